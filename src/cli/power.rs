//! `study power`: how many participants, realizations and repetitions?

mod assume;
mod shards;
mod slurm;

use super::{Console, Failure};
use indicatif::ProgressBar;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use study_analysis::load;
use study_analysis::power::{CHUNK, Cell, CellResult, Chunk, Plan, enough, merge, run_chunk};
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
    /// Only the closed forms, at once
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
    /// Divide the work into this many parts, of which --shard is done
    #[arg(long, value_name = "N", requires = "shard", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    shards: Option<u64>,
    /// Index of the shard to compute, from 0; it is written to --out
    #[arg(long, value_name = "I", requires = "shards", requires = "out")]
    shard: Option<u64>,
    /// Merge the parts in a folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["shards", "slurm"])]
    merge: Option<PathBuf>,
    /// Merge although parts are missing
    #[arg(long, requires = "merge")]
    partial: bool,
    /// Write scripts for a Slurm cluster into a folder; nothing is submitted
    #[arg(long, value_name = "DIR", conflicts_with = "shard")]
    slurm: Option<PathBuf>,
    /// Tasks of the Slurm array (default: one for each unit of work, at most 1000)
    #[arg(long, value_name = "N", requires = "slurm", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    tasks: Option<u64>,
}

/// A cell and one of its chunks.
pub(super) type Unit = (Cell, u64);

/// All units of work, in order.
fn units(plan: &Plan) -> Vec<Unit> {
    units_of(plan, &plan.cells())
}

/// The units of some cells.
pub(super) fn units_of(plan: &Plan, cells: &[Cell]) -> Vec<Unit> {
    let chunks = plan.settings.chunks();
    (cells.iter().copied())
        .flat_map(|cell| (0..chunks).map(move |chunk| (cell, chunk)))
        .collect()
}

/// What a unit of work is, for people.
fn unit(plan: &Plan) -> &'static str {
    match plan.settings.chunk() {
        CHUNK => "thousand studies",
        _ => "lots of studies",
    }
}

/// Runs units on all threads, with a progress bar; the results are in their order.
pub(super) fn simulate(
    plan: &Plan,
    units: &[Unit],
    threads: Option<u16>,
) -> Result<Vec<Chunk>, Failure> {
    let bar = super::console::progress(units.len() as u64, unit(plan));
    let found = simulate_with(plan, units, threads, &bar);
    bar.finish_and_clear();
    found
}

fn simulate_with(
    plan: &Plan,
    units: &[Unit],
    threads: Option<u16>,
    bar: &ProgressBar,
) -> Result<Vec<Chunk>, Failure> {
    let work = || {
        (units.par_iter().with_max_len(1))
            .map(|(cell, chunk)| {
                let found = run_chunk(&plan.settings, cell, *chunk);
                bar.inc(1);
                found
            })
            .collect()
    };
    let found = match threads {
        None => work(),
        Some(threads) => rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build()
            .map_err(Failure::input)?
            .install(work),
    };
    Ok(found)
}

/// Simulates all cells, each until its interval is narrow enough or it has all its studies.
/// The chunks of a unit that was not needed are missing. One chunk of each open cell is done
/// at a time, so that threads decide nothing.
fn simulate_until(
    plan: &Plan,
    units: &[Unit],
    within: f64,
    threads: Option<u16>,
) -> Result<Vec<Option<Chunk>>, Failure> {
    let bar = super::console::progress(units.len() as u64, unit(plan));
    let mut found: Vec<Option<Chunk>> = vec![None; units.len()];
    for index in 0..plan.settings.chunks() {
        let mut places = Vec::new();
        let mut start = 0;
        for same in units.chunk_by(|a, b| a.0 == b.0) {
            let done = found[start..start + same.len()].iter().flatten();
            if !enough(done, within).1 {
                places.push(start + index as usize);
            }
            start += same.len();
        }
        let open: Vec<Unit> = places.iter().map(|at| units[*at]).collect();
        let chunks = simulate_with(plan, &open, threads, &bar)?;
        for (at, chunk) in places.into_iter().zip(chunks) {
            found[at] = Some(chunk);
        }
    }
    bar.finish_and_clear();
    Ok(found)
}

/// The results of the cells whose chunks are there.
fn merged(plan: &Plan, units: &[Unit], chunks: &[Option<Chunk>]) -> Vec<CellResult> {
    let mut found = Vec::new();
    let mut start = 0;
    for same in units.chunk_by(|a, b| a.0 == b.0) {
        let own = chunks[start..start + same.len()].iter().flatten();
        let needed = plan
            .within
            .map_or(usize::MAX, |within| enough(own.clone(), within).0);
        found.extend(merge(&plan.settings, same[0].0, own.take(needed)));
        start += same.len();
    }
    found
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
    let plan = assume::plan(&loaded.protocol, &args.assume, console)?;
    if args.closed && plan.part.is_some() {
        return Err(
            Failure::usage("--closed: a part of pairs or tracks has no closed form")
                .hint("leave it out; --studies sets how many are simulated"),
        );
    }
    let page = Page {
        width: console.width,
        color: console.color,
    };
    let mut report = Report {
        title: loaded.protocol.study.title.clone(),
        study: loaded.protocol.study.id.clone(),
        plan,
        results: Vec::new(),
        missing_units: 0,
    };
    let units = units(&report.plan);
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
        report.results = merged(&report.plan, &units, &chunks);
    } else if !args.closed {
        let chunks: Vec<Option<Chunk>> = match report.plan.within {
            Some(within) => simulate_until(&report.plan, &units, within, args.threads)?,
            None => {
                let chunks = simulate(&report.plan, &units, args.threads)?;
                chunks.into_iter().map(Some).collect()
            }
        };
        report.results = merged(&report.plan, &units, &chunks);
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
