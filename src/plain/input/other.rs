//! Platforms on which a session is refused.

use super::Typed;
use std::io;
use std::time::Duration;

pub(in crate::plain) struct Lines;

impl Lines {
    pub(in crate::plain) fn open() -> io::Result<Self> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub(in crate::plain) fn has_keys(&self) -> bool {
        false
    }

    pub(in crate::plain) fn take_signal(&self) -> Option<&'static str> {
        None
    }

    pub(in crate::plain) fn take_suspend(&self) -> bool {
        false
    }

    pub(in crate::plain) fn suspend(&mut self) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub(in crate::plain) fn forget(&mut self) {}

    pub(in crate::plain) fn single_keys(&mut self, _on: bool) -> io::Result<()> {
        Ok(())
    }

    pub(in crate::plain) fn next(&mut self, _timeout: Duration) -> io::Result<Option<Typed>> {
        Err(io::ErrorKind::Unsupported.into())
    }
}
