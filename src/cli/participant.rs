//! `study participant`

use super::{Console, Failure, results};
use crate::outcome::State;
use crate::store::StateRequest;
use crate::text::ParticipantId;
use clap::ValueEnum;
use std::path::PathBuf;

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
    /// Remove everything that they gave; only the fact that they took part stays
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
    let participant = ParticipantId::new(args.id.as_str()).map_err(Failure::input)?;
    let request = StateRequest {
        participant,
        state: args.state.into(),
        reason: results::reason(&args.reason)?.to_owned(),
        erase: args.erase,
    };
    let study = results::one_study(&args.results)?;
    let change = study.set_state(&request, results::now())?;
    for notice in &change.notices {
        console.say(notice);
    }
    let id = &request.participant;
    let state = request.state.as_str();
    let mut said = match change.before {
        Some(before) => format!("{id} was {} and is now {state}.", before.as_str()),
        None => format!("{id} is on record as {state}."),
    };
    if args.erase {
        said.push_str(&format!(
            " What they gave in {} is erased; tombstone.json says that it was.",
            match change.erased {
                1 => "1 session".to_owned(),
                n => format!("{n} sessions"),
            }
        ));
    }
    said.push_str(&match change.freed_row {
        Some(row) => format!(" Row {row} goes to the next participant.\n"),
        None => " No row is handed out again.\n".to_owned(),
    });
    console.out(said)?;
    results::refresh(&study, console)
}
