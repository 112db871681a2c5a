//! Ratings to an analysis: numbers and warnings. Pure.
//!
//! [`analyze`] decides which rows count, computes every statistic that they
//! allow, and says of each other one why it is not defined. A statistic has the
//! identifier that `docs/statistics.md` gives it (`corr/pearson/r`); the report
//! reads the values by it, and `--json` prints them as they are.
//!
//! The level of inference: VAF varies only between realizations, so "VAF
//! predicts the rating" is tested over the means of the realizations, however
//! many subjects rated. What is tested over subjects holds for these
//! realizations only.

mod cells;
mod describe;
mod deviation;
mod draws;
mod effects;
mod exclude;
mod headline;
mod memory;
mod mixed;
mod order;
mod ordinal;
mod overflow;
mod reference;
mod select;
mod subjects;
mod vaf;
mod values;
mod warnings;

pub use crate::protocol::Exclusion;
pub use deviation::{Deviation, PreregisteredRule, deviations};
pub use exclude::Applied;
pub use select::{Counts, Include, Reason};
pub use values::{Value, Values};
pub use warnings::Warning;

use crate::outcome::ratings::{Practice, Ratings};
use crate::protocol::{Protocol, Role, Unfinished};
use cells::Cells;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What was decided before the data.
#[derive(Debug, Clone, PartialEq)]
pub struct Rules {
    /// Planned participants; below them the analysis is interim.
    pub planned: Option<u32>,
    /// Ratings from here up count as realistic.
    pub realistic_from: Option<f64>,
    /// Ends of the rating scale.
    pub scale: Option<(f64, f64)>,
    /// Whether unfinished sessions count.
    pub unfinished: Unfinished,
    /// Which rows count beside those of participants.
    pub include: Include,
    /// Of Monte Carlo, where there are too many permutations to visit.
    pub seed: u64,
    /// Whether the ratings answer the primary question.
    pub primary: bool,
    /// The pre-stated rules of exclusion.
    pub exclude: Vec<Exclusion>,
    /// Differences from a hidden reference below this count as none.
    pub equivalence_margin: Option<f64>,
    /// What was changed of these rules after the study began, in words.
    pub deviations: Vec<Deviation>,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            planned: None,
            realistic_from: None,
            scale: None,
            unfinished: Unfinished::Include,
            include: Include::default(),
            seed: 2007,
            primary: true,
            exclude: Vec::new(),
            equivalence_margin: None,
            deviations: Vec::new(),
        }
    }
}

impl Rules {
    /// Those of a protocol. `realistic_from` and the margin of equivalence belong
    /// to the primary question; for another `question` there are none.
    pub fn of(protocol: &Protocol, question: &str, include: Include) -> Self {
        use crate::protocol::QuestionKind;
        let primary = protocol.analysis.primary.as_str() == question;
        let asked = protocol
            .questions
            .iter()
            .find(|q| q.id.as_str() == question);
        Self {
            planned: Some(protocol.design.participants),
            realistic_from: protocol.analysis.realistic_from.filter(|_| primary),
            scale: asked.and_then(|q| match &q.kind {
                QuestionKind::Rating { from, to, .. } => Some((*from as f64, *to as f64)),
                QuestionKind::Slider { from, to, .. } => Some((*from, *to)),
                QuestionKind::Choice { .. } | QuestionKind::Number { .. } | QuestionKind::Text => {
                    None
                }
            }),
            unfinished: protocol.analysis.unfinished,
            include,
            seed: protocol.study.seed,
            primary,
            exclude: protocol.analysis.exclude.clone(),
            equivalence_margin: protocol.analysis.equivalence_margin.filter(|_| primary),
            deviations: Vec::new(),
        }
    }
}

/// A comment with its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Said {
    /// Realization. Untrusted.
    pub model: String,
    /// Subject. Untrusted.
    pub subject: String,
    /// The how-maniest time.
    pub repetition: u32,
    /// Question, or `remarks`.
    pub question: String,
    /// As typed. Untrusted.
    pub text: String,
}

/// A realization, as the tables name it.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed {
    /// Name; the M of the identifiers. Untrusted.
    pub id: String,
    /// Role.
    pub role: Role,
    /// The realization that it repeats.
    pub duplicate_of: Option<String>,
    /// Its VAF, if all of its rows agree on one.
    pub vaf: Option<f64>,
}

/// A row with the decision about it; [`Analysis::subject`] and [`Analysis::model`]
/// tell its names. There can be millions: no more is kept than has to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    subject: u32,
    model: Option<u32>,
    /// Repetition number, from 1.
    pub repetition: u32,
    /// Position in the subject's order, from 1, if it is known.
    pub trial_index: Option<u32>,
    /// The rating, if there is one.
    pub rating: Option<f64>,
    /// The VAF, if there is one.
    pub vaf: Option<f64>,
    /// Why it does not count; `None`: it does.
    pub excluded: Option<Arc<Reason>>,
}

/// Everything that was computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// The question whose answers were analysed.
    pub question: String,
    /// Statistic by identifier.
    pub values: Values,
    /// What a reader has to know.
    pub warnings: Vec<Warning>,
    /// Realizations, sorted by name.
    pub realizations: Vec<Listed>,
    /// What was counted, left out, corrected.
    pub counts: Counts,
    /// Every row with the decision about it.
    pub rows: Vec<Judged>,
    /// Practice rows, about which nothing is to be decided.
    pub practice: Arc<Practice>,
    /// Names of the subjects and realizations of the rows.
    subjects: Vec<String>,
    models: Vec<String>,
    /// What each pre-stated rule of exclusion did, in the protocol's order.
    pub exclusions: Vec<Applied>,
    /// What was changed of the rules after the study began, in words.
    pub deviations: Vec<Deviation>,
    /// Comments of the rows that count, by realization.
    pub comments: Vec<Said>,
    /// The threshold of "realistic".
    pub realistic_from: Option<f64>,
    /// Ends of the rating scale.
    pub scale: Option<(f64, f64)>,
}

impl Analysis {
    /// Whose row it is. Untrusted.
    pub fn subject(&self, row: &Judged) -> &str {
        self.subjects
            .get(row.subject as usize)
            .map_or("", String::as_str)
    }

    /// Whether a rule was changed after the study began: what was, is not called
    /// stated beforehand.
    pub fn changed(&self, rule: PreregisteredRule) -> bool {
        self.deviations.iter().any(|d| d.affects.contains(&rule))
    }

    /// The row's realization, empty if there is none. Untrusted.
    pub fn model(&self, row: &Judged) -> &str {
        row.model.map_or("", |m| &self.models[m as usize])
    }
}

/// How far an analysis is, for who watches it from another thread.
#[derive(Debug, Default)]
pub struct Progress {
    /// Groups of statistics to be made: a second round of them may follow.
    pub groups: AtomicU64,
    /// Of these, made.
    pub made: AtomicU64,
}

/// Analyses ratings under rules.
pub fn analyze(ratings: &Ratings, rules: &Rules) -> Analysis {
    analyze_watched(ratings, rules, &Progress::default())
}

/// The same; `progress` tells how far it is.
pub fn analyze_watched(ratings: &Ratings, rules: &Rules, progress: &Progress) -> Analysis {
    let (decisions, exclusions) = select::decide(ratings, rules);
    let used = rows(ratings, |i| decisions[i].is_none());
    let (cells, rows_judged) = rayon::join(|| Cells::of(&used), || judged(ratings, &decisions));
    let (mut values, counts) = rayon::join(
        || statistics(&cells, rules, progress),
        || Counts::of(ratings, &used, &decisions, rules),
    );
    if let Some(smaller) = overflow::smaller(&used) {
        overflow::explain(
            &mut values,
            &statistics(&Cells::of(&smaller), rules, progress),
        );
    }
    if exclusions.iter().any(|e| e.rows > 0) {
        let all = rows(ratings, |i| {
            let reason = decisions[i].as_deref();
            matches!(reason, None | Some(Reason::Rule(_)))
        });
        headline::without_exclusions(&statistics(&Cells::of(&all), rules, progress), &mut values);
    }
    let warnings = warnings::warnings(&cells, &counts, rules, &exclusions, &values);
    Analysis {
        question: ratings.question.clone(),
        realizations: used
            .models
            .iter()
            .zip(&cells.vaf)
            .map(|(m, vaf)| Listed {
                id: m.id.clone(),
                role: m.role,
                duplicate_of: m.duplicate_of.clone(),
                vaf: *vaf,
            })
            .collect(),
        rows: rows_judged,
        practice: Arc::clone(&ratings.practice),
        subjects: ratings.subjects.iter().map(|s| s.id.clone()).collect(),
        models: ratings.models.iter().map(|m| m.id.clone()).collect(),
        exclusions,
        deviations: rules.deviations.clone(),
        comments: comments(&used),
        realistic_from: rules.realistic_from,
        scale: rules.scale,
        values,
        warnings,
        counts,
    }
}

/// Some of the rows; all of them are not copied.
fn rows(ratings: &Ratings, keep: impl Fn(usize) -> bool) -> Cow<'_, Ratings> {
    if (0..ratings.len()).all(&keep) {
        Cow::Borrowed(ratings)
    } else {
        Cow::Owned(ratings.keep(keep))
    }
}

/// Writes a group of statistics.
type Group = fn(&Cells<'_>, &Rules, &mut Values);

/// Groups that need nothing of each other; those that take long for large tables first.
const GROUPS: [Group; 10] = [
    order::order,
    vaf::against_vaf,
    |cells, _, values| ordinal::ordinal(cells, values),
    effects::ranks_and_anova,
    effects::agree,
    |cells, _, values| mixed::mixed(cells, values),
    describe::describe,
    subjects::subjects,
    effects::pairs,
    reference::reference,
];

/// Every statistic. Groups are computed side by side, in the order of the list;
/// each by itself, so that the number of threads changes no bit.
fn statistics(cells: &Cells<'_>, rules: &Rules, progress: &Progress) -> Values {
    progress
        .groups
        .fetch_add(GROUPS.len() as u64, Ordering::Relaxed);
    let mut parts: Vec<(usize, Values)> = (GROUPS.iter().enumerate())
        .par_bridge()
        .map(|(place, group)| {
            let mut values = Values::default();
            group(cells, rules, &mut values);
            progress.made.fetch_add(1, Ordering::Relaxed);
            (place, values)
        })
        .collect();
    parts.sort_by_key(|(place, _)| *place);
    let mut values = Values::default();
    for (_, part) in parts {
        values.take(part);
    }
    memory::memory(cells, rules, &mut values);
    headline::headline(cells, rules, &mut values);
    values
}

fn judged(ratings: &Ratings, decisions: &[select::Decision]) -> Vec<Judged> {
    (decisions.iter().cloned().enumerate())
        .map(|(i, excluded)| Judged {
            subject: ratings.subject[i],
            model: ratings.model[i],
            repetition: ratings.repetition[i],
            trial_index: ratings.trial_index[i],
            rating: ratings.rating[i],
            vaf: ratings.vaf[i],
            excluded,
        })
        .collect()
}

fn model_name(ratings: &Ratings, row: usize) -> String {
    ratings.model[row].map_or_else(String::new, |m| ratings.models[m as usize].id.clone())
}

fn comments(used: &Ratings) -> Vec<Said> {
    let mut said: Vec<Said> = used
        .comments
        .iter()
        .map(|c| Said {
            model: model_name(used, c.row),
            subject: used.subjects[used.subject[c.row] as usize].id.clone(),
            repetition: used.repetition[c.row],
            question: c.question.clone(),
            text: c.text.clone(),
        })
        .collect();
    said.sort_by(|a, b| {
        (&a.model, &a.subject, a.repetition).cmp(&(&b.model, &b.subject, b.repetition))
    });
    said
}
