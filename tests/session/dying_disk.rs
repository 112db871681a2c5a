//! A disk that fails at every call from some call on: what the session says is saved is
//! saved, and its end names the rest.

use crate::memory::{Crash, Fault, MemoryDisk};
use crate::world::{Kept, at};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use study::runner::clock::VirtualClock;
use study::runner::saver::Saving;
use study::runner::{Ended, Runner, Setup};
use study_device::manual::Manual;
use study_plan::protocol::{Answer, Consent, DeviceKind};
use study_session::outcome::Event;
use study_session::session::{Config, Ending, Input, Screen, View};
use study_session::store::{SeatKind, StudyFolder};

/// What an operator does who plays until something is not saved, tries once more to save
/// it, and then leaves.
struct Operator {
    leave: Input,
    retried: bool,
    /// The numbers of ratings entered.
    rated: i64,
    /// Whether initials were typed.
    signed: bool,
}

impl Operator {
    fn turn(&mut self, view: &View) -> Vec<Input> {
        match &view.screen {
            Screen::Who { .. } if view.notice.is_some() => vec![self.leave.clone()],
            Screen::SaveTrouble { .. } if !self.retried => {
                self.retried = true;
                vec![Input::RetrySave]
            }
            Screen::SaveTrouble { .. } => vec![self.leave.clone()],
            Screen::Message { .. }
            | Screen::Reference { .. }
            | Screen::Mount { .. }
            | Screen::Playing { .. }
            | Screen::End { .. } => vec![Input::Advance],
            Screen::Stopped { .. } => vec![Input::RateStopped],
            Screen::Consent { .. } => vec![Input::Consent(true)],
            Screen::Form { questions, .. } => {
                let mut answers = Vec::new();
                for question in questions {
                    let answer = match question.id.as_str() {
                        "realism" => {
                            self.rated += 1;
                            Answer::Rating(self.rated)
                        }
                        "initials" => {
                            self.signed = true;
                            Answer::Text("QXJ".to_owned())
                        }
                        _ => Answer::Text(format!("about {}", self.rated)),
                    };
                    answers.push((question.id.clone(), answer));
                }
                vec![Input::Answer(answers)]
            }
            _ => Vec::new(),
        }
    }
}

struct Session {
    ended: Ended,
    /// Ratings entered.
    rated: i64,
    /// Whether initials were typed.
    signed: bool,
    /// The participant's copy of the consent document that is on the disk.
    copy: Option<String>,
    /// The last view, and the most trials that a view has shown as saved.
    last: View,
    saved: u32,
    on_disk: Vec<Event>,
    calls: usize,
}

fn session(from: usize, leave: &Input) -> Option<Session> {
    session_of(Kept::new(), from, leave)
}

fn session_of(mut kept: Kept, from: usize, leave: &Input) -> Option<Session> {
    kept.protocol.device.kind = DeviceKind::Manual;
    let disk = MemoryDisk::new();
    disk.plan(from, Fault::From(ErrorKind::Other));
    let results = Path::new("results");
    let frozen = kept.frozen();
    let study =
        StudyFolder::open_or_create_on(Arc::new(disk.clone()), results, &frozen, at(0)).ok()?;
    let path = study.path().to_owned();
    let clock = VirtualClock::starting_at(at(0).wall);
    let setup = Setup {
        protocol: Arc::new(kept.protocol.clone()),
        orders: None,
        models: BTreeMap::new(),
        fingerprints: kept.fingerprints.clone(),
        study,
        kind: SeatKind::Real,
        rows: None,
        group: None,
        device_kind: DeviceKind::Manual,
        device: Box::new(Manual::default()),
        deliveries: Default::default(),
        device_check: None,
        self_weighed: None,
        clock: Box::new(clock.clone()),
        saving: Saving::Loop,
    };
    let config = Config {
        participant: "P01".to_owned(),
        operator: "lw".to_owned(),
        auto_identify: true,
        ..Config::default()
    };
    let mut runner = Runner::new(setup, config);
    let mut operator = Operator {
        leave: leave.clone(),
        retried: false,
        rated: 0,
        signed: false,
    };
    let mut last = runner.view();
    let mut saved = 0;
    for _ in 0..10_000 {
        clock.advance(Duration::from_millis(500));
        let view = runner.view();
        saved = saved.max(view.line.trials_saved);
        if !matches!(view.screen, Screen::Saving) {
            last = view.clone();
        }
        if let Some(ended) = runner.step(operator.turn(&view)) {
            drop(runner);
            let after = disk.after(Crash::OnlySynced);
            let files = after.files();
            let copy = files.iter().find(|(path, _)| path.ends_with("consent.txt"));
            let copy = copy.map(|(_, bytes)| String::from_utf8(bytes.clone()).unwrap());
            let found = StudyFolder::open_on(Arc::new(after), &path);
            let sessions = found.unwrap().sessions().unwrap();
            let entries = sessions.into_iter().flat_map(|s| s.entries);
            return Some(Session {
                ended,
                rated: operator.rated,
                signed: operator.signed,
                copy,
                last,
                saved,
                on_disk: entries.map(|e| e.event).collect(),
                calls: disk.calls(),
            });
        }
    }
    panic!("it does not end: {:?}", runner.view().screen)
}

fn ratings<'a>(events: impl IntoIterator<Item = &'a Event>) -> Vec<i64> {
    let rating = |event: &Event| match event {
        Event::Answered {
            answer: Answer::Rating(n),
            ..
        } => Some(*n),
        _ => None,
    };
    events.into_iter().filter_map(rating).collect()
}

#[test]
fn nothing_is_lost_without_being_named_whenever_the_disk_dies() {
    let whole = session(usize::MAX, &Input::Quit).unwrap();
    assert_eq!(whole.ended.ending, Ending::Finished);
    assert_eq!(whole.ended.unsaved, None);
    assert_eq!(ratings(&whole.on_disk), [1, 2, 3]);
    let mut unsaved_answers = 0;
    for leave in [Input::Quit, Input::Abort("SIGTERM".to_owned())] {
        for from in 0..whole.calls {
            let Some(session) = session(from, &leave) else {
                continue;
            };
            let done = |e: &&Event| matches!(e, Event::TrialDone { .. });
            let done = session.on_disk.iter().filter(done).count();
            assert!(
                session.saved as usize <= done,
                "call {from}: shown as saved"
            );
            let Some(unsaved) = &session.ended.unsaved else {
                assert_eq!(
                    ratings(&session.on_disk),
                    (1..=session.rated).collect::<Vec<_>>()
                );
                continue;
            };
            let events: Vec<&Event> = unsaved.events.iter().map(|(_, e)| e).collect();
            let mut all = ratings(&session.on_disk);
            // What could not be synced may still be on the disk.
            all.extend(ratings(events.iter().copied()));
            all.dedup();
            assert_eq!(all, (1..=session.rated).collect::<Vec<_>>(), "call {from}");
            assert!(unsaved.why.is_some(), "call {from}");
            for rating in ratings(events) {
                unsaved_answers += 1;
                let named = |names: &[String]| {
                    let end = format!(": realism = {rating}");
                    names.iter().any(|name| name.ends_with(&end))
                };
                assert!(named(&unsaved.what), "call {from}: {:?}", unsaved.what);
                assert!(named(&session.last.unsaved), "call {from}: on the screen");
                assert!(!session.last.line.all_saved, "call {from}");
            }
        }
    }
    assert!(unsaved_answers > 0, "nothing was tested");
}

/// A study whose participants read a text and type initials.
fn signed() -> Kept {
    let mut kept = Kept::new();
    kept.protocol.consent = Some(Consent {
        document: "Information".to_owned(),
        version: "2".to_owned(),
        file: None,
        text: Some("You turn a switch.".to_owned()),
        initials: true,
    });
    kept
}

/// What was signed is on the disk before the journal says so; until then it is kept by the session, and its end names it.
#[test]
fn no_copy_of_a_consent_is_lost_whenever_the_disk_dies() {
    let is_copy =
        |copy: &str| copy.starts_with("Information, version 2") && copy.ends_with("\nQXJ\n");
    let agreed = |e: &Event| matches!(e, Event::Consented { accepted: true, .. });
    let whole = session_of(signed(), usize::MAX, &Input::Quit).unwrap();
    assert_eq!(whole.ended.ending, Ending::Finished);
    assert!(is_copy(whole.copy.as_ref().unwrap()));
    let mut kept = 0;
    for leave in [Input::Quit, Input::Abort("SIGTERM".to_owned())] {
        for from in 0..whole.calls {
            let Some(session) = session_of(signed(), from, &leave) else {
                continue;
            };
            let in_journal = session.on_disk.iter().any(agreed);
            assert!(!in_journal || session.copy.is_some(), "call {from}");
            let unsaved = session.ended.unsaved.as_ref();
            let Some(copy) = unsaved.and_then(|unsaved| unsaved.copy.as_ref()) else {
                assert!(!session.signed || in_journal, "call {from}: it is lost");
                continue;
            };
            kept += 1;
            assert!(is_copy(copy), "call {from}: {copy}");
            let named = |names: &[String]| {
                let own = |name: &String| name == "the participant's copy of the consent";
                names.iter().any(own)
            };
            let unsaved = unsaved.unwrap();
            assert!(named(&unsaved.what), "call {from}: {:?}", unsaved.what);
            assert!(named(&session.last.unsaved), "call {from}: on the screen");
            // The signature is in nothing but the copy.
            let shown = format!("{:?} {:?} {:?}", unsaved.what, unsaved.events, session.last);
            assert!(!shown.contains("QXJ"), "call {from}: {shown}");
        }
    }
    assert!(kept > 0, "nothing was tested");
}
