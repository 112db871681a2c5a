//! Pictures: paths and texts, written as SVG, PNG or PDF.
//!
//! Lengths are in px, with y downwards. On paper a px is [`POINTS`], so that text of 12 px
//! has 8 pt. The same picture gives the same bytes on every machine.
//!
//! PNG and PDF use Liberation Sans (SIL Open Font License 1.1,
//! `assets/LiberationSans-LICENSE.txt`), which has Latin, Greek and Cyrillic. A character
//! of another script is a box there; SVG uses the reader's fonts.

mod font;
pub mod pdf;
pub mod png;
mod svg;

pub use font::text_width;

use study_base::text::Untrusted;

/// Length of a px on paper, pt.
pub const POINTS: f64 = 2.0 / 3.0;

/// The fonts of all text, first the bundled one.
pub const FONT_FAMILY: &str = "Liberation Sans, Arial, Helvetica, sans-serif";

/// A position: right, down.
pub type Point = (f64, f64);

/// An sRGB color.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Color(pub u8, pub u8, pub u8);

impl Color {
    /// Color of text and axes.
    pub const INK: Self = Self(0x1a, 0x1a, 0x1a);
    /// Color of secondary text.
    pub const GREY: Self = Self(0x59, 0x59, 0x59);
    /// Color of grid lines.
    pub const FAINT: Self = Self(0xdd, 0xdd, 0xdd);
    /// Background.
    pub const WHITE: Self = Self(0xff, 0xff, 0xff);

    /// The color as `#rrggbb`.
    pub fn hex(self) -> String {
        format!("#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }

    /// Relative luminance (WCAG 2), from 0 (black) to 1 (white).
    ///
    /// ```
    /// # use study_report::picture::Color;
    /// assert!((Color::WHITE.luminance() - 1.0).abs() < 1e-12);
    /// assert_eq!(Color(0, 0, 0x80).text_on(), Color::WHITE);
    /// ```
    pub fn luminance(self) -> f64 {
        let linear = |c: u8| {
            let c = f64::from(c) / 255.0;
            if c <= 0.040_45 {
                c / 12.92
            } else {
                libm::pow((c + 0.055) / 1.055, 2.4)
            }
        };
        0.2126 * linear(self.0) + 0.7152 * linear(self.1) + 0.0722 * linear(self.2)
    }

    /// Black or white, whichever has the higher contrast on this color: at least 4.5 to 1.
    pub fn text_on(self) -> Self {
        if self.luminance() > 0.18 {
            Self(0, 0, 0)
        } else {
            Self::WHITE
        }
    }
}

/// A picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Prefix of every id in the SVG: letters, digits, `-`.
    id: String,
    /// Text alternative, escaped.
    title: String,
    /// What a reader of the file must know, such as that the data are simulated, escaped.
    note: Option<String>,
    width: f64,
    height: f64,
    /// In drawing order.
    items: Vec<Item>,
}

#[derive(Debug, Clone, PartialEq)]
enum Item {
    Path(Path),
    Text(Text),
    /// Clips what follows to a box: left, top, right, bottom.
    Clip([f64; 4]),
    /// Ends the clipping.
    Unclip,
}

/// Lines and closed shapes with one appearance.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    steps: Vec<Step>,
    fill: Option<Color>,
    pen: Option<Pen>,
    opacity: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    Move(Point),
    Line(Point),
    Close,
}

/// How lines are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pen {
    /// Color.
    pub color: Color,
    /// Width, px.
    pub width: f64,
    /// Lengths of dashes and gaps, px; empty for a solid line.
    pub dash: &'static [f32],
    /// Whether lines have round ends; a line of length 0 is then a dot.
    pub round: bool,
}

/// A line of text.
#[derive(Debug, Clone, PartialEq)]
pub struct Text {
    /// Position of the anchor on the base line.
    pub at: Point,
    /// The text. Untrusted until it is in a picture.
    pub text: String,
    /// Size of the letters, px.
    pub size: f64,
    /// Which part of the text is at the position.
    pub anchor: Anchor,
    /// Color.
    pub color: Color,
    /// Whether it is bold.
    pub bold: bool,
    /// Rotation to read upwards, degrees.
    pub angle: u8,
    /// Whether it has a white outline, to be readable over lines.
    pub rim: bool,
}

/// Which part of a text is at its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Its start.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

impl Anchor {
    /// The part of the width that is left of the position.
    fn share(self) -> f64 {
        match self {
            Self::Start => 0.0,
            Self::Middle => 0.5,
            Self::End => 1.0,
        }
    }
}

/// Width of a white outline around letters, px.
const RIM: f64 = 3.0;

/// Width of the outline that makes letters bold, in units of their size.
const BOLD: f64 = 0.04;

impl Picture {
    /// A white picture. Characters of the id other than letters, digits and `-` are
    /// removed.
    pub fn new(id: &str, title: &str, width: f64, height: f64) -> Self {
        let id = id
            .chars()
            .filter(|c| c.is_ascii_alphanumeric() || *c == '-');
        Self {
            id: id.collect(),
            title: Untrusted(title).to_string(),
            note: None,
            width,
            height,
            items: Vec::new(),
        }
    }

    /// Sets what a reader of the file must know. Untrusted.
    pub fn set_note(&mut self, note: &str) {
        self.note = Some(Untrusted(note).to_string());
    }

    /// What a reader of the file must know, escaped.
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// Adds a path, unless it is empty.
    pub fn path(&mut self, path: Path) {
        if !path.steps.is_empty() {
            self.items.push(Item::Path(path));
        }
    }

    /// Adds a text.
    pub fn text(&mut self, mut text: Text) {
        text.text = Untrusted(&text.text).to_string();
        self.items.push(Item::Text(text));
    }

    /// Clips what is added until [`Picture::unclip`] to a box: left, top, right, bottom.
    pub fn clip(&mut self, to: [f64; 4]) {
        self.items.push(Item::Clip(to));
    }

    /// Ends the clipping.
    pub fn unclip(&mut self) {
        self.items.push(Item::Unclip);
    }

    /// The picture as an SVG document, which can also be embedded in HTML.
    ///
    /// ```
    /// # use study_report::picture::{Anchor, Picture, Text};
    /// let mut picture = Picture::new("example", "An example", 120.0, 40.0);
    /// picture.text(Text::new((60.0, 20.0), "a < b", 10.0, Anchor::Middle));
    /// assert!(picture.to_svg().contains("a &lt; b"));
    /// ```
    pub fn to_svg(&self) -> String {
        svg::svg(self)
    }

    /// The picture as a PDF of one page.
    pub fn to_pdf(&self) -> Vec<u8> {
        pdf::pdf(self)
    }
}

impl Path {
    /// An empty path of lines.
    pub fn drawn(pen: Pen) -> Self {
        Self {
            steps: Vec::new(),
            fill: None,
            pen: Some(pen),
            opacity: 1.0,
        }
    }

    /// An empty path of filled shapes.
    pub fn filled(color: Color) -> Self {
        Self {
            steps: Vec::new(),
            fill: Some(color),
            pen: None,
            opacity: 1.0,
        }
    }

    /// Adds lines to the filled shapes.
    #[must_use]
    pub fn edged(mut self, pen: Pen) -> Self {
        self.pen = Some(pen);
        self
    }

    /// Sets the opacity, from 0 to 1.
    #[must_use]
    pub fn opacity(mut self, opacity: f64) -> Self {
        self.opacity = opacity;
        self
    }

    /// Adds a straight line.
    pub fn segment(&mut self, a: Point, b: Point) {
        self.steps.extend([Step::Move(a), Step::Line(b)]);
    }

    /// Adds a dot, for a round pen.
    pub fn dot(&mut self, at: Point) {
        self.segment(at, at);
    }

    /// Adds a line through some points.
    pub fn line(&mut self, points: &[Point]) {
        if let [first, rest @ ..] = points {
            self.steps.push(Step::Move(*first));
            self.steps.extend(rest.iter().map(|p| Step::Line(*p)));
        }
    }

    /// Adds a closed shape.
    pub fn polygon(&mut self, corners: &[Point]) {
        self.line(corners);
        self.steps.push(Step::Close);
    }

    /// Adds a box between two corners.
    pub fn rectangle(&mut self, (x0, y0): Point, (x1, y1): Point) {
        self.polygon(&[(x0, y0), (x1, y0), (x1, y1), (x0, y1)]);
    }
}

impl Pen {
    /// A solid line.
    pub fn new(color: Color, width: f64) -> Self {
        Self {
            color,
            width,
            dash: &[],
            round: false,
        }
    }

    /// Sets round ends.
    #[must_use]
    pub fn round(mut self) -> Self {
        self.round = true;
        self
    }

    /// Sets the dashes, px.
    #[must_use]
    pub fn dashed(mut self, dash: &'static [f32]) -> Self {
        self.dash = dash;
        self
    }
}

impl Text {
    /// Dark horizontal text.
    pub fn new(at: Point, text: &str, size: f64, anchor: Anchor) -> Self {
        Self {
            at,
            text: text.to_owned(),
            size,
            anchor,
            color: Color::INK,
            bold: false,
            angle: 0,
            rim: false,
        }
    }
}

#[cfg(test)]
mod tests;
