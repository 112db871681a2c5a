//! The command `study identify`.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use assert_cmd::Command;
use predicates::prelude::*;
use serde_json::Value;
use std::fs;
use std::path::Path;

const TRAINING: &str = "tests/data/recordings/training_a.csv";
const VALIDATION: &str = "tests/data/recordings/validation_a.csv";

fn identify(args: &[&str]) -> Command {
    let mut command = Command::cargo_bin("study").unwrap();
    command.arg("identify").args(args);
    command
}

fn refused(args: &[&str], code: i32, said: &str) {
    identify(args)
        .assert()
        .code(code)
        .stdout("")
        .stderr(predicate::str::contains(said));
}

#[test]
fn json_has_a_cell_for_every_lambda_and_dx_with_unrounded_vaf() {
    let out = identify(&[
        TRAINING,
        "--validate",
        VALIDATION,
        "--method",
        "ewls",
        "--lambda",
        "0.999,0.9995",
        "--dx",
        "0.5,1",
        "--resample",
        "bin",
        "--lookup",
        "linear",
        "--start",
        "cold",
        "--sort",
        "ascending",
        "--json",
    ])
    .assert()
    .success();
    let document: Value = serde_json::from_slice(&out.get_output().stdout).unwrap();
    assert_eq!(document["format"], "study-identify/1");
    let cells = document["cells"].as_array().unwrap();
    let of = |i: usize, key: &str| cells[i][key].as_f64().unwrap();
    let places: Vec<_> = (0..cells.len())
        .map(|i| (of(i, "lambda"), of(i, "dx_mm")))
        .collect();
    assert_eq!(
        places,
        [(0.999, 0.5), (0.999, 1.0), (0.9995, 0.5), (0.9995, 1.0)]
    );
    // golden numbers as in tests/identify/golden.rs
    let vaf = cells[1]["vaf"]["validation_a"].as_f64().unwrap();
    assert!((vaf - 0.949471).abs() < 0.51e-6, "{vaf}");
    assert_eq!(cells[0]["method"], "ewls");
    assert_eq!(cells[0]["resample"], "bin");
    assert_eq!(cells[0]["lookup"], "linear");
    assert!((of(0, "memory_mm") - 1.034).abs() < 0.001);
    assert_eq!(document["best"], 0);
}

#[test]
fn the_table_marks_the_best_cell_and_names_the_recording_used_for_selection() {
    identify(&[
        TRAINING,
        "--validate",
        VALIDATION,
        "--lambda",
        "0.999,0.9995",
        "--dx",
        "1",
    ])
    .assert()
    .success()
    .stdout(predicate::str::contains("*  0.999  1.034      1"))
    .stdout(predicate::str::contains(
        "highest VAF: 0.949471 on validation_a, selected on this recording",
    ))
    .stdout(predicate::str::contains("\u{1b}").not());
}

/// Without a method and options of the recursion: the passive table, whose chosen δ is in
/// the table and the document.
#[test]
fn the_default_passes_its_certificate_and_says_its_delta() {
    let out = identify(&[TRAINING, "--validate", VALIDATION, "--dx", "0.5", "--json"])
        .assert()
        .success();
    let document: Value = serde_json::from_slice(&out.get_output().stdout).unwrap();
    let cell = &document["cells"][0];
    assert_eq!(cell["method"], "passive");
    assert_eq!(cell["certificate"]["pass"], true);
    assert_eq!(cell["direction"], "play");
    let delta = cell["delta_mm"].as_f64().unwrap();
    assert!(delta > 0.2 && delta < 1.0, "{delta}");
    assert!(cell["vaf"]["validation_a"].as_f64().unwrap() >= 0.996);
    identify(&[TRAINING, "--validate", VALIDATION, "--dx", "0.5"])
        .assert()
        .success()
        .stdout(predicate::str::contains("delta mm"))
        .stdout(predicate::str::contains(delta.to_string()));
    refused(
        &[
            TRAINING,
            "--validate",
            VALIDATION,
            "--method",
            "static",
            "--start",
            "warm",
        ],
        2,
        "--start warm does not apply to this method",
    );
}

/// A recording cut in two gives nearly the table of the whole: the direction state starts
/// anew in the second half.
#[test]
fn several_training_recordings_count_like_one() {
    let dir = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(TRAINING).unwrap();
    let rows = text.lines().position(|l| l.starts_with("t_s")).unwrap() + 1;
    let lines: Vec<&str> = text.lines().collect();
    let half = rows + (lines.len() - rows) / 2;
    let part = |name: &str, from: usize, to: usize| {
        let path = dir.path().join(name);
        let all = [&lines[..rows], &lines[from..to]].concat();
        fs::write(&path, all.join("\n")).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (first, second) = (part("1.csv", rows, half), part("2.csv", half, lines.len()));
    let vaf = |training: &[&str]| {
        let mut args = training.to_vec();
        args.extend(["--validate", VALIDATION, "--dx", "0.5", "--json"]);
        let out = identify(&args).assert().success();
        let document: Value = serde_json::from_slice(&out.get_output().stdout).unwrap();
        let recordings = document["recordings"].as_array().unwrap().len();
        let vaf = document["cells"][0]["vaf"]["validation_a"]
            .as_f64()
            .unwrap();
        (vaf, recordings)
    };
    let ((whole, _), (parts, recordings)) = (vaf(&[TRAINING]), vaf(&[&first, &second]));
    assert_eq!(recordings, 2);
    assert!((whole - parts).abs() < 1e-4, "{whole} {parts}");
    assert!((vaf(&[&first]).0 - parts).abs() > 1e-6);
}

#[test]
fn a_copy_of_the_training_recording_is_refused_for_validation() {
    let dir = tempfile::tempdir().unwrap();
    let copy = dir.path().join("other.csv");
    fs::copy(TRAINING, &copy).unwrap();
    let copy = copy.to_str().unwrap();
    refused(&[TRAINING, "--validate", copy], 1, "are the same recording");
    refused(
        &[TRAINING, "--validate", VALIDATION, "--test", copy],
        1,
        "are the same recording",
    );
    refused(
        &[TRAINING, "--validate", VALIDATION, "--test", VALIDATION],
        1,
        "are the same recording",
    );
}

#[test]
fn a_model_file_is_overwritten_only_with_force() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("models");
    let out = out.to_str().unwrap();
    let args = [
        TRAINING,
        "--validate",
        VALIDATION,
        "--lambda",
        "0.9995",
        "--dx",
        "1,2",
        "--out",
        out,
    ];
    identify(&args).assert().success();
    let path = Path::new(out).join("lambda-0.9995-dx-1.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("id = \"lambda-0.9995-dx-1\"\n"), "{text}");
    fs::write(&path, "mine").unwrap();
    refused(&args, 1, "lambda-0.9995-dx-1.toml already exists");
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    identify(&args).arg("--force").assert().success();
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
    assert_eq!(fs::read_dir(out).unwrap().count(), 2);
}

#[test]
fn ids_that_collide_or_leave_the_folder_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().to_str().unwrap();
    let with = |id: &str, said: &str| {
        refused(
            &[
                TRAINING,
                "--validate",
                VALIDATION,
                "--lambda",
                "0.9995",
                "--dx",
                "1,2",
                "--out",
                out,
                "--id",
                id,
            ],
            1,
            said,
        );
    };
    with("same", "two cells would have the id same");
    with("../{dx}", "is not a model id");
    assert_eq!(fs::read_dir(out).unwrap().count(), 0);
}

#[test]
fn bad_arguments_and_bad_recordings_give_one_clear_error_each() {
    let with = |flag: &str, value: &str, code: i32, said: &str| {
        refused(
            &[TRAINING, "--validate", VALIDATION, flag, value],
            code,
            said,
        );
    };
    with(
        "--lambda",
        "1.5",
        2,
        "a forgetting factor is above 0 and at most 1",
    );
    with(
        "--lambda",
        "nan",
        2,
        "a forgetting factor is above 0 and at most 1",
    );
    with("--dx", "0", 2, "an increment is a length above 0 mm");
    with("--dx", "40", 1, "dx = 40 mm leaves");
    with("--resample", "mean", 2, "possible values: point, bin, hat");
    with(
        "--window",
        "tricube",
        2,
        "--window does not apply to this method",
    );
    with("--dx", "0.1:1", 2, "a range is FROM:TO:STEP");
    with(
        "--method",
        "magic",
        2,
        "possible values: friction, passive, static, ewls, constrained, hat, elements, mechanism, two-sided, segments, spring",
    );
    refused(&[TRAINING, "--method", "ewls"], 2, "--validate");
    refused(&[TRAINING, "--validate", "absent.csv"], 1, "absent.csv: ");

    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("ragged.csv");
    fs::write(&path, "t_s,x_mm,f_n\n0,1,1\n1,2\n").unwrap();
    let path = path.to_str().unwrap();
    refused(
        &[TRAINING, "--validate", &format!("v={path}")],
        1,
        "ragged.csv: line 3: 2 fields, but there are 3 columns",
    );
}

/// SVG, PNG, PDF and CSV.
#[test]
fn each_figure_comes_in_four_files() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("figures");
    identify(&[TRAINING, "--validate", VALIDATION])
        .args(["--lambda", "0.999,0.9999", "--dx", "1,2", "--figures"])
        .arg(&out)
        .assert()
        .success();
    for figure in [
        "force-displacement",
        "coverage",
        "fig4-vaf",
        "fig5-parameters",
        "fig6-force",
        "fig7-spectra",
        "fig8-map",
    ] {
        let read = |ending: &str| fs::read(out.join(format!("{figure}.{ending}"))).unwrap();
        assert!(read("svg").starts_with(b"<svg"), "{figure}");
        assert!(read("png").starts_with(b"\x89PNG\r\n\x1a\n"), "{figure}");
        assert!(read("pdf").starts_with(b"%PDF-"), "{figure}");
        assert!(read("csv").iter().filter(|b| **b == b'\n').count() > 4);
    }
    // and a page with all of them
    assert!(out.join("identification.html").exists());
    assert_eq!(fs::read_dir(&out).unwrap().count(), 29);
}
