//! Who has taken part, for the first page: what a typed id is, and whose session goes on.

use chrono::{DateTime, FixedOffset};
use std::cmp::Reverse;
use std::ops::RangeInclusive;
use study_base::sort::SmallSort as _;
use study_plan::protocol::Protocol;
use study_session::outcome::fold::History;
use study_session::page::ago;
use study_session::session::Roster;
use study_session::session::roster::Newcomer;
use study_session::store::{Plan, SeatKind, SessionData, next_row, next_session, participants};

/// Whom this rig takes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rig<'a> {
    /// Kind of its participants.
    pub(super) kind: SeatKind,
    /// Its rows; all if `None`.
    pub(super) rows: Option<&'a RangeInclusive<u32>>,
    /// What the protocol says of groups and repeated sessions, now.
    pub(super) plan: &'a Plan,
}

impl Rig<'_> {
    /// Whether a session that has begun can be continued here.
    fn takes(&self, session: &SessionData) -> bool {
        let Some(seat) = session.seat else {
            return false;
        };
        let of_rows = match (self.rows, seat.row()) {
            (Some(rows), Some(row)) => rows.contains(&row),
            _ => true,
        };
        let start = session.history.start();
        let group = start.and_then(|start| start.assigned.group.as_ref());
        let of_group = match (&self.plan.given, group) {
            (Some(given), Some(had)) => given == had,
            _ => true,
        };
        SeatKind::of(seat) == self.kind && of_rows && of_group
    }
}

/// The participants so far, and what a new one becomes.
pub(super) fn roster(sessions: &[SessionData], rig: &Rig<'_>) -> Roster {
    let newcomer = match rig.kind {
        SeatKind::Real => next_row(rig.rows, sessions).map_or(Newcomer::NoRow, Newcomer::Row),
        SeatKind::Pilot => Newcomer::Pilot,
        SeatKind::Simulated => Newcomer::Simulated,
    };
    let plan = rig.plan;
    let mut roster = Roster::new(&participants(sessions), newcomer);
    if let Some(search) = plan
        .confirms
        .as_ref()
        .filter(|_| rig.kind != SeatKind::Simulated)
    {
        roster.confirms(search.clone());
    }
    let of_one = sessions.chunk_by(|a, b| a.participant == b.participant);
    for own in of_one.filter(|_| !plan.sessions.is_empty()) {
        let own: Vec<&SessionData> = own.iter().collect();
        let next = next_session(&own, plan);
        if let Some(words) = next.of_finished(plan.sessions.len()) {
            roster.comes_again(&own[0].participant, words);
        }
    }
    roster
}

/// The unfinished session with the newest event that this rig can continue. It was under way today,
/// or at most `within_h` hours ago, and is open in no program.
pub(super) fn interrupted<'a>(
    sessions: &'a [SessionData],
    rig: &Rig<'_>,
    within_h: f64,
    is_open: impl Fn(&SessionData) -> bool,
) -> Option<&'a SessionData> {
    let now = rig.plan.now?;
    let of_one = sessions.chunk_by(|a, b| a.participant == b.participant);
    let mut left: Vec<(DateTime<FixedOffset>, &SessionData)> = of_one
        .filter_map(|own| own.last())
        .filter(|s| s.is_unfinished() && s.history.start().is_some() && rig.takes(s))
        .filter_map(|s| Some((s.history.last_activity?.wall, s)))
        .filter(|(last, _)| is_recent(*last, now, within_h))
        .collect();
    left.small_sort_by_key(|(last, _)| Reverse(*last));
    let mut newest_first = left.into_iter().map(|(_, session)| session);
    newest_first.find(|session| !is_open(session))
}

/// Whether something happened on the day of `now`, or at most so long before.
fn is_recent(last: DateTime<FixedOffset>, now: DateTime<FixedOffset>, within_h: f64) -> bool {
    let gap_h = (now - last).as_seconds_f64() / 3600.0;
    let day = last.with_timezone(now.offset()).date_naive();
    gap_h <= within_h || day == now.date_naive()
}

/// When an unfinished session was left, such as "at 14:05, 20 minutes ago".
pub(super) fn left(history: &History, now: DateTime<FixedOffset>) -> String {
    let Some(last) = history.last_activity else {
        return "some time ago".to_owned();
    };
    let last = last.wall.with_timezone(now.offset());
    let gap_h = (now - last).as_seconds_f64() / 3600.0;
    format!("at {}, {} ago", last.format("%H:%M"), ago(gap_h))
}

/// Where an unfinished session goes on, such as "with trial 12 of 40".
pub(super) fn goes_on(history: &History, protocol: &Protocol) -> String {
    let trials = (history.closed(false), history.planned_total(false));
    let start = history.start();
    let adaptive = start.is_some_and(|start| protocol.of(&start.assigned).is_adaptive());
    in_words(trials, history.any_attempt(true), adaptive)
}

/// The same of so many trials of all, the next of which may have `begun`; that of the first one
/// means that the practice is over. How many all are is not said where it depends on the answers.
fn in_words((done, all): (u32, u32), begun: bool, adaptive: bool) -> String {
    if all == 0 {
        return "where it stopped".to_owned();
    }
    if done >= all {
        return "after its last trial".to_owned();
    }
    let word = if begun { "with" } else { "before" };
    let of_all = match adaptive {
        true => String::new(),
        false => format!(" of {all}"),
    };
    format!("{word} trial {}{of_all}", done + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use study_analysis::load;
    use study_plan::protocol::Seat;
    use study_session::outcome::{Moment, State};
    use study_session::store::StudyFolder;

    fn example() -> Vec<SessionData> {
        let study = StudyFolder::open(Path::new("results/turn-signal-example")).unwrap();
        study.sessions().unwrap()
    }

    fn time(text: &str) -> DateTime<FixedOffset> {
        DateTime::parse_from_rfc3339(text).unwrap()
    }

    #[test]
    fn the_first_screen_knows_everybody_and_the_next_row_of_this_rig() {
        let mut sessions = example();
        sessions[0].seat = Some(Seat::Row(1));
        sessions[1].history.standing.state = State::Unfinished;
        sessions[2].history.standing.state = State::DroppedOut;
        let of = |kind, rows: Option<RangeInclusive<u32>>| {
            let rig = Rig {
                kind,
                rows: rows.as_ref(),
                plan: &Plan::default(),
            };
            roster(&sessions, &rig)
        };
        let all = of(SeatKind::Real, None);
        assert_eq!(all.who("nobody-yet").unwrap(), "new, row 2");
        assert_eq!(
            of(SeatKind::Real, Some(40..=50)).who("N1").unwrap(),
            "new, row 40"
        );
        assert_eq!(
            of(SeatKind::Real, Some(1..=1)).who("N1").unwrap(),
            "new, but no row is free"
        );
        assert_eq!(of(SeatKind::Pilot, None).who("N1").unwrap(), "new, a pilot");
        for (id, who) in [
            ("SIM001", "finished"),
            ("SIM002", "unfinished, 15 of 15 trials saved"),
            (" SIM003 ", "dropped-out"),
            ("sim003", "too similar to SIM003"),
        ] {
            assert_eq!(all.who(id).unwrap(), who);
        }
        assert_eq!(all.who("../x"), None);
    }

    /// Four unfinished sessions of rows 1 to 4.
    fn unfinished() -> Vec<SessionData> {
        let mut sessions = example();
        sessions.truncate(4);
        let last = [
            "2026-03-02T09:00:00+01:00",
            "2026-03-02T10:00:00+01:00",
            "2026-03-01T20:00:00+01:00",
            "2026-03-02T08:00:00+01:00",
        ];
        for ((session, last), row) in sessions.iter_mut().zip(last).zip(1..) {
            session.seat = Some(Seat::Row(row));
            session.history.standing.state = State::Unfinished;
            let wall = time(last);
            session.history.last_activity = Some(Moment { wall, mono_ns: 0 });
        }
        sessions
    }

    /// The participant whose session goes on, within four hours, unless `open` has it.
    fn first(
        sessions: &[SessionData],
        (kind, rows): (SeatKind, Option<RangeInclusive<u32>>),
        now: &str,
        open: &str,
    ) -> Option<String> {
        let plan = Plan {
            now: Some(time(now)),
            ..Plan::default()
        };
        let rig = Rig {
            kind,
            rows: rows.as_ref(),
            plan: &plan,
        };
        let is_open = |s: &SessionData| s.participant.as_str() == open;
        let found = interrupted(sessions, &rig, 4.0, is_open);
        found.map(|s| s.participant.to_string())
    }

    #[test]
    fn the_newest_unfinished_session_of_today_and_of_this_rig_goes_on() {
        const NOON: &str = "2026-03-02T12:00:00+01:00";
        let real = |rows| (SeatKind::Real, rows);
        let mut sessions = unfinished();
        let newest = first(&sessions, real(None), NOON, "");
        assert_eq!(newest.as_deref(), Some("SIM002"));
        // Another rig has it open, or has its row.
        let other = first(&sessions, real(None), NOON, "SIM002");
        assert_eq!(other.as_deref(), Some("SIM001"));
        let own = first(&sessions, real(Some(3..=9)), NOON, "");
        assert_eq!(own.as_deref(), Some("SIM004"));
        // A pilot is not continued as a real participant, nor the other way round.
        assert_eq!(first(&sessions, (SeatKind::Pilot, None), NOON, ""), None);
        sessions[1].seat = Some(Seat::Pilot(1));
        let pilot = first(&sessions, (SeatKind::Pilot, None), NOON, "");
        assert_eq!(pilot.as_deref(), Some("SIM002"));
        // Who has finished does not go on.
        sessions[0].history.standing.state = State::Done;
        let next = first(&sessions, real(None), NOON, "");
        assert_eq!(next.as_deref(), Some("SIM004"));
    }

    #[test]
    fn a_session_of_another_day_is_not_proposed_unless_it_is_resumed_without_a_question() {
        let sessions = unfinished();
        let rows = || (SeatKind::Real, Some(3..=3));
        for (now, goes_on) in [
            ("2026-03-01T23:59:00+01:00", true),
            ("2026-03-02T00:00:00+01:00", true),
            ("2026-03-02T00:01:00+01:00", false),
            ("2026-03-02T12:00:00+01:00", false),
        ] {
            let found = first(&sessions, rows(), now, "");
            assert_eq!(found.is_some(), goes_on, "{now}");
        }
    }

    #[test]
    fn it_is_said_when_a_session_was_left() {
        let sessions = unfinished();
        let of = |now: &str| left(&sessions[1].history, time(now));
        for (now, words) in [
            ("2026-03-02T10:20:00+01:00", "at 10:00, 20 minutes ago"),
            // In the time of the rig.
            ("2026-03-02T12:00:00+02:00", "at 11:00, 1 hour ago"),
            // The clock was set back.
            ("2026-03-02T09:00:00+01:00", "at 10:00, some time ago"),
        ] {
            assert_eq!(of(now), words);
        }
        assert_eq!(
            left(&History::default(), time("2026-03-02T12:00:00+02:00")),
            "some time ago"
        );
    }

    #[test]
    fn it_is_said_where_a_session_goes_on() {
        let sessions = example();
        let entries = &sessions[0].entries;
        let protocol = load::load(Path::new("protocols/turn-signal"))
            .unwrap()
            .protocol;
        // The history when so many trials had ended.
        let after = |trials: u32| {
            let mut lengths = 1..=entries.len();
            let length = lengths.find(|n| History::of(&entries[..*n]).closed(false) == trials);
            History::of(&entries[..length.unwrap()])
        };
        for (trials, words) in [
            (0, "before trial 1 of 15"),
            (11, "with trial 12 of 15"),
            (15, "after its last trial"),
        ] {
            assert_eq!(goes_on(&after(trials), &protocol), words);
        }
        assert_eq!(goes_on(&History::default(), &protocol), "where it stopped");
        // How many there are may depend on the answers.
        assert_eq!(in_words((11, 40), true, true), "with trial 12");
    }
}
