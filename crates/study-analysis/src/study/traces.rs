//! Some playbacks, for the figure of forces.

use super::Study;
use crate::analyze::Analysis;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use study_base::text::ModelId;
use study_plan::protocol::columns::SampleColumn;
use study_session::outcome::Status;
use study_session::store::{disk, layout};

/// Largest number of samples that are read of a playback.
const MAX_SAMPLES: usize = 200_000;

/// Largest number of playbacks of a realization that are shown.
const MAX_TRACES: usize = 3;

/// Force against position during one playback.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Realization. Untrusted.
    pub model: String,
    /// Participant and trial. Untrusted.
    pub label: String,
    /// Whether the force was measured, not only commanded.
    pub measured: bool,
    /// Position in mm, force in N.
    pub points: Vec<(f64, f64)>,
}

/// Force against position in some included playbacks: the first of each realization by
/// up to three participants. Files that cannot be read are skipped; `study verify`
/// reports them.
pub(super) fn traces(study: &Study, analysis: &Analysis) -> Vec<Trace> {
    let included: BTreeSet<(&str, &str, u32)> = analysis
        .rows
        .iter()
        .filter(|r| r.excluded.is_none())
        .map(|r| (analysis.subject(r), analysis.model(r), r.repetition))
        .collect();
    let mut shown: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut wanted = Vec::new();
    for row in (study.derived.rows)
        .iter()
        .filter(|r| !r.practice && r.status == Status::Ok)
    {
        let Some(model) = row.model.as_ref().map(ModelId::as_str) else {
            continue;
        };
        let participant = row.participant.as_str();
        let own = shown.entry(model).or_default();
        let enough = own.len() >= MAX_TRACES || own.contains(participant);
        if enough || !included.contains(&(participant, model, row.repetition)) {
            continue;
        }
        let Some(attempt) = row.attempt else { continue };
        let path = layout::session(study.folder.path(), &row.participant, row.session)
            .join(layout::TELEMETRY)
            .join(layout::telemetry(row.trial, attempt, 1));
        if path.is_file() {
            own.insert(participant);
            wanted.push((row, model, path));
        }
    }
    let read = wanted.par_iter().with_max_len(1).map(|(row, model, path)| {
        let (points, measured) = trace(path)?;
        Some(Trace {
            model: (*model).to_owned(),
            label: format!("{} trial {}", row.participant, row.trial),
            measured,
            points,
        })
    });
    read.collect::<Vec<_>>().into_iter().flatten().collect()
}

/// Position (mm) and force (N) of a telemetry file, and whether the force was measured.
fn trace(path: &Path) -> Option<(Vec<(f64, f64)>, bool)> {
    let mut reader = csv::Reader::from_reader(disk::reader(path).ok()?);
    let head = reader.headers().ok()?.clone();
    let column = |column: SampleColumn| head.iter().position(|h| h == column.name());
    let x = column(SampleColumn::XMm)?;
    let command = column(SampleColumn::ForceCommandN)?;
    let measured = column(SampleColumn::ForceMeasuredN);
    let mut points = Vec::new();
    let mut all_measured = measured.is_some();
    let mut record = csv::StringRecord::new();
    while points.len() < MAX_SAMPLES && matches!(reader.read_record(&mut record), Ok(true)) {
        let number = |at: usize| record.get(at).and_then(|t| t.parse::<f64>().ok());
        let force = measured.and_then(number);
        all_measured &= force.is_some();
        if let (Some(x), Some(force)) = (number(x), force.or_else(|| number(command))) {
            points.push((x, force));
        }
    }
    (points.len() > 1).then_some((points, all_measured))
}
