//! Checks of a table before it is sent to a device.
//!
//! A device with an invalid table could apply any force. These checks say nothing
//! about how the table feels or whether it is passive.

use std::collections::BTreeMap;
use study_haptics::model::{Branch, Provenance, Realization, Trained, Units};
use study_wire::predict::{Direction, Lookup};

/// Why a table cannot be played.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum TableError {
    #[error(
        "it is a mechanism, and this device plays tables only (docs/wire.md 8.7, minor version 2)"
    )]
    Mechanism,
    #[error(
        "it is made of elements, which this device does not play (docs/wire.md 8.10, minor version 2)"
    )]
    Elements,
    #[error("its mechanism has {0} values; at most 65535 can be sent")]
    TooManyValues(usize),
    #[error("it has fewer than two nodes")]
    TooFewNodes,
    #[error("it has {0} nodes; at most 65535 can be sent")]
    TooManyNodes(usize),
    #[error("a position is not a finite number")]
    PositionNotFinite,
    #[error("positions do not ascend: {0} mm is followed by {1} mm")]
    NotAscending(f64, f64),
    #[error("the trained range {0} to {1} mm is invalid")]
    Range(f64, f64),
    #[error("the trained speed {0} mm/s is invalid")]
    Speed(f64),
    #[error("the direction's delta_mm {0} is invalid")]
    Delta(f64),
    #[error("{0} {1} has {2} values for {3} nodes")]
    Length(&'static str, &'static str, usize, usize),
    #[error("{0} {1} is not a finite number at node {2}")]
    ParameterNotFinite(&'static str, &'static str, usize),
}

/// A table of forces and damping at some positions, the same in both directions of motion, as tests
/// of a device play it.
pub fn both_ways(
    id: &str,
    x_mm: Vec<f64>,
    (force_n, damping_n_s_per_mm): (Vec<f64>, Vec<f64>),
    trained: Trained,
) -> Realization {
    let nodes = x_mm.len();
    let branch = Branch {
        m_kg: vec![0.0; nodes],
        b_n_s_per_mm: damping_n_s_per_mm,
        k_n_per_mm: vec![0.0; nodes],
        f0_n: force_n,
    };
    Realization {
        units: Units::Linear,
        id: id.to_owned(),
        provenance: Provenance::default(),
        vaf: BTreeMap::new(),
        lookup: Lookup::Linear,
        direction: Direction::Sign,
        trained,
        x_mm,
        positive: branch.clone(),
        negative: branch,
        mechanism: None,
        elements: None,
    }
}

/// Checks that the force of a table is defined everywhere.
///
/// # Errors
/// [`TableError`] with the first problem.
pub fn check(realization: &Realization) -> Result<(), TableError> {
    let nodes = &realization.x_mm;
    if nodes.len() < 2 {
        return Err(TableError::TooFewNodes);
    }
    if nodes.iter().any(|x| !x.is_finite()) {
        return Err(TableError::PositionNotFinite);
    }
    if let Some(pair) = nodes.windows(2).find(|pair| pair[0] >= pair[1]) {
        return Err(TableError::NotAscending(pair[0], pair[1]));
    }
    check_branch("positive", &realization.positive, nodes.len())?;
    check_branch("negative", &realization.negative, nodes.len())?;
    let [low, high] = realization.trained.x_mm;
    if !(low.is_finite() && high.is_finite() && low < high) {
        return Err(TableError::Range(low, high));
    }
    let positive = |value: f64| value.is_finite() && value > 0.0;
    if !positive(realization.trained.v_mm_s) {
        return Err(TableError::Speed(realization.trained.v_mm_s));
    }
    match realization.direction.delta_mm() {
        Some(delta_mm) if !positive(delta_mm) => Err(TableError::Delta(delta_mm)),
        _ => Ok(()),
    }
}

fn check_branch(branch: &'static str, values: &Branch, nodes: usize) -> Result<(), TableError> {
    for (parameter, values) in [
        ("m_kg", &values.m_kg),
        ("b_n_s_per_mm", &values.b_n_s_per_mm),
        ("k_n_per_mm", &values.k_n_per_mm),
        ("f0_n", &values.f0_n),
    ] {
        if values.len() != nodes {
            let count = values.len();
            return Err(TableError::Length(branch, parameter, count, nodes));
        }
        if let Some(node) = values.iter().position(|value| !value.is_finite()) {
            return Err(TableError::ParameterNotFinite(branch, parameter, node + 1));
        }
    }
    Ok(())
}
