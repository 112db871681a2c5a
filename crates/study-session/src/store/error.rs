//! Errors of the results folder.

use super::disk::{ItemKind, NotAFile};
use crate::outcome::State;
use std::io;
use std::path::{Path, PathBuf};
use study_base::text::{PartId, ParticipantId, Untrusted};

/// An error of a results folder.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A file or folder could not be read or written.
    #[error("{}: {}", .path.display(), plain(.source))]
    Io {
        /// File or folder.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The disk has too little space for a session.
    #[error("not enough disk space for a session: {} KiB free, {} KiB needed in {}", .free / 1024, .needed.div_ceil(1024), .path.display())]
    Full {
        /// The study's folder.
        path: PathBuf,
        /// Free space, bytes.
        free: u64,
        /// Minimum for a session, bytes.
        needed: u64,
    },
    /// The folder does not contain a study.
    #[error("{}: not the results of a study: it has no study.json", .path.display())]
    NoStudy {
        /// Folder.
        path: PathBuf,
    },
    /// No results folder.
    #[error("{}: {}", .path.display(), not_results(.source))]
    NoResults {
        /// What was given as one.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// A results folder without a study.
    #[error("{}: contains no results of a study", .path.display())]
    Empty {
        /// The results folder.
        path: PathBuf,
    },
    /// A results folder with several studies where one is meant.
    #[error("{}: contains {} studies: {}", .path.display(), .names.len(), listed(.names))]
    Several {
        /// The results folder.
        path: PathBuf,
        /// Names of their folders, sorted. Untrusted.
        names: Vec<String>,
    },
    /// Written by a later version of the program.
    #[error("{}: written by a newer version of study ({})", .path.display(), Untrusted(.found))]
    Newer {
        /// File.
        path: PathBuf,
        /// The unknown format or event.
        found: String,
    },
    /// A file is damaged.
    #[error("{}: {what}", .path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// Damage.
        what: String,
    },
    /// A file or a link in the place of a folder.
    #[error("{}: {found} in the place of a folder", .path.display())]
    WrongKind {
        /// Where it is.
        path: PathBuf,
        /// What it is.
        found: &'static str,
    },
    /// The mirror is no folder that can be used.
    #[error("the mirror {}: {}", .path.display(), plain(.source))]
    NoMirror {
        /// The mirror.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The mirror would contain the results or be contained in them.
    #[error("the mirror {} and the results {} are not apart", .mirror.display(), .results.display())]
    MirrorInside {
        /// The results folder.
        results: PathBuf,
        /// The mirror.
        mirror: PathBuf,
    },
    /// Both copies have something that the other does not have.
    #[error("{} and its mirror {} have each been continued without the other", .results.display(), .mirror.display())]
    MirrorDiffers {
        /// In the results folder.
        results: PathBuf,
        /// In the mirror.
        mirror: PathBuf,
    },
    /// The study in the folder has other stimuli.
    #[error("{}: the stimuli are not those of the running study `{}`", .path.display(), Untrusted(.study))]
    StimulusChanged {
        /// The study's folder.
        path: PathBuf,
        /// Study id.
        study: String,
    },
    /// Wording or analysis were changed without an amendment.
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
    /// The next session of a participant is not yet planned.
    #[error("{participant}: session {session} is planned from {} on", when(*.from))]
    TooEarly {
        /// Participant.
        participant: ParticipantId,
        /// The next session.
        session: PartId,
        /// When the gap is over.
        from: chrono::DateTime<chrono::FixedOffset>,
    },
    /// The participant took part in the search that the study confirms.
    #[error("{participant} took part in the search `{}`, which this study confirms", Untrusted(.search))]
    Searcher {
        /// Participant.
        participant: ParticipantId,
        /// The study that searched. Untrusted.
        search: String,
    },
    /// The participant belongs to another group.
    #[error("{participant} belongs to group {had}")]
    OtherGroup {
        /// Participant.
        participant: ParticipantId,
        /// The group.
        had: PartId,
    },
    /// A group that cannot be given, or none where one is needed.
    #[error("{}", group_refused(.given.as_ref(), .known, *.by_experimenter))]
    Group {
        /// The group that was given.
        given: Option<PartId>,
        /// The groups of the protocol.
        known: String,
        /// Whether the experimenter gives the groups.
        by_experimenter: bool,
    },
    /// Another process amended the study after it was opened.
    #[error("{}: the protocol was amended in the meantime, to version {version}", .path.display())]
    AmendedMeanwhile {
        /// The study's folder.
        path: PathBuf,
        /// The newest version.
        version: u32,
    },
    /// The participant has finished.
    #[error("{participant} has finished (session {session})")]
    Finished {
        /// Participant.
        participant: ParticipantId,
        /// Last session.
        session: u32,
    },
    /// The participant's state allows no session.
    #[error("{participant} is {}: {}", .state.as_str(), Untrusted(.reason))]
    InState {
        /// Participant.
        participant: ParticipantId,
        /// State.
        state: State,
        /// Reason.
        reason: String,
    },
    /// The participant's data were erased.
    #[error("the data of {participant} were erased; the id cannot be used again")]
    Erased {
        /// Participant.
        participant: ParticipantId,
    },
    /// Another process has the session open.
    #[error("{participant}'s session {session} is open in another process ({})", .path.display())]
    Open {
        /// Participant.
        participant: ParticipantId,
        /// Session.
        session: u32,
        /// The session's folder.
        path: PathBuf,
    },
    /// Another process keeps the study locked.
    #[error("{}: another process keeps the study locked", .path.display())]
    Busy {
        /// The study's folder.
        path: PathBuf,
    },
    /// The id belongs to another kind of participant.
    #[error("{participant} is a {had} participant and cannot be a {wanted} one")]
    OtherKind {
        /// Participant.
        participant: ParticipantId,
        /// Kind of the existing participant.
        had: &'static str,
        /// Kind requested.
        wanted: &'static str,
    },
    /// The id differs from an existing one only in upper and lower case.
    #[error("`{given}` and the existing `{existing}` differ only in upper and lower case")]
    Collides {
        /// Requested id.
        given: ParticipantId,
        /// Existing id.
        existing: ParticipantId,
    },
    /// A new id that begins like an option.
    #[error("`{given}` cannot be a new participant's id: it begins with `-`, like an option")]
    LikeOption {
        /// Requested id.
        given: ParticipantId,
    },
    /// A new id that is the name of a device on Windows.
    #[error("`{given}` cannot be a new participant's id: Windows keeps this name for a device")]
    WindowsDevice {
        /// Requested id.
        given: ParticipantId,
    },
    /// No row is free in the range of this rig.
    #[error("no row from {from} to {to} is free")]
    NoRow {
        /// First row of the range.
        from: u32,
        /// Last row of the range.
        to: u32,
    },
    /// There is no participant with this id.
    #[error("there is no participant `{participant}`{}", .near.as_ref().map(|n| format!("; did you mean `{n}`?")).unwrap_or_default())]
    Unknown {
        /// Requested id.
        participant: ParticipantId,
        /// A similar id.
        near: Option<ParticipantId>,
    },
    /// The tables contain sessions without a journal; they are not overwritten.
    #[error("{}: the tables contain {who}, whose journal is missing", .path.display())]
    SessionsMissing {
        /// The study's folder.
        path: PathBuf,
        /// The participants, safe to print.
        who: String,
    },
    /// The state cannot follow the present one.
    #[error("{participant} cannot be set to {}: {why}", .state.as_str())]
    StateRefused {
        /// Participant.
        participant: ParticipantId,
        /// Requested state.
        state: State,
        /// Reason.
        why: String,
    },
    /// Something cannot be corrected.
    #[error("{participant}: {why}")]
    CorrectionRefused {
        /// Participant.
        participant: ParticipantId,
        /// Reason, safe to print.
        why: String,
    },
    /// An earlier write to this segment failed; it must not be written to again.
    #[error("{}: an earlier write failed; a new segment is needed", .path.display())]
    SegmentFailed {
        /// Segment.
        path: PathBuf,
    },
    /// A record that could not be read back.
    #[error("{}: a record cannot be written so that it can be read back: {what}", .path.display())]
    Unstorable {
        /// Segment.
        path: PathBuf,
        /// Message of the reader.
        what: String,
    },
    /// [`super::SessionFolder::journal`] was called twice.
    #[error("{}: the journal is already open", .path.display())]
    JournalTaken {
        /// The session's folder.
        path: PathBuf,
    },
    /// A file of the protocol outside its folder.
    #[error("`{}` is not a path inside the protocol's folder", Untrusted(.name))]
    OutsideFolder {
        /// File name.
        name: String,
    },
}

/// A time for people.
pub fn when(at: chrono::DateTime<chrono::FixedOffset>) -> String {
    at.format("%Y-%m-%d %H:%M").to_string()
}

/// The first names, which may have any characters.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 8;
    let shown: Vec<String> = (names.iter().take(SHOWN))
        .map(|name| Untrusted(name).to_string())
        .collect();
    let more = if names.len() > SHOWN { ", …" } else { "" };
    shown.join(", ") + more
}

fn not_results(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotADirectory => "a file, not a results folder".to_owned(),
        _ => plain(error),
    }
}

fn group_refused(given: Option<&PartId>, known: &str, by_experimenter: bool) -> String {
    match given {
        None => format!("a new participant needs one of the groups {known}"),
        Some(given) if by_experimenter => {
            format!("there is no group {given}; the groups are {known}")
        }
        Some(_) if known.is_empty() => "the study has no groups".to_owned(),
        Some(_) => "groups follow from the row in this study".to_owned(),
    }
}

impl StoreError {
    /// What to do next, if the message does not say it.
    pub fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Full { .. } => "free some space, then start again".to_owned(),
            Self::Empty { .. } => {
                "RESULTS is a results folder, or the folder of one study in it".to_owned()
            }
            Self::Several { .. } => "give the folder of one of them".to_owned(),
            Self::Newer { .. } => {
                "use the version of study that wrote it, or a later one".to_owned()
            }
            Self::WrongKind { found, .. } if *found == ItemKind::Link.as_str() => {
                "replace the link by the folder that it leads to".to_owned()
            }
            Self::WrongKind { .. } => "move it elsewhere".to_owned(),
            Self::Io { source, .. } => match source.get_ref()?.downcast_ref()? {
                NotAFile(ItemKind::Link) => "replace the link by the file that it leads to",
                NotAFile(_) => "move it elsewhere and restore the file from a copy",
            }
            .to_owned(),
            Self::NoMirror { .. } => {
                "connect the disk, or create the folder; nothing is mirrored into a folder that does not exist".to_owned()
            }
            Self::MirrorInside { .. } => {
                "the mirror must be a folder of its own, on another disk".to_owned()
            }
            Self::MirrorDiffers { .. } => {
                "compare them with `study verify RESULTS --against MIRROR`, move one of them elsewhere, then start again".to_owned()
            }
            Self::StimulusChanged { .. } => {
                "changed stimuli are a new study: give the protocol another study id".to_owned()
            }
            Self::NotAmended { .. } => {
                "use `study amend RESULTS PROTOCOL --reason TEXT`, or restore the protocol"
                    .to_owned()
            }
            Self::AmendedMeanwhile { .. } => "start again with the amended protocol".to_owned(),
            Self::TooEarly { .. } => "the participant can come again then; the gap is in the protocol, [[sessions]]".to_owned(),
            Self::Searcher { .. } => {
                "a search is confirmed by people who did not choose in it; if this is somebody else, give them an id of their own".to_owned()
            }
            Self::OtherGroup { .. } => "leave out --group: a participant stays in one group".to_owned(),
            Self::Group { by_experimenter: true, .. } => "say which with --group".to_owned(),
            Self::Group { .. } => "leave out --group".to_owned(),
            Self::Finished { .. } => "use a new id for each participant".to_owned(),
            Self::InState { state, .. } if *state == State::NoShow => {
                "if they came after all, set the state to void first".to_owned()
            }
            Self::InState { .. } | Self::Erased { .. } => {
                "use a new id for each participant".to_owned()
            }
            Self::Open { .. } => "continue there, or end that process".to_owned(),
            Self::Busy { .. } => "wait for that process, or end it".to_owned(),
            Self::Collides { existing, .. } => {
                format!("use `{existing}` if it is the same person")
            }
            Self::LikeOption { .. } | Self::WindowsDevice { .. } => "use a pseudonym, such as P01".to_owned(),
            Self::NoRow { .. } => "give this rig a larger range with --rows".to_owned(),
            Self::OtherKind { .. } => "use another id".to_owned(),
            Self::SessionsMissing { path, .. } => format!(
                "restore their folders in sessions/ from a copy, or remove them from the tables with `study verify {} --rebuild --drop-missing`",
                path.display()
            ),
            _ => return None,
        })
    }

    /// Whether the request is at fault and not the folder.
    pub fn is_request(&self) -> bool {
        matches!(
            self,
            Self::StimulusChanged { .. }
                | Self::Several { .. }
                | Self::NotAmended { .. }
                | Self::NoMirror { .. }
                | Self::MirrorInside { .. }
                | Self::NothingToAmend { .. }
                | Self::Finished { .. }
                | Self::InState { .. }
                | Self::Erased { .. }
                | Self::OtherKind { .. }
                | Self::Collides { .. }
                | Self::LikeOption { .. }
                | Self::WindowsDevice { .. }
                | Self::NoRow { .. }
                | Self::TooEarly { .. }
                | Self::OtherGroup { .. }
                | Self::Searcher { .. }
                | Self::Group { .. }
                | Self::Unknown { .. }
                | Self::StateRefused { .. }
                | Self::CorrectionRefused { .. }
                | Self::OutsideFolder { .. }
        )
    }

    /// Whether the disk is full.
    pub fn is_full(&self) -> bool {
        match self {
            Self::Full { .. } => true,
            Self::Io { source, .. } => is_full(source),
            _ => false,
        }
    }
}

/// The message of an error of the operating system, in plain words where possible.
pub fn plain(error: &io::Error) -> String {
    use io::ErrorKind as K;
    let words = match error.kind() {
        K::NotFound => "there is no such file or folder",
        K::PermissionDenied => "no permission",
        K::StorageFull => "the disk is full",
        K::QuotaExceeded => "the disk quota is used up",
        K::ReadOnlyFilesystem => "the file system is read-only",
        K::IsADirectory => "it is a folder, not a file",
        K::NotADirectory => "part of the path is not a folder",
        K::FileTooLarge => "the file is larger than allowed",
        // The message of the system without its error number.
        _ => {
            let message = error.to_string();
            return match message.split_once(" (os error ") {
                Some((words, _)) => words.to_owned(),
                None => message,
            };
        }
    };
    words.to_owned()
}

/// Whether an error of the operating system says that the disk is full.
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
    fn an_error_of_the_system_is_shown_without_its_number() {
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
    fn the_message_gives_free_space_in_kib_and_the_path_last() {
        let path: PathBuf = "results/x".into();
        let full = StoreError::Full {
            path: path.clone(),
            free: 92 * 1024 + 1000,
            needed: 128 * 1024,
        };
        assert_eq!(
            full.to_string(),
            "not enough disk space for a session: 92 KiB free, 128 KiB needed in results/x"
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
