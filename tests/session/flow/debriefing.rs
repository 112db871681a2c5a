//! What the study was about: the last thing that is read, and the journal has that it was.

use super::retraced::{assert_equal, record};
use super::rig::Rig;
use super::studies::{plain, rich};
use std::sync::Arc;
use study_plan::protocol::{Debriefing, Entry, Protocol};
use study_session::outcome::{Event, FormId};
use study_session::page::participant;
use study_session::session::view::MessageKind;
use study_session::session::{Ending, Input, Screen, retrace};

const TEXT: &str = "It was about friction.\n\nNothing was random.";

fn debriefed(mut protocol: Protocol) -> Protocol {
    protocol.debriefing = Some(Debriefing {
        file: None,
        text: Some(TEXT.to_owned()),
    });
    protocol
}

/// Whether the page that says what the study was about is on the screen.
fn is_shown(rig: &Rig) -> bool {
    let screen = rig.view().screen;
    matches!(screen, Screen::Message { kind: MessageKind::Debriefing, text } if text == TEXT)
}

fn until_shown(rig: &mut Rig) {
    while !is_shown(rig) {
        assert!(rig.ending.is_none(), "it is not shown");
        rig.step();
    }
}

fn recorded(rig: &Rig) -> usize {
    rig.count(|e| *e == Event::Debriefed)
}

#[test]
fn it_is_shown_once_after_all_questions_and_recorded_before_the_end() {
    for (protocol, questions) in [(rich(), 2), (plain(), 0)] {
        let mut rig = Rig::new(debriefed(protocol));
        until_shown(&mut rig);
        let outro = |e: &Event| {
            matches!(
                e,
                Event::Answered {
                    form: FormId::Outro,
                    ..
                }
            )
        };
        assert_eq!(rig.count(outro), questions, "after the questions");
        assert_eq!(
            (recorded(&rig), rig.count(|e| *e == Event::Finished)),
            (0, 0)
        );
        let page = participant(&rig.view()).unwrap();
        assert_eq!(page.title, "About this study");
        assert_eq!(page.text, TEXT);
        assert!(page.buttons.iter().all(|b| b.enabled) && page.buttons.len() == 1);
        rig.wait(1.0).send(Input::Advance);
        assert!(matches!(rig.view().screen, Screen::End { .. }));
        let last: Vec<&Event> = rig.events().collect();
        assert_eq!(
            last[last.len() - 2..],
            [&Event::Debriefed, &Event::Finished]
        );
        rig.finish();
        rig.assert_whole();
        assert_eq!(recorded(&rig), 1);
    }
}

#[test]
fn without_one_nothing_is_shown_or_recorded() {
    let mut rig = Rig::new(rich());
    rig.finish();
    rig.assert_whole();
    assert_eq!(recorded(&rig), 0);
}

/// Who leaves before it was read reads it on coming back; no answer is asked again.
#[test]
fn a_session_that_is_left_on_it_shows_it_again() {
    let protocol = debriefed(rich());
    let mut rig = Rig::new(protocol.clone());
    until_shown(&mut rig);
    rig.send(Input::Quit);
    assert_eq!(rig.ending, Some(Ending::Interrupted));
    let answers = rig.count(|e| matches!(e, Event::Answered { .. }));
    let mut rig = Rig::back(protocol, rig.journal.clone(), 3600.0);
    rig.identify();
    assert!(is_shown(&rig), "{:?}", rig.view().screen);
    rig.finish();
    rig.assert_whole();
    assert_eq!(recorded(&rig), 1);
    assert_eq!(rig.count(|e| matches!(e, Event::Answered { .. })), answers);
}

/// The program ends after any event: it is recorded once, at the end.
#[test]
fn it_is_recorded_once_wherever_the_program_ended() {
    let protocol = debriefed(plain());
    let mut whole = Rig::new(protocol.clone());
    whole.finish();
    for k in 1..whole.journal.len() {
        let mut rig = Rig::back(protocol.clone(), whole.journal[..k].to_vec(), 10.0);
        rig.identify();
        rig.finish();
        rig.assert_whole();
        assert_eq!(recorded(&rig), 1, "after {k} events");
    }
}

#[test]
fn the_experimenter_reads_it_out_where_they_enter_the_answers() {
    let mut protocol = debriefed(rich());
    protocol.session.entry = Entry::Experimenter;
    let mut rig = Rig::new(protocol);
    until_shown(&mut rig);
    let page = study_session::page::page(&rig.view());
    assert_eq!(page.instruction, Some("Read out"));
}

#[test]
fn it_is_retraced_as_it_was_shown() {
    let protocol = debriefed(rich());
    let mut rig = Rig::new(protocol.clone());
    (rig.pages, rig.watched) = (Some(Vec::new()), false);
    rig.finish();
    let protocol = Arc::new(protocol);
    let mut again = Vec::new();
    for page in retrace::pages(&|_| protocol.clone(), &rig.journal) {
        record(&mut again, &page.view);
    }
    assert_equal(rig.pages.as_ref().unwrap(), &again);
    let shown = |page: &&String| page.contains("It was about friction.");
    assert_eq!(again.iter().filter(shown).count(), 1);
}
