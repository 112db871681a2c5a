//! Output, files and errors of `study analyze`.
#![allow(clippy::unwrap_used)]

use assert_cmd::Command;
use std::fs;
use std::path::Path;

fn study() -> Command {
    let mut command = Command::cargo_bin("study").unwrap();
    command.env("NO_COLOR", "1");
    command
}

fn set(name: &str) -> String {
    format!(
        "{}/tests/golden/data/{name}/data.csv",
        env!("CARGO_MANIFEST_DIR")
    )
}

fn out(command: &mut Command) -> String {
    let done = command.assert().success();
    String::from_utf8(done.get_output().stdout.clone()).unwrap()
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn the_page_of_the_papers_design() {
    insta::assert_snapshot!(out(study().args(["analyze", &set("sim_paper")])));
}

#[test]
fn json_is_one_document_and_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let text =
        out(study()
            .current_dir(dir.path())
            .args(["analyze", &set("sim_all_equal"), "--json"]));
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["format"], "study-analysis/1");
    assert!(json["values"]["corr/pearson/r"].is_null());
    let why = json["undefined"]["corr/pearson/r"].as_str().unwrap();
    assert_eq!(why, "all realizations have the same mean rating");
    assert_eq!(json["values"]["desc/0.9995/mean"], 4.0);
    assert!(
        names(dir.path()).is_empty(),
        "a CSV gets files only with --out"
    );
}

#[cfg(unix)]
#[test]
fn figures_are_not_written_through_a_link() {
    let dir = tempfile::tempdir().unwrap();
    let (target, elsewhere) = (dir.path().join("out"), dir.path().join("elsewhere"));
    fs::create_dir(&target).unwrap();
    fs::create_dir(&elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, target.join("figures")).unwrap();
    let mut command = study();
    command.args(["analyze", &set("sim_paper"), "--out"]);
    let done = command.arg(&target).assert().failure();
    let said = String::from_utf8(done.get_output().stderr.clone()).unwrap();
    assert!(said.contains("figures: this is a symbolic link"), "{said}");
    assert!(names(&elsewhere).is_empty());
    assert_eq!(names(&target), ["figures"]);
}

#[test]
fn tables_go_where_out_says() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("a/b");
    study()
        .args([
            "analyze",
            &set("sim_paper"),
            "--out",
            target.to_str().unwrap(),
        ])
        .assert()
        .success();
    let expected = [
        "agreement.csv",
        "comments.csv",
        "correlation.csv",
        "descriptives.csv",
        "excluded.csv",
        "exclusions.csv",
        "figures",
        "pairs.csv",
        "ratings_used.csv",
        "report.html",
        "subjects.csv",
        "tests.csv",
        "values.json",
        "variance.csv",
        "wide.csv",
        "with_and_without.csv",
    ];
    assert_eq!(names(&target), expected);
    let used = fs::read_to_string(target.join("ratings_used.csv")).unwrap();
    assert_eq!(used.lines().count(), 151);
    assert!(
        used.starts_with("subject,model,repetition,trial_index,rating,vaf,included,reason\r\n")
    );
    let rows = |name: &str| {
        let text = fs::read_to_string(target.join(name)).unwrap();
        text.lines().count() - 1
    };
    // Ten pairs of five realizations, ten subjects, no rule.
    let counted = ["pairs.csv", "subjects.csv", "exclusions.csv"].map(rows);
    assert_eq!(counted, [10, 10, 0]);
    let pairs = fs::read_to_string(target.join("pairs.csv")).unwrap();
    assert!(pairs.starts_with("pair,mean_diff,t,p_t,p_t_holm,"));
    assert!(!pairs.contains(",,"), "all of it is defined: {pairs}");
}

#[test]
fn numbers_that_cannot_be_and_columns_that_are_not_read_are_reported() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("r.csv");
    let table =
        "subject,model,rating,vaf,Repetition\nS1,a,8,95,1\nS1,b,3,97,1\nS2,a,0,95,1\nS2,b,4,97,1\n";
    fs::write(&path, table).unwrap();
    let codes = |scale: &[&str]| {
        let text = out(study().args(["analyze", "--json"]).args(scale).arg(&path));
        let document: serde_json::Value = serde_json::from_str(&text).unwrap();
        let warnings = document["warnings"].as_array().unwrap().clone();
        let text = |w: &serde_json::Value| w["text"].as_str().unwrap().to_owned();
        warnings.iter().map(text).collect::<Vec<_>>()
    };
    assert_eq!(
        codes(&["--scale", "1..7"])[..3],
        [
            "column Repetition is not read: did you mean repetition?",
            "2 ratings outside the scale 1 to 7, such as 8",
            "VAF above 1, such as 95: is it in per cent?",
        ]
    );
    assert!(
        !codes(&["--scale=0..8"])
            .iter()
            .any(|w| w.contains("outside"))
    );
    assert!(!codes(&[]).iter().any(|w| w.contains("outside")));
    for bad in ["7..1", "1..x", "7"] {
        let mut command = study();
        command.args(["analyze", "--scale", bad]).arg(&path);
        command.assert().code(2);
    }
    let mut command = study();
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/results/turn-signal-example");
    command.args(["analyze", "--scale", "1..7", example]);
    command.assert().code(1);
}

#[test]
fn the_better_end_of_the_scale_can_be_stated() {
    let best = |args: &[&str]| {
        let text = out(study().arg("analyze").args(args).arg(set("sim_paper")));
        let (_, rest) = text.split_once("The best-rated realization is ").unwrap();
        rest.split(',').next().unwrap().to_owned()
    };
    assert_eq!(best(&["--direction", "higher"]), best(&[]));
    assert_ne!(best(&["--direction", "lower"]), best(&[]));
    let json = out(study().args(["analyze", "--json", "--direction=lower", &set("sim_paper")]));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["better"], "lower");
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/results/turn-signal-example");
    for (args, code) in [
        (["--direction", "lower", example], 1),
        (["--direction", "down", example], 2),
    ] {
        let mut command = study();
        command.arg("analyze").args(args).assert().code(code);
    }
}

#[test]
fn a_second_analysis_leaves_what_is_right_and_repairs_what_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join("out").join(name);
    let analyze = || {
        let sub = set("sim_paper");
        let args = ["analyze", &sub, "--out", "out"];
        out(study().current_dir(dir.path()).args(args))
    };
    analyze();
    // Of every file: its bytes, and a time that only another write changes.
    let long_ago = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000);
    let all: Vec<String> = (names(&path("")).into_iter())
        .filter(|n| n != "figures")
        .chain(
            names(&path("figures"))
                .iter()
                .map(|n| format!("figures/{n}")),
        )
        .collect();
    assert!(all.len() > 30, "{all:?}");
    let before: Vec<Vec<u8>> = all.iter().map(|n| fs::read(path(n)).unwrap()).collect();
    for name in &all {
        let file = fs::File::options().write(true).open(path(name)).unwrap();
        file.set_modified(long_ago).unwrap();
    }
    let damaged = "figures/order.png";
    fs::write(path(damaged), "half a picture").unwrap();
    analyze();
    for (name, bytes) in all.iter().zip(before) {
        assert!(fs::read(path(name)).unwrap() == bytes, "{name}");
        let untouched = fs::metadata(path(name)).unwrap().modified().unwrap() == long_ago;
        assert_eq!(untouched, name != damaged, "{name}");
    }
    assert_eq!(
        names(&path("figures")).len() + names(&path("")).len() - 1,
        all.len()
    );
}

#[test]
fn bad_input_is_one_clear_error() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("r.csv");
    fs::write(
        &path,
        "subject,model,repetition,rating,vaf\nS1,A,1,4,0.5\nS1,B,1\n",
    )
    .unwrap();
    let done = study().arg("analyze").arg(&path).assert().code(1);
    let said = String::from_utf8(done.get_output().stderr.clone()).unwrap();
    assert!(
        said.ends_with("r.csv, line 3: 3 fields, but the header has 5\n"),
        "{said}"
    );
    assert_eq!(said.lines().count(), 1, "{said}");
    fs::write(
        &path,
        b"subject,model,repetition,rating,vaf\nS1,\xff,1,4,0.5\n",
    )
    .unwrap();
    study().arg("analyze").arg(&path).assert().code(1);
    study()
        .arg("analyze")
        .arg(dir.path().join("none"))
        .assert()
        .code(4);
    // A folder without a study is a fault of the results.
    study().arg("analyze").arg(dir.path()).assert().code(4);
    study()
        .args(["analyze", "x", "--include", "everybody"])
        .assert()
        .code(2);
}
