//! Measured outcomes by realization, a panel for each.

use super::{Along, Canvas, Drawn, Scene, cell, drawn, head, rows_height};
use crate::chart::{Axis, Look, Mark, Whisker};
use study_analysis::analyze::results::{Interval, Number as _, OutcomeMean};
use study_plan::protocol::{OutcomeRules, Transform};

/// Most panels.
const MAX_PANELS: usize = 6;

/// A panel: an outcome, and what is compared by the place of the realization.
struct OfOutcome<'a> {
    rules: &'a OutcomeRules,
    means: Vec<(f64, f64)>,
    whiskers: Vec<Whisker>,
}

/// The means that are compared, with their intervals.
pub(super) fn outcomes(scene: &Scene<'_>) -> Option<Drawn> {
    let a = scene.a;
    let shown: Vec<_> = scene.models.iter().filter(|m| m.tested).collect();
    if !scene.drawable() || shown.is_empty() {
        return None;
    }
    let mut data = vec![head([
        "outcome", "unit", "model", "mean", "ci95_lo", "ci95_hi",
    ])];
    let mut panels: Vec<OfOutcome<'_>> = Vec::new();
    for outcome in a.outcomes.iter().take(MAX_PANELS) {
        let rules = &outcome.rules;
        let record = a.results.outcomes.get(rules.id.as_str())?;
        let (mut means, mut whiskers) = (Vec::new(), Vec::new());
        for (i, model) in shown.iter().enumerate() {
            let found: Option<&OutcomeMean> = record.means.get(model.id.as_str());
            let mean = found.and_then(|m| m.center.number());
            let ends = found.and_then(|m| m.center_ci95.as_ref().and_then(Interval::ends));
            means.extend(mean.map(|mean| (i as f64, mean)));
            whiskers.extend(ends.map(|(low, high)| Whisker {
                at: i as f64,
                low,
                high,
            }));
            data.push(vec![
                rules.id.to_string(),
                rules.measure.unit().to_owned(),
                model.id.clone(),
                cell(mean),
                cell(ends.map(|e| e.0)),
                cell(ends.map(|e| e.1)),
            ]);
        }
        if !means.is_empty() {
            panels.push(OfOutcome {
                rules,
                means,
                whiskers,
            });
        }
    }
    if panels.is_empty() {
        return None;
    }
    let geometric = panels.iter().any(|p| p.rules.transform == Transform::Log);
    let means = match geometric {
        true => "Means over participants, geometric where the logarithm is analyzed,",
        false => "Means over participants",
    };
    let left_out = match a.outcomes.len().saturating_sub(MAX_PANELS) {
        0 => String::new(),
        n => format!(" {n} more are in the table."),
    };
    let caption = format!(
        "Measured outcomes by realization, in the order of {}. {means} with 95 % intervals.{left_out}",
        scene.order()
    );
    let names: Vec<String> = shown.iter().map(|m| super::name(m)).collect();
    Some(drawn("outcomes", caption, data, |c: Canvas| {
        let across = scene.across(c);
        let columns = c.pick(panels.len().min(2), 1);
        let rows = panels.len().div_ceil(columns);
        let each = match across {
            true => rows_height(shown.len()) + 52.0,
            false => c.pick(220.0, 210.0),
        };
        let mut figure = c.figure("outcomes", "Measured outcomes", each * rows as f64);
        figure.columns = columns;
        for panel in &panels {
            let rules = panel.rules;
            let label = format!("{} ({})", rules.measure.noun(), rules.measure.unit());
            let all = (panel.means.iter().map(|m| m.1))
                .chain(panel.whiskers.iter().flat_map(|w| [w.low, w.high]));
            let values = Axis::around(&label, all);
            let names = Axis::of_names(&scene.realizations(), &names);
            let look = Look::nth(0);
            let drawn = Along::new(across, names, values)
                .with(None, look, Mark::ErrorBars(panel.whiskers.clone()))
                .with(None, look, Mark::Points(panel.means.clone()));
            figure = figure.with(drawn.panel.titled(rules.id.as_str()));
        }
        figure
    }))
}
