//! A results folder and its mirror on two disks, one of which fails.

#![allow(clippy::unwrap_used)]

use crate::memory::{Crash, Fault, MemoryDisk};
use crate::process::{Told, run, script, scripted};
use crate::world::{Kept, at, protocol, real, started};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use study_base::rng::Stream;
use study_session::outcome::{Author, Event};
use study_session::store::disk::Disk;
use study_session::store::{Finding, StoreError, StudyFolder};

/// The results folder and the mirror, each on a disk of its own.
struct Disks([MemoryDisk; 2]);

const ROOTS: [&str; 2] = ["results", "mirror"];

impl Disks {
    fn new() -> Self {
        let disks = Self([MemoryDisk::new(), MemoryDisk::new()]);
        disks.0[1].create_folder(Path::new(ROOTS[1])).unwrap();
        disks.0[1].sync_folder(Path::new(".")).unwrap();
        disks
    }

    fn open(&self) -> Result<(StudyFolder, Vec<String>), StoreError> {
        let side = |n: usize| -> (Arc<dyn Disk>, &Path) {
            (Arc::new(self.0[n].clone()), Path::new(ROOTS[n]))
        };
        let kept = Kept::new();
        StudyFolder::open_or_create_mirrored_on([side(0), side(1)], &kept.frozen(), at(0))
    }

    /// The copy on one of the disks, as a study of its own.
    fn copy(&self, side: usize) -> Result<StudyFolder, StoreError> {
        StudyFolder::open_on(Arc::new(self.0[side].clone()), &path(side))
    }

    fn after(&self, crash: Crash) -> Self {
        Self([self.0[0].after(crash), self.0[1].after(crash)])
    }

    fn differences(&self) -> Vec<Finding> {
        let results = self.copy(0).unwrap();
        results.verify_against_on(&self.0[1], &path(1)).unwrap()
    }

    /// Files that differ, found without the program.
    fn differing_files(&self) -> Vec<PathBuf> {
        let files = |side: usize| {
            let mut files = self.0[side].files();
            let passing = ["reserve", ".probe"];
            files.retain(|path, _| {
                let name = path.file_name().unwrap().to_str().unwrap();
                !passing.contains(&name) && !name.ends_with(".tmp")
            });
            let inside = files.into_iter();
            inside
                .map(|(path, bytes)| (path.strip_prefix(path_of(side)).unwrap().to_owned(), bytes))
                .collect::<std::collections::BTreeMap<_, _>>()
        };
        let (a, b) = (files(0), files(1));
        let names: std::collections::BTreeSet<_> = a.keys().chain(b.keys()).cloned().collect();
        let mut names: Vec<_> = names.into_iter().collect();
        names.retain(|name| a.get(name) != b.get(name));
        names
    }
}

fn path_of(side: usize) -> &'static Path {
    Path::new(ROOTS[side])
}

fn path(side: usize) -> PathBuf {
    path_of(side).join("small")
}

/// Runs the session of P01 on both disks.
fn process(disks: &Disks, told: &mut Told) -> Result<StudyFolder, StoreError> {
    let (study, _) = disks.open()?;
    study.refresh(&protocol())?;
    run(&study, told)?;
    study.refresh(&protocol())?;
    Ok(study)
}

fn has_all(study: &StudyFolder, told: &Told) -> bool {
    let sessions = study.sessions().unwrap_or_default();
    let own = sessions.iter().find(|s| s.participant.as_str() == told.id);
    own.is_some_and(|s| !s.truncated && scripted(&s.entries).starts_with(&told.events))
}

#[test]
fn both_copies_are_the_same_bytes() {
    let disks = Disks::new();
    let mut told = Told::of("P01");
    let study = process(&disks, &mut told).unwrap();
    assert!(study.copies().unwrap().in_step());
    assert_eq!(disks.differing_files(), Vec::<PathBuf>::new());
    assert_eq!(disks.differences(), []);
    for side in [0, 1] {
        let copy = disks.copy(side).unwrap();
        assert!(has_all(&copy, &told));
        let found = copy.verify(Some(&protocol())).unwrap();
        assert!(found.iter().all(|f| !f.is_problem), "{found:?}");
    }
}

#[test]
fn two_hundred_faults_of_one_disk_lose_nothing_and_are_found() {
    let faults = [
        Fault::Removed,
        Fault::From(ErrorKind::Other),
        Fault::From(ErrorKind::StorageFull),
        Fault::Error(ErrorKind::Other),
        Fault::Short(ErrorKind::StorageFull),
        Fault::Slow,
    ];
    let mut chance = Stream::new(11, &["mirror"]);
    let mut left_behind = [0, 0];
    for n in 0..200 {
        let disks = Disks::new();
        let (side, other) = if chance.below(2) == 0 { (0, 1) } else { (1, 0) };
        let fault = faults[n % faults.len()];
        let call = chance.below(300) as usize;
        let why = format!("{fault:?} at {call} of the {}", ROOTS[side]);
        disks.0[side].plan(call, fault);
        let mut told = Told::of("P01");
        // Before the first record both disks are needed.
        let ended = process(&disks, &mut told);
        let survivor = disks.copy(other);
        if told.seat.is_some() {
            assert!(has_all(survivor.as_ref().unwrap(), &told), "{why}");
        }
        if let Ok(study) = &ended {
            let copies = study.copies().unwrap();
            assert_eq!(told.events, script("P01", told.seat.unwrap()), "{why}");
            let behind = [copies.results.is_some(), copies.mirror.is_some()];
            assert!(!behind[other], "{why}: {copies:?}");
            left_behind[side] += usize::from(behind[side]);
            // What differs was told, and is found.
            let repaired = disks.after(Crash::Process);
            let differing = repaired.differing_files();
            assert!(behind[side] || differing.is_empty(), "{why}: {differing:?}");
            if repaired.copy(0).is_ok() && repaired.copy(1).is_ok() {
                let found = repaired.differences();
                for file in &differing {
                    let file = file.strip_prefix("small").unwrap();
                    let names = |f: &Finding| file.starts_with(&f.place);
                    assert!(
                        found.iter().any(names),
                        "{why}: {} in {found:?}",
                        file.display()
                    );
                }
                assert!(found.len() <= differing.len(), "{why}: {found:?}");
            }
        }
        drop(ended);
        // Without the fault the next start brings both to the same state.
        let next = disks.after(Crash::Strict(n as u64));
        if next.0[1].list(path_of(1)).is_err() {
            next.0[1].create_folder(path_of(1)).unwrap();
        }
        match process(&next, &mut told) {
            Ok(_) | Err(StoreError::Finished { .. }) => {}
            Err(e) => panic!("{why}: {e}"),
        }
        drop(next.open().unwrap());
        assert_eq!(next.differences(), [], "{why}");
        assert!(has_all(&next.copy(0).unwrap(), &told), "{why}");
    }
    assert!(left_behind.iter().all(|n| *n > 20), "{left_behind:?}");
}

#[test]
fn copies_that_were_each_continued_alone_are_refused() {
    let disks = Disks::new();
    let mut told = Told::of("P01");
    told.until = Some(4);
    drop(process(&disks, &mut told).unwrap());
    for side in [0, 1] {
        let study = disks.copy(side).unwrap();
        let mut claimed = study.claim(&real("P01")).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        journal
            .append(at(50 + side as u64), &Event::Paused)
            .unwrap();
    }
    let before = disks.differing_files();
    let refused = disks.open();
    assert!(
        matches!(refused, Err(StoreError::MirrorDiffers { .. })),
        "{refused:?}"
    );
    assert_eq!(disks.differing_files(), before, "nothing was touched");
}

#[test]
fn an_empty_disk_gets_everything_from_the_other() {
    for side in [0, 1] {
        let disks = Disks::new();
        let mut told = Told::of("P01");
        told.until = Some(6);
        drop(process(&disks, &mut told).unwrap());
        let mut both = disks.0.clone();
        both[side] = MemoryDisk::new();
        both[side].create_folder(path_of(side)).unwrap();
        let disks = Disks(both);
        let (study, notices) = disks.open().unwrap();
        assert!(
            notices.iter().any(|n| n.contains("sessions/P01/1")),
            "{notices:?}"
        );
        assert_eq!(disks.differences(), []);
        told.until = None;
        run(&study, &mut told).unwrap();
        assert!(has_all(&disks.copy(side).unwrap(), &told));
    }
}

#[test]
fn a_mirror_that_does_not_exist_is_not_created() {
    let disks = Disks([MemoryDisk::new(), MemoryDisk::new()]);
    let refused = disks.open();
    assert!(
        matches!(refused, Err(StoreError::NoMirror { .. })),
        "{refused:?}"
    );
    assert!(disks.0[1].list(Path::new("")).unwrap().is_empty());
}

#[test]
fn an_erasure_reaches_the_mirror_at_the_next_start() {
    use crate::world::participant;
    use study_session::outcome::State;
    use study_session::store::StateRequest;
    let disks = Disks::new();
    drop(process(&disks, &mut Told::of("P01")).unwrap());
    let request = StateRequest {
        participant: participant("P01"),
        state: State::Withdrawn,
        reason: "asked".to_owned(),
        erase: true,
    };
    disks.copy(0).unwrap().set_state(&request, at(9)).unwrap();
    drop(disks.open().unwrap());
    let left = disks.0[1].files();
    let journal = left
        .keys()
        .find(|path| path.to_string_lossy().contains("journal"));
    assert_eq!(journal, None);
}

/// A sync fails, and the process dies before it writes more: both sides read the same, and what is on the medium of one is not
/// on that of the other.
#[test]
fn what_a_failed_sync_left_in_doubt_is_written_again_at_the_next_start() {
    for side in [0, 1] {
        let disks = Disks::new();
        let (study, _) = disks.open().unwrap();
        let mut claimed = study.claim(&real("P01")).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        let start = started("P01", claimed.session, claimed.seat);
        let disk = &disks.0[side];
        // A record is a write and a sync.
        disk.plan(disk.calls() + 1, Fault::Error(ErrorKind::Other));
        journal.append(at(1), &start).unwrap();
        assert!(!study.copies().unwrap().in_step());
        drop((journal, claimed, study));
        let next = disks.after(Crash::Process);
        let (study, notices) = next.open().unwrap();
        assert!(study.copies().unwrap().in_step());
        let leads = ["behind the mirror", "behind the results folder"][side];
        assert!(notices.iter().any(|n| n.contains(leads)), "{notices:?}");
        drop(study);
        assert_eq!(next.differences(), []);
        // Without power, and without the other disk.
        let alone = Arc::new(next.0[side].after(Crash::OnlySynced));
        let copy = StudyFolder::open_on(alone, &path(side)).unwrap();
        let sessions = copy.sessions().unwrap();
        assert!(!sessions[0].truncated, "{}", ROOTS[side]);
        assert_eq!(sessions[0].entries.len(), 1, "{}", ROOTS[side]);
    }
}

/// The participant's copy of a consent, on one disk or both.
fn consents(disks: &Disks) -> [bool; 2] {
    [0, 1].map(|side: usize| {
        let files = disks.0[side].files();
        files.keys().any(|path| path.ends_with("consent.txt"))
    })
}

/// Initials are on both disks; after a refusal they are on neither, also if a disk was away when it was recorded.
#[test]
fn a_copy_of_the_consent_is_on_both_disks_and_on_neither_after_a_refusal() {
    for accepted in [true, false] {
        let disks = Disks::new();
        let (study, _) = disks.open().unwrap();
        let mut claimed = study.claim(&real("P01")).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        let start = started("P01", claimed.session, claimed.seat);
        journal.append(at(1), &start).unwrap();
        claimed.folder.keep_consent("signed: QXJ").unwrap();
        assert_eq!(consents(&disks), [true, true]);
        disks.0[1].plan(0, Fault::From(ErrorKind::Other));
        if !accepted {
            claimed.folder.drop_consent().unwrap();
        }
        let consented = Event::Consented {
            document: "Information".to_owned(),
            version: "2".to_owned(),
            accepted,
            by: Author::Participant,
        };
        journal.append(at(2), &consented).unwrap();
        drop((journal, claimed, study));
        assert_eq!(consents(&disks), [accepted, true]);
        let next = disks.after(Crash::Process);
        drop(next.open().unwrap());
        assert_eq!(consents(&next), [accepted, accepted]);
        assert_eq!(next.differences(), []);
    }
}

/// A disk that was away when it was signed gets the copy at the next start.
#[test]
fn a_disk_that_was_away_gets_the_copy_of_the_consent() {
    for away in [0, 1] {
        let disks = Disks::new();
        let (study, _) = disks.open().unwrap();
        let mut claimed = study.claim(&real("P01")).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        let start = started("P01", claimed.session, claimed.seat);
        journal.append(at(1), &start).unwrap();
        disks.0[away].plan(0, Fault::From(ErrorKind::Other));
        claimed.folder.keep_consent("signed: QXJ").unwrap();
        let consented = Event::Consented {
            document: "Information".to_owned(),
            version: "2".to_owned(),
            accepted: true,
            by: Author::Participant,
        };
        journal.append(at(2), &consented).unwrap();
        drop((journal, claimed, study));
        let mut there = [true; 2];
        there[away] = false;
        assert_eq!(consents(&disks), there);
        let next = disks.after(Crash::Process);
        drop(next.open().unwrap());
        assert_eq!(consents(&next), [true, true]);
        assert_eq!(next.differences(), []);
    }
}
