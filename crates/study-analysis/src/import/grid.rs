//! A file as text cells: CSV with commas, semicolons or tabs, or the JSON of jsPsych.

use super::ImportError;
use serde_json::Value as Json;
use std::borrow::Cow;
use std::collections::BTreeSet;

/// What programs write where there is no value.
const MISSING: [&str; 9] = [
    "",
    "na",
    "n/a",
    "nan",
    "none",
    "null",
    "undefined",
    "--",
    ".",
];
/// The same where a name is expected; a realization may be called `none`.
const NAMELESS: [&str; 2] = ["", "na"];

/// A program of experiments, by the columns of its files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// PsychoPy, and PsychoJS.
    PsychoPy,
    /// jsPsych.
    JsPsych,
    /// OpenSesame.
    OpenSesame,
}

impl Program {
    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::PsychoPy => "PsychoPy",
            Self::JsPsych => "jsPsych",
            Self::OpenSesame => "OpenSesame",
        }
    }

    fn of(header: &[String]) -> Option<Self> {
        let has = |name: &str| header.iter().any(|h| h == name);
        let ends = |end: &str| header.iter().any(|h| h.ends_with(end));
        if has("trial_type") && has("trial_index") && has("time_elapsed") {
            Some(Self::JsPsych)
        } else if has("subject_nr") || has("opensesame_version") {
            Some(Self::OpenSesame)
        } else if has("psychopyVersion") || (has("expName") && has("date")) || ends(".thisRepN") {
            Some(Self::PsychoPy)
        } else {
            None
        }
    }
}

/// A row: the line of the file where it begins, from 1 (of JSON the number of the trial), and its
/// cells.
pub(super) type GridRow = (u64, Vec<String>);

/// A table as text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grid {
    /// The file.
    pub name: String,
    /// The program that wrote it, as far as its columns tell.
    pub program: Option<Program>,
    pub(super) header: Vec<String>,
    pub(super) rows: Vec<GridRow>,
    /// Whether numbers may have a comma before their decimals.
    pub(super) decimal_comma: bool,
}

impl Grid {
    /// Reads a file.
    ///
    /// # Errors
    /// [`ImportError`] if it is no table.
    pub fn read(name: &str, bytes: &[u8]) -> Result<Self, ImportError> {
        let name = name.to_owned();
        let Ok(text) = std::str::from_utf8(bytes) else {
            return Err(ImportError::Encoding { name });
        };
        let text = text.trim_start_matches('\u{feff}');
        let (separator, header, rows) = match text.trim_start().starts_with('[') {
            true => json(&name, text)?,
            false => csv(&name, text)?,
        };
        if rows.is_empty() {
            return Err(ImportError::Empty { name });
        }
        let mut names = BTreeSet::new();
        // A column without a name has an index that some programs write, or nothing.
        let twice = header
            .iter()
            .find(|h| !h.is_empty() && !names.insert(h.as_str()));
        if let Some(column) = twice {
            let column = column.clone();
            return Err(ImportError::TwoColumns { name, column });
        }
        Ok(Self {
            program: Program::of(&header),
            decimal_comma: separator != b',',
            name,
            header,
            rows,
        })
    }

    /// The place of a column, and the key within its cells for a name such as `response.Q0` where the cells of
    /// `response` are JSON.
    pub(super) fn place<'a>(&self, column: &'a str) -> Option<(usize, Option<&'a str>)> {
        let at = |name: &str| self.header.iter().position(|h| h == name);
        if let Some(at) = at(column) {
            return Some((at, None));
        }
        let (outer, key) = column.rsplit_once('.')?;
        let place = at(outer)?;
        let has = |(_, cells): &GridRow| member(&cells[place], key).is_some();
        self.rows.iter().any(has).then_some((place, Some(key)))
    }
}

/// A member of an object in a cell.
pub(super) fn member(cell: &str, key: &str) -> Option<String> {
    if !cell.starts_with('{') {
        return None;
    }
    let object: Json = serde_json::from_str(cell).ok()?;
    object.get(key).map(plain)
}

/// A cell, unless it says that there is no value.
pub(super) fn present(cell: &str, is_name: bool) -> Option<&str> {
    let cell = cell.trim();
    let signs: &[&str] = if is_name { &NAMELESS } else { &MISSING };
    let missing = signs.iter().any(|m| cell.eq_ignore_ascii_case(m));
    (!missing).then_some(cell)
}

/// A number with a decimal comma, with a point.
pub(super) fn with_point(cell: &str) -> Cow<'_, str> {
    let number = cell.replacen(',', ".", 1);
    match cell.contains(',') && number.parse::<f64>().is_ok() {
        true => number.into(),
        false => cell.into(),
    }
}

type Cells = (u8, Vec<String>, Vec<GridRow>);

/// The most frequent separator of the first line, outside of quotes.
fn separator(text: &str) -> u8 {
    let line = text.lines().next().unwrap_or_default();
    let outside: String = line.split('"').step_by(2).collect();
    let count = |separator: &u8| outside.bytes().filter(|b| b == separator).count();
    // Of several that are as frequent the last one wins.
    [b'\t', b';', b',']
        .into_iter()
        .max_by_key(count)
        .unwrap_or(b',')
}

fn csv(name: &str, text: &str) -> Result<Cells, ImportError> {
    let fault = |source| ImportError::Csv {
        name: name.to_owned(),
        source,
    };
    // The reader counts lines by their `\n`, and stops before it.
    let text = &text.replace("\r\n", "\n");
    let separator = separator(text);
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header: Vec<String> = reader
        .headers()
        .map_err(fault)?
        .iter()
        .map(str::to_owned)
        .collect();
    let mut rows = Vec::new();
    let (mut read, mut line) = (0, 1);
    for record in reader.records() {
        let record = record.map_err(fault)?;
        let start = record.position().map_or(read, |p| p.byte() as usize);
        // Before a row there may be empty lines.
        let empty = text[start..].bytes().take_while(|b| *b == b'\n').count();
        line += text[read..start + empty].matches('\n').count() as u64;
        read = start + empty;
        // PsychoPy ends lines with a separator; rows of nothing are from spreadsheets.
        if record.iter().all(str::is_empty) {
            continue;
        }
        if record
            .iter()
            .skip(header.len())
            .any(|cell| !cell.is_empty())
        {
            return Err(fault(csv::Error::from(std::io::Error::other(format!(
                "line {}: {} cells, but the header has {}",
                line,
                record.len(),
                header.len()
            )))));
        }
        let mut cells: Vec<String> = record
            .iter()
            .take(header.len())
            .map(str::to_owned)
            .collect();
        cells.resize(header.len(), String::new());
        rows.push((line, cells));
    }
    Ok((separator, header, rows))
}

fn json(name: &str, text: &str) -> Result<Cells, ImportError> {
    let fault = |why: String| ImportError::Json {
        name: name.to_owned(),
        why,
    };
    let trials: Vec<serde_json::Map<String, Json>> =
        serde_json::from_str(text).map_err(|e| fault(e.to_string()))?;
    let mut header: Vec<String> = Vec::new();
    let mut seen = BTreeSet::new();
    for key in trials.iter().flat_map(serde_json::Map::keys) {
        if seen.insert(key) {
            header.push(key.clone());
        }
    }
    let cell = |trial: &serde_json::Map<String, Json>, key: &String| {
        trial.get(key).map_or_else(String::new, plain)
    };
    let rows = trials.iter().zip(1..).map(|(trial, n)| {
        let cells = header.iter().map(|key| cell(trial, key));
        (n, cells.collect())
    });
    let rows = rows.collect();
    Ok((b',', header, rows))
}

/// A value as the text of a cell.
fn plain(value: &Json) -> String {
    match value {
        Json::Null => String::new(),
        Json::String(text) => text.clone(),
        other => other.to_string(),
    }
}
