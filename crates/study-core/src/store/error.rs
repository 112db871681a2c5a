//! Why the results folder could not be read or written.

use crate::outcome::State;
use std::io;
use std::path::{Path, PathBuf};
use study_base::text::{ParticipantId, Untrusted};

/// Why a results folder could not be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A file or folder could not be read or written.
    #[error("{}: {}", .path.display(), plain(.source))]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// There is no room for a session.
    #[error("no room for a session: {} KiB free, {} KiB needed in {}", .free / 1024, .needed.div_ceil(1024), .path.display())]
    Full {
        /// Where.
        path: PathBuf,
        /// Bytes free.
        free: u64,
        /// Bytes that a session needs at the least.
        needed: u64,
    },
    /// The folder is not a study's.
    #[error("{}: not the results of a study: it has no study.json", .path.display())]
    NoStudy {
        /// Which folder.
        path: PathBuf,
    },
    /// A later version of the program wrote this.
    #[error("{}: written by a newer version of study ({})", .path.display(), Untrusted(.found))]
    Newer {
        /// Which file.
        path: PathBuf,
        /// The format or event that is not known here.
        found: String,
    },
    /// A file is not what this program writes.
    #[error("{}: {what}", .path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The study that the folder holds has other stimuli.
    #[error("{}: the stimuli are not those of the running study `{}`", .path.display(), Untrusted(.study))]
    StimulusChanged {
        /// The study's folder.
        path: PathBuf,
        /// Its id.
        study: String,
    },
    /// Wording or analysis changed without an amendment.
    #[error("{}: {what} changed since version {version} of the protocol was frozen", .path.display())]
    NotAmended {
        /// The study's folder.
        path: PathBuf,
        /// The newest version.
        version: u32,
        /// `wording`, `analysis` or both.
        what: &'static str,
    },
    /// An amendment that changes nothing.
    #[error("{}: nothing differs from version {version} of the protocol", .path.display())]
    NothingToAmend {
        /// The study's folder.
        path: PathBuf,
        /// The newest version.
        version: u32,
    },
    /// Somebody amended the study after it was opened here.
    #[error("{}: the protocol was amended meanwhile, to version {version}", .path.display())]
    AmendedMeanwhile {
        /// The study's folder.
        path: PathBuf,
        /// The newest version.
        version: u32,
    },
    /// All trials are done.
    #[error("{participant} has finished (session {session})")]
    Finished {
        /// Who.
        participant: ParticipantId,
        /// Their last session.
        session: u32,
    },
    /// The participant's state allows no session.
    #[error("{participant} is {}: {}", .state.as_str(), Untrusted(.reason))]
    InState {
        /// Who.
        participant: ParticipantId,
        /// Their state.
        state: State,
        /// Why.
        reason: String,
    },
    /// What the participant gave was erased.
    #[error("what {participant} gave was erased; the id is not used again")]
    Erased {
        /// Who.
        participant: ParticipantId,
    },
    /// Another process has the session open.
    #[error("{participant}'s session {session} is open in another process ({})", .path.display())]
    Open {
        /// Who.
        participant: ParticipantId,
        /// Which.
        session: u32,
        /// Its folder.
        path: PathBuf,
    },
    /// Another process has kept the study locked for long.
    #[error("{}: another process keeps the study locked", .path.display())]
    Busy {
        /// The study's folder.
        path: PathBuf,
    },
    /// A pilot's id for a real session, or the like.
    #[error("{participant} is a {had} participant and cannot be a {wanted} one")]
    OtherKind {
        /// Who.
        participant: ParticipantId,
        /// What they are.
        had: &'static str,
        /// What was asked for.
        wanted: &'static str,
    },
    /// The id differs from an existing one only in upper and lower case.
    #[error("`{given}` and the existing `{existing}` differ only in upper and lower case")]
    Collides {
        /// As asked for.
        given: ParticipantId,
        /// As it is.
        existing: ParticipantId,
    },
    /// No row is free in the range of this rig.
    #[error("no row from {from} to {to} is free")]
    NoRow {
        /// First of the range.
        from: u32,
        /// Last of the range.
        to: u32,
    },
    /// Nobody of that id has taken part.
    #[error("there is no participant `{participant}`{}", .near.as_ref().map(|n| format!("; did you mean `{n}`?")).unwrap_or_default())]
    Unknown {
        /// As asked for.
        participant: ParticipantId,
        /// An id that is near.
        near: Option<ParticipantId>,
    },
    /// The tables tell of sessions that are not there; they are not written over.
    #[error("{}: the tables name {who}, whose journal is not there", .path.display())]
    Vanished {
        /// The study's folder.
        path: PathBuf,
        /// Everybody, safe to print.
        who: String,
    },
    /// The state cannot follow on the present one.
    #[error("{participant} cannot be set to {}: {why}", .state.as_str())]
    StateRefused {
        /// Who.
        participant: ParticipantId,
        /// Asked for.
        state: State,
        /// Why not.
        why: String,
    },
    /// An earlier write to this segment failed: it is not touched again.
    #[error("{}: an earlier write failed, a new segment is needed", .path.display())]
    SegmentFailed {
        /// The segment.
        path: PathBuf,
    },
    /// An event that could not be read back.
    #[error("{}: an event could not be written so that it reads back: {what}", .path.display())]
    Unstorable {
        /// The segment.
        path: PathBuf,
        /// What the reader says.
        what: String,
    },
    /// [`super::SessionFolder::journal`] was called twice.
    #[error("{}: the journal is already open", .path.display())]
    JournalTaken {
        /// The session's folder.
        path: PathBuf,
    },
    /// A file name of the protocol that leaves its folder.
    #[error("`{}` is not a path inside the protocol's folder", Untrusted(.name))]
    OutsideFolder {
        /// The name.
        name: String,
    },
}

impl StoreError {
    /// What to do next, where the message does not say it.
    pub fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Full { .. } => "free some space, then start again".to_owned(),
            Self::Newer { .. } => {
                "use the version of study that wrote it, or a later one".to_owned()
            }
            Self::StimulusChanged { .. } => {
                "changed stimuli are a new study: give the protocol another study id".to_owned()
            }
            Self::NotAmended { .. } => {
                "use `study amend RESULTS PROTOCOL --reason TEXT`, or restore the protocol"
                    .to_owned()
            }
            Self::AmendedMeanwhile { .. } => "start again with the amended protocol".to_owned(),
            Self::Finished { .. } => "each participant needs an id of their own".to_owned(),
            Self::InState { state, .. } if *state == State::NoShow => {
                "if they came after all, set the state to void first".to_owned()
            }
            Self::InState { .. } | Self::Erased { .. } => {
                "each participant needs an id of their own".to_owned()
            }
            Self::Open { .. } => "go on there, or end that process".to_owned(),
            Self::Busy { .. } => "wait for it, or end it".to_owned(),
            Self::Collides { existing, .. } => {
                format!("write `{existing}` if it is the same person")
            }
            Self::NoRow { .. } => "give this rig a larger range with --rows".to_owned(),
            Self::OtherKind { .. } => "use another id".to_owned(),
            Self::Vanished { path, .. } => format!(
                "put their folders back into sessions/ from a copy; `study verify {} --rebuild --drop-missing` takes them out of the tables for good",
                path.display()
            ),
            _ => return None,
        })
    }

    /// Whether the request was at fault, not the folder.
    pub fn is_request(&self) -> bool {
        matches!(
            self,
            Self::StimulusChanged { .. }
                | Self::NotAmended { .. }
                | Self::NothingToAmend { .. }
                | Self::Finished { .. }
                | Self::InState { .. }
                | Self::Erased { .. }
                | Self::OtherKind { .. }
                | Self::Collides { .. }
                | Self::NoRow { .. }
                | Self::Unknown { .. }
                | Self::StateRefused { .. }
                | Self::OutsideFolder { .. }
        )
    }

    /// Whether the disk is full, so that a reserve helps.
    pub fn is_full(&self) -> bool {
        match self {
            Self::Full { .. } => true,
            Self::Io { source, .. } => is_full(source),
            _ => false,
        }
    }
}

/// An error of the operating system in plain words, where there are some.
pub fn plain(error: &io::Error) -> String {
    use io::ErrorKind as K;
    let words = match error.kind() {
        K::NotFound => "there is no such file or folder",
        K::PermissionDenied => "no permission",
        K::StorageFull => "the disk is full",
        K::QuotaExceeded => "the disk quota is used up",
        K::ReadOnlyFilesystem => "the file system is read-only",
        K::IsADirectory => "it is a folder, not a file",
        K::NotADirectory => "a part of the path is no folder",
        K::FileTooLarge => "the file is larger than is allowed",
        // Another program's words for it are kept, the system's number is not.
        _ => {
            let told = error.to_string();
            return match told.split_once(" (os error ") {
                Some((words, _)) => words.to_owned(),
                None => told,
            };
        }
    };
    words.to_owned()
}

/// Whether an error of the operating system says that there is no room.
pub(super) fn is_full(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
    )
}

/// Adds the path to an error of the operating system.
pub(super) trait At<T> {
    fn at(self, path: &Path) -> Result<T, StoreError>;
}

impl<T> At<T> for io::Result<T> {
    fn at(self, path: &Path) -> Result<T, StoreError> {
        self.map_err(|source| StoreError::Io {
            path: path.to_owned(),
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_base::text::ParticipantId;

    #[cfg(unix)]
    fn io(number: i32) -> String {
        let source = io::Error::from_raw_os_error(number);
        let path = "results/x/study.json".into();
        StoreError::Io { path, source }.to_string()
    }

    #[cfg(unix)]
    #[test]
    fn an_error_of_the_system_has_words_and_no_number() {
        // errno.h of Linux: ENOENT 2, EACCES 13, ENOSPC 28, EIO 5.
        assert_eq!(
            io(2),
            "results/x/study.json: there is no such file or folder"
        );
        assert_eq!(io(13), "results/x/study.json: no permission");
        assert_eq!(io(28), "results/x/study.json: the disk is full");
        assert!(!io(5).contains("os error"), "{}", io(5));
    }

    #[test]
    fn room_is_told_in_kib_and_the_path_last() {
        let path: PathBuf = "results/x".into();
        let full = StoreError::Full {
            path: path.clone(),
            free: 92 * 1024 + 1000,
            needed: 128 * 1024,
        };
        assert_eq!(
            full.to_string(),
            "no room for a session: 92 KiB free, 128 KiB needed in results/x"
        );
        let open = StoreError::Open {
            participant: ParticipantId::new("P01").unwrap(),
            session: 1,
            path,
        };
        assert_eq!(
            open.to_string(),
            "P01's session 1 is open in another process (results/x)"
        );
    }
}
