//! Bad input: one clear error each, or faithful storage; nothing written
//! elsewhere, nothing lost.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::play_until;
use crate::support::{Terminal, changed_protocol, repository, study};
use std::fs;
use std::path::{Path, PathBuf};

/// A copy of the paper's protocol in which one text is replaced by another.
fn protocol(folder: &Path, old: &str, new: &str) -> PathBuf {
    let to = folder.join("protocol");
    changed_protocol("turn-signal", &to, &[(old, new)]);
    to
}

/// `study check` of it: the one error that it shows.
fn fault(old: &str, new: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = protocol(folder.path(), old, new);
    let (code, _, err) = study(&["check", path.to_str().unwrap()], folder.path());
    assert_eq!(code, 1, "{err}");
    // the fault, and the line that counts
    assert!(err.contains("error: 1 fault"), "{err}");
    assert_eq!(err.matches("error:").count(), 2, "{err}");
    // `run` and `rehearse` refuse it in the same words and make nothing
    let arguments = ["rehearse", path.to_str().unwrap(), "--participants", "1"];
    let (code, _, again) = study(&arguments, folder.path());
    assert_eq!(code, 1, "{again}");
    assert!(again.contains("error:"), "{again}");
    assert!(!folder.path().join("rehearsal").exists());
    err
}

#[test]
fn an_unknown_key_is_shown_with_what_was_probably_meant() {
    let shown = fault("reference = ", "referense = ");
    assert!(
        shown.contains("unknown key `referense` in [trial]"),
        "{shown}"
    );
    assert!(shown.contains("did you mean `reference`?"), "{shown}");
}

#[test]
fn a_limit_that_is_no_number_is_no_limit() {
    let shown = fault("force_n = 12.0", "force_n = nan");
    assert!(
        shown.contains("force_n") && shown.contains("above 0"),
        "{shown}"
    );
}

#[test]
fn a_missing_model_file_is_named_where_it_is_asked_for() {
    let shown = fault("models/lambda-0.9993.toml", "models/lambda-0.9994.toml");
    assert!(shown.contains("models/lambda-0.9994.toml"), "{shown}");
    assert!(shown.contains("protocol.toml:"), "{shown}");
}

#[test]
fn a_ragged_csv_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let text = "subject,model,repetition,rating,vaf\nS1,A,1,5,0.9\nS1,B,1,5\n";
    fs::write(folder.path().join("r.csv"), text).unwrap();
    let (code, out, err) = study(&["analyze", "r.csv"], folder.path());
    assert_eq!((code, out.as_str()), (1, ""), "{err}");
    assert!(err.contains("r.csv") && err.contains('3'), "{err}");
}

#[test]
fn a_results_folder_of_a_newer_format_is_not_touched() {
    let folder = tempfile::tempdir().unwrap();
    let path = repository("protocols/turn-signal");
    let rehearse = ["rehearse", &path, "--participants", "1", "--out", "results"];
    assert_eq!(study(&rehearse, folder.path()).0, 0);
    let manifest = folder.path().join("results/turn-signal/study.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let newer = text.replace("study-results/1", "study-results/2");
    assert_ne!(
        text, newer,
        "the format is not where this test looks for it"
    );
    fs::write(&manifest, &newer).unwrap();
    for command in ["status", "verify", "analyze"] {
        let (code, _, err) = study(&[command, "results"], folder.path());
        assert_eq!(code, 4, "{command}: {err}");
        assert!(
            err.contains("newer") || err.contains("study-results/2"),
            "{command}: {err}"
        );
    }
    assert_eq!(fs::read_to_string(&manifest).unwrap(), newer);
}

/// What is wrong with the arguments is said before anything is said of a terminal.
#[test]
fn arguments_are_looked_at_before_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let path = repository("protocols/turn-signal");
    let run = |more: &[&str]| {
        let (code, _, err) = study(&[&["run", &path][..], more].concat(), folder.path());
        let terminal = err.contains("needs a terminal");
        assert_eq!(code, if terminal { 2 } else { 1 }, "{err}");
        (terminal, err)
    };
    let (terminal, err) = run(&["--participant", "../../x"]);
    assert!(
        !terminal && err.contains("`../../x` is not a participant id"),
        "{err}"
    );
    let long = "o".repeat(65);
    let (terminal, err) = run(&["--operator", &long]);
    assert!(!terminal && err.contains("at most 64 characters"), "{err}");
    fs::write(folder.path().join("file"), "x").unwrap();
    let (terminal, err) = run(&["--results", "file"]);
    assert!(
        !terminal && err.contains("file is a file, not a folder"),
        "{err}"
    );
    assert!(run(&["--participant", "P01", "--operator", "lw"]).0);
    assert!(!folder.path().join("results").exists());
}

#[test]
fn an_id_that_differs_only_in_case_has_one_hint() {
    let folder = tempfile::tempdir().unwrap();
    let path = repository("protocols/turn-signal");
    let state = ["--state", "no-show", "--reason", "x"];
    let mut terminal = Terminal::start(&["run", &path], folder.path(), 24, 80);
    terminal.wait_for("Enter: begin");
    terminal.keys("P01\tlw\r");
    terminal.wait_for("Operate the real switch");
    drop(terminal);
    let told = "`p01` and the existing `P01` differ only in upper and lower case";
    let hint = "use `P01` if it is the same person";
    for arguments in [
        vec!["run", &path, "--participant", "p01"],
        [&["participant", "results", "p01"][..], &state].concat(),
    ] {
        let (code, _, err) = study(&arguments, folder.path());
        assert_eq!(code, 1, "{err}");
        let lines: Vec<&str> = err
            .lines()
            .filter(|l| !l.starts_with("1 warning"))
            .collect();
        assert_eq!(lines, [format!("error: {told}"), format!("  hint: {hint}")]);
    }
    let mut terminal = Terminal::start(&["run", &path], folder.path(), 24, 80);
    terminal.wait_for("Enter: begin");
    terminal.keys("p01\tlw\r");
    terminal.wait_for("differ only in upper and lower case");
    terminal.wait_for("if it is the same person");
}

#[test]
fn an_id_that_leaves_the_folder_is_refused_on_the_screen_and_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("a/b");
    fs::create_dir_all(&inner).unwrap();
    let path = repository("protocols/turn-signal");
    let mut terminal = Terminal::start(&["run", &path], &inner, 24, 80);
    terminal.wait_for("Enter: begin");
    terminal.keys("../../x\tlw\r");
    terminal.wait_for("is not a participant");
    terminal.keys("\u{3}");
    terminal.wait_for("Are you sure?");
    terminal.keys("y");
    assert_eq!(terminal.exit_code(), 0);
    let (code, _, err) = study(
        &[
            "participant",
            "results",
            "../../x",
            "--state",
            "no-show",
            "--reason",
            "x",
        ],
        &inner,
    );
    assert_ne!(code, 0);
    assert!(err.contains("participant id"), "{err}");
    assert!(!folder.path().join("x").exists() && !folder.path().join("a/x").exists());
    let sessions = inner.join("results/turn-signal/sessions");
    assert_eq!(fs::read_dir(sessions).map_or(0, Iterator::count), 0);
}

#[test]
fn a_hostile_comment_is_stored_as_typed_and_shown_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let path = repository("protocols/turn-signal");
    let arguments = ["run", &path, "--participant", "P01", "--operator", "x"];
    let mut terminal = Terminal::start(&arguments, folder.path(), 24, 80);
    play_until(&mut terminal, "P01", "Tab: comment");
    let comment = "=1+1, \"quoted\"\r\nsecond\u{1b}[2J line 👍🏽 \u{202e}abc";
    // the keys choose, a paste brings the rest as it is
    terminal.keys(&format!("4\t\u{1b}[200~{comment}\u{1b}[201~"));
    terminal.wait_for("second");
    // an Enter that comes with another key was pasted
    std::thread::sleep(std::time::Duration::from_millis(300));
    terminal.keys("\r");
    terminal.wait_for("saved ✓ 1 of 1");
    terminal.keys("\u{3}");
    terminal.wait_for("Are you sure?");
    terminal.keys("y");
    assert_eq!(terminal.exit_code(), 0);

    let stored = comment.replace("\r\n", "\n");
    let ratings = folder.path().join("results/turn-signal/ratings.csv");
    let mut ratings = csv::Reader::from_path(ratings).unwrap();
    let headers = ratings.headers().unwrap().clone();
    let column = headers.iter().position(|h| h == "comment").unwrap();
    let row = ratings.records().next().unwrap().unwrap();
    assert_eq!(&row[column], stored);
    assert_eq!(study(&["verify", "results"], folder.path()).0, 0);
    let analyze = ["analyze", "results", "--include", "pilot", "--comments"];
    let (code, out, err) = study(&analyze, folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("=1+1"), "{out}");
    assert!(!out.contains(['\u{1b}', '\u{202e}']), "{out:?}");
}

#[test]
fn a_json_document_has_no_character_that_controls_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let name = "x\u{9b}31m\u{202e}\u{7f}\u{e0041}.csv";
    let text = "subject,model,rating\nP1,a,1\nP1,b,2\nP2,a,3\nP2,b,5\n";
    fs::write(folder.path().join(name), text).unwrap();
    let (code, out, err) = study(&["analyze", name, "--json"], folder.path());
    assert_eq!(code, 0, "{err}");
    let bad = |c: char| c != '\n' && study_base::text::is_unsafe(c);
    assert!(!out.contains(bad), "{out:?}");
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(document["study"]["path"], name);
    // the same for the faults of a protocol
    let path = protocol(folder.path(), "reference = ", "\"\u{9b}\u{202e}\" = ");
    let arguments = ["check", path.to_str().unwrap(), "--json"];
    let (code, out, _) = study(&arguments, folder.path());
    assert_eq!(code, 1);
    assert!(!out.contains(bad), "{out:?}");
    assert!(
        out.contains("\\u009b\\u202e") || out.contains("u{9b}"),
        "{out}"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn help_that_cannot_be_written_is_an_error() {
    for arguments in [&["--help"][..], &["--version"], &["run", "--help"]] {
        let full = fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap();
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_study"))
            .args(arguments)
            .stdout(full)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let err = String::from_utf8(output.stderr).unwrap();
        assert!(
            err.contains("error: standard output: the disk is full"),
            "{err}"
        );
    }
}

/// Comments and single ratings are for the owner of the folder only, whatever the umask.
#[cfg(unix)]
#[test]
fn only_the_owner_can_read_an_analysis() {
    use std::os::unix::fs::PermissionsExt as _;
    fn check(path: &Path, seen: &mut usize) {
        let mode = fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let private = if path.is_dir() { 0o700 } else { 0o600 };
        assert_eq!(mode, private, "{}", path.display());
        *seen += 1;
        if path.is_dir() {
            for item in fs::read_dir(path).unwrap() {
                check(&item.unwrap().path(), seen);
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let protocol = repository("protocols/turn-signal");
    let binary = env!("CARGO_BIN_EXE_study");
    let script = format!(
        "umask 0; set -e; '{binary}' rehearse '{protocol}' --participants 2 --telemetry 10 --out r >/dev/null; \
         '{binary}' analyze r >/dev/null; '{binary}' analyze r --out a/b/c >/dev/null"
    );
    let shell = std::process::Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(
        shell.status.success(),
        "{}",
        String::from_utf8_lossy(&shell.stderr)
    );
    let mut seen = 0;
    check(&folder.path().join("r"), &mut seen);
    check(&folder.path().join("a"), &mut seen);
    assert!(seen > 40, "{seen}");
    // one of an earlier version is made private, too
    let report = folder.path().join("r/turn-signal/analysis/report.html");
    fs::set_permissions(&report, fs::Permissions::from_mode(0o644)).unwrap();
    let (code, _, err) = study(&["analyze", "r"], folder.path());
    assert_eq!(code, 0, "{err}");
    check(&report, &mut seen);
}
