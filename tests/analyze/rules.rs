//! Preregistered rules are applied as stated, results are shown with and without them,
//! and every row states whether it is included.
#![allow(clippy::unwrap_used)]

use study_analysis::analyze::{Analysis, Exclusion, Rules, analyze};
use study_report::{Source, csv, json};
use study_session::outcome::ratings::Ratings;

/// Realizations A, B, C, a hidden reference R, an anchor L and D, a repeat of A.
/// Strokes of the first trial of each participant as given.
fn table(people: &[(&str, [u8; 6], &str)]) -> Ratings {
    let mut text = String::from(
        "study,participant,session,row,trial,block,position,planned_position,model,role,\
         repetition,practice,pilot,simulated,protocol_version,realism,corrected,strokes,attempt,\
         status,vaf\n",
    );
    let models = [
        ("A", "test", "0.7"),
        ("B", "test", "0.8"),
        ("C", "test", "0.9"),
        ("R", "hidden-reference", ""),
        ("L", "low-anchor", ""),
        ("D", "test", "0.7"),
    ];
    for (who, ratings, strokes) in people {
        for (i, ((model, role, vaf), rating)) in models.iter().zip(ratings).enumerate() {
            let n = i + 1;
            let strokes = if i == 0 { *strokes } else { "9" };
            text += &format!(
                "s,{who},1,1,{n},1,{n},{n},{model},{role},1,false,false,false,1,{rating},false,\
                 {strokes},1,ok,{vaf}\n"
            );
        }
    }
    let mut ratings = Ratings::read_csv("r.csv", text.as_bytes(), None).unwrap();
    ratings.set_duplicates([("D", "A")]);
    ratings
}

fn people() -> Ratings {
    table(&[
        //       A  B  C  R  L  D
        ("P1", [2, 4, 6, 7, 1, 2], "2"),
        ("P2", [3, 4, 6, 7, 1, 3], "1"),
        ("P3", [3, 5, 7, 6, 2, 4], ""),
        ("P4", [4, 4, 4, 4, 4, 4], "9"),
        ("P5", [6, 7, 3, 2, 5, 1], "9"),
    ])
}

fn under(rule: Exclusion) -> Analysis {
    let rules = Rules {
        exclude: vec![rule],
        ..Rules::default()
    };
    analyze(&people(), &rules)
}

/// Who lost a row, and how many rows.
fn lost(a: &Analysis) -> (Vec<String>, usize) {
    let gone: Vec<&str> = (a.rows.iter())
        .filter(|r| r.excluded.is_some())
        .map(|r| a.subject(r))
        .collect();
    let mut who: Vec<String> = gone.iter().map(|s| (*s).to_owned()).collect();
    who.dedup();
    (who, gone.len())
}

/// One of the tables of the report.
fn file(a: &Analysis, name: &str) -> String {
    let mut files = csv::tables(&Source::default(), a).into_iter();
    files.find(|f| f.name == name).unwrap().content
}

#[test]
fn each_rule_excludes_exactly_the_participants_it_describes() {
    let of = |rule| lost(&under(rule));
    let all = |who: &str| (vec![who.to_owned()], 6);
    assert_eq!(of(Exclusion::ConstantRater), all("P4"));
    assert_eq!(of(Exclusion::HiddenReferenceBelow(4.0)), all("P5"));
    // D and A are 5 apart for P5, 1 for P3, 0 for the others.
    assert_eq!(of(Exclusion::Inconsistent(1.0)), all("P5"));
    // P1 has exactly 2 strokes.
    assert_eq!(of(Exclusion::StrokesBelow(2.0)), (vec!["P2".to_owned()], 1));
    assert_eq!(of(Exclusion::HiddenReferenceBelow(2.0)), (vec![], 0));
}

#[test]
fn the_order_of_presentation_does_not_decide_who_is_excluded() {
    let under = |references: [&str; 3]| {
        let mut text = String::from("subject,model,rating,role\np,A,5,test\n");
        for rating in references {
            text += &format!("p,R,{rating},hidden-reference\n");
        }
        let rules = Rules {
            exclude: vec![Exclusion::HiddenReferenceBelow(0.2)],
            ..Rules::default()
        };
        let ratings = Ratings::read_csv("r.csv", text.as_bytes(), None).unwrap();
        lost(&analyze(&ratings, &rules)).1
    };
    assert_eq!(under(["0.1", "0.2", "0.3"]), 0);
    assert_eq!(under(["0.3", "0.2", "0.1"]), 0);
    assert_eq!(under(["0.3", "0.2", "0.09"]), 4);
}

#[test]
fn the_main_results_are_given_with_and_without_the_exclusions() {
    let a = under(Exclusion::HiddenReferenceBelow(4.0));
    let plain = analyze(&people(), &Rules::default());
    let r = plain.values.number("corr/pearson/r").unwrap();
    let before = a.values.number("before_exclusion/corr/pearson/r");
    assert_eq!(before, Some(r));
    assert!(a.values.number("corr/pearson/r").unwrap() > r);
    let n = |id: &str| a.values.number(id);
    assert_eq!(
        (n("desc/A/n"), n("before_exclusion/desc/A/n")),
        (Some(4.0), Some(5.0))
    );
    assert!(a.warnings.iter().any(|w| w.code == "with-and-without"));
    let table = file(&a, "with_and_without.csv");
    assert!(table.starts_with("identifier,with,without\r\n"));
    assert!(table.contains("\r\ndesc/A/n,4,5\r\n"), "{table}");
    // Without exclusions there is nothing to show twice.
    let twice = |a: &Analysis| a.values.iter().any(|(id, _)| id.starts_with("before_"));
    assert!(!twice(&plain) && !twice(&under(Exclusion::HiddenReferenceBelow(1.0))));
}

#[test]
fn rules_judge_the_same_rows_whatever_their_order() {
    let two = |first, second| {
        let rules = Rules {
            exclude: vec![first, second],
            ..Rules::default()
        };
        let a = analyze(&people(), &rules);
        (
            lost(&a),
            a.exclusions.iter().map(|e| e.rows).collect::<Vec<_>>(),
        )
    };
    let (a, b) = (
        Exclusion::Inconsistent(1.0),
        Exclusion::HiddenReferenceBelow(5.0),
    );
    let ((one, rows), (other, turned)) = (two(a, b), two(b, a));
    assert_eq!(one, other);
    // P5 is named by the first rule, P4 by the second alone.
    assert_eq!((rows, turned), (vec![6, 6], vec![12, 0]));
}

#[test]
fn every_row_states_whether_it_is_included_and_why_not() {
    let a = under(Exclusion::ConstantRater);
    let counted = "rule,rows,participants,problem\r\nconstant-rater,6,1,\r\n";
    assert_eq!(file(&a, "exclusions.csv"), counted);
    let used = file(&a, "ratings_used.csv");
    assert_eq!(used.lines().count(), 31);
    assert!(used.contains("P1,A,1,1,2,0.7,true,\r\n"));
    assert!(used.contains("P4,A,1,1,4,0.7,false,rule constant-rater\r\n"));
}

#[test]
fn a_rule_of_the_primary_question_judges_no_other() {
    let rules = Rules {
        primary: false,
        exclude: vec![Exclusion::ConstantRater],
        ..Rules::default()
    };
    let a = analyze(&people(), &rules);
    assert_eq!(lost(&a).1, 0);
    assert!(a.warnings.iter().any(|w| w.code == "rule-not-judged"));
}

#[test]
fn references_and_anchors_are_contrasted_and_stay_out_of_the_comparisons() {
    let rules = Rules {
        equivalence_margin: Some(1.0),
        ..Rules::default()
    };
    let a = analyze(&people(), &rules);
    let n = |id: &str| a.values.number(id);
    // C − R: −1, −1, 1, 0, 1.
    assert_eq!(
        (n("reference/R/C/n"), n("reference/R/C/mean_diff")),
        (Some(5.0), Some(0.0))
    );
    // Half the 90 % interval is t(.95, 4)·1/√5 = 2.1318/2.2361 = .9534, within 1.
    assert!((n("reference/R/C/ci90_hi").unwrap() - 0.953_4).abs() < 1e-3);
    assert_eq!(n("reference/R/C/equivalent"), Some(1.0));
    assert_eq!(n("reference/R/A/equivalent"), Some(0.0));
    assert!(n("reference/L/A/mean_diff").is_some());
    assert_eq!(n("corr/n_models"), Some(3.0));
    assert!(a.values.get("posthoc/A|R/t").is_none() && a.values.get("posthoc/A|D/t").is_none());
    // P4 and P5 do not rate the reference above the anchor.
    assert_eq!(n("screen/n_reference_not_above_anchor"), Some(2.0));
    assert_eq!(n("subject/P5/repeat_distance"), Some(5.0));
    // Nobody stated a margin: no test of equivalence, and it says why.
    let a = analyze(&people(), &Rules::default());
    assert!(
        a.values
            .reason("reference/R/C/p_tost")
            .unwrap()
            .contains("no equivalence margin")
    );
}

#[test]
fn the_memory_represents_the_forgetting_factor() {
    let mut text = String::from("subject,model,repetition,rating,vaf,lambda\n");
    // Memories 10, 100, 1000, 10000; means 2, 5, 6, 5 and a little more.
    let models = [
        ("a", 0.9, 2),
        ("b", 0.99, 5),
        ("c", 0.999, 6),
        ("d", 0.9999, 5),
    ];
    for s in 0..3 {
        for (m, lambda, rating) in models {
            text += &format!("S{s},{m},1,{},0.{rating},{lambda}\n", rating + s % 2);
        }
    }
    let ratings = Ratings::read_csv("r.csv", text.as_bytes(), None).unwrap();
    let values = analyze(&ratings, &Rules::default()).values;
    let n = |id: &str| values.number(&format!("covariate/{id}")).unwrap();
    assert_eq!((n("log10_memory/in_mm"), n("log10_memory/df")), (0.0, 2.0));
    // Contrasts (−3,−1,1,3)/20 and (1,−1,−1,1)/4 of the means.
    assert!((n("log10_memory/slope") - 1.0).abs() < 1e-9);
    assert!((n("log10_memory/quadratic/square") + 1.0).abs() < 1e-9);
    assert_eq!(n("log10_memory/quadratic/df"), 1.0);
    let same = text
        .replace(",0.99\n", ",0.9\n")
        .replace(",0.999\n", ",0.9\n");
    let same = same.replace(",0.9999\n", ",0.9\n");
    let ratings = Ratings::read_csv("r.csv", same.as_bytes(), None).unwrap();
    let values = analyze(&ratings, &Rules::default()).values;
    let why = values.reason("covariate/log10_memory/slope").unwrap();
    assert_eq!(why, "all realizations have the same value");
}

#[test]
fn the_shares_of_the_variance_are_those_of_the_analysis_of_variance() {
    // By hand: S = M = 2, two repetitions. Cells 1, 3 / 4, 8, noise ±0.5:
    // MS subject 16, realization 9, error 1 (cells); σ² within = 0.5, h = 1/2.
    let mut text = String::from("subject,model,repetition,rating,vaf\n");
    for (s, m, mean) in [
        ("x", "a", 1.0),
        ("x", "b", 3.0),
        ("y", "a", 4.0),
        ("y", "b", 8.0),
    ] {
        text += &format!("{s},{m},1,{},\n{s},{m},2,{},\n", mean - 0.5, mean + 0.5);
    }
    let ratings = Ratings::read_csv("r.csv", text.as_bytes(), None).unwrap();
    let values = analyze(&ratings, &Rules::default()).values;
    let n = |id: &str| values.number(&format!("variance/{id}")).unwrap();
    let found = ["subject", "model", "interaction", "noise"].map(n);
    for (got, want) in found.iter().zip([7.5, 4.0, 0.75, 0.5]) {
        assert!((got - want).abs() < 1e-12, "{found:?}");
    }
    let whole: f64 = ["subject", "model", "interaction", "noise"]
        .map(|id| n(&format!("share/{id}")))
        .iter()
        .sum();
    assert!((whole - 1.0).abs() < 1e-12);
}

#[test]
fn excluded_participants_count_as_finished_and_make_no_interim_analysis() {
    let rules = Rules {
        exclude: vec![Exclusion::ConstantRater],
        planned: Some(5),
        ..Rules::default()
    };
    let a = analyze(&people(), &rules);
    assert_eq!((a.counts.finished, a.counts.participants), (5, 4));
    assert!(a.warnings.iter().all(|w| w.code != "interim"));
    let source = Source {
        title: "A study".to_owned(),
        study: None,
        protocol_version: None,
        path: "r.csv".to_owned(),
        ..Source::default()
    };
    let json: serde_json::Value = serde_json::from_str(&json::document(&source, &a)).unwrap();
    let counts = &json["counts"];
    assert_eq!([&counts["finished"], &counts["participants"]], [5, 4]);
    let width = study_report::text::Page {
        width: 100,
        color: false,
    };
    let page = study_report::text::page(&source, &a, width);
    assert!(page.contains("5 of 5 participants, 4 analyzed"), "{page}");
    let rules = Rules {
        planned: Some(6),
        ..rules
    };
    let a = analyze(&people(), &rules);
    assert!(a.warnings.iter().any(|w| w.code == "interim"));
}
