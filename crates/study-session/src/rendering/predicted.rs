//! The force that the table gives for the reported motion, by the device's own servo.

use super::REST_MM_S;
use crate::outcome::Sample;
use study_wire::elements::{ElementsView, Spring};
use study_wire::predict::{Direction, Motion};
use study_wire::servo::{Law, Rendering, Servo, ServoSettings};

/// After a longer pause between two samples the filters have to settle again, s.
pub(super) const GAP_S: f64 = 0.004;
/// Time in which filter and slew limit forget a gap, s.
pub(super) const SETTLING_S: f64 = 0.06;
/// Only this much of a longer gap is calculated, in addition to the ramp, s.
const LONGEST_GAP_S: f64 = 0.25;

/// In a longer gap the hand may have turned twice, s: one message of samples at 400 Hz.
const STEADY_S: f64 = 0.03;
/// How far the way over a gap may differ from the mean of the two speeds, as a share.
const STEADY_WAY: f64 = 0.25;

/// Samples on each side of the second difference of the position.
pub(super) const APART: usize = 4;

/// The force at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Predicted {
    /// Force that a right device commands, N.
    pub force_n: f64,
    /// Whether it is known well: the samples before it are complete.
    pub settled: bool,
    /// Whether the state of its direction is known: the hand did not turn among lost samples,
    /// or has moved farther since than the state depends on.
    pub remembered: bool,
    /// Whether samples were lost a short time ago.
    pub after_gap: bool,
    /// Least and largest force since the sample before, N.
    pub ends_n: [f64; 2],
    /// By how much it may be another one because the position has steps and the servo
    /// periods, N.
    pub doubt_n: f64,
}

impl Predicted {
    /// By how much the commanded force differs from all that it may be, N.
    pub(super) fn apart_n(&self, sample: &Sample) -> f64 {
        let apart_n = sample.force_command_n - self.force_n;
        apart_n - apart_n.clamp(-self.doubt_n, self.doubt_n)
    }
}

/// The force at each sample. The samples are finite and in the order of time.
///
/// Between two samples the motion is interpolated, so that the servo runs at its own
/// rate. `acceleration_m_s2` is that of a sample. From `faded_from_s` on, if it is known, the force
/// falls, and is zero once the handle has left the range.
pub(super) fn predicted(
    what: &Rendering<'_>,
    settings: ServoSettings,
    faded_from_s: Option<f64>,
    samples: &[Sample],
    acceleration_m_s2: impl Fn(usize) -> f64,
) -> Vec<Predicted> {
    // The device trips by its own measurements; here every sample has a force.
    let mut servo = Servo::new(ServoSettings {
        velocity_mm_s: f64::MAX,
        overtravel_mm: f64::MAX,
        jump_mm: f64::MAX,
        ..settings
    });
    servo.start();
    let hz = settings.servo_hz;
    let most = ((LONGEST_GAP_S + settings.ramp_s) * hz).ceil();
    let mut all = Vec::with_capacity(samples.len());
    let mut before: Option<(f64, Motion)> = None;
    // What the whole steps so far have left of the time, in steps.
    let mut left = 0.0;
    let mut settled_from_s = 0.0;
    // Positions since the last gap, until they cover what the direction depends on.
    let mut since_gap: Option<[f64; 2]> = None;
    let mut since_turn: Option<[f64; 2]> = None;
    let memory_mm = memory_mm(&what.law);
    let ([low, high], beyond_mm) = (what.range_mm, settings.overtravel_mm);
    let is_near = |x_mm: f64| x_mm >= low - beyond_mm && x_mm <= high + beyond_mm;
    let mut released = false;
    for (i, sample) in samples.iter().enumerate() {
        let here = Motion {
            x_mm: sample.x_mm,
            v_mm_s: sample.v_mm_s,
            a_m_s2: acceleration_m_s2(i),
        };
        // A playback begins at its servo period 0 with the first motion that is known.
        let (from_s, from) = before.unwrap_or((-1.0 / hz, here));
        let apart_s = sample.t_s - from_s;
        if before.is_some() && apart_s > GAP_S {
            settled_from_s = sample.t_s + SETTLING_S;
            since_gap = Some([sample.x_mm; 2]);
            if may_have_turned(from, here, apart_s) {
                since_turn = Some([sample.x_mm; 2]);
            }
        }
        let covering = |places: Option<[f64; 2]>| {
            places
                .map(|[low, high]| [low.min(sample.x_mm), high.max(sample.x_mm)])
                .filter(|[low, high]| high - low < memory_mm)
        };
        (since_gap, since_turn) = (covering(since_gap), covering(since_turn));
        let due = apart_s * hz + left;
        let steps = due.round().clamp(1.0, most) as u32;
        left = (due - f64::from(steps)).clamp(-1.0, 1.0);
        let mut force_n = 0.0;
        let mut ends_n = [f64::INFINITY, f64::NEG_INFINITY];
        for step in 1..=steps {
            let part = f64::from(step) / f64::from(steps);
            let between = |a: f64, b: f64| a + part * (b - a);
            // It fell from a servo period on, whose time is rounded.
            let falls_s = between(from_s, sample.t_s) + 0.5 / hz;
            let x_mm = between(from.x_mm, here.x_mm);
            if faded_from_s.is_some_and(|begins_s| falls_s >= begins_s) {
                servo.fade();
                released |= !is_near(x_mm);
            }
            let stepped_n = servo.step(
                what,
                Motion {
                    x_mm,
                    v_mm_s: between(from.v_mm_s, here.v_mm_s),
                    a_m_s2: between(from.a_m_s2, here.a_m_s2),
                },
            );
            force_n = if released { 0.0 } else { stepped_n };
            ends_n = [ends_n[0].min(force_n), ends_n[1].max(force_n)];
        }
        all.push(Predicted {
            force_n,
            settled: sample.t_s >= settled_from_s && since_gap.is_none(),
            remembered: since_turn.is_none(),
            after_gap: sample.t_s < settled_from_s,
            ends_n,
            doubt_n: 0.0,
        });
        before = Some((sample.t_s, here));
    }
    all
}

/// Whether the hand may have turned between two samples: not if it moved on at the same speed, or
/// rested at the same place.
fn may_have_turned(from: Motion, to: Motion, apart_s: f64) -> bool {
    let way_mm = to.x_mm - from.x_mm;
    let due_mm = 0.5 * (from.v_mm_s + to.v_mm_s) * apart_s;
    let moves = from.v_mm_s * to.v_mm_s > 0.0
        && from.v_mm_s.abs().min(to.v_mm_s.abs()) > REST_MM_S
        && (way_mm - due_mm).abs() < STEADY_WAY * due_mm.abs();
    let rests = from.v_mm_s.abs().max(to.v_mm_s.abs()) < REST_MM_S
        && way_mm.abs() < REST_MM_S * apart_s.min(STEADY_S);
    !((moves || rests) && apart_s < STEADY_S)
}

/// The motion that an unknown motion before it has no influence on, mm: the hand may have
/// turned where samples were lost.
fn memory_mm(law: &Law<'_>) -> f64 {
    match law {
        Law::Table { rule, .. } => match rule {
            Direction::Sign => 0.0,
            Direction::Play { delta_mm } => *delta_mm,
            // e⁻³ of the difference is left.
            Direction::Dahl { delta_mm } => 3.0 * delta_mm,
        },
        Law::Mechanism(what) => {
            let own = what.scalars;
            own.gap_mm + 3.0 * own.slip_mm.max(own.handle_slip_mm)
        }
        Law::Elements(what) => elements_memory_mm(what),
    }
}

/// Both deflections of the longest stop, and the hysteresis of the widest latch. What relaxes
/// forgets in time; it counts by the way at the slip of its force.
fn elements_memory_mm(what: &ElementsView<'_>) -> f64 {
    let memories = what.springs.iter().map(|spring| match *spring {
        Spring::Stop { slip_mm } => 2.0 * slip_mm,
        Spring::Maxwell { slip_mm, .. } => slip_mm,
        Spring::Latch { rearm_mm, break_mm } => break_mm - rearm_mm,
    });
    memories.fold(0.0, f64::max)
}

/// The second difference of the position around a sample, m/s²; `None` if samples are missing.
fn bend_m_s2(samples: &[Sample], i: usize) -> Option<f64> {
    let (before, after) = (samples.get(i.checked_sub(APART)?)?, samples.get(i + APART)?);
    let here = &samples[i];
    let [past_s, next_s] = [here.t_s - before.t_s, after.t_s - here.t_s];
    let whole = (past_s - next_s).abs() < 0.1 * past_s && past_s < GAP_S * APART as f64;
    let bend_mm = after.x_mm - 2.0 * here.x_mm + before.x_mm;
    whole.then(|| 1e-3 * bend_mm / (past_s * next_s))
}

/// The accelerations of the samples, m/s². Those of a program, whose times may be uncertain by a part
/// of a turn, are what it computes itself: the change of its speed since the turn before.
pub(super) fn accelerations(samples: &[Sample], numbered: bool) -> Vec<f64> {
    let since_before = |i: usize| {
        let before = samples.get(i.checked_sub(1)?)?;
        Some(1e-3 * (samples[i].v_mm_s - before.v_mm_s) / (samples[i].t_s - before.t_s))
    };
    (0..samples.len())
        .map(|i| match numbered {
            true => acceleration(samples, i),
            false => since_before(i).unwrap_or(0.0),
        })
        .collect()
}

/// Acceleration at a sample, m/s²: the second difference of the position, in which the
/// filter of the speed has no part; where too few samples are there the difference of the
/// speed.
fn acceleration(samples: &[Sample], i: usize) -> f64 {
    // Beside a gap that of the nearest sample with enough samples around it.
    let near = (0..=APART).flat_map(|by| [i.checked_sub(by), Some(i + by)]);
    if let Some(a_m_s2) = near.flatten().find_map(|i| bend_m_s2(samples, i)) {
        return a_m_s2;
    }
    let before = &samples[i.saturating_sub(1)];
    let after = &samples[(i + 1).min(samples.len() - 1)];
    let dt_s = after.t_s - before.t_s;
    if dt_s > 0.0 {
        1e-3 * (after.v_mm_s - before.v_mm_s) / dt_s
    } else {
        0.0
    }
}
