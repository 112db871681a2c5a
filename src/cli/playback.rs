//! Which device plays: from the protocol, the arguments and `device.toml`.

use super::{Console, Failure, Kind};
use crate::device::host::Settings;
use crate::device::link::Threaded;
use crate::device::manual::{Beside, Manual};
use crate::device::process::{HELLO_WITHIN, Opened, Opening, ProcessDevice};
use crate::device::serial::{BAUD, SerialOpener};
use crate::device::virtual_device::{Options, VirtualDevice};
use crate::device::{Device, DeviceError};
use crate::tui;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::{Duration, Instant};
use study_base::text::Untrusted;
use study_core::protocol::{DeviceKind, Protocol};

/// What a rig has, in the folder that `study` is started in.
const RIG_FILE: &str = "device.toml";
/// Between two looks whether a program has said hello.
const SLICE: Duration = Duration::from_millis(20);
/// A program that says hello within this time is not told to be waited for.
const QUIET: Duration = Duration::from_millis(400);

/// Arguments that say where a device is.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct PlaybackArgs {
    /// Play on another kind of device than the protocol's: makes it a pilot
    #[arg(long, value_name = "KIND", value_parser = device_kind)]
    pub(super) device: Option<DeviceKind>,
    #[command(flatten)]
    pub(super) place: Place,
}

/// Where a device is, of either kind.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct Place {
    #[command(flatten)]
    pub(super) serial: Port,
    /// Program and arguments of a process device, split at spaces
    #[arg(long, value_name = "COMMAND")]
    pub(super) command: Option<String>,
}

/// Where a serial device is.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct Port {
    /// Serial port of the device
    #[arg(long, value_name = "PATH")]
    pub(super) port: Option<String>,
    /// Bits per second of a serial port that is not USB [default: 460800]
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(9600..=4_000_000))]
    pub(super) baud: Option<u32>,
}

/// The kinds of device, as words.
pub(super) fn device_kind(given: &str) -> Result<DeviceKind, String> {
    [
        DeviceKind::Simulated,
        DeviceKind::Serial,
        DeviceKind::Process,
        DeviceKind::Manual,
    ]
    .into_iter()
    .find(|kind| kind.as_str() == given)
    .ok_or_else(|| "it is one of simulated, serial, process, manual".to_owned())
}

/// `device.toml`: what stays with a rig and never stands in a protocol.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Rig {
    #[serde(default)]
    serial: RigSerial,
    #[serde(default)]
    process: RigProcess,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct RigSerial {
    port: Option<String>,
    baud: Option<u32>,
    usb_serial: Option<String>,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct RigProcess {
    command: Option<Vec<String>>,
}

impl Rig {
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
                .hint("it has [serial] with port, baud, usb_serial and [process] with command")
        })
    }
}

impl Place {
    /// Whether one device alone is named, and whether it is a program: by the
    /// arguments, or else by `device.toml`.
    pub(super) fn is_program(&self) -> Result<bool, Failure> {
        let port = self.serial.port.is_some() || self.serial.baud.is_some();
        let (program, port) = match (self.command.is_some(), port) {
            (false, false) => {
                let rig = Rig::read(Path::new(RIG_FILE))?;
                let port = rig.serial.port.is_some() || rig.serial.usb_serial.is_some();
                (rig.process.command.is_some(), port)
            }
            given => given,
        };
        match (program, port) {
            (true, true) => Err(Failure::new(
                Kind::Usage,
                "a port and a program are two devices",
            )
            .hint("say which one is meant: --port PATH or --command COMMAND")),
            (false, false) => Err(Failure::new(Kind::Usage, "which device? none is named").hint(
                format!(
                    "--port PATH or --command \"PROGRAM ARGUMENTS\", or [serial] or [process] in {RIG_FILE}; `study device list` shows the ports"
                ),
            )),
            (program, _) => Ok(program),
        }
    }

    /// Arguments that the kind of device has no use for are refused.
    fn suits(&self, kind: DeviceKind) -> Result<(), Failure> {
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
                Err(Failure::new(
                    Kind::Usage,
                    format!("{argument} makes no sense with a {} device", kind.as_str()),
                )
                .hint(format!(
                    "say kind = \"{other}\" in the protocol, or --device {other}, which makes it a pilot"
                )))
            }
        }
    }

    fn process(&self) -> Result<Vec<String>, Failure> {
        let given = self.command.as_deref();
        let given = given.map(|c| c.split_whitespace().map(str::to_owned).collect());
        let command: Option<Vec<String>> = match given {
            Some(command) => Some(command),
            None => Rig::read(Path::new(RIG_FILE))?.process.command,
        };
        command.filter(|c| !c.is_empty()).ok_or_else(|| {
            Failure::new(Kind::Usage, "a process device needs a program").hint(format!(
                "--command \"PROGRAM ARGUMENTS\", or [process] command = [\"PROGRAM\", \"ARGUMENT\"] in {RIG_FILE}"
            ))
        })
    }

    /// Starts the program and waits for its hello. `None` if somebody left.
    pub(super) fn open_program(
        &self,
        waiting: &mut Waiting<'_>,
    ) -> Result<Option<ProcessDevice>, Failure> {
        let command = self.process()?;
        let name = command.join(" ");
        let mut opening = Opening::begin(command).map_err(|e| unstarted(&e))?;
        let since = Instant::now();
        loop {
            opening = match opening.hello(SLICE).map_err(|e| unstarted(&e))? {
                Opened::Device(device) => return Ok(Some(*device)),
                Opened::NotYet(opening) => opening,
            };
            if since.elapsed() > QUIET && waiting.leaves(&name, since.elapsed()) {
                return Ok(None);
            }
        }
    }
}

impl Port {
    /// The serial port, from the arguments or `device.toml`.
    pub(super) fn serial(&self) -> Result<SerialOpener, Failure> {
        let rig = Rig::read(Path::new(RIG_FILE))?.serial;
        let given = self.port.clone();
        // a port that is named is meant, whatever is plugged in elsewhere
        let usb_serial = rig.usb_serial.filter(|_| given.is_none());
        let port = given.or(rig.port);
        if port.is_none() && usb_serial.is_none() {
            return Err(
                Failure::new(Kind::Usage, "a serial device needs a port").hint(format!(
                    "--port PATH, or [serial] port = \"PATH\" in {RIG_FILE}; `study device list` shows them"
                )),
            );
        }
        let baud = self.baud.or(rig.baud).unwrap_or(BAUD);
        let port = port.unwrap_or_default();
        Ok(SerialOpener::new(&port, baud, usb_serial))
    }

    /// Opens the device behind a serial port.
    pub(super) fn open_serial(&self, settings: Settings) -> Result<Threaded, Failure> {
        let opener = self.serial()?;
        Threaded::open(Box::new(opener), settings).map_err(|e| unopened(&e))
    }
}

/// How somebody is told that a program is waited for.
pub(super) enum Waiting<'a> {
    /// On a screen of its own, which can be left by a key.
    Screen(tui::Options, Option<tui::waiting::Waiting>),
    /// By a line on standard error; Ctrl-C leaves, as in any program.
    Line(&'a mut Console, bool),
}

impl<'a> Waiting<'a> {
    pub(super) fn on_screen(options: tui::Options) -> Self {
        Self::Screen(options, None)
    }

    pub(super) fn in_a_line(console: &'a mut Console) -> Self {
        Self::Line(console, false)
    }

    /// Shows what is waited for; whether somebody wants to leave.
    fn leaves(&mut self, program: &str, since: Duration) -> bool {
        match self {
            Self::Line(_, true) => {}
            Self::Line(console, told) => {
                *told = true;
                console.say(format!(
                    "waiting for `{program}` to say hello, at most {} s; Ctrl-C leaves",
                    HELLO_WITHIN.as_secs()
                ));
            }
            Self::Screen(options, None) => {
                // without a terminal it is waited for all the same; the session says
                // what is wrong with it
                if let Ok(screen) = tui::waiting::Waiting::open(*options) {
                    *self = Self::Screen(*options, Some(screen));
                }
            }
            Self::Screen(_, Some(screen)) => {
                return screen.leaves(program, since, HELLO_WITHIN);
            }
        }
        false
    }
}

/// Opens what plays `kind`, together with a person if some samples are mounted by
/// hand. `None` if somebody left while it was waited for.
pub(super) fn open(
    place: &Place,
    kind: DeviceKind,
    protocol: &Protocol,
    waiting: &mut Waiting<'_>,
) -> Result<Option<Box<dyn Device>>, Failure> {
    place.suits(kind)?;
    let device: Box<dyn Device> = match kind {
        DeviceKind::Simulated => Box::new(VirtualDevice::new(Options {
            seed: protocol.study.seed,
            ..Options::default()
        })),
        DeviceKind::Serial => Box::new(place.serial.open_serial(Settings::default())?),
        DeviceKind::Process => match place.open_program(waiting)? {
            Some(device) => Box::new(device),
            None => return Ok(None),
        },
        DeviceKind::Manual => return Ok(Some(Box::new(Manual::default()))),
    };
    Ok(Some(with_person(device, protocol)))
}

/// The device, together with a person if some samples are mounted by hand.
pub(super) fn with_person(device: Box<dyn Device>, protocol: &Protocol) -> Box<dyn Device> {
    let mut models = protocol.models.iter();
    if models.any(|m| m.device == Some(DeviceKind::Manual)) {
        Box::new(Beside::new(device))
    } else {
        device
    }
}

/// What the last `study device check --save` said, as it is kept beside
/// [`RIG_FILE`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Commissioned {
    /// `study-device-commissioned/1`.
    pub(super) format: String,
    /// Serial number of the device.
    pub(super) device: String,
    /// When, RFC 3339.
    pub(super) at: String,
    /// In one line.
    pub(super) summary: String,
}

/// Its `format`.
pub(super) const COMMISSIONED: &str = "study-device-commissioned/1";
/// Where it is kept.
pub(super) const COMMISSIONED_FILE: &str = "device-check.json";

/// What is known of the commissioning of a device; that of another one, and a file
/// that cannot be read, are told and not used.
pub(super) fn commissioned(device: &str, console: &mut Console) -> Option<String> {
    let bytes = std::fs::read(COMMISSIONED_FILE).ok()?;
    let kept: Commissioned = match serde_json::from_slice(&bytes) {
        Ok(kept) => kept,
        Err(e) => {
            console.say(format!("warning: {COMMISSIONED_FILE} is not used: {e}"));
            return None;
        }
    };
    if kept.format != COMMISSIONED || kept.device != device {
        return None;
    }
    let text = format!("{}: {}", kept.at, kept.summary);
    // it goes into every session: short, whatever somebody wrote into the file
    Some(text.chars().take(500).collect())
}

/// A program that is no device: its own words come first.
fn unstarted(why: &DeviceError) -> Failure {
    let text = match why {
        DeviceError::Lost(why) => why.clone(),
        why => why.to_string(),
    };
    Failure::new(Kind::Device, Untrusted(&text)).hint(
        "start it by hand: it has to print its hello as the first line (docs/devices.md, section 3)",
    )
}

fn unopened(why: &DeviceError) -> Failure {
    let text = why.to_string();
    Failure::new(Kind::Device, Untrusted(&text)).hint(
        "`study device list` shows the ports; `study device info --port PATH` asks who is there",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_rig_has_is_read_strictly() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(RIG_FILE);
        assert_eq!(Rig::read(&path).unwrap(), Rig::default());
        std::fs::write(
            &path,
            "[serial]\nport = \"/dev/ttyUSB0\"\nbaud = 921600\n[process]\ncommand = [\"a\", \"b c\"]\n",
        )
        .unwrap();
        let rig = Rig::read(&path).unwrap();
        assert_eq!(rig.serial.baud, Some(921_600));
        assert_eq!(rig.process.command.unwrap(), ["a", "b c"]);
        std::fs::write(&path, "[serial]\nprot = \"/dev/ttyUSB0\"\n").unwrap();
        let failure = Rig::read(&path).unwrap_err();
        let told = "device.toml:2: unknown field `prot`";
        assert!(failure.message.contains(told), "{}", failure.message);
    }

    #[test]
    fn an_argument_that_does_not_suit_the_kind_is_refused() {
        let place = |port: bool, command: bool| Place {
            serial: Port {
                port: port.then(|| "/dev/ttyUSB0".to_owned()),
                baud: None,
            },
            command: command.then(|| "a b".to_owned()),
        };
        assert!(place(true, false).suits(DeviceKind::Serial).is_ok());
        assert!(place(false, true).suits(DeviceKind::Serial).is_err());
        assert!(place(false, true).suits(DeviceKind::Process).is_ok());
        assert!(place(true, false).suits(DeviceKind::Process).is_err());
        assert!(place(true, false).suits(DeviceKind::Simulated).is_err());
        assert!(place(false, true).suits(DeviceKind::Manual).is_err());
        assert!(place(false, false).suits(DeviceKind::Manual).is_ok());
    }
}
