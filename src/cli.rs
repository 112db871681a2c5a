//! Arguments, dispatch, exit codes; opens files, joins protocol and models,
//! builds the device. One file per command.

pub mod console;
pub mod failure;
pub mod load;

mod amend;
mod analyze;
mod check;
mod completions;
mod device;
mod identify;
mod new;
mod participant;
mod playback;
mod record;
mod rehearse;
mod results;
mod run;
mod schedule;
mod schema;
mod status;
mod trajectory;
mod verify;

pub use console::Console;
pub use failure::{Failure, Kind, guard};

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// From probe recordings of a haptic device to a defended result.
#[derive(Debug, Parser)]
#[command(name = "study", version, about, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a session with a participant, in this terminal
    Run(run::Args),
    /// Run a whole study with simulated participants, on a virtual clock
    Rehearse(rehearse::Args),
    /// What came of a study: statistics, figures and a report
    Analyze(analyze::Args),
    /// Show every fault of a protocol and its models
    Check(check::Args),
    /// Show the reproducible orders and their balance
    Schedule(schedule::Args),
    /// Show who is done, who is unfinished and which row is next
    Status(status::Args),
    /// Set the state of a participant
    Participant(participant::Args),
    /// Change wording or analysis of a running study
    Amend(amend::Args),
    /// Re-read every journal and compare the derived files
    Verify(verify::Args),
    /// Draw an excitation and check it against the limits of probe and target
    Trajectory(trajectory::Args),
    /// Impose an excitation on a target, simulated or real: a recording
    Record(record::Args),
    /// From a recording to model files and their VAF
    Identify(Box<identify::Args>),
    /// Write a commented protocol to start from
    New(new::Args),
    /// Print the JSON Schema of the protocol file, for editors
    Schema(schema::Args),
    /// Find, check and simulate playback devices
    Device(device::Args),
    /// Print completions for a shell
    Completions(completions::Args),
    /// Write manual pages
    Man(completions::ManArgs),
}

/// Does what was asked.
///
/// # Errors
/// [`Failure`], with what to tell the user and the exit code.
pub fn run(cli: Cli, console: &mut Console) -> Result<(), Failure> {
    match cli.command {
        Command::Run(args) => run::run(&args, console),
        Command::Rehearse(args) => rehearse::run(&args, console),
        Command::Analyze(args) => analyze::run(&args, console),
        Command::Check(args) => check::run(&args, console),
        Command::Schedule(args) => schedule::run(&args, console),
        Command::Status(args) => status::run(&args, console),
        Command::Participant(args) => participant::run(&args, console),
        Command::Amend(args) => amend::run(&args, console),
        Command::Verify(args) => verify::run(&args, console),
        Command::Trajectory(args) => trajectory::run(&args, console),
        Command::Record(args) => record::run(&args, console),
        Command::Identify(args) => identify::run(&args, console),
        Command::New(args) => new::run(&args, console),
        Command::Schema(args) => schema::run(&args, console),
        Command::Device(args) => device::run(&args, console),
        Command::Completions(args) => completions::run(&args, console),
        Command::Man(args) => completions::man(&args, console),
    }
}

/// Prints what clap says of the arguments (help and version included) and gives
/// the exit code: 0 for help and version, 2 for wrong usage.
pub fn usage(said: &clap::Error) -> ExitCode {
    // A closed pipe is not worth a message.
    let _ = said.print();
    if said.use_stderr() {
        ExitCode::from(Kind::Usage as u8)
    } else {
        ExitCode::SUCCESS
    }
}
