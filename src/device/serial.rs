//! A serial port as a link: one owner, every read and write bounded.
//!
//! A port is found again by the serial number of its USB adapter, wherever it is
//! plugged in; without one, by its path. A port that another program has is not
//! taken away. The port is opened without blocking, so that neither a device that
//! reads nothing nor a cable that is pulled can hold a thread.

use super::link::{Link, LinkError, Opener};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, tcflush, tcgetattr, tcsetattr,
};
use serialport::{SerialPortInfo, SerialPortType};
use std::time::Duration;

/// Where none is given: telemetry of 20 bytes a sample at 1 kHz needs it.
pub const BAUD: u32 = 460_800;
/// How long a port may refuse bytes before it counts as gone.
const WRITE_WITHIN: Duration = Duration::from_millis(50);
/// One wait of a write.
const WRITE_SLICE: Duration = Duration::from_millis(5);

/// Which port, and how fast.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SerialOpener {
    path: String,
    baud: u32,
    /// Serial number of the USB adapter.
    usb_serial: Option<String>,
}

impl SerialOpener {
    /// The port at `path`, such as `/dev/ttyUSB0`, at `baud` bits per second, which a
    /// USB CDC device and a pseudo-terminal ignore. If it is a USB port, its serial
    /// number is remembered; one that is given is looked for instead of the path.
    pub fn new(path: &str, baud: u32, usb_serial: Option<String>) -> Self {
        let known = || ports().into_iter().find(|p| p.port_name == path);
        let usb_serial = usb_serial.or_else(|| serial_of(known()?));
        Self {
            path: path.to_owned(),
            baud,
            usb_serial,
        }
    }
}

fn ports() -> Vec<SerialPortInfo> {
    serialport::available_ports().unwrap_or_default()
}

fn serial_of(port: SerialPortInfo) -> Option<String> {
    match port.port_type {
        SerialPortType::UsbPort(usb) => usb.serial_number.filter(|s| !s.trim().is_empty()),
        _ => None,
    }
}

impl Opener for SerialOpener {
    fn open(&mut self) -> Result<Box<dyn Link>, LinkError> {
        if let Some(serial) = &self.usb_serial {
            let found = ports()
                .into_iter()
                .find(|port| serial_of(port.clone()).as_ref() == Some(serial));
            match found {
                Some(port) => self.path = port.port_name,
                None if self.path.is_empty() => {
                    return Err(LinkError(format!(
                        "no port of a USB device with the serial number {serial}"
                    )));
                }
                None => {}
            }
        }
        Ok(Box::new(SerialLink::open(&self.path, self.baud)?))
    }

    fn place(&self) -> String {
        self.path.clone()
    }
}

/// An open port.
#[derive(Debug)]
pub struct SerialLink {
    port: OwnedFd,
}

impl SerialLink {
    /// Opens a port for this program alone, raw, 8 bits, no parity, one stop bit.
    ///
    /// # Errors
    /// [`LinkError`]: it is not there, no serial port, taken, or not to be set so.
    pub fn open(path: &str, baud: u32) -> Result<Self, LinkError> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let port = open(path, flags, Mode::empty()).map_err(|e| {
            LinkError(match e {
                Errno::NOENT => "there is no such port".to_owned(),
                Errno::ACCESS => "this user may not open it".to_owned(),
                Errno::BUSY => "another program has it".to_owned(),
                e => e.to_string(),
            })
        })?;
        let failed = |e: Errno| {
            LinkError(match e {
                Errno::WOULDBLOCK => "another program has it".to_owned(),
                Errno::NOTTY => "it is no serial port".to_owned(),
                e => e.to_string(),
            })
        };
        let mut settings = tcgetattr(&port).map_err(failed)?;
        // the lock keeps out whoever asks, the ioctl whoever does not
        flock(&port, FlockOperation::NonBlockingLockExclusive).map_err(failed)?;
        ioctl_tiocexcl(&port).map_err(failed)?;
        settings.make_raw();
        settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
        settings.control_modes -= ControlModes::CSTOPB | ControlModes::PARENB;
        settings
            .set_speed(baud)
            .map_err(|_| LinkError(format!("it cannot be set to {baud} baud")))?;
        tcsetattr(&port, OptionalActions::Now, &settings).map_err(failed)?;
        // what an earlier program left in the driver is not for us, nor for the device
        tcflush(&port, QueueSelector::IOFlush).map_err(failed)?;
        Ok(Self { port })
    }

    /// Whether it is ready before the time is over.
    fn ready(&self, what: PollFlags, wait: Duration) -> Result<bool, LinkError> {
        // milliseconds to a second: it always fits
        let wait = Timespec::try_from(wait).unwrap_or(Timespec {
            tv_sec: 0,
            tv_nsec: 1_000_000,
        });
        let mut port = [PollFd::new(&self.port, what)];
        match poll(&mut port, Some(&wait)) {
            Ok(0) | Err(Errno::INTR) => Ok(false),
            Ok(_) => Ok(true),
            Err(e) => Err(gone(e)),
        }
    }
}

fn gone(e: Errno) -> LinkError {
    LinkError(match e {
        Errno::IO | Errno::NXIO | Errno::NODEV | Errno::PIPE => "unplugged".to_owned(),
        e => format!("the port fails: {e}"),
    })
}

impl Link for SerialLink {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, LinkError> {
        if !self.ready(PollFlags::IN, wait)? {
            return Ok(0);
        }
        match rustix::io::read(&self.port, buffer) {
            // a CDC device that is gone reads as an end of file
            Ok(0) => Err(LinkError("unplugged".to_owned())),
            Ok(n) => Ok(n),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(e) => Err(gone(e)),
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
                    if waited >= WRITE_WITHIN {
                        return Err(LinkError("the port takes no bytes".to_owned()));
                    }
                    self.ready(PollFlags::OUT, WRITE_SLICE)?;
                    waited += WRITE_SLICE;
                }
                Err(e) => return Err(gone(e)),
            }
        }
        Ok(())
    }
}
