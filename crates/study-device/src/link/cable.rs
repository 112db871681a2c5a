//! The device's end of a cable.

use std::fmt::Debug;
use std::time::Duration;

/// Largest number of bytes that wait for a host that does not read; more are lost.
pub(crate) const MAX_WAITING: usize = 1 << 16;

/// The device's end of a cable. Neither reading nor writing waits for the host.
pub(crate) trait Cable: Debug + Send {
    /// Where a host finds the device.
    fn path(&self) -> &str;
    /// The bytes received so far; none without a host.
    fn read(&mut self) -> Vec<u8>;
    /// Sends bytes; they are lost if the host does not read.
    fn write(&mut self, bytes: &[u8]);
    /// Waits at most `wait` for bytes.
    fn wait(&mut self, wait: Duration);
}
