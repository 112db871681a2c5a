//! Sessions of adjustment: each change is one step and an event, and what was felt last is the answer.

use super::part_rig::adjustment;
use super::rig::{DeviceMood, Rig};
use study_base::text::QuestionId;
use study_plan::protocol::{Answer, Protocol, Stimuli, Turn};
use study_session::outcome::{Event, Failure, FormId, fold};
use study_session::session::{Effect, Ending, Input, Screen};

/// The standard is step 21 of the ladder, 2.0.
const STANDARD: usize = 21;

fn asked() -> QuestionId {
    QuestionId::new("equal").unwrap()
}

/// The step of the ladder that plays, from 1.
fn step(rig: &Rig) -> usize {
    let model = rig.session.playing_model().unwrap().as_str();
    model.strip_prefix("damping.").unwrap().parse().unwrap()
}

/// The step at which the trial under way starts.
fn start(rig: &Rig) -> usize {
    let open = rig.session.history().open().unwrap();
    let Stimuli::Adjusted { start, .. } = &open.trial.stimuli else {
        panic!("{:?}", open.trial)
    };
    let number = start.as_str().strip_prefix("damping.").unwrap();
    number.parse().unwrap()
}

/// Does something while a level plays, and waits for the next.
fn does(rig: &mut Rig, input: Input) {
    rig.wait(1.0).send(input).wait(1.0);
}

fn changes(rig: &Rig) -> usize {
    rig.count(|e| matches!(e, Event::Adjusted { .. }))
}

/// The level that is the answer of a trial.
fn answer(rig: &Rig, trial: u32) -> Option<f64> {
    let (attempt, _) = rig.session.history().completion(trial)?;
    let form = FormId::Trial { trial, attempt };
    rig.session.history().answer(form, &asked())?.number()
}

#[test]
fn a_level_is_changed_step_by_step_and_confirmed() {
    let protocol = adjustment("standard = 2.0");
    let mut rig = Rig::new(protocol.clone());
    rig.until("Playing");
    // First the standard: nothing can be changed.
    assert_eq!(step(&rig), STANDARD);
    let shown = rig.view().adjusting.unwrap();
    assert!(shown.at_standard && shown.has_standard);
    assert_eq!(shown.prompt, "Until both feel equal.");
    does(&mut rig, Input::Adjust(Turn::Higher));
    assert_eq!((step(&rig), changes(&rig)), (STANDARD, 0));
    does(&mut rig, Input::Advance);
    let first = start(&rig);
    assert_eq!((step(&rig), changes(&rig)), (first, 0));
    assert!(matches!(
        rig.view().screen,
        Screen::Playing { interval: None, .. }
    ));
    does(&mut rig, Input::Adjust(Turn::Higher));
    does(&mut rig, Input::Adjust(Turn::Higher));
    does(&mut rig, Input::Adjust(Turn::Lower));
    assert_eq!((step(&rig), changes(&rig)), (first + 1, 3));
    // While one change is under way another one is none.
    rig.send(Input::Adjust(Turn::Higher));
    rig.send(Input::Adjust(Turn::Higher)).wait(1.0);
    assert_eq!((step(&rig), changes(&rig)), (first + 2, 4));
    // The standard again, and back to the same level.
    does(&mut rig, Input::Adjust(Turn::Standard));
    assert_eq!(step(&rig), STANDARD);
    assert!(rig.view().adjusting.unwrap().at_standard);
    does(&mut rig, Input::Advance);
    assert_eq!((step(&rig), changes(&rig)), (first + 2, 6));
    does(&mut rig, Input::Advance);
    let level = protocol.families[0].ladder.level(first + 1);
    assert_eq!(answer(&rig, 1), Some(level));
    let row = &rig.session.history().rating_rows(&protocol)[0];
    assert_eq!((row.level, row.model.as_ref()), (Some(level), None));
    // Every presentation has a row; all but those of the standard are the level.
    let rows = fold::interval_rows(rig.session.history(), &protocol);
    let rows: Vec<_> = rows.iter().filter(|row| row.trial == 1).collect();
    let felt: Vec<usize> = (rows.iter())
        .map(|row| {
            let model = row.model.as_ref().unwrap().as_str();
            model.strip_prefix("damping.").unwrap().parse().unwrap()
        })
        .collect();
    assert_eq!(
        felt,
        [
            STANDARD,
            first,
            first + 1,
            first + 2,
            first + 1,
            first + 2,
            STANDARD,
            first + 2
        ]
    );
    let of_level: Vec<bool> = rows.iter().map(|row| row.target.unwrap()).collect();
    assert_eq!(of_level, [false, true, true, true, true, true, false, true]);
    let numbers: Vec<u32> = rows.iter().map(|row| row.interval).collect();
    assert_eq!(numbers, (1..=8).collect::<Vec<_>>());
}

/// A change lets the force fall before it stops; a confirmation stops, and a stop during a change leaves no force at once.
#[test]
fn a_change_has_no_step_of_force_and_a_stop_is_a_stop() {
    let ends = |rig: &Rig| -> Vec<Effect> {
        let of_end = |e: &&Effect| matches!(e, Effect::Stop | Effect::Fade | Effect::Limp);
        rig.effects.iter().filter(of_end).cloned().collect()
    };
    let mut rig = Rig::new(adjustment("standard = 2.0\nexposure = { max_s = 5 }"));
    rig.until("Playing");
    for input in [
        // From the standard to the level, one step, the standard again, and back to the level.
        Input::Advance,
        Input::Adjust(Turn::Higher),
        Input::Adjust(Turn::Standard),
    ] {
        rig.wait(1.0).effects.clear();
        rig.send(input.clone());
        assert_eq!(ends(&rig), [Effect::Fade], "{input:?}");
        rig.wait(1.0);
    }
    // The end of the longest exposure of the standard is a change, too.
    rig.effects.clear();
    rig.wait(5.0).wait(1.0);
    assert_eq!(ends(&rig), [Effect::Fade]);
    // During a change.
    rig.device = DeviceMood::Silent;
    rig.effects.clear();
    rig.send(Input::Adjust(Turn::Higher)).send(Input::Stop);
    assert_eq!(ends(&rig), [Effect::Fade, Effect::Limp]);

    let mut rig = Rig::new(adjustment(""));
    rig.until("Playing");
    rig.wait(1.0).effects.clear();
    rig.send(Input::Advance);
    assert_eq!(ends(&rig), [Effect::Stop]);
}

/// Nothing that is shown has the level, and it cannot be typed later.
#[test]
fn what_was_set_is_not_shown_and_not_corrected() {
    let mut rig = Rig::new(adjustment("standard = 2.0"));
    rig.until("Playing");
    while rig.view().correctable.is_empty() && super::part_rig::done(&rig) == 0 {
        does(&mut rig, Input::Advance);
    }
    assert!(rig.view().correctable.is_empty());
    let before = rig.journal.len();
    rig.send(Input::Correct {
        form: FormId::Trial {
            trial: 1,
            attempt: 1,
        },
        question: asked(),
        answer: Answer::Number(3.0),
        reason: "a slip".to_owned(),
        by: study_session::outcome::Author::Experimenter,
    });
    assert_eq!(rig.journal.len(), before);
    assert!(rig.view().notice.is_some());
}

#[test]
fn the_ladder_has_ends() {
    let mut rig = Rig::new(adjustment(""));
    rig.until("Playing");
    let (turn, end) = match start(&rig) < STANDARD {
        true => (Turn::Lower, 1),
        false => (Turn::Higher, 41),
    };
    for _ in 0..50 {
        does(&mut rig, Input::Adjust(turn));
    }
    assert_eq!(step(&rig), end);
    assert_eq!(changes(&rig), start(&rig).abs_diff(end));
    let shown = rig.view().adjusting.unwrap();
    assert_eq!(
        (shown.can_lower, shown.can_higher, shown.has_standard),
        (end != 1, end != 41, false)
    );
    // Without a standard there is none to be felt.
    does(&mut rig, Input::Adjust(Turn::Standard));
    assert_eq!(step(&rig), end);
}

/// After a stop, or at the end of the longest exposure, the level is felt again or confirmed; the trial goes on.
#[test]
fn a_stopped_level_goes_on() {
    let mut rig = Rig::new(adjustment("exposure = { max_s = 5 }"));
    rig.until("Playing");
    let first = start(&rig);
    does(&mut rig, Input::Adjust(Turn::Higher));
    rig.send(Input::Stop);
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: true });
    rig.send(Input::PlayAgain).wait(1.0);
    assert_eq!(step(&rig), first + 1);
    rig.wait(5.0);
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: true });
    rig.send(Input::RateStopped);
    assert_eq!(rig.count(|e| matches!(e, Event::AttemptFailed { .. })), 0);
    let level = rig.session.history().answer(
        FormId::Trial {
            trial: 1,
            attempt: 1,
        },
        &asked(),
    );
    // 1 + 0.05 for each step.
    let set = level.and_then(Answer::number).unwrap();
    assert!((set - (1.0 + 0.05 * first as f64)).abs() < 1e-9, "{set}");
}

/// After the longest exposure of the standard the level comes, the first time and when it is felt again: nobody has to be
/// quicker than that. Nothing is confirmed.
#[test]
fn after_the_standard_comes_the_level() {
    let mut rig = Rig::new(adjustment("standard = 2.0\nexposure = { max_s = 5 }"));
    rig.until("Playing");
    for turn in [Turn::Higher, Turn::Lower] {
        assert_eq!(step(&rig), STANDARD);
        rig.wait(5.0).wait(1.0);
        let level = step(&rig);
        assert_ne!(level, STANDARD);
        assert!(!rig.view().adjusting.unwrap().at_standard);
        does(&mut rig, Input::Adjust(turn));
        let turned = step(&rig);
        assert_eq!(turned.abs_diff(level), 1);
        does(&mut rig, Input::Adjust(Turn::Standard));
    }
    assert_eq!(step(&rig), STANDARD);
    assert_eq!(rig.count(|e| matches!(e, Event::Answered { .. })), 0);
    // A stop is a stop.
    rig.wait(0.5).send(Input::Stop);
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: false });
}

/// A level is not compared with what was felt before a long pause: the trial then begins again.
#[test]
fn a_level_that_was_stopped_for_long_begins_again() {
    for (seconds, again) in [(40.0, false), (62.0, true)] {
        let mut rig = Rig::new(adjustment("standard = 2.0"));
        rig.until("Playing");
        does(&mut rig, Input::Advance);
        let first = start(&rig);
        does(&mut rig, Input::Adjust(Turn::Higher));
        assert_eq!(step(&rig), first + 1);
        rig.send(Input::Stop).wait(seconds);
        rig.send(Input::PlayAgain).wait(2.0);
        let failed = |e: &Event| matches!(e, Event::AttemptFailed { failure, .. } if *failure == Failure::Interrupted);
        assert_eq!(rig.count(failed), usize::from(again), "{seconds} s");
        rig.until("Playing");
        let expected = if again { STANDARD } else { first + 1 };
        assert_eq!(step(&rig), expected, "{seconds} s");
    }
}

/// A pause that is asked for during a change, and a table that is loaded at the very end of the gap: nothing plays before
/// the pause is over.
#[test]
fn nothing_plays_in_a_pause_that_began_during_a_change() {
    let mut rig = Rig::new(adjustment(""));
    rig.until("Playing");
    rig.device = DeviceMood::Silent;
    rig.wait(0.5).send(Input::Adjust(Turn::Higher));
    let playback = rig.playback;
    rig.send(Input::Pause).send(Input::DeviceStopped(playback));
    let starts = |rig: &Rig| rig.effects.iter().filter(|e| **e == Effect::Start).count();
    let before = starts(&rig);
    rig.wait(1.0).send(Input::DeviceLoaded).wait(5.0);
    assert!(matches!(rig.view().screen, Screen::Paused { .. }));
    assert_eq!(starts(&rig), before);
    rig.send(Input::Advance).wait(0.1);
    assert_eq!(starts(&rig), before + 1);
}

/// Towards the standard, one step at a time, and a fault and a stop on the way.
fn hand(rig: &mut Rig) {
    match rig.view().screen {
        Screen::Playing { .. } => {
            rig.wait(1.0);
            let at_standard = rig.view().adjusting.is_none_or(|own| own.at_standard);
            let input = match step(rig) {
                _ if at_standard => Input::Advance,
                at if at < STANDARD => Input::Adjust(Turn::Higher),
                at if at > STANDARD => Input::Adjust(Turn::Lower),
                _ => Input::Advance,
            };
            rig.send(input);
        }
        Screen::Loading { .. } => {
            rig.wait(1.0);
        }
        _ => {
            rig.step();
        }
    }
}

fn hand_to_the_end(rig: &mut Rig) {
    while rig.ending.is_none() {
        hand(rig);
    }
    assert_eq!(rig.ending, Some(Ending::Finished));
}

/// A session with a fault while a level is loaded and one while it plays, a stop, and a trial that is marked as bad.
fn eventful(protocol: &Protocol) -> Rig {
    let mut rig = Rig::new(protocol.clone());
    while changes(&rig) < 4 {
        hand(&mut rig);
    }
    rig.send(Input::DeviceFault("no bus".to_owned()));
    assert_eq!(rig.count(|e| matches!(e, Event::StepFailed { .. })), 1);
    while changes(&rig) < 7 || !matches!(rig.view().screen, Screen::Playing { .. }) {
        hand(&mut rig);
    }
    rig.send(Input::DeviceFault("no bus".to_owned()));
    while changes(&rig) < 9 || !matches!(rig.view().screen, Screen::Playing { .. }) {
        hand(&mut rig);
    }
    rig.send(Input::Stop);
    while super::part_rig::done(&rig) < 2 {
        hand(&mut rig);
    }
    rig.send(Input::MarkBad {
        reason: "noise".to_owned(),
    });
    hand_to_the_end(&mut rig);
    rig
}

/// The program ends after any event: a trial whose level was playing begins again, every trial has the level that was felt
/// last, and no change was larger than a step.
#[test]
fn a_session_is_picked_up_after_every_single_event() {
    let protocol = adjustment("standard = 2.0\npractice = 1");
    let whole = eventful(&protocol);
    let failed = whole.count(|e| matches!(e, Event::AttemptFailed { .. }));
    assert_eq!(failed, 2);
    let trials = whole.schedule().len() as u32;
    assert_eq!(trials, 1 + 2 * 2);
    for k in 1..whole.journal.len() {
        let journal = &whole.journal[..k];
        let mut rig = Rig::back(protocol.clone(), journal.to_vec(), 30.0);
        hand_to_the_end(&mut rig);
        assert_eq!(rig.journal[..k], *journal, "append only");
        for trial in 1..=trials {
            assert_eq!(
                answer(&rig, trial),
                Some(2.0),
                "trial {trial} after {k} events"
            );
        }
        let rows = fold::interval_rows(rig.session.history(), &protocol);
        for two in rows.windows(2) {
            let [a, b] = two else { panic!() };
            let same = (a.trial, a.attempt) == (b.trial, b.attempt);
            if same && a.target == Some(true) && b.target == Some(true) {
                let apart = (a.level.unwrap() - b.level.unwrap()).abs();
                assert!(apart < 0.05 + 1e-9, "{apart} after {k} events");
            }
        }
        let interrupted = |e: &Event| matches!(e, Event::AttemptFailed { failure, .. } if *failure == Failure::Interrupted);
        assert!(rig.count(interrupted) <= 1);
    }
}
