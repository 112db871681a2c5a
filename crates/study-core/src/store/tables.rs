//! The derived tables as CSV.
//!
//! RFC 4180: UTF-8, lines end in CR LF, a cell with a comma, quotation mark or
//! line end is quoted. Cells hold what was typed; no formula is guarded here, that
//! is for an export to spreadsheets.

use super::derive::Columns;
use crate::outcome::{AttemptRow, Author, Failure, ParticipantRow, RatingRow};
use crate::protocol::{Answer, columns};
use chrono::{DateTime, FixedOffset};
use std::io;
use study_base::text::QuestionId;

const ATTEMPT_COLUMNS: [&str; 15] = [
    "participant",
    "session",
    "pilot",
    "simulated",
    "trial",
    "attempt",
    "model",
    "what",
    "question",
    "from",
    "to",
    "failure",
    "by",
    "text",
    "at",
];

type Writer = csv::Writer<Vec<u8>>;

fn writer() -> Writer {
    csv::WriterBuilder::new()
        .terminator(csv::Terminator::CRLF)
        .from_writer(Vec::new())
}

fn bytes(writer: Writer) -> io::Result<Vec<u8>> {
    writer
        .into_inner()
        .map_err(|e| io::Error::other(e.to_string()))
}

fn cell<T: ToString>(value: Option<T>) -> String {
    value.map(|v| v.to_string()).unwrap_or_default()
}

fn number(value: Option<f64>) -> String {
    cell(value.filter(|v| v.is_finite()))
}

fn time(at: Option<DateTime<FixedOffset>>) -> String {
    at.map(|at| at.to_rfc3339()).unwrap_or_default()
}

fn answer(answer: Option<&Answer>) -> String {
    answer.map(Answer::cell).unwrap_or_default()
}

/// `ratings.csv`.
pub(super) fn ratings(rows: &[RatingRow], own: &Columns) -> io::Result<Vec<u8>> {
    let mut out = writer();
    let header = columns::RATINGS_BEFORE
        .into_iter()
        .chain(own.questions.iter().map(QuestionId::as_str))
        .chain(columns::RATINGS_AFTER)
        .chain(own.covariates.iter().map(String::as_str));
    out.write_record(header)?;
    for row in rows {
        let mut cells = vec![
            row.study.clone(),
            row.participant.to_string(),
            row.session.to_string(),
            cell(row.row),
            row.trial.to_string(),
            row.block.to_string(),
            cell(row.position),
            row.planned_position.to_string(),
            row.model.to_string(),
            row.role.as_str().to_owned(),
            row.repetition.to_string(),
            cell(row.previous_model.as_ref()),
            row.practice.to_string(),
            row.pilot.to_string(),
            row.simulated.to_string(),
            row.device_kind.as_str().to_owned(),
            row.device_id.clone(),
            row.operator.clone(),
            row.tool_version.clone(),
            row.protocol_version.to_string(),
        ];
        cells.extend(own.questions.iter().map(|q| answer(row.answers.get(q))));
        cells.extend([
            row.corrected.to_string(),
            row.declined.to_string(),
            row.remarks.clone(),
            number(row.reference_s),
            number(row.exploration_s),
            number(row.response_s),
            cell(row.strokes),
            number(row.least_energy_j),
            number(row.switches_per_s),
            cell(row.clamp_count),
            time(row.started_at),
            time(row.rated_at),
            cell(row.attempt),
            row.status.as_str().to_owned(),
            number(row.vaf),
        ]);
        let covariate = |name: &String| number(row.covariates.get(name).copied());
        cells.extend(own.covariates.iter().map(covariate));
        out.write_record(&cells)?;
    }
    bytes(out)
}

/// `attempts.csv`.
pub(super) fn attempts(rows: &[AttemptRow]) -> io::Result<Vec<u8>> {
    let mut out = writer();
    out.write_record(ATTEMPT_COLUMNS)?;
    for row in rows {
        out.write_record([
            row.participant.to_string(),
            row.session.to_string(),
            row.pilot.to_string(),
            row.simulated.to_string(),
            cell(row.trial),
            cell(row.attempt),
            cell(row.model.as_ref()),
            row.what.to_owned(),
            cell(row.question.as_ref()),
            answer(row.from.as_ref()),
            answer(row.to.as_ref()),
            row.failure.map(failure).unwrap_or_default().to_owned(),
            row.by.map(author).unwrap_or_default().to_owned(),
            row.text.clone(),
            time(Some(row.at)),
        ])?;
    }
    bytes(out)
}

/// `participants.csv`.
pub(super) fn participants(rows: &[ParticipantRow], own: &Columns) -> io::Result<Vec<u8>> {
    let mut out = writer();
    let header = columns::PARTICIPANTS
        .into_iter()
        .chain(own.forms.iter().map(QuestionId::as_str));
    out.write_record(header)?;
    for row in rows {
        let mut cells = vec![
            row.participant.to_string(),
            row.session.to_string(),
            row.state.as_str().to_owned(),
            row.reason.clone(),
            cell(row.row),
            row.pilot.to_string(),
            row.simulated.to_string(),
            row.erased.to_string(),
            cell(row.consent_version.as_ref()),
            // No session was started: no version was used.
            cell(Some(row.protocol_version).filter(|v| *v > 0)),
            row.trials_done.to_string(),
            row.trials_planned.to_string(),
            time(row.started_at),
        ];
        cells.extend(own.forms.iter().map(|q| answer(row.answers.get(q))));
        out.write_record(&cells)?;
    }
    bytes(out)
}

fn failure(failure: Failure) -> &'static str {
    match failure {
        Failure::DeviceFault => "device-fault",
        Failure::PlaybackLost => "playback-lost",
        Failure::MarkedBad => "marked-bad",
        Failure::Stopped => "stopped",
        Failure::Interrupted => "interrupted",
    }
}

fn author(author: Author) -> &'static str {
    match author {
        Author::Participant => "participant",
        Author::Experimenter => "experimenter",
    }
}
