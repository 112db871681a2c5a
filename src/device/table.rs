//! What a device demands of a table before it plays it.
//!
//! A device does not trust its host: a table with a hole in it would reach the
//! motor. This says nothing about how the table feels or whether it is passive.

use study_haptics::model::{Branch, Realization};
use study_wire::predict::Direction;

/// Checks that a table can be evaluated everywhere.
///
/// # Errors
/// A short sentence that says what is wrong, for [`super::DeviceError::Refused`].
pub fn check(realization: &Realization) -> Result<(), String> {
    let nodes = &realization.x_mm;
    if nodes.len() < 2 {
        return Err("it has fewer than two nodes".to_owned());
    }
    if nodes.iter().any(|x| !x.is_finite()) {
        return Err("a position is not a finite number".to_owned());
    }
    if let Some(i) = nodes.windows(2).position(|w| w[0] >= w[1]) {
        return Err(format!(
            "positions do not ascend: {} mm is followed by {} mm",
            nodes[i],
            nodes[i + 1]
        ));
    }
    for (name, branch) in [
        ("positive", &realization.positive),
        ("negative", &realization.negative),
    ] {
        check_branch(name, branch, nodes.len())?;
    }
    let [low, high] = realization.trained.x_mm;
    if !(low.is_finite() && high.is_finite() && low < high) {
        return Err(format!("the trained range {low} to {high} mm is none"));
    }
    let fastest = realization.trained.v_mm_s;
    if !(fastest.is_finite() && fastest > 0.0) {
        return Err(format!("the trained speed {fastest} mm/s is none"));
    }
    match realization.direction {
        Direction::Sign => Ok(()),
        Direction::Play { delta_mm } | Direction::Dahl { delta_mm } => {
            if delta_mm.is_finite() && delta_mm > 0.0 {
                Ok(())
            } else {
                Err(format!("the direction's delta_mm {delta_mm} is no length"))
            }
        }
    }
}

fn check_branch(name: &str, branch: &Branch, nodes: usize) -> Result<(), String> {
    for (parameter, values) in [
        ("m_kg", &branch.m_kg),
        ("b_n_s_per_mm", &branch.b_n_s_per_mm),
        ("k_n_per_mm", &branch.k_n_per_mm),
        ("f0_n", &branch.f0_n),
    ] {
        if values.len() != nodes {
            return Err(format!(
                "{name} {parameter} has {} values for {nodes} nodes",
                values.len()
            ));
        }
        if let Some(node) = values.iter().position(|v| !v.is_finite()) {
            return Err(format!(
                "{name} {parameter} is not a finite number at node {}",
                node + 1
            ));
        }
    }
    Ok(())
}
