//! Comparing a results folder with a copy of it, file by file.

use crate::store::disk::{Disk, ItemKind, RealDisk};
use crate::store::error::{At as _, StoreError, plain};
use crate::store::verify::Finding;
use crate::store::{StudyFolder, layout};
use std::collections::BTreeMap;
use std::path::Path;

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
