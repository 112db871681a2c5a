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
fn permuted(a: &study_core::analyze::Analysis, name: &str) -> Option<(&'static str, f64)> {
    let get = |id: &str| a.values.number(&format!("corr/{name}/{id}"));
    let exact = get("p_exact_two_sided").map(|p| ("exact p", p));
    exact.or_else(|| get("p_monte_carlo_two_sided").map(|p| ("permutation p", p)))
}

/// How many of the realizations behind the correlation have a mean that another
/// one has, too.
fn tied(a: &study_core::analyze::Analysis) -> usize {
    let of = |m: &&study_core::analyze::Listed| {
        let own = m.role == study_core::outcome::Role::Test && m.duplicate_of.is_none();
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
fn pairs(a: &study_core::analyze::Analysis) -> (Vec<(String, String)>, Option<f64>) {
    let own = |m: &&study_core::analyze::Listed| {
        m.role == study_core::outcome::Role::Test && m.duplicate_of.is_none()
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

/// `one of 8 participants`: those who rated every realization.
fn complete(a: &study_core::analyze::Analysis) -> String {
    let get = |id: &str| a.values.number(&format!("design/{id}")).unwrap_or(0.0);
    let who = match get("n_subjects_complete") {
        0.0 => "none".to_owned(),
        n => n.to_string(),
    };
    format!(
        "{who} of {}",
        apa::counted(get("n_subjects") as usize, "participant", "participants")
    )
}

/// What r hangs on: the one realization without which all means or all VAF are
/// equal, as a sentence. Names in it are untrusted.
fn hangs_on(a: &study_core::analyze::Analysis) -> Option<String> {
    a.values.number("corr/pearson/r")?;
    let points: Vec<(&str, f64, f64)> = (a.realizations.iter())
        .filter(|m| m.role == study_core::outcome::Role::Test && m.duplicate_of.is_none())
        .filter_map(|m| {
            let mean = a
                .values
                .number(&format!("desc/{}/subject_mean/mean", m.id))?;
            Some((m.id.as_str(), mean, m.vaf?))
        })
        .collect();
    if points.len() < 3 {
        return None;
    }
    let alike = |out: usize, of: fn(&(&str, f64, f64)) -> f64| {
        let mut rest = (points.iter().enumerate()).filter(|(i, _)| *i != out);
        let first = rest.next().map_or(0.0, |(_, p)| of(p));
        rest.all(|(_, p)| (of(p) - first).abs() <= 1e-9 * first.abs().max(1.0))
    };
    let means = (0..points.len()).find(|i| alike(*i, |p| p.1));
    let vaf = (0..points.len()).find(|i| alike(*i, |p| p.2));
    let (at, what) = means.map(|i| (i, "means")).or(vaf.map(|i| (i, "VAF")))?;
    Some(format!(
        "Without {} all {what} are equal: r hangs on that one realization.",
        points[at].0
    ))
}

/// Whether the realizations are known to be identified with forgetting factors.
fn identified(a: &study_core::analyze::Analysis) -> bool {
    a.values.get("covariate/log10_memory/r").is_some()
}

/// Why the smallest p is no smaller, if realizations share a VAF.
fn shared_vaf(a: &study_core::analyze::Analysis) -> Option<String> {
    let own = |m: &&study_core::analyze::Listed| {
        let mean = format!("desc/{}/subject_mean/mean", m.id);
        m.role == study_core::outcome::Role::Test
            && m.duplicate_of.is_none()
            && a.values.number(&mean).is_some()
    };
    let mut vaf: Vec<f64> = (a.realizations.iter().filter(own))
        .filter_map(|m| m.vaf)
        .collect();
    vaf.sort_by(f64::total_cmp);
    let groups = vaf.chunk_by(|x, y| x == y).map(<[f64]>::len);
    let tied: usize = groups.filter(|n| *n > 1).sum();
    (tied > 1).then(|| {
        format!(
            "{} realizations share a VAF with another: exchanging them changes nothing, which is \
             why the smallest p is no smaller",
            apa::capital(&apa::count(tied))
        )
    })
}

/// Why there is no p of a pair of realizations, `first` before `second` by name.
fn no_pairs(a: &study_core::analyze::Analysis, first: &str, second: &str) -> String {
    let why = a.values.reason(&format!("posthoc/{first}|{second}/p_t"));
    match (a.values.number("design/n_subjects_complete"), why) {
        (Some(n), Some(why)) if n >= 2.0 => format!("not tested: {why}"),
        _ if a.values.number("design/n_subjects") == Some(1.0) => {
            "not tested: there is one participant only".to_owned()
        }
        _ => format!(
            "not tested: pairs are compared among those who rated every realization, and that is {}",
            complete(a)
        ),
    }
}

/// Why equivalence with a reference was not tested, by the identifier of the
/// contrast; `None` if it was.
fn no_equivalence(a: &study_core::analyze::Analysis, contrast: &str) -> Option<String> {
    let why = a.values.reason(&format!("{contrast}/p_tost"))?;
    let margin = a.values.number(&format!("{contrast}/margin"));
    let changed = a.changed(study_core::analyze::PreregisteredRule::Margin);
    Some(match margin {
        None if changed => {
            "the margin of equivalence was taken back after the study began: see Deviations"
                .to_owned()
        }
        None => "no margin of equivalence was stated beforehand".to_owned(),
        Some(margin) => format!("equivalence within ± {margin} was not tested: {why}"),
    })
}

/// The F test of a mixed model.
struct MixedF {
    f: f64,
    df1: f64,
    df2: f64,
    p: f64,
}

/// That of the realizations over all ratings, where too few subjects are complete for
/// the tests that need complete tables.
fn mixed_f(a: &study_core::analyze::Analysis) -> Option<MixedF> {
    let get = |id: &str| a.values.number(&format!("lmm_model/satterthwaite_{id}"));
    let complete = ["rmanova/p_gg", "friedman/p"];
    if complete.iter().any(|id| a.values.number(id).is_some()) {
        return None;
    }
    Some(MixedF {
        f: get("F")?,
        df1: a.values.number("lmm_model/lrt_df")?,
        df2: get("df2")?,
        p: get("p")?,
    })
}

/// The question as a noun. Untrusted.
fn asked(a: &study_core::analyze::Analysis) -> String {
    match a.question.as_str() {
        "rating" => "the rating".to_owned(),
        other => other.to_owned(),
    }
}
