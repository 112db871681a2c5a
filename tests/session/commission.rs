//! `study device commission` on a device at a pseudo-terminal and on a program. The test plays the
//! person: it pulls at the simulated handle, and knows where the handle really is.
//!
//! Each question and each wrong device is tested in virtual time, beside the dialog.

use crate::support::simulator::Simulator;
use crate::support::{PATIENCE, Terminal, changed_protocol};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Time in which the handle reaches a place or rests, also on a busy machine.
const ON_THE_WAY: Duration = Duration::from_secs(3);

/// What is typed after a line that was said; `None` if it asks for nothing.
type Person<'p> = &'p mut dyn FnMut(&str) -> Option<String>;

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_study"))
        .args(["device", "commission", "--operator", "LW"])
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// The dialog, with `ahead` typed before it begins; exit code, everything that was said, the
/// record, and the page.
fn dialog(
    folder: &Path,
    arguments: &[&str],
    ahead: &str,
    person: Person<'_>,
) -> (i32, String, serde_json::Value, String) {
    let mut child = start(folder, arguments);
    let mut answers = child.stdin.take().unwrap();
    answers.write_all(ahead.as_bytes()).unwrap();
    let mut said = String::new();
    for line in BufReader::new(child.stdout.take().unwrap()).lines() {
        let line = line.unwrap();
        said.push_str(&line);
        said.push('\n');
        if let Some(answer) = person(&line) {
            // What was ended early reads no more.
            let _ = writeln!(answers, "{answer}");
        }
    }
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    let code = child.wait().unwrap().code().unwrap_or(-1);
    let (mut record, mut page) = (serde_json::Value::Null, String::new());
    for item in std::fs::read_dir(folder.join("results/devices"))
        .into_iter()
        .flatten()
    {
        for item in std::fs::read_dir(item.unwrap().path()).unwrap() {
            let path = item.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap();
            match path.extension().and_then(|e| e.to_str()) {
                Some("json") => record = serde_json::from_str(&text).unwrap(),
                _ => page = text,
            }
        }
    }
    (code, said, record, page)
}

/// Somebody at a simulated device who does everything.
fn willing(device: &mut Simulator, line: &str) -> Option<String> {
    let mut place = |x_mm: &str| {
        device.control(&format!("hold {x_mm}"));
        std::thread::sleep(ON_THE_WAY);
        Some(x_mm.to_owned())
    };
    if line.contains("a first place") {
        place("0")
    } else if line.contains("a second place") {
        place("20")
    } else if line.contains("Which force moves it") {
        Some("0,05".to_owned())
    } else if line.contains("type `on`") {
        device.control("free");
        Some("on".to_owned())
    } else if line.contains("What do you weigh with") {
        Some("gauge 0.02 N".to_owned())
    } else if line.contains("press the emergency switch") {
        device.control("trip");
        std::thread::sleep(Duration::from_millis(500));
        Some("yes".to_owned())
    } else if line.contains("release the switch") {
        Some("released".to_owned())
    } else if line.contains("still without force") {
        Some("yes".to_owned())
    } else if line.contains("Pull slowly") {
        let (_, rest) = line.split_once("towards ").unwrap();
        let sign = if rest.starts_with("+x") { "" } else { "-" };
        let force = rest.split_once("with about ").unwrap().1;
        let force_n = force.split(' ').next().unwrap();
        device.control(&format!("pull {sign}{force_n}"));
        std::thread::sleep(ON_THE_WAY);
        Some(format!("{force_n} N"))
    } else if line.contains("type `off`") {
        device.control("pull 0");
        std::thread::sleep(Duration::from_secs(1));
        Some("off".to_owned())
    } else if line.contains("`go`") {
        Some("go".to_owned())
    } else {
        None
    }
}

fn step<'r>(record: &'r serde_json::Value, what: &str) -> &'r serde_json::Value {
    let parts = record["parts"]["steps"].as_array().unwrap();
    parts.iter().find(|part| part["what"] == what).unwrap()
}

/// A session of a protocol with `self_weigh` up to its first page, or to its refusal. Somebody types `go`
/// for the swings whenever it is asked for.
fn run_weighed(folder: &Path, port: &str, more: &[&str]) -> Terminal {
    let arguments = ["run", "protocol", "--port", port, "--operator", "lw"];
    let mut terminal = Terminal::start(&[&arguments, more].concat(), folder, 40, 120);
    let begun = std::time::Instant::now();
    while terminal.runs() && !terminal.screen().contains("Who takes part?") {
        let screen = terminal.screen();
        let last = screen.lines().rev().find(|line| !line.trim().is_empty());
        if last.is_some_and(|line| line.starts_with("Type `go` to begin")) {
            terminal.keys("go\r");
        }
        assert!(begun.elapsed() < PATIENCE, "{screen}");
        // what was typed is echoed meanwhile
        std::thread::sleep(Duration::from_millis(500));
    }
    terminal
}

/// What the journal of a participant's session tells of the motor.
fn told(folder: &Path, terminal: &mut Terminal, participant: &str) -> serde_json::Value {
    terminal.keys(&format!("{participant}\r"));
    let of = format!("results/turn-signal/sessions/{participant}/1/journal.jsonl");
    let text = || std::fs::read_to_string(folder.join(&of)).unwrap_or_default();
    let whole = |text: &str| {
        let mut lines = text
            .split_inclusive('\n')
            .filter(|line| line.ends_with('\n'));
        lines.find_map(|line| {
            let event: serde_json::Value = serde_json::from_str(line).unwrap();
            (event["event"] == "self_weighed").then_some(event)
        })
    };
    terminal.wait_until("the journal", |_| whole(&text()).is_some());
    whole(&text()).unwrap()
}

/// The motor weighs itself on the free handle before a session, which records it. One that has become
/// weak since its commissioning is refused in words, and the record of the device says so.
fn weighs_itself(folder: &Path, mut device: Simulator) {
    let changes = [
        ("study-protocol/1", "study-protocol/3"),
        ("\"simulated\"", "\"serial\""),
        ("[device]\n", "[device]\nself_weigh = true\n"),
    ];
    changed_protocol("turn-signal", &folder.join("protocol"), &changes);
    let port = device.port.to_str().unwrap().to_owned();
    device.control("free");
    let mut terminal = run_weighed(folder, &port, &[]);
    let weighed = told(folder, &mut terminal, "P01");
    assert_eq!(weighed["ok"], true, "{weighed}");
    let gain = weighed["gain"].as_f64().unwrap();
    assert!((gain - 1.0).abs() < 0.03, "{weighed}");
    let lag_ms = weighed["lag_ms"].as_f64().unwrap();
    assert!(lag_ms.abs() < 3.0, "{weighed}");
    let commissioning = weighed["commissioning"].as_str().unwrap();
    assert!(commissioning.ends_with("-commission"), "{weighed}");
    drop(terminal);
    drop(device);

    let mut weak = Simulator::start(folder, &["--wrong", "weak-motor"]);
    weak.control("free");
    let mut terminal = run_weighed(folder, &port, &[]);
    assert_eq!(terminal.exit_code(), 3, "{}", terminal.screen());
    let screen = terminal.screen();
    let words = "% of the force of its commissioning";
    assert!(screen.contains(words), "{screen}");
    assert!(screen.contains("study device commission"), "{screen}");
    let records = folder.join("results/devices/simulated-1");
    let mut passes: Vec<(String, bool)> = (std::fs::read_dir(records).unwrap())
        .map(|item| item.unwrap().path())
        .filter(|path| path.to_str().unwrap().ends_with("-self-weighing.json"))
        .map(|path| {
            let text = std::fs::read_to_string(&path).unwrap();
            let record: serde_json::Value = serde_json::from_str(&text).unwrap();
            let pass = record["pass"].as_bool().unwrap();
            assert_eq!(record["kind"], "self-weighing");
            assert_eq!(record["parts"]["ok"], pass, "{record}");
            (record["id"].as_str().unwrap().to_owned(), pass)
        })
        .collect();
    passes.sort();
    let passes: Vec<bool> = passes.iter().map(|(_, pass)| *pass).collect();
    assert_eq!(passes, [true, false]);
    let sessions = folder.join("results/turn-signal/sessions");
    assert_eq!(std::fs::read_dir(sessions).unwrap().count(), 1);

    let mut terminal = run_weighed(folder, &port, &["--unchecked"]);
    let weighed = told(folder, &mut terminal, "P02");
    assert_eq!(weighed["ok"], false, "{weighed}");
    let gain = weighed["gain"].as_f64().unwrap();
    assert!((gain - 0.5).abs() < 0.03, "{weighed}");
    assert!(weighed["why"].as_str().unwrap().contains(words));
}

/// Also: a pipe full of answers that were typed before the first question changes nothing, and the
/// free handle has been at no stop.
#[test]
fn the_right_device_passes_and_is_marked_as_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let mut device = Simulator::start(folder.path(), &[]);
    device.control("free");
    let port = device.port.to_str().unwrap().to_owned();
    let arguments = ["--force", "4", "--port", &port];
    let ahead = "go\n".repeat(40);
    let (code, said, record, page) = dialog(folder.path(), &arguments, &ahead, &mut |line| {
        willing(&mut device, line)
    });
    assert_eq!(code, 0, "{said}\n{record:#}");
    assert_eq!(
        (&record["pass"], &record["simulated"], &record["kind"]),
        (&true.into(), &true.into(), &"commission".into())
    );
    let numbers = &record["parts"]["numbers"];
    assert_eq!(numbers["version"], "study-commissioning/2");
    assert_eq!(numbers["weighings"].as_array().unwrap().len(), 6);
    for direction in numbers["directions"].as_array().unwrap() {
        let gain = direction["gain"].as_f64().unwrap();
        assert!((gain - 1.0).abs() < 0.05, "{direction}");
    }
    assert_eq!(numbers["emergency_stop"]["limp_before_release"], true);
    assert_eq!(step(&record, "unpowered friction")["seen"], "0.05 N");
    for text in ["SIMULATED", "All steps passed", "by LW", "emergency stop"] {
        assert!(page.contains(text), "{text}: {page}");
    }
    let place = device.ask("where");
    assert!(
        place.contains(" 0 stops") && place.ends_with("0.000 N"),
        "{place}"
    );
    weighs_itself(folder.path(), device);
}

/// A motor that is weak in one direction, and a ruler that shows another scale.
#[test]
fn a_wrong_device_fails_with_its_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let mut device = Simulator::start(folder.path(), &["--wrong", "weak-motor-backwards"]);
    device.control("free");
    let port = device.port.to_str().unwrap().to_owned();
    let arguments = ["--force", "4", "--port", &port];
    let (code, said, record, page) = dialog(folder.path(), &arguments, "", &mut |line| {
        willing(&mut device, line)
    });
    assert_eq!(code, 3, "{said}\n{record:#}");
    assert_eq!(step(&record, "force towards −x")["outcome"], "passed");
    let weak = step(&record, "force towards +x");
    assert_eq!(weak["outcome"], "failed", "{weak}");
    assert!(
        weak["seen"].as_str().unwrap().contains("gain 0.5"),
        "{weak}"
    );
    assert!(page.contains("FAILED"));
}

/// What ends the program while the motor holds a pull.
fn ended(how: impl FnOnce(&mut Child)) {
    let folder = tempfile::tempdir().unwrap();
    let mut device = Simulator::start(folder.path(), &[]);
    device.control("free");
    let port = device.port.to_str().unwrap().to_owned();
    let mut child = start(folder.path(), &["--force", "4", "--port", &port]);
    let mut answers = child.stdin.take().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    for line in lines.by_ref() {
        let line = line.unwrap();
        if line.contains("Pull slowly") {
            break;
        }
        if let Some(answer) = willing(&mut device, &line) {
            writeln!(answers, "{answer}").unwrap();
        }
    }
    device.control("pull 0.5");
    std::thread::sleep(ON_THE_WAY);
    let place = device.ask("where");
    assert!(!place.ends_with(" 0.000 N"), "it holds: {place}");
    device.control("pull 0");
    child.stdin = Some(answers);
    how(&mut child);
    let code = child.wait().unwrap().code();
    let place = device.ask("where");
    assert!(place.ends_with(" 0.000 N"), "{place}");
    assert_ne!(code, Some(0));
    let record = folder.path().join("results/devices/simulated-1");
    let saved = std::fs::read_dir(record).unwrap().count();
    assert_eq!(saved, 2, "what was found is kept");
}

#[test]
fn a_closed_terminal_and_ctrl_c_leave_the_device_limp() {
    ended(|child| drop(child.stdin.take()));
    #[cfg(unix)]
    ended(|child| {
        let pid = child.id().to_string();
        let sent = Command::new("kill").args(["-INT", &pid]).status();
        assert!(sent.unwrap().success());
    });
}

/// A program with a handle at the place that stands in a file, whose motor is right.
const PROGRAM: &str = r#"
import json, os, sys
def say(**m): print(json.dumps(m), flush=True)
say(say="hello", format="study-process/1", id="rig-9", telemetry=True, limits={"force_n": 10, "velocity_mm_s": 800})
table, playing, t, load = None, False, 0.0, 0
def place(): return float(open("place").read())
def force(x):
    xs, fs = table["x_mm"], table["positive"]["f0_n"]
    if x <= xs[0]: return fs[0]
    for a, b, fa, fb in zip(xs, xs[1:], fs, fs[1:]):
        if x <= b: return fa + (fb - fa) * (x - a) / (b - a)
    return fs[-1]
for line in sys.stdin:
    m = json.loads(line)
    do = m["do"]
    if do == "load":
        table, load, playing = m["table"], m["load"], False
        say(say="loaded", load=load)
    elif do == "start":
        playing, t = True, 0.0
        say(say="started", load=load)
    elif do == "limp":
        playing = False
    elif do == "stop":
        playing = False
        say(say="stopped", load=load, duration_s=t, strokes=0, least_energy_j=0, switches_per_s=0, clamps=0)
    elif do == "alive" and playing:
        x = place()
        samples = [[t + 0.001 * i, x, 0.0, force(x), None] for i in range(20)]
        t += 0.02
        say(say="samples", load=load, samples=samples)
    open("force.new", "w").write(str(force(place()) if playing else 0.0))
    os.replace("force.new", "force")
"#;

#[test]
fn a_program_is_commissioned_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("rig.py"), PROGRAM).unwrap();
    // the program reads it at any time
    let place = |x_mm: f64| {
        std::fs::write(at("place.new"), x_mm.to_string()).unwrap();
        std::fs::rename(at("place.new"), at("place")).unwrap();
    };
    place(20.0);
    let mut person = |line: &str| {
        let answer = |text: &str| Some(text.to_owned());
        if line.contains("to one stop") {
            place(-10.0);
        } else if line.contains("to the other stop") {
            place(50.0);
        } else if line.contains("a first place") {
            place(0.0);
            return answer("0");
        } else if line.contains("a second place") {
            place(40.0);
            return answer("40");
        } else if line.contains("Which force moves it") {
            place(20.0);
            return answer("0.1");
        } else if line.contains("type `on`") {
            return answer("on");
        } else if line.contains("What do you weigh with") {
            return answer("scale 1 %");
        } else if line.contains("press the emergency switch") {
            // this program has no way to notice the switch
            return answer("yes");
        } else if line.contains("release the switch") {
            return answer("released");
        } else if line.contains("still without force") {
            return answer("yes");
        } else if line.contains("Pull slowly") {
            // It holds like a spring: the scale shows its force at the place where it is.
            let sign = if line.contains("towards +x") {
                1.0
            } else {
                -1.0
            };
            place(20.0 + sign * 6.0);
            std::thread::sleep(Duration::from_millis(300));
            let force = std::fs::read_to_string(at("force")).unwrap();
            let force_n: f64 = force.parse::<f64>().unwrap().abs();
            return Some(format!("{force_n:.3} N"));
        } else if line.contains("type `off`") {
            place(20.0);
            return answer("off");
        }
        line.contains("`go`").then(|| "go".to_owned())
    };
    let arguments = ["--command", "python3 rig.py"];
    let (code, said, record, _) = dialog(folder.path(), &arguments, "", &mut person);
    assert_eq!(code, 3, "{said}");
    assert_eq!(record["serial"], "rig-9");
    assert_eq!(
        step(&record, "stroke")["seen"],
        "-10.00 to 50.00 mm, by hand"
    );
    assert_eq!(step(&record, "ruler")["outcome"], "passed");
    let stop = step(&record, "emergency stop");
    assert_eq!(stop["outcome"], "failed", "{stop}");
    assert!(
        stop["seen"].as_str().unwrap().contains("did NOT notice"),
        "{stop}"
    );
    // the lowest force was weighed in both directions, the higher ones were not begun
    let weighings = record["parts"]["numbers"]["weighings"].as_array().unwrap();
    assert_eq!(weighings.len(), 2, "{said}");
    for weighing in weighings {
        let ratio =
            weighing["measured_n"].as_f64().unwrap() / weighing["commanded_n"].as_f64().unwrap();
        assert!((ratio - 1.0).abs() < 0.02, "{weighing}");
    }
    assert_eq!(step(&record, "force towards −x")["outcome"], "not-done");
    let left = || std::fs::read_to_string(at("force")).unwrap().parse::<f64>();
    let is_limp = || left().is_ok_and(|force_n| force_n == 0.0);
    let limp = (0..500).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        is_limp()
    });
    assert!(limp, "{:?}", left());
}
