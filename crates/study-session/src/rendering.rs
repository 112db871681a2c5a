//! Was the stimulus right? Compares the forces of a playback with those of its table.
//!
//! [`judge`] is a pure function of the table and limits that were sent, the telemetry
//! and the rules of the protocol. The expected force comes from the code that a device
//! runs ([`study_wire::servo`]), stepped through the reported motion. Every sample is judged
//! (`band`) or counted as unjudged ([`Fidelity::judged_share`]).
//!
//! Not visible in telemetry: a wrong scale or origin of the position, a wrong motor
//! constant without a force sensor, a wrong clock that is consistent. `study device
//! commission` asks a person to measure those.

mod band;
mod comparable;
mod defects;
mod expected;
mod lasting;
mod measured;
mod moments;
mod motion;
mod predicted;
mod scale;
mod search;
mod shares;
mod stated;
mod vibration;

pub use expected::{Expected, expected};

use crate::outcome::{Defect, Fidelity, Sample, Verdict};
use band::{bands, judged_share};
use comparable::{
    TOO_COARSE, comparable, direction_known, too_coarse, too_little, too_much_lost, with_doubt,
};
use defects::{Found, defects};
use lasting::{largest_level, largest_mean, middles};
use measured::measured;
use moments::Moments;
use motion::{
    explore, in_order, interval, longest_gap_s, repeated, speed_late_ms, turns_lost,
    unexplained_gaps,
};
use scale::Scale;
use search::{delay, nearest};
use shares::largest_share;
use stated::stated;
use study_base::text::ModelId;
use study_plan::protocol::{OnFault, RenderingRules};
use study_wire::servo::{self, ServoSettings};

/// Slower than this the handle rests, mm/s.
const REST_MM_S: f64 = 5.0;
/// Duration of the window of [`Fidelity::rendered_error_n`], s.
const WINDOW_S: f64 = 0.02;
/// Duration of the window of [`Fidelity::error_range_share`], s.
const LASTING_S: f64 = 0.05;
/// Only this much of a playback is searched for a delay or another table, s.
const SEARCHED_S: f64 = 20.0;
/// Largest delay that is searched, s.
const LONGEST_DELAY_S: f64 = 0.06;
/// Difference of forces that rounding explains: over the limit, or rms, N.
const ROUNDING_N: f64 = 0.01;
/// What a force sensor resolves, which no device tells, N.
const SENSOR_N: f64 = 0.05;
/// A measured force exceeds its limit if it does so by this factor and this force, N.
const MEASURED_EXCESS: (f64, f64) = (1.1, 0.5);
/// A host that was later than this does not judge the clock of the device, s.
const HOST_LATE_S: f64 = 0.03;
/// Least rate of the steps into which the periods of a program are divided, Hz.
const STEPS_HZ: f64 = 4000.0;
/// Largest share of moving samples that repeat the one before.
const MOST_REPEATED: f64 = 0.2;

/// A playback, as it was requested and reported.
#[derive(Debug, Clone)]
pub struct Played<'a> {
    /// The realization.
    pub model: &'a ModelId,
    /// Its table, as it was sent.
    pub what: servo::Rendering<'a>,
    /// The device's servo, with the force limit of this playback.
    pub servo: ServoSettings,
    /// Whether the device has told the constants of its servo.
    pub servo_told: bool,
    /// Its samples, in the order of arrival.
    pub samples: &'a [Sample],
    /// Whether the device numbers its samples, so that [`Played::lost`] counts all that are
    /// missing. The samples of a program are the turns of its loop: their times are uneven, and
    /// a turn that came late is one that is lost.
    pub numbered: bool,
    /// Number of samples that were lost.
    pub lost: u64,
    /// From when its force fell to its end, in the time of its samples, s.
    pub faded_from_s: Option<f64>,
    /// Time of the samples over time of the host.
    pub time_ratio: Option<f64>,
    /// How late the host was at most, s; `None` if that was not measured.
    pub host_late_s: Option<f64>,
    /// The other tables of the study.
    pub others: &'a [(ModelId, servo::Rendering<'a>)],
}

impl Played<'_> {
    /// The servo whose steps explain the forces: that of a program, whose periods are uneven, in
    /// steps that divide them.
    fn stepped(&self) -> ServoSettings {
        let divided = match self.numbered {
            true => 1.0,
            false => (STEPS_HZ / self.servo.servo_hz).ceil().max(1.0),
        };
        ServoSettings {
            servo_hz: divided * self.servo.servo_hz,
            ..self.servo
        }
    }

    /// Whether the force has not begun to fall at a sample.
    fn is_whole(&self, sample: &Sample) -> bool {
        self.faded_from_s.is_none_or(|from_s| sample.t_s < from_s)
    }
}

/// Judges a playback.
pub fn judge(played: &Played<'_>, rules: &RenderingRules) -> Fidelity {
    let samples = in_order(played.samples);
    let usual_s = interval(&samples);
    let late = usual_s.filter(|_| !played.numbered);
    let lost = played.lost as f64 + late.map_or(0.0, |usual_s| turns_lost(&samples, usual_s));
    let mut fidelity = Fidelity {
        lost_share: share(lost, played.samples.len() as f64 + lost),
        time_ratio: played.time_ratio,
        faded_from_s: played.faded_from_s,
        ..Fidelity::default()
    };
    let Some(interval_s) = usual_s else {
        fidelity.verdict = Verdict::TooLittle;
        fidelity.because = Some("no samples".to_owned());
        return fidelity;
    };
    let forces = with_doubt(played, &samples);
    let scale = Scale::of(played, &samples, &forces);
    let known = direction_known(played, &samples, &forces, interval_s);
    let keep = comparable(played, &samples, &forces, &known);
    let bands = bands(played, &samples, &forces, &known, interval_s);
    fidelity.judged_share = judged_share(&samples, &bands, interval_s);
    explore(played, &samples, interval_s, &mut fidelity);
    let pairs = || {
        (samples.iter().zip(&forces).zip(&keep))
            .filter(|(_, keep)| **keep)
            .map(|((s, p), _)| (p.force_n, s.force_command_n))
    };
    let commanded = Moments::of(pairs());
    let apart = (samples.iter().zip(&forces).zip(&keep))
        .filter(|(_, keep)| **keep)
        .map(|((s, p), _)| (p.force_n, p.force_n + p.apart_n(s)));
    let beyond_doubt = Moments::of(apart);
    fidelity.rendered_vaf = beyond_doubt.vaf();
    fidelity.rendered_gain = commanded.slope();
    fidelity.rendered_bias_n = commanded.bias();
    // Outside of all that is right, of every sample that can be judged.
    let beyond: Vec<Option<f64>> = (samples.iter().zip(&bands))
        .map(|(s, band)| band.judged.then(|| band.beyond_n(s.force_command_n)))
        .collect();
    let sizes: Vec<Option<f64>> = (beyond.iter().zip(&samples))
        .map(|(n, s)| n.filter(|_| is_inside(played, s)).map(f64::abs))
        .collect();
    fidelity.rendered_error_n = largest_mean(&samples, WINDOW_S, |i| beyond[i]);
    let share = |apart_n: &dyn Fn(usize) -> Option<f64>| {
        largest_share(&samples, interval_s, scale.force_n, |i| {
            Some([forces[i].force_n, apart_n(i)?])
        })
    };
    let kept = |i: usize| keep[i].then_some((&samples[i], &forces[i]));
    let apart_share = share(&|i| kept(i).map(|(s, p)| s.force_command_n - p.force_n));
    let kept_share = share(&|i| kept(i).map(|(s, p)| p.apart_n(s)));
    fidelity.rendered_error_share = larger([share(&|i| beyond[i]), kept_share]);
    let level_n = largest_level(&samples, interval_s, LASTING_S, &sizes);
    fidelity.vibration_n = vibration::largest_n(&samples, interval_s, middles, |i| {
        let counts = bands[i].narrow;
        counts.then(|| [forces[i].force_n, samples[i].force_command_n])
    });
    limits(played, &samples, interval_s, &mut fidelity);
    let inside = |s: &Sample| is_inside(played, s);
    let sensed = measured(&samples, interval_s, scale, rules, inside, &mut fidelity);
    let stated = stated(played, &samples, interval_s, scale);
    fidelity.table_error_share = stated.and_then(|stated| stated.share);
    let of_range = |n: Option<f64>, least_n: f64| n.map(|n| n / scale.range_n.max(10.0 * least_n));
    fidelity.error_range_share = of_range(level_n, scale.resolved_n);
    let lasting_n = [
        fidelity.rendered_error_n,
        sensed.and_then(|sensed| sensed.lasting_n),
        stated.and_then(|stated| stated.lasting_n),
    ];
    fidelity.error_jnd = larger(lasting_n).map(|n| n / scale.jnd_n);

    let searched = ((SEARCHED_S / interval_s) as usize).min(samples.len());
    let lag = delay(&samples[..searched], interval_s, |i| {
        keep[i].then(|| [forces[i].force_n, samples[i].force_command_n])
    });
    fidelity.rendered_delay_ms = lag.map(|lag| 1e3 * interval_s * lag.steps);
    let speed_late_ms = match played.numbered {
        true => None,
        false => speed_late_ms(&samples[..searched], interval_s),
    };
    let nearest = nearest(played, &samples[..searched], &keep, interval_s, scale);
    fidelity.nearest_model = nearest.as_ref().map(|near| near.model.clone());

    let too_little = too_little(&samples, &keep, interval_s, &commanded, scale);
    let open = too_little
        .or_else(|| too_much_lost(&fidelity, longest_gap_s(&samples, interval_s), rules))
        .or_else(|| too_coarse(&forces, &keep, &commanded))
        .or_else(|| (apart_share > Some(rules.max_error_share)).then_some(TOO_COARSE));
    let found = Found {
        aligned: lag,
        correlation: commanded.correlation(),
        residual_n: beyond_doubt.residual().map(f64::sqrt),
        bias_share: commanded.bias_share(),
        other: nearest.is_some_and(|near| near.explains),
        disordered: samples.len() < played.samples.len()
            || repeated(&samples).is_some_and(|share| share > MOST_REPEATED)
            || (played.numbered && unexplained_gaps(&samples, played.lost, interval_s)),
        enough: too_little.is_none(),
        host_in_time: played.host_late_s.is_none_or(|late| late < HOST_LATE_S),
        speed_late_ms,
        felt_n: vibration::felt_n(played, scale),
        measured_n: sensed.and_then(|sensed| sensed.lasting_n),
        measured_range_share: of_range(sensed.and_then(|sensed| sensed.level_n), SENSOR_N),
        stated_n: stated.and_then(|stated| stated.lasting_n),
        stated_range_share: of_range(stated.and_then(|stated| stated.level_n), scale.resolved_n),
    };
    fidelity.defects = defects(&fidelity, &found, rules);
    settle(&mut fidelity, played, rules, open);
    fidelity
}

/// The verdict that follows from the defects.
fn settle(
    fidelity: &mut Fidelity,
    played: &Played<'_>,
    rules: &RenderingRules,
    too_little: Option<&'static str>,
) {
    let fails = |defect: &Defect| match rules.on_fault {
        None => defect.is_grave(),
        Some(OnFault::Fail) => true,
        Some(OnFault::Flag) => false,
    };
    fidelity.verdict = if fidelity.defects.iter().any(fails) {
        Verdict::Fault
    } else if !fidelity.defects.is_empty() {
        Verdict::Flag
    } else if let Some(why) = too_little {
        fidelity.because = Some(why.to_owned());
        Verdict::TooLittle
    } else {
        Verdict::Ok
    };
    // The limit holds whatever the constants of the servo are.
    if played.servo_told || fidelity.defects.contains(&Defect::OverLimit) {
        return;
    }
    // Other constants may make it another force; a wrong sign or clock is wrong with any.
    if !fidelity.defects.is_empty() && fidelity.defects.iter().all(|d| d.may_be_constants()) {
        fidelity.verdict = Verdict::Unverified;
        fidelity.because = Some(format!("{UNTOLD}, and it is not that of docs/wire.md"));
    }
    fidelity.only_flag(UNTOLD);
}

/// Why a wrong force is not held against a device.
const UNTOLD: &str = "the device does not tell the constants of its servo";

/// Whether the handle is in the range of the realization, and not at the wall beyond it.
fn is_inside(played: &Played<'_>, sample: &Sample) -> bool {
    let [low, high] = played.what.range_mm;
    (low..=high).contains(&sample.x_mm)
}

/// The largest of the known values.
fn larger<const N: usize>(values: [Option<f64>; N]) -> Option<f64> {
    values.into_iter().flatten().reduce(f64::max)
}

fn share(part: f64, whole: f64) -> Option<f64> {
    (whole > 0.0).then(|| part / whole)
}

/// Largest forces, and by how much they pass the limit of the playback.
fn limits(played: &Played<'_>, samples: &[Sample], interval_s: f64, fidelity: &mut Fidelity) {
    let most = |of: fn(&Sample) -> Option<f64>| {
        samples.iter().filter_map(of).map(f64::abs).reduce(f64::max)
    };
    let commanded = most(|s| Some(s.force_command_n));
    fidelity.max_force_n = larger([commanded, most(|s| s.force_measured_n)]);
    let limit_n = played.servo.force_n;
    let excess = commanded
        .map(|force| force - limit_n)
        .filter(|by| *by > ROUNDING_N);
    let (factor, force_n) = MEASURED_EXCESS;
    let lasting = (interval_s < WINDOW_S)
        .then(|| largest_mean(samples, WINDOW_S, |i| samples[i].force_measured_n))
        .flatten()
        .filter(|force| *force > factor * limit_n + force_n)
        .map(|force| force - limit_n);
    fidelity.over_limit_n = larger([excess, lasting]);
}

#[cfg(test)]
mod tests;
