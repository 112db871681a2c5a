//! Magnitude estimation, `magnitude/…`, and ratings with hidden reference and anchors,
//! `mushra/…`.

use super::over_participants::{ConditionModel, Threshold, mixed};
use crate::analyze::keys::{At, ConditionName};
use crate::analyze::record::{Interval, ParticipantName, RealizationName, Stat, statistics};
use crate::analyze::results::Correlation;
use std::collections::{BTreeMap, BTreeSet};
use study_stats::magnitude::{Estimate, Magnitude, magnitude as estimate};
use study_stats::mushra::{Screening, condition};

statistics! {
    /// The estimates of a level or a realization, after the participants' own means were made equal (Lane, Catania & Stevens 1961).
    pub struct GeometricMean {
        /// geometric mean over participants
        geometric_mean: Stat,
        /// t interval on logarithms
        ci95: Interval,
    }

    /// The power law a·xⁿ by least squares on the mean logarithms.
    pub struct PowerLaw {
        /// n
        exponent: Stat,
        /// log10 a
        log10_coefficient: Stat,
        /// share of the variance of the mean logarithms
        r_squared: Stat,
        /// over participants
        exponent_over_participants: MeanExponent,
    }

    /// The exponent over participants.
    pub struct MeanExponent {
        /// its mean
        mean: Stat,
        /// t interval
        ci95: Interval,
    }

    /// A participant.
    pub struct OwnExponent {
        /// the exponent of the participant's estimates
        exponent: Stat,
    }

    /// Estimated magnitudes.
    pub struct Magnitudes {
        /// estimates of 0 and less
        n_left_out: Stat,
        /// by level
        levels: BTreeMap<At, GeometricMean> as "level",
        /// by realization
        realizations: BTreeMap<RealizationName, GeometricMean> as "realization",
        /// of levels
        law: Option<PowerLaw> as "",
        /// by participant, of levels
        participants: BTreeMap<ParticipantName, OwnExponent> as "",
        /// of log10 of the geometric means with VAF over test realizations
        vaf: Option<Correlation>,
    }

    /// Whether a participant tells reference and anchor (after ITU-R BS.1534-3).
    pub struct Screened {
        /// share of trials whose hidden reference is rated below 90
        reference_below: Stat,
        /// share of trials whose mid anchor is rated above 90
        anchor_above: Stat,
        /// whether one of them is more than 15 %: a flag, nothing is deleted
        screened: Stat,
    }

    /// The ratings of a condition.
    pub struct Rated {
        /// median of all ratings
        median: Stat,
        /// lower quartile
        q1: Stat,
        /// upper quartile
        q3: Stat,
        /// mean over participants
        mean: Stat,
        /// half its t interval
        ci95_half: Stat,
    }

    /// Ratings beside a reference.
    pub struct Mushra {
        /// participants who are not screened
        n_kept: Stat,
        /// by participant
        participants: BTreeMap<ParticipantName, Screened> as "",
        /// over those who are not screened
        conditions: BTreeMap<ConditionName, Rated> as "",
    }
}

/// One estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct MagnitudeRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// Level presented.
    pub level: f64,
    /// Number given.
    pub estimate: f64,
}

/// The estimates of participants, in the order of `people`.
fn estimated<'a>(
    people: &[&str],
    rows: impl Iterator<Item = (&'a str, f64, f64)>,
) -> (Magnitude, Magnitudes) {
    let of_row = |(participant, level, estimate)| Estimate {
        participant: people.binary_search(&participant).unwrap_or_default(),
        level,
        estimate,
    };
    let found = estimate(&rows.map(of_row).collect::<Vec<_>>());
    let magnitudes = Magnitudes {
        n_left_out: Stat::of(found.left_out as f64),
        ..Magnitudes::undefined("")
    };
    (found, magnitudes)
}

/// The geometric mean of each level.
fn geometric_means(found: &Magnitude) -> impl Iterator<Item = (f64, GeometricMean)> {
    let why = "there is one participant";
    found.levels.iter().map(move |(level, mean)| {
        let mean = GeometricMean {
            geometric_mean: Stat::or(mean.map(|m| m.mean), why),
            ci95: Interval::or(mean.and_then(|m| m.ci95), why),
        };
        (*level, mean)
    })
}

/// Geometric means, exponent and coefficient of the power law.
pub fn magnitude(rows: &[MagnitudeRow]) -> Magnitudes {
    let people: BTreeSet<&str> = rows.iter().map(|r| r.participant.as_str()).collect();
    let people: Vec<&str> = people.into_iter().collect();
    let rows = (rows.iter()).map(|row| (row.participant.as_str(), row.level, row.estimate));
    let (found, magnitudes) = estimated(&people, rows);
    let few = "there are fewer than two levels above 0";
    let over = "fewer than two participants have an exponent";
    let law = PowerLaw {
        exponent: Stat::or(found.law.map(|l| l.exponent), few),
        log10_coefficient: Stat::or(found.law.map(|l| l.log10_coefficient), few),
        r_squared: Stat::or(found.law.and_then(|l| l.r_squared), few),
        exponent_over_participants: MeanExponent {
            mean: Stat::or(found.exponent.map(|e| e.mean), over),
            ci95: Interval::or(found.exponent.and_then(|e| e.ci95), over),
        },
    };
    let own = people.iter().zip(&found.exponents).map(|(person, own)| {
        let exponent = Stat::or(*own, few);
        ((*person).into(), OwnExponent { exponent })
    });
    Magnitudes {
        levels: (geometric_means(&found).map(|(level, mean)| (At(level), mean))).collect(),
        law: Some(law),
        participants: own.collect(),
        ..magnitudes
    }
}

/// One estimate of a realization.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RealizationRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// Realization. Untrusted.
    pub realization: String,
    /// Number given.
    pub estimate: f64,
}

/// Geometric means of realizations, as of levels, and their comparison by a mixed model of the
/// logarithms: one mean of each participant and realization.
pub(super) fn realizations(rows: &[RealizationRow]) -> (Magnitudes, Option<ConditionModel>) {
    let mut names: Vec<&str> = rows.iter().map(|r| r.realization.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let mut people: Vec<&str> = rows.iter().map(|r| r.participant.as_str()).collect();
    people.sort_unstable();
    people.dedup();
    let place = |list: &[&str], name: &str| list.binary_search(&name).unwrap_or_default();
    // A realization has no level: its place stands for it, and no power law is fitted.
    let levels = rows.iter().map(|row| {
        let level = place(&names, &row.realization) as f64;
        (row.participant.as_str(), level, row.estimate)
    });
    let (found, mut magnitudes) = estimated(&people, levels);
    magnitudes.realizations = geometric_means(&found)
        .map(|(place, mean)| (names[place as usize].into(), mean))
        .collect();
    let mut logs: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    for row in rows.iter().filter(|r| r.estimate > 0.0) {
        let cell = (row.participant.as_str(), row.realization.as_str());
        logs.entry(cell).or_default().push(libm::log(row.estimate));
    }
    let cells: Vec<Threshold<'_>> = (logs.iter())
        .filter_map(|((participant, condition), logs)| {
            Some(Threshold {
                participant,
                condition,
                value: libm::exp(study_stats::describe::mean(logs)?),
            })
        })
        .collect();
    (magnitudes, mixed(&cells, true))
}

/// One rating.
#[derive(Debug, Clone, PartialEq)]
pub struct MushraRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// Condition. Untrusted.
    pub condition: String,
    /// From 0 to 100.
    pub rating: f64,
}

/// Which conditions are special.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MushraRoles {
    /// The hidden reference.
    pub reference: String,
    /// The mid anchor, if there is one.
    pub mid_anchor: Option<String>,
}

/// Who is screened, and every condition over those who are not; if somebody is screened, over
/// all as well.
pub fn mushra(
    rows: &[MushraRow],
    roles: &MushraRoles,
    screening: &Screening,
) -> (Mushra, BTreeMap<ConditionName, Rated>) {
    let people: BTreeSet<&str> = rows.iter().map(|r| r.participant.as_str()).collect();
    let conditions: BTreeSet<&str> = rows.iter().map(|r| r.condition.as_str()).collect();
    let ratings = |person: &str, condition: &str| -> Vec<f64> {
        let own = rows
            .iter()
            .filter(|r| r.participant == person && r.condition == condition);
        own.map(|r| r.rating).collect()
    };
    let mut kept = Vec::new();
    let mut participants = BTreeMap::new();
    for person in &people {
        let reference = ratings(person, &roles.reference);
        let anchor = (roles.mid_anchor.as_ref()).map_or_else(Vec::new, |a| ratings(person, a));
        let found = screening.judge(&reference, &anchor);
        let screened = Screened {
            reference_below: Stat::or(found.reference_below, "it was not rated"),
            anchor_above: Stat::or(found.anchor_above, "it was not rated"),
            screened: Stat::flag(found.screened),
        };
        participants.insert((*person).into(), screened);
        if !found.screened {
            kept.push(*person);
        }
    }
    let over = |people: &[&str]| -> BTreeMap<ConditionName, Rated> {
        let rated = |name: &&str| {
            let own: Vec<Vec<f64>> = people.iter().map(|person| ratings(person, name)).collect();
            let found = condition(&own);
            let stat = |x: Option<f64>| Stat::or(x, "nobody is left who rated it");
            let half = found.and_then(|c| c.ci95_half);
            let rated = Rated {
                median: stat(found.map(|c| c.median)),
                q1: stat(found.map(|c| c.quartiles.0)),
                q3: stat(found.map(|c| c.quartiles.1)),
                mean: stat(found.map(|c| c.mean)),
                ci95_half: Stat::or(half, "there is one participant"),
            };
            ((*name).into(), rated)
        };
        conditions.iter().map(rated).collect()
    };
    let all: Vec<&str> = people.into_iter().collect();
    // The same numbers twice if nobody is screened.
    let unscreened = match kept.len() == all.len() {
        true => BTreeMap::new(),
        false => over(&all),
    };
    let mushra = Mushra {
        n_kept: Stat::count(kept.len()),
        participants,
        conditions: over(&kept),
    };
    (mushra, unscreened)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::record::{Number as _, PairName};

    /// Three participants and realizations; estimates with moduli 1, 10 and 3.
    fn estimates() -> Vec<RealizationRow> {
        let noise = [[1.0, 1.2, 0.9], [1.1, 0.8, 1.0], [0.9, 1.0, 1.3]];
        let mut rows = Vec::new();
        for (p, modulus) in [1.0, 10.0, 3.0].into_iter().enumerate() {
            for (r, (name, size)) in [("a", 2.0), ("b", 4.0), ("c", 5.0)].into_iter().enumerate() {
                for repetition in [1.0, 1.1] {
                    rows.push(RealizationRow {
                        participant: format!("P{p}"),
                        realization: name.to_owned(),
                        estimate: modulus * size * noise[p][r] * repetition,
                    });
                }
            }
        }
        rows
    }

    /// Everybody judged everything, so that equalization leaves the geometric means, and the
    /// contrasts of the mixed model are their ratios.
    #[test]
    fn realizations_have_the_geometric_means_of_their_estimates() {
        let rows = estimates();
        let (magnitudes, model) = realizations(&rows);
        let of = |name: &str| -> f64 {
            let own = rows.iter().filter(|r| r.realization == name);
            let logs: Vec<f64> = own.map(|r| r.estimate.ln()).collect();
            (logs.iter().sum::<f64>() / logs.len() as f64).exp()
        };
        for name in ["a", "b", "c"] {
            let mean = magnitudes.realizations[name]
                .geometric_mean
                .number()
                .unwrap();
            assert!((mean / of(name) - 1.0).abs() < 1e-12, "{name}: {mean}");
        }
        let model = model.unwrap();
        let ratio = model.pairs[&PairName::of("a", "b")].ratio.number().unwrap();
        assert!((ratio / (of("a") / of("b")) - 1.0).abs() < 1e-9, "{ratio}");
        assert!(model.test.p.number().unwrap() < 0.05);
        assert_eq!(magnitudes.law, None);
    }

    #[test]
    fn whoever_is_screened_is_in_the_second_result_only() {
        let row = |participant: &str, condition: &str, rating| MushraRow {
            participant: participant.to_owned(),
            condition: condition.to_owned(),
            rating,
        };
        let mut rows = vec![
            row("A", "ref", 100.0),
            row("A", "x", 40.0),
            row("B", "ref", 95.0),
            row("B", "x", 60.0),
        ];
        let roles = MushraRoles {
            reference: "ref".to_owned(),
            mid_anchor: None,
        };
        let all = |rows: &[MushraRow]| mushra(rows, &roles, &Screening::default());
        let (kept, nobody) = all(&rows);
        assert!(nobody.is_empty());
        rows.extend([row("C", "ref", 20.0), row("C", "x", 80.0)]);
        let (found, unscreened) = all(&rows);
        assert!(found.participants["C"].screened.is_set());
        assert_eq!(found.conditions["x"], kept.conditions["x"]);
        let with = &unscreened["x"];
        assert_eq!(
            (with.mean.number(), with.median.number()),
            (Some(60.0), Some(60.0))
        );
    }
}
