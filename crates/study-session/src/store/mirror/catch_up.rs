//! Bringing a results folder and its mirror to the same state.
//!
//! Journals are only appended to, so of two copies of a session one contains every
//! record of the other; its files are copied. Two copies that both have records of
//! their own are not touched.

use super::Side;
use crate::store::disk::Disk;
use crate::store::error::{At as _, StoreError};
use crate::store::head::{Head, HeadFile};
use crate::store::manifest::Manifest;
use crate::store::replay::{Replay, replay};
use crate::store::{atomic, journal, layout, lock_study, make_folders, remove_all};
use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::PathBuf;
use study_base::hex::sha256;
use study_base::text::ParticipantId;

/// A folder on both sides: first in the results, then in the mirror.
#[derive(Clone)]
struct Pair<'a> {
    sides: [&'a Side; 2],
    /// Path in both.
    path: PathBuf,
}

/// Copies between both sides of a study until they agree; returns in sentences what was
/// copied. A session that is open in another process is left to that process.
///
/// # Errors
/// [`StoreError::MirrorDiffers`] if neither side contains the other; or the disk's.
pub(in crate::store) fn catch_up(
    results: &Side,
    mirror: &Side,
    study: &str,
) -> Result<Vec<String>, StoreError> {
    let study = Pair {
        sides: [results, mirror],
        path: study.into(),
    };
    if study.names()?.is_empty() {
        return Ok(Vec::new());
    }
    study.make()?;
    let mut locks = Vec::new();
    for side in [0, 1] {
        locks.push(lock_study(study.disk(side), &study.at(side))?);
    }
    let mut notices = Vec::new();
    study.manifest(&mut notices)?;
    study.longer(layout::REVEALS)?;
    let sessions = study.inner(layout::SESSIONS);
    sessions.corrected_ids(&mut notices)?;
    for id in sessions.names()? {
        sessions.inner(&id).participant(&mut notices)?;
    }
    for table in layout::TABLES {
        study.copy_all(0, table)?;
    }
    Ok(notices)
}

impl Pair<'_> {
    fn inner(&self, name: &str) -> Self {
        Self {
            sides: self.sides,
            path: self.path.join(name),
        }
    }

    fn disk(&self, side: usize) -> &dyn Disk {
        self.sides[side].disk.as_ref()
    }

    fn at(&self, side: usize) -> PathBuf {
        self.sides[side].root.join(&self.path)
    }

    /// The names in this folder on a side; none if there is no such folder.
    fn names_of(&self, side: usize) -> Result<BTreeSet<String>, StoreError> {
        let path = self.at(side);
        let items = match self.disk(side).list(&path) {
            Err(e) if e.kind() == ErrorKind::NotFound => Vec::new(),
            listed => listed.at(&path)?,
        };
        let names = items.into_iter().map(|item| item.name);
        Ok(names.filter(|name| !layout::is_passing(name)).collect())
    }

    fn names(&self) -> Result<BTreeSet<String>, StoreError> {
        Ok(&self.names_of(0)? | &self.names_of(1)?)
    }

    /// Creates this folder where it does not exist.
    fn make(&self) -> Result<(), StoreError> {
        for side in [0, 1] {
            make_folders(self.disk(side), &self.at(side))?;
        }
        Ok(())
    }

    fn read(&self, side: usize, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
        let path = self.at(side).join(name);
        match self.disk(side).read(&path) {
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            read => read.at(&path).map(Some),
        }
    }

    /// Copies a file from one side to the other unless it is the same there; returns
    /// whether it was copied.
    fn copy(&self, from: usize, name: &str) -> Result<bool, StoreError> {
        let Some(bytes) = self.read(from, name)? else {
            return Ok(false);
        };
        let to = 1 - from;
        if self.read(to, name)?.is_some_and(|old| old == bytes) {
            return Ok(false);
        }
        self.put(to, name, &bytes)?;
        Ok(true)
    }

    /// Writes a file on a side.
    fn put(&self, to: usize, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        self.make()?;
        atomic::replace(self.disk(to), &self.at(to).join(name), bytes)
    }

    /// Copies a file from the side that leads or, if only the other has it, from there;
    /// returns whether it was copied.
    fn copy_all(&self, lead: usize, name: &str) -> Result<bool, StoreError> {
        match self.read(lead, name)? {
            Some(_) => self.copy(lead, name),
            None => self.copy(1 - lead, name),
        }
    }

    /// As [`Self::copy_all`], also where the file reads the same on both sides: after a sync that
    /// failed, what is read may not be on the medium.
    fn write_again(&self, lead: usize, name: &str) -> Result<bool, StoreError> {
        match self.read(lead, name)? {
            Some(bytes) => self.put(1 - lead, name, &bytes).map(|()| true),
            None => self.copy(1 - lead, name),
        }
    }

    /// Removes a file on both sides; returns whether there was one.
    fn remove(&self, name: &str) -> Result<bool, StoreError> {
        let mut removed = false;
        for side in [0, 1] {
            let path = self.at(side).join(name);
            match self.disk(side).remove_file(&path) {
                Err(e) if e.kind() == ErrorKind::NotFound => continue,
                gone => gone.at(&path)?,
            }
            self.disk(side).sync_folder(&self.at(side)).at(&path)?;
            removed = true;
        }
        Ok(removed)
    }

    fn differs(&self) -> StoreError {
        StoreError::MirrorDiffers {
            results: self.at(0),
            mirror: self.at(1),
        }
    }

    /// Copies a file that is only appended to from where it is longer.
    fn longer(&self, name: &str) -> Result<(), StoreError> {
        let (results, mirror) = (self.read(0, name)?, self.read(1, name)?);
        let (results, mirror) = (results.unwrap_or_default(), mirror.unwrap_or_default());
        let lead = match (results.starts_with(&mirror), mirror.starts_with(&results)) {
            (true, _) => 0,
            (false, true) => 1,
            (false, false) => return Err(self.inner(name).differs()),
        };
        self.copy(lead, name).map(drop)
    }

    /// study.json and the frozen protocol.
    fn manifest(&self, notices: &mut Vec<String>) -> Result<(), StoreError> {
        let read = |side: usize| Manifest::read_intact(self.disk(side), &self.at(side)).ok();
        let (lead, manifest) = match (read(0), read(1)) {
            (Some(results), Some(mirror)) if results.continues(&mirror) => (0, results),
            (Some(results), Some(mirror)) if mirror.continues(&results) => (1, mirror),
            (Some(_), Some(_)) => return Err(self.inner(layout::MANIFEST).differs()),
            (Some(results), None) => (0, results),
            (None, Some(mirror)) => (1, mirror),
            // Opening the study says what is wrong.
            (None, None) => return Ok(()),
        };
        for version in &manifest.versions {
            let number = version.version.to_string();
            for (name, hash) in &version.files {
                let mut folder = self.inner(layout::PROTOCOLS).inner(&number);
                let name = match name.rsplit_once('/') {
                    Some((inner, name)) => {
                        folder = folder.inner(inner);
                        name
                    }
                    None => name,
                };
                for side in [0, 1] {
                    let frozen = folder.read(side, name)?;
                    if frozen.is_some_and(|bytes| sha256(&bytes) == *hash) {
                        folder.copy(side, name)?;
                        break;
                    }
                }
            }
        }
        if self.copy(lead, layout::MANIFEST)? {
            notices.push(updated(lead, layout::MANIFEST));
        }
        Ok(())
    }

    /// Gives a folder the new name that it has on the other side, where the id of its
    /// participant was corrected without this one.
    fn corrected_ids(&self, notices: &mut Vec<String>) -> Result<(), StoreError> {
        for side in [0, 1] {
            let behind = 1 - side;
            let others = self.names_of(behind)?;
            for id in self.names_of(side)?.difference(&others) {
                let new = self.inner(id);
                for number in new
                    .names_of(side)?
                    .iter()
                    .filter(|n| layout::number(n).is_some())
                {
                    let now = new.inner(number).replay(side)?;
                    let was = |former: &&ParticipantId| {
                        let old = self.inner(former.as_str()).inner(number).replay(behind);
                        let is_same = |old: &Replay| {
                            old.records > 0 && old.hashes.iter().all(|h| now.hashes.contains(h))
                        };
                        old.is_ok_and(|old| is_same(&old))
                    };
                    let Some(former) = now.history.former_ids.iter().rev().find(was) else {
                        continue;
                    };
                    let (disk, folder) = (self.disk(behind), self.at(behind));
                    let from = folder.join(former.as_str());
                    disk.rename(&from, &folder.join(id)).at(&from)?;
                    disk.sync_folder(&folder).at(&folder)?;
                    notices.push(updated(side, &format!("{former} is {id}")));
                    break;
                }
            }
        }
        Ok(())
    }

    /// A participant's folder: an erasure, or sessions.
    fn participant(&self, notices: &mut Vec<String>) -> Result<(), StoreError> {
        let mut erased = false;
        for side in [0, 1] {
            if self.read(side, layout::TOMBSTONE)?.is_none() {
                continue;
            }
            erased = true;
            self.copy(side, layout::TOMBSTONE)?;
            let other = 1 - side;
            for number in self.names_of(other)? {
                if layout::number(&number).is_some() {
                    remove_all(self.disk(other), &self.at(other).join(number))?;
                    let what = format!("{} erased", self.path.display());
                    notices.push(updated(side, &what));
                }
            }
        }
        let sessions = self.names()?.into_iter();
        for number in sessions.filter(|n| !erased && layout::number(n).is_some()) {
            self.inner(&number).session(notices)?;
        }
        Ok(())
    }

    fn session(&self, notices: &mut Vec<String>) -> Result<(), StoreError> {
        self.make()?;
        let mut locks = Vec::new();
        for side in [0, 1] {
            let path = self.at(side);
            match self.disk(side).lock(&path).at(&path)? {
                Some(lock) => locks.push(lock),
                None => return Ok(()),
            }
        }
        let ((results, results_head), (mirror, mirror_head)) = (self.journal(0)?, self.journal(1)?);
        let contains = |a: &Replay, b: &Replay| b.hashes.iter().all(|h| a.hashes.contains(h));
        let lead = match (contains(&results, &mirror), contains(&mirror, &results)) {
            (true, true) => {
                let last = |head: &HeadFile| Reverse(head.head().map(|head| head.seq));
                let results = (results.damage.len(), last(&results_head));
                usize::from((mirror.damage.len(), last(&mirror_head)) < results)
            }
            (true, false) => 0,
            (false, true) => 1,
            (false, false) => return Err(self.differs()),
        };
        let decided = [&results, &mirror][lead].history.consent.as_ref();
        let refused = decided.is_some_and(|decided| !decided.accepted);
        // One side has not acknowledged what the other one has.
        let in_doubt = results_head != mirror_head;
        let mut files = 0;
        for folder in [self.clone(), self.inner(layout::TELEMETRY)] {
            for name in folder.names()? {
                // A copy from before a crash, whose participant then refused.
                if refused && name == layout::CONSENT {
                    files += usize::from(folder.remove(&name)?);
                } else if in_doubt && layout::segment_number(&name).is_some() {
                    files += usize::from(folder.write_again(lead, &name)?);
                } else if ![layout::TELEMETRY, layout::HEAD].contains(&name.as_str()) {
                    files += usize::from(folder.copy_all(lead, &name)?);
                }
            }
        }
        // What it acknowledges is there now, also if this process dies before.
        files += usize::from(self.copy_all(lead, layout::HEAD)?);
        if files > 0 {
            notices.push(updated(lead, &self.path.display().to_string()));
        }
        Ok(())
    }

    fn replay(&self, side: usize) -> Result<Replay, StoreError> {
        self.journal(side).map(|(replay, _)| replay)
    }

    /// The journal of a session, and what it says of its last record.
    fn journal(&self, side: usize) -> Result<(Replay, HeadFile), StoreError> {
        let path = self.at(side);
        let head = Head::read(self.disk(side), &path)?;
        let replay = replay(&journal::segments(self.disk(side), &path)?, &head);
        Ok((replay, head))
    }
}

/// "the mirror was behind the results folder; updated: sessions/P01/1".
fn updated(lead: usize, what: &str) -> String {
    let names = ["the results folder", "the mirror"];
    format!(
        "{} was behind {}; updated: {what}",
        names[1 - lead],
        names[lead]
    )
}
