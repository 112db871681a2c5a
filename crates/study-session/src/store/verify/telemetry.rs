//! Comparing the telemetry files with the journal.
//!
//! A file that the journal names is compared by its hash. Files of earlier releases
//! and of attempts that a crash interrupted have none: their lines are counted. Fewer
//! lines than samples are not a problem: a crash or a full disk ends a file early.

use super::Finding;
use crate::outcome::{Event, TelemetryFile};
use crate::store::sessions::SessionData;
use crate::store::telemetry::header;
use crate::store::{StudyFolder, layout, plain};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use study_base::hex::sha256;

/// Trial, attempt and, if the trial has several, interval.
type Presented = (u32, u32, Option<u32>);

impl StudyFolder {
    /// Compares the telemetry files of a session with each playback in the journal. A
    /// playback without a confirmed end has none.
    pub(super) fn verify_telemetry(
        &self,
        session: &SessionData,
        place: &str,
        found: &mut Vec<Finding>,
    ) {
        let folder = format!("{place}/{}", layout::TELEMETRY);
        // Attempts of which the journal says more than the number of samples.
        let mut known = BTreeSet::new();
        for entry in &session.entries {
            match &entry.event {
                Event::TelemetryLost {
                    trial,
                    attempt,
                    reason,
                    interval,
                } => {
                    known.insert((*trial, *attempt, *interval));
                    let name = layout::telemetry_of(*trial, *attempt, *interval, 1);
                    let what = format!("not saved, or only in part: {reason}");
                    found.push(Finding::note(format!("{folder}/{name}"), what));
                }
                Event::PlaybackEnded {
                    trial,
                    attempt,
                    playback,
                    telemetry: Some(file),
                    interval,
                    ..
                } => {
                    known.insert((*trial, *attempt, *interval));
                    self.verify_hash(session, file, playback.samples, &folder, found);
                }
                _ => {}
            }
        }
        let mut counted: BTreeMap<Presented, u64> = BTreeMap::new();
        for (trial, attempt) in session.history.all_attempts() {
            for presentation in &attempt.presentations {
                let several = attempt.is_numbered().then_some(presentation.interval);
                let presented = (trial, attempt.number, several);
                let samples = presentation.ended.map_or(0, |(_, e)| e.playback.samples);
                if samples > 0 && !known.contains(&presented) {
                    *counted.entry(presented).or_default() += samples;
                }
            }
        }
        for (presented, samples) in counted {
            self.count_lines(session, presented, samples, &folder, found);
        }
    }

    /// Compares a file with the hash that the journal has of it.
    fn verify_hash(
        &self,
        session: &SessionData,
        file: &TelemetryFile,
        samples: u64,
        folder: &str,
        found: &mut Vec<Finding>,
    ) {
        let place = format!("{folder}/{}", file.file);
        let path = session.path.join(layout::TELEMETRY).join(&file.file);
        let is_name = !file.file.contains(['/', '\\', '\0']);
        let read = self.disk.read(&path);
        let what = match read.as_deref() {
            Ok(bytes) if is_name && sha256(bytes) == file.sha256 => {
                found.extend(too_few(lines_of(bytes).unwrap_or(0), samples, &place));
                return;
            }
            Ok(_) => "not the file that was recorded (its SHA-256 differs from the journal)".into(),
            Err(e) if e.kind() == io::ErrorKind::NotFound => missing(samples),
            Err(e) => plain(e),
        };
        found.push(Finding::problem(place, what));
    }

    /// Compares the number of lines of all files of an attempt with its samples.
    fn count_lines(
        &self,
        session: &SessionData,
        (trial, attempt, interval): Presented,
        samples: u64,
        folder: &str,
        found: &mut Vec<Finding>,
    ) {
        let place = format!(
            "{folder}/{}",
            layout::telemetry_of(trial, attempt, interval, 1)
        );
        let (mut exists, mut lines) = (false, 0);
        for copy in 1.. {
            let name = layout::telemetry_of(trial, attempt, interval, copy);
            let read = self
                .disk
                .read(&session.path.join(layout::TELEMETRY).join(name));
            match read.map(|bytes| lines_of(&bytes)) {
                Ok(Some(n)) => (exists, lines) = (true, lines + n),
                Ok(None) => {
                    let what = "not a telemetry file of study";
                    return found.push(Finding::problem(place, what));
                }
                Err(e) if e.kind() == io::ErrorKind::NotFound => break,
                Err(e) => return found.push(Finding::problem(place, plain(&e))),
            }
        }
        match exists {
            true => found.extend(too_few(lines, samples, &place)),
            false => found.push(Finding::problem(place, missing(samples))),
        }
    }
}

fn missing(samples: u64) -> String {
    format!("missing; the journal reports {samples} samples")
}

fn too_few(lines: u64, samples: u64, place: &str) -> Option<Finding> {
    let what =
        format!("contains {lines} of {samples} samples; a crash or a full disk ends a file early");
    (lines < samples).then(|| Finding::note(place, what))
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
