//! Facts about a study for its report.

use super::parts::part_reports;
use crate::comparison::sentence;
use crate::html::Details;
use std::collections::{BTreeMap, BTreeSet};
use study_analysis::study::{Analyzed, Study};
use study_base::apa;
use study_base::text::counted;
use study_plan::protocol::{Answer, Order, Protocol, Question, Scale};
use study_session::outcome::{AttemptEvent, AttemptRow, ParticipantRow, STEP_BACK};
use study_session::store::Derived;
use study_stats::describe::mean;

/// Facts about a study besides its analysis. `derived` has the rows of the study, or of
/// all sites of a pool with this one.
pub fn details(study: &Study, derived: &Derived, analyzed: &Analyzed) -> Details {
    let protocol = &study.loaded.protocol;
    let (rows, participants) = (&derived.rows, &derived.participants);
    let ratings = analyzed.ratings();
    let question = ratings.map_or("", |a| a.question.as_str());
    let compared = analyzed.source.preregistration.as_ref();
    let compared = compared.filter(|_| ratings.is_some()).map(sentence);
    let asked = protocol
        .questions
        .iter()
        .find(|q| q.id.as_str() == question);
    let labels = match asked.map(|q| q.kind.scale()) {
        Some(Scale::Levels { labels, .. }) => {
            let all = labels.iter();
            all.map(|(at, l)| (*at as f64, l.clone())).collect()
        }
        _ => Vec::new(),
    };
    let some = |name: &str, value: &Option<String>| {
        let value = value.clone()?;
        Some((name.to_owned(), value))
    };
    let s = &protocol.study;
    let mut facts: Vec<(String, String)> = [
        some("ethics", &s.ethics),
        some("contact", &s.contact),
        some("funding", &s.funding),
        some("data license", &s.license),
        some("doi", &s.doi),
        some("VAF on recording", &protocol.analysis.vaf),
    ]
    .into_iter()
    .flatten()
    .collect();
    if let Some(u) = &protocol.device.uncertified {
        facts.push((
            "uncertified realizations played".to_owned(),
            u.reason.clone(),
        ));
    }
    // The devices used, which for pilots can differ from the protocol's.
    let played = rows.iter().filter(|r| r.attempt.is_some());
    let devices: BTreeSet<&str> = played.map(|r| r.device_kind.as_str()).collect();
    let devices: Vec<&str> = devices.into_iter().collect();
    let tools: BTreeSet<&str> = rows.iter().map(|r| r.tool_version.as_str()).collect();
    let manifest = study.folder.manifest();
    let prints = &manifest.newest().fingerprints;
    Details {
        lang: protocol.text.lang.clone(),
        authors: s.authors.clone(),
        prompt: asked.map(|q| q.prompt.clone()),
        labels,
        facts,
        repetitions: Some(protocol.design.repetitions),
        order: Some(order(&protocol.design.order).to_owned()),
        sample: sample(protocol, participants),
        ethics: s.ethics.clone(),
        conduct: (conduct(protocol, &devices).into_iter())
            .chain(compared)
            .collect(),
        states: states(participants),
        reference: protocol.trial.reference.clone(),
        device: Some(devices.join(", ")).filter(|d| !d.is_empty()),
        seed: Some(s.seed),
        tools: tools
            .into_iter()
            .filter(|t| !t.is_empty())
            .map(str::to_owned)
            .collect(),
        parts: part_reports(protocol, analyzed.parts()),
        // That of a study with ratings is among the warnings of their analysis.
        damage: match ratings {
            Some(_) => Vec::new(),
            None => analyzed.damage.clone(),
        },
        fingerprints: vec![
            ("stimulus".to_owned(), prints.stimulus.clone()),
            ("wording".to_owned(), prints.wording.clone()),
            ("analysis".to_owned(), prints.analysis.clone()),
        ],
        corrections: corrections(&derived.attempts),
        versions: manifest
            .versions
            .iter()
            .map(|v| (v.version, v.at.to_rfc3339(), v.reason.clone()))
            .collect(),
    }
}

/// What was corrected, with both values and the reason. What a participant changed before an
/// answer was complete is no correction.
fn corrections(attempts: &[AttemptRow]) -> Vec<String> {
    let corrected = attempts
        .iter()
        .filter(|row| row.what == AttemptEvent::Correction && row.text != STEP_BACK);
    let value = |answer: &Option<Answer>| match answer {
        None | Some(Answer::Declined { .. }) => "declined".to_owned(),
        Some(answer) => answer.cell(),
    };
    let sentence = |row: &AttemptRow| {
        let place = row
            .trial
            .map_or_else(String::new, |trial| format!(", trial {trial}"));
        let question = row.question.as_ref().map_or("id", |q| q.as_str());
        format!(
            "{}{place}: {question} {} → {} ({}, {})",
            row.participant,
            value(&row.from),
            value(&row.to),
            row.text,
            row.at.format("%Y-%m-%d %H:%M %:z")
        )
    };
    corrected.map(sentence).collect()
}

/// Number of participants by state; pilots and simulated ones only if there are no
/// others.
fn states(participants: &[ParticipantRow]) -> Vec<(String, usize)> {
    let mut by: BTreeMap<&str, usize> = BTreeMap::new();
    for p in described(participants) {
        *by.entry(p.state.as_str()).or_default() += 1;
    }
    by.into_iter().map(|(s, n)| (s.to_owned(), n)).collect()
}

/// The participants; pilots and simulated ones only if there are no others.
fn described(participants: &[ParticipantRow]) -> impl Iterator<Item = &ParticipantRow> {
    let real = |p: &ParticipantRow| !p.pilot && !p.simulated;
    let any = participants.iter().any(real);
    participants.iter().filter(move |p| real(p) || !any)
}

/// Most options that a sentence lists.
const MAX_OPTIONS: usize = 6;

/// A sentence for each intake question that is answered by a number or a choice.
fn sample(protocol: &Protocol, participants: &[ParticipantRow]) -> Vec<String> {
    let sentence = |question: &Question| {
        let answers: Vec<&Answer> = described(participants)
            .filter_map(|p| p.answers.get(&question.id))
            .filter(|answer| !answer.is_declined())
            .collect();
        let numbers: Vec<f64> = answers.iter().filter_map(|a| a.number()).collect();
        let scale = question.kind.scale();
        let unit = match scale {
            Scale::Open {
                unit: Some(unit), ..
            } => format!(" {unit}"),
            _ => String::new(),
        };
        let prompt = question.prompt.trim_end_matches([':', '.']);
        if let Some(mean) = mean(&numbers) {
            let low = numbers.iter().fold(f64::INFINITY, |a, b| a.min(*b));
            let high = numbers.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
            let (mean, n) = (apa::number(mean, 2), numbers.len());
            return Some(format!(
                "“{prompt}”: mean {mean}{unit}, range {low} to {high} (n = {n})."
            ));
        }
        let Scale::Names { options, .. } = scale else {
            return None;
        };
        let chosen = |option: &String| {
            let by = |a: &&&Answer| matches!(a, Answer::Choice(all) if all.contains(option));
            answers.iter().filter(by).count()
        };
        let counts: Vec<String> = (options.iter())
            .map(|option| (chosen(option), option))
            .filter(|(n, _)| *n > 0)
            .map(|(n, option)| format!("{option} {n}"))
            .take(MAX_OPTIONS)
            .collect();
        (!counts.is_empty()).then(|| format!("“{prompt}”: {}.", counts.join(", ")))
    };
    protocol.intake.iter().filter_map(sentence).collect()
}

/// Sentences on the conduct of the sessions, for the methods.
fn conduct(protocol: &Protocol, devices: &[&str]) -> Vec<String> {
    let design = &protocol.design;
    let mut text = Vec::new();
    match design.max_run {
        Some(1) => text.push("No realization was presented twice in a row.".to_owned()),
        Some(n) => text.push(format!(
            "No realization was presented more than {n} times in a row."
        )),
        None => {}
    }
    match design.practice.len() {
        0 => {}
        n => text.push(format!(
            "{} preceded these and {} not analyzed.",
            counted(n, "practice trial", "practice trials"),
            if n == 1 { "was" } else { "were" }
        )),
    }
    if let Some(breaks) = &design.breaks {
        text.push(format!(
            "After every {} there was a break of at least {} s.",
            counted(breaks.every as usize, "trial", "trials"),
            breaks.at_least_s
        ));
    }
    text.push(match devices {
        [] => return text,
        ["simulated"] => "The device was simulated: nobody felt a force.".to_owned(),
        kinds => format!("Kinds of device used: {}.", kinds.join(", ")),
    });
    if let Some(u) = protocol.device.uncertified.as_ref().filter(|u| u.play) {
        text.push(format!(
            "Realizations without a passivity certificate were limited to {} N.",
            u.force_n.get()
        ));
    }
    text
}

fn order(order: &Order) -> &'static str {
    match order {
        Order::Blocked => "random within blocks that hold each realization once",
        Order::Shuffled => "one random order of all trials",
        Order::Williams => "taken from a Williams design, balanced for first-order carry-over",
        Order::LatinSquare => "taken from a cyclic Latin square",
        Order::Fixed => "the same in every repetition",
        Order::File(_) => "read from a prepared file",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_plan::protocol::{Breaks, example};

    #[test]
    fn breaks_come_after_some_trials_and_last_some_seconds() {
        let mut protocol = example::protocol(2, 1);
        protocol.design.breaks = Some(Breaks {
            every: 20,
            at_least_s: 60.0,
        });
        let told = "After every 20 trials there was a break of at least 60 s.";
        assert!(conduct(&protocol, &[]).iter().any(|text| text == told));
    }
}
