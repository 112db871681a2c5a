//! What goes along with the mean rating over realizations: VAF, the forgetting
//! factor, other covariates.

use super::{Answer, ci, two};
use crate::analyze::{Analysis, Value};
use crate::report::apa;

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
    let (kind, p) = match v.number("corr/pearson/p_exact_two_sided") {
        Some(p) => ("exact", Some(p)),
        None => (
            "permutation",
            v.number("corr/pearson/p_monte_carlo_two_sided"),
        ),
    };
    let direction = if r > 0.0 { "higher" } else { "lower" };
    let said = match p {
        Some(p) if p < 0.05 => {
            format!("Over these {n} realizations, those with a higher VAF are rated {direction}")
        }
        Some(_) => format!("{n} realizations do not show that it does"),
        None => format!("Over {n} realizations"),
    };
    let p = p.map_or_else(String::new, |p| {
        format!(", {kind} p {} (two-sided)", apa::equals_p(p))
    });
    let interval = ci(a, "corr/pearson/ci95", apa::r);
    let short = format!("{said}: r = {}{interval}{p}.", apa::r(r));
    let mut more = Vec::new();
    if let Some(least) = v.number("corr/pearson/smallest_p_two_sided") {
        more.push(format!(
            "VAF differs between realizations only, so there are {n} points however many \
             participants rated. The smallest p that any ratings of {n} realizations could have \
             given is {}{}.",
            of_orders(least, n),
            v.number("corr/pearson/critical_r")
                .map_or_else(String::new, |r| {
                    format!(", and |r| has to exceed {} for p < .05 by t", apa::r(r))
                })
        ));
    }
    if let Some(rho) = v.number("corr/spearman/rho") {
        let p = v.number("corr/spearman/p_exact_two_sided");
        let p = p.map_or_else(String::new, |p| format!(", exact p {}", apa::equals_p(p)));
        let tau = v.number("corr/kendall/tau_b");
        let tau = tau.map_or_else(String::new, |t| format!("; Kendall's τb = {}", apa::r(t)));
        more.push(format!("By ranks: Spearman's ρ = {}{p}{tau}.", apa::r(rho)));
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
    if v.number("corr/pearson/p_exact_two_sided").is_some() {
        more.push(
            "It assumes that the realizations are exchangeable, which neighbours on one ladder of \
             λ are not, and it cannot tell VAF from what goes along with it: λ, and how active a \
             realization is."
                .to_owned(),
        );
    }
    Some(Answer {
        question,
        short,
        more,
    })
}

/// A share of all n! orders as what it is.
fn of_orders(share: f64, n: f64) -> String {
    let all: f64 = (1..=n as u32).map(f64::from).product();
    format!("{}/{all}", (share * all).round())
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
        .number("lmm_crossed/var_model")
        .zip(get("var_model"))
        .map_or_else(String::new, |(without, with)| {
            format!(
                " The variance between realizations is {} without VAF in the model and {} with it.",
                apa::number(without, 3),
                apa::number(with, 3)
            )
        });
    let singular = if get("singular") == Some(1.0) {
        " The fit is singular: no variance of the realizations is left beside VAF, so that its p \
         is too small and says nothing about other realizations."
    } else {
        ""
    };
    Some(format!(
        "The mixed model with subjects and realizations crossed gives a slope of {} per unit of \
         VAF (SE {}{test}).{between}{singular}",
        two(slope),
        two(se)
    ))
}

/// λ, by its memory, and other covariates, where the analysis has them.
pub(super) fn covariates(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let get = |id: &str| v.number(&format!("covariate/log10_memory/{id}"));
    let mut more = Vec::new();
    let linear = get("r").map(|r| {
        let test = get("t").zip(get("df")).zip(get("p"));
        let test = test.map_or_else(String::new, |((t, df), p)| {
            format!(
                ", t({}) = {}, p {}",
                apa::number(df, 0),
                two(t),
                apa::equals_p(p)
            )
        });
        format!("r = {}{test}", apa::r(r))
    });
    let (b, p) = (get("quadratic/square"), get("quadratic/p"));
    if let Some((b, p)) = b.zip(p) {
        let df = get("quadratic/df").unwrap_or(0.0);
        more.push(format!(
            "With a square term: {} (p {}, {} residual degrees of freedom).",
            two(b),
            apa::equals_p(p),
            apa::number(df, 0)
        ));
    }
    if let Some(r) = get("r_with_vaf") {
        more.push(format!(
            "The memory goes along with VAF at r = {} over these realizations: what is said of one \
             may be the other's.",
            apa::r(r)
        ));
    }
    for (id, value) in v.iter().filter(|(id, _)| id.starts_with("covariate/")) {
        let name = id
            .strip_prefix("covariate/")
            .and_then(|n| n.strip_suffix("/r"));
        let Some(name) = name.filter(|n| *n != "log10_memory") else {
            continue;
        };
        match value {
            Value::Number(r) => {
                let p = v.number(&format!("covariate/{name}/p"));
                let p = p.map_or_else(String::new, |p| format!(", p {}", apa::equals_p(p)));
                let with = v.number(&format!("covariate/{name}/r_with_vaf"));
                let with = with.map_or_else(String::new, |r| {
                    format!("; {name} against VAF: r = {}", apa::r(r))
                });
                let remark = if name == "least_energy_j" {
                    " It is the least energy that the hand had put in, over playbacks; below 0 the \
                     device was active."
                } else {
                    ""
                };
                more.push(format!(
                    "Mean rating against {name}: r = {}{p}{with}.{remark}",
                    apa::r(*r)
                ));
            }
            Value::Undefined(why) => more.push(format!("{name}: not defined, {why}.")),
            Value::List(_) => {}
        }
        if more.len() >= 8 {
            break;
        }
    }
    let short = match (linear, v.reason("covariate/log10_memory/r")) {
        (Some(linear), _) => {
            let significant = |id: &str| get(id).is_some_and(|p| p < 0.05);
            let verdict = if significant("p") || significant("quadratic/p") {
                "Over these realizations it goes along with the mean rating"
            } else {
                "These realizations do not show that it does"
            };
            format!("{verdict}: log10 of the memory, {linear}.")
        }
        (None, Some(why)) => format!("It cannot be said: {why}."),
        (None, None) if more.is_empty() => return None,
        (None, None) => "Covariates of the realizations, over their mean ratings:".to_owned(),
    };
    let lambda = get("r").is_some() || v.reason("covariate/log10_memory/r").is_some();
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
