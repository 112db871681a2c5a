//! `study device info` and `study device check`.

use super::port::PortConnection;
use crate::cli::device_selection::{
    COMMISSIONED, COMMISSIONED_FILE, Commissioned, DeviceAddress, SerialPortArgs, WaitDisplay,
};
use crate::cli::{Console, Failure, Kind};
use crate::device::check::{self, Commissioning, Verdict};
use crate::device::host::display_name;
use crate::device::link::nonce;
use crate::device::{Device as _, process};
use std::path::{Path, PathBuf};
use study_base::text::Untrusted;
use study_wire::message::{Fault, Identity};

/// Arguments of `study device info`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct InfoArgs {
    #[command(flatten)]
    address: DeviceAddress,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Arguments of `study device check`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct CheckArgs {
    #[command(flatten)]
    port: SerialPortArgs,
    /// Also play each table of this study and compare the rendered force with the table
    #[arg(long, value_name = "PROTOCOL")]
    models: Option<PathBuf>,
    /// Save the result in device-check.json; sessions with this device that are started
    /// in this folder record it
    #[arg(long)]
    save: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Prints identity and limits of a device.
pub(in crate::cli) fn info(args: &InfoArgs, console: &mut Console) -> Result<(), Failure> {
    if args.address.is_program()? {
        return program(args, console);
    }
    let mut connection = PortConnection::open(&args.address.serial)?;
    let address = connection.address.clone();
    let device = check::identify(&mut connection, nonce()).map_err(|error| {
        let (address, error) = (Untrusted(&address), error.to_string());
        Failure::device(format!("{address}: {}", Untrusted(&error)))
            .hint("check its power, the baud rate, and that it implements docs/wire.md")
    })?;
    if args.json {
        let document = serde_json::json!({
            "format": "study-device-info/1",
            "port": address,
            "device": described(&device),
        });
        return console.json(&document);
    }
    let [low, high] = device.stroke_mm;
    let [oldest, newest] = device.versions;
    let features = [
        (device.flags.simulated, "simulated: nothing is measured"),
        (device.flags.telemetry, "telemetry"),
        (device.flags.force_sensor, "force sensor"),
        (device.flags.probe, "probe mode"),
    ];
    let mut lines = vec![
        ("serial number", display_name(&device.serial)),
        ("firmware", display_name(&device.firmware)),
        ("wire format", format!("{oldest} to {newest}")),
        ("features", list(&features)),
        ("force", at_most(device.force_n, "N")),
        ("velocity", at_most(device.velocity_mm_s, "mm/s")),
        ("stroke", format!("{low} to {high} mm")),
        ("stiffness", at_most(device.stiffness_n_per_mm, "N/mm")),
        ("damping", at_most(device.damping_n_s_per_mm, "N·s/mm")),
        ("servo", format!("{} Hz", device.servo_hz)),
        ("telemetry", at_most(device.telemetry_hz, "Hz")),
        ("watchdog", format!("{} ms", device.watchdog_ms)),
        ("tables", at_most(device.max_nodes.into(), "nodes")),
        (
            "playbacks",
            at_most(f64::from(device.longest_ms) / 1e3, "s"),
        ),
        ("state", device.state.to_string()),
    ];
    if device.fault != Fault::None {
        lines.push(("fault", device.fault.to_string()));
    }
    console.out(aligned(&lines))
}

fn at_most(value: f64, unit: &str) -> String {
    format!("at most {value} {unit}")
}

/// The features that a device has.
fn list(features: &[(bool, &str)]) -> String {
    let present = features.iter().filter(|(present, _)| *present);
    let names: Vec<&str> = present.map(|(_, name)| *name).collect();
    names.join(", ")
}

/// Prints identity and limits of a controller program.
fn program(args: &InfoArgs, console: &mut Console) -> Result<(), Failure> {
    let mut display = WaitDisplay::in_a_line(console);
    let Some(device) = args.address.open_program(&mut display)? else {
        return Ok(());
    };
    let (command, device) = (device.command().join(" "), device.identity());
    let force_n = device.limits.force_n.get();
    let velocity_mm_s = device.limits.velocity_mm_s.get();
    if args.json {
        let document = serde_json::json!({
            "format": "study-device-info/1",
            "command": command,
            "device": {
                "id": device.id,
                "language": process::FORMAT,
                "simulated": device.simulated,
                "telemetry": device.telemetry,
                "force_n": force_n,
                "velocity_mm_s": velocity_mm_s,
            },
        });
        return console.json(&document);
    }
    let features = [
        (device.simulated, "simulated: every session is a pilot"),
        (device.telemetry, "telemetry"),
    ];
    let lines = [
        ("program", Untrusted(&command).to_string()),
        ("id", Untrusted(&device.id).to_string()),
        ("messages", process::FORMAT.to_owned()),
        ("features", list(&features)),
        ("force", at_most(force_n, "N")),
        ("velocity", at_most(velocity_mm_s, "mm/s")),
    ];
    console.out(aligned(&lines))
}

fn aligned(lines: &[(&str, String)]) -> String {
    let line = |(what, value): &(&str, String)| format!("{what:<14} {value}\n");
    lines.iter().map(line).collect()
}

fn described(device: &Identity) -> serde_json::Value {
    serde_json::json!({
        "serial": display_name(&device.serial),
        "firmware": display_name(&device.firmware),
        "versions": device.versions,
        "simulated": device.flags.simulated,
        "telemetry": device.flags.telemetry,
        "force_sensor": device.flags.force_sensor,
        "probe": device.flags.probe,
        "force_n": device.force_n,
        "velocity_mm_s": device.velocity_mm_s,
        "stroke_mm": device.stroke_mm,
        "stiffness_n_per_mm": device.stiffness_n_per_mm,
        "damping_n_s_per_mm": device.damping_n_s_per_mm,
        "servo_hz": device.servo_hz,
        "telemetry_hz": device.telemetry_hz,
        "watchdog_ms": device.watchdog_ms,
        "most_nodes": device.max_nodes,
        "longest_ms": device.longest_ms,
    })
}

/// Tests a device against the clauses of the wire format.
pub(in crate::cli) fn check(args: &CheckArgs, console: &mut Console) -> Result<(), Failure> {
    let mut connection = PortConnection::open(&args.port)?;
    let address = connection.address.clone();
    if !args.json {
        console.say(format!(
            "the device will apply up to {} N: hold the handle near the middle of its stroke",
            check::FORCE_N
        ));
    }
    let json = args.json;
    let mut printed = Ok(());
    let result = check::commission(&mut connection, nonce(), &mut |verdict| {
        if !json && printed.is_ok() {
            printed = console.out(line(verdict));
        }
    });
    printed?;
    // The port can be opened only once at a time.
    drop(connection);
    let rendered = match &args.models {
        Some(protocol) if result.passes() => Some(super::rendered::compare_all(
            protocol, &args.port, console, json,
        )?),
        _ => None,
    };
    if args.save {
        save(&result)?;
    }
    let passes = result.passes();
    if json {
        let document = serde_json::json!({
            "format": "study-device-check/1",
            "port": address,
            "device": result.device.as_ref().map(described),
            "pass": passes,
            "verdicts": result.verdicts,
            "latency_ms": result.latency_ms,
            "models": rendered,
        });
        console.json(&document)?;
    } else {
        console.out(format!("{}\n", result.summary()))?;
    }
    if passes {
        return Ok(());
    }
    Err(failed(&address, &result))
}

fn save(result: &Commissioning) -> Result<(), Failure> {
    let Some(device) = &result.device else {
        return Ok(());
    };
    let stored = Commissioned {
        format: COMMISSIONED.to_owned(),
        device: display_name(&device.serial),
        at: chrono::Local::now()
            .format("%Y-%m-%dT%H:%M:%S%:z")
            .to_string(),
        summary: result.summary(),
    };
    let path = Path::new(COMMISSIONED_FILE);
    let text = serde_json::to_string_pretty(&stored).map_err(|e| Failure::new(Kind::Bug, e))?;
    std::fs::write(path, text + "\n").map_err(|e| Failure::file(path, &e))
}

fn line(verdict: &Verdict) -> String {
    let mark = if verdict.pass { "pass" } else { "FAIL" };
    format!(
        "{mark}  {:<5} {}\n            {}\n",
        verdict.clause,
        verdict.what,
        Untrusted(&verdict.seen)
    )
}

fn failed(address: &str, result: &Commissioning) -> Failure {
    let clauses = result.failed_clauses().join(", ");
    Failure::device(format!(
        "{}: it violates clause {clauses} of docs/wire.md",
        Untrusted(address)
    ))
    .hint("do not use it with participants before this is corrected")
}
