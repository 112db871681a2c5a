//! Missing ratings: how many, where, and whether they could turn an answer.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::findings::finding;
use crate::report_support::{Numbers, Printed, analysis_of};
use std::fmt::Write as _;
use study_analysis::analyze::{Analysis, Question};

/// Participants × realizations; what is missing is NAN.
const RATINGS: [[f64; 4]; 9] = [
    [2.0, 4.0, 5.0, 7.0],
    [3.0, 3.0, f64::NAN, 6.0],
    [1.0, 4.0, 4.0, f64::NAN],
    [f64::NAN, 5.0, 6.0, 7.0],
    [2.0, f64::NAN, 3.0, 5.0],
    [3.0, 4.0, 6.0, 6.0],
    [f64::NAN, 3.0, 5.0, f64::NAN],
    [4.0, 5.0, 5.0, 7.0],
    [2.0, 2.0, 4.0, 5.0],
];
const VAF: [f64; 4] = [0.6, 0.7, 0.85, 0.9];

/// The table, with the ratings of each realization higher by some number.
fn table<const K: usize>(ratings: &[[f64; K]], vaf: [f64; K], higher: [f64; K]) -> Analysis {
    let mut csv = "subject,model,rating,vaf\n".to_owned();
    for (s, own) in ratings.iter().enumerate() {
        for (m, rating) in own.iter().enumerate() {
            let rating = match rating.is_nan() {
                true => String::new(),
                false => (rating + higher[m]).to_string(),
            };
            let _ = writeln!(csv, "S{s:02},m{m},{rating},{}", vaf[m]);
        }
    }
    analysis_of(&csv)
}

fn number(a: &Analysis, id: &str) -> f64 {
    a.values.number(id).unwrap_or_else(|| panic!("{id}"))
}

/// R 4.2.2: `lm(y ~ s + m)`; of `is.na(y)` `car::Anova(lm(miss ~ 1), idata, idesign = ~m, type = 3)` with
/// Greenhouse and Geisser's ε, `lm(colMeans(miss) ~ means)` with the adjusted means, and `cor.test(rowMeans(miss), levels)`.
#[test]
fn where_ratings_are_missing_is_as_r_says() {
    let a = table(&RATINGS, VAF, [0.0; 4]);
    for (id, expected) in [
        ("n", 36.0),
        ("missing", 6.0),
        ("share", 1.0 / 6.0),
        ("participants", 5.0),
        ("realization/m0/missing", 2.0),
        ("realization/m1/share", 1.0 / 9.0),
        ("realizations_F", 0.228_571_428_571_429),
        ("realizations_p", 0.857_965_312_141_665),
        ("level_slope", 0.002_102_524_207_495_91),
        ("level_p", 0.951_365_241_509_463),
        ("severity_r", -0.207_677_974_604_399),
        ("severity_p", 0.591_834_477_549_542),
        ("sd", 0.634_163_897_294_098_6),
    ] {
        let found = number(&a, &format!("missing/{id}"));
        assert!((found - expected).abs() < 1e-9, "{id}: {found}");
    }
}

/// A mean that is moved is that of ratings that are all moved by as much.
#[test]
fn answers_are_tried_with_what_is_missing_moved_against_them() {
    let a = table(&RATINGS, VAF, [0.0; 4]);
    let sd = number(&a, "missing/sd");
    let share = |m: usize| number(&a, &format!("missing/realization/m{m}/share"));
    let mean = |m: usize| number(&a, &format!("adjusted/m{m}/mean"));
    // Four realizations have too few orders for a yes about VAF; the t test that is repeated has one.
    assert!(finding(&a, Question::Differ).is_yes() && number(&a, "missing/moved/vaf/p") < 0.05);

    // Higher VAF is rated higher: means of low VAF move up, those of high VAF down.
    let by = [1.0, 1.0, -1.0, -1.0];
    let moved = table(
        &RATINGS,
        VAF,
        std::array::from_fn(|m| by[m] * sd * share(m)),
    );
    let close = |found: f64, expected: f64| {
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}")
    };
    close(
        number(&a, "missing/moved/vaf/p_moved"),
        number(&moved, "influence/p_with_all"),
    );
    close(
        number(&a, "missing/moved/vaf/p"),
        number(&a, "influence/p_with_all"),
    );

    let middle = (0..4).map(mean).sum::<f64>() / 4.0;
    let moved = table(
        &RATINGS,
        VAF,
        std::array::from_fn(|m| (middle - mean(m)).signum() * sd * share(m)),
    );
    close(
        number(&a, "missing/moved/differ/p_moved"),
        number(&moved, "within_clustered/p_gg"),
    );

    // The best is m3, the second m2.
    let best = [0.0, 0.0, sd * share(2), -sd * share(3)];
    let moved = table(&RATINGS, VAF, best);
    close(
        number(&a, "missing/moved/best/p_moved"),
        number(&moved, "pair/m2|m3/p"),
    );
}

/// Twenty participants of whom `out` did not rate the best realization where they did not like it.
fn declined(out: usize) -> Analysis {
    let mut random = Numbers::new(3);
    let rows: Vec<[f64; 3]> = (0..20)
        .map(|s| {
            let level = random.normal();
            let taste: [f64; 3] = std::array::from_fn(|_| 1.2 * random.normal());
            let best = level + 0.95 + taste[0];
            [
                if s < out { f64::NAN } else { best },
                level + taste[1],
                level + taste[2],
            ]
        })
        .collect();
    table(&rows, [0.9, 0.8, 0.7], [0.0; 3])
}

#[test]
fn an_answer_that_hangs_on_what_is_missing_says_so() {
    let caveat = |a: &Analysis| {
        let all = &finding(a, Question::Differ).caveats;
        let about = all.iter().find(|c| c.code.starts_with("missing-"));
        about.map(|c| (c.code, c.text.clone()))
    };
    let (mut turned, mut held) = (0, 0);
    for out in 0..12 {
        let a = declined(out);
        let Some((code, text)) = caveat(&a) else {
            // Up to 3 of 60 are neglected.
            assert!(out <= 3, "{out}");
            continue;
        };
        assert!(out > 3, "{out}: {text}");
        match code {
            "missing-turns-it" => {
                turned += 1;
                let at = number(&a, "missing/moved/differ/turns_at");
                assert!(at > 0.0 && at <= 1.0, "{at}");
                assert!(text.contains("the answer turns from 0."), "{text}");
            }
            _ => {
                held += 1;
                assert!(text.contains("it would still "), "{text}");
            }
        }
    }
    assert!(turned > 0 && held > 0, "{turned} {held}");
    // More are missing of one realization, and a page says so.
    let a = declined(8);
    let codes: Vec<&str> = a.warnings.iter().map(|w| w.code).collect();
    assert!(codes.contains(&"missing-by-realization"), "{codes:?}");
    let printed = Printed::of(&a);
    printed.answers(&["of the ratings are missing; with each of them"]);
}

#[test]
fn where_nothing_is_missing_nothing_is_said() {
    let whole: Vec<[f64; 4]> = (RATINGS.iter().filter(|own| own.iter().all(|x| !x.is_nan())))
        .copied()
        .collect();
    let a = table(&whole, VAF, [0.0; 4]);
    assert!(a.results.evidence.missing.is_none());
    assert_eq!(a.values.number("missing/n"), None);
}
