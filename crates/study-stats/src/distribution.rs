//! Tails and quantiles of the normal, t, F and χ² distributions.
//!
//! Tail probabilities are the regularized incomplete beta and gamma functions of
//! `statrs`, always evaluated for the smaller tail, so that a p of 10⁻²⁰ keeps its
//! digits; the normal tail is `libm::erfc`, because `statrs` has only 11 digits there.
//! Quantiles are roots of the tail probabilities: the inverses of `statrs` are reported
//! to be inaccurate in the tails (t with one degree of freedom at 10⁻¹⁰ by 97 %).

use super::finite;
use statrs::function::{beta::checked_beta_reg, gamma::checked_gamma_ur};
use std::f64::consts::{PI, SQRT_2};

/// P(Z > z) for the standard normal Z.
pub fn normal_upper(z: f64) -> f64 {
    0.5 * libm::erfc(z / SQRT_2)
}

/// The density of the standard normal distribution at z.
pub fn normal_density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// P(Z ≤ z) for the standard normal Z.
pub fn normal_cdf(z: f64) -> f64 {
    normal_upper(-z)
}

/// The z with P(Z ≤ z) = p for the standard normal Z. `None` unless 0 < p < 1.
///
/// ```
/// # use study_stats::distribution::normal_quantile;
/// assert_eq!(format!("{:.6}", normal_quantile(0.975).unwrap()), "1.959964");
/// ```
pub fn normal_quantile(p: f64) -> Option<f64> {
    if !(p > 0.0 && p < 1.0) {
        return None;
    }
    // Search in the smaller tail, which has full relative precision.
    let (tail, sign) = if p < 0.5 { (p, -1.0) } else { (1.0 - p, 1.0) };
    let (mut low, mut high) = (0.0, 40.0);
    let mut z = (-2.0 * tail.ln()).sqrt().min(39.0);
    for _ in 0..200 {
        let error = normal_upper(z) - tail;
        if error > 0.0 {
            low = z;
        } else {
            high = z;
        }
        let newton = z + error / normal_density(z);
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - z).abs() <= 1e-16 * next.abs() {
            break;
        }
        z = next;
    }
    Some(sign * z)
}

/// P(T > t) for Student's T with ν = `df` degrees of freedom:
/// I(ν/(ν + t²); ν/2, ½)/2 for t ≥ 0. `None` unless `df` > 0 and t is finite.
pub fn t_upper(t: f64, df: f64) -> Option<f64> {
    if !(df > 0.0 && t.is_finite()) {
        return None;
    }
    let half = 0.5 * beta_of(df / 2.0, 0.5, df, t * t)?;
    Some(if t >= 0.0 { half } else { 1.0 - half })
}

/// P(|T| ≥ |t|) for Student's T. `None` unless `df` > 0 and t is finite.
pub fn t_two_sided(t: f64, df: f64) -> Option<f64> {
    if !(df > 0.0 && t.is_finite()) {
        return None;
    }
    beta_of(df / 2.0, 0.5, df, t * t)
}

/// P(F > f) for F with d₁ and d₂ degrees of freedom: I(d₂/(d₂ + d₁f); d₂/2, d₁/2).
/// `None` unless both are above 0 and f is finite.
pub fn f_upper(f: f64, df1: f64, df2: f64) -> Option<f64> {
    if !(df1 > 0.0 && df2 > 0.0 && f.is_finite()) {
        return None;
    }
    if f <= 0.0 {
        return Some(1.0);
    }
    beta_of(df2 / 2.0, df1 / 2.0, df2, df1 * f)
}

/// P(X > x) for χ² with `df` degrees of freedom. `None` unless `df` > 0 and x is finite.
///
/// ```
/// # use study_stats::distribution::chi2_upper;
/// assert_eq!(format!("{:.4}", chi2_upper(3.841459, 1.0).unwrap()), "0.0500");
/// ```
pub fn chi2_upper(x: f64, df: f64) -> Option<f64> {
    if !(df > 0.0 && x.is_finite()) {
        return None;
    }
    if x <= 0.0 {
        return Some(1.0);
    }
    checked_gamma_ur(df / 2.0, x / 2.0).ok().and_then(finite)
}

/// I(p/(p + q); a, b), evaluated at the smaller of p/(p + q) and its complement.
fn beta_of(a: f64, b: f64, p: f64, q: f64) -> Option<f64> {
    let x = p / (p + q);
    let value = if x <= 0.5 {
        checked_beta_reg(a, b, x).ok()?
    } else {
        1.0 - checked_beta_reg(b, a, q / (p + q)).ok()?
    };
    // Where 1 − I cancels, the direct form is more accurate.
    let value = if x > 0.5 && value < 1e-3 {
        checked_beta_reg(a, b, x).ok()?
    } else {
        value
    };
    finite(value).map(|v| v.clamp(0.0, 1.0))
}

/// The t with P(T ≤ t) = p for Student's T. `None` unless 0 < p < 1 and `df` > 0.
///
/// ```
/// # use study_stats::distribution::t_quantile;
/// assert_eq!(format!("{:.3}", t_quantile(0.975, 10.0).unwrap()), "2.228");
/// ```
pub fn t_quantile(p: f64, df: f64) -> Option<f64> {
    if !(p > 0.0 && p < 1.0 && df > 0.0) {
        return None;
    }
    let (tail, sign) = if p < 0.5 { (p, -1.0) } else { (1.0 - p, 1.0) };
    let root = root_of_tail(tail, |t| t_upper(t, df))?;
    Some(sign * root)
}

/// The f with P(F ≤ f) = p. `None` unless 0 < p < 1 and both degrees of freedom are
/// above 0.
pub fn f_quantile(p: f64, df1: f64, df2: f64) -> Option<f64> {
    if !(p > 0.0 && p < 1.0 && df1 > 0.0 && df2 > 0.0) {
        return None;
    }
    root_of_tail(1.0 - p, |f| f_upper(f, df1, df2))
}

/// The x ≥ 0 at which a decreasing tail probability has the value `target`: bracketed
/// by doubling, then the Illinois variant of regula falsi on the logarithms, with
/// bisection as the fallback.
pub(super) fn root_of_tail(target: f64, tail: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let error = |x: f64| tail(x).map(|v| v.ln() - target.ln());
    let mut at_low = error(0.0)?;
    if at_low <= 0.0 {
        return Some(0.0);
    }
    let (mut low, mut high) = (0.0, 1.0);
    let mut at_high = error(high)?;
    while at_high > 0.0 {
        (low, at_low) = (high, at_high);
        high *= 2.0;
        if high > 1e300 {
            return None;
        }
        at_high = error(high)?;
    }
    for _ in 0..200 {
        let secant = (low * at_high - high * at_low) / (at_high - at_low);
        let middle = if secant > low && secant < high {
            secant
        } else {
            0.5 * (low + high)
        };
        let at = error(middle)?;
        if at == 0.0 {
            return Some(middle);
        }
        if at > 0.0 {
            if (middle - low).abs() <= 4e-16 * middle {
                return Some(middle);
            }
            (low, at_low) = (middle, at);
            at_high *= 0.5;
        } else {
            if (high - middle).abs() <= 4e-16 * middle {
                return Some(middle);
            }
            (high, at_high) = (middle, at);
            at_low *= 0.5;
        }
        if high - low <= 4e-16 * high {
            break;
        }
    }
    Some(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} is not {b}");
    }

    /// Values of printed tables. `tests/analyze/golden.rs` of the repository compares
    /// with independent programs.
    #[test]
    fn tails_and_quantiles_agree_with_tables() {
        close(t_quantile(0.975, 9.0).unwrap(), 2.262157162798205, 1e-12);
        close(t_quantile(0.975, 1.0).unwrap(), 12.70620473617471, 1e-12);
        close(t_two_sided(2.262157162798205, 9.0).unwrap(), 0.05, 1e-12);
        close(
            f_quantile(0.95, 4.0, 36.0).unwrap(),
            2.633532094011204,
            1e-9,
        );
        close(normal_quantile(0.975).unwrap(), 1.959963984540054, 1e-15);
        close(normal_quantile(0.025).unwrap(), -1.959963984540054, 1e-14);
        close(chi2_upper(3.841458820694124, 1.0).unwrap(), 0.05, 1e-12);
    }

    /// t with one degree of freedom is Cauchy, with the quantile −cot(πp).
    #[test]
    fn the_t_quantile_is_accurate_far_in_the_tail() {
        let exact = -1.0 / (PI * 1e-10f64).tan();
        close(t_quantile(1e-10, 1.0).unwrap(), exact, 1e-9);
    }

    #[test]
    fn arguments_outside_the_domain_give_none() {
        assert_eq!(t_quantile(0.975, 0.0), None);
        assert_eq!(t_two_sided(f64::NAN, 3.0), None);
        assert_eq!(f_upper(f64::INFINITY, 1.0, 1.0), None);
        assert_eq!(normal_quantile(1.0), None);
    }
}
