//! What the help and the manual pages say beside the arguments: examples, exit codes,
//! files, environment.

use super::{Cli, Failure};
use clap::{Command, CommandFactory as _};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};
use std::path::Path;

/// Examples of all commands: a command line, and below it what it does.
const EXAMPLES: &str = include_str!("examples.txt");

/// The examples of a command.
fn examples(command: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    let own = format!("study {command} ");
    let lines = EXAMPLES.lines().zip(EXAMPLES.lines().skip(1)).step_by(2);
    lines
        .filter(move |(line, _)| format!("{line} ").starts_with(&own))
        .map(|(line, what)| (line, what.trim_start()))
}

/// Exit codes: those of [`super::Kind`].
const EXIT: &[(&str, &str)] = &[
    ("0", "done"),
    ("1", "the user's input is at fault"),
    ("2", "wrong usage"),
    ("3", "the device, or a failed check of it"),
    ("4", "the results folder; something may not be saved"),
    ("70", "a bug of the program"),
];

const ENVIRONMENT: &[(&str, &str)] = &[
    ("NO_COLOR", "no colors if set"),
    ("STUDY_PLAIN", "sessions in plain lines if set and not 0"),
    (
        "STUDY_LANG",
        "language of the experimenter's desk, such as de; otherwise that of LC_ALL, LC_MESSAGES or LANG",
    ),
    ("TERM", "dumb: sessions in plain lines, no bars"),
];

const FILES: &[(&str, &str)] = &[
    ("protocol.toml", "a study; study schema describes it"),
    (
        "device.toml",
        "in the working folder: port or program of the local device, mirror",
    ),
    (
        "results/STUDY/sessions/ID/N/journal.jsonl",
        "every event of a session; the tables are derived from it",
    ),
    (
        "results/STUDY/ratings.csv",
        "one row for each counted trial",
    ),
];

/// The command line with its examples.
pub(super) fn command() -> Command {
    Cli::command().mut_subcommands(|command| {
        let own = command.get_after_help().map(|own| format!("{own}\n\n"));
        let lines =
            examples(command.get_name()).map(|(line, what)| format!("\n  {line}\n      {what}"));
        let help = format!(
            "{}Examples:{}",
            own.unwrap_or_default(),
            lines.collect::<String>()
        );
        command.after_help(help)
    })
}

/// Writes a manual page for the program and for each command.
///
/// # Errors
/// [`Failure`] if a page cannot be written.
pub(super) fn write_pages(folder: &Path) -> Result<(), Failure> {
    let mut all = command().disable_help_subcommand(true);
    all.build();
    let names: Vec<String> = all
        .get_subcommands()
        .map(|c| c.get_name().to_owned())
        .collect();
    write_page(folder, &all, "study", &names)?;
    for command in all.get_subcommands() {
        let name = format!("study-{}", command.get_name());
        write_page(folder, command, &name, &names)?;
    }
    Ok(())
}

fn write_page(
    folder: &Path,
    command: &Command,
    name: &str,
    names: &[String],
) -> Result<(), Failure> {
    let path = folder.join(format!("{name}.1"));
    let page = page(command, name, names).map_err(|e| Failure::file(&path, &e))?;
    std::fs::write(&path, page).map_err(|e| Failure::file(&path, &e))
}

fn page(command: &Command, name: &str, names: &[String]) -> std::io::Result<Vec<u8>> {
    let mut page = Vec::new();
    let man = Man::new(command.clone());
    man.render(&mut page)?;
    for (title, list) in [
        ("EXIT STATUS", EXIT),
        ("ENVIRONMENT", ENVIRONMENT),
        ("FILES", FILES),
    ] {
        let mut section = Roff::new();
        section.control("SH", [title]);
        for (key, what) in list {
            section
                .control("TP", [])
                .text([roman(*key)])
                .text([roman(*what)]);
        }
        section.to_writer(&mut page)?;
    }
    let others = names
        .iter()
        .map(|n| format!("study-{n}"))
        .chain(["study".to_owned()]);
    let others: Vec<String> = others
        .filter(|o| o != name)
        .map(|o| format!("{o}(1)"))
        .collect();
    let mut see = Roff::new();
    see.control("SH", ["SEE ALSO"])
        .text([roman(others.join(", "))]);
    see.to_writer(&mut page)?;
    Ok(page)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_examples_and_each_can_be_typed() {
        for sub in Cli::command().get_subcommands() {
            let name = sub.get_name();
            assert!(examples(name).next().is_some(), "{name}");
            for (line, what) in examples(name) {
                assert!(!what.is_empty() && !what.starts_with("study "), "{what}");
                let words = line
                    .replace("\"felt unwell\"", "x")
                    .replace("\"asked for it\"", "x");
                let words = words.replace("\"typo in the instructions\"", "x");
                let parsed = command().try_get_matches_from(words.split(' '));
                assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
            }
        }
    }

    #[test]
    fn a_page_tells_exit_codes_environment_files_and_other_pages() {
        let folder = tempfile::tempdir().unwrap();
        write_pages(folder.path()).unwrap();
        let page = std::fs::read_to_string(folder.path().join("study-run.1")).unwrap();
        for text in [
            "EXIT STATUS",
            "STUDY_PLAIN",
            "journal.jsonl",
            "study\\-analyze(1)",
            "Examples",
        ] {
            assert!(page.contains(text), "{text}:\n{page}");
        }
        assert!(folder.path().join("study.1").exists());
    }
}
