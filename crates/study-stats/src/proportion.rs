//! The share of trials with some property: clustered in subjects, or independent.

use super::distribution::{f_quantile, normal_quantile, t_quantile};
use super::finite;

/// A share with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// Hits over trials.
    pub share: f64,
    /// Number of independent trials that would be equally informative.
    pub n_effective: f64,
    /// Wilson's interval (1927) with the effective number; `None` for one cluster.
    pub ci95: Option<(f64, f64)>,
}

/// The share of hits over clusters (hits, trials), such as subjects, that are the
/// sampling units. Its variance is that of a ratio over S clusters,
/// v = S/(S−1) Σ(hᵢ − p nᵢ)²/N² (Cochran 1977, §6.3). The effective number of trials is
/// p(1 − p)/v, at most N (Korn & Graubard 1998), or S where all clusters agree, because
/// v = 0 does not mean certainty. Wilson's interval uses t(.975, S−1) in place of z.
/// `None` without trials.
pub fn share(clusters: &[(f64, f64)]) -> Option<Share> {
    let clusters = || clusters.iter().filter(|c| c.1 > 0.0);
    let trials: f64 = clusters().map(|c| c.1).sum();
    let s = clusters().count() as f64;
    let p = finite(clusters().map(|c| c.0).sum::<f64>() / trials)?;
    let squares: f64 = clusters().map(|(h, n)| (h - p * n).powi(2)).sum();
    let variance = s / (s - 1.0) * squares / (trials * trials);
    let n_effective = if variance > 1e-24 && p * (1.0 - p) > 0.0 {
        (p * (1.0 - p) / variance).min(trials)
    } else {
        s
    };
    let ci95 = t_quantile(0.975, s - 1.0).map(|t| interval(p, n_effective, t));
    Some(Share {
        share: p,
        n_effective,
        ci95,
    })
}

/// The exact interval of a probability with this coverage, from `hits` of `trials`
/// independent trials (Clopper & Pearson 1934), by quantiles of F. `None` without trials,
/// for more hits than trials, or a `level` outside (0, 1).
///
/// ```
/// # use study_stats::proportion::clopper_pearson;
/// // No hit in 20 trials.
/// let (low, high) = clopper_pearson(0, 20, 0.95).unwrap();
/// assert_eq!((low, format!("{high:.3}")), (0.0, "0.168".into()));
/// ```
pub fn clopper_pearson(hits: u64, trials: u64, level: f64) -> Option<(f64, f64)> {
    if trials == 0 || hits > trials || !(level > 0.0 && level < 1.0) {
        return None;
    }
    let tail = (1.0 - level) / 2.0;
    let (x, rest) = (hits as f64, (trials - hits) as f64);
    // The smallest probability with which as many hits are still as likely as `tail`.
    let low = |x: f64, rest: f64| {
        let f = f_quantile(tail, 2.0 * x, 2.0 * (rest + 1.0))?;
        Some(x * f / (rest + 1.0 + x * f))
    };
    let at_least = if hits == 0 { 0.0 } else { low(x, rest)? };
    let at_most = if hits == trials {
        1.0
    } else {
        1.0 - low(rest, x)?
    };
    Some((at_least, at_most))
}

/// Wilson's 95 % interval (1927) of `hits` of `n` independent trials. `None` unless
/// 0 ≤ hits ≤ n and n > 0.
pub fn wilson(hits: f64, n: f64) -> Option<(f64, f64)> {
    let valid = n > 0.0 && hits >= 0.0 && hits <= n;
    let z = normal_quantile(0.975).filter(|_| valid)?;
    Some(interval(hits / n, n, z))
}

/// Wilson's interval of a share of n trials, with `z` standard errors.
fn interval(share: f64, n: f64, z: f64) -> (f64, f64) {
    let z2 = z * z;
    let center = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = z / (1.0 + z2 / n) * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
    ((center - half).max(0.0), (center + half).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R 4.2.2 `binom.test` and SciPy 1.17 `beta.ppf`, which agree to 3·10⁻¹².
    #[test]
    fn the_exact_interval_agrees_with_two_programs() {
        for (hits, trials, low, high) in [
            (0, 1000, 0.0, 0.003_682_083_896_865_671),
            (
                1,
                1000,
                2.531_748_749_129_406_5e-5,
                0.005_558_924_279_826_672,
            ),
            (503, 1000, 0.471_540_875_022_665_9, 0.534_441_416_228_922_7),
            (1000, 1000, 0.996_317_916_103_134_4, 1.0),
            (
                8017,
                10_000,
                0.793_747_867_057_449_9,
                0.809_476_038_003_954_3,
            ),
        ] {
            let found = clopper_pearson(hits, trials, 0.95).unwrap();
            assert!((found.0 - low).abs() < 1e-9, "{hits}: {found:?}");
            assert!((found.1 - high).abs() < 1e-9, "{hits}: {found:?}");
        }
        assert_eq!(clopper_pearson(1, 0, 0.95), None);
        assert_eq!(clopper_pearson(2, 1, 0.95), None);
    }

    #[test]
    fn repeated_identical_trials_count_once() {
        // Five subjects with three hits and five with none, three trials each.
        let clusters = [(3.0, 3.0); 5].iter().chain(&[(0.0, 3.0); 5]).copied();
        let found = share(&clusters.collect::<Vec<_>>()).unwrap();
        // v = 10/9 · 10 · 2.25/900 = 1/36, p(1−p)/v = 9.
        assert!((found.n_effective - 9.0).abs() < 1e-12);
        let (low, high) = found.ci95.unwrap();
        assert!(low > 0.15 && low < 0.25 && (low + high - 1.0).abs() < 1e-12);
        // Clusters that are more alike than by chance are no more than their trials.
        let alike = [(5.0, 10.0); 8].iter().chain(&[(4.0, 10.0), (6.0, 10.0)]);
        let found = share(&alike.copied().collect::<Vec<_>>()).unwrap();
        assert_eq!(found.n_effective, 100.0);
    }

    #[test]
    fn unanimous_clusters_are_not_certain() {
        let found = share(&[(3.0, 3.0); 10]).unwrap();
        let (low, high) = found.ci95.unwrap();
        assert_eq!((found.share, high), (1.0, 1.0));
        // Wilson with n = 10: 10/(10 + t²), t(.975, 9) = 2.262157
        assert!((low - 10.0 / (10.0 + 2.262_157f64.powi(2))).abs() < 1e-6);
        assert_eq!(share(&[(1.0, 3.0)]).unwrap().ci95, None);
        assert_eq!(share(&[]), None);
    }

    /// R 4.2, prop.test(76, 100, correct = FALSE).
    #[test]
    fn wilson_agrees_with_r() {
        let (low, high) = wilson(76.0, 100.0).unwrap();
        assert!((low - 0.667_676_636_501_855_3).abs() < 1e-12);
        assert!((high - 0.833_086_744_430_512_2).abs() < 1e-12);
        assert_eq!(wilson(3.0, 2.0), None);
        assert_eq!(wilson(0.0, 0.0), None);
    }
}
