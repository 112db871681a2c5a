//! How many answers a search needs.

use super::{Args, Console, Failure, assume, replace, with_threads};
use study_analysis::power::{Progress, SearchAsked, SearchPlan};
use study_plan::protocol::{Part, Protocol};
use study_report::power::{SearchReport, search_document, search_page};
use study_report::text::Page;

/// What is asked of a search.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Searches")]
pub(super) struct Searches {
    /// Searches: the difference of utilities that is just noticed, in units of the noise of one impression (default: 0.95, the
    /// better of two is preferred in 75 %)
    #[arg(long, value_name = "D", value_parser = assume::positive, conflicts_with_all = ["closed", "shards", "merge", "slurm"])]
    jnd: Option<f64>,
    /// Searches: the utility of the best point, where the worst has about 0, in the same units (default: 4)
    #[arg(long, value_name = "U", value_parser = assume::positive, conflicts_with_all = ["closed", "shards", "merge", "slurm"])]
    best: Option<f64>,
}

impl Searches {
    fn is_asked(&self) -> bool {
        self.jnd.is_some() || self.best.is_some()
    }
}

/// The part that is meant, if it searches.
///
/// # Errors
/// [`Failure`] if something is asked that only searches have, or only other parts.
pub(super) fn meant<'p>(protocol: &'p Protocol, args: &Args) -> Result<Option<&'p Part>, Failure> {
    let part = SearchPlan::meant(protocol, args.assume.part());
    if part.is_none() && args.searches.is_asked() {
        return Err(Failure::usage(
            "--jnd and --best are of searches: the primary question is not that of one, and --part names none",
        ));
    }
    let others =
        args.closed || args.shards.is_some() || args.slurm.is_some() || args.merge.is_some();
    if part.is_some() && (others || args.compare.is_of_tracks()) {
        return Err(Failure::usage(
            "--closed, --shards, --merge, --slurm, --procedure and --precision do not apply to a search",
        )
        .hint("--trials compares numbers of answers, --studies sets how many perceivers are simulated"));
    }
    Ok(part)
}

/// Simulates the perceivers.
pub(super) fn run(
    protocol: &Protocol,
    part: &Part,
    args: &Args,
    console: &mut Console,
) -> Result<(), Failure> {
    let flags = assume::overrides(protocol, &args.assume, console)?;
    let asked = SearchAsked {
        jnd: args.searches.jnd,
        best: args.searches.best,
        after: args.compare.trials().to_vec(),
    };
    let plan = SearchPlan::of(protocol, part, &flags, &asked);
    let plan = plan.map_err(|error| assume::failure(&error))?;
    let work = |progress: Progress<'_>| plan.simulate(progress);
    let results = with_threads("searches", plan.searches(), args.threads, work)?;
    let report = SearchReport {
        title: protocol.study.title.clone(),
        study: protocol.study.id.clone(),
        plan,
        results,
    };
    let document = search_document(&report);
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).map_err(|e| Failure::file(out, &e))?;
        let text = study_base::text::escaped_json(&format!("{document:#}\n")).to_string();
        replace(&out.join("search.json"), text.as_bytes())?;
    }
    if args.json {
        return console.json(&document);
    }
    let page = Page {
        width: console.width,
        color: console.color,
    };
    console.out(search_page(&report, page))
}
