//! Realizations: a haptic model's parameters by position and direction.
//!
//! The paper's equation 1, F = m±(x) a + b±(x) v + k±(x) x + F0±(x), sampled at the
//! nodes `x_mm`. Units: x mm, v mm/s, a m/s², F N, hence m kg, b N·s/mm, k N/mm, F0 N.
//! F is the force that the probe applies to the target, positive with +x.
//! [`mod@file`] reads and writes model files. The predicted force
//! ([`study_wire::predict`]) and the passivity certificate ([`certificate`]) are shared
//! with the firmware.

mod alike;
pub mod coverage;
mod elements;
pub mod file;
mod strongest;
mod units;

pub use elements::Elements;
pub use units::Units;

use coverage::{Coverage, Determined};
use std::collections::BTreeMap;
use study_wire::certificate::{self, Certificate, windows};
use study_wire::mechanism::{self, MechanismView, Scalars};
use study_wire::predict::{BranchView, Direction, Lookup, TableView};

/// The `format` of a model file.
pub const FORMAT: &str = "study-model/1";
/// The `format` of a model file with a mechanism or of a turning handle.
pub const FORMAT_2: &str = "study-model/2";
/// The `format` of a model file with elements, or one that says what its recordings carry.
pub const FORMAT_3: &str = "study-model/3";

/// A haptic model's parameters and their origin: the contents of a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Realization {
    /// Identifier of the realization.
    pub id: String,
    /// How it was identified.
    pub provenance: Provenance,
    /// Variance accounted for, by name of the recording.
    pub vaf: BTreeMap<String, f64>,
    /// The units of all its numbers. Names of fields say mm and N, which holds for
    /// [`Units::Linear`]: the others are those of a file, before [`Self::at_lever`].
    pub units: Units,
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
    /// The mechanism that is rendered instead of the table. The table then has its mass,
    /// damping and static force: what it is at rest and in slow motion.
    pub mechanism: Option<Mechanism>,
    /// The elements that are rendered instead of the table, which is then what they are in
    /// slow motion.
    pub elements: Option<Elements>,
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

/// A virtual mechanism, see [`study_wire::mechanism`].
#[derive(Debug, Clone, PartialEq)]
pub struct Mechanism {
    /// The parameters that do not depend on the position.
    pub scalars: Scalars,
    /// The detent force on the follower, N.
    pub detent: Profile,
    /// The Coulomb friction of the follower, N.
    pub friction: Profile,
    /// Corner of the zero-phase low-pass that the recorded force had passed, Hz, and that
    /// its prediction therefore passes as well.
    pub recorded_hz: Option<f64>,
}

/// Values at equally spaced positions, at least two.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Position of the first value, mm.
    pub first_mm: f64,
    /// Distance of two values, mm.
    pub step_mm: f64,
    /// The values, N.
    pub n: Vec<f64>,
}

impl Mechanism {
    /// What it is at rest and in slow motion, at some positions: for v > 0 and v < 0.
    pub fn at_rest(&self, x_mm: &[f64]) -> [Branch; 2] {
        let (view, p) = (self.view(), &self.scalars);
        [true, false].map(|forwards| Branch {
            m_kg: vec![p.handle_kg + p.follower_kg; x_mm.len()],
            b_n_s_per_mm: vec![p.follower_n_s_per_mm + p.handle_n_s_per_mm; x_mm.len()],
            k_n_per_mm: vec![0.0; x_mm.len()],
            f0_n: x_mm.iter().map(|x| view.static_n(*x, forwards)).collect(),
        })
    }

    /// As borrowed slices.
    pub fn view(&self) -> MechanismView<'_> {
        MechanismView::new(self.scalars, self.detent.view(), self.friction.view())
    }
}

impl Profile {
    /// As a borrowed slice.
    pub fn view(&self) -> mechanism::Profile<'_> {
        mechanism::Profile {
            first_mm: self.first_mm,
            step_mm: self.step_mm,
            n: &self.n,
        }
    }

    /// The positions of the values, mm.
    pub fn x_mm(&self) -> impl Iterator<Item = f64> {
        (0..self.n.len()).map(|i| self.first_mm + i as f64 * self.step_mm)
    }
}

/// The range in which a realization was identified; outside it, the target is unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trained {
    /// Lowest and highest position, mm.
    pub x_mm: [f64; 2],
    /// Highest speed in either direction, mm/s: certificates hold up to it or a multiple of it, and all that says how
    /// fast the recordings were means this one.
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
    /// Where the recordings went. Files of versions 1 and 2 do not have it.
    pub coverage: Option<Coverage>,
    /// How well the recordings determine parameters, by the name of the parameter in a file
    /// with mm and N, such as `m_kg`.
    pub terms: BTreeMap<String, Determined>,
}

impl Realization {
    /// A mechanism, with a table of what it is at rest.
    pub fn of_mechanism(
        id: String,
        provenance: Provenance,
        vaf: BTreeMap<String, f64>,
        trained: Trained,
        mechanism: Mechanism,
    ) -> Self {
        let [low, high] = trained.x_mm;
        let inside = |x: &f64| *x > low && *x < high;
        let mut x_mm = vec![low];
        x_mm.extend(mechanism.detent.x_mm().filter(inside));
        x_mm.push(high);
        let [positive, negative] = mechanism.at_rest(&x_mm);
        Self {
            id,
            provenance,
            vaf,
            units: Units::Linear,
            lookup: Lookup::Linear,
            direction: Direction::Play {
                delta_mm: mechanism.scalars.gap_mm + mechanism.scalars.slip_mm,
            },
            trained,
            x_mm,
            positive,
            negative,
            mechanism: Some(mechanism),
            elements: None,
        }
    }

    /// The same at positions counted from elsewhere: a position of x mm becomes x + `by_mm`.
    pub fn shift(&mut self, by_mm: f64) {
        for x in self.x_mm.iter_mut().chain(&mut self.trained.x_mm) {
            *x += by_mm;
        }
        for branch in [&mut self.positive, &mut self.negative] {
            for (f0, k) in branch.f0_n.iter_mut().zip(&branch.k_n_per_mm) {
                *f0 -= k * by_mm;
            }
        }
        if let Some(mechanism) = &mut self.mechanism {
            mechanism.detent.first_mm += by_mm;
            mechanism.friction.first_mm += by_mm;
        }
        if let Some(elements) = &mut self.elements {
            elements.shift(by_mm);
        }
        if let Some(coverage) = &mut self.provenance.coverage {
            coverage.shift(by_mm);
        }
    }

    /// The same with a constant force added, N.
    pub fn raise(&mut self, by_n: f64) {
        let branches = [&mut self.positive, &mut self.negative];
        for f0 in branches.into_iter().flat_map(|branch| &mut branch.f0_n) {
            *f0 += by_n;
        }
        if let Some(mechanism) = &mut self.mechanism {
            mechanism.scalars.offset_n += by_n;
        }
        if let Some(elements) = &mut self.elements {
            elements.force_n.iter_mut().for_each(|n| *n += by_n);
        }
    }

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
        let mut certificate = self.certificate_of_device();
        if let (Direction::Play { delta_mm }, Lookup::Linear) = (self.direction, self.lookup)
            && self.mechanism.is_none()
            && self.elements.is_none()
            && !certificate.hysteresis.holds()
        {
            let mean = windows::least_mean_gap(&self.table(), delta_mm, self.trained.x_mm);
            if mean.holds() {
                certificate.hysteresis = mean;
            }
        }
        certificate
    }

    /// The certificate as a device computes it, which judges each position and no windows of
    /// play. What passes it passes [`Self::certificate`].
    pub fn certificate_of_device(&self) -> Certificate {
        if let Some(mechanism) = &self.mechanism {
            return mechanism.view().certificate(self.trained.v_mm_s);
        }
        if let Some(elements) = &self.elements {
            return elements.view().certificate(self.trained.v_mm_s);
        }
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
