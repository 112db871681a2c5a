//! Records of `study doctor` in the folder of a study: what the machine of a session could do.

use super::error::StoreError;
use super::sessions::check_kind;
use super::{StudyFolder, atomic, layout};
use std::path::PathBuf;

impl StudyFolder {
    /// Saves a record under a file name; returns its path when it is on the medium. No table and
    /// no analysis reads it.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be written, or something else is in the place of the folder.
    pub fn save_doctor(&self, name: &str, record: &[u8]) -> Result<PathBuf, StoreError> {
        let _lock = self.lock()?;
        // A link would lead out of the results folder.
        check_kind(self.disk.as_ref(), &self.path, |name| {
            name == layout::DOCTOR
        })?;
        let folder = self.path.join(layout::DOCTOR);
        atomic::folder(self.disk.as_ref(), &folder)?;
        let path = folder.join(name);
        atomic::replace(self.disk.as_ref(), &path, record)?;
        Ok(path)
    }
}
