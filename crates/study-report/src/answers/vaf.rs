//! VAF, the forgetting factor and other covariates as predictors of the mean rating.

use super::{Answer, posterior};
use crate::{apa, sentences};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, Question};
use study_stats::permutation::DRAWS;

/// Covariates in a list.
const MAX_COVARIATES: usize = 8;

/// Whether VAF predicts the rating.
pub(super) fn predicts(a: &Analysis) -> Option<Answer> {
    let correlation = a.correlation();
    let (mut answer, f) = Answer::to(a, &Question::Vaf)?;
    if f.test.is_none() {
        answer.main.extend(correlation.pearson.r.number().map(|r| {
            format!(
                "Over these {} realizations the means correlate with VAF at r = {}.",
                f.realizations,
                apa::r(r)
            )
        }));
        return Some(answer);
    }
    let caveats = std::mem::take(&mut answer.main);
    answer.main.extend(points(a, f.realizations));
    answer.main.extend(sentences::ties(a));
    let detectable = a.results.sensitivity.correlation.number();
    answer.main.extend(detectable.map(|r| {
        format!(
            "A true correlation of {} is found with a power of 80 % in this design.",
            apa::r(r)
        )
    }));
    answer.main.extend(caveats);
    answer.main.extend(crossed(a));
    answer.main.extend(posterior::vaf(a));
    answer.more.extend(ordinal(a));
    if let Some((spearman, rho)) =
        (correlation.spearman.as_ref()).and_then(|s| Some((s, s.rho.number()?)))
    {
        let kendall = correlation.kendall.as_ref();
        let tau = kendall.and_then(|k| Some((k, k.tau_b.number()?)));
        let tau = tau.map_or_else(String::new, |(kendall, tau)| {
            let p = sentences::permutation_p(a, kendall.permuted.two_sided());
            format!("; Kendall's τb = {}{p}", apa::r(tau))
        });
        answer.main.push(format!(
            "Rank correlations: Spearman's ρ = {}{}{tau}.",
            apa::r(rho),
            sentences::permutation_p(a, spearman.permuted.two_sided())
        ));
    }
    let left_out = correlation.leave_one_out.as_ref();
    let bounds = left_out.and_then(|l| l.pearson_min.number().zip(l.pearson_max.number()));
    if let Some((low, high)) = bounds {
        answer.main.push(format!(
            "Leaving out one realization at a time, r ranges from {} to {}.",
            apa::r(low),
            apa::r(high)
        ));
    }
    answer.main.extend(sentences::sole_influence(a));
    let shares = correlation.share.as_ref();
    if let Some(share) = shares.map(|s| &s.r2).number() {
        let adjusted = shares.map(|s| &s.r2_adjusted).number();
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
        .extend(correlation.pearson.bf10.number().map(|bf| {
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
    let (mut answer, _) =
        Answer::to(a, &Question::Delivered).filter(|(_, f)| f.realizations > 0)?;
    if let Some(r) = a.correlation().pearson.r.number() {
        answer.main.push(format!(
            "With the VAF of the identification the same means correlate at r = {}.",
            apa::r(r)
        ));
    }
    Some(answer)
}

/// The number of points and the p that it allows.
fn points(a: &Analysis, n: usize) -> Option<String> {
    let pearson = &a.correlation().pearson;
    let permuted = pearson.permuted.as_ref()?;
    let smallest = permuted.smallest_p_two_sided.number()?;
    let (_, exact) = permuted.two_sided()?;
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
    let level = sentences::level(a.alpha);
    let critical = pearson.critical_r.number().map_or_else(String::new, |r| {
        format!("; in a t test, p ≤ {level} requires |r| ≥ {}", apa::r(r))
    });
    Some(format!(
        "VAF varies only between realizations, so the correlation rests on {n} points, whatever the \
         number of participants: {smallest}{critical}."
    ))
}

/// The mixed model with crossed random effects.
fn crossed(a: &Analysis) -> Option<String> {
    let model = &a.results.evidence.crossed;
    let slope = sentences::slope_on_vaf(a, &model.coefficients)?;
    let between = (model.var_model_without_vaf.number()).zip(model.var_model.number());
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
    let ordinal = &a.results.ordinal;
    let model = &ordinal.clmm_vaf_crossed;
    let beta = model.beta.number()? / 100.0;
    let (t, p) = (model.t.number()?, model.p.number()?);
    let n = a.correlation().n_models.number().unwrap_or(0.0);
    let odds = ordinal.clm_vaf.proportional_odds.as_ref();
    let odds = odds.and_then(|o| o.chi2.number().zip(o.df.number()).zip(o.p.number()));
    let odds = odds.map_or_else(
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
    let others = others(a);
    let memory = Answer::to(a, &Question::Memory).map(|(answer, _)| answer);
    let asked = memory.is_some();
    let correlations = || {
        let title = "Correlations of the mean rating with the covariates:";
        Answer::new("Do the covariates matter?", title.to_owned())
    };
    let correlations = || (!others.is_empty()).then(correlations);
    let mut answer = memory.or_else(correlations)?;
    let line = (a.results.evidence.covariates.log10_memory.as_ref()).map(|m| &m.line);
    answer.main.extend(curvature(a));
    if let Some(r) = line.map(|l| &l.r_with_vaf).number() {
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
    match asked {
        true => answer.more.extend(others),
        false => answer.main.extend(others),
    }
    if line.map(|l| &l.r).number().is_some() {
        answer.more.push(
            "The memory is the length over which the identification averages: the closer the \
             forgetting factor λ is to 1, the longer."
                .to_owned(),
        );
    }
    Some(answer)
}

fn curvature(a: &Analysis) -> Option<String> {
    let found = &(a.results.evidence.covariates.log10_memory.as_ref()?).quadratic;
    let (b, p, df) = (
        found.square.number()?,
        found.p.number()?,
        found.df.number()?,
    );
    let direction = if b < 0.0 { "downward" } else { "upward" };
    let df = apa::number(df, 0);
    let both = found.f.number().zip(found.p_f.number());
    let both = both.map_or_else(String::new, |(f, p)| {
        let (f, p) = (apa::two(f), apa::p(p));
        format!(" Both terms jointly: F(2, {df}) = {f}, p {p}.")
    });
    Some(format!(
        "Quadratic term: b = {} (a {direction} curve), t({df}) = {}, p {}. The linear and the \
         quadratic term are two tests of one question, each at the level {}.{both}",
        apa::two(b),
        apa::or_dash(found.t.number(), apa::two),
        apa::p_beside(p, a.alpha / 2.0),
        sentences::level(a.alpha / 2.0)
    ))
}

/// A sentence for each covariate other than the logarithm of the memory.
fn others(a: &Analysis) -> Vec<String> {
    let all = &a.results.evidence.covariates;
    // The memory in mm is covered by its logarithm.
    let covered = all
        .log10_memory
        .as_ref()
        .map(|m| &m.line.r)
        .number()
        .is_some();
    let covariates = (a.covariates.iter()).filter(|name| *name != "memory_mm" || !covered);
    covariates
        .filter_map(|name| {
            let what = described(name);
            let line = all.by_name.get(name.as_str())?;
            let Some(r) = line.r.number() else {
                let why = line.r.reason()?;
                return Some(format!("Mean rating against {what}: {why}."));
            };
            let p = line.p.number();
            let p = p.map_or_else(String::new, |p| format!(", p {}", apa::p(p)));
            let with_vaf = line.r_with_vaf.number().map_or_else(String::new, |r| {
                format!(" (with VAF it correlates at r = {})", apa::r(r))
            });
            let r = apa::r(r);
            Some(format!("Mean rating against {what}: r = {r}{p}{with_vaf}."))
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
