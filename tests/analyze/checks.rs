//! Equivalence, slopes of participants, drift, residuals and ends of the scale, compared
//! with R 4.2.2 (lme4 1.1-31, lmerTest 3.1-3) on the ratings of [`table`].
#![allow(clippy::unwrap_used)]

use study_analysis::analyze::{Analysis, Question, Rules, Verdict, analyze};
use study_session::outcome::ratings::Ratings;

/// Eight participants who differ in their slope on VAF, four realizations, three
/// repetitions; the rating of the third realization rises.
fn table() -> String {
    let mut csv = "subject,model,repetition,trial_index,rating,vaf\n".to_owned();
    for s in 0..8_i32 {
        for m in 0..4_i32 {
            for r in 0..3_i32 {
                let scatter = (s * 7 + m * 5 + r * 11 + s * m * 3 + m * r * 2 + s * s * r) % 7;
                let slope = (s % 4 - 1) * (2 * m - 3) * 25;
                let rise = if m == 2 { r * 30 } else { 0 };
                let level = (s * 13) % 5 * 30 + [0, 60, -45, 70][m as usize];
                let rating = f64::from(400 + slope + (scatter - 3) * 20 + rise + level) / 100.0;
                let trial = r * 4 + (m + s + r) % 4 + 1;
                csv += &format!("s{s},m{m},{},{trial},{rating:.2},0.{}\n", r + 1, 70 + 3 * m);
            }
        }
    }
    csv
}

fn analyzed(csv: &str, rules: &Rules) -> Analysis {
    analyze(
        &Ratings::read_csv("a.csv", csv.as_bytes(), None).unwrap(),
        rules,
    )
}

fn near(a: &Analysis, id: &str, expected: f64, tolerance: f64) {
    let found = a
        .values
        .number(id)
        .unwrap_or_else(|| panic!("{id}: {:?}", a.values.get(id)));
    let off = (found - expected).abs() / expected.abs();
    assert!(off < tolerance, "{id}: {found}, R: {expected}");
}

#[test]
fn equivalence_of_pairs_and_of_the_effect_of_vaf_is_that_of_r() {
    let rules = Rules {
        equivalence_margin: Some(2.5),
        ..Rules::default()
    };
    let a = analyzed(&table(), &rules);
    // pt() of both one-sided paired t, p.adjust(…, "holm")
    for (pair, p, holm) in [
        (
            "m0|m1",
            0.000_114_961_514_509_107,
            0.000_574_807_572_545_534,
        ),
        ("m0|m2", 0.001_424_019_356_346_62, 0.004_272_058_069_039_86),
        ("m0|m3", 0.099_772_958_682_080_4, 0.099_772_958_682_080_4),
        (
            "m2|m3",
            0.000_244_565_948_726_435,
            0.000_978_263_794_905_742,
        ),
    ] {
        near(&a, &format!("pair/{pair}/p_tost"), p, 1e-9);
        near(&a, &format!("pair/{pair}/p_tost_holm"), holm, 1e-9);
    }
    near(&a, "pair/m0|m1/ci90_lo", -1.387_270_431_908_35, 1e-9);
    near(&a, "pair/m0|m1/ci90_hi", -0.546_062_901_424_986, 1e-9);
    let shown = |a: &Analysis| -> Vec<bool> {
        let tests = a.pairs.iter().filter_map(|p| p.equivalence.as_ref());
        tests.map(|t| t.is_significant()).collect()
    };
    assert_eq!(shown(&a), [true, true, false, true, true, true]);
    // slope of lmer(rating ~ vaf + (1|subject) + (1|model) + (1|cell)) times .09
    near(&a, "equivalence/vaf/effect", 1.3125, 1e-6);
    near(&a, "equivalence/vaf/p", 0.079_349_425_7, 1e-4);
    near(&a, "equivalence/vaf/ci90_lo", -0.262_922_883_9, 1e-3);
    near(&a, "equivalence/vaf/ci90_hi", 2.887_922_883_9, 1e-4);
    let equivalent = |a: &Analysis| {
        let vaf = a.finding(&Question::Vaf).unwrap();
        assert_eq!(vaf.verdict, Verdict::NotShown);
        vaf.caveats.iter().any(|c| c.code == "equivalent")
    };
    assert!(!equivalent(&a));
    let wide = Rules {
        equivalence_margin: Some(4.0),
        ..Rules::default()
    };
    assert!(equivalent(&analyzed(&table(), &wide)));
    // without a margin nothing is claimed
    let a = analyzed(&table(), &Rules::default());
    assert_eq!(shown(&a), [false; 0]);
    assert_eq!(a.values.get("equivalence/vaf/p"), None);
}

/// pnorm() of both one-sided tests of atanh(cor(means, vaf)), se 1/sqrt(n − 3).
#[test]
fn equivalence_of_the_correlation_is_that_of_r() {
    let at = |margin: f64| Rules {
        equivalence_r: Some(margin),
        ..Rules::default()
    };
    let a = analyzed(&table(), &at(0.95));
    near(&a, "equivalence/r/margin", 0.95, 1e-15);
    near(&a, "equivalence/r/p", 0.301_258_063_506_466, 1e-9);
    near(&a, "equivalence/r/ci90_lo", -0.321_983_462_772_709, 1e-9);
    near(&a, "equivalence/r/ci90_hi", 0.994_599_449_696_057, 1e-9);
    let p = "equivalence/r/p";
    near(
        &analyzed(&table(), &at(0.5)),
        p,
        0.776_877_198_813_847,
        1e-9,
    );
    assert_eq!(analyzed(&table(), &Rules::default()).values.get(p), None);
    // Forty realizations without a trend.
    let csv: String = (0..6)
        .flat_map(|s| {
            (0..40).map(move |m| format!("s{s},m{m:02},{},.{}\n", 1 + (m * 9 + s) % 7, 50 + m))
        })
        .collect();
    let csv = format!("subject,model,rating,vaf\n{csv}");
    let said = |margin| {
        let a = analyzed(&csv, &at(margin));
        let vaf = a.finding(&Question::Vaf).unwrap();
        assert_eq!(vaf.verdict, Verdict::NotShown);
        let caveat = vaf.caveats.iter().find(|c| c.code == "equivalent-r");
        caveat.map(|c| c.text.clone())
    };
    assert!(
        said(0.5)
            .unwrap()
            .starts_with("the correlation is within ± .50 (")
    );
    assert_eq!(said(0.2), None);
}

#[test]
fn slopes_of_participants_drift_and_residuals_are_those_of_r() {
    let a = analyzed(&table(), &Rules::default());
    // lmer(rating ~ x + (1 + x|subject) + (1|model) + (1|cell)), REMLcrit
    near(&a, "slope_variance/variance", 418.410_267, 1e-4);
    near(&a, "slope_variance/chi2", 28.090_649_979, 1e-6);
    near(&a, "slope_variance/p", 4.552_224_3e-7, 1e-5);
    near(&a, "slope_variance/slope", 14.583_333_3, 1e-5);
    // lm(rating ~ trial_index + subject) of each realization
    near(&a, "drift/m0/slope", 0.058_962_264_150_943_4, 1e-9);
    near(&a, "drift/m0/p", 0.029_230_054_034_760_6, 1e-9);
    near(&a, "drift/m2/se", 0.025_909_855_391_033, 1e-9);
    near(&a, "drift/m2/p_holm", 0.009_128_980_998_808_02, 1e-9);
    let order = a.finding(&Question::Order).unwrap();
    let drifting: Vec<&str> = order.caveats.iter().map(|c| c.text.as_str()).collect();
    assert_eq!(
        drifting,
        ["the rating of m2 changes by 0.095 per trial (p = .009, Holm's correction)"]
    );
    near(&a, "residuals/skewness", -0.145_248_808_663_39, 1e-9);
    near(
        &a,
        "residuals/excess_kurtosis",
        -0.423_008_584_438_184,
        1e-9,
    );
    near(&a, "residuals/largest", 2.026_768_028_701_26, 1e-9);
}

#[test]
fn most_ratings_at_an_end_of_the_scale_are_named() {
    let mut csv = "subject,model,rating\n".to_owned();
    for s in 0..5 {
        for (model, ratings) in [
            ("a", [7, 7, 7, 6, 5]),
            ("b", [1, 7, 1, 1, 4]),
            ("c", [7, 6, 7, 1, 1]),
        ] {
            csv += &format!("s{s},{model},{}\n", ratings[s]);
        }
    }
    let rules = Rules {
        scale: Some((1.0, 7.0)),
        ..Rules::default()
    };
    let a = analyzed(&csv, &rules);
    for (id, expected) in [
        ("ends/a/share_high", 0.6),
        ("ends/b/share_low", 0.6),
        ("ends/c/share_high", 0.4),
        ("ends/a/distance_high", 0.6),
        ("ends/b/distance_low", 1.8),
    ] {
        near(&a, id, expected, 1e-12);
    }
    let of = |code: &str| {
        a.warnings
            .iter()
            .find(|w| w.code == code)
            .unwrap()
            .text
            .clone()
    };
    assert!(of("ceiling").starts_with("most ratings of a are the highest of the scale"));
    assert!(of("floor").starts_with("most ratings of b are the lowest of the scale"));
    let a = analyzed(&csv, &Rules::default());
    assert_eq!(
        a.values.get("ends/a/share_high"),
        None,
        "no scale is stated"
    );
}

/// A reference, an anchor or a physical sample is never the best-rated realization.
#[test]
fn a_reference_is_never_the_best_rated() {
    let mut csv = "subject,model,rating,role\n".to_owned();
    for s in 0..6 {
        for (model, rating, role) in [
            ("a", 3, "test"),
            ("b", 4, "test"),
            ("original", 7, "hidden-reference"),
            ("sample", 7, "physical"),
            ("anchor", 7, "low-anchor"),
        ] {
            csv += &format!("s{s},{model},{},{role}\n", rating - (s + rating) % 2);
        }
    }
    let a = analyzed(&csv, &Rules::default());
    let ranked: Vec<&str> = a.ranked().iter().map(|r| r.1).collect();
    assert_eq!(ranked, ["b", "a"]);
    assert_eq!(a.finding(&Question::Best).unwrap().names, ["b", "a"]);
}
