//! Failures of commands: exit code and message.

use std::fmt;
use study_base::diagnostic::Findings;

/// Kind of a failure; the value is the exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Invalid input.
    Input = 1,
    /// Wrong usage.
    Usage = 2,
    /// A problem of the device.
    Device = 3,
    /// A problem of the results folder.
    Results = 4,
    /// A bug in this program.
    Bug = 70,
}

/// Why a command failed.
#[derive(Debug)]
pub struct Failure {
    /// Determines the exit code.
    pub kind: Kind,
    /// What went wrong and where, in one sentence. Untrusted text is escaped when it is
    /// printed. Empty if `findings` say everything.
    pub message: String,
    /// What to do next.
    pub hint: Option<String>,
    /// Errors in files, with positions.
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

    /// A failure because of invalid input.
    pub fn input(message: impl fmt::Display) -> Self {
        Self::new(Kind::Input, message)
    }

    /// A failure because of wrong usage.
    pub fn usage(message: impl fmt::Display) -> Self {
        Self::new(Kind::Usage, message)
    }

    /// A failure because of the device.
    pub fn device(message: impl fmt::Display) -> Self {
        Self::new(Kind::Device, message)
    }

    /// A failure because of the results folder.
    pub fn results(message: impl fmt::Display) -> Self {
        Self::new(Kind::Results, message)
    }

    /// A failure because of errors in files.
    pub fn faults(findings: Vec<Findings>) -> Self {
        Self {
            findings,
            ..Self::new(Kind::Input, "")
        }
    }

    /// A file could not be read or written.
    pub fn file(path: &std::path::Path, error: &std::io::Error) -> Self {
        let why = study_session::store::plain(error);
        Self::input(format!("{}: {why}", path.display()))
    }

    /// The same failure with a hint.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// The exit code of the process.
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
            .hint("answers shown as saved are saved; please report the lines above"))
    })
}
