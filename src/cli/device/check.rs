//! `study device info` and `study device check`.

use super::port::PortConnection;
use super::record::{Record, RecordKind, commissioned_line};
use super::rendering;
use super::single_playback::Pace;
use crate::cli::device_selection::{
    COMMISSIONED, COMMISSIONED_FILE, Commissioned, DeviceAddress, Tested,
};
use crate::cli::{Console, Failure, Kind};
use std::path::{Path, PathBuf};
use study_base::text::Untrusted;
use study_device::Device;
use study_device::check::{self, Commissioning, Progress, Verdict};
use study_device::host::{HostSettings, display_name};
use study_device::link::{nonce, priority};
use study_wire::message::{Fault, Identity};

/// Arguments of `study device info`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct InfoArgs {
    #[command(flatten)]
    pub(super) address: DeviceAddress,
    /// Folder of all results, which has the records of its commissionings
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Print one JSON document
    #[arg(long)]
    pub(super) json: bool,
}

/// Arguments of `study device check`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct CheckArgs {
    #[command(flatten)]
    pub(super) address: DeviceAddress,
    /// Do not play tables in which each term, look-up and direction rule counts, and judge each
    /// playback as in a session, while somebody moves the handle: a session for which the protocol
    /// asks for a check does not accept it
    #[arg(long)]
    pub(super) without_rendering: bool,
    /// The default since release 0.2
    #[arg(long, hide = true, conflicts_with = "without_rendering")]
    rendering: bool,
    /// Print all messages of the wire format with their bytes, as JSON, and end
    #[arg(long, exclusive = true)]
    pub(super) golden: bool,
    /// Also play each table of this study and compare the rendered force with the table
    #[arg(long, value_name = "PROTOCOL")]
    pub(super) models: Option<PathBuf>,
    /// Save the result in devices/ of the results folder, where sessions look for it, and in
    /// device-check.json
    #[arg(long)]
    pub(super) save: bool,
    /// Folder of all results
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub(super) results: PathBuf,
    /// Print one JSON document
    #[arg(long)]
    pub(super) json: bool,
}

/// Prints identity and limits of a device.
pub(in crate::cli) fn info(args: &InfoArgs, console: &mut Console) -> Result<(), Failure> {
    let mut connection = PortConnection::open(&args.address.serial)?;
    let address = connection.address.clone();
    let device = check::identify(&mut connection, nonce()).map_err(|error| {
        let (address, error) = (Untrusted(&address), error.to_string());
        Failure::device(format!("{address}: {}", Untrusted(&error)))
            .hint("check its power, the baud rate, and that it implements docs/wire.md")
    })?;
    let tested = Tested {
        serial: display_name(&device.serial),
        firmware: Some(display_name(&device.firmware)),
        simulated: device.flags.simulated,
    };
    let commissioned = commissioned(args, &tested);
    if args.json {
        let document = serde_json::json!({
            "format": "study-device-info/1",
            "port": address,
            "device": described(&device),
            "commissioned": commissioned,
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
        ("commissioned", Untrusted(&commissioned).to_string()),
    ];
    if device.fault != Fault::None {
        lines.push(("fault", device.fault.to_string()));
    }
    console.out(aligned(&lines))
}

pub(super) fn at_most(value: f64, unit: &str) -> String {
    format!("at most {value} {unit}")
}

/// What is known of its commissionings.
pub(super) fn commissioned(args: &InfoArgs, tested: &Tested) -> String {
    let now = chrono::Local::now().fixed_offset();
    commissioned_line(&args.results, tested, now)
}

/// The features that a device has.
pub(super) fn list(features: &[(bool, &str)]) -> String {
    let present = features.iter().filter(|(present, _)| *present);
    let names: Vec<&str> = present.map(|(_, name)| *name).collect();
    names.join(", ")
}

pub(super) fn aligned(lines: &[(&str, String)]) -> String {
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
    if args.golden {
        return console.document(GOLDEN);
    }
    // A host that is late says nothing of the device.
    priority::raise();
    let mut connection = PortConnection::open(&args.address.serial)?;
    let address = connection.address.clone();
    if !args.json {
        console.say(format!(
            "the device will apply up to {} N: hold the handle near the middle of its stroke",
            check::FORCE_N
        ));
    }
    let json = args.json;
    let mut printed = Ok(());
    let result = check::commission(&mut connection, nonce(), &mut |progress| match progress {
        _ if json => {}
        Progress::Ask(what) => console.say(what),
        Progress::Judged(verdict) if printed.is_ok() => printed = console.out(line(verdict)),
        Progress::Judged(_) => {}
    });
    printed?;
    // The port can be opened only once at a time.
    drop(connection);
    let port = &args.address.serial;
    let rendered = match &args.models {
        Some(protocol) if result.passes() => {
            Some(super::rendered::compare_all(protocol, port, console, json)?)
        }
        _ => None,
    };
    let rendering = match (!args.without_rendering && result.passes(), &result.device) {
        (true, Some(told)) if !told.flags.telemetry => {
            console.say("its rendering cannot be judged: it reports no samples");
            None
        }
        (true, Some(told)) => {
            let [low, high] = told.stroke_mm;
            let mut device = port.open_serial(HostSettings::default())?;
            Some(judge_rendering(
                &mut device,
                middle(low, high),
                console,
                json,
            )?)
        }
        _ => None,
    };
    let mut summary = result.summary();
    if let Some(all) = &rendering {
        let [passed, failed, open] = rendering::tally(all);
        summary.push_str(&format!(
            "; rendering: {passed} of {} passed, {failed} failed, {open} not judged",
            all.len()
        ));
    }
    let right = |all: &Vec<_>| rendering::tally(all)[0] == all.len();
    let passes = result.passes()
        && rendering.as_ref().is_none_or(right)
        && (rendered.iter().flatten()).all(super::rendered::Rendered::is_right);
    if args.save
        && let Some(device) = &result.device
    {
        save(&result)?;
        let tested = Tested {
            serial: display_name(&device.serial),
            firmware: Some(display_name(&device.firmware)),
            simulated: device.flags.simulated,
        };
        let parts = serde_json::json!({
            "clauses": result.verdicts,
            "rendering": rendering,
            "models": rendered,
        });
        let record = Record::new(RecordKind::Check, tested, passes, summary.clone(), parts);
        let path = record.save(&args.results)?;
        console.say(format!("saved: {}", path.display()));
    }
    if json {
        let document = serde_json::json!({
            "format": "study-device-check/1",
            "port": address,
            "device": result.device.as_ref().map(described),
            "pass": passes,
            "verdicts": result.verdicts,
            "latency_ms": result.latency_ms,
            "models": rendered,
            "rendering": rendering,
        });
        console.json(&document)?;
    } else {
        console.out(format!("{summary}\n"))?;
    }
    if passes {
        return Ok(());
    }
    Err(failed(&address, &result))
}

/// Plays the tables of the rendering check and prints each result.
pub(super) fn judge_rendering(
    device: &mut dyn Device,
    middle_mm: f64,
    console: &mut Console,
    quiet: bool,
) -> Result<Vec<rendering::Rendered>, Failure> {
    if !quiet {
        console.say(rendering::prompt());
    }
    rendering::check(device, middle_mm, Pace::real(), &mut |result| match quiet {
        true => Ok(()),
        false => console.out(result.line()),
    })
}

/// Where the tables of the rendering check lie: the middle of the stroke; the simulated
/// device has its handle at 17.5 mm and a stroke of −20 to 60 mm.
fn middle(low: f64, high: f64) -> f64 {
    0.5 * (low + high)
}

/// The golden bytes of docs/wire.md.
const GOLDEN: &str = include_str!("../../../docs/wire-frames.json");

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

pub(super) fn line(verdict: &Verdict) -> String {
    let mark = match (verdict.pass, verdict.judged) {
        (true, _) => "pass",
        (false, true) => "FAIL",
        (false, false) => "open",
    };
    format!(
        "{mark}  {:<width$} {}\n            {}\n",
        verdict.clause,
        verdict.what,
        Untrusted(&verdict.seen),
        // those of a program have names
        width = if verdict.clause.starts_with(char::is_numeric) {
            5
        } else {
            7
        },
    )
}

fn failed(address: &str, result: &Commissioning) -> Failure {
    let failed = result.failed_clauses();
    let plural = if failed.len() == 1 { "" } else { "s" };
    let clauses = failed.join(", ");
    if clauses.is_empty() && !result.unjudged_clauses().is_empty() {
        return Failure::device(format!(
            "{}: not every clause could be judged",
            Untrusted(address)
        ))
        .hint(
            "end other programs, do what is asked and repeat the check; the device is not accused",
        );
    }
    if clauses.is_empty() {
        return Failure::device(format!(
            "{}: its force is not shown to be that of its tables",
            Untrusted(address)
        ))
        .hint("do not use it with participants before this is corrected");
    }
    Failure::device(format!(
        "{}: it violates clause{plural} {clauses} of docs/wire.md",
        Untrusted(address)
    ))
    .hint("do not use it with participants before this is corrected")
}
