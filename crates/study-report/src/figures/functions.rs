//! Psychometric functions: of each participant with the data, and of all participants of a condition.

use super::{Canvas, Drawn, cell, drawn, head};
use crate::apa::digits;
use crate::chart::{Axis, Figure, Look, Mark, PALETTE, Panel, Whisker, shortened};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::results::{CellName, Function};
use study_analysis::analyze::psychophysics::{LevelData, PartAnalysis};
use study_analysis::analyze::results::{Interval, Number as _};
use study_stats::describe::mean;
use study_stats::psychometric::{Curve, Level, Spacing, pooled};

/// Largest number of panels of a figure.
pub(super) const MAX_PANELS: usize = 12;

/// Height of a row of panels, px.
const ROW: f64 = 168.0;

/// A grid of panels, with as many columns as there is room for.
pub(super) fn grid(c: Canvas, name: &str, title: &str, panels: Vec<Panel>) -> Figure {
    let columns = c.pick(3, 2).min(panels.len().max(1));
    let rows = panels.len().div_ceil(columns);
    let mut figure = c.figure(name, title, ROW * rows as f64 + 24.0);
    figure.columns = columns;
    figure.panels = panels;
    figure
}

/// "; the first 12 of 30 are drawn".
pub(super) fn cut(all: usize) -> String {
    match all > MAX_PANELS {
        true => format!(" The first {MAX_PANELS} of {all} are drawn; the file has all data."),
        false => String::new(),
    }
}

pub(super) fn level_label(part: &PartAnalysis) -> String {
    part.data
        .dimension
        .clone()
        .unwrap_or_else(|| "level".to_owned())
}

/// An axis of levels on the scale of their functions.
pub(super) fn level_axis(
    spacing: Spacing,
    label: &str,
    levels: impl IntoIterator<Item = f64>,
) -> Axis {
    match spacing {
        Spacing::Lin => Axis::around(label, levels),
        Spacing::Log => Axis::of_logarithms(label, levels),
    }
}

/// Where a level is on such an axis.
pub(super) fn place(spacing: Spacing, level: f64) -> f64 {
    spacing.place(level).unwrap_or(f64::NAN)
}

/// What was fitted to a cell.
fn fitted<'a>(part: &'a PartAnalysis, cell: &LevelData) -> Option<&'a Function> {
    let name = CellName::of(&cell.participant, &cell.condition);
    part.results.psy.get(&name)
}

/// The function of a cell, of the posterior, on its scale.
fn curve(part: &PartAnalysis, cell: &LevelData) -> Option<Curve> {
    let means = &fitted(part, cell)?.posterior;
    let gamma = means.gamma.as_ref();
    Some(Curve {
        core: cell.core,
        threshold: cell
            .spacing
            .place(means.threshold.median.as_ref()?.number()?)?,
        width: means.width.mean.number()?,
        gamma: part.data.guess.or_else(|| gamma?.mean.number())?,
        lambda: means.lambda.mean.number()?,
    })
}

pub(super) fn psychometric(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let cells = &part.data.levels;
    if cells.is_empty() {
        return None;
    }
    let mut data = vec![head([
        "participant",
        "condition",
        "level",
        "positive",
        "trials",
        "fitted",
    ])];
    for cell in cells {
        let curve = curve(part, cell);
        for l in &cell.levels {
            data.push(vec![
                cell.participant.clone(),
                cell.condition.clone(),
                digits(l.level),
                digits(l.positive),
                digits(l.trials),
                self::cell(curve.map(|c| c.value(place(cell.spacing, l.level)))),
            ]);
        }
    }
    let shares = share_label(part);
    let all = cells.iter().flat_map(|c| c.levels.iter().map(|l| l.level));
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
        (a.min(x), b.max(x))
    });
    let panel = |cell: &LevelData| {
        let spacing = cell.spacing;
        let x = level_axis(spacing, &level_label(part), [low, high]);
        let (from, to) = (x.low, x.high);
        let mut panel = Panel::new(x, Axis::new(shares, -0.04, 1.04));
        panel.title = format!(
            "{} · {}",
            shortened(&cell.participant, 14),
            shortened(&cell.condition, 18)
        );
        let curve = curve(part, cell);
        if let Some(curve) = curve {
            let at = |i: u32| from + (to - from) * f64::from(i) / 120.0;
            let line = (0..=120).map(|i| (at(i), curve.value(at(i)))).collect();
            panel = panel.with(Look::plain(PALETTE[1]).stroke(1.8), Mark::Line(line));
            let ci95 = fitted(part, cell).and_then(|f| f.posterior.threshold.ci95.as_ref());
            if let Some((low, high)) = ci95.and_then(Interval::ends) {
                let at = curve.value(curve.threshold);
                // What lies beyond the levels is not drawn.
                let (low, high) = (place(spacing, low).max(from), place(spacing, high).min(to));
                let bar = Mark::ErrorBarsAcross(vec![Whisker { at, low, high }]);
                panel = panel.with(Look::plain(PALETTE[1]).stroke(1.8), bar);
            }
        }
        with_points(panel, &cell.levels, spacing, [2.5, 7.5])
    };
    let caption = format!(
        "Psychometric functions. Points: {shares} by level, larger with more trials (up to 2, 7, more). \
         Line: the function of the posterior medians of the threshold and means of the rest. Bar: threshold with its 95 % interval, as far as there are levels.{}",
        cut(cells.len())
    );
    let title = "Psychometric functions by participant and condition";
    Some(drawn(name, caption, data, |c: Canvas| {
        grid(
            c,
            name,
            title,
            cells.iter().take(MAX_PANELS).map(panel).collect(),
        )
    }))
}

/// The same panel with the shares of positive answers by level, in points of three sizes; the numbers of
/// trials are those from which on a point is larger.
fn with_points(
    mut panel: Panel,
    levels: &[Level],
    spacing: Spacing,
    [few, many]: [f64; 2],
) -> Panel {
    for (size, least, most) in [
        (4.0, 0.0, few),
        (6.5, few, many),
        (9.0, many, f64::INFINITY),
    ] {
        let own = (levels.iter()).filter(|l| least <= l.trials && l.trials < most);
        let points = own.map(|l| (place(spacing, l.level), l.positive / l.trials));
        let points = points.collect();
        panel = panel.with(Look::plain(PALETTE[0]).size(size), Mark::Points(points));
    }
    panel
}

/// The functions of all participants of a condition: thin lines, the typical one, and the answers of all.
pub(super) fn of_everybody(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let mut conditions: BTreeMap<&str, Vec<&LevelData>> = BTreeMap::new();
    for cell in &part.data.levels {
        conditions
            .entry(cell.condition.as_str())
            .or_default()
            .push(cell);
    }
    conditions.retain(|_, cells| cells.len() > 1);
    if conditions.is_empty() || conditions.len() > MAX_PANELS {
        return None;
    }
    let typical = |condition: &str, curves: &[Curve], spacing: Spacing| {
        let group = part.results.over.psy_group.get(condition)?;
        let center = &group.posterior_threshold;
        let of = |of: fn(&Curve) -> f64| mean(&curves.iter().map(of).collect::<Vec<f64>>());
        let curve = Curve {
            threshold: spacing.place(center.geometric_mean.number()?)?,
            width: of(|c| c.width)?,
            gamma: of(|c| c.gamma)?,
            lambda: of(|c| c.lambda)?,
            ..*curves.first()?
        };
        Some((curve, center.ci95.ends()))
    };
    let mut data = vec![head([
        "condition",
        "level",
        "positive",
        "trials",
        "typical",
    ])];
    let mut panels = Vec::new();
    let all = part
        .data
        .levels
        .iter()
        .flat_map(|c| c.levels.iter().map(|l| l.level));
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
        (a.min(x), b.max(x))
    });
    let shares = share_label(part);
    for (condition, cells) in &conditions {
        let spacing = cells[0].spacing;
        let curves: Vec<Curve> = cells.iter().filter_map(|cell| curve(part, cell)).collect();
        let typical = typical(condition, &curves, spacing);
        let answers: Vec<Level> = cells.iter().flat_map(|cell| cell.levels.clone()).collect();
        let answers = pooled(&answers);
        for l in &answers {
            data.push(vec![
                (*condition).to_owned(),
                digits(l.level),
                digits(l.positive),
                digits(l.trials),
                cell(typical.map(|t| t.0.value(place(spacing, l.level)))),
            ]);
        }
        let x = level_axis(spacing, &level_label(part), [low, high]);
        let (from, to) = (x.low, x.high);
        let line = |curve: &Curve| {
            let at = |i: u32| from + (to - from) * f64::from(i) / 120.0;
            Mark::Line((0..=120).map(|i| (at(i), curve.value(at(i)))).collect())
        };
        let mut panel =
            Panel::new(x, Axis::new(shares, -0.04, 1.04)).titled(&shortened(condition, 30));
        for own in &curves {
            panel = panel.with(Look::plain(PALETTE[6]).stroke(0.9).pale(), line(own));
        }
        let people = cells.len() as f64;
        panel = with_points(panel, &answers, spacing, [2.5 * people, 7.5 * people]);
        if let Some((curve, ci95)) = typical {
            let look = Look::plain(PALETTE[1]).stroke(2.4);
            panel = panel.with(look, line(&curve));
            if let Some((low, high)) = ci95 {
                let at = curve.value(curve.threshold);
                let (low, high) = (place(spacing, low).max(from), place(spacing, high).min(to));
                panel = panel.with(look, Mark::ErrorBarsAcross(vec![Whisker { at, low, high }]));
            }
        }
        panels.push(panel);
    }
    let caption = format!(
        "Psychometric functions of all participants. Thin lines: their own functions. Thick line: the geometric mean of their thresholds \
         with the means of widths, guesses and lapses; the bar is the 95 % t interval of the mean threshold. Points: {shares} of all answers by level, larger \
         with more trials. Such points lie on a flatter function than anybody's."
    );
    let title = "Psychometric functions of all participants by condition";
    Some(drawn(name, caption, data, |c: Canvas| {
        grid(c, name, title, panels.clone())
    }))
}

/// What the share of positive answers is.
fn share_label(part: &PartAnalysis) -> &'static str {
    match part.data.guess {
        Some(_) => "share correct",
        None => "share of “yes”",
    }
}
