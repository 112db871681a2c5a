//! The simulated device in real time, at the end of a cable.
//!
//! To another program it is a device on a serial port or at an address of this computer.
//! [`Simulator`] runs the simulated firmware in real time and transfers the bytes. The cable can
//! be unplugged and plugged in again, and the line can have faults.
//!
//! The device's time follows the clock, but one step is at most [`MAX_STEP`] long. On a
//! busy machine the device's time then falls behind; the simulator counts these pauses.

use super::LinkError;
use super::cable::Cable;
use super::memory::{Line, Noise};
#[cfg(unix)]
use super::pty::{Pty, replace_symlink};
use super::tcp::{Listening, Token};
use crate::firmware::Firmware;

use std::net::SocketAddr;
#[cfg(unix)]
use std::path::PathBuf;
use std::time::{Duration, Instant};
use study_wire::message::Fault;

/// Longest step of the device's time.
pub const MAX_STEP: Duration = Duration::from_millis(5);
/// Largest lateness that is distinguished, µs.
const MAX_LATE_US: usize = 10_000;

/// Where the cable of a simulated device ends.
#[derive(Debug, Clone)]
pub enum Socket {
    /// In a new pseudo-terminal each time that it is plugged in. `name` becomes a symbolic link
    /// to the current one.
    #[cfg(unix)]
    Pty {
        /// Path of the link.
        name: Option<PathBuf>,
    },
    /// At an address of this computer, for hosts that know the token.
    Tcp {
        /// Address; port 0 is any free one.
        at: SocketAddr,
        /// What a host has to send first.
        token: Token,
    },
}

/// An action on a simulated device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Control {
    /// Unplugs the cable.
    Unplug,
    /// Plugs the cable in again, on a new port.
    Plug,
    /// Restarts the device.
    Reset,
    /// Trips the device's safety circuit.
    Trip,
    /// Stops the device's processor for a time.
    Stall(Duration),
    /// Somebody brings the handle to this place and holds it there, mm.
    Hold(f64),
    /// Nobody holds the handle: it moves as the motor pushes it.
    LetGo,
    /// A weight or a scale pulls at the free handle, N, positive towards +x.
    Pull(f64),
}

/// Timing of the simulator.
#[derive(Debug, Clone)]
pub struct StepTiming {
    /// Number of steps by lateness in whole µs; the last entry includes later ones.
    late_us: Vec<u64>,
    /// Number of steps that were longer than [`MAX_STEP`].
    pub pauses: u64,
    /// Total time by which the device's time is behind.
    pub paused: Duration,
}

impl StepTiming {
    /// Quantile of the lateness over all steps, µs; `fraction` is between 0 and 1.
    pub fn quantile_us(&self, fraction: f64) -> usize {
        let total: u64 = self.late_us.iter().sum();
        let wanted = (fraction * total as f64).ceil() as u64;
        let mut seen = 0;
        for (us, count) in self.late_us.iter().enumerate() {
            seen += count;
            if seen >= wanted {
                return us;
            }
        }
        MAX_LATE_US
    }

    /// Number of steps.
    pub fn steps(&self) -> u64 {
        self.late_us.iter().sum()
    }
}

/// A simulated device in real time.
#[derive(Debug)]
pub struct Simulator {
    firmware: Firmware,
    cable: Option<Box<dyn Cable>>,
    socket: Socket,
    to_device: Line,
    to_host: Line,
    start: Instant,
    timing: StepTiming,
    /// Current time of the device.
    now: Duration,
}

impl Simulator {
    /// A device whose cable is plugged in.
    ///
    /// # Errors
    /// [`LinkError`] if there is no pseudo-terminal, the link cannot be created, or the
    /// address is in use.
    pub fn open(
        firmware: Firmware,
        noise: Noise,
        seed: u64,
        socket: Socket,
    ) -> Result<Self, LinkError> {
        let line = |way| Line::new(Duration::ZERO, noise, seed, way);
        let mut simulator = Self {
            firmware,
            cable: None,
            socket,
            to_device: line("there"),
            to_host: line("back"),
            start: Instant::now(),
            timing: StepTiming {
                late_us: vec![0; MAX_LATE_US + 1],
                pauses: 0,
                paused: Duration::ZERO,
            },
            now: Duration::ZERO,
        };
        simulator.plug()?;
        Ok(simulator)
    }

    /// Path or address of the port; `None` while it is unplugged.
    pub fn path(&self) -> Option<&str> {
        self.cable.as_ref().map(|cable| cable.path())
    }

    /// The simulated firmware.
    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }

    /// Timing so far.
    pub fn timing(&self) -> &StepTiming {
        &self.timing
    }

    /// Performs an action on the device.
    ///
    /// # Errors
    /// [`LinkError`] if it cannot be plugged in.
    pub fn control(&mut self, what: Control) -> Result<(), LinkError> {
        match what {
            Control::Unplug => self.cable = None,
            Control::Plug => self.plug()?,
            Control::Reset => self.firmware.reset(self.now),
            Control::Trip => self.firmware.trip(Fault::External, self.now),
            Control::Stall(lasting) => self.firmware.stall(self.now, lasting),
            Control::Hold(x_mm) => self.firmware.hold_at(x_mm),
            Control::LetGo => self.firmware.let_go(),
            Control::Pull(force_n) => self.firmware.pull(force_n),
        }
        Ok(())
    }

    fn plug(&mut self) -> Result<(), LinkError> {
        if self.cable.is_some() {
            return Ok(());
        }
        self.cable = Some(match &mut self.socket {
            #[cfg(unix)]
            Socket::Pty { name } => {
                let pty = Pty::open()?;
                if let Some(name) = name {
                    replace_symlink(name, pty.path())
                        .map_err(|e| LinkError::System(format!("{}: {e}", name.display())))?;
                }
                Box::new(pty)
            }
            Socket::Tcp { at, token } => {
                let listening = Listening::open(*at, token.clone())?;
                // Plugged in again, the device is found where it was.
                *at = listening.address();
                Box::new(listening)
            }
        });
        Ok(())
    }

    /// Waits for the next servo period or for bytes, then simulates up to now.
    pub fn step(&mut self) {
        let paused = self.timing.paused;
        let due = self.now + self.firmware.period();
        let wait = (due + paused).saturating_sub(self.start.elapsed());
        match &mut self.cable {
            Some(cable) => cable.wait(wait),
            None => std::thread::sleep(wait),
        }
        let mut now = self.start.elapsed().saturating_sub(paused);
        let late_us = now.saturating_sub(due).as_micros() as usize;
        self.timing.late_us[late_us.min(MAX_LATE_US)] += 1;
        let longest = self.now + MAX_STEP;
        if now > longest {
            self.timing.pauses += 1;
            self.timing.paused += now - longest;
            now = longest;
        }
        if let Some(cable) = &mut self.cable {
            for frame in frames(&cable.read()) {
                self.to_device.send(frame.to_vec(), now);
            }
        }
        self.firmware.receive(&self.to_device.arrived(now), now);
        for frame in frames(&self.firmware.take_output()) {
            self.to_host.send(frame.to_vec(), now);
        }
        let bytes = self.to_host.arrived(now);
        if let Some(cable) = &mut self.cable {
            cable.write(&bytes);
        }
        self.now = now;
    }
}

#[cfg(unix)]
impl Drop for Simulator {
    fn drop(&mut self) {
        // Only a symbolic link is removed, never another file.
        if let Socket::Pty { name: Some(name) } = &self.socket
            && std::fs::symlink_metadata(name).is_ok_and(|found| found.is_symlink())
        {
            let _ = std::fs::remove_file(name);
        }
    }
}

/// Splits bytes at the ends of frames, so that faults affect single frames.
fn frames(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    bytes.split_inclusive(|byte| *byte == 0)
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::Options;
    use crate::serial::SerialLink;
    use std::path::Path;

    #[test]
    fn a_name_leads_to_the_current_port() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("port");
        let open = |name: &Path| {
            Simulator::open(
                Firmware::new(Options::default()),
                Noise::default(),
                1,
                Socket::Pty {
                    name: Some(name.to_owned()),
                },
            )
        };
        let mut simulator = open(&name).unwrap();
        let leads = || std::fs::read_link(&name).unwrap();
        assert_eq!(leads(), Path::new(simulator.path().unwrap()));
        // With the old port still open the new one has another number.
        let _held = SerialLink::open(simulator.path().unwrap(), 460_800).unwrap();
        simulator.control(Control::Unplug).unwrap();
        simulator.control(Control::Plug).unwrap();
        assert_eq!(leads(), Path::new(simulator.path().unwrap()));
        drop(simulator);
        assert!(!name.exists());
        std::fs::write(&name, "mine").unwrap();
        assert!(open(&name).is_err(), "a file must not be replaced");
        assert_eq!(std::fs::read(&name).unwrap(), b"mine");
    }
}
