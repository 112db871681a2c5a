//! Platforms without Unix signals: a session is refused, since nothing would stop the
//! device when its terminal closes.

use std::io;
use std::sync::atomic::AtomicBool;

/// Whether this platform can guarantee that a session ends in order.
pub(super) const SUPPORTED: bool = false;

pub(crate) struct Signals;

impl Signals {
    pub(crate) fn register() -> io::Result<Self> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub(crate) fn take(&self) -> Option<&'static str> {
        None
    }

    pub(crate) fn take_continued(&self) -> bool {
        false
    }
}

pub(super) fn restore_on_failure(_taken: &'static AtomicBool) -> io::Result<()> {
    Ok(())
}

pub(super) fn suspend() -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

pub(super) fn hung_up() -> bool {
    false
}

pub(crate) fn survive_file_size_limit() {}
