//! Commissioning in virtual time: passes on the simulated device, and names the
//! clause on one with a planted defect.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::time::Duration;
use study::device::check::{Commissioning, Wire, commission};
use study::device::firmware::{Firmware, Flaw, Options};
use study::device::link::LinkError;
use study::device::link::memory::{Line, Noise};

/// A simulated device behind a line of half a millisecond.
struct Bench {
    firmware: Firmware,
    there: Line,
    back: Line,
    now: Duration,
}

const TICK: Duration = Duration::from_micros(250);

impl Bench {
    fn new(options: Options) -> Self {
        let line = |name| Line::new(2 * TICK, Noise::default(), 1, name);
        Self {
            firmware: Firmware::new(options),
            there: line("there"),
            back: line("back"),
            now: Duration::from_secs(1),
        }
    }
}

impl Wire for Bench {
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
            self.back.send(self.firmware.take_output(), self.now);
            let came = self.back.arrived(self.now);
            if !came.is_empty() {
                return Ok(came);
            }
        }
        Ok(Vec::new())
    }
}

fn check(options: Options) -> (Commissioning, Duration) {
    let mut bench = Bench::new(options);
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
                .starts_with("26 of 26 clauses kept; round trip"),
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
        // a device of another version never gets beyond the greeting
        let expected = if flaw == Flaw::OtherVersion {
            "14.3"
        } else {
            clause
        };
        assert!(broken.contains(&expected), "{name} ({clause}): {broken:?}");
        assert!(!found.passes());
        eprintln!("{name}: {broken:?}");
    }
}

#[test]
fn nobody_there_is_one_verdict() {
    struct Nobody(Duration);
    impl Wire for Nobody {
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
