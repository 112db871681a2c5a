//! Questions in words, and typed lines as answers.

use crate::tui::ui_state::field;
use study_base::text::Untrusted;
use study_core::protocol::question::cut_to_fit;
use study_core::protocol::{Answer, Question, QuestionKind};

/// The lines that ask a question, and the last of them, which says what to type.
pub fn ask(question: &Question) -> (Vec<String>, String) {
    let mut lines = text(&question.prompt);
    let what = match &question.kind {
        QuestionKind::Rating { from, to, labels } => {
            lines.extend(labels.iter().map(|(n, label)| labelled(n, label)));
            format!("Type a number from {from} to {to}, then press Enter.")
        }
        QuestionKind::Slider {
            from, to, labels, ..
        } => {
            lines.extend(labels.iter().map(|(n, label)| labelled(n, label)));
            format!("Type a number from {from} to {to}, then press Enter.")
        }
        QuestionKind::Choice { options, multiple } => {
            let options = options.iter().enumerate();
            lines.extend(options.map(|(i, option)| format!("{}: {}", i + 1, Untrusted(option))));
            match multiple {
                true => "Type the numbers of all that apply, such as 1 2, then press Enter.",
                false => "Type the number of one of them, then press Enter.",
            }
            .to_owned()
        }
        QuestionKind::Number { unit, min, max } => {
            let unit = unit.as_ref().map(|u| format!(", in {}", Untrusted(u)));
            let range = match (min, max) {
                (Some(min), Some(max)) => format!(" from {min} to {max}"),
                (Some(min), None) => format!(" from {min} up"),
                (None, Some(max)) => format!(" up to {max}"),
                (None, None) => String::new(),
            };
            let unit = unit.unwrap_or_default();
            format!("Type a number{range}{unit}, then press Enter.")
        }
        QuestionKind::Text => "Type your answer, then press Enter.".to_owned(),
    };
    let what = match question.required {
        true => what,
        false => format!("{what} Enter alone leaves it empty."),
    };
    (lines, what)
}

/// Text of a protocol, line by line.
pub fn text(text: &str) -> Vec<String> {
    let lines = text.trim_end().lines();
    lines.map(|line| Untrusted(line).to_string()).collect()
}

fn labelled(value: &impl std::fmt::Display, label: &str) -> String {
    format!("{value} means: {}", Untrusted(label))
}

/// An answer in words.
pub fn in_words(answer: &Answer) -> String {
    match answer {
        Answer::Declined { .. } => "declined".to_owned(),
        answer => match answer.cell() {
            empty if empty.trim().is_empty() => "empty".to_owned(),
            cell => Untrusted(&cell).to_string(),
        },
    }
}

/// A typed line as the answer to a question; `None` if it is left empty.
///
/// # Errors
/// What to type instead.
pub fn read(question: &Question, line: &str) -> Result<Option<Answer>, String> {
    let typed = line.trim();
    if typed.is_empty() {
        return match question.required {
            true => Err(format!("An answer is needed. {}", ask(question).1)),
            false => Ok(None),
        };
    }
    let instead = || format!("That is not an answer here. {}", ask(question).1);
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
    let numbers = typed.split([' ', ',', ';']).filter(|n| !n.is_empty());
    let mut numbers: Vec<usize> = numbers.map(str::parse).collect::<Result<_, _>>().ok()?;
    numbers.sort_unstable();
    numbers.dedup();
    let option = |n: usize| options.get(n.checked_sub(1)?).cloned();
    numbers.into_iter().map(option).collect()
}
