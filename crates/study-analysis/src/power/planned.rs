//! What the plans of parts have in common.

use super::Cell;
use super::parts::PartWorld;
use study_stats::power::covariate::Spread;

/// World, spread, slope, design, and the numbers of repetitions that are compared.
pub(super) type Planned = (PartWorld, Spread, f64, Cell, Vec<usize>);

/// Nothing scatters.
pub(super) const NOTHING: Spread = Spread {
    subject: 0.0,
    realization: 0.0,
    interaction: 0.0,
    residual: 0.0,
    slope: 0.0,
};

/// Two digits of a default, which people read.
pub(super) fn neat(x: f64) -> f64 {
    let unit = 10f64.powi(x.abs().log10().floor() as i32 - 1);
    if x == 0.0 {
        0.0
    } else {
        (x / unit).round() / (1.0 / unit)
    }
}
