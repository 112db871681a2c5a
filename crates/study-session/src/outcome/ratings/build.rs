//! From rows to columns: names get an index when they first occur, and are sorted at
//! the end.

use super::{Comment, IndexedPracticeRow, Origin, Practice, Ratings, Realization, Row, Subject};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use study_base::sort::SmallSort as _;
use study_plan::protocol::Role;

/// The index of each name, in order of first occurrence.
#[derive(Debug, Default)]
struct Names {
    indices: HashMap<String, u32>,
    /// The name that was looked up last: neighboring rows often share it.
    last: Option<(String, u32)>,
}

impl Names {
    /// The index of a name, and whether the name is new.
    fn index(&mut self, name: &str) -> (u32, bool) {
        if let Some((last, at)) = &self.last
            && last == name
        {
            return (*at, false);
        }
        let next = u32::try_from(self.indices.len()).unwrap_or(u32::MAX);
        let (at, new) = match self.indices.get(name) {
            Some(at) => (*at, false),
            None => {
                self.indices.insert(name.to_owned(), next);
                (next, true)
            }
        };
        let (last, index) = self.last.get_or_insert_with(|| (String::new(), at));
        last.clear();
        last.push_str(name);
        *index = at;
        (at, new)
    }
}

/// The covariate that telemetry provides: how active a realization was.
const LEAST_ENERGY: &str = "least_energy_j";

/// Collects rows.
#[derive(Debug)]
pub(super) struct Builder {
    ratings: Ratings,
    subjects: Names,
    models: Names,
    /// Subjects and realizations of practice rows.
    practice_names: Names,
    practice: Practice,
    /// Rows whose repetition is still to be numbered, rising.
    unnumbered: Vec<usize>,
    /// Sum and number of the least energies, J, by realization: those of
    /// participants, and of pilots and simulated participants.
    energies: BTreeMap<u32, [(f64, f64); 2]>,
}

impl Builder {
    pub(super) fn new(question: String) -> Self {
        Self {
            ratings: Ratings {
                question,
                ..Ratings::default()
            },
            subjects: Names::default(),
            models: Names::default(),
            practice_names: Names::default(),
            practice: Practice::default(),
            unnumbered: Vec::new(),
            energies: BTreeMap::new(),
        }
    }

    /// The least energy that the hand had put in during a playback, J.
    pub(super) fn least_energy(&mut self, model: u32, origin: Origin, energy: f64) {
        if energy.is_finite() {
            let both = self.energies.entry(model).or_default();
            let (sum, n) = &mut both[usize::from(origin != Origin::Real)];
            (*sum, *n) = (*sum + energy, *n + 1.0);
        }
    }

    /// Number of rows so far.
    pub(super) fn len(&self) -> usize {
        self.ratings.len()
    }

    /// Adds a practice row, which is kept apart from the others.
    pub(super) fn practice(&mut self, subject: &str, model: &str, row: Row) {
        let row = row.consistent();
        let mut index = |names: &mut Names, name: &str| {
            let (at, new) = names.index(name);
            if new {
                self.practice.names.push(name.to_owned());
            }
            at
        };
        let subject = index(&mut self.practice_names, subject);
        let model = index(&mut self.practice_names, model);
        self.practice.rows.push(IndexedPracticeRow {
            subject,
            model,
            repetition: row.repetition,
            trial_index: row.trial_index,
            rating: row.rating,
            vaf: row.vaf,
        });
    }

    /// The index of a subject.
    pub(super) fn subject(&mut self, id: &str) -> u32 {
        let (at, new) = self.subjects.index(id);
        if new {
            self.ratings.subjects.push(Subject {
                id: id.to_owned(),
                state: None,
                reason: String::new(),
                site: None,
                group: None,
            });
        }
        at
    }

    /// The index of a realization; its first row gives role and covariates.
    pub(super) fn model(
        &mut self,
        id: &str,
        role: Role,
        covariates: impl FnOnce() -> BTreeMap<String, f64>,
    ) -> u32 {
        let (at, new) = self.models.index(id);
        if new {
            self.ratings.models.push(Realization {
                id: id.to_owned(),
                role,
                duplicate_of: None,
                covariates: covariates(),
            });
        }
        at
    }

    /// Adds a text that belongs to the row pushed next.
    pub(super) fn comment(&mut self, question: String, text: String) {
        let row = self.len();
        self.ratings.comments.push(Comment {
            row,
            question,
            text,
        });
    }

    /// Adds a row.
    pub(super) fn push(&mut self, row: Row) {
        self.ratings.push(row.consistent());
    }

    /// Numbers the repetition of the row pushed next, from 1 within subject and
    /// realization.
    pub(super) fn number_next(&mut self) {
        self.unnumbered.push(self.len());
    }

    /// Gives the realizations their mean least energy, sorts the names and numbers the
    /// repetitions that the table leaves empty.
    pub(super) fn finish(self) -> Ratings {
        let mut r = self.ratings;
        r.practice = Arc::new(self.practice);
        // As in the analysis: the others only if there is no real participant.
        let others = usize::from(!r.origin.contains(&Origin::Real));
        for (model, both) in self.energies {
            let (sum, n) = both[others];
            if let Some(m) = r.models.get_mut(model as usize).filter(|_| n > 0.0) {
                m.covariates.insert(LEAST_ENERGY.to_owned(), sum / n);
            }
        }
        let subjects = sort(&mut r.subjects, |s| &s.id);
        let models = sort(&mut r.models, |m| &m.id);
        for s in &mut r.subject {
            *s = subjects[*s as usize];
        }
        for m in r.model.iter_mut().flatten() {
            *m = models[*m as usize];
        }
        if !self.unnumbered.is_empty() {
            let order = r.by_cell();
            let mut numbers = vec![0; r.len()];
            for rows in r.cells(&order) {
                for (number, &i) in (1u32..).zip(rows) {
                    numbers[i] = number;
                }
            }
            for i in self.unnumbered {
                r.repetition[i] = numbers[i];
            }
        }
        r
    }
}

/// Sorts by name; returns the new index of each item.
pub(super) fn sort<T: Clone>(items: &mut Vec<T>, name: impl Fn(&T) -> &str) -> Vec<u32> {
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.small_sort_by(|&a, &b| name(&items[a]).cmp(name(&items[b])));
    let mut new_index = vec![0; items.len()];
    for (new, &old) in (0u32..).zip(&order) {
        new_index[old] = new;
    }
    *items = order.iter().map(|&i| items[i].clone()).collect();
    new_index
}
