//! Why there is no identification, and what to do about it.

use crate::identify::IdentifyError;
use crate::identify::plan::OptionError;
use crate::identify::signal::SignalError;
use crate::recording::{Energy, RecordingError, RecordingFault};
use study_base::text::{ModelId, Untrusted};

/// Why there is no identification. The messages name the recordings by their paths.
#[derive(Debug, thiserror::Error)]
pub enum IdentificationError {
    /// A recording cannot be read.
    #[error("{}: line {}: {}", Untrusted(.0), .1.line, .1.fault)]
    Unreadable(String, RecordingError),
    /// A target that supplies energy.
    #[error(
        "{}: the target supplies energy: the work of the force over closed cycles is {:.3} J on {:.0} mm, but no passive target gives any",
        Untrusted(.path), .energy.supplied_j, .energy.path_mm
    )]
    Active {
        /// The recording.
        path: String,
        /// Its energy.
        energy: Energy,
        /// Whether spikes may be the cause.
        spikes: bool,
    },
    /// Signals that cannot be prepared.
    #[error("{}: {}", Untrusted(.0), .1)]
    Signal(String, SignalError),
    /// Two paths with the same bytes.
    #[error("{} and {} are the same recording", Untrusted(.0), Untrusted(.1))]
    Same(String, String),
    /// Two recordings with one name.
    #[error("two recordings are called {}: {} and {}", Untrusted(.name), Untrusted(.first), Untrusted(.second))]
    SameName {
        /// The name.
        name: String,
        /// The first path.
        first: String,
        /// The second path.
        second: String,
    },
    /// A repetition of nothing.
    #[error("{} does not repeat the trajectory of a --validate or --test recording", Untrusted(.0))]
    NoRepetition(String),
    /// There is nothing on which one of several realizations could be selected.
    #[error("several realizations need --validate, on which one is selected")]
    NoValidation,
    /// Options that do not go together.
    #[error(transparent)]
    Options(#[from] OptionError),
    /// The recordings do not suit the estimator.
    #[error("{}: {}", Untrusted(.0), .1)]
    Estimator(String, IdentifyError),
    /// An id that a model file cannot have.
    #[error("{0}")]
    Id(String),
    /// Two realizations with one id.
    #[error("two cells would have the id {0}")]
    SameId(ModelId),
}

impl IdentificationError {
    /// What to do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Unreadable(_, error) => match &error.fault {
                RecordingFault::MissingColumn { .. } => Some(
                    "name the columns of your file: --columns t=NAME,x=NAME:UNIT,f=NAME:UNIT, with units such as mm, deg, rad, N and N·m",
                ),
                RecordingFault::Ragged { found, expected } if found > expected => {
                    Some("decimal commas need semicolons or tabs between the columns")
                }
                RecordingFault::LongLine => Some("a row is a line that ends with a line feed"),
                _ => None,
            },
            Self::Active { spikes: true, .. } => {
                Some("the spikes may be the cause: --robust replaces them")
            }
            Self::Active { .. } => Some(
                "F is the force that the probe applies to the target, positive with +x: change the sign of F, or that of x if the position is counted the other way round. For a target with a motor: --active",
            ),
            Self::Same(..) => {
                Some("identify from one recording, select on a second and report a third")
            }
            Self::SameName { .. } => Some("give one another name: --validate NAME=PATH"),
            Self::NoRepetition(_) => {
                Some("record the same trajectory twice, and pass the second recording as --repeat")
            }
            Self::NoValidation => Some("or ask for one, such as --method passive --dx 0.05"),
            Self::Options(error) => error.hint(),
            Self::SameId(_) => {
                Some("use {lambda}, {dx} and {delta} in the template, or fewer values")
            }
            Self::Estimator(_, error) => error.hint(),
            Self::Signal(..) | Self::Id(_) => None,
        }
    }

    /// Whether the request is wrong, and not the recordings.
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::NoValidation | Self::Options(_))
    }
}
