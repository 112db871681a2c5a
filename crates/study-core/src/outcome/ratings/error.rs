//! Why a table of ratings could not be read.

use study_base::text::Untrusted;

/// Why a CSV could not be read. Every message names the file and, where there
/// is one, the line.
#[derive(Debug, thiserror::Error)]
pub enum RatingsError {
    /// It could not be read, or is no CSV.
    #[error("{name}: {source}")]
    Csv {
        /// The file.
        name: String,
        /// What went wrong.
        #[source]
        source: csv::Error,
    },
    /// It is in another encoding.
    #[error("{name}, line {line}: this is no UTF-8; save it as CSV in UTF-8")]
    Encoding {
        /// The file.
        name: String,
        /// From 1, header included.
        line: u64,
    },
    /// It has another separator than the comma.
    #[error(
        "{name}: the columns are separated by `{}`; save it with commas between the columns and \
         points in the numbers",
        Untrusted(&.separator.to_string())
    )]
    Separator {
        /// The file.
        name: String,
        /// What stands between the columns.
        separator: char,
    },
    /// The header lacks a column.
    #[error("{name}: no column `{column}`; a table of ratings has the columns {expected}")]
    NoColumn {
        /// The file.
        name: String,
        /// The column.
        column: String,
        /// What there should be.
        expected: &'static str,
    },
    /// The header has a column twice.
    #[error("{name}: two columns are named `{column}`")]
    TwoColumns {
        /// The file.
        name: String,
        /// The column.
        column: String,
    },
    /// A line is shorter or longer than the header.
    #[error("{name}, line {line}: {found} fields, but the header has {expected}")]
    Ragged {
        /// The file.
        name: String,
        /// From 1, header included.
        line: u64,
        /// Fields there.
        found: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// A field holds something that its column cannot.
    #[error("{name}, line {line}: `{}` in column `{column}` is no {wanted}", Untrusted(.field))]
    Field {
        /// The file.
        name: String,
        /// From 1, header included.
        line: u64,
        /// Which column.
        column: String,
        /// What stands there.
        field: String,
        /// What should.
        wanted: &'static str,
    },
    /// The same subject, realization and repetition comes twice.
    #[error(
        "{name}, line {line}: subject `{}`, model `{}`, repetition {repetition} came already on \
         line {first}",
        Untrusted(.subject), Untrusted(.model)
    )]
    Twice {
        /// The file.
        name: String,
        /// From 1, header included.
        line: u64,
        /// Where it came first.
        first: u64,
        /// Who.
        subject: String,
        /// What.
        model: String,
        /// The how-maniest time.
        repetition: u32,
    },
    /// There is no row.
    #[error("{name}: no ratings, only a header")]
    Empty {
        /// The file.
        name: String,
    },
}

impl RatingsError {
    /// What the reader of CSV says of the file `name`; it has `pending` lines yet
    /// to count.
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
