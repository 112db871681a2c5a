//! How long a realization is felt, feeling it again, and the way back to an earlier page.

use super::rig::{Rig, name};
use super::studies::{plain, qid, rich};
use study_plan::protocol::{Answer, Exposure, Protocol};
use study_session::outcome::{Author, Event, Failure, FormId};
use study_session::session::{Input, Screen};

fn felt_for(min_s: f64, max_s: Option<f64>, replays: u32) -> Protocol {
    let mut protocol = plain();
    protocol.trial.exposure = Exposure {
        min_s,
        max_s,
        replays,
    };
    protocol
}

fn screen(rig: &Rig) -> &'static str {
    name(&rig.view().screen)
}

const FIRST: FormId = FormId::Trial {
    trial: 1,
    attempt: 1,
};

#[test]
fn what_was_felt_too_short_cannot_be_rated() {
    let mut rig = Rig::new(felt_for(4.0, None, 0));
    rig.until("Playing").wait(3.9).send(Input::Advance);
    assert_eq!(screen(&rig), "Playing");
    assert!(!rig.view().can_advance);
    // neither after a stop
    rig.send(Input::Stop).send(Input::RateStopped);
    assert!(matches!(
        rig.view().screen,
        Screen::Stopped { can_rate: false }
    ));
    rig.send(Input::PlayAgain).wait(4.0);
    assert!(rig.view().can_advance);
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Form");
    // and a longer one can be rated after a stop
    rig.answer_page()
        .until("Playing")
        .wait(4.1)
        .send(Input::Stop);
    assert!(matches!(
        rig.view().screen,
        Screen::Stopped { can_rate: true }
    ));
}

#[test]
fn a_realization_is_felt_again_before_it_is_rated_and_that_is_recorded() {
    let protocol = felt_for(0.0, None, 1);
    let mut rig = Rig::new(protocol.clone());
    rig.until("Form");
    assert!(rig.view().can_replay);
    rig.playback.exploration_s = 1.25;
    rig.playback.strokes = 2;
    rig.send(Input::PlayAgain).until("Form");
    assert!(!rig.view().can_replay, "once only");
    assert!(rig.view().has_replays, "but at the next trial");
    rig.answer_page().until_reference(2);
    let row = &rig.session.history().rating_rows(&protocol)[0];
    assert_eq!((row.replays, row.attempt), (Some(1), Some(1)));
    assert_eq!(row.exploration_s, Some(4.25), "3 s, then 1.25 s");
    assert_eq!(row.position, Some(1));
    assert_eq!(rig.count(|e| matches!(e, Event::Replayed { .. })), 1);
}

#[test]
fn who_leaves_while_it_is_felt_again_has_not_ended_the_attempt() {
    let mut rig = Rig::new(felt_for(0.0, None, 1));
    rig.until("Form")
        .send(Input::PlayAgain)
        .until("Playing")
        .send(Input::Quit);
    let interrupted = |e: &Event| matches!(e, Event::AttemptFailed { trial: 1, failure, .. } if *failure == Failure::Interrupted);
    assert_eq!(rig.count(interrupted), 1);
}

#[test]
fn a_step_back_shows_the_earlier_answers_and_records_a_change() {
    let mut protocol = rich();
    protocol.session.entry = study_plan::protocol::Entry::Participant;
    protocol.design.practice.clear();
    let mut rig = Rig::new(protocol);
    rig.until("Reference").until("Form").answer_page();
    let page = |rig: &Rig| match rig.view().screen {
        Screen::Form { page, .. } => page,
        other => panic!("no form: {other:?}"),
    };
    assert_eq!((page(&rig), rig.view().can_go_back), (2, true));
    let before = rig.journal.len();
    rig.send(Input::Back).send(Input::Back);
    assert_eq!((page(&rig), rig.view().can_go_back), (1, false));
    let given = rig.view().given(FIRST, &qid("realism")).cloned();
    assert_eq!(given, Some(Answer::Rating(4)));
    assert_eq!(rig.journal.len(), before, "looking changes nothing");
    // one answer changed, the other sent as it was
    rig.send(Input::Answer(vec![
        (qid("realism"), Answer::Rating(6)),
        (qid("comment"), Answer::Text("words".to_owned())),
    ]));
    assert_eq!(rig.journal.len(), before + 1);
    assert!(matches!(
        &rig.journal[before].event,
        Event::Corrected {
            from: Some(Answer::Rating(4)),
            to: Answer::Rating(6),
            by: Author::Participant,
            ..
        }
    ));
    // what was answered cannot be taken away without a word
    rig.send(Input::Back).send(Input::Answer(Vec::new()));
    let refused = "Choose a number from 1 to 7 first.";
    assert_eq!(rig.view().notice.as_deref(), Some(refused));
    rig.answer_page().answer_page();
    rig.send(Input::Back);
    assert_ne!(screen(&rig), "Form", "a closed trial stays closed");
}

#[test]
fn corrections_are_listed_by_trial_with_the_rating_first() {
    let mut rig = Rig::new(plain());
    rig.until_reference(3);
    let listed: Vec<(String, String)> = (rig.view().correctable.iter())
        .map(|c| (c.title.clone(), c.id().to_string()))
        .collect();
    let want = [
        ("trial 3", "realism"),
        ("trial 3", "comment"),
        ("trial 2", "realism"),
        ("trial 2", "comment"),
        ("trial 1", "realism"),
        ("trial 1", "comment"),
    ];
    assert_eq!(listed, want.map(|(t, q)| (t.to_owned(), q.to_owned())));
}
