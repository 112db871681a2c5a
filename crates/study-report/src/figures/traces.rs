//! Force against position in some playbacks.

use super::{Canvas, Drawn, Scene, Trace, drawn, head};
use crate::chart::{Axis, Look, Mark, Panel};

/// Largest number of points of a trace.
const MAX_POINTS: usize = 400;

/// Largest number of traces of a realization.
const MAX_TRACES: usize = 3;

/// Largest number of realizations.
const MAX_PANELS: usize = 24;

/// Every n-th point, so that at most [`MAX_POINTS`] remain.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let every = points.len().div_ceil(MAX_POINTS).max(1);
    points.iter().copied().step_by(every).collect()
}

pub(super) fn traces(scene: &Scene<'_>, traces: &[Trace]) -> Option<Drawn> {
    let shown: Vec<(&str, Vec<&Trace>)> = scene
        .models
        .iter()
        .filter_map(|m| {
            let own = traces
                .iter()
                .filter(|t| t.model == m.id && t.points.len() > 1);
            let own: Vec<&Trace> = own.take(MAX_TRACES).collect();
            (!own.is_empty()).then_some((m.id.as_str(), own))
        })
        .take(MAX_PANELS)
        .collect();
    if shown.is_empty() {
        return None;
    }
    let all = || shown.iter().flat_map(|(_, t)| t).flat_map(|t| &t.points);
    let measured = shown.iter().flat_map(|(_, t)| t).all(|t| t.measured);
    let force = if measured {
        "force (N)"
    } else {
        "commanded force (N)"
    };
    let (x, y) = (
        Axis::around("position (mm)", all().map(|p| p.0)),
        Axis::around(force, all().map(|p| p.1)),
    );
    let mut data = vec![head(["model", "playback", "x_mm", "force_n"])];
    for (model, own) in &shown {
        for t in own {
            for (x, f) in thinned(&t.points) {
                data.push(vec![
                    (*model).to_owned(),
                    t.label.clone(),
                    x.to_string(),
                    f.to_string(),
                ]);
            }
        }
    }
    let labels: Vec<&str> = shown
        .iter()
        .flat_map(|(_, own)| own.iter().map(|t| t.label.as_str()))
        .take(6)
        .collect();
    let more = if shown.iter().map(|(_, t)| t.len()).sum::<usize>() > labels.len() {
        ", …"
    } else {
        ""
    };
    let caption = format!(
        "Force against position in some playbacks ({}{more}), from a subset of the telemetry samples; one color per playback. {}",
        labels.join(", "),
        if measured {
            "Measured force."
        } else {
            "Commanded force: no force was measured."
        }
    );
    Some(drawn("telemetry", caption, data, |c: Canvas| {
        let columns = c.pick(3, 2).min(shown.len());
        let rows = shown.len().div_ceil(columns);
        let title = "Force against position in some playbacks";
        // Many rows are lower, so that they fit on a page beside others.
        let row = c.pick(176.0, if rows > 3 { 128.0 } else { 156.0 });
        let mut figure = c.figure("telemetry", title, row * rows as f64);
        figure.columns = columns;
        for (j, (model, own)) in shown.iter().enumerate() {
            let mut x = x.clone();
            if j + columns < shown.len() {
                x.label.clear();
            }
            let mut y = y.clone();
            if j % columns > 0 {
                y.label.clear();
            }
            let mut panel = Panel::new(x, y).titled(model);
            for (k, t) in own.iter().enumerate() {
                let mut look = Look::nth(k).stroke(2.0);
                look.opacity = 0.7;
                panel = panel.with(look, Mark::Dots(thinned(&t.points)));
            }
            figure = figure.with(panel);
        }
        figure
    }))
}
