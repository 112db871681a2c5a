//! Who it is, the claim, and how a session is begun or picked up.

use super::phase::Phase;
use super::{Claim, ClaimFacts, Effect, Session};
use crate::outcome::{Choice, Entry, Event, Failure, Moment, Start, State};
use crate::schedule;
use study_base::text::ParticipantId;

/// Longest operator code, characters.
pub const MAX_OPERATOR: usize = 64;

impl Session {
    pub(super) fn identify(&mut self, participant: &str, operator: &str) {
        self.participant = participant.trim().to_owned();
        self.operator = operator.trim().to_owned();
        if self.operator.chars().count() > MAX_OPERATOR {
            return self.say(format!("operator: at most {MAX_OPERATOR} characters"));
        }
        match ParticipantId::new(self.participant.as_str()) {
            Err(_) if self.participant.is_empty() => self.say("who takes part? type an id"),
            Err(why) => self.say(why.to_string()),
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
            self.phase = Phase::Who;
            self.claim = None;
            self.opened = None;
            let why = self.safe(why);
            self.say(why);
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
            seat: claim.seat,
            device_kind: claim.device_kind,
            device_id: claim.device_id.clone(),
            device_telemetry: claim.device_telemetry,
        });
        if !claim.notices.is_empty() {
            let notices = self.safe(&claim.notices.join(" · "));
            self.say(notices);
        }
        if claim.entries.is_empty() {
            self.start(claim, at);
        } else {
            self.pick_up(&claim.entries, at);
        }
    }

    fn start(&mut self, claim: Claim, at: Moment) {
        let planned = schedule::plan(&self.protocol, self.orders.as_deref(), claim.seat);
        match planned {
            Err(why) => {
                self.claim_refused(&format!("there is no order: {why}"));
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
                    tool_version: tool_version(),
                    protocol_version: claim.protocol_version,
                    fingerprints: claim.fingerprints,
                    schedule,
                };
                self.record(Event::SessionStarted(Box::new(start)), at);
                self.phase = Phase::Saving;
            }
        }
    }

    fn pick_up(&mut self, entries: &[Entry], at: Moment) {
        for entry in entries {
            self.history.apply(&entry.event, entry.at);
        }
        if !self.history.started {
            self.history = Default::default();
            return self.claim_refused(
                "the journal of this session has no beginning; `study verify` says more",
            );
        }
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

    /// Wall-clock seconds since somebody last took part. Remarks and what was
    /// done from outside are no part of it.
    fn gap_s(&self, at: Moment) -> f64 {
        self.history
            .last_activity
            .map_or(0.0, |last| (at.wall - last.wall).as_seconds_f64().max(0.0))
    }

    pub(super) fn resume(&mut self, choice: Choice, at: Moment) {
        if let Phase::ResumeChoice { gap_s } = self.phase {
            self.reopen(gap_s, Some(choice), at);
        }
    }

    /// An attempt that had not ended is given up and comes next; one that waits
    /// for its rating waits on, unless its block starts again.
    fn reopen(&mut self, gap_s: f64, choice: Option<Choice>, at: Moment) {
        let restart = choice == Some(Choice::RestartBlock);
        if let Some(open) = &self.history.open
            && (restart || open.ended.is_none())
        {
            let why = if restart {
                "the block starts again"
            } else {
                "the program ended during it"
            };
            self.fail(Failure::Interrupted, why, at);
        }
        let max = self.protocol.design.max_attempts.max(1);
        for (trial, attempt) in self.history.owed_closings(max) {
            self.record(Event::TrialClosed { trial, attempt }, at);
        }
        let queue = if restart {
            self.history.restarted_queue()
        } else {
            self.history.queue.clone()
        };
        let device_id = self.claim.as_ref().map(|c| c.device_id.clone());
        let reopened = Event::Reopened {
            operator: self.operator.clone(),
            tool_version: tool_version(),
            device_id: device_id.unwrap_or_default(),
            gap_s,
            choice,
            queue,
        };
        self.record(reopened, at);
        if choice == Some(Choice::DropOut) {
            self.drop_out("did not come back", at);
        }
        self.phase = Phase::Saving;
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
