//! Bayes factors of a correlation and of a one-sample t.

use super::finite;
use statrs::function::gamma::ln_gamma;

/// Bayes factor BF₁₀ of a correlation r of n pairs against no correlation, with a flat
/// prior on (−1, 1) (Ly, Verhagen & Wagenmakers 2016, κ = 1):
/// √π/2 · Γ((n+1)/2)/Γ((n+2)/2) · ₂F₁((n−1)/2, (n−1)/2; (n+2)/2; r²).
///
/// By Euler's transformation ₂F₁ is (1−r²)^((4−n)/2) ₂F₁(3/2, 3/2; (n+2)/2; r²),
/// whose series has only positive terms. `None` for fewer than three pairs, for |r| = 1
/// or if it overflows.
pub fn correlation_bf10(r: f64, n: usize) -> Option<f64> {
    let z = r * r;
    if n < 3 || 1.0 - z < 1e-10 {
        return None;
    }
    let n = n as f64;
    let c = (n + 2.0) / 2.0;
    let (mut term, mut series) = (1.0f64, 1.0f64);
    for k in 0..10_000_000u32 {
        let k = f64::from(k);
        term *= (1.5 + k) * (1.5 + k) / ((c + k) * (1.0 + k)) * z;
        series += term;
        if term <= 1e-17 * series {
            break;
        }
    }
    let log = std::f64::consts::PI.ln() / 2.0 - 2f64.ln() + ln_gamma((n + 1.0) / 2.0)
        - ln_gamma((n + 2.0) / 2.0)
        + (4.0 - n) / 2.0 * (1.0 - z).ln()
        + series.ln();
    finite(log.exp())
}

/// JZS Bayes factor BF₁₀ of a one-sample t of n numbers (Rouder et al. 2009), with the
/// scale s = `scale` of the Cauchy prior and ν = n − 1:
/// ∫₀^∞ (1+ngs²)^(−½) (1 + t²/((1+ngs²)ν))^(−(ν+1)/2) (2π)^(−½) g^(−3/2) e^(−1/(2g)) dg
/// over (1 + t²/ν)^(−(ν+1)/2).
///
/// With g = eᵘ the integrand is smooth and decreases on both sides faster than any
/// power; there the trapezoidal rule converges faster than any power of its step.
/// `None` for fewer than two numbers or if it overflows.
///
/// ```
/// # use study_stats::bayes::jzs_bf10;
/// // t = 0 speaks for no difference, the more so with more participants.
/// assert!(jzs_bf10(0.0, 100, 0.707) < jzs_bf10(0.0, 20, 0.707));
/// assert!(jzs_bf10(0.0, 20, 0.707) < Some(1.0 / 3.0));
/// ```
pub fn jzs_bf10(t: f64, n: usize, scale: f64) -> Option<f64> {
    if n < 2 || !t.is_finite() {
        return None;
    }
    let n = n as f64;
    let df = n - 1.0;
    let null = -(df + 1.0) / 2.0 * (t * t / df).ln_1p();
    let step = 0.02;
    let mut total = 0.0;
    for i in -400..=3500 {
        let u = f64::from(i) * step;
        let g = u.exp();
        let wide = n * g * scale * scale;
        let log = -0.5 * wide.ln_1p()
            - (df + 1.0) / 2.0 * (t * t / ((1.0 + wide) * df)).ln_1p()
            - 0.5 * (2.0 * std::f64::consts::PI).ln()
            - 0.5 * u
            - 0.5 / g;
        total += (log - null).exp();
    }
    finite(total * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10.634 for r = 0.6, n = 20, from the documentation of pingouin's
    /// `bayesfactor_pearson`.
    #[test]
    fn the_correlation_factor_agrees_with_a_published_one() {
        let bf = correlation_bf10(0.6, 20).unwrap();
        assert!((bf - 10.634).abs() < 0.001, "{bf}");
    }

    #[test]
    fn a_perfect_correlation_has_no_finite_factor() {
        assert_eq!(correlation_bf10(1.0, 5), None);
        assert!(jzs_bf10(f64::INFINITY, 5, 0.707).is_none());
    }
}
