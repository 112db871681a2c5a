//! A serial port on Unix, by termios.
//!
//! The port is opened without blocking, so that neither a device that does not read nor
//! an unplugged cable can block a thread.

use crate::link::{Link, LinkError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, tcflush, tcgetattr, tcsetattr,
};
use std::time::Duration;

/// A port that accepts no bytes for this time counts as lost.
const WRITE_TIMEOUT: Duration = Duration::from_millis(50);
/// Longest single wait of a write.
const WRITE_POLL_INTERVAL: Duration = Duration::from_millis(5);

/// An open port.
#[derive(Debug)]
pub struct SerialLink {
    port: OwnedFd,
}

impl SerialLink {
    /// Opens a port exclusively in raw mode: 8 data bits, no parity, one stop bit.
    ///
    /// # Errors
    /// [`LinkError`] if the port does not exist, is not a serial port, is in use, or does
    /// not support the settings.
    pub fn open(path: &str, baud: u32) -> Result<Self, LinkError> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let port = open(path, flags, Mode::empty()).map_err(|e| match e {
            Errno::NOENT => LinkError::NoSuchPort,
            Errno::ACCESS => LinkError::NoPermission,
            Errno::BUSY => LinkError::InUse,
            e => LinkError::System(e.to_string()),
        })?;
        let failed = |e: Errno| match e {
            Errno::WOULDBLOCK => LinkError::InUse,
            Errno::NOTTY => LinkError::NotSerial,
            e => LinkError::System(e.to_string()),
        };
        let mut settings = tcgetattr(&port).map_err(failed)?;
        // The lock excludes programs that ask for it, the ioctl all others.
        flock(&port, FlockOperation::NonBlockingLockExclusive).map_err(failed)?;
        ioctl_tiocexcl(&port).map_err(failed)?;
        settings.make_raw();
        settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
        settings.control_modes -= ControlModes::CSTOPB | ControlModes::PARENB;
        settings
            .set_speed(baud)
            .map_err(|_| LinkError::BaudRate(baud))?;
        tcsetattr(&port, OptionalActions::Now, &settings).map_err(failed)?;
        // Discard what an earlier program left in the driver.
        tcflush(&port, QueueSelector::IOFlush).map_err(failed)?;
        Ok(Self { port })
    }

    /// Waits at most `wait` until the port is ready.
    fn ready(&self, what: PollFlags, wait: Duration) -> Result<bool, LinkError> {
        // A wait of at most a second always fits.
        let wait = Timespec::try_from(wait).unwrap_or(Timespec {
            tv_sec: 0,
            tv_nsec: 1_000_000,
        });
        let mut port = [PollFd::new(&self.port, what)];
        match poll(&mut port, Some(&wait)) {
            Ok(0) | Err(Errno::INTR) => Ok(false),
            Ok(_) => Ok(true),
            Err(e) => Err(io_error(e)),
        }
    }
}

fn io_error(e: Errno) -> LinkError {
    match e {
        Errno::IO | Errno::NXIO | Errno::NODEV | Errno::PIPE => LinkError::Unplugged,
        e => LinkError::System(e.to_string()),
    }
}

impl Link for SerialLink {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, LinkError> {
        if !self.ready(PollFlags::IN, wait)? {
            return Ok(0);
        }
        match rustix::io::read(&self.port, buffer) {
            // A CDC device that was unplugged reads as the end of a file.
            Ok(0) => Err(LinkError::Unplugged),
            Ok(n) => Ok(n),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(e) => Err(io_error(e)),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let mut left = bytes;
        let mut waited = Duration::ZERO;
        while !left.is_empty() {
            match rustix::io::write(&self.port, left) {
                Ok(n) => left = &left[n..],
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => {
                    if waited >= WRITE_TIMEOUT {
                        return Err(LinkError::WriteTimeout);
                    }
                    self.ready(PollFlags::OUT, WRITE_POLL_INTERVAL)?;
                    waited += WRITE_POLL_INTERVAL;
                }
                Err(e) => return Err(io_error(e)),
            }
        }
        Ok(())
    }
}
