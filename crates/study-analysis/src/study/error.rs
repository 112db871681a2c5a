//! Why a study is not analyzed.

use crate::load::FrozenError;
use crate::preregister::{DocumentError, FILE};
use std::path::PathBuf;
use study_base::text::{BadId, ParticipantId, QuestionId, Untrusted};
use study_session::outcome::ratings::{Origin, RatingsError};
use study_session::store::StoreError;

/// Why a study is not analyzed.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The results folder cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A protocol of the results folder cannot be read.
    #[error(transparent)]
    Frozen(#[from] FrozenError),
    /// A table of ratings cannot be read.
    #[error(transparent)]
    Table(#[from] RatingsError),
    /// The question has no possible id.
    #[error(transparent)]
    Id(#[from] BadId),
    /// The question has no numbers for answers.
    #[error("there is no question `{id}` with numeric answers")]
    NotNumeric {
        /// The question.
        id: QuestionId,
        /// The questions that have, separated by commas.
        numeric: String,
    },
    /// Pilots are analyzed only on request.
    #[error("{}: holds only pilots so far", .0.display())]
    OnlyPilots(PathBuf),
    /// The frozen preregistration cannot be read.
    #[error("{}, version {version}: {FILE}: {source}", Untrusted(&.path.display().to_string()))]
    Preregistration {
        /// The study's folder.
        path: PathBuf,
        /// The version of the protocol that it was frozen with.
        version: u32,
        /// What is wrong with it.
        source: DocumentError,
    },
}

/// Why sites are not pooled.
#[derive(Debug, thiserror::Error)]
pub enum PoolError {
    /// A site cannot be read.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A table, which has no fingerprints.
    #[error("{}: a table has no fingerprints to compare", shown(.0))]
    Table(PathBuf),
    /// A results folder with several studies.
    #[error("{}: {count} studies, but a site has one", shown(.path))]
    Several {
        /// The results folder.
        path: PathBuf,
        /// Number of studies.
        count: usize,
        /// One of them.
        first: PathBuf,
    },
    /// The same folder twice.
    #[error("{}: this site is named twice", shown(.0))]
    Twice(PathBuf),
    /// Fewer than two sites.
    #[error("a pool takes two sites or more")]
    TooFew,
    /// Other stimuli or other rules.
    #[error("{first} and {other} differ in their {}: {listed}", .what.as_str())]
    Differ {
        /// The first site.
        first: String,
        /// The other one.
        other: String,
        /// What differs.
        what: Difference,
        /// The keys with both values. Untrusted.
        listed: String,
    },
    /// A session that two folders have.
    #[error("the session of {participant} is in {} and in {}", shown(&.folders[0]), shown(&.folders[1]))]
    SameSession {
        /// Whose.
        participant: ParticipantId,
        /// The folders.
        folders: [PathBuf; 2],
    },
    /// A primary question that is no rating.
    #[error(
        "{parts}: comparisons and thresholds are not pooled, and the primary question `{primary}` is theirs"
    )]
    NotPooled {
        /// The parts that are not pooled.
        parts: String,
        /// The primary question.
        primary: QuestionId,
    },
    /// A site without ratings.
    #[error("{}: no ratings yet", Untrusted(.0))]
    Empty(String),
    /// Real, pilot and simulated participants are mixed only on request.
    #[error("{} has {}, {} {}: they are not mixed unasked", .best.0, kinds(.best.1), .other.0, kinds(.other.1))]
    Mixed {
        /// A site, and whose ratings it has.
        best: (String, Origin),
        /// A site whose ratings are farther from real ones.
        other: (String, Origin),
    },
    /// Pilots are analyzed only on request.
    #[error("the sites hold only pilots so far")]
    OnlyPilots,
}

study_base::named! {
    /// What two sites must have in common.
    Difference {
        /// What is presented.
        Stimuli = "stimuli",
        /// How it is analyzed.
        Rules = "analysis rules",
    }
}

fn shown(path: &std::path::Path) -> String {
    Untrusted(&path.display().to_string()).to_string()
}

fn kinds(of: Origin) -> &'static str {
    match of {
        Origin::Real => "real participants",
        Origin::Pilot => "only pilots",
        Origin::Simulated => "only simulated participants",
    }
}
