//! Corrections after a session: both values are kept, and everything agrees afterwards.

#![allow(clippy::unwrap_used)]

use crate::support::{copy_folder, repository, study};
use crate::world::{Kept, at, participant, protocol, question, real, session, telemetry};
use std::fs;
use std::path::Path;
use study_plan::protocol::{Answer, Seat};
use study_session::outcome::{Event, State};
use study_session::store::{AnswerCorrection, StateRequest, StoreError, StudyFolder};

fn open(results: &Path) -> StudyFolder {
    StudyFolder::open_or_create(results, &Kept::new().frozen(), at(0)).unwrap()
}

/// Runs a session as far as `events`.
fn run(study: &StudyFolder, id: &str, events: usize) -> Seat {
    let mut claimed = study.claim(&real(id)).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    let all = session(id, claimed.session, claimed.seat);
    for (event, n) in all.iter().zip(0..).take(events).skip(claimed.entries.len()) {
        journal.append(at(n), event).unwrap();
    }
    telemetry(claimed.folder.path(), &all[..all.len().min(events)]);
    claimed.seat
}

fn rating(id: &str, trial: Option<u32>, asked: &str, to: Option<&str>) -> AnswerCorrection {
    AnswerCorrection {
        participant: participant(id),
        session: None,
        trial,
        question: question(asked),
        to: to.map(str::to_owned),
        reason: "misread the sheet".to_owned(),
    }
}

/// No problem, and the tables are what the journals give.
fn assert_whole(study: &StudyFolder) {
    study.refresh(&protocol()).unwrap();
    let found = study.verify(Some(&protocol())).unwrap();
    let problems: Vec<_> = found.iter().filter(|f| f.is_problem).collect();
    assert!(problems.is_empty(), "{problems:?}");
}

#[test]
fn an_answer_is_corrected_and_both_values_are_kept() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, "P01", 99);
    assert_whole(&study);
    let before = study.sessions().unwrap().remove(0);
    let correct = |request: &AnswerCorrection| study.correct_answer(request, &protocol(), at(900));
    let done = correct(&rating("P01", Some(2), "realism", Some("3"))).unwrap();
    // The session itself had corrected a 6.
    assert_eq!((done.from, done.to), (Answer::Rating(5), Answer::Rating(3)));
    let done = correct(&rating("P01", None, "age", Some("14"))).unwrap();
    assert_eq!(done.from, Answer::Text("41".to_owned()));
    let done = correct(&rating("P01", Some(1), "realism", None)).unwrap();
    assert!(done.to.is_declined());
    assert_whole(&study);
    let after = study.sessions().unwrap().remove(0);
    // Appended, and nothing else changed.
    assert_eq!(after.entries[..before.entries.len()], before.entries[..]);
    assert_eq!(after.entries.len(), before.entries.len() + 3);
    assert_eq!(after.history.last_activity, before.history.last_activity);
    let attempts = fs::read_to_string(study.path().join("attempts.csv")).unwrap();
    assert!(
        attempts.contains(",correction,realism,5,3,,experimenter,misread the sheet,"),
        "{attempts}"
    );
    let derived = study.refresh(&protocol()).unwrap();
    let row = derived.rows.iter().find(|r| r.trial == 2).unwrap();
    assert_eq!(row.answers[&question("realism")], Answer::Rating(3));
    assert!(row.corrected);
}

#[test]
fn what_cannot_be_corrected_is_refused() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, "P01", 99);
    let refused = |request: &AnswerCorrection| {
        let error = study
            .correct_answer(request, &protocol(), at(900))
            .unwrap_err();
        assert!(error.is_request(), "{error}");
        error.to_string()
    };
    for (request, why) in [
        (
            rating("P01", Some(2), "realism", Some("8")),
            "The scale goes from 1 to 7.",
        ),
        (
            rating("P01", Some(2), "realism", Some("high")),
            "The scale goes from 1 to 7.",
        ),
        (
            rating("P01", Some(2), "realism", Some("5")),
            "that is already the answer",
        ),
        (
            rating("P01", Some(9), "realism", Some("5")),
            "trial 9 has no answer to `realism`",
        ),
        (
            rating("P01", None, "realism", Some("5")),
            "--trial names the trial",
        ),
        (
            rating("P01", None, "weight", Some("5")),
            "`weight` was not answered",
        ),
        (rating("P07", Some(2), "realism", Some("5")), "P07"),
    ] {
        let said = refused(&request);
        assert!(said.contains(why), "{said}");
    }
    let session = AnswerCorrection {
        session: Some(2),
        ..rating("P01", Some(2), "realism", Some("4"))
    };
    assert!(refused(&session).contains("no such session"));
    // An open session corrects by itself.
    run(&study, "P02", 14);
    let open_one = study.claim(&real("P02")).unwrap();
    let error = study.correct_answer(
        &rating("P02", Some(2), "realism", Some("4")),
        &protocol(),
        at(900),
    );
    assert!(matches!(error, Err(StoreError::Open { .. })), "{error:?}");
    drop(open_one);
    // Whoever withdrew is left alone.
    let withdrawn = StateRequest {
        participant: participant("P01"),
        state: State::Withdrawn,
        reason: "a test".to_owned(),
        erase: false,
    };
    study.set_state(&withdrawn, at(950)).unwrap();
    assert!(refused(&rating("P01", Some(2), "realism", Some("4"))).contains("withdrew"));
}

#[test]
fn a_mistyped_id_is_corrected_with_its_row_and_its_data() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    assert_eq!(run(&study, "P0l", 14), Seat::Row(1));
    run(&study, "P02", 99);
    assert_whole(&study);
    let (from, to) = (participant("P0l"), participant("P01"));
    study.correct_id(&from, &to, "mistyped", at(900)).unwrap();
    assert_whole(&study);
    for table in ["ratings.csv", "participants.csv"] {
        let text = fs::read_to_string(study.path().join(table)).unwrap();
        assert!(
            text.contains("P01,") && !text.contains("P0l"),
            "{table}: {text}"
        );
    }
    let attempts = fs::read_to_string(study.path().join("attempts.csv")).unwrap();
    assert!(
        attempts.contains(",correction,,P0l,P01,,experimenter,mistyped,"),
        "{attempts}"
    );
    // The session goes on under the right id, on the same row.
    assert_eq!(run(&study, "P01", 99), Seat::Row(1));
    assert_whole(&study);
    // The wrong one is free, and is a new participant.
    assert_eq!(run(&study, "P0l", 3), Seat::Row(3));
    // Two participants are not made one.
    let error = study
        .correct_id(&participant("P02"), &to, "mistyped", at(901))
        .unwrap_err();
    assert!(
        error.to_string().contains("P01 takes part already"),
        "{error}"
    );
    let error = study
        .correct_id(&participant("P09"), &from, "mistyped", at(901))
        .unwrap_err();
    assert!(matches!(error, StoreError::Unknown { .. }), "{error}");
}

#[test]
fn a_correction_of_an_id_that_was_interrupted_is_completed() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    run(&study, "P0l", 14);
    let (from, to) = (participant("P0l"), participant("P01"));
    let mut claimed = study.claim(&real("P0l")).unwrap();
    let recorded = Event::IdCorrected {
        from: from.clone(),
        to: to.clone(),
        reason: "mistyped".to_owned(),
    };
    claimed
        .folder
        .journal()
        .unwrap()
        .append(at(900), &recorded)
        .unwrap();
    drop(claimed);
    study.correct_id(&from, &to, "mistyped", at(901)).unwrap();
    assert_whole(&study);
    let entries = &study.sessions().unwrap()[0].entries;
    let records = entries.iter().filter(|e| e.event == recorded).count();
    assert_eq!(records, 1);
}

/// The mirror was not connected when the id was corrected.
#[test]
fn a_mirror_follows_the_correction_of_an_id() {
    let home = tempfile::tempdir().unwrap();
    let (results, mirror) = (home.path().join("results"), home.path().join("mirror"));
    fs::create_dir(&mirror).unwrap();
    let kept = Kept::new();
    let both = || {
        let opened = StudyFolder::open_or_create_mirrored(&results, &mirror, &kept.frozen(), at(0));
        opened.unwrap()
    };
    run(&both().0, "P0l", 14);
    let alone = open(&results);
    alone
        .correct_id(
            &participant("P0l"),
            &participant("P01"),
            "mistyped",
            at(900),
        )
        .unwrap();
    // Somebody else has the wrong id now.
    run(&alone, "P0l", 14);
    let (study, said) = both();
    assert!(
        said.iter().any(|s| s.ends_with("updated: P0l is P01")),
        "{said:?}"
    );
    assert_whole(&study);
    let found = study.verify_against(&mirror.join("small")).unwrap();
    let problems: Vec<_> = found.iter().filter(|f| f.is_problem).collect();
    assert!(problems.is_empty(), "{problems:?}");
    assert_eq!(study.sessions().unwrap().len(), 2);
}

#[test]
fn the_command_says_both_values_and_the_report_has_them() {
    let home = tempfile::tempdir().unwrap();
    let results = home.path().join("results");
    copy_folder(
        Path::new(&repository("results/turn-signal-example")),
        &results.join("turn-signal"),
    );
    let run = |arguments: &[&str]| study(arguments, home.path());
    let why = ["--reason", "misread the sheet"];
    let ask = [
        "correct",
        "results",
        "SIM001",
        "--trial",
        "3",
        "--question",
        "realism",
    ];
    let (_, out, _) = run(&[&ask[..], &["--to", "7"], &why].concat());
    let (to, from) = match out.contains("is 7 from now on") {
        true => ("7", out.split(" was ").nth(1).unwrap()[..1].to_owned()),
        false => {
            let (code, out, err) = run(&[&ask[..], &["--to", "1"], &why].concat());
            assert_eq!(code, 0, "{out}{err}");
            ("1", "7".to_owned())
        }
    };
    let (code, out, err) = run(&[
        "correct", "results", "SIM002", "--id", "SIM02", "--reason", "a typo",
    ]);
    assert_eq!(code, 0, "{out}{err}");
    let (code, out, err) = run(&["verify", "results"]);
    assert_eq!(code, 0, "{out}{err}");
    let (code, _, err) = run(&["analyze", "results", "--include", "simulated"]);
    assert_eq!(code, 0, "{err}");
    let report = fs::read_to_string(results.join("turn-signal/analysis/report.html")).unwrap();
    for one in [
        format!("SIM001, trial 3: realism {from} → {to} (misread the sheet, "),
        "SIM02: id SIM002 → SIM02 (a typo, ".to_owned(),
    ] {
        assert!(report.contains(&one), "{one}");
    }
    // Wrong usage is refused before anything is read.
    for wrong in [
        &["correct", "results", "SIM001", "--reason", "x"][..],
        &[
            "correct",
            "results",
            "SIM001",
            "--question",
            "realism",
            "--reason",
            "x",
        ],
        &[
            "correct", "results", "SIM001", "--id", "X", "--to", "5", "--reason", "x",
        ],
    ] {
        assert_eq!(run(wrong).0, 2, "{wrong:?}");
    }
}
