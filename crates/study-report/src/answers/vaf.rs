//! VAF, the forgetting factor and other covariates as predictors of the mean rating.

use super::Answer;
use crate::{apa, sentences};
use study_analysis::analyze::findings::Direction;
use study_analysis::analyze::{Analysis, Question, Value, group_id};
use study_stats::permutation::DRAWS;

/// Covariates in a list.
const MAX_COVARIATES: usize = 8;

/// Whether VAF predicts the rating.
pub(super) fn predicts(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let f = a.finding(&Question::Vaf)?;
    let question = format!("Does VAF predict {}?", sentences::asked(a));
    let n = f.realizations;
    let mut answer = Answer::of(&question, f, |verdict| {
        let verdict = match f.direction {
            Some(Direction::Up) => format!(
                "{verdict}: over these {n} realizations, those with a higher VAF are rated higher"
            ),
            Some(_) => format!(
                "{verdict}: over these {n} realizations, those with a higher VAF are rated lower"
            ),
            None => format!("{verdict} over these {n} realizations"),
        };
        let r = f
            .estimate
            .map_or_else(String::new, |e| sentences::estimate(&e, apa::r));
        let p = sentences::permutation_p(a, "pearson");
        format!("{verdict}: r = {r}{p} (two-sided).")
    });
    if f.test.is_none() {
        return Some(answer);
    }
    let caveats = std::mem::take(&mut answer.main);
    answer.main.extend(points(a, n));
    answer.main.extend(sentences::ties(a));
    answer
        .main
        .extend(v.number("sensitivity/correlation").map(|r| {
            format!(
                "A true correlation of {} is found with a power of 80 % in this design.",
                apa::r(r)
            )
        }));
    answer.main.extend(caveats);
    answer.main.extend(crossed(a));
    answer.more.extend(ordinal(a));
    if let Some(rho) = v.number("corr_adjusted/spearman/rho") {
        let tau = v
            .number("corr_adjusted/kendall/tau_b")
            .map_or_else(String::new, |tau| {
                let p = sentences::permutation_p(a, "kendall");
                format!("; Kendall's τb = {}{p}", apa::r(tau))
            });
        answer.main.push(format!(
            "Rank correlations: Spearman's ρ = {}{}{tau}.",
            apa::r(rho),
            sentences::permutation_p(a, "spearman")
        ));
    }
    let bounds = v
        .number("corr_adjusted/leave_one_out/pearson_min")
        .zip(v.number("corr_adjusted/leave_one_out/pearson_max"));
    if let Some((low, high)) = bounds {
        answer.main.push(format!(
            "Leaving out one realization at a time, r ranges from {} to {}.",
            apa::r(low),
            apa::r(high)
        ));
    }
    answer.main.extend(sentences::sole_influence(a));
    if let Some(share) = v.number("corr_adjusted/share/r2") {
        let adjusted = v.number("corr_adjusted/share/r2_adjusted");
        let adjusted = adjusted.map_or_else(String::new, |x| {
            format!(
                " (corrected for their number: {})",
                apa::percent(x.max(0.0))
            )
        });
        answer.more.push(format!(
            "VAF explains {} of the variance between the means of the realizations{adjusted}.",
            apa::percent(share)
        ));
    }
    answer
        .more
        .extend(v.number("corr_adjusted/pearson/bf10").map(|bf| {
            format!(
                "Bayes factor of a correlation against none, with a flat prior on r: BF₁₀ = {}.",
                apa::two(bf)
            )
        }));
    Some(answer)
}

/// Whether the VAF of what was delivered predicts the rating. Without a validation
/// recording nobody asks; the section on the force has the reason.
pub(super) fn delivered(a: &Analysis) -> Option<Answer> {
    let f = a
        .finding(&Question::Delivered)
        .filter(|f| f.realizations > 0)?;
    let question = format!(
        "Does the VAF of what was delivered predict {}?",
        sentences::asked(a)
    );
    let n = f.realizations;
    let mut answer = Answer::of(&question, f, |verdict| {
        let r = f
            .estimate
            .map_or_else(String::new, |e| sentences::estimate(&e, apa::r));
        let result = f
            .test
            .as_ref()
            .map_or_else(String::new, sentences::corrected);
        let p = sentences::result(f).unwrap_or_default();
        format!("{verdict}: over these {n} realizations r = {r}, {p} ({result}).")
    });
    if let Some(r) = a.values.number("corr_adjusted/pearson/r") {
        answer.main.push(format!(
            "With the VAF of the identification the same means correlate at r = {}.",
            apa::r(r)
        ));
    }
    Some(answer)
}

/// The number of points and the p that it allows.
fn points(a: &Analysis, n: usize) -> Option<String> {
    let smallest = a
        .values
        .number("corr_adjusted/pearson/smallest_p_two_sided")?;
    let (_, exact) = a.permutation_p("pearson")?;
    let smallest = if exact {
        format!(
            "the smallest p that {n} realizations can give is {}",
            apa::of_orders(smallest, n as f64)
        )
    } else {
        format!(
            "p is estimated from {DRAWS} random orders of the realizations and cannot be below 1/{}",
            DRAWS + 1
        )
    };
    let critical = a.values.number("corr_adjusted/pearson/critical_r");
    let level = sentences::level(a.alpha);
    let critical = critical.map_or_else(String::new, |r| {
        format!("; in a t test, p ≤ {level} requires |r| ≥ {}", apa::r(r))
    });
    Some(format!(
        "VAF varies only between realizations, so the correlation rests on {n} points, whatever the \
         number of participants: {smallest}{critical}."
    ))
}

/// The mixed model with crossed random effects.
fn crossed(a: &Analysis) -> Option<String> {
    let slope = sentences::slope_on_vaf(a, "lmm_vaf_crossed")?;
    let get = |id: &str| a.values.number(&format!("lmm_vaf_crossed/{id}"));
    let between = get("var_model_without_vaf").zip(get("var_model"));
    let between = between.map_or_else(String::new, |(without, with)| {
        format!(
            " The variance between realizations is {} without VAF in the model and {} with it.",
            apa::number(without, 3),
            apa::number(with, 3)
        )
    });
    let singular = match a.no_variance_beside_vaf() {
        Some(true) => {
            " The fit is singular: besides VAF no variance between realizations is left, so p is \
             too small and does not generalize to other realizations."
        }
        Some(false) => {
            " Another variance component is estimated as 0 (a singular fit); the variance between \
             realizations, on which p rests, is not."
        }
        None => "",
    };
    Some(format!(
        "Mixed model with crossed random effects of participants and realizations: {slope}.{between}\
         {singular}"
    ))
}

/// The ordinal model with crossed random effects, and whether its odds are proportional.
fn ordinal(a: &Analysis) -> Option<String> {
    let get = |id: &str| a.values.number(&format!("clmm_vaf_crossed/{id}"));
    let beta = get("beta/vaf")? / 100.0;
    let (t, p) = (get("t")?, get("p")?);
    let n = a.values.number("corr_adjusted/n_models").unwrap_or(0.0);
    let odds = |id: &str| a.values.number(&format!("clm_vaf/proportional_odds/{id}"));
    let odds = (odds("chi2").zip(odds("df")).zip(odds("p"))).map_or_else(
        String::new,
        |((chi2, df), p)| {
            format!(
                " Are the odds proportional? χ²({df}, N = {}) = {}, p {} (ratings taken as independent).",
                a.counts.with_ratings,
                apa::two(chi2),
                apa::p_beside(p, a.alpha)
            )
        },
    );
    Some(format!(
        "Cumulative logit model with crossed random effects: log odds ratio {} per .01 of VAF, \
         t({}) = {} from the likelihood ratio, p {}.{odds}",
        apa::two(beta),
        n - 2.0,
        apa::two(t),
        apa::p_beside(p, a.alpha)
    ))
}

/// Whether the forgetting factor or other covariates matter.
pub(super) fn covariates(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let get = |id: &str| v.number(&format!("covariate/log10_memory/{id}"));
    let others = others(a);
    let short = match a.finding(&Question::Memory) {
        Some(f) => {
            let r = get("r").map_or_else(String::new, |r| {
                let test = get("t").zip(get("df")).zip(get("p"));
                let test = test.map_or_else(String::new, |((t, df), p)| {
                    let (df, t) = (apa::number(df, 0), apa::two(t));
                    let level = f.test.as_ref().map_or(a.alpha, |t| t.level);
                    format!(", t({df}) = {t}, p {}", apa::p_beside(p, level))
                });
                let unit = match get("in_mm") {
                    Some(1.0) => "mm",
                    _ => "samples",
                };
                format!(
                    "; mean rating against log10 of the memory in {unit}: r = {}{test}",
                    apa::r(r)
                )
            });
            format!("{}{r}.", sentences::memory_verdict(f))
        }
        None if others.is_empty() => return None,
        None => "Correlations of the mean rating with the covariates:".to_owned(),
    };
    let question = if a.has_memory() {
        "Does the forgetting factor matter?"
    } else {
        "Do the covariates matter?"
    };
    let mut answer = Answer::new(question, short);
    answer.main.extend(curvature(a));
    if let Some(r) = get("r_with_vaf") {
        answer.main.push(format!(
            "Over these realizations memory and VAF correlate at r = {}: their effects are \
             confounded.",
            apa::r(r)
        ));
    }
    if others.len() > 1 {
        answer.more.push(
            "Each covariate is tested separately, by a t test over the realizations, without a \
             correction for their number."
                .to_owned(),
        );
    }
    match a.finding(&Question::Memory) {
        Some(_) => answer.more.extend(others),
        None => answer.main.extend(others),
    }
    if get("r").is_some() {
        answer.more.push(
            "The memory is the length over which the identification averages: the closer the \
             forgetting factor λ is to 1, the longer."
                .to_owned(),
        );
    }
    Some(answer)
}

fn curvature(a: &Analysis) -> Option<String> {
    let get = |id: &str| {
        a.values
            .number(&format!("covariate/log10_memory/quadratic/{id}"))
    };
    let ((b, p), df) = get("square").zip(get("p")).zip(get("df"))?;
    let direction = if b < 0.0 { "downward" } else { "upward" };
    let df = apa::number(df, 0);
    let both = get("F").zip(get("p_F")).map_or_else(String::new, |(f, p)| {
        let (f, p) = (apa::two(f), apa::p(p));
        format!(" Both terms jointly: F(2, {df}) = {f}, p {p}.")
    });
    Some(format!(
        "Quadratic term: b = {} (a {direction} curve), t({df}) = {}, p {}. The linear and the \
         quadratic term are two tests of one question, each at the level {}.{both}",
        apa::two(b),
        apa::or_dash(get("t"), apa::two),
        apa::p_beside(p, a.alpha / 2.0),
        sentences::level(a.alpha / 2.0)
    ))
}

/// A sentence for each covariate other than the logarithm of the memory.
fn others(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    // The memory in mm is covered by its logarithm.
    let covered = v.number("covariate/log10_memory/r").is_some();
    let covariates = (a.covariates.iter()).filter(|name| *name != "memory_mm" || !covered);
    covariates
        .filter_map(|name| {
            let what = described(name);
            let id = group_id("covariate", &[name]);
            match v.get(&format!("{id}/r"))? {
                Value::Number(r) => {
                    let get = |what: &str| v.number(&format!("{id}/{what}"));
                    let p = get("p").map_or_else(String::new, |p| format!(", p {}", apa::p(p)));
                    let with_vaf = get("r_with_vaf").map_or_else(String::new, |r| {
                        format!(" (with VAF it correlates at r = {})", apa::r(r))
                    });
                    let r = apa::r(*r);
                    Some(format!("Mean rating against {what}: r = {r}{p}{with_vaf}."))
                }
                Value::Undefined(why) => Some(format!("Mean rating against {what}: {why}.")),
                Value::List(_) => None,
            }
        })
        .take(MAX_COVARIATES)
        .collect()
}

/// The meaning of the program's own covariates; others by their names.
fn described(name: &str) -> String {
    match name {
        "least_energy_j" => {
            "the minimum energy absorbed by the device (J, over playbacks; negative if the device \
             was active)"
                .to_owned()
        }
        "lambda" => "the forgetting factor λ".to_owned(),
        "memory_mm" => "the memory (mm)".to_owned(),
        "dx_mm" => "the resampling increment dx (mm)".to_owned(),
        other => apa::name(other),
    }
}
