//! The log of orders shown during a study: one JSON object a line, on disk before
//! the order is shown.

use super::error::{At as _, StoreError};
use super::{StudyFolder, layout};
use crate::outcome::Moment;
use std::ops::RangeInclusive;

impl StudyFolder {
    /// Logs that the orders of these rows are shown, with a reason.
    ///
    /// # Errors
    /// [`StoreError`] if the log cannot be written; the orders must not be shown then.
    pub fn log_reveal(
        &self,
        rows: &RangeInclusive<u32>,
        reason: &str,
        at: Moment,
    ) -> Result<(), StoreError> {
        let _lock = self.lock()?;
        let path = self.path.join(layout::REVEALS);
        let known = self.disk.list(&self.path).at(&self.path)?;
        let is_new = known.iter().all(|item| item.name != layout::REVEALS);
        let mut file = if is_new {
            self.disk.create(&path).at(&path)?
        } else {
            self.disk.open(&path).at(&path)?
        };
        let line = serde_json::json!({
            "at": at.wall,
            "rows": [rows.start(), rows.end()],
            "reason": reason,
        });
        file.write_all(format!("{line}\n").as_bytes()).at(&path)?;
        file.sync().at(&path)?;
        if is_new {
            self.disk.sync_folder(&self.path).at(&self.path)?;
        }
        Ok(())
    }
}
