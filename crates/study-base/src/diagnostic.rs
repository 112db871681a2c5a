//! Faults of a file, with spans and hints.
//!
//! A reader of a file does not stop at the first fault; it collects [`Fault`]s.
//! [`Findings`] are the faults of one file, rendered as rustc does: what, where
//! (file, line, column, caret), what to do. [`table`] reads TOML, because serde
//! stops at the first error.
//!
//! Text from the file is printed through [`crate::text::Untrusted`] only.

pub mod table;

use crate::text::Untrusted;
use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet, renderer::DecorStyle};
use std::fmt::Write as _;
use std::ops::Range;

/// The severity of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The file cannot be used.
    Error,
    /// The file can be used, but something in it is doubtful.
    Warning,
}

/// An error or doubt in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Error or warning.
    pub severity: Severity,
    /// What is wrong, in a short sentence without a full stop.
    pub message: String,
    /// The bytes of the file that it concerns; `None`: the whole file.
    pub span: Option<Range<usize>>,
    /// The text beside the caret, such as "did you mean `repetitions`?".
    pub label: Option<String>,
    /// What to do, if the label does not say it.
    pub hint: Option<String>,
}

impl Fault {
    /// An error about the whole file.
    pub fn error(message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            message: message.into(),
            span: None,
            label: None,
            hint: None,
        }
    }

    /// A warning about the whole file.
    pub fn warning(message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::error(message)
        }
    }

    /// The same fault, at these bytes of the file; `None` is the whole file.
    #[must_use]
    pub fn at(mut self, span: impl Into<Option<Range<usize>>>) -> Self {
        self.span = span.into();
        self
    }

    /// The same fault, with a label beside the caret.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// The same fault, with a hint.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// The faults of a file, with its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Findings {
    /// The path, as the user gave it.
    pub path: String,
    /// The text of the file; empty if it could not be read.
    pub text: String,
    /// The faults; [`Findings::sort`] orders them by place.
    pub faults: Vec<Fault>,
}

impl Findings {
    /// Without faults.
    pub fn new(path: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            path: path.into(),
            text: text.into(),
            faults: Vec::new(),
        }
    }

    /// A single fault of a file whose text is not shown.
    pub fn alone(path: impl Into<String>, fault: Fault) -> Self {
        Self {
            faults: vec![fault],
            ..Self::new(path, "")
        }
    }

    /// Whether any fault is an error.
    pub fn has_errors(&self) -> bool {
        self.count(Severity::Error) > 0
    }

    /// Number of faults of a severity.
    pub fn count(&self, severity: Severity) -> usize {
        let faults = self.faults.iter();
        faults.filter(|f| f.severity == severity).count()
    }

    /// The faults of one severity.
    #[must_use]
    pub fn only(&self, severity: Severity) -> Self {
        let faults = self.faults.iter().filter(|f| f.severity == severity);
        Self {
            path: self.path.clone(),
            text: self.text.clone(),
            faults: faults.cloned().collect(),
        }
    }

    /// Sorts the faults by place, those about the whole file first.
    pub fn sort(&mut self) {
        self.faults
            .sort_by_key(|f| f.span.as_ref().map_or(0, |s| s.start + 1));
    }

    /// Line and column of a byte, both from 1; columns are characters.
    pub fn line_and_column(&self, byte: usize) -> (usize, usize) {
        let before = &self.text[..floor_char_boundary(&self.text, byte)];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        (line, column)
    }

    /// All faults as text for a terminal, with ANSI styles if `color`.
    ///
    /// ```
    /// # use study_base::diagnostic::{Fault, Findings};
    /// let mut findings = Findings::new("protocol.toml", "[design]\nseed = -1\n");
    /// findings.faults.push(Fault::error("the seed is negative").at(16..18));
    /// assert_eq!(findings.line_and_column(16), (2, 8));
    /// assert!(findings.render(false).contains("error: the seed is negative"));
    /// ```
    pub fn render(&self, color: bool) -> String {
        let renderer = if color {
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

/// The text with each unsafe character replaced by as many `?` as it has bytes, so that
/// spans stay valid.
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

/// The candidate nearest to a misspelt word, if one is near enough.
///
/// ```
/// # use study_base::diagnostic::did_you_mean;
/// let keys = ["repetitions", "seed"];
/// assert_eq!(did_you_mean("repetition", keys), Some("repetitions"));
/// assert_eq!(did_you_mean("width", keys), None);
/// ```
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
    fn a_fault_shows_line_caret_and_suggestion() {
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
    fn only_near_words_are_suggested() {
        let keys = ["repetitions", "participants", "order"];
        assert_eq!(did_you_mean("repetition", keys), Some("repetitions"));
        assert_eq!(did_you_mean("oder", keys), Some("order"));
        assert_eq!(did_you_mean("paint", keys), None);
    }
}
