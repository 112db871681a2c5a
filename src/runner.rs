//! Effects of a session to device, store and operator.

use crate::session;
use std::time::Duration;

/// Who operates a session: shows the view, gives inputs.
pub trait Operator {
    /// Shows `view` and waits at most `timeout` for inputs (possibly none).
    ///
    /// # Errors
    /// [`OperatorError`] if nobody can be reached any more.
    fn next(
        &mut self,
        view: &session::View,
        strip: Option<&Strip>,
        timeout: Duration,
    ) -> Result<Vec<session::Input>, OperatorError>;
}

/// The live strip: the last seconds of telemetry, only when asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    /// Position, mm, and force, N; oldest first.
    pub samples: Vec<(f64, f64)>,
    /// The force axis ends here, N.
    pub force_limit_n: f64,
    /// The position axis, mm.
    pub x_range_mm: [f64; 2],
}

/// Why an operator cannot be reached any more: the terminal is gone.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct OperatorError(pub String);
