//! Reference values are those of `study-stats/tests/reference/power_felt.py`.

use super::super::{Assumptions, PartWorld, Scale, Vaf, merge, run_chunk};
use super::*;
use study_stats::power::covariate::Spread;

fn settings(world: FeltWorld, (slope, spread): (f64, Spread), studies: u64) -> Settings {
    Settings {
        assumptions: Assumptions {
            slope,
            smallest: None,
            mean: 0.0,
            spread,
            scale: Scale::Continuous,
            vaf: Vaf::Listed,
            dropout: 0.0,
            missing: 0.0,
            reference: 0.0,
        },
        tests: world.tests(),
        part: Some(PartWorld::Felt(world)),
        pilot: None,
        listed: Vec::new(),
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

fn powers(settings: &Settings, cell: Cell) -> Vec<f64> {
    let chunks: Vec<_> = (0..settings.chunks())
        .map(|i| run_chunk(settings, &cell, i))
        .collect();
    let found = merge(settings, cell, &chunks).unwrap();
    found.tests.iter().map(|test| test.power).collect()
}

/// Within four standard errors of so many studies.
fn agrees(found: f64, expected: f64, studies: f64) {
    let allowed = 4.0 * (expected * (1.0 - expected) / studies).sqrt();
    assert!((found - expected).abs() <= allowed, "{found}, {expected}");
}

/// Three realizations in even steps, ranked once by six participants.
#[test]
fn rankings_agree_with_an_independent_simulation() {
    for (slope, expected) in [(0.0, 0.029_43), (0.7, 0.322_03)] {
        let step = 1.5f64.sqrt();
        let world = FeltWorld::Ranking {
            x: vec![-step, 0.0, step],
            property: "level",
            ties: false,
        };
        let spread = Spread {
            interaction: 0.5,
            residual: 1.0,
            ..Spread::default()
        };
        let settings = settings(world, (slope, spread), 2000);
        let found = powers(&settings, cell(6, 3, 1));
        agrees(found[0], expected, 2000.0);
        // To be above each other one takes more than to be ranked alike.
        assert!(found[1] < found[0] + 0.02, "{found:?}");
    }
}

/// Noncentral t of the means of four settings, on a fine ladder.
#[test]
fn settings_have_the_power_of_a_t_test() {
    for (mean, expected) in [(1.0, 0.05), (1.1, 0.514_35)] {
        let world = FeltWorld::Adjustment {
            levels: (0..=4000).map(|step| 0.001 * f64::from(step)).collect(),
            standard: 1.0,
            mean,
        };
        let spread = Spread {
            subject: 0.1,
            residual: 0.2,
            ..Spread::default()
        };
        let settings = settings(world, (0.0, spread), 2000);
        agrees(powers(&settings, cell(10, 1, 2))[0], expected, 2000.0);
    }
}

#[test]
fn labels_agree_with_an_independent_simulation() {
    let world = FeltWorld::Identification {
        right: vec![0, 1, 2, 3],
        labels: 4,
        correct: 0.35,
    };
    let spread = Spread {
        subject: 0.5,
        realization: 0.3,
        ..Spread::default()
    };
    let settings = settings(world, (0.0, spread), 2000);
    agrees(powers(&settings, cell(8, 4, 6))[0], 0.447_24, 2000.0);
}

/// A map follows levels that are felt, and others as often as chance.
#[test]
fn maps_follow_what_is_felt() {
    let world = FeltWorld::Similarity {
        x: vec![-1.3, -0.9, 0.1, 0.6, 1.5],
        property: "level",
        pairs: (0..5)
            .flat_map(|a| (a + 1..5).map(move |b| [a, b]))
            .collect(),
    };
    let of = |slope: f64, realization: f64, studies: u64| {
        let spread = Spread {
            realization,
            interaction: 5.0,
            residual: 5.0,
            ..Spread::default()
        };
        let settings = settings(world.clone(), (slope, spread), studies);
        powers(&settings, cell(6, 5, 1))[0]
    };
    assert!(of(20.0, 2.0, 20) > 0.9);
    agrees(of(0.0, 20.0, 120), 0.05, 120.0);
}

/// The same numbers again, and nobody is left of those who all drop out.
#[test]
fn studies_follow_from_their_number() {
    let world = FeltWorld::Ranking {
        x: vec![-1.0, 1.0, 0.0],
        property: "level",
        ties: true,
    };
    let spread = Spread {
        residual: 1.0,
        ..Spread::default()
    };
    let mut settings = settings(world, (1.0, spread), 10);
    let own = cell(6, 3, 2);
    let chunk = run_chunk(&settings, &own, 0);
    assert_eq!(chunk, run_chunk(&settings, &own, 0));
    assert!(chunk.tests[0].undefined.is_empty(), "{chunk:?}");
    settings.assumptions.missing = 1.0;
    let chunk = run_chunk(&settings, &own, 0);
    let undefined: u64 = chunk.tests[0].undefined.values().sum();
    assert_eq!((chunk.tests[0].rejected, undefined), (0, 10));
}

#[test]
fn ranks_and_levels_are_the_nearest() {
    assert_eq!(ranks(&[0.1, 2.0, 1.0], 0.0), [3.0, 1.0, 2.0]);
    // The second and third are near each other; the first is alone.
    assert_eq!(ranks(&[5.0, 1.2, 1.0, -3.0], 0.5), [1.0, 2.0, 2.0, 4.0]);
    assert_eq!(nearest(&[0.0, 0.5, 1.0], 0.8), 1.0);
    assert_eq!(nearest(&[0.0, 0.5, 1.0], -9.0), 0.0);
}
