//! How far a session is, for the experimenter's desk.

use super::Session;
use super::view::Course;
use chrono::{DateTime, FixedOffset};
use std::collections::BTreeSet;
use study_base::text::PartId;

/// Completed trials from which on the pace is known.
const LEAST_TRIALS: usize = 3;

impl Session {
    pub(super) fn course(&self) -> Course {
        let history = &self.history;
        let done = history.closed(false);
        let total = self.total(false).filter(|_| history.start().is_some());
        let trial = match history.open() {
            Some(open) => Some(open.trial),
            None => history.next_trial(),
        };
        Course {
            session: self.claim.as_ref().map_or(0, |claim| claim.session),
            part: trial.and_then(|trial| self.place_of(trial.part.as_ref()?)),
            done,
            total,
            minimum_strokes: trial.map_or(0, |trial| self.minimum_strokes(trial)),
            left_s: total.and_then(|total| self.left_s(total.saturating_sub(done))),
        }
    }

    /// The place of a part in the session, and the number of parts, if none comes back after another.
    fn place_of(&self, part: &PartId) -> Option<(u32, u32)> {
        let counted = self.history.schedule().iter().filter(|t| !t.practice);
        let mut order: Vec<&PartId> = counted.filter_map(|t| t.part.as_ref()).collect();
        order.dedup();
        let distinct: BTreeSet<&PartId> = order.iter().copied().collect();
        if distinct.len() < order.len() {
            return None;
        }
        let at = order.iter().position(|p| *p == part)?;
        let number = |n: usize| u32::try_from(n).ok();
        Some((number(at + 1)?, number(order.len())?))
    }

    /// How long so many trials take, s: by the median time from the end of one to the end of the next,
    /// which a break or a pause does not change.
    fn left_s(&self, trials: u32) -> Option<f64> {
        let counted = self.history.schedule().iter().filter(|t| !t.practice);
        let ended = counted.filter_map(|t| Some(self.history.completion(t.trial)?.1.at.wall));
        let mut ended: Vec<DateTime<FixedOffset>> = ended.collect();
        if ended.len() < LEAST_TRIALS {
            return None;
        }
        ended.sort_unstable();
        let gap = |pair: &[DateTime<FixedOffset>]| (pair[1] - pair[0]).as_seconds_f64();
        let mut gaps: Vec<f64> = ended.windows(2).map(gap).collect();
        gaps.sort_unstable_by(f64::total_cmp);
        Some(gaps[gaps.len() / 2] * f64::from(trials))
    }
}
