//! Controller programs: the documented example, and programs that violate the
//! specification.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::print_stderr, reason = "what is skipped is told")]

use std::time::{Duration, Instant};
use study_base::limits::Limits;
use study_device::process::{Opened, Opening, ProcessDevice};
use study_device::{Device, DeviceError, Report, Stimulus};
use study_haptics::model::Realization;
use study_session::outcome::Sample;

/// Long, because the machine may be busy; the tests do not depend on it.
const PATIENCE: Duration = Duration::from_secs(30);

fn table() -> Realization {
    let path = crate::support::repository("protocols/turn-signal/models/lambda-0.9995.toml");
    let text = std::fs::read_to_string(path).unwrap();
    study_haptics::model::file::parse("model", &text).0.unwrap()
}

fn limits() -> Limits {
    serde_json::from_str(r#"{"force_n": 9.0, "velocity_mm_s": 1000.0}"#).unwrap()
}

fn example() -> Option<Vec<String>> {
    let found = std::process::Command::new("python3")
        .arg("--version")
        .output();
    if found.is_err() {
        eprintln!("SKIPPED: python3 is not on this machine, the example was not run");
        return None;
    }
    Some(vec![
        "python3".to_owned(),
        crate::support::repository("docs/process_device.py"),
    ])
}

/// A device and its time.
struct Bench {
    device: ProcessDevice,
    start: Instant,
    heard: Vec<Report>,
}

impl Bench {
    fn new(command: Vec<String>) -> Self {
        Self {
            device: ProcessDevice::open(command).unwrap(),
            start: Instant::now(),
            heard: Vec::new(),
        }
    }

    fn shell(script: &str) -> Self {
        Self::new(vec!["sh".to_owned(), "-c".to_owned(), script.to_owned()])
    }

    fn at(&self) -> Duration {
        self.start.elapsed()
    }

    fn load(&mut self) -> Result<(), DeviceError> {
        let at = self.at();
        let table = table();
        self.device.load(&Stimulus::of_table(&table), limits(), at)
    }

    /// Polls until a report satisfies the condition and returns it.
    fn until(&mut self, what: &str, fine: impl Fn(&Report) -> bool) -> Report {
        while self.at() < PATIENCE {
            let at = self.at();
            let reports = self.device.poll(at);
            let found = reports.iter().find(|r| fine(r)).cloned();
            self.heard.extend(reports);
            if let Some(found) = found {
                return found;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        panic!("no {what}; heard {:?}", self.heard);
    }

    fn lost(&mut self) -> String {
        match self.until("loss", |r| matches!(r, Report::Lost(_))) {
            Report::Lost(why) => why,
            _ => unreachable!(),
        }
    }
}

const HELLO: &str = r#"echo '{"say":"hello","format":"study-process/1","id":"sh","telemetry":true,"limits":{"force_n":5,"velocity_mm_s":100}}'; "#;

/// A program that waits for `load` before it does anything; `alive` may come first.
const UNTIL_LOAD: &str =
    r#"while read line; do case "$line" in *'"do":"load"'*) break;; esac; done; "#;

/// The samples of a session come from one device.
#[test]
fn another_device_does_not_go_on_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let begun = folder.path().join("begun");
    let other = HELLO.replace("\"sh\"", "\"other\"");
    let script = format!(
        "if [ -e '{0}' ]; then {other} else touch '{0}'; {HELLO} fi; {UNTIL_LOAD}",
        begun.display()
    );
    let mut bench = Bench::shell(&script);
    bench.load().unwrap();
    bench.lost();
    let ready_or_lost = |r: &Report| matches!(r, Report::Ready | Report::Lost(_));
    let Report::Lost(why) = bench.until("the restart", ready_or_lost) else {
        panic!("another device is ready");
    };
    assert!(why.contains("other"), "{why}");
}

/// Numbers of the study come with the outcome or by themselves; one that is late, or no number, is reported, and the
/// program goes on.
#[test]
fn numbers_of_the_study_are_reported_and_end_nothing() {
    let say = |message: &str| format!("echo '{{\"say\":{message}}}';");
    let playback = r#""duration_s":1,"strokes":0,"least_energy_j":0,"switches_per_s":0,"clamps":0"#;
    let script = [
        HELLO.to_owned(),
        "while read line; do case \"$line\" in ".to_owned(),
        format!("*'\"do\":\"load\"'*) {};", say(r#""loaded","load":1"#)),
        "*'\"do\":\"start\"'*) ".to_owned(),
        say(r#""started","load":1"#),
        say(r#""outcome","time_s":3.2"#),
        say(r#""outcome","load":1,"errors":NaN"#),
        say(&format!(r#""outcome","load":1,"errors":2,{playback}"#)),
        say(r#""outcome","load":1,"time_s":9"#),
        "; esac; done".to_owned(),
    ]
    .concat();
    let mut bench = Bench::shell(&script);
    bench.load().unwrap();
    bench.until("table", |r| *r == Report::Loaded);
    let at = bench.at();
    bench.device.start(at).unwrap();
    bench.until("the late number", |r| {
        matches!(r, Report::Numbers { outside: true, .. })
    });
    let numbers: Vec<(String, Option<f64>, bool)> = (bench.heard.iter())
        .filter_map(|report| match report {
            Report::Numbers { numbers, outside } => {
                let [number] = &numbers[..] else {
                    panic!("{numbers:?}")
                };
                Some((number.key.clone(), number.value, *outside))
            }
            _ => None,
        })
        .collect();
    let expected = [
        ("time_s", Some(3.2), false),
        ("errors", None, false),
        ("errors", Some(2.0), false),
        ("time_s", Some(9.0), true),
    ];
    let expected = expected.map(|(key, value, outside)| (key.to_owned(), value, outside));
    assert_eq!(numbers, expected);
    let ended = |r: &Report| matches!(r, Report::Stopped(_));
    assert_eq!(bench.heard.iter().filter(|r| ended(r)).count(), 1);
    let lost = |r: &Report| matches!(r, Report::Lost(_) | Report::Fault(_));
    assert!(!bench.heard.iter().any(lost), "{:?}", bench.heard);
}

#[test]
fn the_documented_example_plays() {
    let Some(command) = example() else { return };
    let mut bench = Bench::new(command);
    assert_eq!(bench.device.identity().id, "example-1");
    assert!(bench.device.identity().simulated);
    for _ in 0..2 {
        bench.heard.clear();
        bench.load().unwrap();
        bench.until("table", |r| *r == Report::Loaded);
        let at = bench.at();
        bench.device.start(at).unwrap();
        bench.until("start", |r| *r == Report::Started);
        bench.until("stroke", |r| {
            matches!(r, Report::Progress { strokes: 1.., .. })
        });
        let at = bench.at();
        bench.device.stop(at).unwrap();
        let end = bench.until("stop", |r| matches!(r, Report::Stopped(_)));
        let Report::Stopped(playback) = end else {
            unreachable!()
        };
        let samples: Vec<Sample> = bench
            .heard
            .iter()
            .filter_map(|r| match r {
                Report::Telemetry(samples) => Some(samples.clone()),
                _ => None,
            })
            .flatten()
            .collect();
        assert_eq!(playback.samples, samples.len() as u64);
        assert!(playback.exploration_s >= 0.5, "{playback:?}");
        assert!(samples.iter().all(|s| s.force_command_n.abs() <= 9.0));
        assert!(samples.iter().any(|s| s.force_command_n.abs() > 1.0));
    }
    // LIMP cancels a load
    bench.load().unwrap();
    let at = bench.at();
    bench.device.limp(at);
    bench.heard.clear();
    bench.load().unwrap();
    bench.until("table", |r| *r == Report::Loaded);
    let loads = bench.heard.iter().filter(|r| **r == Report::Loaded);
    assert_eq!(loads.count(), 1, "{:?}", bench.heard);
}

/// A stopped host does not close the program's input: the program goes limp by itself.
#[test]
fn the_documented_example_is_limp_without_alive() {
    let Some(command) = example() else { return };
    let mut bench = Bench::new(command);
    bench.load().unwrap();
    bench.until("table", |r| *r == Report::Loaded);
    // without a playback no `alive` is needed
    std::thread::sleep(Duration::from_millis(700));
    let at = bench.at();
    bench.device.start(at).unwrap();
    bench.until("start", |r| *r == Report::Started);
    std::thread::sleep(Duration::from_millis(900));
    let fault = bench.until("fault", |r| matches!(r, Report::Fault(_)));
    assert_eq!(fault, Report::Fault("no alive".to_owned()));
}

#[test]
fn the_example_refuses_a_load_without_a_table() {
    let Some(command) = example() else { return };
    let mut bench = Bench::new(command);
    let at = bench.at();
    let what = Stimulus {
        model: "the-real-switch",
        table: None,
        code: "",
        by_hand: false,
        allow_uncertified: false,
    };
    bench.device.load(&what, limits(), at).unwrap();
    let fault = bench.until("refusal", |r| matches!(r, Report::Fault(_)));
    assert_eq!(
        fault,
        Report::Fault("the device refuses the table: no table".to_owned())
    );
    bench.load().unwrap();
    bench.until("table", |r| *r == Report::Loaded);
}

#[test]
fn a_program_that_violates_the_specification_is_lost_and_restarted() {
    for (script, why) in [
        ("echo rubbish; sleep 60", "its line 2 is invalid: "),
        (
            "echo '{\"say\":\"started\",\"load\":1}'; sleep 60",
            "it sends `started` while it is loading",
        ),
        (
            "echo '{\"say\":\"loaded\",\"load\":1'; sleep 60",
            "its line 2 is invalid: EOF",
        ),
        (
            "echo ready >&2; printf 'motor on \\033[31mfire\n\n' >&2; exit 3",
            " has ended with exit status 3; its last error message: motor on \\u{1b}[31mfire",
        ),
        ("kill -9 $$", " has ended by signal: 9 (SIGKILL)"),
        ("exec >&-; sleep 60", " has closed its standard streams"),
        ("head -c 400000 /dev/zero; sleep 60", "longer than 262144"),
    ] {
        let mut bench = Bench::shell(&format!("{HELLO} {UNTIL_LOAD} {script}"));
        bench.load().unwrap();
        let lost = bench.lost();
        assert!(lost.contains(why), "{script}: {lost}");
        assert!(bench.load().is_err(), "nobody is there");
        bench.until("return", |r| *r == Report::Ready);
        assert!(bench.load().is_ok());
    }
}

#[test]
fn a_program_that_does_not_read_is_lost_without_blocking_the_host() {
    let mut bench = Bench::shell(&format!("{HELLO} sleep 60"));
    for _ in 0..2000 {
        let at = bench.at();
        bench.device.limp(at);
        if bench.load().is_err() {
            break;
        }
    }
    let lost = bench.lost();
    assert!(lost.contains("does not read"), "{lost}");
}

#[test]
fn a_program_that_is_not_a_controller_is_refused_before_the_session() {
    let refusal = |script: &str| {
        let command = ["sh", "-c", script].map(str::to_owned).to_vec();
        ProcessDevice::open(command).unwrap_err().to_string()
    };
    let ended = refusal("echo no encoder >&2; exit 4");
    assert!(
        ended.ends_with("` has ended with exit status 4; its last error message: no encoder"),
        "{ended}"
    );
    assert!(refusal("echo '{\"say\":\"loaded\",\"load\":1}'; sleep 60").contains("before `hello`"));
    let other = HELLO.replace("process/1", "process/7");
    assert!(refusal(&format!("{other} sleep 60")).contains("uses the format `study-process/7`"));
    let missing = ProcessDevice::open(vec!["/no/such/program".to_owned()]);
    assert!(
        missing
            .unwrap_err()
            .to_string()
            .contains("`/no/such/program` cannot be started: there is no such program"),
    );
}

/// A program that cannot be restarted. The reason may differ from that of the loss.
#[test]
fn why_a_program_cannot_be_restarted_is_reported_once() {
    let folder = tempfile::tempdir().unwrap();
    let flag = folder.path().join("flag");
    let script = format!(
        "test -e {flag} && echo no port >&2 && exit 2; touch {flag}; {HELLO} {UNTIL_LOAD} exit 1",
        flag = flag.display()
    );
    let mut bench = Bench::shell(&script);
    bench.load().unwrap();
    assert!(bench.lost().contains("exit status 1"));
    let again = bench.lost();
    assert!(
        again.contains("exit status 2; its last error message: no port"),
        "{again}"
    );
    let until = bench.at() + Duration::from_millis(2500);
    while bench.at() < until {
        let at = bench.at();
        assert_eq!(bench.device.poll(at), []);
        std::thread::sleep(Duration::from_millis(5));
    }
    std::fs::remove_file(flag).unwrap();
    bench.until("return", |r| *r == Report::Ready);
}

#[test]
fn waiting_for_a_hello_can_be_interrupted() {
    let command = ["sh", "-c", &format!("read go; {HELLO} sleep 60")].map(str::to_owned);
    let mut command = command.to_vec();
    // it waits for a line that is never sent
    let opening = Opening::begin(command.clone()).unwrap();
    let waited = opening.hello(Duration::from_millis(50)).unwrap();
    assert!(matches!(waited, Opened::NotYet(_)), "{waited:?}");
    command[2] = command[2].replace("read go", "sleep 0.2");
    let mut opening = Opening::begin(command).unwrap();
    let mut turns = 0;
    let device = loop {
        turns += 1;
        opening = match opening.hello(Duration::from_millis(10)).unwrap() {
            Opened::Device(device) => break device,
            Opened::NotYet(opening) => opening,
        };
    };
    assert!(turns > 1, "it was waited for in one go");
    assert_eq!(device.identity().id, "sh");
}

#[test]
fn a_program_ends_with_its_host() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ended");
    let script = format!(
        "{HELLO} while read line; do :; done; touch {}",
        path.display()
    );
    drop(Bench::shell(&script));
    let start = Instant::now();
    while !path.exists() {
        assert!(start.elapsed() < PATIENCE, "the child outlives its host");
        std::thread::sleep(Duration::from_millis(2));
    }
}
