//! The protected end of a journal: `head.json`, segments, receipts; and study.json.

#![allow(clippy::unwrap_used)]

use crate::journal::{interrupted, journal_path, small, unfinished};
use crate::memory::MemoryDisk;
use crate::world::{Kept, at, real};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use study_session::outcome::Event;
use study_session::store::disk::Disk as _;
use study_session::store::journal_record::{decode, hash};
use study_session::store::{DamageKind, StoreError, StudyFolder};

fn open(disk: &MemoryDisk) -> StudyFolder {
    StudyFolder::open_on(Arc::new(disk.clone()), small()).unwrap()
}

fn in_session(name: &str) -> PathBuf {
    small().join("sessions/P01/1").join(name)
}

fn lines(disk: &MemoryDisk, name: &str) -> Vec<Vec<u8>> {
    let bytes = disk.read(&in_session(name)).unwrap();
    let lines = bytes.split_inclusive(|b| *b == b'\n');
    lines.map(|l| l[..l.len() - 1].to_vec()).collect()
}

fn head(disk: &MemoryDisk) -> (u64, String, u64) {
    let bytes = disk.read(&in_session("head.json")).unwrap();
    let head: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    let number = |key: &str| head[key].as_u64().unwrap();
    let hash = head["hash"].as_str().unwrap().to_owned();
    (number("seq"), hash, number("segment"))
}

fn replace(disk: &MemoryDisk, path: &Path, bytes: &[u8]) {
    disk.remove_file(path).unwrap();
    disk.create(path).unwrap().write_all(bytes).unwrap();
}

/// The problems that `study verify` finds.
fn problems(disk: &MemoryDisk) -> Vec<String> {
    let found = open(disk).verify(None).unwrap().into_iter();
    let found = found.filter(|f| f.is_problem && !f.place.contains("telemetry"));
    found.map(|f| format!("{}: {}", f.place, f.what)).collect()
}

#[test]
fn the_head_is_the_last_acknowledged_record() {
    for events in [1, 7, 12] {
        let disk = unfinished(events);
        let last = lines(&disk, "journal.jsonl").pop().unwrap();
        assert_eq!(head(&disk), (events as u64, hash(&last), 1));
    }
}

#[test]
fn a_resumed_journal_goes_on_in_a_new_segment_after_the_last_record() {
    let disk = unfinished(12);
    let last = lines(&disk, "journal.jsonl").pop().unwrap();
    let mut claimed = open(&disk).claim(&real("P01")).unwrap();
    assert_eq!(lines(&disk, "journal-2.jsonl"), Vec::<Vec<u8>>::new());
    let mut journal = claimed.folder.journal().unwrap();
    journal.append(at(50), &Event::Paused).unwrap();
    let first = &lines(&disk, "journal-2.jsonl")[0];
    let read = decode(first).unwrap();
    assert_eq!((read.seq, read.prev), (13, hash(&last)));
    assert_eq!(head(&disk), (13, hash(first), 2));
    assert_eq!(problems(&disk), Vec::<String>::new());
}

#[test]
fn a_resumed_journal_repeats_what_was_not_acknowledged() {
    let disk = interrupted(12);
    let last = lines(&disk, "journal.jsonl").pop().unwrap();
    let claimed = open(&disk).claim(&real("P01")).unwrap();
    assert_eq!(claimed.entries.len(), 12);
    assert_eq!(lines(&disk, "journal-2.jsonl"), std::slice::from_ref(&last));
    assert_eq!(head(&disk), (12, hash(&last), 2));
    drop(claimed);
    let session = open(&disk).sessions().unwrap().remove(0);
    assert_eq!((session.entries.len(), session.damage), (12, vec![]));
}

#[test]
fn a_journal_of_an_earlier_release_is_repeated_as_a_whole() {
    let disk = unfinished(12);
    disk.remove_file(&in_session("head.json")).unwrap();
    drop(open(&disk).claim(&real("P01")).unwrap());
    assert_eq!(
        lines(&disk, "journal-2.jsonl"),
        lines(&disk, "journal.jsonl")
    );
    assert_eq!(problems(&disk), Vec::<String>::new());
}

#[test]
fn a_truncated_journal_is_noticed_and_stays_so_when_it_is_continued() {
    for missing in [1, 3] {
        let disk = unfinished(12);
        let kept = lines(&disk, "journal.jsonl")[..13 - missing].join(&b'\n');
        replace(&disk, &journal_path(), &[&kept[..], b"\n"].concat());
        let session = open(&disk).sessions().unwrap().remove(0);
        assert!(session.truncated);
        let first = 13 - missing as u64;
        let [damage] = &session.damage[..] else {
            panic!("{:?}", session.damage);
        };
        assert_eq!(damage.kind, DamageKind::Truncated(first, 12));
        let mut claimed = open(&disk).claim(&real("P01")).unwrap();
        assert!(
            claimed.notices[0].contains("truncated"),
            "{:?}",
            claimed.notices
        );
        let mut journal = claimed.folder.journal().unwrap();
        assert_eq!(journal.append(at(50), &Event::Paused).unwrap(), 13);
        let damage = open(&disk).sessions().unwrap().remove(0).damage;
        assert_eq!(damage[0].kind, DamageKind::Missing(first, 13));
        assert_eq!(problems(&disk).len(), 1);
    }
}

#[test]
fn another_last_record_is_noticed() {
    let disk = unfinished(12);
    let all = lines(&disk, "journal.jsonl");
    let other = unfinished(11);
    let mut claimed = open(&other).claim(&real("P01")).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    journal.append(at(50), &Event::Paused).unwrap();
    let forged = lines(&other, "journal-2.jsonl").remove(0);
    let bytes = [&all[..12].join(&b'\n')[..], b"\n", &forged[..], b"\n"].concat();
    replace(&disk, &journal_path(), &bytes);
    let found = problems(&disk);
    assert!(
        found[0].contains("record 12 is not the one that was saved"),
        "{found:?}"
    );
}

#[test]
fn a_journal_that_is_gone_is_not_begun_again() {
    let disk = unfinished(12);
    disk.remove_file(&journal_path()).unwrap();
    let refused = open(&disk).claim(&real("P01"));
    assert!(
        matches!(refused, Err(StoreError::Damaged { .. })),
        "{refused:?}"
    );
    assert!(disk.read(&journal_path()).is_err(), "nothing was made");
    assert!(
        problems(&disk)[0].contains("records 0 to 12"),
        "{:?}",
        problems(&disk)
    );
}

#[test]
fn a_damaged_head_is_noticed_and_written_again() {
    let disk = unfinished(12);
    let mut bytes = disk.read(&in_session("head.json")).unwrap();
    let at = bytes.windows(2).position(|w| w == b"12").unwrap();
    bytes[at + 1] = b'1';
    replace(&disk, &in_session("head.json"), &bytes);
    assert_eq!(problems(&disk).len(), 1);
    drop(open(&disk).claim(&real("P01")).unwrap());
    assert_eq!(head(&disk).0, 12);
    assert_eq!(problems(&disk), Vec::<String>::new());
}

/// A write that failed can leave whole lines that are none.
#[test]
fn unreadable_lines_at_the_end_are_set_apart() {
    for tail in [
        &b"\0\0\0\0\n"[..],
        b"{\"crc\":\"00000000\",\"v\":1}\n\n\0\n{",
        b"\n\n",
    ] {
        let disk = unfinished(12);
        disk.open(&journal_path()).unwrap().write_all(tail).unwrap();
        assert_eq!(problems(&disk), Vec::<String>::new());
        let claimed = open(&disk).claim(&real("P01")).unwrap();
        assert_eq!(claimed.entries.len(), 12);
        assert_eq!(disk.read(&in_session("torn-1.bin")).unwrap(), tail);
        assert_eq!(lines(&disk, "journal.jsonl").len(), 13);
        drop(claimed);
        assert_eq!(problems(&disk), Vec::<String>::new());
    }
}

#[test]
fn a_receipt_names_the_last_record_and_shows_a_change() {
    let disk = unfinished(12);
    let mut claimed = open(&disk).claim(&real("P01")).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    journal.append(at(50), &Event::Paused).unwrap();
    let receipt = journal.receipt().unwrap().unwrap();
    let last = lines(&disk, "journal-2.jsonl").pop().unwrap();
    assert_eq!((receipt.seq, receipt.hash), (13, hash(&last)));
    drop((journal, claimed));
    assert_eq!(problems(&disk), Vec::<String>::new());
    disk.remove_file(&in_session("journal-2.jsonl")).unwrap();
    disk.remove_file(&in_session("head.json")).unwrap();
    let found = problems(&disk);
    let missing = "sessions/P01/1/receipt.json: record 13 is missing or changed";
    assert!(found.contains(&missing.to_owned()), "{found:?}");
}

#[test]
fn study_json_notices_its_own_damage_and_needs_no_checksum() {
    let disk = unfinished(3);
    let path = small().join("study.json");
    let text = String::from_utf8(disk.read(&path).unwrap()).unwrap();
    assert_eq!(problems(&disk), Vec::<String>::new());
    replace(&disk, &path, text.replace("666", "667").as_bytes());
    let found = problems(&disk);
    assert!(
        found[0].starts_with("study.json: its checksum"),
        "{found:?}"
    );
    let refused = open(&disk).claim(&real("P01"));
    assert!(
        matches!(refused, Err(StoreError::Damaged { .. })),
        "{refused:?}"
    );
    // As an earlier release wrote it, which marked wrong playbacks only.
    let (before, _) = text.split_once(",\n  \"judges_rendering\"").unwrap();
    replace(&disk, &path, format!("{before}\n}}\n").as_bytes());
    assert_eq!(problems(&disk), Vec::<String>::new());
    let kept = Kept::new();
    let disk = Arc::new(disk);
    StudyFolder::open_or_create_on(disk, Path::new("results"), &kept.frozen(), at(9)).unwrap();
}
