//! Errors of identification and warnings about its results.

use super::evidence::{Evidence, LEAST_SAMPLES, Term};
use super::resample::MAX_NODES;
use super::samples::Theta;
use crate::model::coverage::Origin;
use study_base::text::Untrusted;
/// Number of samples after which an estimate rests on ten samples per parameter.
pub(super) const START_UP_SAMPLES: usize = 40;

/// Why identification failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum IdentifyError {
    #[error("lambda has to be above 0 and at most 1, not {0}")]
    Lambda(f64),
    #[error("dx has to be a length above 0 mm, not {0}")]
    Dx(f64),
    #[error("dx = {dx_mm} mm leaves {nodes} nodes in {low} to {high} mm: a table has at least two")]
    TooCoarse {
        dx_mm: f64,
        nodes: usize,
        low: f64,
        high: f64,
    },
    #[error(
        "dx = {dx_mm} mm gives more than {most} nodes in {low} to {high} mm",
        most = MAX_NODES
    )]
    TooFine { dx_mm: f64, low: f64, high: f64 },
    #[error("{recording} has no samples with v {0} 0: both directions are needed", if *.positive { '>' } else { '<' })]
    OneDirection { recording: String, positive: bool },
    #[error("{0}: the two directions have no range of x in common")]
    NoOverlap(String),
    #[error("{option} has to be a length above 0 mm, not {value}")]
    Length { option: &'static str, value: f64 },
    #[error("{option} has to be 0 or more, not {value}")]
    Ridge { option: &'static str, value: f64 },
    #[error("{0} segments: a table has 1 to {most}", most = MAX_NODES - 1)]
    Segments(usize),
    #[error(
        "too few samples for four parameters within {width_mm} mm of the nodes: choose a larger width"
    )]
    Narrow { width_mm: f64 },
    #[error(
        "the recording leaves parameters of the table undetermined: choose a larger ridge or a larger dx"
    )]
    Undetermined,
    #[error(transparent)]
    Signal(#[from] super::signal::SignalError),
    #[error("no start led to a mechanism whose force is finite: check the units of x and F")]
    NoMechanism,
    /// A stated term that the training recordings show.
    #[error("the training recordings show a {} of {}, so that it is not stated but identified", .0.term.as_str(), what_is_said(.0))]
    Shown(Evidence),
    #[error("mass and damping from elsewhere are for tables: {0} has its own")]
    OwnDynamics(&'static str),
    #[error(
        "the dynamic recording {} goes from {:.4} to {:.4} mm, and {percent} % of its samples are where the force by position is known, {:.4} to {:.4} mm",
        Untrusted(.recording), .goes_mm[0], .goes_mm[1], .known_mm[0], .known_mm[1]
    )]
    DynamicRange {
        recording: String,
        percent: f64,
        known_mm: [f64; 2],
        goes_mm: [f64; 2],
    },
    #[error(
        "the dynamic recording {} has {samples} samples where the force by position is known: mass and damping need {LEAST_SAMPLES}", Untrusted(.recording)
    )]
    DynamicTooShort { recording: String, samples: usize },
    #[error(
        "beside what follows from velocity and acceleration, the force of the dynamic recording is {0:.3} times that of the training recordings at the same positions"
    )]
    OtherForce(f64),
    #[error(
        "the estimates with lambda = {lambda} diverge: the recording does not excite all parameters; choose a larger lambda"
    )]
    Diverged { lambda: f64 },
}

impl IdentifyError {
    /// Whether it is about the dynamic recordings.
    pub(super) fn is_of_dynamic(&self) -> bool {
        matches!(
            self,
            Self::DynamicRange { .. } | Self::DynamicTooShort { .. } | Self::OtherForce(_)
        )
    }

    /// What to do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Shown(_) => Some("leave --mass-kg or --damping-n-s-per-mm out"),
            Self::OwnDynamics(_) => Some("such as --method passive"),
            Self::DynamicRange { .. } => Some(
                "both are of the same travel, counted from the same origin and in the same unit: record slow loops as far, or convert the positions",
            ),
            Self::DynamicTooShort { .. } => Some("record more presses, or at a higher rate"),
            Self::OtherForce(_) => Some(
                "both are of the same target, with forces in the same unit (1 gf is 0.00981 N) and of the same sign: convert them",
            ),
            _ => None,
        }
    }
}

/// What an estimator found of one of its terms, and how well the recordings determine it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The term, such as "mass".
    pub name: &'static str,
    /// Its unit, such as "kg".
    pub unit: &'static str,
    /// The value that it has, or would have if it were identified.
    pub value: f64,
    /// Its standard error, in the unit; `None` at a bound or where it is not known.
    pub standard_error: Option<f64>,
    /// What the term is at most, with a confidence of 99 %, in the unit.
    pub upper_bound: Option<f64>,
    /// Whether the recordings determine it, to two standard errors at least: otherwise it is left out, or no more than set. A table leaves out a term that they
    /// determine if least squares would find too little of it, and has one that they do not determine if it predicts; both with a warning.
    pub identified: bool,
    /// What it is known from. A stated value was not identified.
    pub origin: Origin,
}

impl Estimate {
    /// What the experimenter states, kg or N·s/mm.
    pub(super) fn stated(term: Term, value: f64) -> Self {
        Self {
            name: term.as_str(),
            unit: term.unit(),
            value,
            standard_error: None,
            upper_bound: None,
            identified: false,
            origin: Origin::Stated,
        }
    }
}

impl From<&Evidence> for Estimate {
    fn from(evidence: &Evidence) -> Self {
        Self {
            name: evidence.term.as_str(),
            unit: evidence.term.unit(),
            value: evidence.value,
            standard_error: Some(evidence.standard_error),
            upper_bound: evidence.upper_bound,
            identified: evidence.found,
            origin: evidence.origin,
        }
    }
}

/// Why nodes were interpolated between their neighbors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// There are no samples around them.
    NoSamples,
    /// There are too few samples around them.
    FewSamples,
}

impl Cause {
    fn as_str(self) -> &'static str {
        match self {
            Self::NoSamples => "no samples",
            Self::FewSamples => "too few samples",
        }
    }
}

/// What is doubtful about a realization.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum Warning {
    #[error("{positive} of {of} nodes in + and {negative} in - have {} around them and were interpolated", .cause.as_str())]
    Filled {
        cause: Cause,
        positive: usize,
        negative: usize,
        of: usize,
    },
    #[error(
        "{nodes} nodes, the last at {to_mm:.2} mm, rest on fewer than {START_UP_SAMPLES} samples"
    )]
    StartUp { nodes: usize, to_mm: f64 },
    #[error(
        "the static force of {nodes} nodes is far outside the measured range, the most extreme {force_n:.1} N at {at_mm:.2} mm"
    )]
    Implausible {
        nodes: usize,
        force_n: f64,
        at_mm: f64,
    },
    #[error(
        "the best delta, {delta_mm} mm, is at an end of the scan: a better one may lie beyond it (--delta); friction that changes direction at once needs none (--direction sign)"
    )]
    DeltaAtEnd { delta_mm: f64 },
    #[error("{parameter} = {value:.2e} is not determined by the recordings{}: {excitation}", .error.map_or(String::new(), |e| format!(" (standard error {e:.1e})")))]
    NotDetermined {
        parameter: &'static str,
        value: f64,
        error: Option<f64>,
        excitation: &'static str,
    },
    /// The recordings do not carry this term.
    #[error("{0}; --terms overrides this")]
    LeftOut(Evidence),
    /// The recordings do not show this term, but a table predicts better with it.
    #[error("{0}; --terms overrides this")]
    Ambiguous(Evidence),
    /// The recordings say this of a term that the realization does not have, whatever the options are.
    #[error("{}", without(.0))]
    Without(Evidence),
    /// The experimenter states something else than the recordings say.
    #[error("{} of {} is stated, but the {} say {}", .said.term.as_str(), .said.term.shown(*.stated), .said.by(), what_is_said(.said))]
    Stated { stated: f64, said: Evidence },
    /// A stated mass or damping would outweigh everything that was measured.
    #[error(
        "{} of {} is stated: five strokes a second over the travel would take {needs_n:.3} N for it alone, and the force by position is at most {most_n:.3} N; is it in {}?",
        .term.as_str(), .term.shown(*.stated), .term.unit()
    )]
    Outweighs {
        term: Term,
        stated: f64,
        needs_n: f64,
        most_n: f64,
    },
    /// The mass of a table is not that which the recordings show.
    #[error("mass: this table has {}, but the recordings say {}: the rest stands for something that the table lacks; compare the methods (without --method), or choose another dx or --direction", .said.term.shown(*.table_kg), what_is_said(.said))]
    OtherMass { table_kg: f64, said: Evidence },
    /// A dynamic recording has another force at the same positions.
    #[error(
        "the force of the dynamic recordings is {ratio:.2} times that of the training recordings at the same positions, and a mass from them is wrong by as much if that is a unit or a calibration: compare the sensors"
    )]
    OtherForce { ratio: f64 },
    /// The force has features between the nodes.
    #[error(
        "{rms_n:.3} N rms of the force repeat at places closer than 2 dx = {} mm, which nodes at this distance cannot follow: choose a smaller dx", 2.0 * .dx_mm
    )]
    Narrow { rms_n: f64, dx_mm: f64 },
    #[error("the stiffness of the spring is negative: {k_n_per_mm:.4} N/mm")]
    NegativeSpring { k_n_per_mm: f64 },
}

/// What recordings say of a term that a realization does not have.
fn without(evidence: &Evidence) -> String {
    match evidence.found {
        true => format!(
            "{}: {}, which this method does not have",
            evidence.term.as_str(),
            what_is_said(evidence)
        ),
        false => evidence.to_string(),
    }
}

/// An estimate with its standard error, or a bound.
fn what_is_said(evidence: &Evidence) -> String {
    let shown = |value| evidence.term.shown(value);
    match (evidence.found, evidence.upper_bound) {
        (true, _) => format!(
            "{} ± {}",
            shown(evidence.value),
            shown(evidence.standard_error)
        ),
        (false, Some(bound)) => format!("at most {} (99 %)", shown(bound)),
        (false, None) => "nothing of it".to_owned(),
    }
}

/// A warning about nodes whose static force lies outside the measured range, low to
/// high, N, by more than half of it.
pub(super) fn implausible(
    [low, high]: [f64; 2],
    nodes: &[f64],
    branches: [&Vec<Theta>; 2],
) -> Option<Warning> {
    let (middle, reach) = (0.5 * (low + high), high - low);
    let outside: Vec<(f64, f64)> = branches
        .into_iter()
        .flat_map(|branch| nodes.iter().zip(branch))
        .map(|(at_mm, theta)| (theta[2] * at_mm + theta[3], *at_mm))
        .filter(|(force_n, _)| (force_n - middle).abs() > reach)
        .collect();
    let distance = |(force_n, _): &(f64, f64)| (force_n - middle).abs();
    let (force_n, at_mm) =
        *(outside.iter().rev()).max_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some(Warning::Implausible {
        nodes: outside.len(),
        force_n,
        at_mm,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn implausible_forces_are_counted_and_the_most_extreme_is_given() {
        let measured = [-4.0, 4.0];
        let at = |k: f64, f0: f64| [0.0, 0.0, k, f0];
        // at 2 mm: 7.9 N is within half the range beyond the measured one, 8.1 N is not
        let nodes = [1.0, 2.0];
        let plausible = vec![at(0.0, 4.0), at(3.0, 1.9)];
        assert_eq!(
            implausible(measured, &nodes, [&plausible, &plausible]),
            None
        );
        let off = vec![at(0.0, -30.0), at(3.0, 2.1)];
        assert_eq!(
            implausible(measured, &nodes, [&plausible, &off]),
            Some(Warning::Implausible {
                nodes: 2,
                force_n: -30.0,
                at_mm: 1.0
            })
        );
    }
}
