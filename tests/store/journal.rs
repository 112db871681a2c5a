//! The journal's bytes: the format as it was shipped, and every kind of damage.

#![allow(clippy::unwrap_used)]

use crate::memory::{Crash, MemoryDisk};
use crate::world::{Kept, at, participant, real, session};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use study_plan::protocol::Seat;
use study_session::outcome::Event;
use study_session::store::disk::Disk as _;
use study_session::store::journal_record::{self, Claim, Record};
use study_session::store::replay::{Replay, Segment, replay};
use study_session::store::{DamageKind, HeadFile, StudyFolder};

/// The lines of a whole session, each with its line end.
fn lines() -> Vec<Vec<u8>> {
    let claim = Record::Claim(Claim {
        participant: participant("P01"),
        session: 1,
        seat: Some(Seat::Row(1)),
        protocol_version: 1,
        head: false,
    });
    let events = session("P01", 1, Seat::Row(1));
    let events = events
        .into_iter()
        .zip(0..)
        .map(|(e, n)| Record::Event(at(n), e));
    let mut prev = journal_record::NO_LINE.to_owned();
    [claim]
        .into_iter()
        .chain(events)
        .zip(0..)
        .map(|(record, seq)| {
            let mut bytes = journal_record::encode(seq, &prev, &record).unwrap();
            prev = journal_record::hash(&bytes);
            bytes.push(b'\n');
            bytes
        })
        .collect()
}

fn segment(bytes: &[u8]) -> [Segment; 1] {
    [Segment {
        name: "journal.jsonl".to_owned(),
        bytes: bytes.to_vec(),
    }]
}

/// Do not change this test, nor the file: journals of version 1 exist, and every
/// later program has to read them. A new version of the format gets a new file.
/// `journal.jsonl` is the session of `world::session`: a claim, a failed attempt,
/// a correction, remarks, a declined answer, a hostile comment.
#[test]
fn a_journal_of_version_1_is_read_as_it_was_meant() {
    let golden = include_bytes!("../golden/journal_v1/journal.jsonl");
    let read = replay(&segment(golden), &HeadFile::None);
    assert_eq!(read.damage, []);
    assert_eq!(read.claim.as_ref().unwrap().seat, Some(Seat::Row(1)));
    let events: Vec<Event> = read.entries.iter().map(|e| e.event.clone()).collect();
    assert_eq!(events, session("P01", 1, Seat::Row(1)));
    assert_eq!(read.entries[3].at, at(3));
    assert_eq!(read.next_seq, 30);
    assert_eq!(lines().concat(), golden, "version 1 is still written so");
}

/// What is read of damaged bytes, against the records that were written. `hit` is
/// the line that the damage is in, `intact` what the whole bytes give.
fn check_damage(bytes: &[u8], hit: u64, intact: &Replay, why: &str) {
    let read = replay(&segment(bytes), &HeadFile::None);
    assert_ne!(read.damage, intact.damage, "{why}: not noticed");
    let expected: BTreeMap<u64, &Event> =
        intact.entries.iter().map(|e| (e.seq, &e.event)).collect();
    for entry in &read.entries {
        assert_eq!(Some(&&entry.event), expected.get(&entry.seq), "{why}");
    }
    for seq in expected.keys().filter(|seq| **seq != hit) {
        let there = read.entries.iter().any(|e| e.seq == *seq);
        assert!(there, "{why}: record {seq} is lost as well");
    }
    assert!(hit == 0 || read.claim == intact.claim, "{why}");
}

#[test]
fn every_missing_byte_is_noticed_and_costs_one_record() {
    let lines = lines();
    let whole = lines.concat();
    let intact = replay(&segment(&whole), &HeadFile::None);
    assert_eq!(intact.damage, []);
    let mut start = 0;
    for (line, n) in lines.iter().zip(0..) {
        for byte in start..start + line.len() {
            let mut bytes = whole.clone();
            bytes.remove(byte);
            check_damage(&bytes, n, &intact, &format!("byte {byte}, line {n}"));
        }
        start += line.len();
    }
}

/// Each line between its neighbors: what a line does to others it does to these.
#[test]
fn every_flipped_bit_is_noticed_and_costs_one_record() {
    let lines = lines();
    for n in 0..lines.len() {
        let first = n.saturating_sub(1);
        let near = &lines[first..lines.len().min(n + 2)];
        let whole = near.concat();
        let intact = replay(&segment(&whole), &HeadFile::None);
        let start = if n == 0 { 0 } else { near[0].len() };
        for byte in start..start + lines[n].len() {
            for bit in 0..8 {
                let mut bytes = whole.clone();
                bytes[byte] ^= 1 << bit;
                let why = format!("bit {bit} of byte {byte}, line {n}");
                check_damage(&bytes, n as u64, &intact, &why);
            }
        }
    }
}

#[test]
fn a_missing_a_doubled_and_a_changed_line_are_told_apart() {
    let lines = lines();
    let kinds = |lines: &[Vec<u8>]| -> Vec<DamageKind> {
        let read = replay(&segment(&lines.concat()), &HeadFile::None);
        read.damage.into_iter().map(|d| d.kind).collect()
    };
    let mut without = lines.clone();
    without.remove(7);
    assert_eq!(kinds(&without), [DamageKind::Missing(7, 8)]);

    // The record in doubt after a failed write is written once more.
    let mut twice = lines.clone();
    twice.insert(7, lines[6].clone());
    assert_eq!(kinds(&twice), []);

    // Somebody changed an answer and put the checksum right.
    let mut forged = lines.clone();
    let text = String::from_utf8(lines[12].clone()).unwrap();
    let Ok(old) = journal_record::decode(text.trim_end().as_bytes()) else {
        panic!("line 12 is whole");
    };
    let mut new =
        journal_record::encode(old.seq, &old.prev, &Record::Event(at(99), Event::Paused)).unwrap();
    new.push(b'\n');
    forged[12] = new;
    assert_eq!(kinds(&forged), [DamageKind::Chain(13)]);

    let mut both = lines.clone();
    both.insert(13, forged[12].clone());
    assert_eq!(kinds(&both), [DamageKind::Conflict(12)]);
}

#[test]
fn a_tail_cut_at_any_byte_leaves_every_line_before_it() {
    let lines = lines();
    let whole = lines.concat();
    for cut in 0..whole.len() {
        for zeros in [0, 1, 700] {
            let bytes = [&whole[..cut], &vec![0; zeros]].concat();
            let read = replay(&segment(&bytes), &HeadFile::None);
            let mut end = 0;
            let complete = lines
                .iter()
                .take_while(|line| {
                    end += line.len();
                    // Without its line end a record is still whole.
                    end - 1 <= cut
                })
                .count();
            assert_eq!(read.records, complete as u64, "cut at {cut}, {zeros} zeros");
            let clean = zeros == 0 && (cut == 0 || whole[cut - 1] == b'\n');
            assert_eq!(read.damage.is_empty(), clean, "cut at {cut}, {zeros} zeros");
        }
    }
}

pub(crate) fn small() -> &'static Path {
    Path::new("results/small")
}

/// A disk with an unfinished session of so many events, the last of which was not
/// acknowledged: `head.json` names the one before.
pub(crate) fn interrupted(events: usize) -> MemoryDisk {
    let head = Path::new("results/small/sessions/P01/1/head.json");
    let before = unfinished(events - 1).read(head).unwrap();
    let disk = unfinished(events);
    disk.remove_file(head).unwrap();
    disk.create(head).unwrap().write_all(&before).unwrap();
    disk
}

/// A disk with an unfinished session of so many events.
pub(crate) fn unfinished(events: usize) -> MemoryDisk {
    let disk = MemoryDisk::new();
    let kept = Kept::new();
    let study = StudyFolder::open_or_create_on(
        Arc::new(disk.clone()),
        Path::new("results"),
        &kept.frozen(),
        at(0),
    )
    .unwrap();
    let mut claimed = study.claim(&real("P01")).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    for (event, n) in session("P01", 1, Seat::Row(1)).iter().zip(0..).take(events) {
        journal.append(at(n), event).unwrap();
    }
    disk.after(Crash::Process)
}

pub(crate) fn journal_path() -> std::path::PathBuf {
    small().join("sessions/P01/1/journal.jsonl")
}

#[test]
fn a_torn_tail_is_set_apart_and_the_session_goes_on() {
    let whole = interrupted(12).read(&journal_path()).unwrap();
    let last = whole[..whole.len() - 1]
        .iter()
        .rposition(|b| *b == b'\n')
        .unwrap()
        + 1;
    for cut in last..=whole.len() {
        for zeros in [0, 5] {
            let disk = interrupted(12);
            disk.truncate(&journal_path(), cut as u64).unwrap();
            let mut file = disk.open(&journal_path()).unwrap();
            file.write_all(&vec![0; zeros]).unwrap();
            let study = StudyFolder::open_on(Arc::new(disk.clone()), small()).unwrap();
            let mut claimed = study.claim(&real("P01")).unwrap();
            let kept = if cut + 1 >= whole.len() { 12 } else { 11 };
            assert_eq!(claimed.entries.len(), kept, "cut at {cut}");
            let torn: &[u8] = if kept == 12 { &[] } else { &whole[last..cut] };
            let torn = [torn, &vec![0; zeros]].concat();
            if torn.is_empty() {
                assert_eq!(claimed.notices, Vec::<String>::new());
            } else {
                let copy = disk
                    .read(&small().join("sessions/P01/1/torn-1.bin"))
                    .unwrap();
                assert_eq!(copy, torn, "cut at {cut}");
                assert!(
                    claimed.notices[0].contains("torn-1.bin"),
                    "{:?}",
                    claimed.notices
                );
            }
            let mut journal = claimed.folder.journal().unwrap();
            let seq = journal.append(at(50), &Event::Paused).unwrap();
            assert_eq!(seq, kept as u64 + 1);
            let read = study.sessions().unwrap().remove(0);
            assert_eq!(read.damage, []);
            assert_eq!(read.entries.len(), kept + 1);
        }
    }
}

/// Somebody removes the journal, or cuts it, while its session goes on: the next segment has what
/// was acknowledged, by this process or by one before it.
#[test]
fn what_was_acknowledged_and_is_gone_is_written_again() {
    for (resumed, left) in [
        (false, None),
        (false, Some(700)),
        (true, None),
        (true, Some(0)),
    ] {
        let disk = unfinished(if resumed { 6 } else { 0 });
        let study = StudyFolder::open_on(Arc::new(disk.clone()), small()).unwrap();
        let mut claimed = study.claim(&real("P01")).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        let events = session("P01", 1, Seat::Row(1));
        for (event, n) in events.iter().zip(0..).take(8).skip(claimed.entries.len()) {
            journal.append(at(n), event).unwrap();
        }
        match left {
            None => disk.remove_file(&journal_path()).unwrap(),
            Some(bytes) => disk.truncate(&journal_path(), bytes).unwrap(),
        }
        journal.new_segment().unwrap();
        journal.append(at(50), &Event::Paused).unwrap();
        drop((journal, claimed));
        let read = study.sessions().unwrap().remove(0);
        let entries: Vec<&Event> = read.entries.iter().map(|e| &e.event).collect();
        let expected: Vec<&Event> = events[..8].iter().chain([&Event::Paused]).collect();
        assert_eq!(entries, expected, "resumed: {resumed}, left: {left:?}");
        let disk = disk.after(Crash::OnlySynced);
        let study = StudyFolder::open_on(Arc::new(disk), small()).unwrap();
        assert_eq!(study.sessions().unwrap()[0].entries.len(), 9);
        assert!(!study.sessions().unwrap()[0].truncated);
    }
}

#[test]
fn a_damaged_line_in_the_middle_stays_and_the_session_goes_on() {
    for damaged in [0, 1, 6, 12] {
        let disk = unfinished(12);
        let whole = disk.read(&journal_path()).unwrap();
        let mut bytes = whole.clone();
        let mut lines = whole.split_inclusive(|b| *b == b'\n');
        let start: usize = lines.by_ref().take(damaged).map(<[u8]>::len).sum();
        bytes[start + 30] ^= 4;
        disk.truncate(&journal_path(), 0).unwrap();
        disk.open(&journal_path())
            .unwrap()
            .write_all(&bytes)
            .unwrap();

        let study = StudyFolder::open_on(Arc::new(disk.clone()), small()).unwrap();
        let mut claimed = study.claim(&real("P01")).unwrap();
        assert_eq!(claimed.seat, Seat::Row(1), "told twice, in lines 0 and 1");
        let left = if damaged == 0 { 12 } else { 11 };
        assert_eq!(claimed.entries.len(), left);
        assert!(!claimed.notices.is_empty());
        let mut journal = claimed.folder.journal().unwrap();
        assert_eq!(journal.append(at(50), &Event::Paused).unwrap(), 13);
        assert!(
            disk.read(&journal_path()).unwrap().starts_with(&bytes),
            "nothing was repaired"
        );
        let read = study.sessions().unwrap().remove(0);
        assert_eq!(read.entries.len(), left + 1);
        assert_eq!(
            read.damage
                .iter()
                .filter(|d| matches!(d.kind, DamageKind::Unreadable(_)))
                .count(),
            1
        );
        let wrong = study
            .verify(None)
            .unwrap()
            .iter()
            .filter(|f| f.is_problem)
            .count();
        assert!(wrong >= 1);
    }
}

/// Writes the golden file; only for a new version of the format.
#[test]
#[ignore = "only for a new version of the format"]
fn write_golden() {
    std::fs::write("tests/golden/journal_v1/journal.jsonl", lines().concat()).unwrap();
}
