//! A fixed exposure on the simulated device, on a virtual clock.

use crate::memory::MemoryDisk;
use crate::support::repository;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use study::runner::clock::{Clock as _, VirtualClock};
use study::runner::rehearsal::first_day;
use study::runner::{Operator, OperatorError, Runner, Setup};
use study_analysis::load::load;
use study_device::virtual_device::{Options, VirtualDevice};
use study_plan::protocol::{DeviceKind, Exposure};
use study_session::outcome::{Channel, Event};
use study_session::session::{Config, Input, Screen, View};
use study_session::store::{Frozen, SeatKind, StudyFolder};

/// How long it is felt, s: no multiple of anything in the program.
const FELT_S: f64 = 2.5037;

/// Goes on where it can, never while something plays, and leaves after some trials. It waits
/// as long as it is told to.
struct Patient {
    clock: VirtualClock,
    left_s: Vec<f64>,
    rated: u32,
}

impl Operator for Patient {
    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        self.clock.advance(timeout);
        Ok(match &view.screen {
            Screen::Playing {
                since_s, exposure, ..
            } => {
                self.left_s.extend(exposure.left_s(*since_s));
                assert!(!view.can_advance, "it is felt for exactly so long");
                vec![Input::Advance]
            }
            Screen::Form { questions, .. } if self.rated < 3 => {
                self.rated += 1;
                let answer = study_plan::protocol::Answer::Rating(4);
                vec![Input::Answer(vec![(questions[0].id.clone(), answer)])]
            }
            Screen::Form { .. } => vec![Input::Quit],
            Screen::Consent { .. } => vec![Input::Consent(true)],
            _ if view.can_advance => vec![Input::Advance],
            _ => Vec::new(),
        })
    }

    fn channel(&self) -> Option<Channel> {
        Some(Channel::Terminal)
    }
}

#[test]
fn a_fixed_exposure_is_exact_to_twenty_milliseconds() {
    let mut loaded = load(Path::new(&repository("protocols/turn-signal"))).unwrap();
    loaded.protocol.trial.exposure = Exposure {
        min_s: FELT_S,
        max_s: Some(FELT_S),
        replays: 0,
    };
    loaded.protocol.intake.clear();
    loaded.protocol.setup.clear();
    let clock = VirtualClock::starting_at(first_day());
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let disk = Arc::new(MemoryDisk::new());
    let folder = Path::new("results");
    let study = StudyFolder::open_or_create_on(disk, folder, &frozen, clock.now()).unwrap();
    let mut options = Options::default();
    options.device.telemetry_hz = 50.0;
    options.device.servo_hz = 2000.0;
    let setup = Setup {
        protocol: Arc::new(loaded.protocol),
        orders: None,
        models: loaded.models,
        deliveries: Default::default(),
        fingerprints: loaded.fingerprints,
        study: study.clone(),
        kind: SeatKind::Real,
        rows: None,
        group: None,
        device_kind: DeviceKind::Simulated,
        device: Box::new(VirtualDevice::new(options)),
        device_check: None,
        self_weighed: None,
        clock: Box::new(clock.clone()),
        threaded: false,
    };
    let config = Config {
        participant: "P01".to_owned(),
        operator: "lw".to_owned(),
        auto_identify: true,
        ..Config::default()
    };
    let mut operator = Patient {
        clock,
        left_s: Vec::new(),
        rated: 0,
    };
    let ended = Runner::new(setup, config).run(&mut operator);
    assert_eq!(ended.unsaved, None);
    let sessions = study.sessions().unwrap();
    let felt: Vec<f64> = (sessions[0].entries.iter())
        .filter_map(|entry| match &entry.event {
            Event::PlaybackEnded { playback, .. } => Some(playback.exploration_s),
            _ => None,
        })
        .collect();
    assert_eq!(felt.len(), 4);
    for felt_s in felt {
        assert!((felt_s - FELT_S).abs() <= 0.020, "{felt_s}");
    }
    // What is shown counts down from it to nothing.
    let first = operator.left_s[0];
    assert!((FELT_S - 0.1..=FELT_S).contains(&first), "{first}");
    assert!(operator.left_s.iter().any(|left| *left < 0.021));
    let journal = sessions[0].entries.iter().map(|entry| &entry.event);
    let mut answers = journal.filter_map(|event| match event {
        Event::Answered { channel, .. } => Some(*channel),
        _ => None,
    });
    assert!(answers.all(|channel| channel == Some(Channel::Terminal)));
}
