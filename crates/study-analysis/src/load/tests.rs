use super::*;
use std::fs;

/// The order of row 1 is valid, that of row 2 is not.
const PROTOCOL: &str = r#"
format = "study-protocol/1"
study = { id = "example", title = "An example", seed = 2007 }
design = { participants = 1, repetitions = 3, order = "williams", min_distance = 3 }
device = { kind = "manual", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
trial = { reference = "Operate the real switch." }
models = [{ id = "A" }, { id = "B" }, { id = "C" }, { id = "D" }, { id = "E" }]
analysis = { primary = "realism" }

[[questions]]
id = "realism"
kind = "rating"
prompt = "How realistic did it feel?"
from = 1
to = 7
labels = { 1 = "not at all realistic", 7 = "very realistic" }
"#;

#[test]
fn a_study_that_has_started_goes_on_even_if_some_of_its_orders_are_invalid() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(FILE_NAME);
    fs::write(&path, PROTOCOL).unwrap();
    assert!(load(&path).is_err());
    let results = folder.path().join("results");
    assert!(load_for(&path, &results).is_err());

    let study = results.join("example");
    fs::create_dir_all(&study).unwrap();
    fs::write(study.join(layout::MANIFEST), "").unwrap();
    for results in [&results, &study] {
        let loaded = load_for(&path, results).unwrap();
        let mut faults = loaded.findings.iter().flat_map(|f| &f.faults);
        assert!(faults.any(|f| f.message.starts_with("row 2, position 12: ")));
    }
    assert!(load_frozen(&path).is_ok());
}
