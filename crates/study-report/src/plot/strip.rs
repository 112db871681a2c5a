//! A quantity over time, as on the paper of a strip-chart recorder.

use super::braille::Canvas;

/// A quantity over time, (s, value), as a heading, `rows` rows of braille characters and an
/// axis of the time since the first point. Each column of dots covers all values in its
/// time, so that no peak is lost. `scale` has the values of the lowest and the highest line;
/// without it the curve fills the rows and has no values. Empty for fewer than two times.
///
/// ```
/// # use study_report::plot::strip::strip;
/// let points = [(2.0, 0.0), (3.0, 1.0), (4.0, 0.0)];
/// assert!(strip("Force, N", &points, Some([0.0, 1.0]), 20, 2).contains("1.00 │"));
/// assert!(strip("Force", &points, None, 20, 2).contains("\n          │"));
/// ```
pub fn strip(
    heading: &str,
    points: &[(f64, f64)],
    scale: Option<[f64; 2]>,
    columns: usize,
    rows: usize,
) -> String {
    let finite = |(t, y): &&(f64, f64)| t.is_finite() && y.is_finite();
    let points: Vec<(f64, f64)> = points.iter().filter(finite).copied().collect();
    let [from, to] = extent(points.iter().map(|(t, _)| *t));
    if to <= from {
        return String::new();
    }
    let columns = columns.max(2);
    let mut spans: Vec<Option<[f64; 2]>> = vec![None; 2 * columns];
    let last = spans.len() - 1;
    for (t, y) in &points {
        // Between 0 and the last dot, so the cast is exact.
        let dot = ((t - from) / (to - from) * last as f64).round();
        let span = &mut spans[dot.clamp(0.0, last as f64) as usize];
        let [least, most] = span.unwrap_or([*y; 2]);
        *span = Some([least.min(*y), most.max(*y)]);
    }
    let values = scale.unwrap_or_else(|| extent(points.iter().map(|(_, y)| *y)));
    let mut canvas = Canvas::new(columns, rows, values);
    for (dot, span) in spans.into_iter().enumerate() {
        if let Some(span) = span {
            canvas.span(dot, span);
        }
    }
    let time = [0.0, to - from];
    match scale {
        Some(_) => canvas.framed(heading, "s", time),
        None => canvas.unscaled(heading, "s", time),
    }
}

/// The least and the largest value; of no values, two zeros.
pub fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let each = values.map(|value| [value; 2]);
    let all = each.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]);
    all.unwrap_or([0.0; 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rising(by: f64) -> Vec<(f64, f64)> {
        (0..=8)
            .map(|i| (3.0 + f64::from(i), by * f64::from(i)))
            .collect()
    }

    #[test]
    fn a_line_goes_from_corner_to_corner_and_time_begins_at_the_first_point() {
        let drawn = strip("x", &rising(1.0), Some([0.0, 8.0]), 8, 2);
        let lines: Vec<&str> = drawn.lines().collect();
        assert_eq!(lines[1], "x");
        assert!(
            lines[2].starts_with("     8.00 │") && lines[2].ends_with('⠈'),
            "{drawn}"
        );
        assert!(lines[3].starts_with("        0 │⡀"), "{drawn}");
        assert!(
            lines[4].contains("│0") && lines[4].ends_with(" s"),
            "{drawn}"
        );
    }

    #[test]
    fn without_a_scale_a_larger_force_looks_the_same() {
        let drawn = strip("x", &rising(1.0), None, 8, 2);
        assert_eq!(drawn, strip("x", &rising(4.0), None, 8, 2));
        assert!(!drawn.contains("8.00"), "{drawn}");
    }

    #[test]
    fn nothing_is_drawn_of_one_moment_and_of_what_is_no_number() {
        assert_eq!(strip("x", &[], None, 8, 2), "");
        assert_eq!(strip("x", &[(1.0, 2.0)], None, 8, 2), "");
        let odd = [(0.0, f64::NAN), (f64::INFINITY, 1.0), (1.0, 1.0)];
        assert_eq!(strip("x", &odd, None, 8, 2), "");
    }
}
