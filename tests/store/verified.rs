//! What `study verify` says beside a session that is open, of clocks that jumped, and of a
//! manifest whose checksum has lost its name.

#![allow(clippy::unwrap_used)]

use crate::world::{Kept, at, model, protocol, real, request, session, telemetry};
use std::fs;
use std::path::Path;
use study_plan::protocol::Answer;
use study_session::outcome::{Event, FormId, Moment};
use study_session::store::{Finding, SeatKind, StudyFolder};

fn open(results: &Path) -> StudyFolder {
    StudyFolder::open_or_create(results, &Kept::new().frozen(), at(0)).unwrap()
}

/// Runs a session to its end.
fn finished(study: &StudyFolder, id: &str, more: &[Event]) {
    let mut claimed = study.claim(&real(id)).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    let mut all = session(id, claimed.session, claimed.seat);
    all.splice(3..3, more.iter().cloned());
    for (event, n) in all.iter().zip(0..) {
        journal.append(at(n), event).unwrap();
    }
    telemetry(claimed.folder.path(), &all);
}

fn problems(found: &[Finding]) -> Vec<String> {
    let problems = found.iter().filter(|f| f.is_problem);
    problems
        .map(|f| format!("{}: {}", f.place, f.what))
        .collect()
}

#[test]
fn a_session_that_is_open_is_no_problem_and_hides_none() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    finished(&study, "P01", &[]);
    study.refresh(&protocol()).unwrap();
    let mut claimed = study.claim(&real("P02")).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    let all = session("P02", claimed.session, claimed.seat);
    for (event, n) in all.iter().zip(0..).take(14) {
        journal.append(at(n), event).unwrap();
    }
    telemetry(claimed.folder.path(), &all[..14]);
    let verify = || open(results.path()).verify(Some(&protocol())).unwrap();
    let found = verify();
    assert_eq!(problems(&found), [""; 0]);
    let open_one = found
        .iter()
        .filter(|f| f.what.contains("a session is open"));
    assert_eq!(
        open_one.map(|f| &f.place).collect::<Vec<_>>(),
        ["sessions/P02"]
    );

    // A changed row of somebody else is found all the same.
    let ratings = study.path().join("ratings.csv");
    let whole = fs::read_to_string(&ratings).unwrap();
    fs::write(&ratings, whole.replacen(",ok,", ",failed,", 1)).unwrap();
    let expected = ["ratings.csv: differs from what the journals give"];
    assert_eq!(problems(&verify()), expected);
    fs::write(&ratings, &whole).unwrap();
    // So is one that is missing.
    let (rest, _) = whole.trim_end().rsplit_once("\r\n").unwrap();
    fs::write(&ratings, format!("{rest}\r\n")).unwrap();
    assert_eq!(problems(&verify()), expected);
    fs::write(&ratings, &whole).unwrap();

    // A session that was killed is behind its tables, and nobody has it open.
    drop((journal, claimed));
    assert_eq!(problems(&verify()).len(), 3);
    study.refresh(&protocol()).unwrap();
    assert_eq!(problems(&verify()), [""; 0]);
}

#[test]
fn a_clock_that_jumped_is_noted() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    let jump = |by_s| Event::ClockStepped { by_s };
    finished(&study, "P01", &[jump(172_800.0), jump(-2.1)]);
    finished(&study, "P02", &[jump(2.1)]);
    study.refresh(&protocol()).unwrap();
    let found = study.verify(Some(&protocol())).unwrap();
    assert_eq!(problems(&found), [""; 0]);
    let jumps: Vec<&Finding> = found.iter().filter(|f| f.what.contains("jumped")).collect();
    assert_eq!(jumps.len(), 1, "{found:?}");
    assert_eq!(jumps[0].place, "sessions/P01/1");
    assert!(jumps[0].what.contains("by +172800 s:"), "{}", jumps[0].what);
}

#[test]
fn a_checksum_that_lost_its_name_is_a_damaged_one() {
    let results = tempfile::tempdir().unwrap();
    let study = open(results.path());
    finished(&study, "P01", &[]);
    let path = study.path().join("study.json");
    let whole = fs::read_to_string(&path).unwrap();
    let key = whole.rfind("sha256").unwrap();
    let without: String = whole
        .lines()
        .filter(|line| !line.contains("\"sha256\""))
        .collect();
    let without = without.replacen(",}", "}", 1);
    let renamed = (0..6).map(|n| {
        let mut bytes = whole.clone().into_bytes();
        bytes[key + n] ^= 1;
        String::from_utf8(bytes).unwrap()
    });
    for damaged in renamed.chain([without]) {
        fs::write(&path, &damaged).unwrap();
        let found = StudyFolder::open(study.path())
            .unwrap()
            .verify(None)
            .unwrap();
        let problems = problems(&found);
        assert_eq!(problems.len(), 1, "{damaged}");
        assert!(
            problems[0].contains("checksum does not match"),
            "{problems:?}"
        );
        // Nothing is added to such a study.
        let refused = StudyFolder::open_or_create(results.path(), &Kept::new().frozen(), at(0));
        assert!(refused.is_err(), "{damaged}");
    }
}

/// The end of practice is replayed: one that came too early, or too late, is a problem.
#[test]
fn practice_that_ended_before_or_after_its_criterion_is_a_problem() {
    let home = tempfile::tempdir().unwrap();
    let kind = "identification";
    let run = |arguments: &[&str]| {
        let (code, out, err) = crate::support::study(arguments, home.path());
        assert_eq!(code, 0, "{out}{err}");
    };
    run(&["new", "--seed", "20261123", kind, "--kind", kind]);
    let path = home.path().join("identification/protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replace("correct = 7, of = 8", "correct = 3, of = 4");
    fs::write(&path, &text).unwrap();
    run(&["rehearse", kind, "--participants", "2", "--out", "out"]);
    let study = StudyFolder::open(&home.path().join("out/identification")).unwrap();
    let verify = |criterion: &str| {
        let text = text.replace("correct = 3, of = 4", criterion);
        let protocol = study_plan::protocol::file::parse("p", &text)
            .protocol
            .unwrap();
        problems(&study.verify(Some(&protocol)).unwrap())
    };
    assert_eq!(verify("correct = 3, of = 4"), [""; 0]);
    let early = verify("correct = 20, of = 20");
    assert_eq!(early.len(), 2, "{early:?}");
    for problem in early {
        assert!(
            problem.contains("practice of `which`: it ended after")
                && problem.ends_with("before 20 of the last 20 were correct"),
            "{problem}"
        );
    }
    let late = verify("correct = 1, of = 1");
    assert_eq!(late.len(), 2, "{late:?}");
    for problem in late {
        assert!(
            problem.ends_with("began although its criterion was reached"),
            "{problem}"
        );
    }
}

/// The changes of a level are replayed: one to the other end of the ladder is a problem, and so are one that comes before the
/// level was felt, an answer that is not the level that was felt last, and whatever else no session records.
#[test]
fn changes_and_answers_of_no_session_are_problems() {
    let home = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, err) = crate::support::study(arguments, home.path());
        assert_eq!(code, 0, "{out}{err}");
    };
    run(&["new", "--seed", "20261123", "set", "--kind", "adjustment"]);
    run(&["rehearse", "set", "--participants", "2", "--out", "out"]);
    let text = fs::read_to_string(home.path().join("set/protocol.toml")).unwrap();
    let protocol = study_plan::protocol::file::parse("p", &text)
        .protocol
        .unwrap();
    let rehearsed = StudyFolder::open(&home.path().join("out/set")).unwrap();
    assert_eq!(
        problems(&rehearsed.verify(Some(&protocol)).unwrap()),
        [""; 0]
    );
    let all = rehearsed.sessions().unwrap();
    let events: Vec<Event> = all[0].entries.iter().map(|e| e.event.clone()).collect();

    // The same session in a journal of its own, but for one event.
    let planted = |change: fn(Vec<Event>) -> Vec<Event>| {
        let results = tempfile::tempdir().unwrap();
        let study = open(results.path());
        let id = all[0].participant.as_str();
        let mut claimed = study.claim(&request(id, SeatKind::Simulated)).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        let events = change(events.clone());
        let timed: Vec<(Moment, &Event)> = (0..).map(at).zip(&events).collect();
        journal.append_all(&timed).unwrap();
        let mut found = problems(&study.verify(Some(&protocol)).unwrap());
        found.retain(|problem| problem.contains("adjustment `equal`"));
        found
    };
    assert_eq!(planted(|events| events), [""; 0]);
    type Forged = fn(Vec<Event>) -> Vec<Event>;
    let forged: [(Forged, &str); 9] = [
        (jump, "which is not a step"),
        (skip, "and what came before was not felt"),
        (change_later, "and is not under way"),
        (begin_elsewhere, "does not begin as planned"),
        (answer_another, "and another level was felt last"),
        (answer_nothing, "and another level was felt last"),
        (answer_unfelt, "and its level was not felt"),
        (answer_again, "and is not under way"),
        (correct, "and it was felt"),
    ];
    for (change, expected) in forged {
        let found = planted(change);
        assert_eq!(found.len(), 1, "{expected}: {found:?}");
        assert!(found[0].ends_with(expected), "{expected}: {found:?}");
    }
}

/// The first change of a level by a step.
fn changed(events: &[Event]) -> usize {
    let changes = |event: &Event| {
        matches!(
            event,
            Event::Adjusted {
                standard: false,
                ..
            }
        )
    };
    events.iter().position(changes).unwrap()
}

/// The first answer to a trial.
fn answered(events: &[Event]) -> usize {
    let answers = |event: &Event| {
        matches!(
            event,
            Event::Answered {
                form: FormId::Trial { .. },
                ..
            }
        )
    };
    events.iter().position(answers).unwrap()
}

fn answer(events: &mut [Event]) -> &mut Answer {
    let at = answered(events);
    match &mut events[at] {
        Event::Answered { answer, .. } => answer,
        other => panic!("{other:?}"),
    }
}

/// To the other end of the ladder.
fn jump(mut events: Vec<Event>) -> Vec<Event> {
    let at = changed(&events);
    let Event::Adjusted { to, .. } = &mut events[at] else {
        panic!("a change");
    };
    let step: usize = to.as_str().rsplit('.').next().unwrap().parse().unwrap();
    *to = model(if step > 10 { "detent.1" } else { "detent.21" });
    events
}

/// A second change while the first one is under way.
fn skip(mut events: Vec<Event>) -> Vec<Event> {
    let at = changed(&events);
    let again = events[at].clone();
    events.insert(at, again);
    events
}

/// A change after the level was confirmed.
fn change_later(mut events: Vec<Event>) -> Vec<Event> {
    let late = events[changed(&events)].clone();
    let at = answered(&events);
    events.insert(at + 1, late);
    events
}

/// A trial that begins at the standard.
fn begin_elsewhere(mut events: Vec<Event>) -> Vec<Event> {
    let begun = events.iter_mut().find_map(|event| match event {
        Event::AttemptStarted { intervals, .. } => intervals.last_mut(),
        _ => None,
    });
    *begun.unwrap() = model("detent.11");
    events
}

fn answer_another(mut events: Vec<Event>) -> Vec<Event> {
    match answer(&mut events) {
        Answer::Number(level) => *level += 0.05,
        other => panic!("{other:?}"),
    }
    events
}

fn answer_nothing(mut events: Vec<Event>) -> Vec<Event> {
    *answer(&mut events) = Answer::Declined {
        reason: "tired".to_owned(),
    };
    events
}

/// The answer comes before the end of what was felt.
fn answer_unfelt(mut events: Vec<Event>) -> Vec<Event> {
    let at = answered(&events);
    events.swap(at - 1, at);
    events
}

fn answer_again(mut events: Vec<Event>) -> Vec<Event> {
    let at = answered(&events);
    let again = events[at].clone();
    events.insert(at + 1, again);
    events
}

/// The level is typed later.
fn correct(mut events: Vec<Event>) -> Vec<Event> {
    let at = answered(&events);
    let Event::Answered { form, question, .. } = events[at].clone() else {
        panic!("an answer");
    };
    let corrected = Event::Corrected {
        form,
        question,
        from: None,
        to: Answer::Number(1.0),
        reason: "a slip".to_owned(),
        by: study_session::outcome::Author::Experimenter,
        channel: None,
    };
    events.insert(at + 1, corrected);
    events
}
