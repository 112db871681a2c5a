//! The wall clock of a session: whether its dates and gaps can be relied on.

use super::Finding;
use crate::outcome::Event;
use crate::store::sessions::SessionData;

/// A clock that is set by less than this, as by a time server, is not mentioned, s.
const JUMP_S: f64 = 60.0;

impl SessionData {
    /// By how much the wall clock was set within the session, s, each time: against the
    /// monotonic clock, or back while the program was closed.
    pub fn clock_jumps(&self) -> Vec<f64> {
        let before = std::iter::once(None).chain(self.entries.iter().map(Some));
        let pairs = before.zip(&self.entries);
        let jump = pairs.filter_map(|(before, entry)| match &entry.event {
            Event::ClockStepped { by_s } => Some(*by_s),
            Event::Reopened { .. } => {
                let gap = entry.at.wall - before?.at.wall;
                Some(gap.as_seconds_f64()).filter(|s| *s < 0.0)
            }
            _ => None,
        });
        jump.filter(|by_s| by_s.abs() >= JUMP_S).collect()
    }
}

/// Notes jumps of the clock: the records are whole, but their dates are not right.
pub(super) fn verify_clocks(session: &SessionData, place: &str, found: &mut Vec<Finding>) {
    let jumps = session.clock_jumps();
    if jumps.is_empty() {
        return;
    }
    let by: Vec<String> = jumps.iter().map(|by_s| format!("{by_s:+.0} s")).collect();
    let what = format!(
        "the clock of the computer jumped by {}: dates and gaps are wrong by that, durations are not",
        by.join(", ")
    );
    found.push(Finding::note(place, what));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::fold::History;
    use crate::outcome::{Entry, Moment};
    use chrono::{DateTime, TimeDelta};
    use study_base::text::ParticipantId;

    fn session(events: Vec<(i64, Event)>) -> SessionData {
        let entry = |(seq, (wall_s, event)): (u64, (i64, Event))| Entry {
            seq,
            at: Moment {
                wall: DateTime::UNIX_EPOCH.fixed_offset() + TimeDelta::seconds(wall_s),
                mono_ns: 0,
            },
            event,
        };
        SessionData {
            participant: ParticipantId::new("P01").unwrap(),
            session: 1,
            path: "s".into(),
            seat: None,
            entries: (1..).zip(events).map(entry).collect(),
            history: History::default(),
            damage: Vec::new(),
            tombstone: None,
            claimed: true,
            truncated: false,
            protected: true,
            settled: true,
            records: 0,
            hashes: Vec::new(),
            last_hash: String::new(),
            claim: None,
            last_file: None,
        }
    }

    #[test]
    fn jumps_are_named_and_corrections_of_a_time_server_are_not() {
        let step = |by_s| Event::ClockStepped { by_s };
        let reopened = || Event::Reopened {
            operator: String::new(),
            tool_version: String::new(),
            device_id: String::new(),
            front: None,
            gap_s: 0.0,
            choice: None,
            queue: Vec::new(),
            constraint_broken: false,
        };
        let quiet = session(vec![
            (0, step(3.0)),
            (10, Event::Paused),
            (5000, reopened()),
        ]);
        assert_eq!(quiet.clock_jumps(), [0.0; 0]);
        let mut found = Vec::new();
        verify_clocks(&quiet, "p", &mut found);
        assert_eq!(found, []);
        let events = vec![
            (0, Event::Paused),
            (172_800, step(172_800.0)),
            (172_801, step(-2.5)),
            (-1_728_000_000, step(-1.728e9)),
            (-1_728_000_000 - 7200, reopened()),
        ];
        let jumped = session(events);
        assert_eq!(jumped.clock_jumps(), [172_800.0, -1.728e9, -7200.0]);
        verify_clocks(&jumped, "p", &mut found);
        assert!(!found[0].is_problem);
        assert!(
            found[0].what.contains("+172800 s, -1728000000 s, -7200 s"),
            "{found:?}"
        );
    }
}
