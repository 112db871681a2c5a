//! The measured force against the commanded one, by the same rules as the commanded force
//! against that of the table: share of the force, in parts, for a moment, delay, vibration.
//!
//! A sensor has noise and a filter of its own. Its noise is averaged over [`MOMENT_S`], and the
//! commanded force is shifted by the delay of the measured one as far as the protocol allows a
//! delay.

use super::lasting::{largest_level, largest_mean, smoothed};
use super::moments::Moments;
use super::scale::Scale;
use super::search::delay;
use super::shares::largest_share;
use super::vibration;
use super::{LASTING_S, SEARCHED_S, SENSOR_N, WINDOW_S};
use crate::outcome::{Fidelity, Sample};
use study_plan::protocol::RenderingRules;

/// Half of the time over which the noise of a sensor is averaged, s.
const HALF_S: f64 = 0.005;

/// Where the measured force was another one than commanded.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Sensed {
    /// Largest difference that lasted 20 ms, N.
    pub(super) lasting_n: Option<f64>,
    /// Largest mean size of the difference over 50 ms, N.
    pub(super) level_n: Option<f64>,
}

/// Fills in what is stored of the measured force; `None` without a sensor.
pub(super) fn measured(
    samples: &[Sample],
    interval_s: f64,
    scale: Scale,
    rules: &RenderingRules,
    inside: impl Fn(&Sample) -> bool,
    fidelity: &mut Fidelity,
) -> Option<Sensed> {
    let pairs = samples
        .iter()
        .filter_map(|s| Some((s.force_command_n, s.force_measured_n?)));
    let moments = Moments::of(pairs);
    fidelity.measured_vaf = moments.vaf();
    fidelity.measured_gain = moments.slope();
    fidelity.measured_bias_n = moments.bias();
    fidelity.measured_error_n = moments.mean_error();
    samples.iter().find_map(|s| s.force_measured_n)?;

    let searched = ((SEARCHED_S / interval_s) as usize).min(samples.len());
    let lag = delay(&samples[..searched], interval_s, |i| {
        Some([samples[i].force_command_n, samples[i].force_measured_n?])
    });
    fidelity.measured_delay_ms = lag.map(|lag| 1e3 * interval_s * lag.steps);
    let most = 1e-3 * rules.max_delay_ms / interval_s;
    let steps = lag.map_or(0.0, |lag| lag.steps.clamp(0.0, most));
    let differences = differences(samples, interval_s, steps);
    // What a millisecond of the delay leaves is no difference.
    let beyond = |apart_n: f64, slack_n: f64| apart_n - apart_n.clamp(-slack_n, slack_n);
    let bias_n = moments.intercept();
    let without = |bias_n: f64| -> Vec<Option<f64>> {
        (differences.iter())
            .map(|known| known.map(|[apart_n, slack_n]| beyond(apart_n - bias_n, slack_n)))
            .collect()
    };
    let apart = without(0.0);
    let smooth = smoothed(samples, interval_s, HALF_S, &apart);
    let sizes: Vec<Option<f64>> = (smooth.iter().zip(samples))
        .map(|(n, s)| n.filter(|_| inside(s)).map(f64::abs))
        .collect();
    // A constant difference is judged by its size and not as a share.
    let varying = smoothed(
        samples,
        interval_s,
        HALF_S,
        &without(bias_n.unwrap_or_default()),
    );
    let least_n = scale.force_n.max(4.0 * SENSOR_N);
    fidelity.measured_error_share = largest_share(samples, interval_s, least_n, |i| {
        Some([samples[i].force_command_n, varying[i]?])
    });
    fidelity.measured_vibration_n = vibration::largest_n(samples, interval_s, smoothed, |i| {
        Some([samples[i].force_command_n, samples[i].force_measured_n?])
    });
    Some(Sensed {
        lasting_n: largest_mean(samples, WINDOW_S, |i| apart[i]),
        level_n: largest_level(samples, interval_s, LASTING_S, &sizes),
    })
}

/// The measured minus the commanded force `steps` samples before, and by how much that changes
/// within a sample on both sides, N; `None` where one of them is missing.
fn differences(samples: &[Sample], interval_s: f64, steps: f64) -> Vec<Option<[f64; 2]>> {
    let (whole, part) = (steps.floor() as usize, steps.fract());
    let at = |i: usize| {
        let measured_n = samples[i].force_measured_n?;
        let (from, to) = (
            i.checked_sub(whole + 2)?,
            (i + 1).saturating_sub(whole).min(i),
        );
        let around = samples[from..=to].iter().map(|s| s.force_command_n);
        let least_n = around.clone().fold(f64::INFINITY, f64::min);
        let most_n = around.fold(f64::NEG_INFINITY, f64::max);
        let [late_n, later_n] = [whole, whole + 1].map(|by| samples[i - by].force_command_n);
        let commanded_n = late_n + part * (later_n - late_n);
        let complete = samples[i].t_s - samples[from].t_s < (whole as f64 + 3.0) * interval_s;
        complete.then_some([measured_n - commanded_n, 0.5 * (most_n - least_n)])
    };
    (0..samples.len()).map(at).collect()
}
