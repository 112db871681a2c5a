//! Thresholds above a standard: increments, Weber fractions, Weber's law.

use super::marginal::Marginal;
use crate::analyze::record::{Interval, Number as _, Stat, statistics};
use study_plan::protocol::TrackRules;
use study_stats::describe::mean;
use study_stats::paired::one_sample;

statistics! {
    /// The threshold of a track that counts its levels from its standard.
    pub struct AboveStandard {
        /// the standard I
        standard: Stat,
        /// the distance of the threshold from it, ΔI: posterior median
        increment: Stat,
        /// equal-tailed
        increment_ci95: Interval,
        /// the level at the threshold, I + ΔI
        level: Stat,
        /// ΔI/I
        weber_fraction: Option<Stat>,
        /// equal-tailed
        weber_fraction_ci95: Option<Interval>,
    }

    /// Weber's law over the standards of a part: ΔI = c·I^exponent with 1 for the exponent; 0 if increments are equal.
    pub struct WebersLaw {
        /// mean over participants of their own slopes, by least squares, of ln ΔI on ln I
        exponent: Stat,
        /// t interval of the mean
        exponent_ci95: Interval,
        /// t of the test that the exponent is 1
        t: Stat,
        /// its degrees of freedom
        df: Stat,
        /// its p, two-sided
        p: Stat,
        /// participants with thresholds at two standards or more
        n: Stat,
    }
}

impl AboveStandard {
    /// Of the posterior of a threshold; `None` where levels are not counted from a standard.
    pub(super) fn of(rules: &TrackRules, threshold: &Marginal) -> Option<Self> {
        let (relative, standard) = (rules.relative?, rules.standard_level()?);
        let of = |counted: f64| relative.increment(counted, standard);
        let median = threshold.median.as_ref()?;
        let why = median.reason().unwrap_or_default().to_owned();
        let increment = median.number().map(of);
        let ends = threshold.ci95.as_ref().and_then(Interval::ends);
        let ends = ends.map(|(low, high)| (of(low), of(high)));
        let fraction = |x: f64| x / standard;
        let has_fraction = standard > 0.0;
        Some(Self {
            standard: Stat::of(standard),
            increment: Stat::or(increment, why.clone()),
            increment_ci95: Interval::or(ends, why.clone()),
            level: Stat::or(increment.map(|i| standard + i), why.clone()),
            weber_fraction: has_fraction.then(|| Stat::or(increment.map(fraction), why.clone())),
            weber_fraction_ci95: has_fraction.then(|| {
                let ends = ends.map(|(low, high)| (fraction(low), fraction(high)));
                Interval::or(ends, why)
            }),
        })
    }
}

/// Weber's law, of participant, standard and increment; nothing unless there are several
/// standards, all above 0.
pub(super) fn webers_law(thresholds: &[(&str, f64, f64)]) -> Option<WebersLaw> {
    let mut standards: Vec<f64> = thresholds.iter().map(|t| t.1).collect();
    standards.sort_by(f64::total_cmp);
    standards.dedup();
    if standards.len() < 2 || standards[0] <= 0.0 {
        return None;
    }
    let mut people: Vec<&str> = thresholds.iter().map(|t| t.0).collect();
    people.sort_unstable();
    people.dedup();
    let slope = |who: &&str| {
        let own = thresholds.iter().filter(|t| t.0 == *who && t.2 > 0.0);
        let points: Vec<(f64, f64)> = own.map(|t| (libm::log(t.1), libm::log(t.2))).collect();
        let [x, y] = [|p: &(f64, f64)| p.0, |p: &(f64, f64)| p.1].map(|of| {
            let all: Vec<f64> = points.iter().map(of).collect();
            mean(&all)
        });
        let (x, y) = (x?, y?);
        let squares: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
        let products: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
        (squares > 1e-12).then(|| products / squares)
    };
    let slopes: Vec<f64> = people.iter().filter_map(slope).collect();
    let few = "fewer than two participants have thresholds at two standards";
    let found = one_sample(&slopes);
    let apart: Vec<f64> = slopes.iter().map(|slope| slope - 1.0).collect();
    let test = one_sample(&apart);
    let why = test.map_or(few, |_| "the exponents of all participants are alike");
    Some(WebersLaw {
        exponent: Stat::or(found.map(|f| f.mean), few),
        exponent_ci95: Interval::or(found.map(|f| f.ci95), few),
        t: Stat::or(test.and_then(|t| t.t), why),
        df: Stat::or(test.map(|t| t.n as f64 - 1.0), why),
        p: Stat::or(test.and_then(|t| t.p), why),
        n: Stat::count(slopes.len()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::record::Field as _;

    /// Slopes by hand: of A exactly 1, of B ln 2/ln 4 = 1/2, of C 0 over two standards, of D none.
    #[test]
    fn the_exponent_is_the_mean_slope_of_the_participants() {
        let thresholds = [
            ("A", 0.2, 0.02),
            ("A", 0.4, 0.04),
            ("A", 0.8, 0.08),
            ("B", 0.2, 0.03),
            ("B", 0.8, 0.06),
            ("C", 0.2, 0.05),
            ("C", 0.4, 0.05),
            ("D", 0.4, 0.04),
        ];
        let values = webers_law(&thresholds).unwrap().values();
        // The mean of 1, .5 and 0; t(2) = (.5 − 1)/(.5/√3), p from R 4.2.2: 2*pt(-sqrt(3), 2).
        for (id, expected) in [
            ("exponent", 0.5),
            (
                "exponent_ci95_lo",
                0.5 - 4.302652729911275 * 0.5 / 3f64.sqrt(),
            ),
            (
                "exponent_ci95_hi",
                0.5 + 4.302652729911275 * 0.5 / 3f64.sqrt(),
            ),
            ("t", -(3f64.sqrt())),
            ("df", 2.0),
            ("p", 0.2254033307585166),
            ("n", 3.0),
        ] {
            let found = values.number(id).unwrap();
            assert!((found - expected).abs() < 1e-9, "{id}: {found} {expected}");
        }
    }

    #[test]
    fn one_standard_or_one_at_0_says_nothing_about_the_law() {
        let at = |standards: [f64; 2]| {
            let thresholds = standards.map(|standard| ("A", standard, 0.1));
            webers_law(&thresholds)
        };
        assert!(at([0.2, 0.2]).is_none());
        assert!(at([0.0, 0.2]).is_none());
        assert!(at([0.1, 0.2]).is_some());
    }
}
