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
    /// What became of them
    #[arg(long, value_enum)]
    state: Settable,
    /// Why; it is kept
    #[arg(long, value_name = "TEXT")]
    reason: String,
    /// Remove everything that they gave, for good; only the fact that they took part
    /// stays. analysis/ is removed too, for ratings and comments of theirs are in it
    #[arg(long)]
    erase: bool,
}

/// The states that are set from outside a session.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Settable {
    /// Started by mistake; only before the first rating
    Void,
    /// Did not come
    NoShow,
    /// Broke off
    DroppedOut,
    /// Not analysed
    Excluded,
    /// Took back what was given
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

/// Sets the state and says what that means for the row.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    if args.erase && matches!(args.state, Settable::Excluded) {
        return Err(Failure::input(
            "exclusion keeps the data, and --erase removes them",
        )
        .hint("`--state withdrawn --erase` erases; `--state excluded` alone leaves out of the analysis"));
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
    console.out(told(&request, &change))?;
    study_folder::refresh(&study, console)
}

/// What became of the participant, their data and their row.
fn told(request: &StateRequest, change: &StateChange) -> String {
    let id = &request.participant;
    let sessions = counted(change.erased, "session", "sessions");
    let analysis = if change.analysis_removed {
        " analysis/ held some of it and is removed too: run `study analyze` again."
    } else {
        ""
    };
    if let Some(at) = change.erased_before {
        let when = at.format("%Y-%m-%d %H:%M %:z");
        let left = match change.erased {
            0 => "Nothing of theirs was left.".to_owned(),
            _ => format!("What was left of {sessions} is erased now."),
        };
        return format!(
            "What {id} gave was erased already, on {when}; nothing else is changed. {left}{analysis}\n"
        );
    }
    let state = request.state.as_str();
    let mut said = match change.before {
        Some(before) => format!("{id} was {} and is now {state}.", before.as_str()),
        None => format!("{id} is on record as {state}."),
    };
    if request.erase {
        said.push_str(&format!(
            " What they gave in {sessions} is erased and cannot be brought back; tombstone.json says that it was.{analysis} Copies and backups are not touched.",
        ));
    }
    said.push_str(&match change.freed_row {
        Some(row) => format!(" Row {row} goes to the next participant.\n"),
        None => " No row is handed out again.\n".to_owned(),
    });
    said
}
