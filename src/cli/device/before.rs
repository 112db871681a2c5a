//! What a session asks of its device before it begins: check, commissioning, and the motor that weighs
//! itself.

use super::commission::self_weighed;
use super::record::{Record, RecordKind, Within, commission_doubt, commissionings, doubt, last};
use crate::cli::device_selection::{Tested, commissioned};
use crate::cli::{Console, Failure, Kind};
use crate::runner::clock::Clock;
use std::path::Path;
use study_base::text::Untrusted;
use study_device::Device;
use study_device::commission::Numbers;
use study_plan::protocol::{DeviceKind, DeviceRules, RenderingRules};
use study_session::outcome::SelfWeighed;

/// Longest text about a device in the record of a session, characters.
const MOST_SAID: usize = 1000;

/// What is asked of a device before a session.
#[derive(Debug, Clone, Copy)]
pub(in crate::cli) struct Asked {
    /// Its kind.
    pub(in crate::cli) kind: DeviceKind,
    /// `[device] check_within_h`.
    pub(in crate::cli) check_within_h: Option<f64>,
    /// `[device] commissioned_within_days`, with the force limit.
    pub(in crate::cli) commissioned: Option<Within>,
    /// `[device] self_weigh`.
    pub(in crate::cli) self_weigh: bool,
    /// `[device.rendering]`, which says how much a motor may have changed.
    pub(in crate::cli) rendering: RenderingRules,
    /// Whether the session goes on although the device does not satisfy this.
    pub(in crate::cli) unchecked: bool,
}

/// What a session records of its device.
pub(in crate::cli) struct Examined {
    /// Of its check and its commissioning.
    pub(in crate::cli) check: Option<String>,
    /// How its motor weighed itself.
    pub(in crate::cli) self_weighed: Option<SelfWeighed>,
}

impl Asked {
    /// What a protocol asks of a device of this kind.
    pub(in crate::cli) fn of(rules: &DeviceRules, kind: DeviceKind, unchecked: bool) -> Self {
        Self {
            kind,
            check_within_h: rules.check_within_h,
            commissioned: (rules.commissioned_within_days).map(|days| Within {
                days,
                force_n: rules.limits.force_n.get(),
            }),
            self_weigh: rules.self_weigh,
            rendering: rules.rendering,
            unchecked,
        }
    }
}

/// What the session records of its device, after the motor has weighed itself if the protocol asks
/// for it. That is saved among the records of the device, whether the session begins or not.
///
/// # Errors
/// [`Failure`] if check, commissioning or the motor do not satisfy what is asked, and the user did
/// not give `--unchecked`, or if the record cannot be saved.
pub(in crate::cli) fn examined(
    device: &mut dyn Device,
    results: &Path,
    asked: Asked,
    console: &mut Console,
    clock: &dyn Clock,
) -> Result<Examined, Failure> {
    let now = clock.now().wall;
    let check = on_record(device, results, asked, now, console)?;
    let has_force = !matches!(asked.kind, DeviceKind::Simulated | DeviceKind::Manual);
    if !(asked.self_weigh && has_force) {
        return Ok(Examined {
            check,
            self_weighed: None,
        });
    }
    let tested = Tested::of(device);
    let all = commissionings(results, &tested);
    let passed = all.iter().rev().find(|record| record.pass);
    let (id, numbers) = passed.map_or_else(
        || (String::new(), Numbers::default()),
        |record| (record.id.clone(), record.numbers().unwrap_or_default()),
    );
    let found = self_weighed(device, (&id, &numbers), &asked.rendering, (console, clock))?;
    let weighed = SelfWeighed {
        why: found.why.map(|why| why.chars().take(MOST_SAID).collect()),
        ..found
    };
    let serial = tested.serial.clone();
    let parts = serde_json::to_value(&weighed).map_err(|e| Failure::new(Kind::Bug, e))?;
    let (kind, said) = (RecordKind::SelfWeighing, weighed.in_words());
    Record::new(kind, tested, weighed.ok, said, parts).save(results)?;
    if let Some(why) = &weighed.why {
        let said = format!("{}: {}", Untrusted(&serial), Untrusted(why));
        if !asked.unchecked {
            return Err(Failure::device(said).hint(
                "`study device commission --port PORT` finds out more; with --unchecked the session goes on, and \
                 its records say so",
            ));
        }
        console.say(format!("warning: {said}"));
    }
    Ok(Examined {
        check,
        self_weighed: Some(weighed),
    })
}

/// What the session records of check and commissioning of a device; a failed commissioning is
/// said in any case.
///
/// # Errors
/// [`Failure`] if either does not count, and the user did not give `--unchecked`.
fn on_record(
    device: &dyn Device,
    results: &Path,
    asked: Asked,
    now: chrono::DateTime<chrono::FixedOffset>,
    console: &mut Console,
) -> Result<Option<String>, Failure> {
    let within_h = asked.check_within_h;
    let of_check = (asked.kind, within_h, asked.unchecked);
    let mut said = checked(device, results, of_check, now, console)?;
    if matches!(asked.kind, DeviceKind::Simulated | DeviceKind::Manual) {
        return Ok(said);
    }
    let tested = Tested::of(device);
    let all = commissionings(results, &tested);
    let within = asked.commissioned;
    let doubt = commission_doubt(&all, tested.firmware.as_deref(), within, now);
    let serial = Untrusted(&tested.serial);
    let mut more = |text: String| {
        said = Some(match said.take() {
            Some(said) => format!("{said}; {text}"),
            None => text,
        });
    };
    match doubt {
        None => {
            let passed = all.iter().rev().find(|record| record.pass);
            more(passed.map_or_else(String::new, |last| format!("{}: passed", last.id)));
        }
        Some(doubt) if within.is_some() && !asked.unchecked => {
            return Err(Failure::device(format!("{serial}: {}", doubt.why)).hint(
                "`study device commission --port PORT` commissions it, with a scale and a ruler, in some minutes; \
                 with --unchecked the session goes on, and its records say so",
            ));
        }
        Some(doubt) if within.is_some() || doubt.failed => {
            console.say(format!("warning: {serial}: {}", Untrusted(&doubt.why)));
            more(match within {
                Some(_) => format!("not commissioned, by choice: {}", doubt.why),
                None => doubt.why,
            });
        }
        Some(_) => {}
    }
    // It is recorded in every session, so its length is limited.
    Ok(said.map(|said| said.chars().take(MOST_SAID).collect()))
}

/// What the session records of the last check of a device of this kind.
///
/// # Errors
/// [`Failure`] if the check does not count, and the user did not give `--unchecked`.
fn checked(
    device: &dyn Device,
    results: &Path,
    (kind, within_h, unchecked): (DeviceKind, Option<f64>, bool),
    now: chrono::DateTime<chrono::FixedOffset>,
    console: &mut Console,
) -> Result<Option<String>, Failure> {
    if matches!(kind, DeviceKind::Simulated | DeviceKind::Manual) {
        return Ok(None);
    }
    let tested = Tested::of(device);
    let found = last(results, &tested.serial, RecordKind::Check);
    let doubt = doubt(found.as_ref(), tested.firmware.as_deref(), within_h, now);
    let said = match found {
        Some(last) => Some(format!("{}: {}", last.id, last.summary)),
        None => commissioned(&tested.serial, console),
    };
    let Some(doubt) = doubt else {
        return Ok(said);
    };
    if !unchecked {
        let serial = Untrusted(&tested.serial);
        return Err(Failure::device(format!("{serial}: {doubt}")).hint(
            "`study device check --save --port PORT` checks it; with --unchecked the session goes on, \
             and its records say so",
        ));
    }
    let said = said.map_or_else(String::new, |said| format!("; {said}"));
    Ok(Some(format!("unchecked, by choice: {doubt}{said}")))
}
