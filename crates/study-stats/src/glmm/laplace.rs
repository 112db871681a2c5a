//! Laplace's approximation of the likelihood, and its gradient.
//!
//! In the terms of [`super`], with Λ the diagonal matrix of the standard deviations θ, rᵢ, wᵢ = −∂rᵢ/∂η
//! and tᵢ = ∂wᵢ/∂η the derivatives of ln p in the linear predictor of row i, zᵢ the levels of the row,
//! H = I + ΛZᵀWZΛ, hᵢ = zᵢᵀΛH⁻¹Λzᵢ and λ = H⁻¹ΛZᵀ(½ h∘t), implicit differentiation at the mode gives
//!
//! ```text
//! ∂/∂β   = Xᵀa,   a = r − ½ h∘t + w∘ZΛλ
//! ∂/∂θ_f = Σᵢ (û a − λ r − w H⁻¹Λzᵢ)  at the row's level of f
//! ∂/∂ln ν = ∂ln p/∂ln ν − ½ Σ hᵢwᵢ − λᵀû   (gamma, shape ν).
//! ```

use super::data::{GlmmData, Row};
use super::family::Term;
use super::sparse::{Elements, Factor};
use crate::matrix::dot;

/// The likelihood, with the modes from which the next search starts.
pub(super) struct Laplace<'a> {
    data: &'a GlmmData,
    modes: Vec<f64>,
}

impl<'a> Laplace<'a> {
    pub(super) fn new(data: &'a GlmmData) -> Self {
        Self {
            data,
            modes: vec![0.0; data.owner.len()],
        }
    }

    /// The approximate log-likelihood and its gradient; `None` if the parameters are not
    /// admissible, or the modes are not found.
    pub(super) fn gradient(&mut self, at: &[f64]) -> Option<(f64, Vec<f64>)> {
        let data = self.data;
        let (beta, sd, shape) = data.parts(at);
        let sds = Sds::of(data, sd);
        let fixed: Vec<f64> = data.rows.iter().map(|row| dot(&row.x, beta)).collect();
        let (value, terms, factor) = self.mode(&fixed, &sds, shape)?;
        let (common, by_shape) = data.common(shape);
        let value = common + value - 0.5 * factor.log_determinant();
        let inverse = factor.inverse();
        // The leverages h, and the pull of −½ ln|H| on the modes.
        let mut pull = vec![0.0; self.modes.len()];
        let mut leverage = Vec::with_capacity(terms.len());
        let mut by_sd = vec![0.0; sd.len()];
        for (row, term) in data.rows.iter().zip(&terms) {
            let across = across(row, &sds, &inverse);
            let own = sds.times(row, |i, _| across[i]);
            for ((&place, &f), across) in row.levels.iter().zip(&data.order).zip(&across) {
                pull[place] += 0.5 * sds.own[place] * own * term.slope;
                by_sd[f] -= term.weight * across;
            }
            leverage.push(own);
        }
        let lambda = factor.solve(&pull);
        let mut by_beta = vec![0.0; beta.len()];
        let (mut of_values, mut of_leverage) = (0.0, 0.0);
        for ((row, term), h) in data.rows.iter().zip(&terms).zip(&leverage) {
            let shift = sds.times(row, |_, place| lambda[place]);
            let a = term.score - 0.5 * h * term.slope + term.weight * shift;
            for (g, x) in by_beta.iter_mut().zip(&row.x) {
                *g += a * x;
            }
            for (&place, &f) in row.levels.iter().zip(&data.order) {
                by_sd[f] += self.modes[place] * a - lambda[place] * term.score;
            }
            of_values += term.value;
            of_leverage += h * term.weight;
        }
        let mut gradient = by_beta;
        gradient.extend(by_sd);
        if gradient.len() < at.len() {
            let by_modes = dot(&lambda, &self.modes);
            gradient.push(by_shape + of_values - 0.5 * of_leverage - by_modes);
        }
        let finite = value.is_finite() && gradient.iter().all(|g| g.is_finite());
        finite.then_some((value, gradient))
    }

    /// Moves the modes to the maximum of f by Newton's method. Returns f without what is common to
    /// all rows, the term of each row, and the factor of H.
    fn mode(
        &mut self,
        fixed: &[f64],
        sds: &Sds,
        shape: f64,
    ) -> Option<(f64, Vec<Term>, Factor<'a>)> {
        let mut here = self.terms(fixed, sds, shape, &self.modes);
        if !here.0.is_finite() {
            self.modes.fill(0.0);
            here = self.terms(fixed, sds, shape, &self.modes);
        }
        let (mut value, mut terms) = here;
        if !value.is_finite() {
            return None;
        }
        for _ in 0..100 {
            let factor = self.factor(&terms, sds)?;
            let mut slope: Vec<f64> = self.modes.iter().map(|u| -u).collect();
            for (row, term) in self.data.rows.iter().zip(&terms) {
                for &place in &row.levels {
                    slope[place] += sds.own[place] * term.score;
                }
            }
            let step = factor.solve(&slope);
            let gain = 0.5 * dot(&step, &slope);
            if !gain.is_finite() {
                return None;
            }
            // The last step squares the remaining error.
            let last = gain < 1e-12 * (1.0 + value.abs());
            let mut share = 1.0;
            loop {
                let next = self.modes.iter().zip(&step).map(|(u, d)| u + share * d);
                let next: Vec<f64> = next.collect();
                let (found, of_next) = self.terms(fixed, sds, shape, &next);
                if last || found >= value || share < 1e-8 {
                    (value, terms, self.modes) = (found, of_next, next);
                    break;
                }
                share *= 0.5;
            }
            if last {
                let factor = self.factor(&terms, sds)?;
                return Some((value, terms, factor));
            }
        }
        None
    }

    /// f without what is common to all rows, and the term of each row, at these modes.
    fn terms(&self, fixed: &[f64], sds: &Sds, shape: f64, modes: &[f64]) -> (f64, Vec<Term>) {
        let family = self.data.family;
        let rows = self.data.rows.iter().zip(fixed);
        let terms: Vec<Term> = rows
            .map(|(row, eta)| {
                let eta = eta + sds.times(row, |_, place| modes[place]);
                family.term(row.sums, eta, shape)
            })
            .collect();
        let value: f64 = terms.iter().map(|term| term.value).sum();
        (value - 0.5 * dot(modes, modes), terms)
    }

    /// The factor of H.
    fn factor(&self, terms: &[Term], sds: &Sds) -> Option<Factor<'a>> {
        let data = self.data;
        let mut h = data.pattern.unit();
        for (row, term) in data.rows.iter().zip(terms) {
            let mut pairs = row.pairs.iter();
            for (i, &place) in row.levels.iter().enumerate() {
                let own = sds.own[place] * term.weight;
                h.diagonal[place] += own * sds.own[place];
                for (&before, &element) in row.levels[..i].iter().zip(&mut pairs) {
                    h.below[element] += own * sds.own[before];
                }
            }
        }
        data.pattern.factor(h)
    }
}

/// The standard deviation of each place.
struct Sds {
    own: Vec<f64>,
}

impl Sds {
    fn of(data: &GlmmData, sd: &[f64]) -> Self {
        Self {
            own: data.owner.iter().map(|&f| sd[f]).collect(),
        }
    }

    /// Σ θ x over the levels of a row; x of the number of the level in the row, and its place.
    fn times(&self, row: &Row, x: impl Fn(usize, usize) -> f64) -> f64 {
        let levels = row.levels.iter().enumerate();
        levels
            .map(|(i, &place)| self.own[place] * x(i, place))
            .sum()
    }
}

/// H⁻¹Λz at the levels of a row.
fn across(row: &Row, sds: &Sds, inverse: &Elements) -> Vec<f64> {
    let own = |&place: &usize| inverse.diagonal[place] * sds.own[place];
    let mut sums: Vec<f64> = row.levels.iter().map(own).collect();
    let mut pairs = row.pairs.iter();
    for i in 0..row.levels.len() {
        for (j, &element) in (0..i).zip(&mut pairs) {
            sums[i] += inverse.below[element] * sds.own[row.levels[j]];
            sums[j] += inverse.below[element] * sds.own[row.levels[i]];
        }
    }
    sums
}
