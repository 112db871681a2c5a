//! `study check`: every fault of a protocol and of what it names.

use super::{Console, Failure, load};
use crate::diagnostic::{Findings, Severity};
use crate::protocol::check;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `study check`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A protocol.toml or the folder that holds one
    protocol: PathBuf,
    /// One JSON document on standard output
    #[arg(long)]
    json: bool,
}

/// The document of `--json`.
#[derive(Debug, Serialize)]
struct Report<'a> {
    format: &'static str,
    ok: bool,
    errors: Vec<Item<'a>>,
    warnings: Vec<Item<'a>>,
    study: Option<&'a str>,
    models: Option<usize>,
    trials: Option<usize>,
    minutes: Option<f64>,
    fingerprints: Option<&'a crate::protocol::fingerprint::Fingerprints>,
}

#[derive(Debug, Serialize)]
struct Item<'a> {
    file: &'a str,
    line: Option<usize>,
    column: Option<usize>,
    message: &'a str,
    label: Option<&'a str>,
    hint: Option<&'a str>,
}

/// Does it.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let (loaded, findings) = load::examine(&args.protocol);
    let count = |severity| findings.iter().map(|f| f.count(severity)).sum::<usize>();
    let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
    let trials = loaded.as_ref().map(load::Loaded::trials);
    let minutes = loaded.as_ref().map(|l| check::minutes(&l.protocol));
    if args.json {
        let report = Report {
            format: "study-check/1",
            ok: errors == 0,
            errors: items(&findings, Severity::Error),
            warnings: items(&findings, Severity::Warning),
            study: loaded.as_ref().map(|l| l.protocol.study.id.as_str()),
            models: loaded.as_ref().map(|l| l.protocol.models.len()),
            trials,
            minutes,
            fingerprints: loaded.as_ref().map(|l| &l.fingerprints),
        };
        let document = serde_json::to_string_pretty(&report)
            .map_err(|e| Failure::new(super::Kind::Bug, format!("the report: {e}")))?;
        console.out(document + "\n")?;
        // everything has been said on standard output
        return match loaded {
            Some(_) => Ok(()),
            None => Err(Failure::faults(Vec::new())),
        };
    }
    let (Some(loaded), Some(trials), Some(minutes)) = (loaded, trials, minutes) else {
        let mut failure = Failure::faults(findings);
        failure.message = match warnings {
            0 => plural(errors, "fault"),
            _ => format!(
                "{}, {}",
                plural(errors, "fault"),
                plural(warnings, "warning")
            ),
        };
        return Err(failure);
    };
    console.findings(&findings);
    console.out(format!(
        "{}: ok, {}, {}, about {minutes:.0} minutes, {}\n",
        loaded.protocol.study.id,
        plural(loaded.protocol.models.len(), "model"),
        plural(trials, "trial"),
        plural(warnings, "warning"),
    ))
}

fn plural(n: usize, word: &str) -> String {
    match n {
        1 => format!("1 {word}"),
        n => format!("{n} {word}s"),
    }
}

fn items(findings: &[Findings], severity: Severity) -> Vec<Item<'_>> {
    findings
        .iter()
        .flat_map(|f| f.faults.iter().map(move |fault| (f, fault)))
        .filter(|(_, fault)| fault.severity == severity)
        .map(|(f, fault)| {
            let place = fault
                .span
                .as_ref()
                .filter(|_| !f.text.is_empty())
                .map(|span| f.line_and_column(span.start));
            Item {
                file: &f.path,
                line: place.map(|(line, _)| line),
                column: place.map(|(_, column)| column),
                message: &fault.message,
                label: fault.label.as_deref(),
                hint: fault.hint.as_deref(),
            }
        })
        .collect()
}
