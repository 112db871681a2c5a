//! Adaptive tracks: `track/…`.

use crate::analyze::identifiers::group_id;
use crate::analyze::values::Values;
use crate::analyze::warning::Warning;
use study_plan::procedure::{Rule, Scale, Staircase, Summary};
use study_plan::protocol::{Protocol, TrackRules};
use study_session::outcome::fold::History;

/// Whose track it is.
#[derive(Debug, Clone, Copy)]
pub struct TrackName<'a> {
    /// Participant. Untrusted.
    pub participant: &'a str,
    /// Track. Untrusted.
    pub track: &'a str,
}

impl TrackName<'_> {
    fn prefix(&self) -> String {
        group_id("track", &[self.participant, self.track])
    }
}

/// A track as it went.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackData {
    /// Participant. Untrusted.
    pub participant: String,
    /// Track, as in the identifiers of its statistics.
    pub track: String,
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
    name: TrackName<'_>,
    (values, warnings): (&mut Values, &mut Vec<Warning>),
) -> Option<TrackData> {
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
    values.extend(match &rules.rule {
        Rule::Staircase(rule) => {
            let levels: Vec<f64> = ruled.iter().map(|&i| trials[i].level).collect();
            staircase(name, rule, &levels, &summary)
        }
        Rule::QuestPlus(_) => {
            let proposed = recorded.iter().filter_map(|one| one.proposed).collect();
            quest_plus(name, &[("level", proposed)], None, &summary)
        }
        Rule::Constant(_) => {
            let mut values = Values::default();
            let mut group = values.group(name.prefix(), "");
            group.put("n_trials", f64::from(summary.trials));
            group.put("finished", f64::from(u8::from(summary.finished)));
            values
        }
    });
    let easy = trials.iter().filter(|t| t.easy);
    let (easy, wrong) = (easy.clone().count(), easy.filter(|t| !t.positive).count());
    if easy > 0 {
        let mut group = values.group(name.prefix(), "");
        group.put("n_easy", easy as f64);
        group.put("n_easy_wrong", wrong as f64);
    }
    if wrong as f64 > MOST_LAPSES * easy as f64 {
        warnings.push(Warning {
            code: "lapses",
            text: format!(
                "{}, {}: {wrong} of {easy} easy trials are wrong, more than {:.0} %",
                name.participant,
                name.track,
                100.0 * MOST_LAPSES
            ),
        });
    }
    if summary.held > 3 {
        warnings.push(Warning {
            code: "at-a-limit",
            text: format!(
                "{}, {}: a limit held the level back in {} trials; the mean of the reversals is biased",
                name.participant, name.track, summary.held
            ),
        });
    }
    Some(TrackData {
        participant: name.participant.to_owned(),
        track: name.track.to_owned(),
        reversals: (summary.reversals.iter())
            .filter_map(|r| ruled.get((r.trial as usize).checked_sub(1)?).copied())
            .collect(),
        estimate: summary.estimate,
        trials,
    })
}

/// A staircase: its levels as presented, and what they add up to.
pub fn staircase(
    name: TrackName<'_>,
    rule: &Staircase,
    levels: &[f64],
    summary: &Summary,
) -> Values {
    let mut values = Values::default();
    let mut group = values.group(name.prefix(), "there are too few reversals");
    group.list("level", levels.to_vec());
    let reversals = &summary.reversals;
    group.list(
        "reversal_trial",
        reversals.iter().map(|r| f64::from(r.trial)).collect(),
    );
    group.list(
        "reversal_level",
        reversals.iter().map(|r| r.level).collect(),
    );
    group.put("n_reversals", reversals.len() as f64);
    group.put("n_trials", f64::from(summary.trials));
    group.put("n_held", f64::from(summary.held));
    group.put("finished", f64::from(u8::from(summary.finished)));
    group.maybe("estimate", summary.estimate);
    let spread = match rule.scale {
        Scale::Lin => "estimate_spread",
        Scale::Log | Scale::Db => "estimate_spread_log10",
    };
    group.maybe(spread, summary.spread);
    if let Some(target) = rule.target() {
        group.put("target", target);
    }
    values
}

/// A QUEST+ track: what was proposed on each dimension, with its expected entropy and the
/// entropy at the end, where they are known, and the posterior at the end.
pub fn quest_plus(
    name: TrackName<'_>,
    proposed: &[(&str, Vec<f64>)],
    entropies: Option<(&[f64], f64)>,
    summary: &Summary,
) -> Values {
    let mut values = Values::default();
    let mut group = values.group(name.prefix(), "");
    for (dimension, levels) in proposed {
        group.list(&group_id("proposed", &[dimension]), levels.clone());
    }
    if let Some((expected, posterior)) = entropies {
        group.list("expected_entropy", expected.to_vec());
        group.put("posterior_entropy", posterior);
    }
    group.put("n_trials", f64::from(summary.trials));
    group.put("finished", f64::from(u8::from(summary.finished)));
    for marginal in &summary.posterior {
        let prefix = format!(
            "{}/{}",
            name.prefix(),
            group_id("posterior", &[&marginal.name])
        );
        let mut group = values.group(prefix, "");
        group.put("mean", marginal.mean);
        group.put("sd", marginal.sd);
        group.put("mode", marginal.mode);
        group.put("marginal_mode", marginal.marginal_mode);
        group.put("at_edge", marginal.at_edge);
    }
    values
}

/// The track of each trial of interleaved tracks, from 1.
pub fn track_order(participant: &str, order: &[usize]) -> Values {
    let mut values = Values::default();
    let order = order.iter().map(|t| (t + 1) as f64).collect();
    values
        .group(group_id("track", &[participant]), "")
        .list("order", order);
    values
}
