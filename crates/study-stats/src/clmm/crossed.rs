//! Random subjects and random realizations, by Laplace's method.
//!
//! logit P(Y ≤ j) = θⱼ − xβ − σᵤzₛ − σᵥwₘ with standard normal z of the subjects and w of
//! the realizations, which are the predictors of [`CategoryCounts`]. In the terms of
//! [`super`], with a cell c = (s, m), rₖ = nₖ − mₖF(aₖ), ωₖ = mₖF(1 − F),
//! τₖ = ωₖ(1 − 2F), ω_c = Σωₖ, the log-likelihood is approximated by
//!
//! ```text
//! l = f(ẑ, ŵ) − ½ ln |H|,   H = I + Σ ω_c d_c d_cᵀ,   d_c = σᵤeₛ + σᵥeₘ
//! f = Σ (nₖaₖ − mₖs(aₖ)) + Σ Nⱼκⱼ − ½ zᵀz − ½ wᵀw.
//! ```
//!
//! f is concave in (z, w). H is factored with the subjects, which are many, eliminated.
//! With h_c = d_cᵀH⁻¹d_c, λ = H⁻¹ ½ Σ h_c (Στₖ) d_c and ℓ_c = d_cᵀλ, implicit
//! differentiation at the mode gives ∂l = Σ Wₖ ∂aₖ + …, Wₖ = rₖ − ½h_cτₖ + ℓ_cωₖ, to which
//! the standard deviations add what they contribute to d. The Hessian is taken from
//! differences of this gradient. l is even and smooth in σᵤ and σᵥ, so that the
//! boundary 0 needs no special case.

use super::{INFINITE_SD, SMALLEST_SD};
use crate::clm::counts::CategoryCounts;
use crate::clm::newton::{Evaluation, Maximum, maximize};
use crate::clm::{ClmError, ClmFit, clm, fit_of, logistic, softplus};
use crate::distribution::{chi2_upper, t_two_sided};
use crate::matrix::{Cholesky, SymmetricMatrix, dot};

/// Estimates of a proportional-odds model with random subjects and random realizations,
/// and the likelihood-ratio test of its covariate.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossedClmm {
    /// Thresholds and the coefficient.
    pub fit: ClmFit,
    /// Standard deviation between subjects, in logits.
    pub sd_subject: f64,
    /// Standard deviation between realizations, in logits.
    pub sd_realization: f64,
    /// Log-likelihood without the covariate.
    pub null_loglik: f64,
    /// Twice the difference of the log-likelihoods.
    pub chi2: f64,
    /// P(χ²(1) ≥ chi2), which is too small for few realizations.
    pub p_chi2: Option<f64>,
    /// √((q − 2)(e^(chi2/q) − 1)) with the sign of β, for q realizations: the t that has
    /// this likelihood ratio in a balanced Gaussian model.
    pub t: f64,
    /// Two-sided p of t with q − 2 degrees of freedom.
    pub p: Option<f64>,
    /// Thresholds, coefficient and both standard deviations, as the search found them.
    at: Vec<f64>,
    /// The factor of their observed information.
    factor: Cholesky,
}

/// Parameters of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossedParameters {
    /// Rising.
    pub thresholds: Vec<f64>,
    /// Coefficient of the covariate.
    pub beta: f64,
    /// Standard deviation between subjects.
    pub sd_subject: f64,
    /// Standard deviation between realizations.
    pub sd_realization: f64,
}

impl CrossedParameters {
    fn of(at: &[f64]) -> Self {
        let (thresholds, others) = at.split_at(at.len() - 3);
        Self {
            thresholds: thresholds.to_vec(),
            beta: others[0],
            // The likelihood is even in them.
            sd_subject: others[1].abs(),
            sd_realization: others[2].abs(),
        }
    }
}

impl CrossedClmm {
    /// The estimates.
    pub fn estimate(&self) -> CrossedParameters {
        CrossedParameters::of(&self.at)
    }

    /// Parameters of the normal approximation about the estimates, whose covariance is the
    /// inverse of the observed information. `normal` gives standard normal numbers. `None` if
    /// the thresholds do not rise.
    pub fn drawn(&self, mut normal: impl FnMut() -> f64) -> Option<CrossedParameters> {
        let z: Vec<f64> = self.at.iter().map(|_| normal()).collect();
        let moved = self.factor.solve_transposed(&z);
        let at: Vec<f64> = self.at.iter().zip(moved).map(|(x, d)| x + d).collect();
        let found = CrossedParameters::of(&at);
        found.thresholds.is_sorted_by(|a, b| a < b).then_some(found)
    }
}

/// Fits the model with one covariate, whose value is that of the predictor, and without.
///
/// # Errors
/// If the estimates do not exist or were not found, for one subject, or for fewer than
/// three realizations.
pub fn clmm_crossed(table: &CategoryCounts) -> Result<CrossedClmm, ClmError> {
    let fixed = clm(table)?;
    let q = table.realizations_used();
    if table.subjects() < 2 {
        return Err(ClmError::OneSubject);
    }
    if q < 3 || fixed.beta.len() != 1 {
        return Err(ClmError::FewRealizations);
    }
    let t = table.thresholds();
    let full = Model::new(table, true).fit(&fixed, None)?;
    let mut near = full.at.clone();
    near.remove(t);
    // A variance of 0 with the covariate need not be 0 without: there l is flat.
    near[t + 1] = near[t + 1].abs() + full.at[t].abs() / 4.0 + 0.1;
    let null = Model::new(table, false).fit(&fixed, Some(near))?;
    let sd = |i: usize| {
        let sd = full.at[t + i].abs();
        if sd < SMALLEST_SD { 0.0 } else { sd }
    };
    let chi2 = (2.0 * (full.value - null.value)).max(0.0);
    let (q, fit) = (
        q as f64,
        fit_of(table, &full.at, full.value, &full.information)?,
    );
    let size = ((q - 2.0) * (chi2 / q).exp_m1()).sqrt();
    let size = if fit.beta[0] < 0.0 { -size } else { size };
    let factor = Cholesky::definite(&full.information).ok_or(ClmError::NoMaximum)?;
    Ok(CrossedClmm {
        factor,
        at: full.at.clone(),
        sd_subject: sd(1),
        sd_realization: sd(2),
        null_loglik: null.value,
        chi2,
        p_chi2: chi2_upper(chi2, 1.0),
        t: size,
        p: t_two_sided(size, q - 2.0),
        fit,
    })
}

/// The likelihood with or without the covariate.
struct Model<'a> {
    table: &'a CategoryCounts,
    covariate: bool,
    /// The modes of z and then w: where the next search starts.
    modes: Vec<f64>,
    /// The last Hessian, and where it was taken.
    curvature: Option<(Vec<f64>, SymmetricMatrix)>,
}

/// Within this distance in each parameter, in logits, a search keeps the Hessian.
const NEAR: f64 = 0.05;

/// What the terms of a cell sum to.
#[derive(Clone, Copy, Default)]
struct Cell {
    realization: usize,
    /// Σ rₖ, Σ ωₖ, Σ τₖ.
    sums: [f64; 3],
}

impl<'a> Model<'a> {
    fn new(table: &'a CategoryCounts, covariate: bool) -> Self {
        Self {
            table,
            covariate,
            modes: vec![0.0; table.subjects() + table.predictors().len()],
            curvature: None,
        }
    }

    /// Searches from `near`, and from the estimates without random effects at several
    /// scales.
    fn fit(&mut self, fixed: &ClmFit, near: Option<Vec<f64>>) -> Result<Maximum, ClmError> {
        let scales = [(1.0, 0.5), (0.3, 1.5), (3.0, 0.1)];
        let from = |(subject, realization): (f64, f64)| {
            let scale = (1.0 + 0.346 * (subject * subject + realization * realization)).sqrt();
            let beta = fixed.beta.iter().filter(|_| self.covariate);
            let fixed = fixed.thresholds.iter().chain(beta).map(|x| x * scale);
            fixed.chain([subject, realization]).collect::<Vec<f64>>()
        };
        let starts: Vec<Vec<f64>> = near.into_iter().chain(scales.map(from)).collect();
        for start in starts {
            self.modes.fill(0.0);
            self.curvature = None;
            let found = maximize(start, |at| self.evaluate(at));
            if let Some(found) = found.and_then(|found| self.finished(found)) {
                let far = found
                    .at
                    .iter()
                    .rev()
                    .take(2)
                    .any(|sd| sd.abs() > INFINITE_SD);
                return if far {
                    Err(ClmError::SubjectsSeparated)
                } else {
                    Ok(found)
                };
            }
        }
        Err(ClmError::NoMaximum)
    }

    /// A last step of Newton's method, with the Hessian of the maximum. Without the
    /// covariate only the value is used, which is that of the maximum already.
    fn finished(&mut self, found: Maximum) -> Option<Maximum> {
        if !self.covariate {
            return Some(found);
        }
        self.curvature = None;
        let point = self.evaluate(&found.at)?;
        let information = point.hessian.negated();
        let step = Cholesky::definite(&information)?.solve(&point.gradient);
        let at: Vec<f64> = found.at.iter().zip(step).map(|(x, d)| x + d).collect();
        Some(Maximum {
            value: self.gradient(&at)?.0,
            at,
            information,
        })
    }

    /// Value, gradient, and a Hessian that was taken here or near.
    fn evaluate(&mut self, at: &[f64]) -> Option<Evaluation> {
        let (value, gradient) = self.gradient(at)?;
        let near = |(from, _): &&(Vec<f64>, SymmetricMatrix)| {
            let mut moves = from.iter().zip(at);
            moves.all(|(from, at)| (from - at).abs() < NEAR)
        };
        let hessian = match self.curvature.as_ref().filter(near) {
            Some((_, hessian)) => hessian.clone(),
            None => {
                let hessian = self.hessian(at, &gradient)?;
                self.curvature = Some((at.to_vec(), hessian.clone()));
                hessian
            }
        };
        Some(Evaluation {
            value,
            gradient,
            hessian,
        })
    }

    /// The Hessian by differences from the gradient.
    fn hessian(&mut self, at: &[f64], here: &[f64]) -> Option<SymmetricMatrix> {
        const STEP: f64 = 1e-6;
        let mut hessian = SymmetricMatrix::zero(at.len());
        let mut moved = at.to_vec();
        for i in 0..at.len() {
            moved[i] = at[i] + STEP;
            let (_, gradient) = self.gradient(&moved)?;
            moved[i] = at[i];
            for (j, (above, here)) in gradient.iter().zip(here).enumerate() {
                // Each element off the diagonal is added twice.
                let share = if i == j { 1.0 } else { 0.5 };
                hessian.add(i, j, share * (above - here) / STEP);
            }
        }
        Some(hessian)
    }

    /// The approximate log-likelihood and its gradient.
    fn gradient(&mut self, at: &[f64]) -> Option<(f64, Vec<f64>)> {
        let (table, t) = (self.table, self.table.thresholds());
        let (su, sv) = (at[at.len() - 2], at[at.len() - 1]);
        let mut full = at[..t].to_vec();
        full.push(if self.covariate { at[t] } else { 0.0 });
        let mut point = table.spacing(&full, t + 1)?;
        let a = table.linear(&full);
        let (value, cells, inner) = self.mode(&a, su, sv)?;
        let subjects = table.subjects();
        let (z, w) = self.modes.split_at(subjects);
        let value = point.value + value - 0.5 * inner.log_determinant;
        // The leverages h, and the pull of −½ ln|H| on the modes.
        let mut pull = vec![0.0; self.modes.len()];
        let mut leverage = Vec::with_capacity(cells.len());
        let (mut by_u, mut by_v) = (0.0, 0.0);
        for (s, own) in cells.iter().enumerate() {
            let ss = inner.subject(s);
            let mut levers = Vec::with_capacity(own.len());
            for c in own {
                let m = c.realization;
                let (sm, mm) = (inner.cross(s, m), inner.inverse[m][m]);
                let h = su * su * ss + sv * sv * mm + 2.0 * su * sv * sm;
                let [_, omega, tau] = c.sums;
                by_u -= omega * (su * ss + sv * sm);
                by_v -= omega * (sv * mm + su * sm);
                pull[s] += 0.5 * su * h * tau;
                pull[subjects + m] += 0.5 * sv * h * tau;
                levers.push(h);
            }
            leverage.push(levers);
        }
        let lambda = inner.solve(&pull);
        let (lz, lw) = lambda.split_at(subjects);
        let mut weights = vec![0.0; a.len()];
        for (s, terms) in table.by_subject().enumerate() {
            let own = &cells[s];
            let mut place = 0;
            for term in terms {
                let m = term.place / t;
                while own[place].realization != m {
                    place += 1;
                }
                let f = logistic(a[term.place] - su * z[s] - sv * w[m]);
                let omega = term.m * f * (1.0 - f);
                let shift = su * lz[s] + sv * lw[m];
                let weight =
                    term.n - term.m * f - 0.5 * leverage[s][place] * omega * (1.0 - 2.0 * f)
                        + shift * omega;
                weights[term.place] += weight;
                by_u -= z[s] * weight;
                by_v -= w[m] * weight;
            }
            for c in own {
                by_u -= lz[s] * c.sums[0];
                by_v -= lw[c.realization] * c.sums[0];
            }
        }
        table.add_gradient(&weights, &mut point.gradient);
        if !self.covariate {
            point.gradient.truncate(t);
        }
        point.gradient.extend([by_u, by_v]);
        let finite = value.is_finite() && point.gradient.iter().all(|g| g.is_finite());
        finite.then_some((value, point.gradient))
    }

    /// Moves the modes to the maximum of f by Newton's method. Returns f without the
    /// spacing, the cells of each subject, and the factor of H.
    fn mode(&mut self, a: &[f64], su: f64, sv: f64) -> Option<(f64, Vec<Vec<Cell>>, Inner)> {
        let subjects = self.table.subjects();
        let (mut value, mut cells) = self.cells(a, su, sv, &self.modes);
        for _ in 0..100 {
            let inner = Inner::of(&cells, self.table.predictors().len(), su, sv)?;
            let mut slope: Vec<f64> = self.modes.iter().map(|b| -b).collect();
            for (s, own) in cells.iter().enumerate() {
                for c in own {
                    slope[s] -= su * c.sums[0];
                    slope[subjects + c.realization] -= sv * c.sums[0];
                }
            }
            let step = inner.solve(&slope);
            let gain = 0.5 * dot(&step, &slope);
            if !gain.is_finite() {
                return None;
            }
            // The last step squares the remaining error.
            let last = gain < 1e-12 * (1.0 + value.abs());
            let mut share = 1.0;
            loop {
                let next = self.modes.iter().zip(&step).map(|(b, d)| b + share * d);
                let next: Vec<f64> = next.collect();
                let (found, of_next) = self.cells(a, su, sv, &next);
                if last || found >= value || share < 1e-8 {
                    (value, cells, self.modes) = (found, of_next, next);
                    break;
                }
                share *= 0.5;
            }
            if last {
                let inner = Inner::of(&cells, self.table.predictors().len(), su, sv)?;
                return Some((value, cells, inner));
            }
        }
        None
    }

    /// f without the spacing, and the cells of each subject, at given modes.
    fn cells(&self, a: &[f64], su: f64, sv: f64, modes: &[f64]) -> (f64, Vec<Vec<Cell>>) {
        let t = self.table.thresholds();
        let (z, w) = modes.split_at(self.table.subjects());
        let mut value = -0.5 * dot(modes, modes);
        let of_subject = |(s, terms): (usize, &[crate::clm::counts::Term])| {
            let mut own: Vec<Cell> = Vec::new();
            for term in terms {
                let m = term.place / t;
                if own.last().is_none_or(|c| c.realization != m) {
                    own.push(Cell {
                        realization: m,
                        ..Cell::default()
                    });
                }
                let x = a[term.place] - su * z[s] - sv * w[m];
                let f = logistic(x);
                let omega = term.m * f * (1.0 - f);
                value += term.n * x - term.m * softplus(x);
                if let Some(c) = own.last_mut() {
                    c.sums[0] += term.n - term.m * f;
                    c.sums[1] += omega;
                    c.sums[2] += omega * (1.0 - 2.0 * f);
                }
            }
            own
        };
        let cells = self
            .table
            .by_subject()
            .enumerate()
            .map(of_subject)
            .collect();
        (value, cells)
    }
}

/// The inverse of H, by blocks: subjects are diagonal, realizations dense.
struct Inner {
    /// 1/H of each subject.
    diagonal: Vec<f64>,
    /// Of each subject: (realization, element of H).
    beside: Vec<Vec<(usize, f64)>>,
    /// The realizations' block of H⁻¹.
    inverse: Vec<Vec<f64>>,
    log_determinant: f64,
}

impl Inner {
    fn of(cells: &[Vec<Cell>], realizations: usize, su: f64, sv: f64) -> Option<Self> {
        let mut schur = SymmetricMatrix::zero(realizations);
        for m in 0..realizations {
            schur.add(m, m, 1.0);
        }
        let (mut diagonal, mut beside) = (Vec::new(), Vec::new());
        let mut log_determinant = 0.0;
        for own in cells {
            let d = 1.0 + su * su * own.iter().map(|c| c.sums[1]).sum::<f64>();
            let row: Vec<(usize, f64)> = own
                .iter()
                .map(|c| (c.realization, su * sv * c.sums[1]))
                .collect();
            for (i, (c, &(m, x))) in own.iter().zip(&row).enumerate() {
                schur.add(m, m, sv * sv * c.sums[1]);
                for &(k, y) in &row[..=i] {
                    schur.add(m, k, -x * y / d);
                }
            }
            log_determinant += d.ln();
            diagonal.push(1.0 / d);
            beside.push(row);
        }
        let factor = Cholesky::definite(&schur)?;
        log_determinant += factor.log_determinant();
        let column = |m: usize| {
            let mut unit = vec![0.0; realizations];
            unit[m] = 1.0;
            factor.solve(&unit)
        };
        Some(Self {
            diagonal,
            beside,
            inverse: (0..realizations).map(column).collect(),
            log_determinant,
        })
    }

    /// Element (s, m) of H⁻¹, subject and realization.
    fn cross(&self, s: usize, m: usize) -> f64 {
        let sum = |(k, x): &(usize, f64)| x * self.inverse[*k][m];
        -self.diagonal[s] * self.beside[s].iter().map(sum).sum::<f64>()
    }

    /// Diagonal element of H⁻¹ of a subject.
    fn subject(&self, s: usize) -> f64 {
        let sum = |(k, x): &(usize, f64)| x * self.cross(s, *k);
        self.diagonal[s] * (1.0 - self.beside[s].iter().map(sum).sum::<f64>())
    }

    /// H⁻¹b.
    fn solve(&self, b: &[f64]) -> Vec<f64> {
        let subjects = self.diagonal.len();
        let mut rest = b[subjects..].to_vec();
        for (s, row) in self.beside.iter().enumerate() {
            for &(m, x) in row {
                rest[m] -= x * self.diagonal[s] * b[s];
            }
        }
        let w: Vec<f64> = self.inverse.iter().map(|row| dot(row, &rest)).collect();
        let z = self.beside.iter().enumerate().map(|(s, row)| {
            let known: f64 = row.iter().map(|&(m, x)| x * w[m]).sum();
            self.diagonal[s] * (b[s] - known)
        });
        z.chain(w.iter().copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clm::tests::{covariate, derivatives_hold};

    const CELLS: [(u32, u32, &[u32]); 11] = [
        (0, 0, &[0, 1, 1]),
        (0, 1, &[0, 1, 2]),
        (0, 2, &[0, 2]),
        (0, 3, &[1]),
        (1, 0, &[1, 2]),
        (1, 1, &[2, 3, 3]),
        (1, 3, &[2, 3, 3]),
        (2, 0, &[3, 3, 1]),
        (2, 1, &[3, 3]),
        (2, 2, &[2, 3]),
        (2, 3, &[0, 3]),
    ];

    fn table() -> CategoryCounts {
        covariate(&[-1.0, 0.3, 0.3, 1.0], 4, &CELLS)
    }

    /// Also at and beyond σ = 0, where the likelihood is even.
    #[test]
    fn the_gradient_is_that_of_the_likelihood() {
        let table = table();
        for (su, sv) in [(0.9, 0.6), (2.0, 0.0), (-0.5, 1.5)] {
            let mut model = Model::new(&table, true);
            let at = [-1.2, 0.3, 1.7, 0.8, su, sv];
            derivatives_hold(&at, 1e-5, |at| model.evaluate(at));
        }
    }

    /// At the mode, −½ ln|H| with H formed whole.
    #[test]
    fn the_blocks_are_those_of_the_whole_matrix() {
        let table = table();
        let (su, sv) = (0.9, 0.6);
        let mut model = Model::new(&table, true);
        let a = table.linear(&[-1.2, 0.3, 1.7, 0.8]);
        let (_, cells, inner) = model.mode(&a, su, sv).unwrap();
        let mut whole = SymmetricMatrix::zero(7);
        (0..7).for_each(|i| whole.add(i, i, 1.0));
        for (s, own) in cells.iter().enumerate() {
            for c in own {
                let mut d = [0.0; 7];
                (d[s], d[3 + c.realization]) = (su, sv);
                whole.add_outer(c.sums[1], &d);
            }
        }
        let factor = Cholesky::definite(&whole).unwrap();
        assert!((factor.log_determinant() - inner.log_determinant).abs() < 1e-12);
        let b = [1.0, -2.0, 0.5, 0.3, 2.0, -1.0, 0.7];
        for (x, y) in factor.solve(&b).iter().zip(inner.solve(&b)) {
            assert!((x - y).abs() < 1e-12, "{x} {y}");
        }
    }

    #[test]
    fn too_small_tables_have_a_reason() {
        let two = covariate(&[-1.0, 1.0], 3, &[(0, 0, &[0, 1, 2]), (1, 1, &[0, 1, 2])]);
        assert_eq!(clmm_crossed(&two), Err(ClmError::FewRealizations));
        let one = covariate(
            &[-1.0, 0.0, 1.0],
            2,
            &[(0, 0, &[0, 1]), (0, 1, &[0, 1]), (0, 2, &[1, 0])],
        );
        assert_eq!(clmm_crossed(&one), Err(ClmError::OneSubject));
    }
}
