//! `study check`: every fault of a protocol and of the files that it names.

use super::{Console, Failure};
use std::path::PathBuf;
use study_analysis::check::{Checked, Report, Sensitivity};
use study_analysis::load::Loaded;
use study_base::apa;
use study_base::diagnostic::Severity;
use study_base::text::{Untrusted, counted};
use study_plan::protocol::{DeviceKind, ModelEntry, Protocol};

/// Arguments of `study check`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A protocol.toml or the folder that contains it
    protocol: PathBuf,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    /// Show the margins of each certificate and the damping that the tables need
    #[arg(long, conflicts_with = "json")]
    verbose: bool,
}

/// Runs `study check`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let checked = Checked::open(&args.protocol);
    let (errors, warnings) = (
        checked.count(Severity::Error),
        checked.count(Severity::Warning),
    );
    if args.json {
        let document = serde_json::to_string_pretty(&checked.report())
            .map_err(|e| Failure::new(super::Kind::Bug, format!("the report: {e}")))?;
        console.document(document + "\n")?;
        // standard output holds the whole report
        return match checked.loaded {
            Some(_) => Ok(()),
            None => Err(Failure::faults(Vec::new())),
        };
    }
    let warned = counted(warnings, "warning", "warnings");
    let Some(loaded) = &checked.loaded else {
        let mut failure = Failure::faults(checked.findings);
        failure.message = counted(errors, "fault", "faults");
        if warnings > 0 {
            failure.message += &format!(", {warned}");
        }
        return Err(failure);
    };
    console.findings(&checked.findings);
    let report = checked.report();
    console.out(certificates(loaded, &report, args.verbose))?;
    if let Some(sensitivity) = &report.sensitivity {
        console.out(in_words(sensitivity))?;
    }
    console.out(format!(
        "{}: ok, {}, {}, about {:.0} minutes, {warned}\n",
        loaded.protocol.study.id,
        counted(loaded.protocol.models.len(), "model", "models"),
        counted(loaded.trials(), "trial", "trials"),
        report.minutes.unwrap_or_default(),
    ))
}

fn in_words(sensitivity: &Sensitivity) -> String {
    let floor = sensitivity.smallest_p.map_or(String::new(), |p| {
        format!(
            "; the smallest p of the permutation test is {}",
            apa::bare_p(p)
        )
    });
    format!(
        "power: 80 % take a correlation of {} between VAF and the true means, however many the \
         participants{floor}; see `study power`\n",
        apa::r(sensitivity.correlation)
    )
}

/// What the protocol asks of a device before a session.
fn asked_of_devices(protocol: &Protocol) -> String {
    let device = &protocol.device;
    let mut out = String::new();
    let has_force = matches!(device.kind, DeviceKind::Serial | DeviceKind::Process);
    if let Some(days) = device.commissioned_within_days {
        out += &match has_force {
            true => format!(
                "note: a session needs a device that passed `study device commission` within {days} days; \
                 `study device info` says when it did\n"
            ),
            false => format!(
                "note: `commissioned_within_days` asks nothing of a {} device\n",
                device.kind.as_str()
            ),
        };
    }
    if device.self_weigh {
        out += &match has_force {
            true => {
                "note: the motor weighs itself before each session, on the free handle\n".to_owned()
            }
            false => format!(
                "note: `self_weigh` asks nothing of a {} device\n",
                device.kind.as_str()
            ),
        };
    }
    if let Some(hours) = device.check_within_h.filter(|_| has_force) {
        out += &format!(
            "note: a session needs a device that passed `study device check --save` within {hours} h\n"
        );
    }
    out
}

/// A line for each table that is played, with its certificate and, if `verbose`, its
/// margins; notes about tables that fail theirs and about samples mounted by hand.
fn certificates(loaded: &Loaded, report: &Report<'_>, verbose: bool) -> String {
    let mut out = String::new();
    let mut dangers = Vec::new();
    for certified in &report.certificates {
        let (id, certificate) = (certified.model, &certified.certificate);
        if verbose {
            let damping = study_report::identification::required_damping(certificate);
            out += &format!("{id}: {certificate}\n    {damping}\n");
        } else {
            let verdict = if certified.pass { "PASS" } else { "FAIL" };
            out += &format!("{id}: {verdict}\n");
        }
        let notes = certified.danger.iter().chain(&certified.beyond);
        dangers.extend(notes.map(|note| format!("note: `{id}`: {note}\n")));
    }
    let without = report
        .certificates
        .iter()
        .filter(|c| !c.has_coverage)
        .count();
    if without > 0 {
        dangers.push(format!(
            "note: {without} of {} do not say where their recordings went: identified before study-model/3\n",
            counted(report.certificates.len(), "model file", "model files"),
        ));
    }
    out += &dangers.concat();
    let failing = report.certificates.iter().filter(|c| !c.pass).count();
    if let (1.., Some(permission)) = (failing, &loaded.protocol.device.uncertified) {
        out += &format!(
            "note: {failing} of {} fail their certificate; `uncertified` permits playback at up to {} N: {}\n",
            counted(report.certificates.len(), "table", "tables"),
            permission.force_n.get(),
            Untrusted(&permission.reason),
        );
    }
    let protocol = &loaded.protocol;
    out += &asked_of_devices(protocol);
    let by_hand = |m: &&ModelEntry| protocol.device_of(m) == DeviceKind::Manual;
    let samples = protocol.models.iter().filter(by_hand).count();
    if samples > 0 {
        out += &format!(
            "note: {} mounted by hand; `study device codes {}` lists what to write on them\n",
            counted(samples, "sample is", "samples are"),
            loaded.path.display()
        );
    }
    out
}
