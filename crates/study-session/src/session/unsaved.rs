//! What of a session is not known to be on disk, by name.

use super::Session;
use crate::outcome::{Event, Failure, Moment};
use study_base::text::counted;
use study_plan::protocol::Answer;

/// Events that are not known to be on disk when a session has ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Unsaved {
    /// Session of the participant, if it was started.
    pub session: Option<u32>,
    /// Why, safe to print; `None` if the disk has not answered.
    pub why: Option<String>,
    /// The answers and remarks among them by name, such as "trial 3: realism = 5", and
    /// the number of other events. Not escaped.
    pub what: Vec<String>,
    /// The events with their times, in order.
    pub events: Vec<(Moment, Event)>,
    /// The participant's copy of the consent document, if it is not known to be on disk, with what was typed as a
    /// signature. It is kept apart from the events and never shown.
    pub copy: Option<String>,
}

impl Session {
    /// What is not known to be on disk.
    pub fn unsaved(&self) -> Option<Unsaved> {
        if self.saves.all_saved() {
            return None;
        }
        Some(Unsaved {
            session: self.history.start().map(|start| start.session),
            why: self.saves.trouble.as_deref().map(|why| self.sanitized(why)),
            what: self.unsaved_names(),
            events: self.saves.unsaved.iter().cloned().collect(),
            copy: self.saves.copy.clone(),
        })
    }

    /// The names in [`Unsaved::what`].
    pub(super) fn unsaved_names(&self) -> Vec<String> {
        let events = self.saves.unsaved.iter().map(|(_, event)| event);
        let mut names: Vec<String> = events.filter_map(|event| self.name(event)).collect();
        let others = self.saves.unsaved.len() - names.len();
        let copy = self.saves.copy.iter();
        names.extend(copy.map(|_| "the participant's copy of the consent".to_owned()));
        if others > 0 {
            let records = counted(others, "record", "records");
            names.push(format!("{records} of the course of the session"));
        }
        names
    }

    /// The name of an event with something that a person entered.
    fn name(&self, event: &Event) -> Option<String> {
        Some(match event {
            Event::Answered {
                form,
                question,
                answer,
                ..
            } => match self.set_in(*form) == Some(question) {
                // The level would be told.
                true => format!("{}: {question}", self.form_title(*form)),
                false => format!("{}: {question} = {}", self.form_title(*form), words(answer)),
            },
            Event::Corrected {
                form, question, to, ..
            } => format!(
                "{}: {question} corrected to {}",
                self.form_title(*form),
                words(to)
            ),
            Event::Remark { text, .. } => format!("remark: {text}"),
            Event::Consented { accepted: true, .. } => "consent".to_owned(),
            Event::Consented { .. } => "consent refused".to_owned(),
            Event::AttemptFailed {
                failure: Failure::MarkedBad,
                detail,
                ..
            } => format!("a trial marked as bad: {detail}"),
            Event::StateSet { state, .. } => state.as_str().to_owned(),
            _ => return None,
        })
    }
}

fn words(answer: &Answer) -> String {
    match answer {
        Answer::Declined { reason } => format!("declined ({reason})"),
        Answer::Text(text) if text.is_empty() => "nothing".to_owned(),
        other => other.cell(),
    }
}
