//! Adaptive tracks: `track/…`.

use crate::analyze::identifiers::group_id;
use crate::analyze::values::Values;
use crate::procedure::{Scale, Staircase, Summary};

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

/// A QUEST+ track: what was proposed on each dimension, with its expected entropy, and
/// the posterior at the end.
pub fn quest_plus(
    name: TrackName<'_>,
    proposed: &[(&str, Vec<f64>)],
    expected_entropy: &[f64],
    posterior_entropy: f64,
    summary: &Summary,
) -> Values {
    let mut values = Values::default();
    let mut group = values.group(name.prefix(), "");
    for (dimension, levels) in proposed {
        group.list(&group_id("proposed", &[dimension]), levels.clone());
    }
    group.list("expected_entropy", expected_entropy.to_vec());
    group.put("posterior_entropy", posterior_entropy);
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
