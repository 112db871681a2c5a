//! What the participants have in common: `sdt_group/…` of sensitivities, `psy_mixed/…` of
//! thresholds in several conditions.

use crate::analyze::keys::ConditionName;
use crate::analyze::record::{Interval, Number as _, PairName, Stat, statistics};
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;
use study_stats::lmm::{CellSummary, FixedEffects, LmmData, adjusted_means};
use study_stats::paired::{holm, one_sample};

statistics! {
    /// Numbers of participants.
    pub struct Sample {
        /// their mean
        mean: Stat,
        /// their standard deviation
        sd: Stat,
        /// t interval of the mean
        ci95: Interval,
    }

    /// Whether participants tell from chance.
    pub struct AboveChance {
        /// how far they are above chance
        sample: Sample as "",
        /// t of the test against 0
        t: Stat,
        /// its degrees of freedom
        df: Stat,
        /// its p, two-sided
        p: Stat,
    }

    /// Sensitivities of a condition.
    pub struct GroupSensitivity {
        /// d′
        d: Sample,
        /// d′ of yes–no and 2IFC; elsewhere d′ is never below 0, and the share of correct answers less that by guessing is tested, or `share_unbiased` − ½
        above_chance: AboveChance,
        /// participants with a sensitivity
        n: Stat,
    }

    /// A condition or a group.
    pub struct Center {
        /// number of participants
        n: Option<Stat>,
        /// geometric mean, where numbers have ratios
        geometric_mean: Option<Stat>,
        /// mean, where they have none
        mean: Option<Stat>,
        /// geometric standard deviation
        geometric_sd: Option<Stat>,
        /// standard deviation
        sd: Option<Stat>,
        /// of the mean
        ci95: Option<Interval>,
    }

    /// The contrast of two conditions or groups.
    pub struct Contrast {
        /// ratio, where numbers have ratios
        ratio: Option<Stat>,
        /// difference, where they have none
        difference: Option<Stat>,
        /// of the ratio or difference
        ci95: Interval,
        /// t
        t: Stat,
        /// its degrees of freedom
        df: Stat,
        /// its p
        p: Stat,
        /// with Holm's correction
        p_holm: Stat,
        /// Hedges's g, of groups
        hedges_g: Option<Stat>,
    }

    /// A test of several means.
    pub struct FTest {
        /// F
        f: Stat as "F",
        /// its degrees of freedom
        df1: Stat,
        /// those of its denominator
        df2: Stat,
        /// its p
        p: Stat,
    }

    /// The mixed model number ~ condition + (1 | participant) by REML, of logarithms where numbers have ratios: F with Satterthwaite's degrees of freedom, contrasts with Kenward and Roger's.
    pub struct ConditionModel {
        /// whether the conditions differ
        test: FTest as "",
        /// standard deviation of participants
        sd_participant: Stat,
        /// standard deviation of what remains
        sd_error: Stat,
        /// number of participants
        n_participants: Stat,
        /// by condition
        conditions: BTreeMap<ConditionName, Center> as "",
        /// by pair of conditions
        pairs: BTreeMap<PairName, Contrast> as "",
    }
}

impl Center {
    /// The mean or, of ratios, the geometric mean.
    pub fn mean(&self) -> Option<f64> {
        self.geometric_mean.number().or(self.mean.number())
    }

    /// The standard deviation or, of ratios, the geometric one.
    pub fn sd(&self) -> Option<f64> {
        self.geometric_sd.number().or(self.sd.number())
    }
}

impl Contrast {
    /// The ratio or the difference, and what it is called.
    pub fn estimate(&self) -> (&'static str, Option<f64>) {
        match &self.ratio {
            Some(ratio) => ("ratio", ratio.number()),
            None => ("difference", self.difference.number()),
        }
    }
}

/// The sensitivity of one participant in one condition.
#[derive(Debug, Clone)]
pub(super) struct Told {
    pub(super) condition: String,
    /// d′.
    pub(super) d: f64,
    /// What is 0 by chance, and can fall below: d′ itself or, where d′ is never below 0,
    /// the share of correct answers less that by guessing.
    pub(super) above_chance: f64,
}

/// Means over participants of each condition; t tests that they tell it from chance.
pub(super) fn sensitivities(told: &[Told]) -> BTreeMap<ConditionName, GroupSensitivity> {
    let mut conditions: BTreeMap<&str, Vec<&Told>> = BTreeMap::new();
    for one in told {
        conditions.entry(&one.condition).or_default().push(one);
    }
    let few = "fewer than two participants have a sensitivity";
    let sample = |x: &[f64]| {
        let found = one_sample(x);
        Sample {
            mean: Stat::or(found.map(|f| f.mean), few),
            sd: Stat::or(found.map(|f| f.sd), few),
            ci95: Interval::or(found.map(|f| f.ci95), few),
        }
    };
    let of_condition = |(condition, told): (&str, Vec<&Told>)| {
        let d: Vec<f64> = told.iter().map(|t| t.d).collect();
        let above: Vec<f64> = told.iter().map(|t| t.above_chance).collect();
        let test = one_sample(&above);
        let why = test.map_or(few, |_| "all participants are alike");
        let above_chance = AboveChance {
            sample: sample(&above),
            t: Stat::or(test.and_then(|t| t.t), why),
            df: Stat::or(test.map(|t| t.n as f64 - 1.0), why),
            p: Stat::or(test.and_then(|t| t.p), why),
        };
        let group = GroupSensitivity {
            d: sample(&d),
            above_chance,
            n: Stat::count(told.len()),
        };
        (condition.into(), group)
    };
    conditions.into_iter().map(of_condition).collect()
}

/// Why there are no ratios of thresholds.
pub(super) const NOT_POSITIVE: &str = "a threshold is estimated at or below 0, where there are no ratios: the \
     levels do not bracket it, or its trials are too few";

/// A threshold, or another number of one participant in one condition.
#[derive(Debug, Clone)]
pub(super) struct Threshold<'a> {
    pub(super) participant: &'a str,
    pub(super) condition: &'a str,
    pub(super) value: f64,
}

/// A number of one participant in one condition and session.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Participant. Untrusted.
    pub participant: String,
    /// Group of the participant, if the study has groups.
    pub group: Option<String>,
    /// Session, if several sessions have the part.
    pub session: Option<String>,
    /// Track or realization. Untrusted.
    pub condition: String,
    /// A threshold, a sensitivity, a mean rating.
    pub value: f64,
}

/// The mixed model threshold ~ condition + (1 | participant) by REML, F with Satterthwaite's
/// degrees of freedom, contrasts with Kenward and Roger's: of natural logarithms, so that differences are ratios, unless the
/// levels have no ratios, as those of a blend. Nothing with one condition.
pub(super) fn mixed(thresholds: &[Threshold<'_>], ratios: bool) -> Option<ConditionModel> {
    let names = |of: fn(&Threshold<'_>) -> String| -> Vec<String> {
        let mut names: Vec<String> = thresholds.iter().map(of).collect();
        names.small_sort();
        names.dedup();
        names
    };
    let conditions = names(|t| t.condition.to_owned());
    let people = names(|t| t.participant.to_owned());
    if conditions.len() < 2 {
        return None;
    }
    let place = |list: &[String], name: &str| list.iter().position(|n| n == name).unwrap_or(0);
    let positive = thresholds.iter().all(|t| t.value > 0.0);
    let cells: Vec<CellSummary> = (thresholds.iter())
        .map(|t| CellSummary {
            subject: place(&people, t.participant),
            realization: place(&conditions, t.condition),
            x: 0.0,
            n: 1,
            mean: if ratios { libm::log(t.value) } else { t.value },
            within: 0.0,
        })
        .collect();
    let fit = LmmData::new(&cells, FixedEffects::Realizations).and_then(|t| adjusted_means(&t));
    let why = match &fit {
        _ if ratios && !positive => NOT_POSITIVE.to_owned(),
        Err(why) => why.to_string().replace("rating", "threshold"),
        Ok(_) => "the likelihood is too flat for degrees of freedom".to_owned(),
    };
    let fit = fit.ok().filter(|_| positive || !ratios);
    let shown = |x: f64| if ratios { libm::exp(x) } else { x };
    let both = |(low, high): (f64, f64)| (shown(low), shown(high));
    let stat = |x: Option<f64>| Stat::or(x, why.clone());
    let interval = |ci95: Option<(f64, f64)>| Interval::or(ci95.map(both), why.clone());
    // What is given of ratios, and what of differences.
    let either = |x: Option<f64>| {
        let [ratio, difference] = [ratios, !ratios].map(|shown| shown.then(|| stat(x)));
        (ratio, difference)
    };
    let centers = conditions.iter().enumerate().map(|(i, condition)| {
        let found = fit.as_ref().map(|f| f.means[i]);
        let (geometric_mean, mean) = either(found.map(|m| shown(m.estimate)));
        let center = Center {
            geometric_mean,
            mean,
            ci95: Some(interval(found.and_then(|m| m.ci95))),
            ..Center::undefined("")
        };
        (condition.as_str().into(), center)
    });
    let pairs: Vec<PairName> = (conditions.iter().enumerate())
        .flat_map(|(i, a)| conditions[i + 1..].iter().map(|b| PairName::of(a, b)))
        .collect();
    let found = |k: usize| fit.as_ref().map(|f| f.pairs[k]);
    let p: Vec<Option<f64>> = (0..pairs.len())
        .map(|k| found(k).and_then(|c| c.p))
        .collect();
    let p_holm = holm(&p);
    let contrasts = pairs.into_iter().enumerate().map(|(k, pair)| {
        let contrast = found(k);
        let (ratio, difference) = either(contrast.map(|c| shown(c.estimate)));
        let contrast = Contrast {
            ratio,
            difference,
            ci95: interval(contrast.and_then(|c| c.ci95)),
            t: stat(contrast.and_then(|c| c.t)),
            df: stat(contrast.and_then(|c| c.df)),
            p: stat(p[k]),
            p_holm: stat(p_holm[k]),
            hedges_g: None,
        };
        (pair, contrast)
    });
    let effect = fit.as_ref().and_then(|f| f.effect);
    let variances = fit.as_ref().map(|f| f.variances);
    let test = FTest {
        f: stat(effect.map(|e| e.f)),
        df1: stat(effect.map(|e| e.df1)),
        df2: stat(effect.and_then(|e| e.df2)),
        p: stat(effect.and_then(|e| e.p)),
    };
    Some(ConditionModel {
        test,
        sd_participant: stat(variances.map(|v| v.intercept.sqrt())),
        sd_error: stat(variances.map(|v| v.error.sqrt())),
        n_participants: Stat::count(people.len()),
        conditions: centers.collect(),
        pairs: contrasts.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::record::Field as _;

    /// Thresholds of five participants in three conditions; D has none in z.
    const THRESHOLDS: [(&str, &str, f64); 14] = [
        ("A", "x", 0.31),
        ("A", "y", 0.42),
        ("A", "z", 0.55),
        ("B", "x", 0.22),
        ("B", "y", 0.35),
        ("B", "z", 0.30),
        ("C", "x", 0.45),
        ("C", "y", 0.51),
        ("C", "z", 0.80),
        ("D", "x", 0.28),
        ("D", "y", 0.33),
        ("E", "x", 0.39),
        ("E", "y", 0.61),
        ("E", "z", 0.66),
    ];

    fn of(ratios: bool) -> ConditionModel {
        let thresholds = THRESHOLDS.map(|(participant, condition, value)| Threshold {
            participant,
            condition,
            value,
        });
        mixed(&thresholds, ratios).unwrap()
    }

    /// R 4.2.2: lmer(log(t) ~ c + (1|p)) of lme4 with lmerTest and emmeans
    /// (`lmer.df = "kenward-roger"`). Its search stops within 1e-6 of the optimum, which the
    /// degrees of freedom follow.
    #[test]
    fn conditions_are_compared_by_the_mixed_model_of_logarithms() {
        let values = of(true).values();
        for (id, expected) in [
            ("F", 15.39607),
            ("df1", 2.0),
            ("df2", 7.070728704),
            ("p", 0.0026522),
            ("sd_participant", 0.2859466002),
            ("sd_error", 0.1305492018),
            ("x/geometric_mean", 0.319921852099),
            ("x/ci95_lo", 0.222829973271),
            ("z/ci95_hi", 0.745733322319),
            ("x|y/ratio", 0.740112344923),
            ("x|y/ci95_lo", 0.608847212186),
            ("x|z/t", -5.37171391024),
            ("x|z/df", 7.06918395354),
            ("y|z/p", 0.08139892217989),
            ("x|y/p_holm", 0.01646204458111),
        ] {
            let found = values.number(id).unwrap();
            assert!(
                (found / expected - 1.0).abs() < 2e-5,
                "{id}: {found} {expected}"
            );
        }
    }

    /// A protocol may declare its tracks in any order.
    #[test]
    fn a_contrast_is_that_of_its_names_whatever_comes_first() {
        let mut thresholds = THRESHOLDS.map(|(participant, condition, value)| Threshold {
            participant,
            condition,
            value,
        });
        thresholds.reverse();
        let found = mixed(&thresholds, true).unwrap();
        for (name, contrast) in &of(true).pairs {
            let [found, expected] = [&found.pairs[name], contrast].map(|c| c.ratio.number());
            assert!((found.unwrap() / expected.unwrap() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn levels_without_ratios_have_differences() {
        let model = of(false);
        let (name, found) = model.pairs[&PairName::of("x", "y")].estimate();
        let [x, y] = ["x", "y"].map(|name| model.conditions[name].mean().unwrap());
        assert_eq!(name, "difference");
        assert!((found.unwrap() - (x - y)).abs() < 1e-9);
    }

    #[test]
    fn a_threshold_of_0_has_no_logarithm() {
        let at = |value| {
            ["A", "B"].map(|participant| Threshold {
                participant,
                condition: "x",
                value,
            })
        };
        let mut thresholds: Vec<Threshold<'_>> = at(0.0).into();
        let other = at(0.4).map(|t| Threshold {
            condition: "y",
            ..t
        });
        thresholds.extend(other);
        let model = mixed(&thresholds, true).unwrap();
        assert_eq!(model.test.f.reason(), Some(NOT_POSITIVE));
        let contrast = &model.pairs[&PairName::of("x", "y")];
        assert_eq!(contrast.ratio.reason(), Some(NOT_POSITIVE));
    }

    #[test]
    fn chance_is_tested_by_what_can_fall_below_it() {
        // d′ is never below 0, so that its mean is above 0 by chance, too.
        let told = [0.04, -0.06, 0.05, -0.03].map(|above_chance: f64| Told {
            condition: "c".to_owned(),
            d: above_chance.max(0.0) * 10.0,
            above_chance,
        });
        let found = &sensitivities(&told)["c"];
        assert!(found.d.mean.number().unwrap() > 0.2);
        assert!(found.above_chance.p.number().unwrap() > 0.9);
        assert_eq!(found.n.number(), Some(4.0));
    }
}
