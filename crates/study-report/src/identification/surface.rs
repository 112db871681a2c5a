//! Fig. 4: VAF over a parameter of the method and dx.

use super::{Drawing, Shown};
use crate::chart::{Axis, ColorBar, Figure, Look, Mark, Note, PALETTE, Panel, Scale, Span};
use std::fmt::Write as _;

/// Largest number of cells that are labeled.
const MAX_LABELED: usize = 160;
/// VAF this far below the highest have the color of the lowest: a few very low values must
/// not take up the colors of all others.
const SPREAD: f64 = 0.5;

/// What differs between the columns of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Row {
    /// The forgetting factor.
    Lambda,
    /// The length over which the direction changes, mm.
    Delta,
}

/// A cell of Fig. 4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridCell {
    /// Forgetting factor, or δ in mm.
    pub value: f64,
    /// Memory length, mm, if there is a finite one.
    pub memory_mm: Option<f64>,
    /// Resampling increment, mm.
    pub dx_mm: f64,
    /// Variance accounted for.
    pub vaf: f64,
}

/// Fig. 4: VAF over a parameter and dx. `best` is an index of `grid`; `on` names the
/// recording, untrusted. `None` unless there are at least two values of each.
pub fn surface(
    row: Row,
    grid: &[GridCell],
    best: Option<usize>,
    on: &str,
    shown: Shown,
) -> Option<Drawing> {
    // Lengths in the units of the axes.
    let length = |mm: f64| significant(shown.length(mm));
    let value = |p: &GridCell| match row {
        Row::Lambda => p.value,
        Row::Delta => length(p.value),
    };
    let values = distinct(grid.iter().map(value));
    let increments = distinct(grid.iter().map(|p| length(p.dx_mm)));
    if values.len() < 2 || increments.len() < 2 {
        return None;
    }
    let finite = || grid.iter().map(|p| p.vaf).filter(|v| v.is_finite());
    let high = finite().fold(f64::NEG_INFINITY, f64::max);
    let lowest = finite().fold(high, f64::min);
    let scale = Scale::ascending(lowest.max(high - SPREAD), high);
    let index = |of: &[f64], value: f64| of.partition_point(|v| *v < value) as f64;
    let position = |p: &GridCell| {
        (
            index(&values, value(p)),
            index(&increments, length(p.dx_mm)),
        )
    };
    let around = |(x, y): (f64, f64)| Span {
        x: (x - 0.5, x + 0.5),
        y: (y - 0.5, y + 0.5),
    };
    let cells = grid.iter().map(|p| (around(position(p)), p.vaf)).collect();
    let names = |of: &[f64]| of.iter().map(ToString::to_string).collect::<Vec<_>>();
    let [unit, _] = shown.units.names();
    let (axis, title) = match row {
        Row::Lambda => ("forgetting factor λ".to_owned(), "forgetting factor"),
        Row::Delta => (
            format!("length of the change of direction δ ({unit})"),
            "length of the change of direction",
        ),
    };
    let mut panel = Panel::new(
        Axis::of_names(&axis, &names(&values)),
        Axis::of_names(
            &format!("resampling increment dx ({unit})"),
            &names(&increments),
        ),
    )
    .titled(&format!("VAF on {on}"))
    .with(Look::nth(0), Mark::Heat { cells, scale });
    let label = match lowest < scale.low {
        true => format!("VAF; all below {:.2} in one color", scale.low),
        false => "VAF".to_owned(),
    };
    panel.color_bar = Some(ColorBar { label, scale });
    if grid.len() <= MAX_LABELED {
        for p in grid {
            let text = short(p.vaf);
            let note = Note::new(position(p), &text).moved(0.0, 4.0);
            panel = panel.note(note.on(scale.color(p.vaf)));
        }
    }
    if let Some(best) = best.and_then(|i| grid.get(i)) {
        let (x, y) = position(best);
        let corners = [
            (-0.5, -0.5),
            (0.5, -0.5),
            (0.5, 0.5),
            (-0.5, 0.5),
            (-0.5, -0.5),
        ];
        let frame = corners.iter().map(|(a, b)| (x + a, y + b)).collect();
        let look = Look::plain(PALETTE[1]).stroke(3.0);
        panel = panel.named("highest", look, Mark::Line(frame));
    }
    let [delta, memory, dx] = ["delta_mm", "memory_mm", "dx_mm"].map(|key| shown.column(key));
    let mut csv = match row {
        Row::Lambda => format!("lambda,{memory},{dx},vaf\n"),
        Row::Delta => format!("{delta},{dx},vaf\n"),
    };
    for p in grid {
        let (value, dx, vaf) = (value(p), length(p.dx_mm), p.vaf);
        let _ = match row {
            Row::Lambda => {
                let memory = p
                    .memory_mm
                    .map_or(String::new(), |l| shown.length(l).to_string());
                writeln!(csv, "{value},{memory},{dx},{vaf}")
            }
            Row::Delta => writeln!(csv, "{value},{dx},{vaf}"),
        };
    }
    let width = 190.0 + 58.0 * values.len() as f64;
    let height = 150.0 + 32.0 * increments.len() as f64;
    Some(Drawing {
        name: "fig4-vaf",
        figure: Figure::new(
            "fig4",
            &format!("Variance accounted for by {title} and resampling increment"),
            width.clamp(420.0, 1400.0),
            height.clamp(320.0, 1000.0),
        )
        .with(panel),
        csv,
    })
}

/// Without the digits that a conversion of units leaves.
fn significant(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}

/// The distinct values, ascending.
fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// A VAF in at most five characters.
fn short(vaf: f64) -> String {
    if vaf <= -10.0 {
        format!("{vaf:.0}")
    } else {
        format!("{vaf:.3}").replacen("0.", ".", 1)
    }
}
