//! `orders.csv`: orders from elsewhere, one line per trial: `row,position,model`.

use crate::protocol::FileOrders;
use std::collections::BTreeMap;
use std::ops::Range;
use study_base::diagnostic::{Fault, Findings};
use study_base::text::{ModelId, Untrusted};

const COLUMNS: [&str; 3] = ["row", "position", "model"];

/// Most faults that are listed; a file of another format has one in each line.
const MAX_FAULTS: usize = 20;

/// Reads `orders.csv`. The positions of a row are 1, 2, 3, …, the lines in any order.
/// The schedule checks whether the realizations fit the design. The orders are
/// complete only if the findings contain no error.
pub fn parse_orders(path: &str, text: &str) -> (FileOrders, Findings) {
    let mut lines = Lines {
        findings: Findings::new(path, text),
        rows: BTreeMap::new(),
    };
    lines.read(text);
    lines.finish()
}

struct Lines {
    findings: Findings,
    /// row → position → realization
    rows: BTreeMap<u32, BTreeMap<u32, ModelId>>,
}

impl Lines {
    fn read(&mut self, text: &str) {
        let body = text.strip_prefix('\u{feff}').unwrap_or(text);
        let skipped = text.len() - body.len();
        let mut csv = csv::ReaderBuilder::new()
            .flexible(true)
            .has_headers(false)
            .trim(csv::Trim::All)
            .from_reader(body.as_bytes());
        let mut record = csv::StringRecord::new();
        let mut header_seen = false;
        loop {
            let start = skipped + offset(csv.position());
            match csv.read_record(&mut record) {
                Ok(true) => {}
                Ok(false) => break,
                Err(e) => {
                    self.fault(Fault::error(e.to_string()));
                    break;
                }
            }
            let end = skipped + offset(csv.position());
            let span = trimmed(text, start, end);
            if header_seen {
                self.line(&record, span);
                continue;
            }
            header_seen = true;
            if record.iter().ne(COLUMNS) {
                let what = format!("the first line has to be `{}`", COLUMNS.join(","));
                return self.fault(Fault::error(what).at(span));
            }
        }
        if !header_seen {
            self.fault(Fault::error(format!(
                "the file is empty; its first line has to be `{}`",
                COLUMNS.join(",")
            )));
        }
    }

    fn line(&mut self, record: &csv::StringRecord, span: Range<usize>) {
        let (found, wanted) = (record.len(), COLUMNS.len());
        if found != wanted {
            let (line, _) = self.findings.line_and_column(span.start);
            let what = format!("line {line} has {found} of {wanted} columns");
            return self.fault(Fault::error(what).at(span));
        }
        let row = self.number("row", &record[0], &span);
        let position = self.number("position", &record[1], &span);
        let model = ModelId::new(&record[2]);
        if let Err(bad) = &model {
            self.fault(Fault::error(bad.to_string()).at(span.clone()));
        }
        let (Some(row), Some(position), Ok(model)) = (row, position, model) else {
            return;
        };
        let positions = self.rows.entry(row).or_default();
        if positions.insert(position, model).is_some() {
            self.fault(Fault::error(format!("row {row} has position {position} twice")).at(span));
        }
    }

    fn number(&mut self, what: &str, given: &str, span: &Range<usize>) -> Option<u32> {
        let number = given.parse().ok().filter(|n| *n > 0);
        if number.is_none() {
            let given = Untrusted(given);
            let what = format!("{what} has to be a whole number from 1, not `{given}`");
            self.fault(Fault::error(what).at(span.clone()));
        }
        number
    }

    fn fault(&mut self, fault: Fault) {
        if self.findings.faults.len() < MAX_FAULTS {
            self.findings.faults.push(fault);
        }
    }

    fn finish(mut self) -> (FileOrders, Findings) {
        let mut orders = FileOrders::new();
        for (row, positions) in std::mem::take(&mut self.rows) {
            let mut places = (1..).zip(positions.keys());
            if let Some((want, _)) = places.find(|(want, have)| want != *have)
                && !self.findings.has_errors()
            {
                self.fault(Fault::error(format!("row {row} has no position {want}")));
            }
            orders.insert(row, positions.into_values().collect());
        }
        (orders, self.findings)
    }
}

fn offset(position: &csv::Position) -> usize {
    usize::try_from(position.byte()).unwrap_or(usize::MAX)
}

/// The span without surrounding white space.
fn trimmed(text: &str, start: usize, end: usize) -> Range<usize> {
    let Some(line) = text.get(start..end) else {
        return start..start;
    };
    let start = start + (line.len() - line.trim_start().len());
    start..start + line.trim().len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(text: &str) -> Vec<String> {
        let (_, findings) = parse_orders("orders.csv", text);
        findings.faults.into_iter().map(|f| f.message).collect()
    }

    #[test]
    fn lines_in_any_order_become_rows_by_position() {
        let text = "\u{feff}row,position,model\r\n2,2,a\r\n2,1,b\r\n1,1,a\r\n1,2,b\r\n";
        let (orders, findings) = parse_orders("orders.csv", text);
        assert_eq!(findings.faults, []);
        let row = |n: u32| -> Vec<&str> { orders[&n].iter().map(ModelId::as_str).collect() };
        assert_eq!(row(1), ["a", "b"]);
        assert_eq!(row(2), ["b", "a"]);
    }

    #[test]
    fn every_bad_line_is_named() {
        let text = "row,position,model\n1,1\n0,1,a\n1,x,a\n1,1,a/b\n1,1,a\n1,1,b\n";
        assert_eq!(
            messages(text),
            [
                "line 2 has 2 of 3 columns",
                "row has to be a whole number from 1, not `0`",
                "position has to be a whole number from 1, not `x`",
                "`a/b` is not a model id: use 1 to 32 of A-Z a-z 0-9 . _ -",
                "row 1 has position 1 twice",
            ]
        );
        let (_, findings) = parse_orders("orders.csv", text);
        let last = findings.faults[4].span.clone().unwrap();
        assert_eq!(&text[last], "1,1,b");
    }

    #[test]
    fn a_gap_an_empty_file_and_a_foreign_header_are_faults() {
        assert_eq!(
            messages("row,position,model\n7,1,a\n7,3,b\n"),
            ["row 7 has no position 2"]
        );
        assert_eq!(messages("").len(), 1);
        assert_eq!(
            messages("subject,position,model\n1,1,a\n"),
            ["the first line has to be `row,position,model`"]
        );
    }
}
