//! Whole sessions by keys on each way to a device.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use support::player::{Did, play};
use support::{Terminal, repository, study};

/// The paper's protocol with one repetition, changed.
fn protocol(folder: &Path, changes: &[(&str, &str)]) -> PathBuf {
    let from = PathBuf::from(repository("protocols/turn-signal"));
    let to = folder.join("protocol");
    fs::create_dir_all(to.join("models")).unwrap();
    for file in fs::read_dir(from.join("models")).unwrap() {
        let file = file.unwrap();
        fs::copy(file.path(), to.join("models").join(file.file_name())).unwrap();
    }
    let mut text = fs::read_to_string(from.join("protocol.toml")).unwrap();
    for (old, new) in [("repetitions = 3", "repetitions = 1")]
        .iter()
        .chain(changes)
    {
        assert!(text.contains(old), "the protocol has no `{old}` any more");
        text = text.replacen(old, new, 1);
    }
    fs::write(to.join("protocol.toml"), text).unwrap();
    to
}

/// Plays on until the screen contains `text`; every screen that was seen.
fn play_until(terminal: &mut Terminal, text: &str) -> Vec<String> {
    let mut seen: Vec<String> = Vec::new();
    let mut turns = 0;
    while !terminal.screen().contains(text) {
        let screen = terminal.screen();
        if seen.last() != Some(&screen) {
            seen.push(screen);
        }
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
    seen
}

/// A finished session; what was seen, and the rows of ratings.csv by column.
fn session(folder: &Path, protocol: &Path, more: &[&str]) -> (Vec<String>, Vec<Row>) {
    let path = protocol.to_str().unwrap();
    let mut arguments = vec!["run", path, "--operator", "lw"];
    arguments.extend(more);
    let mut terminal = Terminal::start(&arguments, folder, 24, 80);
    terminal.wait_for("Who takes part?");
    let seen = play_until(&mut terminal, "Enter closes");
    terminal.keys("\r");
    assert_eq!(terminal.exit_code(), 0);
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    (
        seen,
        ratings(&folder.join("results/turn-signal/ratings.csv")),
    )
}

type Row = std::collections::BTreeMap<String, String>;

fn ratings(path: &Path) -> Vec<Row> {
    let mut file = csv::Reader::from_path(path).unwrap();
    file.deserialize().map(Result::unwrap).collect()
}

#[test]
fn a_session_on_a_child_program_is_real_data_with_telemetry() {
    if std::process::Command::new("python3")
        .arg("--version")
        .output()
        .is_err()
    {
        eprintln!("SKIPPED: python3 is not on this machine");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path(), &[("\"simulated\"", "\"process\"")]);
    let command = format!("python3 {}", repository("docs/process_device.py"));
    let (_, rows) = session(folder.path(), &protocol, &["--command", &command]);
    assert_eq!(rows.len(), 5);
    for row in &rows {
        assert_eq!(row["status"], "ok");
        assert_eq!(row["pilot"], "false");
        assert_eq!(row["device_kind"], "process");
        assert_eq!(row["device_id"], "example-1");
    }
    let telemetry = folder
        .path()
        .join("results/turn-signal/sessions/P01/1/telemetry");
    assert_eq!(fs::read_dir(telemetry).unwrap().count(), 5);
}

/// Samples have a code that names nothing; the codes are for who labels them.
#[test]
fn a_session_on_samples_mounted_by_hand_shows_their_codes_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path(), &[("\"simulated\"", "\"manual\"")]);
    let path = protocol.to_str().unwrap();
    let (code, codes, err) = study(&["device", "codes", path], folder.path());
    assert_eq!(code, 0, "{err}");
    let codes: Vec<(&str, &str)> = codes
        .lines()
        .map(|line| line.split_once("  ").unwrap())
        .collect();
    assert_eq!(codes.len(), 5);
    let (seen, rows) = session(folder.path(), &protocol, &[]);
    assert_eq!(rows.len(), 5);
    // the order of the codes on the screen is that of the realizations in the file
    let mut asked: Vec<&str> = Vec::new();
    for screen in &seen {
        if let Some((_, after)) = screen.split_once("Mount sample ") {
            let code = after.split('.').next().unwrap();
            let (code, model) = codes.iter().find(|(c, _)| *c == code).unwrap();
            if asked.last() != Some(model) {
                asked.push(model);
            }
            assert!(!screen.contains(model), "{code}: {screen}");
        }
        assert!(!screen.contains("lambda"), "{screen}");
    }
    let felt: Vec<&str> = rows.iter().map(|row| row["model"].as_str()).collect();
    assert_eq!(asked, felt);
    for row in &rows {
        assert_eq!(row["device_kind"], "manual");
        assert_eq!(row["pilot"], "false");
        assert!(row["exploration_s"].parse::<f64>().unwrap() > 0.0);
    }
}

/// One physical sample among tables, and Esc while it is being mounted.
#[test]
fn a_sample_among_tables_is_mounted_and_a_stopped_mounting_comes_again() {
    let folder = tempfile::tempdir().unwrap();
    let manual = "id = \"lambda-0.9995\"\ndevice = \"manual\"";
    let protocol = protocol(folder.path(), &[("id = \"lambda-0.9995\"", manual)]);
    let path = protocol.to_str().unwrap();
    let mut terminal = Terminal::start(&["run", path, "--operator", "lw"], folder.path(), 24, 80);
    terminal.wait_for("Who takes part?");
    play_until(&mut terminal, "Mount sample");
    terminal.keys("\u{1b}");
    terminal.wait_for("Operate the real switch");
    let seen = play_until(&mut terminal, "Enter closes");
    let mounts = seen.iter().filter(|s| s.contains("Mount sample"));
    assert!(mounts.count() >= 1);
    terminal.keys("\r");
    assert_eq!(terminal.exit_code(), 0);
    let rows = ratings(&folder.path().join("results/turn-signal/ratings.csv"));
    assert_eq!(rows.len(), 5);
    let mounted = rows.iter().find(|r| r["model"] == "lambda-0.9995").unwrap();
    assert_eq!((&*mounted["status"], &*mounted["attempt"]), ("ok", "2"));
}
