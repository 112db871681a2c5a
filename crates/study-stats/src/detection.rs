//! Signal detection: sensitivity d′ and bias, for each design of a trial.
//!
//! Rates are corrected by the log-linear rule (Hautus 1995), (h + ½)/(n + 1), in every
//! condition, unless a function takes raw rates. d′ and its decision models follow
//! Macmillan & Creelman (2005); intervals of a share are Wilson's, and their limits go
//! through the same inverse as the share. Trials of several participants do not belong
//! in one call: they are clustered.

use super::distribution::{normal_cdf, normal_density, normal_quantile};
use super::proportion::wilson;
use super::quadrature::gauss_legendre;
use std::f64::consts::SQRT_2;

/// Largest d′ that an inverse gives.
const MOST: f64 = 30.0;

/// Answers of one kind to two kinds of trials: "yes" to signals and to catch trials,
/// "first" when it was the first and when it was the second, "different" to different
/// and to same pairs, "X is A" when it was A and when it was B.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answers {
    /// Answers to the trials where they are right.
    pub hits: f64,
    /// Number of those trials.
    pub n_hits: f64,
    /// Answers to the trials where they are wrong.
    pub false_alarms: f64,
    /// Number of those trials.
    pub n_false_alarms: f64,
}

impl Answers {
    fn valid(&self) -> bool {
        let share = |k: f64, n: f64| k >= 0.0 && k <= n && n > 0.0 && n.is_finite();
        share(self.hits, self.n_hits) && share(self.false_alarms, self.n_false_alarms)
    }

    /// Rates after the log-linear correction. `None` unless there are trials of both
    /// kinds.
    pub fn corrected(&self) -> Option<Rates> {
        let corrected = |k: f64, n: f64| (k + 0.5) / (n + 1.0);
        self.valid().then(|| Rates {
            hit: corrected(self.hits, self.n_hits),
            false_alarm: corrected(self.false_alarms, self.n_false_alarms),
        })
    }

    /// Rates as they are. `None` unless there are trials of both kinds.
    pub fn raw(&self) -> Option<Rates> {
        self.valid().then(|| Rates {
            hit: self.hits / self.n_hits,
            false_alarm: self.false_alarms / self.n_false_alarms,
        })
    }

    /// Var(z of the hit rate) and Var(z of the false-alarm rate): p(1 − p)/(n φ(z)²)
    /// (Gourevitch & Galanter 1967), with these rates and the numbers of trials.
    fn variances(&self, rates: Rates) -> Option<(f64, f64)> {
        let variance = |p: f64, n: f64| {
            let density = normal_density(normal_quantile(p)?);
            Some(p * (1.0 - p) / (n * density * density))
        };
        Some((
            variance(rates.hit, self.n_hits)?,
            variance(rates.false_alarm, self.n_false_alarms)?,
        ))
    }
}

/// A hit rate and a false-alarm rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// P(answer | right).
    pub hit: f64,
    /// P(answer | wrong).
    pub false_alarm: f64,
}

impl Rates {
    /// z of both. `None` if one is 0 or 1.
    fn z(self) -> Option<(f64, f64)> {
        Some((
            normal_quantile(self.hit)?,
            normal_quantile(self.false_alarm)?,
        ))
    }

    /// Φ((zH − zF)/2): the share of correct answers without bias.
    fn unbiased(self) -> Option<f64> {
        let (hit, false_alarm) = self.z()?;
        Some(normal_cdf((hit - false_alarm) / 2.0))
    }
}

/// An estimate of d′.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensitivity {
    /// d′.
    pub d: f64,
    /// Its standard error, where it has one.
    pub se: Option<f64>,
    /// 95 % interval.
    pub ci95: Option<(f64, f64)>,
}

/// A yes–no experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct YesNo {
    /// The corrected rates.
    pub rates: Rates,
    /// zH − zF.
    pub d: f64,
    /// Standard error (Gourevitch & Galanter 1967); approximate under 30 trials.
    pub d_se: f64,
    /// d′ ± 1.96 standard errors.
    pub d_ci95: (f64, f64),
    /// −(zH + zF)/2.
    pub criterion: f64,
    /// exp(d′ · criterion).
    pub beta: f64,
    /// d′ of the raw rates. `None` if one is 0 or 1.
    pub d_uncorrected: Option<f64>,
    /// A′ of the raw rates (Stanislaw & Todorov 1999). `None` if both are 0, or both 1.
    /// It is not free of bias.
    pub a_prime: Option<f64>,
}

/// Sensitivity and criterion of "yes" answers to signals and catch trials.
///
/// ```
/// # use study_stats::detection::{Answers, yes_no};
/// let answers = Answers { hits: 69.0, n_hits: 100.0, false_alarms: 31.0, n_false_alarms: 100.0 };
/// let found = yes_no(&answers).unwrap();
/// // Without correction 0.99; no criterion, because both rates are as far from .5.
/// assert_eq!(format!("{:.2}", found.d_uncorrected.unwrap()), "0.99");
/// assert!(found.criterion.abs() < 1e-12);
/// ```
pub fn yes_no(answers: &Answers) -> Option<YesNo> {
    let rates = answers.corrected()?;
    let (hit, false_alarm) = rates.z()?;
    let (var_hit, var_false) = answers.variances(rates)?;
    let d = hit - false_alarm;
    let d_se = (var_hit + var_false).sqrt();
    let criterion = -(hit + false_alarm) / 2.0;
    let raw = answers.raw()?;
    Some(YesNo {
        rates,
        d,
        d_se,
        d_ci95: wald(d, d_se)?,
        criterion,
        beta: (d * criterion).exp(),
        d_uncorrected: raw.z().map(|(h, f)| h - f),
        a_prime: a_prime(raw),
    })
}

/// A′ = ½ + sgn(H − F)·((H − F)² + |H − F|)/(4 max(H, F) − 4HF).
fn a_prime(rates: Rates) -> Option<f64> {
    let (h, f) = (rates.hit, rates.false_alarm);
    let below = 4.0 * h.max(f) - 4.0 * h * f;
    let distance = h - f;
    if below <= 0.0 {
        return None;
    }
    if distance == 0.0 {
        return Some(0.5);
    }
    Some(0.5 + distance.signum() * (distance * distance + distance.abs()) / below)
}

fn wald(estimate: f64, se: f64) -> Option<(f64, f64)> {
    let z = normal_quantile(0.975)?;
    Some((estimate - z * se, estimate + z * se))
}

/// A two-alternative forced choice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoAlternative {
    /// (zH − zF)/√2 of the corrected rates of the answer "first".
    pub d: f64,
    /// Its standard error.
    pub d_se: f64,
    /// d′ ± 1.96 standard errors.
    pub d_ci95: (f64, f64),
    /// −(zH + zF)/√2: below 0 the first interval is favored.
    pub interval_bias: f64,
    /// Share of correct answers.
    pub share_correct: f64,
    /// Wilson's interval.
    pub share_ci95: (f64, f64),
    /// √2·z(share correct), which a bias makes too small. `None` at 0 and 1.
    pub d_from_share: Option<f64>,
    /// The same of the limits. A limit at 0 or 1 has none.
    pub d_from_share_ci95: (Option<f64>, Option<f64>),
}

/// Sensitivity and interval bias of the answer "first".
pub fn two_alternative(answers: &Answers) -> Option<TwoAlternative> {
    let rates = answers.corrected()?;
    let (hit, false_alarm) = rates.z()?;
    let (var_hit, var_false) = answers.variances(rates)?;
    let d = (hit - false_alarm) / SQRT_2;
    let d_se = ((var_hit + var_false) / 2.0).sqrt();
    let n = answers.n_hits + answers.n_false_alarms;
    let correct = answers.hits + answers.n_false_alarms - answers.false_alarms;
    let share_ci95 = wilson(correct, n)?;
    // A limit within rounding of 1 is 1.
    let from_share = |p: f64| {
        normal_quantile(p)
            .filter(|_| p < 1.0 - 1e-12)
            .map(|z| SQRT_2 * z)
    };
    Some(TwoAlternative {
        d,
        d_se,
        d_ci95: wald(d, d_se)?,
        interval_bias: -(hit + false_alarm) / SQRT_2,
        share_correct: correct / n,
        share_ci95,
        d_from_share: from_share(correct / n),
        d_from_share_ci95: (from_share(share_ci95.0), from_share(share_ci95.1)),
    })
}

/// A choice among several, of which only the share of correct answers is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Share of correct answers.
    pub share_correct: f64,
    /// Wilson's interval.
    pub share_ci95: (f64, f64),
    /// d′: 0 at or below chance, `None` if every answer is correct.
    pub d: Option<f64>,
    /// Delta method. `None` at or below chance, and at 1.
    pub d_se: Option<f64>,
    /// d′ of the limits. The upper limit of 1 has none.
    pub d_ci95: (Option<f64>, Option<f64>),
}

/// One of `m` intervals has the signal, without bias:
/// Pc = ∫φ(x − d′)Φ(x)^(m−1)dx. `None` unless m ≥ 2 and there are trials.
///
/// ```
/// # use study_stats::detection::forced_choice;
/// // 76 % correct of two intervals: d′ = √2 z(.76).
/// let found = forced_choice(76.0, 100.0, 2).unwrap();
/// assert_eq!(format!("{:.2}", found.d.unwrap()), "1.00");
/// ```
pub fn forced_choice(correct: f64, trials: f64, m: u32) -> Option<Choice> {
    choice(correct, trials, share_of_choice(m)?)
}

/// The share of correct answers of a choice among `m` intervals by d′. `None` unless m ≥ 2.
pub fn share_of_choice(m: u32) -> Option<impl Fn(f64) -> f64> {
    let others = i32::try_from(m).ok().filter(|m| *m >= 2)? - 1;
    let nodes = gauss_legendre(80, -9.0, 9.0);
    Some(move |d| {
        (nodes.iter())
            .map(|(x, w)| w * normal_density(*x) * normal_cdf(x + d).powi(others))
            .sum()
    })
}

/// Which of three is odd, by differencing:
/// Pc = 2∫₀^∞[Φ(−x√3 + d′√⅔) + Φ(−x√3 − d′√⅔)]φ(x)dx.
pub fn oddity(correct: f64, trials: f64) -> Option<Choice> {
    choice(correct, trials, share_of_oddity())
}

/// The share of correct answers of oddity by d′.
pub fn share_of_oddity() -> impl Fn(f64) -> f64 {
    let nodes = gauss_legendre(80, 0.0, 9.0);
    move |d| {
        let shift = d * (2.0f64 / 3.0).sqrt();
        let sum = |x: f64| {
            let far = -x * 3f64.sqrt();
            normal_cdf(far + shift) + normal_cdf(far - shift)
        };
        (nodes.iter())
            .map(|(x, w)| 2.0 * w * sum(*x) * normal_density(*x))
            .sum()
    }
}

fn choice(correct: f64, trials: f64, share_of: impl Fn(f64) -> f64) -> Option<Choice> {
    let share_ci95 = wilson(correct, trials)?;
    let share = correct / trials;
    let d = inverse(share, &share_of);
    let d_se = d.filter(|d| *d > 0.0).map(|d| {
        let h = 1e-4;
        let slope = (share_of(d + h) - share_of(d - h)) / (2.0 * h);
        (share * (1.0 - share) / trials).sqrt() / slope
    });
    Some(Choice {
        share_correct: share,
        share_ci95,
        d,
        d_se,
        d_ci95: (
            inverse(share_ci95.0, &share_of),
            inverse(share_ci95.1, &share_of),
        ),
    })
}

/// The d′ ≥ 0 with this share, by bisection; 0 at or below chance, `None` near 1.
fn inverse(share: f64, share_of: impl Fn(f64) -> f64) -> Option<f64> {
    if share <= share_of(0.0) + 1e-12 {
        return Some(0.0);
    }
    if share >= 1.0 - 1e-12 || share >= share_of(MOST) {
        return None;
    }
    let (mut low, mut high) = (0.0, MOST);
    while high - low > 1e-13 * high.max(1.0) {
        let middle = 0.5 * (low + high);
        if share_of(middle) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(0.5 * (low + high))
}

/// The answer "X is A" of ABX.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Abx {
    /// Φ((zH − zF)/2).
    pub share_unbiased: f64,
    /// By differencing: X − (A + B)/2.
    pub differencing: Sensitivity,
    /// By independent observations.
    pub independent: Sensitivity,
    /// −(zH + zF)/2: below 0 the answer "A" is favored.
    pub bias: f64,
}

/// d′ of ABX by both models: p = Φ(d′/√2)Φ(d′/√6) + Φ(−d′/√2)Φ(−d′/√6) by differencing,
/// with d′/2 in place of d′/√6 by independent observations. `raw` takes the rates
/// without correction. Intervals: of zH − zF, through the inverse.
pub fn abx(answers: &Answers, raw: bool) -> Option<Abx> {
    let rates = if raw {
        answers.raw()
    } else {
        answers.corrected()
    }?;
    let (hit, false_alarm) = rates.z()?;
    let model = |second: f64| move |d: f64| share_of_abx(d, second);
    Some(Abx {
        share_unbiased: rates.unbiased()?,
        differencing: through_z(answers, rates, |p| inverse(p, model(6f64.sqrt())))?,
        independent: through_z(answers, rates, |p| inverse(p, model(2.0)))?,
        bias: -(hit + false_alarm) / 2.0,
    })
}

/// The share of correct answers of ABX by d′: `second` is √6 by differencing.
fn share_of_abx(d: f64, second: f64) -> f64 {
    let both = |d: f64| normal_cdf(d / SQRT_2) * normal_cdf(d / second);
    both(d) + both(-d)
}

/// The share of correct answers of ABX by d′, by differencing.
pub fn share_of_abx_by_differencing(d: f64) -> f64 {
    share_of_abx(d, 6f64.sqrt())
}

/// Hits and false alarms of the answer "different" by d′, by differencing, with the criterion
/// at which most answers are correct.
pub fn rates_of_same_different(d: f64) -> (f64, f64) {
    // There the density of a difference is the same for both: it falls with τ for the same.
    let density = |x: f64| normal_density(x / SQRT_2);
    let (mut low, mut high) = (0.0, d.abs() + 4.0);
    for _ in 0..60 {
        let tau = 0.5 * (low + high);
        if density(tau - d) + density(tau + d) < 2.0 * density(tau) {
            low = tau;
        } else {
            high = tau;
        }
    }
    let tau = 0.5 * (low + high);
    let hits = normal_cdf((d - tau) / SQRT_2) + normal_cdf((-d - tau) / SQRT_2);
    (hits, 2.0 * normal_cdf(-tau / SQRT_2))
}

/// An estimate that is a rising function of Φ((zH − zF)/2), with the interval of zH − zF.
fn through_z(
    answers: &Answers,
    rates: Rates,
    d_of: impl Fn(f64) -> Option<f64>,
) -> Option<Sensitivity> {
    let (hit, false_alarm) = rates.z()?;
    let (var_hit, var_false) = answers.variances(rates)?;
    let (low, high) = wald(hit - false_alarm, (var_hit + var_false).sqrt())?;
    let limit = |z: f64| d_of(normal_cdf(z / 2.0));
    Some(Sensitivity {
        d: d_of(normal_cdf((hit - false_alarm) / 2.0))?,
        se: None,
        ci95: limit(low).zip(limit(high)),
    })
}

/// The answer "different".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SameDifferent {
    /// "Different" if |x₁ − x₂| > τ: F = 2Φ(−τ/√2),
    /// H = Φ((d′ − τ)/√2) + Φ((−d′ − τ)/√2).
    pub differencing: Sensitivity,
    /// τ.
    pub tau: f64,
    /// Φ((zH − zF)/2): ½ by chance, below it if "different" is said of the same.
    pub share_unbiased: f64,
    /// Independent observations: p = Φ((zH − zF)/2), d′ = 2z((1 + √(2p − 1))/2).
    pub independent: Sensitivity,
    /// Maximum likelihood by differencing: the first with raw rates, because two rates
    /// determine d′ and τ. `None` if a raw rate is 0 or 1.
    pub differencing_ml: Option<f64>,
}

/// d′ of same–different by both models; 0 if H ≤ F. `raw` takes the rates without
/// correction. The standard error by differencing is that of the delta method.
pub fn same_different(answers: &Answers, raw: bool) -> Option<SameDifferent> {
    let rates = if raw {
        answers.raw()
    } else {
        answers.corrected()
    }?;
    let (d, tau) = by_differencing(rates)?;
    let se = || {
        let slope = |change: fn(Rates, f64) -> Rates| {
            let at = |h: f64| by_differencing(change(rates, h)).map(|(d, _)| d);
            Some((at(1e-5)? - at(-1e-5)?) / 2e-5)
        };
        let hit = slope(|r, h| Rates {
            hit: r.hit + h,
            ..r
        })?;
        let false_alarm = slope(|r, h| Rates {
            false_alarm: r.false_alarm + h,
            ..r
        })?;
        let variance = |p: f64, n: f64| p * (1.0 - p) / n;
        let variance = hit * hit * variance(rates.hit, answers.n_hits)
            + false_alarm * false_alarm * variance(rates.false_alarm, answers.n_false_alarms);
        Some(variance.sqrt())
    };
    let se = if d > 0.0 { se() } else { None };
    let independent = |p: f64| {
        if p <= 0.5 {
            return Some(0.0);
        }
        normal_quantile((1.0 + (2.0 * p - 1.0).sqrt()) / 2.0).map(|z| 2.0 * z)
    };
    Some(SameDifferent {
        differencing: Sensitivity {
            d,
            se,
            ci95: se
                .and_then(|se| wald(d, se))
                .map(|(low, high)| (low.max(0.0), high)),
        },
        tau,
        share_unbiased: rates.unbiased()?,
        independent: through_z(answers, rates, independent)?,
        differencing_ml: answers.raw().and_then(by_differencing).map(|(d, _)| d),
    })
}

/// d′ and τ.
fn by_differencing(rates: Rates) -> Option<(f64, f64)> {
    rates.z()?;
    let tau = -SQRT_2 * normal_quantile(rates.false_alarm / 2.0)?;
    let hit = |d: f64| normal_cdf((d - tau) / SQRT_2) + normal_cdf((-d - tau) / SQRT_2);
    Some((inverse(rates.hit, hit)?, tau))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, tolerance: f64) {
        assert!((a - b).abs() <= tolerance, "{a} is not {b}");
    }

    fn answers(hits: f64, n_hits: f64, false_alarms: f64, n_false_alarms: f64) -> Answers {
        Answers {
            hits,
            n_hits,
            false_alarms,
            n_false_alarms,
        }
    }

    /// c = −(z(H) + z(F))/2, and −(z(H) + z(F))/√2 of two intervals (Macmillan & Creelman 2005,
    /// equations 2.1 and 7.5): whoever often says "yes" has a criterion below 0. Rates .95 and
    /// .45: z = 1.644854 and −0.125661 (R 4.2, `qnorm`).
    #[test]
    fn a_liberal_criterion_is_negative() {
        let liberal = answers(9.0, 9.0, 4.0, 9.0);
        close(yes_no(&liberal).unwrap().criterion, -0.759_596, 1e-6);
        let bias = two_alternative(&liberal).unwrap().interval_bias;
        close(bias, -1.074_231, 1e-6);
    }

    /// The worked values of Macmillan & Creelman (2005), chapters 7 and 9, by psyphy
    /// 0.3 in R: ABX with H .75, F .3; same–different with H .6, F .3.
    #[test]
    fn both_models_agree_with_psyphy() {
        let abx = abx(&answers(75.0, 100.0, 30.0, 100.0), true).unwrap();
        close(abx.differencing.d, 1.868_677, 1e-5);
        close(abx.independent.d, 1.660_982, 1e-5);
        let (low, high) = abx.differencing.ci95.unwrap();
        assert!(low > 1.0 && low < 1.868 && high > 1.869 && high < 3.0);
        let pair = same_different(&answers(60.0, 100.0, 30.0, 100.0), true).unwrap();
        close(pair.differencing.d, 1.784_740, 1e-5);
        close(pair.independent.d, 1.511_226, 1e-5);
        assert_eq!(pair.differencing_ml, Some(pair.differencing.d));
        // R 4.2: optim and optimHess of the log-likelihood of 60, 40, 30, 70
        close(pair.differencing.se.unwrap(), 0.250_647, 1e-5);
    }

    /// Two-alternative d′ of m-AFC is √2·z(Pc); oddity at d′ = 0 is ⅓.
    #[test]
    fn choices_have_their_limits() {
        let two = forced_choice(38.0, 50.0, 2).unwrap();
        close(
            two.d.unwrap(),
            SQRT_2 * normal_quantile(0.76).unwrap(),
            1e-9,
        );
        let chance = oddity(20.0, 60.0).unwrap();
        assert_eq!((chance.d, chance.d_se), (Some(0.0), None));
        assert!(chance.d_ci95.1.unwrap() > 1.0);
        let perfect = forced_choice(20.0, 20.0, 3).unwrap();
        assert_eq!((perfect.d, perfect.d_ci95.1), (None, None));
        assert!(perfect.d_ci95.0.unwrap() > 1.8);
        assert_eq!(forced_choice(5.0, 4.0, 3), None);
        assert_eq!(forced_choice(1.0, 4.0, 1), None);
    }

    #[test]
    fn nothing_follows_from_no_trials() {
        assert_eq!(yes_no(&answers(0.0, 0.0, 1.0, 2.0)), None);
        assert_eq!(two_alternative(&answers(3.0, 2.0, 1.0, 2.0)), None);
        let below = yes_no(&answers(10.0, 40.0, 16.0, 40.0)).unwrap();
        assert!(below.d < 0.0, "a negative d' stays as it is");
        assert_eq!(
            same_different(&answers(10.0, 40.0, 12.0, 40.0), false)
                .unwrap()
                .differencing
                .d,
            0.0
        );
    }
}
