//! Which estimator suits a recording: candidates compared on data that were left out.
//!
//! Each candidate is identified from everything, which gives its realization and certificate, and
//! once more without each fold of a blocked cross-validation ([`super::folds`]), which gives its
//! accuracy. dx, δ and λ are chosen by the same folds. A candidate fails if a constant force
//! predicts the data left out better, or if its certificate does not pass; of the others the one
//! with the least residual is recommended, or one before it in the list whose residual is hardly larger. With weights of
//! components the root of what perceptual VAF misses takes the place of the residual.

use super::folds::{FOLDS, Folds, LeftOut};
use super::friction::Friction;
use super::grid::{self, Cell, Plan};
use super::method::{Candidacy, Claim, Delta, Progress, Setting, State, Terms};
use super::passive::Passive;
use super::perceptual::Weights;
use super::vaf::{self, Score};
use super::{ESTIMATORS, IdentifyError, Method, Training, direction_state, evidence};
use crate::model::Realization;
use crate::recording::Recording;
use std::sync::OnceLock;
use study_base::sort::SmallSort as _;
use study_wire::predict::Lookup;

/// Increments that are tried, in units of [`Recording::scale_mm`].
const DX: [f64; 8] = [2.0, 1.0, 0.5, 0.25, 0.1, 0.05, 0.025, 0.01];
/// A residual that exceeds another one by at most this share is hardly larger: of a candidate, and
/// of an increment.
const HARDLY: f64 = 0.05;
/// Increments in a row that may be tried in vain.
const PATIENCE: usize = 3;
/// A residual that is this many times another one is far from it.
pub const FAR: f64 = 2.0;
/// Samples that are enough to choose an increment; of more, every so many-th is used.
const ENOUGH: usize = 100_000;
/// Samples per node, at least, on average and in each direction.
const SAMPLES_PER_NODE: f64 = 5.0;
/// Encoder counts in dx, at least.
const COUNTS_PER_NODE: f64 = 2.0;

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
            _ if self.cell.scores.iter().any(|score| score.vaf < 0.0) => Some(Failure::Constant),
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
    let claims = cell.method.claim() == Claim::Passive;
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
    /// The candidates that were not tried, and why.
    pub not_tried: Vec<(&'static str, String)>,
    /// Standard deviation of the noise of single samples of the force, N, if it is white.
    pub noise_n: Option<f64>,
    /// Whether whole strokes were left out, and not parts of them.
    pub whole_strokes: bool,
    /// Whether candidates were compared by their perceptual VAF, and not by their residual.
    pub by_perceptual: bool,
}

/// What candidates are compared by: their residual on data left out, N, or the root of what perceptual VAF misses there.
fn loss(candidate: &Candidate, by_perceptual: bool) -> f64 {
    let of = |left_out: LeftOut| match left_out.perceptual {
        Some(vaf) if by_perceptual => (1.0 - vaf).max(0.0).sqrt(),
        _ => left_out.rms_n,
    };
    candidate.left_out.map_or(f64::INFINITY, of)
}

impl Comparison {
    /// The best candidate that does not fail, and how many times its residual that of this one
    /// is, where it is [`FAR`] times or more.
    pub fn beaten(&self, candidate: &Candidate) -> Option<(&Candidate, f64)> {
        let rms_n = |c: &Candidate| c.left_out.map_or(f64::INFINITY, |l| l.rms_n);
        let best = (self.candidates.iter())
            .filter(|other| other.failure().is_none())
            .min_by(|a, b| rms_n(a).total_cmp(&rms_n(b)))?;
        let ratio = rms_n(candidate) / rms_n(best);
        (ratio >= FAR && ratio.is_finite()).then_some((best, ratio))
    }

    /// The recommended candidate, or the one of least residual if all fail.
    pub fn best(&self) -> Option<&Candidate> {
        let loss = |c: &Candidate| loss(c, self.by_perceptual);
        match self.recommended {
            Some(i) => self.candidates.get(i),
            None => (self.candidates.iter()).min_by(|a, b| loss(a).total_cmp(&loss(b))),
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
    run_weighed(training, lookup, recordings, None, step)
}

/// The same with weights of the components of errors. The increments and direction states of a method are chosen by the
/// residual nevertheless.
///
/// # Errors
/// As [`run`].
pub fn run_weighed(
    training: &Training<'_>,
    lookup: Lookup,
    recordings: &[&Recording],
    weights: Option<&Weights>,
    step: impl Fn(Progress) + Sync,
) -> Result<Comparison, IdentifyError> {
    let samples: usize = training.recordings.iter().map(|r| r.len()).sum();
    let folds = Folds::new(&training.recordings);
    let trials = Trials::new(training, &folds, samples.div_ceil(ENOUGH), lookup);
    let (mut candidates, mut not_tried) = (Vec::new(), Vec::new());
    for known in ESTIMATORS {
        let name = known.names[0].0;
        match (known.candidate)(&trials)? {
            Candidacy::Never => {}
            Candidacy::NotTried(why) => not_tried.push((name, why)),
            Candidacy::With(method, dx_mm) => {
                match one(training, method, dx_mm, lookup, recordings, &step) {
                    Ok(cell) => candidates.push(Candidate {
                        left_out: trials.left_out(&cell, method, dx_mm, weights),
                        cell,
                    }),
                    // another target, for whatever method
                    Err(error @ IdentifyError::OtherForce(_)) => return Err(error),
                    Err(error) if !candidates.is_empty() => {
                        not_tried.push((name, error.to_string()))
                    }
                    Err(error) => return Err(error),
                }
            }
        }
    }
    let mut left_out = candidates.iter().filter_map(|c: &Candidate| c.left_out);
    let by_perceptual = weights.is_some() && left_out.all(|l| l.perceptual.is_some());
    let residual = |i: usize| loss(&candidates[i], by_perceptual);
    let mut sound: Vec<usize> = (0..candidates.len())
        .filter(|i| candidates[*i].failure().is_none())
        .collect();
    sound.small_sort_by(|a, b| residual(*a).total_cmp(&residual(*b)));
    let hardly_larger = |i: &&usize| residual(**i) <= (1.0 + HARDLY) * residual(sound[0]);
    let recommended = sound.iter().filter(hardly_larger).min().copied();
    Ok(Comparison {
        second: sound.iter().copied().find(|i| Some(*i) != recommended),
        recommended,
        candidates,
        not_tried,
        noise_n: evidence::white_noise_n(&training.recordings),
        whole_strokes: folds.whole_strokes,
        by_perceptual,
    })
}

/// A simple estimator whose residual on the recordings is [`FAR`] times less than that of a
/// realization which was asked for, or less, and how many times.
pub fn beaten_by(
    training: &Training<'_>,
    cell: &Cell,
    lookup: Lookup,
    recordings: &[&Recording],
) -> Option<(Method, f64)> {
    let square = |scores: &[Score]| -> f64 {
        let each = scores
            .iter()
            .map(|s| s.residual_n.powi(2) + s.bias_n.powi(2));
        each.sum()
    };
    let scale_mm = training.recordings[0].scale_mm();
    let dx_mm = (cell.realization.provenance.dx_mm).unwrap_or(0.5 * scale_mm);
    let simple: [Method; 2] = [Friction::default().into(), Passive::default().into()];
    (simple.into_iter())
        .filter(|method| method.name() != cell.method.name())
        .filter_map(|method| {
            let found = training.identify(method, dx_mm, lookup).ok()?;
            let scores: Vec<Score> = (recordings.iter())
                .map(|recording| vaf::score(&found.realization, recording))
                .collect();
            Some((method, (square(&cell.scores) / square(&scores)).sqrt()))
        })
        .filter(|(_, ratio)| *ratio >= FAR)
        .max_by(|a, b| a.1.total_cmp(&b.1))
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
#[derive(Debug)]
pub(super) struct Trials<'t, 'r> {
    training: &'t Training<'r>,
    folds: &'t Folds<'t>,
    /// Without each fold; `None` where the rest does not suit any method.
    rest: Vec<Option<Training<'r>>>,
    lookup: Lookup,
    /// Increments, descending, mm.
    dx_mm: Vec<f64>,
    /// The terms that all recordings together carry.
    terms: Terms,
    /// See [`Self::table`].
    table: OnceLock<(State, f64)>,
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
        let (mut probe, _) = training.carried(Passive::default().into());
        Self {
            rest: (0..FOLDS)
                .map(|fold| Some(folds.without(fold, every)))
                .map(|weights| Training::weighted(&training.recordings, weights).ok())
                .collect(),
            dx_mm: (DX.iter().map(|dx| plain(dx * scale_mm)))
                .filter(|dx| *dx >= least_mm && training.nodes(*dx).is_ok())
                .collect(),
            terms: probe.terms_mut().map_or(Terms::ALL, |terms| *terms),
            table: OnceLock::new(),
            training,
            folds,
            lookup,
        }
    }

    /// The recordings.
    pub(super) fn training(&self) -> &'t Training<'r> {
        self.training
    }

    /// Whether whole strokes are left out, and not parts of them.
    pub(super) fn whole_strokes(&self) -> bool {
        self.folds.whole_strokes
    }

    /// The accuracy of a method on what it was identified without.
    fn left_out(
        &self,
        whole: &Cell,
        method: Method,
        dx_mm: f64,
        weights: Option<&Weights>,
    ) -> Option<LeftOut> {
        let identify = |method: Method, rest: &Training<'r>| {
            let setting = Setting::new(dx_mm, self.lookup);
            method.identify_part(whole.fitted.as_deref(), rest, setting)
        };
        self.left_out_of(method, identify, weights)
    }

    fn left_out_of(
        &self,
        mut method: Method,
        identify: impl Fn(Method, &Training<'r>) -> Option<Realization> + Sync,
        weights: Option<&Weights>,
    ) -> Option<LeftOut> {
        if let Some(terms) = method.terms_mut() {
            // each fold identifies the same terms
            *terms = self.terms;
        }
        let of_fold = |fold: usize| identify(method, self.rest[fold].as_ref()?);
        self.folds.left_out(of_fold, weights)
    }

    /// The rms error of a method on data left out, N; infinite where it cannot be identified.
    pub(super) fn rms_n(&self, method: Method, dx_mm: f64) -> f64 {
        let identify = |method: Method, rest: &Training<'r>| {
            let found = rest.identify(method, dx_mm, self.lookup).ok()?;
            Some(found.realization)
        };
        let left_out = self.left_out_of(method, identify, None);
        left_out.map_or(f64::INFINITY, |left_out| left_out.rms_n)
    }

    /// The increment of least residual, or a longer one whose residual is hardly larger. Shorter
    /// ones are tried until [`PATIENCE`] in a row have not reduced it: nodes as far apart as the
    /// detents of a knob say nothing of nodes that follow them.
    pub(super) fn best_dx(&self, method: Method) -> f64 {
        let mut tried: Vec<(f64, f64)> = Vec::new();
        let mut in_vain = 0;
        let least = |tried: &[(f64, f64)]| tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
        for dx_mm in &self.dx_mm {
            let rms_n = self.rms_n(method, *dx_mm);
            let falls = rms_n < least(&tried);
            tried.push((*dx_mm, rms_n));
            in_vain = match falls || rms_n.is_infinite() {
                true => 0,
                false => in_vain + 1,
            };
            if in_vain == PATIENCE {
                break;
            }
        }
        let most = (1.0 + HARDLY) * least(&tried);
        let best = tried.iter().find(|(_, rms_n)| *rms_n <= most);
        best.map_or(self.training.recordings[0].scale_mm(), |(dx_mm, _)| *dx_mm)
    }

    /// The direction state of a table and the distance of its nodes, mm: those of the passive table
    /// with the least residual.
    ///
    /// # Errors
    /// [`IdentifyError`] if the recordings do not suit a passive table.
    pub(super) fn table(&self) -> Result<(State, f64), IdentifyError> {
        if let Some(found) = self.table.get() {
            return Ok(*found);
        }
        let of = |delta| -> Method {
            let state = State::Play(delta);
            let default = Passive::default();
            Passive { state, ..default }.into()
        };
        let middle_mm = self.dx_mm[self.dx_mm.len() / 2];
        let scanned = self.delta_mm(of(Delta::Scan), middle_mm)?;
        let dx_mm = self.best_dx(of(Delta::Mm(scanned)));
        let tried: Vec<(f64, f64)> = (self.training.deltas_mm().into_iter())
            .map(|delta_mm| (delta_mm, self.rms_n(of(Delta::Mm(delta_mm)), dx_mm)))
            .collect();
        let least = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
        let most = direction_state::TOLERANCE * least;
        let shortest = (tried.iter()).find(|(_, rms_n)| *rms_n <= most);
        let delta_mm = shortest.map_or(scanned, |(delta_mm, _)| *delta_mm);
        Ok(*(self.table).get_or_init(|| (State::Play(Delta::Mm(delta_mm)), dx_mm)))
    }

    /// The δ that a scan over all recordings finds, mm.
    ///
    /// # Errors
    /// [`IdentifyError`] if they do not suit the method.
    pub(super) fn delta_mm(&self, method: Method, dx_mm: f64) -> Result<f64, IdentifyError> {
        let found = self.training.identify(method, dx_mm, self.lookup)?;
        (found.realization.direction.delta_mm()).ok_or(IdentifyError::Undetermined)
    }
}
