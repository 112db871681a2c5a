//! `study stimulus`: bundles, protocols that take their models from bundles, catalogues.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use assert_cmd::Command;
use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;
use std::fs;
use std::path::{Path, PathBuf};
use study_base::hex::sha256;
use study_haptics::archive::{Bundle, Stated};
use study_report::catalogue;

/// Models of protocols/keyboard and the curves that they were identified from.
const SWITCHES: [(&str, &str); 2] = [("akko-blue", "Akko_Blue_V2"), ("jwk-bluey", "JWK_Bluey")];
const CREDIT: &str = "measured by ThereminGoat (theremingoat.com)";
const STATED: [&str; 6] = [
    "--license",
    "any use, with credit",
    "--instrument",
    "a force tester",
    "--published",
    "2024-05-17",
];

fn study(args: &[&str], folder: &Path) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("study").unwrap();
    command.args(args).current_dir(folder).assert()
}

fn repository(path: &str) -> String {
    format!("{}/{path}", env!("CARGO_MANIFEST_DIR"))
}

/// Imports and packs a switch in a folder of its own, as a lab does, from a file with a name of its own; returns the bundle.
fn packed(lab: &Path, (id, curve): (&str, &str)) -> PathBuf {
    fs::create_dir_all(lab).unwrap();
    let shared = repository(&format!("tests/data/switches/{curve}.csv"));
    let whose = lab.file_name().unwrap().to_string_lossy();
    let curve = format!("{curve}-{whose}.csv");
    fs::copy(shared, lab.join(&curve)).unwrap();
    let model = repository(&format!("protocols/keyboard/models/{id}.toml"));
    let recording = format!("{id}.csv");
    let import = ["import", "force-curve", &curve, "-o", &recording, "--force"];
    study(&[&import[..], &["--credit", CREDIT]].concat(), lab).success();
    let pack = [&["stimulus", "pack", &model, &recording][..], &STATED].concat();
    let told = study(&pack, lab).success().get_output().stdout.clone();
    let address = String::from_utf8(told).unwrap();
    let address = address.trim().strip_prefix("sha256:").unwrap();
    lab.join(format!("bundles/{address}.tar"))
}

#[test]
fn two_labs_pack_the_same_bytes_and_unpack_what_they_packed() {
    let home = tempfile::tempdir().unwrap();
    let [a, b] = ["utah/lab", "bern"].map(|lab| packed(&home.path().join(lab), SWITCHES[0]));
    let bytes = fs::read(&a).unwrap();
    assert_eq!(bytes, fs::read(&b).unwrap());
    assert_eq!(a.file_stem().unwrap().to_str().unwrap(), sha256(&bytes));

    let out = home.path().join("out");
    let [from, to] = [&a, &out].map(|path| path.to_str().unwrap());
    study(&["stimulus", "unpack", from, "--out", to], home.path()).success();
    let model = repository("protocols/keyboard/models/akko-blue.toml");
    assert_eq!(
        fs::read(out.join("model.toml")).unwrap(),
        fs::read(model).unwrap()
    );
    let recording = home.path().join("bern/akko-blue.csv");
    assert_eq!(
        fs::read(out.join("recordings/01.csv")).unwrap(),
        fs::read(recording).unwrap()
    );
    study(&["stimulus", "unpack", from, "--out", to], home.path())
        .code(1)
        .stderr(contains("not an empty folder"));

    let other = packed(home.path(), SWITCHES[1]);
    let other = other.to_str().unwrap();
    study(
        &["stimulus", "diff", from, b.to_str().unwrap()],
        home.path(),
    )
    .success()
    .stdout("no difference\n");
    study(&["stimulus", "diff", from, other], home.path())
        .success()
        .stdout(
            contains("id: \"akko-blue\" → \"jwk-bluey\"\n")
                .and(contains("recordings 1: rows: 2165 → 2394\n")),
        );

    let mut wrong = bytes;
    let at = wrong.len() / 2;
    wrong[at] ^= 1;
    fs::write(home.path().join("wrong.tar"), wrong).unwrap();
    study(&["stimulus", "verify", "wrong.tar", from], home.path())
        .code(1)
        .stdout(contains("akko-blue, sha256:"))
        .stderr(
            contains("wrong.tar: refused: recordings/01.csv was changed")
                .and(contains("1 bundle refused")),
        );
    // a name that is the address of another bundle
    let renamed = format!("{}.tar", "0".repeat(64));
    fs::copy(&a, home.path().join(&renamed)).unwrap();
    study(&["stimulus", "verify", &renamed], home.path())
        .code(1)
        .stderr(contains(
            "its name is an address, and it is the bundle sha256:",
        ));
    fs::remove_file(home.path().join(&renamed)).unwrap();
    let model = repository("protocols/keyboard/models/jwk-bluey.toml");
    study(&["stimulus", "pack", &model, "jwk-bluey.csv"], home.path())
        .code(1)
        .stderr(contains("the license is not stated").and(contains("--license")));
    study(&["stimulus", "site", ".", "--out", "site"], home.path())
        .code(1)
        .stderr(contains("wrong.tar: refused"));
    assert!(!home.path().join("site").exists());
}

const PROTOCOL: &str = r#"format = "study-protocol/1"
study = { id = "keys", title = "Keys", seed = 7 }
design = { participants = 2, repetitions = 2, order = "blocked", practice = ["akko-blue"] }
device = { kind = "simulated", limits = { force_n = 3.0, velocity_mm_s = 400.0 } }
analysis = { primary = "realism" }

[[models]]
id = "akko-blue"
file = "models/akko-blue.toml"

[[models]]
id = "jwk-bluey"
file = "models/jwk-bluey.toml"

[[models]]
id = "again"
duplicate_of = "akko-blue"

[[questions]]
id = "realism"
kind = "rating"
prompt = "How much did it feel like a key?"
from = 1
to = 7
labels = { 1 = "not at all", 7 = "exactly" }
"#;

/// All files below a folder, without what is told of the protocol itself.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => found.push((
                    path.strip_prefix(folder).unwrap().to_owned(),
                    fs::read(&path).unwrap(),
                )),
            }
        }
    }
    found.sort();
    found
}

#[test]
fn a_session_with_bundles_is_the_one_with_files() {
    let home = tempfile::tempdir().unwrap();
    let [with_files, with_bundles] = ["files", "own"].map(|name| home.path().join(name));
    fs::create_dir_all(with_files.join("models")).unwrap();
    let [akko, jwk] = SWITCHES.map(|switch| {
        let name = format!("models/{}.toml", switch.0);
        let model = repository(&format!("protocols/keyboard/{name}"));
        fs::copy(model, with_files.join(name)).unwrap();
        packed(&with_bundles, switch)
    });
    fs::write(with_files.join("protocol.toml"), PROTOCOL).unwrap();
    fs::copy(&jwk, with_bundles.join("jwk.tar")).unwrap();
    let address = akko.file_stem().unwrap().to_str().unwrap();
    let of_bundles = PROTOCOL
        .replace(
            "file = \"models/akko-blue.toml\"",
            &format!("bundle = \"sha256:{address}\""),
        )
        .replace("file = \"models/jwk-bluey.toml\"", "bundle = \"jwk.tar\"");
    let protocol = with_bundles.join("protocol.toml");
    fs::write(&protocol, &of_bundles).unwrap();

    let [files_of, bundles_of] = ["files", "own"].map(|name| {
        let out = format!("results-{name}");
        study(
            &["rehearse", name, "--participants", "1", "--out", &out],
            home.path(),
        )
        .success();
        study(&["verify", &out], home.path()).success();
        files(&home.path().join(out).join("keys"))
    });
    let sessions = |all: &[(PathBuf, Vec<u8>)]| -> Vec<(PathBuf, Vec<u8>)> {
        let is_session =
            |path: &Path| path.starts_with("sessions") || path == Path::new("ratings.csv");
        all.iter()
            .filter(|(path, _)| is_session(path))
            .cloned()
            .collect()
    };
    let (a, b) = (sessions(&files_of), sessions(&bundles_of));
    assert!(
        a.len() > 7,
        "telemetry of seven trials and the rest: {}",
        a.len()
    );
    for (one, other) in a.iter().zip(&b) {
        assert_eq!(one.0, other.0);
        assert!(one.1 == other.1, "{} differs", one.0.display());
    }
    assert_eq!(a.len(), b.len());
    // the bundle is frozen with the study
    let frozen = Path::new("protocol/1/bundles").join(format!("{address}.tar"));
    assert!(bundles_of.iter().any(|(path, _)| *path == frozen));

    // A bundle that is another one, or none, is refused before any session.
    let check = |text: &str, cause: &str| {
        fs::write(&protocol, text).unwrap();
        study(&["check", "own"], home.path())
            .code(1)
            .stderr(contains(cause));
    };
    let missing = of_bundles.replace(address, &"0".repeat(64));
    check(&missing, "the bundle file cannot be read");
    fs::copy(
        &akko,
        with_bundles.join(format!("bundles/{}.tar", "0".repeat(64))),
    )
    .unwrap();
    check(&missing, "its address is sha256:");
    fs::write(with_bundles.join("jwk.tar"), "PK").unwrap();
    check(
        &of_bundles,
        "the bundle is refused: it is not a tar archive",
    );
    check(
        &of_bundles.replace("jwk.tar", "../jwk.tar"),
        "has to stay inside the protocol's folder",
    );
    check(
        &of_bundles.replace("sha256:", "sha256:x"),
        "is no address of a bundle",
    );
    let both = of_bundles.replace(
        "bundle = \"jwk.tar\"",
        "bundle = \"jwk.tar\"\nfile = \"a.toml\"",
    );
    check(&both, "has a `file` and a `bundle`");
}

#[test]
fn a_catalogue_is_pages_in_four_orders() {
    let home = tempfile::tempdir().unwrap();
    for switch in SWITCHES {
        packed(home.path(), switch);
    }
    study(
        &["stimulus", "site", "bundles", "--out", "site"],
        home.path(),
    )
    .success();
    let site = files(&home.path().join("site"));
    assert_eq!(site.len(), 8, "four pages, two pictures, two bundles");
    let page = |name: &str| fs::read_to_string(home.path().join("site").join(name)).unwrap();
    for name in ["index", "by-force", "by-travel", "by-tactility"] {
        let text = page(&format!("{name}.html"));
        let order = |id: &str| text.find(&format!("<h2>{id}</h2>")).unwrap();
        // jwk-bluey is a linear switch with a longer travel
        let akko_first = order("akko-blue") < order("jwk-bluey");
        assert_eq!(akko_first, name == "index" || name == "by-travel", "{name}");
        assert!(!text.contains("<script") && !text.contains("javascript:"));
    }
    let index = page("index.html").replace(env!("CARGO_PKG_VERSION"), "VERSION");
    insta::assert_snapshot!(index.replace("><", ">\n<"));
}

#[test]
fn hostile_texts_stay_texts_in_a_catalogue() {
    let recording = b"t_s,x_mm,f_n\n0,0,1\n1,1,2\n2,0,1\n".to_vec();
    let model = format!(
        "format = \"study-model/1\"\nid = \"a\"\nlookup = \"linear\"\ndirection = {{ rule = \"sign\" }}\n\
         trained = {{ x_mm = [0.0, 1.0], v_mm_s = 1.0 }}\nx_mm = [0.0, 1.0]\n\
         [provenance]\nmethod = \"</dd><script>alert(1)</script>\\u202e\\u001b[2J\"\n\
         [provenance.recordings]\n\"<b>../../x</b>\" = \"{}\"\n[vaf]\n\"\\\"><img src=x>\" = 0.5\n\
         [positive]\nm_kg = [0.0, 0.0]\nb_n_s_per_mm = [0.0, 0.0]\nk_n_per_mm = [0.0, 0.0]\nf0_n = [1.0, 2.0]\n\
         [negative]\nm_kg = [0.0, 0.0]\nb_n_s_per_mm = [0.0, 0.0]\nk_n_per_mm = [0.0, 0.0]\nf0_n = [0.5, 1.0]\n",
        sha256(&recording)
    );
    let stated = Stated {
        license: "\"><script>".to_owned(),
        credit: "<img src=x onerror=alert(1)>".to_owned(),
        instrument: "&lt;b onclick='x'>".to_owned(),
        published: "2024-05-17".to_owned(),
    };
    let bundle = Bundle::pack(model.as_bytes(), vec![("r".to_owned(), recording)], stated).unwrap();
    let bundle = Bundle::open(bundle.bytes()).unwrap();
    for (name, text) in catalogue::files(&[bundle.clone(), bundle]) {
        assert!(!name.contains(".."), "{name}");
        for bad in ["<script", "<img src=x", "<b", "\u{202e}", "\u{1b}"] {
            let body = text.find("<body").unwrap_or_default();
            let found = text[body..].match_indices(bad);
            // <body> itself
            let found = found
                .filter(|(at, _)| !text[body + at..].starts_with("<body"))
                .count();
            assert_eq!(found, 0, "{name}: {bad:?}");
        }
        let cards = text.matches("<article").count();
        assert!(
            cards == usize::from(name.ends_with(".html")),
            "the same bundle twice is one"
        );
    }
}
