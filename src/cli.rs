//! The command line: arguments, dispatch and exit codes. Opens files, combines protocol
//! and models, and opens the device. One file for each command.

pub mod console;
pub mod failure;

mod amend;
mod analyze;
mod check;
mod command_line;
mod completions;
mod correct;
mod desk;
mod device;
mod device_selection;
mod doctor;
mod explore;
mod export;
mod help;
mod identify;
mod import;
mod include;
mod new;
mod overview;
mod participant;
mod power;
mod preregister;
mod progress;
mod record;
mod rehearse;
mod replay;
mod run;
mod schedule;
mod schema;
mod status;
mod stimulus;
mod study_folder;
mod trajectory;
mod verify;

pub use completions::answer_shell;
pub use console::Console;
pub use failure::{Failure, Kind, guard};

use clap::{FromArgMatches as _, Parser, Subcommand};
use std::process::ExitCode;

/// Haptic experiments: identify realizations, play them back, collect ratings, analyze
#[derive(Debug, Parser)]
#[command(name = "study", version, about, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a session with a participant in this terminal
    Run(run::Args),
    /// Run a whole study with simulated participants
    Rehearse(rehearse::Args),
    /// Analyze a study: statistics, figures, report
    Analyze(analyze::Args),
    /// Show what a search found: maps, uncertainty, order of proposals
    Explore(explore::Args),
    /// Check a protocol and its models
    Check(check::Args),
    /// How many participants, realizations and repetitions? Power of the planned design
    Power(Box<power::Args>),
    /// Write the data of a study for other programs and for archives
    Export(export::Args),
    /// Write a preregistration: design, rules, deciding tests and power before the first session
    Preregister(preregister::Args),
    /// Show the presentation orders and their balance
    Schedule(schedule::Args),
    /// Show the state of each participant and the next row
    Status(status::Args),
    /// Show all participants of a study: progress, returns due, exclusions, rows, disk and mirror
    Desk(desk::Args),
    /// Show a session or a trial again: what was on the screen, answered and felt
    Replay(replay::Args),
    /// Change the state of a participant
    Participant(participant::Args),
    /// Correct an answer or a mistyped id after a session; both values are kept
    Correct(correct::Args),
    /// Change the wording or the analysis of a running study
    Amend(amend::Args),
    /// Verify all journals and the files derived from them
    Verify(verify::Args),
    /// Draw a trajectory and check it against the limits of probe and target
    Trajectory(trajectory::Args),
    /// Move the probe along a trajectory and record the response
    Record(record::Args),
    /// Read measurements of another instrument, or results of another program
    Import(import::Args),
    /// Identify realizations from a recording: model files and their VAF
    Identify(Box<identify::Args>),
    /// Archive of stimuli: pack a realization with its recordings, verify, compare, catalogue
    Stimulus(stimulus::Args),
    /// Write a commented protocol as a starting point
    New(new::Args),
    /// Print the JSON Schema of the protocol file, for editors
    Schema(schema::Args),
    /// Find, check and simulate playback devices
    Device(device::Args),
    /// Measure this computer, its disk, terminal and device: fit for which sessions?
    Doctor(doctor::Args),
    /// Print shell completions
    Completions(completions::Args),
    /// Write manual pages
    Man(completions::ManArgs),
}

/// Parses the arguments of the process.
///
/// # Errors
/// The help that was asked for, or what is wrong.
pub fn parse() -> Result<Cli, clap::Error> {
    Cli::from_arg_matches(&help::command().try_get_matches()?)
}

/// Runs a command.
///
/// # Errors
/// [`Failure`]: the message for the user and the exit code.
pub fn run(cli: Cli, console: &mut Console) -> Result<(), Failure> {
    match cli.command {
        Command::Run(args) => run::run(&args, console),
        Command::Rehearse(args) => rehearse::run(&args, console),
        Command::Analyze(args) => analyze::run(&args, console),
        Command::Explore(args) => explore::run(&args, console),
        Command::Check(args) => check::run(&args, console),
        Command::Power(args) => power::run(&args, console),
        Command::Export(args) => export::run(&args, console),
        Command::Preregister(args) => preregister::run(&args, console),
        Command::Schedule(args) => schedule::run(&args, console),
        Command::Status(args) => status::run(&args, console),
        Command::Desk(args) => desk::run(&args, console),
        Command::Replay(args) => replay::run(&args, console),
        Command::Participant(args) => participant::run(&args, console),
        Command::Correct(args) => correct::run(&args, console),
        Command::Amend(args) => amend::run(&args, console),
        Command::Verify(args) => verify::run(&args, console),
        Command::Trajectory(args) => trajectory::run(&args, console),
        Command::Record(args) => record::run(&args, console),
        Command::Import(args) => import::run(&args, console),
        Command::Identify(args) => identify::run(&args, console),
        Command::Stimulus(args) => stimulus::run(&args, console),
        Command::New(args) => new::run(&args, console),
        Command::Schema(args) => schema::run(&args, console),
        Command::Device(args) => device::run(&args, console),
        Command::Doctor(args) => doctor::run(&args, console),
        Command::Completions(args) => completions::run(&args, console),
        Command::Man(args) => completions::man(&args, console),
    }
}

/// Prints a message of the argument parser, such as help or a usage error. Returns the
/// exit code: 0 for help and version, 2 for wrong usage, 1 if help cannot be written.
pub fn usage(message: &clap::Error, console: &mut Console) -> ExitCode {
    let printed = message
        .print()
        .and_then(|()| std::io::Write::flush(&mut std::io::stdout()));
    if message.use_stderr() {
        return ExitCode::from(Kind::Usage as u8);
    }
    match printed.map_err(|e| console::unwritten(&e)) {
        Err(Some(failure)) => {
            console.failure(&failure);
            ExitCode::from(failure.exit_code())
        }
        // A closed pipe needs no message.
        Ok(()) | Err(None) => ExitCode::SUCCESS,
    }
}
