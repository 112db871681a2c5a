//! What weights predict of choices that they were not fitted to, by nested cross-validation: the penalty is chosen
//! without the choices that are predicted.

use super::maximum::advantage;
use super::{ALPHAS, Data, LAMBDAS, Penalty};
use crate::describe::{mean, sd};
use crate::distribution::t_quantile;
use crate::preference_gp::probit::of_answer;
use std::collections::BTreeSet;

/// Folds of a comparison, at most.
const FOLDS: usize = 10;
/// Folds by which a penalty is chosen, at most, and of stimuli.
const INNER_FOLDS: usize = 5;
/// Scores that differ by less than this part are equal.
const TIE: f64 = 1e-9;

/// The prediction of choices that were left out, by weights and by equal weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// Choices that were predicted.
    pub choices: f64,
    /// Mean logarithm of the probability of what was chosen; ln ½ by guessing.
    pub score: f64,
    /// The same by equal weights.
    pub equal_score: f64,
    /// Share of the choices whose answer was the more probable one.
    pub right: f64,
    /// The same by equal weights.
    pub equal_right: f64,
    /// Mean over participants, or over choices, of `score` less `equal_score`.
    pub gain: f64,
    /// 95 % interval of it, by t over participants or over choices.
    pub gain_ci95: Option<(f64, f64)>,
}

/// How some choices were predicted.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    choices: f64,
    score: f64,
    right: f64,
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.choices += other.choices;
        self.score += other.score;
        self.right += other.right;
    }

    /// Of the choices of a unit, those of some pairs.
    fn of(data: &Data, unit: usize, w: &[f64], counts: impl Fn(usize) -> bool) -> Self {
        let mut found = Self::default();
        for (row, n) in data.units[unit].iter().filter(|(row, _)| counts(*row)) {
            let ahead = advantage(&data.rows[*row], w);
            found.add(Self {
                choices: *n,
                score: n * of_answer(ahead).0,
                right: match ahead {
                    0.0 => 0.5 * n,
                    _ if ahead > 0.0 => *n,
                    _ => 0.0,
                },
            });
        }
        found
    }
}

/// The penalty that predicts the choices of some of these units best when it is fitted to those of the others; of equals
/// the first one.
pub(super) fn penalty(data: &Data, among: &[usize]) -> Penalty {
    let folds = among.len().min(INNER_FOLDS);
    if folds < 2 {
        return Penalty::Equal;
    }
    let score = |penalty: Penalty| -> f64 {
        let of_fold = |fold: usize| -> f64 {
            let is_out = |place: usize| place % folds == fold;
            let kept = (among.iter().enumerate()).filter(|(place, _)| !is_out(*place));
            let counts = data.counts(kept.map(|(_, unit)| (*unit, 1.0)));
            let Some(w) = data.fit(&counts, penalty) else {
                return f64::NEG_INFINITY;
            };
            let out = (among.iter().enumerate()).filter(|(place, _)| is_out(*place));
            out.map(|(_, unit)| Tally::of(data, *unit, &w, |_| true).score)
                .sum()
        };
        (0..folds).map(of_fold).sum()
    };
    let mut best = (Penalty::Equal, score(Penalty::Equal));
    let sparse = ALPHAS.map(Penalty::Sparse);
    for penalty in LAMBDAS.map(Penalty::Unequal).into_iter().chain(sparse) {
        let own = score(penalty);
        if own > best.1 + TIE * best.1.abs() {
            best = (penalty, own);
        }
    }
    best.0
}

/// What was predicted of each unit, by weights and by equal ones.
type Predicted = Vec<[Tally; 2]>;

/// Fits both to some units and adds what they predict of others. `false` if nothing was fitted.
fn predict(
    data: &Data,
    kept: &Data,
    (train, test): (&[usize], &[usize]),
    counts: impl Fn(usize) -> bool,
    predicted: &mut Predicted,
) -> bool {
    let of_train = kept.counts(train.iter().map(|unit| (*unit, 1.0)));
    if of_train.iter().all(|n| *n == 0.0) {
        return false;
    }
    let chosen = penalty(kept, train);
    let both = [chosen, Penalty::Equal].map(|penalty| kept.fit(&of_train, penalty));
    let [Some(own), Some(equal)] = both else {
        return false;
    };
    for unit in test {
        for (tally, w) in predicted[*unit].iter_mut().zip([&own, &equal]) {
            tally.add(Tally::of(data, *unit, w, &counts));
        }
    }
    true
}

/// The prediction of units that were left out. `None` with fewer than two, or if nothing was fitted.
pub(super) fn units(data: &Data) -> Option<LeftOut> {
    let n = data.units.len();
    let folds = n.min(FOLDS);
    let mut predicted = vec![[Tally::default(); 2]; n];
    for fold in 0..folds {
        let (test, train): (Vec<usize>, Vec<usize>) = (0..n).partition(|i| i % folds == fold);
        if !predict(data, data, (&train, &test), |_| true, &mut predicted) {
            return None;
        }
    }
    summary(&predicted)
}

/// The prediction of choices between stimuli of which one or both were left out, a fifth of the stimuli at a time. `None`
/// if no choice is left to fit to.
pub(super) fn stimuli(data: &Data) -> Option<LeftOut> {
    let all: BTreeSet<usize> = data.pairs.iter().flatten().copied().collect();
    let all: Vec<usize> = all.into_iter().collect();
    let folds = all.len().min(INNER_FOLDS);
    let everybody: Vec<usize> = (0..data.units.len()).collect();
    let mut predicted = vec![[Tally::default(); 2]; data.units.len()];
    for fold in 0..folds {
        let is_out = |stimulus: &usize| {
            let place = all.binary_search(stimulus);
            place.is_ok_and(|place| place % folds == fold)
        };
        let touched = |row: usize| data.pairs[row].iter().any(is_out);
        let mut kept = data.clone();
        for unit in &mut kept.units {
            unit.retain(|(row, _)| !touched(*row));
        }
        kept.units
            .retain(|unit| !unit.is_empty() || data.over_participants);
        let train: Vec<usize> = (0..kept.units.len()).collect();
        predict(data, &kept, (&train, &everybody), touched, &mut predicted);
    }
    summary(&predicted)
}

/// `None` if nothing was predicted.
fn summary(predicted: &Predicted) -> Option<LeftOut> {
    let mut sums = [Tally::default(); 2];
    let mut gains = Vec::new();
    for [own, equal] in predicted.iter().filter(|both| both[0].choices > 0.0) {
        sums[0].add(*own);
        sums[1].add(*equal);
        gains.push((own.score - equal.score) / own.choices);
    }
    let [own, equal] = sums;
    let gain = mean(&gains)?;
    let n = gains.len() as f64;
    let half = (sd(&gains)).and_then(|sd| Some(t_quantile(0.975, n - 1.0)? * sd / n.sqrt()));
    Some(LeftOut {
        choices: own.choices,
        score: own.score / own.choices,
        equal_score: equal.score / equal.choices,
        right: own.right / own.choices,
        equal_right: equal.right / equal.choices,
        gain,
        gain_ci95: half.map(|half| (gain - half, gain + half)),
    })
}
