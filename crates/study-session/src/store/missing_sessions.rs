//! Sessions that the derived tables contain although their journals are missing.
//!
//! Such a session was lost or removed. It is reported, and the tables are not
//! overwritten without an explicit request. A participant who had only been claimed
//! gave nothing that could be lost: a crash can leave such a row.

use super::sessions::SessionData;
use super::{StudyFolder, layout};
use crate::outcome::State;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use study_base::text::Untrusted;
use study_plan::protocol::columns::ParticipantColumn;

/// A session in a table whose journal is missing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MissingSession {
    /// File name of the table.
    pub(super) table: &'static str,
    /// Participant, as in the table.
    pub(super) participant: String,
    /// Session, as in the table.
    pub(super) session: String,
}

impl fmt::Display for MissingSession {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", Untrusted(&self.participant))?;
        match self.session.as_str() {
            "1" => Ok(()),
            other => write!(f, " (session {})", Untrusted(other)),
        }
    }
}

impl StudyFolder {
    /// The missing sessions by participant and session, each once. A table that does
    /// not exist or cannot be read contains none.
    pub(super) fn missing_sessions(&self, sessions: &[SessionData]) -> Vec<MissingSession> {
        let mut erased = BTreeSet::new();
        let mut present = BTreeSet::new();
        for session in sessions.iter().filter(|s| s.claimed) {
            let id = session.participant.as_str();
            present.insert((id, session.session.to_string()));
            // The tables have the id of before until they are written again.
            for former in &session.history.former_ids {
                present.insert((former.as_str(), session.session.to_string()));
            }
            if session.tombstone.is_some() {
                erased.insert(id);
            }
        }
        let mut missing = BTreeMap::new();
        for table in [layout::PARTICIPANTS, layout::RATINGS] {
            let Ok(bytes) = self.disk.read(&self.path.join(table)) else {
                continue;
            };
            for (id, session) in named(&bytes) {
                if !erased.contains(id.as_str())
                    && !present.contains(&(id.as_str(), session.clone()))
                {
                    missing.entry((id, session)).or_insert(table);
                }
            }
        }
        missing
            .into_iter()
            .map(|((participant, session), table)| MissingSession {
                table,
                participant,
                session,
            })
            .collect()
    }
}

/// Participant and session of each row of a table that is more than a claim.
fn named(table: &[u8]) -> BTreeSet<(String, String)> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(table);
    let Ok(header) = reader.headers() else {
        return BTreeSet::new();
    };
    // Both tables have these columns under the same names.
    let find = |column: ParticipantColumn| header.iter().position(|h| h == column.name());
    let (Some(id), Some(session)) = (
        find(ParticipantColumn::Participant),
        find(ParticipantColumn::Session),
    ) else {
        return BTreeSet::new();
    };
    // A state is only in participants.csv.
    let (state, started) = (
        find(ParticipantColumn::State),
        find(ParticipantColumn::StartedAt),
    );
    let is_claim = |r: &csv::StringRecord| {
        let cell = |column: Option<usize>| column.and_then(|at| r.get(at));
        cell(state) == Some(State::Unfinished.as_str()) && cell(started) == Some("")
    };
    reader
        .records()
        .filter_map(Result::ok)
        .filter(|r| !is_claim(r))
        .filter_map(|r| Some((r.get(id)?.to_owned(), r.get(session)?.to_owned())))
        .collect()
}
