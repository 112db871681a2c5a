//! `study rehearse`: a whole study with simulated participants.

use super::progress::shown as shown_progress;
use super::{Console, Failure, Kind};
use crate::rater::Effect;
use crate::rehearsal::{Options, RehearseError, rehearse};
use std::path::PathBuf;
use study_analysis::load;
use study_base::text::Untrusted;
use study_session::outcome::{State, Status};

/// Arguments of `study rehearse`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A protocol.toml or the folder that contains it
    protocol: PathBuf,
    /// Number of simulated participants
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=9999))]
    participants: u32,
    /// Seed of the raters; the orders always use the seed of the protocol
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "rehearsal")]
    out: PathBuf,
    /// Let the device fail at random, and render another force than the one it was sent in
    /// some of the sessions
    #[arg(long)]
    faults: bool,
    /// Whether ratings depend on the realization
    #[arg(long, value_enum, default_value_t = EffectArg::BuiltIn)]
    effect: EffectArg,
    /// Telemetry samples per second [default: 100, or 1000 with --faults, since slow telemetry
    /// shows no wrong force]
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(1..=4000))]
    telemetry: Option<u32>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum EffectArg {
    /// Realizations that are closer to the target and less active are rated higher
    BuiltIn,
    /// Ratings do not depend on the realization
    None,
}

impl From<RehearseError> for Failure {
    fn from(error: RehearseError) -> Self {
        match error {
            RehearseError::Load(error) => error.into(),
            RehearseError::Unplayable(error) => error.into(),
            RehearseError::Recording(error) => error.into(),
            RehearseError::Store(error) => error.into(),
            RehearseError::Rehearsed { .. } | RehearseError::Real(_) => {
                Self::results(error).hint("name another folder with --out")
            }
            RehearseError::Session(error) => Self::new(Kind::Results, error),
        }
    }
}

/// Runs the command.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let loaded = load::load(&args.protocol)?;
    let without_tables = loaded.models.is_empty()
        && loaded.protocol.families.is_empty()
        && loaded.protocol.spaces.is_empty();
    let options = Options {
        participants: args.participants,
        seed: args.seed,
        effect: match args.effect {
            EffectArg::BuiltIn => Effect::BuiltIn,
            EffectArg::None => Effect::None,
        },
        faults: args.faults,
        telemetry_hz: args.telemetry,
        progress: None,
    };
    let rehearsed = shown_progress("participants", |progress| {
        let progress = Some(progress);
        rehearse(
            loaded,
            &args.out,
            &Options {
                progress,
                ..options
            },
        )
    })?;
    for notice in &rehearsed.notices {
        console.say(format!("warning: {}", Untrusted(notice)));
    }
    let derived = &rehearsed.derived;
    let done = (derived.participants.iter())
        .filter(|p| p.state == State::Done)
        .count();
    let rated = (derived.rows.iter())
        .filter(|row| !row.practice && row.status == Status::Ok)
        .count();
    let shown = rehearsed.folder.display();
    let compared = match rehearsed.percepts.target() {
        _ if without_tables => {
            "The realizations have no tables: the raters' answers do not depend on them.".to_owned()
        }
        Some(best) => {
            format!("The raters compare with the realization with the highest VAF, {best}.")
        }
        None => "The raters compare with the simulated switch B.".to_owned(),
    };
    console.out(format!(
        "{done} simulated participants, {rated} rated trials in {shown}.\n{compared}\nSimulated: the effects are built in (docs/simulation.md) and are no evidence.\nNext: study analyze {shown} --include simulated\n"
    ))
}
