//! Why a message of a program is rejected.

use study_base::child::{ChildFailure, MAX_TEXT};
use study_base::text::{Untrusted, beginning};

/// Version of the messages, stated in the program's `hello`.
pub const FORMAT: &str = "study-process/2";
/// Largest number of samples in one line.
pub(super) const MAX_SAMPLES: usize = 4096;

/// Why a message of a program is rejected.
#[derive(Debug, thiserror::Error)]
pub(super) enum MessageError {
    /// Not valid JSON of a known message; the error and the line.
    #[error("{0}: {1}")]
    Json(serde_json::Error, String),
    #[error("more than {MAX_SAMPLES} samples in one line")]
    TooManySamples,
    #[error("it uses the format `{format}`; this program supports {FORMAT} and version 1", format = Untrusted(.0))]
    Format(String),
    #[error("its {0} needs 1 to 64 characters")]
    Text(&'static str),
    #[error("{0}")]
    Told(String),
    #[error("the outcome of its playback has no `load`")]
    NoLoad,
    #[error("it sends `{0}` before `hello`")]
    NoHello(&'static str),
    #[error("it is another device than before, `{id}`", id = Untrusted(.0))]
    OtherDevice(String),
    #[error("it sends `{message}` while {state}")]
    WrongState {
        message: &'static str,
        state: &'static str,
    },
}

impl From<MessageError> for ChildFailure {
    fn from(error: MessageError) -> Self {
        Self::Violation(error.to_string())
    }
}

/// The beginning of a program's text.
pub(super) fn short_text(text: &str) -> String {
    beginning(text, MAX_TEXT)
}
