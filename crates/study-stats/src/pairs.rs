//! Paired comparisons: Bradley–Terry with order effect and Davidson's ties, Thurstone's
//! Case V, circular triads.
//!
//! With abilities a that sum to zero, the order effect δ and the tie parameter ν, the
//! logarithmic weights of the outcomes are a_i + δ/2 (the first is preferred), a_j − δ/2
//! (the second) and ln ν + (a_i + a_j)/2 (a tie; Davidson 1970). Without ties this is
//! Bradley & Terry (1952), and the probability of the first is
//! 1/(1 + exp(−(a_i − a_j + δ))).

pub(crate) mod existence;

use super::clm::newton::{Evaluation, maximize};
use super::distribution::{normal_cdf, normal_density, normal_upper};
use super::matrix::{Cholesky, SymmetricMatrix, dot};
use thiserror::Error;

/// Answers to one pair in one order, of one participant or added up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// The item that was presented first.
    pub first: usize,
    /// The item that was presented second.
    pub second: usize,
    /// How often the first was preferred.
    pub first_preferred: f64,
    /// How often the second was preferred.
    pub second_preferred: f64,
    /// How often neither was.
    pub tied: f64,
    /// The participant.
    pub cluster: usize,
}

/// What a model has beside abilities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Model {
    /// How abilities become probabilities.
    pub link: Link,
    /// An effect of the order of presentation.
    pub order: bool,
}

/// How abilities become probabilities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Link {
    /// Bradley–Terry, in logits. Ties are left out.
    BradleyTerry,
    /// Davidson, in logits, with ties.
    Davidson,
    /// Thurstone's Case V, Φ(a_i − a_j + δ). Ties are left out.
    Thurstone,
}

/// Why abilities have no estimate.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NoAbilities {
    /// Fewer than two items, or an item with itself.
    #[error("there are not two items to compare")]
    NoPairs,
    /// Groups of items that nobody compared.
    #[error("no comparison joins these groups of items")]
    Disconnected(Vec<Vec<usize>>),
    /// A group that was never less preferred than an item outside it: Ford's (1957)
    /// condition fails.
    #[error("some items were preferred every time: their abilities are unbounded")]
    Unbounded(Vec<usize>),
    /// The order effect needs pairs that were presented in both orders.
    #[error("no pair was presented in both orders")]
    OneOrder,
    /// Nobody preferred anything.
    #[error("every comparison is a tie")]
    AllTied,
    /// Items were tied in every choice that allowed it, so that a parameter of ties is unbounded; only of rankings.
    #[error("items were tied whenever they could be: how readily they are is unbounded")]
    AlwaysTied,
    /// Sets of tied items that are too many to count; only of rankings.
    #[error("so many items can be tied in so many ways that the likelihood is not computed")]
    TooManySets,
    /// The search found no maximum.
    #[error("the likelihood has no maximum that was found")]
    NotFound,
}

/// An estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect {
    /// The estimate.
    pub estimate: f64,
    /// Standard error.
    pub se: f64,
    /// Two-sided p of no effect.
    pub p: f64,
}

impl Effect {
    fn new(estimate: f64, variance: f64) -> Self {
        let se = variance.max(0.0).sqrt();
        Self {
            estimate,
            se,
            p: 2.0 * normal_upper((estimate / se).abs()),
        }
    }
}

/// Estimated abilities.
#[derive(Debug, Clone)]
pub struct Abilities {
    /// Each ability; they sum to zero.
    pub abilities: Vec<f64>,
    /// Standard errors of abilities that sum to zero. They depend on that constraint;
    /// [`difference`](Self::difference) does not.
    pub ses: Vec<f64>,
    /// First minus second, if the model has it.
    pub order: Option<Effect>,
    /// ln ν, if the model has it and there are ties.
    pub tie: Option<Effect>,
    /// 2·(saturated − fitted), over the pairs in each order; of rankings over single choices.
    pub deviance: f64,
    /// Its degrees of freedom.
    pub df: usize,
    model: Model,
    /// Of each item: its ability as a linear function of the parameters.
    vectors: Vec<Vec<f64>>,
    covariance: Covariance,
    clustered: Option<SymmetricMatrix>,
    /// The information of each participant.
    information: Vec<SymmetricMatrix>,
}

#[derive(Debug, Clone)]
struct Covariance(SymmetricMatrix);

/// The difference of two abilities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// a − b with its model-based standard error, which takes all answers for
    /// independent.
    pub effect: Effect,
    /// The same with the sandwich over participants, V·(Σ s sᵀ)·V, without a factor for
    /// small samples. `None` with one participant.
    pub clustered: Option<Effect>,
    /// On how many participants the difference rests: (Σ h)²/Σ h² of their shares h of the information about
    /// it. Their number if all answered equally often.
    pub participants: f64,
    /// Probability that a is preferred to b, without order effect and without a tie.
    pub preferred: f64,
}

impl Abilities {
    /// The ability of item `a` minus that of `b`.
    pub fn difference(&self, a: usize, b: usize) -> Difference {
        let contrast = minus(&self.vectors[a], &self.vectors[b]);
        let estimate = self.abilities[a] - self.abilities[b];
        Difference {
            effect: Effect::new(estimate, quadratic(&self.covariance.0, &contrast)),
            clustered: (self.clustered.as_ref())
                .map(|v| Effect::new(estimate, quadratic(v, &contrast))),
            participants: self.participants(&contrast),
            preferred: match self.model.link {
                Link::Thurstone => normal_cdf(estimate),
                Link::BradleyTerry | Link::Davidson => 1.0 / (1.0 + (-estimate).exp()),
            },
        }
    }

    /// The standard error of an ability by the sandwich over participants; `None` with one
    /// participant.
    pub fn clustered_se(&self, item: usize) -> Option<f64> {
        let sandwich = self.clustered.as_ref()?;
        Some(quadratic(sandwich, &self.vectors[item]).max(0.0).sqrt())
    }

    /// On how many participants an ability rests, as [`Difference::participants`].
    pub fn participants_of(&self, item: usize) -> f64 {
        self.participants(&self.vectors[item])
    }

    /// The standard error of the order effect by the sandwich over participants; `None` without the effect, or with
    /// one participant.
    pub fn order_clustered_se(&self) -> Option<f64> {
        let sandwich = self.clustered.as_ref().filter(|_| self.model.order)?;
        let place = self.abilities.len() - 1;
        Some(sandwich.get(place, place).max(0.0).sqrt())
    }

    /// On how many participants the order effect rests, as [`Difference::participants`]; `None` without the effect.
    pub fn participants_of_order(&self) -> Option<f64> {
        let mut contrast = vec![0.0; self.covariance.0.size()];
        *contrast.get_mut(self.abilities.len() - 1)? = 1.0;
        self.model.order.then(|| self.participants(&contrast))
    }

    fn participants(&self, contrast: &[f64]) -> f64 {
        let v = &self.covariance.0;
        let along: Vec<f64> = (0..contrast.len())
            .map(|i| (0..contrast.len()).map(|j| v.get(i, j) * contrast[j]).sum())
            .collect();
        let shares = self
            .information
            .iter()
            .map(|own| quadratic(own, &along).max(0.0));
        let (sum, squares) =
            shares.fold((0.0, 0.0), |(sum, squares), h| (sum + h, squares + h * h));
        if squares > 0.0 {
            sum * sum / squares
        } else {
            0.0
        }
    }

    /// The rank of each item; 1 is the most preferred.
    pub fn ranks(&self) -> Vec<usize> {
        let above = |a: &f64| self.abilities.iter().filter(|b| *b > a).count();
        self.abilities.iter().map(|a| above(a) + 1).collect()
    }
}

/// Ability `i` as a linear function of the parameters: the last one is minus the sum.
fn ability(i: usize, items: usize, size: usize) -> Vec<f64> {
    let mut vector = vec![0.0; size];
    if i + 1 < items {
        vector[i] = 1.0;
    } else {
        vector[..items - 1].fill(-1.0);
    }
    vector
}

fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x - y).collect()
}

/// vᵀMv.
fn quadratic(m: &SymmetricMatrix, v: &[f64]) -> f64 {
    let n = v.len();
    (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .map(|(i, j)| v[i] * v[j] * m.get(i, j))
        .sum()
}

/// One row of data as outcomes: how often, and the weight as a function of the
/// parameters.
pub(crate) struct Row {
    pub(crate) cluster: usize,
    pub(crate) outcomes: Vec<(f64, Vec<f64>)>,
}

impl Row {
    fn trials(&self) -> f64 {
        self.outcomes.iter().map(|o| o.0).sum()
    }

    /// Probability of each outcome.
    pub(crate) fn probabilities(&self, link: Link, at: &[f64]) -> Vec<f64> {
        let weights: Vec<f64> = self.outcomes.iter().map(|o| dot(&o.1, at)).collect();
        if link == Link::Thurstone {
            let x = weights[0] - weights[1];
            return vec![normal_cdf(x), normal_cdf(-x)];
        }
        let top = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let powers: Vec<f64> = weights.iter().map(|w| (w - top).exp()).collect();
        let sum: f64 = powers.iter().sum();
        powers.iter().map(|p| p / sum).collect()
    }

    /// Adds value, gradient and Hessian of the log-likelihood.
    fn add(&self, link: Link, at: &[f64], to: &mut Evaluation) {
        let probabilities = self.probabilities(link, at);
        for ((count, _), p) in self.outcomes.iter().zip(&probabilities) {
            if *count > 0.0 {
                to.value += count * p.ln();
            }
        }
        if link == Link::Thurstone {
            let contrast = minus(&self.outcomes[0].1, &self.outcomes[1].1);
            let x = dot(&contrast, at);
            let (a, b) = (mills(x), mills(-x));
            let (first, second) = (self.outcomes[0].0, self.outcomes[1].0);
            let slope = first * a - second * b;
            let curve = -first * a * (a + x) - second * b * (b - x);
            for (g, c) in to.gradient.iter_mut().zip(&contrast) {
                *g += slope * c;
            }
            to.hessian.add_outer(curve, &contrast);
            return;
        }
        let n = self.trials();
        let mut mean = vec![0.0; at.len()];
        for ((count, vector), p) in self.outcomes.iter().zip(&probabilities) {
            for ((g, m), v) in to.gradient.iter_mut().zip(&mut mean).zip(vector) {
                *g += (count - n * p) * v;
                *m += p * v;
            }
            to.hessian.add_outer(-n * p, vector);
        }
        to.hessian.add_outer(n, &mean);
    }
}

/// φ(x)/Φ(x).
fn mills(x: f64) -> f64 {
    // Beyond this Φ underflows, and the ratio is −x.
    if x < -37.0 {
        return -x;
    }
    normal_density(x) / normal_cdf(x)
}

/// Maximum-likelihood abilities of items 0 … `items` − 1, with standard errors from the
/// observed information.
pub fn abilities(
    items: usize,
    comparisons: &[Comparison],
    model: Model,
) -> Result<Abilities, NoAbilities> {
    let ties = model.link == Link::Davidson;
    let sum = |f: fn(&Comparison) -> f64| comparisons.iter().map(f).sum::<f64>();
    let with_ties = ties && sum(|c| c.tied) > 0.0;
    existence::check(items, comparisons, with_ties, model.order)?;
    if with_ties && sum(|c| c.first_preferred + c.second_preferred) == 0.0 {
        return Err(NoAbilities::AllTied);
    }
    let order_place = items - 1;
    let tie_place = order_place + usize::from(model.order);
    let size = tie_place + usize::from(with_ties);
    let rows: Vec<Row> = (comparisons.iter())
        .map(|c| {
            let mut first = ability(c.first, items, size);
            let mut second = ability(c.second, items, size);
            let mut tied: Vec<f64> = (first.iter().zip(&second))
                .map(|(a, b)| 0.5 * (a + b))
                .collect();
            if model.order {
                first[order_place] = 0.5;
                second[order_place] = -0.5;
            }
            let mut outcomes = vec![(c.first_preferred, first), (c.second_preferred, second)];
            if with_ties {
                tied[tie_place] = 1.0;
                outcomes.push((c.tied, tied));
            }
            Row {
                cluster: c.cluster,
                outcomes,
            }
        })
        .collect();
    let of_pairs = |at: &[f64]| {
        let (deviance, cells) = deviance(&rows, comparisons, model.link, at);
        (deviance, cells * (1 + usize::from(with_ties)))
    };
    let space = Space {
        vectors: (0..items).map(|i| ability(i, items, size)).collect(),
        abilities: items - 1,
        size,
    };
    Ok(fitted(space, &rows, model, of_pairs)?.abilities)
}

/// How parameters become abilities.
pub(crate) struct Space {
    /// Of each item: its ability as a linear function of the parameters.
    pub(crate) vectors: Vec<Vec<f64>>,
    /// Number of parameters of abilities, which are the first ones. The order effect follows, if the model has it, and then
    /// those of ties.
    pub(crate) abilities: usize,
    /// Number of all parameters.
    pub(crate) size: usize,
}

/// What maximizes a likelihood.
pub(crate) struct Fitted {
    pub(crate) abilities: Abilities,
    /// The parameters after the abilities and the order effect.
    pub(crate) ties: Vec<Effect>,
    pub(crate) log_likelihood: f64,
}

/// The maximum of the likelihood of rows. `deviance` gives that of the rows at the parameters, and the number of free
/// outcomes.
pub(crate) fn fitted(
    space: Space,
    rows: &[Row],
    model: Model,
    deviance: impl FnOnce(&[f64]) -> (f64, usize),
) -> Result<Fitted, NoAbilities> {
    let Space { vectors, size, .. } = space;
    let order_place = space.abilities;
    let tie_place = order_place + usize::from(model.order);
    let evaluate = |at: &[f64]| {
        let mut sum = Evaluation::zero(size);
        for row in rows {
            row.add(model.link, at, &mut sum);
        }
        sum.value.is_finite().then_some(sum)
    };
    let found = maximize(vec![0.0; size], evaluate).ok_or(NoAbilities::NotFound)?;
    // The likelihood still rises where an effect is practically infinite.
    if found.at.iter().any(|x| x.abs() > 20.0) {
        return Err(NoAbilities::NotFound);
    }
    let factor = Cholesky::definite(&found.information).ok_or(NoAbilities::NotFound)?;
    let covariance = inverse(&factor, size);
    let effect = |place: usize| Effect::new(found.at[place], covariance.get(place, place));
    let (deviance, free) = deviance(&found.at);
    let clusters = by_cluster(rows, model.link, &found.at);
    let ties: Vec<Effect> = (tie_place..size).map(effect).collect();
    let abilities = Abilities {
        abilities: vectors.iter().map(|v| dot(v, &found.at)).collect(),
        ses: (vectors.iter())
            .map(|v| quadratic(&covariance, v).sqrt())
            .collect(),
        order: model.order.then(|| effect(order_place)),
        tie: ties.first().copied(),
        deviance,
        df: free.saturating_sub(size),
        model,
        clustered: sandwich(&clusters, &factor),
        information: (clusters.iter()).map(|own| own.hessian.negated()).collect(),
        covariance: Covariance(covariance),
        vectors,
    };
    Ok(Fitted {
        abilities,
        ties,
        log_likelihood: found.value,
    })
}

fn inverse(factor: &Cholesky, size: usize) -> SymmetricMatrix {
    let mut inverse = SymmetricMatrix::zero(size);
    for i in 0..size {
        let mut unit = vec![0.0; size];
        unit[i] = 1.0;
        let column = factor.solve(&unit);
        for (j, value) in column.iter().enumerate().take(i + 1) {
            inverse.add(i, j, *value);
        }
    }
    inverse
}

/// The derivatives of the likelihood of each cluster.
fn by_cluster(rows: &[Row], link: Link, at: &[f64]) -> Vec<Evaluation> {
    let clusters = rows.iter().map(|r| r.cluster + 1).max().unwrap_or(0);
    let mut all = vec![Evaluation::zero(at.len()); clusters];
    for row in rows {
        row.add(link, at, &mut all[row.cluster]);
    }
    all
}

/// V·(Σ s sᵀ)·V over the clusters; `None` with one.
fn sandwich(clusters: &[Evaluation], factor: &Cholesky) -> Option<SymmetricMatrix> {
    let mut sandwich = SymmetricMatrix::zero(clusters.first()?.gradient.len());
    for own in clusters {
        sandwich.add_outer(1.0, &factor.solve(&own.gradient));
    }
    (clusters.len() > 1).then_some(sandwich)
}

/// The deviance of the pairs in each order, added up, and their number.
fn deviance(rows: &[Row], comparisons: &[Comparison], link: Link, at: &[f64]) -> (f64, usize) {
    struct Cell {
        pair: (usize, usize),
        counts: Vec<f64>,
        probabilities: Vec<f64>,
    }
    let mut cells: Vec<Cell> = Vec::new();
    for (row, c) in rows.iter().zip(comparisons) {
        if row.trials() <= 0.0 {
            continue;
        }
        let counts = row.outcomes.iter().map(|o| o.0);
        let pair = (c.first, c.second);
        match cells.iter_mut().find(|cell| cell.pair == pair) {
            Some(cell) => cell
                .counts
                .iter_mut()
                .zip(counts)
                .for_each(|(sum, k)| *sum += k),
            None => cells.push(Cell {
                pair,
                counts: counts.collect(),
                probabilities: row.probabilities(link, at),
            }),
        }
    }
    let term = |counts: &[f64], probabilities: &[f64]| -> f64 {
        let n: f64 = counts.iter().sum();
        (counts.iter().zip(probabilities))
            .filter(|(k, _)| **k > 0.0)
            .map(|(k, p)| 2.0 * k * (k / (n * p)).ln())
            .sum()
    };
    (
        cells
            .iter()
            .map(|c| term(&c.counts, &c.probabilities))
            .sum(),
        cells.len(),
    )
}

/// How consistent one complete round of comparisons is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triads {
    /// Triples in which a is preferred to b, b to c and c to a.
    pub circular: f64,
    /// 1 without any, 0 with as many as there can be (Kendall & Babington Smith 1940).
    pub consistency: f64,
}

/// The circular triads of one round: each pair once, as (preferred, other).
/// d = T(T − 1)(2T − 1)/12 − ½Σw². `None` with fewer than three items, or unless each
/// pair occurs once.
///
/// ```
/// # use study_stats::pairs::circular_triads;
/// // a over b, b over c, c over a.
/// let found = circular_triads(3, &[(0, 1), (1, 2), (2, 0)]).unwrap();
/// assert_eq!((found.circular, found.consistency), (1.0, 0.0));
/// ```
pub fn circular_triads(items: usize, preferred: &[(usize, usize)]) -> Option<Triads> {
    let mut seen = vec![false; items * items];
    let mut wins = vec![0.0; items];
    for (winner, loser) in preferred {
        let (low, high) = (*winner.min(loser), *winner.max(loser));
        if low == high || high >= items || std::mem::replace(&mut seen[low * items + high], true) {
            return None;
        }
        wins[*winner] += 1.0;
    }
    if items < 3 || preferred.len() != items * (items - 1) / 2 {
        return None;
    }
    let t = items as f64;
    let squares: f64 = wins.iter().map(|w| w * w).sum();
    let circular = t * (t - 1.0) * (2.0 * t - 1.0) / 12.0 - squares / 2.0;
    let most = match items % 2 {
        1 => (t * t * t - t) / 24.0,
        _ => (t * t * t - 4.0 * t) / 24.0,
    };
    Some(Triads {
        circular,
        consistency: 1.0 - circular / most,
    })
}

#[cfg(test)]
mod tests;
