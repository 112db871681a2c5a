//! Figures as SVG: axes, ticks, legends, marks, and nothing that moves.
//!
//! A [`Figure`] is a grid of [`Panel`]s; a panel has two axes, series and notes.
//! Lengths are CSS pixels, data are in the units of their axis. It is no general
//! plotting library: it has what the figures of this program need.
//!
//! Invariants: equal figures give equal bytes, on every machine and in every
//! locale; ids begin with the figure's own, so that several can stand in one
//! page; text from the data is escaped and cannot leave its element; what is not
//! finite is not drawn; what lies outside the axes is clipped. Colours are safe
//! for the colour-blind, and shape, dash or hatching says the same again, so that
//! a figure reads in grey.

mod axis;
mod draw;
mod frame;
mod look;
mod out;

pub use axis::{Axis, Ticks};
pub(in crate::report) use frame::for_names;
pub use look::{Colour, Dash, Fill, Look, PALETTE, Shape, ramp};

use out::Out;

/// The font of every text, first the one that is bundled for PNG.
pub const FONT_FAMILY: &str = "Liberation Sans, Arial, Helvetica, sans-serif";

/// Size of tick labels and notes, px.
pub const SMALL: f64 = 12.0;

/// Size of axis labels and titles, px.
pub const NORMAL: f64 = 13.0;

/// A picture with one or more panels.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Prefix of every id in the SVG: letters, digits, `-`. Unique in a page.
    pub id: String,
    /// What the picture shows, for those who cannot see it. Untrusted.
    pub title: String,
    /// px.
    pub width: f64,
    /// px.
    pub height: f64,
    /// Panels beside each other, at least one.
    pub columns: usize,
    /// Row by row.
    pub panels: Vec<Panel>,
}

/// A pair of axes and what is drawn on them.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Above the panel; empty for none. Untrusted.
    pub title: String,
    /// Left to right.
    pub x: Axis,
    /// Bottom to top.
    pub y: Axis,
    /// In the order in which they are drawn.
    pub series: Vec<Series>,
    /// Texts at places of the data.
    pub notes: Vec<Note>,
    /// Key of the colours of a heat map.
    pub colour_bar: Option<ColourBar>,
    /// Height relative to other rows; that of a row is its panels' largest.
    pub share: f64,
}

/// Marks that look alike.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Entry in the legend, if any. Untrusted.
    pub name: Option<String>,
    /// How they look.
    pub look: Look,
    /// What they are.
    pub mark: Mark,
}

/// What is drawn. Places are (x, y) in units of the axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// Joined points; one that is not finite breaks the line.
    Line(Vec<(f64, f64)>),
    /// Many small round dots, `stroke` px wide: for thousands of samples.
    Dots(Vec<(f64, f64)>),
    /// Marker shapes.
    Points(Vec<(f64, f64)>),
    /// Upright bars with caps.
    ErrorBars(Vec<Whisker>),
    /// Lying bars with caps: `at` is y, the ends are x.
    ErrorBarsAcross(Vec<Whisker>),
    /// Filled boxes, also those of a histogram.
    Bars(Vec<Span>),
    /// Boxes coloured by a value between `low` and `high`, by [`ramp`].
    Heat {
        /// Boxes and their values.
        cells: Vec<(Span, f64)>,
        /// Value of the lightest colour.
        low: f64,
        /// Value of the darkest colour.
        high: f64,
    },
}

/// An error bar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whisker {
    /// Place along the other axis.
    pub at: f64,
    /// One end.
    pub low: f64,
    /// The other.
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

/// A text at a place.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// Place in units of the axes.
    pub at: (f64, f64),
    /// Moved by so many px, right and down.
    pub by: (f64, f64),
    /// Untrusted.
    pub text: String,
    /// Which end of the text stands there.
    pub anchor: Anchor,
    /// Colour.
    pub colour: Colour,
    /// Whether a white rim keeps it readable over lines.
    pub rim: bool,
}

/// Which end of a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Its start.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

/// Key of a heat map.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourBar {
    /// What the colours say. Untrusted.
    pub label: String,
    /// Value of the lightest colour.
    pub low: f64,
    /// Value of the darkest colour.
    pub high: f64,
}

impl Figure {
    /// A figure with one column and no panel yet.
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

    /// The same with one more panel.
    #[must_use]
    pub fn with(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// The SVG, one document that also stands in HTML as it is.
    pub fn to_svg(&self) -> String {
        let mut out = Out::new(&self.id);
        out.open(&self.title, self.width, self.height);
        for (panel, frame) in self.panels.iter().zip(frame::frames(self)) {
            draw::panel(&mut out, panel, &frame);
        }
        out.close()
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
            colour_bar: None,
            share: 1.0,
        }
    }

    /// The same with a title.
    #[must_use]
    pub fn titled(mut self, title: &str) -> Self {
        title.clone_into(&mut self.title);
        self
    }

    /// The same with marks that the legend does not name.
    #[must_use]
    pub fn with(mut self, look: Look, mark: Mark) -> Self {
        self.series.push(Series {
            name: None,
            look,
            mark,
        });
        self
    }

    /// The same with marks that the legend names.
    #[must_use]
    pub fn named(mut self, name: &str, look: Look, mark: Mark) -> Self {
        self.series.push(Series {
            name: Some(name.to_owned()),
            look,
            mark,
        });
        self
    }

    /// The same with a note.
    #[must_use]
    pub fn note(mut self, note: Note) -> Self {
        self.notes.push(note);
        self
    }
}

impl Note {
    /// A dark text with a rim, whose middle stands at a place.
    pub fn new(at: (f64, f64), text: &str) -> Self {
        Self {
            at,
            by: (0.0, 0.0),
            text: text.to_owned(),
            anchor: Anchor::Middle,
            colour: Colour::INK,
            rim: true,
        }
    }

    /// The same, moved by px right and down.
    #[must_use]
    pub fn moved(mut self, right: f64, down: f64) -> Self {
        self.by = (right, down);
        self
    }

    /// The same without a rim, in black or white: for text on a filled box.
    #[must_use]
    pub fn on(mut self, paper: Colour) -> Self {
        self.colour = paper.text_on();
        self.rim = false;
        self
    }

    /// The same with another end at the place.
    #[must_use]
    pub fn anchored(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }
}

/// Boxes of a histogram: bin i covers `from + i·width` and that much on.
pub fn histogram(from: f64, width: f64, counts: &[f64]) -> Mark {
    let bin = |(i, n): (usize, &f64)| Span {
        x: (from + i as f64 * width, from + (i + 1) as f64 * width),
        y: (0.0, *n),
    };
    Mark::Bars(counts.iter().enumerate().map(bin).collect())
}

/// Width of a text in the figures' font, px: an estimate that errs on the wide
/// side, for layout only.
pub fn text_width(text: &str, size: f64) -> f64 {
    use unicode_width::UnicodeWidthChar as _;
    let em = |c: char| match c {
        'i' | 'j' | 'l' | '\'' | '|' | '.' | ',' | ':' | ';' | '!' | 'I' | ' ' => 0.30,
        'f' | 't' | 'r' | '(' | ')' | '-' | '/' => 0.38,
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.90,
        c if c.is_uppercase() => 0.72,
        c => match c.width().unwrap_or(0) {
            0 => 0.0,
            1 => 0.58,
            _ => 1.02,
        },
    };
    let shown = study_base::text::Untrusted(text).to_string();
    shown.chars().map(em).sum::<f64>() * size
}

/// A text that is at most about so many px wide; what is left out is marked.
pub fn fitted(text: &str, size: f64, room: f64) -> String {
    let mut most = text.chars().count();
    let mut shown = text.to_owned();
    while most > 1 && text_width(&shown, size) > room {
        most -= 1;
        shown = shortened(text, most);
    }
    shown
}

/// A text of at most so many characters. What is left out is marked, after the first
/// third: names of realizations often begin alike.
/// Characters that are shown as their code count as that.
pub fn shortened(text: &str, most: usize) -> String {
    let text = &study_base::text::Untrusted(text).to_string();
    let length = text.chars().count();
    if length <= most {
        return text.to_owned();
    }
    let kept = most.saturating_sub(1);
    let end = kept - kept / 3;
    let first: String = text.chars().take(kept - end).collect();
    let last: String = text.chars().skip(length - end).collect();
    format!("{first}…{last}")
}

#[cfg(test)]
mod tests;
