//! The numbers of the servo: `f64`, or `f32` for a processor that calculates in single
//! precision only.
//!
//! A table on the wire, its certificate and all settings are `f64` with either. With `f32`
//! the servo converts them once and renders every shipped realization within 1 mN of `f64`
//! (`tests/device/precision.rs`).

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// `f64` or `f32`.
pub trait Real:
    Copy
    + 'static
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// 0.
    const ZERO: Self;
    /// 1/2.
    const HALF: Self;
    /// 1.
    const ONE: Self;
    /// The nearest number of this type.
    fn of(value: f64) -> Self;
    /// As `f64`, exactly.
    fn f64(self) -> f64;
    /// The integer part; saturates, and NaN gives 0.
    fn to_i32(self) -> i32;
    /// |x|.
    fn abs(self) -> Self;
    /// The nearest integer, away from zero at the middle.
    fn round(self) -> Self;
    /// e^x.
    fn exp(self) -> Self;
    /// cos x.
    fn cos(self) -> Self;
    /// The larger one; the other one of a NaN.
    fn max(self, other: Self) -> Self;
    /// The smaller one; the other one of a NaN.
    fn min(self, other: Self) -> Self;
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;
}

macro_rules! real {
    ($type:ident: $abs:ident $round:ident $exp:ident $cos:ident) => {
        impl Real for $type {
            const ZERO: Self = 0.0;
            const HALF: Self = 0.5;
            const ONE: Self = 1.0;

            #[inline]
            fn of(value: f64) -> Self {
                value as Self
            }

            #[inline]
            fn f64(self) -> f64 {
                f64::from(self)
            }

            #[inline]
            fn to_i32(self) -> i32 {
                self as i32
            }

            #[inline]
            fn abs(self) -> Self {
                libm::$abs(self)
            }

            #[inline]
            fn round(self) -> Self {
                libm::$round(self)
            }

            #[inline]
            fn exp(self) -> Self {
                libm::$exp(self)
            }

            #[inline]
            fn cos(self) -> Self {
                libm::$cos(self)
            }

            #[inline]
            fn max(self, other: Self) -> Self {
                Self::max(self, other)
            }

            #[inline]
            fn min(self, other: Self) -> Self {
                Self::min(self, other)
            }

            #[inline]
            fn is_finite(self) -> bool {
                Self::is_finite(self)
            }
        }
    };
}
real!(f64: fabs round exp cos);
real!(f32: fabsf roundf expf cosf);
