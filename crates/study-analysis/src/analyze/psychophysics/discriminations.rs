//! The tracks of a part: functions, sensitivities, and what participants have in common.

use super::again::again;
use super::detection::Sensitivity;
use super::over_participants::{Measured, Threshold, Told, mixed, sensitivities};
use super::part_data::{Found, LevelData, PartData, StudyData, groups, sessions_of, trial};
use super::population::{ConditionFit, PopulationCell, population};
use super::results::PartResults;
use super::standards::{AboveStandard, webers_law};
use super::tracks::of_session;
use super::trials::{Asked, TrialCount, TrialSettings, discrimination, level};
use crate::analyze::keys::CellName;
use crate::analyze::record::Number as _;
use crate::analyze::warning::Warning;
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::PartId;
use study_plan::protocol::Protocol;
use study_plan::protocol::conditions::by_condition;
use study_plan::protocol::parts::{Method, Part, TrackRules, Vary};
use study_session::outcome::RatingRow;
use study_stats::describe::mean;
use study_stats::psychometric::hierarchy::Effort;
use study_stats::psychometric::{Core, Level, Priors, Spacing, Support, WidthPrior, pooled};

/// Each condition is fitted by itself; the priors refer to the range of its own ladder. A track is a
/// condition, unless several measure one together.
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
    let (mut together, mut settings_of) = (Vec::new(), BTreeMap::new());
    let groups = groups(rows);
    let sessions = sessions_of(protocol, part);
    let apart = have_different_standards(tracks);
    let mut increments = Vec::new();
    let conditions = by_condition(tracks);
    let cells = conditions
        .iter()
        .flat_map(|own| sessions.iter().map(move |s| (own, *s)));
    for (own_tracks, session) in cells {
        // Those of a condition are alike but for their procedures.
        let rules = own_tracks[0];
        let (asked, name) = *Asked::NAMES.iter().find(|n| n.1 == rules.method.as_str())?;
        if methods.len() == 1 {
            (task, data.guess) = (name, rules.method.guess_rate());
        }
        let condition = &condition(rules.condition(), session);
        let own = rows.iter().filter(|row| {
            let in_session = session.is_none() || row.session_id.as_ref() == session;
            let in_track = |track: &&TrackRules| row.track.as_ref() == Some(&track.id);
            in_session && own_tracks.iter().any(in_track)
        });
        let counts: Vec<TrialCount> = own
            .filter_map(|row| trial(part, asked, row, condition))
            .collect();
        trials += counts.len();
        names.push(condition.clone());
        let mut found = discrimination(asked, &counts, &settings(protocol, rules));
        for (name, function) in &mut found.psy {
            let own = AboveStandard::of(rules, &function.posterior.threshold);
            if let Some(standard) = rules.standard_level()
                && let Some(increment) = own.as_ref().and_then(|own| own.increment.number())
            {
                let participant = name.participant.as_str().to_owned();
                increments.push((participant, standard, increment));
            }
            function.above_standard = own;
        }
        let mut people: Vec<&str> = counts.iter().map(|c| c.participant.as_str()).collect();
        people.sort_unstable();
        people.dedup();
        for participant in &people {
            let cell = CellName::of(participant, condition);
            let threshold = found.psy.get(&cell);
            let threshold = threshold.and_then(|f| f.posterior.threshold.median.as_ref()?.number());
            let from = rules.standard_level().filter(|_| apart).unwrap_or(0.0);
            let threshold = threshold.map(|threshold| threshold - from);
            let told_apart = sensitivity(asked, rules.method, found.sdt.get(&cell));
            if let Some(value) = threshold.or(told_apart.map(|t| t.0)) {
                measured.push(Measured {
                    participant: (*participant).to_owned(),
                    group: groups.get(*participant).cloned(),
                    session: session.map(|s| s.as_str().to_owned()),
                    condition: rules.condition().as_str().to_owned(),
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
            let own = levels(
                asked,
                (participant, condition),
                &counts,
                protocol.fit(rules),
            );
            if let (Some(own), Some((experiment, _))) = (&own, asked.experiment()) {
                together.push(PopulationCell {
                    name: cell,
                    levels: own.levels.clone(),
                });
                let settings = settings(protocol, rules);
                let fit = ConditionFit {
                    core: settings.core,
                    spacing: settings.spacing,
                    experiment,
                    priors: settings.priors,
                };
                settings_of.insert(condition.clone(), fit);
            }
            data.levels.extend(own);
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
            if !in_session || people.binary_search(&participant).is_err() {
                continue;
            }
            for track in own_tracks {
                let name = CellName::of(participant, &self::condition(&track.id, session));
                let found = of_session(protocol, track, history, (&name, condition), &mut warnings);
                if let Some((result, own)) = found {
                    results.track.insert(name, result);
                    data.tracks.push(own);
                }
            }
        }
    }
    results.over.sdt_group = sensitivities(&told);
    let increments: Vec<(&str, f64, f64)> = (increments.iter())
        .map(|(who, standard, increment)| (who.as_str(), *standard, *increment))
        .collect();
    results.over.webers_law = webers_law(&increments);
    if apart && !thresholds.is_empty() {
        warnings.push(Warning {
            code: "different-standards",
            text: "the tracks have different standards: their thresholds are compared by the distance from \
                   the standard"
                .to_owned(),
        });
    }
    let families = tracks.iter().filter_map(|t| protocol.family(t.family()?));
    let families: Vec<_> = families.collect();
    // Sensitivities have no ratios.
    let ratios = !thresholds.is_empty() && have_ratios(protocol, tracks);
    if !thresholds.is_empty() {
        results.over.psy_mixed = mixed(&over_sessions(&measured, ratios), ratios);
    }
    // Participants of different groups are no draws from one population.
    if study.pools && protocol.groups.is_none() {
        let of = (protocol.study.seed, part.id.as_str());
        results.over.psy_population = population(&together, &settings_of, of, Effort::ANALYSIS);
        if let Some(model) = &results.over.psy_population
            && !model.has_converged()
        {
            let why = model.sd_participant.median.reason().unwrap_or_default();
            warnings.push(Warning {
                code: "not-pooled",
                text: format!("thresholds were not learned together: {why}"),
            });
        }
    }
    let ids: Vec<&str> = sessions.iter().flatten().map(|s| s.as_str()).collect();
    results.over.again = again(&measured, &ids, ratios);
    data.measured = measured;
    if families.windows(2).all(|two| two[0].id == two[1].id) {
        data.dimension = tracks.first().and_then(|track| protocol.dimension(track));
        data.family = families.first().map(|family| family.dimension());
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

/// Whether the levels of these tracks have ratios, as those of a blend have not; their distances
/// from a standard have.
pub(crate) fn have_ratios(protocol: &Protocol, tracks: &[&TrackRules]) -> bool {
    let counted = tracks.iter().filter(|t| t.relative.is_none());
    let mut families = counted.filter_map(|t| protocol.family(t.family()?));
    !families.any(|f| f.vary == Vary::Blend)
}

/// Whether levels above different standards are compared, of tracks that do not count them from
/// there: equal increments would then be different thresholds. Yes–no needs no standard.
fn have_different_standards(tracks: &[&TrackRules]) -> bool {
    let of = |track: &&TrackRules| {
        let plain = track.relative.is_none() && track.method != Method::YesNo;
        track.standard_level().filter(|_| plain)
    };
    let standards: Vec<Option<f64>> = tracks.iter().map(of).collect();
    standards.windows(2).any(|two| two[0] != two[1])
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

/// The name of a condition or track in the identifiers of its statistics; of a part that several
/// sessions have, with the session.
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

/// How the functions of a track are fitted: the priors refer to the range of the ladder,
/// since an adaptive track stays near the threshold.
pub(crate) fn settings(protocol: &Protocol, track: &TrackRules) -> TrialSettings {
    let (spacing, core) = protocol.fit(track);
    let places = |levels: &[f64]| -> Option<Vec<f64>> {
        levels.iter().map(|level| spacing.place(*level)).collect()
    };
    // As the track counts its levels.
    let ladder = track.family().map(|_| protocol.ladder(track));
    let support = ladder.and_then(|ladder| Support::of(places(ladder.levels())?));
    // Where a stimulus equals the standard, if all levels are above it.
    let origin = (track.counted_standard()).and_then(|level| spacing.place(level));
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

    /// A part with tracks on the standards 0.2, 0.4 and 0.8.
    fn on_standards(relative: &str) -> Protocol {
        let mut text = String::from(
            r#"
format = "study-protocol/3"
study = { id = "example", title = "An example", seed = 1 }
design = { participants = 10 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "more" }

[[families]]
id = "friction"
from = "static.toml"
vary = "friction"
range = [0.02, 1.6]
steps = 80

[[parts]]
id = "more"
kind = "discrimination"
prompt = "Which one had more friction?"
tracks = ["low", "middle", "high"]
"#,
        );
        for (id, standard) in [("low", 0.2), ("middle", 0.4), ("high", 0.8)] {
            text += &format!(
                "[[tracks]]\nid = \"{id}\"\nmethod = \"2ifc\"\nfamily = \"friction\"\nstandard = {standard}\n\
                 procedure = {{ rule = \"quest+\", trials = 40 }}\n{relative}\n"
            );
        }
        let parsed = study_plan::protocol::file::parse("protocol.toml", &text);
        let shown = parsed.findings.render(false);
        parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
    }

    /// Answers that rise along the levels above each standard.
    #[test]
    fn thresholds_are_counted_from_the_standard() {
        let of = |relative: &str| {
            let found = crate::preregister::complete_parts(&on_standards(relative), 4);
            found.into_iter().next().unwrap()
        };
        let cell = CellName::of("000000", "high");
        let increments = of("relative = \"increment\"");
        let function = &increments.results.psy[&cell];
        let threshold = function.posterior.threshold.median.as_ref().unwrap();
        let threshold = threshold.number().unwrap();
        let above = function.above_standard.as_ref().unwrap();
        assert!(threshold > 0.0 && threshold < 0.8, "{threshold}");
        assert_eq!(above.increment.number(), Some(threshold));
        assert!((above.level.number().unwrap() - 0.8 - threshold).abs() < 1e-12);
        let fraction = above.weber_fraction.as_ref().unwrap().number().unwrap();
        assert!((fraction - threshold / 0.8).abs() < 1e-12);
        let ends = function.posterior.threshold.ci95.as_ref().unwrap().ends();
        let (low, high) = ends.unwrap();
        let own = above.weber_fraction_ci95.as_ref().unwrap().ends().unwrap();
        assert!((own.0 - low / 0.8).abs() < 1e-12 && (own.1 - high / 0.8).abs() < 1e-12);
        assert!(increments.results.over.webers_law.is_some());
        assert_eq!(
            increments.data.dimension.as_deref(),
            Some("friction above the standard")
        );

        let fractions = of("relative = \"fraction\"");
        let function = &fractions.results.psy[&cell];
        let threshold = function.posterior.threshold.median.as_ref().unwrap();
        let above = function.above_standard.as_ref().unwrap();
        assert_eq!(
            above.weber_fraction.as_ref().unwrap().number(),
            threshold.number()
        );
    }

    /// Thresholds at different standards are never compared as levels.
    #[test]
    fn levels_above_different_standards_are_compared_by_their_distances() {
        let part = &crate::preregister::complete_parts(&on_standards(""), 4)[0];
        assert!(
            part.warnings
                .iter()
                .any(|w| w.code == "different-standards")
        );
        for (who, condition, standard) in [("000001", "low", 0.2), ("000002", "high", 0.8)] {
            let function = &part.results.psy[&CellName::of(who, condition)];
            let level = function.posterior.threshold.median.as_ref().unwrap();
            let level = level.number().unwrap();
            let compared = part.data.measured.iter();
            let compared: Vec<f64> = compared
                .filter(|m| m.participant == who && m.condition == condition)
                .map(|m| m.value)
                .collect();
            assert!(
                (compared[0] + standard - level).abs() < 1e-12,
                "{compared:?} {level}"
            );
        }
        assert!(part.results.over.webers_law.is_none());
    }

    /// A study of one track over a ladder with this scale, from `low` to 2, above this standard.
    fn study(scale: &str, low: f64, standard: f64) -> Protocol {
        let text = format!(
            r#"
format = "study-protocol/2"
study = {{ id = "example", title = "An example", seed = 1 }}
design = {{ participants = 10 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "more" }}

[[families]]
id = "friction"
from = "static.toml"
vary = "friction"
range = [{low}, 2.0]
steps = 20
scale = "{scale}"

[[parts]]
id = "more"
kind = "discrimination"
text = "Two switches."
prompt = "Which one had more friction?"
tracks = ["only"]

[[tracks]]
id = "only"
method = "2ifc"
family = "friction"
standard = {standard:?}
procedure = {{ rule = "staircase", up = 1, down = 3, start = 1.0, scale = "lin", steps = [0.1], stop = {{ reversals = 8, max_trials = 60 }}, estimate_last = 6 }}
"#
        );
        let parsed = study_plan::protocol::file::parse("protocol.toml", &text);
        let shown = parsed.findings.render(false);
        parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
    }

    /// The prior of a width follows from the scale of the ladder and from the standard.
    #[test]
    fn a_track_has_the_prior_of_its_ladder() {
        let of = |scale: &str, low: f64, standard: f64| {
            let protocol = study(scale, low, standard);
            let track = protocol
                .track(&PartId::new("only").unwrap())
                .unwrap()
                .clone();
            settings(&protocol, &track).priors
        };
        assert_eq!(of("log", 0.1, 0.0).width, WidthPrior::OfRatios);
        assert_eq!(of("lin", 0.1, 0.0).width, WidthPrior::FromOrigin(0.0));
        assert_eq!(of("lin", 0.3, 0.3).width, WidthPrior::FromOrigin(0.3));
        // A standard within the ladder is no origin: there are thresholds on both sides.
        assert_eq!(of("lin", 0.1, 0.5).width, WidthPrior::Even);
        let support = of("log", 0.1, 0.0).support.unwrap();
        assert!((support.low - 0.1f64.ln()).abs() < 1e-12);
        assert!((support.high - 2f64.ln()).abs() < 1e-12);
        assert_eq!(of("lin", 0.1, 0.0).lapse, 30.0);
        // Counted from the standard 0.8, the levels 0.82 to 1.6 are fractions from 0.025 to 1.
        let protocol = on_standards("relative = \"fraction\"");
        let support = settings(&protocol, &protocol.tracks[2])
            .priors
            .support
            .unwrap();
        assert!((support.low - 0.025f64.ln()).abs() < 1e-9 && support.high.abs() < 1e-9);
    }

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
