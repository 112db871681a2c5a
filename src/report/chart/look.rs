//! Palette, marker shapes, dashes.

use super::Colour;

/// Eight colours after Okabe & Ito (2008), darkened for white paper, ordered so that
/// neighbours also differ in lightness.
pub const PALETTE: [Colour; 8] = [
    Colour(0x00, 0x4a, 0x8f),
    Colour(0xd5, 0x5e, 0x00),
    Colour(0x00, 0x6b, 0x54),
    Colour(0xd0, 0x8f, 0x00),
    Colour(0x7a, 0x2d, 0x68),
    Colour(0x3f, 0x9f, 0xd8),
    Colour(0x4d, 0x4d, 0x4d),
    Colour(0xc9, 0x76, 0xa5),
];

/// Marker shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Disc.
    Disc,
    /// Square.
    Square,
    /// Triangle, point up.
    Up,
    /// Diamond.
    Diamond,
    /// Triangle, point down.
    Down,
    /// Open ring.
    Ring,
    /// ×.
    Cross,
    /// +.
    Plus,
}

const SHAPES: [Shape; 8] = [
    Shape::Disc,
    Shape::Square,
    Shape::Up,
    Shape::Diamond,
    Shape::Down,
    Shape::Ring,
    Shape::Cross,
    Shape::Plus,
];

/// Dashes of lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dash {
    /// ────
    Solid,
    /// ─ ─ ─
    Dashed,
    /// · · ·
    Dotted,
    /// ─ · ─
    DashDot,
    /// ── ──
    Long,
}

const DASHES: [Dash; 5] = [
    Dash::Solid,
    Dash::Dashed,
    Dash::DashDot,
    Dash::Dotted,
    Dash::Long,
];

impl Dash {
    /// Lengths of dashes and gaps, px; empty for a solid line.
    pub(super) fn pattern(self) -> &'static [f32] {
        match self {
            Self::Solid => &[],
            Self::Dashed => &[6.0, 4.0],
            Self::Dotted => &[1.5, 3.0],
            Self::DashDot => &[8.0, 3.0, 2.0, 3.0],
            Self::Long => &[12.0, 4.0],
        }
    }
}

/// Appearance of marks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Colour of lines and fills.
    pub colour: Colour,
    /// Shape of points.
    pub shape: Shape,
    /// Dash of lines.
    pub dash: Dash,
    /// Width of lines, px.
    pub stroke: f64,
    /// Diameter of points, px.
    pub size: f64,
    /// Opacity, from 0 to 1.
    pub opacity: f64,
}

impl Look {
    /// The appearance of the n-th series: adjacent series differ in colour, shape and dash.
    pub fn nth(n: usize) -> Self {
        Self {
            colour: PALETTE[n % PALETTE.len()],
            // When the colours repeat, each gets the next shape.
            shape: SHAPES[(n + n / PALETTE.len()) % SHAPES.len()],
            dash: DASHES[n % DASHES.len()],
            stroke: 1.5,
            size: 8.0,
            opacity: 1.0,
        }
    }

    /// Solid lines and discs in one colour.
    pub fn plain(colour: Colour) -> Self {
        Self {
            colour,
            dash: Dash::Solid,
            shape: Shape::Disc,
            ..Self::nth(0)
        }
    }

    /// Sets the width of lines, px.
    #[must_use]
    pub fn stroke(mut self, px: f64) -> Self {
        self.stroke = px;
        self
    }

    /// Sets the diameter of points, px.
    #[must_use]
    pub fn size(mut self, px: f64) -> Self {
        self.size = px;
        self
    }

    /// Sets the dash.
    #[must_use]
    pub fn dashed(mut self, dash: Dash) -> Self {
        self.dash = dash;
        self
    }
}

/// Stops of the colour ramp, with evenly decreasing lightness.
const STOPS: [Colour; 5] = [
    Colour(0xf4, 0xf7, 0xfb),
    Colour(0xb9, 0xd3, 0xe8),
    Colour(0x6a, 0xa6, 0xd0),
    Colour(0x21, 0x6d, 0xa8),
    Colour(0x08, 0x30, 0x6b),
];

/// The colour of a value from 0 (light) to 1 (dark). It has a single hue, so that the
/// order is visible in greyscale too.
pub fn ramp(share: f64) -> Colour {
    let at = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    // Between 0 and 3, so the cast is exact.
    let low = (at.floor() as usize).min(STOPS.len() - 2);
    let (a, b, t) = (STOPS[low], STOPS[low + 1], at - low as f64);
    // Between two bytes, so the cast is exact.
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * t).round() as u8;
    Colour(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}
