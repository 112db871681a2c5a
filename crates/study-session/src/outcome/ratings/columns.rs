//! Ratings by column: each column is declared once.

use super::error::RatingsError;
use super::line::{Field, Line};
use super::measured::Measured;
use super::{Comment, Felt, Origin, Practice, Realization, Subject};
use crate::outcome::rows::{RatingRow, Status};
use std::sync::Arc;
use study_plan::protocol::columns::RatingColumn;

/// Declares [`Ratings`] and [`Row`]. The columns after `set` are set by the reader; those
/// after `copied` are copied from a column of `ratings.csv` and the field of [`RatingRow`].
macro_rules! columns {
    (
        set { $($(#[$set_doc:meta])+ $set:ident: $set_type:ty,)+ }
        copied { $($(#[$doc:meta])+ $column:ident: $type:ty = $source:ident $field:ident,)+ }
    ) => {
        /// Ratings by column. All columns have the same length, except `felt`.
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct Ratings {
            /// The question whose answers are the ratings.
            pub question: String,
            /// Sorted by name.
            pub subjects: Vec<Subject>,
            /// Sorted by name.
            pub models: Vec<Realization>,
            $($(#[$set_doc])+ pub $set: Vec<$set_type>,)+
            $($(#[$doc])+ pub $column: Vec<$type>,)+
            /// What was felt; shorter than the others if the last rows do not say, empty if
            /// none does.
            pub felt: Vec<Option<Felt>>,
            /// Texts that were answered or remarked in trials.
            pub comments: Vec<Comment>,
            /// Practice rows, which are not in the columns.
            pub practice: Arc<Practice>,
            /// What was measured beside the ratings, in the order of the protocol.
            pub measured: Vec<Measured>,
            /// Names of the sites that the subjects are from; empty if there is only one.
            /// Untrusted.
            pub sites: Vec<String>,
            /// Columns of a foreign table that were not read although their names differ from
            /// optional ones only in case, and these. The first is untrusted.
            pub near_misses: Vec<(String, &'static str)>,
        }

        /// One row of [`Ratings`].
        #[derive(Debug, Clone, Copy, Default, PartialEq)]
        pub struct Row {
            $($(#[$set_doc])+ pub $set: $set_type,)+
            $($(#[$doc])+ pub $column: $type,)+
            /// What was felt, if it is known.
            pub felt: Option<Felt>,
        }

        impl Row {
            /// The columns that are copied from a row of a study.
            pub(super) fn of(row: &RatingRow) -> Self {
                Self { $($column: row.$field.known(),)+ ..Self::default() }
            }

            /// The columns that are copied from a line of a table; `at` says where they are.
            pub(super) fn read(
                line: &Line<'_>,
                at: impl Fn(RatingColumn) -> Option<usize>,
            ) -> Result<Self, RatingsError> {
                Ok(Self {
                    $($column: {
                        let source = RatingColumn::$source;
                        Field::read(line, at(source), source)?
                    },)+
                    ..Self::default()
                })
            }
        }

        impl Ratings {
            /// Adds a row.
            pub fn push(&mut self, row: Row) {
                if row.felt.is_some() {
                    self.felt.resize(self.len(), None);
                    self.felt.push(row.felt);
                }
                $(self.$set.push(row.$set);)+
                $(self.$column.push(row.$column);)+
            }

            /// The columns of some of the rows, and nothing else.
            pub(super) fn pick(&self, rows: &[usize]) -> Self {
                Self {
                    $($set: rows.iter().map(|&i| self.$set[i]).collect(),)+
                    $($column: rows.iter().map(|&i| self.$column[i]).collect(),)+
                    measured: self.measured.iter().map(|m| m.pick(rows)).collect(),
                    felt: match self.felt.is_empty() {
                        true => Vec::new(),
                        false => rows.iter().map(|&i| self.felt(i).copied()).collect(),
                    },
                    ..Self::default()
                }
            }

            /// Adds the columns of others, and nothing else.
            pub(super) fn extend(&mut self, other: &Self) {
                Measured::extend(self, other);
                if !other.felt.is_empty() {
                    self.felt.resize(self.len(), None);
                    self.felt.extend_from_slice(&other.felt);
                }
                $(self.$set.extend_from_slice(&other.$set);)+
                $(self.$column.extend_from_slice(&other.$column);)+
            }
        }
    };
}

columns! {
    set {
        /// Index into `subjects`.
        subject: u32,
        /// Index into `models`; a foreign table may leave it empty.
        model: Option<u32>,
        /// Repetition number, from 1; a foreign table may count from 0.
        repetition: u32,
        /// The answer, if the trial has one that counts.
        rating: Option<f64>,
        /// The kind of participant.
        origin: Origin,
        /// Row of the source, from 1; for a file without its header.
        source_row: u32,
    }
    copied {
        /// VAF of the realization.
        vaf: Option<f64> = Vaf vaf,
        /// Position in the subject's order, from 1.
        trial_index: Option<u32> = Position position,
        /// Whether an answer was corrected.
        corrected: bool = Corrected corrected,
        /// The attempt that counts, from 1; above 1 the trial was repeated.
        attempt: Option<u32> = Attempt attempt,
        /// Full strokes, where telemetry counted them.
        strokes: Option<u32> = Strokes strokes,
        /// The outcome of the trial.
        status: Status = Status status,
    }
}

impl Row {
    /// A failed trial has no rating, and without a rating no trial is `ok`.
    pub(super) fn consistent(self) -> Self {
        let rating = self.rating.filter(|_| self.status != Status::Failed);
        let status = match (self.status, rating) {
            (Status::Ok, None) => Status::Missing,
            (status, _) => status,
        };
        Self {
            rating,
            status,
            ..self
        }
    }
}
