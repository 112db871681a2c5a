//! Pictures and sounds beside what is felt: nothing is answered about what nobody is known to have seen.

use super::device::{failures, screen};
use super::part_rig::pairs;
use super::rig::{DeviceMood, Rig, start};
use super::studies::{MODELS, plain};
use chrono::TimeDelta;
use std::sync::Arc;
use study_base::text::{ModelId, ParticipantId};
use study_plan::protocol::{Medium, Protocol};
use study_session::outcome::fold::attempt_rows;
use study_session::outcome::{AttemptEvent, Entry, Event, Failure, Moment};
use study_session::page::participant;
use study_session::session::cue::{Loss, MediaReport, Shown, Shows};
use study_session::session::{Config, Input, Screen};

/// The name of the picture that all realizations show.
const PICTURE: &str = "f00d";

fn shown(medium: Medium) -> Shown {
    Shown {
        medium,
        id: PICTURE.to_owned(),
        alt: Some("a drawer".to_owned()),
        caption: None,
    }
}

/// With a page that shows these media of every realization.
pub(super) fn with(media: &[Medium]) -> Config {
    let of = |id: &&str| {
        let id = ModelId::new(*id).unwrap();
        (id, media.iter().map(|medium| shown(*medium)).collect())
    };
    let shows: Shows = MODELS[..3].iter().map(of).collect();
    Config {
        media: Some(Arc::new(shows)),
        ..Config::default()
    }
}

pub(super) fn here(ready: bool) -> Input {
    Input::Media(MediaReport::Here { ready })
}

/// A session before its first trial, whose page is ready.
fn at_reference(protocol: Protocol, media: &[Medium]) -> Rig {
    let mut rig = Rig::with_config(protocol, with(media), Vec::new(), start());
    rig.until("Reference").send(here(true));
    rig
}

/// The same with the first trial playing.
fn playing(media: &[Medium]) -> Rig {
    let mut rig = at_reference(plain(), media);
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Playing");
    rig
}

fn cue(rig: &Rig) -> u64 {
    rig.view().cue.expect("something is shown").cue
}

/// A fifth of a second after the start the page says when a medium came.
pub(super) fn came(rig: &mut Rig, medium: Medium, after_ms: f64, uncertainty_ms: f64) {
    let cue = cue(rig);
    rig.wait(0.2);
    rig.send(Input::Media(MediaReport::Onset {
        cue,
        medium,
        ago_s: 0.2 - after_ms * 1e-3,
        uncertainty_s: uncertainty_ms * 1e-3,
    }));
}

pub(super) fn lost(rig: &mut Rig, cue: u64, why: Loss) {
    rig.send(Input::Media(MediaReport::Lost { cue, why }));
}

/// Offsets and uncertainties in the journal, ms.
pub(super) fn onsets(rig: &Rig) -> Vec<(u32, Medium, f64, f64)> {
    rig.events()
        .filter_map(|event| match event {
            Event::MediaShown {
                trial,
                medium,
                offset_ms,
                uncertainty_ms,
                ..
            } => Some((*trial, *medium, *offset_ms, *uncertainty_ms)),
            _ => None,
        })
        .collect()
}

fn details(rig: &Rig) -> Vec<String> {
    rig.events()
        .filter_map(|event| match event {
            Event::AttemptFailed { detail, .. } => Some(detail.clone()),
            _ => None,
        })
        .collect()
}

/// Plays to the end with a page that shows everything in time.
pub(super) fn finish(rig: &mut Rig) {
    for _ in 0..1000 {
        if rig.ending.is_some() {
            return;
        }
        rig.send(here(true));
        if let Some(cue) = rig.view().cue {
            for shown in cue.media {
                rig.send(Input::Media(MediaReport::Onset {
                    cue: cue.cue,
                    medium: shown.medium,
                    ago_s: 0.0,
                    uncertainty_s: 0.001,
                }));
            }
        }
        rig.step();
    }
    panic!("it never ends: {:?}", rig.view());
}

#[test]
fn no_trial_begins_before_the_page_is_ready_and_in_sight() {
    let media = [Medium::Picture];
    let mut rig = Rig::with_config(plain(), with(&media), Vec::new(), start());
    rig.until("Reference");
    for _ in 0..3 {
        let view = rig.view();
        assert!(view.awaits_page && !view.can_advance);
        let page = participant(&view).unwrap();
        assert_eq!(
            page.wait.as_deref(),
            Some("Pictures and sounds are being loaded.")
        );
        assert!(page.buttons.iter().all(|button| !button.enabled));
        rig.send(here(false)).send(Input::Advance);
        assert_eq!(screen(&rig), "Reference");
    }
    rig.send(here(true));
    assert!(rig.view().can_advance);
    // It is silent, or went out of sight.
    rig.wait(2.1);
    assert!(!rig.view().can_advance);
    rig.send(here(true)).send(here(false));
    assert!(!rig.view().can_advance);
    rig.send(here(true)).send(Input::Advance);
    assert_eq!(screen(&rig), "Playing");
    assert_eq!(failures(&rig), []);
}

#[test]
fn the_media_of_what_plays_are_on_the_page_while_it_plays() {
    let mut rig = playing(&[Medium::Picture]);
    let view = rig.view();
    assert_eq!(view.cue.as_ref().unwrap().media, [shown(Medium::Picture)]);
    let page = serde_json::to_value(participant(&view).unwrap()).unwrap();
    assert_eq!(page["media"]["media"][0]["id"], PICTURE);
    assert_eq!(page["media"]["media"][0]["medium"], "picture");
    assert_eq!(page["media"]["media"][0]["alt"], "a drawer");
    came(&mut rig, Medium::Picture, 30.0, 1.0);
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Form");
    let page = serde_json::to_value(participant(&rig.view()).unwrap()).unwrap();
    assert!(page.get("media").is_none(), "{page}");
}

#[test]
fn an_onset_within_the_bound_is_recorded_and_in_the_rows() {
    let mut rig = playing(&[Medium::Picture]);
    assert_eq!(cue(&rig), 1);
    // Nobody goes on before it came.
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Playing");
    came(&mut rig, Medium::Picture, 30.0, 1.0);
    rig.send(Input::Advance).answer_page();
    rig.until("Reference").send(here(true)).send(Input::Advance);
    assert_eq!(cue(&rig), 2);
    came(&mut rig, Medium::Picture, 50.0, 2.5);
    let found = onsets(&rig);
    let offsets: Vec<(f64, f64)> = found.iter().map(|(_, _, at, by)| (*at, *by)).collect();
    assert_eq!(offsets, [(30.0, 1.0), (50.0, 2.5)]);
    finish(&mut rig);
    rig.assert_whole();
    assert_eq!(failures(&rig), []);
    let history = rig.session.history();
    let rows = history.rating_rows(&plain());
    let row = |trial| rows.iter().find(|row| row.trial == trial).unwrap();
    let (first, second) = (row(found[0].0), row(found[1].0));
    assert_eq!(first.media_offset_ms, Some(30.0));
    assert_eq!(first.media_uncertainty_ms, Some(1.0));
    assert_eq!(first.media_jitter_ms, None);
    assert_eq!(second.media_offset_ms, Some(50.0));
    // The standard deviation of 30 and 50 is 10 √2.
    let jitter = second.media_jitter_ms.unwrap();
    assert!((jitter - 14.142_135_623_730_951).abs() < 1e-9, "{jitter}");
    let id = ParticipantId::new("P01").unwrap();
    let log = attempt_rows(history, &id, 1, &rig.journal);
    let media: Vec<_> = (log.iter())
        .filter(|row| row.what == AttemptEvent::Media)
        .collect();
    assert_eq!(media.len(), 6);
    assert_eq!(media[1].medium, Some(Medium::Picture));
    assert_eq!(media[1].media_offset_ms, Some(50.0));
    assert_eq!(media[1].media_uncertainty_ms, Some(2.5));
}

#[test]
fn an_onset_beyond_the_bound_fails_its_attempt_with_what_the_clocks_may_make_wrong() {
    for (after_ms, uncertainty_ms, fails) in [
        (99.0, 1.0, false),
        (99.0, 1.1, true),
        (130.0, 0.5, true),
        (-99.0, 1.1, true),
        (10.0, 95.0, true),
    ] {
        let mut rig = playing(&[Medium::Picture]);
        came(&mut rig, Medium::Picture, after_ms, uncertainty_ms);
        assert_eq!(onsets(&rig).len(), 1, "{after_ms}");
        if !fails {
            assert_eq!(screen(&rig), "Playing", "{after_ms} ± {uncertainty_ms}");
            continue;
        }
        assert_eq!(failures(&rig), [(1, 1, Failure::Media)], "{after_ms}");
        assert_eq!(screen(&rig), "Reference");
        assert!(!rig.view().armed);
        let detail = details(&rig);
        let allowed = "the protocol allows 100 ms";
        assert!(detail[0].contains(allowed), "{detail:?}");
        assert!(detail[0].starts_with("the picture came"), "{detail:?}");
        assert!(rig.view().notice.unwrap().contains("comes again"));
        finish(&mut rig);
        rig.assert_whole();
        assert_eq!(rig.closed()[&1], Some(2), "the second attempt counts");
    }
}

#[test]
fn each_medium_of_an_interval_has_to_come() {
    let mut rig = playing(&[Medium::Picture, Medium::Sound]);
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.wait(1.2);
    assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
    let mut rig = playing(&[Medium::Picture, Medium::Sound]);
    came(&mut rig, Medium::Sound, 60.0, 1.0);
    let cue = cue(&rig);
    rig.send(Input::Media(MediaReport::Onset {
        cue,
        medium: Medium::Picture,
        ago_s: 0.18,
        uncertainty_s: 0.001,
    }));
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Form");
    finish(&mut rig);
    // Of several the one that is farthest from the start.
    let rows = rig.session.history().rating_rows(&plain());
    let first = rows.iter().find(|row| row.trial == 1).unwrap();
    assert_eq!(first.media_offset_ms, Some(60.0));
    assert_eq!(first.media_jitter_ms, None, "two media are no jitter");
}

#[test]
fn a_playback_without_a_report_is_not_answered() {
    // The report does not come.
    let mut rig = playing(&[Medium::Picture]);
    rig.wait(1.0);
    assert_eq!(failures(&rig), []);
    rig.wait(0.2);
    assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
    assert!(details(&rig)[0].contains("did not confirm in time"));
    // It ends before the report comes.
    let mut protocol = plain();
    protocol.trial.exposure.max_s = Some(0.05);
    let mut rig = at_reference(protocol, &[Medium::Picture]);
    rig.send(Input::Advance).wait(0.06);
    assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
    assert_eq!(screen(&rig), "Reference");
    // A report that comes later is of nothing.
    rig.send(Input::Media(MediaReport::Onset {
        cue: 1,
        medium: Medium::Picture,
        ago_s: 0.0,
        uncertainty_s: 0.001,
    }));
    assert_eq!(onsets(&rig), []);
}

#[test]
fn reports_that_cannot_be_true_are_none() {
    let onset = |cue, medium, ago_s, uncertainty_s| {
        Input::Media(MediaReport::Onset {
            cue,
            medium,
            ago_s,
            uncertainty_s,
        })
    };
    let mut rig = playing(&[Medium::Picture]);
    rig.wait(0.1);
    for wrong in [
        onset(2, Medium::Picture, 0.05, 0.001),
        onset(0, Medium::Picture, 0.05, 0.001),
        onset(1, Medium::Sound, 0.05, 0.001),
        onset(1, Medium::Picture, -0.1, 0.001),
        onset(1, Medium::Picture, f64::NAN, 0.001),
        onset(1, Medium::Picture, 0.05, f64::NAN),
        onset(1, Medium::Picture, 0.05, -1.0),
        onset(1, Medium::Picture, 0.05, f64::INFINITY),
        onset(1, Medium::Picture, 1e9, 0.001),
    ] {
        rig.send(wrong);
    }
    assert_eq!((onsets(&rig), failures(&rig)), (Vec::new(), Vec::new()));
    rig.send(onset(1, Medium::Picture, 0.05, 0.001));
    rig.send(onset(1, Medium::Picture, 0.01, 0.001));
    assert_eq!(onsets(&rig).len(), 1, "it comes once");
}

#[test]
fn what_went_out_of_sight_is_not_answered() {
    for why in [Loss::Hidden, Loss::Asleep, Loss::NotPlayed] {
        // While it plays.
        let mut rig = playing(&[Medium::Picture]);
        came(&mut rig, Medium::Picture, 20.0, 1.0);
        lost(&mut rig, 1, why);
        assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
        assert_eq!(details(&rig), [why.as_str()]);
        // It was asleep, and says so when the questions are there.
        let mut rig = playing(&[Medium::Picture]);
        came(&mut rig, Medium::Picture, 20.0, 1.0);
        rig.send(Input::Advance);
        assert_eq!(screen(&rig), "Form");
        lost(&mut rig, 1, why);
        assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
        assert_eq!(screen(&rig), "Reference");
        lost(&mut rig, 1, why);
        assert_eq!(failures(&rig).len(), 1, "said twice, it counts once");
    }
    // What is answered stays, as does what is presented later.
    let mut rig = playing(&[Medium::Picture]);
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.send(Input::Advance).answer_page();
    rig.until("Reference").send(here(true)).send(Input::Advance);
    lost(&mut rig, 1, Loss::Hidden);
    assert_eq!(failures(&rig), []);
    lost(&mut rig, 7, Loss::Hidden);
    assert_eq!(failures(&rig), []);
}

#[test]
fn a_page_that_gives_no_sign_of_life_fails_the_attempt() {
    let mut rig = playing(&[Medium::Picture]);
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.wait(1.7);
    assert_eq!(failures(&rig), []);
    rig.send(here(true)).wait(1.9);
    assert_eq!(failures(&rig), []);
    rig.wait(0.2);
    assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
    assert!(details(&rig)[0].contains("no sign of life"));
    // Nothing begins until it is back.
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Reference");
    finish(&mut rig);
    rig.assert_whole();
    // One that says that it is not ready is out of sight at once.
    let mut rig = playing(&[Medium::Picture]);
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.send(here(false)).wait(0.01);
    assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
}

#[test]
fn nothing_starts_while_the_page_is_away() {
    let mut rig = at_reference(plain(), &[Medium::Picture]);
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Loading");
    rig.send(here(false)).send(Input::DeviceLoaded);
    assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
    let started = rig.count(|event| matches!(event, Event::PlaybackStarted { .. }));
    assert_eq!((started, screen(&rig)), (0, "Reference"));
}

#[test]
fn a_stop_before_the_onset_can_only_be_played_again() {
    let mut rig = playing(&[Medium::Picture]);
    rig.send(Input::Stop);
    let Screen::Stopped { can_rate } = rig.view().screen else {
        panic!("{:?}", rig.view().screen);
    };
    assert!(!can_rate);
    rig.send(Input::RateStopped);
    assert_eq!(screen(&rig), "Stopped");
    rig.send(Input::PlayAgain);
    assert_eq!(screen(&rig), "Playing");
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.send(Input::Stop).send(Input::RateStopped);
    assert_eq!(screen(&rig), "Form");
}

#[test]
fn a_pause_that_was_asked_for_comes_once() {
    let mut rig = playing(&[Medium::Picture]);
    rig.device = DeviceMood::Silent;
    rig.send(Input::Pause);
    lost(&mut rig, 1, Loss::Hidden);
    assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
    assert_eq!(screen(&rig), "Paused");
    let playback = rig.playback;
    rig.send(Input::DeviceStopped(playback));
    assert_eq!(rig.count(|event| *event == Event::Paused), 1);
}

/// Comes back five seconds later to what is in a journal, with a page.
fn back(journal: Vec<Entry>) -> Rig {
    let last = journal.last().map_or(start().wall, |entry| entry.at.wall);
    let now = Moment {
        wall: last + TimeDelta::seconds(5),
        mono_ns: 5_000_000_000,
    };
    Rig::with_config(plain(), with(&[Medium::Picture]), journal, now)
}

#[test]
fn a_resumed_session_asks_only_about_what_was_seen() {
    // The program ended between the end of the playback and the failure of the attempt.
    let mut unseen = Rig::new(plain());
    unseen.until("Form");
    let mut rig = back(unseen.journal.clone());
    rig.until("Reference");
    assert_eq!(failures(&rig), [(1, 1, Failure::Media)]);
    finish(&mut rig);
    rig.assert_whole();
    // What was seen is asked about.
    let mut seen = playing(&[Medium::Picture]);
    came(&mut seen, Medium::Picture, 20.0, 1.0);
    seen.send(Input::Advance);
    assert_eq!(screen(&seen), "Form");
    let mut rig = back(seen.journal.clone());
    rig.until("Form");
    assert_eq!(failures(&rig), []);
    finish(&mut rig);
    rig.assert_whole();
    assert_eq!(rig.closed()[&1], Some(1));
}

#[test]
fn each_interval_has_its_own_onsets_and_all_have_to_be_seen() {
    let media = [Medium::Picture];
    let mut rig = Rig::with_config(pairs(""), with(&media), Vec::new(), start());
    rig.until("Reference").send(here(true)).send(Input::Advance);
    assert_eq!((screen(&rig), cue(&rig)), ("Playing", 1));
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.send(here(true)).send(Input::Advance);
    assert_eq!(
        rig.view().cue,
        None,
        "between the intervals nothing is shown"
    );
    for _ in 0..50 {
        if screen(&rig) != "Playing" {
            rig.send(here(true)).wait(0.2);
        }
    }
    assert_eq!((screen(&rig), cue(&rig)), ("Playing", 2));
    came(&mut rig, Medium::Picture, 40.0, 1.0);
    let intervals: Vec<Option<u32>> = (rig.events())
        .filter_map(|event| match event {
            Event::MediaShown { interval, .. } => Some(*interval),
            _ => None,
        })
        .collect();
    assert_eq!(intervals, [Some(1), Some(2)]);
    assert!(failures(&rig).is_empty());
    // The page wakes up and says that the first one was not seen to its end.
    lost(&mut rig, 1, Loss::Asleep);
    let failed: Vec<Failure> = failures(&rig).into_iter().map(|(_, _, why)| why).collect();
    assert_eq!(failed, [Failure::Media]);
    assert_eq!(screen(&rig), "Reference");
}

#[test]
fn a_session_whose_media_nobody_presents_goes_on_without_them() {
    let mut rig = Rig::new(plain());
    rig.until("Playing");
    assert_eq!(rig.view().cue, None);
    lost(&mut rig, 1, Loss::Hidden);
    rig.finish();
    rig.assert_whole();
    assert_eq!((onsets(&rig), failures(&rig)), (Vec::new(), Vec::new()));
    let rows = rig.session.history().rating_rows(&plain());
    assert!(rows.iter().all(|row| row.media_offset_ms.is_none()));
}
