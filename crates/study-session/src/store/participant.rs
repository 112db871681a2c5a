//! Setting the state of a participant and erasing their data.
//!
//! Writing the tombstone commits an erasure: from then on the participant counts as
//! erased, whatever is left of the files, and repeating the command completes it.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::journal::{self, Journal};
use super::sessions::{SessionData, check_kind};
use super::tombstone::{ErasedSession, Tombstone};
use super::{StudyFolder, layout};
use crate::outcome::{Event, Moment, State};
use chrono::{DateTime, FixedOffset};
use std::path::Path;
use study_base::text::ParticipantId;
use study_plan::protocol::Seat;

/// A request to set the state of a participant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateRequest {
    /// Participant.
    pub participant: ParticipantId,
    /// New state. [`State::Unfinished`] takes back an exclusion or a drop-out: the
    /// participant then has the state that the session determines.
    pub state: State,
    /// Reason.
    pub reason: String,
    /// Whether to erase the participant's data.
    pub erase: bool,
}

/// The effect of setting a state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateChange {
    /// State before; `None` for a participant without a session.
    pub before: Option<State>,
    /// State from now on.
    pub after: State,
    /// The row that the next participant gets, if one became free.
    pub freed_row: Option<u32>,
    /// Number of sessions whose data were erased.
    pub erased: usize,
    /// When the data had been erased by an earlier command, if they had.
    pub erased_before: Option<DateTime<FixedOffset>>,
    /// Whether `analysis/`, which contains data of all participants, was removed.
    pub analysis_removed: bool,
    /// Messages to the operator.
    pub notices: Vec<String>,
}

impl StudyFolder {
    /// Sets a participant's state and, on request, erases their data. The derived
    /// tables must be written again afterwards.
    ///
    /// # Errors
    /// [`StoreError`]: no such participant, a state that cannot follow the present
    /// one, an open session, or the disk's.
    pub fn set_state(&self, request: &StateRequest, at: Moment) -> Result<StateChange, StoreError> {
        let _lock = self.lock()?;
        let id = &request.participant;
        self.check_id(id)?;
        let own = self.sessions_of(id)?;
        if request.erase {
            // What a link leads to would not be erased.
            self.check_analysis()?;
        }
        if let Some(stone) = own.last().and_then(|s| s.tombstone.as_ref()) {
            if !request.erase {
                return Err(StoreError::Erased {
                    participant: id.clone(),
                });
            }
            // Files remain if the earlier erasure was interrupted, and the tombstone may
            // not be on the medium.
            let folder = layout::participant(&self.path, id);
            self.disk.sync_folder(&folder).at(&folder)?;
            return Ok(StateChange {
                before: Some(stone.state),
                after: stone.state,
                freed_row: None,
                erased: self.remove_sessions(id)?,
                erased_before: Some(stone.erased_at),
                analysis_removed: self.remove_analysis()?,
                notices: Vec::new(),
            });
        }
        let last = own.last();
        self.check_change(request, last)?;
        let before = last.map(|s| s.standing().state);
        let freed_row = last.and_then(SessionData::held_row);
        let mut notices = Vec::new();
        let after = match (request.state, last) {
            (State::Unfinished, Some(last)) => self.reinstated(last, &mut notices)?,
            (state, _) => state,
        };
        let (mut erased, mut analysis_removed) = (0, false);
        if request.erase {
            erased = self.erase(request, &own, at)?;
            analysis_removed = self.remove_analysis()?;
        } else {
            let number = last.map_or(1, |s| s.session);
            let event = Event::StateSet {
                state: after,
                reason: request.reason.clone(),
            };
            self.append_state(id, last.is_none(), number, at, &event, &mut notices)?;
        }
        Ok(StateChange {
            before,
            after,
            freed_row: freed_row.filter(|_| !after.keeps_row()),
            erased,
            erased_before: None,
            analysis_removed,
            notices,
        })
    }

    fn check_change(
        &self,
        request: &StateRequest,
        last: Option<&SessionData>,
    ) -> Result<(), StoreError> {
        let refused = |why: &str| {
            Err(StoreError::StateRefused {
                participant: request.participant.clone(),
                state: request.state,
                why: why.to_owned(),
            })
        };
        let Some(last) = last else {
            if request.state == State::NoShow && !request.erase {
                return Ok(());
            }
            return Err(StoreError::Unknown {
                participant: request.participant.clone(),
                near: self.near(&request.participant)?,
            });
        };
        let started = last.history.start().is_some();
        match request.state {
            State::Done => refused("only a session sets this state"),
            State::Unfinished => {
                let consent = last.history.consent.as_ref();
                match last.standing().state {
                    _ if request.erase => refused("nothing is erased of who is reinstated"),
                    _ if consent.is_some_and(|c| !c.accepted) => refused("consent was refused"),
                    State::Excluded | State::DroppedOut => Ok(()),
                    _ => refused("only an exclusion or a drop-out can be taken back"),
                }
            }
            State::Void if last.history.has_rating() => {
                refused("a trial has been rated; use dropped-out or excluded")
            }
            State::NoShow if started => refused("the session was started; use dropped-out or void"),
            State::DroppedOut if last.standing().state == State::Done => {
                refused("every trial is done; use excluded or withdrawn")
            }
            _ => Ok(()),
        }
    }

    /// The state that a session determines by itself; says who has its row now.
    fn reinstated(
        &self,
        session: &SessionData,
        notices: &mut Vec<String>,
    ) -> Result<State, StoreError> {
        let row = session.seat.and_then(Seat::row);
        for other in self.sessions()? {
            if row.is_some() && other.held_row() == row {
                notices.push(format!(
                    "row {} was assigned to {} in the meantime: both have its order",
                    row.unwrap_or_default(),
                    other.participant
                ));
            }
        }
        let finished = session.entries.iter().any(|e| e.event == Event::Finished);
        Ok(if finished {
            State::Done
        } else {
            State::Unfinished
        })
    }

    pub(super) fn near(&self, id: &ParticipantId) -> Result<Option<ParticipantId>, StoreError> {
        let ids = self.participant_ids()?;
        let near =
            study_base::diagnostic::did_you_mean(id.as_str(), ids.iter().map(|i| i.as_str()));
        Ok(near.and_then(|near| ids.iter().find(|i| i.as_str() == near).cloned()))
    }

    /// Appends the state to the journal of a session. A participant without a session
    /// gets a folder without a seat.
    pub(super) fn append_state(
        &self,
        participant: &ParticipantId,
        new: bool,
        number: u32,
        at: Moment,
        event: &Event,
        notices: &mut Vec<String>,
    ) -> Result<(), StoreError> {
        if new {
            let folder = layout::session(&self.path, participant, number);
            self.make_session(participant, &folder)?;
        }
        let lock = self.lock_session(participant, number)?;
        let mut recovered = journal::recover(&lock)?;
        notices.append(&mut recovered.notices);
        let is_new = recovered.replay.records == 0;
        let mut journal = Journal::open(lock, recovered)?;
        if is_new {
            journal.records(&[self.claim_record(participant, number, None)])?;
        }
        journal.append(at, event)?;
        Ok(())
    }

    fn erase(
        &self,
        request: &StateRequest,
        own: &[SessionData],
        at: Moment,
    ) -> Result<usize, StoreError> {
        let id = &request.participant;
        let mut locks = Vec::new();
        let mut sessions = Vec::new();
        for session in own {
            locks.push(self.lock_session(id, session.session)?);
            let read = self.session(id, session.session)?;
            sessions.push(ErasedSession {
                session: session.session,
                seat: session.seat,
                lines: read.records,
                last_hash: read.last_hash,
            });
        }
        let stone = Tombstone::new(id, request.state, &request.reason, at, sessions);
        let folder = layout::participant(&self.path, id);
        stone.write(self.disk.as_ref(), &folder)?;
        let erased = self.remove_sessions(id);
        drop(locks);
        erased
    }

    /// Removes the sessions of a participant; returns their number.
    fn remove_sessions(&self, id: &ParticipantId) -> Result<usize, StoreError> {
        let folder = layout::participant(&self.path, id);
        let numbers = self.session_numbers(&folder)?;
        for number in &numbers {
            let session = layout::session(&self.path, id, *number);
            remove_all(self.disk.as_ref(), &session)?;
        }
        self.disk.sync_folder(&folder).at(&folder)?;
        Ok(numbers.len())
    }

    /// Checks that nothing else has the name of the folder `analysis/`.
    ///
    /// # Errors
    /// [`StoreError::WrongKind`] if something has, such as a link.
    pub fn check_analysis(&self) -> Result<(), StoreError> {
        let is_analysis = |name: &str| name == layout::ANALYSIS;
        check_kind(self.disk.as_ref(), &self.path, is_analysis).map(drop)
    }

    /// Removes the folder `analysis/`, which contains single ratings and comments;
    /// returns whether there was one.
    fn remove_analysis(&self) -> Result<bool, StoreError> {
        let items = self.disk.list(&self.path).at(&self.path)?;
        let is_analysis = |i: &super::disk::Item| i.name == layout::ANALYSIS && i.is_folder();
        if !items.iter().any(is_analysis) {
            return Ok(false);
        }
        remove_all(self.disk.as_ref(), &self.path.join(layout::ANALYSIS))?;
        self.disk.sync_folder(&self.path).at(&self.path)?;
        Ok(true)
    }
}

/// Removes a folder and its content without following links.
pub(super) fn remove_all(disk: &dyn Disk, folder: &Path) -> Result<(), StoreError> {
    for item in disk.list(folder).at(folder)? {
        let path = folder.join(&item.name);
        if item.is_folder() {
            remove_all(disk, &path)?;
        } else {
            disk.remove_file(&path).at(&path)?;
        }
    }
    disk.remove_folder(folder).at(folder)
}
