//! Sessions of similarity: pages, rows, and what is left of an interrupted one.

use super::part_rig::*;
use super::rig::Rig;
use study_base::text::{ModelId, QuestionId};
use study_plan::protocol::{Answer, Protocol, Stimuli};
use study_session::outcome::{Event, fold};
use study_session::session::{Input, Screen};

fn asked() -> QuestionId {
    QuestionId::new("apart").unwrap()
}

/// One step; each rating is the number of its trial.
fn rate(rig: &mut Rig) {
    let Screen::Form { .. } = rig.view().screen else {
        rig.step();
        return;
    };
    rig.wait(1.0);
    let trial = rig.session.history().open().unwrap().trial.trial;
    let rating = Answer::Number(f64::from(trial));
    rig.send(Input::Answer(vec![(asked(), rating)]));
}

/// Number of the trial, what was felt first and second, the rating, and whether it is practice.
type Rated = (u32, [ModelId; 2], Option<f64>, bool);

fn rated(rig: &Rig, protocol: &Protocol) -> Vec<Rated> {
    let history = rig.session.history();
    let intervals = fold::interval_rows(history, protocol);
    let rows = history.rating_rows(protocol);
    let mut rated: Vec<Rated> = (rows.iter())
        .map(|row| {
            assert_eq!((row.model.as_ref(), row.correct), (None, None));
            let felt = |interval: u32| {
                let own = intervals.iter().find(|own| {
                    (own.trial, Some(own.attempt), own.interval)
                        == (row.trial, row.attempt, interval)
                });
                own.unwrap().model.clone().unwrap()
            };
            let rating = row.answers[&asked()].number();
            (row.trial, [felt(1), felt(2)], rating, row.practice)
        })
        .collect();
    rated.sort_by_key(|row| row.0);
    rated
}

/// What the schedule has, each with the number of its trial as the rating.
fn planned(rig: &Rig) -> Vec<Rated> {
    let schedule = rig.schedule();
    let planned = schedule.iter().map(|trial| match &trial.stimuli {
        Stimuli::Pair { pair } => (
            trial.trial,
            pair.clone(),
            Some(f64::from(trial.trial)),
            trial.practice,
        ),
        other => panic!("{other:?}"),
    });
    planned.collect()
}

/// Practice and identical pairs are pages like any other; the row has the rating, and no realization of its own.
#[test]
fn differences_are_rated_after_two_intervals() {
    let protocol = similarity("identical = true\npractice = 2");
    let mut rig = Rig::new(protocol.clone());
    finish_by(&mut rig, rate);
    let rows = rated(&rig, &protocol);
    assert_eq!(rows, planned(&rig));
    assert_eq!(rows.len(), 2 + 2 * (3 + 3));
    assert_eq!(rows.iter().filter(|row| row.3).count(), 2);
    let identical = rows.iter().filter(|row| row.1[0] == row.1[1]);
    assert_eq!(identical.count(), 2 * 3);
}

const COURSE: Course = Course {
    step: rate,
    after: [3, 5, 7, 9],
    playing: second,
    corrected: |_| (asked(), Answer::Number(99.0)),
};

/// The program ends after any event: every pair is rated once, in its planned order of intervals, and no rating is lost.
#[test]
fn a_session_is_picked_up_after_every_single_event() {
    let protocol = similarity("identical = true\npractice = 2");
    let whole = eventful(&protocol, &COURSE);
    let failed = whole.count(|e| matches!(e, Event::AttemptFailed { .. }));
    assert_eq!(failed, 3);
    let corrected = |row: &&Rated| row.2 == Some(99.0);
    assert_eq!(rated(&whole, &protocol).iter().filter(corrected).count(), 1);
    let expected = planned(&whole);
    for k in 1..whole.journal.len() {
        let journal = &whole.journal[..k];
        let mut rig = Rig::back(protocol.clone(), journal.to_vec(), 30.0);
        finish_by(&mut rig, rate);
        assert_eq!(rig.journal[..k], *journal, "append only");
        let corrected_before = (journal.iter()).any(|e| matches!(e.event, Event::Corrected { .. }));
        let found = rated(&rig, &protocol);
        assert_eq!(found.len(), expected.len(), "after {k} events");
        for (found, expected) in found.iter().zip(&expected) {
            if corrected_before && found.2 == Some(99.0) {
                assert_eq!((found.0, &found.1), (expected.0, &expected.1));
            } else {
                assert_eq!(found, expected, "after {k} events");
            }
        }
        let corrected = found.iter().filter(corrected).count();
        assert_eq!(corrected, usize::from(corrected_before), "after {k} events");
    }
}
