//! Claiming sessions and rows.
//!
//! There is no ledger file: who has which row is read from the journals, under a
//! lock on the study's folder. A participant keeps a row while their state allows
//! it; the numbers of pilots and simulated participants are never reused.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::journal::{self, Journal};
use super::journal_record::{Claim, Record};
use super::manifest::Manifest;
use super::plan::{self, Next, Plan, done, next_session};
use super::session_lock::{LEAST_FREE_BYTES, RESERVE_BYTES, SessionLock};
use super::sessions::{SessionData, deciding};
use super::{SessionFolder, StudyFolder, atomic, layout};
use crate::outcome::fold::Standing;
use crate::outcome::{Entry, State};
use std::collections::BTreeSet;
use std::io;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use study_base::text::ParticipantId;
use study_plan::protocol::{Assigned, Seat};

/// Free space below which the operator is warned, bytes.
const LOW_SPACE_BYTES: u64 = 32 << 20;

/// How often a lock that somebody has is asked for again, and the time between.
const LOCK_ATTEMPTS: u32 = 15;
const BETWEEN_ATTEMPTS: Duration = Duration::from_millis(20);

/// The kind of a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeatKind {
    /// Takes part in the study and has a row of the schedule.
    Real,
    /// Tries the study out.
    Pilot,
    /// Simulated: no person.
    Simulated,
}

impl SeatKind {
    /// The word for it in a sentence.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Real => "real",
            Self::Pilot => "pilot",
            Self::Simulated => "simulated",
        }
    }

    /// The kind of participant that has a seat.
    pub fn of(seat: Seat) -> Self {
        match seat {
            Seat::Row(_) => Self::Real,
            Seat::Pilot(_) => Self::Pilot,
            Seat::Simulated(_) => Self::Simulated,
        }
    }
}

/// A request for a session.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimRequest {
    /// Participant.
    pub participant: ParticipantId,
    /// Kind of participant.
    pub kind: SeatKind,
    /// Rows available to this rig; all if `None`.
    pub rows: Option<RangeInclusive<u32>>,
    /// What the protocol says of groups and repeated sessions.
    pub plan: Plan,
}

/// A session claimed by this process.
#[derive(Debug)]
pub struct Claimed {
    /// Session of the participant, from 1.
    pub session: u32,
    /// Source of the order.
    pub seat: Seat,
    /// Its events so far; empty for a new session.
    pub entries: Vec<Entry>,
    /// Version of the protocol that it started with; the newest for a new session.
    pub protocol_version: u32,
    /// Group and planned session of a new session.
    pub assigned: Assigned,
    /// Folder of the session.
    pub folder: SessionFolder,
    /// Messages to the operator.
    pub notices: Vec<String>,
}

impl StudyFolder {
    /// Claims a participant's unfinished session, or a new one with the lowest free
    /// row. When this returns, the claim is on the medium.
    ///
    /// # Errors
    /// [`StoreError`] if the participant has finished or left the study, is of another
    /// kind, has the session open elsewhere or an id that differs from another only
    /// in case; if no row is free or the disk is full; if the format is newer.
    pub fn claim(&self, request: &ClaimRequest) -> Result<Claimed, StoreError> {
        let _lock = self.lock()?;
        let newest = Manifest::read_intact(self.disk.as_ref(), &self.path)?
            .newest()
            .version;
        if newest != self.version() {
            return Err(StoreError::AmendedMeanwhile {
                path: self.path.clone(),
                version: newest,
            });
        }
        self.check_id(&request.participant)?;
        check_searchers(request)?;
        let all = self.sessions()?;
        let own: Vec<&SessionData> = all
            .iter()
            .filter(|s| s.participant == request.participant)
            .collect();
        let number = self.session_to_claim(request, &own)?;
        let next = next_session(&own, &request.plan);
        let mut notices: Vec<String> = next.notice().into_iter().collect();
        if let (Next::TooEarly { session, from, .. }, SeatKind::Real) = (&next, request.kind) {
            return Err(StoreError::TooEarly {
                participant: request.participant.clone(),
                session: session.clone(),
                from: *from,
            });
        }
        let simulated = request.kind == SeatKind::Simulated;
        let group = plan::group(&request.plan, (&request.participant, simulated), &own)?;
        self.probe(&mut notices)?;

        let folder = layout::session(&self.path, &request.participant, number);
        if !own.iter().any(|s| s.session == number) {
            self.make_session(&request.participant, &folder)?;
        }
        let disk = self.disk.as_ref();
        let locked = self.lock_session(&request.participant, number);
        let lock = locked.inspect_err(|_| {
            let _ = disk.remove_file(&self.path.join(layout::PROBE));
        })?;
        // Other processes may have written since the sessions were read.
        let mut recovered = journal::recover(&lock)?;
        notices.append(&mut recovered.notices);
        let replay = &recovered.replay;
        check_standing(request, number, &replay.history.standing)?;
        let is_new = replay.records == 0;
        let kept = own.iter().filter(|s| s.is_done()).find_map(|s| s.seat);
        let seat = match is_new {
            true => match kept {
                Some(seat) => seat,
                None => next_seat(request, &all)?,
            },
            false => replay.seat().ok_or_else(|| StoreError::Damaged {
                path: folder.clone(),
                what: "claim and first event are damaged, so its row of the schedule is unknown"
                    .to_owned(),
            })?,
        };
        check_kind(request, seat)?;
        // A claim may be all that there is of a session.
        let assigned = match replay.history.start().is_none() {
            true => next.assigned(group.or_else(|| request.plan.group_of(seat))),
            false => Assigned::default(),
        };
        let protocol_version = replay
            .history
            .start()
            .map_or(self.version(), |start| start.protocol_version);
        let entries = replay.entries.clone();
        let mut journal = Journal::open(Arc::clone(&lock), recovered)?;
        if is_new {
            let seat = Some(seat);
            journal.records(&[self.claim_record(&request.participant, number, seat)])?;
        }
        self.keep_reserve(&folder)?;
        Ok(Claimed {
            session: number,
            seat,
            entries,
            protocol_version,
            assigned,
            folder: SessionFolder::new(lock, journal),
            notices,
        })
    }

    /// The first record of a new journal.
    pub(super) fn claim_record(
        &self,
        id: &ParticipantId,
        session: u32,
        seat: Option<Seat>,
    ) -> Record {
        Record::Claim(Claim {
            participant: id.clone(),
            session,
            seat,
            protocol_version: self.version(),
            head: true,
        })
    }

    /// Refuses an id that a file system may not distinguish from an existing one, and a
    /// new one that a command would take for an option.
    ///
    /// # Errors
    /// [`StoreError::Collides`], [`StoreError::LikeOption`], or the sessions cannot be read.
    pub fn check_id(&self, id: &ParticipantId) -> Result<(), StoreError> {
        let ids = self.participant_ids()?;
        if !ids.contains(id) {
            check_new_id(id)?;
        }
        match ids.into_iter().find(|i| i != id && i.collides_with(id)) {
            None => Ok(()),
            Some(existing) => Err(StoreError::Collides {
                given: id.clone(),
                existing,
            }),
        }
    }

    /// Number of the session to continue or begin.
    fn session_to_claim(
        &self,
        request: &ClaimRequest,
        own: &[&SessionData],
    ) -> Result<u32, StoreError> {
        let participant = request.participant.clone();
        for seat in own.iter().filter_map(|s| s.seat) {
            check_kind(request, seat)?;
        }
        let Some(last) = own.last() else {
            return Ok(1);
        };
        if last.tombstone.is_some() {
            return Err(StoreError::Erased { participant });
        }
        let standing = last.standing();
        // A no-show whose state was written incompletely cannot be continued.
        let empty = last.claimed && last.seat.is_none() && last.entries.is_empty();
        if standing.state == State::Void || (empty && last.damage.is_empty()) {
            return Ok(last.session + 1);
        }
        if standing.state == State::Done && done(own) < request.plan.sessions.len() {
            return Ok(last.session + 1);
        }
        check_standing(request, last.session, &standing)?;
        Ok(last.session)
    }

    /// Creates a session's folder and its parents durably.
    pub(super) fn make_session(&self, id: &ParticipantId, folder: &Path) -> Result<(), StoreError> {
        let disk = self.disk.as_ref();
        atomic::folder(disk, &self.path.join(layout::SESSIONS))?;
        let participant = layout::participant(&self.path, id);
        atomic::folder(disk, &participant)?;
        // Of several processes only one succeeds.
        disk.create_folder(folder).at(folder)?;
        disk.sync_folder(&participant).at(&participant)
    }

    /// Whether a program has a session open at this moment.
    pub fn is_open(&self, session: &SessionData) -> bool {
        // Nobody claims a session meanwhile, who would find it locked.
        let claims = super::lock_study(self.disk.as_ref(), &self.path);
        claims.is_ok_and(|_claims| matches!(self.disk.lock(&session.path), Ok(None)))
    }

    /// Locks a session's folder and makes its name durable: the process that created it
    /// may have died before its syncs.
    ///
    /// # Errors
    /// [`StoreError::Open`] if another process has it open, or the disk's.
    pub(super) fn lock_session(
        &self,
        id: &ParticipantId,
        number: u32,
    ) -> Result<Arc<SessionLock>, StoreError> {
        let path = layout::session(&self.path, id, number);
        let mut lock = self.disk.lock(&path).at(&path)?;
        // A program that was started a moment ago has the lock of a session that has just ended
        // until it runs.
        for _ in 0..LOCK_ATTEMPTS {
            if lock.is_some() {
                break;
            }
            std::thread::sleep(BETWEEN_ATTEMPTS);
            lock = self.disk.lock(&path).at(&path)?;
        }
        match lock {
            Some(lock) => {
                let disk = Arc::clone(&self.disk);
                self.settle_names(id)?;
                Ok(Arc::new(SessionLock::new(disk, path, lock)))
            }
            None => Err(StoreError::Open {
                participant: id.clone(),
                session: number,
                path,
            }),
        }
    }

    /// Returns when the names of a participant's sessions are on the medium.
    pub(super) fn settle_names(&self, id: &ParticipantId) -> Result<(), StoreError> {
        for folder in [
            layout::participant(&self.path, id),
            self.path.join(layout::SESSIONS),
        ] {
            self.disk.sync_folder(&folder).at(&folder)?;
        }
        Ok(())
    }

    /// Writes the reserve before anything is claimed, so that a full or read-only
    /// disk prevents the claim.
    fn probe(&self, notices: &mut Vec<String>) -> Result<(), StoreError> {
        let disk = self.disk.as_ref();
        let path = self.path.join(layout::PROBE);
        match disk.remove_file(&path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e).at(&path),
            _ => {}
        }
        let free = disk.free_bytes(&self.path).at(&self.path)?;
        let needed = LEAST_FREE_BYTES;
        if let Some(free) = free.filter(|free| *free < needed) {
            return Err(StoreError::Full {
                path: self.path.clone(),
                free,
                needed,
            });
        }
        if let Some(free) = free.filter(|free| *free < LOW_SPACE_BYTES) {
            notices.push(format!("only {} KiB of disk space are free", free >> 10));
        }
        let written = write_reserve(disk, &path);
        if written.is_err() {
            let _ = disk.remove_file(&path);
        }
        written.at(&path)
    }

    /// Moves the reserve written by [`Self::probe`] into the session.
    fn keep_reserve(&self, folder: &Path) -> Result<(), StoreError> {
        let to = folder.join(layout::RESERVE);
        self.disk
            .rename(&self.path.join(layout::PROBE), &to)
            .at(&to)
    }
}

fn write_reserve(disk: &dyn Disk, path: &Path) -> io::Result<()> {
    let mut file = disk.create(path)?;
    // Not zeros: some file systems allocate no space for those.
    let pattern: Vec<u8> = (1..=251).collect();
    let mut bytes = pattern.repeat(RESERVE_BYTES as usize / pattern.len() + 1);
    bytes.truncate(RESERVE_BYTES as usize);
    file.write_all(&bytes)?;
    file.sync()
}

/// Refuses whoever took part in the search that the study confirms. Simulated participants are nobody.
fn check_searchers(request: &ClaimRequest) -> Result<(), StoreError> {
    let confirms = request.plan.confirms.as_ref();
    let of_search = confirms.filter(|search| search.was_searcher(&request.participant));
    match of_search.filter(|_| request.kind != SeatKind::Simulated) {
        None => Ok(()),
        Some(search) => Err(StoreError::Searcher {
            participant: request.participant.clone(),
            search: search.study.clone(),
        }),
    }
}

/// Refuses a session that is not unfinished.
fn check_standing(
    request: &ClaimRequest,
    session: u32,
    standing: &Standing,
) -> Result<(), StoreError> {
    let participant = request.participant.clone();
    match standing.state {
        State::Unfinished => Ok(()),
        State::Done => Err(StoreError::Finished {
            participant,
            session,
        }),
        state => Err(StoreError::InState {
            participant,
            state,
            reason: standing.reason.clone(),
        }),
    }
}

/// Refuses a new id that a command would take for an option, or Windows for a device: a results
/// folder can be copied to every system. Earlier releases accepted both.
///
/// # Errors
/// [`StoreError::LikeOption`], [`StoreError::WindowsDevice`].
pub fn check_new_id(id: &ParticipantId) -> Result<(), StoreError> {
    let given = || id.clone();
    if id.is_like_option() {
        return Err(StoreError::LikeOption { given: given() });
    }
    if id.is_windows_device() {
        return Err(StoreError::WindowsDevice { given: given() });
    }
    Ok(())
}

fn check_kind(request: &ClaimRequest, seat: Seat) -> Result<(), StoreError> {
    let had = SeatKind::of(seat);
    if had == request.kind {
        return Ok(());
    }
    Err(StoreError::OtherKind {
        participant: request.participant.clone(),
        had: had.as_str(),
        wanted: request.kind.as_str(),
    })
}

fn next_seat(request: &ClaimRequest, all: &[SessionData]) -> Result<Seat, StoreError> {
    let numbers = |kind: SeatKind| {
        all.iter()
            .filter_map(|s| s.seat)
            .filter(|seat| SeatKind::of(*seat) == kind)
            .map(Seat::number)
            .max()
            .map_or(1, |n| n.saturating_add(1))
    };
    match request.kind {
        SeatKind::Pilot => Ok(Seat::Pilot(numbers(SeatKind::Pilot))),
        SeatKind::Simulated => Ok(Seat::Simulated(numbers(SeatKind::Simulated))),
        SeatKind::Real => {
            let rows = request.rows.as_ref();
            next_row(rows, all).map(Seat::Row).ok_or(StoreError::NoRow {
                from: rows.map_or(1, |rows| *rows.start()),
                to: rows.map_or(u32::MAX, |rows| *rows.end()),
            })
        }
    }
}

/// The row that the next participant would get, from all sessions of a study: the lowest
/// that no participant keeps, of a range or of all.
pub fn next_row(rows: Option<&RangeInclusive<u32>>, sessions: &[SessionData]) -> Option<u32> {
    let held: BTreeSet<u32> = held_rows(sessions).collect();
    let (from, to) = rows.map_or((1, u32::MAX), |rows| (*rows.start(), *rows.end()));
    (from.max(1)..=to).find(|row| !held.contains(row))
}

/// The rows that participants keep, by participant. A row stands here twice if it was assigned again
/// before somebody who had it was reinstated.
pub fn held_rows(sessions: &[SessionData]) -> impl Iterator<Item = u32> {
    deciding(sessions).filter_map(SessionData::held_row)
}
