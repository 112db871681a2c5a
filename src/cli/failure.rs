//! Why a command failed: decides the exit code and what the user reads.

use std::fmt;
use study_base::diagnostic::Findings;

/// What kind of failure; the number is the exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The user's input is at fault.
    Input = 1,
    /// The arguments are.
    Usage = 2,
    /// The device.
    Device = 3,
    /// The results folder.
    Results = 4,
    /// We are.
    Bug = 70,
}

/// A failed command.
#[derive(Debug)]
pub struct Failure {
    /// Decides the exit code.
    pub kind: Kind,
    /// What went wrong and where; one sentence. Text from outside is escaped by
    /// whoever prints it. Empty if `findings` say everything.
    pub message: String,
    /// What to do next.
    pub hint: Option<String>,
    /// Faults of files, with places.
    pub findings: Vec<Findings>,
}

impl Failure {
    /// A failure with a message.
    pub fn new(kind: Kind, message: impl fmt::Display) -> Self {
        Self {
            kind,
            message: message.to_string(),
            hint: None,
            findings: Vec::new(),
        }
    }

    /// The user's input is at fault.
    pub fn input(message: impl fmt::Display) -> Self {
        Self::new(Kind::Input, message)
    }

    /// The results folder is.
    pub fn results(message: impl fmt::Display) -> Self {
        Self::new(Kind::Results, message)
    }

    /// Faults in files.
    pub fn faults(findings: Vec<Findings>) -> Self {
        Self {
            findings,
            ..Self::new(Kind::Input, "")
        }
    }

    /// A file could not be read or written.
    pub fn file(path: &std::path::Path, error: &std::io::Error) -> Self {
        let why = study_core::store::plain(error);
        Self::input(format!("{}: {why}", path.display()))
    }

    /// The same, with advice.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// The process's exit code.
    pub fn exit_code(&self) -> u8 {
        self.kind as u8
    }
}

/// Runs `f`; a panic in it becomes a [`Kind::Bug`].
///
/// # Errors
/// What `f` returns, or the panic.
pub fn guard(f: impl FnOnce() -> Result<(), Failure>) -> Result<(), Failure> {
    // The hook has already printed where it happened.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(f)).unwrap_or_else(|_| {
        Err(Failure::new(Kind::Bug, "this is a bug in study")
            .hint("what was shown as saved is saved; please report the lines above"))
    })
}
