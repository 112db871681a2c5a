//! Drawing a study.

use super::{Assumptions, Cell, Link, Scale, Settings, Vaf};
use study_base::rng::Stream;
use study_stats::describe::mean;
use study_stats::random::RandomSource;

/// The stream of one study.
pub(super) struct Draws(pub(super) Stream);

impl RandomSource for Draws {
    fn below(&mut self, n: u64) -> u64 {
        self.0.below(n)
    }

    fn shuffle(&mut self, items: &mut [usize]) {
        self.0.shuffle(items);
    }

    fn normal(&mut self) -> f64 {
        self.0.normal()
    }
}

/// A simulated study. Buffers are used again for the next one.
#[derive(Debug, Default)]
pub(super) struct Drawn {
    /// VAF of the realizations.
    pub(super) vaf: Vec<f64>,
    /// Ratings by participant, realization, repetition.
    pub(super) ratings: Vec<f64>,
    /// Which of them are missing; empty if none.
    pub(super) missing: Vec<bool>,
    /// Participants who were not lost.
    pub(super) participants: usize,
    /// VAF in standard deviations: standardized over the realizations, or as drawn.
    pub(super) x: Vec<f64>,
    /// Standard deviation of VAF.
    pub(super) unit: f64,
    /// The realization with the highest VAF minus the hidden reference, of each participant
    /// who rated both; only after [`Drawn::compare`].
    pub(super) beside_reference: Vec<f64>,
    /// True means of the realizations.
    means: Vec<f64>,
    /// Level and own slope of each participant who was not lost.
    people: Vec<(f64, f64)>,
}

/// Less their mean, over their standard deviation with denominator n; and that.
pub(super) fn standardized(values: &[f64]) -> (Vec<f64>, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let sd = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let of = |v: &f64| if sd > 0.0 { (v - mean) / sd } else { 0.0 };
    (values.iter().map(of).collect(), sd)
}

/// The standard deviation of drawn VAF: few are above 1.
const DRAWN_SD: f64 = 0.05;

impl Drawn {
    /// For studies of a cell.
    pub(super) fn new(cell: &Cell, settings: &Settings) -> Self {
        let vaf = settings.vaf(cell.realizations);
        let (x, unit) = standardized(&vaf);
        Self {
            x,
            unit,
            vaf,
            ..Self::default()
        }
    }

    /// Draws the next study. The numbers do not depend on slope and standard deviations, so
    /// that curves over these are smooth.
    pub(super) fn draw(&mut self, cell: &Cell, world: &Assumptions, draws: &mut Draws) {
        let (q, r) = (cell.realizations, cell.repetitions);
        let sd = &world.spread;
        if world.vaf == Vaf::Drawn {
            self.x = (0..q).map(|_| draws.normal()).collect();
            self.vaf = self.x.iter().map(|x| 0.75 + DRAWN_SD * x).collect();
            self.unit = DRAWN_SD;
        }
        self.means.clear();
        for x in &self.x {
            let scatter = sd.realization * draws.normal();
            self.means.push(world.mean + world.slope * x + scatter);
        }
        self.ratings.clear();
        self.people.clear();
        for _ in 0..cell.participants {
            let level = sd.subject * draws.normal();
            let own = sd.slope * draws.normal();
            self.people.push((level, own));
            for (mean, x) in self.means.iter().zip(&self.x) {
                let here = mean + level + own * x + sd.interaction * draws.normal();
                for _ in 0..r {
                    let residual = residual(world, draws);
                    self.ratings.push(rating(here + residual, &world.scale));
                }
            }
        }
        self.lose(cell, world, draws);
    }

    /// Removes participants and trials.
    fn lose(&mut self, cell: &Cell, world: &Assumptions, draws: &mut Draws) {
        let own = cell.realizations * cell.repetitions;
        self.participants = cell.participants;
        if world.dropout > 0.0 {
            let mut kept = 0;
            for i in 0..cell.participants {
                if draws.0.unit() >= world.dropout {
                    self.ratings.copy_within(i * own..(i + 1) * own, kept * own);
                    self.people[kept] = self.people[i];
                    kept += 1;
                }
            }
            self.ratings.truncate(kept * own);
            self.people.truncate(kept);
            self.participants = kept;
        }
        self.missing.clear();
        if world.missing > 0.0 {
            let lost = (self.ratings.iter()).map(|_| draws.0.unit() < world.missing);
            self.missing.extend(lost);
        }
    }

    /// Draws the ratings of the hidden reference, whose true mean is that of the realization
    /// with the highest VAF and `reference` points more, and compares the two. Returns its
    /// ratings by participant, without missing ones.
    pub(super) fn compare(
        &mut self,
        cell: &Cell,
        world: &Assumptions,
        draws: &mut Draws,
    ) -> Vec<Vec<f64>> {
        let (q, r) = (cell.realizations, cell.repetitions);
        let highest = (0..q).max_by(|a, b| self.x[*a].total_cmp(&self.x[*b]));
        let best = highest.unwrap_or(0);
        let mut all = Vec::with_capacity(self.participants);
        self.beside_reference.clear();
        for (i, (level, own)) in self.people.iter().enumerate() {
            let here = self.means[best] + world.reference + level + own * self.x[best];
            let here = here + world.spread.interaction * draws.normal();
            let mut ratings = Vec::with_capacity(r);
            for _ in 0..r {
                let rating = rating(here + residual(world, draws), &world.scale);
                if world.missing == 0.0 || draws.0.unit() >= world.missing {
                    ratings.push(rating);
                }
            }
            let from = (i * q + best) * r;
            let rated = |at: &usize| self.missing.get(*at) != Some(&true);
            let of_best: Vec<f64> = (from..from + r)
                .filter(rated)
                .map(|at| self.ratings[at])
                .collect();
            if let (Some(a), Some(b)) = (mean(&of_best), mean(&ratings)) {
                self.beside_reference.push(a - b);
            }
            all.push(ratings);
        }
        all
    }

    /// Whether everybody who was not lost rated everything.
    pub(super) fn is_complete(&self) -> bool {
        !self.missing.contains(&true)
    }
}

/// From repetition to repetition.
pub(super) fn residual(world: &Assumptions, draws: &mut Draws) -> f64 {
    match &world.scale {
        Scale::Ordinal {
            link: Link::Logit, ..
        } => logistic(draws),
        _ => world.spread.residual * draws.normal(),
    }
}

/// A standard logistic number.
pub(super) fn logistic(draws: &mut Draws) -> f64 {
    // Between 0 and 1, without the ends.
    let u = draws.0.unit() + 2f64.powi(-54);
    (u / (1.0 - u)).ln()
}

pub(super) fn rating(latent: f64, scale: &Scale) -> f64 {
    match scale {
        Scale::Continuous => latent,
        // A half is rounded down, as a threshold at it would.
        Scale::Rounded(from, to) => (latent - 0.5).ceil().clamp(*from as f64, *to as f64),
        Scale::Ordinal {
            thresholds, from, ..
        } => {
            let below = thresholds.iter().filter(|t| **t < latent).count();
            *from as f64 + below as f64
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_becomes_a_rating_of_the_scale() {
        let rounded = Scale::Rounded(1, 7);
        for (latent, expected) in [(-3.0, 1.0), (1.4, 1.0), (1.6, 2.0), (6.6, 7.0), (9.0, 7.0)] {
            assert_eq!(rating(latent, &rounded), expected);
        }
        let thresholds = (1..7).map(|i| f64::from(i) + 0.5).collect();
        let same = Scale::Ordinal {
            link: Link::Probit,
            thresholds,
            from: 1,
        };
        for i in -20..100 {
            let latent = f64::from(i) * 0.1 + 0.013;
            assert_eq!(rating(latent, &same), rating(latent, &rounded));
        }
    }
}
