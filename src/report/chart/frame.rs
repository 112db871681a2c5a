//! Layout of panels, margins and legends.

use super::axis::{Axis, Ticks};
use super::{Figure, NORMAL, Panel, SMALL, fitted, text_width};

/// Smallest gap between two tick labels, px.
const APART: f64 = 8.0;

/// Largest width of a slanted label, px.
const MAX_SLANTED: f64 = 140.0;

/// An angle: degrees, cosine, sine.
type Angle = (u8, f64, f64);

/// Angles of slanted labels; the flatter one is used if it fits.
const FLAT: Angle = (35, 0.819, 0.574);
const STEEP: Angle = (60, 0.5, 0.866);

/// Smallest distance of the base lines of slanted labels, px.
const LINE: f64 = 12.0;

/// The angle of the labels of an x axis of `room` px; `None` if they fit horizontally.
fn slant(widest: f64, labels: usize, room: f64) -> Option<Angle> {
    if (widest + APART) * labels as f64 <= room {
        None
    } else if room / labels as f64 * FLAT.2 >= LINE {
        Some(FLAT)
    } else {
        Some(STEEP)
    }
}

/// Additional height for slanted labels of an x axis about `room` px wide, px.
pub(in crate::report) fn for_names(names: &[String], room: f64) -> f64 {
    let widths = names
        .iter()
        .map(|n| text_width(&super::shortened(n, MAX_LABEL), SMALL));
    let widest = widths.fold(0.0, f64::max);
    slant(widest, names.len(), room).map_or(0.0, |(_, _, sine)| sine * widest.min(MAX_SLANTED))
}

/// Largest width of a tick label, in columns.
pub(super) const MAX_LABEL: usize = 24;

/// Positions of the parts of a panel, px.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Frame {
    /// Edges of the axes.
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
    /// Left edge of the panel.
    pub(super) outer_left: f64,
    /// Upper edge of the panel.
    pub(super) outer_top: f64,
    /// Lower edge of the panel.
    pub(super) outer_bottom: f64,
    /// Ticks of x and y: value, label.
    pub(super) x_ticks: Vec<(f64, String)>,
    pub(super) y_ticks: Vec<(f64, String)>,
    /// Slant of the labels of x, degrees.
    pub(super) slant: u8,
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

/// The frames of all panels. All have the same left margin, and those of a row the same
/// lower margin, so that axes are aligned.
pub(super) fn frames(figure: &Figure) -> Vec<Frame> {
    let columns = figure.columns.max(1);
    let cell_width = figure.width / columns as f64;
    let rows: Vec<&[Panel]> = figure.panels.chunks(columns).collect();
    let share = |row: &[Panel]| row.iter().map(|p| p.share).fold(0.1, f64::max);
    let whole: f64 = rows.iter().map(|r| share(r)).sum();
    let margin = figure.panels.iter().map(left_margin).fold(0.0, f64::max);
    // Panels in a grid have equal heights.
    let labelled = |row: &[Panel]| row.iter().any(|p| !p.x.label.is_empty());
    let anywhere = columns > 1 && labelled(&figure.panels);
    let mut frames = Vec::new();
    let mut top = 0.0;
    for row in rows {
        let height = figure.height * share(row) / whole;
        for (j, panel) in row.iter().enumerate() {
            let left = cell_width * j as f64;
            let label = anywhere || labelled(row);
            frames.push(frame(
                panel,
                (left, top, left + cell_width, top + height),
                (margin, label),
            ));
        }
        top += height;
    }
    frames
}

fn left_margin(panel: &Panel) -> f64 {
    let label = if panel.y.label.is_empty() { 6.0 } else { 24.0 };
    // The number of ticks is not known yet, so take the widest label of several choices.
    let widest = [2, 4, 6, 8, 10]
        .into_iter()
        .flat_map(|most| panel.y.marks(most))
        .map(|(_, l)| text_width(&super::shortened(&l, MAX_LABEL), SMALL))
        .fold(0.0, f64::max);
    label + widest + 8.0
}

fn frame(panel: &Panel, outer: (f64, f64, f64, f64), (margin, label): (f64, bool)) -> Frame {
    let (outer_left, outer_top, outer_right, outer_bottom) = outer;
    let left = outer_left + margin;
    let right = outer_right
        - match &panel.colour_bar {
            Some(_) => 76.0,
            None => 14.0,
        };
    let mut top = outer_top + if panel.title.is_empty() { 8.0 } else { 26.0 };
    let legend = legend(panel, left, right, &mut top);
    let room = right - left;
    let (x_ticks, angle) = x_ticks(&panel.x, room, left - outer_left);
    let below = match (x_ticks.is_empty(), angle) {
        (true, _) => 6.0,
        (false, None) => 22.0,
        (false, Some((_, _, sine))) => {
            let widest = x_ticks
                .iter()
                .map(|(_, l)| text_width(l, SMALL))
                .fold(0.0, f64::max);
            // Plus the height of the letters.
            widest * sine + 18.0
        }
    };
    let label = if label { 22.0 } else { 4.0 };
    let bottom = (outer_bottom - below - label).max(top + 10.0);
    // At least 22 px from tick to tick.
    let most = ((bottom - top) / 22.0).floor().clamp(2.0, 10.0) as usize;
    let shorten = |t: (f64, String)| (t.0, super::shortened(&t.1, MAX_LABEL));
    Frame {
        left,
        top,
        right: right.max(left + 10.0),
        bottom,
        outer_left,
        outer_top,
        outer_bottom,
        x_ticks,
        y_ticks: panel.y.marks(most).into_iter().map(shorten).collect(),
        slant: angle.map_or(0, |a| a.0),
        legend,
    }
}

/// As many ticks as fit. Names that do not fit are slanted, and if they still do not fit
/// only every n-th is shown. A slanted label extends at most `margin` px to the left
/// of the axis.
fn x_ticks(axis: &Axis, room: f64, margin: f64) -> (Vec<(f64, String)>, Option<Angle>) {
    let widest = |ticks: &[(f64, String)]| {
        let all = ticks.iter().map(|(_, l)| text_width(l, SMALL));
        all.fold(0.0, f64::max)
    };
    if let Ticks::At(given) = &axis.ticks {
        let mut ticks: Vec<(f64, String)> = given
            .iter()
            .map(|(at, l)| (*at, super::shortened(l, MAX_LABEL)))
            .collect();
        let angle = slant(widest(&ticks), ticks.len(), room);
        if let Some((_, cosine, sine)) = angle {
            let fit = (room * sine / LINE).floor().max(1.0) as usize;
            let every = ticks.len().div_ceil(fit);
            let short = |(at, label): (f64, String)| {
                let before = margin + axis.share(at).unwrap_or(0.0) * room;
                let most = MAX_SLANTED.min(before / cosine);
                (at, fitted(&label, SMALL, most))
            };
            ticks = ticks.into_iter().step_by(every).map(short).collect();
        }
        return (ticks, angle);
    }
    let ticks = (2..=10)
        .rev()
        .map(|most| axis.marks(most))
        .find(|ticks| (widest(ticks) + APART) * ticks.len() as f64 <= room);
    (ticks.unwrap_or_default(), None)
}

fn legend(panel: &Panel, left: f64, right: f64, top: &mut f64) -> Vec<(usize, (f64, f64))> {
    let mut entries = Vec::new();
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
