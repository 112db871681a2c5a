//! Where the recordings moved the follower, and what a mechanism is elsewhere: its detents and
//! its friction keep the last value that the data support, or are a line between two.
//!
//! A value that no data reached is whatever the ridge left: at an edge it can be many times
//! the force of the target, and a faster hand than the recorded one takes the follower there.

use super::{STARTED_HZ, follow};
use crate::identify::samples::{Weights, weight_of};
use crate::model::{Mechanism, Profile};
use crate::recording::Recording;

/// A node is reached if the follower was this long within half a step of it, s.
const LEAST_S: f64 = 0.02;

/// The positions of the follower on the recordings.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reach {
    /// Lowest and highest position, mm.
    pub(super) range_mm: [f64; 2],
    /// Which nodes of the detents are reached.
    nodes: Vec<bool>,
}

/// The reach of a mechanism on the samples whose weight is not 0.
pub(super) fn of(mechanism: &Mechanism, recordings: &[&Recording], weights: Weights<'_>) -> Reach {
    let detent = &mechanism.detent;
    let mut range_mm = [f64::INFINITY, f64::NEG_INFINITY];
    let mut time_s = vec![0.0; detent.n.len()];
    for (r, recording) in recordings.iter().enumerate() {
        let mut i = 0;
        let sample_s = recording.duration_s() / recording.len() as f64;
        follow(
            &mechanism.view(),
            recording,
            recording.len(),
            STARTED_HZ,
            |state| {
                i += 1;
                if weight_of(weights, r, i - 1) == 0.0 {
                    return;
                }
                let y_mm = state.y_mm();
                range_mm = [range_mm[0].min(y_mm), range_mm[1].max(y_mm)];
                let node = ((y_mm - detent.first_mm) / detent.step_mm).round();
                // a negative or infinite one is the first or last
                let node = (node as usize).min(time_s.len() - 1);
                time_s[node] += sample_s;
            },
        );
    }
    Reach {
        range_mm,
        nodes: time_s.iter().map(|time_s| *time_s >= LEAST_S).collect(),
    }
}

/// The mechanism with profiles that end at the last nodes that are reached; beyond its ends a
/// profile is constant.
pub(super) fn held(mechanism: &Mechanism, reach: &Reach) -> Mechanism {
    let first = reach.nodes.iter().position(|reached| *reached);
    let last = reach.nodes.iter().rposition(|reached| *reached);
    let (Some(first), Some(last)) = (first, last) else {
        return mechanism.clone();
    };
    // a profile has two values at least
    let last = last.max(first + 1).min(reach.nodes.len() - 1);
    let first = first.min(last - 1);
    let (old, friction) = (&mechanism.detent, &mechanism.friction);
    let detent = Profile {
        first_mm: old.first_mm + first as f64 * old.step_mm,
        step_mm: old.step_mm,
        n: old.n[first..=last].to_vec(),
    };
    let span_mm = (last - first) as f64 * old.step_mm;
    let intervals = (span_mm / friction.step_mm).ceil();
    let step_mm = span_mm / intervals;
    let at = |i: usize| {
        friction
            .view()
            .linear_n(detent.first_mm + i as f64 * step_mm)
    };
    Mechanism {
        friction: Profile {
            first_mm: detent.first_mm,
            step_mm,
            n: (0..=intervals as usize).map(at).collect(),
        },
        detent,
        ..mechanism.clone()
    }
}

/// The mechanism with a line across nodes that are not reached, between two that are.
pub(super) fn bridged(mut mechanism: Mechanism, reach: &Reach) -> Mechanism {
    let n = &mut mechanism.detent.n;
    let reached: Vec<usize> = (0..n.len()).filter(|i| reach.nodes[*i]).collect();
    for pair in reached.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        for i in from + 1..to {
            let share = (i - from) as f64 / (to - from) as f64;
            n[i] = n[from] + share * (n[to] - n[from]);
        }
    }
    mechanism
}
