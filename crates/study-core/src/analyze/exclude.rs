//! Applies the preregistered exclusion rules, `[[analysis.exclude]]`.
//!
//! Every rule judges the same rows: those that count before any rule is applied.
//! The order of the rules therefore decides only which rule is reported for a row
//! that several exclude: the first.

use super::Rules;
use crate::outcome::Verdict;
use crate::outcome::ratings::Ratings;
use crate::protocol::{Exclusion, Role};
use std::collections::{BTreeSet, HashMap};

/// Why a rule about the force leaves some trials.
pub(super) const UNJUDGED: &str = "the force of some trials was not judged; these trials stay";

/// Whether the rule `wrong-force` excludes a trial.
pub(super) fn is_wrong(verdict: Verdict) -> bool {
    matches!(verdict, Verdict::Flag | Verdict::Fault)
}

/// Whether the rule `unverified-force` excludes a trial.
pub(super) fn is_unverified(verdict: Verdict) -> bool {
    verdict != Verdict::Ok
}

/// The effect of a rule.
#[derive(Debug, Clone, PartialEq)]
pub struct Applied {
    /// The rule.
    pub rule: Exclusion,
    /// Rows that it excluded.
    pub rows: usize,
    /// Participants with such a row.
    pub participants: usize,
    /// Why it could judge no rows, or not all.
    pub problem: Option<&'static str>,
}

/// Applies the rules to the rows that count so far, `counts`. Returns the index of
/// the first rule that excludes each row, and the effect of each rule.
pub(super) fn apply(
    ratings: &Ratings,
    rules: &Rules,
    counts: &[bool],
) -> (Vec<Option<usize>>, Vec<Applied>) {
    let judged: Vec<Judgement> = (rules.exclude.iter())
        .map(|rule| judge(ratings, rules, *rule, counts))
        .collect();
    let excluded_by: Vec<Option<usize>> = (counts.iter().enumerate())
        .map(|(i, counts)| {
            let excludes = |j: &Judgement| j.excludes(ratings, i);
            judged.iter().position(excludes).filter(|_| *counts)
        })
        .collect();
    let applied = (judged.iter().enumerate())
        .map(|(k, judgement)| {
            let rows = (0..excluded_by.len()).filter(|&i| excluded_by[i] == Some(k));
            let participants: BTreeSet<u32> = rows.clone().map(|i| ratings.subject[i]).collect();
            Applied {
                rule: rules.exclude[k],
                rows: rows.count(),
                participants: participants.len(),
                problem: judgement.problem,
            }
        })
        .collect();
    (excluded_by, applied)
}

/// Which rows a rule excludes.
#[derive(Debug, Default)]
struct Judgement {
    /// Whether a participant is excluded; empty if none is.
    subjects: Vec<bool>,
    /// Rows with fewer strokes are excluded.
    strokes: Option<f64>,
    /// Rows whose force was judged so are excluded.
    force: Option<fn(Verdict) -> bool>,
    problem: Option<&'static str>,
}

impl Judgement {
    fn excludes(&self, ratings: &Ratings, row: usize) -> bool {
        let subject = ratings.subject[row] as usize;
        let few =
            (ratings.strokes[row].zip(self.strokes)).is_some_and(|(n, least)| f64::from(n) < least);
        let wrong = (ratings.felt(row).zip(self.force))
            .is_some_and(|(felt, excluded)| excluded(felt.verdict));
        self.subjects.get(subject) == Some(&true) || few || wrong
    }

    fn of(subjects: Vec<bool>) -> Self {
        Self {
            subjects,
            ..Self::default()
        }
    }

    fn none(problem: &'static str) -> Self {
        Self {
            problem: Some(problem),
            ..Self::default()
        }
    }
}

/// What one rule excludes of the rows in `counts`: participants ([`Judgement::of`]) or
/// single rows (a field of [`Judgement`]).
fn judge(ratings: &Ratings, rules: &Rules, rule: Exclusion, counts: &[bool]) -> Judgement {
    let of_trials = matches!(
        rule,
        Exclusion::StrokesBelow(_) | Exclusion::WrongForce | Exclusion::UnverifiedForce
    );
    if !of_trials && !rules.primary {
        return Judgement::none("it applies to the primary question, which this is not");
    }
    let rows = (0..ratings.len()).filter(|&i| counts[i]);
    let rated = (rows.clone()).filter_map(|i| Some((i, ratings.rating[i]?)));
    match rule {
        Exclusion::ConstantRater => {
            // Number of ratings, smallest, largest.
            let none = (0u32, f64::INFINITY, f64::NEG_INFINITY);
            let mut seen = vec![none; ratings.subjects.len()];
            for (i, v) in rated {
                let s = &mut seen[ratings.subject[i] as usize];
                *s = (s.0 + 1, s.1.min(v), s.2.max(v));
            }
            let constant = |(n, low, high): &(u32, f64, f64)| *n > 1 && low == high;
            Judgement::of(seen.iter().map(constant).collect())
        }
        Exclusion::HiddenReferenceBelow(least) => {
            let is_reference = |m: u32| ratings.models[m as usize].role == Role::HiddenReference;
            if !(ratings.models.iter()).any(|m| m.role == Role::HiddenReference) {
                return Judgement::none("the design has no hidden reference");
            }
            let mut sums = vec![(0.0, 0.0); ratings.subjects.len()];
            for (i, v) in rated.filter(|(i, _)| ratings.model[*i].is_some_and(is_reference)) {
                add(&mut sums[ratings.subject[i] as usize], v);
            }
            let below = |s: &(f64, f64)| average(*s).is_some_and(|mean| mean < least);
            Judgement::of(sums.iter().map(below).collect())
        }
        Exclusion::StrokesBelow(least) => {
            let unknown = rows.clone().any(|i| ratings.strokes[i].is_none());
            Judgement {
                strokes: Some(least),
                problem: unknown
                    .then_some("the strokes of some trials are unknown; these trials stay"),
                ..Judgement::default()
            }
        }
        Exclusion::WrongForce | Exclusion::UnverifiedForce => {
            let unknown = rows.clone().any(|i| ratings.felt(i).is_none());
            Judgement {
                force: Some(match rule {
                    Exclusion::WrongForce => is_wrong,
                    _ => is_unverified,
                }),
                problem: unknown.then_some(UNJUDGED),
                ..Judgement::default()
            }
        }
        Exclusion::Inconsistent(most) => {
            let pairs = pairs(ratings);
            if pairs.is_empty() {
                return Judgement::none("the design has no hidden duplicate");
            }
            let distances = distances(ratings, &pairs, rated);
            let far = |d: &Option<f64>| d.is_some_and(|d| d > most);
            Judgement::of(distances.iter().map(far).collect())
        }
    }
}

fn add(sum: &mut (f64, f64), x: f64) {
    sum.0 += x;
    sum.1 += 1.0;
}

fn average((sum, n): (f64, f64)) -> Option<f64> {
    (n > 0.0).then(|| sum / n)
}

/// Indices of each hidden duplicate and its original.
pub(super) fn pairs(ratings: &Ratings) -> Vec<(usize, usize)> {
    let models = &ratings.models;
    (models.iter().enumerate())
        .filter_map(|(d, model)| {
            let original = model.duplicate_of.as_ref()?;
            let o = models.binary_search_by(|m| m.id.cmp(original)).ok()?;
            Some((d, o))
        })
        .collect()
}

/// Mean distance between the cell means of the pairs, by participant; `None` without
/// such cells.
pub(super) fn distances(
    ratings: &Ratings,
    pairs: &[(usize, usize)],
    rated: impl Iterator<Item = (usize, f64)>,
) -> Vec<Option<f64>> {
    // Two duplicates may share their original.
    let paired: BTreeSet<usize> = pairs.iter().flat_map(|(d, o)| [*d, *o]).collect();
    let columns: HashMap<usize, usize> = paired.into_iter().zip(0..).collect();
    let width = columns.len();
    let mut cells = vec![(0.0, 0.0); width * ratings.subjects.len()];
    for (i, rating) in rated {
        let column = ratings.model[i].and_then(|m| columns.get(&(m as usize)));
        if let Some(column) = column {
            add(
                &mut cells[width * ratings.subject[i] as usize + column],
                rating,
            );
        }
    }
    (cells.chunks(width))
        .map(|own| {
            let mean = |model| average(own[columns[model]]);
            let mut sum = (0.0, 0.0);
            for (duplicate, original) in pairs {
                if let Some((d, o)) = mean(duplicate).zip(mean(original)) {
                    add(&mut sum, (d - o).abs());
                }
            }
            // Removes rounding errors, so that distances that are equal compare equal.
            average(sum).map(study_stats::describe::rounded)
        })
        .collect()
}
