//! The weights that participants give to the dimensions of a map that they share.

use super::{Dissimilarities, Draws, ParticipantName, RealizationName, Stat, Why};
use crate::analyze::record::statistics;
use std::collections::BTreeMap;
use study_stats::similarity::individual::{Weighted, common_fit, differ, weighted};
use study_stats::similarity::scaling::Precision;

statistics! {
    /// Where a realization lies in the map with weights, the sum of squares along each dimension of which is 1.
    pub struct WeightedPlace {
        /// along the dimension with the largest weights
        x: Stat,
        /// along the second dimension
        y: Stat,
        /// along the third dimension
        z: Option<Stat>,
    }

    /// How a participant weighs the dimensions: a squared weight is about the share of the own scalar products for which the dimension accounts.
    pub struct OwnWeights {
        /// weight of the first dimension, 0 or more
        x: Stat,
        /// weight of the second dimension
        y: Stat,
        /// weight of the third dimension
        z: Option<Stat>,
        /// share of the squares of the own scalar products for which the map accounts
        fit: Stat,
    }

    /// A map that participants share, whose dimensions each of them weighs (INDSCAL; Carroll & Chang 1970): of those who rated every pair.
    pub struct Weights {
        /// participants who rated every pair
        n: Stat,
        /// dimensions, as many as the map has
        dimensions: Stat,
        /// mean over participants of the share of the squares of their scalar products for which the map accounts
        fit: Stat,
        /// the same of a map whose dimensions all weigh alike, but for a factor of their own
        common_fit: Stat,
        /// mean of the difference of the two after the dissimilarities of each pair were dealt to the participants at random
        gain_by_chance: Stat,
        /// share of the deals with at least the observed difference, the observed one among them
        p: Stat,
        /// the map, by realization
        map: BTreeMap<RealizationName, WeightedPlace>,
        /// by participant
        participants: BTreeMap<ParticipantName, OwnWeights> as "participant",
    }
}

/// Random starts.
const STARTS: usize = 20;
const ONE_DIMENSION: &str = "the map has one dimension";
const FEW_PEOPLE: &str = "fewer than two participants rated every pair";
const NOT_FOUND: &str = "no map with weights was found";

/// Of the participants with their rescaled dissimilarities. `dimensions`: those of the map, or why there is none.
pub(super) fn weights(
    known: &[(&&str, Dissimilarities)],
    names: &[&str],
    dimensions: Result<usize, Why>,
    draws: &dyn Fn(&str) -> Draws,
) -> Weights {
    let dimensions = match dimensions {
        Ok(0 | 1) => return Weights::undefined(ONE_DIMENSION),
        Ok(dimensions) => dimensions,
        Err(why) => return Weights::undefined(why),
    };
    let whole = |own: &&(&&str, Dissimilarities)| own.1.values().iter().all(Option::is_some);
    let (people, all): (Vec<&str>, Vec<Dissimilarities>) = (known.iter().filter(whole))
        .map(|(who, own)| (**who, own.clone()))
        .unzip();
    if all.len() < 2 {
        return Weights::undefined(FEW_PEOPLE);
    }
    let random = &mut draws("weights");
    let Some(found) = weighted(&all, dimensions, STARTS, Precision::FINE, random) else {
        return Weights::undefined(NOT_FOUND);
    };
    let differ = differ(&all, dimensions, &mut draws("weights/dealt"));
    let third = |own: &[f64]| own.get(2).copied().map(Stat::of);
    let place = |(object, name): (usize, &&str)| {
        let at = found.map.point(object);
        let place = WeightedPlace {
            x: Stat::of(at[0]),
            y: Stat::of(at[1]),
            z: third(at),
        };
        (RealizationName::from(*name), place)
    };
    let own = |(person, name): (usize, &&str)| {
        let Weighted { weights, fits, .. } = &found;
        let own = OwnWeights {
            x: Stat::of(weights[person][0]),
            y: Stat::of(weights[person][1]),
            z: third(&weights[person]),
            fit: Stat::of(fits[person]),
        };
        (ParticipantName::from(*name), own)
    };
    Weights {
        n: Stat::count(all.len()),
        dimensions: Stat::count(dimensions),
        fit: Stat::of(found.fit()),
        common_fit: Stat::or(common_fit(&all, dimensions), NOT_FOUND),
        gain_by_chance: Stat::or(differ.map(|d| d.by_chance), NOT_FOUND),
        p: Stat::or(differ.map(|d| d.p), NOT_FOUND),
        map: names.iter().enumerate().map(place).collect(),
        participants: people.iter().enumerate().map(own).collect(),
    }
}
