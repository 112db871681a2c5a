//! Comparing a study with the preregistration that was frozen with its protocol.

use super::super::load::Loaded;
use super::super::{Failure, study_folder};
use super::Analysed;
use crate::report::comparison::sentence;
use study_base::text::Untrusted;
use study_core::analyze::Warning;
use study_core::analyze::psychophysics::PartAnalysis;
use study_core::outcome::{ParticipantRow, State};
use study_core::preregister::{
    Comparison, Conduct, Declared, FILE, Preregistration, compare, deciding,
};
use study_core::protocol::Seat;
use study_core::store::{SessionData, StudyFolder};

/// What an analysis says of its own conduct.
struct Done<'a> {
    question: &'a str,
    tests: Vec<Declared>,
    finished: Option<usize>,
}

/// The document of the earliest version that has one, compared with what was done.
fn comparison(
    study: &StudyFolder,
    sessions: &[SessionData],
    newest: &Loaded,
    done: &Done<'_>,
) -> Result<Option<Comparison>, Failure> {
    for version in &study.manifest().versions {
        if !version.files.contains_key(FILE) {
            continue;
        }
        let older;
        let files = if version.version == study.version() {
            &newest.files
        } else {
            older = study_folder::frozen_version(study, version.version)?;
            &older.files
        };
        let Some((_, bytes)) = files.iter().find(|(name, _)| name == FILE) else {
            continue;
        };
        let document = Preregistration::read(bytes).map_err(|e| {
            let path = study.path().display().to_string();
            Failure::results(format!(
                "{}, version {}: {FILE}: {e}",
                Untrusted(&path),
                version.version
            ))
            .hint("`study verify` says whether it was changed since the study began")
        })?;
        let real = |s: &&SessionData| matches!(s.seat, Some(Seat::Row(_)));
        let began = (sessions.iter().filter(real))
            .filter_map(|s| s.history.started_at())
            .map(|at| at.wall);
        return Ok(Some(compare(
            &document,
            &Conduct {
                protocol: &newest.parts,
                question: done.question,
                tests: &done.tests,
                finished: done.finished,
                planned: newest.protocol.design.participants,
                first_session: began.min(),
                frozen_with: version.version,
            },
        )));
    }
    Ok(None)
}

/// Adds the comparison to an analysis and its report.
pub(super) fn add(
    study: &StudyFolder,
    sessions: &[SessionData],
    newest: &Loaded,
    to: &mut Analysed,
) -> Result<(), Failure> {
    let analysis = &to.analysis;
    let done = Done {
        question: &analysis.question,
        tests: deciding(Some(analysis), &analysis.parts),
        finished: Some(analysis.counts.finished).filter(|_| analysis.counts.real() > 0),
    };
    let Some(found) = comparison(study, sessions, newest, &done)? else {
        return Ok(());
    };
    if !found.deviations.is_empty() {
        to.analysis.warnings.push(Warning {
            code: "preregistration",
            text: format!(
                "the study deviates from its preregistration of {}: {}",
                found.date,
                found.deviations.join("; ")
            ),
        });
    }
    to.details.conduct.push(sentence(&found));
    to.source.preregistration = Some(found);
    Ok(())
}

/// The comparison of a study whose primary question is no rating.
pub(super) fn of_parts(
    study: &StudyFolder,
    sessions: &[SessionData],
    newest: &Loaded,
    participants: &[ParticipantRow],
    parts: &[PartAnalysis],
) -> Result<Option<Comparison>, Failure> {
    let real = |p: &&ParticipantRow| !p.pilot && !p.simulated;
    let finished = participants.iter().filter(real);
    let finished = finished.filter(|p| p.state == State::Done).count();
    let done = Done {
        question: newest.protocol.analysis.primary.as_str(),
        tests: deciding(None, parts),
        finished: Some(finished).filter(|_| participants.iter().any(|p| real(&p))),
    };
    comparison(study, sessions, newest, &done)
}
