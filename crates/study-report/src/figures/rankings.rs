//! The figure of a part of ranking.

use super::Drawn;
use super::forest::{Row, forest};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;
use study_stats::psychometric::Spacing;

/// Worths with their intervals, the first realization first.
pub(super) fn worths(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let found = part.results.over.ranking.as_ref()?;
    let mut rows: Vec<Row> = (found.items.iter())
        .filter_map(|(name, item)| {
            Some(Row {
                name: name.as_str().to_owned(),
                value: item.log_worth.number()?,
                ci95: item.log_worth_ci95.ends(),
                mean: false,
                together: None,
            })
        })
        .collect();
    rows.small_sort_by(|a, b| b.value.total_cmp(&a.value));
    let caption = "Rankings: logarithms of the worths (their sum is 0) with 95 % intervals, the realization with the first ranks \
                   first. A difference of 1.1 means that of two untied realizations the higher one is above the other in three of four rankings."
        .to_owned();
    let title = "Worths of the realizations";
    forest(
        name,
        (title, caption, "log worth"),
        vec![(String::new(), rows)],
        (Some(0.0), Spacing::Lin),
    )
}
