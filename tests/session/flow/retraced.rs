//! The pages that follow from a journal are those that were shown, byte by byte.

use super::between::asked;
use super::consent::signed;
use super::part_rig::{
    QUEST, STAIRCASE, adjustment, answering, beside_a_reference, finish, identification,
    magnitudes, pairs, reference, second, similarity, track, until,
};
use super::rig::Rig;
use super::studies::{plain, rich};
use proptest::prelude::*;
use std::sync::Arc;
use study_base::text::QuestionId;
use study_plan::protocol::{Answer, Occasion, Protocol, Turn};
use study_session::outcome::{Author, Entry, Event, FormId};
use study_session::page::{Kind, participant};
use study_session::session::retrace::{self, Shown};
use study_session::session::{Input, Screen, View};

/// Adds the page of a view, without times, if a participant reads it: not what passes, nor
/// a request to wait for the experimenter, whose reason need not be in the journal.
pub(super) fn record(pages: &mut Vec<String>, view: &View) {
    let Some(page) = participant(view) else {
        return;
    };
    // Its text is complete when the wait is over.
    let waits = page.kind == Kind::Reference && page.wait.is_some();
    if waits || matches!(page.kind, Kind::Wait | Kind::Stopping) {
        return;
    }
    let page = serde_json::to_string(&page.timeless()).unwrap();
    if pages.last() != Some(&page) {
        pages.push(page);
    }
}

/// A session whose pages are recorded.
fn recording(protocol: &Protocol) -> Rig {
    let mut rig = Rig::new(protocol.clone());
    (rig.pages, rig.watched) = (Some(Vec::new()), false);
    rig
}

/// Another process goes on with the session.
fn back(mut rig: Rig, protocol: &Protocol, after_s: f64) -> Rig {
    let pages = rig.pages.take();
    let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), after_s);
    (rig.pages, rig.watched) = (pages, false);
    rig
}

fn retraced(rig: &Rig, protocol: &Protocol) -> Vec<Shown> {
    let protocol = Arc::new(protocol.clone());
    retrace::pages(&|_| protocol.clone(), &rig.journal)
}

fn assert_same(rig: &Rig, protocol: &Protocol) {
    let mut again = Vec::new();
    for page in retraced(rig, protocol) {
        record(&mut again, &page.view);
    }
    assert_equal(rig.pages.as_ref().unwrap(), &again);
}

/// Names the first page that differs.
pub(super) fn assert_equal(shown: &[String], again: &[String]) {
    let differ = |(a, b): (&String, &String)| a != b;
    let apart = shown.iter().zip(again).position(differ);
    let apart = apart.unwrap_or(shown.len().min(again.len()));
    assert_eq!(
        shown.get(apart),
        again.get(apart),
        "page {apart} of {} and {}",
        shown.len(),
        again.len()
    );
    assert!(shown.len() > 10, "{}", shown.len());
}

#[test]
fn ratings_show_the_same_pages_again() {
    for protocol in [plain(), rich(), signed()] {
        let mut rig = recording(&protocol);
        rig.finish();
        assert_same(&rig, &protocol);
    }
}

/// Questionnaires between the trials, too: their pages belong to the trial in whose row they are.
#[test]
fn questionnaires_between_the_trials_show_the_same_pages_again() {
    for after in [Occasion::Condition, Occasion::Block] {
        let protocol = asked(rich(), after);
        let mut rig = recording(&protocol);
        rig.finish();
        assert_same(&rig, &protocol);
        let mut seen = 0;
        for page in retraced(&rig, &protocol) {
            if let Screen::Form {
                form: FormId::After { trial, attempt },
                ..
            } = page.view.screen
            {
                assert_eq!(page.of, Some((trial, attempt)));
                seen += 1;
            }
        }
        // Each of both questions of each form has a page.
        let given = |e: &Event| {
            matches!(
                e,
                Event::Answered {
                    form: FormId::After { .. },
                    ..
                }
            )
        };
        assert!(seen > 0);
        assert_eq!(seen, rig.count(given), "{after:?}");
    }
}

#[test]
fn each_kind_of_part_shows_the_same_pages_again() {
    let practice = "practice = [\"VVB-9\", \"XQZ-7\"]\nfeedback = \"always\"";
    for protocol in [
        pairs("tie = true"),
        track("2ifc", STAIRCASE, "easy = 0.1\nfeedback = true"),
        track("2ifc", QUEST, ""),
        identification(practice),
        beside_a_reference(),
        magnitudes(),
        similarity(""),
        adjustment("standard = 2.0\npractice = 1"),
    ] {
        let mut rig = recording(&protocol);
        finish(&mut rig);
        assert_same(&rig, &protocol);
    }
}

#[test]
fn faults_marks_and_resumptions_within_intervals_show_the_same_pages_again() {
    let protocol = track("2ifc", STAIRCASE, "");
    let mut rig = recording(&protocol);
    until(&mut rig, 2, second);
    rig.wait(0.5).send(Input::DeviceFault("no bus".to_owned()));
    until(&mut rig, 5, reference);
    rig.wait(0.5).send(Input::Pause);
    rig.wait(5.0).send(Input::Advance);
    rig.wait(0.5).send(Input::MarkBad {
        reason: "noise".to_owned(),
    });
    until(&mut rig, 8, second);
    rig.wait(0.5).send(Input::Quit);
    let mut rig = back(rig, &protocol, 600.0);
    until(&mut rig, 10, answering);
    rig.wait(0.5).send(Input::Abort("power".to_owned()));
    // Too long ago for an answer: it is felt again.
    let mut rig = back(rig, &protocol, 600.0);
    finish(&mut rig);
    assert_same(&rig, &protocol);
}

#[test]
fn what_is_felt_again_before_the_answer_shows_the_same_pages_again() {
    let protocol = pairs("exposure = { replays = 1 }");
    let mut rig = recording(&protocol);
    until(&mut rig, 1, answering);
    rig.wait(0.5).send(Input::PlayAgain);
    finish(&mut rig);
    assert_eq!(rig.count(|e| matches!(e, Event::Replayed { .. })), 1);
    assert_same(&rig, &protocol);
}

/// Changes, the standard again, a stop and the longest exposure.
#[test]
fn a_level_that_is_set_shows_the_same_pages_again() {
    let protocol = adjustment("standard = 2.0\nexposure = { max_s = 5 }");
    let mut rig = recording(&protocol);
    rig.until("Playing");
    for input in [
        Input::Advance,
        Input::Adjust(Turn::Higher),
        Input::Stop,
        Input::PlayAgain,
        Input::Adjust(Turn::Standard),
        Input::Advance,
        Input::Adjust(Turn::Lower),
    ] {
        rig.wait(0.5).send(input).wait(1.0);
    }
    rig.wait(5.0);
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: true });
    rig.wait(0.5).send(Input::RateStopped);
    finish(&mut rig);
    assert_eq!(rig.count(|e| matches!(e, Event::AttemptFailed { .. })), 0);
    assert_same(&rig, &protocol);
}

/// At each level the steps that were possible there, and not those of the level that came next.
#[test]
fn the_ends_of_a_ladder_are_shown_where_they_were() {
    let protocol = adjustment("");
    let mut rig = recording(&protocol);
    rig.until("Playing");
    let steps = |view: &View| {
        let own = view.adjusting.as_ref().unwrap();
        (own.can_lower, own.can_higher)
    };
    let mut seen = vec![steps(&rig.view())];
    while seen.last() == Some(&(true, true)) {
        rig.wait(0.5).send(Input::Adjust(Turn::Lower)).wait(1.0);
        seen.push(steps(&rig.view()));
    }
    assert_eq!(seen.last(), Some(&(false, true)));
    let pages = retraced(&rig, &protocol);
    let playing = pages.iter().map(|page| &page.view);
    let playing = playing.filter(|view| matches!(view.screen, Screen::Playing { .. }));
    assert_eq!(playing.map(steps).collect::<Vec<_>>(), seen);
}

/// Also where the program was left: the last page is the one that was on the screen.
#[test]
fn an_unfinished_session_ends_at_its_page() {
    let protocol = rich();
    for page in ["Form", "Reference", "Playing", "Break"] {
        let mut rig = recording(&protocol);
        rig.until(page);
        let last = retraced(&rig, &protocol).pop().unwrap();
        let (a, b) = (&last.view.screen, &rig.view().screen);
        assert_eq!(super::rig::name(a), super::rig::name(b), "{page}");
    }
}

#[test]
fn a_page_before_a_trial_belongs_to_the_attempt_that_follows() {
    let protocol = rich();
    let mut rig = recording(&protocol);
    rig.until_reference(2);
    rig.wait(3.0).send(Input::Advance);
    rig.wait(0.5).send(Input::DeviceFault("no bus".to_owned()));
    rig.finish();
    let mut seen = 0;
    for page in retraced(&rig, &protocol) {
        if !matches!(page.view.screen, Screen::Reference { .. }) {
            continue;
        }
        let later = rig.journal[page.after..]
            .iter()
            .find_map(|e| match e.event {
                Event::AttemptStarted { trial, attempt, .. } => Some((trial, attempt)),
                _ => None,
            });
        assert_eq!(page.of, later);
        seen += 1;
    }
    assert_eq!(
        seen,
        rig.count(|e| matches!(e, Event::AttemptStarted { .. }))
    );
}

#[test]
fn after_an_amendment_the_pages_have_its_words() {
    let protocol = rich();
    let mut amended = rich();
    "How real was it?".clone_into(&mut amended.questions[0].prompt);
    let mut rig = recording(&protocol);
    rig.until_reference(2).until("Form");
    rig.wait(0.5).send(Input::Quit);
    let mut rig = back(rig, &amended, 20.0);
    rig.finish();
    let [before, after] = [protocol, amended].map(Arc::new);
    let in_force = |entry: &Entry| match entry.event {
        Event::Reopened { .. } => after.clone(),
        _ => before.clone(),
    };
    let mut again = Vec::new();
    for page in retrace::pages(&in_force, &rig.journal) {
        record(&mut again, &page.view);
    }
    assert_eq!(rig.pages, Some(again));
}

#[test]
fn a_journal_without_its_start_has_no_pages() {
    let protocol = plain();
    let mut rig = recording(&protocol);
    rig.finish();
    rig.journal.remove(0);
    assert_eq!(retraced(&rig, &protocol), []);
    rig.journal.clear();
    assert_eq!(retraced(&rig, &protocol), []);
}

/// Whatever is missing from a journal: it ends, and shows what can be known.
#[test]
fn a_journal_with_gaps_is_retraced_to_its_end() {
    let protocol = rich();
    let mut rig = recording(&protocol);
    rig.finish();
    let whole = rig.journal.clone();
    for gap in 1..whole.len() {
        rig.journal.clone_from(&whole);
        rig.journal.remove(gap);
        let end = retraced(&rig, &protocol).pop().unwrap();
        assert!(end.after <= rig.journal.len(), "without record {gap}");
    }
}

/// What may happen next.
#[derive(Debug, Clone, Copy)]
enum Act {
    Step,
    /// The device is stopped; it is rated, or played again.
    Stop {
        rate: bool,
    },
    Pause,
    MarkBad,
    Fault,
    Remark,
    /// A page back, other answers.
    Back,
    /// The process dies and a new one comes back so many seconds later.
    Crash {
        after_s: f64,
    },
}

fn act() -> impl Strategy<Value = Act> {
    prop_oneof![
        20 => Just(Act::Step),
        2 => any::<bool>().prop_map(|rate| Act::Stop { rate }),
        1 => Just(Act::Pause),
        1 => Just(Act::MarkBad),
        1 => Just(Act::Fault),
        1 => Just(Act::Remark),
        2 => Just(Act::Back),
        1 => prop_oneof![Just(30.0), Just(900.0), Just(40_000.0)]
            .prop_map(|after_s| Act::Crash { after_s }),
    ]
}

/// Other answers than those of the page.
fn others(rig: &Rig) -> Vec<(QuestionId, Answer)> {
    let view = rig.view();
    let Screen::Form {
        form, questions, ..
    } = &view.screen
    else {
        return Vec::new();
    };
    let other = |given: &Answer| match given {
        Answer::Rating(4) => Answer::Rating(5),
        Answer::Rating(_) => Answer::Rating(4),
        Answer::Text(text) if text == "words" => Answer::Text("other words".to_owned()),
        Answer::Text(_) => Answer::Text("words".to_owned()),
        Answer::Number(n) => Answer::Number(n + 1.0),
        given => given.clone(),
    };
    let given = questions.iter().filter_map(|q| {
        let given = view.given(*form, &q.id)?;
        Some((q.id.clone(), other(given)))
    });
    given.collect()
}

/// Whether another process went on with the session since something was felt. Where the steps back lead then is not in the journal.
fn is_resumed(rig: &Rig) -> bool {
    let since =
        (rig.journal.iter().rev()).take_while(|e| !matches!(e.event, Event::PlaybackEnded { .. }));
    since
        .into_iter()
        .any(|e| matches!(e.event, Event::Reopened { .. }))
}

fn perform(mut rig: Rig, protocol: &Protocol, act: Act) -> Rig {
    rig.wait(0.01);
    let view = rig.view();
    let plays = matches!(view.screen, Screen::Playing { .. });
    // Nothing tells whether it was rated after a stop before the first answer.
    let done = |e: &&Entry| !matches!(e.event, Event::Remark { .. });
    let last = rig.journal.iter().rev().find(done);
    let traced =
        last.is_none_or(|e| !matches!(e.event, Event::PlaybackEnded { stopped: true, .. }));
    let is_asked = traced
        && matches!(
            view.screen,
            Screen::Form {
                form: FormId::Trial { .. },
                ..
            }
        );
    match act {
        Act::Step => {
            rig.step();
        }
        Act::Stop { rate } if plays => {
            rig.send(Input::Stop);
            rig.wait(0.01).send(match rate {
                true => Input::RateStopped,
                false => Input::PlayAgain,
            });
        }
        Act::Pause if plays || is_asked => {
            rig.send(Input::Pause);
            rig.wait(2.0).send(Input::Advance);
        }
        Act::MarkBad if plays || is_asked => {
            rig.send(Input::MarkBad {
                reason: "noise".to_owned(),
            });
        }
        Act::Fault if plays => {
            rig.send(Input::DeviceFault("no bus".to_owned()));
        }
        Act::Remark => {
            rig.send(Input::Remark {
                by: Author::Participant,
                text: "loud".to_owned(),
            });
        }
        Act::Back if view.can_go_back && !is_resumed(&rig) => {
            rig.send(Input::Back);
            rig.wait(0.01);
            let answers = others(&rig);
            rig.send(Input::Answer(answers));
        }
        // Elsewhere a text may have been passed, of which the journal has no trace.
        Act::Crash { after_s } if plays || is_asked => rig = back(rig, protocol, after_s),
        _ => {}
    }
    rig
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 250,
        max_shrink_iters: 500,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn sessions_with_stops_pauses_faults_corrections_and_crashes_show_the_same_pages_again(
        acts in proptest::collection::vec(act(), 0..120)
    ) {
        let protocol = rich();
        let mut rig = recording(&protocol);
        for act in acts {
            if rig.ending.is_some() {
                break;
            }
            rig = perform(rig, &protocol, act);
        }
        rig.finish();
        assert_same(&rig, &protocol);
    }
}
