//! What the search finds.

use std::fmt;

/// What the search found; each is the worst of its kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Danger {
    /// A force at rest that slow motion never has.
    Force {
        /// That force, N.
        found_n: f64,
        /// The largest force in slow motion, N.
        slow_n: f64,
        /// Where, mm.
        at_mm: f64,
        /// Speed of the stroke that led there, mm/s.
        by_mm_s: f64,
    },
    /// A force on the way back that differs from that after a slow stroke.
    Latched {
        /// Largest difference, N.
        apart_n: f64,
        /// Over how much of the way back, mm.
        stays_mm: f64,
        /// Where the stroke ended, mm.
        to_mm: f64,
        /// Speed of the stroke before it, mm/s.
        by_mm_s: f64,
    },
    /// Reversals that draw energy at speeds that the device does not prevent.
    Reversal {
        /// Energy of a reversal, J, at most.
        most_j: f64,
        /// Speed up to which they draw energy, mm/s.
        up_to_mm_s: f64,
        /// The speed at which the device trips, mm/s.
        trips_mm_s: f64,
    },
    /// Chatter that draws energy.
    Chatter {
        /// Power beyond what the damping of the device takes, W.
        power_w: f64,
        /// Where, mm.
        at_mm: f64,
        /// Reversals per second.
        reversals_hz: f64,
    },
    /// Strokes back and forth that draw energy.
    Cycle {
        /// Energy of one cycle beyond what the damping of the device takes, J.
        energy_j: f64,
        /// Cycles per second.
        cycles_hz: f64,
    },
}

impl fmt::Display for Danger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Force {
                found_n,
                slow_n,
                at_mm,
                by_mm_s,
            } => write!(
                f,
                "{found_n:.2} N at rest at {at_mm:.2} mm after a stroke of {by_mm_s:.0} mm/s; slow motion has {slow_n:.2} N at most"
            ),
            Self::Latched {
                apart_n,
                stays_mm,
                to_mm,
                by_mm_s,
            } => write!(
                f,
                "after a stroke of {by_mm_s:.0} mm/s to {to_mm:.2} mm the force stays {apart_n:.2} N off over {stays_mm:.1} mm of the way back"
            ),
            Self::Reversal {
                most_j,
                up_to_mm_s,
                trips_mm_s,
            } => write!(
                f,
                "friction by the sign of the velocity gives up to {:.3} mJ at each reversal, at speeds up to {up_to_mm_s:.0} mm/s; the device trips at {trips_mm_s:.0} mm/s",
                1e3 * most_j
            ),
            Self::Chatter {
                power_w,
                at_mm,
                reversals_hz,
            } => write!(
                f,
                "{reversals_hz:.0} reversals a second at {at_mm:.2} mm draw {:.2} mW",
                1e3 * power_w
            ),
            Self::Cycle {
                energy_j,
                cycles_hz,
            } => write!(
                f,
                "strokes back and forth at {cycles_hz:.1} Hz draw {:.1} mJ each time",
                1e3 * energy_j
            ),
        }
    }
}
