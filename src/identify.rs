//! From a recording to a realization.
//!
//! A [`Training`] is a recording grouped by direction of travel and sorted by x,
//! once; [`Training::identify`] makes one realization of it, [`grid::run`] one for
//! every λ and dx and compares each with other recordings. Samples with v = 0
//! belong to no direction and are left out; prediction gives them the direction
//! of the sample before.
//!
//! In this version: the paper's EWLS with a cold start and ascending order, point
//! and bin resampling, and two baselines. Not here: filtering (a recording is used
//! as it is), files, and what a terminal shows.
//!
//! Reference: Colton & Hollerbach, World Haptics 2007, equation 1 and section 4.

pub mod baseline;
pub mod ewls;
pub mod grid;
pub mod lanes;
pub mod resample;
pub mod vaf;

use crate::model::predict::{Direction, Lookup};
use crate::model::{Branch, Provenance, Realization, Trained};
use crate::recording::Recording;
use ewls::{Sorted, Theta};
use resample::{Resample, Resampled};
use std::fmt;

/// Samples of the recursion before its estimate rests on ten for each parameter.
const START_UP_SAMPLES: usize = 40;

/// Why a recording gives no realization.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// λ is out of range.
    #[error("lambda has to be above 0 and at most 1, not {0}")]
    Lambda(f64),
    /// dx is no length.
    #[error("dx has to be a length above 0 mm, not {0}")]
    Dx(f64),
    /// Fewer than two nodes fit.
    #[error("dx = {dx_mm} mm leaves {nodes} nodes in {low} to {high} mm: a table has at least two")]
    TooCoarse {
        /// mm.
        dx_mm: f64,
        /// How many fit.
        nodes: usize,
        /// Where both directions begin, mm.
        low: f64,
        /// Where the first of them ends, mm.
        high: f64,
    },
    /// More nodes than a table can have.
    #[error(
        "dx = {dx_mm} mm gives more than {most} nodes in {low} to {high} mm",
        most = resample::MOST_NODES
    )]
    TooFine {
        /// mm.
        dx_mm: f64,
        /// Where both directions begin, mm.
        low: f64,
        /// Where the first of them ends, mm.
        high: f64,
    },
    /// There is only one direction of travel.
    #[error("{recording} never moves with v {0} 0: both directions are needed", if *.positive { '>' } else { '<' })]
    OneDirection {
        /// Its name.
        recording: String,
        /// Which direction is missing.
        positive: bool,
    },
    /// The two directions were never at the same positions.
    #[error("{0}: the two directions have no range of x in common")]
    NoOverlap(String),
    /// The recursion left the range of numbers.
    #[error(
        "the estimates with lambda = {lambda} are no numbers: the recording does not excite all parameters; take a larger lambda"
    )]
    Diverged {
        /// The forgetting factor.
        lambda: f64,
    },
}

/// What is doubtful about a realization.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// Nodes without a sample of their own were filled from their neighbours.
    EmptyBins {
        /// Of the + direction.
        positive: usize,
        /// Of the − direction.
        negative: usize,
        /// Nodes of the table.
        of: usize,
    },
    /// Nodes where the recursion had hardly begun.
    StartUp {
        /// How many.
        nodes: usize,
        /// Up to where, mm.
        to_mm: f64,
    },
    /// A spring that pushes away: it has no stable place.
    NegativeSpring {
        /// N/mm.
        k_n_per_mm: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EmptyBins {
                positive,
                negative,
                of,
            } => write!(
                f,
                "of {of} nodes {positive} in + and {negative} in - have no sample and were filled from their neighbours"
            ),
            Self::StartUp { nodes, to_mm } => write!(
                f,
                "{nodes} nodes up to {to_mm:.2} mm rest on fewer than {START_UP_SAMPLES} samples"
            ),
            Self::NegativeSpring { k_n_per_mm } => {
                write!(f, "the spring pushes away, {k_n_per_mm:.4} N/mm")
            }
        }
    }
}

/// How a realization is identified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// The paper's, with forgetting factor `lambda` in (0, 1].
    Ewls {
        /// Forgetting factor.
        lambda: f64,
        /// How the estimates are brought to the nodes.
        resample: Resample,
    },
    /// Mean force by position and direction.
    Static,
    /// One straight line.
    Spring,
}

impl Method {
    /// As it stands in model files and arguments.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ewls { .. } => "ewls",
            Self::Static => "static",
            Self::Spring => "spring",
        }
    }
}

/// A recording ready to be identified from.
#[derive(Debug)]
pub struct Training<'r> {
    recording: &'r Recording,
    positive: Sorted,
    negative: Sorted,
    /// Where both directions have samples, mm.
    range_mm: [f64; 2],
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

    /// One θ a sample in both directions.
    ///
    /// # Errors
    /// [`IdentifyError`] if λ is not in (0, 1] or the estimates are no numbers.
    pub fn estimates(&self, lambda: f64) -> Result<Estimates, IdentifyError> {
        if !(lambda > 0.0 && lambda <= 1.0) {
            return Err(IdentifyError::Lambda(lambda));
        }
        let of = |samples| {
            let theta = ewls::estimate(samples, lambda);
            let finite = theta.iter().flatten().all(|p| p.is_finite());
            finite
                .then_some(theta)
                .ok_or(IdentifyError::Diverged { lambda })
        };
        Ok(Estimates {
            lambda,
            positive: of(&self.positive)?,
            negative: of(&self.negative)?,
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

    /// A table of the paper's method from estimates that were made before.
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
        let at_nodes = |samples: &Sorted, theta: &[Theta]| match resample {
            Resample::Point => resample::point(&samples.x_mm, theta, &nodes),
            Resample::Bin => resample::bin(&samples.x_mm, theta, &nodes, dx_mm),
        };
        let positive = at_nodes(&self.positive, &estimates.positive);
        let negative = at_nodes(&self.negative, &estimates.negative);
        let start_up = self.start_up_mm();
        let early = nodes.iter().filter(|node| **node < start_up).count();
        let mut identified = self.table(nodes, positive, negative, lookup);
        if early > 0 {
            identified.warnings.push(Warning::StartUp {
                nodes: early,
                to_mm: start_up,
            });
        }
        let memory = self.memory_mm(estimates.lambda);
        identified.realization.provenance = Provenance {
            method: "ewls".into(),
            lambda: Some(estimates.lambda),
            memory_mm: memory.is_finite().then_some(memory),
            dx_mm: Some(dx_mm),
            resample: Some(resample.word().into()),
            ..self.provenance()
        };
        Ok(identified)
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

    /// Up to where the recursion of one direction or the other has hardly begun.
    fn start_up_mm(&self) -> f64 {
        self.directions()
            .into_iter()
            .map(|samples| samples.x_mm[START_UP_SAMPLES.min(samples.len() - 1)])
            .fold(f64::NEG_INFINITY, f64::max)
    }

    fn provenance(&self) -> Provenance {
        Provenance {
            filter: Some("as recorded".into()),
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
        Identified {
            realization: Realization {
                id: String::new(),
                provenance: Provenance::default(),
                vaf: std::collections::BTreeMap::new(),
                lookup,
                direction: Direction::Sign,
                trained: Trained {
                    x_mm: self.range_mm,
                    v_mm_s: self.recording.top_speed_mm_s(),
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
    /// Forgetting factor.
    pub lambda: f64,
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

impl Identified {
    /// Share of the nodes of both directions with a negative mass, and with
    /// negative damping, 0 to 1.
    pub fn negative_shares(&self) -> [f64; 2] {
        let branches = [&self.realization.positive, &self.realization.negative];
        let share = |of: fn(&Branch) -> &Vec<f64>| {
            let all = branches.iter().flat_map(|b| of(b));
            let below = all.clone().filter(|p| **p < 0.0).count();
            below as f64 / all.count() as f64
        };
        [share(|b| &b.m_kg), share(|b| &b.b_n_s_per_mm)]
    }
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
