//! `head.json`: the last record of a journal that was acknowledged.
//!
//! It is replaced after the record is on the medium and before the record is
//! acknowledged. A journal that is ahead of it was interrupted in between; a journal
//! that is behind it has lost acknowledged records.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::{atomic, layout, sealed};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::Path;

/// Format of the file.
const FORMAT: &str = "study-head/1";

/// The last acknowledged record of a journal.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Head {
    format: String,
    /// Its sequence number.
    pub seq: u64,
    /// Its hash, as in `prev` of a following record.
    pub hash: String,
    /// Number of the segment that contains it.
    pub segment: u32,
}

/// What `head.json` says of a journal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum HeadFile {
    /// There is none, as in journals of earlier releases.
    None,
    /// The last acknowledged record.
    Is(Head),
    /// It cannot be read.
    Damaged,
}

impl HeadFile {
    /// The head, if it can be read.
    pub fn head(&self) -> Option<&Head> {
        match self {
            Self::Is(head) => Some(head),
            Self::None | Self::Damaged => None,
        }
    }
}

impl Head {
    pub(super) fn new(seq: u64, hash: &str, segment: u32) -> Self {
        Self {
            format: FORMAT.to_owned(),
            seq,
            hash: hash.to_owned(),
            segment,
        }
    }

    /// Replaces the file in a session's folder; returns when it is on the medium.
    pub(super) fn write(&self, disk: &dyn Disk, folder: &Path) -> Result<(), StoreError> {
        let path = folder.join(layout::HEAD);
        atomic::replace(disk, &path, &sealed::seal(self, &path)?)
    }

    /// Reads the file in a session's folder.
    pub(super) fn read(disk: &dyn Disk, folder: &Path) -> Result<HeadFile, StoreError> {
        let path = folder.join(layout::HEAD);
        let bytes = match disk.read(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(HeadFile::None),
            read => read.at(&path)?,
        };
        if sealed::is_intact(&bytes) != Some(true) {
            return Ok(HeadFile::Damaged);
        }
        match serde_json::from_slice::<Self>(&bytes) {
            Ok(head) if head.format == FORMAT => Ok(HeadFile::Is(head)),
            Ok(Self { format: found, .. }) => Err(StoreError::Newer { path, found }),
            Err(_) => Ok(HeadFile::Damaged),
        }
    }
}
