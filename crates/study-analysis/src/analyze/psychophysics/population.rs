//! Thresholds of several participants learned together: `psy_population/…`.

use crate::analyze::draws::Draws;
use crate::analyze::keys::{CellName, ConditionName};
use crate::analyze::record::{Interval, PairName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::psychometric::hierarchy::{
    Cell, Condition, Coordinate, Diagnostics, Effort, Estimate, NoPooling, Population,
    PopulationPriors, partial_pooling,
};
use study_stats::psychometric::{Core, Experiment, Level, Priors, Spacing, Support, WidthPrior};

statistics! {
    /// A number in the pooled model.
    pub struct Pooled {
        /// posterior median
        median: Stat,
        /// equal-tailed
        ci95: Interval,
    }

    /// Whether the draws of the pooled model can be relied upon. If not, all else is undefined.
    pub struct Convergence {
        /// 1 if all of the following are good enough
        converged: Stat,
        /// number of draws
        n_draws: Stat,
        /// effective sample size by the importance weights, (Σw)²/Σw²; 400 or more
        effective_draws: Stat,
        /// shape of the distribution of the largest weights (Vehtari et al. 2024); .7 or less
        pareto_k: Stat,
        /// √(1 + variance of the means of independent sets of draws/posterior variance), the largest of all parameters; 1.01 or less
        r_hat: Stat,
        /// the largest standard error of a posterior mean in posterior standard deviations
        error: Stat,
        /// the largest probability of a threshold at the ends of the tables; .01 or less
        at_edge: Stat,
    }

    /// Two conditions in the pooled model.
    pub struct PooledContrast {
        /// ratio of the thresholds; where levels lie above a standard, of their distances from it
        ratio: Option<Pooled>,
        /// difference of the thresholds, where levels have no ratios
        difference: Option<Pooled>,
        /// posterior probability that the threshold of the first is larger
        first_larger: Stat,
    }

    /// The pooled model: thresholds and widths of participants are draws from a population, the share of lapses is everybody's (partial pooling).
    pub struct PopulationModel {
        /// of the draws
        convergence: Convergence as "",
        /// number of participants
        n_participants: Stat,
        /// the threshold of the population
        threshold: BTreeMap<ConditionName, Pooled>,
        /// two conditions
        contrasts: BTreeMap<PairName, PooledContrast> as "",
        /// the threshold of a participant, drawn towards that of the population
        participant: BTreeMap<CellName, Pooled>,
        /// standard deviation of participants, of natural logarithms where levels have ratios
        sd_participant: Pooled,
        /// standard deviation of what a condition does to a participant
        sd_interaction: Option<Pooled>,
        /// the width of the typical participant, on the scale; above a standard, in distances of the threshold from it
        width: Pooled,
        /// standard deviation of the natural logarithms of the participants' widths
        sd_width: Pooled,
        /// the share of lapses
        lambda: Pooled,
    }
}

impl PopulationModel {
    /// Whether its numbers can be relied upon.
    pub fn has_converged(&self) -> bool {
        self.convergence.converged.is_set()
    }
}

/// The trials of one participant in one condition.
pub(super) struct PopulationCell {
    pub(super) name: CellName,
    /// Counts by level; levels may repeat.
    pub(super) levels: Vec<Level>,
}

/// How the functions of a condition are fitted.
pub(super) struct ConditionFit {
    pub(super) core: Core,
    pub(super) spacing: Spacing,
    pub(super) experiment: Experiment,
    pub(super) priors: Priors,
}

/// The pooled model of these cells; `settings` are those of each condition. Its draws follow from the seed
/// and the name of the part. Nothing with fewer than two participants, or where the guess rate is each
/// participant's own (yes–no).
pub(super) fn population(
    cells: &[PopulationCell],
    settings: &BTreeMap<String, ConditionFit>,
    (seed, part): (u64, &str),
    effort: Effort,
) -> Option<PopulationModel> {
    let names: Vec<&str> = (settings.keys().map(String::as_str))
        .filter(|c| cells.iter().any(|cell| cell.name.condition.as_str() == *c))
        .collect();
    let mut people: Vec<&str> = cells.iter().map(|c| c.name.participant.as_str()).collect();
    people.sort_unstable();
    people.dedup();
    let condition_of = |name: &&str| {
        let own = || cells.iter().filter(|c| c.name.condition.as_str() == *name);
        let ConditionFit {
            core,
            spacing,
            experiment,
            priors,
        } = settings[*name];
        let places = own()
            .flat_map(|c| spacing.places(&c.levels))
            .map(|l| l.level);
        Some(Condition {
            core,
            experiment,
            support: priors.support.or_else(|| Support::of(places))?,
            width: priors.width,
        })
    };
    let conditions: Vec<Condition> = names.iter().map(condition_of).collect::<Option<_>>()?;
    let first = settings.get(*names.first()?)?;
    let of_cell = |cell: &PopulationCell| {
        let condition = names.binary_search(&cell.name.condition.as_str()).ok()?;
        let spacing = settings[names[condition]].spacing;
        Some(Cell {
            participant: people.binary_search(&cell.name.participant.as_str()).ok()?,
            condition,
            levels: spacing.places(&cell.levels),
        })
    };
    let placed: Vec<Cell> = cells.iter().map(of_cell).collect::<Option<_>>()?;
    let priors = PopulationPriors {
        lapse: first.priors.lapse,
        ..PopulationPriors::of(first.priors.width)
    };
    let mut draws = Draws::new(seed, &format!("population/{part}"));
    let spacings: Vec<Spacing> = names.iter().map(|c| settings[*c].spacing).collect();
    let found = match spacings.windows(2).all(|s| s[0] == s[1]) {
        true => partial_pooling(&conditions, &placed, &priors, effort, &mut draws),
        false => Err(NoPooling::Scales),
    };
    let n_participants = Stat::count(people.len());
    match found {
        Err(NoPooling::OneParticipant | NoPooling::YesNo) => None,
        Err(why) => Some(PopulationModel {
            n_participants,
            ..PopulationModel::undefined(why.to_string())
        }),
        Ok(found) => {
            let scale = Scale {
                found: &found,
                spacing: first.spacing,
                conditions: &conditions,
            };
            let names_of_cells = cells.iter().map(|c| &c.name);
            Some(PopulationModel {
                n_participants,
                ..scale.model(&names, names_of_cells, &placed)
            })
        }
    }
}

/// The scale on which a population is reported.
struct Scale<'a> {
    found: &'a Population,
    spacing: Spacing,
    conditions: &'a [Condition],
}

impl Scale<'_> {
    fn model<'a>(
        &self,
        names: &[&str],
        cells: impl Iterator<Item = &'a CellName>,
        placed: &[Cell],
    ) -> PopulationModel {
        let found = self.found;
        let name = |c: usize| ConditionName::from(names[c]);
        let thresholds = found.conditions.iter().enumerate();
        let has_ratios = self.conditions.iter().all(|c| c.width != WidthPrior::Even);
        let contrasts = found.contrasts.iter().map(|c| {
            let ratio = has_ratios.then(|| self.number(&c.difference, libm::exp));
            let unit = found.unit;
            let difference = (!has_ratios).then(|| self.number(&c.difference, |x| x * unit));
            let contrast = PooledContrast {
                ratio,
                difference,
                first_larger: self.stat(c.above),
            };
            (PairName::of(names[c.first], names[c.second]), contrast)
        });
        let participants = cells.zip(placed).zip(&found.cells);
        let of_deviation = |e: &Estimate| match has_ratios {
            true => self.number(e, |x| x),
            false => self.number(e, |x| x * found.unit),
        };
        let of_width = |e: &Estimate| match has_ratios {
            true => self.number(e, libm::exp),
            false => self.number(e, |x| libm::exp(x) * found.unit),
        };
        PopulationModel {
            convergence: self.convergence(),
            n_participants: Stat::missing(""),
            threshold: thresholds
                .map(|(c, e)| (name(c), self.threshold(c, e)))
                .collect(),
            contrasts: contrasts.collect(),
            participant: participants
                .map(|((cell, placed), e)| (cell.clone(), self.threshold(placed.condition, e)))
                .collect(),
            sd_participant: of_deviation(&found.between),
            sd_interaction: found.interaction.as_ref().map(of_deviation),
            width: of_width(&found.width),
            sd_width: self.number(&found.width_between, |x| x),
            lambda: self.number(&found.lapse, |x| x),
        }
    }

    fn threshold(&self, condition: usize, e: &Estimate) -> Pooled {
        let coordinate: Coordinate = self.conditions[condition].coordinate(self.found.unit);
        self.number(e, |theta| self.spacing.level(coordinate.place(theta)))
    }

    /// A number and its interval, after a function that rises.
    fn number(&self, e: &Estimate, to: impl Fn(f64) -> f64) -> Pooled {
        let why = self.why();
        let shown = why.is_none();
        let why = why.unwrap_or_default();
        Pooled {
            median: Stat::or(shown.then(|| to(e.median)), why.clone()),
            ci95: Interval::or(shown.then(|| (to(e.ci95.0), to(e.ci95.1))), why),
        }
    }

    fn stat(&self, x: f64) -> Stat {
        match self.why() {
            None => Stat::of(x),
            Some(why) => Stat::missing(why),
        }
    }

    /// Why its numbers are undefined.
    fn why(&self) -> Option<String> {
        let problem = self.found.diagnostics.problem()?;
        Some(format!("the pooled model has not converged: {problem}"))
    }

    fn convergence(&self) -> Convergence {
        let Diagnostics {
            draws,
            effective,
            pareto_k,
            r_hat,
            error,
            at_edge,
        } = self.found.diagnostics;
        Convergence {
            converged: Stat::flag(self.found.diagnostics.problem().is_none()),
            n_draws: Stat::count(draws),
            effective_draws: Stat::of(effective),
            pareto_k: Stat::of(pareto_k),
            r_hat: Stat::of(r_hat),
            error: Stat::of(error),
            at_edge: Stat::of(at_edge),
        }
    }
}

#[cfg(test)]
mod tests;
