//! A kill, a loss of power and a failing disk at every call that the store makes.

#![allow(clippy::unwrap_used)]

use crate::memory::{CRASHES, Crash, Fault, MemoryDisk};
use crate::world::{Kept, at, protocol, real, session};
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use study_core::outcome::Event;
use study_core::protocol::Seat;
use study_core::store::{StoreError, StudyFolder};

/// What a process was told is on disk.
#[derive(Debug, Default)]
struct Told {
    claimed: bool,
    events: Vec<Event>,
}

/// A short session: what it says does not matter here.
fn script(seat: Seat) -> Vec<Event> {
    let mut events = session("P01", 1, seat);
    events.truncate(9);
    events.push(Event::Finished);
    events
}

fn open(disk: &MemoryDisk) -> Result<StudyFolder, StoreError> {
    let kept = Kept::new();
    StudyFolder::open_or_create_on(
        Arc::new(disk.clone()),
        Path::new("results"),
        &kept.frozen(),
        at(0),
    )
}

/// Runs the session of P01 from wherever it stands to its end, as a runner would:
/// a record that fails goes to a new segment.
fn run(disk: &MemoryDisk, told: &mut Told) -> Result<(), StoreError> {
    let study = open(disk)?;
    let mut claimed = study.claim(&real("P01"))?;
    told.claimed = true;
    assert_eq!((claimed.session, claimed.seat), (1, Seat::Row(1)));
    let all = script(claimed.seat);
    let had: Vec<Event> = claimed.entries.iter().map(|e| e.event.clone()).collect();
    assert_eq!(had, all[..had.len()], "what was read is what was written");
    assert!(
        had.len() >= told.events.len(),
        "an acknowledged event is lost"
    );
    assert!(
        had.len() <= told.events.len() + 1,
        "only one can be in doubt"
    );
    told.events = had;
    let mut journal = claimed.folder.journal()?;
    for (n, event) in all.iter().enumerate().skip(told.events.len()) {
        let moment = at(n as u64);
        let mut seq = journal.append(moment, event);
        for _ in 0..3 {
            if seq.is_err() {
                assert!(
                    matches!(
                        journal.append(moment, event),
                        Err(StoreError::SegmentFailed { .. })
                    ),
                    "a file is not touched after a failure"
                );
                seq = journal
                    .new_segment()
                    .and_then(|()| journal.append(moment, event));
            }
        }
        assert_eq!(seq?, n as u64 + 1);
        told.events.push(event.clone());
    }
    study.refresh(&protocol())?;
    Ok(())
}

/// The next process finds the disk so, finishes the session, and all is well.
fn comes_back(disk: &MemoryDisk, told: &mut Told, why: &str) {
    // The claim comes first; if every event is on disk the session is over.
    let over = told.events.last() == Some(&Event::Finished);
    match run(disk, told) {
        Ok(()) => {}
        Err(StoreError::Finished { .. }) => {
            let study = open(disk).unwrap();
            study.refresh(&protocol()).unwrap();
            let sessions = study.sessions().unwrap();
            let events: Vec<Event> = sessions[0]
                .entries
                .iter()
                .map(|e| e.event.clone())
                .collect();
            assert_eq!(events, script(Seat::Row(1)), "{why}");
        }
        Err(e) => panic!("{why}: over {over}: {e}"),
    }
    let study = open(disk).unwrap();
    let wrong: Vec<_> = study
        .verify(Some(&protocol()))
        .unwrap()
        .into_iter()
        // The harness writes none.
        .filter(|f| f.is_problem && !f.place.contains("telemetry"))
        .collect();
    assert_eq!(wrong, [], "{why}");
}

fn calls_of_a_session() -> usize {
    let disk = MemoryDisk::new();
    run(&disk, &mut Told::default()).unwrap();
    disk.calls()
}

/// The call that writes the event with this number, from 0.
fn call_of_event(number: usize) -> usize {
    let disk = MemoryDisk::new();
    let study = open(&disk).unwrap();
    let mut claimed = study.claim(&real("P01")).unwrap();
    let _journal = claimed.folder.journal().unwrap();
    // A write and a sync for each event.
    disk.calls() + 2 * number
}

#[test]
fn nothing_acknowledged_is_lost_by_a_kill_or_loss_of_power_at_any_call() {
    let calls = calls_of_a_session();
    assert!(calls > 80, "{calls}");
    let mut states = 0;
    for fault in [Fault::Kill, Fault::KillInWrite] {
        for call in 0..calls {
            let disk = MemoryDisk::new();
            disk.plan(call, fault);
            let mut told = Told::default();
            // Drops of a dead process touch nothing: the disk says no.
            let _ = run(&disk, &mut told);
            assert!(disk.is_dead());
            for crash in CRASHES {
                let found = disk.after(crash);
                let mut told = Told {
                    claimed: told.claimed,
                    events: told.events.clone(),
                };
                comes_back(
                    &found,
                    &mut told,
                    &format!("{fault:?} at {call}, {crash:?}"),
                );
                states += 1;
            }
        }
    }
    println!("{states} crash states");
}

#[test]
fn recovery_can_be_killed_at_each_step_and_run_again() {
    for first in [Crash::Half, Crash::Zeros] {
        let disk = MemoryDisk::new();
        disk.plan(call_of_event(6), Fault::KillInWrite);
        let mut told = Told::default();
        let _ = run(&disk, &mut told);
        assert!(told.claimed && !told.events.is_empty());
        let torn = disk.after(first);
        let whole = torn.after(Crash::Process);
        let _ = run(
            &whole,
            &mut Told {
                claimed: true,
                events: told.events.clone(),
            },
        );
        for fault in [Fault::Kill, Fault::KillInWrite] {
            for call in 0..whole.calls() {
                let second = torn.after(Crash::Process);
                second.plan(call, fault);
                let mut again = Told {
                    claimed: true,
                    events: told.events.clone(),
                };
                let _ = run(&second, &mut again);
                for crash in CRASHES {
                    let mut told = Told {
                        claimed: true,
                        events: again.events.clone(),
                    };
                    let why = format!("{first:?}, {fault:?} at {call}, {crash:?}");
                    comes_back(&second.after(crash), &mut told, &why);
                }
            }
        }
    }
}

#[test]
fn a_disk_error_at_any_call_is_never_an_ok() {
    let calls = calls_of_a_session();
    let faults = [
        Fault::Error(ErrorKind::Other),
        Fault::Error(ErrorKind::StorageFull),
        Fault::Short(ErrorKind::StorageFull),
        Fault::Error(ErrorKind::Interrupted),
    ];
    for fault in faults {
        for call in 0..calls {
            let disk = MemoryDisk::new();
            disk.plan(call, fault);
            let mut told = Told::default();
            let _ = run(&disk, &mut told);
            for crash in [Crash::OnlySynced, Crash::Zeros] {
                let mut told = Told {
                    claimed: told.claimed,
                    events: told.events.clone(),
                };
                let why = format!("{fault:?} at {call}, {crash:?}");
                comes_back(&disk.after(crash), &mut told, &why);
            }
        }
    }
}

/// How many of the crash states after a whole session lose what was acknowledged.
fn lost_with(plant: impl Fn(&MemoryDisk)) -> bool {
    let disk = MemoryDisk::new();
    plant(&disk);
    let mut told = Told::default();
    run(&disk, &mut told).unwrap();
    let found = disk.after(Crash::OnlySynced);
    let Ok(study) = StudyFolder::open_on(Arc::new(found), Path::new("results/small")) else {
        return true;
    };
    study
        .sessions()
        .unwrap()
        .iter()
        .all(|s| s.entries.len() < told.events.len())
}

#[test]
fn the_harness_sees_a_missing_sync_of_a_file_and_of_a_folder() {
    assert!(!lost_with(|_| {}));
    assert!(lost_with(MemoryDisk::plant_no_file_sync));
    assert!(lost_with(MemoryDisk::plant_no_folder_sync));
}
