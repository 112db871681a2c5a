//! Which samples of a playback are compared with the table, and whether they are enough.

use super::moments::Moments;
use super::predicted::{APART, GAP_S, Predicted, accelerations, predicted};
use super::scale::Scale;
use super::{Played, REST_MM_S, ROUNDING_N, WINDOW_S};
use crate::outcome::{Fidelity, Sample};
use study_plan::protocol::RenderingRules;
use study_wire::elements::Spring;
use study_wire::predict::Direction;
use study_wire::servo::Law;

/// Least time of comparable samples, s.
const LEAST_S: f64 = 0.5;
/// Least time of motion in each direction, s.
const LEAST_MOTION_S: f64 = 0.1;
/// Telemetry with longer intervals is too slow for a verdict, s.
pub(super) const SLOW_S: f64 = 0.0025;
/// Mass of a hand with its handle that a force moves, kg: less is moved more.
const HANDLE_KG: f64 = 0.3;
/// A force that was wrong for a longer gap than this would not have been seen, s.
const LONGEST_GAP_S: f64 = 0.06;
/// Time after the ramp before forces are compared, s.
pub(super) const AFTER_RAMP_S: f64 = 0.05;
/// Why there is no verdict about a force that the steps of the position leave open.
pub(super) const TOO_COARSE: &str = "the steps of the position are too coarse for this force";
/// Largest doubt about the force, rms, as a share of its standard deviation, and N.
const MOST_DOUBT: (f64, f64) = (0.1, 0.5);

/// The force at each sample, with what is not known about it: within the band of its
/// filter the acceleration is open by half a step of the position, and by its change in a
/// servo period and among lost samples; the deflection of a mechanism is open by half a step.
pub(super) fn with_doubt(played: &Played<'_>, samples: &[Sample]) -> Vec<Predicted> {
    let (what, servo) = (&played.what, played.servo);
    let stepped = played.stepped();
    let a_m_s2 = accelerations(samples, played.numbered);
    let fades = played.faded_from_s;
    let mut forces = predicted(what, stepped, fades, samples, |i| a_m_s2[i]);
    // The largest acceleration in that band within half a step.
    let band = std::f64::consts::TAU * servo.acceleration_hz;
    let half_mm = 0.5 * step_mm(samples);
    let swings_n: Vec<f64> = forces.iter().map(|p| p.ends_n[1] - p.ends_n[0]).collect();
    let more_m_s2 = |i: usize| {
        let among_lost = among_lost_m_s2(samples, &a_m_s2, i, half_mm, swings_n[i]);
        match played.numbered {
            // The program filters the same steps.
            false => among_lost,
            true => {
                1e-3 * half_mm * band * band
                    + jerk(samples, &a_m_s2, i) / servo.servo_hz
                    + among_lost
            }
        }
    };
    let mut others = vec![predicted(what, stepped, fades, samples, |i| {
        a_m_s2[i] + more_m_s2(i)
    })];
    // At a limit of the force only one side shows.
    if forces.iter().any(|p| p.after_gap) {
        others.push(predicted(what, stepped, fades, samples, |i| {
            a_m_s2[i] - more_m_s2(i)
        }));
    }
    let deflection_n = half_mm * stiffness_n_per_mm(&what.law);
    for (i, force) in forces.iter_mut().enumerate() {
        let apart_n = others.iter().map(|o| (o[i].force_n - force.force_n).abs());
        force.doubt_n = apart_n.fold(0.0, f64::max) + deflection_n;
    }
    forces
}

/// What the acceleration among the samples that were lost before this one may have been beside
/// that between both ends, m/s²: the change from one to the other, which may have come at once,
/// twice what the speeds tell of the mean, what two steps of the position in each millisecond do to
/// them, and what the force did to the handle meanwhile.
fn among_lost_m_s2(
    samples: &[Sample],
    a_m_s2: &[f64],
    i: usize,
    half_mm: f64,
    swing_n: f64,
) -> f64 {
    let Some(before) = i.checked_sub(1) else {
        return 0.0;
    };
    let gap_s = samples[i].t_s - samples[before].t_s;
    if gap_s <= GAP_S {
        return 0.0;
    }
    let ends = [before, i].map(|i| a_m_s2[i]);
    let mean_m_s2 = 1e-3 * (samples[i].v_mm_s - samples[before].v_mm_s) / gap_s;
    let apart_m_s2 = mean_m_s2 - 0.5 * (ends[0] + ends[1]);
    (ends[1] - ends[0]).abs() + 2.0 * apart_m_s2.abs() + 4.0 * half_mm / gap_s + swing_n / HANDLE_KG
}

/// Size of the change of the acceleration, m/s³.
fn jerk(samples: &[Sample], a_m_s2: &[f64], i: usize) -> f64 {
    let (before, after) = (i.saturating_sub(APART), (i + APART).min(samples.len() - 1));
    let time_s = samples[after].t_s - samples[before].t_s;
    let change = a_m_s2[after] - a_m_s2[before];
    if time_s > 0.0 {
        (change / time_s).abs()
    } else {
        0.0
    }
}

/// Stiffness of the parts of a mechanism or of elements that the handle deflects.
fn stiffness_n_per_mm(law: &Law<'_>) -> f64 {
    match law {
        Law::Table { .. } => 0.0,
        Law::Mechanism(what) => {
            let own = what.scalars;
            own.contact_n_per_mm + own.handle_n / own.handle_slip_mm
        }
        Law::Elements(what) => {
            let stiffest = |(spring, profile): (&Spring, &&[f64])| {
                let most_n = profile.iter().copied().fold(0.0, f64::max);
                most_n / spring.slip_mm().unwrap_or(f64::INFINITY)
            };
            what.springs.iter().zip(&what.spring_n).map(stiffest).sum()
        }
    }
}

/// The smallest change of the position, mm.
fn step_mm(samples: &[Sample]) -> f64 {
    let changes = samples.windows(2).map(|w| (w[1].x_mm - w[0].x_mm).abs());
    changes
        .filter(|mm| *mm > 0.0)
        .reduce(f64::min)
        .unwrap_or(0.0)
}

/// Why lost and unjudged samples leave a playback open, if they do.
pub(super) fn too_much_lost(
    fidelity: &Fidelity,
    gap_s: f64,
    rules: &RenderingRules,
) -> Option<&'static str> {
    if fidelity.lost_share > Some(rules.max_lost_share) {
        Some("too many samples were lost")
    } else if gap_s > LONGEST_GAP_S {
        Some("the samples of too long a time were lost")
    } else if fidelity.judged_share < Some(rules.min_judged_share) {
        Some("the force of too many samples is not known")
    } else {
        None
    }
}

/// Whether what is not known about the force is as much as a verdict excludes.
pub(super) fn too_coarse(
    forces: &[Predicted],
    keep: &[bool],
    commanded: &Moments,
) -> Option<&'static str> {
    let kept = || forces.iter().zip(keep).filter(|(_, keep)| **keep);
    let square: f64 = kept().map(|(p, _)| p.doubt_n.powi(2)).sum();
    let doubt_n = (square / kept().count().max(1) as f64).sqrt();
    let known = doubt_n < MOST_DOUBT.0 * commanded.var_x()?.sqrt() && doubt_n < MOST_DOUBT.1;
    (!known).then_some(TOO_COARSE)
}

/// At which samples the direction of the motion is known. With the rule sign it can change
/// between two samples: it is known after one interval in the same direction and the time
/// that the slew limit takes for the largest change of the force.
pub(super) fn direction_known(
    played: &Played<'_>,
    samples: &[Sample],
    forces: &[Predicted],
    interval_s: f64,
) -> Vec<bool> {
    if !by_sign(played) {
        return vec![true; samples.len()];
    }
    let unknown_s = unknown_s(played, forces, interval_s);
    let mut changed_s = f64::NEG_INFINITY;
    let mut before_mm_s = 0.0;
    let known = samples.iter().map(|s| {
        if s.v_mm_s * before_mm_s <= 0.0 {
            changed_s = s.t_s;
        }
        before_mm_s = s.v_mm_s;
        s.t_s - changed_s >= unknown_s
    });
    known.collect()
}

/// For how long the force is not known after the direction has changed between two samples, s.
pub(super) fn unknown_s(played: &Played<'_>, forces: &[Predicted], interval_s: f64) -> f64 {
    let least_n = forces.iter().map(|p| p.force_n).fold(f64::MAX, f64::min);
    let most_n = forces.iter().map(|p| p.force_n).fold(f64::MIN, f64::max);
    1.5 * interval_s + (most_n - least_n) / played.servo.slew_n_s
}

pub(super) fn by_sign(played: &Played<'_>) -> bool {
    matches!(
        played.what.law,
        Law::Table {
            rule: Direction::Sign,
            ..
        }
    )
}

/// Which samples are compared: after the ramp and before the force falls, where the motion before is complete, where
/// the table's force is below its limit and its direction is known, with the rule sign in
/// motion.
pub(super) fn comparable(
    played: &Played<'_>,
    samples: &[Sample],
    forces: &[Predicted],
    known: &[bool],
) -> Vec<bool> {
    let from_s = played.servo.ramp_s + AFTER_RAMP_S;
    let limit_n = played.servo.force_n;
    let by_sign = by_sign(played);
    (samples.iter().zip(forces).zip(known))
        .map(|((s, p), known)| {
            let moves = s.v_mm_s.abs() > REST_MM_S;
            let free = p.force_n.abs() < limit_n - ROUNDING_N;
            let whole = s.t_s >= from_s && played.is_whole(s);
            whole && p.settled && free && *known && (!by_sign || moves)
        })
        .collect()
}

/// Why a playback cannot be judged, if it cannot.
pub(super) fn too_little(
    samples: &[Sample],
    keep: &[bool],
    interval_s: f64,
    commanded: &Moments,
    scale: Scale,
) -> Option<&'static str> {
    let compared = || {
        samples
            .iter()
            .zip(keep)
            .filter(|(_, keep)| **keep)
            .map(|(s, _)| s)
    };
    let lasting = |n: usize, least_s: f64| n as f64 * interval_s >= least_s;
    // An encoder that trembles between two steps moves nothing.
    let apart = ((WINDOW_S / interval_s) as usize).max(1);
    let ways = samples.windows(apart + 1).zip(keep);
    let ways = || {
        ways.clone()
            .filter(|(_, keep)| **keep)
            .map(|(w, _)| w[apart].x_mm - w[0].x_mm)
    };
    let moving = |sign: f64| ways().filter(|mm| sign * mm > REST_MM_S * WINDOW_S).count();
    let travel_mm = ways().map(f64::abs).sum::<f64>() / apart as f64;
    if interval_s > SLOW_S {
        Some("the device reports fewer than 400 samples per second")
    } else if !lasting(compared().count(), LEAST_S) {
        Some("too few samples after the ramp and below the limit")
    } else if ![1.0, -1.0]
        .iter()
        .all(|sign| lasting(moving(*sign), LEAST_MOTION_S))
    {
        Some("too little motion in one of the directions")
    } else if travel_mm < scale.travel_mm {
        Some("too little travel")
    } else if commanded
        .var_x()
        .is_none_or(|var| var < scale.force_n.powi(2))
    {
        Some("too little change of the force")
    } else {
        None
    }
}
