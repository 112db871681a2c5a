//! Commissioning in virtual time: the simulated device passes, and with a planted defect
//! the violated clause is named.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::time::Duration;
use study_device::check::{Commissioning, Connection, Progress, Verdict, commission};
use study_device::firmware::{Firmware, Flaw, Options};
use study_device::link::LinkError;
use study_device::link::memory::{Line, Noise};
use study_wire::frame::{Decoder, Frame};
use study_wire::message::kind;

/// A simulated device on a line with a latency of half a millisecond.
struct Bench {
    firmware: Firmware,
    there: Line,
    back: Line,
    now: Duration,
    /// Changes the body of each message of the device.
    change: Box<Change>,
}

/// Changes a body.
type Change = dyn FnMut(&mut Vec<u8>);

const TICK: Duration = Duration::from_micros(250);

impl Bench {
    fn new(options: Options) -> Self {
        let line = |name| Line::new(2 * TICK, Noise::default(), 1, name);
        Self {
            firmware: Firmware::new(options),
            there: line("there"),
            back: line("back"),
            now: Duration::from_secs(1),
            change: Box::new(|_| ()),
        }
    }
}

/// The frames with changed bodies.
fn changed(bytes: &[u8], change: &mut Change) -> Vec<u8> {
    let mut decoder = Decoder::new();
    let mut sent = Vec::new();
    for byte in bytes {
        if let Some(Ok(body)) = decoder.push(*byte) {
            let mut body = body.to_vec();
            change(&mut body);
            sent.extend_from_slice(Frame::of(&body).unwrap().as_bytes());
        }
    }
    sent
}

impl Connection for Bench {
    fn now(&mut self) -> Duration {
        self.now
    }

    fn exchange(&mut self, bytes: &[u8], wait: Duration) -> Result<Vec<u8>, LinkError> {
        self.there.send(bytes.to_vec(), self.now);
        let until = self.now + wait;
        while self.now < until {
            self.now = (self.now + TICK).min(until);
            let came = self.there.arrived(self.now);
            self.firmware.receive(&came, self.now);
            let sent = changed(&self.firmware.take_output(), &mut self.change);
            self.back.send(sent, self.now);
            let came = self.back.arrived(self.now);
            if !came.is_empty() {
                return Ok(came);
            }
        }
        Ok(Vec::new())
    }
}

fn check(options: Options) -> (Commissioning, Duration) {
    check_changed(options, |_| ())
}

fn check_changed(
    options: Options,
    change: impl FnMut(&mut Vec<u8>) + 'static,
) -> (Commissioning, Duration) {
    let mut bench = Bench::new(options);
    bench.change = Box::new(change);
    let found = commission(&mut bench, 7, &mut |_| {});
    assert_eq!(bench.firmware.held_n(), 0.0, "it was left with force");
    (found, bench.now - Duration::from_secs(1))
}

#[test]
fn the_simulated_device_passes_in_time() {
    for watchdog_ms in [30, 200] {
        let (found, took) = check(Options {
            watchdog_ms,
            ..Options::default()
        });
        let broken: Vec<_> = found.verdicts.iter().filter(|v| !v.pass).collect();
        assert!(broken.is_empty(), "{broken:#?}");
        assert!(found.verdicts.len() >= 25);
        assert!(found.passes());
        assert!(took < Duration::from_secs(30), "{took:?}");
        let [median, _, most] = found.latency_ms.unwrap();
        assert!(
            (0.9..2.1).contains(&median) && most < 3.0,
            "{median} {most}"
        );
        assert!(
            found
                .summary()
                .starts_with("31 of 31 tests passed; round trip"),
            "{}",
            found.summary()
        );
    }
}

#[test]
fn each_planted_defect_is_named_by_its_clause() {
    for (flaw, name, clause) in Flaw::ALL {
        let (found, _) = check(Options {
            flaw: Some(flaw),
            ..Options::default()
        });
        let broken: Vec<&str> = found
            .verdicts
            .iter()
            .filter(|v| !v.pass)
            .map(|v| v.clause)
            .collect();
        // a device with another version is rejected at HELLO
        let expected = if flaw == Flaw::OtherVersion {
            "14.3"
        } else {
            clause
        };
        assert!(broken.contains(&expected), "{name} ({clause}): {broken:?}");
        assert!(!found.passes());
    }
}

/// Writes a number into a body, behind the header.
fn write(body: &mut [u8], offset: usize, value: f64) {
    body[4 + offset..4 + offset + 8].copy_from_slice(&value.to_le_bytes());
}

/// A device that answers wrongly is not one that does not answer.
#[test]
fn causes_are_named() {
    type Wrong = fn(&mut Vec<u8>);
    let cases: [(&str, &str, Wrong); 10] = [
        (
            "14.3",
            "IDENTITY is malformed: its servo rate is not a number",
            |body| {
                if body[1] == kind::IDENTITY {
                    write(body, 25, f64::NAN);
                }
            },
        ),
        (
            "14.3",
            "IDENTITY is malformed: its force limit is infinite",
            |body| {
                if body[1] == kind::IDENTITY {
                    write(body, 41, f64::INFINITY);
                }
            },
        ),
        ("14.3", "IDENTITY has the sequence number", |body| {
            if body[1] == kind::IDENTITY {
                body[2] ^= 0x20;
            }
        }),
        ("14.3", "IDENTITY is malformed: it has", |body| {
            if body[1] == kind::IDENTITY {
                body.pop();
            }
        }),
        ("14.3", "its force limit is 1e300 N", |body| {
            if body[1] == kind::IDENTITY {
                write(body, 41, 1e300);
            }
        }),
        ("14.3", "its serial number is empty", |body| {
            if body[1] == kind::IDENTITY {
                body[4 + 121..4 + 153].fill(0);
            }
        }),
        (
            "11.1",
            "OUTCOME is malformed: its energy is not a number",
            |body| {
                if body[1] == kind::OUTCOME {
                    write(body, 43, f64::NAN);
                }
            },
        ),
        ("7.7", "its slew limit is 20 N/s", |body| {
            if body[1] == kind::IDENTITY && body.len() > 200 {
                write(body, 216, 20.0);
            }
        }),
        ("7.7", "its added damping is -0.02 N·s/mm", |body| {
            if body[1] == kind::IDENTITY && body.len() > 200 {
                write(body, 176, -0.02);
            }
        }),
        ("7.7", "its ramp is 3 s", |body| {
            if body[1] == kind::IDENTITY && body.len() > 200 {
                write(body, 224, 3.0);
            }
        }),
    ];
    for (clause, cause, change) in cases {
        let (found, _) = check_changed(Options::default(), change);
        let broken: Vec<_> = found.verdicts.iter().filter(|v| !v.pass).collect();
        let named = |v: &&&Verdict| v.clause == clause && v.seen.contains(cause);
        assert!(broken.iter().any(|v| named(&v)), "{cause}: {broken:#?}");
        assert!(
            broken.iter().all(|v| !v.seen.contains("no answer")),
            "{cause}: {broken:#?}"
        );
        assert!(broken.iter().all(|v| v.judged), "{cause}: {broken:#?}");
    }
}

/// A REARM right after a LIMP, refused with `moving` (13), is executed: idle (1).
#[test]
fn a_device_that_is_armed_while_its_handle_moves_is_found() {
    let mut after_limp = false;
    let (found, _) = check_changed(Options::default(), move |body| match (body[1], body[4]) {
        (kind::ACK, kind::LIMP) => after_limp = true,
        (kind::ACK, kind::REARM) if after_limp && body[5] == 13 => (body[5], body[6]) = (0, 1),
        (kind::IDENTITY, _) => after_limp = false,
        _ => {}
    });
    assert_eq!(found.failed_clauses(), ["5.3"]);
    let seen = |v: &Verdict| v.seen.contains("it is armed again at");
    assert!(found.verdicts.iter().any(seen), "{found:#?}");
}

/// 20 ms are less than a third of a watchdog time of 200 ms.
#[test]
fn replies_that_leave_late_are_found_with_any_watchdog_time() {
    let (found, _) = check(Options {
        watchdog_ms: 200,
        flaw: Some(Flaw::LateReplies),
        ..Options::default()
    });
    assert!(found.failed_clauses().contains(&"11.1"), "{found:#?}");
}

/// Nobody moves the handle: nothing is said of the clause that needs it.
#[test]
fn a_clause_that_needs_a_motion_is_open_without_one() {
    let mut bench = Bench::new(Options::default());
    bench.firmware.hold_at(17.5);
    let mut asked = Vec::new();
    let found = commission(&mut bench, 7, &mut |progress| {
        if let Progress::Ask(what) = progress {
            asked.push(what.to_owned());
        }
    });
    assert_eq!(found.failed_clauses(), Vec::<&str>::new());
    assert_eq!(found.unjudged_clauses(), ["5.3"]);
    assert!(!found.passes());
    assert!(
        asked.len() == 1 && asked[0].contains("move the handle"),
        "{asked:?}"
    );
}

#[test]
fn without_a_device_there_is_one_verdict() {
    struct Nobody(Duration);
    impl Connection for Nobody {
        fn now(&mut self) -> Duration {
            self.0
        }
        fn exchange(&mut self, _: &[u8], wait: Duration) -> Result<Vec<u8>, LinkError> {
            self.0 += wait;
            Ok(Vec::new())
        }
    }
    let found = commission(&mut Nobody(Duration::ZERO), 1, &mut |_| {});
    assert_eq!(found.verdicts.len(), 1);
    assert!(!found.passes());
    assert!(found.verdicts[0].seen.contains("no answer"), "{found:?}");
}

/// The simulated probe follows a path and measures the target. The recording contains the
/// path, one period late, and a force of the target's magnitude.
#[test]
fn a_path_is_followed_and_recorded_completely() {
    use study_device::probe::{ProbePath, record};
    use study_wire::message::DeviceState;
    let rate_hz = 1000.0;
    let x_mm: Vec<f64> = (0..3000)
        .map(|i| 17.5 - 12.0 * (std::f64::consts::TAU * 0.5 * f64::from(i) / rate_hz).cos())
        .collect();
    let path = ProbePath {
        x_mm: x_mm.clone(),
        rate_hz,
        force_n: 12.0,
    };
    let mut bench = Bench::new(Options::default());
    let mut told = 0.0;
    let (device, recording) = record(&mut bench, 3, &path, &mut |share| told = share).unwrap();
    assert!(device.flags.simulated);
    assert!((told - 1.0f64).abs() < 0.05, "{told}");
    assert_eq!(recording.x_mm.len(), 3000);
    assert_eq!((recording.f_n.len(), recording.a_m_s2.len()), (3000, 3000));
    for (asked, is) in x_mm.iter().zip(&recording.x_mm) {
        assert!((asked - is).abs() < 0.1, "{asked} {is}");
    }
    let most_n = recording.f_n.iter().fold(0.0f64, |m, f| m.max(f.abs()));
    assert!((3.0..12.0).contains(&most_n), "{most_n}");
    // The device is limp afterwards, and after a refusal, too.
    assert_eq!(bench.firmware.held_n(), 0.0);
    assert_eq!(bench.firmware.state(), DeviceState::Limp);
    // beyond the stroke, and above the velocity limit
    let refusal = |path: &ProbePath| {
        let mut bench = Bench::new(Options::default());
        let refused = record(&mut bench, 4, path, &mut |_| {}).unwrap_err();
        assert_eq!(bench.firmware.state(), DeviceState::Limp);
        refused
    };
    let mut far = path.clone();
    far.x_mm[1500] = 70.0;
    assert!(
        refusal(&far).to_string().contains("a limit is invalid"),
        "{}",
        refusal(&far)
    );
    let mut fast = path;
    fast.x_mm[1500] += 5.0;
    assert!(
        refusal(&fast).to_string().contains("cannot be evaluated"),
        "{}",
        refusal(&fast)
    );
}
