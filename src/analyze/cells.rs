//! Subject × realization cells, and the complete tables made of them.
//!
//! Ratings are held as differences from a whole number near their mean, so that
//! an offset costs no digits; what is a level (a mean, a quantile) adds it back.

use crate::outcome::ratings::{NO_MODEL, Ratings};
use crate::protocol::Role;
use crate::stats::describe::mean;
use std::ops::Range;

/// One subject's ratings of one realization.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    pub(super) subject: usize,
    pub(super) model: usize,
    /// Into [`Cells::order`].
    pub(super) rows: Range<usize>,
    /// Mean of the centred ratings.
    pub(super) mean: f64,
}

/// The ratings that count, sorted into cells.
#[derive(Debug)]
pub(super) struct Cells<'a> {
    pub(super) ratings: &'a Ratings,
    /// What was taken off every rating.
    pub(super) offset: f64,
    /// Ratings less the offset, by row; NaN missing.
    pub(super) centred: Vec<f64>,
    /// Rows with a rating and a realization, by subject, model, repetition.
    pub(super) order: Vec<usize>,
    /// By subject, then model; none is empty.
    pub(super) cells: Vec<Cell>,
    /// VAF of each model, if its rows agree on one.
    pub(super) vaf: Vec<Option<f64>>,
}

/// A complete table: the subjects that rated all of some realizations.
#[derive(Debug, Clone)]
pub(super) struct Table {
    /// Indices of the subjects.
    pub(super) subjects: Vec<usize>,
    /// Indices of the realizations.
    pub(super) models: Vec<usize>,
    /// Cell means less the offset. Equal thirds may differ in their last bit.
    pub(super) rows: Vec<Vec<f64>>,
}

impl Table {
    /// A column: one realization, by subject.
    pub(super) fn column(&self, j: usize) -> Vec<f64> {
        self.rows.iter().map(|r| r[j]).collect()
    }
}

impl<'a> Cells<'a> {
    pub(super) fn of(ratings: &'a Ratings) -> Self {
        let rated: Vec<f64> = ratings
            .rating
            .iter()
            .copied()
            .filter(|v| v.is_finite())
            .collect();
        let offset = mean(&rated).unwrap_or(0.0).round();
        let centred: Vec<f64> = ratings.rating.iter().map(|v| v - offset).collect();
        let mut order: Vec<usize> = (0..ratings.len())
            .filter(|&i| centred[i].is_finite() && ratings.model[i] != NO_MODEL)
            .collect();
        order.sort_by_key(|&i| (ratings.subject[i], ratings.model[i], ratings.repetition[i]));
        let mut cells = Vec::new();
        let mut start = 0;
        for group in order.chunk_by(|&a, &b| {
            (ratings.subject[a], ratings.model[a]) == (ratings.subject[b], ratings.model[b])
        }) {
            let numbers: Vec<f64> = group.iter().map(|&i| centred[i]).collect();
            if let Some(mean) = mean(&numbers) {
                cells.push(Cell {
                    subject: ratings.subject[group[0]] as usize,
                    model: ratings.model[group[0]] as usize,
                    rows: start..start + group.len(),
                    mean,
                });
            }
            start += group.len();
        }
        Self {
            vaf: vafs(ratings),
            ratings,
            offset,
            centred,
            order,
            cells,
        }
    }

    /// Centred ratings of a cell, by repetition.
    pub(super) fn of_cell(&self, cell: &Cell) -> Vec<f64> {
        self.order[cell.rows.clone()]
            .iter()
            .map(|&i| self.centred[i])
            .collect()
    }

    /// Realizations that the study asks about: role test and no hidden repeat.
    pub(super) fn test_models(&self) -> Vec<usize> {
        (0..self.ratings.models.len())
            .filter(|&m| {
                let model = &self.ratings.models[m];
                model.role == Role::Test && model.duplicate_of.is_none()
            })
            .collect()
    }

    /// The subjects that rated all of these realizations.
    pub(super) fn table(&self, models: &[usize]) -> Table {
        let mut table = Table {
            subjects: Vec::new(),
            models: models.to_vec(),
            rows: Vec::new(),
        };
        if models.is_empty() {
            return table;
        }
        let mut place = vec![usize::MAX; self.ratings.models.len()];
        for (j, &m) in models.iter().enumerate() {
            place[m] = j;
        }
        for cells in self.cells.chunk_by(|a, b| a.subject == b.subject) {
            let mut row = vec![f64::NAN; models.len()];
            for cell in cells {
                if let Some(slot) = row.get_mut(place[cell.model]) {
                    *slot = cell.mean;
                }
            }
            if row.iter().all(|v| v.is_finite()) {
                table.subjects.push(cells[0].subject);
                table.rows.push(row);
            }
        }
        table
    }

    /// Mean over the subjects of their cell means, less the offset, by model.
    pub(super) fn subject_means(&self) -> Vec<Vec<f64>> {
        let mut means = vec![Vec::new(); self.ratings.models.len()];
        for cell in &self.cells {
            means[cell.model].push(cell.mean);
        }
        means
    }

    /// The name of a subject.
    pub(super) fn subject_name(&self, subject: usize) -> &str {
        &self.ratings.subjects[subject].id
    }

    /// The name of a realization.
    pub(super) fn model_name(&self, model: usize) -> &str {
        &self.ratings.models[model].id
    }
}

fn vafs(ratings: &Ratings) -> Vec<Option<f64>> {
    let mut found: Vec<Option<Option<f64>>> = vec![None; ratings.models.len()];
    for (&m, &v) in ratings.model.iter().zip(&ratings.vaf) {
        if m == NO_MODEL || !v.is_finite() {
            continue;
        }
        let slot = &mut found[m as usize];
        *slot = match *slot {
            None => Some(Some(v)),
            Some(Some(before)) if before == v => *slot,
            // Two values: the realization has none.
            Some(_) => Some(None),
        };
    }
    found.into_iter().map(Option::flatten).collect()
}
