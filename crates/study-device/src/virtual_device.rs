//! The simulated device in virtual time: a [`Host`], a simulated line in each
//! direction, and the simulated [`Firmware`].
//!
//! The bytes are the same as on a serial port. All reports follow from the options, the
//! tables and the times of the calls. The frequency of polling has no influence, because
//! everything happens at whole milliseconds. A jump of virtual time does not count as a
//! stalled user interface unless [`Options::supervision_timeout`] is set.
//!
//! `docs/simulation.md` gives parameters and formulas. Nothing in the reports is
//! measured.

use super::faults::{FaultPlan, InjectedFault, PlannedFault};
use super::firmware::{self, Firmware};
use super::host::{self, Health, Host, HostSettings};
use super::link::memory::{Line, Noise, Pace};
use super::{Device, DeviceError, Identity, Report, Stimulus};
use std::time::Duration;
use study_base::limits::Limits;
use study_wire::message::Fault;

/// Latency in each direction, about that of a USB serial adapter.
const LATENCY: Duration = Duration::from_micros(500);
/// Everything happens at multiples of this step.
const STEP: Duration = Duration::from_millis(1);
/// The device is powered up and connected this long before time zero.
const POWER_UP_LEAD: Duration = Duration::from_secs(1);
/// How long the cable is unplugged.
const UNPLUGGED_FOR: Duration = Duration::from_secs(2);
/// How long the line is dead after a lost playback.
const DEAD_FOR: Duration = Duration::from_millis(1500);

/// Options of a simulated device. Without faults by default.
#[derive(Debug, Default)]
pub struct Options {
    /// The device side; its telemetry rate is also the one that is requested.
    pub device: firmware::Options,
    /// Injected faults of the device.
    pub faults: FaultPlan,
    /// Injected faults of the line, in both directions.
    pub noise: Noise,
    /// How fast the line is, in both directions.
    pub pace: Pace,
    /// See [`HostSettings::supervision_timeout`].
    pub supervision_timeout: Option<Duration>,
}

impl Options {
    /// The defaults with a seed of the device.
    pub fn seeded(seed: u64) -> Self {
        let mut options = Self::default();
        options.device.seed = seed;
        options
    }
}

/// The simulated device.
#[derive(Debug)]
pub struct VirtualDevice {
    host: Host,
    firmware: Firmware,
    to_device: Line,
    to_host: Line,
    faults: FaultPlan,
    loads: u32,
    /// Fault of the present load, until its playback starts.
    planned_fault: Option<PlannedFault>,
    /// Fault of the present playback and its time.
    fault_at: Option<(Duration, InjectedFault)>,
    /// When the cable is plugged in again, or the line works again.
    dead_until: Option<Duration>,
    unplugged: bool,
    pace: Pace,
    /// Current time of the simulation, [`POWER_UP_LEAD`] ahead of the caller's time.
    now: Duration,
    reports: Vec<Report>,
}

impl VirtualDevice {
    /// A connected device, limp and without a table.
    pub fn new(options: Options) -> Self {
        let telemetry_hz = options.device.telemetry_hz.max(0.1);
        let settings = HostSettings {
            supervision_timeout: options.supervision_timeout,
            telemetry_hz,
        };
        let line = |name| Line::new(LATENCY, Noise::default(), options.device.seed, name);
        let mut device = Self {
            host: Host::new(0, settings),
            to_device: line("there"),
            to_host: line("back"),
            firmware: Firmware::new(firmware::Options {
                telemetry_hz,
                ..options.device
            }),
            faults: options.faults,
            loads: 0,
            planned_fault: None,
            fault_at: None,
            dead_until: None,
            unplugged: false,
            pace: options.pace,
            now: Duration::ZERO,
            reports: Vec::new(),
        };
        device.to_device.set_pace(options.pace);
        device.to_host.set_pace(options.pace);
        device.host.connected(device.now);
        device.pump();
        device.run(POWER_UP_LEAD);
        // The first connection is not reported.
        device.reports.clear();
        device.to_device.set_noise(options.noise);
        device.to_host.set_noise(options.noise);
        device
    }

    /// The commanded force, N; zero unless it is playing.
    pub fn held_n(&self) -> f64 {
        self.firmware.held_n()
    }

    /// The device side, whose handle somebody can hold, let go or pull.
    pub fn firmware(&mut self) -> &mut Firmware {
        &mut self.firmware
    }

    /// Trips the device now, as by its emergency switch.
    pub fn trip(&mut self, fault: Fault) {
        self.firmware.trip(fault, self.now);
    }

    /// Quality of the link.
    pub fn health(&self) -> &Health {
        self.host.health()
    }

    /// Simulates up to `until`, on the simulation's time.
    fn run(&mut self, until: Duration) {
        loop {
            let next = self.now + STEP;
            let next = if self.host.armed() {
                next
            } else {
                next.max(round_up(self.due().map_or(until, |due| due.min(until))))
            };
            if next > until {
                // Nothing happens until then.
                self.now = self.now.max(round_up(until.saturating_sub(STEP)));
                return;
            }
            self.now = next;
            self.step();
        }
    }

    /// When something happens next while nothing is playing; `None` if nothing is due.
    fn due(&self) -> Option<Duration> {
        let lines = [self.to_device.next(), self.to_host.next()];
        let all = lines.into_iter().chain([self.host.next(), self.dead_until]);
        all.flatten().min()
    }

    fn step(&mut self) {
        let now = self.now;
        if let Some((_, fault)) = self.fault_at.take_if(|(at, _)| *at <= now) {
            self.inject(fault);
        }
        if self.dead_until.take_if(|at| *at <= now).is_some() {
            self.to_device.set_dead(false);
            self.to_host.set_dead(false);
            if std::mem::take(&mut self.unplugged) {
                self.host.connected(now);
            }
        }
        let bytes = self.to_device.arrived(now);
        self.firmware.receive(&bytes, now);
        self.to_host.send(self.firmware.take_output(), now);
        let bytes = self.to_host.arrived(now);
        self.host.receive(&bytes, now);
        self.host.advance(now);
        self.pump();
    }

    /// Sends the host's bytes and collects its reports.
    fn pump(&mut self) {
        self.to_device.send(self.host.take_output(), self.now);
        for report in self.host.take_reports() {
            if report == Report::Started
                && let Some(planned) = self.planned_fault.take()
            {
                let after = Duration::from_secs_f64(planned.after_s);
                self.fault_at = Some((self.now + after, planned.fault));
            }
            self.reports.push(report);
        }
    }

    fn inject(&mut self, fault: InjectedFault) {
        match fault {
            InjectedFault::Trip | InjectedFault::RefuseLoad => {
                self.firmware.trip(Fault::External, self.now)
            }
            InjectedFault::LosePlayback => self.kill_lines(DEAD_FOR),
            InjectedFault::Unplug => {
                self.kill_lines(UNPLUGGED_FOR);
                self.unplugged = true;
                self.host.disconnected("unplugged");
            }
        }
    }

    fn kill_lines(&mut self, time: Duration) {
        self.to_device.set_dead(true);
        self.to_host.set_dead(true);
        self.dead_until = Some(self.now + time);
    }

    /// Executes a command at `at`, after simulating everything before it.
    fn command<T>(&mut self, at: Duration, command: impl FnOnce(&mut Host, Duration) -> T) -> T {
        let at = at + POWER_UP_LEAD;
        self.run(at);
        self.host.keep_alive(at);
        // The command's bytes are sent now, even between two steps.
        let step = self.now;
        self.now = at.max(step);
        let done = command(&mut self.host, self.now);
        self.pump();
        self.now = step;
        done
    }
}

/// The next multiple of [`STEP`].
fn round_up(at: Duration) -> Duration {
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
            numbered: true,
            limits: firmware::Options::default().limits,
            servo: None,
            mechanisms: true,
            elements: true,
            stiffness_n_per_mm: None,
            damping_n_s_per_mm: None,
            stroke_mm: None,
            firmware: None,
        })
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        self.loads += 1;
        self.planned_fault = self.faults.for_load(self.loads);
        self.fault_at = None;
        let planned = self.planned_fault.map(|planned| planned.fault);
        if planned == Some(InjectedFault::RefuseLoad) {
            return Err(DeviceError::Refused("an injected fault".to_owned()));
        }
        self.command(at, |host, at| host.load(what, limits, at))
    }

    fn load_time(&self, what: &Stimulus<'_>, limits: Limits) -> Option<Duration> {
        // The default line is faster than any slot.
        if self.pace == Pace::default() {
            return None;
        }
        let trip = self.host.health().trips.usual()?;
        host::load_time(self.host.device()?, what, limits, trip, self.pace.byte_time)
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.command(at, Host::start)
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.command(at, Host::stop)
    }

    fn fade(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.command(at, Host::fade)
    }

    fn limp(&mut self, at: Duration) {
        self.fault_at = None;
        self.command(at, Host::limp);
        self.reports.retain(Report::survives_limp);
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        let until = at + POWER_UP_LEAD;
        self.run(until);
        self.host.keep_alive(until);
        std::mem::take(&mut self.reports)
    }
}
