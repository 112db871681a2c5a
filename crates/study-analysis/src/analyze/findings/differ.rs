//! Do the realizations differ?

use super::{Compared, Estimate, Finding, Question, Test, TestKind};
use crate::analyze::effects::MAX_COLUMNS;
use crate::analyze::results::{Differences, Number as _};
use study_base::apa;
use study_base::text::counted;
use study_stats::level::rejects;

/// The tests that can decide, chosen by the design.
fn chosen(facts: &Compared<'_>) -> TestKind {
    let d = facts.design;
    match (d.complete, d.realizations) {
        _ if !d.uses_complete() => TestKind::WithinParticipants,
        (_, 2) => TestKind::Anova,
        (2, _) => TestKind::FriedmanExact,
        (_, k) if k > MAX_COLUMNS => TestKind::Friedman,
        (s, k) if s <= k => TestKind::AnovaHuynhFeldt,
        _ => TestKind::AnovaGreenhouseGeisser,
    }
}

pub(super) fn differ(facts: &Compared<'_>) -> Option<Finding> {
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
    let Differences {
        friedman, rmanova, ..
    } = facts.differences;
    let cells = facts.cells;
    let Some(test) = found else {
        let p = match kind {
            TestKind::WithinParticipants => {
                (cells.clustered.as_ref()).map_or(&cells.within.p, |c| c.deciding(d).1)
            }
            TestKind::Friedman | TestKind::FriedmanExact => &friedman.p,
            _ => &rmanova.p,
        };
        return undefined(p.reason().unwrap_or("there is no test"));
    };
    let used = test.kind;
    let mut found = Finding::decided(Question::Differ, test, d);
    found.participants = d.analyzed();
    let effect = match used {
        TestKind::FriedmanExact | TestKind::Friedman => {
            Some(("Kendall's W", friedman.kendall_w.number()))
        }
        TestKind::WithinParticipants => None,
        _ => Some(("generalized eta squared", rmanova.ges.number())),
    };
    found.effect = effect.and_then(|(name, value)| Estimate::of(name, value?));
    if used == TestKind::WithinParticipants {
        let alike = match cells.clustered {
            Some(_) => "",
            None => " and that all pairs of realizations correlate alike",
        };
        let complete = match d.complete {
            0 => "none".to_owned(),
            n => n.to_string(),
        };
        found.caveat(
            "within-participants",
            format!(
                "{complete} of {} rated every realization; realizations are compared within \
                 participants, by the ratings of all, assuming that what is missing does not depend on \
                 what the rating would have been{alike}",
                counted(d.participants, "participant", "participants")
            ),
        );
        let left_out = cells.clustered.as_ref().and_then(|c| c.left_out.number());
        if let Some(n) = left_out.filter(|n| *n > 0.0) {
            found.caveat(
                "one-participant-links",
                format!(
                    "{} between realizations that one participant alone links {} left out, because nothing shows \
                     how much others would vary about it; let more participants rate both",
                    counted(n as usize, "difference", "differences"),
                    if n > 1.0 { "are" } else { "is" }
                ),
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

fn test(facts: &Compared<'_>, kind: TestKind) -> Option<Test> {
    let Differences {
        friedman, rmanova, ..
    } = facts.differences;
    let alpha = facts.rules.alpha;
    let of_anova = |p: Option<f64>, epsilon: f64| {
        let f = rmanova.f.number()?;
        let df = [&rmanova.df1, &rmanova.df2].map(|df| df.number().map(|df| df * epsilon));
        Some(Test::single(kind, p?, alpha).with("F", Some(f), &df))
    };
    let of_friedman = |p: Option<f64>| {
        let test = Test::single(kind, p?, alpha);
        Some(test.with("χ²", friedman.chi2.number(), &[friedman.df.number()]))
    };
    match kind {
        TestKind::Anova => of_anova(rmanova.p.number(), 1.0),
        TestKind::AnovaGreenhouseGeisser => {
            of_anova(rmanova.p_gg.number(), rmanova.eps_gg.number()?)
        }
        TestKind::AnovaHuynhFeldt => of_anova(
            rmanova.p_hf.number(),
            rmanova.eps_hf_unclipped.number()?.min(1.0),
        ),
        TestKind::WithinParticipants => {
            let cells = facts.cells;
            let equal = &cells.within;
            let (f, df, p, epsilon) = match &cells.clustered {
                Some(own) => {
                    let (epsilon, p) = own.deciding(facts.design);
                    (&own.f, [&own.df1, &own.df2], p, epsilon.number()?)
                }
                None => (&equal.f, [&equal.df1, &equal.df2], &equal.p, 1.0),
            };
            let df = df.map(|df| df.number().map(|df| df * epsilon));
            Some(Test::single(kind, p.number()?, alpha).with("F", f.number(), &df))
        }
        TestKind::FriedmanExact => of_friedman(friedman.exact_p.number()),
        TestKind::Friedman => {
            let p = friedman.iman_davenport_p.number();
            of_friedman(p.or_else(|| friedman.p.number()))
        }
        _ => None,
    }
}
