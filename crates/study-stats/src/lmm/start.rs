//! The coordinates of the search, and its starting points.
//!
//! A variance ratio is searched as u = ln(1 + cγ) ≥ 0, with c the largest number of
//! ratings of one level: the log-determinants are nearly linear in u. A correlated intercept
//! and slope are Γ = θθ' + diag(0, δ), θ = (θ₁, θ₂) free, δ ≥ 0 the variance of
//! the slope given the intercept; |correlation| = 1 is δ = 0.

use super::RandomEffects;
use super::data::LmmData;
use super::profile::Ratios;

/// Most starting points.
const MAX_STARTS: usize = 4;

/// Maps the coordinates to variance ratios.
#[derive(Debug, Clone)]
pub(super) struct Coordinates {
    pub(super) random: RandomEffects,
    intercept: f64,
    slope: f64,
    realization: f64,
    cell: f64,
}

impl Coordinates {
    pub(super) fn of(table: &LmmData, random: RandomEffects) -> Self {
        let (mut intercept, mut slope, mut cell) = (1.0f64, 0.0f64, 1.0f64);
        let mut by_realization = vec![0.0; table.realizations.len()];
        for pattern in &table.patterns {
            let n: f64 = pattern.units.iter().map(|u| u.n).sum();
            let xx: f64 = pattern.units.iter().map(|u| u.n * u.x * u.x).sum();
            intercept = intercept.max(n);
            slope = slope.max(xx);
            for unit in &pattern.units {
                cell = cell.max(unit.n);
                by_realization[unit.realization] += pattern.subjects * unit.n;
            }
        }
        Self {
            random,
            intercept,
            slope: if slope > 0.0 { slope } else { 1.0 },
            realization: by_realization.iter().copied().fold(1.0, f64::max),
            cell,
        }
    }

    /// Which coordinates are bounded below by 0.
    pub(super) fn bounded(&self) -> Vec<bool> {
        let mut bounded = if self.random.slope {
            vec![false, false, true]
        } else {
            vec![true]
        };
        bounded.extend(
            [self.random.realization, self.random.cell]
                .iter()
                .filter(|r| **r),
        );
        bounded
    }

    pub(super) fn ratios(&self, at: &[f64]) -> Ratios {
        let mut ratios = Ratios::default();
        let rest = if self.random.slope {
            let (a, b) = (at[0] / self.intercept.sqrt(), at[1] / self.slope.sqrt());
            ratios.intercept = a * a;
            ratios.covariance = a * b;
            ratios.slope = b * b + at[2].exp_m1() / self.slope;
            &at[3..]
        } else {
            ratios.intercept = at[0].exp_m1() / self.intercept;
            &at[1..]
        };
        let mut rest = rest.iter();
        if self.random.realization {
            ratios.realization = rest.next().map_or(0.0, |u| u.exp_m1() / self.realization);
        }
        if self.random.cell {
            ratios.cell = rest.next().map_or(0.0, |u| u.exp_m1() / self.cell);
        }
        ratios
    }

    /// Starting points from a coarse grid: with one coordinate every local minimum of the
    /// grid; with several the best points, of which the later ones serve if the search
    /// from the first does not converge.
    pub(super) fn starts(&self, f: &dyn Fn(&[f64]) -> Option<f64>) -> Vec<Vec<f64>> {
        let bounded = self.bounded();
        let axes: Vec<&[f64]> = match (bounded.len(), self.random.slope) {
            (1, _) => vec![&[
                0.0, 0.2, 0.5, 1.0, 1.7, 2.5, 3.5, 5.0, 7.0, 10.0, 14.0, 20.0,
            ]],
            (3, true) => vec![&[0.4, 1.5, 5.0], &[-1.0, 0.1, 1.0], &[0.0, 0.7, 3.0]],
            (2, _) => vec![&[0.0, 0.7, 2.0, 5.0]; 2],
            (d, _) => vec![&[0.0, 0.7, 3.0]; d],
        };
        let mut points: Vec<Vec<f64>> = vec![Vec::new()];
        for axis in &axes {
            points = points
                .iter()
                .flat_map(|p| {
                    axis.iter().map(move |v| {
                        let mut point = p.clone();
                        point.push(*v);
                        point
                    })
                })
                .collect();
        }
        let values: Vec<f64> = points
            .iter()
            .map(|p| f(p).unwrap_or(f64::INFINITY))
            .collect();
        let mut order: Vec<usize> = (0..points.len())
            .filter(|i| values[*i].is_finite())
            .collect();
        if axes.len() == 1 {
            order.retain(|&i| {
                (i == 0 || values[i] <= values[i - 1])
                    && (i + 1 == values.len() || values[i] <= values[i + 1])
            });
        } else {
            order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        }
        order.truncate(MAX_STARTS);
        order.iter().map(|&i| points[i].clone()).collect()
    }
}
