use super::maximum::advantage;
use super::*;
use crate::distribution::t_quantile;
use crate::random::SplitMix64;

/// Components of the error of 25 stimuli.
fn stimuli(random: &mut SplitMix64, components: usize) -> Vec<Vec<f64>> {
    let mut error = || (0..components).map(|_| random.normal().powi(2)).collect();
    (0..25).map(|_| error()).collect()
}

/// Choices between random pairs by people with these weights.
fn choices(
    random: &mut SplitMix64,
    errors: &[Vec<f64>],
    (people, each): (usize, usize),
    weights: &[f64],
) -> Vec<Chosen> {
    let n = errors.len();
    let mut chosen = Vec::new();
    for participant in 0..people {
        for _ in 0..each {
            let a = random.below(n as u64) as usize;
            let b = (a + 1 + random.below(n as u64 - 1) as usize) % n;
            let mut felt = |i: usize| random.normal() - advantage(&errors[i], weights);
            let (preferred, other) = if felt(a) > felt(b) { (a, b) } else { (b, a) };
            chosen.push(Chosen {
                preferred,
                other,
                participant,
            });
        }
    }
    chosen
}

/// People who weigh the second of five components only.
#[test]
fn who_feels_one_component_gives_it_the_weight() {
    for seed in 0..2 {
        let mut random = SplitMix64::new(seed);
        let errors = stimuli(&mut random, 5);
        let weights = [0.0, 1.0, 0.0, 0.0, 0.0];
        let chosen = choices(&mut random, &errors, (10, 60), &weights);
        let found = weigh(&errors, &chosen, &mut random).unwrap();
        let shares = found.shares.clone().unwrap();
        assert!(shares[1] >= 0.9, "{seed}: {found:?}");
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!((found.weights[1] - 1.0).abs() < 0.25, "{seed}: {found:?}");
        assert!(found.shares_ci95[1].0 > 0.5 && found.shares_ci95[1].1 > 0.99);
        assert!(found.sensitivity_ci95.0 > 0.0);
        for left_out in [found.left_out, found.other_stimuli] {
            let left_out = left_out.unwrap();
            assert!(left_out.gain_ci95.unwrap().0 > 0.05, "{seed}: {left_out:?}");
            assert!(left_out.right > left_out.equal_right + 0.05);
        }
        assert!(found.over_participants && found.participants == 10 && found.choices == 600);
    }
}

/// People who guess, and people who weigh all components alike: every interval contains one fifth in nearly all of
/// their studies, and no study tells that weights predict better.
#[test]
fn equal_weights_are_in_the_intervals_of_who_feels_nothing_or_everything() {
    for sensitivity in [0.0, 0.4] {
        let (mut without, mut better) = (0, 0);
        for seed in 0..8 {
            let mut random = SplitMix64::new(1000 + seed);
            let errors = stimuli(&mut random, 5);
            let chosen = choices(&mut random, &errors, (8, 30), &[sensitivity; 5]);
            let found = weigh(&errors, &chosen, &mut random).unwrap();
            let has = |(low, high): &(f64, f64)| *low <= 0.2 && 0.2 <= *high;
            without += usize::from(!found.shares_ci95.iter().all(has));
            let gain = found.left_out.unwrap().gain_ci95.unwrap();
            better += usize::from(gain.0 > 0.0);
            if sensitivity > 0.0 {
                assert!(found.sensitivity_ci95.0 > 0.0, "{seed}: {found:?}");
            }
        }
        // Binomial: of 8 at most 2 at the level .05 with a probability of .994.
        assert!(without <= 2, "{sensitivity}: {without}");
        assert!(better <= 2, "{sensitivity}: {better}");
    }
}

/// Both ends of an interval of a share s are where w − s Σ w is t standard errors from 0.
#[test]
fn an_interval_ends_where_a_share_is_told_from_the_estimate() {
    let mut covariance = SymmetricMatrix::zero(2);
    covariance.add(0, 0, 0.04);
    covariance.add(1, 1, 0.01);
    covariance.add(0, 1, 0.005);
    let free = Free {
        weights: vec![1.0, 1.5],
        covariance,
        equal: (2.0, 0.25),
        df: 9.0,
    };
    let t = t_quantile(0.9875, 9.0).unwrap();
    let (low, high) = free.share(0);
    assert!(0.0 < low && low < 0.4 && 0.4 < high && high < 1.0);
    for s in [low, high] {
        let variance = (1.0 - s).powi(2) * 0.04 + s * s * 0.01 - 2.0 * s * (1.0 - s) * 0.005;
        let apart = (1.0 - s * 2.5_f64).abs() / variance.sqrt();
        assert!((apart - t).abs() < 1e-9, "{s}: {apart} {t}");
    }
    // A sum that is not told from 0.
    let weak = Free {
        weights: vec![0.1, 0.15],
        ..free
    };
    assert_eq!(weak.share(0), (0.0, 1.0));
    let half = 0.5 * t_quantile(0.975, 9.0).unwrap();
    assert_eq!(weak.equal_sum(), (2.0 - half, 2.0 + half));
}

/// If every choice is predicted, weights stay finite; with one participant choices are the units.
#[test]
fn choices_without_an_error_have_finite_weights() {
    let errors: Vec<Vec<f64>> = (0..6).map(|i| vec![f64::from(i), 1.0]).collect();
    let choose = |i: usize| Chosen {
        preferred: i % 5,
        other: i % 5 + 1,
        participant: 3,
    };
    let chosen: Vec<Chosen> = (0..20).map(choose).collect();
    let found = weigh(&errors, &chosen, &mut SplitMix64::new(1)).unwrap();
    assert!(found.weights.iter().all(|w| w.is_finite()));
    assert!(!found.over_participants && found.participants == 1);
    let spread = spread(&errors, &chosen).unwrap();
    assert_eq!(
        (spread.rms.as_slice(), spread.own.as_slice()),
        (&[1.0, 0.0][..], &[1.0, 0.0][..])
    );
    assert!((spread.cosine[0][0] - 1.0).abs() < 1e-12);
    assert_eq!((spread.cosine[0][1], spread.cosine[1][1]), (0.0, 0.0));
}

#[test]
fn what_cannot_be_fitted_is_named() {
    let errors = vec![vec![0.0, 1.0], vec![1.0, 0.0]];
    let choose = |preferred, other| Chosen {
        preferred,
        other,
        participant: 0,
    };
    let some = vec![choose(0, 1); 12];
    let refused = |errors: &[Vec<f64>], chosen: &[Chosen]| {
        let error = fit(errors, chosen, Penalty::Equal).unwrap_err();
        assert_eq!(
            spread(errors, chosen).err().unwrap_or(NoWeights::Alike),
            error
        );
        error
    };
    assert_eq!(refused(&errors, &some[..9]), NoWeights::TooFew(9));
    assert_eq!(refused(&[], &some), NoWeights::Components);
    let uneven = [vec![0.0], vec![1.0, 0.0]];
    assert_eq!(refused(&uneven, &some), NoWeights::Components);
    let infinite = [vec![0.0], vec![f64::INFINITY]];
    assert_eq!(refused(&infinite, &some), NoWeights::NotFinite);
    let same = [vec![2.0], vec![2.0]];
    assert_eq!(refused(&same, &some), NoWeights::Alike);
    let mut wrong = some.clone();
    wrong[4] = choose(1, 1);
    assert_eq!(refused(&errors, &wrong), NoWeights::Choice(4));
    wrong[4] = choose(1, 2);
    assert_eq!(refused(&errors, &wrong), NoWeights::Choice(4));
}
