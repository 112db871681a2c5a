//! Comparing a results folder with a copy of it, file by file.

use crate::store::disk::{Disk, ItemKind, RealDisk};
use crate::store::error::{At as _, StoreError, plain};
use crate::store::head::{Head, HeadFile};
use crate::store::verify::Finding;
use crate::store::{StudyFolder, layout};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use study_base::text::ParticipantId;

/// How often sessions that seem apart are looked at again, and the time between.
const MORE_LOOKS: u32 = 2;
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// A session of a participant, by its number.
type Numbered = (ParticipantId, u32);

impl StudyFolder {
    /// Compares every file with a copy of the study in the folder `copy`, except
    /// `analysis/`, the records of `study doctor`, which are of one machine, and what a session
    /// needs only while it is open. Derived tables that differ are notes.
    ///
    /// # Errors
    /// [`StoreError`] if a folder cannot be listed.
    pub fn verify_against(&self, copy: &Path) -> Result<Vec<Finding>, StoreError> {
        self.verify_against_on(&RealDisk, copy)
    }

    /// The same with a copy on another disk.
    ///
    /// # Errors
    /// As [`StudyFolder::verify_against`].
    pub fn verify_against_on(
        &self,
        disk: &dyn Disk,
        copy: &Path,
    ) -> Result<Vec<Finding>, StoreError> {
        let mut found = Vec::new();
        let sides = [(self.disk.as_ref(), self.path.as_path()), (disk, copy)];
        compare(&sides, "", &mut found)?;
        Ok(found)
    }

    /// The sessions whose last acknowledged record is another one in a copy of the study, such as
    /// the mirror of `study run --mirror`, and those that only one of both has. Only `head.json` is read,
    /// where [`StudyFolder::verify_against`] compares every file. Sessions under way are looked at again,
    /// since their records reach one disk after the other.
    ///
    /// # Errors
    /// [`StoreError`] if the copy is no study, or a folder or a head cannot be read.
    pub fn heads_apart(&self, copy: &Path) -> Result<Vec<(ParticipantId, u32)>, StoreError> {
        let copy = Self::open(copy)?;
        let mut apart = self.apart(&copy)?;
        for _ in 0..MORE_LOOKS {
            if apart.is_empty() {
                break;
            }
            std::thread::sleep(BETWEEN_LOOKS);
            let again = self.apart(&copy)?;
            apart.retain(|session| again.contains(session));
        }
        Ok(apart)
    }

    /// The same at one moment.
    fn apart(&self, copy: &Self) -> Result<Vec<Numbered>, StoreError> {
        let mut heads: BTreeMap<Numbered, [Option<HeadFile>; 2]> = BTreeMap::new();
        for (side, study) in [self, copy].into_iter().enumerate() {
            let disk = study.disk.as_ref();
            for id in study.participant_ids()? {
                for number in study.session_numbers(&layout::participant(&study.path, &id))? {
                    let head = Head::read(disk, &layout::session(&study.path, &id, number))?;
                    heads.entry((id.clone(), number)).or_default()[side] = Some(head);
                }
            }
        }
        let differ = |(session, [here, there]): (Numbered, [Option<HeadFile>; 2])| {
            (here != there).then_some(session)
        };
        Ok(heads.into_iter().filter_map(differ).collect())
    }
}

/// The folder and its copy.
type Sides<'a> = [(&'a dyn Disk, &'a Path); 2];

/// Compares a folder; `place` is its path in both.
fn compare(sides: &Sides<'_>, place: &str, found: &mut Vec<Finding>) -> Result<(), StoreError> {
    let mut kinds: BTreeMap<String, [Option<ItemKind>; 2]> = BTreeMap::new();
    for (side, (disk, root)) in sides.iter().enumerate() {
        let path = root.join(place);
        for item in disk.list(&path).at(&path)? {
            let local = [layout::ANALYSIS, layout::DOCTOR].contains(&item.name.as_str());
            if !layout::is_passing(&item.name) && !local {
                kinds.entry(item.name).or_default()[side] = Some(item.kind);
            }
        }
    }
    for (name, kinds) in kinds {
        let inner = match place {
            "" => name,
            place => format!("{place}/{name}"),
        };
        let what = match kinds {
            [Some(ItemKind::Folder), Some(ItemKind::Folder)] => {
                compare(sides, &inner, found)?;
                continue;
            }
            [Some(ItemKind::File), Some(ItemKind::File)] => match differ(sides, &inner) {
                Some(what) => what,
                None => continue,
            },
            [Some(_), None] => "missing in the copy".to_owned(),
            [None, _] => "only in the copy".to_owned(),
            [Some(here), Some(there)] => {
                format!("{} here, {} in the copy", here.as_str(), there.as_str())
            }
        };
        found.push(Finding {
            is_problem: !layout::TABLES.contains(&inner.as_str()),
            place: inner,
            what,
        });
    }
    Ok(())
}

/// How two files differ.
fn differ([(here, a), (there, b)]: &Sides<'_>, place: &str) -> Option<String> {
    let (here, there) = (here.read(&a.join(place)), there.read(&b.join(place)));
    Some(match (here, there) {
        (Ok(here), Ok(there)) if here == there => return None,
        (Ok(here), Ok(there)) if here.starts_with(&there) => {
            let more = here.len() - there.len();
            format!("the last {more} bytes are missing in the copy")
        }
        (Ok(here), Ok(there)) if there.starts_with(&here) => {
            format!("the copy has {} bytes more", there.len() - here.len())
        }
        (Ok(_), Ok(_)) => "differs from the copy".to_owned(),
        (Err(e), _) => plain(&e),
        (Ok(_), Err(e)) => format!("in the copy: {}", plain(&e)),
    })
}
