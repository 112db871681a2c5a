//! From a recording to a realization.
//!
//! A [`Training`] is a recording grouped by direction of travel and sorted by x,
//! once. All estimators stand behind one call:
//!
//! ```text
//! Training::new(&recording)?.identify(method, dx_mm, lookup)? → Identified
//! ```
//!
//! * [`Method`]: which estimator, with every option of its own. `Display` is what a
//!   model file keeps of it.
//! * [`Identified`]: a [`Realization`] without id and VAF, the same for all methods,
//!   and what is doubtful about it. A node that rests on nothing is in the warnings.
//! * [`IdentifyError`]: why there is none.
//!
//! [`Training::estimates_of`] and [`Training::ewls`] are the two halves of the EWLS
//! family, for many dx from one recursion; [`grid::run`] makes a table for every λ
//! and dx and compares each with other recordings.
//!
//! Samples with v = 0 belong to no direction and are left out, except by the hat
//! table, whose direction state knows them; prediction gives them the direction of
//! the sample before. The nodes are multiples of dx inside the data of both
//! directions. Not here: filtering (a recording is used as it is), files, and what
//! a terminal shows. Formulas and measurements: `docs/estimators.md`.
//!
//! Reference: Colton & Hollerbach, World Haptics 2007, equation 1 and section 4.

mod banded;
pub mod baseline;
pub mod constrained;
pub mod ewls;
pub mod grid;
mod hat;
mod hat_table;
pub mod lanes;
pub mod method;
mod problem;
pub mod resample;
pub mod signal;
pub mod two_sided;
pub mod vaf;
pub mod validation;

pub use method::Method;
pub use problem::{IdentifyError, Warning};

use crate::model::{Branch, Provenance, Realization, Trained};
use crate::recording::Recording;
use ewls::{Sorted, Theta};
use method::{Ewls, Sort, Start, TwoSided, Width};
use problem::START_UP_SAMPLES;
use resample::{Resample, Resampled};
use study_wire::predict::{Direction, Lookup};

/// A recording ready to be identified from.
#[derive(Debug)]
pub struct Training<'r> {
    recording: &'r Recording,
    positive: Sorted,
    negative: Sorted,
    /// Where both directions have samples, mm.
    range_mm: [f64; 2],
    // every table asks for these two, and a grid has a hundred tables
    force_range_n: [f64; 2],
    top_speed_mm_s: f64,
}

impl<'r> Training<'r> {
    /// Groups by the sign of v and sorts by x.
    ///
    /// # Errors
    /// [`IdentifyError`] if a direction is missing or they do not overlap.
    pub fn new(recording: &'r Recording) -> Result<Self, IdentifyError> {
        let positive = sorted(recording, |v| v > 0.0);
        let negative = sorted(recording, |v| v < 0.0);
        for (samples, sign) in [(&positive, true), (&negative, false)] {
            if samples.is_empty() {
                return Err(IdentifyError::OneDirection {
                    recording: recording.name.clone(),
                    positive: sign,
                });
            }
        }
        let (plus, minus) = (positive.range_mm(), negative.range_mm());
        let low = plus[0].max(minus[0]);
        let high = plus[1].min(minus[1]);
        if low >= high {
            return Err(IdentifyError::NoOverlap(recording.name.clone()));
        }
        Ok(Self {
            recording,
            positive,
            negative,
            range_mm: [low, high],
            force_range_n: recording
                .f_n
                .iter()
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], f| {
                    [f.min(low), f.max(high)]
                }),
            top_speed_mm_s: recording.top_speed_mm_s(),
        })
    }

    /// The samples of v > 0 and of v < 0.
    pub fn directions(&self) -> [&Sorted; 2] {
        [&self.positive, &self.negative]
    }

    /// L of a forgetting factor in mm, the smaller of the two directions.
    pub fn memory_mm(&self, lambda: f64) -> f64 {
        self.positive
            .memory_mm(lambda)
            .min(self.negative.memory_mm(lambda))
    }

    /// A realization by any method. dx has no meaning for some, see
    /// [`Method::has_dx`].
    ///
    /// # Errors
    /// [`IdentifyError`] if an option is out of range or the recording does not
    /// suit the method.
    pub fn identify(
        &self,
        method: Method,
        dx_mm: f64,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        method.check()?;
        match method {
            Method::Ewls(options) => {
                // a fault of dx before the work begins
                self.nodes(dx_mm)?;
                let estimates = self.estimates_of(options)?;
                self.ewls(&estimates, dx_mm, options.resample, lookup)
            }
            Method::TwoSided(options) => self.two_sided(options, dx_mm, lookup),
            Method::Hat(options) => self.hat(options, dx_mm, lookup),
            Method::Static => self.static_profile(dx_mm, lookup),
            Method::Segments(options) => self.segments(options, lookup),
            Method::Spring => Ok(self.spring(lookup)),
        }
    }

    /// One θ a sample in both directions, by the paper's own recursion.
    ///
    /// # Errors
    /// [`IdentifyError`] if λ is not in (0, 1] or the estimates are no numbers.
    pub fn estimates(&self, lambda: f64) -> Result<Estimates, IdentifyError> {
        self.estimates_of(Ewls::paper(lambda, Resample::Point))
    }

    /// One θ a sample in both directions; `options.resample` has no part in it.
    ///
    /// # Errors
    /// [`IdentifyError`] if λ is not in (0, 1] or the estimates are no numbers.
    pub fn estimates_of(&self, options: Ewls) -> Result<Estimates, IdentifyError> {
        Method::Ewls(options).check()?;
        let of = |samples, backward| {
            let theta = ewls::estimate_with(samples, &options, backward);
            let finite = theta.iter().flatten().all(|p| p.is_finite());
            finite.then_some(theta).ok_or(IdentifyError::Diverged {
                lambda: options.lambda,
            })
        };
        Ok(Estimates {
            options,
            positive: of(&self.positive, false)?,
            negative: of(&self.negative, true)?,
        })
    }

    /// The nodes of a table.
    ///
    /// # Errors
    /// [`IdentifyError`] if dx does not suit the recording.
    pub fn nodes(&self, dx_mm: f64) -> Result<Vec<f64>, IdentifyError> {
        let [low, high] = self.range_mm;
        if !(dx_mm.is_finite() && dx_mm > 0.0) {
            return Err(IdentifyError::Dx(dx_mm));
        }
        if (high - low) / dx_mm >= resample::MOST_NODES as f64 {
            return Err(IdentifyError::TooFine { dx_mm, low, high });
        }
        let nodes = resample::nodes(low, high, dx_mm);
        if nodes.len() < 2 {
            return Err(IdentifyError::TooCoarse {
                dx_mm,
                nodes: nodes.len(),
                low,
                high,
            });
        }
        Ok(nodes)
    }

    /// A table of the EWLS family from estimates that were made before.
    ///
    /// # Errors
    /// [`IdentifyError`] if dx does not suit the recording.
    pub fn ewls(
        &self,
        estimates: &Estimates,
        dx_mm: f64,
        resample: Resample,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        let nodes = self.nodes(dx_mm)?;
        let at_nodes = |samples: &Sorted, theta: &[Theta]| {
            resample::at_nodes(resample, &samples.x_mm, theta, &nodes, dx_mm)
        };
        let positive = at_nodes(&self.positive, &estimates.positive);
        let negative = at_nodes(&self.negative, &estimates.negative);
        let options = Ewls {
            resample,
            ..estimates.options
        };
        Ok(self.ewls_table(options, dx_mm, nodes, positive, negative, lookup))
    }

    /// A table of the EWLS family from values at its nodes.
    fn ewls_table(
        &self,
        options: Ewls,
        dx_mm: f64,
        nodes: Vec<f64>,
        positive: Resampled,
        negative: Resampled,
        lookup: Lookup,
    ) -> Identified {
        let start_up = self.start_up(&options, &nodes);
        let mut identified = self.table(nodes, positive, negative, lookup);
        identified.warnings.extend(start_up);
        let memory = self.memory_mm(options.lambda);
        identified.realization.provenance = Provenance {
            method: Method::Ewls(options).to_string(),
            lambda: Some(options.lambda),
            memory_mm: memory.is_finite().then_some(memory),
            dx_mm: Some(dx_mm),
            resample: Some(options.resample.word().into()),
            ..self.provenance()
        };
        identified
    }

    /// Mean force by position and direction.
    ///
    /// # Errors
    /// [`IdentifyError`] if dx does not suit the recording.
    pub fn static_profile(&self, dx_mm: f64, lookup: Lookup) -> Result<Identified, IdentifyError> {
        let nodes = self.nodes(dx_mm)?;
        let positive = baseline::static_profile(&self.positive, &nodes, dx_mm);
        let negative = baseline::static_profile(&self.negative, &nodes, dx_mm);
        let mut identified = self.table(nodes, positive, negative, lookup);
        identified.realization.provenance = Provenance {
            method: "static".into(),
            dx_mm: Some(dx_mm),
            resample: Some("bin".into()),
            ..self.provenance()
        };
        Ok(identified)
    }

    /// One straight line, as a table of two nodes at the ends of the range.
    pub fn spring(&self, lookup: Lookup) -> Identified {
        let theta = baseline::spring(self.recording);
        let both = Resampled {
            theta: vec![theta; 2],
            empty: 0,
        };
        let mut identified = self.table(self.range_mm.to_vec(), both.clone(), both, lookup);
        identified.realization.provenance = Provenance {
            method: "spring".into(),
            ..self.provenance()
        };
        if theta[2] < 0.0 {
            identified.warnings.push(Warning::NegativeSpring {
                k_n_per_mm: theta[2],
            });
        }
        identified
    }

    /// Least squares around each node.
    fn two_sided(
        &self,
        options: TwoSided,
        dx_mm: f64,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        let nodes = self.nodes(dx_mm)?;
        let width = |samples: &Sorted| match options.width {
            Width::Mm(mm) => mm,
            Width::Lambda(lambda) => samples.memory_mm(lambda),
        };
        let of = |samples: &Sorted| {
            let l_mm = width(samples);
            two_sided::at_nodes(samples, &nodes, options.window, l_mm, options.bounded)
                .ok_or(IdentifyError::Narrow { width_mm: l_mm })
        };
        let (positive, negative) = (of(&self.positive)?, of(&self.negative)?);
        let mut identified = self.table(nodes, positive, negative, lookup);
        // what is filled here is not empty but thin
        for warning in &mut identified.warnings {
            if let Warning::EmptyBins {
                positive,
                negative,
                of,
            } = *warning
            {
                *warning = Warning::Thin {
                    positive,
                    negative,
                    of,
                };
            }
        }
        identified.realization.provenance = Provenance {
            method: Method::TwoSided(options).to_string(),
            lambda: Method::TwoSided(options).lambda(),
            memory_mm: Some(width(&self.positive).min(width(&self.negative))),
            dx_mm: Some(dx_mm),
            ..self.provenance()
        };
        Ok(identified)
    }

    /// The nodes where the recursion of one direction or the other has hardly
    /// begun; with a warm start there are none.
    fn start_up(&self, options: &Ewls, nodes: &[f64]) -> Option<Warning> {
        if options.start == Start::Warm {
            return None;
        }
        let fortieth = |x: &[f64]| x[START_UP_SAMPLES.min(x.len() - 1)];
        let mut low = fortieth(&self.positive.x_mm);
        let mut high = f64::INFINITY;
        match options.sort {
            Sort::Ascending => low = low.max(fortieth(&self.negative.x_mm)),
            Sort::Travel => {
                let x = &self.negative.x_mm;
                high = x[x.len() - 1 - START_UP_SAMPLES.min(x.len() - 1)];
            }
        }
        let early: Vec<f64> = nodes
            .iter()
            .copied()
            .filter(|node| *node < low || *node > high)
            .collect();
        early.last().map(|last| Warning::StartUp {
            nodes: early.len(),
            to_mm: *last,
        })
    }

    fn provenance(&self) -> Provenance {
        Provenance {
            filter: Some(match self.recording.filter() {
                Some(words) => format!("as recorded: {words}"),
                None => "as recorded".into(),
            }),
            recordings: [(self.recording.name.clone(), self.recording.sha256.clone())].into(),
            // a probe's program writes there what was recorded, and whether it is real
            note: self.recording.header.first().cloned(),
            ..Provenance::default()
        }
    }

    fn table(
        &self,
        nodes: Vec<f64>,
        positive: Resampled,
        negative: Resampled,
        lookup: Lookup,
    ) -> Identified {
        let mut warnings = Vec::new();
        if positive.empty + negative.empty > 0 {
            warnings.push(Warning::EmptyBins {
                positive: positive.empty,
                negative: negative.empty,
                of: nodes.len(),
            });
        }
        let both = [&positive.theta, &negative.theta];
        warnings.extend(problem::unmeasured(self.force_range_n, &nodes, both));
        Identified {
            realization: Realization {
                id: String::new(),
                provenance: Provenance::default(),
                vaf: std::collections::BTreeMap::new(),
                lookup,
                direction: Direction::Sign,
                trained: Trained {
                    x_mm: self.range_mm,
                    v_mm_s: self.top_speed_mm_s,
                },
                x_mm: nodes,
                positive: branch(&positive.theta),
                negative: branch(&negative.theta),
            },
            warnings,
        }
    }
}

/// One θ a sample, in the order of [`Training::directions`].
#[derive(Debug, Clone)]
pub struct Estimates {
    /// How they were made.
    pub options: Ewls,
    /// Of v > 0.
    pub positive: Vec<Theta>,
    /// Of v < 0.
    pub negative: Vec<Theta>,
}

/// A realization without an id and without VAF, and what is doubtful about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// The table.
    pub realization: Realization,
    /// What is doubtful.
    pub warnings: Vec<Warning>,
}

fn sorted(recording: &Recording, belongs: impl Fn(f64) -> bool) -> Sorted {
    let mut order: Vec<usize> = (0..recording.len())
        .filter(|i| belongs(recording.v_mm_s[*i]))
        .collect();
    // stable: ties keep their order in time
    order.sort_by(|a, b| recording.x_mm[*a].total_cmp(&recording.x_mm[*b]));
    let pick = |column: &[f64]| order.iter().map(|i| column[*i]).collect();
    Sorted {
        x_mm: pick(&recording.x_mm),
        v_mm_s: pick(&recording.v_mm_s),
        a_m_s2: pick(&recording.a_m_s2),
        f_n: pick(&recording.f_n),
    }
}

fn branch(theta: &[Theta]) -> Branch {
    let pick = |i: usize| theta.iter().map(|t| t[i]).collect();
    Branch {
        m_kg: pick(0),
        b_n_s_per_mm: pick(1),
        k_n_per_mm: pick(2),
        f0_n: pick(3),
    }
}
