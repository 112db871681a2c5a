//! When abilities have a maximum-likelihood estimate (Ford 1957): the graph "a was
//! preferred to b at least once" is strongly connected.

use super::{Comparison, NoAbilities};

/// The reason why there is none. Ties count in both directions, if the model has them.
pub(crate) fn check(
    items: usize,
    comparisons: &[Comparison],
    ties: bool,
    order: bool,
) -> Result<(), NoAbilities> {
    let valid = |c: &Comparison| c.first < items && c.second < items && c.first != c.second;
    if items < 2 || !comparisons.iter().all(valid) {
        return Err(NoAbilities::NoPairs);
    }
    let mut preferred = vec![vec![false; items]; items];
    let mut compared = preferred.clone();
    let mut presented = preferred.clone();
    for c in comparisons {
        let tied = ties && c.tied > 0.0;
        preferred[c.first][c.second] |= c.first_preferred > 0.0 || tied;
        preferred[c.second][c.first] |= c.second_preferred > 0.0 || tied;
        let any = c.first_preferred + c.second_preferred > 0.0 || tied;
        compared[c.first][c.second] |= any;
        compared[c.second][c.first] |= any;
        presented[c.first][c.second] |= any;
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
    // A group whose members are below nobody outside it.
    let class = |item: usize| -> Vec<usize> {
        let same = |other: &usize| *other == item || above[item][*other] && above[*other][item];
        (0..items).filter(same).collect()
    };
    for item in 0..items {
        let top = class(item);
        let beaten = (above.iter().enumerate()).any(|(o, below)| below[item] && !top.contains(&o));
        if top.len() < items && !beaten {
            return Err(NoAbilities::Unbounded(top));
        }
    }
    let both = |a: usize, b: usize| presented[a][b] && presented[b][a];
    if order && !(0..items).any(|a| (0..a).any(|b| both(a, b))) {
        return Err(NoAbilities::OneOrder);
    }
    Ok(())
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
