//! Vectorized arithmetic for four λ at once.
//!
//! For one sample, the computations for different λ differ only in λ, θ and P. A
//! [`Lane`] holds such a number for four λ, and with AVX2 each operation on it
//! compiles to one instruction. Two loops use it: [`recursion`], which computes sums
//! of the estimates over runs of samples, and [`errors`], which compares predictions
//! with a recording.
//!
//! Each loop is compiled twice, for AVX2 with FMA and for any processor, and selected
//! at run time. Both perform the same roundings in the same order (`mul_add` rounds
//! once on every machine), so results are bit-identical on all processors. Processors
//! older than 2013 compute `mul_add` in software, slowly.
//!
//! Invariant: lanes never mix. The result for a λ does not depend on the other λ of
//! the grid.

pub mod errors;
pub mod recursion;

/// Number of values in a [`Lane`].
pub const WIDTH: usize = 4;

/// Lanes per pass over the samples: enough to hide the latency of a division, few
/// enough for their state to stay in the cache.
pub const LANES_PER_PASS: usize = 3;

/// λ per pass over the samples.
pub const LAMBDAS_PER_PASS: usize = WIDTH * LANES_PER_PASS;

/// One number for each of four λ.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub struct Lane(pub [f64; WIDTH]);

impl Lane {
    /// Zeros.
    pub const ZERO: Self = Self([0.0; WIDTH]);

    /// The same value in all four places.
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
    pub fn negated_mul_add(self, b: Self, c: Self) -> Self {
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

/// The instruction set of the two loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Processor {
    /// AVX2 and FMA.
    Avx2,
    /// Any processor.
    Portable,
}

impl Processor {
    /// The fastest that this machine supports.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
        {
            return Self::Avx2;
        }
        Self::Portable
    }
}
