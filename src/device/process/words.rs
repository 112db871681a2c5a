//! What host and child say to each other, one JSON object a line.

use crate::device::Stimulus;
use serde::Deserialize;
use serde_json::{Value, json};
use study_base::limits::Limits;
use study_base::text::Untrusted;
use study_core::outcome::{Playback, Sample};
use study_wire::predict::{Direction, Lookup};

/// Version of the language, in the child's `hello`.
pub const FORMAT: &str = "study-process/1";

/// Longest text of a child that is kept, characters.
const MAX_TEXT: usize = 200;
/// Longest id of a device, characters.
const MAX_ID: usize = 64;
/// Most samples in one line.
const MAX_SAMPLES: usize = 4096;

/// What a child says.
#[derive(Debug, Deserialize)]
#[serde(tag = "say", rename_all = "kebab-case")]
pub(super) enum Say {
    Hello(Hello),
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
        samples: Vec<Row>,
    },
    Progress {
        load: u64,
        strokes: u32,
        clamps: u64,
    },
    Stopped {
        load: u64,
        #[serde(flatten)]
        outcome: Outcome,
    },
    Fault {
        what: String,
    },
}

/// Who a child is.
#[derive(Debug, Deserialize)]
pub(super) struct Hello {
    pub(super) format: String,
    pub(super) id: String,
    pub(super) telemetry: bool,
    /// Whether no motor and no hand is behind it.
    #[serde(default)]
    pub(super) simulated: bool,
    pub(super) limits: Limits,
}

/// What a playback came to.
#[derive(Debug, Deserialize)]
pub(super) struct Outcome {
    duration_s: f64,
    strokes: u32,
    least_energy_j: f64,
    switches_per_s: f64,
    clamps: u64,
}

/// t in s, x in mm, v in mm/s, commanded force in N, measured force in N or null.
#[derive(Debug, Deserialize)]
pub(super) struct Row(f64, f64, f64, f64, Option<f64>);

impl From<Row> for Sample {
    fn from(row: Row) -> Self {
        Self {
            t_s: row.0,
            x_mm: row.1,
            v_mm_s: row.2,
            force_command_n: row.3,
            force_measured_n: row.4,
        }
    }
}

impl From<Outcome> for Playback {
    fn from(outcome: Outcome) -> Self {
        Self {
            exploration_s: outcome.duration_s,
            strokes: outcome.strokes,
            least_energy_j: outcome.least_energy_j,
            switches_per_s: outcome.switches_per_s,
            clamp_count: outcome.clamps,
            samples: 0,
            samples_lost: 0,
        }
    }
}

impl Say {
    pub(super) fn hello(self) -> Result<Hello, String> {
        match self {
            Self::Hello(hello) if hello.format != FORMAT => Err(format!(
                "it speaks `{}`, and this version speaks {FORMAT}",
                Untrusted(&short_text(&hello.format))
            )),
            Self::Hello(hello) if hello.id.is_empty() || hello.id.chars().count() > MAX_ID => {
                Err(format!("its id has to have 1 to {MAX_ID} characters"))
            }
            Self::Hello(hello) => Ok(hello),
            other => Err(format!("it says `{}` before `hello`", other.word())),
        }
    }

    pub(super) fn load(&self) -> Option<u64> {
        match self {
            Self::Hello(_) | Self::Fault { .. } => None,
            Self::Loaded { load }
            | Self::Refused { load, .. }
            | Self::Started { load }
            | Self::Samples { load, .. }
            | Self::Progress { load, .. }
            | Self::Stopped { load, .. } => Some(*load),
        }
    }

    pub(super) fn word(&self) -> &'static str {
        match self {
            Self::Hello(_) => "hello",
            Self::Loaded { .. } => "loaded",
            Self::Refused { .. } => "refused",
            Self::Started { .. } => "started",
            Self::Samples { .. } => "samples",
            Self::Progress { .. } => "progress",
            Self::Stopped { .. } => "stopped",
            Self::Fault { .. } => "fault",
        }
    }
}

/// A line of a child.
pub(super) fn read(line: &[u8]) -> Result<Say, String> {
    let mut say: Say = serde_json::from_slice(line).map_err(|e| {
        let shown = String::from_utf8_lossy(line);
        format!("{e}: {}", short_text(shown.trim_end()))
    })?;
    match &mut say {
        Say::Samples { samples, .. } if samples.len() > MAX_SAMPLES => {
            return Err(format!("more than {MAX_SAMPLES} samples"));
        }
        Say::Refused { why: text, .. } | Say::Fault { what: text } => *text = short_text(text),
        _ => {}
    }
    Ok(say)
}

/// The beginning of somebody's text.
pub(super) fn short_text(text: &str) -> String {
    beginning(text, MAX_TEXT)
}

/// At most so many characters of it.
pub(super) fn beginning(text: &str, most: usize) -> String {
    let mut short: String = text.chars().take(most).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}

fn line(value: &Value) -> String {
    format!("{value}\n")
}

/// `start`, `stop`, `limp`, `alive`.
pub(super) fn short(word: &str, load: u64) -> String {
    line(&json!({"do": word, "load": load}))
}

/// `load`, with everything that is to be played.
pub(super) fn load(number: u64, what: &Stimulus<'_>, limits: Limits) -> String {
    let table = what.table.map(|table| {
        let branch = |b: &study_haptics::model::Branch| {
            json!({
                "m_kg": b.m_kg, "b_n_s_per_mm": b.b_n_s_per_mm,
                "k_n_per_mm": b.k_n_per_mm, "f0_n": b.f0_n,
            })
        };
        let (rule, delta_mm) = match table.direction {
            Direction::Sign => ("sign", None),
            Direction::Play { delta_mm } => ("play", Some(delta_mm)),
            Direction::Dahl { delta_mm } => ("dahl", Some(delta_mm)),
        };
        let lookup = match table.lookup {
            Lookup::Linear => "linear",
            Lookup::Floor => "floor",
            Lookup::Nearest => "nearest",
        };
        json!({
            "lookup": lookup,
            "direction": {"rule": rule, "delta_mm": delta_mm},
            "trained": {"x_mm": table.trained.x_mm, "v_mm_s": table.trained.v_mm_s},
            "x_mm": table.x_mm,
            "positive": branch(&table.positive),
            "negative": branch(&table.negative),
        })
    });
    line(&json!({
        "do": "load", "load": number, "model": what.model, "uncertified": what.permitted,
        "limits": {"force_n": limits.force_n.get(), "velocity_mm_s": limits.velocity_mm_s.get()},
        "table": table,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_described_is_refused() {
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
            let error = read(line.as_bytes()).unwrap_err();
            assert!(error.contains(why), "{line}: {error}");
        }
        let other = r#"{"say":"hello","format":"study-process/2","id":"a","telemetry":true,"limits":{"force_n":1,"velocity_mm_s":1}}"#;
        let error = read(other.as_bytes()).unwrap().hello().unwrap_err();
        assert!(error.contains("study-process/1"), "{error}");
    }

    #[test]
    fn a_long_text_is_cut() {
        let line = format!(r#"{{"say":"fault","what":"{}"}}"#, "x".repeat(5000));
        let Say::Fault { what } = read(line.as_bytes()).unwrap() else {
            panic!("no fault");
        };
        assert_eq!(what.chars().count(), MAX_TEXT + 1);
    }
}
