//! The JSON Schema beside a protocol, which editors find by its first line.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::study;
use std::fs;
use std::path::Path;

const LINE: &str = "#:schema protocol.schema.json\n";

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn a_new_study_of_each_kind_names_the_schema_beside_it() {
    let home = tempfile::tempdir().unwrap();
    let (code, schema, _) = study(&["schema"], home.path());
    assert_eq!(code, 0);
    let kinds = "rating factorial pairs 2ifc staircase questplus magnitude mushra yesno abx search identification similarity ranking adjustment";
    for kind in kinds.split(' ') {
        let (code, _, err) = study(&["new", kind, "--kind", kind], home.path());
        assert_eq!((code, err.as_str()), (0, ""));
        let folder = home.path().join(kind);
        assert!(read(&folder, "protocol.toml").starts_with(LINE), "{kind}");
        assert!(read(&folder, "protocol.schema.json") == schema, "{kind}");
    }
}

#[test]
fn the_schema_is_installed_once_and_spares_other_files() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let install = |what: &str| study(&["schema", "--install", what], folder);
    let text = "# mine\nformat = \"study-protocol/1\"\n";
    fs::write(folder.join("protocol.toml"), text).unwrap();
    let (code, out, err) = install(".");
    assert_eq!((code, err.as_str()), (0, ""));
    assert!(out.contains("names it in its first line"), "{out}");
    assert_eq!(read(folder, "protocol.toml"), format!("{LINE}{text}"));

    // An older schema is replaced; the line stays.
    fs::write(
        folder.join("protocol.schema.json"),
        "{\"title\": \"study protocol\"}",
    )
    .unwrap();
    let (code, out, _) = install("protocol.toml");
    assert!(code == 0 && out.contains("names it already"), "{out}");
    assert_eq!(read(folder, "protocol.toml"), format!("{LINE}{text}"));
    let schema = read(folder, "protocol.schema.json");
    assert!(schema.contains("\"max_run\""), "{schema}");

    let other = "#:schema https://example.org/other.json\nformat = 1\n";
    fs::write(folder.join("protocol.toml"), other).unwrap();
    let (code, out, _) = install(".");
    assert!(
        code == 0 && out.contains("names another schema, https://example.org/other.json"),
        "{out}"
    );
    assert_eq!(read(folder, "protocol.toml"), other);

    fs::write(folder.join("protocol.schema.json"), "mine").unwrap();
    let (code, _, err) = install(".");
    assert!(code == 1 && err.contains("this is another file"), "{err}");
    assert_eq!(read(folder, "protocol.schema.json"), "mine");
    for (path, said) in [
        ("nowhere", "there is no such file"),
        ("/dev/null", "it is not a regular file"),
    ] {
        let (code, _, err) = install(path);
        assert!(code == 1 && err.contains(said), "{path}: {err}");
    }
}
