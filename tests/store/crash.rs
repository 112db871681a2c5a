//! A kill, a loss of power and a failing disk at every call that the store makes.

#![allow(clippy::unwrap_used)]

use crate::memory::{CRASHES, Crash, Fault, MemoryDisk};
use crate::process::{Told, finishes, noticed, open, process};
use crate::world::protocol;
use std::io::ErrorKind;
use std::path::Path;
use study_session::store::StoreError;

fn p01() -> Told {
    Told::of("P01")
}

/// The next process finds the disk so, finishes the session, and all is well.
fn comes_back(disk: &MemoryDisk, told: &Told, why: &str) {
    noticed(disk, std::slice::from_ref(told)).unwrap_or_else(|e| panic!("{why}: {e}"));
    finishes(disk, &mut told.clone()).unwrap_or_else(|e| panic!("{why}: {e}"));
}

fn calls_of_a_session() -> usize {
    let disk = MemoryDisk::new();
    process(&disk, &mut p01()).unwrap();
    disk.calls()
}

/// The call that writes the event with this number, from 0.
fn call_of_event(number: usize) -> usize {
    let disk = MemoryDisk::new();
    let mut told = p01();
    told.until = Some(number);
    process(&disk, &mut told).unwrap();
    assert_eq!(told.events.len(), number);
    // After the last event come the receipt and the tables.
    let all = disk.calls();
    let disk = MemoryDisk::new();
    let counts = (0..all).filter(|call| {
        let again = disk.after(Crash::Process);
        again.plan(*call, Fault::Kill);
        let mut told = p01();
        told.until = Some(number);
        let _ = process(&again, &mut told);
        told.events.len() < number
    });
    counts.count()
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
            let mut told = p01();
            // Drops of a dead process touch nothing: the disk says no.
            let _ = process(&disk, &mut told);
            assert!(disk.is_dead());
            for crash in CRASHES {
                let why = format!("{fault:?} at {call}, {crash:?}");
                comes_back(&disk.after(crash), &told, &why);
                states += 1;
            }
        }
    }
    println!("{states} crash states");
}

#[test]
fn recovery_can_be_killed_at_each_step_and_run_again() {
    let in_event = call_of_event(6);
    for first in [Crash::Half, Crash::Zeros] {
        let disk = MemoryDisk::new();
        disk.plan(in_event, Fault::KillInWrite);
        let mut told = p01();
        let _ = process(&disk, &mut told);
        assert_eq!(told.events.len(), 6);
        let torn = disk.after(first);
        let whole = torn.after(Crash::Process);
        process(&whole, &mut told.clone()).unwrap();
        for fault in [Fault::Kill, Fault::KillInWrite] {
            for call in 0..whole.calls() {
                let second = torn.after(Crash::Process);
                second.plan(call, fault);
                let mut told = told.clone();
                let _ = process(&second, &mut told);
                for crash in [Crash::OnlySynced, Crash::Half, Crash::Strict(call as u64)] {
                    let why = format!("{first:?}, {fault:?} at {call}, {crash:?}");
                    comes_back(&second.after(crash), &told, &why);
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
        Fault::From(ErrorKind::Other),
    ];
    for fault in faults {
        for call in 0..calls {
            let disk = MemoryDisk::new();
            disk.plan(call, fault);
            let mut told = p01();
            let _ = process(&disk, &mut told);
            for crash in [Crash::OnlySynced, Crash::Zeros] {
                let why = format!("{fault:?} at {call}, {crash:?}");
                comes_back(&disk.after(crash), &told, &why);
            }
        }
    }
}

/// A process may die between the creation of a name and its sync, and the next one
/// finds the name although it is not on the medium.
#[test]
fn a_session_that_was_resumed_after_a_kill_survives_a_loss_of_power() {
    for call in 0..calls_of_a_session() {
        let disk = MemoryDisk::new();
        disk.plan(call, Fault::Kill);
        let mut told = p01();
        let _ = process(&disk, &mut told);
        let resumed = disk.after(Crash::Process);
        let ended = process(&resumed, &mut told);
        let over = matches!(ended, Err(StoreError::Finished { .. }));
        assert!(over || ended.is_ok(), "{call}: {ended:?}");
        let why = format!("killed at {call}, resumed, power lost");
        comes_back(&resumed.after(Crash::OnlySynced), &told, &why);
    }
}

/// The tables then name a participant whose claim never reached the medium.
#[test]
fn tables_that_were_derived_after_a_kill_do_not_outlive_their_journals() {
    for call in 0..calls_of_a_session() {
        let disk = MemoryDisk::new();
        disk.plan(call, Fault::Kill);
        let mut told = p01();
        let _ = process(&disk, &mut told);
        let started = disk.after(Crash::Process);
        open(&started).unwrap().refresh(&protocol()).unwrap();
        for crash in [Crash::OnlySynced, Crash::BytesOnly] {
            let why = format!("killed at {call}, tables derived, {crash:?}");
            comes_back(&started.after(crash), &told, &why);
        }
    }
}

/// The second process reads from the cache what the disk refused to take from the first.
#[test]
fn what_a_failed_sync_left_in_the_cache_is_written_again_by_the_next_process() {
    let calls = calls_of_a_session();
    let mut failed = 0;
    for call in 0..calls {
        let disk = MemoryDisk::new();
        // Nothing can be written any more: the process gives up.
        disk.plan(call, Fault::From(ErrorKind::Other));
        let mut told = p01();
        failed += usize::from(process(&disk, &mut told).is_err());
        let next = disk.after(Crash::Process);
        let ended = process(&next, &mut told);
        let over = matches!(ended, Err(StoreError::Finished { .. }));
        assert!(over || ended.is_ok(), "{call}: {ended:?}");
        let why = format!("failing from {call}, resumed, power lost");
        comes_back(&next.after(Crash::OnlySynced), &told, &why);
    }
    assert_eq!(failed, calls);
}

/// Whether a loss of power after a whole session loses what was acknowledged.
fn lost_with(plant: impl Fn(&MemoryDisk)) -> bool {
    let disk = MemoryDisk::new();
    plant(&disk);
    let mut told = p01();
    process(&disk, &mut told).unwrap();
    noticed(&disk.after(Crash::OnlySynced), &[told]).is_err()
}

#[test]
fn the_harness_sees_a_missing_sync_of_a_file_and_of_a_folder() {
    let is_file = |p: &Path| p.extension().is_some();
    assert!(!lost_with(|_| {}));
    assert!(lost_with(|disk| disk.plant_no_sync(is_file)));
    assert!(lost_with(
        |disk| disk.plant_no_sync(|p| p.extension().is_none())
    ));
}
