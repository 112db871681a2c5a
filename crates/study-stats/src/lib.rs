//! Numbers in, estimates out.
//!
//! Plain functions over slices: no subjects, no realizations, no files. A
//! function whose result is not defined for its input returns `None`; it never
//! returns NaN, an infinity or an invented 0 or 1. `docs/statistics.md` derives
//! the formulas and names their sources; here each stands above its code.

pub mod agreement;
pub mod anova;
pub mod bayes;

pub mod bootstrap;
pub mod clm;
pub mod clmm;
pub mod correlation;
pub mod describe;
pub mod distribution;
pub mod friedman;
pub mod grim;
pub mod lmm;
mod matrix;
pub mod paired;
pub mod permutation;

pub mod proportion;
pub mod random;
pub mod rank;
pub mod regression;
pub mod two_way_slope;

/// The number, if it is one that can be printed.
pub(crate) fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

/// The rows of a table; `None` if there are none, or if they are empty or differ in
/// length.
pub(crate) fn rectangular<R: AsRef<[f64]>>(rows: &[R]) -> Option<Vec<&[f64]>> {
    let width = rows.first()?.as_ref().len();
    let rows: Vec<&[f64]> = rows.iter().map(AsRef::as_ref).collect();
    (width > 0 && rows.iter().all(|row| row.len() == width)).then_some(rows)
}
