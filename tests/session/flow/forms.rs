//! Answers, corrections, remarks, and trials marked as bad.

use super::rig::{Rig, name};
use super::studies::{plain, qid, rich};
use study_plan::protocol::Answer;
use study_session::outcome::{Author, Event, Failure, FormId};
use study_session::session::{Effect, Input, Screen};

fn screen(rig: &Rig) -> &'static str {
    name(&rig.view().screen)
}

fn correct(form: FormId, question: &str, answer: Answer, reason: &str) -> Input {
    Input::Correct {
        form,
        question: qid(question),
        answer,
        reason: reason.to_owned(),
        by: Author::Experimenter,
    }
}

fn remark(text: &str) -> Input {
    Input::Remark {
        by: Author::Participant,
        text: text.to_owned(),
    }
}

fn bad(reason: &str) -> Input {
    Input::MarkBad {
        reason: reason.to_owned(),
    }
}

#[test]
fn a_bad_answer_records_nothing_and_says_what_is_accepted() {
    let mut rig = Rig::new(plain());
    rig.until("Form");
    let before = rig.journal.len();
    for (answers, notice) in [
        (
            vec![(qid("realism"), Answer::Rating(8))],
            "The scale goes from 1 to 7.",
        ),
        (
            vec![(qid("comment"), Answer::Text("dull".into()))],
            "Choose a number from 1 to 7 first.",
        ),
        (
            vec![(qid("other"), Answer::Rating(1))],
            "Choose a number from 1 to 7 first.",
        ),
        (
            vec![
                (qid("realism"), Answer::Rating(1)),
                (qid("other"), Answer::Rating(1)),
            ],
            "`other` is not asked here",
        ),
        (
            vec![(qid("realism"), Answer::Declined { reason: " ".into() })],
            "Why is the question declined? The reason is stored.",
        ),
    ] {
        rig.send(Input::Answer(answers));
        assert_eq!(rig.view().notice.as_deref(), Some(notice));
        assert_eq!(screen(&rig), "Form");
    }
    assert_eq!(rig.journal.len(), before);
}

#[test]
fn declined_is_an_answer_and_a_comment_can_be_anything() {
    let mut rig = Rig::new(plain());
    rig.until("Form");
    let comment = "=1+\"2\"\n\u{1b}[2J よかった 👍🏽";
    rig.send(Input::Answer(vec![
        (
            qid("realism"),
            Answer::Declined {
                reason: "felt nothing".to_owned(),
            },
        ),
        (qid("comment"), Answer::Text(comment.to_owned())),
    ]));
    let form = FormId::Trial {
        trial: 1,
        attempt: 1,
    };
    assert!(rig.answer(form, &qid("realism")).unwrap().is_declined());
    assert_eq!(
        rig.answer(form, &qid("comment")),
        Some(Answer::Text(comment.to_owned()))
    );
    assert_eq!(screen(&rig), "Reference");
}

#[test]
fn pages_are_counted_and_turned() {
    let mut rig = Rig::new(rich());
    rig.until("Reference").until("Form");
    for (page, ids) in [(1, vec!["realism", "comment"]), (2, vec!["crispness"])] {
        let Screen::Form {
            questions,
            page: shown,
            pages,
            ..
        } = rig.view().screen
        else {
            panic!("no form");
        };
        assert_eq!((shown, pages), (page, 2));
        let asked: Vec<_> = questions.iter().map(|q| q.id.as_str()).collect();
        assert_eq!(asked, ids);
        rig.answer_page();
    }
    assert_ne!(screen(&rig), "Form");
}

#[test]
fn an_earlier_answer_is_corrected_with_a_reason_and_both_are_kept() {
    let mut rig = Rig::new(rich());
    rig.until_reference(2);
    let before = rig.journal.len();
    rig.send(correct(
        FormId::Intake,
        "experience",
        Answer::Rating(7),
        "misheard",
    ));
    let event = &rig.journal[before].event;
    assert_eq!(
        *event,
        Event::Corrected {
            form: FormId::Intake,
            question: qid("experience"),
            from: Some(Answer::Rating(4)),
            to: Answer::Rating(7),
            reason: "misheard".to_owned(),
            by: Author::Experimenter,
            channel: None,
        }
    );
    assert_eq!(screen(&rig), "Reference", "it interrupts nothing");
    let shown = rig.view().correctable;
    let now = shown.iter().find(|c| c.id() == &qid("experience")).unwrap();
    assert_eq!(now.answer, Answer::Rating(7));
    let again = correct(FormId::Intake, "experience", Answer::Rating(4), "after all");
    rig.send(again);
    assert!(matches!(
        &rig.journal[before + 1].event,
        Event::Corrected {
            from: Some(Answer::Rating(7)),
            ..
        }
    ));
    rig.finish();
    rig.assert_whole();
}

#[test]
fn a_correction_needs_a_reason_an_earlier_answer_and_a_valid_new_one() {
    let mut rig = Rig::new(rich());
    rig.until_reference(2);
    let before = rig.journal.len();
    for input in [
        correct(FormId::Intake, "experience", Answer::Rating(7), "  "),
        correct(FormId::Intake, "experience", Answer::Rating(8), "misheard"),
        correct(FormId::Intake, "experience", Answer::Rating(4), "the same"),
        correct(FormId::Intake, "nothing", Answer::Rating(4), "misheard"),
        correct(FormId::Outro, "effort", Answer::Rating(4), "too early"),
    ] {
        rig.send(input);
        assert!(rig.view().notice.is_some());
    }
    assert_eq!(rig.journal.len(), before);
}

#[test]
fn what_can_be_corrected_is_listed_newest_first_under_its_number_on_the_screen() {
    let mut rig = Rig::new(rich());
    rig.until_reference(3);
    let mut titles: Vec<String> = rig
        .view()
        .correctable
        .into_iter()
        .map(|c| c.title)
        .collect();
    titles.dedup();
    assert_eq!(
        titles,
        ["trial 2", "trial 1", "practice 1", "intake", "set-up"]
    );
}

#[test]
fn a_page_already_confirmed_can_be_corrected_during_the_same_rating() {
    let mut rig = Rig::new(rich());
    rig.until_reference(1).until("Form").answer_page();
    let first = rig.view().correctable.remove(1);
    assert_eq!(first.title, "trial 1");
    rig.send(correct(
        first.form,
        "realism",
        Answer::Rating(1),
        "wrong key",
    ));
    assert_eq!(screen(&rig), "Form");
    rig.finish();
    rig.assert_whole();
}

#[test]
fn a_remark_can_be_made_at_any_time_and_ends_nothing() {
    let mut rig = Rig::new(rich());
    let mut made = 0;
    let mut last = "";
    rig.until("Consent");
    while rig.ending.is_none() {
        let now = screen(&rig);
        if now != last {
            let before = rig.view().screen;
            rig.send(remark("noise next door"));
            assert_eq!(rig.view().screen, before);
            made += 1;
        }
        last = now;
        rig.step();
    }
    rig.assert_whole();
    assert!(made > 20);
    assert_eq!(rig.count(|e| matches!(e, Event::Remark { .. })), made);
}

#[test]
fn a_remark_during_a_playback_belongs_to_its_trial() {
    let mut rig = Rig::new(plain());
    rig.until("Reference").send(remark("before"));
    rig.until("Playing").send(remark("it hums"));
    rig.send(remark(""));
    assert!(rig.view().notice.is_some());
    let trials: Vec<_> = rig
        .events()
        .filter_map(|e| match e {
            Event::Remark { trial, .. } => Some(*trial),
            _ => None,
        })
        .collect();
    assert_eq!(trials, [None, Some(1)]);
    assert_eq!(screen(&rig), "Playing");
}

#[test]
fn a_trial_under_way_can_be_marked_as_bad_in_every_phase() {
    for phase in ["Playing", "Form"] {
        let mut rig = Rig::new(plain());
        rig.until(phase);
        assert_eq!(rig.view().can_mark_bad.as_deref(), Some("trial 1"));
        rig.effects.clear();
        rig.send(bad(" "));
        assert!(rig.view().notice.is_some());
        assert_eq!(screen(&rig), phase, "a reason is needed");
        rig.send(bad("door slammed"));
        if phase == "Playing" {
            assert_eq!(rig.effects[0], Effect::Limp);
        }
        assert_eq!(screen(&rig), "Reference");
        assert_eq!(
            rig.count(|e| matches!(
                e,
                Event::AttemptFailed {
                    trial: 1,
                    attempt: 1,
                    failure: Failure::MarkedBad,
                    ..
                }
            )),
            1
        );
        rig.finish();
        rig.assert_whole();
        assert_eq!(rig.closed()[&1], Some(2));
    }
}

#[test]
fn the_last_finished_trial_can_be_marked_as_bad_until_the_next_is_under_way() {
    let mut rig = Rig::new(rich());
    rig.until_reference(2);
    assert_eq!(rig.view().can_mark_bad.as_deref(), Some("trial 1"));
    let answers = rig.view().correctable.len();
    rig.send(bad("misunderstood"));
    assert_eq!(
        rig.view().correctable.len(),
        answers - 3,
        "no longer current"
    );
    assert_eq!(rig.view().can_mark_bad, None, "only the last one");
    assert_eq!(rig.view().progress.unwrap().current, 1);
    assert_eq!(screen(&rig), "Reference");
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.closed()[&2], Some(2));
}

#[test]
fn marking_the_trial_before_a_break_keeps_the_break_and_makes_no_second_one() {
    let mut rig = Rig::new(rich());
    rig.until("Break").wait(10.0).send(bad("misunderstood"));
    assert!(matches!(rig.view().screen, Screen::Break { wait_s, .. } if wait_s <= 50.0));
    rig.finish();
    rig.assert_whole();
    let after: Vec<_> = rig
        .events()
        .filter_map(|e| match e {
            Event::BreakStarted { after } => Some(*after),
            _ => None,
        })
        .collect();
    assert_eq!(after, [2, 4]);
}

#[test]
fn the_last_trial_of_all_can_be_marked_as_bad_before_the_end() {
    let mut rig = Rig::new(rich());
    while rig.closed().len() < 7 {
        rig.step();
    }
    rig.until("Form").send(bad("misunderstood"));
    assert_eq!(screen(&rig), "Reference");
    rig.finish();
    rig.assert_whole();
}

#[test]
fn a_trial_marked_as_bad_too_often_is_closed() {
    let mut rig = Rig::new(plain());
    while rig.count(|e| matches!(e, Event::TrialClosed { .. })) == 0 {
        rig.until("Playing");
        let first = rig.session.playing_model() == rig.schedule()[0].model();
        if first && rig.closed().len() < 3 {
            rig.send(bad("again"));
        } else {
            rig.step().until("Form").answer_page();
        }
    }
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.closed()[&1], None);
}
