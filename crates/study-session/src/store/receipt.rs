//! `receipt.json`: the last record of a session when it was left.
//!
//! It repeats what `head.json` says at that moment, for a reader outside the folder: a
//! printed receipt shows later that no record is missing or changed.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::manifest::CHECKSUM;
use super::{atomic, layout, sealed};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::Path;

/// Format of the file.
const FORMAT: &str = "study-receipt/1";

/// The end of a journal when the session was left.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Receipt {
    format: String,
    /// Sequence number of the last record; also the number of events.
    pub seq: u64,
    /// Hash of the last record, as in `prev` of a following record.
    pub hash: String,
}

impl Receipt {
    pub(super) fn new(seq: u64, hash: &str) -> Self {
        Self {
            format: FORMAT.to_owned(),
            seq,
            hash: hash.to_owned(),
        }
    }

    pub(super) fn write(&self, disk: &dyn Disk, folder: &Path) -> Result<(), StoreError> {
        let path = folder.join(layout::RECEIPT);
        atomic::replace(disk, &path, &sealed::seal(self, &path)?)
    }

    /// Reads the receipt of a session's folder; `None` if there is none. A damaged one
    /// is an error.
    pub(super) fn read(disk: &dyn Disk, folder: &Path) -> Result<Option<Self>, StoreError> {
        let path = folder.join(layout::RECEIPT);
        let bytes = match disk.read(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            read => read.at(&path)?,
        };
        let receipt = serde_json::from_slice(&bytes).ok();
        match receipt.filter(|_| sealed::is_intact(&bytes) == Some(true)) {
            Some(receipt) => Ok(Some(receipt)),
            None => Err(StoreError::Damaged {
                path,
                what: CHECKSUM.to_owned(),
            }),
        }
    }
}
