//! Pre-stated rules of exclusion, `[[analysis.exclude]]`.
//!
//! Every rule judges the same rows: those that count before any rule does. So
//! the order of the rules changes nothing but which one is named of a row that
//! several would leave out: the first. Nothing is left out that no rule names.

use super::Rules;
use super::select::{Decision, Reason};
use crate::outcome::ratings::Ratings;
use crate::protocol::{ExclusionRule, Role};
use std::fmt;
use std::sync::Arc;

/// A rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exclusion {
    /// Participants with two ratings or more that never change.
    ConstantRater,
    /// Participants whose mean rating of the hidden references is under this.
    HiddenReferenceBelow(f64),
    /// Trials with fewer full strokes than this.
    StrokesBelow(f64),
    /// Participants whose cells of a realization and of its hidden repeat are
    /// further apart than this, on average over the pairs.
    Inconsistent(f64),
}

impl Exclusion {
    /// That of a protocol; `None` for a name that is not one, or a parameter that
    /// is not there, which the reader of protocols refuses.
    pub fn of(rule: &ExclusionRule) -> Option<Self> {
        let parameter = |name: &str| rule.parameters.get(name).copied();
        match rule.rule.as_str() {
            "constant-rater" => Some(Self::ConstantRater),
            "hidden-reference-below" => parameter("rating").map(Self::HiddenReferenceBelow),
            "strokes-below" => parameter("strokes").map(Self::StrokesBelow),
            "inconsistent" => parameter("difference").map(Self::Inconsistent),
            _ => None,
        }
    }

    /// Whether it judges by the primary ratings.
    fn needs_primary(self) -> bool {
        !matches!(self, Self::StrokesBelow(_))
    }
}

impl fmt::Display for Exclusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ConstantRater => f.write_str("constant-rater"),
            Self::HiddenReferenceBelow(rating) => write!(f, "hidden-reference-below {rating}"),
            Self::StrokesBelow(strokes) => write!(f, "strokes-below {strokes}"),
            Self::Inconsistent(difference) => write!(f, "inconsistent {difference}"),
        }
    }
}

/// What a rule did.
#[derive(Debug, Clone, PartialEq)]
pub struct Applied {
    /// The rule.
    pub rule: Exclusion,
    /// Rows that it left out.
    pub rows: usize,
    /// Participants with such a row.
    pub participants: usize,
    /// Why it could judge nothing, or not all.
    pub problem: Option<&'static str>,
}

/// Applies the rules to the rows that count so far.
pub(super) fn apply(ratings: &Ratings, rules: &Rules, decisions: &mut [Decision]) -> Vec<Applied> {
    let judged: Vec<Judgement> = (rules.exclude.iter())
        .map(|rule| judge(ratings, rules, *rule, decisions))
        .collect();
    let reasons: Vec<Arc<Reason>> = (rules.exclude.iter())
        .map(|rule| Arc::new(Reason::Rule(*rule)))
        .collect();
    let mut hit = vec![vec![false; ratings.subjects.len()]; rules.exclude.len()];
    let mut rows = vec![0; rules.exclude.len()];
    for (i, decision) in decisions.iter_mut().enumerate() {
        if decision.is_some() || judged.is_empty() {
            continue;
        }
        let subject = ratings.subject[i] as usize;
        let strokes = ratings.strokes[i];
        if let Some(k) = judged.iter().position(|j| j.leaves_out(subject, strokes)) {
            *decision = Some(Arc::clone(&reasons[k]));
            rows[k] += 1;
            hit[k][subject] = true;
        }
    }
    (0..judged.len())
        .map(|k| Applied {
            rule: rules.exclude[k],
            rows: rows[k],
            participants: hit[k].iter().filter(|h| **h).count(),
            problem: judged[k].problem,
        })
        .collect()
}

/// Whom or what a rule leaves out.
#[derive(Debug, Default)]
struct Judgement {
    /// By participant; empty: none.
    subjects: Vec<bool>,
    /// Rows with fewer strokes.
    strokes: Option<f64>,
    problem: Option<&'static str>,
}

impl Judgement {
    fn leaves_out(&self, subject: usize, strokes: Option<u32>) -> bool {
        self.subjects.get(subject) == Some(&true)
            || strokes
                .zip(self.strokes)
                .is_some_and(|(n, least)| f64::from(n) < least)
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

fn judge(ratings: &Ratings, rules: &Rules, rule: Exclusion, decisions: &[Decision]) -> Judgement {
    if rule.needs_primary() && !rules.primary {
        return Judgement::none("it judges by the primary question, which this is not");
    }
    let rows = (0..ratings.len()).filter(|&i| decisions[i].is_none());
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
                problem: unknown.then_some("some trials have no count of strokes and stay"),
                ..Judgement::default()
            }
        }
        Exclusion::Inconsistent(most) => {
            let pairs = pairs(ratings);
            if pairs.is_empty() {
                return Judgement::none("the design has no hidden repeat");
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

/// Each hidden repeat and its original.
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

/// Mean distance between the cells of the pairs, by participant.
pub(super) fn distances(
    ratings: &Ratings,
    pairs: &[(usize, usize)],
    rated: impl Iterator<Item = (usize, f64)>,
) -> Vec<Option<f64>> {
    let mut slot = vec![usize::MAX; ratings.models.len()];
    for (k, m) in pairs.iter().flat_map(|(d, o)| [*d, *o]).enumerate() {
        // Two repeats may share their original.
        if slot[m] == usize::MAX {
            slot[m] = k;
        }
    }
    let width = 2 * pairs.len();
    let mut cells = vec![(0.0, 0.0); width * ratings.subjects.len()];
    for (i, v) in rated {
        let k = ratings.model[i].map_or(usize::MAX, |m| slot[m as usize]);
        if k != usize::MAX {
            add(&mut cells[width * ratings.subject[i] as usize + k], v);
        }
    }
    (cells.chunks(width))
        .map(|own| {
            let mut sum = (0.0, 0.0);
            for (d, o) in pairs {
                let both = average(own[slot[*d]]).zip(average(own[slot[*o]]));
                if let Some((d, o)) = both {
                    add(&mut sum, (d - o).abs());
                }
            }
            // Thirds that agree on paper agree here.
            average(sum).map(study_stats::describe::rounded)
        })
        .collect()
}
