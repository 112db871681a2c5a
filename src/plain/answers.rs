//! Questions in words, and typed lines as answers.

use crate::tui::ui_state::field;
use study_base::text::{Untrusted, ascii_number};
use study_core::protocol::phrases::{Phrase, Words};
use study_core::protocol::question::cut_to_fit;
use study_core::protocol::{Answer, Question, QuestionKind};

/// The lines that ask a question, and the last of them, which says what to type.
pub fn ask(question: &Question, words: &Words) -> (Vec<String>, String) {
    let mut lines = text(&question.prompt);
    let what = match &question.kind {
        QuestionKind::Rating { from, to, labels } => {
            lines.extend(labels.iter().map(|(n, label)| labelled(n, label, words)));
            words.fill(Phrase::PlainRange, &[("from", from), ("to", to)])
        }
        QuestionKind::Slider {
            from, to, labels, ..
        } => {
            lines.extend(labels.iter().map(|(n, label)| labelled(n, label, words)));
            words.fill(Phrase::PlainRange, &[("from", from), ("to", to)])
        }
        QuestionKind::Choice { options, multiple } => {
            let options = options.iter().enumerate();
            lines.extend(options.map(|(i, option)| format!("{}: {}", i + 1, Untrusted(option))));
            let phrase = match multiple {
                true => Phrase::PlainOptions,
                false => Phrase::PlainOption,
            };
            words.get(phrase).to_owned()
        }
        QuestionKind::Number {
            unit,
            min,
            max,
            above,
        } => {
            lines.extend(unit.as_ref().map(|unit| Untrusted(unit).to_string()));
            match (min, max) {
                _ if above.is_some() => {
                    let above = above.unwrap_or_default();
                    words.fill(Phrase::RangeAbove, &[("above", &above)])
                }
                (Some(min), Some(max)) => {
                    words.fill(Phrase::PlainRange, &[("from", min), ("to", max)])
                }
                (Some(min), None) => words.fill(Phrase::RangeFrom, &[("from", min)]),
                (None, Some(max)) => words.fill(Phrase::RangeTo, &[("to", max)]),
                (None, None) => words.get(Phrase::PlainNumber).to_owned(),
            }
        }
        QuestionKind::Text => words.get(Phrase::PlainText).to_owned(),
    };
    let what = match question.required {
        true => what,
        false => format!("{what} {}", words.get(Phrase::PlainOptional)),
    };
    (lines, what)
}

/// Text of a protocol, line by line.
pub fn text(text: &str) -> Vec<String> {
    let lines = text.trim_end().lines();
    lines.map(|line| Untrusted(line).to_string()).collect()
}

fn labelled(value: &dyn std::fmt::Display, label: &str, words: &Words) -> String {
    words.fill(
        Phrase::PlainLabel,
        &[("value", value), ("label", &Untrusted(label))],
    )
}

/// An answer in words.
pub fn in_words(answer: &Answer, words: &Words) -> String {
    match answer {
        Answer::Declined { .. } => words.get(Phrase::Declined).to_owned(),
        answer => match answer.cell() {
            empty if empty.trim().is_empty() => words.get(Phrase::Empty).to_owned(),
            cell => Untrusted(&cell).to_string(),
        },
    }
}

/// A typed line as the answer to a question; `None` if it is left empty.
///
/// # Errors
/// What to type instead.
pub fn read(question: &Question, line: &str, words: &Words) -> Result<Option<Answer>, String> {
    let number: String = line.trim().chars().map(ascii_number).collect();
    let typed = number.as_str();
    if typed.is_empty() {
        return match question.required {
            true => Err(format!(
                "{} {}",
                words.get(Phrase::PlainNeeded),
                ask(question, words).1
            )),
            false => Ok(None),
        };
    }
    let instead = || {
        format!(
            "{} {}",
            words.get(Phrase::PlainNoAnswer),
            ask(question, words).1
        )
    };
    let answer = match &question.kind {
        QuestionKind::Rating { .. } => Answer::Rating(typed.parse().map_err(|_| instead())?),
        QuestionKind::Slider { .. } | QuestionKind::Number { .. } => {
            Answer::Number(field::parse(typed).ok_or_else(instead)?)
        }
        QuestionKind::Choice { options, .. } => {
            Answer::Choice(chosen(typed, options).ok_or_else(instead)?)
        }
        QuestionKind::Text => Answer::Text(cut_to_fit(line).0.to_owned()),
    };
    match question.accepts(&answer) {
        Ok(()) => Ok(Some(answer)),
        Err(_) => Err(instead()),
    }
}

/// The options with the typed numbers, in the order of the list.
fn chosen(typed: &str, options: &[String]) -> Option<Vec<String>> {
    let numbers = typed
        .split(|c: char| c.is_whitespace() || ",;".contains(c))
        .filter(|n| !n.is_empty());
    let mut numbers: Vec<usize> = numbers.map(str::parse).collect::<Result<_, _>>().ok()?;
    numbers.sort_unstable();
    numbers.dedup();
    let option = |n: usize| options.get(n.checked_sub(1)?).cloned();
    numbers.into_iter().map(option).collect()
}
