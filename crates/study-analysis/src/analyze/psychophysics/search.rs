//! What the searches of a study found: maps, and no test. A search decides nothing, because its pairs were chosen by the
//! answers before them.

pub use super::explored::{Exploration, Explored, ExploredPair, Population};

use super::counting::Counting;
use super::explored::by_participant;
use super::part_data::{Intervals, StudyData};
use crate::analyze::Rules;
use crate::analyze::select::Include;
use std::collections::BTreeSet;
use study_base::text::ParticipantId;
use study_plan::procedure::search::RecordedPair;
use study_plan::protocol::{Answer, Part, SpaceRules};
use study_session::outcome::fold::History;
use study_session::outcome::{FormId, RatingRow};
use study_stats::describe::{mean, sd};
use study_stats::preference_gp::Posterior;

/// The explorations of all parts that search. Which participants and trials count is decided as for all parts.
pub fn explorations(study: &StudyData<'_>, include: Include) -> Vec<Exploration> {
    let parts = study.protocol.parts.iter();
    parts
        .filter_map(|part| exploration(study, part, include))
        .collect()
}

/// The exploration of a part; `None` of one that does not search.
pub(super) fn exploration(
    study: &StudyData<'_>,
    part: &Part,
    include: Include,
) -> Option<Exploration> {
    let (space, _) = study.protocol.searched(part)?;
    let counting = Counting::of(study, include);
    let rows = study.rows.iter().filter(|row| counting.row(row));
    let rows: Vec<&RatingRow> = rows.collect();
    let intervals = Intervals::of(study.intervals);
    let rules = Rules::of(study.protocol, "", include);
    let of_part = Counting::of_part(study, part, &rows, &intervals, &rules.exclude);
    let kept: BTreeSet<_> = of_part.kept.iter().map(|row| key(row)).collect();
    let excluded = of_part.all.iter().map(|row| key(row));
    let excluded: BTreeSet<_> = excluded.filter(|key| !kept.contains(key)).collect();
    let searches: Vec<Explored> = (study.sessions.iter())
        .filter(|history| counting.session(history))
        .filter_map(|history| explored(study, part, history, &excluded))
        .collect();
    Some(Exploration {
        part: part.id.clone(),
        space: space.clone(),
        population: population(space, &searches),
        pilot: searches.iter().any(|own| own.pilot),
        simulated: searches.iter().any(|own| own.simulated),
        searches,
        exclusions: of_part.exclusions,
    })
}

/// Participant, session and trial.
type Key<'a> = (&'a ParticipantId, u32, u32);

fn key(row: &RatingRow) -> Key<'_> {
    (&row.participant, row.session, row.trial)
}

/// The search of a session without some trials; `None` if it has no answer to one.
fn explored(
    study: &StudyData<'_>,
    part: &Part,
    history: &History,
    excluded: &BTreeSet<Key<'_>>,
) -> Option<Explored> {
    let start = history.start()?;
    let protocol = study.protocol.of(&start.assigned);
    let (space, _) = study.protocol.searched(part)?;
    let mut search = protocol.start_search(part, start.seat)?.ok()?;
    let question = part.asks.first()?;
    let mut pairs = Vec::new();
    for (trial, attempt) in history.searched(&part.id) {
        if excluded.contains(&(&start.participant, start.session, trial.trial)) {
            continue;
        }
        let [first, second] = &attempt.models[..] else {
            continue;
        };
        let (Some(first), Some(second)) = (space.point_of(first), space.point_of(second)) else {
            continue;
        };
        let form = FormId::Trial {
            trial: trial.trial,
            attempt: attempt.number,
        };
        let preferred = match history.answer(form, question) {
            Some(Answer::Choice(chosen)) => match chosen.first().map(String::as_str) {
                Some("first") => Some(first),
                Some("second") => Some(second),
                _ => None,
            },
            _ => None,
        };
        let points = [first.min(second), first.max(second)];
        let recorded = RecordedPair {
            pair: points,
            preferred,
        };
        if let Some(answer) = recorded.answer() {
            search.answer(&answer);
        }
        pairs.push(ExploredPair {
            trial: trial.trial,
            points,
            preferred,
        });
    }
    if search.answered() == 0 {
        return None;
    }
    let posterior = search.posterior()?;
    let (mean, sd) = centered(&posterior);
    let left_out = history.left_out(&part.id, space);
    let left_out: Vec<usize> = left_out.iter().map(|out| out.point).collect();
    let certified = space.lattice.certified();
    let best = posterior.best_point(|index| !left_out.contains(&certified[index]))?;
    Some(Explored {
        participant: start.participant.clone(),
        session: start.session,
        pilot: start.seat.is_pilot(),
        simulated: start.seat.is_simulated(),
        pairs,
        left_out,
        mean,
        sd,
        best,
    })
}

/// Means and standard deviations of utilities minus their mean over the points: the common level of all utilities is
/// not known from comparisons, and is no uncertainty of the map.
fn centered(posterior: &Posterior) -> (Vec<f64>, Vec<f64>) {
    let n = posterior.mean().len();
    let over = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / n as f64;
    let level = over(&mut posterior.mean().iter().copied());
    let with_all: Vec<f64> = (0..n)
        .map(|i| over(&mut (0..n).map(|j| posterior.covariance(i, j))))
        .collect();
    let of_level = over(&mut with_all.iter().copied());
    let variance = |i: usize| posterior.covariance(i, i) - 2.0 * with_all[i] + of_level;
    (
        posterior.mean().iter().map(|mean| mean - level).collect(),
        (0..n).map(|i| variance(i).max(0.0).sqrt()).collect(),
    )
}

fn population(space: &SpaceRules, searches: &[Explored]) -> Option<Population> {
    let points = searches.iter().map(|own| own.mean.len()).min()?;
    let of_search = |own: &Explored| own.mean.clone();
    let people = by_participant(searches);
    let maps: Vec<Vec<f64>> = match people.len() {
        1 => searches.iter().map(of_search).collect(),
        _ => (people.values())
            .map(|own| {
                let at = |point: usize| own.iter().map(|one| one.mean[point]).sum::<f64>();
                let all = own.len() as f64;
                (0..points).map(|point| at(point) / all).collect()
            })
            .collect(),
    };
    if maps.len() < 2 {
        return None;
    }
    let at = |point: usize| -> Vec<f64> { maps.iter().map(|map| map[point]).collect() };
    let means: Option<Vec<f64>> = (0..points).map(|point| mean(&at(point))).collect();
    let sds: Option<Vec<f64>> = (0..points).map(|point| sd(&at(point))).collect();
    let means = means?;
    let certified = space.lattice.certified();
    let is_out = |index: usize| {
        let out = |own: &Explored| own.left_out.contains(&certified[index]);
        searches.iter().any(out)
    };
    let may: Vec<usize> = (0..points).filter(|index| !is_out(*index)).collect();
    let may = if may.is_empty() {
        (0..points).collect()
    } else {
        may
    };
    let most = may.iter().map(|index| means[*index]);
    let most = most.fold(f64::NEG_INFINITY, f64::max);
    let best = may.into_iter().find(|index| means[*index] == most)?;
    Some(Population {
        mean: means,
        sd: sds?,
        best,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_base::text::PartId;
    use study_plan::procedure::{Ladder, Lattice};
    use study_plan::protocol::{Axis, Vary};
    use study_stats::preference_gp::{Choice, Kernel};

    fn space() -> SpaceRules {
        SpaceRules {
            id: PartId::new("s").unwrap(),
            from: "a.toml".to_owned(),
            axes: vec![Axis {
                vary: Vary::Detent,
                levels: Ladder::new(vec![0.5, 1.0, 1.5]).unwrap(),
            }],
            lattice: Lattice::new(vec![3], |_| true).unwrap(),
        }
    }

    fn map(who: &str, session: u32, mean: [f64; 3], left_out: &[usize]) -> Explored {
        Explored {
            participant: ParticipantId::new(who).unwrap(),
            session,
            pilot: false,
            simulated: false,
            pairs: Vec::new(),
            left_out: left_out.to_vec(),
            mean: mean.to_vec(),
            sd: vec![1.0; 3],
            best: 0,
        }
    }

    /// Two sessions of one participant are one person, whose map is their mean.
    #[test]
    fn people_count_alike_however_often_they_came() {
        let twice = [
            map("P01", 1, [3.0, 0.0, 0.0], &[]),
            map("P01", 2, [1.0, 0.0, 2.0], &[]),
        ];
        let alone = population(&space(), &twice).unwrap();
        assert_eq!((alone.mean[0], alone.best), (2.0, 0));
        assert!((alone.sd[0] - 2.0_f64.sqrt()).abs() < 1e-12);
        let [first, second] = twice;
        let other = map("P02", 1, [-3.0, 4.0, 1.0], &[]);
        let searches = vec![first.clone(), other, second];
        let both = population(&space(), &searches).unwrap();
        assert_eq!(both.mean, [-0.5, 2.0, 1.0]);
        assert_eq!(both.best, 1);
        let found = Exploration {
            part: PartId::new("p").unwrap(),
            space: space(),
            population: Some(both),
            pilot: false,
            simulated: false,
            exclusions: Vec::new(),
            searches,
        };
        assert_eq!((found.people(), found.best()), (2, Some(1)));
        // A point at which the device failed in a session is not what they recommend.
        let failed = map("P02", 1, [-3.0, 4.0, 1.0], &[1]);
        let best = population(&space(), &[first.clone(), failed]).unwrap().best;
        assert_eq!(best, 2);
        assert!(population(&space(), &[first]).is_none());
    }

    /// Of two points, f₁ minus their mean is half of f₁ − f₂.
    #[test]
    fn a_map_does_not_count_the_level_of_all_utilities() {
        let kernel = Kernel {
            sd: 2.0,
            lengths: vec![0.4],
        };
        let choices = [Choice {
            preferred: 1,
            other: 0,
        }];
        let points = [vec![0.0], vec![0.5]];
        let posterior = Posterior::new(&points, &kernel, &choices).unwrap();
        let (mean, sd) = centered(&posterior);
        let half = 0.5 * (posterior.mean()[1] - posterior.mean()[0]);
        assert!(half > 0.0 && (mean[1] - half).abs() < 1e-12 && (mean[0] + half).abs() < 1e-12);
        let apart = posterior.covariance(0, 0) + posterior.covariance(1, 1)
            - 2.0 * posterior.covariance(0, 1);
        assert!((sd[0] - 0.5 * apart.sqrt()).abs() < 1e-12, "{sd:?}");
        assert!(sd[0] < posterior.sd(0));
    }
}
