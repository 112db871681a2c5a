//! Tables for tests.

use study_haptics::model::{Branch, Realization, Trained, Units};
use study_wire::predict::{Direction, Lookup};

/// The direction rule of most tables.
pub(crate) const PLAY: Direction = Direction::Play { delta_mm: 0.5 };

/// A table for 1.5 to 33.5 mm with constant mass kg, damping N·s/mm and stiffness N/mm.
/// `offset_n` has the position, mm, and 1 or −1 for the direction.
pub(crate) fn table(
    id: &str,
    x_mm: Vec<f64>,
    [m, b, k]: [f64; 3],
    offset_n: impl Fn(f64, f64) -> f64,
    direction: Direction,
) -> Realization {
    let branch = |side: f64| Branch {
        m_kg: vec![m; x_mm.len()],
        b_n_s_per_mm: vec![b; x_mm.len()],
        k_n_per_mm: vec![k; x_mm.len()],
        f0_n: x_mm.iter().map(|x| offset_n(*x, side)).collect(),
    };
    Realization {
        id: id.to_owned(),
        provenance: Default::default(),
        vaf: Default::default(),
        lookup: Lookup::Linear,
        direction,
        trained: Trained {
            x_mm: [1.5, 33.5],
            v_mm_s: 138.0,
        },
        positive: branch(1.0),
        negative: branch(-1.0),
        x_mm,
        mechanism: None,
        units: Units::Linear,
    }
}

/// Nodes 1 mm apart.
pub(crate) fn fine() -> Vec<f64> {
    (2..=33).map(f64::from).collect()
}

/// Nodes 5 mm apart.
pub(crate) fn coarse() -> Vec<f64> {
    (0..=7).map(|i| 5.0 * f64::from(i)).collect()
}

/// Three detents of 1 N.
pub(crate) fn detent_n(x_mm: f64) -> f64 {
    ((x_mm - 5.0) / 12.5 * std::f64::consts::TAU).sin()
}
