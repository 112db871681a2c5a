//! Nobody can guess the right answers of tracks: ways of guessing without any sensation, over
//! all methods, many seeds and rows.
//!
//! The shares are compared with chance by hand-made bounds: 0.02 and four standard errors of
//! the simulation, which is printed (`--nocapture`).

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test that fails says where, and rates are read"
)]

use crate::parts::{PAIRS, protocol, similarity};
use std::collections::BTreeMap;
use study_plan::protocol::{Method, Protocol, Seat, Stimuli};
use study_plan::schedule::Planner;

/// Rows of a study; each has its own orders.
const ROWS: u32 = 400;

/// What somebody knows who guesses: the shares of the answers, and after each trial what they
/// said and what was right.
struct Past<'a> {
    /// How often each answer is right, in the long run.
    shares: &'a [f64],
    said: &'a [usize],
    /// What was right in each trial so far.
    right: &'a [usize],
}

impl Past<'_> {
    fn answers(&self) -> usize {
        self.shares.len()
    }

    fn count(&self, from: usize, answer: usize) -> f64 {
        self.right[from..]
            .iter()
            .filter(|right| **right == answer)
            .count() as f64
    }

    /// The answer that has been right less often than its share, compared with the others.
    fn overdue(&self, from: usize) -> usize {
        let n = (self.right.len() - from) as f64;
        let lack = |answer: usize| self.shares[answer] * n - self.count(from, answer);
        let mut best = 0;
        for answer in 1..self.answers() {
            if lack(answer) > lack(best) + 1e-9 {
                best = answer;
            }
        }
        best
    }
}

type Way = (&'static str, fn(&Past<'_>) -> usize);

const WAYS: [Way; 9] = [
    ("always the first", |_| 0),
    ("alternate", |past| past.said.len() % past.answers()),
    ("repeat what was right", |past| {
        past.right.last().copied().unwrap_or(0)
    }),
    ("what was not right", |past| {
        let last = past.right.last().copied().unwrap_or(0);
        (last + 1) % past.answers()
    }),
    ("win-stay, lose-shift", |past| {
        match (past.said.last(), past.right.last()) {
            (Some(said), Some(right)) if said == right => *said,
            (Some(said), _) => (said + 1) % past.answers(),
            _ => 0,
        }
    }),
    ("count everything", |past| past.overdue(0)),
    ("count the last eight", |past| {
        past.overdue(past.right.len().saturating_sub(8))
    }),
    ("count in blocks of twice the answers", |past| {
        let block = 2 * past.answers();
        past.overdue(past.right.len() - past.right.len() % block)
    }),
    ("count in stretches of 24", |past| {
        past.overdue(past.right.len() - past.right.len() % 24)
    }),
];

/// The best guesses: who knows the rule gives every next answer its probability.
struct Best {
    weights: Vec<f64>,
    chance: BTreeMap<Vec<u32>, f64>,
}

impl Best {
    fn new(shares: &[f64]) -> Self {
        Self {
            weights: shares.to_vec(),
            chance: BTreeMap::new(),
        }
    }

    /// The probability that a stretch ends in balance, after these counts.
    fn in_balance(&mut self, counts: &[u32]) -> f64 {
        if counts.iter().sum::<u32>() == 24 {
            let near = |(n, w): (&u32, &f64)| (f64::from(*n) - 24.0 * w).abs() <= 4.0 + 1e-9;
            return f64::from(u8::from(counts.iter().zip(&self.weights).all(near)));
        }
        if let Some(known) = self.chance.get(counts) {
            return *known;
        }
        let mut sum = 0.0;
        for answer in 0..counts.len() {
            let mut next = counts.to_vec();
            next[answer] += 1;
            sum += self.weights[answer] * self.in_balance(&next);
        }
        self.chance.insert(counts.to_vec(), sum);
        sum
    }

    /// The answer with the largest probability, divided by its share: the best one for the mean
    /// over answers of the share of right ones.
    fn guess(&mut self, past: &Past<'_>) -> usize {
        let from = past.right.len() - past.right.len() % 24;
        let counts: Vec<u32> = (0..past.answers())
            .map(|a| past.count(from, a) as u32)
            .collect();
        let gain = |answer: usize, of: &mut Self| {
            let mut next = counts.clone();
            next[answer] += 1;
            of.in_balance(&next)
        };
        let mut best = (0, gain(0, self));
        for answer in 1..past.answers() {
            let own = gain(answer, self);
            if own > best.1 + 1e-12 {
                best = (answer, own);
            }
        }
        best.0
    }
}

const METHODS: [(&str, Method); 6] = [
    ("2ifc:80:0:0.1", Method::TwoIntervals),
    ("3ifc:80:0:0", Method::ThreeIntervals),
    ("same-different:48:0.5:0.05", Method::SameDifferent),
    ("abx:80:0:0.1", Method::Abx),
    ("odd-one-out:80:0:0", Method::OddOneOut),
    ("yes-no:80:0.2:0.1", Method::YesNo),
];

/// The right answers of the trials of a track, as numbers, for each row.
fn right_answers(protocol: &Protocol, method: Method, rows: u32) -> Vec<Vec<usize>> {
    let planner = Planner::new(protocol, None).expect("a feasible design");
    let number = |right: &str| {
        method
            .answers()
            .iter()
            .position(|a| *a == right)
            .expect("an answer")
    };
    (1..=rows)
        .map(|row| {
            let trials = planner.plan(Seat::Row(row)).expect("an order");
            let right = trials.iter().filter_map(|trial| match &trial.stimuli {
                Stimuli::Track { intervals, .. } => method.correct(intervals).map(number),
                _ => None,
            });
            right.collect()
        })
        .collect()
}

/// The mean over answers of the share of trials in which it was said, of those in which it was
/// right, with its standard error over rows.
fn score(rows: &[Vec<usize>], shares: &[f64], mut way: impl FnMut(&Past<'_>) -> usize) -> [f64; 2] {
    let of_row = |right: &Vec<usize>| {
        let mut said = Vec::new();
        let mut hits = 0.0;
        for trial in 0..right.len() {
            let guess = way(&Past {
                shares,
                said: &said,
                right: &right[..trial],
            });
            if guess == right[trial] {
                hits += 1.0 / (shares[guess] * shares.len() as f64);
            }
            said.push(guess);
        }
        hits / right.len() as f64
    };
    let scores: Vec<f64> = rows.iter().map(of_row).collect();
    let n = scores.len() as f64;
    let mean = scores.iter().sum::<f64>() / n;
    let variance = scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
    [mean, (variance / n).sqrt()]
}

/// How often each answer is right in the long run.
fn shares(protocol: &Protocol, method: Method) -> Vec<f64> {
    let answers = method.answers().len();
    if method.catch_sequences().is_empty() {
        return vec![1.0 / answers as f64; answers];
    }
    let track = &protocol.tracks[0];
    let m = f64::from(track.rule.most_trials());
    let all = m / (1.0 - track.catch - track.easy);
    let (c, e) = ((all * track.catch).round(), (all * track.easy).round());
    let catch = c / (m + c + e);
    let is_catch = |answer: &&str| {
        let of = |s: &&[_]| method.correct(s) == Some(*answer);
        method.catch_sequences().iter().any(of)
    };
    (method.answers().iter())
        .map(|answer| if is_catch(answer) { catch } else { 1.0 - catch })
        .collect()
}

#[test]
fn no_way_of_guessing_is_better_than_chance_by_more_than_a_fiftieth() {
    for (rules, method) in METHODS {
        let protocol = protocol(2, &[&format!("t:{rules}")], PAIRS);
        let rows = right_answers(&protocol, method, ROWS);
        let shares = shares(&protocol, method);
        let chance = 1.0 / shares.len() as f64;
        let check = |name: &str, [mean, error]: [f64; 2]| {
            println!("{rules} {name}: {mean:.4} ± {error:.4}");
            assert!(
                mean - chance < 0.02 + 4.0 * error,
                "{rules} {name}: {mean} ± {error}"
            );
            assert!(error < 0.005, "{rules} {name}: {error}");
        };
        for (name, way) in WAYS {
            check(name, score(&rows, &shares, way));
        }
        let mut best = Best::new(&shares);
        check("the best", score(&rows, &shares, |past| best.guess(past)));
    }
}

/// The same ways of guessing do find what can be guessed in version 1.
#[test]
fn the_orders_of_version_1_can_be_guessed() {
    for (rules, method) in METHODS {
        let protocol = protocol(1, &[&format!("t:{rules}")], PAIRS);
        let rows = right_answers(&protocol, method, 60);
        let shares = shares(&protocol, method);
        let chance = 1.0 / shares.len() as f64;
        let of = |(_, way): &Way| score(&rows, &shares, *way)[0];
        let best = WAYS.iter().map(of).fold(0.0, f64::max);
        println!("{rules}: {best:.4}");
        assert!(best > chance + 0.05, "{rules}: {best}");
    }
}

/// Each answer is right between 8 and 16 times in 24 trials, of three between 4 and 12 times,
/// and each sequence of an answer nearly equally often.
#[test]
fn answers_and_sequences_stay_in_balance() {
    for (rules, method) in METHODS {
        let protocol = protocol(2, &[&format!("t:{rules}")], PAIRS);
        let shares = shares(&protocol, method);
        for right in right_answers(&protocol, method, 60) {
            for stretch in right.chunks_exact(24) {
                for (answer, share) in shares.iter().enumerate() {
                    let n = stretch.iter().filter(|r| **r == answer).count() as f64;
                    assert!(
                        (n - 24.0 * share).abs() <= 4.0 + 1e-9,
                        "{rules}: {stretch:?}"
                    );
                }
            }
        }
        let trials = Planner::new(&protocol, None)
            .unwrap()
            .plan(Seat::Row(1))
            .unwrap();
        let mut counts: BTreeMap<&str, BTreeMap<String, i32>> = BTreeMap::new();
        for trial in &trials {
            if let Stimuli::Track { intervals, .. } = &trial.stimuli {
                let of = counts
                    .entry(method.correct(intervals).unwrap())
                    .or_default();
                *of.entry(format!("{intervals:?}")).or_default() += 1;
            }
        }
        for of in counts.values() {
            let (least, most) = (of.values().min(), of.values().max());
            assert!(most.unwrap() - least.unwrap() <= 2, "{rules}: {of:?}");
        }
    }
}

/// Which of a pair comes first follows neither from the trials before, nor from another two rows.
/// Nobody is told what came first, so that nobody can count.
#[test]
fn which_of_a_pair_comes_first_cannot_be_guessed() {
    let rules = PAIRS.replace("repetitions = 3", "repetitions = 4");
    first_cannot_be_guessed(&protocol(2, &[], &rules), 10);
    // In whatever version of the orders of others.
    let rules = "repetitions = 4\nidentical = true\npractice = 3";
    first_cannot_be_guessed(&similarity(1, rules), 6);
}

/// `block`: different pairs in a block.
fn first_cannot_be_guessed(protocol: &Protocol, block: usize) {
    let planner = Planner::new(protocol, None).unwrap();
    let exchanged = |row: u32| -> Vec<(String, usize)> {
        let trials = planner.plan(Seat::Row(row)).unwrap();
        let counted = trials.iter().filter(|trial| !trial.practice);
        let one = counted.filter_map(|trial| match &trial.stimuli {
            Stimuli::Pair { pair: [a, b] } if a < b => Some((format!("{a}{b}"), 0)),
            Stimuli::Pair { pair: [a, b] } if b < a => Some((format!("{b}{a}"), 1)),
            _ => None,
        });
        one.collect()
    };
    let rows: Vec<Vec<(String, usize)>> = (1..=ROWS).map(exchanged).collect();
    let n: usize = rows.iter().map(Vec::len).sum();
    let error = 0.5 / (n as f64 / 2.0).sqrt();
    let share = |hit: &mut dyn FnMut(usize, usize) -> bool| {
        let hits = (0..rows.len()).flat_map(|row| (0..rows[row].len()).map(move |at| (row, at)));
        hits.filter(|(row, at)| hit(*row, *at)).count() as f64 / n as f64
    };
    let first = share(&mut |row, at| rows[row][at].1 == 0);
    let alternate = share(&mut |row, at| rows[row][at].1 == at % 2);
    let blocks = share(&mut |row, at| rows[row][at].1 == at / block % 2);
    let rhythm = share(&mut |row, at| rows[row][at].1 == at / 2 % 2);
    // What the rows before had in the same repetition of the same pair.
    let as_row = |back: usize| {
        let known: Vec<BTreeMap<&str, Vec<usize>>> = (rows.iter())
            .map(|row| {
                let mut of: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
                for (pair, bit) in row {
                    of.entry(pair).or_default().push(*bit);
                }
                of
            })
            .collect();
        let (mut hits, mut all) = (0, 0);
        for row in back..rows.len() {
            for (pair, bits) in &known[row] {
                let before = &known[row - back][pair];
                hits += bits.iter().zip(before).filter(|(a, b)| a == b).count();
                all += bits.len();
            }
        }
        hits as f64 / all as f64
    };
    for (name, share) in [
        ("always the same", first),
        ("alternate", alternate),
        ("by blocks", blocks),
        ("twice each", rhythm),
        ("as two rows before", as_row(2)),
        ("as three rows before", as_row(3)),
    ] {
        println!("{name}: {share:.4} ± {error:.4}");
        assert!((share - 0.5).abs() < 0.02 + 4.0 * error, "{name}: {share}");
    }
}

/// Whether the two are the same realization follows neither from the place of a trial in its block nor from the trial before,
/// but for what has come already: nobody is told what that was.
#[test]
fn identical_pairs_come_anywhere() {
    let protocol = similarity(2, "repetitions = 2\nidentical = true");
    let planner = Planner::new(&protocol, None).unwrap();
    let identical = |row: u32| -> Vec<bool> {
        let trials = planner.plan(Seat::Row(row)).unwrap();
        let same = trials.iter().map(|trial| match &trial.stimuli {
            Stimuli::Pair { pair: [a, b] } => a == b,
            other => panic!("{other:?}"),
        });
        same.collect()
    };
    let rows: Vec<Vec<bool>> = (1..=ROWS).map(identical).collect();
    let share = |trials: &mut dyn Iterator<Item = bool>| {
        let all: Vec<bool> = trials.collect();
        let mean = all.iter().filter(|same| **same).count() as f64 / all.len() as f64;
        (mean, (0.24 / all.len() as f64).sqrt())
    };
    // Of ten pairs of a block four are identical.
    for place in 0..20 {
        let (found, error) = share(&mut rows.iter().map(|row| row[place]));
        assert!(
            (found - 0.4).abs() < 4.0 * error,
            "{place}: {found} ± {error}"
        );
    }
    // After an identical one three of the nine others are.
    let in_a_block = |row: &Vec<bool>| -> Vec<[bool; 2]> {
        let blocks = row.chunks(10).flat_map(|block| block.windows(2));
        blocks.map(|two| [two[0], two[1]]).collect()
    };
    let after: Vec<[bool; 2]> = rows.iter().flat_map(in_a_block).collect();
    for (before, expected) in [(true, 3.0 / 9.0), (false, 4.0 / 9.0)] {
        let own = after.iter().filter(|two| two[0] == before);
        let (found, error) = share(&mut own.map(|two| two[1]));
        assert!(
            (found - expected).abs() < 4.0 * error,
            "{before}: {found} ± {error}"
        );
    }
}
