//! Trials of somebody else's experiment, from a CSV.

use super::adjustment::{SettingRow, adjustment};
use super::identification::{LabelRow, identification, labels_of};
use super::preferences::{Choice, Preference, in_both_orders, preferences};
use super::ranking::{RankingRow, ranking};
use super::results::PartResults;
use super::scales::{MagnitudeRow, MushraRoles, MushraRow, magnitude, mushra};
use super::similarity::{Properties, SimilarityRow, similarity};
use super::trials::{Asked, TrialCount, TrialSettings, discrimination};
use std::io::BufRead;
use study_base::text::Untrusted;
use study_stats::mushra::Screening;
use thiserror::Error;

/// What the rows of a table are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableKind {
    /// Trials: `participant[,condition][,level]`, and `target,answer` or `positive`; with
    /// `trials`, a row stands for so many.
    Trials(Asked),
    /// Paired preferences: `[participant,]first,second,answer`.
    Pairs,
    /// Magnitude estimation: `participant,level,estimate`.
    Magnitude,
    /// Ratings with hidden reference: `participant,condition,role,rating`.
    Mushra,
    /// Identification: `participant[,realization],target,answer`.
    Identification,
    /// Similarity: `participant,first,second,rating`.
    Similarity,
    /// Rankings: `participant[,ranking],realization,rank`.
    Ranking,
    /// Adjustment: `participant,start,level[,standard]`.
    Adjustment,
}

impl TableKind {
    /// The kinds that are no trials, with their names.
    const OTHERS: [(Self, &str); 7] = [
        (Self::Pairs, "pairs"),
        (Self::Magnitude, "magnitude"),
        (Self::Mushra, "mushra"),
        (Self::Identification, "identification"),
        (Self::Similarity, "similarity"),
        (Self::Ranking, "ranking"),
        (Self::Adjustment, "adjustment"),
    ];

    /// The kind of a name.
    pub fn named(name: &str) -> Option<Self> {
        let asked = Asked::NAMES.iter().find(|n| n.1 == name);
        let other = Self::OTHERS.iter().find(|n| n.1 == name);
        asked
            .map(|n| Self::Trials(n.0))
            .or_else(|| other.map(|n| n.0))
    }

    /// All names.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let others = Self::OTHERS.iter().map(|n| n.1);
        Asked::NAMES.iter().map(|n| n.1).chain(others)
    }
}

/// A table that cannot be analyzed.
#[derive(Debug, Error)]
pub enum TableError {
    /// The CSV cannot be read.
    #[error("{name}: {source}")]
    Csv {
        /// The file.
        name: String,
        /// What is wrong.
        source: csv::Error,
    },
    /// A column is missing.
    #[error("{name}: there is no column `{column}`; a table of {kind} has {columns}")]
    Column {
        /// The file.
        name: String,
        /// The column.
        column: &'static str,
        /// The kind of table.
        kind: &'static str,
        /// All columns of the kind.
        columns: &'static str,
    },
    /// A cell that is not what its column has.
    #[error("{name}:{line}: {column} is `{}`, expected {expected}", Untrusted(.cell))]
    Cell {
        /// The file.
        name: String,
        /// Line, from 1.
        line: u64,
        /// The column.
        column: &'static str,
        /// The cell. Untrusted.
        cell: String,
        /// What would be right.
        expected: String,
    },
    /// Columns that are not separated by commas.
    #[error(
        "{name}: the columns are separated by {separator}; a table has commas, and decimal points: `study import table` makes one"
    )]
    Separator {
        /// The file.
        name: String,
        /// What separates them.
        separator: &'static str,
    },
    /// Nothing to analyze.
    #[error("{name}: there are no rows")]
    Empty {
        /// The file.
        name: String,
    },
}

/// The statistics of a CSV, and its number of rows.
///
/// # Errors
/// [`TableError`] of the first fault.
pub fn analyze_table(
    name: &str,
    input: impl BufRead,
    kind: TableKind,
    settings: &TrialSettings,
) -> Result<(PartResults, usize), TableError> {
    let rows = Rows::read(name, input, kind)?;
    let mut results = PartResults::undefined("");
    match kind {
        TableKind::Trials(asked) => {
            results = discrimination(asked, &rows.trials(asked)?, settings);
        }
        TableKind::Pairs => {
            let pairs = rows.pairs()?;
            let ties = pairs.iter().any(|p| matches!(p.choice, Choice::Tie(_)));
            results.pairs = Some(preferences(&pairs, ties, in_both_orders(&pairs)));
        }
        TableKind::Magnitude => results.over.magnitude = Some(magnitude(&rows.estimates()?)),
        TableKind::Mushra => {
            let (ratings, roles) = rows.ratings()?;
            let (kept, all) = mushra(&ratings, &roles, &Screening::default());
            (results.over.mushra, results.mushra_unscreened) = (Some(kept), all);
        }
        TableKind::Identification => {
            let (answers, labels) = rows.labels()?;
            results.over.identification = Some(identification(&answers, &labels).0);
        }
        TableKind::Similarity => {
            let (ratings, streams) = (rows.differences()?, (settings.seed, "table"));
            results.over.similarity = Some(similarity(&ratings, &Properties::new(), streams));
        }
        TableKind::Ranking => {
            let streams = (settings.seed, "table");
            results.over.ranking = Some(ranking(&rows.ranks()?, streams));
        }
        TableKind::Adjustment => {
            let ((set, standard), streams) = (rows.settings()?, (settings.seed, "table"));
            results.over.adjustment = Some(adjustment(&set, standard, streams));
        }
    }
    Ok((results, rows.records.len()))
}

/// Reads a CSV without analyzing it.
///
/// # Errors
/// [`TableError`] of the first fault.
pub fn read_table(name: &str, input: impl BufRead, kind: TableKind) -> Result<(), TableError> {
    let rows = Rows::read(name, input, kind)?;
    match kind {
        TableKind::Trials(asked) => rows.trials(asked).map(|_| ()),
        TableKind::Pairs => rows.pairs().map(|_| ()),
        TableKind::Magnitude => rows.estimates().map(|_| ()),
        TableKind::Mushra => rows.ratings().map(|_| ()),
        TableKind::Identification => rows.labels().map(|_| ()),
        TableKind::Similarity => rows.differences().map(|_| ()),
        TableKind::Ranking => rows.ranks().map(|_| ()),
        TableKind::Adjustment => rows.settings().map(|_| ()),
    }
}

/// The column that says whether an answer is correct: `correct`, or that of a keyboard or
/// mouse of PsychoPy, such as `key_resp.corr`, if there is one of them.
pub(crate) fn correct_column(header: &[String]) -> Option<usize> {
    let of_component = || {
        let mut all = header.iter().enumerate();
        let (at, _) = all.find(|(_, name)| name.ends_with(".corr"))?;
        all.all(|(_, name)| !name.ends_with(".corr")).then_some(at)
    };
    let named = header.iter().position(|name| name == "correct");
    named.or_else(of_component)
}

/// Columns of the participant, in the order in which they are looked for.
pub(crate) const PARTICIPANT: [&str; 4] =
    ["participant", "subject", "participant_id", "subject_id"];

struct Rows<'a> {
    name: &'a str,
    kind: TableKind,
    header: Vec<String>,
    records: Vec<(u64, csv::StringRecord)>,
}

impl<'a> Rows<'a> {
    fn read(name: &'a str, input: impl BufRead, kind: TableKind) -> Result<Self, TableError> {
        let fault = |source| TableError::Csv {
            name: name.to_owned(),
            source,
        };
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(input);
        let header = reader.headers().map_err(fault)?.iter();
        let header = header.map(|h| h.trim_start_matches('\u{feff}').to_owned());
        let header: Vec<String> = header.collect();
        if let [only] = &header[..] {
            for (mark, separator) in [(';', "semicolons"), ('\t', "tabs")] {
                if only.contains(mark) {
                    let name = name.to_owned();
                    return Err(TableError::Separator { name, separator });
                }
            }
        }
        let mut records = Vec::new();
        for record in reader.records() {
            let record = record.map_err(fault)?;
            records.push((record.position().map_or(0, csv::Position::line), record));
        }
        if records.is_empty() {
            return Err(TableError::Empty {
                name: name.to_owned(),
            });
        }
        Ok(Self {
            name,
            kind,
            header,
            records,
        })
    }

    fn column(&self, column: &str) -> Option<usize> {
        self.header.iter().position(|h| h == column)
    }

    fn required(&self, column: &'static str) -> Result<usize, TableError> {
        let found = match column {
            "participant" => (PARTICIPANT.iter()).find_map(|name| self.column(name)),
            _ => self.column(column),
        };
        let (kind, columns) = match self.kind {
            TableKind::Trials(_) => (
                "trials",
                "participant[,condition][,level],target,answer[,trials] or participant[,condition],level,positive[,trials]; \
                 correct or key_resp.corr, as jsPsych and PsychoPy write them, is read in the place of positive",
            ),
            TableKind::Pairs => ("pairs", "[participant,]first,second,answer"),
            TableKind::Magnitude => ("magnitude estimation", "participant,level,estimate"),
            TableKind::Mushra => ("MUSHRA", "participant,condition,role,rating"),
            TableKind::Identification => {
                ("identification", "participant[,realization],target,answer")
            }
            TableKind::Similarity => ("similarity", "participant,first,second,rating"),
            TableKind::Ranking => ("rankings", "participant[,ranking],realization,rank"),
            TableKind::Adjustment => ("adjustment", "participant,start,level[,standard]"),
        };
        found.ok_or_else(|| TableError::Column {
            name: self.name.to_owned(),
            column,
            kind,
            columns,
        })
    }

    fn fault(
        &self,
        line: u64,
        column: &'static str,
        cell: &str,
        expected: impl Into<String>,
    ) -> TableError {
        TableError::Cell {
            name: self.name.to_owned(),
            line,
            column,
            cell: cell.to_owned(),
            expected: expected.into(),
        }
    }

    fn number(
        &self,
        (line, record): &(u64, csv::StringRecord),
        (column, at): (&'static str, usize),
        range: (f64, f64),
    ) -> Result<f64, TableError> {
        let cell = &record[at];
        let good = |x: &f64| x.is_finite() && range.0 <= *x && *x <= range.1;
        (cell.parse().ok().filter(good)).ok_or_else(|| {
            let expected = match range {
                (low, high) if high < f64::MAX => format!("a number from {low} to {high}"),
                (low, _) if low > f64::MIN => format!("a number of at least {low}"),
                _ => "a number".to_owned(),
            };
            self.fault(*line, column, cell, expected)
        })
    }

    /// The place of a word among the answers.
    fn word(
        &self,
        (line, record): &(u64, csv::StringRecord),
        (column, at): (&'static str, usize),
        words: &[&str],
    ) -> Result<usize, TableError> {
        let cell = &record[at];
        let found = words.iter().position(|w| w.eq_ignore_ascii_case(cell));
        found.ok_or_else(|| self.fault(*line, column, cell, words.join(", ")))
    }

    /// Whether an answer is correct.
    fn truth(&self, row: &(u64, csv::StringRecord), at: usize) -> Result<bool, TableError> {
        let cell = &row.1[at];
        match cell.to_ascii_lowercase().as_str() {
            "true" | "1" | "1.0" => Ok(true),
            "false" | "0" | "0.0" => Ok(false),
            _ => Err(self.fault(row.0, "correct", cell, "true, false, 1 or 0")),
        }
    }

    fn trials(&self, asked: Asked) -> Result<Vec<TrialCount>, TableError> {
        let participant = self.required("participant")?;
        let (condition, level) = (self.column("condition"), self.column("level"));
        let target = self.column("target");
        let answer = self.column("answer");
        let positive = self.column("positive");
        let trials = self.column("trials");
        // jsPsych calls the answer its response; beside `correct` it is a key.
        let says = target.is_some() && correct_column(&self.header).is_none();
        let answer = answer.or_else(|| self.column("response").filter(|_| says));
        let correct =
            correct_column(&self.header).filter(|_| answer.is_none() && positive.is_none());
        // Whoever is right has said "no" in a catch trial, and "smaller" below the standard.
        let by_target = matches!(
            asked,
            Asked::YesNo | Asked::Comparison | Asked::SameDifferent
        );
        match (positive, correct) {
            (None, None) if answer.is_none() => {
                self.required("answer")?;
            }
            (None, None) => {}
            (None, Some(_)) if by_target => {
                self.required("level")?;
                self.required("target")?;
            }
            _ => {
                self.required("level")?;
            }
        }
        let words = asked.answers();
        // Programs of experiments also have rows of instructions and pauses.
        let is_trial = |row: &&(u64, csv::StringRecord)| {
            correct
                .is_none_or(|at| !row.1[at].is_empty() && !row.1[at].eq_ignore_ascii_case("none"))
        };
        let one = |row: &(u64, csv::StringRecord)| {
            let count = match trials {
                Some(at) => self.number(row, ("trials", at), (0.0, 1e5))?,
                None => 1.0,
            };
            let right = match target {
                Some(at) => Some(self.word(row, ("target", at), words)?),
                None => None,
            };
            let positive = match (positive, answer, correct) {
                (Some(at), _, _) => self.number(row, ("positive", at), (0.0, count))?,
                (None, Some(at), _) => {
                    let given = self.word(row, ("answer", at), words)?;
                    count * f64::from(u8::from(given == right.unwrap_or(0)))
                }
                (None, None, Some(at)) => count * f64::from(u8::from(self.truth(row, at)?)),
                (None, None, None) => 0.0,
            };
            let level = match level {
                Some(at) if !row.1[at].is_empty() => {
                    Some(self.number(row, ("level", at), (f64::MIN, f64::MAX))?)
                }
                _ => None,
            };
            Ok(TrialCount {
                participant: row.1[participant].to_owned(),
                condition: condition.map_or("all", |at| &row.1[at]).to_owned(),
                level,
                target: right,
                positive,
                trials: count,
            })
        };
        let found: Vec<TrialCount> = (self.records.iter().filter(is_trial))
            .map(one)
            .collect::<Result<_, _>>()?;
        match found.is_empty() {
            true => Err(TableError::Empty {
                name: self.name.to_owned(),
            }),
            false => Ok(found),
        }
    }

    fn pairs(&self) -> Result<Vec<Preference>, TableError> {
        let participant = self
            .column("participant")
            .or_else(|| self.column("subject"));
        let (first, second) = (self.required("first")?, self.required("second")?);
        let answer = self.required("answer")?;
        let one = |row: &(u64, csv::StringRecord)| {
            let said = self.word(row, ("answer", answer), &["first", "second", "tie"])?;
            Ok(Preference {
                participant: participant.map_or("", |at| &row.1[at]).to_owned(),
                first: row.1[first].to_owned(),
                second: row.1[second].to_owned(),
                choice: match said {
                    0 => Choice::First(1.0),
                    1 => Choice::Second(1.0),
                    _ => Choice::Tie(1.0),
                },
            })
        };
        self.records.iter().map(one).collect()
    }

    fn estimates(&self) -> Result<Vec<MagnitudeRow>, TableError> {
        let participant = self.required("participant")?;
        let (level, estimate) = (self.required("level")?, self.required("estimate")?);
        let any = (f64::MIN, f64::MAX);
        let one = |row: &(u64, csv::StringRecord)| {
            Ok(MagnitudeRow {
                participant: row.1[participant].to_owned(),
                level: self.number(row, ("level", level), any)?,
                estimate: self.number(row, ("estimate", estimate), any)?,
            })
        };
        self.records.iter().map(one).collect()
    }

    /// The answers, and the labels in alphabetical order.
    fn labels(&self) -> Result<(Vec<LabelRow>, Vec<String>), TableError> {
        let participant = self.required("participant")?;
        let target = self.required("target")?;
        let answer = match self.column("answer").or_else(|| self.column("response")) {
            Some(at) => at,
            None => self.required("answer")?,
        };
        let realization = self.column("realization");
        let cells = || {
            self.records
                .iter()
                .flat_map(|r| [&r.1[target], &r.1[answer]])
        };
        let labels = labels_of(cells());
        let place = |row: &(u64, csv::StringRecord), (column, at): (&'static str, usize)| {
            let cell = &row.1[at];
            let found = labels.binary_search_by(|l| l.as_str().cmp(cell)).ok();
            let found = found.filter(|_| !cell.is_empty());
            found.ok_or_else(|| self.fault(row.0, column, cell, "a label"))
        };
        let one = |row: &(u64, csv::StringRecord)| {
            Ok(LabelRow {
                participant: row.1[participant].to_owned(),
                realization: realization.map(|at| row.1[at].to_owned()),
                right: place(row, ("target", target))?,
                given: place(row, ("answer", answer))?,
            })
        };
        let rows: Result<Vec<_>, _> = self.records.iter().map(one).collect();
        Ok((rows?, labels))
    }

    /// Ratings of how different two were.
    fn differences(&self) -> Result<Vec<SimilarityRow>, TableError> {
        let participant = self.required("participant")?;
        let (first, second) = (self.required("first")?, self.required("second")?);
        let rating = self.required("rating")?;
        let one = |row: &(u64, csv::StringRecord)| {
            Ok(SimilarityRow {
                participant: row.1[participant].to_owned(),
                first: row.1[first].to_owned(),
                second: row.1[second].to_owned(),
                rating: self.number(row, ("rating", rating), (0.0, f64::MAX))?,
            })
        };
        self.records.iter().map(one).collect()
    }

    /// Ranks; without a column `ranking` each participant has one.
    fn ranks(&self) -> Result<Vec<RankingRow>, TableError> {
        let participant = self.required("participant")?;
        let (realization, rank) = (self.required("realization")?, self.required("rank")?);
        let ranking = self.column("ranking");
        let one = |row: &(u64, csv::StringRecord)| {
            Ok(RankingRow {
                participant: row.1[participant].to_owned(),
                ranking: ranking.map_or("", |at| &row.1[at]).to_owned(),
                realization: row.1[realization].to_owned(),
                rank: self.number(row, ("rank", rank), (f64::MIN, f64::MAX))?,
            })
        };
        self.records.iter().map(one).collect()
    }

    /// Levels that were set, and that of the standard, if the table has it.
    fn settings(&self) -> Result<(Vec<SettingRow>, Option<f64>), TableError> {
        let participant = self.required("participant")?;
        let (start, level) = (self.required("start")?, self.required("level")?);
        let any = (f64::MIN, f64::MAX);
        let mut standard: Option<f64> = None;
        for row in &self.records {
            let Some(at) = self.column("standard") else {
                break;
            };
            let own = self.number(row, ("standard", at), any)?;
            let first = *standard.get_or_insert(own);
            if own != first {
                let expected = format!("{first}: a table has one standard");
                return Err(self.fault(row.0, "standard", &row.1[at], expected));
            }
        }
        let one = |row: &(u64, csv::StringRecord)| {
            let side = self.word(row, ("start", start), &["below", "above"])?;
            Ok(SettingRow {
                participant: row.1[participant].to_owned(),
                level: self.number(row, ("level", level), any)?,
                ascending: side == 0,
                changes: None,
            })
        };
        let rows: Result<Vec<_>, TableError> = self.records.iter().map(one).collect();
        Ok((rows?, standard))
    }

    /// The ratings, and which conditions are hidden reference and mid anchor.
    fn ratings(&self) -> Result<(Vec<MushraRow>, MushraRoles), TableError> {
        const ROLES: [&str; 4] = ["test", "hidden-reference", "mid-anchor", "low-anchor"];
        let participant = self.required("participant")?;
        let (condition, rating) = (self.required("condition")?, self.required("rating")?);
        let role = self.required("role")?;
        let mut roles = MushraRoles {
            reference: String::new(),
            mid_anchor: None,
        };
        let mut rows = Vec::new();
        for row in &self.records {
            let condition = row.1[condition].to_owned();
            match self.word(row, ("role", role), &ROLES)? {
                1 => roles.reference.clone_from(&condition),
                2 => roles.mid_anchor = Some(condition.clone()),
                _ => {}
            }
            rows.push(MushraRow {
                participant: row.1[participant].to_owned(),
                condition,
                rating: self.number(row, ("rating", rating), (0.0, 100.0))?,
            });
        }
        Ok((rows, roles))
    }
}
