//! Measured quantities as 32-bit integers.
//!
//! Millionths of mm, mm/s-thousandths and so on: see each function. What does
//! not fit is the largest that does; what is no number is 0, so that no reader
//! ever meets one.

/// "No sensor" in place of a force.
pub const NONE: i32 = i32::MIN;

/// mm to nm: ±2147 mm.
pub fn nm(x_mm: f64) -> i32 {
    scaled(x_mm, 1e6)
}

/// nm to mm.
pub fn from_nm(nm: i32) -> f64 {
    f64::from(nm) / 1e6
}

/// mm/s to µm/s: ±2,147,483 mm/s.
pub fn um_s(v_mm_s: f64) -> i32 {
    scaled(v_mm_s, 1e3)
}

/// µm/s to mm/s.
pub fn from_um_s(um_s: i32) -> f64 {
    f64::from(um_s) / 1e3
}

/// N to µN: ±2147 N.
pub fn un(force_n: f64) -> i32 {
    scaled(force_n, 1e6)
}

/// µN to N.
pub fn from_un(un: i32) -> f64 {
    f64::from(un) / 1e6
}

/// m/s² to µm/s²: ±2147 m/s².
pub fn um_s2(a_m_s2: f64) -> i32 {
    scaled(a_m_s2, 1e6)
}

/// µm/s² to m/s².
pub fn from_um_s2(um_s2: i32) -> f64 {
    f64::from(um_s2) / 1e6
}

/// A force that may not be measured.
pub fn maybe_un(force_n: Option<f64>) -> i32 {
    force_n.map_or(NONE, un)
}

/// Back again.
pub fn from_maybe_un(un: i32) -> Option<f64> {
    (un != NONE).then(|| from_un(un))
}

fn scaled(value: f64, scale: f64) -> i32 {
    // `as` saturates and makes 0 of what is no number; NONE stays free
    (libm::round(value * scale) as i32).max(-i32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_an_encoder_come_back_exactly() {
        for count in -10_000..10_000 {
            let x_mm = f64::from(count) * 5.0 / 1000.0;
            assert_eq!(from_nm(nm(x_mm)), x_mm, "{count}");
        }
    }

    #[test]
    fn what_does_not_fit_is_the_largest_and_never_the_missing_one() {
        assert_eq!(un(1e300), i32::MAX);
        assert_eq!(un(-1e300), -i32::MAX);
        assert_eq!(un(f64::NEG_INFINITY), -i32::MAX);
        assert_eq!(un(f64::NAN), 0);
        assert_eq!(from_maybe_un(maybe_un(None)), None);
        assert_eq!(from_maybe_un(maybe_un(Some(-1.5))), Some(-1.5));
        assert_eq!(from_um_s(um_s(123.456)), 123.456);
        assert_eq!(from_um_s2(um_s2(-9.81)), -9.81);
    }
}
