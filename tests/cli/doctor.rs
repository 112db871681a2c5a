//! `study doctor`: what it measures and says on this machine, whatever its speed.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::simulator::Simulator;
use crate::support::{Terminal, changed_protocol, copy_folder, repository, study};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What it leaves in a folder.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.collect()
}

/// The document of a run, whose exit code is that of its verdicts: 4 for the disk, 3 for what was
/// asked, else 0.
fn measured(arguments: &[&str], folder: &Path) -> (Value, String) {
    let (code, out, err) = study(&[&["doctor", "--json"], arguments].concat(), folder);
    let document: Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}: {out}{err}"));
    assert_eq!(document["format"], "study-doctor/1");
    let unfit = |finding: &&Value| finding["fit"] == "not-fit";
    let findings = document["findings"].as_array().unwrap();
    let concerns = |finding: &Value, purpose: &Value| {
        let uses = finding["uses"].as_array().unwrap();
        uses.contains(purpose)
    };
    let of_disk = findings
        .iter()
        .filter(unfit)
        .any(|finding| finding["about"] == "disk" && concerns(finding, &Value::from("hand")));
    let of_asked = (findings.iter().filter(unfit)).any(|f| concerns(f, &document["asked"]));
    let expected = match (of_disk, of_asked) {
        (true, _) => 4,
        (false, true) => 3,
        (false, false) => 0,
    };
    assert_eq!(code, expected, "{out}{err}");
    assert!(document["seconds"].as_f64().unwrap() < 20.0);
    (document, err)
}

/// What a finding of this name says.
fn says<'d>(document: &'d Value, id: &str) -> &'d str {
    let findings = document["findings"].as_array().unwrap();
    let found = findings.iter().find(|finding| finding["id"] == id);
    found.unwrap_or_else(|| panic!("{id}: {document:#}"))["says"]
        .as_str()
        .unwrap()
}

#[test]
fn a_folder_is_measured_and_left_as_it_was() {
    let home = tempfile::tempdir().unwrap();
    let (document, _) = measured(&[], home.path());
    assert_eq!(document["asked"], Value::Null);
    assert_eq!(names(home.path()), Vec::<String>::new());
    for (stretch, least) in [("quiet", 20), ("saving", 20)] {
        let late = &document["measured"]["timing"][stretch];
        for thread in ["turn", "heartbeat", "screen"] {
            assert!(late[thread]["n"].as_u64().unwrap() > least, "{late:#}");
            assert!(late[thread]["median_ms"].as_f64() <= late[thread]["largest_ms"].as_f64());
        }
    }
    let disk = &document["measured"]["disk"];
    assert!(disk["record"]["n"].as_u64().unwrap() > 0, "{disk:#}");
    assert!(disk["free_bytes"].as_u64().unwrap() > 0);
    assert_eq!(disk["broken"], Value::from(Vec::<Value>::new()));
    assert!(says(&document, "heartbeat").contains("watchdog time of 30 ms"));
    assert!(
        says(&document, "terminal").contains("is no terminal")
            || says(&document, "terminal").contains("Neither")
    );
    let uses = document["verdicts"].as_array().unwrap().iter();
    let uses: Vec<&str> = uses
        .map(|verdict| verdict["use"].as_str().unwrap())
        .collect();
    assert_eq!(uses, ["hand", "serial", "tablet", "unattended"]);
}

#[test]
fn a_bad_port_and_a_bad_program_say_so_in_words() {
    let home = tempfile::tempdir().unwrap();
    let (document, err) = measured(&["--port", "no\u{1b}[31msuch"], home.path());
    assert_eq!(document["asked"], "serial");
    assert!(
        says(&document, "device").contains("no such port"),
        "{document:#}"
    );
    assert!(!err.contains('\u{1b}') && err.contains("not fit"), "{err}");
    let (code, out, err) = study(
        &["doctor", "--command", "no-such-program \u{1b}"],
        home.path(),
    );
    assert!([3, 4].contains(&code), "{out}{err}");
    assert!(out.contains("there is no such program"), "{out}");
    assert!(!out.contains('\u{1b}') && !err.contains('\u{1b}'));
    let hand = out
        .lines()
        .find(|line| line.starts_with("manual or process"))
        .unwrap();
    assert!(
        hand.contains("NOT FIT") && hand.contains("device"),
        "{hand}"
    );
    assert_eq!(names(home.path()), Vec::<String>::new());
    // something that is no serial port, and both kinds of device at once
    let (document, _) = measured(&["--port", "tcp://127.0.0.1:1"], home.path());
    assert!(
        says(&document, "device").contains("no device listens there"),
        "{document:#}"
    );
    let both = ["doctor", "--port", "x", "--command", "y"];
    assert_eq!(study(&both, home.path()).0, 2);
}

#[test]
fn a_device_is_measured_and_stays_limp() {
    let home = tempfile::tempdir().unwrap();
    let mut simulator = Simulator::start_tcp(&[]);
    let port = simulator.port.to_str().unwrap().to_owned();
    let (document, err) = measured(&["--port", &port], home.path());
    let device = &document["measured"]["device"];
    assert_eq!(device["watchdog_ms"], 200.0, "{document:#}");
    assert_eq!(device["simulated"], true);
    assert!(device["trips"]["n"].as_u64().unwrap() > 5, "{device:#}");
    assert!(says(&document, "round-trip").contains("watchdog time of 200 ms"));
    assert!(says(&document, "heartbeat").contains("this device"));
    // The token is a secret.
    let token = port.split_once("//").unwrap().1.split_once('@').unwrap().0;
    assert!(!document.to_string().contains(token) && !err.contains(token));
    let place = simulator.ask("where");
    assert!(place.ends_with("0.000 N"), "{place}");
}

#[cfg(unix)]
#[test]
fn a_program_is_measured_by_its_messages() {
    let home = tempfile::tempdir().unwrap();
    let command = format!("python3 '{}'", repository("docs/process_device.py"));
    let (document, _) = measured(&["--command", &command], home.path());
    let device = &document["measured"]["device"];
    assert_eq!(device["id"], "example-1", "{document:#}");
    assert_eq!(device["watchdog_ms"], 500.0);
    assert!(device["trips"]["n"].as_u64().unwrap() > 5, "{device:#}");
    assert!(device["hello_ms"].as_f64().unwrap() > 0.0);
    assert_eq!(document["asked"], "hand");
}

#[test]
fn a_study_keeps_the_record_and_no_other_command_minds() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("example");
    copy_folder(
        Path::new(&repository("results/turn-signal-example")),
        &folder,
    );
    let copy = home.path().join("copy");
    copy_folder(&folder, &copy);
    let (before, verified, _) = study(&["verify", "example"], home.path());
    let had = names(&folder).len();
    let (document, err) = measured(&["example"], home.path());
    let kept = names(&folder.join("doctor"));
    assert_eq!(kept.len(), 1, "{kept:?}");
    assert!(
        kept[0].ends_with("Z.json") && err.contains(&kept[0]),
        "{kept:?} {err}"
    );
    let text = fs::read_to_string(folder.join("doctor").join(&kept[0])).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), document);
    assert_eq!(names(&folder).len(), had + 1);
    // What it says more is that the record is not checked.
    let again = study(&["verify", "example"], home.path()).1;
    let beside = again.strip_prefix(&*verified);
    assert_eq!(
        beside,
        Some("Not checked: doctor/, from which nothing is derived.\n")
    );
    let (code, out, err) = study(&["verify", "example", "--against", "copy"], home.path());
    assert_eq!(code, before, "{out}{err}");
    let status = study(&["status", "example"], home.path());
    assert_eq!(status.0, 0, "{}", status.2);
    for format in ["csv", "bids"] {
        let arguments = [
            "export",
            "example",
            "--to",
            format,
            "--include",
            "simulated",
            "--out",
            format,
        ];
        let (code, _, err) = study(&arguments, home.path());
        assert_eq!(code, 0, "{format}: {err}");
        assert!(!names(&home.path().join(format)).contains(&"doctor".to_owned()));
    }
    // A link in the place of the folder would lead elsewhere.
    #[cfg(unix)]
    {
        fs::remove_dir_all(folder.join("doctor")).unwrap();
        std::os::unix::fs::symlink(home.path(), folder.join("doctor")).unwrap();
        let (_, err) = measured(&["example"], home.path());
        assert!(err.contains("no record was saved"), "{err}");
    }
}

#[test]
fn a_protocol_says_what_is_asked() {
    let home = tempfile::tempdir().unwrap();
    let protocol = home.path().join("protocol");
    changed_protocol(
        "turn-signal",
        &protocol,
        &[("kind = \"simulated\"", "kind = \"serial\"")],
    );
    let (document, _) = measured(&["protocol"], home.path());
    assert_eq!(document["asked"], "serial");
    assert_eq!(document["measured"]["device"], Value::Null);
    assert!(!home.path().join("results").exists());
    fs::write(home.path().join("a-file"), "").unwrap();
    let (code, _, err) = study(&["doctor", "--results", "a-file"], home.path());
    assert!(
        code == 1 && err.contains("is a file, not a folder"),
        "{err}"
    );
    fs::write(home.path().join("device.toml"), "[serial]\nprot = 1\n").unwrap();
    let (code, _, err) = study(&["doctor", "protocol"], home.path());
    assert!(code == 1 && err.contains("unknown field"), "{err}");
}

#[cfg(unix)]
#[test]
fn a_terminal_is_seen_and_ctrl_c_leaves_nothing() {
    let home = tempfile::tempdir().unwrap();
    let mut small = Terminal::start(&["doctor"], home.path(), 60, 79);
    small.wait_for("unattended rehearsal and analysis");
    let shown = small.screen();
    assert!(
        shown.contains("79 × 60 cells") && shown.contains("80 × 24"),
        "{shown}"
    );
    assert!(shown.contains("--plain"), "{shown}");
    small.exit_code();

    let mut ended = Terminal::start(&["doctor"], home.path(), 60, 100);
    let trial = home.path().join(".study-doctor.tmp");
    ended.wait_until("the disk is tried", |_| trial.exists());
    ended.signal("INT");
    assert_eq!(ended.exit_code(), 3);
    assert_eq!(names(home.path()), Vec::<String>::new());
}

/// A library for `LD_PRELOAD` with which every sync takes as long as `SYNC_MS` says; none without a C compiler.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn slow_syncs(folder: &Path) -> Option<std::path::PathBuf> {
    let source = "#include <stdlib.h>\n#include <unistd.h>\n\
                  int fsync(int file) { (void)file; usleep(1000 * atoi(getenv(\"SYNC_MS\"))); return 0; }\n\
                  int fdatasync(int file) { return fsync(file); }\n";
    let (from, library) = (folder.join("slow.c"), folder.join("slow.so"));
    fs::write(&from, source).unwrap();
    let mut compiler = std::process::Command::new("cc");
    compiler
        .args(["-shared", "-fPIC", "-o"])
        .args([&library, &from]);
    compiler.status().ok()?.success().then_some(library)
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[test]
fn a_slow_disk_is_measured_and_said_in_words() {
    let home = tempfile::tempdir().unwrap();
    let Some(library) = slow_syncs(home.path()) else {
        return eprintln!("SKIPPED: no C compiler here, so no slow disk");
    };
    let results = home.path().join("results");
    fs::create_dir(&results).unwrap();
    // A record takes three syncs or more.
    for (sync_ms, least_ms, fit) in [(100, 300.0, "with-limits"), (800, 2400.0, "not-fit")] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_study"))
            .args(["doctor", "--json"])
            .current_dir(home.path())
            .env("LD_PRELOAD", &library)
            .env("SYNC_MS", sync_ms.to_string())
            .output()
            .unwrap();
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        let record = &document["measured"]["disk"]["record"];
        assert!(
            record["median_ms"].as_f64().unwrap() >= least_ms,
            "{record:#}"
        );
        let findings = document["findings"].as_array().unwrap();
        let saving = findings.iter().find(|finding| finding["id"] == "saving");
        let saving = saving.unwrap();
        assert_eq!(saving["fit"], fit, "{saving:#}");
        assert!(
            says(&document, "saving").contains("A record is saved within"),
            "{saving:#}"
        );
        assert!(
            saving["advice"].as_str().unwrap().contains("disk"),
            "{saving:#}"
        );
        assert!(document["seconds"].as_f64().unwrap() < 20.0, "{document:#}");
        if fit == "not-fit" {
            assert_eq!(output.status.code(), Some(4), "{document:#}");
        }
        assert_eq!(names(&results), Vec::<String>::new());
    }
}
