//! `study participant`

use super::{Console, Failure, study_folder};
use clap::ValueEnum;
use std::io::{self, IsTerminal as _};
use std::path::{Path, PathBuf};
use study_base::sort::SmallSort as _;
use study_base::text::{ParticipantId, counted};
use study_session::outcome::State;
use study_session::store::{self, StateChange, StateRequest, layout};

/// Arguments of `study participant`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Results folder of one study
    results: PathBuf,
    /// Participant
    #[arg(add = super::completions::participants())]
    id: String,
    /// New state
    #[arg(long, value_enum)]
    state: Settable,
    /// Reason; it is recorded
    #[arg(long, value_name = "TEXT")]
    reason: String,
    /// Permanently delete all data of the participant; only a record that they took
    /// part remains. Also deletes analysis/, which contains ratings and comments
    #[arg(long)]
    erase: bool,
    /// Erase without asking
    #[arg(long, requires = "erase")]
    yes: bool,
}

/// The states that this command can set.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Settable {
    /// Started by mistake; only before the first rating
    Void,
    /// Did not come
    NoShow,
    /// Dropped out during the session
    DroppedOut,
    /// Excluded from the analysis
    Excluded,
    /// Withdrew consent
    Withdrawn,
    /// Takes back an exclusion or a drop-out
    Reinstated,
}

impl From<Settable> for State {
    fn from(state: Settable) -> Self {
        match state {
            Settable::Void => Self::Void,
            Settable::NoShow => Self::NoShow,
            Settable::DroppedOut => Self::DroppedOut,
            Settable::Excluded => Self::Excluded,
            Settable::Withdrawn => Self::Withdrawn,
            Settable::Reinstated => Self::Unfinished,
        }
    }
}

/// Sets the state and prints the consequences.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    if args.erase && matches!(args.state, Settable::Excluded) {
        return Err(Failure::input(
            "exclusion keeps the data, but --erase deletes them",
        )
        .hint("use `--state withdrawn --erase` to delete the data, or `--state excluded` alone to leave them out of the analysis"));
    }
    let participant = ParticipantId::new(args.id.as_str()).map_err(Failure::input)?;
    let request = StateRequest {
        participant,
        state: args.state.into(),
        reason: study_folder::reason(&args.reason)?.to_owned(),
        erase: args.erase,
    };
    let study = store::one_study(&args.results)?;
    if args.erase && !args.yes && !confirmed(study.path(), &request.participant, console)? {
        return console.out("Nothing is erased.\n");
    }
    let change = study.set_state(&request, study_folder::now())?;
    for notice in &change.notices {
        console.say(notice);
    }
    console.out(summary(&request, &change))?;
    study_folder::refresh(&study, console)
}

/// Lists what is erased and asks for the participant's id. True without a question if
/// there is nothing to list: the store then says why.
fn confirmed(
    study: &Path,
    participant: &ParticipantId,
    console: &mut Console,
) -> Result<bool, Failure> {
    let mut listed = Vec::new();
    list(&layout::participant(study, participant), &mut listed);
    if listed.is_empty() {
        return Ok(true);
    }
    list(&study.join(layout::ANALYSIS), &mut listed);
    let names = listed
        .iter()
        .filter_map(|path| path.strip_prefix(study).ok());
    let names: Vec<String> = names
        .map(|name| format!("  {}\n", name.display()))
        .collect();
    console.out(format!(
        "These files are erased and cannot be restored:\n{}",
        names.concat()
    ))?;
    if !io::stdin().is_terminal() {
        return Err(Failure::input(
            "--erase asks for confirmation, and standard input is no terminal",
        )
        .hint("add --yes to erase without asking"));
    }
    console.out(format!("Type {participant} to erase them: "))?;
    let mut typed = String::new();
    let read = io::stdin().read_line(&mut typed);
    read.map_err(|e| Failure::input(format!("standard input: {e}")))?;
    Ok(typed.trim() == participant.as_str())
}

/// The files in a folder, in order; none if it cannot be read.
fn list(folder: &Path, files: &mut Vec<PathBuf>) {
    let Ok(items) = std::fs::read_dir(folder) else {
        return;
    };
    let mut paths: Vec<PathBuf> = items.flatten().map(|item| item.path()).collect();
    paths.small_sort();
    for path in paths {
        if path.is_dir() && !path.is_symlink() {
            list(&path, files);
        } else {
            files.push(path);
        }
    }
}

/// What happened to the participant, their data and their row.
fn summary(request: &StateRequest, change: &StateChange) -> String {
    let id = &request.participant;
    let sessions = counted(change.erased, "session", "sessions");
    let analysis = if change.analysis_removed {
        " analysis/ contained some of them and is deleted too: run `study analyze` again."
    } else {
        ""
    };
    if let Some(at) = change.erased_before {
        let when = at.format("%Y-%m-%d %H:%M %:z");
        let left = match change.erased {
            0 => "No data were left.".to_owned(),
            _ => format!("The remaining data of {sessions} are erased now."),
        };
        return format!(
            "The data of {id} were already erased on {when}; nothing else is changed. {left}{analysis}\n"
        );
    }
    let state = change.after.as_str();
    let mut text = match change.before {
        Some(before) => format!("{id} was {} and is now {state}.", before.as_str()),
        None => format!("{id} is recorded as {state}."),
    };
    if request.erase {
        text.push_str(&format!(
            " The data of {sessions} are erased and cannot be restored; tombstone.json records the erasure.{analysis} Copies and backups are not affected.",
        ));
    }
    text.push_str(&match change.freed_row {
        Some(row) => format!(" Row {row} is assigned to the next participant.\n"),
        None => " No row becomes free.\n".to_owned(),
    });
    text
}
