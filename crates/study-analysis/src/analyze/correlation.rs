//! Correlations over realizations of VAF with a mean rating or another value of theirs:
//! `corr/*`, `corr_adjusted/*`, `corr_delivered/*`, and those of parts.

use super::Rules;
use super::draws::Draws;
use super::record::{Interval, Number as _, RealizationName, Stat, statistics};
use std::collections::BTreeMap;
use study_base::text::Untrusted;
use study_stats::bayes::correlation_bf10;
use study_stats::correlation::{fisher_interval, kendall, p_of_r, pearson, spearman};
use study_stats::describe::is_constant;
use study_stats::permutation::{self, Statistic};
use study_stats::within;

pub(super) const FEW: &str = "fewer than three realizations with a VAF";

/// Largest number of realizations to leave out one by one; the cost is quadratic.
const MAX_LEFT_OUT: usize = 1000;

statistics! {
    /// A permutation test over the realizations: up to nine by all n! pairings, the observed one included, whose statistic (or its absolute value) is at least the observed one, where values within 10⁻⁹ count as equal; above by (b + 1)/(B + 1) with B = 9,999 permutations from the study's seed.
    pub struct Permuted {
        /// share of all pairings whose absolute statistic is at least the observed one
        p_exact_two_sided: Option<Stat>,
        /// share of all pairings whose statistic is at least the observed one
        p_exact_greater: Option<Stat>,
        /// the same, estimated from random pairings
        p_monte_carlo_two_sided: Option<Stat>,
        /// the same, estimated from random pairings
        p_monte_carlo_greater: Option<Stat>,
        /// the smallest two-sided p that any ratings could have had
        smallest_p_two_sided: Stat,
    }

    /// Pearson's correlation over the realizations. n = 2 is undefined, n = 3 has no interval.
    pub struct Pearson {
        /// the correlation
        r: Stat,
        /// of t = r√((n−2)/(1−r²))
        p_t: Stat,
        /// tanh(atanh r ± 1.96/√(n−3))
        ci95: Option<Interval>,
        /// Ly et al. (2016), flat prior: √π/2 · Γ((n+1)/2)/Γ((n+2)/2) · ₂F₁((n−1)/2, (n−1)/2; (n+2)/2; r²)
        bf10: Option<Stat>,
        /// by all pairings
        permuted: Option<Permuted> as "",
        /// t/√(n−2+t²), t = t(1 − α/2, n−2), with α the level of significance
        critical_r: Option<Stat>,
    }

    /// Spearman's correlation over the realizations.
    pub struct Spearman {
        /// the correlation
        rho: Stat,
        /// by all pairings
        permuted: Permuted as "",
    }

    /// Kendall's correlation over the realizations (Kendall 1945).
    pub struct Kendall {
        /// the correlation
        tau_b: Stat,
        /// by all pairings
        permuted: Permuted as "",
    }

    /// Correlations without a realization.
    pub struct Without {
        /// Pearson's
        pearson: Stat,
        /// Spearman's
        spearman: Stat,
    }

    /// Correlations without each realization in turn.
    pub struct LeaveOneOut {
        /// without this realization
        without: BTreeMap<RealizationName, Without> as "",
        /// the lowest of Pearson's
        pearson_min: Stat,
        /// the highest of Pearson's
        pearson_max: Stat,
        /// the lowest of Spearman's
        spearman_min: Stat,
        /// the highest of Spearman's
        spearman_max: Stat,
    }

    /// The share of the variance between realizations that is associated with VAF. All three assume a linear relation and a sample of realizations; none shows that VAF is the cause.
    pub struct Share {
        /// r²
        r2: Stat,
        /// 1 − (1−r²)(n−1)/(n−2) (Ezekiel 1930); it can be negative
        r2_adjusted: Stat,
        /// 1 − `lmm_vaf_crossed/var_model` / `lmm_vaf_crossed/var_model_without_vaf`: the reduction of the crossed model's variance of realizations when VAF is added, with the same random effects and the same ratings; negative where VAF explains less than expected by chance, undefined where there is no variance without VAF
        var_model_crossed: Option<Stat>,
    }

    /// The slope of the means on VAF where the design makes some differences less precise than others: by a factor of more than 1.2 in their variances, if a cell of n ratings has the variance 1 + 1/n. Generalized least squares over the realizations, with the covariance of their differences in `within_cells` (cells with fewer ratings count as less precise) plus a variance of the realizations about the line, by restricted maximum likelihood; the standard error is scaled by the weighted residuals (Knapp & Hartung 2003). With equally precise means it is Pearson's t.
    pub struct Trend {
        /// change of the rating per unit of VAF
        slope: Stat,
        /// its standard error
        se: Stat,
        /// `slope`/`se`
        t: Stat,
        /// realizations less 2
        df: Stat,
        /// two-sided
        p: Stat,
        /// interval of `slope`
        ci95: Interval,
        /// t/√(t² + df), a correlation that weighs the means by their precision
        r: Stat,
        /// standard deviation of the realizations about the line, beyond the errors of their means
        sd_realizations: Stat,
    }

    /// Correlations over realizations of x, a VAF, with y, a mean.
    pub struct Correlation {
        /// realizations
        n_models: Option<Stat>,
        /// decides whether VAF predicts the rating
        pearson: Pearson,
        /// of ranks
        spearman: Option<Spearman>,
        /// of orders
        kendall: Option<Kendall>,
        /// without each realization
        leave_one_out: Option<LeaveOneOut>,
        /// what VAF explains
        share: Option<Share>,
        /// decides instead where the design is not balanced
        trend: Option<Trend>,
    }
}

impl Permuted {
    /// The two-sided p, and whether it is exact.
    pub fn two_sided(&self) -> Option<(f64, bool)> {
        let exact = self.p_exact_two_sided.number().map(|p| (p, true));
        exact.or_else(|| Some((self.p_monte_carlo_two_sided.number()?, false)))
    }
}

impl Pearson {
    /// The two-sided p of the permutation test, and whether it is exact.
    pub fn permutation_p(&self) -> Option<(f64, bool)> {
        self.permuted.as_ref()?.two_sided()
    }
}

impl Correlation {
    /// Number of realizations; 0 where there are no means.
    pub fn n(&self) -> usize {
        self.n_models.number().unwrap_or(0.0) as usize
    }

    /// Why there is none of values that do not exist.
    pub(super) fn without_means(why: impl ToString) -> Self {
        Self::undefined(why.to_string())
    }

    /// All correlations.
    pub(super) fn of(x: &[f64], y: &[f64], names: &[&str], rules: &Rules) -> Self {
        let why = undefined(x);
        // Two points always lie on a line.
        let enough = |r: Option<f64>| Stat::or(r.filter(|_| x.len() >= 3), why);
        Self {
            spearman: Some(Spearman {
                rho: enough(spearman(x, y)),
                permuted: permuted(Statistic::Spearman, x, y, rules),
            }),
            kendall: Some(Kendall {
                tau_b: enough(kendall(x, y)),
                permuted: permuted(Statistic::Kendall, x, y, rules),
            }),
            leave_one_out: Some(leave_one_out(x, y, names, why)),
            ..Self::of_pearson(x, y, rules)
        }
    }

    /// Pearson's correlation with its tests: what decides whether VAF predicts the rating.
    pub(super) fn of_pearson(x: &[f64], y: &[f64], rules: &Rules) -> Self {
        let n = x.len();
        let why = undefined(x);
        let r = pearson(x, y).filter(|_| n >= 3);
        let line = match r {
            Some(_) => "the means lie on a line",
            None => why,
        };
        let no_interval = match r {
            Some(_) if n == 3 => "three realizations have no interval",
            _ => line,
        };
        let interval = r.and_then(|r| fisher_interval(r, n as f64 - 3.0));
        let pearson = Pearson {
            r: Stat::or(r, why),
            p_t: Stat::or(r.and_then(|r| p_of_r(r, n as f64 - 2.0)), line),
            ci95: Some(Interval::or(interval, no_interval)),
            bf10: Some(Stat::or(r.and_then(|r| correlation_bf10(r, n)), line)),
            permuted: Some(permuted(Statistic::Pearson, x, y, rules)),
            critical_r: None,
        };
        Self {
            n_models: Some(Stat::count(n)),
            pearson,
            spearman: None,
            kendall: None,
            leave_one_out: None,
            share: None,
            trend: None,
        }
    }

    /// With the trend, which decides where not all means are equally precise.
    pub(super) fn with_trend(mut self, found: Option<within::Trend>) -> Self {
        let Some(found) = found else {
            self.trend = Some(Trend::undefined(
                "fewer than three realizations with a VAF, or participants do not link them, or no variance of error",
            ));
            return self;
        };
        let why = "the means lie on a line";
        self.trend = Some(Trend {
            slope: Stat::of(found.slope),
            se: Stat::of(found.se),
            t: Stat::or(found.t, why),
            df: Stat::of(found.df),
            p: Stat::or(found.p, why),
            ci95: Interval::or(found.ci95, why),
            r: Stat::or(found.r, why),
            sd_realizations: Stat::of(found.sd),
        });
        self
    }
}

/// Why there is no correlation, if there is none.
fn undefined(x: &[f64]) -> &'static str {
    if x.len() < 3 {
        FEW
    } else if is_constant(x) {
        "all realizations have the same VAF"
    } else {
        "all realizations have the same mean rating"
    }
}

fn permuted(statistic: Statistic, x: &[f64], y: &[f64], rules: &Rules) -> Permuted {
    let mut draws = Draws::new(rules.seed, "permutation");
    let test = permutation::test(statistic, x, y, &mut draws);
    let why = undefined(x);
    let two_sided = Stat::or(test.map(|t| t.two_sided), why);
    let greater = Stat::or(test.map(|t| t.greater), why);
    let all = Permuted {
        smallest_p_two_sided: Stat::or(test.map(|t| t.smallest), why),
        ..Permuted::undefined(why)
    };
    if x.len() > permutation::MAX_EXACT {
        Permuted {
            p_monte_carlo_two_sided: Some(two_sided),
            p_monte_carlo_greater: Some(greater),
            ..all
        }
    } else {
        Permuted {
            p_exact_two_sided: Some(two_sided),
            p_exact_greater: Some(greater),
            ..all
        }
    }
}

/// The correlations without each realization in turn.
fn leave_one_out(x: &[f64], y: &[f64], names: &[&str], why: &'static str) -> LeaveOneOut {
    let n = x.len();
    let kept = |i: usize, v: &[f64]| -> Vec<f64> {
        let kept = v.iter().enumerate().filter(|(j, _)| *j != i);
        kept.map(|(_, v)| *v).collect()
    };
    let why = match n {
        3 => "leaving one out leaves two",
        n if n > MAX_LEFT_OUT => "more than 1000 realizations",
        _ => why,
    };
    let mut ends = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    let possible = n > 3 && n <= MAX_LEFT_OUT;
    let mut complete = possible;
    let defined = pearson(x, y).is_some();
    let mut lost = None;
    let mut without = BTreeMap::new();
    for (i, name) in names.iter().enumerate().filter(|_| possible) {
        let (x, y) = (kept(i, x), kept(i, y));
        let both = [pearson(&x, &y), spearman(&x, &y)];
        let left = if is_constant(&x) {
            "VAF"
        } else {
            "mean ratings"
        };
        let why = format!("without it all {left} are equal");
        let own = Without {
            pearson: Stat::or(both[0], why.clone()),
            spearman: Stat::or(both[1], why),
        };
        without.insert((*name).into(), own);
        for (r, (lowest, highest)) in both.iter().zip(&mut ends) {
            match r {
                Some(r) => (*lowest, *highest) = (lowest.min(*r), highest.max(*r)),
                None => {
                    complete = false;
                    // The correlation over all is defined but not without this one.
                    if defined && lost.is_none() {
                        let name = Untrusted(name);
                        lost = Some(format!("without `{name}` all {left} are equal"));
                    }
                }
            }
        }
    }
    let why = lost.map_or(why.into(), super::record::Why::from);
    let end = |x: f64| Stat::or(complete.then_some(x), why.clone());
    let [pearson, spearman] = ends;
    LeaveOneOut {
        without,
        pearson_min: end(pearson.0),
        pearson_max: end(pearson.1),
        spearman_min: end(spearman.0),
        spearman_max: end(spearman.1),
    }
}
