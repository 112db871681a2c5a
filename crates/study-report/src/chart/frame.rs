//! Layout of panels, margins and legends.

use super::axis::{Axis, MAX_LABEL, Ticks};
use super::{Figure, NORMAL, Panel, SMALL, text_width};

/// Smallest gap between two tick labels, px.
const APART: f64 = 8.0;

/// Smallest distance of turned labels, px.
const LINE: f64 = 13.0;

/// Whether the labels of an x axis of `room` px fit side by side.
fn fit(widest: f64, labels: usize, room: f64) -> bool {
    (widest + APART) * labels as f64 <= room
}

/// Width of the widest name as a tick label, px.
pub(crate) fn widest(names: &[String], columns: usize) -> f64 {
    (names.iter())
        .map(|n| text_width(&super::shortened(n, columns), SMALL))
        .fold(0.0, f64::max)
}

/// Additional height for names below an x axis about `room` px wide, px: 0 if they fit
/// side by side.
pub(crate) fn for_names(names: &[String], room: f64) -> f64 {
    let widest = widest(names, MAX_LABEL);
    if fit(widest, names.len(), room) {
        0.0
    } else {
        widest
    }
}

/// Positions of the parts of a panel, px.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Frame {
    /// Edges of the axes.
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
    /// Left and right edge of the panel.
    pub(super) outer_left: f64,
    pub(super) outer_right: f64,
    /// Upper edge of the panel.
    pub(super) outer_top: f64,
    /// Lower edge of the panel.
    pub(super) outer_bottom: f64,
    /// Ticks of x and y: value, label.
    pub(super) x_ticks: Vec<(f64, String)>,
    pub(super) y_ticks: Vec<(f64, String)>,
    /// Whether the labels of x are turned.
    pub(super) turned: bool,
    /// Left end of the title, and the room for it.
    pub(super) title: (f64, f64),
    /// Legend: index of the series, position of its sample.
    pub(super) legend: Vec<(usize, (f64, f64))>,
}

impl Frame {
    pub(super) fn x(&self, axis: &Axis, value: f64) -> Option<f64> {
        Some(self.left + axis.share(value)? * (self.right - self.left))
    }

    pub(super) fn y(&self, axis: &Axis, value: f64) -> Option<f64> {
        Some(self.bottom - axis.share(value)? * (self.bottom - self.top))
    }
}

/// Width of the sample of a legend entry with the following gap, px.
pub(super) const SAMPLE: f64 = 26.0;
const LEGEND_LINE: f64 = 18.0;

/// The frames of all panels. Those of a column have the same margins, so that axes are
/// aligned; widths between the margins are proportional to [`Panel::breadth`].
pub(super) fn frames(figure: &Figure) -> Vec<Frame> {
    let columns = figure.columns.clamp(1, figure.panels.len().max(1));
    let column = |j: usize| figure.panels.iter().skip(j).step_by(columns);
    let most = |j: usize, of: fn(&Panel) -> f64| column(j).map(of).fold(0.0, f64::max);
    let margins: Vec<(f64, f64)> = (0..columns)
        .map(|j| (most(j, left_margin), most(j, right_margin)))
        .collect();
    let breadths: Vec<f64> = (0..columns).map(|j| most(j, |p| p.breadth)).collect();
    let outside: f64 = margins.iter().map(|m| m.0 + m.1).sum();
    let unit = (figure.width - outside).max(10.0) / breadths.iter().sum::<f64>().max(0.1);
    let rows: Vec<&[Panel]> = figure.panels.chunks(columns).collect();
    let share = |row: &[Panel]| row.iter().map(|p| p.share).fold(0.1, f64::max);
    let whole: f64 = rows.iter().map(|r| share(r)).sum();
    // Panels in a grid have equal heights.
    let labeled = |row: &[Panel]| row.iter().any(|p| !p.x.label.is_empty());
    let anywhere = columns > 1 && labeled(&figure.panels);
    let mut frames = Vec::new();
    let mut top = 0.0;
    for row in rows {
        let height = figure.height * share(row) / whole;
        let mut left = 0.0;
        for (j, panel) in row.iter().enumerate() {
            let right = left + margins[j].0 + unit * breadths[j] + margins[j].1;
            let label = anywhere || labeled(row);
            let outer = (left, top, right, top + height);
            frames.push(frame(panel, outer, margins[j], label));
            left = right;
        }
        top += height;
    }
    // Titles begin at the axes, unless one has no room there.
    let mut titles = figure.panels.iter().zip(&frames);
    if titles.any(|(p, f)| text_width(&p.title, NORMAL) > f.title.1) {
        for f in &mut frames {
            f.title = (f.outer_left + 2.0, f.outer_right - f.outer_left - 4.0);
        }
    }
    frames
}

fn left_margin(panel: &Panel) -> f64 {
    let label = if panel.y.label.is_empty() { 6.0 } else { 24.0 };
    // The number of ticks is not known yet, so take the widest label of several choices.
    let widest = [2, 4, 6, 8, 10]
        .into_iter()
        .flat_map(|most| panel.y.marks(most))
        .map(|(_, l)| text_width(&super::shortened(&l, panel.y.columns), SMALL))
        .fold(0.0, f64::max);
    label + widest + 8.0
}

fn right_margin(panel: &Panel) -> f64 {
    match &panel.color_bar {
        Some(_) => 82.0,
        None => 14.0,
    }
}

fn frame(panel: &Panel, outer: (f64, f64, f64, f64), margins: (f64, f64), label: bool) -> Frame {
    let (outer_left, outer_top, outer_right, outer_bottom) = outer;
    let (left, right) = (outer_left + margins.0, outer_right - margins.1);
    let mut top = outer_top + if panel.title.is_empty() { 8.0 } else { 26.0 };
    let legend = legend(panel, outer_left, (left, right), &mut top);
    let room = right - left;
    let (x_ticks, turned) = x_ticks(&panel.x, room);
    let below = match (x_ticks.is_empty(), turned) {
        (true, _) => 6.0,
        (false, false) => 22.0,
        (false, true) => {
            let widths = x_ticks.iter().map(|(_, l)| text_width(l, SMALL));
            widths.fold(0.0, f64::max) + 12.0
        }
    };
    let label = if label { 22.0 } else { 4.0 };
    let bottom = (outer_bottom - below - label).max(top + 10.0);
    // At least 22 px from tick to tick.
    let most = ((bottom - top) / 22.0).floor().clamp(2.0, 10.0) as usize;
    let shorten = |t: (f64, String)| (t.0, super::shortened(&t.1, panel.y.columns));
    Frame {
        left,
        top,
        right: right.max(left + 10.0),
        bottom,
        outer_left,
        outer_right,
        outer_top,
        outer_bottom,
        x_ticks,
        y_ticks: panel.y.marks(most).into_iter().map(shorten).collect(),
        turned,
        title: (left, right - left),
        legend,
    }
}

/// As many ticks as fit, and whether their labels are turned. Names that do not fit side
/// by side are turned, and if they still do not fit only every n-th is shown.
fn x_ticks(axis: &Axis, room: f64) -> (Vec<(f64, String)>, bool) {
    let widest = |ticks: &[(f64, String)]| {
        let all = ticks.iter().map(|(_, l)| text_width(l, SMALL));
        all.fold(0.0, f64::max)
    };
    if let Ticks::At(given) = &axis.ticks {
        let ticks = given.iter();
        let ticks: Vec<(f64, String)> = ticks
            .map(|(at, l)| (*at, super::shortened(l, axis.columns)))
            .collect();
        if fit(widest(&ticks), ticks.len(), room) {
            return (ticks, false);
        }
        let every = ticks
            .len()
            .div_ceil((room / LINE).floor().max(1.0) as usize);
        return (ticks.into_iter().step_by(every).collect(), true);
    }
    let ticks = (2..=10)
        .rev()
        .map(|most| axis.marks(most))
        .find(|ticks| fit(widest(ticks), ticks.len(), room));
    (ticks.unwrap_or_default(), false)
}

fn legend(
    panel: &Panel,
    outer_left: f64,
    (left, right): (f64, f64),
    top: &mut f64,
) -> Vec<(usize, (f64, f64))> {
    let mut entries = Vec::new();
    // Beside long names there is little room above the axes alone.
    let left = if right - left < 240.0 {
        left.min(outer_left + 8.0)
    } else {
        left
    };
    let (mut x, mut y) = (left, *top + 10.0);
    for (i, series) in panel.series.iter().enumerate() {
        let Some(name) = &series.name else { continue };
        let name = super::shortened(name, MAX_LABEL);
        let width = SAMPLE + text_width(&name, SMALL) + 14.0;
        if x > left && x + width > right {
            x = left;
            y += LEGEND_LINE;
        }
        entries.push((i, (x, y)));
        x += width;
    }
    if !entries.is_empty() {
        *top = y + LEGEND_LINE - 4.0;
    }
    entries
}

/// Distance of the base line of a panel's title from the upper edge, px.
pub(super) const TITLE_BASE: f64 = NORMAL + 4.0;
