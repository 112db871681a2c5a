//! What the searches of a study found: maps, and no test. A search decides nothing, because its pairs were chosen by the
//! answers before them.

use super::part_data::StudyData;
use crate::analyze::select::{Include, Whose, state_counts};
use std::collections::BTreeSet;
use study_base::text::{PartId, ParticipantId};
use study_plan::procedure::search::RecordedPair;
use study_plan::protocol::{Answer, Part, SpaceRules};
use study_session::outcome::FormId;
use study_session::outcome::fold::History;
use study_session::outcome::ratings::Origin;
use study_stats::describe::{mean, sd};
use study_stats::preference_gp::Posterior;

/// What a part that searches found.
#[derive(Debug, Clone)]
pub struct Exploration {
    /// The part.
    pub part: PartId,
    /// Its space. Values below are those of its certified points, in their order.
    pub space: SpaceRules,
    /// The participants who count, in the order of their sessions.
    pub participants: Vec<Explored>,
    /// All of them together; `None` with fewer than two.
    pub population: Option<Population>,
}

/// The search of one participant in one session.
#[derive(Debug, Clone)]
pub struct Explored {
    /// Participant.
    pub participant: ParticipantId,
    /// Session, from 1.
    pub session: u32,
    /// The pairs in the order in which they were presented, with the corrected answers.
    pub pairs: Vec<ExploredPair>,
    /// The posterior mean of the utility of each point, in units of the noise of one impression, minus its mean over the
    /// points: only differences of utilities are known.
    pub mean: Vec<f64>,
    /// The posterior standard deviation of that difference.
    pub sd: Vec<f64>,
    /// Index of the point with the largest mean.
    pub best: usize,
}

/// A pair that was presented.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ExploredPair {
    /// Trial of the session.
    pub trial: u32,
    /// Its two points, the lower number first.
    pub points: [usize; 2],
    /// The one that was preferred; `None` if that was declined.
    pub preferred: Option<usize>,
}

/// The maps of several participants together. Each counts alike, however certain it is.
#[derive(Debug, Clone)]
pub struct Population {
    /// Mean over the participants' maps.
    pub mean: Vec<f64>,
    /// Standard deviation between the participants' maps.
    pub sd: Vec<f64>,
    /// Index of the point with the largest mean.
    pub best: usize,
}

/// The explorations of all parts that search. Which participants count is decided as for all parts.
pub fn explorations(study: &StudyData<'_>, include: Include) -> Vec<Exploration> {
    let origin = |history: &History| {
        let seat = history.start().map(|start| start.seat);
        Origin::of(
            seat.is_some_and(|seat| seat.is_simulated()),
            seat.is_some_and(|seat| seat.is_pilot()),
        )
    };
    let origins: Vec<Origin> = study
        .sessions
        .iter()
        .map(|history| origin(history))
        .collect();
    let whose = Whose::of(&origins, include);
    let unfinished = study.protocol.analysis.unfinished;
    let left_out: BTreeSet<&ParticipantId> = (study.participants.iter())
        .filter(|p| !state_counts(p.state, unfinished))
        .map(|p| &p.participant)
        .collect();
    let explore = |part: &Part| {
        let (space, _) = study.protocol.searched(part)?;
        let participants: Vec<Explored> = (study.sessions.iter())
            .filter(|history| whose.counts(origin(history)))
            .filter_map(|history| explored(study, part, history))
            .filter(|own| !left_out.contains(&own.participant))
            .collect();
        Some(Exploration {
            part: part.id.clone(),
            space: space.clone(),
            population: population(&participants),
            participants,
        })
    };
    study.protocol.parts.iter().filter_map(explore).collect()
}

/// The search of a session; `None` if it has no answer to one.
fn explored(study: &StudyData<'_>, part: &Part, history: &History) -> Option<Explored> {
    let start = history.start()?;
    let protocol = study.protocol.of(&start.assigned);
    let (space, _) = study.protocol.searched(part)?;
    let mut search = protocol.start_search(part, start.seat)?.ok()?;
    let question = part.asks.first()?;
    let mut pairs = Vec::new();
    for (trial, attempt) in history.searched(&part.id) {
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
    Some(Explored {
        participant: start.participant.clone(),
        session: start.session,
        pairs,
        mean,
        sd,
        best: posterior.best_point(),
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

fn population(participants: &[Explored]) -> Option<Population> {
    if participants.len() < 2 {
        return None;
    }
    let points = participants.iter().map(|own| own.mean.len()).min()?;
    let at =
        |point: usize| -> Vec<f64> { participants.iter().map(|own| own.mean[point]).collect() };
    let means: Option<Vec<f64>> = (0..points).map(|point| mean(&at(point))).collect();
    let sds: Option<Vec<f64>> = (0..points).map(|point| sd(&at(point))).collect();
    let means = means?;
    let most = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let best = means.iter().position(|mean| *mean == most)?;
    Some(Population {
        mean: means,
        sd: sds?,
        best,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_stats::preference_gp::{Choice, Kernel};

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
