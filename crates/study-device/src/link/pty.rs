//! The simulated device on a pseudo-terminal, in real time.
//!
//! To another program it is a device on a serial port. [`Simulator`] runs the simulated
//! firmware in real time and transfers the bytes. The cable can be unplugged and plugged
//! in again, and the line can have faults.
//!
//! The device's time follows the clock, but one step is at most [`MAX_STEP`] long. On a
//! busy machine the device's time then falls behind; the simulator counts these pauses.

use super::LinkError;
use super::memory::{Line, Noise};
use crate::firmware::Firmware;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use study_wire::message::Fault;

/// Longest step of the device's time.
pub const MAX_STEP: Duration = Duration::from_millis(5);
/// Largest number of bytes that wait for a host that does not read; more are lost.
const MAX_WAITING: usize = 1 << 16;
/// Largest lateness that is distinguished, µs.
const MAX_LATE_US: usize = 10_000;

/// The device's end of a pseudo-terminal.
#[derive(Debug)]
pub struct Pty {
    master: OwnedFd,
    path: String,
    waiting: Vec<u8>,
}

impl Pty {
    /// Opens a pseudo-terminal.
    ///
    /// # Errors
    /// [`LinkError`] if the system provides none.
    pub fn open() -> Result<Self, LinkError> {
        let failed = |e: Errno| LinkError::System(format!("no pseudo-terminal: {e}"));
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).map_err(failed)?;
        grantpt(&master).map_err(failed)?;
        unlockpt(&master).map_err(failed)?;
        let path = ptsname(&master, Vec::new()).map_err(failed)?;
        let mut settings = tcgetattr(&master).map_err(failed)?;
        settings.make_raw();
        tcsetattr(&master, OptionalActions::Now, &settings).map_err(failed)?;
        let flags = fcntl_getfl(&master).map_err(failed)?;
        fcntl_setfl(&master, flags | OFlags::NONBLOCK).map_err(failed)?;
        Ok(Self {
            master,
            path: path.to_string_lossy().into_owned(),
            waiting: Vec::new(),
        })
    }

    /// Path of the host's end.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The bytes received so far; none without a host.
    pub(super) fn read(&mut self) -> Vec<u8> {
        let mut bytes = vec![0; 4096];
        let n = rustix::io::read(&self.master, &mut bytes).unwrap_or(0);
        bytes.truncate(n);
        bytes
    }

    pub(super) fn write(&mut self, bytes: &[u8]) {
        if self.waiting.len() + bytes.len() <= MAX_WAITING {
            self.waiting.extend_from_slice(bytes);
        }
        while !self.waiting.is_empty() {
            match rustix::io::write(&self.master, &self.waiting) {
                Ok(n) => drop(self.waiting.drain(..n)),
                Err(Errno::INTR) => {}
                Err(_) => return,
            }
        }
    }

    /// Waits at most `wait` for bytes.
    fn wait(&self, wait: Duration) {
        let Ok(wait) = Timespec::try_from(wait) else {
            return;
        };
        let mut master = [PollFd::new(&self.master, PollFlags::IN)];
        let ready = poll(&mut master, Some(&wait));
        // Without a host the terminal is always ready.
        if ready.is_ok_and(|n| n > 0) && master[0].revents().contains(PollFlags::HUP) {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
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
    /// From the next playback on somebody holds the handle at this place, mm.
    Hold(f64),
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
    pty: Option<Pty>,
    /// Symbolic link that always leads to the current port.
    name: Option<PathBuf>,
    to_device: Line,
    to_host: Line,
    start: Instant,
    timing: StepTiming,
    /// Current time of the device.
    now: Duration,
}

impl Simulator {
    /// A device on a new port. `name` becomes a symbolic link to the current port.
    ///
    /// # Errors
    /// [`LinkError`] if there is no pseudo-terminal or the link cannot be created.
    pub fn open(
        firmware: Firmware,
        noise: Noise,
        seed: u64,
        name: Option<PathBuf>,
    ) -> Result<Self, LinkError> {
        let line = |way| Line::new(Duration::ZERO, noise, seed, way);
        let mut simulator = Self {
            firmware,
            pty: None,
            name,
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

    /// Path of the port; `None` while it is unplugged.
    pub fn path(&self) -> Option<&str> {
        self.pty.as_ref().map(Pty::path)
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
            Control::Unplug => self.pty = None,
            Control::Plug => self.plug()?,
            Control::Reset => self.firmware.reset(self.now),
            Control::Trip => self.firmware.trip(Fault::External, self.now),
            Control::Stall(lasting) => self.firmware.stall(self.now, lasting),
            Control::Hold(x_mm) => self.firmware.hold_at(x_mm),
        }
        Ok(())
    }

    fn plug(&mut self) -> Result<(), LinkError> {
        if self.pty.is_some() {
            return Ok(());
        }
        let pty = Pty::open()?;
        if let Some(name) = &self.name {
            replace_symlink(name, pty.path())
                .map_err(|e| LinkError::System(format!("{}: {e}", name.display())))?;
        }
        self.pty = Some(pty);
        Ok(())
    }

    /// Waits for the next servo period or for bytes, then simulates up to now.
    pub fn step(&mut self) {
        let paused = self.timing.paused;
        let due = self.now + self.firmware.period();
        let wait = (due + paused).saturating_sub(self.start.elapsed());
        match &self.pty {
            Some(pty) => pty.wait(wait),
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
        if let Some(pty) = &mut self.pty {
            for frame in frames(&pty.read()) {
                self.to_device.send(frame.to_vec(), now);
            }
        }
        self.firmware.receive(&self.to_device.arrived(now), now);
        for frame in frames(&self.firmware.take_output()) {
            self.to_host.send(frame.to_vec(), now);
        }
        let bytes = self.to_host.arrived(now);
        if let Some(pty) = &mut self.pty {
            pty.write(&bytes);
        }
        self.now = now;
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        // Only a symbolic link is removed, never another file.
        if let Some(name) = &self.name
            && std::fs::symlink_metadata(name).is_ok_and(|found| found.is_symlink())
        {
            let _ = std::fs::remove_file(name);
        }
    }
}

/// Creates a symbolic link; replaces an earlier link but no other file.
fn replace_symlink(name: &Path, path: &str) -> std::io::Result<()> {
    match std::fs::symlink_metadata(name) {
        Ok(found) if found.file_type().is_symlink() => std::fs::remove_file(name)?,
        Ok(_) => return Err(std::io::ErrorKind::AlreadyExists.into()),
        Err(_) => {}
    }
    std::os::unix::fs::symlink(path, name)
}

/// Splits bytes at the ends of frames, so that faults affect single frames.
fn frames(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    bytes.split_inclusive(|byte| *byte == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::Options;
    use crate::link::Link as _;
    use crate::serial::SerialLink;

    #[test]
    fn bytes_pass_in_both_directions_and_unplugging_ends_the_link() {
        let mut pty = Pty::open().unwrap();
        let mut link = SerialLink::open(pty.path(), 460_800).unwrap();
        link.write(&[0, 1, 255, 3, 17, 19, 0]).unwrap();
        assert_eq!(pty.read(), [0, 1, 255, 3, 17, 19, 0]);
        pty.write(&[13, 10, 4, 0]);
        let mut buffer = [0; 64];
        let n = link.read(&mut buffer, Duration::from_secs(5)).unwrap();
        assert_eq!(buffer[..n], [13, 10, 4, 0]);
        assert_eq!(link.read(&mut buffer, Duration::from_millis(1)), Ok(0));
        let taken = SerialLink::open(pty.path(), 460_800).unwrap_err();
        assert_eq!(taken, LinkError::InUse);
        drop(pty);
        let end = link.read(&mut buffer, Duration::from_secs(5)).unwrap_err();
        assert_eq!(end, LinkError::Unplugged);
    }

    /// A side that does not read cannot block the other.
    #[test]
    fn a_device_that_does_not_read_ends_the_link_and_a_host_that_does_not_read_loses_bytes() {
        let mut pty = Pty::open().unwrap();
        let mut link = SerialLink::open(pty.path(), 460_800).unwrap();
        let full = (0..10_000).find_map(|_| link.write(&[7; 100]).err());
        assert_eq!(full, Some(LinkError::WriteTimeout));
        for _ in 0..10_000 {
            pty.write(&[7; 100]);
        }
        assert!(pty.waiting.len() <= MAX_WAITING);
    }

    #[test]
    fn a_name_leads_to_the_current_port() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("port");
        let open = |name: &Path| {
            Simulator::open(
                Firmware::new(Options::default()),
                Noise::default(),
                1,
                Some(name.to_owned()),
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
