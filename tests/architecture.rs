//! The walls of the house: who may import whom, no circle of files, how long a
//! file may be. docs/architecture.md has the picture.
//!
//! Cargo holds the walls between crates; here stand which crates those are and what
//! Cargo cannot see: the layers inside a crate, circles, and who touches files,
//! clocks and terminals.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const MAX_LINES: usize = 600;
/// main.rs parses, runs, reports.
const MAX_MAIN_LINES: usize = 30;

/// Crate: the crates of this workspace that it may depend on.
const CRATES: &str = "\
study-base:
study-wire:
study-stats:
study-haptics: study-base study-wire
study-plan: study-base study-stats
study-session: study-base study-plan study-wire
study-analysis: study-base study-haptics study-plan study-session study-stats study-wire
study-report: study-analysis study-base study-haptics study-plan study-session study-stats study-wire
study-device: study-base study-haptics study-session study-wire
study: study-analysis study-base study-device study-haptics study-plan study-report study-session study-stats study-wire
study-firmware: study-wire
study-firmware-c: study-wire
";

/// Crates that count as one module of the import table, under this name.
const ONE_MODULE: [(&str, &str); 3] = [
    ("study-stats", "stats"),
    ("study-report", "report"),
    ("study-device", "device"),
];
/// Module: the modules that it may import. `study-base` is open to all who depend on it; the
/// crates of [`ONE_MODULE`] and `study-wire` count as one module each. The last ones are between
/// the modules of study-wire.
const IMPORTS: &str = "\
diagnostic: text
procedure: stats
protocol: procedure stats
schedule: protocol
outcome: procedure protocol
session: procedure protocol schedule outcome
page: protocol session
store: procedure protocol outcome
rendering: protocol outcome wire
analyze: protocol procedure outcome stats
power: protocol procedure outcome analyze stats
export: protocol outcome analyze
import: outcome analyze
preregister: protocol outcome analyze
check: load model power protocol safe_play stats wire
load: archive family identify model preregister protocol recording safe_play schedule store wire
study: analyze load outcome preregister protocol store
model: wire
archive: identify model recording
family: model wire
safe_play: model wire
swing:
trajectory: wire
plant: trajectory wire
identify: model recording wire
device: outcome model plant swing wire
rater: protocol model plant wire
doctor: device store
rehearsal: analyze device load protocol rater runner store
runner: session device store identify outcome protocol rendering model rater safe_play wire
report: archive analyze stats identify load model outcome power preregister procedure protocol recording safe_play store study wire
tui: runner page session outcome protocol
plain: runner page session outcome protocol tui
screen: runner page session protocol
front: runner page session protocol
cli: analyze archive check device doctor export front identify import load model outcome page plain plant power procedure protocol rater recording rehearsal rendering report runner schedule screen session stats store study swing trajectory tui wire
main: cli
certificate: predict
predict: real
estimate: predict real
message: elements frame mechanism predict real
servo: elements mechanism predict real
mechanism: certificate predict real sum
elements: certificate mechanism predict real sum
sum: real
handler: certificate elements frame mechanism message predict real servo
stats:
";

/// Modules that may touch files, clocks, terminals, processes or the network.
const WITH_IO: &[&str] = &[
    "store",
    "tui",
    "plain",
    "screen",
    "front",
    "runner",
    "cli",
    "child",
    "device/link",
    "device/process",
];
const IO: [&str; 8] = [
    "std::fs",
    "std::process",
    "std::net",
    "std::env",
    "Instant::now",
    "SystemTime::now",
    "Local::now",
    "Utc::now",
];

/// A file of one of the crates.
#[derive(Clone)]
struct Source {
    /// Such as `study-plan`.
    package: String,
    /// Path below `src`, such as `store/journal.rs`.
    file: String,
    text: String,
}

impl Source {
    fn new(package: &str, file: &str, text: &str) -> Self {
        Self {
            package: package.to_owned(),
            file: file.to_owned(),
            text: text.to_owned(),
        }
    }

    /// Where it is, for messages.
    fn shown(&self) -> String {
        format!("{}: {}", self.package, self.file)
    }

    /// Its module path inside the crate: `store/journal.rs` is store, journal.
    fn path(&self) -> Vec<&str> {
        match self.file.trim_end_matches(".rs") {
            "lib" => Vec::new(),
            path => path.split('/').collect(),
        }
    }

    /// The module of the import table: the first name, but one for all of a crate
    /// of [`ONE_MODULE`].
    fn module(&self) -> &str {
        let whole = ONE_MODULE
            .iter()
            .find(|(package, _)| *package == self.package);
        whole.map_or_else(
            || self.path().first().copied().unwrap_or("lib"),
            |(_, module)| module,
        )
    }

    /// Its place among the modules with input and output: that of a crate of
    /// [`ONE_MODULE`] begins with its module.
    fn place(&self) -> String {
        let whole = ONE_MODULE
            .iter()
            .find(|(package, _)| *package == self.package);
        let module = whole.map(|(_, module)| *module);
        let path: Vec<&str> = module.into_iter().chain(self.path()).collect();
        path.join("/")
    }

    fn is_test(&self) -> bool {
        self.path().contains(&"tests")
    }

    /// The code: without comments and without its tests.
    fn code(&self) -> String {
        let own = self.text.split("#[cfg(test)]\nmod tests").next();
        (own.unwrap_or(&self.text).lines())
            .map(|line| line.split("//").next().unwrap_or(line))
            .collect::<Vec<_>>()
            .join("\n")
    }

    /// Every path that starts at a crate, `super` or `self`, with the braces of
    /// `use` multiplied out.
    fn paths(&self) -> Vec<Vec<String>> {
        let code = self.code();
        let mut found = Vec::new();
        for start in ["crate::", "super::", "self::", "study_", "study::"] {
            for (at, _) in code.match_indices(start) {
                let before = code[..at].chars().next_back();
                if !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                    tree(&code[at..], &mut Vec::new(), &mut found);
                }
            }
        }
        found
    }
}

/// The paths of a use tree that begins `text`; returns how far it reaches.
fn tree(text: &str, prefix: &mut Vec<String>, found: &mut Vec<Vec<String>>) -> usize {
    let mut at = 0;
    let depth = prefix.len();
    loop {
        let rest = &text[at..];
        let word: String = rest
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_' || *c == '*')
            .collect();
        at += word.len();
        if !word.is_empty() {
            prefix.push(word);
        }
        if !text[at..].starts_with("::") {
            break;
        }
        at += 2;
        if text[at..].starts_with('{') {
            at += 1;
            loop {
                at += text[at..].len() - text[at..].trim_start().len();
                if text[at..].starts_with('}') || text[at..].is_empty() {
                    break;
                }
                at += tree(&text[at..], prefix, found).max(1);
                // what follows an item: `as name`, a comma
                at += text[at..].find([',', '}']).unwrap_or(text.len() - at);
                at += usize::from(text[at..].starts_with(','));
            }
            prefix.truncate(depth);
            return at + 1;
        }
    }
    found.push(prefix.clone());
    prefix.truncate(depth);
    at
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of a package.
fn folder(package: &str) -> PathBuf {
    match package {
        "study" => root().to_owned(),
        "study-firmware" => root().join("firmware"),
        "study-firmware-c" => root().join("firmware/c"),
        _ => root().join("crates").join(package),
    }
}

fn sources() -> Vec<Source> {
    let mut files = Vec::new();
    for package in table(CRATES).into_keys() {
        let src = folder(package).join("src");
        let mut folders = vec![src.clone()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "rs") {
                    let name = path.strip_prefix(&src).unwrap().to_str().unwrap();
                    let text = fs::read_to_string(&path).unwrap();
                    files.push(Source::new(package, &name.replace('\\', "/"), &text));
                }
            }
        }
    }
    files.sort_by(|a, b| (&a.package, &a.file).cmp(&(&b.package, &b.file)));
    assert!(files.len() > 300, "the sources were not found");
    files
}

/// The module of the import table that a path from a file leads to, if it is
/// another one.
fn imported<'a>(from: &'a Source, path: &'a [String]) -> Option<&'a str> {
    let up = path.iter().take_while(|word| *word == "super").count();
    let module = match path[0].as_str() {
        "crate" | "super" if ONE_MODULE.iter().any(|(p, _)| *p == from.package) => return None,
        "super" if up == from.path().len() => path.get(up)?.as_str(),
        "study_base" => return None,
        "study_wire"
            if !["study-firmware", "study-firmware-c"].contains(&from.package.as_str()) =>
        {
            "wire"
        }
        "crate" | "study" | "study_haptics" | "study_plan" | "study_session" | "study_analysis" => {
            path.get(1)?.as_str()
        }
        name => {
            let whole = |(package, _): &&(&str, &str)| package.replace('-', "_") == name;
            ONE_MODULE.iter().find(whole)?.1
        }
    };
    (module != from.module()).then_some(module)
}

/// The lines of a table: a name, and the names after its colon.
fn table(text: &'static str) -> BTreeMap<&'static str, BTreeSet<&'static str>> {
    let lines = text.lines().map(|line| line.split_once(':').unwrap());
    lines
        .map(|(name, others)| (name, others.split_whitespace().collect()))
        .collect()
}

/// What is wrong with single files.
fn violations(files: &[Source]) -> Vec<String> {
    let allowed = table(IMPORTS);
    let known: BTreeSet<&str> = files.iter().map(Source::module).chain(["wire"]).collect();
    let mut wrong = Vec::new();
    for source in files {
        let (shown, module) = (source.shown(), source.module());
        let lines = source.text.lines().count();
        let most = if source.file == "main.rs" {
            MAX_MAIN_LINES
        } else {
            MAX_LINES
        };
        if lines > most {
            wrong.push(format!("{shown} has {lines} lines, more than {most}"));
        }
        if source.file.ends_with("mod.rs") {
            wrong.push(format!("{shown}: name.rs + name/, never mod.rs"));
        }
        if source.is_test() {
            continue;
        }
        for path in source.paths() {
            let Some(import) = imported(source, &path) else {
                continue;
            };
            let may = allowed.get(module).is_some_and(|may| may.contains(import));
            let open = source.package == "study-base" && import == "text";
            if known.contains(import) && !may && !open {
                wrong.push(format!("{shown} imports {import}"));
            }
        }
        let with_io =
            source.file == "main.rs" || WITH_IO.iter().any(|m| source.place().starts_with(m));
        if !with_io {
            for word in IO {
                if source.code().contains(word) {
                    wrong.push(format!("{shown} uses {word}"));
                }
            }
        }
    }
    wrong.dedup();
    wrong
}

/// What the tables permit and nobody needs.
fn unused(files: &[Source]) -> Vec<String> {
    let mut left = table(IMPORTS);
    let mut io: BTreeSet<&str> = WITH_IO.iter().copied().collect();
    for source in files.iter().filter(|s| !s.is_test()) {
        for path in source.paths() {
            if let Some(import) = imported(source, &path)
                && let Some(may) = left.get_mut(source.module())
            {
                may.remove(import);
            }
        }
        let code = source.code();
        if IO.iter().any(|word| code.contains(word)) {
            io.retain(|m| !source.place().starts_with(m));
        }
    }
    let imports = left
        .into_iter()
        .flat_map(|(module, may)| may.into_iter().map(move |m| (module, m)))
        .map(|(module, may)| format!("{module} may import {may} and does not"));
    let io = io
        .into_iter()
        .map(|m| format!("{m} may do input and output and does not"));
    imports.chain(io).collect()
}

/// Circles among the children of each folder. A child is a file with the folder of
/// its name; what a file takes from its own parents and children is no arrow.
fn circles(files: &[Source]) -> Vec<String> {
    type Uses = BTreeMap<String, BTreeSet<String>>;
    // (crate, folder) → child → the children that it uses
    let mut arrows: BTreeMap<(&str, Vec<String>), Uses> = BTreeMap::new();
    for source in files.iter().filter(|s| !s.is_test()) {
        let modules: BTreeSet<Vec<&str>> = files
            .iter()
            .filter(|s| s.package == source.package)
            .map(Source::path)
            .collect();
        let own = source.path();
        for path in source.paths() {
            let mut at: Vec<&str> = match path[0].as_str() {
                "crate" => Vec::new(),
                "super" | "self" => own.clone(),
                _ => continue,
            };
            for word in &path {
                match word.as_str() {
                    "crate" | "self" => {}
                    "super" => drop(at.pop()),
                    word => {
                        at.push(word);
                        if !modules.contains(&at) {
                            at.pop();
                            break;
                        }
                    }
                }
            }
            let common = own.iter().zip(&at).take_while(|(a, b)| a == b).count();
            if let (Some(from), Some(to)) = (own.get(common), at.get(common)) {
                let folder = own[..common].iter().map(|s| (*s).to_owned()).collect();
                (arrows.entry((&source.package, folder)).or_default())
                    .entry((*from).to_owned())
                    .or_default()
                    .insert((*to).to_owned());
            }
        }
    }
    let mut found = Vec::new();
    for ((package, folder), uses) in arrows {
        // What no child within the rest uses, and what uses no child within the
        // rest, is on no circle.
        let mut rest: BTreeSet<&String> = uses.keys().collect();
        loop {
            let on_circle = |child: &String| {
                let ahead = uses[child].iter().any(|to| rest.contains(to));
                ahead && rest.iter().any(|from| uses[*from].contains(child))
            };
            let kept: BTreeSet<&String> = rest.iter().copied().filter(|c| on_circle(c)).collect();
            if kept.len() == rest.len() {
                break;
            }
            rest = kept;
        }
        if !rest.is_empty() {
            let names: Vec<&str> = rest.iter().map(|s| s.as_str()).collect();
            let place = [&[package.to_owned()], folder.as_slice()]
                .concat()
                .join("/");
            found.push(format!("{place}: circle of {}", names.join(", ")));
        }
    }
    found
}

/// The crates of this workspace in a section of a manifest.
fn dependencies(manifest: &toml::Table, section: &str) -> BTreeSet<String> {
    let Some(table) = manifest.get(section).and_then(toml::Value::as_table) else {
        return BTreeSet::new();
    };
    let names = table.keys().filter(|k| k.starts_with("study"));
    names.cloned().collect()
}

#[test]
fn crates_depend_on_what_the_table_says() {
    for (package, allowed) in table(CRATES) {
        let text = fs::read_to_string(folder(package).join("Cargo.toml")).unwrap();
        let manifest: toml::Table = text.parse().unwrap();
        let used = dependencies(&manifest, "dependencies");
        assert!(used.iter().eq(allowed), "{package}: {used:?}");
        let of_tests = dependencies(&manifest, "dev-dependencies");
        assert!(of_tests.is_empty(), "{package}: {of_tests:?}");
    }
}

#[test]
fn every_module_imports_only_what_the_table_allows() {
    let wrong = violations(&sources());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_permission_is_used() {
    let unused = unused(&sources());
    assert!(unused.is_empty(), "{}", unused.join("\n"));
}

#[test]
fn no_folder_has_a_circle_of_files() {
    let found = circles(&sources());
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn a_planted_violation_is_found() {
    let planted = |package: &str, file: &str, text: &str| {
        let mut files = sources();
        let before: BTreeSet<String> = violations(&files).into_iter().collect();
        files.push(Source::new(package, file, text));
        let mut found = violations(&files);
        found.retain(|v| !before.contains(v));
        found
    };
    for (package, file, text, expected) in [
        (
            "study",
            "tui/views/x.rs",
            "use study_session::{outcome::FormId, store::{Journal, x}};\n",
            "study: tui/views/x.rs imports store",
        ),
        (
            "study",
            "tui/x.rs",
            "fn f() { study_device::g() }\n",
            "study: tui/x.rs imports device",
        ),
        (
            "study-session",
            "session/x.rs",
            "use crate::store::Journal;\n",
            "study-session: session/x.rs imports store",
        ),
        (
            "study-analysis",
            "analyze/x.rs",
            "fn f() { std::fs::read(\"x\"); }\n",
            "study-analysis: analyze/x.rs uses std::fs",
        ),
        (
            "study-session",
            "session/x.rs",
            "fn f() { let t = Instant::now(); }\n",
            "study-session: session/x.rs uses Instant::now",
        ),
        (
            "study-stats",
            "x.rs",
            &"\n".repeat(601),
            "study-stats: x.rs has 601 lines, more than 600",
        ),
    ] {
        assert_eq!(planted(package, file, text), [expected]);
    }
    let linked = "/// See [`study_device`].\n";
    assert!(planted("study-session", "session/x.rs", linked).is_empty());
}

#[test]
fn a_planted_circle_is_found() {
    let planted = |files: &[(&str, &str)]| {
        let mut all = sources();
        let before: BTreeSet<String> = circles(&all).into_iter().collect();
        all.extend(files.iter().map(|(f, t)| Source::new("study-stats", f, t)));
        let mut found = circles(&all);
        found.retain(|v| !before.contains(v));
        found
    };
    assert_eq!(
        planted(&[
            ("x.rs", "use super::{y::{Y, Z as W}, rank};\n"),
            ("y.rs", "fn f() { crate::z::deep::g() }\n"),
            ("z.rs", "pub mod deep;\n"),
            ("z/deep.rs", "use super::super::x::X;\n"),
        ]),
        ["study-stats: circle of x, y, z"]
    );
    // a chain and a parent with its child are none
    let chain = [
        ("x.rs", "use super::y::Y;\nuse super::rank;\n"),
        ("y.rs", "pub mod child;\nuse child::C;\n"),
        ("y/child.rs", "use super::Y;\n"),
    ];
    assert!(planted(&chain).is_empty());
}

#[test]
fn a_permission_that_nobody_uses_is_found() {
    // without the terminal's files nobody needs what only they need
    let mut files = sources();
    files.retain(|s| s.module() != "tui");
    let found = unused(&files);
    assert!(
        found.contains(&"tui may import session and does not".to_owned()),
        "{found:?}"
    );
    assert!(found.contains(&"tui may do input and output and does not".to_owned()));
}
