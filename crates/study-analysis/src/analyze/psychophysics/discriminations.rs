//! The tracks of a part: functions, sensitivities, and what participants have in common.

use super::again::again;
use super::detection::Sensitivity;
use super::over_participants::{Measured, Threshold, Told, mixed, sensitivities};
use super::part_data::{Found, LevelData, PartData, StudyData, chosen, groups, sessions_of};
use super::results::PartResults;
use super::tracks::of_session;
use super::trials::{Asked, TrialCount, TrialSettings, discrimination, level};
use crate::analyze::keys::CellName;
use crate::analyze::record::Number as _;
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::PartId;
use study_plan::protocol::Protocol;
use study_plan::protocol::parts::{Method, Part, TrackRules, Vary};
use study_session::outcome::RatingRow;
use study_stats::describe::mean;
use study_stats::psychometric::{Core, Level, Priors, Spacing, Support, WidthPrior, pooled};

/// Each track is fitted by itself; the priors refer to the range of its own ladder.
pub(super) fn of_tracks(
    study: &StudyData<'_>,
    part: &Part,
    tracks: &[&TrackRules],
    rows: &[&RatingRow],
) -> Option<Found> {
    let protocol = study.protocol;
    let methods: BTreeSet<&str> = tracks.iter().map(|t| t.method.as_str()).collect();
    let mut results = PartResults::undefined("");
    let (mut trials, mut task) = (0, "discrimination");
    let (mut told, mut thresholds, mut measured) = (Vec::new(), Vec::new(), Vec::new());
    let (mut warnings, mut data) = (Vec::new(), PartData::default());
    let mut names = Vec::new();
    let groups = groups(rows);
    let sessions = sessions_of(protocol, part);
    for (rules, session) in (tracks.iter()).flat_map(|t| sessions.iter().map(move |s| (*t, *s))) {
        let (asked, name) = *Asked::NAMES.iter().find(|n| n.1 == rules.method.as_str())?;
        if methods.len() == 1 {
            (task, data.guess) = (name, rules.method.guess_rate());
        }
        let condition = &condition(&rules.id, session);
        let own = rows.iter().filter(|row| {
            let in_session = session.is_none() || row.session_id.as_ref() == session;
            in_session && row.track.as_ref() == Some(&rules.id)
        });
        let counts: Vec<TrialCount> = own
            .filter_map(|row| trial(part, asked, row, condition))
            .collect();
        trials += counts.len();
        names.push(condition.clone());
        let found = discrimination(asked, &counts, &settings(protocol, rules));
        let mut people: Vec<&str> = counts.iter().map(|c| c.participant.as_str()).collect();
        people.sort_unstable();
        people.dedup();
        for participant in &people {
            let cell = CellName::of(participant, condition);
            let threshold = found.psy.get(&cell);
            let threshold = threshold.and_then(|f| f.posterior.threshold.median.as_ref()?.number());
            let told_apart = sensitivity(asked, rules.method, found.sdt.get(&cell));
            if let Some(value) = threshold.or(told_apart.map(|t| t.0)) {
                measured.push(Measured {
                    participant: (*participant).to_owned(),
                    group: groups.get(*participant).cloned(),
                    session: session.map(|s| s.as_str().to_owned()),
                    condition: rules.id.as_str().to_owned(),
                    value,
                });
            }
            thresholds.extend(threshold);
            if let Some((d, above_chance)) = told_apart {
                told.push(Told {
                    condition: condition.clone(),
                    d,
                    above_chance,
                });
            }
            data.levels.extend(levels(
                asked,
                (participant, condition),
                &counts,
                protocol.fit(rules),
            ));
        }
        results.psy.extend(found.psy);
        results.pooled.extend(found.pooled);
        results.sdt.extend(found.sdt);
        results.over.psy_group.extend(found.over.psy_group);
        // Whoever does not count has no track either.
        for history in study.sessions {
            let Some(start) = history.start() else {
                continue;
            };
            let participant = start.participant.as_str();
            let in_session = session.is_none() || start.assigned.session_id.as_ref() == session;
            if in_session && people.binary_search(&participant).is_ok() {
                let name = CellName::of(participant, condition);
                let found = of_session(protocol, rules, history, &name, &mut warnings);
                if let Some((result, own)) = found {
                    results.track.insert(name, result);
                    data.tracks.push(own);
                }
            }
        }
    }
    results.over.sdt_group = sensitivities(&told);
    let families = tracks.iter().filter_map(|t| protocol.family(t.family()?));
    let families: Vec<_> = families.collect();
    // Sensitivities have no ratios.
    let ratios = !thresholds.is_empty() && have_ratios(protocol, tracks);
    if !thresholds.is_empty() {
        results.over.psy_mixed = mixed(&over_sessions(&measured, ratios), ratios);
    }
    let ids: Vec<&str> = sessions.iter().flatten().map(|s| s.as_str()).collect();
    results.over.again = again(&measured, &ids, ratios);
    data.measured = measured;
    if let Some(first) = families.first()
        && families.iter().all(|f| f.id == first.id)
    {
        data.dimension = Some(first.dimension());
    }
    Some(Found {
        task,
        trials,
        results,
        warnings,
        data,
        names,
    })
}

/// Whether the levels of these tracks have ratios, as those of a blend have not.
pub(crate) fn have_ratios(protocol: &Protocol, tracks: &[&TrackRules]) -> bool {
    let mut families = tracks.iter().filter_map(|t| protocol.family(t.family()?));
    !families.any(|f| f.vary == Vary::Blend)
}

/// The threshold of each participant and track, over the sessions.
fn over_sessions(measured: &[Measured], ratios: bool) -> Vec<Threshold<'_>> {
    let mut cells: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    for m in measured {
        cells
            .entry((&m.participant, &m.condition))
            .or_default()
            .push(m.value);
    }
    let usable = !ratios || measured.iter().all(|m| m.value > 0.0);
    let center = |x: &[f64]| match usable && ratios {
        true => {
            libm::exp(mean(&x.iter().map(|x| libm::log(*x)).collect::<Vec<_>>()).unwrap_or(0.0))
        }
        false => mean(x).unwrap_or(0.0),
    };
    (cells.iter())
        .map(|((participant, condition), x)| Threshold {
            participant,
            condition,
            value: if usable {
                center(x)
            } else {
                x.iter().copied().fold(f64::INFINITY, f64::min)
            },
        })
        .collect()
}

/// The name of a track in the identifiers of its statistics; of a part that several sessions
/// have, with the session.
fn condition(track: &PartId, session: Option<&PartId>) -> String {
    match session {
        Some(session) => format!("{track}@{session}"),
        None => track.as_str().to_owned(),
    }
}

/// d′ and what is 0 by chance.
pub(super) fn sensitivity(
    asked: Asked,
    method: Method,
    found: Option<&Sensitivity>,
) -> Option<(f64, f64)> {
    let found = found?;
    match asked {
        Asked::TwoIntervals | Asked::YesNo => Some((found.d.number()?, found.d.number()?)),
        Asked::ThreeIntervals | Asked::OddOneOut => {
            // Without a d′, if all answers are correct.
            let correct = found.share_correct.number()?;
            Some((found.d.number()?, correct - method.guess_rate()?))
        }
        Asked::Abx | Asked::SameDifferent => {
            let unbiased = found.share_unbiased.number()?;
            Some((found.d_differencing.number()?, unbiased - 0.5))
        }
        Asked::Comparison => None,
    }
}

/// The answers of a participant by level, without catch trials; `None` without levels.
fn levels(
    asked: Asked,
    (participant, condition): (&str, &str),
    counts: &[TrialCount],
    (spacing, core): (Spacing, Core),
) -> Option<LevelData> {
    let own = counts.iter().filter(|c| c.participant == participant);
    let levels: Vec<Level> = own.filter_map(|trial| level(asked, trial)).collect();
    (!levels.is_empty()).then(|| LevelData {
        participant: participant.to_owned(),
        condition: condition.to_owned(),
        levels: pooled(&levels),
        spacing,
        core,
    })
}

fn trial(part: &Part, asked: Asked, row: &RatingRow, condition: &str) -> Option<TrialCount> {
    let correct = row.correct?;
    let given = chosen(part, row)?;
    let words = asked.answers();
    let given = words.iter().position(|word| *word == given)?;
    // Of two answers, the one that was not given is correct if the given one is wrong. Of
    // three it is not known from the row, and not needed: only right or wrong counts.
    let target = match (correct, words.len()) {
        (true, _) => Some(given),
        (false, 2) => Some(1 - given),
        (false, _) => None,
    };
    Some(TrialCount {
        participant: row.participant.as_str().to_owned(),
        condition: condition.to_owned(),
        level: row.level,
        target,
        positive: f64::from(u8::from(correct)),
        trials: 1.0,
    })
}

/// How the functions of a track are fitted: the priors refer to the range of the ladder,
/// since an adaptive track stays near the threshold.
pub(crate) fn settings(protocol: &Protocol, track: &TrackRules) -> TrialSettings {
    let (spacing, core) = protocol.fit(track);
    let family = track.family().and_then(|id| protocol.family(id));
    let places = |levels: &[f64]| -> Option<Vec<f64>> {
        levels.iter().map(|level| spacing.place(*level)).collect()
    };
    let support = family.and_then(|f| Support::of(places(f.ladder.levels())?));
    // Where a stimulus equals the standard, if all levels are above it.
    let origin = track
        .standard_level()
        .and_then(|level| spacing.place(level));
    let origin = origin.filter(|origin| support.is_some_and(|s| *origin <= s.low));
    let width = match (origin, spacing) {
        (Some(origin), _) => WidthPrior::FromOrigin(origin),
        (None, Spacing::Log) => WidthPrior::OfRatios,
        (None, Spacing::Lin) => WidthPrior::Even,
    };
    TrialSettings {
        core,
        spacing,
        lambda: track.fit.lapse,
        standard: None,
        priors: Priors::track(support, width),
        repeats: 0,
        seed: protocol.study.seed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::record::Stat;

    /// Tracks are compared, not tracks in a session.
    #[test]
    fn a_threshold_of_several_sessions_is_one_for_each_track() {
        let measured = [
            ("x", "first", 0.2),
            ("y", "first", 0.5),
            ("x", "second", 0.8),
        ];
        let measured = measured.map(|(condition, session, value)| Measured {
            participant: "A".to_owned(),
            group: None,
            session: Some(session.to_owned()),
            condition: condition.to_owned(),
            value,
        });
        // geometric means of ratios, else means
        for (ratios, of_x) in [(true, 0.4), (false, 0.5)] {
            let found = over_sessions(&measured, ratios);
            let found: Vec<_> = found.iter().map(|t| (t.condition, t.value)).collect();
            assert!(
                matches!(found[..], [("x", x), ("y", 0.5)] if (x - of_x).abs() < 1e-12),
                "{found:?}"
            );
        }
    }

    /// Half of the answers right is chance among two, and above it among three.
    #[test]
    fn chance_depends_on_the_number_of_answers() {
        let half = Sensitivity {
            d: Some(Stat::of(0.7)),
            d_differencing: Some(Stat::of(0.7)),
            share_correct: Some(Stat::of(0.5)),
            share_unbiased: Some(Stat::of(0.5)),
            ..Sensitivity::undefined("")
        };
        for (asked, method, above) in [
            (Asked::ThreeIntervals, Method::ThreeIntervals, 1.0 / 6.0),
            (Asked::OddOneOut, Method::OddOneOut, 1.0 / 6.0),
            (Asked::Abx, Method::Abx, 0.0),
            (Asked::SameDifferent, Method::SameDifferent, 0.0),
            (Asked::TwoIntervals, Method::TwoIntervals, 0.7),
        ] {
            let (d, found) = sensitivity(asked, method, Some(&half)).unwrap();
            assert!(
                (found - above).abs() < 1e-12 && d == 0.7,
                "{method:?}: {found}"
            );
        }
    }

    /// Where d′ is never below 0, answers below chance are: nobody tells the two apart who is
    /// wrong more often than somebody who guesses.
    #[test]
    fn answers_below_chance_are_below_0() {
        let below = |share: f64| Sensitivity {
            d: Some(Stat::of(0.7)),
            d_differencing: Some(Stat::of(0.7)),
            share_correct: Some(Stat::of(share)),
            share_unbiased: Some(Stat::of(share)),
            ..Sensitivity::undefined("")
        };
        for (asked, method) in [
            (Asked::ThreeIntervals, Method::ThreeIntervals),
            (Asked::OddOneOut, Method::OddOneOut),
            (Asked::Abx, Method::Abx),
            (Asked::SameDifferent, Method::SameDifferent),
        ] {
            let (_, found) = sensitivity(asked, method, Some(&below(0.2))).unwrap();
            assert!(found < -0.1, "{method:?}: {found}");
        }
    }

    /// Whoever compares the intervals has the d′ of differencing, also in tables.
    #[test]
    fn the_sensitivity_of_comparing_is_that_of_differencing() {
        let independent = Sensitivity {
            d: Some(Stat::of(1.1)),
            ..Sensitivity::undefined("")
        };
        let differencing = Sensitivity {
            d_differencing: Some(Stat::of(0.7)),
            ..independent.clone()
        };
        assert_eq!(independent.d().0, Some(1.1));
        assert_eq!(differencing.d().0, Some(0.7));
    }
}
