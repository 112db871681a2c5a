//! What the experimenter's desk knows besides the session: who comes next, and the disk.

use crate::cli::overview;
use crate::tui::desk::{Desk, FreeSpace, Language, Visit};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use study_base::sort::SmallSort as _;
use study_plan::protocol::phrases::Words;
use study_plan::protocol::{Protocol, ScaleDirection};
use study_session::session::Roster;
use study_session::store::{Due, Plan, Return, SeatKind, SessionData, comes_again, when};

/// New ids that are offered, one more than is shown: one of them takes part now.
const NEW_IDS: usize = 4;
/// Time between two questions how much of the disk is free.
const EVERY: Duration = Duration::from_secs(10);

/// The desk of a session that begins now. `sessions` are those of the study so far.
pub(super) fn desk(
    sessions: &[SessionData],
    kind: SeatKind,
    plan: &Plan,
    roster: &Roster,
    protocol: &Protocol,
) -> Desk {
    let language = Language::of_environment(|name| std::env::var(name).ok());
    let [overdue, due] = returns(sessions, kind, plan);
    let unfinished = roster.who_is_unfinished().map(ToString::to_string);
    let come = overdue.iter().chain(&due).map(|v| v.participant.clone());
    let new = roster.next_ids().map(|id| id.to_string()).take(NEW_IDS);
    Desk {
        language,
        words: words(language, protocol),
        next: unfinished.into_iter().chain(come).chain(new).collect(),
        overdue,
        due,
        free: FreeSpace::default(),
    }
}

/// The fixed sentences in the experimenter's language, where the study has another one.
fn words(language: Language, protocol: &Protocol) -> Option<Arc<Words>> {
    if language.is_of(protocol.text.lang.as_deref()) {
        return None;
    }
    // A scale has its ends where the participant sees them.
    let direction = match protocol.text.phrases().scales_from_right() {
        true => ScaleDirection::RightToLeft,
        false => ScaleDirection::LeftToRight,
    };
    let words = Words::new(Some(language.tag()), &BTreeMap::new());
    Some(Arc::new(words.with_scales(direction)))
}

/// Whose next session is overdue, and whose is due; those first whose window ends first.
fn returns(sessions: &[SessionData], kind: SeatKind, plan: &Plan) -> [Vec<Visit>; 2] {
    let Some(now) = plan.now else {
        return [Vec::new(), Vec::new()];
    };
    let of_one = sessions.chunk_by(|a, b| a.participant == b.participant);
    let of_kind = |own: &&[SessionData]| {
        let mut seats = own.iter().filter_map(|s| s.seat);
        seats.any(|seat| SeatKind::of(seat) == kind)
    };
    let mut all: Vec<(&SessionData, Return)> = of_one
        .filter(of_kind)
        .filter_map(|own| {
            let own: Vec<&SessionData> = own.iter().collect();
            Some((*own.first()?, comes_again(&own, plan)?))
        })
        .collect();
    all.small_sort_by_key(|(_, again)| again.until.unwrap_or(again.from));
    [Due::Overdue, Due::Now].map(|due| {
        let of_due = all.iter().filter(|(_, again)| again.due(now) == due);
        let visit = |(session, again): &(&SessionData, Return)| Visit {
            participant: session.participant.to_string(),
            what: format!(
                "{} {}",
                again.session,
                when(again.until.unwrap_or(again.from))
            ),
        };
        of_due.map(visit).collect()
    })
}

/// Measures the free space of a folder's disk in a thread of its own, as long as somebody looks at it. A
/// disk that hangs hinders nobody else.
pub(super) fn measure(free: FreeSpace, folder: &Path) {
    let folder: PathBuf = folder.to_owned();
    let measuring = move || {
        while free.is_looked_at() {
            free.set(overview::free_bytes(&folder));
            std::thread::sleep(EVERY);
        }
    };
    // Without the thread the desk does not know it.
    let thread = std::thread::Builder::new().name("free space".to_owned());
    drop(thread.spawn(measuring));
}

#[cfg(test)]
mod tests {
    use super::*;
    use chrono::TimeDelta;
    use study_base::text::PartId;
    use study_plan::protocol::{Seat, SessionPlan};
    use study_session::session::roster::Newcomer;
    use study_session::store::{StudyFolder, participants};

    /// The sessions of the example, as of real participants, and a plan of two sessions at a time after
    /// the last of them ended.
    fn example(hours: i64) -> (Vec<SessionData>, Plan) {
        let study = StudyFolder::open(Path::new("results/turn-signal-example")).unwrap();
        let mut sessions = study.sessions().unwrap();
        sessions.truncate(3);
        for (session, row) in sessions.iter_mut().zip(1..) {
            session.seat = Some(Seat::Row(row));
        }
        let ended = sessions.iter().filter_map(|s| s.history.last_activity);
        let last = ended.map(|at| at.wall).max().unwrap();
        let session = |id: &str| SessionPlan {
            id: PartId::new(id).unwrap(),
            parts: None,
            min_gap_h: 0.0,
            max_gap_h: Some(24.0),
        };
        let plan = Plan {
            sessions: vec![session("one"), session("two")],
            now: Some(last + TimeDelta::hours(hours)),
            ..Plan::default()
        };
        (sessions, plan)
    }

    #[test]
    fn who_comes_again_is_overdue_after_the_longest_gap() {
        let (sessions, plan) = example(1000);
        let [overdue, due] = returns(&sessions, SeatKind::Real, &plan);
        assert_eq!((overdue.len(), due.len()), (3, 0));
        assert_eq!(overdue[0].participant, "SIM001");
        assert!(overdue[0].what.starts_with("two 20"), "{}", overdue[0].what);
        // Nobody of another kind is on this desk.
        assert_eq!(returns(&sessions, SeatKind::Pilot, &plan), [vec![], vec![]]);
        let (sessions, plan) = example(0);
        let [_, due] = returns(&sessions, SeatKind::Real, &plan);
        assert!(due.iter().any(|visit| visit.participant == "SIM003"));
    }

    #[test]
    fn next_is_who_comes_again_and_then_somebody_new() {
        let (sessions, plan) = example(1000);
        let roster = Roster::new(&participants(&sessions), Newcomer::Row(4));
        let path = Path::new("protocols/turn-signal");
        let protocol = study_analysis::load::load(path).unwrap().protocol;
        let desk = desk(&sessions, SeatKind::Real, &plan, &roster, &protocol);
        assert_eq!(desk.next[..3], ["SIM001", "SIM002", "SIM003"]);
        assert_eq!(desk.next[3..], ["SIM004", "SIM005", "SIM006", "SIM007"]);
    }

    #[test]
    fn the_study_keeps_its_own_sentences_where_its_language_is_the_experimenters() {
        let path = Path::new("protocols/turn-signal");
        let mut protocol = study_analysis::load::load(path).unwrap().protocol;
        assert_eq!(words(Language::English, &protocol), None);
        assert!(words(Language::German, &protocol).is_some());
        protocol.text.lang = Some("ar".to_owned());
        // The scale stays where the participant sees it.
        let german = words(Language::German, &protocol).unwrap();
        assert!(german.scales_from_right());
    }
}
