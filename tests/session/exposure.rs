//! A fixed exposure on the simulated device, on a virtual clock.

use crate::memory::MemoryDisk;
use crate::support::repository;
use std::cell::Cell;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;
use study::runner::clock::{Clock, VirtualClock};
use study::runner::rehearsal::first_day;
use study::runner::saver::Saving;
use study::runner::{Operator, OperatorError, Runner, Setup};
use study_analysis::load::load;
use study_device::virtual_device::{Options, VirtualDevice};
use study_plan::protocol::{Answer, DeviceKind, Exposure};
use study_session::outcome::{Channel, Event, Failure, Moment};
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
                let answer = Answer::Rating(4);
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

/// The events of a session in which everything is felt for this long.
fn session(exposure: Exposure, clock: VirtualClock, operator: &mut dyn Operator) -> Vec<Event> {
    sitting(&MemoryDisk::new(), exposure, clock, operator)
}

/// The same, of a session that may have been left before.
fn sitting(
    disk: &MemoryDisk,
    exposure: Exposure,
    clock: impl Clock + 'static,
    operator: &mut dyn Operator,
) -> Vec<Event> {
    let mut loaded = load(Path::new(&repository("protocols/turn-signal"))).unwrap();
    loaded.protocol.trial.exposure = exposure;
    loaded.protocol.intake.clear();
    loaded.protocol.setup.clear();
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let disk = Arc::new(disk.clone());
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
        clock: Box::new(clock),
        saving: Saving::Loop,
    };
    let config = Config {
        participant: "P01".to_owned(),
        operator: "lw".to_owned(),
        auto_identify: true,
        ..Config::default()
    };
    let ended = Runner::new(setup, config).run(operator);
    assert_eq!(ended.unsaved, None);
    let mut sessions = study.sessions().unwrap();
    let entries = std::mem::take(&mut sessions[0].entries);
    entries.into_iter().map(|entry| entry.event).collect()
}

fn exactly(felt_s: f64) -> Exposure {
    Exposure {
        min_s: felt_s,
        max_s: Some(felt_s),
        replays: 0,
    }
}

/// How long each playback lasted, s.
fn felt_s(events: &[Event]) -> Vec<f64> {
    let felt = events.iter().filter_map(|event| match event {
        Event::PlaybackEnded { playback, .. } => Some(playback.exploration_s),
        _ => None,
    });
    felt.collect()
}

#[test]
fn a_fixed_exposure_is_exact_to_twenty_milliseconds() {
    let clock = VirtualClock::starting_at(first_day());
    let mut operator = Patient {
        clock: clock.clone(),
        left_s: Vec::new(),
        rated: 0,
    };
    let events = session(exactly(FELT_S), clock, &mut operator);
    let felt = felt_s(&events);
    assert_eq!(felt.len(), 4);
    for felt_s in felt {
        assert!((felt_s - FELT_S).abs() <= 0.020, "{felt_s}");
    }
    // What is shown counts down from it to nothing.
    let first = operator.left_s[0];
    assert!((FELT_S - 0.1..=FELT_S).contains(&first), "{first}");
    assert!(operator.left_s.iter().any(|left| *left < 0.021));
    let mut answers = events.iter().filter_map(|event| match event {
        Event::Answered { channel, .. } => Some(*channel),
        _ => None,
    });
    assert!(answers.all(|channel| channel == Some(Channel::Terminal)));
}

/// Somebody closes the lid of the computer during the first playback.
struct Sleeper {
    patient: Patient,
    slept: bool,
}

impl Operator for Sleeper {
    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        if matches!(view.screen, Screen::Playing { .. }) && !self.slept {
            self.slept = true;
            self.patient.clock.advance(Duration::from_secs(20));
            // What is pressed on waking up must not end the playback as if nothing had been.
            return Ok(vec![Input::Advance]);
        }
        self.patient.next(view, timeout)
    }
}

#[test]
fn a_playback_in_which_the_computer_stood_still_does_not_count() {
    let clock = VirtualClock::starting_at(first_day());
    let mut operator = Sleeper {
        patient: Patient {
            clock: clock.clone(),
            left_s: Vec::new(),
            rated: 0,
        },
        slept: false,
    };
    let events = session(exactly(0.3), clock, &mut operator);
    let longest = felt_s(&events).into_iter().fold(0.0, f64::max);
    assert!(longest <= 0.32, "{longest} s");
    let failed: Vec<&Event> = (events.iter())
        .filter(|event| matches!(event, Event::AttemptFailed { .. }))
        .collect();
    let [
        Event::AttemptFailed {
            trial: 1,
            attempt: 1,
            failure: Failure::Interrupted,
            detail,
            queue,
            ..
        },
    ] = &failed[..]
    else {
        panic!("{failed:?}");
    };
    assert!(detail.contains("stood still for 20.0 s"), "{detail}");
    assert_eq!(queue[0], 1, "it comes next");
}

/// How many trials were felt again, of a session that is left at its first rating and resumed 40 s
/// later, if the computer then stands still for so long at the rating.
fn felt_again_after(standstill: Duration) -> usize {
    let clock = VirtualClock::starting_at(first_day());
    let disk = MemoryDisk::new();
    let patient = |rated| Patient {
        clock: clock.clone(),
        left_s: Vec::new(),
        rated,
    };
    let own = || clock.clone();
    sitting(&disk, exactly(FELT_S), own(), &mut patient(3));
    clock.advance(Duration::from_secs(40));
    let mut operator = Absent {
        patient: patient(2),
        standstill,
    };
    let events = sitting(&disk, exactly(FELT_S), own(), &mut operator);
    let again = |event: &&Event| match event {
        Event::AttemptFailed { detail, .. } => detail.starts_with("felt again"),
        _ => false,
    };
    events.iter().filter(again).count()
}

/// The program does not run for a while when somebody is about to rate.
struct Absent {
    patient: Patient,
    standstill: Duration,
}

impl Operator for Absent {
    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        if matches!(view.screen, Screen::Form { .. }) {
            let standstill = std::mem::take(&mut self.standstill);
            self.patient.clock.advance(standstill);
        }
        self.patient.next(view, timeout)
    }
}

/// A stopped process, or a suspended computer whose clock goes on, is a pause like the one for which
/// the program was left.
#[test]
fn a_rating_waits_no_longer_than_a_pause_may_be_while_the_program_stands_still() {
    assert_eq!(felt_again_after(Duration::ZERO), 0);
    assert_eq!(felt_again_after(Duration::from_secs(15)), 0);
    assert_eq!(felt_again_after(Duration::from_secs(25)), 1);
}

/// The clock of a computer whose monotonic clock stands still while it is suspended.
#[derive(Clone)]
struct Suspendable {
    clock: VirtualClock,
    asleep: Rc<Cell<Duration>>,
}

impl Clock for Suspendable {
    fn now(&self) -> Moment {
        let at = self.clock.now();
        let asleep_ns = u64::try_from(self.asleep.get().as_nanos()).unwrap();
        Moment {
            mono_ns: at.mono_ns - asleep_ns,
            ..at
        }
    }
}

/// Somebody whose computer is suspended at the first rating, and who rates on waking it up.
struct Awoken {
    patient: Patient,
    asleep: Rc<Cell<Duration>>,
}

impl Operator for Awoken {
    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        if matches!(view.screen, Screen::Form { .. }) && self.asleep.get().is_zero() {
            let asleep = Duration::from_secs(100);
            self.patient.clock.advance(asleep);
            self.asleep.set(asleep);
        }
        self.patient.next(view, timeout)
    }
}

#[test]
fn a_rating_on_waking_up_is_not_about_what_was_felt_before() {
    let clock = Suspendable {
        clock: VirtualClock::starting_at(first_day()),
        asleep: Rc::default(),
    };
    let mut operator = Awoken {
        patient: Patient {
            clock: clock.clock.clone(),
            left_s: Vec::new(),
            rated: 0,
        },
        asleep: clock.asleep.clone(),
    };
    let events = sitting(&MemoryDisk::new(), exactly(FELT_S), clock, &mut operator);
    let again = |event: &&Event| match event {
        Event::AttemptFailed { detail, .. } => detail.starts_with("felt again"),
        _ => false,
    };
    assert_eq!(events.iter().filter(again).count(), 1);
    // Of three ratings the first one came too late.
    let rating = |event: &&Event| {
        matches!(
            event,
            Event::Answered {
                answer: Answer::Rating(_),
                ..
            }
        )
    };
    assert_eq!(events.iter().filter(rating).count(), 2);
}
