//! A device.

use super::finding::{About, Finding, Fit, ms};
use super::{Connected, Device, Spread};
use study_device::check::{ADAPTER_MS, REPLY_MS, longest_ms};

/// A program that needs longer until its `hello` keeps people waiting, ms.
const HELLO_MS: f64 = 3000.0;
/// Latency timer of an adapter that delays nothing, ms.
const ADAPTER_TIMER_MS: f64 = 1.0;

/// Everything about a device.
pub(super) fn judge(device: &Device) -> Vec<Finding> {
    let of = |id, fit, says| Finding::new(About::Device, id, &[device.purpose()], fit, says);
    if let Some(why) = &device.failure {
        let advice = match device.connected {
            Connected::Port => {
                "`study device list` lists the ports; check cable, power, baud rate and that no other program has it."
            }
            Connected::Program => {
                "Start the program by hand: its first line has to be its hello (docs/devices.md, section 3)."
            }
        };
        return vec![
            of("device", Fit::NotFit, format!("{}: {why}.", device.address)).advice(advice),
        ];
    }
    let mut findings = vec![identity(device)];
    findings.push(match (device.connected, device.trips) {
        (Connected::Port, Some(trips)) => line(device, trips),
        (Connected::Program, Some(trips)) => program(device, trips),
        (Connected::Port, None) => of(
            "round-trip",
            Fit::NotMeasured,
            "The device answered no question after its identification.".to_owned(),
        )
        .advice("`study device check` says what is wrong with it."),
        (Connected::Program, None) => of(
            "round-trip",
            Fit::WithLimits,
            "The program speaks version 1 of the messages, which confirms nothing: its answers cannot be timed."
                .to_owned(),
        )
        .advice("Let it speak study-process/2 (docs/devices.md, section 3)."),
    });
    if let Some(hello_ms) = device.hello_ms {
        let fit = match hello_ms > HELLO_MS {
            true => Fit::WithLimits,
            false => Fit::Fit,
        };
        let says = format!("The program sent its hello after {}.", ms(hello_ms));
        findings.push(of("hello", fit, says).advice("Start it beforehand, if it can be."));
    }
    findings
}

fn identity(device: &Device) -> Finding {
    let id = device.id.as_deref().unwrap_or("without a name");
    let firmware = device.firmware.as_deref().unwrap_or("not told");
    let watchdog = device.watchdog_ms.map_or_else(
        || "not told".to_owned(),
        |watchdog_ms| format!("{watchdog_ms:.0} ms"),
    );
    let (fit, simulated) = match device.simulated {
        true => (Fit::WithLimits, ", simulated"),
        false => (Fit::Fit, ""),
    };
    let says = format!("Device {id}, firmware {firmware}{simulated}, watchdog time {watchdog}.");
    Finding::new(About::Device, "device", &[device.purpose()], fit, says)
        .advice("Nothing is felt on a simulated device: every session with it is a pilot.")
}

/// Round trips on a line, by the rules of clause 11.1 of `study device check`.
fn line(device: &Device, trips: Spread) -> Finding {
    let watchdog_ms = device.watchdog_ms.unwrap_or_default();
    // The device tells whole milliseconds.
    let allowed_ms = longest_ms(watchdog_ms as u16);
    let usual_ms = REPLY_MS + device.line_ms + ADAPTER_MS;
    let timer = device.adapter_ms.filter(|timer| *timer > ADAPTER_TIMER_MS);
    let fit = match () {
        () if trips.median_ms > usual_ms || trips.p99_ms > allowed_ms => Fit::NotFit,
        () if timer.is_some() || trips.largest_ms > allowed_ms => Fit::WithLimits,
        () => Fit::Fit,
    };
    let at = match device.baud {
        Some(baud) => format!(" at {baud} baud"),
        None => String::new(),
    };
    let delays = timer.map_or_else(String::new, |timer| {
        format!(" The latency timer of the adapter is {timer:.0} ms.")
    });
    let says = format!(
        "A round trip{at} takes {} in half, {} in 99 % and {} in all of {} cases; {} in half and {} in 99 % are allowed with a watchdog time of {watchdog_ms:.0} ms.{delays}",
        ms(trips.median_ms),
        ms(trips.p99_ms),
        ms(trips.largest_ms),
        trips.n,
        ms(usual_ms),
        ms(allowed_ms),
    );
    Finding::new(About::Device, "round-trip", &[device.purpose()], fit, says).advice(
        "Set the latency timer of an FTDI adapter to 1 ms (docs/devices.md, section 2), connect it without a hub, or use a longer watchdog time.",
    )
}

/// Answers of a program.
fn program(device: &Device, trips: Spread) -> Finding {
    let watchdog_ms = device.watchdog_ms.unwrap_or_default();
    let fit = match () {
        () if trips.p99_ms >= watchdog_ms => Fit::NotFit,
        () if trips.p99_ms >= watchdog_ms / 3.0 => Fit::WithLimits,
        () => Fit::Fit,
    };
    let says = format!(
        "The program confirms that its force is off within {} in half, {} in 99 % and {} in all of {} cases; its watchdog time is {watchdog_ms:.0} ms.",
        ms(trips.median_ms),
        ms(trips.p99_ms),
        ms(trips.largest_ms),
        trips.n,
    );
    Finding::new(About::Device, "round-trip", &[device.purpose()], fit, says)
        .advice("Let it read its input in a thread of its own, or more often in its loop.")
}
