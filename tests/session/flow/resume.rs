//! A session that was left, at every point, and picked up.

use super::rig::{Rig, name};
use super::studies::{plain, qid, rich};
use std::collections::BTreeSet;
use study_plan::protocol::{Answer, Protocol};
use study_session::outcome::{Author, Choice, Entry, Event, Failure, FormId, SelfWeighed, State};
use study_session::session::{Ending, Input, Screen};

fn screen(rig: &Rig) -> &'static str {
    name(&rig.view().screen)
}

/// A whole session in which everything goes wrong once.
fn eventful() -> Rig {
    let mut rig = Rig::new(rich());
    rig.until_reference(2).until("Playing");
    rig.send(Input::DeviceFault("too hot".to_owned()));
    rig.until("Playing")
        .send(Input::Stop)
        .send(Input::PlayAgain);
    rig.send(Input::Stop).send(Input::RateStopped);
    rig.answer_page().send(Input::Remark {
        by: Author::Participant,
        text: "it hums".to_owned(),
    });
    rig.until("Reference").send(Input::MarkBad {
        reason: "misunderstood".to_owned(),
    });
    rig.send(Input::Correct {
        form: FormId::Intake,
        question: qid("fatigue"),
        answer: Answer::Rating(6),
        reason: "misheard".to_owned(),
        by: Author::Experimenter,
    });
    rig.until("Form").send(Input::Pause).wait(20.0);
    while rig.count(|e| matches!(e, Event::TrialClosed { .. })) == 0 {
        rig.until("Playing");
        if rig.session.playing_model() == rig.schedule().last().and_then(|t| t.model()) {
            rig.send(Input::DeviceFault("broken".to_owned()));
        } else {
            rig.step();
        }
    }
    rig.finish();
    rig.assert_whole();
    rig
}

/// The answer that is there at the end, by place and question.
fn answers(journal: &[Entry]) -> Vec<(FormId, String, Answer)> {
    journal
        .iter()
        .filter_map(|e| match &e.event {
            Event::Answered {
                form,
                question,
                answer,
                ..
            } => Some((*form, question.to_string(), answer.clone())),
            _ => None,
        })
        .collect()
}

/// `rig` itself asserts that nothing is asked twice and nothing closed twice.
fn assert_picked_up(protocol: Protocol, journal: &[Entry], gap_s: f64) -> Rig {
    let mut rig = Rig::back(protocol, journal.to_vec(), gap_s);
    rig.identify();
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.journal[..journal.len()], *journal, "append only");
    let positions = rig.positions();
    let different: BTreeSet<_> = positions.iter().collect();
    assert_eq!(different.len(), positions.len(), "{positions:?}");
    rig
}

#[test]
fn a_session_can_be_picked_up_after_every_single_event() {
    let whole = eventful();
    let finished = whole.count(|e| *e == Event::Finished);
    assert_eq!(finished, 1);
    let last = whole.journal.len() - 1;
    assert!(last > 75, "{last} events are no full session");
    for k in 1..=last {
        let journal = &whole.journal[..k];
        let rig = assert_picked_up(rich(), journal, 60.0);
        let before = answers(journal);
        let after = answers(&rig.journal);
        assert_eq!(after[..before.len()], before[..], "after {k} events");
        assert_eq!(rig.count(|e| matches!(e, Event::Reopened { .. })), 1);
    }
}

#[test]
fn a_session_left_again_and_again_still_comes_to_its_end() {
    let mut journal = Vec::new();
    let mut sittings = 0;
    loop {
        let mut rig = Rig::back(rich(), journal.clone(), 30.0);
        rig.identify();
        let target = journal.len() + 6;
        while rig.journal.len() < target && rig.ending.is_none() {
            rig.step();
        }
        sittings += 1;
        assert!(sittings < 200, "it makes no headway");
        journal = rig.journal.clone();
        if rig.ending.is_some() {
            rig.assert_whole();
            break;
        }
    }
    assert!(sittings > 5);
}

#[test]
fn nothing_is_recorded_beyond_the_end_of_a_finished_session() {
    let whole = eventful();
    let mut rig = Rig::back(rich(), whole.journal.clone(), 60.0);
    rig.identify();
    assert_eq!(screen(&rig), "End");
    rig.send(Input::Advance);
    assert_eq!(rig.ending, Some(Ending::Finished));
    assert_eq!(rig.journal.len(), whole.journal.len());
}

/// Plays on until `stop`, and comes back to the journal after so many seconds.
fn left_at(protocol: &Protocol, gap_s: f64, stop: impl Fn(&mut Rig)) -> Rig {
    let mut rig = Rig::new(protocol.clone());
    stop(&mut rig);
    let mut back = Rig::back(protocol.clone(), rig.journal.clone(), gap_s);
    back.identify();
    back
}

#[test]
fn a_playback_that_was_interrupted_comes_next_and_costs_no_attempt() {
    for quit in [false, true] {
        let mut rig = left_at(&plain(), 60.0, |rig| {
            rig.until_reference(1).until("Playing");
            if quit {
                rig.send(Input::Quit);
            }
        });
        assert_eq!(screen(&rig), "Reference");
        let failed = |e: &Event| {
            matches!(
                e,
                Event::AttemptFailed {
                    trial: 2,
                    attempt: 1,
                    failure: Failure::Interrupted,
                    ..
                }
            )
        };
        assert_eq!(rig.count(failed), 1);
        rig.step();
        assert_eq!(rig.session.playing_model(), rig.schedule()[1].model());
        rig.finish();
        rig.assert_whole();
        assert_eq!(rig.closed()[&2], Some(2));
        assert_eq!(rig.positions(), [1, 2, 3, 4, 5, 6]);
    }
}

/// The motor weighs itself whenever a session is opened.
#[test]
fn what_the_motor_told_follows_the_start_and_each_resumption() {
    let weighed = |gain: f64| SelfWeighed {
        commissioning: "c1".to_owned(),
        ok: true,
        gain: Some(gain),
        lag_ms: Some(0.5),
        apparent_kg: Some(0.6),
        why: None,
    };
    let mut rig = Rig::new(plain());
    rig.self_weighed = Some(weighed(1.01));
    rig.until_reference(1).until("Playing");
    let mut back = Rig::back(plain(), rig.journal.clone(), 60.0);
    back.self_weighed = Some(weighed(0.99));
    back.identify().finish();
    back.assert_whole();
    let events: Vec<&Event> = back.events().collect();
    let told: Vec<(bool, f64)> = (events.windows(2))
        .filter_map(|pair| match pair {
            [before, Event::SelfWeighed(found)] => Some((
                matches!(before, Event::SessionStarted(_) | Event::Reopened { .. }),
                found.gain.unwrap(),
            )),
            _ => None,
        })
        .collect();
    assert_eq!(told, [(true, 1.01), (true, 0.99)]);
    // finished, it says nothing more
    let mut done = Rig::back(plain(), back.journal.clone(), 60.0);
    done.self_weighed = Some(weighed(1.0));
    done.identify();
    assert_eq!(done.journal, back.journal);
}

#[test]
fn a_rating_goes_on_at_the_first_question_that_was_not_answered() {
    let mut rig = left_at(&rich(), 60.0, |rig| {
        rig.until_reference(1).until("Form").wait(9.0).answer_page();
    });
    let Screen::Form {
        questions,
        page: 2,
        pages: 2,
        form,
        ..
    } = rig.view().screen
    else {
        panic!("{:?}", rig.view().screen);
    };
    assert_eq!(questions[0].id, qid("crispness"));
    rig.wait(5.0).answer_page();
    let response = rig.events().find_map(|e| match e {
        Event::TrialDone {
            trial, response_s, ..
        } if matches!(form, FormId::Trial { trial: t, .. } if t == *trial) => Some(*response_s),
        _ => None,
    });
    // The time over the gap counts.
    assert!((response.unwrap() - 74.0).abs() < 1e-6, "{response:?}");
}

/// How somebody leaves a session.
type Stop = fn(&mut Rig);

#[test]
fn a_trial_that_was_felt_too_long_ago_is_felt_again() {
    let stops: [(&str, Stop); 3] = [
        ("felt", |rig| {
            rig.until("Form");
        }),
        ("left", |rig| {
            rig.until("Form").send(Input::Quit);
        }),
        ("stopped", |rig| {
            rig.until("Playing").send(Input::Stop);
        }),
    ];
    for (what, stop) in stops {
        for (gap_s, kept) in [(59.0, true), (61.0, false), (3.5 * 3600.0, false)] {
            let mut rig = left_at(&plain(), gap_s, stop);
            assert_eq!(screen(&rig) != "Reference", kept, "{what} {gap_s}");
            let again = rig.events().find_map(|e| match e {
                Event::AttemptFailed {
                    trial: 1,
                    attempt: 1,
                    failure: Failure::Interrupted,
                    paused_s,
                    ..
                } => *paused_s,
                _ => None,
            });
            assert_eq!(again.is_none(), kept, "{what} {gap_s}");
            assert!(again.is_none_or(|s| (s - gap_s).abs() < 1e-3), "{again:?}");
            rig.finish();
            rig.assert_whole();
            let row = &rig.session.history().rating_rows(&plain())[0];
            assert_eq!(row.felt_again_after_s, again, "{what} {gap_s}");
        }
    }
}

/// Neither leaving again and again nor a clock that was set back makes a pause short.
#[test]
fn pauses_add_up_and_an_unknown_one_is_too_long() {
    let mut rig = left_at(&plain(), 40.0, |rig| {
        rig.until("Form");
    });
    assert_eq!(screen(&rig), "Form");
    let mut again = Rig::back(plain(), rig.journal.clone(), 40.0);
    again.identify();
    assert_eq!(screen(&again), "Reference");
    rig.answer_page();
    let row = &rig.session.history().rating_rows(&plain())[0];
    assert!((row.paused_s.unwrap() - 40.0).abs() < 1e-3);
    let back = left_at(&plain(), -86_400.0, |rig| {
        rig.until("Form");
    });
    assert_eq!(screen(&back), "Reference");
}

/// What was answered in time is not lost, however long the pause after it was; the row says so.
#[test]
fn a_trial_that_is_answered_in_part_goes_on_after_any_pause() {
    let mut rig = left_at(&rich(), 7200.0, |rig| {
        rig.until_reference(1).until("Form").answer_page();
    });
    assert!(matches!(rig.view().screen, Screen::Form { page: 2, .. }));
    let kept = answers(&rig.journal);
    rig.answer_page();
    assert_eq!(answers(&rig.journal)[..kept.len()], kept[..]);
    let paused = rig.events().filter_map(|e| match e {
        Event::TrialDone { paused_s, .. } => *paused_s,
        _ => None,
    });
    assert_eq!(paused.map(f64::round).collect::<Vec<_>>(), [7200.0]);
    rig.finish();
    rig.assert_whole();
}

#[test]
fn a_page_of_which_half_was_written_asks_the_other_half() {
    let mut rig = Rig::new(plain());
    rig.until("Form").answer_page();
    let cut = rig
        .events()
        .position(|e| matches!(e, Event::Answered { question, .. } if *question == qid("comment")));
    let mut back = Rig::back(plain(), rig.journal[..cut.unwrap()].to_vec(), 60.0);
    back.identify();
    let Screen::Form { questions, .. } = back.view().screen else {
        panic!("{:?}", back.view().screen);
    };
    assert_eq!(questions.len(), 1);
    assert_eq!(questions[0].id, qid("comment"));
    back.finish();
    back.assert_whole();
}

#[test]
fn a_stopped_playback_is_still_to_be_chosen_about() {
    let rig = left_at(&plain(), 60.0, |rig| {
        rig.until("Playing").send(Input::Stop);
    });
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: true });
}

#[test]
fn a_break_goes_on_for_what_is_left_of_it() {
    let rig = left_at(&rich(), 25.0, |rig| {
        rig.until("Break").wait(10.0);
    });
    let Screen::Break { wait_s, .. } = rig.view().screen else {
        panic!("{:?}", rig.view().screen);
    };
    assert!((30.0..=40.0).contains(&wait_s), "{wait_s}");
}

#[test]
fn earlier_ratings_stay_correctable_and_saved() {
    let mut rig = left_at(&plain(), 60.0, |rig| {
        rig.until_reference(3);
    });
    let view = rig.view();
    assert_eq!((view.line.trials_saved, view.line.trials_answered), (3, 3));
    assert_eq!(view.correctable.len(), 6);
    assert_eq!(view.correctable[0].title, "trial 3");
    assert_eq!(view.can_mark_bad.as_deref(), Some("trial 3"));
    rig.send(Input::MarkBad {
        reason: "misunderstood".to_owned(),
    });
    rig.finish();
    rig.assert_whole();
}

#[test]
fn after_a_long_gap_the_operator_chooses() {
    let soon = left_at(&plain(), 3.9 * 3600.0, |rig| {
        rig.until_reference(4);
    });
    assert_eq!(screen(&soon), "Reference", "within four hours it goes on");
    let mut rig = left_at(&plain(), 5.0 * 3600.0, |rig| {
        rig.until_reference(4);
    });
    let Screen::ResumeChoice {
        gap_h,
        done,
        total,
        restart,
    } = rig.view().screen
    else {
        panic!("{:?}", rig.view().screen);
    };
    assert!(restart);
    assert!((gap_h - 5.0).abs() < 1e-6);
    assert_eq!((done, total), (4, Some(6)));
    let before = rig.journal.len();
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "ResumeChoice", "Enter does not choose");
    rig.send(Input::Pause);
    let why = rig.view().notice.unwrap();
    assert!(why.contains("once the session goes on"), "{why}");
    assert_eq!(rig.journal.len(), before, "there is no pause");
    rig.send(Input::Resume(Choice::Continue));
    assert!(matches!(
        &rig.journal[before].event,
        Event::Reopened { choice: Some(Choice::Continue), queue, gap_s, .. }
            if *queue == [5, 6] && (*gap_s - 18_000.0).abs() < 1e-6
    ));
    rig.finish();
    rig.assert_whole();
}

#[test]
fn quitting_the_choice_or_remarking_there_leaves_it_to_be_made() {
    let mut rig = left_at(&plain(), 5.0 * 3600.0, |rig| {
        rig.until_reference(4);
    });
    rig.send(Input::Remark {
        by: Author::Experimenter,
        text: "a day later".to_owned(),
    });
    rig.send(Input::Quit);
    assert_eq!(rig.ending, Some(Ending::Interrupted));
    let mut again = Rig::back(plain(), rig.journal.clone(), 60.0);
    again.identify();
    assert_eq!(screen(&again), "ResumeChoice");
}

#[test]
fn a_restarted_block_is_felt_again_as_a_whole() {
    for stop in ["Reference", "Playing", "Form"] {
        let mut rig = left_at(&plain(), 5.0 * 3600.0, |rig| {
            rig.until_reference(4).until(stop);
        });
        let before = rig.journal.len();
        rig.send(Input::Resume(Choice::RestartBlock));
        assert_eq!(screen(&rig), "Reference", "{stop}");
        let queue = rig.journal[before..].iter().find_map(|e| match &e.event {
            Event::Reopened { queue, .. } => Some(queue.clone()),
            _ => None,
        });
        assert_eq!(queue.unwrap(), [4, 5, 6], "{stop}");
        assert_eq!(rig.view().line.trials_answered, 3);
        assert_eq!(rig.view().correctable[0].title, "trial 3");
        rig.finish();
        rig.assert_whole();
        assert_eq!(rig.closed()[&4], Some(2), "{stop}");
    }
}

#[test]
fn a_participant_who_does_not_come_back_drops_out() {
    let mut rig = left_at(&plain(), 50.0 * 3600.0, |rig| {
        rig.until_reference(4);
    });
    rig.send(Input::Resume(Choice::DropOut));
    assert_eq!(screen(&rig), "End");
    rig.send(Input::Advance);
    assert_eq!(rig.ending, Some(Ending::DroppedOut));
    assert!(rig.events().any(|e| matches!(
        e,
        Event::StateSet {
            state: State::DroppedOut,
            ..
        }
    )));
    let mut again = Rig::back(plain(), rig.journal.clone(), 60.0);
    again.identify();
    assert_eq!(screen(&again), "End", "and stays out");
}

#[test]
fn a_clock_that_went_back_is_no_gap() {
    let rig = left_at(&plain(), -86_400.0, |rig| {
        rig.until_reference(1);
    });
    assert_eq!(screen(&rig), "Reference");
    assert!(
        rig.events()
            .any(|e| matches!(e, Event::Reopened { gap_s, .. } if *gap_s == 0.0))
    );
}

#[test]
fn a_journal_without_a_beginning_is_not_picked_up() {
    let mut rig = Rig::new(plain());
    rig.until_reference(2);
    let mut back = Rig::back(plain(), rig.journal[1..].to_vec(), 60.0);
    back.identify();
    assert!(
        back.view()
            .notice
            .unwrap()
            .contains("start of this session is missing")
    );
    assert_eq!(screen(&back), "Who");
    assert_eq!(back.journal.len(), rig.journal.len() - 1);
}

#[test]
fn a_journal_with_any_one_line_missing_is_finished_without_harm() {
    let whole = eventful();
    for k in 1..whole.journal.len() - 1 {
        let mut journal = whole.journal[..whole.journal.len() - 1].to_vec();
        journal.remove(k);
        let mut rig = Rig::back(rich(), journal, 60.0);
        rig.lenient = true;
        rig.identify();
        rig.finish();
        assert_eq!(rig.ending, Some(Ending::Finished), "without event {k}");
    }
}
