//! States, faults and refusals, each one byte on the wire.

use super::WireError;
use super::bytes::{Field, Reader, Writer};

/// Defines an enum with a byte code and a text for each value.
macro_rules! codes {
    ($(#[$about:meta])* $name:ident { $($(#[$what:meta])* $variant:ident = $code:literal, $text:literal;)+ }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub enum $name {
            $($(#[$what])* $variant = $code,)+
        }

        impl $name {
            /// Every value, in the order of the codes.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)+];

            /// The byte on the wire.
            pub fn code(self) -> u8 {
                self as u8
            }

            /// The value for a byte on the wire.
            pub fn from_code(code: u8) -> Option<Self> {
                match code {
                    $($code => Some(Self::$variant),)+
                    _ => None,
                }
            }

            /// Text for messages.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.as_str())
            }
        }

        impl Field for $name {
            const MAX_LEN: usize = 1;

            fn write(&self, out: &mut Writer) {
                self.code().write(out);
            }

            fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
                Self::from_code(u8::read(from)?).ok_or(WireError::Field)
            }
        }
    };
}

codes! {
    /// State of a device. There is force only in `Ramp` and `Run`.
    DeviceState {
        /// Powered up, no HELLO received.
        Boot = 0, "it has just started up";
        /// Nothing is loaded.
        Idle = 1, "nothing is loaded";
        /// A table or path is loaded and the watchdog runs.
        Loaded = 2, "a table is loaded";
        /// Playing with rising force, or approaching the first point of a path.
        Ramp = 3, "it starts to play";
        /// Playing at full force, or following a path.
        Run = 4, "it is playing";
        /// Zero force; the last samples are being sent.
        Stopping = 5, "it is stopping";
        /// Zero force, latched, by command or without a heartbeat.
        Limp = 6, "it is limp";
        /// Zero force, latched after a trip.
        Fault = 7, "it has tripped";
    }
}

impl DeviceState {
    /// Whether the motor may apply force.
    pub fn applies_force(self) -> bool {
        matches!(self, Self::Ramp | Self::Run)
    }

    /// Whether only REARM leads out of this state.
    pub fn latched(self) -> bool {
        matches!(self, Self::Limp | Self::Fault)
    }

    /// Whether the watchdog is active.
    pub fn armed(self) -> bool {
        matches!(self, Self::Loaded | Self::Ramp | Self::Run | Self::Stopping)
    }
}

codes! {
    /// Why a device is limp, or why the last playback ended.
    Fault {
        /// No fault.
        None = 0, "no fault";
        /// LIMP was sent.
        LimpCommand = 1, "stopped by the LIMP command";
        /// No fresh heartbeat for the watchdog time.
        Watchdog = 2, "no fresh heartbeat from the host";
        /// Another HELLO while something was armed.
        NewConnection = 3, "another connection was opened";
        /// Faster than the velocity limit.
        Velocity = 4, "velocity limit exceeded";
        /// Too far beyond the range.
        Stroke = 5, "stroke exceeded";
        /// A measured or computed value is not a number.
        NotANumber = 6, "a measured or computed value is not a number";
        /// The position jumped by more than the handle can move.
        Encoder = 7, "the encoder jumped";
        /// A servo period was missed.
        Overrun = 8, "the servo missed a period";
        /// The longest duration of the playback has passed. Not latched.
        Longest = 9, "the longest duration has passed";
        /// A button, a guard or the drive.
        External = 10, "stopped by the device's safety circuit";
        /// The probe does not follow its path.
        Following = 11, "the probe does not follow its path";
    }
}

codes! {
    /// Result of a request.
    Refusal {
        /// Done.
        None = 0, "done";
        /// The length or a field is invalid.
        Malformed = 1, "the message is malformed";
        /// The message type is unknown.
        UnknownType = 2, "the message type is unknown";
        /// The version is not supported; the detail is the supported one.
        Version = 3, "this version of the wire format is not supported";
        /// Not possible in this state.
        WrongState = 4, "not possible in this state";
        /// HELLO has not been received.
        NoHello = 5, "HELLO has to come first";
        /// More nodes or points than announced or than fit; the detail is the largest
        /// number.
        TooMany = 6, "more nodes or points than the device accepts";
        /// Not the next chunk; the detail is the expected node or point.
        Order = 7, "not the next chunk";
        /// Nodes or points are missing; the detail is the number received.
        Incomplete = 8, "nodes or points are missing";
        /// The CRC of the upload does not match; the detail is the device's.
        Checksum = 9, "the checksum of the upload does not match";
        /// The table or path cannot be evaluated; the detail is the node from 0.
        BadTable = 10, "the table cannot be evaluated";
        /// A limit is not finite and positive, or above the device's; the detail is
        /// 1 force, 2 velocity, 3 range, 4 stiffness, 5 damping.
        Limit = 11, "a limit is invalid or above the device's";
        /// The certificate fails and uncertified playback was not permitted; the
        /// detail is the condition: 1 mass, 2 damping, 3 hysteresis.
        Uncertified = 12, "the table fails its certificate";
        /// The handle is not at rest.
        Moving = 13, "the handle is not at rest";
        /// PLAY or RECORD names another table or path than the loaded one, whose CRC is
        /// the detail.
        OtherTable = 14, "another table is loaded";
        /// The longest duration is zero or above the device's, which is the detail, ms.
        Duration = 15, "the longest duration is zero or above the device's";
        /// The device has no probe mode.
        NoProbe = 16, "the device has no probe mode";
        /// STOP names another playback than the current one, which is the detail.
        OtherPlayback = 17, "another playback is in progress";
        /// The sequence number was used for another request.
        Reused = 18, "the sequence number was used for another request";
        /// No fresh heartbeat, so the host may be dead.
        NoHeartbeat = 19, "no fresh heartbeat";
    }
}

codes! {
    /// Kind of an EVENT.
    EventKind {
        /// A playback or recording has started.
        Started = 1, "started";
        /// It has ended and the force is zero.
        Stopped = 2, "stopped";
        /// The force is zero and the state is latched.
        Latched = 3, "latched";
    }
}

codes! {
    /// What is loaded.
    Loaded {
        /// Nothing.
        Nothing = 0, "nothing";
        /// A table for playback.
        Table = 1, "a table";
        /// A path for a recording.
        Path = 2, "a path";
    }
}
