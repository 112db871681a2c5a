//! The tables of `analysis/`, RFC 4180. Text is stored as it was typed.

use super::Source;
use crate::analyze::{Analysis, Value};

/// A file of `analysis/`: name and content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// File name.
    pub name: &'static str,
    /// Whole content.
    pub content: String,
}

/// All files: tables and `values.json`.
pub fn tables(source: &Source, analysis: &Analysis) -> Vec<Table> {
    vec![
        table("descriptives.csv", descriptives(analysis)),
        table("correlation.csv", correlation(analysis)),
        table("comments.csv", comments(analysis)),
        table("excluded.csv", excluded(analysis)),
        table("ratings_used.csv", ratings_used(analysis)),
        Table {
            name: "values.json",
            content: super::json::document(source, analysis),
        },
    ]
}

fn table(name: &'static str, rows: Vec<Vec<String>>) -> Table {
    Table {
        name,
        content: text(&rows),
    }
}

/// Rows as CSV; all are equally long.
pub(super) fn text(rows: &[Vec<String>]) -> String {
    let mut writer = csv::WriterBuilder::new()
        .terminator(csv::Terminator::CRLF)
        .from_writer(Vec::new());
    for row in rows {
        writer
            .write_record(row)
            .expect("rows of a table are equally long and memory takes them");
    }
    let bytes = writer.into_inner().expect("memory takes them");
    String::from_utf8(bytes).expect("only text was written")
}

fn cells<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.iter().map(|t| (*t).to_owned()).collect()
}

fn number(x: Option<f64>) -> String {
    x.map_or_else(String::new, |x| x.to_string())
}

fn descriptives(a: &Analysis) -> Vec<Vec<String>> {
    const STATISTICS: [&str; 8] = ["n", "mean", "sd", "median", "q1", "q3", "min", "max"];
    const OVER_SUBJECTS: [&str; 6] = ["n", "mean", "sd", "sem", "ci95_lo", "ci95_hi"];
    let v = &a.values;
    let from = v.number("desc_all/hist_from");
    let bins = v.list("desc_all/hist").map_or(0, <[f64]>::len);
    let mut head = cells(["model", "role", "duplicate_of", "vaf"]);
    head.extend(STATISTICS.iter().map(|s| (*s).to_owned()));
    head.extend(OVER_SUBJECTS.iter().map(|s| format!("subject_mean_{s}")));
    head.extend(cells(["cousineau_morey_ci95_half", "share_realistic"]));
    head.extend((0..bins).map(|b| format!("count_{}", from.unwrap_or(0.0) + b as f64)));
    let mut rows = vec![head];
    for m in &a.realizations {
        let id = &m.id;
        let get = |name: &str| number(v.number(&format!("desc/{id}/{name}")));
        let mut row = vec![
            id.clone(),
            m.role.as_str().to_owned(),
            m.duplicate_of.clone().unwrap_or_default(),
            number(m.vaf),
        ];
        row.extend(STATISTICS.iter().map(|s| get(s)));
        row.extend(
            OVER_SUBJECTS
                .iter()
                .map(|s| get(&format!("subject_mean/{s}"))),
        );
        row.push(get("cousineau_morey/ci95_half"));
        row.push(number(v.number(&format!("realistic/{id}/share"))));
        let hist = v.list(&format!("desc/{id}/hist")).unwrap_or(&[]);
        row.extend((0..bins).map(|b| number(hist.get(b).copied())));
        rows.push(row);
    }
    rows
}

fn correlation(a: &Analysis) -> Vec<Vec<String>> {
    const GROUPS: [&str; 7] = [
        "corr",
        "subject_corr",
        "subject_slope",
        "rmcorr_cells",
        "rmcorr_trials",
        "bootstrap",
        "page",
    ];
    let mut rows = vec![cells(["identifier", "value", "undefined_because"])];
    for (id, value) in a.values.iter() {
        if !GROUPS.iter().any(|g| id.split('/').next() == Some(g)) {
            continue;
        }
        rows.push(match value {
            Value::Number(x) => vec![id.to_owned(), x.to_string(), String::new()],
            Value::List(x) => {
                let all: Vec<String> = x.iter().map(f64::to_string).collect();
                vec![id.to_owned(), all.join(" "), String::new()]
            }
            Value::Undefined(why) => vec![id.to_owned(), String::new(), why.clone()],
        });
    }
    rows
}

fn comments(a: &Analysis) -> Vec<Vec<String>> {
    let mut rows = vec![cells([
        "model",
        "subject",
        "repetition",
        "question",
        "text",
    ])];
    rows.extend(a.comments.iter().map(|c| {
        vec![
            c.model.clone(),
            c.subject.clone(),
            c.repetition.to_string(),
            c.question.clone(),
            c.text.clone(),
        ]
    }));
    rows
}

fn excluded(a: &Analysis) -> Vec<Vec<String>> {
    let mut rows = vec![cells([
        "subject",
        "model",
        "repetition",
        "rating",
        "reason",
    ])];
    for row in &a.rows {
        if let Some(reason) = &row.excluded {
            rows.push(vec![
                row.subject.to_string(),
                row.model.to_string(),
                row.repetition.to_string(),
                number(row.rating),
                reason.to_string(),
            ]);
        }
    }
    rows
}

fn ratings_used(a: &Analysis) -> Vec<Vec<String>> {
    let head = [
        "subject",
        "model",
        "repetition",
        "rating",
        "vaf",
        "included",
        "reason",
    ];
    let mut rows = vec![cells(head)];
    for row in &a.rows {
        let reason = match (&row.excluded, row.rating) {
            (Some(reason), _) => reason.to_string(),
            (None, None) => "no rating".to_owned(),
            (None, Some(_)) => String::new(),
        };
        rows.push(vec![
            row.subject.to_string(),
            row.model.to_string(),
            row.repetition.to_string(),
            number(row.rating),
            number(row.vaf),
            reason.is_empty().to_string(),
            reason,
        ]);
    }
    rows
}
