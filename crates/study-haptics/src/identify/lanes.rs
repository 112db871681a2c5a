//! Four λ at once: arithmetic on four numbers side by side.
//!
//! What a grid does for every λ on the same sample has the same operands but for λ,
//! θ and P. A [`Lane`] holds one such number for four λ, and a compiler that may use
//! AVX2 makes one instruction of each operation on it. Two loops are written so:
//! [`recursion`], which leaves sums of the estimates over runs of samples, and
//! [`errors`], which compares predictions with a recording.
//!
//! Each loop is compiled twice, for AVX2 with FMA and for any processor, and chosen
//! at run time. Both do the same roundings in the same order (`mul_add` is one
//! rounding on every machine), so the numbers do not depend on the processor, to the
//! last bit. A processor older than 2013 computes `mul_add` in software, slowly.
//!
//! Invariant: lanes never mix. What comes out for a λ does not depend on which
//! others are in the grid.

pub mod errors;
pub mod recursion;

/// Numbers in a [`Lane`].
pub const WIDTH: usize = 4;

/// Lanes that one pass over the samples serves: enough to keep the processor busy
/// while a division waits, few enough for their state to stay near it.
pub const LANES_A_PASS: usize = 3;

/// λ that one pass over the samples serves.
pub const LAMBDAS_A_PASS: usize = WIDTH * LANES_A_PASS;

/// One number for each of four λ.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub struct Lane(pub [f64; WIDTH]);

impl Lane {
    /// Zeros.
    pub const ZERO: Self = Self([0.0; WIDTH]);

    /// The same number four times.
    #[inline(always)]
    pub fn all(value: f64) -> Self {
        Self([value; WIDTH])
    }

    /// `self` · `b` + `c`, rounded once.
    #[inline(always)]
    pub fn mul_add(self, b: Self, c: Self) -> Self {
        let mut out = c;
        for i in 0..WIDTH {
            out.0[i] = self.0[i].mul_add(b.0[i], c.0[i]);
        }
        out
    }

    /// `c` − `self` · `b`, rounded once.
    #[inline(always)]
    pub fn take_from(self, b: Self, c: Self) -> Self {
        let mut out = c;
        for i in 0..WIDTH {
            out.0[i] = (-self.0[i]).mul_add(b.0[i], c.0[i]);
        }
        out
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident, $symbol:tt) => {
        impl std::ops::$trait for Lane {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                let mut out = self;
                for i in 0..WIDTH {
                    out.0[i] = self.0[i] $symbol other.0[i];
                }
                out
            }
        }
    };
}

operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

/// Which of the two compilations runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Processor {
    /// With AVX2 and FMA.
    Avx2,
    /// Any.
    Portable,
}

impl Processor {
    /// The fastest that this machine has.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
        {
            return Self::Avx2;
        }
        Self::Portable
    }
}
