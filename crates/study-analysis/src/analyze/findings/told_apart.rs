//! What the design cannot tell apart, whatever the ratings are: realizations that no participants
//! link, and realizations that everybody felt in the same order.

use super::{Finding, Pair, Question, Verdict};
use crate::analyze::cells::{Cell, Cells};
use crate::analyze::results::{Evidence, Number as _};
use crate::analyze::same_order::Orders;
use study_base::apa;
use study_base::text::counted;
use study_stats::within::linked_sets;

/// Takes back the verdicts of questions that the design cannot answer. Means, differences and
/// correlations stay.
pub(super) fn withdraw(
    cells: &Cells<'_>,
    evidence: &Evidence,
    findings: &mut [Finding],
    pairs: &mut [Pair],
) {
    let sets = sets(cells, evidence);
    let not_linked = |of_vaf: bool| not_linked(cells, &sets, of_vaf);
    let (vaf, all) = (not_linked(true), not_linked(false));
    let one_order = one_order(cells);
    for found in findings {
        let why = match found.question {
            Question::Vaf | Question::Delivered | Question::Memory => {
                vaf.as_ref().or(one_order.as_ref())
            }
            Question::Best | Question::Differ => all.as_ref().or(one_order.as_ref()),
            Question::Effect(_)
            | Question::Pairs
            | Question::Reference(_)
            | Question::Equivalence(_) => one_order.as_ref(),
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

/// Sets of realizations that participants link, by their indices: those that at least two participants rated.
/// What one person alone rated is no part of a comparison.
fn sets(cells: &Cells<'_>, evidence: &Evidence) -> Vec<Vec<usize>> {
    let sets = &evidence.cells.within.sets;
    if sets.number().is_none_or(|sets| sets <= 1.0) {
        return Vec::new();
    }
    let models = cells.tested();
    let people: Vec<Vec<usize>> = (cells.cells.chunk_by(|a, b| a.subject == b.subject))
        .map(|own| {
            let place = |c: &Cell| models.binary_search(&c.model).ok();
            own.iter().filter_map(place).collect()
        })
        .collect();
    let set_of = linked_sets(&people, models.len());
    let raters = |set: usize| {
        let of_set = |own: &&Vec<usize>| own.first().is_some_and(|at| set_of[*at] == set);
        people.iter().filter(of_set).count()
    };
    let members = |set: usize| {
        let all = models.iter().zip(&set_of).filter(|(_, of)| **of == set);
        all.map(|(model, _)| *model).collect()
    };
    (0..models.len())
        .filter(|set| raters(*set) > 1)
        .map(members)
        .collect()
}

/// Says so if no participants link all realizations, or all with a VAF.
fn not_linked(cells: &Cells<'_>, sets: &[Vec<usize>], of_vaf: bool) -> Option<String> {
    let counts = |set: &&Vec<usize>| !of_vaf || set.iter().any(|m| cells.vaf[*m].is_some());
    let n = sets.iter().filter(counts).count();
    (n > 1).then(|| {
        format!(
            "the realizations fall into {} that no participant links, so that a difference between them may \
             be one between participants; let some participants rate realizations of several sets",
            counted(n, "set", "sets")
        )
    })
}

/// Says so if everybody felt the realizations in the same order.
fn one_order(cells: &Cells<'_>) -> Option<String> {
    let orders = Orders::of(cells).filter(|orders| orders.are_one())?;
    let alike = match orders.share >= 1.0 - 1e-9 {
        true => "everybody felt the realizations in the same order".to_owned(),
        false => format!(
            "the realizations were felt in much the same order, which explains {} of the positions",
            apa::percent(orders.share)
        ),
    };
    Some(format!(
        "{alike} (p {} with random orders), so that a difference between them may be one of time, such as \
         practice or fatigue; present them in several orders (if the column of the trials numbers the rows of a \
         table, leave it out)",
        apa::p(orders.chance)
    ))
}
