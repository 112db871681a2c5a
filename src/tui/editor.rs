//! A text editor for any language.
//!
//! The cursor moves by graphemes. Text is stored as typed or pasted, with two
//! exceptions: line ends become `\n`, and NUL is removed, since it ends the text for many
//! readers of CSV. What exceeds [`MAX_TEXT_BYTES`] is removed with a notice.
//!
//! Invariant: the cursor is at a boundary between graphemes.

use super::keys::Key;
use super::wrap::{self, Line};
use study_plan::protocol::answer::{MAX_TEXT_BYTES, cut_to_fit};
use unicode_segmentation::{GraphemeCursor, UnicodeSegmentation as _};

/// A text with a cursor.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Editor {
    text: String,
    cursor: usize,
    one_line: bool,
    /// Width of the text as last drawn, in cells: Up and Down move in it.
    columns: usize,
}

/// The effect of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Handled {
    /// None: the key may mean something else.
    No,
    /// The key was used.
    Yes,
    /// The key was used, with a notice to show.
    Notice(String),
    /// A text was inserted, but not all of it: it is too long.
    Cut,
}

impl Editor {
    /// A multi-line editor that holds `text`, with the cursor at its end.
    pub fn new(text: &str) -> Self {
        Self {
            text: text.to_owned(),
            cursor: text.len(),
            one_line: false,
            columns: 60,
        }
    }

    /// A single-line editor.
    pub fn line(text: &str) -> Self {
        Self {
            one_line: true,
            ..Self::new(text)
        }
    }

    /// The text as typed.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether the text is empty or white space.
    pub fn is_blank(&self) -> bool {
        self.text.trim().is_empty()
    }

    /// Sets the width in which the text is drawn, in cells.
    pub fn set_width(&mut self, columns: usize) {
        self.columns = columns.max(1);
    }

    /// Inserts typed or pasted text at the cursor.
    pub fn insert(&mut self, piece: &str) -> Handled {
        let (piece, mut cut) = cut_to_fit(piece);
        let mut clean = piece.replace("\r\n", "\n").replace('\r', "\n");
        if self.one_line {
            clean = clean.replace(['\n', '\t'], " ");
        }
        let nul = clean.contains('\0');
        clean.retain(|c| c != '\0');
        let room = MAX_TEXT_BYTES.saturating_sub(self.text.len());
        let kept = clean
            .grapheme_indices(true)
            .map(|(at, g)| at + g.len())
            .take_while(|end| *end <= room)
            .last()
            .unwrap_or(0);
        cut |= kept < clean.len();
        self.text.insert_str(self.cursor, &clean[..kept]);
        self.cursor = self.boundary_from(self.cursor + kept);
        if cut {
            Handled::Cut
        } else if nul {
            Handled::Notice("NUL characters were removed.".to_owned())
        } else {
            Handled::Yes
        }
    }

    /// Handles a key: edits the text or moves the cursor.
    pub fn key(&mut self, key: Key) -> Handled {
        match key {
            Key::Char(c) => return self.insert(c.encode_utf8(&mut [0; 4])),
            Key::NewLine if !self.one_line => return self.insert("\n"),
            Key::Left => self.cursor = self.before(self.cursor),
            Key::Right => self.cursor = self.after(self.cursor),
            Key::WordLeft => self.cursor = self.word_before(),
            Key::WordRight => self.cursor = self.word_after(),
            Key::Home => self.cursor = self.row_range().0,
            Key::End => self.cursor = self.row_range().1,
            Key::Up => return self.move_row(false),
            Key::Down => return self.move_row(true),
            Key::Backspace => self.remove(self.before(self.cursor), self.cursor),
            Key::Delete => self.remove(self.cursor, self.after(self.cursor)),
            Key::DeleteWord => self.remove(self.word_before(), self.cursor),
            Key::DeleteToStart => self.remove(self.row_range().0, self.cursor),
            _ => return Handled::No,
        }
        Handled::Yes
    }

    /// The lines at a width in cells, and the cursor's line and column.
    pub fn layout(&self, columns: usize) -> (Vec<Line>, usize, usize) {
        let lines = wrap::wrap(&self.text, columns);
        let row = lines
            .iter()
            .rposition(|line| line.range.start <= self.cursor)
            .unwrap_or(0);
        let start = lines[row].range.start;
        let before: usize = self.text[start..self.cursor]
            .graphemes(true)
            .map(|g| wrap::width(&wrap::shown(g)))
            .sum();
        (lines, row, before.min(columns))
    }

    fn remove(&mut self, from: usize, to: usize) {
        self.text.replace_range(from..to, "");
        self.cursor = self.boundary_from(from);
    }

    fn before(&self, at: usize) -> usize {
        let mut graphemes = self.text[..at].grapheme_indices(true);
        graphemes.next_back().map_or(0, |(start, _)| start)
    }

    fn after(&self, at: usize) -> usize {
        let next = self.text[at..].graphemes(true).next();
        at + next.map_or(0, str::len)
    }

    /// `at`, or the next boundary between graphemes: a combining mark joins the letter
    /// before it.
    fn boundary_from(&self, at: usize) -> usize {
        let mut cursor = GraphemeCursor::new(at, self.text.len(), true);
        match cursor.is_boundary(&self.text, 0) {
            Ok(true) => at,
            _ => cursor
                .next_boundary(&self.text, 0)
                .ok()
                .flatten()
                .unwrap_or(self.text.len()),
        }
    }

    fn word_before(&self) -> usize {
        let mut words = self.text[..self.cursor].unicode_word_indices();
        let start = words.next_back().map_or(0, |(start, _)| start);
        self.boundary_from(start)
    }

    fn word_after(&self) -> usize {
        let mut words = self.text[self.cursor..].unicode_word_indices();
        let end = words.next().map(|(at, word)| self.cursor + at + word.len());
        self.boundary_from(end.unwrap_or(self.text.len()))
    }

    /// First and last cursor position in the cursor's line as drawn.
    fn row_range(&self) -> (usize, usize) {
        let (lines, row, _) = self.layout(self.columns);
        let range = &lines[row].range;
        let last = row + 1 == lines.len();
        let broken = self.text[range.end..].starts_with('\n');
        let end = if last || broken {
            range.end
        } else {
            self.before(range.end).max(range.start)
        };
        (range.start, end)
    }

    fn move_row(&mut self, down: bool) -> Handled {
        let (lines, row, column) = self.layout(self.columns);
        let target = if down {
            Some(row + 1).filter(|r| *r < lines.len())
        } else {
            row.checked_sub(1)
        };
        let Some(target) = target else {
            return Handled::No;
        };
        let range = lines[target].range.clone();
        let last = target + 1 == lines.len() || self.text[range.end..].starts_with('\n');
        let mut cells = 0;
        let mut at = range.start;
        for g in self.text[range.clone()].graphemes(true) {
            cells += wrap::width(&wrap::shown(g));
            let end = at + g.len();
            if cells > column || (end == range.end && !last) {
                break;
            }
            at = end;
        }
        self.cursor = at;
        Handled::Yes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn typed(text: &str) -> Editor {
        let mut editor = Editor::new("");
        for c in text.chars() {
            editor.key(Key::Char(c));
        }
        editor
    }

    #[test]
    fn backspace_removes_what_a_reader_sees_as_one_character() {
        for (text, left) in [
            ("ae\u{301}", "a"),
            ("a👍🏽", "a"),
            ("a👩‍👩‍👧", "a"),
            ("日本", "日"),
            ("שלום", "שלו"),
        ] {
            let mut editor = typed(text);
            assert_eq!(editor.text(), text);
            editor.key(Key::Backspace);
            assert_eq!(editor.text(), left);
        }
    }

    #[test]
    fn the_cursor_never_stands_inside_a_character() {
        let mut editor = typed("ae\u{301}b");
        for _ in 0..2 {
            editor.key(Key::Left);
        }
        editor.key(Key::Char('x'));
        assert_eq!(editor.text(), "axe\u{301}b");
        // A mark joins the letter before it, and the cursor goes behind both.
        editor.key(Key::Char('\u{308}'));
        editor.key(Key::Char('y'));
        assert_eq!(editor.text(), "ax\u{308}ye\u{301}b");
    }

    #[test]
    fn a_pasted_megabyte_is_cut_between_characters_with_a_notice() {
        let mut editor = typed("start ");
        let taken = editor.insert(&"日👍🏽".repeat(100_000));
        assert_eq!(taken, Handled::Cut);
        assert!(editor.text().len() <= MAX_TEXT_BYTES);
        assert!(editor.text().len() > MAX_TEXT_BYTES - 12);
        assert!(editor.text().starts_with("start 日👍🏽"));
        assert_eq!(editor.insert("日本日本"), Handled::Cut);
    }

    #[test]
    fn pasted_text_is_stored_as_it_is_but_for_line_ends_and_nul() {
        let mut editor = Editor::new("");
        editor.insert("=1\r\n\"a\"\r\tb\u{1b}[31m\u{202e}\0");
        assert_eq!(editor.text(), "=1\n\"a\"\n\tb\u{1b}[31m\u{202e}");
    }

    #[test]
    fn a_line_stays_a_line() {
        let mut editor = Editor::line("");
        editor.insert("a\nb\tc");
        assert_eq!(editor.key(Key::NewLine), Handled::No);
        assert_eq!(editor.text(), "a b c");
    }

    #[test]
    fn up_and_down_keep_the_column_and_leave_at_the_ends() {
        let mut editor = typed("one");
        editor.key(Key::NewLine);
        editor.insert("two three");
        assert_eq!(editor.key(Key::Up), Handled::Yes);
        editor.key(Key::Char('!'));
        assert_eq!(editor.text(), "one!\ntwo three");
        assert_eq!(editor.key(Key::Up), Handled::No);
    }

    #[test]
    fn words_can_be_removed_and_skipped() {
        let mut editor = typed("crisp but late");
        editor.key(Key::DeleteWord);
        assert_eq!(editor.text(), "crisp but ");
        editor.key(Key::WordLeft);
        editor.key(Key::DeleteToStart);
        assert_eq!(editor.text(), "but ");
    }

    proptest! {
        #[test]
        fn no_key_breaks_the_text(
            start in "[ab \n日e\u{301}\u{200d}👩🏽\u{1f1e9}\u{1f1ea}]{0,30}",
            keys in proptest::collection::vec(0usize..16, 0..40),
            columns in 1usize..20,
        ) {
            let all = [
                Key::Left, Key::Right, Key::Up, Key::Down, Key::Home, Key::End,
                Key::WordLeft, Key::WordRight, Key::Backspace, Key::Delete,
                Key::DeleteWord, Key::DeleteToStart, Key::NewLine,
                Key::Char('x'), Key::Char('\u{301}'), Key::Char('\u{1f1e9}'),
            ];
            let mut editor = Editor::new(&start);
            editor.set_width(columns);
            for key in keys {
                editor.key(all[key]);
                let mut cursor = GraphemeCursor::new(editor.cursor, editor.text.len(), true);
                prop_assert!(cursor.is_boundary(&editor.text, 0).unwrap());
                let (lines, row, _) = editor.layout(columns);
                prop_assert!(row < lines.len());
            }
        }
    }
}
