//! A number that is typed.

use super::{Declared, Draws, Kind, accept_if};
use crate::protocol::answer::{Answer, Refusal};
use crate::protocol::control::Control;
use crate::protocol::keys::{Key, Kind as Type, keys};
use crate::protocol::scale::Scale;
use crate::protocol::section::Section;
use serde::Serialize;
use serde_json::{Value, json};
use study_base::diagnostic::Fault;

/// A number that is typed.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Number {
    /// Its unit, for the prompt and the data dictionary.
    pub unit: Option<String>,
    /// Smallest that is accepted.
    pub min: Option<f64>,
    /// Largest that is accepted.
    pub max: Option<f64>,
    /// Only larger numbers are accepted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub above: Option<f64>,
}

impl Kind for Number {
    fn accepts(&self, answer: &Answer, _required: bool) -> Result<(), Refusal> {
        let &Self {
            min, max, above, ..
        } = self;
        let &Answer::Number(n) = answer else {
            return Err(Refusal::OtherKind);
        };
        if let Some(above) = above.filter(|above| n <= *above) {
            return Err(Refusal::NotAbove(above));
        }
        let within = min.is_none_or(|min| n >= min) && max.is_none_or(|max| n <= max);
        accept_if(n.is_finite() && within, Refusal::OutOfRange { min, max })
    }

    fn scale(&self) -> Scale<'_> {
        Scale::Open {
            unit: self.unit.as_deref(),
            min: self.min,
            max: self.max,
            above: self.above,
        }
    }

    fn control(&self) -> Control<'_> {
        Control::Digits {
            unit: self.unit.as_deref(),
            min: self.min,
            max: self.max,
            above: self.above,
        }
    }

    fn texts_mut(&mut self) -> Vec<&mut String> {
        self.unit.iter_mut().collect()
    }

    fn stimulus(&self) -> Value {
        let mut stimulus = json!({ "number": [self.min, self.max], "unit": self.unit });
        // Absent from the fingerprints of numbers without it.
        if let Some(above) = self.above {
            stimulus["above"] = json!(above);
        }
        stimulus
    }

    /// A number within the bounds, whole if possible; without bounds a plausible age.
    fn simulate(&self, draws: &mut dyn Draws) -> Answer {
        let least = self.min.or(self.above);
        let low = least.unwrap_or_else(|| self.max.map_or(18.0, |max| max - 40.0));
        let high = self.max.unwrap_or(low + 40.0);
        let drawn = low + draws.unit() * (high - low);
        let allowed = |n: &f64| {
            (low..=high).contains(n) && self.above.is_none_or(|above| *n > above)
        };
        let numbers = [drawn.round(), drawn.clamp(low, high)];
        Answer::Number(numbers.into_iter().find(allowed).unwrap_or(high))
    }
}

impl Declared for Number {
    const WORD: &'static str = "number";
    const MEANING: &'static str = "A number that is typed.";
    const KEYS: &'static [Key] = keys! {
        /// The unit, shown with the prompt and recorded in the data dictionary.
        "unit": Type::Text, r#""years""#;
        /// The smallest number that is accepted.
        "min": Type::ANY_NUMBER, "18";
        /// The largest number that is accepted.
        "max": Type::ANY_NUMBER, "99";
        /// Only numbers above this one are accepted.
        "above": Type::ANY_NUMBER, "0";
    };

    fn read(section: &mut Section<'_, '_>) -> Option<Self> {
        let unit = section.text("unit");
        let (min, max) = (section.number("min"), section.number("max"));
        let above = section.number("above");
        if let (Some(above), Some(max)) = (above, max)
            && above >= max
        {
            let what = format!("no number is above {above} and at most max = {max}");
            section.fault_at("above", Fault::error(what));
        }
        if let (Some(min), Some(max)) = (min, max)
            && min > max
        {
            section.fault_at(
                "min",
                Fault::error(format!(
                    "no number lies between min = {min} and max = {max}"
                ))
                .hint("swap them"),
            );
        }
        Some(Self {
            unit,
            min,
            max,
            above,
        })
    }

    fn examples() -> Vec<Self> {
        let age = Self {
            unit: Some("years".to_owned()),
            min: Some(18.0),
            max: Some(99.0),
            above: None,
        };
        let positive = Self {
            above: Some(0.0),
            ..Self::default()
        };
        vec![age, positive, Self::default()]
    }
}
