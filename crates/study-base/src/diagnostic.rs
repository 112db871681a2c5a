//! Faults with spans and hints, for every file we read.
//!
//! A reader of a file never stops at the first fault: it collects [`Fault`]s and
//! goes on. [`Findings`] are the faults of one file, rendered the way rustc does:
//! what, where (file, line, column, caret), what to do next. [`table`] walks a
//! TOML document by hand, because serde stops at the first error.
//!
//! Text from the file appears in messages only through [`crate::text::Untrusted`].

pub mod table;

use crate::text::Untrusted;
use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet, renderer::DecorStyle};
use std::fmt::Write as _;
use std::ops::Range;

/// How bad a fault is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The file cannot be used.
    Error,
    /// It can, but somebody should look.
    Warning,
}

/// One thing that is wrong with a file, or doubtful.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Error or warning.
    pub severity: Severity,
    /// What is wrong, in one short sentence without a full stop.
    pub message: String,
    /// Bytes of the file that it is about; `None`: the file as a whole.
    pub span: Option<Range<usize>>,
    /// What stands beside the caret, such as "did you mean `repetitions`?".
    pub label: Option<String>,
    /// What to do next, where the label does not say it.
    pub hint: Option<String>,
}

impl Fault {
    /// An error without a place yet.
    pub fn error(message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            message: message.into(),
            span: None,
            label: None,
            hint: None,
        }
    }

    /// A warning without a place yet.
    pub fn warning(message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::error(message)
        }
    }

    /// The same, at these bytes of the file (`None` leaves the whole file).
    #[must_use]
    pub fn at(mut self, span: impl Into<Option<Range<usize>>>) -> Self {
        self.span = span.into();
        self
    }

    /// The same, with words beside the caret.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// The same, with advice.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// The faults of one file, with its text to point into.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Findings {
    /// The path as the user gave it, for the message.
    pub path: String,
    /// The text of the file; empty if it could not be read.
    pub text: String,
    /// In the order of their place in the file.
    pub faults: Vec<Fault>,
}

impl Findings {
    /// No faults yet.
    pub fn new(path: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            path: path.into(),
            text: text.into(),
            faults: Vec::new(),
        }
    }

    /// Whether any fault is an error.
    pub fn has_errors(&self) -> bool {
        self.count(Severity::Error) > 0
    }

    /// How many faults are of this severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.faults
            .iter()
            .filter(|f| f.severity == severity)
            .count()
    }

    /// Those of one severity.
    #[must_use]
    pub fn only(&self, severity: Severity) -> Self {
        let faults = self.faults.iter().filter(|f| f.severity == severity);
        Self {
            path: self.path.clone(),
            text: self.text.clone(),
            faults: faults.cloned().collect(),
        }
    }

    /// Sorts the faults by their place, those about the whole file first.
    pub fn sort(&mut self) {
        self.faults
            .sort_by_key(|f| f.span.as_ref().map_or(0, |s| s.start + 1));
    }

    /// Line and column (both from 1, columns in characters) of a byte.
    pub fn line_and_column(&self, byte: usize) -> (usize, usize) {
        let before = &self.text[..floor_char_boundary(&self.text, byte)];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        (line, column)
    }

    /// All faults as text for a terminal; `colour` adds ANSI styles.
    pub fn render(&self, colour: bool) -> String {
        let renderer = if colour {
            Renderer::styled()
        } else {
            Renderer::plain()
        }
        .decor_style(DecorStyle::Unicode);
        let shown = printable(&self.text);
        let path = Untrusted(&self.path).to_string();
        let mut out = String::new();
        for fault in &self.faults {
            let level = match fault.severity {
                Severity::Error => Level::ERROR,
                Severity::Warning => Level::WARNING,
            };
            let message = Untrusted(&fault.message).to_string();
            let label = fault.label.as_deref().map(|l| Untrusted(l).to_string());
            let hint = fault.hint.as_deref().map(|h| Untrusted(h).to_string());
            let group = level.primary_title(message);
            let place = fault.span.clone().filter(|_| !shown.is_empty());
            let mut report = match place {
                Some(span) => {
                    let start = floor_char_boundary(&shown, span.start);
                    let end = floor_char_boundary(&shown, span.end).max(start);
                    let mut mark = AnnotationKind::Primary.span(start..end);
                    if let Some(label) = label {
                        mark = mark.label(label);
                    }
                    group.element(
                        Snippet::source(shown.as_str())
                            .path(path.as_str())
                            .annotation(mark),
                    )
                }
                None => group.element(annotate_snippets::Origin::path(path.as_str())),
            };
            if let Some(hint) = hint {
                report = report.element(Level::HELP.message(hint));
            }
            let _ = writeln!(out, "{}", renderer.render(&[report]));
        }
        out
    }
}

/// The text with whatever could steer a terminal replaced by as many `?` as it
/// has bytes, so that spans still fit.
fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if c != '\n' && c != '\t' && crate::text::is_unsafe(c) {
            shown.extend(std::iter::repeat_n('?', c.len_utf8()));
        } else {
            shown.push(c);
        }
    }
    shown
}

fn floor_char_boundary(text: &str, byte: usize) -> usize {
    let mut at = byte.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// The candidate that a mistyped word most likely meant, if one is near enough.
pub fn did_you_mean<'a>(
    given: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    candidates
        .into_iter()
        .map(|c| (strsim::damerau_levenshtein(given, c), c))
        .filter(|(distance, c)| *distance <= 1 + given.len().max(c.len()) / 4)
        .min()
        .map(|(_, c)| c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_shows_the_line_the_caret_and_the_way_out() {
        let mut findings = Findings::new("protocol.toml", "[design]\nrepetition = 3\n");
        findings.faults.push(
            Fault::error("unknown key `repetition` in [design]")
                .at(9..19)
                .label("did you mean `repetitions`?"),
        );
        let text = findings.render(false);
        assert!(
            text.contains("error: unknown key `repetition` in [design]"),
            "{text}"
        );
        assert!(text.contains("protocol.toml:2:1"), "{text}");
        assert!(text.contains("did you mean `repetitions`?"), "{text}");
        assert_eq!(findings.line_and_column(9), (2, 1));
    }

    #[test]
    fn escape_sequences_of_the_file_do_not_reach_the_terminal() {
        let mut findings = Findings::new("a\u{1b}b", "x = \"\u{1b}[2J\u{9b}\"\n");
        findings.faults.push(Fault::error("bad \u{1b}").at(4..8));
        assert!(!findings.render(false).contains(['\u{1b}', '\u{9b}']));
    }

    #[test]
    fn a_near_miss_is_recognised_and_a_stranger_is_not() {
        let keys = ["repetitions", "participants", "order"];
        assert_eq!(did_you_mean("repetition", keys), Some("repetitions"));
        assert_eq!(did_you_mean("oder", keys), Some("order"));
        assert_eq!(did_you_mean("colour", keys), None);
    }
}
