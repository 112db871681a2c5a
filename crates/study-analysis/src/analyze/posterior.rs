//! A second opinion on ratings as ordered categories: posterior probabilities, `ordinal_posterior/*`. It decides nothing.

use super::cells::Cells;
use super::record::{Interval, PairName, RealizationName, Stat, Why, statistics};
use super::{Better, Rules};
use rayon::prelude::*;
use std::collections::BTreeMap;
use study_stats::ordinal_hierarchy::{
    OrdinalCell, OrdinalEffort, OrdinalHierarchy, OrdinalPriors, Posterior, ordinal_hierarchy,
};
use study_stats::random::SplitMix64;

/// Most levels of a scale: each has a threshold.
const MAX_LEVELS: usize = 21;

/// The priors of effects and of their spread: as they are, half and twice as wide.
const FACTORS: [f64; 3] = [1.0, 0.5, 2.0];

statistics! {
    /// A probability, and what it is with other priors.
    pub struct Probability {
        /// posterior probability
        p: Stat,
        /// with effects and standard deviations half as large before the ratings
        p_narrow: Stat,
        /// with effects and standard deviations twice as large before the ratings
        p_wide: Stat,
    }

    /// A realization.
    pub struct PosteriorRealization {
        /// its latent mean less that of all, in standard deviations of a rating from one time to the next: posterior mean
        level: Stat,
        /// equal-tailed
        level_ci95: Interval,
        /// that it is the best
        best: Probability,
    }

    /// Two realizations, the first minus the second.
    pub struct PosteriorPair {
        /// difference of latent means: posterior mean
        difference: Stat,
        /// equal-tailed
        difference_ci95: Interval,
        /// that the first is above the second
        above: Probability,
        /// that they differ by less than the equivalence margin, whose points are the mean distance of neighboring thresholds
        equivalent: Option<Probability>,
    }

    /// The effect of VAF.
    pub struct PosteriorSlope {
        /// per standard deviation of VAF: posterior mean
        slope: Stat,
        /// equal-tailed
        slope_ci95: Interval,
        /// that it is above 0
        above: Probability,
    }

    /// Posterior of a cumulative probit model of the ratings: thresholds; VAF, standardized; realizations, participants and both as draws from normal populations; a share of ratings without attention. Priors: thresholds N(0, 3²), effect of VAF N(0, 1), standard deviations half-normal(1), share Beta(1, 30). Undefined if its chains have not converged. It decides nothing.
    pub struct PosteriorModel {
        /// draws of all chains
        n_draws: Stat,
        /// the largest split R̂ of all numbers, of all three priors
        r_hat: Stat,
        /// the smallest effective number of draws
        effective_draws: Stat,
        /// by realization
        realization: BTreeMap<RealizationName, PosteriorRealization>,
        /// by pair
        pair: BTreeMap<PairName, PosteriorPair>,
        /// if three realizations or more have a VAF, and all have
        vaf: Option<PosteriorSlope>,
        /// standard deviation between realizations, about the line if VAF is in the model: posterior mean
        sd_realization: Stat,
        /// between participants
        sd_participant: Stat,
        /// of participants and realizations together
        sd_interaction: Stat,
        /// share of ratings without attention
        lapse: Stat,
    }
}

/// The posterior, with so many draws.
pub(super) fn posterior(cells: &Cells<'_>, rules: &Rules, effort: OrdinalEffort) -> PosteriorModel {
    let models = cells.tested();
    let prepared = match prepared(cells, &models) {
        Ok(prepared) => prepared,
        Err(why) => return PosteriorModel::undefined(why),
    };
    let vaf = standardized(&models.iter().map(|&m| cells.vaf[m]).collect::<Vec<_>>());
    let fitted: Result<Vec<OrdinalHierarchy>, Why> = (FACTORS.par_iter())
        .map(|factor| {
            let priors = OrdinalPriors::default().scaled(*factor);
            let mut random = SplitMix64::new(rules.seed);
            let margin = rules.equivalence_margin;
            let covariate = vaf.as_deref().unwrap_or(&[]);
            ordinal_hierarchy(&prepared, covariate, &priors, margin, effort, &mut random)
                .map_err(|error| Why::from(error.to_string()))
        })
        .collect();
    let fitted = match fitted {
        Ok(fitted) => fitted,
        Err(why) => return PosteriorModel::undefined(why),
    };
    let worst = |of: fn(&OrdinalHierarchy) -> f64, larger: bool| {
        let all = fitted.iter().map(of);
        match larger {
            true => all.fold(0.0, f64::max),
            false => all.fold(f64::INFINITY, f64::min),
        }
    };
    let problem = fitted.iter().find_map(|f| f.convergence.problem());
    let found = match problem {
        Some(why) => PosteriorModel::undefined(why),
        None => model(cells, &models, &fitted, rules),
    };
    PosteriorModel {
        n_draws: Stat::count(fitted[0].convergence.draws),
        r_hat: Stat::of(worst(|f| f.convergence.r_hat, true)),
        effective_draws: Stat::of(worst(|f| f.convergence.effective, false)),
        ..found
    }
}

fn model(
    cells: &Cells<'_>,
    models: &[usize],
    fitted: &[OrdinalHierarchy],
    rules: &Rules,
) -> PosteriorModel {
    let own = &fitted[0];
    let probability = |of: &dyn Fn(&OrdinalHierarchy) -> f64| Probability {
        p: Stat::of(of(&fitted[0])),
        p_narrow: Stat::of(of(&fitted[1])),
        p_wide: Stat::of(of(&fitted[2])),
    };
    let interval = |of: &Posterior| Interval::or(Some(of.ci95), "");
    let realization = (models.iter().enumerate()).map(|(j, &m)| {
        let best = probability(&|f| match rules.better {
            Better::Higher => f.highest[j],
            Better::Lower => f.lowest[j],
        });
        let of = PosteriorRealization {
            level: Stat::of(own.realizations[j].mean),
            level_ci95: interval(&own.realizations[j]),
            best,
        };
        (RealizationName::from(cells.model_name(m)), of)
    });
    // Names are sorted, and so are the pairs of the model.
    let pair = (own.differences.iter().enumerate()).map(|(at, difference)| {
        let names = [difference.first, difference.second].map(|j| cells.model_name(models[j]));
        let of = PosteriorPair {
            difference: Stat::of(difference.difference.mean),
            difference_ci95: interval(&difference.difference),
            above: probability(&|f| f.differences[at].above),
            equivalent: (difference.equivalent)
                .map(|_| probability(&|f| f.differences[at].equivalent.unwrap_or(f64::NAN))),
        };
        (PairName::of(names[0], names[1]), of)
    });
    PosteriorModel {
        realization: realization.collect(),
        pair: pair.collect(),
        vaf: own.slope.map(|slope| PosteriorSlope {
            slope: Stat::of(slope.mean),
            slope_ci95: interval(&slope),
            above: probability(&|f| f.slope_above.unwrap_or(f64::NAN)),
        }),
        sd_realization: Stat::of(own.between_realizations.mean),
        sd_participant: Stat::of(own.between_participants.mean),
        sd_interaction: Stat::of(own.interaction.mean),
        lapse: Stat::of(own.lapse.mean),
        ..PosteriorModel::undefined("")
    }
}

/// The counts of each cell of these realizations, participants and realizations numbered from 0.
fn prepared(cells: &Cells<'_>, models: &[usize]) -> Result<Vec<OrdinalCell>, Why> {
    let rows = cells.cells.iter();
    let own: Vec<_> = rows
        .filter_map(|cell| Some((cell, models.binary_search(&cell.model).ok()?)))
        .collect();
    let ratings = || {
        own.iter()
            .flat_map(|(cell, _)| cells.of_cell(cell))
            .copied()
    };
    if ratings().any(|rating| rating.fract() != 0.0) {
        return Err("the ratings are no whole numbers".into());
    }
    let (low, high) = ratings().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    let is_scale = low.is_finite() && high - low < MAX_LEVELS as f64;
    if !is_scale {
        return Err(format!("the ratings have more than {MAX_LEVELS} levels").into());
    }
    let levels = (high - low) as usize + 1;
    let mut participants: Vec<usize> = own.iter().map(|(cell, _)| cell.subject).collect();
    participants.dedup();
    Ok(own
        .iter()
        .map(|(cell, realization)| {
            let mut counts = vec![0; levels];
            for rating in cells.of_cell(cell) {
                counts[(rating - low) as usize] += 1;
            }
            OrdinalCell {
                participant: participants.binary_search(&cell.subject).unwrap_or(0),
                realization: *realization,
                counts,
            }
        })
        .collect())
}

/// VAF with mean 0 and standard deviation 1; `None` unless all of three or more are known and vary.
fn standardized(vaf: &[Option<f64>]) -> Option<Vec<f64>> {
    let known: Vec<f64> = vaf.iter().copied().collect::<Option<_>>()?;
    let (mean, sd) = (
        study_stats::describe::mean(&known)?,
        study_stats::describe::sd(&known)?,
    );
    let varies = known.len() >= 3 && sd > 1e-12;
    varies.then(|| known.iter().map(|x| (x - mean) / sd).collect())
}
