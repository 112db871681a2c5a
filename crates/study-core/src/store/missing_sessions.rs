//! Whom the tables name although no journal tells of them.
//!
//! The tables are derived and prove nothing, but a session that was in them and is
//! gone was lost or taken away: it is told, and they are not written over unasked.

use super::sessions::SessionData;
use super::{StudyFolder, layout};
use crate::protocol::columns::ParticipantColumn;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use study_base::text::Untrusted;

/// A session that a table names and that is not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Vanished {
    /// The table.
    pub(super) table: &'static str,
    /// Whose, as the table has it.
    pub(super) participant: String,
    /// Which, as the table has it.
    pub(super) session: String,
}

impl fmt::Display for Vanished {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", Untrusted(&self.participant))?;
        match self.session.as_str() {
            "1" => Ok(()),
            other => write!(f, " (session {})", Untrusted(other)),
        }
    }
}

impl StudyFolder {
    /// By participant and session, each once. A table that is not there or cannot
    /// be read names nobody.
    pub(super) fn vanished(&self, sessions: &[SessionData]) -> Vec<Vanished> {
        let mut erased = BTreeSet::new();
        let mut there = BTreeSet::new();
        for session in sessions.iter().filter(|s| s.claimed) {
            let id = session.participant.as_str();
            there.insert((id, session.session.to_string()));
            if session.tombstone.is_some() {
                erased.insert(id);
            }
        }
        let mut gone = BTreeMap::new();
        for table in [layout::PARTICIPANTS, layout::RATINGS] {
            let Ok(bytes) = self.disk.read(&self.path.join(table)) else {
                continue;
            };
            for (id, session) in named(&bytes) {
                if !erased.contains(id.as_str()) && !there.contains(&(id.as_str(), session.clone()))
                {
                    gone.entry((id, session)).or_insert(table);
                }
            }
        }
        gone.into_iter()
            .map(|((participant, session), table)| Vanished {
                table,
                participant,
                session,
            })
            .collect()
    }
}

/// Participant and session of each row of a table.
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
    reader
        .records()
        .filter_map(Result::ok)
        .filter_map(|r| Some((r.get(id)?.to_owned(), r.get(session)?.to_owned())))
        .collect()
}
