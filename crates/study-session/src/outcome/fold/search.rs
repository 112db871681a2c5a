//! What the searches of a session were told, and which points they present no more.

use super::{Attempt, History};
use crate::outcome::event::Failure;
use std::collections::BTreeMap;
use study_base::text::{ModelId, PartId};
use study_plan::procedure::search::{LeftOut, RecordedPair};
use study_plan::protocol::{Answer, SpaceRules, Stimuli, Trial};

/// So many attempts of searches have to fail at a point, with none between them in which it was played, before it is left out:
/// a fault that comes once is no fault of the point, and a trial is tried three times.
const FAILURES: u32 = 2;

/// Points at which the device failed.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Failing {
    /// Part and point: failures since it was played.
    failures: BTreeMap<(PartId, ModelId), u32>,
    /// Part and point that are presented no more, and how many trials of the part had been told.
    left_out: Vec<(PartId, ModelId, usize)>,
}

impl History {
    /// The completed trials of a part that searches, in the order in which the search was told.
    pub fn searched<'a>(
        &'a self,
        part: &'a PartId,
    ) -> impl Iterator<Item = (&'a Trial, &'a Attempt)> + 'a {
        self.told_of(move |trial| searches(trial, part))
    }

    /// The same as points of the space, with the answers that were given first; a correction changes the analysis, not the
    /// search. Trials of which the journal does not have two points are left out.
    pub fn compared(&self, part: &PartId, space: &SpaceRules) -> Vec<RecordedPair> {
        let point = |model: &ModelId| space.point_of(model);
        let recorded = |(_, attempt): (&Trial, &Attempt)| {
            let [first, second] = &attempt.models[..] else {
                return None;
            };
            let (first, second) = (point(first)?, point(second)?);
            let preferred = match &attempt.told {
                Some(Answer::Choice(chosen)) => match chosen.first().map(String::as_str) {
                    Some("first") => Some(first),
                    Some("second") => Some(second),
                    _ => None,
                },
                _ => None,
            };
            Some(RecordedPair {
                pair: [first.min(second), first.max(second)],
                preferred,
            })
        };
        self.searched(part).filter_map(recorded).collect()
    }

    /// The points that a search presents no more, in the order in which they were left out.
    pub fn left_out(&self, part: &PartId, space: &SpaceRules) -> Vec<LeftOut> {
        let own = self.failing.left_out.iter().filter(|out| out.0 == *part);
        let point = |(_, model, after): &(PartId, ModelId, usize)| {
            let (point, after) = (space.point_of(model)?, *after);
            Some(LeftOut { point, after })
        };
        own.filter_map(point).collect()
    }

    /// The points of a part at which the device failed so often that they are to be left out, and are not yet.
    pub fn to_leave_out(&self, part: &PartId) -> Vec<ModelId> {
        let failing = &self.failing;
        let is_out = |point: &ModelId| {
            let mut out = failing.left_out.iter();
            out.any(|out| out.0 == *part && out.1 == *point)
        };
        let often = |(at, failures): (&(PartId, ModelId), &u32)| {
            let often = at.0 == *part && *failures >= FAILURES && !is_out(&at.1);
            often.then(|| at.1.clone())
        };
        failing.failures.iter().filter_map(often).collect()
    }

    /// Counts a failure of the device at the interval that was loaded or played.
    pub(super) fn failed_at_point(&mut self, trial: u32, attempt: u32, failure: Failure) {
        let Some((part, attempt)) = self.of_search(trial, attempt) else {
            return;
        };
        let interval = match failure {
            Failure::DeviceFault | Failure::PlaybackLost => attempt.interval(),
            // It was judged after the interval had ended.
            Failure::Rendering => attempt.presentations.last().map(|p| p.interval),
            Failure::MarkedBad | Failure::Stopped | Failure::Interrupted | Failure::Media => None,
        };
        let index = interval.and_then(|interval| (interval as usize).checked_sub(1));
        if let Some(point) = index.and_then(|index| attempt.models.get(index)) {
            let at = (part.clone(), point.clone());
            *self.failing.failures.entry(at).or_default() += 1;
        }
    }

    /// Both points of an attempt were played.
    pub(super) fn played(&mut self, trial: u32, attempt: u32) {
        if let Some((part, attempt)) = self.of_search(trial, attempt) {
            let (part, points) = (part.clone(), attempt.models.clone());
            let failures = &mut self.failing.failures;
            failures.retain(|(of, point), _| *of != part || !points.contains(point));
        }
    }

    pub(super) fn leave_out(&mut self, part: &PartId, point: &ModelId) {
        let after = self.searched(part).count();
        let out = (part.clone(), point.clone(), after);
        self.failing.left_out.push(out);
    }

    /// Takes back what was told of some attempts. What was left out after them stays so.
    pub(super) fn untold(&mut self, which: impl Fn((u32, u32)) -> bool) {
        self.told.retain(|told| !which(*told));
        let mut left_out = std::mem::take(&mut self.failing.left_out);
        for (part, _, after) in &mut left_out {
            *after = (*after).min(self.searched(part).count());
        }
        self.failing.left_out = left_out;
    }

    /// The part of a trial that searches, and an attempt at it.
    fn of_search(&self, trial: u32, attempt: u32) -> Option<(&PartId, &Attempt)> {
        let part = self.planned(trial)?.part.as_ref();
        let part = part.filter(|part| self.planned(trial).is_some_and(|t| searches(t, part)))?;
        let attempts = &self.trials.get(&trial)?.attempts;
        Some((part, attempts.iter().find(|a| a.number == attempt)?))
    }
}

fn searches(trial: &Trial, part: &PartId) -> bool {
    trial.part.as_ref() == Some(part) && matches!(trial.stimuli, Stimuli::Search { .. })
}
