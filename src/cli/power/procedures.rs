//! Procedures of tracks beside each other.

use super::{Args, Console, Failure, assume, on_threads, replace};
use study_analysis::power::{PartWorld, Plan, Progress, alternatives};
use study_plan::protocol::Protocol;
use study_plan::protocol::procedures::Procedure;
use study_report::power::{About, Compared, Report, Wanted, compared, compared_document, head};
use study_report::text::Page;

/// What is compared.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Thresholds")]
pub(super) struct Compare {
    /// Procedures to compare by what a minute tells: own, staircase, quest+, constant
    #[arg(long, value_name = "RULE,…", value_delimiter = ',', value_parser = procedure, conflicts_with_all = ["closed", "shards", "merge", "slurm"])]
    procedure: Vec<Procedure>,
    /// Numbers of trials of each track, or of answers of a search, to compare
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(5..=10_000), conflicts_with_all = ["closed", "shards", "merge", "slurm"])]
    trials: Vec<u32>,
    /// Precision that is wanted, half the 95 % interval: participant=1.5, mean=1.2, contrast=1.3 as
    /// factors, of a blend in levels
    #[arg(long, value_name = "WHAT=X", value_delimiter = ',', value_parser = wanted)]
    precision: Vec<Wanted>,
}

fn procedure(text: &str) -> Result<Procedure, String> {
    let found = Procedure::ALL.into_iter().find(|p| p.as_str() == text);
    found.ok_or_else(|| "write own, staircase, quest+ or constant".to_owned())
}

fn wanted(text: &str) -> Result<Wanted, String> {
    let expected = || "write participant=1.5, mean=1.2 or contrast=1.3".to_owned();
    let (name, within) = text.split_once('=').ok_or_else(expected)?;
    let about = About::ALL.into_iter().find(|a| a.1 == name.trim());
    let within: Option<f64> = within
        .trim()
        .parse()
        .ok()
        .filter(|x: &f64| x.is_finite() && *x > 0.0);
    match (about, within) {
        (Some((about, _)), Some(within)) => Ok(Wanted { about, within }),
        _ => Err(expected()),
    }
}

impl Compare {
    /// Whether procedures or numbers of trials are compared.
    pub(super) fn is_asked(&self) -> bool {
        !self.procedure.is_empty() || !self.trials.is_empty()
    }

    /// Whether something is asked that only tracks have.
    pub(super) fn is_of_tracks(&self) -> bool {
        !self.procedure.is_empty() || !self.precision.is_empty()
    }

    /// Numbers of trials.
    pub(super) fn trials(&self) -> &[u32] {
        &self.trials
    }

    /// The precisions that are wanted of a plan.
    pub(super) fn wanted(&self, plan: &Plan) -> Result<Vec<Wanted>, Failure> {
        let ratios = match &plan.settings.part {
            Some(PartWorld::Tracks(tracks)) => Some(tracks.ratios),
            _ => None,
        };
        match ratios {
            None if !self.precision.is_empty() => Err(Failure::usage(
                "--precision is of thresholds: this study has no tracks, or --part names another part",
            )),
            Some(true) if self.precision.iter().any(|w| w.within <= 1.0) => Err(Failure::usage(
                "--precision: where levels have ratios it is a factor above 1, such as 1.2",
            )),
            _ => Ok(self.precision.clone()),
        }
    }
}

/// Simulates each procedure with each number of trials.
pub(super) fn run(protocol: &Protocol, args: &Args, console: &mut Console) -> Result<(), Failure> {
    let own = [Procedure::Own];
    let procedures = match args.compare.procedure.as_slice() {
        [] => &own[..],
        given => given,
    };
    let mut flags = assume::overrides(protocol, &args.assume, console)?;
    if flags.plan.participants.is_empty() && protocol.power.participants.is_empty() {
        // Each design takes long: no others than that of the protocol, unless they are asked for.
        flags.plan.participants = vec![protocol.design.participants.max(2)];
    }
    let found = alternatives(protocol, &flags, procedures, &args.compare.trials);
    let found = found.map_err(|error| assume::failure(&error))?;
    let page = Page {
        width: console.width,
        color: console.color,
    };
    let mut all: Vec<Compared> = Vec::new();
    for alternative in found {
        let mut report = Report {
            title: protocol.study.title.clone(),
            study: protocol.study.id.clone(),
            wanted: args.compare.wanted(&alternative.plan)?,
            plan: alternative.plan.clone(),
            results: Vec::new(),
            missing_units: 0,
        };
        if all.is_empty() && !args.json {
            console.out(head(&report, page))?;
        }
        let plan = &report.plan;
        let units = plan.units();
        let work = |progress: Progress<'_>| plan.simulate_designs(&units, progress);
        let chunks = on_threads(plan, units.len(), args.threads, work)?;
        report.results = plan.results(&units, &chunks);
        all.push(Compared {
            alternative,
            report,
        });
    }
    let document = compared_document(&all, &args.compare.precision);
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).map_err(|e| Failure::file(out, &e))?;
        let text = study_base::text::escaped_json(&format!("{document:#}\n")).to_string();
        replace(&out.join("procedures.json"), text.as_bytes())?;
    }
    if args.json {
        return console.json(&document);
    }
    console.out(compared(&all, &args.compare.precision, page))
}
