//! Verdicts where groups, orders, single realizations or single participants decide.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::findings::{finding, kind, rating_table};
use crate::report_support::{Numbers, Printed, analysis_of};
use rayon::prelude::*;
use std::fmt::Write as _;
use study_analysis::analyze::{Analysis, Question, TestKind};

/// A study in which some realizations are rated by lenient participants and others by severe ones: the
/// first half of the participants rates the realizations before `middle`, the others those after it, and
/// all the middle one if `bridged`. No realization is better.
fn unlike_groups(seed: u64, bridged: bool) -> Analysis {
    let mut random = Numbers::new(seed);
    let mut rows = Vec::new();
    for s in 0..20 {
        let lenient = s < 10;
        let level = random.normal() + if lenient { 1.5 } else { -1.5 };
        let rates = |m: usize| match m {
            2 => bridged || lenient,
            m => lenient == (m < 2),
        };
        for m in (0..5).filter(|m| rates(*m)) {
            let taste = 0.5 * random.normal();
            for k in 1..=2 {
                rows.push((s, m, k, level + taste + 0.8 * random.normal()));
            }
        }
    }
    analysis_of(&rating_table(&rows, |m| Some(0.7 + 0.05 * m as f64)))
}

/// A model that compares participants with each other says "they differ" in 95 % of these studies, and
/// permutations of its means "VAF predicts" in 45 %.
#[test]
fn severe_groups_that_share_one_realization_keep_the_level() {
    let studies = 300;
    let yes: Vec<[bool; 3]> = (0..studies)
        .into_par_iter()
        .map(|seed| {
            let a = unlike_groups(seed, true);
            assert_eq!(kind(&a, Question::Vaf), TestKind::WeightedTrend);
            [Question::Vaf, Question::Differ, Question::Pairs].map(|q| finding(&a, q).is_yes())
        })
        .collect();
    // Binomial: 15 ± 3 · 3.8 of 300 at the level .05; pairs are at most at it.
    let count = |at: usize| yes.iter().filter(|yes| yes[at]).count();
    for at in 0..2 {
        assert!((4..=26).contains(&count(at)), "{at}: {}", count(at));
    }
    assert!(count(2) <= 26, "{}", count(2));
}

#[test]
fn what_no_participant_links_cannot_be_told() {
    let a = unlike_groups(1, false);
    for question in [Question::Vaf, Question::Differ, Question::Best] {
        let why = finding(&a, question).reason().unwrap();
        assert!(why.contains("2 sets that no participant links"), "{why}");
    }
    // r and the means are still given, and pairs within a set
    assert!(a.values.number("corr_adjusted/pearson/r").is_some());
    assert!(a.pair("m00", "m01").unwrap().test.is_some());
    assert_eq!(a.pair("m01", "m03"), None);
    Printed::of(&a).answers(&[
        "Do the realizations differ? Cannot be determined: the realizations fall into 2 sets that no participant links",
        "Over these 5 realizations the means correlate with VAF at r = ",
    ]);
}

/// The only trial of somebody who left, and realizations without a VAF that another group rated.
#[test]
fn strays_and_realizations_without_a_vaf_take_no_verdict_away() {
    let mut random = Numbers::new(3);
    let mut rows = Vec::new();
    for s in 0..8 {
        for m in 0..5 {
            rows.push((s, m, 1, 2.0 + 0.8 * m as f64 + 0.3 * random.normal()));
        }
    }
    let vaf = |m: usize| (m < 5).then_some(0.7 + 0.05 * m as f64);
    let all = analysis_of(&rating_table(&rows, vaf));
    let p = finding(&all, Question::Vaf).test.as_ref().unwrap().p;
    rows.push((20, 7, 1, 4.0));
    let stray = analysis_of(&rating_table(&rows, vaf));
    for question in [Question::Vaf, Question::Differ, Question::Best] {
        assert_eq!(
            finding(&stray, question.clone()).reason(),
            None,
            "{question:?}"
        );
    }
    for s in 21..24 {
        for m in 7..9 {
            rows.push((s, m, 1, 4.0 + random.normal()));
        }
    }
    let others = analysis_of(&rating_table(&rows, vaf));
    let of_vaf = finding(&others, Question::Vaf);
    assert_eq!(of_vaf.test.as_ref().map(|test| test.p), Some(p));
    let why = finding(&others, Question::Differ).reason().unwrap();
    assert!(why.contains("2 sets"), "{why}");
}

/// One participant alone rated the highest VAF, and above all others: the r that is printed is that of the slope
/// that decides, and not of the means as if they were equally precise.
#[test]
fn r_is_that_of_the_slope_that_decides() {
    let mut random = Numbers::new(7);
    let mut rows = Vec::new();
    for s in 0..30 {
        for m in 0..5 {
            rows.push((s, m, 1, 6.0 - 0.8 * m as f64 + 1.5 * random.normal()));
        }
    }
    rows.push((0, 5, 1, 7.0));
    let vaf = [0.60, 0.62, 0.64, 0.66, 0.68, 0.80];
    let a = analysis_of(&rating_table(&rows, |m| Some(vaf[m])));
    let r = |id: &str| a.values.number(&format!("corr_adjusted/{id}")).unwrap();
    assert!((r("pearson/r") - r("trend/r")).abs() > 0.1);
    assert!(r("trend/r") * r("trend/slope") > 0.0);
    let found = finding(&a, Question::Vaf);
    assert_eq!(found.estimate.unwrap().value, r("trend/r"));
}

/// Ratings fall by the trial, and everybody has the same order.
#[test]
fn an_order_that_all_share_cannot_be_told_from_the_realizations() {
    let table = |shuffled: bool| {
        let mut random = Numbers::new(4);
        let mut csv = "subject,model,repetition,rating,vaf,trial_index\n".to_owned();
        for s in 0..10 {
            for place in 0..5 {
                let m = if shuffled { (s + place) % 5 } else { place };
                let rating = 5.0 - 0.5 * place as f64 + 0.3 * random.normal();
                let vaf = 0.7 + 0.05 * m as f64;
                let _ = writeln!(csv, "S{s},m{m},1,{rating},{vaf},{}", place + 1);
            }
        }
        analysis_of(&csv)
    };
    let a = table(false);
    for question in [
        Question::Vaf,
        Question::Differ,
        Question::Best,
        Question::Pairs,
    ] {
        let why = finding(&a, question).reason().unwrap();
        assert!(
            why.contains("everybody felt the realizations in the same order"),
            "{why}"
        );
    }
    assert!(a.pairs.iter().all(|p| p.test.is_none()));
    let printed = Printed::of(&a);
    printed.answers(&["present them in several orders"]);
    // In orders of their own the same drift is no obstacle.
    let a = table(true);
    assert_eq!(finding(&a, Question::Differ).reason(), None);
}

/// Five realizations with nearly the same VAF and one anchor: r = .95 says how the anchor was rated. Leverage by
/// R: `hatvalues(lm(y ~ x))`.
#[test]
fn a_relation_that_hangs_on_one_realization_says_so() {
    let vaf = [0.20, 0.90, 0.91, 0.93, 0.94, 0.95];
    let mut random = Numbers::new(11);
    let mut rows = Vec::new();
    for s in 0..8 {
        for m in 0..6 {
            let mean = if m == 0 { 2.0 } else { 5.0 };
            rows.push((s, m, 1, mean + 0.5 * random.normal()));
        }
    }
    let a = analysis_of(&rating_table(&rows, |m| Some(vaf[m])));
    let leverage = a.values.number("influence/leverage/m00").unwrap();
    assert!((leverage - 0.996_749_442_491_59).abs() < 1e-9, "{leverage}");
    let caveats = &finding(&a, Question::Vaf).caveats;
    assert!(
        caveats
            .iter()
            .any(|c| c.code == "far-realization" && c.text.contains("over the others r = ")),
        "{caveats:?}"
    );
    let even = analysis_of(&rating_table(&rows, |m| Some(0.5 + 0.1 * m as f64)));
    let caveats = &finding(&even, Question::Vaf).caveats;
    assert!(
        caveats.iter().all(|c| c.code != "far-realization"),
        "{caveats:?}"
    );
}

/// Six participants without a preference, and one who rates by VAF from one end of the scale to the other.
#[test]
fn a_relation_that_hangs_on_one_participant_says_so() {
    let base = [3.0, 4.0, 3.0, 4.0, 3.0, 4.0];
    let mut rows = Vec::new();
    for s in 0..7 {
        for (m, mean) in base.iter().enumerate() {
            let own = if s == 6 { 10.0 * m as f64 } else { *mean };
            rows.push((s, m, 1, own));
        }
    }
    let a = analysis_of(&rating_table(&rows, |m| Some(0.5 + 0.05 * m as f64)));
    let f = finding(&a, Question::Vaf);
    assert!(f.is_yes(), "{f:?}");
    let text = f
        .caveats
        .iter()
        .find(|c| c.code == "one-participant-turns-it");
    assert!(
        text.unwrap()
            .text
            .starts_with("without S06 it is not shown (t test, p = "),
        "{text:?}"
    );
    // R: cor.test of 3 4 3 4 3 4 with 0 to 5
    let p = a.values.number("influence/p_without/S06").unwrap();
    assert!((p - 0.573_392_253_825_36).abs() < 1e-9, "{p}");
}
