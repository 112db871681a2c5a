use super::super::event::Playback;
use super::super::rows::{RatingRow, Status};
use super::*;
use study_base::text::{ModelId, ParticipantId};
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::{DeviceKind, Seat, Stimuli, example};

fn at(second: u64) -> Moment {
    let start = chrono::DateTime::parse_from_rfc3339("2007-03-22T10:00:00+01:00").unwrap();
    Moment {
        wall: start + chrono::TimeDelta::seconds(i64::try_from(second).unwrap()),
        mono_ns: second,
    }
}

/// The journal of a session of A, B, C in this order.
fn journal(events: Vec<Event>) -> Vec<Entry> {
    let trial = |(id, n): (&str, u32)| Trial {
        trial: n,
        block: 1,
        position: n,
        stimuli: Stimuli::One {
            model: ModelId::new(id).unwrap(),
        },
        repetition: 1,
        practice: false,
        part: None,
    };
    let start = Event::SessionStarted(Box::new(Start {
        study: "example".to_owned(),
        participant: ParticipantId::new("P01").unwrap(),
        session: 1,
        seat: Seat::Row(1),
        operator: "first".to_owned(),
        device_kind: DeviceKind::Simulated,
        device_id: "sim".to_owned(),
        device_check: None,
        front: Some("a 1".to_owned()),
        tool_version: "0".to_owned(),
        protocol_version: 1,
        fingerprints: Fingerprints {
            stimulus: String::new(),
            wording: String::new(),
            analysis: String::new(),
        },
        schedule: ["A", "B", "C"].into_iter().zip(1..).map(trial).collect(),
        assigned: study_plan::protocol::Assigned::default(),
    }));
    std::iter::once(start)
        .chain(events)
        .zip(1..)
        .map(|(event, seq)| Entry {
            seq,
            at: at(seq),
            event,
        })
        .collect()
}

fn begin(trial: u32, attempt: u32) -> Event {
    Event::AttemptStarted {
        trial,
        attempt,
        position: trial,
        model: Some(ModelId::new(["A", "B", "C"][trial as usize - 1]).unwrap()),
        reference_s: 1.0,
        intervals: Vec::new(),
        level: None,
    }
}

fn play(trial: u32, attempt: u32, samples: u64) -> [Event; 3] {
    [
        begin(trial, attempt),
        Event::PlaybackStarted {
            trial,
            attempt,
            interval: None,
        },
        Event::PlaybackEnded {
            trial,
            attempt,
            playback: Playback {
                exploration_s: 2.0,
                strokes: 3,
                least_energy_j: f64::NAN,
                samples,
                ..Playback::default()
            },
            stopped: false,
            telemetry: None,
            rendering: None,
            interval: None,
        },
    ]
}

fn rate(trial: u32, attempt: u32, rating: i64) -> Event {
    Event::Answered {
        form: FormId::Trial { trial, attempt },
        question: QuestionId::new("realism").unwrap(),
        answer: Answer::Rating(rating),
        channel: None,
    }
}

fn done(trial: u32, attempt: u32) -> Event {
    Event::TrialDone {
        trial,
        attempt,
        response_s: 1.5,
        paused_s: None,
    }
}

fn reopened(choice: Option<Choice>, queue: &[u32]) -> Event {
    Event::Reopened {
        operator: "second".to_owned(),
        tool_version: "1".to_owned(),
        device_id: "sim-2".to_owned(),
        front: None,
        gap_s: 90_000.0,
        choice,
        queue: queue.to_vec(),
        constraint_broken: false,
    }
}

fn fail(trial: u32, attempt: u32) -> Event {
    Event::AttemptFailed {
        trial,
        attempt,
        failure: Failure::DeviceFault,
        detail: String::new(),
        queue: Vec::new(),
        constraint_broken: false,
        paused_s: None,
    }
}

fn rows(events: Vec<Event>) -> Vec<RatingRow> {
    History::of(&journal(events)).rating_rows(&example::protocol(3, 1))
}

fn statuses(rows: &[RatingRow]) -> Vec<Status> {
    rows.iter().map(|r| r.status).collect()
}

#[test]
fn every_planned_trial_has_a_row_before_anything_was_felt() {
    let rows = rows(Vec::new());
    assert_eq!(statuses(&rows), [Status::Missing; 3]);
    assert!(
        rows.iter()
            .all(|r| r.position.is_none() && r.attempt.is_none())
    );
    assert_eq!(rows[2].planned_position, 3);
}

#[test]
fn an_answer_on_disk_counts_although_the_trial_was_never_closed() {
    let mut events = play(1, 1, 9).to_vec();
    events.push(rate(1, 1, 6));
    let rows = rows(events);
    assert_eq!(rows[0].status, Status::Ok);
    assert_eq!(rows[0].rated_at, Some(at(5).wall));
    assert_eq!(rows[0].response_s, None);
}

#[test]
fn a_restarted_block_is_felt_again_and_its_first_answers_do_not_count() {
    let mut events = play(1, 1, 9).to_vec();
    events.extend([rate(1, 1, 6), done(1, 1)]);
    events.push(reopened(Some(Choice::RestartBlock), &[1, 2, 3]));
    assert_eq!(statuses(&rows(events.clone())), [Status::Missing; 3]);
    events.extend(play(1, 2, 9));
    events.extend([rate(1, 2, 2), done(1, 2)]);
    let row = rows(events).remove(0);
    assert_eq!((row.status, row.attempt), (Status::Ok, Some(2)));
    assert_eq!(row.answers.values().next().unwrap().number(), Some(2.0));
    let now = (row.operator.as_str(), row.device_id.as_str());
    assert_eq!((now, row.front_name), (("second", "sim-2"), None));
}

#[test]
fn a_resume_that_goes_on_keeps_what_was_answered() {
    let mut events = play(1, 1, 9).to_vec();
    events.extend([
        rate(1, 1, 6),
        done(1, 1),
        reopened(Some(Choice::Continue), &[2, 3]),
    ]);
    let row = rows(events).remove(0);
    assert_eq!((row.status, row.operator.as_str()), (Status::Ok, "first"));
    assert_eq!(row.front_name.as_deref(), Some("a 1"));
}

#[test]
fn a_trial_that_was_given_up_is_failed_and_shows_its_last_attempt() {
    let mut events = vec![begin(1, 1), fail(1, 1)];
    events.extend(play(1, 2, 9));
    events.extend([
        fail(1, 2),
        Event::TrialClosed {
            trial: 1,
            attempt: 2,
        },
    ]);
    events.extend(play(2, 1, 0));
    let history = History::of(&journal(events));
    let rows = history.rating_rows(&example::protocol(3, 1));
    assert_eq!((rows[0].status, rows[0].attempt), (Status::Failed, Some(2)));
    assert!(rows[0].answers.is_empty());
    // The first attempt was never felt, the second was.
    assert_eq!(rows[0].previous_model, None);
    assert_eq!(rows[1].previous_model.as_ref().unwrap().as_str(), "A");
    let row = history.participant_row(&ParticipantId::new("P01").unwrap(), 1);
    assert_eq!((row.trials_done, row.trials_planned), (1, 3));
}

#[test]
fn without_telemetry_there_are_no_strokes_and_no_number_is_never_a_number() {
    let rows = rows([play(1, 1, 0), play(2, 1, 5)].concat());
    assert_eq!((rows[0].strokes, rows[0].exploration_s), (None, Some(2.0)));
    assert_eq!((rows[1].strokes, rows[1].least_energy_j), (Some(3), None));
}

/// Two intervals without any exploration leave what follows a number.
#[test]
fn intervals_without_exploration_have_no_part_in_a_rate() {
    let interval = |exploration_s, switches_per_s| Ended {
        playback: Playback {
            exploration_s,
            switches_per_s,
            samples: 9,
            ..Playback::default()
        },
        stopped: false,
    };
    let mut attempt = Attempt::new(1, &Sitting::default(), None);
    let models = ["A", "B", "C", "A"].map(|id| ModelId::new(id).unwrap());
    attempt.models = models.to_vec();
    for (n, (s, rate)) in (1..).zip([(0.0, 0.0), (0.0, 0.0), (3.0, 2.0), (1.0, 6.0)]) {
        attempt.started(n, at(u64::from(n)));
        attempt.interval_ended(n, interval(s, rate), None, at(u64::from(n)));
    }
    let sum = attempt.ended.unwrap().playback;
    assert_eq!((sum.exploration_s, sum.switches_per_s), (4.0, 3.0));
}

/// Without the line of its start a trial of adjustment begins as planned: each level that comes later is that of its own
/// interval.
#[test]
fn an_adjustment_without_its_start_begins_as_planned() {
    let id = |id: &str| ModelId::new(id).unwrap();
    let start = |interval| Event::PlaybackStarted {
        trial: 1,
        attempt: 1,
        interval: Some(interval),
    };
    let adjusted = Event::Adjusted {
        trial: 1,
        attempt: 1,
        to: id("C"),
        standard: false,
    };
    let mut entries = journal(vec![start(1), start(2), adjusted]);
    if let Event::SessionStarted(start) = &mut entries[0].event {
        start.schedule[0].stimuli = Stimuli::Adjusted {
            start: id("B"),
            standard: Some(id("A")),
        };
    }
    let history = History::of(&entries);
    let attempt = history.open().unwrap().attempt;
    assert_eq!(attempt.models, [id("A"), id("B"), id("C")]);
    assert!(attempt.is_standard(1) && !attempt.is_standard(2));
    assert_eq!(attempt.set_to(), Some(&id("C")));
}

/// A level that is felt again after the program was left is answered after that.
#[test]
fn the_time_before_a_level_is_felt_again_is_no_time_of_its_answer() {
    let mut events = play(1, 1, 9).to_vec();
    events.push(reopened(None, &[1, 2, 3]));
    let open = |events: &[Event]| {
        let history = History::of(&journal(events.to_vec()));
        let attempt = history.open().unwrap().attempt;
        attempt.rated_earlier_s
    };
    assert_eq!(open(&events), 1.0);
    events.push(Event::Adjusted {
        trial: 1,
        attempt: 1,
        to: ModelId::new("A").unwrap(),
        standard: false,
    });
    assert_eq!(open(&events), 0.0);
}

#[test]
fn the_last_event_that_sets_a_state_determines_it() {
    let state = |events| History::of(&journal(events)).standing.state;
    assert_eq!(state(vec![]), State::Unfinished);
    assert_eq!(state(vec![Event::Finished]), State::Done);
    let excluded = Event::StateSet {
        state: State::Excluded,
        reason: "fell asleep".to_owned(),
    };
    assert_eq!(state(vec![Event::Finished, excluded]), State::Excluded);
    assert_eq!(
        state(vec![reopened(Some(Choice::DropOut), &[])]),
        State::DroppedOut
    );
}

#[test]
fn without_the_start_of_an_attempt_only_the_content_of_that_line_is_lost() {
    let mut events = play(1, 1, 9).to_vec();
    events.extend([rate(1, 1, 6), done(1, 1)]);
    events.extend(play(2, 1, 9));
    let complete = rows(events.clone());
    events.remove(0);
    let damaged = rows(events);
    assert_eq!((damaged[0].position, damaged[0].started_at), (None, None));
    assert_eq!(damaged[0].answers, complete[0].answers);
    assert_eq!(damaged[0].response_s, complete[0].response_s);
    assert_eq!(damaged[0].attempt, Some(1));
    assert_eq!(damaged[1].previous_model, complete[1].previous_model);
}

#[test]
fn the_log_says_what_breaks_the_constraint_of_the_order() {
    let failed = |trial, queue: &[u32], constraint_broken| Event::AttemptFailed {
        trial,
        attempt: 1,
        failure: Failure::DeviceFault,
        detail: "hot".to_owned(),
        queue: queue.to_vec(),
        constraint_broken,
        paused_s: None,
    };
    let mut restarted = reopened(Some(Choice::RestartBlock), &[1, 3]);
    if let Event::Reopened {
        constraint_broken, ..
    } = &mut restarted
    {
        *constraint_broken = true;
    }
    let entries = journal(vec![
        begin(1, 1),
        failed(1, &[1, 2, 3], true),
        begin(2, 1),
        failed(2, &[1, 3], true),
        restarted,
        begin(3, 1),
        failed(3, &[1, 3], false),
    ]);
    let history = History::of(&entries);
    let id = ParticipantId::new("P01").unwrap();
    let log = attempt_rows(&history, &id, 1, &entries);
    let texts: Vec<&str> = log.iter().map(|r| r.text.as_str()).collect();
    let texts: Vec<&str> = texts.into_iter().filter(|t| !t.is_empty()).collect();
    assert_eq!(
        texts,
        [
            "hot [its new place breaks the order's constraint]",
            "hot [the order without it breaks its constraint]",
            "restarted the block after 90000 s [the restart breaks the order's constraint]",
            "hot",
        ]
    );
}

#[test]
fn a_stopped_presentation_that_is_resumed_is_one_presentation() {
    let failed = |attempt, failure| Event::AttemptFailed {
        trial: 1,
        attempt,
        failure,
        detail: String::new(),
        queue: vec![1, 2, 3],
        constraint_broken: false,
        paused_s: None,
    };
    let start = |attempt| Event::PlaybackStarted {
        trial: 1,
        attempt,
        interval: None,
    };
    let mut events = vec![begin(1, 1), start(1), failed(1, Failure::Stopped)];
    assert!(History::of(&journal(events.clone())).goes_on());
    events.extend([begin(1, 2), failed(2, Failure::Interrupted)]);
    assert!(History::of(&journal(events.clone())).goes_on());
    events.extend([begin(1, 3), start(3)]);
    let history = History::of(&journal(events.clone()));
    assert_eq!((history.felt().count(), history.goes_on()), (1, false));
    events.extend([failed(3, Failure::DeviceFault), begin(1, 4), start(4)]);
    assert_eq!(History::of(&journal(events)).felt().count(), 2);
}
