//! What a verification cannot check, and why.

use crate::outcome::{Entry, Event};
use crate::store::sessions::SessionData;
use crate::store::{StudyFolder, layout};
use std::collections::BTreeSet;
use study_base::text::counted;

/// Folders that are not compared with anything, with the reason.
const FOLDERS: [(&str, &str); 2] = [
    (layout::ANALYSIS, "which `study analyze` writes again"),
    (layout::DOCTOR, "from which nothing is derived"),
];

impl StudyFolder {
    /// What [`StudyFolder::verify`] does not check of these sessions, each with the reason; empty
    /// where it checks everything. `has_protocol` says whether it is given the protocol.
    pub fn not_checked(&self, sessions: &[SessionData], has_protocol: bool) -> Vec<String> {
        let mut parts = Vec::new();
        if !has_protocol {
            let what = "the derived tables, tracks, searches, ends of practice and steps of adjustments, because the frozen protocol cannot be read";
            parts.push(what.to_owned());
        }
        let files: usize = sessions.iter().map(|s| self.without_checksum(s)).sum();
        if files > 0 {
            parts.push(format!(
                "the numbers in {}, because the journals have no checksum of what earlier releases or playbacks without a confirmed end left",
                counted(files, "telemetry file", "telemetry files")
            ));
        }
        let items = self.disk.list(&self.path).unwrap_or_default();
        for (name, why) in FOLDERS {
            if items.iter().any(|item| item.name == name) {
                parts.push(format!("{name}/, {why}"));
            }
        }
        parts
    }

    /// The number of telemetry files of a session whose checksum is not in its journal.
    fn without_checksum(&self, session: &SessionData) -> usize {
        if session.tombstone.is_some() {
            return 0;
        }
        let file = |entry: &Entry| match &entry.event {
            Event::PlaybackEnded { telemetry, .. } => telemetry.as_ref().map(|t| t.file.clone()),
            _ => None,
        };
        let named: BTreeSet<String> = session.entries.iter().filter_map(file).collect();
        let folder = session.path.join(layout::TELEMETRY);
        let items = self.disk.list(&folder).unwrap_or_default();
        let other = items.iter().filter(|item| !named.contains(&item.name));
        other.count()
    }
}
