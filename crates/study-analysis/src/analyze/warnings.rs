//! Warnings: what limits the interpretation of the results.

use super::Rules;
use super::cells::Cells;
use super::design::Design;
use super::deviation::PreregisteredRule;
use super::exclude::Applied;
use super::findings::{Finding, Question, Verdict};
use super::results::{
    Ends, Evidence, MissingOf, Number as _, RealizationName, Results, Screened, Screening, Stat,
};
use super::select::Counts;
use super::subjects::MAX_LISTED;
use super::warning::Warning;
use std::collections::BTreeMap;
use study_base::apa;
use study_base::sort::SmallSort as _;
use study_base::text::counted;
use study_stats::level::rejects;
use study_stats::permutation::{DRAWS, MAX_EXACT};

/// A weaker correlation is not driven by anything.
const DRIVEN: f64 = 0.5;

/// With fewer realizations a test of "VAF predicts the rating" has little power.
const ENOUGH_REALIZATIONS: usize = 8;

pub(super) fn warnings(
    cells: &Cells<'_>,
    counts: &Counts,
    rules: &Rules,
    exclusions: &[Applied],
    results: &Results,
    findings: &[Finding],
) -> Vec<Warning> {
    let mut found = Vec::new();
    let mut warn = |code, text: String| found.push(Warning { code, text });
    let real = counts.real();
    let others = counts.pilots + counts.simulated;
    if others > 0 && real == 0 {
        warn(
            "no-participants",
            format!("only {}: the results are not evidence", who(counts)),
        );
    } else if counts.rows > 0 && counts.real_rows == 0 {
        // All pilots and simulated participants are excluded as well.
        let text = "only pilots or simulated participants: the results are not evidence";
        warn("no-participants", text.to_owned());
    } else if others > 0 {
        warn("mixed", format!("the analysis includes {}", who(counts)));
    }
    let judged = results.evidence.rendering.as_ref().map(|r| &r.judged);
    let judged = judged.and_then(|j| {
        let wrong = j.n_flag.number()? + j.n_fault.number()?;
        Some((j.n_ok.number()?, wrong))
    });
    if let Some((ok, wrong)) = judged.filter(|(_, wrong)| *wrong > 0.0) {
        warn(
            "wrong-force",
            format!(
                "in {wrong} of {} judged trials that count the force was not that of the realization's table",
                ok + wrong
            ),
        );
    }
    if counts.interim() {
        let planned = counts.planned.unwrap_or(0);
        warn(
            "interim",
            format!(
                "interim: {} of {planned} planned participants {} finished; optional stopping \
                 inflates false positives",
                counts.finished,
                if counts.finished == 1 { "has" } else { "have" }
            ),
        );
    }
    // Those of tracks are warnings of their part.
    for change in rules.deviations.iter().filter(|d| d.track.is_none()) {
        let Warning { code, text } = change.warning();
        warn(code, text);
    }
    if counts.participants == 1 && counts.rated > 0 {
        warn(
            "one-participant",
            "only one participant is analyzed: the results do not generalize to other people"
                .to_owned(),
        );
    }
    let changed =
        (rules.deviations.iter()).any(|d| d.affects.contains(&PreregisteredRule::Exclusions));
    excluded(&mut warn, exclusions, changed, results);
    headline(&mut warn, &results.evidence, findings);
    design(&mut warn, cells, results);
    missing(&mut warn, &results.evidence, rules.alpha);
    raters(&mut warn, cells, &results.screening);
    ends(&mut warn, cells, &results.ends);
    found
}

fn who(counts: &Counts) -> String {
    let pilots = counted(counts.pilots, "pilot participant", "pilot participants");
    let simulated = counted(
        counts.simulated,
        "simulated participant",
        "simulated participants",
    );
    match (counts.pilots, counts.simulated) {
        (0, _) => simulated,
        (_, 0) => pilots,
        _ => format!("{pilots} and {simulated}"),
    }
}

fn excluded(
    warn: &mut impl FnMut(&'static str, String),
    exclusions: &[Applied],
    changed: bool,
    results: &Results,
) {
    let later = if changed {
        " (changed after the study began)"
    } else {
        ""
    };
    for e in exclusions {
        if let Some(problem) = e.problem {
            let text = format!("the exclusion rule `{}`{later}: {problem}", e.rule);
            warn("rule-not-judged", text);
        }
        if e.rows > 0 {
            warn(
                "excluded",
                format!(
                    "the exclusion rule `{}`{later} excluded {} of {}",
                    e.rule,
                    counted(e.rows, "row", "rows"),
                    people(e.participants)
                ),
            );
        }
    }
    let before = results.before_exclusion.as_ref();
    let before = before.and_then(|b| b.corr.pearson.r.number());
    if let Some((before, after)) = before.zip(results.evidence.corr.pearson.r.number()) {
        let (before, after) = (apa::r(before), apa::r(after));
        let text = if before == after {
            format!("the exclusions do not change r to three decimals: r = {after}")
        } else {
            format!("without the exclusions r would be {before} instead of {after}: see the tables")
        };
        warn("with-and-without", text);
    }
}

fn headline(
    warn: &mut impl FnMut(&'static str, String),
    evidence: &Evidence,
    findings: &[Finding],
) {
    let is = |question: &Question, verdict: &Verdict| {
        (findings.iter()).any(|f| f.question == *question && f.verdict == *verdict)
    };
    for caveat in findings.iter().flat_map(|f| &f.caveats) {
        if caveat.code == "raw-and-adjusted" {
            warn(caveat.code, caveat.text.clone());
        }
    }
    let correlation = &evidence.corr_adjusted;
    let Some(r) = correlation.pearson.r.number() else {
        return;
    };
    let n = correlation.n();
    if n < ENOUGH_REALIZATIONS {
        warn(
            "few-realizations",
            format!(
                "VAF varies only between the {n} realizations: the correlation rests on {n} points, \
                 whatever the number of participants"
            ),
        );
    }
    let permuted = correlation.trend.is_none();
    if n > MAX_EXACT && permuted {
        warn(
            "monte-carlo",
            format!(
                "the permutation p is estimated from {DRAWS} random orders of the realizations"
            ),
        );
    }
    let left_out = correlation.leave_one_out.as_ref();
    let ends = left_out.and_then(|l| l.pearson_min.number().zip(l.pearson_max.number()));
    if let Some((low, high)) = ends
        && r.abs() >= DRIVEN
        && (low * high <= 0.0 || high - low > 0.5)
    {
        warn(
            "one-realization",
            format!(
                "the correlation is driven by single realizations: with one left out, r lies \
                 between {} and {}",
                apa::r(low),
                apa::r(high)
            ),
        );
    }
    if let Some(rho) = correlation.spearman.as_ref().and_then(|s| s.rho.number())
        && (r - rho).abs() > 0.3
    {
        warn(
            "not-linear",
            format!(
                "r = {} and rho = {} differ: the relation is not linear, or there is an outlier",
                apa::r(r),
                apa::r(rho)
            ),
        );
    }
    if is(&Question::Differ, &Verdict::Yes) && is(&Question::Vaf, &Verdict::NotShown) {
        warn(
            "differ-without-trend",
            "the realizations differ, but a linear relation with VAF is not shown: look at the \
             means, not only at the slope"
                .to_owned(),
        );
    }
    let test = if permuted {
        "the permutation test"
    } else {
        "the test of VAF"
    };
    let text = if evidence.covariates.log10_memory.is_some() {
        format!(
            "{test} assumes exchangeable realizations, and realizations with adjacent \
             lambda are not; the effect of VAF is confounded with lambda and activeness"
        )
    } else {
        format!(
            "{test} assumes exchangeable realizations; the effect of VAF is confounded \
             with everything that correlates with it"
        )
    };
    warn("assumptions", text);
}

fn design(warn: &mut impl FnMut(&'static str, String), cells: &Cells<'_>, results: &Results) {
    let design = Design::of(cells);
    // Participants without any rating are counted at the head of the report.
    let incomplete = design.participants - design.complete;
    if incomplete > 0 && !cells.ratings.models.is_empty() {
        warn(
            "incomplete",
            format!(
                "{} did not rate every test realization{}",
                people(incomplete),
                match (design.uses_complete(), incomplete == 1) {
                    (true, true) => " and is excluded from the comparisons of realizations",
                    (true, false) => " and are excluded from the comparisons of realizations",
                    (false, _) => {
                        ": the comparisons use adjusted means, and what needs complete data (analysis of \
                         variance, Friedman's test) leaves them out"
                    }
                }
            ),
        );
    }
    let sizes: Vec<usize> = cells.cells.iter().map(|c| c.rows.len()).collect();
    if sizes.iter().min() != sizes.iter().max() {
        warn(
            "unbalanced",
            "the cells contain different numbers of ratings: the mean over ratings differs from \
             the mean over participants"
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
                "nobody rated realization {}: it is excluded from all comparisons",
                model.id
            );
            warn("not-rated", text);
        }
        if cells.vaf[m].is_none() && has_vaf[m] {
            warn(
                "vaf-differs",
                format!(
                    "the rows of realization {} have different VAF: it is analyzed without VAF",
                    model.id
                ),
            );
        }
    }
    if !results.screening.screen.listed.is_set() {
        warn(
            "many-participants",
            format!("more than {MAX_LISTED} participants: they are screened but not listed"),
        );
    }
    let normal_limit = &results.over_participants.bootstrap.normal_limit;
    if normal_limit.as_ref().is_some_and(Stat::is_set) {
        warn(
            "normal-limit",
            "with so many participants the bootstrap draws means from their normal limit"
                .to_owned(),
        );
    }
    if r.model.contains(&None) {
        warn("no-model", "some ratings have no realization".to_owned());
    }
}

/// Ratings that are not missing at random.
fn missing(warn: &mut impl FnMut(&'static str, String), evidence: &Evidence, alpha: f64) {
    let Some(missing) = &evidence.missing else {
        return;
    };
    let random =
        "verdicts take missing ratings as missing at random, given participant and realization";
    let shown = |p: &Stat| p.number().filter(|p| rejects(*p, alpha));
    if let Some(p) = shown(&missing.realizations_p) {
        let share = |(name, of): (&'_ RealizationName, &MissingOf)| {
            Some((name.as_str().to_owned(), of.share.number()?))
        };
        let mut shares: Vec<(String, f64)> = missing.realization.iter().filter_map(share).collect();
        shares.small_sort_by(|a, b| a.1.total_cmp(&b.1));
        if let (Some(least), Some(most)) = (shares.first(), shares.last()) {
            warn(
                "missing-by-realization",
                format!(
                    "ratings are missing unequally: {} of {} and {} of {} (p {}); {random}",
                    apa::percent(least.1),
                    least.0,
                    apa::percent(most.1),
                    most.0,
                    apa::p(p)
                ),
            );
        }
    }
    if let Some((slope, p)) = missing.level_slope.number().zip(shown(&missing.level_p)) {
        let level = if slope < 0.0 { "lower" } else { "higher" };
        warn(
            "missing-by-level",
            format!(
                "more ratings are missing of realizations that are rated {level} (p {}); {random}",
                apa::p(p)
            ),
        );
    }
    if let Some((r, p)) = missing.severity_r.number().zip(shown(&missing.severity_p)) {
        let level = if r < 0.0 { "lower" } else { "higher" };
        warn(
            "missing-by-participant",
            format!(
                "participants who rate {level} miss more ratings (r = {}, p {}); realizations are compared within participants",
                apa::r(r),
                apa::p(p)
            ),
        );
    }
}

fn raters(warn: &mut impl FnMut(&'static str, String), cells: &Cells<'_>, screening: &Screening) {
    if cells.ratings.models.len() < 2 {
        return;
    }
    let constant = screening.screen.n_constant.number().unwrap_or(0.0) as usize;
    if constant == 0 {
        return;
    }
    let is_constant =
        |s: &Screened| s.n.number().is_some_and(|n| n > 1.0) && s.distinct.number() == Some(1.0);
    let names = (cells.ratings.subjects.iter())
        .map(|s| s.id.as_str())
        .filter(|id| screening.subject.get(*id).is_some_and(is_constant))
        .take(5);
    let shown = names.collect::<Vec<_>>().join(", ");
    let more = if constant > 5 { ", …" } else { "" };
    warn(
        "constant-rater",
        format!(
            "{} always gave the same rating: {shown}{more} (not excluded)",
            people(constant)
        ),
    );
}

/// Most of the ratings at an end of the scale.
const MOST: f64 = 0.5;

/// Realizations that most ratings put at an end of the scale.
fn ends(
    warn: &mut impl FnMut(&'static str, String),
    cells: &Cells<'_>,
    ends: &BTreeMap<RealizationName, Ends>,
) {
    type Share = fn(&Ends) -> &Stat;
    let (low, high): (Share, Share) = (|e| &e.share_low, |e| &e.share_high);
    for (code, share, end, beyond) in [
        ("floor", low, "lowest", "below"),
        ("ceiling", high, "highest", "above"),
    ] {
        let tested = cells.tested().into_iter().map(|m| cells.model_name(m));
        let most = |name: &&str| {
            share(ends.get(*name)?)
                .number()
                .filter(|share| *share > MOST)
        };
        let names: Vec<&str> = tested.filter(|name| most(name).is_some()).collect();
        if let [first, ..] = names[..] {
            let others = match names.len() - 1 {
                0 => String::new(),
                n => format!(
                    " and {}",
                    counted(n, "other realization", "other realizations")
                ),
            };
            let text = format!(
                "most ratings of {first}{others} are the {end} of the scale: differences {beyond} it \
                 cannot show"
            );
            warn(code, text);
        }
    }
}

fn people(n: usize) -> String {
    counted(n, "participant", "participants")
}
