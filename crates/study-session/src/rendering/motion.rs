//! The motion of the handle in a playback, and whether its samples are in order.

use super::comparable::SLOW_S;
use super::predicted::GAP_S;
use super::search::delay;
use super::{Played, REST_MM_S, WINDOW_S, share};
use crate::outcome::{Fidelity, Sample};

/// A longer time between two samples than this many usual ones is no jitter.
const JITTER: f64 = 2.0;

/// The finite samples with ascending times.
pub(super) fn in_order(samples: &[Sample]) -> Vec<Sample> {
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
pub(super) fn interval(samples: &[Sample]) -> Option<f64> {
    let mut all: Vec<f64> = samples.windows(2).map(|w| w[1].t_s - w[0].t_s).collect();
    let middle = all.len() / 2;
    (!all.is_empty()).then(|| *all.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The longest time without samples, s, also before the first one.
pub(super) fn longest_gap_s(samples: &[Sample], interval_s: f64) -> f64 {
    let first_s = samples.first().map_or(0.0, |first| first.t_s);
    let gaps = samples.windows(2).map(|w| w[1].t_s - w[0].t_s - interval_s);
    gaps.fold(first_s.max(0.0), f64::max)
}

/// Turns of a program's loop that did not come: what a pause leaves out that is longer than
/// jitter and than the pauses after which filters settle again.
pub(super) fn turns_lost(samples: &[Sample], interval_s: f64) -> f64 {
    let least_s = GAP_S.max(JITTER * interval_s);
    let pauses = samples.windows(2).map(|w| w[1].t_s - w[0].t_s);
    let late = pauses.filter(|pause_s| *pause_s > least_s);
    late.map(|pause_s| pause_s / interval_s - 1.0).sum()
}

/// Whether more samples are missing than the device says.
pub(super) fn unexplained_gaps(samples: &[Sample], lost: u64, interval_s: f64) -> bool {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return false;
    };
    let due = (last.t_s - first.t_s) / interval_s + 1.0;
    due > 1.1 * (samples.len() as f64 + lost as f64) + 50.0
}

/// Travel, range, speeds and the time in motion.
pub(super) fn explore(
    played: &Played<'_>,
    samples: &[Sample],
    interval_s: f64,
    fidelity: &mut Fidelity,
) {
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

/// By how much later than the change of the position the speed of a program comes, ms: its forces are
/// predicted with that speed.
pub(super) fn speed_late_ms(samples: &[Sample], interval_s: f64) -> Option<f64> {
    let change = |i: usize| {
        let (before, after) = (samples.get(i.checked_sub(1)?)?, samples.get(i + 1)?);
        let time_s = after.t_s - before.t_s;
        (time_s < 2.0 * GAP_S).then(|| (after.x_mm - before.x_mm) / time_s)
    };
    let lag = delay(samples, interval_s, |i| {
        Some([change(i)?, samples[i].v_mm_s])
    })?;
    Some(1e3 * interval_s * lag.steps)
}

/// Share of moving samples that repeat the one before.
pub(super) fn repeated(samples: &[Sample]) -> Option<f64> {
    let moving = |w: &&[Sample]| w[1].v_mm_s.abs() > 4.0 * REST_MM_S;
    let same = |w: &&[Sample]| {
        (w[0].x_mm, w[0].v_mm_s, w[0].force_command_n)
            == (w[1].x_mm, w[1].v_mm_s, w[1].force_command_n)
    };
    let all = samples.windows(2).filter(moving).count();
    let repeats = samples.windows(2).filter(moving).filter(same).count();
    share(repeats as f64, all as f64)
}
