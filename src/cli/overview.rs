//! What a study has come to at one moment, without an order, an answer, a score or a realization:
//! shared by `study status`, `study desk` and the desk of a session. Only reads.

use super::{Failure, study_folder};
use crate::tui::desk::is_almost_full;
use chrono::{DateTime, FixedOffset};
use serde::Serialize;
use std::path::Path;
use study_analysis::load;
use study_base::text::{PartId, ParticipantId};
use study_plan::protocol::{Assign, Groups, Protocol};
use study_session::outcome::{ParticipantRow, State};
use study_session::store::disk::{Disk as _, RealDisk};
use study_session::store::{
    self, Due, Plan, SessionData, StudyFolder, comes_again, held_rows, layout, next_row,
    participants,
};

/// Free rows that are listed.
const ROWS_LISTED: usize = 20;

/// One study at one moment. The fields are those of `study-desk/1`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Overview {
    /// Identifier of the study.
    pub(super) study: String,
    /// Its folder.
    pub(super) folder: String,
    /// Newest version of its protocol.
    pub(super) protocol_version: u32,
    /// When this was read.
    pub(super) read_at: DateTime<FixedOffset>,
    /// Participants that the protocol plans; `None` if it cannot be read.
    pub(super) planned: Option<u32>,
    /// Sessions that it plans for each of them; `None` if it cannot be read.
    pub(super) sessions_each: Option<usize>,
    /// The participants, by id.
    pub(super) participants: Vec<Person>,
    /// The rows of the schedule.
    pub(super) rows: Rows,
    /// The groups that the experimenter gives; none if the protocol has none.
    pub(super) groups: Vec<Group>,
    /// When somebody last took part.
    pub(super) last_activity: Option<DateTime<FixedOffset>>,
    /// Disk and mirror.
    pub(super) storage: Storage,
    /// Damage of journals and frozen protocols; one sentence each.
    pub(super) warnings: Vec<String>,
}

/// A participant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Person {
    /// Pseudonym.
    pub(super) participant: ParticipantId,
    /// Whether the data are those of a participant of the study.
    pub(super) kind: Reality,
    /// Row of the schedule.
    pub(super) row: Option<u32>,
    /// Group, if the experimenter gave it.
    pub(super) group: Option<PartId>,
    /// State of the last session.
    pub(super) state: State,
    /// Whether a program has that session open.
    pub(super) running: bool,
    /// Whether the data were erased.
    pub(super) erased: bool,
    /// Number of that session, from 1.
    pub(super) session: u32,
    /// Finished sessions.
    pub(super) sessions_done: usize,
    /// Trials of the last session that are done, without practice.
    pub(super) trials_done: u32,
    /// Its trials; `None` where their number depends on the answers, and if nobody knows it.
    pub(super) trials_planned: Option<u32>,
    /// When they last took part.
    pub(super) last_activity: Option<DateTime<FixedOffset>>,
    /// Why they are in this state, as the experimenter typed it; may be empty.
    pub(super) reason: String,
    /// The session for which they come again.
    pub(super) next: Option<Coming>,
}

/// Whether data are those of a participant of the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Reality {
    /// They are.
    Real,
    /// Somebody tried the study out.
    Pilot,
    /// Nobody took part.
    Simulated,
}

/// A session for which a participant comes again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Coming {
    /// Its identifier.
    pub(super) session: PartId,
    /// Whether it is due.
    #[serde(serialize_with = "word")]
    pub(super) due: Due,
    /// The earliest time.
    pub(super) from: DateTime<FixedOffset>,
    /// The latest one; `None` if no longest gap is planned.
    pub(super) until: Option<DateTime<FixedOffset>>,
}

/// The rows of the schedule.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Rows {
    /// How many participants keep.
    pub(super) kept: usize,
    /// The one that the next participant gets.
    pub(super) next: Option<u32>,
    /// Free ones below the highest that is kept: of participants who left. At most 20.
    pub(super) freed: Vec<u32>,
    /// Kept by more than one participant.
    pub(super) twice: Vec<u32>,
    /// Beyond the planned number of participants.
    pub(super) beyond: Vec<u32>,
}

/// A group.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Group {
    /// Its identifier.
    pub(super) group: PartId,
    /// Its real participants who have finished or can still finish.
    pub(super) participants: usize,
}

/// Disk and mirror.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Storage {
    /// Bytes that can still be written; `None` if the system does not say.
    pub(super) free_bytes: Option<u64>,
    /// Whether that is little.
    pub(super) almost_full: bool,
    /// The mirror; `None` if none is known.
    pub(super) mirror: Option<Mirror>,
}

/// A copy on a second disk.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Mirror {
    /// Folder of the study in it.
    pub(super) folder: String,
    /// How it is.
    pub(super) state: Copied,
    /// The sessions whose last record differs, such as `P03/1`; or why the copy cannot be read.
    pub(super) differs: Vec<String>,
}

/// How a copy is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Copied {
    /// The last record of every session is the same.
    InStep,
    /// That of a session is not.
    Apart,
    /// There is no copy.
    Missing,
    /// It cannot be read.
    Unreadable,
}

fn word<S: serde::Serializer>(due: &Due, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(due.as_str())
}

impl Reality {
    /// That of a participant.
    pub(super) fn of(row: &ParticipantRow) -> Self {
        match (row.pilot, row.simulated) {
            (_, true) => Self::Simulated,
            (true, false) => Self::Pilot,
            (false, false) => Self::Real,
        }
    }
}

/// Every study of a results folder, now; and the failure that is due after everything was shown,
/// if acknowledged records are missing.
///
/// # Errors
/// [`Failure`] if there is no study, or one cannot be read.
pub(super) fn of_results(
    results: &Path,
    mirror: Option<&Path>,
) -> Result<(Vec<Overview>, Result<(), Failure>), Failure> {
    let now = chrono::Local::now().fixed_offset();
    let (mut all, mut whole) = (Vec::new(), Ok(()));
    for study in store::studies(results)? {
        let sessions = study.sessions()?;
        all.push(of_study(&study, &sessions, mirror, now)?);
        whole = whole.and(study_folder::whole(&study, &sessions));
    }
    Ok((all, whole))
}

/// A study with these sessions at a moment. `mirror` is a folder as for `study run --mirror`.
///
/// # Errors
/// [`Failure`] if its folder cannot be read.
pub(super) fn of_study(
    study: &StudyFolder,
    sessions: &[SessionData],
    mirror: Option<&Path>,
    now: DateTime<FixedOffset>,
) -> Result<Overview, Failure> {
    // A damaged protocol is among the warnings.
    let loaded = load::frozen(study).ok();
    let warnings = load::damage(study, sessions, loaded.as_ref())?;
    let protocol = loaded.as_ref().map(|loaded| &loaded.protocol);
    let planned = protocol.map(|p| p.design.participants);
    let rows = participants(sessions);
    let people: Vec<Person> = (rows.iter())
        .map(|row| {
            let own = own(sessions, &row.participant);
            person(row, &own, protocol, is_running(study, sessions, row), now)
        })
        .collect();
    let groups = protocol.and_then(given_groups);
    let groups = groups.iter().flat_map(|groups| &groups.list);
    let stays = |p: &&Person| p.kind == Reality::Real && p.state.keeps_row();
    let groups: Vec<Group> = groups
        .map(|group| Group {
            group: group.id.clone(),
            participants: (people.iter().filter(stays))
                .filter(|p| p.group.as_ref() == Some(&group.id))
                .count(),
        })
        .collect();
    Ok(Overview {
        study: study.manifest().study.clone(),
        folder: study.path().display().to_string(),
        protocol_version: study.version(),
        read_at: now,
        planned,
        sessions_each: protocol.map(|p| p.sessions.len().max(1)),
        last_activity: people.iter().filter_map(|p| p.last_activity).max(),
        participants: people,
        rows: kept(sessions, planned),
        groups,
        storage: storage(study, mirror),
        warnings,
    })
}

/// The groups of a protocol, if the experimenter says who belongs to which. Where the row decides, a
/// group can tell which realizations somebody feels, and so can their numbers when somebody begins.
fn given_groups(protocol: &Protocol) -> Option<&Groups> {
    let groups = protocol.groups.as_ref();
    groups.filter(|groups| groups.assign == Assign::Given)
}

fn own<'a>(sessions: &'a [SessionData], id: &ParticipantId) -> Vec<&'a SessionData> {
    sessions.iter().filter(|s| s.participant == *id).collect()
}

fn person(
    row: &ParticipantRow,
    own: &[&SessionData],
    protocol: Option<&Protocol>,
    running: bool,
    now: DateTime<FixedOffset>,
) -> Person {
    let last = own.iter().find(|s| s.session == row.session);
    let start = last.and_then(|s| s.history.start());
    // How early a track ends tells how somebody answered.
    let depends = match (start, protocol) {
        (Some(start), Some(protocol)) => protocol.of(&start.assigned).is_adaptive(),
        (None, _) => false,
        (Some(_), None) => true,
    };
    // Whoever is here comes for no other session, also before the first page is left.
    let next = protocol.filter(|_| !running).and_then(|protocol| {
        let again = comes_again(own, &Plan::of(protocol, None, now))?;
        Some(Coming {
            due: again.due(now),
            session: again.session,
            from: again.from,
            until: again.until,
        })
    });
    let active = own.iter().filter_map(|s| s.history.last_activity);
    Person {
        participant: row.participant.clone(),
        kind: Reality::of(row),
        row: row.row,
        group: (row.group.clone()).filter(|_| protocol.and_then(given_groups).is_some()),
        state: row.state,
        running,
        erased: row.erased,
        session: row.session,
        sessions_done: own.iter().filter(|s| s.is_done()).count(),
        trials_done: row.trials_done,
        trials_planned: (row.trials_planned > 0 && !depends).then_some(row.trials_planned),
        last_activity: active.map(|at| at.wall).max(),
        reason: row.reason.clone(),
        next,
    }
}

/// Whether a session is open in a program at this moment.
pub(super) fn is_running(
    study: &StudyFolder,
    sessions: &[SessionData],
    row: &ParticipantRow,
) -> bool {
    let own = |s: &&SessionData| s.participant == row.participant && s.session == row.session;
    let own = sessions.iter().find(own);
    row.state == State::Unfinished && own.is_some_and(|session| study.is_open(session))
}

/// The rows that participants keep.
fn kept(sessions: &[SessionData], planned: Option<u32>) -> Rows {
    let mut held: Vec<u32> = held_rows(sessions).collect();
    held.sort_unstable();
    let mut twice: Vec<u32> = (held.windows(2))
        .filter(|pair| pair[0] == pair[1])
        .map(|pair| pair[0])
        .collect();
    twice.dedup();
    let kept = held.len();
    held.dedup();
    let highest = held.last().copied().unwrap_or(0);
    let is_free = |row: &u32| held.binary_search(row).is_err();
    Rows {
        kept,
        next: next_row(None, sessions),
        freed: (1..highest).filter(is_free).take(ROWS_LISTED).collect(),
        beyond: planned.map_or_else(Vec::new, |planned| {
            held.iter().copied().filter(|row| *row > planned).collect()
        }),
        twice,
    }
}

/// The free bytes of the disk that a folder is on; `None` if the system does not say.
pub(super) fn free_bytes(folder: &Path) -> Option<u64> {
    RealDisk.free_bytes(folder).ok().flatten()
}

fn storage(study: &StudyFolder, mirror: Option<&Path>) -> Storage {
    let free_bytes = free_bytes(study.path());
    Storage {
        free_bytes,
        almost_full: free_bytes.is_some_and(is_almost_full),
        mirror: mirror.map(|mirror| copied(study, mirror)),
    }
}

/// How the copy of a study in a mirror is.
fn copied(study: &StudyFolder, mirror: &Path) -> Mirror {
    let folder = mirror.join(&study.manifest().study);
    let (state, differs) = match folder.join(layout::MANIFEST).symlink_metadata() {
        Err(_) => (Copied::Missing, Vec::new()),
        Ok(_) => match study.heads_apart(&folder) {
            Ok(apart) if apart.is_empty() => (Copied::InStep, Vec::new()),
            Ok(apart) => {
                let names = apart.iter().map(|(id, number)| format!("{id}/{number}"));
                (Copied::Apart, names.collect())
            }
            Err(error) => (Copied::Unreadable, vec![error.to_string()]),
        },
    };
    Mirror {
        folder: folder.display().to_string(),
        state,
        differs,
    }
}
