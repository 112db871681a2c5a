//! How well the weights of five components are found from choices: `cargo run --release --example choice_weights -- 50`
//! simulates so many studies of each kind. Each has 25 stimuli whose errors are squares of normal numbers, and people whose
//! sensitivities differ by 30 % (their logarithms are normal); the noise of an impression is 1.
#![allow(clippy::print_stdout)]

use study_stats::choice_weights::{Chosen, NoWeights, weigh};
use study_stats::random::{RandomSource as _, SplitMix64};

const STIMULI: u64 = 25;

/// Kinds of perceivers, their weights, how many they are, and choices of each.
const KINDS: [(&str, [f64; 5], [usize; 2]); 5] = [
    ("one component", [0.0, 1.0, 0.0, 0.0, 0.0], [10, 40]),
    ("one component", [0.0, 1.0, 0.0, 0.0, 0.0], [20, 60]),
    ("two components", [0.0, 0.6, 0.0, 0.4, 0.0], [10, 40]),
    ("all alike", [0.3; 5], [10, 40]),
    ("nothing", [0.0; 5], [10, 40]),
];

fn main() -> Result<(), NoWeights> {
    let studies: u64 = std::env::args()
        .nth(1)
        .and_then(|n| n.parse().ok())
        .unwrap_or(10);
    for (name, weights, [people, each]) in KINDS {
        let sum: f64 = weights.iter().sum();
        let truth = weights.map(|w| if sum > 0.0 { w / sum } else { 0.2 });
        let [mut second, mut most, mut inside, mut better] = [0.0; 4];
        for seed in 0..studies {
            let mut random = SplitMix64::new(77 + 7919 * seed);
            let mut stimulus = || (0..5).map(|_| random.normal().powi(2)).collect();
            let errors: Vec<Vec<f64>> = (0..STIMULI).map(|_| stimulus()).collect();
            let mut chosen = Vec::new();
            for participant in 0..people {
                let own = (0.3 * random.normal()).exp();
                for _ in 0..each {
                    let a = random.below(STIMULI) as usize;
                    let b = (a + 1 + random.below(STIMULI - 1) as usize) % STIMULI as usize;
                    let mut felt = |i: usize| {
                        let loss = errors[i].iter().zip(weights).map(|(e, w)| e * w);
                        random.normal() - own * loss.sum::<f64>()
                    };
                    let (preferred, other) = if felt(a) > felt(b) { (a, b) } else { (b, a) };
                    chosen.push(Chosen {
                        preferred,
                        other,
                        participant,
                    });
                }
            }
            let found = weigh(&errors, &chosen, &mut random)?;
            let share = found.shares.as_ref().map_or(0.0, |shares| shares[1]);
            second += share;
            most += f64::from(u8::from(share >= 0.9));
            let all = (found.shares_ci95.iter().zip(truth))
                .all(|((low, high), share)| (*low..=*high).contains(&share));
            inside += f64::from(u8::from(all));
            let gain = found.left_out.and_then(|left_out| left_out.gain_ci95);
            better += f64::from(u8::from(gain.is_some_and(|(low, _)| low > 0.0)));
        }
        let n = studies as f64;
        println!(
            "{name}, {people} people, {each} choices each: mean share of the second {:.2}, at least .9 in {:.2}; \
             all intervals hold in {:.2}; better than equal weights in {:.2}",
            second / n,
            most / n,
            inside / n,
            better / n
        );
    }
    Ok(())
}
