//! Checks that need the protocol, the model files and the orders together.

use super::{OtherFiles, families};
use study_base::diagnostic::{Fault, Findings, Severity, did_you_mean};
use study_base::perception::force_jnd_n;
use study_base::sort::SmallSort as _;
use study_base::text::Untrusted;
use study_haptics::model::Realization;
use study_haptics::safe_play;
use study_plan::protocol::check::{self, Spans};
use study_plan::protocol::{Assigned, DeviceKind, FileOrders, Order, Protocol, Role};
use study_plan::schedule::balance::balances;
use study_plan::schedule::{Planner, ScheduleError};

/// Takes VAFs missing in the protocol from the model files and compares the others.
pub(super) fn vaf(
    protocol: &mut Protocol,
    others: &OtherFiles<'_>,
    spans: &Spans,
    findings: &mut Findings,
) {
    let wanted = protocol.analysis.vaf.clone();
    let mut names_used: Vec<String> = Vec::new();
    let mut names_seen: Vec<String> = Vec::new();
    let mut misses = Vec::new();
    for (i, entry) in protocol.models.iter_mut().enumerate() {
        let Some(realization) = others.realization(&entry.id) else {
            continue;
        };
        let known = &realization.vaf;
        names_seen.extend(known.keys().cloned());
        let name = match &wanted {
            Some(name) => name.clone(),
            None if known.len() == 1 => known.keys().next().cloned().unwrap_or_default(),
            None if known.is_empty() => continue,
            None => {
                if entry.role == Role::Test && entry.vaf.is_none() {
                    let names: Vec<&str> = known.keys().map(String::as_str).collect();
                    misses.push(
                        Fault::warning(format!(
                            "`{}` has several VAFs and `analysis.vaf` does not select one",
                            entry.id
                        ))
                        .at(spans.get(&format!("models[{i}].id")).cloned())
                        .hint(format!("its file has {}", names.join(", "))),
                    );
                }
                continue;
            }
        };
        let Some(measured) = known.get(&name).copied() else {
            continue;
        };
        if entry.role == Role::Test && !names_used.contains(&name) {
            names_used.push(name.clone());
        }
        let place = spans.get(&format!("models[{i}].vaf")).cloned();
        if let Some(stated) = entry.vaf {
            let written = place.clone().and_then(|span| findings.text.get(span));
            if (stated - measured).abs() > tolerance(written.unwrap_or_default()) {
                findings.faults.push(
                    Fault::error(format!(
                        "the VAF of `{}` is not {stated}: its file has {measured} for `{}`",
                        entry.id,
                        Untrusted(&name)
                    ))
                    .at(place)
                    .hint("omit `vaf` to take it from the file"),
                );
                continue;
            }
        }
        entry.vaf = Some(measured);
    }
    findings.faults.extend(misses);
    if let Some(wanted) = &wanted
        && !names_seen.is_empty()
        && !names_seen.contains(wanted)
    {
        let fault = Fault::error(format!(
            "no model file has a VAF for `{}`",
            Untrusted(wanted)
        ))
        .at(spans.get("analysis.vaf").cloned());
        names_seen.small_sort();
        names_seen.dedup();
        let names: Vec<&str> = names_seen.iter().map(String::as_str).collect();
        findings
            .faults
            .push(match did_you_mean(wanted, names.iter().copied()) {
                Some(near) => fault.label(format!("did you mean `{near}`?")),
                None => fault.hint(format!("they have {}", names.join(", "))),
            });
    }
    if names_used.len() > 1 {
        findings.faults.push(
            Fault::warning(format!(
                "VAFs of different recordings are compared: {}",
                names_used.join(", ")
            ))
            .hint("select one with `analysis.vaf`"),
        );
    }
}

/// Warns of test realizations whose accuracies differ by less than can be felt: by their residual
/// forces, σ_F √(1 − VAF), with the standard deviation σ_F of the force at rest over the nodes.
pub(super) fn too_close(protocol: &Protocol, others: &OtherFiles<'_>, findings: &mut Findings) {
    if !check::is_about_realizations(protocol) || !others.unread(protocol).is_empty() {
        return;
    }
    let tests = protocol.models.iter().filter(|m| m.role == Role::Test);
    let known: Vec<(f64, &Realization)> = tests
        .filter_map(|m| Some((m.vaf?, others.realization(&m.id)?)))
        .collect();
    if known.len() < 2 {
        return;
    }
    let (best_vaf, best) =
        (known.iter().copied()).fold(
            known[0],
            |best, one| if one.0 > best.0 { one } else { best },
        );
    let least_vaf = known.iter().map(|(vaf, _)| *vaf).fold(best_vaf, f64::min);
    let forces_n = families::forces(best, best, 0.0);
    let greatest_n = forces_n.iter().fold(0.0, |most: f64, f| most.max(f.abs()));
    let mean_n = forces_n.iter().sum::<f64>() / forces_n.len() as f64;
    let squares: f64 = forces_n.iter().map(|f| (f - mean_n).powi(2)).sum();
    let sd_n = (squares / forces_n.len() as f64).sqrt();
    let span_n = sd_n * ((1.0 - least_vaf).sqrt() - (1.0 - best_vaf).sqrt());
    let noticeable_n = force_jnd_n(greatest_n);
    if span_n < noticeable_n {
        findings.faults.push(
            Fault::warning(format!(
                "the test realizations differ too little: VAF {least_vaf:.4} to {best_vaf:.4} is {span_n:.3} N of residual force at {sd_n:.2} N rms, and {noticeable_n:.2} N is just noticeable"
            ))
            .hint("take realizations that are further apart"),
        );
    }
}

/// Reports realizations that fail their certificate or are not safe to play, unless the protocol
/// permits them.
pub(super) fn certificates(
    protocol: &Protocol,
    others: &OtherFiles<'_>,
    spans: &Spans,
    findings: &mut Findings,
) {
    if protocol.device.uncertified.as_ref().is_some_and(|u| u.play) {
        return;
    }
    let mut seen = Vec::new();
    for (i, entry) in protocol.models.iter().enumerate() {
        let Some(realization) = others.realization(&entry.id) else {
            continue;
        };
        // a sample mounted by hand has no actuator
        if protocol.device_of(entry) == DeviceKind::Manual {
            continue;
        }
        if seen.contains(&entry.file.as_ref()) {
            continue;
        }
        let certificate = realization.certificate();
        let danger = || safe_play::refusal(realization, &safe_play::Device::default());
        let fault = if !certificate.passes() {
            let message = format!("the table of `{}` can put energy into a hand", entry.id);
            Fault::error(message)
                .label(certificate.to_string())
                .hint(super::PERMIT)
        } else if let Some(danger) = danger() {
            let message = format!("`{}` is not safe to play", entry.id);
            Fault::error(message)
                .label(danger.to_string())
                .hint(super::ANEW)
        } else {
            continue;
        };
        seen.push(entry.file.as_ref());
        let place = ["file", "bundle"].map(|key| spans.get(&format!("models[{i}].{key}")));
        let place = place.into_iter().flatten().next().cloned();
        findings.faults.push(fault.at(place));
    }
}

/// Largest accepted difference between a stated VAF and that of the file: half a unit
/// of the stated value's last digit.
fn tolerance(written: &str) -> f64 {
    const EXACT: f64 = 1e-9;
    let decimals = match written.split_once('.') {
        Some((_, decimals)) if decimals.bytes().all(|b| b.is_ascii_digit()) => decimals.len(),
        _ => return EXACT,
    };
    let digits = i32::try_from(decimals).unwrap_or(i32::MAX);
    // at least two digits are compared
    0.5 * 10f64.powi(-digits.max(2)) + EXACT
}

/// Reports the first order that cannot be made, and whether a balanced order is
/// balanced for the planned number of participants. For a study that has started, an
/// order that cannot be made is a warning: others can.
pub(super) fn orders(
    protocol: &Protocol,
    orders: Option<&FileOrders>,
    started: bool,
    spans: &Spans,
    findings: &mut Findings,
) {
    let participants = protocol.design.participants;
    let own = |assigned: &Assigned| {
        let planner = Planner::new(&protocol.of(assigned), orders);
        planner.and_then(|planner| planner.verify(participants))
    };
    // Each group in each session has orders of its own.
    let tried = protocol.assignments().iter().try_for_each(own);
    if let Err(error) = tried {
        let place = keys(&error, protocol)
            .iter()
            .find_map(|key| spans.get(*key))
            .cloned();
        let mut fault = Fault::error(error.to_string()).at(place);
        if started {
            fault.severity = Severity::Warning;
        }
        fault.hint = error.hint().map(str::to_owned);
        findings.faults.push(fault);
        return;
    }
    let realizations = protocol.scheduled_models().count();
    if let Some(balance) = balances(
        &protocol.design.order,
        realizations,
        protocol.design.repetitions,
    ) && !u64::from(protocol.design.participants).is_multiple_of(balance.participants)
    {
        findings.faults.push(
            Fault::warning(format!(
                "the orders are balanced at multiples of {} participants, not at {}",
                balance.participants, protocol.design.participants
            ))
            .at(spans.get("design.participants").cloned()),
        );
    }
}

/// The protocol keys that an error of the schedule concerns, the likeliest first.
fn keys(error: &ScheduleError, protocol: &Protocol) -> &'static [&'static str] {
    match error {
        ScheduleError::MinDistance { .. } => &["design.min_distance"],
        ScheduleError::MaxRun { .. } | ScheduleError::MaxRunZero => &["design.max_run"],
        ScheduleError::TooLong { .. } | ScheduleError::NoRepetitions => {
            &["design.repetitions", "parts"]
        }
        ScheduleError::LongTracks { .. } => &["tracks", "parts"],
        ScheduleError::Broken { .. } | ScheduleError::TooManyStates { .. } => &[
            "design.max_run",
            "design.min_distance",
            "design.order",
            "parts",
        ],
        _ if matches!(protocol.design.order, Order::File(_)) => {
            &["design.order.file", "design.order"]
        }
        _ => &["design.order", "parts"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stated_vaf_may_be_rounded_to_its_digits() {
        let agrees = |written: &str, measured: f64| {
            let stated: f64 = written.parse().unwrap();
            (stated - measured).abs() <= tolerance(written)
        };
        assert!(agrees("0.79", 0.7949));
        assert!(!agrees("0.79", 0.7951));
        assert!(agrees("0.7949", 0.794_949));
        assert!(!agrees("0.7949", 0.7951));
        assert!(!agrees("0.8", 0.7949));
        assert!(agrees("-0.25", -0.2549));
        assert!(!agrees("1", 0.99));
        assert!(!agrees("7.9e-1", 0.7949));
    }
}
