//! Reading the sessions of a study.

use super::error::{At as _, StoreError};
use super::journal_record::Claim;
use super::replay::{Damage, replay};
use super::tombstone::Tombstone;
use super::{StudyFolder, journal, layout};
use crate::outcome::fold::{History, Standing};
use crate::outcome::{Entry, State};
use crate::protocol::Seat;
use rayon::prelude::*;
use std::io;
use std::path::{Path, PathBuf};
use study_base::text::ParticipantId;

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

    /// Whether the session can be continued.
    pub fn is_unfinished(&self) -> bool {
        self.standing().state == State::Unfinished
    }
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
    pub(super) fn participant_ids(&self) -> Result<Vec<ParticipantId>, StoreError> {
        let folder = self.path.join(layout::SESSIONS);
        let items = match self.disk.list(&folder) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            listed => listed.at(&folder)?,
        };
        let mut ids: Vec<ParticipantId> = items
            .into_iter()
            .filter(|i| i.is_folder)
            .filter_map(|i| ParticipantId::new(i.name).ok())
            .collect();
        ids.sort();
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
        let items = match self.disk.list(folder) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            listed => listed.at(folder)?,
        };
        let mut numbers: Vec<u32> = items
            .iter()
            .filter(|i| i.is_folder)
            .filter_map(|i| layout::number(&i.name))
            .collect();
        numbers.sort_unstable();
        Ok(numbers)
    }

    /// One session.
    pub(super) fn session(
        &self,
        id: &ParticipantId,
        number: u32,
    ) -> Result<SessionData, StoreError> {
        let path = layout::session(&self.path, id, number);
        let segments = journal::segments(self.disk.as_ref(), &path)?;
        let replay = replay(&segments);
        Ok(SessionData {
            participant: id.clone(),
            session: number,
            seat: replay.seat(),
            claimed: replay.records > 0,
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
