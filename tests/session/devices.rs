//! Whole sessions by keys on each kind of device.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::print_stderr, reason = "what is skipped is printed")]

use crate::support::player::{enter, play_to_end, play_until};
use crate::support::simulator::Simulator;
use crate::support::{PATIENT, Terminal, changed_protocol, repository, study};
use std::fs;
use std::path::{Path, PathBuf};

/// The protocol of the paper with one repetition and other changes.
pub(crate) fn protocol(folder: &Path, changes: &[(&str, &str)]) -> PathBuf {
    let to = folder.join("protocol");
    let changes = [&[("repetitions = 3", "repetitions = 1"), PATIENT], changes].concat();
    changed_protocol("turn-signal", &to, &changes);
    to
}

/// `study run` on its first page.
pub(crate) fn run(folder: &Path, protocol: &Path, more: &[&str]) -> Terminal {
    let path = protocol.to_str().unwrap();
    let arguments = [&["run", path, "--operator", "lw"], more].concat();
    let mut terminal = Terminal::start(&arguments, folder, 24, 80);
    terminal.wait_for("Who takes part?");
    terminal
}

/// Plays a whole session: the pages seen, and the rows of ratings.csv by column.
pub(crate) fn session(folder: &Path, protocol: &Path, more: &[&str]) -> (Vec<String>, Vec<Row>) {
    let mut terminal = run(folder, protocol, more);
    let seen = play_to_end(&mut terminal, "P01");
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    (
        seen,
        ratings(&folder.join("results/turn-signal/ratings.csv")),
    )
}

pub(crate) type Row = std::collections::BTreeMap<String, String>;

/// How a trial ended, on which device, and whether it is a pilot's.
pub(crate) fn felt(row: &Row) -> [&str; 4] {
    ["status", "device_kind", "device_id", "pilot"].map(|column| row[column].as_str())
}

pub(crate) fn ratings(path: &Path) -> Vec<Row> {
    let mut file = csv::Reader::from_path(path).unwrap();
    file.deserialize().map(Result::unwrap).collect()
}

#[test]
fn a_session_on_a_child_program_is_real_data_with_telemetry() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path(), &[("\"simulated\"", "\"process\"")]);
    // the documented example, as if it drove a motor
    let example = fs::read_to_string(repository("docs/process_device.py")).unwrap();
    let real = example.replace(" simulated=True,", "");
    assert_ne!(real, example);
    let script = folder.path().join("controller.py");
    fs::write(&script, real).unwrap();
    let command = format!("python3 {}", script.display());
    let (_, rows) = session(folder.path(), &protocol, &["--command", &command]);
    assert_eq!(rows.len(), 5);
    for row in &rows {
        assert_eq!(felt(row), ["ok", "process", "example-1", "false"]);
    }
    let telemetry = "results/turn-signal/sessions/P01/1/telemetry";
    let telemetry = fs::read_dir(folder.path().join(telemetry)).unwrap();
    assert_eq!(telemetry.count(), 5);
}

/// A shortened study by keys on the simulated device: a mechanism among its playbacks, every
/// one with the force of its realization.
fn mechanism_by_keys(name: &str, waits: &[(&str, &str)], trials: usize, asked: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("protocol");
    let shorter = [
        ("repetitions = 3", "repetitions = 1"),
        ("reference_min_s = 3", "reference_min_s = 0"),
        ("minimum_strokes = 2", "minimum_strokes = 1"),
    ];
    changed_protocol(name, &to, &[&shorter, waits].concat());
    play_to_end(&mut run(folder.path(), &to, &[]), "P01");
    let results = folder.path().join("results").join(name);
    let rows = ratings(&results.join("ratings.csv"));
    let tested: Vec<&Row> = rows
        .iter()
        .filter(|row| row["practice"] == "false")
        .collect();
    assert_eq!(tested.len(), trials);
    assert!(tested.iter().any(|row| row["model"] == "mechanism"));
    for row in tested {
        assert_eq!(row["status"], "ok", "{row:?}");
        assert!(
            ["ok", "too-little"].contains(&&*row["rendering"]),
            "{row:?}"
        );
        assert!(asked.iter().all(|q| !row[*q].is_empty()), "{row:?}");
    }
}

#[test]
fn a_session_with_the_knob_by_keys() {
    mechanism_by_keys("knob", &[PATIENT], 7, &["realism", "crispness"]);
}

#[test]
fn a_session_with_the_passive_realizations_by_keys() {
    let waits = [
        ("at_least_s = 60", "at_least_s = 1"),
        ("max_attempts = 3", "max_attempts = 50"),
    ];
    mechanism_by_keys("turn-signal-passive", &waits, 9, &["realism"]);
}

/// A controller that plays tables only is not given a study with a mechanism: nothing is
/// created.
#[test]
fn a_mechanism_on_a_device_for_tables_is_refused_before_the_session() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("protocol");
    changed_protocol(
        "turn-signal-passive",
        &to,
        &[("\"simulated\"", "\"process\"")],
    );
    let command = format!("python3 {}", repository("docs/process_device.py"));
    let arguments = ["run", to.to_str().unwrap(), "--command", &command];
    let (code, _, err) = study(&arguments, folder.path());
    assert_eq!(code, 3, "{err}");
    assert!(
        err.contains(
            "realization `mechanism` is a mechanism, and the device `example-1` plays tables only"
        ),
        "{err}"
    );
    assert!(!folder.path().join("results").exists());
}

/// Whether there is a Python for the example controller.
pub(crate) fn has_python() -> bool {
    let found = std::process::Command::new("python3")
        .arg("--version")
        .output()
        .is_ok();
    if !found {
        eprintln!("SKIPPED: python3 is not on this machine");
    }
    found
}

/// While a program has not said hello, the screen shows it, and a key quits. Nothing is
/// created.
#[test]
fn the_screen_shows_that_a_program_has_not_said_hello() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path(), &[("\"simulated\"", "\"process\"")]);
    let path = protocol.to_str().unwrap();
    let arguments = ["run", path, "--command", "sleep 60"];
    for key in ["\u{1b}", "q"] {
        let mut terminal = Terminal::start(&arguments, folder.path(), 24, 80);
        terminal.wait_for("Waiting for the device.");
        terminal.wait_for("`sleep 60` has not said hello yet: 1 of at most 10 s.");
        terminal.keys(key);
        terminal.wait_for("Nothing was recorded.");
        assert!(!terminal.alternate());
        assert_eq!(terminal.exit_code(), 0);
    }
    // one that ends is reported with its last line
    let script = folder.path().join("broken.sh");
    fs::write(&script, "sleep 1; echo no encoder >&2; exit 7").unwrap();
    let command = format!("sh {}", script.display());
    let arguments = ["run", path, "--command", &command];
    let (code, _, err) = study(&arguments, folder.path());
    assert_eq!(code, 3, "{err}");
    assert!(
        err.contains("` has ended with exit status 7; its last error message: no encoder"),
        "{err}"
    );
    assert!(!folder.path().join("results").exists());
}

/// A controller that ends during a trial is not reported as a disconnected cable.
#[test]
fn a_program_that_ends_is_reported_with_its_status_and_its_last_line() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path(), &[("\"simulated\"", "\"process\"")]);
    let script = folder.path().join("c.sh");
    let hello = r#"{"say":"hello","format":"study-process/1","id":"c","telemetry":false,"limits":{"force_n":9,"velocity_mm_s":500}}"#;
    let text = format!(
        "if test -e gone; then echo 'no encoder for lambda-0.9995' >&2; exit 7; fi\necho '{hello}'\nwhile read line; do case $line in *load*lambda*) touch gone; echo 'no encoder for lambda-0.9995' >&2; exit 7;; esac; done\n"
    );
    fs::write(&script, text).unwrap();
    let mut terminal = run(folder.path(), &protocol, &["--command", "sh c.sh"]);
    play_until(&mut terminal, "P01", "DEVICE TROUBLE");
    let flowing = |screen: &str| {
        let screen = screen.replace('┃', "");
        let words: Vec<&str> = screen.split_whitespace().collect();
        words.join(" ")
    };
    // On a busy machine the exit status may come a moment later.
    for words in [
        "`sh c.sh` has ended",
        "exit status 7",
        "no encoder",
        "by hand",
    ] {
        terminal.wait_until(words, |screen| flowing(screen).contains(words));
    }
    let screen = flowing(&terminal.screen());
    for words in ["cable", "lambda"] {
        assert!(!screen.contains(words), "{words}:\n{screen}");
    }
}

#[test]
fn info_shows_the_identity_of_a_program() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("c.sh");
    let hello = r#"{"say":"hello","format":"study-process/1","id":"rig-2","telemetry":true,"limits":{"force_n":9,"velocity_mm_s":500}}"#;
    fs::write(
        &script,
        format!("echo '{hello}'\nwhile read line; do :; done\n"),
    )
    .unwrap();
    let ask = ["device", "info", "--command", "sh c.sh"];
    let (_, out, err) = study(&ask, folder.path());
    let shown = out.contains("rig-2") && out.contains("at most 9 N");
    assert!(shown, "{out}{err}");
    let (_, out, _) = study(&[&ask[..], &["--json"]].concat(), folder.path());
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(json["device"]["id"], "rig-2");
    // device.toml can name it as well
    fs::write(
        folder.path().join("device.toml"),
        "[process]\ncommand = [\"sh\", \"c.sh\"]\n",
    )
    .unwrap();
    let (code, out, _) = study(&["device", "info"], folder.path());
    assert!(code == 0 && out.contains("rig-2"), "{out}");
    // its rendering is checked, and it answers nothing
    let check = ["device", "check", "--command", "sh c.sh"];
    let (code, out, err) = study(&check, folder.path());
    assert_eq!(code, 3, "{err}");
    assert!(
        err.contains("the program violates clause load"),
        "{out}{err}"
    );
    assert_eq!(out.matches("FAIL").count(), 1, "{out}");
    // a command that cannot use a program does not offer the option
    let record = ["record", "x.toml", "--command", "sh c.sh"];
    let (code, _, err) = study(&record, folder.path());
    assert_eq!(code, 2, "{err}");
    assert!(err.contains("unexpected argument '--command'"), "{err}");
}

/// Codes on samples do not identify a realization; a command lists them for labeling.
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

/// One physical sample among tables, with Esc during mounting.
#[test]
fn a_sample_among_tables_is_mounted_and_a_stopped_mounting_is_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let manual = "id = \"lambda-0.9995\"\ndevice = \"manual\"";
    let protocol = protocol(folder.path(), &[("id = \"lambda-0.9995\"", manual)]);
    let mut terminal = run(folder.path(), &protocol, &[]);
    play_until(&mut terminal, "P01", "Mount sample");
    terminal.keys("\u{1b}");
    terminal.wait_for("Operate the real switch");
    let seen = play_to_end(&mut terminal, "P01");
    let mounts = seen.iter().filter(|s| s.contains("Mount sample"));
    assert!(mounts.count() >= 1);
    let rows = ratings(&folder.path().join("results/turn-signal/ratings.csv"));
    assert_eq!(rows.len(), 5);
    let mounted = rows.iter().find(|r| r["model"] == "lambda-0.9995").unwrap();
    assert_eq!((&*mounted["status"], &*mounted["attempt"]), ("ok", "2"));
}

/// A device on a port and the program in a terminal.
struct Rig {
    folder: tempfile::TempDir,
    device: Simulator,
    terminal: Terminal,
}

impl Rig {
    fn start(faults: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let device = Simulator::start(folder.path(), faults);
        let protocol = protocol(folder.path(), &[("\"simulated\"", "\"serial\"")]);
        let port = device.port.to_str().unwrap().to_owned();
        let terminal = run(folder.path(), &protocol, &["--port", &port]);
        Self {
            folder,
            device,
            terminal,
        }
    }

    fn to(&mut self, text: &str) {
        play_until(&mut self.terminal, "P01", text);
    }

    /// Plays to the end: the rows, and the entries of the journal.
    fn finish(mut self) -> (Vec<Row>, Vec<serde_json::Value>) {
        play_to_end(&mut self.terminal, "P01");
        let of_results = |command| study(&[command, "results"], self.folder.path());
        let (code, out, err) = of_results("verify");
        assert_eq!(code, 0, "{out}{err}");
        let results = self.folder.path().join("results/turn-signal");
        let rows = ratings(&results.join("ratings.csv"));
        assert_eq!(rows.len(), 5);
        // a simulated device gives no real data
        for row in &rows {
            assert_eq!(felt(row), ["ok", "serial", "simulated-1", "true"]);
        }
        let journal = fs::read_to_string(results.join("sessions/P01/1/journal.jsonl")).unwrap();
        let events = journal
            .lines()
            .map(|line| serde_json::from_str(line).unwrap());
        let events: Vec<serde_json::Value> = events.collect();
        no_rating_without_a_playback(&events);
        let playbacks = events.iter().map(|entry| &event(entry)["playback"]);
        let [p99, most] = [0, 1].map(|i| {
            let late = playbacks
                .clone()
                .filter_map(|p| p["host_late_ms"][i].as_f64());
            late.fold(0.0, f64::max)
        });
        let said = format!("late by at most {most:.0} ms, 99 % within {p99:.0} ms");
        let (_, status, _) = of_results("status");
        assert!(status.contains(&said), "{said}: {status}");
        (rows, events)
    }
}

/// The event of an entry.
fn event(entry: &serde_json::Value) -> &serde_json::Value {
    if entry["event"].is_string() {
        entry
    } else {
        &entry["event"]
    }
}

fn no_rating_without_a_playback(entries: &[serde_json::Value]) {
    let mut ended = std::collections::BTreeSet::new();
    let mut answers = 0;
    for entry in entries {
        let event = event(entry);
        let attempt = |of: &serde_json::Value| (of["trial"].as_u64(), of["attempt"].as_u64());
        match event["event"].as_str() {
            Some("playback_ended") => {
                ended.insert(attempt(event));
            }
            Some("answered") => {
                let place = &event["place"]["trial"];
                if place.is_object() {
                    answers += 1;
                    assert!(ended.contains(&attempt(place)), "{entry}");
                }
            }
            _ => {}
        }
    }
    assert!(answers >= 5, "the journal's form has changed: {answers}");
}

#[test]
fn a_session_over_a_port_has_complete_telemetry() {
    let mut rig = Rig::start(&[]);
    rig.to("Enter: close");
    // the files are read before the rig deletes the folder
    let telemetry = "results/turn-signal/sessions/P01/1/telemetry";
    let files = fs::read_dir(rig.folder.path().join(telemetry)).unwrap();
    let text = files.map(|file| fs::read_to_string(file.unwrap().path()).unwrap());
    let rows: Vec<usize> = text.map(|text| text.lines().count() - 1).collect();
    assert_eq!(rows.len(), 5);
    let (_, events) = rig.finish();
    let ended = events.iter().map(event);
    let ended = ended.filter(|e| e["event"] == "playback_ended");
    let (mut samples, mut lost) = (0, 0);
    for event in ended {
        samples += event["playback"]["samples"].as_u64().unwrap();
        lost += event["playback"]["samples_lost"].as_u64().unwrap();
    }
    assert!(samples > 0);
    assert_eq!((samples as usize, lost), (rows.iter().sum(), 0));
}

/// The verdict of a commissioning in the same folder is recorded in the session.
#[test]
fn a_commissioning_is_recorded_in_the_session_and_a_broken_device_fails_it() {
    let mut rig = Rig::start(&[]);
    // only one program can open the port
    let port = rig.device.port.to_str().unwrap().to_owned();
    let check = [
        "device",
        "check",
        "--without-rendering",
        "--save",
        "--port",
        &port,
    ];
    let (code, _, err) = study(&check, rig.folder.path());
    assert_eq!(code, 3);
    assert!(err.contains("another program is using it"), "{err}");
    rig.to("Operate the real switch");
    drop(rig.terminal);
    // on a busy machine the check may miss a time limit
    let tries = (0..5).map(|_| study(&check, rig.folder.path()));
    let (_, out, _) = tries.into_iter().find(|(code, ..)| *code == 0).unwrap();
    assert!(out.contains("31 of 31 tests passed"), "{out}");
    let protocol = rig.folder.path().join("protocol");
    let mut terminal = run(rig.folder.path(), &protocol, &["--port", &port]);
    terminal.keys("\u{15}P02\r");
    terminal.wait_for("Operate the real switch");
    drop(terminal);
    let journal = "results/turn-signal/sessions/P02/1/journal.jsonl";
    let journal = fs::read_to_string(rig.folder.path().join(journal)).unwrap();
    assert!(journal.contains("\"device_check\":\""), "{journal}");
    assert!(
        journal.contains("31 of 31 tests passed; round trip"),
        "{journal}"
    );
    drop(rig.device);

    let folder = tempfile::tempdir().unwrap();
    let device = Simulator::start(folder.path(), &["--flaw", "takes-bad-tables"]);
    let port = device.port.to_str().unwrap();
    let check = ["device", "check", "--json", "--port", port];
    let mut tries = (0..5).map(|_| study(&check, folder.path()));
    let alone = |(_, _, err): &(i32, String, String)| {
        err.contains("it violates clauses 8.3, 8.7, 8.10 of docs/wire.md")
    };
    let (code, out, _) = tries.find(alone).expect("the planted defect alone");
    assert_eq!(code, 3, "{out}");
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(document["format"], "study-device-check/1");
    assert_eq!(document["pass"], false);
    assert_eq!(document["device"]["serial"], "simulated-1");
}

/// The cable is pulled before a trial, during playback, while a rating is entered and
/// between trials, and the device loses its power during playback.
#[test]
fn a_cable_that_is_pulled_in_each_state_costs_no_answer() {
    let mut rig = Rig::start(&[]);
    // before the first trial
    rig.to("Operate the real switch");
    rig.device.control("unplug");
    rig.terminal.wait_until("the cause of the trouble", |s| {
        s.contains("DEVICE TROUBLE") && s.contains("unplugged")
    });
    rig.device.control("plug");
    // while it plays
    rig.to("Feel the device");
    rig.device.control("unplug");
    rig.terminal.wait_for("DEVICE TROUBLE");
    rig.device.control("plug");
    // while the rating is typed: it is not disturbed
    rig.to("1–7: choose");
    rig.device.control("unplug");
    rig.terminal.keys("6");
    rig.terminal.wait_for("┃  6  ┃");
    enter(&mut rig.terminal);
    rig.terminal
        .wait_until("the rating to be taken", |s| !s.contains("1–7: choose"));
    // the next trial has to wait for the device
    rig.to("DEVICE TROUBLE");
    rig.device.control("plug");
    // power, while it plays
    rig.to("Feel the device");
    rig.device.control("reset");
    rig.terminal.wait_for("DEVICE TROUBLE");
    // the stop button of the device
    rig.to("Feel the device");
    rig.device.control("trip");
    rig.terminal.wait_for("DEVICE TROUBLE");
    let (rows, events) = rig.finish();
    assert!(rows.iter().any(|row| row["realism"] == "6"));
    let failed = events.iter().map(event);
    let failed = failed.filter(|e| e["event"] == "attempt_failed");
    assert!(failed.count() >= 3);
}

/// One frame in forty is corrupted, lost, duplicated, reordered or late, each way.
#[test]
fn a_bad_line_costs_telemetry_and_no_answer() {
    let faults = ["corrupt", "drop", "duplicate", "reorder", "delay"];
    let faults: Vec<String> = faults.iter().map(|f| format!("{f}=0.005")).collect();
    let faults: Vec<&str> = faults.iter().flat_map(|f| ["--fault", f]).collect();
    Rig::start(&faults).finish();
}

/// `study record` with a probe at a port gives a recording that can be identified.
#[test]
fn a_recording_over_a_port_can_be_identified() {
    let folder = tempfile::tempdir().unwrap();
    let device = Simulator::start(folder.path(), &[]);
    let port = device.port.to_str().unwrap();
    let trajectory = folder.path().join("short.toml");
    let text = "format = \"study-trajectory/1\"\noffset_mm = 17.5\nduration_s = 4.0\nramp_s = 1.0\n[[parts]]\nkind = \"sine\"\namplitude_mm = 14.0\nfrequency_hz = 0.7\n";
    fs::write(&trajectory, text).unwrap();
    // on a busy machine the probe may be too late
    let record = |arguments: &[&str]| {
        let mut tries = (0..20).map(|_| study(arguments, folder.path()));
        tries.find(|(code, ..)| *code == 0).expect("a recording")
    };
    let first = "record short.toml --device serial --out training.csv --port";
    let first: Vec<&str> = first.split(' ').chain([port]).collect();
    let (_, _, err) = record(&first);
    assert!(err.contains("wrote training.csv"), "{err}");
    let training = fs::read_to_string(folder.path().join("training.csv")).unwrap();
    let header = training.lines().next().unwrap();
    assert!(header.contains("simulated, not measured"), "{header}");
    // the command of the header can be run as it is written
    let (_, command) = header.split_once("; ").unwrap();
    let (command, _) = command.split_once(" (study ").unwrap();
    assert_eq!(
        command,
        format!(
            "study record short.toml --device serial --port {port} --rate 1000 --max-force 12 --filter 30"
        )
    );
    let words: Vec<&str> = command.split(' ').skip(1).collect();
    let (_, probe, _) = record(&words);
    assert_eq!(probe.lines().next().unwrap(), header);
    fs::write(folder.path().join("probe.csv"), probe).unwrap();
    let (code, _, err) = study(&["record", "short.toml", "--port", port], folder.path());
    assert_eq!(code, 2, "{err}");
    let identify = "identify training.csv --validate probe.csv --method ewls";
    let identify: Vec<&str> = identify.split(' ').collect();
    let (code, out, err) = study(&identify, folder.path());
    assert_eq!(code, 0, "{out}{err}");
}

#[test]
fn a_problem_with_a_port_is_reported_before_anything_is_created() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path(), &[("\"simulated\"", "\"serial\"")]);
    let path = protocol.to_str().unwrap();
    let (code, _, err) = study(&["run", path], folder.path());
    assert_eq!(code, 2);
    assert!(
        err.contains("needs a port") && err.contains("--port"),
        "{err}"
    );
    let (code, _, err) = study(&["run", path, "--port", "/dev/no-such-port"], folder.path());
    assert_eq!(code, 3);
    assert!(
        err.contains("/dev/no-such-port: there is no such port"),
        "{err}"
    );
    let file = folder.path().join("file");
    fs::write(&file, "x").unwrap();
    let (code, _, err) = study(
        &["run", path, "--port", file.to_str().unwrap()],
        folder.path(),
    );
    assert_eq!(code, 3);
    assert!(err.contains("it is not a serial port"), "{err}");
    assert_eq!(fs::read(&file).unwrap(), b"x");
    assert!(!folder.path().join("results").exists());
}
