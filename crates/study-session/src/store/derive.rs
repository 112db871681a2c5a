//! The rows of the derived tables, from the journals.
//!
//! They are sorted by participant, session and trial, so that the same journals give
//! the same bytes. [`super::tables`] writes them.

use super::error::{At as _, StoreError};
use super::sessions::SessionData;
use super::{StudyFolder, atomic, journal, layout, tables};
use crate::outcome::fold::{attempt_rows, interval_rows};
use crate::outcome::{AttemptRow, IntervalRow, ParticipantRow, RatingRow, State, Verdict};
use std::collections::BTreeSet;
use std::io;
use study_base::text::ParticipantId;
use study_plan::protocol::Protocol;

/// Every row of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Derived {
    /// One for each planned trial of each session that was started, except those of
    /// void sessions and of participants who withdrew.
    pub rows: Vec<RatingRow>,
    /// One for each attempt, answer, correction, failure, remark and change of state.
    pub attempts: Vec<AttemptRow>,
    /// One for each participant, by the last session.
    pub participants: Vec<ParticipantRow>,
    /// One for each presentation, in a study with parts.
    pub intervals: Vec<IntervalRow>,
}

impl StudyFolder {
    /// Derives and writes the tables under one lock, so that of two processes the
    /// later one also writes later.
    ///
    /// # Errors
    /// As [`StudyFolder::sessions`]; [`StoreError::SessionsMissing`] if the tables name a
    /// session that does not exist; those of writing, after which each table is either
    /// the old one or the new one.
    pub fn refresh(&self, protocol: &Protocol) -> Result<Derived, StoreError> {
        self.refresh_with(protocol, false)
    }

    /// As [`StudyFolder::refresh`]; with `drop_missing` sessions that do not exist are
    /// dropped from the tables.
    ///
    /// # Errors
    /// As [`StudyFolder::refresh`].
    pub fn refresh_with(
        &self,
        protocol: &Protocol,
        drop_missing: bool,
    ) -> Result<Derived, StoreError> {
        let _lock = self.lock()?;
        let sessions = self.sessions()?;
        let missing = self.missing_sessions(&sessions);
        if !drop_missing && !missing.is_empty() {
            let who: Vec<String> = missing.iter().map(ToString::to_string).collect();
            return Err(StoreError::SessionsMissing {
                path: self.path.clone(),
                who: who.join(", "),
            });
        }
        // Nothing may be in a table that a loss of power can still take from a journal.
        self.settle(&sessions)?;
        let derived = Derived::of(&sessions, protocol);
        for (name, bytes) in derived.tables(protocol).at(&self.path)? {
            atomic::replace_if_new(self.disk.as_ref(), &self.path.join(name), &bytes)?;
        }
        Ok(derived)
    }
}

impl StudyFolder {
    /// Returns when every journal is on the medium.
    fn settle(&self, sessions: &[SessionData]) -> Result<(), StoreError> {
        for session in sessions.iter().filter(|s| !s.settled) {
            journal::settle(self.disk.as_ref(), &session.path)?;
            self.settle_names(&session.participant)?;
        }
        Ok(())
    }
}

impl Derived {
    /// In how many trials of the last session of a participant the force was wrong, and in
    /// how many it was judged.
    pub fn wrong_forces(&self, participant: &str) -> [usize; 2] {
        let own = || (self.rows.iter()).filter(|row| row.participant.as_str() == participant);
        let last = own().map(|row| row.session).max();
        let verdicts: Vec<Verdict> = own()
            .filter(|row| Some(row.session) == last)
            .filter_map(|row| Some(row.fidelity.as_ref()?.verdict))
            .collect();
        let wrong = |verdict: &&Verdict| matches!(verdict, Verdict::Flag | Verdict::Fault);
        [verdicts.iter().filter(wrong).count(), verdicts.len()]
    }

    /// The rows of all sessions of a study. `protocol` has the VAF of its realizations.
    /// Damaged lines of a journal are skipped; [`StudyFolder::verify`] reports them.
    pub fn of(sessions: &[SessionData], protocol: &Protocol) -> Self {
        let mut derived = Self {
            participants: participants(sessions),
            ..Self::default()
        };
        // Whoever withdraws in a later session withdraws all.
        let withdrawn: BTreeSet<&ParticipantId> = (sessions.iter())
            .filter(|s| s.standing().state == State::Withdrawn)
            .map(|s| &s.participant)
            .collect();
        for session in sessions {
            let withdrawn = withdrawn.contains(&session.participant);
            if session.standing().state != State::Void && !withdrawn {
                derived.rows.extend(session.history.rating_rows(protocol));
                if !protocol.parts.is_empty() {
                    derived
                        .intervals
                        .extend(interval_rows(&session.history, protocol));
                }
            }
            if !withdrawn {
                let rows = attempt_rows(
                    &session.history,
                    &session.participant,
                    session.session,
                    &session.entries,
                );
                derived.attempts.extend(rows);
            }
        }
        derived
    }

    /// File name and bytes of each table that the study has.
    pub(super) fn tables(&self, protocol: &Protocol) -> io::Result<Vec<(&'static str, Vec<u8>)>> {
        let header = RatingRow::header_of(protocol, &self.rows);
        let ratings = tables::csv(&header, &self.rows)?;
        let header = AttemptRow::header_of(&self.attempts);
        let attempts = tables::csv(&header, &self.attempts)?;
        let header = ParticipantRow::header_of(protocol, &self.participants);
        let participants = tables::csv(&header, &self.participants)?;
        let mut tables = vec![
            (layout::RATINGS, ratings),
            (layout::ATTEMPTS, attempts),
            (layout::PARTICIPANTS, participants),
        ];
        if !protocol.parts.is_empty() {
            let intervals = tables::csv(&IntervalRow::header(), &self.intervals)?;
            tables.push((layout::INTERVALS, intervals));
        }
        Ok(tables)
    }
}

/// One row for each participant.
pub fn participants(sessions: &[SessionData]) -> Vec<ParticipantRow> {
    let mut rows: Vec<ParticipantRow> = Vec::new();
    for session in sessions.iter().filter(|s| s.claimed) {
        let history = &session.history;
        let mut row = history.participant_row(&session.participant, session.session);
        if let Some(seat) = session.seat {
            row.row = seat.row();
            row.pilot = seat.is_pilot();
            row.simulated = seat.is_simulated();
        }
        if let Some(stone) = &session.tombstone {
            row.state = stone.state;
            row.reason.clone_from(&stone.reason);
            row.erased = true;
        } else if row.state == State::Withdrawn {
            // The tables keep only that the participant took part.
            row.answers.clear();
        }
        match rows.last_mut() {
            Some(last) if last.participant == row.participant => {
                // What is asked once was asked in the first session.
                if !matches!(row.state, State::Withdrawn | State::Void) && !row.erased {
                    let earlier = std::mem::take(&mut last.answers);
                    for (question, answer) in earlier {
                        row.answers.entry(question).or_insert(answer);
                    }
                }
                *last = row;
            }
            _ => rows.push(row),
        }
    }
    rows
}
