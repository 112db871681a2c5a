//! The simulated device as a program drives it: host, line and firmware in virtual time, with
//! stalls, late reports and a look at its force.

use crate::bugs::Bug;
use crate::clock::SimClock;
use crate::disk::Death;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use study_base::limits::Limits;
use study_device::faults::FaultPlan;
use study_device::host::SUPERVISION_TIMEOUT;
use study_device::link::memory::Noise;
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, DeviceError, Identity, Report, Stimulus};
use study_wire::message::Fault;

/// The time after a Stop or a failure within which there is no force: that of docs/devices.md.
pub(crate) const LIMP_WITHIN: Duration = Duration::from_millis(50);
/// The same for a loop that stands still.
const LIMP_WITHIN_STANDSTILL: Duration = Duration::from_millis(150);
/// The virtual device has its own time, which is ahead by this.
const AHEAD: Duration = Duration::from_secs(1);

/// The device. Clones are the same one.
#[derive(Clone)]
pub(crate) struct SimDevice(Arc<Mutex<Own>>);

struct Own {
    device: VirtualDevice,
    clock: SimClock,
    death: Death,
    bug: Option<Bug>,
    /// When the program last called.
    called: Duration,
    /// Reports that the program has not heard, and until when telemetry is among them.
    held: Vec<Report>,
    held_until: Duration,
    playbacks: u32,
    wrong: Option<String>,
}

impl SimDevice {
    /// A device that is connected. `faults` is the probability of a fault in a playback, and
    /// `uneven` that of a piece on the line that comes late or twice.
    pub(crate) fn new(
        seed: u64,
        clock: &SimClock,
        death: &Death,
        bug: Option<Bug>,
        (faults, uneven): (f64, f64),
    ) -> Self {
        let mut options = Options::seeded(seed);
        options.device.servo_hz = 2000.0;
        options.device.telemetry_hz = 50.0;
        options.faults = FaultPlan::random(seed, faults);
        options.noise = Noise {
            delay: uneven,
            duplicate: uneven,
            drop_telemetry: uneven,
            extra_delay: Duration::from_millis(3),
            ..Noise::default()
        };
        options.supervision_timeout = match bug {
            Some(Bug::Unsupervised) => None,
            _ => Some(SUPERVISION_TIMEOUT),
        };
        Self(Arc::new(Mutex::new(Own {
            device: VirtualDevice::new(options),
            clock: clock.clone(),
            death: death.clone(),
            bug,
            called: clock.real(),
            held: Vec::new(),
            held_until: Duration::ZERO,
            playbacks: 0,
            wrong: None,
        })))
    }

    fn own(&self) -> MutexGuard<'_, Own> {
        self.0.lock().unwrap()
    }

    /// Whether it drives the hand now.
    pub(crate) fn has_force(&self) -> bool {
        self.own().device.firmware().state().applies_force()
    }

    /// What it has done that it may not do.
    pub(crate) fn wrong(&self) -> Option<String> {
        self.own().wrong.take()
    }

    /// Number of playbacks that have started.
    pub(crate) fn playbacks(&self) -> u32 {
        self.own().playbacks
    }

    /// It trips, as by its emergency switch.
    pub(crate) fn trip(&self) {
        self.own().device.trip(Fault::External);
    }

    /// Its processor hangs.
    pub(crate) fn hang(&self, lasting: Duration) {
        let mut own = self.own();
        let at = own.clock.real() + AHEAD;
        own.device.firmware().stall(at, lasting);
    }

    /// Its telemetry comes late.
    pub(crate) fn hold(&self, lasting: Duration) {
        let mut own = self.own();
        own.held_until = own.clock.real() + lasting;
    }

    /// The program has died: whether the device is limp soon after.
    pub(crate) fn is_limp_without_host(&self) -> bool {
        let mut own = self.own();
        let by = own.clock.real() + AHEAD + LIMP_WITHIN;
        own.device.firmware().advance(by);
        !own.device.firmware().state().applies_force()
    }
}

impl Own {
    /// Real time, with everything that happened until then. A standstill of the program is not
    /// seen by the host, which polls only now.
    fn now(&mut self) -> Duration {
        let now = self.clock.real();
        let still = now.saturating_sub(self.called);
        self.called = now;
        if still > LIMP_WITHIN_STANDSTILL {
            let reports = self.device.poll(now);
            self.held.extend(reports);
            if self.device.firmware().state().applies_force() {
                self.wrong = Some(format!("there is force after a standstill of {still:?}"));
            }
        }
        now
    }
}

impl Device for SimDevice {
    fn identity(&self) -> Identity {
        self.own().device.identity()
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        _: Duration,
    ) -> Result<(), DeviceError> {
        let mut own = self.own();
        own.ask(|device, now| device.load(what, limits, now))
    }

    fn start(&mut self, _: Duration) -> Result<(), DeviceError> {
        self.own().ask(|device, now| device.start(now))
    }

    fn stop(&mut self, _: Duration) -> Result<(), DeviceError> {
        self.own().ask(|device, now| device.stop(now))
    }

    fn fade(&mut self, _: Duration) -> Result<(), DeviceError> {
        self.own().ask(|device, now| device.fade(now))
    }

    fn limp(&mut self, _: Duration) {
        let mut own = self.own();
        if own.bug == Some(Bug::DeafDevice) {
            return;
        }
        // Nothing can be done if the program is dead.
        let _ = own.ask(|device, now| {
            device.limp(now);
            Ok(())
        });
        let survives =
            |report: &Report| matches!(report, Report::Fault(_) | Report::Lost(_) | Report::Ready);
        own.held.retain(survives);
    }

    fn poll(&mut self, _: Duration) -> Vec<Report> {
        let mut own = self.own();
        if own.death.is_here() {
            return Vec::new();
        }
        let now = own.now();
        let reports = own.device.poll(now);
        let started = reports.iter().filter(|r| **r == Report::Started).count();
        own.playbacks += u32::try_from(started).unwrap();
        own.held.extend(reports);
        let can_wait =
            |report: &Report| matches!(report, Report::Telemetry(_) | Report::Progress { .. });
        match now < own.held_until && own.held.iter().all(can_wait) {
            true => Vec::new(),
            false => std::mem::take(&mut own.held),
        }
    }
}

impl Own {
    /// Gives a command, unless the program is dead.
    fn ask(
        &mut self,
        command: impl FnOnce(&mut VirtualDevice, Duration) -> Result<(), DeviceError>,
    ) -> Result<(), DeviceError> {
        if self.death.is_here() {
            return Err(DeviceError::Lost("the program is dead".to_owned()));
        }
        let now = self.now();
        command(&mut self.device, now)
    }
}
