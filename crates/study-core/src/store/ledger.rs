//! Who has which session and which row.
//!
//! There is no ledger file: it is read from the journals, under a lock on the
//! study's folder, so it cannot disagree with them. A row belongs to a participant
//! while their state keeps it; the numbers of pilots and simulated participants
//! are never given twice.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::held::{Held, RESERVE_BYTES};
use super::journal::{self, Journal};
use super::journal_record::{Claim, Record};
use super::manifest::Manifest;
use super::sessions::SessionData;
use super::{SessionFolder, StudyFolder, atomic, layout};
use crate::outcome::fold::Standing;
use crate::outcome::{Entry, State};
use crate::protocol::Seat;
use std::collections::BTreeSet;
use std::io;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;
use study_base::text::ParticipantId;

/// Free space below which the operator is told, bytes.
const LITTLE_BYTES: u64 = 32 << 20;

/// What kind of participant a seat is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeatKind {
    /// Takes a row.
    Real,
    /// A person who tries the study out.
    Pilot,
    /// Nobody.
    Simulated,
}

impl SeatKind {
    /// In a sentence.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Real => "real",
            Self::Pilot => "pilot",
            Self::Simulated => "simulated",
        }
    }

    /// Of a seat.
    pub fn of(seat: Seat) -> Self {
        match seat {
            Seat::Row(_) => Self::Real,
            Seat::Pilot(_) => Self::Pilot,
            Seat::Simulated(_) => Self::Simulated,
        }
    }
}

/// Who wants a session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClaimRequest {
    /// Who.
    pub participant: ParticipantId,
    /// What kind of participant.
    pub kind: SeatKind,
    /// The rows of this rig; all if `None`.
    pub rows: Option<RangeInclusive<u32>>,
}

/// A session that belongs to this process.
#[derive(Debug)]
pub struct Claimed {
    /// Which of the participant's, from 1.
    pub session: u32,
    /// Where the order comes from.
    pub seat: Seat,
    /// What has happened in it; empty for a new one.
    pub entries: Vec<Entry>,
    /// The version of the protocol that it started with; for a new one the newest.
    pub protocol_version: u32,
    /// Its folder.
    pub folder: SessionFolder,
    /// What the operator should know.
    pub notices: Vec<String>,
}

impl StudyFolder {
    /// Claims a participant's unfinished session, or a new one with the lowest free
    /// row. When this returns the claim is on the medium.
    ///
    /// # Errors
    /// [`StoreError`]: the participant is done or out, open elsewhere, of another
    /// kind, collides with another id; no free row; no room; a newer format.
    pub fn claim(&self, request: &ClaimRequest) -> Result<Claimed, StoreError> {
        let _lock = self.lock()?;
        let newest = Manifest::read(self.disk.as_ref(), &self.path)?
            .newest()
            .version;
        if newest != self.version() {
            return Err(StoreError::AmendedMeanwhile {
                path: self.path.clone(),
                version: newest,
            });
        }
        self.check_id(&request.participant)?;
        let all = self.sessions()?;
        let own: Vec<&SessionData> = all
            .iter()
            .filter(|s| s.participant == request.participant)
            .collect();
        let number = self.session_to_claim(request, &own)?;
        let mut notices = Vec::new();
        self.probe(&mut notices)?;

        let folder = layout::session(&self.path, &request.participant, number);
        if !own.iter().any(|s| s.session == number) {
            self.make_session(&request.participant, &folder)?;
        }
        let disk = self.disk.as_ref();
        let Some(lock) = disk.lock(&folder).at(&folder)? else {
            let _ = disk.remove_file(&self.path.join(layout::PROBE));
            return Err(StoreError::Open {
                participant: request.participant.clone(),
                session: number,
                path: folder,
            });
        };
        let held = Arc::new(Held::new(Arc::clone(&self.disk), folder.clone(), lock));
        if !self.has_journal(&folder)? {
            let path = folder.join(layout::segment(1));
            disk.create(&path).at(&path)?;
            disk.sync_folder(&folder).at(&folder)?;
        }
        // Others may have written since the ledger was read; now nobody can.
        let (mut segments, mut replay, recovered) = journal::recover(disk, &folder)?;
        notices.extend(recovered);
        if let Some(found) = replay.newer() {
            return Err(StoreError::Newer {
                path: folder,
                found,
            });
        }
        check_standing(request, number, replay.history.standing())?;
        if replay.records == 0 {
            let seat = next_seat(request, &all)?;
            let claim = Claim {
                participant: request.participant.clone(),
                session: number,
                seat: Some(seat),
                protocol_version: self.version(),
            };
            let last = segments
                .last()
                .and_then(|s| layout::segment_number(&s.name));
            let mut journal = Journal::open(Arc::clone(&held), last.unwrap_or(1), &replay)?;
            journal.record(&Record::Claim(claim))?;
            drop(journal);
            (segments, replay, _) = journal::recover(disk, &folder)?;
        }
        let seat = replay.seat().ok_or_else(|| StoreError::Damaged {
            path: folder.clone(),
            what: "the lines that say which order the session has are damaged".to_owned(),
        })?;
        check_kind(request, seat)?;
        self.keep_reserve(&folder)?;
        let last = segments
            .last()
            .and_then(|s| layout::segment_number(&s.name));
        let protocol_version = replay
            .history
            .start()
            .map_or(self.version(), |start| start.protocol_version);
        let entries = replay.entries.clone();
        Ok(Claimed {
            session: number,
            seat,
            entries,
            protocol_version,
            folder: SessionFolder::new(held, last.unwrap_or(1), replay),
            notices,
        })
    }

    /// Refuses an id that a file system could take for another one.
    ///
    /// # Errors
    /// [`StoreError::Collides`], or the sessions cannot be read.
    pub fn check_id(&self, id: &ParticipantId) -> Result<(), StoreError> {
        let ids = self.participant_ids()?;
        match ids.into_iter().find(|i| i != id && i.collides_with(id)) {
            None => Ok(()),
            Some(existing) => Err(StoreError::Collides {
                given: id.clone(),
                existing,
            }),
        }
    }

    /// The session to go on with or to begin.
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
        // A no-show whose state was not written to its end has nothing to go on with.
        let empty = last.claimed && last.seat.is_none() && last.entries.is_empty();
        if standing.state == State::Void || (empty && last.damage.is_empty()) {
            return Ok(last.session + 1);
        }
        check_standing(request, last.session, &standing)?;
        Ok(last.session)
    }

    /// Makes a session's folder and everything above it, durably.
    pub(super) fn make_session(&self, id: &ParticipantId, folder: &Path) -> Result<(), StoreError> {
        let disk = self.disk.as_ref();
        atomic::folder(disk, &self.path.join(layout::SESSIONS))?;
        let participant = layout::participant(&self.path, id);
        atomic::folder(disk, &participant)?;
        // This is the claim: of all who try, one succeeds.
        disk.create_folder(folder).at(folder)?;
        disk.sync_folder(&participant).at(&participant)
    }

    pub(super) fn has_journal(&self, folder: &Path) -> Result<bool, StoreError> {
        let items = self.disk.list(folder).at(folder)?;
        Ok(items
            .iter()
            .any(|i| layout::segment_number(&i.name).is_some()))
    }

    /// Writes the reserve where it belongs to no session yet: if there is no room
    /// or the disk does not take it, nothing was claimed.
    fn probe(&self, notices: &mut Vec<String>) -> Result<(), StoreError> {
        let disk = self.disk.as_ref();
        let path = self.path.join(layout::PROBE);
        match disk.remove_file(&path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e).at(&path),
            _ => {}
        }
        let free = disk.free_bytes(&self.path).at(&self.path)?;
        let needed = 2 * RESERVE_BYTES;
        if let Some(free) = free.filter(|free| *free < needed) {
            return Err(StoreError::Full {
                path: self.path.clone(),
                free,
                needed,
            });
        }
        if let Some(free) = free.filter(|free| *free < LITTLE_BYTES) {
            notices.push(format!("only {} KiB are free on the disk", free >> 10));
        }
        let written = write_reserve(disk, &path);
        if written.is_err() {
            let _ = disk.remove_file(&path);
        }
        written.at(&path)
    }

    /// Gives the session the reserve that the probe has written.
    fn keep_reserve(&self, folder: &Path) -> Result<(), StoreError> {
        let to = folder.join(layout::RESERVE);
        self.disk
            .rename(&self.path.join(layout::PROBE), &to)
            .at(&to)
    }
}

fn write_reserve(disk: &dyn Disk, path: &Path) -> io::Result<()> {
    let mut file = disk.create(path)?;
    // Not zeros: some file systems would keep no room for those.
    let bytes: Vec<u8> = (0..RESERVE_BYTES).map(|i| (i % 251) as u8 ^ 0x5a).collect();
    file.write_all(&bytes)?;
    file.sync()
}

/// Only an unfinished session goes on.
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
            let rows = request.rows.clone().unwrap_or(1..=u32::MAX);
            free_row(rows.clone(), all)
                .map(Seat::Row)
                .ok_or(StoreError::NoRow {
                    from: *rows.start(),
                    to: *rows.end(),
                })
        }
    }
}

/// The lowest row that the next participant would get, by all sessions of a study.
pub fn next_row(sessions: &[SessionData]) -> u32 {
    free_row(1..=u32::MAX, sessions).unwrap_or(u32::MAX)
}

/// The lowest row of a range that nobody keeps.
fn free_row(rows: RangeInclusive<u32>, all: &[SessionData]) -> Option<u32> {
    let held: BTreeSet<u32> = all.iter().filter_map(SessionData::held_row).collect();
    let mut rows = (*rows.start()).max(1)..=*rows.end();
    rows.find(|row| !held.contains(row))
}
