//! Comparing a study with the preregistration that was frozen with its protocol.

use super::super::load::Loaded;
use super::super::{Failure, study_folder};
use super::Analysed;
use crate::report::comparison::sentence;
use study_base::text::Untrusted;
use study_core::analyze::{Analysis, Warning};
use study_core::preregister::{Comparison, Conduct, FILE, Preregistration, compare};
use study_core::protocol::Seat;
use study_core::store::{SessionData, StudyFolder};

/// The document of the earliest version that has one, compared with what was done.
fn comparison(
    study: &StudyFolder,
    sessions: &[SessionData],
    newest: &Loaded,
    analysis: &Analysis,
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
                analysis,
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
    let Some(found) = comparison(study, sessions, newest, &to.analysis)? else {
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
