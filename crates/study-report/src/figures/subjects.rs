//! Ratings by subject: a heat map, a line for each subject, repetitions.

use super::{Along, Canvas, Drawn, Scene, cell, drawn, head, name, rows_height};
use crate::apa;
use crate::chart::{
    Axis, Color, ColorBar, Look, MAX_LABEL, Mark, Note, PALETTE, Panel, SMALL, Scale, Span,
    for_names, text_width, widest,
};
use std::collections::BTreeMap;
use study_analysis::analyze::results::Number as _;
use study_stats::describe::mean;

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
            if let Some(mean) = scene.cell(s, &m.id) {
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
        "Mean {} of each participant for each realization, over the repetitions; realizations in \
         the order of {}. Darker is higher.",
        scene.asked,
        scene.order()
    );
    let title = format!("{} by participant and realization", scene.asked);
    let subjects: Vec<String> = scene.subjects.iter().map(|s| (*s).to_owned()).collect();
    let drawn = |c: Canvas| {
        // Realizations stand at the left if they would not fit side by side.
        let across = scene.across(c);
        let (rows, columns) = if across {
            (scene.names(), subjects.clone())
        } else {
            (subjects.clone(), scene.names())
        };
        let place = |(model, subject): (f64, f64)| {
            if across {
                (subject, model)
            } else {
                (model, subject)
            }
        };
        let (x, y) = if across {
            ("participant".to_owned(), "")
        } else {
            (scene.realizations(), "participant")
        };
        let boxes = found.iter().map(|(at, mean)| {
            let (x, y) = place(*at);
            let span = Span {
                x: (x - 0.5, x + 0.5),
                y: (y - 0.5, y + 0.5),
            };
            (span, *mean)
        });
        let scale = Scale::ascending(low, high);
        let heat = Mark::Heat {
            cells: boxes.collect(),
            scale,
        };
        // The first row is at the top.
        let y = Axis::of_names(y, &rows).reversed();
        let mut panel =
            Panel::new(Axis::of_names(&x, &columns), y).with(Look::plain(PALETTE[0]), heat);
        panel.color_bar = Some(ColorBar {
            label: scene.asked.clone(),
            scale,
        });
        // Width without labels and legend; a cell below 26 px is too narrow for a number.
        let room = c.width - widest(&rows, MAX_LABEL) - 110.0;
        if room / columns.len() as f64 >= 26.0 && high.abs() < 1000.0 && low.abs() < 1000.0 {
            panel.notes = found
                .iter()
                .map(|(at, mean)| {
                    let text = apa::number(*mean, 1);
                    Note::new(place(*at), &text).on(scale.color(*mean))
                })
                .collect();
        }
        let below = for_names(&columns, room);
        let height = 56.0 + 18.0 * rows.len().max(4) as f64 + below;
        c.figure("subjects-and-realizations", &title, height)
            .with(panel)
    };
    let name = "subjects-and-realizations";
    Some(super::drawn(name, caption, table(scene), drawn))
}

pub(super) fn lines(scene: &Scene<'_>) -> Option<Drawn> {
    if !scene.with_subjects() || scene.models.len() < 2 || scene.subjects.len() < 2 {
        return None;
    }
    let caption = format!(
        "Mean {} of each realization in the order of {}, with a gray line for each participant. \
         The thick line is the {}mean over participants.",
        scene.asked,
        scene.order(),
        scene.adjusted(),
    );
    let title = format!("{} by participant", scene.asked);
    let along = |get: &dyn Fn(&str) -> Option<f64>| -> Vec<(f64, f64)> {
        let each = scene.models.iter().enumerate();
        each.map(|(j, m)| (j as f64, get(&m.id).unwrap_or(f64::NAN)))
            .collect()
    };
    Some(drawn(
        "subject-lines",
        caption,
        table(scene),
        |c: Canvas| {
            let all: Vec<f64> = scene.cells.values().filter_map(|x| mean(x)).collect();
            let values = scene.ratings(&format!("{}, mean", scene.asked), &all);
            let names = Axis::of_names(&scene.realizations(), &scene.names());
            let across = scene.across(c);
            let mut panel = Along::new(across, names, values);
            let mut thin = Look::plain(Color::GREY).stroke(1.0);
            thin.opacity = 0.5;
            for (i, s) in scene.subjects.iter().enumerate() {
                let line = along(&|m| scene.cell(s, m));
                let name = (i == 0).then_some("one participant");
                // A dot where both neighbors are missing, too.
                let dots = Mark::Dots(line.clone());
                panel = panel
                    .with(name, thin, Mark::Line(line))
                    .with(None, thin.stroke(3.5), dots);
            }
            let over = along(&|m| scene.mean(m));
            let thick = Look::plain(PALETTE[0]).stroke(2.5).size(8.0);
            let panel = panel
                .with(
                    Some("mean over participants"),
                    thick,
                    Mark::Line(over.clone()),
                )
                .with(None, thick, Mark::Points(over));
            let height = if across {
                rows_height(scene.models.len()) + 72.0
            } else {
                c.pick(290.0, 270.0)
            };
            c.figure("subject-lines", &title, height).with(panel.panel)
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
    let order = &scene.a.results.evidence.order;
    let over = |repetition: u32| {
        let all = &order.repetition;
        all.get(&repetition).map(|r| &r.mean).number()
    };
    let mut data = vec![head(["model", "repetition", "mean"])];
    for m in &scene.models {
        for k in first..=last {
            data.push(vec![m.id.clone(), k.to_string(), cell(of(&m.id, k))]);
        }
    }
    let trial = &order.trial;
    let slope = trial.slope.number().zip(trial.p.number());
    let digits = apa::decimals(trial.se.number().unwrap_or(0.0), 3);
    let slope = slope.map_or_else(String::new, |(b, p)| {
        format!(
            " Adjusted for participants and realizations, the rating changes by {} per trial, t test p {}.",
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
        let thick = Look::plain(Color::INK).stroke(3.0);
        let line: Vec<(f64, f64)> = (first..=last).map(at).collect();
        panel = panel.named("all", thick, Mark::Line(line));
        // Additional height for a long legend.
        let names = scene
            .models
            .iter()
            .map(|m| text_width(&name(m), SMALL) + 40.0);
        let lines = (names.sum::<f64>() / (c.width - 80.0)).ceil();
        let height = c.pick(280.0, 230.0) + 18.0 * (lines - 1.0).max(0.0);
        c.figure("order", &title, height).with(panel)
    }))
}

/// Largest number of repetitions.
const MAX_REPETITIONS: u32 = 30;

/// Largest number of lines.
const MAX_LINES: usize = 12;
