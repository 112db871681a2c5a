//! Questions and answers: every kind declares here what it accepts.

use crate::text::QuestionId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use unicode_segmentation::UnicodeSegmentation as _;

/// Longest text that an answer or remark may have, bytes. What is longer is cut
/// on a character with a notice before it is confirmed, never after.
pub const MAX_TEXT_BYTES: usize = 4096;

/// A question to a participant or an experimenter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Question {
    /// Its name; a column of `ratings.csv` or `participants.csv`.
    pub id: QuestionId,
    /// What is asked, in any language.
    pub prompt: String,
    /// What can be answered.
    pub kind: QuestionKind,
    /// Whether it can be left empty (text is by default optional, the rest not).
    /// "Declined", with a reason, is possible always.
    pub required: bool,
}

/// What can be answered to a question.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum QuestionKind {
    /// A whole number on a labelled scale.
    Rating {
        /// Smallest.
        from: i64,
        /// Largest, above `from`.
        to: i64,
        /// Words at some of the numbers.
        labels: BTreeMap<i64, String>,
    },
    /// A number on a continuous scale.
    Slider {
        /// Left end.
        from: f64,
        /// Right end, above `from`.
        to: f64,
        /// What one key press moves.
        step: f64,
        /// Words at the two ends (keys are the ends as text).
        labels: BTreeMap<String, String>,
    },
    /// One or several of a list.
    Choice {
        /// What there is to choose from; no two alike.
        options: Vec<String>,
        /// Whether several can be chosen.
        multiple: bool,
    },
    /// A number that is typed.
    Number {
        /// Its unit, for the prompt and the data dictionary.
        unit: Option<String>,
        /// Smallest that is accepted.
        min: Option<f64>,
        /// Largest that is accepted.
        max: Option<f64>,
    },
    /// Free text.
    Text,
}

/// What was answered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// To a rating.
    Rating(i64),
    /// To a slider or a number.
    Number(f64),
    /// To a choice: what was chosen, in the order of the options.
    Choice(Vec<String>),
    /// To a text, as typed.
    Text(String),
    /// To any question: none, and why.
    Declined {
        /// The participant's or experimenter's words.
        reason: String,
    },
}

impl Answer {
    /// As a number, where it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Rating(n) => Some(*n as f64),
            Self::Number(n) => Some(*n),
            Self::Choice(_) | Self::Text(_) | Self::Declined { .. } => None,
        }
    }

    /// Whether the question was declined.
    pub fn is_declined(&self) -> bool {
        matches!(self, Self::Declined { .. })
    }

    /// As it stands in a cell of a CSV: numbers plain, choices joined by `; `,
    /// declined empty.
    pub fn cell(&self) -> String {
        match self {
            Self::Rating(n) => n.to_string(),
            Self::Number(n) => n.to_string(),
            Self::Choice(chosen) => chosen.join("; "),
            Self::Text(text) => text.clone(),
            Self::Declined { .. } => String::new(),
        }
    }
}

impl Question {
    /// Checks an answer against the question.
    ///
    /// # Errors
    /// A short sentence that says what is accepted, for the person who typed it.
    pub fn accepts(&self, answer: &Answer) -> Result<(), String> {
        match (&self.kind, answer) {
            (_, Answer::Declined { reason }) => {
                if reason.trim().is_empty() {
                    Err("say why it is declined".to_owned())
                } else {
                    fits(reason)
                }
            }
            (QuestionKind::Rating { from, to, .. }, Answer::Rating(n)) => {
                if (from..=to).contains(&n) {
                    Ok(())
                } else {
                    Err(format!("choose {from} to {to}"))
                }
            }
            (QuestionKind::Slider { from, to, .. }, Answer::Number(n)) => {
                if (from..=to).contains(&n) {
                    Ok(())
                } else {
                    Err(format!("choose {from} to {to}"))
                }
            }
            (QuestionKind::Number { min, max, .. }, Answer::Number(n)) => {
                let low = min.is_some_and(|m| *n < m);
                let high = max.is_some_and(|m| *n > m);
                if n.is_finite() && !low && !high {
                    Ok(())
                } else {
                    Err(match (min, max) {
                        (Some(a), Some(b)) => format!("a number from {a} to {b}"),
                        (Some(a), None) => format!("a number from {a} up"),
                        (None, Some(b)) => format!("a number up to {b}"),
                        (None, None) => "a number".to_owned(),
                    })
                }
            }
            (QuestionKind::Choice { options, multiple }, Answer::Choice(chosen)) => {
                let known = chosen.iter().all(|c| options.contains(c));
                let count = *multiple || chosen.len() <= 1;
                if !known || !count {
                    Err("choose from the list".to_owned())
                } else if chosen.is_empty() && self.required {
                    Err("choose one".to_owned())
                } else {
                    Ok(())
                }
            }
            (QuestionKind::Text, Answer::Text(text)) => {
                if text.trim().is_empty() && self.required {
                    Err("an answer is needed".to_owned())
                } else {
                    fits(text)
                }
            }
            _ => Err("the answer is of another kind than the question".to_owned()),
        }
    }
}

fn fits(text: &str) -> Result<(), String> {
    if text.len() > MAX_TEXT_BYTES {
        Err(format!("at most {MAX_TEXT_BYTES} bytes"))
    } else {
        Ok(())
    }
}

/// Cuts text to [`MAX_TEXT_BYTES`] between what a reader sees as characters;
/// says whether anything was cut.
pub fn cut_to_fit(text: &str) -> (&str, bool) {
    if text.len() <= MAX_TEXT_BYTES {
        return (text, false);
    }
    let end = text
        .grapheme_indices(true)
        .map(|(at, g)| at + g.len())
        .take_while(|end| *end <= MAX_TEXT_BYTES)
        .last()
        .unwrap_or(0);
    (&text[..end], true)
}
