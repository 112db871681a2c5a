//! The simulated device in this process, in virtual time: the host's side of the
//! wire, a line of memory, and the simulated device's side at its end.
//!
//! The bytes are those of a serial port. What it measures, plays and reports follows
//! from its options, the tables and the instants it is called at; how often it is
//! polled changes nothing, because everything in between happens at whole
//! milliseconds. A jump of virtual time is no stalled screen, unless
//! [`Options::stall`] says that it is.
//!
//! Parameters and formulas are in `docs/simulation.md`. Nothing it reports is
//! measured.

use super::faults::{Fate, FaultPlan, Injected};
use super::firmware::{self, Firmware};
use super::host::{Health, Host, Settings};
use super::link::memory::{Line, Noise};
use super::{Device, DeviceError, Identity, Report, Stimulus};
use std::time::Duration;
use study_base::limits::Limits;
use study_haptics::plant::HandParameters;
use study_wire::message::Fault;

/// Each way: about what a USB serial adapter takes.
const LATENCY: Duration = Duration::from_micros(500);
/// Everything happens at multiples of it.
const STEP: Duration = Duration::from_millis(1);
/// The device is powered up and greeted so long before the beginning.
const BEFORE: Duration = Duration::from_secs(1);
/// How long a cable is out.
const UNPLUGGED: Duration = Duration::from_secs(2);
/// How long the line is dead when a playback is lost.
const DEAD: Duration = Duration::from_millis(1500);

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
    /// What the line does wrong on purpose, both ways.
    pub noise: Noise,
    /// Without a poll for so long the screen counts as stalled; `None`: never.
    pub stall: Option<Duration>,
    /// Hand and slider.
    pub hand: HandParameters,
    /// Smallest mass that is rendered, kg: minus infinity plays every table as it
    /// is, which no hand may be able to hold.
    pub least_mass_kg: f64,
}

impl Default for Options {
    /// That of [`firmware::Options`], 1 kHz telemetry, no faults.
    fn default() -> Self {
        let device = firmware::Options::default();
        Self {
            seed: device.seed,
            servo_hz: device.servo_hz,
            telemetry_hz: 1000.0,
            limits: device.limits,
            faults: FaultPlan::none(),
            noise: Noise::default(),
            stall: None,
            hand: device.hand,
            least_mass_kg: device.least_mass_kg,
        }
    }
}

/// The simulated device.
#[derive(Debug)]
pub struct VirtualDevice {
    host: Host,
    firmware: Firmware,
    there: Line,
    back: Line,
    faults: FaultPlan,
    loads: u32,
    /// What the present load meets.
    fate: Option<Fate>,
    /// When its playback meets it.
    strikes: Option<(Duration, Injected)>,
    /// When the cable is put back, or the line heals.
    heals: Option<Duration>,
    unplugged: bool,
    /// How far everything has come, on the device's time: [`BEFORE`] ahead.
    now: Duration,
    reports: Vec<Report>,
}

impl VirtualDevice {
    /// A device that is limp and waits for a table.
    pub fn new(options: Options) -> Self {
        let telemetry_hz = options.telemetry_hz.max(0.1);
        let host = Host::new(
            0,
            Settings {
                stall: options.stall,
                telemetry_hz,
            },
        );
        let firmware = Firmware::new(firmware::Options {
            seed: options.seed,
            servo_hz: options.servo_hz,
            telemetry_hz,
            limits: options.limits,
            hand: options.hand,
            least_mass_kg: options.least_mass_kg,
            ..firmware::Options::default()
        });
        let line = |name| Line::new(LATENCY, Noise::default(), options.seed, name);
        let mut device = Self {
            host,
            firmware,
            there: line("there"),
            back: line("back"),
            faults: options.faults,
            loads: 0,
            fate: None,
            strikes: None,
            heals: None,
            unplugged: false,
            now: Duration::ZERO,
            reports: Vec::new(),
        };
        device.host.linked(device.now);
        device.pump();
        device.run(BEFORE);
        // that it is there is no news
        device.reports.clear();
        device.there.set_noise(options.noise);
        device.back.set_noise(options.noise);
        device
    }

    /// The force that it holds, N; zero unless it plays.
    pub fn held_n(&self) -> f64 {
        self.firmware.held_n()
    }

    /// What the link has been like.
    pub fn health(&self) -> &Health {
        self.host.health()
    }

    /// Lets time pass up to `until`, on the device's time.
    fn run(&mut self, until: Duration) {
        loop {
            let next = self.now + STEP;
            let next = if self.host.armed() {
                next
            } else {
                next.max(whole(self.due().min(until)))
            };
            if next > until {
                // nothing happens until then
                self.now = self.now.max(whole(until.saturating_sub(STEP)));
                return;
            }
            self.now = next;
            self.step();
        }
    }

    /// When something happens next while nothing plays.
    fn due(&self) -> Duration {
        [
            self.host.next(),
            self.there.next(),
            self.back.next(),
            self.heals.unwrap_or(Duration::MAX),
        ]
        .into_iter()
        .min()
        .unwrap_or(Duration::MAX)
    }

    fn step(&mut self) {
        let now = self.now;
        if let Some((_, fault)) = self.strikes.take_if(|(at, _)| *at <= now) {
            self.strike(fault);
        }
        if self.heals.take_if(|at| *at <= now).is_some() {
            self.there.set_dead(false);
            self.back.set_dead(false);
            if std::mem::take(&mut self.unplugged) {
                self.host.linked(now);
            }
        }
        let bytes = self.there.arrived(now);
        self.firmware.receive(&bytes, now);
        self.back.send(self.firmware.take_output(), now);
        let bytes = self.back.arrived(now);
        self.host.receive(&bytes, now);
        self.host.advance(now);
        self.pump();
    }

    /// What the host has to say goes onto the line, and to whoever polls.
    fn pump(&mut self) {
        self.there.send(self.host.take_output(), self.now);
        for report in self.host.take_reports() {
            if report == Report::Started
                && let Some(fate) = self.fate.take()
            {
                let after = Duration::from_secs_f64(fate.after_s);
                self.strikes = Some((self.now + after, fate.fault));
            }
            self.reports.push(report);
        }
    }

    fn strike(&mut self, fault: Injected) {
        match fault {
            Injected::Trip | Injected::RefuseLoad => self.firmware.trip(Fault::External, self.now),
            Injected::LosePlayback => {
                self.there.set_dead(true);
                self.back.set_dead(true);
                self.heals = Some(self.now + DEAD);
            }
            Injected::Unplug => {
                self.there.set_dead(true);
                self.back.set_dead(true);
                self.unplugged = true;
                self.host.unlinked("unplugged");
                self.heals = Some(self.now + UNPLUGGED);
            }
        }
    }

    /// Takes a command at `at`: everything before it has happened.
    fn command<T>(&mut self, at: Duration, command: impl FnOnce(&mut Host, Duration) -> T) -> T {
        let at = at + BEFORE;
        self.run(at);
        self.host.fed(at);
        // between two steps: its bytes go now
        let step = self.now;
        self.now = at.max(step);
        let done = command(&mut self.host, self.now);
        self.pump();
        self.now = step;
        done
    }
}

/// The next multiple of [`STEP`].
fn whole(at: Duration) -> Duration {
    let step = STEP.as_nanos() as u64;
    let steps = at.as_nanos().div_ceil(u128::from(step));
    Duration::from_nanos((steps as u64).saturating_mul(step))
}

impl Device for VirtualDevice {
    fn identity(&self) -> Identity {
        self.host.identity().unwrap_or_else(|| Identity {
            id: "simulated".to_owned(),
            simulated: true,
            telemetry: true,
            limits: firmware::Options::default().limits,
        })
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        self.loads += 1;
        self.fate = self.faults.fate(self.loads);
        self.strikes = None;
        if self
            .fate
            .is_some_and(|fate| fate.fault == Injected::RefuseLoad)
        {
            return Err(DeviceError::Refused("an injected fault".to_owned()));
        }
        self.command(at, |host, at| host.load(what, limits, at))
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.command(at, Host::start)
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.command(at, Host::stop)
    }

    fn limp(&mut self, at: Duration) {
        self.strikes = None;
        self.command(at, Host::limp);
        self.reports
            .retain(|r| matches!(r, Report::Fault(_) | Report::Lost(_) | Report::Ready));
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        let until = at + BEFORE;
        self.run(until);
        self.host.fed(until);
        std::mem::take(&mut self.reports)
    }
}
