//! The rows of `attempts.csv`: a log of single events.

use super::History;
use crate::outcome::event::{Author, Choice, Entry, Event, FormId};
use crate::outcome::rows::{AttemptEvent, AttemptRow};
use crate::outcome::sent::SentNumber;
use std::collections::BTreeMap;
use study_base::text::{ModelId, ParticipantId};
use study_plan::protocol::Answer;

/// Every attempt, answer, correction, failure, remark and change of state in the
/// order in which they happened. `history` is that of the same entries.
pub fn attempt_rows(
    history: &History,
    id: &ParticipantId,
    session: u32,
    entries: &[Entry],
) -> Vec<AttemptRow> {
    let start = history.start();
    let mut models: BTreeMap<u32, ModelId> = start
        .iter()
        .flat_map(|s| &s.schedule)
        .filter_map(|t| Some((t.trial, t.model()?.clone())))
        .collect();
    let mut rows = Vec::new();
    for entry in entries {
        let Some(what) = AttemptEvent::of(&entry.event) else {
            continue;
        };
        let mut row = AttemptRow {
            participant: id.clone(),
            session,
            simulated: start.is_some_and(|s| s.seat.is_simulated()),
            pilot: start.is_some_and(|s| s.seat.is_pilot()),
            trial: None,
            attempt: None,
            model: None,
            what,
            question: None,
            from: None,
            to: None,
            failure: None,
            by: None,
            text: String::new(),
            at: entry.at.wall,
            input_channel: None,
            medium: None,
            media_offset_ms: None,
            media_uncertainty_ms: None,
        };
        match &entry.event {
            Event::AttemptStarted {
                trial,
                attempt,
                model,
                ..
            } => {
                if let Some(model) = model {
                    models.insert(*trial, model.clone());
                }
                (row.trial, row.attempt) = (Some(*trial), Some(*attempt));
            }
            Event::Answered {
                form,
                question,
                answer,
                channel,
            } => {
                row.input_channel = *channel;
                (row.trial, row.attempt) = trial_of(*form);
                row.question = Some(question.clone());
                row.text = declined_reason(answer);
                row.to = Some(answer.clone());
            }
            Event::Corrected {
                form,
                question,
                from,
                to,
                reason,
                by,
                channel,
            } => {
                row.input_channel = *channel;
                (row.trial, row.attempt) = trial_of(*form);
                row.question = Some(question.clone());
                (row.from, row.to) = (from.clone(), Some(to.clone()));
                row.text.clone_from(reason);
                row.by = Some(*by);
            }
            Event::AttemptFailed {
                trial,
                attempt,
                failure,
                detail,
                queue,
                constraint_broken,
                paused_s: _,
            } => {
                (row.trial, row.attempt) = (Some(*trial), Some(*attempt));
                row.failure = Some(*failure);
                row.text.clone_from(detail);
                if *constraint_broken {
                    row.text.push_str(if queue.contains(trial) {
                        " [its new place breaks the order's constraint]"
                    } else {
                        " [the order without it breaks its constraint]"
                    });
                }
            }
            Event::StepFailed {
                trial,
                attempt,
                failure,
                detail,
            } => {
                (row.trial, row.attempt) = (Some(*trial), Some(*attempt));
                row.failure = Some(*failure);
                row.text = format!("{detail} [the level before is felt again]");
            }
            Event::MediaShown {
                trial,
                attempt,
                interval,
                medium,
                offset_ms,
                uncertainty_ms,
            } => {
                (row.trial, row.attempt) = (Some(*trial), Some(*attempt));
                row.text = interval.map_or(String::new(), |n| format!("interval {n}"));
                row.medium = Some(*medium);
                row.media_offset_ms = Some(*offset_ms);
                row.media_uncertainty_ms = Some(*uncertainty_ms);
            }
            Event::TrialClosed { trial, attempt } => {
                (row.trial, row.attempt) = (Some(*trial), Some(*attempt));
            }
            Event::Remark { by, trial, text } => {
                row.trial = *trial;
                row.by = Some(*by);
                row.text.clone_from(text);
            }
            Event::Reopened {
                gap_s,
                choice,
                constraint_broken,
                ..
            } => {
                row.text = resume_text(*gap_s, *choice);
                if *constraint_broken {
                    row.text
                        .push_str(" [the restart breaks the order's constraint]");
                }
            }
            Event::SelfWeighed(weighed) => row.text = weighed.in_words(),
            Event::NumbersSent {
                trial,
                attempt,
                numbers,
            } => {
                (row.trial, row.attempt) = (*trial, *attempt);
                let refused = numbers.iter().filter(|number| number.fault.is_some());
                let told: Vec<String> = refused.map(SentNumber::in_words).collect();
                row.text = told.join("; ");
            }
            Event::StateSet { state, reason } => {
                row.text = format!("{}: {reason}", state.as_str());
            }
            Event::IdCorrected { from, to, reason } => {
                let id = |id: &ParticipantId| Some(Answer::Text(id.to_string()));
                (row.from, row.to) = (id(from), id(to));
                row.by = Some(Author::Experimenter);
                row.text.clone_from(reason);
            }
            Event::Revealed { reason } => {
                row.text.clone_from(reason);
            }
            _ => {}
        }
        row.model = row.trial.and_then(|t| models.get(&t).cloned());
        rows.push(row);
    }
    rows
}

fn resume_text(gap_s: f64, choice: Option<Choice>) -> String {
    let choice = match choice {
        None => "went on",
        Some(Choice::RestartBlock) => "restarted the block",
        Some(Choice::Continue) => "continued late",
        Some(Choice::DropOut) => "dropped out",
    };
    format!("{choice} after {gap_s:.0} s")
}

fn trial_of(form: FormId) -> (Option<u32>, Option<u32>) {
    match form {
        FormId::Trial { trial, attempt } | FormId::After { trial, attempt } => {
            (Some(trial), Some(attempt))
        }
        FormId::Setup | FormId::Intake | FormId::Outro | FormId::Consent => (None, None),
    }
}

fn declined_reason(answer: &Answer) -> String {
    match answer {
        Answer::Declined { reason } => reason.clone(),
        _ => String::new(),
    }
}
