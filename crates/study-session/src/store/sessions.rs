//! Reading the sessions of a study.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::head::Head;
use super::journal_record::Claim;
use super::replay::{Damage, replay};
use super::tombstone::Tombstone;
use super::{StudyFolder, journal, layout};
use crate::outcome::fold::{History, Standing};
use crate::outcome::{Entry, State};
use rayon::prelude::*;
use std::io;
use std::path::{Path, PathBuf};
use study_base::sort::SmallSort as _;
use study_base::text::ParticipantId;
use study_plan::protocol::Seat;

/// One session as read from its journal.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionData {
    /// Participant.
    pub participant: ParticipantId,
    /// Session of the participant, from 1.
    pub session: u32,
    /// Folder of the session.
    pub path: PathBuf,
    /// Source of the order; `None` for a no-show, an incomplete claim, and a journal in
    /// which both claim and first event are damaged.
    pub seat: Option<Seat>,
    /// Every event that could be read; empty if the data were erased.
    pub entries: Vec<Entry>,
    /// What these events add up to.
    pub history: History,
    /// Damage of the journal.
    pub damage: Vec<Damage>,
    /// The tombstone, if the data were erased.
    pub tombstone: Option<Tombstone>,
    /// Whether the journal contains any record.
    pub claimed: bool,
    /// Whether acknowledged records are missing at the end of the journal.
    pub truncated: bool,
    /// Whether `head.json` tells which record is the last; it does not in journals of
    /// earlier releases.
    pub protected: bool,
    /// Whether every record was acknowledged and is therefore on the medium.
    pub(super) settled: bool,
    /// Number of records, including the claim.
    pub(super) records: u64,
    /// Hash of each record by sequence number, in ascending order.
    pub(super) hashes: Vec<(u64, String)>,
    /// Hash of the last record.
    pub(super) last_hash: String,
    /// The claim, if it could be read.
    pub(super) claim: Option<Claim>,
    /// File name of the last segment of the journal.
    pub(super) last_file: Option<String>,
}

impl SessionData {
    /// State and its reason.
    pub fn standing(&self) -> Standing {
        match &self.tombstone {
            Some(tombstone) => Standing {
                state: tombstone.state,
                reason: tombstone.reason.clone(),
            },
            None => self.history.standing.clone(),
        }
    }

    /// The row that this session keeps.
    pub fn held_row(&self) -> Option<u32> {
        let state = self.standing().state;
        self.seat?.row().filter(|_| state.keeps_row())
    }

    /// Hash of the last record of its journal; that of an erased one is empty.
    pub fn last_hash(&self) -> &str {
        &self.last_hash
    }

    /// Whether all its trials are done.
    pub fn is_done(&self) -> bool {
        self.standing().state == State::Done
    }

    /// Whether the session can be continued.
    pub fn is_unfinished(&self) -> bool {
        self.standing().state == State::Unfinished
    }
}

/// The session of each participant that decides on the row: the last one that is not void.
pub(super) fn deciding(sessions: &[SessionData]) -> impl Iterator<Item = &SessionData> {
    let of_one = sessions.chunk_by(|a, b| a.participant == b.participant);
    let not_void = |s: &&SessionData| s.standing().state != State::Void;
    of_one.filter_map(move |own| own.iter().rev().find(not_void))
}

impl StudyFolder {
    /// Reads every session, by participant (in byte order) and number. Nothing is
    /// changed or locked: a session under way is read as far as it is on disk. An
    /// erased participant has one entry, with the tombstone.
    ///
    /// # Errors
    /// [`StoreError`] if a folder or file cannot be read. Damage is no error.
    pub fn sessions(&self) -> Result<Vec<SessionData>, StoreError> {
        let ids = self.participant_ids()?;
        let read: Vec<_> = ids.par_iter().map(|id| self.sessions_of(id)).collect();
        let mut all = Vec::new();
        // Of several errors always the same one is reported.
        for sessions in read {
            all.extend(sessions?);
        }
        Ok(all)
    }

    /// The ids of all participants with a folder, in byte order.
    ///
    /// # Errors
    /// [`StoreError::WrongKind`] if something else has the name of a participant or of
    /// the folder of all sessions.
    pub(super) fn participant_ids(&self) -> Result<Vec<ParticipantId>, StoreError> {
        check_kind(self.disk.as_ref(), &self.path, |name| {
            [layout::SESSIONS, layout::PROTOCOLS].contains(&name)
        })?;
        let folder = self.path.join(layout::SESSIONS);
        let is_id = |name: &str| ParticipantId::new(name).is_ok();
        let names = check_kind(self.disk.as_ref(), &folder, is_id)?;
        let mut ids: Vec<ParticipantId> = names
            .into_iter()
            .filter_map(|name| ParticipantId::new(name).ok())
            .collect();
        ids.small_sort();
        Ok(ids)
    }

    /// The sessions of one participant.
    pub(super) fn sessions_of(&self, id: &ParticipantId) -> Result<Vec<SessionData>, StoreError> {
        let folder = layout::participant(&self.path, id);
        if let Some(tombstone) = Tombstone::read(self.disk.as_ref(), &folder)? {
            return Ok(vec![SessionData {
                participant: id.clone(),
                session: tombstone.last_session(),
                path: folder,
                seat: tombstone.seat(),
                entries: Vec::new(),
                history: History::default(),
                damage: Vec::new(),
                tombstone: Some(tombstone),
                claimed: true,
                truncated: false,
                protected: true,
                settled: true,
                records: 0,
                hashes: Vec::new(),
                last_hash: String::new(),
                claim: None,
                last_file: None,
            }]);
        }
        self.session_numbers(&folder)?
            .into_iter()
            .map(|number| self.session(id, number))
            .collect()
    }

    pub(super) fn session_numbers(&self, folder: &Path) -> Result<Vec<u32>, StoreError> {
        let is_session = |name: &str| layout::number(name).is_some();
        let names = check_kind(self.disk.as_ref(), folder, is_session)?;
        let mut numbers: Vec<u32> = names.iter().filter_map(|n| layout::number(n)).collect();
        numbers.sort_unstable();
        Ok(numbers)
    }

    /// Reads one session's folder.
    pub(super) fn session(
        &self,
        id: &ParticipantId,
        number: u32,
    ) -> Result<SessionData, StoreError> {
        let path = layout::session(&self.path, id, number);
        // What a link leads to would be neither verified nor erased.
        check_kind(self.disk.as_ref(), &path, |name| name == layout::TELEMETRY)?;
        // The head first: a session under way may write on between the two.
        let head = Head::read(self.disk.as_ref(), &path)?;
        let segments = journal::segments(self.disk.as_ref(), &path)?;
        let replay = replay(&segments, &head);
        Ok(SessionData {
            participant: id.clone(),
            session: number,
            seat: replay.seat(),
            claimed: replay.records > 0,
            truncated: replay.is_truncated(),
            protected: head.head().is_some(),
            settled: replay.settled,
            records: replay.records,
            hashes: replay.hashes,
            last_hash: replay.prev,
            path,
            history: replay.history,
            entries: replay.entries,
            damage: replay.damage,
            tombstone: None,
            claim: replay.claim,
            last_file: segments.last().map(|s| s.name.clone()),
        })
    }
}

/// The names in a folder that must be folders; none if the folder does not exist.
///
/// # Errors
/// [`StoreError::WrongKind`] if one of them is a file or a link: what it contains would
/// otherwise be left out without a word.
pub(super) fn check_kind(
    disk: &dyn Disk,
    folder: &Path,
    must: impl Fn(&str) -> bool,
) -> Result<Vec<String>, StoreError> {
    let items = match disk.list(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        listed => listed.at(folder)?,
    };
    let found: Vec<_> = items.into_iter().filter(|i| must(&i.name)).collect();
    match found.iter().find(|i| !i.is_folder()) {
        Some(item) => Err(StoreError::WrongKind {
            path: folder.join(&item.name),
            found: item.kind.as_str(),
        }),
        None => Ok(found.into_iter().map(|i| i.name).collect()),
    }
}
