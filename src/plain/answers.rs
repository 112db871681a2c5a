//! Questions and answers in words.

use std::fmt::Display;
use study_base::text::Untrusted;
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{Answer, Control, Pick, Question};

/// The lines that ask a question, and the last of them, which says what to type.
pub fn ask(question: &Question, words: &Words) -> (Vec<String>, String) {
    let mut lines = text(&question.prompt);
    let range = |from: &dyn Display, to: &dyn Display| {
        words.fill(Phrase::PlainRange, &[("from", from), ("to", to)])
    };
    let what = match question.kind.control() {
        Control::Boxes { from, to, labels } => {
            lines.extend(labels.iter().map(|(n, label)| labeled(n, label, words)));
            range(&from, &to)
        }
        Control::Track {
            from, to, labels, ..
        } => {
            lines.extend(labels.iter().map(|(n, label)| labeled(n, label, words)));
            range(&from, &to)
        }
        Control::List { options, pick } => {
            let options = options.iter().enumerate();
            lines.extend(options.map(|(i, option)| format!("{}: {}", i + 1, Untrusted(option))));
            let phrase = match pick {
                Pick::Many => Phrase::PlainOptions,
                Pick::One => Phrase::PlainOption,
            };
            words.get(phrase).to_owned()
        }
        Control::Digits {
            unit,
            min,
            max,
            above,
        } => {
            lines.extend(unit.map(|unit| Untrusted(unit).to_string()));
            match (min, max, above) {
                (.., Some(above)) => words.fill(Phrase::RangeAbove, &[("above", &above)]),
                (Some(min), Some(max), _) => range(&min, &max),
                (Some(min), None, _) => words.fill(Phrase::RangeFrom, &[("from", &min)]),
                (None, Some(max), _) => words.fill(Phrase::RangeTo, &[("to", &max)]),
                (None, None, _) => words.get(Phrase::PlainNumber).to_owned(),
            }
        }
        Control::Text => words.get(Phrase::PlainText).to_owned(),
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

fn labeled(value: &dyn Display, label: &str, words: &Words) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_stands_after_its_number() {
        let words = Words::default();
        assert_eq!(labeled(&7, "very real", &words), "7 means: very real");
    }
}
