//! Subject × realization cells, and complete tables of them.
//!
//! Ratings are stored as differences from a whole number near their mean, so that a
//! large offset costs no digits. Means and quantiles add the offset back.

use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;
use study_base::sort::SmallSort as _;
use study_session::outcome::ratings::Ratings;
use study_stats::describe::{mean, mean_of, squares_about};
use study_stats::lmm::CellSummary;

/// One subject's ratings of one realization, with the sufficient statistics of a
/// Gaussian model without trial-level terms.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    pub(super) subject: usize,
    pub(super) model: usize,
    /// Range in [`Cells::order`] and [`Cells::sorted`].
    pub(super) rows: Range<usize>,
    /// Mean of the centered ratings.
    pub(super) mean: f64,
    /// Sum of squares about the mean, not finite if it overflows.
    pub(super) squares: f64,
}

impl Cell {
    /// What a mixed model needs of it, without a covariate; `None` if its sum of squares
    /// overflows.
    pub(super) fn summary(&self) -> Option<CellSummary> {
        self.squares.is_finite().then(|| CellSummary {
            subject: self.subject,
            realization: self.model,
            x: 0.0,
            n: self.rows.len(),
            mean: self.mean,
            within: self.squares,
        })
    }
}

/// The included ratings, sorted into cells.
#[derive(Debug)]
pub(super) struct Cells<'a> {
    pub(super) ratings: &'a Ratings,
    /// What was subtracted from every rating.
    pub(super) offset: f64,
    /// Ratings less the offset, by row.
    pub(super) centered: Vec<Option<f64>>,
    /// All rows, by subject and realization (rows without one last).
    pub(super) all: Vec<usize>,
    /// Rows with a rating and a realization, by subject, realization, repetition.
    pub(super) order: Vec<usize>,
    /// The centered ratings in this order; those of a cell are adjacent.
    pub(super) sorted: Vec<f64>,
    /// By subject, then realization; none is empty.
    pub(super) cells: Vec<Cell>,
    /// VAF by realization, if all of its rows have the same one.
    pub(super) vaf: Vec<Option<f64>>,
    /// Whether anyone rated the realization.
    pub(super) rated: Vec<bool>,
    /// The complete table of the tested realizations.
    complete: CompleteTable,
}

/// Cell means of the subjects that rated all of some realizations.
#[derive(Debug, Clone, Default)]
pub(super) struct CompleteTable {
    /// Indices of the subjects.
    pub(super) subjects: Vec<usize>,
    /// Indices of the realizations.
    pub(super) models: Vec<usize>,
    /// Cell means less the offset, subjects × realizations. Equal thirds may differ in
    /// their last bit.
    pub(super) rows: Vec<Vec<f64>>,
}

impl CompleteTable {
    /// The cell means of one realization, by subject.
    pub(super) fn column(&self, j: usize) -> Vec<f64> {
        self.rows.iter().map(|r| r[j]).collect()
    }
}

impl<'a> Cells<'a> {
    /// Sorts ratings into cells, in linear time unless repetitions are out of order.
    pub(super) fn of(ratings: &'a Ratings) -> Self {
        let offset = mean_of(ratings.rating.iter().copied().flatten()).map_or(0.0, f64::round);
        let less = |v: &Option<f64>| v.map(|v| v - offset).filter(|v| v.is_finite());
        let centered: Vec<Option<f64>> = ratings.rating.iter().map(less).collect();
        let (all, vaf) = rayon::join(|| ratings.by_cell(), || vafs(ratings));
        let counts = |i: &usize| centered[*i].is_some() && ratings.model[*i].is_some();
        let mut order: Vec<usize> = all.iter().copied().filter(counts).collect();
        let place = |i: usize| (ratings.subject[i], ratings.model[i]);
        let mut groups: Vec<Range<usize>> = Vec::new();
        for group in order.chunk_by_mut(|&a, &b| place(a) == place(b)) {
            if !group.is_sorted_by_key(|&i| ratings.repetition[i]) {
                group.small_sort_by_key(|&i| ratings.repetition[i]);
            }
            let start = groups.last().map_or(0, |g| g.end);
            groups.push(start..start + group.len());
        }
        let sorted: Vec<f64> = order.par_iter().filter_map(|&i| centered[i]).collect();
        let cell = |rows: Range<usize>| {
            let numbers = &sorted[rows.clone()];
            let (subject, model) = place(order[rows.start]);
            let mean = mean(numbers)?;
            Some(Cell {
                subject: subject as usize,
                model: model? as usize,
                rows,
                mean,
                squares: match numbers {
                    [_] => 0.0,
                    _ => squares_about(numbers, mean).unwrap_or(f64::NAN).max(0.0),
                },
            })
        };
        let cells: Vec<Cell> = (groups.into_par_iter().with_min_len(1000))
            .filter_map(cell)
            .collect();
        let mut rated = vec![false; ratings.models.len()];
        for cell in &cells {
            rated[cell.model] = true;
        }
        let mut made = Self {
            vaf,
            rated,
            ratings,
            offset,
            centered,
            all,
            order,
            sorted,
            cells,
            complete: CompleteTable::default(),
        };
        made.complete = made.complete_table(&made.tested());
        made
    }

    /// Centered ratings of a cell, by repetition.
    pub(super) fn of_cell(&self, cell: &Cell) -> &[f64] {
        &self.sorted[cell.rows.clone()]
    }

    /// The tested realizations that somebody rated.
    pub(super) fn tested(&self) -> Vec<usize> {
        let models = self.ratings.models.iter().enumerate();
        (models.filter(|(m, model)| self.rated[*m] && model.is_tested()))
            .map(|(m, _)| m)
            .collect()
    }

    /// For each realization its column in a table of `models`, if it has one.
    pub(super) fn columns(&self, models: &[usize]) -> Vec<Option<usize>> {
        let mut columns = vec![None; self.ratings.models.len()];
        for (j, &m) in models.iter().enumerate() {
            columns[m] = Some(j);
        }
        columns
    }

    /// The complete table of these realizations.
    pub(super) fn table(&self, models: &[usize]) -> Cow<'_, CompleteTable> {
        if models == self.complete.models {
            Cow::Borrowed(&self.complete)
        } else {
            Cow::Owned(self.complete_table(models))
        }
    }

    fn complete_table(&self, models: &[usize]) -> CompleteTable {
        let mut table = CompleteTable {
            subjects: Vec::new(),
            models: models.to_vec(),
            rows: Vec::new(),
        };
        if models.is_empty() {
            return table;
        }
        let columns = self.columns(models);
        for cells in self.cells.chunk_by(|a, b| a.subject == b.subject) {
            let mut row = vec![None; models.len()];
            for cell in cells {
                if let Some(j) = columns[cell.model] {
                    row[j] = Some(cell.mean).filter(|mean| mean.is_finite());
                }
            }
            if let Some(row) = row.into_iter().collect() {
                table.subjects.push(cells[0].subject);
                table.rows.push(row);
            }
        }
        table
    }

    /// The cell means of all subjects less the offset, by realization.
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

/// Sum of squares and degrees of freedom within cells.
pub(super) fn within<'c>(cells: impl IntoIterator<Item = &'c Cell>) -> (f64, usize) {
    let (mut squares, mut df) = (0.0, 0);
    for cell in cells {
        squares += cell.squares;
        df += cell.rows.len() - 1;
    }
    (squares, df)
}

fn vafs(ratings: &Ratings) -> Vec<Option<f64>> {
    let mut found: Vec<Option<Option<f64>>> = vec![None; ratings.models.len()];
    for (&m, &v) in ratings.model.iter().zip(&ratings.vaf) {
        let (Some(m), Some(v)) = (m, v) else {
            continue;
        };
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
