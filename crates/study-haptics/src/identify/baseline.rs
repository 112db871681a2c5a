//! Two baselines: a force profile without dynamics, and a spring.
//!
//! * `static`: for each direction the mean force of the samples in
//!   [node − dx/2, node + dx/2) at any speed; m = b = k = 0 and F0 is that mean, the
//!   least-squares fit of F0 alone. This is playback of a recorded force profile
//!   (Angerilli 2001).
//! * `spring`: F = k x + F0 by least squares over all samples of both directions.

use super::resample::{self, Resampled};
use super::samples::{Samples, Theta};
use crate::recording::Recording;

/// The mean force at each node of one direction, as [0, 0, 0, F].
pub fn static_profile(samples: &Samples, nodes: &[f64], dx_mm: f64) -> Resampled {
    let forces: Vec<Theta> = samples.f_n.iter().map(|f| [0.0, 0.0, 0.0, *f]).collect();
    resample::bin(&samples.x_mm, &forces, nodes, dx_mm)
}

/// The least-squares line through all samples, as [0, 0, k, F0].
pub fn spring(recordings: &[&Recording]) -> Theta {
    let all = || recordings.iter().flat_map(|r| r.x_mm.iter().zip(&r.f_n));
    let n = all().count() as f64;
    let mean_x = all().map(|(x, _)| x).sum::<f64>() / n;
    let mean_f = all().map(|(_, f)| f).sum::<f64>() / n;
    let (mut xx, mut xf) = (0.0, 0.0);
    for (x, f) in all() {
        xx += (x - mean_x) * (x - mean_x);
        xf += (x - mean_x) * (f - mean_f);
    }
    // x varies in every recording, so xx > 0
    let k = xf / xx;
    [0.0, 0.0, k, mean_f - k * mean_x]
}
