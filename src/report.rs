//! An analysis to bytes: the terminal page, the HTML report, figures, CSV tables,
//! one JSON document.
//!
//! Nothing is inferred here: every statistic stands in the analysis, by its
//! identifier, and what is absent is left out. Text from the data is escaped on
//! its way to a terminal, to HTML, to SVG and to CSV, and stored as it is in JSON.

mod apa;
pub mod csv;
pub mod figures;
pub mod html;
pub mod identification;
pub mod json;
pub mod plot;
pub mod png;
pub mod svg;
pub mod text;

/// What was analysed, for the head of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// For people. Untrusted.
    pub title: String,
    /// Id of the study, if it is one of ours.
    pub study: Option<String>,
    /// Version of the protocol whose rules were applied.
    pub protocol_version: Option<u32>,
    /// Where it was read, as the user gave it. Untrusted.
    pub path: String,
}

/// The permutation p of a correlation over realizations (`pearson`, `spearman`,
/// `kendall`), with how it was found: from all orders, or from random ones.
fn permuted(a: &crate::analyze::Analysis, name: &str) -> Option<(&'static str, f64)> {
    let get = |id: &str| a.values.number(&format!("corr/{name}/{id}"));
    let exact = get("p_exact_two_sided").map(|p| ("exact p", p));
    exact.or_else(|| get("p_monte_carlo_two_sided").map(|p| ("permutation p", p)))
}

/// How many of the realizations behind the correlation have a mean that another
/// one has, too.
fn tied(a: &crate::analyze::Analysis) -> usize {
    let of = |m: &&crate::analyze::Listed| {
        let own = m.role == crate::outcome::Role::Test && m.duplicate_of.is_none();
        let id = format!("desc/{}/subject_mean/mean", m.id);
        m.vaf.filter(|_| own).and(a.values.number(&id))
    };
    let mut means: Vec<f64> = a.realizations.iter().filter_map(|m| of(&m)).collect();
    means.sort_by(f64::total_cmp);
    let same = |x: &f64, y: &f64| (x - y).abs() <= 1e-9 * x.abs().max(1.0);
    let groups = means.chunk_by(same).map(<[f64]>::len);
    groups.filter(|n| *n > 1).sum()
}

/// More realizations are not compared pair by pair.
const MAX_PAIRED: usize = 8;

/// Pairs that were compared, by name, and the least p that Wilcoxon's test and
/// Holm's correction could have given the clearest of them.
fn pairs(a: &crate::analyze::Analysis) -> (Vec<(String, String)>, Option<f64>) {
    let own = |m: &&crate::analyze::Listed| {
        m.role == crate::outcome::Role::Test && m.duplicate_of.is_none()
    };
    let tests = a.realizations.iter().filter(own);
    let ids: Vec<&str> = tests.map(|m| m.id.as_str()).collect();
    if ids.len() > MAX_PAIRED {
        return (Vec::new(), None);
    }
    let mut found = Vec::new();
    for first in &ids {
        for second in ids.iter().filter(|s| first < *s) {
            let id = format!("posthoc/{first}|{second}/mean_diff");
            if a.values.get(&id).is_some() {
                found.push(((*first).to_owned(), (*second).to_owned()));
            }
        }
    }
    found.sort();
    let subjects = a.values.number("design/n_subjects_complete");
    let least = subjects.filter(|_| !found.is_empty()).map(|n| {
        let one = 2.0 * 0.5f64.powi(n as i32);
        (one * found.len() as f64).min(1.0)
    });
    (found, least)
}

/// The question as a noun. Untrusted.
fn asked(a: &crate::analyze::Analysis) -> String {
    match a.question.as_str() {
        "rating" => "the rating".to_owned(),
        other => other.to_owned(),
    }
}
