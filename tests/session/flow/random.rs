//! Whatever comes in, in whatever order: `rig` holds the walls.

use super::rig::{DeviceMood, Rig, StoreMood};
use super::studies::{qid, rich};
use proptest::prelude::*;
use study_plan::protocol::Answer;
use study_session::outcome::{Author, Choice, FormId, Playback};
use study_session::session::{Effect, Input, Screen};

/// What may happen next.
#[derive(Debug, Clone)]
pub(super) enum Act {
    /// The sensible thing.
    Step,
    Wait(f64),
    Send(Input),
    Device(DeviceMood),
    Store(StoreMood),
    /// The process dies and a new one comes back so many seconds later.
    Crash(f64),
}

fn input() -> impl Strategy<Value = Input> {
    let words = || prop_oneof![Just(String::new()), Just("why".to_owned()), ".{0,20}"];
    let form = prop_oneof![
        Just(FormId::Setup),
        Just(FormId::Intake),
        Just(FormId::Outro),
        (0..9u32, 1..4u32).prop_map(|(trial, attempt)| FormId::Trial { trial, attempt }),
    ];
    let question = prop_oneof![
        Just(qid("realism")),
        Just(qid("comment")),
        Just(qid("fatigue"))
    ];
    let answer = prop_oneof![
        (0..9i64).prop_map(Answer::Rating),
        any::<f64>().prop_map(Answer::Number),
        words().prop_map(Answer::Text),
        words().prop_map(|reason| Answer::Declined { reason }),
    ];
    let correction = (form, question.clone(), answer.clone(), words()).prop_map(
        |(form, question, answer, reason)| Input::Correct {
            form,
            question,
            answer,
            reason,
            by: Author::Experimenter,
        },
    );
    let remark = words().prop_map(|text| Input::Remark {
        by: Author::Participant,
        text,
    });
    let playback = (any::<f64>(), 0..9u32).prop_map(|(least_energy_j, strokes)| {
        Input::DeviceStopped(Playback {
            least_energy_j,
            strokes,
            ..Playback::default()
        })
    });
    let choice = prop_oneof![Just(Choice::RestartBlock), Just(Choice::Continue)];
    prop_oneof![
        Just(Input::Advance),
        Just(Input::Stop),
        Just(Input::Pause),
        Just(Input::PlayAgain),
        Just(Input::RateStopped),
        Just(Input::RetrySave),
        Just(Input::DeviceLoaded),
        Just(Input::DeviceStarted),
        Just(Input::DeviceReady),
        (0..9u32).prop_map(|strokes| Input::DeviceProgress { strokes }),
        words().prop_map(Input::DeviceFault),
        words().prop_map(Input::DeviceLost),
        words().prop_map(Input::SaveFailed),
        words().prop_map(|reason| Input::MarkBad { reason }),
        proptest::collection::vec((question, answer), 0..3).prop_map(Input::Answer),
        choice.prop_map(Input::Resume),
        playback,
        correction,
        remark,
    ]
}

pub(super) fn act() -> impl Strategy<Value = Act> {
    let mood = prop_oneof![Just(DeviceMood::Willing), Just(DeviceMood::Silent)];
    let store = prop_oneof![
        4 => Just(StoreMood::Prompt),
        1 => Just(StoreMood::Slow),
        1 => Just(StoreMood::Broken),
    ];
    prop_oneof![
        20 => Just(Act::Step),
        3 => (0..10_000u32).prop_map(|ms| Act::Wait(f64::from(ms) * 1e-3)),
        12 => input().prop_map(Act::Send),
        1 => mood.prop_map(Act::Device),
        1 => store.prop_map(Act::Store),
        1 => prop_oneof![Just(60.0), Just(40_000.0)].prop_map(Act::Crash),
    ]
}

/// After a stop, a pause or a failure, only a new wish loads or starts anything.
fn assert_unloaded(input: &Input, effects: &[Effect]) {
    let halting = matches!(
        input,
        Input::Stop
            | Input::Pause
            | Input::Quit
            | Input::Abort(_)
            | Input::DeviceFault(_)
            | Input::DeviceLost(_)
            | Input::SaveFailed(_)
            | Input::MarkBad { .. }
            | Input::Tick
    );
    if halting {
        for effect in effects {
            let goes = matches!(effect, Effect::Load { .. } | Effect::Start);
            assert!(!goes, "{effect:?} after {input:?}");
        }
    }
}

/// What the device reports by itself opens no rating, except that a playback has ended: without a
/// key nobody gets from "device ready" to a question about what was not felt.
fn assert_not_asked(before: &Screen, input: &Input, after: &Screen) {
    let waits = matches!(
        before,
        Screen::Reference { .. }
            | Screen::Loading { .. }
            | Screen::Playing { .. }
            | Screen::Stopped { .. }
            | Screen::DeviceTrouble { .. }
    );
    let report = matches!(
        input,
        Input::DeviceLoaded
            | Input::DeviceStarted
            | Input::DeviceReady
            | Input::DeviceProgress { .. }
            | Input::DeviceFault(_)
            | Input::DeviceLost(_)
    );
    let asked = matches!(
        after,
        Screen::Form {
            form: FormId::Trial { .. },
            ..
        }
    );
    assert!(
        !(waits && report && asked),
        "{input:?}: {before:?} to {after:?}"
    );
}

pub(super) fn perform(mut rig: Rig, act: Act) -> Rig {
    match act {
        Act::Step => {
            rig.step();
        }
        Act::Wait(seconds) => {
            rig.effects.clear();
            rig.wait(seconds);
            assert_unloaded(&Input::Tick, &rig.effects);
        }
        Act::Send(input) => {
            rig.effects.clear();
            let before = rig.view().screen;
            rig.send(input.clone());
            assert_unloaded(&input, &rig.effects);
            assert_not_asked(&before, &input, &rig.view().screen);
        }
        Act::Device(mood) => rig.device = mood,
        Act::Store(mood) => rig.store = mood,
        Act::Crash(gap_s) => {
            // What was not acknowledged may be lost.
            let kept = rig.before + usize::try_from(rig.on_disk).unwrap();
            rig = Rig::back(rich(), rig.journal[..kept].to_vec(), gap_s);
        }
    }
    rig
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 100,
        max_shrink_iters: 500,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_order_of_events_breaks_a_wall_or_keeps_a_session_from_its_end(
        acts in proptest::collection::vec(act(), 0..250)
    ) {
        let mut rig = Rig::new(rich());
        for act in acts {
            if rig.ending.is_some() {
                break;
            }
            rig = perform(rig, act);
            if matches!(rig.view().screen, Screen::Loading { .. } | Screen::Stopping) {
                prop_assert!(rig.view().armed);
            }
        }
        rig.finish();
        rig.assert_whole();
    }
}
