//! Outcomes from the telemetry of a results folder.

use super::Study;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use study_base::text::ParticipantId;
use study_plan::protocol::columns::SampleColumn;
use study_plan::protocol::{Measure, OutcomeRules, Telemetry};
use study_session::outcome::ratings::Motions;
use study_session::outcome::{Event, Sample, motion};
use study_session::store::{disk, layout};

/// Most samples that are read of a playback: longer ones were not measured.
const MAX_SAMPLES: usize = 2_000_000;

/// Participant, session, trial and attempt.
type Attempt<'a> = (&'a ParticipantId, u32, u32, u32);

/// What was measured of the motion in each trial, by the place of its row. Files that cannot be read are left
/// out: what they would tell was not measured, and `study verify` reports them.
pub(super) fn measured(study: &Study, outcomes: &[OutcomeRules]) -> Motions {
    let wanted: Vec<Telemetry> = (outcomes.iter())
        .filter_map(|outcome| match &outcome.measure {
            // Strokes are counted by the device.
            Measure::Telemetry(Telemetry::Strokes)
            | Measure::Clock(_)
            | Measure::Answers(_)
            | Measure::Questionnaire(_)
            | Measure::Device(_) => None,
            Measure::Telemetry(what) => Some(*what),
        })
        .collect();
    if wanted.is_empty() {
        return Motions::new();
    }
    let files = files(study);
    let rows: Vec<(usize, &Vec<PathBuf>)> = (study.derived.rows.iter().enumerate())
        .filter(|(_, row)| !row.practice && row.track.is_none())
        .filter_map(|(at, row)| {
            let attempt = (&row.participant, row.session, row.trial, row.attempt?);
            Some((at, files.get(&attempt)?))
        })
        .collect();
    let of_row = |(at, files): &(usize, &Vec<PathBuf>)| {
        let playbacks: Option<Vec<Vec<Sample>>> = files.iter().map(|file| samples(file)).collect();
        let playbacks = playbacks.unwrap_or_default();
        let measured = wanted
            .iter()
            .filter_map(|what| Some((*what, motion::outcome(&playbacks, *what)?)));
        (*at, measured.collect())
    };
    rows.par_iter().with_max_len(1).map(of_row).collect()
}

/// The telemetry of each attempt, one file for each playback, as the journals name them.
fn files(study: &Study) -> BTreeMap<Attempt<'_>, Vec<PathBuf>> {
    let mut files: BTreeMap<Attempt<'_>, Vec<PathBuf>> = BTreeMap::new();
    for session in &study.sessions {
        for entry in &session.entries {
            let Event::PlaybackEnded {
                trial,
                attempt,
                telemetry,
                ..
            } = &entry.event
            else {
                continue;
            };
            let name = match telemetry {
                // A name with a folder leads out of the results; `study verify` refuses it.
                Some(file) if file.file.contains(['/', '\\', '\0']) => continue,
                Some(file) => file.file.clone(),
                // Journals of earlier releases do not name it.
                None => layout::telemetry(*trial, *attempt, 1),
            };
            let key = (&session.participant, session.session, *trial, *attempt);
            let folder = session.path.join(layout::TELEMETRY);
            let all = files.entry(key).or_default();
            all.push(folder.join(name));
        }
    }
    files
}

/// The samples of a telemetry file; `None` if it is none, or too long.
pub fn samples(path: &Path) -> Option<Vec<Sample>> {
    let mut reader = csv::Reader::from_reader(disk::reader(path).ok()?);
    let head = reader.headers().ok()?.clone();
    let place = |column: SampleColumn| head.iter().position(|h| h == column.name());
    let [t_s, x_mm, v_mm_s, command] = [
        SampleColumn::TS,
        SampleColumn::XMm,
        SampleColumn::VMmS,
        SampleColumn::ForceCommandN,
    ]
    .map(place);
    let [t_s, x_mm, v_mm_s, command] = [t_s?, x_mm?, v_mm_s?, command?];
    let measured = place(SampleColumn::ForceMeasuredN);
    let mut found = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).ok()? {
        let number = |at: usize| record.get(at).and_then(|t| t.parse::<f64>().ok());
        found.push(Sample {
            t_s: number(t_s)?,
            x_mm: number(x_mm)?,
            v_mm_s: number(v_mm_s)?,
            force_command_n: number(command)?,
            force_measured_n: measured.and_then(number),
        });
        if found.len() > MAX_SAMPLES {
            return None;
        }
    }
    Some(found)
}
