//! Mixed models on tables that do not permit them, or barely.
#![allow(clippy::unwrap_used)]

use study_analysis::analyze::{Rules, Values, analyze};
use study_session::outcome::ratings::Ratings;

fn analyzed(rows: &str) -> Values {
    let csv = format!("subject,model,repetition,rating,vaf\n{rows}");
    let ratings = Ratings::read_csv("a.csv", csv.as_bytes(), None).unwrap();
    analyze(&ratings, &Rules::default()).values
}

/// Analyses subjects × realizations × repetitions, with rating and VAF as functions of
/// the three indices.
fn table(
    [subjects, models, repetitions]: [u32; 3],
    rating: impl Fn(u32, u32, u32) -> f64,
    vaf: impl Fn(u32, u32, u32) -> String,
) -> Values {
    let mut rows = String::new();
    for s in 0..subjects {
        for m in 0..models {
            for r in 0..repetitions {
                let (y, x) = (rating(s, m, r), vaf(s, m, r));
                rows += &format!("s{s},m{m},{},{y},{x}\n", r + 1);
            }
        }
    }
    analyzed(&rows)
}

/// Ratings without a pattern, reproducible.
fn scattered(s: u32, m: u32, r: u32) -> f64 {
    f64::from((s * 7 + m * 5 + r * 11 + s * m * 3 + m * r) % 7 + 1)
}

fn by_model(_: u32, m: u32, _: u32) -> String {
    format!("0.{}", 70 + 3 * m)
}

fn undefined(values: &Values, id: &str, because: &str) {
    let why = values.reason(id);
    assert!(
        why.is_some_and(|w| w.contains(because)),
        "{id}: {:?}",
        values.get(id)
    );
}

#[test]
fn one_subject_has_no_mixed_model() {
    let v = table([1, 5, 3], scattered, by_model);
    for id in [
        "lmm_model/sigma2",
        "lmm_vaf/slope",
        "lmm_vaf_slope/slope",
        "lmm_vaf_crossed/slope",
        "lmm_crossed/sigma2",
        "lmm_variance/share_model",
    ] {
        undefined(&v, id, "two subjects");
    }
}

#[test]
fn one_realization_has_no_realization_effect() {
    let v = table([6, 1, 3], scattered, by_model);
    undefined(&v, "lmm_model/satterthwaite_F", "two realizations");
    undefined(&v, "lmm_crossed/var_model", "two realizations");
    undefined(&v, "lmm_vaf/slope", "VAF does not vary");
}

#[test]
fn equal_ratings_have_no_mixed_model() {
    let v = table([4, 5, 3], |_, _, _| 4.0, by_model);
    undefined(&v, "lmm_model/sigma2", "all ratings are equal");
    undefined(&v, "lmm_vaf_crossed/slope", "all ratings are equal");
}

#[test]
fn repeated_ratings_that_agree_leave_no_error_beside_a_cell_effect() {
    let v = table([5, 5, 3], |s, m, _| scattered(s, m, 0), by_model);
    undefined(&v, "lmm_vaf_crossed/slope", "no variance of error");
    assert!(v.number("lmm_vaf/slope").is_some());
}

#[test]
fn a_missing_or_constant_vaf_has_a_reason() {
    let v = table([5, 4, 2], scattered, |_, _, _| String::new());
    undefined(&v, "lmm_vaf/slope", "no test realization has a VAF");
    undefined(&v, "lmm_vaf_crossed/slope", "no test realization has a VAF");
    assert!(v.number("lmm_model/sigma2").is_some());
    let v = table([5, 4, 2], scattered, |_, _, _| "0.8".to_owned());
    undefined(&v, "lmm_vaf_slope/slope", "VAF does not vary");
}

#[test]
fn two_realizations_have_no_crossed_slope() {
    let v = table([6, 2, 2], scattered, by_model);
    undefined(&v, "lmm_vaf_crossed/slope", "three realizations");
    assert!(v.number("lmm_vaf/slope").is_some());
}

#[test]
fn a_vaf_of_each_trial_has_a_slope_but_no_crossed_model() {
    let v = table([6, 4, 3], scattered, |s, m, r| {
        format!("{}", f64::from(s + 2 * m) + 0.5 * f64::from(r))
    });
    assert!(v.number("lmm_vaf/slope").is_some());
    undefined(&v, "lmm_vaf_crossed/slope", "between the ratings of one");
}

#[test]
fn shares_of_the_variance_sum_to_one() {
    let csv = include_str!("../golden/data/sim_paper/data.csv");
    let ratings = Ratings::read_csv("a.csv", csv.as_bytes(), None).unwrap();
    let v = analyze(&ratings, &Rules::default()).values;
    let share = |name: &str| v.number(&format!("lmm_variance/share_{name}")).unwrap();
    let sum: f64 = ["subject", "model", "subject_model", "error"]
        .map(share)
        .iter()
        .sum();
    assert!((sum - 1.0).abs() < 1e-12);
    // In balanced data the error variance is that of the repetitions, with or without VAF.
    let (a, b) = (
        v.number("lmm_variance/var_error").unwrap(),
        v.number("lmm_vaf_crossed/sigma2").unwrap(),
    );
    assert!((a - b).abs() < 1e-7, "{a} and {b}");
}

/// Ratings with a strong interaction of realization and subject.
fn interacting(s: u32, m: u32, r: u32) -> f64 {
    let own = f64::from((s * 5 + m * 3 + s * m * 2) % 7);
    10.0 * own + 20.0 * f64::from(m % 3) + f64::from((s + 2 * m + 3 * r + m * r) % 3)
}

/// The share of VAF compares two fits with the same random effects on the same
/// ratings, so that it does not depend on the interaction variance.
#[test]
fn the_share_of_vaf_compares_models_with_the_same_random_effects() {
    let scattered_vaf =
        |_, m: u32, _| ["0.2", "0.9", "0.5", "0.7", "0.35", "0.6"][m as usize].to_owned();
    let v = table([5, 6, 8], interacting, scattered_vaf);
    let number = |id: &str| v.number(id).unwrap();
    let share = number("corr/share/var_model_crossed");
    // Every realization has a VAF, so the model without VAF is that of `lmm_variance`.
    let without = number("lmm_variance/var_model");
    let with = number("lmm_vaf_crossed/var_model");
    assert!(
        (share - (1.0 - with / without)).abs() < 1e-6,
        "{share} {with} {without}"
    );
    assert!((number("lmm_vaf_crossed/var_model_without_vaf") - without).abs() < 1e-6 * without);
    assert_eq!(share, number("lmm_variance/model_share_of_vaf"));
    // The model without the interaction has a different variance.
    let other = 1.0 - with / number("lmm_crossed/var_model");
    assert!((share - other).abs() > 0.01, "{share} {other}");
}

#[test]
fn the_share_of_vaf_uses_only_realizations_with_a_vaf() {
    let vaf = |s, m, r| {
        if m == 6 {
            String::new()
        } else {
            by_model(s, m, r)
        }
    };
    let all = table(
        [5, 7, 3],
        |s, m, r| if m == 6 { 90.0 } else { interacting(s, m, r) },
        vaf,
    );
    let rated = table([5, 6, 3], interacting, by_model);
    for id in [
        "corr/share/var_model_crossed",
        "lmm_vaf_crossed/var_model_without_vaf",
        "lmm_variance/model_share_of_vaf",
    ] {
        let (a, b) = (all.number(id).unwrap(), rated.number(id).unwrap());
        assert!((a - b).abs() < 1e-6 * (1.0 + b.abs()), "{id}: {a} {b}");
    }
}

#[test]
fn the_share_of_vaf_is_undefined_without_variance_between_realizations() {
    let v = table(
        [6, 5, 2],
        |s, m, r| f64::from((s + m + 3 * r * (s + 1)) % 5),
        by_model,
    );
    assert_eq!(v.number("lmm_vaf_crossed/var_model_without_vaf"), Some(0.0));
    undefined(
        &v,
        "corr/share/var_model_crossed",
        "no variance between realizations",
    );
    undefined(
        &v,
        "lmm_variance/model_share_of_vaf",
        "no variance between realizations",
    );
}

/// The crossed ordinal model takes milliseconds for each participant.
#[test]
fn the_crossed_ordinal_model_has_at_most_a_hundred_participants() {
    let study = |participants| {
        table(
            [participants, 4, 1],
            |s, m, _| f64::from(1 + (s * 7 + m * (s % 3 + 1)) % 5),
            |_, m, _| format!("0.{}", 6 + m),
        )
    };
    let id = "clmm_vaf_crossed/beta/vaf";
    let fitted = study(100);
    assert!(fitted.number(id).is_some(), "{:?}", fitted.reason(id));
    assert_eq!(study(101).reason(id), Some("more than 100 subjects"));
}
