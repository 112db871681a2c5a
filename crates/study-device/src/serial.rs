//! Serial ports as links.
//!
//! A port is found again by the serial number of its USB adapter, even when it is
//! plugged in elsewhere; without a serial number, by its path.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
pub use unix::SerialLink;
#[cfg(windows)]
pub use windows::SerialLink;

use super::link::{Link, LinkError, Opener};
use serialport::{SerialPortInfo, SerialPortType};
use std::time::Duration;

/// Default rate, bits per second: enough for telemetry of 20 bytes per sample at 1 kHz.
pub const BAUD: u32 = 460_800;

/// Opens one serial port at one rate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SerialOpener {
    path: String,
    baud: u32,
    /// Serial number of the USB adapter, if it is known.
    usb_serial: Option<String>,
}

impl SerialOpener {
    /// The port at `path`, such as `/dev/ttyUSB0` or `COM3`, at `baud` bits per second (ignored by
    /// USB CDC devices and pseudo-terminals). The serial number of a USB port is stored;
    /// a given `usb_serial` takes precedence over the path.
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
                    return Err(LinkError::NoSuchUsbSerial(serial.clone()));
                }
                None => {}
            }
        }
        Ok(Box::new(SerialLink::open(&self.path, self.baud)?))
    }

    fn address(&self) -> String {
        self.path.clone()
    }

    /// With start and stop bit. USB is faster.
    fn byte_time(&self) -> Duration {
        Duration::from_secs(10) / self.baud.max(1)
    }
}
