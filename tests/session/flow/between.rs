//! Questionnaires between the trials: after each condition, block or part.

use super::part_rig::read;
use super::rig::Rig;
use super::studies::{plain, qid, rating, rich};
use study_base::text::PartId;
use study_plan::protocol::file::parse;
use study_plan::protocol::{Answer, Inventory, Occasion, Protocol, Questionnaire};
use study_session::outcome::{Author, Event, FormId, RatingRow};
use study_session::session::Input;

pub(super) fn asked(mut protocol: Protocol, after: Occasion) -> Protocol {
    protocol.questionnaires.push(Questionnaire {
        id: PartId::new("load").unwrap(),
        kind: Inventory::NasaTlx,
        own: None,
        after,
        questions: vec![rating("load_mental"), rating("load_effort")],
    });
    protocol
}

/// The forms between the trials, in the order in which they were answered.
fn forms(rig: &Rig) -> Vec<FormId> {
    let answered = rig.events().filter_map(|event| match event {
        Event::Answered {
            form: form @ FormId::After { .. },
            ..
        } => Some(*form),
        _ => None,
    });
    let mut forms: Vec<FormId> = answered.collect();
    forms.dedup();
    forms
}

fn after(trials: &[u32]) -> Vec<FormId> {
    let form = |trial: &u32| FormId::After {
        trial: *trial,
        attempt: 1,
    };
    trials.iter().map(form).collect()
}

#[test]
fn each_condition_is_judged_before_the_next_one_is_felt() {
    let protocol = asked(plain(), Occasion::Condition);
    let mut rig = Rig::new(protocol.clone());
    rig.finish();
    rig.assert_whole();
    assert_eq!(forms(&rig), after(&[1, 2, 3, 4, 5, 6]));
    let mut given = 0;
    for event in rig.events() {
        match event {
            Event::TrialDone { .. } => given = 0,
            Event::Answered {
                form: FormId::After { .. },
                ..
            } => given += 1,
            Event::AttemptStarted { trial, .. } if *trial > 1 => assert_eq!(given, 2),
            _ => {}
        }
    }
    let history = rig.session.history();
    let rows = history.rating_rows(&protocol);
    let judged = |row: &RatingRow| row.answers.get(&qid("load_effort")) == Some(&Answer::Rating(4));
    assert!(rows.iter().all(judged));
    let who = &history.start().unwrap().participant;
    let once = history.participant_row(who, 1).answers;
    assert!(!once.contains_key(&qid("load_effort")));
}

/// Practice is not judged; a break comes after the questionnaire.
#[test]
fn a_block_is_judged_after_its_last_trial() {
    let protocol = asked(rich(), Occasion::Block);
    let mut rig = Rig::new(protocol);
    rig.finish();
    rig.assert_whole();
    assert_eq!(forms(&rig), after(&[4, 7]));
}

#[test]
fn a_part_or_its_only_realization_is_judged_once() {
    let parts = r#"
[analysis]
primary = "realism"
[[questions]]
id = "realism"
kind = "rating"
prompt = "?"
from = 1
to = 7
[[parts]]
id = "one"
kind = "rating"
models = ["XQZ-7"]
repetitions = 3
[[parts]]
id = "two"
kind = "rating"
models = ["KJW-3", "VVB-9"]
repetitions = 2
"#;
    for (occasion, trials) in [
        (Occasion::Part, &[3, 7][..]),
        (Occasion::Condition, &[3, 4, 5, 6, 7][..]),
        (Occasion::Block, &[1, 2, 3, 5, 7][..]),
    ] {
        let protocol = asked(read(parts), occasion);
        let mut rig = Rig::new(protocol.clone());
        rig.finish();
        assert_eq!(forms(&rig), after(trials), "{occasion:?}");
        let times = protocol.questionnaires[0].times(&protocol) as usize;
        assert_eq!(times, trials.len(), "{occasion:?}");
    }
}

/// The answers of a trial that does not count do not count either.
#[test]
fn a_condition_whose_trial_is_felt_again_is_judged_again() {
    let protocol = asked(plain(), Occasion::Condition);
    let mut rig = Rig::new(protocol.clone());
    rig.until_reference(1).send(Input::MarkBad {
        reason: "misunderstood".to_owned(),
    });
    rig.finish();
    rig.assert_whole();
    let of_first = |form: &&FormId| matches!(form, FormId::After { trial: 1, .. });
    let all = forms(&rig);
    let first: Vec<&FormId> = all.iter().filter(of_first).collect();
    let (trial, attempt) = (1, 2);
    assert_eq!(first.len(), 2);
    assert_eq!(*first[1], FormId::After { trial, attempt });
    let rows = rig.session.history().rating_rows(&protocol);
    assert!(rows[0].answers.contains_key(&qid("load_mental")));
}

/// A block ends with the trial that was completed last, which need not be the last one of the plan.
#[test]
fn a_block_whose_last_trial_is_felt_again_is_judged_again() {
    let protocol = asked(plain(), Occasion::Block);
    let mut rig = Rig::new(protocol.clone());
    let bad = || Input::MarkBad {
        reason: "noise".to_owned(),
    };
    // The first trial comes again at the end of its block, and then once more.
    rig.until_reference(1).send(bad());
    rig.until_reference(3).send(bad());
    rig.finish();
    rig.assert_whole();
    let form = |trial, attempt| FormId::After { trial, attempt };
    assert_eq!(forms(&rig), [form(1, 2), form(1, 3), form(6, 1)]);
    let rows = rig.session.history().rating_rows(&protocol);
    let judged = |row: &&RatingRow| row.answers.contains_key(&qid("load_mental"));
    let judged: Vec<u32> = rows.iter().filter(judged).map(|row| row.trial).collect();
    assert_eq!(judged, [1, 6]);
}

#[test]
fn an_answer_between_the_trials_can_be_corrected() {
    let protocol = asked(plain(), Occasion::Condition);
    let mut rig = Rig::new(protocol.clone());
    rig.until_reference(1);
    let form = after(&[1])[0];
    let shown = rig.view().correctable;
    assert!(shown.iter().any(|own| own.form == form));
    rig.send(Input::Correct {
        form,
        question: qid("load_mental"),
        answer: Answer::Rating(6),
        reason: "misread".to_owned(),
        by: Author::Participant,
    });
    rig.finish();
    let rows = rig.session.history().rating_rows(&protocol);
    assert_eq!(rows[0].answers[&qid("load_mental")], Answer::Rating(6));
    assert_eq!(rows[0].answers[&qid("load_effort")], Answer::Rating(4));
}

#[test]
fn a_session_without_trials_asks_its_questionnaires() {
    let alone = r#"
format = "study-protocol/1"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 4 }
device = { kind = "manual" }
analysis = { primary = "sus" }
[[questionnaires]]
id = "sus"
kind = "sus"
"#;
    let protocol = parse("p", alone).protocol.unwrap();
    let mut rig = Rig::new(protocol.clone());
    rig.finish();
    rig.assert_whole();
    let journal = rig.journal[..5].to_vec();
    let mut again = Rig::back(protocol, journal, 10.0);
    again.identify();
    again.finish();
    again.assert_whole();
    let outro = |event: &Event| {
        matches!(
            event,
            Event::Answered {
                form: FormId::Outro,
                ..
            }
        )
    };
    assert_eq!([rig.count(outro), again.count(outro)], [10, 10]);
}

/// `rig` itself asserts that nothing is asked twice.
#[test]
fn a_session_can_be_picked_up_between_any_two_answers() {
    let protocol = asked(plain(), Occasion::Condition);
    let mut whole = Rig::new(protocol.clone());
    whole.finish();
    for k in 1..whole.journal.len() {
        let mut rig = Rig::back(protocol.clone(), whole.journal[..k].to_vec(), 10.0);
        rig.identify();
        rig.finish();
        rig.assert_whole();
        assert_eq!(forms(&rig).len(), 6, "after {k} events");
        let rows = rig.session.history().rating_rows(&protocol);
        let judged = |id: &str| rows.iter().all(|row| row.answers.contains_key(&qid(id)));
        assert!(
            judged("load_mental") && judged("load_effort"),
            "after {k} events"
        );
    }
}
