//! `study power`: how many participants, realizations and repetitions?

mod assume;
mod procedures;
mod searches;
mod shards;
mod slurm;

use super::{Console, Failure};
use std::path::{Path, PathBuf};
use study_analysis::load;
use study_analysis::power::{CHUNK, Plan, Progress};
use study_base::text::Untrusted;
use study_report::picture::png::Painter;
use study_report::power::{Report, document, figure, head, results};
use study_report::text::Page;

/// Arguments of `study power`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Each rating is mean + participant + (slope + own slope) · VAF + realization + interaction + residual; \
                        docs/power.md explains the numbers."
)]
pub(super) struct Args {
    /// A protocol.toml or the folder that contains it
    #[arg(required_unless_present = "merge")]
    protocol: Option<PathBuf>,
    #[command(flatten)]
    assume: assume::Assume,
    #[command(flatten)]
    compare: procedures::Compare,
    #[command(flatten)]
    searches: searches::Searches,
    /// Print only the closed-form results, without simulation
    #[arg(long, conflicts_with_all = ["shards", "merge", "slurm"])]
    closed: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    /// Folder for power.json and figures, or for the files of --shard
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of threads (results do not depend on it)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Number of parts into which the work is divided; --shard chooses one
    #[arg(long, value_name = "N", requires = "shard", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    shards: Option<u64>,
    /// Index of the shard to compute, from 0; it is written to --out
    #[arg(long, value_name = "I", requires = "shards", requires = "out")]
    shard: Option<u64>,
    /// Merge the parts in a folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["shards", "slurm"])]
    merge: Option<PathBuf>,
    /// Merge even if parts are missing
    #[arg(long, requires = "merge")]
    partial: bool,
    /// Write scripts for a Slurm cluster into a folder; nothing is submitted
    #[arg(long, value_name = "DIR", conflicts_with = "shard")]
    slurm: Option<PathBuf>,
    /// Tasks of the Slurm array (default: one for each unit of work, at most 1000)
    #[arg(long, value_name = "N", requires = "slurm", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    tasks: Option<u64>,
}

/// What a unit of work is, for people.
fn unit(plan: &Plan) -> &'static str {
    match plan.settings.chunk() {
        CHUNK => "thousand studies",
        _ => "lots of studies",
    }
}

/// Works on so many threads, or on all, with a progress bar of units.
pub(super) fn on_threads<T: Send>(
    plan: &Plan,
    units: usize,
    threads: Option<u16>,
    work: impl FnOnce(Progress<'_>) -> T + Send,
) -> Result<T, Failure> {
    with_threads(unit(plan), units, threads, work)
}

/// The same of any units, whose plural is `unit`.
pub(super) fn with_threads<T: Send>(
    unit: &'static str,
    units: usize,
    threads: Option<u16>,
    work: impl FnOnce(Progress<'_>) -> T + Send,
) -> Result<T, Failure> {
    let bar = super::console::progress(units as u64, unit);
    let progress = || bar.inc(1);
    let found = match threads {
        None => work(&progress),
        Some(threads) => rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build()
            .map_err(Failure::input)?
            .install(|| work(&progress)),
    };
    bar.finish_and_clear();
    Ok(found)
}

/// Runs `study power`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let Some(path) = &args.protocol else {
        let Some(dir) = &args.merge else {
            return Err(Failure::usage("name a protocol"));
        };
        let again = shards::arguments(dir, args)?;
        return run(&again, console);
    };
    let loaded = load::load(path)?;
    if let Some(part) = searches::meant(&loaded.protocol, args)? {
        return searches::run(&loaded.protocol, part, args, console);
    }
    if args.compare.is_asked() {
        return procedures::run(&loaded.protocol, args, console);
    }
    let plan = assume::plan(&loaded.protocol, &args.assume, console)?;
    if args.closed && plan.settings.part.is_some() {
        return Err(Failure::usage(
            "--closed: pairs, tracks and effects of factors have no closed form",
        )
        .hint("leave it out; --studies sets how many are simulated"));
    }
    let page = Page {
        width: console.width,
        color: console.color,
    };
    let mut report = Report {
        title: loaded.protocol.study.title.clone(),
        study: loaded.protocol.study.id.clone(),
        wanted: args.compare.wanted(&plan)?,
        plan,
        results: Vec::new(),
        missing_units: 0,
    };
    let units = report.plan.units();
    if let (Some(of), Some(shard), Some(out)) = (args.shards, args.shard, &args.out) {
        return shards::run(
            &report.plan,
            &units,
            (shard, of),
            out,
            args.threads,
            console,
        );
    }
    if let Some(dir) = &args.slurm {
        return slurm::write(&report.plan, &units, dir, args.tasks, console);
    }
    if !args.json {
        console.out(head(&report, page))?;
    }
    if let Some(dir) = &args.merge {
        let chunks = shards::read(&report.plan, &units, dir, args.partial)?;
        report.missing_units = chunks.iter().filter(|c| c.is_none()).count();
        report.results = report.plan.results(&units, &chunks);
    } else if !args.closed {
        let plan = &report.plan;
        let work = |progress: Progress<'_>| plan.simulate_designs(&units, progress);
        let chunks = on_threads(plan, units.len(), args.threads, work)?;
        report.results = plan.results(&units, &chunks);
    }
    if let Some(out) = &args.out {
        write(out, &report)?;
    }
    if args.json {
        return console.json(&document(&report));
    }
    console.out(results(&report, page))
}

/// Writes the document and the figure.
fn write(out: &Path, report: &Report) -> Result<(), Failure> {
    let made = std::fs::create_dir_all(out);
    made.map_err(|e| Failure::file(out, &e))?;
    let text = study_base::text::escaped_json(&format!("{:#}\n", document(report))).to_string();
    let mut files = vec![("power.json", text.into_bytes())];
    if let Some(figure) = figure(report) {
        let picture = figure.picture();
        let png = Painter::default().png(&picture);
        files.push(("power.svg", picture.to_svg().into_bytes()));
        files.push(("power.pdf", picture.to_pdf()));
        files.push((
            "power.png",
            png.map_err(|e| Failure::new(super::Kind::Bug, e))?,
        ));
    }
    for (name, content) in files {
        replace(&out.join(name), &content)?;
    }
    Ok(())
}

/// Writes a file under another name first.
pub(super) fn replace(path: &Path, content: &[u8]) -> Result<(), Failure> {
    let part = path.with_extension(format!("{}.part", std::process::id()));
    let written = std::fs::write(&part, content).and_then(|()| std::fs::rename(&part, path));
    written.map_err(|e| {
        // The first error is the one to report.
        let _ = std::fs::remove_file(&part);
        Failure::file(path, &e)
    })
}

/// A path for messages.
fn shown(path: &Path) -> String {
    Untrusted(&path.display().to_string()).to_string()
}
