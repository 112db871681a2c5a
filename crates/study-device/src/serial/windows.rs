//! A serial port on Windows: a COM port, which only one program can open.

use crate::link::{Link, LinkError};
use serialport::{COMPort, ClearBuffer, ErrorKind, SerialPort as _};
use std::io::{self, Read as _, Write as _};
use std::time::Duration;

/// A port that accepts no bytes for this time counts as lost.
const WRITE_TIMEOUT: Duration = Duration::from_millis(50);
/// Windows counts waits in whole milliseconds, and 0 would be no wait.
const LEAST_WAIT: Duration = Duration::from_millis(1);

/// An open port.
#[derive(Debug)]
pub struct SerialLink {
    port: COMPort,
}

impl SerialLink {
    /// Opens a port exclusively: 8 data bits, no parity, one stop bit, no flow control. DTR is
    /// off, so that a board whose reset is wired to it does not restart.
    ///
    /// # Errors
    /// [`LinkError`] if the port does not exist, is not a serial port, is in use, or does
    /// not support the settings.
    pub fn open(path: &str, baud: u32) -> Result<Self, LinkError> {
        let port = serialport::new(path, baud)
            .timeout(LEAST_WAIT)
            .dtr_on_open(false)
            .open_native()
            .map_err(|e| open_error(&e))?;
        // Discard what an earlier program left in the driver.
        port.clear(ClearBuffer::All).map_err(|e| open_error(&e))?;
        Ok(Self { port })
    }

    /// Sets how long reading and writing wait.
    fn wait(&mut self, wait: Duration) -> Result<(), LinkError> {
        let wait = wait.max(LEAST_WAIT);
        if self.port.timeout() == wait {
            return Ok(());
        }
        self.port
            .set_timeout(wait)
            .map_err(|e| LinkError::System(e.to_string()))
    }
}

fn open_error(error: &serialport::Error) -> LinkError {
    match error.kind {
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => LinkError::InUse,
        ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound) => LinkError::NoSuchPort,
        ErrorKind::InvalidInput => LinkError::NotSerial,
        _ => LinkError::System(error.to_string()),
    }
}

/// Errors of Windows with which a port answers whose adapter was pulled out: access denied, bad
/// command, general failure, operation aborted, device not connected.
const UNPLUGGED: [i32; 5] = [5, 22, 31, 995, 1167];

fn io_error(error: &io::Error) -> LinkError {
    match error.raw_os_error() {
        Some(number) if UNPLUGGED.contains(&number) => LinkError::Unplugged,
        _ => LinkError::System(error.to_string()),
    }
}

impl Link for SerialLink {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, LinkError> {
        self.wait(wait)?;
        match self.port.read(buffer) {
            Ok(count) => Ok(count),
            Err(e) if is_no_data(&e) => Ok(0),
            Err(e) => Err(io_error(&e)),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.wait(WRITE_TIMEOUT)?;
        let mut left = bytes;
        while !left.is_empty() {
            match self.port.write(left) {
                Ok(0) => return Err(LinkError::WriteTimeout),
                Ok(count) => left = &left[count..],
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) if e.kind() == io::ErrorKind::TimedOut => {
                    return Err(LinkError::WriteTimeout);
                }
                Err(e) => return Err(io_error(&e)),
            }
        }
        Ok(())
    }
}

fn is_no_data(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
    )
}
