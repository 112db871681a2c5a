//! Measures a device, which stays limp.

use super::super::Failure;
use super::super::device::port::PortConnection;
use super::super::device_selection::{DeviceAddress, SerialPortArgs};
use super::{Kind, system};
use crate::doctor::{Connected, Device, Spread, Use};
use std::time::Duration;
use study_device::check::{self, RoundTrips};
use study_device::host::display_name;
use study_device::link::{nonce, priority};
use study_device::process::check as program;
use study_plan::protocol::DeviceKind;

/// Number of round trips.
const TRIPS: usize = 500;
/// Longest time for them.
const TIME: Duration = Duration::from_secs(3);

/// A device that was named.
#[derive(Debug, Clone)]
pub(super) enum Named {
    /// A port, with its address for people and its rate.
    Port(SerialPortArgs, String, Option<u32>),
    /// A program and its arguments.
    Program(Vec<String>),
}

/// The device that the arguments name, or for the kind of a protocol `device.toml`.
///
/// # Errors
/// [`Failure`] if the arguments contradict each other.
pub(super) fn named(
    address: &DeviceAddress,
    kind: Option<DeviceKind>,
) -> Result<Option<Named>, Failure> {
    let serial = &address.serial;
    let given = address.command.is_some() || serial.port.is_some() || serial.baud.is_some();
    let found = match (given, kind) {
        (true, _) if address.is_program()? => Named::program(address),
        (true, _) => Named::port(serial),
        (false, Some(DeviceKind::Serial)) => Named::port(serial),
        (false, Some(DeviceKind::Process)) => Named::program(address),
        (false, _) => return Ok(None),
    };
    match found {
        // Nothing was asked for by an argument.
        Err(failure) if !given && failure.kind == Kind::Usage => Ok(None),
        found => found.map(Some),
    }
}

impl Named {
    fn port(port: &SerialPortArgs) -> Result<Self, Failure> {
        let opener = port.serial()?;
        // An address over TCP has no rate.
        let baud = match opener.byte_time().is_zero() {
            true => None,
            false => Some(port.bits_per_s()?),
        };
        Ok(Self::Port(port.clone(), opener.address(), baud))
    }

    fn program(address: &DeviceAddress) -> Result<Self, Failure> {
        Ok(Self::Program(address.process()?))
    }

    /// What a device like this is used for.
    pub(super) fn purpose(&self) -> Use {
        match self {
            Self::Port(..) => Use::Serial,
            Self::Program(_) => Use::Hand,
        }
    }

    fn failed(&self, why: String) -> Device {
        match self {
            Self::Port(_, address, _) => Device::failed(Connected::Port, address.clone(), why),
            Self::Program(command) => Device::failed(Connected::Program, command.join(" "), why),
        }
    }

    /// A device that has said nothing for so long.
    pub(super) fn silent(&self, time: Duration) -> Device {
        self.failed(format!("no answer within {:.0} s", time.as_secs_f64()))
    }

    /// Measures it. What it does not do is a result.
    pub(super) fn measure(&self) -> Device {
        let measured = match self {
            Self::Port(port, address, baud) => of_port(port, address, *baud),
            Self::Program(command) => of_program(command),
        };
        measured.unwrap_or_else(|why| self.failed(why))
    }
}

fn of_port(port: &SerialPortArgs, address: &str, baud: Option<u32>) -> Result<Device, String> {
    // As the thread that serves a link.
    priority::raise();
    let opened = PortConnection::open(port).map_err(|failure| {
        let own = format!("{address}: ");
        let message = failure.message;
        message.strip_prefix(&own).unwrap_or(&message).to_owned()
    });
    let measured = check::round_trips(&mut opened?, nonce(), TRIPS, TIME);
    let RoundTrips {
        device,
        trips_ms,
        line_ms,
    } = measured.map_err(|failure| failure.to_string())?;
    Ok(Device {
        connected: Connected::Port,
        address: address.to_owned(),
        failure: None,
        id: Some(display_name(&device.serial)),
        firmware: Some(display_name(&device.firmware)),
        simulated: device.flags.simulated,
        baud,
        watchdog_ms: Some(device.watchdog_ms.into()),
        hello_ms: None,
        trips: Spread::of(trips_ms),
        line_ms,
        adapter_ms: system::adapter_latency_ms(address),
    })
}

fn of_program(command: &[String]) -> Result<Device, String> {
    priority::raise_nice();
    let measured = program::round_trips(command, TRIPS, TIME).map_err(|error| match error {
        study_device::DeviceError::Lost(why) => why,
        error => error.to_string(),
    })?;
    let identity = measured.told.identity;
    Ok(Device {
        connected: Connected::Program,
        address: command.join(" "),
        failure: None,
        id: Some(identity.id),
        firmware: identity.firmware,
        simulated: identity.simulated,
        baud: None,
        watchdog_ms: Some(1e3 * measured.told.watchdog.as_secs_f64()),
        hello_ms: Some(measured.hello_ms),
        trips: Spread::of(measured.trips_ms),
        line_ms: 0.0,
        adapter_ms: None,
    })
}
