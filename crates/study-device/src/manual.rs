//! An experimenter who mounts physical samples.
//!
//! A load asks for the sample with a code ([`Report::Mount`]), and the session starts the
//! playback once the experimenter confirms that it is mounted. Only the duration of the
//! exploration is measured.
//!
//! The codes have three digits, like the labels in sensory tests, and say nothing about
//! the sample. [`WithManual`] combines a device with an experimenter, for studies in
//! which only some samples are physical.

use super::{Device, DeviceError, Identity, Report, Stimulus};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;
use study_base::limits::Limits;
use study_base::rng::Stream;
use study_base::text::ModelId;
use study_session::outcome::Playback;

/// Number of codes with three digits, 100 to 999.
const CODES: u64 = 900;

/// A distinct code for each realization, determined by the study's seed and the order
/// of the ids. Adding an id at the end changes no other code. Studies with more than 450
/// realizations get more digits. A code is never part of an id.
///
/// ```
/// # use study_device::manual::codes;
/// # use study_base::text::ModelId;
/// let ids = ["old", "new"].map(|id| ModelId::new(id).expect("an id"));
/// let codes = codes(2007, &[&ids[0], &ids[1]]);
/// assert_ne!(codes[&ids[0]], codes[&ids[1]]);
/// assert!(codes.values().all(|code| code.len() == 3));
/// ```
pub fn codes(seed: u64, ids: &[&ModelId]) -> BTreeMap<ModelId, String> {
    let mut stream = Stream::new(seed, &["manual", "codes"]);
    let mut from = 100;
    let mut range = CODES;
    while (ids.len() as u64) * 2 > range {
        from *= 10;
        range *= 10;
    }
    let mut taken = BTreeSet::new();
    let mut codes = BTreeMap::new();
    for id in ids {
        let code = loop {
            let code = from + stream.below(range);
            let in_id = ids.iter().any(|id| id.as_str().contains(&code.to_string()));
            // The last condition ends the search if the ids contain too many numbers.
            if !taken.contains(&code) && (!in_id || taken.len() as u64 * 4 > range) {
                break code;
            }
            if in_id {
                taken.insert(code);
            }
        };
        taken.insert(code);
        codes.insert((*id).clone(), code.to_string());
    }
    codes
}

/// An experimenter who mounts the requested samples.
#[derive(Debug, Default)]
pub struct Manual {
    phase: Phase,
    reports: Vec<Report>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
enum Phase {
    #[default]
    Idle,
    Mounting,
    Exploring {
        since: Duration,
    },
}

impl Device for Manual {
    fn identity(&self) -> Identity {
        Identity {
            id: "manual".to_owned(),
            simulated: false,
            telemetry: false,
            numbered: false,
            // No limit in practice, because a sample has no motor.
            limits: Limits::new(1e3, 1e5).expect("positive constants"),
            servo: None,
            mechanisms: false,
            elements: false,
            stiffness_n_per_mm: None,
            damping_n_s_per_mm: None,
            stroke_mm: None,
            firmware: None,
        }
    }

    fn load(&mut self, what: &Stimulus<'_>, _: Limits, _: Duration) -> Result<(), DeviceError> {
        self.reports = vec![Report::Mount(what.code.to_owned())];
        self.phase = Phase::Mounting;
        Ok(())
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        if self.phase != Phase::Mounting {
            return Err(DeviceError::WrongState {
                command: "start",
                state: "no sample is mounted",
            });
        }
        self.phase = Phase::Exploring { since: at };
        self.reports.push(Report::Started);
        Ok(())
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        let Phase::Exploring { since } = self.phase else {
            return Err(DeviceError::WrongState {
                command: "stop",
                state: "no sample is being explored",
            });
        };
        self.phase = Phase::Idle;
        self.reports.push(Report::Stopped(Playback {
            exploration_s: at.saturating_sub(since).as_secs_f64(),
            ..Playback::default()
        }));
        Ok(())
    }

    fn limp(&mut self, _: Duration) {
        self.phase = Phase::Idle;
        self.reports.clear();
    }

    fn poll(&mut self, _: Duration) -> Vec<Report> {
        std::mem::take(&mut self.reports)
    }
}

/// A device combined with an experimenter for the physical samples.
pub struct WithManual {
    device: Box<dyn Device>,
    person: Manual,
    /// Whether the current stimulus is a physical sample.
    by_hand: bool,
}

impl WithManual {
    /// Combines a device with an experimenter.
    pub fn new(device: Box<dyn Device>) -> Self {
        Self {
            device,
            person: Manual::default(),
            by_hand: false,
        }
    }

    /// Who presents the current stimulus.
    fn current(&mut self) -> &mut dyn Device {
        if self.by_hand {
            &mut self.person
        } else {
            &mut *self.device
        }
    }
}

impl Device for WithManual {
    fn identity(&self) -> Identity {
        self.device.identity()
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        // No force while the experimenter mounts a sample.
        self.limp(at);
        self.by_hand = what.by_hand;
        self.current().load(what, limits, at)
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.current().start(at)
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.current().stop(at)
    }

    fn fade(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.current().fade(at)
    }

    fn limp(&mut self, at: Duration) {
        self.person.limp(at);
        self.device.limp(at);
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        let mut reports = self.device.poll(at);
        reports.extend(self.person.poll(at));
        reports
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    fn id(name: &str) -> ModelId {
        ModelId::new(name).unwrap()
    }

    #[test]
    fn codes_are_distinct_stable_and_opaque() {
        let names: Vec<ModelId> = (0..400).map(|i| id(&format!("m{i}"))).collect();
        let all: Vec<&ModelId> = names.iter().collect();
        let codes_of_all = codes(2007, &all);
        let distinct: BTreeSet<&String> = codes_of_all.values().collect();
        assert_eq!(distinct.len(), 400);
        assert!(distinct.iter().all(|c| c.len() == 3));
        for (name, code) in &codes_of_all {
            assert!(!name.as_str().contains(code.as_str()));
        }
        // no code is part of any name, where there are enough others
        let names: Vec<ModelId> = (100..200).map(|i| id(&format!("m{i}"))).collect();
        let all: Vec<&ModelId> = names.iter().collect();
        let codes_of_all = codes(2007, &all);
        let in_a_name = |code: &String| names.iter().any(|n| n.as_str().contains(code.as_str()));
        assert!(!codes_of_all.values().any(in_a_name));
        // the same ids again, and with one more at the end
        let names: Vec<ModelId> = ["real", "copy", "spring"].map(id).to_vec();
        let three: Vec<&ModelId> = names.iter().collect();
        let first = codes(2007, &three[..2]);
        let then = codes(2007, &three);
        assert!(first.iter().all(|(id, code)| then[id] == *code));
        assert_ne!(codes(2008, &three), then);
        // more than three digits can tell apart
        let names: Vec<ModelId> = (0..2000).map(|i| id(&format!("x{i}"))).collect();
        let many: Vec<&ModelId> = names.iter().collect();
        let distinct: BTreeSet<String> = codes(1, &many).into_values().collect();
        assert_eq!(distinct.len(), 2000);
    }

    /// A motor that counts how often it is made limp.
    struct Motor(Arc<AtomicU32>);

    impl Device for Motor {
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
            Ok(())
        }

        fn limp(&mut self, _: Duration) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }

        fn poll(&mut self, _: Duration) -> Vec<Report> {
            Vec::new()
        }
    }

    #[test]
    fn the_motor_is_limp_while_a_sample_is_mounted() {
        let limped = Arc::new(AtomicU32::new(0));
        let mut device = WithManual::new(Box::new(Motor(limped.clone())));
        let what = Stimulus {
            model: "the-real-switch",
            table: None,
            code: "417",
            by_hand: true,
            allow_uncertified: false,
        };
        let limits = device.identity().limits;
        device.load(&what, limits, Duration::ZERO).unwrap();
        assert_eq!(limped.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn a_sample_is_requested_by_its_code_and_its_exploration_is_timed() {
        let at = Duration::from_secs;
        let limits = Manual::default().identity().limits;
        let what = Stimulus {
            model: "the-real-switch",
            table: None,
            code: "417",
            by_hand: true,
            allow_uncertified: false,
        };
        let mut person = Manual::default();
        assert!(person.start(at(0)).is_err(), "nothing is mounted");
        person.load(&what, limits, at(1)).unwrap();
        assert_eq!(person.poll(at(1)), [Report::Mount("417".to_owned())]);
        person.start(at(20)).unwrap();
        assert_eq!(person.poll(at(20)), [Report::Started]);
        person.stop(at(32)).unwrap();
        let reports = person.poll(at(32));
        let [Report::Stopped(playback)] = &reports[..] else {
            panic!("{reports:?}");
        };
        assert_eq!(playback.exploration_s, 12.0);
        // LIMP cancels the request.
        person.load(&what, limits, at(40)).unwrap();
        person.limp(at(41));
        assert_eq!(person.poll(at(41)), []);
        assert!(person.start(at(42)).is_err());
    }
}
