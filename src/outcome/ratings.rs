//! Ratings by column, for analysis.
//!
//! One row per presentation that counts. Subjects and realizations are sorted as
//! strings (C locale) and named by their index; a missing number is NaN inside a
//! column and never leaves this crate as a number. Practice rows are counted and
//! left out at the door. What was excluded, and why, is decided in `analyze`.

mod read;

pub use read::RatingsError;

use super::columns::{ParticipantRow, RatingRow, Status};
use super::event::State;
use crate::protocol::{Answer, Role};
use crate::text::QuestionId;
use std::collections::{BTreeMap, BTreeSet};

/// The index of a row without a realization, as some foreign data have it.
pub const NO_MODEL: u32 = u32::MAX;

/// A realization as the ratings know it.
#[derive(Debug, Clone, PartialEq)]
pub struct Realization {
    /// Its name. Untrusted: a foreign file may say anything.
    pub id: String,
    /// What it is in the study.
    pub role: Role,
    /// The realization that it repeats in secret.
    pub duplicate_of: Option<String>,
    /// Numbers that may explain the ratings.
    pub covariates: BTreeMap<String, f64>,
}

/// Who a row is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Origin {
    /// A participant.
    Real,
    /// Somebody who tried the study out.
    Pilot,
    /// Nobody.
    Simulated,
}

/// A subject as the ratings know it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Subject {
    /// The name. Untrusted.
    pub id: String,
    /// The state, where the study keeps one.
    pub state: Option<State>,
    /// Why, where somebody set it.
    pub reason: String,
}

/// A text that was answered in a trial.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Comment {
    /// Row of the ratings.
    pub row: usize,
    /// Question, or `remarks`.
    pub question: String,
    /// As typed. Untrusted.
    pub text: String,
}

/// Ratings by column. All columns are equally long.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ratings {
    /// The question whose answers these are.
    pub question: String,
    /// Sorted by name.
    pub subjects: Vec<Subject>,
    /// Sorted by name.
    pub models: Vec<Realization>,
    /// Index into `subjects`.
    pub subject: Vec<u32>,
    /// Index into `models`, or [`NO_MODEL`].
    pub model: Vec<u32>,
    /// The how-maniest time, from 1; 0 if it is not known.
    pub repetition: Vec<u32>,
    /// NaN: none.
    pub rating: Vec<f64>,
    /// NaN: none.
    pub vaf: Vec<f64>,
    /// Place in the subject's order, from 1; 0 if it is not known.
    pub trial_index: Vec<u32>,
    /// Who the row is from.
    pub origin: Vec<Origin>,
    /// What became of the trial.
    pub status: Vec<Status>,
    /// Whether an answer was corrected.
    pub corrected: Vec<bool>,
    /// The attempt that counts; above 1 the trial was repeated, 0 not known.
    pub attempt: Vec<u32>,
    /// Row of the source, from 1 (the line of a file, header not counted).
    pub source_row: Vec<u32>,
    /// Texts answered or remarked in trials.
    pub comments: Vec<Comment>,
    /// Practice rows that were left out.
    pub practice: usize,
}

/// One row before names are indices.
#[derive(Debug, Clone)]
struct Row {
    subject: String,
    model: Option<String>,
    role: Role,
    repetition: u32,
    rating: f64,
    vaf: f64,
    trial_index: u32,
    origin: Origin,
    status: Status,
    corrected: bool,
    attempt: u32,
    source_row: u32,
    covariates: BTreeMap<String, f64>,
    comments: Vec<(String, String)>,
}

impl Ratings {
    /// From the rows of a study, for one question.
    pub fn from_rows(rows: &[RatingRow], question: &QuestionId) -> Self {
        let practice = rows.iter().filter(|r| r.practice).count();
        let counted = rows.iter().enumerate().filter(|(_, r)| !r.practice);
        let plain = counted.map(|(i, r)| Row {
            subject: r.participant.to_string(),
            model: Some(r.model.to_string()),
            role: r.role,
            repetition: r.repetition,
            rating: rated(r, question),
            vaf: r.vaf.filter(|v| v.is_finite()).unwrap_or(f64::NAN),
            trial_index: r.position.unwrap_or(0),
            origin: match (r.simulated, r.pilot) {
                (true, _) => Origin::Simulated,
                (false, true) => Origin::Pilot,
                (false, false) => Origin::Real,
            },
            status: r.status,
            corrected: r.corrected,
            attempt: r.attempt.unwrap_or(0),
            source_row: u32::try_from(i + 1).unwrap_or(u32::MAX),
            covariates: r.covariates.clone(),
            comments: comments(r),
        });
        Self::build(question.to_string(), plain.collect(), practice)
    }

    /// Marks hidden repeats: (repeat, original) each.
    pub fn set_duplicates<'a>(&mut self, pairs: impl IntoIterator<Item = (&'a str, &'a str)>) {
        for (repeat, original) in pairs {
            if let Some(model) = self.models.iter_mut().find(|m| m.id == repeat) {
                model.duplicate_of = Some(original.to_owned());
            }
        }
    }

    /// Tells the states of participants, as the study's table has them.
    pub fn set_states(&mut self, participants: &[ParticipantRow]) {
        for p in participants {
            let id = p.participant.as_str();
            if let Ok(i) = self.subjects.binary_search_by(|s| s.id.as_str().cmp(id)) {
                self.subjects[i].state = Some(p.state);
                self.subjects[i].reason.clone_from(&p.reason);
            }
        }
    }

    /// How many rows.
    pub fn len(&self) -> usize {
        self.rating.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rating.is_empty()
    }

    /// The same with only some of the rows. Subjects and realizations without a
    /// row are gone too.
    #[must_use]
    pub fn keep(&self, keep: impl Fn(usize) -> bool) -> Self {
        let rows: Vec<usize> = (0..self.len()).filter(|&i| keep(i)).collect();
        let (subject_map, subjects) = remap(&self.subjects, rows.iter().map(|&i| self.subject[i]));
        let (model_map, models) = remap(
            &self.models,
            rows.iter()
                .map(|&i| self.model[i])
                .filter(|&m| m != NO_MODEL),
        );
        let mut place = vec![usize::MAX; self.len()];
        for (new, &old) in rows.iter().enumerate() {
            place[old] = new;
        }
        fn pick<T: Copy>(rows: &[usize], column: &[T]) -> Vec<T> {
            rows.iter().map(|&i| column[i]).collect()
        }
        Self {
            question: self.question.clone(),
            subject: rows
                .iter()
                .map(|&i| subject_map[self.subject[i] as usize])
                .collect(),
            model: rows
                .iter()
                .map(|&i| match self.model[i] {
                    NO_MODEL => NO_MODEL,
                    m => model_map[m as usize],
                })
                .collect(),
            repetition: pick(&rows, &self.repetition),
            rating: pick(&rows, &self.rating),
            vaf: pick(&rows, &self.vaf),
            trial_index: pick(&rows, &self.trial_index),
            origin: pick(&rows, &self.origin),
            status: pick(&rows, &self.status),
            corrected: pick(&rows, &self.corrected),
            attempt: pick(&rows, &self.attempt),
            source_row: pick(&rows, &self.source_row),
            comments: self
                .comments
                .iter()
                .filter(|c| place[c.row] != usize::MAX)
                .map(|c| Comment {
                    row: place[c.row],
                    ..c.clone()
                })
                .collect(),
            practice: self.practice,
            subjects,
            models,
        }
    }

    fn build(question: String, rows: Vec<Row>, practice: usize) -> Self {
        let subjects: BTreeSet<&str> = rows.iter().map(|r| r.subject.as_str()).collect();
        let subjects: Vec<Subject> = subjects
            .into_iter()
            .map(|id| Subject {
                id: id.to_owned(),
                state: None,
                reason: String::new(),
            })
            .collect();
        let mut models: BTreeMap<&str, Realization> = BTreeMap::new();
        for row in &rows {
            if let Some(id) = &row.model {
                models.entry(id).or_insert_with(|| Realization {
                    id: id.clone(),
                    role: row.role,
                    duplicate_of: None,
                    covariates: row.covariates.clone(),
                });
            }
        }
        let models: Vec<Realization> = models.into_values().collect();
        let mut ratings = Self {
            question,
            practice,
            ..Self::default()
        };
        let index = |i: usize| u32::try_from(i).unwrap_or(NO_MODEL - 1);
        for (at, row) in rows.into_iter().enumerate() {
            let subject = subjects.partition_point(|s| s.id < row.subject);
            ratings.subject.push(index(subject));
            ratings.model.push(
                row.model
                    .map_or(NO_MODEL, |id| index(models.partition_point(|m| m.id < id))),
            );
            ratings.repetition.push(row.repetition);
            ratings.rating.push(row.rating);
            ratings.vaf.push(row.vaf);
            ratings.trial_index.push(row.trial_index);
            ratings.origin.push(row.origin);
            ratings.status.push(row.status);
            ratings.corrected.push(row.corrected);
            ratings.attempt.push(row.attempt);
            ratings.source_row.push(row.source_row);
            ratings
                .comments
                .extend(row.comments.into_iter().map(|(question, text)| Comment {
                    row: at,
                    question,
                    text,
                }));
        }
        ratings.subjects = subjects;
        ratings.models = models;
        ratings
    }
}

/// The rating of a row, if the trial counts and it is a finite number.
fn rated(row: &RatingRow, question: &QuestionId) -> f64 {
    let answer = row.answers.get(question).and_then(Answer::number);
    match row.status {
        Status::Failed => f64::NAN,
        Status::Ok | Status::Declined | Status::Missing => {
            answer.filter(|v| v.is_finite()).unwrap_or(f64::NAN)
        }
    }
}

fn comments(row: &RatingRow) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = row
        .answers
        .iter()
        .filter_map(|(q, a)| match a {
            Answer::Text(text) if !text.trim().is_empty() => Some((q.to_string(), text.clone())),
            _ => None,
        })
        .collect();
    if !row.remarks.trim().is_empty() {
        found.push(("remarks".to_owned(), row.remarks.clone()));
    }
    found
}

/// Keeps the named items that are used; also tells where each of the old went.
fn remap<T: Clone>(items: &[T], used: impl Iterator<Item = u32>) -> (Vec<u32>, Vec<T>) {
    let used: BTreeSet<u32> = used.collect();
    let mut map = vec![NO_MODEL; items.len()];
    let mut kept = Vec::with_capacity(used.len());
    for (new, old) in (0u32..).zip(&used) {
        map[*old as usize] = new;
        kept.push(items[*old as usize].clone());
    }
    (map, kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Ratings {
        let csv = "subject,model,repetition,rating,vaf\n\
                   S2,B,1,3,0.9\nS1,A,1,4,0.8\nS1,B,1,,0.9\nS2,A,1,5,0.8\n";
        Ratings::read_csv("t.csv", csv.as_bytes(), None).unwrap()
    }

    #[test]
    fn names_are_sorted_and_rows_keep_their_order() {
        let r = small();
        let subjects: Vec<&str> = r.subjects.iter().map(|s| s.id.as_str()).collect();
        assert_eq!(subjects, ["S1", "S2"]);
        assert_eq!(r.subject, [1, 0, 0, 1]);
        assert_eq!(r.model, [1, 0, 1, 0]);
        assert!(r.rating[2].is_nan());
    }

    #[test]
    fn keeping_rows_forgets_who_is_gone() {
        let r = small();
        let kept = r.keep(|i| r.subject[i] == 1);
        assert_eq!(kept.subjects.len(), 1);
        assert_eq!(kept.subjects[0].id, "S2");
        assert_eq!(kept.subject, [0, 0]);
        assert_eq!(kept.rating, [3.0, 5.0]);
    }
}
