//! The identifiers in `docs/statistics*.md` and in the JSON Schema are those of the declared
//! statistics. `UPDATE_DOCS=1 cargo test --test analyze docs` writes them.
#![allow(clippy::unwrap_used)]

use crate::json_schema::{begins, fits};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;
use study_analysis::analyze::psychophysics::results::PartResults;
use study_analysis::analyze::results::{Declared, Field as _, Results};
use study_analysis::analyze::{Rules, analyze};
use study_session::outcome::ratings::Ratings;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const START: &str = "<!-- The statistics: written by a test from their declarations. -->\n";
const END: &str = "<!-- End of the statistics. -->\n";

/// The document that defines the statistics of a group of ratings.
fn document(id: &str) -> &'static str {
    match id {
        _ if id.starts_with("lmm_") || id == "slope_variance" => "statistics-mixed",
        _ if id.starts_with("clm") => "statistics-ordinal",
        _ => "statistics",
    }
}

/// The name of the group of an identifier.
fn first(id: &str) -> &str {
    id.split('/').next().unwrap_or_default()
}

fn of_parts() -> Vec<Declared> {
    let mut all = Vec::new();
    PartResults::declare("", "", &mut all);
    all
}

/// A table of the statistics whose identifiers begin alike, and where each record is.
struct Section {
    document: &'static str,
    id: String,
    about: Vec<String>,
    rows: Vec<(String, String)>,
}

/// The sections of the documents, in the order of the declarations.
#[derive(Default)]
struct Sections {
    all: Vec<Section>,
    /// Whether the statistics are those of parts that are no ratings.
    of_parts: bool,
    /// Where each record is in full.
    written: BTreeMap<&'static str, String>,
}

impl Sections {
    /// The section of an identifier.
    fn section(&mut self, id: &str) -> &mut Section {
        let group = first(id);
        let document = match self.of_parts {
            true => "statistics-psychophysics",
            false => document(group),
        };
        let is_it = |s: &Section| first(&s.id) == group && s.document == document;
        let at = self.all.iter().position(is_it).unwrap_or_else(|| {
            self.all.push(Section {
                document,
                id: id.to_owned(),
                about: Vec::new(),
                rows: Vec::new(),
            });
            self.all.len() - 1
        });
        &mut self.all[at]
    }

    /// Adds declarations of the record with this identifier.
    fn add(&mut self, of: &str, declared: &[Declared]) {
        let mut rest = declared;
        while let [first, after @ ..] = rest {
            rest = after;
            match first {
                Declared::Statistic { id, doc, list } => {
                    let list = if *list { " (a list)" } else { "" };
                    self.row(id, &format!("{}{list}", line(doc)));
                }
                Declared::Group { id, own: count, .. } => {
                    let (own, after) = rest.split_at(*count);
                    rest = after;
                    match id.as_str() {
                        "" => self.add("", own),
                        _ => self.group(of, first, own),
                    }
                }
            }
        }
    }

    /// Adds a group; `of` is the identifier of the record that has it.
    fn group(&mut self, of: &str, group: &Declared, own: &[Declared]) {
        let Declared::Group {
            id,
            doc,
            about,
            record,
            ..
        } = group
        else {
            return;
        };
        let (doc, about) = (line(doc), line(about));
        let is_first = self.section(id).id == *id && of != id;
        if let Some(written) = self.written.get(record) {
            let text = format!("{doc}: as `{written}/…`");
            let names = own.iter().filter_map(|declared| match declared {
                Declared::Statistic { id, .. } => Some(id.as_str()),
                Declared::Group { .. } => None,
            });
            return match (is_first, of == id) {
                (true, _) => self.section(id).about.push(text),
                (false, true) => self.row(&names.collect::<Vec<_>>().join(" "), &text),
                (false, false) => self.row(&format!("{id}/…"), &text),
            };
        }
        self.written.insert(record, id.clone());
        let about = match doc.to_lowercase() == about.to_lowercase() {
            true => about,
            false => format!("{}. {about}", doc.trim_end_matches('?')),
        };
        match is_first {
            true => self.section(id).about.push(about),
            false => self.row(&format!("{id}/…"), &about),
        }
        self.add(id, own);
    }

    fn row(&mut self, id: &str, text: &str) {
        let section = self.section(id);
        // The ends of an interval are one row.
        if let (Some((last, before)), Some(stem)) =
            (section.rows.last_mut(), id.strip_suffix("_hi"))
            && before == text
            && *last == format!("{stem}_lo")
        {
            *last = format!("{last} {id}");
            return;
        }
        section.rows.push((id.to_owned(), text.to_owned()));
    }
}

fn line(doc: &str) -> String {
    let doc = doc.split_whitespace().collect::<Vec<_>>().join(" ");
    doc.trim_end_matches('.').to_owned()
}

/// The sections of a document.
fn page(name: &str) -> String {
    let mut sections = Sections::default();
    sections.add("", &Results::declared());
    sections.of_parts = true;
    sections.add("", &of_parts());
    let mut out = String::new();
    for section in &sections.all {
        if section.document != name {
            continue;
        }
        let _ = writeln!(out, "\n### `{}`\n", first(&section.id));
        for about in &section.about {
            let _ = writeln!(out, "{}.\n", capital(about));
        }
        if !section.rows.is_empty() {
            out.push_str("| identifier | what it is |\n|---|---|\n");
        }
        for (ids, text) in &section.rows {
            let ids: Vec<String> = ids.split(' ').map(|id| format!("`{id}`")).collect();
            let [ids, text] = [&ids.join(", "), text].map(|cell| cell.replace('|', "\\|"));
            let _ = writeln!(out, "| {ids} | {text} |");
        }
    }
    out.push('\n');
    out
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

fn statistics(all: Vec<Declared>) -> Vec<(String, &'static str, bool)> {
    let all = all.into_iter();
    all.filter_map(|declared| match declared {
        Declared::Statistic { id, doc, list } => Some((id, doc, list)),
        Declared::Group { .. } => None,
    })
    .collect()
}

/// What stands for names of the data.
const NAMES: [&str; 23] = [
    "M",
    "R",
    "D",
    "S",
    "NAME",
    "SITE",
    "PARTICIPANT",
    "CONDITION",
    "LABEL",
    "RIGHT",
    "GIVEN",
    "K",
    "PROPERTY",
    "N",
    "GROUP",
    "PARAMETER",
    "ITEM",
    "X",
    "P",
    "OUTCOME",
    "EFFECT",
    "FACTOR=LEVEL",
    "FACTOR=a|b",
];

/// Regular expressions of the identifiers of a statistic.
fn patterns(id: &str) -> Vec<String> {
    let part = |part: &str| match part {
        "a|b" | "A|B" | "j|k" => r"[^/|]+\|[^/|]+".to_owned(),
        name if NAMES.contains(&name) => "[^/]+".to_owned(),
        word => word.to_owned(),
    };
    let parts: Vec<String> = id.split('/').map(part).collect();
    let pattern = format!("^{}$", parts.join("/"));
    // Some questions are about something with a name.
    let question = |form: &str| pattern.replace("QUESTION", form);
    match pattern.contains("QUESTION") {
        true => vec![question("[^/]+"), question("[^/]+/[^/]+")],
        false => vec![pattern],
    }
}

fn all_patterns(all: Vec<Declared>) -> Vec<String> {
    let all = statistics(all);
    all.iter().flat_map(|s| patterns(&s.0)).collect()
}

/// The part of the schema that describes the statistics.
fn described(declared: Vec<Declared>) -> Value {
    let schemas = statistics(declared)
        .into_iter()
        .flat_map(|(id, doc, list)| {
            let of = if list { "list" } else { "statistic" };
            let schema = json!({ "$ref": format!("#/$defs/{of}"), "description": line(doc) });
            let of = move |pattern| (pattern, schema.clone());
            patterns(&id).into_iter().map(of)
        });
    json!({
        "type": "object",
        "description": "statistics by identifier; null if undefined",
        "patternProperties": schemas.collect::<Map<_, _>>(),
        "additionalProperties": false,
    })
}

/// JSON of which a line has what fits.
fn printed(value: &Value, indent: usize) -> String {
    let whole = value.to_string();
    if indent + whole.len() <= 120 {
        return whole;
    }
    let inside = " ".repeat(indent + 2);
    let (parts, [open, close]) = match value {
        Value::Object(object) => {
            let part =
                |(key, value)| format!("{inside}{}: {}", json!(key), printed(value, indent + 2));
            (object.iter().map(part).collect(), ["{", "}"])
        }
        Value::Array(list) => {
            let part = |value| format!("{inside}{}", printed(value, indent + 2));
            (list.iter().map(part).collect::<Vec<_>>(), ["[", "]"])
        }
        _ => return whole,
    };
    format!(
        "{open}\n{}\n{}{close}",
        parts.join(",\n"),
        " ".repeat(indent)
    )
}

/// Compares a file with what it should be, or writes it.
fn compare(path: &Path, wanted: &str) {
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(path, wanted).unwrap();
    }
    assert!(
        fs::read_to_string(path).unwrap() == wanted,
        "{} differs from the declared statistics: `UPDATE_DOCS=1 cargo test --test analyze docs` \
         writes it again",
        path.display()
    );
}

#[test]
fn the_documents_have_the_declared_statistics() {
    for name in [
        "statistics",
        "statistics-mixed",
        "statistics-ordinal",
        "statistics-psychophysics",
    ] {
        let path = Path::new(ROOT).join(format!("docs/{name}.md"));
        let text = fs::read_to_string(&path).unwrap();
        let (before, rest) = text.split_once(START).unwrap();
        let (_, after) = rest.split_once(END).unwrap();
        compare(&path, &format!("{before}{START}{}{END}{after}", page(name)));
    }
}

#[test]
fn the_schemas_have_the_declared_statistics() {
    let mut ratings = study_report::json::schema();
    ratings["properties"]["values"] = described(Results::declared());
    let mut parts = study_report::json::parts_schema();
    parts["properties"]["parts"]["items"]["properties"]["values"] = described(of_parts());
    for (name, mut schema) in [("analysis", ratings), ("parts", parts)] {
        schema["$defs"] = json!({
            "statistic": { "type": ["number", "null"] },
            "list": { "type": ["array", "null"], "items": { "type": "number" } },
        });
        let path = Path::new(ROOT).join(format!("docs/study-{name}-1.schema.json"));
        compare(&path, &(printed(&schema, 0) + "\n"));
    }
}

#[test]
fn what_an_analysis_has_is_declared() {
    let patterns = all_patterns(Results::declared());
    for set in ["sim_paper", "sim_one_rep", "nist_norris", "nist_numacc1"] {
        let path = Path::new(ROOT).join(format!("tests/golden/data/{set}/data.csv"));
        let file = BufReader::new(File::open(path).unwrap());
        let ratings = Ratings::read_csv(set, file, None).unwrap();
        let rules = Rules {
            realistic_from: Some(5.0),
            ..Rules::default()
        };
        for (id, _) in analyze(&ratings, &rules).values.iter() {
            assert!(patterns.iter().any(|p| fits(p, id)), "{id} of {set}");
        }
    }
}

/// The script of `study export --to r` computes statistics under their identifiers.
#[test]
fn the_identifiers_in_the_r_script_are_declared() {
    let path = Path::new(ROOT).join("crates/study-analysis/src/export/analysis.R");
    let script = fs::read_to_string(path).unwrap();
    let written = |start| script.split(start).skip(1);
    let ids = |start| written(start).filter_map(|rest: &str| rest.split('"').next());
    let of_ratings: Vec<&str> = ids("value[\"").collect();
    let of_others: Vec<&str> = ids("put(\"").collect();
    assert!(of_ratings.len() > 10 && of_others.len() > 10);
    for (ids, declared) in [(of_ratings, Results::declared()), (of_others, of_parts())] {
        let patterns = all_patterns(declared);
        for id in ids {
            let known = match id.strip_suffix('/') {
                // A name follows.
                Some(id) => patterns.iter().any(|p| begins(p, id)),
                None => patterns.iter().any(|p| fits(p, id)),
            };
            assert!(known, "{id}");
        }
    }
}

/// Code spans of the documents that begin with the name of a group are identifiers, or the
/// beginning of some.
#[test]
fn the_identifiers_in_the_documents_are_declared() {
    let mut declared = Results::declared();
    declared.extend(of_parts());
    let groups = statistics(declared.clone());
    let groups: BTreeSet<&str> = groups.iter().map(|s| first(&s.0)).collect();
    let patterns = all_patterns(declared);
    let mut seen = 0;
    let mut unknown = BTreeSet::new();
    for entry in fs::read_dir(Path::new(ROOT).join("docs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "md") {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        for id in text.split('`').skip(1).step_by(2) {
            let word = |c: char| c.is_ascii_alphanumeric() || "_/|-".contains(c);
            if !id.contains('/') || !id.chars().all(word) || !groups.contains(first(id)) {
                continue;
            }
            seen += 1;
            let known = |id: &str| patterns.iter().any(|p| begins(p, id));
            // The name of a question begins like a group.
            let is_question = id == "equivalence/R";
            if !known(id) && !known(&format!("{id}_lo")) && !is_question {
                unknown.insert(format!("{id} in {}", path.display()));
            }
        }
    }
    assert!(seen > 100, "{seen}");
    assert!(unknown.is_empty(), "{unknown:#?}");
}
