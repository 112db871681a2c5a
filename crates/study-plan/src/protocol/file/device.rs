//! `[device]`.

use super::models::AT_MOST_1;
use crate::protocol::keys::{Key, Kind, Words as _, keys};
use crate::protocol::section::Section;
use crate::protocol::{DeviceKind, DeviceRules, OnFault, RenderingRules, Uncertified};
use study_base::diagnostic::Fault;
use study_base::limits::Limits;

pub(super) const DEVICE: &[Key] = keys! {
    /// The kind of device that plays the realizations. Port, baud rate and command belong
    /// to the laboratory, not to the study: they are arguments of `study run`.
    "kind": Kind::Word(DeviceKind::WORDS), r#""simulated""#, required;
    /// Limits that no playback exceeds. The lower of these and the device's own apply.
    "limits": Kind::Table(LIMITS), "{ force_n = 12.0, velocity_mm_s = 1000.0 }", derived("required, unless `kind` is `manual`, or `process` without model files");
    /// Permission to play tables that fail their passivity certificate, which could put
    /// energy into the hand. Without it such a table is refused.
    "uncertified": Kind::Table(UNCERTIFIED), r#"{ play = true, force_n = 9.0, reason = "the paper's own realizations" }"#;
    /// Lever arm at which the hand holds a turning handle. Model files in degrees or radians and
    /// N·m are converted with it; limits, telemetry and results are in mm and N at the hand.
    "lever_mm": Kind::positive("mm"), "20.0";
    /// When the force of a playback was that of its table, and what follows if it was not.
    /// Needs a device that reports samples.
    "rendering": Kind::Table(RENDERING), r#"{ min_vaf = 0.9, on_fault = "fail" }"#;
    /// Hours within which `study device check --save` must have passed on the device. A session
    /// on another device is refused unless `study run --unchecked` says that it is meant.
    "check_within_h": Kind::positive("h"), "24.0";
    /// Days within which `study device commission` must have passed on the device, with its present
    /// firmware. A session on another device is refused, and also if a later commissioning failed,
    /// unless `study run --unchecked` says that it is meant. Needs the format `study-protocol/3`.
    "commissioned_within_days": Kind::positive("days"), "30.0";
    /// Whether the motor weighs itself before each session: the free handle swings on weak virtual
    /// springs, and its apparent mass and its lag are compared with those of the commissioning, by `gain`
    /// and `max_delay_ms` of `rendering`. Needs a device that reports samples and the format
    /// `study-protocol/3`.
    "self_weigh": Kind::Flag, "true", default("false");
};

const RENDERING: &[Key] = keys! {
    /// Least share of the variance of the table's force that the device commands.
    "min_vaf": Kind::Number(AT_MOST_1, ""), "0.9", default("0.995");
    /// Least and largest slope of the commanded on the table's force, and of the measured on
    /// the commanded force.
    "gain": Kind::NumberList, "[0.9, 1.1]", default("[0.93, 1.07]");
    /// Largest mean difference of commanded and table's force.
    "max_bias_n": Kind::positive("N"), "0.5", default("0.2");
    /// Largest delay of the commanded force.
    "max_delay_ms": Kind::positive("ms"), "10.0", default("5.0");
    /// Largest difference of commanded and table's force that lasts 20 ms.
    "max_error_n": Kind::positive("N"), "1.0", default("0.5");
    /// Largest difference of commanded and table's force as a share of the table's force, both
    /// root mean squares: of the whole playback, of each direction and of each stretch of 2 s.
    "max_error_share": Kind::positive(""), "0.15", default("0.075");
    /// Largest mean size of the difference over 50 ms, of the commanded force from the table's
    /// and of the measured one from the commanded, as a share of the range of the table's forces.
    "max_range_share": Kind::positive(""), "0.2", default("0.1");
    /// Largest share of the samples that may be lost. Of a playback that lost more nothing is
    /// said.
    "max_lost_share": Kind::Number(AT_MOST_1, ""), "0.05", default("0.1");
    /// Least share of the time in which the force must be known. Of a playback with less nothing
    /// is said.
    "min_judged_share": Kind::Number(AT_MOST_1, ""), "0.8", default("0.5");
    /// Largest mean size of measured minus commanded force.
    "max_measured_error_n": Kind::positive("N"), "1.0", default("0.5");
    /// What a wrong playback is. Without this key it fails if the force passed its limit, was
    /// that of another table or had the wrong sign, and is marked otherwise.
    "on_fault": Kind::Word(OnFault::WORDS), r#""fail""#;
};

const LIMITS: &[Key] = keys! {
    /// The largest force.
    "force_n": Kind::positive("N"), "12.0", required;
    /// The speed of the handle above which the device stops.
    "velocity_mm_s": Kind::positive("mm/s"), "1000.0", required;
};

const UNCERTIFIED: &[Key] = keys! {
    /// Whether such tables are played.
    "play": Kind::Flag, "true", required;
    /// The largest force for such tables, at most `limits.force_n`.
    "force_n": Kind::positive("N"), "9.0", required;
    /// Why they are played; recorded in every session.
    "reason": Kind::Text, r#""the paper's own realizations""#, required;
};

pub(super) fn read(mut section: Section<'_, '_>) -> Option<DeviceRules> {
    let kind = section.word("kind");
    let given = section.value("limits").is_some();
    let limits = section.section("limits").and_then(limits);
    let uncertified = section.section("uncertified").and_then(uncertified);
    let lever_mm = section.number("lever_mm");
    let rendering = section.section("rendering").and_then(rendering);
    // Whether a program plays tables is known with the realizations.
    let perhaps = matches!(kind, Some(DeviceKind::Manual | DeviceKind::Process));
    if !given && !perhaps {
        section.report_missing("limits", section.key("limits").such_as());
    }
    if let (Some(uncertified), Some(limits)) = (&uncertified, limits)
        && uncertified.force_n > limits.force_n
    {
        section.fault_at_path(
            "device.uncertified.force_n",
            Fault::error(format!(
                "`device.uncertified.force_n` is {} N, above `device.limits.force_n`, {} N",
                uncertified.force_n.get(),
                limits.force_n.get()
            )),
        );
    }
    let check_within_h = section.number("check_within_h");
    let commissioned_within_days = section.number("commissioned_within_days");
    let self_weigh = section.flag("self_weigh");
    Some(DeviceRules {
        kind: kind?,
        limits: match limits {
            Some(limits) => limits,
            // Without tables these limits are never used.
            None if !given => Limits::new(12.0, 1000.0).ok()?,
            None => return None,
        },
        uncertified,
        lever_mm,
        rendering: rendering?,
        check_within_h,
        commissioned_within_days,
        self_weigh: self_weigh?,
    })
}

fn rendering(mut section: Section<'_, '_>) -> Option<RenderingRules> {
    let default = RenderingRules::default();
    let gain = match section.numbers("gain").as_deref() {
        None => default.gain,
        Some([low, high]) if low < high => [*low, *high],
        Some(_) => {
            section.fault_at(
                "gain",
                Fault::error("`gain` needs two numbers, the smaller one first")
                    .hint("such as gain = [0.9, 1.1]"),
            );
            return None;
        }
    };
    Some(RenderingRules {
        min_vaf: section.number("min_vaf")?,
        gain,
        max_bias_n: section.number("max_bias_n")?,
        max_delay_ms: section.number("max_delay_ms")?,
        max_error_n: section.number("max_error_n")?,
        max_error_share: section.number("max_error_share")?,
        max_range_share: section.number("max_range_share")?,
        max_lost_share: section.number("max_lost_share")?,
        min_judged_share: section.number("min_judged_share")?,
        max_measured_error_n: section.number("max_measured_error_n")?,
        on_fault: section.word("on_fault"),
    })
}

fn limits(mut section: Section<'_, '_>) -> Option<Limits> {
    let (force_n, velocity_mm_s) = (section.limit("force_n"), section.limit("velocity_mm_s"));
    Some(Limits {
        force_n: force_n?,
        velocity_mm_s: velocity_mm_s?,
    })
}

fn uncertified(mut section: Section<'_, '_>) -> Option<Uncertified> {
    let (play, force_n) = (section.flag("play"), section.limit("force_n"));
    let reason = section.text("reason");
    Some(Uncertified {
        play: play?,
        force_n: force_n?,
        reason: reason?,
    })
}
