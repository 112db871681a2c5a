//! What the help and the manual pages say beside the arguments: examples, exit codes,
//! files, environment.

use super::{Cli, Failure};
use clap::{Command, CommandFactory as _};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};
use std::path::Path;

/// Examples of each command: the command line and what it does.
pub(super) const EXAMPLES: &[(&str, &[(&str, &str)])] = &[
    (
        "run",
        &[
            (
                "study run protocols/turn-signal",
                "asks who takes part, and begins or resumes",
            ),
            (
                "study run my-study --participant P07 --operator LW",
                "without the first page",
            ),
            (
                "study run my-study --mirror /media/usb",
                "every record on a second disk as well",
            ),
            (
                "study run my-study --plain",
                "lines only, for a screen reader",
            ),
            (
                "study run my-study --screen=192.168.1.20",
                "the participant's side on a tablet",
            ),
            (
                "study run my-study --device simulated",
                "a pilot on the simulated device",
            ),
        ],
    ),
    (
        "rehearse",
        &[(
            "study rehearse my-study --participants 10",
            "the whole study in seconds, in rehearsal/",
        )],
    ),
    (
        "analyze",
        &[
            (
                "study analyze results",
                "on the terminal, and files in results/…/analysis",
            ),
            (
                "study analyze results --include pilot",
                "pilots as well, under a banner",
            ),
            (
                "study analyze --pool utah bern --out pooled",
                "two sites of a study, with site as a factor",
            ),
            (
                "study analyze ratings.csv --out report",
                "any table with subject,model,rating",
            ),
            (
                "study analyze trials.csv --task 2ifc",
                "thresholds from a table of trials",
            ),
            (
                "study analyze results --json",
                "all values with their identifiers",
            ),
            (
                "study analyze trials.csv --task 2ifc",
                "thresholds of any table with participant,level,positive,trials",
            ),
        ],
    ),
    (
        "check",
        &[(
            "study check my-study",
            "all errors at once, with line and hint",
        )],
    ),
    (
        "power",
        &[
            (
                "study power my-study --slope 0.5 --closed",
                "the closed forms, at once",
            ),
            (
                "study power my-study --participants 10,20,40 --out power",
                "by simulation, with figures",
            ),
            (
                "study power my-study --slurm jobs --studies 100000",
                "scripts for a cluster",
            ),
        ],
    ),
    (
        "export",
        &[
            (
                "study export results --to bids --out dataset",
                "for an archive; also psych-ds, frictionless",
            ),
            (
                "study export results --to csv --out tables --bom --spreadsheet-safe",
                "for a spreadsheet",
            ),
            (
                "study export results --to r --out r --without-comments",
                "tables, an R script and a Quarto document",
            ),
            (
                "study export rehearsal --to wide --include simulated --out wide",
                "one row for each simulated participant",
            ),
        ],
    ),
    (
        "preregister",
        &[
            (
                "study preregister my-study",
                "preregistration.md and .json beside the protocol",
            ),
            (
                "study preregister my-study --participants 20 --date 2026-03-01",
                "another number of participants, a stated day",
            ),
        ],
    ),
    (
        "schedule",
        &[
            (
                "study schedule my-study --rows 1-10 --csv",
                "the orders of the first ten participants",
            ),
            (
                "study schedule my-threshold --answers answers.csv --json",
                "what the tracks present if they are answered so",
            ),
        ],
    ),
    (
        "status",
        &[("study status results", "who is done, unfinished, next")],
    ),
    (
        "participant",
        &[
            (
                "study participant results P03 --state dropped-out --reason \"felt unwell\"",
                "the answers are kept",
            ),
            (
                "study participant results P03 --state withdrawn --reason \"asked for it\" --erase",
                "removes what the person gave, after a confirmation",
            ),
        ],
    ),
    (
        "amend",
        &[(
            "study amend results my-study --reason \"typo in the instructions\"",
            "a new version of the wording",
        )],
    ),
    (
        "verify",
        &[("study verify results", "checksums, chains, derived tables")],
    ),
    (
        "trajectory",
        &[(
            "study trajectory protocols/turn-signal/training.toml",
            "checked against the limits of probe and target",
        )],
    ),
    (
        "record",
        &[(
            "study record protocols/turn-signal/training.toml --plant b --rate 10000 --out training.csv",
            "from the simulated switch",
        )],
    ),
    (
        "import",
        &[(
            "study import force-curve switch-1.csv switch-2.csv switch-3.csv -o switch.csv",
            "three repetitions of a press and release as one recording",
        )],
    ),
    (
        "identify",
        &[(
            "study identify training.csv --validate validation-1.5hz.csv --out models",
            "model files and their VAF",
        )],
    ),
    (
        "new",
        &[(
            "study new my-study --kind questplus",
            "a commented protocol of a threshold",
        )],
    ),
    (
        "schema",
        &[("study schema", "for the editor's completion and checks")],
    ),
    (
        "device",
        &[
            ("study device list", "serial ports"),
            (
                "study device check --port /dev/ttyACM0",
                "does it conform to docs/wire.md?",
            ),
            (
                "study device check --port /dev/ttyACM0 --rendering --save",
                "and is its force that of its tables?",
            ),
            (
                "study device commission --port /dev/ttyACM0",
                "a weight, a ruler, the emergency stop",
            ),
            ("study device simulate", "a device on a pseudo-terminal"),
        ],
    ),
    (
        "completions",
        &[("study completions bash", "source the output in ~/.bashrc")],
    ),
    (
        "man",
        &[(
            "study man /usr/local/share/man/man1",
            "one page for each command",
        )],
    ),
];

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
    EXAMPLES
        .iter()
        .fold(Cli::command(), |all, (name, examples)| {
            all.mut_subcommand(name, |command| {
                let own = command.get_after_help().map(|own| format!("{own}\n\n"));
                let help = own.unwrap_or_default() + &in_lines(examples);
                command.after_help(help)
            })
        })
}

fn in_lines(examples: &[(&str, &str)]) -> String {
    let lines = examples
        .iter()
        .map(|(line, what)| format!("  {line}\n      {what}\n"));
    format!("Examples:\n{}", lines.collect::<String>().trim_end())
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
            let (_, examples) = EXAMPLES.iter().find(|(of, _)| *of == name).expect(name);
            for (line, what) in *examples {
                assert!(line.starts_with(&format!("study {name}")), "{line}");
                assert!(!what.is_empty());
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
