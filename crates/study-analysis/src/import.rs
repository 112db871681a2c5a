//! Tables that other programs of experiments wrote, as the tables that `analyze` reads.
//!
//! Nothing is interpreted here: columns get the names that `analyze` knows, rows that are no
//! trials are left out, several files become one. What the cells mean is decided by the
//! readers of [`Ratings`] and of [`TableKind`], which read the result before it is handed over; their errors
//! name the file and the line that the cell came from.

mod convert;
mod error;
mod grid;
mod mapping;

pub use error::ImportError;
pub use grid::{Grid, Program};
pub use mapping::{FORMAT, Mapping};

use crate::analyze::psychophysics::{TableError, TableKind, read_table};
use convert::Converted;
use std::collections::{BTreeMap, BTreeSet};
use study_session::outcome::ratings::{Ratings, RatingsError};

/// What the rows of the result are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Ratings of realizations: `study analyze TABLE`.
    Ratings,
    /// A table of `study analyze TABLE --task`.
    Task(TableKind),
}

impl Kind {
    /// The name of ratings.
    const RATINGS: &'static str = "ratings";

    /// The kind of a name: `ratings`, or a task of `study analyze --task`.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            Self::RATINGS => Some(Self::Ratings),
            task => TableKind::named(task).map(Self::Task),
        }
    }

    /// All names.
    pub fn names() -> impl Iterator<Item = &'static str> {
        std::iter::once(Self::RATINGS).chain(TableKind::names())
    }

    /// The columns that a table of this kind may have, in the order in which they are written.
    pub fn columns(self) -> &'static [&'static str] {
        match self {
            Self::Ratings => &[
                "subject",
                "model",
                "rating",
                "repetition",
                "trial_index",
                "vaf",
                "role",
            ],
            Self::Task(TableKind::Trials(_)) => &[
                "participant",
                "condition",
                "level",
                "target",
                "answer",
                "correct",
                "positive",
                "trials",
            ],
            Self::Task(TableKind::Pairs) => &["participant", "first", "second", "answer"],
            Self::Task(TableKind::Magnitude) => &["participant", "level", "estimate"],
            Self::Task(TableKind::Mushra) => &["participant", "condition", "role", "rating"],
            Self::Task(TableKind::Identification) => {
                &["participant", "realization", "target", "answer"]
            }
            Self::Task(TableKind::Similarity) => &["participant", "first", "second", "rating"],
            Self::Task(TableKind::Ranking) => &["participant", "ranking", "realization", "rank"],
            Self::Task(TableKind::Adjustment) => &["participant", "start", "level", "standard"],
        }
    }

    /// The columns that it must have. Trials have one of those that tell the answer.
    fn required(self) -> &'static [&'static str] {
        match self {
            Self::Ratings => &["subject", "model", "rating"],
            Self::Task(TableKind::Trials(_)) => &["participant"],
            Self::Task(TableKind::Identification) => &["participant", "target", "answer"],
            Self::Task(TableKind::Ranking) => &["participant", "realization", "rank"],
            Self::Task(TableKind::Adjustment) => &["participant", "start", "level"],
            Self::Task(_) => self.columns(),
        }
    }

    /// The columns of which one tells what was answered; a row without it is no trial.
    fn answers(self) -> &'static [&'static str] {
        match self {
            Self::Ratings => &["rating"],
            Self::Task(TableKind::Trials(_)) => &["answer", "correct", "positive"],
            Self::Task(TableKind::Pairs | TableKind::Identification) => &["answer"],
            Self::Task(TableKind::Magnitude) => &["estimate"],
            Self::Task(TableKind::Mushra | TableKind::Similarity) => &["rating"],
            Self::Task(TableKind::Ranking) => &["rank"],
            Self::Task(TableKind::Adjustment) => &["level"],
        }
    }

    /// Has the reader of `analyze` read a table; its first error otherwise.
    fn check(self, name: &str, table: &str) -> Result<(), ImportError> {
        match self {
            Self::Ratings => {
                Ratings::read_csv(name, table.as_bytes(), None)?;
            }
            Self::Task(kind) => {
                read_table(name, table.as_bytes(), kind)?;
            }
        }
        Ok(())
    }
}

/// What was taken from one file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Taken {
    /// The file.
    pub name: String,
    /// The program that wrote it, as far as its columns tell.
    pub program: Option<Program>,
    /// Its rows.
    pub rows: usize,
    /// Rows of the result. A wide table has several for each of its rows.
    pub taken: usize,
    /// Of these, rows without a rating.
    pub unrated: usize,
    /// Rows that [`Mapping::rows`] leaves out.
    pub filtered: usize,
    /// Other rows that are no trials.
    pub others: usize,
}

/// A table as `analyze` reads it, and where it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The table, as CSV.
    pub table: String,
    /// The columns, with those that were found by their names.
    pub mapping: Mapping,
    /// The files, in their order.
    pub files: Vec<Taken>,
    /// Number of participants.
    pub participants: usize,
    /// Participants of more than one file, with the first two of those. Untrusted.
    pub shared: Vec<(String, String, String)>,
}

/// Joins tables of one experiment. Columns that `mapping` does not state are found by the names that
/// they usually have, in the first table; all tables have the same ones.
///
/// ```
/// use study_analysis::import::{Grid, Mapping, import};
/// # fn main() -> Result<(), study_analysis::import::ImportError> {
/// let file = Grid::read("p1.csv", "participant;texture;grade\nP1;soft;2,5\nP1;crisp;6\n".as_bytes())?;
/// let mut mapping = Mapping::new("ratings");
/// mapping.set("model", "texture")?;
/// mapping.set("rating", "grade")?;
/// let imported = import(&[file], mapping)?;
/// assert_eq!(imported.table, "subject,model,rating\nP1,soft,2.5\nP1,crisp,6\n");
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`ImportError`] of the first fault.
pub fn import(grids: &[Grid], mapping: Mapping) -> Result<Imported, ImportError> {
    let kind = mapping.kind()?;
    let first = grids.first().ok_or(ImportError::NoFiles)?;
    let mapping = mapping.completed(first)?;
    let header = convert::header(&mapping, kind);
    let mut table = convert::line(&header);
    let (mut files, mut people) = (Vec::new(), BTreeMap::<String, BTreeSet<usize>>::new());
    let mut counts = BTreeMap::new();
    for (i, grid) in grids.iter().enumerate() {
        let converted = Converted::of(grid, &mapping, kind, &mut counts)?;
        check(grid, kind, &header, &converted, &mapping)?;
        for row in &converted.rows {
            table.push_str(&convert::line(&row.cells));
            people.entry(row.cells[0].clone()).or_default().insert(i);
        }
        files.push(converted.taken);
    }
    kind.check("the joined table", &table)?;
    let name = |i: &usize| grids[*i].name.clone();
    let shared = people.iter().filter_map(|(person, files)| {
        let mut files = files.iter();
        Some((person.clone(), name(files.next()?), name(files.next()?)))
    });
    Ok(Imported {
        shared: shared.collect(),
        participants: people.len(),
        table,
        mapping,
        files,
    })
}

/// Has `analyze` read the rows of one file, so that its errors name their lines there.
fn check(
    grid: &Grid,
    kind: Kind,
    header: &[String],
    converted: &Converted,
    mapping: &Mapping,
) -> Result<(), ImportError> {
    let mut table = convert::line(header);
    for row in &converted.rows {
        let one_line = row.cells.iter().map(|cell| cell.replace(['\r', '\n'], " "));
        table.push_str(&convert::line(&one_line.collect::<Vec<_>>()));
    }
    let line = |n: u64| {
        let row = usize::try_from(n).ok().and_then(|n| n.checked_sub(2));
        row.and_then(|row| Some(converted.rows.get(row)?.line))
            .unwrap_or(n)
    };
    let of_column = |column: &str| mapping.columns.get(column).cloned();
    kind.check(&grid.name, &table).map_err(|error| match error {
        ImportError::Ratings(RatingsError::Field {
            name,
            line: at,
            column,
            field,
            wanted,
        }) => {
            let source = of_column(&column);
            let error = RatingsError::Field {
                name,
                line: line(at),
                column,
                field,
                wanted,
            };
            ImportError::of_cell(error, source)
        }
        ImportError::Ratings(RatingsError::Twice {
            name,
            line: at,
            first,
            subject,
            model,
            repetition,
        }) => {
            let (at, first) = (line(at), line(first));
            RatingsError::Twice {
                name,
                line: at,
                first,
                subject,
                model,
                repetition,
            }
            .into()
        }
        ImportError::Trials(TableError::Cell {
            name,
            line: at,
            column,
            cell,
            expected,
        }) => {
            let source = of_column(column);
            let error = TableError::Cell {
                name,
                line: line(at),
                column,
                cell,
                expected,
            };
            ImportError::of_cell(error, source)
        }
        ImportError::Ratings(RatingsError::Empty { .. })
        | ImportError::Trials(TableError::Empty { .. }) => ImportError::NoTrials {
            name: grid.name.clone(),
            rows: grid.rows.len(),
            filtered: converted.taken.filtered,
        },
        other => other,
    })
}

#[cfg(test)]
mod tests;
