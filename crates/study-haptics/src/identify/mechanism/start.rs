//! Where the fit starts: the detents of a passive table, and two guesses of the backlash
//! and of the share of the mass before it.

use crate::identify::method::Terms;
use crate::identify::{IdentifyError, Passive, Training};
use crate::model::{Mechanism, Profile};
use study_wire::mechanism::Scalars;
use study_wire::predict::Lookup;

/// Least number of intervals of F_c over the travel.
const FRICTIONS: f64 = 8.0;
/// Backlash at the start, as multiples of the δ of the passive table.
const GAPS: [f64; 2] = [0.6, 2.0];
/// Share of the mass before the backlash at the start.
const BEFORE: [f64; 2] = [0.35, 0.7];

/// The starts.
///
/// # Errors
/// [`IdentifyError`] if the recordings do not suit a passive table.
pub(super) fn starts(training: &Training<'_>, dx_mm: f64) -> Result<Vec<Mechanism>, IdentifyError> {
    let method = Passive {
        terms: Terms::ALL,
        ..Passive::default()
    };
    let table = training
        .identify(method, dx_mm, Lookup::Linear)?
        .realization;
    let delta_mm = table.direction.delta_mm().unwrap_or(dx_mm);
    let nodes = &table.x_mm;
    let middle = |i: usize| 0.5 * (table.positive.f0_n[i] + table.negative.f0_n[i]);
    let half = |i: usize| 0.5 * (table.positive.f0_n[i] - table.negative.f0_n[i]);
    let mut halves: Vec<f64> = (0..nodes.len()).map(half).collect();
    halves.sort_by(f64::total_cmp);
    let friction_n = halves[halves.len() / 2];
    let mass_kg = table.positive.m_kg[0];
    let b = [&table.positive, &table.negative].map(|branch| &branch.b_n_s_per_mm);
    let damping = b.iter().flat_map(|b| b.iter()).sum::<f64>() / (2 * nodes.len()) as f64;

    // the follower goes beyond the nodes of the table by less than this
    let [low, high] = training.range_mm;
    let travel_mm = high - low;
    let first = ((low - dx_mm) / dx_mm).floor();
    let last = ((high + dx_mm) / dx_mm).ceil();
    let detent = Profile {
        first_mm: first * dx_mm,
        step_mm: dx_mm,
        n: (first as i64..=last as i64)
            .map(|i| {
                let x_mm = i as f64 * dx_mm;
                let at = nodes.partition_point(|node| *node < x_mm - 0.5 * dx_mm);
                middle(at.min(nodes.len() - 1))
            })
            .collect(),
    };
    // every node of F_c is one of D, so that both fit into one table on the wire
    let every = (travel_mm / FRICTIONS / dx_mm).floor().max(1.0);
    let friction = Profile {
        first_mm: detent.first_mm,
        step_mm: every * dx_mm,
        n: vec![0.8 * friction_n; ((last - first) / every).ceil() as usize + 1],
    };
    let range = |values: &[f64]| {
        let [low, high] = crate::recording::range(values);
        high - low
    };
    let force_n = range(&detent.n).max(friction_n);
    let contact_n_per_mm = 30.0 * force_n / travel_mm;
    let mass_kg = mass_kg.max(1e-3 * force_n);
    let slip_mm = travel_mm / 500.0;
    let of = |gap: f64, before: f64| {
        let follower_kg = (1.0 - before) * mass_kg;
        let critical = (1e-3 * follower_kg * contact_n_per_mm).sqrt();
        Mechanism {
            scalars: Scalars {
                handle_kg: before * mass_kg,
                follower_kg,
                contact_n_per_mm,
                contact_n_s_per_mm: 0.3 * critical,
                gap_mm: gap * delta_mm,
                follower_n_s_per_mm: 0.7 * damping,
                slip_mm,
                stribeck: 0.2,
                stribeck_mm_s: 0.03 * training.top_speed_mm_s,
                handle_n: 0.2 * friction_n,
                handle_slip_mm: slip_mm,
                handle_n_s_per_mm: 0.3 * damping,
                offset_n: 0.0,
            },
            detent: detent.clone(),
            friction: friction.clone(),
            recorded_hz: None,
        }
    };
    Ok(GAPS
        .iter()
        .flat_map(|gap| BEFORE.iter().map(|before| of(*gap, *before)))
        .collect())
}
