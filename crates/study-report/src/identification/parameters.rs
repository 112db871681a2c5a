//! Fig. 5 and 8: the parameters of a table over position, and over position and λ.

use super::{Drawing, Shown, both, letter, points, zero_line};
use crate::chart::{Axis, Color, ColorBar, Figure, Look, Mark, Note, Panel, Scale, Shape, Span};
use std::fmt::Write as _;
use study_base::sort::SmallSort as _;
use study_haptics::model::{Branch, Realization};

/// A parameter: column of the CSV, name, values by node.
type Parameter = (&'static str, &'static str, fn(&Branch) -> &Vec<f64>);

const PARAMETERS: [Parameter; 4] = [
    ("m_kg", "mass m", |b| &b.m_kg),
    ("b_n_s_per_mm", "damping b", |b| &b.b_n_s_per_mm),
    ("k_n_per_mm", "stiffness k", |b| &b.k_n_per_mm),
    ("f0_n", "offset F0", |b| &b.f0_n),
];

/// The label of the axis of a parameter.
fn label((key, name, _): Parameter, shown: Shown) -> String {
    let [x, f] = shown.units.names();
    let unit = match key {
        "m_kg" if f == "N" => "kg".to_owned(),
        "m_kg" => return "inertia m (kg·m²)".to_owned(),
        "b_n_s_per_mm" => format!("{f}·s/{x}"),
        "k_n_per_mm" => format!("{f}/{x}"),
        _ => f.to_owned(),
    };
    format!("{name} ({unit})")
}

/// dF0/dx between the nodes: positions and slopes.
fn slopes(x: &[f64], f: &[f64]) -> [Vec<f64>; 2] {
    let between = x.windows(2).zip(f.windows(2));
    let (x, slopes) = between
        .map(|(x, f)| (0.5 * (x[0] + x[1]), (f[1] - f[0]) / (x[1] - x[0])))
        .unzip();
    [x, slopes]
}

/// Fig. 5: the parameters of a table over position, both directions. A table without
/// stiffness has it in its offset: its slope is shown.
pub fn parameters(realization: &Realization, shown: Shown) -> Drawing {
    let r = shown.realization(realization);
    let mut figure = Figure::new(
        "fig5",
        "Parameters of the realization over position",
        820.0,
        660.0,
    );
    figure.columns = 2;
    let branches = [&r.positive, &r.negative];
    let without_stiffness = branches
        .iter()
        .all(|b| b.k_n_per_mm.iter().all(|k| *k == 0.0));
    for (n, parameter) in PARAMETERS.into_iter().enumerate() {
        let (key, _, of) = parameter;
        let slope = key == "k_n_per_mm" && without_stiffness;
        let lines = branches.map(|branch| match slope {
            true => slopes(&r.x_mm, &branch.f0_n),
            false => [r.x_mm.clone(), of(branch).clone()],
        });
        let name = match slope {
            true => ("k_n_per_mm", "slope of the offset dF0/dx", of),
            false => parameter,
        };
        // with 0, which is drawn: one mass for all x is otherwise a line on an axis without a scale
        let values = (lines.iter().flat_map(|[_, y]| y.iter().copied())).chain([0.0]);
        let mut panel = Panel::new(
            Axis::around(&shown.position(), r.x_mm.iter().copied()),
            Axis::around(&label(name, shown), values),
        )
        .titled(&letter(n));
        for ((direction, look), [x, y]) in ["v > 0", "v < 0"].into_iter().zip(both()).zip(&lines) {
            // One legend is enough.
            panel = match n {
                0 => panel.named(direction, look, points(x, y)),
                _ => panel.with(look, points(x, y)),
            };
        }
        zero_line(&mut panel);
        let mut drawn = lines.iter().flat_map(|[_, y]| y);
        if drawn.all(|value| *value == 0.0) {
            // such as a mass that the recordings do not carry: a scale without a value looks like one
            let middle = 0.5 * (panel.x.low + panel.x.high);
            panel.y = panel.y.at(vec![(0.0, "0".to_owned())]);
            panel = panel.note(Note::new((middle, 0.0), "0 everywhere").moved(0.0, -12.0));
        }
        figure = figure.with(panel);
    }
    let mut csv = shown.column("x_mm");
    for direction in ["positive", "negative"] {
        for (key, _, _) in PARAMETERS {
            let _ = write!(csv, ",{direction}_{}", shown.column(key));
        }
    }
    csv.push('\n');
    for (i, x) in r.x_mm.iter().enumerate() {
        let _ = write!(csv, "{x}");
        for branch in branches {
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

/// Share of the values beyond each end of the colors of Fig. 8.
const BEYOND: f64 = 0.02;

/// Fig. 8: the parameters of the + direction over position and λ. `None` unless there
/// are at least two realizations with the same nodes.
pub fn map(by_lambda: &[(f64, &Realization)], shown: Shown) -> Option<Drawing> {
    let mut sorted: Vec<(f64, Realization)> = (by_lambda.iter())
        .map(|(lambda, r)| (*lambda, shown.realization(r)))
        .collect();
    sorted.small_sort_by(|a, b| a.0.total_cmp(&b.0));
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
    for (n, parameter) in PARAMETERS.into_iter().enumerate() {
        let (_, _, of) = parameter;
        let mut sizes: Vec<f64> = sorted
            .iter()
            .flat_map(|(_, r)| of(&r.positive))
            .map(|value| value.abs())
            .collect();
        sizes.sort_by(f64::total_cmp);
        let most = sizes[((sizes.len() - 1) as f64 * (1.0 - BEYOND)).round() as usize];
        let scale = Scale::diverging(most);
        let edge = |i: usize| match x.get(i) {
            Some(here) if i > 0 => 0.5 * (x[i - 1] + here),
            _ => x[i.min(x.len() - 1)],
        };
        let cells: Vec<(Span, f64)> = (sorted.iter().enumerate())
            .flat_map(|(row, (_, r))| {
                let y = row as f64;
                let span = move |i: usize| Span {
                    x: (edge(i), edge(i + 1)),
                    y: (y - 0.5, y + 0.5),
                };
                let values = of(&r.positive).iter().enumerate();
                values.map(move |(i, value)| (span(i), *value))
            })
            .collect();
        let beyond = |above: bool| {
            let clipped = cells.iter().filter(|(_, value)| match above {
                true => *value > scale.high,
                false => *value < scale.low,
            });
            let middle = |s: &Span| (0.5 * (s.x.0 + s.x.1), 0.5 * (s.y.0 + s.y.1));
            Mark::Points(clipped.map(|(span, _)| middle(span)).collect())
        };
        let (above, below) = (beyond(true), beyond(false));
        let mark = |shape| Look {
            shape,
            ..Look::plain(Color::WHITE).size(5.0)
        };
        let mut panel = Panel::new(
            Axis::new(&shown.position(), x[0], x[x.len() - 1]).without_grid(),
            Axis::of_names("forgetting factor λ", &names),
        )
        .titled(&format!("{}  {}", letter(n), label(parameter, shown)))
        .with(Look::nth(0), Mark::Heat { cells, scale })
        .with(mark(Shape::Up), above)
        .with(mark(Shape::Down), below);
        panel.color_bar = Some(ColorBar {
            label: "triangles: beyond the colors".to_owned(),
            scale,
        });
        figure = figure.with(panel);
    }
    let columns = PARAMETERS.map(|(key, ..)| shown.column(key));
    let mut csv = format!("lambda,{},{}\n", shown.column("x_mm"), columns.join(","));
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
