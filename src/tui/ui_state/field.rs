//! The field of one question. No answer is preset: what was not chosen is not sent.

use crate::tui::editor::{Editor, Handled};
use crate::tui::keys::Key;
use std::collections::BTreeSet;
use study_base::text::{ascii_number, sentence};
use study_core::protocol::phrases::{Phrase, Words};
use study_core::protocol::{Answer, AnswerError, Question, QuestionKind};

/// The answer to one question, as entered so far.
///
/// `answer`, `key`, `set_number` and `toggle` match field and kind together and ignore
/// what does not fit: for a new kind the compiler does not list them.
#[derive(Debug, Clone, PartialEq)]
pub enum Field {
    /// A rating.
    Rating {
        /// The chosen number.
        chosen: Option<i64>,
        /// Digits typed so far.
        typed: String,
    },
    /// A slider.
    Slider {
        /// The value at the marker.
        value: Option<f64>,
        /// Digits typed so far.
        typed: String,
    },
    /// A choice.
    Choice {
        /// Index of the option that the keys act on; it is not chosen thereby.
        cursor: Option<usize>,
        /// Indices of the chosen options.
        marked: BTreeSet<usize>,
    },
    /// A number.
    Number(Editor),
    /// A text.
    Text(Editor),
}

impl Field {
    /// An empty field for a question.
    pub fn new(question: &Question) -> Self {
        match &question.kind {
            QuestionKind::Rating { .. } => Self::Rating {
                chosen: None,
                typed: String::new(),
            },
            QuestionKind::Slider { .. } => Self::Slider {
                value: None,
                typed: String::new(),
            },
            QuestionKind::Choice { .. } => Self::Choice {
                cursor: None,
                marked: BTreeSet::new(),
            },
            QuestionKind::Number { .. } => Self::Number(Editor::line("")),
            QuestionKind::Text => Self::Text(Editor::new("")),
        }
    }

    /// A field that holds the answer that was given before.
    pub fn with(question: &Question, given: Option<&Answer>) -> Self {
        let typed = String::new();
        match (&question.kind, given) {
            (QuestionKind::Rating { .. }, Some(Answer::Rating(n))) => Self::Rating {
                chosen: Some(*n),
                typed,
            },
            (QuestionKind::Slider { .. }, Some(Answer::Number(n))) => Self::Slider {
                value: Some(*n),
                typed,
            },
            (QuestionKind::Choice { options, .. }, Some(Answer::Choice(chosen))) => {
                let at = |option| options.iter().position(|o| o == option);
                let marked: BTreeSet<usize> = chosen.iter().filter_map(at).collect();
                Self::Choice {
                    cursor: marked.first().copied(),
                    marked,
                }
            }
            (QuestionKind::Number { .. }, Some(Answer::Number(n))) => {
                Self::Number(Editor::line(&n.to_string()))
            }
            (QuestionKind::Text, Some(Answer::Text(text))) => Self::Text(Editor::new(text)),
            _ => Self::new(question),
        }
    }

    /// A field for the correction of `old`: a text field starts with it, others are empty.
    pub fn correcting(question: &Question, old: &Answer) -> Self {
        match (&question.kind, old) {
            (QuestionKind::Text, Answer::Text(text)) => Self::Text(Editor::new(text)),
            _ => Self::new(question),
        }
    }

    /// Whether a character, including Space, is text in this field.
    pub fn is_text(&self) -> bool {
        matches!(self, Self::Text(_))
    }

    /// Its text editor, if it has one.
    pub fn editor(&mut self) -> Option<&mut Editor> {
        match self {
            Self::Number(editor) | Self::Text(editor) => Some(editor),
            _ => None,
        }
    }

    /// The answer entered so far; `None` if there is none.
    ///
    /// # Errors
    /// What to do, if the entry is not a valid answer.
    pub fn answer(&self, question: &Question, words: &Words) -> Result<Option<Answer>, String> {
        let answer = match (self, &question.kind) {
            (Self::Rating { chosen, .. }, _) => chosen.map(Answer::Rating),
            (Self::Slider { value, .. }, _) => value.map(Answer::Number),
            (Self::Choice { marked, .. }, QuestionKind::Choice { options, .. })
                if !marked.is_empty() =>
            {
                let chosen = marked.iter().filter_map(|i| options.get(*i).cloned());
                Some(Answer::Choice(chosen.collect()))
            }
            (Self::Number(editor), _) if !editor.is_blank() => {
                let number = parse(editor.text()).ok_or(words.get(Phrase::NumberLike))?;
                Some(Answer::Number(number))
            }
            (Self::Text(editor), _) if !editor.is_blank() => {
                Some(Answer::Text(editor.text().to_owned()))
            }
            _ => None,
        };
        match &answer {
            Some(answer) => question
                .accepts(answer)
                .map_err(|why| in_words(why, words))?,
            None if question.required => return Err(ask_for(question, words)),
            None => {}
        }
        Ok(answer)
    }

    /// Handles a key.
    pub fn key(&mut self, question: &Question, key: Key, words: &Words) -> Handled {
        let on_scale = matches!(self, Self::Rating { .. } | Self::Slider { .. });
        let key = match key {
            Key::Left if on_scale && words.scales_from_right() => Key::Right,
            Key::Right if on_scale && words.scales_from_right() => Key::Left,
            Key::Char(c) if !matches!(self, Self::Text(_)) => Key::Char(ascii_number(c)),
            key => key,
        };
        match (self, &question.kind) {
            (Self::Rating { chosen, typed }, QuestionKind::Rating { from, to, .. }) => {
                rating(chosen, typed, (*from, *to), key, words)
            }
            (Self::Slider { value, typed }, QuestionKind::Slider { from, to, step, .. }) => {
                slider(value, typed, (*from, *to, *step), key, words)
            }
            (Self::Choice { cursor, marked }, QuestionKind::Choice { options, multiple }) => {
                choice(cursor, marked, (options.len(), *multiple), key, words)
            }
            (Self::Number(editor), _) => match key {
                Key::Char(c) if !matches!(c, '0'..='9' | '.' | ',' | '-' | '+' | 'e' | 'E') => {
                    Handled::No
                }
                Key::Up | Key::Down => Handled::No,
                key => editor.key(key),
            },
            (Self::Text(editor), _) => editor.key(key),
            _ => Handled::No,
        }
    }

    /// Handles a click on a number of a scale.
    pub fn set_number(&mut self, question: &Question, number: f64) {
        match (self, &question.kind) {
            (Self::Rating { chosen, typed }, QuestionKind::Rating { from, to, .. }) => {
                typed.clear();
                *chosen = Some((number.round() as i64).clamp(*from, *to));
            }
            (Self::Slider { value, typed }, QuestionKind::Slider { from, to, step, .. }) => {
                typed.clear();
                *value = Some(on_grid(number, *from, *to, *step));
            }
            _ => {}
        }
    }

    /// Handles a click on an option of a list.
    pub fn toggle(&mut self, question: &Question, at: usize) {
        if let (Self::Choice { cursor, marked }, QuestionKind::Choice { options, multiple }) =
            (self, &question.kind)
            && at < options.len()
        {
            *cursor = Some(at);
            mark(marked, at, *multiple);
        }
    }
}

/// Parses a number, in the digits of any keyboard; a comma is accepted as decimal separator.
pub fn parse(text: &str) -> Option<f64> {
    let text: String = text.trim().chars().map(ascii_number).collect();
    let number: f64 = text.replace(',', ".").parse().ok()?;
    number.is_finite().then_some(number)
}

/// What is missing, as a request.
fn ask_for(question: &Question, words: &Words) -> String {
    let phrase = match &question.kind {
        QuestionKind::Rating { from, to, .. } => {
            return words.fill(Phrase::NumberFirst, &[("from", from), ("to", to)]);
        }
        QuestionKind::Slider { .. } => Phrase::SliderFirst,
        QuestionKind::Choice { .. } => Phrase::OptionFirst,
        QuestionKind::Number { .. } => Phrase::TypeNumberFirst,
        QuestionKind::Text => Phrase::TypeAnswerFirst,
    };
    words.get(phrase).to_owned()
}

/// Why an answer is not accepted, as a request.
fn in_words(why: AnswerError, words: &Words) -> String {
    let both = |phrase, from: f64, to: f64| words.fill(phrase, &[("from", &from), ("to", &to)]);
    let words = match why {
        AnswerError::OffScale(from, to) => Some(both(Phrase::OffScale, from, to)),
        AnswerError::OutOfRange { min, max } => match (min, max) {
            (Some(min), Some(max)) => Some(both(Phrase::Range, min, max)),
            (Some(min), None) => Some(words.fill(Phrase::RangeFrom, &[("from", &min)])),
            (None, Some(max)) => Some(words.fill(Phrase::RangeTo, &[("to", &max)])),
            (None, None) => None,
        },
        AnswerError::NotAbove(above) => Some(words.fill(Phrase::RangeAbove, &[("above", &above)])),
        _ => None,
    };
    words.unwrap_or_else(|| sentence(&why.to_string()))
}

fn rating(
    chosen: &mut Option<i64>,
    typed: &mut String,
    (from, to): (i64, i64),
    key: Key,
    words: &Words,
) -> Handled {
    if let Key::Char(c @ ('0'..='9' | '-')) = key {
        for start in [format!("{typed}{c}"), c.to_string()] {
            let number = start.parse().ok().filter(|n| (from..=to).contains(n));
            let more = begins_another(&start, from, to);
            if number.is_some() || more {
                if number.is_some() {
                    *chosen = number;
                }
                *typed = start;
                return Handled::Yes;
            }
        }
        typed.clear();
        return Handled::Notice(words.fill(Phrase::OffScale, &[("from", &from), ("to", &to)]));
    }
    if key == Key::Backspace {
        typed.pop();
        *chosen = typed.parse().ok().filter(|n| (from..=to).contains(n));
        return Handled::Yes;
    }
    let big = (to.saturating_sub(from) / 10).max(1);
    let next = match key {
        Key::Left => chosen.map_or(to, |n| n.saturating_sub(1)),
        Key::Right => chosen.map_or(from, |n| n.saturating_add(1)),
        Key::PageDown => chosen.map_or(to, |n| n.saturating_sub(big)),
        Key::PageUp => chosen.map_or(from, |n| n.saturating_add(big)),
        Key::Home => from,
        Key::End => to,
        _ => return Handled::No,
    };
    typed.clear();
    *chosen = Some(next.clamp(from, to));
    Handled::Yes
}

/// Whether a longer number in the range starts with these digits.
fn begins_another(start: &str, from: i64, to: i64) -> bool {
    if start == "-" {
        return from < 0;
    }
    let Ok(n) = start.parse::<i64>() else {
        return false;
    };
    // Numbers with this prefix: [10 n, 10 n + 9], then [100 n, 100 n + 99], and so on.
    let (mut near, mut far) = (n, n);
    loop {
        let tens = (near.checked_mul(10), far.checked_mul(10));
        let (Some(tenfold), Some(last)) = tens else {
            return false;
        };
        let (low, high) = if n > 0 {
            (tenfold, last.saturating_add(9))
        } else {
            (last.saturating_sub(9), tenfold)
        };
        if n == 0 || (n > 0 && low > to) || (n < 0 && high < from) {
            return false;
        }
        if low <= to && high >= from {
            return true;
        }
        (near, far) = if n > 0 { (low, high) } else { (high, low) };
    }
}

fn slider(
    value: &mut Option<f64>,
    typed: &mut String,
    (from, to, step): (f64, f64, f64),
    key: Key,
    words: &Words,
) -> Handled {
    if let Key::Char(c @ ('0'..='9' | '.' | ',' | '-')) = key {
        for start in [format!("{typed}{c}"), c.to_string()] {
            let number = parse(&start).filter(|n| (from..=to).contains(n));
            if number.is_some() || matches!(start.as_str(), "-" | "." | "," | "-." | "-,") {
                if number.is_some() {
                    *value = number;
                }
                *typed = start;
                return Handled::Yes;
            }
        }
        typed.clear();
        return Handled::Notice(words.fill(Phrase::OffScale, &[("from", &from), ("to", &to)]));
    }
    if key == Key::Backspace {
        typed.pop();
        *value = parse(typed).filter(|n| (from..=to).contains(n));
        return Handled::Yes;
    }
    // The first key sets the marker to the middle, which favours neither end.
    let moved = |steps: f64| value.map_or((from + to) / 2.0, |v| v + steps * step);
    let next = match key {
        Key::Left => moved(-1.0),
        Key::Right => moved(1.0),
        Key::PageDown => moved(-10.0),
        Key::PageUp => moved(10.0),
        Key::Home => from,
        Key::End => to,
        _ => return Handled::No,
    };
    typed.clear();
    *value = Some(on_grid(next, from, to, step));
    Handled::Yes
}

/// The value rounded to whole steps from the left end, clamped to the scale, with no
/// more decimals than the scale has.
fn on_grid(value: f64, from: f64, to: f64, step: f64) -> f64 {
    let steps = ((value - from) / step).round();
    if !steps.is_finite() {
        return from;
    }
    let decimals = [from, step].map(|n| {
        let text = n.to_string();
        text.split_once('.').map_or(0, |(_, d)| d.len())
    });
    let decimals = decimals[0].max(decimals[1]).min(15);
    let exact = from + steps * step;
    let rounded = format!("{exact:.decimals$}").parse().unwrap_or(exact);
    rounded.clamp(from, to)
}

fn choice(
    cursor: &mut Option<usize>,
    marked: &mut BTreeSet<usize>,
    (count, multiple): (usize, bool),
    key: Key,
    words: &Words,
) -> Handled {
    let last = count.saturating_sub(1);
    let at = match key {
        Key::Up => cursor.map_or(last, |c| c.saturating_sub(1)),
        Key::Down => cursor.map_or(0, |c| (c + 1).min(last)),
        Key::PageUp => cursor.map_or(0, |c| c.saturating_sub(8)),
        Key::PageDown => cursor.map_or(0, |c| (c + 8).min(last)),
        Key::Home => 0,
        Key::End => last,
        Key::Char(' ' | 'x') => {
            let Some(at) = *cursor else {
                return Handled::Notice(words.get(Phrase::SelectFirst).to_owned());
            };
            mark(marked, at, multiple);
            return Handled::Yes;
        }
        Key::Char(c @ '1'..='9') => {
            let at = c as usize - '1' as usize;
            if at >= count {
                return Handled::Notice(words.fill(Phrase::ListHas, &[("total", &count)]));
            }
            *cursor = Some(at);
            mark(marked, at, multiple);
            return Handled::Yes;
        }
        _ => return Handled::No,
    };
    if count == 0 {
        return Handled::No;
    }
    *cursor = Some(at);
    if !multiple {
        mark(marked, at, false);
    }
    Handled::Yes
}

fn mark(marked: &mut BTreeSet<usize>, at: usize, multiple: bool) {
    if multiple {
        if !marked.remove(&at) {
            marked.insert(at);
        }
    } else {
        marked.clear();
        marked.insert(at);
    }
}

#[cfg(test)]
mod tests;
