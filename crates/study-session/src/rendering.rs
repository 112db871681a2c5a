//! Was the stimulus right? Compares the forces of a playback with those of its table.
//!
//! [`judge`] is a pure function of the table and limits that were sent, the telemetry
//! and the rules of the protocol. The expected force comes from the code that a device
//! runs ([`study_wire::servo`]), stepped through the reported motion.
//!
//! Not visible in telemetry: a wrong scale or origin of the position, a wrong motor
//! constant without a force sensor, a wrong clock that is consistent. `study device
//! commission` asks a person to measure those.

mod comparable;
mod moments;
mod predicted;
mod scale;
mod shares;

use crate::outcome::{Defect, Fidelity, Sample, Verdict};
use comparable::{
    SLOW_S, TOO_COARSE, comparable, direction_known, too_coarse, too_little, with_doubt,
};
use moments::{Moments, best_lag};
use predicted::{Predicted, predicted};
use scale::Scale;
use shares::{Share, largest_share};
use study_base::text::ModelId;
use study_plan::protocol::{OnFault, RenderingRules};
use study_wire::servo::{self, ServoSettings};

/// Slower than this the handle rests, mm/s.
const REST_MM_S: f64 = 5.0;
/// Duration of the window of [`Fidelity::rendered_error_n`], s.
const WINDOW_S: f64 = 0.02;
/// Only this much of a playback is searched for a delay or another table, s.
const SEARCHED_S: f64 = 20.0;
/// Largest delay that is searched, s.
const LONGEST_DELAY_S: f64 = 0.06;
/// Difference of forces that rounding explains: over the limit, or rms, N.
const ROUNDING_N: f64 = 0.01;
/// A measured force exceeds its limit if it does so by this factor and this force, N.
const MEASURED_EXCESS: (f64, f64) = (1.1, 0.5);
/// Largest error of the speed, and of the time of the samples.
const SPEED_ERROR: f64 = 0.1;
const TIME_ERROR: f64 = 0.05;
/// A host that was later than this does not judge the clock of the device, s.
const HOST_LATE_S: f64 = 0.03;
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
    /// Number of samples that were lost.
    pub lost: u64,
    /// Time of the samples over time of the host.
    pub time_ratio: Option<f64>,
    /// How late the host was at most, s; `None` if that was not measured.
    pub host_late_s: Option<f64>,
    /// The other tables of the study.
    pub others: &'a [(ModelId, servo::Rendering<'a>)],
}

/// Judges a playback.
pub fn judge(played: &Played<'_>, rules: &RenderingRules) -> Fidelity {
    let samples = in_order(played.samples);
    let mut fidelity = Fidelity {
        lost_share: share(
            played.lost as f64,
            played.samples.len() as f64 + played.lost as f64,
        ),
        time_ratio: played.time_ratio,
        ..Fidelity::default()
    };
    let Some(interval_s) = interval(&samples) else {
        fidelity.verdict = Verdict::TooLittle;
        fidelity.because = Some("no samples".to_owned());
        return fidelity;
    };
    let scale = Scale::of(played);
    let forces = with_doubt(played, &samples);
    let known = direction_known(played, &samples, &forces, interval_s);
    let keep = comparable(played, &samples, &forces, &known);
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
    fidelity.rendered_error_n = lasting_error(played, &samples, &forces, &known);
    let share = largest_share(&samples, &forces, &keep, interval_s, scale);
    fidelity.rendered_error_share = share.map(|share| share.beyond_doubt);
    limits(played, &samples, interval_s, &mut fidelity);
    measured(&samples, &mut fidelity);

    let searched = ((SEARCHED_S / interval_s) as usize).min(samples.len());
    let lag = delay(&samples[..searched], &forces, &keep, interval_s);
    fidelity.rendered_delay_ms = lag.map(|lag| 1e3 * interval_s * lag.steps);
    let nearest = nearest(played, &samples[..searched], &keep, interval_s);
    fidelity.nearest_model = nearest.as_ref().map(|near| near.model.clone());

    let too_little = too_little(&samples, &keep, interval_s, &commanded, scale);
    let unsure = |share: &Share| share.apart > rules.max_error_share;
    let open = too_little
        .or_else(|| too_coarse(&forces, &keep, &commanded))
        .or_else(|| share.filter(unsure).map(|_| TOO_COARSE));
    let found = Found {
        aligned: lag,
        correlation: commanded.correlation(),
        residual_n: beyond_doubt.residual().map(f64::sqrt),
        bias_share: commanded.bias_share(),
        other: nearest.is_some_and(|near| near.explains),
        disordered: samples.len() < played.samples.len()
            || repeated(&samples).is_some_and(|share| share > MOST_REPEATED)
            || unexplained_gaps(&samples, played.lost, interval_s),
        enough: too_little.is_none(),
        host_in_time: played.host_late_s.is_none_or(|late| late < HOST_LATE_S),
    };
    fidelity.defects = defects(&fidelity, &found, rules);
    settle(&mut fidelity, played, rules, open);
    fidelity
}

/// What the defects follow from, beside the stored quantities.
struct Found {
    aligned: Option<moments::Lag>,
    correlation: Option<f64>,
    residual_n: Option<f64>,
    bias_share: Option<f64>,
    other: bool,
    disordered: bool,
    enough: bool,
    host_in_time: bool,
}

/// The defects, in the order of their declaration. Several defects of the same force
/// have one cause: only the most specific is named.
fn defects(fidelity: &Fidelity, found: &Found, rules: &RenderingRules) -> Vec<Defect> {
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
        if all.len() == before && (in_part || over(fidelity.rendered_error_n, rules.max_error_n)) {
            all.push(Defect::Error);
        }
        all.sort_by_key(|defect| *defect as u8);
    }
    let weak = found.enough && outside(fidelity.measured_gain);
    if weak || over(fidelity.measured_error_n, rules.max_measured_error_n) {
        all.push(Defect::Measured);
    }
    if fidelity
        .speed_gain
        .is_some_and(|gain| (gain - 1.0).abs() > SPEED_ERROR)
    {
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
    if fidelity.defects.contains(&Defect::OverLimit) {
        return;
    }
    if !played.servo_told {
        fidelity.only_flag("the device does not tell the constants of its servo");
    }
}

/// The finite samples with ascending times.
fn in_order(samples: &[Sample]) -> Vec<Sample> {
    let mut last_s = f64::NEG_INFINITY;
    let finite = |s: &Sample| {
        [s.t_s, s.x_mm, s.v_mm_s, s.force_command_n]
            .iter()
            .all(|n| n.is_finite())
            && s.force_measured_n.is_none_or(f64::is_finite)
    };
    let mut keep = |s: &&Sample| {
        let next = finite(s) && s.t_s > last_s;
        if next {
            last_s = s.t_s;
        }
        next
    };
    samples.iter().filter(&mut keep).copied().collect()
}

/// The usual time between two samples, s: the median.
fn interval(samples: &[Sample]) -> Option<f64> {
    let mut all: Vec<f64> = samples.windows(2).map(|w| w[1].t_s - w[0].t_s).collect();
    let middle = all.len() / 2;
    (!all.is_empty()).then(|| *all.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Whether more samples are missing than the device says.
fn unexplained_gaps(samples: &[Sample], lost: u64, interval_s: f64) -> bool {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return false;
    };
    let due = (last.t_s - first.t_s) / interval_s + 1.0;
    due > 1.1 * (samples.len() as f64 + lost as f64) + 50.0
}

fn share(part: f64, whole: f64) -> Option<f64> {
    (whole > 0.0).then(|| part / whole)
}

/// Travel, range, speeds and the time in motion.
fn explore(played: &Played<'_>, samples: &[Sample], interval_s: f64, fidelity: &mut Fidelity) {
    let steps = || samples.windows(2).map(|w| (w[0], w[1]));
    fidelity.travel_mm = Some(steps().map(|(a, b)| (b.x_mm - a.x_mm).abs()).sum());
    let [low, high] = played.what.range_mm;
    let inside = || samples.iter().map(|s| s.x_mm.clamp(low, high));
    let visited =
        inside().fold(f64::NEG_INFINITY, f64::max) - inside().fold(f64::INFINITY, f64::min);
    fidelity.range_share = share(visited, high - low);
    fidelity.top_speed_mm_s = samples.iter().map(|s| s.v_mm_s.abs()).reduce(f64::max);
    let trained_mm_s = played.what.trained_mm_s;
    let factor = |top_mm_s| share(top_mm_s, trained_mm_s);
    fidelity.speed_factor = fidelity.top_speed_mm_s.and_then(factor);
    let moving = || samples.iter().filter(|s| s.v_mm_s.abs() > REST_MM_S);
    let beyond = |s: &&Sample| s.v_mm_s.abs() > trained_mm_s || !(low..=high).contains(&s.x_mm);
    let in_motion = moving().count() as f64;
    fidelity.motion_share = share(in_motion, samples.len() as f64);
    fidelity.beyond_share = share(moving().filter(beyond).count() as f64, in_motion);

    // The speed against the change of the position, over a time in which the resolution
    // of the position does not matter.
    let apart = ((WINDOW_S / interval_s) as usize).max(1);
    let whole = |w: &&[Sample]| (w[apart].t_s - w[0].t_s) < 1.5 * WINDOW_S.max(interval_s);
    let changes = samples.windows(apart + 1).filter(whole).map(|w| {
        let by_speed: f64 = (w.windows(2))
            .map(|s| 0.5 * (s[0].v_mm_s + s[1].v_mm_s) * (s[1].t_s - s[0].t_s))
            .sum();
        (w[apart].x_mm - w[0].x_mm, by_speed)
    });
    let (mut xx, mut xv, mut vv, mut n) = (0.0, 0.0, 0.0, 0.0);
    for (dx, dv) in changes {
        (xx, xv, vv, n) = (xx + dx * dx, xv + dx * dv, vv + dv * dv, n + 1.0);
    }
    // Either of them moves by more than rest.
    let rest_mm = REST_MM_S * WINDOW_S;
    if interval_s <= SLOW_S && f64::max(xx, vv) > n * rest_mm * rest_mm {
        fidelity.speed_gain = Some(if xx > 0.0 { xv / xx } else { f64::MAX });
    }
}

/// Share of moving samples that repeat the one before.
fn repeated(samples: &[Sample]) -> Option<f64> {
    let moving = |w: &&[Sample]| w[1].v_mm_s.abs() > 4.0 * REST_MM_S;
    let same = |w: &&[Sample]| {
        (w[0].x_mm, w[0].v_mm_s, w[0].force_command_n)
            == (w[1].x_mm, w[1].v_mm_s, w[1].force_command_n)
    };
    let all = samples.windows(2).filter(moving).count();
    let repeats = samples.windows(2).filter(moving).filter(same).count();
    share(repeats as f64, all as f64)
}

/// The largest mean difference of commanded and expected force over a window, N. Only
/// motion in a known direction counts, and the first quarter of the ramp, where forces are
/// small.
fn lasting_error(
    played: &Played<'_>,
    samples: &[Sample],
    forces: &[Predicted],
    known: &[bool],
) -> Option<f64> {
    let early_s = 0.25 * played.servo.ramp_s;
    largest_mean(samples, |i| {
        let moves = samples[i].v_mm_s.abs() > REST_MM_S && known[i];
        let counts = forces[i].settled && (moves || samples[i].t_s < early_s);
        counts.then(|| forces[i].apart_n(&samples[i]))
    })
}

/// The largest size of the mean of a series over a window without missing values.
fn largest_mean(samples: &[Sample], value: impl Fn(usize) -> Option<f64>) -> Option<f64> {
    let mut largest: Option<f64> = None;
    let (mut sum, mut from) = (0.0, 0);
    for (i, sample) in samples.iter().enumerate() {
        let Some(here) = value(i) else {
            (sum, from) = (0.0, i + 1);
            continue;
        };
        sum += here;
        while from < i && sample.t_s - samples[from + 1].t_s >= WINDOW_S {
            sum -= value(from).unwrap_or(0.0);
            from += 1;
        }
        if sample.t_s - samples[from].t_s >= WINDOW_S {
            let mean = (sum / (i + 1 - from) as f64).abs();
            largest = Some(largest.map_or(mean, |most| most.max(mean)));
        }
    }
    largest
}

/// Largest forces, and by how much they pass the limit of the playback.
fn limits(played: &Played<'_>, samples: &[Sample], interval_s: f64, fidelity: &mut Fidelity) {
    let most = |of: fn(&Sample) -> Option<f64>| {
        samples.iter().filter_map(of).map(f64::abs).reduce(f64::max)
    };
    let commanded = most(|s| Some(s.force_command_n));
    fidelity.max_force_n = [commanded, most(|s| s.force_measured_n)]
        .into_iter()
        .flatten()
        .reduce(f64::max);
    let limit_n = played.servo.force_n;
    let excess = commanded
        .map(|force| force - limit_n)
        .filter(|by| *by > ROUNDING_N);
    let (factor, force_n) = MEASURED_EXCESS;
    let lasting = (interval_s < WINDOW_S)
        .then(|| largest_mean(samples, |i| samples[i].force_measured_n))
        .flatten()
        .filter(|force| *force > factor * limit_n + force_n)
        .map(|force| force - limit_n);
    fidelity.over_limit_n = [excess, lasting].into_iter().flatten().reduce(f64::max);
}

/// The measured force against the commanded one.
fn measured(samples: &[Sample], fidelity: &mut Fidelity) {
    let pairs = samples
        .iter()
        .filter_map(|s| Some((s.force_command_n, s.force_measured_n?)));
    let moments = Moments::of(pairs);
    fidelity.measured_vaf = moments.vaf();
    fidelity.measured_gain = moments.slope();
    fidelity.measured_bias_n = moments.bias();
    fidelity.measured_error_n = moments.mean_error();
}

/// How much later than expected the commanded force comes.
fn delay(
    samples: &[Sample],
    forces: &[Predicted],
    keep: &[bool],
    interval_s: f64,
) -> Option<moments::Lag> {
    let first_s = samples.first()?.t_s;
    let place = |s: &Sample| ((s.t_s - first_s) / interval_s).round() as usize;
    // A clock that jumps must not ask for an array of any size.
    let most = 2 * (SEARCHED_S / interval_s) as usize;
    let size = place(samples.last()?).min(most) + 1;
    let (mut expected, mut commanded) = (vec![None; size], vec![None; size]);
    for ((sample, force), _) in samples
        .iter()
        .zip(forces)
        .zip(keep)
        .filter(|(_, keep)| **keep)
    {
        if let Some(slot) = expected.get_mut(place(sample)) {
            *slot = Some(force.force_n);
            commanded[place(sample)] = Some(sample.force_command_n);
        }
    }
    let lags = (LONGEST_DELAY_S / interval_s) as usize;
    best_lag(&expected, &commanded, lags).filter(|lag| lag.correlation > 0.5)
}

/// The table of the study that explains the commanded force best.
struct Nearest<'a> {
    model: &'a ModelId,
    /// Whether it is another one than was sent, and explains the force where that one
    /// does not.
    explains: bool,
}

/// Compares all tables at the rate of the samples.
fn nearest<'a>(
    played: &Played<'a>,
    samples: &[Sample],
    keep: &[bool],
    interval_s: f64,
) -> Option<Nearest<'a>> {
    let settings = ServoSettings {
        servo_hz: 1.0 / interval_s,
        ..played.servo
    };
    let score = |what: &servo::Rendering<'_>| {
        let forces = predicted(what, settings, samples, |_| 0.0);
        let pairs = (samples.iter().zip(&forces).zip(keep)).filter(|(_, keep)| **keep);
        let moments = Moments::of(pairs.map(|((s, p), _)| (p.force_n, s.force_command_n)));
        let far = moments.residual()? + moments.bias()?.powi(2);
        Some((far, moments.vaf()))
    };
    let (own, _) = score(&played.what)?;
    let mut best = Nearest {
        model: played.model,
        explains: false,
    };
    let distinct = own > Scale::of(played).force_n.powi(2);
    let mut least = own;
    for (model, what) in played.others {
        if let Some((far, vaf)) = score(what)
            && far < least
        {
            least = far;
            best = Nearest {
                model,
                explains: distinct && far < 0.25 * own && vaf.is_some_and(|vaf| vaf > 0.95),
            };
        }
    }
    Some(best)
}

#[cfg(test)]
mod tests;
