//! A port as a wire with a clock.

use crate::cli::playback::Port;
use crate::cli::{Failure, Kind};
use crate::device::check::Wire;
use crate::device::link::{Link, LinkError, Opener as _};
use std::time::{Duration, Instant};
use study_base::text::Untrusted;

/// An open port, and since when.
pub(in crate::cli) struct PortWire {
    link: Box<dyn Link>,
    start: Instant,
    /// Where it leads to.
    pub(in crate::cli) place: String,
}

impl PortWire {
    /// Opens the port that the arguments or `device.toml` name.
    pub(in crate::cli) fn open(port: &Port) -> Result<Self, Failure> {
        let mut opener = port.serial()?;
        let link = opener.open().map_err(|e| {
            let place = opener.place();
            Failure::new(Kind::Device, format!("{}: {e}", Untrusted(&place)))
                .hint("`study device list` shows the ports")
        })?;
        Ok(Self {
            link,
            start: Instant::now(),
            place: opener.place(),
        })
    }
}

impl Wire for PortWire {
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
}
