//! Does VAF predict the rating?

use super::{Direction, Estimate, Facts, Finding, Question, Test, TestKind, Verdict};
use crate::analyze::values::Values;
use study_base::apa;
use study_stats::level::rejects;

/// The group of statistics that decides: correlations with adjusted means, which are the
/// means over participants if no cell is missing.
const DECIDING: &str = "corr_adjusted";

pub(super) fn vaf(facts: &Facts<'_>) -> Option<Finding> {
    let cells = facts.cells;
    let with_vaf = cells
        .tested()
        .into_iter()
        .filter(|&m| cells.vaf[m].is_some());
    let n = with_vaf.count();
    if n == 0 {
        return None;
    }
    let mut found = correlation(facts, Question::Vaf, DECIDING, n);
    caveats(facts, &mut found);
    Some(found)
}

/// The finding about a correlation over `n` realizations, from the statistics of a group.
fn correlation(facts: &Facts<'_>, question: Question, group: &str, n: usize) -> Finding {
    let id = |what: &str| format!("{group}/pearson/{what}");
    let found = decided(facts, question.clone(), group).unwrap_or_else(|| {
        let why = facts.values.reason(&id("r"));
        let why = why.unwrap_or("the permutation test is undefined");
        Finding::undefined(question, why, facts.design)
    });
    Finding {
        realizations: n,
        estimate: facts.number(&id("r")).map(|value| Estimate {
            name: "r",
            value,
            ci95: facts.values.interval(&id("ci95")),
        }),
        ..found
    }
}

/// Does the delivered VAF predict the rating? Asked where playbacks were judged.
pub(super) fn delivered(facts: &Facts<'_>) -> Option<Finding> {
    const GROUP: &str = "corr_delivered";
    let n = facts.number(&format!("{GROUP}/n_models"));
    if n.is_none() && facts.values.get(&format!("{GROUP}/pearson/r")).is_none() {
        return None;
    }
    let n = n.unwrap_or(0.0) as usize;
    if n == 0 {
        let why = super::super::rendering::NO_RECORDING;
        return Some(Finding {
            realizations: n,
            ..Finding::undefined(Question::Delivered, why, facts.design)
        });
    }
    let mut found = correlation(facts, Question::Delivered, GROUP, n);
    too_few(facts, GROUP, &mut found);
    Some(found)
}

fn decided(facts: &Facts<'_>, question: Question, group: &str) -> Option<Finding> {
    let test = permutation(facts.values, group, facts.rules.alpha)?;
    let r = facts.number(&format!("{group}/pearson/r"))?;
    let direction = Some(Direction::of(r)).filter(|_| test.is_significant());
    Some(Finding {
        direction,
        ..Finding::decided(question, test, facts.design)
    })
}

/// The permutation test of the correlation over realizations in a group of statistics.
pub(in crate::analyze) fn permutation(values: &Values, group: &str, alpha: f64) -> Option<Test> {
    let of = |what: &str| values.number(&format!("{group}/pearson/{what}"));
    let r = of("r")?;
    let exact = of("p_exact_two_sided").map(|p| (TestKind::PermutationExact, p));
    let random = || of("p_monte_carlo_two_sided").map(|p| (TestKind::PermutationMonteCarlo, p));
    let (kind, p) = exact.or_else(random)?;
    Some(Test::single(kind, p, alpha).with("r", Some(r), &[]))
}

/// Says so if no order of the realizations gives a small p.
fn too_few(facts: &Facts<'_>, group: &str, found: &mut Finding) {
    let least = facts.number(&format!("{group}/pearson/smallest_p_two_sided"));
    if let Some(least) = least.filter(|p| !rejects(*p, facts.rules.alpha)) {
        found.caveat(
            "too-few",
            format!(
                "with these {} realizations no p below {} is possible",
                found.realizations,
                apa::bare_p(least)
            ),
        );
    }
}

fn caveats(facts: &Facts<'_>, found: &mut Finding) {
    let alpha = facts.rules.alpha;
    if let (Some(p), Some(margin), Verdict::NotShown) = (
        facts.number("equivalence/vaf/p"),
        facts.number("equivalence/vaf/margin"),
        &found.verdict,
    ) && rejects(p, alpha)
    {
        found.caveat(
            "equivalent",
            format!(
                "from the lowest to the highest VAF the rating changes by less than {margin} points \
                 (two one-sided t tests, p {})",
                apa::p_beside(p, alpha)
            ),
        );
    }
    if let (Some(p), Some(margin), Verdict::NotShown) = (
        facts.number("equivalence/r/p"),
        facts.number("equivalence/r/margin"),
        &found.verdict,
    ) && rejects(p, alpha)
    {
        found.caveat(
            "equivalent-r",
            format!(
                "the correlation is within ± {} (two one-sided tests by Fisher's z, p {})",
                apa::share(margin, 2),
                apa::p_beside(p, alpha)
            ),
        );
    }
    too_few(facts, DECIDING, found);
    let of = |what: &str| facts.number(&format!("{DECIDING}/pearson/{what}"));
    if let (
        Some(Estimate {
            ci95: Some((low, high)),
            ..
        }),
        Some(test),
    ) = (found.estimate, &found.test)
        && (low * high > 0.0) != test.is_significant()
        && (alpha - 0.05).abs() < 1e-12
    {
        found.caveat(
            "interval-and-p",
            "the confidence interval and p disagree: the interval (Fisher's z) assumes normally \
             distributed VAF and means, the permutation test does not; rely on p",
        );
    }
    let raw = facts.number("corr/pearson/r");
    let raw_p = ["exact", "monte_carlo"].map(|kind| format!("corr/pearson/p_{kind}_two_sided"));
    let raw_p = raw_p.iter().find_map(|id| facts.number(id));
    if let (Some(raw), Some(r), Some(raw_p), Some(test), false) =
        (raw, of("r"), raw_p, &found.test, facts.design.is_complete())
        && (raw * r < 0.0 || rejects(raw_p, alpha) != test.is_significant())
    {
        found.caveat(
            "raw-and-adjusted",
            format!(
                "participants did not all rate the same realizations; the means as they are \
                 correlate at r = {} (p {}), the adjusted means, on which this rests, at r = {}",
                apa::r(raw),
                apa::p(raw_p),
                apa::r(r)
            ),
        );
    }
}
