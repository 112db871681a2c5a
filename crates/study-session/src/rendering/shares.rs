//! By how much the force was wrong, as a share of the force of the table: over the whole
//! playback, in each direction, at rest, and in each stretch of it. A device that is wrong in
//! one direction only, or that turns wrong late, is right on average.

use super::REST_MM_S;
use crate::outcome::Sample;

/// Duration of a stretch, s.
const STRETCH_S: f64 = 2.0;
/// Parts with less comparable time are not judged by themselves, s.
const LEAST_S: f64 = 0.5;

/// Number of samples, and sums of squares, N².
#[derive(Clone, Copy, Default)]
struct Squares {
    n: f64,
    force: f64,
    apart: f64,
}

impl Squares {
    fn add(&mut self, [force_n, apart_n]: [f64; 2]) {
        self.n += 1.0;
        self.force += force_n.powi(2);
        self.apart += apart_n.powi(2);
    }

    /// Rms difference over rms force; weaker forces count as `least_n`.
    fn share(&self, least_n: f64) -> f64 {
        let [force_n, apart_n] = [self.force, self.apart].map(|sum| (sum / self.n).sqrt());
        apart_n / force_n.max(least_n)
    }
}

/// The largest share among the whole playback and its parts. `known` is the right force at a
/// sample and the difference from it, N, where it is compared. `None` without half a second of
/// such samples.
pub(super) fn largest_share(
    samples: &[Sample],
    interval_s: f64,
    least_n: f64,
    known: impl Fn(usize) -> Option<[f64; 2]>,
) -> Option<f64> {
    let stretch = (STRETCH_S / interval_s).ceil();
    let [mut all, mut forwards, mut backwards, mut rest, mut latest] = [Squares::default(); 5];
    let mut stretches = Vec::new();
    for (i, sample) in samples.iter().enumerate() {
        let Some(pair) = known(i) else {
            continue;
        };
        let way = match sample.v_mm_s {
            v if v > REST_MM_S => &mut forwards,
            v if v < -REST_MM_S => &mut backwards,
            _ => &mut rest,
        };
        for part in [&mut all, way, &mut latest] {
            part.add(pair);
        }
        if latest.n >= stretch {
            stretches.push(std::mem::take(&mut latest));
        }
    }
    (stretches.into_iter())
        .chain([all, forwards, backwards, rest, latest])
        .filter(|part| part.n * interval_s >= LEAST_S)
        .map(|part| part.share(least_n))
        .reduce(f64::max)
}
