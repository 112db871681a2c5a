//! Errors of identification and warnings about its results.

use super::resample::MAX_NODES;
use super::samples::Theta;
use std::fmt;

/// Number of samples after which an estimate rests on ten samples per parameter.
pub(super) const START_UP_SAMPLES: usize = 40;

/// Why identification failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// λ is out of range.
    #[error("lambda has to be above 0 and at most 1, not {0}")]
    Lambda(f64),
    /// dx is not a positive length.
    #[error("dx has to be a length above 0 mm, not {0}")]
    Dx(f64),
    /// Fewer than two nodes fit in the range of the recording.
    #[error("dx = {dx_mm} mm leaves {nodes} nodes in {low} to {high} mm: a table has at least two")]
    TooCoarse {
        /// Resampling increment, mm.
        dx_mm: f64,
        /// Number of nodes that fit.
        nodes: usize,
        /// Lower end of the range common to both directions, mm.
        low: f64,
        /// Upper end of the range common to both directions, mm.
        high: f64,
    },
    /// More nodes than a table can have.
    #[error(
        "dx = {dx_mm} mm gives more than {most} nodes in {low} to {high} mm",
        most = MAX_NODES
    )]
    TooFine {
        /// Resampling increment, mm.
        dx_mm: f64,
        /// Lower end of the range common to both directions, mm.
        low: f64,
        /// Upper end of the range common to both directions, mm.
        high: f64,
    },
    /// There is only one direction of travel.
    #[error("{recording} has no samples with v {0} 0: both directions are needed", if *.positive { '>' } else { '<' })]
    OneDirection {
        /// Name of the recording.
        recording: String,
        /// Whether the missing direction is v > 0.
        positive: bool,
    },
    /// The two directions cover no common positions.
    #[error("{0}: the two directions have no range of x in common")]
    NoOverlap(String),
    /// An option that is a length is not positive.
    #[error("{option} has to be a length above 0 mm, not {value}")]
    Length {
        /// The option.
        option: &'static str,
        /// Its value, mm.
        value: f64,
    },
    /// The weight of a penalty is negative or not finite.
    #[error("{option} has to be 0 or more, not {value}")]
    Ridge {
        /// The option.
        option: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number of segments that no table can have.
    #[error("{0} segments: a table has 1 to {most}", most = MAX_NODES - 1)]
    Segments(usize),
    /// Too few samples around every node.
    #[error(
        "too few samples for four parameters within {width_mm} mm of the nodes: choose a larger width"
    )]
    Narrow {
        /// L, mm.
        width_mm: f64,
    },
    /// The normal equations are singular.
    #[error(
        "the recording leaves parameters of the table undetermined: choose a larger ridge or a larger dx"
    )]
    Undetermined,
    /// An estimate of the recursion is not finite.
    #[error(
        "the estimates with lambda = {lambda} diverge: the recording does not excite all parameters; choose a larger lambda"
    )]
    Diverged {
        /// The forgetting factor.
        lambda: f64,
    },
}

/// Why nodes were interpolated between their neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// There are no samples around them.
    NoSamples,
    /// There are too few samples around them.
    FewSamples,
}

/// What is doubtful about a realization.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// Nodes were interpolated between their neighbours.
    Filled {
        /// Why.
        cause: Cause,
        /// Number of nodes in the + direction.
        positive: usize,
        /// Number of nodes in the − direction.
        negative: usize,
        /// Nodes of the table.
        of: usize,
    },
    /// Nodes at which the recursion has seen few samples.
    StartUp {
        /// Number of nodes.
        nodes: usize,
        /// Position of the highest of them, mm.
        to_mm: f64,
    },
    /// The static force of some nodes is far outside the measured range.
    Implausible {
        /// Number of nodes, in both directions.
        nodes: usize,
        /// The most extreme force, N.
        force_n: f64,
        /// Position of that force, mm.
        at_mm: f64,
    },
    /// The best δ is at an end of the scan.
    DeltaAtEnd {
        /// The best δ, mm.
        delta_mm: f64,
    },
    /// The spring has a negative stiffness and is unstable.
    NegativeSpring {
        /// Stiffness, N/mm.
        k_n_per_mm: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Filled {
                cause,
                positive,
                negative,
                of,
            } => {
                let cause = match cause {
                    Cause::NoSamples => "no samples",
                    Cause::FewSamples => "too few samples",
                };
                write!(
                    f,
                    "{positive} of {of} nodes in + and {negative} in - have {cause} around them and were interpolated"
                )
            }
            Self::StartUp { nodes, to_mm } => write!(
                f,
                "{nodes} nodes, the last at {to_mm:.2} mm, rest on fewer than {START_UP_SAMPLES} samples"
            ),
            Self::Implausible {
                nodes,
                force_n,
                at_mm,
            } => write!(
                f,
                "the static force of {nodes} nodes is far outside the measured range, the most extreme {force_n:.1} N at {at_mm:.2} mm"
            ),
            Self::DeltaAtEnd { delta_mm } => write!(
                f,
                "the best delta, {delta_mm} mm, is at an end of the scan: a better one may lie beyond it"
            ),
            Self::NegativeSpring { k_n_per_mm } => {
                write!(
                    f,
                    "the stiffness of the spring is negative: {k_n_per_mm:.4} N/mm"
                )
            }
        }
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
