//! By how much the force was wrong, as a share of the force of the table: over the whole
//! playback, in each direction, and in each stretch of it. A device that is wrong in one
//! direction only, or that turns wrong late, is right on average.

use super::predicted::Predicted;
use super::scale::Scale;
use crate::outcome::Sample;

/// Duration of a stretch, s.
const STRETCH_S: f64 = 2.0;
/// Parts with less comparable time are not judged by themselves, s.
const LEAST_S: f64 = 0.5;

/// Sums of squares, N².
#[derive(Clone, Copy, Default)]
struct Squares {
    n: usize,
    force: f64,
    apart: f64,
    beyond_doubt: f64,
}

/// Rms difference of commanded and table's force over rms force of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    /// The difference.
    pub(super) apart: f64,
    /// What of it the steps of the position do not explain.
    pub(super) beyond_doubt: f64,
}

impl Squares {
    fn add(&mut self, sample: &Sample, force: &Predicted) {
        self.n += 1;
        self.force += force.force_n.powi(2);
        self.apart += (sample.force_command_n - force.force_n).powi(2);
        self.beyond_doubt += force.apart_n(sample).powi(2);
    }

    fn share(&self, scale: Scale) -> Share {
        let n = self.n as f64;
        let force_n = (self.force / n).sqrt().max(scale.force_n);
        Share {
            apart: (self.apart / n).sqrt() / force_n,
            beyond_doubt: (self.beyond_doubt / n).sqrt() / force_n,
        }
    }
}

/// The largest shares among the whole playback and its parts; `None` without half a second
/// of comparable samples.
pub(super) fn largest_share(
    samples: &[Sample],
    forces: &[Predicted],
    keep: &[bool],
    interval_s: f64,
    scale: Scale,
) -> Option<Share> {
    let stretch = (STRETCH_S / interval_s).ceil() as usize;
    let [mut all, mut forwards, mut backwards, mut latest] = [Squares::default(); 4];
    let mut stretches = Vec::new();
    for ((sample, force), _) in (samples.iter().zip(forces))
        .zip(keep)
        .filter(|(_, keep)| **keep)
    {
        let way = match sample.v_mm_s > 0.0 {
            true => &mut forwards,
            false => &mut backwards,
        };
        for part in [&mut all, way, &mut latest] {
            part.add(sample, force);
        }
        if latest.n == stretch {
            stretches.push(std::mem::take(&mut latest));
        }
    }
    (stretches.into_iter())
        .chain([all, forwards, backwards, latest])
        .filter(|part| part.n as f64 * interval_s >= LEAST_S)
        .map(|part| part.share(scale))
        .reduce(|a, b| Share {
            apart: a.apart.max(b.apart),
            beyond_doubt: a.beyond_doubt.max(b.beyond_doubt),
        })
}
