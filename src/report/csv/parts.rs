//! The CSV tables of the parts of a study that are not ratings.

use super::{TableFile, cells, digits, number, table};
use crate::report::part_tables::{PartCell, PartTable, tables};
use study_core::analyze::Value;
use study_core::analyze::psychophysics::PartAnalysis;

/// `parts.csv` with all statistics by identifier, `parts_findings.csv`, and a table for
/// each kind of statistic, all with the part in the first column.
pub fn part_tables(parts: &[PartAnalysis]) -> Vec<TableFile> {
    let mut all = vec![
        table("parts.csv", statistics(parts)),
        table("parts_findings.csv", findings(parts)),
    ];
    const FILES: [(&str, &str); 14] = [
        ("groups", "part_groups.csv"),
        ("group_pairs", "part_group_pairs.csv"),
        ("thresholds", "part_thresholds.csv"),
        ("conditions", "part_conditions.csv"),
        ("contrasts", "part_contrasts.csv"),
        ("comparisons", "part_comparisons.csv"),
        ("sensitivities", "part_sensitivities.csv"),
        ("preferences", "part_preferences.csv"),
        ("preference_pairs", "part_preference_pairs.csv"),
        ("magnitudes", "part_magnitudes.csv"),
        ("magnitude_contrasts", "part_magnitude_contrasts.csv"),
        ("mushra", "part_mushra.csv"),
        ("scores", "part_scores.csv"),
        ("items", "part_items.csv"),
    ];
    for (kind, file) in FILES {
        let mut rows: Vec<Vec<String>> = Vec::new();
        for part in parts {
            for own in tables(&part.values)
                .iter()
                .filter(|t| t.file == kind && !t.rows.is_empty())
            {
                if rows.is_empty() {
                    rows.push(["part".to_owned()].into_iter().chain(names(own)).collect());
                }
                let of_part = |row: Vec<String>| {
                    let name = part.part.as_str().to_owned();
                    [name].into_iter().chain(row).collect()
                };
                rows.extend(
                    own.rows
                        .iter()
                        .map(|row| of_part(row.iter().flat_map(exact).collect())),
                );
            }
        }
        if !rows.is_empty() {
            all.push(table(file, rows));
        }
    }
    all
}

/// The columns; the ends of an interval have columns of their own.
fn names(table: &PartTable) -> Vec<String> {
    let row = table.rows.first();
    let names = (table.columns.iter().enumerate()).map(|(i, (_, column))| {
        match row.and_then(|row| row.get(i)) {
            Some(PartCell::Interval(..)) => vec![format!("{column}_lo"), format!("{column}_hi")],
            _ => vec![(*column).to_owned()],
        }
    });
    names.flatten().collect()
}

/// A cell with all digits.
fn exact(cell: &PartCell) -> Vec<String> {
    match cell {
        PartCell::Name(text) => vec![text.clone()],
        PartCell::Number(x, _) => vec![number(*x)],
        PartCell::Interval(ends, _) => {
            vec![number(ends.map(|e| e.0)), number(ends.map(|e| e.1))]
        }
    }
}

fn statistics(parts: &[PartAnalysis]) -> Vec<Vec<String>> {
    let mut rows = vec![cells(["part", "identifier", "value", "undefined_because"])];
    for part in parts {
        for (id, value) in part.values.iter() {
            let (value, why) = match value {
                Value::Number(x) => (digits(*x), String::new()),
                Value::List(x) => {
                    let all: Vec<String> = x.iter().map(|x| digits(*x)).collect();
                    (all.join(" "), String::new())
                }
                Value::Undefined(why) => (String::new(), why.clone()),
            };
            rows.push(vec![
                part.part.as_str().to_owned(),
                id.to_owned(),
                value,
                why,
            ]);
        }
    }
    rows
}

fn findings(parts: &[PartAnalysis]) -> Vec<Vec<String>> {
    let mut rows = vec![cells([
        "part",
        "question",
        "verdict",
        "test",
        "statistic",
        "p",
        "level",
        "comparisons",
        "estimate",
        "ci95_lo",
        "ci95_hi",
        "n_participants",
        "n_realizations",
        "undefined_because",
    ])];
    for part in parts {
        for f in &part.findings {
            let test = f.test.as_ref();
            let statistic = test.and_then(|t| t.statistic.as_ref()).map(|s| s.value);
            let ci95 = f.estimate.and_then(|e| e.ci95);
            rows.push(vec![
                part.part.as_str().to_owned(),
                f.question.id(),
                f.verdict.as_str().to_owned(),
                test.map_or_else(String::new, |t| t.kind.as_str().to_owned()),
                number(statistic),
                number(test.map(|t| t.p)),
                number(test.map(|t| t.level)),
                test.map_or_else(String::new, |t| t.comparisons.to_string()),
                number(f.estimate.map(|e| e.value)),
                number(ci95.map(|e| e.0)),
                number(ci95.map(|e| e.1)),
                f.participants.to_string(),
                f.realizations.to_string(),
                f.reason().unwrap_or_default().to_owned(),
            ]);
        }
    }
    rows
}
