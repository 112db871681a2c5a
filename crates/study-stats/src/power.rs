//! Power of t tests, and the smallest effect that a design finds.
//!
//! If an effect is not zero, its t is noncentral t: with Z ~ N(δ, 1) and u = √(χ²(ν)/ν)
//! independent of it, P(|Z| > t(1 − α/2, ν)·u). The realizations are the units of a
//! slope: with the covariate standardized over q realizations (Σx² = q) and the scatter
//! V of their observed means about the line, δ = slope·√(q/V) and ν = q − 2. For a
//! mean difference over n subjects, δ = d√n and ν = n − 1.
//!
//! [`covariate`] has the design of subjects × realizations × repetitions, [`two_conditions`]
//! the designs of Westfall, Kenny and Judd.

pub mod covariate;
pub mod two_conditions;

use super::distribution::{normal_upper, root_of_tail, t_quantile};
use statrs::function::gamma::ln_gamma;

/// The probability that a two-sided t test with `df` degrees of freedom rejects at
/// `alpha`, if its t has the noncentrality `ncp`. `None` unless `df` > 0, 0 < `alpha` < 1
/// and `ncp` is finite.
pub fn power(ncp: f64, df: f64, alpha: f64) -> Option<f64> {
    if !(ncp.is_finite() && alpha > 0.0 && alpha < 1.0) {
        return None;
    }
    let critical = t_quantile(1.0 - alpha / 2.0, df)?;
    Some(Scale::of(df).rejected(ncp, critical))
}

/// Nodes and weights of Gauss–Legendre quadrature on (−1, 1), the half with x ≥ 0.
const RULE: [(f64, f64); 3] = [
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// Intervals on which the rule is applied.
const PANELS: usize = 60;

/// P(Z > z) is below 10⁻²⁰ from here on, which changes no probability in double precision.
const OUTSIDE: f64 = 9.3;

/// A node with a smaller weight does not either.
const NEGLIGIBLE: f64 = 1e-20;

/// u = √(χ²(ν)/ν): values with the probabilities that stand for its density.
struct Scale(Vec<(f64, f64)>);

impl Scale {
    fn of(df: f64) -> Self {
        // The density is below 10⁻¹⁶ outside.
        let reach = 9.0 / (2.0 * df).sqrt();
        let (low, high) = ((1.0 - reach).max(0.0), 1.0 + 1.3 * reach);
        let half = (high - low) / (2 * PANELS) as f64;
        let ln_scale = 2f64.ln() + df / 2.0 * (df / 2.0).ln() - ln_gamma(df / 2.0);
        let density = |u: f64| (ln_scale + (df - 1.0) * u.ln() - df * u * u / 2.0).exp();
        let node = |u: f64, w: f64| (u, half * w * density(u));
        let panel = |i: usize| {
            let middle = low + half * (2 * i + 1) as f64;
            RULE.iter().flat_map(move |&(x, w)| {
                let other = (x != 0.0).then(|| node(middle - half * x, w));
                [Some(node(middle + half * x, w)), other]
            })
        };
        let nodes = (0..PANELS).flat_map(panel).flatten();
        Self(nodes.filter(|(_, weight)| *weight > NEGLIGIBLE).collect())
    }

    /// The mean of `g(u)`.
    fn average(&self, g: impl Fn(f64) -> f64) -> f64 {
        self.0.iter().map(|&(u, weight)| g(u) * weight).sum()
    }

    /// ∫ f(u) P(|Z + δ| > cu) du over the density f of u.
    fn rejected(&self, ncp: f64, critical: f64) -> f64 {
        let upper = |z: f64| if z < OUTSIDE { normal_upper(z) } else { 0.0 };
        let at = |u: f64| upper(critical * u - ncp) + upper(critical * u + ncp);
        self.average(at).clamp(0.0, 1.0)
    }
}

/// The smallest noncentrality with this power. `None` unless `alpha` < `target` < 1.
pub fn detectable(target: f64, df: f64, alpha: f64) -> Option<f64> {
    if !(alpha > 0.0 && target > alpha && target < 1.0) {
        return None;
    }
    let critical = t_quantile(1.0 - alpha / 2.0, df)?;
    let scale = Scale::of(df);
    let missed = |ncp: f64| Some(1.0 - scale.rejected(ncp, critical));
    root_of_tail(1.0 - target, missed)
}

/// The smallest correlation between a covariate and the observed means of `n`
/// realizations that is found with this power: δ/√(n + δ²). `None` for fewer than three
/// realizations, and as for [`detectable`].
pub fn detectable_correlation(n: usize, target: f64, alpha: f64) -> Option<f64> {
    let ncp = detectable(target, (n as f64) - 2.0, alpha).filter(|_| n > 2)?;
    Some(ncp / (n as f64 + ncp * ncp).sqrt())
}

/// The smallest mean difference, in standard deviations of the differences (Cohen's
/// d_z), that `n` subjects show with this power: δ/√n. `None` for fewer than two
/// subjects, and as for [`detectable`].
///
/// ```
/// # use study_stats::power::detectable_difference;
/// // What G*Power calls d_z with 34 subjects, power .80 and α = .05.
/// assert_eq!(format!("{:.1}", detectable_difference(34, 0.8, 0.05).unwrap()), "0.5");
/// ```
pub fn detectable_difference(n: usize, target: f64, alpha: f64) -> Option<f64> {
    let ncp = detectable(target, n as f64 - 1.0, alpha).filter(|_| n > 1)?;
    Some(ncp / (n as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SciPy 1.17 `nct` and R 4.2.2 `pt(…, ncp)`, which agree to 3·10⁻¹².
    #[test]
    fn power_agrees_with_the_noncentral_t() {
        for (df, ncp, alpha, expected) in [
            (1.0, 5.720_775_535_473_553, 0.05, 0.346_457_878_918_592_7),
            (3.0, 3.133_169_948_582_676, 0.05, 0.565_498_111_945_611_3),
            (3.0, 3.707_604_929_176_037, 0.05, 0.696_841_782_999_728_2),
            (3.0, 0.0, 0.05, 0.05),
            (6.0, -2.638_286_725_234_307, 0.05, 0.598_135_322_885_535_7),
            (6.0, 3.881_979_835_323_783, 0.01, 0.596_230_931_549_434_2),
            (10.0, 2.412_090_756_622_109_5, 0.05, 0.586_150_670_007_420_8),
            (18.0, 2.906_591_794_880_898_6, 0.05, 0.784_867_722_294_386_6),
            (18.0, 22.156_468_376_279_886, 0.05, 1.0),
        ] {
            let found = power(ncp, df, alpha).unwrap();
            assert!(
                (found - expected).abs() < 1e-8,
                "{df} {ncp}: {found}, {expected}"
            );
        }
    }

    /// The same sources, by bisection.
    #[test]
    fn the_detectable_correlation_agrees_with_its_reference() {
        for (n, expected) in [
            (5, 0.885_250_513_758_088_3),
            (8, 0.765_678_498_033_690_8),
            (12, 0.668_047_625_318_888_5),
            (20, 0.552_277_880_221_977_9),
        ] {
            let found = detectable_correlation(n, 0.8, 0.05).unwrap();
            assert!((found - expected).abs() < 1e-8, "{n}: {found}");
        }
        assert_eq!(detectable_correlation(2, 0.8, 0.05), None);
    }

    /// R 4.2.2: `power.t.test(n = 10, power = .8, type = "paired", strict = TRUE)`.
    #[test]
    fn the_detectable_difference_agrees_with_r() {
        let found = detectable_difference(10, 0.8, 0.05).unwrap();
        assert!((found - 0.996_001_371_455).abs() < 1e-9, "{found}");
        assert_eq!(detectable_difference(1, 0.8, 0.05), None);
        assert_eq!(detectable(0.05, 9.0, 0.05), None);
    }
}
