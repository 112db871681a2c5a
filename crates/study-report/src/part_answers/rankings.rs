//! What is said of rankings.

use super::MAX_LISTED;
use crate::apa;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;
use study_base::text::counted;

/// The mean ranks, the first first, as many as a sentence lists.
pub(super) fn ranks(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.ranking.as_ref()?;
    let mut means: Vec<(&str, f64)> = (found.items.iter())
        .filter_map(|(name, item)| Some((name.as_str(), item.mean_rank.number()?)))
        .collect();
    means.small_sort_by(|a, b| a.1.total_cmp(&b.1));
    let listed: Vec<String> = (means.iter().take(MAX_LISTED))
        .map(|(name, mean)| format!("{name} {}", apa::two(*mean)))
        .collect();
    (!listed.is_empty()).then(|| format!("Mean ranks: {}.", listed.join(", ")))
}

/// The pairs of which one was above the other in every ranking: their differences have no size, so that they are not among
/// the pairs that are compared by it.
pub(super) fn of_one_order(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.ranking.as_ref()?;
    let p: Vec<f64> = (found.pairs.values())
        .filter(|pair| pair.worths.difference.number().is_none())
        .filter_map(|pair| pair.worths.p_holm.number())
        .collect();
    let largest = p.iter().copied().reduce(f64::max)?;
    Some(format!(
        "In {} of {} one was above the other in every ranking (sign tests, Holm's correction over all pairs, largest p {}).",
        p.len(),
        counted(found.pairs.len(), "pair", "pairs"),
        apa::p_beside(largest, part.alpha)
    ))
}
