//! The results folder on a real disk: claims, rows, tables, erasure.

#![allow(clippy::unwrap_used)]

use crate::world::{
    HOSTILE, Kept, at, participant, protocol, question, real, request, session, started, telemetry,
};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Stdio;
use study_plan::protocol::Seat;
use study_session::outcome::{Event, Sample, State, Status};
use study_session::store::{
    ClaimRequest, Frozen, SeatKind, StateRequest, StoreError, StudyFolder, next_row, participants,
};

fn open(results: &Path) -> StudyFolder {
    StudyFolder::open_or_create(results, &Kept::new().frozen(), at(0)).unwrap()
}

/// Runs a session as far as `events`; all of it if that is large.
fn run(study: &StudyFolder, request: &ClaimRequest, events: usize) -> Seat {
    let mut claimed = study.claim(request).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    let all = session(request.participant.as_str(), claimed.session, claimed.seat);
    for (event, n) in all.iter().zip(0..).take(events).skip(claimed.entries.len()) {
        journal.append(at(n), event).unwrap();
    }
    telemetry(claimed.folder.path(), &all[..all.len().min(events)]);
    claimed.seat
}

fn set(
    study: &StudyFolder,
    id: &str,
    state: State,
    erase: bool,
) -> Result<Option<u32>, StoreError> {
    let request = StateRequest {
        participant: participant(id),
        state,
        reason: "a test".to_owned(),
        erase,
    };
    study.set_state(&request, at(500)).map(|c| c.freed_row)
}

#[test]
fn an_unfinished_session_is_resumed_with_its_seat() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    assert_eq!(run(&study, &real("P01"), 8), Seat::Row(1));
    let claimed = study.claim(&real("P01")).unwrap();
    assert_eq!((claimed.session, claimed.seat), (1, Seat::Row(1)));
    assert_eq!(claimed.entries.len(), 8);
    let elsewhere = open(results.path()).claim(&real("P01"));
    assert!(
        matches!(elsewhere, Err(StoreError::Open { .. })),
        "{elsewhere:?}"
    );
    drop(claimed);
    run(&study, &real("P01"), 99);
    let over = study.claim(&real("P01"));
    assert!(matches!(over, Err(StoreError::Finished { .. })), "{over:?}");
}

#[test]
fn a_session_that_was_claimed_and_not_started_keeps_its_row() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    drop(study.claim(&real("P01")).unwrap());
    let again = study.claim(&real("P01")).unwrap();
    assert_eq!((again.session, again.seat), (1, Seat::Row(1)));
    assert_eq!(again.entries, []);
}

#[test]
fn the_row_of_a_drop_out_is_assigned_again() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    for (id, row) in [("P01", 1), ("P02", 2), ("P03", 3)] {
        assert_eq!(run(&study, &real(id), 8), Seat::Row(row));
    }
    assert_eq!(
        set(&study, "P02", State::DroppedOut, false).unwrap(),
        Some(2)
    );
    assert_eq!(next_row(None, &study.sessions().unwrap()), Some(2));
    let back = study.claim(&real("P02"));
    assert!(matches!(back, Err(StoreError::InState { .. })), "{back:?}");
    assert_eq!(run(&study, &real("P04"), 8), Seat::Row(2));
    assert_eq!(run(&study, &real("P05"), 8), Seat::Row(4));
    assert_eq!(set(&study, "P02", State::Excluded, false).unwrap(), None);
}

#[test]
fn a_rig_assigns_only_its_own_rows() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let rig = |id: &str| ClaimRequest {
        rows: Some(10..=11),
        ..real(id)
    };
    assert_eq!(run(&study, &rig("P01"), 3), Seat::Row(10));
    assert_eq!(run(&study, &rig("P02"), 3), Seat::Row(11));
    let full = study.claim(&rig("P03"));
    assert!(matches!(full, Err(StoreError::NoRow { .. })), "{full:?}");
    assert_eq!(run(&study, &real("P03"), 3), Seat::Row(1));
}

#[test]
fn pilots_and_simulated_participants_have_no_row() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    assert_eq!(
        run(&study, &request("T1", SeatKind::Pilot), 99),
        Seat::Pilot(1)
    );
    assert_eq!(
        run(&study, &request("SIM001", SeatKind::Simulated), 99),
        Seat::Simulated(1)
    );
    assert_eq!(
        run(&study, &request("SIM002", SeatKind::Simulated), 99),
        Seat::Simulated(2)
    );
    assert_eq!(run(&study, &real("P01"), 3), Seat::Row(1));
    let other = study.claim(&real("T1"));
    assert!(
        matches!(other, Err(StoreError::OtherKind { .. })),
        "{other:?}"
    );
}

#[test]
fn ids_that_differ_only_in_case_are_refused() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, &real("P01"), 3);
    let lower = study.claim(&real("p01"));
    assert!(
        matches!(lower, Err(StoreError::Collides { .. })),
        "{lower:?}"
    );
}

/// A command would take it for an option. Earlier releases accepted it.
#[test]
fn an_id_like_an_option_is_refused_unless_it_exists() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    for id in ["-x", "--", "-", "-01"] {
        let refused = study.claim(&real(id));
        assert!(
            matches!(refused, Err(StoreError::LikeOption { .. })),
            "{refused:?}"
        );
        let refused = set(&study, id, State::NoShow, false);
        assert!(
            matches!(refused, Err(StoreError::LikeOption { .. })),
            "{refused:?}"
        );
        assert!(!study.path().join("sessions").join(id).exists());
    }
    std::fs::create_dir_all(study.path().join("sessions/-x")).unwrap();
    assert_eq!(run(&study, &real("-x"), 3), Seat::Row(1));
    set(&study, "-x", State::Excluded, false).unwrap();
    assert_eq!(study.sessions().unwrap()[0].participant.as_str(), "-x");
    run(&study, &real("x-1"), 3);
}

/// Windows has no folder of this name, and a results folder may be copied there.
#[test]
fn an_id_that_windows_keeps_for_a_device_is_refused_unless_it_exists() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    for id in ["CON", "nul", "Com1"] {
        let refused = study.claim(&real(id));
        assert!(
            matches!(refused, Err(StoreError::WindowsDevice { .. })),
            "{refused:?}"
        );
    }
    std::fs::create_dir_all(study.path().join("sessions/CON")).unwrap();
    assert_eq!(run(&study, &real("CON"), 3), Seat::Row(1));
}

#[test]
fn a_session_can_be_void_only_before_its_first_rating() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, &real("P01"), 3);
    assert_eq!(set(&study, "P01", State::Void, false).unwrap(), Some(1));
    let claimed = study.claim(&real("P01")).unwrap();
    assert_eq!((claimed.session, claimed.seat), (2, Seat::Row(1)));
    let open_here = set(&study, "P01", State::Void, false);
    assert!(
        matches!(open_here, Err(StoreError::Open { .. })),
        "{open_here:?}"
    );
    drop(claimed);
    run(&study, &real("P01"), 99);
    let rated = set(&study, "P01", State::Void, false);
    assert!(
        matches!(rated, Err(StoreError::StateRefused { .. })),
        "{rated:?}"
    );
    let derived = study.refresh(&protocol()).unwrap();
    assert_eq!(derived.rows.len(), 3, "the void session has no rows");
    assert_eq!(derived.participants.len(), 1);
    assert_eq!(derived.participants[0].session, 2);
}

#[test]
fn a_no_show_has_no_row_and_can_still_take_part() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let unknown = set(&study, "P01", State::Excluded, false);
    assert!(
        matches!(unknown, Err(StoreError::Unknown { .. })),
        "{unknown:?}"
    );
    set(&study, "P01", State::NoShow, false).unwrap();
    assert_eq!(next_row(None, &study.sessions().unwrap()), Some(1));
    assert_eq!(
        participants(&study.sessions().unwrap())[0].state,
        State::NoShow
    );
    assert!(study.claim(&real("P01")).is_err());
    set(&study, "P01", State::Void, false).unwrap();
    assert_eq!(run(&study, &real("P01"), 99), Seat::Row(1));
}

#[test]
fn changed_stimuli_need_another_study_and_changed_wording_an_amendment() {
    let results = tempfile::tempdir().unwrap();
    let mut study = open(results.path());
    let mut kept = Kept::new();
    kept.fingerprints.wording = "8".repeat(64);
    kept.files[0].1.extend_from_slice(b"# amended\n");
    let reopened = StudyFolder::open_or_create(results.path(), &kept.frozen(), at(1));
    assert!(
        matches!(reopened, Err(StoreError::NotAmended { .. })),
        "{reopened:?}"
    );
    assert!(
        reopened
            .unwrap_err()
            .hint()
            .unwrap()
            .contains("study amend")
    );
    let stale = open(results.path());
    assert_eq!(
        study
            .amend(&kept.frozen(), "a typing error", at(2))
            .unwrap(),
        2
    );
    assert_eq!(
        StudyFolder::open_or_create(results.path(), &kept.frozen(), at(3))
            .unwrap()
            .version(),
        2
    );
    let behind = stale.claim(&real("P01"));
    assert!(
        matches!(behind, Err(StoreError::AmendedMeanwhile { .. })),
        "{behind:?}"
    );
    assert_eq!(study.manifest().versions[1].reason, "a typing error");
    assert!(study.path().join("protocol/1/protocol.toml").exists());
    assert!(study.path().join("protocol/2/models/A.toml").exists());
    kept.fingerprints.stimulus = "9".repeat(64);
    let changed = study.amend(&kept.frozen(), "no", at(4));
    assert!(
        matches!(changed, Err(StoreError::StimulusChanged { .. })),
        "{changed:?}"
    );
}

#[test]
fn a_frozen_file_outside_the_folder_is_refused() {
    let results = tempfile::tempdir().unwrap();
    let kept = Kept::new();
    let files = vec![("../../escaped".to_owned(), vec![1])];
    let frozen = Frozen {
        files: &files,
        ..kept.frozen()
    };
    let refused = StudyFolder::open_or_create(results.path(), &frozen, at(0));
    assert!(
        matches!(refused, Err(StoreError::OutsideFolder { .. })),
        "{refused:?}"
    );
    assert!(!results.path().join("escaped").exists());
}

#[test]
fn a_changed_frozen_file_is_reported() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let clean = study.verify(None).unwrap();
    assert!(clean.iter().all(|f| !f.is_problem), "{clean:?}");
    std::fs::write(
        study.path().join("protocol/1/models/A.toml"),
        "id = \"B\"\n",
    )
    .unwrap();
    let found = study.verify(None).unwrap();
    assert!(
        found
            .iter()
            .any(|f| f.is_problem && f.place.ends_with("A.toml")),
        "{found:?}"
    );
}

#[test]
fn only_the_owner_can_read_the_files() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, &real("P01"), 9);
    study.refresh(&protocol()).unwrap();
    let mode = |path: &str| {
        let known = std::fs::metadata(study.path().join(path)).unwrap();
        known.permissions().mode() & 0o777
    };
    assert_eq!(mode("sessions/P01/1/journal.jsonl"), 0o600);
    assert_eq!(mode("ratings.csv"), 0o600);
    for folder in ["sessions", "sessions/P01", "sessions/P01/1", "protocol"] {
        assert_eq!(mode(folder), 0o700, "{folder}");
    }
    assert!(
        !study.path().join("sessions/P01/1/reserve").exists(),
        "the reserve is freed"
    );
}

#[test]
fn the_tables_have_what_happened() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, &real("P01"), 99);
    let derived = study.refresh(&protocol()).unwrap();
    assert_eq!(derived.rows.len(), 3);
    let [b, a, c] = &derived.rows[..] else {
        panic!("three trials");
    };
    // Trial 1 failed, was repeated last and counts with its second attempt.
    assert_eq!(
        (b.status, b.attempt, b.position),
        (Status::Ok, Some(2), Some(3))
    );
    assert_eq!(b.answers[&question("realism")].number(), Some(4.0));
    assert_eq!(b.previous_model.as_ref().unwrap().as_str(), "C");
    // The failed attempt was presented, so trial 2 followed B; its answer was corrected.
    assert_eq!(a.previous_model.as_ref().unwrap().as_str(), "B");
    assert_eq!(a.answers[&question("realism")].number(), Some(5.0));
    assert!(a.corrected && !b.corrected);
    assert_eq!(a.remarks, "first | second");
    assert_eq!((a.strokes, a.clamp_count), (Some(4), Some(1)));
    assert_eq!((a.exploration_s, a.response_s), (Some(3.25), Some(2.5)));
    assert_eq!(c.status, Status::Declined);
    assert!(c.declined);
    assert_eq!(derived.participants[0].trials_done, 3);
    let whats: Vec<&str> = derived.attempts.iter().map(|r| r.what.as_str()).collect();
    assert_eq!(whats.iter().filter(|w| **w == "attempt").count(), 4);
    assert_eq!(whats.iter().filter(|w| **w == "failure").count(), 1);
    assert_eq!(whats.iter().filter(|w| **w == "correction").count(), 1);
}

#[test]
fn a_hostile_comment_is_stored_as_typed_in_rfc_4180() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, &real("P01"), 99);
    study.refresh(&protocol()).unwrap();
    let bytes = std::fs::read(study.path().join("ratings.csv")).unwrap();
    let text = String::from_utf8(bytes.clone()).unwrap();
    assert!(text.starts_with("study,participant,session,row,trial,block,position,planned_position,model,role,repetition,previous_model,practice,pilot,simulated,device_kind,device_id,operator,tool_version,protocol_version,realism,comment,corrected,declined,remarks,reference_s,exploration_s,response_s,strokes,least_energy_j,switches_per_s,clamp_count,started_at,rated_at,attempt,status,vaf,lambda\r\n"), "{text}");
    assert!(
        text.contains("\"=1+1,\"\"quoted\"\"\r\nsecond line"),
        "{text}"
    );
    let mut reader = csv::Reader::from_reader(&bytes[..]);
    let column = reader
        .headers()
        .unwrap()
        .iter()
        .position(|h| h == "comment")
        .unwrap();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 3);
    assert_eq!(&rows[1][column], HOSTILE);
    assert_eq!(&rows[1][1], "P01");
    assert!(
        rows[1].iter().any(|c| c == "2007-03-22T10:00:07+01:00"),
        "{:?}",
        rows[1]
    );
}

#[test]
fn the_tables_are_the_same_bytes_from_the_same_journals() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    for id in ["P02", "P01"] {
        run(&study, &real(id), 20);
    }
    study.refresh(&protocol()).unwrap();
    let ratings = study.path().join("ratings.csv");
    let first = std::fs::read(&ratings).unwrap();
    assert!(
        study
            .verify(Some(&protocol()))
            .unwrap()
            .iter()
            .all(|f| !f.is_problem)
    );
    std::fs::write(&ratings, "lost").unwrap();
    assert!(
        study
            .verify(Some(&protocol()))
            .unwrap()
            .iter()
            .any(|f| f.is_problem)
    );
    study.refresh(&protocol()).unwrap();
    assert_eq!(std::fs::read(&ratings).unwrap(), first);
}

#[test]
fn telemetry_files_are_never_overwritten() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let claimed = study.claim(&real("P01")).unwrap();
    let sample = Sample {
        t_s: 0.001,
        x_mm: -1.5,
        v_mm_s: 20.0,
        force_command_n: 3.25,
        force_measured_n: None,
    };
    for measured in [None, Some(3.0)] {
        let mut writer = claimed.folder.telemetry(7, 1).unwrap();
        let sample = Sample {
            force_measured_n: measured,
            ..sample
        };
        writer.write(&[sample]).unwrap();
        writer.finish().unwrap();
    }
    let read = |name: &str| {
        let path = claimed.folder.path().join("telemetry").join(name);
        std::fs::read_to_string(path).unwrap()
    };
    let header = "t_s,x_mm,v_mm_s,force_command_n,force_measured_n\r\n";
    assert_eq!(
        read("007-a1.csv"),
        format!("{header}0.001,-1.5,20,3.25,\r\n")
    );
    assert_eq!(
        read("007-a1-2.csv"),
        format!("{header}0.001,-1.5,20,3.25,3\r\n")
    );
}

fn all_bytes(folder: &Path) -> Vec<u8> {
    let mut bytes = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            bytes.extend(all_bytes(&path));
        } else {
            bytes.extend(std::fs::read(&path).unwrap());
        }
    }
    bytes
}

#[test]
fn erasure_leaves_only_a_tombstone() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, &real("P01"), 99);
    run(&study, &real("P02"), 99);
    study.refresh(&protocol()).unwrap();
    assert_eq!(set(&study, "P01", State::Withdrawn, true).unwrap(), Some(1));
    let derived = study.refresh(&protocol()).unwrap();
    assert_eq!(derived.rows.len(), 3);
    assert!(derived.participants[0].erased);
    assert_eq!(derived.participants[0].row, Some(1));
    assert!(!study.path().join("sessions/P01/1").exists());
    set(&study, "P02", State::Excluded, true).unwrap();
    study.refresh(&protocol()).unwrap();
    let left = String::from_utf8(all_bytes(study.path())).unwrap();
    assert!(
        !left.contains("second line") && !left.contains("felt nothing"),
        "{left}"
    );
    let found = study.verify(Some(&protocol())).unwrap();
    assert!(found.iter().all(|f| !f.is_problem), "{found:?}");
    assert_eq!(
        found.iter().filter(|f| f.what.contains("erased")).count(),
        2
    );
    let again = study.claim(&real("P01"));
    assert!(matches!(again, Err(StoreError::Erased { .. })), "{again:?}");
    // An interrupted erasure is completed by the same command.
    std::fs::create_dir(study.path().join("sessions/P01/1")).unwrap();
    std::fs::write(study.path().join("sessions/P01/1/journal.jsonl"), "left").unwrap();
    assert!(study.verify(None).unwrap().iter().any(|f| f.is_problem));
    set(&study, "P01", State::Withdrawn, true).unwrap();
    assert!(study.verify(None).unwrap().iter().all(|f| !f.is_problem));
}

#[test]
fn an_unsaved_rating_is_saved_on_a_full_disk() {
    let mount = tempfile::tempdir().unwrap();
    let mounted = std::process::Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=512k", "tmpfs"])
        .arg(mount.path())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|s| s.success());
    if !mounted {
        eprintln!("SKIPPED: a small tmpfs cannot be mounted here, the full disk is not tested");
        return;
    }
    let result = std::panic::catch_unwind(|| fill(mount.path()));
    let _ = std::process::Command::new("umount")
        .arg("-l")
        .arg(mount.path())
        .status();
    result.unwrap();
}

fn fill(results: &Path) {
    let study = open(results);
    let mut claimed = study.claim(&real("P01")).unwrap();
    assert!(
        claimed
            .notices
            .iter()
            .any(|n| n.contains("KiB of disk space are free")),
        "{:?}",
        claimed.notices
    );
    let mut journal = claimed.folder.journal().unwrap();
    journal
        .append(at(0), &started("P01", 1, claimed.seat))
        .unwrap();
    let filler = results.join("filler");
    let full = std::fs::write(&filler, vec![7u8; 1 << 20]);
    assert!(full.is_err());
    let all = session("P01", 1, claimed.seat);
    let mut failures = 0;
    for (event, n) in all.iter().zip(0..).skip(1) {
        if let Err(e) = journal.append(at(n), event) {
            assert!(e.is_full(), "{e}");
            failures += 1;
            journal.new_segment().unwrap();
            journal.append(at(n), event).unwrap();
        }
    }
    assert_eq!(
        failures, 1,
        "the reserve is enough for the rest of this session"
    );
    drop(journal);
    drop(claimed);
    let read = study.sessions().unwrap().remove(0);
    let events: Vec<Event> = read.entries.into_iter().map(|e| e.event).collect();
    assert_eq!(events, all);
    std::fs::write(&filler, vec![7u8; 1 << 20]).unwrap_err();
    let next = study.claim(&real("P02"));
    assert!(matches!(next, Err(StoreError::Full { .. })), "{next:?}");
    assert!(
        !study.path().join("sessions/P02").exists(),
        "nothing was claimed"
    );
}
