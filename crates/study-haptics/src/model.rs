//! The realization table: a haptic model's parameters by position and direction.
//!
//! The paper's equation 1, F = m±(x) a + b±(x) v + k±(x) x + F0±(x), sampled at
//! the nodes `x_mm`. Units: x mm, v mm/s, a m/s², F N, so m kg, b N·s/mm, k N/mm,
//! F0 N. F is the force that the probe applies to the target, positive with +x.
//! Reading and writing of model files is in [`mod@file`]; the force in [`predict`] and
//! whether it can be active in [`certificate`] use nothing but `core` and slices, so
//! that a firmware can share them.

pub mod file;

use std::collections::BTreeMap;
use study_wire::certificate::{self, Certificate};
use study_wire::predict::{BranchView, Direction, Lookup, TableView};

/// The version of the file format that this program writes and reads.
pub const FORMAT: &str = "study-model/1";

/// A haptic model's parameters, as a model file has them.
#[derive(Debug, Clone, PartialEq)]
pub struct Realization {
    /// The file's own name for it.
    pub id: String,
    /// How it came about.
    pub provenance: Provenance,
    /// Variance accounted for, by the name of the recording.
    pub vaf: BTreeMap<String, f64>,
    /// How parameters between nodes are found.
    pub lookup: Lookup,
    /// How the two branches are joined.
    pub direction: Direction,
    /// The range that the table was identified in.
    pub trained: Trained,
    /// Positions of the nodes, mm, strictly ascending, at least two.
    pub x_mm: Vec<f64>,
    /// For v > 0.
    pub positive: Branch,
    /// For v < 0.
    pub negative: Branch,
}

/// The parameters of one direction, one value a node.
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

/// Where a table was identified: outside it, nothing is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trained {
    /// Lowest and highest position, mm.
    pub x_mm: [f64; 2],
    /// Largest speed, mm/s.
    pub v_mm_s: f64,
}

/// How a table came about.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Provenance {
    /// Estimator, such as `ewls`.
    pub method: String,
    /// Forgetting factor, where the method has one.
    pub lambda: Option<f64>,
    /// L = 1 / ((1 − λ) ρ), mm, the smaller of the two directions.
    pub memory_mm: Option<f64>,
    /// Resampling increment, mm.
    pub dx_mm: Option<f64>,
    /// How the estimates were brought to the nodes: `point`, `bin`, `hat`.
    pub resample: Option<String>,
    /// The filter that the recordings went through.
    pub filter: Option<String>,
    /// Name → SHA-256 of each recording that was used.
    pub recordings: BTreeMap<String, String>,
    /// Anything else worth knowing, in words.
    pub note: Option<String>,
}

impl Realization {
    /// The table as borrowed slices, for [`predict`].
    pub fn table(&self) -> TableView<'_> {
        TableView {
            x_mm: &self.x_mm,
            positive: self.positive.view(),
            negative: self.negative.view(),
            lookup: self.lookup,
        }
    }

    /// Whether it can put energy into a hand, over the range that it was trained in.
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
