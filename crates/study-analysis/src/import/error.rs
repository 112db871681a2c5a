//! Why a table could not be imported.

use crate::analyze::psychophysics::TableError;
use study_base::text::Untrusted;
use study_session::outcome::ratings::RatingsError;

/// The most columns that an error lists.
const MOST_LISTED: usize = 40;

/// Why a table could not be imported.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum ImportError {
    /// There is no file.
    #[error("there are no tables to import")]
    NoFiles,
    /// It is in another encoding.
    #[error("{name}: this is not UTF-8; save it as CSV in UTF-8")]
    Encoding { name: String },
    /// It is not a table.
    #[error("{name}: {source}")]
    Csv { name: String, source: csv::Error },
    /// It begins like JSON and is none, or not a list of trials.
    #[error("{name}: it begins like JSON, but is no list of trials: {why}")]
    Json { name: String, why: String },
    /// There is no row.
    #[error("{name}: there are no rows")]
    Empty { name: String },
    /// The header has a column twice.
    #[error("{name}: two columns are named `{}`", Untrusted(.column))]
    TwoColumns { name: String, column: String },
    /// Which column it is has to be said.
    #[error(
        "{name}: which column has the {}? No column is named as usual; the columns are {}",
        .what, listed(.columns)
    )]
    Asked {
        name: String,
        field: String,
        what: &'static str,
        columns: Vec<String>,
    },
    /// A stated column is not there.
    #[error("{name}: there is no column `{}`{}; the columns are {}", Untrusted(.column), did_you_mean(.near), listed(.columns))]
    NoColumn {
        name: String,
        column: String,
        near: Option<String>,
        columns: Vec<String>,
    },
    /// A name that the kind of table does not have.
    #[error("a table of {kind} has no `{}`; it has {fields}", Untrusted(.field))]
    UnknownField {
        field: String,
        kind: String,
        fields: String,
    },
    /// A file of columns of another kind or format.
    #[error("{0}")]
    Mapping(String),
    /// All rows were left out.
    #[error(
        "{name}: none of {rows} rows is a trial ({filtered} are left out by their cells, the others have no answer)"
    )]
    NoTrials {
        name: String,
        rows: usize,
        filtered: usize,
    },
    /// A cell is not what its column has.
    #[error("{message}{}", from(.column))]
    Cell {
        message: String,
        column: Option<String>,
    },
    /// What the reader of ratings says.
    #[error(transparent)]
    Ratings(#[from] RatingsError),
    /// What the reader of trials says.
    #[error(transparent)]
    Trials(#[from] TableError),
}

impl ImportError {
    /// The error of a cell, and the column of the file that it is from.
    pub(super) fn of_cell(error: impl std::fmt::Display, column: Option<String>) -> Self {
        Self::Cell {
            message: error.to_string(),
            column,
        }
    }
}

fn from(column: &Option<String>) -> String {
    let column = column.as_ref();
    column.map_or_else(String::new, |column| {
        format!(" (from the column `{}`)", Untrusted(column))
    })
}

fn did_you_mean(near: &Option<String>) -> String {
    let near = near.as_ref();
    near.map_or_else(String::new, |near| {
        format!(" (did you mean `{}`?)", Untrusted(near))
    })
}

fn listed(columns: &[String]) -> String {
    let shown = columns.iter().take(MOST_LISTED);
    let shown: Vec<String> = shown.map(|column| Untrusted(column).to_string()).collect();
    let more = match columns.len().saturating_sub(MOST_LISTED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    shown.join(", ") + &more
}
