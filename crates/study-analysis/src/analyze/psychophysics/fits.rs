//! Psychometric functions of participants and conditions: `psy/…`, `psy_group/…`.

use super::marginal::Marginal;
use super::over_participants::NOT_POSITIVE;
use super::standards::AboveStandard;
use crate::analyze::draws::Draws;
use crate::analyze::keys::{At, CellName, ConditionName};
use crate::analyze::record::{Interval, Key as _, Number as _, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::distribution::normal_quantile;
use study_stats::psychometric::{
    Core, Curve, Experiment, Fit, Level, NoThreshold, Priors, Spacing, deviance_p, free_lapse,
    group, map, maximum_likelihood, pooled, posterior,
};

/// Shares of ψ whose level is always given, beside the middle of the function.
const SHARES: [f64; 4] = [0.707, 0.75, 0.794, 0.8];

statistics! {
    /// The trials that are fitted.
    pub struct Fitted {
        /// number of levels
        n_levels: Stat,
        /// number of trials
        n_trials: Stat,
        /// 1 where the function is one of the logarithm of the level
        log_scale: Option<Stat>,
        /// trials at levels of 0 and below, which have no logarithm
        n_left_out: Option<Stat>,
    }

    /// Maximum likelihood with γ and λ fixed.
    pub struct MaximumLikelihood {
        /// the level at which the function without guesses and lapses is ½
        threshold: Stat,
        /// the distance from .05 to .95 of it, on the scale
        width: Stat,
        /// standard error of the threshold, from the observed information
        se_threshold: Stat,
        /// standard error of the width
        se_width: Stat,
        /// its deviance
        deviance: Stat,
        /// levels − 2
        df: Stat,
        /// the level at which the function has a share
        level_at: BTreeMap<At, Stat>,
        /// (1 + #{D* ≥ D})/(B + 1) over B simulated data sets, each fitted again
        deviance_p_bootstrap: Option<Stat>,
    }

    /// Maximum likelihood with λ free up to .06 (Wichmann & Hill 2001).
    pub struct FreeLapse {
        /// the threshold
        threshold: Stat,
        /// the width
        width: Stat,
        /// the share of lapses
        lambda: Stat,
        /// the share of guesses
        gamma: Stat,
        /// its deviance
        deviance: Stat,
    }

    /// A comparison with a standard, by maximum likelihood.
    pub struct WithStandard {
        /// the point of subjective equality: the threshold
        pse: Stat,
        /// its standard error
        se_pse: Stat,
        /// Wald's
        pse_ci95: Interval,
        /// pse − standard
        constant_error: Stat,
        /// half the distance of the levels at S = .25 and S = .75
        jnd: Stat,
        /// its standard error, over logarithms by the delta method
        se_jnd: Stat,
        /// jnd/standard
        weber_fraction: Stat,
    }

    /// The mode of the posterior.
    pub struct Mode {
        /// the threshold
        threshold: Stat,
        /// the width
        width: Stat,
        /// the share of lapses
        lambda: Stat,
        /// the share of guesses
        gamma: Stat,
        /// how much answers vary more than binomially
        eta: Stat,
        /// logarithm of the density, without binomial coefficients and constants of the priors
        log_posterior_kernel: Stat,
    }

    /// The posterior.
    pub struct Posterior {
        /// of the threshold, as a level
        threshold: Marginal,
        /// of the width
        width: Marginal,
        /// of the share of lapses
        lambda: Marginal,
        /// of the variation beyond the binomial one
        eta: Marginal,
        /// of the share of guesses, in yes–no
        gamma: Option<Marginal>,
    }

    /// The psychometric function of a participant and condition.
    pub struct Function {
        /// what is fitted
        trials: Fitted as "",
        /// by maximum likelihood
        ml: MaximumLikelihood,
        /// of a comparison
        with_standard: Option<WithStandard> as "",
        /// by maximum likelihood with free lapses
        ml_lapse: Option<FreeLapse>,
        /// the mode of the posterior
        map: Mode,
        /// the posterior: the headline
        posterior: Posterior,
        /// of a track that counts its levels from a standard
        above_standard: Option<AboveStandard>,
    }

    /// The function of summed counts, which is flatter than anybody's.
    pub struct PooledFunction {
        /// what is fitted
        trials: Fitted as "",
        /// by maximum likelihood
        ml: MaximumLikelihood,
    }

    /// Thresholds of several participants, on natural logarithms. Leaving out those without a threshold biases the mean.
    pub struct ThresholdSummary {
        /// geometric mean
        geometric_mean: Stat,
        /// t interval on logarithms
        ci95: Interval,
        /// geometric standard deviation
        geometric_sd: Stat,
        /// arithmetic mean
        arithmetic_mean: Stat,
        /// participants with a threshold
        n: Stat,
        /// participants without one
        n_undefined: Stat,
    }

    /// Thresholds of a condition.
    pub struct GroupThresholds {
        /// by maximum likelihood
        threshold: ThresholdSummary,
        /// posterior medians
        posterior_threshold: ThresholdSummary,
    }

    /// Psychometric functions.
    pub struct Functions {
        /// by participant and condition
        psy: BTreeMap<CellName, Function>,
        /// with several participants of a condition, of their summed counts
        pooled: BTreeMap<ConditionName, PooledFunction> as "psy/pooled",
        /// what several participants have in common
        psy_group: BTreeMap<ConditionName, GroupThresholds>,
    }
}

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
    /// What is assumed before the answers, on the scale.
    pub priors: Priors,
    /// Simulated data sets for the p of the deviance; 0 for none, as in adaptive tracks.
    pub repeats: u32,
    /// Seed of those.
    pub seed: u64,
}

/// All statistics of psychometric functions. With several participants of a condition, their
/// counts are also pooled, and their thresholds summed up.
pub fn psychometric(cells: &[FitCell], settings: &FitSettings) -> Functions {
    let mut functions = Functions::undefined("");
    let mut conditions: BTreeMap<&str, Vec<&FitCell>> = BTreeMap::new();
    for cell in cells {
        conditions.entry(&cell.condition).or_default().push(cell);
    }
    for (condition, cells) in conditions {
        let found: Vec<(CellName, Function)> = (cells.iter())
            .map(|cell| {
                let name = CellName::of(&cell.participant, condition);
                let function = Function::of(&name, &cell.levels, settings);
                (name, function)
            })
            .collect();
        if cells.len() > 1 {
            let all: Vec<Level> = cells.iter().flat_map(|c| c.levels.clone()).collect();
            let (trials, levels) = counts(&all, settings.spacing);
            let fit = maximum_likelihood(settings.core, &levels, settings.gamma, settings.lambda);
            let ml = likelihood(&fit, settings);
            let pooled = PooledFunction { trials, ml };
            functions.pooled.insert(condition.into(), pooled);
            let summary = |threshold: fn(&Function) -> &Stat| {
                summary(
                    &found
                        .iter()
                        .map(|f| threshold(&f.1).number())
                        .collect::<Vec<_>>(),
                )
            };
            let group = GroupThresholds {
                threshold: summary(|f| &f.ml.threshold),
                posterior_threshold: summary(|f| {
                    f.posterior
                        .threshold
                        .median
                        .as_ref()
                        .unwrap_or(&f.posterior.threshold.mean)
                }),
            };
            functions.psy_group.insert(condition.into(), group);
        }
        functions.psy.extend(found);
    }
    functions
}

/// The trials that are fitted, each level once and at its place on the scale.
fn counts(rows: &[Level], spacing: Spacing) -> (Fitted, Vec<Level>) {
    let trials = |levels: &[Level]| levels.iter().map(|l| l.trials).sum::<f64>();
    let levels = pooled(&spacing.places(rows));
    // Levels of 0 and below have no logarithm.
    let left_out = trials(rows) - trials(&levels);
    let fitted = Fitted {
        n_levels: Stat::count(levels.len()),
        n_trials: Stat::of(trials(&levels)),
        log_scale: (spacing == Spacing::Log).then(|| Stat::flag(true)),
        n_left_out: (left_out > 0.0).then(|| Stat::of(left_out)),
    };
    (fitted, levels)
}

impl Function {
    fn of(name: &CellName, rows: &[Level], settings: &FitSettings) -> Self {
        let (trials, levels) = counts(rows, settings.spacing);
        let fit = maximum_likelihood(settings.core, &levels, settings.gamma, settings.lambda);
        let mut ml = likelihood(&fit, settings);
        if settings.repeats > 0 {
            let path = format!("deviance/psy/{}", name.part());
            let mut draws = Draws::new(settings.seed, &path);
            let p = fit.map(|fit| deviance_p(&fit, &levels, settings.repeats, &mut draws));
            ml.deviance_p_bootstrap = Some(Stat::or(p.ok(), reason(&fit)));
        }
        let with_standard = |standard| comparison(&fit, settings.spacing, standard);
        Self {
            trials,
            ml,
            with_standard: settings.standard.map(with_standard),
            ml_lapse: settings
                .lapse_most
                .map(|most| lapses(&levels, most, settings)),
            map: mode(&levels, settings),
            posterior: bayesian(&levels, settings),
            above_standard: None,
        }
    }
}

fn lapses(levels: &[Level], most: f64, settings: &FitSettings) -> FreeLapse {
    let (core, experiment) = (settings.core, settings.experiment);
    let free = free_lapse(core, levels, experiment, settings.gamma, most);
    let curve = free.as_ref().ok().map(|f| f.curve);
    let stat = |x: Option<f64>| Stat::or(x, reason(&free));
    FreeLapse {
        threshold: stat(curve.map(|c| settings.spacing.level(c.threshold))),
        width: stat(curve.map(|c| c.width)),
        lambda: stat(curve.map(|c| c.lambda)),
        gamma: stat(curve.map(|c| c.gamma)),
        deviance: stat(free.as_ref().ok().map(|f| f.deviance)),
    }
}

fn reason<T>(result: &Result<T, NoThreshold>) -> String {
    let why = result.as_ref().err();
    why.map_or_else(String::new, ToString::to_string)
}

fn likelihood(fit: &Result<Fit, NoThreshold>, settings: &FitSettings) -> MaximumLikelihood {
    let found = fit.as_ref().ok();
    let spacing = settings.spacing;
    let stat = |x: Option<f64>| Stat::or(x, reason(fit));
    let flat = "the information about threshold and width is singular";
    let se = |se: &dyn Fn(&Fit) -> Option<f64>| match found {
        Some(found) => Stat::or(se(found), flat),
        None => stat(None),
    };
    // In the middle of the function, and at the usual shares.
    let middle = 0.5 * (1.0 + settings.gamma);
    let middle = (middle * 1e4).round() / 1e4;
    let level_at = |fit: &Fit, share: f64| {
        let level = fit.curve.level_at(share).map(|at| spacing.level(at));
        Stat::or(level, "the function does not have this share")
    };
    let shares = SHARES.into_iter().chain([middle]);
    MaximumLikelihood {
        threshold: stat(found.map(|f| spacing.level(f.curve.threshold))),
        width: stat(found.map(|f| f.curve.width)),
        se_threshold: se(&|f| of_level(f, spacing)),
        se_width: se(&|f| f.width_se),
        deviance: stat(found.map(|f| f.deviance)),
        df: stat(found.map(|f| f.df as f64)),
        level_at: (shares.filter_map(|share| Some((At(share), level_at(found?, share))))).collect(),
        deviance_p_bootstrap: None,
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
fn comparison(fit: &Result<Fit, NoThreshold>, spacing: Spacing, standard: f64) -> WithStandard {
    let found = fit.as_ref().ok();
    let stat = |x: Option<f64>| Stat::or(x, reason(fit));
    let place = found.map(|f| f.curve.threshold);
    let pse = place.map(|at| spacing.level(at));
    let se = found.and_then(|f| f.threshold_se);
    let (jnd, se_jnd) = found.map(|f| jnd(f, spacing)).unzip();
    let half = se.zip(normal_quantile(0.975)).map(|(se, z)| se * z);
    let ends = place.zip(half);
    let ends = ends.map(|(p, h)| (spacing.level(p - h), spacing.level(p + h)));
    let fraction = jnd.filter(|_| standard != 0.0).map(|j| j / standard);
    WithStandard {
        pse: stat(pse),
        se_pse: stat(found.and_then(|f| of_level(f, spacing))),
        pse_ci95: Interval::or(ends, reason(fit)),
        constant_error: stat(pse.map(|p| p - standard)),
        jnd: stat(jnd),
        se_jnd: stat(se_jnd.flatten()),
        weber_fraction: Stat::or(fraction, "the standard is 0, or there is no JND"),
    }
}

fn mode(levels: &[Level], settings: &FitSettings) -> Mode {
    let mode = map(settings.core, levels, settings.experiment, &settings.priors);
    let found = mode.as_ref().ok();
    let stat = |x: Option<f64>| Stat::or(x, reason(&mode));
    Mode {
        threshold: stat(found.map(|m| settings.spacing.level(m.curve.threshold))),
        width: stat(found.map(|m| m.curve.width)),
        lambda: stat(found.map(|m| m.curve.lambda)),
        gamma: stat(found.map(|m| m.curve.gamma)),
        eta: stat(found.map(|m| m.eta)),
        log_posterior_kernel: stat(found.map(|m| m.log_kernel)),
    }
}

fn bayesian(levels: &[Level], settings: &FitSettings) -> Posterior {
    let posterior = posterior(settings.core, levels, settings.experiment, &settings.priors);
    let found = posterior.as_ref().ok();
    let why = reason(&posterior).into();
    let mean = |mean: Option<f64>| Marginal::of_mean(mean, &why);
    let with_interval = |of: Option<study_stats::psychometric::Interval>| Marginal::of(of, &why);
    let is_yes_no = settings.experiment == Experiment::YesNo;
    Posterior {
        threshold: with_interval(found.map(|p| p.threshold_level(settings.spacing))),
        width: with_interval(found.map(|p| p.width)),
        lambda: mean(found.map(|p| p.lambda)),
        eta: mean(found.map(|p| p.eta)),
        gamma: is_yes_no.then(|| mean(found.and_then(|p| p.gamma))),
    }
}

/// Thresholds of several participants, on natural logarithms.
fn summary(thresholds: &[Option<f64>]) -> ThresholdSummary {
    let known: Vec<f64> = thresholds.iter().copied().flatten().collect();
    let found = group(&known);
    let why = match found {
        None if known.is_empty() => "nobody has a threshold",
        None => NOT_POSITIVE,
        Some(_) => "there is only one threshold",
    };
    ThresholdSummary {
        geometric_mean: Stat::or(found.map(|g| g.geometric_mean), why),
        ci95: Interval::or(found.and_then(|g| g.ci95), why),
        geometric_sd: Stat::or(found.and_then(|g| g.geometric_sd), why),
        arithmetic_mean: Stat::or(found.map(|g| g.arithmetic_mean), why),
        n: Stat::count(known.len()),
        n_undefined: Stat::count(thresholds.len() - known.len()),
    }
}
