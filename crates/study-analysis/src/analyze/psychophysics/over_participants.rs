//! What the participants have in common: `sdt_group/…` of sensitivities, `psy_mixed/…` of
//! thresholds in several conditions.

use crate::analyze::identifiers::{group_id, pair_id};
use crate::analyze::values::Values;
use std::collections::BTreeMap;
use study_stats::lmm::{CellSummary, FixedEffects, LmmData, adjusted_means};
use study_stats::paired::{holm, one_sample};

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
pub(super) fn sensitivities(told: &[Told], values: &mut Values) {
    let mut conditions: BTreeMap<&str, Vec<&Told>> = BTreeMap::new();
    for one in told {
        conditions.entry(&one.condition).or_default().push(one);
    }
    for (condition, told) in conditions {
        let prefix = group_id("sdt_group", &[condition]);
        let d: Vec<f64> = told.iter().map(|t| t.d).collect();
        let above: Vec<f64> = told.iter().map(|t| t.above_chance).collect();
        let few = "fewer than two participants have a sensitivity";
        for (name, x) in [("d", &d), ("above_chance", &above)] {
            let found = one_sample(x);
            let mut group = values.group(format!("{prefix}/{name}"), few);
            group.maybe("mean", found.map(|f| f.mean));
            group.maybe("sd", found.map(|f| f.sd));
            group.interval("ci95", found.map(|f| f.ci95));
        }
        let test = one_sample(&above);
        let why = match test {
            None => few,
            Some(_) => "all participants are alike",
        };
        let mut group = values.group(format!("{prefix}/above_chance"), why);
        group.maybe("t", test.and_then(|t| t.t));
        group.maybe("df", test.map(|t| t.n as f64 - 1.0));
        group.maybe("p", test.and_then(|t| t.p));
        values.group(prefix, "").put("n", told.len() as f64);
    }
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

/// The mixed model in `group`, threshold ~ condition + (1 | participant) by REML, F with Satterthwaite's
/// degrees of freedom, contrasts with Kenward and Roger's: of natural logarithms, so that differences are ratios, unless the
/// levels have no ratios, as those of a blend. Nothing with one condition.
pub(super) fn mixed(group: &str, thresholds: &[Threshold<'_>], ratios: bool, values: &mut Values) {
    let names = |of: fn(&Threshold<'_>) -> String| -> Vec<String> {
        let mut names: Vec<String> = thresholds.iter().map(of).collect();
        names.sort();
        names.dedup();
        names
    };
    let conditions = names(|t| t.condition.to_owned());
    let people = names(|t| t.participant.to_owned());
    if conditions.len() < 2 {
        return;
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
    let (mean, difference) = match ratios {
        true => ("geometric_mean", "ratio"),
        false => ("mean", "difference"),
    };
    let effect = fit.as_ref().and_then(|f| f.effect);
    let name = group;
    let mut group = values.group(name, why.as_str());
    group.maybe("F", effect.map(|e| e.f));
    group.maybe("df1", effect.map(|e| e.df1));
    group.maybe("df2", effect.and_then(|e| e.df2));
    group.maybe("p", effect.and_then(|e| e.p));
    let variances = fit.as_ref().map(|f| f.variances);
    group.maybe("sd_participant", variances.map(|v| v.intercept.sqrt()));
    group.maybe("sd_error", variances.map(|v| v.error.sqrt()));
    group.put("n_participants", people.len() as f64);
    for (i, condition) in conditions.iter().enumerate() {
        let found = fit.as_ref().map(|f| f.means[i]);
        let mut group = values.group(group_id(name, &[condition]), why.as_str());
        group.maybe(mean, found.map(|m| shown(m.estimate)));
        group.interval("ci95", found.and_then(|m| m.ci95).map(both));
    }
    let pairs: Vec<(usize, usize)> = (0..conditions.len())
        .flat_map(|a| (a + 1..conditions.len()).map(move |b| (a, b)))
        .collect();
    let found = |k: usize| fit.as_ref().map(|f| f.pairs[k]);
    let p: Vec<Option<f64>> = (0..pairs.len())
        .map(|k| found(k).and_then(|c| c.p))
        .collect();
    for ((k, (a, b)), p_holm) in pairs.iter().enumerate().zip(holm(&p)) {
        let contrast = found(k);
        let prefix = pair_id(name, &conditions[*a], &conditions[*b]);
        let mut group = values.group(prefix, why.as_str());
        group.maybe(difference, contrast.map(|c| shown(c.estimate)));
        group.interval("ci95", contrast.and_then(|c| c.ci95).map(both));
        group.maybe("t", contrast.and_then(|c| c.t));
        group.maybe("df", contrast.and_then(|c| c.df));
        group.maybe("p", p[k]);
        group.maybe("p_holm", p_holm);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    fn of(ratios: bool) -> Values {
        let thresholds = THRESHOLDS.map(|(participant, condition, value)| Threshold {
            participant,
            condition,
            value,
        });
        let mut values = Values::default();
        mixed("psy_mixed", &thresholds, ratios, &mut values);
        values
    }

    /// R 4.2.2: lmer(log(t) ~ c + (1|p)) of lme4 with lmerTest and emmeans
    /// (`lmer.df = "kenward-roger"`). Its search stops within 1e-6 of the optimum, which the
    /// degrees of freedom follow.
    #[test]
    fn conditions_are_compared_by_the_mixed_model_of_logarithms() {
        let values = of(true);
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
            let found = values.number(&format!("psy_mixed/{id}")).unwrap();
            assert!(
                (found / expected - 1.0).abs() < 2e-5,
                "{id}: {found} {expected}"
            );
        }
    }

    #[test]
    fn levels_without_ratios_have_differences() {
        let values = of(false);
        let number = |id: &str| values.number(&format!("psy_mixed/{id}"));
        assert_eq!(number("x|y/ratio"), None);
        let difference = number("x/mean").unwrap() - number("y/mean").unwrap();
        assert!((number("x|y/difference").unwrap() - difference).abs() < 1e-9);
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
        let mut values = Values::default();
        mixed("psy_mixed", &thresholds, true, &mut values);
        assert_eq!(values.reason("psy_mixed/F"), Some(NOT_POSITIVE));
        assert_eq!(values.reason("psy_mixed/x|y/ratio"), Some(NOT_POSITIVE));
    }

    #[test]
    fn chance_is_tested_by_what_can_fall_below_it() {
        // d′ is never below 0, so that its mean is above 0 by chance, too.
        let told = [0.04, -0.06, 0.05, -0.03].map(|above_chance: f64| Told {
            condition: "c".to_owned(),
            d: above_chance.max(0.0) * 10.0,
            above_chance,
        });
        let mut values = Values::default();
        sensitivities(&told, &mut values);
        assert!(values.number("sdt_group/c/d/mean").unwrap() > 0.2);
        assert!(values.number("sdt_group/c/above_chance/p").unwrap() > 0.9);
        assert_eq!(values.number("sdt_group/c/n"), Some(4.0));
    }
}
