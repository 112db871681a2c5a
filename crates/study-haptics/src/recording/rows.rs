//! The rows of a recording's CSV, checked one by one.
//!
//! Not a general CSV reader: every field is a number, so a comma is always a
//! border and a line is always a row. That gives exact line numbers and needs no
//! memory but the columns and one line.

use super::RecordingFault;
use sha2::{Digest as _, Sha256};
use std::io::{BufRead, Read as _};
use study_base::text::Untrusted;

/// Second differences need three.
pub(super) const LEAST_ROWS: usize = 3;
/// A hundred minutes at 10 kHz, 2.4 GB of columns.
pub(super) const MOST_ROWS: usize = 60_000_000;
/// Longer lines are no rows of numbers.
pub(super) const MOST_LINE_BYTES: usize = 65_536;
/// Header lines that are kept.
const MOST_HEADER_LINES: usize = 1000;

/// In the order of [`Rows::columns`].
pub(super) const COLUMNS: [&str; 5] = ["t_s", "x_mm", "v_mm_s", "a_m_s2", "f_n"];
/// Those that have to be there, as indices of [`COLUMNS`].
const REQUIRED: [usize; 3] = [0, 1, 4];

/// What was read: columns that were absent are empty.
#[derive(Debug)]
pub(super) struct Rows {
    pub(super) columns: [Vec<f64>; 5],
    pub(super) header: Vec<String>,
    pub(super) header_line: u64,
    pub(super) sha256: String,
}

type Fault = (u64, RecordingFault);

/// Reads all rows.
pub(super) fn read(input: impl BufRead) -> Result<Rows, Fault> {
    let mut lines = Lines::new(input);
    let mut header = Vec::new();
    let places = loop {
        let Some(line) = lines.next()? else {
            return Err((lines.number.max(1), RecordingFault::NoColumns));
        };
        if let Some(words) = line.strip_prefix(b"#") {
            if header.len() < MOST_HEADER_LINES {
                let words = words.strip_prefix(b" ").unwrap_or(words);
                header.push(String::from_utf8_lossy(words).into_owned());
            }
        } else {
            break columns(line).map_err(|fault| (lines.number, fault))?;
        }
    };
    let header_line = lines.number;
    let mut columns: [Vec<f64>; 5] = Default::default();
    let mut rows = 0;
    while let Some(line) = lines.next()? {
        if line.starts_with(b"#") {
            continue;
        }
        if rows == MOST_ROWS {
            return Err((lines.number, RecordingFault::TooLong));
        }
        row(line, &places, &mut columns).map_err(|fault| (lines.number, fault))?;
        rows += 1;
    }
    if rows < LEAST_ROWS {
        return Err((lines.number, RecordingFault::TooShort(rows)));
    }
    Ok(Rows {
        columns,
        header,
        header_line,
        sha256: lines.sha256(),
    })
}

/// For each field the column that it belongs to, if we want it.
fn columns(line: &[u8]) -> Result<Vec<Option<usize>>, RecordingFault> {
    let text = String::from_utf8_lossy(line);
    let names: Vec<&str> = text
        .split(',')
        .map(|name| name.trim().trim_matches('"'))
        .collect();
    let places: Vec<Option<usize>> = names
        .iter()
        .map(|name| COLUMNS.iter().position(|column| column == name))
        .collect();
    for (column, name) in COLUMNS.into_iter().enumerate() {
        let found = places.iter().filter(|p| **p == Some(column)).count();
        if found > 1 {
            return Err(RecordingFault::DoubleColumn(name));
        }
        if found == 0 && REQUIRED.contains(&column) {
            let found: Vec<String> = names.iter().map(|n| shown(n)).collect();
            return Err(RecordingFault::MissingColumn {
                missing: name,
                found: found.join(", "),
            });
        }
    }
    Ok(places)
}

/// Appends one row.
fn row(
    line: &[u8],
    places: &[Option<usize>],
    columns: &mut [Vec<f64>; 5],
) -> Result<(), RecordingFault> {
    let found = line.iter().filter(|byte| **byte == b',').count() + 1;
    if found != places.len() {
        return Err(RecordingFault::Ragged {
            found,
            expected: places.len(),
        });
    }
    for (field, place) in line.split(|byte| *byte == b',').zip(places) {
        let Some(column) = *place else { continue };
        let name = COLUMNS[column];
        let value: f64 = std::str::from_utf8(field)
            .ok()
            .and_then(|text| text.trim().parse().ok())
            .ok_or_else(|| RecordingFault::NotANumber {
                column: name,
                text: shown(String::from_utf8_lossy(field).trim()),
            })?;
        if !value.is_finite() {
            return Err(RecordingFault::NotFinite {
                column: name,
                value,
            });
        }
        if column == 0
            && let Some(before) = columns[0].last()
            && value <= *before
        {
            return Err(RecordingFault::Time {
                before: *before,
                now: value,
            });
        }
        columns[column].push(value);
    }
    Ok(())
}

/// Text of the file for a message: escaped, not longer than a line of it.
fn shown(text: &str) -> String {
    let cut: String = text.chars().take(40).collect();
    Untrusted(&cut).to_string()
}

/// Lines that are not blank, with their number, hashed as they go by.
struct Lines<R> {
    input: R,
    line: Vec<u8>,
    number: u64,
    hash: Sha256,
}

impl<R: BufRead> Lines<R> {
    fn new(input: R) -> Self {
        Self {
            input,
            line: Vec::new(),
            number: 0,
            hash: Sha256::new(),
        }
    }

    fn next(&mut self) -> Result<Option<&[u8]>, Fault> {
        loop {
            self.line.clear();
            let read = self
                .input
                .by_ref()
                .take(MOST_LINE_BYTES as u64 + 1)
                .read_until(b'\n', &mut self.line)
                .map_err(|e| (self.number + 1, RecordingFault::Io(e)))?;
            if read == 0 {
                return Ok(None);
            }
            self.number += 1;
            if read > MOST_LINE_BYTES {
                return Err((self.number, RecordingFault::LongLine));
            }
            self.hash.update(&self.line);
            if self.number == 1 && self.line.starts_with(b"\xef\xbb\xbf") {
                self.line.drain(..3);
            }
            if !self.line.trim_ascii().is_empty() {
                return Ok(Some(self.line.trim_ascii_end()));
            }
        }
    }

    fn sha256(self) -> String {
        let digest = self.hash.finalize();
        digest.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}
