//! The estimators and their options: one value says how a table is made.
//!
//! A [`Method`] has everything but the nodes' spacing dx and the look-up, which a
//! grid varies; [`Training::identify`](super::Training::identify) takes the three
//! together. Its `Display` stands in model files as `provenance.method`: the word,
//! and after it every option that is not the usual one, so that a table can be
//! made again.

use super::IdentifyError;
use super::resample::Resample;
use std::fmt;
use study_wire::predict::Direction;

/// How a realization is identified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// The paper's: exponentially weighted least squares along x, one pass.
    Ewls(Ewls),
    /// Least squares around each node, with weights that fall to both sides.
    TwoSided(TwoSided),
    /// All nodes at once, by penalised least squares, with a direction state.
    Hat(Hat),
    /// Baseline: mean force by position and direction.
    Static,
    /// Baseline: force by direction as straight lines between few nodes.
    Segments(Segments),
    /// Baseline: one straight line.
    Spring,
}

impl Method {
    /// As it stands in arguments.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ewls(Ewls { bounded: false, .. }) => "ewls",
            Self::Ewls(_) => "constrained",
            Self::TwoSided(_) => "two-sided",
            Self::Hat(_) => "hat",
            Self::Static => "static",
            Self::Segments(_) => "segments",
            Self::Spring => "spring",
        }
    }

    /// Whether dx has a meaning for it.
    pub fn has_dx(self) -> bool {
        !matches!(self, Self::Segments(_) | Self::Spring)
    }

    /// The forgetting factor, where it has one.
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

    /// Checks the options.
    ///
    /// # Errors
    /// [`IdentifyError`] for the first number that is out of range.
    pub fn check(self) -> Result<(), IdentifyError> {
        if let Some(lambda) = self.lambda()
            && !(lambda > 0.0 && lambda <= 1.0)
        {
            return Err(IdentifyError::Lambda(lambda));
        }
        match self {
            Self::Ewls(_) | Self::Static | Self::Spring => Ok(()),
            Self::TwoSided(options) => match options.width {
                Width::Mm(mm) => positive("the width of two-sided weights", mm),
                // without forgetting there would be one θ for all positions
                Width::Lambda(1.0) => Err(IdentifyError::Lambda(1.0)),
                Width::Lambda(_) => Ok(()),
            },
            Self::Hat(options) => {
                if let State::Play(Delta::Mm(mm)) | State::Dahl(Delta::Mm(mm)) = options.state {
                    positive("delta", mm)?;
                }
                not_negative("the ridge on F", options.ridge_force)?;
                not_negative("the ridge on m and b", options.ridge_dynamics)
            }
            Self::Segments(options) => {
                if (1..super::resample::MOST_NODES).contains(&options.count) {
                    Ok(())
                } else {
                    Err(IdentifyError::Segments(options.count))
                }
            }
        }
    }
}

fn positive(what: &'static str, value: f64) -> Result<(), IdentifyError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(IdentifyError::Length { what, value })
    }
}

fn not_negative(what: &'static str, value: f64) -> Result<(), IdentifyError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(IdentifyError::Ridge { what, value })
    }
}

/// Options of the paper's method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ewls {
    /// Forgetting factor, above 0 and at most 1.
    pub lambda: f64,
    /// How the estimates are brought to the nodes.
    pub resample: Resample,
    /// How the recursion begins.
    pub start: Start,
    /// The order of the samples.
    pub sort: Sort,
    /// Whether every estimate has m, b ≥ 0.
    pub bounded: bool,
}

impl Ewls {
    /// The paper's own: cold start, ascending order, no bounds.
    pub fn paper(lambda: f64, resample: Resample) -> Self {
        Self {
            lambda,
            resample,
            start: Start::Cold,
            sort: Sort::Ascending,
            bounded: false,
        }
    }
}

/// How the recursion begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// From θ = 0 and P = 10⁶ I.
    Cold,
    /// From where a pass back over the first 3/(1 − λ) samples ends.
    Warm,
}

impl Start {
    /// As it stands in arguments.
    pub fn word(self) -> &'static str {
        match self {
            Self::Cold => "cold",
            Self::Warm => "warm",
        }
    }
}

/// The order of the samples in the recursion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sort {
    /// From the lowest x up in both directions.
    Ascending,
    /// As the target travels: up in +, down in −.
    Travel,
}

impl Sort {
    /// As it stands in arguments.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ascending => "ascending",
            Self::Travel => "travel",
        }
    }
}

/// Options of two-sided least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoSided {
    /// How the weights fall.
    pub window: Window,
    /// How far they reach.
    pub width: Width,
    /// Whether m, b ≥ 0 at every node.
    pub bounded: bool,
}

/// How weights fall with the distance from a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Window {
    /// e^(−|x − node|/L): an EWLS forward and one backward, combined.
    Exponential,
    /// (1 − |u|³)³ with u = (x − node)/(3L), 0 beyond.
    Tricube,
}

impl Window {
    /// As it stands in arguments.
    pub fn word(self) -> &'static str {
        match self {
            Self::Exponential => "exponential",
            Self::Tricube => "tricube",
        }
    }
}

/// L of two-sided weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Width {
    /// That of an EWLS: L = 1 / ((1 − λ) ρ), in each direction by its own ρ.
    Lambda(f64),
    /// mm.
    Mm(f64),
}

/// Options of the hat table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hat {
    /// How the branches are joined, in identification and afterwards.
    pub state: State,
    /// Weight of the squared second differences of F along the nodes.
    pub ridge_force: f64,
    /// Weight of the squared first differences of m and 60·b.
    pub ridge_dynamics: f64,
    /// Whether m, b ≥ 0 at every node.
    pub bounded: bool,
}

impl Default for Hat {
    /// Play with δ found on the training data, m, b ≥ 0.
    fn default() -> Self {
        Self {
            state: State::Play(Delta::Scan),
            ridge_force: 3e-3,
            ridge_dynamics: 5e-2,
            bounded: true,
        }
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
    /// As it stands in arguments.
    pub fn word(self) -> &'static str {
        match self {
            Self::Sign => "sign",
            Self::Play(_) => "play",
            Self::Dahl(_) => "dahl",
        }
    }

    /// The rule with one δ.
    pub(super) fn with(self, delta_mm: f64) -> Direction {
        match self {
            Self::Sign => Direction::Sign,
            Self::Play(_) => Direction::Play { delta_mm },
            Self::Dahl(_) => Direction::Dahl { delta_mm },
        }
    }
}

/// δ of a direction state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delta {
    /// mm.
    Mm(f64),
    /// The shortest in 0.3 to 1 mm that leaves at most a tenth more (rms) of the
    /// training recording than the one that leaves least.
    Scan,
}

/// Options of the segmented baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segments {
    /// How many straight lines over the range of both directions.
    pub count: usize,
}

impl Default for Segments {
    /// Twelve.
    fn default() -> Self {
        Self { count: 12 }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())?;
        match self {
            Self::Ewls(options) => {
                if options.start != Start::Cold {
                    write!(f, " start={}", options.start.word())?;
                }
                if options.sort != Sort::Ascending {
                    write!(f, " sort={}", options.sort.word())?;
                }
                Ok(())
            }
            Self::TwoSided(options) => {
                write!(f, " window={}", options.window.word())?;
                if let Width::Mm(mm) = options.width {
                    write!(f, " width={mm}")?;
                }
                bounds(f, options.bounded)
            }
            Self::Hat(options) => {
                write!(
                    f,
                    " ridge={},{}",
                    options.ridge_force, options.ridge_dynamics
                )?;
                if let State::Play(Delta::Scan) | State::Dahl(Delta::Scan) = options.state {
                    f.write_str(" delta=scan")?;
                }
                bounds(f, options.bounded)
            }
            Self::Segments(options) => write!(f, " count={}", options.count),
            Self::Static | Self::Spring => Ok(()),
        }
    }
}

fn bounds(f: &mut fmt::Formatter<'_>, bounded: bool) -> fmt::Result {
    if bounded {
        f.write_str(" m,b>=0")
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_method_in_words_has_every_option_that_is_not_the_usual_one() {
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
