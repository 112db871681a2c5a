//! `kill -9` of the real binary at random moments: answers that the screen showed as
//! saved are on disk, and the session can be resumed.
//!
//! 200 kills without a loss show that fewer than 1.5 % of such kills lose an answer (3/N,
//! 95 % confidence). They do not reveal a missing sync; the tests of the store do, with
//! simulated crashes.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(
    clippy::print_stderr,
    reason = "how many answers were at stake is printed"
)]

use super::plain::Lines;
use crate::support::player::{Did, play_before, play_to_end};
use crate::support::{PATIENT, Terminal, changed_protocol, study};
use std::path::Path;
use std::time::{Duration, Instant};
use study_base::rng::Stream;
use study_session::outcome::{Event, State};
use study_session::store::{StudyFolder, participants};

/// The number after `saved ✓`, if the screen shows one.
fn saved(screen: &str) -> Option<usize> {
    let after = screen.split("saved ✓").nth(1)?;
    after.split_whitespace().next()?.parse().ok()
}

/// Number of completed trials in the journals of a participant.
fn done(folder: &Path, participant: &str) -> usize {
    let Ok(study) = StudyFolder::open(&folder.join("results/turn-signal")) else {
        return 0;
    };
    let sessions = study.sessions().unwrap();
    sessions
        .iter()
        .filter(|s| s.participant.as_str() == participant)
        .inspect(|s| assert!(s.damage.is_empty(), "{:?}", s.damage))
        .flat_map(|s| &s.entries)
        .filter(|e| matches!(e.event, Event::TrialDone { .. }))
        .count()
}

fn kills(seed: u64, count: u32) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let protocol = folder.join("protocol");
    changed_protocol("turn-signal", &protocol, &[PATIENT]);
    let protocol = protocol.to_str().unwrap();
    let mut chance = Stream::new(seed, &["kill"]);
    let mut participant = 1;
    let mut survived = 0;
    for kill in 0..count {
        let id = format!("P{participant:02}");
        let mut terminal = Terminal::start(
            &["run", protocol, "--participant", &id, "--operator", "x"],
            folder,
            24,
            80,
        );
        let until = Instant::now() + Duration::from_secs_f64(0.05 + 2.0 * chance.unit());
        let mut seen = 0;
        while Instant::now() < until && terminal.runs() {
            let screen = terminal.screen();
            seen = seen.max(saved(&screen).unwrap_or(0));
            if play_before(&mut terminal, &id, until) == Did::Waited {
                std::thread::sleep(Duration::from_millis(2));
            }
        }
        seen = seen.max(saved(&terminal.screen()).unwrap_or(0));
        terminal.signal("KILL");
        drop(terminal);
        let kept = done(folder, &id);
        assert!(
            kept >= seen,
            "kill {kill}: the screen showed {seen} trials as saved, {kept} are"
        );
        survived = survived.max(kept);
        if is_done(folder, &id) {
            participant += 1;
        }
    }
    assert!(
        survived > 0,
        "no trial was ever finished: nothing was tested"
    );
    // the last session can be finished and is complete
    let id = format!("P{participant:02}");
    let mut terminal = Terminal::start(
        &["run", protocol, "--participant", &id, "--operator", "x"],
        folder,
        24,
        80,
    );
    play_to_end(&mut terminal, &id);
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    assert_eq!(done(folder, &id), 15);
}

fn is_done(folder: &Path, participant: &str) -> bool {
    let Ok(study) = StudyFolder::open(&folder.join("results/turn-signal")) else {
        return false;
    };
    let rows = participants(&study.sessions().unwrap());
    rows.iter()
        .any(|p| p.participant.as_str() == participant && p.state == State::Done)
}

#[test]
fn a_hundred_kills_lose_nothing_that_was_shown_as_saved() {
    kills(1, 100);
}

#[test]
fn another_hundred_kills_lose_nothing_that_was_shown_as_saved() {
    kills(2, 100);
}

/// The same by lines, at a multiple of a person's pace: what the console of another system
/// can show as well.
fn kills_in_lines(seed: u64, count: u32) {
    let home = tempfile::tempdir().unwrap();
    let protocol = home.path().join("protocol");
    changed_protocol("turn-signal", &protocol, &[PATIENT]);
    let protocol = protocol.to_str().unwrap();
    let mut chance = Stream::new(seed, &["kill in lines"]);
    let (mut participant, mut survived) = (1, 0);
    for kill in 0..count {
        let id = format!("P{participant:02}");
        let run = [
            "run",
            protocol,
            "--plain",
            "--participant",
            &id,
            "--operator",
            "x",
        ];
        let lines = Lines::hurried(home.path(), &run);
        let until = Instant::now() + Duration::from_secs_f64(0.1 + 4.0 * chance.unit());
        let seen = lines.play_and_kill(until);
        let kept = done(home.path(), &id);
        assert!(
            kept >= seen,
            "kill {kill}: the lines said that {seen} trials were saved, {kept} are"
        );
        survived += seen;
        if is_done(home.path(), &id) {
            participant += 1;
        }
    }
    assert!(survived > 0, "nothing was saved: nothing was tested");
    // The last session can be finished and is complete.
    let id = format!("P{participant:02}");
    let run = [
        "run",
        protocol,
        "--plain",
        "--participant",
        &id,
        "--operator",
        "x",
    ];
    let end = Lines::hurried(home.path(), &run).play(None);
    assert!(end.starts_with("The session is finished"), "{end}");
    assert_eq!(done(home.path(), &id), 15);
    let (code, out, err) = study(&["verify", "results"], home.path());
    assert_eq!(code, 0, "{out}{err}");
    eprintln!("{count} kills, {participant} participants, {survived} trials shown as saved");
}

#[test]
fn kills_of_a_session_in_lines_lose_nothing_that_was_said_to_be_saved() {
    kills_in_lines(3, 5);
}

#[test]
#[ignore = "minutes: .ci/wine runs it"]
fn two_hundred_kills_in_lines() {
    kills_in_lines(4, 200);
}
