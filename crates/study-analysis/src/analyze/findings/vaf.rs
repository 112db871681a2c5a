//! Does VAF predict the rating?

use super::{Design, Direction, Estimate, Facts, Finding, Question, Test, TestKind, Verdict};
use crate::analyze::Rules;
use crate::analyze::cells::Cells;
use crate::analyze::rendering::NO_RECORDING;
use crate::analyze::results::{
    Correlation, EquivalenceOfVaf, Influence, Interval, Number as _, Pearson, Trend,
};
use study_base::apa;
use study_base::text::counted;
use study_stats::level::rejects;

/// What the finding about VAF rests on.
pub(in crate::analyze) struct AboutVaf<'a> {
    /// Decides: the correlation with the adjusted means, which are the means over
    /// participants if no cell is missing.
    pub(in crate::analyze) adjusted: &'a Correlation,
    /// For caveats: the correlation with the means as they are, and equivalence.
    pub(in crate::analyze) beside: Option<(&'a Correlation, &'a EquivalenceOfVaf)>,
    /// For caveats: on whom and on what it hangs.
    pub(in crate::analyze) influence: Option<&'a Influence>,
}

/// The finding about VAF; `None` if no realization has one.
pub(in crate::analyze) fn vaf(
    cells: &Cells<'_>,
    design: Design,
    rules: &Rules,
    about: &AboutVaf<'_>,
) -> Option<Finding> {
    let with_vaf = cells
        .tested()
        .into_iter()
        .filter(|&m| cells.vaf[m].is_some());
    let n = with_vaf.count();
    if n == 0 {
        return None;
    }
    let pearson = &about.adjusted.pearson;
    let mut found = correlation(Question::Vaf, about.adjusted, n, design, rules.alpha);
    if let Some((_, equivalence)) = about.beside {
        equivalent(equivalence, rules.alpha, &mut found);
    }
    if about.adjusted.trend.is_none() {
        too_few(pearson, rules.alpha, &mut found);
    }
    interval_and_p(rules.alpha, &mut found);
    if let Some(influence) = about.influence {
        one_realization(influence, about.adjusted, &mut found);
        let least = pearson
            .permuted
            .as_ref()
            .and_then(|p| p.smallest_p_two_sided.number());
        let possible =
            about.adjusted.trend.is_some() || least.is_some_and(|p| rejects(p, rules.alpha));
        if possible {
            one_participant(influence, rules.alpha, &mut found);
        }
    }
    if let Some((raw, _)) = about.beside.filter(|_| !design.is_complete()) {
        raw_and_adjusted(&raw.pearson, pearson, rules.alpha, &mut found);
    }
    Some(found)
}

/// The finding about a correlation over `n` realizations.
fn correlation(
    question: Question,
    correlation: &Correlation,
    n: usize,
    design: Design,
    alpha: f64,
) -> Finding {
    let pearson = &correlation.pearson;
    let r = pearson.r.number();
    let decided = match &correlation.trend {
        Some(trend) => (trend.slope.number()).zip(weighted(trend, alpha)),
        None => r.zip(permutation(pearson, alpha)),
    };
    let found = match decided {
        Some((slope, test)) => Finding {
            direction: Some(Direction::of(slope)).filter(|_| test.is_significant()),
            ..Finding::decided(question, test, design)
        },
        None => {
            let of_trend = correlation.trend.as_ref().and_then(|t| t.p.reason());
            let why = pearson.r.reason().or(of_trend);
            let why = why.unwrap_or("the permutation test is undefined");
            Finding::undefined(question, why, design)
        }
    };
    // Fisher's z takes the means as equally precise.
    let equal = correlation.trend.is_none();
    let weighted_r = correlation.trend.as_ref().and_then(|t| t.r.number());
    Finding {
        realizations: n,
        estimate: (weighted_r.or(r)).map(|value| Estimate {
            name: "r",
            value,
            ci95: (pearson.ci95.as_ref().filter(|_| equal)).and_then(Interval::ends),
        }),
        ..found
    }
}

/// Does the delivered VAF predict the rating? Asked where playbacks were judged.
pub(super) fn delivered(facts: &Facts<'_>) -> Option<Finding> {
    let delivered = &facts.evidence.rendering.as_ref()?.correlation;
    let n = delivered.n();
    if n == 0 {
        return Some(Finding {
            realizations: n,
            ..Finding::undefined(Question::Delivered, NO_RECORDING, facts.design)
        });
    }
    let alpha = facts.rules.alpha;
    let mut found = correlation(Question::Delivered, delivered, n, facts.design, alpha);
    if delivered.trend.is_none() {
        too_few(&delivered.pearson, alpha, &mut found);
    }
    Some(found)
}

/// The test of the slope of weighted means.
fn weighted(trend: &Trend, alpha: f64) -> Option<Test> {
    let test = Test::single(TestKind::WeightedTrend, trend.p.number()?, alpha);
    Some(test.with("t", trend.t.number(), &[trend.df.number()]))
}

/// The permutation test of a correlation over realizations.
pub(in crate::analyze) fn permutation(pearson: &Pearson, alpha: f64) -> Option<Test> {
    let r = pearson.r.number()?;
    let (p, exact) = pearson.permuted.as_ref()?.two_sided()?;
    let kind = if exact {
        TestKind::PermutationExact
    } else {
        TestKind::PermutationMonteCarlo
    };
    Some(Test::single(kind, p, alpha).with("r", Some(r), &[]))
}

/// Says so if no order of the realizations gives a small p.
fn too_few(pearson: &Pearson, alpha: f64, found: &mut Finding) {
    let least = pearson.permuted.as_ref();
    let least = least.and_then(|p| p.smallest_p_two_sided.number());
    if let Some(least) = least.filter(|p| !rejects(*p, alpha)) {
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

/// Says so if nothing is shown and the effect of VAF is shown to be small.
fn equivalent(equivalence: &EquivalenceOfVaf, alpha: f64, found: &mut Finding) {
    if found.verdict != Verdict::NotShown {
        return;
    }
    let effect = equivalence.vaf.as_ref();
    let effect = effect.and_then(|e| e.p.number().zip(e.margin.number()));
    if let Some((p, margin)) = effect.filter(|(p, _)| rejects(*p, alpha)) {
        found.caveat(
            "equivalent",
            format!(
                "from the lowest to the highest VAF the rating changes by less than {margin} points \
                 (two one-sided t tests, p {})",
                apa::p_beside(p, alpha)
            ),
        );
    }
    let r = equivalence.r.as_ref();
    let r = r.and_then(|e| e.p.number().zip(e.margin.number()));
    if let Some((p, margin)) = r.filter(|(p, _)| rejects(*p, alpha)) {
        found.caveat(
            "equivalent-r",
            format!(
                "the correlation is within ± {} (two one-sided tests by Fisher's z, p {})",
                apa::share(margin, 2),
                apa::p_beside(p, alpha)
            ),
        );
    }
}

fn interval_and_p(alpha: f64, found: &mut Finding) {
    let interval = found.estimate.and_then(|e| e.ci95);
    if let (Some((low, high)), Some(test)) = (interval, &found.test)
        && (low * high > 0.0) != test.is_significant()
        && (alpha - 0.05).abs() < 1e-12
    {
        found.caveat(
            "interval-and-p",
            "the confidence interval and p disagree: the interval (Fisher's z) assumes normally \
             distributed VAF and means, the permutation test does not; rely on p",
        );
    }
}

/// A realization with this leverage decides alone where the line goes.
const FAR: f64 = 0.9;

/// Says so if the VAF of one realization is far from all others. Three realizations always have one.
fn one_realization(influence: &Influence, correlation: &Correlation, found: &mut Finding) {
    let far = (influence.leverage.iter())
        .filter_map(|(name, h)| Some((name, h.number()?)))
        .find(|(_, h)| *h >= FAR && influence.leverage.len() > 3);
    let Some((name, leverage)) = far else {
        return;
    };
    let without = correlation.leave_one_out.as_ref();
    let without = without.and_then(|all| all.without.get(name.as_str())?.pearson.number());
    let without = without.map_or_else(String::new, |r| {
        format!("; over the others r = {}", apa::r(r))
    });
    found.caveat(
        "far-realization",
        format!(
            "the VAF of {} is far from all others, so that a relation would rest on this realization (leverage {}){without}",
            name.as_str(),
            apa::share(leverage, 2)
        ),
    );
}

/// Says so if the answer turns without one participant.
fn one_participant(influence: &Influence, alpha: f64, found: &mut Finding) {
    let yes = found.verdict == Verdict::Yes;
    let agrees = |p: f64| rejects(p, alpha) == yes;
    // Only where the test that is repeated says the same of everybody.
    if found.reason().is_some() || !influence.p_with_all.number().is_some_and(agrees) {
        return;
    }
    let turning: Vec<(&str, f64)> = (influence.p_without.iter())
        .filter_map(|(name, p)| Some((name.as_str(), p.number()?)))
        .filter(|(_, p)| !agrees(*p))
        .collect();
    let Some((name, p)) = turning.first() else {
        return;
    };
    let it = if yes {
        "it is not shown"
    } else {
        "it is shown"
    };
    let more = match turning.len() - 1 {
        0 => String::new(),
        n => format!(
            ", and so without any other of {}",
            counted(n, "participant", "participants")
        ),
    };
    found.caveat(
        "one-participant-turns-it",
        format!(
            "without {name} {it} (t test, p {}){more}",
            apa::p_beside(*p, alpha)
        ),
    );
}

/// Says so if the means as they are lead to another conclusion.
fn raw_and_adjusted(raw: &Pearson, adjusted: &Pearson, alpha: f64, found: &mut Finding) {
    let p = [raw, adjusted].map(|pearson| Some((pearson.r.number()?, pearson.p_t.number()?)));
    if let [Some((raw, raw_p)), Some((r, p))] = p
        && (raw * r < 0.0 || rejects(raw_p, alpha) != rejects(p, alpha))
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
