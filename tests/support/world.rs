//! A small study, for tests of the store.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used)]

use crate::designs::design;
use std::collections::BTreeMap;
use study_base::text::{ModelId, ParticipantId, QuestionId};
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::*;
use study_session::outcome::{Author, Event, Failure, FormId, Moment, Playback, Start};
use study_session::store::{ClaimRequest, Frozen, Plan, SeatKind};

pub fn model(id: &str) -> ModelId {
    ModelId::new(id).unwrap()
}

pub fn question(id: &str) -> QuestionId {
    QuestionId::new(id).unwrap()
}

pub fn participant(id: &str) -> ParticipantId {
    ParticipantId::new(id).unwrap()
}

fn text_question(id: &str) -> Question {
    Question {
        id: question(id),
        prompt: id.to_owned(),
        kind: QuestionKind::Text(kinds::Text),
        required: false,
    }
}

/// Models A, B, C; realism 1–7 and a comment; an intake question `age`.
pub fn protocol() -> Protocol {
    let entry = |(i, id): (usize, &str)| ModelEntry {
        id: model(id),
        file: None,
        vaf: Some(0.5 + 0.1 * i as f64),
        role: Role::Test,
        duplicate_of: None,
        device: None,
        covariates: BTreeMap::from([("lambda".to_owned(), 0.9 + 0.01 * i as f64)]),
        levels: BTreeMap::new(),
        media: Default::default(),
    };
    let mut small = design(0, 1, Order::Blocked);
    "small".clone_into(&mut small.study.id);
    "A small study".clone_into(&mut small.study.title);
    small.design.participants = 4;
    Protocol {
        models: ["A", "B", "C"].into_iter().enumerate().map(entry).collect(),
        questions: vec![
            Question {
                id: question("realism"),
                prompt: "How realistic?".to_owned(),
                kind: QuestionKind::Rating(kinds::Rating {
                    from: 1,
                    to: 7,
                    labels: BTreeMap::new(),
                }),
                required: true,
            },
            text_question("comment"),
        ],
        intake: vec![text_question("age")],
        ..small
    }
}

pub fn fingerprints() -> Fingerprints {
    Fingerprints {
        stimulus: "5".repeat(64),
        wording: "6".repeat(64),
        analysis: "7".repeat(64),
    }
}

pub fn files() -> Vec<(String, Vec<u8>)> {
    vec![
        (
            "protocol.toml".to_owned(),
            b"format = \"study-protocol/1\"\n".to_vec(),
        ),
        ("models/A.toml".to_owned(), b"id = \"A\"\n".to_vec()),
    ]
}

/// A protocol with its files, to be frozen.
pub struct Kept {
    pub protocol: Protocol,
    pub files: Vec<(String, Vec<u8>)>,
    pub fingerprints: Fingerprints,
}

impl Kept {
    pub fn new() -> Self {
        Self {
            protocol: protocol(),
            files: files(),
            fingerprints: fingerprints(),
        }
    }

    pub fn frozen(&self) -> Frozen<'_> {
        Frozen {
            protocol: &self.protocol,
            files: &self.files,
            fingerprints: &self.fingerprints,
        }
    }
}

/// The moment `s` seconds after ten o'clock.
pub fn at(seconds: u64) -> Moment {
    let start = chrono::DateTime::parse_from_rfc3339("2007-03-22T10:00:00+01:00").unwrap();
    Moment {
        wall: start + chrono::TimeDelta::seconds(i64::try_from(seconds).unwrap()),
        mono_ns: seconds * 1_000_000_000,
    }
}

pub fn request(id: &str, kind: SeatKind) -> ClaimRequest {
    ClaimRequest {
        participant: participant(id),
        kind,
        rows: None,
        plan: Plan::default(),
    }
}

pub fn real(id: &str) -> ClaimRequest {
    request(id, SeatKind::Real)
}

pub fn schedule() -> Vec<Trial> {
    ["B", "A", "C"]
        .into_iter()
        .zip(1..)
        .map(|(id, n)| Trial {
            trial: n,
            block: 1,
            position: n,
            stimuli: Stimuli::One { model: model(id) },
            repetition: 1,
            practice: false,
            part: None,
        })
        .collect()
}

pub fn started(id: &str, session: u32, seat: Seat) -> Event {
    Event::SessionStarted(Box::new(Start {
        study: "small".to_owned(),
        participant: participant(id),
        session,
        seat,
        operator: "mc".to_owned(),
        device_kind: DeviceKind::Simulated,
        device_id: "sim-1".to_owned(),
        device_check: None,
        front: None,
        tool_version: "0.1.0".to_owned(),
        protocol_version: 1,
        fingerprints: fingerprints(),
        schedule: schedule(),
        assigned: Assigned::default(),
    }))
}

pub fn answered(trial: u32, attempt: u32, id: &str, answer: Answer) -> Event {
    Event::Answered {
        form: FormId::Trial { trial, attempt },
        question: question(id),
        answer,
        channel: None,
    }
}

/// A comment with control sequences, CSV separators and the start of a formula.
pub const HOSTILE: &str =
    "=1+1,\"quoted\"\r\nsecond line 👍🏽 \u{1b}[2J\u{9b}31m\u{0}tab\there {\"crc\":\" end";

pub fn begun(trial: u32, attempt: u32, position: u32, id: &str) -> Event {
    Event::AttemptStarted {
        trial,
        attempt,
        position,
        model: Some(model(id)),
        reference_s: 1.5,
        intervals: Vec::new(),
        level: None,
    }
}

pub fn ended(trial: u32, attempt: u32) -> Event {
    Event::PlaybackEnded {
        trial,
        attempt,
        playback: Playback {
            exploration_s: 3.25,
            strokes: 4,
            least_energy_j: -0.001,
            switches_per_s: 2.5,
            clamp_count: 1,
            samples: 3250,
            samples_lost: 0,
            time_ratio: None,
            host_late_ms: None,
        },
        stopped: false,
        telemetry: None,
        rendering: None,
        interval: None,
    }
}

pub fn failed(trial: u32, attempt: u32, queue: &[u32]) -> Event {
    Event::AttemptFailed {
        trial,
        attempt,
        failure: Failure::MarkedBad,
        detail: "knocked".to_owned(),
        queue: queue.to_vec(),
        constraint_broken: false,
        paused_s: None,
    }
}

/// The 29 events of a session with a failed attempt, a correction, remarks and a
/// declined answer.
pub fn session(id: &str, number: u32, seat: Seat) -> Vec<Event> {
    let remark = |text: &str| Event::Remark {
        by: Author::Participant,
        trial: Some(2),
        text: text.to_owned(),
    };
    let intake = Event::Answered {
        form: FormId::Intake,
        question: question("age"),
        answer: Answer::Text("41".to_owned()),
        channel: None,
    };
    let mut events = vec![started(id, number, seat), intake, Event::InstructionsRead];
    let play = |events: &mut Vec<Event>, trial, attempt, position, id| {
        events.push(begun(trial, attempt, position, id));
        events.push(Event::PlaybackStarted {
            trial,
            attempt,
            interval: None,
        });
        events.push(ended(trial, attempt));
    };
    let done = |trial, attempt| Event::TrialDone {
        trial,
        attempt,
        response_s: 2.5,
        paused_s: None,
    };
    play(&mut events, 1, 1, 1, "B");
    events.push(failed(1, 1, &[2, 3, 1]));
    play(&mut events, 2, 1, 1, "A");
    events.push(remark("first"));
    events.push(answered(2, 1, "realism", Answer::Rating(6)));
    events.push(answered(2, 1, "comment", Answer::Text(HOSTILE.to_owned())));
    events.push(done(2, 1));
    events.push(remark("second"));
    play(&mut events, 3, 1, 2, "C");
    events.push(answered(
        3,
        1,
        "realism",
        Answer::Declined {
            reason: "felt nothing".to_owned(),
        },
    ));
    events.push(done(3, 1));
    events.push(Event::Corrected {
        form: FormId::Trial {
            trial: 2,
            attempt: 1,
        },
        question: question("realism"),
        from: Some(Answer::Rating(6)),
        to: Answer::Rating(5),
        reason: "slip".to_owned(),
        by: Author::Experimenter,
        channel: None,
    });
    play(&mut events, 1, 2, 3, "B");
    events.push(answered(1, 2, "realism", Answer::Rating(4)));
    events.push(done(1, 2));
    events.push(Event::Paused);
    events.push(Event::Unpaused { paused_s: 12.0 });
    events.push(Event::Finished);
    events
}

/// Writes the telemetry that the playbacks among the events report.
pub fn telemetry(session: &std::path::Path, events: &[Event]) {
    let folder = session.join("telemetry");
    std::fs::create_dir_all(&folder).unwrap();
    let header = "t_s,x_mm,v_mm_s,force_command_n,force_measured_n\r\n";
    for event in events {
        if let Event::PlaybackEnded {
            trial,
            attempt,
            playback,
            ..
        } = event
        {
            let lines = "0.001,0,0,0,\r\n".repeat(playback.samples as usize);
            let file = folder.join(format!("{trial:03}-a{attempt}.csv"));
            std::fs::write(file, format!("{header}{lines}")).unwrap();
        }
    }
}
