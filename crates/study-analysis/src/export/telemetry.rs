//! Telemetry of the exported trials, file by file.

use super::table::{Field, Type};
use super::{ExportError, Job};
use chrono::{DateTime, FixedOffset};
use std::borrow::Cow;
use study_base::text::ParticipantId;
use study_plan::protocol::columns::{IntervalColumn, RatingColumn, SampleColumn};

/// A telemetry file that a journal names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recorded {
    /// Participant, as in the results folder.
    pub participant: ParticipantId,
    /// Session.
    pub session: u32,
    /// Trial.
    pub trial: u32,
    /// Attempt.
    pub attempt: u32,
    /// Interval, if the trial has several.
    pub interval: Option<u32>,
    /// Name of the file.
    pub file: String,
    /// When the device confirmed the start.
    pub started_at: Option<DateTime<FixedOffset>>,
}

/// The samples of a playback, as text.
pub(super) struct Samples {
    pub(super) rows: Vec<Vec<String>>,
}

impl Samples {
    /// A cell as a number.
    fn number(&self, row: usize) -> Option<f64> {
        self.rows.get(row)?.first()?.parse().ok()
    }

    /// Samples per second, from the median of the steps; and whether every stamp is
    /// within half a step of an even clock.
    pub(super) fn rate(&self) -> Option<(f64, bool)> {
        let times: Vec<f64> = (0..self.rows.len()).map_while(|i| self.number(i)).collect();
        let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() || times.len() < self.rows.len() {
            return None;
        }
        steps.sort_by(f64::total_cmp);
        let step = steps[steps.len() / 2];
        if !(step.is_finite() && step > 0.0) {
            return None;
        }
        // Stamps are rounded: to the nearest tenth of a sample per second.
        let rate = (10.0 / step).round() / 10.0;
        let even = |(i, t): (usize, &f64)| (t - times[0] - i as f64 / rate).abs() < 0.5 / rate;
        Some((rate, times.iter().enumerate().all(even)))
    }

    /// The stamp of the first sample, s.
    pub(super) fn first(&self) -> f64 {
        self.number(0).unwrap_or(0.0)
    }
}

/// The files of the exported trials: of each the attempt that counts.
pub(super) fn recorded<'a>(job: &Job<'a>) -> Vec<&'a Recorded> {
    let counts = |r: &&Recorded| {
        let id = job.selected.ids.get(&r.participant);
        job.selected.rows.iter().any(|row| {
            Some(&row.participant) == id
                && (row.session, row.trial, row.attempt) == (r.session, r.trial, Some(r.attempt))
        })
    };
    job.source.telemetry.iter().filter(counts).collect()
}

/// Reads a file; a device's NaN is missing.
pub(super) fn samples(job: &mut Job<'_>, recorded: &Recorded) -> Result<Samples, ExportError> {
    let bytes = (job.read)(recorded)?;
    let failed = |why: String| ExportError::Telemetry {
        file: recorded.file.clone(),
        why,
    };
    let mut reader = csv::Reader::from_reader(&bytes[..]);
    let wanted: Vec<&str> = SampleColumn::ALL.iter().map(|c| c.name()).collect();
    let head = reader.headers().map_err(|e| failed(e.to_string()))?;
    if head != wanted {
        return Err(failed("its columns are others".to_owned()));
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        // A crash can end a file inside a line.
        let Ok(record) = record else { break };
        let cell = |text: &str| match text.parse::<f64>() {
            Ok(x) if x.is_finite() => text.to_owned(),
            _ => String::new(),
        };
        rows.push(record.iter().map(cell).collect());
    }
    Ok(Samples { rows })
}

/// The columns of the telemetry of a session.
pub(super) fn fields() -> Vec<Field> {
    let mut fields = vec![
        Field::new(Type::Text, "participant", "pseudonym"),
        Field::new(
            Type::Whole,
            "session",
            RatingColumn::Session.column().meaning,
        ),
        Field::new(Type::Whole, "trial", RatingColumn::Trial.column().meaning),
        Field::new(
            Type::Whole,
            "attempt",
            RatingColumn::Attempt.column().meaning,
        ),
        Field::new(
            Type::Whole,
            "interval",
            IntervalColumn::Interval.column().meaning,
        ),
    ];
    for column in SampleColumn::ALL {
        let declared = column.column();
        let mut field = Field::new(Type::Number, declared.name, declared.meaning);
        field.unit = declared.unit.map(str::to_owned);
        field.empty = Some(
            declared
                .empty
                .unwrap_or("the device reported no number")
                .to_owned(),
        );
        fields.push(field);
    }
    fields
}

/// A CSV of the telemetry of one session, with participant and session.
pub(super) struct SessionFile {
    pub(super) participant: ParticipantId,
    pub(super) session: u32,
    pub(super) bytes: Vec<u8>,
}

/// Hands over a CSV for each session with telemetry.
pub(super) fn by_session(
    job: &mut Job<'_>,
    mut take: impl FnMut(&mut Job<'_>, SessionFile) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    if !job.options.telemetry {
        return Ok(());
    }
    let all = recorded(job);
    let dialect = job.options.dialect;
    let local = |cell: String| match dialect.decimal_comma {
        true => cell.replace('.', ","),
        false => cell,
    };
    let head: Vec<Cow<'_, str>> = fields().into_iter().map(|f| f.name.into()).collect();
    for session in all.chunk_by(|a, b| (&a.participant, a.session) == (&b.participant, b.session)) {
        let Some(id) = job.selected.ids.get(&session[0].participant).cloned() else {
            continue;
        };
        let mut records = vec![head.clone()];
        for recorded in session {
            let place = [
                id.to_string(),
                recorded.session.to_string(),
                recorded.trial.to_string(),
                recorded.attempt.to_string(),
                recorded.interval.unwrap_or(1).to_string(),
            ];
            for row in samples(job, recorded)?.rows {
                records.push(
                    place
                        .iter()
                        .cloned()
                        .chain(row.into_iter().map(local))
                        .map(Cow::Owned)
                        .collect(),
                );
            }
        }
        let file = SessionFile {
            participant: id,
            session: session[0].session,
            bytes: super::delimited::lines(records, &dialect),
        };
        take(job, file)?;
    }
    Ok(())
}

/// A gzip file without name and time.
pub(super) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];
    out.extend(miniz_oxide::deflate::compress_to_vec(bytes, 6));
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(bytes);
    out.extend(sum.to_le_bytes());
    out.extend((bytes.len() as u32).to_le_bytes());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(times: &[f64]) -> Samples {
        let rows = times.iter().map(|t| vec![t.to_string()]).collect();
        Samples { rows }
    }

    #[test]
    fn the_rate_is_that_of_the_stamps() {
        let even: Vec<f64> = (0..50).map(|i| f64::from(i) * 0.001).collect();
        assert_eq!(at(&even).rate(), Some((1000.0, true)));
        let mut gap = even.clone();
        gap[20..].iter_mut().for_each(|t| *t += 0.01);
        assert_eq!(at(&gap).rate(), Some((1000.0, false)));
        assert_eq!(at(&[0.0]).rate(), None);
        assert_eq!(at(&[1.0, 1.0]).rate(), None);
    }
}
