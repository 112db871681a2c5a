//! Which estimator suits a recording: candidates compared on data that were left out.
//!
//! Each candidate is identified from everything, which gives its realization and certificate, and
//! once more without each fold of a blocked cross-validation ([`super::folds`]), which gives its
//! accuracy. dx, δ and λ are chosen by the same folds. A candidate fails if a constant force
//! predicts the data left out better, or if its certificate does not pass; of the others the one
//! with the least residual is recommended, or one before it in the list whose residual is hardly larger.

use super::folds::{FOLDS, Folds, LeftOut};
use super::grid::{self, Cell, Plan};
use super::mechanism::{self, Progress};
use super::method::{Delta, Elements, Ewls, Friction, Hat, Passive, Start, State, Terms};
use super::resample::Resample;
use super::{IdentifyError, Method, Training, evidence, hat_table};
use crate::recording::Recording;
use study_wire::predict::Lookup;

/// Increments that are tried, in units of [`Recording::scale_mm`].
const DX: [f64; 8] = [2.0, 1.0, 0.5, 0.25, 0.1, 0.05, 0.025, 0.01];
/// Memories of the recursion that are tried, in units of dx.
const MEMORIES: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];
/// A residual that exceeds another one by at most this share is hardly larger: of a candidate, and
/// of an increment.
const HARDLY: f64 = 0.05;
/// Samples that are enough to choose an increment; of more, every so many-th is used.
const ENOUGH: usize = 100_000;
/// Samples per node, at least, on average and in each direction.
const SAMPLES_PER_NODE: f64 = 5.0;
/// Encoder counts in dx, at least.
const COUNTS_PER_NODE: f64 = 2.0;
/// Steps times parameters of a mechanism that is tried: four times what 60 s need with nodes
/// every 1/70 of the travel.
const MOST_WORK: f64 = 1.6e8;

/// A method that was compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Its realization from everything.
    pub cell: Cell,
    /// Its accuracy on data left out; `None` if it could not be identified without some of them.
    pub left_out: Option<LeftOut>,
}

impl Candidate {
    /// Why it is not recommended, whatever the others do.
    pub fn failure(&self) -> Option<Failure> {
        match self.left_out {
            None => Some(Failure::Undetermined),
            Some(LeftOut { vaf, .. }) if vaf < 0.0 => Some(Failure::Constant),
            _ if !self.cell.certificate.passes() => Some(Failure::Certificate),
            _ => None,
        }
    }
}

/// How a method fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// A constant force predicts better.
    #[error("predicts data left out worse than a constant")]
    Constant,
    /// It can supply energy.
    #[error("its certificate fails")]
    Certificate,
    /// Parts of the recordings do not determine it.
    #[error("parts of the recordings do not determine it")]
    Undetermined,
}

/// How a method that was asked for fails: where it was validated, or where it claims to be passive.
/// The paper's method and the baselines make no such claim.
pub fn failure(cell: &Cell) -> Option<Failure> {
    let claims = matches!(
        cell.method,
        Method::Passive(_) | Method::Friction(_) | Method::Mechanism(_) | Method::Elements(_)
    );
    if cell.scores.iter().any(|score| score.vaf < 0.0) {
        return Some(Failure::Constant);
    }
    (claims && !cell.certificate.passes()).then_some(Failure::Certificate)
}

/// All candidates, in the order in which they are preferred where their residuals hardly differ.
#[derive(Debug)]
pub struct Comparison {
    /// The methods that were compared.
    pub candidates: Vec<Candidate>,
    /// The recommended one; `None` if all fail.
    pub recommended: Option<usize>,
    /// The next best that does not fail.
    pub second: Option<usize>,
    /// Why the mechanism was not tried.
    pub not_tried: Option<String>,
    /// Standard deviation of the noise of single samples of the force, N, if it is white.
    pub noise_n: Option<f64>,
    /// Whether whole strokes were left out, and not parts of them.
    pub whole_strokes: bool,
}

impl Comparison {
    /// The recommended candidate, or the one of least residual if all fail.
    pub fn best(&self) -> Option<&Candidate> {
        let residual = |c: &Candidate| c.left_out.map_or(f64::INFINITY, |l| l.rms_n);
        match self.recommended {
            Some(i) => self.candidates.get(i),
            None => (self.candidates.iter()).min_by(|a, b| residual(a).total_cmp(&residual(b))),
        }
    }
}

/// Compares the methods, and scores them on `recordings`. `step` is called after each step of the
/// fit of a mechanism.
///
/// # Errors
/// [`IdentifyError`] if the recordings do not suit a passive table.
pub fn run(
    training: &Training<'_>,
    lookup: Lookup,
    recordings: &[&Recording],
    step: impl Fn(Progress) + Sync,
) -> Result<Comparison, IdentifyError> {
    let samples: usize = training.recordings.iter().map(|r| r.len()).sum();
    let folds = Folds::new(&training.recordings);
    let trials = Trials::new(training, &folds, samples.div_ceil(ENOUGH), lookup);
    let (passive, dx_mm) = trials.passive()?;
    let Method::Passive(Passive { state, .. }) = passive else {
        return Err(IdentifyError::Undetermined);
    };
    let hat = Method::Hat(Hat {
        state,
        ..Hat::default()
    });
    let friction = trials.friction()?;
    let static_dx_mm = trials.best_dx(Method::Static);
    let plans = [
        (friction, dx_mm),
        (passive, dx_mm),
        (Method::Static, static_dx_mm),
        (trials.ewls(dx_mm), dx_mm),
        (hat, dx_mm),
    ];
    let candidate = |(method, dx_mm): (Method, f64)| -> Result<Candidate, IdentifyError> {
        Ok(Candidate {
            cell: one(training, method, dx_mm, lookup, recordings, &step)?,
            left_out: trials.left_out(method, dx_mm),
        })
    };
    // a slow loop has neither speeds nor partial strokes
    let elements = (folds.whole_strokes).then(|| (Method::Elements(Elements::default()), dx_mm));
    let mut candidates = plans
        .into_iter()
        .chain(elements)
        .map(candidate)
        .collect::<Result<Vec<_>, _>>()?;
    let not_tried = match trials.mechanism(recordings, &step) {
        Ok(mechanism) => {
            candidates.push(mechanism);
            None
        }
        Err(why) => Some(why),
    };
    let residual = |i: usize| candidates[i].left_out.map_or(f64::INFINITY, |l| l.rms_n);
    let mut sound: Vec<usize> = (0..candidates.len())
        .filter(|i| candidates[*i].failure().is_none())
        .collect();
    sound.sort_by(|a, b| residual(*a).total_cmp(&residual(*b)));
    let hardly_larger = |i: &&usize| residual(**i) <= (1.0 + HARDLY) * residual(sound[0]);
    let recommended = sound.iter().filter(hardly_larger).min().copied();
    Ok(Comparison {
        second: sound.iter().copied().find(|i| Some(*i) != recommended),
        recommended,
        candidates,
        not_tried,
        noise_n: evidence::white_noise_n(&training.recordings),
        whole_strokes: folds.whole_strokes,
    })
}

/// One realization from everything.
fn one(
    training: &Training<'_>,
    method: Method,
    dx_mm: f64,
    lookup: Lookup,
    recordings: &[&Recording],
    step: &(impl Fn(Progress) + Sync),
) -> Result<Cell, IdentifyError> {
    let plan = Plan {
        methods: vec![method],
        dx_mm: vec![dx_mm],
    };
    let cells = grid::run_in_steps(training, &plan, lookup, recordings, || (), step)?;
    cells.into_iter().next().ok_or(IdentifyError::Undetermined)
}

/// The methods without each fold.
struct Trials<'t, 'r> {
    training: &'t Training<'r>,
    folds: &'t Folds<'t>,
    /// Without each fold; `None` where the rest does not suit any method.
    rest: Vec<Option<Training<'r>>>,
    lookup: Lookup,
    /// Increments, descending, mm.
    dx_mm: Vec<f64>,
    /// The terms that all recordings together carry.
    terms: Terms,
}

impl<'t, 'r> Trials<'t, 'r> {
    fn new(training: &'t Training<'r>, folds: &'t Folds<'t>, every: usize, lookup: Lookup) -> Self {
        let scale_mm = training.recordings[0].scale_mm();
        let [low, high] = training.range_mm;
        let fewest = training.directions().map(super::Samples::len);
        let counts = (training.recordings.iter()).filter_map(|r| r.resolution_mm());
        let least_mm = (SAMPLES_PER_NODE * (high - low) / fewest[0].min(fewest[1]) as f64)
            .max(COUNTS_PER_NODE * counts.fold(0.0, f64::max));
        // 3 · 0.2 has to equal 0.6
        let plain = |dx: f64| format!("{dx:.6e}").parse().unwrap_or(dx);
        let mut probe = Method::Passive(Passive::default());
        (probe, _) = training.carried(probe);
        Self {
            rest: (0..FOLDS)
                .map(|fold| Some(folds.without(fold, every)))
                .map(|weights| Training::weighted(&training.recordings, weights).ok())
                .collect(),
            dx_mm: (DX.iter().map(|dx| plain(dx * scale_mm)))
                .filter(|dx| *dx >= least_mm && training.nodes(*dx).is_ok())
                .collect(),
            terms: probe.terms_mut().map_or(Terms::ALL, |terms| *terms),
            training,
            folds,
            lookup,
        }
    }

    fn left_out(&self, method: Method, dx_mm: f64) -> Option<LeftOut> {
        let mut method = method;
        if let Some(terms) = method.terms_mut() {
            // each fold identifies the same terms
            *terms = self.terms;
        }
        self.folds.left_out(|fold| {
            let rest = self.rest[fold].as_ref()?;
            let found = rest.identify(method, dx_mm, self.lookup).ok()?;
            Some(found.realization)
        })
    }

    fn rms_n(&self, method: Method, dx_mm: f64) -> f64 {
        let left_out = self.left_out(method, dx_mm);
        left_out.map_or(f64::INFINITY, |left_out| left_out.rms_n)
    }

    /// The increment of least residual, or a longer one whose residual is hardly larger. Shorter
    /// ones are tried while the residual falls.
    fn best_dx(&self, method: Method) -> f64 {
        let mut tried: Vec<(f64, f64)> = Vec::new();
        let least = |tried: &[(f64, f64)]| tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
        for dx_mm in &self.dx_mm {
            let rms_n = self.rms_n(method, *dx_mm);
            let falls = rms_n < least(&tried);
            tried.push((*dx_mm, rms_n));
            if !falls && rms_n.is_finite() {
                break;
            }
        }
        let most = (1.0 + HARDLY) * least(&tried);
        let best = tried.iter().find(|(_, rms_n)| *rms_n <= most);
        best.map_or(self.training.recordings[0].scale_mm(), |(dx_mm, _)| *dx_mm)
    }

    /// The passive table with its increment.
    fn passive(&self) -> Result<(Method, f64), IdentifyError> {
        let default = Passive::default();
        let of = |delta| {
            Method::Passive(Passive {
                state: State::Play(delta),
                ..default
            })
        };
        let middle_mm = self.dx_mm[self.dx_mm.len() / 2];
        let scanned = self.delta_mm(of(Delta::Scan), middle_mm)?;
        let dx_mm = self.best_dx(of(Delta::Mm(scanned)));
        let tried: Vec<(f64, f64)> = (self.training.deltas_mm().into_iter())
            .map(|delta_mm| (delta_mm, self.rms_n(of(Delta::Mm(delta_mm)), dx_mm)))
            .collect();
        let least = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
        let shortest = (tried.iter()).find(|(_, rms_n)| *rms_n <= hat_table::TOLERANCE * least);
        let delta_mm = shortest.map_or(scanned, |(delta_mm, _)| *delta_mm);
        Ok((of(Delta::Mm(delta_mm)), dx_mm))
    }

    /// The δ that a scan over all recordings finds.
    fn delta_mm(&self, method: Method, dx_mm: f64) -> Result<f64, IdentifyError> {
        let found = self.training.identify(method, dx_mm, self.lookup)?;
        (found.realization.direction.delta_mm()).ok_or(IdentifyError::Undetermined)
    }

    fn friction(&self) -> Result<Method, IdentifyError> {
        let of = |delta| {
            Method::Friction(Friction {
                state: State::Dahl(delta),
                ..Friction::default()
            })
        };
        let delta_mm = self.delta_mm(of(Delta::Scan), self.dx_mm[0])?;
        Ok(of(Delta::Mm(delta_mm)))
    }

    /// The recursion with the memory of least residual.
    fn ewls(&self, dx_mm: f64) -> Method {
        let [plus, minus] = self.training.directions().map(super::Samples::len);
        let [low, high] = self.training.range_mm;
        let per_mm = plus.max(minus) as f64 / (high - low);
        let of = |memory: &f64| {
            let forgotten: f64 = 1.0 / (memory * dx_mm * per_mm).max(10.0);
            let lambda = 1.0 - format!("{forgotten:.0e}").parse().unwrap_or(forgotten);
            Method::Ewls(Ewls {
                start: Start::Warm,
                terms: Terms::default(),
                ..Ewls::paper(lambda, Resample::Hat)
            })
        };
        let methods = MEMORIES.iter().map(of);
        let tried = methods.map(|method| (method, self.rms_n(method, dx_mm)));
        let best = tried.min_by(|a, b| a.1.total_cmp(&b.1));
        best.map_or_else(|| of(&1.0), |(method, _)| method)
    }

    /// The mechanism, or why it was not tried. Without each fold it is fitted from where the fit to
    /// everything ended.
    fn mechanism(
        &self,
        recordings: &[&Recording],
        step: &(impl Fn(Progress) + Sync),
    ) -> Result<Candidate, String> {
        if !self.folds.whole_strokes {
            return Err("too few strokes".to_owned());
        }
        let [low, high] = self.training.range_mm;
        let dx_mm = 0.5 * self.training.recordings[0].scale_mm();
        let seconds: f64 = (self.training.recordings.iter())
            .map(|r| r.duration_s())
            .sum();
        let work = seconds * mechanism::PREDICTED_HZ * ((high - low) / dx_mm);
        if work > MOST_WORK {
            return Err("it would take minutes: --method mechanism".to_owned());
        }
        let method = Method::Mechanism(super::method::Mechanism::default());
        let cell = one(self.training, method, dx_mm, self.lookup, recordings, step)
            .map_err(|error| error.to_string())?;
        let fitted = (cell.fitted.as_deref()).ok_or("it was not fitted".to_owned())?;
        let left_out = self.folds.left_out(|fold| {
            let rest = self.rest[fold].as_ref()?;
            let mechanism = mechanism::refitted(fitted, rest)?;
            Some(rest.of_mechanism(method, dx_mm, mechanism))
        });
        Ok(Candidate { cell, left_out })
    }
}
