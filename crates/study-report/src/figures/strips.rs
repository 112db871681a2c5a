//! Ratings that are no whole numbers of a short scale, such as those of a slider: a dot
//! for each rating, wider where there are more.

use super::{Along, Canvas, Drawn, Scene, drawn, head, jitter, rows_height};
use crate::apa::digits;
use crate::chart::{Axis, Color, Look, Mark, PALETTE};
use std::collections::BTreeMap;

/// Largest number of ratings of all realizations.
const MAX_RATINGS: usize = 100_000;

/// Largest number of dots of a realization: others are left out evenly.
const MAX_DOTS: usize = 200;

/// Ratings within this share of all values are neighbors.
const NEAR: f64 = 0.04;

pub(super) fn strips(scene: &Scene<'_>) -> Option<Drawn> {
    if !scene.drawable() || scene.a.counts.rated > MAX_RATINGS {
        return None;
    }
    let mut by: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for row in scene.a.rows.iter().filter(|r| r.excluded.is_none()) {
        if let Some(x) = row.rating {
            by.entry(scene.a.model(row)).or_default().push(x);
        }
    }
    let mut all: Vec<(usize, Vec<f64>)> = Vec::new();
    for (j, m) in scene.models.iter().enumerate() {
        let Some(mut x) = by.remove(m.id.as_str()) else {
            continue;
        };
        x.sort_by(f64::total_cmp);
        let every = x.len().div_ceil(MAX_DOTS);
        all.push((j, x.into_iter().step_by(every).collect()));
    }
    let shown = || all.iter().flat_map(|(_, x)| x.iter().copied());
    let (low, high) = scene.a.scale.unwrap_or_else(|| {
        let low = shown().fold(f64::INFINITY, f64::min);
        (low, shown().fold(f64::NEG_INFINITY, f64::max))
    });
    if all.is_empty() || low >= high {
        return None;
    }
    let mut data = vec![head(["model", "rating"])];
    for (j, x) in &all {
        for rating in x {
            data.push(vec![scene.models[*j].id.clone(), digits(*rating)]);
        }
    }
    let near = NEAR * (high - low);
    let crowds: Vec<Vec<usize>> = all
        .iter()
        .map(|(_, x)| {
            x.iter()
                .map(|v| {
                    x.partition_point(|o| *o <= v + near) - x.partition_point(|o| *o < v - near)
                })
                .collect()
        })
        .collect();
    let most = crowds.iter().flatten().copied().max().unwrap_or(1) as f64;
    let mut dots = Vec::new();
    for ((j, x), crowds) in all.iter().zip(&crowds) {
        for (i, (rating, crowd)) in x.iter().zip(crowds).enumerate() {
            let width = 0.85 * (*crowd as f64 / most).sqrt();
            dots.push((*j as f64 + width * jitter(i), *rating));
        }
    }
    let medians: Vec<(f64, f64)> = (scene.models.iter().enumerate())
        .filter_map(|(j, m)| Some((j as f64, scene.number(&m.id, |d| &d.median)?)))
        .flat_map(|(j, median)| {
            // A point that is not finite ends a line.
            [(j - 0.4, median), (j + 0.4, median), (f64::NAN, f64::NAN)]
        })
        .collect();
    let of = match scene.asked.as_str() {
        "rating" => String::new(),
        asked => format!(" of {asked}"),
    };
    let caption = format!(
        "All ratings{of} by realization, in the order of {}; lines: medians.{}",
        scene.order(),
        if scene.a.counts.rated > dots.len() {
            " Where a realization has many ratings, some are left out evenly."
        } else {
            ""
        }
    );
    let title = format!("Ratings{of} by realization");
    Some(drawn("strips", caption, data, |c: Canvas| {
        let across = scene.across(c);
        let names = Axis::of_names(&scene.realizations(), &scene.names());
        let values = scene.ratings(&scene.asked, &shown().collect::<Vec<_>>());
        let mut faint = Look::plain(PALETTE[0]).stroke(4.0);
        faint.opacity = 0.5;
        let thick = Look::plain(Color::INK).stroke(2.0);
        let panel = Along::new(across, names, values)
            .with(None, faint, Mark::Dots(dots.clone()))
            .with(None, thick, Mark::Line(medians.clone()))
            .panel;
        let height = if across {
            rows_height(scene.models.len()) + 52.0
        } else {
            c.pick(280.0, 260.0)
        };
        c.figure("strips", &title, height).with(panel)
    }))
}
