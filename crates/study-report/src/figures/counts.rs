//! Histograms of the ratings, by realization.

use super::{Canvas, Drawn, Scene, drawn, head, name};
use crate::apa::digits;
use crate::chart::{Axis, Look, Mark, PALETTE, Panel, Span};
use crate::chart::{MAX_LABEL, widest};
use study_analysis::analyze::results::{List, Number as _};

/// Largest number of bins of a histogram.
const MAX_BINS: usize = 21;

/// Largest number of histograms.
const MAX_PANELS: usize = 24;

pub(super) fn histograms(scene: &Scene<'_>) -> Option<Drawn> {
    let all = &scene.a.results.descriptives.desc_all;
    let first = all.hist_from.number()?;
    let bins = all.hist.as_ref()?.numbers()?.len();
    let counts: Vec<&[f64]> = scene
        .models
        .iter()
        .map(|m| {
            let hist = scene.a.described(&m.id).and_then(|d| d.hist.as_ref());
            hist.and_then(List::numbers).unwrap_or(&[])
        })
        .collect();
    let drawable = (1..=MAX_PANELS).contains(&scene.models.len());
    if !drawable || !(1..=MAX_BINS).contains(&bins) || first.abs() > 1000.0 {
        return None;
    }
    let last = first + bins as f64 - 1.0;
    // The whole scale if it is short, including ratings that nobody gave.
    let (low, high) = scene
        .a
        .scale
        .filter(|(from, to)| from.fract() == 0.0 && to - from < MAX_BINS as f64)
        .map_or((first, last), |(from, to)| (first.min(from), last.max(to)));
    let most = counts
        .iter()
        .copied()
        .flatten()
        .copied()
        .fold(1.0, f64::max);
    let mut data = vec![head(["model", "rating", "count"])];
    for (m, counts) in scene.models.iter().zip(&counts) {
        for (b, n) in counts.iter().enumerate() {
            let rating = first + b as f64;
            data.push(vec![m.id.clone(), digits(rating), n.to_string()]);
        }
    }
    let of = match scene.asked.as_str() {
        "rating" => String::new(),
        asked => format!(" of {asked}"),
    };
    let caption = format!(
        "Number of ratings{of} by realization, in the order of {}. All panels have the same axes.",
        scene.order()
    );
    let title = format!("Counts of {} by realization", scene.asked);
    Some(drawn("histograms", caption, data, |c: Canvas| {
        // As many columns as leave room for all titles.
        let title_width = widest(&scene.names(), MAX_LABEL) * 1.1;
        let columns = (1..=c.pick(4, 2))
            .rev()
            .find(|n| title_width <= c.width / f64::from(*n) - 10.0);
        let rows = scene.models.len().div_ceil(columns.unwrap_or(1) as usize);
        let columns = scene.models.len().div_ceil(rows);
        // Many rows are lower, so that they fit on a page beside others.
        let row = c.pick(140.0, if rows > 5 { 92.0 } else { 120.0 });
        let mut figure = c.figure("histograms", &title, row * rows as f64);
        figure.columns = columns;
        for (j, (m, counts)) in scene.models.iter().zip(&counts).enumerate() {
            let under = j + columns >= scene.models.len();
            let label = if under { scene.asked.as_str() } else { "" };
            let x = Axis::new(label, low - 0.6, high + 0.6).without_grid();
            let y = Axis::new(
                if j % columns == 0 { "ratings" } else { "" },
                0.0,
                most * 1.05,
            );
            let bars = counts.iter().enumerate().map(|(b, n)| {
                let at = first + b as f64;
                Span {
                    x: (at - 0.4, at + 0.4),
                    y: (0.0, *n),
                }
            });
            let bars = Mark::Bars(bars.filter(|s| s.y.1 > 0.0).collect());
            figure = figure.with(
                Panel::new(x, y)
                    .titled(&name(m))
                    .with(Look::plain(PALETTE[0]), bars),
            );
        }
        figure
    }))
}
