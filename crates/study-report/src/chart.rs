//! Charts: axes, ticks, legends, marks.
//!
//! A [`Figure`] is a grid of [`Panel`]s; a panel has two axes, series and notes.
//! Lengths are in px of a [`Picture`], data in the units of their axis. This is no general
//! plotting library: it has what the figures of this program need.
//!
//! Invariants: equal figures give equal bytes, on every machine and in every
//! locale; ids start with the figure's own, so that one page can contain several;
//! text from the data is escaped and cannot leave its element; values that are not
//! finite are not drawn; marks outside the axes are clipped. Colors are safe for
//! color-blind readers and repeated by shape or dash, so that a figure can
//! be read in grayscale.

mod axis;
mod draw;
mod frame;
mod labels;
mod look;

pub use super::picture::{Anchor, Color, text_width};
pub(crate) use axis::MAX_LABEL;
pub use axis::{Axis, Ticks};
pub(crate) use frame::{for_names, widest};
pub use look::{Dash, Look, PALETTE, Scale, Shape};

use super::picture::Picture;
use study_base::text::{Untrusted, cut_middle};

/// Size of tick labels and notes, px: 8 pt on paper.
pub const SMALL: f64 = 12.0;

/// Size of axis labels and titles, px.
pub const NORMAL: f64 = 13.0;

/// A picture with one or more panels.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Prefix of every id in the SVG: letters, digits, `-`. Unique within a page.
    pub id: String,
    /// Text alternative for screen readers. Untrusted.
    pub title: String,
    /// Width, px.
    pub width: f64,
    /// Height, px.
    pub height: f64,
    /// Panels per row, at least one.
    pub columns: usize,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
}

/// Axes and the marks on them.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Title above the panel; empty for none. Untrusted.
    pub title: String,
    /// Axis from left to right.
    pub x: Axis,
    /// Axis from bottom to top.
    pub y: Axis,
    /// Series in drawing order.
    pub series: Vec<Series>,
    /// Text in the panel.
    pub notes: Vec<Note>,
    /// Names of points, placed so that they do not overlap.
    pub labels: Vec<Label>,
    /// Legend of a heat map.
    pub color_bar: Option<ColorBar>,
    /// Width relative to other columns; a column takes the largest of its panels.
    pub breadth: f64,
    /// Height relative to other rows; a row takes the largest of its panels.
    pub share: f64,
}

/// Marks of one appearance.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Legend entry, if any. Untrusted.
    pub name: Option<String>,
    /// Appearance.
    pub look: Look,
    /// The marks.
    pub mark: Mark,
}

/// Marks at positions (x, y) in units of the axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A polyline; a point that is not finite interrupts it.
    Line(Vec<(f64, f64)>),
    /// Small round dots, `stroke` px wide, for thousands of samples.
    Dots(Vec<(f64, f64)>),
    /// Markers.
    Points(Vec<(f64, f64)>),
    /// Vertical error bars with caps.
    ErrorBars(Vec<Whisker>),
    /// Horizontal error bars with caps: `at` is y, the ends are x.
    ErrorBarsAcross(Vec<Whisker>),
    /// A filled area, such as a confidence band: x, its lower and its upper edge.
    Area(Vec<(f64, f64, f64)>),
    /// Filled boxes, such as those of a histogram.
    Bars(Vec<Span>),
    /// Boxes colored by their value.
    Heat {
        /// Boxes and their values.
        cells: Vec<(Span, f64)>,
        /// The colors.
        scale: Scale,
    },
}

/// An error bar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whisker {
    /// Position along the other axis.
    pub at: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A box in units of the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Left and right.
    pub x: (f64, f64),
    /// Bottom and top.
    pub y: (f64, f64),
}

/// Text at a position in a panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// Position in units of the axes.
    pub at: (f64, f64),
    /// Offset to the right and down, px.
    pub by: (f64, f64),
    /// Text. Untrusted.
    pub text: String,
    /// Which part of the text is at the position.
    pub anchor: Anchor,
    /// Color.
    pub color: Color,
    /// Whether it has a white outline, to be readable over lines.
    pub rim: bool,
}

/// The name of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    /// The point, in units of the axes.
    pub at: (f64, f64),
    /// Untrusted.
    pub text: String,
}

/// Legend of a heat map.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorBar {
    /// Label. Untrusted.
    pub label: String,
    /// The colors.
    pub scale: Scale,
}

impl Figure {
    /// An empty figure with one column.
    pub fn new(id: &str, title: &str, width: f64, height: f64) -> Self {
        Self {
            id: id.to_owned(),
            title: title.to_owned(),
            width,
            height,
            columns: 1,
            panels: Vec::new(),
        }
    }

    /// Adds a panel.
    #[must_use]
    pub fn with(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Widens an axis of each panel, so that distances are as long in all directions.
    #[must_use]
    pub fn isometric(mut self) -> Self {
        // An axis that is wider may have wider labels.
        for _ in 0..4 {
            let frames = frame::frames(&self);
            for (panel, frame) in self.panels.iter_mut().zip(frames) {
                let (width, height) = (frame.right - frame.left, frame.bottom - frame.top);
                let (x, y) = (panel.x.high - panel.x.low, panel.y.high - panel.y.low);
                let px = (width / x).min(height / y);
                panel.x.widened(width / px);
                panel.y.widened(height / px);
            }
        }
        self
    }

    /// Whether all labels have a place where they overlap nothing.
    pub fn labels_fit(&self) -> bool {
        (self.panels.iter().zip(frame::frames(self)))
            .all(|(panel, frame)| labels::places(panel, &frame).iter().all(|p| p.is_free))
    }

    /// Draws the figure.
    pub fn picture(&self) -> Picture {
        let mut out = Picture::new(&self.id, &self.title, self.width, self.height);
        for (panel, frame) in self.panels.iter().zip(frame::frames(self)) {
            draw::panel(&mut out, panel, &frame);
        }
        out
    }
}

impl Panel {
    /// An empty panel.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self {
            title: String::new(),
            x,
            y,
            series: Vec::new(),
            notes: Vec::new(),
            labels: Vec::new(),
            color_bar: None,
            breadth: 1.0,
            share: 1.0,
        }
    }

    /// Sets the title.
    #[must_use]
    pub fn titled(mut self, title: &str) -> Self {
        title.clone_into(&mut self.title);
        self
    }

    /// Adds marks without a legend entry.
    #[must_use]
    pub fn with(mut self, look: Look, mark: Mark) -> Self {
        self.series.push(Series {
            name: None,
            look,
            mark,
        });
        self
    }

    /// Adds marks with a legend entry.
    #[must_use]
    pub fn named(mut self, name: &str, look: Look, mark: Mark) -> Self {
        self.series.push(Series {
            name: Some(name.to_owned()),
            look,
            mark,
        });
        self
    }

    /// Adds a note.
    #[must_use]
    pub fn note(mut self, note: Note) -> Self {
        self.notes.push(note);
        self
    }
}

impl Note {
    /// Dark text with an outline, centered at a position.
    pub fn new(at: (f64, f64), text: &str) -> Self {
        Self {
            at,
            by: (0.0, 0.0),
            text: text.to_owned(),
            anchor: Anchor::Middle,
            color: Color::INK,
            rim: true,
        }
    }

    /// Sets the offset to the right and down, px.
    #[must_use]
    pub fn moved(mut self, right: f64, down: f64) -> Self {
        self.by = (right, down);
        self
    }

    /// Black or white text without an outline, for a filled box of color `paper`.
    #[must_use]
    pub fn on(mut self, paper: Color) -> Self {
        self.color = paper.text_on();
        self.rim = false;
        self
    }

    /// Sets the anchor.
    #[must_use]
    pub fn anchored(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }
}

/// A text shortened to at most about `room` px.
pub fn fitted(text: &str, size: f64, room: f64) -> String {
    let mut most = Untrusted(text).to_string().chars().count();
    let mut shown = text.to_owned();
    while most > 1 && text_width(&shown, size) > room {
        most -= 1;
        shown = shortened(text, most);
    }
    shown
}

/// An escaped text of at most some columns, shortened in the middle.
///
/// ```
/// # use study_report::chart::shortened;
/// assert_eq!(shortened("turn-signal-play-0.5", 12), "tur…play-0.5");
/// ```
pub fn shortened(text: &str, columns: usize) -> String {
    cut_middle(&Untrusted(text).to_string(), columns)
}

#[cfg(test)]
mod tests;
