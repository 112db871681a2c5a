//! Whole sessions in a pseudo-terminal of 80×24, by keys alone.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::{
    F2, correct_newest, dialog, mark_bad, play_to_end, play_until as until, quit,
};
use crate::support::{PATIENT, Terminal, changed_protocol, study};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

fn start(folder: &Path, protocol: &Path) -> Terminal {
    let path = protocol.to_str().unwrap();
    Terminal::hurried(&["run", path, "--operator", "lw"], folder)
}

fn play_until(terminal: &mut Terminal, text: &str) {
    until(terminal, "P01", text);
}

/// A session with a remark, a bad trial, a correction, a quit and a resume.
fn eventful(protocol: &Path, id: &str, trials: usize) {
    let folder = tempfile::tempdir().unwrap();
    let mut terminal = start(folder.path(), protocol);
    // a remark during the first counted trial
    play_until(&mut terminal, "trial 1 of");
    play_until(&mut terminal, "Enter: rate");
    dialog(&mut terminal, F2, "Tab: author", "motor hums\r");
    // a busy machine may lose the playback; the remark does not end it
    terminal.wait_until("the playback to go on", |s| {
        s.contains("Feel the device") || s.contains("DEVICE TROUBLE")
    });
    play_until(&mut terminal, "trial 2 of");
    // a bad trial
    play_until(&mut terminal, "Enter: rate");
    mark_bad(&mut terminal, "somebody came in");
    play_until(&mut terminal, "trial 3 of");
    // a correction: the newest answer
    correct_newest(&mut terminal, "3", "mistyped");
    let (_, out, _) = study(&["status", "results"], folder.path());
    assert!(out.contains("running now"), "{out}");
    // quit in the middle, and resume
    quit(&mut terminal);
    let (_, out, _) = study(&["status", "results"], folder.path());
    assert!(
        out.contains("unfinished") && !out.contains("running now"),
        "{out}"
    );
    assert!(!terminal.alternate());
    assert!(
        terminal.screen().contains("not finished"),
        "{}",
        terminal.screen()
    );

    let mut terminal = start(folder.path(), protocol);
    terminal.wait_for("P01 was interrupted at ");
    terminal.wait_for(&format!("Type P01 to go on with trial 3 of {trials},"));
    terminal.keys("P01");
    terminal.wait_for(&format!("unfinished, 2 of {trials} trials saved"));
    terminal.keys("\r");
    terminal.wait_for(&format!("welcome back: 2 of {trials} trials are saved"));
    play_to_end(&mut terminal, "P01");

    // who a typed id is, before it takes a row
    let mut terminal = start(folder.path(), protocol);
    for (id, who) in [
        ("P01", "finished"),
        ("p01", "too similar to P01"),
        ("P02", "new, a pilot"),
    ] {
        terminal.keys(&format!("\u{15}{id}"));
        terminal.wait_for(who);
    }
    quit(&mut terminal);

    let results = folder.path().join("results").join(id);
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let (code, out, err) = study(&["status", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("done"), "{out}");
    let (code, _, err) = study(&["analyze", "results"], folder.path());
    assert_eq!(code, 1, "{err}");
    assert!(
        err.contains("only pilots") && err.contains("--include pilot"),
        "{err}"
    );
    let analyze = ["analyze", "results", "--include", "pilot"];
    let (code, out, err) = study(&analyze, folder.path());
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
    let attempts = fs::read_to_string(results.join("attempts.csv")).unwrap();
    let again = counted.iter().filter(|r| &r[column("attempt")] == "2");
    // the simulated device may fail as well, and that trial is then repeated too
    assert!(again.count() >= 1, "{attempts}");
    assert_eq!(
        attempts.matches("somebody came in").count(),
        1,
        "{attempts}"
    );
    assert!(
        counted
            .iter()
            .any(|r| &r[column("remarks")] == "motor hums")
    );
    for word in ["mistyped", "motor hums"] {
        assert!(attempts.contains(word), "{word}");
    }
}

#[test]
fn the_papers_study_with_a_correction_a_remark_a_bad_trial_a_quit_and_a_resume() {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("paper");
    changed_protocol("turn-signal", &to, &[PATIENT]);
    eventful(&to, "turn-signal", 15);
}

/// The extended protocol with one repetition and short waits.
fn shortened(folder: &Path) -> PathBuf {
    let to = folder.join("extended");
    let changes = [
        ("repetitions = 3", "repetitions = 1"),
        (
            "breaks = { every = 10, at_least_s = 60 }",
            "breaks = { every = 4, at_least_s = 1 }",
        ),
        ("reference_min_s = 3", "reference_min_s = 0"),
        ("minimum_strokes = 2", "minimum_strokes = 1"),
        ("max_attempts = 3", "max_attempts = 50"),
    ];
    changed_protocol("turn-signal-extended", &to, &changes);
    to
}

#[test]
fn the_extended_study_with_the_same_and_its_consent_forms_practice_and_breaks() {
    let folder = tempfile::tempdir().unwrap();
    eventful(&shortened(folder.path()), "turn-signal-extended", 10);
}

#[test]
fn an_erasure_lists_what_goes_and_asks_for_the_id() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("paper");
    changed_protocol("turn-signal", &protocol, &[PATIENT]);
    let mut terminal = start(folder.path(), &protocol);
    play_until(&mut terminal, "trial 2 of");
    quit(&mut terminal);
    let erase = [
        "participant",
        "results",
        "P01",
        "--state",
        "withdrawn",
        "--reason",
        "asked",
        "--erase",
    ];
    let journal = folder
        .path()
        .join("results/turn-signal/sessions/P01/1/journal.jsonl");
    // without a terminal it is refused
    let (code, out, err) = study(&erase, folder.path());
    assert_eq!(code, 1, "{out}");
    assert!(out.contains("sessions/P01/1/journal.jsonl"), "{out}");
    assert!(err.contains("--yes"), "{err}");
    for (typed, goes) in [("P02", false), ("", false), ("P01", true)] {
        assert!(journal.exists());
        let mut terminal = Terminal::start(&erase, folder.path(), 40, 80);
        terminal.wait_for("Type P01 to erase them:");
        assert!(terminal.screen().contains("sessions/P01/1/journal.jsonl"));
        terminal.keys(&format!("{typed}\r"));
        assert_eq!(terminal.exit_code(), 0);
        let screen = terminal.screen();
        assert_eq!(screen.contains("Nothing is erased."), !goes, "{screen}");
        assert_eq!(journal.exists(), !goes);
    }
}

/// Nobody rates what was not felt, and no answer comes from keys that were typed before
/// the question appeared.
#[test]
fn held_quick_or_early_keys_answer_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("paper");
    changed_protocol("turn-signal", &protocol, &[PATIENT]);
    // At a person's pace, which is the matter here.
    let run = ["run", protocol.to_str().unwrap(), "--operator", "lw"];
    let mut terminal = Terminal::start(&run, folder.path(), 24, 80);
    terminal.wait_for("Who takes part?");
    play_until(&mut terminal, "Enter: when ready");
    terminal.keys("\r\r\r\r");
    // held: the first repeat comes late, the others quickly, until well after the device plays
    std::thread::sleep(Duration::from_millis(600));
    let mut repeats = 0;
    while repeats < 15 {
        terminal.keys("\r");
        std::thread::sleep(Duration::from_millis(30));
        let screen = terminal.screen();
        assert!(!screen.contains("1–7: choose"), "{screen}");
        repeats += usize::from(screen.contains("Feel the device"));
    }
    // one deliberate Enter rates; what comes with it is too early for the question
    let rated = |screen: &str| screen.contains("1–7: choose");
    for _ in 0..20 {
        play_until(&mut terminal, "Enter: rate");
        terminal.keys("\r6\r");
        terminal.wait_until("the question", |s| rated(s) || s.contains("DEVICE TROUBLE"));
        if rated(&terminal.screen()) {
            break;
        }
    }
    std::thread::sleep(Duration::from_millis(300));
    let screen = terminal.screen();
    assert!(rated(&screen) && !screen.contains("┃  6  ┃"), "{screen}");
    // in a dialog every key counts
    dialog(&mut terminal, F2, "Tab: author", "quickly\r");
    play_until(&mut terminal, "trial 2 of");
    let journal = "results/turn-signal/sessions/P01/1/journal.jsonl";
    let journal = fs::read_to_string(folder.path().join(journal)).unwrap();
    assert!(journal.contains("quickly"), "{journal}");
}

/// A pasted line is no answer to what was not looked at, whether the terminal marks it as
/// pasted or sends it as keys.
#[test]
fn pasted_lines_answer_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("paper");
    changed_protocol("turn-signal", &protocol, &[PATIENT]);
    let mut terminal = start(folder.path(), &protocol);
    let pasted = "6\r7\r6\r7\r6\r".repeat(4);
    let marked = format!("\u{1b}[200~{pasted}\u{1b}[201~");
    let rates = |screen: &str| screen.contains("1–7: choose");
    for _ in 0..20 {
        play_until(&mut terminal, "Enter: rate");
        terminal.keys(&pasted);
        std::thread::sleep(Duration::from_millis(300));
        let screen = terminal.screen();
        assert!(!rates(&screen), "{screen}");
        // a busy machine may lose the playback
        if screen.contains("Enter: rate") {
            break;
        }
    }
    play_until(&mut terminal, "1–7: choose");
    for paste in [&pasted, &marked] {
        terminal.keys(paste);
        std::thread::sleep(Duration::from_millis(300));
        let screen = terminal.screen();
        assert!(rates(&screen) && screen.contains("trial 1 of"), "{screen}");
    }
    terminal.wait_for("no text field to paste into");
    // the choice is on the screen, and a deliberate key changes it
    terminal.wait_for("┃  6  ┃");
    play_until(&mut terminal, "trial 2 of");
    let journal = "results/turn-signal/sessions/P01/1/journal.jsonl";
    let journal = fs::read_to_string(folder.path().join(journal)).unwrap();
    let answers = journal.matches("\"question\":\"realism\"").count();
    assert_eq!(answers, 1, "{journal}");
    assert!(journal.contains("{\"rating\":3}"), "{journal}");
}
