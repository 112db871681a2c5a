//! Do the sites agree?

use super::{Estimate, Facts, Finding, Question, Test, TestKind};
use crate::analyze::results::{Number as _, SiteLevels, SiteProfiles, SiteTest, Stat};
use study_base::text::counted;

/// Level, pattern and effect of VAF by site; nothing in a study of one site.
pub(super) fn sites(facts: &Facts<'_>) -> Vec<Finding> {
    let Some(sites) = &facts.evidence.sites else {
        return Vec::new();
    };
    let mut found = vec![profiles(facts, &sites.realizations)];
    if has_vaf(facts) {
        let levels = &sites.vaf.levels;
        found.push(level(
            facts,
            Question::SiteVaf,
            levels,
            "difference of slopes",
        ));
    }
    found.push(level(
        facts,
        Question::SiteLevel,
        &sites.level,
        "difference",
    ));
    found
}

fn has_vaf(facts: &Facts<'_>) -> bool {
    let cells = facts.cells;
    cells.tested().into_iter().any(|m| cells.vaf[m].is_some())
}

/// Whether the realizations differ alike at all sites, with the correction of both degrees of
/// freedom.
fn profiles(facts: &Facts<'_>, found: &SiteProfiles) -> Finding {
    let epsilon = found.eps_gg.number().unwrap_or(1.0);
    let kind = TestKind::BetweenWithin;
    decided(
        facts,
        Question::SiteRealizations,
        kind,
        (&found.test, &found.p_gg),
        epsilon,
    )
}

/// Whether the sites differ in one number of each participant.
fn level(facts: &Facts<'_>, question: Question, found: &SiteLevels, name: &'static str) -> Finding {
    let test = (&found.test, &found.test.p);
    let decided = decided(facts, question, TestKind::BetweenSites, test, 1.0);
    let estimate = found.difference.difference.number().map(|value| Estimate {
        name,
        value,
        ci95: found.difference.difference_ci95.ends(),
    });
    Finding {
        estimate: estimate.filter(|_| decided.test.is_some()),
        ..decided
    }
}

fn decided(
    facts: &Facts<'_>,
    question: Question,
    kind: TestKind,
    (found, p): (&SiteTest, &Stat),
    epsilon: f64,
) -> Finding {
    let design = facts.design;
    let Some(value) = p.number() else {
        let why = p.reason().unwrap_or("there is no test");
        return Finding::undefined(question, why, design);
    };
    let df = [&found.df1, &found.df2].map(|df| df.number().map(|df| df * epsilon));
    let test = Test::single(kind, value, facts.rules.alpha).with("F", found.f.number(), &df);
    let pes = found.pes.number();
    let mut found = Finding::decided(question, test, design);
    found.participants = design.complete;
    found.effect = pes.and_then(|e| Estimate::of("partial eta squared", e));
    if design.complete < design.participants {
        found.caveat(
            "complete-only",
            format!(
                "{} of {} rated every realization; the others are left out of the comparison of sites",
                design.complete,
                counted(design.participants, "participant", "participants")
            ),
        );
    }
    found
}
