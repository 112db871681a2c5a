//! Comparing the derived tables with the journals.
//!
//! The tables are written when a session begins and ends. Those of participants whose session is
//! open at this moment are behind their journals, and are left out.

use super::Finding;
use crate::store::derive::Derived;
use crate::store::error::{At as _, StoreError, plain};
use crate::store::sessions::SessionData;
use crate::store::{StudyFolder, layout};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use study_base::text::ParticipantId;
use study_plan::protocol::Protocol;
use study_plan::protocol::columns::ParticipantColumn;

/// The cells of a row that are not empty, by column.
type Cells = BTreeMap<String, String>;

impl StudyFolder {
    /// Compares each table with what the journals give.
    pub(super) fn verify_tables(
        &self,
        sessions: &[SessionData],
        protocol: &Protocol,
        found: &mut Vec<Finding>,
    ) -> Result<(), StoreError> {
        let same = |old: &[u8], new: &[u8]| old == new;
        let compared = self.compare_tables(sessions, protocol, same)?;
        if !compared.iter().any(|f| f.is_problem) {
            found.extend(compared);
            return Ok(());
        }
        // A session may be open, or have ended while the files were read.
        let mut sessions = self.sessions()?;
        let open: BTreeSet<ParticipantId> = (sessions.iter())
            .filter(|s| s.tombstone.is_none() && self.is_open(s))
            .map(|s| s.participant.clone())
            .collect();
        sessions.retain(|s| !open.contains(&s.participant));
        let same = |old: &[u8], new: &[u8]| match open.is_empty() {
            true => old == new,
            false => rows(old, &open) == rows(new, &open),
        };
        found.extend(self.compare_tables(&sessions, protocol, same)?);
        for id in open {
            let place = format!("{}/{id}", layout::SESSIONS);
            let what = "a session is open: its rows in the tables are written when it ends";
            found.push(Finding::note(place, what));
        }
        Ok(())
    }

    fn compare_tables(
        &self,
        sessions: &[SessionData],
        protocol: &Protocol,
        same: impl Fn(&[u8], &[u8]) -> bool,
    ) -> Result<Vec<Finding>, StoreError> {
        let mut found = Vec::new();
        let derived = Derived::of(sessions, protocol);
        for (name, bytes) in derived.tables(protocol).at(&self.path)? {
            match self.disk.read(&self.path.join(name)) {
                Ok(old) if same(&old, &bytes) => {}
                Ok(_) => found.push(Finding::problem(
                    name,
                    "differs from what the journals give",
                )),
                Err(e) if e.kind() == io::ErrorKind::NotFound => {
                    found.push(Finding::note(name, "not written yet"));
                }
                Err(e) => found.push(Finding::problem(name, plain(&e))),
            }
        }
        Ok(found)
    }
}

/// The rows of a table without those of some participants; `None` if it is no table. Columns
/// that are empty in all of them do not matter: who is left out may be the only one to have them.
fn rows(table: &[u8], without: &BTreeSet<ParticipantId>) -> Option<Vec<Cells>> {
    let mut reader = csv::Reader::from_reader(table);
    let header = reader.headers().ok()?.clone();
    let id = ParticipantColumn::Participant.name();
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.ok()?;
        let cells = header
            .iter()
            .zip(&record)
            .filter(|(_, cell)| !cell.is_empty());
        let cells: Cells = cells
            .map(|(name, cell)| (name.into(), cell.into()))
            .collect();
        let of = cells
            .get(id)
            .and_then(|id| ParticipantId::new(id.as_str()).ok());
        if !of.is_some_and(|of| without.contains(&of)) {
            rows.push(cells);
        }
    }
    Some(rows)
}
