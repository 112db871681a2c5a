//! A process that runs a short session, and what it was told is on disk.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used)]

use crate::memory::MemoryDisk;
use crate::world::{Kept, at, protocol, real, session};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use study_plan::protocol::Seat;
use study_session::outcome::{Entry, Event, Sample};
use study_session::store::disk::Disk as _;
use study_session::store::{SessionFolder, StoreError, StudyFolder};

/// What a process was told about the session of a participant.
#[derive(Debug, Clone)]
pub struct Told {
    pub id: &'static str,
    /// Once the claim is acknowledged.
    pub seat: Option<Seat>,
    pub events: Vec<Event>,
    /// Leaves before this event.
    pub until: Option<usize>,
}

impl Told {
    pub fn of(id: &'static str) -> Self {
        Self {
            id,
            seat: None,
            events: Vec::new(),
            until: None,
        }
    }

    pub fn folder(&self) -> PathBuf {
        Path::new("results/small/sessions").join(self.id).join("1")
    }
}

/// A short session: what it says does not matter here.
pub fn script(id: &str, seat: Seat) -> Vec<Event> {
    let mut events = session(id, 1, seat);
    events.truncate(9);
    events.push(Event::Finished);
    events
}

/// The events as in the script, which does not know of telemetry files.
pub fn scripted<'a>(entries: impl IntoIterator<Item = &'a Entry>) -> Vec<Event> {
    let mut events: Vec<Event> = entries.into_iter().map(|e| e.event.clone()).collect();
    events.retain(|e| !matches!(e, Event::TelemetryLost { .. }));
    for event in &mut events {
        if let Event::PlaybackEnded { telemetry, .. } = event {
            *telemetry = None;
        }
    }
    events
}

pub fn open(disk: &MemoryDisk) -> Result<StudyFolder, StoreError> {
    let kept = Kept::new();
    StudyFolder::open_or_create_on(
        Arc::new(disk.clone()),
        Path::new("results"),
        &kept.frozen(),
        at(0),
    )
}

/// Runs the session from wherever it stands to its end, as `study run` does: records
/// that fail go to a new segment. Up to three events are written together.
pub fn process(disk: &MemoryDisk, told: &mut Told) -> Result<(), StoreError> {
    let study = open(disk)?;
    study.refresh(&protocol())?;
    run(&study, told)?;
    study.refresh(&protocol()).map(drop)
}

pub fn run(study: &StudyFolder, told: &mut Told) -> Result<(), StoreError> {
    let mut claimed = study.claim(&real(told.id))?;
    assert_eq!(claimed.session, 1);
    assert!(
        told.seat.is_none_or(|seat| seat == claimed.seat),
        "another row"
    );
    told.seat = Some(claimed.seat);
    let all = script(told.id, claimed.seat);
    let had = scripted(&claimed.entries);
    assert_eq!(had, all[..had.len()], "what was read is what was written");
    let before = told.events.len();
    assert!(had.len() >= before, "an acknowledged event is lost");
    assert!(had.len() <= before + 3, "only three can be in doubt");
    told.events = had;
    let mut journal = claimed.folder.journal()?;
    while told.events.len() < told.until.unwrap_or(all.len()).min(all.len()) {
        let first = told.events.len();
        let together = (1 + first % 3).min(all.len() - first);
        let mut events = Vec::new();
        for event in &all[first..first + together] {
            events.extend(with_telemetry(&claimed.folder, event));
        }
        let moments: Vec<_> = events.iter().map(|e| (at(first as u64), e)).collect();
        let mut written = journal.append_all(&moments);
        for _ in 0..3 {
            if written.is_err() {
                let again = journal.append_all(&moments);
                assert!(
                    matches!(again, Err(StoreError::SegmentFailed { .. })),
                    "a file is not touched after a failure"
                );
                written = journal
                    .new_segment()
                    .and_then(|()| journal.append_all(&moments));
            }
        }
        written?;
        told.events.extend_from_slice(&all[first..first + together]);
    }
    journal.receipt().map(drop)
}

/// An event as the saver writes it: the end of a playback with its telemetry.
fn with_telemetry(folder: &SessionFolder, event: &Event) -> Vec<Event> {
    let mut event = event.clone();
    let Event::PlaybackEnded {
        trial,
        attempt,
        telemetry,
        ..
    } = &mut event
    else {
        return vec![event];
    };
    let sample = Sample {
        t_s: 0.001,
        x_mm: 1.0,
        v_mm_s: 2.0,
        force_command_n: 3.0,
        force_measured_n: None,
    };
    let written = folder.telemetry(*trial, *attempt).and_then(|mut file| {
        file.write(&[sample; 3])?;
        file.finish()
    });
    match written {
        Ok(file) => {
            *telemetry = Some(file);
            vec![event]
        }
        Err(e) => {
            let lost = Event::TelemetryLost {
                trial: *trial,
                attempt: *attempt,
                reason: e.to_string(),
                interval: None,
            };
            vec![lost, event]
        }
    }
}

/// Reads what is found after a crash, before any recovery: everything acknowledged is
/// there, and `head.json` says so.
///
/// # Errors
/// What is missing.
pub fn noticed(disk: &MemoryDisk, told: &[Told]) -> Result<(), String> {
    let told: Vec<&Told> = told.iter().filter(|t| t.seat.is_some()).collect();
    if told.is_empty() {
        return Ok(());
    }
    let study = StudyFolder::open_on(Arc::new(disk.clone()), Path::new("results/small"));
    let sessions = study
        .and_then(|s| s.sessions())
        .map_err(|e| e.to_string())?;
    for told in told {
        let session = sessions.iter().find(|s| s.participant.as_str() == told.id);
        let session = session.ok_or(format!("no session of {}", told.id))?;
        if session.seat != told.seat {
            return Err(format!("{} has {:?}", told.id, session.seat));
        }
        let had = scripted(&session.entries);
        if session.truncated || !had.starts_with(&told.events) {
            let (n, of) = (had.len(), told.events.len());
            return Err(format!("{}: {n} events of at least {of}", told.id));
        }
        let head = disk.read(&told.folder().join("head.json"));
        let head = head.map_err(|e| format!("{}: head.json: {e}", told.id))?;
        let head: serde_json::Value = serde_json::from_slice(&head).map_err(|e| e.to_string())?;
        let last = told.events.len() as u64;
        if head["seq"].as_u64() < Some(last) {
            return Err(format!("{}: head {head}, but {last} was saved", told.id));
        }
    }
    Ok(())
}

/// The next process finds the disk so, finishes the session, and nothing is wrong.
///
/// # Errors
/// What is wrong.
pub fn finishes(disk: &MemoryDisk, told: &mut Told) -> Result<(), String> {
    match process(disk, told) {
        Ok(()) => {}
        Err(StoreError::Finished { .. }) => {
            // The last event is there, although nobody was told.
            let seat = told.seat.ok_or("finished and never claimed")?;
            let sessions = open(disk).and_then(|study| study.sessions());
            let sessions = sessions.map_err(|e| e.to_string())?;
            let own = sessions.iter().find(|s| s.participant.as_str() == told.id);
            if own.is_none_or(|s| scripted(&s.entries) != script(told.id, seat)) {
                return Err("finished, but not the whole session".to_owned());
            }
        }
        Err(e) => return Err(e.to_string()),
    }
    let study = open(disk).map_err(|e| e.to_string())?;
    let found = study.verify(Some(&protocol())).map_err(|e| e.to_string())?;
    match found.iter().find(|f| f.is_problem) {
        Some(problem) => Err(format!("{problem:?}")),
        None => Ok(()),
    }
}
