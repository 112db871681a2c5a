//! The stages of a connection and a playback.

use std::time::Duration;

/// The host's view of the device.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Stage {
    /// There is no port.
    #[default]
    Disconnected,
    /// LIMP and HELLO have been sent.
    Connecting,
    /// The device does not answer or answers incorrectly; the host reconnects at `retry`.
    Silent { retry: Duration },
    /// Limp, nothing loaded.
    Idle,
    /// A table is being uploaded.
    Loading { since: Duration },
    /// A table is loaded.
    Loaded { since: Duration },
    /// PLAY has been sent.
    Starting,
    /// Playing.
    Playing { since: Duration },
    /// FADE has been sent: it plays until the force is zero.
    Fading { since: Duration },
    /// STOP has been sent, or the end of the playback has been reported.
    Stopping { since: Duration },
    /// The playback has ended and STATE asks for its outcome.
    AwaitingOutcome,
}

impl Stage {
    /// Text for messages about a command in the wrong state.
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Disconnected | Self::Connecting | Self::Silent { .. } => "it does not answer",
            Self::Idle => "nothing is loaded",
            Self::Loading { .. } => "the table is being loaded",
            Self::Loaded { .. } => "a table is loaded",
            Self::Starting => "it is starting",
            Self::Playing { .. } => "it is playing",
            Self::Fading { .. } | Self::Stopping { .. } | Self::AwaitingOutcome => "it is stopping",
        }
    }

    /// Whether the device's watchdog is or will be active.
    pub(super) fn armed(self) -> bool {
        matches!(
            self,
            Self::Loading { .. }
                | Self::Loaded { .. }
                | Self::Starting
                | Self::Playing { .. }
                | Self::Fading { .. }
                | Self::Stopping { .. }
                // The table stays loaded. If STATE or its answer is lost on the line, it is
                // asked for again, and the device must not go limp before.
                | Self::AwaitingOutcome
        )
    }

    /// Whether the device has identified itself.
    pub(super) fn known(self) -> bool {
        !matches!(
            self,
            Self::Disconnected | Self::Connecting | Self::Silent { .. }
        )
    }
}
