//! Does a covariate of the realizations predict the rating? Power in closed form.
//!
//! n subjects rate q realizations R times each, all crossed; the covariate x is
//! standardized over the realizations with denominator q (Σx² = q):
//!
//! y = mean + uᵢ + (slope + sᵢ)xⱼ + mⱼ + (um)ᵢⱼ + eᵢⱼᵣ.
//!
//! The observed means of the realizations scatter about the line with the variance
//! V = σ²ₘ + σ²ᵤₘ/n + σ²ₑ/(nR), so that t of Pearson's r is noncentral t with
//! δ = slope·√(q/V) and ν = q − 2. The subjects' slopes add σ²ₛ/n to the variance of the
//! mean slope, which that scatter does not contain: with κ = 1 + qσ²ₛ/(nV) it is t/√κ that
//! is noncentral t, with δ/√κ. The limit for n → ∞ is the ceiling: only σₘ is left of V.

use super::Scale;
use crate::distribution::{normal_upper, t_quantile};
use crate::finite;
use statrs::function::gamma::ln_gamma;
use std::f64::consts::PI;

/// Standard deviations of the random effects, in units of the rating.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spread {
    /// Levels of the subjects. No test of the slope depends on it.
    pub subject: f64,
    /// True means of the realizations about the line.
    pub realization: f64,
    /// Subject × realization.
    pub interaction: f64,
    /// Repetition to repetition.
    pub residual: f64,
    /// Slopes of the subjects, per standard deviation of the covariate.
    pub slope: f64,
}

/// Where the values of the covariate come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Values {
    /// They are known: Σx² = q.
    #[default]
    Fixed,
    /// They will be drawn from a normal distribution with variance 1.
    Drawn,
}

/// A design with its assumptions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Design {
    /// Slope per standard deviation of the covariate.
    pub slope: f64,
    /// Random effects.
    pub spread: Spread,
    /// Subjects; `None` for endlessly many.
    pub subjects: Option<usize>,
    /// Realizations.
    pub realizations: usize,
    /// Repetitions of each realization.
    pub repetitions: usize,
    /// Where the covariate comes from.
    pub values: Values,
}

/// What a design can be expected to show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Degrees of freedom, q − 2.
    pub df: f64,
    /// Noncentrality δ, before the subjects' slopes.
    pub ncp: f64,
    /// κ: variance of the mean slope over what the test takes for it.
    pub slope_inflation: f64,
    /// Probability that Pearson's t test rejects.
    pub power: f64,
    /// The same if the slope is 0: α, or more if subjects differ in their slopes.
    pub size: f64,
    /// Correlation of the covariate with the means of endlessly many subjects; `None` if
    /// those do not vary.
    pub rho_true: Option<f64>,
    /// Correlation with the means of this many subjects.
    pub rho_observed: f64,
    /// Share of the variance of the observed means that is not error.
    pub reliability: f64,
    /// Expected half-width of the slope's 1 − α interval.
    pub half_width: f64,
    /// Power with endlessly many subjects.
    pub ceiling: f64,
    /// Probability that a rejection has the wrong sign; `None` if the slope is 0.
    pub type_s: Option<f64>,
    /// Mean of |estimate| over |slope| given rejection; `None` if the slope is 0.
    pub type_m: Option<f64>,
}

impl Design {
    /// V: variance of the observed means about the line.
    pub fn scatter(&self) -> f64 {
        let s = &self.spread;
        let own = s.interaction.powi(2) + s.residual.powi(2) / self.repetitions as f64;
        let error = self.subjects.map_or(0.0, |n| own / n as f64);
        s.realization.powi(2) + error
    }

    /// Whether power is defined, with the degrees of freedom and the critical t.
    fn critical(&self, alpha: f64) -> Option<(f64, f64)> {
        let s = &self.spread;
        let sds = [s.subject, s.realization, s.interaction, s.residual, s.slope];
        let v = self.scatter();
        let valid = alpha > 0.0
            && alpha < 1.0
            && self.realizations > 2
            && self.repetitions > 0
            && self.subjects != Some(0)
            && sds.iter().all(|s| *s >= 0.0);
        if !(valid && v > 0.0 && v.is_finite() && self.slope.is_finite()) {
            return None;
        }
        let df = self.realizations as f64 - 2.0;
        Some((df, t_quantile(1.0 - alpha / 2.0, df)?))
    }

    /// κ for a covariate with this Σx².
    fn inflation(&self, sxx: f64) -> f64 {
        self.subjects.map_or(1.0, |n| {
            1.0 + sxx * self.spread.slope.powi(2) / (n as f64 * self.scatter())
        })
    }

    /// The probability that Pearson's t test rejects at the two-sided level `alpha`. `None`
    /// for fewer than three realizations, no repetition or subject, a negative standard
    /// deviation, means without scatter, or `alpha` outside (0, 1).
    pub fn power(&self, alpha: f64) -> Option<f64> {
        let (df, critical) = self.critical(alpha)?;
        let v = self.scatter();
        let scale = Scale::of(df);
        let given = |sxx: f64| {
            let root = self.inflation(sxx).sqrt();
            scale.rejected(self.slope * (sxx / v).sqrt() / root, critical / root)
        };
        let q = self.realizations as f64;
        Some(match self.values {
            Values::Fixed => given(q),
            Values::Drawn => Scale::of(q - 1.0).average(|u| given((q - 1.0) * u * u)),
        })
    }

    /// Power with endlessly many subjects, defined as [`Design::power`].
    pub fn ceiling(&self, alpha: f64) -> Option<f64> {
        self.critical(alpha)?;
        if self.spread.realization > 0.0 {
            let endless = Self {
                subjects: None,
                ..*self
            };
            endless.power(alpha)
        } else {
            Some(if self.slope == 0.0 { alpha } else { 1.0 })
        }
    }

    /// Power and its relatives, defined as [`Design::power`].
    pub fn expected(&self, alpha: f64) -> Option<Expected> {
        let (df, critical) = self.critical(alpha)?;
        let (s, v) = (&self.spread, self.scatter());
        let q = self.realizations as f64;
        let rho = |v: f64| self.slope / (self.slope.powi(2) + v).sqrt();
        let (ncp, kappa) = (self.slope * (q / v).sqrt(), self.inflation(q));
        let errors = (self.slope != 0.0 && self.values == Values::Fixed)
            .then(|| errors(ncp.abs() / kappa.sqrt(), df, critical / kappa.sqrt()));
        let null = Self {
            slope: 0.0,
            ..*self
        };
        Some(Expected {
            df,
            ncp,
            slope_inflation: kappa,
            power: self.power(alpha)?,
            size: null.power(alpha)?,
            rho_true: finite(rho(s.realization.powi(2))),
            rho_observed: rho(v),
            reliability: (self.slope.powi(2) + s.realization.powi(2)) / (self.slope.powi(2) + v),
            half_width: critical * (v / q).sqrt() * mean_root(df),
            ceiling: self.ceiling(alpha)?,
            type_s: errors.map(|e| e.0),
            type_m: errors.map(|e| e.1),
        })
    }

    /// The fewest subjects, of a range, with this power. `None` if no number of them has
    /// it, or where [`Design::power`] is not defined.
    pub fn least_subjects(
        &self,
        target: f64,
        alpha: f64,
        range: std::ops::RangeInclusive<usize>,
    ) -> Option<usize> {
        let reaches = |n: usize| {
            let design = Self {
                subjects: Some(n),
                ..*self
            };
            Some(design.power(alpha)? >= target)
        };
        if self.spread.slope > 0.0 {
            // Power can fall with n, as the size does.
            return range.into_iter().find(|&n| reaches(n) == Some(true));
        }
        let (mut low, mut high) = (*range.start(), *range.end());
        if !reaches(high)? {
            return None;
        }
        while low < high {
            let middle = low.midpoint(high);
            if reaches(middle)? {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        Some(high)
    }

    /// The smallest slope with this power: a root in the slope. `None` unless
    /// size < `target` < 1, or where [`Design::power`] is not defined.
    pub fn detectable_slope(&self, target: f64, alpha: f64) -> Option<f64> {
        let power = |slope: f64| Self { slope, ..*self }.power(alpha);
        if !(target < 1.0 && target > power(0.0)?) {
            return None;
        }
        let (mut low, mut high) = (0.0, self.scatter().sqrt());
        while power(high)? < target {
            (low, high) = (high, 2.0 * high);
            if !high.is_finite() {
                return None;
            }
        }
        while high - low > 1e-9 * high {
            let middle = f64::midpoint(low, high);
            if power(middle)? < target {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(high)
    }
}

/// E(√(χ²(ν)/ν)): the bias of a standard deviation.
fn mean_root(df: f64) -> f64 {
    (2.0 / df).sqrt() * (ln_gamma((df + 1.0) / 2.0) - ln_gamma(df / 2.0)).exp()
}

/// Types S and M of a test that rejects for |Z| > cu, Z ~ N(δ, 1) with δ > 0: the share
/// of rejections with the wrong sign, and E(|Z|) given rejection over δ (Gelman & Carlin
/// 2014).
fn errors(ncp: f64, df: f64, critical: f64) -> (f64, f64) {
    let density = |z: f64| (-0.5 * z * z).exp() / (2.0 * PI).sqrt();
    let scale = Scale::of(df);
    let power = scale.rejected(ncp, critical);
    let wrong = scale.average(|u| normal_upper(critical * u + ncp));
    let size = scale.average(|u| {
        let (right, left) = (critical * u - ncp, critical * u + ncp);
        ncp * (normal_upper(right) - normal_upper(left)) + density(right) + density(left)
    });
    (wrong / power, size / (power * ncp))
}

/// The fewest realizations with which endlessly many subjects have this power, for a
/// correlation `rho` of the covariate with the true means. `None` unless
/// 0 < |rho| < 1 and `alpha` < `target` < 1, or if more than 10 000 are needed.
pub fn least_realizations(rho: f64, target: f64, alpha: f64, values: Values) -> Option<usize> {
    if !(rho != 0.0 && rho.abs() < 1.0 && alpha > 0.0 && target > alpha && target < 1.0) {
        return None;
    }
    let power = |q: usize| limit(rho, q, values).power(alpha);
    let (mut low, mut high) = (2, 3);
    while power(high)? < target {
        (low, high) = (high, 2 * high);
        if high > 20_000 {
            return None;
        }
    }
    // `low` does not reach the target, `high` does.
    while high - low > 1 {
        let middle = low.midpoint(high);
        if power(middle)? < target {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

/// The design of endlessly many subjects with this correlation.
pub fn limit(rho: f64, realizations: usize, values: Values) -> Design {
    Design {
        slope: rho / (1.0 - rho * rho).sqrt(),
        spread: Spread {
            realization: 1.0,
            ..Spread::default()
        },
        subjects: None,
        realizations,
        repetitions: 1,
        values,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Spread = Spread {
        subject: 0.6,
        realization: 0.3,
        interaction: 0.4,
        residual: 0.8,
        slope: 0.0,
    };

    fn design(slope: f64, spread: Spread, n: usize, q: usize, r: usize) -> Design {
        Design {
            slope,
            spread,
            subjects: Some(n),
            realizations: q,
            repetitions: r,
            values: Values::Fixed,
        }
    }

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-8, "{found}, {expected}");
    }

    /// The noncentral t of SciPy 1.17 and of R 4.2.2, which agree to 3·10⁻¹²; the
    /// integrals in two orders.
    #[test]
    fn expectations_agree_with_two_programs() {
        let half = Spread {
            realization: 0.5,
            ..PAPER
        };
        // slope, spread, n, q, R, α; ncp, power, ρ observed, reliability, half-width, ceiling, S, M
        type Case = ((f64, Spread, usize, usize, usize, f64), [f64; 8]);
        let cases: [Case; 6] = [
            (
                (0.5, PAPER, 10, 5, 3, 0.05),
                [
                    3.133_169_948_582_676,
                    0.565_498_111_945_611_3,
                    0.813_968_162_529_289_3,
                    0.901_060_070_671_378_2,
                    0.467_903_793_932_219_6,
                    0.700_860_546_227_964_8,
                    6.254_266_586_1e-6,
                    1.137_370_826_357_313_5,
                ],
            ),
            (
                (0.5, PAPER, 10, 5, 1, 0.05),
                [
                    2.711_630_722_733_202,
                    0.460_732_100_544_712_5,
                    0.771_516_749_810_459_6,
                    0.809_523_809_523_809_6,
                    0.540_642_239_256_887_8,
                    0.700_860_546_227_964_8,
                    3.916_193_990_9e-5,
                    1.200_865_260_521_344_8,
                ],
            ),
            (
                (-0.5, half, 10, 8, 3, 0.05),
                [
                    -2.638_286_725_234_307,
                    0.598_135_322_885_535_7,
                    -0.682_100_099_623_000_4,
                    0.930_521_091_811_414_2,
                    0.444_889_260_184_512_86,
                    0.656_875_875_094_989_3,
                    1.659_656_976e-5,
                    1.200_685_933_891_851,
                ],
            ),
            (
                (0.4, half, 10, 12, 1, 0.05),
                [
                    2.412_090_756_622_109_5,
                    0.586_150_670_007_420_8,
                    0.571_428_571_428_571_5,
                    0.836_734_693_877_551_1,
                    0.360_387_003_715_973_8,
                    0.705_099_074_916_076,
                    2.596_705_358e-5,
                    1.246_910_406_238_084_7,
                ],
            ),
            (
                (
                    0.8,
                    Spread {
                        realization: 0.2,
                        ..PAPER
                    },
                    20,
                    3,
                    3,
                    0.05,
                ),
                [
                    5.720_775_535_473_553,
                    0.346_457_878_918_592_7,
                    0.957_094_840_834_044_6,
                    0.973_282_442_748_091_7,
                    1.417_721_708_887_825_3,
                    0.413_269_860_062_822_8,
                    1.589_793e-10,
                    1.028_558_195_219_617_7,
                ],
            ),
            (
                (
                    0.6,
                    Spread {
                        realization: 0.4,
                        ..PAPER
                    },
                    12,
                    8,
                    3,
                    0.01,
                ),
                [
                    3.881_979_835_323_783,
                    0.596_230_931_549_434_2,
                    0.808_223_859_120_487,
                    0.943_548_387_096_774_2,
                    0.549_738_671_640_504_2,
                    0.687_526_877_784_552_2,
                    6.927_691e-9,
                    1.114_334_390_698_146_2,
                ],
            ),
        ];
        for ((slope, spread, n, q, r, alpha), expected) in cases {
            let found = design(slope, spread, n, q, r).expected(alpha).unwrap();
            let numbers = [
                found.ncp,
                found.power,
                found.rho_observed,
                found.reliability,
                found.half_width,
                found.ceiling,
                found.type_s.unwrap(),
                found.type_m.unwrap(),
            ];
            for (found, expected) in numbers.into_iter().zip(expected) {
                close(found, expected);
            }
            close(found.size, alpha);
        }
    }

    /// The same sources.
    #[test]
    fn slopes_of_subjects_raise_the_size() {
        let spread = Spread {
            slope: 0.4,
            ..PAPER
        };
        let found = design(0.5, spread, 10, 5, 3).expected(0.05).unwrap();
        close(found.slope_inflation, 1.628_272_251_308_900_7);
        close(found.power, 0.556_131_880_402_520_8);
        close(found.size, 0.088_171_590_445_589_82);
        close(found.ceiling, 0.700_860_546_227_964_8);
        let spread = Spread {
            slope: 0.3,
            ..PAPER
        };
        let found = design(0.0, spread, 10, 8, 3).expected(0.05).unwrap();
        close(found.power, 0.098_280_995_341_357_92);
        assert_eq!((found.type_s, found.type_m), (None, None));
    }

    #[test]
    fn without_scatter_of_the_realizations_the_ceiling_is_one() {
        let flat = Spread {
            realization: 0.0,
            ..PAPER
        };
        let found = design(0.3, flat, 10, 5, 3).expected(0.05).unwrap();
        close(found.power, 0.645_294_137_772_160_9);
        assert_eq!((found.ceiling, found.rho_true), (1.0, Some(1.0)));
        let null = design(0.0, flat, 10, 5, 3).expected(0.05).unwrap();
        assert_eq!((null.ceiling, null.rho_true), (0.05, None));
        assert_eq!(design(0.5, flat, 10, 2, 3).expected(0.05), None);
        assert_eq!(
            design(0.5, Spread::default(), 10, 5, 3).expected(0.05),
            None
        );
    }

    /// Numerical integration in SciPy and R, as above.
    #[test]
    fn a_drawn_covariate_has_less_power() {
        for (q, rho, drawn, fixed) in [
            (5, 0.5, 0.131_132_380_562_603_48, 0.151_938_286_757_269_64),
            (5, 0.95, 0.858_063_966_535_166_5, 0.988_743_333_623_441_5),
            (8, 0.8, 0.754_667_720_500_474_3, 0.878_579_831_222_692_5),
            (12, 0.5, 0.400_399_469_423_163_8, 0.439_627_301_124_870_2),
            (20, 0.8, 0.995_845_905_374_019_5, 0.999_875_159_302_643_1),
        ] {
            let power = |values| limit(rho, q, values).expected(0.05).unwrap().power;
            close(power(Values::Drawn), drawn);
            close(power(Values::Fixed), fixed);
        }
    }

    /// The same sources, by search.
    #[test]
    fn the_fewest_realizations_agree() {
        for (rho, target, fixed, drawn) in [
            (0.3, 0.8, 82, 84),
            (0.3, 0.9, 109, 112),
            (0.5, 0.8, 26, 29),
            (0.6, 0.9, 21, 24),
            (0.7, 0.8, 11, 13),
            (0.9, 0.8, 5, 6),
            (0.95, 0.8, 4, 5),
        ] {
            let least = |values| least_realizations(rho, target, 0.05, values);
            assert_eq!(
                [least(Values::Fixed), least(Values::Drawn)],
                [Some(fixed), Some(drawn)]
            );
        }
        assert_eq!(least_realizations(1.0, 0.8, 0.05, Values::Fixed), None);
    }

    /// The same sources, by search.
    #[test]
    fn the_fewest_subjects_agree() {
        for (q, r, target, expected) in [
            (5, 5, 0.8, None),
            (6, 1, 0.8, Some(50)),
            (6, 3, 0.8, Some(24)),
            (8, 1, 0.9, Some(20)),
            (8, 5, 0.8, Some(4)),
            (10, 5, 0.8, Some(2)),
        ] {
            let found = design(0.5, PAPER, 1, q, r).least_subjects(target, 0.05, 2..=200);
            assert_eq!(found, expected, "{q} {r} {target}");
        }
    }

    #[test]
    fn the_detectable_slope_has_its_power() {
        for slope_sd in [0.0, 0.3] {
            let spread = Spread {
                slope: slope_sd,
                ..PAPER
            };
            let own = design(0.0, spread, 10, 8, 3);
            let slope = own.detectable_slope(0.8, 0.05).unwrap();
            close(Design { slope, ..own }.expected(0.05).unwrap().power, 0.8);
            assert_eq!(own.detectable_slope(0.01, 0.05), None);
        }
    }
}
