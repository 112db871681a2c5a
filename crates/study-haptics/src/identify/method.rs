//! The estimators and their options.
//!
//! A [`Method`] specifies a table up to the node spacing dx and the look-up, which a
//! grid varies; [`Training::identify`](super::Training::identify) takes all three.
//! Its `Display` is the `provenance.method` of model files: the name followed by the
//! options that differ from the default, so that a table can be reproduced.

use super::IdentifyError;
use super::resample::Resample;
use std::fmt;
use study_base::named;
use study_wire::predict::Direction;

/// An estimator with its options.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// The paper's method: exponentially weighted least squares along x.
    Ewls(Ewls),
    /// Least squares around each node, with weights that decrease to both sides.
    TwoSided(TwoSided),
    /// All nodes at once, by penalized least squares, with a direction state.
    Hat(Hat),
    /// The hat table with one mass and bounds that make it passive.
    Passive(Passive),
    /// A virtual mechanism, by the simulation error of the force.
    Mechanism(Mechanism),
    /// A potential with dampers and springs that slip, relax or break.
    Elements(Elements),
    /// Mass, damping and friction that do not depend on the position.
    Friction(Friction),
    /// Baseline: mean force by position and direction.
    Static,
    /// Baseline: force by direction, piecewise linear between few nodes.
    Segments(Segments),
    /// Baseline: one straight line.
    Spring,
}

impl Method {
    /// The name in arguments and model files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ewls(Ewls { bounded: false, .. }) => "ewls",
            Self::Ewls(_) => "constrained",
            Self::TwoSided(_) => "two-sided",
            Self::Hat(_) => "hat",
            Self::Passive(_) => "passive",
            Self::Mechanism(_) => "mechanism",
            Self::Elements(_) => "elements",
            Self::Friction(_) => "friction",
            Self::Static => "static",
            Self::Segments(_) => "segments",
            Self::Spring => "spring",
        }
    }

    /// Whether the nodes are multiples of dx.
    pub fn has_dx(self) -> bool {
        !matches!(self, Self::Segments(_) | Self::Spring | Self::Friction(_))
    }

    /// The forgetting factor, if the method has one.
    pub fn lambda(self) -> Option<f64> {
        match self {
            Self::Ewls(options) => Some(options.lambda),
            Self::TwoSided(TwoSided {
                width: Width::Lambda(lambda),
                ..
            }) => Some(lambda),
            _ => None,
        }
    }

    /// The terms, of a method that has a choice of them.
    pub(super) fn terms_mut(&mut self) -> Option<&mut Terms> {
        match self {
            Self::Ewls(Ewls { terms, .. })
            | Self::TwoSided(TwoSided { terms, .. })
            | Self::Hat(Hat { terms, .. })
            | Self::Passive(Passive { terms, .. })
            | Self::Elements(Elements { terms })
            | Self::Friction(Friction { terms, .. }) => Some(terms),
            Self::Mechanism(_) | Self::Static | Self::Segments(_) | Self::Spring => None,
        }
    }

    /// Checks the options.
    ///
    /// # Errors
    /// [`IdentifyError`] for the first option that is out of range.
    pub fn check(self) -> Result<(), IdentifyError> {
        if let Some(lambda) = self.lambda()
            && !(lambda > 0.0 && lambda <= 1.0)
        {
            return Err(IdentifyError::Lambda(lambda));
        }
        match self {
            Self::Ewls(_) | Self::Elements(_) | Self::Static | Self::Spring => Ok(()),
            Self::TwoSided(options) => match options.width {
                Width::Mm(mm) => positive("the width of two-sided weights", mm),
                // without forgetting there would be a single θ for all positions
                Width::Lambda(1.0) => Err(IdentifyError::Lambda(1.0)),
                Width::Lambda(_) => Ok(()),
            },
            Self::Hat(options) => {
                options.state.check()?;
                not_negative("the ridge on F", options.ridge_force)?;
                not_negative("the ridge on m and b", options.ridge_dynamics)
            }
            Self::Passive(options) => {
                options.state.check()?;
                not_negative("the ridge on F", options.ridge_force)?;
                not_negative("the ridge on b", options.ridge_damping)
            }
            Self::Friction(options) => options.state.check(),
            Self::Mechanism(options) => match options.recorded_hz {
                Some(hz) => positive("the corner of the low-pass", hz),
                None => Ok(()),
            },
            Self::Segments(options) => {
                if (1..super::resample::MAX_NODES).contains(&options.count) {
                    Ok(())
                } else {
                    Err(IdentifyError::Segments(options.count))
                }
            }
        }
    }
}

fn positive(option: &'static str, value: f64) -> Result<(), IdentifyError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(IdentifyError::Length { option, value })
    }
}

fn not_negative(option: &'static str, value: f64) -> Result<(), IdentifyError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(IdentifyError::Ridge { option, value })
    }
}

/// Options of exponentially weighted least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ewls {
    /// Forgetting factor λ, above 0 and at most 1.
    pub lambda: f64,
    /// Resampling of the estimates at the nodes.
    pub resample: Resample,
    /// Initial state of the recursion.
    pub start: Start,
    /// Order of the samples.
    pub sort: Sort,
    /// Whether m, b ≥ 0 in every estimate.
    pub bounded: bool,
    /// The terms that are estimated.
    pub terms: Terms,
}

impl Ewls {
    /// The method as published: cold start, ascending order, no bounds, all terms.
    pub fn paper(lambda: f64, resample: Resample) -> Self {
        Self {
            lambda,
            resample,
            start: Start::Cold,
            sort: Sort::Ascending,
            bounded: false,
            terms: Terms::ALL,
        }
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

/// Options of two-sided least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoSided {
    /// Shape of the weights.
    pub window: Window,
    /// Width L of the weights.
    pub width: Width,
    /// Whether m, b ≥ 0 at every node.
    pub bounded: bool,
    /// The terms that are estimated.
    pub terms: Terms,
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

/// The width L of two-sided weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Width {
    /// The memory of EWLS with this λ: L = 1 / ((1 − λ) ρ), with the sample density ρ
    /// of each direction.
    Lambda(f64),
    /// A length, mm.
    Mm(f64),
}

/// Options of the hat table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hat {
    /// The direction state, in identification and in prediction.
    pub state: State,
    /// Weight of the squared second differences of F along the nodes.
    pub ridge_force: f64,
    /// Weight of the squared first differences of m and 60·b.
    pub ridge_dynamics: f64,
    /// Whether m, b ≥ 0 at every node.
    pub bounded: bool,
    /// Which of m and b the table has.
    pub terms: Terms,
}

impl Default for Hat {
    /// Play, with δ found on the training recording, and m, b ≥ 0.
    fn default() -> Self {
        Self {
            state: State::Play(Delta::Scan),
            ridge_force: 3e-3,
            ridge_dynamics: 5e-2,
            bounded: true,
            terms: Terms::default(),
        }
    }
}

/// Options of the virtual mechanism.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mechanism {
    /// The corner of the low-pass that the recorded forces have passed, Hz; `None`: found.
    pub recorded_hz: Option<f64>,
}

/// Options of passive elements.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Elements {
    /// Which of m and b they have.
    pub terms: Terms,
}

/// Options of the friction model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// The direction state, in identification and in prediction.
    pub state: State,
    /// Which of m and b it has.
    pub terms: Terms,
}

impl Default for Friction {
    /// Dahl, with δ found on the training recordings.
    fn default() -> Self {
        Self {
            state: State::Dahl(Delta::Scan),
            terms: Terms::default(),
        }
    }
}

/// Options of the passive table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passive {
    /// The direction state, in identification and in prediction.
    pub state: State,
    /// Weight of the squared second differences of F⁺ and F⁻ along the nodes.
    pub ridge_force: f64,
    /// Weight of the squared first differences of b times the rms speed.
    pub ridge_damping: f64,
    /// Which of m and b the table has.
    pub terms: Terms,
    /// Whether outliers have limited influence: Huber's (1964) weights with k = 1.345.
    pub huber: bool,
}

impl Default for Passive {
    /// Play, with δ found on the training recordings.
    fn default() -> Self {
        Self {
            state: State::Play(Delta::Scan),
            ridge_force: 3e-3,
            ridge_damping: 6e-2,
            terms: Terms::default(),
            huber: false,
        }
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

    /// Whether each entry of [`Theta`](super::Theta) is identified.
    pub(super) fn kept(self) -> [bool; 4] {
        [self.m, self.b, self.k, true]
    }
}

/// The direction state of a hat table.
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
    fn check(self) -> Result<(), IdentifyError> {
        match self {
            Self::Play(Delta::Mm(mm)) | Self::Dahl(Delta::Mm(mm)) => positive("delta", mm),
            _ => Ok(()),
        }
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

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())?;
        match self {
            Self::Ewls(options) => {
                if options.start != Start::Cold {
                    write!(f, " start={}", options.start.as_str())?;
                }
                if options.sort != Sort::Ascending {
                    write!(f, " sort={}", options.sort.as_str())?;
                }
                terms(f, options.terms)
            }
            Self::TwoSided(options) => {
                write!(f, " window={}", options.window.as_str())?;
                if let Width::Mm(mm) = options.width {
                    write!(f, " width={mm}")?;
                }
                bounds(f, options.bounded)?;
                terms(f, options.terms)
            }
            Self::Hat(options) => {
                write!(
                    f,
                    " ridge={},{}",
                    options.ridge_force, options.ridge_dynamics
                )?;
                scanned(f, options.state)?;
                bounds(f, options.bounded)?;
                without_k(f, options.terms)
            }
            Self::Passive(options) => {
                write!(
                    f,
                    " ridge={},{}",
                    options.ridge_force, options.ridge_damping
                )?;
                scanned(f, options.state)?;
                if options.huber {
                    f.write_str(" huber")?;
                }
                without_k(f, options.terms)
            }
            Self::Segments(options) => write!(f, " count={}", options.count),
            Self::Friction(options) => {
                scanned(f, options.state)?;
                without_k(f, options.terms)
            }
            Self::Elements(options) => without_k(f, options.terms),
            Self::Mechanism(options) => match options.recorded_hz {
                Some(hz) => write!(f, " recorded={hz}"),
                None => Ok(()),
            },
            Self::Static | Self::Spring => Ok(()),
        }
    }
}

fn scanned(f: &mut fmt::Formatter<'_>, state: State) -> fmt::Result {
    f.write_str(match state {
        State::Play(Delta::Scan) | State::Dahl(Delta::Scan) => " delta=scan",
        _ => "",
    })
}

/// The terms of a method with a stiffness, if they are not all.
fn terms(f: &mut fmt::Formatter<'_>, terms: Terms) -> fmt::Result {
    listed(f, &[("m", terms.m), ("b", terms.b), ("k", terms.k)])
}

/// The terms of a method without a stiffness, if they are not all.
fn without_k(f: &mut fmt::Formatter<'_>, terms: Terms) -> fmt::Result {
    listed(f, &[("m", terms.m), ("b", terms.b)])
}

fn listed(f: &mut fmt::Formatter<'_>, terms: &[(&str, bool)]) -> fmt::Result {
    if terms.iter().all(|(_, kept)| *kept) {
        return Ok(());
    }
    let kept = terms.iter().filter(|(_, kept)| *kept);
    let names: Vec<&str> = kept.map(|(name, _)| *name).collect();
    match names.is_empty() {
        true => f.write_str(" terms=f0"),
        false => write!(f, " terms={}", names.join(",")),
    }
}

fn bounds(f: &mut fmt::Formatter<'_>, bounded: bool) -> fmt::Result {
    f.write_str(if bounded { " m,b>=0" } else { "" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_displayed_method_has_every_option_that_is_not_the_default() {
        let paper = Ewls::paper(0.999, Resample::Point);
        assert_eq!(Method::Ewls(paper).to_string(), "ewls");
        let warm = Ewls {
            start: Start::Warm,
            sort: Sort::Travel,
            bounded: true,
            ..paper
        };
        assert_eq!(
            Method::Ewls(warm).to_string(),
            "constrained start=warm sort=travel"
        );
        assert_eq!(
            Method::Hat(Hat::default()).to_string(),
            "hat ridge=0.003,0.05 delta=scan m,b>=0"
        );
    }

    #[test]
    fn options_out_of_range_are_refused() {
        let two_sided = |width| {
            Method::TwoSided(TwoSided {
                window: Window::Tricube,
                width,
                bounded: false,
                terms: Terms::default(),
            })
        };
        let hat = |delta, ridge| {
            Method::Hat(Hat {
                state: State::Play(Delta::Mm(delta)),
                ridge_force: ridge,
                ..Hat::default()
            })
        };
        for bad in [
            two_sided(Width::Mm(0.0)),
            two_sided(Width::Mm(f64::NAN)),
            two_sided(Width::Lambda(1.0)),
            two_sided(Width::Lambda(-0.5)),
            hat(0.0, 0.0),
            hat(f64::INFINITY, 0.0),
            hat(0.5, -1.0),
            hat(0.5, f64::NAN),
            Method::Segments(Segments { count: 0 }),
            Method::Segments(Segments { count: usize::MAX }),
            Method::Ewls(Ewls::paper(1.5, Resample::Bin)),
            Method::Ewls(Ewls::paper(f64::NAN, Resample::Bin)),
        ] {
            assert!(bad.check().is_err(), "{bad}");
        }
        assert_eq!(hat(0.5, 0.0).check(), Ok(()));
    }
}
