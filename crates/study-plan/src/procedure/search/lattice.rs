//! The points of a space: equal steps along each axis, and which of them may be presented.

use crate::procedure::ProcedureError;
use serde::Serialize;
use std::collections::VecDeque;
use study_base::sort::SmallSort as _;

/// The most points of a lattice.
pub const MAX_POINTS: usize = study_stats::preference_gp::MAX_POINTS;

/// Most axes: pairs have twice as many coordinates in the Sobol sequence.
pub(super) const MAX_AXES: usize = 4;

/// A finite space. Point numbers count the last axis fastest, from 0.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Lattice {
    steps: Vec<usize>,
    certified: Vec<usize>,
}

impl Lattice {
    /// One to four axes with two steps or more, at most [`MAX_POINTS`] points. `certified` says of a point, by its steps
    /// along the axes, whether it may be presented.
    ///
    /// # Errors
    /// [`ProcedureError`] if there are other numbers of axes, steps or points, or fewer than two certified ones.
    ///
    /// ```
    /// # use study_plan::procedure::{Lattice, ProcedureError};
    /// let lattice = Lattice::new(vec![3, 3], |at| at[0] + at[1] < 4)?;
    /// assert_eq!(lattice.certified(), [0, 1, 2, 3, 4, 5, 6, 7]);
    /// assert_eq!(lattice.coordinates(5), [0.5, 1.0]);
    /// # Ok::<(), ProcedureError>(())
    /// ```
    pub fn new(
        steps: Vec<usize>,
        certified: impl Fn(&[usize]) -> bool,
    ) -> Result<Self, ProcedureError> {
        let range = |what: &str, value: usize, range| {
            Err(ProcedureError::Range {
                what: what.to_owned(),
                value: value as f64,
                range,
            })
        };
        if steps.is_empty() || steps.len() > MAX_AXES {
            return range("the number of axes", steps.len(), "1 to 4");
        }
        if let Some(few) = steps.iter().find(|n| **n < 2) {
            return range("the number of steps of an axis", *few, "at least 2");
        }
        let points = steps.iter().fold(1usize, |all, n| all.saturating_mul(*n));
        if points > MAX_POINTS {
            return range("the number of points", points, "at most 1000");
        }
        let mut lattice = Self {
            steps,
            certified: Vec::new(),
        };
        lattice.certified = (0..points)
            .filter(|point| certified(&lattice.at(*point)))
            .collect();
        match lattice.certified.len() {
            few @ 0..2 => range("the number of certified points", few, "at least 2"),
            _ => Ok(lattice),
        }
    }

    /// The number of steps of each axis.
    pub fn steps(&self) -> &[usize] {
        &self.steps
    }

    /// Certified or not.
    pub fn len(&self) -> usize {
        self.steps.iter().product()
    }

    /// Never: there are two points or more.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The points that may be presented, rising.
    pub fn certified(&self) -> &[usize] {
        &self.certified
    }

    /// Whether a point may be presented.
    pub fn is_certified(&self, point: usize) -> bool {
        self.certified.binary_search(&point).is_ok()
    }

    /// The step of a point along each axis, from 0.
    pub fn at(&self, point: usize) -> Vec<usize> {
        let mut rest = point;
        let mut at: Vec<usize> = (self.steps.iter().rev())
            .map(|n| {
                let step = rest % n;
                rest /= n;
                step
            })
            .collect();
        at.reverse();
        at
    }

    /// The point with these steps along the axes.
    pub fn point(&self, at: &[usize]) -> usize {
        let pairs = at.iter().zip(&self.steps);
        pairs.fold(0, |point, (step, n)| point * n + step)
    }

    /// Where a point is along each axis, from 0 at its first step to 1 at its last.
    pub fn coordinates(&self, point: usize) -> Vec<f64> {
        let pairs = self.at(point).into_iter().zip(&self.steps);
        pairs
            .map(|(step, n)| step as f64 / (n - 1) as f64)
            .collect()
    }

    /// The point in whose cell 32-bit fractions lie: step ⌊fraction · steps / 2³²⌋ of each axis.
    pub(super) fn point_at(&self, fractions: &[u32]) -> usize {
        let pairs = fractions.iter().zip(&self.steps);
        let at: Vec<usize> = pairs
            .map(|(fraction, n)| ((u64::from(*fraction) * *n as u64) >> 32) as usize)
            .collect();
        self.point(&at)
    }

    /// The certified points in groups, the largest first: in a group, one can go from each point to every other in single
    /// steps along an axis, without a point that is not certified.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        let mut left: Vec<bool> = (0..self.len()).map(|p| self.is_certified(p)).collect();
        let mut groups = Vec::new();
        for start in self.certified.iter().copied() {
            if !std::mem::take(&mut left[start]) {
                continue;
            }
            let mut group = vec![start];
            let mut next = VecDeque::from([start]);
            while let Some(point) = next.pop_front() {
                for neighbor in self.neighbors(point) {
                    if std::mem::take(&mut left[neighbor]) {
                        group.push(neighbor);
                        next.push_back(neighbor);
                    }
                }
            }
            group.sort_unstable();
            groups.push(group);
        }
        groups.small_sort_by_key(|group| std::cmp::Reverse(group.len()));
        groups
    }

    fn neighbors(&self, point: usize) -> Vec<usize> {
        let at = self.at(point);
        let mut found = Vec::new();
        for (axis, n) in self.steps.iter().enumerate() {
            let beside = [at[axis].checked_sub(1), Some(at[axis] + 1)];
            for step in beside.into_iter().flatten().filter(|step| step < n) {
                let mut moved = at.clone();
                moved[axis] = step;
                found.push(self.point(&moved));
            }
        }
        found
    }
}
