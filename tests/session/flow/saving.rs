//! Slow disks, full disks, and leaving.

use super::rig::{DeviceMood, Rig, StoreMood, name};
use super::studies::{plain, rich};
use study_session::outcome::{Event, Failure};
use study_session::session::{Effect, Ending, Input, Screen};

fn screen(rig: &Rig) -> &'static str {
    name(&rig.view().screen)
}

#[test]
fn a_session_waits_for_the_disk_after_each_trial() {
    let mut rig = Rig::new(plain());
    rig.until("Form");
    rig.store = StoreMood::Slow;
    rig.answer_page();
    let view = rig.view();
    assert_eq!(view.screen, Screen::Saving);
    assert!(!view.line.all_saved);
    assert_eq!((view.line.trials_saved, view.line.trials_answered), (0, 1));
    rig.send(Input::Advance).wait(60.0);
    assert_eq!(screen(&rig), "Saving", "only the disk ends it");
    let saved = rig.on_disk;
    rig.send(Input::Saved { count: saved + 1 });
    assert_eq!(screen(&rig), "Saving", "all of it");
    let all = rig.all_on_disk();
    rig.send(all);
    let view = rig.view();
    assert_eq!(name(&view.screen), "Reference");
    assert_eq!((view.line.trials_saved, view.line.trials_answered), (1, 1));
}

#[test]
fn an_acknowledgement_of_more_than_was_sent_is_no_credit() {
    let mut rig = Rig::new(plain());
    rig.until("Form");
    rig.store = StoreMood::Slow;
    let effects = rig.session.handle(Input::Saved { count: 10_000 }, rig.now);
    assert_eq!(effects, []);
    rig.answer_page();
    assert!(!rig.view().line.all_saved);
}

#[test]
fn a_full_disk_stops_everything_and_loses_nothing() {
    for phase in ["Reference", "Playing", "Form", "Break"] {
        let mut rig = Rig::new(rich());
        rig.until(phase);
        rig.effects.clear();
        rig.send(Input::SaveFailed("disk full".to_owned()));
        assert_eq!(rig.effects[0], Effect::Limp, "{phase}");
        assert_eq!(
            rig.view().screen,
            Screen::SaveTrouble {
                what: "disk full".to_owned()
            }
        );
        rig.effects.clear();
        rig.store = StoreMood::Broken;
        rig.send(Input::Advance);
        assert!(rig.effects.contains(&Effect::RetrySave));
        assert_eq!(screen(&rig), "SaveTrouble", "{phase}");
        rig.store = StoreMood::Slow;
        rig.send(Input::RetrySave);
        assert_eq!(screen(&rig), "Saving", "{phase}");
        let all = rig.all_on_disk();
        rig.send(all);
        if phase == "Playing" {
            rig.wait(2.0);
            assert_eq!(rig.view().screen, Screen::Stopped { can_rate: false });
        } else {
            assert_eq!(screen(&rig), phase);
        }
        rig.finish();
        rig.assert_whole();
    }
}

#[test]
fn nothing_goes_on_while_the_disk_fails() {
    let mut rig = Rig::new(plain());
    rig.until("Form");
    rig.store = StoreMood::Broken;
    rig.answer_page();
    assert_eq!(screen(&rig), "SaveTrouble");
    let before = rig.journal.len();
    let inputs = [
        Input::Pause,
        Input::PlayAgain,
        Input::RateStopped,
        Input::Answer(Vec::new()),
        Input::DeviceLoaded,
        Input::Tick,
    ];
    for input in inputs {
        rig.send(input);
        assert_eq!(screen(&rig), "SaveTrouble");
    }
    assert_eq!(rig.journal.len(), before);
    rig.store = StoreMood::Prompt;
    rig.send(Input::RetrySave);
    assert_eq!(screen(&rig), "Reference");
    assert_eq!(rig.view().line.trials_saved, 1);
}

#[test]
fn a_disk_that_fails_before_it_plays_goes_back_to_the_prompt() {
    let mut rig = Rig::new(plain());
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.store = StoreMood::Broken;
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "SaveTrouble");
    rig.store = StoreMood::Prompt;
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Reference");
    assert!(rig.events().any(|e| matches!(
        e,
        Event::AttemptFailed {
            failure: Failure::Stopped,
            ..
        }
    )));
}

#[test]
fn quitting_waits_for_the_disk() {
    for phase in [
        "Consent",
        "Message",
        "Reference",
        "Playing",
        "Form",
        "Break",
    ] {
        let mut rig = Rig::new(rich());
        rig.until(phase);
        rig.store = StoreMood::Slow;
        rig.effects.clear();
        rig.send(Input::Quit);
        assert_eq!(rig.effects[0], Effect::Limp, "{phase}");
        assert_eq!(rig.ending, None, "{phase}");
        assert!(matches!(
            rig.journal.last().unwrap().event,
            Event::Interrupted { .. }
        ));
        rig.wait(3600.0);
        assert_eq!(rig.ending, None, "{phase}");
        let all = rig.all_on_disk();
        rig.send(all);
        assert_eq!(rig.ending, Some(Ending::Interrupted), "{phase}");
    }
}

#[test]
fn quitting_before_a_session_is_claimed_leaves_nothing() {
    let mut rig = Rig::new(plain());
    rig.send(Input::Quit);
    assert_eq!(rig.ending, Some(Ending::Nothing));
    assert!(rig.journal.is_empty());
}

#[test]
fn quitting_on_a_broken_disk_tries_once_more() {
    let mut rig = Rig::new(plain());
    rig.until("Form");
    rig.store = StoreMood::Broken;
    rig.answer_page();
    rig.effects.clear();
    rig.send(Input::Quit);
    assert!(rig.effects.contains(&Effect::RetrySave));
    assert_eq!(rig.ending, Some(Ending::Interrupted));
}

#[test]
fn a_disk_that_fails_on_quitting_is_shown_and_a_second_quit_is_obeyed() {
    let mut rig = Rig::new(plain());
    rig.until("Form");
    rig.store = StoreMood::Broken;
    rig.send(Input::Quit);
    assert_eq!(screen(&rig), "SaveTrouble");
    assert_eq!(rig.ending, None);
    rig.store = StoreMood::Slow;
    rig.send(Input::Advance);
    assert!(rig.effects.contains(&Effect::RetrySave));
    rig.send(Input::Quit);
    assert_eq!(rig.ending, Some(Ending::Interrupted));
}

#[test]
fn an_abort_waits_for_nobody() {
    let mut rig = Rig::new(plain());
    rig.until("Playing");
    rig.store = StoreMood::Slow;
    rig.effects.clear();
    rig.send(Input::Abort("the terminal is gone".to_owned()));
    assert_eq!(rig.effects[0], Effect::Limp);
    assert!(rig.events().any(|e| matches!(e,
        Event::Interrupted { reason } if reason == "the terminal is gone")));
    rig.wait(4.0);
    assert_eq!(rig.ending, None);
    rig.wait(1.5);
    assert_eq!(rig.ending, Some(Ending::Interrupted));
}

#[test]
fn leaving_from_the_last_screen_is_finished_however_it_is_left() {
    for input in [
        Input::Advance,
        Input::Quit,
        Input::Abort("hang-up".to_owned()),
    ] {
        let mut rig = Rig::new(rich());
        rig.until("End");
        assert_eq!(
            rig.view().screen,
            Screen::End {
                text: "Goodbye.".into()
            }
        );
        rig.send(input);
        assert_eq!(rig.ending, Some(Ending::Finished));
        assert_eq!(rig.count(|e| matches!(e, Event::Interrupted { .. })), 0);
    }
}
