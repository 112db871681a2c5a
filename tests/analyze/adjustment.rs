//! Adjustment: tables of settings, and a rehearsed study.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts::{analyzed, cells, of_table, study};
use crate::trials::{analyze, text, values};
use std::fs;

const HEAD: &str = "participant,start,level,standard\n";

#[test]
fn settings_have_their_table() {
    let folder = tempfile::tempdir().unwrap();
    // Six participants, with the numbers of R in crates/study-stats/src/adjustment.rs.
    let people: [(&[f64], &[f64]); 6] = [
        (&[0.9, 1.0, 1.1], &[1.2, 1.1, 1.3]),
        (&[1.2, 1.1, 1.0], &[1.2, 1.4, 1.3]),
        (&[0.8, 0.9, 0.9], &[1.0, 1.0, 0.9]),
        (&[1.3, 1.1], &[1.3, 1.5, 1.2]),
        (&[1.0, 1.2, 1.1], &[1.1, 1.0, 1.3]),
        (&[1.4], &[1.5]),
    ];
    let mut table = HEAD.to_owned();
    for (who, (below, above)) in (1..).zip(people) {
        for (side, levels) in [("below", below), ("above", above)] {
            for level in levels {
                table += &format!("P{who},{side},{level},1\n");
            }
        }
    }
    let arguments = ["--task", "adjustment", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &arguments));
    for (id, expected) in [
        ("n", 31.0),
        ("n_participants", 6.0),
        ("pse", 1.175),
        ("pse_ci95_lo", 0.987_026_966_145_119),
        ("error/t", 2.393_172_105_652_4),
        ("error/p", 0.062_143_319_372_778),
        ("start/difference", -0.127_777_777_777_778),
        ("start/p", 0.004_722_863_406_675),
        ("spread/sd", 0.109_223_736_254_55),
        ("participant/P6/pse", 1.45),
    ] {
        let found = found[format!("adjustment/{id}")].as_f64().unwrap();
        assert!((found - expected).abs() < 1e-9, "{id}: {found}");
    }
    let page = text(&mut analyze(
        folder.path(),
        &table,
        &["--task", "adjustment"],
    ));
    assert!(
        page.contains("participant  settings     PSE")
            && page.contains("Mean point of subjective equality"),
        "{page}"
    );
    for (rows, said) in [
        (
            "P1,left,1.0,1\n",
            "t.csv:2: start is `left`, expected below, above",
        ),
        (
            "P1,below,1.0,1\nP1,above,1.2,2\n",
            "t.csv:3: standard is `2`, expected 1: a table has one standard",
        ),
    ] {
        let done = analyze(
            folder.path(),
            &format!("{HEAD}{rows}"),
            &["--task", "adjustment"],
        )
        .assert()
        .code(1);
        let error = String::from_utf8(done.get_output().stderr.clone()).unwrap();
        assert!(error.contains(said), "{error}");
    }
}

/// Ten hands whose point of equality is the standard come to it within three standard errors; the analysis of the study is
/// that of a table of its settings, and no change was larger than a step.
#[test]
fn hands_with_a_known_point_of_equality_find_it() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        vec![
            "new",
            "--seed",
            "20261128",
            "adjustment",
            "--kind",
            "adjustment",
        ],
        vec![
            "rehearse",
            "adjustment",
            "--participants",
            "10",
            "--out",
            "out",
        ],
    ] {
        let (code, _, err) = study(&arguments, folder.path());
        assert_eq!(code, 0, "{err}");
    }
    let part = analyzed(folder.path())["parts"][0].clone();
    // Three settings from each side.
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"adjustment".into(), &60.into())
    );
    let number = |id: &str| part["values"][format!("adjustment/{id}")].as_f64().unwrap();
    let se = number("pse_sd") / 10f64.sqrt();
    assert!(
        (number("pse") - 1.0).abs() < 3.0 * se,
        "{} ± {se}",
        number("pse")
    );
    // Hands stay half a step behind.
    let behind = number("start/difference");
    assert!((-0.1..0.0).contains(&behind), "{behind}");
    assert!(number("changes") > 5.0);
    for (at, question) in ["adjusted", "starts"].iter().enumerate() {
        assert_eq!(part["findings"][at]["question"], *question);
    }
    let results = folder.path().join("out/adjustment");
    let columns = ["participant", "trial", "interval", "level", "target"];
    let felt = cells(&results.join("intervals.csv"), &columns);
    for two in felt.windows(2) {
        let [a, b] = two else { panic!() };
        if a[..2] == b[..2] && a[4] == "true" && b[4] == "true" {
            let level = |row: &[String]| row[3].parse::<f64>().unwrap();
            assert!((level(a) - level(b)).abs() < 0.05 + 1e-9, "{a:?} {b:?}");
        }
    }
    let columns = ["participant", "trial", "equal", "level", "practice"];
    let mut table = HEAD.to_owned();
    for row in cells(&results.join("ratings.csv"), &columns) {
        assert_eq!(row[2], row[3]);
        if row[4] == "true" {
            continue;
        }
        let own = |f: &&Vec<String>| f[..2] == row[..2] && f[4] == "true";
        let start: f64 = felt.iter().find(own).unwrap()[3].parse().unwrap();
        let side = if start < 1.0 { "below" } else { "above" };
        table += &format!("{},{side},{},1\n", row[0], row[2]);
    }
    let of_table = of_table(folder.path(), &table, &["adjustment"]);
    let mut compared = 0;
    for (id, value) in part["values"].as_object().unwrap() {
        // What is drawn, and what a table does not have.
        if id.contains("sd_ci95") || id.ends_with("/changes") {
            continue;
        }
        let (a, b) = (value.as_f64().unwrap(), of_table[id].as_f64().unwrap());
        assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{id}: {a} {b}");
        compared += 1;
    }
    assert!(compared > 60, "{compared}");
    let (code, page, err) = study(&["analyze", "out/adjustment"], folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(
        page.contains("Do settings differ from the standard?"),
        "{page}"
    );
    let analysis = results.join("analysis");
    assert!(analysis.join("figures/part-1-settings.svg").is_file());
    assert_eq!(
        cells(&analysis.join("part_adjustment.csv"), &["participant"]).len(),
        10
    );
    let report = fs::read_to_string(analysis.join("report.html")).unwrap();
    assert!(report.contains("The point of subjective equality was"));
    // Nothing of intervals, each of which is felt once and for a time.
    let felt = "Levels were 0.5 s apart. Each could be changed at once, and confirmed after 1 s. The standard could be felt again \
                at any time.";
    assert!(report.contains(felt) && !report.contains("Nothing could be felt again"));
    let (code, out, err) = study(&["verify", "out"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
}

/// A setting goes by the strokes of the level that was confirmed: those on the way are passed.
#[test]
fn settings_are_excluded_by_the_level_that_was_confirmed() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, _, err) = study(arguments, folder.path());
        assert_eq!(code, 0, "{err}");
    };
    run(&["new", "--seed", "20261128", "set", "--kind", "adjustment"]);
    let rehearse = ["rehearse", "set", "--participants", "4", "--out"];
    run(&[&rehearse[..], &["first"]].concat());
    let results = folder.path().join("first/set");
    let columns = ["participant", "trial", "attempt", "strokes"];
    let felt = cells(&results.join("intervals.csv"), &columns);
    let columns = ["participant", "trial", "attempt", "practice"];
    let mut settings = cells(&results.join("ratings.csv"), &columns);
    settings.retain(|row| row[3] == "false");
    let strokes = |row: &Vec<String>| -> Vec<u32> {
        let own = felt.iter().filter(|f| f[..3] == row[..3]);
        own.map(|f| f[3].parse().unwrap_or(0)).collect()
    };
    let all: Vec<Vec<u32>> = settings.iter().map(strokes).collect();
    let last = |own: &Vec<u32>| *own.last().unwrap();
    let mut sorted: Vec<u32> = all.iter().map(last).collect();
    sorted.sort_unstable();
    let least = sorted[sorted.len() / 2];
    let excluded = all.iter().filter(|own| last(own) < least).count();
    let passed = all.iter().filter(|own| own.iter().any(|n| *n < least));
    assert!(passed.count() > excluded, "{all:?}");

    // The same hands, and the rule.
    let file = folder.path().join("set/protocol.toml");
    let protocol = fs::read_to_string(&file).unwrap();
    let rule = format!(r#"exclude = [{{ rule = "strokes-below", strokes = {least} }}]"#);
    fs::write(&file, format!("{protocol}\n{rule}\n")).unwrap();
    run(&[&rehearse[..], &["out"]].concat());
    let part = analyzed(folder.path())["parts"][0].clone();
    assert_eq!(part["exclusions"][0]["rows"], excluded);
    assert_eq!(part["trials"], settings.len() - excluded);
}
