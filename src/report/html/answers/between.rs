//! What goes along with the mean rating over realizations: VAF, the forgetting
//! factor, other covariates.

use super::{Answer, ci, two};
use crate::report::{apa, permuted, tied};
use study_core::analyze::{Analysis, Value};
use study_stats::permutation::DRAWS;

pub(super) fn predicts(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let question = format!("Does VAF predict {}?", crate::report::asked(a));
    let Some(r) = v.number("corr/pearson/r") else {
        // Without any VAF it is no question.
        let asked = a.realizations.iter().any(|m| m.vaf.is_some());
        return match v.get("corr/pearson/r") {
            Some(Value::Undefined(why)) if asked => Some(Answer {
                question,
                short: format!("It cannot be said: {why}."),
                more: Vec::new(),
            }),
            _ => None,
        };
    };
    let n = v.number("corr/n_models").unwrap_or(0.0);
    let found = permuted(a, "pearson");
    let p = found.map(|f| f.1);
    let direction = if r > 0.0 { "higher" } else { "lower" };
    let said = match p {
        Some(p) if p < 0.05 => {
            format!("Over these {n} realizations, those with a higher VAF are rated {direction}")
        }
        Some(_) => format!("These {n} realizations do not show that it does"),
        None => format!("Over {n} realizations"),
    };
    let shown = found.map_or_else(String::new, |(kind, p)| {
        format!(", {} (two-sided)", apa::named_p(kind, p))
    });
    let interval = ci(a, "corr/pearson/ci95", apa::r);
    let short = format!("{said}: r = {}{interval}{shown}.", apa::r(r));
    let mut more = points(a, n);
    let ends = (v.number("corr/pearson/ci95_lo")).zip(v.number("corr/pearson/ci95_hi"));
    if let (Some((low, high)), Some(p)) = (ends, p)
        && (low * high > 0.0) != (p < 0.05)
    {
        more.push(
            "The interval and the p disagree: the interval (Fisher's z) takes VAF and mean rating \
             as normally distributed, the p does not. Go by the p."
                .to_owned(),
        );
    }
    if let Some(rho) = v.number("corr/spearman/rho") {
        let with = |name: &str| {
            permuted(a, name).map_or_else(String::new, |(kind, p)| {
                format!(", {}", apa::named_p(kind, p))
            })
        };
        let tau = v.number("corr/kendall/tau_b");
        let tau = tau.map_or_else(String::new, |t| {
            format!("; Kendall's τb = {}{}", apa::r(t), with("kendall"))
        });
        more.push(format!(
            "By ranks: Spearman's ρ = {}{}{tau}.",
            apa::r(rho),
            with("spearman")
        ));
    }
    let ends = v
        .number("corr/leave_one_out/pearson_min")
        .zip(v.number("corr/leave_one_out/pearson_max"));
    if let Some((low, high)) = ends {
        more.push(format!(
            "Leaving out one realization at a time, r goes from {} to {}.",
            apa::r(low),
            apa::r(high)
        ));
    }
    more.extend(crate::report::hangs_on(a));
    if let Some(share) = v.number("corr/share/r2") {
        let adjusted = v.number("corr/share/r2_adjusted");
        let adjusted = adjusted.map_or_else(String::new, |x| {
            format!(
                " ({} after the correction for few realizations)",
                apa::percent(x.max(0.0))
            )
        });
        more.push(format!(
            "VAF goes along with {} of the variance between the realizations' means{adjusted}.",
            apa::percent(share)
        ));
    }
    more.extend(crossed(a));
    if p.is_some() {
        let (neighbours, such) = if crate::report::identified(a) {
            (
                ", which neighbours on one ladder of λ are not",
                ": λ, and how active a realization is",
            )
        } else {
            ("", "")
        };
        more.push(format!(
            "The p by permutation assumes that the realizations are exchangeable{neighbours}, and it \
             cannot tell VAF from what goes along with it{such}."
        ));
    }
    Some(Answer {
        question,
        short,
        more,
    })
}

/// How many points there are, and what p they can give.
fn points(a: &Analysis, n: f64) -> Vec<String> {
    let v = &a.values;
    let Some(least) = v.number("corr/pearson/smallest_p_two_sided") else {
        return Vec::new();
    };
    let exact = v.number("corr/pearson/p_exact_two_sided").is_some();
    let smallest = if exact {
        format!(
            "The smallest p that {n} realizations can give is {}",
            apa::of_orders(least, n)
        )
    } else {
        format!(
            "The p is from {DRAWS} random orders of the realizations, and cannot be smaller than \
             1/{}",
            DRAWS + 1
        )
    };
    let critical = v
        .number("corr/pearson/critical_r")
        .map_or_else(String::new, |r| {
            format!("; by a t test, p < .05 needs |r| above {}", apa::r(r))
        });
    let mut said = vec![format!(
        "VAF differs between realizations only, so there are {n} points however many \
         participants rated. {smallest}{critical}."
    )];
    if exact {
        said.extend(crate::report::shared_vaf(a).map(|s| format!("{s}.")));
    }
    let tied = tied(a);
    if tied > 1 {
        said.push(format!(
            "{} of the {n} means have an equal among them. Exchanging equal means changes nothing, so \
             that p cannot become as small as that.",
            apa::capital(&apa::count(tied))
        ));
    }
    said
}

/// The mixed model with subjects and realizations crossed.
fn crossed(a: &Analysis) -> Option<String> {
    let get = |id: &str| a.values.number(&format!("lmm_vaf_crossed/{id}"));
    let (slope, se) = get("slope").zip(get("slope_se"))?;
    let test = get("slope_t")
        .zip(get("slope_satterthwaite_df"))
        .zip(get("slope_satterthwaite_p"));
    let test = test.map_or_else(String::new, |((t, df), p)| {
        format!(
            ", t({}) = {}, p {}",
            apa::number(df, 1),
            two(t),
            apa::equals_p(p)
        )
    });
    let between = a
        .values
        .number("lmm_vaf_crossed/var_model_without_vaf")
        .zip(get("var_model"))
        .map_or_else(String::new, |(without, with)| {
            format!(
                " The variance between realizations is {} without VAF in the model and {} with it.",
                apa::number(without, 3),
                apa::number(with, 3)
            )
        });
    let singular = match super::none_left(a) {
        Some(true) => {
            " The fit is singular: no variance of the realizations is left beside VAF, so that its \
             p is too small and says nothing about other realizations."
        }
        Some(false) => {
            " Another variance of the model is estimated as 0 (a singular fit); that of the \
             realizations, which the p rests on, is not."
        }
        None => "",
    };
    Some(format!(
        "The mixed model with subjects and realizations crossed gives a slope of {} per unit of \
         VAF (SE {}{test}).{between}{singular}",
        apa::number(slope, apa::decimals(se, 2)),
        apa::number(se, apa::decimals(se, 2))
    ))
}

/// λ, by its memory, and other covariates, where the analysis has them.
pub(super) fn covariates(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let get = |id: &str| v.number(&format!("covariate/log10_memory/{id}"));
    let mut more = Vec::new();
    if let Some(line) = curvature(a) {
        more.push(line);
    }
    if let Some(r) = get("r_with_vaf") {
        more.push(format!(
            "The memory goes along with VAF at r = {} over these realizations: what is said of one \
             may be the other's.",
            apa::r(r)
        ));
    }
    let listed = others(a);
    if listed.len() > 1 {
        more.push(
            "Each covariate is tested alone, by a t test over the realizations; no p is corrected \
             for their number."
                .to_owned(),
        );
    }
    more.extend(listed);
    let unit = match get("in_mm") {
        Some(1.0) => "in mm",
        _ => "in samples",
    };
    let short = match (get("r"), v.reason("covariate/log10_memory/r")) {
        (Some(r), _) => {
            let test = get("t").zip(get("df")).zip(get("p"));
            let test = test.map_or_else(String::new, |((t, df), p)| {
                format!(
                    ", t({}) = {}, p {}",
                    apa::number(df, 0),
                    two(t),
                    apa::equals_p(p)
                )
            });
            format!(
                "{}: mean rating against log10 of the memory ({unit}), r = {}{test}.",
                apa::memory_verdict(r, get("p"), get("quadratic/p")),
                apa::r(r)
            )
        }
        (None, Some(why)) => format!("It cannot be said: {why}."),
        (None, None) if more.is_empty() => return None,
        (None, None) => "What is known of the realizations, against their mean ratings:".to_owned(),
    };
    let lambda = get("r").is_some() || v.reason("covariate/log10_memory/r").is_some();
    if get("r").is_some() {
        more.push(
            "The memory is how far back the identification looks: the nearer the forgetting factor λ \
             is to 1, the longer."
                .to_owned(),
        );
    }
    let question = if lambda {
        "Does the forgetting factor matter?"
    } else {
        "Do the covariates matter?"
    };
    Some(Answer {
        question: question.to_owned(),
        short,
        more,
    })
}

fn curvature(a: &Analysis) -> Option<String> {
    let get = |id: &str| {
        a.values
            .number(&format!("covariate/log10_memory/quadratic/{id}"))
    };
    let ((b, p), df) = get("square").zip(get("p")).zip(get("df"))?;
    let bent = if b < 0.0 { "downwards" } else { "upwards" };
    let both = get("F").zip(get("p_F")).map_or_else(String::new, |(f, p)| {
        format!(
            " Both together: F(2, {}) = {}, p {}.",
            apa::number(df, 0),
            two(f),
            apa::equals_p(p)
        )
    });
    Some(format!(
        "With a square term beside the line, {} (a curve bent {bent}), t({}) = {}, \
         p {}. Line and curve are two tests: each is held against .025, and the verdict goes by them.{both}",
        two(b),
        apa::number(df, 0),
        get("t").map_or_else(|| "–".to_owned(), two),
        apa::equals_p(p)
    ))
}

/// A sentence for each covariate other than the logarithm of the memory.
fn others(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let mut said = Vec::new();
    for (id, value) in v.iter() {
        let name = id
            .strip_prefix("covariate/")
            .and_then(|n| n.strip_suffix("/r"));
        let Some(name) = name.filter(|n| *n != "log10_memory") else {
            continue;
        };
        // The logarithm has been told of.
        if name == "memory_mm" && v.number("covariate/log10_memory/r").is_some() {
            continue;
        }
        let shown = called(name);
        match value {
            Value::Number(r) => {
                let get = |what: &str| v.number(&format!("covariate/{name}/{what}"));
                let p = get("p").map_or_else(String::new, |p| format!(", p {}", apa::equals_p(p)));
                let with = get("r_with_vaf").map_or_else(String::new, |r| {
                    format!(" (and VAF against it, r = {})", apa::r(r))
                });
                said.push(format!(
                    "Mean rating against {shown}: r = {}{p}{with}.",
                    apa::r(*r)
                ));
            }
            Value::Undefined(why) => {
                said.push(format!("Mean rating against {shown}: not defined, {why}."));
            }
            Value::List(_) => {}
        }
        if said.len() >= 8 {
            break;
        }
    }
    said
}

/// What the program's own covariates are; others by their names.
fn called(name: &str) -> String {
    match name {
        "least_energy_j" => {
            "the least energy that the hand had put in (J, over playbacks; below 0 the device was \
             active)"
                .to_owned()
        }
        "lambda" => "the forgetting factor λ".to_owned(),
        "memory_mm" => "the memory (mm)".to_owned(),
        "dx_mm" => "the grid's step (dx, mm)".to_owned(),
        other => apa::name(other),
    }
}
