//! Raters who set levels.
//!
//! A hand goes from its start towards the point at which a level feels equal to the standard, which differs by a bias of
//! the rater's own and by noise of each trial, and stays half a step behind: settings from below and from above differ, and
//! their mean does not.

use super::impression::{Impression, Reference};
use super::{Effect, Rater};
use std::collections::BTreeMap;
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};
use study_haptics::model::Realization;
use study_plan::protocol::{Adjustment, Protocol, Turn};

/// Standard deviation over raters of the bias, in steps of the ladder.
const BIAS_STEPS: f64 = 0.5;
/// Median standard deviation of the noise of a trial, in the same unit.
const NOISE_STEPS: f64 = 1.0;
/// How far a hand stays behind, in the same unit.
const BEHIND_STEPS: f64 = 0.5;
/// Share of trials in which the standard is felt again.
const COMPARES: f64 = 0.3;

/// A rater's ability to set levels.
#[derive(Debug)]
pub(super) struct Adjusting {
    stream: Stream,
    bias: f64,
    noise: f64,
}

impl Adjusting {
    pub(super) fn new(seed: u64, number: u32) -> Self {
        let mut stream = Stream::new(seed, &["rater", &number.to_string(), "adjusting"]);
        Self {
            bias: BIAS_STEPS * stream.normal(),
            noise: NOISE_STEPS * libm::exp(0.25 * stream.normal()),
            stream,
        }
    }
}

/// Where a hand goes in a trial.
#[derive(Debug, Clone, Copy)]
pub struct Aim {
    /// The place in the ladder, from 0, between steps.
    place: f64,
    /// Whether the standard is felt again before.
    pub compares: bool,
}

impl Rater {
    /// Where the hand goes that starts at a level. `equal`: the place in the ladder that feels equal to the standard.
    pub fn aim(&mut self, own: &Adjustment, start: &ModelId, equal: Option<f64>) -> Aim {
        let Adjusting {
            stream,
            bias,
            noise,
        } = &mut self.adjusting;
        let noise = *noise * stream.normal();
        let (anywhere, compares) = (stream.unit(), stream.unit() < COMPARES);
        let last = own.models.len().saturating_sub(1) as f64;
        let behind = match own.ascends_from(start) {
            true => -BEHIND_STEPS,
            false => BEHIND_STEPS,
        };
        let place = match equal.filter(|_| self.effect == Effect::BuiltIn) {
            Some(equal) => equal + *bias + noise + behind,
            None => anywhere * last,
        };
        Aim {
            place: place.clamp(0.0, last),
            compares,
        }
    }
}

impl Aim {
    /// A step towards it; `None` at the nearest level.
    pub fn turn(&self, own: &Adjustment, level: &ModelId) -> Option<Turn> {
        let at = own.models.iter().position(|m| m == level)? as f64;
        match self.place - at {
            left if left > 0.5 => Some(Turn::Higher),
            left if left < -0.5 => Some(Turn::Lower),
            _ => None,
        }
    }
}

/// Of each part of adjustment the place in its ladder that feels equal to its standard: of a level itself, of a realization
/// that of the nearest level, and without a standard that of the level with the highest opinion.
pub(super) fn equal(
    protocol: &Protocol,
    tables: &BTreeMap<ModelId, Realization>,
    impressions: &BTreeMap<ModelId, Impression>,
    reference: &Reference,
) -> BTreeMap<PartId, f64> {
    let mut equal = BTreeMap::new();
    for part in &protocol.parts {
        let Some(own) = part.task.adjustment() else {
            continue;
        };
        let worse = |model: &ModelId| match &own.standard {
            Some(standard) if standard == model => Some(0.0),
            Some(standard) => {
                let (level, standard) = (tables.get(model)?, tables.get(standard)?);
                Some(Impression::distance_n(level, standard, reference))
            }
            None => Some(-impressions.get(model)?.opinion(part.id.as_str())),
        };
        let places = own.models.iter().enumerate();
        let known = places.filter_map(|(at, model)| Some((at, worse(model)?)));
        let best = known.min_by(|a, b| a.1.total_cmp(&b.1));
        equal.extend(best.map(|(at, _)| (part.id.clone(), at as f64)));
    }
    equal
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_plan::protocol::AdjustmentWords;

    fn task() -> Adjustment {
        let id = |n: usize| ModelId::new(format!("f.{n}")).unwrap();
        Adjustment {
            family: PartId::new("f").unwrap(),
            models: (1..=21).map(id).collect(),
            standard: Some(id(11)),
            below: vec![id(1)],
            above: vec![id(21)],
            repetitions: 1,
            practice: 0,
            jnd: None,
            words: AdjustmentWords::default(),
        }
    }

    /// The place at which a hand stops, walked step by step.
    fn set(rater: &mut Rater, own: &Adjustment, start: &ModelId) -> f64 {
        let aim = rater.aim(own, start, Some(10.0));
        let mut level = start.clone();
        for _ in 0..100 {
            match aim.turn(own, &level) {
                Some(turn) => level = own.turned(&level, turn).unwrap().clone(),
                None => break,
            }
        }
        own.models.iter().position(|m| *m == level).unwrap() as f64
    }

    /// Over raters the mean of both sides is the point of equality, within its standard error; a hand stays behind.
    #[test]
    fn hands_come_to_the_point_of_equality() {
        let own = task();
        let (mut means, mut differences) = (Vec::new(), Vec::new());
        for number in 1..=300 {
            let mut rater = Rater::new(5, number, Effect::BuiltIn);
            let mut side = |start: &ModelId| {
                let all = (0..6).map(|_| set(&mut rater, &own, start));
                all.sum::<f64>() / 6.0
            };
            let (up, down) = (side(&own.below[0]), side(&own.above[0]));
            means.push(f64::midpoint(up, down));
            differences.push(up - down);
        }
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let se = |x: &[f64]| {
            let m = mean(x);
            let squares: f64 = x.iter().map(|v| (v - m).powi(2)).sum();
            (squares / (x.len() - 1) as f64 / x.len() as f64).sqrt()
        };
        let (center, error) = (mean(&means), se(&means));
        assert!((center - 10.0).abs() < 3.0 * error, "{center} ± {error}");
        let (behind, error) = (mean(&differences), se(&differences));
        assert!((behind + 1.0).abs() < 3.0 * error, "{behind} ± {error}");
    }
}
