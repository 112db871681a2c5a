//! Questionnaires between the trials that are answered after a pause: kept, and marked where it was too long.

use super::between::asked;
use super::retraced::{assert_equal, record};
use super::rig::{Rig, StoreMood};
use super::studies::{plain, qid, rich};
use chrono::TimeDelta;
use std::sync::Arc;
use study_analysis::analyze::Include;
use study_analysis::analyze::psychophysics::{StudyData, parts};
use study_plan::protocol::{Answer, Occasion, Protocol};
use study_session::outcome::{Event, FormId, RatingRow};
use study_session::session::{Input, Screen, retrace};

fn load() -> Protocol {
    asked(plain(), Occasion::Condition)
}

/// Whether a questionnaire between the trials is on the screen.
fn asks(rig: &Rig) -> bool {
    let screen = rig.view().screen;
    matches!(
        screen,
        Screen::Form {
            form: FormId::After { .. },
            ..
        }
    )
}

/// A session at the first page of the questionnaire after its first trial.
fn asking(protocol: &Protocol) -> Rig {
    let mut rig = Rig::new(protocol.clone());
    until_asked(&mut rig);
    rig
}

fn until_asked(rig: &mut Rig) {
    while !asks(rig) {
        assert!(rig.ending.is_none());
        rig.step();
    }
}

fn pause(rig: &mut Rig, seconds: f64) {
    rig.send(Input::Pause).wait(seconds).send(Input::Advance);
}

/// The pauses that the journal has, and whether they were too long.
fn delays(rig: &Rig) -> Vec<(Option<f64>, bool)> {
    let delayed = rig.events().filter_map(|event| match event {
        Event::FormDelayed {
            trial: 1,
            paused_s,
            late,
            ..
        } => Some((paused_s.map(f64::round), *late)),
        _ => None,
    });
    delayed.collect()
}

/// The row of the first trial, once the session is over; both items are answered, and no trial was felt again.
fn row(rig: &mut Rig, protocol: &Protocol) -> RatingRow {
    rig.finish();
    rig.assert_whole();
    let failed = |e: &Event| matches!(e, Event::AttemptFailed { .. });
    assert_eq!(rig.count(failed), 0);
    let row = rig.session.history().rating_rows(protocol).remove(0);
    for item in ["load_mental", "load_effort"] {
        assert_eq!(row.answers.get(&qid(item)), Some(&Answer::Rating(4)));
    }
    row
}

#[test]
fn a_pause_is_recorded_and_beyond_the_longest_one_it_is_late() {
    let protocol = load();
    for (seconds, late) in [(0.0, None), (30.0, Some(false)), (62.0, Some(true))] {
        let mut rig = asking(&protocol);
        pause(&mut rig, seconds);
        let row = row(&mut rig, &protocol);
        let expected: Vec<_> = late
            .map(|late| (Some(seconds.round()), late))
            .into_iter()
            .collect();
        assert_eq!(delays(&rig), expected, "{seconds} s");
        let paused_s = row.questionnaire_paused_s.map(f64::round);
        assert_eq!(paused_s, late.map(|_| seconds.round()));
        assert_eq!(row.questionnaire_late, late.filter(|late| *late));
        // The pause does not count as one of the trial.
        assert_eq!(row.paused_s, None);
    }
}

/// Each page of the form may be answered after a pause; they add up.
#[test]
fn pauses_of_one_form_add_up() {
    let protocol = load();
    let mut rig = asking(&protocol);
    pause(&mut rig, 40.0);
    rig.answer_page();
    assert!(asks(&rig));
    pause(&mut rig, 40.0);
    let row = row(&mut rig, &protocol);
    assert_eq!(delays(&rig), [(Some(40.0), false), (Some(40.0), true)]);
    assert_eq!(row.questionnaire_paused_s.map(f64::round), Some(80.0));
    assert_eq!(row.questionnaire_late, Some(true));
}

/// The protocol says how long a pause may be.
#[test]
fn the_longest_pause_is_that_of_the_protocol() {
    for (longest_pause_s, late) in [(10.0, Some(true)), (600.0, None)] {
        let mut protocol = load();
        protocol.session.longest_pause_s = longest_pause_s;
        let mut rig = asking(&protocol);
        pause(&mut rig, 90.0);
        assert_eq!(row(&mut rig, &protocol).questionnaire_late, late);
    }
}

/// The program was left: before the form, and between two of its pages.
#[test]
fn a_form_that_is_answered_hours_later_is_late_and_nothing_is_lost() {
    let protocol = load();
    for pages in [0, 1] {
        let mut rig = asking(&protocol);
        for _ in 0..pages {
            rig.answer_page();
        }
        rig.send(Input::Quit);
        let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 3.0 * 3600.0);
        rig.identify();
        assert!(asks(&rig), "{:?}", rig.view().screen);
        let row = row(&mut rig, &protocol);
        let [(Some(paused_s), true)] = delays(&rig)[..] else {
            panic!("{:?}", delays(&rig))
        };
        assert!((paused_s - 3.0 * 3600.0).abs() < 60.0, "{paused_s}");
        assert_eq!(row.questionnaire_late, Some(true));
        // Those of the next trials are not.
        let rows = rig.session.history().rating_rows(&protocol);
        let others = &rows[1..];
        assert!(others.iter().all(|row| row.questionnaire_late.is_none()));
    }
}

/// The program ended between the answer to the trial and the form.
#[test]
fn a_form_that_was_never_on_the_screen_is_late_too() {
    let protocol = load();
    let rig = asking(&protocol);
    let done = |e: &Event| matches!(e, Event::TrialDone { .. });
    let length = 1 + rig.journal.iter().position(|e| done(&e.event)).unwrap();
    let mut rig = Rig::back(protocol.clone(), rig.journal[..length].to_vec(), 600.0);
    rig.identify();
    assert_eq!(row(&mut rig, &protocol).questionnaire_late, Some(true));
}

#[test]
fn a_pause_of_unknown_length_is_too_long() {
    let protocol = load();
    let rig = asking(&protocol);
    let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), -600.0);
    rig.identify();
    let row = row(&mut rig, &protocol);
    assert_eq!(delays(&rig), [(None, true)]);
    assert_eq!(
        (row.questionnaire_paused_s, row.questionnaire_late),
        (None, Some(true))
    );
}

/// A process that stood still, a computer that was suspended, and a disk that did not write.
#[test]
fn whatever_comes_between_is_a_pause() {
    let protocol = load();
    let stood_still = |rig: &mut Rig| {
        rig.send(Input::StoodStill { seconds: 90.0 });
    };
    let suspended = |rig: &mut Rig| {
        rig.now.wall += TimeDelta::seconds(90);
        rig.send(Input::Tick);
    };
    let disk = |rig: &mut Rig| {
        rig.send(Input::SaveFailed("disk full".to_owned()));
        rig.wait(90.0);
        rig.store = StoreMood::Prompt;
        rig.send(Input::RetrySave);
    };
    let between = [
        ("stood still", &stood_still as &dyn Fn(&mut Rig)),
        ("suspended", &suspended),
        ("disk", &disk),
    ];
    for (what, happens) in between {
        let mut rig = asking(&protocol);
        happens(&mut rig);
        assert!(asks(&rig), "{what}");
        rig.answer_page();
        assert_eq!(delays(&rig), [(Some(90.0), true)], "{what}");
    }
}

/// A trial that is felt again has a form of its own, which is answered in time.
#[test]
fn a_condition_that_is_felt_again_is_marked_anew() {
    let protocol = load();
    let mut rig = asking(&protocol);
    pause(&mut rig, 100.0);
    rig.answer_page();
    assert_eq!(delays(&rig), [(Some(100.0), true)]);
    rig.send(Input::MarkBad {
        reason: "noise".to_owned(),
    });
    rig.finish();
    rig.assert_whole();
    let rows = rig.session.history().rating_rows(&protocol);
    assert_eq!(
        (rows[0].attempt, rows[0].questionnaire_late),
        (Some(2), None)
    );
}

/// Time on an open page is no pause, here as with ratings.
#[test]
fn reading_and_thinking_are_no_pause() {
    let protocol = load();
    let mut rig = asking(&protocol);
    rig.wait(300.0);
    row(&mut rig, &protocol);
    assert_eq!(delays(&rig), []);
}

const FROM_MEMORY: &str = "1 questionnaire was answered from memory, after pauses of more than 60 s, at most 100 s; it is \
                           counted, and marked in `questionnaire_late`";

#[test]
fn the_analysis_says_how_many_are_from_memory() {
    let protocol = load();
    for (seconds, expected) in [(30.0, None), (100.0, Some(FROM_MEMORY))] {
        let mut rig = asking(&protocol);
        pause(&mut rig, seconds);
        rig.finish();
        let history = rig.session.history();
        let start = history.start().unwrap();
        let study = StudyData {
            protocol: &protocol,
            rows: &history.rating_rows(&protocol),
            intervals: &[],
            participants: &[history.participant_row(&start.participant, 1)],
            sessions: &[history],
            pools: false,
        };
        let found = parts(&study, Include::default());
        let own = found.iter().find(|part| part.part.as_str() == "load");
        let mut warnings = own.unwrap().warnings.iter();
        let late = warnings.find(|w| w.code == "late-questionnaires");
        assert_eq!(late.map(|w| w.text.as_str()), expected);
    }
}

#[test]
fn a_form_after_a_pause_is_retraced_as_it_was_shown() {
    let protocol = asked(rich(), Occasion::Condition);
    let mut rig = Rig::new(protocol.clone());
    (rig.pages, rig.watched) = (Some(Vec::new()), false);
    until_asked(&mut rig);
    pause(rig.wait(1.0), 100.0);
    rig.answer_page();
    pause(rig.wait(1.0), 2.0);
    rig.finish();
    let delayed = |e: &Event| matches!(e, Event::FormDelayed { .. });
    assert_eq!(rig.count(delayed), 2);
    let protocol = Arc::new(protocol);
    let mut again = Vec::new();
    for page in retrace::pages(&|_| protocol.clone(), &rig.journal) {
        record(&mut again, &page.view);
    }
    assert_equal(rig.pages.as_ref().unwrap(), &again);
}
