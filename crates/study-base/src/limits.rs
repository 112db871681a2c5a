//! Limits that are finite and positive by construction.
//!
//! TOML and CSV can contain `nan` and `inf`, and `force > nan` is never true: a limit
//! that is NaN would silently not limit. Therefore no limit is a bare `f64`.

use serde::{Deserialize, Serialize};

/// A finite, positive bound, in the unit of its field's name.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Limit(f64);

/// A number that cannot be a limit.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("a limit has to be a finite number above zero, not {0}")]
pub struct BadLimit(pub f64);

impl Limit {
    /// Checks a number.
    ///
    /// # Errors
    /// [`BadLimit`] for NaN, an infinity, zero or a negative number.
    pub fn new(value: f64) -> Result<Self, BadLimit> {
        if value.is_finite() && value > 0.0 {
            Ok(Self(value))
        } else {
            Err(BadLimit(value))
        }
    }

    /// The bound as a number.
    pub fn get(self) -> f64 {
        self.0
    }

    /// The smaller of the two limits.
    #[must_use]
    pub fn capped_at(self, other: Self) -> Self {
        if other.0 < self.0 { other } else { self }
    }

    /// `value` clamped to [−limit, limit]; NaN becomes 0, no force.
    ///
    /// ```
    /// # use study_base::limits::Limit;
    /// let limit = Limit::new(12.0)?;
    /// assert_eq!((limit.clamp(-20.0), limit.clamp(f64::NAN)), (-12.0, 0.0));
    /// assert!(Limit::new(f64::NAN).is_err());
    /// # Ok::<(), study_base::limits::BadLimit>(())
    /// ```
    pub fn clamp(self, value: f64) -> f64 {
        if value.is_nan() {
            0.0
        } else {
            value.clamp(-self.0, self.0)
        }
    }
}

impl TryFrom<f64> for Limit {
    type Error = BadLimit;
    fn try_from(value: f64) -> Result<Self, BadLimit> {
        Self::new(value)
    }
}

impl From<Limit> for f64 {
    fn from(limit: Limit) -> f64 {
        limit.0
    }
}

/// Limits that no playback exceeds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Largest force, N.
    pub force_n: Limit,
    /// Largest speed of the handle before the device trips, mm/s.
    pub velocity_mm_s: Limit,
}

impl Limits {
    /// Checks a force, N, and a speed, mm/s.
    ///
    /// # Errors
    /// [`BadLimit`] for the first that is not finite and positive.
    pub fn new(force_n: f64, velocity_mm_s: f64) -> Result<Self, BadLimit> {
        Ok(Self {
            force_n: Limit::new(force_n)?,
            velocity_mm_s: Limit::new(velocity_mm_s)?,
        })
    }

    /// The smaller of the two, for each limit.
    #[must_use]
    pub fn capped_at(self, device: Self) -> Self {
        Self {
            force_n: self.force_n.capped_at(device.force_n),
            velocity_mm_s: self.velocity_mm_s.capped_at(device.velocity_mm_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_finite_positive_numbers_are_limits() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, -1.0] {
            assert!(Limit::new(bad).is_err(), "{bad}");
        }
        assert_eq!(Limit::new(12.0).unwrap().get(), 12.0);
    }

    #[test]
    fn a_clamp_never_exceeds_the_limit() {
        let limit = Limit::new(12.0).unwrap();
        assert_eq!(limit.clamp(f64::NAN), 0.0);
        assert_eq!(limit.clamp(f64::INFINITY), 12.0);
        assert_eq!(limit.clamp(-1e308), -12.0);
        assert_eq!(limit.clamp(3.0), 3.0);
    }

    #[test]
    fn the_lower_limit_applies() {
        let asked = Limit::new(12.0).unwrap();
        let device = Limit::new(9.0).unwrap();
        assert_eq!(asked.capped_at(device), device);
        assert_eq!(device.capped_at(asked), device);
    }
}
