//! Trials of several intervals: pairs and tracks.

use super::part_rig::*;
use super::rig::{DeviceMood, Rig};
use study_plan::protocol::{Answer, QuestionKind, Seat, Stimuli, kinds};
use study_session::outcome::{Event, Failure, FormId};
use study_session::session::{Effect, Input, Screen};

#[test]
fn a_track_after_a_fault_a_bad_trial_a_correction_and_a_resume_is_the_one_without() {
    for procedure in [STAIRCASE, QUEST] {
        let protocol = track("2ifc", procedure, "easy = 0.1");
        let mut calm = Rig::new(protocol.clone());
        finish(&mut calm);
        let expected = recorded(&calm, &protocol);
        assert!(expected.len() >= 14, "{}", expected.len());

        let mut rig = Rig::new(protocol.clone());
        // A fault in the second interval of the third trial.
        until(&mut rig, 2, second);
        rig.send(Input::DeviceFault("no bus".to_owned()));
        // A wrong answer that is corrected two trials later.
        until(&mut rig, 5, reference);
        let earlier = rig.view().correctable[1].clone();
        let Answer::Choice(given) = &earlier.answer else {
            panic!()
        };
        let other = if given[0] == "first" {
            "second"
        } else {
            "first"
        };
        rig.send(Input::Correct {
            form: earlier.form,
            question: earlier.id().clone(),
            answer: Answer::Choice(vec![other.to_owned()]),
            reason: "a slip".to_owned(),
            by: study_session::outcome::Author::Participant,
        });
        assert_eq!(rig.count(|e| matches!(e, Event::Corrected { .. })), 1);
        // A trial that is marked as bad after its answer.
        until(&mut rig, 8, reference);
        rig.send(Input::MarkBad {
            reason: "noise".to_owned(),
        });
        // The program ends during an interval, and again before an answer.
        until(&mut rig, 10, second);
        rig.send(Input::Quit);
        let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 60.0);
        until(&mut rig, 12, answering);
        rig.send(Input::Abort("power".to_owned()));
        let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 30.0);
        finish(&mut rig);

        assert_eq!(recorded(&rig, &protocol), expected, "{procedure}");
        let rows = rig.session.history().rating_rows(&protocol);
        assert_eq!(rows.iter().filter(|r| r.corrected).count(), 1);
        let failed = rig.count(|e| matches!(e, Event::AttemptFailed { .. }));
        assert_eq!(failed, 3);
    }
}

#[test]
fn a_corrected_answer_counts_in_the_table_and_not_in_the_track() {
    let protocol = track("2ifc", STAIRCASE, "");
    let mut rig = Rig::new(protocol.clone());
    until(&mut rig, 4, reference);
    let before = recorded(&rig, &protocol);
    let last = rig.view().correctable[0].clone();
    let Answer::Choice(given) = &last.answer else {
        panic!()
    };
    let other = if given[0] == "first" {
        "second"
    } else {
        "first"
    };
    let correct = |rig: &Rig| {
        rig.session.history().rating_rows(&protocol)[3]
            .correct
            .unwrap()
    };
    let was = correct(&rig);
    rig.send(Input::Correct {
        form: last.form,
        question: last.id().clone(),
        answer: Answer::Choice(vec![other.to_owned()]),
        reason: "a slip".to_owned(),
        by: study_session::outcome::Author::Participant,
    });
    assert_eq!(recorded(&rig, &protocol), before);
    assert_eq!(correct(&rig), !was);
}

#[test]
fn the_end_of_a_track_drops_its_other_trials_and_a_bad_last_trial_brings_them_back() {
    let protocol = track("2ifc", STAIRCASE, "");
    let mut rig = Rig::new(protocol.clone());
    assert_eq!(rig.count(|_| true), 0);
    finish(&mut rig);
    let ended = |e: &Event| matches!(e, Event::TrackEnded { finished: true, .. });
    assert_eq!(rig.count(ended), 1);
    let rows = rig.session.history().rating_rows(&protocol);
    assert_eq!(rows.len(), done(&rig));
    assert!(rows.len() < rig.schedule().len(), "{}", rows.len());
    assert!(
        rows.iter()
            .all(|r| r.model.is_none() && r.correct.is_some())
    );

    // The last answer of the track was given by mistake.
    let trials = rows.len();
    let mut rig = Rig::new(protocol.clone());
    until(&mut rig, trials - 1, answering);
    // Not confirmed as saved yet, so that the session has not ended.
    rig.store = super::rig::StoreMood::Slow;
    let answers = observed(&rig);
    rig.send(Input::Answer(answers));
    rig.send(Input::MarkBad {
        reason: "wrong key".to_owned(),
    });
    rig.store = super::rig::StoreMood::Prompt;
    let saved = rig.all_on_disk();
    rig.send(saved);
    finish(&mut rig);
    assert_eq!(rig.session.history().rating_rows(&protocol).len(), trials);
}

#[test]
fn restarting_a_block_takes_its_answers_from_the_track() {
    let protocol = track("2ifc", QUEST, "");
    let mut rig = Rig::new(protocol.clone());
    // A block has four trials.
    until(&mut rig, 6, reference);
    let told = recorded(&rig, &protocol);
    rig.send(Input::Quit);
    let mut rig = Rig::back(protocol.clone(), rig.journal.clone(), 100_000.0);
    rig.identify();
    rig.send(Input::Resume(study_session::outcome::Choice::RestartBlock));
    assert_eq!(recorded(&rig, &protocol), told[..4]);
    finish(&mut rig);
    assert_eq!(recorded(&rig, &protocol).len(), 16);
}

#[test]
fn every_interval_is_loaded_anew_and_starts_after_the_same_gap() {
    let protocol = track("same-different", QUEST, "");
    let mut rig = Rig::new(protocol.clone());
    until(&mut rig, 12, reference);
    let loads = rig
        .effects
        .iter()
        .filter(|e| matches!(e, Effect::Load { .. }));
    assert_eq!(loads.count(), 24);
    let same = |t: &study_plan::protocol::Trial| match &t.stimuli {
        Stimuli::Track { intervals, .. } => intervals[0] == intervals[1],
        _ => false,
    };
    let schedule = rig.schedule();
    let equal = schedule[..12].iter().filter(|t| same(t)).count();
    assert!((3..=9).contains(&equal), "{equal}");
    let gaps: Vec<f64> =
        study_session::outcome::fold::interval_rows(rig.session.history(), &protocol)
            .iter()
            .filter_map(|row| row.gap_s)
            .collect();
    assert_eq!(gaps.len(), 12);
    assert!(
        gaps.iter()
            .all(|gap| *gap >= 1.0 && (gap - gaps[0]).abs() < 1e-9),
        "{gaps:?}"
    );
}

/// How long a realization takes to load must not be noticed: a load that outlasts the gap
/// makes it a whole multiple.
#[test]
fn a_slow_load_delays_the_next_interval_by_whole_gaps() {
    let mut rig = Rig::new(pairs("gap_s = 1.0"));
    until(&mut rig, 0, |s| matches!(s, Screen::Playing { .. }));
    rig.device = DeviceMood::Silent;
    let playback = rig.playback;
    rig.wait(3.0)
        .send(Input::Advance)
        .send(Input::DeviceStopped(playback));
    let starts = |rig: &Rig| {
        let started = |e: &&Effect| matches!(e, Effect::Start);
        rig.effects.iter().filter(started).count()
    };
    rig.wait(1.7).send(Input::DeviceLoaded);
    assert_eq!(starts(&rig), 1, "1.7 s after the first interval");
    rig.wait(0.2);
    assert_eq!(starts(&rig), 1, "1.9 s");
    rig.wait(0.2);
    assert_eq!(starts(&rig), 2, "2.1 s");
}

#[test]
fn a_failed_second_interval_brings_the_whole_pair_back() {
    let protocol = pairs("tie = true");
    let mut rig = Rig::new(protocol.clone());
    until(&mut rig, 1, second);
    let failing = rig.session.history().open().unwrap().trial.trial;
    rig.send(Input::DeviceFault("no bus".to_owned()));
    finish(&mut rig);
    let starts =
        rig.count(|e| matches!(e, Event::PlaybackStarted { trial, .. } if *trial == failing));
    assert_eq!(starts, 4, "both intervals twice");
    let rows = rig.session.history().rating_rows(&protocol);
    assert_eq!(rows.len(), 6);
    assert!(
        rows.iter()
            .all(|r| r.answers.len() == 1 && r.correct.is_none())
    );
    let attempts: Vec<_> = rows.iter().filter(|r| r.attempt == Some(2)).collect();
    assert_eq!(attempts.len(), 1);
    assert_eq!(attempts[0].trial, failing);
}

#[test]
fn a_trial_is_replayed_as_often_as_the_part_permits_and_never_after_an_answer() {
    let mut rig = Rig::new(pairs("exposure = { replays = 1 }"));
    until(&mut rig, 0, answering);
    assert!(rig.view().can_replay);
    assert!(rig.view().has_replays);
    rig.send(Input::PlayAgain);
    assert!(!answering(&rig.view().screen));
    until(&mut rig, 0, answering);
    assert!(!rig.view().can_replay);
    rig.send(Input::PlayAgain);
    assert!(answering(&rig.view().screen), "once only");
    until(&mut rig, 1, reference);
    let protocol = pairs("exposure = { replays = 1 }");
    let row = &rig.session.history().rating_rows(&protocol)[0];
    assert_eq!(row.replays, Some(1));
    assert_eq!(row.exploration_s, Some(12.0), "four times 3 s");
    let mut rig = Rig::new(pairs(""));
    until(&mut rig, 0, answering);
    assert!(!rig.view().can_replay && !rig.view().has_replays);
}

#[test]
fn an_interval_is_felt_neither_too_short_nor_too_long() {
    let mut rig = Rig::new(pairs("exposure = { min_s = 2, max_s = 5 }"));
    until(&mut rig, 0, |s| matches!(s, Screen::Playing { .. }));
    rig.wait(1.0).send(Input::Advance);
    assert!(matches!(
        rig.view().screen,
        Screen::Playing {
            keep_exploring: true,
            ..
        }
    ));
    rig.wait(3.5);
    assert!(matches!(
        rig.view().screen,
        Screen::Playing {
            keep_exploring: false,
            ..
        }
    ));
    rig.wait(1.0);
    let ended = |e: &Event| {
        matches!(
            e,
            Event::PlaybackEnded {
                interval: Some(1),
                stopped: false,
                ..
            }
        )
    };
    assert_eq!(rig.count(ended), 1, "it stops by itself");
}

#[test]
fn a_stop_in_the_first_interval_repeats_the_trial() {
    let protocol = pairs("");
    let mut rig = Rig::new(protocol);
    until(&mut rig, 0, |s| matches!(s, Screen::Playing { .. }));
    rig.send(Input::Stop);
    assert!(matches!(
        rig.view().screen,
        Screen::Stopped { can_rate: false }
    ));
    rig.send(Input::PlayAgain);
    until(&mut rig, 1, reference);
    let failed = |e: &Event| {
        matches!(
            e,
            Event::AttemptFailed {
                failure: Failure::Stopped,
                ..
            }
        )
    };
    assert_eq!(rig.count(failed), 1);
}

#[test]
fn feedback_says_if_the_answer_was_correct_and_only_where_it_is_wanted() {
    for (more, wanted) in [("feedback = true", true), ("", false)] {
        let protocol = track("2ifc", STAIRCASE, more);
        let mut rig = Rig::new(protocol.clone());
        let mut said = Vec::new();
        while done(&rig) < 12 {
            step(&mut rig);
            if let Screen::Message { text, .. } = &rig.view().screen {
                said.push(text.contains("not"));
            }
        }
        let rows = rig.session.history().rating_rows(&protocol);
        let wrong: Vec<bool> = rows.iter().filter_map(|r| r.correct).map(|c| !c).collect();
        assert!(wrong.contains(&true) && wrong.contains(&false));
        match wanted {
            true => assert_eq!(said, wrong),
            false => assert!(said.is_empty()),
        }
    }
}

#[test]
fn the_pages_of_a_trial_are_the_same_whatever_it_presents() {
    for protocol in [
        pairs(""),
        beside_a_reference(),
        magnitudes(),
        identification("feedback = \"never\""),
        similarity("identical = true"),
        ranking("ties = true\nrepetitions = 3"),
        track("2ifc", STAIRCASE, "easy = 0.3"),
        track("3ifc", STAIRCASE, "easy = 0.3"),
        track("abx", QUEST, ""),
        track("same-different", QUEST, ""),
        track("odd-one-out", QUEST, ""),
        track("yes-no", QUEST, ""),
    ] {
        let pages = |row: u32| {
            let mut rig = Rig::new(protocol.clone());
            rig.seat = Seat::Row(row);
            let mut pages = Vec::new();
            while done(&rig) < 2 {
                rig.step();
                pages.push(format!("{:?}", rig.view()));
            }
            let schedule = rig.schedule();
            let trials = schedule[..2].iter().map(|t| format!("{:?}", t.stimuli));
            (pages, trials.collect::<Vec<_>>())
        };
        let (first, presented) = pages(1);
        let mut others = 0;
        for row in 2..12 {
            let (same, other) = pages(row);
            assert_eq!(same, first);
            others += usize::from(other != presented);
        }
        assert!(others > 3, "{others}");
    }
}

#[test]
fn no_page_has_the_name_of_a_level_or_of_its_family() {
    let protocol = track("2ifc", STAIRCASE, "");
    let mut rig = Rig::new(protocol);
    until(&mut rig, 3, second);
    rig.send(Input::DeviceFault(
        "damping.12 is not passive; up.standard neither".to_owned(),
    ));
    let shown = format!("{:?}", rig.view());
    assert!(
        !shown.contains("damping.") && !shown.contains("up.standard"),
        "{shown}"
    );
}

#[test]
fn the_text_of_a_part_is_shown_once_before_its_first_trial() {
    let text = |n: usize| {
        format!(
            "[[parts]]\nid = \"p{n}\"\nkind = \"pairs\"\nprompt = \"?\"\nrepetitions = 1\ntext = \"Part {n}\"\n"
        )
    };
    let protocol = read(&format!(
        "[analysis]\nprimary = \"p1\"\n{}{}",
        text(1),
        text(2)
    ));
    let mut rig = Rig::new(protocol.clone());
    let mut shown = Vec::new();
    let note = |rig: &Rig, shown: &mut Vec<(usize, String)>| {
        if let Screen::Message { text, .. } = &rig.view().screen {
            shown.push((done(rig), text.clone()));
        }
    };
    while done(&rig) < 4 {
        step(&mut rig);
        note(&rig, &mut shown);
    }
    rig.send(Input::Quit);
    let mut rig = Rig::back(protocol, rig.journal.clone(), 10.0);
    while rig.ending.is_none() {
        step(&mut rig);
        note(&rig, &mut shown);
    }
    let expected = [(0, "Part 1".to_owned()), (3, "Part 2".to_owned())];
    assert_eq!(shown, expected);
}

#[test]
fn a_form_of_a_part_has_its_own_questions() {
    let protocol = pairs("");
    let mut rig = Rig::new(protocol);
    until(&mut rig, 0, answering);
    let Screen::Form {
        questions, form, ..
    } = rig.view().screen
    else {
        panic!()
    };
    assert_eq!(questions[0].id.as_str(), "real");
    assert!(matches!(form, FormId::Trial { .. }));
}

/// People read the answers in their language; files have the words of the program.
#[test]
fn answers_are_shown_in_the_language_of_the_study_and_stored_in_one() {
    let mut protocol = pairs("tie = true");
    protocol.text.lang = Some("de".to_owned());
    let mut rig = Rig::new(protocol.clone());
    until(&mut rig, 0, answering);
    let Screen::Form { questions, .. } = rig.view().screen else {
        panic!()
    };
    let QuestionKind::Choice(kinds::Choice { options, .. }) = &questions[0].kind else {
        panic!()
    };
    assert_eq!(options, &["erstes", "zweites", "kein Unterschied"]);
    let id = questions[0].id.clone();
    let shown = Answer::Choice(vec![options[2].clone()]);
    rig.send(Input::Answer(vec![(id.clone(), shown.clone())]));
    until(&mut rig, 1, reference);
    let stored = |rig: &Rig| rig.session.history().rating_rows(&protocol)[0].answers[&id].clone();
    assert_eq!(stored(&rig), Answer::Choice(vec!["tie".to_owned()]));
    // The correction shows and takes the words of the language, too.
    let given = rig.view().correctable[0].clone();
    assert_eq!(given.answer, shown);
    rig.send(Input::Correct {
        form: given.form,
        question: id.clone(),
        answer: Answer::Choice(vec!["zweites".to_owned()]),
        reason: "a slip".to_owned(),
        by: study_session::outcome::Author::Participant,
    });
    assert_eq!(stored(&rig), Answer::Choice(vec!["second".to_owned()]));
}

/// A realization is rated after its reference, and the screen says which is which.
#[test]
fn a_reference_is_felt_first_and_named() {
    let protocol = beside_a_reference();
    let mut rig = Rig::new(protocol.clone());
    let first = |screen: &Screen| {
        matches!(
            screen,
            Screen::Playing {
                interval: Some((1, 2)),
                ..
            }
        )
    };
    until(&mut rig, 0, first);
    assert_eq!(rig.view().interval_name(1), "reference");
    until(&mut rig, 0, second);
    assert_eq!(rig.view().interval_name(2), "rate this one");
    until(&mut rig, 1, reference);
    let row = &rig.session.history().rating_rows(&protocol)[0];
    assert_eq!(row.model.as_ref(), rig.schedule()[0].model());
    finish(&mut rig);
    assert_eq!(rig.session.history().rating_rows(&protocol).len(), 6);
}
