//! Selection of the device from the protocol, the arguments and `device.toml`.

use super::{Console, Failure, command_line};
use crate::rehearsal::with_manual_samples;
use crate::tui;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use study_base::text::Untrusted;
use study_device::host::HostSettings;
use study_device::link::tcp::TcpAddress;
use study_device::link::{LinkedDevice, Opener, Priority, priority};
use study_device::manual::Manual;
use study_device::process::{HELLO_TIMEOUT, Opened, Opening, ProcessDevice};
use study_device::serial::{BAUD, SerialOpener};
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, DeviceError};
use study_plan::protocol::{DeviceKind, Protocol};

/// Local device configuration in the working directory.
const CONFIG_FILE: &str = "device.toml";
/// Time between two checks whether a program has sent its hello.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Waiting for a program is shown only after this time.
const QUIET_WAIT: Duration = Duration::from_millis(400);

/// Arguments that select a device.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct DeviceArgs {
    /// Use another kind of device than the protocol's; the session is then a pilot
    #[arg(id = "device", long = "device", value_name = "KIND", value_parser = device_kind)]
    pub(super) kind: Option<DeviceKind>,
    #[command(flatten)]
    pub(super) address: DeviceAddress,
}

/// Address of a serial device or a controller program.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct DeviceAddress {
    #[command(flatten)]
    pub(super) serial: SerialPortArgs,
    /// Program and arguments of a process device, quoted as for a shell
    #[arg(long, value_name = "COMMAND")]
    pub(super) command: Option<String>,
}

/// Address of a serial device.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct SerialPortArgs {
    /// Serial port of the device, or its address over TCP, such as tcp://127.0.0.1:5000
    #[arg(long, value_name = "PORT")]
    pub(super) port: Option<String>,
    /// Baud rate of a serial port, ignored by USB [default: 460800]
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(9600..=4_000_000))]
    pub(super) baud: Option<u32>,
}

/// The value of an argument is not a kind of device.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("use one of simulated, serial, process, manual")]
pub(super) struct UnknownKind;

/// Parses a kind of device.
fn device_kind(given: &str) -> Result<DeviceKind, UnknownKind> {
    [
        DeviceKind::Simulated,
        DeviceKind::Serial,
        DeviceKind::Process,
        DeviceKind::Manual,
    ]
    .into_iter()
    .find(|kind| kind.as_str() == given)
    .ok_or(UnknownKind)
}

/// `device.toml`: addresses of the local devices, which are not part of a protocol.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct DeviceConfig {
    #[serde(default)]
    serial: SerialConfig,
    #[serde(default)]
    process: ProcessConfig,
    /// Folder on a second disk for `study run`.
    mirror: Option<PathBuf>,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct SerialConfig {
    port: Option<String>,
    baud: Option<u32>,
    usb_serial: Option<String>,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct ProcessConfig {
    command: Option<Vec<String>>,
}

impl DeviceConfig {
    fn read(path: &Path) -> Result<Self, Failure> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(e) => return Err(Failure::file(path, &e)),
        };
        toml::from_str(&text).map_err(|e| {
            let before = e.span().and_then(|span| text.get(..span.start));
            let line = before.map_or(1, |before| before.matches('\n').count() + 1);
            Failure::input(format!("{}:{line}: {}", path.display(), e.message()))
                .hint("allowed are mirror, [serial] with port, baud, usb_serial and [process] with command")
        })
    }
}

/// The mirror that `device.toml` names.
pub(super) fn mirror() -> Result<Option<PathBuf>, Failure> {
    Ok(DeviceConfig::read(Path::new(CONFIG_FILE))?.mirror)
}

impl DeviceAddress {
    /// Whether the arguments, or else `device.toml`, name a program; `false` for a port.
    ///
    /// # Errors
    /// [`Failure`] if both or none are named.
    pub(super) fn is_program(&self) -> Result<bool, Failure> {
        let port = self.serial.port.is_some() || self.serial.baud.is_some();
        let (program, port) = match (self.command.is_some(), port) {
            (false, false) => {
                let config = DeviceConfig::read(Path::new(CONFIG_FILE))?;
                let port = config.serial.port.is_some() || config.serial.usb_serial.is_some();
                (config.process.command.is_some(), port)
            }
            given => given,
        };
        match (program, port) {
            (true, true) => Err(Failure::usage("both a port and a program are given")
                .hint("choose one: --port PATH or --command COMMAND")),
            (false, false) => Err(Failure::usage("no device is given").hint(
                format!(
                    "--port PATH or --command \"PROGRAM ARGUMENTS\", or [serial] or [process] in {CONFIG_FILE}; `study device list` shows the ports"
                ),
            )),
            (program, _) => Ok(program),
        }
    }

    /// Refuses arguments that do not apply to the kind of device.
    fn check_kind(&self, kind: DeviceKind) -> Result<(), Failure> {
        let (port, baud) = (self.serial.port.is_some(), self.serial.baud.is_some());
        let useless = match kind {
            DeviceKind::Serial => [("--command", self.command.is_some()), ("", false)],
            DeviceKind::Process => [("--port", port), ("--baud", baud)],
            DeviceKind::Simulated | DeviceKind::Manual => [
                ("--port", port || baud),
                ("--command", self.command.is_some()),
            ],
        };
        match useless.iter().find(|(_, given)| *given) {
            None => Ok(()),
            Some((argument, _)) => {
                let other = match *argument {
                    "--command" => "process",
                    _ => "serial",
                };
                let kind = kind.as_str();
                let failure = format!("{argument} does not apply to a {kind} device");
                Err(Failure::usage(failure).hint(format!(
                    "set kind = \"{other}\" in the protocol, or use --device {other} for a pilot session"
                )))
            }
        }
    }

    /// The program and its arguments.
    pub(super) fn process(&self) -> Result<Vec<String>, Failure> {
        let command: Option<Vec<String>> = match &self.command {
            Some(command) => Some(command_line::words("--command", command)?),
            None => DeviceConfig::read(Path::new(CONFIG_FILE))?.process.command,
        };
        command.filter(|c| !c.is_empty()).ok_or_else(|| {
            Failure::usage("a process device needs a program").hint(format!(
                "--command \"PROGRAM ARGUMENTS\", or [process] command = [\"PROGRAM\", \"ARGUMENT\"] in {CONFIG_FILE}"
            ))
        })
    }

    /// Starts the program and waits for its hello. `None` if the user canceled.
    pub(super) fn open_program(
        &self,
        display: &mut WaitDisplay<'_>,
    ) -> Result<Option<ProcessDevice>, Failure> {
        let command = self.process()?;
        let name = command.join(" ");
        let mut opening = Opening::begin(command).map_err(|e| program_failure(&e))?;
        let since = Instant::now();
        loop {
            opening = match opening
                .hello(POLL_INTERVAL)
                .map_err(|e| program_failure(&e))?
            {
                Opened::Device(device) => return Ok(Some(*device)),
                Opened::NotYet(opening) => opening,
            };
            if since.elapsed() > QUIET_WAIT && display.canceled(&name, since.elapsed()) {
                return Ok(None);
            }
        }
    }
}

impl SerialPortArgs {
    /// The port that was given, for messages and files: without the token of an address.
    pub(super) fn shown_port(&self) -> Option<String> {
        let given = self.port.as_ref()?;
        Some(match TcpAddress::read(given) {
            Some(Ok(address)) => address.to_string(),
            _ => given.clone(),
        })
    }

    /// The serial port or the address over TCP, from the arguments or `device.toml`.
    pub(super) fn serial(&self) -> Result<Box<dyn Opener>, Failure> {
        let config = DeviceConfig::read(Path::new(CONFIG_FILE))?.serial;
        let baud = self.rate(&config);
        let given = self.port.clone();
        // A port argument takes precedence over a serial number in the file.
        let usb_serial = config.usb_serial.filter(|_| given.is_none());
        let port = given.or(config.port);
        if port.is_none() && usb_serial.is_none() {
            return Err(
                Failure::usage("a serial device needs a port").hint(format!(
                    "--port PATH, or [serial] port = \"PATH\" in {CONFIG_FILE}; `study device list` lists the ports"
                )),
            );
        }
        let port = port.unwrap_or_default();
        Ok(match TcpAddress::read(&port) {
            Some(address) => Box::new(address.map_err(|e| Failure::usage(format!("--port: {e}")))?),
            None => Box::new(SerialOpener::new(&port, baud, usb_serial)),
        })
    }

    /// Bits per second of a serial port, from the arguments or `device.toml`.
    pub(super) fn bits_per_s(&self) -> Result<u32, Failure> {
        let config = DeviceConfig::read(Path::new(CONFIG_FILE))?.serial;
        Ok(self.rate(&config))
    }

    fn rate(&self, config: &SerialConfig) -> u32 {
        self.baud.or(config.baud).unwrap_or(BAUD)
    }

    /// Opens the device behind a serial port.
    pub(super) fn open_serial(&self, settings: HostSettings) -> Result<LinkedDevice, Failure> {
        let opener = self.serial()?;
        // Heartbeats are sent only while this thread polls.
        priority::raise_nice();
        LinkedDevice::open(opener, settings).map_err(|e| port_failure(&e))
    }
}

/// How waiting for a program is shown.
pub(super) enum WaitDisplay<'a> {
    /// On a screen, which a key cancels. `None` until the screen is opened.
    Screen(tui::Options, Option<tui::waiting::Waiting>),
    /// By a line on standard error, with whether it was printed; Ctrl-C cancels.
    Line(&'a mut Console, bool),
}

impl<'a> WaitDisplay<'a> {
    pub(super) fn on_screen(options: tui::Options) -> Self {
        Self::Screen(options, None)
    }

    pub(super) fn in_a_line(console: &'a mut Console) -> Self {
        Self::Line(console, false)
    }

    /// Prints a line on standard error, unless a screen is open.
    fn say(&mut self, text: &str) {
        match self {
            Self::Line(console, _) => console.say(text),
            Self::Screen(_, Some(_)) => {}
            Self::Screen(_, None) => Console::of_process().say(text),
        }
    }

    /// Shows the waiting and returns whether the user canceled.
    fn canceled(&mut self, program: &str, since: Duration) -> bool {
        match self {
            Self::Line(_, true) => {}
            Self::Line(console, printed) => {
                *printed = true;
                console.say(format!(
                    "waiting up to {} s for the hello of `{program}`; Ctrl-C cancels",
                    HELLO_TIMEOUT.as_secs()
                ));
            }
            Self::Screen(options, None) => {
                // Without a terminal the waiting is not shown; the session reports the
                // missing terminal later.
                if let Ok(screen) = tui::waiting::Waiting::open(*options) {
                    *self = Self::Screen(*options, Some(screen));
                }
            }
            Self::Screen(_, Some(screen)) => {
                return screen.leaves(program, since, HELLO_TIMEOUT);
            }
        }
        false
    }
}

/// Opens a device of the given kind, combined with an experimenter if some samples are
/// mounted by hand. `None` if the user canceled.
pub(super) fn open(
    address: &DeviceAddress,
    kind: DeviceKind,
    protocol: &Protocol,
    display: &mut WaitDisplay<'_>,
) -> Result<Option<Box<dyn Device>>, Failure> {
    address.check_kind(kind)?;
    let device: Box<dyn Device> = match kind {
        DeviceKind::Simulated => {
            let options = Options::seeded(protocol.study.seed);
            Box::new(VirtualDevice::new(options))
        }
        DeviceKind::Serial => {
            let device = address.serial.open_serial(HostSettings::default())?;
            if device.status().priority == Priority::Usual {
                display.say(
                    "warning: the system permits no higher priority for the thread that sends heartbeats; \
                     on a busy computer the device may go limp (docs/devices.md)",
                );
            }
            Box::new(device)
        }
        DeviceKind::Process => match address.open_program(display)? {
            Some(device) => Box::new(device),
            None => return Ok(None),
        },
        DeviceKind::Manual => return Ok(Some(Box::new(Manual::default()))),
    };
    Ok(Some(with_manual_samples(device, protocol)))
}

/// The device that was tested.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Tested {
    /// Its serial number; of a program its id.
    pub(super) serial: String,
    /// Version of its firmware, if it tells it.
    pub(super) firmware: Option<String>,
    /// Whether it is simulated.
    pub(super) simulated: bool,
}

impl Tested {
    /// Of an open device.
    pub(super) fn of(device: &dyn Device) -> Self {
        let identity = device.identity();
        Self {
            serial: identity.id,
            firmware: identity.firmware,
            simulated: identity.simulated,
        }
    }
}

/// Result of the last `study device check --save`, stored next to [`CONFIG_FILE`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Commissioned {
    /// `study-device-commissioned/1`.
    pub(super) format: String,
    /// Serial number of the device.
    pub(super) device: String,
    /// Time of the check, RFC 3339.
    pub(super) at: String,
    /// Summary in one line.
    pub(super) summary: String,
}

/// Format identifier of [`Commissioned`].
pub(super) const COMMISSIONED: &str = "study-device-commissioned/1";
/// File name of [`Commissioned`].
pub(super) const COMMISSIONED_FILE: &str = "device-check.json";

/// The stored check of this device, for the session's records. A file that cannot be
/// read is reported; the check of another device is ignored.
pub(super) fn commissioned(device: &str, console: &mut Console) -> Option<String> {
    let bytes = std::fs::read(COMMISSIONED_FILE).ok()?;
    let stored: Commissioned = match serde_json::from_slice(&bytes) {
        Ok(stored) => stored,
        Err(e) => {
            console.say(format!("warning: {COMMISSIONED_FILE} is ignored: {e}"));
            return None;
        }
    };
    if stored.format != COMMISSIONED || stored.device != device {
        return None;
    }
    let text = format!("{}: {}", stored.at, stored.summary);
    // It is recorded in every session, so its length is limited.
    Some(text.chars().take(500).collect())
}

fn program_failure(error: &DeviceError) -> Failure {
    let text = match error {
        DeviceError::Lost(reason) => reason.clone(),
        error => error.to_string(),
    };
    Failure::device(Untrusted(&text))
        .hint("start it by hand: its first line has to be its hello (docs/devices.md, section 3)")
}

fn port_failure(error: &DeviceError) -> Failure {
    let text = error.to_string();
    Failure::device(Untrusted(&text)).hint(
        "`study device list` lists the ports; `study device info --port PATH` identifies a device",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_device_configuration_is_read_strictly() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(CONFIG_FILE);
        assert_eq!(DeviceConfig::read(&path).unwrap(), DeviceConfig::default());
        std::fs::write(
            &path,
            "[serial]\nport = \"/dev/ttyUSB0\"\nbaud = 921600\n[process]\ncommand = [\"a\", \"b c\"]\n",
        )
        .unwrap();
        let config = DeviceConfig::read(&path).unwrap();
        assert_eq!(config.serial.baud, Some(921_600));
        assert_eq!(config.process.command.unwrap(), ["a", "b c"]);
        std::fs::write(&path, "[serial]\nprot = \"/dev/ttyUSB0\"\n").unwrap();
        let failure = DeviceConfig::read(&path).unwrap_err();
        let expected = "device.toml:2: unknown field `prot`";
        assert!(failure.message.contains(expected), "{}", failure.message);
    }

    #[test]
    fn an_argument_that_does_not_apply_to_the_kind_is_refused() {
        let address = |port: bool, command: bool| DeviceAddress {
            serial: SerialPortArgs {
                port: port.then(|| "/dev/ttyUSB0".to_owned()),
                baud: None,
            },
            command: command.then(|| "a b".to_owned()),
        };
        assert!(address(true, false).check_kind(DeviceKind::Serial).is_ok());
        assert!(address(false, true).check_kind(DeviceKind::Serial).is_err());
        assert!(address(false, true).check_kind(DeviceKind::Process).is_ok());
        assert!(
            address(true, false)
                .check_kind(DeviceKind::Process)
                .is_err()
        );
        assert!(
            address(true, false)
                .check_kind(DeviceKind::Simulated)
                .is_err()
        );
        assert!(address(false, true).check_kind(DeviceKind::Manual).is_err());
        assert!(address(false, false).check_kind(DeviceKind::Manual).is_ok());
    }
}
