//! Baseline `spring`: F = k x + F0 by least squares over all samples of both directions, as a table
//! of two nodes at the ends of the range.

use super::method::{Claim, Declared, Estimator, Opt, Options, Setting};
use super::resample::Resampled;
use super::samples::Theta;
use super::{Cause, Identified, IdentifyError, Training, Warning};
use crate::recording::Recording;

/// The spring, which has no options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spring;

impl Estimator for Spring {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let theta = line(&training.recordings);
        let branch = Resampled {
            theta: vec![theta; 2],
            filled: 0,
        };
        let nodes = training.range_mm.to_vec();
        let cause = Cause::NoSamples;
        let mut identified = training.table(nodes, branch.clone(), branch, cause, setting.lookup);
        identified.realization.provenance = training.provenance(*self);
        let [_, _, k_n_per_mm, _] = theta;
        if k_n_per_mm < 0.0 {
            let warning = Warning::NegativeSpring { k_n_per_mm };
            identified.warnings.push(warning);
        }
        Ok(identified)
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

impl Declared for Spring {
    const NAMES: &'static [(&'static str, &'static str)] =
        &[("spring", "Baseline: one straight line")];
    const OPTIONS: &'static [Opt] = &[];

    fn asked(_name: &str, _options: &Options) -> Vec<Self> {
        vec![Self]
    }
}

/// The least-squares line through all samples, as [0, 0, k, F0].
fn line(recordings: &[&Recording]) -> Theta {
    let all = || recordings.iter().flat_map(|r| r.x_mm.iter().zip(&r.f_n));
    let n = all().count() as f64;
    let mean_x = all().map(|(x, _)| x).sum::<f64>() / n;
    let mean_f = all().map(|(_, f)| f).sum::<f64>() / n;
    let (mut xx, mut xf) = (0.0, 0.0);
    for (x, f) in all() {
        xx += (x - mean_x) * (x - mean_x);
        xf += (x - mean_x) * (f - mean_f);
    }
    // x varies in every recording, so xx > 0
    let k = xf / xx;
    [0.0, 0.0, k, mean_f - k * mean_x]
}
