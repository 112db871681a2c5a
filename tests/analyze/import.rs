//! `study import table`: files that other programs wrote become tables that `study analyze` reads.
//! tests/data/tables/README.md says who wrote them; `expected/` is what Python's readers make of them.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use assert_cmd::Command;
use predicates::str::contains;
use std::fs;
use std::path::Path;

const TABLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/tables");

/// `study import table` of files of a program: those whose names begin so.
fn import(folder: &Path, files: &str, args: &[&str]) -> Command {
    let entries = fs::read_dir(TABLES).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = paths
        .filter(|path| {
            let name = path.file_name().unwrap().to_str().unwrap();
            name.starts_with(files) && (files.ends_with("json") || !name.ends_with(".json"))
        })
        .filter(|path| path.extension().is_some_and(|e| e == "csv" || e == "json"))
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "{files}");
    let mut command = Command::cargo_bin("study").unwrap();
    command
        .current_dir(folder)
        .args(["import", "table", "-o", "t.csv"])
        .args(paths)
        .args(args);
    command
}

fn expected(name: &str) -> String {
    fs::read_to_string(format!("{TABLES}/expected/{name}.csv")).unwrap()
}

#[test]
fn files_of_each_program_give_what_other_readers_give() {
    const RATINGS: [&str; 4] = ["--as", "ratings", "--column", "model=texture"];
    for (files, args, name) in [
        (
            "jspsych",
            [&RATINGS[..], &["--rows", "task=rating"]].concat(),
            "jspsych-ratings",
        ),
        (
            "jspsych",
            vec!["--as", "2ifc", "--rows", "task=2afc"],
            "jspsych-trials",
        ),
        (
            "jspsych-P03.json",
            [&RATINGS[..], &["--rows", "task=rating"]].concat(),
            "jspsych-json",
        ),
        ("psychopy", RATINGS.to_vec(), "psychopy-ratings"),
        ("psychopy", vec!["--as", "2ifc"], "psychopy-trials"),
        (
            "opensesame",
            [&RATINGS[..], &["--rows", "task=rating"]].concat(),
            "opensesame-ratings",
        ),
        (
            "opensesame",
            vec!["--as", "2ifc", "--rows", "task=2afc"],
            "opensesame-trials",
        ),
        (
            "wide",
            vec!["--as", "ratings", "--wide", "{model}_{repetition}"],
            "wide",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        import(folder.path(), files, &args).assert().success();
        let written = fs::read_to_string(folder.path().join("t.csv")).unwrap();
        assert!(written == expected(name), "{name}:\n{written}");
        let mut analyze = Command::cargo_bin("study").unwrap();
        analyze
            .current_dir(folder.path())
            .args(["analyze", "t.csv", "--json"]);
        if args.contains(&"2ifc") {
            analyze.args(["--task", "2ifc"]);
        }
        analyze.assert().success();
    }
}

/// What was said once is read again, and nothing that was there is lost.
#[test]
fn columns_are_asked_for_once() {
    let folder = tempfile::tempdir().unwrap();
    let asked = [
        "--as",
        "ratings",
        "--column",
        "model=texture",
        "--rows",
        "task=rating",
    ];
    import(folder.path(), "jspsych-P01", &["--as", "ratings"])
        .assert()
        .code(1)
        .stderr(contains("which column has the realization"))
        .stderr(contains("the columns are task, stimulus, rt, response"))
        .stderr(contains("--column model=NAME"));
    assert!(!folder.path().join("t.csv").exists());
    import(folder.path(), "jspsych-P01", &asked)
        .assert()
        .success()
        .stderr(contains("jsPsych, 49 rows, 8 taken, 41 left out by --rows"))
        .stderr(contains(
            "columns: model = texture, rating = response, subject = subject, trial_index = @order",
        ))
        .stderr(contains("wrote 8 ratings of 1 participant to t.csv"))
        .stderr(contains("next: study analyze t.csv"));
    let kept = folder.path().join("t.columns.toml");
    let text = fs::read_to_string(&kept).unwrap();
    import(folder.path(), "jspsych", &asked)
        .assert()
        .code(1)
        .stderr(contains("t.csv already exists"));
    let again = ["--columns", "t.columns.toml", "--force"];
    import(folder.path(), "jspsych", &again).assert().success();
    assert_eq!(
        fs::read_to_string(folder.path().join("t.csv")).unwrap(),
        expected("jspsych-ratings")
    );
    assert_eq!(fs::read_to_string(&kept).unwrap(), text);

    fs::remove_file(folder.path().join("t.csv")).unwrap();
    fs::write(&kept, text.replace("study-columns/1", "study-columns/9")).unwrap();
    import(folder.path(), "jspsych", &["--columns", "t.columns.toml"])
        .assert()
        .code(1)
        .stderr(contains("the format of the columns is `study-columns/9`"));
    // Another import does not replace what was kept.
    import(
        folder.path(),
        "jspsych",
        &["--as", "2ifc", "--rows", "task=2afc"],
    )
    .assert()
    .code(1)
    .stderr(contains("t.columns.toml already exists"));
    assert!(!folder.path().join("t.csv").exists());
}

#[test]
fn text_of_a_file_cannot_control_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("a.csv"),
        "p\u{1b}[2J,model,rating\n\u{1b}[2J,a,\u{1b}[31m\n",
    )
    .unwrap();
    for args in [
        &["--as", "ratings"][..],
        &["--as", "ratings", "--column", "subject=p\u{1b}[2J"],
    ] {
        let mut command = Command::cargo_bin("study").unwrap();
        command
            .current_dir(folder.path())
            .args(["import", "table", "a.csv", "-o", "t.csv"])
            .args(args);
        let done = command.assert().code(1);
        let said = String::from_utf8(done.get_output().stderr.clone()).unwrap();
        assert!(
            !said.contains('\u{1b}') && said.contains("\\u{1b}"),
            "{said:?}"
        );
    }
}
