//! Curves and bar charts of characters for a terminal.
//!
//! Curves are drawn with braille characters, two dots per column and four per row. Each
//! dot column covers the range of all values in its time, so that no peak is lost.

use study_report::plot::braille::{Canvas, framed};

/// Values evaluated for each dot column.
const VALUES_PER_DOT: usize = 16;
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
    let mut canvas = Canvas::new(columns, rows, [low, high]);
    for (dot, span) in spans.iter().enumerate() {
        canvas.span(dot, *span);
    }
    canvas.framed(heading, unit, range)
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
