//! Identification, the claim, and the start or resumption of a session.

use super::phase::Phase;
use super::{Claim, ClaimFacts, Effect, Session};
use crate::outcome::fold::History;
use crate::outcome::{Choice, Entry, Event, Failure, Moment, Start, State};
use std::sync::Arc;
use study_base::text::{ParticipantId, counted};
use study_plan::protocol::{Assigned, Stimuli, Trial};
use study_plan::schedule;

/// Longest operator code, in characters.
pub const MAX_OPERATOR: usize = 64;

impl Session {
    pub(super) fn identify(&mut self, participant: &str, operator: &str) {
        self.participant = participant.trim().to_owned();
        self.operator = operator.trim().to_owned();
        if self.operator.chars().count() > MAX_OPERATOR {
            return self.notify(format!("operator: at most {MAX_OPERATOR} characters"));
        }
        match ParticipantId::new(self.participant.as_str()) {
            Err(_) if self.participant.is_empty() => self.notify("type the participant's id"),
            Err(why) => self.notify(why.to_string()),
            Ok(participant) => {
                self.phase = Phase::Claiming;
                self.out.push(Effect::Claim {
                    participant,
                    operator: self.operator.clone(),
                });
            }
        }
    }

    pub(super) fn claim_refused(&mut self, why: &str) {
        if matches!(self.phase, Phase::Claiming) {
            self.phase = Phase::Identify;
            self.claim = None;
            self.opened = None;
            let why = self.sanitized(why);
            self.notify(why);
        }
    }

    pub(super) fn claimed(&mut self, claim: Claim, at: Moment) {
        if !matches!(self.phase, Phase::Claiming) {
            return;
        }
        self.opened = Some(at);
        self.clock = at;
        self.participant = claim.participant.to_string();
        self.claim = Some(ClaimFacts {
            session: claim.session,
            seat: claim.seat,
            device_kind: claim.device_kind,
            device_id: claim.device_id.clone(),
            device_telemetry: claim.device_telemetry,
            self_weighed: claim.self_weighed.clone(),
        });
        if !claim.notices.is_empty() {
            let notices = self.sanitized(&claim.notices.join(" · "));
            self.notify(notices);
        }
        if claim.entries.is_empty() {
            self.start(claim, at);
        } else {
            self.resume_from(&claim.entries, at);
        }
    }

    fn start(&mut self, claim: Claim, at: Moment) {
        self.take_part(&claim.assigned);
        let planned = schedule::plan(&self.protocol, self.orders.as_deref(), claim.seat);
        match planned {
            Err(why) => {
                self.claim_refused(&format!("the order cannot be made: {why}"));
            }
            Ok(schedule) => {
                let start = Start {
                    study: self.protocol.study.id.clone(),
                    participant: claim.participant,
                    session: claim.session,
                    seat: claim.seat,
                    operator: self.operator.clone(),
                    device_kind: claim.device_kind,
                    device_id: claim.device_id,
                    device_check: claim.device_check,
                    front: self.front.clone(),
                    tool_version: tool_version(),
                    protocol_version: claim.protocol_version,
                    fingerprints: claim.fingerprints,
                    schedule,
                    assigned: claim.assigned,
                };
                self.record(Event::SessionStarted(Box::new(start)), at);
                self.record_self_weighed(at);
                self.phase = Phase::Saving;
            }
        }
    }

    /// Records what the motor told of itself before the session, after the event that opens it.
    fn record_self_weighed(&mut self, at: Moment) {
        let weighed = self.claim.as_ref().and_then(|c| c.self_weighed.clone());
        if let Some(weighed) = weighed {
            self.record(Event::SelfWeighed(Box::new(weighed)), at);
        }
    }

    fn resume_from(&mut self, entries: &[Entry], at: Moment) {
        self.history = History::of(entries);
        let Some(start) = self.history.start() else {
            self.history = History::default();
            return self.claim_refused(
                "the start of this session is missing from its journal; run `study verify`",
            );
        };
        let assigned = start.assigned.clone();
        self.take_part(&assigned);
        if self.history.over() {
            self.phase = Phase::End;
            return;
        }
        let gap_s = self.gap_s(at);
        if gap_s > self.protocol.session.resume_within_h * 3600.0 {
            self.phase = Phase::ResumeChoice { gap_s };
        } else {
            self.reopen(gap_s, None, at);
        }
    }

    /// From now on, the protocol is that of this group and planned session.
    pub(super) fn take_part(&mut self, assigned: &Assigned) {
        if *assigned != Assigned::default() {
            self.protocol = Arc::new(self.protocol.of(assigned));
        }
    }

    /// Wall-clock time since the last activity, s.
    fn gap_s(&self, at: Moment) -> f64 {
        self.history
            .last_activity
            .map_or(0.0, |last| (at.wall - last.wall).as_seconds_f64().max(0.0))
    }

    pub(super) fn resume(&mut self, choice: Choice, at: Moment) {
        if let Phase::ResumeChoice { gap_s } = self.phase {
            if choice == Choice::RestartBlock && !self.can_restart() {
                return self.notify(
                    "a search is not restarted: its answers so far lead to the next pairs",
                );
            }
            self.reopen(gap_s, Some(choice), at);
        }
    }

    /// Whether the block under way can be restarted. A search is one block, all of whose answers would be lost.
    pub(super) fn can_restart(&self) -> bool {
        let next = self.history.next_trial();
        !next.is_some_and(|trial| matches!(trial.stimuli, Stimuli::Search { .. }))
    }

    /// Records the resumption. An attempt whose playback had not ended fails and its
    /// trial comes next, as does one that was felt too long ago; another one that waits
    /// for its rating stays open unless its block is restarted.
    fn reopen(&mut self, gap_s: f64, choice: Option<Choice>, at: Moment) {
        let restart = choice == Some(Choice::RestartBlock);
        if let Some(open) = self.history.open()
            && (restart || open.attempt.ended.is_none())
        {
            let why = if restart {
                "the block starts again"
            } else {
                "the program ended during it"
            };
            self.fail(Failure::Interrupted, why, at);
        }
        self.came_back(at);
        if self.comes_too_late() {
            self.feel_again(at);
        }
        for (trial, attempt) in self.unrecorded_closings() {
            self.record(Event::TrialClosed { trial, attempt }, at);
        }
        let queue = if restart {
            self.restarted_queue()
        } else {
            self.history.queue.to_vec()
        };
        let planned = |trial: &u32| self.history.planned(*trial).cloned();
        let to_come: Vec<_> = queue.iter().filter_map(planned).collect();
        let part = to_come.first().and_then(|t| t.part.as_ref());
        let design = self.protocol.design_of(part);
        let constraint_broken =
            restart && schedule::breaks_constraint(&self.felt(), &to_come, &design);
        let device_id = self.claim.as_ref().map(|c| c.device_id.clone());
        let reopened = Event::Reopened {
            operator: self.operator.clone(),
            tool_version: tool_version(),
            device_id: device_id.unwrap_or_default(),
            front: self.front.clone(),
            gap_s,
            choice,
            queue,
            constraint_broken,
        };
        self.record(reopened, at);
        self.record_self_weighed(at);
        let saved = self.history.completed().count();
        let greeting = match self.total(false) {
            Some(total) => format!("welcome back: {saved} of {total} trials are saved"),
            None => format!("welcome back: {} saved", counted(saved, "trial", "trials")),
        };
        self.notice = Some(match self.notice.take() {
            Some(notice) => format!("{notice} · {greeting}"),
            None => greeting,
        });
        if choice == Some(Choice::DropOut) {
            self.drop_out("did not come back", at);
        }
        self.phase = Phase::Saving;
    }

    /// Trials, each with its last attempt, that failed too often although their
    /// closing is not in the journal: the program ended between the two events.
    fn unrecorded_closings(&self) -> Vec<(u32, u32)> {
        let history = &self.history;
        let max = self.protocol.design.max_attempts.max(1);
        let given_up = |trial: &u32| {
            !history.is_closed(*trial)
                && history.failures(*trial) >= max
                && !history.queue.contains(trial)
        };
        let trials = history.schedule().iter().map(|t| t.trial);
        trials
            .filter(given_up)
            .map(|trial| (trial, history.attempts(trial)))
            .collect()
    }

    /// The queue after a restart of the block under way: all its trials as planned,
    /// then the others that are still to come. The practice of each part is a block of its own.
    fn restarted_queue(&self) -> Vec<u32> {
        let history = &self.history;
        let Some(next) = history.next_trial() else {
            return Vec::new();
        };
        let same = |t: &Trial| t.block == next.block && t.part == next.part;
        let in_block = |trial: &u32| history.planned(*trial).is_some_and(same);
        let again = history.schedule().iter().filter(|t| same(t));
        let again: Vec<u32> = again.map(|t| t.trial).collect();
        let mut later: Vec<u32> = (history.queue.iter().copied())
            .filter(|t| !in_block(t))
            .collect();
        let dropped = self.dropped(&again);
        if !dropped.is_empty() {
            later.extend(dropped.iter().map(|t| t.trial).filter(|t| !in_block(t)));
            later.sort_unstable();
        }
        again.into_iter().chain(later).collect()
    }

    pub(super) fn drop_out(&mut self, reason: &str, at: Moment) {
        let state = Event::StateSet {
            state: State::DroppedOut,
            reason: reason.to_owned(),
        };
        self.record(state, at);
    }
}

fn tool_version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}
