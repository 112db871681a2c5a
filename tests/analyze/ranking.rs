//! Ranking: tables of ranks, and a rehearsed study.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts::{analyzed, cells, of_table, rehearsed, study};
use crate::trials::{analyze, close, csv, golden, joined, text, values};
use std::fs;

#[test]
fn ranking_has_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let file = golden("ranking_sim");
    let table = csv("participant,ranking,realization,rank", &file, joined);
    let arguments = ["--task", "ranking", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &arguments));
    for id in [
        "agreement/w",
        "realization/m2/log_worth_se",
        "ties/3/log_delta",
        "pair/m1|m2/p_holm",
        "participant/P5/with_others",
    ] {
        close(&found, &file, &format!("ranking/{id}"));
    }
    let page = text(&mut analyze(folder.path(), &table, &["--task", "ranking"]));
    for part in ["mean rank", "m1 − m2", "Ties of 2: ln δ = −1.58", "own W"] {
        assert!(page.contains(part), "{part}:\n{page}");
    }
    let word = "participant,realization,rank\nP1,a,first\n";
    let done = analyze(folder.path(), word, &["--task", "ranking"])
        .assert()
        .code(1);
    let said = String::from_utf8(done.get_output().stderr.clone()).unwrap();
    assert!(said.contains("t.csv:2: rank is `first`"), "{said}");
}

/// Salad dressings ranked by tartness by 32 judges (Vargo 1989, in Critchlow & Fligner 1991). Values of R as in
/// crates/study-stats/tests/reference/ranking.R.
#[test]
fn the_salads_of_vargo_differ_in_tartness() {
    let counted = [
        ([4, 3, 2, 1], 1),
        ([3, 4, 2, 1], 1),
        ([4, 3, 1, 2], 1),
        ([4, 1, 3, 2], 6),
        ([3, 1, 4, 2], 1),
        ([4, 2, 1, 3], 3),
        ([4, 1, 2, 3], 11),
        ([2, 1, 4, 3], 2),
        ([2, 3, 1, 4], 1),
        ([3, 1, 2, 4], 2),
        ([2, 1, 3, 4], 1),
        ([1, 2, 3, 4], 2),
    ];
    // Without a column for it, each has one ranking.
    let mut table = "participant,realization,rank\n".to_owned();
    let mut judge = 0;
    for (ranks, judges) in counted {
        for _ in 0..judges {
            judge += 1;
            for (salad, rank) in ["A", "B", "C", "D"].iter().zip(ranks) {
                table += &format!("J{judge},{salad},{rank}\n");
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--task", "ranking", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &arguments));
    let number = |id: &str| found[format!("ranking/{id}")].as_f64().unwrap();
    for (id, expected, tolerance) in [
        ("n", 32.0, 0.0),
        ("agreement/w", 0.428_125, 1e-9),
        ("agreement/chi2", 41.1, 1e-9),
        ("realization/B/mean_rank", 1.4375, 1e-12),
        ("realization/A/log_worth", -1.329_572_098, 1e-6),
        ("realization/B/log_worth", 1.400_341_881, 1e-6),
        ("realization/B/log_worth_se", 0.252_124_869, 1e-6),
        ("pair/A|B/difference", -2.729_913_980, 1e-6),
        ("pair/A|B/se_clustered", 0.554_871_119, 1e-6),
        ("pair/A|B/above", 4.0 / 32.0, 1e-12),
        // B is above each other one; of C it is the least sure.
        ("best/difference", 1.168_375_468, 1e-6),
        ("best/p", 0.032_279_305, 1e-6),
    ] {
        let found = number(id);
        assert!((found - expected).abs() <= tolerance, "{id}: {found}");
    }
    assert!(number("agreement/p") < 0.001);
}

/// Ten people, all of whom put e last and a first: worths of the others, bounds of the two ends, and no sentence that is cut.
#[test]
fn what_everybody_puts_first_or_last_has_bounds() {
    let orders = [
        "a b c d e",
        "a c b d e",
        "a b d c e",
        "a b c d e",
        "a d b c e",
        "a b c d e",
        "a c d b e",
        "a b c d e",
        "a c b d e",
        "a d c b e",
    ];
    let mut table = "participant,realization,rank\n".to_owned();
    for (person, order) in orders.iter().enumerate() {
        for (rank, realization) in (1..).zip(order.split(' ')) {
            table += &format!("P{person},{realization},{rank}\n");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--task", "ranking", "--json"];
    let found = values(&mut analyze(folder.path(), &table, &arguments));
    let number = |id: &str| found[format!("ranking/{id}")].as_f64();
    for (id, level) in [("a", 1.0), ("b", 2.0), ("c", 2.0), ("d", 2.0), ("e", 3.0)] {
        assert_eq!(
            number(&format!("realization/{id}/level")),
            Some(level),
            "{id}"
        );
    }
    // SciPy as in crates/study-stats/tests/reference/ranking_levels.py: ten of ten.
    let bound = 0.807_154_865_25;
    for (id, expected) in [
        ("pair/a|e/ci95_lo", bound),
        ("pair/a|b/ci95_lo", bound),
        ("best/ci95_lo", bound),
        ("pair/a|b/p", 0.001_953_125),
        // Holm over ten pairs.
        ("best/p", 0.019_531_25),
    ] {
        assert!((number(id).unwrap() - expected).abs() < 1e-9, "{id}");
    }
    for id in [
        "pair/a|e/ci95_hi",
        "pair/a|e/difference",
        "best/difference",
        "realization/e/log_worth",
    ] {
        assert_eq!(number(id), None, "{id}");
    }
    let within: f64 = ["b", "c", "d"]
        .iter()
        .filter_map(|id| number(&format!("realization/{id}/log_worth")))
        .sum();
    assert!(within.abs() < 1e-9);
    assert!(number("pair/b|c/difference").is_some() && number("agreement/p").unwrap() < 0.05);
    let words = |table: &str| {
        let page = text(&mut analyze(folder.path(), table, &["--task", "ranking"]));
        page.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let page = words(&table);
    for said in ["has no upper limit", "one end", "sum to 0 within a level"] {
        assert!(page.contains(said), "{said}:\n{page}");
    }
    let apart = "participant,realization,rank\nP1,a,1\nP1,c,2\nP2,b,1\nP2,c,2\n";
    let why = "No worths: none of the others was ever ranked above a, or with the same rank, and not all realizations were ranked together.";
    let page = words(apart);
    assert!(page.contains(why), "{page}");
}

/// Everybody felt the realizations in one order: what ranks have in common may be due to it.
#[test]
fn ranks_in_one_order_for_everybody_decide_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let arguments = ["new", "--seed", "7", "ranking", "--kind", "ranking"];
    let (code, _, err) = study(&arguments, at);
    assert_eq!(code, 0, "{err}");
    let path = at.join("ranking/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let fixed = text.replace("order = \"williams\"", "order = \"fixed\"");
    assert_ne!(text, fixed);
    fs::write(&path, fixed).unwrap();
    let arguments = ["rehearse", "ranking", "--participants", "6", "--out", "out"];
    let (code, _, err) = study(&arguments, at);
    assert_eq!(code, 0, "{err}");
    let part = analyzed(at)["parts"][0].clone();
    for finding in part["findings"].as_array().unwrap() {
        assert_eq!(finding["verdict"], "undefined", "{finding}");
    }
    assert!(part["values"]["ranking/agreement/w"].is_number());
    assert!(part["values"]["ranking/agreement/p"].is_null());
    let why = part["undefined"]["ranking/agreement/p"].as_str().unwrap();
    assert!(why.contains("in the same order"), "{why}");
}

/// The study and a table of its ranks have the same statistics.
#[test]
fn a_rehearsed_ranking_is_that_of_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let part = rehearsed(folder.path(), "ranking");
    let results = folder.path().join("out/ranking");
    let ranks = ["order", "order-2", "order-3", "order-4"];
    let columns = [&["participant", "trial", "model"][..], &ranks].concat();
    let rows = cells(&results.join("ratings.csv"), &columns);
    assert_eq!(rows.len(), 2 * 2);
    let columns = ["participant", "trial", "interval", "model"];
    let felt = cells(&results.join("intervals.csv"), &columns);
    let mut table = "participant,ranking,realization,rank\n".to_owned();
    for row in &rows {
        assert_eq!(row[2], "");
        let mut own: Vec<&str> = row[3..].iter().map(String::as_str).collect();
        for (interval, rank) in (1..).zip(&row[3..]) {
            let interval: String = format!("{interval}");
            let model = felt.iter().find(|f| f[..2] == row[..2] && f[2] == interval);
            table += &format!("{},{},{},{rank}\n", row[0], row[1], model.unwrap()[3]);
        }
        // Each rank is given once.
        own.sort_unstable();
        assert_eq!(own, ["1", "2", "3", "4"]);
    }
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"ranking".into(), &4.into())
    );
    let values = part["values"].as_object().unwrap();
    let of_table = of_table(folder.path(), &table, &["ranking"]);
    for (id, value) in values {
        let (a, b) = (value.as_f64(), of_table[id].as_f64());
        let close = (a.zip(b)).is_none_or(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0));
        assert!(a.is_some() == b.is_some() && close, "{id}: {value}");
    }
    assert!(values.len() > 60, "{}", values.len());
    let asked: Vec<&str> = (part["findings"].as_array().unwrap().iter())
        .map(|finding| finding["question"].as_str().unwrap())
        .collect();
    assert_eq!(asked, ["ranked-alike", "ranked-first"]);
    let (code, page, err) = study(&["analyze", "out/ranking"], folder.path());
    assert_eq!(code, 0, "{err}");
    for said in [
        "Do participants rank the realizations alike?",
        "Is one realization ranked above each other one?",
        "Mean ranks: ",
    ] {
        assert!(page.contains(said), "{said}:\n{page}");
    }
    let analysis = results.join("analysis");
    for table in ["part_ranks.csv", "part_rank_pairs.csv", "part_rankings.csv"] {
        assert!(analysis.join(table).is_file(), "{table}");
    }
    let report = fs::read_to_string(analysis.join("report.html")).unwrap();
    assert!(report.contains("the model of Plackett (1975) and Luce (1959)"));
    let (code, out, err) = study(&["verify", "out"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
}
