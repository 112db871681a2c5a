//! The first figures of an identification as text: force and residual over position, and coverage.

use super::Shown;
use super::coverage::{Coverage, rows, shade};
use super::position::{Bin, ByPosition};
use crate::apa::plain;
use crate::plot::braille::{Canvas, LABEL, labeled};

/// Rows of the force.
const ROWS: usize = 8;
/// Widest picture, columns.
const WIDEST: usize = 120;
/// Columns from one mark of the model to the next one.
const EVERY: usize = 3;
/// Characters of the shades of coverage.
const SHADES: [char; 5] = [' ', '·', '░', '▒', '█'];
const BARS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Force over position and the size of the residual below it.
pub fn displacement(found: &ByPosition, width: usize, shown: Shown) -> String {
    let [x_unit, f_unit] = shown.units.names();
    let columns = width.clamp(40, WIDEST) - LABEL - 3 - x_unit.chars().count();
    let bins = found.x_mm.len();
    let half = 0.5 * (found.x_mm[1] - found.x_mm[0]);
    let range = [found.x_mm[0] - half, found.x_mm[bins - 1] + half].map(|mm| shown.length(mm));
    let all = || found.sides.iter().flatten().flatten();
    let forces = all().flat_map(|bin| [bin.measured_n, bin.model_n]);
    let forces = forces.map(|n| shown.force(n));
    let ends = forces.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], f| {
        [low.min(f), high.max(f)]
    });
    let mut canvas = Canvas::new(columns, ROWS, ends);
    for side in [0, 1] {
        let measured = found.column(side, |bin| shown.force(bin.measured_n));
        let mut before: Option<f64> = None;
        for dot in 0..2 * columns {
            let Some(f) = measured[dot * bins / (2 * columns)] else {
                before = None;
                continue;
            };
            // a steep flank has no holes
            let from = before.unwrap_or(f);
            canvas.span(dot, [from.min(f), from.max(f)]);
            before = Some(f);
        }
    }
    for (side, mark) in ['o', '+'].into_iter().enumerate() {
        let model = found.column(side, |bin| shown.force(bin.model_n));
        for column in (side..columns).step_by(EVERY) {
            if let Some(f) = model[(2 * column + 1) * bins / (2 * columns)] {
                canvas.mark(column, f, mark);
            }
        }
    }
    let [first, second] = found.directions();
    let heading = format!(
        "{}: ⠒ measured; model: o {first}, + {second}",
        shown.of_force("", "F")
    );
    canvas.framed(&heading, x_unit, range) + &residual(found, columns, f_unit, shown)
}

/// A bar for each column and direction.
fn residual(found: &ByPosition, columns: usize, f_unit: &str, shown: Shown) -> String {
    let size = |bin: &Bin| {
        let deviation = bin.deviation_n.unwrap_or(0.0);
        bin.residual_n().hypot(deviation)
    };
    let most = found.inner().map(size).fold(0.0, f64::max);
    let differences: Vec<f64> = found.inner().filter_map(|bin| bin.difference_n).collect();
    let mean_square = |n: &[f64]| n.iter().map(|n| n * n).sum::<f64>() / n.len() as f64;
    let repeated = match differences.len() {
        0 => String::new(),
        _ => format!(
            "; two repetitions differ by {} {f_unit}",
            plain(shown.force(mean_square(&differences).sqrt()))
        ),
    };
    let rows = [0, 1].map(|side| {
        let sizes = found.column(side, size);
        let bar = |column: usize| {
            let share = sizes[(2 * column + 1) * sizes.len() / (2 * columns)]? / most;
            // between 1 and 8
            Some(BARS[(8.0 * share).ceil().clamp(1.0, 8.0) as usize])
        };
        let bars = (0..columns).map(|column| bar(column).unwrap_or(' '));
        (
            found.directions()[side].to_owned(),
            bars.collect::<String>(),
        )
    });
    let mut out = format!(
        "residual (rms): █ is {} {f_unit} or more{repeated}\n",
        plain(shown.force(most))
    );
    for (label, bars) in rows {
        out += &format!("{label:>LABEL$} │{}\n", bars.trim_end());
    }
    out
}

/// The map of coverage.
pub fn coverage(found: &Coverage, width: usize, shown: Shown) -> String {
    let [x_unit, _] = shown.units.names();
    let rows = rows(found);
    let names: Vec<String> = rows.iter().map(|row| row.name(shown)).collect();
    let label = names.iter().map(|name| name.chars().count()).max();
    let label = label.unwrap_or(0).max(LABEL);
    let columns = width.clamp(40, WIDEST) - label - 3 - x_unit.chars().count();
    let [low, high] = found.x_mm;
    let at = |column: usize| low + (high - low) * (column as f64 + 0.5) / columns as f64;
    let is_held = |column: usize| {
        let mut held = found.held_mm.iter();
        held.any(|[from, to]| (*from..*to).contains(&at(column)))
    };
    let drawn = rows.iter().map(|row| {
        let character = |column: usize| match is_held(column) {
            true => '×',
            false => SHADES[shade(row.samples[column * row.samples.len() / columns])],
        };
        (0..columns).map(character).collect::<String>()
    });
    let mut heading =
        format!("samples by velocity ({x_unit}/s): · 1 to 9, ░ 10 to 99, ▒ 100 to 999, █ more");
    if !found.held_mm.is_empty() {
        heading += ", × held";
    }
    let range = found.x_mm.map(|mm| shown.length(mm));
    labeled(
        &heading,
        x_unit,
        range,
        columns,
        names.into_iter().zip(drawn),
    )
}
