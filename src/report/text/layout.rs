//! Columns, wrapping and colour of the terminal page, by display width.

use std::collections::BTreeSet;
use unicode_segmentation::UnicodeSegmentation as _;
use unicode_width::UnicodeWidthStr as _;

/// Styles, or none.
#[derive(Debug, Clone, Copy)]
pub(super) struct Paint(pub(super) bool);

impl Paint {
    pub(super) fn strong(self, text: &str) -> String {
        self.style("1", text)
    }

    pub(super) fn dim(self, text: &str) -> String {
        self.style("2", text)
    }

    pub(super) fn warn(self, text: &str) -> String {
        self.style("33", text)
    }

    /// Line by line, so that no style runs over a line's end.
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

/// A number with so many decimals; a very large one in exponents.
pub(super) fn number(x: f64, decimals: usize) -> String {
    if x.abs() >= 1e12 {
        format!("{x:.3e}")
    } else {
        // The addition turns a rounded −0 into 0.
        let shown = format!("{x:.decimals$}");
        match shown.strip_prefix('-') {
            Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
            _ => shown.replace('-', "−"),
        }
    }
}

/// Text of at most so many columns, with `…` where it was cut.
pub(super) fn cut(text: &str, width: usize) -> String {
    if text.width() <= width {
        return text.to_owned();
    }
    let mut out = String::new();
    let mut used = 1;
    for g in text.graphemes(true) {
        used += g.width();
        if used > width {
            break;
        }
        out.push_str(g);
    }
    out.push('…');
    out
}

/// A name of at most so many columns, with `…` after its first third where it was
/// cut: names of realizations often begin alike.
pub(super) fn squeezed(name: &str, width: usize) -> String {
    if name.width() <= width {
        return name.to_owned();
    }
    let room = width.saturating_sub(1);
    let within = |parts: &mut dyn Iterator<Item = &str>, most: usize| -> Vec<String> {
        let mut used = 0;
        let fits = |g: &&str| {
            used += g.width();
            used <= most
        };
        parts.take_while(fits).map(str::to_owned).collect()
    };
    let first = within(&mut name.graphemes(true), room / 3);
    let mut last = within(&mut name.graphemes(true).rev(), room - room / 3);
    last.reverse();
    format!("{}…{}", first.concat(), last.concat())
}

/// Text filled up to so many columns.
pub(super) fn pad(text: &str, width: usize) -> String {
    format!("{text}{}", " ".repeat(width.saturating_sub(text.width())))
}

/// Lines of at most so many columns, broken between words (or, in a word that is
/// longer than a line, anywhere), each with a line feed.
pub(super) fn wrap(text: &str, width: usize, first: &str, rest: &str) -> String {
    let mut out = String::new();
    let mut line = first.to_owned();
    let mut empty = true;
    let feed = |line: &mut String, out: &mut String| {
        out.push_str(line.trim_end());
        out.push('\n');
        rest.clone_into(line);
    };
    for word in glued(text) {
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

/// The words of a text. What stands around an equals or a less-than sign stays
/// together, and a number with its per cent: `p = .023` is one word.
fn glued(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut open = false;
    for word in text.split(' ').filter(|w| !w.is_empty()) {
        let sign = matches!(word, "=" | "<");
        let unit = word.starts_with('%');
        match words.last_mut().filter(|_| sign || unit || open) {
            Some(last) => {
                last.push(' ');
                last.push_str(word);
            }
            None => words.push(word.to_owned()),
        }
        open = sign;
    }
    words
}

/// A table that gives way when the page is narrow: first the names, as long as they
/// differ, then whole columns, last the ends of the lines.
pub(super) struct Grid {
    rows: Vec<Vec<String>>,
    /// A column that is set to the left, like the first and the last.
    left: Option<usize>,
    /// Columns that are left out, one after the other.
    dropped: Vec<usize>,
}

/// Narrowest first column.
const MIN_NAME: usize = 8;

impl Grid {
    pub(super) fn new(head: &[&str], left: Option<usize>, dropped: &[usize]) -> Self {
        Self {
            rows: vec![head.iter().map(|h| (*h).to_owned()).collect()],
            left,
            dropped: dropped.to_vec(),
        }
    }

    /// The narrowest first column in which the names differ that do so in full.
    fn narrowest(&self, widest: usize) -> usize {
        let differ = |width: usize| {
            let shown = self.rows.iter().map(|r| squeezed(&r[0], width));
            shown.collect::<BTreeSet<_>>().len()
        };
        let all = differ(widest);
        (MIN_NAME.min(widest)..widest)
            .find(|w| differ(*w) == all)
            .unwrap_or(widest)
    }

    pub(super) fn row(&mut self, row: Vec<String>) {
        self.rows.push(row);
    }

    /// The table; a blank line after the `apart`-th row, if others follow.
    pub(super) fn render(&self, width: usize, apart: usize, paint: Paint) -> String {
        let columns = self.rows[0].len();
        // Of the last heading the words give way, not the numbers under it.
        let column = |j: usize| {
            let skip = usize::from(j + 1 == columns && self.rows.len() > 1);
            let cells = self.rows[skip..].iter();
            cells.map(|r| r[j].width()).max().unwrap_or(0)
        };
        let mut widths: Vec<usize> = (0..columns).map(column).collect();
        let mut shown: Vec<usize> = (0..columns).collect();
        let narrowest = self.narrowest(widths[0]);
        for &drop in &self.dropped {
            let least: usize = shown[1..].iter().map(|&j| widths[j] + 2).sum();
            if narrowest + least > width {
                shown.retain(|&j| j != drop);
            }
        }
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
                    squeezed(&row[j], w)
                } else {
                    cut(&row[j], w)
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
            let line = cut(line.trim_end(), width);
            out.push_str(&if i == 0 { paint.dim(&line) } else { line });
            out.push('\n');
            if i == apart && i > 0 && i + 1 < self.rows.len() {
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

    #[test]
    fn words_wrap_and_long_ones_break() {
        assert_eq!(wrap("aa bb cc", 5, "", ""), "aa bb\ncc\n");
        assert_eq!(wrap("aaaaaaa", 4, "! ", "  "), "! aa\n  aa\n  aa\n  a\n");
        assert_eq!(wrap("so p = .02, yes", 9, "", ""), "so\np = .02,\nyes\n");
    }

    #[test]
    fn names_that_begin_alike_stay_apart() {
        assert_eq!(squeezed("lambda-0.99995-dx-1", 13), "lamb…995-dx-1");
        let mut grid = Grid::new(&["realization", "n", "VAF"], None, &[1]);
        for name in ["lambda-0.9995-dx-1", "lambda-0.99995-dx-1"] {
            grid.row(vec![name.to_owned(), "30".to_owned(), "0.9".to_owned()]);
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

    #[test]
    fn wide_characters_count_twice() {
        assert_eq!(squeezed("よかったね", 6), "…たね");
        assert_eq!(cut("よかった", 5), "よか…");
        assert_eq!(pad("よ", 4), "よ  ");
    }

    #[test]
    fn no_minus_zero_is_shown() {
        assert_eq!(number(-0.0001, 2), "0.00");
        assert_eq!(number(-0.01, 2), "−0.01");
        assert_eq!(number(1e300, 3), "1.000e300");
    }
}
