//! Which column is which.

use super::grid::{Grid, Program};
use super::{ImportError, Kind};
use crate::analyze::psychophysics::{PARTICIPANT, correct_column};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use study_base::diagnostic::did_you_mean;

/// The format of the file.
pub const FORMAT: &str = "study-columns/1";
/// In the place of a column: the name of the file, without its ending.
pub(super) const FILE: &str = "@file";
/// In the place of a column: the number of the trial of the participant, from 1.
pub(super) const ORDER: &str = "@order";

/// Which columns of a file are those that `analyze` reads: what `study import table` asks for, and keeps.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// [`FORMAT`].
    pub format: String,
    /// What the rows are: a name of [`Kind`].
    #[serde(rename = "as")]
    pub kind: String,
    /// Columns that are copied under their own names, such as factors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keep: Vec<String>,
    /// Columns of a wide table that have the ratings of one realization each, by name, or a pattern with
    /// `{model}` and `{repetition}`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub wide: Vec<String>,
    /// The column of the file for each column of the result; `@file` is the name of the file,
    /// `@order` the number of the trial.
    #[serde(default)]
    pub columns: BTreeMap<String, String>,
    /// Only rows whose cell in a column is one of these.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rows: BTreeMap<String, Vec<String>>,
    /// For columns of the result: what a cell of the file means.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub words: BTreeMap<String, BTreeMap<String, String>>,
    /// Whether columns that are not stated are looked for by their usual names; one that was kept is whole.
    #[serde(skip)]
    looks: bool,
}

impl Mapping {
    /// Without any column; `kind` is a name of [`Kind`].
    pub fn new(kind: &str) -> Self {
        Self {
            format: FORMAT.to_owned(),
            kind: kind.to_owned(),
            keep: Vec::new(),
            wide: Vec::new(),
            columns: BTreeMap::new(),
            rows: BTreeMap::new(),
            words: BTreeMap::new(),
            looks: true,
        }
    }

    /// The kind of the table.
    ///
    /// # Errors
    /// [`ImportError`] for a format or a kind that is unknown, and names that the kind does not have.
    pub fn kind(&self) -> Result<Kind, ImportError> {
        if self.format != FORMAT {
            let found = study_base::text::Untrusted(&self.format);
            return Err(ImportError::Mapping(format!(
                "the format of the columns is `{found}`, not `{FORMAT}`"
            )));
        }
        let kind = Kind::named(&self.kind).ok_or_else(|| {
            let names: Vec<&str> = Kind::names().collect();
            ImportError::Mapping(format!("`as` has to be one of {}", names.join(", ")))
        })?;
        let fields = self.columns.keys().chain(self.words.keys());
        for field in fields {
            if !kind.columns().contains(&field.as_str()) {
                return Err(ImportError::UnknownField {
                    field: field.clone(),
                    kind: self.kind.clone(),
                    fields: kind.columns().join(", "),
                });
            }
        }
        if !self.wide.is_empty() && kind != Kind::Ratings {
            return Err(ImportError::Mapping(
                "only ratings can be in a wide table".to_owned(),
            ));
        }
        Ok(kind)
    }

    /// States the column of the file for a column of the result.
    ///
    /// # Errors
    /// [`ImportError`] if the kind of table has no such column.
    pub fn set(&mut self, field: &str, column: &str) -> Result<(), ImportError> {
        self.columns.insert(field.to_owned(), column.to_owned());
        self.kind().map(|_| ())
    }

    /// The mapping with the columns that can be found by their names. Every stated one has to be there.
    pub(super) fn completed(mut self, grid: &Grid) -> Result<Self, ImportError> {
        let kind = self.kind()?;
        if self.looks {
            for field in kind.columns() {
                if self.is_open(field)
                    && let Some(found) = self.usual(field, kind, grid)
                {
                    self.columns.insert((*field).to_owned(), found);
                }
            }
        }
        let asked = |field: &'static str| ImportError::Asked {
            name: grid.name.clone(),
            field: field.to_owned(),
            what: described(field),
            columns: grid.header.clone(),
        };
        if let Some(field) = kind.required().iter().find(|field| self.is_open(field)) {
            return Err(asked(field));
        }
        let answers = kind.answers();
        if self.wide.is_empty()
            && !answers
                .iter()
                .any(|field| self.columns.contains_key(*field))
        {
            return Err(asked(answers[0]));
        }
        Ok(self)
    }

    /// Whether a column is neither stated nor told by the columns of a wide table or by those that are kept.
    fn is_open(&self, field: &str) -> bool {
        let wide = !self.wide.is_empty()
            && ["model", "rating", "repetition", "trial_index"].contains(&field);
        let factors = field == "model" && !self.keep.is_empty();
        !wide && !factors && !self.columns.contains_key(field)
    }

    /// The column that has this in the files of the program, or by its name.
    fn usual(&self, field: &str, kind: Kind, grid: &Grid) -> Option<String> {
        let named = |name: &str| {
            let same = |h: &&String| h.eq_ignore_ascii_case(name);
            grid.header.iter().find(same).cloned()
        };
        let only = |end: &str| {
            let mut all = grid.header.iter().filter(|h| h.ends_with(end));
            all.next().filter(|_| all.next().is_none()).cloned()
        };
        let told = kind
            .answers()
            .iter()
            .any(|field| self.columns.contains_key(*field));
        match field {
            "subject" | "participant" => {
                let names = PARTICIPANT.into_iter().chain(["subject_nr"]);
                names.into_iter().find_map(named)
            }
            "rating" => named("rating").or_else(|| match grid.program {
                Some(Program::PsychoPy) => only(".rating").or_else(|| only(".response")),
                Some(_) => named("response"),
                None => None,
            }),
            "level" => named("level")
                .or_else(|| named("intensity"))
                .or_else(|| only(".intensity")),
            "correct" if told => None,
            "correct" => correct_column(&grid.header).map(|at| grid.header[at].clone()),
            // The files of these programs have a row after each trial.
            "trial_index" => grid
                .program
                .map(|_| ORDER.to_owned())
                .or_else(|| named(field)),
            // Their other columns may have any meaning.
            "condition" | "target" | "answer" | "positive" | "trials" | "repetition" | "vaf"
            | "role"
                if grid.program.is_some() =>
            {
                None
            }
            _ => named(field),
        }
    }

    /// The place of a column in a file.
    pub(super) fn place<'a>(
        column: &'a str,
        grid: &Grid,
    ) -> Result<(usize, Option<&'a str>), ImportError> {
        grid.place(column).ok_or_else(|| {
            let near = did_you_mean(column, grid.header.iter().map(String::as_str));
            ImportError::NoColumn {
                name: grid.name.clone(),
                column: column.to_owned(),
                near: near.map(str::to_owned),
                columns: grid.header.clone(),
            }
        })
    }
}

/// What a column of the result has, for the question which one it is.
fn described(field: &str) -> &'static str {
    match field {
        "subject" | "participant" => "participant",
        "model" => "realization (`model`)",
        "rating" => "rating",
        "first" => "first realization",
        "second" => "second realization",
        "answer" => "answer",
        "level" => "level",
        "estimate" => "estimate",
        "condition" => "condition",
        _ => "role",
    }
}
