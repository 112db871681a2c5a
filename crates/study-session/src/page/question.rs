//! A question on a page, and what was given as its answer.

use super::safe;
use serde::Serialize;
use std::fmt::Display;
use study_base::text::Untrusted;
use study_plan::protocol::answer::range;
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{Control, Given, Pick, Question};

/// A rating scale with more points is answered by typing.
const MOST_BOXES: i64 = 21;

/// A question as the page asks it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Asked {
    /// Its id.
    pub id: String,
    /// Its text.
    pub prompt: String,
    /// The word for a question that may be left empty.
    pub optional: Option<String>,
    /// What can be answered, in words; may be empty.
    pub hint: String,
    /// How it is answered.
    pub field: Field,
    /// The answer that was given before a step back.
    pub given: Option<Given>,
}

/// How a question is answered.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Field {
    /// One box for each number.
    Boxes {
        /// The numbers with their labels, which may be empty.
        boxes: Vec<(i64, String)>,
    },
    /// A slider without a preset.
    Slider {
        /// First end.
        from: f64,
        /// Last end.
        to: f64,
        /// How far a key moves it.
        step: f64,
        /// The two ends in words.
        ends: [String; 2],
        /// Labels of numbers between them.
        labels: Vec<(f64, String)>,
    },
    /// One or several of a list; the answer is their indices.
    Choice {
        /// The options.
        options: Vec<String>,
        /// Whether several can be chosen.
        multiple: bool,
    },
    /// A typed number.
    Number {
        /// Its unit; may be empty.
        unit: String,
    },
    /// A typed text.
    Text,
}

/// The question as a page asks it.
pub(super) fn asked(question: &Question, words: &Words) -> Asked {
    let mut hint = String::new();
    let field = match question.kind.control() {
        Control::Boxes { from, to, labels } => {
            if to.saturating_sub(from) < MOST_BOXES {
                let label = |n: i64| labels.get(&n).map_or(String::new(), |l| safe(l));
                Field::Boxes {
                    boxes: (from..=to).map(|n| (n, label(n))).collect(),
                }
            } else {
                hint = words.fill(Phrase::Range, &[("from", &from), ("to", &to)]);
                for (n, label) in labels {
                    let label = Untrusted(label);
                    let values = [("value", n as &dyn Display), ("label", &label)];
                    hint = format!("{hint}\n{}", words.fill(Phrase::PlainLabel, &values));
                }
                Field::Number {
                    unit: String::new(),
                }
            }
        }
        Control::Track {
            from,
            to,
            step,
            labels,
        } => {
            let end = |end: f64| match labels.iter().find(|(at, _)| *at == end) {
                Some((_, label)) => format!("{end}: {}", Untrusted(label)),
                None => end.to_string(),
            };
            Field::Slider {
                from,
                to,
                step,
                ends: [end(from), end(to)],
                labels: (labels.iter())
                    .filter(|(at, _)| *at > from && *at < to)
                    .map(|(at, label)| (*at, safe(label)))
                    .collect(),
            }
        }
        Control::List { options, pick } => Field::Choice {
            options: options.iter().map(|o| safe(o)).collect(),
            multiple: pick == Pick::Many,
        },
        Control::Digits {
            unit,
            min,
            max,
            above,
        } => {
            hint = match above {
                Some(above) => words.fill(Phrase::RangeAbove, &[("above", &above)]),
                None => range(min, max, words),
            };
            Field::Number {
                unit: unit.map_or(String::new(), safe),
            }
        }
        Control::Text => Field::Text,
    };
    Asked {
        id: question.id.to_string(),
        prompt: safe(&question.prompt),
        optional: (!question.required).then(|| words.get(Phrase::Optional).to_owned()),
        hint,
        field,
        given: None,
    }
}
