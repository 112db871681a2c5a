//! Controller programs that stall or lie in a session.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::devices::has_python;
use crate::support::player::play_to_end;
use crate::support::repository;
use std::fs;

/// The example with a change, in a whole session, whose journal has the words.
fn trouble(from: &str, to: &str, words: &[&str]) {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // Every attempt fails: one for each trial is enough.
    let changes = [
        ("\"simulated\"", "\"process\""),
        ("max_attempts = 50", "max_attempts = 1"),
    ];
    let protocol = super::devices::protocol(folder.path(), &changes);
    let example = fs::read_to_string(repository("docs/process_device.py")).unwrap();
    assert!(example.contains(from));
    let script = folder.path().join("controller.py");
    fs::write(&script, example.replacen(from, to, 1)).unwrap();
    let command = format!("python3 '{}'", script.display());
    let mut terminal = super::devices::run(folder.path(), &protocol, &["--command", &command]);
    play_to_end(&mut terminal, "P01");
    let journal = folder
        .path()
        .join("results/turn-signal/sessions/P01/1/journal.jsonl");
    let journal = fs::read_to_string(journal).unwrap();
    for words in words {
        assert!(journal.contains(words), "{words}: {journal}");
    }
}

const PLAYS: &str = "    elif do == \"alive\" and since:";

#[test]
fn a_program_that_is_stopped_is_told_in_words() {
    let to = format!(
        "    elif do == \"alive\" and since and now - since > 0.05:\n        os.kill(os.getpid(), signal.SIGSTOP)\n{PLAYS}"
    );
    trouble(PLAYS, &to, &["sent nothing for 1 s"]);
}

#[test]
fn a_program_that_is_killed_is_told_in_words() {
    let to = format!(
        "    elif do == \"alive\" and since and now - since > 0.05:\n        os.kill(os.getpid(), signal.SIGKILL)\n{PLAYS}"
    );
    trouble(PLAYS, &to, &["has ended by signal: 9 (SIGKILL)"]);
}
