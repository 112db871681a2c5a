//! `study device info --command` and `study device check --command`: controller programs.

use super::check::{
    CheckArgs, InfoArgs, aligned, at_most, commissioned, judge_rendering, line, list,
};
use super::record::{Record, RecordKind};
use super::rendering::{self, Rendered};
use crate::cli::device_selection::{Tested, WaitDisplay};
use crate::cli::{Console, Failure};
use study_base::text::Untrusted;
use study_device::DeviceError;
use study_device::check::Verdict;
use study_device::link::priority;
use study_device::process::check as program_check;

/// Prints identity and limits of a controller program.
pub(super) fn info(args: &InfoArgs, console: &mut Console) -> Result<(), Failure> {
    let mut display = WaitDisplay::in_a_line(console);
    let Some(program) = args.address.open_program(&mut display)? else {
        return Ok(());
    };
    let commissioned = commissioned(args, &Tested::of(&program));
    let (command, told) = (program.command().join(" "), program.told().clone());
    let device = &told.identity;
    let force_n = device.limits.force_n.get();
    let velocity_mm_s = device.limits.velocity_mm_s.get();
    let watchdog_ms = 1e3 * told.watchdog.as_secs_f64();
    if args.json {
        let document = serde_json::json!({
            "format": "study-device-info/1",
            "command": command,
            "device": {
                "id": device.id,
                "language": told.format(),
                "version": device.firmware,
                "simulated": device.simulated,
                "telemetry": device.telemetry,
                "force_n": force_n,
                "velocity_mm_s": velocity_mm_s,
                "stroke_mm": device.stroke_mm,
                "stiffness_n_per_mm": device.stiffness_n_per_mm,
                "loop_hz": device.servo.map(|servo| servo.servo_hz),
                "watchdog_ms": watchdog_ms,
            },
            "commissioned": commissioned,
        });
        return console.json(&document);
    }
    let features = [
        (device.simulated, "simulated: every session is a pilot"),
        (device.telemetry, "telemetry"),
    ];
    let mut lines = vec![
        ("program", Untrusted(&command).to_string()),
        ("id", Untrusted(&device.id).to_string()),
    ];
    if let Some(version) = &device.firmware {
        lines.push(("version", Untrusted(version).to_string()));
    }
    lines.extend([
        ("messages", told.format().to_owned()),
        ("features", list(&features)),
        ("force", at_most(force_n, "N")),
        ("velocity", at_most(velocity_mm_s, "mm/s")),
    ]);
    if let Some([low, high]) = device.stroke_mm {
        lines.push(("stroke", format!("{low} to {high} mm")));
    }
    if let Some(most) = device.stiffness_n_per_mm {
        lines.push(("stiffness", at_most(most, "N/mm")));
    }
    lines.push(match device.servo {
        Some(servo) => ("loop", format!("{} Hz", servo.servo_hz)),
        None => (
            "constants",
            "none: a wrong force is `unverified`".to_owned(),
        ),
    });
    lines.push(("watchdog", format!("{watchdog_ms} ms")));
    lines.push(("commissioned", Untrusted(&commissioned).to_string()));
    console.out(aligned(&lines))
}

/// Tests a controller program: the clauses of docs/devices.md, and its rendering.
pub(super) fn check(args: &CheckArgs, console: &mut Console) -> Result<(), Failure> {
    if args.models.is_some() {
        return Err(Failure::usage("--models needs a device on a port"));
    }
    priority::raise_nice();
    let command = args.address.process()?;
    if !args.json {
        console.say(format!(
            "the device will apply up to {} N: hold the handle near the middle of its stroke",
            program_check::FORCE_N
        ));
    }
    let mut printed = Ok(());
    let checked = program_check::clauses(&command, &mut |verdict| {
        if !args.json && printed.is_ok() {
            printed = console.out(line(verdict));
        }
    });
    let checked = checked.map_err(|e| unusable(&e))?;
    printed?;
    let verdicts = checked.verdicts;
    let clauses_pass = verdicts.iter().all(|v| v.pass);
    let device = checked.told.identity.clone();
    let rendering = match !args.without_rendering && clauses_pass {
        true if !device.telemetry => {
            console.say("its rendering cannot be judged: it reports no samples");
            None
        }
        true => {
            let middle_mm = program_check::middle_mm(&checked.told);
            let mut display = WaitDisplay::in_a_line(console);
            let Some(mut program) = args.address.open_program(&mut display)? else {
                return Ok(());
            };
            Some(judge_rendering(
                &mut program,
                middle_mm,
                console,
                args.json,
            )?)
        }
        false => None,
    };
    let summary = summary(&verdicts, rendering.as_deref());
    let right = |all: &Vec<Rendered>| rendering::tally(all)[0] == all.len();
    let pass = clauses_pass && rendering.as_ref().is_none_or(right);
    if args.save {
        let parts = serde_json::json!({ "clauses": verdicts, "rendering": rendering });
        let tested = Tested {
            serial: device.id.clone(),
            firmware: device.firmware.clone(),
            simulated: device.simulated,
        };
        let record = Record::new(RecordKind::Check, tested, pass, summary.clone(), parts);
        let path = record.save(&args.results)?;
        console.say(format!("saved: {}", path.display()));
    }
    if args.json {
        let document = serde_json::json!({
            "format": "study-device-check/1",
            "device": device.id,
            "pass": pass,
            "verdicts": verdicts,
            "rendering": rendering,
        });
        console.json(&document)?;
    } else {
        console.out(format!("{summary}\n"))?;
    }
    match pass {
        true => Ok(()),
        false => Err(failed(&verdicts, rendering.as_deref().unwrap_or_default())),
    }
}

fn summary(verdicts: &[Verdict], rendering: Option<&[Rendered]>) -> String {
    let passed = verdicts.iter().filter(|v| v.pass).count();
    let mut line = format!("{passed} of {} clauses passed", verdicts.len());
    if let Some(all) = rendering {
        let [passed, failed, open] = rendering::tally(all);
        line += &format!(
            "; rendering: {passed} of {} passed, {failed} failed, {open} not judged",
            all.len()
        );
    }
    line
}

fn failed(verdicts: &[Verdict], rendering: &[Rendered]) -> Failure {
    let wrong: Vec<&str> = (verdicts.iter())
        .filter(|v| !v.pass && v.judged)
        .map(|v| v.clause)
        .collect();
    if !wrong.is_empty() {
        let plural = if wrong.len() == 1 { "" } else { "s" };
        let wrong = wrong.join(", ");
        return Failure::device(format!(
            "the program violates clause{plural} {wrong} of docs/devices.md, section 3"
        ))
        .hint("do not use it with participants before this is corrected");
    }
    if verdicts.iter().any(|v| !v.pass) {
        return Failure::device("not every clause could be judged")
            .hint("hold the handle near the middle of its stroke and repeat the check");
    }
    if rendering.iter().any(|line| line.is_silent) {
        return Failure::device("the program does not answer in time")
            .hint("it has to answer load, start and stop as docs/devices.md says");
    }
    let [_, failed, open] = rendering::tally(rendering);
    if failed == 0 {
        return Failure::device(format!(
            "{open} of {} tables were not judged",
            rendering.len()
        ))
        .hint("the lines above say why; nothing was found wrong");
    }
    Failure::device("the program does not render its tables with the constants that it tells").hint(
        "`servo` of its hello has the constants, those of docs/wire.md 7.1 to 7.5 where it says nothing",
    )
}

fn unusable(error: &DeviceError) -> Failure {
    let text = match error {
        DeviceError::Lost(reason) => reason.clone(),
        error => error.to_string(),
    };
    Failure::device(Untrusted(&text))
        .hint("start it by hand: its first line has to be its hello (docs/devices.md, section 3)")
}
