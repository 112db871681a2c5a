//! The mechanism as an estimator.

use super::{Fitted, PREDICTED_HZ, Settings, identify, refitted};
use crate::identify::method::{self, Candidacy, Claim, Declared, Estimator, Opt, Options, Setting};
use crate::identify::{Identified, IdentifyError, Training, Trials};
use crate::model::{self, Provenance, Realization, Trained};
use std::collections::BTreeMap;
use std::fmt;

/// Steps times parameters of a mechanism that is tried in a comparison: four times what 60 s need
/// with nodes every 1/70 of the travel.
const MOST_WORK: f64 = 1.6e8;

/// Options of the virtual mechanism.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mechanism {
    /// The corner of the low-pass that the recorded forces have passed, Hz; `None`: found.
    pub recorded_hz: Option<f64>,
}

impl Mechanism {
    fn realization(
        self,
        training: &Training<'_>,
        dx_mm: f64,
        mechanism: model::Mechanism,
    ) -> Realization {
        let provenance = Provenance {
            dx_mm: Some(dx_mm),
            ..training.provenance(self)
        };
        let trained = Trained {
            x_mm: training.range_mm,
            v_mm_s: training.top_speed_mm_s,
        };
        Realization::of_mechanism(
            String::new(),
            provenance,
            BTreeMap::new(),
            trained,
            mechanism,
        )
    }
}

impl Estimator for Mechanism {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let dx_mm = setting.dx_mm;
        training.nodes(dx_mm)?;
        let settings = Settings {
            dx_mm,
            recorded_hz: self.recorded_hz,
        };
        let fitted = identify(training, settings, setting.step)?;
        Ok(Identified {
            realization: self.realization(training, dx_mm, fitted.mechanism.clone()),
            warnings: fitted.warnings(),
            terms: fitted.terms(),
            fitted: Some(Box::new(fitted)),
        })
    }

    /// From where the fit to all recordings ended.
    fn identify_part(
        &self,
        whole: Option<&Fitted>,
        part: &Training<'_>,
        setting: Setting<'_>,
    ) -> Option<Realization> {
        let mechanism = refitted(whole?, part)?;
        Some(self.realization(part, setting.dx_mm, mechanism))
    }

    fn check(&self) -> Result<(), IdentifyError> {
        match self.recorded_hz {
            Some(hz) => method::positive("the corner of the low-pass", hz),
            None => Ok(()),
        }
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.recorded_hz {
            Some(hz) => write!(f, " recorded={hz}"),
            None => Ok(()),
        }
    }

    fn simulates(&self) -> bool {
        true
    }

    fn is_table(&self) -> bool {
        false
    }

    fn claim(&self) -> Claim {
        Claim::Passive
    }
}

impl Declared for Mechanism {
    const NAMES: &'static [(&'static str, &'static str)] = &[(
        "mechanism",
        "A virtual mechanism with backlash, two masses and friction, fitted by simulation",
    )];
    const OPTIONS: &'static [Opt] = &[Opt::Dx];

    fn asked(_name: &str, options: &Options) -> Vec<Self> {
        vec![Self {
            recorded_hz: options.filter_hz,
        }]
    }

    fn candidate(trials: &Trials<'_, '_>) -> Result<Candidacy, IdentifyError> {
        if !trials.whole_strokes() {
            return Ok(Candidacy::NotTried("too few strokes".to_owned()));
        }
        let training = trials.training();
        let [low, high] = training.range_mm;
        let default_mm = 0.5 * training.recordings[0].scale_mm();
        // where a table needs much closer nodes, so does the mechanism
        let dx_mm = match trials.table()? {
            (_, table_mm) if table_mm <= 0.5 * default_mm => table_mm,
            _ => default_mm,
        };
        let seconds: f64 = training.recordings.iter().map(|r| r.duration_s()).sum();
        let work = seconds * PREDICTED_HZ * ((high - low) / dx_mm);
        Ok(match work > MOST_WORK {
            true => Candidacy::NotTried("it would take minutes: --method mechanism".to_owned()),
            false => Candidacy::With(Self::default().into(), dx_mm),
        })
    }
}
