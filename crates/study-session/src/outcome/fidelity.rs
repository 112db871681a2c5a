//! How faithful a playback was, as it is stored: the verdict and its quantities.
//!
//! [`rendering`](crate::rendering) computes it from the telemetry and the table that was
//! sent.

use serde::{Deserialize, Serialize};
use study_base::named;
use study_base::text::ModelId;

named! {
    /// Whether the force was that of the table that was sent. From good to bad.
    #[derive(Default, PartialOrd, Ord, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    Verdict {
        /// The commanded force, and the measured one where there is a sensor, were right.
        Ok = "ok",
        /// The device reports no samples, or plays no table.
        #[default]
        Unverified = "unverified",
        /// Too little was felt, or reported, to judge it.
        TooLittle = "too-little",
        /// It was wrong in a way that the protocol marks.
        Flag = "flag",
        /// It was wrong in a way that fails the attempt.
        Fault = "fault",
    }
}

named! {
    /// What was wrong with a playback.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    Defect {
        /// The force passed the limit of the session.
        OverLimit = "over-limit",
        /// Another table of the study explains the force.
        OtherTable = "other-table",
        /// The force had the wrong sign.
        Sign = "sign",
        /// The force varied otherwise than that of the table.
        Shape = "shape",
        /// The force was too large or too small.
        Gain = "gain",
        /// A constant force was added.
        Bias = "bias",
        /// The force came too late, or before the motion.
        Delay = "delay",
        /// For a moment the force was another one.
        Error = "error",
        /// A vibration or tick that a hand feels was added.
        Vibration = "vibration",
        /// The constants that the device states make it another force than that of the table.
        Constants = "constants",
        /// The measured force was not the commanded one.
        Measured = "measured",
        /// The reported speed was not the change of the reported position.
        Speed = "speed",
        /// The time of the samples was not that of the host.
        Clock = "clock",
        /// Samples that are not finite, or not in the order of time.
        Samples = "samples",
    }
}

impl Defect {
    /// Whether it fails an attempt unless the protocol says otherwise.
    pub fn is_grave(self) -> bool {
        matches!(self, Self::OverLimit | Self::OtherTable | Self::Sign)
    }

    /// Whether a right device whose servo has other constants than those of docs/wire.md may
    /// show it.
    pub fn may_be_constants(self) -> bool {
        match self {
            Self::Shape | Self::Gain | Self::Bias | Self::Delay | Self::Error => true,
            Self::Vibration | Self::Constants | Self::OtherTable => true,
            Self::OverLimit | Self::Sign => false,
            Self::Measured | Self::Speed | Self::Clock | Self::Samples => false,
        }
    }
}

/// What was found about one playback. `None`: not known, or not defined.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Fidelity {
    /// Verdict.
    pub verdict: Verdict,
    /// What was wrong, in the order of [`Defect`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub defects: Vec<Defect>,
    /// Why a defect is a flag only, or why there is no verdict.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub because: Option<String>,
    /// Share of the variance of the table's force that the commanded force has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rendered_vaf: Option<f64>,
    /// Slope of the commanded force on that of the table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rendered_gain: Option<f64>,
    /// Mean of the commanded force minus that of the table, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rendered_bias_n: Option<f64>,
    /// How much later than that of the table the commanded force was, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rendered_delay_ms: Option<f64>,
    /// Largest difference of the two forces that lasted 20 ms, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rendered_error_n: Option<f64>,
    /// Largest rms difference of the two forces over rms force of the table: in the whole
    /// playback, one direction, at rest, or a stretch of 2 s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rendered_error_share: Option<f64>,
    /// Share of the time in which the commanded force was judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged_share: Option<f64>,
    /// Largest mean size of the difference over 50 ms, over the range of the table's forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_range_share: Option<f64>,
    /// Largest difference that lasted 20 ms, of the commanded force, of the measured one from the
    /// commanded, or from the table with the constants of docs/wire.md, in just noticeable
    /// differences of a force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_jnd: Option<f64>,
    /// Largest vibration above 30 Hz that is not of the table, rms over 0.1 s, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vibration_n: Option<f64>,
    /// As `rendered_error_share`, with the constants of docs/wire.md in place of those that the
    /// device states, if it states others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table_error_share: Option<f64>,
    /// Largest commanded or measured force, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_force_n: Option<f64>,
    /// By how much the commanded force passed the limit of the session, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub over_limit_n: Option<f64>,
    /// Share of the variance of the commanded force that the measured force has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_vaf: Option<f64>,
    /// Slope of the measured force on the commanded one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_gain: Option<f64>,
    /// Mean of the measured minus the commanded force, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_bias_n: Option<f64>,
    /// Mean size of the measured minus the commanded force, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_error_n: Option<f64>,
    /// How much later than commanded the measured force was, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_delay_ms: Option<f64>,
    /// Largest rms difference of measured and commanded force, without its mean and the delay that
    /// is allowed, over rms commanded force, in the same parts as `rendered_error_share`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_error_share: Option<f64>,
    /// As `vibration_n`, of the measured minus the commanded force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_vibration_n: Option<f64>,
    /// The realization of the study that explains the commanded force best. Never on a
    /// screen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest_model: Option<ModelId>,
    /// Share of the samples that was lost.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_share: Option<f64>,
    /// Time of the samples over time of the host.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_ratio: Option<f64>,
    /// From when the force fell to the end of the playback, in the time of its samples, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faded_from_s: Option<f64>,
    /// Slope of the reported speed on the change of the reported position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_gain: Option<f64>,
    /// Distance over which the handle was moved, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub travel_mm: Option<f64>,
    /// Share of the identified range that was visited.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_share: Option<f64>,
    /// Largest speed, mm/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub top_speed_mm_s: Option<f64>,
    /// Share of the time in which the handle moved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion_share: Option<f64>,
    /// Largest speed over that of the recordings of the realization.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_factor: Option<f64>,
    /// Share of the time in motion in which the handle was faster or further than these
    /// recordings: the realization is held there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond_share: Option<f64>,
    /// VAF of what was delivered: of the table's force on the validation recording, with the
    /// gain and the delay of this playback.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delivered_vaf: Option<f64>,
}

impl Fidelity {
    /// A playback that cannot be judged, and why.
    pub fn unverified(because: &str) -> Self {
        Self {
            because: Some(because.to_owned()),
            ..Self::default()
        }
    }

    /// Slope of the force that was felt on that of the table: of the measured force where
    /// there is a sensor, else of the commanded one.
    pub fn felt_gain(&self) -> Option<f64> {
        Some(self.rendered_gain? * self.measured_gain.unwrap_or(1.0))
    }

    /// Makes a fault a flag, and says why.
    pub fn only_flag(&mut self, because: &str) {
        if self.verdict == Verdict::Fault {
            self.verdict = Verdict::Flag;
        }
        if self.verdict == Verdict::Flag {
            self.because = Some(because.to_owned());
        }
    }
}
