//! The runner's supervision of a device: silence during playback, and the force limits
//! that it requests.

use crate::designs::{design, model};
use crate::tables;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use study::rater::{Effect, Percepts, Rater};
use study::runner::clock::{Clock as _, VirtualClock};
use study::runner::rehearsal::{first_day, run_one};
use study::runner::saver::Saving;
use study::runner::{Setup, playback_limits};
use study_base::limits::{Limit, Limits};
use study_base::text::QuestionId;
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, DeviceError, Identity, Report, Stimulus};
use study_haptics::model::Realization;
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::*;
use study_session::store::{Frozen, SeatKind, StudyFolder};

/// What the runner asked a device to load.
#[derive(Debug, Clone, PartialEq)]
struct Load {
    model: String,
    force_n: f64,
    allow_uncertified: bool,
}

/// A simulated device that may fall silent one second into its first playback.
struct Observed {
    device: VirtualDevice,
    loads: Arc<Mutex<Vec<Load>>>,
    falls_silent: bool,
    started: Option<Duration>,
}

impl Device for Observed {
    fn identity(&self) -> Identity {
        self.device.identity()
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        self.loads.lock().unwrap().push(Load {
            model: what.model.to_owned(),
            force_n: limits.force_n.get(),
            allow_uncertified: what.allow_uncertified,
        });
        self.device.load(what, limits, at)
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.start(at)
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.stop(at)
    }

    fn limp(&mut self, at: Duration) {
        if self.started.take().is_some() {
            self.falls_silent = false;
        }
        self.device.limp(at);
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        let reports = self.device.poll(at);
        if reports.contains(&Report::Started) {
            self.started = Some(at);
        }
        match self.started {
            Some(started) if self.falls_silent && at > started + Duration::from_secs(1) => {
                Vec::new()
            }
            _ => reports,
        }
    }
}

/// A table of constant mass and damping with 1 N of friction.
fn table(id: &str, mass_kg: f64) -> Realization {
    let terms = [mass_kg, 0.01, 0.0];
    tables::table(id, tables::coarse(), terms, |_, side| side, tables::PLAY)
}

/// Realizations `A`, which is certified, and `B`, which is not; one rating.
fn protocol(uncertified_n: Option<f64>) -> Protocol {
    let mut protocol = design(2, 1, Order::Blocked);
    protocol.device.uncertified = uncertified_n.map(|force_n| Uncertified {
        play: true,
        force_n: Limit::new(force_n).unwrap(),
        reason: "a test".to_owned(),
    });
    protocol.questions = vec![Question {
        id: QuestionId::new("realism").unwrap(),
        prompt: "How realistic?".to_owned(),
        kind: QuestionKind::Rating(kinds::Rating {
            from: 1,
            to: 7,
            labels: BTreeMap::new(),
        }),
        required: true,
    }];
    protocol
}

/// Runs a rehearsed session; the loads and the lines of the journal.
fn session(falls_silent: bool) -> (Vec<Load>, Vec<serde_json::Value>) {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(Some(9.0));
    let fingerprints = Fingerprints {
        stimulus: "5".repeat(64),
        wording: "6".repeat(64),
        analysis: "7".repeat(64),
    };
    let files = [("protocol.toml".to_owned(), b"not read\n".to_vec())];
    let frozen = Frozen {
        protocol: &protocol,
        files: &files,
        fingerprints: &fingerprints,
    };
    let clock = VirtualClock::starting_at(first_day());
    let study = StudyFolder::open_or_create(folder.path(), &frozen, clock.now()).unwrap();
    let journal = study.path().join("sessions/SIM001/1/journal.jsonl");
    let loads = Arc::new(Mutex::new(Vec::new()));
    let device = Observed {
        device: VirtualDevice::new(Options::default()),
        loads: Arc::clone(&loads),
        falls_silent,
        started: None,
    };
    let models = [("A", 0.05), ("B", -0.2)];
    let setup = Setup {
        protocol: Arc::new(protocol),
        orders: None,
        models: models
            .map(|(id, mass_kg)| (model(id).id, table(id, mass_kg)))
            .into(),
        fingerprints,
        study,
        kind: SeatKind::Simulated,
        rows: None,
        group: None,
        device_kind: DeviceKind::Simulated,
        device: Box::new(device),
        deliveries: Default::default(),
        device_check: None,
        self_weighed: None,
        clock: Box::new(clock.clone()),
        saving: Saving::Loop,
    };
    let mut rater = Rater::new(1, 1, Effect::None);
    run_one(setup, "SIM001", &clock, &mut rater, &Percepts::default()).unwrap();
    let journal = std::fs::read_to_string(journal).unwrap();
    let lines = journal
        .lines()
        .map(|line| serde_json::from_str(line).unwrap());
    (loads.lock().unwrap().clone(), lines.collect())
}

/// A device with telemetry that sends nothing for a second has lost the playback.
#[test]
fn a_second_of_silence_ends_the_attempt() {
    let (_, journal) = session(true);
    let at_s = |event: &serde_json::Value| event["mono_ns"].as_f64().unwrap() * 1e-9;
    let started = journal.iter().find(|e| e["event"] == "playback_started");
    let lost = journal.iter().find(|e| e["failure"] == "playback_lost");
    let after_s = at_s(lost.expect("a lost playback")) - at_s(started.unwrap());
    // silent after one second, noticed one second later, in steps of a quarter second
    assert!((2.0..2.8).contains(&after_s), "{after_s} s");
    let ended = journal.iter().filter(|e| e["event"] == "playback_ended");
    assert_eq!(ended.count(), 2, "the trial is repeated");
}

/// The force of tables that fail their certificate is capped, that of others is not.
#[test]
fn uncertified_tables_are_loaded_with_the_capped_force() {
    let (loads, _) = session(false);
    let load = |model: &str, force_n| Load {
        model: model.to_owned(),
        force_n,
        allow_uncertified: true,
    };
    assert_eq!(loads.len(), 2);
    assert!(loads.contains(&load("A", 12.0)), "{loads:?}");
    assert!(loads.contains(&load("B", 9.0)), "{loads:?}");
}

#[test]
fn the_cap_applies_to_uncertified_tables_only_and_never_raises_the_limit() {
    let (certified, uncertified) = (table("A", 0.05), table("B", -0.2));
    assert!(certified.certificate().passes());
    assert!(!uncertified.certificate().passes());
    let force_n = |cap_n, table| playback_limits(&protocol(cap_n), table).force_n.get();
    assert_eq!(force_n(Some(9.0), Some(&uncertified)), 9.0);
    assert_eq!(force_n(Some(9.0), Some(&certified)), 12.0);
    assert_eq!(force_n(Some(9.0), None), 12.0);
    assert_eq!(force_n(Some(15.0), Some(&uncertified)), 12.0);
    assert_eq!(force_n(None, Some(&uncertified)), 12.0);
    // what is not safe to play is capped, although it passes its certificate
    let text = std::fs::read_to_string("crates/study-haptics/tests/data/edge.toml").unwrap();
    let edge = study_haptics::model::file::parse("edge.toml", &text)
        .0
        .unwrap();
    assert!(edge.certificate().passes());
    assert_eq!(force_n(Some(9.0), Some(&edge)), 9.0);
    let limits = playback_limits(&protocol(Some(9.0)), Some(&uncertified));
    assert_eq!(limits.velocity_mm_s.get(), 1000.0);
}
