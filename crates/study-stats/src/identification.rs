//! Identification: one of several labels is given to each stimulus. What a matrix of
//! confusions transmits, which labels are similar, and whether participants do better than
//! by guessing.
//!
//! Participants are the sampling units: errors of what all of them transmit together are by
//! leaving out each in turn.

use super::detection::{self, Answers};
use super::distribution::{t_quantile, t_two_sided};
use super::pairs::{Comparison, Link, Model, abilities};
use super::{describe, finite};
use std::f64::consts::LN_2;

/// How often each label was given where another one was right.
#[derive(Debug, Clone, PartialEq)]
pub struct Confusions {
    labels: usize,
    /// By the label that was right, then by the one that was given.
    counts: Vec<f64>,
}

impl Confusions {
    /// No answers yet, among so many labels.
    pub fn new(labels: usize) -> Self {
        Self {
            labels,
            counts: vec![0.0; labels * labels],
        }
    }

    /// The sum of several, all among the same labels; `None` of none.
    pub fn sum<'a>(mut all: impl Iterator<Item = &'a Self>) -> Option<Self> {
        let first = all.next()?.clone();
        Some(all.fold(first, |sum, own| sum.combined(own, 1.0)))
    }

    fn combined(&self, other: &Self, times: f64) -> Self {
        let both = self.counts.iter().zip(&other.counts);
        Self {
            labels: self.labels,
            counts: both.map(|(a, b)| a + times * b).collect(),
        }
    }

    /// Counts an answer: the label that was right, and the one that was given.
    pub fn add(&mut self, right: usize, given: usize) {
        self.counts[right * self.labels + given] += 1.0;
    }

    /// Number of labels.
    pub fn labels(&self) -> usize {
        self.labels
    }

    /// How often one label was given where another was right.
    pub fn count(&self, right: usize, given: usize) -> f64 {
        self.counts[right * self.labels + given]
    }

    /// How often a label was right.
    pub fn right(&self, label: usize) -> f64 {
        (0..self.labels).map(|given| self.count(label, given)).sum()
    }

    /// How often a label was given.
    pub fn given(&self, label: usize) -> f64 {
        (0..self.labels).map(|right| self.count(right, label)).sum()
    }

    /// Number of answers.
    pub fn trials(&self) -> f64 {
        self.counts.iter().sum()
    }

    /// Number of correct answers.
    pub fn correct(&self) -> f64 {
        (0..self.labels).map(|l| self.count(l, l)).sum()
    }

    /// The correct answers of somebody who gives each label as often, but guesses: their expected
    /// share, which is 1/labels if each is right, or is given, equally often. `None` without answers.
    pub fn by_guessing(&self) -> Option<f64> {
        let n = self.trials();
        let agree: f64 = (0..self.labels)
            .map(|l| self.right(l) * self.given(l))
            .sum();
        finite(agree / (n * n))
    }

    /// The variance of the share of correct answers if the answers are dealt to the trials at
    /// random, each label being right and given as often as it was. `None` with fewer than two answers.
    fn guessing_variance(&self) -> Option<f64> {
        let n = self.trials();
        let product = |l: usize| self.right(l) * self.given(l);
        let all: f64 = (0..self.labels).map(product).sum();
        let of_label = |l: usize| {
            let alone = (n - self.right(l)) * (n - self.given(l));
            product(l) * (alone + all - product(l))
        };
        let sum: f64 = (0..self.labels).map(of_label).sum();
        finite(sum / (n * n * (n - 1.0)) / (n * n)).filter(|_| n > 1.0)
    }
}

/// What answers tell of the labels that were right, in bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Information {
    /// The information transmitted (mutual information), by maximum likelihood: too high by chance.
    pub transmitted: f64,
    /// The same less its bias: Σ (1 − n/r)(1 − n/c)/(2N ln 2) over the cells that are not empty, where a cell
    /// has n of the r answers of its row and of the c of its column. It may fall below 0, and is never above `transmitted`.
    ///
    /// That is Miller's (1955) bias where the numbers of presentations are fixed. The entropy of a row of r answers with
    /// shares p is too low by Σ (1 − p)/(2r ln 2), together (K − R)/(2N ln 2) of K cells and R rows. The share q of a
    /// column has the variance Σ r p(1 − p)/N², so that its entropy is too low by (C − S)/(2N ln 2) of C columns, where S is the
    /// sum of n²/(r c). Drawn presentations, as Miller's, have S = 1; perfect answers S = R, and no bias.
    pub corrected: f64,
    /// The entropy of the labels that were right: what perfect answers transmit.
    pub stimulus: f64,
    /// The entropy of the labels that were given.
    pub response: f64,
}

/// The information that is transmitted. `None` without answers.
///
/// ```
/// # use study_stats::identification::{Confusions, information};
/// let mut perfect = Confusions::new(4);
/// (0..4).for_each(|label| perfect.add(label, label));
/// assert_eq!(information(&perfect).unwrap().transmitted, 2.0);
/// ```
pub fn information(found: &Confusions) -> Option<Information> {
    let n = found.trials();
    let labels = 0..found.labels;
    let entropy = |counts: &[f64]| -> f64 {
        let shares = counts.iter().map(|c| c / n).filter(|p| *p > 0.0);
        -shares.map(|p| p * libm::log2(p)).sum::<f64>()
    };
    let rows: Vec<f64> = labels.clone().map(|l| found.right(l)).collect();
    let columns: Vec<f64> = labels.clone().map(|l| found.given(l)).collect();
    let (stimulus, response) = (entropy(&rows), entropy(&columns));
    let transmitted = (stimulus + response - entropy(&found.counts)).min(stimulus);
    let cells = labels.flat_map(|right| (0..found.labels).map(move |given| (right, given)));
    let elsewhere = cells.filter_map(|(right, given)| {
        let n = found.count(right, given);
        (n > 0.0).then(|| (1.0 - n / rows[right]) * (1.0 - n / columns[given]))
    });
    let bias = elsewhere.sum::<f64>() / (2.0 * n * LN_2);
    (n > 0.0).then_some(Information {
        transmitted,
        corrected: transmitted - bias,
        stimulus,
        response,
    })
}

/// Luce's (1963) biased choice model: label j is given where i is right in proportion to η(i, j)·β(j).
#[derive(Debug, Clone, PartialEq)]
pub struct BiasedChoice {
    labels: usize,
    /// log η by pair of labels.
    similarities: Vec<f64>,
    /// β, which sum to 1.
    pub biases: Vec<f64>,
}

impl BiasedChoice {
    /// ln η of two labels: 0 if they are never told apart.
    pub fn log_similarity(&self, a: usize, b: usize) -> f64 {
        self.similarities[a * self.labels + b]
    }
}

/// The model by maximum likelihood, after 1/labels was added to each cell so that none is empty:
/// of two labels that is the log-linear correction of d′. The likelihood is that of quasi-symmetry,
/// whose sums over two cells are those of the data and whose ratios are a model of Bradley and Terry.
/// `None` if a label was never right.
pub fn biased_choice(found: &Confusions) -> Option<BiasedChoice> {
    let labels = found.labels;
    if (0..labels).any(|l| found.right(l) <= 0.0) {
        return None;
    }
    let add = 1.0 / labels as f64;
    let count = |right: usize, given: usize| found.count(right, given) + add;
    let pairs = (0..labels).flat_map(|a| (a + 1..labels).map(move |b| (a, b)));
    // That b is given for a is a preference for b.
    let compared: Vec<Comparison> = (pairs.clone())
        .map(|(a, b)| Comparison {
            first: a,
            second: b,
            first_preferred: count(b, a),
            second_preferred: count(a, b),
            tied: 0.0,
            cluster: 0,
        })
        .collect();
    let model = Model {
        link: Link::BradleyTerry,
        order: false,
    };
    let drift = abilities(labels, &compared, model).ok()?.abilities;
    let mut similarities = vec![0.0; labels * labels];
    for (a, b) in pairs {
        // The fitted cells n·p and n·(1 − p), where p is 1/(1 + e^−x).
        let x = drift[b] - drift[a];
        let both = libm::log(count(a, b) + count(b, a));
        let fitted = 2.0 * both - libm::log1p(libm::exp(-x)) - libm::log1p(libm::exp(x));
        let same = libm::log(count(a, a)) + libm::log(count(b, b));
        let similarity = 0.5 * (fitted - same);
        similarities[a * labels + b] = similarity;
        similarities[b * labels + a] = similarity;
    }
    let weights: Vec<f64> = (0..labels)
        .map(|l| libm::exp(0.5 * drift[l]) * count(l, l).sqrt())
        .collect();
    let all: f64 = weights.iter().sum();
    Some(BiasedChoice {
        labels,
        similarities,
        biases: weights.iter().map(|w| w / all).collect(),
    })
}

/// d′ of two labels, from the answers to them that were one of the two: zH − zF with the log-linear
/// correction. `None` if one of them has no such answer.
pub fn sensitivity(found: &Confusions, a: usize, b: usize) -> Option<f64> {
    let answers = Answers {
        hits: found.count(a, a),
        n_hits: found.count(a, a) + found.count(a, b),
        false_alarms: found.count(b, a),
        n_false_alarms: found.count(b, a) + found.count(b, b),
    };
    Some(detection::yes_no(&answers)?.d)
}

/// A statistic of the answers of all participants, with an error over participants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pooled {
    /// Its value.
    pub estimate: f64,
    /// Its standard error by the jackknife (Tukey 1958): √((n − 1)/n · Σ (θᵢ − θ̄)²), where θᵢ is the statistic
    /// without participant i.
    pub se: Option<f64>,
    /// `estimate` ± t(.975, n − 1)·`se`; `None` if the error is 0, because participants who are alike do not tell
    /// how much others differ.
    pub ci95: Option<(f64, f64)>,
}

/// An error below this is one of rounding.
const NO_ERROR: f64 = 1e-10;

/// Statistics of the sum of the participants' confusions, each with an error over participants if it
/// is defined without every one of them. The bootstrap's interval would be too narrow and too high: resampled
/// participants are fewer than those there are, and fewer transmit more by chance.
pub fn pooled(
    participants: &[Confusions],
    statistics: impl Fn(&Confusions) -> Vec<Option<f64>>,
) -> Vec<Option<Pooled>> {
    let Some(all) = Confusions::sum(participants.iter()) else {
        return Vec::new();
    };
    let without = participants.iter().map(|own| all.combined(own, -1.0));
    let left: Vec<Vec<Option<f64>>> = without.map(|less| statistics(&less)).collect();
    let n = participants.len() as f64;
    let estimates = statistics(&all).into_iter().enumerate();
    estimates
        .map(|(i, estimate)| {
            let left: Option<Vec<f64>> = left.iter().map(|of| of[i]).collect();
            let squares = left.and_then(|left| describe::sum_of_squares(&left));
            let se = squares.filter(|_| n > 1.0);
            let se = se.map(|squares| ((n - 1.0) / n * squares).sqrt());
            let error = se.filter(|se| *se > NO_ERROR);
            let half = error.and_then(|se| Some(t_quantile(0.975, n - 1.0)? * se));
            estimate.map(|estimate| Pooled {
                estimate,
                se,
                ci95: half.map(|half| (estimate - half, estimate + half)),
            })
        })
        .collect()
}

/// The corrected information of all participants together, with its error and interval over them.
///
/// The error is that of what is lost, L = `stimulus` − `corrected`, which has an interval on its logarithm, L·e^±h with
/// h = t(.975, n − 1)·`se`/L, so that near perfect answers it reaches further towards more errors than towards fewer. Information
/// below 0 counts as 0 there, and the interval lies between 0 and `stimulus`. `None` without answers.
pub fn transfer(participants: &[Confusions]) -> Option<Pooled> {
    let all = information(&Confusions::sum(participants.iter())?)?;
    let lost = |found: &Confusions| information(found).map(|own| own.stimulus - own.corrected);
    let found = pooled(participants, |found| vec![lost(found)]);
    let se = found.first().copied().flatten()?.se;
    let least = (all.stimulus - all.corrected).min(all.stimulus);
    let ci95 = se
        .filter(|se| *se > NO_ERROR && least > 0.0)
        .and_then(|se| {
            let half = t_quantile(0.975, participants.len() as f64 - 1.0)? * se / least;
            let left = |half: f64| (all.stimulus - least * libm::exp(half)).max(0.0);
            Some((left(half), left(-half)))
        });
    Some(Pooled {
        estimate: all.corrected,
        se,
        ci95,
    })
}

/// The least share of the variance of guesses that an error over participants may have: so few
/// participants who are alike by chance, or all of whom are right, are not certain.
const LEAST_SHARE: f64 = 0.25;

/// How far participants are above guessing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AboveGuessing {
    /// Mean over participants of the share of correct answers less that by guessing.
    pub mean: f64,
    /// Its standard error: that of a mean, but at least half of that of guesses.
    pub se: f64,
    /// Number of participants.
    pub n: usize,
    /// Mean over standard error.
    pub t: f64,
    /// Two-sided p, t on n − 1 degrees of freedom.
    pub p: f64,
    /// 95 % interval of the mean.
    pub ci95: (f64, f64),
}

/// Whether participants give the right label more often than by guessing. Guesses of each participant
/// have that participant's own preferences for labels (Cohen 1960), and their expectation is exact however few trials there are.
/// Participants with fewer than two answers do not count. `None` for fewer than two others, or if each of them always gave the
/// same label.
pub fn above_guessing(participants: &[Confusions]) -> Option<AboveGuessing> {
    let of_participant = |own: &Confusions| {
        let share = own.correct() / own.trials();
        Some((share - own.by_guessing()?, own.guessing_variance()?))
    };
    let found: Vec<(f64, f64)> = participants.iter().filter_map(of_participant).collect();
    let above: Vec<f64> = found.iter().map(|f| f.0).collect();
    let n = above.len() as f64;
    let mean = describe::mean(&above)?;
    let guesses = found.iter().map(|f| f.1).sum::<f64>() / (n * n);
    let own = describe::variance(&above)? / n;
    let se = own.max(LEAST_SHARE * guesses).sqrt();
    let t = finite(mean / se)?;
    let half = t_quantile(0.975, n - 1.0)? * se;
    Some(AboveGuessing {
        mean,
        se,
        n: above.len(),
        t,
        p: t_two_sided(t, n - 1.0)?,
        ci95: (mean - half, mean + half),
    })
}

#[cfg(test)]
mod tests;
