//! Questionnaires at the end of a session, and magnitude estimates of realizations: from
//! `study new` to the report.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts::{analyzed, cells, study};
use serde_json::Value;
use std::fs;

const QUESTIONNAIRES: &str = r#"
[[questionnaires]]
id = "sus"
kind = "sus"

[[questionnaires]]
id = "load"
kind = "nasa-tlx"
"#;

#[test]
fn questionnaires_are_answered_scored_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = study(&["new", "--seed", "20261123", "s"], folder.path());
    assert_eq!(code, 0, "{err}");
    let path = folder.path().join("s/protocol.toml");
    let protocol = fs::read_to_string(&path).unwrap() + QUESTIONNAIRES;
    fs::write(&path, protocol).unwrap();
    let arguments = ["rehearse", "s", "--participants", "3", "--out", "out"];
    let (code, _, err) = study(&arguments, folder.path());
    assert_eq!(code, 0, "{err}");
    let (code, out, err) = study(&["verify", "out"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let document = analyzed(folder.path());
    let [sus, load] = [0, 1].map(|i| &document["parts"][i]);
    assert_eq!(
        (&sus["task"], &load["task"]),
        (&"sus".into(), &"nasa-tlx".into())
    );
    let names: Vec<String> = (1..=10).map(|i| format!("sus_{i}")).collect();
    let mut columns = vec!["participant"];
    columns.extend(names.iter().map(String::as_str));
    let answers = cells(&folder.path().join("out/s/participants.csv"), &columns);
    assert_eq!(answers.len(), 3);
    let mut total = 0.0;
    for row in &answers {
        let given: Vec<f64> = row[1..].iter().map(|a| a.parse().unwrap()).collect();
        let odd: f64 = given.iter().step_by(2).sum();
        let even: f64 = given.iter().skip(1).step_by(2).sum();
        let score = 2.5 * (odd - 5.0 + 25.0 - even);
        assert_eq!(
            sus["values"][format!("questionnaire/score/{}", row[0])],
            score
        );
        total += score;
    }
    let mean = sus["values"]["questionnaire/mean"].as_f64().unwrap();
    assert!((mean - total / 3.0).abs() < 1e-9);
    assert_eq!(load["values"]["questionnaire/item/mental/n"], 3.0);
    let (code, out, err) = study(&["analyze", "out"], folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("sus, 3 scores, 3 participants"), "{out}");
    let analysis = folder.path().join("out/s/analysis");
    let report = fs::read_to_string(analysis.join("report.html")).unwrap();
    assert!(report.contains("System Usability Scale (Brooke, 1996)"));
    assert!(
        analysis.join("part_scores.csv").is_file() && analysis.join("part_items.csv").is_file()
    );
}

const BETWEEN: &str = r#"
[[questionnaires]]
id = "load"
kind = "nasa-tlx"
after = "condition"

[[questionnaires]]
id = "usability"
kind = "sus"
after = "block"
"#;

const ITEMS: [&str; 6] = [
    "load_mental",
    "load_physical",
    "load_temporal",
    "load_performance",
    "load_effort",
    "load_frustration",
];

/// Scores after each realization are those of its rows, and are compared as a measured outcome; those after
/// a block are described.
#[test]
fn scores_between_the_trials_are_those_of_their_conditions() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, folder.path());
        assert_eq!(code, 0, "{out}{err}");
        out
    };
    run(&["new", "--seed", "20261128", "s"]);
    let path = folder.path().join("s/protocol.toml");
    let protocol = fs::read_to_string(&path).unwrap();
    let protocol = protocol.replace("study-protocol/1", "study-protocol/3") + BETWEEN;
    fs::write(&path, protocol).unwrap();
    run(&["rehearse", "s", "--participants", "4", "--out", "out"]);
    run(&["verify", "out"]);
    let document = analyzed(folder.path());
    let mut columns = vec!["model", "practice"];
    columns.extend(ITEMS);
    let rows = cells(&folder.path().join("out/s/ratings.csv"), &columns);
    let [load, usability] = [0, 1].map(|i| &document["parts"][i]["values"]);
    let near = |found: &Value, expected: f64| {
        let found = found.as_f64().unwrap();
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    };
    for model in ["lambda-0.9991", "lambda-0.9995", "lambda-0.9999"] {
        let own = rows
            .iter()
            .filter(|row| row[0] == model && row[1] == "false");
        let scores: Vec<f64> = own
            .map(|row| {
                row[2..]
                    .iter()
                    .map(|x| x.parse::<f64>().unwrap())
                    .sum::<f64>()
                    / 6.0
            })
            .collect();
        // Four participants, three blocks.
        assert_eq!(scores.len(), 12);
        let mean = scores.iter().sum::<f64>() / 12.0;
        let values = &document["values"];
        near(&values[format!("outcomes/load/desc/{model}/mean")], mean);
        near(&load[format!("questionnaire/after/{model}/mean")], mean);
    }
    assert_eq!(document["values"]["outcomes/load/n_missing"], 0.0);
    let p = document["values"]["outcomes/load/differ/p"].as_f64();
    assert!(p.is_some_and(|p| (0.0..=1.0).contains(&p)), "{p:?}");
    assert_eq!(usability["questionnaire/after/3/n"], 4.0);
    assert!(document["values"]["outcomes/usability/n"].is_null());
    run(&["analyze", "out"]);
    let analysis = folder.path().join("out/s/analysis");
    let report = fs::read_to_string(analysis.join("report.html")).unwrap();
    for said in [
        "raw score of the Task Load Index",
        "(Hart &amp; Staveland, 1988) after each realization",
        "(Brooke, 1996) after each block",
        "Scores between the trials",
    ] {
        assert!(report.contains(said), "{said}");
    }
    assert!(analysis.join("part_scores_after.csv").is_file());
    let to_csv = ["export", "out/s", "--to", "csv", "--out", "e"];
    run(&[to_csv.as_slice(), ["--include", "simulated"].as_slice()].concat());
    let dictionary = fs::read_to_string(folder.path().join("e/dictionary.csv")).unwrap();
    assert!(
        dictionary.contains("load_mental")
            && dictionary.contains("How mentally demanding was the task?")
    );
    let outcomes = run(&["analyze", "out", "--question", "load"]);
    assert!(outcomes.contains("load"), "{outcomes}");
}

/// The items and the scales of a questionnaire of the study's own, from the answers of each participant.
#[test]
fn a_questionnaire_of_the_studys_own_is_scored() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, folder.path());
        assert_eq!(code, 0, "{out}{err}");
        out
    };
    let own = ALONE
        .replace("study-protocol/1", "study-protocol/3")
        .replace("primary = \"sus\"", "primary = \"touch\"")
        .replace(
            "id = \"sus\"\nkind = \"sus\"",
            r#"id = "touch"
kind = "own"
items = ["One.", "Two.", "Three."]
from = 0
to = 6
reverse = [2]
total = "sum"
times = 2.0
scales = [{ id = "outer", items = [1, 3], times = 0.5 }]"#,
        );
    fs::create_dir(folder.path().join("q")).unwrap();
    fs::write(folder.path().join("q/protocol.toml"), own).unwrap();
    run(&["rehearse", "q", "--participants", "5", "--out", "out"]);
    run(&["verify", "out"]);
    let document = analyzed(folder.path());
    let values = &document["parts"][0]["values"];
    let table = folder.path().join("out/alone/participants.csv");
    let columns = ["participant", "touch_1", "touch_2", "touch_3"];
    let mut outer = 0.0;
    for row in cells(&table, &columns) {
        let x: Vec<f64> = row[1..].iter().map(|x| x.parse().unwrap()).collect();
        let score = 2.0 * (x[0] + 6.0 - x[1] + x[2]);
        assert_eq!(values[format!("questionnaire/score/{}", row[0])], score);
        outer += 0.5 * (x[0] + x[2]) / 5.0;
    }
    let found = values["questionnaire/scale/outer/mean"].as_f64().unwrap();
    assert!((found - outer).abs() < 1e-9, "{found} {outer}");
    run(&["analyze", "out"]);
    let analysis = folder.path().join("out/alone/analysis");
    assert!(analysis.join("part_subscales.csv").is_file());
}

const ALONE: &str = r#"
format = "study-protocol/1"
study = { id = "alone", title = "Usability of a switch", seed = 1 }
design = { participants = 3 }
device = { kind = "manual" }
analysis = { primary = "sus" }
[[questionnaires]]
id = "sus"
kind = "sus"
"#;

/// Nothing is presented: there are no trials, and the scores are the result.
#[test]
fn a_study_can_consist_of_questionnaires() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, folder.path());
        assert_eq!(code, 0, "{out}{err}");
        out
    };
    fs::create_dir(folder.path().join("q")).unwrap();
    fs::write(folder.path().join("q/protocol.toml"), ALONE).unwrap();
    run(&["check", "q"]);
    assert!(run(&["schedule", "q"]).contains("only asks questionnaires"));
    run(&["rehearse", "q", "--participants", "3", "--out", "out"]);
    run(&["verify", "out"]);
    let document = analyzed(folder.path());
    assert_eq!(document["format"], "study-parts/1");
    let part = &document["parts"][0];
    assert_eq!((&part["task"], &part["trials"]), (&"sus".into(), &3.into()));
    assert_eq!(part["values"]["questionnaire/n"], 3.0);
    let out = run(&["analyze", "out"]);
    assert!(out.contains("sus, 3 scores, 3 participants"), "{out}");
    run(&[
        "export",
        "out/alone",
        "--to",
        "csv",
        "--out",
        "e",
        "--include",
        "simulated",
    ]);
    let answers = cells(&folder.path().join("e/participants.csv"), &["sus_1"]);
    assert_eq!(answers.len(), 3);
}

#[test]
fn magnitudes_of_realizations_are_estimated_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = study(
        &["new", "--seed", "20261123", "m", "--kind", "pairs"],
        folder.path(),
    );
    assert_eq!(code, 0, "{err}");
    let path = folder.path().join("m/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let (head, rest) = text.split_once("[[parts]]").unwrap();
    let (_, analysis) = rest.split_once("[analysis]").unwrap();
    let part = "[[parts]]\nid = \"more-real\"\nkind = \"magnitude\"\nprompt = \"How real?\"\nrepetitions = 2\n";
    fs::write(&path, format!("{head}{part}\n[analysis]{analysis}")).unwrap();
    let arguments = ["rehearse", "m", "--participants", "3", "--out", "out"];
    let (code, _, err) = study(&arguments, folder.path());
    assert_eq!(code, 0, "{err}");
    let document = analyzed(folder.path());
    assert_eq!(document["format"], "study-parts/1");
    let part = &document["parts"][0];
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"magnitude".into(), &18.into())
    );
    let columns = ["model", "more-real"];
    let given = cells(&folder.path().join("out/m/ratings.csv"), &columns);
    for model in ["lambda-0.9991", "lambda-0.9995", "lambda-0.9999"] {
        let own = given.iter().filter(|row| row[0] == model);
        let logs: Vec<f64> = own.map(|row| row[1].parse::<f64>().unwrap().ln()).collect();
        assert_eq!(logs.len(), 6);
        let mean = (logs.iter().sum::<f64>() / 6.0).exp();
        let id = format!("magnitude/realization/{model}/geometric_mean");
        let found = part["values"][&id].as_f64().unwrap();
        assert!((found / mean - 1.0).abs() < 1e-9, "{model}: {found} {mean}");
    }
    let questions: Vec<&Value> = (part["findings"].as_array().unwrap().iter())
        .map(|f| &f["question"])
        .collect();
    assert_eq!(questions, ["magnitudes", "magnitude-vaf"]);
    let (code, out, err) = study(&["analyze", "out"], folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("Do the estimates differ between realizations?"),
        "{out}"
    );
}

/// Estimates after a standard refer to its number: the geometric mean of the standard itself is near it, whatever scale
/// the participants would choose.
#[test]
fn estimates_after_a_standard_refer_to_its_number() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, folder.path());
        assert_eq!(code, 0, "{out}{err}");
        (out, err)
    };
    run(&["new", "--seed", "20261128", "m", "--kind", "magnitude"]);
    let path = folder.path().join("m/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let with = text
        .replace("study-protocol/2", "study-protocol/3")
        .replace(
            "range = [0.25, 1.7] ",
            "levels = [0.25, 0.5, 0.75, 1.0, 1.7] ",
        )
        .replace("steps = 7\n", "")
        .replace(
            "family = \"detent\" ",
            "standard = 0.5\nmodulus = 120\nfamily = \"detent\" ",
        );
    fs::write(&path, &with).unwrap();
    let (_, warned) = run(&["check", "m"]);
    let doubt = "says 120, the number of the standard";
    assert!(warned.contains(doubt), "{warned}");
    let said = with.replace(
        "How strong did it feel?",
        "The first one is 120. How strong was the second one?",
    );
    fs::write(&path, said).unwrap();
    let (_, warned) = run(&["check", "m"]);
    assert!(!warned.contains(doubt), "{warned}");
    run(&["rehearse", "m", "--participants", "12", "--out", "out"]);
    run(&["verify", "out"]);
    let document = analyzed(folder.path());
    let values = &document["parts"][0]["values"];
    let mean = |level: &str| {
        let id = format!("magnitude/level/{level}/geometric_mean");
        values[&id]
            .as_f64()
            .unwrap_or_else(|| panic!("no {id} in {values:#}"))
    };
    assert!((mean("0.5") / 120.0).ln().abs() < 0.15, "{}", mean("0.5"));
    assert!(mean("0.25") < 100.0 && mean("1.7") > 180.0);
    let (out, _) = run(&["analyze", "out"]);
    assert!(!out.is_empty());
    let page = fs::read_to_string(folder.path().join("out/my-study/analysis/report.html"));
    let page =
        page.or_else(|_| fs::read_to_string(folder.path().join("out/m/analysis/report.html")));
    assert!(
        page.unwrap()
            .contains("after the standard 0.5, whose number was 120")
    );
}

/// A question of yes and no as the primary one: means are shares of the stated answer.
#[test]
fn the_share_of_an_answer_is_analyzed() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = study(&["new", "--seed", "20261123", "s"], folder.path());
    assert_eq!(code, 0, "{err}");
    let path = folder.path().join("s/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let (head, rest) = text.split_once("kind = \"rating\"").unwrap();
    let (_, rest) = rest.split_once("very realistic\" }\n").unwrap();
    let choice =
        "kind = \"choice\"\nprompt = \"Was it the switch?\"\noptions = [\"yes\", \"no\"]\n";
    let text = format!("{head}{choice}{rest}")
        .replace(
            "primary = \"realism\"",
            "primary = \"realism\"\nshare_of = \"yes\"",
        )
        .replace("realistic_from", "# realistic_from");
    fs::write(&path, text).unwrap();
    let arguments = ["rehearse", "s", "--participants", "5", "--out", "out"];
    let (code, _, err) = study(&arguments, folder.path());
    assert_eq!(code, 0, "{err}");
    let document = analyzed(folder.path());
    let given = cells(
        &folder.path().join("out/s/ratings.csv"),
        &["model", "realism"],
    );
    for model in ["lambda-0.9991", "lambda-0.9995", "lambda-0.9999"] {
        let own: Vec<bool> = (given.iter().filter(|row| row[0] == model))
            .map(|row| row[1] == "yes")
            .collect();
        assert_eq!(own.len(), 15);
        let share = own.iter().filter(|yes| **yes).count() as f64 / 15.0;
        let mean = document["values"][format!("desc/{model}/mean")]
            .as_f64()
            .unwrap();
        assert!((mean - share).abs() < 1e-12, "{model}: {mean} {share}");
    }
    let (code, out, err) = study(&["analyze", "out"], folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("1 for the answer “yes”"), "{out}");
}
