//! Maps of what participants have in common, and how many dimensions they take.

use super::{
    DimensionsName, Dissimilarities, Draws, Interval, MapOf, NO_MAP, SecondDimension, Stat,
    StressByChance, Why,
};
use std::collections::BTreeMap;
use study_stats::describe::{mean, sd};
use study_stats::paired::one_sample;
use study_stats::similarity::dimensions::{chosen, complete, most, predicted, structure};
use study_stats::similarity::scaling::{Map, Precision, Scale, Scaled, classical, smacof};

/// Random starts of a map that is reported.
const STARTS: usize = 100;
/// Stress of ordinal scaling below which other maps fit as well, so that distances say no more than an order. Few realizations come to
/// this, and few levels of one family nearly always do.
const NO_STRESS: f64 = 0.01;
const UNPREDICTED: &str = "the pairs of the others do not connect all realizations, or each participant's ratings are all equal";

/// Maps of the mean dissimilarities, and what is known of their dimensions.
pub(super) struct Maps {
    /// Of the chosen number of dimensions, in points of the scale.
    pub(super) map: Option<Map>,
    pub(super) scale: Scale,
    pub(super) stress: Option<f64>,
    pub(super) structure: StressByChance,
    pub(super) dimensions: BTreeMap<DimensionsName, MapOf>,
    pub(super) second: SecondDimension,
    /// Why there is no map.
    missing: Why,
}

impl Maps {
    pub(super) fn none(why: Why) -> Self {
        Self {
            map: None,
            scale: Scale::Ordinal,
            stress: None,
            structure: StressByChance::undefined(why.clone()),
            dimensions: BTreeMap::new(),
            second: SecondDimension::undefined(why.clone()),
            missing: why,
        }
    }

    pub(super) fn why(&self) -> Why {
        self.missing.clone()
    }
}

/// Maps of each number of dimensions, and the chosen one.
pub(super) struct Scaling {
    dimensions: BTreeMap<DimensionsName, MapOf>,
    /// How each number of dimensions predicts participants.
    predictions: Vec<Vec<Option<f64>>>,
    pub(super) scale: Scale,
    pub(super) map: Option<Scaled>,
}

/// `unit`: what the rescaled dissimilarities have in common; `starts`: random ones of each map.
pub(super) fn scaling(
    all: &[Dissimilarities],
    unit: &Dissimilarities,
    starts: usize,
    draws: &dyn Fn(&str) -> Draws,
) -> Scaling {
    let n = unit.objects();
    let mut fitted = Vec::new();
    let mut predictions: Vec<Vec<Option<f64>>> = Vec::new();
    let mut dimensions = BTreeMap::new();
    for k in 1..=most(n) {
        let of = |scale, stream: &str| {
            let random = &mut draws(&format!("{stream}/{k}"));
            smacof(unit, k, scale, starts, Precision::FINE, random)
        };
        let (ordinal, ratio) = (of(Scale::Ordinal, "map"), of(Scale::Ratio, "ratio"));
        let predicted = predicted(all, k, &mut draws(&format!("predicted/{k}")));
        let defined: Vec<f64> = predicted.iter().copied().flatten().collect();
        let alone = match all.len() {
            0 | 1 => "there are no other participants",
            _ => UNPREDICTED,
        };
        let se = sd(&defined).map(|sd| sd / (defined.len() as f64).sqrt());
        let own = MapOf {
            stress: Stat::or(ordinal.as_ref().map(|m| m.stress), NO_MAP),
            ratio_stress: Stat::or(ratio.as_ref().map(|m| m.stress), NO_MAP),
            classical: Stat::or(
                classical(unit, k).map(|c| c.share),
                "a pair was not rated, or no two differ",
            ),
            predicted: Stat::or(mean(&defined), alone),
            predicted_se: Stat::or(se, alone),
        };
        dimensions.insert(DimensionsName::from(k.to_string().as_str()), own);
        fitted.push((ordinal, ratio));
        predictions.push(predicted);
    }
    // With nobody to predict it is a plane, if there are enough realizations.
    let best = chosen(&predictions).unwrap_or(most(n).min(2));
    let (ordinal, ratio) = fitted.into_iter().nth(best - 1).unwrap_or_default();
    let (scale, map) = match ordinal {
        Some(found) if found.stress < NO_STRESS => (Scale::Ratio, ratio),
        other => (Scale::Ordinal, other),
    };
    Scaling {
        dimensions,
        predictions,
        scale,
        map,
    }
}

/// `unit`: what the rescaled dissimilarities have in common; `points`: what 1 is on the scale.
pub(super) fn maps(
    all: &[Dissimilarities],
    unit: &Dissimilarities,
    points: f64,
    draws: &dyn Fn(&str) -> Draws,
) -> Maps {
    let Scaling {
        dimensions,
        predictions,
        scale,
        map,
    } = scaling(all, unit, STARTS, draws);
    let random = &mut draws("structure");
    let tested = structure(all, random);
    let why = |x: Option<f64>| Stat::or(x, NO_MAP);
    Maps {
        scale,
        stress: map.as_ref().map(|m| m.stress),
        map: map.map(|m| m.map.scaled(points)),
        structure: StressByChance {
            dimensions: why(tested.map(|t| t.dimensions as f64)),
            stress: why(tested.map(|t| t.stress)),
            by_chance: why(tested.map(|t| t.by_chance)),
            p: why(tested.map(|t| t.p)),
        },
        dimensions,
        second: second(&predictions),
        missing: NO_MAP.into(),
    }
}

fn second(predictions: &[Vec<Option<f64>>]) -> SecondDimension {
    let known = complete(predictions);
    let [one, two, ..] = &known[..] else {
        return SecondDimension::undefined("there are fewer than six realizations");
    };
    let differences: Vec<f64> = two.iter().zip(one).map(|(two, one)| two - one).collect();
    let why = match differences.len() {
        0 | 1 => "there are fewer than two participants",
        _ => "all participants have the same difference",
    };
    let found = one_sample(&differences);
    SecondDimension {
        difference: Stat::or(found.map(|f| f.mean), why),
        ci95: Interval::or(found.map(|f| f.ci95), why),
        t: Stat::or(found.and_then(|f| f.t), why),
        df: Stat::or(found.map(|f| f.n as f64 - 1.0), why),
        p: Stat::or(found.and_then(|f| f.p), why),
    }
}
