//! The estimators and increments that the arguments ask for.

use super::super::Failure;
use super::args::{Args, DirectionRule, MethodName, Term, distinct};
use study_haptics::identify::Method;
use study_haptics::identify::grid::Plan;
use study_haptics::identify::method::{
    self, Delta, Ewls, Friction, Hat, Passive, Segments, Sort, Start, State, Terms, TwoSided,
    Width, Window,
};
use study_haptics::identify::resample::Resample;

/// The range of the paper's grid.
const DEFAULT_LAMBDAS: [f64; 10] = [
    0.999, 0.9991, 0.9992, 0.9993, 0.9994, 0.9995, 0.9996, 0.9997, 0.9998, 0.9999,
];
/// The best cell of the paper's grid and the increment of its study, mm in a switch: multiples
/// of the scale of the recording.
const DEFAULT_DX: [f64; 2] = [0.5, 1.0];
/// The range of the paper's Fig. 4, likewise.
const FIGURE_DX: [f64; 11] = [0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0];

impl Args {
    /// The grid: every method with its options, and every dx that is given.
    pub(super) fn plan(&self) -> Result<Plan, Failure> {
        self.check_options_apply()?;
        let lambdas = match distinct(&self.lambda) {
            given if given.is_empty() => DEFAULT_LAMBDAS.to_vec(),
            given => given,
        };
        let deltas: Vec<Delta> = match distinct(&self.delta) {
            given if given.is_empty() => vec![Delta::Scan],
            given => given.into_iter().map(Delta::Mm).collect(),
        };
        let each_delta = |of: &dyn Fn(Delta) -> Method| deltas.iter().map(|d| of(*d)).collect();
        let each = |of: &dyn Fn(f64) -> Method| lambdas.iter().map(|l| of(*l)).collect();
        let methods: Vec<Method> = match self.method() {
            MethodName::Ewls => each(&|lambda| self.ewls(lambda, false)),
            MethodName::Constrained => each(&|lambda| self.ewls(lambda, true)),
            MethodName::TwoSided => {
                let of = |width| {
                    Method::TwoSided(TwoSided {
                        window: self.window.unwrap_or(Window::Tricube),
                        width,
                        bounded: self.bounds.unwrap_or(false),
                        terms: self.kept(),
                    })
                };
                match self.width {
                    Some(mm) => vec![of(Width::Mm(mm))],
                    None => each(&|lambda| of(Width::Lambda(lambda))),
                }
            }
            MethodName::Hat => each_delta(&|delta| self.hat(delta)),
            MethodName::Passive => each_delta(&|delta| self.passive(delta)),
            MethodName::Mechanism => vec![Method::Mechanism(method::Mechanism {
                recorded_hz: self.filter,
            })],
            MethodName::Elements => vec![Method::Elements(method::Elements { terms: self.kept() })],
            MethodName::Friction => {
                let rule = self.direction.unwrap_or(DirectionRule::Dahl);
                each_delta(&|delta| {
                    Method::Friction(Friction {
                        state: state(rule, delta),
                        terms: self.kept(),
                    })
                })
            }
            MethodName::Static => vec![Method::Static],
            MethodName::Segments => vec![Method::Segments(
                self.segments
                    .map_or_else(Segments::default, |count| Segments { count }),
            )],
            MethodName::Spring => vec![Method::Spring],
        };
        let dx_mm = distinct(&self.dx);
        Ok(Plan { methods, dx_mm })
    }

    /// The increments without `--dx`, in a recording of this scale.
    pub(super) fn default_dx_mm(&self, scale_mm: f64) -> Vec<f64> {
        let of_switch: &[f64] = match self.method() {
            MethodName::Mechanism | MethodName::Elements => &DEFAULT_DX[..1],
            _ if self.figures.is_some() => &FIGURE_DX,
            _ => &DEFAULT_DX,
        };
        // 3 · 0.2 has to equal 0.6
        let plain = |dx: f64| format!("{:.6e}", dx * scale_mm).parse().unwrap_or(dx);
        of_switch.iter().map(|dx| plain(*dx)).collect()
    }

    fn ewls(&self, lambda: f64, bounded: bool) -> Method {
        Method::Ewls(Ewls {
            lambda,
            resample: self.resample.unwrap_or(Resample::Bin),
            start: self.start.unwrap_or(Start::Cold),
            sort: self.sort.unwrap_or(Sort::Ascending),
            bounded,
            terms: self.kept(),
        })
    }

    /// The terms that are identified.
    fn kept(&self) -> Terms {
        let kept = |term| self.terms.is_empty() || self.terms.contains(&term);
        Terms {
            m: kept(Term::M),
            b: kept(Term::B),
            k: kept(Term::K),
            only_carried: self.terms.is_empty(),
        }
    }

    /// The direction state of a table.
    fn table_state(&self, delta: Delta) -> State {
        state(self.direction.unwrap_or(DirectionRule::Play), delta)
    }

    fn passive(&self, delta: Delta) -> Method {
        let default = Passive::default();
        Method::Passive(Passive {
            state: self.table_state(delta),
            ridge_force: self.ridge.first().copied().unwrap_or(default.ridge_force),
            ridge_damping: self.ridge.get(1).copied().unwrap_or(default.ridge_damping),
            terms: self.kept(),
            huber: self.huber,
        })
    }

    fn hat(&self, delta: Delta) -> Method {
        let default = Hat::default();
        Method::Hat(Hat {
            state: self.table_state(delta),
            ridge_force: self.ridge.first().copied().unwrap_or(default.ridge_force),
            ridge_dynamics: self.ridge.get(1).copied().unwrap_or(default.ridge_dynamics),
            bounded: self.bounds.unwrap_or(default.bounded),
            terms: self.kept(),
        })
    }

    /// Rejects options that the method does not have. Those of the paper's recursion are
    /// accepted at their defaults, so that one script can identify baselines as well.
    fn check_options_apply(&self) -> Result<(), Failure> {
        use MethodName::{
            Constrained, Elements, Ewls, Friction, Hat, Mechanism, Passive, Segments, Static,
            TwoSided,
        };
        let (lambda, dx) = (!self.lambda.is_empty(), !self.dx.is_empty());
        if !self.terms.is_empty() && !self.terms.contains(&Term::F0) {
            return Err(Failure::usage("--terms needs f0, the force by position")
                .hint("without it: --method friction"));
        }
        if self.terms.contains(&Term::K)
            && !matches!(self.method(), Ewls | Constrained | TwoSided | Mechanism)
        {
            return Err(Failure::usage(
                "--terms: only ewls, constrained and two-sided have a stiffness k",
            )
            .hint("the others have a force by position, f0, whose slope it is"));
        }
        if !self.terms.is_empty() && self.method() == Mechanism {
            return Err(Failure::usage("--terms does not apply to a mechanism").hint(
                "none of its parts can be left out; a standard error shows which ones the recordings do not determine",
            ));
        }
        let given: [(&str, bool, &[MethodName]); 12] = [
            ("--lambda", lambda, &[Ewls, Constrained, TwoSided]),
            (
                "--dx",
                dx,
                &[
                    Ewls,
                    Constrained,
                    TwoSided,
                    Hat,
                    Passive,
                    Mechanism,
                    Elements,
                    Static,
                ],
            ),
            (
                "--start warm",
                self.start == Some(Start::Warm),
                &[Ewls, Constrained],
            ),
            ("--window", self.window.is_some(), &[TwoSided]),
            ("--width", self.width.is_some(), &[TwoSided]),
            (
                "--direction",
                self.direction.is_some(),
                &[Hat, Passive, Friction],
            ),
            ("--delta", !self.delta.is_empty(), &[Hat, Passive, Friction]),
            (
                "--terms",
                !self.terms.is_empty(),
                &[
                    Ewls,
                    Constrained,
                    TwoSided,
                    Hat,
                    Passive,
                    Elements,
                    Friction,
                ],
            ),
            ("--huber", self.huber, &[Passive]),
            ("--ridge", !self.ridge.is_empty(), &[Hat, Passive]),
            ("--bounds", self.bounds.is_some(), &[TwoSided, Hat]),
            ("--segments", self.segments.is_some(), &[Segments]),
        ];
        let useless = |(_, given, methods): &&(_, bool, &[MethodName])| {
            *given && !methods.contains(&self.method())
        };
        match given.iter().find(useless) {
            Some((flag, _, _)) => Err(Failure::usage(format!(
                "{flag} does not apply to this method"
            ))),
            None => Ok(()),
        }
    }
}

fn state(rule: DirectionRule, delta: Delta) -> State {
    match rule {
        DirectionRule::Sign => State::Sign,
        DirectionRule::Play => State::Play(delta),
        DirectionRule::Dahl => State::Dahl(delta),
    }
}
