//! Who a typed id is: one line on the first screen, before a row is taken.

use crate::outcome::{ParticipantRow, State};
use std::collections::BTreeMap;
use study_base::text::ParticipantId;

/// The participants of the study when the program started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Roster {
    known: BTreeMap<ParticipantId, Known>,
    /// What is said of participants who have finished a session and come again.
    again: BTreeMap<ParticipantId, String>,
    newcomer: Newcomer,
}

/// What a new participant becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Newcomer {
    /// A participant with this row, the next free one.
    Row(u32),
    /// A participant for whom no row is free.
    NoRow,
    /// A pilot.
    Pilot,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Known {
    state: State,
    erased: bool,
    done: u32,
    planned: u32,
}

impl Roster {
    /// A roster of these participants.
    pub fn new(rows: &[ParticipantRow], newcomer: Newcomer) -> Self {
        let known = rows.iter().map(|row| {
            let known = Known {
                state: row.state,
                erased: row.erased,
                done: row.trials_done,
                planned: row.trials_planned,
            };
            (row.participant.clone(), known)
        });
        Self {
            known: known.collect(),
            again: BTreeMap::new(),
            newcomer,
        }
    }

    /// Says of a participant who has finished a session when the next one is.
    pub fn comes_again(&mut self, participant: &ParticipantId, words: String) {
        self.again.insert(participant.clone(), words);
    }

    /// Who a typed id is; `None` if it is no id.
    pub fn who(&self, typed: &str) -> Option<String> {
        let id = ParticipantId::new(typed.trim()).ok()?;
        if let Some(other) = self
            .known
            .keys()
            .find(|k| **k != id && k.collides_with(&id))
        {
            return Some(format!("too similar to {other}"));
        }
        Some(match self.known.get(&id) {
            Some(Known { erased: true, .. }) => "erased".to_owned(),
            Some(Known {
                state: State::Unfinished,
                done,
                planned,
                ..
            }) => format!("unfinished, {done} of {planned} trials saved"),
            Some(Known {
                state: State::Done, ..
            }) => match self.again.get(&id) {
                Some(words) => words.clone(),
                None => "finished".to_owned(),
            },
            None
            | Some(Known {
                state: State::Void, ..
            }) => match self.newcomer {
                Newcomer::Row(row) => format!("new, row {row}"),
                Newcomer::NoRow => "new, but no row is free".to_owned(),
                Newcomer::Pilot => "new, a pilot".to_owned(),
            },
            Some(Known { state, .. }) => state.as_str().to_owned(),
        })
    }
}
