//! Values with their intervals, one below the other.

use super::functions::{level_axis, place};
use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head, rows_height};
use crate::apa::digits;
use crate::chart::{Axis, Color, Look, Mark, PALETTE, Panel, Shape, Whisker, shortened};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::results::{CellName, ConditionName};
use study_base::sort::SmallSort as _;
use study_stats::psychometric::Spacing;

/// A value with its interval.
pub(super) struct Row {
    pub(super) name: String,
    pub(super) value: f64,
    pub(super) ci95: Option<(f64, f64)>,
    /// Over participants.
    pub(super) mean: bool,
    /// The same in the pooled model.
    pub(super) together: Option<(f64, (f64, f64))>,
}

impl Row {
    /// Everything that has to be on the axis.
    fn ends(&self) -> impl Iterator<Item = f64> {
        let (low, high) = self.ci95.unwrap_or((self.value, self.value));
        let together = self.together.into_iter();
        [low, high, self.value]
            .into_iter()
            .chain(together.flat_map(|(value, (low, high))| [value, low, high]))
    }
}

/// Rows of each condition.
pub(super) type Rows = Vec<(String, Vec<Row>)>;

/// Whether some rows have a value of the pooled model as well.
pub(super) fn have_pooled(panels: &Rows) -> bool {
    let mut rows = panels.iter().flat_map(|(_, rows)| rows);
    rows.any(|row| row.together.is_some())
}

/// The scale on which all rows have a place: levels without one, such as 0 over logarithms, need an axis of
/// levels. And the values that it has to reach.
pub(super) fn scale(panels: &Rows, beside: Option<f64>, spacing: Spacing) -> (Spacing, Vec<f64>) {
    let rows = panels.iter().flat_map(|(_, rows)| rows);
    let ends: Vec<f64> = rows.flat_map(Row::ends).chain(beside).collect();
    match ends.iter().all(|x| spacing.place(*x).is_some()) {
        true => (spacing, ends),
        false => (Spacing::Lin, ends),
    }
}

/// The table of the rows.
pub(super) fn table(panels: &Rows) -> Vec<Vec<String>> {
    let pooled = have_pooled(panels);
    let mut names = head(["condition", "name", "value", "ci95_lo", "ci95_hi"]);
    if pooled {
        names.extend(head(["together", "together_ci95_lo", "together_ci95_hi"]));
    }
    let mut data = vec![names];
    for (condition, rows) in panels {
        for row in rows {
            let mut line = vec![
                condition.clone(),
                row.name.clone(),
                digits(row.value),
                cell(row.ci95.map(|e| e.0)),
                cell(row.ci95.map(|e| e.1)),
            ];
            if pooled {
                let ends = row.together.map(|t| t.1);
                line.push(cell(row.together.map(|t| t.0)));
                line.extend([cell(ends.map(|e| e.0)), cell(ends.map(|e| e.1))]);
            }
            data.push(line);
        }
    }
    data
}

/// How a value is drawn: a disc, and a diamond of a mean, behind which the others are pale.
pub(super) fn alone(mean: bool, behind: bool) -> Look {
    let look = Look::plain(PALETTE[0]);
    match (mean, behind) {
        (true, _) => look.shaped(Shape::Diamond).stroke(2.2).size(9.0),
        (false, true) => look.stroke(1.3).size(6.0).pale(),
        (false, false) => look.stroke(1.5).size(7.0),
    }
}

/// How the same is drawn in the pooled model: an open ring.
pub(super) fn together(mean: bool) -> Look {
    let look = Look::plain(PALETTE[1]).shaped(Shape::Ring);
    match mean {
        true => look.stroke(2.2).size(9.0),
        false => look.stroke(1.3).size(7.0).pale(),
    }
}

/// Values with their intervals, one below the other, in a panel for each condition. The interval of the
/// mean is shaded through all rows.
pub(super) fn forest(
    name: &str,
    (title, caption, label): (&str, String, &str),
    panels: Rows,
    (zero, spacing): (Option<f64>, Spacing),
) -> Option<Drawn> {
    let most = panels.iter().map(|p| p.1.len()).max()?;
    if most == 0 || most > MAX_DRAWN {
        return None;
    }
    let (pooled, data) = (have_pooled(&panels), table(&panels));
    let (spacing, ends) = scale(&panels, zero, spacing);
    // Two marks of a row, one below the other.
    let (above, below) = if pooled { (0.17, 0.19) } else { (0.0, 0.0) };
    let panel = |(condition, rows): &(String, Vec<Row>)| {
        let names: Vec<String> = rows.iter().map(|r| shortened(&r.name, 20)).collect();
        let mut axis = Axis::of_names("", &names).reversed();
        axis.columns = 20;
        let (low, high) = (axis.low, axis.high);
        let mut panel = Panel::new(level_axis(spacing, label, ends.iter().copied()), axis);
        panel.title = shortened(condition, 30);
        let across = |at: f64| Mark::Line(vec![(at, low), (at, high)]);
        let mean = rows.iter().find(|row| row.mean);
        if let Some((from, to)) = mean.and_then(|row| row.ci95) {
            let [from, to] = [from, to].map(|x| (place(spacing, x), low, high));
            let band = alone(true, false).opacity(0.13);
            panel = panel.with(band, Mark::Area(vec![from, to]));
        }
        if let Some(zero) = zero {
            panel = panel.with(Look::plain(Color::INK).stroke(1.0), across(zero));
        }
        for of_mean in [false, true] {
            let own = || rows.iter().enumerate().filter(|(_, r)| r.mean == of_mean);
            let bars = own().filter_map(|(i, r)| {
                let (low, high) = r.ci95?;
                let (low, high) = (place(spacing, low), place(spacing, high));
                let at = i as f64 - above;
                Some(Whisker { at, low, high })
            });
            let look = alone(of_mean, mean.is_some());
            panel = panel.with(look, Mark::ErrorBarsAcross(bars.collect()));
            let points = own().map(|(i, r)| (place(spacing, r.value), i as f64 - above));
            let points = Mark::Points(points.collect());
            panel = match pooled && !of_mean {
                true => panel.named("each alone", look, points),
                false => panel.with(look, points),
            };
            if !pooled {
                continue;
            }
            let look = together(of_mean);
            let pooled = || own().filter_map(|(i, r)| Some((i as f64 + below, r.together?)));
            let bars = pooled().map(|(at, (_, (low, high)))| Whisker {
                at,
                low: place(spacing, low),
                high: place(spacing, high),
            });
            panel = panel.with(look, Mark::ErrorBarsAcross(bars.collect()));
            let points = pooled().map(|(at, (value, _))| (place(spacing, value), at));
            let points = Mark::Points(points.collect());
            panel = match of_mean {
                false => panel.named("learned together", look, points),
                true => panel.with(look, points),
            };
        }
        panel
    };
    let row = rows_height(most) * if pooled { 1.3 } else { 1.0 };
    let around = if pooled { 90.0 } else { 70.0 };
    Some(drawn(name, caption, data, |c: Canvas| {
        let columns = c.pick(2, 1).min(panels.len());
        let rows = panels.len().div_ceil(columns) as f64;
        let mut figure = c.figure(name, title, rows * (row + around));
        figure.columns = columns;
        figure.panels = panels.iter().map(panel).collect();
        figure
    }))
}

/// A number, and its interval.
pub(super) type Estimated = (Option<f64>, Option<(f64, f64)>);

/// Participants of a condition with a value, then the mean.
pub(super) fn by_condition<R>(
    cells: &BTreeMap<CellName, R>,
    value: impl Fn(&R) -> Estimated,
    mean: impl Fn(&ConditionName) -> Option<Estimated>,
) -> Rows {
    let mut cells: Vec<(&CellName, &R)> = cells.iter().collect();
    cells.small_sort_by_key(|(name, _)| &name.condition);
    let row = |name: &str, (value, ci95): Estimated, mean: bool| {
        Some(Row {
            name: name.to_owned(),
            value: value?,
            ci95,
            mean,
            together: None,
        })
    };
    let conditions = cells.chunk_by(|a, b| a.0.condition == b.0.condition);
    let rows = conditions.map(|own| {
        let condition = &own[0].0.condition;
        let of_cell =
            |(cell, found): &(&CellName, &R)| row(cell.participant.as_str(), value(found), false);
        let mut rows: Vec<Row> = own.iter().filter_map(of_cell).collect();
        if rows.len() > 1 {
            rows.extend(mean(condition).and_then(|mean| row("mean", mean, true)));
        }
        (condition.as_str().to_owned(), rows)
    });
    rows.filter(|(_, rows)| !rows.is_empty()).collect()
}
