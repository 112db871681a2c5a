//! What an identification prints: its text, its document, and its figures.
//!
//! The figures are numbered as in the paper: 4 VAF over λ (or δ) and dx,
//! 5 parameters over position, 6 force over time, 7 its spectrum, 8 parameters over
//! position and λ. Before them come those that are looked at first: force and residual over position,
//! coverage, and the comparison of methods, which [`terminal`] draws as text.
//!
//! Each figure comes with its data as a CSV, in the units of its axes. Nothing is
//! identified or selected here.

mod comparison;
mod coverage;
mod displacement;
mod elements;
mod elsewhere;
mod first;
mod json;
mod loops;
mod mechanism;
mod methods;
mod page;
mod parameters;
mod position;
mod printed;
mod spectrum;
mod surface;
pub mod terminal;
mod text;

pub use coverage::{Coverage, coverage};
pub use displacement::displacement;
pub use json::document;
pub use mechanism::mechanism;
pub use methods::{Compared, methods};
pub use page::page;
pub use parameters::{map, parameters};
pub use position::{Bin, ByPosition};
pub use surface::{GridCell, Row, surface};
pub use text::{required_damping, text};

use super::chart::{Axis, Color, Dash, Figure, Look, Mark, PALETTE, Panel};
use std::fmt::Write as _;
use study_base::text::Untrusted;
use study_haptics::identify::identification::Identification;
use study_haptics::identify::vaf;
use study_haptics::model::{Realization, Units};
use study_haptics::recording::Recording;

/// Duration shown in Fig. 6, s.
const SHOWN_S: f64 = 4.0;
/// Largest number of points of a line in Fig. 6.
const MAX_POINTS: usize = 2000;

/// A figure and its data.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// File name without extension.
    pub name: &'static str,
    /// The figure.
    pub figure: Figure,
    /// Its data.
    pub csv: String,
}

/// The figures of an identification, and notes on figures that need more cells.
pub fn figures(results: &Identification) -> (Vec<Drawing>, Vec<&'static str>) {
    let mut missing = Vec::new();
    let mut drawings = first::drawings(results);
    let shown =
        (results.turned).map_or(Shown::LINEAR, |(units, lever_mm)| Shown { units, lever_mm });
    let lambdas = (results.cells.iter()).any(|c| c.realization.provenance.lambda.is_some());
    let row = if lambdas { Row::Lambda } else { Row::Delta };
    let places: Vec<GridCell> = results
        .cells
        .iter()
        .filter_map(|cell| {
            let provenance = &cell.realization.provenance;
            Some(GridCell {
                value: match row {
                    Row::Lambda => provenance.lambda?,
                    Row::Delta => cell.realization.direction.delta_mm()?,
                },
                memory_mm: provenance.memory_mm,
                dx_mm: provenance.dx_mm?,
                vaf: cell.scores.first()?.vaf,
            })
        })
        .collect();
    let whole = places.len() == results.cells.len();
    let selected_on = results
        .recordings
        .first()
        .map_or("", |source| &source.recording.name);
    let name = Untrusted(selected_on).to_string();
    let best = results.best.filter(|_| whole);
    match surface(row, &places, best, &name, shown) {
        Some(drawing) => drawings.push(drawing),
        None => {
            missing.push("no Fig. 4: it requires two dx and two lambda, or two dx and two delta")
        }
    }
    if let Some(cell) = results.cells.get(results.best.unwrap_or(0)) {
        let recording = results.reported();
        let realization = &cell.realization;
        let mechanism = mechanism(realization, recording, shown);
        let is_table = mechanism.is_none();
        drawings.push(mechanism.unwrap_or_else(|| parameters(realization, shown)));
        drawings.push(force(realization, recording, shown));
        match spectra(realization, recording, shown) {
            Some(drawing) => drawings.push(drawing),
            None => missing.push("no Fig. 7: the time of a slow press says nothing of the switch"),
        }
        let dx = realization.provenance.dx_mm;
        let same_dx: Vec<_> = results
            .cells
            .iter()
            .filter(|other| other.realization.provenance.dx_mm == dx)
            .filter_map(|other| Some((other.realization.provenance.lambda?, &other.realization)))
            .collect();
        match map(&same_dx, shown) {
            Some(drawing) => drawings.push(drawing),
            None if is_table => missing.push("no Fig. 8: it requires at least two lambda"),
            None => {}
        }
    }
    (drawings, missing)
}

/// The units of the axes and the lever arm of a turning handle, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    /// The units.
    pub units: Units,
    /// Without meaning for mm and N.
    pub lever_mm: f64,
}

impl Shown {
    /// mm and N.
    pub const LINEAR: Self = Self {
        units: Units::Linear,
        lever_mm: 1.0,
    };

    fn length(self, mm: f64) -> f64 {
        self.units.of_mm(mm, self.lever_mm)
    }

    fn force(self, n: f64) -> f64 {
        self.units.of_n(n, self.lever_mm)
    }

    /// A realization in these units.
    fn realization(self, linear: &Realization) -> Realization {
        linear.clone().turned(self.units, self.lever_mm)
    }

    fn position(self) -> String {
        let [x, _] = self.units.names();
        let word = match self.units {
            Units::Linear => "position x",
            Units::Degrees | Units::Radians => "angle θ",
        };
        format!("{word} ({x})")
    }

    /// The name of a force with its unit; a torque where the handle turns.
    fn of_force(self, before: &str, symbol: &str) -> String {
        let (word, unit) = match self.units {
            Units::Linear => ("force", "N"),
            Units::Degrees | Units::Radians => ("torque", "N·m"),
        };
        let words = [before, word, symbol].into_iter().filter(|w| !w.is_empty());
        let words: Vec<&str> = words.collect();
        format!("{} ({unit})", words.join(" "))
    }

    /// The head of a column whose key in mm and N is `key`.
    fn column(self, key: &str) -> String {
        self.units.key(key)
    }
}

/// Fig. 6: measured and predicted force over the first seconds, of a slow press over all of it.
pub fn force(realization: &Realization, recording: &Recording, shown: Shown) -> Drawing {
    let start = recording.t_s[0];
    let shown_s = match recording.is_force_curve() {
        true => f64::INFINITY,
        false => SHOWN_S,
    };
    let samples = recording.t_s.partition_point(|t| t - start <= shown_s);
    let stride = samples.div_ceil(MAX_POINTS).max(1);
    let rows: Vec<[f64; 3]> = vaf::predict(realization, recording)
        .enumerate()
        .take(samples)
        .step_by(stride)
        .map(|(i, predicted)| {
            let [measured, predicted] = [recording.f_n[i], predicted].map(|n| shown.force(n));
            [recording.t_s[i] - start, measured, predicted]
        })
        .collect();
    let line = |of: fn(&[f64; 3]) -> f64| Mark::Line(rows.iter().map(|r| (r[0], of(r))).collect());
    let time = || Axis::new("time (s)", 0.0, rows.last().map_or(1.0, |r| r[0]));
    let forces = rows.iter().flat_map(|r| [r[1], r[2]]);
    let [measured, predicted] = both();
    let mut residual = Panel::new(
        time(),
        Axis::around(
            &shown.of_force("residual", ""),
            rows.iter().map(|r| r[1] - r[2]),
        ),
    )
    .with(Look::plain(PALETTE[6]), line(|r| r[1] - r[2]));
    zero_line(&mut residual);
    residual.share = 0.5;
    let figure = Figure::new(
        "fig6",
        "Measured and predicted force over time",
        820.0,
        480.0,
    )
    .with(
        Panel::new(time(), Axis::around(&shown.of_force("", "F"), forces))
            .named("measured", measured, line(|r| r[1]))
            .named("predicted", predicted, line(|r| r[2])),
    )
    .with(residual);
    let columns = ["measured_n", "predicted_n"].map(|key| shown.column(key));
    let mut csv = format!("t_s,{}\n", columns.join(","));
    for [t, f, p] in &rows {
        let _ = writeln!(csv, "{t},{f},{p}");
    }
    Drawing {
        name: "fig6-force",
        figure,
        csv,
    }
}

/// Fig. 7: amplitude spectra of measured force, predicted force and residual, from 0 to 10 Hz or half the
/// sampling rate. `None` for a slow press, whose time says nothing of the target.
pub fn spectra(realization: &Realization, recording: &Recording, shown: Shown) -> Option<Drawing> {
    if recording.is_force_curve() {
        return None;
    }
    let predicted: Vec<f64> = vaf::predict(realization, recording).collect();
    let residual: Vec<f64> = recording
        .f_n
        .iter()
        .zip(&predicted)
        .map(|(f, p)| f - p)
        .collect();
    let mut found = spectrum::amplitudes(&recording.t_s, [&recording.f_n, &predicted, &residual]);
    for (_, amplitudes) in &mut found {
        *amplitudes = amplitudes.map(|n| shown.force(n));
    }
    let line = |i: usize| Mark::Line(found.iter().map(|(hz, n)| (*hz, n[i])).collect());
    let top = found.iter().flat_map(|(_, n)| *n).fold(0.0, f64::max);
    let [measured, other] = both();
    let panel = Panel::new(
        Axis::new(
            "frequency (Hz)",
            0.0,
            found.last().map_or(spectrum::TOP_HZ, |f| f.0),
        ),
        Axis::new(&shown.of_force("amplitude of the", ""), 0.0, 1.05 * top),
    )
    .named("measured", measured, line(0))
    .named("predicted", other, line(1))
    .named("residual", Look::nth(6).dashed(Dash::Dotted), line(2));
    let columns = ["measured_n", "predicted_n", "residual_n"].map(|key| shown.column(key));
    let mut csv = format!("hz,{}\n", columns.join(","));
    for (hz, [f, p, e]) in &found {
        let _ = writeln!(csv, "{hz},{f},{p},{e}");
    }
    Some(Drawing {
        name: "fig7-spectra",
        figure: Figure::new(
            "fig7",
            "Spectra of measured and predicted force",
            820.0,
            420.0,
        )
        .with(panel),
        csv,
    })
}

/// The appearance of two compared series, different in color, lightness and dash.
fn both() -> [Look; 2] {
    [
        Look::plain(PALETTE[0]).stroke(2.0),
        Look::plain(PALETTE[1]).dashed(Dash::Dashed).stroke(2.0),
    ]
}

fn points(x: &[f64], y: &[f64]) -> Mark {
    Mark::Line(x.iter().copied().zip(y.iter().copied()).collect())
}

/// Draws a line at 0 below the series, where 0 lies within the axis.
fn zero_line(panel: &mut Panel) {
    if panel.y.low < 0.0 && panel.y.high > 0.0 {
        let ends = vec![(panel.x.low, 0.0), (panel.x.high, 0.0)];
        let line = super::chart::Series {
            name: None,
            look: Look::plain(Color::GREY).stroke(1.0),
            mark: Mark::Line(ends),
        };
        panel.series.insert(0, line);
    }
}

/// The letter of the n-th panel, as its title.
fn letter(n: usize) -> String {
    char::from(b'a' + u8::try_from(n % 26).unwrap_or(0)).to_string()
}

#[cfg(test)]
mod tests;
