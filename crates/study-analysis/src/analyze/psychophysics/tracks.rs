//! Adaptive tracks: `track/…`.

use crate::analyze::keys::{CellName, ParameterName};
use crate::analyze::record::{List, Number as _, Stat, statistics};
use crate::analyze::warning::Warning;
use std::collections::BTreeMap;
use study_plan::procedure::{Reversal, Rule, Scale, Staircase, Summary};
use study_plan::protocol::{Protocol, TrackRules};
use study_session::outcome::fold::History;
use study_stats::describe::{mean, sd};

statistics! {
    /// A track of a participant.
    pub struct TrackResult {
        /// trials that moved it
        n_trials: Stat,
        /// whether it came to its end
        finished: Stat,
        /// of a staircase
        staircase: Option<StaircaseResult> as "",
        /// of QUEST+
        quest_plus: Option<QuestPlusResult> as "",
        /// of a track with easy trials
        easy: Option<EasyTrials> as "",
    }

    /// A staircase.
    pub struct StaircaseResult {
        /// its levels as presented
        level: List,
        /// the trials of its reversals, from 1
        reversal_trial: List,
        /// the levels that were presented in them
        reversal_level: List,
        /// number of reversals
        n_reversals: Stat,
        /// trials in which a limit held the level back
        n_held: Stat,
        /// the mean of the last reversals, a geometric mean where steps are ratios or decibels
        estimate: Stat,
        /// standard deviation of these reversals
        estimate_spread: Option<Stat>,
        /// the same of their decimal logarithms, where steps are ratios or decibels
        estimate_spread_log10: Option<Stat>,
        /// the share of positive answers at which the rule settles
        target: Option<Stat>,
    }

    /// QUEST+.
    pub struct QuestPlusResult {
        /// what the rule proposed on a dimension, by trial
        proposed: BTreeMap<ParameterName, List>,
        /// the expected entropy of each proposal
        expected_entropy: Option<List>,
        /// the entropy at the end
        posterior_entropy: Option<Stat>,
        /// the posterior at the end
        posterior: BTreeMap<ParameterName, MarginalResult>,
    }

    /// The posterior of a parameter.
    pub struct MarginalResult {
        /// its mean
        mean: Stat,
        /// its standard deviation
        sd: Stat,
        /// its value at the mode of the joint posterior
        mode: Stat,
        /// the mode of its own posterior
        marginal_mode: Stat,
        /// the probability of the two ends of its grid
        at_edge: Stat,
    }

    /// Easy trials, which move no staircase.
    pub struct EasyTrials {
        /// number of easy trials
        n_easy: Stat,
        /// those with a wrong answer
        n_easy_wrong: Stat,
    }
}

/// A track as it went.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackData {
    /// Participant. Untrusted.
    pub participant: String,
    /// Track, as in the identifiers of its statistics.
    pub track: String,
    /// Condition that it measures, as in the identifiers of its statistics.
    pub condition: String,
    /// Its trials in order, easy ones included.
    pub trials: Vec<TrackTrial>,
    /// Which of the trials turned the direction, from 0.
    pub reversals: Vec<usize>,
    /// What the rule estimates.
    pub estimate: Option<f64>,
}

/// One trial of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackTrial {
    /// The level that was presented.
    pub level: f64,
    /// Whether the answer was positive when it was given.
    pub positive: bool,
    /// Whether it was an easy trial, which moves no staircase.
    pub easy: bool,
}

/// The largest share of wrong answers to easy trials that is not remarkable.
const MOST_LAPSES: f64 = 0.2;

/// A track of a session, replayed with the answers that it was told; `None` if it had
/// none.
pub(super) fn of_session(
    protocol: &Protocol,
    rules: &TrackRules,
    history: &History,
    (name, condition): (&CellName, &str),
    warnings: &mut Vec<Warning>,
) -> Option<(TrackResult, TrackData)> {
    let recorded = history.recorded(rules);
    let start = history.start()?;
    let mut track = protocol.of(&start.assigned).start(rules, start.seat).ok()?;
    for one in &recorded {
        track.answer(&one.answer);
    }
    let trials: Vec<TrackTrial> = (recorded.iter())
        .map(|one| TrackTrial {
            level: one.answer.presented,
            positive: one.answer.positive,
            easy: one.answer.easy,
        })
        .collect();
    trials.first()?;
    let summary = track.summary();
    let ruled: Vec<usize> = (0..trials.len()).filter(|&i| !trials[i].easy).collect();
    let mut result = match &rules.rule {
        Rule::Staircase(rule) => {
            let levels: Vec<f64> = ruled.iter().map(|&i| trials[i].level).collect();
            staircase(rule, &levels, &summary)
        }
        Rule::QuestPlus(_) => {
            let proposed = recorded.iter().filter_map(|one| one.proposed).collect();
            quest_plus(&[("level", proposed)], None, &summary)
        }
        Rule::Constant(_) => TrackResult::of(&summary),
    };
    let easy = trials.iter().filter(|t| t.easy);
    let (easy, wrong) = (easy.clone().count(), easy.filter(|t| !t.positive).count());
    if easy > 0 {
        result.easy = Some(EasyTrials {
            n_easy: Stat::count(easy),
            n_easy_wrong: Stat::count(wrong),
        });
    }
    let (participant, track) = (name.participant.as_str(), name.condition.as_str());
    if wrong as f64 > MOST_LAPSES * easy as f64 {
        warnings.push(Warning {
            code: "lapses",
            text: format!(
                "{participant}, {track}: {wrong} of {easy} easy trials are wrong, more than {:.0} %",
                100.0 * MOST_LAPSES
            ),
        });
    }
    if summary.held > 3 {
        warnings.push(Warning {
            code: "at-a-limit",
            text: format!(
                "{participant}, {track}: a limit held the level back in {} trials; the mean of the reversals is biased",
                summary.held
            ),
        });
    }
    let data = TrackData {
        participant: participant.to_owned(),
        track: track.to_owned(),
        condition: condition.to_owned(),
        reversals: (summary.reversals.iter())
            .filter_map(|r| ruled.get((r.trial as usize).checked_sub(1)?).copied())
            .collect(),
        estimate: match &result.staircase {
            Some(staircase) => staircase.estimate.number(),
            None => summary.estimate,
        },
        trials,
    };
    Some((result, data))
}

impl TrackResult {
    /// What all rules have.
    fn of(summary: &Summary) -> Self {
        Self {
            n_trials: Stat::of(f64::from(summary.trials)),
            finished: Stat::flag(summary.finished),
            staircase: None,
            quest_plus: None,
            easy: None,
        }
    }
}

/// The levels that were presented in the trials of the reversals.
fn presented(levels: &[f64], summary: &Summary) -> Vec<f64> {
    let at = |r: &Reversal| levels.get((r.trial as usize).checked_sub(1)?).copied();
    summary.reversals.iter().filter_map(at).collect()
}

/// Mean and standard deviation of the last reversals, of the levels that were presented: under log
/// and dB the geometric mean, and the deviation of log10.
fn of_reversals(rule: &Staircase, levels: &[f64], summary: &Summary) -> (Option<f64>, Option<f64>) {
    let levels = presented(levels, summary);
    let Some(from) = levels.len().checked_sub(rule.estimate_last as usize) else {
        return (None, None);
    };
    let ratios = rule.scale != Scale::Lin;
    let scaled = |level: &f64| if ratios { libm::log10(*level) } else { *level };
    let last: Vec<f64> = levels[from..].iter().map(scaled).collect();
    let mean = mean(&last).map(|m| if ratios { libm::pow(10.0, m) } else { m });
    (mean, sd(&last))
}

/// A staircase: its levels as presented, and what they add up to.
pub fn staircase(rule: &Staircase, levels: &[f64], summary: &Summary) -> TrackResult {
    let few = "there are too few reversals";
    let reversals = summary.reversals.iter();
    let (estimate, spread) = of_reversals(rule, levels, summary);
    let spread = || Some(Stat::or(spread, few));
    let (estimate_spread, estimate_spread_log10) = match rule.scale {
        Scale::Lin => (spread(), None),
        Scale::Log | Scale::Db => (None, spread()),
    };
    let staircase = StaircaseResult {
        level: List::of(levels.to_vec()),
        reversal_trial: List::of(reversals.clone().map(|r| f64::from(r.trial)).collect()),
        reversal_level: List::of(presented(levels, summary)),
        n_reversals: Stat::count(reversals.len()),
        n_held: Stat::of(f64::from(summary.held)),
        estimate: Stat::or(estimate, few),
        estimate_spread,
        estimate_spread_log10,
        target: rule.target().map(Stat::of),
    };
    TrackResult {
        staircase: Some(staircase),
        ..TrackResult::of(summary)
    }
}

/// A QUEST+ track: what was proposed on each dimension, with its expected entropy and the
/// entropy at the end, where they are known, and the posterior at the end.
pub fn quest_plus(
    proposed: &[(&str, Vec<f64>)],
    entropies: Option<(&[f64], f64)>,
    summary: &Summary,
) -> TrackResult {
    let proposed = proposed.iter();
    let quest_plus = QuestPlusResult {
        proposed: (proposed.map(|(name, levels)| ((*name).into(), List::of(levels.clone()))))
            .collect(),
        expected_entropy: entropies.map(|(expected, _)| List::of(expected.to_vec())),
        posterior_entropy: entropies.map(|(_, posterior)| Stat::of(posterior)),
        posterior: (summary.posterior.iter())
            .map(|of| {
                let marginal = MarginalResult {
                    mean: Stat::of(of.mean),
                    sd: Stat::of(of.sd),
                    mode: Stat::of(of.mode),
                    marginal_mode: Stat::of(of.marginal_mode),
                    at_edge: Stat::of(of.at_edge),
                };
                (of.name.as_str().into(), marginal)
            })
            .collect(),
    };
    TrackResult {
        quest_plus: Some(quest_plus),
        ..TrackResult::of(summary)
    }
}

/// The track of each trial of interleaved tracks, from 1.
pub fn track_order(order: &[usize]) -> List {
    List::of(order.iter().map(|t| (t + 1) as f64).collect())
}
