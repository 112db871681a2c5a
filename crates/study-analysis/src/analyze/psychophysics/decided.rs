//! What decides about answers that belong to no study, such as simulated ones: the same
//! estimates and findings as those of a study's parts.

use super::adjustment::{SettingRow, adjustment};
use super::discriminations::sensitivity;
use super::findings::{self, PartFacts, PartFinding, PartQuestion, of_model, of_preferences};
use super::identification::{LabelRow, identification};
use super::over_participants::{ConditionModel, Threshold, Told, mixed, sensitivities};
use super::population::{ConditionFit, Pooled, PopulationCell, population};
use super::preferences::{Preference, in_both_orders, preferences};
use super::ranking::{RankingRow, ranking};
use super::similarity::{SimilarityRow, property_followed};
use super::trials::{Asked, TrialCount, TrialSettings, discrimination};
use crate::analyze::keys::{CellName, ConditionName};
use crate::analyze::record::{Number as _, PairName};
use std::collections::{BTreeMap, BTreeSet};
use study_plan::protocol::parts::TrackRules;
use study_stats::psychometric::hierarchy::Effort;
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

/// The threshold of one participant in a condition: posterior median and interval. `None` if the answers
/// have none.
pub(crate) fn threshold(
    asked: Asked,
    levels: &[Level],
    settings: &TrialSettings,
) -> Option<Estimated> {
    let (experiment, _) = asked.experiment()?;
    let levels = settings.spacing.places(levels);
    let found = posterior(settings.core, &levels, experiment, &settings.priors);
    let found = found.ok()?.threshold_level(settings.spacing);
    Some(Estimated {
        value: found.median,
        ci95: found.ci95,
    })
}

/// An estimate with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimated {
    /// The estimate.
    pub(crate) value: f64,
    /// Its ends.
    pub(crate) ci95: (f64, f64),
}

/// What is found of thresholds in several conditions.
#[derive(Debug, Clone)]
pub(crate) struct Differing {
    /// Whether they differ.
    pub(crate) finding: Option<PartFinding>,
    /// The last condition against the first: a ratio, or a difference where there are none.
    pub(crate) contrast: Option<Estimated>,
}

/// What is found of thresholds of participants, by participant, condition and value; `ends` are the first
/// and the last condition. `None` with one condition.
pub(crate) fn thresholds(
    found: &[(String, String, f64)],
    (ratios, ends): (bool, [&str; 2]),
    alpha: f64,
) -> Option<Differing> {
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
    Some(Differing {
        finding: of_model(&facts, PartQuestion::Thresholds, Some(&model)).0,
        contrast: contrast(&model, ends),
    })
}

/// The contrast of the last condition with the first.
fn contrast(model: &ConditionModel, [first, last]: [&str; 2]) -> Option<Estimated> {
    let pair = PairName::of(first, last);
    let found = model.pairs.get(&pair)?;
    let (name, value) = found.estimate();
    let (value, ci95) = (value?, found.ci95.ends()?);
    let found = Estimated { value, ci95 };
    Some(found.of_last(&pair, last, name == "ratio"))
}

impl Estimated {
    /// What a pair says of `last` against the other one: pairs have sorted names.
    fn of_last(self, pair: &PairName, last: &str, is_ratio: bool) -> Self {
        if pair.names()[0] == last {
            return self;
        }
        let turned = |x: f64| if is_ratio { 1.0 / x } else { -x };
        let (low, high) = self.ci95;
        Self {
            value: turned(self.value),
            ci95: (turned(high), turned(low)),
        }
    }
}

/// The mean threshold in a condition with its t interval, geometric where levels have ratios.
pub(crate) fn mean_threshold(of_track: &[f64], ratios: bool) -> Option<Estimated> {
    if !ratios {
        let found = study_stats::paired::one_sample(of_track)?;
        return Some(Estimated {
            value: found.mean,
            ci95: found.ci95,
        });
    }
    let found = group(of_track)?;
    Some(Estimated {
        value: found.geometric_mean,
        ci95: found.ci95?,
    })
}

/// What the pooled model finds.
#[derive(Debug, Clone)]
pub(crate) struct Together {
    /// The threshold of each cell, in their order.
    pub(crate) cells: Vec<Estimated>,
    /// The population in the first condition.
    pub(crate) mean: Option<Estimated>,
    /// The last condition against the first.
    pub(crate) contrast: Option<Estimated>,
}

/// The answers of a participant in a condition: names, and counts by level.
pub(crate) type Answered = (CellName, Vec<Level>);

/// The pooled model of these cells as the analysis fits it, with fewer draws. `Err` where there is none for
/// such data, `Ok(None)` if it has not converged.
pub(crate) fn together(
    cells: &[Answered],
    conditions: &[(&str, Asked, &TrialSettings)],
    seed: u64,
) -> Result<Option<Together>, NoModel> {
    let settings = conditions.iter().map(|(name, asked, settings)| {
        let fit = ConditionFit {
            core: settings.core,
            spacing: settings.spacing,
            experiment: asked.experiment()?.0,
            priors: settings.priors,
        };
        Some(((*name).to_owned(), fit))
    });
    let settings: Option<BTreeMap<String, ConditionFit>> = settings.collect();
    let cells: Vec<PopulationCell> = (cells.iter())
        .map(|(name, levels)| PopulationCell {
            name: name.clone(),
            levels: levels.clone(),
        })
        .collect();
    let model = population(
        &cells,
        &settings.ok_or(NoModel)?,
        (seed, "power"),
        Effort::SIMULATION,
    );
    let model = model.ok_or(NoModel)?;
    if !model.has_converged() {
        return Ok(None);
    }
    let of = |found: &Pooled| {
        Some(Estimated {
            value: found.median.number()?,
            ci95: found.ci95.ends()?,
        })
    };
    let of_cell = |cell: &PopulationCell| model.participant.get(&cell.name).and_then(of);
    let cells: Option<Vec<Estimated>> = cells.iter().map(of_cell).collect();
    let (first, last) = match conditions {
        [first, .., last] => (first.0, Some(last.0)),
        [first] => (first.0, None),
        [] => return Err(NoModel),
    };
    let contrast = last.and_then(|last| {
        let pair = PairName::of(first, last);
        let found = model.contrasts.get(&pair)?;
        let (is_ratio, found) = match (&found.ratio, &found.difference) {
            (Some(ratio), _) => (true, ratio),
            (None, difference) => (false, difference.as_ref()?),
        };
        Some(of(found)?.of_last(&pair, last, is_ratio))
    });
    Ok(cells.map(|cells| Together {
        cells,
        mean: model
            .threshold
            .get(&ConditionName::from(first))
            .and_then(of),
        contrast,
    }))
}

/// What findings are made from, of the participants of some rows.
fn facts<'a>(people: impl Iterator<Item = &'a str>, alpha: f64) -> PartFacts {
    let people: BTreeSet<&str> = people.collect();
    PartFacts {
        alpha,
        participants: people.len(),
    }
}

/// The findings of rankings. `seed` is that of random orders.
pub(crate) fn ranked(rows: &[RankingRow], alpha: f64, seed: u64) -> Vec<PartFinding> {
    let facts = facts(rows.iter().map(|row| row.participant.as_str()), alpha);
    findings::of_rankings(&facts, &ranking(rows, (seed, "power"))).0
}

/// Whether the map of ratings of difference follows a property of the realizations, from fewer random starts than that
/// of a study. `None` without a map.
pub(crate) fn follows(
    rows: &[SimilarityRow],
    property: &BTreeMap<String, f64>,
    (alpha, seed): (f64, u64),
) -> Option<PartFinding> {
    let facts = facts(rows.iter().map(|row| row.participant.as_str()), alpha);
    let fit = property_followed(rows, property, seed)?;
    Some(findings::map_follows(&facts, "level", &fit, property.len()))
}

/// The findings of settings beside a standard.
pub(crate) fn adjusted(
    rows: &[SettingRow],
    standard: f64,
    (alpha, seed): (f64, u64),
) -> Vec<PartFinding> {
    let facts = facts(rows.iter().map(|row| row.participant.as_str()), alpha);
    findings::settings_of(&facts, &adjustment(rows, Some(standard), (seed, "power")))
}

/// Whether the right labels are given more often than by guessing.
pub(crate) fn identified(rows: &[LabelRow], labels: &[String], alpha: f64) -> PartFinding {
    let facts = facts(rows.iter().map(|row| row.participant.as_str()), alpha);
    findings::identified(&facts, &identification(rows, labels).0)
}

/// There is no pooled model of such data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NoModel;

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
