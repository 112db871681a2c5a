//! The field of one question. No answer is preset: what was not chosen is not sent.

use crate::tui::editor::{Editor, Handled};
use crate::tui::keys::Key;
use study_base::text::ascii_number;
use study_plan::protocol::answer::number;
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{Answer, Control, Given, Pick, Question, Refusal};

/// The answer to one question, as entered so far: one for each [`Control`].
#[derive(Debug, Clone, PartialEq)]
pub enum Field {
    /// Boxes with whole numbers.
    Boxes {
        /// The chosen number.
        chosen: Option<i64>,
        /// Digits typed so far.
        typed: String,
    },
    /// A line with a marker.
    Track {
        /// The value at the marker.
        value: Option<f64>,
        /// Digits typed so far.
        typed: String,
    },
    /// A list of options.
    List {
        /// Index of the option that the keys act on; it is not chosen thereby.
        cursor: Option<usize>,
        /// Indices of the chosen options, in the order in which they were chosen.
        marked: Vec<usize>,
    },
    /// A typed number.
    Digits(Editor),
    /// A typed text.
    Text(Editor),
}

impl Field {
    /// An empty field for a question.
    pub fn new(question: &Question) -> Self {
        Self::with(question, None)
    }

    /// A field that holds the answer that was given before.
    pub fn with(question: &Question, given: Option<&Answer>) -> Self {
        let control = question.kind.control();
        let given = given.and_then(|answer| control.given(answer));
        let (text, marked) = match given {
            Some(Given::Typed(text)) => (text, Vec::new()),
            Some(Given::Chosen(marked)) => (String::new(), marked),
            None => Default::default(),
        };
        match control {
            Control::Boxes { .. } => Self::Boxes {
                chosen: text.parse().ok(),
                typed: String::new(),
            },
            Control::Track { .. } => Self::Track {
                value: text.parse().ok(),
                typed: String::new(),
            },
            Control::List { .. } => Self::List {
                cursor: marked.first().copied(),
                marked,
            },
            Control::Digits { .. } => Self::Digits(Editor::line(&text)),
            Control::Text => Self::Text(Editor::new(&text)),
        }
    }

    /// A field for the correction of `old`: a text field starts with it, others are empty.
    pub fn correcting(question: &Question, old: &Answer) -> Self {
        let is_text = question.kind.control() == Control::Text;
        Self::with(question, Some(old).filter(|_| is_text))
    }

    /// Whether a character, including Space, is text in this field.
    pub fn is_text(&self) -> bool {
        matches!(self, Self::Text(_))
    }

    /// Its text editor, if it has one.
    pub fn editor(&mut self) -> Option<&mut Editor> {
        match self {
            Self::Digits(editor) | Self::Text(editor) => Some(editor),
            _ => None,
        }
    }

    /// What is entered so far.
    fn given(&self) -> Option<Given> {
        Some(match self {
            Self::Boxes { chosen, .. } => Given::Typed((*chosen)?.to_string()),
            Self::Track { value, .. } => Given::Typed((*value)?.to_string()),
            Self::List { marked, .. } => Given::Chosen(marked.clone()),
            Self::Digits(editor) | Self::Text(editor) => Given::Typed(editor.text().to_owned()),
        })
    }

    /// The answer entered so far; `None` if there is none.
    ///
    /// # Errors
    /// [`Refusal`] if the entry is not a valid answer.
    pub fn answer(&self, question: &Question) -> Result<Option<Answer>, Refusal> {
        question.read(self.given().as_ref())
    }

    /// Handles a key.
    pub fn key(&mut self, question: &Question, key: Key, words: &Words) -> Handled {
        let on_scale = matches!(self, Self::Boxes { .. } | Self::Track { .. });
        let key = match key {
            Key::Left if on_scale && words.scales_from_right() => Key::Right,
            Key::Right if on_scale && words.scales_from_right() => Key::Left,
            Key::Char(c) if !matches!(self, Self::Text(_)) => Key::Char(ascii_number(c)),
            key => key,
        };
        match (self, question.kind.control()) {
            (Self::Boxes { chosen, typed }, Control::Boxes { from, to, .. }) => {
                rating(chosen, typed, (from, to), key, words)
            }
            (Self::Track { value, typed }, Control::Track { from, to, step, .. }) => {
                slider(value, typed, (from, to, step), key, words)
            }
            (Self::List { cursor, marked }, Control::List { options, pick }) => {
                list(cursor, marked, (options.len(), pick), key, words)
            }
            (Self::Digits(editor), _) => match key {
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
        match (self, question.kind.control()) {
            (Self::Boxes { chosen, typed }, Control::Boxes { from, to, .. }) => {
                typed.clear();
                *chosen = Some((number.round() as i64).clamp(from, to));
            }
            (Self::Track { value, typed }, Control::Track { from, to, step, .. }) => {
                typed.clear();
                *value = Some(on_grid(number, from, to, step));
            }
            _ => {}
        }
    }

    /// Handles a click on an option of a list.
    pub fn toggle(&mut self, question: &Question, at: usize) {
        if let (Self::List { cursor, marked }, Control::List { options, pick }) =
            (self, question.kind.control())
            && at < options.len()
        {
            *cursor = Some(at);
            mark(marked, at, pick);
        }
    }
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
        return Handled::Notice(Refusal::OffScale(from as f64, to as f64).words(words));
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
            let found = number(&start).filter(|n| (from..=to).contains(n));
            if found.is_some() || matches!(start.as_str(), "-" | "." | "," | "-." | "-,") {
                if found.is_some() {
                    *value = found;
                }
                *typed = start;
                return Handled::Yes;
            }
        }
        typed.clear();
        return Handled::Notice(Refusal::OffScale(from, to).words(words));
    }
    if key == Key::Backspace {
        typed.pop();
        *value = number(typed).filter(|n| (from..=to).contains(n));
        return Handled::Yes;
    }
    // The first key sets the marker to the middle, which favors neither end.
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

fn list(
    cursor: &mut Option<usize>,
    marked: &mut Vec<usize>,
    (count, pick): (usize, Pick),
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
            mark(marked, at, pick);
            return Handled::Yes;
        }
        Key::Char(c) => {
            let at = (0..count).find(|at| key_of(*at) == Some(c.to_ascii_lowercase()));
            let Some(at) = at else {
                return match c {
                    '1'..='9' => Handled::Notice(Refusal::NotListed(count).words(words)),
                    _ => Handled::No,
                };
            };
            *cursor = Some(at);
            mark(marked, at, pick);
            return Handled::Yes;
        }
        _ => return Handled::No,
    };
    if count == 0 {
        return Handled::No;
    }
    *cursor = Some(at);
    if pick == Pick::One {
        mark(marked, at, pick);
    }
    Handled::Yes
}

/// The key of an option of a list, by its place from 0: digits, then the letters that do nothing else
/// there.
pub fn key_of(at: usize) -> Option<char> {
    let letters = ('a'..='z').filter(|c| *c != 'x');
    ('1'..='9').chain(letters).nth(at)
}

/// Chooses an option, or takes it back where several can be chosen.
fn mark(marked: &mut Vec<usize>, at: usize, pick: Pick) {
    match marked.iter().position(|m| *m == at) {
        Some(place) if pick != Pick::One => drop(marked.remove(place)),
        _ if pick == Pick::One => *marked = vec![at],
        _ => marked.push(at),
    }
}

#[cfg(test)]
mod tests;
