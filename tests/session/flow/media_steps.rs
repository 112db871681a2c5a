//! Pictures beside a standard of an adjustment, and the pages of sessions with media again.

use super::device::{failures, screen};
use super::media::{came, finish, here, lost, onsets, with};
use super::part_rig::adjustment;
use super::retraced::{assert_equal, record};
use super::rig::{DeviceMood, Rig, start};
use super::studies::plain;
use std::sync::Arc;
use study_plan::protocol::{Medium, Turn};
use study_session::outcome::{Event, Failure};
use study_session::session::cue::Loss;
use study_session::session::{Input, retrace};

/// Waits until something plays, with a page that is ready.
fn until_plays(rig: &mut Rig) {
    for _ in 0..50 {
        if screen(rig) == "Playing" {
            return;
        }
        rig.send(here(true)).wait(0.1);
    }
    panic!("it does not play: {:?}", rig.view());
}

/// A level plays that is set beside a standard with a picture, which was seen.
fn setting() -> Rig {
    let media = with(&[Medium::Picture]);
    let protocol = adjustment("reference = \"XQZ-7\"");
    let mut rig = Rig::with_config(protocol, media, Vec::new(), start());
    rig.until("Reference").send(here(true)).send(Input::Advance);
    until_plays(&mut rig);
    assert!(rig.view().adjusting.unwrap().at_standard);
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.wait(1.0).send(here(true)).send(Input::Advance);
    until_plays(&mut rig);
    assert!(!rig.view().adjusting.unwrap().at_standard);
    assert_eq!(rig.view().cue, None, "a level has no media");
    rig
}

/// Confirms the level that plays in the first attempt.
fn confirm(rig: &mut Rig) {
    rig.wait(1.0).send(here(true)).send(Input::Advance);
    assert_eq!(failures(rig), []);
    assert_eq!(rig.closed()[&1], Some(1));
}

#[test]
fn a_standard_that_was_stopped_before_its_picture_came_is_seen_again() {
    let mut rig = setting();
    rig.wait(1.0)
        .send(here(true))
        .send(Input::Adjust(Turn::Standard));
    until_plays(&mut rig);
    rig.send(here(true)).send(Input::Stop);
    assert_eq!(screen(&rig), "Stopped");
    rig.send(Input::PlayAgain);
    until_plays(&mut rig);
    assert!(rig.view().adjusting.unwrap().at_standard);
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.send(here(true)).send(Input::Advance);
    until_plays(&mut rig);
    assert_eq!(onsets(&rig).len(), 2);
    confirm(&mut rig);
}

#[test]
fn a_page_that_is_away_as_the_standard_is_asked_for_costs_the_step_and_not_the_setting() {
    let mut rig = setting();
    let level = rig.session.playing_model().cloned();
    rig.device = DeviceMood::Silent;
    rig.wait(1.0).send(Input::Adjust(Turn::Standard));
    let playback = rig.playback;
    rig.send(Input::DeviceStopped(playback));
    assert_eq!(screen(&rig), "Loading");
    rig.send(here(false)).send(Input::DeviceLoaded).wait(1.0);
    assert_eq!(screen(&rig), "Stopped");
    assert!(
        !rig.view().armed,
        "a table that was loaded is not left there"
    );
    let failed: Vec<Failure> = (rig.events())
        .filter_map(|event| match event {
            Event::StepFailed { failure, .. } => Some(*failure),
            _ => None,
        })
        .collect();
    assert_eq!((failed, failures(&rig)), (vec![Failure::Media], Vec::new()));
    rig.device = DeviceMood::Willing;
    rig.send(here(true)).send(Input::PlayAgain);
    until_plays(&mut rig);
    assert_eq!(rig.session.playing_model().cloned(), level);
    confirm(&mut rig);
}

/// Pages without what was shown and played on them, of which a retraced one has nothing.
fn without_media(pages: &[String]) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for page in pages {
        let mut page: serde_json::Value = serde_json::from_str(page).unwrap();
        page.as_object_mut().unwrap().remove("media");
        let page = page.to_string();
        if all.last() != Some(&page) {
            all.push(page);
        }
    }
    all
}

#[test]
fn failures_of_media_are_retraced_as_they_were_shown() {
    let mut rig = Rig::with_config(plain(), with(&[Medium::Picture]), Vec::new(), start());
    (rig.pages, rig.watched) = (Some(Vec::new()), false);
    rig.until("Reference").send(here(true)).send(Input::Advance);
    // It comes too late; then it was not seen to its end, which is said once the questions are there.
    came(&mut rig, Medium::Picture, 130.0, 1.0);
    rig.until("Reference").send(here(true)).send(Input::Advance);
    came(&mut rig, Medium::Picture, 20.0, 1.0);
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Form");
    rig.wait(1.0);
    lost(&mut rig, 2, Loss::Asleep);
    finish(&mut rig);
    rig.assert_whole();
    assert_eq!(failures(&rig).len(), 2);
    let protocol = Arc::new(plain());
    let mut again = Vec::new();
    for page in retrace::pages(&|_| protocol.clone(), &rig.journal) {
        record(&mut again, &page.view);
    }
    let shown = without_media(rig.pages.as_ref().unwrap());
    assert_equal(&shown, &without_media(&again));
}
