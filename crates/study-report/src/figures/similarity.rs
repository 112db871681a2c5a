//! The map of the realizations, in which distances stand for differences.

use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head, rows_height};
use crate::apa::digits;
use crate::chart::{Axis, Label, Look, Mark, PALETTE, Panel, Whisker, shortened};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::psychophysics::results::Place;
use study_analysis::analyze::results::Number as _;

/// Where a realization lies, with standard errors, by dimension.
struct Placed {
    name: String,
    at: Vec<(f64, Option<f64>)>,
}

fn placed(name: &str, place: &Place) -> Placed {
    let axis = |x: Option<f64>, se: Option<f64>| x.map(|x| (x, se));
    let at = [
        axis(place.x.number(), place.x_se.number()),
        axis(place.y.number(), place.y_se.number()),
        axis(place.z.number(), place.z_se.number()),
    ];
    Placed {
        name: name.to_owned(),
        at: at.into_iter().flatten().collect(),
    }
}

/// The map of a part of similarity.
pub(super) fn map(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let found = part.results.over.similarity.as_ref()?;
    let places = found.map.iter();
    let rows: Vec<Placed> = places
        .map(|(name, place)| placed(name.as_str(), place))
        .collect();
    let dimensions = rows.first()?.at.len();
    if dimensions == 0 || rows.len() > MAX_DRAWN {
        return None;
    }
    let mut data = vec![head(["realization", "x", "x_se", "y", "y_se", "z", "z_se"])];
    for row in &rows {
        let mut line = vec![row.name.clone()];
        for k in 0..3 {
            line.push(cell(row.at.get(k).map(|at| at.0)));
            line.push(cell(row.at.get(k).and_then(|at| at.1)));
        }
        data.push(line);
    }
    let stress = found.map_stress.number().map_or_else(String::new, digits);
    let caption = format!(
        "Map of the realizations: distances stand for differences, in points of the scale; axes have no meaning of their own. Bars: one standard \
         error over participants to both sides. Stress {stress}."
    );
    let title = "Map of perceived differences";
    Some(drawn(name, caption, data, |c: Canvas| {
        if dimensions == 1 {
            let height = 56.0 + rows_height(rows.len());
            return c.figure(name, title, height).with(line(&rows));
        }
        let ends = rows.iter().flat_map(|row| row.at.iter());
        // The same units on both axes.
        let most = ends.fold(0.0, |most: f64, (x, se)| {
            most.max(x.abs() + se.unwrap_or(0.0))
        });
        let mut figure = c.figure(name, title, c.pick(380.0, 300.0));
        figure.columns = dimensions - 1;
        for second in 1..dimensions {
            figure = figure.with(plane(&rows, second, most * 1.1));
        }
        figure
    }))
}

/// One dimension: a row for each realization, in their order along it.
fn line(rows: &[Placed]) -> Panel {
    let mut rows: Vec<&Placed> = rows.iter().collect();
    rows.sort_by(|a, b| a.at[0].0.total_cmp(&b.at[0].0));
    let names: Vec<String> = rows.iter().map(|row| row.name.clone()).collect();
    let ends = rows.iter().flat_map(|row| {
        let (x, se) = row.at[0];
        let se = se.unwrap_or(0.0);
        [x - se, x + se]
    });
    let x = Axis::around("dimension 1, points of the scale", ends);
    let y = Axis::of_names("", &names).reversed();
    let bars = rows.iter().enumerate().filter_map(|(at, row)| {
        let (x, se) = row.at[0];
        Some(Whisker {
            at: at as f64,
            low: x - se?,
            high: x + se?,
        })
    });
    let points = rows.iter().enumerate();
    let points = points.map(|(at, row)| (row.at[0].0, at as f64)).collect();
    let look = Look::plain(PALETTE[0]);
    let bars = Mark::ErrorBarsAcross(bars.collect());
    Panel::new(x, y)
        .with(look, bars)
        .with(look, Mark::Points(points))
}

/// The first dimension, and another one.
fn plane(rows: &[Placed], second: usize, most: f64) -> Panel {
    let axis = |k: usize| Axis::new(&format!("dimension {}", k + 1), -most, most);
    let look = Look::plain(PALETTE[0]);
    let bars = |of: usize, along: usize| {
        let bar = move |row: &Placed| {
            let (x, se) = row.at[of];
            Some(Whisker {
                at: row.at[along].0,
                low: x - se?,
                high: x + se?,
            })
        };
        rows.iter().filter_map(bar).collect()
    };
    let mut panel = Panel::new(axis(0), axis(second))
        .with(look, Mark::ErrorBarsAcross(bars(0, second)))
        .with(look, Mark::ErrorBars(bars(second, 0)));
    let at = |row: &Placed| (row.at[0].0, row.at[second].0);
    panel = panel.with(look, Mark::Points(rows.iter().map(at).collect()));
    panel.labels = (rows.iter())
        .map(|row| Label {
            at: at(row),
            text: shortened(&row.name, 20),
        })
        .collect();
    panel
}
