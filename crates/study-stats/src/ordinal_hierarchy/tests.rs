use super::effects::{Effects, Latent};
use super::*;
use crate::describe::{mean, sd};

fn cell(participant: usize, realization: usize, counts: &[u32]) -> OrdinalCell {
    OrdinalCell {
        participant,
        realization,
        counts: counts.to_vec(),
    }
}

/// The density of latent means is that of a normal distribution with their covariance, by hand for three cells: v + σ² of the same participant, τ² of the same
/// realization, s²xx′ of all.
#[test]
fn the_density_of_latent_means_is_normal() {
    let cells = [
        cell(0, 0, &[1, 1]),
        cell(0, 1, &[1, 1]),
        cell(1, 1, &[0, 2]),
    ];
    let data = Data::new(&cells, &[-1.0, 1.5]).unwrap();
    let latent = |participant, realization, n, mean| Latent {
        participant,
        realization,
        n,
        mean,
    };
    let all = [
        latent(0, 0, 2.0, 0.4),
        latent(0, 1, 3.0, -0.9),
        latent(1, 1, 1.0, 1.7),
    ];
    // numpy: slogdet and solve of the covariance; without 3 ln 2π.
    for (spread, slope, expected) in [
        ([0.5, 0.8, 0.3], 1.0, -2.904_098_028_220_427_6),
        ([1.2, 0.1, 0.9], 0.4, -2.705_604_114_334_944_3),
    ] {
        let found = Effects::new(&data, &all, spread, slope).unwrap();
        assert!(
            (found.log_density - expected).abs() < 1e-12,
            "{}",
            found.log_density
        );
    }
}

/// Draws of the effects have the mean and the standard deviation that follow from that covariance.
#[test]
fn effects_are_drawn_from_their_distribution() {
    let cells = [
        cell(0, 0, &[1, 1]),
        cell(0, 1, &[1, 1]),
        cell(1, 1, &[0, 2]),
    ];
    let data = Data::new(&cells, &[-1.0, 1.5]).unwrap();
    let all = [(0, 0, 2.0, 0.4), (0, 1, 3.0, -0.9), (1, 1, 1.0, 1.7)].map(
        |(participant, realization, n, mean)| Latent {
            participant,
            realization,
            n,
            mean,
        },
    );
    let found = Effects::new(&data, &all, [0.5, 0.8, 0.3], 1.0).unwrap();
    let mut random = SplitMix64::new(4);
    let draws: Vec<Vec<f64>> = (0..40_000)
        .map(|_| {
            let (people, own) = found.draw(&mut random);
            [people, own].concat()
        })
        .collect();
    // u₀, u₁, m₀, m₁, β by numpy: D Hᵀ V⁻¹ y and D − D Hᵀ V⁻¹ H D.
    let reference = [
        (-0.251_258_555_242_824_2, 0.488_512_188_888_819_86),
        (0.724_834_465_963_222_8, 0.668_578_016_923_161_5),
        (0.131_826_504_191_149_58, 0.466_810_086_238_893_36),
        (0.053_164_085_934_006_095, 0.475_704_657_058_287_57),
        (-0.208_321_501_160_561_7, 0.413_977_563_631_399_65),
    ];
    for (at, (expected, deviation)) in reference.into_iter().enumerate() {
        let own: Vec<f64> = draws.iter().map(|d| d[at]).collect();
        let (m, s) = (mean(&own).unwrap(), sd(&own).unwrap());
        assert!((m - expected).abs() < 4.0 * deviation / 200.0, "{at}: {m}");
        assert!((s / deviation - 1.0).abs() < 0.015, "{at}: {s}");
    }
}

#[test]
fn what_is_no_data_is_refused() {
    let of = |cells: &[OrdinalCell], x: &[f64]| Data::new(cells, x).err();
    let two = [cell(0, 0, &[1, 0]), cell(1, 1, &[0, 1])];
    assert_eq!(of(&two, &[]), None);
    assert_eq!(of(&two, &[0.1]), Some(OrdinalError::Covariate));
    assert_eq!(of(&two, &[0.1, f64::NAN]), Some(OrdinalError::Covariate));
    assert_eq!(of(&two[..1], &[]), Some(OrdinalError::TooFew));
    assert_eq!(of(&[], &[]), Some(OrdinalError::Categories));
    let uneven = [cell(0, 0, &[1, 0]), cell(1, 1, &[0, 1, 0])];
    assert_eq!(of(&uneven, &[]), Some(OrdinalError::Categories));
    let alike = [cell(0, 0, &[2, 0]), cell(1, 1, &[1, 0])];
    assert_eq!(of(&alike, &[]), Some(OrdinalError::Constant));
}

/// The same seed gives the same posterior, and chains that have hardly begun say so.
#[test]
fn draws_follow_from_the_seed() {
    let cells: Vec<OrdinalCell> = (0..6)
        .flat_map(|i| (0..3).map(move |j| (i, j)))
        .map(|(i, j)| {
            let mut counts = [0; 5];
            counts[(i + 2 * j) % 5] += 1;
            counts[(j + 1) % 5] += 1;
            cell(i, j, &counts)
        })
        .collect();
    let effort = OrdinalEffort {
        chains: 4,
        warmup: 20,
        draws: 60,
    };
    let of = |seed| {
        let mut random = SplitMix64::new(seed);
        let priors = OrdinalPriors::default();
        ordinal_hierarchy(&cells, &[], &priors, Some(0.3), effort, &mut random).unwrap()
    };
    let found = of(1);
    assert_eq!(found, of(1));
    assert_ne!(found, of(2));
    assert!(found.convergence.problem().is_some());
    for ends in [&found.highest, &found.lowest] {
        let sum: f64 = ends.iter().sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }
    let middle: f64 = found.realizations.iter().map(|r| r.mean).sum();
    assert!(middle.abs() < 1e-12, "{middle}");
    assert!(found.differences.iter().all(|d| d.equivalent.is_some()));
    assert!(found.slope.is_none());
}
