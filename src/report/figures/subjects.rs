//! Ratings by subject: a heat map, a line for each subject, repetitions.

use super::{Canvas, Drawn, Scene, cell, drawn, head, name};
use crate::report::apa;
use crate::report::chart::{
    Axis, Colour, ColourBar, Look, Mark, Note, PALETTE, Panel, SMALL, Span, for_names, ramp, share,
    shortened, text_width,
};
use std::collections::BTreeMap;
use study_core::analyze::RealizationSummary;
use study_stats::describe::mean;

fn mean_of(scene: &Scene<'_>, subject: &str, model: &str) -> Option<f64> {
    scene.cells.get(&(subject, model)).and_then(|x| mean(x))
}

/// The means of all cells, as CSV rows.
fn table(scene: &Scene<'_>) -> Vec<Vec<String>> {
    let mut data = vec![head(["subject", "model", "n", "mean"])];
    for ((subject, model), x) in &scene.cells {
        data.push(vec![
            (*subject).to_owned(),
            (*model).to_owned(),
            x.len().to_string(),
            cell(mean(x)),
        ]);
    }
    data
}

pub(super) fn cells(scene: &Scene<'_>) -> Option<Drawn> {
    if !scene.with_subjects() {
        return None;
    }
    let mut found = Vec::new();
    for (j, m) in scene.models.iter().enumerate() {
        for (i, s) in scene.subjects.iter().enumerate() {
            if let Some(mean) = mean_of(scene, s, &m.id) {
                found.push(((j as f64, i as f64), mean));
            }
        }
    }
    let all = || found.iter().map(|c| c.1);
    let (low, high) = scene.a.scale.unwrap_or_else(|| {
        let low = all().fold(f64::INFINITY, f64::min);
        (low, all().fold(f64::NEG_INFINITY, f64::max))
    });
    let caption = format!(
        "Mean {} of each participant for each realization, over the repetitions. Darker is higher.",
        scene.asked
    );
    let title = format!("{} by subject and realization", scene.asked);
    let rows = scene.subjects.len();
    Some(drawn(
        "subjects-and-realizations",
        caption,
        table(scene),
        |c: Canvas| {
            let boxes = found.iter().map(|((x, y), mean)| {
                let span = Span {
                    x: (x - 0.5, x + 0.5),
                    y: (y - 0.5, y + 0.5),
                };
                (span, *mean)
            });
            let mut subjects = Axis::of_names("subject", &scene.subjects);
            // The first one is at the top.
            (subjects.low, subjects.high) = (subjects.high, subjects.low);
            let heat = Mark::Heat {
                cells: boxes.collect(),
                low,
                high,
            };
            let mut panel = Panel::new(Axis::of_names("realization", &scene.names()), subjects)
                .with(Look::plain(PALETTE[0]), heat);
            panel.colour_bar = Some(ColourBar {
                label: scene.asked.clone(),
                low,
                high,
            });
            let widest = (scene.subjects.iter())
                .map(|s| text_width(&shortened(s, 24), SMALL))
                .fold(0.0, f64::max);
            // Width without labels and legend; a cell below 26 px is too narrow for a number.
            let room = c.width - widest - 110.0;
            let wide = room / scene.models.len() as f64 >= 26.0;
            if wide && high.abs() < 1000.0 && low.abs() < 1000.0 {
                panel.notes = found
                    .iter()
                    .map(|(at, mean)| {
                        let paper = ramp(share(*mean, low, high));
                        Note::new(*at, &apa::number(*mean, 1)).on(paper)
                    })
                    .collect();
            }
            // Room for slanted names below the cells.
            let below = for_names(&scene.names(), room);
            let height = 70.0 + c.pick(22.0, 20.0) * rows.max(4) as f64 + below;
            c.figure("subjects-and-realizations", &title, height)
                .with(panel)
        },
    ))
}

/// The realizations, ordered by VAF if all have one.
fn ordered<'s>(scene: &'s Scene<'_>) -> (Vec<&'s RealizationSummary>, bool) {
    let mut models = scene.models.clone();
    let by_vaf = models.iter().all(|m| m.vaf.is_some());
    if by_vaf {
        models.sort_by(|a, b| a.vaf.unwrap_or(0.0).total_cmp(&b.vaf.unwrap_or(0.0)));
    }
    (models, by_vaf)
}

pub(super) fn lines(scene: &Scene<'_>) -> Option<Drawn> {
    if !scene.with_subjects() || scene.models.len() < 2 || scene.subjects.len() < 2 {
        return None;
    }
    let (models, by_vaf) = ordered(scene);
    let order = if by_vaf { " ordered by VAF" } else { "" };
    let caption = format!(
        "Mean {} of each realization{order}, with a grey line for each participant. The thick line is \
         the mean over participants.",
        scene.asked
    );
    let title = format!("{} by participant", scene.asked);
    let names: Vec<String> = models.iter().map(|m| name(m)).collect();
    Some(drawn(
        "subject-lines",
        caption,
        table(scene),
        |c: Canvas| {
            let label = if by_vaf {
                "realization, from low to high VAF"
            } else {
                "realization"
            };
            let along = |get: &dyn Fn(&str) -> Option<f64>| -> Vec<(f64, f64)> {
                let each = models.iter().enumerate();
                each.map(|(j, m)| (j as f64, get(&m.id).unwrap_or(f64::NAN)))
                    .collect()
            };
            let y = scene.ratings(&format!("{}, mean", scene.asked), &[]);
            let y = if scene.a.scale.is_some() {
                y
            } else {
                let all: Vec<f64> = scene.cells.values().filter_map(|x| mean(x)).collect();
                scene.ratings(&y.label, &all)
            };
            let mut panel = Panel::new(Axis::of_names(label, &names), y);
            let mut thin = Look::plain(Colour::GREY).stroke(1.2).size(4.0);
            thin.opacity = 0.55;
            for (i, s) in scene.subjects.iter().enumerate() {
                let line = along(&|m| mean_of(scene, s, m));
                let mark = Mark::Line(line.clone());
                panel = if i == 0 {
                    panel.named("one participant", thin, mark)
                } else {
                    panel.with(thin, mark)
                };
                panel = panel.with(thin, Mark::Points(line));
            }
            let over = along(&|m| scene.number(m, "subject_mean/mean"));
            let thick = Look::plain(PALETTE[0]).stroke(3.0).size(9.0);
            panel = panel
                .named("mean over participants", thick, Mark::Line(over.clone()))
                .with(thick, Mark::Points(over));
            let height = c.pick(320.0, 290.0) + for_names(&names, c.width - 60.0);
            c.figure("subject-lines", &title, height).with(panel)
        },
    ))
}

/// Ratings by realization and repetition.
pub(super) fn order(scene: &Scene<'_>) -> Option<Drawn> {
    let mut by: BTreeMap<(&str, u32), Vec<f64>> = BTreeMap::new();
    for row in scene.a.rows.iter().filter(|r| r.excluded.is_none()) {
        if let Some(x) = row.rating {
            let key = (scene.a.model(row), row.repetition);
            by.entry(key).or_default().push(x);
        }
    }
    let last = by.keys().map(|k| k.1).max().unwrap_or(0);
    let lines = (1..=MAX_LINES).contains(&scene.models.len());
    // A foreign table may number repetitions from 0.
    let first = by.keys().map(|k| k.1).min().unwrap_or(1).min(1);
    if last <= first || last > MAX_REPETITIONS || !lines {
        return None;
    }
    let of = |model: &str, repetition: u32| by.get(&(model, repetition)).and_then(|x| mean(x));
    let over = |repetition: u32| {
        let id = format!("order_repetition/{repetition}/mean");
        scene.a.values.number(&id)
    };
    let mut data = vec![head(["model", "repetition", "mean"])];
    for m in &scene.models {
        for k in first..=last {
            data.push(vec![m.id.clone(), k.to_string(), cell(of(&m.id, k))]);
        }
    }
    let v = &scene.a.values;
    let slope = v.number("order_trial/slope").zip(v.number("order_trial/p"));
    let digits = apa::decimals(v.number("order_trial/se").unwrap_or(0.0), 3);
    let slope = slope.map_or_else(String::new, |(b, p)| {
        format!(
            " Adjusted for subjects and realizations, the rating changes by {} per trial, t test p {}.",
            apa::number(b, digits),
            apa::p(p)
        )
    });
    let caption = format!(
        "Mean {} by repetition, with a line for each realization; black: all realizations.{slope}",
        scene.asked
    );
    let title = format!("{} by repetition", scene.asked);
    Some(drawn("order", caption, data, |c: Canvas| {
        let ticks = (first..=last)
            .map(|k| (f64::from(k), k.to_string()))
            .collect();
        let x = Axis::new("repetition", f64::from(first) - 0.3, f64::from(last) + 0.3)
            .at(ticks)
            .without_grid();
        let all: Vec<f64> = by.values().filter_map(|x| mean(x)).collect();
        let y = scene.ratings(&format!("{}, mean", scene.asked), &all);
        let mut panel = Panel::new(x, y);
        for (i, m) in scene.models.iter().enumerate() {
            let at = |k: u32| (f64::from(k), of(&m.id, k).unwrap_or(f64::NAN));
            let line: Vec<(f64, f64)> = (first..=last).map(at).collect();
            let look = Look::nth(i);
            panel = panel.with(look, Mark::Line(line.clone())).named(
                &name(m),
                look,
                Mark::Points(line),
            );
        }
        let at = |k: u32| (f64::from(k), over(k).unwrap_or(f64::NAN));
        let thick = Look::plain(Colour::INK).stroke(3.0);
        let line: Vec<(f64, f64)> = (first..=last).map(at).collect();
        panel = panel.named("all", thick, Mark::Line(line));
        // Additional height for a long legend.
        let names = scene
            .models
            .iter()
            .map(|m| text_width(&name(m), SMALL) + 40.0);
        let lines = (names.sum::<f64>() / (c.width - 80.0)).ceil();
        let height = c.pick(320.0, 340.0) + 18.0 * (lines - 1.0).max(0.0);
        c.figure("order", &title, height).with(panel)
    }))
}

/// Largest number of repetitions.
const MAX_REPETITIONS: u32 = 30;

/// Largest number of lines.
const MAX_LINES: usize = 12;
