//! The main tables.

use crate::table::{Cell, MAX_ROWS, Medium, Table};
use crate::tables;
use maud::{Markup, html};
use study_analysis::analyze::Analysis;

use super::{safe, typeset};

/// Largest number of rows of a table that is kept on one printed page.
const MAX_WHOLE: usize = 10;

/// A table with its caption and the notes below it; nothing if it is empty.
pub(super) fn table(t: &Table) -> Markup {
    html! {
        @if !t.is_empty() { (grid(t, true)) }
        @for note in t.notes(Medium::Report) { p.note { (typeset(note)) } }
    }
}

/// The first rows of a table, with or without its caption, and how many more there are.
pub(super) fn grid(t: &Table, captioned: bool) -> Markup {
    let columns = t.columns(Medium::Report);
    let wraps = |column: usize| columns[column].head.wraps.then_some("text");
    html! {
        div.scroll.whole[t.len() <= MAX_WHOLE] tabindex="0" role="region" aria-label=(t.caption) {
            table {
                @if captioned { caption { (t.caption) } }
                thead { tr {
                    @for (i, head) in t.heads(Medium::Report).iter().enumerate() {
                        // An empty header heads nothing.
                        @if head.is_empty() { td {} } @else {
                            th class=[wraps(i)] scope="col" { (safe(head)) }
                        }
                    }
                } }
                tbody {
                    @for (apart, cells) in t.rows(Medium::Report).iter().take(MAX_ROWS) {
                        tr class=[apart.then_some("italic")] {
                            @for (i, cell) in cells.iter().enumerate() { td class=[wraps(i)] { (shown(cell)) } }
                        }
                    }
                }
            }
        }
        @if t.len() > MAX_ROWS {
            p.note { (t.len() - MAX_ROWS) " more rows are in the CSV file." }
        }
    }
}

fn shown(cell: &Cell) -> Markup {
    let text = safe(&cell.shown());
    match cell {
        Cell::Code(_) => html! { code { (text) } },
        _ => html! { (text) },
    }
}

pub(super) fn section(a: &Analysis) -> Markup {
    let mut all = vec![
        tables::factors::effects(a),
        tables::factors::means(a),
        tables::factors::contrasts(a),
        tables::realizations(a, ""),
        tables::missing(a),
        tables::pairs(a),
        tables::outcomes::means(a),
        tables::outcomes::tests(a),
    ];
    all.extend(tables::against_references(a));
    all.extend([
        tables::posterior(a),
        tables::repeats(a),
        tables::variance(a),
        tables::agreement(a),
        tables::with_and_without(a),
        tables::subjects(a),
    ]);
    html! {
        section {
            h2 { "Tables" }
            @for t in &all { (table(t)) }
        }
    }
}
