//! What decides about answers that belong to no study, such as simulated ones: the same
//! estimates and findings as those of a study's parts.

use super::discriminations::sensitivity;
use super::findings::{PartFacts, PartFinding, of_preferences, of_sensitivities, of_thresholds};
use super::over_participants::{Threshold, Told, mixed, sensitivities};
use super::preferences::{Preference, in_both_orders, preferences};
use super::trials::{Asked, TrialCount, TrialSettings, discrimination};
use crate::analyze::identifiers::group_id;
use crate::analyze::values::Values;
use std::collections::BTreeSet;
use study_plan::protocol::parts::TrackRules;
use study_stats::psychometric::{Level, group, posterior};

/// What is found of paired preferences.
#[derive(Debug, Clone)]
pub(crate) struct Compared {
    /// Whether a realization is preferred to another.
    pub(crate) preferred: Option<PartFinding>,
    /// The ability of each item, sorted by name; empty if they have none.
    pub(crate) abilities: Vec<f64>,
}

/// The finding of some answers to pairs, and the abilities on which that of VAF rests.
pub(crate) fn compared(chosen: &[Preference], tie: bool, alpha: f64) -> Compared {
    let values = preferences(chosen, tie, in_both_orders(chosen));
    let names: BTreeSet<&String> = chosen.iter().flat_map(|p| [&p.first, &p.second]).collect();
    let names: Vec<String> = names.into_iter().cloned().collect();
    let people: BTreeSet<&str> = chosen.iter().map(|p| p.participant.as_str()).collect();
    let facts = PartFacts {
        values: &values,
        alpha,
        participants: people.len(),
    };
    let ability = |name: &String| values.number(&group_id("pairs/ability", &[name]));
    let abilities: Option<Vec<f64>> = names.iter().map(ability).collect();
    let (findings, _) = of_preferences(&facts, &names);
    Compared {
        preferred: findings.into_iter().next(),
        abilities: abilities.unwrap_or_default(),
    }
}

/// The threshold of one participant on a track: the posterior mean. `None` if the answers
/// have none.
pub(crate) fn threshold(asked: Asked, levels: &[Level], settings: &TrialSettings) -> Option<f64> {
    let (experiment, _) = asked.experiment()?;
    let levels = settings.spacing.places(levels);
    let found = posterior(settings.core, &levels, experiment, settings.support);
    found.ok().map(|p| p.threshold_level(settings.spacing).mean)
}

/// The finding of thresholds of participants, by participant, track and value; `None` with
/// one track.
pub(crate) fn thresholds(
    found: &[(String, String, f64)],
    ratios: bool,
    alpha: f64,
) -> Option<PartFinding> {
    let of: Vec<Threshold<'_>> = (found.iter())
        .map(|(participant, condition, value)| Threshold {
            participant,
            condition,
            value: *value,
        })
        .collect();
    let mut values = Values::default();
    mixed("psy_mixed", &of, ratios, &mut values);
    let conditions: BTreeSet<&str> = found.iter().map(|t| t.1.as_str()).collect();
    let people: BTreeSet<&str> = found.iter().map(|t| t.0.as_str()).collect();
    let facts = PartFacts {
        values: &values,
        alpha,
        participants: people.len(),
    };
    let conditions: Vec<&str> = conditions.into_iter().collect();
    of_thresholds(&facts, &conditions).0.into_iter().next()
}

/// Half the 95 % interval of the mean threshold on a track, of its natural logarithm where
/// levels have ratios.
pub(crate) fn threshold_half_width(of_track: &[f64], ratios: bool) -> Option<f64> {
    if !ratios {
        let (low, high) = study_stats::paired::one_sample(of_track)?.ci95;
        return Some((high - low) / 2.0);
    }
    let (low, high) = group(of_track)?.ci95?;
    Some(libm::log(high / low) / 2.0)
}

/// The findings of each track whether its two realizations are told apart.
pub(crate) fn told_apart(
    tracks: &[(&TrackRules, Asked, Vec<TrialCount>, &TrialSettings)],
    alpha: f64,
) -> Vec<PartFinding> {
    let (mut told, mut values) = (Vec::new(), Values::default());
    let mut people = 0;
    for (rules, asked, counts, settings) in tracks {
        let found = discrimination(*asked, counts, settings);
        let participants: BTreeSet<&str> = counts.iter().map(|c| c.participant.as_str()).collect();
        people = people.max(participants.len());
        for participant in participants {
            let name = rules.id.as_str();
            let id = |group: &str, what: &str| {
                format!("{}/{what}", group_id(group, &[participant, name]))
            };
            if let Some((d, above_chance)) = sensitivity(*asked, rules, &found, &id) {
                told.push(Told {
                    condition: name.to_owned(),
                    d,
                    above_chance,
                });
            }
        }
    }
    sensitivities(&told, &mut values);
    let facts = PartFacts {
        values: &values,
        alpha,
        participants: people,
    };
    let names: Vec<&str> = tracks.iter().map(|t| t.0.id.as_str()).collect();
    of_sensitivities(&facts, &names)
}
