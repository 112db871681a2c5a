//! Whether the telemetry that a journal tells of is there.
//!
//! Files and lines are counted; the numbers in them have no checksum and are not
//! checked. A file that is shorter than the journal says is no fault: a crash or a
//! full disk ends one early.

use super::Finding;
use crate::store::sessions::SessionData;
use crate::store::telemetry::header;
use crate::store::{StoreError, StudyFolder, layout, plain};
use std::collections::BTreeMap;
use std::io;

impl StudyFolder {
    /// Compares the files of a session with what each playback reported. A playback
    /// whose samples were never counted has no entry in the journal to compare with.
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
            let (mut there, mut lines, mut foreign) = (false, 0, false);
            for copy in 1.. {
                match self
                    .disk
                    .read(&folder.join(layout::telemetry(trial, attempt, copy)))
                {
                    Ok(bytes) => {
                        there = true;
                        match lines_of(&bytes) {
                            Some(n) => lines += n,
                            None => foreign = true,
                        }
                    }
                    Err(e) if e.kind() == io::ErrorKind::NotFound => break,
                    Err(e) => {
                        found.push(Finding::wrong(&place, plain(&e)));
                        there = true;
                        foreign = true;
                        break;
                    }
                }
            }
            if !there {
                let what = format!("it is not there; the journal counts {samples} samples");
                found.push(Finding::wrong(place, what));
            } else if foreign {
                found.push(Finding::wrong(place, "it is not what study writes"));
            } else if lines < samples {
                found.push(Finding::note(
                    place,
                    format!(
                        "{lines} of the {samples} samples are there; a crash or a full disk ends a file early"
                    ),
                ));
            }
        }
        Ok(())
    }
}

/// Samples in a file, without a last line that has no end; `None` if it does not
/// begin as one of ours. An empty file is one whose buffer was never written.
fn lines_of(bytes: &[u8]) -> Option<u64> {
    let header = header();
    let header = header.as_bytes();
    if bytes.len() < header.len() {
        return header.starts_with(bytes).then_some(0);
    }
    let samples = bytes.strip_prefix(header)?;
    Some(samples.iter().filter(|b| **b == b'\n').count() as u64)
}
