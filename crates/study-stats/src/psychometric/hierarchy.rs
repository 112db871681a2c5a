//! Partial pooling: the psychometric functions of several participants as draws from a
//! population, whose parameters are learned from all of them together.
//!
//! For participant i in condition c, the coordinate θ of the threshold and the logarithm ω of
//! the width are
//!
//! * θ = μ_c + b_i + e_ic with b_i ~ N(0, τ²) and e_ic ~ N(0, σ²): conditions are fixed effects,
//!   participants differ in their thresholds (τ) and in what a condition does to them (σ, with
//!   two conditions or more);
//! * ω ~ N(ν, κ²), for each participant and condition by itself;
//! * the lapse rate λ is shared by all; answers are binomial.
//!
//! [`Condition::coordinate`] says what θ and ω are. The posterior of the population's parameters
//! (μ, τ, σ, ν, κ, λ) is computed in two steps. *First* the functions of the participants are
//! integrated out by quadrature: the likelihood of each cell is tabulated over θ, ω and λ, written
//! as a sum of normal densities over θ and ω, and its integral over normal populations is then
//! a closed formula (`table`, `marginal`). *Then* the parameters that are left, five of one
//! condition and five plus their number of several, are drawn by importance sampling from t
//! distributions that are fitted to their posterior, along randomly shifted lattices
//! (`importance`). The result is a pure function of the data and of the random source.
//!
//! Both errors are known: [`Diagnostics`] has those of the draws, and a table that is twice
//! as fine shows that of the quadrature (tests).

mod importance;
mod marginal;
mod summary;
mod table;

use super::{Core, Experiment, Level, Support, WidthPrior, pooled};
use crate::random::RandomSource;
use thiserror::Error;

/// One condition: what was asked, and over which ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// Shape of its functions.
    pub core: Core,
    /// What an answer is. Yes–no, whose guess rate is each participant's own, is refused.
    pub experiment: Experiment,
    /// The ladder, at its places on the scale.
    pub support: Support,
    /// What is assumed of widths, which also says what the coordinate of a threshold is.
    pub width: WidthPrior,
}

/// The trials of one participant in one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Index of the participant, from 0 without gaps.
    pub participant: usize,
    /// Index of the condition.
    pub condition: usize,
    /// Counts by level, at its place on the scale; levels may repeat.
    pub levels: Vec<Level>,
}

/// The coordinate θ of thresholds and ω of widths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coordinate {
    /// θ = threshold/unit, ω = ln(width/unit). The unit is 1 over logarithms of levels, so that
    /// differences of θ are logarithms of ratios.
    Place(f64),
    /// θ = ln(threshold − origin), ω = ln(width/(threshold − origin)).
    FromOrigin(f64),
}

impl Coordinate {
    /// θ of a threshold at this place of the scale; `None` at or below the origin.
    pub fn of(self, place: f64) -> Option<f64> {
        match self {
            Self::Place(unit) => Some(place / unit),
            Self::FromOrigin(origin) => (place > origin).then(|| (place - origin).ln()),
        }
    }

    /// The place of θ on the scale.
    pub fn place(self, theta: f64) -> f64 {
        match self {
            Self::Place(unit) => theta * unit,
            Self::FromOrigin(origin) => origin + theta.exp(),
        }
    }

    /// (x − threshold)/width.
    fn argument(self, x: f64, theta: f64, omega: f64) -> f64 {
        match self {
            Self::Place(unit) => (x / unit - theta) / omega.exp(),
            Self::FromOrigin(origin) => ((x - origin) / theta.exp() - 1.0) / omega.exp(),
        }
    }
}

impl Condition {
    /// The coordinate of its thresholds; `unit` is that of a scale without ratios.
    pub fn coordinate(&self, unit: f64) -> Coordinate {
        match self.width {
            WidthPrior::Even => Coordinate::Place(unit),
            WidthPrior::OfRatios => Coordinate::Place(1.0),
            WidthPrior::FromOrigin(origin) => Coordinate::FromOrigin(origin),
        }
    }

    /// The ends of its ladder in the coordinate.
    fn ends(&self, unit: f64) -> (f64, f64) {
        let Support { low, high, least } = self.support;
        match self.coordinate(unit) {
            Coordinate::Place(unit) => (low / unit, high / unit),
            // A ladder may begin at the standard.
            Coordinate::FromOrigin(origin) => (
                (low - origin).max(least / 2.0).ln(),
                (high - origin).max(least).ln(),
            ),
        }
    }
}

/// What is assumed of the population. Each μ_c is even over the ladder of its condition and falls
/// as a raised cosine over half the ladder's length on both sides, in the coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PopulationPriors {
    /// τ is half-normal with this scale.
    pub between: f64,
    /// σ is half-normal with this scale.
    pub interaction: f64,
    /// ν is normal with this mean and standard deviation.
    pub width: (f64, f64),
    /// κ is half-normal with this scale.
    pub width_between: f64,
    /// λ is Beta(1, this).
    pub lapse: f64,
}

impl PopulationPriors {
    /// Those that belong to the prior of one participant's width. ν and κ together spread widths
    /// as widely as that prior does: √(0.5² + 0.4²) = 0.64 where that has 0.6, and √(0.6² + 0.4²) =
    /// 0.72 where it has 0.7. Without ratios the unit is the length of the ladder.
    pub fn of(width: WidthPrior) -> Self {
        let ratios = Self {
            between: 0.5,
            interaction: 0.3,
            width: (0.486_664, 0.5),
            width_between: 0.4,
            lapse: 30.0,
        };
        match width {
            WidthPrior::OfRatios => ratios,
            WidthPrior::FromOrigin(_) => Self {
                width: (0.530_628, 0.6),
                ..ratios
            },
            WidthPrior::Even => Self {
                between: 0.25,
                interaction: 0.15,
                width: (-std::f64::consts::LN_2, 0.8),
                ..ratios
            },
        }
    }
}

/// How finely the posterior is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Independent sets of draws, by whose differences the error is known; 4 or more.
    pub sets: usize,
    /// Draws in each.
    pub draws: usize,
    /// 1, or a larger number for proportionally finer tables.
    pub fineness: f64,
}

impl Effort {
    /// What an analysis uses: 8 × 512 draws, of a posterior that is far from normal up to four times as many.
    pub const ANALYSIS: Self = Self {
        sets: 8,
        draws: 512,
        fineness: 1.0,
    };
    /// For many simulated studies: 4 × 128 draws, whose error is a twentieth of a standard
    /// deviation.
    pub const SIMULATION: Self = Self {
        sets: 4,
        draws: 128,
        fineness: 1.0,
    };
}

/// The posterior of one number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Median.
    pub median: f64,
    /// From 2.5 % to 97.5 %.
    pub ci95: (f64, f64),
}

/// Parameters of a population, in the coordinate.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// μ of each condition.
    pub means: Vec<f64>,
    /// τ.
    pub between: f64,
    /// σ; 0 of one condition.
    pub interaction: f64,
    /// ν.
    pub width: f64,
    /// κ.
    pub width_between: f64,
    /// λ.
    pub lapse: f64,
}

/// The difference of two conditions, in the coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contrast {
    /// Index of the first condition.
    pub first: usize,
    /// Index of the second one.
    pub second: usize,
    /// μ of the first less μ of the second.
    pub difference: Estimate,
    /// Posterior probability that it is above 0.
    pub above: f64,
}

/// Whether the draws can be relied upon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diagnostics {
    /// Number of draws.
    pub draws: usize,
    /// Effective sample size: (Σw)²/Σw² of the importance weights (Kish 1965).
    pub effective: f64,
    /// k̂ of the generalized Pareto distribution of the largest weights (Vehtari, Simpson, Gelman,
    /// Yao & Gabry 2024): the larger, the longer the tail that the draws miss.
    pub pareto_k: f64,
    /// √(1 + variance of the means of the sets/posterior variance), the largest of all
    /// parameters and contrasts: as Gelman and Rubin's R̂ of chains.
    pub r_hat: f64,
    /// The largest standard error of a posterior mean, in posterior standard deviations, by the
    /// differences between the sets.
    pub error: f64,
    /// The largest posterior probability of a participant's threshold at the ends of the tables,
    /// which lie beyond the ladder by half its length or more, or far from all likelihoods.
    pub at_edge: f64,
}

impl Diagnostics {
    /// Why the model decides nothing; `None` if it has converged: k̂ up to .7, an effective size
    /// of 400 draws, or 40 % of fewer than 1000, R̂ up to 1.01 (1.05 of fewer), and hardly any
    /// probability beyond the ends of the tables.
    pub fn problem(&self) -> Option<Problem> {
        let few = self.draws < 1000;
        let least = if few { 0.25 * self.draws as f64 } else { 400.0 };
        let most = if few { 1.05 } else { 1.01 };
        // Written so that a number that is not one is a problem.
        let [weights, number, sets, edge] = [
            self.pareto_k <= 0.7,
            self.effective >= least,
            self.r_hat <= most,
            self.at_edge <= 0.01,
        ];
        match (weights, number, sets, edge) {
            (false, ..) => Some(Problem::HeavyWeights),
            (_, false, ..) => Some(Problem::FewEffective),
            (_, _, false, _) => Some(Problem::SetsDiffer),
            (.., false) => Some(Problem::AtEdge),
            _ => None,
        }
    }
}

/// Why draws cannot be relied upon.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Problem {
    /// k̂ is above .7.
    #[error("a few draws have most of the weight (Pareto k above .7)")]
    HeavyWeights,
    /// The effective sample size is too small.
    #[error("the effective number of draws is too small")]
    FewEffective,
    /// R̂ is too large.
    #[error("independent sets of draws differ (R-hat)")]
    SetsDiffer,
    /// The thresholds are not within reach of the ladder.
    #[error("the thresholds may lie beyond the ladder")]
    AtEdge,
}

/// Why there is no pooled model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum NoPooling {
    /// A population is learned from several.
    #[error("there are fewer than two participants")]
    OneParticipant,
    /// The guess rate is a parameter.
    #[error("the guess rate of yes–no answers is each participant's own")]
    YesNo,
    /// θ of one condition is not that of another.
    #[error("the scales of the conditions differ")]
    Scales,
    /// Counts, levels or ladders that cannot be.
    #[error("the counts or the ladders are not possible")]
    Invalid,
    /// The density has no maximum that was found.
    #[error("the posterior has no mode that was found")]
    NoMode,
}

/// The posterior of a population and of its participants, in the coordinate.
#[derive(Debug, Clone, PartialEq)]
pub struct Population {
    /// μ, the mean of each condition.
    pub conditions: Vec<Estimate>,
    /// All pairs of conditions, in their order.
    pub contrasts: Vec<Contrast>,
    /// τ, the standard deviation between participants.
    pub between: Estimate,
    /// σ, that of what a condition does to them; `None` of one condition.
    pub interaction: Option<Estimate>,
    /// ν, the mean of ω.
    pub width: Estimate,
    /// κ, its standard deviation.
    pub width_between: Estimate,
    /// λ.
    pub lapse: Estimate,
    /// θ of each cell, in the order of the cells.
    pub cells: Vec<Estimate>,
    /// Draws of the population's parameters with their weights, whose sum is 1.
    pub draws: Vec<(Parameters, f64)>,
    /// Whether the draws can be relied upon.
    pub diagnostics: Diagnostics,
    /// The unit of a coordinate without ratios.
    pub unit: f64,
}

/// Fits the pooled model. Conditions without cells are an error, as are cells without trials.
pub fn partial_pooling(
    conditions: &[Condition],
    cells: &[Cell],
    priors: &PopulationPriors,
    effort: Effort,
    random: &mut impl RandomSource,
) -> Result<Population, NoPooling> {
    let data = Data::new(conditions, cells)?;
    let tables = table::Tables::new(&data, priors, effort.fineness);
    let model = marginal::Model::new(&data, priors, tables);
    let draws = importance::draw(&model, effort, random).ok_or(NoPooling::NoMode)?;
    Ok(summary::population(&model, &draws, &data))
}

/// The data, checked, with levels added up.
struct Data {
    conditions: Vec<Condition>,
    cells: Vec<Cell>,
    participants: usize,
    unit: f64,
}

impl Data {
    fn new(conditions: &[Condition], cells: &[Cell]) -> Result<Self, NoPooling> {
        let yes_no = |c: &Condition| c.experiment == Experiment::YesNo;
        if conditions.iter().any(yes_no) {
            return Err(NoPooling::YesNo);
        }
        let kind = |c: &Condition| std::mem::discriminant(&c.width);
        if conditions.windows(2).any(|c| kind(&c[0]) != kind(&c[1])) {
            return Err(NoPooling::Scales);
        }
        let cells: Vec<Cell> = (cells.iter())
            .map(|cell| Cell {
                levels: pooled(&cell.levels),
                ..*cell
            })
            .collect();
        let good_level = |l: &Level| {
            let counts = l.positive >= 0.0 && l.positive <= l.trials && l.trials <= 1e5;
            counts && l.level.is_finite()
        };
        let good_cell = |c: &Cell| {
            let origin_is_below = match conditions.get(c.condition).map(|c| c.width) {
                Some(WidthPrior::FromOrigin(origin)) => c.levels.iter().all(|l| l.level >= origin),
                Some(_) => true,
                None => false,
            };
            origin_is_below && !c.levels.is_empty() && c.levels.iter().all(good_level)
        };
        let good_condition = |(i, c): (usize, &Condition)| {
            let guess = match c.experiment {
                Experiment::ForcedChoice(guess) => (0.0..1.0).contains(&guess),
                Experiment::YesNo | Experiment::Comparison => true,
            };
            let Support { low, high, least } = c.support;
            guess && high > low && least > 0.0 && cells.iter().any(|cell| cell.condition == i)
        };
        let participants = cells.iter().map(|c| c.participant + 1).max().unwrap_or(0);
        let has_cells = |i: usize| cells.iter().any(|c| c.participant == i);
        let mut places: Vec<_> = cells.iter().map(|c| (c.participant, c.condition)).collect();
        places.sort_unstable();
        if !cells.iter().all(good_cell)
            || !conditions.iter().enumerate().all(good_condition)
            || participants > cells.len()
            || !(0..participants).all(has_cells)
            || places.windows(2).any(|pair| pair[0] == pair[1])
        {
            return Err(NoPooling::Invalid);
        }
        if participants < 2 {
            return Err(NoPooling::OneParticipant);
        }
        let range = |c: &Condition| c.support.high - c.support.low;
        Ok(Self {
            conditions: conditions.to_vec(),
            participants,
            unit: conditions.iter().map(range).fold(0.0, f64::max),
            cells,
        })
    }
}

#[cfg(test)]
mod tests;
