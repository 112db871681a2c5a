//! Curves and bar charts of characters for a terminal.
//!
//! Curves are drawn with braille characters, two dots per column and four per row. Each
//! dot column covers the range of all values in its time, so that no peak is lost.

use std::fmt::Write as _;
use study_report::plot::Axis;

/// Width of the labels on the left, columns.
pub(in crate::cli) const LABEL: usize = 9;
/// Values evaluated for each dot column.
const VALUES_PER_DOT: usize = 16;
/// Bits of a braille cell: by column, then row.
const DOTS: [[u32; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];
const BLOCKS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// `value` over `range`, as a heading, `rows` lines and an axis.
pub(in crate::cli) fn curve(
    heading: &str,
    unit: &str,
    range: [f64; 2],
    columns: usize,
    rows: usize,
    value: impl Fn(f64) -> f64,
) -> String {
    let dots = 2 * columns;
    let [from, to] = range;
    // neighbors share a value, so that the line has no holes
    let spans: Vec<[f64; 2]> = (0..dots)
        .map(|dot| {
            (0..=VALUES_PER_DOT)
                .map(|i| {
                    let n = VALUES_PER_DOT;
                    let share = (dot * n + i) as f64 / (dots * n) as f64;
                    value(from + (to - from) * share)
                })
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
                    [low.min(v), high.max(v)]
                })
        })
        .collect();
    let low = spans.iter().map(|s| s[0]).fold(f64::INFINITY, f64::min);
    let high = spans.iter().map(|s| s[1]).fold(f64::NEG_INFINITY, f64::max);
    let span = if high > low { high - low } else { 1.0 };
    let lines = 4 * rows;
    // between 0 and lines − 1, so the cast is exact
    let line = |v: f64| (((high - v) / span * (lines - 1) as f64).round() as usize).min(lines - 1);
    let mut cells = vec![vec![0u32; columns]; rows];
    for (dot, [least, most]) in spans.iter().enumerate() {
        for at in line(*most)..=line(*least) {
            cells[at / 4][dot / 2] |= DOTS[dot % 2][at % 4];
        }
    }
    let drawn = cells.iter().map(|row| {
        row.iter()
            .map(|bits| char::from_u32(0x2800 + bits).unwrap_or(' '))
            .collect::<String>()
    });
    framed(heading, unit, range, columns, [low, high], drawn.collect())
}

/// A bar chart with one bar for each value, logarithmic from `least_share` of the largest
/// value.
pub(in crate::cli) fn columns(
    heading: &str,
    unit: &str,
    range: [f64; 2],
    values: &[f64],
    least_share: f64,
    rows: usize,
) -> String {
    let most = values.iter().copied().fold(0.0, f64::max);
    let height = |v: f64| {
        let share = v / most;
        if share > least_share {
            1.0 - share.log10() / least_share.log10()
        } else {
            0.0
        }
    };
    let drawn = (0..rows).map(|row| {
        let floor = (rows - 1 - row) as f64;
        values
            .iter()
            .map(|v| {
                let eighths = (8.0 * (height(*v) * rows as f64 - floor)).round();
                // between 0 and 8, so the cast is exact
                BLOCKS[eighths.clamp(0.0, 8.0) as usize]
            })
            .collect::<String>()
    });
    let bounds = [most * least_share, most];
    framed(heading, unit, range, values.len(), bounds, drawn.collect())
}

/// The rows with labels on the left and an axis below.
fn framed(
    heading: &str,
    unit: &str,
    [from, to]: [f64; 2],
    columns: usize,
    [low, high]: [f64; 2],
    rows: Vec<String>,
) -> String {
    let mut out = format!("\n{heading}\n");
    let last = rows.len() - 1;
    for (i, row) in rows.iter().enumerate() {
        let label = match i {
            0 => number(high),
            _ if i == last => number(low),
            _ => String::new(),
        };
        // writing to a String cannot fail
        let _ = writeln!(out, "{label:>LABEL$} │{}", row.trim_end_matches(['⠀', ' ']));
    }
    let ticks = Axis::new(from, to, columns).map_or(String::new(), |axis| axis.ticks());
    let _ = writeln!(out, "{:>LABEL$} │{ticks} {unit}", "");
    out
}

/// A number that fits into [`LABEL`] columns.
fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if (0.01..1e5).contains(&size) {
        format!("{value:.2}")
    } else {
        format!("{value:.1e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_drawn_from_corner_to_corner() {
        let drawn = curve("a line", "s", [0.0, 10.0], 8, 2, |t| t);
        assert_eq!(
            drawn,
            "\na line\n    10.00 │⠀⠀⠀⠀⣀⡤⠖⠋\n        0 │⣠⠴⠚⠉⠁\n          │0   5 10 s\n"
        );
    }

    #[test]
    fn a_constant_and_an_empty_spectrum_are_drawn_too() {
        assert!(curve("c", "s", [0.0, 1.0], 10, 2, |_| 3.0).contains("3.00"));
        let empty = columns("s", "Hz", [0.0, 1.0], &[0.0; 10], 1e-4, 2);
        assert!(!empty.contains('█'), "{empty}");
    }

    #[test]
    fn the_largest_value_fills_its_column() {
        let drawn = columns("s", "Hz", [0.0, 4.0], &[1.0, 0.01, 1e-9], 1e-4, 2);
        let rows: Vec<&str> = drawn.lines().skip(2).collect();
        assert!(rows[0].ends_with("│█"), "{drawn}");
        assert!(rows[1].ends_with("│██"), "{drawn}");
    }
}
