//! What the exclusion rules see of the trials of a part.

use super::part_data::{Intervals, asked};
use crate::analyze::exclude::force as said;
use std::collections::BTreeMap;
use study_base::text::{ModelId, ParticipantId};
use study_plan::protocol::rules::{Answers, Force, Given, Realization, Trial, Trials};
use study_plan::protocol::{Part, Protocol, Role};
use study_session::outcome::{RatingRow, Verdict};

/// The trials of a part, with the realizations that got a number.
pub(super) fn trials<'a>(
    (protocol, part): (&Protocol, &Part),
    rows: &[&'a RatingRow],
    intervals: &Intervals<'_>,
) -> Trials<'a> {
    let question = asked(protocol, part);
    let answer = |row: &'a RatingRow| {
        let first = row.answer_before_feedback.as_ref();
        first.or_else(|| row.answers.get(question?)).map(Given::of)
    };
    let is_number = |row: &&'a RatingRow| matches!(answer(row), Some(Given::Number(_)));
    let numbers: Vec<&RatingRow> = rows.iter().copied().filter(is_number).collect();
    let mut participants: BTreeMap<&ParticipantId, usize> = BTreeMap::new();
    for row in rows {
        let next = participants.len();
        participants.entry(&row.participant).or_insert(next);
    }
    let rated: BTreeMap<&ModelId, Role> = (numbers.iter())
        .filter_map(|row| Some((row.model.as_ref()?, row.role)))
        .collect();
    let places: BTreeMap<&ModelId, usize> = rated.keys().copied().zip(0..).collect();
    let original = |id: &ModelId| {
        places
            .get(protocol.model(id)?.duplicate_of.as_ref()?)
            .copied()
    };
    let realizations = (rated.iter())
        .map(|(id, role)| Realization {
            hidden_reference: *role == Role::HiddenReference,
            duplicate_of: original(id),
        })
        .collect();
    let sets = part.task.adjustment().is_some();
    let trial = |row: &&'a RatingRow| {
        let (strokes, force) = match sets {
            true => of_a_setting(row, intervals),
            false => (intervals.strokes(row), worst(row)),
        };
        Trial {
            participant: participants[&row.participant],
            realization: (row.model.as_ref()).and_then(|id| places.get(id).copied()),
            answer: answer(row),
            strokes,
            force,
        }
    };
    Trials {
        answers: match numbers.is_empty() {
            true => Answers::Choices,
            false => Answers::Points,
        },
        of_a_part: true,
        participants: participants.len(),
        realizations,
        trials: rows.iter().map(trial).collect(),
    }
}

/// The force of the worst playback of a trial.
fn worst(row: &RatingRow) -> Option<Force> {
    row.fidelity.as_ref().map(|worst| said(worst.verdict))
}

/// Strokes and force of a level that was set: levels on the way are felt for a moment, in which nothing has to be explored and
/// little can be verified. A wrong force is one on the way, too, unless the step was repeated because of it.
fn of_a_setting(row: &RatingRow, intervals: &Intervals<'_>) -> (Option<u32>, Option<Force>) {
    let set = intervals.counted(row).last();
    let strokes = set.and_then(|set| set.strokes);
    let own = set.and_then(|set| set.fidelity.as_ref());
    let worst = match row.fidelity.as_ref().map(|worst| worst.verdict) {
        Some(Verdict::Fault) => {
            let felt = intervals.counted(row).iter();
            let verdicts = felt.filter_map(|own| Some(own.fidelity.as_ref()?.verdict));
            verdicts.filter(|verdict| *verdict != Verdict::Fault).max()
        }
        other => other,
    };
    let force = match worst.map(said) {
        Some(Force::Unverified) => own.map(|own| said(own.verdict)),
        other => other,
    };
    (strokes, force)
}
