//! When abilities have a maximum-likelihood estimate (Ford 1957): the graph "a was
//! preferred to b at least once" is strongly connected.

use super::{Comparison, NoAbilities};
use std::cmp::Reverse;

/// The reason why there is none. Ties count in both directions, if the model has them.
pub(crate) fn check(
    items: usize,
    comparisons: &[Comparison],
    ties: bool,
    order: bool,
) -> Result<(), NoAbilities> {
    let graph = Graph::of(items, comparisons, ties)?;
    if graph.classes.len() > 1 {
        return Err(graph.unbounded());
    }
    let mut presented = vec![vec![false; items]; items];
    for c in comparisons.iter().filter(|c| is_answered(c, ties)) {
        presented[c.first][c.second] = true;
    }
    let both = |a: usize, b: usize| presented[a][b] && presented[b][a];
    if order && !(0..items).any(|a| (0..a).any(|b| both(a, b))) {
        return Err(NoAbilities::OneOrder);
    }
    Ok(())
}

/// The items in levels, the highest first: an item was never less preferred than one of a lower level, and within
/// a level the condition holds. One level, if it holds for all items.
///
/// # Errors
/// [`NoAbilities::Unbounded`] if the answers do not say which of two levels is the higher one.
pub(crate) fn levels(
    items: usize,
    comparisons: &[Comparison],
    ties: bool,
) -> Result<Vec<Vec<usize>>, NoAbilities> {
    let graph = Graph::of(items, comparisons, ties)?;
    let reached = |class: &Vec<usize>| {
        let below = &graph.above[class[0]];
        let reached = (0..items).filter(|item| class.contains(item) || below[*item]);
        reached.count()
    };
    let mut levels = graph.classes.clone();
    levels.sort_by_key(|class| Reverse(reached(class)));
    match levels
        .windows(2)
        .all(|two| graph.above[two[0][0]][two[1][0]])
    {
        true => Ok(levels),
        false => Err(graph.unbounded()),
    }
}

/// Whether a comparison has an answer that counts.
fn is_answered(c: &Comparison, ties: bool) -> bool {
    c.first_preferred + c.second_preferred > 0.0 || (ties && c.tied > 0.0)
}

/// What was preferred to what.
struct Graph {
    /// Whether an item was preferred to another, directly or by way of others.
    above: Vec<Vec<bool>>,
    /// Items each of which was preferred to each other one of its class, directly or by way of others.
    classes: Vec<Vec<usize>>,
}

impl Graph {
    fn of(items: usize, comparisons: &[Comparison], ties: bool) -> Result<Self, NoAbilities> {
        let valid = |c: &Comparison| c.first < items && c.second < items && c.first != c.second;
        if items < 2 || !comparisons.iter().all(valid) {
            return Err(NoAbilities::NoPairs);
        }
        let mut preferred = vec![vec![false; items]; items];
        let mut compared = preferred.clone();
        for c in comparisons {
            let tied = ties && c.tied > 0.0;
            preferred[c.first][c.second] |= c.first_preferred > 0.0 || tied;
            preferred[c.second][c.first] |= c.second_preferred > 0.0 || tied;
            let any = is_answered(c, ties);
            compared[c.first][c.second] |= any;
            compared[c.second][c.first] |= any;
        }
        let joined = closure(compared);
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (item, reached) in joined.iter().enumerate() {
            match groups.iter_mut().find(|g| reached[g[0]]) {
                Some(group) => group.push(item),
                None => groups.push(vec![item]),
            }
        }
        if groups.len() > 1 {
            return Err(NoAbilities::Disconnected(groups));
        }
        let above = closure(preferred);
        let mut classes: Vec<Vec<usize>> = Vec::new();
        for (item, below) in above.iter().enumerate() {
            let same = |other: usize| below[other] && above[other][item];
            match classes.iter_mut().find(|class| same(class[0])) {
                Some(class) => class.push(item),
                None => classes.push(vec![item]),
            }
        }
        Ok(Self { above, classes })
    }

    /// A class whose members are below nobody outside it.
    fn unbounded(&self) -> NoAbilities {
        let beaten = |class: &Vec<usize>| {
            let above = self.above.iter().enumerate();
            let mut above = above.filter(|(_, below)| below[class[0]]);
            above.any(|(item, _)| !class.contains(&item))
        };
        let top = self.classes.iter().find(|class| !beaten(class));
        NoAbilities::Unbounded(top.cloned().unwrap_or_default())
    }
}

/// What can be reached from each item.
fn closure(mut reach: Vec<Vec<bool>>) -> Vec<Vec<bool>> {
    for via in 0..reach.len() {
        let further = reach[via].clone();
        for from in &mut reach {
            if from[via] {
                for (known, more) in from.iter_mut().zip(&further) {
                    *known |= more;
                }
            }
        }
    }
    reach
}
