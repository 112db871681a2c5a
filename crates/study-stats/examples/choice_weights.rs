//! How well the weights of five components are found from choices: `cargo run --release --example choice_weights -- 50`
//! simulates so many studies of each kind. Each has 25 stimuli whose errors are squares of normal numbers, and people whose
//! sensitivities differ by 30 % (their logarithms are normal); the noise of an impression is 1.
//!
//! With `--file weights.csv` each study is a line of a file: what is there is not simulated again, so that a run can be
//! interrupted. `--shard 2/4` simulates every fourth study, into a file of its own; `cat` puts files together. Means have standard
//! errors, shares exact 95 % intervals.
#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;
use std::fs::{OpenOptions, read_to_string};
use std::io::Write as _;
use study_stats::choice_weights::{Chosen, NoWeights, weigh};
use study_stats::describe::{mean, sd};
use study_stats::proportion::clopper_pearson;
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

/// Number of a kind and of a study, and what was found: the share of the second component, whether all intervals hold, whether the
/// weights predict better than equal ones.
type Found = BTreeMap<(usize, u64), [f64; 3]>;

fn main() -> Result<(), NoWeights> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let studies: u64 = (arguments.first())
        .and_then(|n| n.parse().ok())
        .unwrap_or(10);
    let shard = value("--shard").unwrap_or_else(|| "1/1".to_owned());
    let shard = shard
        .split_once('/')
        .and_then(|(own, all)| Some((own.parse::<u64>().ok()?, all.parse::<u64>().ok()?)));
    let (own, all) = shard
        .filter(|(own, all)| (1..=*all).contains(own))
        .expect("--shard takes I/N");
    let file = value("--file");
    let mut found: Found = file.as_deref().map(lines).unwrap_or_default();
    for kind in 0..KINDS.len() {
        for seed in (0..studies).filter(|seed| seed % all == own - 1) {
            if found.contains_key(&(kind, seed)) {
                continue;
            }
            let study = study(kind, seed)?;
            if let Some(file) = &file {
                let [share, inside, better] = study;
                let line = format!("{kind},{seed},{share},{inside},{better}\n");
                let out = OpenOptions::new().create(true).append(true).open(file);
                let mut out = out.expect("the file can be written");
                out.write_all(line.as_bytes())
                    .expect("the file can be written");
            }
            found.insert((kind, seed), study);
        }
    }
    println!(
        "| perceivers | people × choices | studies | mean share of the second | .9 or more | all intervals hold | better than equal weights |\n|---|---|---|---|---|---|---|"
    );
    for (kind, (name, _, [people, each])) in KINDS.iter().enumerate() {
        let own: Vec<&[f64; 3]> = (found.iter())
            .filter(|((of, _), _)| *of == kind)
            .map(|(_, study)| study)
            .collect();
        let shares: Vec<f64> = own.iter().map(|study| study[0]).collect();
        let error = sd(&shares).unwrap_or_default() / (shares.len() as f64).sqrt();
        let of = |which: &dyn Fn(&[f64; 3]) -> bool| {
            let hits = own.iter().filter(|study| which(study)).count();
            let (low, high) =
                clopper_pearson(hits as u64, own.len() as u64, 0.95).unwrap_or((0.0, 1.0));
            let share = hits as f64 / own.len().max(1) as f64;
            format!("{share:.2} ({low:.2} to {high:.2})")
        };
        println!(
            "| {name} | {people} × {each} | {} | {:.3} ± {error:.3} | {} | {} | {} |",
            own.len(),
            mean(&shares).unwrap_or_default(),
            of(&|study| study[0] >= 0.9),
            of(&|study| study[1] > 0.0),
            of(&|study| study[2] > 0.0)
        );
    }
    Ok(())
}

/// The lines of a file; one that an interruption tore is taken away.
fn lines(file: &str) -> Found {
    let text = read_to_string(file).unwrap_or_default();
    let whole = text.rfind('\n').map_or(0, |at| at + 1);
    if whole < text.len() {
        std::fs::write(file, &text[..whole]).expect("the file can be written");
    }
    let line = |line: &str| {
        let (kind, rest) = line.split_once(',')?;
        let (seed, rest) = rest.split_once(',')?;
        let numbers: Vec<f64> = rest
            .split(',')
            .map(|x| x.parse().ok())
            .collect::<Option<_>>()?;
        let numbers: [f64; 3] = numbers.try_into().ok()?;
        Some(((kind.parse().ok()?, seed.parse().ok()?), numbers))
    };
    text[..whole].lines().filter_map(line).collect()
}

/// A study of a kind.
fn study(kind: usize, seed: u64) -> Result<[f64; 3], NoWeights> {
    let (_, weights, [people, each]) = KINDS[kind];
    let sum: f64 = weights.iter().sum();
    let truth = weights.map(|w| if sum > 0.0 { w / sum } else { 0.2 });
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
    let all = (found.shares_ci95.iter().zip(truth))
        .all(|((low, high), share)| (*low..=*high).contains(&share));
    let gain = found.left_out.and_then(|left_out| left_out.gain_ci95);
    let better = gain.is_some_and(|(low, _)| low > 0.0);
    Ok([share, f64::from(u8::from(all)), f64::from(u8::from(better))])
}
