//! Changes of the level in a trial of adjustment, on the simulated device: one step of a ladder after
//! the other, each certified and verified, without a step of the force.

use crate::tables;
use std::time::Duration;
use study_base::limits::Limits;
use study_base::rng::Stream;
use study_base::text::ModelId;
use study_device::firmware::Options as DeviceOptions;
use study_device::link::memory::Noise;
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, Report, Stimulus, rendering_of};
use study_haptics::model::Realization;
use study_plan::protocol::RenderingRules;
use study_session::outcome::{Playback, Sample};
use study_session::rendering::{Played, judge};
use study_wire::predict::Motion;
use study_wire::servo::{Servo, ServoSettings};

/// Largest change of the force beside that of the hand's own motion, N/ms.
const MOST_N_PER_MS: f64 = 2.0;
const SERVO_HZ: f64 = 4000.0;
/// Levels of the ladder: its least one, and the ratio of two neighbors, a just noticeable difference of
/// a force.
const LEVELS: usize = 12;
const LEAST: f64 = 0.4;
const RATIO: f64 = 1.1;

/// A level of a family: detents, a spring and friction, of which all grow with the level. It has no
/// mass, so that positions and speeds give its force.
fn level(at: usize) -> Realization {
    let by = LEAST * RATIO.powi(at as i32);
    tables::table(
        &format!("level.{}", at + 1),
        tables::fine(),
        [0.0, 0.01, 0.05 * by],
        |x_mm, side| by * (5.0 * tables::detent_n(x_mm) + 1.5 * side - 0.8),
        tables::PLAY,
    )
}

/// A playback of a level: what ended it, and its samples of each servo period.
struct Felt {
    samples: Vec<Sample>,
    playback: Playback,
    faded_from_s: Option<f64>,
}

/// How a level is ended.
#[derive(Clone, Copy, PartialEq)]
enum Ends {
    Fade,
    Stop,
}

struct Bench {
    device: VirtualDevice,
    now: Duration,
}

impl Bench {
    /// A hand, and a link that may lose and damage frames.
    fn new(seed: u64, noise: Noise) -> Self {
        let device = DeviceOptions {
            seed,
            watchdog_ms: 200,
            servo_hz: SERVO_HZ,
            telemetry_hz: SERVO_HZ,
            ..DeviceOptions::default()
        };
        Self {
            device: VirtualDevice::new(Options {
                device,
                noise,
                ..Options::default()
            }),
            now: Duration::ZERO,
        }
    }

    /// Polls every millisecond until a report comes, for five seconds at most.
    fn until(&mut self, done: impl Fn(&Report) -> bool) -> Vec<Report> {
        let mut all = Vec::new();
        for _ in 0..5000 {
            self.now += Duration::from_millis(1);
            all.extend(self.device.poll(self.now));
            if all.iter().any(&done) {
                return all;
            }
        }
        panic!("nothing came of it: {all:?}");
    }

    /// Loads a level, without permission for one that is not certified, and plays it for a time.
    fn feel(&mut self, table: &Realization, limits: Limits, lasting: Duration, ends: Ends) -> Felt {
        let what = Stimulus {
            allow_uncertified: false,
            ..Stimulus::of_table(table)
        };
        self.device.load(&what, limits, self.now).unwrap();
        let loaded = self.until(|r| matches!(r, Report::Loaded | Report::Fault(_)));
        assert!(loaded.contains(&Report::Loaded), "{}: {loaded:?}", table.id);
        self.device.start(self.now).unwrap();
        let mut reports = self.until(|r| *r == Report::Started);
        self.now += lasting;
        reports.extend(self.device.poll(self.now));
        match ends {
            Ends::Fade => self.device.fade(self.now).unwrap(),
            Ends::Stop => self.device.stop(self.now).unwrap(),
        }
        reports.extend(self.until(|r| matches!(r, Report::Stopped(_))));
        assert_eq!(self.device.held_n(), 0.0);
        let mut felt = Felt {
            samples: Vec::new(),
            playback: Playback::default(),
            faded_from_s: None,
        };
        for report in reports {
            match report {
                Report::Telemetry(more) => felt.samples.extend(more),
                Report::Stopped(playback) => felt.playback = playback,
                Report::Faded { from_s } => felt.faded_from_s = Some(from_s),
                Report::Fault(why) | Report::Lost(why) => panic!("{}: {why}", table.id),
                _ => {}
            }
        }
        felt
    }

    fn servo(&self, limits: Limits) -> ServoSettings {
        ServoSettings {
            force_n: limits.force_n.get(),
            ..self.device.identity().servo.unwrap()
        }
    }
}

/// The largest change of the force within a servo period beside that of the same table for the same
/// hand without a fall, N/ms: from the first period to the one after the last, in which there is no
/// force.
fn largest_n_per_ms(felt: &Felt, table: &Realization, servo: ServoSettings) -> f64 {
    let mut whole = Servo::new(ServoSettings {
        velocity_mm_s: f64::MAX,
        overtravel_mm: f64::MAX,
        jump_mm: f64::MAX,
        ..servo
    });
    whole.start();
    let what = rendering_of(table);
    let (mut before_n, mut largest_n) = ([0.0_f64; 2], 0.0_f64);
    for sample in &felt.samples {
        let motion = Motion {
            x_mm: sample.x_mm,
            v_mm_s: sample.v_mm_s,
            a_m_s2: 0.0,
        };
        let now_n = [sample.force_command_n, whole.step(&what, motion)];
        let changes_n = [0, 1].map(|i| (now_n[i] - before_n[i]).abs());
        largest_n = largest_n.max(changes_n[0] - changes_n[1]);
        before_n = now_n;
    }
    largest_n.max(before_n[0].abs()) * 1e-3 * servo.servo_hz
}

/// Goes to and fro on the ladder; the largest change of the force in so many changes, N/ms.
fn changes(count: usize, seed: u64, noise: Noise, ends: Ends) -> f64 {
    let lossy = noise != Noise::default();
    let ladder: Vec<Realization> = (0..LEVELS).map(level).collect();
    assert!(ladder.iter().all(|table| table.certificate().passes()));
    let limits = Limits::new(12.0, 1000.0).unwrap();
    let mut bench = Bench::new(seed, noise);
    let servo = bench.servo(limits);
    let mut draws = Stream::new(seed, &["changes"]);
    let (mut at, mut worst) = (LEVELS / 2, 0.0_f64);
    for change in 0..count {
        let table = &ladder[at];
        // Also within the ramp, which takes 0.4 s.
        let lasting = Duration::from_millis(100 + draws.below(1100));
        let felt = bench.feel(table, limits, lasting, ends);
        assert_eq!(felt.faded_from_s.is_some(), ends == Ends::Fade);
        if !lossy {
            assert_eq!(felt.playback.samples_lost, 0);
            worst = worst.max(largest_n_per_ms(&felt, table, servo));
        }
        // What a session asks for, 1 kHz.
        let whole_ms = |s: &&Sample| (SERVO_HZ * s.t_s).round() % 4.0 == 0.0;
        let usual: Vec<Sample> = felt.samples.iter().filter(whole_ms).copied().collect();
        let model = ModelId::new("level").unwrap();
        let played = Played {
            model: &model,
            what: rendering_of(table),
            servo,
            servo_told: true,
            samples: &usual,
            numbered: true,
            lost: felt.playback.samples_lost,
            faded_from_s: felt.faded_from_s,
            time_ratio: felt.playback.time_ratio,
            host_late_s: None,
            others: &[],
        };
        let found = judge(&played, &RenderingRules::default());
        let what = format!("change {change}, {}, {lasting:?}", table.id);
        assert!(found.defects.is_empty(), "{what}: {found:?}");
        // A step up or down.
        let up = at == 0 || (at + 1 < LEVELS && draws.below(2) == 0);
        at = if up { at + 1 } else { at - 1 };
    }
    worst
}

#[test]
fn no_change_has_a_step_of_force() {
    let worst = changes(150, 1, Noise::default(), Ends::Fade);
    eprintln!("the force changes by at most {worst:.3} N/ms beside what the hand does");
    assert!(worst <= MOST_N_PER_MS, "{worst} N/ms");
}

#[test]
#[ignore = "takes minutes"]
fn none_of_ten_thousand_changes_has_a_step_of_force() {
    for seed in 0..20 {
        let worst = changes(500, seed, Noise::default(), Ends::Fade);
        eprintln!("hand {seed}: at most {worst:.3} N/ms beside what the hand does");
        assert!(worst <= MOST_N_PER_MS, "hand {seed}: {worst} N/ms");
    }
}

/// The measure above finds the step of a stop, which is the whole force at once.
#[test]
fn a_stop_has_a_step_of_force() {
    let worst = changes(20, 1, Noise::default(), Ends::Stop);
    assert!(worst > 3.0 * MOST_N_PER_MS, "{worst} N/ms");
}

/// Frames that are lost, damaged, doubled or late, also that of the fall and its replies: each change
/// comes to its end, and each level is certified and verified.
#[test]
fn changes_over_a_bad_line_come_to_their_end() {
    let noise = Noise {
        corrupt: 0.01,
        drop: 0.01,
        duplicate: 0.02,
        reorder: 0.01,
        ..Noise::default()
    };
    changes(60, 3, noise, Ends::Fade);
}
