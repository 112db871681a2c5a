//! Ratings from a CSV: a foreign table with one row for each rating, or a study's
//! `ratings.csv`.

use super::error::RatingsError;
use super::line::Line;
use super::{Builder, Felt, Origin, Ratings, Row};
use crate::outcome::rows::Status;
use std::collections::BTreeMap;
use std::io::BufRead;
use study_base::sort::SmallSort as _;
use study_plan::protocol::Role;
use study_plan::protocol::columns::{self, RatingColumn as C, UsedColumn as Foreign};

const FOREIGN: &str = "subject,model,rating[,repetition][,vaf][,trial_index][,role]";

impl Ratings {
    /// Reads a CSV with the columns `subject`, `model`, `rating` and optionally
    /// `repetition`, `vaf`, `trial_index` and `role`, in any order, or one with the
    /// columns of a study's `ratings.csv`. An empty role is `test`. Fields of model, rating and VAF may be empty, `NA` or
    /// `NaN`. A repetition that is empty or has no column is numbered from 1; a written
    /// one is kept, 0 too. A byte order mark is skipped. `question` names the column
    /// with the ratings; default: `rating`, and in a study's table the first question.
    ///
    /// ```
    /// # use study_session::outcome::ratings::{Ratings, RatingsError};
    /// let table = "subject,model,rating\nP1,a,3\nP1,b,\nP2,a,5\n";
    /// let ratings = Ratings::read_csv("t.csv", table.as_bytes(), None)?;
    /// assert_eq!((ratings.len(), ratings.models.len()), (3, 2));
    /// let wrong = Ratings::read_csv("t.csv", &b"subject,model,rating\nP1,a,high\n"[..], None);
    /// assert!(wrong.unwrap_err().to_string().contains("line 2"));
    /// # Ok::<(), RatingsError>(())
    /// ```
    ///
    /// # Errors
    /// [`RatingsError`] of the first line with an error.
    pub fn read_csv(
        name: &str,
        input: impl BufRead,
        question: Option<&str>,
    ) -> Result<Self, RatingsError> {
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::None)
            .from_reader(input);
        let header: Vec<String> = reader
            .headers()
            .map_err(|source| RatingsError::csv(name, source, 0))?
            .iter()
            .map(|h| h.trim_start_matches('\u{feff}').trim().to_owned())
            .collect();
        if let [only] = header.as_slice()
            && let Some(separator) = [';', '\t'].into_iter().find(|c| only.contains(*c))
        {
            return Err(RatingsError::Separator {
                name: name.to_owned(),
                separator,
            });
        }
        let columns = Positions::of(name, &header, question)?;
        let mut table = Reading {
            builder: Builder::new(columns.question.clone()),
            lines: Vec::new(),
        };
        let read = table.read(name, &header, &columns, &mut reader);
        let lines = table.lines;
        let mut ratings = table.builder.finish();
        ratings.near_misses = columns.near_misses;
        // A repeated row above a line that cannot be read is the first error.
        if let Some((first, second)) = repeated(&ratings) {
            let model = ratings.model[second].map(|m| &ratings.models[m as usize]);
            return Err(RatingsError::Twice {
                name: name.to_owned(),
                line: lines[second],
                first: lines[first],
                subject: ratings.subjects[ratings.subject[second] as usize]
                    .id
                    .clone(),
                model: model.map_or_else(String::new, |m| m.id.clone()),
                repetition: ratings.repetition[second],
            });
        }
        read?;
        if ratings.is_empty() {
            return Err(RatingsError::Empty {
                name: name.to_owned(),
            });
        }
        Ok(ratings)
    }
}

/// The rows of a table while it is read.
struct Reading {
    builder: Builder,
    /// Line of each row.
    lines: Vec<u64>,
}

impl Reading {
    fn read(
        &mut self,
        name: &str,
        header: &[String],
        columns: &Positions,
        reader: &mut csv::Reader<impl BufRead>,
    ) -> Result<(), RatingsError> {
        let mut record = csv::StringRecord::new();
        let mut number = 0u32;
        // The reader counts a line at its `\n`, but stops at the `\r` before it.
        let inner = header.iter().filter(|h| h.contains('\n')).count();
        let pending = u64::from(inner == 0 && reader.position().line() == 1);
        loop {
            let more = reader
                .read_record(&mut record)
                .map_err(|source| RatingsError::csv(name, source, pending))?;
            if !more {
                return Ok(());
            }
            let start = record.position().map_or(0, csv::Position::line);
            let line = match reader.position().line() - start {
                0 | 1 => start + pending,
                // Lines within a name, or empty ones before the row.
                passed => {
                    let within = record.as_slice().matches('\n').count() as u64;
                    start + pending + (passed - 1).saturating_sub(within)
                }
            };
            if record.len() != header.len() {
                return Err(RatingsError::Ragged {
                    name: name.to_owned(),
                    line,
                    found: record.len(),
                    expected: header.len(),
                });
            }
            number = number.saturating_add(1);
            let line = Line {
                name,
                header,
                record: &record,
                line,
            };
            columns.row(&line, number, &mut self.builder)?;
            // A practice row is not among the others.
            self.lines.resize(self.builder.len(), line.line);
        }
    }
}

/// The first row that repeats another: first the other row, then this one.
fn repeated(ratings: &Ratings) -> Option<(usize, usize)> {
    let order = ratings.by_cell();
    let mut found: Option<(usize, usize)> = None;
    for rows in ratings.cells(&order) {
        let of = |i: &usize| ratings.repetition[*i];
        if rows.windows(2).all(|w| of(&w[0]) < of(&w[1])) {
            continue;
        }
        let mut rows = rows.to_vec();
        rows.small_sort_by_key(of);
        for w in rows.windows(2).filter(|w| of(&w[0]) == of(&w[1])) {
            if found.is_none_or(|(_, second)| w[1] < second) {
                found = Some((w[0], w[1]));
            }
        }
    }
    found
}

/// Where the columns are that the analysis needs.
struct Positions {
    question: String,
    rating: usize,
    /// The place of each column of `ratings.csv`, in the order of their declaration; those
    /// of a foreign table with the same meaning are in their places.
    columns: Vec<Option<usize>>,
    /// Remarks, and the questions that are not read.
    texts: Vec<usize>,
    covariates: Vec<usize>,
    near_misses: Vec<(String, &'static str)>,
}

impl Positions {
    fn of(name: &str, header: &[String], question: Option<&str>) -> Result<Self, RatingsError> {
        let mut positions: BTreeMap<&str, usize> = BTreeMap::new();
        for (i, h) in header.iter().enumerate() {
            if positions.insert(h, i).is_some() {
                return Err(RatingsError::TwoColumns {
                    name: name.to_owned(),
                    column: h.clone(),
                });
            }
        }
        let find = |column: &str| positions.get(column).copied();
        let need = |column: &str| {
            find(column).ok_or_else(|| RatingsError::NoColumn {
                name: name.to_owned(),
                column: column.to_owned(),
                near: near_miss(column, header).map(str::to_owned),
                expected: FOREIGN,
            })
        };
        let has_parts = columns::are_of_parts(header);
        let own = |column: C| {
            let declared = column.column().is_in(has_parts, false);
            find(column.name()).filter(|_| declared)
        };
        let (Some(_), Some(_)) = (own(C::Participant), own(C::PlannedPosition)) else {
            let question = question.unwrap_or(Foreign::Rating.name());
            let optional = [
                Foreign::Repetition.name(),
                Foreign::Vaf.name(),
                Foreign::TrialIndex.name(),
                C::Role.name(),
            ];
            let missed = optional.into_iter().filter(|column| find(column).is_none());
            let near = missed.filter_map(|c| Some((near_miss(c, header)?.to_owned(), c)));
            let places = [
                (C::Participant, Some(need(Foreign::Subject.name())?)),
                (C::Model, Some(need(Foreign::Model.name())?)),
                (C::Repetition, find(Foreign::Repetition.name())),
                (C::Vaf, find(Foreign::Vaf.name())),
                (C::Position, find(Foreign::TrialIndex.name())),
                (C::Role, own(C::Role)),
            ];
            let place = |column: &C| places.iter().find(|p| p.0 == *column).and_then(|p| p.1);
            return Ok(Self {
                near_misses: near.collect(),
                question: question.to_owned(),
                rating: need(question)?,
                columns: C::ALL.iter().map(place).collect(),
                texts: Vec::new(),
                covariates: MEMORY.iter().filter_map(|c| find(c)).collect(),
            });
        };
        // A repeated column fills the space between its neighbors.
        let repeated = |column: C| {
            let mut before = C::ALL.iter().rev().skip_while(|c| **c != column).skip(1);
            let mut after = C::ALL.iter().skip_while(|c| **c != column).skip(1);
            let start = before.find_map(|c| own(*c)).map_or(0, |i| i + 1);
            start..after.find_map(|c| own(*c)).unwrap_or(header.len())
        };
        let questions = repeated(C::Questions);
        let rating = match question {
            Some(question) => need(question)?,
            None if !questions.is_empty() => questions.start,
            None => {
                return Err(RatingsError::NoQuestion {
                    name: name.to_owned(),
                });
            }
        };
        let texts = questions.filter(|&i| i != rating);
        for column in [C::Model, C::Repetition] {
            need(column.name())?;
        }
        Ok(Self {
            near_misses: Vec::new(),
            question: header[rating].clone(),
            rating,
            columns: C::ALL.iter().map(|column| own(*column)).collect(),
            texts: texts.chain(own(C::Remarks)).collect(),
            covariates: repeated(C::Covariates).collect(),
        })
    }

    /// Where a column is; `None`: the table lacks it.
    fn at(&self, column: C) -> Option<usize> {
        self.columns[column as usize]
    }

    /// Adds the row of a line to the others.
    fn row(&self, line: &Line<'_>, number: u32, builder: &mut Builder) -> Result<(), RatingsError> {
        let text = |column: C| self.at(column).map_or("", |at| line.text(at));
        let subject = text(C::Participant);
        if subject.is_empty() {
            let at = self.at(C::Participant).unwrap_or(0);
            return Err(line.error(at, "the name of a participant"));
        }
        let model = text(C::Model);
        // Of a study with parts only trials with a single, planned realization are rated.
        if self.at(C::Track).is_some() && (model.is_empty() || !text(C::Track).is_empty()) {
            return Ok(());
        }
        let flag = |column: C| line.flag(self.at(column));
        let origin = Origin::of(flag(C::Simulated)?, flag(C::Pilot)?);
        let repetition = line.whole(self.at(C::Repetition))?;
        let mut row = Row {
            origin,
            repetition: repetition.unwrap_or(0),
            rating: line.number(Some(self.rating))?,
            ..Row::read(line, |column| self.at(column))?
        };
        row.source_row = number;
        row.felt = self.felt(line)?;
        row.trial_index = row.trial_index.filter(|t| *t > 0);
        let practice = flag(C::Practice)?;
        let has_role = !practice && !text(C::Role).is_empty();
        let role = match self.at(C::Role).filter(|_| has_role) {
            Some(at) => line.level(at, C::Role)?,
            None => Role::Test,
        };
        // A foreign table has no column that says so.
        if practice || (self.at(C::Practice).is_none() && role == Role::Practice) {
            builder.practice(subject, model, row);
            return Ok(());
        }
        let energy = match row.status {
            Status::Ok => line.number(self.at(C::LeastEnergyJ))?,
            Status::Failed | Status::Declined | Status::Missing => None,
        };
        for &i in &self.texts {
            let text = &line.record[i];
            // The answers to other numeric questions are not comments.
            if !text.trim().is_empty() && text.trim().parse::<f64>().is_err() {
                builder.comment(line.header[i].clone(), text.to_owned());
            }
        }
        row.subject = builder.subject(subject);
        if !model.is_empty() {
            let model = builder.model(model, role, || self.covariates(line));
            row.model = Some(model);
            if let Some(energy) = energy {
                builder.least_energy(model, row.origin, energy);
            }
        }
        if repetition.is_none() {
            builder.number_next();
        }
        builder.push(row);
        Ok(())
    }

    /// What was felt, where the table says so.
    fn felt(&self, line: &Line<'_>) -> Result<Option<Felt>, RatingsError> {
        let Some(at) = self
            .at(C::Rendering)
            .filter(|&at| !line.text(at).is_empty())
        else {
            return Ok(None);
        };
        let number = |column: C| line.number(self.at(column));
        Ok(Some(Felt {
            verdict: line.level(at, C::Rendering)?,
            rendered_vaf: number(C::RenderedVaf)?,
            gain: number(C::RenderedGain)?,
            delivered_vaf: number(C::DeliveredVaf)?,
            judged_share: number(C::JudgedShare)?,
            error_jnd: number(C::ErrorJnd)?,
            failed: 0,
        }))
    }

    /// Those that are numbers.
    fn covariates(&self, line: &Line<'_>) -> BTreeMap<String, f64> {
        let number = |i: usize| line.text(i).parse().ok().filter(|v: &f64| v.is_finite());
        (self.covariates.iter())
            .filter_map(|&i| Some((line.header[i].clone(), number(i)?)))
            .collect()
    }
}

/// A column whose name differs from `wanted` only in case.
fn near_miss<'h>(wanted: &str, header: &'h [String]) -> Option<&'h str> {
    let near = |h: &&String| h.eq_ignore_ascii_case(wanted);
    header.iter().find(near).map(String::as_str)
}

/// Columns of a foreign table that give the memory of a realization.
const MEMORY: [&str; 2] = ["lambda", "memory_mm"];

#[cfg(test)]
mod tests {
    use super::*;

    fn read(csv: &str) -> Result<Ratings, RatingsError> {
        Ratings::read_csv("r.csv", csv.as_bytes(), None)
    }

    fn message(csv: &str) -> String {
        read(csv).unwrap_err().to_string()
    }

    const HEAD: &str = "subject,model,repetition,rating,vaf\n";

    #[test]
    fn names_that_differ_only_in_case_are_noticed() {
        assert_eq!(
            message("Subject,model,rating\nS1,A,4\n"),
            "r.csv: no column `subject` (rename `Subject`); a table of ratings has the columns \
             subject,model,rating[,repetition][,vaf][,trial_index][,role]"
        );
        let r = read("subject,model,rating,VAF,Role\nS1,A,4,0.5,test\n").unwrap();
        let near: Vec<_> = r
            .near_misses
            .iter()
            .map(|(c, k)| (c.as_str(), *k))
            .collect();
        assert_eq!(near, [("VAF", "vaf"), ("Role", "role")]);
        assert_eq!(
            read(&format!("{HEAD}S1,A,1,4,0.5\n")).unwrap().near_misses,
            []
        );
    }

    #[test]
    fn a_foreign_table_can_have_roles() {
        let csv = "subject,model,rating,role\nS1,A,4,\nS1,B,5,hidden-reference\nS1,C,2,practice\n";
        let r = read(csv).unwrap();
        let roles: Vec<Role> = r.models.iter().map(|m| m.role).collect();
        assert_eq!(roles, [Role::Test, Role::HiddenReference]);
        assert_eq!(r.practice.len(), 1);
        assert!(message("subject,model,rating,role\nS1,A,4,best\n").contains("one of test, "));
    }

    #[test]
    fn a_byte_order_mark_and_empty_fields_are_allowed() {
        let r = read(&format!("\u{feff}{HEAD}S1,,1,,\nS1,,2,4,0.5\n")).unwrap();
        assert_eq!(r.model, [None; 2]);
        assert_eq!((r.len(), r.models.len()), (2, 0));
        assert_eq!(r.status, [Status::Missing, Status::Ok]);
    }

    #[test]
    fn three_columns_are_a_table() {
        let r = read("subject,model,rating\nS1,A,4\nS1,B,2\nS1,A,5\n").unwrap();
        assert_eq!(r.repetition, [1, 1, 2]);
        assert!(r.vaf.iter().all(Option::is_none));
    }

    #[test]
    fn repetitions_may_count_from_zero_and_keep_their_numbers() {
        let r = read(&format!(
            "{HEAD}S1,A,0,4,\nS1,A,1,5,\nS1,B,0,4,\nS1,B,2,5,\n"
        ))
        .unwrap();
        assert_eq!(r.repetition, [0, 1, 0, 2]);
        // An empty field is no 0: it is counted up.
        let r = read(&format!("{HEAD}S1,A,0,4,\nS1,A,,5,\nS1,B,,4,\nS1,B,,5,\n")).unwrap();
        assert_eq!(r.repetition, [0, 2, 1, 2]);
        assert_eq!(
            message(&format!("{HEAD}S1,A,0,4,\nS1,A,0,5,\n")),
            "r.csv, line 3: subject `S1`, model `A`, repetition 0 is already on line 2"
        );
        assert!(message(&format!("{HEAD}S1,A,4294967296,4,\n")).contains("whole number from 0"));
    }

    #[test]
    fn each_error_names_its_line() {
        assert_eq!(
            message(&format!("{HEAD}S1,A,1,4,0.5\nS1,B,1,4\n")),
            "r.csv, line 3: 4 fields, but the header has 5"
        );
        assert_eq!(
            message(&format!("{HEAD}S1,A,1,four,0.5\n")),
            "r.csv, line 2: `four` in column `rating` is not a finite number"
        );
        assert_eq!(
            message(&format!("{HEAD}S1,A,1,inf,0.5\n")),
            "r.csv, line 2: `inf` in column `rating` is not a finite number"
        );
        assert_eq!(
            message(&format!("{HEAD}S1,A,1,4,0.5\nS1,A,1,5,0.5\n")),
            "r.csv, line 3: subject `S1`, model `A`, repetition 1 is already on line 2"
        );
        // Lines are those of an editor: also where they end in \r\n, where one is
        // empty and where a name goes on in the next.
        let wrong = "S1,A,1,four,0.5\n";
        for (before, line) in [
            ("", 2),
            ("S0,A,1,4,0.5\n", 3),
            ("S0,A,1,4,0.5\n\n\n", 5),
            ("S0,\"A\nB\",1,4,0.5\n", 4),
            ("S0,\"A\nB\",1,4,0.5\n\nS0,A,1,4,0.5\n", 6),
        ] {
            for end in ["\n", "\r\n"] {
                let text = format!("{HEAD}{before}{wrong}").replace('\n', end);
                let found = message(&text);
                assert!(
                    found.starts_with(&format!("r.csv, line {line}:")),
                    "{found} {text:?}"
                );
            }
        }
        assert_eq!(message(HEAD), "r.csv: no ratings, only a header");
        assert!(message("subject,model,vaf\n").contains("no column `rating`"));
        assert!(message("subject,subject\n").contains("two columns are named `subject`"));
        assert_eq!(
            message("subject;model;repetition;rating;vaf\nS1;A;1;4,5;0,5\n"),
            "r.csv: the columns are separated by `;`; save it with commas between the columns \
             and points in the numbers, or read it with `study import table`"
        );
        let latin = [HEAD.as_bytes(), b"S1,A,1,4,0.5\nM\xfcller,A,1,4,0.5\n"].concat();
        assert_eq!(
            Ratings::read_csv("r.csv", latin.as_slice(), None)
                .unwrap_err()
                .to_string(),
            "r.csv, line 3: this is not UTF-8; save it as CSV in UTF-8"
        );
    }

    #[test]
    fn a_hostile_field_is_shown_escaped() {
        let found = message(&format!("{HEAD}S1,A,1,\u{1b}[2J,0.5\n"));
        assert!(found.contains("\\u{1b}[2J") && !found.contains('\u{1b}'));
    }

    #[test]
    fn the_table_of_a_study_is_read() {
        let csv = "study,participant,session,row,trial,block,position,planned_position,model,role,\
                   repetition,practice,pilot,simulated,protocol_version,realism,comment,corrected,\
                   remarks,attempt,status,vaf\n\
                   x,SIM001,1,,1,0,,1,Z,practice,0,true,false,true,1,3,,false,,1,ok,\n\
                   x,SIM001,1,,2,1,1,1,A,test,1,false,false,true,1,5,\"a, b\",true,hm,2,ok,0.8\n\
                   x,SIM001,1,,3,1,2,2,B,low-anchor,1,false,false,true,1,,,false,,1,declined,0.1\n";
        let r = read(csv).unwrap();
        assert_eq!(
            (r.question.as_str(), r.practice.len(), r.len()),
            ("realism", 1, 2)
        );
        assert_eq!(r.models[1].role, Role::LowAnchor);
        assert_eq!(r.origin, [Origin::Simulated; 2]);
        assert_eq!((r.attempt[0], r.corrected[0]), (Some(2), true));
        let texts: Vec<&str> = r.comments.iter().map(|c| c.text.as_str()).collect();
        assert_eq!(texts, ["a, b", "hm"]);
    }
}
