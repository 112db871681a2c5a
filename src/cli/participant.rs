//! `study participant`

use super::{Console, Failure, study_folder};
use clap::ValueEnum;
use std::path::PathBuf;
use study_base::text::{ParticipantId, counted};
use study_core::outcome::State;
use study_core::store::{StateChange, StateRequest};

/// Arguments of `study participant`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Results folder of one study
    results: PathBuf,
    /// Participant
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
}

impl From<Settable> for State {
    fn from(state: Settable) -> Self {
        match state {
            Settable::Void => Self::Void,
            Settable::NoShow => Self::NoShow,
            Settable::DroppedOut => Self::DroppedOut,
            Settable::Excluded => Self::Excluded,
            Settable::Withdrawn => Self::Withdrawn,
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
    let study = study_folder::one_study(&args.results)?;
    let change = study.set_state(&request, study_folder::now())?;
    for notice in &change.notices {
        console.say(notice);
    }
    console.out(summary(&request, &change))?;
    study_folder::refresh(&study, console)
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
    let state = request.state.as_str();
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
