//! Which rows count, and why others do not.

use super::Rules;
use super::exclude::{self, Applied};
use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::sync::Arc;
use study_plan::protocol::{Exclusion, Unfinished};
use study_session::outcome::Status;
use study_session::outcome::event::State;
use study_session::outcome::ratings::{Origin, Ratings};

/// Which rows also count, besides those of real participants.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Include {
    /// Those of pilots.
    pub pilot: bool,
    /// Those of simulated participants.
    pub simulated: bool,
}

/// Why a row does not count.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// It is a pilot's, and there are real ones.
    Pilot,
    /// It is a simulated participant's, and there are others.
    Simulated,
    /// Its session is unfinished, and the protocol excludes these.
    Unfinished,
    /// The participant's state, with the reason that was given.
    State(State, String),
    /// A preregistered exclusion rule.
    Rule(Exclusion),
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pilot => f.write_str("pilot"),
            Self::Simulated => f.write_str("simulated"),
            Self::Unfinished => f.write_str("unfinished"),
            Self::State(state, why) if why.is_empty() => f.write_str(state.as_str()),
            Self::State(state, why) => write!(f, "{}: {why}", state.as_str()),
            Self::Rule(rule) => write!(f, "rule {rule}"),
        }
    }
}

/// Why a row does not count; `None` if it does.
pub(super) type Decision = Option<Arc<Reason>>;

/// Whose rows count: those of real participants alone, unless others are included.
/// Without any, those of pilots, and without these the simulated ones, under a banner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Whose {
    real: bool,
    /// Real participants or pilots.
    people: bool,
    include: Include,
}

impl Whose {
    pub(super) fn of(origins: &[Origin], include: Include) -> Self {
        let real = origins.contains(&Origin::Real);
        Self {
            real,
            people: real || origins.contains(&Origin::Pilot),
            include,
        }
    }

    pub(super) fn counts(self, origin: Origin) -> bool {
        match origin {
            Origin::Real => true,
            Origin::Pilot => !self.real || self.include.pilot,
            Origin::Simulated => !self.people || self.include.simulated,
        }
    }
}

/// Whether the answers of a participant in this state count.
pub(super) fn state_counts(state: State, unfinished: Unfinished) -> bool {
    match state {
        State::Done => true,
        State::Unfinished | State::DroppedOut => unfinished == Unfinished::Include,
        State::Void | State::NoShow | State::Excluded | State::Withdrawn => false,
    }
}

/// Decides which rows count; also returns the effect of each exclusion rule.
///
/// The exclusion rules are applied to the rows that are left by [`Whose`] and
/// [`state_counts`].
pub(super) fn decide(ratings: &Ratings, rules: &Rules) -> (Vec<Decision>, Vec<Applied>) {
    let whose = Whose::of(&ratings.origin, rules.include);
    let pilot = Arc::new(Reason::Pilot);
    let simulated = Arc::new(Reason::Simulated);
    let states: Vec<Decision> = (ratings.subjects.iter())
        .map(|subject| {
            let state = subject.state?;
            if state_counts(state, rules.unfinished) {
                return None;
            }
            Some(Arc::new(match state {
                State::Unfinished | State::DroppedOut => Reason::Unfinished,
                _ => Reason::State(state, subject.reason.clone()),
            }))
        })
        .collect();
    let mut decisions: Vec<Decision> = (0..ratings.len())
        .map(|i| match ratings.origin[i] {
            origin if whose.counts(origin) => states[ratings.subject[i] as usize].clone(),
            Origin::Simulated => Some(Arc::clone(&simulated)),
            Origin::Real | Origin::Pilot => Some(Arc::clone(&pilot)),
        })
        .collect();
    if rules.exclude.is_empty() {
        return (decisions, Vec::new());
    }
    let counted: Vec<usize> = (0..ratings.len())
        .filter(|&i| decisions[i].is_none())
        .collect();
    let trials = exclude::trials(ratings, counted.iter().copied(), rules.primary);
    let (excluded_by, applied) = exclude::apply(&rules.exclude, &trials);
    let reasons: Vec<Decision> = (rules.exclude.iter())
        .map(|rule| Some(Arc::new(Reason::Rule(*rule))))
        .collect();
    for (i, rule) in counted.into_iter().zip(excluded_by) {
        if let Some(rule) = rule {
            decisions[i].clone_from(&reasons[rule]);
        }
    }
    (decisions, applied)
}

/// How many rows and participants there are.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rows of the table without practice.
    pub rows: usize,
    /// Rows that count and have a rating.
    pub rated: usize,
    /// Rows that count but have no rating, for any reason; the next three are
    /// among them.
    pub without_rating: usize,
    /// Trials that count and failed in every attempt.
    pub failed: usize,
    /// Trials that count and whose question was declined.
    pub declined: usize,
    /// Trials that count and were never reached, or left empty.
    pub missing: usize,
    /// Rows that count with a corrected answer.
    pub corrected: usize,
    /// Rows that count after a failed attempt.
    pub repeated: usize,
    /// Practice rows, which are never analyzed.
    pub practice: usize,
    /// Rows that do not count, by reason.
    pub excluded: BTreeMap<String, usize>,
    /// Participants with rows that count.
    pub participants: usize,
    /// Of these, those with at least one rating.
    pub with_ratings: usize,
    /// Real participants whose session is finished or of unknown state, including
    /// those excluded by a rule. Only these count towards the planned ones.
    pub finished: usize,
    /// Participants with at least one row that does not count.
    pub excluded_participants: usize,
    /// Planned participants.
    pub planned: Option<u32>,
    /// Pilots with rows that count.
    pub pilots: usize,
    /// Simulated participants with rows that count.
    pub simulated: usize,
    /// Rows of real participants, whether they count or not.
    pub real_rows: usize,
}

impl Counts {
    pub(super) fn of(all: &Ratings, used: &Ratings, decisions: &[Decision], rules: &Rules) -> Self {
        let with = |status: Status| {
            (0..used.len())
                .filter(|&i| used.status[i] == status && used.rating[i].is_none())
                .count()
        };
        let rated = used.rating.iter().flatten().count();
        let mut gone = vec![false; all.subjects.len()];
        // Rows share their reasons: each is formatted once.
        let mut by_reason: Vec<(&Arc<Reason>, usize)> = Vec::new();
        let mut places: HashMap<*const Reason, usize> = HashMap::new();
        let mut took_part = vec![false; all.subjects.len()];
        for (i, decision) in decisions.iter().enumerate() {
            let counts = matches!(decision.as_deref(), None | Some(Reason::Rule(_)));
            if counts && all.origin[i] == Origin::Real {
                took_part[all.subject[i] as usize] = true;
            }
            if let Some(reason) = decision {
                let at = *places.entry(Arc::as_ptr(reason)).or_insert_with(|| {
                    by_reason.push((reason, 0));
                    by_reason.len() - 1
                });
                by_reason[at].1 += 1;
                gone[all.subject[i] as usize] = true;
            }
        }
        let mut excluded = BTreeMap::new();
        for (reason, rows) in by_reason {
            *excluded.entry(reason.to_string()).or_insert(0) += rows;
        }
        let mut origin = vec![Origin::Real; used.subjects.len()];
        for (&s, &o) in used.subject.iter().zip(&used.origin) {
            origin[s as usize] = origin[s as usize].max(o);
        }
        let mut rated_by = vec![false; used.subjects.len()];
        for (&s, rating) in used.subject.iter().zip(&used.rating) {
            rated_by[s as usize] |= rating.is_some();
        }
        let finished = |state: Option<State>| matches!(state, None | Some(State::Done));
        Self {
            rows: all.len(),
            rated,
            without_rating: used.len() - rated,
            failed: with(Status::Failed),
            declined: with(Status::Declined),
            missing: with(Status::Missing) + with(Status::Ok),
            corrected: used.corrected.iter().filter(|c| **c).count(),
            repeated: used.attempt.iter().flatten().filter(|a| **a > 1).count(),
            practice: all.practice.len(),
            excluded,
            participants: used.subjects.len(),
            with_ratings: rated_by.iter().filter(|r| **r).count(),
            finished: (all.subjects.iter().zip(&took_part))
                .filter(|(s, part)| **part && finished(s.state))
                .count(),
            excluded_participants: gone.iter().filter(|g| **g).count(),
            planned: rules.planned,
            pilots: origin.iter().filter(|o| **o == Origin::Pilot).count(),
            simulated: origin.iter().filter(|o| **o == Origin::Simulated).count(),
            real_rows: all.origin.iter().filter(|o| **o == Origin::Real).count(),
        }
    }

    /// Real participants with rows that count.
    pub fn real(&self) -> usize {
        self.participants - self.pilots - self.simulated
    }

    /// Whether fewer participants have finished than were planned. A study without
    /// any real participant is never interim.
    pub fn interim(&self) -> bool {
        self.real() > 0 && self.planned.is_some_and(|p| self.finished < p as usize)
    }
}
