//! The events of a session in words, and as JSON.
//!
//! While a participant's realizations are hidden, nothing here names one, or tells of its
//! force: no text of the device either, which may do both.

use serde_json::{Map, Value};
use study_base::text::{ModelId, Untrusted};
use study_plan::protocol::Answer;
use study_session::outcome::{Choice, Entry, Event, FormId, Playback, SentNumber};

/// Fields of events that tell nothing of a realization.
const OPEN: &[&str] = &[
    "accepted",
    "after",
    "answer",
    "apparent_kg",
    "attempt",
    "by",
    "by_s",
    "channel",
    "choice",
    "commissioning",
    "device_id",
    "device_kind",
    "document",
    "event",
    "failure",
    "from",
    "front",
    "gain",
    "gap_s",
    "group",
    "interval",
    "lag_ms",
    "late",
    "ok",
    "operator",
    "participant",
    "paused_s",
    "place",
    "position",
    "protocol_version",
    "question",
    "reason",
    "reference_s",
    "response_s",
    "rested_s",
    "seat",
    "session",
    "session_id",
    "state",
    "stopped",
    "study",
    "telemetry",
    "text",
    "to",
    "tool_version",
    "trial",
    "version",
];

/// Fields that tell of it.
const HIDDEN: &[&str] = &[
    "constraint_broken",
    "detail",
    "finished",
    "intervals",
    "level",
    "medium",
    "model",
    "numbers",
    "offset_ms",
    "part",
    "point",
    "rendering",
    "track",
    "uncertainty_ms",
];

/// Fields of a playback that tell nothing of a realization.
const OF_PLAYBACK: &[&str] = &["exploration_s", "samples", "samples_lost", "strokes"];

/// An event as in the journal, with its time; the planned order is left out, and what is
/// hidden unless `revealed`.
pub(super) fn json(entry: &Entry, revealed: bool) -> Map<String, Value> {
    let Ok(Value::Object(mut fields)) = serde_json::to_value(&entry.event) else {
        return Map::new();
    };
    if matches!(entry.event, Event::Adjusted { .. }) && !revealed {
        // what is felt next; `to` of other events is an id
        fields.remove("to");
    }
    if let Some(Value::Object(playback)) = fields.remove("playback") {
        let kept = playback.into_iter();
        let kept = kept.filter(|(key, _)| revealed || OF_PLAYBACK.contains(&key.as_str()));
        fields.insert("playback".to_owned(), Value::Object(kept.collect()));
    }
    let kept = |key: &str| {
        let hidden = HIDDEN.contains(&key) && revealed;
        OPEN.contains(&key) || hidden || key == "playback"
    };
    let mut all = Map::new();
    all.insert("at".to_owned(), entry.at.wall.to_rfc3339().into());
    all.extend(fields.into_iter().filter(|(key, _)| kept(key)));
    all
}

/// An event in a few words.
pub(super) fn words(event: &Event, revealed: bool) -> String {
    match event {
        Event::SessionStarted(start) => format!(
            "the session begins: operator {}, device {}, study {}",
            or_none(&start.operator),
            or_none(&start.device_id),
            Untrusted(&start.tool_version)
        ),
        Event::SelfWeighed(weighed) => {
            format!(
                "the motor weighed itself: {}",
                Untrusted(&weighed.in_words())
            )
        }
        Event::Reopened { gap_s, choice, .. } => {
            let how = match choice {
                None => "",
                Some(Choice::RestartBlock) => ", and the block is repeated",
                Some(Choice::Continue) => ", where it stopped",
                Some(Choice::DropOut) => ": the participant does not come back",
            };
            format!("the session goes on after {gap_s:.0} s{how}")
        }
        Event::Consented {
            document,
            version,
            accepted,
            ..
        } => {
            let what = match accepted {
                true => "the participant agrees to",
                false => "the participant does not agree to",
            };
            format!("{what} {}, version {}", or_none(document), or_none(version))
        }
        Event::Answered {
            form,
            question,
            answer,
            channel,
        } => {
            let channel = channel.map_or(String::new(), |c| format!(" ({})", c.as_str()));
            format!("{}{question} = {}{channel}", of_form(*form), shown(answer))
        }
        Event::Corrected {
            form,
            question,
            from,
            to,
            reason,
            by,
            ..
        } => format!(
            "{}{question} corrected from {} to {} by the {}: {}",
            of_form(*form),
            from.as_ref().map_or("–".to_owned(), shown),
            shown(to),
            by.as_str(),
            Untrusted(reason)
        ),
        Event::AttemptStarted {
            attempt,
            model,
            reference_s,
            intervals,
            level,
            ..
        } => {
            let models: Vec<&str> = model.iter().chain(intervals).map(ModelId::as_str).collect();
            let level = level.map_or(String::new(), |l| format!(" at level {}", l.presented));
            let what = match revealed && !models.is_empty() {
                true => format!(": {}{level}", models.join(", ")),
                false => String::new(),
            };
            format!("attempt {attempt}, after a prompt of {reference_s:.1} s{what}")
        }
        Event::PlaybackStarted { interval, .. } => format!("{} plays", of_interval(*interval)),
        Event::PlaybackEnded {
            playback,
            stopped,
            rendering,
            interval,
            ..
        } => {
            let by_hand = if *stopped { ", stopped by hand" } else { "" };
            let verdict = rendering.as_ref().filter(|_| revealed);
            let verdict = verdict.map_or(String::new(), |found| {
                format!(", force: {}", found.verdict.as_str())
            });
            let felt = felt(playback);
            format!("{} ends{felt}{by_hand}{verdict}", of_interval(*interval))
        }
        Event::MediaShown {
            medium,
            offset_ms,
            uncertainty_ms,
            ..
        } if revealed => format!(
            "the {} comes {offset_ms:.1} ms after the start, ± {uncertainty_ms:.1} ms",
            medium.as_str()
        ),
        // Left out before: their number tells.
        Event::MediaShown { .. } => "the participant's page shows or plays it".to_owned(),
        Event::NumbersSent { numbers, .. } if revealed => numbers_sent(numbers),
        Event::NumbersSent { .. } => "the device sends numbers".to_owned(),
        Event::Adjusted { standard: true, .. } => "the standard is asked for".to_owned(),
        Event::Adjusted { to, .. } if revealed => format!("{to} comes next"),
        // A step away, or after the standard the same.
        Event::Adjusted { .. } => "the next level comes, or the same again".to_owned(),
        Event::StepFailed {
            failure, detail, ..
        } => {
            let detail = match revealed {
                true => format!(": {}", Untrusted(detail)),
                false => String::new(),
            };
            let why = failure.as_str();
            format!("the step failed, {why}{detail}; the level before is felt again")
        }
        Event::Replayed { .. } => "it is felt again before the answer".to_owned(),
        Event::TelemetryLost { reason, .. } => {
            format!(
                "its samples were not saved, or only in part: {}",
                Untrusted(reason)
            )
        }
        Event::AttemptFailed {
            attempt,
            failure,
            detail,
            ..
        } => {
            let detail = match revealed {
                true => format!(": {}", Untrusted(detail)),
                false => String::new(),
            };
            format!("attempt {attempt} failed, {}{detail}", failure.as_str())
        }
        Event::TrialDone {
            response_s,
            paused_s,
            ..
        } => {
            let paused = paused_s.map_or(String::new(), |s| format!(", after pauses of {s:.1} s"));
            format!("answered in {response_s:.1} s{paused}")
        }
        Event::FormDelayed { paused_s, late, .. } => {
            let how_long =
                paused_s.map_or("of unknown length".to_owned(), |s| format!("of {s:.1} s"));
            let late = if *late { ", longer than allowed" } else { "" };
            format!("the questionnaires are answered after a pause {how_long}{late}")
        }
        Event::TrialClosed { .. } => "it failed too often and does not come again".to_owned(),
        Event::TrackEnded { track, .. } if revealed => format!("the track {track} has ended"),
        Event::TrackEnded { .. } => "a track has ended".to_owned(),
        Event::PracticeEnded { .. } => "the practice has reached its criterion".to_owned(),
        Event::PointLeftOut { point, .. } if revealed => {
            format!("the device failed at {point}: the search goes on without this point")
        }
        Event::PointLeftOut { .. } => "the search goes on without a point".to_owned(),
        Event::Remark { by, text, .. } => {
            format!("the {} remarks: {}", by.as_str(), Untrusted(text))
        }
        Event::InstructionsRead => "the instructions were read".to_owned(),
        Event::Debriefed => "what the study was about was shown".to_owned(),
        Event::Paused => "a pause begins".to_owned(),
        Event::Unpaused { paused_s } => format!("the pause ends after {paused_s:.1} s"),
        Event::BreakStarted { .. } => "a break begins".to_owned(),
        Event::BreakEnded { rested_s } => format!("the break ends after {rested_s:.1} s"),
        Event::ClockStepped { by_s } => format!("the clock of the computer steps by {by_s:.1} s"),
        Event::Interrupted { reason } => format!("the program was left: {}", Untrusted(reason)),
        Event::Finished => "the session is complete".to_owned(),
        Event::IdCorrected { from, to, reason } => {
            format!("the id {from} is corrected to {to}: {}", Untrusted(reason))
        }
        Event::StateSet { state, reason } => {
            format!(
                "the state is set to {}: {}",
                state.as_str(),
                Untrusted(reason)
            )
        }
        Event::Revealed { reason } => format!("the order was shown: {}", Untrusted(reason)),
    }
}

fn felt(playback: &Playback) -> String {
    format!(
        " after {:.1} s, {} full strokes",
        playback.exploration_s, playback.strokes
    )
}

/// Numbers by name, and why some do not count.
fn numbers_sent(numbers: &[SentNumber]) -> String {
    let one = |number: &SentNumber| {
        let value = number.value.map_or_else(String::new, |x| format!(" = {x}"));
        let why = number
            .fault
            .map(|fault| format!(", which {}", fault.in_words()));
        let why = why.unwrap_or_default();
        format!("{}{value}{why}", Untrusted(&number.key))
    };
    let all: Vec<String> = numbers.iter().map(one).collect();
    format!("the device sends {}", all.join(", "))
}

fn of_interval(interval: Option<u32>) -> String {
    interval.map_or("it".to_owned(), |n| format!("interval {n}"))
}

fn of_form(form: FormId) -> &'static str {
    match form {
        FormId::Setup => "set-up: ",
        FormId::Intake => "intake: ",
        FormId::Outro => "closing questions: ",
        FormId::Consent => "consent: ",
        FormId::Trial { .. } | FormId::After { .. } => "",
    }
}

fn or_none(text: &str) -> String {
    match text {
        "" => "–".to_owned(),
        text => Untrusted(text).to_string(),
    }
}

fn shown(answer: &Answer) -> String {
    match answer {
        Answer::Declined { reason } => format!("declined ({})", Untrusted(reason)),
        answer => or_none(&answer.cell()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chrono::DateTime;
    use study_session::outcome::{Failure, Fidelity, Moment};

    fn entry(event: Event) -> Entry {
        let at = Moment {
            wall: DateTime::UNIX_EPOCH.fixed_offset(),
            mono_ns: 0,
        };
        Entry { seq: 1, at, event }
    }

    /// Everything that a playback and its failure tell of a realization.
    fn telling(model: &str, least_energy_j: f64) -> Vec<Event> {
        let model = ModelId::new(model).unwrap();
        let playback = Playback {
            exploration_s: 3.0,
            strokes: 4,
            least_energy_j,
            switches_per_s: 100.0 * least_energy_j,
            clamp_count: (10.0 * least_energy_j) as u64,
            ..Playback::default()
        };
        let rendering = Fidelity {
            nearest_model: Some(model.clone()),
            max_force_n: Some(least_energy_j),
            ..Fidelity::default()
        };
        let (trial, attempt) = (7, 1);
        vec![
            Event::AttemptStarted {
                trial,
                attempt,
                position: 7,
                model: Some(model.clone()),
                reference_s: 2.0,
                intervals: vec![model.clone()],
                level: None,
            },
            Event::PlaybackEnded {
                trial,
                attempt,
                playback,
                stopped: false,
                telemetry: None,
                rendering: Some(Box::new(rendering)),
                interval: None,
            },
            Event::AttemptFailed {
                trial,
                attempt,
                failure: Failure::DeviceFault,
                detail: format!("{model} needs {least_energy_j} N"),
                queue: vec![7, 9],
                constraint_broken: false,
                paused_s: None,
            },
            Event::Adjusted {
                trial,
                attempt,
                to: model.clone(),
                standard: false,
            },
            Event::NumbersSent {
                trial: Some(trial),
                attempt: Some(attempt),
                numbers: vec![SentNumber {
                    key: format!("time_of_{model}"),
                    value: Some(least_energy_j),
                    fault: None,
                }],
            },
            Event::PointLeftOut {
                part: study_base::text::PartId::new("best").unwrap(),
                point: model,
            },
        ]
    }

    #[test]
    fn what_is_hidden_is_the_same_for_every_realization() {
        let told = |model: &str, n: f64, revealed: bool| {
            let each = telling(model, n).into_iter().map(|event| {
                let said = words(&event, revealed);
                format!("{said} {:?}", json(&entry(event), revealed))
            });
            each.collect::<Vec<_>>()
        };
        assert_eq!(told("XQZ-7", 1.0, false), told("KJW-3", 7.0, false));
        for (open, hidden) in told("XQZ-7", 1.0, true)
            .iter()
            .zip(told("KJW-3", 7.0, true))
        {
            assert!(open.contains("XQZ-7"), "{open}");
            assert_ne!(*open, hidden);
        }
    }

    #[test]
    fn typed_text_cannot_control_a_terminal() {
        let remark = Event::Remark {
            by: study_session::outcome::Author::Participant,
            trial: None,
            text: "a\u{1b}[2J\nb".to_owned(),
        };
        assert_eq!(
            words(&remark, true),
            "the participant remarks: a\\u{1b}[2J\\nb"
        );
    }
}
