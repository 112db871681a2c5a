//! The figure of a part of ranking.

use super::Drawn;
use super::forest::{Row, forest};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;
use study_stats::psychometric::Spacing;

/// Worths with their intervals, the first realization first; a panel for each level, if there are several.
pub(super) fn worths(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let found = part.results.over.ranking.as_ref()?;
    // By level, the whole number of which is exact; 0 without levels.
    let mut levels: BTreeMap<u64, Vec<Row>> = BTreeMap::new();
    for (name, item) in &found.items {
        let level = item.level.number().unwrap_or(0.0) as u64;
        if let Some(value) = item.log_worth.number() {
            levels.entry(level).or_default().push(Row {
                name: name.as_str().to_owned(),
                value,
                ci95: item.log_worth_ci95.ends(),
                mean: false,
                together: None,
            });
        }
    }
    for rows in levels.values_mut() {
        rows.small_sort_by(|a, b| b.value.total_cmp(&a.value));
    }
    let (sum, apart) = match found.items.values().any(|item| item.level.is_some()) {
        true => (
            "their sum is 0 in each level",
            " In every ranking those of a level were above all of lower ones: worths are compared within a level only, and what is \
             alone in its level has none.",
        ),
        false => ("their sum is 0", ""),
    };
    let caption = format!(
        "Rankings: logarithms of the worths ({sum}) with 95 % intervals, the realization with the first ranks \
         first. A difference of 1.1 means that of two untied realizations the higher one is above the other in three of four \
         rankings.{apart}"
    );
    let panels = levels.into_iter().map(|(level, rows)| match level {
        0 => (String::new(), rows),
        _ => (format!("level {level}"), rows),
    });
    let title = "Worths of the realizations";
    forest(
        name,
        (title, caption, "log worth"),
        panels.collect(),
        (Some(0.0), Spacing::Lin),
    )
}
