//! The simulated device, in this process: the servo, a hand, and virtual time.
//!
//! What it measures, plays and reports follows from its options, the tables and
//! the instants it is called at; how often it is polled changes nothing. There is
//! no link in between yet: commands and reports are handed over as they are.
//!
//! States: idle → load → loaded → start → playing → stop → loaded. A trip is
//! latched: only a new load goes on from there. [`Device::limp`] ends in idle from
//! everywhere but a trip and a cable that is out.
//!
//! Parameters and formulas are in `docs/simulation.md`. Nothing it reports is
//! measured.

use super::core::tally::Tally;
use super::core::{Core, Rendering, Settings, State, Trip};
use super::faults::{Fate, FaultPlan, Injected};
use super::{Device, DeviceError, Identity, Report, Stimulus, table};
use crate::limits::{Limit, Limits};
use crate::model::Realization;
use crate::model::predict::Motion;
use crate::outcome::{Playback, Sample};
use crate::plant::{Hand, HandParameters};
use crate::rng::Stream;
use std::time::Duration;

/// From a load to its confirmation.
const LOAD_LATENCY: Duration = Duration::from_millis(20);
/// From a start or stop to its confirmation.
const COMMAND_LATENCY: Duration = Duration::from_millis(2);
/// How long a cable is out.
const UNPLUGGED: Duration = Duration::from_secs(2);
/// Resolution of the encoder, mm.
const ENCODER_MM: f64 = 0.005;
/// Corner of the one-pole low-pass that the speed is taken through, Hz.
const SPEED_HZ: f64 = 200.0;

/// What a simulated device is like.
#[derive(Debug)]
pub struct Options {
    /// Decides how the hand moves in each playback.
    pub seed: u64,
    /// Servo periods per second, held to 500 … 20,000; no number reads as 4000.
    pub servo_hz: f64,
    /// Telemetry samples per second, at most one a servo period.
    pub telemetry_hz: f64,
    /// What the device never exceeds.
    pub limits: Limits,
    /// What it does wrong on purpose.
    pub faults: FaultPlan,
    /// Hand and slider.
    pub hand: HandParameters,
    /// Smallest mass that is rendered, kg: minus infinity plays every table as it
    /// is, which no hand may be able to hold.
    pub least_mass_kg: f64,
}

impl Default for Options {
    /// 4 kHz servo, 1 kHz telemetry, 15 N, 1 m/s, no faults, seed 0; no less mass
    /// than the slider's own can be taken away.
    fn default() -> Self {
        let limit = |value| Limit::new(value).expect("a positive constant");
        let hand = HandParameters::default();
        Self {
            seed: 0,
            servo_hz: 4000.0,
            telemetry_hz: 1000.0,
            limits: Limits {
                force_n: limit(15.0),
                velocity_mm_s: limit(1000.0),
            },
            faults: FaultPlan::none(),
            hand,
            least_mass_kg: -hand.slider_kg,
        }
    }
}

/// The simulated device.
#[derive(Debug)]
pub struct VirtualDevice {
    options: Options,
    /// Servo periods between two telemetry samples.
    decimation: u64,
    loads: u32,
    loaded: Option<Loaded>,
    phase: Phase,
    /// Not yet fetched.
    reports: Vec<Report>,
}

#[derive(Debug)]
struct Loaded {
    realization: Realization,
    limits: Limits,
    fate: Option<Fate>,
}

#[derive(Debug)]
enum Phase {
    Idle,
    Loading {
        until: Duration,
    },
    Loaded,
    Starting {
        until: Duration,
    },
    Playing(Box<Run>),
    Stopping {
        until: Duration,
        playback: Playback,
    },
    Tripped,
    /// An injected loss: limp, and never heard of until the next load.
    Silent,
    Unplugged {
        until: Duration,
    },
}

/// One playback.
#[derive(Debug)]
struct Run {
    since: Duration,
    core: Core,
    hand: Hand,
    sensor: Sensor,
    /// Servo periods so far.
    steps: u64,
    /// The servo period in which the injected fault strikes.
    strikes: Option<(u64, Injected)>,
    samples: u64,
    /// Strokes and clamps as last reported.
    told: (u32, u64),
}

/// How a run ended by itself.
enum Ending {
    Trip(Trip),
    Silence,
    Unplugged { at: Duration },
}

impl VirtualDevice {
    /// A device that is limp and waits for a table.
    pub fn new(mut options: Options) -> Self {
        options.servo_hz = if options.servo_hz.is_nan() {
            Options::default().servo_hz
        } else {
            options.servo_hz.clamp(500.0, 20_000.0)
        };
        let every = (options.servo_hz / options.telemetry_hz.max(0.1)).round();
        Self {
            decimation: (every as u64).max(1),
            options,
            loads: 0,
            loaded: None,
            phase: Phase::Idle,
            reports: Vec::new(),
        }
    }

    /// The force that it holds at this moment, N; zero unless it plays.
    pub fn held_n(&self) -> f64 {
        match &self.phase {
            Phase::Playing(run) => run.core.held_n(),
            _ => 0.0,
        }
    }

    /// Lets time pass up to `at`.
    fn advance(&mut self, at: Duration) {
        loop {
            match &mut self.phase {
                Phase::Loading { until } if *until <= at => {
                    self.reports.push(Report::Loaded);
                    self.phase = Phase::Loaded;
                }
                Phase::Starting { until } if *until <= at => {
                    let since = *until;
                    self.reports.push(Report::Started);
                    self.phase = match &self.loaded {
                        Some(loaded) => Phase::Playing(Box::new(self.begin(loaded, since))),
                        None => Phase::Idle,
                    };
                }
                Phase::Playing(run) => {
                    let Some(loaded) = &self.loaded else { return };
                    let (samples, ending) =
                        run.advance(at, &loaded.realization, &self.options, self.decimation);
                    let progress = run.progress();
                    if !samples.is_empty() {
                        self.reports.push(Report::Telemetry(samples));
                    }
                    self.reports.extend(progress);
                    match ending {
                        None => return,
                        Some(Ending::Trip(why)) => {
                            self.reports.push(Report::Fault(why.as_str().to_owned()));
                            self.phase = Phase::Tripped;
                        }
                        Some(Ending::Silence) => self.phase = Phase::Silent,
                        Some(Ending::Unplugged { at }) => {
                            self.reports.push(Report::Lost("unplugged".to_owned()));
                            self.phase = Phase::Unplugged {
                                until: at + UNPLUGGED,
                            };
                        }
                    }
                }
                Phase::Stopping { until, playback } if *until <= at => {
                    self.reports.push(Report::Stopped(*playback));
                    self.phase = Phase::Loaded;
                }
                Phase::Unplugged { until } if *until <= at => {
                    self.reports.push(Report::Ready);
                    self.loaded = None;
                    self.phase = Phase::Idle;
                }
                _ => return,
            }
        }
    }

    fn begin(&self, loaded: &Loaded, since: Duration) -> Run {
        let options = &self.options;
        let mut core = Core::new(Settings {
            servo_hz: options.servo_hz,
            force_n: loaded.limits.force_n.get(),
            velocity_mm_s: loaded.limits.velocity_mm_s.get(),
            least_mass_kg: options.least_mass_kg,
            ..Settings::default()
        });
        core.start();
        let [low, high] = loaded.realization.trained.x_mm;
        let margin = (0.1 * (high - low)).min(1.5);
        let variation = Stream::new(options.seed, &["device", "hand", &self.loads.to_string()]);
        let hand = Hand::new(options.hand, [low + margin, high - margin], variation);
        Run {
            since,
            core,
            sensor: Sensor::new(hand.motion(), options.servo_hz),
            hand,
            steps: 0,
            strikes: loaded
                .fate
                .map(|fate| ((fate.after_s * options.servo_hz) as u64, fate.fault)),
            samples: 0,
            told: (0, 0),
        }
    }

    fn state(&self) -> &'static str {
        match self.phase {
            Phase::Idle => "no table is loaded",
            Phase::Loading { .. } => "the table is being loaded",
            Phase::Loaded => "a table is loaded",
            Phase::Starting { .. } => "it is about to play",
            Phase::Playing(_) => "it plays",
            Phase::Stopping { .. } => "it is about to stop",
            Phase::Tripped => "it has tripped",
            Phase::Silent => "it does not answer",
            Phase::Unplugged { .. } => "it is unplugged",
        }
    }

    fn wrong_state(&self, command: &'static str) -> DeviceError {
        match self.phase {
            Phase::Unplugged { .. } => DeviceError::Lost("unplugged".to_owned()),
            _ => DeviceError::WrongState {
                command,
                state: self.state(),
            },
        }
    }
}

impl Device for VirtualDevice {
    fn identity(&self) -> Identity {
        Identity {
            id: "simulated-1".to_owned(),
            simulated: true,
            telemetry: true,
            limits: self.options.limits,
        }
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        self.advance(at);
        let realization = what.need_table()?;
        match self.phase {
            Phase::Idle | Phase::Loading { .. } | Phase::Loaded => {}
            Phase::Tripped | Phase::Silent => {}
            _ => return Err(self.wrong_state("load")),
        }
        self.loads += 1;
        self.loaded = None;
        self.phase = Phase::Idle;
        let fate = self.options.faults.fate(self.loads);
        if fate.is_some_and(|fate| fate.fault == Injected::RefuseLoad) {
            return Err(DeviceError::Refused("an injected fault".to_owned()));
        }
        table::check(realization).map_err(DeviceError::Refused)?;
        self.loaded = Some(Loaded {
            realization: realization.clone(),
            limits: limits.capped_at(self.options.limits),
            fate,
        });
        self.phase = Phase::Loading {
            until: at + LOAD_LATENCY,
        };
        Ok(())
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.advance(at);
        if !matches!(self.phase, Phase::Loaded) {
            return Err(self.wrong_state("start"));
        }
        self.phase = Phase::Starting {
            until: at + COMMAND_LATENCY,
        };
        Ok(())
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.advance(at);
        let playback = match &self.phase {
            Phase::Playing(run) => run.playback(at),
            Phase::Starting { .. } => Playback::default(),
            // already on its way, already reported, or lost
            Phase::Stopping { .. } | Phase::Tripped | Phase::Silent => return Ok(()),
            _ => return Err(self.wrong_state("stop")),
        };
        self.phase = Phase::Stopping {
            until: at + COMMAND_LATENCY,
            playback,
        };
        Ok(())
    }

    fn limp(&mut self, at: Duration) {
        self.advance(at);
        if !matches!(self.phase, Phase::Tripped | Phase::Unplugged { .. }) {
            self.phase = Phase::Idle;
            self.loaded = None;
        }
        self.reports
            .retain(|r| matches!(r, Report::Fault(_) | Report::Lost(_) | Report::Ready));
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        self.advance(at);
        std::mem::take(&mut self.reports)
    }
}

impl Run {
    /// Runs the servo up to `at`: what it sampled, and how it ended if it did.
    fn advance(
        &mut self,
        at: Duration,
        realization: &Realization,
        options: &Options,
        decimation: u64,
    ) -> (Vec<Sample>, Option<Ending>) {
        let elapsed_s = at.saturating_sub(self.since).as_secs_f64();
        // whole periods that have passed; the hair keeps rounding out of it
        let due = (elapsed_s * options.servo_hz + 1e-6) as u64;
        let period_s = 1.0 / options.servo_hz;
        let what = Rendering {
            table: realization.table(),
            rule: realization.direction,
            range_mm: realization.trained.x_mm,
            trained_mm_s: realization.trained.v_mm_s,
        };
        let mut samples = Vec::new();
        while self.steps < due {
            if let Some((_, fault)) = self.strikes.filter(|(step, _)| *step <= self.steps) {
                let ending = self.strike(fault, period_s);
                return (samples, Some(ending));
            }
            let measured = self.sensor.read(self.hand.motion());
            let force_n = self.core.step(&what, measured);
            if let State::Tripped(why) = self.core.state() {
                return (samples, Some(Ending::Trip(why)));
            }
            if self.steps.is_multiple_of(decimation) {
                samples.push(Sample {
                    t_s: self.steps as f64 * period_s,
                    x_mm: measured.x_mm,
                    v_mm_s: measured.v_mm_s,
                    force_command_n: force_n,
                    force_measured_n: None,
                });
                self.samples += 1;
            }
            self.hand.step(force_n, period_s);
            self.steps += 1;
        }
        (samples, None)
    }

    fn strike(&mut self, fault: Injected, period_s: f64) -> Ending {
        match fault {
            Injected::Trip | Injected::RefuseLoad => {
                self.core.trip(Trip::Told);
                Ending::Trip(Trip::Told)
            }
            Injected::LosePlayback => Ending::Silence,
            Injected::Unplug => Ending::Unplugged {
                at: self.since + Duration::from_secs_f64(self.steps as f64 * period_s),
            },
        }
    }

    /// Strokes and clamps, if they are not what was told last.
    fn progress(&mut self) -> Option<Report> {
        let Tally {
            strokes, clamps, ..
        } = self.core.tally();
        if self.told == (strokes, clamps) {
            return None;
        }
        self.told = (strokes, clamps);
        Some(Report::Progress { strokes, clamps })
    }

    fn playback(&self, at: Duration) -> Playback {
        let tally = self.core.tally();
        let exploration_s = at.saturating_sub(self.since).as_secs_f64();
        Playback {
            exploration_s,
            strokes: tally.strokes,
            least_energy_j: tally.least_energy_j,
            switches_per_s: if exploration_s > 0.0 {
                tally.switches as f64 / exploration_s
            } else {
                0.0
            },
            clamp_count: tally.clamps,
            samples: self.samples,
            samples_lost: 0,
        }
    }
}

/// Encoder, speed from its differences, accelerometer.
#[derive(Debug)]
struct Sensor {
    x_mm: f64,
    v_mm_s: f64,
    servo_hz: f64,
    /// Of the one-pole low-pass, a period.
    share: f64,
}

impl Sensor {
    fn new(motion: Motion, servo_hz: f64) -> Self {
        Self {
            x_mm: quantised(motion.x_mm),
            v_mm_s: 0.0,
            servo_hz,
            share: 1.0 - libm::exp(-std::f64::consts::TAU * SPEED_HZ / servo_hz),
        }
    }

    fn read(&mut self, motion: Motion) -> Motion {
        let x_mm = quantised(motion.x_mm);
        let difference = (x_mm - self.x_mm) * self.servo_hz;
        self.v_mm_s += self.share * (difference - self.v_mm_s);
        self.x_mm = x_mm;
        Motion {
            x_mm,
            v_mm_s: self.v_mm_s,
            a_m_s2: motion.a_m_s2,
        }
    }
}

fn quantised(x_mm: f64) -> f64 {
    (x_mm / ENCODER_MM).round() * ENCODER_MM
}
