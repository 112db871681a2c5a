//! Identification: feedback, practice to a criterion, and corrections.

use super::part_rig::*;
use super::rig::Rig;
use study_base::text::QuestionId;
use study_plan::protocol::{Answer, Control, Protocol, Seat};
use study_session::outcome::{Author, Choice, Event, FormId, RatingRow};
use study_session::session::view::MessageKind;
use study_session::session::{Input, Screen};

/// The right label of what is felt, or another one.
fn named(rig: &Rig, protocol: &Protocol, right: bool) -> Vec<(QuestionId, Answer)> {
    let open = rig.session.history().open().unwrap();
    let part = protocol.part(open.trial.part.as_ref().unwrap()).unwrap();
    let own = part.task.identification().unwrap();
    let label = own.label_of(open.trial.model().unwrap()).unwrap();
    let other = own.labels.iter().find(|l| l.text != label).unwrap();
    let text = if right { label } else { &other.text };
    let answer = Answer::Choice(vec![text.to_owned()]);
    vec![(part.asks[0].clone(), answer)]
}

/// One step; every label is right, or none is.
fn step_named(rig: &mut Rig, protocol: &Protocol, right: bool) {
    match rig.view().screen {
        Screen::Form { .. } => {
            rig.wait(1.0);
            let answers = named(rig, protocol, right);
            rig.send(Input::Answer(answers));
        }
        _ => {
            rig.step();
        }
    }
}

/// The labels are those of the study in every language, and the right one is told where it is wanted.
#[test]
fn the_right_label_is_told_after_practice_or_always_or_never() {
    for (feedback, practice, counted) in [
        ("practice", true, false),
        ("always", true, true),
        ("never", false, false),
    ] {
        let more = format!("practice = [\"VVB-9\", \"XQZ-7\"]\nfeedback = \"{feedback}\"");
        let mut protocol = identification(&more);
        protocol.text.lang = Some("de".to_owned());
        let mut rig = Rig::new(protocol.clone());
        let mut said = Vec::new();
        while rig.ending.is_none() {
            match rig.view().screen {
                Screen::Form { questions, .. } => {
                    let options = match questions[0].kind.control() {
                        Control::List { options, .. } => options.to_vec(),
                        _ => panic!(),
                    };
                    assert_eq!(options, ["first", "no"]);
                    rig.wait(1.0);
                    let answer = Answer::Choice(vec!["first".to_owned()]);
                    rig.send(Input::Answer(vec![(questions[0].id.clone(), answer)]));
                }
                _ => {
                    rig.step();
                }
            }
            if let Screen::Message { kind, text } = rig.view().screen
                && kind == MessageKind::Feedback
            {
                said.push(text);
            }
        }
        let rows = rig.session.history().rating_rows(&protocol);
        let told = |row: &&RatingRow| if row.practice { practice } else { counted };
        let expected: Vec<&str> = (rows.iter().filter(told))
            .map(|row| match row.correct {
                Some(true) => "Das war richtig.",
                _ => "Das war nicht richtig. Es war: no",
            })
            .collect();
        assert_eq!(said, expected, "{feedback}");
        let right = |row: &RatingRow| row.model.as_ref().unwrap().as_str() == "XQZ-7";
        assert!(rows.iter().all(|row| row.correct == Some(right(row))));
        assert_eq!(rows.len(), 2 + 6);
    }
}

/// Practice ends with the criterion, also after a resume, or goes through all rounds; its pages do not say
/// how many trials are left.
#[test]
fn practice_ends_once_enough_of_the_last_answers_are_correct() {
    let protocol = identification(
        "practice = [\"XQZ-7\", \"KJW-3\"]\ncriterion = { correct = 3, of = 4, rounds = 5 }",
    );
    // The third answer is the first correct one.
    let practice = |first_right: usize, resumed: Option<usize>| {
        let mut rig = Rig::new(protocol.clone());
        let mut given = 0;
        let mut quit = resumed;
        loop {
            let view = rig.view();
            if let Some(progress) = view.progress.filter(|p| p.practice) {
                assert_eq!(progress.total, None);
            }
            if view.progress.is_some_and(|p| !p.practice) {
                break;
            }
            if quit == Some(given) && matches!(view.screen, Screen::Reference { .. }) {
                quit = None;
                rig.send(Input::Quit);
                rig = Rig::back(protocol.clone(), rig.journal.clone(), 10.0);
                continue;
            }
            match view.screen {
                Screen::Form { .. } => {
                    rig.wait(1.0);
                    let answers = named(&rig, &protocol, given >= first_right);
                    given += 1;
                    rig.send(Input::Answer(answers));
                }
                _ => {
                    rig.step();
                }
            }
        }
        let ended = rig.count(|e| matches!(e, Event::PracticeEnded { .. }));
        let rows = rig.session.history().rating_rows(&protocol);
        let rows = rows.iter().filter(|r| r.practice).count();
        assert_eq!(rows, given);
        (given, ended)
    };
    assert_eq!(practice(0, None), (4, 1));
    assert_eq!(practice(2, None), (5, 1));
    assert_eq!(practice(2, Some(4)), (5, 1));
    // The criterion with the last answer of all: nothing is left to end.
    assert_eq!(practice(7, None), (10, 0));
    assert_eq!(practice(99, None), (10, 0));
    // Each round has each realization once, in orders that differ between seats.
    let orders: Vec<Vec<String>> = (1..=6)
        .map(|row| {
            let trials = study_plan::schedule::plan(&protocol, None, Seat::Row(row)).unwrap();
            let own = trials.iter().filter(|t| t.practice);
            own.map(|t| t.model().unwrap().to_string()).collect()
        })
        .collect();
    for order in &orders {
        assert!(
            order.chunks(2).all(|round| round[0] != round[1]),
            "{order:?}"
        );
    }
    assert!(orders[1..].iter().any(|order| *order != orders[0]));
}

/// A trial that failed before the criterion was reached does not come after the end of practice.
#[test]
fn a_practice_trial_that_failed_does_not_outlast_its_practice() {
    let protocol = identification(
        "practice = [\"XQZ-7\", \"KJW-3\"]\ncriterion = { correct = 3, of = 4, rounds = 5 }",
    );
    let mut rig = Rig::new(protocol.clone());
    let playing = |rig: &Rig| matches!(rig.view().screen, Screen::Playing { .. });
    while !playing(&rig) || done(&rig) < 1 {
        step_named(&mut rig, &protocol, true);
    }
    let failed = rig.session.history().open().unwrap().trial.trial;
    rig.send(Input::DeviceFault("no bus".to_owned()));
    assert!(rig.session.history().queue.contains(&failed));
    while rig.ending.is_none() {
        step_named(&mut rig, &protocol, true);
    }
    let practice = |n: &u32| rig.schedule().iter().any(|t| t.trial == *n && t.practice);
    let mut events = rig.events();
    assert!(events.any(|e| matches!(e, Event::PracticeEnded { .. })));
    let after: Vec<u32> = events
        .filter_map(|e| match e {
            Event::AttemptStarted { trial, .. } => Some(*trial).filter(practice),
            _ => None,
        })
        .collect();
    assert_eq!(after, [0; 0]);
    let tried = rig.count(|e| matches!(e, Event::AttemptStarted { trial, .. } if *trial == failed));
    assert_eq!(tried, 1);
    let rows = rig.session.history().rating_rows(&protocol);
    let answered = |r: &&RatingRow| r.practice && r.correct.is_some();
    assert_eq!(rows.iter().filter(answered).count(), 4);
    assert_eq!(rows.iter().filter(|r| !r.practice).count(), 6);
}

/// Where the right label was told, the first answer counts, and the correction is in the row; elsewhere the correction counts.
#[test]
fn an_answer_that_is_corrected_after_the_right_label_was_told_stays_wrong() {
    for (feedback, practice, counted) in [
        ("practice", true, false),
        ("always", true, true),
        ("never", false, false),
    ] {
        let more = format!("practice = [\"VVB-9\"]\nfeedback = \"{feedback}\"");
        let protocol = identification(&more);
        let mut rig = Rig::new(protocol.clone());
        // Wrong in the practice trial and the first that counts, and both are corrected.
        while done(&rig) < 2 || !reference(&rig.view().screen) {
            step_named(&mut rig, &protocol, false);
        }
        let wrong = rig.session.history().rating_rows(&protocol);
        assert!(wrong[..2].iter().all(|row| row.correct == Some(false)));
        assert!(wrong.iter().all(|row| row.answer_before_feedback.is_none()));
        for (trial, told) in [(1, practice), (2, counted)] {
            let row = &wrong[trial as usize - 1];
            let part = &protocol.parts[0];
            let own = part.task.identification().unwrap();
            let label = own.label_of(row.model.as_ref().unwrap()).unwrap();
            let right = Answer::Choice(vec![label.to_owned()]);
            rig.send(Input::Correct {
                form: FormId::Trial { trial, attempt: 1 },
                question: part.asks[0].clone(),
                answer: right.clone(),
                reason: "a slip".to_owned(),
                by: Author::Participant,
            });
            let rows = rig.session.history().rating_rows(&protocol);
            let now = &rows[trial as usize - 1];
            assert_eq!(now.answers[&part.asks[0]], right);
            assert!(now.corrected);
            assert_eq!(now.correct, Some(!told), "{feedback} {trial}");
            let first = row.answers[&part.asks[0]].clone();
            assert_eq!(now.answer_before_feedback, told.then_some(first));
        }
        let again = rig.count(|e| matches!(e, Event::Corrected { .. }));
        assert_eq!(again, 2);
    }
}

/// Nothing is told of an answer that was declined: one that replaces it counts.
#[test]
fn an_answer_that_replaces_a_declined_one_counts() {
    let protocol = identification("feedback = \"always\"");
    let mut rig = Rig::new(protocol.clone());
    until(&mut rig, 0, answering);
    let right = named(&rig, &protocol, true);
    let question = right[0].0.clone();
    let declined = Answer::Declined {
        reason: "felt nothing".to_owned(),
    };
    rig.send(Input::Answer(vec![(question.clone(), declined)]));
    until(&mut rig, 1, reference);
    rig.send(Input::Correct {
        form: FormId::Trial {
            trial: 1,
            attempt: 1,
        },
        question,
        answer: right[0].1.clone(),
        reason: "a slip".to_owned(),
        by: Author::Participant,
    });
    let row = &rig.session.history().rating_rows(&protocol)[0];
    assert_eq!(row.correct, Some(true));
    assert_eq!(row.answer_before_feedback, None);
}

/// All practice has the block 0, and that of another part is not taken up again.
#[test]
fn restarting_a_block_in_practice_repeats_that_of_its_part_only() {
    let mut protocol = identification("practice = [\"XQZ-7\", \"KJW-3\"]");
    let mut second = protocol.parts[0].clone();
    second.id = study_base::text::PartId::new("again").unwrap();
    protocol.parts.push(second);
    let mut rig = Rig::new(protocol.clone());
    // Practice and six trials of the first part, and one practice trial of the second.
    while done(&rig) < 2 + 6 + 1 || !reference(&rig.view().screen) {
        step_named(&mut rig, &protocol, true);
    }
    rig.send(Input::Quit);
    let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 100_000.0);
    rig.identify();
    rig.send(Input::Resume(Choice::RestartBlock));
    let expected: Vec<u32> = (9..=16).collect();
    assert_eq!(rig.session.history().queue, expected);
    while rig.ending.is_none() {
        step_named(&mut rig, &protocol, true);
    }
    let answered = rig.session.history().rating_rows(&protocol);
    assert!(answered.iter().all(|row| row.correct == Some(true)));
    assert_eq!(done(&rig), 16 + 1);
}
