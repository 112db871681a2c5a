//! The table of a design: rows by group, centered and scaled.

use super::{FactorialError, MAX_CELLS, MAX_FACTORS};
use crate::anova::{helmert, kronecker, unit};
use crate::between::center_groups;
use crate::describe::{mean_of, power_of_two};
use crate::matrix::dot;

/// The values x = center + unit·z of a design that was checked.
pub(super) struct Table {
    /// z: a row for each subject, those of the first group first.
    pub(super) rows: Vec<Vec<f64>>,
    /// Number of subjects of each group.
    pub(super) sizes: Vec<usize>,
    /// A power of two.
    pub(super) unit: f64,
    /// The mean of all values.
    pub(super) center: f64,
    /// Sum of squares of z about the means of groups and cells: of all errors together.
    pub(super) errors: f64,
    /// What a sum of squares of z has to exceed in order not to be due to rounding.
    pub(super) least: f64,
}

impl Table {
    pub(super) fn new(
        rows: &[Vec<f64>],
        levels: &[usize],
        groups: &[usize],
    ) -> Result<Self, FactorialError> {
        let cells = cells(levels)?;
        let sizes = sizes(rows.len(), groups)?;
        if levels.is_empty() && sizes.len() == 1 {
            return Err(FactorialError::NoTerm);
        }
        Self::of(rows, cells, groups, sizes)
    }

    /// A table of which the factors do not matter, with the cells of the first row.
    pub(super) fn of_cells(rows: &[Vec<f64>], groups: &[usize]) -> Result<Self, FactorialError> {
        let cells = rows.first().map_or(0, Vec::len);
        Self::of(rows, cells, groups, sizes(rows.len(), groups)?)
    }

    fn of(
        rows: &[Vec<f64>],
        cells: usize,
        groups: &[usize],
        sizes: Vec<usize>,
    ) -> Result<Self, FactorialError> {
        for (row, values) in rows.iter().enumerate() {
            if values.len() != cells {
                return Err(FactorialError::RowLength {
                    row,
                    found: values.len(),
                    expected: cells,
                });
            }
            if values.iter().any(|x| !x.is_finite()) {
                return Err(FactorialError::NotFinite(row));
            }
        }
        let first = power_of_two(rows.iter().flatten());
        let scaled = rows.iter().flatten().map(|x| x * first);
        let mean = mean_of(scaled.clone()).ok_or(FactorialError::Overflow)?;
        let deviations: Vec<f64> = scaled.clone().map(|x| x - mean).collect();
        let second = power_of_two(deviations.iter());
        let mut places: Vec<usize> = (0..rows.len()).collect();
        places.sort_by_key(|&row| groups.get(row).copied().unwrap_or(0));
        let row = |row: &usize| {
            let own = &deviations[row * cells..(row + 1) * cells];
            own.iter().map(|x| x * second).collect()
        };
        let rows: Vec<Vec<f64>> = places.iter().map(row).collect();
        let size: f64 = rows.iter().map(|z| dot(z, z)).sum();
        // Before the mean was subtracted values were known to some 10⁻¹⁵ of their size.
        let before: f64 = scaled.map(|x| (x * second).powi(2)).sum();
        let mut centered = rows.clone();
        center_groups(&mut centered, &sizes);
        Ok(Self {
            errors: centered.iter().map(|z| dot(z, z)).sum(),
            rows,
            sizes,
            unit: 1.0 / first / second,
            center: mean / first,
            least: (1e-24 * size).max(1e-29 * before),
        })
    }

    pub(super) fn has_groups(&self) -> bool {
        self.sizes.len() > 1
    }

    /// The group of each row of z.
    pub(super) fn groups(&self) -> Vec<usize> {
        let of_group = |(group, size): (usize, &usize)| vec![group; *size];
        self.sizes.iter().enumerate().flat_map(of_group).collect()
    }

    /// Degrees of freedom of the error of one contrast: N − G.
    pub(super) fn df(&self) -> f64 {
        (self.rows.len() - self.sizes.len()) as f64
    }

    /// The means by group of these contrasts of z, and what is left of them in each row.
    pub(super) fn centered(&self, contrasts: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let of_row = |z: &Vec<f64>| contrasts.iter().map(|c| dot(c, z)).collect();
        let mut y: Vec<Vec<f64>> = self.rows.iter().map(of_row).collect();
        (center_groups(&mut y, &self.sizes), y)
    }
}

/// Number of cells of a design.
pub(super) fn cells(levels: &[usize]) -> Result<usize, FactorialError> {
    if levels.len() > MAX_FACTORS {
        return Err(FactorialError::TooManyFactors(levels.len()));
    }
    if let Some(factor) = levels.iter().position(|n| *n < 2) {
        return Err(FactorialError::OneLevel(factor));
    }
    let product = levels.iter().try_fold(1usize, |all, n| all.checked_mul(*n));
    product
        .filter(|cells| *cells <= MAX_CELLS)
        .ok_or(FactorialError::TooManyCells)
}

/// Number of rows of each group.
fn sizes(rows: usize, groups: &[usize]) -> Result<Vec<usize>, FactorialError> {
    if rows < 2 {
        return Err(FactorialError::TooFewParticipants);
    }
    if groups.is_empty() {
        return Ok(vec![rows]);
    }
    if groups.len() != rows {
        return Err(FactorialError::GroupsLength {
            rows,
            groups: groups.len(),
        });
    }
    let mut sizes = vec![0; rows];
    let mut last = 0;
    for &group in groups {
        // A group from the number of rows on leaves an earlier one empty.
        if let Some(size) = sizes.get_mut(group) {
            *size += 1;
        }
        last = last.max(group);
    }
    if let Some(empty) = sizes.iter().position(|n| *n == 0)
        && empty < last
    {
        return Err(FactorialError::EmptyGroup(empty));
    }
    if last + 1 >= rows {
        return Err(FactorialError::NoError);
    }
    sizes.truncate(last + 1);
    Ok(sizes)
}

/// Orthonormal contrasts over the cells for a term of these factors.
pub(super) fn within_contrasts(factors: &[usize], levels: &[usize]) -> Vec<Vec<f64>> {
    over_cells(levels, |factor, k| {
        if factors.contains(&factor) {
            helmert(k)
        } else {
            vec![unit(k)]
        }
    })
}

/// The Kronecker product of rows for each factor, which are given its place and number of
/// levels.
pub(super) fn over_cells(
    levels: &[usize],
    of_factor: impl Fn(usize, usize) -> Vec<Vec<f64>>,
) -> Vec<Vec<f64>> {
    let factors = levels.iter().enumerate();
    factors.fold(vec![vec![1.0]], |product, (factor, &k)| {
        kronecker(&product, &of_factor(factor, k))
    })
}
