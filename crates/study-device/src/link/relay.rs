//! A pseudo-terminal before a device on a port, which hears what the device says.
//!
//! With it the time to zero force of any device can be measured, also of one whose force
//! nobody here simulates: the device says in the same servo period that it has become limp.

use super::cable::Cable as _;
use super::pty::Pty;
use super::{Link, LinkError};
use std::time::Duration;
use study_wire::frame::Decoder;
use study_wire::message::{DeviceState, EventKind, Reply, fixed};

/// Longest wait for bytes.
const WAIT: Duration = Duration::from_micros(200);

/// A device behind a pseudo-terminal.
pub struct Relay {
    device: Box<dyn Link>,
    pty: Option<Pty>,
    decoder: Decoder,
    state: Option<DeviceState>,
    force_n: f64,
}

impl Relay {
    /// Without a port for a host.
    pub fn new(device: Box<dyn Link>) -> Self {
        Self {
            device,
            pty: None,
            decoder: Decoder::new(),
            state: None,
            force_n: 0.0,
        }
    }

    /// A new port for a host; returns its path.
    ///
    /// # Errors
    /// [`LinkError`] if the system provides none.
    pub fn plug(&mut self) -> Result<String, LinkError> {
        let pty = Pty::open()?;
        let path = pty.path().to_owned();
        (self.pty, self.state) = (Some(pty), None);
        Ok(path)
    }

    /// Takes the port away.
    pub fn unplug(&mut self) {
        self.pty = None;
    }

    /// The last state that the device told the host.
    pub fn state(&self) -> Option<DeviceState> {
        self.state
    }

    /// The last force that it reported, N.
    pub fn force_n(&self) -> f64 {
        self.force_n
    }

    /// Passes on what has arrived, after a short wait.
    ///
    /// # Errors
    /// [`LinkError`] if the device is gone.
    pub fn step(&mut self) -> Result<(), LinkError> {
        let mut buffer = [0; 4096];
        if let Some(pty) = &mut self.pty {
            let bytes = pty.read();
            self.device.write(&bytes)?;
        }
        let n = self.device.read(&mut buffer, WAIT)?;
        for byte in &buffer[..n] {
            if let Some(Ok(body)) = self.decoder.push(*byte)
                && let Ok((_, reply)) = Reply::decode(body)
            {
                self.hear(&reply);
            }
        }
        if let Some(pty) = &mut self.pty {
            pty.write(&buffer[..n]);
        }
        Ok(())
    }

    fn hear(&mut self, reply: &Reply) {
        match reply {
            Reply::Pulse(pulse) => self.state = Some(pulse.state),
            Reply::Ack(ack) => self.state = Some(ack.state),
            Reply::Event(event) if event.kind == EventKind::Latched => {
                self.state = Some(DeviceState::Limp);
                self.force_n = 0.0;
            }
            Reply::Telemetry(telemetry) => {
                if let Some(last) = telemetry.samples.as_slice().last() {
                    self.force_n = fixed::from_un(last.command_un);
                }
            }
            _ => {}
        }
    }
}
