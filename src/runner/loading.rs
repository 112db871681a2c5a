//! When a session is told that a table is loaded.

use std::time::Duration;

/// Every load takes a multiple of this time, so that its duration tells nothing about the
/// realization: neither the size of its table nor how the handle came to rest after the
/// one before.
const LOAD_SLOT: Duration = Duration::from_millis(500);
/// One that takes longer is told at once: the session gives up at the end of its slot.
const LONGEST_LOAD: Duration = Duration::from_millis(4500);

/// The first multiple of [`LOAD_SLOT`] after `began` that is not before `now`.
pub(super) fn end_of_slot(began: Duration, now: Duration) -> Duration {
    let took = now.saturating_sub(began);
    if took > LONGEST_LOAD {
        return now;
    }
    let slots = took.as_nanos().div_ceil(LOAD_SLOT.as_nanos());
    began + LOAD_SLOT * u32::try_from(slots.max(1)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_ends_with_its_slot_and_before_the_session_gives_up() {
        let ends =
            |took: u64| end_of_slot(Duration::from_secs(7), Duration::from_millis(7000 + took));
        let slots = [
            (0, 500),
            (1, 500),
            (500, 500),
            (501, 1000),
            (4499, 4500),
            (4501, 4501),
        ];
        for (took, told) in slots {
            assert_eq!(ends(took), Duration::from_millis(7000 + told), "{took} ms");
        }
    }
}
