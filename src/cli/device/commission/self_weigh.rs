//! Before a session the motor weighs itself, and is compared with its commissioning.

use super::LAST;
use super::desk::Terminal;
use super::rig::{Rig, Stop, safe};
use super::swing::{Swung, swing};
use crate::cli::device_selection::Tested;
use crate::cli::{Console, Failure};
use crate::runner::clock::Clock;
use study_device::Device;
use study_device::commission::{NoSelfWeighing, Numbers};
use study_plan::protocol::RenderingRules;
use study_session::outcome::SelfWeighed;

/// How often a swing that somebody touched is repeated.
const TRIES: usize = 3;

/// What came of it.
pub(super) struct Found {
    /// For the record of the session.
    pub(super) weighed: SelfWeighed,
    /// Why the session should not begin; `None` if the motor is as it was.
    pub(super) doubt: Option<String>,
}

/// Asks for the free handle and lets the motor weigh itself.
///
/// # Errors
/// [`Failure`] if nobody answers any more or the dialog is left.
pub(in crate::cli) fn self_weighed(
    device: &mut dyn Device,
    (id, numbers): (&str, &Numbers),
    rules: &RenderingRules,
    (console, clock): (&mut Console, &dyn Clock),
) -> Result<(SelfWeighed, Option<String>), Failure> {
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
    Ok((found.weighed, found.doubt))
}

/// The dialog.
pub(super) fn weigh(
    rig: &mut Rig<'_>,
    id: &str,
    numbers: &Numbers,
    rules: &RenderingRules,
) -> Result<Found, Stop> {
    let of = |doubt: String| Found {
        weighed: SelfWeighed {
            commissioning: id.to_owned(),
            ok: false,
            gain: None,
            lag_ms: None,
            apparent_kg: None,
            why: Some(doubt.clone()),
        },
        doubt: Some(doubt),
    };
    let (Some(before), Some(stroke_mm)) = (numbers.swing, numbers.stroke_mm) else {
        return Ok(of(
            "its commissioning has no swing, so that the motor cannot be compared".to_owned(),
        ));
    };
    let mut why = String::new();
    for _ in 0..TRIES {
        if !rig.may_go(
            "The handle will move by itself, four times, by about 10 mm to each side. Take your hand off it, \
             and let nothing touch it.",
        )? {
            return Ok(of("the self-weighing was left out".to_owned()));
        }
        let swung = swing(rig, before.plan, stroke_mm);
        rig.ended()?;
        let found = match swung {
            Swung::Weighed(found) => found,
            Swung::Not(touched) => {
                why = match touched {
                    NoSelfWeighing::Touched(..) => {
                        "a hand or something else was at the handle".to_owned()
                    }
                    NoSelfWeighing::NoSwing(_) => {
                        "the handle did not swing: a hand was at it, or it sticks, or the motor gives no force"
                            .to_owned()
                    }
                    other => other.to_string(),
                };
                rig.say(&format!("{why}. Once more:"))?;
                continue;
            }
            Swung::Trouble(trouble) => return Ok(of(format!("the device gave up: {trouble}"))),
        };
        let [gain, lag_ms] = found.since(&before.found);
        let [least, most] = rules.gain;
        let doubt = if !(least..=most).contains(&gain) {
            Some(format!(
                "its motor gives {:.0} % of the force of its commissioning",
                100.0 * gain
            ))
        } else if lag_ms.abs() > rules.max_delay_ms {
            Some(format!(
                "its force comes {lag_ms:.0} ms later than at its commissioning"
            ))
        } else {
            None
        };
        rig.say(match doubt {
            Some(_) => "The motor is not as it was.",
            None => "The motor is as it was.",
        })?;
        return Ok(Found {
            weighed: SelfWeighed {
                commissioning: id.to_owned(),
                ok: doubt.is_none(),
                gain: Some(gain),
                lag_ms: Some(lag_ms),
                apparent_kg: Some(found.apparent_kg),
                why: doubt.clone(),
            },
            doubt,
        });
    }
    Ok(of(why))
}
