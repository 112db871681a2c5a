//! States, faults and refusals: one byte each on the wire.

/// An enum whose values are bytes on the wire, each with its words.
macro_rules! codes {
    ($(#[$about:meta])* $name:ident { $($(#[$what:meta])* $variant:ident = $code:literal, $words:literal;)+ }) => {
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

            /// From the byte on the wire.
            pub fn from_code(code: u8) -> Option<Self> {
                match code {
                    $($code => Some(Self::$variant),)+
                    _ => None,
                }
            }

            /// In words.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $words,)+
                }
            }
        }
    };
}

codes! {
    /// What a device is doing. Force is other than zero in `Ramp` and `Run` only.
    State {
        /// Just powered up; nobody has said HELLO.
        Boot = 0, "it has just started up";
        /// Nothing is loaded.
        Idle = 1, "nothing is loaded";
        /// A table or path is loaded and the watchdog runs.
        Loaded = 2, "a table is loaded";
        /// Playing, and the force is coming up.
        Ramp = 3, "it starts to play";
        /// Playing at full force.
        Run = 4, "it plays";
        /// Zero force; the last samples are on their way.
        Stopping = 5, "it is about to stop";
        /// Zero force, latched: told so, or the host was not heard.
        Limp = 6, "it is limp";
        /// Zero force, latched: it has tripped.
        Fault = 7, "it has tripped";
    }
}

impl State {
    /// Whether the motor may give force.
    pub fn forceful(self) -> bool {
        matches!(self, Self::Ramp | Self::Run)
    }

    /// Whether only REARM leads on.
    pub fn latched(self) -> bool {
        matches!(self, Self::Limp | Self::Fault)
    }

    /// Whether the watchdog runs.
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
        Told = 1, "told to be limp";
        /// No fresh heartbeat for the watchdog time.
        Watchdog = 2, "no fresh heartbeat from the host";
        /// Another HELLO while something was armed.
        NewConnection = 3, "another connection was opened";
        /// Faster than the velocity limit.
        Velocity = 4, "velocity limit exceeded";
        /// Further than the wall lets anything come.
        Stroke = 5, "stroke exceeded";
        /// A measured or computed value is not a number.
        NotANumber = 6, "a measured or computed value is not a number";
        /// The encoder jumped further than the handle can move.
        Encoder = 7, "the encoder jumped";
        /// A servo period was missed.
        Overrun = 8, "the servo missed a period";
        /// The longest duration of a playback has passed. Not latched.
        Longest = 9, "the longest duration has passed";
        /// A button, a guard or the drive itself.
        External = 10, "stopped by the device's supervision";
        /// The probe does not follow its path.
        Following = 11, "the probe does not follow its path";
    }
}

codes! {
    /// How a request ended.
    Refusal {
        /// Done.
        None = 0, "done";
        /// A length or a field is none that the message can have.
        Malformed = 1, "the message is malformed";
        /// No message of this version.
        UnknownType = 2, "the type of message is unknown";
        /// The device does not speak the version; the detail is the one it does.
        Version = 3, "the version of the wire format is not spoken";
        /// Not in this state.
        WrongState = 4, "not in this state";
        /// No HELLO yet.
        NoHello = 5, "HELLO comes first";
        /// More than the device has room for; the detail is how much it has.
        TooMany = 6, "more than the device has room for";
        /// A chunk that is not the next; the detail is the one expected.
        Order = 7, "not the next chunk";
        /// Nodes or points are missing; the detail is how many there are.
        Incomplete = 8, "nodes or points are missing";
        /// The CRC over the whole does not fit; the detail is the device's.
        Checksum = 9, "the checksum over the whole does not fit";
        /// The table or path cannot be evaluated; the detail is the node from 0.
        BadTable = 10, "the table cannot be evaluated";
        /// A limit that is not finite and positive, or is above the device's; the
        /// detail says which: 1 force, 2 velocity, 3 range, 4 stiffness, 5 damping.
        Limit = 11, "a limit is none, or above the device's";
        /// The certificate fails and it was not armed; the detail says which
        /// condition: 1 mass, 2 damping, 3 hysteresis.
        Uncertified = 12, "the table fails its certificate and was not armed";
        /// The handle is not at rest.
        Moving = 13, "the handle is not at rest";
        /// PLAY or RECORD names another table or path than is loaded; the detail is
        /// the CRC of what is.
        OtherTable = 14, "another table is loaded";
        /// A playback's longest duration is zero or above the device's; the detail
        /// is the device's, ms.
        Duration = 15, "the longest duration is none, or above the device's";
        /// The device has no probe mode.
        NoProbe = 16, "the device has no probe mode";
        /// STOP names another playback than the one under way; the detail is that.
        OtherPlayback = 17, "another playback is under way";
        /// The sequence number was used for another request.
        Reused = 18, "the sequence number was used for another request";
        /// No fresh heartbeat: nothing is armed for a host that may be dead.
        NoHeartbeat = 19, "no fresh heartbeat";
    }
}

codes! {
    /// What an EVENT tells.
    Happening {
        /// Playing or recording has begun.
        Started = 1, "started";
        /// It has ended and the force is zero.
        Stopped = 2, "stopped";
        /// Zero force, latched.
        Latched = 3, "latched";
    }
}

codes! {
    /// What is loaded.
    Loaded {
        /// Nothing.
        Nothing = 0, "nothing";
        /// A table, to be played.
        Table = 1, "a table";
        /// A path, to be followed and recorded.
        Path = 2, "a path";
    }
}
