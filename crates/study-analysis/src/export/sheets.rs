//! Tables for spreadsheets and for programs with panels for repeated measures.

use super::delimited::{self, dictionary, labels};
use super::table::{Field, Table, Type};
use super::{ExportError, Format, Job, readme, telemetry};
use std::collections::BTreeMap;
use study_base::text::{ParticipantId, QuestionId};
use study_plan::protocol::{Occasion, Question, Questionnaire};
use study_session::outcome::cell::Cell;
use study_session::outcome::{RatingRow, Status};

/// Tables for spreadsheets.
pub(super) struct Csv;

impl Format for Csv {
    const NAME: &'static str = "csv";
    const ABOUT: &'static str = "Tables for spreadsheets, JASP and jamovi";
    const SHEETS: bool = true;

    fn files(job: &mut Job<'_>) -> Result<(), ExportError> {
        let tables: Vec<&Table<'_>> = job.tables.all().collect();
        let mut files = Vec::new();
        for table in &tables {
            let bytes = delimited::csv(table, &job.options.dialect);
            job.file(&format!("{}.csv", table.name), &bytes)?;
            files.push(readme::listed(table));
        }
        documents(job, &tables, files)
    }
}

/// A table with one row for each participant.
pub(super) struct Wide;

impl Format for Wide {
    const NAME: &'static str = "wide";
    const ABOUT: &'static str = "One row for each participant";
    const SHEETS: bool = true;
    const TELEMETRY: bool = false;

    fn files(job: &mut Job<'_>) -> Result<(), ExportError> {
        let table = side_by_side(job)?;
        let bytes = delimited::csv(&table, &job.options.dialect);
        job.file("wide.csv", &bytes)?;
        let files = vec![readme::listed(&table)];
        documents(job, &[&table, &job.tables.realizations], files)
    }
}

/// What both have beside their tables.
fn documents(
    job: &mut Job<'_>,
    tables: &[&Table<'_>],
    mut files: Vec<(String, &'static str)>,
) -> Result<(), ExportError> {
    let dialect = job.options.dialect;
    job.file("dictionary.csv", &dictionary(tables, &dialect))?;
    job.file("labels.csv", &labels(tables, &dialect))?;
    telemetry::by_session(job, |job, session| {
        let path = format!("telemetry/{}-{}.csv", session.participant, session.session);
        job.file(&path, &session.bytes)
    })?;
    for (path, what) in [
        ("dictionary.csv", "what the columns mean"),
        ("labels.csv", "the labels of values"),
    ] {
        files.push((path.to_owned(), what));
    }
    if job.options.telemetry {
        files.push((
            "telemetry/".to_owned(),
            "position and force of the attempts that count",
        ));
    }
    let text = readme::readme(job, &files, &[]);
    job.file("README.md", text.as_bytes())?;
    let changes = readme::changes(job);
    job.file("CHANGES.md", changes.as_bytes())
}

/// What distinguishes the ratings of a participant: part and session if there are
/// several, and realization.
type Group = (Option<String>, Option<u32>, String);

/// The ratings of a group: repetition, participant, rating.
type Repetitions<'a> = BTreeMap<u32, BTreeMap<&'a ParticipantId, f64>>;

/// One row for each participant: what the table of participants has, then the mean
/// rating of each realization and each rating.
fn side_by_side<'a>(job: &Job<'a>) -> Result<Table<'a>, ExportError> {
    let protocol = job.source.protocol;
    let counts = |r: &&RatingRow| {
        r.model.is_some() && r.track.is_none() && !r.practice && r.status != Status::Failed
    };
    let rows: Vec<&RatingRow> = job.selected.rows.iter().filter(counts).collect();
    if rows.is_empty() {
        return Err(ExportError::NotWide);
    }
    let several = rows.iter().any(|r| r.part != rows[0].part);
    let sessions = job.selected.several_sessions();
    let order: BTreeMap<&str, usize> = (protocol.models.iter().enumerate())
        .map(|(i, m)| (m.id.as_str(), i))
        .collect();
    let group = |r: &RatingRow| -> Group {
        let part = r.part.as_ref().filter(|_| several).map(ToString::to_string);
        let model = r
            .model
            .as_ref()
            .map_or_else(String::new, ToString::to_string);
        (part, sessions.then_some(r.session), model)
    };
    let mut table = job.tables.participants.clone();
    table.name = "wide";
    table.meaning =
        "One row for each participant: the mean rating of each realization and each rating.";
    let ids: Vec<&ParticipantId> = job
        .selected
        .participants
        .iter()
        .map(|p| &p.participant)
        .collect();
    // Those of other questionnaires are about no realization.
    let about_each = |own: &&Questionnaire| own.after == Occasion::Condition;
    let after_each = protocol.questionnaires.iter().filter(about_each);
    let numeric = (protocol.questions.iter())
        .chain(after_each.flat_map(|own| &own.questions))
        .filter(|q| q.kind.scale().is_number());
    for question in numeric {
        let mut ratings: BTreeMap<(usize, Group), Repetitions<'_>> = BTreeMap::new();
        for row in &rows {
            let own = group(row);
            let place = order.get(own.2.as_str()).copied().unwrap_or(usize::MAX);
            if let Some(x) = number(row, &question.id) {
                let cells = ratings.entry((place, own)).or_default();
                cells
                    .entry(row.repetition)
                    .or_default()
                    .insert(&row.participant, x);
            }
        }
        for ((_, group), repetitions) in &ratings {
            let mean = |id: &&ParticipantId| {
                let own: Vec<f64> = repetitions
                    .values()
                    .filter_map(|r| r.get(*id).copied())
                    .collect();
                match own.is_empty() {
                    true => Cell::Empty,
                    false => Cell::Number(own.iter().sum::<f64>() / own.len() as f64),
                }
            };
            let cells: Vec<Cell<'_>> = ids.iter().map(mean).collect();
            table.add(field(question, group, None), cells);
        }
        for ((_, group), repetitions) in &ratings {
            for (repetition, of) in repetitions {
                let one =
                    |id: &&ParticipantId| of.get(*id).map_or(Cell::Empty, |x| Cell::Number(*x));
                let cells: Vec<Cell<'_>> = ids.iter().map(one).collect();
                table.add(field(question, group, Some(*repetition)), cells);
            }
        }
    }
    Ok(table)
}

fn number(row: &RatingRow, question: &QuestionId) -> Option<f64> {
    let answer = row.answers.get(question)?;
    answer.number().filter(|x| x.is_finite())
}

/// A column of ratings, or of their mean.
fn field(question: &Question, (part, session, model): &Group, repetition: Option<u32>) -> Field {
    let of = repetition.map_or_else(|| "mean".to_owned(), |r| r.to_string());
    let names = [
        part.clone(),
        session.map(|s| format!("session{s}")),
        Some(question.id.to_string()),
        Some(model.clone()),
        Some(of),
    ];
    let name = names.into_iter().flatten().collect::<Vec<_>>().join("_");
    let what = match repetition {
        Some(r) => format!("rating of {model}, repetition {r}"),
        None => format!("mean rating of {model} over the repetitions"),
    };
    let mut field = Field::new(Type::Number, &name, &what);
    field.title = Some(question.prompt.clone());
    field.empty = Some("declined or not answered".to_owned());
    field
}
