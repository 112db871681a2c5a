//! Numbers that a controller program sends: what counts, and what is named in the journal.

use super::device::screen;
use super::rig::{DeviceMood, Rig};
use super::studies::plain;
use std::collections::BTreeMap;
use study_base::text::{ParticipantId, QuestionId};
use study_plan::protocol::{DeviceNumber, Measure, OutcomeRules, Protocol, Transform};
use study_session::outcome::fold::attempt_rows;
use study_session::outcome::{AttemptEvent, Choice, Event, SentFault, SentNumber};
use study_session::session::Input;

/// A study whose device sends a time and a count.
fn study() -> Protocol {
    let id = |name: &str| QuestionId::new(name).unwrap();
    let outcome = |name: &str, measure: &str, unit: &str| OutcomeRules {
        id: id(name),
        measure: Measure::Device(DeviceNumber {
            name: id(measure),
            unit: unit.to_owned(),
        }),
        better: None,
        transform: Transform::Identity,
        model: None,
        of: None,
    };
    Protocol {
        outcomes: vec![
            outcome("duration", "time", "s"),
            outcome("missed", "errors", "1"),
        ],
        ..plain()
    }
}

fn sent(numbers: &[(&str, Option<f64>)], outside: bool) -> Input {
    let number = |(key, value): &(&str, Option<f64>)| SentNumber {
        key: (*key).to_owned(),
        value: *value,
        fault: None,
    };
    Input::DeviceNumbers {
        numbers: numbers.iter().map(number).collect(),
        outside,
    }
}

fn recorded(rig: &Rig) -> Vec<(String, Option<SentFault>)> {
    rig.events()
        .filter_map(|event| match event {
            Event::NumbersSent { numbers, .. } => Some(numbers),
            _ => None,
        })
        .flatten()
        .map(|number| (number.key.clone(), number.fault))
        .collect()
}

#[test]
fn numbers_of_a_playback_count_and_nothing_that_was_sent_is_lost() {
    let mut rig = Rig::new(study());
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance).send(Input::DeviceLoaded);
    // It has not started.
    rig.send(sent(&[("time_s", Some(1.0))], false));
    rig.send(Input::DeviceStarted);
    let mixed = [
        ("time_s", Some(3.2)),
        ("time_ms", Some(3200.0)),
        ("errors", None),
        ("foot_n", Some(2.0)),
    ];
    rig.send(sent(&mixed, false));
    rig.send(sent(&[("time_s", Some(9.0))], false));
    rig.send(Input::Advance);
    rig.send(sent(&[("errors", Some(2.0)), ("errors", Some(4.0))], false));
    let playback = rig.playback;
    rig.send(Input::DeviceStopped(playback));
    assert_eq!(screen(&rig), "Form");
    rig.send(sent(&[("errors", Some(7.0))], true));
    assert_eq!(screen(&rig), "Form");

    let expected = [
        ("time_s", Some(SentFault::OutsidePlayback)),
        ("time_s", None),
        ("time_ms", Some(SentFault::OtherUnit)),
        ("errors", Some(SentFault::NoNumber)),
        ("foot_n", Some(SentFault::Undeclared)),
        ("time_s", Some(SentFault::Twice)),
        ("errors", None),
        ("errors", Some(SentFault::Twice)),
        ("errors", Some(SentFault::OutsidePlayback)),
    ];
    let found = recorded(&rig);
    let found: Vec<(&str, Option<SentFault>)> = found
        .iter()
        .map(|(key, fault)| (key.as_str(), *fault))
        .collect();
    assert_eq!(found, expected);

    let row = &rig.session.history().rating_rows(&study())[0];
    let counted = BTreeMap::from([("duration".to_owned(), 3.2), ("missed".to_owned(), 2.0)]);
    assert_eq!(row.sent, counted);
    // Outcomes can be declared later: the force was recorded.
    let mut later = study();
    if let Measure::Device(number) = &mut later.outcomes[0].measure {
        (number.name, number.unit) = (QuestionId::new("foot").unwrap(), "N".to_owned());
    }
    let row = &rig.session.history().rating_rows(&later)[0];
    assert_eq!(row.sent["duration"], 2.0);

    let id = ParticipantId::new("P01").unwrap();
    let rows = attempt_rows(rig.session.history(), &id, 1, &rig.journal);
    let refused: Vec<(Option<u32>, &str)> = (rows.iter())
        .filter(|row| row.what == AttemptEvent::NumberSent)
        .map(|row| (row.trial, row.text.as_str()))
        .collect();
    assert_eq!(
        refused,
        [
            (None, "time_s 1: outside-playback"),
            (
                Some(1),
                "time_ms 3200: other-unit; errors: no-number; foot_n 2: undeclared"
            ),
            (Some(1), "time_s 9: twice"),
            (Some(1), "errors 4: twice"),
            (Some(1), "errors 7: outside-playback"),
        ]
    );
}

/// A trial that is felt anew has the numbers of the attempt that counts.
#[test]
fn numbers_of_a_failed_attempt_do_not_count() {
    let mut rig = Rig::new(study());
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance).send(Input::DeviceLoaded);
    rig.send(Input::DeviceStarted);
    rig.send(sent(&[("time_s", Some(3.0))], false));
    rig.send(Input::DeviceFault("too hot".to_owned()));
    rig.send(sent(&[("time_s", Some(4.0))], false));
    let rows = rig.session.history().rating_rows(&study());
    assert!(rows.iter().all(|row| row.sent.is_empty()));
    let faults: Vec<Option<SentFault>> = recorded(&rig).into_iter().map(|(_, f)| f).collect();
    assert_eq!(faults, [None, Some(SentFault::OutsidePlayback)]);
}

/// Programs send more keys than a study asks for.
#[test]
fn without_a_declared_number_nothing_is_recorded() {
    let mut rig = Rig::new(plain());
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance).send(Input::DeviceLoaded);
    rig.send(Input::DeviceStarted);
    rig.send(sent(&[("time_s", Some(3.2))], false));
    assert!(recorded(&rig).is_empty());
}

/// Whoever dropped out is no part of the study any more.
#[test]
fn nothing_is_recorded_of_who_dropped_out() {
    let mut begun = Rig::new(study());
    begun.until_reference(1);
    let mut rig = Rig::back(study(), begun.journal.clone(), 50.0 * 3600.0);
    rig.identify();
    assert_eq!(screen(&rig), "ResumeChoice");
    rig.send(Input::Resume(Choice::DropOut));
    assert_eq!(screen(&rig), "End");
    let before = rig.journal.len();
    rig.send(sent(&[("time_s", Some(3.2))], true));
    assert_eq!(rig.journal.len(), before);
}
