//! What is left of a participant whose data were erased.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::{atomic, layout};
use crate::outcome::{Moment, State};
use crate::protocol::Seat;
use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::Path;
use study_base::text::ParticipantId;

/// The version of the tombstone's format.
const FORMAT: &str = "study-tombstone/1";

/// What is left of a participant whose data were erased: nothing that they gave.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tombstone {
    format: String,
    /// Whose.
    pub participant: ParticipantId,
    /// State that was set with it.
    pub state: State,
    /// Why.
    pub reason: String,
    /// When.
    pub erased_at: DateTime<FixedOffset>,
    /// The sessions that were erased.
    pub sessions: Vec<ErasedSession>,
}

/// A session that was erased.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErasedSession {
    /// Which, from 1.
    pub session: u32,
    /// The seat that it had.
    pub seat: Option<Seat>,
    /// Records that its journal had.
    pub lines: u64,
    /// Hash of the last, as the next line would have had it in `prev`.
    pub last_hash: String,
}

impl Tombstone {
    /// The last session that was erased.
    pub fn last_session(&self) -> u32 {
        self.sessions.last().map_or(1, |s| s.session)
    }

    /// The seat of the last session that had one.
    pub fn seat(&self) -> Option<Seat> {
        self.sessions.iter().rev().find_map(|s| s.seat)
    }

    /// The tombstone of a participant whose data are erased now.
    pub(super) fn new(
        participant: &ParticipantId,
        state: State,
        reason: &str,
        at: Moment,
        sessions: Vec<ErasedSession>,
    ) -> Self {
        Self {
            format: FORMAT.to_owned(),
            participant: participant.clone(),
            state,
            reason: reason.to_owned(),
            erased_at: at.wall,
            sessions,
        }
    }

    /// Writes it into the participant's folder.
    pub(super) fn write(&self, disk: &dyn Disk, folder: &Path) -> Result<(), StoreError> {
        let path = folder.join(layout::TOMBSTONE);
        let mut text = serde_json::to_string_pretty(self).map_err(|e| StoreError::Unstorable {
            path: path.clone(),
            what: e.to_string(),
        })?;
        text.push('\n');
        atomic::replace(disk, &path, text.as_bytes())
    }

    /// Reads the one in a participant's folder, if there is one.
    pub(super) fn read(disk: &dyn Disk, folder: &Path) -> Result<Option<Self>, StoreError> {
        let path = folder.join(layout::TOMBSTONE);
        let bytes = match disk.read(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            read => read.at(&path)?,
        };
        let stone: Self = serde_json::from_slice(&bytes).map_err(|e| StoreError::Damaged {
            path: path.clone(),
            what: e.to_string(),
        })?;
        if stone.format != FORMAT {
            return Err(StoreError::Newer {
                path,
                found: stone.format,
            });
        }
        Ok(Some(stone))
    }
}
