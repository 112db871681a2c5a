//! The damping that a target would have if all of its hysteresis were damping.
//!
//! Where a target goes both ways, its friction resists both, so that F⁺ − F⁻ ≥ b (v⁺ − v⁻) at each place, and
//!
//! ```text
//! b ≤ ∫ (F⁺ − F⁻) dx / ∫ (v⁺ − v⁻) dx
//! ```
//!
//! with the means of each direction. The mass has no part in it where both ways are alike, or begin and end at rest: ∮ m a dx is the change of the
//! kinetic energy. Unlike an estimate, this needs neither several speeds nor a shape of the friction. It is all that one slow press and release
//! says of the damping.

use super::equations::Row;

/// The bound, and what it is made of.
#[derive(Debug)]
pub(super) struct Dissipation {
    /// The quotient, N·s/mm; `None` if no place was passed in both directions.
    pub(super) damping: Option<f64>,
    /// The shares of the forces of all samples in it, s/mm.
    pub(super) weights: Vec<f64>,
}

impl Dissipation {
    /// Of samples beside `nodes` nodes that are equally far apart. The speed is that of the instruments, which has hardly any noise; where
    /// it is too low because it is a mean over time, the bound is higher.
    pub(super) fn of(rows: &[Row], nodes: usize) -> Self {
        let speed = |row: &Row| row.border[1];
        let direction = |row: &Row| usize::from(speed(row) > 0.0);
        // the ways through the surroundings of each node
        let mut ways = vec![[0.0; 2]; nodes];
        for row in rows {
            ways[row.node()][direction(row)] += speed(row).abs();
        }
        let mut weights: Vec<f64> = (rows.iter())
            .map(|row| match ways[row.node()] {
                [back, forth] if back > 0.0 && forth > 0.0 => {
                    speed(row) / [back, forth][direction(row)]
                }
                _ => 0.0,
            })
            .collect();
        let sum = |of: &dyn Fn(&Row) -> f64| -> f64 {
            let products = rows.iter().zip(&weights);
            products.map(|(row, weight)| weight * of(row)).sum()
        };
        let (force, speeds) = (sum(&|row| row.signals[0]), sum(&speed));
        // false for NaN
        let both_ways = speeds > 0.0;
        for weight in weights.iter_mut().filter(|_| both_ways) {
            *weight /= speeds;
        }
        Self {
            damping: both_ways.then_some(force / speeds),
            weights,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::evidence::equations::{EVERYWHERE, Rule, nodes, rows};
    use crate::identify::evidence::instruments::Instruments;
    use crate::recording::{Recording, read};
    use study_wire::predict::Direction;

    /// Two sines of 2 mm with a damper of 0.03 N·s/mm, a mass, a spring, and dry friction.
    fn bound(friction_n: f64) -> f64 {
        let w = std::f64::consts::TAU * 0.5;
        let mut text = String::from("t_s,x_mm,f_n\n");
        for i in 0..4000 {
            let t = 1e-3 * f64::from(i);
            let (x, v) = (-2.0 * (w * t).cos(), 2.0 * w * (w * t).sin());
            let f = 0.03 * v - 1e-3 * w * w * x + 0.5 * x + friction_n.copysign(v);
            text += &format!("{t},{x},{f}\n");
        }
        let recording = read("r", text.as_bytes()).unwrap();
        let recordings: [&Recording; 1] = [&recording];
        let nodes = nodes(&recordings, recording.range_mm());
        let instruments = [Instruments::new(&recording, 1)];
        let rule = Rule {
            direction: Direction::Sign,
            smooth: 1,
            other_lengths: false,
        };
        let rows = rows(&recordings, (&nodes, EVERYWHERE), rule, &instruments);
        Dissipation::of(&rows, nodes.len()).damping.unwrap()
    }

    /// Of a damper alone the bound is its damping; friction raises it by its force over the speed, whose mean over the travel is π/4 of
    /// the highest one, 2 mm · 2π 0.5 Hz.
    #[test]
    fn all_hysteresis_is_what_damping_can_be_at_most() {
        let without = bound(0.0);
        assert!((without - 0.03).abs() < 1e-4, "{without}");
        let mean_mm_s = std::f64::consts::FRAC_PI_4 * 2.0 * std::f64::consts::PI;
        let with = bound(0.2);
        let expected = 0.03 + 0.2 / mean_mm_s;
        assert!((with / expected - 1.0).abs() < 0.02, "{with} {expected}");
    }
}
