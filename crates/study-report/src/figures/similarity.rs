//! The map of the realizations, in which distances stand for differences.

use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head, rows_height};
use crate::apa::{percent, plain};
use crate::chart::{Axis, Label, Look, Mark, PALETTE, Panel, Whisker, shortened};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::psychophysics::results::Place;
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;

/// Width and height of labels and ticks of axes, px.
const MARGINS: f64 = 56.0;

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
    let stress = found.map_stress.number().map_or_else(String::new, plain);
    let axes = match dimensions {
        1 => "only distances have a meaning, no place and no direction",
        _ => "axes have no meaning of their own, and a unit is as long on both",
    };
    let caption = format!(
        "Map of the realizations: distances stand for differences, in points of the scale; {axes}. Bars: one standard \
         error over participants to both sides. Stress {stress}."
    );
    let title = "Map of perceived differences";
    Some(drawn(name, caption, data, |c: Canvas| {
        if dimensions == 1 {
            let height = 56.0 + rows_height(rows.len());
            return c.figure(name, title, height).with(line(&rows));
        }
        let columns = c.pick(dimensions - 1, 1);
        let width = (c.width / columns as f64 - MARGINS).max(1.0);
        let planes: Vec<Panel> = (1..dimensions).map(|second| plane(&rows, second)).collect();
        // As high as the highest needs, within what is easy to look at.
        let share = |p: &Panel| (p.y.high - p.y.low) / (p.x.high - p.x.low);
        let height = planes.iter().map(|p| share(p) * width).fold(0.0, f64::max);
        let height = height.clamp(c.pick(220.0, 180.0), c.pick(360.0, 300.0)) + MARGINS;
        let lines = planes.len().div_ceil(columns);
        let mut figure = c.figure(name, title, height * lines as f64);
        figure.columns = columns;
        figure.panels = planes;
        figure.isometric()
    }))
}

/// The map that participants share, and how each weighs its dimensions.
pub(super) fn weights(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let found = &part.results.over.similarity.as_ref()?.weights;
    let axes = |all: [Option<f64>; 3]| -> Vec<(f64, Option<f64>)> {
        all.into_iter().flatten().map(|x| (x, None)).collect()
    };
    let places = found.map.iter().map(|(name, at)| Placed {
        name: name.as_str().to_owned(),
        at: axes([at.x.number(), at.y.number(), at.z.number()]),
    });
    let people = found.participants.iter().map(|(name, own)| Placed {
        name: name.as_str().to_owned(),
        at: axes([own.x.number(), own.y.number(), own.z.number()]),
    });
    let (places, people): (Vec<Placed>, Vec<Placed>) = (places.collect(), people.collect());
    let dimensions = people.first()?.at.len();
    if places.len().max(people.len()) > MAX_DRAWN {
        return None;
    }
    let mut data = vec![head(["what", "name", "x", "y", "z"])];
    for (what, rows) in [("realization", &places), ("participant", &people)] {
        data.extend(rows.iter().map(|row| {
            let at = (0..3).map(|k| cell(row.at.get(k).map(|at| at.0)));
            let names = [what.to_owned(), row.name.clone()];
            names.into_iter().chain(at).collect()
        }));
    }
    let fit = found.fit.number().map_or_else(String::new, percent);
    let caption = format!(
        "A map that participants share (INDSCAL), whose dimensions each of them weighs: the realizations, and the weights of the participants. A \
         squared weight is about the share of the participant's scalar products for which the dimension accounts; the map accounts for \
         {fit} of all. As far as participants weigh the dimensions differently, its axes cannot be turned as those of other maps."
    );
    let title = "Dimensions that participants share, and their weights";
    Some(drawn(name, caption, data, |c: Canvas| {
        let columns = c.pick(2, 1);
        let mut panels = Vec::new();
        for second in 1..dimensions {
            let mut map = plane(&places, second);
            map.title = "realizations".to_owned();
            let mut weights = plane(&people, second);
            weights.title = "participants".to_owned();
            weights.x.label = "weight of dimension 1".to_owned();
            weights.y.label = format!("weight of dimension {}", second + 1);
            panels.extend([map, weights]);
        }
        let lines = panels.len().div_ceil(columns);
        let mut figure = c.figure(name, title, c.pick(340.0, 300.0) * lines as f64);
        figure.columns = columns;
        figure.panels = panels;
        figure
    }))
}

/// One dimension: a row for each realization, in their order along it.
fn line(rows: &[Placed]) -> Panel {
    let mut rows: Vec<&Placed> = rows.iter().collect();
    rows.small_sort_by(|a, b| a.at[0].0.total_cmp(&b.at[0].0));
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
fn plane(rows: &[Placed], second: usize) -> Panel {
    let axis = |k: usize| {
        let ends = rows.iter().flat_map(|row| {
            let (x, se) = row.at[k];
            let se = se.unwrap_or(0.0);
            [x - se, x + se]
        });
        Axis::around(&format!("dimension {}", k + 1), ends)
    };
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

#[cfg(test)]
mod tests {
    use super::super::parts::of_part;
    use super::*;
    use study_analysis::analyze::psychophysics::{Properties, SimilarityRow, similarity};
    use study_analysis::preregister::complete_parts;

    /// Nine realizations in a space of so many dimensions, with names that are long for the narrow figure; six participants who
    /// perceive them alike.
    fn part(dimensions: usize) -> PartAnalysis {
        let places = [
            [0.0, 0.0, 0.0],
            [9.0, 1.0, 2.0],
            [2.0, 6.0, 1.0],
            [10.0, 7.0, 0.0],
            [5.0, 3.0, 5.0],
            [1.0, 1.5, 5.0],
            [8.0, 4.0, 4.5],
            [4.5, 7.0, 3.0],
            [4.6, 7.1, 2.8],
        ];
        let name = |at: usize| format!("detent-{}-friction-{}", at / 3, at % 3);
        let mut rows = Vec::new();
        for person in 0..6usize {
            for (i, one) in places.iter().enumerate() {
                for (j, other) in places.iter().enumerate().skip(i + 1) {
                    let squares = one.iter().zip(other).take(dimensions);
                    let distance: f64 = squares.map(|(a, b)| (a - b) * (a - b)).sum();
                    let noise = (person * 31 + i * 17 + j * 7) % 11;
                    rows.push(SimilarityRow {
                        participant: format!("P{person}"),
                        first: name(i),
                        second: name(j),
                        rating: (7.0 * distance.sqrt() + 0.5 * noise as f64).round(),
                    });
                }
            }
        }
        let protocol = r#"
format = "study-protocol/3"
study = { id = "example", title = "An example", seed = 1 }
design = { participants = 10 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "apart" }
models = [{ id = "a", file = "a.toml" }, { id = "b", file = "b.toml" }]

[[parts]]
id = "apart"
kind = "similarity"
prompt = "How different?"
same = "alike"
different = "as different as can be"
repetitions = 2
"#;
        let parsed = study_plan::protocol::file::parse("protocol.toml", protocol);
        let mut part = complete_parts(&parsed.protocol.unwrap(), 4).remove(0);
        let found = similarity(&rows, &Properties::new(), (1, "apart"));
        part.results.over.similarity = Some(found);
        part
    }

    /// One dimension is a row for each realization; a plane has them with their names, and three dimensions are two planes.
    #[test]
    fn a_map_has_a_panel_for_each_plane() {
        for (dimensions, seconds) in [(1, 0), (2, 1), (3, 2)] {
            let part = part(dimensions);
            let found = part.results.over.similarity.as_ref().unwrap();
            let chosen = found.map_dimensions.number().unwrap();
            assert!((chosen - dimensions as f64).abs() < 1e-9, "{chosen}");
            let figures = of_part(1, &part);
            let figure = figures.iter().find(|f| f.name == "part-1-map").unwrap();
            assert_eq!(figure.data.lines().count(), 1 + 9);
            for picture in [&figure.wide, &figure.narrow] {
                let svg = picture.to_svg();
                for (at, axis) in [">dimension 2<", ">dimension 3<"].iter().enumerate() {
                    assert_eq!(svg.matches(axis).count(), usize::from(at < seconds));
                }
                // Each name stands once in each panel.
                let names = svg.matches(">detent-2-friction-2<").count();
                assert_eq!(names, seconds.max(1));
            }
            // Realizations and participants of the map with weights, in a panel each.
            let figure = figures.iter().find(|f| f.name == "part-1-weights");
            assert_eq!(figure.is_some(), dimensions > 1);
            if let Some(figure) = figure {
                assert_eq!(figure.data.lines().count(), 1 + 9 + 6);
                let svg = figure.narrow.to_svg();
                assert_eq!(svg.matches(">weight of dimension 1<").count(), seconds);
            }
        }
    }
}
