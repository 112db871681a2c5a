//! Tries the disk of the results, with what a session does to save a record.

use super::super::Failure;
use super::system;
use crate::doctor::{Disk, Spread};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use study_session::store::{DiskTrial, SavingTime, StoreError, disk};

/// How long records are saved.
pub(super) const TIME: Duration = Duration::from_secs(3);
/// Not more than so many.
const MOST: usize = 5000;

/// Saves records in a folder until the time is over or `stop` is set, and removes them.
///
/// # Errors
/// [`Failure`] only if another process tries the same folder: what the disk does not do is a
/// result.
pub(super) fn measure(
    disk: Arc<dyn disk::Disk>,
    folder: &Path,
    stop: &AtomicBool,
) -> Result<Disk, Failure> {
    let mut found = Disk {
        folder: folder.display().to_string(),
        file_system: system::file_system(folder),
        free_bytes: disk.free_bytes(folder).ok().flatten(),
        ..Disk::default()
    };
    let mut trial = match DiskTrial::begin(disk, folder) {
        Ok(trial) => trial,
        Err(StoreError::Busy { path }) => {
            let path = path.display();
            return Err(Failure::results(format!(
                "{path}: another `study doctor` is at work there"
            ))
            .hint("wait until it has ended"));
        }
        Err(error) => {
            found.failure = Some(error.to_string());
            return Ok(found);
        }
    };
    let begun = Instant::now();
    let mut times: Vec<SavingTime> = Vec::new();
    while begun.elapsed() < TIME && times.len() < MOST && !stop.load(Ordering::Relaxed) {
        match trial.save() {
            Ok(time) => times.push(time),
            Err(error) => {
                found.failure = Some(error.to_string());
                break;
            }
        }
    }
    let spread = |of: fn(&SavingTime) -> Duration| {
        let times_ms = times.iter().map(|time| 1e3 * of(time).as_secs_f64());
        Spread::of(times_ms.collect())
    };
    found.journal = spread(|time| time.journal);
    found.head = spread(|time| time.head);
    found.record = spread(|time| time.journal + time.head);
    if found.failure.is_none() {
        match trial.broken() {
            Ok(broken) => found.broken = broken,
            Err(error) => found.failure = Some(error.to_string()),
        }
    }
    found.left = trial.end().err().map(|error| error.to_string());
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_session::store::disk::RealDisk;

    #[test]
    fn a_folder_is_tried_and_left_as_it_was() {
        let home = tempfile::tempdir().unwrap();
        let stop = AtomicBool::new(false);
        let found = measure(Arc::new(RealDisk), home.path(), &stop).unwrap();
        assert_eq!((&found.failure, &found.left), (&None, &None));
        let record = found.record.unwrap();
        assert!(
            record.n > 0 && record.largest_ms >= record.median_ms,
            "{record:?}"
        );
        assert!(found.free_bytes.is_some_and(|free| free > 0));
        assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_a_result() {
        let home = tempfile::tempdir().unwrap();
        let stop = AtomicBool::new(false);
        let found = measure(Arc::new(RealDisk), &home.path().join("none"), &stop).unwrap();
        assert!(
            found
                .failure
                .is_some_and(|why| why.contains("no such file"))
        );
        assert_eq!(found.record, None);
    }

    #[test]
    fn a_signal_ends_it_and_nothing_is_left() {
        let home = tempfile::tempdir().unwrap();
        let begun = Instant::now();
        measure(Arc::new(RealDisk), home.path(), &AtomicBool::new(true)).unwrap();
        assert!(begun.elapsed() < TIME);
        assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
    }
}
