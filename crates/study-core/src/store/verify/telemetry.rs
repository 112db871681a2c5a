//! Comparing the telemetry files with the journal.
//!
//! Only files and lines are counted; the numbers in them have no checksum. A file
//! with fewer samples than the journal reports is not a problem: a crash or a full
//! disk ends a file early.

use super::Finding;
use crate::store::sessions::SessionData;
use crate::store::telemetry::header;
use crate::store::{StoreError, StudyFolder, layout, plain};
use std::collections::BTreeMap;
use std::io;

impl StudyFolder {
    /// Compares the telemetry files of a session with the number of samples of each
    /// playback in the journal. A playback without a confirmed end has none.
    pub(super) fn verify_telemetry(
        &self,
        session: &SessionData,
        place: &str,
        found: &mut Vec<Finding>,
    ) -> Result<(), StoreError> {
        let mut counted: BTreeMap<(u32, u32), u64> = BTreeMap::new();
        for (trial, attempt) in session.history.all_attempts() {
            let samples = attempt.ended.map_or(0, |e| e.playback.samples);
            if samples > 0 {
                *counted.entry((trial, attempt.number)).or_default() += samples;
            }
        }
        let folder = session.path.join(layout::TELEMETRY);
        for ((trial, attempt), samples) in counted {
            let name = layout::telemetry(trial, attempt, 1);
            let place = format!("{place}/{}/{name}", layout::TELEMETRY);
            let (mut exists, mut lines, mut foreign) = (false, 0, false);
            for copy in 1.. {
                match self
                    .disk
                    .read(&folder.join(layout::telemetry(trial, attempt, copy)))
                {
                    Ok(bytes) => {
                        exists = true;
                        match lines_of(&bytes) {
                            Some(n) => lines += n,
                            None => foreign = true,
                        }
                    }
                    Err(e) if e.kind() == io::ErrorKind::NotFound => break,
                    Err(e) => {
                        found.push(Finding::problem(&place, plain(&e)));
                        exists = true;
                        foreign = true;
                        break;
                    }
                }
            }
            if !exists {
                let what = format!("missing; the journal reports {samples} samples");
                found.push(Finding::problem(place, what));
            } else if foreign {
                found.push(Finding::problem(place, "not a telemetry file of study"));
            } else if lines < samples {
                found.push(Finding::note(
                    place,
                    format!(
                        "contains {lines} of {samples} samples; a crash or a full disk ends a file early"
                    ),
                ));
            }
        }
        Ok(())
    }
}

/// Number of complete sample lines of a file; `None` if its first line is not the
/// header. An empty file has none: its buffer was never written.
fn lines_of(bytes: &[u8]) -> Option<u64> {
    let header = header();
    let header = header.as_bytes();
    if bytes.len() < header.len() {
        return header.starts_with(bytes).then_some(0);
    }
    let samples = bytes.strip_prefix(header)?;
    Some(samples.iter().filter(|b| **b == b'\n').count() as u64)
}
