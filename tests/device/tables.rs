//! Tables for tests.

use study_haptics::model::{Branch, Elements, Provenance, Realization, Trained, Units};
use study_wire::elements::Spring;
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
        elements: None,
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

/// Detents with friction, branches that relax in 5 ms to 5 s, and a latch. Where a position in
/// single precision lies on the other side of the latch's ends both may be one period apart, so that
/// the ends are between the counts of the encoder.
pub(crate) fn elements() -> Realization {
    let x_mm: Vec<f64> = (0..=60).map(|i| 2.0 + 0.5 * f64::from(i)).collect();
    let of = |value: fn(f64) -> f64| x_mm.iter().map(|x| value(*x)).collect::<Vec<f64>>();
    let own = Elements {
        mass_kg: 0.08,
        force_n: of(|x| 4.0 * (0.5 * x).sin()),
        damping_n_s_per_mm: [of(|_| 0.003), of(|x| 0.002 + 0.001 * x.cos().abs())],
        springs: vec![
            Spring::Stop { slip_mm: 0.15 },
            Spring::Maxwell {
                slip_mm: 8.0,
                relaxation_s: 0.005,
            },
            Spring::Maxwell {
                slip_mm: 30.0,
                relaxation_s: 5.0,
            },
            Spring::Latch {
                rearm_mm: 14.0005,
                break_mm: 17.0005,
            },
            Spring::Stop { slip_mm: 2.0 },
        ],
        spring_n: vec![
            of(|x| 0.8 + 0.4 * (0.9 * x).sin()),
            of(|_| 12.0),
            of(|_| 6.0),
            of(|x| if (13.0..18.0).contains(&x) { 1.5 } else { 0.0 }),
            of(|x| 0.3 * (x - 15.0).abs() / 15.0),
        ],
        x_mm: x_mm.clone(),
    };
    let trained = Trained {
        x_mm: [2.0, 32.0],
        v_mm_s: 200.0,
    };
    let vaf = std::collections::BTreeMap::new();
    Realization::of_elements("e".to_owned(), Provenance::default(), vaf, trained, own)
}
