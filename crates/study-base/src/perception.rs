//! What people can feel.

/// Just noticeable difference of a force of 1 N or more, N: below it, two forces of the same
/// motion are hardly told apart (Doerrer & Werthschützky 2002, on push-buttons and levers).
pub const FORCE_JND_N: f64 = 0.1;

/// Weber fraction of a force: differences are noticed in proportion to it. 7 to 10 % are
/// reported (Jones 1989; Pang, Tan & Durlach 1991).
const WEBER_FRACTION: f64 = 0.1;

/// The just noticeable difference in force, N, of a realization or recording whose greatest
/// force is `greatest_n`: [`FORCE_JND_N`], and a tenth of the greatest force of one weaker
/// than 1 N, such as a key.
///
/// ```
/// use study_base::perception::force_jnd_n;
/// assert_eq!(force_jnd_n(9.0), 0.1);
/// assert!((force_jnd_n(-0.6) - 0.06).abs() < 1e-15);
/// ```
pub fn force_jnd_n(greatest_n: f64) -> f64 {
    FORCE_JND_N.min(WEBER_FRACTION * greatest_n.abs())
}
