//! Do the realizations differ?

use super::{Estimate, Facts, Finding, Question, Test, TestKind};
use crate::analyze::effects::MAX_COLUMNS;
use study_base::apa;
use study_base::text::counted;
use study_stats::level::rejects;

/// The tests that can decide, chosen by the design.
fn chosen(facts: &Facts<'_>) -> TestKind {
    let d = facts.design;
    match (d.complete, d.realizations) {
        _ if !d.uses_complete() => TestKind::MixedModel,
        (_, 2) => TestKind::Anova,
        (2, _) => TestKind::FriedmanExact,
        (_, k) if k > MAX_COLUMNS => TestKind::Friedman,
        (s, k) if s <= k => TestKind::AnovaHuynhFeldt,
        _ => TestKind::AnovaGreenhouseGeisser,
    }
}

pub(super) fn differ(facts: &Facts<'_>) -> Option<Finding> {
    let d = facts.design;
    if d.realizations == 0 {
        return None;
    }
    let undefined = |why: &str| Some(Finding::undefined(Question::Differ, why, d));
    if d.realizations == 1 {
        return undefined("there is only one realization");
    }
    if d.participants < 2 {
        return undefined("there is only one participant");
    }
    let kind = chosen(facts);
    let found = test(facts, kind).or_else(|| match kind {
        // No variance of error, or too many orders for the exact distribution.
        TestKind::FriedmanExact => test(facts, TestKind::Friedman),
        _ => test(facts, TestKind::FriedmanExact).filter(|_| d.uses_complete()),
    });
    let Some(test) = found else {
        let id = match kind {
            TestKind::MixedModel => "lmm_cells/p",
            TestKind::Friedman | TestKind::FriedmanExact => "friedman/p",
            _ => "rmanova/p",
        };
        return undefined(facts.values.reason(id).unwrap_or("there is no test"));
    };
    let used = test.kind;
    let mut found = Finding::decided(Question::Differ, test, d);
    found.participants = d.analyzed();
    let effect = match used {
        TestKind::FriedmanExact | TestKind::Friedman => Some(("Kendall's W", "friedman/kendall_W")),
        TestKind::MixedModel => None,
        _ => Some(("generalized eta squared", "rmanova/ges")),
    };
    found.effect = effect.and_then(|(name, id)| Estimate::of(name, facts.number(id)?));
    if used == TestKind::MixedModel {
        let complete = match d.complete {
            0 => "none".to_owned(),
            n => n.to_string(),
        };
        found.caveat(
            "mixed-model",
            format!(
                "{complete} of {} rated every realization; the mixed model uses the ratings of all, \
                 and assumes that ratings are missing at random and that all pairs of realizations \
                 correlate alike",
                counted(d.participants, "participant", "participants")
            ),
        );
        if facts.number("lmm_cells/connected") == Some(0.0) {
            found.caveat(
                "not-connected",
                "no participants link all realizations: some are compared only between different \
                 participants",
            );
        }
    } else if d.complete < d.participants {
        found.caveat(
            "complete-only",
            format!(
                "{} of {} rated every realization; the others are left out of the comparison",
                d.complete,
                counted(d.participants, "participant", "participants")
            ),
        );
    }
    if used != kind {
        found.caveat(
            "no-error",
            "the ratings leave no variance of error, so that F is undefined; Friedman's test decides",
        );
    }
    if let Some(least) = smallest_friedman(d.complete, d.realizations)
        .filter(|p| used == TestKind::FriedmanExact && !rejects(*p, facts.rules.alpha))
    {
        found.caveat(
            "too-few",
            format!(
                "with two participants and {} realizations Friedman's test cannot give a p below {}",
                d.realizations,
                apa::bare_p(least)
            ),
        );
    }
    Some(found)
}

/// The smallest exact p of Friedman's test for two participants: both rank alike, 1/k!.
fn smallest_friedman(participants: usize, k: usize) -> Option<f64> {
    (participants == 2).then(|| 1.0 / (2..=k).map(|i| i as f64).product::<f64>())
}

fn test(facts: &Facts<'_>, kind: TestKind) -> Option<Test> {
    let get = |id: &str| facts.number(id);
    let alpha = facts.rules.alpha;
    let anova = |p: &str, epsilon: f64| {
        let f = get("rmanova/F")?;
        let df = |id: &str| get(id).map(|df| df * epsilon);
        let test = Test::single(kind, get(p)?, alpha);
        Some(test.with("F", Some(f), &[df("rmanova/df1"), df("rmanova/df2")]))
    };
    let friedman = |p: &str| {
        let test = Test::single(kind, get(p)?, alpha);
        Some(test.with("χ²", get("friedman/chi2"), &[get("friedman/df")]))
    };
    match kind {
        TestKind::Anova => anova("rmanova/p", 1.0),
        TestKind::AnovaGreenhouseGeisser => anova("rmanova/p_gg", get("rmanova/eps_gg")?),
        TestKind::AnovaHuynhFeldt => {
            anova("rmanova/p_hf", get("rmanova/eps_hf_unclipped")?.min(1.0))
        }
        TestKind::MixedModel => Some(Test::single(kind, get("lmm_cells/p")?, alpha).with(
            "F",
            get("lmm_cells/F"),
            &[get("lmm_cells/df1"), get("lmm_cells/df2")],
        )),
        TestKind::FriedmanExact => friedman("friedman/exact_p"),
        TestKind::Friedman => {
            let p = get("friedman/iman_davenport_p").or_else(|| get("friedman/p"))?;
            Some(Test::single(kind, p, alpha).with(
                "χ²",
                get("friedman/chi2"),
                &[get("friedman/df")],
            ))
        }
        _ => None,
    }
}
