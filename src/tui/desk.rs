//! The experimenter's desk: what the terminal shows while the participant has a page of their own.
//!
//! It is blind like every screen of a session: with the same hand at the same times it is the same for every
//! realization. What a device reports while it plays (position, force, strokes, how often the handle turns)
//! depends on what it renders, also when it is drawn without a scale: a detent draws the handle
//! on, friction lets it rest. None of it is here. The strip shows the course of the session in its
//! place: when the participant reads, feels, answers and rests.

mod strip;
mod words;

pub use strip::{CELL_S, Doing, Strip};
pub use words::{Language, Say};

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use study_plan::protocol::phrases::Words;
use study_session::session::Screen;

/// What the desk knows besides the session.
#[derive(Debug, Clone)]
pub struct Desk {
    /// The experimenter's language.
    pub language: Language,
    /// The fixed sentences of a session in this language; `None` if the study has the same one.
    pub words: Option<Arc<Words>>,
    /// Ids of who may come next.
    pub next: Vec<String>,
    /// Whose next session is overdue.
    pub overdue: Vec<Visit>,
    /// Whose next session is due, and until when.
    pub due: Vec<Visit>,
    /// Free space of the disk.
    pub free: FreeSpace,
}

/// Somebody comes again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Visit {
    /// Pseudonym.
    pub participant: String,
    /// Session and time, in no language.
    pub what: String,
}

/// The free bytes of a disk. Another thread measures them, so that a disk that hangs keeps no
/// page from being drawn.
#[derive(Debug, Clone)]
pub struct FreeSpace(Arc<AtomicU64>);

/// Stands for a number that is not known.
const UNKNOWN: u64 = u64::MAX;

impl Default for FreeSpace {
    fn default() -> Self {
        Self(Arc::new(AtomicU64::new(UNKNOWN)))
    }
}

impl FreeSpace {
    /// The bytes; `None` while they are not known.
    pub fn bytes(&self) -> Option<u64> {
        Some(self.0.load(Ordering::Relaxed)).filter(|bytes| *bytes != UNKNOWN)
    }

    /// Sets them.
    pub fn set(&self, bytes: Option<u64>) {
        self.0.store(bytes.unwrap_or(UNKNOWN), Ordering::Relaxed);
    }

    /// Whether anybody else looks at them.
    pub fn is_looked_at(&self) -> bool {
        Arc::strong_count(&self.0) > 1
    }
}

/// Free space below which a disk is called almost full, bytes: room for the telemetry of a few
/// dozen sessions.
const LOW_BYTES: u64 = 1 << 30;

/// Whether a disk with so many free bytes is almost full.
pub fn is_almost_full(free_bytes: u64) -> bool {
    free_bytes < LOW_BYTES
}

/// A size on a disk.
pub fn size(bytes: u64) -> String {
    let (value, unit) = match bytes as f64 {
        bytes if bytes < 1e6 => (bytes / 1e3, "kB"),
        bytes if bytes < 1e9 => (bytes / 1e6, "MB"),
        bytes if bytes < 1e12 => (bytes / 1e9, "GB"),
        bytes => (bytes / 1e12, "TB"),
    };
    match value < 9.95 {
        true => format!("{value:.1} {unit}"),
        false => format!("{value:.0} {unit}"),
    }
}

/// Whether the desk takes the place of a screen: those that the participant reads. What asks the
/// experimenter for something stays as it is.
pub fn covers(screen: &Screen) -> bool {
    match screen {
        Screen::Consent { .. }
        | Screen::Message { .. }
        | Screen::Reference { .. }
        | Screen::Loading { .. }
        | Screen::Playing { .. }
        | Screen::Stopping
        | Screen::Stopped { .. }
        | Screen::Saving
        | Screen::Break { .. } => true,
        Screen::Form {
            to_experimenter, ..
        } => !to_experimenter,
        Screen::Who { .. }
        | Screen::ResumeChoice { .. }
        | Screen::Mount { .. }
        | Screen::DeviceTrouble { .. }
        | Screen::SaveTrouble { .. }
        | Screen::Paused { .. }
        | Screen::End { .. } => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_two_digits_or_more() {
        for (bytes, shown) in [
            (0, "0.0 kB"),
            (9_940, "9.9 kB"),
            (9_960, "10 kB"),
            (123_456_789, "123 MB"),
            (12_300_000_000, "12 GB"),
            (2_000_000_000_000, "2.0 TB"),
        ] {
            assert_eq!(size(bytes), shown);
        }
    }

    #[test]
    fn free_space_is_unknown_until_it_is_measured() {
        let free = FreeSpace::default();
        assert_eq!((free.bytes(), free.is_looked_at()), (None, false));
        let measured = free.clone();
        measured.set(Some(5));
        assert_eq!((free.bytes(), free.is_looked_at()), (Some(5), true));
        measured.set(None);
        assert_eq!(free.bytes(), None);
    }
}
