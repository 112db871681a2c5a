//! Baseline: force by direction, piecewise linear between equally spaced nodes over the range of
//! both directions (a segmented static model, MacLean 1996).

use super::banded::Bound;
use super::hat::Penalty;
use super::method::{Claim, Declared, Estimator, Opt, Options, Setting};
use super::resample::MAX_NODES;
use super::{Identified, IdentifyError, Training};
use std::fmt;
use study_wire::predict::Direction;

/// Options of the segmented baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segments {
    /// Number of segments over the range of both directions.
    pub count: usize,
}

impl Default for Segments {
    /// Twelve segments.
    fn default() -> Self {
        Self { count: 12 }
    }
}

impl Estimator for Segments {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let [low, high] = training.range_mm;
        let nodes: Vec<f64> = (0..=self.count)
            .map(|i| low + (high - low) * i as f64 / self.count as f64)
            .collect();
        if nodes.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(IdentifyError::NoOverlap(
                training.recordings[0].name.clone(),
            ));
        }
        let penalty = Penalty {
            // only interpolates over segments without samples
            ridge_force: 1e-6,
            ridge_dynamics: 0.0,
            dynamics: [Bound::Zero; 2],
        };
        let mut identified = training.hat_with(nodes, setting.lookup, Direction::Sign, penalty)?;
        identified.realization.provenance = training.provenance(*self);
        Ok(identified)
    }

    fn check(&self) -> Result<(), IdentifyError> {
        match (1..MAX_NODES).contains(&self.count) {
            true => Ok(()),
            false => Err(IdentifyError::Segments(self.count)),
        }
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, " count={}", self.count)
    }

    fn has_dx(&self) -> bool {
        false
    }

    fn is_static(&self) -> bool {
        true
    }

    fn claim(&self) -> Claim {
        Claim::Baseline
    }
}

impl Declared for Segments {
    const NAMES: &'static [(&'static str, &'static str)] =
        &[("segments", "Baseline: piecewise linear force by direction")];
    const OPTIONS: &'static [Opt] = &[Opt::Segments];

    fn asked(_name: &str, options: &Options) -> Vec<Self> {
        vec![(options.segments).map_or_else(Self::default, |count| Self { count })]
    }
}
