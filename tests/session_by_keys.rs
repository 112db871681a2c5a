//! Whole sessions in a pseudo-terminal of 80×24, by keys alone.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::fs;
use support::player::{Did, play};
use support::{Terminal, repository, study};

fn start(folder: &std::path::Path, protocol: &str) -> Terminal {
    let path = repository(&format!("protocols/{protocol}"));
    let mut terminal = Terminal::start(&["run", &path, "--operator", "lw"], folder, 24, 80);
    terminal.wait_for("Who takes part?");
    terminal
}

/// Plays on until the screen contains `text`.
fn play_until(terminal: &mut Terminal, text: &str) {
    let mut turns = 0;
    while !terminal.screen().contains(text) {
        if play(terminal, "P01") == Did::Waited {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        turns += 1;
        assert!(
            turns < 20_000,
            "`{text}` never comes:\n{}",
            terminal.screen()
        );
    }
}

/// Opens a dialog by its key and types into it.
fn dialog(terminal: &mut Terminal, key: &str, title: &str, typed: &str) {
    terminal.keys(key);
    terminal.wait_for(title);
    terminal.keys(typed);
    terminal.wait_until("the dialog to close", |s| !s.contains(title));
}

const F2: &str = "\u{1b}OQ";
const F3: &str = "\u{1b}OR";
const F4: &str = "\u{1b}OS";
const F10: &str = "\u{1b}[21~";

/// A session with everything that can happen in it.
fn eventful(protocol: &str, trials: usize, comment: &str) {
    let folder = tempfile::tempdir().unwrap();
    let mut terminal = start(folder.path(), protocol);
    // the first trial that counts, rated with a comment
    play_until(&mut terminal, "Enter to rate");
    dialog(&mut terminal, F2, "Tab who", "motor hums\r");
    assert!(
        terminal.screen().contains("Feel the device"),
        "the remark ended the playback"
    );
    play_until(&mut terminal, "trial 2 of");
    // a bad one
    play_until(&mut terminal, "Enter to rate");
    dialog(&mut terminal, F4, "Enter marks it", "somebody came in\r");
    play_until(&mut terminal, "trial 3 of");
    // a correction: the newest answer
    terminal.keys(F3);
    terminal.wait_for("Correct");
    terminal.keys("\r");
    terminal.wait_until("the new answer", |s| s.contains("Enter goes on"));
    terminal.keys(comment);
    terminal.keys("\r");
    terminal.wait_until("the reason", |s| s.contains("Enter corrects"));
    terminal.keys("mistyped\r");
    terminal.wait_until("the dialog to close", |s| !s.contains("Enter corrects"));
    // leave in the middle, and come back
    terminal.keys(F10);
    terminal.wait_for("Are you sure?");
    terminal.keys("y");
    assert_eq!(terminal.exit_code(), 0);
    assert!(!terminal.alternate());
    assert!(
        terminal.screen().contains("not finished"),
        "{}",
        terminal.screen()
    );

    let mut terminal = start(folder.path(), protocol);
    play_until(&mut terminal, "Enter closes");
    terminal.keys("\r");
    assert_eq!(terminal.exit_code(), 0);

    let results = folder.path().join("results").join(protocol);
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let (code, out, err) = study(&["status", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("done"), "{out}");
    let (code, out, err) = study(&["analyze", "results"], folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("pilot"), "{out}");

    let mut ratings = csv::Reader::from_path(results.join("ratings.csv")).unwrap();
    let headers = ratings.headers().unwrap().clone();
    let column = |name: &str| headers.iter().position(|h| h == name).unwrap();
    let (status, practice) = (column("status"), column("practice"));
    let (corrected, pilot) = (column("corrected"), column("pilot"));
    let rows: Vec<csv::StringRecord> = ratings.records().map(Result::unwrap).collect();
    let counted: Vec<_> = rows.iter().filter(|r| &r[practice] == "false").collect();
    assert_eq!(counted.len(), trials);
    assert!(
        counted
            .iter()
            .all(|r| &r[status] == "ok" && &r[pilot] == "true")
    );
    assert_eq!(rows.iter().filter(|r| &r[corrected] == "true").count(), 1);
    assert_eq!(
        counted
            .iter()
            .filter(|r| &r[column("attempt")] == "2")
            .count(),
        1
    );
    assert!(
        counted
            .iter()
            .any(|r| &r[column("remarks")] == "motor hums")
    );
    let attempts = fs::read_to_string(results.join("attempts.csv")).unwrap();
    for word in ["somebody came in", "mistyped", "motor hums"] {
        assert!(attempts.contains(word), "{word}");
    }
}

#[test]
fn the_papers_study_with_a_correction_a_remark_a_bad_trial_a_quit_and_a_resume() {
    eventful("turn-signal", 15, "3");
}
