//! `study device`: ports, device tests and the simulated device.

pub(super) mod before;
mod check;
mod commission;
mod hold;
pub(super) mod port;
mod program;
mod record;
mod rendered;
mod rendering;
mod safety;
mod simulate;
mod single_playback;

use super::{Console, Failure};
use serialport::SerialPortType;
use std::path::{Path, PathBuf};
use study_analysis::load;
use study_base::sort::SmallSort as _;
use study_base::text::Untrusted;
use study_plan::protocol::DeviceKind;

/// Arguments of `study device`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// List the serial ports of this machine
    List {
        /// Print one JSON document
        #[arg(long)]
        json: bool,
    },
    /// Show the identity and the limits of a device
    Info(check::InfoArgs),
    /// Test a device on a serial port against the clauses of docs/wire.md
    Check(check::CheckArgs),
    /// Guide through what only a person can check: weight, ruler, emergency stop, friction
    Commission(commission::Args),
    /// Run a simulated device on a pseudo-terminal or at an address of this computer; its port
    /// is the first line of output
    Simulate(simulate::Args),
    /// Play one table without a session
    #[command(hide = true)]
    Hold(hold::Args),
    /// Measure the time to zero force after the host is killed, stopped, stalled or
    /// unplugged, on a simulated device
    #[command(hide = true)]
    Safety(safety::Args),
    /// List the codes for the labels of physical samples; not for the experimenter
    Codes {
        /// A protocol.toml or the folder that contains it
        protocol: PathBuf,
    },
}

/// Runs a subcommand of `study device`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    match &args.what {
        What::List { json } => list(*json, console),
        What::Info(args) => match args.address.is_program()? {
            true => program::info(args, console),
            false => check::info(args, console),
        },
        What::Check(args) => match !args.golden && args.address.is_program()? {
            true => program::check(args, console),
            false => check::check(args, console),
        },
        What::Commission(args) => commission::run(args, console),
        What::Hold(args) => hold::run(args, console),
        What::Safety(args) => safety::run(args, console),
        What::Simulate(args) => simulate::run(args, console),
        What::Codes { protocol } => codes(protocol, console),
    }
}

fn codes(path: &Path, console: &mut Console) -> Result<(), Failure> {
    let loaded = load::load(path)?;
    let codes = crate::runner::sample_codes(&loaded.protocol);
    let kind = loaded.protocol.device.kind;
    let mut out = String::new();
    for model in &loaded.protocol.models {
        if model.device.unwrap_or(kind) == DeviceKind::Manual
            && let Some(code) = codes.get(&model.id)
        {
            out.push_str(&format!("{code}  {}\n", model.id));
        }
    }
    if out.is_empty() {
        return Err(
            Failure::input(format!("{}: no sample is mounted by hand", path.display())).hint(
                "set device = \"manual\" in the model's entry, or kind = \"manual\" in [device]",
            ),
        );
    }
    console.out(out)
}

/// A serial port and the connected device, as far as the system knows.
#[derive(serde::Serialize)]
struct ListedPort {
    path: String,
    what: String,
    serial_number: Option<String>,
}

fn list(json: bool, console: &mut Console) -> Result<(), Failure> {
    let found = serialport::available_ports()
        .map_err(|e| Failure::device(format!("cannot list the serial ports: {e}")))?;
    let mut ports: Vec<ListedPort> = found
        .into_iter()
        .map(|port| {
            let (what, serial_number) = describe(port.port_type);
            ListedPort {
                path: port.port_name,
                what,
                serial_number,
            }
        })
        .collect();
    ports.small_sort_by(|a, b| a.path.cmp(&b.path));
    if json {
        let document = serde_json::json!({"format": "study-device-list/1", "ports": ports});
        return console.json(&document);
    }
    if ports.is_empty() {
        return console.out("no serial ports on this machine\n");
    }
    let mut out = String::new();
    for port in &ports {
        let serial = port.serial_number.as_deref().unwrap_or("");
        out.push_str(&format!(
            "{:<24} {} {}\n",
            Untrusted(&port.path),
            Untrusted(&port.what),
            Untrusted(serial)
        ));
    }
    console.out(out)
}

fn describe(kind: SerialPortType) -> (String, Option<String>) {
    match kind {
        SerialPortType::UsbPort(usb) => {
            let product = usb.product.unwrap_or_else(|| "USB".to_owned());
            (
                format!("{product} ({:04x}:{:04x})", usb.vid, usb.pid),
                usb.serial_number,
            )
        }
        SerialPortType::BluetoothPort => ("Bluetooth".to_owned(), None),
        SerialPortType::PciPort => ("built in".to_owned(), None),
        SerialPortType::Unknown => ("unknown".to_owned(), None),
    }
}
