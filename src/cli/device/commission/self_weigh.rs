//! Before a session the motor weighs itself, and is compared with its commissioning.

use super::desk::Terminal;
use super::rig::{Rig, Stop, safe};
use super::swing::{Swung, swing};
use super::{LAST, is_late};
use crate::cli::device_selection::Tested;
use crate::cli::{Console, Failure};
use crate::runner::clock::Clock;
use study_device::Device;
use study_device::commission::{NoSelfWeighing, Numbers, SelfWeighing};
use study_haptics::swing::NoSwing;
use study_plan::protocol::RenderingRules;
use study_session::outcome::SelfWeighed;

/// How often the swings are begun, if somebody touches the handle or this computer is late.
const TRIES: usize = 3;

/// Asks for the free handle and lets the motor weigh itself. If it is not as it was at its
/// commissioning, whose id and numbers are given, or if that is not known, `why` says so.
///
/// # Errors
/// [`Failure`] if nobody answers any more or the dialog is left.
pub(in crate::cli) fn self_weighed(
    device: &mut dyn Device,
    (id, numbers): (&str, &Numbers),
    rules: &RenderingRules,
    (console, clock): (&mut Console, &dyn Clock),
) -> Result<SelfWeighed, Failure> {
    if !device.identity().telemetry {
        let why = "it reports no samples, so that its motor cannot weigh itself";
        return Ok(unknown(id, why));
    }
    let serial = Tested::of(device).serial;
    let desk = Terminal::open(console, clock)?;
    let mut rig = Rig::new(device, Box::new(desk));
    rig.say(&format!(
        "Device {}: the motor weighs itself before the session.",
        safe(&serial)
    ))?;
    let found = weigh(&mut rig, id, numbers, rules).map_err(Stop::failure)?;
    // the session begins with a device that is limp and has said so
    rig.settle(LAST);
    Ok(found)
}

/// What is recorded of a motor that could not be compared.
fn unknown(id: &str, why: impl Into<String>) -> SelfWeighed {
    SelfWeighed {
        commissioning: id.to_owned(),
        ok: false,
        gain: None,
        lag_ms: None,
        apparent_kg: None,
        why: Some(why.into()),
    }
}

/// The dialog.
pub(super) fn weigh(
    rig: &mut Rig<'_>,
    id: &str,
    numbers: &Numbers,
    rules: &RenderingRules,
) -> Result<SelfWeighed, Stop> {
    let (Some(before), Some(stroke_mm)) = (numbers.swing, numbers.stroke_mm) else {
        return Ok(unknown(
            id,
            match id {
                "" => "it was never commissioned, so that its motor cannot be compared",
                _ => "its commissioning has no swing, so that its motor cannot be compared",
            },
        ));
    };
    let (mut why, mut again) = (String::new(), String::new());
    for _ in 0..TRIES {
        if !rig.may_go(&format!(
            "{again}The handle will move by itself, four times, by about 10 mm to each side. Take your hand off it, \
             and let nothing touch it."
        ))? {
            return Ok(unknown(id, "the self-weighing was left out"));
        }
        let swung = swing(rig, before.plan, stroke_mm);
        rig.ended()?;
        why = match swung {
            Swung::Weighed(found) => {
                let weighed = compared(id, &before.found, &found, rules);
                rig.say(match weighed.ok {
                    true => "The motor is as it was.",
                    false => "The motor is not as it was.",
                })?;
                return Ok(weighed);
            }
            Swung::Trouble(trouble) if is_late(&trouble) => {
                "This computer was late, and the device gives no force then, as it has to".to_owned()
            }
            Swung::Trouble(trouble) => {
                return Ok(unknown(id, format!("the device gave up: {trouble}")));
            }
            Swung::Not(NoSelfWeighing::Touched(..)) => {
                "a hand or something else was at the handle".to_owned()
            }
            Swung::Not(NoSelfWeighing::NoSwing(NoSwing::Rests | NoSwing::NotDetermined)) => {
                "the handle did not swing: a hand was at it, or it sticks, or the motor gives no force"
                    .to_owned()
            }
            Swung::Not(other) => other.to_string(),
        };
        rig.limp();
        again = format!("{why}. Once more: ");
    }
    Ok(unknown(id, why))
}

/// The motor now against that of the commissioning.
fn compared(
    id: &str,
    before: &SelfWeighing,
    found: &SelfWeighing,
    rules: &RenderingRules,
) -> SelfWeighed {
    let [gain, lag_ms] = found.since(before);
    let [least, most] = rules.gain;
    let why = if !(least..=most).contains(&gain) {
        Some(format!(
            "its motor gives {:.0} % of the force of its commissioning",
            100.0 * gain
        ))
    } else if lag_ms.abs() > rules.max_delay_ms {
        let when = if lag_ms > 0.0 { "later" } else { "earlier" };
        Some(format!(
            "its force comes {:.0} ms {when} than at its commissioning",
            lag_ms.abs()
        ))
    } else {
        None
    };
    SelfWeighed {
        commissioning: id.to_owned(),
        ok: why.is_none(),
        gain: Some(gain),
        lag_ms: Some(lag_ms),
        apparent_kg: Some(found.apparent_kg),
        why,
    }
}
