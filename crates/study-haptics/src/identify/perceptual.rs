//! Perceptual VAF: the error of a realization in components that people may weigh differently.
//!
//! F̂ − F on a recording, less its mean, is divided into parts whose squares add up:
//!
//! * the mean in each bin of position, over both directions: [`Component::Detent`] where the force of the recording falls
//!   with x, which is what is felt as a detent, and [`Component::Level`] elsewhere;
//! * what the means of the two directions in a bin differ: [`Component::Direction`]. With equally many samples of each it is
//!   half of their difference, such as that of the friction;
//! * what remains, which depends on the motion: its means over blocks of 25 ms, [`Component::Slow`], below
//!   about 20 Hz, and what remains of it, [`Component::Fast`].
//!
//! Each is a mean square over the variance of F, so that their sum is 1 − VAF. Bins are half of
//! [`Recording::scale_mm`] wide. Samples with v = 0 have the direction of the one before.
//!
//! With weights w the perceptual VAF is 1 − Σ w e / Σ w f, where f are the same components of F itself. A constant force has 0, a
//! perfect realization 1, and with equal weights it is VAF.

pub mod file;

use super::vaf;
use crate::model::Realization;
use crate::recording::{Recording, mean_and_variance};

study_base::named! {
    /// A component of the error.
    Component {
        /// The force by position, where it does not fall.
        Level = "level",
        /// The force by position, where it falls.
        Detent = "detent",
        /// What the directions differ.
        Direction = "direction",
        /// What depends on the motion, below about 20 Hz.
        Slow = "slow",
        /// The same above about 20 Hz.
        Fast = "fast",
    }
}

impl Component {
    /// All components, in the order of [`Parts`].
    pub const ALL: [Self; 5] = [
        Self::Level,
        Self::Detent,
        Self::Direction,
        Self::Slow,
        Self::Fast,
    ];
}

/// The components of an error or of a force, as shares of the variance of the force, in the order of [`Component::ALL`].
pub type Parts = [f64; 5];

/// Width of a bin of position, in units of [`Recording::scale_mm`].
const BIN: f64 = 0.5;
/// Most bins.
const MOST_BINS: f64 = 1e5;
/// The least fall of a detent, as a share of the range of the force.
const FALL: f64 = 0.05;
/// Length of a block, s: half of a period of 20 Hz.
const BLOCK_S: f64 = 0.025;

/// A recording with which realizations are compared.
#[derive(Debug)]
pub struct Reference<'r> {
    recording: &'r Recording,
    /// Of each sample.
    bins: Vec<usize>,
    is_negative: Vec<bool>,
    blocks: Vec<usize>,
    /// Of each bin.
    falls: Vec<bool>,
    /// Σ (F − mean)².
    squares: f64,
    force: Parts,
}

/// How much each component counts, at least 0; only their ratios matter.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// In the order of [`Component::ALL`]; `None` of one that is not known.
    known: [Option<f64>; 5],
    /// Where they are from, for people.
    pub note: Option<String>,
}

impl Weights {
    /// `None` unless one of them is above 0 and none is below it or not finite.
    pub fn new(known: [Option<f64>; 5], note: Option<String>) -> Option<Self> {
        let mut all = known.iter().flatten();
        let sound = all.clone().all(|w| *w >= 0.0 && w.is_finite());
        (sound && all.any(|w| *w > 0.0)).then_some(Self { known, note })
    }

    /// The weight of a component; `None` if it is not known.
    pub fn known(&self, component: Component) -> Option<f64> {
        let place = Component::ALL.iter().position(|c| *c == component);
        self.known[place?]
    }

    /// The weights, with the mean of the known ones in place of those that are not known.
    pub fn all(&self) -> Parts {
        let known: Vec<f64> = self.known.iter().copied().flatten().collect();
        let mean = known.iter().sum::<f64>() / known.len() as f64;
        self.known.map(|w| w.unwrap_or(mean))
    }
}

impl<'r> Reference<'r> {
    /// `None` if the force does not vary, or the position varies by nothing that can be divided into bins.
    pub fn of(recording: &'r Recording) -> Option<Self> {
        let [low, high] = recording.range_mm();
        let width_mm = BIN * recording.scale_mm();
        let count = ((high - low) / width_mm).floor() + 1.0;
        if !(1.0..MOST_BINS).contains(&count) {
            return None;
        }
        let bin = |x: &f64| ((x - low) / width_mm) as usize;
        let mut before = false;
        let mut direction = |v: &f64| {
            if *v != 0.0 {
                before = *v < 0.0;
            }
            before
        };
        let start = recording.t_s.first()?;
        // Counted, so that a gap has no blocks.
        let (mut blocks, mut last) = (0, 0.0);
        let mut block = |t: &f64| {
            let here = ((t - start) / BLOCK_S).floor();
            blocks += usize::from(here != last);
            last = here;
            blocks
        };
        let mut found = Self {
            bins: recording.x_mm.iter().map(bin).collect(),
            is_negative: recording.v_mm_s.iter().map(&mut direction).collect(),
            blocks: recording.t_s.iter().map(&mut block).collect(),
            falls: vec![false; count as usize],
            squares: recording.len() as f64 * mean_and_variance(&recording.f_n).1,
            force: [0.0; 5],
            recording,
        };
        let [least_n, most_n] = recording.range_n();
        let profile = found.means(&recording.f_n);
        found.falls = falls(&profile, FALL * (most_n - least_n));
        found.force = found.parts(&recording.f_n)?;
        Some(found)
    }

    /// The components of the recorded force, which add up to 1.
    pub fn force(&self) -> Parts {
        self.force
    }

    /// Whether the recorded force falls with x anywhere.
    pub fn has_detents(&self) -> bool {
        self.falls.contains(&true)
    }

    /// The components of the error of a realization, which add up to 1 − VAF. `None` if its prediction is not finite.
    pub fn errors(&self, realization: &Realization) -> Option<Parts> {
        self.parts(&vaf::errors(realization, self.recording))
    }

    /// The perceptual VAF of a realization. `None` if its prediction is not finite, or if the recorded force has nothing of
    /// what is weighed.
    pub fn vaf(&self, realization: &Realization, weights: &Weights) -> Option<f64> {
        let [errors, force] = self.weighed(&vaf::errors(realization, self.recording), weights)?;
        (force > 0.0).then(|| 1.0 - errors / force)
    }

    /// The weighted sums of squares, N², of the errors of all samples and of the recorded force, of which the quotient is what
    /// perceptual VAF misses. `None` if an error is not finite.
    pub fn weighed(&self, errors: &[f64], weights: &Weights) -> Option<[f64; 2]> {
        let all = weights.all();
        let sum = |parts: Parts| -> f64 { parts.iter().zip(all).map(|(p, w)| p * w).sum() };
        Some([self.parts(errors)?, self.force].map(|parts| self.squares * sum(parts)))
    }

    /// The mean of a signal in each bin that has samples of both directions, each of which counts alike, so that friction is
    /// no detent where one of them has more samples. If all motion is in one direction, of each bin with samples.
    fn means(&self, signal: &[f64]) -> Vec<Option<f64>> {
        let mut sums = vec![[(0.0, 0.0); 2]; self.falls.len()];
        for ((bin, negative), value) in self.bins.iter().zip(&self.is_negative).zip(signal) {
            add(&mut sums[*bin][usize::from(*negative)], *value);
        }
        let mean = |(sum, n): (f64, f64)| (n > 0.0).then(|| sum / n);
        let one_way = !(sums.iter()).any(|[plus, minus]| plus.1 > 0.0 && minus.1 > 0.0);
        sums.into_iter()
            .map(|both| match both.map(mean) {
                [Some(plus), Some(minus)] => Some(0.5 * (plus + minus)),
                [one, other] if one_way => one.or(other),
                _ => None,
            })
            .collect()
    }

    /// The components of a signal less its mean.
    fn parts(&self, signal: &[f64]) -> Option<Parts> {
        let (mean, _) = mean_and_variance(signal);
        let mut rest: Vec<f64> = signal.iter().map(|value| value - mean).collect();
        let mut sums = vec![[(0.0, 0.0); 2]; self.falls.len()];
        let cells = || self.bins.iter().zip(&self.is_negative);
        for ((bin, negative), value) in cells().zip(&rest) {
            add(&mut sums[*bin][usize::from(*negative)], *value);
        }
        let [mut level, mut detent, mut direction] = [0.0; 3];
        for ([plus, minus], falls) in sums.iter().zip(&self.falls) {
            let n = plus.1 + minus.1;
            if n == 0.0 {
                continue;
            }
            let of_both = (plus.0 + minus.0).powi(2) / n;
            if *falls {
                detent += of_both;
            } else {
                level += of_both;
            }
            if plus.1 > 0.0 && minus.1 > 0.0 {
                let apart = plus.0 / plus.1 - minus.0 / minus.1;
                direction += plus.1 * minus.1 / n * apart * apart;
            }
        }
        for ((bin, negative), value) in cells().zip(&mut rest) {
            let (sum, n) = sums[*bin][usize::from(*negative)];
            *value -= sum / n;
        }
        let last = self.blocks.last().copied().unwrap_or(0);
        let mut sums = vec![(0.0, 0.0); last + 1];
        for (block, value) in self.blocks.iter().zip(&rest) {
            add(&mut sums[*block], *value);
        }
        let of_block = |(sum, n): &(f64, f64)| if *n > 0.0 { sum * sum / n } else { 0.0 };
        let slow: f64 = sums.iter().map(of_block).sum();
        let all: f64 = rest.iter().map(|value| value * value).sum();
        let parts = [level, detent, direction, slow, (all - slow).max(0.0)];
        let parts = parts.map(|part| part / self.squares);
        parts.iter().all(|part| part.is_finite()).then_some(parts)
    }
}

/// Adds a number to a sum and its count.
fn add(sum: &mut (f64, f64), value: f64) {
    *sum = (sum.0 + value, sum.1 + 1.0);
}

/// The bins of a profile from a peak to the next valley that is at least `least` lower, if the profile rises by as much
/// after it or ends there.
fn falls(profile: &[Option<f64>], least: f64) -> Vec<bool> {
    let mut found = vec![false; profile.len()];
    let mut top = (f64::NEG_INFINITY, 0);
    let mut bottom: Option<(f64, usize)> = None;
    for (bin, level) in profile.iter().enumerate() {
        let Some(level) = *level else {
            continue;
        };
        match bottom {
            None if level >= top.0 => top = (level, bin),
            None if top.0 - level >= least => bottom = Some((level, bin)),
            None => {}
            Some(lowest) if level <= lowest.0 => bottom = Some((level, bin)),
            Some(lowest) if level - lowest.0 >= least => {
                found[top.1..=lowest.1].fill(true);
                top = (level, bin);
                bottom = None;
            }
            Some(_) => {}
        }
    }
    if let Some(lowest) = bottom {
        found[top.1..=lowest.1].fill(true);
    }
    found
}

#[cfg(test)]
mod tests;
