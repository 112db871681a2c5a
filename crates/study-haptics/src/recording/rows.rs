//! Reading the rows of a recording's CSV file.
//!
//! Not a general CSV reader: every field is a number, so a separator always separates
//! fields and a line is always a row. This gives exact line numbers and needs no memory
//! except for the columns and one line. The separator is a semicolon or a tab if the line
//! of column names has one, and a comma otherwise; numbers may have decimal commas unless
//! the comma is the separator.

use super::RecordingFault;
use super::names::{COLUMNS, Names};
use std::io::{BufRead, Read as _};
use study_base::hex::Digest;
use study_base::text::Untrusted;

/// Least number of rows: second differences need three.
pub(super) const MIN_ROWS: usize = 3;
/// Most rows: a hundred minutes at 10 kHz, 2.4 GB of columns.
pub(super) const MAX_ROWS: usize = 60_000_000;
/// Longer lines cannot be rows of numbers.
pub(super) const MAX_LINE_BYTES: usize = 65_536;
/// Most header lines that are stored.
const MAX_HEADER_LINES: usize = 1000;

/// The required ones, as indices of [`COLUMNS`].
const REQUIRED: [usize; 3] = [0, 1, 4];

/// The contents of a file.
#[derive(Debug)]
pub(super) struct Rows {
    pub(super) t_s: Vec<f64>,
    pub(super) x_mm: Vec<f64>,
    pub(super) v_mm_s: Option<Vec<f64>>,
    pub(super) a_m_s2: Option<Vec<f64>>,
    pub(super) f_n: Vec<f64>,
    /// The `#` lines above the column names.
    pub(super) header: Vec<String>,
    /// Number of the line of column names.
    pub(super) header_line: u64,
    pub(super) sha256: String,
    /// What separates fields, unless it is a comma.
    pub(super) separator: Option<&'static str>,
    /// Rows that repeat the one before in all columns and are left out: their number and the first line.
    pub(super) repeated: Option<(usize, u64)>,
}

type Fault = (u64, RecordingFault);

/// Reads all rows.
pub(super) fn read(input: impl BufRead, names: &Names) -> Result<Rows, Fault> {
    let mut lines = Lines::new(input);
    let mut header = Vec::new();
    let (fields, separator) = loop {
        let Some(line) = lines.next()? else {
            return Err((lines.number.max(1), RecordingFault::NoColumns));
        };
        if let Some(text) = line.strip_prefix(b"#") {
            if header.len() < MAX_HEADER_LINES {
                let text = text.strip_prefix(b" ").unwrap_or(text);
                header.push(String::from_utf8_lossy(text).into_owned());
            }
        } else {
            let separator = separator(line);
            let fields = columns(line, separator, names);
            break (fields.map_err(|fault| (lines.number, fault))?, separator);
        }
    };
    let header_line = lines.number;
    let mut columns: [Vec<f64>; 5] = Default::default();
    let (mut rows, mut repeated) = (0, None);
    while let Some(line) = lines.next()? {
        if line.starts_with(b"#") {
            continue;
        }
        if rows == MAX_ROWS {
            return Err((lines.number, RecordingFault::TooLong));
        }
        let values = row(line, separator, &fields, names).map_err(|fault| (lines.number, fault))?;
        let last = |column: &Vec<f64>| column.last().copied();
        if let Some(before) = last(&columns[0])
            && values[0] <= Some(before)
        {
            if values == [0, 1, 2, 3, 4].map(|k| last(&columns[k])) {
                let (count, first) = repeated.unwrap_or((0, lines.number));
                repeated = Some((count + 1, first));
                continue;
            }
            let now = values[0].unwrap_or(before);
            return Err((lines.number, RecordingFault::Time { before, now }));
        }
        for (column, value) in columns.iter_mut().zip(values) {
            column.extend(value);
        }
        rows += 1;
    }
    if rows < MIN_ROWS {
        return Err((lines.number, RecordingFault::TooShort(rows)));
    }
    let given = |column: usize| fields.contains(&Some(column));
    let [t_s, x_mm, v_mm_s, a_m_s2, f_n] = columns;
    Ok(Rows {
        t_s,
        x_mm,
        v_mm_s: given(2).then_some(v_mm_s),
        a_m_s2: given(3).then_some(a_m_s2),
        f_n,
        header,
        header_line,
        sha256: lines.sha256(),
        separator: match separator {
            b';' => Some("semicolons"),
            b'\t' => Some("tabs"),
            _ => None,
        },
        repeated,
    })
}

/// What separates the fields of a file with these column names.
pub(super) fn separator(line: &[u8]) -> u8 {
    let has = |byte: &u8| line.contains(byte);
    *[b';', b'\t'].iter().find(|byte| has(byte)).unwrap_or(&b',')
}

/// For each field the index of its column in [`COLUMNS`]; `None` for other columns.
fn columns(line: &[u8], separator: u8, own: &Names) -> Result<Vec<Option<usize>>, RecordingFault> {
    let text = String::from_utf8_lossy(line);
    let names: Vec<&str> = text
        .split(char::from(separator))
        .map(|name| name.trim().trim_matches('"'))
        .collect();
    let fields: Vec<Option<usize>> = names.iter().map(|name| own.column(name)).collect();
    for (column, name) in COLUMNS.into_iter().enumerate() {
        let found = fields.iter().filter(|f| **f == Some(column)).count();
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
    Ok(fields)
}

/// The values of one row, `None` for columns that the file does not have.
fn row(
    line: &[u8],
    separator: u8,
    fields: &[Option<usize>],
    names: &Names,
) -> Result<[Option<f64>; 5], RecordingFault> {
    let mut values = [None; 5];
    let found = line.iter().filter(|byte| **byte == separator).count() + 1;
    if found != fields.len() {
        return Err(RecordingFault::Ragged {
            found,
            expected: fields.len(),
        });
    }
    for (field, column) in line.split(|byte| *byte == separator).zip(fields) {
        let Some(column) = *column else { continue };
        let name = COLUMNS[column];
        let value: f64 = std::str::from_utf8(field)
            .ok()
            .and_then(|text| number(text.trim(), separator))
            .ok_or_else(|| RecordingFault::NotANumber {
                column: name,
                text: shown(String::from_utf8_lossy(field).trim()),
            })?;
        let value = value * names.factor(column);
        if !value.is_finite() {
            return Err(RecordingFault::NotFinite {
                column: name,
                value,
            });
        }
        values[column] = Some(value);
    }
    Ok(values)
}

/// A number, with a decimal comma unless the comma separates fields.
pub(super) fn number(text: &str, separator: u8) -> Option<f64> {
    match text.parse() {
        Err(_) if separator != b',' && text.contains(',') => {
            text.replacen(',', ".", 1).parse().ok()
        }
        parsed => parsed.ok(),
    }
}

/// Text of the file for a message: truncated and escaped.
pub(super) fn shown(text: &str) -> String {
    let cut: String = text.chars().take(40).collect();
    Untrusted(&cut).to_string()
}

/// An iterator over the lines that are not blank, with line numbers; hashes all lines.
struct Lines<R> {
    input: R,
    line: Vec<u8>,
    number: u64,
    hash: Digest,
}

impl<R: BufRead> Lines<R> {
    fn new(input: R) -> Self {
        Self {
            input,
            line: Vec::new(),
            number: 0,
            hash: Digest::default(),
        }
    }

    fn next(&mut self) -> Result<Option<&[u8]>, Fault> {
        loop {
            self.line.clear();
            let read = self
                .input
                .by_ref()
                .take(MAX_LINE_BYTES as u64 + 1)
                .read_until(b'\n', &mut self.line)
                .map_err(|e| (self.number + 1, RecordingFault::Io(e)))?;
            if read == 0 {
                return Ok(None);
            }
            self.number += 1;
            if read > MAX_LINE_BYTES {
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
        self.hash.finish()
    }
}
