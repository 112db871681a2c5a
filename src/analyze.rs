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
mod effects;
mod mixed;
mod order;
mod ordinal;
mod select;
mod vaf;
mod values;
mod warnings;

pub use select::{Counts, Include, Reason};
pub use values::{Value, Values};
pub use warnings::Warning;

use crate::outcome::ratings::Ratings;
use crate::protocol::{Protocol, Role, Unfinished};
use cells::Cells;

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
    /// Names of the pre-stated rules of exclusion.
    pub exclusion_rules: Vec<String>,
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
            exclusion_rules: Vec::new(),
        }
    }
}

impl Rules {
    /// Those of a protocol. The threshold of `realistic_from` and the scale
    /// belong to the primary question; for another `question` there are none.
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
            exclusion_rules: protocol
                .analysis
                .exclude
                .iter()
                .map(|e| e.rule.clone())
                .collect(),
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

/// A row with the decision about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// Subject. Untrusted.
    pub subject: String,
    /// Realization, empty if there is none. Untrusted.
    pub model: String,
    /// The how-maniest time; 0 unknown.
    pub repetition: u32,
    /// The rating, if there is one.
    pub rating: Option<f64>,
    /// The VAF, if there is one.
    pub vaf: Option<f64>,
    /// Why it does not count; `None`: it does.
    pub excluded: Option<Reason>,
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
    /// Comments of the rows that count, by realization.
    pub comments: Vec<Said>,
    /// The threshold of "realistic".
    pub realistic_from: Option<f64>,
    /// Ends of the rating scale.
    pub scale: Option<(f64, f64)>,
}

/// Analyses ratings under rules.
pub fn analyze(ratings: &Ratings, rules: &Rules) -> Analysis {
    let decisions = select::decide(ratings, rules);
    let used = ratings.keep(|i| decisions[i].is_none());
    let cells = Cells::of(&used);
    let mut values = Values::default();
    describe::describe(&cells, rules, &mut values);
    effects::effects(&cells, &mut values);
    vaf::against_vaf(&cells, rules, &mut values);
    order::order(&cells, &mut values);
    mixed::mixed(&cells, &mut values);
    ordinal::ordinal(&cells, &mut values);
    let counts = Counts::of(ratings, &used, &decisions, rules);
    let warnings = warnings::warnings(&cells, &counts, rules, &values);
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
        rows: (0..ratings.len())
            .map(|i| Judged {
                subject: ratings.subjects[ratings.subject[i] as usize].id.clone(),
                model: model_name(ratings, i),
                repetition: ratings.repetition[i],
                rating: Some(ratings.rating[i]).filter(|v| v.is_finite()),
                vaf: Some(ratings.vaf[i]).filter(|v| v.is_finite()),
                excluded: decisions[i].clone(),
            })
            .collect(),
        comments: comments(&used),
        realistic_from: rules.realistic_from,
        scale: rules.scale,
        values,
        warnings,
        counts,
    }
}

fn model_name(ratings: &Ratings, row: usize) -> String {
    ratings
        .models
        .get(ratings.model[row] as usize)
        .map_or_else(String::new, |m| m.id.clone())
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
