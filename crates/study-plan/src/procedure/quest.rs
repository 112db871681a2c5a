//! QUEST+ (Watson 2017, Journal of Vision 17(3):10): the stimulus whose answer is
//! expected to leave the least entropy over a grid of parameters.
//!
//! Psi (Kontsevich & Tyler 1999) is the same with a cumulative normal and the posterior
//! mean as its estimate: [`QuestPlus::psi`].

mod formula;
mod function;

pub use function::Function;

use super::{Ladder, ProcedureError, Summary, filled};
use serde::{Deserialize, Serialize};
use study_stats::distribution::normal_cdf;

/// The most cells of a table, stimuli times combinations of parameters. Two tables of
/// this size have 160 MB.
pub const MAX_CELLS: usize = 10_000_000;
/// Expected entropies that differ by less than this, or this part of the least one, are
/// tied.
const TIE: f64 = 1e-12;
/// The function is kept within [`LEAST`, 1 − `LEAST`]: an answer may be improbable, not
/// impossible.
const LEAST: f64 = 1e-14;

/// A parameter of the psychometric function, with its grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Its name in the function.
    pub name: String,
    /// The grid.
    pub values: Vec<f64>,
    /// A weight for each value; equal without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<Vec<f64>>,
}

impl Parameter {
    /// A parameter with equal weights.
    pub fn new(name: &str, values: Vec<f64>) -> Self {
        Self {
            name: name.to_owned(),
            values,
            prior: None,
        }
    }
}

/// The rule of a QUEST+ track.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuestPlus {
    /// The psychometric function: the probability of a positive answer.
    pub function: Function,
    /// Its parameters; the prior is the product of theirs. The first is the one that is
    /// estimated.
    pub parameters: Vec<Parameter>,
    /// Number of trials, or the most.
    pub trials: u32,
    /// The fewest, where `entropy_below` or `sd_below` may stop the track.
    #[serde(default)]
    pub min_trials: u32,
    /// Stops when the entropy of the posterior, in nats, is below this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub entropy_below: Option<f64>,
    /// Stops when the posterior standard deviation of the first parameter is below this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd_below: Option<f64>,
}

impl QuestPlus {
    /// A fixed number of trials.
    pub fn new(function: Function, parameters: Vec<Parameter>, trials: u32) -> Self {
        Self {
            function,
            parameters,
            trials,
            min_trials: 0,
            entropy_below: None,
            sd_below: None,
        }
    }

    /// Psi: a cumulative normal with a grid of means and standard deviations, and fixed
    /// guess and lapse rates. Its own lapse δ, of a curve times (1 − δ) plus δ/2, is
    /// twice the lapse rate here.
    pub fn psi(mean: Vec<f64>, sd: Vec<f64>, gamma: f64, lambda: f64, trials: u32) -> Self {
        let parameters = vec![
            Parameter::new("mean", mean),
            Parameter::new("sd", sd),
            Parameter::new("gamma", vec![gamma]),
            Parameter::new("lambda", vec![lambda]),
        ];
        Self::new(Function::Normal, parameters, trials)
    }
}

/// The posterior of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Marginal {
    /// Name of the parameter in files.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// Its value at the mode of the joint posterior.
    pub mode: f64,
    /// Mode of its own posterior.
    pub marginal_mode: f64,
    /// Probability of the two end points of its grid together. Above 0.01 the grid is
    /// too small.
    pub at_edge: f64,
}

/// A QUEST+ in progress.
#[derive(Debug, Clone)]
pub struct Progress {
    rule: QuestPlus,
    function: formula::Formula,
    /// Every combination of stimulus dimensions; the first dimension changes slowest.
    points: Vec<Vec<f64>>,
    cells: Vec<Vec<f64>>,
    /// Probability of a positive answer, cell by cell, all stimuli of a cell together.
    positive: Vec<f64>,
    /// Entropy of the answer, in the same order.
    uncertainty: Vec<f64>,
    posterior: Vec<f64>,
    trials: u32,
    /// The next stimulus and its expected entropy.
    best: (usize, f64),
}

impl Progress {
    /// A track on one dimension, which the function calls `intensity`.
    pub fn on_ladder(rule: &QuestPlus, ladder: &Ladder) -> Result<Self, ProcedureError> {
        let levels = ladder.levels().to_vec();
        Self::new(rule, &[("intensity".to_owned(), levels)])
    }

    /// A track on any number of named dimensions.
    pub fn new(
        rule: &QuestPlus,
        dimensions: &[(String, Vec<f64>)],
    ) -> Result<Self, ProcedureError> {
        check(rule, dimensions)?;
        let names = (dimensions.iter().map(|d| d.0.as_str()))
            .chain(rule.parameters.iter().map(|p| p.name.as_str()))
            .collect::<Vec<_>>();
        let function = rule.function.formula(&names)?;
        let size = |lists: &mut dyn Iterator<Item = usize>| {
            lists.fold(1usize, |product, n| product.saturating_mul(n))
        };
        let stimuli = size(&mut dimensions.iter().map(|d| d.1.len()));
        let cells = size(&mut rule.parameters.iter().map(|p| p.values.len()));
        if stimuli.saturating_mul(cells) > MAX_CELLS {
            return Err(ProcedureError::TooLarge {
                stimuli,
                cells,
                limit: MAX_CELLS,
            });
        }
        let points = product(dimensions.iter().map(|d| d.1.as_slice()));
        let cells = product(rule.parameters.iter().map(|p| p.values.as_slice()));
        let mut positive = Vec::with_capacity(points.len() * cells.len());
        for cell in &cells {
            for point in &points {
                positive.push(probability(&function, point, cell)?);
            }
        }
        let uncertainty = positive.iter().map(|p| binary_entropy(*p)).collect();
        let mut progress = Self {
            rule: rule.clone(),
            function,
            points,
            cells,
            positive,
            uncertainty,
            posterior: prior(&rule.parameters),
            trials: 0,
            best: (0, 0.0),
        };
        progress.best = progress.least_expected_entropy();
        Ok(progress)
    }

    /// The next stimulus, one number for each dimension; `None` when the track has
    /// ended.
    pub fn next(&self) -> Option<&[f64]> {
        let ended = self.trials >= self.rule.trials || self.is_precise();
        (!ended).then(|| self.points[self.best.0].as_slice())
    }

    /// The expected entropy of the next stimulus, in nats.
    pub fn expected_entropy(&self) -> f64 {
        self.best.1
    }

    /// The entropy of the posterior, in nats.
    pub fn entropy(&self) -> f64 {
        -(self.posterior.iter().map(|p| x_ln_x(*p)).sum::<f64>())
    }

    /// One trial, at the stimulus that was presented.
    pub fn answer(&mut self, presented: &[f64], positive: bool) {
        self.trials += 1;
        self.learn(presented, positive);
    }

    /// An answer that does not count as a trial.
    pub fn learn(&mut self, presented: &[f64], positive: bool) {
        let stimuli = self.points.len();
        let known = self.points.iter().position(|p| p == presented);
        for (i, posterior) in self.posterior.iter_mut().enumerate() {
            let p = match known {
                Some(point) => self.positive[i * stimuli + point],
                // A point beside the grid: presented by another rule.
                None => probability(&self.function, presented, &self.cells[i]).unwrap_or(0.5),
            };
            *posterior *= if positive { p } else { 1.0 - p };
        }
        normalize(&mut self.posterior);
        self.best = self.least_expected_entropy();
    }

    /// The first stimulus, in order, with the least expected entropy. With H the entropy
    /// of the posterior, h that of an answer, and the posterior's weights p(θ), the
    /// expectation is H + Σ p(θ) h(P(s, θ)) − h(Σ p(θ) P(s, θ)).
    fn least_expected_entropy(&self) -> (usize, f64) {
        let stimuli = self.points.len();
        let mut predicted = vec![0.0; stimuli];
        let mut noise = vec![0.0; stimuli];
        let rows = self.positive.chunks_exact(stimuli);
        let rows = rows.zip(self.uncertainty.chunks_exact(stimuli));
        // Each stimulus has its own sum, in the order of the cells.
        for (weight, (positive, uncertainty)) in self.posterior.iter().zip(rows) {
            for (sum, p) in predicted.iter_mut().zip(positive) {
                *sum += weight * p;
            }
            for (sum, h) in noise.iter_mut().zip(uncertainty) {
                *sum += weight * h;
            }
        }
        let entropy = self.entropy();
        let expected: Vec<f64> = (predicted.iter().zip(&noise))
            .map(|(p, noise)| entropy + noise - binary_entropy(p.clamp(0.0, 1.0)))
            .collect();
        let least = expected.iter().copied().fold(f64::INFINITY, f64::min);
        let bound = least + TIE * least.abs().max(1.0);
        let first = expected.iter().position(|e| *e <= bound).unwrap_or(0);
        (first, expected[first])
    }

    fn is_precise(&self) -> bool {
        let below =
            |bound: Option<f64>, value: &dyn Fn() -> f64| bound.is_some_and(|b| value() < b);
        self.trials >= self.rule.min_trials
            && (below(self.rule.entropy_below, &|| self.entropy())
                || below(self.rule.sd_below, &|| self.marginal(0).sd))
    }

    /// The posterior of parameter `i`, in the order of the rule.
    fn marginal(&self, i: usize) -> Marginal {
        let parameter = &self.rule.parameters[i];
        let inner: usize = (self.rule.parameters[i + 1..].iter())
            .map(|p| p.values.len())
            .product();
        let mut weights = vec![0.0; parameter.values.len()];
        for (cell, weight) in self.posterior.iter().enumerate() {
            weights[cell / inner % parameter.values.len()] += weight;
        }
        let values = || weights.iter().zip(&parameter.values);
        let mean: f64 = values().map(|(w, v)| w * v).sum();
        let variance: f64 = values().map(|(w, v)| w * (v - mean) * (v - mean)).sum();
        let last = weights.len() - 1;
        Marginal {
            name: parameter.name.clone(),
            mean,
            sd: variance.sqrt(),
            mode: self.cells[first_largest(&self.posterior)][i],
            marginal_mode: parameter.values[first_largest(&weights)],
            at_edge: if last == 0 {
                1.0
            } else {
                weights[0] + weights[last]
            },
        }
    }

    /// How far the track is.
    pub fn summary(&self) -> Summary {
        let posterior: Vec<Marginal> = (0..self.rule.parameters.len())
            .filter(|i| self.rule.parameters[*i].values.len() > 1)
            .map(|i| self.marginal(i))
            .collect();
        let ended = self.next().is_none();
        let by_precision = self.rule.entropy_below.is_some() || self.rule.sd_below.is_some();
        let first = self.marginal(0);
        Summary {
            trials: self.trials,
            ended,
            finished: ended && (self.is_precise() || !by_precision),
            estimate: (self.trials > 0).then_some(first.mean),
            spread: (self.trials > 0).then_some(first.sd),
            posterior,
            ..Summary::default()
        }
    }
}

fn check(rule: &QuestPlus, dimensions: &[(String, Vec<f64>)]) -> Result<(), ProcedureError> {
    filled("the stimulus", dimensions)?;
    filled("parameters", &rule.parameters)?;
    super::above_0("trials", f64::from(rule.trials))?;
    let grids = (dimensions.iter().map(|d| (&d.0, &d.1)))
        .chain(rule.parameters.iter().map(|p| (&p.name, &p.values)));
    for (name, values) in grids {
        filled(name, values)?;
        if let Some(value) = values.iter().copied().find(|v| !v.is_finite()) {
            return Err(ProcedureError::Range {
                what: name.clone(),
                value,
                range: "finite",
            });
        }
    }
    for parameter in &rule.parameters {
        let Some(weights) = &parameter.prior else {
            continue;
        };
        let good = |w: &f64| *w >= 0.0 && w.is_finite();
        if weights.len() != parameter.values.len() {
            return Err(ProcedureError::Prior {
                name: parameter.name.clone(),
                weights: weights.len(),
                values: parameter.values.len(),
            });
        }
        let bad = weights.iter().copied().find(|w| !good(w));
        let sum: f64 = weights.iter().sum();
        if bad.is_some() || sum <= 0.0 || !sum.is_finite() {
            return Err(ProcedureError::Range {
                what: format!("a weight of the prior of {}", parameter.name),
                value: bad.unwrap_or(sum),
                range: "0 or more, and not all 0",
            });
        }
    }
    Ok(())
}

/// All combinations; the first list changes slowest.
fn product<'a>(lists: impl Iterator<Item = &'a [f64]>) -> Vec<Vec<f64>> {
    lists.fold(vec![Vec::new()], |points, list| {
        (points.iter())
            .flat_map(|point| {
                list.iter().map(move |value| {
                    let mut longer = point.clone();
                    longer.push(*value);
                    longer
                })
            })
            .collect()
    })
}

/// The product of the weights, with the sum 1.
fn prior(parameters: &[Parameter]) -> Vec<f64> {
    let equal = |p: &Parameter| vec![1.0; p.values.len()];
    let weights: Vec<Vec<f64>> = (parameters.iter())
        .map(|p| p.prior.clone().unwrap_or_else(|| equal(p)))
        .collect();
    let mut prior: Vec<f64> = product(weights.iter().map(Vec::as_slice))
        .iter()
        .map(|cell| cell.iter().product())
        .collect();
    normalize(&mut prior);
    prior
}

fn normalize(weights: &mut [f64]) {
    let sum: f64 = weights.iter().sum();
    for weight in weights {
        *weight /= sum;
    }
}

fn probability(
    function: &formula::Formula,
    point: &[f64],
    cell: &[f64],
) -> Result<f64, ProcedureError> {
    let value = function.value(point, cell);
    // Rounding may leave [0, 1] by a little.
    if !(value > -1e-9 && value < 1.0 + 1e-9) {
        return Err(ProcedureError::NoProbability {
            value,
            at: format!("{point:?} with the parameters {cell:?}"),
        });
    }
    Ok(value.clamp(LEAST, 1.0 - LEAST))
}

/// x ln x, 0 at 0.
fn x_ln_x(x: f64) -> f64 {
    if x > 0.0 { x * libm::log(x) } else { 0.0 }
}

fn binary_entropy(p: f64) -> f64 {
    -(x_ln_x(p) + x_ln_x(1.0 - p))
}

fn first_largest(values: &[f64]) -> usize {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    values.iter().position(|v| *v == largest).unwrap_or(0)
}
