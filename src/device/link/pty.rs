//! The simulated device at the end of a pseudo-terminal, in real time.
//!
//! For another program it is a device on a serial port: [`Simulator`] runs the
//! firmware side by the clock, gives it what comes in and sends what comes out. The
//! cable can be pulled and put back, and the line can be bad.
//!
//! The device's time is the clock's, but a turn is at most [`LONGEST_TURN`] long: a
//! machine that is busy elsewhere stops the device with the program, as if time
//! stood still. How often that was is counted.

use super::LinkError;
use super::memory::{Line, Noise};
use crate::device::firmware::Firmware;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use study_wire::message::Fault;

/// A turn that took longer has made time stand still.
pub const LONGEST_TURN: Duration = Duration::from_millis(5);
/// What waits for a host that does not read, bytes; more is lost.
const WAITING: usize = 1 << 16;
/// Late turns are counted up to here, µs.
const LATEST_US: usize = 10_000;

/// One end of a pseudo-terminal; a host opens the other.
#[derive(Debug)]
pub struct Pty {
    master: OwnedFd,
    path: String,
    waiting: Vec<u8>,
}

impl Pty {
    /// Opens one.
    ///
    /// # Errors
    /// [`LinkError`]: the system has none.
    pub fn open() -> Result<Self, LinkError> {
        let failed = |e: Errno| LinkError(format!("no pseudo-terminal: {e}"));
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

    /// Where a host finds it.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// What has come; nothing as well while no host is there.
    fn read(&mut self) -> Vec<u8> {
        let mut bytes = vec![0; 4096];
        let n = rustix::io::read(&self.master, &mut bytes).unwrap_or(0);
        bytes.truncate(n);
        bytes
    }

    fn write(&mut self, bytes: &[u8]) {
        if self.waiting.len() + bytes.len() <= WAITING {
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

    /// Waits for bytes, no longer than `wait`.
    fn wait(&self, wait: Duration) {
        let Ok(wait) = Timespec::try_from(wait) else {
            return;
        };
        let mut master = [PollFd::new(&self.master, PollFlags::IN)];
        let come = poll(&mut master, Some(&wait));
        // without a host it is always "ready"
        if come.is_ok_and(|n| n > 0) && master[0].revents().contains(PollFlags::HUP) {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Something that is done to a simulated device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// The cable is pulled.
    Unplug,
    /// It is put back: the port is another one.
    Plug,
    /// The device loses its power for a moment.
    Reset,
    /// Its supervision trips.
    Trip,
    /// Its processor hangs.
    Stall(Duration),
}

/// How punctual the simulator was.
#[derive(Debug, Clone)]
pub struct Punctuality {
    /// Turns by how late they began, in whole µs; the last has all later ones.
    late_us: Vec<u64>,
    /// Turns that were longer than [`LONGEST_TURN`], and what time stood still.
    pub slips: u64,
    /// See above.
    pub slipped: Duration,
}

impl Punctuality {
    /// How late a turn began at most, of the share `share` of all turns, µs.
    pub fn percentile_us(&self, share: f64) -> usize {
        let total: u64 = self.late_us.iter().sum();
        let wanted = (share * total as f64).ceil() as u64;
        let mut seen = 0;
        for (us, count) in self.late_us.iter().enumerate() {
            seen += count;
            if seen >= wanted {
                return us;
            }
        }
        LATEST_US
    }

    /// Turns.
    pub fn turns(&self) -> u64 {
        self.late_us.iter().sum()
    }
}

/// A simulated device in real time.
#[derive(Debug)]
pub struct Simulator {
    firmware: Firmware,
    pty: Option<Pty>,
    /// A name that always leads to the present port.
    name: Option<PathBuf>,
    there: Line,
    back: Line,
    start: Instant,
    punctuality: Punctuality,
    /// The device's time.
    now: Duration,
}

impl Simulator {
    /// A device with its port. `name` becomes a symbolic link to it, wherever it is
    /// plugged in.
    ///
    /// # Errors
    /// [`LinkError`]: no pseudo-terminal, or the link cannot be made.
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
            there: line("there"),
            back: line("back"),
            start: Instant::now(),
            punctuality: Punctuality {
                late_us: vec![0; LATEST_US + 1],
                slips: 0,
                slipped: Duration::ZERO,
            },
            now: Duration::ZERO,
        };
        simulator.plug()?;
        Ok(simulator)
    }

    /// Where a host finds it; empty while it is unplugged.
    pub fn path(&self) -> &str {
        self.pty.as_ref().map_or("", Pty::path)
    }

    /// The device.
    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }

    /// How punctual it was so far.
    pub fn punctuality(&self) -> &Punctuality {
        &self.punctuality
    }

    /// Does something to it.
    ///
    /// # Errors
    /// [`LinkError`]: it cannot be plugged in.
    pub fn control(&mut self, what: Control) -> Result<(), LinkError> {
        match what {
            Control::Unplug => self.pty = None,
            Control::Plug => self.plug()?,
            Control::Reset => self.firmware.reset(self.now),
            Control::Trip => self.firmware.trip(Fault::External, self.now),
            Control::Stall(lasting) => self.firmware.stall(self.now, lasting),
        }
        Ok(())
    }

    fn plug(&mut self) -> Result<(), LinkError> {
        if self.pty.is_some() {
            return Ok(());
        }
        let pty = Pty::open()?;
        if let Some(name) = &self.name {
            point(name, pty.path()).map_err(|e| LinkError(format!("{}: {e}", name.display())))?;
        }
        self.pty = Some(pty);
        Ok(())
    }

    /// One turn: waits for the next servo period or for bytes, then lets the device
    /// do what is due.
    pub fn turn(&mut self) {
        let slipped = self.punctuality.slipped;
        let due = self.now + self.firmware.period();
        let wait = (due + slipped).saturating_sub(self.start.elapsed());
        match &self.pty {
            Some(pty) => pty.wait(wait),
            None => std::thread::sleep(wait),
        }
        let mut now = self.start.elapsed().saturating_sub(slipped);
        let late_us = now.saturating_sub(due).as_micros() as usize;
        self.punctuality.late_us[late_us.min(LATEST_US)] += 1;
        let longest = self.now + LONGEST_TURN;
        if now > longest {
            self.punctuality.slips += 1;
            self.punctuality.slipped += now - longest;
            now = longest;
        }
        if let Some(pty) = &mut self.pty {
            for frame in frames(&pty.read()) {
                self.there.send(frame.to_vec(), now);
            }
        }
        self.firmware.receive(&self.there.arrived(now), now);
        for frame in frames(&self.firmware.take_output()) {
            self.back.send(frame.to_vec(), now);
        }
        let bytes = self.back.arrived(now);
        if let Some(pty) = &mut self.pty {
            pty.write(&bytes);
        }
        self.now = now;
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        // a file of somebody else's stays, and it may never have been made
        if let Some(name) = &self.name
            && std::fs::symlink_metadata(name).is_ok_and(|found| found.is_symlink())
        {
            let _ = std::fs::remove_file(name);
        }
    }
}

/// Makes `name` a symbolic link, in place of an earlier one but of nothing else.
fn point(name: &Path, path: &str) -> std::io::Result<()> {
    match std::fs::symlink_metadata(name) {
        Ok(found) if found.file_type().is_symlink() => std::fs::remove_file(name)?,
        Ok(_) => return Err(std::io::ErrorKind::AlreadyExists.into()),
        Err(_) => {}
    }
    std::os::unix::fs::symlink(path, name)
}

/// Pieces that end where a frame does: faults strike single frames.
fn frames(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    bytes.split_inclusive(|byte| *byte == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::firmware::Options;
    use crate::device::link::Link as _;
    use crate::device::serial::SerialLink;

    #[test]
    fn bytes_go_both_ways_and_a_pulled_cable_is_an_end() {
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
        assert_eq!(taken.0, "another program has it");
        drop(pty);
        let end = link.read(&mut buffer, Duration::from_secs(5)).unwrap_err();
        assert_eq!(end.0, "unplugged");
    }

    /// Whoever does not read cannot hold whoever writes.
    #[test]
    fn a_device_that_reads_nothing_ends_the_link_and_a_host_that_does_not_costs_nothing() {
        let mut pty = Pty::open().unwrap();
        let mut link = SerialLink::open(pty.path(), 460_800).unwrap();
        let full = (0..10_000).find_map(|_| link.write(&[7; 100]).err());
        assert_eq!(full.unwrap().0, "the port takes no bytes");
        for _ in 0..10_000 {
            pty.write(&[7; 100]);
        }
        assert!(pty.waiting.len() <= WAITING);
    }

    #[test]
    fn a_name_leads_to_the_port_wherever_it_is_plugged_in() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("port");
        let firmware = Firmware::new(Options::default());
        let open = |name: &Path| {
            Simulator::open(
                Firmware::new(Options::default()),
                Noise::default(),
                1,
                Some(name.to_owned()),
            )
        };
        let mut simulator =
            Simulator::open(firmware, Noise::default(), 1, Some(name.clone())).unwrap();
        let leads = || std::fs::read_link(&name).unwrap();
        assert_eq!(leads(), Path::new(simulator.path()));
        // somebody keeps the old port open: the new one has another number
        let _held = SerialLink::open(simulator.path(), 460_800).unwrap();
        simulator.control(Control::Unplug).unwrap();
        simulator.control(Control::Plug).unwrap();
        assert_eq!(leads(), Path::new(simulator.path()));
        drop(simulator);
        assert!(!name.exists());
        std::fs::write(&name, "mine").unwrap();
        assert!(open(&name).is_err(), "a file is not overwritten");
        assert_eq!(std::fs::read(&name).unwrap(), b"mine");
    }
}
