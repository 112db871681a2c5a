//! Every session of a study, read and not changed.

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

/// One session, as its journal tells it.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionData {
    /// Whose.
    pub participant: ParticipantId,
    /// Which, from 1.
    pub session: u32,
    /// Its folder.
    pub path: PathBuf,
    /// Where the order comes from; none for somebody who never came, for a session
    /// whose claim was killed, and where both places that say it are damaged.
    pub seat: Option<Seat>,
    /// Every event that could be read; empty if the data were erased.
    pub entries: Vec<Entry>,
    /// What these events add up to.
    pub history: History,
    /// Whatever is wrong with the journal.
    pub damage: Vec<Damage>,
    /// What is left if the data were erased.
    pub tombstone: Option<Tombstone>,
    /// Whether the claim of the folder was completed.
    pub claimed: bool,
    /// The claim, if it could be read.
    pub(super) claim: Option<Claim>,
    /// The file that the journal was last written to.
    pub(super) last_file: String,
}

impl SessionData {
    /// State and reason.
    pub fn standing(&self) -> Standing {
        match &self.tombstone {
            Some(tombstone) => Standing {
                state: tombstone.state,
                reason: tombstone.reason.clone(),
            },
            None => self.history.standing().clone(),
        }
    }

    /// The row that this session keeps from being given to others.
    pub fn held_row(&self) -> Option<u32> {
        let state = self.standing().state;
        self.seat?.row().filter(|_| state.keeps_row())
    }

    /// Whether the session can go on.
    pub fn is_unfinished(&self) -> bool {
        self.standing().state == State::Unfinished
    }
}

impl StudyFolder {
    /// Every session, by participant (in the order of their bytes) and number.
    /// Nothing is changed or locked: of a session under way this is what was on
    /// disk. What is erased is there once, with its tombstone.
    ///
    /// # Errors
    /// [`StoreError`] if a folder or file cannot be read. Damage is no error.
    pub fn sessions(&self) -> Result<Vec<SessionData>, StoreError> {
        let ids = self.participant_ids()?;
        let read: Vec<_> = ids.par_iter().map(|id| self.sessions_of(id)).collect();
        let mut all = Vec::new();
        // Of several errors always the same one is told.
        for sessions in read {
            all.extend(sessions?);
        }
        Ok(all)
    }

    /// Everybody who has a folder, in the order of their bytes.
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
                last_file: String::new(),
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
            last_file: segments.last().map(|s| s.name.clone()).unwrap_or_default(),
        })
    }
}
