//! Text of any language laid out in terminal cells.
//!
//! Lines are ranges of the source text, so that prompts and editors share one
//! way of breaking. What is shown is safe: characters that control the terminal or
//! hide the order of the text are escaped by [`Untrusted`]. Right-to-left text is drawn
//! in its stored order; reordering is left to the terminal.

use std::borrow::Cow;
use std::ops::Range;
use study_base::text::{Untrusted, cut_end, is_unsafe};
use unicode_segmentation::UnicodeSegmentation as _;
use unicode_width::UnicodeWidthStr as _;

/// One line of laid-out text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// Byte range in the source, without the line break.
    pub range: Range<usize>,
    /// The text as drawn.
    pub shown: String,
}

/// Width of a string in cells, summed over its graphemes, as a terminal buffer counts.
pub fn width(text: &str) -> usize {
    text.graphemes(true).map(|g| g.width()).sum()
}

/// A grapheme as it is drawn: never of zero width, never a control sequence.
pub fn shown(grapheme: &str) -> Cow<'_, str> {
    if grapheme == "\t" {
        return Cow::Borrowed("    ");
    }
    if grapheme.contains(is_unsafe) {
        return Cow::Owned(Untrusted(grapheme).to_string());
    }
    if grapheme.width() > 0 {
        return Cow::Borrowed(grapheme);
    }
    // A combining mark without a letter is drawn on a circle; what is still
    // invisible is spelled out.
    let circled = format!("◌{grapheme}");
    if width(&circled) > 0 && grapheme.chars().all(is_mark) {
        Cow::Owned(circled)
    } else {
        let spelled = grapheme.chars().map(|c| c.escape_unicode().to_string());
        Cow::Owned(spelled.collect())
    }
}

fn is_mark(c: char) -> bool {
    matches!(c, '\u{300}'..='\u{36f}' | '\u{483}'..='\u{489}' | '\u{591}'..='\u{5bd}'
        | '\u{610}'..='\u{61a}' | '\u{64b}'..='\u{65f}' | '\u{900}'..='\u{903}'
        | '\u{93a}'..='\u{94f}' | '\u{e31}'..='\u{e3a}' | '\u{e47}'..='\u{e4e}'
        | '\u{1ab0}'..='\u{1aff}' | '\u{1dc0}'..='\u{1dff}' | '\u{20d0}'..='\u{20ff}'
        | '\u{3099}'..='\u{309a}' | '\u{fe20}'..='\u{fe2f}')
}

/// Breaks `text` into lines of at most `columns` cells, at spaces and between
/// wide characters where it can. At least one line; none wider than `columns`
/// unless a single character is.
pub fn wrap(text: &str, columns: usize) -> Vec<Line> {
    let columns = columns.max(1);
    let mut lines = Vec::new();
    let mut line = Open::at(0);
    for (at, grapheme) in text.grapheme_indices(true) {
        let end = at + grapheme.len();
        if matches!(grapheme, "\n" | "\r\n" | "\r") {
            lines.push(line.close(at));
            line = Open::at(end);
            continue;
        }
        let cell = shown(grapheme);
        let cells = width(&cell);
        let space = grapheme.chars().all(char::is_whitespace);
        let wide = cells > 1 && width(grapheme) == cells;
        let parts = (wide || line.wide) && !line.opens && !begins_no_line(grapheme);
        if parts && !space && line.cells > 0 {
            line.break_after = Some((at, line.shown.len(), line.cells));
        }
        if line.cells + cells > columns && line.cells > 0 {
            if space {
                // Spaces at the edge belong to the line they end.
                line.hangs = true;
                line.break_after = Some((end, line.shown.len(), line.cells));
                continue;
            }
            while line.cells + cells > columns && line.cells > 0 {
                let (cut, next) = line.split(at);
                lines.push(cut);
                line = next;
            }
        } else if line.hangs {
            let (cut, next) = line.split(at);
            lines.push(cut);
            line = next;
        }
        line.shown.push_str(&cell);
        line.cells += cells;
        line.wide = wide;
        line.opens = ends_no_line(grapheme);
        if space || matches!(grapheme, "-" | "–" | "—" | "/") {
            line.break_after = Some((end, line.shown.len(), line.cells));
        }
    }
    lines.push(line.close(text.len()));
    lines
}

/// Whether no line of Japanese or Chinese text begins with a character: closing
/// punctuation and marks of repetition (`line-break: normal` of CSS).
fn begins_no_line(grapheme: &str) -> bool {
    const NOT_FIRST: &str = "、。，．・：；？！!?,.:;)]}）］｝〕〉》」』】’”…‥〜～々ゝゞヽヾ％℃";
    grapheme
        .chars()
        .next()
        .is_some_and(|c| NOT_FIRST.contains(c))
}

/// Whether no line ends with a character: opening brackets.
fn ends_no_line(grapheme: &str) -> bool {
    const NOT_LAST: &str = "([{（［｛〔〈《「『【‘“￥";
    grapheme
        .chars()
        .next()
        .is_some_and(|c| NOT_LAST.contains(c))
}

/// A line that is being filled.
struct Open {
    start: usize,
    shown: String,
    cells: usize,
    hangs: bool,
    /// Whether its last character is wide.
    wide: bool,
    /// Whether no line ends with its last character.
    opens: bool,
    /// Source byte, shown byte and cell after which it may be broken.
    break_after: Option<(usize, usize, usize)>,
}

impl Open {
    fn at(start: usize) -> Self {
        Self {
            start,
            shown: String::new(),
            cells: 0,
            hangs: false,
            wide: false,
            opens: false,
            break_after: None,
        }
    }

    fn close(self, end: usize) -> Line {
        Line {
            range: self.start..end,
            shown: self.shown,
        }
    }

    /// Ends the line where it may be broken, or at `at`, and opens the next.
    fn split(mut self, at: usize) -> (Line, Self) {
        let Some((source, shown, cells)) = self.break_after else {
            return (self.close(at), Self::at(at));
        };
        let rest = self.shown.split_off(shown);
        let mut next = Self::at(source);
        next.cells = self.cells - cells;
        next.shown = rest;
        (self.close(source), next)
    }
}

/// Source lines of at least this width were broken to fit a file, not for the reader.
const FULL: usize = 60;

/// A text of the author's as paragraphs: a line break after a full line flows on, every
/// other one is kept, and so are blank lines and lines that start with a list mark or a
/// space. Between wide characters, which part words without spaces, nothing is put.
pub fn flow(text: &str) -> String {
    let mut out: Vec<String> = Vec::new();
    let mut full = false;
    for line in text.trim_end().lines() {
        let line = line.trim_end();
        let own = line.is_empty()
            || line.starts_with([' ', '\t', '-', '*', '•', '–'])
            || line.starts_with(|c: char| c.is_ascii_digit());
        match out.last_mut() {
            Some(last) if full && !own => {
                let wide = |g: Option<&str>| g.is_some_and(|g| width(g) > 1);
                let unspaced =
                    wide(last.graphemes(true).next_back()) && wide(line.graphemes(true).next());
                if !unspaced {
                    last.push(' ');
                }
                last.push_str(line);
            }
            _ => out.push(line.to_owned()),
        }
        full = width(line) >= FULL;
    }
    out.join("\n")
}

/// Lines for reading: wrapped, without spaces at their ends, at most `rows`; the
/// last one ends with `…` if something had to be left out.
pub fn paragraph(text: &str, columns: usize, rows: usize) -> Vec<String> {
    let lines = wrap(text.trim_end(), columns);
    let cut = lines.len() > rows;
    let mut out: Vec<String> = lines
        .into_iter()
        .take(rows)
        .map(|line| line.shown.trim_end().to_owned())
        .collect();
    if cut && let Some(last) = out.last_mut() {
        *last = cut_end(&format!("{last}…"), columns);
    }
    out
}

/// One line of at most `columns` cells, `…` at its end if it was longer. The
/// text is escaped.
pub fn one_line(text: &str, columns: usize) -> String {
    let safe: String = text
        .graphemes(true)
        .map(|g| match g {
            "\n" | "\r\n" | "\r" => Cow::Borrowed(" ⏎ "),
            g => shown(g),
        })
        .collect();
    cut_end(&safe, columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lines(text: &str, columns: usize) -> Vec<String> {
        wrap(text, columns).into_iter().map(|l| l.shown).collect()
    }

    #[test]
    fn a_full_line_flows_on_and_the_authors_breaks_stay() {
        let full = "You will feel a number of imitations of a turn-signal switch and say";
        let flows = format!("{full}\nhow real they are.");
        assert_eq!(flow(&flows), format!("{full} how real they are."));
        assert_eq!(flow("first\nsecond\n"), "first\nsecond");
        assert_eq!(flow(&format!("{full}\n\ntwo")), format!("{full}\n\ntwo"));
        assert_eq!(flow(&format!("{full}\n- this")), format!("{full}\n- this"));
        let wide = "これは".repeat(11);
        assert_eq!(flow(&format!("{wide}\n長い")), format!("{wide}長い"));
        assert_eq!(flow(""), "");
    }

    #[test]
    fn no_line_of_japanese_begins_with_a_full_stop_or_ends_with_a_bracket() {
        assert_eq!(lines("よかった。", 8), ["よかっ", "た。"]);
        assert_eq!(lines("がくせい", 6), ["がくせ", "い"]);
        assert_eq!(lines("まって", 4), ["まっ", "て"]);
        assert_eq!(lines("あ「いい」", 4), ["あ", "「い", "い」"]);
    }

    #[test]
    fn text_breaks_at_spaces() {
        assert_eq!(lines("one two three", 8), ["one two ", "three"]);
        assert_eq!(lines("one two  three", 7), ["one two", "three"]);
        assert_eq!(lines("abcdefgh", 3), ["abc", "def", "gh"]);
        assert_eq!(lines("a\n\nb", 3), ["a", "", "b"]);
        assert_eq!(lines("", 3), [""]);
    }

    #[test]
    fn wide_characters_take_two_cells_and_break_anywhere() {
        assert_eq!(lines("よかった", 5), ["よか", "った"]);
        assert_eq!(lines("ab よかった", 6), ["ab よ", "かった"]);
    }

    #[test]
    fn a_mark_stays_with_its_letter_and_a_lone_one_is_visible() {
        assert_eq!(lines("e\u{301}e\u{301}", 1), ["e\u{301}", "e\u{301}"]);
        assert_eq!(lines("\u{301}", 4), ["◌\u{301}"]);
        assert_eq!(lines("\u{200b}", 20), ["\\u{200b}"]);
    }

    #[test]
    fn nothing_that_steers_the_terminal_is_shown() {
        assert_eq!(lines("a\u{1b}[2J\u{202e}b", 40), ["a\\u{1b}[2J\\u{202e}b"]);
    }

    #[test]
    fn what_does_not_fit_ends_with_an_ellipsis() {
        assert_eq!(one_line("abcdef", 4), "abc…");
        assert_eq!(one_line("日本語", 4), "日…");
        assert_eq!(paragraph("one two three four", 5, 2), ["one", "two…"]);
        assert_eq!(one_line("a\nb", 9), "a ⏎ b");
    }

    proptest! {
        #[test]
        fn lines_are_in_order_and_lose_nothing_but_line_breaks(text in "\\PC{0,40}|[ a-z\n\t\u{301}日👍🏽\u{202e}]{0,60}", columns in 1usize..30) {
            let lines = wrap(&text, columns);
            let widest = text.graphemes(true).map(|g| width(&shown(g))).max();
            let mut at = 0;
            for line in &lines {
                prop_assert!(text[at..line.range.start].chars().all(|c| matches!(c, '\n' | '\r')));
                at = line.range.end;
                prop_assert!(width(&line.shown) <= columns.max(widest.unwrap_or(0)));
            }
            prop_assert_eq!(at, text.len());
        }
    }
}
