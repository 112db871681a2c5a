//! Playback devices, the host's side.
//!
//! A [`Device`] never blocks: a command returns at once, and a later [`Device::poll`]
//! reports the result. Time is an argument, so a device also runs on a virtual clock.
//! The host never closes the force loop.
//!
//! - [`host`] is the host's side of the wire format, [`link`] runs it on a link, and
//!   [`serial`] opens serial ports.
//! - [`virtual_device`] is the simulated device in virtual time, [`firmware`] its
//!   device side, and [`faults`] the faults that can be injected.
//! - [`process`] is a controller program of the lab, [`manual`] an experimenter who
//!   mounts samples, [`sending`] a simulated program that sends numbers of a study.
//! - [`table`] checks tables before they are sent, [`commission`] has what a person checks of a
//!   device, [`check`] tests a device against
//!   `docs/wire.md`, and [`probe`] records with a probe.

pub mod check;
pub mod commission;
pub mod faults;
pub mod firmware;
pub mod host;
pub mod link;
pub mod manual;
pub mod probe;
pub mod process;
pub mod sending;
pub mod serial;
pub mod table;
pub mod virtual_device;

use std::time::Duration;
use study_base::limits::Limits;
use study_haptics::model::Realization;
use study_session::outcome::{Playback, Sample, SentNumber};
use study_wire::servo::{self, Law, ServoSettings};

/// Identity and limits of a device.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
    /// Name of the device in every file, such as `simulated-1`.
    pub id: String,
    /// Whether it is simulated, without motor and hand.
    pub simulated: bool,
    /// Whether it reports samples during playback.
    pub telemetry: bool,
    /// Whether it numbers them, so that it is known which are lost; a program does not.
    pub numbered: bool,
    /// Limits that it never exceeds.
    pub limits: Limits,
    /// The constants of its servo, if it tells them.
    pub servo: Option<ServoSettings>,
    /// Whether it plays mechanisms, and not only tables.
    pub mechanisms: bool,
    /// Whether it plays elements.
    pub elements: bool,
    /// Largest stiffness of a certified realization, N/mm, if it tells.
    pub stiffness_n_per_mm: Option<f64>,
    /// Largest damping of a certified realization, N·s/mm, if it tells.
    pub damping_n_s_per_mm: Option<f64>,
    /// Positions that its handle can reach, mm, if it tells.
    pub stroke_mm: Option<[f64; 2]>,
    /// The version of its firmware, or of a program, if it tells it.
    pub firmware: Option<String>,
}

/// Why a command was refused immediately.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// The table cannot be played.
    #[error("the device refuses the table: {0}")]
    Refused(String),
    /// The command is not possible in the device's state.
    #[error("the device cannot {command} while {state}")]
    WrongState {
        /// The command.
        command: &'static str,
        /// The state of the device.
        state: &'static str,
    },
    /// The device does not answer.
    #[error("the device does not answer: {0}")]
    Lost(String),
}

/// What a device has to play.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stimulus<'a> {
    /// Id of the realization. Never shown during a session.
    pub model: &'a str,
    /// Table of the realization; optional for physical samples and controller programs.
    pub table: Option<&'a Realization>,
    /// Opaque code shown to people, see [`manual::codes`].
    pub code: &'a str,
    /// Whether a person mounts it.
    pub by_hand: bool,
    /// Whether a table that fails its certificate may be played.
    pub allow_uncertified: bool,
}

/// A realization as a servo plays it.
pub fn rendering_of(table: &Realization) -> servo::Rendering<'_> {
    let law = match (&table.mechanism, &table.elements) {
        (Some(mechanism), _) => Law::Mechanism(mechanism.view()),
        (None, Some(elements)) => Law::Elements(elements.view()),
        (None, None) => Law::Table {
            table: table.table(),
            rule: table.direction,
        },
    };
    servo::Rendering {
        law,
        range_mm: table.trained.x_mm,
        trained_mm_s: table.trained.v_mm_s,
    }
}

impl<'a> Stimulus<'a> {
    /// A table alone, also an uncertified one.
    pub fn of_table(table: &'a Realization) -> Self {
        Self {
            model: &table.id,
            table: Some(table),
            code: "",
            by_hand: false,
            allow_uncertified: true,
        }
    }

    /// The table, for a device that plays only tables.
    ///
    /// # Errors
    /// [`DeviceError::Refused`] if there is none.
    pub fn need_table(&self) -> Result<&'a Realization, DeviceError> {
        let none = || DeviceError::Refused("the realization has no table".to_owned());
        self.table.ok_or_else(none)
    }
}

/// A report of a device. [`Device::poll`] returns reports in order.
#[derive(Debug, Clone, PartialEq)]
pub enum Report {
    /// The stimulus is loaded.
    Loaded,
    /// Instead of [`Report::Loaded`]: a person has to mount the sample with this code
    /// before the playback is started.
    Mount(String),
    /// The playback has started.
    Started,
    /// Samples since the last report.
    Telemetry(Vec<Sample>),
    /// Totals of the playback so far.
    Progress {
        /// Full strokes.
        strokes: u32,
        /// Clamps.
        clamps: u64,
    },
    /// The force of the playback fell to zero before it stopped; [`Report::Stopped`] follows.
    Faded {
        /// From when it fell, in the time of the samples, s.
        from_s: f64,
    },
    /// A controller program sends numbers, such as the time that a task took.
    Numbers {
        /// As they were sent.
        numbers: Vec<SentNumber>,
        /// Whether they belong to no playback under way: they came before or after it.
        outside: bool,
    },
    /// The playback has stopped and the device is limp.
    Stopped(Playback),
    /// The device has tripped and is limp until the next load.
    Fault(String),
    /// The device no longer answers.
    Lost(String),
    /// The device answers again, limp and without a table.
    Ready,
}

impl Report {
    /// Whether the report is still valid after [`Device::limp`]; reports about the
    /// interrupted playback are not, but for numbers, which are recorded whatever became of it.
    fn survives_limp(&self) -> bool {
        matches!(
            self,
            Self::Fault(_) | Self::Lost(_) | Self::Ready | Self::Numbers { .. }
        )
    }
}

/// A playback device, real or simulated.
///
/// `at` is monotonic time since an origin chosen by the caller.
pub trait Device: Send {
    /// Identity and limits.
    fn identity(&self) -> Identity;

    /// Loads a stimulus; [`Report::Loaded`] or [`Report::Mount`] follows. The lower of
    /// `limits` and the device's own limits apply.
    ///
    /// # Errors
    /// [`DeviceError`] if the command cannot be sent.
    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError>;

    /// How long a load of this stimulus usually takes, as far as the device and the rate of its
    /// line tell; `None` if nothing tells.
    fn load_time(&self, _what: &Stimulus<'_>, _limits: Limits) -> Option<Duration> {
        None
    }

    /// Starts playing the loaded stimulus; [`Report::Started`] follows.
    ///
    /// # Errors
    /// [`DeviceError`] if nothing is loaded.
    fn start(&mut self, at: Duration) -> Result<(), DeviceError>;

    /// Stops playing; [`Report::Stopped`] follows, unless a fault or a loss was
    /// reported before.
    ///
    /// # Errors
    /// [`DeviceError`] if the device does not answer or nothing was started.
    fn stop(&mut self, at: Duration) -> Result<(), DeviceError>;

    /// Stops playing without a step of the force, which falls to zero before, on a device that can
    /// do so in 1.5 s; [`Report::Faded`] then precedes [`Report::Stopped`]. Other devices stop at once.
    /// [`Device::stop`] and [`Device::limp`] end the fall at once.
    ///
    /// # Errors
    /// As of [`Device::stop`].
    fn fade(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.stop(at)
    }

    /// Switches the force off at once. This cannot fail: a device that does not receive
    /// it goes limp by its watchdog. The playback is lost without a report.
    fn limp(&mut self, at: Duration);

    /// Reports of everything that happened up to `at`.
    fn poll(&mut self, at: Duration) -> Vec<Report>;
}
