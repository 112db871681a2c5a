//! Parts of similarity from which there is no map, or one that says little.

use crate::protocol::similarity::unconnected;
use crate::protocol::{Part, Protocol, Similarity, Task};
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, counted};
use study_stats::similarity::dimensions::{MOST_OBJECTS, most};

/// The fewest realizations of a map of so many dimensions.
fn fewest(dimensions: usize) -> usize {
    (0..MOST_OBJECTS)
        .find(|n| most(*n) >= dimensions)
        .unwrap_or(MOST_OBJECTS)
}

/// All doubts about a part.
pub(super) fn doubts(protocol: &Protocol, part: &Part) -> Vec<Fault> {
    let Task::Similarity(own) = &part.task else {
        return Vec::new();
    };
    let all = [
        size(part, own),
        one_sided(part, own),
        pairs(protocol, part, own),
    ];
    all.into_iter().flatten().collect()
}

/// Too few realizations for a map that more than chance decides, or too many.
fn size(part: &Part, own: &Similarity) -> Option<Fault> {
    let (n, line, plane) = (own.models.len(), fewest(1), fewest(2));
    let (what, hint) = match n {
        _ if n < line => (
            format!("there is no map of fewer than {line}"),
            "add realizations, or levels of a family",
        ),
        _ if n < plane => (
            format!("a map of fewer than {plane} has one dimension"),
            "add realizations, or levels of a family",
        ),
        _ if n > MOST_OBJECTS => (
            format!("there is no map of more than {MOST_OBJECTS}"),
            "leave some out, or make two parts",
        ),
        _ => return None,
    };
    let what = format!("the part `{}` has {n} realizations: {what}", part.id);
    Some(Fault::warning(what).hint(hint))
}

/// Pairs that nobody rates in both orders equally often.
fn one_sided(part: &Part, own: &Similarity) -> Option<Fault> {
    (own.repetitions % 2 == 1).then(|| {
        let what = format!(
            "`repetitions = {}`: nobody has both orders of a pair of `{}` equally often",
            own.repetitions, part.id
        );
        Fault::warning(what).hint("take an even number; the orders are balanced over two rows")
    })
}

/// Pairs of all groups together that do not connect all realizations, or are too few for a plane.
fn pairs(protocol: &Protocol, part: &Part, own: &Similarity) -> Option<Fault> {
    let mut rated: Vec<[ModelId; 2]> = Vec::new();
    for assigned in protocol.assignments() {
        let assigned = protocol.of(&assigned);
        let task = assigned.part(&part.id).map(|part| &part.task);
        let Some(Task::Similarity(of_group)) = task else {
            continue;
        };
        let new = (of_group.different.iter()).filter(|pair| !rated.contains(pair));
        let new: Vec<[ModelId; 2]> = new.cloned().collect();
        rated.extend(new);
    }
    if let Some([one, other]) = unconnected(&own.models, &rated) {
        let what = format!(
            "no group connects `{one}` and `{other}` by pairs of `{}`: they have no place in one map",
            part.id
        );
        let hint =
            "let a group rate both, or each of them beside a realization that they have in common";
        return Some(Fault::warning(what).hint(hint));
    }
    // A plane has two coordinates of each.
    let enough = own.possible().min(2 * own.models.len());
    (rated.len() < enough).then(|| {
        let what = format!(
            "{} of `{}` for {} realizations: nearly any ratings of so few fit a plane",
            counted(rated.len(), "pair", "pairs"),
            part.id,
            own.models.len()
        );
        Fault::warning(what).hint(format!("take {enough} pairs or more"))
    })
}
