//! A study beside the preregistration that was frozen with its protocol.

use super::{Study, StudyError};
use crate::analyze::psychophysics::PartAnalysis;
use crate::analyze::{Analysis, Warning};
use crate::load;
use crate::preregister::{Comparison, Conduct, Declared, FILE, Preregistration, compare, deciding};
use study_plan::protocol::Seat;
use study_session::outcome::{ParticipantRow, State};
use study_session::store::SessionData;

/// What an analysis says of its own conduct.
struct Done<'a> {
    question: &'a str,
    tests: Vec<Declared>,
    finished: Option<usize>,
}

/// The document of the earliest version that has one, with the number of this version.
fn document(study: &Study) -> Result<Option<(u32, Preregistration)>, StudyError> {
    let folder = &study.folder;
    let versions = folder.manifest().versions.iter();
    for version in versions.filter(|v| v.files.contains_key(FILE)) {
        let version = version.version;
        let older;
        let files = if version == folder.version() {
            &study.loaded.files
        } else {
            older = load::frozen_version(folder, version)?;
            &older.files
        };
        let Some((_, bytes)) = files.iter().find(|(name, _)| name == FILE) else {
            continue;
        };
        return match Preregistration::read(bytes) {
            Ok(document) => Ok(Some((version, document))),
            Err(source) => Err(StudyError::Preregistration {
                path: folder.path().to_owned(),
                version,
                source,
            }),
        };
    }
    Ok(None)
}

/// Whether a study has a document.
pub(super) fn has_document(study: &Study) -> Result<bool, StudyError> {
    Ok(document(study)?.is_some())
}

/// The document, compared with what was done.
fn comparison(study: &Study, done: &Done<'_>) -> Result<Option<Comparison>, StudyError> {
    let Some((version, document)) = document(study)? else {
        return Ok(None);
    };
    let newest = &study.loaded;
    let real = |s: &&SessionData| matches!(s.seat, Some(Seat::Row(_)));
    let began = (study.sessions.iter().filter(real))
        .filter_map(|s| s.history.started_at())
        .map(|at| at.wall);
    let conduct = Conduct {
        protocol: &newest.parts,
        question: done.question,
        tests: &done.tests,
        finished: done.finished,
        planned: newest.protocol.design.participants,
        first_session: began.min(),
        frozen_with: version,
    };
    Ok(Some(compare(&document, &conduct)))
}

/// Compares an analysis of ratings, which warns of deviations.
pub(super) fn add(
    study: &Study,
    analysis: &mut Analysis,
) -> Result<Option<Comparison>, StudyError> {
    let done = Done {
        question: &analysis.question,
        tests: deciding(Some(analysis), &analysis.parts),
        finished: Some(analysis.counts.finished).filter(|_| analysis.counts.real() > 0),
    };
    let found = comparison(study, &done)?;
    let deviates = found.as_ref().filter(|c| !c.deviations.is_empty());
    analysis.warnings.extend(deviates.map(|found| Warning {
        code: "preregistration",
        text: format!(
            "the study deviates from its preregistration of {}: {}",
            found.date,
            found.deviations.join("; ")
        ),
    }));
    Ok(found)
}

/// Compares a study whose primary question is no rating.
pub(super) fn of_parts(
    study: &Study,
    parts: &[PartAnalysis],
) -> Result<Option<Comparison>, StudyError> {
    let participants = &study.derived.participants;
    let real = |p: &&ParticipantRow| !p.pilot && !p.simulated;
    let finished = participants.iter().filter(real);
    let finished = finished.filter(|p| p.state == State::Done).count();
    let done = Done {
        question: study.loaded.protocol.analysis.primary.as_str(),
        tests: deciding(None, parts),
        finished: Some(finished).filter(|_| participants.iter().any(|p| real(&p))),
    };
    comparison(study, &done)
}
