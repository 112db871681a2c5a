//! What the exclusion rules see of the trials of a part.

use super::part_data::{Intervals, asked};
use crate::analyze::exclude::force;
use std::collections::BTreeMap;
use study_base::text::{ModelId, ParticipantId};
use study_plan::protocol::rules::{Answers, Given, Realization, Trial, Trials};
use study_plan::protocol::{Part, Protocol, Role};
use study_session::outcome::RatingRow;

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
    let trial = |row: &&'a RatingRow| Trial {
        participant: participants[&row.participant],
        realization: (row.model.as_ref()).and_then(|id| places.get(id).copied()),
        answer: answer(row),
        strokes: intervals.strokes(row),
        force: (row.fidelity.as_ref()).map(|worst| force(worst.verdict)),
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
