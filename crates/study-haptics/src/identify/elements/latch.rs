//! Where a recording asks for a latch: a spring that breaks at one position and holds again
//! below another one.

use study_base::sort::SmallSort as _;
use super::force_n;
use super::sums::follow;
use crate::identify::Training;
use crate::model::Elements;
use rayon::prelude::*;
use study_wire::elements::Spring;

/// Distances of the ends of a latch that are tried, in nodes.
const WIDTHS: [usize; 9] = [1, 2, 3, 4, 6, 8, 12, 16, 24];
/// Latches that are handed over.
const MOST: usize = 3;
/// Its ends are moved by these parts of the spacing, each at most so often.
const REFINED: [f64; 3] = [0.5, 0.2, 0.05];
const MOVES: usize = 4;
/// It has to break this often.
const LEAST_BREAKS: usize = 3;

/// The latches whose state explains most of what elements leave: between the ends the mean error
/// before a break exceeds the one after it. By the sum of squares between these two groups.
pub(super) fn likely(training: &Training<'_>, elements: &Elements, every: usize) -> Vec<Spring> {
    let errors = errors(training, elements, every);
    let nodes = &elements.x_mm;
    let pairs: Vec<[usize; 2]> = (0..nodes.len())
        .flat_map(|low| WIDTHS.iter().map(move |width| [low, low + width]))
        .filter(|[_, high]| *high < nodes.len())
        .collect();
    let mut found: Vec<(f64, [usize; 2])> = (pairs.into_par_iter())
        .filter_map(|[low, high]| Some((explained(&errors, nodes[low], nodes[high])?, [low, high])))
        .collect();
    found.small_sort_by(|a, b| b.0.total_cmp(&a.0));
    (found.iter().take(MOST))
        .map(|(_, [low, high])| refined(&errors, [nodes[*low], nodes[*high]], nodes[1] - nodes[0]))
        .map(|[rearm_mm, break_mm]| Spring::Latch { rearm_mm, break_mm })
        .collect()
}

/// The ends moved by parts of the spacing while that explains more.
fn refined(errors: &[Vec<[f64; 2]>], from_mm: [f64; 2], spacing_mm: f64) -> [f64; 2] {
    let mut best_mm = from_mm;
    let mut most = explained(errors, from_mm[0], from_mm[1]).unwrap_or(0.0);
    for part in REFINED {
        let by_mm = part * spacing_mm;
        for _ in 0..MOVES {
            let moves = [[by_mm, 0.0], [-by_mm, 0.0], [0.0, by_mm], [0.0, -by_mm]];
            let tried = moves.map(|[rearm, breaks]| [best_mm[0] + rearm, best_mm[1] + breaks]);
            let of = |[rearm_mm, break_mm]: &[f64; 2]| match rearm_mm < break_mm {
                true => explained(errors, *rearm_mm, *break_mm).unwrap_or(0.0),
                false => 0.0,
            };
            let next = tried.iter().max_by(|a, b| of(a).total_cmp(&of(b)));
            match next.filter(|next| of(next) > most) {
                Some(next) => (best_mm, most) = (*next, of(next)),
                None => break,
            }
        }
    }
    best_mm
}

/// Positions and errors F − F̂ of the samples, a list for each recording.
fn errors(training: &Training<'_>, elements: &Elements, every: usize) -> Vec<Vec<[f64; 2]>> {
    let mut all = vec![Vec::new(); training.recordings.len()];
    follow(training, &elements.springs, None, every, |r, i, z, _| {
        let recording = training.recordings[r];
        let error = recording.f_n[i] - force_n(elements, recording, i, z);
        all[r].push([recording.x_mm[i], error]);
    });
    all
}

/// The sum of squares between the samples before a break and after one; `None` if there are
/// too few breaks or the force before is not the larger one.
fn explained(errors: &[Vec<[f64; 2]>], rearm_mm: f64, break_mm: f64) -> Option<f64> {
    // number and sum of the errors after a break and before
    let mut groups = [[0.0; 2]; 2];
    let mut breaks = 0;
    for recording in errors {
        let mut holds = recording.first().is_some_and(|first| first[0] <= break_mm);
        for [x, error] in recording {
            if *x > break_mm {
                breaks += usize::from(holds);
                holds = false;
            } else if *x < rearm_mm {
                holds = true;
            } else {
                let group = &mut groups[usize::from(holds)];
                group[0] += 1.0;
                group[1] += error;
            }
        }
    }
    let [[after, after_sum], [before, before_sum]] = groups;
    if breaks < LEAST_BREAKS || after == 0.0 || before == 0.0 {
        return None;
    }
    let difference = before_sum / before - after_sum / after;
    (difference > 0.0).then(|| before * after / (before + after) * difference * difference)
}
