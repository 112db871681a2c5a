//! Parts that search: the next two points follow from the answers.

use super::part_rig::*;
use super::rig::Rig;
use crate::world;
use study_base::text::{ModelId, QuestionId};
use study_plan::procedure::search::RecordedPair;
use study_plan::protocol::{Answer, Protocol, SpaceRules, Stimuli};
use study_session::outcome::{Choice, Entry, Event};
use study_session::session::{Ending, Input, Screen};
use study_session::store::{Frozen, StudyFolder};

pub(super) fn searching(rule: &str) -> Protocol {
    let parsed = study_plan::protocol::file::parse(
        "p",
        &format!(
            r#"
format = "study-protocol/3"
study = {{ id = "s", title = "t", seed = 3 }}
design = {{ participants = 4, order_version = 2 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "best" }}
[[spaces]]
id = "XQZ-7"
from = "XQZ-7.toml"
axes = {{ detent = [0.5, 1.5], friction = [0.0, 1.5] }}
grid = 5
[[parts]]
id = "best"
kind = "search"
prompt = "Which?"
space = "XQZ-7"
rule = {rule}
"#
        ),
    );
    let shown = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
}

const MODEL: &str = r#"{ name = "preference-gp", trials = 14, start = 4 }"#;

/// Somebody who likes the point with detent 1.25 and friction 0.375 best.
fn preferred(rig: &Rig, space: &SpaceRules) -> Vec<(QuestionId, Answer)> {
    let open = rig.session.history().open().unwrap();
    let far = |model| {
        let point = space.point_of(model).unwrap();
        let levels = space.levels(point);
        let away = (levels[0] - 1.25).hypot((levels[1] - 0.375) / 1.5);
        // Of two that are equally far, the one with the lower number, whichever comes first.
        (away, point)
    };
    let [first, second] = &open.attempt.models[..] else {
        panic!("{:?}", open.attempt.models);
    };
    let word = if far(first) < far(second) {
        "first"
    } else {
        "second"
    };
    vec![(
        QuestionId::new("best").unwrap(),
        Answer::Choice(vec![word.to_owned()]),
    )]
}

/// Steps until a screen after so many trials.
fn go_on(rig: &mut Rig, protocol: &Protocol, there: impl Fn(&Rig, &Screen) -> bool) {
    loop {
        let screen = rig.view().screen;
        if rig.ending.is_some() || there(rig, &screen) {
            return;
        }
        match screen {
            Screen::Form { .. } => {
                rig.wait(1.0);
                let answers = preferred(rig, &protocol.spaces[0]);
                rig.send(Input::Answer(answers));
            }
            Screen::Loading { .. } => {
                rig.wait(1.0);
            }
            _ => {
                rig.step();
            }
        }
    }
}

fn end(rig: &mut Rig, protocol: &Protocol) {
    go_on(rig, protocol, |_, _| false);
    assert_eq!(rig.ending, Some(Ending::Finished));
}

fn compared(rig: &Rig, protocol: &Protocol) -> Vec<RecordedPair> {
    let part = &protocol.parts[0].id;
    rig.session.history().compared(part, &protocol.spaces[0])
}

#[test]
fn a_search_after_a_fault_a_bad_trial_and_a_resume_is_the_one_without() {
    for rule in [
        MODEL,
        r#"{ name = "sobol", trials = 14 }"#,
        r#"{ name = "random", trials = 14 }"#,
    ] {
        let protocol = searching(rule);
        let mut calm = Rig::new(protocol.clone());
        end(&mut calm, &protocol);
        let expected = compared(&calm, &protocol);
        assert_eq!(expected.len(), 14);

        let mut rig = Rig::new(protocol.clone());
        // A fault in the second interval of the third trial.
        go_on(&mut rig, &protocol, |rig, screen| {
            done(rig) >= 2 && second(screen)
        });
        rig.send(Input::DeviceFault("no table for XQZ-7.12".to_owned()));
        // A trial that is marked as bad after its answer.
        go_on(&mut rig, &protocol, |rig, screen| {
            done(rig) >= 7 && reference(screen)
        });
        rig.send(Input::MarkBad {
            reason: "noise".to_owned(),
        });
        // The program ends during an interval, and again before an answer.
        go_on(&mut rig, &protocol, |rig, screen| {
            done(rig) >= 9 && second(screen)
        });
        rig.send(Input::Quit);
        let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 60.0);
        go_on(&mut rig, &protocol, |rig, screen| {
            done(rig) >= 11 && answering(screen)
        });
        rig.send(Input::Abort("power".to_owned()));
        let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 60.0);
        end(&mut rig, &protocol);
        assert_eq!(compared(&rig, &protocol), expected, "{rule}");
    }
}

/// The program ends after any event, and another one, which knows nothing but the journal, goes on: it proposes the pairs that
/// would have come.
#[test]
fn a_search_is_picked_up_after_every_single_event() {
    let protocol = searching(MODEL);
    let mut calm = Rig::new(protocol.clone());
    end(&mut calm, &protocol);
    let expected = compared(&calm, &protocol);
    for k in 1..calm.journal.len() {
        let journal = &calm.journal[..k];
        let mut rig = Rig::back(protocol.clone(), journal.to_vec(), 30.0);
        end(&mut rig, &protocol);
        assert_eq!(rig.journal[..k], *journal, "append only");
        assert_eq!(compared(&rig, &protocol), expected, "after {k} events");
    }
}

/// A search is one block: restarting it would lose all of its answers.
#[test]
fn a_search_is_not_restarted_after_a_long_gap() {
    let protocol = searching(MODEL);
    let mut rig = Rig::new(protocol.clone());
    go_on(&mut rig, &protocol, |rig, screen| {
        done(rig) >= 6 && reference(screen)
    });
    rig.send(Input::Quit);
    let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 9.0 * 3600.0);
    rig.identify();
    let restart = |rig: &Rig| match rig.view().screen {
        Screen::ResumeChoice { restart, .. } => Some(restart),
        _ => None,
    };
    assert_eq!(restart(&rig), Some(false));
    rig.send(Input::Resume(Choice::RestartBlock));
    assert_eq!(restart(&rig), Some(false));
    assert!(
        rig.view()
            .notice
            .unwrap()
            .contains("a search is not restarted")
    );
    rig.send(Input::Resume(Choice::Continue));
    assert_eq!(compared(&rig, &protocol).len(), 6);
    end(&mut rig, &protocol);
    assert_eq!(
        rig.journal
            .iter()
            .filter(|e| matches!(e.event, Event::TrialDone { .. }))
            .count(),
        14
    );
}

/// A device that fails whenever it plays one point costs two attempts, and no trial.
#[test]
fn a_search_goes_on_without_a_point_at_which_the_device_fails() {
    for rule in [
        MODEL,
        r#"{ name = "sobol", trials = 14 }"#,
        r#"{ name = "random", trials = 14 }"#,
    ] {
        let protocol = searching(rule);
        let mut calm = Rig::new(protocol.clone());
        end(&mut calm, &protocol);
        let space = &protocol.spaces[0];
        // The second point of a pair of the first trials, and one of a pair that the answers chose.
        for at in [2, 9] {
            let refused = space.realization(compared(&calm, &protocol)[at].pair[1]);
            let plays = |rig: &Rig, screen: &Screen| {
                let playing = matches!(screen, Screen::Playing { .. });
                playing && rig.session.playing_model() == Some(&refused)
            };
            let mut rig = Rig::new(protocol.clone());
            go_on(&mut rig, &protocol, plays);
            rig.send(Input::DeviceFault("too fast".to_owned()));
            go_on(&mut rig, &protocol, plays);
            rig.send(Input::DeviceFault("too fast".to_owned()));
            let left_out = |rig: &Rig| rig.count(|e| matches!(e, Event::PointLeftOut { .. }));
            assert_eq!(left_out(&rig), 1, "{rule}");
            // A trial that is marked as bad is felt again without the point.
            go_on(&mut rig, &protocol, |rig, screen| {
                done(rig) >= 1 && reference(screen)
            });
            rig.send(Input::MarkBad {
                reason: "noise".to_owned(),
            });
            rig.send(Input::Quit);
            let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 60.0);
            go_on(&mut rig, &protocol, plays);
            assert_eq!(rig.ending, Some(Ending::Finished), "{rule}");
            assert_eq!(left_out(&rig), 1, "{rule}");
            assert_eq!(rig.closed().values().flatten().count(), 14, "{rule}");
            assert_eq!(verified(&protocol, &rig.journal), [""; 0], "{rule}");
        }
    }
}

#[test]
fn a_model_learns_and_the_order_of_the_two_is_the_planned_one() {
    let protocol = searching(MODEL);
    let mut rig = Rig::new(protocol.clone());
    end(&mut rig, &protocol);
    let space = &protocol.spaces[0];
    let mut swaps = [0, 0];
    for (trial, attempt) in rig.session.history().searched(&protocol.parts[0].id) {
        let Stimuli::Search { swapped, .. } = trial.stimuli else {
            panic!("{trial:?}");
        };
        let points: Vec<usize> = (attempt.models.iter())
            .map(|model| space.point_of(model).unwrap())
            .collect();
        assert_eq!(points[0] > points[1], swapped);
        swaps[usize::from(swapped)] += 1;
    }
    assert!(swaps.iter().all(|n| *n >= 3), "{swaps:?}");
    let part = &protocol.parts[0];
    let seat = rig.session.history().start().unwrap().seat;
    let mut search = protocol.start_search(part, seat).unwrap().unwrap();
    for recorded in compared(&rig, &protocol) {
        assert_eq!(search.next(), Some(recorded.pair));
        search.answer(&recorded.answer().unwrap());
    }
    let best = search.best_point().unwrap();
    assert_eq!(space.levels(best), [1.25, 0.375]);
    // Realizations stand in the intervals, and the answers in a column of the part's name.
    let rows = rig.session.history().rating_rows(&protocol);
    assert_eq!(rows.len(), 14);
    assert!(
        rows.iter()
            .all(|r| r.model.is_none() && r.answers.len() == 1)
    );
    let starts =
        rig.count(|e| matches!(e, Event::AttemptStarted { intervals, .. } if intervals.len() == 2));
    assert_eq!(starts, 14);
}

/// What `study verify` says of the searches in a journal.
fn verified(protocol: &Protocol, journal: &[Entry]) -> Vec<String> {
    let home = tempfile::tempdir().unwrap();
    let files = [("protocol.toml".to_owned(), b"the protocol".to_vec())];
    let fingerprints = world::fingerprints();
    let frozen = Frozen {
        protocol,
        files: &files,
        fingerprints: &fingerprints,
    };
    let folder = StudyFolder::open_or_create(home.path(), &frozen, world::at(0)).unwrap();
    let mut claimed = folder.claim(&world::real("P01")).unwrap();
    let mut written = claimed.folder.journal().unwrap();
    for entry in journal {
        written.append(entry.at, &entry.event).unwrap();
    }
    drop(written);
    let found = folder.verify(Some(protocol)).unwrap();
    let texts = found.into_iter().filter(|f| f.is_problem).map(|f| f.what);
    texts.filter(|what| what.starts_with("search")).collect()
}

#[test]
fn verify_finds_pairs_that_the_rule_would_not_propose() {
    let protocol = searching(MODEL);
    let mut rig = Rig::new(protocol.clone());
    end(&mut rig, &protocol);
    assert_eq!(verified(&protocol, &rig.journal), [""; 0]);
    let changed = |trial: u32, change: fn(&SpaceRules, &mut Vec<ModelId>)| {
        let mut journal = rig.journal.clone();
        for entry in &mut journal {
            if let Event::AttemptStarted {
                trial: own,
                intervals,
                ..
            } = &mut entry.event
                && *own == trial
            {
                change(&protocol.spaces[0], intervals);
            }
        }
        verified(&protocol, &journal)
    };
    let [turned] = &changed(9, |_, intervals| intervals.reverse())[..] else {
        panic!("two");
    };
    assert_eq!(
        turned,
        "search `best`: trial 9 does not present two points of its space in the planned order"
    );
    let another = |space: &SpaceRules, intervals: &mut Vec<ModelId>| {
        // The other point stays, and which of the two has the higher number.
        let points = [0, 1].map(|i| space.point_of(&intervals[i]).unwrap());
        let low = usize::from(points[1] < points[0]);
        let next = if points[low] == 0 { 1 } else { points[low] - 1 };
        intervals[low] = space.realization(next);
    };
    let [other] = &changed(12, another)[..] else {
        panic!("two");
    };
    assert!(
        other.starts_with("search `best`: trial 12 of the search compares the points"),
        "{other}"
    );
    let [foreign] = &changed(3, |_, intervals| intervals[0] = world::model("XQZ-7.99"))[..] else {
        panic!("two");
    };
    assert!(foreign.contains("trial 3 does not present"), "{foreign}");
}
