//! `study preregister`: what a study states before its first session.

use super::power::{simulate, units_of};
use super::{Console, Failure};
use chrono::NaiveDate;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use study_analysis::analyze::{Include, Rules};
use study_analysis::load;
use study_analysis::power::{Overrides, Plan, merge};
use study_analysis::preregister::{
    FILE, FORMAT, Preregistration, complete_parts, complete_study, deciding,
};
use study_analysis::study::{describe_realizations, is_rated};
use study_base::text::{Untrusted, escaped_json};
use study_plan::protocol::Protocol;
use study_plan::protocol::power::PowerPlan;
use study_report::power::{self as power_report, Report};
use study_report::preregistration::{self as document, Content};
use study_report::study::track_in_words;

/// The document for people.
const MARKDOWN: &str = "preregistration.md";

/// Arguments of `study preregister`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "`study run` freezes the document with the protocol, and the report compares."
)]
pub(super) struct Args {
    /// A protocol.toml or the folder that holds one
    protocol: PathBuf,
    /// Planned participants (default: those of the protocol)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    participants: Option<u32>,
    /// The day of the document (default: today)
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<NaiveDate>,
    /// Simulated studies for the power
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(100..=10_000_000))]
    studies: Option<u64>,
    /// Folder for preregistration.md and preregistration.json (default: that of the protocol)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Runs `study preregister`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mut loaded = load::load(&args.protocol)?;
    let n = (args.participants).unwrap_or(loaded.protocol.design.participants);
    loaded.protocol.design.participants = n;
    loaded.parts.analysis["participants"] = json!(n);
    let protocol = &loaded.protocol;
    let question = protocol.analysis.primary.clone();
    let mut ratings = complete_study(protocol, &question, n);
    describe_realizations(&mut ratings, &loaded);
    if !is_rated(protocol) {
        ratings = ratings.keep(|_| false);
    }
    let rules = Rules::of(protocol, question.as_str(), Include::default());
    let analysis = study_analysis::analyze::analyze(&ratings, &rules);
    let parts = complete_parts(protocol, n);
    let (power, sentences) = power(protocol, args.studies)?;
    let facts = Preregistration {
        format: FORMAT.to_owned(),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        date: (args.date).unwrap_or_else(|| super::study_folder::now().wall.date_naive()),
        study: protocol.study.id.clone(),
        participants: n,
        question,
        tests: deciding(Some(&analysis), &parts),
        power,
        fingerprints: loaded.parts.fingerprints(),
        protocol: loaded.parts.clone(),
        sha256: String::new(),
    }
    .sealed();
    let text = document::markdown(&Content {
        document: &facts,
        protocol,
        analysis: &analysis,
        parts: &parts,
        tracks: protocol
            .tracks
            .iter()
            .map(|track| track_in_words(protocol, track))
            .collect(),
        power: sentences,
    });
    let value = serde_json::to_value(&facts).map_err(|e| Failure::new(super::Kind::Bug, e))?;
    let facts_text = escaped_json(&format!("{value:#}\n")).to_string();
    let folder = args.out.as_deref().unwrap_or(&loaded.folder);
    fs::create_dir_all(folder).map_err(|e| Failure::file(folder, &e))?;
    let files = [(MARKDOWN, text), (FILE, facts_text)];
    for (name, content) in &files {
        unchanged(&folder.join(name), content)?;
    }
    for (name, content) in &files {
        super::power::replace(&folder.join(name), content.as_bytes())?;
    }
    console.say(format!("written: {}", shown(&folder.join(MARKDOWN))));
    console.out(format!("{}\n", facts.sha256))
}

fn shown(path: &Path) -> String {
    Untrusted(&path.display().to_string()).to_string()
}

/// A document is not replaced by another one: it may have been registered.
fn unchanged(path: &Path, content: &str) -> Result<(), Failure> {
    match fs::read_to_string(path) {
        Ok(there) if there != content => Err(Failure::input(format!(
            "{}: there is another document already",
            shown(path)
        ))
        .hint("delete it if it was not registered, or choose another folder with --out")),
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Failure::file(path, &e)),
        _ => Ok(()),
    }
}

/// Power of the planned design, as facts and in sentences; why there is none otherwise.
fn power(protocol: &Protocol, studies: Option<u64>) -> Result<(Value, Vec<String>), Failure> {
    let own = PowerPlan {
        studies,
        ..PowerPlan::default()
    };
    let flags = Overrides {
        plan: own,
        ..Overrides::default()
    };
    let mut plan = match Plan::of(protocol, &flags) {
        Ok(plan) => plan,
        Err(why) => {
            let sentence = format!("Power was not computed: {why}.");
            return Ok((
                json!({ "undefined_because": why.to_string() }),
                vec![sentence],
            ));
        }
    };
    plan.grid = vec![plan.own];
    let units = units_of(&plan, &[plan.own]);
    let chunks = simulate(&plan, &units, None)?;
    let results = merge(&plan.settings, plan.own, &chunks);
    let report = Report {
        title: protocol.study.title.clone(),
        study: protocol.study.id.clone(),
        plan,
        results: results.into_iter().collect(),
        missing_units: 0,
    };
    Ok((power_report::own_design(&report), document::power(&report)))
}
