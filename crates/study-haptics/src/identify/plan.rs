//! What options ask for: the estimators, the grid, or a comparison of all.

use super::grid::Plan;
use super::method::{Known, Opt, Options, TermName};
use super::{ESTIMATORS, Method};

/// The best cell of the paper's grid and the increment of its study, mm in a switch: multiples
/// of the scale of the recording.
const DEFAULT_DX: [f64; 2] = [0.5, 1.0];
/// The range of the paper's Fig. 4, likewise.
const FIGURE_DX: [f64; 11] = [0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0];

/// Why options are refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OptionError {
    /// There is no such estimator.
    #[error("there is no estimator `{}`", study_base::text::Untrusted(.0))]
    Unknown(String),
    /// Terms without the force by position.
    #[error("--terms needs f0, the force by position")]
    WithoutForce,
    /// A stiffness of an estimator that has none.
    #[error("--terms: only {} have a stiffness k", with_stiffness())]
    Stiffness,
    /// Terms of a mechanism.
    #[error("--terms does not apply to a mechanism")]
    Mechanism,
    /// A term that is to be identified and is from elsewhere.
    #[error("--terms {} asks for what is from elsewhere", .0.as_str())]
    Elsewhere(TermName),
    /// An option that the estimator does not have.
    #[error("{} does not apply to this method", .0.as_str())]
    Useless(Opt),
}

impl OptionError {
    /// What to do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::WithoutForce => Some("without it: --method friction"),
            Self::Stiffness => Some("the others have a force by position, f0, whose slope it is"),
            Self::Mechanism => Some(
                "none of its parts can be left out; a standard error shows which ones the recordings do not determine",
            ),
            Self::Elsewhere(_) => Some(
                "leave it out: --dynamic, --mass-kg and --damping-n-s-per-mm say where it is from",
            ),
            Self::Unknown(_) | Self::Useless(_) => None,
        }
    }
}

/// The names of the estimators with a stiffness.
fn with_stiffness() -> String {
    let with = |known: &&Known| known.options.contains(&Opt::Stiffness);
    let names: Vec<&str> = (ESTIMATORS.iter().filter(with))
        .flat_map(|known| known.names.iter().map(|(name, _)| *name))
        .collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    }
}

impl Options {
    /// The name of the estimator. The options of the paper's recursion mean this recursion.
    pub fn name(&self) -> &str {
        let recursion = !self.lambda.is_empty()
            || self.resample.is_some()
            || self.start.is_some()
            || self.sort.is_some();
        (self.method.as_deref()).unwrap_or(match recursion {
            true => "ewls",
            false => "passive",
        })
    }

    /// Whether estimators are compared: without a method, and without an option of one.
    pub fn compares(&self) -> bool {
        let nothing = Self {
            filter_hz: self.filter_hz,
            range_of_dx: self.range_of_dx,
            ..Self::default()
        };
        *self == nothing
    }

    /// Refuses terms that are asked for although mass or damping are from elsewhere.
    pub(super) fn allow(&self, [mass, damping]: [bool; 2]) -> Result<(), OptionError> {
        let asked = |term: &TermName| match term {
            TermName::M => mass,
            TermName::B => damping,
            TermName::K | TermName::F0 => false,
        };
        let wrong = self.terms.iter().copied().find(asked);
        wrong.map_or(Ok(()), |term| Err(OptionError::Elsewhere(term)))
    }

    /// The estimators with their options.
    ///
    /// # Errors
    /// [`OptionError`] for an unknown name, or an option that the estimator does not have. Those
    /// of the paper's recursion are accepted at their defaults, so that one script can identify
    /// baselines as well.
    pub fn methods(&self) -> Result<Vec<Method>, OptionError> {
        let name = self.name();
        let is = |known: &&Known| known.names.iter().any(|(other, _)| *other == name);
        let known = (ESTIMATORS.iter().find(is)).ok_or(OptionError::Unknown(name.to_owned()))?;
        let methods = (known.asked)(name, self);
        if !self.terms.is_empty() && !self.terms.contains(&TermName::F0) {
            return Err(OptionError::WithoutForce);
        }
        let simulates = methods.iter().any(|method| method.simulates());
        if !self.terms.is_empty() && simulates {
            return Err(OptionError::Mechanism);
        }
        let given = [
            (Opt::Stiffness, self.terms.contains(&TermName::K)),
            (Opt::Lambda, !self.lambda.is_empty()),
            (Opt::Dx, !self.dx_mm.is_empty()),
            (Opt::Start, self.start == Some(super::method::Start::Warm)),
            (Opt::Window, self.window.is_some()),
            (Opt::Width, self.width_mm.is_some()),
            (Opt::Direction, self.direction.is_some()),
            (Opt::Delta, !self.delta_mm.is_empty()),
            (Opt::Terms, !self.terms.is_empty()),
            (Opt::Huber, self.huber),
            (Opt::Ridge, self.ridge.is_some()),
            (Opt::Bounds, self.bounds.is_some()),
            (Opt::Segments, self.segments.is_some()),
        ];
        let useless = |(option, given): &&(Opt, bool)| *given && !known.options.contains(option);
        match given.iter().find(useless) {
            Some((Opt::Stiffness, _)) => Err(OptionError::Stiffness),
            Some((option, _)) => Err(OptionError::Useless(*option)),
            None => Ok(methods),
        }
    }

    /// The grid of estimators and increments, for recordings of this scale, mm.
    ///
    /// # Errors
    /// As [`Self::methods`].
    pub fn plan(&self, scale_mm: f64) -> Result<Plan, OptionError> {
        let methods = self.methods()?;
        let of_switch: &[f64] = match methods.iter().any(|method| method.simulates()) {
            true => &DEFAULT_DX[..1],
            false if self.range_of_dx => &FIGURE_DX,
            false => &DEFAULT_DX,
        };
        // 3 · 0.2 has to equal 0.6
        let plain = |dx: f64| format!("{:.6e}", dx * scale_mm).parse().unwrap_or(dx);
        let dx_mm = match self.dx_mm.is_empty() {
            true => of_switch.iter().map(|dx| plain(*dx)).collect(),
            false => self.dx_mm.clone(),
        };
        Ok(Plan { methods, dx_mm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::method::{Delta, Rule, Sort, Start, State, Terms, Window};
    use crate::identify::resample::Resample;
    use crate::identify::{Ewls, Hat, Segments, TwoSided, Width};

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

    /// Every estimator is found by its names, and only by its own.
    #[test]
    fn an_estimator_that_is_asked_for_by_a_name_has_it() {
        let mut names = Vec::new();
        for known in ESTIMATORS {
            for (name, _) in known.names {
                assert!(!names.contains(name), "{name} twice");
                names.push(name);
                let options = Options {
                    method: Some((*name).to_owned()),
                    ..Options::default()
                };
                for method in options.methods().unwrap() {
                    assert_eq!(method.name(), *name);
                    assert_eq!(method.check(), Ok(()));
                    assert!(method.to_string().starts_with(name), "{method}");
                }
            }
        }
        assert_eq!(names.len(), 11);
    }

    #[test]
    fn an_option_that_the_estimator_does_not_have_is_refused() {
        let refused = |method: &str, options: Options| {
            let method = Some(method.to_owned());
            Options { method, ..options }
                .methods()
                .unwrap_err()
                .to_string()
        };
        let delta = Options {
            delta_mm: vec![0.5],
            ..Options::default()
        };
        let stiffness = Options {
            terms: vec![TermName::F0, TermName::K],
            ..Options::default()
        };
        assert_eq!(
            refused("static", delta),
            "--delta does not apply to this method"
        );
        assert_eq!(
            refused("passive", stiffness),
            "--terms: only ewls, constrained and two-sided have a stiffness k"
        );
        assert_eq!(
            refused("magic", Options::default()),
            "there is no estimator `magic`"
        );
        // nothing is asked for: all are compared, and a signal's filter is no option of one
        let nothing = Options {
            filter_hz: Some(30.0),
            ..Options::default()
        };
        assert!(nothing.compares());
        let direction = Some(Rule::Dahl);
        assert!(
            !Options {
                direction,
                ..nothing
            }
            .compares()
        );
    }
}
