//! Who a typed id is: one line on the first screen, before a row is taken.

use crate::outcome::{ParticipantRow, State};
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;
use study_base::text::ParticipantId;
use study_plan::protocol::Confirms;

/// The participants of the study when the program started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Roster {
    known: BTreeMap<ParticipantId, Known>,
    /// What is said of participants who have finished a session and come again.
    again: BTreeMap<ParticipantId, String>,
    /// Those who began last, the latest first.
    recent: Vec<ParticipantId>,
    /// Whose session was interrupted.
    interrupted: Option<Interrupted>,
    /// The search that the study confirms.
    search: Option<Confirms>,
    newcomer: Newcomer,
}

/// A session that was interrupted.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Interrupted {
    participant: ParticipantId,
    /// When, such as "at 14:05, 20 minutes ago".
    left: String,
    /// Where it goes on, such as "with trial 12 of 40".
    goes_on: String,
}

/// How many of the last participants are shown.
const RECENT: usize = 5;

/// What a new participant becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Newcomer {
    /// A participant with this row, the next free one.
    Row(u32),
    /// A participant for whom no row is free.
    NoRow,
    /// A pilot.
    Pilot,
    /// Simulated: no person.
    Simulated,
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
        let mut begun: Vec<&ParticipantRow> =
            rows.iter().filter(|row| row.started_at.is_some()).collect();
        begun.small_sort_by_key(|row| std::cmp::Reverse(row.started_at));
        let recent = begun.iter().take(RECENT);
        Self {
            recent: recent.map(|row| row.participant.clone()).collect(),
            known: known.collect(),
            again: BTreeMap::new(),
            interrupted: None,
            search: None,
            newcomer,
        }
    }

    /// Says of a participant who has finished a session when the next one is.
    pub fn comes_again(&mut self, participant: &ParticipantId, words: String) {
        self.again.insert(participant.clone(), words);
    }

    /// Says whose session was interrupted, when, such as "at 14:05, 20 minutes ago", and where it
    /// goes on, such as "with trial 12 of 40".
    pub fn interrupted(&mut self, participant: ParticipantId, left: String, goes_on: String) {
        self.interrupted = Some(Interrupted {
            participant,
            left,
            goes_on,
        });
    }

    /// Whose session was interrupted last.
    pub fn who_is_unfinished(&self) -> Option<&ParticipantId> {
        self.interrupted.as_ref().map(|own| &own.participant)
    }

    /// Two sentences that say whose session was interrupted and how it goes on.
    pub fn unfinished(&self) -> Option<[String; 2]> {
        let own = self.interrupted.as_ref()?;
        let (id, left, goes_on) = (&own.participant, &own.left, &own.goes_on);
        Some([
            format!("{id} was interrupted {left}."),
            format!("Type {id} to go on {goes_on}, or another id for somebody else."),
        ])
    }

    /// The id that Enter alone takes: one for the next participant. Not while somebody has not finished: an Enter that is
    /// pressed once too often would go on with a session of somebody else, or start one beside it, so that an id is typed.
    pub fn proposed(&self) -> Option<ParticipantId> {
        match self.interrupted {
            Some(_) => None,
            None => self.next_id(),
        }
    }

    /// Says which search the study confirms: who took part in it cannot take part here.
    pub fn confirms(&mut self, search: Confirms) {
        self.search = Some(search);
    }

    fn was_searcher(&self, id: &ParticipantId) -> bool {
        (self.search.as_ref()).is_some_and(|search| search.was_searcher(id))
    }

    /// The participants who began last, the latest first, with who they are.
    pub fn recent(&self) -> impl Iterator<Item = (&ParticipantId, String)> {
        let who = |id: &ParticipantId| self.who(id.as_str()).unwrap_or_default();
        self.recent.iter().map(move |id| (id, who(id)))
    }

    fn next_id(&self) -> Option<ParticipantId> {
        self.next_ids().next()
    }

    /// Ids for the next participants, in their order: that of the last one, or P00, with the next free
    /// numbers. None if that id does not end with a number.
    pub fn next_ids(&self) -> impl Iterator<Item = ParticipantId> {
        let last = self.recent.first().map_or("P00", ParticipantId::as_str);
        let name = last.trim_end_matches(|c: char| c.is_ascii_digit());
        let digits = &last[name.len()..];
        let width = digits.len();
        let number = digits.parse::<u32>().ok();
        let numbers = number.map(|number| number..number.saturating_add(1000));
        let id =
            move |n: u32| ParticipantId::new(format!("{name}{:0width$}", n.checked_add(1)?)).ok();
        (numbers.into_iter().flatten())
            .filter_map(id)
            .filter(move |id| !self.was_searcher(id))
            .filter(move |id| !self.known.keys().any(|k| k == id || k.collides_with(id)))
    }

    /// Who a typed id is; `None` if it is no id.
    pub fn who(&self, typed: &str) -> Option<String> {
        let id = ParticipantId::new(typed.trim()).ok()?;
        if self.was_searcher(&id) {
            return Some("took part in the search".to_owned());
        }
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
            None if id.is_like_option() => "begins with -, like an option".to_owned(),
            None if id.is_windows_device() => "the name of a device on Windows".to_owned(),
            None
            | Some(Known {
                state: State::Void, ..
            }) => match self.newcomer {
                Newcomer::Row(row) => format!("new, row {row}"),
                Newcomer::NoRow => "new, but no row is free".to_owned(),
                Newcomer::Pilot => "new, a pilot".to_owned(),
                Newcomer::Simulated => "new, simulated".to_owned(),
            },
            Some(Known { state, .. }) => state.as_str().to_owned(),
        })
    }
}
