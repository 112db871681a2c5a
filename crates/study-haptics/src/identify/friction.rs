//! The friction model: F = m a + b v + F_c z + F_0 with m, b, F_c ≥ 0 and a direction state z.
//!
//! It has no position. Of a joint or a damper, whose force hardly depends on the position,
//! it predicts more than a table with hundreds of parameters. Its table has two nodes with
//! equal parameters and passes its certificate by construction: S⁺ − S⁻ = 2 F_c.

use super::banded::{Banded, Bound};
use super::method::Terms;
use super::samples::{Theta, Weights, weight_of};
use super::vaf::motion;
use crate::recording::Recording;
use study_wire::predict::{Direction, DirectionState};

/// m, b, F_c, F_0.
const UNKNOWNS: usize = 4;

/// The parameters of either direction of least squared error; `None` if the recordings leave
/// them undetermined.
pub(super) fn parameters(
    recordings: &[&Recording],
    rule: Direction,
    terms: Terms,
    weights: Weights<'_>,
) -> Option<[Theta; 2]> {
    let mut normal = Banded::zero(UNKNOWNS, UNKNOWNS - 1);
    let mut right = [0.0; UNKNOWNS];
    for (r, recording) in recordings.iter().enumerate() {
        let mut state = DirectionState::default();
        for i in 0..recording.len() {
            let motion = motion(recording, i);
            let z = state.step(rule, motion);
            let trust = weight_of(weights, r, i);
            let features = [motion.a_m_s2, motion.v_mm_s, z, 1.0];
            for (row, one) in features.into_iter().enumerate() {
                right[row] += trust * one * recording.f_n[i];
                for (column, other) in features[..=row].iter().enumerate() {
                    normal.add(row, column, trust * one * other);
                }
            }
        }
    }
    let bounds = [
        Bound::of_term(terms.m),
        Bound::of_term(terms.b),
        Bound::NotNegative,
        Bound::Free,
    ];
    let found = normal.solve_bounded(&right, &bounds)?;
    let [m, b, coulomb_n, offset_n] = *found.first_chunk::<UNKNOWNS>()?;
    let finite = found.iter().all(|value| value.is_finite());
    let side = |sign: f64| [m, b, 0.0, offset_n + sign * coulomb_n];
    finite.then(|| [side(1.0), side(-1.0)])
}
