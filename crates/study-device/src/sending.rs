//! A simulated controller program that sends numbers of the study with each playback, for rehearsals.
//!
//! They are drawn and depend on nothing that is felt: counts from 0 to 3, and else numbers from 0.83 to 5 whose small
//! values are frequent.

use super::{Device, DeviceError, Identity, Report, Stimulus};
use std::time::Duration;
use study_base::limits::Limits;
use study_base::rng::Stream;
use study_session::outcome::SentNumber;

/// A number that is sent with each playback.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drawn {
    /// Its key in the message, such as `time_s`.
    pub key: String,
    /// Whether it is a count.
    pub is_count: bool,
}

/// A device with drawn numbers at the end of each of its playbacks.
pub struct Sending {
    device: Box<dyn Device>,
    numbers: Vec<Drawn>,
    stream: Stream,
}

impl Sending {
    /// The same seed draws the same numbers.
    pub fn new(device: Box<dyn Device>, numbers: Vec<Drawn>, seed: u64) -> Self {
        Self {
            device,
            numbers,
            stream: Stream::new(seed, &["device", "numbers"]),
        }
    }

    fn draw(&mut self) -> Report {
        let stream = &mut self.stream;
        let mut one = |drawn: &Drawn| {
            let (count, share) = (stream.below(4), stream.unit());
            SentNumber {
                key: drawn.key.clone(),
                value: Some(match drawn.is_count {
                    true => count as f64,
                    false => 1.0 / (0.2 + share),
                }),
                fault: None,
            }
        };
        Report::Numbers {
            numbers: self.numbers.iter().map(&mut one).collect(),
            outside: false,
        }
    }
}

impl Device for Sending {
    fn identity(&self) -> Identity {
        self.device.identity()
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        self.device.load(what, limits, at)
    }

    fn load_time(&self, what: &Stimulus<'_>, limits: Limits) -> Option<Duration> {
        self.device.load_time(what, limits)
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.start(at)
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.stop(at)
    }

    fn fade(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.fade(at)
    }

    fn limp(&mut self, at: Duration) {
        self.device.limp(at);
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        let mut all = Vec::new();
        for report in self.device.poll(at) {
            if matches!(report, Report::Stopped(_)) {
                all.push(self.draw());
            }
            all.push(report);
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manual::Manual;

    #[test]
    fn each_playback_sends_its_numbers_before_its_end() {
        let drawn = |key: &str, is_count| Drawn {
            key: key.to_owned(),
            is_count,
        };
        let played = |seed: u64| {
            let numbers = vec![drawn("time_s", false), drawn("errors", true)];
            let mut device = Sending::new(Box::new(Manual::default()), numbers, seed);
            let what = Stimulus {
                model: "a",
                table: None,
                code: "417",
                by_hand: true,
                allow_uncertified: false,
            };
            let limits = device.identity().limits;
            let at = Duration::from_millis;
            let mut all = Vec::new();
            for start in [0, 1000, 2000] {
                device.load(&what, limits, at(start)).unwrap();
                device.poll(at(start));
                device.start(at(start + 100)).unwrap();
                device.poll(at(start + 100));
                device.stop(at(start + 200)).unwrap();
                let reports = device.poll(at(start + 300));
                let [Report::Numbers { numbers, outside }, Report::Stopped(_)] = &reports[..]
                else {
                    panic!("{reports:?}")
                };
                assert!(!outside);
                all.extend(numbers.clone());
            }
            all
        };
        let all = played(7);
        assert_eq!(all, played(7));
        assert_ne!(all, played(8));
        for pair in all.chunks(2) {
            let [time, errors] = [0, 1].map(|i| pair[i].value.unwrap());
            assert!((0.8..=5.0).contains(&time), "{time}");
            assert!(errors.fract() == 0.0 && (0.0..4.0).contains(&errors));
        }
    }

    /// A device that only lets its force fall, and says that it did.
    #[derive(Default)]
    struct Falls(Vec<Report>);

    impl Device for Falls {
        fn identity(&self) -> Identity {
            Manual::default().identity()
        }

        fn load(&mut self, _: &Stimulus<'_>, _: Limits, _: Duration) -> Result<(), DeviceError> {
            Ok(())
        }

        fn start(&mut self, _: Duration) -> Result<(), DeviceError> {
            Ok(())
        }

        fn stop(&mut self, _: Duration) -> Result<(), DeviceError> {
            panic!("a stop at once");
        }

        fn fade(&mut self, _: Duration) -> Result<(), DeviceError> {
            self.0.push(Report::Faded { from_s: 1.0 });
            Ok(())
        }

        fn limp(&mut self, _: Duration) {}

        fn poll(&mut self, _: Duration) -> Vec<Report> {
            std::mem::take(&mut self.0)
        }
    }

    #[test]
    fn a_force_falls_as_without_numbers() {
        let mut device = Sending::new(Box::new(Falls::default()), Vec::new(), 1);
        device.fade(Duration::ZERO).unwrap();
        assert_eq!(device.poll(Duration::ZERO), [Report::Faded { from_s: 1.0 }]);
    }
}
