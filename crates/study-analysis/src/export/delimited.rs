//! Tables as text: CSV (RFC 4180) and the tab-separated tables of BIDS.

use super::table::{Table, Type, clean};
use std::borrow::Cow;
use study_session::outcome::cell::Cell;

/// How a CSV is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dialect {
    /// Between two cells.
    pub separator: char,
    /// Whether numbers have a decimal comma.
    pub decimal_comma: bool,
    /// Whether the file begins with a byte order mark.
    pub bom: bool,
    /// Whether text that a spreadsheet could take for a formula gets an apostrophe.
    pub safe: bool,
}

impl Default for Dialect {
    fn default() -> Self {
        Self {
            separator: ',',
            decimal_comma: false,
            bom: false,
            safe: false,
        }
    }
}

/// Whether a spreadsheet could take a text for a formula.
pub(super) fn is_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@', '\t', '\r'])
}

/// Adds a cell to a CSV, quoted if it has to be.
fn push(out: &mut String, text: &str, separator: char) {
    if text.contains(['"', '\n', '\r', separator]) {
        out.push('"');
        out.push_str(&text.replace('"', "\"\""));
        out.push('"');
    } else {
        out.push_str(text);
    }
}

/// The text of a cell.
fn shown(cell: &Cell<'_>, dialect: &Dialect) -> String {
    match cell {
        Cell::Number(_) if dialect.decimal_comma => cell.to_string().replace('.', ","),
        Cell::Text(text) => guarded(text, dialect),
        _ => cell.to_string(),
    }
}

fn guarded(text: &str, dialect: &Dialect) -> String {
    let guard = dialect.safe && is_formula(text);
    let guard = if guard { "'" } else { "" };
    format!("{guard}{}", clean(text))
}

/// Lines of a CSV.
pub(super) fn lines<'t>(
    records: impl IntoIterator<Item = Vec<Cow<'t, str>>>,
    dialect: &Dialect,
) -> Vec<u8> {
    let mut out = String::from(if dialect.bom { "\u{feff}" } else { "" });
    for record in records {
        for (i, text) in record.iter().enumerate() {
            if i > 0 {
                out.push(dialect.separator);
            }
            push(&mut out, text, dialect.separator);
        }
        out.push('\n');
    }
    out.into_bytes()
}

/// A table as CSV.
pub(super) fn csv(table: &Table<'_>, dialect: &Dialect) -> Vec<u8> {
    let head = (table.fields.iter()).map(|f| guarded(&f.name, dialect).into());
    let rows =
        (table.rows.iter()).map(|row| row.iter().map(|c| shown(c, dialect).into()).collect());
    lines(std::iter::once(head.collect()).chain(rows), dialect)
}

/// Number of text cells that a spreadsheet could take for a formula.
pub(super) fn formulas(table: &Table<'_>) -> usize {
    let cells = table.rows.iter().flatten();
    cells
        .filter(|cell| matches!(cell, Cell::Text(text) if is_formula(text)))
        .count()
}

/// What stands for a missing value in BIDS.
pub(super) const MISSING: &str = "n/a";

/// A cell of a BIDS table: without tabs, line breaks and control characters, never empty.
pub(super) fn bids_cell(text: &str) -> String {
    let flat = text.replace("\r\n", " ").replace(char::is_control, " ");
    match flat.trim() {
        "" => MISSING.to_owned(),
        trimmed => trimmed.to_owned(),
    }
}

/// Some rows of a table as tab-separated text, and how many cells had a tab or a line
/// break.
pub(super) fn tsv<'t, 'a: 't>(
    names: &[&str],
    rows: impl IntoIterator<Item = &'t [Cell<'a>]>,
) -> (Vec<u8>, usize) {
    let mut out = names.join("\t") + "\n";
    let mut changed = 0;
    for row in rows {
        for (i, cell) in row.iter().enumerate() {
            if i > 0 {
                out.push('\t');
            }
            let text = cell.to_string();
            changed += usize::from(text.contains(char::is_control));
            out.push_str(&bids_cell(&text));
        }
        out.push('\n');
    }
    (out.into_bytes(), changed)
}

/// The dictionary of some tables: one row for each column.
pub(super) fn dictionary(tables: &[&Table<'_>], dialect: &Dialect) -> Vec<u8> {
    let head = [
        "table", "column", "question", "type", "level", "unit", "min", "max", "meaning", "empty_if",
    ];
    let mut records = vec![head.map(Cow::Borrowed).to_vec()];
    for table in tables {
        for f in &table.fields {
            let number = |x: Option<f64>| match x {
                Some(x) => shown(&Cell::Number(x), dialect),
                None => String::new(),
            };
            let text = |t: &str| Cow::Owned(guarded(t, dialect));
            records.push(vec![
                text(table.name),
                text(&f.name),
                text(f.title.as_deref().unwrap_or_default()),
                f.type_name().into(),
                f.measurement().into(),
                text(f.unit.as_deref().unwrap_or_default()),
                number(f.min).into(),
                number(f.max).into(),
                text(&f.meaning),
                text(f.empty.as_deref().unwrap_or_default()),
            ]);
        }
    }
    lines(records, dialect)
}

/// The labels of the values: one row for each value of each column.
pub(super) fn labels(tables: &[&Table<'_>], dialect: &Dialect) -> Vec<u8> {
    let mut records = vec![
        ["table", "column", "value", "label"]
            .map(Cow::Borrowed)
            .to_vec(),
    ];
    for table in tables {
        for f in &table.fields {
            for (value, label) in &f.levels {
                let value = match f.kind {
                    Type::Text => guarded(value, dialect),
                    _ => value.clone(),
                };
                records.push(vec![
                    table.name.into(),
                    guarded(&f.name, dialect).into(),
                    value.into(),
                    guarded(label, dialect).into(),
                ]);
            }
        }
    }
    lines(records, dialect)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::table::Field;
    use proptest::prelude::*;

    fn table(texts: &[String]) -> Table<'_> {
        Table {
            name: "t",
            meaning: "",
            fields: vec![
                Field::new(Type::Text, "-x", ""),
                Field::new(Type::Number, "y", ""),
            ],
            rows: (texts.iter())
                .map(|t| vec![Cell::Text(t.as_str().into()), Cell::Number(-1.5)])
                .collect(),
            key: &[],
            refers: &[],
        }
    }

    fn hostile() -> impl Strategy<Value = String> {
        let pieces = prop::sample::select(vec![
            "=1+1",
            "+",
            "-2",
            "@x",
            "\t",
            "\r",
            "\n",
            "\r\n",
            "\"",
            ",",
            ";",
            "'",
            "\u{202e}",
            "😀",
            "\u{feff}",
            "\0",
            "\u{7f}",
            " ",
            "n/a",
            "</script>",
            "よ",
            "..",
            "/",
        ]);
        prop::collection::vec(pieces, 0..6).prop_map(|p| p.concat())
    }

    proptest! {
        #[test]
        fn a_csv_reads_back_as_its_text(
            texts in prop::collection::vec(hostile(), 1..6),
            semicolon in any::<bool>(),
        ) {
            let dialect = Dialect {
                separator: if semicolon { ';' } else { ',' },
                decimal_comma: semicolon,
                ..Dialect::default()
            };
            let bytes = csv(&table(&texts), &dialect);
            let mut reader = csv::ReaderBuilder::new()
                .delimiter(dialect.separator as u8)
                .from_reader(&bytes[..]);
            let number = if semicolon { "-1,5" } else { "-1.5" };
            let read: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
            prop_assert_eq!(read.len(), texts.len());
            for (record, text) in read.iter().zip(&texts) {
                prop_assert_eq!(&record[0], clean(text));
                prop_assert_eq!(&record[1], number);
            }
        }

        #[test]
        fn a_safe_csv_has_no_text_that_begins_as_a_formula(
            texts in prop::collection::vec(hostile(), 1..6),
        ) {
            let dialect = Dialect { safe: true, ..Dialect::default() };
            let bytes = csv(&table(&texts), &dialect);
            let mut reader = csv::Reader::from_reader(&bytes[..]);
            prop_assert_eq!(&reader.headers().unwrap()[0], "'-x");
            for (record, text) in reader.records().zip(&texts) {
                let record = record.unwrap();
                prop_assert!(!is_formula(&record[0]));
                prop_assert_eq!(record[0].strip_prefix('\'').unwrap_or(&record[0]), {
                    let own = clean(text);
                    own.strip_prefix('\'').unwrap_or(&own).to_owned()
                });
                prop_assert_eq!(&record[1], "-1.5", "a number has no apostrophe");
            }
        }

        #[test]
        fn a_bids_table_has_its_cells_and_no_empty_one(texts in prop::collection::vec(hostile(), 1..6)) {
            let table = table(&texts);
            let (bytes, changed) = tsv(&["a", "b"], table.rows.iter().map(Vec::as_slice));
            let text = String::from_utf8(bytes).unwrap();
            let lines: Vec<&str> = text.strip_suffix('\n').unwrap().split('\n').collect();
            prop_assert_eq!(lines.len(), texts.len() + 1);
            for line in &lines {
                let cells: Vec<&str> = line.split('\t').collect();
                prop_assert_eq!(cells.len(), 2);
                prop_assert!(cells.iter().all(|c| !c.is_empty() && !c.contains(char::is_control)));
            }
            prop_assert_eq!(changed, texts.iter().filter(|t| t.contains(char::is_control)).count());
        }
    }

    #[test]
    fn a_byte_order_mark_comes_first() {
        let texts = ["a".to_owned()];
        let dialect = Dialect {
            bom: true,
            ..Dialect::default()
        };
        assert_eq!(
            csv(&table(&texts), &dialect),
            "\u{feff}-x,y\na,-1.5\n".as_bytes()
        );
    }
}
