//! Similarity: `similarity/…`.

mod maps;
mod people;
mod weights;

use crate::analyze::draws::Draws;
use crate::analyze::keys::{DimensionsName, PropertyName};
use crate::analyze::record::{
    Interval, PairName, ParticipantName, RealizationName, Stat, Why, statistics,
};
use maps::{Maps, maps, scaling};
use people::{Own, people};
use std::collections::{BTreeMap, BTreeSet};
use study_stats::describe::{mean, sd};
use study_stats::similarity::dimensions::MOST_OBJECTS;
use study_stats::similarity::fit::{followed, resampled};
use study_stats::similarity::scaling::{Map, Scale};
use study_stats::similarity::{
    Dissimilarities, agreement, asymmetry, pairs as pairs_of, with_the_others,
};
use weights::weights;
pub use weights::{OwnWeights, WeightedPlace, Weights};

statistics! {
    /// Whether participants find the same pairs different.
    pub struct Agreed {
        /// mean over pairs of participants of the correlation of their dissimilarities
        mean_correlation: Stat,
        /// Kendall's W of those who rated every pair
        kendall_w: Stat,
        /// participants who rated every pair
        n_complete: Stat,
    }

    /// Whether it matters which of two is felt first.
    pub struct OrderOfPairs {
        /// root mean square over pairs of the mean difference of the two orders, in points of the scale
        rms: Stat,
        /// its p, if the signs of all differences are drawn
        p: Stat,
        /// pairs that somebody rated in both orders
        n_pairs: Stat,
    }

    /// Ratings of a realization beside itself.
    pub struct IdenticalPairs {
        /// number of ratings
        n: Stat,
        /// mean over participants
        mean: Stat,
        /// the same as a share of the mean of pairs of different realizations
        share: Stat,
        /// participants whose mean is not below that of their different pairs
        n_not_below: Stat,
    }

    /// Whether a map has less stress than by chance.
    pub struct StressByChance {
        /// dimensions of the map that is compared
        dimensions: Stat,
        /// its stress, of ratio scaling
        stress: Stat,
        /// mean stress after each participant's ratings were dealt to the pairs at random
        by_chance: Stat,
        /// share of the deals with no more stress, the observed one among them
        p: Stat,
    }

    /// A map of so many dimensions.
    pub struct MapOf {
        /// Kruskal's stress 1 of ordinal scaling
        stress: Stat,
        /// the same of ratio scaling
        ratio_stress: Stat,
        /// share of the absolute eigenvalues of classical scaling that these dimensions have
        classical: Stat,
        /// mean over participants of Spearman's correlation of their dissimilarities with the distances in the map of all others
        predicted: Stat,
        /// standard error of this mean
        predicted_se: Stat,
    }

    /// Whether two dimensions predict a participant better than one.
    pub struct SecondDimension {
        /// mean over participants of the difference of the two correlations
        difference: Stat,
        /// t interval of the mean
        ci95: Interval,
        /// t of the test against 0
        t: Stat,
        /// its degrees of freedom
        df: Stat,
        /// its p, two-sided
        p: Stat,
    }

    /// Where a realization lies in the map, in points of the scale.
    pub struct Place {
        /// along the longest axis
        x: Stat,
        /// standard error over participants, by the bootstrap
        x_se: Stat,
        /// along the second axis
        y: Option<Stat>,
        /// standard error over participants, by the bootstrap
        y_se: Option<Stat>,
        /// along the third axis
        z: Option<Stat>,
        /// standard error over participants, by the bootstrap
        z_se: Option<Stat>,
    }

    /// How the map lies to properties of the realizations.
    pub struct MapFit {
        /// number of properties
        properties: Stat,
        /// correlation of map and properties after Procrustes' rotation
        r: Stat,
        /// interval over participants, by the bootstrap
        ci95: Interval,
        /// p over the orders of the realizations
        p: Stat,
        /// whether all orders were enumerated
        exact: Stat,
        /// the smallest p that properties with these values could have
        smallest_p: Stat,
    }

    /// A pair of realizations.
    pub struct PairDifference {
        /// number of ratings
        n: Stat,
        /// mean over participants of their means
        mean: Stat,
        /// standard deviation of their means
        sd: Stat,
        /// mean after the participants' ratings were brought to the same mean, in points of the scale: what is scaled
        rescaled: Stat,
        /// distance in the map
        distance: Stat,
    }

    /// A participant.
    pub struct OwnDifferences {
        /// number of ratings of pairs of different realizations
        n: Stat,
        /// their mean
        mean: Stat,
        /// mean rating of identical pairs
        identical: Option<Stat>,
        /// correlation of the dissimilarities with the mean of all others
        with_others: Stat,
    }

    /// Ratings of how different realizations are.
    pub struct Similarities {
        /// number of ratings of pairs of different realizations
        n: Stat,
        /// their mean over participants
        mean: Stat,
        /// participants on whom the map rests
        n_participants: Stat,
        /// agreement of the participants
        agreement: Agreed,
        /// order within pairs
        order: OrderOfPairs,
        /// identical pairs, if there are any
        identical: Option<IdenticalPairs>,
        /// structure
        structure: StressByChance,
        /// by number of dimensions
        dimensions: BTreeMap<DimensionsName, MapOf>,
        /// the second dimension
        second: SecondDimension,
        /// dimensions of the map
        map_dimensions: Stat,
        /// whether its distances are in proportion to the dissimilarities (1), because their order alone fits without stress, or in their order (0)
        map_in_proportion: Stat,
        /// stress of the map
        map_stress: Stat,
        /// the map, by realization
        map: BTreeMap<RealizationName, Place>,
        /// weights of dimensions
        weights: Weights,
        /// by property of the realizations
        follows: BTreeMap<PropertyName, MapFit>,
        /// by pair
        pairs: BTreeMap<PairName, PairDifference> as "pair",
        /// by participant
        participants: BTreeMap<ParticipantName, OwnDifferences> as "participant",
    }
}

/// One rating.
#[derive(Debug, Clone, PartialEq)]
pub struct SimilarityRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// What was felt first. Untrusted.
    pub first: String,
    /// What was felt second. Untrusted.
    pub second: String,
    /// How different they were: 0 if they were alike.
    pub rating: f64,
}

/// A set of properties: of each the values by realization.
pub type Properties = BTreeMap<String, Vec<BTreeMap<String, f64>>>;

const NO_RATINGS: &str = "there are no ratings of two different realizations";
const ALL_ALIKE: &str = "no two different realizations were rated as different";
const ONE_PARTICIPANT: &str = "there is one participant";
const FEW: &str = "there are fewer than four realizations";
const MANY: &str = "there are more than 30 realizations";
const NO_MAP: &str = "the rated pairs do not connect all realizations, or no two differ";

/// The statistics of ratings of difference. `seed` and `name` are those of the random streams.
pub fn similarity(
    rows: &[SimilarityRow],
    properties: &Properties,
    (seed, name): (u64, &str),
) -> Similarities {
    let felt: BTreeSet<&str> = (rows.iter())
        .flat_map(|r| [r.first.as_str(), r.second.as_str()])
        .collect();
    let names: Vec<&str> = felt.into_iter().collect();
    let draws = |of: &str| Draws::new(seed, &format!("similarity/{name}/{of}"));
    let people = people(rows, &names);
    let known: Vec<(&&str, Dissimilarities)> = (people.iter())
        .filter_map(|(who, own)| Some((who, own.dissimilarities(names.len()).rescaled()?)))
        .collect();
    let all: Vec<Dissimilarities> = known.iter().map(|k| k.1.clone()).collect();
    let means: Vec<f64> = people.values().filter_map(Own::mean).collect();
    let unit = Dissimilarities::in_common(all.iter());
    let points = unit.as_ref().and_then(|unit| points_of(&people, unit));
    let none = match means.is_empty() {
        true => NO_RATINGS,
        false => ALL_ALIKE,
    };
    let few: Option<Why> = match names.len() {
        _ if all.is_empty() => Some(none.into()),
        0..4 => Some(FEW.into()),
        n if n > MOST_OBJECTS => Some(MANY.into()),
        _ => None,
    };
    let scaled = match (&few, points, &unit) {
        (None, Some(points), Some(unit)) => maps(&all, unit, points, &draws),
        _ => Maps::none(few.clone().unwrap_or_else(|| NO_MAP.into())),
    };
    let others = with_the_others(&all);
    let with_others = |who: &&str| {
        let at = known.iter().position(|k| *k.0 == *who)?;
        others[at]
    };
    let participants = people.iter().map(|(who, own)| {
        let why = match all.len() {
            0 | 1 => "there are no other participants",
            _ => "all ratings are equal, or the others did not rate two of these pairs",
        };
        let identical: Vec<f64> = own.identical.values().flatten().copied().collect();
        let record = OwnDifferences {
            n: Stat::count(own.different().len()),
            mean: Stat::or(own.mean(), NO_RATINGS),
            identical: mean(&identical).map(Stat::of),
            with_others: Stat::or(with_others(who), why),
        };
        (ParticipantName::from(*who), record)
    });
    Similarities {
        n: Stat::count(people.values().map(|own| own.different().len()).sum()),
        mean: Stat::or(mean(&means), NO_RATINGS),
        n_participants: Stat::count(all.len()),
        agreement: agreed(&all, none),
        order: order(&people, names.len(), &mut draws("order")),
        identical: identical(&people),
        weights: {
            let dimensions = scaled.map.as_ref().map(Map::dimensions);
            weights(
                &known,
                &names,
                dimensions.ok_or_else(|| scaled.why()),
                &draws,
            )
        },
        follows: follows(&scaled, &all, properties, &names, &draws),
        participants: participants.collect(),
        pairs: pairs(&people, &names, unit.as_ref(), points, scaled.map.as_ref()),
        map: places(&scaled, &all, &names, &mut draws("errors")),
        map_dimensions: Stat::or(
            scaled.map.as_ref().map(|m| m.dimensions() as f64),
            scaled.why(),
        ),
        map_in_proportion: match &scaled.map {
            Some(_) => Stat::flag(scaled.scale == Scale::Ratio),
            None => Stat::missing(scaled.why()),
        },
        map_stress: Stat::or(scaled.stress, scaled.why()),
        structure: scaled.structure,
        dimensions: scaled.dimensions,
        second: scaled.second,
    }
}

/// Random starts of the maps of simulated studies.
const SIMULATED_STARTS: usize = 10;

/// How the map of some ratings follows a property of the realizations, as that of [`similarity`] but from fewer random starts and without
/// an interval. `None` without a map.
pub(super) fn property_followed(
    rows: &[SimilarityRow],
    property: &BTreeMap<String, f64>,
    seed: u64,
) -> Option<MapFit> {
    let names: Vec<&str> = property.keys().map(String::as_str).collect();
    let all: Vec<Dissimilarities> = (people(rows, &names).values())
        .filter_map(|own| own.dissimilarities(names.len()).rescaled())
        .collect();
    let unit = Dissimilarities::in_common(all.iter())?;
    let draws = |of: &str| Draws::new(seed, &format!("similarity/power/{of}"));
    let map = scaling(&all, &unit, SIMULATED_STARTS, &draws).map?.map;
    let columns = [property.values().copied().collect::<Vec<f64>>()];
    let found = followed(&map, &columns, &mut draws("follows"))?;
    Some(MapFit {
        properties: Stat::count(columns.len()),
        r: Stat::of(found.r),
        ci95: Interval::or(None, "the interval is not simulated"),
        p: Stat::of(found.p),
        exact: Stat::flag(found.exact),
        smallest_p: Stat::of(found.smallest),
    })
}

/// Mean over participants of the factor between what they rated and what all have in common, in points of the scale.
fn points_of(people: &BTreeMap<&str, Own>, unit: &Dissimilarities) -> Option<f64> {
    let factor = |own: &Own| {
        let rated =
            pairs_of(unit.objects()).filter_map(|(a, b)| Some([own.pair(a, b)?, unit.get(a, b)?]));
        let [points, units] = rated.fold([0.0, 0.0], |sum, [x, y]| [sum[0] + x, sum[1] + y]);
        Some(points / units).filter(|factor| factor.is_finite())
    };
    let factors: Vec<f64> = people.values().filter_map(factor).collect();
    mean(&factors)
}

/// `none`: why nobody is there, if so.
fn agreed(all: &[Dissimilarities], none: &'static str) -> Agreed {
    let found = agreement(all);
    let few: &'static str = match all.len() {
        0 => none,
        1 => ONE_PARTICIPANT,
        _ => "no two participants have ratings that can be correlated",
    };
    let complete = match found.complete {
        0 | 1 => "fewer than two participants rated every pair",
        _ if all.iter().all(|own| own.known().len() < 2) => "one pair was rated",
        _ => "each participant's ratings are all equal",
    };
    Agreed {
        mean_correlation: Stat::or(found.mean_correlation, few),
        kendall_w: Stat::or(found.kendall_w, complete),
        n_complete: Stat::count(found.complete),
    }
}

fn order(people: &BTreeMap<&str, Own>, realizations: usize, draws: &mut Draws) -> OrderOfPairs {
    let of = |own: &Own| -> Vec<Option<f64>> {
        let difference = |(a, b)| Some(mean(own.of(a, b))? - mean(own.of(b, a))?);
        pairs_of(realizations).map(difference).collect()
    };
    let differences: Vec<Vec<Option<f64>>> = people.values().map(of).collect();
    let found = asymmetry(&differences, draws);
    let why = "nobody rated a pair in both orders";
    OrderOfPairs {
        rms: Stat::or(found.map(|f| f.rms), why),
        p: Stat::or(found.map(|f| f.p), why),
        n_pairs: Stat::count(found.map_or(0, |f| f.pairs)),
    }
}

fn identical(people: &BTreeMap<&str, Own>) -> Option<IdenticalPairs> {
    let of = |own: &Own| {
        let ratings: Vec<f64> = own.identical.values().flatten().copied().collect();
        Some((ratings.len(), mean(&ratings)?, own.mean()))
    };
    let found: Vec<(usize, f64, Option<f64>)> = people.values().filter_map(of).collect();
    let means: Vec<f64> = found.iter().map(|f| f.1).collect();
    let different: Vec<f64> = found.iter().filter_map(|f| f.2).collect();
    let all = mean(&means)?;
    let share = mean(&different).filter(|d| *d > 0.0).map(|d| all / d);
    let not_below = found.iter().filter(|f| f.2.is_some_and(|d| f.1 >= d));
    Some(IdenticalPairs {
        n: Stat::count(found.iter().map(|f| f.0).sum()),
        mean: Stat::of(all),
        share: Stat::or(share, ALL_ALIKE),
        n_not_below: Stat::count(not_below.count()),
    })
}

fn places(
    scaled: &Maps,
    all: &[Dissimilarities],
    names: &[&str],
    draws: &mut Draws,
) -> BTreeMap<RealizationName, Place> {
    let Some(map) = &scaled.map else {
        return BTreeMap::new();
    };
    let found = resampled(all, (map, scaled.scale), &[], draws);
    let why = match all.len() {
        1 => ONE_PARTICIPANT,
        _ => "too few resamples of the participants have a map",
    };
    let one = |(object, name): (usize, &&str)| {
        let at = |k: usize| map.point(object).get(k).copied();
        let error = |k: usize| {
            let error = found.as_ref().map(|found| found.errors[object][k]);
            Stat::or(error, why)
        };
        let other = |k: usize| at(k).map(|x| (Stat::of(x), error(k)));
        let ((y, y_se), (z, z_se)) = (other(1).unzip(), other(2).unzip());
        let place = Place {
            x: Stat::or(at(0), NO_MAP),
            x_se: error(0),
            y,
            y_se,
            z,
            z_se,
        };
        (RealizationName::from(*name), place)
    };
    names.iter().enumerate().map(one).collect()
}

fn follows(
    scaled: &Maps,
    all: &[Dissimilarities],
    properties: &Properties,
    names: &[&str],
    draws: &dyn Fn(&str) -> Draws,
) -> BTreeMap<PropertyName, MapFit> {
    let of = |(name, own): (&String, &Vec<BTreeMap<String, f64>>)| {
        let columns: Option<Vec<Vec<f64>>> = (own.iter())
            .map(|values| {
                names
                    .iter()
                    .map(|name| values.get(*name).copied())
                    .collect()
            })
            .collect();
        let fit = match (&scaled.map, columns) {
            (None, _) => MapFit::undefined(scaled.why()),
            (_, None) => MapFit::undefined("a realization has no such property"),
            (Some(map), Some(columns)) => fit((map, scaled.scale), all, &columns, name, draws),
        };
        (PropertyName::from(name.as_str()), fit)
    };
    properties.iter().map(of).collect()
}

fn fit(
    (map, scale): (&Map, Scale),
    all: &[Dissimilarities],
    columns: &[Vec<f64>],
    name: &str,
    draws: &dyn Fn(&str) -> Draws,
) -> MapFit {
    let constant = "a property is the same of all realizations";
    let found = followed(map, columns, &mut draws(&format!("follows/{name}")));
    let random = &mut draws(&format!("resampled/{name}"));
    let interval = found.and_then(|_| resampled(all, (map, scale), columns, random)?.r_ci95);
    let why = match (found, all.len()) {
        (None, _) => constant,
        (_, 1) => ONE_PARTICIPANT,
        _ => "too few resamples of the participants have a map",
    };
    MapFit {
        properties: Stat::count(columns.len()),
        r: Stat::or(found.map(|f| f.r), constant),
        ci95: Interval::or(interval, why),
        p: Stat::or(found.map(|f| f.p), constant),
        exact: Stat::or(found.map(|f| f64::from(u8::from(f.exact))), constant),
        smallest_p: Stat::or(found.map(|f| f.smallest), constant),
    }
}

fn pairs(
    people: &BTreeMap<&str, Own>,
    names: &[&str],
    unit: Option<&Dissimilarities>,
    points: Option<f64>,
    map: Option<&Map>,
) -> BTreeMap<PairName, PairDifference> {
    let one = |(a, b): (usize, usize)| {
        let ratings: Vec<f64> = people.values().filter_map(|own| own.pair(a, b)).collect();
        let n = people
            .values()
            .map(|own| own.of(a, b).len() + own.of(b, a).len());
        let rescaled = unit.and_then(|unit| Some(unit.get(a, b)? * points?));
        let unrated = "the pair was not rated";
        let record = PairDifference {
            n: Stat::count(n.sum()),
            mean: Stat::or(mean(&ratings), unrated),
            sd: Stat::or(sd(&ratings), "fewer than two participants rated the pair"),
            rescaled: Stat::or(rescaled, unrated),
            distance: Stat::or(map.map(|map| map.distance(a, b)), "there is no map"),
        };
        (PairName::of(names[a], names[b]), record)
    };
    pairs_of(names.len()).map(one).collect()
}
