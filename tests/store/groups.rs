//! Groups and repeated sessions: who comes again when, in which group and on which row.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::world::*;
use chrono::{DateTime, FixedOffset};
use std::path::Path;
use study_base::text::{ModelId, PartId, ParticipantId};
use study_plan::protocol::{Assign, Confirms, GroupRules, Groups, Seat, SessionPlan};
use study_session::store::{
    ClaimRequest, Next, Plan, SeatKind, StoreError, StudyFolder, next_session,
};

fn id(text: &str) -> PartId {
    PartId::new(text).unwrap()
}

/// Two groups, and two sessions with a gap from 20 to 48 h.
fn plan(assign: Assign, hours: f64) -> Plan {
    let group = |name: &str| GroupRules {
        id: id(name),
        share: 1,
        parts: None,
        models: None,
    };
    let session = |name: &str| SessionPlan {
        id: id(name),
        parts: None,
        min_gap_h: 20.0,
        max_gap_h: Some(48.0),
    };
    Plan {
        seed: 7,
        groups: Some(Groups {
            assign,
            list: vec![group("novices"), group("experts")],
        }),
        sessions: vec![session("one"), session("two")],
        confirms: None,
        given: None,
        now: Some(after(hours)),
    }
}

/// So many hours after ten o'clock, when all sessions of these tests end.
fn after(hours: f64) -> DateTime<FixedOffset> {
    at(0).wall + chrono::TimeDelta::milliseconds((hours * 3.6e6) as i64)
}

fn open(results: &Path) -> StudyFolder {
    StudyFolder::open_or_create(results, &Kept::new().frozen(), at(0)).unwrap()
}

/// Runs a whole session.
fn run(study: &StudyFolder, request: &ClaimRequest) -> Seat {
    let mut claimed = study.claim(request).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    let all = session(request.participant.as_str(), claimed.session, claimed.seat);
    for (event, n) in all.iter().zip(0..).skip(claimed.entries.len()) {
        journal.append(at(n), event).unwrap();
    }
    telemetry(claimed.folder.path(), &all);
    claimed.seat
}

fn request(who: &str, plan: Plan) -> ClaimRequest {
    ClaimRequest { plan, ..real(who) }
}

#[test]
fn the_next_session_has_the_same_row_and_group_and_comes_after_the_gap() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let by_row = |hours| plan(Assign::Row, hours);
    assert_eq!(run(&study, &request("P01", by_row(0.0))), Seat::Row(1));
    assert_eq!(run(&study, &request("P02", by_row(0.0))), Seat::Row(2));
    let early = study.claim(&request("P01", by_row(19.9)));
    let Err(StoreError::TooEarly { session, from, .. }) = &early else {
        panic!("{early:?}");
    };
    assert_eq!(*session, id("two"));
    // The last activity is some seconds after ten.
    assert!((*from - after(20.0)).num_minutes().abs() < 30, "{from}");
    assert!(early_is_kind(
        &study.claim(&request("P01", by_row(19.0))).unwrap_err()
    ));
    // Nothing was begun.
    assert_eq!(study.sessions().unwrap().len(), 2);

    let mut groups = Vec::new();
    for (who, row) in [("P01", 1), ("P02", 2)] {
        let again = study.claim(&request(who, by_row(30.0))).unwrap();
        assert_eq!((again.session, again.seat), (2, Seat::Row(row)));
        assert_eq!(again.assigned.session_id, Some(id("two")));
        assert!((again.assigned.gap_h.unwrap() - 30.0).abs() < 0.5);
        assert_eq!(again.notices, Vec::<String>::new());
        groups.push(again.assigned.group.unwrap());
    }
    assert_ne!(groups[0], groups[1], "a block of two rows has both groups");
    // A new participant takes the next row, not one of theirs.
    let new = study.claim(&request("P03", by_row(30.0))).unwrap();
    assert_eq!(new.seat, Seat::Row(3));
    assert_eq!(new.assigned.session_id, Some(id("one")));
}

/// Who took part in a search does not confirm it, whatever the case of the id; simulated participants are nobody.
#[test]
fn searchers_do_not_confirm_their_search() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let plan = Plan {
        confirms: Some(Confirms {
            study: "s".to_owned(),
            part: id("better"),
            pairs_sha256: "0".repeat(64),
            best: ModelId::new("switch.7").unwrap(),
            searchers: vec![ParticipantId::new("P01").unwrap()],
            pilot: false,
            simulated: false,
        }),
        ..Plan::default()
    };
    for who in ["P01", "p01"] {
        for kind in [SeatKind::Real, SeatKind::Pilot] {
            let asked = ClaimRequest {
                kind,
                ..request(who, plan.clone())
            };
            let error = study.claim(&asked).unwrap_err();
            assert!(matches!(error, StoreError::Searcher { .. }), "{error}");
            assert!(error.is_request() && error.hint().is_some());
            assert!(error.to_string().contains("took part in the search `s`"));
        }
    }
    // Nothing was begun.
    assert_eq!(study.sessions().unwrap().len(), 0);
    assert_eq!(run(&study, &request("P02", plan.clone())), Seat::Row(1));
    let simulated = ClaimRequest {
        kind: SeatKind::Simulated,
        ..request("P01", plan)
    };
    assert!(study.claim(&simulated).is_ok());
}

fn early_is_kind(error: &StoreError) -> bool {
    let text = error.to_string();
    text.contains("session two is planned from 2007-03-23") && error.hint().is_some()
}

#[test]
fn a_late_session_is_noted_and_after_the_last_one_nothing_comes() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let by_row = |hours| plan(Assign::Row, hours);
    run(&study, &request("P01", by_row(0.0)));
    let sessions = study.sessions().unwrap();
    let own: Vec<_> = sessions.iter().collect();
    let next = next_session(&own, &by_row(72.0));
    assert!(matches!(next, Next::Late { .. }), "{next:?}");
    assert!(
        next.of_finished(2).unwrap().contains("48 h at most")
            || next.of_finished(2).unwrap().contains("of 48 at most")
    );
    let late = study.claim(&request("P01", by_row(72.0))).unwrap();
    assert!(late.notices[0].contains("session two comes 72 h after the one before"));
    drop(late);
    assert_eq!(run(&study, &request("P01", by_row(72.0))), Seat::Row(1));
    let over = study.claim(&request("P01", by_row(300.0)));
    assert!(matches!(over, Err(StoreError::Finished { .. })), "{over:?}");
}

#[test]
fn a_group_that_is_given_is_needed_once_and_stays() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let given = |group: Option<&str>| Plan {
        given: group.map(id),
        ..plan(Assign::Given, 30.0)
    };
    let none = study.claim(&request("P01", given(None))).unwrap_err();
    assert!(none.to_string().contains("novices, experts"), "{none}");
    let unknown = study.claim(&request("P01", given(Some("others"))));
    assert!(
        matches!(unknown, Err(StoreError::Group { .. })),
        "{unknown:?}"
    );
    assert!(study.sessions().unwrap().is_empty(), "nothing was begun");
    let first = study
        .claim(&request("P01", given(Some("experts"))))
        .unwrap();
    assert_eq!(first.assigned.group, Some(id("experts")));
    drop(first);
    // By row nobody is given a group.
    let by_row = Plan {
        given: Some(id("experts")),
        ..plan(Assign::Row, 0.0)
    };
    let refused = study.claim(&request("P02", by_row)).unwrap_err();
    assert!(
        refused.to_string().contains("follow from the row"),
        "{refused}"
    );
}

#[test]
fn a_pilot_need_not_wait_and_a_study_without_sessions_is_as_before() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let pilot = ClaimRequest {
        kind: SeatKind::Pilot,
        ..request("T1", plan(Assign::Row, 1.0))
    };
    run(&study, &pilot);
    let again = study.claim(&pilot).unwrap();
    assert_eq!(again.session, 2);
    assert!(
        again.notices[0].contains("not planned before"),
        "{:?}",
        again.notices
    );
    run(&study, &real("P01"));
    let over = study.claim(&real("P01"));
    assert!(matches!(over, Err(StoreError::Finished { .. })), "{over:?}");
}
