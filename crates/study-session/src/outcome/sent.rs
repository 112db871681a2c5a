//! Numbers that a controller program sends with a playback: `{"say": "outcome", "time_s": 3.2}`.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use study_base::named;
use study_base::text::{QuestionId, Untrusted};
use study_plan::protocol::{DeviceNumber, Protocol};

named! {
    /// Why a number that a controller program sent does not count.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    SentFault {
        /// It is no finite number.
        NoNumber = "no-number",
        /// No outcome has this name.
        Undeclared = "undeclared",
        /// An outcome has this name with another unit.
        OtherUnit = "other-unit",
        /// It came before its playback began or after it had ended.
        OutsidePlayback = "outside-playback",
        /// It was sent before in the same playback, and the first one counts.
        Twice = "twice",
    }
}

impl SentFault {
    /// As a sentence goes on: "it …".
    pub fn in_words(self) -> &'static str {
        match self {
            Self::NoNumber => "is no number",
            Self::Undeclared => "is not declared",
            Self::OtherUnit => "has another unit than was declared",
            Self::OutsidePlayback => "came before or after its playback",
            Self::Twice => "was sent twice in a playback, and the first one counts",
        }
    }
}

/// A number that a controller program sent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SentNumber {
    /// Its name with the unit, such as `time_s`. Untrusted.
    pub key: String,
    /// The number, if it is a finite one.
    pub value: Option<f64>,
    /// Why it does not count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<SentFault>,
}

impl SentNumber {
    /// Whether its name and unit are those of an outcome.
    ///
    /// # Errors
    /// [`SentFault::Undeclared`] or [`SentFault::OtherUnit`].
    pub fn declared_in(&self, protocol: &Protocol) -> Result<(), SentFault> {
        let mut found = Err(SentFault::Undeclared);
        for (_, number) in protocol.numbers_of_device() {
            if number.key() == self.key {
                return Ok(());
            }
            let rest = self.key.strip_prefix(number.name.as_str());
            if rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('_')) {
                found = Err(SentFault::OtherUnit);
            }
        }
        found
    }

    /// What was sent and why it does not count, for a row of `attempts.csv`.
    pub fn in_words(&self) -> String {
        let value = self
            .value
            .map_or_else(String::new, |value| format!(" {value}"));
        let why = self.fault.map_or("", SentFault::as_str);
        format!("{}{value}: {why}", Untrusted(&self.key))
    }
}

/// The numbers that count for the outcomes of a protocol, by outcome. `sent` has the presentation and the number, in
/// the order in which they came. Of several presentations of a trial the last one that sent the number counts.
pub(super) fn counted(sent: &[(usize, SentNumber)], protocol: &Protocol) -> BTreeMap<String, f64> {
    let of = |(id, number): (&QuestionId, &DeviceNumber)| {
        let key = number.key();
        let own = sent.iter().filter(|(_, sent)| sent.key == key);
        let last = own.clone().map(|(presentation, _)| *presentation).max()?;
        let mut in_last = own.filter(|(presentation, _)| *presentation == last);
        let (_, first) = in_last.next()?;
        Some((id.to_string(), first.value?))
    };
    protocol.numbers_of_device().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_plan::protocol::file::parse;

    fn protocol(outcomes: &str) -> Protocol {
        let text = format!(
            r#"
format = "study-protocol/3"
study = {{ id = "x", title = "X", seed = 1 }}
device = {{ kind = "process" }}
design = {{ participants = 4, repetitions = 1, order = "blocked" }}
questions = [{{ id = "rough", kind = "rating", prompt = "How rough?", from = 1, to = 7 }}]
analysis = {{ primary = "rough" }}
models = [{{ id = "a" }}, {{ id = "b" }}]
outcomes = {outcomes}
"#
        );
        let parsed = parse("p.toml", &text);
        (parsed.protocol).unwrap_or_else(|| panic!("{}", parsed.findings.render(false)))
    }

    const TWO: &str = r#"[
  { id = "duration", from = "device", measure = "time", unit = "s" },
  { id = "errors", from = "device", measure = "errors" },
]"#;

    fn sent(key: &str, value: f64) -> SentNumber {
        SentNumber {
            key: key.to_owned(),
            value: Some(value),
            fault: None,
        }
    }

    #[test]
    fn names_and_units_are_those_of_the_protocol() {
        let protocol = protocol(TWO);
        let of = |key: &str| sent(key, 1.0).declared_in(&protocol);
        assert_eq!((of("time_s"), of("errors")), (Ok(()), Ok(())));
        for other in ["time_ms", "time", "time_S", "errors_s"] {
            assert_eq!(of(other), Err(SentFault::OtherUnit), "{other}");
        }
        for none in ["timer_s", "duration_s", "force_n", ""] {
            assert_eq!(of(none), Err(SentFault::Undeclared), "{none}");
        }
    }

    /// In a presentation the first one counts, of presentations the last one.
    #[test]
    fn the_last_presentation_counts_and_in_it_the_first_number() {
        let protocol = protocol(TWO);
        let all = [
            (1, sent("time_s", 3.0)),
            (1, sent("errors", 2.0)),
            (2, sent("time_s", 4.0)),
            (2, sent("time_s", 5.0)),
            (2, sent("time_ms", 9.0)),
        ];
        let found = counted(&all, &protocol);
        assert_eq!((found["duration"], found["errors"]), (4.0, 2.0));
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn the_form_in_a_journal_never_changes() {
        let number = SentNumber {
            fault: Some(SentFault::OtherUnit),
            ..sent("time_ms", 3200.0)
        };
        let written = serde_json::json!(number);
        assert_eq!(
            written,
            serde_json::json!({"key": "time_ms", "value": 3200.0, "fault": "other-unit"})
        );
        let none = serde_json::json!(SentNumber {
            value: None,
            ..sent("time_s", 0.0)
        });
        assert_eq!(none, serde_json::json!({"key": "time_s", "value": null}));
        assert_eq!(
            serde_json::from_value::<SentNumber>(none).unwrap().value,
            None
        );
    }
}
