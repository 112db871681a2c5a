//! Steps of an adjustment that fail: the setting goes on from what was felt before, where that is known.

use super::part_rig::{adjustment, done};
use super::retraced::{assert_equal, record};
use super::rig::{DeviceMood, Rig, StoreMood};
use std::sync::Arc;
use study_analysis::analyze::Include;
use study_analysis::analyze::psychophysics::{StudyData, parts};
use study_base::text::ModelId;
use study_plan::protocol::{Answer, Protocol, Turn};
use study_session::outcome::{
    AttemptEvent, Defect, Event, Failure, Fidelity, FormId, Verdict, fold,
};
use study_session::session::{Effect, Input, Screen, retrace};

fn shown(rig: &Rig) -> &'static str {
    super::rig::name(&rig.view().screen)
}

/// What plays or was felt last.
fn level(rig: &Rig) -> ModelId {
    rig.session.playing_model().unwrap().clone()
}

fn steps_failed(rig: &Rig) -> Vec<Failure> {
    let failed = rig.events().filter_map(|event| match event {
        Event::StepFailed { failure, .. } => Some(*failure),
        _ => None,
    });
    failed.collect()
}

fn attempts_failed(rig: &Rig) -> usize {
    rig.count(|e| matches!(e, Event::AttemptFailed { .. }))
}

/// The level of the first trial that was confirmed.
fn set(rig: &Rig, protocol: &Protocol) -> Option<f64> {
    let form = FormId::Trial {
        trial: 1,
        attempt: 1,
    };
    let asked = &protocol.parts[0].asks[0];
    rig.session
        .history()
        .answer(form, asked)
        .and_then(Answer::number)
}

/// A session whose first level was changed once, and plays.
fn setting(protocol: &Protocol) -> Rig {
    let mut rig = Rig::new(protocol.clone());
    rig.until("Playing");
    while rig.view().adjusting.unwrap().at_standard {
        rig.wait(1.0).send(Input::Advance).wait(1.0);
    }
    rig.wait(1.0).send(Input::Adjust(Turn::Higher)).wait(1.0);
    assert_eq!(shown(&rig), "Playing");
    rig
}

/// Changes the level; the device stops and says nothing more.
fn turn(rig: &mut Rig, turn: Turn) {
    rig.device = DeviceMood::Silent;
    rig.wait(1.0).send(Input::Adjust(turn));
    let playback = rig.playback;
    rig.send(Input::DeviceStopped(playback));
    assert_eq!(shown(rig), "Loading");
}

/// Dismisses the fault, and feels the level again.
fn feel_again(rig: &mut Rig) {
    rig.device = DeviceMood::Willing;
    if shown(rig) == "DeviceTrouble" {
        rig.wait(1.0).send(Input::Advance);
    }
    assert_eq!(shown(rig), "Stopped");
    rig.wait(1.0).send(Input::PlayAgain).wait(1.0);
    assert_eq!(shown(rig), "Playing");
}

/// A judgement with this verdict.
fn judged(verdict: Verdict) -> Input {
    Input::DeviceJudged(Box::new(Fidelity {
        verdict,
        defects: vec![Defect::OtherTable],
        ..Fidelity::default()
    }))
}

/// Confirms the level that plays; the setting is that level.
fn confirm(rig: &mut Rig, protocol: &Protocol, expected: &ModelId) {
    assert_eq!(level(rig), *expected);
    rig.wait(1.0).send(Input::Advance);
    assert_eq!(done(rig), 1);
    assert_eq!(set(rig, protocol), protocol.level_of(expected));
}

/// A handle that does not come to rest takes no table.
#[test]
fn a_restless_handle_costs_a_step_and_not_the_setting() {
    for more in ["", "standard = 2.0"] {
        let protocol = adjustment(more);
        let mut rig = setting(&protocol);
        let before = level(&rig);
        turn(&mut rig, Turn::Higher);
        let after = level(&rig);
        assert_ne!(after, before);
        rig.wait(5.5);
        assert_eq!(shown(&rig), "DeviceTrouble");
        assert_eq!(steps_failed(&rig), [Failure::PlaybackLost]);
        let mut last = rig.effects.iter().rev().take(2);
        assert!(last.any(|effect| *effect == Effect::Limp));
        assert_eq!(level(&rig), before, "the change is taken back");
        rig.wait(1.0).send(Input::Advance);
        assert_eq!(rig.view().screen, Screen::Stopped { can_rate: true });
        feel_again(&mut rig);
        assert_eq!(level(&rig), before);
        // The same step, and this time the hand rests.
        rig.wait(1.0).send(Input::Adjust(Turn::Higher)).wait(1.0);
        confirm(&mut rig, &protocol, &after);
        assert_eq!(attempts_failed(&rig), 0);
        // Every presentation has a row, and no change was larger than a step.
        let rows = fold::interval_rows(rig.session.history(), &protocol);
        let own: Vec<_> = rows.iter().filter(|row| row.trial == 1).collect();
        let numbers: Vec<u32> = own.iter().map(|row| row.interval).collect();
        assert_eq!(numbers, (1..=own.len() as u32).collect::<Vec<_>>());
        let levels: Vec<f64> = (own.iter())
            .filter(|row| row.target == Some(true))
            .map(|row| row.level.unwrap())
            .collect();
        assert_eq!(levels.len(), 4);
        assert!(
            levels
                .windows(2)
                .all(|two| (two[0] - two[1]).abs() < 0.05 + 1e-9)
        );
        let history = rig.session.history();
        let who = &history.start().unwrap().participant;
        let log = fold::attempt_rows(history, who, 1, &rig.journal);
        let failed = log.iter().filter(|row| row.what == AttemptEvent::Failure);
        let said: Vec<&str> = failed.map(|row| row.text.as_str()).collect();
        assert_eq!(said.len(), 1);
        assert!(
            said[0].contains("did not confirm the table within 5 s"),
            "{said:?}"
        );
    }
}

/// Whoever stops, pauses, or has a full disk while the next level is loaded loses only that step.
#[test]
fn what_stops_a_change_takes_back_that_change() {
    for (input, after) in [
        (Input::Stop, "Stopped"),
        (Input::Pause, "Paused"),
        (Input::SaveFailed("disk full".to_owned()), "SaveTrouble"),
        (Input::DeviceFault("no bus".to_owned()), "DeviceTrouble"),
    ] {
        let protocol = adjustment("");
        let mut rig = setting(&protocol);
        let before = level(&rig);
        turn(&mut rig, Turn::Lower);
        if after == "SaveTrouble" {
            rig.store = StoreMood::Broken;
        }
        rig.wait(0.2).send(input);
        assert_eq!(shown(&rig), after);
        rig.store = StoreMood::Prompt;
        if matches!(after, "Paused" | "SaveTrouble") {
            rig.wait(1.0).send(Input::Advance);
        }
        assert_eq!((steps_failed(&rig).len(), attempts_failed(&rig)), (1, 0));
        feel_again(&mut rig);
        confirm(&mut rig, &protocol, &before);
    }
}

/// It has to be felt right before it can be confirmed, also if it was to be confirmed or left.
#[test]
fn a_level_with_a_wrong_force_is_felt_again_and_not_confirmed() {
    for leaves in [Input::Advance, Input::Adjust(Turn::Higher)] {
        let protocol = adjustment("[[analysis.exclude]]\nrule = \"wrong-force\"");
        let mut rig = setting(&protocol);
        let before = level(&rig);
        rig.device = DeviceMood::Silent;
        rig.wait(1.0).send(leaves);
        let playback = rig.playback;
        rig.send(judged(Verdict::Fault));
        rig.send(Input::DeviceStopped(playback));
        assert_eq!(shown(&rig), "DeviceTrouble");
        assert_eq!(steps_failed(&rig), [Failure::Rendering]);
        rig.wait(1.0).send(Input::Advance);
        assert_eq!(rig.view().screen, Screen::Stopped { can_rate: false });
        rig.wait(1.0).send(Input::RateStopped);
        assert_eq!((done(&rig), attempts_failed(&rig)), (0, 0));
        feel_again(&mut rig);
        confirm(&mut rig, &protocol, &before);
        rig.finish();
        // The verdict stays on record, and excludes no setting.
        let history = rig.session.history();
        let rows = history.rating_rows(&protocol);
        let worst = rows[0].fidelity.as_ref().unwrap();
        assert_eq!(worst.verdict, Verdict::Fault);
        let study = StudyData {
            protocol: &protocol,
            rows: &rows,
            intervals: &fold::interval_rows(history, &protocol),
            participants: &[history.participant_row(&rows[0].participant, 1)],
            sessions: &[history],
            pools: false,
        };
        let found = parts(&study, Include::default());
        assert_eq!(found[0].trials, 4);
        assert!(found[0].exclusions.iter().all(|rule| rule.rows == 0));
    }
}

/// A device that always fails at one level is not tried for ever.
#[test]
fn a_level_at_which_the_device_fails_again_and_again_ends_the_attempt() {
    let protocol = adjustment("");
    let most = protocol.design_of(Some(&protocol.parts[0].id)).max_attempts as usize;
    let mut rig = setting(&protocol);
    for n in 1..=most {
        turn(&mut rig, Turn::Higher);
        rig.wait(5.5);
        assert_eq!(shown(&rig), "DeviceTrouble");
        let ends = n == most;
        assert_eq!(attempts_failed(&rig), usize::from(ends), "{n}");
        assert_eq!(steps_failed(&rig).len(), if ends { n - 1 } else { n });
        if !ends {
            feel_again(&mut rig);
        }
    }
    rig.finish();
}

/// Failures at different levels are those of a hand, and end nothing.
#[test]
fn failures_at_other_levels_do_not_add_up() {
    let protocol = adjustment("");
    let mut rig = setting(&protocol);
    for n in 1..=6 {
        turn(&mut rig, Turn::Higher);
        rig.wait(5.5);
        feel_again(&mut rig);
        rig.wait(1.0).send(Input::Adjust(Turn::Higher)).wait(1.0);
        assert_eq!((steps_failed(&rig).len(), attempts_failed(&rig)), (n, 0));
    }
    let last = level(&rig);
    confirm(&mut rig, &protocol, &last);
}

/// What was felt, or for how long, is not known: the trial begins again.
#[test]
fn where_it_is_not_known_what_was_felt_the_trial_begins_again() {
    // While it plays.
    let protocol = adjustment("");
    let mut rig = setting(&protocol);
    rig.wait(1.0).send(Input::DeviceFault("no bus".to_owned()));
    assert_eq!((steps_failed(&rig).len(), attempts_failed(&rig)), (0, 1));
    // While it stops, without a word of how it ended.
    let mut rig = setting(&protocol);
    rig.device = DeviceMood::Silent;
    rig.wait(1.0).send(Input::Adjust(Turn::Higher)).wait(2.5);
    assert_eq!((steps_failed(&rig).len(), attempts_failed(&rig)), (0, 1));
    // It played, and nobody had asked for it.
    let mut rig = setting(&protocol);
    turn(&mut rig, Turn::Higher);
    rig.wait(0.2).send(Input::DeviceStarted);
    assert_eq!((steps_failed(&rig).len(), attempts_failed(&rig)), (0, 1));
    // Its start was requested.
    let mut rig = setting(&protocol);
    turn(&mut rig, Turn::Higher);
    rig.wait(0.2).send(Input::DeviceLoaded).wait(1.0);
    assert_eq!(rig.effects.last(), Some(&Effect::Start));
    rig.wait(0.2).send(Input::Stop);
    assert_eq!((steps_failed(&rig).len(), attempts_failed(&rig)), (0, 1));
    // Nothing was set yet.
    let mut rig = Rig::new(adjustment("standard = 2.0"));
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.wait(1.0).send(Input::Advance).wait(5.5);
    assert_eq!((steps_failed(&rig).len(), attempts_failed(&rig)), (0, 1));
}

/// Nothing is lost while the device is away, nor if the program is left then.
#[test]
fn what_was_set_waits_for_the_device_and_for_the_program() {
    let protocol = adjustment("");
    let mut rig = setting(&protocol);
    let before = level(&rig);
    turn(&mut rig, Turn::Higher);
    rig.wait(0.2).send(Input::DeviceLost("no bus".to_owned()));
    rig.wait(1.0).send(Input::Advance);
    assert_eq!(shown(&rig), "Stopped");
    rig.wait(1.0).send(Input::PlayAgain);
    assert_eq!(shown(&rig), "DeviceTrouble");
    assert_eq!(attempts_failed(&rig), 0);
    let journal = rig.journal.clone();
    rig.send(Input::DeviceReady);
    feel_again(&mut rig);
    confirm(&mut rig, &protocol, &before);

    let mut rig = Rig::back(protocol.clone(), journal, 20.0);
    rig.identify();
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: true });
    feel_again(&mut rig);
    confirm(&mut rig, &protocol, &before);
    assert_eq!(attempts_failed(&rig), 0);
}

/// After a pause that is too long a level is compared with a memory: the trial begins again.
#[test]
fn after_a_long_pause_the_trial_begins_again() {
    let mut rig = setting(&adjustment(""));
    turn(&mut rig, Turn::Higher);
    rig.wait(0.2).send(Input::Stop);
    rig.device = DeviceMood::Willing;
    rig.wait(90.0).send(Input::PlayAgain).wait(2.0);
    assert_eq!(attempts_failed(&rig), 1);
}

#[test]
fn failed_steps_are_retraced_as_they_were_shown() {
    let protocol = adjustment("standard = 2.0");
    let mut rig = Rig::new(protocol.clone());
    (rig.pages, rig.watched) = (Some(Vec::new()), false);
    rig.until("Playing");
    rig.wait(1.0).send(Input::Advance).wait(1.0);
    rig.wait(1.0).send(Input::Adjust(Turn::Higher)).wait(1.0);
    turn(&mut rig, Turn::Higher);
    rig.wait(5.5);
    feel_again(&mut rig);
    turn(&mut rig, Turn::Standard);
    rig.wait(0.2).send(Input::Stop);
    feel_again(&mut rig);
    turn(&mut rig, Turn::Lower);
    rig.wait(0.2).send(Input::Pause);
    rig.wait(3.0).send(Input::Advance);
    feel_again(&mut rig);
    rig.device = DeviceMood::Silent;
    rig.wait(1.0).send(Input::Advance);
    let playback = rig.playback;
    rig.send(judged(Verdict::Fault));
    rig.send(Input::DeviceStopped(playback));
    feel_again(&mut rig);
    rig.wait(1.0).send(Input::Advance);
    assert_eq!((steps_failed(&rig).len(), done(&rig)), (4, 1));
    rig.finish();
    let protocol = Arc::new(protocol);
    let mut again = Vec::new();
    for page in retrace::pages(&|_| protocol.clone(), &rig.journal) {
        record(&mut again, &page.view);
    }
    assert_equal(rig.pages.as_ref().unwrap(), &again);
}
