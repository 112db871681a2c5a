//! Processors, priority and lateness.

use super::finding::{About, Finding, Fit, Use, ms};
use super::{Connected, Lateness, Machine, Measured, Spread, Timing};
use std::time::Duration;
use study_device::host::{HEARTBEAT_INTERVAL, SUPERVISION_TIMEOUT};
use study_device::link::Priority;

/// Watchdog time of a device that was not measured, ms: docs/wire.md.
const WATCHDOG_MS: f64 = 30.0;
/// Watchdog time of a program that tells none, ms: docs/devices.md, section 3.
const PROGRAM_WATCHDOG_MS: f64 = 500.0;
/// Longest time between two `alive` of a screen that is in time, ms: docs/devices.md, section 3.
const ALIVE_MS: f64 = 100.0;
/// Time between two turns of the screen during a playback, ms.
const SCREEN_TURN_MS: f64 = 20.0;
/// A wait of 1 ms that takes this much longer has a coarse timer, ms: Windows without a request
/// rounds waits up to 15.6 ms.
const COARSE_MS: f64 = 5.0;
/// From this share of the processors on, other programs are in the way.
const BUSY_SHARE: f64 = 0.5;

fn in_ms(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

/// Everything about the computer.
pub(super) fn judge(measured: &Measured) -> Vec<Finding> {
    let told = |connected| {
        let device = measured.device.as_ref();
        device.filter(|d| d.connected == connected)?.watchdog_ms
    };
    let timing = &measured.timing;
    let mut findings = vec![processors(&measured.machine)];
    findings.push(priority(timing));
    let (Some(quiet), Some(saving)) = (timing.quiet, timing.saving) else {
        let says = "How late threads are was not measured.".to_owned();
        let uses = [Use::Hand, Use::Serial];
        findings.push(Finding::new(
            About::Computer,
            "heartbeat",
            &uses,
            Fit::NotMeasured,
            says,
        ));
        return findings;
    };
    findings.push(timer(&measured.machine, quiet.turn));
    let both = [quiet, saving];
    findings.push(heartbeat(both, told(Connected::Port), timing.priority));
    findings.extend(screen(both, told(Connected::Program)));
    findings
}

fn processors(machine: &Machine) -> Finding {
    let n = machine.processors;
    let of = match n {
        1 => "1 processor".to_owned(),
        n => format!("{n} processors"),
    };
    let (fit, says) = match machine.busy {
        Some(busy) if busy >= BUSY_SHARE * n as f64 => (
            Fit::WithLimits,
            format!("Other programs keep {busy:.1} of {of} busy."),
        ),
        _ if n == 1 => (
            Fit::WithLimits,
            "One processor has to do everything at once.".to_owned(),
        ),
        Some(busy) => (Fit::Fit, format!("{of}, of which {busy:.1} were busy.")),
        None => (
            Fit::Fit,
            format!("{of}; the system does not tell how busy they are."),
        ),
    };
    Finding::new(About::Computer, "processors", &[Use::Serial], fit, says)
        .advice("End other programs before a session, and use a computer that does nothing else.")
}

fn priority(timing: &Timing) -> Finding {
    let (fit, says) = match timing.priority {
        Priority::RealTime => (
            Fit::Fit,
            "The thread that sends heartbeats has real-time priority.".to_owned(),
        ),
        given => {
            let instead = match given {
                Priority::Raised => "only more time than other programs",
                _ => "no higher priority than other programs",
            };
            let why = match timing.permitted {
                Some(0) => "the system permits this user none (`ulimit -r` is 0)",
                Some(_) => {
                    "this user may have it (`ulimit -r`), so that the system or its container refuses it"
                }
                None => "the system refuses it",
            };
            (
                Fit::WithLimits,
                format!(
                    "The thread that sends heartbeats has {instead}, not real-time priority: {why}."
                ),
            )
        }
    };
    let advice = match timing.permitted {
        Some(0) => {
            "Add the line `USER - rtprio 20` to /etc/security/limits.conf, with your user name, and log in again."
        }
        Some(_) => "Run it outside a container, or give the container time for real-time threads.",
        None => "Run it as a user who may raise priorities.",
    };
    Finding::new(About::Computer, "priority", &[Use::Serial], fit, says).advice(advice)
}

/// Whether waits are as short as they are asked for.
fn timer(machine: &Machine, turn: Spread) -> Finding {
    let fit = match turn.median_ms > COARSE_MS {
        true => Fit::WithLimits,
        false => Fit::Fit,
    };
    let step = machine.clock_step_ns.map_or_else(String::new, |ns| {
        format!("; the clock has steps of {ns:.0} ns")
    });
    let says = format!(
        "A wait of 1 ms usually takes {}{step}.",
        ms(1.0 + turn.median_ms)
    );
    Finding::new(About::Computer, "timer", &[Use::Serial], fit, says)
        .advice("Update the system, and switch off power saving and virtual machines.")
}

/// The larger lateness of two, and whether it was while records were saved.
fn worse(both: [Lateness; 2], of: fn(&Lateness) -> Spread) -> (Spread, &'static str) {
    let [quiet, saving] = both.map(|lateness| of(&lateness));
    match saving.largest_ms > quiet.largest_ms {
        true => (saving, "while records were saved"),
        false => (quiet, "while nothing else was done"),
    }
}

/// Whether heartbeats come in time for the watchdog of a device.
fn heartbeat(both: [Lateness; 2], told_ms: Option<f64>, priority: Priority) -> Finding {
    let (late, when) = worse(both, |lateness| lateness.heartbeat);
    let watchdog_ms = told_ms.unwrap_or(WATCHDOG_MS);
    let interval_ms = in_ms(HEARTBEAT_INTERVAL);
    // After this it is limp; after the other one it is if a heartbeat is lost as well.
    let limp_ms = (watchdog_ms - interval_ms).max(0.0);
    let close_ms = (watchdog_ms - 2.0 * interval_ms).max(0.0);
    let fit = match late.largest_ms {
        most if most >= limp_ms => Fit::NotFit,
        most if most >= close_ms => Fit::WithLimits,
        _ => Fit::Fit,
    };
    let whose = match told_ms {
        Some(_) => "this device",
        None => "a device",
    };
    let says = format!(
        "Heartbeats, every {interval_ms:.0} ms, were late by {} in 99 % and {} at most {when}, of {}; {whose} with a watchdog time of {watchdog_ms:.0} ms goes limp when one is late by {limp_ms:.0} ms.",
        ms(late.p99_ms),
        ms(late.largest_ms),
        late.n,
    );
    let advice = match priority {
        Priority::RealTime => {
            "End other programs and switch off power saving; if that does not help, use another computer, or a device with a watchdog time of 50 to 200 ms."
        }
        _ => {
            "Give the program real-time priority (see `priority`), end other programs, or use a device with a watchdog time of 50 to 200 ms."
        }
    };
    Finding::new(About::Computer, "heartbeat", &[Use::Serial], fit, says).advice(advice)
}

/// Whether the screen polls often enough for heartbeats, and for `alive` to a program.
fn screen(both: [Lateness; 2], told_ms: Option<f64>) -> [Finding; 2] {
    let (late, when) = worse(both, |lateness| lateness.screen);
    let judged = |limit_ms: f64| match late.largest_ms {
        most if most >= limit_ms => Fit::NotFit,
        most if most >= 0.5 * limit_ms => Fit::WithLimits,
        _ => Fit::Fit,
    };
    let was = format!(
        "The screen's thread was late by {} in 99 % and {} at most {when}",
        ms(late.p99_ms),
        ms(late.largest_ms)
    );
    let advice = "End other programs before a session.";
    let still_ms = in_ms(SUPERVISION_TIMEOUT) - SCREEN_TURN_MS;
    let watchdog_ms = told_ms.unwrap_or(PROGRAM_WATCHDOG_MS);
    let alive_ms = (watchdog_ms - ALIVE_MS).max(0.0);
    let fits = [judged(still_ms), judged(alive_ms)];
    [
        Finding::new(
            About::Computer,
            "screen",
            &[Use::Serial],
            fits[0],
            format!("{was}; heartbeats stop when it is late by {still_ms:.0} ms."),
        )
        .advice(advice),
        Finding::new(
            About::Computer,
            "alive",
            &[Use::Hand],
            fits[1],
            format!(
                "{was}; a program with a watchdog time of {watchdog_ms:.0} ms is limp when it is late by {alive_ms:.0} ms."
            ),
        )
        .advice(advice),
    ]
}
