//! A serial port as the connection of a device test.

use crate::cli::Failure;
use crate::cli::device_selection::SerialPortArgs;
use std::time::{Duration, Instant};
use study_base::text::Untrusted;
use study_device::check::Connection;
use study_device::link::{Link, LinkError};

/// An open port with a clock.
pub(in crate::cli) struct PortConnection {
    link: Box<dyn Link>,
    byte_time: Duration,
    start: Instant,
    /// Path of the port.
    pub(in crate::cli) address: String,
}

impl PortConnection {
    /// Opens the port that the arguments or `device.toml` name.
    pub(in crate::cli) fn open(port: &SerialPortArgs) -> Result<Self, Failure> {
        let mut opener = port.serial()?;
        let link = opener.open().map_err(|e| {
            let address = opener.address();
            Failure::device(format!("{}: {e}", Untrusted(&address)))
                .hint("`study device list` lists the ports")
        })?;
        Ok(Self {
            link,
            byte_time: opener.byte_time(),
            start: Instant::now(),
            address: opener.address(),
        })
    }
}

impl Connection for PortConnection {
    fn now(&mut self) -> Duration {
        self.start.elapsed()
    }

    fn exchange(&mut self, bytes: &[u8], wait: Duration) -> Result<Vec<u8>, LinkError> {
        if !bytes.is_empty() {
            self.link.write(bytes)?;
        }
        let mut buffer = vec![0; 4096];
        let n = self.link.read(&mut buffer, wait)?;
        buffer.truncate(n);
        Ok(buffer)
    }

    fn byte_time(&self) -> Duration {
        self.byte_time
    }
}
