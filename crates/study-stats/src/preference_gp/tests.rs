use super::*;
use proptest::prelude::*;

fn line(n: usize) -> Vec<Vec<f64>> {
    (0..n).map(|i| vec![i as f64 / (n - 1) as f64]).collect()
}

fn kernel() -> Kernel {
    Kernel {
        sd: 2.0,
        lengths: vec![0.4],
    }
}

fn choice(preferred: usize, other: usize) -> Choice {
    Choice { preferred, other }
}

#[test]
fn without_answers_the_posterior_is_the_prior() {
    let prior = Posterior::new(&line(4), &kernel(), &[]).unwrap();
    assert_eq!(prior.mean(), [0.0; 4]);
    assert_eq!((prior.sd(2), prior.evidence()), (2.0, 0.0));
    // √5 · (1/3) / 0.4 = 1.8634: 4 (1 + r + r²/3) exp(−r)
    assert!((prior.covariance(1, 2) - 2.495_239_254_563_323_5).abs() < 1e-12);
    // The most different pair: θ/√(2π), the same for all that are as far apart.
    assert_eq!(prior.best_pair(|_| true), Some((0, 3)));
    let spread = (8.0 - 2.0 * prior.covariance(0, 3)).sqrt();
    let expected = spread / (2.0 * std::f64::consts::PI).sqrt();
    assert!((prior.expected_best(0, 3) - expected).abs() < 1e-14);
    assert_eq!(prior.best_point(|_| true), Some(0));
}

/// Of five points on a line, 2 was preferred to 1: 3 is the best, 2 is close to it, and of 0 little is known.
#[test]
fn a_challenger_is_the_point_that_may_be_better_by_most() {
    let posterior = Posterior::new(&line(5), &kernel(), &[choice(2, 1)]).unwrap();
    assert_eq!(posterior.best_point(|_| true), Some(3));
    let advantage = |other: usize| {
        let mean = posterior.mean()[other] - posterior.mean()[3];
        let variance = posterior.covariance(3, 3) + posterior.covariance(other, other)
            - 2.0 * posterior.covariance(3, other);
        (mean, variance.sqrt())
    };
    let (near, far) = (advantage(2), advantage(0));
    // By numpy: (−0.1671, 1.3908) and (−1.0430, 2.2869).
    let expected = [
        near.0 + 0.1671,
        near.1 - 1.3908,
        far.0 + 1.043,
        far.1 - 2.2869,
    ];
    assert!(expected.iter().all(|off| off.abs() < 1e-4), "{expected:?}");
    let turn = (near.0 - far.0) / (far.1 - near.1);
    assert_eq!(posterior.challenge(0.99 * turn, |_| true), Some((2, 3)));
    assert_eq!(posterior.challenge(1.01 * turn, |_| true), Some((0, 3)));
    // Of points that are tied by symmetry, the first.
    let prior = Posterior::new(&line(3), &kernel(), &[choice(1, 0), choice(1, 2)]).unwrap();
    assert_eq!(prior.challenge(2.0, |_| true), Some((0, 1)));
    // A point that cannot be presented is neither.
    assert_eq!(posterior.best_point(|point| point != 3), Some(2));
    assert_eq!(posterior.challenge(2.0, |point| point != 3), Some((2, 4)));
    assert_eq!(posterior.challenge(2.0, |point| point > 2), Some((3, 4)));
    assert_eq!(posterior.challenge(2.0, |point| point == 3), None);
    assert_eq!(posterior.best_pair(|point| point > 2), Some((3, 4)));
    assert_eq!(posterior.best_pair(|point| point == 3), None);
    let alone = Posterior::new(&[vec![0.5]], &kernel(), &[]).unwrap();
    assert_eq!(alone.challenge(2.0, |_| true), None);
}

/// One answer: the difference g of the two points solves g = c φ(z)/(√2 Φ(z)), z = g/√2, found by bisection.
#[test]
fn one_answer_is_solved_by_bisection() {
    let points = line(3);
    let posterior = Posterior::new(&points, &kernel(), &[choice(2, 0)]).unwrap();
    let prior = Posterior::new(&points, &kernel(), &[]).unwrap();
    let c = 8.0 - 2.0 * prior.covariance(0, 2);
    let slope = |g: f64| probit::of_answer(g).1;
    let (mut low, mut high) = (0.0, 10.0);
    for _ in 0..200 {
        let middle: f64 = 0.5 * (low + high);
        match middle < c * slope(middle) {
            true => low = middle,
            false => high = middle,
        }
    }
    let g = posterior.mean()[2] - posterior.mean()[0];
    assert!((g - low).abs() < 1e-13, "{g} {low}");
    let curvature = probit::of_answer(g).2;
    let variance =
        posterior.covariance(0, 0) + posterior.covariance(2, 2) - 2.0 * posterior.covariance(0, 2);
    assert!((variance - 1.0 / (1.0 / c + curvature)).abs() < 1e-12);
    // By symmetry, the middle stays at 0.
    assert!(posterior.mean()[1].abs() < 1e-15);
}

#[test]
fn what_is_no_data_is_refused() {
    let points = line(3);
    let error = |points: &[Vec<f64>], kernel: &Kernel, choices: &[Choice]| {
        Posterior::new(points, kernel, choices).unwrap_err()
    };
    let no = error(&points, &kernel(), &[choice(1, 0), choice(2, 2)]);
    assert_eq!(no, NoPosterior::Choice { choice: 1 });
    let no = error(&points, &kernel(), &[choice(3, 0)]);
    assert_eq!(
        no.to_string(),
        "answer 0 does not compare two of the points"
    );
    assert_eq!(
        error(&[], &kernel(), &[]).to_string(),
        "0 points; there have to be 1 to 1000"
    );
    let flat = Kernel {
        sd: 0.0,
        ..kernel()
    };
    assert_eq!(error(&points, &flat, &[]), NoPosterior::Kernel);
    let short = Kernel {
        lengths: vec![0.1, -1.0],
        ..kernel()
    };
    assert_eq!(error(&points, &short, &[]), NoPosterior::Kernel);
    let plane = Kernel {
        lengths: vec![0.1, 1.0],
        ..kernel()
    };
    assert_eq!(
        error(&points, &plane, &[]).to_string(),
        "point 0 does not have 2 finite coordinates"
    );
    let mut broken = points.clone();
    broken[2][0] = f64::NAN;
    let no = NoPosterior::Coordinates {
        point: 2,
        dimensions: 1,
    };
    assert_eq!(error(&broken, &kernel(), &[]), no);
    let many = vec![choice(0, 1); MAX_CHOICES + 1];
    let no = NoPosterior::TooManyChoices {
        found: MAX_CHOICES + 1,
    };
    assert_eq!(error(&points, &kernel(), &many), no);
    let none = Posterior::most_probable(&points, &[], &[]);
    assert_eq!(none, Err(NoPosterior::Kernel));
}

/// The bits of a posterior, as this program computed them on x86-64: another processor, compiler or number of threads has to
/// give the same. The values are compared with other programs in `tests/preference_gp.rs`.
#[test]
fn a_posterior_has_the_same_bits_everywhere() {
    let choices: Vec<Choice> = (0..30)
        .map(|i| (i * 7 % 9, i * 5 % 8))
        .filter(|(a, b)| a != b)
        .map(|(a, b)| choice(a, b))
        .collect();
    let (at, posterior) = Posterior::most_probable(&line(9), &candidates(1), &choices).unwrap();
    let bits = [
        posterior.mean()[0],
        posterior.mean()[8],
        posterior.covariance(2, 5),
        posterior.evidence(),
        posterior.expected_best(3, 7),
    ]
    .map(f64::to_bits);
    assert_eq!((at, bits), (AT, BITS), "{at} {bits:#x?}");
}

const AT: usize = 6;
const BITS: [u64; 5] = [
    0xbfd1_ccc0_661c_e87e,
    0x3fce_fc1a_8457_565c,
    0x3fe6_bc79_4229_d668,
    0xc032_11c8_f77d_921a,
    0x3fc3_95cd_d65f_2466,
];

/// The first point is preferred in all of 200 answers to one pair, whose covariance has rank 1.
#[test]
fn equal_answers_have_a_mode() {
    let posterior = Posterior::new(&line(3), &kernel(), &[choice(0, 2); 200]).unwrap();
    let apart = posterior.mean()[0] - posterior.mean()[2];
    assert!(apart > 2.0 && apart.is_finite(), "{apart}");
    assert!(posterior.evidence() < 0.0);
}

proptest! {
    /// Pruning and ties change nothing: the pair is the first one near the largest value of all.
    #[test]
    fn the_best_pair_is_that_of_an_exhaustive_search(
        answers in prop::collection::vec((0usize..12, 0usize..12), 0..25),
        sd in 0.3f64..5.0,
        length in 0.1f64..1.5,
    ) {
        let choices: Vec<Choice> = (answers.into_iter())
            .filter(|(a, b)| a != b)
            .map(|(a, b)| choice(a, b))
            .collect();
        let kernel = Kernel { sd, lengths: vec![length] };
        let posterior = Posterior::new(&line(12), &kernel, &choices).unwrap();
        let mut all = Vec::new();
        for b in 0..12 {
            for a in 0..b {
                all.push((posterior.expected_best(a, b), (a, b)));
                prop_assert_eq!(posterior.expected_best(a, b), posterior.expected_best(b, a));
                let higher = posterior.mean()[a].max(posterior.mean()[b]);
                prop_assert!(posterior.expected_best(a, b) >= higher);
            }
        }
        let most = all.iter().fold(f64::NEG_INFINITY, |m, (value, _)| m.max(*value));
        let tied = most - TIE * most.abs().max(1.0);
        let first = all.iter().find(|(value, _)| *value >= tied).map(|(_, pair)| *pair);
        prop_assert_eq!(posterior.best_pair(|_| true), first);
        // Answers never make a utility less certain.
        for i in 0..12 {
            prop_assert!(posterior.sd(i) <= sd * (1.0 + 1e-12));
        }
    }

    /// The order of answers does not matter, and who is preferred the other way round turns the sign.
    #[test]
    fn answers_are_exchangeable_and_signs_turn(
        answers in prop::collection::vec((0usize..6, 0usize..6), 1..20),
    ) {
        let choices: Vec<Choice> = (answers.into_iter())
            .filter(|(a, b)| a != b)
            .map(|(a, b)| choice(a, b))
            .collect();
        let reversed: Vec<Choice> = choices.iter().rev().copied().collect();
        let turned: Vec<Choice> = choices.iter().map(|c| choice(c.other, c.preferred)).collect();
        let of = |choices: &[Choice]| Posterior::new(&line(6), &kernel(), choices).unwrap();
        let (one, two, three) = (of(&choices), of(&reversed), of(&turned));
        for i in 0..6 {
            prop_assert!((one.mean()[i] - two.mean()[i]).abs() < 1e-9);
            prop_assert!((one.mean()[i] + three.mean()[i]).abs() < 1e-9);
            prop_assert!((one.sd(i) - three.sd(i)).abs() < 1e-9);
        }
    }
}
