//! Identification: from a recording to a realization.
//!
//! A [`Training`] groups a recording by direction of travel and sorts each group by
//! position, once. All estimators share one call:
//!
//! ```text
//! Training::new(&recording)?.identify(method, dx_mm, lookup)? → Identified
//! ```
//!
//! * [`Method`]: the estimator with its options. Model files keep its `Display`.
//! * [`Identified`]: a [`Realization`] without id and VAF, and the warnings about it.
//!   The same for all methods.
//! * [`IdentifyError`]: why identification failed.
//!
//! [`Training::estimates`] and [`Training::ewls`] are the two halves of the EWLS
//! family: one recursion serves many dx. [`grid::run`] identifies a realization for
//! every λ and dx and validates each on other recordings.
//!
//! Samples with v = 0 belong to no direction and are left out, except by the hat
//! table, whose direction state is defined for them; prediction assigns them the
//! direction of the previous sample. The nodes are the multiples of dx in the range
//! that both directions cover. Recordings are used unfiltered: [`signal`] has the
//! filters. Formulas and results: `docs/estimators.md`.
//!
//! Reference: Colton & Hollerbach, World Haptics 2007, equation 1 and section 4.

mod banded;
pub mod baseline;
pub mod compare;
pub mod constrained;
pub mod delivery;
pub mod evidence;
pub mod ewls;
pub mod folds;
pub mod forecast;
mod friction;
pub mod grid;
mod hat;
mod hat_table;
pub mod lanes;
pub mod mechanism;
pub mod method;
mod passive;
mod problem;
pub mod repetition;
pub mod resample;
pub mod samples;
pub mod signal;
pub mod two_sided;
pub mod vaf;
pub mod validation;

pub use method::Method;
pub use problem::{Cause, IdentifyError, Warning};
pub use samples::{Samples, Theta};

use crate::model::{Branch, Mechanism, Provenance, Realization, Trained};
use crate::recording::{Recording, range};
use evidence::{Evidence, Term};
use mechanism::{Fitted, Progress};
use method::{Ewls, Sort, Start, TwoSided, Width};
use problem::START_UP_SAMPLES;
use resample::{Resample, Resampled};
use std::sync::OnceLock;
use study_wire::predict::{Direction, Lookup};

/// One or more recordings of a target, prepared for identification.
#[derive(Debug)]
pub struct Training<'r> {
    recordings: Vec<&'r Recording>,
    /// Of their samples, where they are not all 1.
    weights: Option<Vec<Vec<f64>>>,
    positive: Samples,
    negative: Samples,
    /// Where both directions have samples, mm.
    range_mm: [f64; 2],
    // every table of a grid needs these two
    force_range_n: [f64; 2],
    top_speed_mm_s: f64,
    /// Of mass and damping, computed when first asked for.
    evidence: OnceLock<Option<[Evidence; 2]>>,
}

impl<'r> Training<'r> {
    /// One recording: see [`Self::of`].
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn new(recording: &'r Recording) -> Result<Self, IdentifyError> {
        Self::of(&[recording])
    }

    /// Groups the samples of all recordings by the sign of v and sorts each group by x.
    /// A direction state starts anew in each recording.
    ///
    /// # Errors
    /// [`IdentifyError`] if a direction has no samples or the directions do not
    /// overlap in x.
    pub fn of(recordings: &[&'r Recording]) -> Result<Self, IdentifyError> {
        Self::weighted(recordings, None)
    }

    /// [`Self::of`] samples with weights: those of weight 0 are left out. Only methods that sum over
    /// samples in order of time use other weights than 0 and 1.
    fn weighted(
        recordings: &[&'r Recording],
        weights: Option<Vec<Vec<f64>>>,
    ) -> Result<Self, IdentifyError> {
        let positive = Samples::of(recordings, weights.as_deref(), |v| v > 0.0);
        let negative = Samples::of(recordings, weights.as_deref(), |v| v < 0.0);
        let names: Vec<&str> = recordings.iter().map(|r| r.name.as_str()).collect();
        let names = names.join(", ");
        let range_of = |samples: &Samples, positive| {
            (samples.range_mm()).ok_or_else(|| IdentifyError::OneDirection {
                recording: names.clone(),
                positive,
            })
        };
        let (plus, minus) = (range_of(&positive, true)?, range_of(&negative, false)?);
        let low = plus[0].max(minus[0]);
        let high = plus[1].min(minus[1]);
        if low >= high {
            return Err(IdentifyError::NoOverlap(names));
        }
        let forces = recordings.iter().map(|r| range(&r.f_n));
        Ok(Self {
            recordings: recordings.to_vec(),
            weights,
            positive,
            negative,
            range_mm: [low, high],
            force_range_n: forces.fold([f64::INFINITY, f64::NEG_INFINITY], |all, one| {
                [all[0].min(one[0]), all[1].max(one[1])]
            }),
            top_speed_mm_s: (recordings.iter().map(|r| r.top_speed_mm_s())).fold(0.0, f64::max),
            evidence: OnceLock::new(),
        })
    }

    /// The recordings.
    pub fn recordings(&self) -> &[&'r Recording] {
        &self.recordings
    }

    /// The samples with v > 0 and those with v < 0.
    pub fn directions(&self) -> [&Samples; 2] {
        [&self.positive, &self.negative]
    }

    /// The memory L of a forgetting factor, mm: the smaller of the two directions.
    /// `None` if it is unlimited (λ = 1).
    pub fn memory_mm(&self, lambda: f64) -> Option<f64> {
        let [plus, minus] = self.directions().map(|samples| samples.memory_mm(lambda));
        Some(plus?.min(minus?))
    }

    /// What the recordings say about mass and damping; `None` if they are too short.
    pub fn evidence(&self) -> Option<&[Evidence; 2]> {
        let of = || evidence::of(&self.recordings, self.range_mm);
        self.evidence.get_or_init(of).as_ref()
    }

    /// The method without the terms that the recordings do not carry, if it asks for that, and
    /// a warning for each.
    fn carried(&self, mut method: Method) -> (Method, Vec<Warning>) {
        let mut left_out = Vec::new();
        if let Some(terms) = method.terms_mut().filter(|terms| terms.only_carried) {
            terms.only_carried = false;
            for evidence in self.evidence().into_iter().flatten() {
                let kept = match evidence.term {
                    Term::Mass => &mut terms.m,
                    Term::Damping => &mut terms.b,
                };
                if *kept && !evidence.is_carried() {
                    *kept = false;
                    left_out.push(Warning::LeftOut(*evidence));
                }
            }
        }
        (method, left_out)
    }

    /// Identifies a realization. Methods without dx ignore `dx_mm`, see
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
        let (method, left_out) = self.carried(method);
        let mut identified = self.identify_as_asked(method, dx_mm, lookup)?;
        identified.warnings.extend(left_out);
        Ok(identified)
    }

    fn identify_as_asked(
        &self,
        method: Method,
        dx_mm: f64,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        match method {
            Method::Ewls(options) => {
                // check dx before the long computation
                self.nodes(dx_mm)?;
                let estimates = self.estimates(options)?;
                self.ewls(&estimates, dx_mm, options.resample, lookup)
            }
            Method::TwoSided(options) => self.two_sided(options, dx_mm, lookup),
            Method::Hat(options) => self.hat(options, dx_mm, lookup),
            Method::Passive(options) => self.passive(options, dx_mm, lookup),
            Method::Mechanism(options) => self.mechanism(options, dx_mm, |_| ()),
            Method::Friction(options) => self.friction(options, lookup),
            Method::Static => self.static_profile(dx_mm, lookup),
            Method::Segments(options) => self.segments(options, lookup),
            Method::Spring => Ok(self.spring(lookup)),
        }
    }

    /// One estimate of θ per sample, in both directions. `options.resample` is not
    /// used.
    ///
    /// # Errors
    /// [`IdentifyError`] if λ is not in (0, 1] or an estimate is not finite.
    pub fn estimates(&self, options: Ewls) -> Result<Estimates, IdentifyError> {
        Method::Ewls(options).check()?;
        let estimate = |samples, backward| {
            let theta = ewls::estimate(samples, &options, backward);
            let finite = theta.iter().flatten().all(|p| p.is_finite());
            finite.then_some(theta).ok_or(IdentifyError::Diverged {
                lambda: options.lambda,
            })
        };
        Ok(Estimates {
            options,
            positive: estimate(&self.positive, false)?,
            negative: estimate(&self.negative, true)?,
        })
    }

    /// The positions of a table's nodes, mm.
    ///
    /// # Errors
    /// [`IdentifyError`] if dx does not suit the recording.
    pub fn nodes(&self, dx_mm: f64) -> Result<Vec<f64>, IdentifyError> {
        let [low, high] = self.range_mm;
        if !(dx_mm.is_finite() && dx_mm > 0.0) {
            return Err(IdentifyError::Dx(dx_mm));
        }
        if (high - low) / dx_mm >= resample::MAX_NODES as f64 {
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

    /// A table of the EWLS family from estimates computed before.
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
        let at_nodes = |samples: &Samples, theta: &[Theta]| {
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

    /// A table of the EWLS family from the parameters at its nodes.
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
        let mut identified = self.table(nodes, positive, negative, Cause::NoSamples, lookup);
        identified.warnings.extend(start_up);
        identified.realization.provenance = Provenance {
            lambda: Some(options.lambda),
            memory_mm: self.memory_mm(options.lambda),
            dx_mm: Some(dx_mm),
            resample: Some(options.resample.as_str().into()),
            ..self.provenance(Method::Ewls(options))
        };
        identified
    }

    /// Baseline: mean force by position and direction.
    ///
    /// # Errors
    /// [`IdentifyError`] if dx does not suit the recording.
    pub fn static_profile(&self, dx_mm: f64, lookup: Lookup) -> Result<Identified, IdentifyError> {
        let nodes = self.nodes(dx_mm)?;
        let positive = baseline::static_profile(&self.positive, &nodes, dx_mm);
        let negative = baseline::static_profile(&self.negative, &nodes, dx_mm);
        let mut identified = self.table(nodes, positive, negative, Cause::NoSamples, lookup);
        identified.realization.provenance = Provenance {
            dx_mm: Some(dx_mm),
            resample: Some(Resample::Bin.as_str().into()),
            ..self.provenance(Method::Static)
        };
        Ok(identified)
    }

    /// Baseline: one straight line, as a table of two nodes at the ends of the range.
    pub fn spring(&self, lookup: Lookup) -> Identified {
        let theta = baseline::spring(&self.recordings);
        let branch = Resampled {
            theta: vec![theta; 2],
            filled: 0,
        };
        let nodes = self.range_mm.to_vec();
        let mut identified = self.table(nodes, branch.clone(), branch, Cause::NoSamples, lookup);
        identified.realization.provenance = self.provenance(Method::Spring);
        let [_, _, k_n_per_mm, _] = theta;
        if k_n_per_mm < 0.0 {
            let warning = Warning::NegativeSpring { k_n_per_mm };
            identified.warnings.push(warning);
        }
        identified
    }

    /// Weighted least squares around each node.
    fn two_sided(
        &self,
        options: TwoSided,
        dx_mm: f64,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        let nodes = self.nodes(dx_mm)?;
        let [l_plus, l_minus] = self.directions().map(|samples| match options.width {
            Width::Mm(mm) => Ok(mm),
            Width::Lambda(lambda) => {
                (samples.memory_mm(lambda)).ok_or(IdentifyError::Lambda(lambda))
            }
        });
        let (l_plus, l_minus) = (l_plus?, l_minus?);
        let estimate = |samples: &Samples, width_mm| {
            let of = (options.bounded, options.terms);
            two_sided::at_nodes(samples, &nodes, options.window, width_mm, of)
                .ok_or(IdentifyError::Narrow { width_mm })
        };
        let positive = estimate(&self.positive, l_plus)?;
        let negative = estimate(&self.negative, l_minus)?;
        let mut identified = self.table(nodes, positive, negative, Cause::FewSamples, lookup);
        let method = Method::TwoSided(options);
        identified.realization.provenance = Provenance {
            lambda: method.lambda(),
            memory_mm: Some(l_plus.min(l_minus)),
            dx_mm: Some(dx_mm),
            ..self.provenance(method)
        };
        Ok(identified)
    }

    /// The virtual mechanism. `progress` is called after each step of its fit.
    ///
    /// # Errors
    /// As [`mechanism::identify`].
    pub fn mechanism(
        &self,
        options: method::Mechanism,
        dx_mm: f64,
        progress: impl Fn(Progress) + Sync,
    ) -> Result<Identified, IdentifyError> {
        self.nodes(dx_mm)?;
        let settings = mechanism::Settings {
            dx_mm,
            recorded_hz: options.recorded_hz,
        };
        let fitted = mechanism::identify(self, settings, progress)?;
        let method = Method::Mechanism(options);
        Ok(Identified {
            realization: self.of_mechanism(method, dx_mm, fitted.mechanism.clone()),
            warnings: fitted.warnings(),
            fitted: Some(Box::new(fitted)),
        })
    }

    fn of_mechanism(&self, method: Method, dx_mm: f64, mechanism: Mechanism) -> Realization {
        let provenance = Provenance {
            dx_mm: Some(dx_mm),
            ..self.provenance(method)
        };
        let trained = Trained {
            x_mm: self.range_mm,
            v_mm_s: self.top_speed_mm_s,
        };
        let vaf = std::collections::BTreeMap::new();
        Realization::of_mechanism(String::new(), provenance, vaf, trained, mechanism)
    }

    /// A warning about nodes where the recursion of either direction has seen few
    /// samples. A warm start has none.
    fn start_up(&self, options: &Ewls, nodes: &[f64]) -> Option<Warning> {
        if options.start == Start::Warm {
            return None;
        }
        let end_of_start_up = |x: &[f64]| x[START_UP_SAMPLES.min(x.len() - 1)];
        let mut low = end_of_start_up(&self.positive.x_mm);
        let mut high = f64::INFINITY;
        match options.sort {
            Sort::Ascending => low = low.max(end_of_start_up(&self.negative.x_mm)),
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

    /// What model files say about the recording, and the method.
    fn provenance(&self, method: Method) -> Provenance {
        Provenance {
            method: method.to_string(),
            filter: Some(match self.recordings[0].filter() {
                Some(description) => format!("as recorded: {description}"),
                None => "as recorded".into(),
            }),
            recordings: (self.recordings.iter())
                .map(|r| (r.name.clone(), r.sha256.clone()))
                .collect(),
            // `study record` writes there what was recorded and whether it is simulated
            note: self.recordings[0].header.first().cloned(),
            ..Provenance::default()
        }
    }

    /// A table with the direction rule `sign` from the parameters at its nodes;
    /// `cause` is why nodes were filled, if some were.
    fn table(
        &self,
        nodes: Vec<f64>,
        positive: Resampled,
        negative: Resampled,
        cause: Cause,
        lookup: Lookup,
    ) -> Identified {
        let mut warnings = Vec::new();
        if positive.filled + negative.filled > 0 {
            warnings.push(Warning::Filled {
                cause,
                positive: positive.filled,
                negative: negative.filled,
                of: nodes.len(),
            });
        }
        let branches = [&positive.theta, &negative.theta];
        warnings.extend(problem::implausible(self.force_range_n, &nodes, branches));
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
                mechanism: None,
                units: crate::model::Units::Linear,
            },
            warnings,
            fitted: None,
        }
    }
}

/// One estimate of θ per sample, in the order of [`Training::directions`].
#[derive(Debug, Clone)]
pub struct Estimates {
    /// The options they were computed with.
    pub options: Ewls,
    /// For v > 0.
    pub positive: Vec<Theta>,
    /// For v < 0, in ascending order of x.
    pub negative: Vec<Theta>,
}

/// An identified realization; its id and VAF are empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// The table or mechanism.
    pub realization: Realization,
    /// What is doubtful about it.
    pub warnings: Vec<Warning>,
    /// How a mechanism was fitted.
    pub fitted: Option<Box<Fitted>>,
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
