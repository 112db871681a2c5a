//! Palette, marker shapes, dashes.

use super::Color;

/// Eight colors after Okabe & Ito (2008), darkened for white paper, ordered so that
/// neighbors also differ in lightness.
pub const PALETTE: [Color; 8] = [
    Color(0x00, 0x4a, 0x8f),
    Color(0xd5, 0x5e, 0x00),
    Color(0x00, 0x6b, 0x54),
    Color(0xd0, 0x8f, 0x00),
    Color(0x7a, 0x2d, 0x68),
    Color(0x3f, 0x9f, 0xd8),
    Color(0x4d, 0x4d, 0x4d),
    Color(0xc9, 0x76, 0xa5),
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

/// The share of the color in a pale one.
const PALE: f64 = 0.45;

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
    /// Color of lines and fills.
    pub color: Color,
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
    /// The appearance of the n-th series: adjacent series differ in color, shape and dash.
    pub fn nth(n: usize) -> Self {
        Self {
            color: PALETTE[n % PALETTE.len()],
            // When the colors repeat, each gets the next shape.
            shape: SHAPES[(n + n / PALETTE.len()) % SHAPES.len()],
            dash: DASHES[n % DASHES.len()],
            stroke: 1.5,
            size: 8.0,
            opacity: 1.0,
        }
    }

    /// Solid lines and discs in one color.
    pub fn plain(color: Color) -> Self {
        Self {
            color,
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

    /// The same color mixed with white, for marks that stay behind others.
    #[must_use]
    pub fn pale(mut self) -> Self {
        let Color(red, green, blue) = self.color;
        // At most 255, so the cast is exact.
        let mix = |x: u8| (f64::from(x) * PALE + 255.0 * (1.0 - PALE)).round() as u8;
        self.color = Color(mix(red), mix(green), mix(blue));
        self
    }

    /// Sets the opacity, from 0 to 1.
    #[must_use]
    pub fn opacity(mut self, share: f64) -> Self {
        self.opacity = share;
        self
    }

    /// Sets the shape of points.
    #[must_use]
    pub fn shaped(mut self, shape: Shape) -> Self {
        self.shape = shape;
        self
    }

    /// Sets the dash.
    #[must_use]
    pub fn dashed(mut self, dash: Dash) -> Self {
        self.dash = dash;
        self
    }
}

/// Stops of the ascending scale, with evenly decreasing lightness and a single hue, so that
/// the order is visible in grayscale too.
const STOPS: [Color; 5] = [
    Color(0xf4, 0xf7, 0xfb),
    Color(0xb9, 0xd3, 0xe8),
    Color(0x6a, 0xa6, 0xd0),
    Color(0x21, 0x6d, 0xa8),
    Color(0x08, 0x30, 0x6b),
];

/// Stops of the diverging scale: light in the middle, two hues, darker towards both ends.
const DIVERGING: [Color; 5] = [
    Color(0x7f, 0x3b, 0x08),
    Color(0xe0, 0x8f, 0x3e),
    Color(0xf7, 0xf7, 0xf7),
    Color(0x6a, 0xa6, 0xd0),
    Color(0x08, 0x30, 0x6b),
];

/// The colors of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// The value of the first color; lower values have it as well.
    pub low: f64,
    /// The value of the last color; higher values have it as well.
    pub high: f64,
    stops: &'static [Color; 5],
}

impl Scale {
    /// From light to dark.
    pub fn ascending(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            stops: &STOPS,
        }
    }

    /// Light at 0, with one hue below it and another one above it, up to ±`most`.
    pub fn diverging(most: f64) -> Self {
        Self {
            low: -most,
            high: most,
            stops: &DIVERGING,
        }
    }

    /// The color of a value; that of the middle if both ends are equal.
    pub fn color(&self, value: f64) -> Color {
        let share = (value - self.low) / (self.high - self.low);
        between(self.stops, if share.is_finite() { share } else { 0.5 })
    }

    /// The color at a share of the scale, from 0 to 1.
    pub(super) fn at(&self, share: f64) -> Color {
        between(self.stops, share)
    }
}

fn between(stops: &[Color; 5], share: f64) -> Color {
    let at = share.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
    // Between 0 and 3, so the cast is exact.
    let low = (at.floor() as usize).min(stops.len() - 2);
    let (a, b, t) = (stops[low], stops[low + 1], at - low as f64);
    // Between two bytes, so the cast is exact.
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * t).round() as u8;
    Color(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}
