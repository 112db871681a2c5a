//! Answers, what a person gives in place of one, and why it is refused.

use super::phrases::{Phrase, Words};
use serde::{Deserialize, Serialize};
use std::fmt;
use study_base::text::ascii_number;
use unicode_segmentation::UnicodeSegmentation as _;

/// Longest text of an answer or remark, bytes. Longer text is cut between
/// characters, with a notice, before it is confirmed.
pub const MAX_TEXT_BYTES: usize = 4096;

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

/// What a person enters to answer a question, on any channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Given {
    /// A number or a text, as typed. In place of a list, the numbers of options from 1.
    Typed(String),
    /// Indices of the chosen options from 0, in the order in which they were chosen.
    Chosen(Vec<usize>),
}

impl Given {
    /// Whether nothing is entered.
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Typed(text) => text.trim().is_empty(),
            Self::Chosen(chosen) => chosen.is_empty(),
        }
    }
}

/// Why an answer is not accepted. [`Refusal::words`] asks for a better one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// No number of this scale is chosen.
    NoNumber(f64, f64),
    /// The marker is not set on a scale with these ends.
    NoMark(f64, f64),
    /// No option is chosen.
    NoOption,
    /// No number is typed.
    NothingTyped,
    /// No text is typed.
    NoText,
    /// A question is declined without a reason.
    NoReason,
    /// The number is not on the scale with these ends.
    OffScale(f64, f64),
    /// The number is outside these bounds.
    OutOfRange {
        /// Smallest number.
        min: Option<f64>,
        /// Largest number.
        max: Option<f64>,
    },
    /// The number is not above this one.
    NotAbove(f64),
    /// The text is not a number.
    NotANumber,
    /// The list has only so many options.
    NotListed(usize),
    /// The rank was given to something else, and no two are alike.
    RankTaken(i64),
    /// The text has more than [`MAX_TEXT_BYTES`].
    TooLong,
    /// It is no answer to a question of this kind.
    OtherKind,
}

impl Refusal {
    /// What to do instead, in the language of the study. Every channel says these words.
    pub fn words(&self, words: &Words) -> String {
        let ends = |phrase, from: f64, to: f64| words.fill(phrase, &[("from", &from), ("to", &to)]);
        let phrase = match *self {
            Self::NoNumber(from, to) => return ends(Phrase::NumberFirst, from, to),
            Self::NoMark(from, to) => return ends(Phrase::SliderFirst, from, to),
            Self::OffScale(from, to) => return ends(Phrase::OffScale, from, to),
            Self::OutOfRange { min, max } => return range(min, max, words),
            Self::NotAbove(above) => return words.fill(Phrase::RangeAbove, &[("above", &above)]),
            Self::NotListed(total) => return words.fill(Phrase::ListHas, &[("total", &total)]),
            Self::RankTaken(rank) => return words.fill(Phrase::RankTaken, &[("rank", &rank)]),
            // The editors of all channels cut a text before.
            Self::TooLong => return format!("At most {MAX_TEXT_BYTES} bytes."),
            Self::NoOption => Phrase::OptionFirst,
            Self::NothingTyped => Phrase::TypeNumberFirst,
            Self::NoText => Phrase::TypeAnswerFirst,
            Self::NoReason => Phrase::DeclineWhy,
            Self::NotANumber => Phrase::NumberLike,
            Self::OtherKind => Phrase::PlainNoAnswer,
        };
        words.get(phrase).to_owned()
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words(&Words::default()))
    }
}

impl std::error::Error for Refusal {}

/// Which numbers can be typed, as a request.
pub fn range(min: Option<f64>, max: Option<f64>, words: &Words) -> String {
    match (min, max) {
        (Some(min), Some(max)) => words.fill(Phrase::Range, &[("from", &min), ("to", &max)]),
        (Some(min), None) => words.fill(Phrase::RangeFrom, &[("from", &min)]),
        (None, Some(max)) => words.fill(Phrase::RangeTo, &[("to", &max)]),
        (None, None) => words.get(Phrase::NumberLike).to_owned(),
    }
}

/// Parses a number in the digits of any keyboard. A comma is a decimal separator.
///
/// ```
/// use study_plan::protocol::answer::number;
/// assert_eq!(number(" 12,5"), Some(12.5));
/// assert_eq!(number("inf"), None);
/// ```
pub fn number(text: &str) -> Option<f64> {
    let number: f64 = digits(text).replace(',', ".").parse().ok()?;
    number.is_finite().then_some(number)
}

/// Trimmed text with the digits and signs of any keyboard as ASCII.
pub(super) fn digits(text: &str) -> String {
    text.trim().chars().map(ascii_number).collect()
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

/// Text as it is kept: cut to fit, with `\n` as line break and without NUL.
pub fn tidy(text: &str) -> String {
    let text = cut_to_fit(text).0;
    let mut text = text.replace("\r\n", "\n").replace('\r', "\n");
    text.retain(|c| c != '\0');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_text_is_cut_between_characters() {
        let flag = "🇩🇪"; // one character of two code points, 8 bytes
        let long = "x".repeat(MAX_TEXT_BYTES - 4) + flag;
        let (cut, was_cut) = cut_to_fit(&long);
        assert!(was_cut);
        assert_eq!(cut.len(), MAX_TEXT_BYTES - 4);
        assert_eq!(cut_to_fit("short"), ("short", false));
    }

    #[test]
    fn text_is_kept_without_foreign_line_breaks() {
        assert_eq!(tidy("a\r\nb\rc\0"), "a\nb\nc");
    }
}
