//! Many processes at one results folder.

#![allow(clippy::unwrap_used)]

use crate::world::{Kept, at, real};
use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, Stdio};
use study_session::store::{StoreError, StudyFolder};

fn open(results: &Path) -> StudyFolder {
    StudyFolder::open_or_create(results, &Kept::new().frozen(), at(0)).unwrap()
}

/// Not a test of its own: what the child processes below do.
#[test]
fn helper_claims() {
    let (Ok(results), Ok(id)) = (
        std::env::var("STUDY_TEST_RESULTS"),
        std::env::var("STUDY_TEST_ID"),
    ) else {
        return;
    };
    let study = open(Path::new(&results));
    let claimed = study.claim(&real(&id));
    match &claimed {
        Ok(claimed) => println!("\nCLAIMED {}", claimed.seat),
        Err(StoreError::Open { .. }) => println!("\nOPEN"),
        Err(e) => println!("\nFAILED {e}"),
    }
    // Held until the parent lets go.
    let _ = std::io::stdin().read(&mut [0]);
}

fn claimer(results: &Path, id: &str) -> Child {
    std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "processes::helper_claims", "--nocapture"])
        .env("STUDY_TEST_RESULTS", results)
        .env("STUDY_TEST_ID", id)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn verdicts(children: &mut [Child]) -> Vec<String> {
    let words = ["CLAIMED", "OPEN", "FAILED"];
    let verdicts = children
        .iter_mut()
        .map(|child| {
            BufReader::new(child.stdout.as_mut().unwrap())
                .lines()
                .map(Result::unwrap)
                .find(|l| words.iter().any(|w| l.starts_with(w)))
                .unwrap()
        })
        .collect();
    for child in children {
        drop(child.stdin.take());
        child.wait().unwrap();
    }
    verdicts
}

#[test]
fn of_64_processes_that_claim_one_participant_one_wins_and_none_overwrites() {
    let results = tempfile::tempdir().unwrap();
    let mut children: Vec<Child> = (0..64).map(|_| claimer(results.path(), "P01")).collect();
    let verdicts = verdicts(&mut children);
    let won = verdicts.iter().filter(|v| *v == "CLAIMED row 1").count();
    let open_elsewhere = verdicts.iter().filter(|v| *v == "OPEN").count();
    assert_eq!((won, open_elsewhere), (1, 63), "{verdicts:?}");
    let sessions = open(results.path()).sessions().unwrap();
    assert_eq!(sessions.len(), 1);
    assert_eq!(sessions[0].damage, []);
}

#[test]
fn rigs_that_claim_different_participants_at_once_get_different_rows() {
    let results = tempfile::tempdir().unwrap();
    let ids: Vec<String> = (1..=8).map(|n| format!("P{n:02}")).collect();
    let mut children: Vec<Child> = ids.iter().map(|id| claimer(results.path(), id)).collect();
    let rows: BTreeSet<String> = verdicts(&mut children).into_iter().collect();
    let expected: BTreeSet<String> = (1..=8).map(|n| format!("CLAIMED row {n}")).collect();
    assert_eq!(rows, expected);
}
