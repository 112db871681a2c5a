//! A whole session, its order, and what the screen says on the way.

use super::rig::{Rig, start};
use super::studies::{MODELS, plain, rating, rich};
use study_plan::protocol::{Breaks, Entry, Seat};
use study_session::outcome::{Author, Event, FormId, State};
use study_session::session::view::{Banner, DeviceState, MessageKind, Telemetry};
use study_session::session::{Config, Effect, Ending, Input, Screen};

#[test]
fn a_plain_session_is_prompt_play_rate_six_times() {
    let mut rig = Rig::new(plain());
    rig.finish();
    rig.assert_whole();
    let trial = [
        "Reference",
        "Loading",
        "Playing",
        "Stopping",
        "Form",
        "Saving",
    ];
    let mut expected = vec!["Who", "Saving"];
    for _ in 0..6 {
        expected.extend(trial);
    }
    expected.extend(["End"]);
    assert_eq!(rig.screens, expected);
    assert_eq!(rig.positions(), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn a_rich_session_asks_everything_in_its_order() {
    let mut rig = Rig::new(rich());
    rig.finish();
    rig.assert_whole();
    let mut screens = rig.screens.clone();
    screens.retain(|s| !["Loading", "Playing", "Stopping", "Saving"].contains(s));
    assert_eq!(
        screens,
        [
            "Who",
            "Consent",
            "Form",
            "Message",
            "Form",
            "Message",
            "Reference",
            "Form",
            "Message",
            "Reference",
            "Form",
            "Reference",
            "Form",
            "Break",
            "Reference",
            "Form",
            "Reference",
            "Form",
            "Break",
            "Reference",
            "Form",
            "Reference",
            "Form",
            "Form",
            "End"
        ]
    );
    let places: Vec<FormId> = rig
        .events()
        .filter_map(|e| match e {
            Event::Answered { form, .. } => Some(*form),
            _ => None,
        })
        .collect();
    assert_eq!(places.first(), Some(&FormId::Setup));
    assert_eq!(places.last(), Some(&FormId::Outro));
    assert_eq!(rig.positions(), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn every_event_of_a_trial_is_recorded_once_and_in_order() {
    let mut rig = Rig::new(plain());
    rig.until_reference(1);
    let names: Vec<String> = rig
        .events()
        .map(|e| {
            serde_json::to_value(e).unwrap()["event"]
                .as_str()
                .unwrap()
                .to_owned()
        })
        .collect();
    assert_eq!(
        names,
        [
            "session_started",
            "attempt_started",
            "playback_started",
            "playback_ended",
            "answered",
            "answered",
            "trial_done"
        ]
    );
}

#[test]
fn each_messages_text_is_shown_once() {
    let mut rig = Rig::new(rich());
    let mut kinds = Vec::new();
    while rig.ending.is_none() {
        if let Screen::Message { kind, text } = rig.view().screen {
            assert!(!text.is_empty());
            kinds.push(kind);
        }
        rig.step();
    }
    assert_eq!(
        kinds,
        [
            MessageKind::Welcome,
            MessageKind::Instructions,
            MessageKind::Practice,
            MessageKind::PracticeOver
        ]
    );
    assert_eq!(rig.count(|e| *e == Event::InstructionsRead), 1);
}

#[test]
fn setup_is_asked_of_the_experimenter_and_the_rest_of_the_participant() {
    for entry in [Entry::Participant, Entry::Experimenter] {
        let mut protocol = rich();
        protocol.session.entry = entry;
        let mut rig = Rig::new(protocol);
        while rig.ending.is_none() {
            let view = rig.view();
            assert_eq!(view.entry, entry);
            if let Screen::Form {
                form,
                to_experimenter,
                ..
            } = view.screen
            {
                assert_eq!(to_experimenter, form == FormId::Setup);
            }
            rig.step();
        }
        rig.assert_whole();
        let by = match entry {
            Entry::Participant => Author::Participant,
            Entry::Experimenter => Author::Experimenter,
        };
        assert_eq!(
            rig.count(|e| matches!(e, Event::Consented { by: b, accepted: true, .. } if *b == by)),
            1
        );
    }
}

#[test]
fn without_consent_nothing_is_asked() {
    let mut rig = Rig::new(rich());
    rig.until("Consent").send(Input::Consent(false));
    assert_eq!(
        rig.view().screen,
        Screen::End {
            text: "Nothing more is asked. Thank you.".into()
        }
    );
    rig.send(Input::Remark {
        by: Author::Participant,
        text: "no".to_owned(),
    });
    rig.send(Input::Advance);
    assert_eq!(rig.ending, Some(Ending::DroppedOut));
    assert_eq!(rig.journal.len(), 3);
    assert_eq!(
        rig.journal[2].event,
        Event::StateSet {
            state: State::DroppedOut,
            reason: "no consent".to_owned()
        }
    );
}

#[test]
fn a_bad_participant_id_stays_on_the_first_screen() {
    let mut rig = Rig::new(plain());
    for id in ["", "../../x", "a\u{1b}[2Jb"] {
        rig.send(Input::Identify {
            participant: id.to_owned(),
            operator: String::new(),
        });
        let view = rig.view();
        let notice = view.notice.unwrap();
        assert!(!notice.contains('\u{1b}'), "{notice}");
        assert!(matches!(
            view.screen,
            Screen::Who {
                claiming: false,
                ..
            }
        ));
    }
    assert!(rig.effects.is_empty());
}

#[test]
fn a_refused_claim_comes_back_with_its_reason() {
    let (mut session, _) = study_session::session::Session::new(
        std::sync::Arc::new(plain()),
        None,
        Config::default(),
        start(),
    );
    let effects = session.handle(
        Input::Identify {
            participant: " P01 ".to_owned(),
            operator: "lw".to_owned(),
        },
        start(),
    );
    assert!(
        matches!(&effects[..], [Effect::Claim { participant, .. }] if participant.as_str() == "P01")
    );
    session.handle(Input::ClaimRefused("P01 is done".to_owned()), start());
    let view = session.view(start());
    assert_eq!(view.notice.as_deref(), Some("P01 is done"));
    assert!(matches!(
        view.screen,
        Screen::Who {
            claiming: false,
            ..
        }
    ));
}

#[test]
fn a_rehearsal_skips_the_first_screen() {
    let config = Config {
        participant: "SIM001".to_owned(),
        auto_identify: true,
        ..Config::default()
    };
    let mut rig = Rig::with_config(plain(), config, Vec::new(), start());
    assert!(!rig.screens.contains(&"Who") || rig.screens[0] == "Who");
    assert!(matches!(rig.effects[0], Effect::Claim { .. }));
    rig.finish();
    rig.assert_whole();
}

#[test]
fn the_banner_tells_pilots_and_simulations_apart() {
    for (seat, banner) in [
        (Seat::Row(3), None),
        (Seat::Pilot(1), Some(Banner::Pilot)),
        (Seat::Simulated(1), Some(Banner::Simulated)),
    ] {
        let mut rig = Rig::new(plain());
        rig.seat = seat;
        rig.identify();
        assert_eq!(rig.view().banner, banner);
    }
}

#[test]
fn the_reference_stays_at_least_as_long_as_asked() {
    let mut protocol = plain();
    protocol.trial.reference_min_s = 5.0;
    let mut rig = Rig::new(protocol);
    rig.until("Reference").send(Input::Advance);
    assert_eq!(
        rig.view().notice.as_deref(),
        Some("wait for the prompt to end")
    );
    assert!(!rig.view().can_advance);
    rig.wait(4.0).send(Input::Advance);
    assert!(
        matches!(rig.view().screen, Screen::Reference { wait_s, .. } if (wait_s - 1.0).abs() < 1e-6)
    );
    rig.wait(1.0).send(Input::Advance);
    assert!(matches!(rig.view().screen, Screen::Playing { .. }));
    let shown = rig.events().find_map(|e| match e {
        Event::AttemptStarted { reference_s, .. } => Some(*reference_s),
        _ => None,
    });
    assert!((shown.unwrap() - 5.0).abs() < 1e-6);
}

#[test]
fn a_break_lasts_at_least_as_long_as_asked_and_never_ends_a_session() {
    let mut protocol = plain();
    protocol.design.breaks = Some(Breaks {
        every: 3,
        at_least_s: 60.0,
    });
    let mut rig = Rig::new(protocol);
    rig.until("Break").send(Input::Advance);
    assert!(matches!(rig.view().screen, Screen::Break { .. }));
    rig.wait(59.0).send(Input::Advance);
    assert!(matches!(rig.view().screen, Screen::Break { .. }));
    rig.wait(2.0).send(Input::Advance);
    assert!(matches!(rig.view().screen, Screen::Reference { .. }));
    rig.finish();
    let breaks: Vec<_> = rig
        .events()
        .filter_map(|e| match e {
            Event::BreakStarted { after } => Some(*after),
            _ => None,
        })
        .collect();
    assert_eq!(breaks, [3], "not after the sixth, which is the last");
    let rested = rig.events().find_map(|e| match e {
        Event::BreakEnded { rested_s } => Some(*rested_s),
        _ => None,
    });
    assert!(rested.unwrap() >= 60.0);
}

#[test]
fn progress_counts_practice_by_itself_and_trials_from_one_to_all() {
    let mut rig = Rig::new(rich());
    let mut seen = Vec::new();
    while rig.ending.is_none() {
        if let Some(progress) = rig.view().progress {
            let now = (progress.practice, progress.current, progress.total);
            if seen.last() != Some(&now) {
                seen.push(now);
            }
        }
        rig.step();
    }
    let mut expected = vec![(true, 1, Some(1))];
    expected.extend((1..=6).map(|k| (false, k, Some(6))));
    assert_eq!(seen, expected);
}

#[test]
fn the_status_line_follows_the_device_and_the_clock() {
    let mut rig = Rig::new(plain());
    assert_eq!(rig.view().line.device, DeviceState::Unknown);
    rig.until("Reference");
    assert_eq!(rig.view().line.device, DeviceState::Limp);
    rig.step();
    assert_eq!(
        rig.view().line.device,
        DeviceState::Running(Telemetry::Arrives)
    );
    assert!(rig.view().armed);
    let before = rig.view().line.elapsed_s;
    rig.wait(10.0);
    assert!((rig.view().line.elapsed_s - before - 10.0).abs() < 1e-6);
    assert!(matches!(rig.view().screen, Screen::Playing { since_s, .. } if since_s >= 10.0));
}

#[test]
fn the_simulated_rater_alone_learns_what_is_played() {
    let mut rig = Rig::new(plain());
    rig.until("Reference");
    assert_eq!(rig.session.playing_model(), None);
    rig.step();
    let first = rig.schedule()[0].model().unwrap().clone();
    assert_eq!(rig.session.playing_model(), Some(&first));
    rig.until("Form");
    assert_eq!(rig.session.playing_model(), Some(&first));
    assert!(MODELS.contains(&first.as_str()));
}

#[test]
fn without_an_order_the_claim_is_given_back() {
    let mut protocol = plain();
    for model in &mut protocol.models {
        model.role = study_plan::protocol::Role::Practice;
    }
    let mut rig = Rig::new(protocol);
    rig.identify();
    assert!(
        rig.view()
            .notice
            .unwrap()
            .starts_with("the order cannot be made")
    );
    assert!(rig.journal.is_empty());
    rig.send(Input::Quit);
    assert_eq!(rig.ending, Some(Ending::Nothing));
}

#[test]
fn a_step_of_the_wall_clock_is_recorded_once() {
    let mut rig = Rig::new(plain());
    rig.until("Reference");
    rig.now.wall += chrono::TimeDelta::seconds(3600);
    rig.wait(1.0).wait(1.0).wait(1.0);
    let steps: Vec<f64> = rig
        .events()
        .filter_map(|e| match e {
            Event::ClockStepped { by_s } => Some(*by_s),
            _ => None,
        })
        .collect();
    assert_eq!(steps.len(), 1);
    assert!((steps[0] - 3600.0).abs() < 1e-3, "{steps:?}");
}

#[test]
fn an_experiment_without_questions_after_a_trial_still_closes_it() {
    let mut protocol = plain();
    protocol.questions.clear();
    protocol.outro = vec![rating("effort")];
    let mut rig = Rig::new(protocol);
    rig.finish();
    rig.assert_whole();
}
