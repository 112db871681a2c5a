//! Which sessions are analyzed besides those of participants.

use study_analysis::analyze::Include;

/// Sessions that are left out unless they are asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Who {
    Pilot,
    Simulated,
}

/// What the given words include.
pub(super) fn include(asked: &[Who]) -> Include {
    Include {
        pilot: asked.contains(&Who::Pilot),
        simulated: asked.contains(&Who::Simulated),
    }
}
