//! Differences between realizations with their intervals.

use super::{Canvas, Drawn, Scene, cell, drawn, head};
use crate::apa::digits;
use crate::chart::{Anchor, MAX_LABEL, Note, shortened, widest};
use crate::chart::{Axis, Color, Look, Mark, PALETTE, Panel, Shape, Whisker};
use study_analysis::analyze::{Pair, Verdict};
use study_base::sort::SmallSort as _;

/// The compared pairs, the higher mean first, the largest difference first.
fn pairs(scene: &Scene<'_>) -> Vec<Pair> {
    let mut found: Vec<Pair> = (scene.a.pairs.iter())
        .map(|p| {
            let higher = if p.difference.value < 0.0 {
                &p.second
            } else {
                &p.first
            };
            p.seen_from(higher)
        })
        .collect();
    found.small_sort_by(|a, b| b.difference.value.total_cmp(&a.difference.value));
    found
}

pub(super) fn forest(scene: &Scene<'_>) -> Option<Drawn> {
    let pairs = pairs(scene);
    if pairs.is_empty() || !scene.drawable() {
        return None;
    }
    let mut data = vec![head([
        "higher",
        "lower",
        "difference",
        "ci95_lo",
        "ci95_hi",
        "p_holm",
    ])];
    for p in &pairs {
        data.push(vec![
            p.first.clone(),
            p.second.clone(),
            digits(p.difference.value),
            cell(p.difference.ci95.map(|e| e.0)),
            cell(p.difference.ci95.map(|e| e.1)),
            cell(p.test.as_ref().map(|t| t.p)),
        ]);
    }
    let tested = scene.models.iter().filter(|m| m.tested).count();
    let which = if pairs.len() == tested * (tested - 1) / 2 {
        "all pairs of realizations".to_owned()
    } else {
        let most = scene.a.better.most();
        format!("the realization with the {most} mean and each other one")
    };
    let caption = format!(
        "Differences of mean {} between {which}, with 95 % intervals that are not corrected for \
         the number of pairs. Filled: significant at {} after Holm's correction.",
        scene.asked,
        crate::sentences::level(scene.a.alpha),
    );
    let title = format!("Differences of {} between realizations", scene.asked);
    Some(drawn("pairs", caption, data, |c: Canvas| {
        let columns = 2 * MAX_LABEL + 3;
        let short = |name: &str| shortened(name, MAX_LABEL);
        let names: Vec<String> = pairs
            .iter()
            .map(|p| format!("{} − {}", short(&p.first), short(&p.second)))
            .collect();
        // Names that would take most of the width stand above their bars.
        let above = widest(&names, columns) > 0.5 * c.width;
        let ends = pairs.iter().flat_map(|p| {
            let (low, high) =
                (p.difference.ci95).unwrap_or((p.difference.value, p.difference.value));
            [low, high, 0.0]
        });
        let mut rows = Axis::of_names("", &names).reversed();
        rows.columns = columns;
        let values = Axis::around(&format!("difference of mean {}", scene.asked), ends);
        let (low, high) = (rows.low, rows.high);
        let mut panel = Panel::new(values, rows);
        if above {
            panel.y = panel.y.bare();
            let left = panel.x.low;
            let notes = names.iter().enumerate().map(|(i, name)| {
                let note = Note::new((left, i as f64), name).moved(4.0, -12.0);
                note.anchored(Anchor::Start)
            });
            panel.notes = notes.collect();
        }
        let zero = Mark::Line(vec![(0.0, low), (0.0, high)]);
        panel = panel.with(Look::plain(Color::INK).stroke(1.0), zero);
        let look = Look::plain(PALETTE[0]).stroke(1.5).size(8.0);
        let bars = pairs.iter().enumerate().filter_map(|(i, p)| {
            let ((low, high), at) = (p.difference.ci95?, i as f64);
            Some(Whisker { at, low, high })
        });
        panel = panel.with(look, Mark::ErrorBarsAcross(bars.collect()));
        for filled in [true, false] {
            let shown = pairs.iter().enumerate();
            let shown = shown.filter(|(_, p)| (p.verdict == Verdict::Yes) == filled);
            let shape = if filled { Shape::Disc } else { Shape::Ring };
            let points = shown.map(|(i, p)| (p.difference.value, i as f64)).collect();
            panel = panel.with(Look { shape, ..look }, Mark::Points(points));
        }
        let row = if above { 28.0 } else { 17.0 };
        let height = row * pairs.len().max(3) as f64 + 52.0;
        c.figure("pairs", &title, height).with(panel)
    }))
}
