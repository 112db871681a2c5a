//! Passive elements as a realization: see [`study_wire::elements`].

use super::{Branch, Provenance, Realization, Trained, Units};
use std::collections::BTreeMap;
use study_wire::elements::{ElementsView, MAX_SPRINGS, Spring};
use study_wire::predict::{Direction, Lookup};

/// A potential with dampers and springs in parallel. All profiles have one value per node.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Elements {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Positions of the nodes, mm, strictly ascending, at least two.
    pub x_mm: Vec<f64>,
    /// The force of the potential, N.
    pub force_n: Vec<f64>,
    /// Damping for v > 0 and v < 0, N·s/mm.
    pub damping_n_s_per_mm: [Vec<f64>; 2],
    /// The springs, at most [`MAX_SPRINGS`].
    pub springs: Vec<Spring>,
    /// The force of each spring, N.
    pub spring_n: Vec<Vec<f64>>,
}

impl Elements {
    /// As borrowed slices.
    pub fn view(&self) -> ElementsView<'_> {
        let mut spring_n: [&[f64]; MAX_SPRINGS] = [&[]; MAX_SPRINGS];
        for (slice, profile) in spring_n.iter_mut().zip(&self.spring_n) {
            *slice = profile;
        }
        let [forwards, backwards] = &self.damping_n_s_per_mm;
        ElementsView {
            x_mm: &self.x_mm,
            mass_kg: self.mass_kg,
            force_n: &self.force_n,
            damping_n_s_per_mm: [forwards, backwards],
            springs: &self.springs,
            spring_n,
        }
    }

    /// What it is in slow motion, for v > 0 and v < 0.
    fn at_rest(&self) -> [Branch; 2] {
        let view = self.view();
        [0, 1].map(|side| Branch {
            m_kg: vec![self.mass_kg; self.x_mm.len()],
            b_n_s_per_mm: self.damping_n_s_per_mm[side].clone(),
            k_n_per_mm: vec![0.0; self.x_mm.len()],
            f0_n: (self.x_mm.iter())
                .map(|x| view.static_n(*x, side == 0))
                .collect(),
        })
    }

    /// The way over which friction changes after a reversal, mm.
    fn reversal_mm(&self) -> f64 {
        let stops = self.springs.iter().filter_map(|spring| match spring {
            Spring::Stop { slip_mm } => Some(2.0 * slip_mm),
            _ => None,
        });
        let spacing = self.x_mm[1] - self.x_mm[0];
        let longest = stops.fold(0.0, f64::max);
        if longest > 0.0 { longest } else { spacing }
    }

    pub(super) fn shift(&mut self, by_mm: f64) {
        self.x_mm.iter_mut().for_each(|x| *x += by_mm);
        for spring in &mut self.springs {
            if let Spring::Latch { rearm_mm, break_mm } = spring {
                *rearm_mm += by_mm;
                *break_mm += by_mm;
            }
        }
    }

    /// In other units: factors of length, force and mass.
    pub(super) fn rescale(&mut self, x: f64, f: f64, m: f64) {
        let by = |values: &mut [f64], factor: f64| values.iter_mut().for_each(|v| *v *= factor);
        self.mass_kg *= m;
        by(&mut self.x_mm, x);
        by(&mut self.force_n, f);
        for damping in &mut self.damping_n_s_per_mm {
            by(damping, f / x);
        }
        for profile in &mut self.spring_n {
            by(profile, f);
        }
        for spring in &mut self.springs {
            match spring {
                Spring::Stop { slip_mm } | Spring::Maxwell { slip_mm, .. } => *slip_mm *= x,
                Spring::Latch { rearm_mm, break_mm } => {
                    *rearm_mm *= x;
                    *break_mm *= x;
                }
            }
        }
    }
}

impl Realization {
    /// Elements, with a table of what they are in slow motion.
    pub fn of_elements(
        id: String,
        provenance: Provenance,
        vaf: BTreeMap<String, f64>,
        trained: Trained,
        elements: Elements,
    ) -> Self {
        let [positive, negative] = elements.at_rest();
        Self {
            id,
            provenance,
            vaf,
            units: Units::Linear,
            lookup: Lookup::Linear,
            direction: Direction::Play {
                delta_mm: elements.reversal_mm(),
            },
            trained,
            x_mm: elements.x_mm.clone(),
            positive,
            negative,
            mechanism: None,
            elements: Some(elements),
        }
    }
}
