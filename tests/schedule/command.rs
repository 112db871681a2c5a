//! The arguments of `study schedule`.

use assert_cmd::Command;
use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;

fn rows(given: &str) -> assert_cmd::assert::Assert {
    Command::cargo_bin("study")
        .expect("the binary is built with its tests")
        .args(["schedule", "protocol.toml", &format!("--rows={given}")])
        .assert()
}

#[test]
fn invalid_rows_are_a_usage_error_with_an_explanation() {
    rows("0").code(2).stderr(contains("rows count from 1"));
    rows("40-1").code(2).stderr(contains("did you mean 1-40?"));
    rows("-3").code(2).stderr(contains("a range such as 1-40"));
    rows("1-x").code(2).stderr(contains("a range such as 1-40"));
    rows("99999999999")
        .code(2)
        .stderr(contains("at most 4294967295 rows"));
}

#[test]
fn the_order_of_a_started_study_is_shown_only_with_a_reason_that_is_logged() {
    let folder = tempfile::tempdir().expect("a folder");
    let protocol = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/turn-signal");
    let study = |arguments: &[&str]| {
        Command::cargo_bin("study")
            .expect("the binary is built with its tests")
            .current_dir(folder.path())
            .args(arguments)
            .assert()
    };
    study(&["schedule", protocol]).success();
    study(&[
        "rehearse",
        protocol,
        "--participants",
        "1",
        "--out",
        "results",
    ])
    .success();
    study(&["schedule", protocol])
        .code(4)
        .stdout("")
        .stderr(contains("has started").and(contains("--reveal")));
    study(&["schedule", protocol, "--rows", "2-3", "--reveal", " "])
        .code(1)
        .stdout("");
    study(&[
        "schedule",
        protocol,
        "--rows",
        "2-3",
        "--reveal",
        "rig 2 has\nno screen",
    ])
    .success()
    .stdout(contains("lambda-0.9991"));
    let log = folder.path().join("results/turn-signal/reveals.jsonl");
    let log = std::fs::read_to_string(log).expect("the log");
    assert_eq!(log.lines().count(), 1, "{log}");
    assert!(
        log.contains(r#""rows":[2,3]"#) && log.contains(r"rig 2 has\nno screen"),
        "{log}"
    );
    study(&["verify", "results"]).success();
}
