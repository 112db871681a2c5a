//! The tracks and pairs of a study.

use super::again::{again, by_condition};
use super::counting::{Counting, PartRows};
use super::discriminations::of_tracks;
use super::findings::{
    PartFacts, PartFinding, PartQuestion, identified, maps_of, of_groups_and_sessions, of_model,
    of_preferences, of_rankings, of_realizations, settings_of, told_apart,
};
use super::of_adjustment::of_adjustment;
use super::of_identification::of_identification;
use super::of_ranking::of_ranking;
use super::of_scales::{of_magnitudes, of_mushra};
use super::of_similarity::of_similarity;
use super::over_participants::Measured;
use super::part_data::{
    Found, Intervals, PartAnalysis, PartData, StudyData, asked, chosen, groups, sessions_of, trial,
};
use super::preferences::{Choice, Preference, Preferences, in_both_orders, preferences};
use super::questionnaires::of_questionnaires;
use super::results::PartResults;
use super::search::exploration;
use super::sequential::{self, sequential_effects};
use super::trials::Asked;
use crate::analyze::Rules;
use crate::analyze::findings::Pair;
use crate::analyze::record::{Field as _, Number as _};
use crate::analyze::results::Correlation;
use crate::analyze::select::Include;
use crate::analyze::warning::Warning;
use std::collections::{BTreeMap, BTreeSet};
use study_base::sort::SmallSort as _;
use study_base::text::{ModelId, PartId, ParticipantId, counted};
use study_plan::protocol::pairs::Pairs;
use study_plan::protocol::parts::{Part, Task, TrackRules};
use study_plan::protocol::presentations::Presentations;
use study_plan::protocol::{Answer, Protocol, Role};
use study_session::outcome::RatingRow;
use study_stats::describe::{is_constant, mean};
use study_stats::sequential::Answered;

/// The analyses of all parts that are not ratings, of questionnaires, and of what ratings say of
/// groups and sessions. Which participants count is decided as
/// for ratings. Practice and trials without an answer do not count, nor do those that an
/// exclusion rule excludes. Answers are the corrected ones, unless the right one was told before, at the
/// levels that were presented.
pub fn parts(study: &StudyData<'_>, include: Include) -> Vec<PartAnalysis> {
    let protocol = study.protocol;
    let counting = Counting::of(study, include);
    let rows = study.rows.iter().filter(|row| counting.row(row));
    let rows: Vec<&RatingRow> = rows.collect();
    let intervals = Intervals::of(study.intervals);
    let rules = Rules::of(protocol, "", include);
    let one = |part: &Part| {
        let PartRows {
            all,
            kept: rows,
            exclusions,
        } = Counting::of_part(study, part, &rows, &intervals, &rules.exclude);
        let found = |rows: &[&RatingRow]| of_part_task(study, part, rows, &intervals, &rules);
        let mut own = found(&rows)?;
        own.data.exploration = exploration(study, part, include);
        if rows.len() < all.len() {
            own.results.before_exclusion = Some(found(&all)?.results.before_exclusion());
        }
        let who: BTreeSet<_> = rows.iter().map(|r| &r.participant).collect();
        own.warnings
            .extend(searchers(protocol, rows.iter().copied()));
        let facts = PartFacts {
            alpha: rules.alpha,
            participants: who.len(),
        };
        let (findings, pairs) = findings(&facts, &own);
        let uncompared = match part.task {
            Task::Pairs(_) => Some(
                "groups are compared by what they prefer, and sessions are not compared: abilities are those of \
                 all participants and sessions together",
            ),
            Task::Magnitude(_) => Some(
                "groups are compared by condition only, and sessions are not compared: each participant has \
                 numbers of their own",
            ),
            Task::Mushra(_) => Some(
                "groups and sessions are not compared in this part: its means are those of all participants \
                 together",
            ),
            Task::Similarity(_) => Some(
                "groups and sessions are not compared in this part: its map is that of all participants and \
                 sessions together",
            ),
            Task::Ranking(_) => Some(
                "groups and sessions are not compared in this part: its worths are those of all participants and \
                 sessions together",
            ),
            Task::Adjustment(_) => Some(
                "groups and sessions are not compared in this part: its means are those of all participants and \
                 sessions together",
            ),
            Task::Rating(_)
            | Task::Discrimination { .. }
            | Task::Identification(_)
            | Task::Search(_) => None,
        };
        let several = protocol.groups.is_some() || sessions_of(protocol, part).len() > 1;
        if let Some(text) = uncompared.filter(|_| several) {
            own.warnings.push(Warning {
                code: "groups-not-compared",
                text: text.to_owned(),
            });
        }
        Some(PartAnalysis {
            part: part.id.clone(),
            task: own.task,
            trials: own.trials,
            participants: who.len(),
            pilot: rows.iter().any(|r| r.pilot),
            simulated: rows.iter().any(|r| r.simulated),
            results: own.results,
            findings,
            pairs,
            warnings: own.warnings,
            exclusions,
            alpha: rules.alpha,
            used: (rows.iter())
                .map(|r| (r.participant.clone(), r.session, r.trial))
                .collect(),
            data: own.data,
        })
    };
    let parts = protocol.parts.iter().filter_map(one);
    let questionnaires = of_questionnaires(study, include);
    parts.chain(questionnaires).collect()
}

/// The findings of a part, and the comparisons on which they rest.
fn findings(facts: &PartFacts, own: &Found) -> (Vec<PartFinding>, Vec<Pair>) {
    let (results, over) = (&own.results, &own.results.over);
    let (mut found, pairs) = match (&results.pairs, &over.magnitude, &over.ranking) {
        (Some(preferences), _, _) => of_preferences(facts, preferences),
        (None, None, Some(rankings)) => of_rankings(facts, rankings),
        (None, Some(magnitude), _) => {
            let model = results.magnitude_mixed.as_ref();
            of_realizations(facts, model, magnitude.vaf.as_ref())
        }
        (None, None, None) => {
            let model = over.psy_mixed.as_ref();
            let (found, pairs) = of_model(facts, PartQuestion::Thresholds, model);
            (Vec::from_iter(found), pairs)
        }
    };
    found.extend((over.identification.as_ref()).map(|own| identified(facts, own)));
    let similarity = over.similarity.iter();
    found.extend(similarity.flat_map(|own| maps_of(facts, own)));
    let adjustment = over.adjustment.iter();
    found.extend(adjustment.flat_map(|own| settings_of(facts, own)));
    let told = |name: &String| Some(told_apart(facts, name, over.sdt_group.get(name.as_str())?));
    found.extend(own.names.iter().filter_map(told));
    found.extend(of_groups_and_sessions(facts, &over.again));
    (found, pairs)
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
        Task::Rating(own) => of_ratings(study, part, own, rows),
        Task::Magnitude(own) => Some(of_magnitudes(
            study.protocol,
            part,
            &own.presentations,
            (rows, rules),
        )),
        Task::Mushra(own) => Some(of_mushra(study.protocol, part, &own.presentations, rows)),
        Task::Identification(own) => Some(of_identification(study, part, own, rows)),
        Task::Pairs(pairs) => Some(of_pairs(study, part, pairs, rows, intervals, rules)),
        Task::Discrimination { tracks } => {
            let protocol = study.protocol;
            let tracks: Vec<&TrackRules> =
                tracks.iter().filter_map(|id| protocol.track(id)).collect();
            let mut found = of_tracks(study, part, &tracks, rows)?;
            if let Some((asked, people)) = in_order(part, &tracks, rows) {
                let result = sequential_effects(&people);
                let warned = (result.as_ref()).and_then(|result| {
                    sequential::warning(asked.answers()[0], result, rules.alpha)
                });
                found.warnings.extend(warned);
                found.results.over.sequential = result;
            }
            Some(found)
        }
        Task::Search(_) => Some(of_search(rows)),
        Task::Similarity(own) => {
            let trials = (rows, intervals);
            Some(of_similarity(study.protocol, part, own, trials, rules))
        }
        Task::Ranking(own) => Some(of_ranking(part, own, (rows, intervals), rules)),
        Task::Adjustment(own) => {
            let trials = (rows, intervals);
            Some(of_adjustment(study.protocol, part, own, trials, rules))
        }
    }
}

/// Participants with some of these rows who took part in the search that the study confirms, such as after the correction of an
/// id by an earlier release.
fn searchers<'a>(
    protocol: &Protocol,
    rows: impl Iterator<Item = &'a RatingRow>,
) -> Option<Warning> {
    let search = protocol.confirms.as_ref()?;
    let both = |row: &&RatingRow| !row.simulated && search.was_searcher(&row.participant);
    let both: BTreeSet<_> = rows.filter(both).map(|r| &r.participant).collect();
    let names: Vec<&str> = both.iter().map(|id| id.as_str()).collect();
    (!names.is_empty()).then(|| Warning {
        code: "searchers",
        text: format!(
            "{} took part in the search that this study confirms, and judge again what they chose: {}",
            counted(names.len(), "participant", "participants"),
            names.join(", ")
        ),
    })
}

/// The same of all answers of a study that count, ratings as well.
pub(crate) fn searchers_of(study: &StudyData<'_>, include: Include) -> Option<Warning> {
    let counting = Counting::of(study, include);
    let rows = study.rows.iter().filter(|row| counting.row(row));
    searchers(study.protocol, rows)
}

/// A search has no test: what it found is confirmed with participants who did not search.
fn of_search(rows: &[&RatingRow]) -> Found {
    Found {
        task: "search",
        trials: rows.len(),
        results: PartResults::undefined("a search has no statistics that decide anything"),
        warnings: vec![Warning {
            code: "search",
            text: "pairs were chosen by the answers before them, so that no test of them has its level; what a search \
                   found has to be confirmed with participants who did not take part in it"
                .to_owned(),
        }],
        data: PartData::default(),
        names: Vec::new(),
    }
}

/// The trials of each participant in their order, by session. `None` unless the tracks are answered by the same two words of
/// which one is right.
fn in_order(
    part: &Part,
    tracks: &[&TrackRules],
    rows: &[&RatingRow],
) -> Option<(Asked, Vec<Vec<Vec<Answered>>>)> {
    let method = tracks.first()?.method;
    let name = method.as_str();
    let asked = Asked::NAMES.iter().find(|n| n.1 == name)?.0;
    if asked.answers().len() != 2 || tracks.iter().any(|t| t.method != method) {
        return None;
    }
    let mut trials: Vec<(&str, u32, u32, Answered)> = (rows.iter())
        .filter_map(|row| {
            let trial = trial(part, asked, row, "")?;
            let first_is_right = trial.target? == 0;
            let answered = Answered {
                first: first_is_right == (trial.positive > 0.5),
                first_is_right,
                strength: trial.level.unwrap_or(0.0),
            };
            Some((row.participant.as_str(), row.session, row.trial, answered))
        })
        .collect();
    trials.small_sort_by_key(|(who, session, trial, _)| (*who, *session, *trial));
    let of_one = trials.chunk_by(|a, b| a.0 == b.0).map(|own| {
        let sessions = own.chunk_by(|a, b| a.1 == b.1);
        sessions
            .map(|one| one.iter().map(|t| t.3).collect())
            .collect()
    });
    Some((asked, of_one.collect()))
}

/// What a rating part says of groups and sessions, in a study that has them. All else about
/// ratings is in their own analysis.
fn of_ratings(
    study: &StudyData<'_>,
    part: &Part,
    own: &Presentations,
    rows: &[&RatingRow],
) -> Option<Found> {
    let protocol = study.protocol;
    if protocol.groups.is_none() && protocol.sessions.is_empty() {
        return None;
    }
    let tested = |id: &ModelId| {
        let model = protocol.model(id);
        model.is_some_and(|m| m.role == Role::Test && m.duplicate_of.is_none())
    };
    let asked = asked(protocol, part)?;
    let mut cells: BTreeMap<(&ParticipantId, Option<&PartId>, &ModelId), Vec<f64>> =
        BTreeMap::new();
    for row in rows {
        let model = row
            .model
            .as_ref()
            .filter(|id| own.models.contains(id) && tested(id));
        let rating = row.answers.get(asked).and_then(Answer::number);
        if let (Some(model), Some(rating)) = (model, rating) {
            let cell = (&row.participant, row.session_id.as_ref(), model);
            cells.entry(cell).or_default().push(rating);
        }
    }
    let sessions = sessions_of(protocol, part);
    let several = sessions.len() > 1;
    let groups = groups(rows);
    let measured: Vec<Measured> = (cells.iter())
        .filter_map(|((participant, session, model), ratings)| {
            Some(Measured {
                participant: participant.as_str().to_owned(),
                group: groups.get(participant.as_str()).cloned(),
                session: session.filter(|_| several).map(|s| s.as_str().to_owned()),
                condition: model.as_str().to_owned(),
                value: mean(ratings)?,
            })
        })
        .collect();
    let ids: Vec<&str> = sessions.iter().flatten().map(|s| s.as_str()).collect();
    let mut results = PartResults::undefined("");
    results.over.again = again(&measured, &ids, false);
    Some(Found {
        task: "rating",
        trials: rows.len(),
        results,
        warnings: Vec::new(),
        data: PartData::default(),
        names: Vec::new(),
    })
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
    let mut found = preferences(&chosen, pairs.tie, in_both_orders(&chosen));
    let models = study.protocol.models.iter();
    let vaf: BTreeMap<String, f64> = models
        .filter_map(|m| Some((m.id.as_str().to_owned(), m.vaf?)))
        .filter(|(id, _)| found.items.0.contains_key(id.as_str()))
        .collect();
    if !vaf.is_empty() {
        found.vaf = Some(with_vaf(&found, &vaf, rules));
    }
    let mut results = PartResults::undefined("");
    results.over.again = by_condition(&shares(&chosen, &groups(rows)));
    results.pairs = Some(found);
    Found {
        task: "pairs",
        trials: chosen.len(),
        results,
        warnings: Vec::new(),
        names: Vec::new(),
        data: PartData {
            vaf,
            ..PartData::default()
        },
    }
}

/// How large a share of their comparisons each participant's realizations win; a tie is half a
/// win.
fn shares(chosen: &[Preference], groups: &BTreeMap<String, String>) -> Vec<Measured> {
    let mut won: BTreeMap<(&str, &str), (f64, f64)> = BTreeMap::new();
    for p in chosen {
        let first = match p.choice {
            Choice::First(_) => 1.0,
            Choice::Second(_) => 0.0,
            Choice::Tie(_) => 0.5,
        };
        for (item, share) in [(&p.first, first), (&p.second, 1.0 - first)] {
            let cell = won.entry((&p.participant, item)).or_default();
            *cell = (cell.0 + share, cell.1 + 1.0);
        }
    }
    let one = |((who, item), (won, of)): ((&str, &str), (f64, f64))| Measured {
        participant: who.to_owned(),
        group: groups.get(who).cloned(),
        session: None,
        condition: item.to_owned(),
        value: won / of,
    };
    won.into_iter().map(one).collect()
}

/// The correlation of abilities with VAF over realizations, as that of mean ratings.
fn with_vaf(found: &Preferences, vaf: &BTreeMap<String, f64>, rules: &Rules) -> Correlation {
    let ability = |name: &str| found.items.0.get(name)?.ability.number();
    let known = vaf
        .iter()
        .filter_map(|(name, vaf)| Some((name.as_str(), *vaf, ability(name)?)));
    let known: Vec<(&str, f64, f64)> = known.collect();
    let names: Vec<&str> = known.iter().map(|k| k.0).collect();
    let x: Vec<f64> = known.iter().map(|k| k.1).collect();
    let y: Vec<f64> = known.iter().map(|k| k.2).collect();
    let mut correlation = Correlation::of(&x, &y, &names, rules);
    if names.is_empty() {
        correlation.explain(&"there are no abilities".into());
    } else if !is_constant(&x) && is_constant(&y) {
        correlation.explain(&"all abilities are equal".into());
    }
    correlation
}

/// The answer to a pair; `None` if there is none.
pub(super) fn preference(
    part: &Part,
    row: &RatingRow,
    intervals: &Intervals<'_>,
) -> Option<Preference> {
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
