//! What an estimator is, and the options from which it takes its own.
//!
//! An estimator is one file of this folder and its line in `estimators!` of `identify.rs`. The
//! file has a struct with the estimator's options, which implements [`Estimator`] (what it
//! identifies, which terms it has, what its table claims) and `Declared` (its names in arguments
//! and model files, which options apply to it, whether and how it is compared with the others).
//! `friction.rs` is a short model.
//!
//! A [`Method`] specifies a table up to the node spacing dx and the look-up, which a
//! grid varies. Its `Display` is the `provenance.method` of model files: the name followed by the
//! options that differ from the default, so that a table can be reproduced.

use super::resample::Resample;
use super::{Fitted, Identified, IdentifyError, Method, Training, Trials};
use crate::model::Realization;
use std::fmt;
use study_base::named;
use study_wire::predict::{Direction, Lookup};

/// The forgetting factors without `lambda`: the range of the paper's grid.
const DEFAULT_LAMBDAS: [f64; 10] = [
    0.999, 0.9991, 0.9992, 0.9993, 0.9994, 0.9995, 0.9996, 0.9997, 0.9998, 0.9999,
];

/// An estimator with its options.
pub trait Estimator: fmt::Debug {
    /// The name in arguments and model files.
    fn name(&self) -> &'static str;

    /// Identifies a realization.
    ///
    /// # Errors
    /// [`IdentifyError`] if the recordings do not suit the estimator.
    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError>;

    /// Identifies it from a part of the recordings; `whole` is how a mechanism was fitted to all of
    /// them. `None` if the part does not determine it.
    fn identify_part(
        &self,
        _whole: Option<&Fitted>,
        part: &Training<'_>,
        setting: Setting<'_>,
    ) -> Option<Realization> {
        Some(self.identify(part, setting).ok()?.realization)
    }

    /// Checks the options.
    ///
    /// # Errors
    /// [`IdentifyError`] for the first option that is out of range.
    fn check(&self) -> Result<(), IdentifyError> {
        Ok(())
    }

    /// The options that differ from the default, each after a space.
    ///
    /// # Errors
    /// As [`fmt::Display`].
    fn write_options(&self, _f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Ok(())
    }

    /// Whether the nodes are multiples of dx.
    fn has_dx(&self) -> bool {
        true
    }

    /// Whether it simulates the target step by step: it takes even samples and reports its steps.
    fn simulates(&self) -> bool {
        false
    }

    /// Whether its realizations are tables, to which a mass and a damping can be added.
    fn is_table(&self) -> bool {
        true
    }

    /// Whether its realizations have neither mass nor damping, whatever the recordings say.
    fn is_static(&self) -> bool {
        false
    }

    /// What its realizations claim.
    fn claim(&self) -> Claim {
        Claim::Nothing
    }

    /// The forgetting factor, if it has one.
    fn lambda(&self) -> Option<f64> {
        None
    }

    /// The terms, if there is a choice of them.
    fn terms_mut(&mut self) -> Option<&mut Terms> {
        None
    }

    /// The template of the ids of its model files, with `{lambda}`, `{dx}` and `{delta}`.
    fn id_template(&self, several_deltas: bool) -> String {
        let delta = if several_deltas { "-delta-{delta}" } else { "" };
        let dx = if self.has_dx() { "-dx-{dx}" } else { "" };
        format!("{}{delta}{dx}", self.name())
    }
}

/// How an estimator is asked for.
pub(super) trait Declared: Estimator + Sized {
    /// Its name and what it is, as the help lists it; those of its variants.
    const NAMES: &'static [(&'static str, &'static str)];
    /// The options that apply to it, beside those of all.
    const OPTIONS: &'static [Opt];

    /// What options ask for under one of its names.
    fn asked(name: &str, options: &Options) -> Vec<Self>;

    /// How it is compared with the other estimators.
    ///
    /// # Errors
    /// [`IdentifyError`] if the recordings do not suit it.
    fn candidate(_trials: &Trials<'_, '_>) -> Result<Candidacy, IdentifyError> {
        Ok(Candidacy::Never)
    }
}

/// Whether an estimator takes part in a comparison.
#[derive(Debug)]
pub(super) enum Candidacy {
    /// It is no candidate.
    Never,
    /// With these options and this dx, mm.
    With(Method, f64),
    /// It was not tried, and why.
    NotTried(String),
}

/// What the realizations of an estimator claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Claim {
    /// Nothing: their certificate tells.
    Nothing,
    /// To pass their certificate.
    Passive,
    /// To be what others are compared with.
    Baseline,
}

/// What [`Estimator::identify`] needs besides recordings and options.
#[derive(Clone, Copy)]
pub struct Setting<'s> {
    /// Distance of the nodes, mm; without meaning where there is no dx.
    pub dx_mm: f64,
    /// Look-up between nodes.
    pub lookup: Lookup,
    /// Called after each step of a simulation, from any thread.
    pub step: &'s (dyn Fn(Progress) + Sync),
}

impl Setting<'_> {
    /// A dx and a look-up, without reports of steps.
    pub fn new(dx_mm: f64, lookup: Lookup) -> Self {
        Self {
            dx_mm,
            lookup,
            step: &|_| (),
        }
    }
}

/// What has been done, for a progress bar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Steps of all starts so far, and at most.
    pub steps: usize,
    /// See `steps`.
    pub of: usize,
}

/// An estimator in [`ESTIMATORS`](super::ESTIMATORS).
#[derive(Debug)]
pub struct Known {
    /// Its name and what it is; those of its variants.
    pub names: &'static [(&'static str, &'static str)],
    /// The options that apply to it, beside those of all.
    pub options: &'static [Opt],
    pub(super) asked: fn(&str, &Options) -> Vec<Method>,
    pub(super) candidate: fn(&Trials<'_, '_>) -> Result<Candidacy, IdentifyError>,
}

/// Declares the estimators from their files, in the order in which they are preferred where
/// their residuals hardly differ.
macro_rules! estimators {
    ($($(#[$doc:meta])+ $file:ident: $variant:ident($kind:path),)+) => {
        $(pub mod $file;)+

        /// An estimator with its options.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Method {
            $($(#[$doc])+ $variant($kind),)+
        }

        impl std::ops::Deref for Method {
            type Target = dyn method::Estimator;

            fn deref(&self) -> &Self::Target {
                match self { $(Self::$variant(of) => of,)+ }
            }
        }

        impl std::ops::DerefMut for Method {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self { $(Self::$variant(of) => of,)+ }
            }
        }

        $(impl From<$kind> for Method {
            fn from(of: $kind) -> Self {
                Self::$variant(of)
            }
        })+

        /// All estimators.
        pub static ESTIMATORS: &[method::Known] = &[$(method::Known {
            names: <$kind as method::Declared>::NAMES,
            options: <$kind as method::Declared>::OPTIONS,
            asked: |name, options| {
                let asked = <$kind as method::Declared>::asked(name, options);
                asked.into_iter().map(Method::from).collect()
            },
            candidate: <$kind as method::Declared>::candidate,
        },)+];
    };
}
pub(super) use estimators;

named! {
    /// An option that not every estimator has, by its name in arguments.
    Opt {
        /// Forgetting factors.
        Lambda = "--lambda",
        /// Distances of nodes.
        Dx = "--dx",
        /// A warm start of the recursion.
        Start = "--start warm",
        /// The shape of two-sided weights.
        Window = "--window",
        /// The width of two-sided weights.
        Width = "--width",
        /// The rule of the direction state.
        Direction = "--direction",
        /// Its length.
        Delta = "--delta",
        /// Which of mass and damping are identified.
        Terms = "--terms",
        /// A stiffness among the terms.
        Stiffness = "--terms k",
        /// Limited influence of outliers.
        Huber = "--huber",
        /// Weights of penalties.
        Ridge = "--ridge",
        /// Whether mass and damping are at least 0.
        Bounds = "--bounds",
        /// A number of segments.
        Segments = "--segments",
    }
}

named! {
    /// A term that `--terms` names.
    TermName {
        /// The mass.
        M = "m",
        /// The damping.
        B = "b",
        /// The stiffness.
        K = "k",
        /// The force by position; in friction the Coulomb friction with an offset.
        F0 = "f0",
    }
}

named! {
    /// A rule of the direction state.
    Rule {
        /// The sign of v, as in the paper.
        Sign = "sign",
        /// Play (backlash).
        Play = "play",
        /// Dahl friction.
        Dahl = "dahl",
    }
}

/// What a user asks for. What is not given has the default of the estimator.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// The name of an estimator.
    pub method: Option<String>,
    /// Forgetting factors, above 0 and at most 1.
    pub lambda: Vec<f64>,
    /// Distances of the nodes, mm.
    pub dx_mm: Vec<f64>,
    /// Resampling of the estimates of a recursion at the nodes.
    pub resample: Option<Resample>,
    /// Initial state of a recursion.
    pub start: Option<Start>,
    /// Order of the samples in a recursion.
    pub sort: Option<Sort>,
    /// Shape of two-sided weights.
    pub window: Option<Window>,
    /// Width of two-sided weights, mm.
    pub width_mm: Option<f64>,
    /// Rule of the direction state.
    pub direction: Option<Rule>,
    /// Lengths of the direction state, mm.
    pub delta_mm: Vec<f64>,
    /// Weights of the penalties on the force and on the dynamics.
    pub ridge: Option<[f64; 2]>,
    /// Whether outliers have limited influence.
    pub huber: bool,
    /// The terms that are identified; empty: those that the recordings carry.
    pub terms: Vec<TermName>,
    /// Whether mass and damping are at least 0.
    pub bounds: Option<bool>,
    /// Number of segments.
    pub segments: Option<usize>,
    /// The corner of the low-pass that all signals have passed, Hz.
    pub filter_hz: Option<f64>,
    /// Whether the default of dx is a range, for a figure, and not two values.
    pub range_of_dx: bool,
}

impl Options {
    /// The terms that are identified.
    pub(super) fn kept(&self) -> Terms {
        let kept = |term| self.terms.is_empty() || self.terms.contains(&term);
        Terms {
            m: kept(TermName::M),
            b: kept(TermName::B),
            k: kept(TermName::K),
            only_carried: self.terms.is_empty(),
        }
    }

    /// An estimator for each forgetting factor.
    pub(super) fn each_lambda<E>(&self, of: impl Fn(f64) -> E) -> Vec<E> {
        let lambdas = match self.lambda.is_empty() {
            true => &DEFAULT_LAMBDAS[..],
            false => &self.lambda,
        };
        lambdas.iter().map(|lambda| of(*lambda)).collect()
    }

    /// An estimator for each direction state.
    pub(super) fn each_state<E>(&self, default: Rule, of: impl Fn(State) -> E) -> Vec<E> {
        let state = |delta| match self.direction.unwrap_or(default) {
            Rule::Sign => State::Sign,
            Rule::Play => State::Play(delta),
            Rule::Dahl => State::Dahl(delta),
        };
        match self.delta_mm.is_empty() {
            true => vec![of(state(Delta::Scan))],
            false => (self.delta_mm.iter())
                .map(|mm| of(state(Delta::Mm(*mm))))
                .collect(),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        self.write_options(f)
    }
}

/// Refuses a length that is not above 0.
pub(super) fn positive(option: &'static str, value: f64) -> Result<(), IdentifyError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(IdentifyError::Length { option, value })
    }
}

/// Refuses a weight below 0.
pub(super) fn not_negative(option: &'static str, value: f64) -> Result<(), IdentifyError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(IdentifyError::Ridge { option, value })
    }
}

/// Refuses a forgetting factor that is not above 0 and at most 1.
pub(super) fn forgetting(lambda: f64) -> Result<(), IdentifyError> {
    match lambda > 0.0 && lambda <= 1.0 {
        true => Ok(()),
        false => Err(IdentifyError::Lambda(lambda)),
    }
}

named! {
    /// Initial state of the recursion.
    Start {
        /// θ = 0 and P = 10⁶ I.
        Cold = "cold",
        /// The state after a backward pass over the first 3/(1 − λ) samples.
        Warm = "warm",
    }
}

named! {
    /// Order of the samples in the recursion.
    Sort {
        /// Ascending x in both directions.
        Ascending = "ascending",
        /// The direction of travel: ascending in +, descending in −.
        Travel = "travel",
    }
}

named! {
    /// The weight of a sample by its distance from a node.
    Window {
        /// e^(−|x − node|/L), the sum of a forward and a backward EWLS.
        Exponential = "exponential",
        /// (1 − |u|³)³ with u = (x − node)/(3L), 0 for |u| > 1.
        Tricube = "tricube",
    }
}

/// Which terms are identified beside the force by position; the others are 0.
///
/// ```
/// use study_haptics::identify::method::Terms;
/// // what the user asked for is identified, whatever the recordings carry
/// assert!(Terms::default().only_carried && !Terms::ALL.only_carried);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Terms {
    /// The mass.
    pub m: bool,
    /// The damping.
    pub b: bool,
    /// The stiffness, in the methods that estimate one.
    pub k: bool,
    /// Whether m and b are left out where the recordings do not carry them: see
    /// [`evidence`](super::evidence).
    pub only_carried: bool,
}

impl Default for Terms {
    /// All that the recordings carry.
    fn default() -> Self {
        Self {
            only_carried: true,
            ..Self::ALL
        }
    }
}

impl Terms {
    /// All, whatever the recordings carry.
    pub const ALL: Self = Self {
        m: true,
        b: true,
        k: true,
        only_carried: false,
    };

    /// Of mass and damping those that are not left out, as text: ` terms=b`; with a stiffness if
    /// the estimator has one.
    pub(super) fn write(self, f: &mut fmt::Formatter<'_>, stiffness: bool) -> fmt::Result {
        let all = [("m", self.m), ("b", self.b), ("k", self.k)];
        let all = if stiffness { &all[..] } else { &all[..2] };
        if all.iter().all(|(_, kept)| *kept) {
            return Ok(());
        }
        let kept = all.iter().filter(|(_, kept)| *kept);
        let names: Vec<&str> = kept.map(|(name, _)| *name).collect();
        match names.is_empty() {
            true => f.write_str(" terms=f0"),
            false => write!(f, " terms={}", names.join(",")),
        }
    }

    /// Whether each entry of [`Theta`](super::Theta) is identified.
    pub(super) fn kept(self) -> [bool; 4] {
        [self.m, self.b, self.k, true]
    }
}

/// The direction state of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum State {
    /// The sign of v.
    Sign,
    /// See [`Direction::Play`].
    Play(Delta),
    /// See [`Direction::Dahl`].
    Dahl(Delta),
}

impl State {
    pub(super) fn check(self) -> Result<(), IdentifyError> {
        match self {
            Self::Play(Delta::Mm(mm)) | Self::Dahl(Delta::Mm(mm)) => positive("delta", mm),
            _ => Ok(()),
        }
    }

    /// ` delta=scan`, if so.
    pub(super) fn write(self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Play(Delta::Scan) | Self::Dahl(Delta::Scan) => " delta=scan",
            _ => "",
        })
    }

    /// The direction rule with a given δ, mm.
    pub(super) fn with(self, delta_mm: f64) -> Direction {
        match self {
            Self::Sign => Direction::Sign,
            Self::Play(_) => Direction::Play { delta_mm },
            Self::Dahl(_) => Direction::Dahl { delta_mm },
        }
    }
}

/// The length δ of a direction state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delta {
    /// A length, mm.
    Mm(f64),
    /// The shortest whose rms error on the training recordings exceeds the least one by
    /// at most a tenth, between 1/100 and 1/4 of the travel.
    Scan,
}
