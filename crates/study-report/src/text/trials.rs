//! The page of thresholds, sensitivities and preferences.

use super::Page;
use super::layout::{Grid, Paint, wrap};
use crate::apa::name;
use crate::part_answers::{answered, answers, banner, caveats};
use crate::table::{Column, Medium, Table};
use crate::tables::parts::tables;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::psychophysics::results::PartResults;
use study_base::text::{Untrusted, counted};

/// The statistics of a table of trials.
pub fn trials(title: &str, task: &str, rows: usize, results: &PartResults, page: Page) -> String {
    let paint = Paint(page.color);
    let mut out = paint.strong(&name(title));
    out += &format!("\n{task}, {}\n\n", counted(rows, "row", "rows"));
    out + &all_tables(results, page)
}

/// A part of a study: its tables, answers and caveats.
pub fn part(title: &str, part: &PartAnalysis, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let paint = Paint(page.color);
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
    out += &all_tables(&part.results, page);
    for answer in answered(part) {
        out += &paint.strong(&Untrusted(&answer.question).to_string());
        out.push('\n');
        for sentence in [answer.short].iter().chain(&answer.main) {
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

fn all_tables(results: &PartResults, page: Page) -> String {
    let width = page.width.clamp(60, 100);
    let paint = Paint(page.color);
    let tables = tables(results);
    (tables.iter().map(|table| one(table, width, paint))).collect()
}

fn one(table: &Table, width: usize, paint: Paint) -> String {
    let mut out = String::new();
    let grid = Grid::of(table, Some(1));
    if !table.is_empty() {
        out = grid.render(width, table.len(), paint);
    }
    let columns = table.columns(Medium::Terminal);
    let shown: Vec<&Column> = grid.shown(width).iter().map(|i| columns[*i]).collect();
    let notes = table.notes_with(&shown);
    for (i, note) in notes.iter().enumerate() {
        out += &wrap(note, width, "", if i == 0 { "" } else { "  " });
    }
    if !notes.is_empty() {
        out.push('\n');
    }
    out
}
