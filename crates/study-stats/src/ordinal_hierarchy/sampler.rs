//! One chain.

use super::effects::{Effects, Latent, Spread};
use super::{Data, OrdinalPriors};
use crate::distribution::{normal_cdf, normal_quantile};
use crate::random::{RandomSource, SplitMix64};

/// Steps out of a slice, and steps back into it.
const MAX_STEPS: usize = 50;

/// What is kept of a step.
#[derive(Debug, Clone)]
pub(super) struct Draw {
    /// βx + m of each realization.
    pub(super) realizations: Vec<f64>,
    pub(super) slope: f64,
    pub(super) spread: Spread,
    pub(super) lapse: f64,
    pub(super) thresholds: Vec<f64>,
}

impl Draw {
    /// The mean distance of neighboring thresholds.
    pub(super) fn category(&self) -> f64 {
        let ends = self.thresholds.first().zip(self.thresholds.last());
        let range = ends.map_or(0.0, |(low, high)| high - low);
        range / (self.thresholds.len().max(2) - 1) as f64
    }
}

/// The state of a chain.
pub(super) struct Chain<'a> {
    data: &'a Data,
    priors: &'a OrdinalPriors,
    random: SplitMix64,
    thresholds: Vec<f64>,
    lapse: f64,
    slope: f64,
    spread: Spread,
    realizations: Vec<f64>,
    people: Vec<f64>,
    interaction: Vec<f64>,
}

/// Uniform in (0, 1).
fn unit(random: &mut SplitMix64) -> f64 {
    (random.below(1 << 53) as f64 + 0.5) / (1u64 << 53) as f64
}

/// Φ(b) − Φ(a), from the tail in which the digits are.
fn between(a: f64, b: f64) -> f64 {
    match a > 0.0 {
        true => normal_cdf(-a) - normal_cdf(-b),
        false => normal_cdf(b) - normal_cdf(a),
    }
}

/// A normal number between two bounds.
fn truncated(mean: f64, (low, high): (f64, f64), random: &mut SplitMix64) -> f64 {
    let (a, b) = (low - mean, high - mean);
    let u = unit(random);
    // In the upper tail by its mirror image.
    let (a, b, sign) = if a > 0.0 { (-b, -a, -1.0) } else { (a, b, 1.0) };
    let p = normal_cdf(a) + u * (normal_cdf(b) - normal_cdf(a));
    let z = normal_quantile(p).filter(|z| z.is_finite());
    // Beyond all digits the nearer end is all that is left.
    let nearer = if a.is_finite() && a.abs() < b.abs() {
        a
    } else {
        b
    };
    mean + sign * z.unwrap_or(nearer).clamp(a, b)
}

/// A draw by slice sampling, stepping out (Neal 2003). `log` is −∞ where nothing is possible.
fn slice(at: f64, width: f64, random: &mut SplitMix64, mut log: impl FnMut(f64) -> f64) -> f64 {
    let level = log(at) + unit(random).ln();
    let mut low = at - width * unit(random);
    let mut high = low + width;
    for _ in 0..MAX_STEPS {
        if log(low) <= level {
            break;
        }
        low -= width;
    }
    for _ in 0..MAX_STEPS {
        if log(high) <= level {
            break;
        }
        high += width;
    }
    for _ in 0..MAX_STEPS {
        let next = low + (high - low) * unit(random);
        if log(next) > level {
            return next;
        }
        match next < at {
            true => low = next,
            false => high = next,
        }
    }
    at
}

impl<'a> Chain<'a> {
    /// Thresholds begin at the quantiles of all ratings, effects at 0; a random part makes chains begin apart.
    pub(super) fn new(data: &'a Data, priors: &'a OrdinalPriors, mut random: SplitMix64) -> Self {
        let counts =
            (0..data.categories).map(|k| data.cells.iter().map(|c| f64::from(c.counts[k])).sum());
        let counts: Vec<f64> = counts.collect();
        let total: f64 = counts.iter().sum();
        let mut below = 0.0;
        let mut thresholds: Vec<f64> = (counts[..data.categories - 1].iter().enumerate())
            .map(|(k, n)| {
                below += n;
                let p = (below + 0.5) / (total + 1.0);
                // Categories that nobody used are apart as well.
                normal_quantile(p).unwrap_or(0.0) + 1e-3 * k as f64
            })
            .collect();
        let scale = 1.0 + unit(&mut random);
        thresholds.iter_mut().for_each(|c| *c *= scale);
        let mut spread = || priors.spread * (0.2 + 0.8 * unit(&mut random));
        let spread = [spread(), spread(), spread()];
        Self {
            data,
            priors,
            thresholds,
            lapse: 0.01,
            slope: 0.0,
            spread,
            realizations: vec![0.0; data.realizations],
            people: vec![0.0; data.participants],
            interaction: vec![0.0; data.cells.len()],
            random,
        }
    }

    pub(super) fn draw(&self) -> Draw {
        Draw {
            realizations: (0..self.data.realizations)
                .map(|j| self.realization(j))
                .collect(),
            slope: self.slope,
            spread: self.spread,
            lapse: self.lapse,
            thresholds: self.thresholds.clone(),
        }
    }

    pub(super) fn step(&mut self) {
        self.draw_thresholds();
        self.draw_shift();
        self.draw_scale();
        self.draw_lapse();
        let latent = self.latent();
        self.draw_effects(&latent);
    }

    /// βxⱼ + mⱼ.
    fn realization(&self, j: usize) -> f64 {
        let x = self.data.covariate.get(j).copied().unwrap_or(0.0);
        self.slope * x + self.realizations[j]
    }

    /// η of each cell.
    fn expected(&self) -> Vec<f64> {
        let cells = self.data.cells.iter().zip(&self.interaction);
        cells
            .map(|(c, w)| self.realization(c.realization) + self.people[c.participant] + w)
            .collect()
    }

    /// The ends of category k.
    fn ends(thresholds: &[f64], k: usize) -> (f64, f64) {
        let low = if k == 0 {
            f64::NEG_INFINITY
        } else {
            thresholds[k - 1]
        };
        (low, thresholds.get(k).copied().unwrap_or(f64::INFINITY))
    }

    /// The logarithm of the likelihood of the categories from `from` to `to`, with latent ratings and lapses integrated out.
    fn log_likelihood(
        &self,
        expected: &[f64],
        thresholds: &[f64],
        lapse: f64,
        (from, to): (usize, usize),
    ) -> f64 {
        let by_chance = lapse / self.data.categories as f64;
        let mut sum = 0.0;
        for (cell, eta) in self.data.cells.iter().zip(expected) {
            for k in from..=to {
                if cell.counts[k] > 0 {
                    let (low, high) = Self::ends(thresholds, k);
                    let p = (1.0 - lapse) * between(low - eta, high - eta) + by_chance;
                    sum += f64::from(cell.counts[k]) * p.ln();
                }
            }
        }
        sum
    }

    fn draw_thresholds(&mut self) {
        let expected = self.expected();
        let last = self.data.categories - 1;
        for k in 0..last {
            let (low, _) = Self::ends(&self.thresholds, k);
            let (_, high) = Self::ends(&self.thresholds, k + 1);
            let mut moved = self.thresholds.clone();
            let mut random = self.random.clone();
            self.thresholds[k] = slice(self.thresholds[k], 0.5, &mut random, |c| {
                if c <= low || c >= high {
                    return f64::NEG_INFINITY;
                }
                moved[k] = c;
                let prior = -0.5 * (c / self.priors.threshold).powi(2);
                prior + self.log_likelihood(&expected, &moved, self.lapse, (k, k + 1))
            });
            self.random = random;
        }
    }

    /// Thresholds together with all realizations, and together with all participants: what the ratings cannot tell apart, so that
    /// only what is assumed of both decides.
    fn draw_shift(&mut self) {
        let n = self.thresholds.len() as f64;
        for of_realizations in [true, false] {
            let (effects, sd) = match of_realizations {
                true => (&mut self.realizations, self.spread[0]),
                false => (&mut self.people, self.spread[1]),
            };
            let (own, other) = (self.priors.threshold.powi(-2), sd.powi(-2));
            let precision = n * own + effects.len() as f64 * other;
            let sums =
                own * self.thresholds.iter().sum::<f64>() + other * effects.iter().sum::<f64>();
            let by = -sums / precision + self.random.normal() / precision.sqrt();
            let all = self.thresholds.iter_mut().chain(effects);
            all.for_each(|x| *x += by);
        }
    }

    fn log_prior(&self, thresholds: &[f64]) -> f64 {
        let squares = thresholds
            .iter()
            .map(|c| (c / self.priors.threshold).powi(2));
        -0.5 * squares.sum::<f64>()
    }

    /// All latent numbers but the error together, by a factor eᵗ: the densities of the effects, of their spread's unit, take away
    /// their part of the Jacobian.
    fn draw_scale(&mut self) {
        let expected = self.expected();
        let last = self.data.categories - 1;
        let has_slope = !self.data.covariate.is_empty();
        let mut free = (last + 3) as f64;
        if has_slope {
            free += 1.0;
        }
        let mut random = self.random.clone();
        let t = slice(0.0, 0.1, &mut random, |t| {
            let factor = t.exp();
            let scaled = |x: &[f64]| x.iter().map(|x| factor * x).collect::<Vec<f64>>();
            let thresholds = scaled(&self.thresholds);
            let spread = self
                .spread
                .iter()
                .map(|s| (factor * s / self.priors.spread).powi(2));
            let slope = (factor * self.slope / self.priors.slope).powi(2);
            let likelihood =
                self.log_likelihood(&scaled(&expected), &thresholds, self.lapse, (0, last));
            likelihood + self.log_prior(&thresholds) - 0.5 * (spread.sum::<f64>() + slope)
                + free * t
        });
        self.random = random;
        let factor = t.exp();
        let all = [
            &mut self.thresholds,
            &mut self.realizations,
            &mut self.people,
            &mut self.interaction,
        ];
        all.into_iter().flatten().for_each(|x| *x *= factor);
        self.spread.iter_mut().for_each(|s| *s *= factor);
        self.slope *= factor;
    }

    fn draw_lapse(&mut self) {
        let expected = self.expected();
        let last = self.data.categories - 1;
        let mut random = self.random.clone();
        self.lapse = slice(self.lapse, 0.03, &mut random, |lapse| {
            if lapse <= 0.0 || lapse >= 1.0 {
                return f64::NEG_INFINITY;
            }
            let prior = (self.priors.lapse - 1.0) * (1.0 - lapse).ln();
            prior + self.log_likelihood(&expected, &self.thresholds, lapse, (0, last))
        });
        self.random = random;
    }

    /// The latent ratings of those that are no lapses, by cell.
    fn latent(&mut self) -> Vec<Option<Latent>> {
        let expected = self.expected();
        let by_chance = self.lapse / self.data.categories as f64;
        let mut made = Vec::with_capacity(expected.len());
        for (cell, eta) in self.data.cells.iter().zip(expected) {
            let (mut n, mut sum) = (0.0, 0.0);
            for (k, count) in cell.counts.iter().enumerate() {
                let (low, high) = Self::ends(&self.thresholds, k);
                let felt = (1.0 - self.lapse) * between(low - eta, high - eta);
                for _ in 0..*count {
                    if unit(&mut self.random) * (felt + by_chance) < felt {
                        n += 1.0;
                        sum += truncated(eta, (low, high), &mut self.random);
                    }
                }
            }
            made.push((n > 0.0).then(|| Latent {
                participant: cell.participant,
                realization: cell.realization,
                n,
                mean: sum / n,
            }));
        }
        made
    }

    fn draw_effects(&mut self, latent: &[Option<Latent>]) {
        let present: Vec<Latent> = latent.iter().copied().flatten().collect();
        let log = |spread: Spread| {
            Effects::new(self.data, &present, spread, self.priors.slope)
                .map_or(f64::NEG_INFINITY, |e| e.log_density)
        };
        let mut spread = self.spread;
        for which in 0..3 {
            // Over its logarithm, with the Jacobian.
            let found = slice(spread[which].ln(), 0.8, &mut self.random, |ln| {
                let mut moved = spread;
                moved[which] = ln.exp();
                if !(moved[which] > 1e-6 && moved[which] < 1e6) {
                    return f64::NEG_INFINITY;
                }
                ln - 0.5 * (moved[which] / self.priors.spread).powi(2) + log(moved)
            });
            spread[which] = found.exp();
        }
        self.spread = spread;
        let Some(effects) = Effects::new(self.data, &present, spread, self.priors.slope) else {
            return;
        };
        let (people, own) = effects.draw(&mut self.random);
        self.people = people;
        let k = self.data.realizations;
        self.realizations = own[..k].to_vec();
        self.slope = own.get(k).copied().unwrap_or(0.0);
        let within = 1.0 / (spread[2] * spread[2]);
        for (at, (cell, latent)) in self.data.cells.iter().zip(latent).enumerate() {
            let n = latent.map_or(0.0, |l| l.n);
            let here = self.realization(cell.realization) + self.people[cell.participant];
            let mean = latent.map_or(0.0, |l| l.n * (l.mean - here)) / (n + within);
            self.interaction[at] = mean + self.random.normal() / (n + within).sqrt();
        }
    }
}
