//! Baseline `static`: for each direction the mean force of the samples in
//! [node − dx/2, node + dx/2) at any speed; m = b = k = 0 and F0 is that mean, the
//! least-squares fit of F0 alone. This is playback of a recorded force profile
//! (Angerilli 2001).

use super::method::{Candidacy, Claim, Declared, Estimator, Opt, Options, Setting};
use super::resample::{self, Resample, Resampled};
use super::samples::{Samples, Theta};
use super::{Cause, Identified, IdentifyError, Training, Trials};
use crate::model::Provenance;

/// The static profile, which has no options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Static;

impl Estimator for Static {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let dx_mm = setting.dx_mm;
        let nodes = training.nodes(dx_mm)?;
        let [positive, negative] = training.directions().map(|of| profile(of, &nodes, dx_mm));
        let cause = Cause::NoSamples;
        let mut identified = training.table(nodes, positive, negative, cause, setting.lookup);
        identified.realization.provenance = Provenance {
            dx_mm: Some(dx_mm),
            resample: Some(Resample::Bin.as_str().into()),
            ..training.provenance(*self)
        };
        Ok(identified)
    }

    fn is_static(&self) -> bool {
        true
    }

    fn claim(&self) -> Claim {
        Claim::Baseline
    }
}

impl Declared for Static {
    const NAMES: &'static [(&'static str, &'static str)] =
        &[("static", "Baseline: mean force by position and direction")];
    const OPTIONS: &'static [Opt] = &[Opt::Dx];

    fn asked(_name: &str, _options: &Options) -> Vec<Self> {
        vec![Self]
    }

    fn candidate(trials: &Trials<'_, '_>) -> Result<Candidacy, IdentifyError> {
        Ok(Candidacy::With(Self.into(), trials.best_dx(Self.into())))
    }
}

/// The mean force at each node of one direction, as [0, 0, 0, F].
fn profile(samples: &Samples, nodes: &[f64], dx_mm: f64) -> Resampled {
    let forces: Vec<Theta> = samples.f_n.iter().map(|f| [0.0, 0.0, 0.0, *f]).collect();
    resample::bin(&samples.x_mm, &forces, nodes, dx_mm)
}
