//! The page of thresholds, sensitivities and preferences.

use super::Page;
use super::layout::{Grid, Paint, wrap};
use crate::report::apa::name;
use crate::report::part_answers::{Answered, answered, answers, banner, caveats};
use crate::report::part_tables::{PartCell, PartTable, tables};
use study_base::text::{Untrusted, counted};
use study_core::analyze::Values;
use study_core::analyze::psychophysics::PartAnalysis;

/// The statistics of a table of trials.
pub fn trials(title: &str, task: &str, rows: usize, values: &Values, page: Page) -> String {
    let paint = Paint(page.colour);
    let mut out = paint.strong(&name(title));
    out += &format!("\n{task}, {}\n\n", counted(rows, "row", "rows"));
    out + &all_tables(values, page)
}

/// A part of a study: its tables, answers and caveats.
pub fn part(title: &str, part: &PartAnalysis, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let paint = Paint(page.colour);
    let mut out = paint.strong(&name(title));
    out += &format!(
        "\n{}, {}, {}\n",
        part.task,
        answers(part),
        counted(part.participants, "participant", "participants")
    );
    if let Some(text) = banner(part) {
        out += &paint.warn(&format!("{text}\n"));
    }
    out.push('\n');
    out += &all_tables(&part.values, page);
    for Answered {
        question,
        short,
        more,
    } in answered(part)
    {
        out += &paint.strong(&Untrusted(&question).to_string());
        out.push('\n');
        for sentence in [short].iter().chain(&more) {
            out += &wrap(&Untrusted(sentence).to_string(), width, "  ", "  ");
        }
        out.push('\n');
    }
    for text in caveats(part) {
        let text = wrap(&Untrusted(&text).to_string(), width, "! ", "  ");
        out += &paint.warn(&text);
    }
    out
}

fn all_tables(values: &Values, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let tables = tables(values);
    (tables
        .iter()
        .map(|table| one(table, width, Paint(page.colour))))
    .collect()
}

fn one(table: &PartTable, width: usize, paint: Paint) -> String {
    let mut out = String::new();
    if !table.rows.is_empty() {
        let mut grid = Grid::new(&table.head(), Some(1), &[]);
        for row in &table.rows {
            grid.row(row.iter().map(PartCell::shown).collect());
        }
        out = grid.render(width, table.rows.len(), paint);
    }
    for (i, note) in table.notes.iter().enumerate() {
        out += &wrap(note, width, "", if i == 0 { "" } else { "  " });
    }
    if !table.notes.is_empty() {
        out.push('\n');
    }
    out
}
