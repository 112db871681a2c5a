//! Tables that are odd in one way each: nothing else may suffer from it.
#![allow(clippy::unwrap_used)]

use study_analysis::analyze::{Analysis, Rules, Value, analyze};
use study_report::Source;
use study_report::text::{Page, page};
use study_session::outcome::ratings::Ratings;
use study_stats::carry_over::{OrderedRating, carry_over};

fn of(csv: &str) -> Analysis {
    let ratings = Ratings::read_csv("a.csv", csv.as_bytes(), None).unwrap();
    analyze(&ratings, &Rules::default())
}

/// What the terminal shows.
fn shown(a: &Analysis) -> String {
    let source = Source {
        title: "a.csv".to_owned(),
        study: None,
        protocol_version: None,
        path: "a.csv".to_owned(),
        ..Source::default()
    };
    let form = Page {
        width: 100,
        color: false,
    };
    page(&source, a, form)
}

/// Five subjects, four realizations, two repetitions; ratings 1 to 7.
fn table(rating: impl Fn(usize, usize, usize) -> String) -> String {
    let mut csv = String::from("subject,model,repetition,rating,vaf,trial_index\n");
    for s in 0..5 {
        for r in 0..2 {
            for m in 0..4 {
                let (vaf, trial) = (0.7 + 0.05 * m as f64, 4 * r + m + 1);
                csv += &format!("S{s},m{m},{},{},{vaf:.2},{trial}\n", r + 1, rating(s, m, r));
            }
        }
    }
    csv
}

fn some(s: usize, m: usize, r: usize) -> String {
    ((3 * s + 5 * m + 2 * r + s * m) % 7 + 1).to_string()
}

#[test]
fn a_realization_without_ratings_does_not_affect_the_others() {
    let empty = of(&table(
        |s, m, r| if m == 1 { String::new() } else { some(s, m, r) },
    ));
    let csv = table(some);
    let rows = csv.lines().filter(|l| !l.contains(",m1,"));
    let without = of(&rows.map(|l| format!("{l}\n")).collect::<String>());
    for id in [
        "design/n_subjects_complete",
        "friedman/chi2",
        "rmanova/F",
        "corr/pearson/r",
        "subject_slope/mean",
        "page/L",
        "bootstrap/se",
        "icc_subjects/ICC2",
        "lmm_model/reml_deviance",
    ] {
        assert!(without.values.number(id).is_some(), "{id}");
        assert_eq!(empty.values.number(id), without.values.number(id), "{id}");
    }
    let said = empty
        .warnings
        .iter()
        .find(|w| w.code == "not-rated")
        .unwrap();
    assert!(said.text.contains("m1"), "{}", said.text);
}

#[test]
fn a_table_with_an_oddity_has_its_warning_and_another_has_none() {
    let fine = table(some);
    let (short, _) = fine.trim_end().rsplit_once('\n').unwrap();
    let codes = |csv: &str| -> Vec<&str> { of(csv).warnings.iter().map(|w| w.code).collect() };
    for (code, odd) in [
        ("unbalanced", short.to_owned()),
        ("vaf-differs", fine.replacen("0.70", "0.71", 1)),
    ] {
        assert!(codes(&odd).contains(&code), "{:?}", codes(&odd));
        assert!(!codes(&fine).contains(&code), "{code}");
    }
}

/// Trials numbered from 1 in each of two sessions: what came before a trial is
/// not known, and no rating of the other session stands in for it.
#[test]
fn an_ambiguous_trial_index_precedes_no_trial() {
    let twice = of(&table(some)
        .replace(",5\n", ",1\n")
        .replace(",6\n", ",2\n")
        .replace(",7\n", ",3\n")
        .replace(",8\n", ",4\n"));
    assert!(twice.values.reason("order_previous_rating/slope").is_some());
    let once = of(&table(some));
    assert!(once.values.number("order_previous_rating/slope").is_some());
}

/// Each repetition is a block: its first rating follows the last one of the block before,
/// but could not have come in another place of it.
#[test]
fn carry_over_is_compared_with_the_orders_within_repetitions() {
    let a = of(&table(some));
    let mut ratings = Vec::new();
    for (s, r, m) in (0..5).flat_map(|s| (0..8).map(move |i| (s, i / 4, i % 4))) {
        ratings.push(OrderedRating {
            subject: s as u32,
            realization: m as u32,
            block: r as u32,
            rating: some(s, m, r).parse().unwrap(),
        });
    }
    let slope = a.values.number("carry_over/slope").unwrap();
    let expected = carry_over(&ratings).unwrap().slope;
    assert!((slope - expected).abs() < 1e-12, "{slope}, {expected}");
}

/// Squares of 10³⁰⁸ exceed a double. What may be lost by that says so; no reason claims
/// that ratings are missing.
#[test]
fn overflow_is_given_as_a_reason() {
    let csv = table(|s, m, r| format!("{}e307", some(s, m, r)));
    let a = of(&csv);
    let why = |id: &str| a.values.reason(id).unwrap_or_else(|| panic!("{id}"));
    for id in [
        "desc/m0/sd",
        "rmanova/F",
        "icc_subjects/ICC1",
        "lmm_model/reml_deviance",
        "subject_slope/t",
    ] {
        assert!(
            why(id).contains("beyond what a double holds"),
            "{id}: {}",
            why(id)
        );
    }
    let plain = of(&table(|s, m, r| format!("{}.5", some(s, m, r))));
    for id in ["clm_model/loglik", "realistic/m0/share"] {
        assert_eq!(a.values.reason(id), plain.values.reason(id), "{id}");
    }
    for (id, value) in a.values.iter() {
        if let Value::Undefined(why) = value {
            assert!(
                !why.contains("no ratings") && !why.contains("fewer than two"),
                "{id}: {why}"
            );
        }
    }
    let page = shown(&a);
    let digits = page
        .split(|c: char| !c.is_ascii_digit())
        .map(str::len)
        .max();
    assert!(digits.is_some_and(|n| n < 20), "{page}");
}

#[test]
fn one_is_not_many() {
    let one = of("subject,model,repetition,rating,vaf\nS,m,1,4,0.7\n");
    let page = shown(&one);
    assert!(page.contains("1 participant · 1 rating\n"), "{page}");
}

#[test]
fn the_realization_that_carries_a_correlation_alone_is_named() {
    let lone = |odd: fn(usize) -> (f64, usize)| {
        let mut csv = String::from("subject,model,rating,vaf\n");
        for s in 0..3 {
            for m in 0..4 {
                let (vaf, rating) = odd(m);
                csv += &format!("S{s},m{m},{rating},{vaf}\n");
            }
        }
        of(&csv)
    };
    let why = |a: &Analysis, id: &str| match a.values.get(id) {
        Some(Value::Undefined(why)) => why.clone(),
        other => panic!("{id}: {other:?}"),
    };
    let a = lone(|m| (0.7 + 0.05 * m as f64, if m == 2 { 6 } else { 3 }));
    assert!(a.values.number("corr/pearson/r").is_some());
    for id in ["pearson_min", "pearson_max", "spearman_min", "spearman_max"] {
        let said = why(&a, &format!("corr/leave_one_out/{id}"));
        assert_eq!(said, "without `m2` all mean ratings are equal");
    }
    let said = why(&a, "corr/leave_one_out/m2/pearson");
    assert_eq!(said, "without it all mean ratings are equal");
    let a = lone(|m| (if m == 1 { 0.9 } else { 0.7 }, 1 + m));
    let said = why(&a, "corr/leave_one_out/pearson_min");
    assert_eq!(said, "without `m1` all VAF are equal");
}

#[test]
fn repetitions_from_zero_give_what_those_from_one_give() {
    let from_one = of(&table(some));
    let mut csv = String::new();
    for line in table(some).lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let Ok(n) = cells[2].parse::<u32>() {
            cells[2] = (n - 1).to_string();
        }
        csv += &(cells.join(",") + "\n");
    }
    let from_zero = of(&csv);
    assert!(from_zero.values.number("order_repetition/0/mean").is_some());
    for (id, value) in from_one.values.iter() {
        if !id.starts_with("order_repetition/") {
            assert_eq!(from_zero.values.get(id), Some(value), "{id}");
        }
    }
}
