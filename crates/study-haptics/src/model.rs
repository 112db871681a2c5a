//! Realizations: a haptic model's parameters by position and direction.
//!
//! The paper's equation 1, F = m±(x) a + b±(x) v + k±(x) x + F0±(x), sampled at the
//! nodes `x_mm`. Units: x mm, v mm/s, a m/s², F N, hence m kg, b N·s/mm, k N/mm, F0 N.
//! F is the force that the probe applies to the target, positive with +x.
//! [`mod@file`] reads and writes model files. The predicted force
//! ([`study_wire::predict`]) and the passivity certificate ([`certificate`]) are shared
//! with the firmware.

pub mod file;

use std::collections::BTreeMap;
use study_wire::certificate::{self, Certificate};
use study_wire::predict::{BranchView, Direction, Lookup, TableView};

/// The `format` of a model file.
pub const FORMAT: &str = "study-model/1";

/// A haptic model's parameters and their origin: the contents of a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Realization {
    /// Its id.
    pub id: String,
    /// How it was identified.
    pub provenance: Provenance,
    /// Variance accounted for, by name of the recording.
    pub vaf: BTreeMap<String, f64>,
    /// How parameters between nodes are found.
    pub lookup: Lookup,
    /// How the two branches are combined.
    pub direction: Direction,
    /// The range in which it was identified.
    pub trained: Trained,
    /// Positions of the nodes, mm, strictly ascending, at least two.
    pub x_mm: Vec<f64>,
    /// Parameters for v > 0.
    pub positive: Branch,
    /// Parameters for v < 0.
    pub negative: Branch,
}

/// The parameters of one direction, one value per node.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Branch {
    /// Mass, kg.
    pub m_kg: Vec<f64>,
    /// Damping, N·s/mm.
    pub b_n_s_per_mm: Vec<f64>,
    /// Stiffness, N/mm.
    pub k_n_per_mm: Vec<f64>,
    /// Offset force, N.
    pub f0_n: Vec<f64>,
}

/// The range in which a realization was identified; outside it, the target is unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trained {
    /// Lowest and highest position, mm.
    pub x_mm: [f64; 2],
    /// Highest speed, mm/s.
    pub v_mm_s: f64,
}

/// How a realization was identified.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Provenance {
    /// The estimator with its options, such as `ewls start=warm`.
    pub method: String,
    /// Forgetting factor, if the method has one.
    pub lambda: Option<f64>,
    /// The memory L = 1 / ((1 − λ) ρ), mm, the smaller of the two directions.
    pub memory_mm: Option<f64>,
    /// Resampling increment, mm.
    pub dx_mm: Option<f64>,
    /// Resampling method: `point`, `bin`, `hat`.
    pub resample: Option<String>,
    /// The filter applied to the recordings.
    pub filter: Option<String>,
    /// SHA-256 hash of each recording, by name.
    pub recordings: BTreeMap<String, String>,
    /// Remarks.
    pub note: Option<String>,
}

impl Realization {
    /// The table as borrowed slices, for [`study_wire::predict`].
    pub fn table(&self) -> TableView<'_> {
        TableView {
            x_mm: &self.x_mm,
            positive: self.positive.view(),
            negative: self.negative.view(),
            lookup: self.lookup,
        }
    }

    /// The passivity certificate over the trained range: whether the realization can
    /// supply energy to a hand.
    pub fn certificate(&self) -> Certificate {
        let range = certificate::Range {
            x_mm: self.trained.x_mm,
            v_mm_s: self.trained.v_mm_s,
        };
        certificate::certify(&self.table(), self.direction, range)
    }
}

impl Branch {
    /// As borrowed slices.
    pub fn view(&self) -> BranchView<'_> {
        BranchView {
            m_kg: &self.m_kg,
            b_n_s_per_mm: &self.b_n_s_per_mm,
            k_n_per_mm: &self.k_n_per_mm,
            f0_n: &self.f0_n,
        }
    }
}
