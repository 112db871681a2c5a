//! The probability of an answer, with the same bits on every machine.

use std::f64::consts::SQRT_2;

/// 1/√(2π).
pub(super) const DENSITY_AT_0: f64 = 0.398_942_280_401_432_7;
/// ln √(2π).
const LOG_ROOT_TAU: f64 = 0.918_938_533_204_672_8;
/// Below this the ratio of tail and density is a continued fraction.
const FAR: f64 = -5.0;
/// Levels of the fraction; at −5 the next one changes less than 10⁻¹⁶.
const LEVELS: u32 = 60;

/// The standard normal density.
pub(super) fn density(z: f64) -> f64 {
    DENSITY_AT_0 * libm::exp(-0.5 * z * z)
}

/// Φ(z).
pub(super) fn cumulative(z: f64) -> f64 {
    0.5 * libm::erfc(-z / SQRT_2)
}

/// ln Φ(z) and its derivative φ(z)/Φ(z).
pub(super) fn log_cumulative(z: f64) -> (f64, f64) {
    if z > FAR {
        let below = cumulative(z);
        let log = if z > 0.0 {
            libm::log1p(-cumulative(-z))
        } else {
            libm::log(below)
        };
        return (log, density(z) / below);
    }
    // Mills' ratio: 1/(t + 1/(t + 2/(t + 3/(t + …)))) with t = −z.
    let t = -z;
    let slope = (1..=LEVELS)
        .rev()
        .fold(t, |rest, k| t + f64::from(k) / rest);
    (-0.5 * t * t - LOG_ROOT_TAU - libm::log(slope), slope)
}

/// The logarithm of the probability of an answer whose points differ by `g`, its derivative, and minus the second one:
/// ln Φ(g/√2).
pub(crate) fn of_answer(g: f64) -> (f64, f64, f64) {
    let z = g / SQRT_2;
    let (log, slope) = log_cumulative(z);
    (log, slope / SQRT_2, 0.5 * (slope * (slope + z)).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// z, ln Φ(z) and φ(z)/Φ(z) with 40 digits (mpmath 1.3), rounded.
    const KNOWN: [(f64, f64, f64); 7] = [
        (-38.5, -745.695_270_290_411, 38.525_939_096_854_49),
        (-12.0, -75.410_673_001_568_8, 12.082_214_175_254_284),
        (-5.0, -15.064_998_393_988_725, 5.186_503_967_125_842),
        (-4.9, -14.551_182_689_355_311, 5.089_828_600_129_883),
        (-1.0, -1.841_021_645_009_263_6, 1.525_135_276_160_981),
        (0.5, -0.368_946_415_288_656_4, 0.509_160_433_837_033_5),
        (6.0, -9.865_876_455_243_758e-10, 6.075_882_855_817_676e-09),
    ];

    #[test]
    fn logarithms_and_slopes_are_those_of_scipy() {
        for (z, log, slope) in KNOWN {
            let found = log_cumulative(z);
            assert!((found.0 - log).abs() <= 2e-14 * log.abs(), "{z}: {found:?}");
            assert!((found.1 - slope).abs() <= 2e-13 * slope, "{z}: {found:?}");
        }
    }

    /// The two ways to compute it meet, and no answer has a negative curvature.
    #[test]
    fn the_fraction_continues_the_function() {
        let (before, after) = (log_cumulative(FAR), log_cumulative(FAR + 1e-12));
        assert!((before.0 - after.0).abs() < 1e-10 && (before.1 - after.1).abs() < 1e-10);
        for i in -400..=400 {
            let (log, slope, curvature) = of_answer(f64::from(i) * 0.1);
            assert!(
                log <= 0.0 && slope >= 0.0 && (0.0..=0.5).contains(&curvature),
                "{i}"
            );
        }
    }
}
