//! Why a recording gives no realization, and what is doubtful about one.

use super::ewls::Theta;
use super::resample::MOST_NODES;
use std::fmt;

/// Samples of the recursion before its estimate rests on ten for each parameter.
pub(super) const START_UP_SAMPLES: usize = 40;

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
        most = MOST_NODES
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
    /// A number that has to be a length is none.
    #[error("{what} has to be a length above 0 mm, not {value}")]
    Length {
        /// Which.
        what: &'static str,
        /// mm.
        value: f64,
    },
    /// A weight of a penalty is negative or no number.
    #[error("{what} has to be 0 or more, not {value}")]
    Ridge {
        /// Which.
        what: &'static str,
        /// The weight.
        value: f64,
    },
    /// A number of segments that no table can have.
    #[error("{0} segments: a table has 1 to {most}", most = MOST_NODES - 1)]
    Segments(usize),
    /// The weights around the nodes hold too little.
    #[error(
        "within {width_mm} mm of the nodes there are too few samples for four parameters: take a larger width"
    )]
    Narrow {
        /// L, mm.
        width_mm: f64,
    },
    /// The normal equations have no single solution.
    #[error(
        "the recording leaves parameters of the table undetermined: take a larger ridge or a larger dx"
    )]
    Undetermined,
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
        /// The highest of them, mm.
        to_mm: f64,
    },
    /// Nodes with too few samples around them were filled from their neighbours.
    Thin {
        /// Of the + direction.
        positive: usize,
        /// Of the − direction.
        negative: usize,
        /// Nodes of the table.
        of: usize,
    },
    /// The force at rest of some nodes is far from anything that was measured.
    Unmeasured {
        /// How many, of both directions.
        nodes: usize,
        /// The worst, N.
        force_n: f64,
        /// Where that is, mm.
        at_mm: f64,
    },
    /// The best δ is the first or the last of those that were tried.
    DeltaAtEnd {
        /// mm.
        delta_mm: f64,
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
                "{nodes} nodes, the last at {to_mm:.2} mm, rest on fewer than {START_UP_SAMPLES} samples"
            ),
            Self::Thin {
                positive,
                negative,
                of,
            } => write!(
                f,
                "of {of} nodes {positive} in + and {negative} in - have too few samples around them and were filled from their neighbours"
            ),
            Self::Unmeasured {
                nodes,
                force_n,
                at_mm,
            } => write!(
                f,
                "{nodes} nodes have a force at rest far outside what was measured, the worst {force_n:.1} N at {at_mm:.2} mm"
            ),
            Self::DeltaAtEnd { delta_mm } => write!(
                f,
                "of the training recording delta = {delta_mm} mm leaves least, the end of what was tried: a better one may lie beyond"
            ),
            Self::NegativeSpring { k_n_per_mm } => {
                write!(f, "the spring pushes away, {k_n_per_mm:.4} N/mm")
            }
        }
    }
}

/// Whether the force at rest of a node is more than half the measured range
/// outside of it: a place where the estimate rests on nothing that was felt.
pub(super) fn unmeasured(
    [low, high]: [f64; 2],
    nodes: &[f64],
    branches: [&Vec<Theta>; 2],
) -> Option<Warning> {
    let (middle, reach) = (0.5 * (low + high), high - low);
    let mut worst: Option<(f64, Warning)> = None;
    let mut count = 0;
    for branch in branches {
        for (at_mm, theta) in nodes.iter().zip(branch) {
            let force_n = theta[2] * at_mm + theta[3];
            let off = (force_n - middle).abs();
            if off <= reach {
                continue;
            }
            count += 1;
            if worst.as_ref().is_none_or(|(most, _)| off > *most) {
                let warning = Warning::Unmeasured {
                    nodes: count,
                    force_n,
                    at_mm: *at_mm,
                };
                worst = Some((off, warning));
            }
        }
    }
    worst.map(|(_, mut warning)| {
        if let Warning::Unmeasured { nodes, .. } = &mut warning {
            *nodes = count;
        }
        warning
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_that_nobody_felt_are_counted_with_the_worst() {
        let measured = [-4.0, 4.0];
        let at = |k: f64, f0: f64| [0.0, 0.0, k, f0];
        // at 2 mm: 7.9 N is within half the range of what was measured, 8.1 N is not
        let nodes = [1.0, 2.0];
        let fine = vec![at(0.0, 4.0), at(3.0, 1.9)];
        assert_eq!(unmeasured(measured, &nodes, [&fine, &fine]), None);
        let off = vec![at(0.0, -30.0), at(3.0, 2.1)];
        assert_eq!(
            unmeasured(measured, &nodes, [&fine, &off]),
            Some(Warning::Unmeasured {
                nodes: 2,
                force_n: -30.0,
                at_mm: 1.0
            })
        );
    }
}
