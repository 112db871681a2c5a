//! The numbers that R has to come to: identifier, value, tolerance.

use crate::analyze::psychophysics::PartAnalysis;
use crate::analyze::{Analysis, group_id};

/// Most realizations with a VAF of which R goes through every permutation.
const MAX_PERMUTED: f64 = 8.0;

/// An identifier, its value if it has one, and the tolerance.
type Number = (String, Option<f64>, &'static str);

/// The tolerance, relative to a value above 1, of closed forms, of the linear mixed model,
/// of abilities, and of the ordinal model.
const CLOSED: &str = "1e-9";
const LINEAR: &str = "2e-5";
/// Of a likelihood that both maximize by Newton's method.
const FITTED: &str = "1e-6";
const ORDINAL: &str = "2e-3";

/// Of the analysis of ratings.
pub(super) fn of_ratings(analysis: &Analysis) -> Vec<Number> {
    let mut ids: Vec<(String, &'static str)> = Vec::new();
    for realization in &analysis.realizations {
        let group = group_id("desc", &[&realization.id]);
        ids.extend(["n", "mean", "sd"].map(|what| (format!("{group}/{what}"), CLOSED)));
    }
    ids.extend(["n_models", "pearson/r", "pearson/p_t"].map(|w| (format!("corr/{w}"), CLOSED)));
    let models = analysis.values.number("corr/n_models");
    if models.is_some_and(|n| n <= MAX_PERMUTED) {
        ids.push(("corr/pearson/p_exact_two_sided".to_owned(), CLOSED));
    }
    let linear = [
        "slope",
        "slope_se",
        "slope_satterthwaite_df",
        "slope_satterthwaite_p",
    ];
    let variances = ["var_subject", "var_model", "sigma2"];
    ids.extend((linear.iter().chain(&variances)).map(|w| (format!("lmm_vaf_crossed/{w}"), LINEAR)));
    let ordinal = [
        "beta/vaf",
        "se/vaf",
        "sd_subject",
        "sd_model",
        "loglik",
        "lrt_chi2",
    ];
    ids.extend(ordinal.map(|w| (format!("clmm_vaf_crossed/{w}"), ORDINAL)));
    let values = &analysis.values;
    (ids.into_iter())
        .map(|(id, tolerance)| {
            let value = values.number(&id);
            (id, value, tolerance)
        })
        .collect()
}

/// Of a part, with the part's id before each identifier.
pub(super) fn of_part(part: &PartAnalysis) -> Vec<Number> {
    let permuted = |group: &str| {
        let n = part.values.number(&format!("{group}/n_models"));
        n.is_some_and(|n| n <= MAX_PERMUTED)
    };
    let one = |id: &str| {
        let (group, what) = id.rsplit_once('/')?;
        let of_vaf = group
            .strip_suffix("/pearson")
            .filter(|_| what == "p_exact_two_sided");
        let tolerance = tolerance(part.task, group, what)?;
        of_vaf.is_none_or(permuted).then_some(tolerance)
    };
    (part.values.iter())
        .filter_map(|(id, _)| Some((id, one(id)?)))
        .map(|(id, tolerance)| {
            let value = part.values.number(id);
            (format!("{}:{id}", part.part), value, tolerance)
        })
        .collect()
}

/// The tolerance of a statistic of a part; `None` of one that R does not compute.
fn tolerance(task: &str, group: &str, what: &str) -> Option<&'static str> {
    const TEST: [&str; 4] = ["F", "df1", "df2", "p"];
    let of = |names: &[&str]| names.contains(&what);
    // Names of the data have no separators in identifiers.
    let (first, name) = group.split_once('/').unwrap_or((group, ""));
    let pair = name.contains('|');
    match (first, name) {
        ("pairs", "") => {
            of(&["order", "order_se", "tie_log_nu", "tie_log_nu_se"]).then_some(FITTED)
        }
        ("pairs", "ability" | "ability_se") => Some(FITTED),
        ("pairs", "vaf/pearson") => of(&["r", "p_exact_two_sided"]).then_some(FITTED),
        ("pairs", _) if pair => of(&["difference", "se"]).then_some(FITTED),
        ("magnitude", "vaf/pearson") => of(&["r", "p_exact_two_sided"]).then_some(CLOSED),
        ("magnitude", "") => of(&["exponent", "log10_coefficient"]).then_some(CLOSED),
        ("magnitude", name) if name.starts_with("realization/") => {
            of(&["geometric_mean"]).then_some(CLOSED)
        }
        ("magnitude_mixed" | "psy_mixed" | "sessions", "") => of(&TEST).then_some(LINEAR),
        ("mushra", name) if task == "mushra" && !name.is_empty() => {
            of(&["median", "mean"]).then_some(CLOSED)
        }
        ("sdt_group", name) if name.ends_with("/above_chance") => of(&["t", "p"]).then_some(CLOSED),
        ("groups", "") => of(&TEST).then_some(CLOSED),
        ("groups", _) if pair => of(&["difference", "ratio", "t", "df", "p"]).then_some(CLOSED),
        ("groups", _) => of(&["mean", "sd", "geometric_mean", "geometric_sd"]).then_some(CLOSED),
        ("groups_conditions", "") => (of(&TEST) || of(&["eps_gg", "p_gg"])).then_some(CLOSED),
        ("retest", "") => of(&["icc_agreement", "icc_consistency", "sem"]).then_some(CLOSED),
        _ => None,
    }
}
