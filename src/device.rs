//! What plays a realization.
//!
//! [`Device`] never blocks: a command is asked for, and what came of it is
//! reported by a later [`Device::poll`]. Time is an argument, so the same device
//! runs on a virtual clock. The host never closes the force loop.
//!
//! [`wire`] is what host and device say to each other, in [`frame`]s.
//! [`virtual_device`] is the simulated one, in this process; [`core`] the servo
//! step that it shares with a firmware, [`table`] what it demands of a table,
//! [`faults`] what it can be told to do wrong. [`process`] is a child program of
//! the lab's, [`manual`] an experimenter who mounts samples.

pub mod check;
pub mod faults;
pub mod firmware;
pub mod host;
pub mod link;
pub mod manual;
pub mod probe;
pub mod process;
pub mod serial;
pub mod table;
pub mod virtual_device;

use std::time::Duration;
use study_base::limits::Limits;
use study_core::outcome::{Playback, Sample};
use study_haptics::model::Realization;

/// Who a device is and what it can do.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
    /// Names it in every file, such as `simulated-1`.
    pub id: String,
    /// Whether no motor and no hand is behind it.
    pub simulated: bool,
    /// Whether it reports samples while it plays.
    pub telemetry: bool,
    /// What it never exceeds, whatever is asked.
    pub limits: Limits,
}

/// Why a command was refused on the spot.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// The table cannot be played.
    #[error("the device refuses the table: {0}")]
    Refused(String),
    /// The command does not fit the device's state.
    #[error("the device cannot {command} while {state}")]
    WrongState {
        /// What was asked.
        command: &'static str,
        /// What it is doing.
        state: &'static str,
    },
    /// It does not answer.
    #[error("the device does not answer: {0}")]
    Lost(String),
}

/// What is to be played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stimulus<'a> {
    /// The realization's id. Never shown to anybody in the session.
    pub model: &'a str,
    /// Its table; a physical sample and a child program may do without.
    pub table: Option<&'a Realization>,
    /// What it is called towards people: opaque, see [`manual::codes`].
    pub code: &'a str,
    /// Whether a person mounts it.
    pub by_hand: bool,
    /// Whether a table that fails its certificate may be played: the device is
    /// armed for it explicitly.
    pub permitted: bool,
}

impl<'a> Stimulus<'a> {
    /// A table alone, permitted.
    pub fn of_table(table: &'a Realization) -> Self {
        Self {
            model: &table.id,
            table: Some(table),
            code: "",
            by_hand: false,
            permitted: true,
        }
    }

    /// The table, for a device that plays nothing else.
    ///
    /// # Errors
    /// [`DeviceError::Refused`] if there is none.
    pub fn need_table(&self) -> Result<&'a Realization, DeviceError> {
        let none = || DeviceError::Refused("the realization has no table".to_owned());
        self.table.ok_or_else(none)
    }
}

/// What a device says between two polls, in order.
#[derive(Debug, Clone, PartialEq)]
pub enum Report {
    /// The table is there and valid.
    Loaded,
    /// Instead of [`Report::Loaded`]: the sample with this code is to be mounted
    /// by a person, and started when that is done.
    Mount(String),
    /// It plays.
    Started,
    /// What it measured since the last report.
    Telemetry(Vec<Sample>),
    /// Full strokes and clamps so far.
    Progress {
        /// Full strokes.
        strokes: u32,
        /// Clamps.
        clamps: u64,
    },
    /// It has stopped and is limp.
    Stopped(Playback),
    /// It has tripped and is limp, latched until the next load.
    Fault(String),
    /// It does not answer any more.
    Lost(String),
    /// It is back, limp and ready for a table.
    Ready,
}

/// A playback device, real or simulated.
///
/// `at` is monotonic time since an origin of the caller's and never goes back.
pub trait Device: Send {
    /// Who it is.
    fn identity(&self) -> Identity;

    /// Sends what is to be played; [`Report::Loaded`] or [`Report::Mount`] follows.
    /// The device plays it under `limits`, or its own where they are lower.
    ///
    /// # Errors
    /// [`DeviceError`] if it cannot even be asked.
    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError>;

    /// Starts playing what is loaded; [`Report::Started`] follows.
    ///
    /// # Errors
    /// [`DeviceError`] if nothing is loaded.
    fn start(&mut self, at: Duration) -> Result<(), DeviceError>;

    /// Stops playing; [`Report::Stopped`] follows, unless a fault or a loss did
    /// before.
    ///
    /// # Errors
    /// [`DeviceError`] if it does not answer or nothing was started.
    fn stop(&mut self, at: Duration) -> Result<(), DeviceError>;

    /// Zero force at once. Cannot fail: a device that does not hear it goes limp
    /// by its own watchdog. Whatever was playing is lost without a report.
    fn limp(&mut self, at: Duration);

    /// What happened up to `at`.
    fn poll(&mut self, at: Duration) -> Vec<Report>;
}
