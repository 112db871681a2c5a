//! Which springs a recording asks for.
//!
//! They come from a ladder: the one that reduces the squared error most is added, or two branches
//! that relax, as long as that is worth it; then their lengths and times are varied, and one that
//! this has made superfluous is removed. A latch is looked for where the error depends on which of two
//! positions was passed last. The beginnings of the recordings are left out, where branches that
//! relax hold what nobody knows yet.

use super::sums::{Solved, Sums};
use super::{Penalty, latch};
use crate::identify::Training;
use rayon::prelude::*;
use study_wire::elements::{MAX_SPRINGS, Spring};

/// Slip lengths of stops that are tried, as shares of the travel.
const SLIPS: [f64; 6] = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16];
/// Ratio of two relaxation times that are tried, and the first in sampling intervals.
const RELAXATIONS: (f64, f64) = (3.0, 5.0);
/// Longest relaxation time, as a share of the duration.
const LONGEST: f64 = 0.1;
/// Most relaxation times.
const MOST_RELAXATIONS: usize = 7;
/// Branches of the shortest relaxation time that slip are dampers whose force has a limit. It is
/// reached at these shares of the top speed.
const LIMITED: [f64; 3] = [0.1, 0.2, 0.4];
/// A spring reduces the squared error at least by this share.
const WORTH: f64 = 0.1;
/// Lengths and times are varied by these factors, times at most so often by each.
const VARIED: [f64; 4] = [std::f64::consts::SQRT_2, 1.19, 1.09, 1.044];
const MOVES: usize = 6;
/// So many of the factors while springs are still added.
const ROUGH: usize = 2;
/// They are varied no further if that has reduced the squared error by less than this share.
const HARDLY: f64 = 1e-4;
/// Branches whose times are varied together: there are 3 to this power of choices.
const MOST_TOGETHER: usize = 3;
/// A slip over fewer encoder counts follows their noise.
const LEAST_COUNTS: f64 = 10.0;
/// Latches are passive up to this multiple of the speed for which they are certified.
const FASTER: f64 = 1.25;
/// Samples that are enough to choose springs; of more, every so many-th is used.
const ENOUGH: usize = 20_000;

/// What springs are chosen for.
#[derive(Debug)]
pub(super) struct Problem<'p, 'r> {
    training: &'p Training<'r>,
    nodes: &'p [f64],
    penalty: Penalty,
    /// Of the samples every so many-th is used.
    every: usize,
    /// The least slip, mm.
    least_mm: f64,
}

impl<'p, 'r> Problem<'p, 'r> {
    pub(super) fn new(training: &'p Training<'r>, nodes: &'p [f64], penalty: Penalty) -> Self {
        let samples: usize = training.recordings.iter().map(|r| r.len()).sum();
        let counts = (training.recordings.iter()).filter_map(|r| r.resolution_mm());
        Self {
            training,
            nodes,
            penalty,
            every: samples.div_ceil(ENOUGH),
            least_mm: LEAST_COUNTS * counts.fold(0.0, f64::max),
        }
    }

    fn sums(&self, springs: &[Spring]) -> Sums {
        Sums::of(self.training, self.nodes, springs, None, self.every)
    }

    fn solved(&self, springs: &[Spring]) -> Option<Solved> {
        let all: Vec<usize> = (0..springs.len()).collect();
        self.solve(&self.sums(springs), &all)
    }

    /// `None` also if a latch would release less than it is counted to.
    fn solve(&self, sums: &Sums, kept: &[usize]) -> Option<Solved> {
        let trained_mm_s = FASTER * self.training.top_speed_mm_s;
        let passive = |s: &Solved| s.elements.view().certificate(trained_mm_s).passes();
        sums.solve(kept, self.penalty).filter(passive)
    }
}

/// The springs that are worth it.
pub(super) fn springs(problem: &Problem<'_, '_>) -> Option<Vec<Spring>> {
    let mut best = refined(problem, climbed(problem)?);
    loop {
        let before = best.elements.springs.len();
        best = pruned(problem, best);
        if best.elements.springs.len() == before {
            return Some(best.elements.springs);
        }
        best = refined(problem, best);
    }
}

/// With springs of the ladder and latches, one after the other, or two branches at once: where there
/// are two relaxation times, the best single one lies between them, and the next would make up
/// for that.
fn climbed(problem: &Problem<'_, '_>) -> Option<Solved> {
    let ladder = ladder(problem);
    let mut best = problem.solved(&[])?;
    while best.elements.springs.len() < MAX_SPRINGS {
        let now = &best.elements.springs;
        let new: Vec<Spring> = (ladder.iter())
            .filter(|spring| !now.contains(spring))
            .copied()
            .collect();
        let sums = problem.sums(&[&now[..], &new[..]].concat());
        let added = |choice: &Vec<usize>| {
            let kept = (0..now.len()).chain(choice.iter().map(|k| now.len() + k));
            problem.solve(&sums, &kept.collect::<Vec<_>>())
        };
        let choices = choices(problem, &new, MAX_SPRINGS - now.len());
        let mut tried: Vec<Solved> = choices.par_iter().filter_map(added).collect();
        let latches = latch::likely(problem.training, &best.elements, problem.every);
        let with = |latch: &Spring| problem.solved(&[&now[..], &[*latch]].concat());
        tried.extend(latches.iter().filter_map(with));
        // each spring has to be worth it
        let held_to = |solved: &Solved| {
            let more = solved.elements.springs.len() - now.len();
            solved.square / (1.0 - WORTH).powi(more as i32)
        };
        let next = (tried.into_iter()).min_by(|a, b| held_to(a).total_cmp(&held_to(b)));
        match next.filter(|next| held_to(next) < best.square) {
            Some(next) => {
                best = VARIED[..ROUGH]
                    .iter()
                    .fold(next, |best, by| timed(problem, best, *by))
            }
            None => break,
        }
    }
    Some(best)
}

/// Each of some springs, and of branches that do not slip each pair if there is room for one.
fn choices(problem: &Problem<'_, '_>, springs: &[Spring], room: usize) -> Vec<Vec<usize>> {
    let mut choices: Vec<Vec<usize>> = (0..springs.len()).map(|k| vec![k]).collect();
    let relaxing: Vec<usize> = (0..springs.len())
        .filter(|k| relaxation_s(problem.training, &springs[*k]).is_some())
        .collect();
    if room > 1 {
        for (i, one) in relaxing.iter().enumerate() {
            choices.extend(relaxing[..i].iter().map(|other| vec![*other, *one]));
        }
    }
    choices
}

/// Without what the variation of others has made superfluous.
fn pruned(problem: &Problem<'_, '_>, mut best: Solved) -> Solved {
    while let Some(without) = (0..best.elements.springs.len())
        .filter_map(|at| {
            let mut others = best.elements.springs.clone();
            others.remove(at);
            problem.solved(&others)
        })
        .min_by(|a, b| a.square.total_cmp(&b.square))
        .filter(|without| (1.0 - WORTH) * without.square <= best.square)
    {
        best = without;
    }
    best
}

/// With lengths, times and ends varied while that reduces the squared error.
fn refined(problem: &Problem<'_, '_>, mut best: Solved) -> Solved {
    for factor in VARIED {
        best = timed(problem, best, factor);
        for at in 0..best.elements.springs.len() {
            for by in [factor, 1.0 / factor] {
                for varied in varied(problem, &best.elements.springs[at], by) {
                    let mut others = best.elements.springs.clone();
                    others[at] = varied;
                    let next = problem.solved(&others);
                    if let Some(next) = next.filter(|next| next.square < best.square) {
                        best = next;
                    }
                }
            }
        }
    }
    best
}

/// With relaxation times varied by a factor while that reduces the squared error.
fn timed(problem: &Problem<'_, '_>, mut best: Solved, factor: f64) -> Solved {
    for _ in 0..MOVES {
        let before = best.square;
        best = together(problem, best, factor);
        // not less, or hardly
        if best.square > (1.0 - HARDLY) * before {
            break;
        }
    }
    best
}

/// With the relaxation times of all branches varied at once: one makes up for another, so that
/// none of them alone would leave a wrong pair.
fn together(problem: &Problem<'_, '_>, best: Solved, factor: f64) -> Solved {
    let springs = &best.elements.springs;
    let times = (springs.iter()).filter_map(|s| relaxation_s(problem.training, s));
    if !(1..=MOST_TOGETHER).contains(&times.count()) {
        return best;
    }
    let mut variants = Vec::new();
    let mut choices: Vec<Vec<usize>> = vec![Vec::new()];
    for spring in springs {
        let first = variants.len();
        variants.push(*spring);
        if let Some(relaxation_s) = relaxation_s(problem.training, spring) {
            for by in [factor, 1.0 / factor] {
                variants.push(branch(problem.training, by * relaxation_s));
            }
        }
        let each = |choice: &Vec<usize>| -> Vec<Vec<usize>> {
            (first..variants.len())
                .map(|k| [&choice[..], &[k]].concat())
                .collect()
        };
        choices = choices.iter().flat_map(each).collect();
    }
    let sums = problem.sums(&variants);
    let next = (choices.par_iter())
        .filter_map(|choice| problem.solve(&sums, choice))
        .min_by(|a, b| a.square.total_cmp(&b.square));
    match next {
        Some(next) if next.square < best.square => next,
        _ => best,
    }
}

/// A spring with another length. The ends of a latch move by a part of the spacing.
fn varied(problem: &Problem<'_, '_>, spring: &Spring, by: f64) -> Vec<Spring> {
    let kept = |slip_mm: f64| slip_mm >= problem.least_mm;
    match *spring {
        Spring::Stop { slip_mm } => {
            let slip_mm = by * slip_mm;
            let other = Spring::Stop { slip_mm };
            (kept(slip_mm).then_some(other)).into_iter().collect()
        }
        // see `together`
        Spring::Maxwell { .. } if relaxation_s(problem.training, spring).is_some() => Vec::new(),
        Spring::Maxwell {
            slip_mm,
            relaxation_s,
        } => {
            let slip_mm = by * slip_mm;
            let other = Spring::Maxwell {
                slip_mm,
                relaxation_s,
            };
            (kept(slip_mm).then_some(other)).into_iter().collect()
        }
        Spring::Latch { rearm_mm, break_mm } => {
            let by_mm = 1.5 * (by - 1.0) * (problem.nodes[1] - problem.nodes[0]);
            let other = |rearm_mm: f64, break_mm: f64| Spring::Latch { rearm_mm, break_mm };
            [
                other(rearm_mm + by_mm, break_mm),
                other(rearm_mm, break_mm + by_mm),
                other(rearm_mm + by_mm, break_mm + by_mm),
            ]
            .into_iter()
            .filter(Spring::is_valid)
            .collect()
        }
    }
}

/// The relaxation time of a branch that does not slip.
fn relaxation_s(training: &Training<'_>, spring: &Spring) -> Option<f64> {
    match *spring {
        Spring::Maxwell {
            slip_mm,
            relaxation_s,
        } if slip_mm >= most_mm(training, relaxation_s) => Some(relaxation_s),
        _ => None,
    }
}

/// A branch that does not slip.
fn branch(training: &Training<'_>, relaxation_s: f64) -> Spring {
    Spring::Maxwell {
        slip_mm: most_mm(training, relaxation_s),
        relaxation_s,
    }
}

/// The deflection of a branch at twice the trained speed, or over the whole travel, mm.
fn most_mm(training: &Training<'_>, relaxation_s: f64) -> f64 {
    rounded((2.0 * training.top_speed_mm_s * relaxation_s).min(travel_mm(training)))
}

fn travel_mm(training: &Training<'_>) -> f64 {
    training.range_mm[1] - training.range_mm[0]
}

/// Stops and Maxwell branches that are tried.
fn ladder(problem: &Problem<'_, '_>) -> Vec<Spring> {
    let (training, least_mm) = (problem.training, problem.least_mm);
    let stops = (SLIPS.iter().map(|share| share * travel_mm(training)))
        .filter(|slip_mm| *slip_mm >= least_mm)
        .map(|slip_mm| Spring::Stop {
            slip_mm: rounded(slip_mm),
        });
    let longest =
        (training.recordings.iter()).max_by(|a, b| a.duration_s().total_cmp(&b.duration_s()));
    let (duration_s, intervals) =
        longest.map_or((0.0, 1), |r| (r.duration_s(), r.len().max(2) - 1));
    let (ratio, first) = RELAXATIONS;
    let first_s = first * duration_s / intervals as f64;
    let branches = (0..MOST_RELAXATIONS)
        .map(|k| first_s * ratio.powi(k as i32))
        .take_while(|relaxation_s| *relaxation_s <= LONGEST * duration_s)
        .map(|relaxation_s| branch(training, rounded(relaxation_s)));
    let fastest_mm = training.top_speed_mm_s * first_s;
    let limited = (LIMITED.iter().map(|share| share * fastest_mm))
        .filter(|slip_mm| *slip_mm >= least_mm)
        .map(|slip_mm| Spring::Maxwell {
            slip_mm: rounded(slip_mm),
            relaxation_s: rounded(first_s),
        });
    stops.chain(branches).chain(limited).collect()
}

/// With three significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}
