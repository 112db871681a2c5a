//! The device stops, fails, is silent or lies, in each phase.

use super::rig::{DeviceMood, Rig, name};
use super::studies::{plain, rich};
use study_base::text::ModelId;
use study_plan::protocol::DeviceKind;
use study_session::outcome::{Defect, Event, Failure, Fidelity, Playback, Verdict};
use study_session::session::view::{DeviceState, Telemetry};
use study_session::session::{Effect, Input, Screen};

/// A session whose device waits in the phase of this screen, in the first trial.
pub(super) fn in_phase(screen: &str) -> Rig {
    let mut rig = Rig::new(plain());
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance);
    if screen != "Loading" {
        rig.send(Input::DeviceLoaded);
    }
    if !["Loading", "Ready"].contains(&screen) {
        rig.send(Input::DeviceStarted);
    }
    if screen == "Stopping" {
        rig.send(Input::Advance);
    }
    rig.effects.clear();
    rig
}

pub(super) fn failures(rig: &Rig) -> Vec<(u32, u32, Failure)> {
    rig.events()
        .filter_map(|e| match e {
            Event::AttemptFailed {
                trial,
                attempt,
                failure,
                ..
            } => Some((*trial, *attempt, *failure)),
            _ => None,
        })
        .collect()
}

pub(super) fn screen(rig: &Rig) -> &'static str {
    name(&rig.view().screen)
}

#[test]
fn a_fault_in_any_phase_of_playing_sends_the_trial_to_the_end_of_its_block() {
    for phase in ["Loading", "Ready", "Playing", "Stopping"] {
        let mut rig = in_phase(phase);
        rig.send(Input::DeviceFault("too hot".to_owned()));
        assert_eq!(rig.effects[0], Effect::Limp, "{phase}");
        assert_eq!(failures(&rig), [(1, 1, Failure::DeviceFault)], "{phase}");
        let queue = rig.events().find_map(|e| match e {
            Event::AttemptFailed { queue, .. } => Some(queue.clone()),
            _ => None,
        });
        assert_eq!(queue.unwrap(), [2, 3, 1, 4, 5, 6], "{phase}");
        let view = rig.view();
        // Before it plays, the reason may be about the table.
        let words = match phase {
            "Loading" | "Ready" => "the device does not play this trial",
            _ => "too hot",
        };
        assert!(
            matches!(&view.screen, Screen::DeviceTrouble { what, can_go_on: true } if what.starts_with(words))
        );
        assert_eq!(view.line.device, DeviceState::Fault);
        assert!(!view.armed);
        rig.send(Input::Advance);
        assert_eq!(screen(&rig), "Reference");
        rig.finish();
        rig.assert_whole();
    }
}

#[test]
fn a_lost_device_has_to_come_back_first() {
    for phase in ["Loading", "Ready", "Playing", "Stopping"] {
        let mut rig = in_phase(phase);
        rig.send(Input::DeviceLost("unplugged".to_owned()));
        assert_eq!(rig.effects[0], Effect::Limp, "{phase}");
        assert_eq!(failures(&rig), [(1, 1, Failure::PlaybackLost)], "{phase}");
        assert_eq!(rig.view().line.device, DeviceState::Lost);
        rig.send(Input::Advance);
        assert_eq!(screen(&rig), "DeviceTrouble");
        rig.send(Input::DeviceReady);
        assert_eq!(
            screen(&rig),
            "DeviceTrouble",
            "the operator goes on, not the device"
        );
        rig.send(Input::Advance);
        assert_eq!(screen(&rig), "Reference");
        rig.finish();
        rig.assert_whole();
    }
}

#[test]
fn trouble_while_nothing_plays_costs_no_attempt_and_no_rating() {
    let mut rig = Rig::new(plain());
    rig.until("Form")
        .send(Input::DeviceFault("too hot".to_owned()));
    assert_eq!(
        screen(&rig),
        "Form",
        "a half-typed comment is not taken away"
    );
    assert!(rig.view().notice.unwrap().contains("too hot"));
    rig.answer_page();
    assert_eq!(screen(&rig), "DeviceTrouble");
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Reference");
    rig.send(Input::DeviceLost("unplugged".to_owned()));
    rig.send(Input::Advance)
        .send(Input::DeviceReady)
        .send(Input::Advance);
    assert_eq!(screen(&rig), "Reference");
    assert_eq!(failures(&rig), []);
    rig.finish();
    rig.assert_whole();
}

#[test]
fn a_form_tells_of_a_lost_device_as_long_as_it_is_lost() {
    let mut rig = Rig::new(plain());
    rig.until("Form")
        .send(Input::DeviceLost("unplugged".to_owned()));
    assert_eq!(rig.view().notice.unwrap(), "device: unplugged");
    rig.send(Input::Stop).wait(60.0);
    assert_eq!(rig.view().notice.unwrap(), "device: unplugged");
    rig.send(Input::DeviceReady);
    assert_eq!(rig.view().notice, None);
    assert_eq!(rig.view().line.device, DeviceState::Limp);
    // nothing was lost, so nothing is left to be confirmed
    rig.answer_page();
    assert_eq!(screen(&rig), "Reference");
}

#[test]
fn between_trials_the_trouble_is_told_once() {
    let mut rig = Rig::new(plain());
    rig.until("Reference")
        .send(Input::DeviceLost("unplugged".to_owned()));
    assert_eq!(screen(&rig), "DeviceTrouble");
    assert_eq!(rig.view().notice, None);
}

/// Nothing is said of a device where there is none, and nothing of counts that
/// nobody makes.
#[test]
fn a_sample_is_neither_limp_nor_counted() {
    let mut protocol = plain();
    protocol.device.kind = DeviceKind::Manual;
    let mut rig = Rig::new(protocol);
    rig.telemetry = false;
    rig.until("Reference");
    let states = |rig: &Rig| (rig.view().line.device, rig.view().device);
    assert_eq!(states(&rig), (DeviceState::ByHand, DeviceKind::Manual));
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance)
        .send(Input::DeviceMount("417".to_owned()));
    assert_eq!(states(&rig), (DeviceState::ByHand, DeviceKind::Manual));
    rig.send(Input::Advance);
    rig.session.handle(Input::DeviceStarted, rig.now);
    assert_eq!(states(&rig), (DeviceState::Felt, DeviceKind::Manual));

    // among tables: the device is limp while somebody has their hands in it
    let mut protocol = plain();
    for model in &mut protocol.models {
        model.device = Some(DeviceKind::Manual);
    }
    let mut rig = Rig::new(protocol);
    rig.until("Reference");
    assert_eq!(states(&rig), (DeviceState::Limp, DeviceKind::Simulated));
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance)
        .send(Input::DeviceMount("417".to_owned()));
    assert_eq!(states(&rig), (DeviceState::Limp, DeviceKind::Manual));
    rig.send(Input::Advance);
    rig.session.handle(Input::DeviceStarted, rig.now);
    assert_eq!(states(&rig), (DeviceState::Felt, DeviceKind::Manual));

    // a controller without telemetry counts only if it says so
    let mut rig = Rig::new(plain());
    rig.telemetry = false;
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance).send(Input::DeviceLoaded);
    rig.send(Input::DeviceStarted);
    assert_eq!(
        rig.view().line.device,
        DeviceState::Running(Telemetry::None)
    );
    rig.send(Input::DeviceSampled);
    assert_eq!(
        rig.view().line.device,
        DeviceState::Running(Telemetry::Arrives)
    );
    rig.wait(0.6);
    assert_eq!(
        rig.view().line.device,
        DeviceState::Running(Telemetry::Silent)
    );
}

#[test]
fn nothing_is_loaded_while_the_device_is_away() {
    let mut rig = Rig::new(plain());
    rig.until("Form")
        .send(Input::DeviceLost("unplugged".to_owned()))
        .answer_page();
    rig.effects.clear();
    for _ in 0..3 {
        rig.send(Input::Advance);
        assert_eq!(screen(&rig), "DeviceTrouble");
    }
    assert_eq!(rig.effects, []);
}

#[test]
fn esc_stops_in_every_phase() {
    for phase in ["Loading", "Ready", "Playing", "Stopping"] {
        let mut rig = in_phase(phase);
        rig.send(Input::Stop);
        let first = if phase == "Playing" {
            Effect::Stop
        } else {
            Effect::Limp
        };
        assert_eq!(rig.effects[0], first, "{phase}");
        assert!(
            !rig.effects
                .iter()
                .any(|e| matches!(e, Effect::Load { .. } | Effect::Start)),
            "{phase}"
        );
    }
    for phase in ["Reference", "Form", "Break", "Message", "Consent", "End"] {
        let mut rig = Rig::new(rich());
        rig.until(phase);
        let before = screen(&rig);
        rig.effects.clear();
        rig.send(Input::Stop);
        assert_eq!(rig.effects, [Effect::Limp], "{phase}");
        assert_eq!(screen(&rig), before);
    }
}

#[test]
fn esc_before_it_plays_goes_back_to_the_prompt_and_costs_no_attempt() {
    let mut rig = in_phase("Loading");
    for attempt in 1..=5 {
        rig.send(Input::Stop);
        assert_eq!(screen(&rig), "Reference");
        assert_eq!(failures(&rig).last(), Some(&(1, attempt, Failure::Stopped)));
        rig.send(Input::Advance);
    }
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.positions(), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn a_late_answer_of_the_device_starts_nothing() {
    let mut rig = in_phase("Loading");
    rig.send(Input::Stop);
    rig.effects.clear();
    let late = rig.session.handle(Input::DeviceLoaded, rig.now);
    assert_eq!(late, []);
    let unasked = rig.session.handle(Input::DeviceStarted, rig.now);
    assert_eq!(
        unasked,
        [Effect::Limp],
        "a device that plays unasked is made limp"
    );
}

#[test]
fn a_stopped_playback_can_be_rated() {
    let mut rig = in_phase("Playing");
    let playback = rig.playback;
    rig.send(Input::Stop);
    assert_eq!(screen(&rig), "Stopping");
    rig.send(Input::DeviceStopped(playback));
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: true });
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Stopped", "Enter does not choose");
    rig.send(Input::RateStopped);
    assert_eq!(screen(&rig), "Form");
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.closed()[&1], Some(1));
}

/// A judgement with this verdict.
fn judged(verdict: Verdict) -> Input {
    Input::DeviceJudged(Box::new(Fidelity {
        verdict,
        defects: vec![Defect::OtherTable],
        nearest_model: Some(ModelId::new("spring").unwrap()),
        ..Fidelity::default()
    }))
}

#[test]
fn a_wrong_playback_fails_its_attempt_and_names_nothing() {
    let mut rig = in_phase("Playing");
    let playback = rig.playback;
    rig.send(Input::Advance);
    rig.send(judged(Verdict::Fault));
    rig.send(Input::DeviceStopped(playback));
    let Screen::DeviceTrouble { what, can_go_on } = rig.view().screen else {
        panic!("{:?}", rig.view().screen);
    };
    assert_eq!(what, "the device did not do what it was told");
    assert!(can_go_on);
    let failures: Vec<Event> = (rig.journal.iter().map(|e| e.event.clone()))
        .filter(|e| matches!(e, Event::AttemptFailed { .. }))
        .collect();
    let [
        Event::AttemptFailed {
            trial: 1,
            failure: Failure::Rendering,
            detail,
            ..
        },
    ] = &failures[..]
    else {
        panic!("{failures:?}");
    };
    assert_eq!(detail, "other-table");
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.closed()[&1], Some(2), "the second attempt counts");
}

#[test]
fn a_marked_playback_is_rated_and_the_next_has_its_own_judgement() {
    let mut rig = in_phase("Playing");
    let playback = rig.playback;
    rig.send(Input::Advance).send(judged(Verdict::Flag));
    rig.send(Input::DeviceStopped(playback));
    assert_eq!(screen(&rig), "Form");
    rig.finish();
    rig.assert_whole();
    let stored: Vec<Option<Verdict>> = (rig.journal.iter())
        .filter_map(|e| match &e.event {
            Event::PlaybackEnded { rendering, .. } => Some(rendering.as_deref().map(|r| r.verdict)),
            _ => None,
        })
        .collect();
    assert_eq!(stored[0], Some(Verdict::Flag));
    assert!(stored[1..].iter().all(Option::is_none), "{stored:?}");
}

#[test]
fn a_stopped_playback_can_be_played_again_at_once() {
    let mut rig = Rig::new(plain());
    rig.until("Playing");
    for attempt in 2..=6 {
        rig.send(Input::Stop);
        assert_eq!(screen(&rig), "Stopped");
        rig.send(Input::PlayAgain);
        assert_eq!(screen(&rig), "Playing");
        let last = rig.events().rev_find_attempt();
        assert_eq!(last, Some((1, attempt)));
    }
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.count(|e| matches!(e, Event::TrialClosed { .. })), 0);
    assert_eq!(rig.positions(), [1, 2, 3, 4, 5, 6], "it keeps its form");
}

trait LastAttempt {
    fn rev_find_attempt(self) -> Option<(u32, u32)>;
}

impl<'a, I: Iterator<Item = &'a Event>> LastAttempt for I {
    fn rev_find_attempt(self) -> Option<(u32, u32)> {
        self.filter_map(|e| match e {
            Event::AttemptStarted { trial, attempt, .. } => Some((*trial, *attempt)),
            _ => None,
        })
        .last()
    }
}

#[test]
fn esc_twice_is_limp_and_what_was_felt_cannot_be_rated_unless_it_is_confirmed() {
    let mut rig = in_phase("Playing");
    rig.send(Input::Stop).send(Input::Stop);
    assert_eq!(rig.effects, [Effect::Stop, Effect::Limp]);
    rig.wait(2.0);
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: false });
    rig.send(Input::RateStopped);
    assert_eq!(screen(&rig), "Stopped");
    assert!(rig.view().notice.is_some());
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.count(|e| matches!(e, Event::TrialClosed { .. })), 0);
}

#[test]
fn what_the_device_never_confirms_is_a_lost_playback() {
    for (phase, within_s) in [("Loading", 5.0), ("Ready", 5.0), ("Stopping", 2.0)] {
        let mut rig = in_phase(phase);
        rig.wait(within_s - 0.1);
        assert_eq!(failures(&rig), [], "{phase}");
        rig.wait(0.2);
        assert_eq!(rig.effects[0], Effect::Limp, "{phase}");
        assert_eq!(failures(&rig), [(1, 1, Failure::PlaybackLost)], "{phase}");
        assert_eq!(screen(&rig), "DeviceTrouble");
        let playback = rig.playback;
        rig.send(Input::DeviceStopped(playback))
            .send(Input::DeviceLoaded);
        assert_eq!(screen(&rig), "DeviceTrouble", "too late");
        rig.finish();
        rig.assert_whole();
    }
}

#[test]
fn playing_and_mounting_by_hand_have_no_time_limit() {
    let mut rig = in_phase("Playing");
    rig.wait(3600.0);
    assert_eq!(screen(&rig), "Playing");
    let mut protocol = plain();
    for model in &mut protocol.models {
        model.device = Some(DeviceKind::Manual);
    }
    let mut rig = Rig::new(protocol);
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance).wait(600.0);
    assert_eq!(screen(&rig), "Loading");
}

#[test]
fn after_the_last_attempt_the_trial_is_closed_and_the_session_goes_on() {
    let mut rig = Rig::new(plain());
    rig.until("Reference");
    let mut lost = 0;
    while rig.closed().len() < 6 {
        rig.until("Playing");
        let (trial, _) = rig.events().rev_find_attempt().unwrap();
        if trial == 2 {
            lost += 1;
            rig.send(Input::DeviceFault("again".to_owned()));
        } else {
            rig.step().until("Form").answer_page();
        }
    }
    assert_eq!(lost, 3, "max_attempts");
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.closed()[&2], None);
    assert_eq!(
        rig.count(|e| matches!(
            e,
            Event::TrialClosed {
                trial: 2,
                attempt: 3
            }
        )),
        1
    );
}

#[test]
fn a_place_that_breaks_max_run_is_flagged() {
    let mut protocol = plain();
    protocol.design.max_run = Some(1);
    let mut rig = Rig::new(protocol);
    rig.until_reference(5).step();
    rig.send(Input::DeviceFault("too hot".to_owned()));
    let flagged = rig.events().any(|e| {
        matches!(
            e,
            Event::AttemptFailed {
                trial: 6,
                constraint_broken: true,
                ..
            }
        )
    });
    assert!(flagged, "the last trial can only come right after itself");
}

#[test]
fn a_returned_trial_takes_the_position_at_which_it_is_felt() {
    let mut rig = in_phase("Playing");
    rig.device = DeviceMood::Willing;
    rig.send(Input::DeviceFault("too hot".to_owned()));
    rig.finish();
    rig.assert_whole();
    let mut first_block: Vec<(u32, u32)> = rig
        .events()
        .filter_map(|e| match e {
            Event::AttemptStarted {
                trial, position, ..
            } => Some((*trial, *position)),
            _ => None,
        })
        .collect();
    first_block.truncate(4);
    assert_eq!(first_block, [(1, 1), (2, 2), (3, 3), (1, 4)]);
}

#[test]
fn the_rating_waits_for_the_strokes_that_are_asked_for() {
    let mut rig = in_phase_with_strokes(4);
    let progress = |strokes| Input::DeviceProgress { strokes };
    rig.send(progress(2));
    assert!(matches!(
        rig.view().screen,
        Screen::Playing {
            keep_exploring: true,
            interval: None,
            ..
        }
    ));
    assert!(!rig.view().can_advance);
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Playing");
    assert!(rig.view().notice.unwrap() == "keep exploring");
    rig.send(progress(4)).send(Input::Advance);
    assert_eq!(screen(&rig), "Stopping");
    rig.send(Input::DeviceStopped(Playback {
        strokes: 4,
        ..Playback::default()
    }));
    assert_eq!(screen(&rig), "Form");
}

#[test]
fn too_few_strokes_cannot_be_rated_by_stopping_either() {
    let mut rig = in_phase_with_strokes(4);
    rig.send(Input::Stop).send(Input::DeviceStopped(Playback {
        strokes: 3,
        ..Playback::default()
    }));
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: false });
}

fn in_phase_with_strokes(minimum: u32) -> Rig {
    let mut protocol = plain();
    protocol.trial.minimum_strokes = minimum;
    let mut rig = Rig::new(protocol);
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance)
        .send(Input::DeviceLoaded)
        .send(Input::DeviceStarted);
    rig
}

#[test]
fn a_device_without_telemetry_is_not_asked_for_strokes() {
    let mut protocol = plain();
    protocol.trial.minimum_strokes = 4;
    let mut rig = Rig::new(protocol);
    rig.telemetry = false;
    rig.playback.strokes = 0;
    rig.until("Form");
}

#[test]
fn a_device_that_ends_by_itself_has_still_confirmed_the_end() {
    let mut rig = in_phase("Playing");
    let playback = rig.playback;
    rig.send(Input::DeviceStopped(playback));
    assert_eq!(screen(&rig), "Form");
}

#[test]
fn an_account_that_is_no_number_is_a_lost_playback() {
    let mut rig = in_phase("Stopping");
    rig.send(Input::DeviceStopped(Playback {
        least_energy_j: f64::NAN,
        ..Playback::default()
    }));
    assert_eq!(failures(&rig), [(1, 1, Failure::PlaybackLost)]);
    assert_eq!(screen(&rig), "DeviceTrouble");
}
