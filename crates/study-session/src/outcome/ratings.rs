//! Ratings by column, for analysis.
//!
//! One row for each presentation that counts. Subjects and realizations are sorted
//! by their bytes (C locale) and referred to by index. What is not known is `None`,
//! and every number is finite. Practice rows are kept apart. Which rows are
//! excluded, and why, is decided in `analyze`.

mod build;
mod columns;
mod error;
mod line;
mod measured;
mod pooled;
mod read;

pub use columns::{Ratings, Row};
pub use error::RatingsError;
pub use measured::{Measured, Motions};

use super::event::{Failure, State};
use super::fidelity::{Fidelity, Verdict};
use super::rows::{AttemptEvent, AttemptRow, ParticipantRow, RatingRow, Status};
use build::Builder;
use std::collections::BTreeMap;
use std::sync::Arc;
use study_base::text::{ParticipantId, QuestionId};
use study_plan::protocol::{Answer, Role};

/// A realization that was rated.
#[derive(Debug, Clone, PartialEq)]
pub struct Realization {
    /// Its name. Untrusted: a foreign file may hold any text.
    pub id: String,
    /// Its role in the study.
    pub role: Role,
    /// The realization of which it is a hidden duplicate.
    pub duplicate_of: Option<String>,
    /// Covariates by name; with telemetry also `least_energy_j`, J, the mean over its
    /// playbacks.
    pub covariates: BTreeMap<String, f64>,
}

impl Realization {
    /// Whether it takes part in the tests: role `test` and no hidden duplicate.
    pub fn is_tested(&self) -> bool {
        self.role == Role::Test && self.duplicate_of.is_none()
    }
}

/// The kind of participant that a row is from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Origin {
    /// A real participant.
    #[default]
    Real,
    /// A pilot participant.
    Pilot,
    /// A simulated participant.
    Simulated,
}

impl Origin {
    /// From the columns of a row.
    pub fn of(simulated: bool, pilot: bool) -> Self {
        match (simulated, pilot) {
            (true, _) => Self::Simulated,
            (false, true) => Self::Pilot,
            (false, false) => Self::Real,
        }
    }
}

/// A subject: a participant of the study or of a foreign table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Subject {
    /// Pseudonym. Untrusted.
    pub id: String,
    /// The participant's state; `None` for a foreign table.
    pub state: Option<State>,
    /// Why the state was set; may be empty.
    pub reason: String,
    /// Index into [`Ratings::sites`], in a study of several sites.
    pub site: Option<u32>,
    /// The participant's group, in a study with groups.
    pub group: Option<String>,
}

/// A text that was answered or remarked in a trial.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Comment {
    /// Index of the row.
    pub row: usize,
    /// Question, or `remarks`.
    pub question: String,
    /// As typed. Untrusted.
    pub text: String,
}

/// What was felt in a trial, compared with the table of its realization.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Felt {
    /// Whether the force was that of the table.
    pub verdict: Verdict,
    /// VAF of the commanded force.
    pub rendered_vaf: Option<f64>,
    /// Slope of the commanded force.
    pub gain: Option<f64>,
    /// VAF of what was delivered, for the validation recording.
    pub delivered_vaf: Option<f64>,
    /// Share of the time in which the force was judged.
    pub judged_share: Option<f64>,
    /// Largest difference from the right force that lasted 20 ms, in just noticeable differences.
    pub error_jnd: Option<f64>,
    /// Attempts at the trial that failed because of the force; 0 where the table of
    /// attempts was not read.
    pub failed: u32,
}

impl Felt {
    fn of(fidelity: &Fidelity) -> Self {
        let finite = |x: Option<f64>| x.filter(|x| x.is_finite());
        Self {
            verdict: fidelity.verdict,
            rendered_vaf: finite(fidelity.rendered_vaf),
            gain: finite(fidelity.rendered_gain),
            delivered_vaf: finite(fidelity.delivered_vaf),
            judged_share: finite(fidelity.judged_share),
            error_jnd: finite(fidelity.error_jnd),
            failed: 0,
        }
    }
}

/// Practice rows, with their own list of names: a participant who only practiced is
/// not among the subjects.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Practice {
    names: Vec<String>,
    rows: Vec<IndexedPracticeRow>,
}

/// A practice row; subject and realization are indices of names.
#[derive(Debug, Clone, Copy, PartialEq)]
struct IndexedPracticeRow {
    subject: u32,
    model: u32,
    repetition: u32,
    trial_index: Option<u32>,
    rating: Option<f64>,
    vaf: Option<f64>,
}

/// A practice row. Its names are untrusted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PracticeRow<'a> {
    /// Participant.
    pub subject: &'a str,
    /// Realization; empty if the table names none.
    pub model: &'a str,
    /// As in the table; 0 if the field is empty, as practice has no repetitions.
    pub repetition: u32,
    /// Position in the order, if it is known.
    pub trial_index: Option<u32>,
    /// The rating, if there is one.
    pub rating: Option<f64>,
    /// The VAF, if there is one.
    pub vaf: Option<f64>,
}

impl Practice {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The rows, in the order of their table.
    pub fn iter(&self) -> impl Iterator<Item = PracticeRow<'_>> {
        let name = |at: u32| self.names.get(at as usize).map_or("", String::as_str);
        self.rows.iter().map(move |row| PracticeRow {
            subject: name(row.subject),
            model: name(row.model),
            repetition: row.repetition,
            trial_index: row.trial_index,
            rating: row.rating,
            vaf: row.vaf,
        })
    }
}

impl Ratings {
    /// The ratings in the rows of a study: the answers to one question. Trials of tracks
    /// and of several intervals are no ratings of a realization.
    pub fn from_rows(rows: &[RatingRow], question: &QuestionId, share_of: Option<&str>) -> Self {
        let mut builder = Builder::new(question.to_string());
        let number = |answer: &Answer| match (answer, share_of) {
            (Answer::Choice(chosen), Some(option)) => {
                Some(f64::from(u8::from(chosen.iter().any(|c| c == option))))
            }
            _ => answer.number(),
        };
        for (i, r) in rows.iter().enumerate() {
            let Some(rated) = r.model.as_ref().filter(|_| r.track.is_none()) else {
                continue;
            };
            let origin = Origin::of(r.simulated, r.pilot);
            let answer = r.answers.get(question);
            let mut row = Row {
                repetition: r.repetition,
                rating: answer.and_then(number).filter(|v| v.is_finite()),
                origin,
                source_row: u32::try_from(i + 1).unwrap_or(u32::MAX),
                felt: r.fidelity.as_ref().map(Felt::of),
                ..Row::of(r)
            };
            if r.practice {
                builder.practice(r.participant.as_str(), rated.as_str(), row);
                continue;
            }
            row.subject = builder.subject(r.participant.as_str());
            let model = builder.model(rated.as_str(), r.role, || r.covariates.clone());
            row.model = Some(model);
            for (question, text) in comments(r) {
                builder.comment(question, text);
            }
            if let (Some(energy), Status::Ok) = (r.least_energy_j, r.status) {
                builder.least_energy(model, origin, energy);
            }
            builder.push(row);
        }
        builder.finish()
    }

    /// Marks hidden duplicates, given as (repeat, original).
    pub fn set_duplicates<'a>(&mut self, pairs: impl IntoIterator<Item = (&'a str, &'a str)>) {
        for (repeat, original) in pairs {
            if let Some(model) = self.models.iter_mut().find(|m| m.id == repeat) {
                model.duplicate_of = Some(original.to_owned());
            }
        }
    }

    /// Adds a covariate of a realization, unless its rows have it.
    pub fn add_covariate(&mut self, model: &str, name: &str, value: f64) {
        if let Some(m) = self.models.iter_mut().find(|m| m.id == model)
            && value.is_finite()
        {
            m.covariates.entry(name.to_owned()).or_insert(value);
        }
    }

    /// Sets the states and groups of the participants.
    pub fn set_states(&mut self, participants: &[ParticipantRow]) {
        for p in participants {
            let id = p.participant.as_str();
            if let Ok(i) = self.subjects.binary_search_by(|s| s.id.as_str().cmp(id)) {
                self.subjects[i].state = Some(p.state);
                self.subjects[i].reason.clone_from(&p.reason);
                self.subjects[i].group = p.group.as_ref().map(ToString::to_string);
            }
        }
    }

    /// Counts the attempts that failed because of the force. `rows` are those that the
    /// ratings were made of.
    pub fn set_failed(&mut self, rows: &[RatingRow], attempts: &[AttemptRow]) {
        let mut failed: BTreeMap<(&ParticipantId, u32, u32), u32> = BTreeMap::new();
        for attempt in attempts {
            if let (AttemptEvent::Failure, Some(Failure::Rendering), Some(trial)) =
                (attempt.what, attempt.failure, attempt.trial)
            {
                let of = (&attempt.participant, attempt.session, trial);
                *failed.entry(of).or_default() += 1;
            }
        }
        for (felt, source) in self.felt.iter_mut().zip(&self.source_row) {
            let row = rows.get(*source as usize - 1);
            if let (Some(felt), Some(row)) = (felt, row) {
                let of = (&row.participant, row.session, row.trial);
                felt.failed = failed.get(&of).copied().unwrap_or(0);
            }
        }
    }

    /// What was felt in a row, if it is known.
    pub fn felt(&self, row: usize) -> Option<&Felt> {
        self.felt.get(row)?.as_ref()
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rating.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rating.is_empty()
    }

    /// A copy with some of the rows. Subjects and realizations without a row are
    /// dropped.
    #[must_use]
    pub fn keep(&self, keep: impl Fn(usize) -> bool) -> Self {
        let rows: Vec<usize> = (0..self.len()).filter(|&i| keep(i)).collect();
        let (subject_map, subjects) = remap(&self.subjects, rows.iter().map(|&i| self.subject[i]));
        let (model_map, models) = remap(&self.models, rows.iter().filter_map(|&i| self.model[i]));
        let mut kept = self.pick(&rows);
        for subject in &mut kept.subject {
            *subject = subject_map[*subject as usize];
        }
        for model in kept.model.iter_mut().flatten() {
            *model = model_map[*model as usize];
        }
        let comment = |c: &Comment| {
            let row = rows.binary_search(&c.row).ok()?;
            Some(Comment { row, ..c.clone() })
        };
        Self {
            question: self.question.clone(),
            comments: self.comments.iter().filter_map(comment).collect(),
            practice: Arc::clone(&self.practice),
            sites: self.sites.clone(),
            near_misses: self.near_misses.clone(),
            subjects,
            models,
            ..kept
        }
    }

    /// The rows sorted by subject, then realization (none comes last), otherwise in
    /// their order: a counting sort, linear in the rows.
    pub fn by_cell(&self) -> Vec<usize> {
        let models = self.models.len();
        let place = |i: usize| self.model[i].map_or(models, |m| m as usize);
        let by_model = counting_sort(0..self.len(), self.len(), models + 1, place);
        counting_sort(
            by_model.iter().copied(),
            self.len(),
            self.subjects.len(),
            |i| self.subject[i] as usize,
        )
    }

    /// The rows of each subject and realization, of rows in the order of
    /// [`Ratings::by_cell`].
    fn cells<'o>(&self, order: &'o [usize]) -> impl Iterator<Item = &'o [usize]> {
        order
            .chunk_by(|&a, &b| (self.subject[a], self.model[a]) == (self.subject[b], self.model[b]))
    }
}

/// Sorts `n` rows by their keys, which are below `keys`; equal ones keep their order.
fn counting_sort(
    rows: impl IntoIterator<Item = usize> + Clone,
    n: usize,
    keys: usize,
    key: impl Fn(usize) -> usize,
) -> Vec<usize> {
    let mut next = vec![0; keys + 1];
    for i in rows.clone() {
        next[key(i) + 1] += 1;
    }
    for k in 1..=keys {
        next[k] += next[k - 1];
    }
    let mut sorted = vec![0; n];
    for i in rows {
        let at = &mut next[key(i)];
        sorted[*at] = i;
        *at += 1;
    }
    sorted
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

/// Keeps the items that are used; also returns the new index of each of these.
fn remap<T: Clone>(items: &[T], used: impl Iterator<Item = u32>) -> (Vec<u32>, Vec<T>) {
    let mut is_used = vec![false; items.len()];
    for i in used {
        is_used[i as usize] = true;
    }
    // For an item that is used: the number of used items before it.
    let new = is_used.iter().scan(0, |next, used| {
        let at = *next;
        *next += u32::from(*used);
        Some(at)
    });
    let kept = items.iter().zip(&is_used).filter(|(_, used)| **used);
    (new.collect(), kept.map(|(item, _)| item.clone()).collect())
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
        assert_eq!(r.model, [1, 0, 1, 0].map(Some));
        assert_eq!(r.rating, [Some(3.0), Some(4.0), None, Some(5.0)]);
    }

    #[test]
    fn keeping_rows_drops_subjects_without_any() {
        let r = small();
        let kept = r.keep(|i| r.subject[i] == 1);
        assert_eq!(kept.subjects.len(), 1);
        assert_eq!(kept.subjects[0].id, "S2");
        assert_eq!(kept.subject, [0, 0]);
        assert_eq!(kept.model, [1, 0].map(Some));
        assert_eq!(kept.rating, [3.0, 5.0].map(Some));
    }
}
