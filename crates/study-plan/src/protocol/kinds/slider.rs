//! A number on a continuous scale.

use super::{Declared, Draws, Kind, accept_if, ascending};
use crate::protocol::answer::{Answer, Refusal};
use crate::protocol::control::Control;
use crate::protocol::keys::{Key, Kind as Type, keys};
use crate::protocol::scale::Scale;
use crate::protocol::section::Section;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use study_base::diagnostic::Fault;

/// A number on a continuous scale.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Slider {
    /// Left end.
    pub from: f64,
    /// Right end, above `from`.
    pub to: f64,
    /// How far one key press moves it.
    pub step: f64,
    /// Labels of some numbers, by the number as text.
    pub labels: BTreeMap<String, String>,
}

impl Kind for Slider {
    fn accepts(&self, answer: &Answer, _required: bool) -> Result<(), Refusal> {
        let Answer::Number(n) = answer else {
            return Err(Refusal::OtherKind);
        };
        let off_scale = Refusal::OffScale(self.from, self.to);
        accept_if((self.from..=self.to).contains(n), off_scale)
    }

    fn scale(&self) -> Scale<'_> {
        Scale::Interval {
            from: self.from,
            to: self.to,
            labels: &self.labels,
        }
    }

    fn control(&self) -> Control<'_> {
        let labels = self.labels.iter();
        let labels = labels.filter_map(|(at, label)| Some((at.parse().ok()?, label.as_str())));
        Control::Track {
            from: self.from,
            to: self.to,
            step: self.step,
            labels: labels.collect(),
        }
    }

    fn texts_mut(&mut self) -> Vec<&mut String> {
        self.labels.values_mut().collect()
    }

    fn stimulus(&self) -> Value {
        json!({ "slider": [self.from, self.to, self.step] })
    }

    fn simulate(&self, draws: &mut dyn Draws) -> Answer {
        let mut along = draws.position() * (self.to - self.from);
        if self.step > 0.0 {
            along = (along / self.step).round() * self.step;
        }
        Answer::Number((self.from + along).clamp(self.from, self.to))
    }
}

impl Declared for Slider {
    const WORD: &'static str = "slider";
    const MEANING: &'static str = "A number on a continuous scale.";
    const KEYS: &'static [Key] = keys! {
        /// The left end.
        "from": Type::ANY_NUMBER, "0", required;
        /// The right end, above `from`.
        "to": Type::ANY_NUMBER, "100", required;
        /// How far one key press moves the slider.
        "step": Type::positive(""), "5", derived("a hundredth of the scale");
        /// Texts at some of the numbers.
        "labels": Type::NumberLabels, r#"{ 0 = "not at all", 50 = "half", 100 = "completely" }"#;
    };

    fn read(section: &mut Section<'_, '_>) -> Option<Self> {
        let (from, to) = (section.number("from"), section.number("to"));
        let step = section.number("step");
        let (from, to) = (from?, to?);
        ascending(section, from, to)?;
        let step = step.unwrap_or((to - from) / 100.0);
        if !(step > 0.0 && step <= to - from) {
            section.fault_at(
                "step",
                Fault::error(format!(
                    "`{}.step` has to be above 0 and at most {}, not {step}",
                    section.path(),
                    to - from
                )),
            );
        }
        let labels = section.number_labels(from, to)?;
        Some(Self {
            from,
            to,
            step,
            labels,
        })
    }

    fn examples() -> Vec<Self> {
        let labels = [("0", "none"), ("1", "all")].map(|(at, l)| (at.to_owned(), l.to_owned()));
        vec![Self {
            from: 0.0,
            to: 1.0,
            step: 0.05,
            labels: labels.into(),
        }]
    }
}
