//! Measured quantities as 32-bit integers.
//!
//! Each function names its unit. Values that do not fit saturate, and NaN becomes 0,
//! so that a reader always gets a finite number.

use crate::real::Real;

/// mm to nm: ±2147 mm.
///
/// ```
/// # use study_wire::message::fixed::nm;
/// assert_eq!(nm(17.5), 17_500_000);
/// assert_eq!(nm(1e9), i32::MAX);
/// ```
pub fn nm<R: Real>(x_mm: R) -> i32 {
    scaled(x_mm, 1e6)
}

/// nm to mm.
pub fn from_nm(nm: i32) -> f64 {
    f64::from(nm) / 1e6
}

/// mm/s to µm/s: ±2,147,483 mm/s.
pub fn um_s<R: Real>(v_mm_s: R) -> i32 {
    scaled(v_mm_s, 1e3)
}

/// µm/s to mm/s.
pub fn from_um_s(um_s: i32) -> f64 {
    f64::from(um_s) / 1e3
}

/// N to µN: ±2147 N.
pub fn un<R: Real>(force_n: R) -> i32 {
    scaled(force_n, 1e6)
}

/// µN to N.
pub fn from_un(un: i32) -> f64 {
    f64::from(un) / 1e6
}

/// m/s² to µm/s²: ±2147 m/s².
pub fn um_s2<R: Real>(a_m_s2: R) -> i32 {
    scaled(a_m_s2, 1e6)
}

/// µm/s² to m/s².
pub fn from_um_s2(um_s2: i32) -> f64 {
    f64::from(um_s2) / 1e6
}

fn scaled<R: Real>(value: R, scale: f64) -> i32 {
    // i32::MIN is reserved for "no sensor".
    (value * R::of(scale)).round().to_i32().max(-i32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoder_counts_are_exact() {
        for count in -10_000..10_000 {
            let x_mm = f64::from(count) * 5.0 / 1000.0;
            assert_eq!(from_nm(nm(x_mm)), x_mm, "{count}");
        }
    }

    #[test]
    fn values_saturate_without_reaching_the_code_for_no_sensor() {
        assert_eq!(un(1e300), i32::MAX);
        assert_eq!(un(-1e300), -i32::MAX);
        assert_eq!(un(f64::NEG_INFINITY), -i32::MAX);
        assert_eq!(un(f64::NAN), 0);
        assert_eq!(from_un(un(-1.5)), -1.5);
        assert_eq!(from_um_s(um_s(123.456)), 123.456);
        assert_eq!(from_um_s2(um_s2(-9.81)), -9.81);
    }
}
