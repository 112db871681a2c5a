//! A grid of realizations: every method with every dx, validated on other recordings.
//!
//! Work shared by the cells of the paper's method is done once: one pass over the
//! samples serves all λ (`lanes::recursion`) and all dx (`runs`), and only sums over
//! runs of samples are stored. One pass over a recording serves all tables with the
//! same nodes (`lanes::errors`). Memory is that of the recordings and the tables.
//! Work is split into parallel chunks that do not depend on the number of threads, so
//! the results do not either.
//!
//! The order of summation depends on the dx of the grid: a table identified together
//! with other dx can differ in the last digits from the same table identified alone
//! (except with `point`, whose runs do not change).

mod runs;

use super::evidence::Evidence;
use super::ewls::Ewls;
use super::lanes::errors::errors;
use super::lanes::recursion::{self, Run, Sums};
use super::lanes::{LAMBDAS_PER_PASS, Processor};
use super::method::{Progress, Setting, Sort, Start};
use super::resample::{Resample, Resampled};
use super::vaf::{self, Score};
use super::{
    Estimate, Fitted, Identified, IdentifyError, Method, Samples, Training, Warning, ewls,
};
use crate::model::Realization;
use crate::recording::{Recording, mean_and_variance};
use rayon::prelude::*;
use runs::{Nodes, Runs};
use study_wire::certificate::Certificate;
use study_wire::predict::{Direction, Lookup};

/// The cells of a grid: every method with every dx.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Methods with their options.
    pub methods: Vec<Method>,
    /// Resampling increments, mm, for the methods that have them.
    pub dx_mm: Vec<f64>,
}

impl Plan {
    /// The paper's method with each λ.
    pub fn ewls(lambdas: &[f64], dx_mm: &[f64], resample: Resample) -> Self {
        Self {
            methods: lambdas
                .iter()
                .map(|lambda| Method::Ewls(Ewls::paper(*lambda, resample)))
                .collect(),
            dx_mm: dx_mm.to_vec(),
        }
    }

    /// Number of realizations.
    ///
    /// ```
    /// # use study_haptics::identify::grid::Plan;
    /// # use study_haptics::identify::resample::Resample;
    /// // Three λ with two distances of the nodes.
    /// assert_eq!(Plan::ewls(&[0.99, 0.995, 0.999], &[0.5, 1.0], Resample::Point).cells(), 6);
    /// ```
    pub fn cells(&self) -> usize {
        let cells = |method: &Method| {
            if method.has_dx() { self.dx_mm.len() } else { 1 }
        };
        self.methods.iter().map(cells).sum()
    }
}

/// One realization of a grid and how well it predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// How it was identified.
    pub method: Method,
    /// The realization with its VAF by name of recording; its id is empty.
    pub realization: Realization,
    /// The scores on each recording, in their order.
    pub scores: Vec<Score>,
    /// The passivity certificate.
    pub certificate: Certificate,
    /// What is doubtful about the realization.
    pub warnings: Vec<Warning>,
    /// What was found of each term: see [`Identified::terms`].
    pub terms: Vec<Estimate>,
    /// How a mechanism was fitted.
    pub fitted: Option<Box<Fitted>>,
}

/// Identifies every cell, method by method, and scores it on `recordings`. Calls
/// `done` after each cell, from any thread.
///
/// # Errors
/// [`IdentifyError`] of the first cell that cannot be identified.
pub fn run(
    training: &Training<'_>,
    plan: &Plan,
    lookup: Lookup,
    recordings: &[&Recording],
    done: impl Fn() + Sync,
) -> Result<Vec<Cell>, IdentifyError> {
    run_on(Processor::best(), training, plan, lookup, recordings, done)
}

/// [`run`], which also calls `step` after each step of the fit of a mechanism.
///
/// # Errors
/// As [`run`].
pub fn run_in_steps(
    training: &Training<'_>,
    plan: &Plan,
    lookup: Lookup,
    recordings: &[&Recording],
    done: impl Fn() + Sync,
    step: impl Fn(Progress) + Sync,
) -> Result<Vec<Cell>, IdentifyError> {
    let best = Processor::best();
    run_steps_on(best, training, plan, lookup, recordings, done, &step)
}

/// [`run`] with the loops of one instruction set.
///
/// # Errors
/// As [`run`].
///
/// # Panics
/// If this machine does not support the instruction set.
pub fn run_on(
    processor: Processor,
    training: &Training<'_>,
    plan: &Plan,
    lookup: Lookup,
    recordings: &[&Recording],
    done: impl Fn() + Sync,
) -> Result<Vec<Cell>, IdentifyError> {
    run_steps_on(processor, training, plan, lookup, recordings, done, &|_| ())
}

type Step<'s> = &'s (dyn Fn(Progress) + Sync);

fn run_steps_on(
    processor: Processor,
    training: &Training<'_>,
    plan: &Plan,
    lookup: Lookup,
    recordings: &[&Recording],
    done: impl Fn() + Sync,
    step: Step<'_>,
) -> Result<Vec<Cell>, IdentifyError> {
    // check the arguments before the long computation
    for method in &plan.methods {
        method.check()?;
        if training.elsewhere.terms() != [false; 2] && !method.is_table() {
            return Err(IdentifyError::OwnDynamics(method.as_str()));
        }
    }
    let mut tables = Vec::new();
    if plan.methods.iter().any(|m| m.has_dx()) {
        for dx_mm in &plan.dx_mm {
            tables.push(Nodes {
                dx_mm: *dx_mm,
                x_mm: training.nodes(*dx_mm)?,
            });
        }
    }
    let (carried, evidence): (Vec<Method>, Vec<Vec<Evidence>>) =
        (plan.methods.iter().map(|method| training.carried(*method))).unzip();
    let mut identified = identify(processor, training, &carried, &tables, lookup, step)?;
    for ((tables, evidence), method) in identified.iter_mut().zip(evidence).zip(&carried) {
        for table in tables {
            table.add_terms(*method, evidence.clone());
        }
    }
    let methods: Vec<Method> = carried
        .iter()
        .zip(&identified)
        .flat_map(|(method, tables)| vec![*method; tables.len()])
        .collect();
    let identified: Vec<Identified> = identified.into_iter().flatten().collect();
    let realizations: Vec<&Realization> = identified.iter().map(|i| &i.realization).collect();
    let scores = score(processor, &realizations, recordings, done);
    methods
        .into_iter()
        .zip(identified)
        .zip(scores)
        .map(|((method, identified), scores)| {
            let mut cell = cell(method, identified, scores, recordings);
            let said = || training.evidence().copied();
            training.elsewhere.complete(&mut cell, said, recordings)?;
            Ok(cell)
        })
        .collect()
}

/// The tables of each method, in the order of dx.
fn identify(
    processor: Processor,
    training: &Training<'_>,
    methods: &[Method],
    tables: &[Nodes],
    lookup: Lookup,
    step: Step<'_>,
) -> Result<Vec<Vec<Identified>>, IdentifyError> {
    let mut identified: Vec<Option<Result<Vec<Identified>, IdentifyError>>> =
        vec![None; methods.len()];
    for (options, members) in families(methods) {
        let lambdas: Vec<f64> = members
            .iter()
            .filter_map(|i| methods[*i].lambda())
            .collect();
        let of_family = ewls_tables(processor, training, options, &lambdas, tables, lookup);
        for (i, tables) in members.into_iter().zip(of_family) {
            identified[i] = Some(tables);
        }
    }
    identified
        .into_par_iter()
        .zip(methods)
        .map(|(done, method)| {
            done.unwrap_or_else(|| one_method(training, *method, tables, lookup, step))
        })
        .collect::<Vec<_>>()
        .into_iter()
        .collect()
}

/// The tables of a method that shares no work with others.
fn one_method(
    training: &Training<'_>,
    method: Method,
    tables: &[Nodes],
    lookup: Lookup,
    step: Step<'_>,
) -> Result<Vec<Identified>, IdentifyError> {
    let with = |dx_mm| {
        let setting = Setting {
            dx_mm,
            lookup,
            step,
        };
        method.identify(training, setting)
    };
    if let Method::Ewls(options) = method {
        let estimates = training.estimates(options)?;
        let table =
            |nodes: &Nodes| training.ewls(&estimates, nodes.dx_mm, options.resample, lookup);
        return tables.iter().map(table).collect();
    }
    if !method.has_dx() {
        return Ok(vec![with(0.0)?]);
    }
    if method.simulates() {
        // each fit uses all threads
        return tables.iter().map(|nodes| with(nodes.dx_mm)).collect();
    }
    tables
        .par_iter()
        .map(|nodes| with(nodes.dx_mm))
        .collect::<Vec<_>>()
        .into_iter()
        .collect()
}

/// The EWLS methods grouped by their options without λ: these options and the
/// indices of the methods.
fn families(methods: &[Method]) -> Vec<(Ewls, Vec<usize>)> {
    let mut families: Vec<(Ewls, Vec<usize>)> = Vec::new();
    for (i, method) in methods.iter().enumerate() {
        let Method::Ewls(options) = method else {
            continue;
        };
        if !options.bounded && options.lambda < recursion::MIN_LAMBDA {
            continue;
        }
        let same = |family: &Ewls| {
            Ewls {
                lambda: options.lambda,
                ..*family
            } == *options
        };
        match families.iter_mut().find(|(family, _)| same(family)) {
            Some((_, members)) => members.push(i),
            None => families.push((*options, vec![i])),
        }
    }
    families
}

/// The tables of each λ. One pass over the samples serves [`LAMBDAS_PER_PASS`] λ.
fn ewls_tables(
    processor: Processor,
    training: &Training<'_>,
    options: Ewls,
    lambdas: &[f64],
    tables: &[Nodes],
    lookup: Lookup,
) -> Vec<Result<Vec<Identified>, IdentifyError>> {
    let runs = training
        .directions()
        .map(|samples| Runs::new(options.resample, &samples.x_mm, tables));
    let per_pass = if options.bounded { 1 } else { LAMBDAS_PER_PASS };
    let passes: Vec<(usize, &[f64])> = [0, 1]
        .into_iter()
        .flat_map(|direction| lambdas.chunks(per_pass).map(move |l| (direction, l)))
        .collect();
    let sums: Vec<Option<Vec<Sums>>> = passes
        .into_par_iter()
        .flat_map_iter(|(direction, lambdas)| {
            let samples = training.directions()[direction];
            let (backward, runs) = (direction == 1, &runs[direction]);
            pass(processor, options, samples, backward, lambdas, runs)
        })
        .collect();
    let (plus, minus) = sums.split_at(lambdas.len());
    lambdas
        .par_iter()
        .zip(plus)
        .zip(minus)
        .map(|((lambda, plus), minus)| {
            let options = Ewls {
                lambda: *lambda,
                ..options
            };
            let (Some(plus), Some(minus)) = (plus, minus) else {
                return Err(IdentifyError::Diverged { lambda: *lambda });
            };
            let table = |(i, nodes): (usize, &Nodes)| {
                let resampled: Option<[Resampled; 2]> = runs[0]
                    .table(i, nodes, plus)
                    .zip(runs[1].table(i, nodes, minus))
                    .map(Into::into);
                match resampled {
                    Some([mut positive, mut negative]) => {
                        if options.bounded {
                            // rounding of the moments may leave -1e-18
                            let thetas = positive.theta.iter_mut().chain(&mut negative.theta);
                            for p in thetas.flat_map(|theta| &mut theta[..2]) {
                                *p = p.max(0.0);
                            }
                        }
                        Ok(training.ewls_table(
                            options,
                            nodes.dx_mm,
                            nodes.x_mm.clone(),
                            positive,
                            negative,
                            lookup,
                        ))
                    }
                    // no node has samples around it: see `resample`
                    None => training.identify(Method::Ewls(options), nodes.dx_mm, lookup),
                }
            };
            tables.iter().enumerate().map(table).collect()
        })
        .collect()
}

/// The sums of one direction for the λ of one pass, in ascending order of x whatever
/// the order of the recursion.
fn pass(
    processor: Processor,
    options: Ewls,
    samples: &Samples,
    backward: bool,
    lambdas: &[f64],
    runs: &Runs,
) -> Vec<Option<Vec<Sums>>> {
    let warm = |lambda: f64| match options.start {
        Start::Cold => 0,
        Start::Warm => ewls::warm_samples(lambda),
    };
    let moments = runs.moments;
    let sums_over = |samples: &Samples, runs: &[Run]| -> Vec<Option<Vec<Sums>>> {
        if options.bounded {
            let alone =
                |l: &f64| ewls::bounded_sums(samples, (*l, options.terms), warm(*l), runs, moments);
            lambdas.iter().map(alone).collect()
        } else {
            let of = (lambdas, options.terms);
            recursion::sums(processor, samples, of, warm, runs, moments)
        }
    };
    if !(backward && options.sort == Sort::Travel) {
        return sums_over(samples, &runs.runs);
    }
    let n = samples.len();
    let reverse = |run: &Run| Run {
        from: n - run.to,
        to: n - run.from,
        ..*run
    };
    let reversed: Vec<Run> = runs.runs.iter().rev().map(reverse).collect();
    let mut sums = sums_over(&samples.reordered(&samples.descending()), &reversed);
    for sums in sums.iter_mut().flatten() {
        sums.reverse();
    }
    sums
}

/// The scores of every realization on every recording.
fn score(
    processor: Processor,
    realizations: &[&Realization],
    recordings: &[&Recording],
    done: impl Fn() + Sync,
) -> Vec<Vec<Score>> {
    let variance = |r: &&Recording| mean_and_variance(&r.f_n).1;
    let variances: Vec<f64> = recordings.iter().map(variance).collect();
    // tables with the same nodes are compared in one pass
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, r) in realizations.iter().enumerate() {
        let alike = |group: &Vec<usize>| {
            let first = realizations[group[0]];
            group.len() < LAMBDAS_PER_PASS
                && r.direction == Direction::Sign
                && first.direction == Direction::Sign
                && first.x_mm == r.x_mm
        };
        match groups.iter_mut().find(|group| alike(group)) {
            Some(group) => group.push(i),
            None => groups.push(vec![i]),
        }
    }
    let scored: Vec<Vec<Vec<Score>>> = groups
        .par_iter()
        .map(|group| {
            let alike: Vec<&Realization> = group.iter().map(|i| realizations[*i]).collect();
            let mut scores = vec![Vec::new(); group.len()];
            for (recording, variance) in recordings.iter().zip(&variances) {
                if alike[0].direction == Direction::Sign {
                    let errors = errors(processor, &alike, recording);
                    for (scores, errors) in scores.iter_mut().zip(errors) {
                        scores.push(Score {
                            vaf: 1.0 - errors.variance_n2 / variance,
                            bias_n: errors.mean_n,
                            residual_n: errors.variance_n2.sqrt(),
                        });
                    }
                } else {
                    scores[0].push(vaf::score(alike[0], recording));
                }
            }
            for _ in group {
                done();
            }
            scores
        })
        .collect();
    let mut by_realization = vec![Vec::new(); realizations.len()];
    for (group, scores) in groups.into_iter().zip(scored) {
        for (i, scores) in group.into_iter().zip(scores) {
            by_realization[i] = scores;
        }
    }
    by_realization
}

fn cell(
    method: Method,
    identified: Identified,
    scores: Vec<Score>,
    recordings: &[&Recording],
) -> Cell {
    let Identified {
        mut realization,
        warnings,
        terms,
        fitted,
    } = identified;
    for (recording, score) in recordings.iter().zip(&scores) {
        let name = recording.name.clone();
        let hash = recording.sha256.clone();
        realization.provenance.recordings.insert(name.clone(), hash);
        realization.vaf.insert(name, score.vaf);
    }
    Cell {
        method,
        certificate: realization.certificate(),
        realization,
        scores,
        warnings,
        terms,
        fitted,
    }
}

/// The index of the cell with the highest mean VAF over the first `validations`
/// recordings, the first one of equals; `None` if no cell has a finite VAF. A cell that is the only one is
/// the best without any.
pub fn best(cells: &[Cell], validations: usize) -> Option<usize> {
    let mean = |cell: &Cell| {
        let scores = &cell.scores[..validations.min(cell.scores.len())];
        scores.iter().map(|s| s.vaf).sum::<f64>() / scores.len() as f64
    };
    if validations == 0 && cells.len() == 1 {
        return Some(0);
    }
    let mut best: Option<(usize, f64)> = None;
    for (i, cell) in cells.iter().enumerate() {
        let vaf = mean(cell);
        if vaf.is_finite() && best.is_none_or(|(_, highest)| vaf > highest) {
            best = Some((i, vaf));
        }
    }
    best.map(|(i, _)| i)
}
