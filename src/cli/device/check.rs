//! `study device info` and `study device check`.

use super::nonce;
use super::port::PortWire;
use crate::cli::playback::{COMMISSIONED, COMMISSIONED_FILE, Commissioned, Place, Port, Waiting};
use crate::cli::{Console, Failure, Kind};
use crate::device::check::{self, Commissioning, Verdict};
use crate::device::host::name;
use crate::device::{Device as _, process};
use std::path::{Path, PathBuf};
use study_base::text::Untrusted;
use study_wire::message::Identity;

/// Arguments of `study device info`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct InfoArgs {
    #[command(flatten)]
    place: Place,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Arguments of `study device check`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct CheckArgs {
    #[command(flatten)]
    place: Port,
    /// Play each table of this study as well, and compare what was rendered with it
    #[arg(long, value_name = "PROTOCOL")]
    models: Option<PathBuf>,
    /// Keep the verdict in device-check.json, so that it stands in every session that
    /// is started in this folder on this device
    #[arg(long)]
    save: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Says who is there.
pub(in crate::cli) fn info(args: &InfoArgs, console: &mut Console) -> Result<(), Failure> {
    if args.place.is_program()? {
        return program(args, console);
    }
    let mut wire = PortWire::open(&args.place.serial)?;
    let place = wire.place.clone();
    let found = check::greet(&mut wire, nonce());
    let device = found.map_err(|why| {
        let place = Untrusted(&place);
        Failure::new(Kind::Device, format!("{place}: {}", Untrusted(&why)))
            .hint("is it powered, and does it speak docs/wire.md at this baud rate?")
    })?;
    if args.json {
        let document = serde_json::json!({
            "format": "study-device-info/1",
            "port": place,
            "device": described(&device),
        });
        return console.out(format!("{document:#}\n"));
    }
    let [low, high] = device.stroke_mm;
    let flags = [
        (device.flags.simulated, "simulated: nothing is measured"),
        (device.flags.telemetry, "telemetry"),
        (device.flags.force_sensor, "force sensor"),
        (device.flags.probe, "probe mode"),
    ];
    let flags: Vec<&str> = flags.iter().filter(|f| f.0).map(|f| f.1).collect();
    let mut lines = vec![
        ("serial number", name(&device.serial)),
        ("firmware", name(&device.firmware)),
        (
            "wire format",
            format!("{} to {}", device.versions[0], device.versions[1]),
        ),
        ("has", flags.join(", ")),
        ("force", format!("at most {} N", device.force_n)),
        ("velocity", format!("at most {} mm/s", device.velocity_mm_s)),
        ("stroke", format!("{low} to {high} mm")),
        (
            "stiffness",
            format!("at most {} N/mm", device.stiffness_n_per_mm),
        ),
        (
            "damping",
            format!("at most {} N·s/mm", device.damping_n_s_per_mm),
        ),
        ("servo", format!("{} Hz", device.servo_hz)),
        ("telemetry", format!("at most {} Hz", device.telemetry_hz)),
        ("watchdog", format!("{} ms", device.watchdog_ms)),
        ("tables", format!("at most {} nodes", device.most_nodes)),
        (
            "playbacks",
            format!("at most {} s", f64::from(device.longest_ms) / 1e3),
        ),
        ("state", device.state.as_str().to_owned()),
    ];
    if device.fault.code() != 0 {
        lines.push(("because", device.fault.as_str().to_owned()));
    }
    console.out(aligned(&lines))
}

/// What a program says of itself.
fn program(args: &InfoArgs, console: &mut Console) -> Result<(), Failure> {
    let opened = args.place.open_program(&mut Waiting::in_a_line(console))?;
    let Some(device) = opened else { return Ok(()) };
    let (command, device) = (device.command().join(" "), device.identity());
    let [force_n, velocity_mm_s] = [device.limits.force_n, device.limits.velocity_mm_s];
    if args.json {
        let document = serde_json::json!({
            "format": "study-device-info/1",
            "command": command,
            "device": {
                "id": device.id,
                "language": process::FORMAT,
                "simulated": device.simulated,
                "telemetry": device.telemetry,
                "force_n": force_n.get(),
                "velocity_mm_s": velocity_mm_s.get(),
            },
        });
        return console.out(format!("{document:#}\n"));
    }
    let flags = [
        (device.simulated, "simulated: every session is a pilot"),
        (device.telemetry, "telemetry"),
    ];
    let flags: Vec<&str> = flags.iter().filter(|f| f.0).map(|f| f.1).collect();
    let lines = [
        ("program", Untrusted(&command).to_string()),
        ("id", Untrusted(&device.id).to_string()),
        ("language", process::FORMAT.to_owned()),
        ("has", flags.join(", ")),
        ("force", format!("at most {} N", force_n.get())),
        ("velocity", format!("at most {} mm/s", velocity_mm_s.get())),
    ];
    console.out(aligned(&lines))
}

fn aligned(lines: &[(&str, String)]) -> String {
    let line = |(what, value): &(&str, String)| format!("{what:<14} {value}\n");
    lines.iter().map(line).collect()
}

fn described(device: &Identity) -> serde_json::Value {
    serde_json::json!({
        "serial": name(&device.serial),
        "firmware": name(&device.firmware),
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
        "most_nodes": device.most_nodes,
        "longest_ms": device.longest_ms,
    })
}

/// Looks at a device, clause by clause.
pub(in crate::cli) fn check(args: &CheckArgs, console: &mut Console) -> Result<(), Failure> {
    let mut wire = PortWire::open(&args.place)?;
    let place = wire.place.clone();
    if !args.json {
        console.say(format!(
            "the device plays with up to {} N: hold the handle near the middle of its stroke",
            check::FORCE_N
        ));
    }
    let json = args.json;
    let mut unsaid = Ok(());
    let found = check::commission(&mut wire, nonce(), &mut |verdict| {
        if !json && unsaid.is_ok() {
            unsaid = console.out(line(verdict));
        }
    });
    unsaid?;
    // the port has one owner at a time
    drop(wire);
    let rendered = match &args.models {
        Some(protocol) if found.passes() => {
            Some(super::rendered::look(protocol, &args.place, console, json)?)
        }
        _ => None,
    };
    if args.save {
        save(&found)?;
    }
    let passes = found.passes();
    if json {
        let document = serde_json::json!({
            "format": "study-device-check/1",
            "port": place,
            "device": found.device.as_ref().map(described),
            "pass": passes,
            "verdicts": found.verdicts,
            "latency_ms": found.latency_ms,
            "models": rendered,
        });
        console.out(format!("{document:#}\n"))?;
    } else {
        console.out(format!("{}\n", found.summary()))?;
    }
    if passes {
        return Ok(());
    }
    Err(refused(&place, &found))
}

fn save(found: &Commissioning) -> Result<(), Failure> {
    let Some(device) = &found.device else {
        return Ok(());
    };
    let kept = Commissioned {
        format: COMMISSIONED.to_owned(),
        device: name(&device.serial),
        at: chrono::Local::now()
            .format("%Y-%m-%dT%H:%M:%S%:z")
            .to_string(),
        summary: found.summary(),
    };
    let path = Path::new(COMMISSIONED_FILE);
    let text = serde_json::to_string_pretty(&kept).map_err(|e| Failure::new(Kind::Bug, e))?;
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

fn refused(place: &str, found: &Commissioning) -> Failure {
    let broken: Vec<&str> = found
        .verdicts
        .iter()
        .filter(|v| !v.pass)
        .map(|v| v.clause)
        .collect();
    Failure::new(
        Kind::Device,
        format!(
            "{}: it does not keep clause {} of docs/wire.md",
            Untrusted(place),
            broken.join(", ")
        ),
    )
    .hint("nobody should have it in their hand before that is put right")
}
