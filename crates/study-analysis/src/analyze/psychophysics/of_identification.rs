//! Identification of a study.

use super::again::again;
use super::identification::{LabelRow, identification};
use super::over_participants::Measured;
use super::part_data::{Found, PartData, StudyData, chosen, groups, sessions_of};
use super::results::PartResults;
use crate::analyze::warning::Warning;
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::{ModelId, Untrusted, counted};
use study_plan::protocol::identification::{Criterion, Identification};
use study_plan::protocol::parts::Part;
use study_session::outcome::RatingRow;

/// The answers of a part.
pub(super) fn of_identification(
    study: &StudyData<'_>,
    part: &Part,
    own: &Identification,
    rows: &[&RatingRow],
) -> Found {
    let protocol = study.protocol;
    let place = |label: &str| own.labels.iter().position(|l| l.text == label);
    let original = |id: &ModelId| {
        let model = protocol.model(id);
        let original = model.and_then(|m| m.duplicate_of.as_ref());
        original.unwrap_or(id).as_str().to_owned()
    };
    let answered: Vec<(&RatingRow, LabelRow)> = (rows.iter())
        .filter_map(|row| {
            let model = row.model.as_ref()?;
            let answer = LabelRow {
                participant: row.participant.as_str().to_owned(),
                realization: Some(original(model)),
                right: place(own.label_of(model)?)?,
                given: place(chosen(part, row)?)?,
            };
            Some((*row, answer))
        })
        .collect();
    let answers: Vec<LabelRow> = answered.iter().map(|a| a.1.clone()).collect();
    let labels: Vec<String> = own.labels.iter().map(|l| l.text.clone()).collect();
    let (found, confusions) = identification(&answers, &labels);
    let mut results = PartResults::undefined("");
    results.over.again = {
        let sessions = sessions_of(protocol, part);
        let ids: Vec<&str> = sessions.iter().flatten().map(|s| s.as_str()).collect();
        again(&shares(&answered, rows, ids.len() > 1), &ids, false)
    };
    results.over.identification = Some(found);
    Found {
        task: "identification",
        trials: answers.len(),
        results,
        warnings: (few_trials(own, answers.len()).into_iter())
            .chain(not_learned(study, part, own, rows))
            .collect(),
        names: Vec::new(),
        data: PartData {
            labels,
            confusions,
            ..PartData::default()
        },
    }
}

/// The share of correct answers of each participant, by which groups and sessions are compared.
fn shares(
    answered: &[(&RatingRow, LabelRow)],
    rows: &[&RatingRow],
    by_session: bool,
) -> Vec<Measured> {
    let groups = groups(rows);
    let mut cells: BTreeMap<(&str, Option<&str>), (f64, f64)> = BTreeMap::new();
    for (row, answer) in answered {
        let session = row.session_id.as_ref().filter(|_| by_session);
        let cell = (answer.participant.as_str(), session.map(|s| s.as_str()));
        let cell = cells.entry(cell).or_default();
        cell.0 += f64::from(u8::from(answer.right == answer.given));
        cell.1 += 1.0;
    }
    let one = |((who, session), (correct, n)): ((&str, Option<&str>), (f64, f64))| Measured {
        participant: who.to_owned(),
        group: groups.get(who).cloned(),
        session: session.map(str::to_owned),
        condition: "correct".to_owned(),
        value: correct / n,
    };
    cells.into_iter().map(one).collect()
}

fn few_trials(own: &Identification, answers: usize) -> Option<Warning> {
    let text = own.too_few(answers).filter(|_| answers > 0)?;
    Some(Warning {
        code: "few-trials",
        text,
    })
}

/// Participants whose practice ended before they reached its criterion, by the answers with which it ended: in the order in which they
/// were given, as they were before any correction.
fn not_learned(
    study: &StudyData<'_>,
    part: &Part,
    own: &Identification,
    rows: &[&RatingRow],
) -> Option<Warning> {
    let criterion = own.criterion?;
    let counted_here: BTreeSet<(&str, u32)> = (rows.iter())
        .map(|r| (r.participant.as_str(), r.session))
        .collect();
    let reached =
        |answers: Vec<bool>| (0..=answers.len()).any(|end| criterion.is_reached(&answers[..end]));
    let sessions = study.sessions.iter().filter_map(|history| {
        let start = history.start()?;
        let missed = !reached(history.practiced(part));
        missed.then_some((start.participant.as_str(), start.session))
    });
    let missed: BTreeSet<(&str, u32)> = sessions.collect();
    let missing: BTreeSet<&str> = (counted_here.intersection(&missed))
        .map(|place| place.0)
        .collect();
    let names: Vec<String> = missing
        .iter()
        .map(|who| Untrusted(who).to_string())
        .collect();
    let Criterion { correct, of, .. } = criterion;
    (!names.is_empty()).then(|| Warning {
        code: "not-learned",
        text: format!(
            "{} did not reach the criterion of practice ({correct} of the last {of} answers correct): {}",
            counted(names.len(), "participant", "participants"),
            names.join(", ")
        ),
    })
}
