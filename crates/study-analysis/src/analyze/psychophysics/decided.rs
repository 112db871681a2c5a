//! What decides about answers that belong to no study, such as simulated ones: the same
//! estimates and findings as those of a study's parts.

use super::discriminations::sensitivity;
use super::findings::{self, PartFacts, PartFinding, PartQuestion, of_model, of_preferences};
use super::over_participants::{Threshold, Told, mixed, sensitivities};
use super::preferences::{Preference, in_both_orders, preferences};
use super::trials::{Asked, TrialCount, TrialSettings, discrimination};
use crate::analyze::keys::CellName;
use crate::analyze::record::Number as _;
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
    let found = preferences(chosen, tie, in_both_orders(chosen));
    let people: BTreeSet<&str> = chosen.iter().map(|p| p.participant.as_str()).collect();
    let facts = PartFacts {
        alpha,
        participants: people.len(),
    };
    let items = found.items.0.values();
    let abilities: Option<Vec<f64>> = items.map(|item| item.ability.number()).collect();
    let (findings, _) = of_preferences(&facts, &found);
    Compared {
        preferred: findings.into_iter().next(),
        abilities: abilities.unwrap_or_default(),
    }
}

/// The threshold of one participant on a track: the posterior median. `None` if the answers
/// have none.
pub(crate) fn threshold(asked: Asked, levels: &[Level], settings: &TrialSettings) -> Option<f64> {
    let (experiment, _) = asked.experiment()?;
    let levels = settings.spacing.places(levels);
    let found = posterior(settings.core, &levels, experiment, &settings.priors);
    found
        .ok()
        .map(|p| p.threshold_level(settings.spacing).median)
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
    let model = mixed(&of, ratios)?;
    let people: BTreeSet<&str> = found.iter().map(|t| t.0.as_str()).collect();
    let facts = PartFacts {
        alpha,
        participants: people.len(),
    };
    of_model(&facts, PartQuestion::Thresholds, Some(&model)).0
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

/// The findings of each track whether its two realizations are told apart; `None` if one has
/// no sensitivities.
pub(crate) fn told_apart(
    tracks: &[(&TrackRules, Asked, Vec<TrialCount>, &TrialSettings)],
    alpha: f64,
) -> Option<Vec<PartFinding>> {
    let mut told = Vec::new();
    let mut people = 0;
    for (rules, asked, counts, settings) in tracks {
        let found = discrimination(*asked, counts, settings);
        let participants: BTreeSet<&str> = counts.iter().map(|c| c.participant.as_str()).collect();
        people = people.max(participants.len());
        for participant in participants {
            let name = rules.id.as_str();
            let own = found.sdt.get(&CellName::of(participant, name));
            if let Some((d, above_chance)) = sensitivity(*asked, rules.method, own) {
                told.push(Told {
                    condition: name.to_owned(),
                    d,
                    above_chance,
                });
            }
        }
    }
    let facts = PartFacts {
        alpha,
        participants: people,
    };
    let groups = sensitivities(&told);
    let of_track = |name: &str| Some(findings::told_apart(&facts, name, groups.get(name)?));
    (tracks.iter())
        .map(|(rules, ..)| of_track(rules.id.as_str()))
        .collect()
}
