//! What the design cannot tell apart, whatever the ratings are: realizations that no participants
//! link, and realizations that everybody felt in the same order.

use super::{Finding, Pair, Question, Verdict};
use crate::analyze::cells::Cells;
use crate::analyze::results::{Evidence, Number as _};
use crate::analyze::same_order;
use study_base::apa;
use study_base::text::counted;

/// Takes back the verdicts of questions that the design cannot answer. Means, differences and
/// correlations stay.
pub(super) fn withdraw(
    cells: &Cells<'_>,
    evidence: &Evidence,
    findings: &mut [Finding],
    pairs: &mut [Pair],
) {
    let not_linked = not_linked(evidence);
    let one_order = one_order(cells);
    for found in findings {
        let why = match found.question {
            Question::Vaf
            | Question::Delivered
            | Question::Memory
            | Question::Best
            | Question::Differ => not_linked.as_ref().or(one_order.as_ref()),
            Question::Pairs | Question::Reference(_) | Question::Equivalence(_) => {
                one_order.as_ref()
            }
            Question::Disagreement
            | Question::Order
            | Question::CarryOver
            | Question::Repeat(_)
            | Question::SiteRealizations
            | Question::SiteVaf
            | Question::SiteLevel => None,
        };
        // Without an estimate there is another reason, which comes first.
        if let Some(why) = why.filter(|_| found.reason().is_none() || found.estimate.is_some()) {
            found.verdict = Verdict::Undefined(why.clone());
            found.test = None;
            found.direction = None;
            found.caveats.clear();
        }
    }
    if let Some(why) = one_order {
        for pair in pairs {
            pair.verdict = Verdict::Undefined(why.clone());
            pair.test = None;
            pair.equivalence = None;
        }
    }
}

/// Says so if no participants link all realizations.
fn not_linked(evidence: &Evidence) -> Option<String> {
    let sets = evidence
        .cells
        .within
        .sets
        .number()
        .filter(|sets| *sets > 1.0)? as usize;
    Some(format!(
        "the realizations fall into {} that no participant links, so that a difference between them may \
         be one between participants; let some participants rate realizations of several sets",
        counted(sets, "set", "sets")
    ))
}

/// Says so if everybody felt the realizations in the same order.
fn one_order(cells: &Cells<'_>) -> Option<String> {
    let chance = same_order::chance(cells).filter(|chance| *chance <= same_order::LEAST_CHANCE)?;
    Some(format!(
        "everybody felt the realizations in the same order (p {} with random orders), so that a difference \
         between them may be one of time, such as practice or fatigue; present them in several orders",
        apa::p(chance)
    ))
}
