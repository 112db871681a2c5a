//! Psychometric functions of participants and conditions: `psy/…`, `psy_group/…`.

use super::over_participants::NOT_POSITIVE;
use crate::analyze::draws::Draws;
use crate::analyze::identifiers::group_id;
use crate::analyze::values::Values;
use std::collections::BTreeMap;
use study_stats::distribution::normal_quantile;
use study_stats::psychometric::{
    Core, Curve, Experiment, Fit, Interval, Level, NoThreshold, Spacing, Support, deviance_p,
    free_lapse, group, map, maximum_likelihood, pooled, posterior,
};

/// Shares of ψ whose level is always given, beside the middle of the function.
const SHARES: [f64; 4] = [0.707, 0.75, 0.794, 0.8];

/// The trials of one participant in one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct FitCell {
    /// Participant. Untrusted.
    pub participant: String,
    /// Condition. Untrusted.
    pub condition: String,
    /// Trials by level; levels may repeat.
    pub levels: Vec<Level>,
}

/// How functions are fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct FitSettings {
    /// Shape.
    pub core: Core,
    /// The scale of the levels. Thresholds are levels all the same; widths are on the scale.
    pub spacing: Spacing,
    /// What an answer is.
    pub experiment: Experiment,
    /// γ of maximum likelihood.
    pub gamma: f64,
    /// λ of maximum likelihood.
    pub lambda: f64,
    /// The largest λ where it is free; `None`: it is fixed only.
    pub lapse_most: Option<f64>,
    /// The standard of a comparison, for PSE, JND and Weber fraction.
    pub standard: Option<f64>,
    /// The range that the priors refer to, on the scale; `None`: that of the levels.
    pub support: Option<Support>,
    /// Simulated data sets for the p of the deviance; 0 for none, as in adaptive tracks.
    pub repeats: u32,
    /// Seed of those.
    pub seed: u64,
}

/// All statistics of psychometric functions. Cells are sorted by participant and
/// condition; with several participants of a condition, their counts are also pooled
/// (`psy/pooled/…`) and their thresholds summed up (`psy_group/…`).
pub fn psychometric(cells: &[FitCell], settings: &FitSettings) -> Values {
    let mut values = Values::default();
    let mut conditions: BTreeMap<&str, Vec<&FitCell>> = BTreeMap::new();
    for cell in cells {
        conditions.entry(&cell.condition).or_default().push(cell);
    }
    for (condition, cells) in conditions {
        let mut likely = Vec::new();
        let mut bayesian = Vec::new();
        for cell in &cells {
            let names = [cell.participant.as_str(), condition];
            let found = one(&names, &cell.levels, settings, &mut values);
            likely.push((cell.participant.as_str(), found.0));
            bayesian.push((cell.participant.as_str(), found.1));
        }
        if cells.len() < 2 {
            continue;
        }
        let all: Vec<Level> = cells.iter().flat_map(|c| c.levels.clone()).collect();
        let prefix = group_id("psy", &["pooled", condition]);
        let levels = counts(&prefix, &all, settings.spacing, &mut values);
        let fit = maximum_likelihood(settings.core, &levels, settings.gamma, settings.lambda);
        likelihood(&prefix, &fit, settings, &mut values);
        summary(condition, "threshold", &likely, &mut values);
        summary(condition, "posterior_threshold", &bayesian, &mut values);
    }
    values
}

/// The trials that are fitted, each level once and at its place on the scale.
fn counts(prefix: &str, rows: &[Level], spacing: Spacing, values: &mut Values) -> Vec<Level> {
    let trials = |levels: &[Level]| levels.iter().map(|l| l.trials).sum::<f64>();
    let levels = pooled(&spacing.places(rows));
    let mut group = values.group(prefix, "");
    group.put("n_levels", levels.len() as f64);
    group.put("n_trials", trials(&levels));
    if spacing == Spacing::Log {
        group.put("log_scale", 1.0);
    }
    // Levels of 0 and below have no logarithm.
    let left_out = trials(rows) - trials(&levels);
    if left_out > 0.0 {
        group.put("n_left_out", left_out);
    }
    levels
}

/// The functions of one cell; its thresholds by maximum likelihood and as posterior
/// mean.
fn one(
    names: &[&str],
    rows: &[Level],
    settings: &FitSettings,
    values: &mut Values,
) -> (Option<f64>, Option<f64>) {
    let prefix = &group_id("psy", names);
    let levels = &counts(prefix, rows, settings.spacing, values);
    let level = |place: f64| settings.spacing.level(place);
    let fit = maximum_likelihood(settings.core, levels, settings.gamma, settings.lambda);
    likelihood(prefix, &fit, settings, values);
    if settings.repeats > 0 {
        let mut draws = Draws::new(settings.seed, &format!("deviance/{prefix}"));
        let p = fit.map(|fit| deviance_p(&fit, levels, settings.repeats, &mut draws));
        let mut group = values.group(format!("{prefix}/ml"), reason(&fit));
        group.maybe("deviance_p_bootstrap", p.ok());
    }
    if let Some(standard) = settings.standard {
        comparison(prefix, &fit, (settings.spacing, standard), values);
    }
    if let Some(most) = settings.lapse_most {
        let free = free_lapse(
            settings.core,
            levels,
            settings.experiment,
            settings.gamma,
            most,
        );
        let mut group = values.group(format!("{prefix}/ml_lapse"), reason(&free));
        let curve = free.as_ref().ok().map(|f| f.curve);
        group.maybe("threshold", curve.map(|c| level(c.threshold)));
        group.maybe("width", curve.map(|c| c.width));
        group.maybe("lambda", curve.map(|c| c.lambda));
        group.maybe("gamma", curve.map(|c| c.gamma));
        group.maybe("deviance", free.ok().map(|f| f.deviance));
    }
    (
        fit.ok().map(|f| level(f.curve.threshold)),
        bayesian(prefix, levels, settings, values),
    )
}

fn reason<T>(result: &Result<T, NoThreshold>) -> String {
    result
        .as_ref()
        .err()
        .map_or_else(String::new, ToString::to_string)
}

fn likelihood(
    prefix: &str,
    fit: &Result<Fit, NoThreshold>,
    settings: &FitSettings,
    values: &mut Values,
) {
    let found = fit.as_ref().ok();
    let spacing = settings.spacing;
    let mut group = values.group(format!("{prefix}/ml"), reason(fit));
    group.maybe("threshold", found.map(|f| spacing.level(f.curve.threshold)));
    group.maybe("width", found.map(|f| f.curve.width));
    let flat = "the information about threshold and width is singular";
    let se = |se: Option<f64>| (found.is_none() || se.is_some(), se);
    for (name, (known, se)) in [
        ("se_threshold", se(found.and_then(|f| of_level(f, spacing)))),
        ("se_width", se(found.and_then(|f| f.width_se))),
    ] {
        match known {
            true => group.maybe(name, se),
            false => group.put_or(name, None, flat),
        }
    }
    group.maybe("deviance", found.map(|f| f.deviance));
    group.maybe("df", found.map(|f| f.df as f64));
    let Some(fit) = found else {
        return;
    };
    // In the middle of the function, and at the usual shares.
    let middle = 0.5 * (1.0 + settings.gamma);
    let middle = (middle * 1e4).round() / 1e4;
    for share in SHARES.into_iter().chain([middle]) {
        let why = "the function does not have this share";
        let level = fit.curve.level_at(share).map(|at| spacing.level(at));
        group.put_or(&format!("level_at/{share}"), level, why);
    }
}

/// The standard error of the threshold as a level: over logarithms, that of the logarithm
/// times the level.
fn of_level(fit: &Fit, spacing: Spacing) -> Option<f64> {
    let factor = match spacing {
        Spacing::Lin => 1.0,
        Spacing::Log => spacing.level(fit.curve.threshold),
    };
    Some(fit.threshold_se? * factor)
}

/// Half the distance of the levels where S is .25 and .75, with its standard error.
fn jnd(fit: &Fit, spacing: Spacing) -> (f64, Option<f64>) {
    let curve = fit.curve;
    if spacing == Spacing::Lin {
        return (curve.jnd(), fit.jnd_se());
    }
    let quarter = |share| {
        Curve {
            gamma: 0.0,
            lambda: 0.0,
            ..curve
        }
        .level_at(share)
        .unwrap_or(curve.threshold)
    };
    let [low, high] = [quarter(0.25), quarter(0.75)];
    let [at_low, at_high] = [low, high].map(|at| spacing.level(at));
    // Its derivatives in threshold and width, both on the scale.
    let by_width = |at: f64, level: f64| 0.5 * level * (at - curve.threshold) / curve.width;
    let (t, w) = (
        0.5 * (at_high - at_low),
        by_width(high, at_high) - by_width(low, at_low),
    );
    let se = || {
        let (of_t, of_w, both) = (fit.threshold_se?, fit.width_se?, fit.covariance?);
        let variance = (t * of_t).powi(2) + (w * of_w).powi(2) + 2.0 * t * w * both;
        Some(variance.sqrt())
    };
    (t, se())
}

/// PSE, JND and Weber fraction of a comparison with `standard`.
fn comparison(
    prefix: &str,
    fit: &Result<Fit, NoThreshold>,
    (spacing, standard): (Spacing, f64),
    values: &mut Values,
) {
    let found = fit.as_ref().ok();
    let mut group = values.group(prefix, reason(fit));
    let place = found.map(|f| f.curve.threshold);
    let pse = place.map(|at| spacing.level(at));
    let se = found.and_then(|f| f.threshold_se);
    let (jnd, se_jnd) = found.map(|f| jnd(f, spacing)).unzip();
    group.maybe("pse", pse);
    group.maybe("se_pse", found.and_then(|f| of_level(f, spacing)));
    let half = se.zip(normal_quantile(0.975)).map(|(se, z)| se * z);
    let ends = place.zip(half);
    group.interval(
        "pse_ci95",
        ends.map(|(p, h)| (spacing.level(p - h), spacing.level(p + h))),
    );
    group.maybe("constant_error", pse.map(|p| p - standard));
    group.maybe("jnd", jnd);
    group.maybe("se_jnd", se_jnd.flatten());
    let fraction = jnd.filter(|_| standard != 0.0).map(|j| j / standard);
    group.put_or(
        "weber_fraction",
        fraction,
        "the standard is 0, or there is no JND",
    );
}

/// Mode and posterior; the posterior mean of the threshold.
fn bayesian(
    prefix: &str,
    levels: &[Level],
    settings: &FitSettings,
    values: &mut Values,
) -> Option<f64> {
    let (core, experiment) = (settings.core, settings.experiment);
    let mode = map(core, levels, experiment, settings.support);
    let found = mode.as_ref().ok();
    let mut group = values.group(format!("{prefix}/map"), reason(&mode));
    let level = |place: f64| settings.spacing.level(place);
    group.maybe("threshold", found.map(|m| level(m.curve.threshold)));
    group.maybe("width", found.map(|m| m.curve.width));
    group.maybe("lambda", found.map(|m| m.curve.lambda));
    group.maybe("gamma", found.map(|m| m.curve.gamma));
    group.maybe("eta", found.map(|m| m.eta));
    group.maybe("log_posterior_kernel", found.map(|m| m.log_kernel));
    let posterior = posterior(core, levels, experiment, settings.support);
    let found = posterior.as_ref().ok();
    let threshold = found.map(|p| p.threshold_level(settings.spacing));
    for (name, interval) in [("threshold", threshold), ("width", found.map(|p| p.width))] {
        let mut group = values.group(format!("{prefix}/posterior/{name}"), reason(&posterior));
        group.maybe("mean", interval.map(|i: Interval| i.mean));
        group.interval("ci95", interval.map(|i| i.ci95));
    }
    let mut group = values.group(format!("{prefix}/posterior"), reason(&posterior));
    group.maybe("lambda/mean", found.map(|p| p.lambda));
    group.maybe("eta/mean", found.map(|p| p.eta));
    if experiment == Experiment::YesNo {
        group.maybe("gamma/mean", found.and_then(|p| p.gamma));
    }
    threshold.map(|t| t.mean)
}

/// Thresholds of several participants, on natural logarithms.
fn summary(condition: &str, name: &str, thresholds: &[(&str, Option<f64>)], values: &mut Values) {
    let known: Vec<f64> = thresholds.iter().filter_map(|t| t.1).collect();
    let found = group(&known);
    let why = match found {
        None if known.is_empty() => "nobody has a threshold",
        None => NOT_POSITIVE,
        Some(_) => "there is only one threshold",
    };
    let prefix = format!("{}/{name}", group_id("psy_group", &[condition]));
    let mut values = values.group(prefix, why);
    values.maybe("geometric_mean", found.map(|g| g.geometric_mean));
    values.interval("ci95", found.and_then(|g| g.ci95));
    values.maybe("geometric_sd", found.and_then(|g| g.geometric_sd));
    values.maybe("arithmetic_mean", found.map(|g| g.arithmetic_mean));
    values.put("n", known.len() as f64);
    values.put("n_undefined", (thresholds.len() - known.len()) as f64);
}
