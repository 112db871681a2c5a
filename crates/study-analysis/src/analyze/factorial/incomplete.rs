//! The effects within participants, over everybody who rated two realizations or more: where
//! many did not rate everything.

use super::{ClusteredEffect, Compared, FactorialMean, FactorialTests, Layout, Margin};
use crate::analyze::adjusted::Adjusted;
use crate::analyze::cells::Cells;
use crate::analyze::record::{Number as _, Stat, Why};
use study_plan::protocol::Crossing;
use study_stats::lmm::ContrastT;
use study_stats::paired::holm;
use study_stats::within::Clustered;

pub(super) struct Incomplete<'a> {
    layout: Layout<'a>,
    clustered: &'a Clustered,
    /// What a mean participant would rate, by realization.
    means: Vec<f64>,
    participants: usize,
}

impl<'a> Incomplete<'a> {
    pub(super) fn of(
        cells: &Cells<'_>,
        adjusted: &'a Adjusted,
        crossing: &'a Crossing,
        margin: Option<Margin>,
    ) -> Result<Self, Why> {
        let layout = Layout::of(cells, crossing, margin, &adjusted.models)?;
        let why = "more realizations or participants than are compared within participants";
        let clustered = adjusted.clustered.as_ref().ok_or(why)?;
        let means = adjusted.means.as_ref().map_err(|e| e.to_string())?;
        Ok(Self {
            layout,
            clustered,
            means: means.iter().map(|mean| mean + cells.offset).collect(),
            participants: adjusted.design.participants,
        })
    }

    /// Decides the effects, and compares levels, in place of the complete participants.
    pub(super) fn decide(&self, found: &mut FactorialTests) {
        let crossing = self.layout.crossing;
        let mut decided: Vec<ClusteredEffect> =
            crossing.effects.iter().map(|e| self.effect(e)).collect();
        let p: Vec<Option<f64>> = decided.iter().map(|e| e.p.number()).collect();
        let corrected = holm(&p);
        for ((effect, p_holm), own) in crossing
            .effects
            .iter()
            .zip(corrected)
            .zip(decided.drain(..))
        {
            let name = crossing.effect_name(effect);
            if let Some(numbers) = found.effects.get_mut(name.as_str()) {
                let why = own.p.reason().unwrap_or_default().to_owned();
                numbers.p_holm = Some(Stat::or(p_holm, why));
                numbers.clustered = Some(own);
            }
        }
        found.means = (self.layout.shown().into_iter())
            .map(|levels| (self.layout.named(&levels), self.mean(&levels)))
            .collect();
        found.contrasts = self.layout.contrasts(&|weights| {
            let found = self.clustered.contrast(&self.over_realizations(weights))?;
            Some(Compared {
                estimate: found.estimate,
                se: found.se,
                ci95: found.ci95,
                t: found.t,
                df: found.df,
                p: found.p,
                dz: None,
            })
        });
    }

    /// Weights of combinations as weights of realizations.
    fn over_realizations(&self, weights: &[f64]) -> Vec<f64> {
        let realizations = self.clustered.realizations.len();
        self.layout.over_realizations(weights, realizations)
    }

    fn effect(&self, effect: &[usize]) -> ClusteredEffect {
        let contrasts: Vec<Vec<f64>> = (self.layout.contrasts_of(effect).iter())
            .map(|weights| self.over_realizations(weights))
            .collect();
        let why = match contrasts.iter().all(|weights| self.is_linked(weights)) {
            true => {
                "too few participants link the levels, or their ratings leave no variance of error"
            }
            false => {
                "no participants link the levels, so that a difference between them may be one between participants; let \
                 the same participants rate all of them"
            }
        };
        // One that cannot be tested leaves the effect without a test.
        let tests: Option<Vec<(f64, ContrastT)>> = (contrasts.iter())
            .map(|weights| {
                let test = self.clustered.contrast(weights)?;
                Some((test.p?, test))
            })
            .collect();
        let n = contrasts.len();
        let least = tests.and_then(|tests| tests.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)));
        let htz = self.clustered.test(&contrasts);
        ClusteredEffect {
            t: Stat::or(least.and_then(|(_, test)| test.t), why),
            df: Stat::or(least.and_then(|(_, test)| test.df), why),
            n_contrasts: Stat::count(n),
            p: Stat::or(least.map(|(p, _)| (p * n as f64).min(1.0)), why),
            htz_f: Stat::or(htz.map(|f| f.f), why),
            htz_df1: Stat::or(htz.map(|f| f.df1), why),
            htz_df2: Stat::or(htz.and_then(|f| f.df2), why),
            htz_p: Stat::or(htz.and_then(|f| f.p), why),
        }
    }

    /// Whether a contrast compares realizations that participants link: its weights sum to 0 in every set of these.
    fn is_linked(&self, weights: &[f64]) -> bool {
        let mut sums = vec![0.0; self.clustered.sets.len()];
        for (set, weight) in self.clustered.sets.iter().zip(weights) {
            sums[*set] += weight;
        }
        sums.iter().all(|sum: &f64| sum.abs() < 1e-9)
    }

    fn mean(&self, levels: &[(usize, usize)]) -> FactorialMean {
        let chosen = self.layout.at(levels);
        let of = |combination: &usize| {
            let own = &self.layout.columns[*combination];
            own.iter().map(|j| self.means[*j]).sum::<f64>() / own.len() as f64
        };
        let sum: f64 = chosen.iter().map(of).sum();
        FactorialMean {
            n: Stat::count(self.participants),
            mean: Stat::of(sum / chosen.len() as f64),
            sd: None,
            ci95: None,
        }
    }
}
