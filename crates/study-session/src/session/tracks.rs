//! What the next attempt presents: of a track, the level that follows from the answers so
//! far; of a search, its two points (`search`). Which practice has reached its criterion.

use super::Session;
use crate::outcome::{Event, Moment, TrackLevel};
use study_base::text::{ModelId, PartId};
use study_plan::procedure::{Recorded, Track};
use study_plan::protocol::{Interval, Part, Stimuli, TrackRules, Trial};

/// What an attempt presents.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Presenting {
    /// The realization of each interval.
    pub(super) models: Vec<ModelId>,
    pub(super) level: Option<TrackLevel>,
}

/// A track and what it has been told, so that it is not replayed for each trial.
#[derive(Debug)]
pub(super) struct Running {
    id: PartId,
    told: Vec<Recorded>,
    track: Track,
}

impl Session {
    /// The part of a trial; `None` in a study without parts.
    pub(super) fn part_of(&self, trial: &Trial) -> Option<&Part> {
        self.protocol.part(trial.part.as_ref()?)
    }

    /// What the next attempt at a trial presents; `None` if its track has ended.
    pub(super) fn presenting(&mut self, trial: &Trial) -> Option<Presenting> {
        let (track, intervals, easy) = match &trial.stimuli {
            Stimuli::One { model } => return Some(Presenting::of(vec![model.clone()])),
            Stimuli::Rated { reference, model } => {
                return Some(Presenting::of(vec![reference.clone(), model.clone()]));
            }
            Stimuli::Pair { pair } => return Some(Presenting::of(pair.to_vec())),
            Stimuli::Set { set } => return Some(Presenting::of(set.clone())),
            Stimuli::Adjusted { start, standard } => {
                let models = standard.iter().chain([start]).cloned();
                return Some(Presenting::of(models.collect()));
            }
            Stimuli::Search { swapped, .. } => {
                let models = self.searched(trial, *swapped)?;
                return Some(Presenting::of(models));
            }
            Stimuli::Track {
                track,
                intervals,
                easy,
            } => (track, intervals, *easy),
        };
        let protocol = self.protocol.clone();
        let rules = protocol.track(track)?;
        let ladder = protocol.ladder(rules);
        let proposal = self.track(rules)?.next()?;
        let ruled = !easy && !rules.method.is_catch(intervals);
        let step = match easy {
            true => ladder.levels().len() - 1,
            false => proposal.step,
        };
        let comparison = protocol.comparison(rules, step)?;
        let standard = rules.standard();
        let model = |interval: &Interval| match interval {
            Interval::Standard => standard.clone(),
            Interval::Comparison => comparison.clone(),
        };
        Some(Presenting {
            models: intervals.iter().map(model).collect(),
            level: Some(TrackLevel {
                proposed: ruled.then_some(proposal.level),
                presented: ladder.level(step),
            }),
        })
    }

    /// A track after all that it has been told.
    fn track(&mut self, rules: &TrackRules) -> Option<&Track> {
        let seat = self.history.start()?.seat;
        let told = self.history.recorded(rules);
        let known = self.running.iter().position(|r| r.id == rules.id);
        let known = known.filter(|at| told.starts_with(&self.running[*at].told));
        let at = match known {
            Some(at) => at,
            None => {
                let track = self.protocol.start(rules, seat).ok()?;
                self.running.retain(|r| r.id != rules.id);
                self.running.push(Running {
                    id: rules.id.clone(),
                    told: Vec::new(),
                    track,
                });
                self.running.len() - 1
            }
        };
        let running = &mut self.running[at];
        for new in &told[running.told.len()..] {
            running.track.answer(&new.answer);
        }
        running.told = told;
        Some(&self.running[at].track)
    }

    /// Ends the practice to which the next trial belongs, if its criterion is reached.
    pub(super) fn end_practice(&mut self, at: Moment) {
        let next = self.history.next_trial().filter(|t| t.practice);
        let Some(part) = next.and_then(|t| self.part_of(t)) else {
            return;
        };
        let criterion = part.task.identification().and_then(|own| own.criterion);
        if criterion.is_some_and(|c| c.is_reached(&self.history.practiced(part))) {
            let part = part.id.clone();
            self.record(Event::PracticeEnded { part }, at);
        }
    }

    /// Ends the track of the next trial, if its rule proposes nothing more, and so on.
    pub(super) fn end_tracks(&mut self, at: Moment) {
        let protocol = self.protocol.clone();
        while let Some(next) = self.history.next_trial()
            && let Some(rules) = next.track().and_then(|id| protocol.track(id))
            && let Some(track) = self.track(rules)
            && track.next().is_none()
        {
            let finished = track.summary().finished;
            let track = rules.id.clone();
            self.record(Event::TrackEnded { track, finished }, at);
        }
    }
}

impl Presenting {
    fn of(models: Vec<ModelId>) -> Self {
        Self {
            models,
            level: None,
        }
    }
}
