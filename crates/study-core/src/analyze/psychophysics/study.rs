//! The tracks and pairs of a study.

use super::excluded;
use super::findings::{PartFacts, PartFinding, of_preferences, of_sensitivities, of_thresholds};
use super::over_participants::{Threshold, Told, mixed, sensitivities};
use super::part_data::{Found, Intervals, LevelData, PartData, StudyData, chosen};
use super::preferences::{Choice, Preference, in_both_orders, preferences};
use super::tracks::{TrackName, of_session};
use super::trials::{Asked, TrialCount, TrialSettings, discrimination, level};
use crate::analyze::exclude::Applied;
use crate::analyze::findings::Pair;
use crate::analyze::identifiers::group_id;
use crate::analyze::select::{Include, Whose, state_counts};
use crate::analyze::values::Values;
use crate::analyze::warning::Warning;
use crate::analyze::{Rules, vaf};
use crate::outcome::ratings::Origin;
use crate::outcome::{RatingRow, Status};
use crate::protocol::Protocol;
use crate::protocol::parts::{Compared, Pairs, Part, Task, TrackRules, Vary};
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::{PartId, ParticipantId};
use study_stats::describe::is_constant;
use study_stats::psychometric::{Core, Level, Support, pooled};

/// The analysis of one part of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct PartAnalysis {
    /// The part.
    pub part: PartId,
    /// The kind of its trials, as in `[[tracks]] method`, or `pairs`.
    pub task: &'static str,
    /// Number of trials with an answer that counts.
    pub trials: usize,
    /// Number of participants with such a trial.
    pub participants: usize,
    /// Whether answers of pilots are among them.
    pub pilot: bool,
    /// Whether answers of simulated participants are among them.
    pub simulated: bool,
    /// The statistics.
    pub values: Values,
    /// The answers to the questions about it.
    pub findings: Vec<PartFinding>,
    /// The comparisons on which they rest: of realizations, or of thresholds.
    pub pairs: Vec<Pair>,
    /// What limits them.
    pub warnings: Vec<Warning>,
    /// The effect of each preregistered exclusion rule.
    pub exclusions: Vec<Applied>,
    /// Level of significance of every test, two-sided.
    pub alpha: f64,
    /// What its figures draw besides.
    pub data: PartData,
}

/// The analyses of all parts that are not ratings. Which participants count is decided as
/// for ratings. Practice and trials without an answer do not count, nor do those that an
/// exclusion rule excludes. Answers are the corrected ones, at the levels that were
/// presented.
pub fn parts(study: &StudyData<'_>, include: Include) -> Vec<PartAnalysis> {
    let protocol = study.protocol;
    let origin = |row: &RatingRow| Origin::of(row.simulated, row.pilot);
    let origins: Vec<Origin> = study.rows.iter().map(origin).collect();
    let whose = Whose::of(&origins, include);
    let unfinished = protocol.analysis.unfinished;
    let left_out: BTreeSet<&ParticipantId> = (study.participants.iter())
        .filter(|p| !state_counts(p.state, unfinished))
        .map(|p| &p.participant)
        .collect();
    let counts = |r: &&RatingRow| {
        let counts = whose.counts(origin(r)) && !left_out.contains(&r.participant);
        counts && !r.practice && r.status == Status::Ok
    };
    let rows: Vec<&RatingRow> = study.rows.iter().filter(counts).collect();
    let intervals = Intervals::of(study.intervals);
    let rules = Rules::of(protocol, "", include);
    let one = |part: &Part| {
        let of_part = |r: &&&RatingRow| r.part.as_ref() == Some(&part.id);
        let all: Vec<&RatingRow> = rows.iter().filter(of_part).copied().collect();
        let (stays, exclusions) = excluded::apply(&rules.exclude, part, &all, &intervals);
        let kept = all.iter().zip(&stays).filter(|(_, stays)| **stays);
        let rows: Vec<&RatingRow> = kept.map(|(row, _)| *row).collect();
        let found = |rows: &[&RatingRow]| of_part_task(study, part, rows, &intervals, &rules);
        let mut own = found(&rows)?;
        if rows.len() < all.len() {
            let before = found(&all)?;
            without_exclusions(&before.values, &mut own.values);
        }
        let who: BTreeSet<_> = rows.iter().map(|r| &r.participant).collect();
        let facts = PartFacts {
            values: &own.values,
            alpha: rules.alpha,
            participants: who.len(),
        };
        let names: Vec<&str> = own.names.iter().map(String::as_str).collect();
        let (mut findings, pairs) = match &part.task {
            Task::Pairs(_) => of_preferences(&facts, &own.names),
            Task::Rating(_) | Task::Discrimination { .. } => of_thresholds(&facts, &names),
        };
        let told = |name: &&&str| {
            own.values
                .get(&group_id("sdt_group", &[name, "n"]))
                .is_some()
        };
        let told: Vec<&str> = names.iter().filter(told).copied().collect();
        findings.extend(of_sensitivities(&facts, &told));
        Some(PartAnalysis {
            part: part.id.clone(),
            task: own.task,
            trials: own.trials,
            participants: who.len(),
            pilot: rows.iter().any(|r| r.pilot),
            simulated: rows.iter().any(|r| r.simulated),
            values: own.values,
            findings,
            pairs,
            warnings: own.warnings,
            exclusions,
            alpha: rules.alpha,
            data: own.data,
        })
    };
    protocol.parts.iter().filter_map(one).collect()
}

/// The statistics of these trials of a part; `None` of ratings.
fn of_part_task(
    study: &StudyData<'_>,
    part: &Part,
    rows: &[&RatingRow],
    intervals: &Intervals<'_>,
    rules: &Rules,
) -> Option<Found> {
    match &part.task {
        Task::Rating(_) => None,
        Task::Pairs(pairs) => Some(of_pairs(study, part, pairs, rows, intervals, rules)),
        Task::Discrimination { tracks } => {
            let protocol = study.protocol;
            let tracks: Vec<&TrackRules> =
                tracks.iter().filter_map(|id| protocol.track(id)).collect();
            of_tracks(study, part, &tracks, rows)
        }
    }
}

/// Adds what depends on the exclusions, as it would be without them.
fn without_exclusions(before: &Values, values: &mut Values) {
    for group in [
        "pairs/ability/",
        "pairs/vaf/pearson/",
        "psy_group/",
        "psy_mixed/",
        "sdt_group/",
    ] {
        let ids = before.iter().filter(|(id, _)| id.starts_with(group));
        for (id, _) in ids {
            values.copy(before, id, format!("before_exclusion/{id}"));
        }
    }
}

fn of_pairs(
    study: &StudyData<'_>,
    part: &Part,
    pairs: &Pairs,
    rows: &[&RatingRow],
    intervals: &Intervals<'_>,
    rules: &Rules,
) -> Found {
    let chosen = |row: &&RatingRow| preference(part, row, intervals);
    let chosen: Vec<Preference> = rows.iter().filter_map(chosen).collect();
    let mut values = preferences(&chosen, pairs.tie, in_both_orders(&chosen));
    let names: BTreeSet<&String> = chosen.iter().flat_map(|p| [&p.first, &p.second]).collect();
    let models = study.protocol.models.iter();
    let vaf: BTreeMap<String, f64> = models
        .filter_map(|m| Some((m.id.as_str().to_owned(), m.vaf?)))
        .filter(|(id, _)| names.contains(id))
        .collect();
    if !vaf.is_empty() {
        with_vaf(&vaf, rules, &mut values);
    }
    Found {
        task: "pairs",
        trials: chosen.len(),
        values,
        warnings: Vec::new(),
        names: names.into_iter().cloned().collect(),
        data: PartData {
            vaf,
            ..PartData::default()
        },
    }
}

/// The correlation of abilities with VAF over realizations, as that of mean ratings.
fn with_vaf(vaf: &BTreeMap<String, f64>, rules: &Rules, values: &mut Values) {
    let ability = |name: &str| values.number(&group_id("pairs/ability", &[name]));
    let known = vaf
        .iter()
        .filter_map(|(name, vaf)| Some((name.as_str(), *vaf, ability(name)?)));
    let known: Vec<(&str, f64, f64)> = known.collect();
    let names: Vec<&str> = known.iter().map(|k| k.0).collect();
    let x: Vec<f64> = known.iter().map(|k| k.1).collect();
    let y: Vec<f64> = known.iter().map(|k| k.2).collect();
    vaf::correlations("pairs/vaf", &x, &y, &names, rules, values);
    let of_vaf = |id: &str| id.starts_with("pairs/vaf/");
    if names.is_empty() {
        values.explain(of_vaf, "there are no abilities");
    } else if !is_constant(&x) && is_constant(&y) {
        values.explain(of_vaf, "all abilities are equal");
    }
}

fn preference(part: &Part, row: &RatingRow, intervals: &Intervals<'_>) -> Option<Preference> {
    let item = |interval: u32| {
        let felt = intervals.counted(row).iter();
        let model = felt
            .filter(|i| i.interval == interval)
            .find_map(|i| i.model.as_ref());
        Some(model?.as_str().to_owned())
    };
    Some(Preference {
        participant: row.participant.as_str().to_owned(),
        first: item(1)?,
        second: item(2)?,
        choice: match chosen(part, row)? {
            "first" => Choice::First(1.0),
            "second" => Choice::Second(1.0),
            _ => Choice::Tie(1.0),
        },
    })
}

/// Each track is fitted by itself; the priors refer to the range of its own ladder.
fn of_tracks(
    study: &StudyData<'_>,
    part: &Part,
    tracks: &[&TrackRules],
    rows: &[&RatingRow],
) -> Option<Found> {
    let protocol = study.protocol;
    let methods: BTreeSet<&str> = tracks.iter().map(|t| t.method.as_str()).collect();
    let (mut values, mut trials, mut task) = (Values::default(), 0, "discrimination");
    let (mut told, mut thresholds) = (Vec::new(), Vec::new());
    let (mut warnings, mut data) = (Vec::new(), PartData::default());
    for rules in tracks {
        let (asked, name) = *Asked::NAMES.iter().find(|n| n.1 == rules.method.as_str())?;
        if methods.len() == 1 {
            (task, data.guess) = (name, rules.method.guess_rate());
        }
        let of_track = |row: &&&RatingRow| row.track.as_ref() == Some(&rules.id);
        let own = rows.iter().filter(of_track);
        let counts: Vec<TrialCount> = own.filter_map(|row| trial(part, asked, row)).collect();
        trials += counts.len();
        let found = discrimination(asked, &counts, &settings(protocol, rules));
        let condition = rules.id.as_str();
        let mut people: Vec<&str> = counts.iter().map(|c| c.participant.as_str()).collect();
        people.sort_unstable();
        people.dedup();
        for participant in &people {
            let id = |group: &str, what: &str| {
                format!("{}/{what}", group_id(group, &[participant, condition]))
            };
            if let Some(value) = found.number(&id("psy", "posterior/threshold/mean")) {
                let participant = (*participant).to_owned();
                thresholds.push((participant, condition, value));
            }
            if let Some((d, above_chance)) = sensitivity(asked, rules, &found, &id) {
                told.push(Told {
                    condition,
                    d,
                    above_chance,
                });
            }
            data.levels
                .extend(levels(asked, participant, condition, &counts));
        }
        values.extend(found);
        // Whoever does not count has no track either.
        for history in study.sessions {
            let Some(start) = history.start() else {
                continue;
            };
            let participant = start.participant.as_str();
            if people.binary_search(&participant).is_ok() {
                let name = TrackName {
                    participant,
                    track: condition,
                };
                let to = (&mut values, &mut warnings);
                data.tracks
                    .extend(of_session(protocol, rules, history, name, to));
            }
        }
    }
    sensitivities(&told, &mut values);
    let families = tracks.iter().filter_map(|t| protocol.family(t.family()?));
    let families: Vec<_> = families.collect();
    let ratios = families.iter().all(|f| f.vary != Vary::Blend);
    let thresholds: Vec<Threshold<'_>> = (thresholds.iter())
        .map(|(participant, condition, value)| Threshold {
            participant,
            condition,
            value: *value,
        })
        .collect();
    mixed(&thresholds, ratios, &mut values);
    if let Some(first) = families.first()
        && families.iter().all(|f| f.id == first.id)
    {
        let unit = first
            .unit
            .as_ref()
            .map_or_else(String::new, |u| format!(" ({u})"));
        data.dimension = Some(format!("{}{unit}", first.id));
    }
    Some(Found {
        task,
        trials,
        values,
        warnings,
        data,
        names: tracks.iter().map(|t| t.id.as_str().to_owned()).collect(),
    })
}

/// d′ and what is 0 by chance.
fn sensitivity(
    asked: Asked,
    rules: &TrackRules,
    values: &Values,
    id: &impl Fn(&str, &str) -> String,
) -> Option<(f64, f64)> {
    let get = |what: &str| values.number(&id("sdt", what));
    match asked {
        Asked::TwoIntervals | Asked::YesNo => Some((get("d")?, get("d")?)),
        Asked::ThreeIntervals | Asked::OddOneOut => {
            // Without a d′, if all answers are correct.
            Some((
                get("d")?,
                get("share_correct")? - rules.method.guess_rate()?,
            ))
        }
        Asked::Abx | Asked::SameDifferent => {
            Some((get("d_differencing")?, get("share_unbiased")? - 0.5))
        }
        Asked::Comparison => None,
    }
}

/// The answers of a participant by level, without catch trials; `None` without levels.
fn levels(
    asked: Asked,
    participant: &str,
    condition: &str,
    counts: &[TrialCount],
) -> Option<LevelData> {
    let own = counts.iter().filter(|c| c.participant == participant);
    let levels: Vec<Level> = own.filter_map(|trial| level(asked, trial)).collect();
    (!levels.is_empty()).then(|| LevelData {
        participant: participant.to_owned(),
        condition: condition.to_owned(),
        levels: pooled(&levels),
    })
}

fn trial(part: &Part, asked: Asked, row: &RatingRow) -> Option<TrialCount> {
    let correct = row.correct?;
    let given = chosen(part, row)?;
    let words = asked.answers();
    let given = words.iter().position(|word| *word == given)?;
    // Of two answers, the one that was not given is correct if the given one is wrong; of
    // three, the sensitivities need only whether it is.
    let target = match (correct, words.len()) {
        (true, _) => Some(given),
        (false, 2) => Some(1 - given),
        (false, count) => Some((given + 1) % count),
    };
    Some(TrialCount {
        participant: row.participant.as_str().to_owned(),
        condition: row.track.as_ref()?.as_str().to_owned(),
        level: row.level,
        target,
        positive: f64::from(u8::from(correct)),
        trials: 1.0,
    })
}

/// How the functions of a track are fitted: the priors refer to the range of the ladder,
/// since an adaptive track stays near the threshold.
fn settings(protocol: &Protocol, track: &TrackRules) -> TrialSettings {
    let family = match &track.compared {
        Compared::Levels { family, .. } => protocol.family(family),
        Compared::Models { .. } => None,
    };
    let support = |levels: &[f64]| {
        let steps = levels.windows(2).map(|pair| pair[1] - pair[0]);
        Some(Support {
            low: *levels.first()?,
            high: *levels.last()?,
            least: steps.fold(f64::INFINITY, f64::min),
        })
    };
    TrialSettings {
        core: Core::Norm,
        lambda: 0.02,
        standard: None,
        support: family.and_then(|f| support(f.ladder.levels())),
        repeats: 0,
        seed: protocol.study.seed,
    }
}
