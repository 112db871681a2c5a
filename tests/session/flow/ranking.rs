//! Sessions of ranking: pages, ranks that are refused, rows, and what is left of an interrupted session.

use super::part_rig::*;
use super::rig::Rig;
use serde_json::json;
use study_base::text::{ModelId, PartId, QuestionId};
use study_plan::protocol::ranking::question;
use study_plan::protocol::{Answer, Protocol, Stimuli};
use study_session::outcome::{Event, FormId, fold};
use study_session::page::reply::{Exchange, Outcome, Sent};
use study_session::session::{Input, Screen};

/// The question about the rank of an interval, from 1.
fn asked(interval: usize) -> QuestionId {
    question(&PartId::new("order").unwrap(), interval)
}

/// The rank that is given to an interval, from 1: each once in a trial.
fn rank(trial: u32, interval: usize) -> i64 {
    i64::from(trial + u32::try_from(interval).unwrap()) % 3 + 1
}

/// Which rank the page asks for; `None` if it is no page of a form.
fn page(rig: &Rig) -> Option<usize> {
    match rig.view().screen {
        Screen::Form { page, .. } => Some(page as usize),
        _ => None,
    }
}

fn give(rig: &mut Rig, interval: usize, rank: i64) {
    rig.wait(1.0);
    rig.send(Input::Answer(vec![(asked(interval), Answer::Rating(rank))]));
}

/// One step; ranks are those of [`rank`].
fn step(rig: &mut Rig) {
    let Some(interval) = page(rig) else {
        // A gap passes by itself: a step would also end the interval after it.
        match rig.view().screen {
            Screen::Loading { .. } => {
                rig.wait(1.0);
            }
            _ => {
                rig.step();
            }
        }
        return;
    };
    let trial = rig.session.history().open().unwrap().trial.trial;
    give(rig, interval, rank(trial, interval));
}

fn second_of_three(screen: &Screen) -> bool {
    matches!(
        screen,
        Screen::Playing {
            interval: Some((2, 3)),
            ..
        }
    )
}

/// Number of the trial, what was felt in its order, the ranks, and whether it is practice.
type Ranked = (u32, Vec<ModelId>, Vec<Option<f64>>, bool);

fn ranked(rig: &Rig, protocol: &Protocol) -> Vec<Ranked> {
    let history = rig.session.history();
    let intervals = fold::interval_rows(history, protocol);
    let rows = history.rating_rows(protocol);
    let mut ranked: Vec<Ranked> = (rows.iter())
        .map(|row| {
            assert_eq!((row.model.as_ref(), row.correct), (None, None));
            let felt = |interval: u32| {
                let own = intervals.iter().find(|own| {
                    (own.trial, Some(own.attempt), own.interval)
                        == (row.trial, row.attempt, interval)
                });
                own.unwrap().model.clone().unwrap()
            };
            let ranks = (1..=3).map(|interval| row.answers[&asked(interval)].number());
            let felt = (1..=3).map(felt).collect();
            (row.trial, felt, ranks.collect(), row.practice)
        })
        .collect();
    ranked.sort_by_key(|row| row.0);
    ranked
}

/// What the schedule has, with the ranks of [`rank`] and the corrections of the journal.
fn planned(rig: &Rig) -> Vec<Ranked> {
    let schedule = rig.schedule();
    let mut planned: Vec<Ranked> = (schedule.iter())
        .map(|trial| match &trial.stimuli {
            Stimuli::Set { set } => {
                let ranks = (1..=3).map(|interval| Some(rank(trial.trial, interval) as f64));
                (trial.trial, set.clone(), ranks.collect(), trial.practice)
            }
            other => panic!("{other:?}"),
        })
        .collect();
    for event in rig.events() {
        if let Event::Corrected {
            form: FormId::Trial { trial, .. },
            to,
            ..
        } = event
        {
            let own = planned.iter_mut().find(|own| own.0 == *trial).unwrap();
            own.2[0] = to.number();
        }
    }
    planned
}

/// All are felt, each under its number, and then asked in turn; the row has the ranks, and no realization of its own.
#[test]
fn realizations_are_ranked_after_all_were_felt() {
    let protocol = ranking("repetitions = 4\npractice = 1");
    let mut rig = Rig::new(protocol.clone());
    let mut names = Vec::new();
    while done(&rig) < 1 {
        if let Screen::Playing {
            interval: Some((at, 3)),
            ..
        } = rig.view().screen
        {
            names.push(rig.view().interval_name(at));
        }
        step(&mut rig);
    }
    names.dedup();
    assert_eq!(names, ["number 1", "number 2", "number 3"]);
    finish_by(&mut rig, step);
    let rows = ranked(&rig, &protocol);
    assert_eq!(rows, planned(&rig));
    assert_eq!((rows.len(), rows.iter().filter(|r| r.3).count()), (5, 1));
    let orders: std::collections::BTreeSet<_> = rows.iter().map(|row| row.1.clone()).collect();
    assert!(orders.len() > 1);
}

/// A rank that was given on a page before is refused, in the words of the study, and the page stays; with ties it is taken.
#[test]
fn a_rank_is_given_once_unless_there_are_ties() {
    let to_second_page = |more: &str| {
        let mut rig = Rig::new(ranking(more));
        while page(&rig) != Some(2) {
            if page(&rig) == Some(1) {
                give(&mut rig, 1, 2);
            } else {
                rig.step();
            }
        }
        rig
    };
    let mut rig = to_second_page("repetitions = 1");
    give(&mut rig, 2, 2);
    let notice = rig.view().notice.unwrap();
    assert!(notice.starts_with("2 is given already."), "{notice}");
    assert_eq!(page(&rig), Some(2));
    give(&mut rig, 2, 1);
    assert_eq!((page(&rig), rig.view().notice), (Some(3), None));
    // Back to exchange the first two: the second is asked again, and its rank is no longer free.
    rig.send(Input::Back).send(Input::Back);
    give(&mut rig, 1, 1);
    give(&mut rig, 2, 1);
    assert_eq!(page(&rig), Some(2));
    give(&mut rig, 2, 2);
    give(&mut rig, 3, 3);
    finish_by(&mut rig, step);
    let rows = rig
        .session
        .history()
        .rating_rows(&ranking("repetitions = 1"));
    let ranks = |at: usize| rows[0].answers[&asked(at)].number();
    assert_eq!([1, 2, 3].map(ranks), [Some(1.0), Some(2.0), Some(3.0)]);
    let mut tied = to_second_page("repetitions = 1\nties = true");
    give(&mut tied, 2, 2);
    assert_eq!(page(&tied), Some(3));
}

/// The words reach a screen of the participant's own.
#[test]
fn a_page_is_told_why_a_rank_is_refused() {
    let mut rig = Rig::new(ranking("repetitions = 1"));
    while page(&rig) != Some(2) {
        if page(&rig) == Some(1) {
            give(&mut rig, 1, 3);
        } else {
            rig.step();
        }
    }
    rig.wait(1.0);
    let mut exchange = Exchange::new("run".to_owned());
    let mut answered = |rig: &mut Rig, key: &str, rank: &str| {
        exchange.show(&rig.view());
        let id = exchange.page().unwrap().id.to_owned();
        let reply = json!({"page": id, "key": key, "shown_ms": 250, "does": "answer",
            "answers": {"order-2": rank}});
        assert!(exchange.arrive(Sent::read(reply.to_string().as_bytes()).unwrap()));
        let input = exchange.input(&rig.view()).unwrap();
        rig.send(input);
        exchange.show(&rig.view());
        exchange.outcome(key).cloned()
    };
    let Some(Outcome::Refused(why)) = answered(&mut rig, "1", "3") else {
        panic!("it is taken");
    };
    assert!(why.starts_with("3 is given already."), "{why}");
    assert_eq!(answered(&mut rig, "2", "1"), Some(Outcome::Saved));
    assert_eq!(page(&rig), Some(3));
}

const COURSE: Course = Course {
    step,
    after: [1, 2, 3, 4],
    playing: second_of_three,
    corrected: |form| match form {
        FormId::Trial { trial, .. } => (asked(1), Answer::Rating(rank(trial, 2))),
        other => panic!("{other:?}"),
    },
};

/// The program ends after any event: every set is ranked once, in its planned order, and no rank is lost.
#[test]
fn a_session_is_picked_up_after_every_single_event() {
    let protocol = ranking("repetitions = 5\npractice = 1");
    let whole = eventful(&protocol, &COURSE);
    let failed = whole.count(|e| matches!(e, Event::AttemptFailed { .. }));
    assert_eq!(failed, 3);
    assert_eq!(whole.count(|e| matches!(e, Event::Corrected { .. })), 1);
    assert_eq!(ranked(&whole, &protocol), planned(&whole));
    for k in 1..whole.journal.len() {
        let journal = &whole.journal[..k];
        let mut rig = Rig::back(protocol.clone(), journal.to_vec(), 30.0);
        finish_by(&mut rig, step);
        assert_eq!(rig.journal[..k], *journal, "append only");
        assert_eq!(ranked(&rig, &protocol), planned(&rig), "after {k} events");
    }
}
