//! Messages between host and program, one JSON object per line.

use super::error::{MAX_SAMPLES, MessageError, short_text};
use super::hello::{Hello, Told};
use crate::Stimulus;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use study_base::limits::Limits;
use study_base::text::beginning;
use study_session::outcome::{Playback, Sample, SentNumber};

/// Most numbers of an outcome that are read, and characters of their names.
const MAX_NUMBERS: usize = 64;
const MAX_KEY: usize = 64;

/// A message of a program.
#[derive(Debug, Deserialize)]
#[serde(tag = "say", rename_all = "kebab-case")]
pub(super) enum ChildMessage {
    Hello(Box<Hello>),
    Loaded {
        load: u64,
    },
    Refused {
        load: u64,
        why: String,
    },
    Started {
        load: u64,
    },
    Samples {
        load: u64,
        samples: Vec<SampleRow>,
    },
    Progress {
        load: u64,
        strokes: u32,
        clamps: u64,
    },
    /// What a playback was, numbers that were measured in it, or both. Version 1 has another word for it.
    #[serde(alias = "stopped")]
    Outcome {
        /// Numbers without it are of the load under way.
        load: Option<u64>,
        #[serde(flatten)]
        outcome: Outcome,
    },
    /// The force is off, as was asked; with the sample after that.
    Free {
        load: u64,
        sample: Option<SampleRow>,
    },
    Fault {
        what: String,
    },
}

/// The content of an outcome: the keys of [`PlaybackOutcome`], and others, which are numbers of the study.
#[derive(Debug, Deserialize)]
#[serde(try_from = "Map<String, Value>")]
pub(super) struct Outcome {
    pub(super) playback: Option<PlaybackOutcome>,
    pub(super) numbers: Vec<SentNumber>,
}

impl TryFrom<Map<String, Value>> for Outcome {
    type Error = serde_json::Error;

    /// Without any key it is a playback that lacks all of them.
    fn try_from(mut keys: Map<String, Value>) -> Result<Self, Self::Error> {
        let of_playback: Map<String, Value> = (OF_PLAYBACK.iter())
            .filter_map(|key| Some(((*key).to_owned(), keys.remove(*key)?)))
            .collect();
        let playback = match of_playback.is_empty() && !keys.is_empty() {
            true => None,
            false => Some(serde_json::from_value(Value::Object(of_playback))?),
        };
        let number = |(key, value): (String, Value)| SentNumber {
            key: beginning(&key, MAX_KEY),
            value: value.as_f64().filter(|x| x.is_finite()),
            fault: None,
        };
        Ok(Self {
            playback,
            numbers: keys.into_iter().take(MAX_NUMBERS).map(number).collect(),
        })
    }
}

/// The keys of [`PlaybackOutcome`].
const OF_PLAYBACK: [&str; 5] = [
    "duration_s",
    "strokes",
    "least_energy_j",
    "switches_per_s",
    "clamps",
];

/// Outcome of a playback.
#[derive(Debug, Deserialize)]
pub(super) struct PlaybackOutcome {
    pub(super) duration_s: f64,
    strokes: u32,
    least_energy_j: f64,
    switches_per_s: f64,
    clamps: u64,
}

/// t in s, x in mm, v in mm/s, commanded force in N, measured force in N or null.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct SampleRow(f64, f64, f64, f64, Option<f64>);

impl From<SampleRow> for Sample {
    fn from(row: SampleRow) -> Self {
        Self {
            t_s: row.0,
            x_mm: row.1,
            v_mm_s: row.2,
            force_command_n: row.3,
            force_measured_n: row.4,
        }
    }
}

impl From<PlaybackOutcome> for Playback {
    fn from(outcome: PlaybackOutcome) -> Self {
        Self {
            exploration_s: outcome.duration_s,
            strokes: outcome.strokes,
            least_energy_j: outcome.least_energy_j,
            switches_per_s: outcome.switches_per_s,
            clamp_count: outcome.clamps,
            samples: 0,
            samples_lost: 0,
            time_ratio: None,
            host_late_ms: None,
        }
    }
}

impl ChildMessage {
    pub(super) fn hello(self) -> Result<Told, MessageError> {
        match self {
            Self::Hello(hello) => hello.told(),
            other => Err(MessageError::NoHello(other.as_str())),
        }
    }

    /// Number of the load that the message is about, if it is about one.
    pub(super) fn load(&self) -> Option<u64> {
        match self {
            Self::Hello(_) | Self::Fault { .. } => None,
            Self::Loaded { load }
            | Self::Refused { load, .. }
            | Self::Started { load }
            | Self::Samples { load, .. }
            | Self::Progress { load, .. }
            | Self::Free { load, .. } => Some(*load),
            Self::Outcome { load, .. } => *load,
        }
    }

    pub(super) fn as_str(&self) -> &'static str {
        match self {
            Self::Hello(_) => "hello",
            Self::Loaded { .. } => "loaded",
            Self::Refused { .. } => "refused",
            Self::Started { .. } => "started",
            Self::Samples { .. } => "samples",
            Self::Progress { .. } => "progress",
            Self::Outcome { .. } => "outcome",
            Self::Free { .. } => "free",
            Self::Fault { .. } => "fault",
        }
    }
}

/// Reads a line of a program.
pub(super) fn read(line: &[u8]) -> Result<ChildMessage, MessageError> {
    let mut message = match serde_json::from_slice(line) {
        Ok(message) => message,
        Err(error) => outcome_without_nan(line).ok_or_else(|| {
            let shown = String::from_utf8_lossy(line);
            MessageError::Json(error, short_text(shown.trim_end()))
        })?,
    };
    match &mut message {
        ChildMessage::Samples { samples, .. } if samples.len() > MAX_SAMPLES => {
            return Err(MessageError::TooManySamples);
        }
        ChildMessage::Refused { why: text, .. } | ChildMessage::Fault { what: text } => {
            *text = short_text(text);
        }
        _ => {}
    }
    Ok(message)
}

/// An outcome with numbers that JSON has not, which many programs write all the same, as null. Of other messages such a
/// number is an error: what a device says of itself has to be known.
fn outcome_without_nan(line: &[u8]) -> Option<ChildMessage> {
    let (mut rest, mut clean, mut in_text) = (line, Vec::new(), false);
    while let [first, after @ ..] = rest {
        let written = [&b"NaN"[..], b"-Infinity", b"Infinity"]
            .into_iter()
            .find(|word| !in_text && rest.starts_with(word));
        if let Some(word) = written {
            clean.extend_from_slice(b"null");
            rest = &rest[word.len()..];
            continue;
        }
        // What stands after a backslash ends no text.
        if let (b'\\', true, [escaped, after @ ..]) = (*first, in_text, after) {
            clean.extend_from_slice(&[*first, *escaped]);
            rest = after;
            continue;
        }
        in_text ^= *first == b'"';
        clean.push(*first);
        rest = after;
    }
    let message = serde_json::from_slice(&clean).ok()?;
    matches!(message, ChildMessage::Outcome { .. }).then_some(message)
}

fn line(value: &Value) -> String {
    format!("{value}\n")
}

/// The command `start`, `stop`, `free`, `limp` or `alive`.
pub(super) fn command(name: &str, load: u64) -> String {
    line(&json!({"do": name, "load": load}))
}

/// The command `load` with table or mechanism and limits.
pub(super) fn load(number: u64, what: &Stimulus<'_>, limits: Limits) -> String {
    let mechanism = what
        .table
        .and_then(|own| Some((own, own.mechanism.as_ref()?)));
    let table = what.table.filter(|_| mechanism.is_none()).map(|table| {
        let branch = |b: &study_haptics::model::Branch| {
            json!({
                "m_kg": b.m_kg, "b_n_s_per_mm": b.b_n_s_per_mm,
                "k_n_per_mm": b.k_n_per_mm, "f0_n": b.f0_n,
            })
        };
        let direction = table.direction;
        json!({
            "lookup": table.lookup.as_str(),
            "direction": {"rule": direction.as_str(), "delta_mm": direction.delta_mm()},
            "trained": {"x_mm": table.trained.x_mm, "v_mm_s": table.trained.v_mm_s},
            "x_mm": table.x_mm,
            "positive": branch(&table.positive),
            "negative": branch(&table.negative),
        })
    });
    let mut command = json!({
        "do": "load", "load": number, "model": what.model, "uncertified": what.allow_uncertified,
        "limits": {"force_n": limits.force_n.get(), "velocity_mm_s": limits.velocity_mm_s.get()},
        "table": table,
    });
    if let Some((own, mechanism)) = mechanism {
        let profile = |p: &study_haptics::model::Profile| json!({"first_mm": p.first_mm, "step_mm": p.step_mm, "n": p.n});
        let mut parameters = json!({
            "trained": {"x_mm": own.trained.x_mm, "v_mm_s": own.trained.v_mm_s},
            "detent": profile(&mechanism.detent),
            "friction": profile(&mechanism.friction),
        });
        let scalars = mechanism.scalars.to_array();
        for (key, value) in study_haptics::model::file::SCALAR_KEYS.iter().zip(scalars) {
            parameters[*key] = json!(value);
        }
        command["mechanism"] = parameters;
    }
    line(&command)
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_base::child::MAX_TEXT;

    #[test]
    fn messages_that_violate_the_specification_are_rejected() {
        for (line, why) in [
            ("no json", "expected"),
            (r#"{"say":"hallo"}"#, "unknown variant"),
            (r#"{"say":"loaded"}"#, "missing field `load`"),
            (
                r#"{"say":"samples","load":1,"samples":[[0,1,2,NaN,null]]}"#,
                "expected",
            ),
            (
                r#"{"say":"samples","load":1,"samples":[[0,1,2,3]]}"#,
                "invalid length",
            ),
            (
                r#"{"say":"hello","format":"study-process/1","id":"a","telemetry":true,"limits":{"force_n":-1,"velocity_mm_s":1}}"#,
                "above zero",
            ),
        ] {
            let error = read(line.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(why), "{line}: {error}");
        }
        let other = r#"{"say":"hello","format":"study-process/7","id":"a","telemetry":true,"limits":{"force_n":1,"velocity_mm_s":1}}"#;
        let error = read(other.as_bytes()).unwrap().hello().unwrap_err();
        let error = error.to_string();
        assert!(error.contains("study-process/2"), "{error}");
    }

    fn outcome(line: &str) -> Result<(Option<u64>, Outcome), String> {
        match read(line.as_bytes()).map_err(|e| e.to_string())? {
            ChildMessage::Outcome { load, outcome } => Ok((load, outcome)),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn an_outcome_has_numbers_of_the_study() {
        let playback =
            r#""duration_s":2,"strokes":3,"least_energy_j":0,"switches_per_s":1,"clamps":0"#;
        let (load, both) = outcome(&format!(
            r#"{{"say":"outcome","load":7,{playback},"time_s":3.25}}"#
        ))
        .unwrap();
        assert_eq!((load, both.playback.unwrap().duration_s), (Some(7), 2.0));
        let told = |numbers: &[SentNumber]| -> Vec<(String, Option<f64>)> {
            let one = |n: &SentNumber| (n.key.clone(), n.value);
            numbers.iter().map(one).collect()
        };
        assert_eq!(told(&both.numbers), [("time_s".to_owned(), Some(3.25))]);
        // Version 1 calls it otherwise.
        let (_, old) = outcome(&format!(r#"{{"say":"stopped","load":7,{playback}}}"#)).unwrap();
        assert!(old.playback.is_some() && old.numbers.is_empty());
        let (load, alone) = outcome(r#"{"say":"outcome","time_s":3.25}"#).unwrap();
        assert!(load.is_none() && alone.playback.is_none());
        let why = outcome(r#"{"say":"outcome","load":7}"#).unwrap_err();
        assert!(why.contains("missing field `duration_s`"), "{why}");
        let why = outcome(r#"{"say":"outcome","load":7,"duration_s":2,"time_s":1}"#).unwrap_err();
        assert!(why.contains("missing field `strokes`"), "{why}");
    }

    /// What is no number is none, and says so by its name; of a playback it is an error, as in all other messages.
    #[test]
    fn numbers_that_json_has_not_are_none() {
        let (_, found) = outcome(
            r#"{"say":"outcome","load":7,"a":NaN,"b":-Infinity,"c":null,"d":"3.2","e":true,"f_NaN":1,"g":"\"NaN"}"#,
        )
        .unwrap();
        let told: Vec<(&str, Option<f64>)> = (found.numbers.iter())
            .map(|n| (n.key.as_str(), n.value))
            .collect();
        let none = ["a", "b", "c", "d", "e"].map(|key| (key, None));
        assert_eq!(
            told,
            [&none[..], &[("f_NaN", Some(1.0)), ("g", None)]].concat()
        );
        let of_playback = r#"{"say":"outcome","load":7,"duration_s":NaN,"strokes":3,"least_energy_j":0,"switches_per_s":1,"clamps":0}"#;
        assert!(outcome(of_playback).is_err());
        let long = format!(r#"{{"say":"outcome","load":7,"{}":1}}"#, "k".repeat(500));
        let (_, found) = outcome(&long).unwrap();
        assert_eq!(found.numbers[0].key.chars().count(), MAX_KEY + 1);
        let many: Vec<String> = (0..200).map(|i| format!(r#""k{i}":{i}"#)).collect();
        let many = format!(r#"{{"say":"outcome","load":7,{}}}"#, many.join(","));
        assert_eq!(outcome(&many).unwrap().1.numbers.len(), MAX_NUMBERS);
    }

    #[test]
    fn a_long_text_is_cut() {
        let line = format!(r#"{{"say":"fault","what":"{}"}}"#, "x".repeat(5000));
        let ChildMessage::Fault { what } = read(line.as_bytes()).unwrap() else {
            panic!("no fault");
        };
        assert_eq!(what.chars().count(), MAX_TEXT + 1);
    }

    #[test]
    fn a_line_has_at_most_so_many_samples() {
        let line = |n: usize| {
            let rows = vec!["[0,1,2,3,null]"; n].join(",");
            format!(r#"{{"say":"samples","load":1,"samples":[{rows}]}}"#)
        };
        assert!(read(line(MAX_SAMPLES).as_bytes()).is_ok());
        assert!(matches!(
            read(line(MAX_SAMPLES + 1).as_bytes()),
            Err(MessageError::TooManySamples)
        ));
    }
}
