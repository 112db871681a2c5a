//! Groups and repeated sessions: which group a participant belongs to, and which session
//! comes next, after which gap.

use super::error::{StoreError, when};
use super::sessions::SessionData;
use crate::outcome::State;
use chrono::{DateTime, FixedOffset, TimeDelta};
use study_base::text::{PartId, ParticipantId};
use study_plan::protocol::{Assign, Assigned, Confirms, Groups, Protocol, Seat, SessionPlan};

/// What a claim needs of the protocol: groups, repeated sessions, and who cannot take part.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plan {
    /// The seed of the study.
    pub seed: u64,
    /// `[groups]`
    pub groups: Option<Groups>,
    /// `[[sessions]]`
    pub sessions: Vec<SessionPlan>,
    /// `[confirms]`
    pub confirms: Option<Confirms>,
    /// The group that the experimenter gives to a new participant.
    pub given: Option<PartId>,
    /// The time of the claim; `None`: gaps are not known.
    pub now: Option<DateTime<FixedOffset>>,
}

impl Plan {
    /// That of a protocol, for a claim at this time.
    pub fn of(protocol: &Protocol, given: Option<PartId>, now: DateTime<FixedOffset>) -> Self {
        Self {
            seed: protocol.study.seed,
            groups: protocol.groups.clone(),
            sessions: protocol.sessions.clone(),
            confirms: protocol.confirms.clone(),
            given,
            now: Some(now),
        }
    }

    /// The group of a new participant to whom none is given. Simulated ones take the groups
    /// in turn, where the experimenter would give them.
    pub(super) fn group_of(&self, seat: Seat) -> Option<PartId> {
        let groups = self.groups.as_ref()?;
        let in_turn = || {
            let at = seat.number().saturating_sub(1) as usize % groups.list.len().max(1);
            groups.list.get(at).map(|g| &g.id)
        };
        groups.of_seat(self.seed, seat).or_else(in_turn).cloned()
    }
}

/// Sessions that a participant has finished.
pub(super) fn done(own: &[&SessionData]) -> usize {
    own.iter().filter(|s| s.is_done()).count()
}

/// What a participant can do next.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// Begin or go on with a session.
    Session {
        /// Its id; `None` in a study without repeated sessions.
        session: Option<PartId>,
        /// Time since the session before, h; `None` for the first one.
        gap_h: Option<f64>,
    },
    /// The gap before the next session is not over.
    TooEarly {
        /// Identifier of the next session.
        session: PartId,
        /// When it is.
        from: DateTime<FixedOffset>,
        /// Time since the session before, h.
        gap_h: f64,
    },
    /// The gap has become longer than planned.
    Late {
        /// Identifier of the next session.
        session: PartId,
        /// Time since the session before, h.
        gap_h: f64,
        /// The longest planned one, h.
        most: f64,
    },
    /// Nothing: all sessions are done, or the participant has left.
    Nothing,
}

/// What a participant with these sessions can do next, by the state of the last session
/// and the gap since the one before it.
pub fn next_session(own: &[&SessionData], plan: &Plan) -> Next {
    let state = own.last().map(|s| s.standing().state);
    if !matches!(
        state,
        None | Some(State::Done | State::Void | State::Unfinished)
    ) {
        return Next::Nothing;
    }
    let before = own.iter().rfind(|s| s.is_done());
    let Some(next) = plan.sessions.get(done(own)) else {
        let never = before.is_none() && plan.sessions.is_empty();
        return match never {
            true => Next::Session {
                session: None,
                gap_h: None,
            },
            false => Next::Nothing,
        };
    };
    let session = next.id.clone();
    let ended = before
        .and_then(|s| s.history.last_activity)
        .map(|at| at.wall);
    let (Some(ended), Some(now)) = (ended, plan.now) else {
        return Next::Session {
            session: Some(session),
            gap_h: None,
        };
    };
    let gap_h = (now - ended).as_seconds_f64() / 3600.0;
    // An unfinished one has begun; its gap is in its journal.
    let has_begun = own.last().is_some_and(|s| s.history.start().is_some());
    if state == Some(State::Unfinished) && has_begun {
        return Next::Session {
            session: Some(session),
            gap_h: None,
        };
    }
    if gap_h < next.min_gap_h {
        let wait = TimeDelta::milliseconds((next.min_gap_h * 3.6e6).round() as i64);
        return Next::TooEarly {
            session,
            from: ended + wait,
            gap_h,
        };
    }
    match next.max_gap_h.filter(|most| gap_h > *most) {
        Some(most) => Next::Late {
            session,
            gap_h,
            most,
        },
        None => Next::Session {
            session: Some(session),
            gap_h: Some(gap_h),
        },
    }
}

/// When somebody who has finished a session comes again: the window of the next session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Return {
    /// Identifier of the next session.
    pub session: PartId,
    /// The earliest time.
    pub from: DateTime<FixedOffset>,
    /// The latest time; `None` if no longest gap is planned.
    pub until: Option<DateTime<FixedOffset>>,
}

/// Where a moment lies in the window of a session. The most urgent comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Due {
    /// After its end.
    Overdue,
    /// In it.
    Now,
    /// Before it.
    Later,
}

impl Due {
    /// The word for it.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Overdue => "overdue",
            Self::Now => "due",
            Self::Later => "later",
        }
    }
}

impl Return {
    /// Where a moment lies in the window.
    pub fn due(&self, now: DateTime<FixedOffset>) -> Due {
        match self.until {
            Some(until) if now > until => Due::Overdue,
            _ if now < self.from => Due::Later,
            _ => Due::Now,
        }
    }
}

/// The window of the next session of a participant with these sessions, who has finished one
/// and begun no other since; `None` of anybody else, and if [`Plan::now`] is not known.
pub fn comes_again(own: &[&SessionData], plan: &Plan) -> Option<Return> {
    let session = match next_session(own, plan) {
        Next::Session {
            session: Some(session),
            gap_h: Some(_),
        }
        | Next::TooEarly { session, .. }
        | Next::Late { session, .. } => session,
        Next::Session { .. } | Next::Nothing => return None,
    };
    let planned = plan.sessions.iter().find(|s| s.id == session)?;
    let before = own.iter().rfind(|s| s.is_done())?;
    let ended = before.history.last_activity?.wall;
    Some(Return {
        session,
        from: later(ended, planned.min_gap_h)?,
        until: planned.max_gap_h.and_then(|gap_h| later(ended, gap_h)),
    })
}

/// The time so many hours later; `None` beyond the calendar.
fn later(at: DateTime<FixedOffset>, hours: f64) -> Option<DateTime<FixedOffset>> {
    let gap = TimeDelta::try_milliseconds((hours * 3.6e6).round() as i64)?;
    at.checked_add_signed(gap)
}

impl Next {
    /// What the operator is told of the gap.
    pub(super) fn notice(&self) -> Option<String> {
        match self {
            Self::TooEarly { session, from, .. } => Some(format!(
                "session {session} is not planned before {}",
                when(*from)
            )),
            Self::Late {
                session,
                gap_h,
                most,
            } => Some(format!(
                "session {session} comes {gap_h:.0} h after the one before; planned were {most} h at most"
            )),
            Self::Session { .. } | Self::Nothing => None,
        }
    }

    /// What the first screen says of somebody who has finished a session; `None` of whoever
    /// has not, or is not to come again. `all` is the number of planned sessions.
    pub fn of_finished(&self, all: usize) -> Option<String> {
        match self {
            Self::Session {
                session: Some(session),
                gap_h: Some(_),
            } => Some(format!("next: session {session}, one of {all}")),
            Self::TooEarly { session, from, .. } => Some(format!(
                "session {session} is planned from {} on",
                when(*from)
            )),
            Self::Late {
                session,
                gap_h,
                most,
            } => Some(format!(
                "next: session {session}, after {gap_h:.0} h instead of {most} at most"
            )),
            Self::Session { .. } | Self::Nothing => None,
        }
    }

    /// That of a new session, with the participant's group.
    pub(super) fn assigned(&self, group: Option<PartId>) -> Assigned {
        let (session_id, gap_h) = match self {
            Self::Session { session, gap_h } => (session.clone(), *gap_h),
            Self::TooEarly { session, gap_h, .. } | Self::Late { session, gap_h, .. } => {
                (Some(session.clone()), Some(*gap_h))
            }
            Self::Nothing => (None, None),
        };
        Assigned {
            group,
            session_id,
            gap_h,
        }
    }
}

/// The group of a participant, as far as it does not follow from the seat: that of earlier
/// sessions, or the one that the experimenter gives.
///
/// # Errors
/// [`StoreError::OtherGroup`] or [`StoreError::Group`], if a group is given that cannot be,
/// or none where one is needed. Simulated participants need none.
pub(super) fn group(
    plan: &Plan,
    (participant, simulated): (&ParticipantId, bool),
    own: &[&SessionData],
) -> Result<Option<PartId>, StoreError> {
    let given = plan.given.as_ref();
    let started = own.iter().filter(|s| s.standing().state != State::Void);
    let had = started
        .filter_map(|s| s.history.start()?.assigned.group.clone())
        .next();
    if let (Some(had), Some(given)) = (&had, given)
        && had != given
    {
        return Err(StoreError::OtherGroup {
            participant: participant.clone(),
            had: had.clone(),
        });
    }
    if had.is_some() {
        return Ok(had);
    }
    let list = plan.groups.as_ref().map_or(&[][..], |g| &g.list);
    let by_experimenter = plan
        .groups
        .as_ref()
        .is_some_and(|g| g.assign == Assign::Given);
    let fits = match given {
        Some(given) => by_experimenter && list.iter().any(|g| g.id == *given),
        None => !by_experimenter || simulated,
    };
    if fits {
        return Ok(given.cloned());
    }
    let known: Vec<&str> = list.iter().map(|g| g.id.as_str()).collect();
    Err(StoreError::Group {
        given: given.cloned(),
        known: known.join(", "),
        by_experimenter,
    })
}
