//! The exact least-squares solution under m, b ≥ 0.
//!
//! With θ the unconstrained minimum and P ∝ (ΣφφᵀW)⁻¹, the minimum with the
//! parameters C held at 0 is θ_c = θ − P_C (P_CC)⁻¹ θ_C, and its cost is higher by
//! θ_Cᵀ (P_CC)⁻¹ θ_C. The problem is convex and its active set is {m}, {b} or
//! {m, b}, so the feasible candidate of least cost is the solution. The scale of P
//! does not matter.

use super::samples::Theta;

/// The minimum under m, b ≥ 0 from the unconstrained minimum θ and the columns of P
/// that belong to m and b, all in the order of [`Theta`].
pub fn bounded(theta: Theta, p_m: [f64; 4], p_b: [f64; 4]) -> Theta {
    let [m, b, ..] = theta;
    if m >= 0.0 && b >= 0.0 {
        return theta;
    }
    let (mm, mb, bb) = (p_m[0], p_m[1], p_b[1]);
    let minus = |of_m: f64, of_b: f64| -> Theta {
        std::array::from_fn(|i| theta[i] - p_m[i] * of_m - p_b[i] * of_b)
    };
    let mut best: Option<(f64, Theta)> = None;
    let mut offer = |cost: f64, mut candidate: Theta, at_zero: &[usize]| {
        for i in at_zero {
            candidate[*i] = 0.0;
        }
        let feasible = candidate[0] >= 0.0 && candidate[1] >= 0.0;
        // false for NaN, which a singular P gives
        if feasible && cost >= 0.0 && best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, candidate));
        }
    };
    offer(m * m / mm, minus(m / mm, 0.0), &[0]);
    offer(b * b / bb, minus(0.0, b / bb), &[1]);
    let determinant = mm * bb - mb * mb;
    let of_m = (bb * m - mb * b) / determinant;
    let of_b = (mm * b - mb * m) / determinant;
    offer(m * of_m + b * of_b, minus(of_m, of_b), &[0, 1]);
    // P is singular to working precision: keep the bounds at least
    best.map_or([m.max(0.0), b.max(0.0), theta[2], theta[3]], |(_, t)| t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_base::rng::Stream;

    /// ΣφφᵀW of random samples, its inverse, and ΣφF.
    fn problem(noise: &mut Stream) -> ([[f64; 4]; 4], [f64; 4]) {
        let mut r = [[0.0; 4]; 4];
        let mut y = [0.0; 4];
        let truth: Theta = std::array::from_fn(|_| noise.normal());
        for _ in 0..12 {
            let mut phi: Theta = std::array::from_fn(|_| noise.normal());
            phi[3] = 1.0;
            // correlated, so that bounding one moves the other
            phi[1] += 0.8 * phi[0];
            let f = (0..4).map(|i| phi[i] * truth[i]).sum::<f64>() + noise.normal();
            for i in 0..4 {
                y[i] += phi[i] * f;
                for j in 0..4 {
                    r[i][j] += phi[i] * phi[j];
                }
            }
        }
        (r, y)
    }

    /// Gauss–Jordan elimination for the parameters that are free; the others are 0.
    fn solve(r: &[[f64; 4]; 4], y: &[f64; 4], free: &[usize]) -> Theta {
        let n = free.len();
        let mut rows: Vec<Vec<f64>> = free
            .iter()
            .map(|i| {
                let row = free.iter().map(|j| r[*i][*j]);
                row.chain([y[*i]]).collect()
            })
            .collect();
        for p in 0..n {
            let pivot = rows[p].clone();
            for (q, row) in rows.iter_mut().enumerate() {
                let factor = if q == p { 0.0 } else { row[p] / pivot[p] };
                for (value, above) in row.iter_mut().zip(&pivot) {
                    *value -= factor * above;
                }
            }
        }
        let mut theta = [0.0; 4];
        for (p, i) in free.iter().enumerate() {
            theta[*i] = rows[p][n] / rows[p][p];
        }
        theta
    }

    /// Column `c` of the inverse.
    fn inverse_column(r: &[[f64; 4]; 4], c: usize) -> Theta {
        let mut unit = [0.0; 4];
        unit[c] = 1.0;
        solve(r, &unit, &[0, 1, 2, 3])
    }

    fn gradient(r: &[[f64; 4]; 4], y: &[f64; 4], theta: &Theta) -> Theta {
        std::array::from_fn(|i| (0..4).map(|j| r[i][j] * theta[j]).sum::<f64>() - y[i])
    }

    #[test]
    fn the_bounded_estimate_meets_the_kkt_conditions() {
        let mut noise = Stream::new(7, &["kkt"]);
        let mut at_bounds = [0; 4];
        for _ in 0..2000 {
            let (r, y) = problem(&mut noise);
            let free = solve(&r, &y, &[0, 1, 2, 3]);
            let theta = bounded(free, inverse_column(&r, 0), inverse_column(&r, 1));
            let g = gradient(&r, &y, &theta);
            assert!(theta[0] >= 0.0 && theta[1] >= 0.0, "{theta:?}");
            // the gradient is 0 in k and F0; in m and b it is 0, or positive at the bound
            assert!(g[2].abs() < 1e-8 && g[3].abs() < 1e-8, "{g:?}");
            for i in 0..2 {
                assert!(g[i] > -1e-8, "{g:?}");
                assert!(theta[i] == 0.0 || g[i].abs() < 1e-8, "{theta:?} {g:?}");
            }
            at_bounds[usize::from(theta[0] == 0.0) + 2 * usize::from(theta[1] == 0.0)] += 1;
        }
        // every active set occurs
        assert!(at_bounds.iter().all(|n| *n > 50), "{at_bounds:?}");
    }

    #[test]
    fn the_bounded_estimate_is_the_best_of_all_active_sets() {
        let mut noise = Stream::new(8, &["brute"]);
        for _ in 0..500 {
            let (r, y) = problem(&mut noise);
            let cost = |t: &Theta| {
                let g = gradient(&r, &y, t);
                (0..4).map(|i| t[i] * (g[i] - y[i])).sum::<f64>()
            };
            let found = bounded(
                solve(&r, &y, &[0, 1, 2, 3]),
                inverse_column(&r, 0),
                inverse_column(&r, 1),
            );
            for free in [&[0, 1, 2, 3][..], &[1, 2, 3], &[0, 2, 3], &[2, 3]] {
                let other = solve(&r, &y, free);
                if other[0] >= 0.0 && other[1] >= 0.0 {
                    assert!(cost(&found) <= cost(&other) + 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_singular_matrix_still_gives_parameters_within_bounds() {
        let zero = [0.0; 4];
        let theta = bounded([-1.0, 2.0, 3.0, 4.0], zero, zero);
        assert_eq!(theta, [0.0, 2.0, 3.0, 4.0]);
    }
}
