use super::super::tracks::{TrackWorld, TracksWorld, Truth, of_participant, run};
use super::super::{Assumptions, Scale, Vaf, merge, run_chunk};
use super::*;
use crate::analyze::psychophysics::results::CellName;
use crate::analyze::psychophysics::{TrialCount, TrialSettings};
use crate::analyze::results::Number as _;
use study_base::text::{ModelId, PartId};
use study_plan::procedure::{Constant, Ladder, Rule, Track};
use study_plan::protocol::parts::{Compared, FitRules, Method, TrackRules};
use study_stats::distribution::normal_upper;
use study_stats::power::covariate::Spread;
use study_stats::psychometric::{Core, Curve, Priors, Spacing, Support};

fn settings(part: PartWorld, tests: &[Test], studies: u64) -> Settings {
    Settings {
        assumptions: Assumptions {
            slope: 0.0,
            smallest: None,
            mean: 0.0,
            spread: Spread {
                subject: 0.0,
                realization: 0.0,
                interaction: 0.0,
                residual: 0.0,
                slope: 0.0,
            },
            scale: Scale::Continuous,
            vaf: Vaf::Listed,
            dropout: 0.0,
            missing: 0.0,
            reference: 0.0,
        },
        part: Some(part),
        pilot: None,
        listed: Vec::new(),
        tests: tests.to_vec(),
        alpha: 0.05,
        margin: None,
        seed: 2007,
        studies,
    }
}

fn cell(participants: usize, realizations: usize, repetitions: usize) -> Cell {
    Cell {
        realizations,
        repetitions,
        participants,
    }
}

fn power(settings: &Settings, cell: Cell, test: usize) -> f64 {
    let chunks: Vec<_> = (0..settings.chunks())
        .map(|i| run_chunk(settings, &cell, i))
        .collect();
    merge(settings, cell, &chunks).unwrap().tests[test].power
}

fn agrees(found: f64, expected: f64, n: f64) {
    let allowed = 4.0 * (expected * (1.0 - expected) / n).sqrt();
    assert!((found - expected).abs() <= allowed, "{found}, {expected}");
}

fn pair(vaf: &[f64]) -> PairsWorld {
    let q = vaf.len();
    PairsWorld {
        vaf: vaf.iter().map(|v| Some(*v)).collect(),
        pairs: (0..q)
            .flat_map(|a| (a + 1..q).map(move |b| [a, b]))
            .collect(),
        ties: None,
        random_order: false,
    }
}

/// Two realizations, 8 participants × 4 trials, half of them in each order: the difference
/// of abilities is half the difference of two logits, so that the power is a sum over two
/// binomial distributions. With one participant, whose answers are taken for independent.
#[test]
fn one_pair_has_the_power_of_its_binomial_counts() {
    let mut settings = settings(
        PartWorld::Pairs(pair(&[0.7, 0.8])),
        &[Test::Preferred],
        4000,
    );
    // x is −1 and 1, so that the true difference is twice the slope.
    for slope in [0.0, 0.6] {
        settings.assumptions.slope = slope;
        let p = 1.0 / (1.0 + libm::exp(-2.0 * slope));
        let n = 16u32;
        let choose = |k: u32| {
            (0..k)
                .map(|i| f64::from(n - i) / f64::from(i + 1))
                .product()
        };
        let probability = |k: u32, p: f64| {
            let all: f64 = choose(k);
            all * p.powi(k as i32) * (1.0 - p).powi((n - k) as i32)
        };
        let mut expected = 0.0;
        for a in 1..n {
            for b in 1..n {
                let logit = |k: u32| libm::log(f64::from(k) / f64::from(n - k));
                let variance = |k: u32| f64::from(n) / f64::from(k * (n - k));
                let difference = (logit(a) - logit(b)) / 2.0;
                let se = (variance(a) + variance(b)).sqrt() / 2.0;
                let significant = 2.0 * normal_upper((difference / se).abs()) <= 0.05;
                // In the other order the better one is second.
                let both = probability(a, p) * probability(b, 1.0 - p);
                expected += both * f64::from(u8::from(significant));
            }
        }
        agrees(power(&settings, cell(1, 2, 32), 0), expected, 4000.0);
    }
}

/// Who drops out answers nothing: half of 32 participants have the power of about 16.
#[test]
fn who_drops_out_of_pairs_does_not_count() {
    let mut settings = settings(
        PartWorld::Pairs(pair(&[0.7, 0.8])),
        &[Test::Preferred],
        1000,
    );
    settings.assumptions.slope = 0.25;
    let [all, half] = [32, 16].map(|n| power(&settings, cell(n, 2, 4), 0));
    settings.assumptions.dropout = 0.5;
    let left = power(&settings, cell(32, 2, 4), 0);
    assert!(
        (left - half).abs() < 0.06 && left < all - 0.15,
        "{left}: {half}, {all}"
    );
}

/// With many answers abilities are the true ones, and the test of VAF is that of a
/// correlation over them.
#[test]
fn many_answers_have_the_power_of_a_correlation() {
    let vaf = [0.70, 0.74, 0.75, 0.80, 0.86, 0.9];
    let mut world = pair(&vaf);
    world.ties = Some(0.2);
    world.random_order = true;
    let tests = [Test::Preferred, Test::PreferenceVaf];
    let mut settings = settings(PartWorld::Pairs(world), &tests, 400);
    settings.assumptions.slope = 0.9;
    settings.assumptions.spread.realization = 0.6;
    settings.assumptions.missing = 0.1;
    let found = power(&settings, cell(30, 6, 2), 1);
    let limit = study_stats::power::covariate::Design {
        slope: 0.9,
        spread: settings.assumptions.spread,
        subjects: None,
        realizations: 6,
        repetitions: 2,
        values: study_stats::power::covariate::Values::Fixed,
    };
    // The permutation test is within .03 of Pearson's t here.
    let limit = limit.power(0.05).unwrap();
    assert!((found - limit).abs() < 0.11, "{found} {limit}");
    settings.assumptions.slope = 0.0;
    agrees(power(&settings, cell(30, 6, 2), 1), 0.05, 400.0);
}

fn track(method: Method, compared: Compared, rule: Rule, truth: Truth) -> TrackWorld {
    let ladder = match compared {
        Compared::Levels { .. } => Ladder::new(vec![0.2, 0.4, 0.6, 0.8, 1.0]),
        Compared::Models { .. } => Ladder::new(vec![1.0]),
    };
    TrackWorld {
        rules: TrackRules {
            id: PartId::new("a").unwrap(),
            method,
            compared,
            relative: None,
            rule,
            feedback: false,
            catch: 0.0,
            easy: 0.0,
            fit: FitRules::default(),
            measures: None,
        },
        ladder: ladder.unwrap(),
        settings: TrialSettings {
            core: Core::Norm,
            spacing: Spacing::Lin,
            lambda: 0.02,
            standard: None,
            priors: Priors::schuett(Some(Support {
                low: 0.2,
                high: 1.0,
                least: 0.2,
            })),
            repeats: 0,
            seed: 1,
        },
        truth,
    }
}

fn constant(levels: &[f64], repetitions: u32) -> Rule {
    Rule::Constant(Constant {
        levels: levels.to_vec(),
        repetitions,
    })
}

/// 10 participants × 40 trials; rates of 20 000 studies in R 4.2.2 (binomial answers,
/// log-linear rates, one-sided half of t.test), standard error .0025.
#[test]
fn told_apart_agrees_with_an_independent_simulation() {
    let models = ["s", "c"].map(|id| ModelId::new(id).unwrap());
    for (d, sd, expected) in [(0.3, 0.0, 0.854), (0.4, 0.3, 0.8458), (0.0, 0.0, 0.02545)] {
        let track = track(
            Method::TwoIntervals,
            Compared::Models {
                models: models.clone(),
            },
            constant(&[1.0], 40),
            Truth::Sensitivity(d),
        );
        let world = PartWorld::Tracks(TracksWorld {
            tracks: vec![track],
            ratios: false,
            pooled: 0,
        });
        let mut settings = settings(world, &[Test::ToldApart], 3000);
        settings.assumptions.spread.subject = sd;
        agrees(power(&settings, cell(10, 1, 1), 0), expected, 2500.0);
    }
}

/// The threshold of a simulated track is what the analysis of its trials gives, and near
/// the true one.
#[test]
fn thresholds_are_those_of_the_analysis() {
    let typical = Curve {
        core: Core::Norm,
        threshold: 0.5,
        width: 0.5,
        gamma: 0.5,
        lambda: 0.02,
    };
    let compared = Compared::Levels {
        family: PartId::new("f").unwrap(),
        standard: 0.0,
    };
    let rule = constant(&[0.2, 0.4, 0.6, 0.8, 1.0], 80);
    let track = track(
        Method::TwoIntervals,
        compared,
        rule,
        Truth::Function(typical),
    );
    let mut draws = Stream::new(4, &["track"]);
    let fresh = Track::new(&track.rules.rule, &track.ladder, &mut draws).unwrap();
    let levels = run(&track, fresh, &typical, &mut draws);
    assert_eq!(levels.len(), 400);
    let asked = track.asked().unwrap();
    let found = decided::threshold(asked, &levels, &track.settings)
        .unwrap()
        .value;
    assert!((found - 0.5).abs() < 0.1, "{found}");
    let counts: Vec<TrialCount> = (levels.iter())
        .map(|l| TrialCount {
            participant: "P".to_owned(),
            condition: "c".to_owned(),
            level: Some(l.level),
            target: None,
            positive: l.positive,
            trials: 1.0,
        })
        .collect();
    let results = crate::analyze::psychophysics::discrimination(asked, &counts, &track.settings);
    let function = &results.psy[&CellName::of("P", "c")];
    let median = function.posterior.threshold.median.as_ref();
    assert_eq!(median.and_then(|m| m.number()), Some(found));
    // A participant differs by a factor, or by a number of levels.
    assert_eq!(of_participant(typical, 0.1, false).threshold, 0.6);
    let doubled = of_participant(typical, libm::log(2.0), true);
    assert!((doubled.threshold - 1.0).abs() < 1e-12 && (doubled.width - 1.0).abs() < 1e-12);
}

/// Thresholds that differ by a factor of 3 differ for the analysis, and equal ones seldom.
#[test]
fn thresholds_that_differ_are_found() {
    let curve = |threshold| Curve {
        core: Core::Norm,
        threshold,
        width: 0.3,
        gamma: 0.5,
        lambda: 0.0,
    };
    let world = |ratio: f64| {
        let tracks = [("a", 0.3), ("b", 0.3 * ratio)].map(|(id, threshold)| {
            let compared = Compared::Levels {
                family: PartId::new("f").unwrap(),
                standard: 0.0,
            };
            let rule = constant(&[0.2, 0.4, 0.6, 0.8, 1.0], 10);
            let truth = Truth::Function(curve(threshold));
            let mut track = track(Method::TwoIntervals, compared, rule, truth);
            track.rules.id = PartId::new(id).unwrap();
            track
        });
        PartWorld::Tracks(TracksWorld {
            tracks: tracks.into(),
            ratios: true,
            pooled: 0,
        })
    };
    let decided = |ratio: f64| {
        let mut settings = settings(world(ratio), &[Test::Thresholds], 6);
        settings.assumptions.spread.subject = 0.1;
        let chunk = run_chunk(&settings, &cell(5, 2, 1), 0);
        assert!(chunk.tests[0].undefined.is_empty());
        assert!(chunk.intervals == 6 && chunk.half_width > 0.0);
        assert_eq!(chunk, run_chunk(&settings, &cell(5, 2, 1), 0));
        chunk.tests[0].rejected
    };
    assert_eq!((decided(3.0), decided(1.0) < 3), (6, true));
}
