//! `study schedule --answers`: tracks replayed from a list of answers, compared with the
//! reference cases of `tests/golden/psychophysics`, and the orders of parts as text.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use assert_cmd::Command;
use predicates::str::contains;
use serde_json::{Value as Json, json};
use std::fs;
use std::path::Path;

fn study(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("study").unwrap();
    command.current_dir(folder).args(arguments).assert()
}

fn golden(name: &str) -> Json {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/psychophysics");
    let text = fs::read_to_string(format!("{root}/{name}.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// A protocol in `folder` with these tracks on a ladder of friction.
fn protocol(folder: &Path, ladder: &str, tracks: &[(&str, String)]) {
    study(
        folder,
        &["new", "--seed", "20261123", "p", "--kind", "staircase"],
    )
    .success();
    let names: Vec<String> = tracks.iter().map(|(id, _)| format!("{id:?}")).collect();
    let tracks: Vec<String> = (tracks.iter())
        .map(|(id, procedure)| {
            format!("[[tracks]]\nid = {id:?}\nmethod = \"2ifc\"\nfamily = \"f\"\nstandard = 0.0\nprocedure = {procedure}\n")
        })
        .collect();
    let text = format!(
        r#"format = "study-protocol/2"
study = {{ id = "p", title = "A track", seed = 1 }}
design = {{ participants = 2 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "which" }}
parts = [{{ id = "which", kind = "discrimination", prompt = "?", tracks = [{}] }}]
[[families]]
id = "f"
from = "models/static.toml"
vary = "friction"
{ladder}
{}"#,
        names.join(", "),
        tracks.concat()
    );
    fs::write(folder.join("p/protocol.toml"), text).unwrap();
}

/// The replayed tracks.
fn replayed(folder: &Path, answers: &str) -> Vec<Json> {
    fs::write(folder.join("answers.csv"), answers).unwrap();
    let arguments = ["schedule", "p", "--answers", "answers.csv", "--json"];
    let output = study(folder, &arguments).success().get_output().clone();
    let document: Json = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["format"], "study-tracks/1");
    document["tracks"].as_array().unwrap().clone()
}

fn list(json: &Json) -> Vec<f64> {
    let list = json.as_array().unwrap();
    list.iter().map(|x| x.as_f64().unwrap()).collect()
}

/// A key of every trial of a track.
fn of_trials(track: &Json, key: &str) -> Vec<f64> {
    let trials = track["trials"].as_array().unwrap();
    trials.iter().map(|t| t[key].as_f64().unwrap()).collect()
}

fn assert_close(got: &[f64], want: &[f64], what: &str) {
    assert_eq!(got.len(), want.len(), "{what}");
    for (trial, (got, want)) in (1..).zip(got.iter().zip(want)) {
        let close = (got - want).abs() <= 1e-9 * want.abs().max(1.0);
        assert!(close, "{what}, trial {trial}: {got}, not {want}");
    }
}

fn staircase(rule: &Json, common: &Json) -> String {
    let key = |name: &str| match &rule[name] {
        Json::Null => &common[name],
        own => own,
    };
    let or = |name: &str, otherwise: Json| match key(name) {
        Json::Null => otherwise,
        given => given.clone(),
    };
    format!(
        "{{ rule = \"staircase\", up = {}, down = {}, start = {}, steps = {}, scale = {}, step_up_factor = {}, initial_one_up_one_down = {}, \
         estimate_last = {}, stop = {{ reversals = {}, min_trials = {}, max_trials = 200 }} }}",
        key("up"),
        key("down"),
        key("start"),
        key("steps"),
        key("scale"),
        or("step_up_factor", json!(1.0)),
        or("initial_one_up_one_down", json!(true)),
        key("estimate_last"),
        key("stop_reversals"),
        or("min_trials", json!(0)),
    )
}

/// Levels, reversals and estimate of a staircase against the reference.
fn compare_staircase(track: &Json, name: &str, expected: &Json) {
    let want = |id: &str| &expected[format!("track/P01/{name}/{id}")]["value"];
    assert_close(&of_trials(track, "proposed"), &list(want("level")), name);
    let summary = &track["summary"];
    let estimate = summary["estimate"].as_f64().unwrap();
    assert_close(&[estimate], &[want("estimate").as_f64().unwrap()], name);
    let reversals = summary["reversals"].as_array().unwrap();
    let trials: Vec<f64> = (reversals.iter())
        .map(|r| r["trial"].as_f64().unwrap())
        .collect();
    assert_close(&trials, &list(want("reversal_trial")), name);
    assert_eq!(
        summary["finished"].as_bool().unwrap(),
        want("finished") == &json!(1)
    );
}

#[test]
fn staircases_propose_the_levels_of_the_reference() {
    for (case, ladder) in [
        ("staircase_weighted_75", "range = [0.0, 2.0]\nsteps = 201"),
        (
            "staircase_1u2d_db_clamped",
            "range = [0.25, 2.0]\nsteps = 176",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (file, name) = (golden(case), "A");
        let input = &file["input"];
        protocol(folder.path(), ladder, &[(name, staircase(input, input))]);
        let answers: Vec<String> = (list(&input["responses"]).iter())
            .map(|a| format!("{a}\n"))
            .collect();
        let tracks = replayed(folder.path(), &format!("answer\n{}", answers.concat()));
        compare_staircase(&tracks[0], name, &file["expected"]);
        // What is presented is a level of the ladder, within half a step.
        let pairs = of_trials(&tracks[0], "proposed");
        let presented = of_trials(&tracks[0], "presented");
        for (proposed, presented) in pairs.iter().zip(presented) {
            assert!((proposed - presented).abs() <= 0.005 + 1e-9);
        }
    }
}

#[test]
fn interleaved_tracks_are_replayed_each_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let file = golden("staircase_interleaved");
    let input = &file["input"];
    let rules = input["tracks"].as_array().unwrap();
    let tracks: Vec<(&str, String)> = (rules.iter())
        .map(|rule| (rule["track"].as_str().unwrap(), staircase(rule, input)))
        .collect();
    protocol(folder.path(), "range = [0.0, 2.0]\nsteps = 41", &tracks);
    let mut answers = "track,answer\n".to_owned();
    for row in input["responses"].as_array().unwrap() {
        answers += &format!("{},{}\n", row["track"].as_str().unwrap(), row["correct"]);
    }
    for track in replayed(folder.path(), &answers) {
        let name = track["track"].as_str().unwrap().to_owned();
        compare_staircase(&track, &name, &file["expected"]);
    }
}

#[test]
fn quest_plus_and_psi_propose_the_levels_of_the_reference() {
    for case in ["psi_sim_2ifc", "questplus_sim_2ifc_prior"] {
        let folder = tempfile::tempdir().unwrap();
        let file = golden(case);
        let (input, expected) = (&file["input"], &file["expected"]);
        let levels = &input["stimulus"]["intensity"];
        let parameters: Vec<String> = ["mean", "sd", "gamma", "lambda"]
            .iter()
            .map(|name| {
                let values = &input["parameters"][name];
                let prior = input["prior"].get(name);
                let prior = prior.map_or_else(String::new, |p| format!(", prior = {p}"));
                format!("{{ name = {name:?}, values = {values}{prior} }}")
            })
            .collect();
        let responses = list(&input["responses"]);
        let rule = format!(
            "{{ rule = \"quest+\", function = \"normal\", trials = {}, parameters = [{}] }}",
            responses.len(),
            parameters.join(", ")
        );
        protocol(folder.path(), &format!("levels = {levels}"), &[("A", rule)]);
        let mut answers = "answer,presented\n".to_owned();
        for (answer, presented) in responses.iter().zip(input["presented"].as_array().unwrap()) {
            answers += &format!("{answer},{}\n", presented[0]);
        }
        let track = &replayed(folder.path(), &answers)[0];
        let want = |id: &str| &expected[format!("track/P01/A/{id}")]["value"];
        assert_close(
            &of_trials(track, "proposed"),
            &list(want("proposed/intensity")),
            case,
        );
        let mean = track["summary"]["posterior"][0]["mean"].as_f64().unwrap();
        assert_close(
            &[mean],
            &[want("posterior/mean/mean").as_f64().unwrap()],
            case,
        );
        // The estimate of the last trial is that of the summary; the track has ended.
        assert_eq!(*of_trials(track, "estimate").last().unwrap(), mean);
        assert_eq!(track["next"], Json::Null);
    }
}

/// An easy trial moves no staircase, and QUEST+ learns from it at the top of the ladder.
#[test]
fn easy_trials_are_marked_in_the_file() {
    let rules = [
        (
            "up",
            r#"{ rule = "staircase", up = 1, down = 1, start = 1.0, steps = [0.1], stop = { reversals = 4, max_trials = 40 } }"#,
        ),
        ("q", r#"{ rule = "quest+", trials = 10 }"#),
    ];
    let rules = rules.map(|(id, rule)| (id, rule.to_owned()));
    let folder = tempfile::tempdir().unwrap();
    protocol(folder.path(), "range = [0.1, 2.0]\nsteps = 20", &rules);
    let answers = "track,answer,easy\nup,1,0\nup,0,1\nup,1,\nq,1,0\nq,0,1\n";
    let tracks = replayed(folder.path(), answers);
    let up = &tracks[0]["trials"];
    assert_eq!(
        (&up[1]["proposed"], &up[1]["presented"]),
        (&Json::Null, &json!(2.0))
    );
    assert_eq!(
        (&up[0]["proposed"], &up[2]["proposed"]),
        (&json!(1.0), &json!(0.9))
    );
    let quest = &tracks[1]["trials"];
    assert!(quest[1]["estimate"].as_f64() > quest[0]["estimate"].as_f64());
    assert_eq!(tracks[1]["summary"]["trials"], 1);
}

#[test]
fn faults_of_a_file_of_answers_are_named_with_their_line() {
    let rule = r#"{ rule = "staircase", up = 1, down = 1, start = 1.0, steps = [0.1], stop = { reversals = 1, max_trials = 3 } }"#;
    let folder = tempfile::tempdir().unwrap();
    let tracks = [("up", rule.to_owned()), ("down", rule.to_owned())];
    protocol(folder.path(), "range = [0.1, 2.0]\nsteps = 20", &tracks);
    for (answers, says) in [
        (
            "track,answer\nup,maybe\n",
            "line 2: answer is `maybe`, expected 1 or 0",
        ),
        ("track,answer\npu,1\n", "line 2: track is `pu`, expected up"),
        ("answer\n1\n", "no column `track`"),
        ("track\nup\n", "no column `answer`"),
        ("track,answer\n", "no answers"),
        (
            "track,answer,presented\nup,1,1.03\n",
            "line 2: presented is `1.03`, expected a level of the ladder, 0.1 to 2",
        ),
        (
            "track,answer\nup,1\nup,1\nup,1\nup,1\n",
            "line 5: the track `up` has ended after 3 trials",
        ),
    ] {
        fs::write(folder.path().join("answers.csv"), answers).unwrap();
        let arguments = ["schedule", "p", "--answers", "answers.csv"];
        study(folder.path(), &arguments)
            .code(1)
            .stderr(contains(says));
    }
    study(folder.path(), &["schedule", "p", "--json"]).code(2);
    let rows = ["schedule", "p", "--answers", "answers.csv", "--rows", "1-2"];
    study(folder.path(), &rows).code(2);
    fs::write(
        folder.path().join("answers.csv"),
        "track,answer\nup,1\nup,0\n",
    )
    .unwrap();
    let arguments = ["schedule", "p", "--answers", "answers.csv"];
    study(folder.path(), &arguments)
        .success()
        .stdout(contains("\nended\n"));
}

/// The constant stimuli of a row are those of its session.
#[test]
fn constant_stimuli_come_in_the_order_of_the_row() {
    let folder = tempfile::tempdir().unwrap();
    let rule = r#"{ rule = "constant", levels = [0.5, 1.0, 2.0], repetitions = 3 }"#;
    protocol(
        folder.path(),
        "levels = [0.5, 1.0, 2.0]",
        &[("c", rule.to_owned())],
    );
    fs::write(
        folder.path().join("answers.csv"),
        "answer\n".to_owned() + &"1\n".repeat(9),
    )
    .unwrap();
    let proposed = |row: &str| {
        let arguments = [
            "schedule",
            "p",
            "--answers",
            "answers.csv",
            "--json",
            "--rows",
            row,
        ];
        let output = study(folder.path(), &arguments)
            .success()
            .get_output()
            .clone();
        let document: Json = serde_json::from_slice(&output.stdout).unwrap();
        of_trials(&document["tracks"][0], "proposed")
    };
    let first = proposed("1");
    assert!((2..9).any(|row| proposed(&row.to_string()) != first));
    let mut sorted = first;
    sorted.sort_by(f64::total_cmp);
    assert_eq!(sorted, [0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
}

#[test]
fn the_orders_of_parts_are_shown_with_their_balance() {
    let folder = tempfile::tempdir().unwrap();
    study(
        folder.path(),
        &["new", "--seed", "20261123", "pairs", "--kind", "pairs"],
    )
    .success();
    let file = folder.path().join("pairs/protocol.toml");
    let text = fs::read_to_string(&file).unwrap();
    let parts = "[[questions]]\nid = \"realism\"\nkind = \"rating\"\nprompt = \"?\"\nfrom = 1\nto = 7\n\n\
                 [[parts]]\nid = \"rated\"\nkind = \"rating\"\nrepetitions = 2\norder = \"williams\"\n\n[analysis]";
    fs::write(
        &file,
        text.replace("seed = 1 ", "seed = 7 ")
            .replace("[analysis]", parts),
    )
    .unwrap();
    let shown = |rows: &str| {
        let arguments = ["schedule", "pairs", "--rows", rows];
        let output = study(folder.path(), &arguments)
            .success()
            .get_output()
            .clone();
        String::from_utf8(output.stdout).unwrap()
    };
    let text = shown("1-6");
    assert!(text.contains("2 parts, 12 trials\n"), "{text}");
    assert!(
        text.contains(
            "Part more-real\nblocked, 3 pairs × 2 repetitions, order of the two balanced\n"
        ),
        "{text}"
    );
    assert!(
        text.contains("Order of the two: balanced over these rows."),
        "{text}"
    );
    assert!(
        text.contains("Part rated\nwilliams, 3 realizations × 2 repetitions\n"),
        "{text}"
    );
    assert!(text.contains("Carry-over: balanced"), "{text}");
    let random = fs::read_to_string(&file).unwrap();
    fs::write(
        &file,
        random.replace(
            "interval_order = \"balanced\"",
            "interval_order = \"random\"",
        ),
    )
    .unwrap();
    let text = shown("1-5");
    assert!(
        text.contains("Order of the two: drawn for each trial; "),
        "{text}"
    );

    study(
        folder.path(),
        &["new", "--seed", "20261123", "up", "--kind", "staircase"],
    )
    .success();
    let arguments = ["schedule", "up", "--rows", "1-2"];
    let output = study(folder.path(), &arguments)
        .success()
        .get_output()
        .clone();
    let text = String::from_utf8(output.stdout).unwrap();
    for part in [
        "1 part, 134 trials at most\n",
        "a  high: 2ifc, 1 up, 3 down (settles at 79.4 %) from 0.5, 60 trials at most\n",
        "  a  134: CS ",
        "; easy 14, catch 0\n",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    let lines = text.lines().filter(|line| line.chars().count() > 100);
    assert_eq!(lines.count(), 0, "{text}");
}
