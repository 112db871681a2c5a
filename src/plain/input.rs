//! What is typed: lines, and while the device is armed also single keys.

#[cfg(not(unix))]
mod other;
#[cfg(unix)]
mod unix;

#[cfg(not(unix))]
pub(super) use other::Lines;
#[cfg(unix)]
pub(super) use unix::Lines;

/// A line or a key that was typed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Typed {
    /// A line, without its end.
    Line(String),
    /// Esc, or Space as the first character, while the device is armed.
    Stop,
}
