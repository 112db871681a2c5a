//! Serial ports on systems without termios: opening always fails.

use crate::link::{Link, LinkError};
use std::time::Duration;

/// A serial port; it cannot be opened on this system.
#[derive(Debug)]
pub enum SerialLink {}

impl SerialLink {
    /// Fails on this system.
    ///
    /// # Errors
    /// Always [`LinkError::Unsupported`].
    pub fn open(_: &str, _: u32) -> Result<Self, LinkError> {
        Err(LinkError::Unsupported)
    }
}

impl Link for SerialLink {
    fn read(&mut self, _: &mut [u8], _: Duration) -> Result<usize, LinkError> {
        match *self {}
    }

    fn write(&mut self, _: &[u8]) -> Result<(), LinkError> {
        match *self {}
    }
}
