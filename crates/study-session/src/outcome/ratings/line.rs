//! One line of a table.

use super::error::RatingsError;
use crate::outcome::rows::Status;
use serde::de::{DeserializeOwned, IntoDeserializer as _};
use study_plan::protocol::columns::{Kind, RatingColumn};

/// A line of a table.
pub(super) struct Line<'a> {
    pub(super) name: &'a str,
    pub(super) header: &'a [String],
    pub(super) record: &'a csv::StringRecord,
    pub(super) line: u64,
}

impl Line<'_> {
    pub(super) fn text(&self, at: usize) -> &str {
        self.record[at].trim()
    }

    pub(super) fn error(&self, at: usize, wanted: impl Into<String>) -> RatingsError {
        RatingsError::Field {
            name: self.name.to_owned(),
            line: self.line,
            column: self.header[at].clone(),
            field: self.record[at].to_owned(),
            wanted: wanted.into(),
        }
    }

    /// A finite number; `None` without a column, and for `NA`, `NaN` and empty fields.
    pub(super) fn number(&self, at: Option<usize>) -> Result<Option<f64>, RatingsError> {
        let missing = |text: &str| {
            ["", "na", "nan"]
                .iter()
                .any(|m| text.eq_ignore_ascii_case(m))
        };
        let Some(at) = at.filter(|&at| !missing(self.text(at))) else {
            return Ok(None);
        };
        match self.text(at).parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(self.error(at, "a finite number")),
        }
    }

    /// A whole number from 0; `None` without a column and for empty fields.
    pub(super) fn whole(&self, at: Option<usize>) -> Result<Option<u32>, RatingsError> {
        let Some(at) = at.filter(|&at| !self.text(at).is_empty()) else {
            return Ok(None);
        };
        let number = self.text(at).parse().map(Some);
        number.map_err(|_| self.error(at, "a whole number from 0"))
    }

    /// `false` without a column and for empty fields.
    pub(super) fn flag(&self, at: Option<usize>) -> Result<bool, RatingsError> {
        match at.map(|at| (at, self.text(at))) {
            Some((_, "true")) => Ok(true),
            Some((_, "false" | "")) | None => Ok(false),
            Some((at, _)) => Err(self.error(at, "`true` or `false`")),
        }
    }

    /// One of the words that a column has.
    pub(super) fn level<T: DeserializeOwned>(
        &self,
        at: usize,
        column: RatingColumn,
    ) -> Result<T, RatingsError> {
        let read: Result<T, serde::de::value::Error> =
            T::deserialize(self.text(at).into_deserializer());
        read.map_err(|_| {
            let words: Vec<&str> = match column.column().kind {
                Kind::Level(levels) => levels.iter().map(|(word, _)| *word).collect(),
                _ => Vec::new(),
            };
            self.error(at, format!("one of {}", words.join(", ")))
        })
    }
}

/// A value that is copied from a column of `ratings.csv`, by the type of the column.
pub(super) trait Field: Sized {
    /// Reads it from a line; `at` is `None` if the table lacks the column.
    fn read(line: &Line<'_>, at: Option<usize>, column: RatingColumn)
    -> Result<Self, RatingsError>;

    /// The value if it can be analyzed.
    fn known(self) -> Self {
        self
    }
}

impl Field for Option<u32> {
    fn read(line: &Line<'_>, at: Option<usize>, _: RatingColumn) -> Result<Self, RatingsError> {
        line.whole(at)
    }
}

impl Field for Option<f64> {
    fn read(line: &Line<'_>, at: Option<usize>, _: RatingColumn) -> Result<Self, RatingsError> {
        line.number(at)
    }

    fn known(self) -> Self {
        self.filter(|number| number.is_finite())
    }
}

impl Field for bool {
    fn read(line: &Line<'_>, at: Option<usize>, _: RatingColumn) -> Result<Self, RatingsError> {
        line.flag(at)
    }
}

impl Field for Status {
    fn read(
        line: &Line<'_>,
        at: Option<usize>,
        column: RatingColumn,
    ) -> Result<Self, RatingsError> {
        at.map_or(Ok(Self::Ok), |at| line.level(at, column))
    }
}
