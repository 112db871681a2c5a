//! Where recordings went, for the model file.

use super::evidence::Term;
use super::folds::strokes;
use super::problem::{Estimate, Warning};
use crate::model::coverage::{Coverage, Determined, Origin};
use crate::model::{Mechanism, Realization};
use crate::recording::Recording;
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;

/// Places of the map.
const PLACES: usize = 20;
/// Classes of speeds, each twice as fast as the one before.
const CLASSES: usize = 6;
/// Share of the range at either side that is its end, as for the full strokes of a playback.
const END: f64 = 0.2;

/// What is known of mass and damping, by the names in a model file, without a value where recordings do not
/// show the term and nobody stated it: nothing is known of one that they do not bound either.
pub(super) fn determined(terms: &[Estimate]) -> BTreeMap<String, Determined> {
    let of = |term: Term| {
        let found = terms.iter().find(|of| of.name == term.as_str())?;
        let key = match term {
            Term::Mass => "m_kg",
            Term::Damping => "b_n_s_per_mm",
        };
        let known = Determined {
            value: (found.identified || found.origin == Origin::Stated).then_some(found.value),
            standard_error: found.standard_error.filter(|_| found.identified),
            upper_bound: found.upper_bound,
            origin: found.origin,
        };
        Some((key.to_owned(), known))
    };
    Term::BOTH.into_iter().filter_map(of).collect()
}

/// A note with what recordings do not bound, and why.
pub(super) fn note(note: Option<String>, warnings: &[Warning]) -> Option<String> {
    let unbounded = warnings.iter().filter_map(|warning| match warning {
        Warning::LeftOut(evidence) | Warning::Ambiguous(evidence) | Warning::Without(evidence) => {
            (evidence.upper_bound.is_none()).then(|| evidence.to_string())
        }
        _ => None,
    });
    let all: Vec<String> = note.into_iter().chain(unbounded).collect();
    (!all.is_empty()).then(|| all.join("; "))
}

/// The coverage of a realization by the recordings that it was identified from.
pub fn of(realization: &Realization, recordings: &[&Recording]) -> Coverage {
    let trained = realization.trained;
    let mut coverage = Coverage::empty(trained.x_mm, trained.v_mm_s, PLACES, CLASSES);
    for recording in recordings {
        for (x_mm, v_mm_s) in recording.x_mm.iter().zip(&recording.v_mm_s) {
            coverage.add(*x_mm, *v_mm_s);
        }
        let [full, partial] = full_and_partial(recording, trained.x_mm);
        coverage.full_strokes += full;
        coverage.partial_strokes += partial;
    }
    coverage.held_mm = held_mm(&coverage, realization.mechanism.as_ref());
    coverage
}

/// Number of full and of partial strokes. What comes before the first turn and after the last
/// one is a stroke only if it is a full one or turns in the middle.
fn full_and_partial(recording: &Recording, [low, high]: [f64; 2]) -> [u32; 2] {
    let x_mm = &recording.x_mm;
    let strokes = strokes(recording);
    // the last sample of each stroke
    let is_last = |i: &usize| strokes.get(i + 1) != Some(&strokes[*i]);
    let ends: Vec<usize> = (0..strokes.len()).filter(is_last).collect();
    let end = |x: f64| match (x - low) / (high - low) {
        share if share <= END => -1,
        share if share >= 1.0 - END => 1,
        _ => 0,
    };
    let (mut counts, mut from) = ([0, 0], 0);
    for (stroke, to) in ends.iter().enumerate() {
        let (begin, finish) = (end(x_mm[from]), end(x_mm[*to]));
        let turns = [stroke > 0, stroke + 1 < ends.len()];
        let in_the_middle = (turns[0] && begin == 0) || (turns[1] && finish == 0);
        if begin * finish < 0 {
            counts[0] += 1;
        } else if in_the_middle || turns == [true; 2] {
            counts[1] += 1;
        }
        from = *to;
    }
    counts
}

/// Where a direction has no samples, or where the profile of a mechanism has ended.
fn held_mm(coverage: &Coverage, mechanism: Option<&Mechanism>) -> Vec<[f64; 2]> {
    let [low, high] = coverage.x_mm;
    let mut held: Vec<[f64; 2]> = coverage.gaps_mm().concat();
    if let Some(detent) = mechanism.map(|mechanism| &mechanism.detent) {
        let end_mm = detent.first_mm + detent.step_mm * (detent.n.len() - 1) as f64;
        held.extend([[low, detent.first_mm], [end_mm, high]]);
    }
    held.retain(|[from, to]| from < to);
    held.small_sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut joined: Vec<[f64; 2]> = Vec::new();
    for [from, to] in held {
        match joined.last_mut().filter(|last| last[1] >= from) {
            Some(last) => last[1] = last[1].max(to),
            None => joined.push([from, to]),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Profile;
    use study_wire::mechanism::Scalars;

    /// A motion between turning points at 1 mm a sample.
    fn through(turns: &[f64]) -> Recording {
        let mut x_mm = vec![turns[0]];
        for pair in turns.windows(2) {
            let steps = (pair[1] - pair[0]).abs() as usize;
            let way = (pair[1] - pair[0]).signum();
            x_mm.extend((1..=steps).map(|i| pair[0] + way * i as f64));
        }
        let n = x_mm.len();
        Recording {
            t_s: (0..n).map(|i| 0.01 * i as f64).collect(),
            v_mm_s: vec![100.0; n],
            a_m_s2: vec![0.0; n],
            f_n: vec![0.0; n],
            x_mm,
            header: Vec::new(),
            warnings: Vec::new(),
            name: "strokes".into(),
            sha256: String::new(),
        }
    }

    #[test]
    fn strokes_are_full_or_partial() {
        for (turns, expected) in [
            // from the middle: neither
            (&[50.0, 95.0][..], [0, 0]),
            (&[50.0, 95.0, 2.0, 90.0, 40.0], [2, 0]),
            // turns in the middle, on both sides of it
            (&[0.0, 60.0, 0.0], [0, 2]),
            (&[0.0, 100.0, 50.0, 100.0, 0.0], [2, 2]),
            // within one end
            (&[0.0, 15.0, 0.0, 15.0, 0.0, 100.0], [1, 3]),
        ] {
            let found = full_and_partial(&through(turns), [0.0, 100.0]);
            assert_eq!(found, expected, "{turns:?}");
        }
    }

    #[test]
    fn held_is_where_no_data_are_and_where_a_profile_has_ended() {
        let mut coverage = Coverage::empty([0.0, 10.0], 50.0, 10, 2);
        for place in [0, 1, 2, 3, 6, 7, 8] {
            coverage.add(f64::from(place) + 0.5, 30.0);
            coverage.add(f64::from(place) + 0.5, -30.0);
        }
        coverage.add(4.5, 30.0);
        assert_eq!(held_mm(&coverage, None), [[4.0, 6.0], [9.0, 10.0]]);
        let profile = Profile {
            first_mm: 0.5,
            step_mm: 1.0,
            n: vec![0.0; 9],
        };
        let mechanism = Mechanism {
            scalars: Scalars::default(),
            friction: profile.clone(),
            detent: profile,
            recorded_hz: None,
        };
        let held = held_mm(&coverage, Some(&mechanism));
        assert_eq!(held, [[0.0, 0.5], [4.0, 6.0], [8.5, 10.0]]);
    }
}
