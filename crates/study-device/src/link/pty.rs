//! The device's end of a pseudo-terminal: to another program it is a serial port.

use super::LinkError;
use super::cable::{Cable, MAX_WAITING};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::path::Path;
use std::time::Duration;

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
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
        // Other systems have no such flag, and a child that starts between both calls keeps the terminal.
        #[cfg(target_os = "linux")]
        let flags = flags | OpenptFlags::CLOEXEC;
        let master = openpt(flags).map_err(failed)?;
        fcntl_setfd(&master, FdFlags::CLOEXEC).map_err(failed)?;
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
}

impl Cable for Pty {
    fn path(&self) -> &str {
        &self.path
    }

    fn read(&mut self) -> Vec<u8> {
        let mut bytes = vec![0; 4096];
        let n = rustix::io::read(&self.master, &mut bytes).unwrap_or(0);
        bytes.truncate(n);
        bytes
    }

    fn write(&mut self, bytes: &[u8]) {
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

    fn wait(&mut self, wait: Duration) {
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

/// Creates a symbolic link; replaces an earlier link but no other file.
pub(super) fn replace_symlink(name: &Path, path: &str) -> std::io::Result<()> {
    match std::fs::symlink_metadata(name) {
        Ok(found) if found.file_type().is_symlink() => std::fs::remove_file(name)?,
        Ok(_) => return Err(std::io::ErrorKind::AlreadyExists.into()),
        Err(_) => {}
    }
    std::os::unix::fs::symlink(path, name)
}

#[cfg(test)]
mod tests {
    use super::*;
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
}
