//! The figures of an identification, numbered as in the paper: 4 VAF over λ and dx,
//! 5 parameters over position, 6 force over time, 7 its spectrum, 8 parameters over
//! position and λ.
//!
//! Each figure comes with its data as a CSV, in the units of its axes. Nothing is
//! identified or selected here.

mod spectrum;

use super::chart::{
    Axis, ColourBar, Dash, Figure, Look, Mark, Note, PALETTE, Panel, Span, ramp, share,
};
use std::fmt::Write as _;
use study_haptics::identify::vaf;
use study_haptics::model::{Branch, Realization};
use study_haptics::recording::Recording;

/// Duration shown in Fig. 6, s.
const SHOWN_S: f64 = 4.0;
/// Largest number of points of a line in Fig. 6.
const MAX_POINTS: usize = 2000;
/// Largest number of cells that are labelled in Fig. 4.
const MAX_LABELLED: usize = 160;

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

/// A cell of Fig. 4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridCell {
    /// Forgetting factor.
    pub lambda: f64,
    /// Memory length, mm, if finite.
    pub memory_mm: Option<f64>,
    /// Resampling increment, mm.
    pub dx_mm: f64,
    /// Variance accounted for.
    pub vaf: f64,
}

/// Fig. 4: VAF over λ and dx. `best` is an index of `grid`; `on` names the recording,
/// untrusted. `None` unless there are at least two λ and two dx.
pub fn surface(grid: &[GridCell], best: Option<usize>, on: &str) -> Option<Drawing> {
    let lambdas = distinct(grid.iter().map(|p| p.lambda));
    let increments = distinct(grid.iter().map(|p| p.dx_mm));
    if lambdas.len() < 2 || increments.len() < 2 {
        return None;
    }
    let finite = || grid.iter().map(|p| p.vaf).filter(|v| v.is_finite());
    let high = finite().fold(f64::NEG_INFINITY, f64::max);
    // A few very low values must not take up the colour range of all others.
    let low = finite().fold(high, f64::min).max(high - 0.5);
    let index = |of: &[f64], value: f64| of.partition_point(|v| *v < value) as f64;
    let position = |p: &GridCell| (index(&lambdas, p.lambda), index(&increments, p.dx_mm));
    let around = |(x, y): (f64, f64)| Span {
        x: (x - 0.5, x + 0.5),
        y: (y - 0.5, y + 0.5),
    };
    let cells = grid.iter().map(|p| (around(position(p)), p.vaf)).collect();
    let names = |of: &[f64]| of.iter().map(ToString::to_string).collect::<Vec<_>>();
    let mut panel = Panel::new(
        Axis::of_names("forgetting factor λ", &names(&lambdas)),
        Axis::of_names("resampling increment dx (mm)", &names(&increments)),
    )
    .titled(&format!("VAF on {on}"))
    .with(Look::nth(0), Mark::Heat { cells, low, high });
    panel.colour_bar = Some(ColourBar {
        label: "VAF".into(),
        low,
        high,
    });
    if grid.len() <= MAX_LABELLED {
        for p in grid {
            let mut note = Note::new(position(p), &short(p.vaf)).moved(0.0, 4.0);
            note.colour = ramp(share(p.vaf, low, high)).text_on();
            // White letters must have no white outline.
            note.rim = false;
            panel = panel.note(note);
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
    let mut csv = String::from("lambda,memory_mm,dx_mm,vaf\n");
    for p in grid {
        let memory = p.memory_mm.map_or(String::new(), |l| l.to_string());
        let _ = writeln!(csv, "{},{memory},{},{}", p.lambda, p.dx_mm, p.vaf);
    }
    let width = 190.0 + 58.0 * lambdas.len() as f64;
    let height = 150.0 + 32.0 * increments.len() as f64;
    Some(Drawing {
        name: "fig4-vaf",
        figure: Figure::new(
            "fig4",
            "Variance accounted for by forgetting factor and resampling increment",
            width.clamp(420.0, 1400.0),
            height.clamp(320.0, 1000.0),
        )
        .with(panel),
        csv,
    })
}

/// A parameter: column of the CSV, label of the axis, values by node.
type Column = (&'static str, &'static str, fn(&Branch) -> &Vec<f64>);

const PARAMETERS: [Column; 4] = [
    ("m_kg", "mass m (kg)", |b| &b.m_kg),
    ("b_n_s_per_mm", "damping b (N·s/mm)", |b| &b.b_n_s_per_mm),
    ("k_n_per_mm", "stiffness k (N/mm)", |b| &b.k_n_per_mm),
    ("f0_n", "offset force F0 (N)", |b| &b.f0_n),
];

/// Fig. 5: the parameters of a realization over position, both directions.
pub fn parameters(realization: &Realization) -> Drawing {
    let r = realization;
    let mut figure = Figure::new(
        "fig5",
        "Parameters of the realization over position",
        820.0,
        620.0,
    );
    figure.columns = 2;
    let [plus, minus] = both();
    for (_, label, of) in PARAMETERS {
        let values = || of(&r.positive).iter().chain(of(&r.negative)).copied();
        let line = |branch: &Branch| points(&r.x_mm, of(branch));
        figure = figure.with(
            Panel::new(
                Axis::around("position x (mm)", r.x_mm.iter().copied()),
                Axis::around(label, values()),
            )
            .named("v > 0", plus, line(&r.positive))
            .named("v < 0", minus, line(&r.negative)),
        );
    }
    let mut csv = String::from("x_mm");
    for direction in ["positive", "negative"] {
        for (name, _, _) in PARAMETERS {
            let _ = write!(csv, ",{direction}_{name}");
        }
    }
    csv.push('\n');
    for (i, x) in r.x_mm.iter().enumerate() {
        let _ = write!(csv, "{x}");
        for branch in [&r.positive, &r.negative] {
            for (_, _, of) in PARAMETERS {
                let _ = write!(csv, ",{}", of(branch)[i]);
            }
        }
        csv.push('\n');
    }
    Drawing {
        name: "fig5-parameters",
        figure,
        csv,
    }
}

/// Fig. 6: measured and predicted force over the first seconds.
pub fn force(realization: &Realization, recording: &Recording) -> Drawing {
    let start = recording.t_s[0];
    let shown = recording.t_s.partition_point(|t| t - start <= SHOWN_S);
    let stride = shown.div_ceil(MAX_POINTS).max(1);
    let rows: Vec<[f64; 3]> = vaf::predict(realization, recording)
        .enumerate()
        .take(shown)
        .step_by(stride)
        .map(|(i, predicted)| [recording.t_s[i] - start, recording.f_n[i], predicted])
        .collect();
    let line = |of: fn(&[f64; 3]) -> f64| Mark::Line(rows.iter().map(|r| (r[0], of(r))).collect());
    let time = || Axis::new("time (s)", 0.0, rows.last().map_or(1.0, |r| r[0]));
    let forces = rows.iter().flat_map(|r| [r[1], r[2]]);
    let [measured, predicted] = both();
    let mut residual = Panel::new(
        time(),
        Axis::around("residual (N)", rows.iter().map(|r| r[1] - r[2])),
    )
    .with(Look::plain(PALETTE[6]), line(|r| r[1] - r[2]));
    residual.share = 0.5;
    let figure = Figure::new(
        "fig6",
        "Measured and predicted force over time",
        820.0,
        480.0,
    )
    .with(
        Panel::new(time(), Axis::around("force F (N)", forces))
            .named("measured", measured, line(|r| r[1]))
            .named("predicted", predicted, line(|r| r[2])),
    )
    .with(residual);
    let mut csv = String::from("t_s,measured_n,predicted_n\n");
    for [t, f, p] in &rows {
        let _ = writeln!(csv, "{t},{f},{p}");
    }
    Drawing {
        name: "fig6-force",
        figure,
        csv,
    }
}

/// Fig. 7: amplitude spectra of measured force, predicted force and residual, 0 to 10 Hz.
pub fn spectra(realization: &Realization, recording: &Recording) -> Drawing {
    let predicted: Vec<f64> = vaf::predict(realization, recording).collect();
    let residual: Vec<f64> = recording
        .f_n
        .iter()
        .zip(&predicted)
        .map(|(f, p)| f - p)
        .collect();
    let found = spectrum::amplitudes(&recording.t_s, [&recording.f_n, &predicted, &residual]);
    let line = |i: usize| Mark::Line(found.iter().map(|(hz, n)| (*hz, n[i])).collect());
    let top = found.iter().flat_map(|(_, n)| *n).fold(0.0, f64::max);
    let [measured, other] = both();
    let panel = Panel::new(
        Axis::new("frequency (Hz)", 0.0, spectrum::TOP_HZ),
        Axis::new("amplitude of the force (N)", 0.0, 1.05 * top),
    )
    .named("measured", measured, line(0))
    .named("predicted", other, line(1))
    .named("residual", Look::nth(6).dashed(Dash::Dotted), line(2));
    let mut csv = String::from("hz,measured_n,predicted_n,residual_n\n");
    for (hz, [f, p, e]) in &found {
        let _ = writeln!(csv, "{hz},{f},{p},{e}");
    }
    Drawing {
        name: "fig7-spectra",
        figure: Figure::new(
            "fig7",
            "Spectra of measured and predicted force",
            820.0,
            420.0,
        )
        .with(panel),
        csv,
    }
}

/// Fig. 8: the parameters of the + direction over position and λ. `None` unless there
/// are at least two realizations with the same nodes.
pub fn map(by_lambda: &[(f64, &Realization)]) -> Option<Drawing> {
    let mut sorted = by_lambda.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let x = &sorted.first()?.1.x_mm;
    if sorted.len() < 2 || sorted.iter().any(|(_, r)| r.x_mm != *x) {
        return None;
    }
    let names: Vec<String> = sorted
        .iter()
        .map(|(lambda, _)| lambda.to_string())
        .collect();
    let mut figure = Figure::new(
        "fig8",
        "Parameters of the + direction over position and forgetting factor",
        960.0,
        680.0,
    );
    figure.columns = 2;
    for (_, label, of) in PARAMETERS {
        let mut all: Vec<f64> = sorted
            .iter()
            .flat_map(|(_, r)| of(&r.positive))
            .copied()
            .collect();
        all.sort_by(f64::total_cmp);
        // The colours cover the middle 96 %; other values get the colours of the ends.
        let at = |share: f64| all[((all.len() - 1) as f64 * share).round() as usize];
        let (low, high) = (at(0.02), at(0.98));
        let cells = sorted
            .iter()
            .enumerate()
            .flat_map(|(row, (_, r))| {
                let values = of(&r.positive);
                (0..x.len()).map(move |i| {
                    let left = if i == 0 {
                        x[0]
                    } else {
                        0.5 * (x[i - 1] + x[i])
                    };
                    let right = x.get(i + 1).map_or(x[i], |next| 0.5 * (x[i] + next));
                    let y = row as f64;
                    let span = Span {
                        x: (left, right),
                        y: (y - 0.5, y + 0.5),
                    };
                    (span, values[i])
                })
            })
            .collect();
        let mut panel = Panel::new(
            Axis::new("position x (mm)", x[0], x[x.len() - 1]).without_grid(),
            Axis::of_names("forgetting factor λ", &names),
        )
        .titled(label)
        .with(Look::nth(0), Mark::Heat { cells, low, high });
        panel.colour_bar = Some(ColourBar {
            label: String::new(),
            low,
            high,
        });
        figure = figure.with(panel);
    }
    let mut csv = String::from("lambda,x_mm,m_kg,b_n_s_per_mm,k_n_per_mm,f0_n\n");
    for (lambda, r) in &sorted {
        for (i, x) in r.x_mm.iter().enumerate() {
            let [m, b, k, f0] = PARAMETERS.map(|(_, _, of)| of(&r.positive)[i]);
            let _ = writeln!(csv, "{lambda},{x},{m},{b},{k},{f0}");
        }
    }
    Some(Drawing {
        name: "fig8-map",
        figure,
        csv,
    })
}

/// The appearance of two compared series, different in colour, lightness and dash.
fn both() -> [Look; 2] {
    [
        Look::plain(PALETTE[0]).stroke(2.0),
        Look::plain(PALETTE[1]).dashed(Dash::Dashed).stroke(2.0),
    ]
}

fn points(x: &[f64], y: &[f64]) -> Mark {
    Mark::Line(x.iter().copied().zip(y.iter().copied()).collect())
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

#[cfg(test)]
mod tests;
