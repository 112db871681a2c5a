//! `study analyze TABLE.csv --task …`.
#![allow(clippy::unwrap_used)]

use assert_cmd::Command;
use serde_json::Value as Json;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

pub(crate) fn analyze(folder: &Path, table: &str, args: &[&str]) -> Command {
    let path = folder.join("t.csv");
    fs::write(&path, table).unwrap();
    let mut command = Command::cargo_bin("study").unwrap();
    command
        .current_dir(folder)
        .args(["analyze", "t.csv"])
        .args(args);
    command
}

pub(crate) fn text(command: &mut Command) -> String {
    let done = command.assert().success();
    String::from_utf8(done.get_output().stdout.clone()).unwrap()
}

pub(crate) fn values(command: &mut Command) -> Json {
    let document: Json = serde_json::from_str(&text(command)).unwrap();
    assert_eq!(document["format"], "study-trials/1");
    document["values"].clone()
}

/// The input of a reference file and the expected value of an identifier.
pub(crate) fn golden(name: &str) -> Json {
    let path = format!(
        "{}/tests/golden/psychophysics/{name}.json",
        env!("CARGO_MANIFEST_DIR")
    );
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

pub(crate) fn csv(head: &str, golden: &Json, row: impl Fn(&[Json]) -> String) -> String {
    let mut table = format!("{head}\n");
    for cells in golden["input"]["rows"].as_array().unwrap() {
        writeln!(table, "{}", row(cells.as_array().unwrap())).unwrap();
    }
    table
}

fn plain(cell: &Json) -> String {
    cell.as_str()
        .map_or_else(|| cell.to_string(), str::to_owned)
}

pub(crate) fn joined(cells: &[Json]) -> String {
    cells.iter().map(plain).collect::<Vec<_>>().join(",")
}

pub(crate) fn close(got: &Json, want: &Json, id: &str) {
    let (got, want) = (
        got[id].as_f64().unwrap(),
        want["expected"][id]["value"].as_f64().unwrap(),
    );
    assert!(
        (got - want).abs() <= 1e-4 * want.abs(),
        "{id}: {got} is not {want}"
    );
}

#[test]
fn thresholds_of_a_forced_choice() {
    let folder = tempfile::tempdir().unwrap();
    let file = golden("fit_sim_group");
    let table = csv("participant,level,positive,trials", &file, joined);
    let found = values(&mut analyze(
        folder.path(),
        &table,
        &["--task", "2ifc", "--json"],
    ));
    close(&found, &file, "psy/P02/all/ml/threshold");
    close(&found, &file, "psy/pooled/all/ml/width");
    close(&found, &file, "psy_group/all/threshold/geometric_mean");
    assert!(found["psy/P01/all/posterior/threshold/ci95_lo"].is_number());
    assert!(found.get("psy/P01/all/ml/deviance_p_bootstrap").is_none());
    let page = text(&mut analyze(folder.path(), &table, &["--task", "2ifc"]));
    assert!(page.contains("t.csv\n2ifc, 28 rows\n"), "{page}");
    assert!(
        page.contains("P04") && page.contains("geometric mean"),
        "{page}"
    );
    assert!(page.lines().all(|l| l.chars().count() <= 100), "{page}");
    // trial by trial, with the target, gives the same
    let mut single = "participant,level,target,answer\n".to_owned();
    for row in file["input"]["rows"].as_array().unwrap() {
        for trial in 0..row[3].as_u64().unwrap() {
            let target = ["first", "second"][usize::from(trial % 2 == 1)];
            let other = ["second", "first"][usize::from(trial % 2 == 1)];
            let answer = if trial < row[2].as_u64().unwrap() {
                target
            } else {
                other
            };
            writeln!(single, "{},{},{target},{answer}", plain(&row[0]), row[1]).unwrap();
        }
    }
    let same = values(&mut analyze(
        folder.path(),
        &single,
        &["--task", "2ifc", "--json"],
    ));
    assert_eq!(same, found);
}

/// As the programs of experiments write their trials: the same functions as from counts.
#[test]
fn tables_of_psychopy_and_jspsych_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = golden("fit_sim_group");
    let counts = csv("participant,level,positive,trials", &file, joined);
    let args = ["--task", "2ifc", "--json"];
    let expected = values(&mut analyze(folder.path(), &counts, &args));
    // PsychoPy: all columns of all components, an empty row for the instructions.
    let mut psychopy =
        "level,trials.thisN,key_resp.keys,key_resp.corr,key_resp.rt,participant,session,date\n\
                        ,,,,,P01,001,2026-03-02\n,,None,None,,P01,001,2026-03-02\n"
            .to_owned();
    // jsPsych: every cell in quotes, null for what was no answer.
    let mut jspsych = "\"rt\",\"stimulus\",\"response\",\"trial_type\",\"trial_index\",\"subject\",\"level\",\"correct\"\n\
                       \"2310\",\"<p>Welcome</p>\",\" \",\"html-keyboard-response\",\"0\",\"P01\",\"\",\"\"\n"
        .to_owned();
    for row in file["input"]["rows"].as_array().unwrap() {
        for trial in 0..row[3].as_u64().unwrap() {
            let correct = trial < row[2].as_u64().unwrap();
            let (who, level) = (plain(&row[0]), &row[1]);
            let one = u8::from(correct);
            writeln!(
                psychopy,
                "{level},{trial},left,{one},0.{trial}1,{who},001,2026-03-02"
            )
            .unwrap();
            writeln!(
                jspsych,
                "\"612\",\"a.png\",\"f\",\"image-keyboard-response\",\"{trial}\",\"{who}\",\"{level}\",\"{correct}\""
            )
            .unwrap();
        }
    }
    for table in [psychopy, jspsych] {
        let found = values(&mut analyze(folder.path(), &table, &args));
        assert_eq!(found, expected);
    }
    // `response` is the answer where the target is known.
    let table = "participant,level,target,response\nP1,1,first,first\nP1,1,second,first\n";
    let answered = table.replace("response", "answer");
    let found = [table, &answered].map(|t| values(&mut analyze(folder.path(), t, &args)));
    assert_eq!(found[0], found[1]);
    // Whoever is right in a catch trial has said no: the target tells what was answered.
    let mut by_answer = "participant,level,target,answer\n".to_owned();
    let mut by_correct = "participant,level,target,correct,response\n".to_owned();
    for (level, target, yes) in [
        ("1", "yes", 3),
        ("2", "yes", 7),
        ("4", "yes", 9),
        ("", "no", 2),
    ] {
        for trial in 0..10 {
            let said = if trial < yes { "yes" } else { "no" };
            let right = said == target;
            writeln!(by_answer, "P1,{level},{target},{said}").unwrap();
            writeln!(by_correct, "P1,{level},{target},{right},f").unwrap();
        }
    }
    let args = ["--task", "yes-no", "--json"];
    let found = [by_answer, by_correct].map(|t| values(&mut analyze(folder.path(), &t, &args)));
    assert_eq!(found[0], found[1]);
}

#[test]
fn names_are_printed_as_the_data_have_them() {
    let folder = tempfile::tempdir().unwrap();
    let shown = |table: &str, task: &str| {
        let page = text(&mut analyze(folder.path(), table, &["--task", task]));
        for escaped in ["%2F", "%7C", "%25"] {
            assert!(!page.contains(escaped), "{page}");
        }
        page
    };
    let mut table = "participant,condition,target,answer\n".to_owned();
    for condition in ["a/b", "c%d"] {
        for target in ["first", "second"] {
            writeln!(table, "p|1,{condition},{target},first").unwrap();
        }
    }
    let page = shown(&table, "2ifc");
    assert!(page.contains("p|1") && page.contains("a/b") && page.contains("c%d"));
    let mut table = "participant,first,second,answer\n".to_owned();
    for (better, worse) in [("new/old", "b|c"), ("b|c", "50%"), ("new/old", "50%")] {
        for (first, second, answer) in [
            (better, worse, "first"),
            (worse, better, "second"),
            (better, worse, "second"),
        ] {
            writeln!(table, "p,{first},{second},{answer}").unwrap();
        }
    }
    let page = shown(&table, "pairs");
    assert!(
        page.contains("b|c − new/old") && page.contains("50% − b|c"),
        "{page}"
    );
    // An ability that is 0 but for rounding.
    assert!(page.contains(" 0.00 ") && !page.contains("e−"), "{page}");
}

#[test]
fn a_comparison_has_a_pse() {
    let folder = tempfile::tempdir().unwrap();
    let file = golden("fit_sim_pse");
    let table = csv("participant,level,positive,trials", &file, |r| {
        format!("P01,{}", joined(r))
    });
    let args = [
        "--task",
        "comparison",
        "--standard",
        "1",
        "--lapse",
        "0",
        "--json",
    ];
    let found = values(&mut analyze(folder.path(), &table, &args));
    for id in ["pse", "jnd", "weber_fraction", "constant_error"] {
        close(&found, &file, &format!("psy/P01/all/{id}"));
    }
    let page = text(&mut analyze(folder.path(), &table, &args[..6]));
    assert!(page.contains("Weber fraction"), "{page}");
}

/// The same counts at the exponentials of the reference's levels: what the reference has as a
/// threshold is its logarithm here.
#[test]
fn functions_over_logarithms_are_those_of_the_reference() {
    let folder = tempfile::tempdir().unwrap();
    let row = |r: &[Json]| format!("P01,{},{},{}", r[0].as_f64().unwrap().exp(), r[1], r[2]);
    let head = "participant,level,positive,trials";
    let file = golden("fit_sim_weibull_3afc");
    // A level of 0 has no logarithm.
    let table = csv(head, &file, row) + "P01,0,5,12\n";
    let args = ["--task", "3ifc", "--fit-scale", "log", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &args));
    let want = |id: &str| file["expected"][id]["value"].as_f64().unwrap();
    let number = |id: &str| found[id].as_f64().unwrap();
    for (id, tolerance) in [
        ("ml/threshold", 1e-6),
        ("ml_lapse/threshold", 1e-4),
        ("map/threshold", 1e-4),
        ("posterior/threshold/ci95_lo", 0.006),
        ("posterior/threshold/ci95_hi", 0.006),
    ] {
        let id = format!("psy/P01/all/{id}");
        assert!((number(&id).ln() - want(&id)).abs() < tolerance, "{id}");
    }
    for id in ["ml/width", "ml/deviance", "ml/se_width", "n_trials"] {
        close(&found, &file, &format!("psy/P01/all/{id}"));
    }
    let se = want("psy/P01/all/ml/se_threshold") * want("psy/P01/all/ml/threshold").exp();
    assert!((number("psy/P01/all/ml/se_threshold") - se).abs() < 1e-6);
    assert_eq!(number("psy/P01/all/n_left_out"), 12.0);
    assert_eq!(number("psy/P01/all/log_scale"), 1.0);
    // The mean of the level: e^(m + s²/2) of a normal posterior of the logarithm.
    let mean = number("psy/P01/all/posterior/threshold/mean").ln();
    let spread = want("psy/P01/all/posterior/threshold/ci95_hi")
        - want("psy/P01/all/posterior/threshold/ci95_lo");
    let expected = want("psy/P01/all/posterior/threshold/mean") + (spread / 3.92).powi(2) / 2.0;
    assert!((mean - expected).abs() < 2e-3, "{mean} {expected}");
    let page = text(&mut analyze(folder.path(), &table, &args[..4]));
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(page.contains("natural logarithm of a ratio"), "{page}");

    // R 4.2.2: optim and optimHess of the probit likelihood, with the delta method.
    let file = golden("fit_sim_pse");
    let table = csv(head, &file, row);
    let args = [
        "--task",
        "comparison",
        "--fit-scale",
        "log",
        "--core",
        "norm",
        "--lapse",
        "0",
        "--standard",
        "2.718281828",
        "--json",
    ];
    let found = values(&mut analyze(folder.path(), &table, &args));
    for (id, expected) in [
        ("pse", 2.747821),
        ("se_pse", 0.05279952),
        ("pse_ci95_lo", 2.646261),
        ("pse_ci95_hi", 2.85328),
        ("jnd", 0.3582593),
        ("se_jnd", 0.03600095),
    ] {
        let got = found[format!("psy/P01/all/{id}")].as_f64().unwrap();
        assert!((got / expected - 1.0).abs() < 1e-5, "{id}: {got}");
    }
}

#[test]
fn a_ladder_over_logarithms_has_a_ratio() {
    let folder = tempfile::tempdir().unwrap();
    let table = "participant,level,positive,trials\nP01,0.1,6,10\nP01,0.11,9,10\n";
    let with = |scale: &str, ladder: &str| {
        let args = [
            "--task",
            "2ifc",
            "--json",
            "--fit-scale",
            scale,
            "--ladder",
            ladder,
        ];
        analyze(folder.path(), table, &args)
    };
    let width = |ladder: &str| {
        let found = values(&mut with("log", ladder));
        let end = |id: &str| found[format!("psy/P01/all/posterior/threshold/ci95_{id}")].as_f64();
        end("hi").unwrap() / end("lo").unwrap()
    };
    assert!(width("0.02..0.6:1.1") > 1.5 * width("0.09..0.12:1.1"));
    for (scale, ladder, says) in [
        ("log", "0..0.6:1.1", "above 0"),
        ("log", "0.02..0.6:0.05", "the ratio of two neighbors"),
        ("log", "0.02..0.6:1", "the ratio of two neighbors"),
        ("lin", "0.6..0.02:0.1", "the step"),
        ("lin", "0..1", "--ladder"),
    ] {
        with(scale, ladder)
            .assert()
            .failure()
            .stderr(predicates::str::contains(says));
    }
}

#[test]
fn sensitivities_come_from_targets_and_answers() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = "participant,condition,target,answer,trials\n".to_owned();
    let file = golden("sdt_2afc");
    for row in file["input"]["rows"].as_array().unwrap() {
        let n = |i: usize| row[i].as_u64().unwrap();
        for (target, answer, count) in [
            ("first", "first", n(1)),
            ("first", "second", n(2) - n(1)),
            ("second", "first", n(3)),
            ("second", "second", n(4) - n(3)),
        ] {
            writeln!(table, "P01,{},{target},{answer},{count}", plain(&row[0])).unwrap();
        }
    }
    let found = values(&mut analyze(
        folder.path(),
        &table,
        &["--task", "2ifc", "--json"],
    ));
    for condition in ["unbiased", "first_favoured", "perfect"] {
        close(&found, &file, &format!("sdt/P01/{condition}/d"));
        close(&found, &file, &format!("sdt/P01/{condition}/d_se"));
    }
    close(&found, &file, "sdt/P01/first_favoured/interval_bias");
    let page = text(&mut analyze(folder.path(), &table, &["--task", "2ifc"]));
    assert!(
        page.contains("d′") && page.contains("first_favoured"),
        "{page}"
    );
}

#[test]
fn preferences_magnitudes_and_ratings_have_their_tables() {
    let folder = tempfile::tempdir().unwrap();
    let file = golden("pairs_sim_order_clusters");
    let table = csv("participant,first,second,answer", &file, joined);
    let found = values(&mut analyze(
        folder.path(),
        &table,
        &["--task", "pairs", "--json"],
    ));
    close(&found, &file, "pairs/m1|m3/difference");
    close(&found, &file, "pairs/m1|m3/se_clustered");
    close(&found, &file, "pairs/order");
    let page = text(&mut analyze(folder.path(), &table, &["--task", "pairs"]));
    assert!(
        page.contains("ability") && page.contains("Order:"),
        "{page}"
    );

    let file = golden("magnitude_estimation");
    let table = csv("participant,level,repetition,estimate", &file, joined);
    let found = values(&mut analyze(
        folder.path(),
        &table,
        &["--task", "magnitude", "--json"],
    ));
    close(&found, &file, "magnitude/exponent");
    let page = text(&mut analyze(
        folder.path(),
        &table,
        &["--task", "magnitude"],
    ));
    assert!(page.contains("1 estimate left out"), "{page}");

    let file = golden("mushra_screening");
    let table = csv("participant,item,condition,role,rating", &file, |r| {
        let role = match plain(&r[2]).as_str() {
            "hidden-reference" => "hidden-reference",
            "anchor-mid" => "mid-anchor",
            "anchor-low" => "low-anchor",
            _ => "test",
        };
        format!("{},{role},{}", joined(&r[..3]), r[3])
    });
    let found = values(&mut analyze(
        folder.path(),
        &table,
        &["--task", "mushra", "--json"],
    ));
    close(&found, &file, "mushra/m1/ci95_half");
    assert_eq!(found["mushra/n_kept"], 4.0);
    let page = text(&mut analyze(folder.path(), &table, &["--task", "mushra"]));
    assert!(
        page.contains("Screened, and only in the last column, the mean over all: P04, P05."),
        "{page}"
    );
}

#[test]
fn identification_has_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let file = golden("identification_sim");
    let table = csv("participant,realization,target,answer", &file, joined);
    let found = values(&mut analyze(
        folder.path(),
        &table,
        &["--task", "identification", "--json"],
    ));
    for id in [
        "information/corrected",
        "above_guessing/p",
        "pair/buzz|soft%2Flong/similarity",
        "realization/m4/correct_ci95_lo",
    ] {
        close(&found, &file, &format!("identification/{id}"));
    }
    let page = text(&mut analyze(
        folder.path(),
        &table,
        &["--task", "identification"],
    ));
    assert!(
        page.contains("soft/long") && page.contains("Information transfer: 0.60 bits"),
        "{page}"
    );
    let answered = table.replace("target,answer", "target,response");
    let again = values(&mut analyze(
        folder.path(),
        &answered,
        &["--task", "identification", "--json"],
    ));
    assert_eq!(again, found);
    let empty = "participant,target,answer\nP1,a,\n";
    let done = analyze(folder.path(), empty, &["--task", "identification"])
        .assert()
        .code(1);
    let said = String::from_utf8(done.get_output().stderr.clone()).unwrap();
    assert!(
        said.contains("t.csv:2: answer is ``, expected a label"),
        "{said}"
    );
}

/// What cannot be estimated is named with its reason, and the command succeeds.
#[test]
fn what_is_undefined_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let table =
        "participant,level,positive,trials\nP1,1,10,20\nP1,2,10,20\nP1,3,20,20\nP1,4,20,20\n";
    let page = text(&mut analyze(folder.path(), table, &["--task", "2ifc"]));
    assert!(
        page.contains("P1 all: no maximum of the likelihood: a step"),
        "{page}"
    );
    let table = "first,second,answer\na,b,first\nc,d,second\n";
    let page = text(&mut analyze(folder.path(), table, &["--task", "pairs"]));
    assert!(
        page.contains("no comparison joins {a, b} with {c, d}"),
        "{page}"
    );
}

#[test]
fn a_bad_table_is_refused_with_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    for (table, task, said) in [
        (
            "participant;level;correct\nP1;0,1;1\n",
            "2ifc",
            "t.csv: the columns are separated by semicolons; a table has commas, and decimal points",
        ),
        (
            "participant,level,correct\nP1,1,yes\n",
            "2ifc",
            "t.csv:2: correct is `yes`, expected true, false, 1 or 0",
        ),
        (
            "participant,level,correct\nP1,1,1\n",
            "yes-no",
            "there is no column `target`",
        ),
        (
            "participant,level,correct\nP1,1,1\n",
            "comparison",
            "there is no column `target`",
        ),
        (
            "participant,level\nP1,1\n",
            "2ifc",
            "there is no column `answer`",
        ),
        (
            "participant,level,positive,trials\nP1,1,3,2\n",
            "2ifc",
            "t.csv:2: positive is `3`, expected a number from 0 to 2",
        ),
        (
            "participant,target,answer\nP1,first,yes\n",
            "2ifc",
            "t.csv:2: answer is `yes`, expected first, second",
        ),
        (
            "participant,level,estimate\nP1,1,\u{1b}[2J\n",
            "magnitude",
            "estimate is",
        ),
        (
            "participant,level,estimate\n",
            "magnitude",
            "there are no rows",
        ),
        ("participant,level,estimate\nP1,1\n", "magnitude", "t.csv"),
    ] {
        let done = analyze(folder.path(), table, &["--task", task])
            .assert()
            .code(1);
        let said_in_fact = String::from_utf8(done.get_output().stderr.clone()).unwrap();
        assert!(said_in_fact.contains(said), "{said_in_fact}");
        assert!(!said_in_fact.contains('\u{1b}'), "{said_in_fact:?}");
    }
    let folder_given = Command::cargo_bin("study")
        .unwrap()
        .current_dir(folder.path())
        .args(["analyze", ".", "--task", "2ifc"])
        .assert()
        .code(1);
    let said = String::from_utf8(folder_given.get_output().stderr.clone()).unwrap();
    assert!(said.contains("--task is for a table of trials"), "{said}");
}
