//! Questions, answers, and which answers a question accepts.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use study_base::text::QuestionId;
use unicode_segmentation::UnicodeSegmentation as _;

/// Longest text of an answer or remark, bytes. Longer text is cut between
/// characters, with a notice, before it is confirmed.
pub const MAX_TEXT_BYTES: usize = 4096;

/// A question to a participant or an experimenter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Question {
    /// Its name, also of its column in `ratings.csv` or `participants.csv`.
    pub id: QuestionId,
    /// The text of the question, in any language.
    pub prompt: String,
    /// Which answers are possible.
    pub kind: QuestionKind,
    /// Whether an answer is required; by default for every kind but text.
    /// Declining, with a reason, is always possible.
    pub required: bool,
}

/// The kind of a question, which decides what its answers are.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum QuestionKind {
    /// A whole number on a labelled scale.
    Rating {
        /// Smallest rating.
        from: i64,
        /// Largest rating, above `from`.
        to: i64,
        /// Labels of some of the ratings.
        labels: BTreeMap<i64, String>,
    },
    /// A number on a continuous scale.
    Slider {
        /// Left end.
        from: f64,
        /// Right end, above `from`.
        to: f64,
        /// How far one key press moves it.
        step: f64,
        /// Labels of some numbers, by the number as text.
        labels: BTreeMap<String, String>,
    },
    /// One or several of a list.
    Choice {
        /// The options, no two alike.
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
        /// Only larger numbers are accepted.
        #[serde(skip_serializing_if = "Option::is_none")]
        above: Option<f64>,
    },
    /// Free text.
    Text,
}

impl QuestionKind {
    /// Whether its answers are numbers.
    pub fn is_number(&self) -> bool {
        match self {
            Self::Rating { .. } | Self::Slider { .. } | Self::Number { .. } => true,
            Self::Choice { .. } | Self::Text => false,
        }
    }
}

/// An answer to a question.
///
/// Journals have the names of the variants, which therefore never change. A program
/// that does not know a variant skips its record, reports it, and does not continue
/// that session.
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
    /// To any question: declined.
    Declined {
        /// The reason, as typed.
        reason: String,
    },
}

/// Why an answer is not accepted, as a request to the person who gave it.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum AnswerError {
    #[error("say why it is declined")]
    NoReason,
    #[error("choose {0} to {1}")]
    OffScale(f64, f64),
    #[error("{}", range(*.min, *.max))]
    OutOfRange { min: Option<f64>, max: Option<f64> },
    #[error("a number above {0}")]
    NotAbove(f64),
    #[error("choose from the list")]
    NotAnOption,
    #[error("choose one")]
    NothingChosen,
    #[error("an answer is needed")]
    Empty,
    #[error("at most {MAX_TEXT_BYTES} bytes")]
    TooLong,
    #[error("the answer is of another kind than the question")]
    OtherKind,
}

fn range(min: Option<f64>, max: Option<f64>) -> String {
    match (min, max) {
        (Some(a), Some(b)) => format!("a number from {a} to {b}"),
        (Some(a), None) => format!("a number from {a} up"),
        (None, Some(b)) => format!("a number up to {b}"),
        (None, None) => "a number".to_owned(),
    }
}

impl Answer {
    /// The answer as a number, if it is one.
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

    /// The cell of a CSV: a number, the chosen options joined by `; `, the text, or
    /// nothing if declined.
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
    /// [`AnswerError`] if the answer is not accepted.
    pub fn accepts(&self, answer: &Answer) -> Result<(), AnswerError> {
        let when = |refused: bool, error| if refused { Err(error) } else { Ok(()) };
        let fits = |text: &str| when(text.len() > MAX_TEXT_BYTES, AnswerError::TooLong);
        match (&self.kind, answer) {
            (_, Answer::Declined { reason }) => {
                when(reason.trim().is_empty(), AnswerError::NoReason)?;
                fits(reason)
            }
            (&QuestionKind::Rating { from, to, .. }, Answer::Rating(n)) => {
                let scale = AnswerError::OffScale(from as f64, to as f64);
                when(!(from..=to).contains(n), scale)
            }
            (&QuestionKind::Slider { from, to, .. }, Answer::Number(n)) => {
                when(!(from..=to).contains(n), AnswerError::OffScale(from, to))
            }
            (
                &QuestionKind::Number {
                    above: Some(above), ..
                },
                Answer::Number(n),
            ) if *n <= above => Err(AnswerError::NotAbove(above)),
            (&QuestionKind::Number { min, max, .. }, Answer::Number(n)) => {
                let low = min.is_some_and(|m| *n < m);
                let high = max.is_some_and(|m| *n > m);
                let range = AnswerError::OutOfRange { min, max };
                when(!n.is_finite() || low || high, range)
            }
            (QuestionKind::Choice { options, multiple }, Answer::Choice(chosen)) => {
                let known = chosen.iter().all(|c| options.contains(c));
                let once = (1..chosen.len()).all(|i| !chosen[..i].contains(&chosen[i]));
                let count = *multiple || chosen.len() <= 1;
                when(!known || !once || !count, AnswerError::NotAnOption)?;
                when(
                    chosen.is_empty() && self.required,
                    AnswerError::NothingChosen,
                )
            }
            (QuestionKind::Text, Answer::Text(text)) => {
                when(text.trim().is_empty() && self.required, AnswerError::Empty)?;
                fits(text)
            }
            _ => Err(AnswerError::OtherKind),
        }
    }
}

/// Cuts text to [`MAX_TEXT_BYTES`] between grapheme clusters; also returns whether
/// anything was cut.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn question(kind: QuestionKind, required: bool) -> Question {
        Question {
            id: QuestionId::new("q").unwrap(),
            prompt: "?".to_owned(),
            kind,
            required,
        }
    }

    #[test]
    fn a_rating_is_on_the_scale() {
        let rating = question(
            QuestionKind::Rating {
                from: 1,
                to: 7,
                labels: BTreeMap::new(),
            },
            true,
        );
        for (given, good) in [(0, false), (1, true), (7, true), (8, false)] {
            assert_eq!(
                rating.accepts(&Answer::Rating(given)).is_ok(),
                good,
                "{given}"
            );
        }
        assert!(rating.accepts(&Answer::Number(3.0)).is_err());
    }

    #[test]
    fn a_number_that_is_none_is_refused() {
        let slider = question(
            QuestionKind::Slider {
                from: 0.0,
                to: 1.0,
                step: 0.1,
                labels: BTreeMap::new(),
            },
            true,
        );
        let number = question(
            QuestionKind::Number {
                unit: None,
                min: None,
                max: Some(99.0),
                above: None,
            },
            true,
        );
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 100.0] {
            assert!(slider.accepts(&Answer::Number(bad)).is_err(), "{bad}");
            assert!(number.accepts(&Answer::Number(bad)).is_err(), "{bad}");
        }
        assert!(slider.accepts(&Answer::Number(0.25)).is_ok());
        let refused = number.accepts(&Answer::Number(100.0)).unwrap_err();
        assert_eq!(refused.to_string(), "a number up to 99");
    }

    #[test]
    fn a_choice_is_from_the_list_and_each_option_once() {
        let choose = |multiple, required, chosen: &[&str]| {
            let options = vec!["a".to_owned(), "b".to_owned()];
            question(QuestionKind::Choice { options, multiple }, required)
                .accepts(&Answer::Choice(
                    chosen.iter().map(|c| (*c).to_owned()).collect(),
                ))
                .is_ok()
        };
        assert!(choose(false, true, &["a"]));
        assert!(!choose(false, true, &["a", "b"]));
        assert!(!choose(false, true, &["c"]));
        assert!(!choose(true, true, &[]));
        assert!(choose(true, false, &[]));
        assert!(choose(true, true, &["b", "a"]));
        assert!(!choose(true, true, &["a", "a"]));
    }

    #[test]
    fn any_question_can_be_declined_with_a_reason() {
        let text = question(QuestionKind::Text, true);
        let declined = |reason: &str| Answer::Declined {
            reason: reason.to_owned(),
        };
        assert!(text.accepts(&declined("too personal")).is_ok());
        assert!(text.accepts(&declined(" ")).is_err());
        assert!(text.accepts(&Answer::Text(" ".to_owned())).is_err());
    }

    #[test]
    fn long_text_is_cut_between_characters() {
        let flag = "🇩🇪"; // one character of two code points, 8 bytes
        let long = "x".repeat(MAX_TEXT_BYTES - 4) + flag;
        let (cut, was_cut) = cut_to_fit(&long);
        assert!(was_cut);
        assert_eq!(cut.len(), MAX_TEXT_BYTES - 4);
        assert_eq!(cut_to_fit("short"), ("short", false));
    }
}
