//! What the journals must have, read from the disks alone.

use crate::people::Ledger;
use crate::setting::Person;
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::QuestionId;
use study_plan::protocol::{Answer, Protocol, Question};
use study_session::outcome::{Choice, Entry, Event, FormId};
use study_session::store::{Derived, SeatKind, SessionData};

/// The questions that are answered in a journal.
///
/// # Errors
/// A question that is answered twice.
pub(crate) fn answered(entries: &[Entry]) -> Result<BTreeSet<(FormId, QuestionId)>, String> {
    let mut answered = BTreeSet::new();
    for entry in entries {
        if let Event::Answered { form, question, .. } = &entry.event
            && !answered.insert((*form, question.clone()))
        {
            return Err(format!("{question} of {form:?} is answered twice"));
        }
    }
    Ok(answered)
}

/// The forms of the trials that were felt and of which nothing is answered.
pub(crate) fn unanswered(entries: &[Entry]) -> BTreeSet<FormId> {
    let felt = entries.iter().filter_map(|entry| match &entry.event {
        Event::PlaybackEnded { trial, attempt, .. } => Some(FormId::Trial {
            trial: *trial,
            attempt: *attempt,
        }),
        _ => None,
    });
    let mut forms: BTreeSet<FormId> = felt.collect();
    for entry in entries {
        if let Event::Answered { form, .. } = &entry.event {
            forms.remove(form);
        }
    }
    forms
}

/// The texts in the journals of one disk.
///
/// # Errors
/// An answer that is there twice, that nobody gave, or that has another rating beside it than the
/// one with which it was given.
pub(crate) fn texts(sessions: &[SessionData], ledger: &Ledger) -> Result<BTreeSet<String>, String> {
    let mut found = BTreeSet::new();
    for session in sessions {
        answered(&session.entries)?;
        let mut ratings = BTreeMap::new();
        let mut texts = BTreeMap::new();
        for entry in &session.entries {
            match &entry.event {
                Event::Answered {
                    form,
                    answer: Answer::Rating(rating),
                    ..
                } => {
                    ratings.insert(*form, *rating);
                }
                Event::Answered {
                    form,
                    answer: Answer::Text(text),
                    ..
                } if !text.is_empty() => {
                    if !found.insert(text.clone()) {
                        return Err(format!("{text} is in the journals twice"));
                    }
                    texts.insert(*form, text);
                }
                _ => {}
            }
        }
        for (form, text) in texts {
            let given = ledger.given.get(text);
            let given = given.ok_or_else(|| format!("nobody gave {text}"))?;
            if given.is_some() && ratings.get(&form) != given.as_ref() {
                return Err(format!("{text} was given with another rating"));
            }
        }
    }
    Ok(found)
}

/// Whether a finished session has everything, and everything once.
///
/// # Errors
/// What it has not.
pub(crate) fn whole(session: &SessionData, protocol: &Protocol) -> Result<(), String> {
    let id = &session.participant;
    let count = |which: fn(&Event) -> bool| {
        let events = session.entries.iter().map(|entry| &entry.event);
        events.filter(|event| which(event)).count()
    };
    if count(|event| *event == Event::Finished) != 1 {
        return Err(format!("{id} has not finished once"));
    }
    if count(|event| matches!(event, Event::SessionStarted(_))) != 1 {
        return Err(format!("{id} has not started once"));
    }
    let answered = answered(&session.entries)?;
    let asks = |form: FormId, questions: &[Question]| {
        let missing = questions
            .iter()
            .find(|q| !answered.contains(&(form, q.id.clone())));
        missing.map_or(Ok(()), |q| {
            Err(format!("{id}: {} of {form:?} is missing", q.id))
        })
    };
    asks(FormId::Setup, &protocol.setup)?;
    asks(FormId::Intake, &protocol.intake)?;
    asks(FormId::Outro, &protocol.outro)?;
    let closed = closed(&session.entries);
    for trial in session.history.schedule().iter().map(|t| t.trial) {
        match closed.get(&trial) {
            None => return Err(format!("{id}: trial {trial} is not closed")),
            Some(None) => {}
            Some(Some(attempt)) => {
                let attempt = *attempt;
                asks(FormId::Trial { trial, attempt }, &protocol.questions)?;
            }
        }
    }
    let mut felt = BTreeSet::new();
    for entry in &session.entries {
        match &entry.event {
            Event::PlaybackEnded { trial, attempt, .. } => {
                felt.insert((*trial, *attempt));
            }
            Event::Answered {
                form: FormId::Trial { trial, attempt },
                ..
            } if !felt.contains(&(*trial, *attempt)) => {
                return Err(format!("{id}: trial {trial} is rated and was not felt"));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Whether the table of ratings has every trial of a finished session once, with the answers of the
/// attempt that counts and no others.
///
/// # Errors
/// What it has not.
pub(crate) fn table(
    session: &SessionData,
    derived: &Derived,
    protocol: &Protocol,
) -> Result<(), String> {
    let id = &session.participant;
    let mut given = BTreeMap::new();
    for entry in &session.entries {
        if let Event::Answered {
            form,
            question,
            answer,
            ..
        } = &entry.event
        {
            given.insert((*form, question), answer);
        }
    }
    let rows = derived.rows.iter().filter(|row| row.participant == *id);
    let rows: Vec<_> = rows.collect();
    let mut trials: Vec<u32> = rows.iter().map(|row| row.trial).collect();
    let mut planned: Vec<u32> = session.history.schedule().iter().map(|t| t.trial).collect();
    trials.sort_unstable();
    planned.sort_unstable();
    if trials != planned {
        return Err(format!("{id}: the table has the trials {trials:?}"));
    }
    let closed = closed(&session.entries);
    for row in rows {
        let trial = row.trial;
        let counted = closed.get(&trial).copied().flatten();
        let form = counted.map(|attempt| FormId::Trial { trial, attempt });
        for question in protocol.questions.iter().map(|q| &q.id) {
            let answer = form.and_then(|form| given.get(&(form, question)).copied());
            if row.answers.get(question) != answer {
                return Err(format!(
                    "{id}: the table has another answer to {question} of trial {trial}"
                ));
            }
        }
    }
    Ok(())
}

/// The trials that are closed, each with the attempt that counts if it was completed.
fn closed(entries: &[Entry]) -> BTreeMap<u32, Option<u32>> {
    let mut closed = BTreeMap::new();
    for entry in entries {
        match &entry.event {
            Event::TrialDone { trial, attempt, .. } => {
                closed.insert(*trial, Some(*attempt));
            }
            Event::TrialClosed { trial, .. } => {
                closed.insert(*trial, None);
            }
            Event::AttemptFailed { trial, .. } => {
                closed.remove(trial);
            }
            Event::Reopened {
                choice: Some(Choice::RestartBlock),
                queue,
                ..
            } => closed.retain(|trial, _| !queue.contains(trial)),
            _ => {}
        }
    }
    closed
}

/// Whether real, pilot and simulated participants are marked as what they are.
///
/// # Errors
/// Who is not.
pub(crate) fn kinds(
    people: &[Person],
    sessions: &[SessionData],
    derived: &Derived,
) -> Result<(), String> {
    let mut rows = BTreeSet::new();
    for person in people {
        let wrong = |place: &str| Err(format!("{} is not {:?} {place}", person.id, person.kind));
        let own = sessions
            .iter()
            .filter(|s| s.participant.as_str() == person.id);
        for session in own {
            if session.seat.map(SeatKind::of) != Some(person.kind) {
                return wrong("in the journal");
            }
            if let Some(row) = session.held_row()
                && !rows.insert(row)
            {
                return Err(format!("row {row} is given twice"));
            }
        }
        let marks = (
            person.kind == SeatKind::Pilot,
            person.kind == SeatKind::Simulated,
        );
        let of_participants = derived.participants.iter();
        let of_participants = of_participants
            .filter(|row| row.participant.as_str() == person.id)
            .map(|row| (row.pilot, row.simulated));
        let of_ratings = derived.rows.iter();
        let of_ratings = of_ratings
            .filter(|row| row.participant.as_str() == person.id)
            .map(|row| (row.pilot, row.simulated));
        if of_participants.chain(of_ratings).any(|own| own != marks) {
            return wrong("in the tables");
        }
    }
    Ok(())
}
