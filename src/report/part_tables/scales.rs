//! The tables of estimated magnitudes, of ratings beside a reference and of questionnaires.

use super::{PartCell, PartTable, cells, named};
use crate::report::apa::{interval_or_dash, name, plain, two};
use study_base::text::counted;
use study_core::analyze::Values;

/// Estimates of levels or of realizations.
pub(super) fn magnitudes(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "magnitudes",
        caption: "Estimated magnitudes",
        columns: &[
            ("", "level"),
            ("geometric mean", "geometric_mean"),
            ("95 %", "geometric_mean_ci95"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    let mut levels: Vec<&str> = (values.iter())
        .filter_map(|(id, _)| {
            id.strip_prefix("magnitude/level/")?
                .strip_suffix("/geometric_mean")
        })
        .collect();
    let level = |text: &str| text.parse().unwrap_or(f64::MAX);
    levels.sort_by(|a, b| level(a).total_cmp(&level(b)));
    for level in levels {
        let id = format!("magnitude/level/{level}");
        let number = level.parse().ok();
        let shown = number.map_or_else(|| named(level), |x| PartCell::Number(Some(x), plain));
        table.rows.push(vec![
            shown,
            PartCell::Number(values.number(&format!("{id}/geometric_mean")), plain),
            PartCell::Interval(values.interval(&format!("{id}/ci95")), plain),
        ]);
    }
    for cell in cells(values, "magnitude/realization", 1) {
        let id = format!("magnitude/realization/{}", cell[0]);
        table.rows.push(vec![
            named(cell[0]),
            PartCell::Number(values.number(&format!("{id}/geometric_mean")), plain),
            PartCell::Interval(values.interval(&format!("{id}/ci95")), plain),
        ]);
    }
    if let Some(exponent) = values.number("magnitude/exponent") {
        let interval = values.interval("magnitude/exponent_over_participants/ci95");
        let left_out = values.number("magnitude/n_left_out").unwrap_or_default();
        table.notes.push(format!(
            "Exponent {} {}, over participants. {} left out, because not above 0.",
            two(exponent),
            interval_or_dash(interval, two),
            counted(left_out as usize, "estimate", "estimates"),
        ));
    }
    table
}

/// Ratings beside a reference.
pub(super) fn ratings(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "mushra",
        caption: "Ratings from 0 to 100",
        columns: &[
            ("", "condition"),
            ("median", "median"),
            ("quartiles", "quartile"),
            ("mean", "mean"),
            ("95 %", "mean_ci95_half"),
            ("with screened", "mean_unscreened"),
        ],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    let of = |statistic: &str| -> Vec<&str> {
        let suffix = format!("/{statistic}");
        (values.iter())
            .filter_map(|(id, _)| id.strip_prefix("mushra/")?.strip_suffix(&suffix))
            .collect()
    };
    for condition in of("median") {
        let number = |statistic: &str| values.number(&format!("mushra/{condition}/{statistic}"));
        let unscreened = format!("mushra_unscreened/{condition}/mean");
        let unscreened = match values.get(&unscreened) {
            Some(_) => values.number(&unscreened),
            None => number("mean"),
        };
        table.rows.push(vec![
            named(condition),
            PartCell::Number(number("median"), plain),
            PartCell::Interval(number("q1").zip(number("q3")), plain),
            PartCell::Number(number("mean"), plain),
            PartCell::Number(number("ci95_half"), |h| format!("± {}", plain(h))),
            PartCell::Number(unscreened, plain),
        ]);
    }
    let screened: Vec<String> = (of("screened").iter())
        .filter(|p| values.number(&format!("mushra/{p}/screened")) == Some(1.0))
        .map(|p| name(p))
        .collect();
    if !screened.is_empty() {
        let text = format!(
            "Screened, and only in the last column, the mean over all: {}.",
            screened.join(", ")
        );
        table.notes.push(text);
    }
    table
}

/// The score of each participant in a questionnaire.
pub(super) fn scores(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "scores",
        caption: "Scores",
        columns: &[("", "participant"), ("score", "score")],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    for (id, _) in values.iter() {
        let Some(participant) = id.strip_prefix("questionnaire/score/") else {
            continue;
        };
        let score = PartCell::Number(values.number(id), plain);
        table.rows.push(vec![named(participant), score]);
    }
    let number = |statistic: &str| values.number(&format!("questionnaire/{statistic}"));
    if let (Some(mean), Some(n)) = (number("mean"), number("n")) {
        table.notes.push(format!(
            "Score: mean {} {} of {}.",
            plain(mean),
            interval_or_dash(values.interval("questionnaire/ci95"), plain),
            counted(n as usize, "participant", "participants"),
        ));
    }
    table
}

/// The answers to the items of a questionnaire, as they were given.
pub(super) fn items(values: &Values) -> PartTable {
    let mut table = PartTable {
        file: "items",
        caption: "Items, as answered",
        columns: &[("item", "item"), ("mean", "mean"), ("SD", "sd")],
        rows: Vec::new(),
        notes: Vec::new(),
    };
    let mut found: Vec<_> = cells(values, "questionnaire/item", 1).into_iter().collect();
    // 2 before 10; names as they are.
    found.sort_by_key(|cell| cell[0].parse::<u32>().unwrap_or(0));
    for cell in found {
        let id = |statistic: &str| format!("questionnaire/item/{}/{statistic}", cell[0]);
        let number = |statistic: &str| PartCell::Number(values.number(&id(statistic)), two);
        table
            .rows
            .push(vec![named(cell[0]), number("mean"), number("sd")]);
    }
    table
}
