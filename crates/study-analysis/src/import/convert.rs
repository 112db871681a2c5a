//! The rows of a file as rows of a table that `analyze` reads.

use super::grid::{Grid, member, present, with_point};
use super::mapping::{FILE, Mapping, ORDER};
use super::{ImportError, Kind, Taken};
use std::collections::BTreeMap;

/// Columns of the result with numbers.
const NUMBERS: [&str; 8] = [
    "rating",
    "vaf",
    "level",
    "estimate",
    "positive",
    "trials",
    "repetition",
    "trial_index",
];

/// Columns of the result in which a word such as `none` is no name.
const ANSWERS: [&str; 11] = [
    "rating",
    "vaf",
    "level",
    "estimate",
    "positive",
    "trials",
    "repetition",
    "trial_index",
    "answer",
    "correct",
    "target",
];

/// What a file gives.
pub(super) struct Converted {
    pub(super) rows: Vec<ConvertedRow>,
    pub(super) taken: Taken,
}

/// A row of the result.
pub(super) struct ConvertedRow {
    /// The line of the file that it is from.
    pub(super) line: u64,
    /// In the order of [`header`]; the participant is the first.
    pub(super) cells: Vec<String>,
}

/// The columns of the result.
pub(super) fn header(mapping: &Mapping, kind: Kind) -> Vec<String> {
    let told = |field: &&str| match *field {
        "model" | "rating" if !mapping.wide.is_empty() => true,
        "model" => mapping.columns.contains_key(*field) || !mapping.keep.is_empty(),
        "repetition" => {
            let numbered = mapping.wide.iter().any(|w| w.contains(REPETITION));
            numbered || mapping.columns.contains_key(*field)
        }
        field => mapping.columns.contains_key(field),
    };
    let own = kind.columns().iter().copied().filter(told);
    own.map(str::to_owned)
        .chain(mapping.keep.iter().cloned())
        .collect()
}

/// A line of CSV.
pub(super) fn line(cells: &[String]) -> String {
    let cells = cells
        .iter()
        .map(|cell| match cell.contains([',', '"', '\n', '\r']) {
            true => format!("\"{}\"", cell.replace('"', "\"\"")),
            false => cell.clone(),
        });
    cells.collect::<Vec<_>>().join(",") + "\n"
}

/// In the names of a wide table: the realization, and its repetition.
const MODEL: &str = "{model}";
const REPETITION: &str = "{repetition}";

/// A column of a wide table: its place, its realization and its repetition.
struct Wide {
    at: usize,
    model: String,
    repetition: Option<String>,
}

/// What a name has in the places of a pattern.
fn fitted(pattern: &str, name: &str) -> Option<(String, Option<String>)> {
    let (before, after) = pattern.split_once(MODEL)?;
    let owned = |text: &str| Some(text.to_owned()).filter(|text| !text.is_empty());
    if let Some((between, end)) = after.split_once(REPETITION) {
        let inner = name.strip_prefix(before)?.strip_suffix(end)?;
        let (model, repetition) = inner.rsplit_once(between).filter(|_| !between.is_empty())?;
        return Some((owned(model)?, Some(whole(repetition)?)));
    }
    if let Some((start, between)) = before.split_once(REPETITION) {
        let inner = name.strip_prefix(start)?.strip_suffix(after)?;
        let (repetition, model) = inner.split_once(between).filter(|_| !between.is_empty())?;
        return Some((owned(model)?, Some(whole(repetition)?)));
    }
    Some((
        owned(name.strip_prefix(before)?.strip_suffix(after)?)?,
        None,
    ))
}

/// A repetition is a number.
fn whole(text: &str) -> Option<String> {
    text.parse::<u32>().ok().map(|n| n.to_string())
}

/// The columns of a wide table.
fn wide(mapping: &Mapping, grid: &Grid) -> Result<Vec<Wide>, ImportError> {
    let mut found = Vec::new();
    for pattern in &mapping.wide {
        if !pattern.contains(MODEL) {
            let (at, _) = Mapping::place(pattern, grid)?;
            found.push(Wide {
                at,
                model: pattern.clone(),
                repetition: None,
            });
            continue;
        }
        let fitting = grid.header.iter().enumerate().filter_map(|(at, name)| {
            let (model, repetition) = fitted(pattern, name)?;
            Some(Wide {
                at,
                model,
                repetition,
            })
        });
        let before = found.len();
        found.extend(fitting);
        if found.len() == before {
            let shown = study_base::text::Untrusted(pattern);
            return Err(ImportError::Mapping(format!(
                "{}: no column is named like `{shown}`",
                grid.name
            )));
        }
    }
    Ok(found)
}

/// Where the cell of a column of the result is from.
enum Source<'a> {
    File,
    Order,
    Place(usize, Option<&'a str>),
    /// Of a wide table, told by the column.
    Wide(&'static str),
    /// The realization as the combination of the columns that are kept.
    Levels(Vec<(usize, Option<&'a str>)>),
}

impl Converted {
    /// Converts the rows of a file. `counts` has the trials of each participant so far.
    pub(super) fn of(
        grid: &Grid,
        mapping: &Mapping,
        kind: Kind,
        counts: &mut BTreeMap<String, usize>,
    ) -> Result<Self, ImportError> {
        let wide = wide(mapping, grid)?;
        let filters = (mapping.rows.iter())
            .map(|(column, wanted)| Ok((Mapping::place(column, grid)?, wanted)))
            .collect::<Result<Vec<_>, ImportError>>()?;
        let sources = header(mapping, kind)
            .into_iter()
            .map(|field| Ok((source(&field, mapping, grid)?, field)))
            .collect::<Result<Vec<_>, ImportError>>()?;
        let mut taken = Taken {
            name: grid.name.clone(),
            program: grid.program,
            rows: grid.rows.len(),
            taken: 0,
            unrated: 0,
            filtered: 0,
            others: 0,
        };
        let mut rows = Vec::new();
        for (line, cells) in &grid.rows {
            let is = |((at, key), wanted): &((usize, Option<&str>), &Vec<String>)| {
                let cell = text(&cells[*at], *key);
                wanted.contains(&cell)
            };
            if !filters.iter().all(is) {
                taken.filtered += 1;
                continue;
            }
            let columns: Vec<Option<&Wide>> = match wide.is_empty() {
                true => vec![None],
                false => wide.iter().map(Some).collect(),
            };
            for column in columns {
                let cell = |(source, field): &(Source<'_>, String)| {
                    cell(source, field, cells, column, grid, mapping)
                };
                let mut row: Vec<String> = sources.iter().map(cell).collect();
                if !is_trial(&sources, &row, kind, mapping) {
                    taken.others += 1;
                    continue;
                }
                let count = counts.entry(row[0].clone()).or_default();
                *count += 1;
                for (value, (source, field)) in row.iter_mut().zip(&sources) {
                    if matches!(source, Source::Order) {
                        *value = count.to_string();
                    }
                    if kind == Kind::Ratings && field == "rating" && value.is_empty() {
                        taken.unrated += 1;
                    }
                }
                rows.push(ConvertedRow {
                    line: *line,
                    cells: row,
                });
            }
        }
        taken.taken = rows.len();
        Ok(Self { rows, taken })
    }
}

/// Where a column of the result is from.
fn source<'a>(field: &str, mapping: &'a Mapping, grid: &Grid) -> Result<Source<'a>, ImportError> {
    if !mapping.wide.is_empty() && !mapping.columns.contains_key(field) {
        match field {
            "model" => return Ok(Source::Wide("model")),
            "rating" => return Ok(Source::Wide("rating")),
            "repetition" => return Ok(Source::Wide("repetition")),
            _ => {}
        }
    }
    let stated = mapping.columns.get(field);
    if field == "model" && stated.is_none() {
        let places = mapping.keep.iter().map(|kept| Mapping::place(kept, grid));
        return Ok(Source::Levels(places.collect::<Result<_, _>>()?));
    }
    // A column that is kept has its own name.
    let column = stated.or_else(|| mapping.keep.iter().find(|kept| *kept == field));
    match column.map(String::as_str) {
        Some(FILE) => Ok(Source::File),
        Some(ORDER) => Ok(Source::Order),
        Some(column) => {
            let (at, key) = Mapping::place(column, grid)?;
            Ok(Source::Place(at, key))
        }
        None => Err(ImportError::Mapping(format!("no column for `{field}`"))),
    }
}

/// A cell, or a member of the object in it.
fn text(cell: &str, key: Option<&str>) -> String {
    match key {
        Some(key) => member(cell, key).unwrap_or_default(),
        None => cell.to_owned(),
    }
}

fn cell(
    source: &Source<'_>,
    field: &str,
    cells: &[String],
    wide: Option<&Wide>,
    grid: &Grid,
    mapping: &Mapping,
) -> String {
    let found = match (source, wide) {
        (Source::File, _) => {
            let path = std::path::Path::new(&grid.name);
            path.file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        }
        (Source::Place(at, key), _) => text(&cells[*at], *key),
        (Source::Wide("model"), Some(wide)) => wide.model.clone(),
        (Source::Wide("repetition"), Some(wide)) => wide.repetition.clone().unwrap_or_default(),
        (Source::Wide(_), Some(wide)) => cells[wide.at].clone(),
        // As `study analyze --factor` names them.
        (Source::Levels(places), _) => {
            let levels = places.iter().map(|(at, key)| text(&cells[*at], *key));
            levels.collect::<Vec<_>>().join(", ")
        }
        (Source::Order | Source::Wide(_), _) => String::new(),
    };
    let is_name = !ANSWERS.contains(&field);
    let Some(found) = present(&found, is_name) else {
        return String::new();
    };
    let meant = mapping.words.get(field).and_then(|words| words.get(found));
    let found = meant.map_or(found, String::as_str);
    match grid.decimal_comma && NUMBERS.contains(&field) {
        true => with_point(found).into_owned(),
        false => found.to_owned(),
    }
}

/// Whether a row is a trial: it has a realization, or of other kinds an answer. A participant who did
/// not rate a realization of a wide table has not seen it.
fn is_trial(
    sources: &[(Source<'_>, String)],
    row: &[String],
    kind: Kind,
    mapping: &Mapping,
) -> bool {
    let cells = || sources.iter().map(|(_, field)| field.as_str()).zip(row);
    let has = |name: &str| cells().any(|(field, cell)| field == name && !cell.is_empty());
    match kind {
        Kind::Ratings if !mapping.wide.is_empty() => has("rating"),
        Kind::Ratings if mapping.columns.contains_key("model") => has("model"),
        Kind::Ratings => mapping.keep.iter().all(|name| has(name)),
        Kind::Task(_) => kind.answers().iter().any(|name| has(name)),
    }
}
