//! The second opinion of the ordinal hierarchical model.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::findings::finding;
use crate::report_support::{Numbers, Printed};
use std::fmt::Write as _;
use study_analysis::analyze::{Analysis, Better, OrdinalEffort, Question, Rules, analyze};
use study_session::outcome::ratings::Ratings;

/// Ten participants who rate the third realization higher by one and a half, on a scale from 1 to 7.
fn table() -> String {
    let mut random = Numbers::new(8);
    let mut csv = "subject,model,repetition,rating,vaf\n".to_owned();
    for s in 0..10 {
        let level = 3.6 + 0.6 * random.normal();
        for (m, mean) in [0.0, 0.1, 1.5].iter().enumerate() {
            let taste = 0.3 * random.normal();
            for k in 1..=3 {
                let rating = (level + mean + taste + 0.8 * random.normal())
                    .round()
                    .clamp(1.0, 7.0);
                let _ = writeln!(csv, "S{s:02},m{m},{k},{rating},{}", 0.7 + 0.1 * m as f64);
            }
        }
    }
    csv
}

fn of(csv: &str, rules: Rules) -> Analysis {
    let ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
    analyze(&ratings, &rules)
}

fn rules(draws: usize) -> Rules {
    Rules {
        posterior: Some(OrdinalEffort {
            chains: 4,
            warmup: 100,
            draws,
        }),
        equivalence_margin: Some(0.5),
        ..Rules::default()
    }
}

#[test]
fn it_says_what_is_probable_and_decides_nothing() {
    let csv = table();
    let a = of(&csv, rules(800));
    let number = |id: &str| {
        let found = a.values.number(id);
        found.unwrap_or_else(|| panic!("{id}: {:?}", a.results.posterior))
    };
    assert!(number("ordinal_posterior/realization/m2/best/p") > 0.97);
    assert!(number("ordinal_posterior/pair/m0|m2/above/p") < 0.03);
    assert!(
        number("ordinal_posterior/pair/m0|m1/equivalent/p")
            > number("ordinal_posterior/pair/m0|m2/equivalent/p")
    );
    assert!(number("ordinal_posterior/vaf/above/p") > 0.8);
    let plain = of(
        &csv,
        Rules {
            posterior: None,
            ..rules(1)
        },
    );
    assert_eq!(plain.findings, a.findings);
    assert_eq!(plain.values.number("ordinal_posterior/n_draws"), None);
    let printed = Printed::of(&a);
    printed.answers(&[
        "Second opinion, which decides nothing: the posterior probability that m2 is the best is",
    ]);
    Printed::of(&plain).nowhere(&["ordinal_posterior", "posterior probability"]);
}

#[test]
fn where_lower_is_better_the_lowest_is_the_best() {
    let a = of(
        &table(),
        Rules {
            better: Better::Lower,
            ..rules(800)
        },
    );
    let best = |m: &str| {
        a.values
            .number(&format!("ordinal_posterior/realization/{m}/best/p"))
            .unwrap()
    };
    assert!(best("m2") < 0.03 && best("m0") + best("m1") > 0.97);
}

#[test]
fn without_convergence_or_levels_there_is_none() {
    let a = of(&table(), rules(20));
    assert_eq!(
        a.values.number("ordinal_posterior/realization/m2/best/p"),
        None
    );
    assert!(
        a.values
            .number("ordinal_posterior/effective_draws")
            .unwrap()
            < 400.0
    );
    assert!(finding(&a, Question::Best).is_yes());
    Printed::of(&a).answers(&["There is no second opinion by the ordinal model: "]);
    let halves = table().replace(",4,", ",4.5,");
    let a = of(&halves, rules(20));
    Printed::of(&a).answers(&["the ratings are no whole numbers"]);
}
