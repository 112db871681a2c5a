//! A whole number on a labeled scale.

use super::{Declared, Draws, Kind, accept_if, ascending};
use crate::protocol::answer::{Answer, Refusal};
use crate::protocol::control::Control;
use crate::protocol::keys::{Key, Kind as Type, keys};
use crate::protocol::scale::Scale;
use crate::protocol::section::{Section, text};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use study_base::diagnostic::Fault;
use study_base::text::Untrusted;

/// Most points of a scale: one key or click each.
const MAX_POINTS: i64 = 101;

/// A whole number on a labeled scale.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rating {
    /// Smallest rating.
    pub from: i64,
    /// Largest rating, above `from`.
    pub to: i64,
    /// Labels of some of the ratings.
    pub labels: BTreeMap<i64, String>,
}

impl Kind for Rating {
    fn accepts(&self, answer: &Answer, _required: bool) -> Result<(), Refusal> {
        let &Answer::Rating(n) = answer else {
            return Err(Refusal::OtherKind);
        };
        let off_scale = Refusal::OffScale(self.from as f64, self.to as f64);
        accept_if((self.from..=self.to).contains(&n), off_scale)
    }

    fn scale(&self) -> Scale<'_> {
        Scale::Levels {
            from: self.from,
            to: self.to,
            labels: &self.labels,
        }
    }

    fn control(&self) -> Control<'_> {
        Control::Boxes {
            from: self.from,
            to: self.to,
            labels: &self.labels,
        }
    }

    fn texts_mut(&mut self) -> Vec<&mut String> {
        self.labels.values_mut().collect()
    }

    fn stimulus(&self) -> Value {
        json!({ "rating": [self.from, self.to] })
    }

    fn simulate(&self, draws: &mut dyn Draws) -> Answer {
        let span = (self.to - self.from) as f64;
        let steps = (draws.position() * span).round() as i64;
        Answer::Rating((self.from + steps).clamp(self.from, self.to))
    }
}

impl Declared for Rating {
    const WORD: &'static str = "rating";
    const MEANING: &'static str = "A whole number on a labeled scale.";
    const KEYS: &'static [Key] = keys! {
        /// The smallest rating.
        "from": Type::ANY_WHOLE, "1", required;
        /// The largest rating, above `from`. A scale has at most 101 points.
        "to": Type::ANY_WHOLE, "7", required;
        /// Texts at some of the numbers.
        "labels": Type::WholeLabels, r#"{ 1 = "not at all realistic", 7 = "very realistic" }"#;
    };

    fn read(section: &mut Section<'_, '_>) -> Option<Self> {
        let (from, to) = (section.whole::<i64>("from"), section.whole::<i64>("to"));
        let (from, to) = (from?, to?);
        ascending(section, from, to)?;
        if to.checked_sub(from).is_none_or(|n| n >= MAX_POINTS) {
            section.fault_at(
                "to",
                Fault::error(format!(
                    "a rating has at most {MAX_POINTS} points, not {from} to {to}"
                ))
                .hint("`kind = \"slider\"` is for fine scales"),
            );
            return None;
        }
        let mut labels = BTreeMap::new();
        for (key, label) in section.entries("labels") {
            match key.parse::<i64>() {
                Ok(at) if (from..=to).contains(&at) => {
                    labels.insert(at, text(&label)?);
                }
                Ok(at) => label.fault(Fault::error(format!(
                    "the label at {at} is outside the scale {from} to {to}"
                ))),
                Err(_) => label.fault(
                    Fault::error(format!(
                        "a label belongs to a whole number, not to `{}`",
                        Untrusted(&key)
                    ))
                    .hint("such as labels = { 1 = \"not at all\", 7 = \"very\" }"),
                ),
            }
        }
        Some(Self { from, to, labels })
    }

    fn examples() -> Vec<Self> {
        let labels = [(1, "not at all"), (7, "very")].map(|(at, l)| (at, l.to_owned()));
        let labeled = Self {
            from: 1,
            to: 7,
            labels: labels.into(),
        };
        // Too many points for boxes.
        let long = Self {
            from: -50,
            to: 50,
            labels: BTreeMap::new(),
        };
        vec![labeled, long]
    }
}
