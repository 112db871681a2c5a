//! The saver: what becomes of telemetry, and events that wait together.

#![allow(clippy::unwrap_used)]

use crate::memory::MemoryDisk;
use crate::process::open;
use crate::world::{at, begun, ended, real, started};
use std::cell::Cell;
use std::path::Path;
use std::rc::Rc;
use study::runner::saver::{Job, SaveEvent, Saver, Saving};
use study_session::outcome::{Author, Event, Sample};
use study_session::store::StudyFolder;
use study_session::store::disk::Disk as _;

const SAMPLE: Sample = Sample {
    t_s: 0.001,
    x_mm: 1.0,
    v_mm_s: 0.0,
    force_command_n: 0.5,
    force_measured_n: None,
};

fn telemetry() -> &'static Path {
    Path::new("results/small/sessions/P01/1/telemetry")
}

/// Saves one playback; `before` changes the disk before its telemetry begins.
fn playback(disk: &MemoryDisk, before: impl Fn(&MemoryDisk)) -> (StudyFolder, Vec<SaveEvent>) {
    let study = open(disk).unwrap();
    let mut claimed = study.claim(&real("P01")).unwrap();
    let start = started("P01", 1, claimed.seat);
    let journal = claimed.folder.journal().unwrap();
    let mut saver = Saver::new(claimed.folder, journal, Saving::Loop);
    before(disk);
    saver.send(Job::Append(at(0), start));
    saver.send(Job::Append(at(1), begun(1, 1, 1, "B")));
    saver.send(Job::TelemetryBegin {
        trial: 1,
        attempt: 1,
        interval: None,
    });
    saver.send(Job::Telemetry(vec![SAMPLE; 3250]));
    saver.send(Job::TelemetryEnd);
    saver.send(Job::Append(at(2), ended(1, 1)));
    let mut events = saver.drain();
    events.extend(saver.finish());
    (study, events)
}

fn findings(study: &StudyFolder) -> Vec<(bool, String)> {
    let found = study.verify(None).unwrap().into_iter();
    found
        .map(|f| (f.is_problem, format!("{}: {}", f.place, f.what)))
        .collect()
}

#[test]
fn the_journal_has_the_hash_of_the_telemetry() {
    let disk = MemoryDisk::new();
    let (study, events) = playback(&disk, |_| {});
    assert_eq!(
        events[..3],
        [SaveEvent::Saved, SaveEvent::Saved, SaveEvent::Saved]
    );
    assert!(
        matches!(&events[3..], [SaveEvent::Left(receipt)] if receipt.seq == 3),
        "{events:?}"
    );
    assert_eq!(findings(&study), []);
    let file = telemetry().join("001-a1.csv");
    let mut bytes = disk.read(&file).unwrap();
    let last = bytes.len() - 3;
    bytes[last - 1] ^= 1;
    disk.truncate(&file, 0).unwrap();
    disk.open(&file).unwrap().write_all(&bytes).unwrap();
    let [(true, changed)] = &findings(&study)[..] else {
        panic!("{:?}", findings(&study));
    };
    assert!(
        changed.contains("001-a1.csv: not the file that was recorded"),
        "{changed}"
    );
    disk.remove_file(&file).unwrap();
    let [(true, missing)] = &findings(&study)[..] else {
        panic!("{:?}", findings(&study));
    };
    assert!(missing.contains("001-a1.csv: missing"), "{missing}");
}

#[test]
fn lost_telemetry_is_in_the_journal_and_no_problem_for_ever() {
    let disk = MemoryDisk::new();
    // A file has the name of the folder.
    let (study, events) = playback(&disk, |disk| drop(disk.create(telemetry()).unwrap()));
    let is_lost = |e: &SaveEvent| matches!(e, SaveEvent::TelemetryLost(_));
    assert!(events.iter().any(is_lost), "{events:?}");
    let saved = events.iter().filter(|e| **e == SaveEvent::Saved).count();
    assert_eq!(
        saved, 3,
        "the session waits for three events and knows of no fourth"
    );
    disk.remove_file(telemetry()).unwrap();
    let session = study.sessions().unwrap().remove(0);
    let lost = |e: &Event| {
        matches!(
            e,
            Event::TelemetryLost {
                trial: 1,
                attempt: 1,
                ..
            }
        )
    };
    assert!(session.entries.iter().any(|e| lost(&e.event)));
    let [(false, note)] = &findings(&study)[..] else {
        panic!("{:?}", findings(&study));
    };
    assert!(
        note.contains("001-a1.csv: not saved, or only in part"),
        "{note}"
    );
}

/// The program ended between the copy of the consent document and its event; then the participant says no, or yes.
#[test]
fn who_refuses_after_a_crash_leaves_no_copy_of_the_consent() {
    for accepted in [false, true] {
        let disk = MemoryDisk::new();
        let study = open(&disk).unwrap();
        let mut claimed = study.claim(&real("P01")).unwrap();
        let start = started("P01", 1, claimed.seat);
        let journal = claimed.folder.journal().unwrap();
        claimed.folder.keep_consent("signed: QXJ").unwrap();
        let mut saver = Saver::new(claimed.folder, journal, Saving::Loop);
        saver.send(Job::Append(at(0), start));
        let consented = Event::Consented {
            document: "Information".to_owned(),
            version: "2".to_owned(),
            accepted,
            by: Author::Participant,
        };
        saver.send(Job::Append(at(1), consented));
        let events = saver.finish();
        let saved = events.iter().filter(|e| **e == SaveEvent::Saved).count();
        assert_eq!(saved, 2, "{events:?}");
        let copy = disk.read(Path::new("results/small/sessions/P01/1/consent.txt"));
        assert_eq!(copy.is_ok(), accepted);
    }
}

/// A saver that is given turns, and the number of jobs that the next ones do.
fn in_turns(disk: &MemoryDisk) -> (Saver, Rc<Cell<usize>>) {
    let mut claimed = open(disk).unwrap().claim(&real("P01")).unwrap();
    let start = started("P01", 1, claimed.seat);
    let journal = claimed.folder.journal().unwrap();
    let jobs = Rc::new(Cell::new(0));
    let given = jobs.clone();
    let turns = Saving::Turns(Rc::new(move |_| given.get()));
    let mut saver = Saver::new(claimed.folder, journal, turns);
    let events = [start, begun(1, 1, 1, "B"), ended(1, 1)];
    for (s, event) in (0..).zip(events) {
        saver.send(Job::Append(at(s), event));
    }
    (saver, jobs)
}

/// What is acknowledged is in the journal, and nothing is before a turn is given.
#[test]
fn a_saver_in_turns_does_as_much_as_it_is_given() {
    let disk = MemoryDisk::new();
    let (mut saver, jobs) = in_turns(&disk);
    let events = || open(&disk).unwrap().sessions().unwrap()[0].entries.len();
    let saved = |events: Vec<SaveEvent>| {
        let saved = events.iter().filter(|e| **e == SaveEvent::Saved);
        saved.count()
    };
    for (given, written, all) in [(0, 0, 0), (2, 2, 2), (0, 0, 2), (9, 1, 3), (9, 0, 3)] {
        jobs.set(given);
        assert_eq!((saved(saver.drain()), events()), (written, all));
    }
    assert!(matches!(&saver.finish()[..], [SaveEvent::Left(_)]));
}

#[test]
fn a_saver_in_turns_gives_a_disk_up_that_does_not_answer_at_the_end() {
    for (given, saved) in [(0, 0), (1, 3)] {
        let disk = MemoryDisk::new();
        let (saver, jobs) = in_turns(&disk);
        jobs.set(given);
        let left = saver.finish().len();
        // The receipt follows the last event.
        assert_eq!(left, saved + usize::from(saved > 0));
        let entries = &open(&disk).unwrap().sessions().unwrap()[0].entries;
        assert_eq!(entries.len(), saved);
    }
}
