//! The cores of psychometric functions, of u = (x − threshold)/width.

use crate::distribution::{normal_cdf, normal_density, normal_quantile};
use std::f64::consts::LN_2;

/// 2 z(.95): the width in standard deviations.
const NORMAL: f64 = 3.289_707_253_902_944;
/// 2 ln(19): the width in units of the logistic.
const LOGISTIC: f64 = 5.888_877_958_332_88;
/// ln(−ln .05) − ln(−ln .95).
const GUMBEL: f64 = 4.067_383_949_407_112;

/// The shape S.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Core {
    /// Cumulative normal.
    Norm,
    /// Logistic.
    Logistic,
    /// 1 − exp(−exp(…)): the Weibull function over the logarithm of the level.
    Gumbel,
    /// exp(−exp(…)).
    ReversedGumbel,
}

impl Core {
    /// All cores, with the names of `psignifit`.
    pub const NAMES: [(Self, &str); 4] = [
        (Self::Norm, "norm"),
        (Self::Logistic, "logistic"),
        (Self::Gumbel, "gumbel"),
        (Self::ReversedGumbel, "rgumbel"),
    ];

    /// The core of a name.
    pub fn named(name: &str) -> Option<Self> {
        let found = Self::NAMES.into_iter().find(|n| n.1 == name);
        found.map(|n| n.0)
    }

    /// S(u).
    pub(super) fn value(self, u: f64) -> f64 {
        match self {
            Self::Norm => normal_cdf(NORMAL * u),
            Self::Logistic => 1.0 / (1.0 + (-LOGISTIC * u).exp()),
            Self::Gumbel => -(-(GUMBEL * u).exp() * LN_2).exp_m1(),
            Self::ReversedGumbel => (-(-GUMBEL * u).exp() * LN_2).exp(),
        }
    }

    /// S, its slope and its curvature at u.
    pub(super) fn derivatives(self, u: f64) -> (f64, f64, f64) {
        let s = self.value(u);
        match self {
            Self::Norm => {
                let slope = NORMAL * normal_density(NORMAL * u);
                (s, slope, -NORMAL * NORMAL * u * slope)
            }
            Self::Logistic => {
                let slope = LOGISTIC * s * (1.0 - s);
                (s, slope, LOGISTIC * slope * (1.0 - 2.0 * s))
            }
            Self::Gumbel | Self::ReversedGumbel => {
                let c = if self == Self::Gumbel {
                    GUMBEL
                } else {
                    -GUMBEL
                };
                let e = (c * u).exp() * LN_2;
                let slope = GUMBEL * e * (-e).exp();
                // e·exp(−e) is 0 · ∞ far out.
                if slope == 0.0 || !slope.is_finite() {
                    return (s, 0.0, 0.0);
                }
                (s, slope, c * slope * (1.0 - e))
            }
        }
    }

    /// The u at which S is `s`. `None` unless 0 < s < 1.
    pub(super) fn inverse(self, s: f64) -> Option<f64> {
        if !(s > 0.0 && s < 1.0) {
            return None;
        }
        let gumbel = |tail: f64| ((-tail.ln()).ln() - LN_2.ln()) / GUMBEL;
        match self {
            Self::Norm => normal_quantile(s).map(|z| z / NORMAL),
            Self::Logistic => Some((s / (1.0 - s)).ln() / LOGISTIC),
            Self::Gumbel => Some(gumbel(1.0 - s)),
            Self::ReversedGumbel => Some(-gumbel(s)),
        }
    }

    /// Half the distance from S = .25 to S = .75 for a width of 1.
    pub(super) fn jnd_of_width(self) -> f64 {
        let quarter = |s: f64| self.inverse(s).unwrap_or_default();
        0.5 * (quarter(0.75) - quarter(0.25))
    }
}
