//! What is wrong with a playback.

use super::ROUNDING_N;
use super::moments::Lag;
use crate::outcome::{Defect, Fidelity};
use study_base::sort::SmallSort as _;
use study_plan::protocol::RenderingRules;

/// Largest error of the speed, and of the time of the samples.
const SPEED_ERROR: f64 = 0.1;
const TIME_ERROR: f64 = 0.05;
/// Noise of a sensor that is no vibration, N, root mean square.
const SENSOR_NOISE_N: f64 = 0.1;

/// What the defects follow from, beside the stored quantities.
pub(super) struct Found {
    pub(super) aligned: Option<Lag>,
    pub(super) correlation: Option<f64>,
    pub(super) residual_n: Option<f64>,
    pub(super) bias_share: Option<f64>,
    pub(super) other: bool,
    pub(super) disordered: bool,
    pub(super) enough: bool,
    pub(super) host_in_time: bool,
    /// By how much the speed of a program is late, ms.
    pub(super) speed_late_ms: Option<f64>,
    /// Vibration that is felt, N.
    pub(super) felt_n: f64,
    /// Largest difference of measured and commanded force that lasted 20 ms, N, and its largest
    /// mean size over 50 ms as a share of the range of forces.
    pub(super) measured_n: Option<f64>,
    pub(super) measured_range_share: Option<f64>,
    /// The same of the commanded force and that of the table with the constants of docs/wire.md.
    pub(super) stated_n: Option<f64>,
    pub(super) stated_range_share: Option<f64>,
}

/// The defects, in the order of their declaration. Several defects of the same force
/// have one cause: only the most specific is named.
pub(super) fn defects(fidelity: &Fidelity, found: &Found, rules: &RenderingRules) -> Vec<Defect> {
    let over = |value: Option<f64>, most: f64| value.is_some_and(|v| v.abs() > most);
    let outside =
        |value: Option<f64>| value.is_some_and(|v| !(rules.gain[0]..=rules.gain[1]).contains(&v));
    let mut all = Vec::new();
    if fidelity.over_limit_n.is_some() {
        all.push(Defect::OverLimit);
    }
    let poor = found.enough
        && found.residual_n.is_some_and(|rms| rms > ROUNDING_N)
        && fidelity.rendered_vaf.is_some_and(|v| v < rules.min_vaf);
    let reversed = found.enough
        && fidelity.rendered_gain.is_some_and(|g| g < -0.2)
        && found.correlation.is_some_and(|r| r < -0.5);
    if found.enough && found.other {
        all.push(Defect::OtherTable);
    } else if reversed {
        all.push(Defect::Sign);
    } else {
        let before = all.len();
        let aligned = found.aligned.is_none_or(|lag| outside(Some(lag.slope)));
        if found.enough && outside(fidelity.rendered_gain) && aligned {
            all.push(Defect::Gain);
        }
        let biased = over(fidelity.rendered_bias_n, rules.max_bias_n)
            || over(found.bias_share, rules.max_error_share);
        if found.enough && biased {
            all.push(Defect::Bias);
        }
        if found.enough && over(fidelity.rendered_delay_ms, rules.max_delay_ms) {
            all.push(Defect::Delay);
        }
        // What is left after gain, bias and delay.
        let explained = found
            .aligned
            .is_some_and(|lag| lag.correlation.powi(2) >= rules.min_vaf);
        if poor && !(explained && all.len() > before) {
            all.push(Defect::Shape);
        }
        let in_part = found.enough && over(fidelity.rendered_error_share, rules.max_error_share);
        let moments = over(fidelity.rendered_error_n, rules.max_error_n)
            || over(fidelity.error_range_share, rules.max_range_share);
        if all.len() == before && moments {
            all.push(Defect::Error);
        }
        if all.len() == before && over(fidelity.vibration_n, found.felt_n) {
            all.push(Defect::Vibration);
        }
        if all.len() == before && in_part {
            all.push(Defect::Error);
        }
        let excused = over(found.stated_n, rules.max_error_n)
            || over(found.stated_range_share, rules.max_range_share)
            || (found.enough && over(fidelity.table_error_share, rules.max_error_share));
        if all.len() == before && excused {
            all.push(Defect::Constants);
        }
        all.small_sort_by_key(|defect| *defect as u8);
    }
    let weak = found.enough
        && (outside(fidelity.measured_gain)
            || over(fidelity.measured_error_share, rules.max_error_share)
            || over(fidelity.measured_delay_ms, rules.max_delay_ms));
    let at_times = over(
        found.measured_n,
        rules.max_error_n.max(rules.max_measured_error_n),
    ) || over(found.measured_range_share, rules.max_range_share)
        || over(
            fidelity.measured_vibration_n,
            found.felt_n.max(SENSOR_NOISE_N),
        );
    if weak || at_times || over(fidelity.measured_error_n, rules.max_measured_error_n) {
        all.push(Defect::Measured);
    }
    let other_speed = (fidelity.speed_gain).is_some_and(|gain| (gain - 1.0).abs() > SPEED_ERROR);
    if other_speed || (found.enough && over(found.speed_late_ms, rules.max_delay_ms)) {
        all.push(Defect::Speed);
    }
    let off = |ratio: f64| (ratio - 1.0).abs() > TIME_ERROR;
    if found.host_in_time && fidelity.time_ratio.is_some_and(off) {
        all.push(Defect::Clock);
    }
    if found.disordered {
        all.push(Defect::Samples);
    }
    all
}
