//! The forces that a right device may command at each sample of a playback.
//!
//! Where the motion determines the force, that is one force with its doubt. Where a table's
//! direction is not known, because the handle rests or turned among lost samples, it is any
//! force between its two branches. A state of a mechanism or of elements that is not known
//! leaves the force open: such samples, and those that were lost, are not judged. Where samples are
//! so far apart that the motion among them is anybody's guess, only a handle at rest is judged.

use super::comparable::{SLOW_S, by_sign, unknown_s};
use super::predicted::{GAP_S, Predicted, SETTLING_S, accelerations, predicted};
use super::{Played, REST_MM_S};
use crate::outcome::Sample;
use study_wire::predict::{BranchView, TableView};
use study_wire::servo::{Law, Rendering};

/// Share of the slew limit from which the force at a sample depends on what was between it and the
/// one before.
const STEEP: f64 = 0.25;

/// The forces that are right at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Band {
    /// Least and largest force, N.
    pub(super) ends_n: [f64; 2],
    /// Whether the forces are known at all.
    pub(super) judged: bool,
    /// Whether the motion determines the force, up to its doubt.
    pub(super) narrow: bool,
}

impl Band {
    /// By how much a force is outside of the band, N: below it negative.
    pub(super) fn beyond_n(&self, force_n: f64) -> f64 {
        let [low, high] = self.ends_n;
        force_n - force_n.min(high).max(low)
    }
}

/// The band at each sample; `forces` and `known` are those of the samples.
pub(super) fn bands(
    played: &Played<'_>,
    samples: &[Sample],
    forces: &[Predicted],
    known: &[bool],
    interval_s: f64,
) -> Vec<Band> {
    let sides = sides(played, samples);
    let quiet = quiet_s(samples);
    let still = still_s(samples);
    let unknown_s = unknown_s(played, forces, interval_s);
    let by_sign = by_sign(played);
    // Among lost samples the force was somewhere; from there the slew limit takes its time.
    let mut open: Option<([f64; 2], f64)> = None;
    let mut band = |i: usize| {
        let (force, sample) = (&forces[i], &samples[i]);
        let moves = sample.v_mm_s.abs() > REST_MM_S;
        let certain = match by_sign {
            true => (moves && known[i]) || quiet[i] >= unknown_s,
            false => force.remembered,
        };
        let [mut low, mut high] = [force.force_n; 2];
        if let (Some(sides), false) = (&sides, certain) {
            for side in sides {
                low = low.min(side[i].force_n);
                high = high.max(side[i].force_n);
            }
        }
        let gap_s = i
            .checked_sub(1)
            .map_or(0.0, |j| sample.t_s - samples[j].t_s);
        if gap_s > GAP_S {
            let [least_n, most_n] = force.ends_n;
            let slewed_s = (most_n - least_n) / played.servo.slew_n_s;
            open = Some((force.ends_n, sample.t_s + slewed_s));
        }
        // Where it changes about as fast as it can, it depends on the speed between the samples.
        let [least_n, most_n] = force.ends_n;
        if most_n - least_n > STEEP * played.servo.slew_n_s * interval_s {
            (low, high) = (low.min(least_n), high.max(most_n));
        }
        open = open.filter(|(_, until_s)| sample.t_s <= *until_s);
        if let Some(([least_n, most_n], _)) = open {
            (low, high) = (low.min(least_n), high.max(most_n));
        }
        Band {
            ends_n: [low - force.doubt_n, high + force.doubt_n],
            // The filters of a program go over a pause in one turn, each in its own way.
            judged: (sides.is_some() || certain)
                && (played.numbered || !force.after_gap)
                && (interval_s <= SLOW_S || still[i] >= SETTLING_S),
            narrow: certain && !force.after_gap,
        }
    };
    (0..samples.len()).map(&mut band).collect()
}

/// The forces of each branch of a table for the whole motion; `None` for what is no table.
fn sides(played: &Played<'_>, samples: &[Sample]) -> Option<[Vec<Predicted>; 2]> {
    let Law::Table { table, rule } = played.what.law else {
        return None;
    };
    let a_m_s2 = accelerations(samples, played.numbered);
    let side = |branch: BranchView<'_>| {
        let table = TableView {
            positive: branch,
            negative: branch,
            ..table
        };
        let what = Rendering {
            law: Law::Table { table, rule },
            ..played.what
        };
        let fades = played.faded_from_s;
        predicted(&what, played.stepped(), fades, samples, |i| a_m_s2[i])
    };
    Some([side(table.positive), side(table.negative)])
}

/// For how long the position has been the same at each sample, s.
fn still_s(samples: &[Sample]) -> Vec<f64> {
    let mut since: Option<&Sample> = None;
    let still = samples.iter().map(|here| {
        let begun = since
            .filter(|begun| begun.x_mm == here.x_mm)
            .unwrap_or(here);
        since = Some(begun);
        here.t_s - begun.t_s
    });
    still.collect()
}

/// For how long the encoder has not moved at each sample, s: the position is the same and the
/// speed, which is filtered, only decays. The direction cannot have changed meanwhile, and is known
/// if a speed was reported since samples were lost.
fn quiet_s(samples: &[Sample]) -> Vec<f64> {
    let mut since_s = f64::INFINITY;
    let mut before: Option<&Sample> = None;
    let mut direction_known = true;
    let quiet = samples.iter().map(|here| {
        let after_gap = before.is_some_and(|before| here.t_s - before.t_s > GAP_S);
        // A speed of zero does not tell its sign.
        direction_known = (direction_known && !after_gap) || here.v_mm_s != 0.0;
        let rests = before.is_some_and(|before| {
            here.x_mm == before.x_mm
                && here.v_mm_s * before.v_mm_s >= 0.0
                && here.v_mm_s.abs() <= before.v_mm_s.abs()
        });
        if !rests || !direction_known {
            since_s = here.t_s;
        }
        before = Some(here);
        here.t_s - since_s
    });
    quiet.collect()
}

/// Share of the time of a playback in which its force was judged; `None` without samples.
pub(super) fn judged_share(samples: &[Sample], bands: &[Band], interval_s: f64) -> Option<f64> {
    let (first, last) = (samples.first()?, samples.last()?);
    let judged = bands.iter().filter(|band| band.judged).count() as f64;
    let whole_s = last.t_s - first.t_s.min(0.0) + interval_s;
    (whole_s > 0.0).then(|| (judged * interval_s / whole_s).min(1.0))
}
