//! Colours, marker shapes, dashes and hatching.

/// An sRGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

impl Colour {
    /// Colour of text and axes.
    pub const INK: Self = Self(0x1a, 0x1a, 0x1a);
    /// Colour of secondary text.
    pub const GREY: Self = Self(0x59, 0x59, 0x59);
    /// Colour of grid lines.
    pub const FAINT: Self = Self(0xdd, 0xdd, 0xdd);
    /// Background.
    pub const WHITE: Self = Self(0xff, 0xff, 0xff);

    /// The colour as `#rrggbb`.
    pub fn hex(self) -> String {
        format!("#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }

    /// Relative luminance (WCAG 2), from 0 (black) to 1 (white).
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

    /// Black or white, whichever has the higher contrast on this colour: at least 4.5 to 1.
    pub fn text_on(self) -> Self {
        if self.luminance() > 0.18 {
            Self(0, 0, 0)
        } else {
            Self::WHITE
        }
    }
}

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
    pub(super) fn pattern(self) -> Option<&'static str> {
        match self {
            Self::Solid => None,
            Self::Dashed => Some("6 4"),
            Self::Dotted => Some("1.5 3"),
            Self::DashDot => Some("8 3 2 3"),
            Self::Long => Some("12 4"),
        }
    }
}

/// Fills of boxes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fill {
    /// Solid.
    Solid,
    /// Hatched, rising lines.
    Rising,
    /// Hatched, falling lines.
    Falling,
    /// Cross-hatched.
    Crossed,
}

const FILLS: [Fill; 4] = [Fill::Solid, Fill::Rising, Fill::Falling, Fill::Crossed];

/// Appearance of marks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Colour of lines and fills.
    pub colour: Colour,
    /// Shape of points.
    pub shape: Shape,
    /// Dash of lines.
    pub dash: Dash,
    /// Fill of boxes.
    pub fill: Fill,
    /// Width of lines, px.
    pub stroke: f64,
    /// Diameter of points, px.
    pub size: f64,
    /// Opacity, from 0 to 1.
    pub opacity: f64,
}

impl Look {
    /// The appearance of the n-th series: adjacent series differ in colour, shape, dash
    /// and hatching.
    pub fn nth(n: usize) -> Self {
        Self {
            colour: PALETTE[n % PALETTE.len()],
            // When the colours repeat, each gets the next shape.
            shape: SHAPES[(n + n / PALETTE.len()) % SHAPES.len()],
            dash: DASHES[n % DASHES.len()],
            fill: FILLS[n % FILLS.len()],
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
            fill: Fill::Solid,
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
