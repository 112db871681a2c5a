//! The data dictionary in docs/results.md is generated from the declarations of the
//! columns. `UPDATE_DOCS=1 cargo test --test store dictionary` writes it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::Path;
use study_plan::protocol::columns::{
    AttemptColumn, Column, IntervalColumn, Kind, ParticipantColumn, RatingColumn, SampleColumn,
    UsedColumn,
};

const START: &str = "<!-- columns -->\n";
const END: &str = "<!-- end of columns -->\n";

/// A table of Markdown: one row for each column.
fn table(heading: &str, rows: &str, columns: impl Iterator<Item = Column>) -> String {
    let mut text = format!(
        "\n### {heading}\n\n{rows}\n\n| column | type | meaning | empty if |\n|---|---|---|---|\n"
    );
    for column in columns {
        let name = match column.name.contains(' ') {
            true => column.name.to_owned(),
            false => format!("`{}`", column.name),
        };
        let kind = match column.kind {
            Kind::Text => "text",
            Kind::Whole => "whole number",
            Kind::Number => "number",
            Kind::Flag => "`true`, `false`",
            Kind::Time => "RFC 3339 time",
            Kind::Level(_) => "word",
            Kind::Answer => "number or text",
        };
        let unit = column
            .unit
            .map(|unit| format!(", {unit}"))
            .unwrap_or_default();
        let levels = match column.kind {
            Kind::Level(levels) => levels,
            _ => &[],
        };
        let levels: Vec<String> = (levels.iter())
            .map(|(level, meaning)| format!("`{level}`: {meaning}"))
            .collect();
        let colon = if levels.is_empty() { "" } else { ". " };
        let meaning = format!("{}{colon}{}", column.meaning, levels.join("; ")).replace('|', "\\|");
        let empty = column.empty.unwrap_or_default();
        text += &format!("| {name} | {kind}{unit} | {meaning} | {empty} |\n");
    }
    text
}

fn dictionary() -> String {
    [
        table(
            "ratings.csv",
            "One row for each planned trial.",
            RatingColumn::ALL.iter().map(|c| c.column()),
        ),
        table(
            "attempts.csv",
            "One row for each event that concerns an attempt, an answer or the participant's state, in the order in which they happened.",
            AttemptColumn::ALL.iter().map(|c| c.column()),
        ),
        table(
            "participants.csv",
            "One row for each participant, by the last session.",
            ParticipantColumn::ALL.iter().map(|c| c.column()),
        ),
        table(
            "intervals.csv",
            "One row for each presentation, of failed attempts, too; only in a study with parts.",
            IntervalColumn::ALL.iter().map(|c| c.column()),
        ),
        table(
            "telemetry/TRIAL-aATTEMPT.csv",
            "One row for each sample of an attempt.",
            SampleColumn::ALL.iter().map(|c| c.column()),
        ),
        table(
            "analysis/ratings_used.csv",
            "One row for each rating, whether the analysis used it or not.",
            UsedColumn::ALL.iter().map(|c| c.column()),
        ),
    ]
    .concat()
        + "\n"
}

#[test]
fn the_dictionary_in_the_docs_is_generated_from_the_columns() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/results.md");
    let text = fs::read_to_string(&path).unwrap();
    let (before, rest) = text.split_once(START).unwrap();
    let (_, after) = rest.split_once(END).unwrap();
    let wanted = format!("{before}{START}{}{END}{after}", dictionary());
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(&path, &wanted).unwrap();
    }
    assert!(
        fs::read_to_string(&path).unwrap() == wanted,
        "docs/results.md differs from the declared columns; \
         run `UPDATE_DOCS=1 cargo test --test store dictionary`"
    );
}
