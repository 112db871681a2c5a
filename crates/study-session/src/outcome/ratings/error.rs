//! Why a table of ratings could not be read.

use study_base::text::Untrusted;

/// Why a CSV could not be read. Every message names the file and, where there is
/// one, the line: `line` is counted from 1, header included.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum RatingsError {
    /// It could not be read, or is not a CSV.
    #[error("{name}: {source}")]
    Csv { name: String, source: csv::Error },
    /// It is in another encoding.
    #[error("{name}, line {line}: this is not UTF-8; save it as CSV in UTF-8")]
    Encoding { name: String, line: u64 },
    /// Its columns are not separated by commas.
    #[error(
        "{name}: the columns are separated by `{}`; save it with commas between the columns and \
         points in the numbers, or read it with `study import table`",
        Untrusted(&.separator.to_string())
    )]
    Separator { name: String, separator: char },
    /// The header lacks a column.
    #[error(
        "{name}: no column `{}`{}; a table of ratings has the columns {expected}",
        Untrusted(.column), renamed(.near.as_deref())
    )]
    NoColumn {
        name: String,
        column: String,
        near: Option<String>,
        expected: &'static str,
    },
    /// A table with the columns of a study's has no answers.
    #[error("{name}: no column with answers; the questions follow `protocol_version`")]
    NoQuestion { name: String },
    /// The header has a column twice.
    #[error("{name}: two columns are named `{}`", Untrusted(.column))]
    TwoColumns { name: String, column: String },
    /// A line is shorter or longer than the header.
    #[error("{name}, line {line}: {found} fields, but the header has {expected}")]
    Ragged {
        name: String,
        line: u64,
        found: usize,
        expected: usize,
    },
    /// A field holds something that its column cannot.
    #[error("{name}, line {line}: `{}` in column `{}` is not {wanted}", Untrusted(.field), Untrusted(.column))]
    Field {
        name: String,
        line: u64,
        column: String,
        field: String,
        wanted: String,
    },
    /// Two rows have the same subject, realization and repetition.
    #[error(
        "{name}, line {line}: subject `{}`, model `{}`, repetition {repetition} is already on \
         line {first}",
        Untrusted(.subject), Untrusted(.model)
    )]
    Twice {
        name: String,
        line: u64,
        first: u64,
        subject: String,
        model: String,
        repetition: u32,
    },
    /// There is no row.
    #[error("{name}: no ratings, only a header")]
    Empty { name: String },
}

/// What to do about a column whose name differs only in case.
fn renamed(near: Option<&str>) -> String {
    near.map_or_else(String::new, |near| {
        format!(" (rename `{}`)", Untrusted(near))
    })
}

impl RatingsError {
    /// An error of the CSV reader in the file `name`, which has not yet counted
    /// `pending` lines.
    pub(super) fn csv(name: &str, source: csv::Error, pending: u64) -> Self {
        let name = name.to_owned();
        match source.kind() {
            csv::ErrorKind::Utf8 { pos, .. } => Self::Encoding {
                name,
                line: pos.as_ref().map_or(1, |pos| pos.line() + pending),
            },
            _ => Self::Csv { name, source },
        }
    }
}
