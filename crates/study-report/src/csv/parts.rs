//! The CSV tables of the parts of a study that are not ratings.

use super::{TableFile, cells, number, table};
use crate::apa::digits;
use crate::tables::parts::KINDS;
use study_analysis::analyze::Value;
use study_analysis::analyze::psychophysics::PartAnalysis;

/// `parts.csv` with all statistics by identifier, `parts_findings.csv`, and a table for
/// each kind of statistic, all with the part in the first column.
pub fn part_tables(parts: &[PartAnalysis]) -> Vec<TableFile> {
    let mut all = vec![
        table("parts.csv", statistics(parts)),
        table("parts_findings.csv", findings(parts)),
    ];
    for (file, make) in KINDS {
        let of_part =
            |part: &PartAnalysis| make(&part.results).records(&[("part", part.part.as_str())]);
        let rows = joined(parts.iter().map(of_part));
        if !rows.is_empty() {
            all.push(table(file, rows));
        }
    }
    all
}

/// The rows of several tables under one head; none if no table has rows. Columns that only some
/// of them have are the last ones, and empty in the others.
fn joined(tables: impl Iterator<Item = Vec<Vec<String>>>) -> Vec<Vec<String>> {
    let tables: Vec<Vec<Vec<String>>> = tables.filter(|t| t.len() > 1).collect();
    let heads = tables.iter().filter_map(|t| t.first());
    let Some(head) = heads.max_by_key(|head| head.len()).cloned() else {
        return Vec::new();
    };
    let columns = head.len();
    let mut rows = vec![head];
    rows.extend(tables.into_iter().flat_map(|t| t.into_iter().skip(1)));
    for row in &mut rows {
        row.resize(columns, String::new());
    }
    rows
}

fn statistics(parts: &[PartAnalysis]) -> Vec<Vec<String>> {
    let mut rows = vec![cells(["part", "identifier", "value", "undefined_because"])];
    for part in parts {
        for (id, value) in part.values().iter() {
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

#[cfg(test)]
mod tests {
    use super::joined;

    /// Only staircases have reversals: a part with them and one without share a file.
    #[test]
    fn a_part_without_the_last_column_has_an_empty_cell_there() {
        let table = |rows: &[&[&str]]| -> Vec<Vec<String>> {
            let row = |row: &&[&str]| row.iter().map(|c| (*c).to_owned()).collect();
            rows.iter().map(row).collect()
        };
        let constant = table(&[&["part", "threshold"], &["a", "0.2"]]);
        let staircase = table(&[
            &["part", "threshold", "reversal_mean"],
            &["b", "0.3", "0.31"],
        ]);
        let empty = table(&[&["part", "threshold"]]);
        let expected = table(&[
            &["part", "threshold", "reversal_mean"],
            &["a", "0.2", ""],
            &["b", "0.3", "0.31"],
        ]);
        assert_eq!(
            joined([empty.clone(), constant, staircase].into_iter()),
            expected
        );
        assert!(joined([empty].into_iter()).is_empty());
    }
}
