//! What a reader has to know before believing a number.

use super::Rules;
use super::cells::Cells;
use super::deviation::PreregisteredRule;
use super::exclude::Applied;
use super::select::Counts;
use super::subjects::MAX_LISTED;
use super::values::Values;
use study_stats::permutation::{DRAWS, MAX_EXACT};

/// A warning: a short name that stays, and a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// For programs.
    pub code: &'static str,
    /// For people. May hold names from the data: untrusted.
    pub text: String,
}

/// Below so many realizations, "VAF predicts the rating" is read with care.
const ENOUGH_REALIZATIONS: f64 = 8.0;

pub(super) fn warnings(
    cells: &Cells<'_>,
    counts: &Counts,
    rules: &Rules,
    exclusions: &[Applied],
    values: &Values,
) -> Vec<Warning> {
    let mut found = Vec::new();
    let mut warn = |code, text: String| found.push(Warning { code, text });
    let real = counts.real();
    let others = counts.pilots + counts.simulated;
    if others > 0 && real == 0 {
        warn(
            "no-participants",
            format!("{}; this is no evidence", who(counts)),
        );
    } else if counts.rows > 0 && counts.real_rows == 0 {
        // whoever took part was left out, and was nobody real
        let text = "only pilots or simulated participants; this is no evidence";
        warn("no-participants", text.to_owned());
    } else if others > 0 {
        warn("mixed", format!("among the participants: {}", who(counts)));
    }
    if counts.interim() {
        let planned = counts.planned.unwrap_or(0);
        warn(
            "interim",
            format!(
                "interim: {} of {planned} planned participants {} finished; looking early and \
                 stopping when it pleases makes every p too small",
                counts.finished,
                if counts.finished == 1 { "has" } else { "have" }
            ),
        );
    }
    for change in &rules.deviations {
        warn(
            "deviation",
            format!("deviation from what was stated beforehand: {}", change.text),
        );
    }
    if counts.participants == 1 && counts.rated > 0 {
        warn(
            "one-participant",
            "only one participant is analysed: the results tell of that one, and nothing about \
             people in general"
                .to_owned(),
        );
    }
    let changed =
        (rules.deviations.iter()).any(|d| d.affects.contains(&PreregisteredRule::Exclusions));
    excluded(&mut warn, exclusions, changed, values);
    headline(&mut warn, values);
    design(&mut warn, cells, values);
    raters(&mut warn, cells, values);
    found
}

fn who(counts: &Counts) -> String {
    match (counts.pilots, counts.simulated) {
        (0, s) => format!("{s} simulated"),
        (p, 0) => counted(p, "pilot", "pilots"),
        (p, s) => format!("{} and {s} simulated", counted(p, "pilot", "pilots")),
    }
}

fn excluded(
    warn: &mut impl FnMut(&'static str, String),
    exclusions: &[Applied],
    changed: bool,
    values: &Values,
) {
    let (first, later) = if changed {
        ("the", " (the rules were changed after the study began)")
    } else {
        ("the pre-stated", "")
    };
    for e in exclusions {
        if let Some(problem) = e.problem {
            let text = format!("{first} exclusion `{}`{later}: {problem}", e.rule);
            warn("rule-not-judged", text);
        }
        if e.rows > 0 {
            warn(
                "excluded",
                format!(
                    "{first} exclusion `{}`{later} left out {} of {}",
                    e.rule,
                    counted(e.rows, "row", "rows"),
                    people(e.participants)
                ),
            );
        }
    }
    let both = |id: &str| {
        let before = values.number(&format!("before_exclusion/{id}"));
        before.zip(values.number(id))
    };
    if let Some((before, after)) = both("corr/pearson/r") {
        let text = if shown(before) == shown(after) {
            format!(
                "without the exclusions r would be the same to three digits, {}",
                shown(after)
            )
        } else {
            format!(
                "without the exclusions r would be {}, not {}: both are in the tables",
                shown(before),
                shown(after)
            )
        };
        warn("with-and-without", text);
    }
}

fn headline(warn: &mut impl FnMut(&'static str, String), values: &Values) {
    let Some(r) = values.number("corr/pearson/r") else {
        return;
    };
    let n = values.number("corr/n_models").unwrap_or(0.0);
    if n < ENOUGH_REALIZATIONS {
        warn(
            "few-realizations",
            format!(
                "VAF varies between {n} realizations only: there are {n} points, however many \
                 participants rated"
            ),
        );
    }
    if n > MAX_EXACT as f64 {
        warn(
            "monte-carlo",
            format!("permutation p from {DRAWS} random orders of the realizations, not from all"),
        );
    }
    let ends = [
        "corr/leave_one_out/pearson_min",
        "corr/leave_one_out/pearson_max",
    ];
    if let (Some(low), Some(high)) = (values.number(ends[0]), values.number(ends[1]))
        && (low * high <= 0.0 || high - low > 0.5)
    {
        warn(
            "one-realization",
            format!(
                "the correlation hangs on single realizations: with one left out, r lies between \
                 {} and {}",
                shown(low),
                shown(high)
            ),
        );
    }
    if let Some(rho) = values.number("corr/spearman/rho")
        && (r - rho).abs() > 0.3
    {
        warn(
            "not-linear",
            format!(
                "r = {} and rho = {} differ: the relation is no line, or one point is far out",
                shown(r),
                shown(rho)
            ),
        );
    }
    let f = values.number("rmanova/p_gg").is_some_and(|p| p < 0.05);
    let flat = values.number("corr/pearson/p_t").is_some_and(|p| p >= 0.05);
    if f && flat {
        warn(
            "differ-without-trend",
            "the realizations differ, but that they do so along VAF is not shown: look at their \
             means, not at the slope alone"
                .to_owned(),
        );
    }
    // Only what was identified with forgetting factors has them.
    let identified = values.get("covariate/log10_memory/r").is_some();
    let text = if identified {
        "the permutation takes the realizations as exchangeable, which neighbours on one ladder \
         of lambda are not; what goes along with VAF, such as lambda or activeness, cannot be \
         told from it"
    } else {
        "the permutation takes the realizations as exchangeable; what goes along with VAF cannot \
         be told from it"
    };
    warn("assumptions", text.to_owned());
}

fn design(warn: &mut impl FnMut(&'static str, String), cells: &Cells<'_>, values: &Values) {
    let n = |id: &str| values.number(id).unwrap_or(0.0);
    let incomplete = n("design/n_subjects") - n("design/n_subjects_complete");
    if incomplete > 0.0 && !cells.ratings.models.is_empty() {
        warn(
            "incomplete",
            format!(
                "{} did not rate every test realization and {} left out of what needs complete \
                 tables",
                people(incomplete as usize),
                if incomplete == 1.0 { "is" } else { "are" }
            ),
        );
    }
    let sizes: Vec<usize> = cells.cells.iter().map(|c| c.rows.len()).collect();
    if sizes.iter().min() != sizes.iter().max() {
        warn(
            "unbalanced",
            "cells hold different numbers of ratings: the mean over ratings is not the mean over \
             participants"
                .to_owned(),
        );
    }
    let r = cells.ratings;
    let mut has_vaf = vec![false; r.models.len()];
    for (&m, v) in r.model.iter().zip(&r.vaf) {
        if let (Some(m), Some(_)) = (m, v) {
            has_vaf[m as usize] = true;
        }
    }
    for (m, model) in r.models.iter().enumerate() {
        if !cells.rated[m] {
            let text = format!(
                "nobody rated realization {}: it is left out of all comparisons",
                model.id
            );
            warn("not-rated", text);
        }
        if cells.vaf[m].is_none() && has_vaf[m] {
            warn(
                "vaf-differs",
                format!(
                    "realization {} has rows with different VAF; it has none here",
                    model.id
                ),
            );
        }
    }
    if values.number("screen/listed") == Some(0.0) {
        warn(
            "many-participants",
            format!(
                "more than {MAX_LISTED} participants: they are screened, but not listed one by one"
            ),
        );
    }
    if values.number("bootstrap/normal_limit") == Some(1.0) {
        warn(
            "normal-limit",
            "so many participants that the bootstrap draws means from their normal limit"
                .to_owned(),
        );
    }
    if r.model.contains(&None) {
        warn("no-model", "some ratings name no realization".to_owned());
    }
}

fn raters(warn: &mut impl FnMut(&'static str, String), cells: &Cells<'_>, values: &Values) {
    if cells.ratings.models.len() < 2 {
        return;
    }
    let constant = values.number("screen/n_constant").unwrap_or(0.0) as usize;
    if constant == 0 {
        return;
    }
    let names = (cells.ratings.subjects.iter())
        .map(|s| s.id.as_str())
        .filter(|id| {
            let n = values.number(&format!("subject/{id}/n")).unwrap_or(0.0);
            n > 1.0 && values.number(&format!("subject/{id}/distinct")) == Some(1.0)
        })
        .take(5);
    let shown = names.collect::<Vec<_>>().join(", ");
    let more = if constant > 5 { ", …" } else { "" };
    warn(
        "constant-rater",
        format!(
            "{} gave the same rating every time: {shown}{more} (kept)",
            people(constant)
        ),
    );
}

/// A correlation as the pages print it: three decimals, no zero before the point, a
/// real minus and no negative zero.
fn shown(r: f64) -> String {
    let digits = format!("{:.3}", r.abs());
    let sign = if r < 0.0 && digits != "0.000" {
        "−"
    } else {
        ""
    };
    format!("{sign}{}", digits.strip_prefix('0').unwrap_or(&digits))
}

fn people(n: usize) -> String {
    counted(n, "participant", "participants")
}

/// `one` or so many `many`.
fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}
