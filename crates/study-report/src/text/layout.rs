//! Columns, wrapping and color of the terminal page, by display width.

use crate::table::{Medium, Table};
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::{cut_end, cut_middle};
use unicode_segmentation::UnicodeSegmentation as _;
use unicode_width::UnicodeWidthStr as _;

/// Terminal styles, if enabled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Paint(pub(crate) bool);

impl Paint {
    pub(crate) fn strong(self, text: &str) -> String {
        self.style("1", text)
    }

    pub(crate) fn dim(self, text: &str) -> String {
        self.style("2", text)
    }

    pub(crate) fn warn(self, text: &str) -> String {
        self.style("33", text)
    }

    /// Styles each line separately, so that no style runs over the end of a line.
    fn style(self, code: &str, text: &str) -> String {
        if !self.0 {
            return text.to_owned();
        }
        text.split_inclusive('\n')
            .map(|line| {
                let (body, end) = match line.strip_suffix('\n') {
                    Some(body) => (body, "\n"),
                    None => (line, ""),
                };
                format!("\u{1b}[{code}m{body}\u{1b}[0m{end}")
            })
            .collect()
    }
}

/// Text padded with spaces to some columns.
pub(crate) fn pad(text: &str, width: usize) -> String {
    format!("{text}{}", " ".repeat(width.saturating_sub(text.width())))
}

/// Wraps text between words, and inside words longer than a line; each line ends with a
/// line feed.
pub(crate) fn wrap(text: &str, width: usize, first: &str, rest: &str) -> String {
    let mut out = String::new();
    let mut line = first.to_owned();
    let mut empty = true;
    let feed = |line: &mut String, out: &mut String| {
        out.push_str(line.trim_end());
        out.push('\n');
        rest.clone_into(line);
    };
    for word in unbreakable(text) {
        let word = word.as_str();
        let space = usize::from(!empty);
        if !empty && line.width() + space + word.width() > width {
            feed(&mut line, &mut out);
            empty = true;
        }
        if !empty {
            line.push(' ');
        }
        for g in word.graphemes(true) {
            if line.width() + g.width() > width {
                feed(&mut line, &mut out);
            }
            line.push_str(g);
        }
        empty = false;
    }
    feed(&mut line, &mut out);
    out
}

/// The pieces of a text between which a line may break: words, but `p = .023`, `95 %`
/// and `F(2, 5) = 8.10` are one piece each.
fn unbreakable(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut open = false;
    for word in text.split(' ').filter(|w| !w.is_empty()) {
        let sign = matches!(word, "=" | "<" | ">");
        let unit = word.starts_with('%');
        match words.last_mut().filter(|_| sign || unit || open) {
            Some(last) => {
                last.push(' ');
                last.push_str(word);
            }
            None => words.push(word.to_owned()),
        }
        open = sign || (word.starts_with("F(") && word.ends_with(','));
    }
    words
}

/// A table that adapts to the width of the page: it shortens names as long as they stay
/// distinct, then drops columns, then cuts the ends of lines.
pub(super) struct Grid {
    rows: Vec<Vec<String>>,
    /// A left-aligned column besides the first and the last.
    left: Option<usize>,
    /// Columns to drop, in this order; those of a group together.
    dropped: Vec<Vec<usize>>,
}

/// Smallest width of the first column.
const MIN_NAME: usize = 8;

impl Grid {
    /// A table as a grid; `left` is aligned to the left if the table does not say which column is.
    pub(super) fn of(table: &Table, left: Option<usize>) -> Self {
        let columns = table.columns(Medium::Terminal);
        let aligned = columns.iter().position(|c| c.head.left);
        let mut dropped: BTreeMap<u8, Vec<usize>> = BTreeMap::new();
        for (i, column) in columns.iter().enumerate() {
            if let Some(rank) = column.head.rank {
                dropped.entry(rank).or_default().push(i);
            }
        }
        let dropped: Vec<Vec<usize>> = dropped.into_values().collect();
        let heads = table.heads(Medium::Terminal);
        let mut grid = Self::new(&heads, aligned.or(left), &dropped);
        let rows = table.rows(Medium::Terminal);
        (grid.rows).extend(rows.iter().map(|r| r.1.iter().map(|c| c.shown()).collect()));
        grid
    }

    fn new(head: &[&str], left: Option<usize>, dropped: &[Vec<usize>]) -> Self {
        Self {
            rows: vec![head.iter().map(|h| (*h).to_owned()).collect()],
            left,
            dropped: dropped.to_vec(),
        }
    }

    /// The smallest width of the first column at which different names look different.
    fn narrowest(&self, widest: usize) -> usize {
        let differ = |width: usize| {
            let shown = self.rows.iter().map(|r| cut_middle(&r[0], width));
            shown.collect::<BTreeSet<_>>().len()
        };
        let all = differ(widest);
        (MIN_NAME.min(widest)..widest)
            .find(|w| differ(*w) == all)
            .unwrap_or(widest)
    }

    /// The widths of all columns.
    fn widths(&self) -> Vec<usize> {
        let columns = self.rows[0].len();
        // The last heading may be cut, the numbers below it may not.
        let column = |j: usize| {
            let skip = usize::from(j + 1 == columns && self.rows.len() > 1);
            let cells = self.rows[skip..].iter();
            cells.map(|r| r[j].width()).max().unwrap_or(0)
        };
        (0..columns).map(column).collect()
    }

    /// The columns that are shown on a page of this width.
    pub(super) fn shown(&self, width: usize) -> Vec<usize> {
        let widths = self.widths();
        let mut shown: Vec<usize> = (0..widths.len()).collect();
        let narrowest = self.narrowest(widths[0]);
        for drop in &self.dropped {
            let least: usize = shown[1..].iter().map(|&j| widths[j] + 2).sum();
            if narrowest + least > width {
                shown.retain(|j| !drop.contains(j));
            }
        }
        shown
    }

    /// The table, with a blank line after the first `tests` rows if others follow.
    pub(super) fn render(&self, width: usize, tests: usize, paint: Paint) -> String {
        let columns = self.rows[0].len();
        let mut widths = self.widths();
        let shown = self.shown(width);
        let others: usize = shown[1..].iter().map(|&j| widths[j] + 2).sum();
        widths[0] = widths[0].min(width.saturating_sub(others).max(MIN_NAME));
        let room = width.saturating_sub(widths[0] + others);
        widths[columns - 1] += room;
        let mut out = String::new();
        for (i, row) in self.rows.iter().enumerate() {
            let mut line = String::new();
            for &j in &shown {
                let w = widths[j];
                let cell = if j == 0 {
                    cut_middle(&row[j], w)
                } else {
                    cut_end(&row[j], w)
                };
                if j > 0 {
                    line.push_str("  ");
                }
                if j == 0 || j + 1 == columns || Some(j) == self.left {
                    line.push_str(&pad(&cell, w));
                } else {
                    line.push_str(&" ".repeat(w - cell.width()));
                    line.push_str(&cell);
                }
            }
            let line = cut_end(line.trim_end(), width);
            out.push_str(&if i == 0 { paint.dim(&line) } else { line });
            out.push('\n');
            if i == tests && i > 0 && i + 1 < self.rows.len() {
                out.push('\n');
            }
        }
        out.push('\n');
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::apa::two;
    use crate::table::{Builder, page};

    #[test]
    fn words_wrap_and_long_ones_break() {
        assert_eq!(wrap("aa bb cc", 5, "", ""), "aa bb\ncc\n");
        assert_eq!(wrap("aaaaaaa", 4, "! ", "  "), "! aa\n  aa\n  aa\n  a\n");
        assert_eq!(wrap("so p = .02, yes", 9, "", ""), "so\np = .02,\nyes\n");
    }

    #[test]
    fn names_that_begin_alike_stay_distinct() {
        let mut grid = Grid::new(&["realization", "n", "VAF"], None, &[vec![1]]);
        for name in ["lambda-0.9995-dx-1", "lambda-0.99995-dx-1"] {
            grid.rows
                .push(vec![name.to_owned(), "30".to_owned(), "0.9".to_owned()]);
        }
        let page = grid.render(20, 2, Paint(false));
        let names: BTreeSet<&str> = page
            .lines()
            .skip(1)
            .filter_map(|l| l.split(' ').next())
            .filter(|n| !n.is_empty())
            .collect();
        assert_eq!(names.len(), 2, "{page}");
        assert!(page.lines().all(|l| l.width() <= 20), "{page}");
    }

    /// What explains a column goes with it, and an interval with its estimate.
    #[test]
    fn columns_of_a_rank_are_left_out_together_and_so_is_their_note() {
        let rows = ["a", "b"];
        let half = |head: &str| page(head).droppable(1);
        let table = Builder::new("", rows)
            .name("", "name", &|row| row.to_owned())
            .number(
                half("estimate").explained("Estimate: a guess.".to_owned()),
                two,
                &|_| Some(0.5),
            )
            .ends(half("95 %"), two, &|_| Some((0.25, 0.75)))
            .number(page("n").explained("n: all.".to_owned()), two, &|_| {
                Some(3.0)
            })
            .notes(["Own.".to_owned()]);
        let grid = Grid::of(&table, None);
        let columns = table.columns(Medium::Terminal);
        let notes = |width| {
            let shown: Vec<_> = grid.shown(width).iter().map(|i| columns[*i]).collect();
            table.notes_with(&shown).join(" ")
        };
        assert_eq!(grid.shown(80), [0, 1, 2, 3]);
        assert_eq!(notes(80), "Estimate: a guess. n: all. Own.");
        // There would be room for the estimate without its interval.
        assert_eq!(grid.shown(20), [0, 3]);
        assert_eq!(notes(20), "n: all. Own.");
        assert_eq!(table.notes(Medium::Report), table.notes_with(&columns));
    }

    #[test]
    fn wide_characters_count_twice() {
        assert_eq!(pad("よ", 4), "よ  ");
    }

    #[test]
    fn the_degrees_of_freedom_stay_together() {
        assert_eq!(
            unbreakable("a F(2, 5) = 8.10, p"),
            ["a", "F(2, 5) = 8.10,", "p"]
        );
    }
}
