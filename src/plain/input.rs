//! What is typed: lines, and while the device is armed also single keys.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
pub(super) use unix::Lines;
#[cfg(windows)]
pub(super) use windows::Lines;

/// A line or a key that was typed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Typed {
    /// A line, without its end.
    Line(String),
    /// Esc, or Space as the first character, while the device is armed.
    Stop,
}

/// Takes the first line from bytes that were read, without its end.
fn take_line(bytes: &mut Vec<u8>) -> Option<String> {
    let end = bytes.iter().position(|b| *b == b'\n')?;
    let line: Vec<u8> = bytes.drain(..=end).collect();
    let line = String::from_utf8_lossy(&line[..end]);
    Some(line.trim_end_matches('\r').to_owned())
}
