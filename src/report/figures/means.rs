//! Means of the realizations: Fig. 10, Fig. 11, and the mean rating against VAF.

use super::{Canvas, Drawn, Scene, cell, drawn, head};
use crate::report::chart::{Anchor, Axis, Figure, Look, Mark, Note, Panel, Whisker};
use crate::report::chart::{PALETTE, SMALL, for_names, shortened, text_width};
use crate::report::csv::digits;
use crate::report::{apa, sentences};

/// Index, mean and standard deviation of each realization.
fn deviations(scene: &Scene<'_>) -> Vec<(f64, f64, f64)> {
    let each = scene.models.iter().enumerate();
    each.filter_map(|(i, m)| {
        let mean = scene.number(&m.id, "mean")?;
        Some((i as f64, mean, scene.number(&m.id, "sd").unwrap_or(0.0)))
    })
    .collect()
}

fn rating_panel(scene: &Scene<'_>, x_label: &str) -> Panel {
    let means = deviations(scene);
    let beyond: Vec<f64> = means.iter().flat_map(|m| [m.1 - m.2, m.1 + m.2]).collect();
    let label = format!("{}, mean ± SD", scene.asked);
    let look = Look::plain(PALETTE[0]);
    let bars = means.iter().filter(|m| m.2 > 0.0).map(|m| Whisker {
        at: m.0,
        low: m.1 - m.2,
        high: m.1 + m.2,
    });
    Panel::new(
        Axis::of_names(x_label, &scene.names()),
        scene.ratings(&label, &beyond),
    )
    .with(look, Mark::ErrorBars(bars.collect()))
    .with(
        look.size(9.0),
        Mark::Points(means.iter().map(|m| (m.0, m.1)).collect()),
    )
}

/// The figure of the paper that this one reproduces, if the realizations are of that kind.
fn as_in(scene: &Scene<'_>, figure: u8) -> String {
    if scene.a.has_memory() {
        format!(", as in Fig. {figure} of Colton & Hollerbach (World Haptics 2007)")
    } else {
        String::new()
    }
}

pub(super) fn fig10(scene: &Scene<'_>) -> Option<Drawn> {
    if !scene.drawable() || deviations(scene).is_empty() {
        return None;
    }
    let mut data = vec![head(["model", "n", "mean", "sd"])];
    for m in &scene.models {
        let mut row = vec![m.id.clone()];
        row.extend(["n", "mean", "sd"].map(|s| cell(scene.number(&m.id, s))));
        data.push(row);
    }
    let caption = format!(
        "Mean {} of each realization. Error bars: ± 1 standard deviation over all of its ratings \
         (n − 1){}.",
        scene.asked,
        as_in(scene, 10)
    );
    let title = format!("Mean {} by realization", scene.asked);
    Some(drawn("fig10-means", caption, data, |c: Canvas| {
        let height = c.pick(280.0, 250.0) + for_names(&scene.names(), c.width - 60.0);
        c.figure("fig10-means", &title, height)
            .with(rating_panel(scene, "realization"))
    }))
}

pub(super) fn fig11(scene: &Scene<'_>) -> Option<Drawn> {
    let vaf: Vec<(f64, f64)> = scene
        .models
        .iter()
        .enumerate()
        .filter_map(|(i, m)| Some((i as f64, m.vaf?)))
        .collect();
    if !scene.drawable() || vaf.is_empty() || deviations(scene).is_empty() {
        return None;
    }
    let mut data = vec![head(["model", "mean", "sd", "vaf"])];
    for m in &scene.models {
        let mut row = vec![m.id.clone()];
        row.extend(["mean", "sd"].map(|s| cell(scene.number(&m.id, s))));
        row.push(cell(m.vaf));
        data.push(row);
    }
    let caption = format!(
        "Mean {} (above) and variance accounted for{} (below) of each realization{}.",
        scene.asked,
        if scene.a.has_memory() {
            " on the validation recording"
        } else {
            ""
        },
        as_in(scene, 11)
    );
    let title = format!("{} and VAF by realization", scene.asked);
    Some(drawn("fig11-rating-and-vaf", caption, data, |c: Canvas| {
        let mut above = rating_panel(scene, "");
        above.x = above.x.bare();
        above.share = 1.1;
        let axis = Axis::around("VAF", vaf.iter().map(|v| v.1));
        let names = Axis::of_names("realization", &scene.names());
        let look = Look::nth(1).size(9.0);
        let below = Panel::new(names, axis).with(look, Mark::Points(vaf.clone()));
        let height = c.pick(420.0, 390.0) + for_names(&scene.names(), c.width - 60.0);
        c.figure("fig11-rating-and-vaf", &title, height)
            .with(above)
            .with(below)
    }))
}

/// A realization as a point.
struct Dot {
    /// Index of the realization.
    nth: usize,
    vaf: f64,
    mean: f64,
    ci95: Option<(f64, f64)>,
}

pub(super) fn against_vaf(scene: &Scene<'_>) -> Option<Drawn> {
    let each = scene.models.iter().enumerate();
    let dots: Vec<Dot> = each
        .filter_map(|(nth, m)| {
            let get = |what: &str| scene.number(&m.id, &format!("subject_mean/{what}"));
            Some(Dot {
                nth,
                vaf: m.vaf?,
                mean: get("mean")?,
                ci95: get("ci95_lo").zip(get("ci95_hi")),
            })
        })
        .collect();
    if !scene.drawable() || dots.len() < 2 {
        return None;
    }
    let mut data = vec![head(["model", "vaf", "mean", "ci95_lo", "ci95_hi"])];
    for d in &dots {
        data.push(vec![
            scene.models[d.nth].id.clone(),
            digits(d.vaf),
            digits(d.mean),
            cell(d.ci95.map(|e| e.0)),
            cell(d.ci95.map(|e| e.1)),
        ]);
    }
    let v = &scene.a.values;
    let found = v.number("corr/pearson/r").map_or_else(String::new, |r| {
        let p = sentences::permutation_p(scene.a, "pearson");
        format!(" Over the tested realizations r = {}{p}.", apa::r(r))
    });
    let bars = if dots.iter().any(|d| d.ci95.is_some()) {
        " Error bars: 95 % t intervals over subjects; they do not generalise to other \
         realizations."
    } else {
        ""
    };
    let caption = format!(
        "Mean {} over subjects against VAF (variance accounted for).{bars}{found}",
        scene.asked
    );
    let title = format!("Mean {} against VAF", scene.asked);
    Some(drawn("rating-against-vaf", caption, data, |c: Canvas| {
        plane(scene, &dots, &title, c)
    }))
}

fn plane(scene: &Scene<'_>, dots: &[Dot], title: &str, c: Canvas) -> Figure {
    let beyond: Vec<f64> = dots
        .iter()
        .flat_map(|d| {
            let (low, high) = d.ci95.unwrap_or((d.mean, d.mean));
            [low, high, d.mean]
        })
        .collect();
    let with = dots.iter().any(|d| d.ci95.is_some());
    let label = format!(
        "{}, mean{}",
        scene.asked,
        if with { " [95 % CI]" } else { "" }
    );
    let mut height = c.pick(360.0, 320.0);
    let axes = Panel::new(
        Axis::around("VAF", dots.iter().map(|d| d.vaf)),
        scene.ratings(&label, &beyond),
    );
    // The approximate size of the axes.
    let room = (c.width - 70.0, height - 60.0);
    let names: Vec<String> = (dots.iter())
        .map(|d| shortened(&scene.models[d.nth].id, 22))
        .collect();
    let (mut notes, crowded) = labels(&names, dots, &axes, room);
    if crowded {
        // Use numbers, which fit, and explain them in the legend.
        let numbers: Vec<String> = (1..=dots.len()).map(|n| n.to_string()).collect();
        notes = labels(&numbers, dots, &axes, room).0;
        let widths = names.iter().map(|n| text_width(n, SMALL) + 52.0);
        height += 18.0 * (widths.sum::<f64>() / (c.width - 80.0)).ceil();
    }
    let mut panel = axes;
    for (i, d) in dots.iter().enumerate() {
        let look = Look::nth(d.nth);
        if let Some((low, high)) = d.ci95 {
            let at = d.vaf;
            let bar = Mark::ErrorBars(vec![Whisker { at, low, high }]);
            panel = panel.with(look, bar);
        }
        let point = Mark::Points(vec![(d.vaf, d.mean)]);
        panel = if crowded {
            panel.named(&format!("{} {}", i + 1, names[i]), look.size(10.0), point)
        } else {
            panel.with(look.size(10.0), point)
        };
    }
    panel.notes = notes;
    c.figure("rating-against-vaf", title, height).with(panel)
}

/// A box, px: left, top, right, bottom.
type Box = (f64, f64, f64, f64);

fn overlap(a: &Box, b: &Box) -> bool {
    !(a.2 < b.0 || b.2 < a.0 || a.3 < b.1 || b.3 < a.1)
}

/// Labels of the dots that overlap no other label or dot and as few error bars as
/// possible; and whether this failed for any label.
fn labels(texts: &[String], dots: &[Dot], panel: &Panel, room: (f64, f64)) -> (Vec<Note>, bool) {
    let position = |x: f64, y: f64| {
        let share = |v: f64, axis: &Axis| (v - axis.low) / (axis.high - axis.low);
        (
            share(x, &panel.x) * room.0,
            (1.0 - share(y, &panel.y)) * room.1,
        )
    };
    let mut names: Vec<Box> = Vec::new();
    let mut bars: Vec<Box> = Vec::new();
    for d in dots {
        let (x, y) = position(d.vaf, d.mean);
        names.push((x - 5.0, y - 5.0, x + 5.0, y + 5.0));
        if let Some((low, high)) = d.ci95 {
            let (top, bottom) = (position(d.vaf, high).1, position(d.vaf, low).1);
            bars.push((x - 3.0, top, x + 3.0, bottom));
        }
    }
    // From the lowest dot upwards, so that displaced labels keep the order of the dots.
    let mut upwards: Vec<(&Dot, &String)> = dots.iter().zip(texts).collect();
    upwards.sort_by(|a, b| a.0.mean.total_cmp(&b.0.mean));
    let (mut notes, mut crowded) = (Vec::new(), false);
    for (d, text) in upwards {
        let (x, y) = position(d.vaf, d.mean);
        let width = text_width(text, SMALL);
        let boxed = |c: &(Anchor, f64, f64)| -> Box {
            let left = if c.0 == Anchor::Start {
                x + c.1
            } else {
                x + c.1 - width
            };
            (left, y + c.2 - 7.0, left + width, y + c.2 + 7.0)
        };
        let cost = |c: &(Anchor, f64, f64)| -> usize {
            let own = boxed(c);
            let outside = own.0 < 0.0 || own.2 > room.0 || own.1 < 0.0 || own.3 > room.1;
            let covered = |all: &[Box]| all.iter().filter(|b| overlap(b, &own)).count();
            100 * usize::from(outside) + 10 * covered(&names) + covered(&bars)
        };
        let mut best = (Anchor::Start, 9.0, 0.0);
        for step in 0..9 {
            // Vertical offsets 0, −14, 14, −28, 28 …, with growing horizontal offsets.
            let down = 14.0 * f64::from((step + 1) / 2) * if step % 2 == 1 { -1.0 } else { 1.0 };
            let aside = 9.0 + 0.3 * down.abs();
            for c in [(Anchor::Start, aside, down), (Anchor::End, -aside, down)] {
                if cost(&c) < cost(&best) {
                    best = c;
                }
            }
        }
        crowded |= cost(&best) >= 10;
        names.push(boxed(&best));
        let note = Note::new((d.vaf, d.mean), text);
        notes.push(note.moved(best.1, best.2).anchored(best.0));
    }
    (notes, crowded)
}
