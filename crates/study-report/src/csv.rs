//! The CSV tables of `analysis/` (RFC 4180). Text is stored as typed.

mod parts;
mod test_table;

pub use parts::part_tables;

use super::apa::digits;
use super::table::Table;
use super::{Source, tables};
use study_analysis::analyze::{Analysis, Value};

/// A file of `analysis/`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableFile {
    /// File name.
    pub name: &'static str,
    /// Content.
    pub content: String,
}

/// The CSV tables and `values.json`.
pub fn tables(source: &Source, analysis: &Analysis) -> Vec<TableFile> {
    let of = |table: Table| table.records(&[]);
    let mut all = vec![
        table("descriptives.csv", of(tables::realizations(analysis, ""))),
        table("tests.csv", test_table::rows(analysis)),
        table("correlation.csv", identified(analysis, &CORRELATION)),
        table("pairs.csv", of(tables::posthoc(analysis))),
        table("variance.csv", identified(analysis, &VARIANCE)),
        table("agreement.csv", identified(analysis, &AGREEMENT)),
        table("subjects.csv", of(tables::subjects(analysis))),
        table("exclusions.csv", of(tables::rules(analysis))),
        table(
            "with_and_without.csv",
            of(tables::all_with_and_without(analysis)),
        ),
        table("comments.csv", comments(analysis)),
        table("excluded.csv", of(tables::excluded(analysis))),
        TableFile {
            name: "ratings_used.csv",
            content: ratings_used(analysis),
        },
        TableFile {
            name: "values.json",
            content: super::json::document(source, analysis),
        },
    ];
    if analysis.crossing.is_some() {
        all.extend([
            table("factors.csv", of(tables::factors::effects(analysis))),
            table("factor_means.csv", of(tables::factors::means(analysis))),
            table(
                "factor_contrasts.csv",
                of(tables::factors::contrasts(analysis)),
            ),
        ]);
    }
    if !analysis.outcomes.is_empty() {
        all.extend([
            table("outcomes.csv", of(tables::outcomes::means(analysis))),
            table("outcome_tests.csv", of(tables::outcomes::tests(analysis))),
        ]);
    }
    if !analysis.parts.is_empty() {
        all.extend(part_tables(&analysis.parts));
    }
    all
}

pub(super) fn table(name: &'static str, rows: Vec<Vec<String>>) -> TableFile {
    TableFile {
        name,
        content: text(&rows),
    }
}

/// Rows of equal length as CSV.
pub(super) fn text(rows: &[Vec<String>]) -> String {
    written(|to| {
        for row in rows {
            to.row(row);
        }
    })
}

/// A table that is written row by row, because it can have millions of rows.
fn written(write: impl FnOnce(&mut Rows)) -> String {
    let mut rows = Rows(
        csv::WriterBuilder::new()
            .terminator(csv::Terminator::CRLF)
            .from_writer(Vec::new()),
    );
    write(&mut rows);
    let bytes = rows
        .0
        .into_inner()
        .expect("writing to memory does not fail");
    String::from_utf8(bytes).expect("all fields are UTF-8")
}

struct Rows(csv::Writer<Vec<u8>>);

impl Rows {
    fn row<T: AsRef<[u8]>>(&mut self, row: impl IntoIterator<Item = T>) {
        self.0
            .write_record(row)
            .expect("all rows have the same length");
    }
}

fn cells<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.iter().map(|t| (*t).to_owned()).collect()
}

pub(super) fn number(x: Option<f64>) -> String {
    x.map_or_else(String::new, digits)
}

fn whole(x: Option<u32>) -> String {
    x.map_or_else(String::new, |x| x.to_string())
}

const CORRELATION: [&str; 7] = [
    "corr",
    "subject_corr",
    "subject_slope",
    "rmcorr_cells",
    "rmcorr_trials",
    "bootstrap",
    "page",
];

const VARIANCE: [&str; 2] = ["variance", "lmm_variance"];

const AGREEMENT: [&str; 4] = [
    "icc_subjects",
    "icc_repetitions",
    "krippendorff_subjects",
    "krippendorff_repetitions",
];

/// The statistics of some groups, one per row.
fn identified(a: &Analysis, groups: &[&str]) -> Vec<Vec<String>> {
    let mut rows = vec![cells(["identifier", "value", "undefined_because"])];
    for (id, value) in a.values.iter() {
        if !groups.iter().any(|g| id.split('/').next() == Some(g)) {
            continue;
        }
        rows.push(match value {
            Value::Number(x) => vec![id.to_owned(), digits(*x), String::new()],
            Value::List(x) => {
                let all: Vec<String> = x.iter().map(|x| digits(*x)).collect();
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

fn ratings_used(a: &Analysis) -> String {
    written(|to| {
        to.row([
            "subject",
            "model",
            "repetition",
            "trial_index",
            "rating",
            "vaf",
            "included",
            "reason",
        ]);
        for row in &a.rows {
            let excluded = row.excluded.as_ref().map(|r| r.to_string());
            let reason = match (&excluded, row.rating) {
                (Some(reason), _) => reason,
                (None, None) => "no rating",
                (None, Some(_)) => "",
            };
            to.row([
                a.subject(row),
                a.model(row),
                &row.repetition.to_string(),
                &whole(row.trial_index),
                &number(row.rating),
                &number(row.vaf),
                if reason.is_empty() { "true" } else { "false" },
                reason,
            ]);
        }
        for row in a.practice.iter() {
            to.row([
                row.subject,
                row.model,
                &row.repetition.to_string(),
                &whole(row.trial_index),
                &number(row.rating),
                &number(row.vaf),
                "false",
                "practice",
            ]);
        }
    })
}
