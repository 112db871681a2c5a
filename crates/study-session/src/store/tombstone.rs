//! The record that remains of a participant whose data were erased.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::{atomic, layout};
use crate::outcome::{Moment, State};
use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::Path;
use study_base::text::ParticipantId;
use study_plan::protocol::Seat;

/// Format of the tombstone.
const FORMAT: &str = "study-tombstone/1";

/// The record that remains of a participant whose data were erased.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tombstone {
    format: String,
    /// Participant.
    pub participant: ParticipantId,
    /// State set with the erasure.
    pub state: State,
    /// Reason.
    pub reason: String,
    /// When the data were erased.
    pub erased_at: DateTime<FixedOffset>,
    /// The erased sessions.
    pub sessions: Vec<ErasedSession>,
}

/// An erased session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErasedSession {
    /// Session of the participant, from 1.
    pub session: u32,
    /// Its seat.
    pub seat: Option<Seat>,
    /// Number of records of its journal.
    pub lines: u64,
    /// Hash of the last record, as in `prev` of a following line.
    pub last_hash: String,
}

impl Tombstone {
    /// The last erased session.
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

    /// Reads the tombstone in a participant's folder, if there is one.
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
