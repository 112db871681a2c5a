//! Curves of braille characters, two dots per column and four per row.

use super::Axis;
use std::fmt::Write as _;

/// Width of the labels on the left, columns.
pub const LABEL: usize = 9;
/// Bits of a braille cell: by column, then row.
const DOTS: [[u32; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];

/// A field of characters on which curves and marks are drawn.
#[derive(Debug, Clone)]
pub struct Canvas {
    columns: usize,
    /// The value of the lowest and of the highest line.
    values: [f64; 2],
    cells: Vec<Vec<u32>>,
    /// Row, column and character.
    marks: Vec<(usize, usize, char)>,
}

impl Canvas {
    /// An empty field of at least one row for values from `low` to `high`.
    pub fn new(columns: usize, rows: usize, [low, high]: [f64; 2]) -> Self {
        Self {
            columns,
            values: [low, high],
            cells: vec![vec![0; columns]; rows.max(1)],
            marks: Vec::new(),
        }
    }

    /// The line of dots of a value, from the top.
    fn line(&self, value: f64) -> usize {
        let [low, high] = self.values;
        let last = (4 * self.cells.len() - 1) as f64;
        let span = if high > low { high - low } else { 1.0 };
        // between 0 and the last line, so the cast is exact
        ((high - value) / span * last).round().clamp(0.0, last) as usize
    }

    /// Sets the dots of a column of dots from one value to another one.
    pub fn span(&mut self, dot: usize, [least, most]: [f64; 2]) {
        for at in self.line(most)..=self.line(least) {
            self.cells[at / 4][dot / 2] |= DOTS[dot % 2][at % 4];
        }
    }

    /// Draws a character at the value of a column, over the curves.
    pub fn mark(&mut self, column: usize, value: f64, character: char) {
        let row = self.line(value) / 4;
        self.marks.push((row, column, character));
    }

    /// The field under a heading, with the values of its lines on the left and an axis of `range` below.
    pub fn framed(&self, heading: &str, unit: &str, range: [f64; 2]) -> String {
        framed(heading, unit, range, self.columns, self.values, self.rows())
    }

    /// The same without values on the left.
    pub fn unscaled(&self, heading: &str, unit: &str, range: [f64; 2]) -> String {
        let rows = self.rows().into_iter().map(|row| (String::new(), row));
        labeled(heading, unit, range, self.columns, rows)
    }

    fn rows(&self) -> Vec<String> {
        let row = |(row, cells): (usize, &Vec<u32>)| {
            let braille = (cells.iter()).map(|bits| char::from_u32(0x2800 + bits).unwrap_or(' '));
            let mut characters: Vec<char> = braille.collect();
            for (_, column, character) in self.marks.iter().filter(|(r, ..)| *r == row) {
                characters[*column] = *character;
            }
            characters.into_iter().collect()
        };
        self.cells.iter().enumerate().map(row).collect()
    }
}

/// Rows of a text chart with the highest and the lowest value on the left and an axis of `range` below.
pub fn framed(
    heading: &str,
    unit: &str,
    range: [f64; 2],
    columns: usize,
    [low, high]: [f64; 2],
    rows: Vec<String>,
) -> String {
    let last = rows.len().saturating_sub(1);
    let labels = (0..rows.len()).map(|i| match i {
        0 => number(high),
        _ if i == last => number(low),
        _ => String::new(),
    });
    labeled(heading, unit, range, columns, labels.zip(rows))
}

/// Rows of a text chart, each with its label on the left, and an axis of `range` below.
pub fn labeled(
    heading: &str,
    unit: &str,
    [from, to]: [f64; 2],
    columns: usize,
    rows: impl Iterator<Item = (String, String)>,
) -> String {
    let rows: Vec<(String, String)> = rows.collect();
    let labels = rows.iter().map(|(label, _)| label.chars().count());
    let width = labels.max().unwrap_or(0).max(LABEL);
    let mut out = format!("\n{heading}\n");
    for (label, row) in rows {
        // writing to a String cannot fail
        let _ = writeln!(out, "{label:>width$} │{}", row.trim_end_matches(['⠀', ' ']));
    }
    let ticks = Axis::new(from, to, columns).map_or(String::new(), |axis| axis.ticks());
    let _ = writeln!(out, "{:>width$} │{ticks} {unit}", "");
    out
}

/// A number that fits into [`LABEL`] columns.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        1.0..1e5 => format!("{value:.2}"),
        0.001..1.0 => format!("{value:.3}"),
        _ => format!("{value:.1e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_stands_at_its_value_over_the_curve() {
        let mut canvas = Canvas::new(3, 2, [0.0, 0.6]);
        for dot in 0..6 {
            canvas.span(dot, [0.6, 0.6]);
        }
        canvas.mark(1, 0.0, 'o');
        canvas.mark(2, 0.6, 'x');
        assert_eq!(
            canvas.framed("F", "mm", [0.0, 4.0]),
            "\nF\n    0.600 │⠉⠉x\n        0 │⠀o\n          │ mm\n"
        );
    }

    #[test]
    fn numbers_of_a_key_keep_three_digits() {
        assert_eq!(
            [0.2637, 1.2, 12.0, 0.0004, 0.0].map(number),
            ["0.264", "1.20", "12.00", "4.0e-4", "0"]
        );
    }
}
