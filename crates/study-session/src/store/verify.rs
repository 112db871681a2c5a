//! Verifying a results folder: every file is read again and compared.

mod adjustments;
mod clocks;
mod not_checked;
mod practice;
mod searches;
mod tables;
mod telemetry;
mod tracks;

use super::error::{At as _, StoreError, plain};
use super::ledger::SeatKind;
use super::manifest::{CHECKSUM, Manifest};
use super::receipt::Receipt;
use super::replay::DamageKind;
use super::sessions::{SessionData, deciding};
use super::{StudyFolder, layout};
use crate::outcome::Event;
use std::collections::{BTreeMap, BTreeSet};
use study_base::hex::sha256;
use study_base::text::{ParticipantId, Untrusted, counted};
use study_plan::protocol::{Protocol, Seat};

/// A finding of the verification of a results folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Whether it is a problem and not only a note.
    pub is_problem: bool,
    /// File or folder, relative to the study's folder.
    pub place: String,
    /// Description.
    pub what: String,
}

impl Finding {
    fn problem(place: impl Into<String>, what: impl Into<String>) -> Self {
        Self {
            is_problem: true,
            place: place.into(),
            what: what.into(),
        }
    }

    fn note(place: impl Into<String>, what: impl Into<String>) -> Self {
        Self {
            is_problem: false,
            ..Self::problem(place, what)
        }
    }
}

impl StudyFolder {
    /// Verifies the checksums and the chain of every journal, the hashes of the frozen
    /// protocol, the number of telemetry samples and, given a protocol, the levels of
    /// tracks, the pairs of searches, the ends of practice, the steps of adjustments and the derived tables.
    ///
    /// # Errors
    /// [`StoreError`] if a folder or journal cannot be read at all.
    pub fn verify(&self, protocol: Option<&Protocol>) -> Result<Vec<Finding>, StoreError> {
        let sessions = self.sessions()?;
        let mut found = self.verify_journals(&sessions)?;
        for session in &sessions {
            let place = place_of(session);
            self.verify_telemetry(session, &place, &mut found);
            clocks::verify_clocks(session, &place, &mut found);
        }
        if let Some(protocol) = protocol {
            for session in &sessions {
                let place = place_of(session);
                tracks::verify_tracks(session, protocol, &place, &mut found);
                searches::verify_searches(session, protocol, &place, &mut found);
                practice::verify_practice(session, protocol, &place, &mut found);
                adjustments::verify_adjustments(session, protocol, &place, &mut found);
            }
            self.verify_tables(&sessions, protocol, &mut found)?;
        }
        Ok(found)
    }

    /// The problems of the frozen protocol and the journals, which affect everything
    /// derived from them.
    ///
    /// # Errors
    /// As [`StudyFolder::verify`].
    pub fn faults(&self, sessions: &[SessionData]) -> Result<Vec<Finding>, StoreError> {
        let mut found = self.verify_journals(sessions)?;
        found.retain(|f| f.is_problem);
        Ok(found)
    }

    fn verify_journals(&self, sessions: &[SessionData]) -> Result<Vec<Finding>, StoreError> {
        let mut found = Vec::new();
        self.verify_frozen(&mut found)?;
        self.verify_names(sessions, &mut found)?;
        for session in sessions {
            self.verify_session(session, &mut found)?;
        }
        verify_protection(sessions, &mut found);
        verify_rows(sessions, &mut found);
        for missing in self.missing_sessions(sessions) {
            let what = format!(
                "{} contains {missing}, whose journal is missing",
                missing.table
            );
            found.push(Finding::problem(layout::SESSIONS, what));
        }
        Ok(found)
    }

    fn verify_frozen(&self, found: &mut Vec<Finding>) -> Result<(), StoreError> {
        let manifest = Manifest::read(self.disk.as_ref(), &self.path)?;
        if manifest.intact == Some(false) {
            found.push(Finding::problem(layout::MANIFEST, CHECKSUM));
        }
        for version in &manifest.versions {
            let folder = layout::protocol(&self.path, version.version);
            for (name, hash) in &version.files {
                let place = format!("{}/{}/{name}", layout::PROTOCOLS, version.version);
                match self.disk.read(&folder.join(name)) {
                    Err(e) => found.push(Finding::problem(place, plain(&e))),
                    Ok(bytes) if sha256(&bytes) != *hash => found.push(Finding::problem(
                        place,
                        "not the file that was frozen (its SHA-256 differs from study.json)",
                    )),
                    Ok(_) => {}
                }
            }
        }
        Ok(())
    }

    /// Checks the names of the folders in `sessions/`.
    fn verify_names(
        &self,
        sessions: &[SessionData],
        found: &mut Vec<Finding>,
    ) -> Result<(), StoreError> {
        let folder = self.path.join(layout::SESSIONS);
        let Ok(items) = self.disk.list(&folder) else {
            return Ok(());
        };
        let mut ids: Vec<ParticipantId> = Vec::new();
        for item in items {
            let place = format!("{}/{}", layout::SESSIONS, Untrusted(&item.name));
            let is_folder = item.is_folder();
            match ParticipantId::new(item.name) {
                Ok(id) if is_folder => {
                    if let Some(other) = ids.iter().find(|i| i.collides_with(&id)) {
                        found.push(Finding::problem(
                            &place,
                            format!("differs from {other} only in upper and lower case"),
                        ));
                    }
                    let erased = |s: &SessionData| s.participant == id && s.tombstone.is_some();
                    let erased = sessions.iter().any(erased);
                    self.verify_participant(&id, erased, &place, found)?;
                    ids.push(id);
                }
                _ => found.push(Finding::note(
                    place,
                    "not the folder of a participant; ignored",
                )),
            }
        }
        Ok(())
    }

    fn verify_participant(
        &self,
        id: &ParticipantId,
        erased: bool,
        place: &str,
        found: &mut Vec<Finding>,
    ) -> Result<(), StoreError> {
        let folder = layout::participant(&self.path, id);
        for item in self.disk.list(&folder).at(&folder)? {
            let is_session = item.is_folder() && layout::number(&item.name).is_some();
            let place = format!("{place}/{}", Untrusted(&item.name));
            if is_session && erased {
                found.push(Finding::problem(
                    place,
                    "the erasure is incomplete; repeat the same command",
                ));
            } else if !is_session && item.name != layout::TOMBSTONE {
                found.push(Finding::note(place, "not written by study; ignored"));
            }
        }
        Ok(())
    }

    fn verify_session(
        &self,
        session: &SessionData,
        found: &mut Vec<Finding>,
    ) -> Result<(), StoreError> {
        let place = place_of(session);
        if let Some(stone) = &session.tombstone {
            let place = format!("{}/{}", layout::SESSIONS, session.participant);
            if stone.participant != session.participant {
                found.push(Finding::problem(
                    &place,
                    "the tombstone belongs to another participant",
                ));
            }
            let when = stone.erased_at.to_rfc3339();
            found.push(Finding::note(place, format!("erased at {when}")));
            return Ok(());
        }
        if !session.claimed && session.damage.iter().all(is_torn) {
            found.push(Finding::note(
                place,
                "the claim is incomplete; no session was started",
            ));
            return Ok(());
        }
        // An incomplete end was never acknowledged.
        let open_end = session.is_unfinished() || session.protected;
        for damage in &session.damage {
            let expected =
                is_torn(damage) && (open_end || Some(&damage.file) != session.last_file.as_ref());
            found.push(Finding {
                is_problem: !expected,
                place: place.clone(),
                what: damage.to_string(),
            });
        }
        if let Some(claim) = &session.claim
            && (!is_or_was(session, &claim.participant) || claim.session != session.session)
        {
            let whose = format!(
                "the journal belongs to {}, session {}",
                claim.participant, claim.session
            );
            found.push(Finding::problem(&place, whose));
        }
        self.verify_start(session, &place, found);
        self.verify_receipt(session, &place, found)?;
        for item in self.disk.list(&session.path).at(&session.path)? {
            let known = layout::segment_number(&item.name).is_some()
                || layout::OF_SESSION.contains(&item.name.as_str());
            let place = format!("{place}/{}", Untrusted(&item.name));
            if layout::is_torn(&item.name) {
                found.push(Finding::note(
                    place,
                    "bytes of a line that was never acknowledged",
                ));
            } else if !known {
                found.push(Finding::note(place, "not written by study; ignored"));
            }
        }
        Ok(())
    }

    /// Compares the receipt with the record that it names.
    fn verify_receipt(
        &self,
        session: &SessionData,
        place: &str,
        found: &mut Vec<Finding>,
    ) -> Result<(), StoreError> {
        let what = match Receipt::read(self.disk.as_ref(), &session.path) {
            Ok(None) => return Ok(()),
            Ok(Some(receipt)) => {
                let record = (receipt.seq, receipt.hash);
                // It may have been written after the journal was read.
                let has = |session: &SessionData| session.hashes.contains(&record);
                if has(session) || has(&self.session(&session.participant, session.session)?) {
                    return Ok(());
                }
                format!("record {} is missing or changed", record.0)
            }
            Err(StoreError::Damaged { what, .. }) => what,
            Err(e) => e.to_string(),
        };
        found.push(Finding::problem(
            format!("{place}/{}", layout::RECEIPT),
            what,
        ));
        Ok(())
    }

    fn verify_start(&self, session: &SessionData, place: &str, found: &mut Vec<Finding>) {
        let Some(start) = session.history.start() else {
            let only_state = |e: &Event| matches!(e, Event::StateSet { .. });
            if !session.entries.iter().all(|e| only_state(&e.event)) {
                found.push(Finding::problem(
                    place,
                    "the start of the session is missing",
                ));
            }
            return;
        };
        if start.participant != session.participant
            || start.session != session.session
            || Some(start.seat) != session.seat
        {
            let what = "its first event names another participant, session or row";
            found.push(Finding::problem(place, what));
        }
        let version = start.protocol_version;
        match self.manifest.versions.iter().find(|v| v.version == version) {
            None => found.push(Finding::problem(
                place,
                format!("version {version} of the protocol is not in study.json"),
            )),
            Some(v) if v.fingerprints != start.fingerprints => found.push(Finding::problem(
                place,
                format!("its fingerprints differ from those of version {version} of the protocol"),
            )),
            Some(_) => {}
        }
    }
}

/// Notes which journals have no head: their ends could be missing unnoticed.
fn verify_protection(sessions: &[SessionData], found: &mut Vec<Finding>) {
    let without = |s: &&SessionData| s.claimed && !s.protected && s.damage.is_empty();
    let names: Vec<String> = sessions.iter().filter(without).map(place_of).collect();
    if let Some(first) = names.first() {
        let what = format!(
            "{} of an earlier release (such as {first}): no {} shows whether records are missing at the end",
            counted(names.len(), "journal", "journals"),
            layout::HEAD
        );
        found.push(Finding::note(layout::SESSIONS, what));
    }
}

/// Whether an id is that of a session, or was until it was corrected.
fn is_or_was(session: &SessionData, id: &ParticipantId) -> bool {
    session.participant == *id || session.history.former_ids.contains(id)
}

fn place_of(session: &SessionData) -> String {
    let (id, number) = (&session.participant, session.session);
    format!("{}/{id}/{number}", layout::SESSIONS)
}

fn is_torn(damage: &super::Damage) -> bool {
    matches!(damage.kind, DamageKind::Torn(_))
}

/// Finds participants who have the same row or number.
fn verify_rows(sessions: &[SessionData], found: &mut Vec<Finding>) {
    let mut holders: BTreeMap<Seat, BTreeSet<&ParticipantId>> = BTreeMap::new();
    for session in deciding(sessions) {
        let Some(seat) = session.seat else {
            continue;
        };
        let keeps = session.standing().state.keeps_row();
        let is_real = SeatKind::of(seat) == SeatKind::Real;
        if keeps || !is_real {
            holders
                .entry(seat)
                .or_default()
                .insert(&session.participant);
        }
    }
    for (seat, who) in holders.into_iter().filter(|(_, who)| who.len() > 1) {
        let names: Vec<&str> = who.iter().map(|id| id.as_str()).collect();
        found.push(Finding::problem(
            layout::SESSIONS,
            format!("{} have the same {seat}", names.join(" and ")),
        ));
    }
}
