//! Ratings from a CSV: somebody else's long form, or our own `ratings.csv`.

use super::error::RatingsError;
use super::{Builder, NO_MODEL, NO_STROKES, Origin, Ratings, Row};
use crate::outcome::columns::Status;
use crate::protocol::Role;
use std::collections::BTreeMap;
use std::io::BufRead;

/// Stands for a repetition that is not written, until it is counted up.
const NOT_WRITTEN: u32 = u32::MAX;

const FOREIGN: &str = "subject,model,rating[,repetition][,vaf][,trial_index]";

/// Columns of our own table that stand before the questions.
const BEFORE_QUESTIONS: &str = "protocol_version";

impl Ratings {
    /// Reads a CSV with the columns `subject,model,rating` and optionally
    /// `repetition`, `vaf` and `trial_index`, in any order, or one with the columns of
    /// our own `ratings.csv`. Empty fields of model, rating and vaf are missing, and so
    /// are `NA` and `NaN`; a repetition that is empty or has no column is counted up
    /// from 1; a written one is kept as it is, 0 too.
    /// A byte order mark is skipped. In our own table `question` names the column (default: the
    /// first after `protocol_version`).
    ///
    /// # Errors
    /// [`RatingsError`], at the first line that is wrong.
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
        let columns = Columns::of(name, &header, question)?;
        let mut table = Reading {
            builder: Builder::new(columns.question.clone()),
            lines: Vec::new(),
        };
        let read = table.read(name, &header, &columns, &mut reader);
        let lines = table.lines;
        let mut ratings = table.builder.finish();
        // A repeated row above a line that cannot be read is the first fault.
        number_repetitions(&mut ratings);
        if let Some((first, second)) = repeated(&ratings) {
            let model = ratings.models.get(ratings.model[second] as usize);
            return Err(RatingsError::Twice {
                name: name.to_owned(),
                line: lines[second].into(),
                first: lines[first].into(),
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

/// A table that is being read.
struct Reading {
    builder: Builder,
    /// Line of each row.
    lines: Vec<u32>,
}

impl Reading {
    fn read(
        &mut self,
        name: &str,
        header: &[String],
        columns: &Columns,
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
            if let Some(row) = columns.row(&line, number, &mut self.builder)? {
                self.builder.push(row);
                self.lines
                    .push(u32::try_from(line.line).unwrap_or(u32::MAX));
            }
        }
    }
}

/// Counts up the repetitions that a table leaves empty, in the order of its rows.
fn number_repetitions(ratings: &mut Ratings) {
    if !ratings.repetition.contains(&NOT_WRITTEN) {
        return;
    }
    let order = ratings.by_cell();
    for rows in cells(ratings, &order)
        .map(<[usize]>::to_vec)
        .collect::<Vec<_>>()
    {
        for (n, i) in (1u32..).zip(rows) {
            if ratings.repetition[i] == NOT_WRITTEN {
                ratings.repetition[i] = n;
            }
        }
    }
}

/// The rows of each subject and realization.
fn cells<'o>(ratings: &'o Ratings, order: &'o [usize]) -> impl Iterator<Item = &'o [usize]> {
    order.chunk_by(|&a, &b| {
        (ratings.subject[a], ratings.model[a]) == (ratings.subject[b], ratings.model[b])
    })
}

/// The first row that repeats another, after that other.
fn repeated(ratings: &Ratings) -> Option<(usize, usize)> {
    let order = ratings.by_cell();
    let mut found: Option<(usize, usize)> = None;
    for rows in cells(ratings, &order) {
        let of = |i: &usize| ratings.repetition[*i];
        if rows.windows(2).all(|w| of(&w[0]) < of(&w[1])) {
            continue;
        }
        let mut rows = rows.to_vec();
        rows.sort_by_key(of);
        for w in rows.windows(2).filter(|w| of(&w[0]) == of(&w[1])) {
            if found.is_none_or(|(_, second)| w[1] < second) {
                found = Some((w[0], w[1]));
            }
        }
    }
    found
}

/// Where the columns of interest stand.
struct Columns {
    question: String,
    subject: usize,
    model: usize,
    repetition: Option<usize>,
    rating: usize,
    vaf: Option<usize>,
    trial_index: Option<usize>,
    strokes: Option<usize>,
    least_energy: Option<usize>,
    /// Those after `vaf` in our own table; of somebody else's, what tells the
    /// memory of a realization.
    covariates: Vec<usize>,
    ours: Option<Ours>,
}

/// What only our own table has.
struct Ours {
    role: Option<usize>,
    practice: Option<usize>,
    pilot: Option<usize>,
    simulated: Option<usize>,
    status: Option<usize>,
    corrected: Option<usize>,
    attempt: Option<usize>,
    texts: Vec<usize>,
}

impl Columns {
    fn of(name: &str, header: &[String], question: Option<&str>) -> Result<Self, RatingsError> {
        let mut places: BTreeMap<&str, usize> = BTreeMap::new();
        for (i, h) in header.iter().enumerate() {
            if places.insert(h, i).is_some() {
                return Err(RatingsError::TwoColumns {
                    name: name.to_owned(),
                    column: h.clone(),
                });
            }
        }
        let find = |column: &str| places.get(column).copied();
        let need = |column: &str| {
            find(column).ok_or_else(|| RatingsError::NoColumn {
                name: name.to_owned(),
                column: column.to_owned(),
                expected: FOREIGN,
            })
        };
        let ours = find("participant").zip(find("planned_position"));
        let Some((subject, _)) = ours else {
            return Ok(Self {
                question: question.unwrap_or("rating").to_owned(),
                subject: need("subject")?,
                model: need("model")?,
                repetition: find("repetition"),
                rating: need(question.unwrap_or("rating"))?,
                vaf: find("vaf"),
                trial_index: find("trial_index"),
                strokes: None,
                least_energy: None,
                covariates: MEMORY.iter().filter_map(|c| find(c)).collect(),
                ours: None,
            });
        };
        let first = find(BEFORE_QUESTIONS).map_or(0, |i| i + 1);
        let end = find("corrected").unwrap_or(first);
        let rating = match question {
            Some(q) => need(q)?,
            None if first < end => first,
            None => need("realism")?,
        };
        let texts = (first..end).filter(|&i| i != rating).chain(find("remarks"));
        Ok(Self {
            question: header[rating].clone(),
            subject,
            model: need("model")?,
            repetition: Some(need("repetition")?),
            rating,
            vaf: find("vaf"),
            trial_index: find("position"),
            strokes: find("strokes"),
            least_energy: find("least_energy_j"),
            covariates: find("vaf").map_or(Vec::new(), |v| (v + 1..header.len()).collect()),
            ours: Some(Ours {
                role: find("role"),
                practice: find("practice"),
                pilot: find("pilot"),
                simulated: find("simulated"),
                status: find("status"),
                corrected: find("corrected"),
                attempt: find("attempt"),
                texts: texts.collect(),
            }),
        })
    }

    /// `None`: a practice row.
    fn row(
        &self,
        line: &Line<'_>,
        number: u32,
        builder: &mut Builder,
    ) -> Result<Option<Row>, RatingsError> {
        let subject = line.text(self.subject);
        if subject.is_empty() {
            return Err(line.fault(self.subject, "name of a subject"));
        }
        let mut row = Row {
            subject: 0,
            model: NO_MODEL,
            repetition: line.repetition(self.repetition)?,
            rating: line.number(self.rating)?,
            vaf: self.vaf.map_or(Ok(f64::NAN), |i| line.number(i))?,
            trial_index: self.trial_index.map_or(Ok(0), |i| line.whole(i))?,
            origin: Origin::Real,
            status: Status::Ok,
            corrected: false,
            attempt: 0,
            strokes: NO_STROKES,
            source_row: number,
        };
        let mut role = Role::Test;
        let mut energy = None;
        if let Some(ours) = &self.ours {
            let flag = |at: Option<usize>| at.map_or(Ok(false), |i| line.flag(i));
            if flag(ours.practice)? {
                row.repetition %= NOT_WRITTEN;
                builder.practice(subject, line.text(self.model), &row);
                return Ok(None);
            }
            role = ours.role.map_or(Ok(Role::Test), |i| {
                line.word(i, &ROLES, "role of a realization")
            })?;
            row.status = ours.status.map_or(Ok(Status::Ok), |i| {
                line.word(i, &STATUSES, "status (ok, failed, declined, missing)")
            })?;
            row.origin = match (flag(ours.simulated)?, flag(ours.pilot)?) {
                (true, _) => Origin::Simulated,
                (false, true) => Origin::Pilot,
                (false, false) => Origin::Real,
            };
            row.corrected = flag(ours.corrected)?;
            row.attempt = ours.attempt.map_or(Ok(0), |i| line.whole(i))?;
            if let Some(i) = self.strokes.filter(|&i| !line.text(i).is_empty()) {
                row.strokes = line.whole(i)?;
            }
            let telling = row.status == Status::Ok;
            if let Some(i) = self.least_energy.filter(|_| telling) {
                energy = Some(line.number(i)?);
            }
            if row.status == Status::Failed {
                row.rating = f64::NAN;
            }
            for &i in &ours.texts {
                let text = &line.record[i];
                // Other numeric questions are not comments.
                if !text.trim().is_empty() && text.trim().parse::<f64>().is_err() {
                    builder.comment(line.header[i].clone(), text.to_owned());
                }
            }
        }
        if row.rating.is_nan() && row.status == Status::Ok {
            row.status = Status::Missing;
        }
        row.subject = builder.subject(subject);
        let model = line.text(self.model);
        if !model.is_empty() {
            row.model = builder.model(model, role, || self.covariates(line));
            if let Some(energy) = energy {
                builder.least_energy(row.model, row.origin, energy);
            }
        }
        Ok(Some(row))
    }

    /// Those that are numbers.
    fn covariates(&self, line: &Line<'_>) -> BTreeMap<String, f64> {
        let number = |i: usize| line.text(i).parse().ok().filter(|v: &f64| v.is_finite());
        (self.covariates.iter())
            .filter_map(|&i| Some((line.header[i].clone(), number(i)?)))
            .collect()
    }
}

/// Columns of somebody else's table that tell the memory of a realization.
const MEMORY: [&str; 2] = ["lambda", "memory_mm"];

const ROLES: [(&str, Role); 5] = [
    ("test", Role::Test),
    ("practice", Role::Practice),
    ("hidden-reference", Role::HiddenReference),
    ("low-anchor", Role::LowAnchor),
    ("physical", Role::Physical),
];

const STATUSES: [(&str, Status); 4] = [
    ("ok", Status::Ok),
    ("failed", Status::Failed),
    ("declined", Status::Declined),
    ("missing", Status::Missing),
];

struct Line<'a> {
    name: &'a str,
    header: &'a [String],
    record: &'a csv::StringRecord,
    line: u64,
}

impl Line<'_> {
    fn text(&self, at: usize) -> &str {
        self.record[at].trim()
    }

    fn fault(&self, at: usize, wanted: &'static str) -> RatingsError {
        RatingsError::Field {
            name: self.name.to_owned(),
            line: self.line,
            column: self.header[at].clone(),
            field: self.record[at].to_owned(),
            wanted,
        }
    }

    fn number(&self, at: usize) -> Result<f64, RatingsError> {
        let text = self.text(at);
        if text.is_empty() || text.eq_ignore_ascii_case("na") || text.eq_ignore_ascii_case("nan") {
            return Ok(f64::NAN);
        }
        text.parse()
            .ok()
            .filter(|v: &f64| v.is_finite())
            .ok_or_else(|| self.fault(at, "finite number"))
    }

    /// A written repetition, from whichever number the table counts.
    fn repetition(&self, at: Option<usize>) -> Result<u32, RatingsError> {
        match at.filter(|&i| !self.text(i).is_empty()) {
            None => Ok(NOT_WRITTEN),
            Some(i) => match self.whole(i)? {
                NOT_WRITTEN => Err(self.fault(i, "number of a repetition")),
                n => Ok(n),
            },
        }
    }

    /// A whole number from 1; empty is 0.
    fn whole(&self, at: usize) -> Result<u32, RatingsError> {
        match self.text(at) {
            "" => Ok(0),
            text => text
                .parse()
                .map_err(|_| self.fault(at, "whole number from 0")),
        }
    }

    fn flag(&self, at: usize) -> Result<bool, RatingsError> {
        match self.text(at) {
            "true" => Ok(true),
            "false" | "" => Ok(false),
            _ => Err(self.fault(at, "`true` or `false`")),
        }
    }

    fn word<T: Copy>(
        &self,
        at: usize,
        words: &[(&str, T)],
        wanted: &'static str,
    ) -> Result<T, RatingsError> {
        words
            .iter()
            .find(|(word, _)| *word == self.text(at))
            .map(|(_, value)| *value)
            .ok_or_else(|| self.fault(at, wanted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(csv: &str) -> Result<Ratings, RatingsError> {
        Ratings::read_csv("r.csv", csv.as_bytes(), None)
    }

    fn says(csv: &str) -> String {
        read(csv).unwrap_err().to_string()
    }

    const HEAD: &str = "subject,model,repetition,rating,vaf\n";

    #[test]
    fn a_byte_order_mark_and_empty_fields_are_no_fault() {
        let r = read(&format!("\u{feff}{HEAD}S1,,1,,\nS1,,2,4,0.5\n")).unwrap();
        assert_eq!(r.model, [NO_MODEL; 2]);
        assert_eq!((r.len(), r.models.len()), (2, 0));
        assert_eq!(r.status, [Status::Missing, Status::Ok]);
    }

    #[test]
    fn three_columns_are_a_table() {
        let r = read("subject,model,rating\nS1,A,4\nS1,B,2\nS1,A,5\n").unwrap();
        assert_eq!(r.repetition, [1, 1, 2]);
        assert!(r.vaf.iter().all(|v| v.is_nan()));
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
            says(&format!("{HEAD}S1,A,0,4,\nS1,A,0,5,\n")),
            "r.csv, line 3: subject `S1`, model `A`, repetition 0 came already on line 2"
        );
        assert!(says(&format!("{HEAD}S1,A,4294967295,4,\n")).contains("number of a repetition"));
    }

    #[test]
    fn each_fault_names_its_line() {
        assert_eq!(
            says(&format!("{HEAD}S1,A,1,4,0.5\nS1,B,1,4\n")),
            "r.csv, line 3: 4 fields, but the header has 5"
        );
        assert_eq!(
            says(&format!("{HEAD}S1,A,1,four,0.5\n")),
            "r.csv, line 2: `four` in column `rating` is no finite number"
        );
        assert_eq!(
            says(&format!("{HEAD}S1,A,1,inf,0.5\n")),
            "r.csv, line 2: `inf` in column `rating` is no finite number"
        );
        assert_eq!(
            says(&format!("{HEAD}S1,A,1,4,0.5\nS1,A,1,5,0.5\n")),
            "r.csv, line 3: subject `S1`, model `A`, repetition 1 came already on line 2"
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
                let said = says(&text);
                assert!(
                    said.starts_with(&format!("r.csv, line {line}:")),
                    "{said} {text:?}"
                );
            }
        }
        assert_eq!(says(HEAD), "r.csv: no ratings, only a header");
        assert!(says("subject,model,vaf\n").contains("no column `rating`"));
        assert!(says("subject,subject\n").contains("two columns are named `subject`"));
        assert_eq!(
            says("subject;model;repetition;rating;vaf\nS1;A;1;4,5;0,5\n"),
            "r.csv: the columns are separated by `;`; save it with commas between the columns \
             and points in the numbers"
        );
        let latin = [HEAD.as_bytes(), b"S1,A,1,4,0.5\nM\xfcller,A,1,4,0.5\n"].concat();
        assert_eq!(
            Ratings::read_csv("r.csv", latin.as_slice(), None)
                .unwrap_err()
                .to_string(),
            "r.csv, line 3: this is no UTF-8; save it as CSV in UTF-8"
        );
    }

    #[test]
    fn a_hostile_field_is_shown_escaped() {
        let said = says(&format!("{HEAD}S1,A,1,\u{1b}[2J,0.5\n"));
        assert!(said.contains("\\u{1b}[2J") && !said.contains('\u{1b}'));
    }

    #[test]
    fn our_own_table_is_understood() {
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
        assert_eq!((r.attempt[0], r.corrected[0]), (2, true));
        let texts: Vec<&str> = r.comments.iter().map(|c| c.text.as_str()).collect();
        assert_eq!(texts, ["a, b", "hm"]);
    }
}
