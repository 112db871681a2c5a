//! Unsolicited messages of a device: TELEMETRY, EVENT, RECORDED.
//!
//! They are neither acknowledged nor repeated. Samples are numbered from the start
//! of the playback, so that a host can count lost ones.

use super::FixedVec;
use super::bytes::fields;
use super::code::{DeviceState, EventKind, Fault};

fields! {
    /// One servo period of a playback. See [`super::fixed`] for the units.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    TelemetrySample {
        /// Servo periods since the start.
        tick: u32;
        /// Position, nm.
        x_nm: i32;
        /// Speed, µm/s.
        v_um_s: i32;
        /// Commanded force, µN, after every limit.
        command_un: i32;
        /// Measured force, µN; `None` without a force sensor.
        measured_un: Option<i32>;
    }
}

fields! {
    /// Consecutive samples of a playback.
    #[derive(Debug, Clone, Copy, PartialEq)]
    Telemetry {
        /// The host's number of the playback.
        playback: u32;
        /// Number of earlier samples of this playback, received or lost.
        first: u32;
        /// Clock of the device when the last of the samples was taken, ms, wrapping.
        clock_ms: u32;
        /// Full strokes so far.
        strokes: u32;
        /// Clamps so far.
        clamps: u32;
        /// One to ten.
        samples: FixedVec<TelemetrySample, { Telemetry::MAX_SAMPLES }>;
    }
}

fields! {
    /// A change of state. If it is lost, the next PULSE or OUTCOME shows the same.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    Event {
        /// Kind of the event.
        kind: EventKind;
        /// State of the device after the event.
        state: DeviceState;
        /// Cause of the event.
        fault: Fault;
        /// The host's number of the playback.
        playback: u32;
        /// Servo periods since the start of the playback.
        tick: u32;
        /// Clock of the device, ms, wrapping.
        clock_ms: u32;
    }
}

fields! {
    /// Measurement of the probe at one point of its path.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    RecordedPoint {
        /// Position, nm.
        x_nm: i32;
        /// Force that the probe applies, µN; `None` without a force sensor.
        force_un: Option<i32>;
        /// Acceleration, µm/s².
        a_um_s2: i32;
    }
}

fields! {
    /// Consecutive samples of a recording; sample n belongs to point n of the path.
    #[derive(Debug, Clone, Copy, PartialEq)]
    Recorded {
        /// The host's number of the recording.
        playback: u32;
        /// Number of the first sample, from 0.
        first: u32;
        /// Clock of the device when the last of the samples was taken, ms, wrapping.
        clock_ms: u32;
        /// One to 18.
        points: FixedVec<RecordedPoint, { Recorded::MAX_POINTS }>;
    }
}

impl Telemetry {
    /// Largest number of samples in one message.
    pub const MAX_SAMPLES: usize = 10;
}

impl Recorded {
    /// Largest number of samples in one message.
    pub const MAX_POINTS: usize = 18;
}
