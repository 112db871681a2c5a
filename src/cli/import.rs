//! `study import`: measurements of other instruments as recordings, results of other programs as tables.

mod table;

use super::trajectory::{refuse_to_overwrite, write_file};
use super::{Console, Failure};
use std::fs;
use std::path::{Path, PathBuf};
use study_base::hex::sha256;
use study_base::text::counted;
use study_haptics::recording::force_curve::{
    self as curve, LEAST_RATE_HZ, MOST_RATE_HZ, Source, Stated, USUAL_RATE_HZ,
};

/// A longer press is likelier a time in ms, s.
const LONG_S: f64 = 1800.0;

/// A weaker switch is likelier a force in another unit than was assumed, N.
const WEAK_N: f64 = 0.05;

/// Arguments of `study import`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Displacement and force of a slow press and release: the files of a force tester, or columns force and displacement
    #[command(name = "force-curve")]
    ForceCurve(Box<ForceCurve>),
    /// Ratings, trials or comparisons of PsychoPy, jsPsych, OpenSesame or a spreadsheet, as a table that study analyze reads
    Table(Box<table::Args>),
}

#[derive(Debug, clap::Args)]
struct ForceCurve {
    /// The curves: repeated measurements of one target, or several speeds, become one recording
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,

    /// Write the recording to this file
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,

    /// What was measured [default: the column name of the first file]
    #[arg(long, value_name = "TEXT")]
    target: Option<String>,

    /// With which instrument, and by whom
    #[arg(long, value_name = "TEXT")]
    instrument: Option<String>,

    /// Whom to credit
    #[arg(long, value_name = "TEXT")]
    credit: Option<String>,

    /// Terms of use, such as CC-BY-4.0
    #[arg(long, value_name = "TEXT")]
    license: Option<String>,

    /// Rows a second of files without a time [default: 10]
    #[arg(long, value_name = "HZ", value_parser = rate, allow_negative_numbers = true)]
    rate: Option<f64>,

    /// Write the names of the files into the recording, as version 0.2 did: it is another recording then if they have other names
    #[arg(long)]
    file_names: bool,

    /// Accept a target that supplies energy: without this flag it is refused, because most likely the file is wrong
    #[arg(long)]
    active: bool,

    /// Overwrite OUT if it exists
    #[arg(long)]
    force: bool,
}

fn rate(given: &str) -> Result<f64, String> {
    let rate = given.trim().parse().ok();
    rate.filter(|hz: &f64| (LEAST_RATE_HZ..=MOST_RATE_HZ).contains(hz))
        .ok_or_else(|| format!("a rate is a number from {LEAST_RATE_HZ} to {MOST_RATE_HZ} Hz"))
}

/// A measurement cannot be made again.
fn refuse_to_replace_an_input(files: &[PathBuf], out: &Path) -> Result<(), Failure> {
    let same = |file: &&PathBuf| match (fs::canonicalize(file), fs::canonicalize(out)) {
        (Ok(file), Ok(out)) => file == out,
        _ => false,
    };
    match files.iter().find(same) {
        Some(file) => Err(Failure::input(format!(
            "{} is one of the measurements, which would be lost",
            file.display()
        ))
        .hint("write to another file; nothing was written")),
        None => Ok(()),
    }
}

/// Runs a subcommand of `study import`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    match &args.what {
        What::ForceCurve(args) => force_curve(args, console),
        What::Table(args) => table::run(args, console),
    }
}

/// Reads the files and writes the recording.
fn force_curve(args: &ForceCurve, console: &mut Console) -> Result<(), Failure> {
    refuse_to_overwrite(Some(&args.out), args.force)?;
    refuse_to_replace_an_input(&args.files, &args.out)?;
    let mut curves = Vec::new();
    for path in &args.files {
        let bytes = fs::read(path).map_err(|e| Failure::file(path, &e))?;
        let curve = curve::read(&String::from_utf8_lossy(&bytes))
            .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
        if let Err(wrong) = curve.passive()
            && !args.active
        {
            return Err(Failure::input(format!("{}: {wrong}", path.display())).hint(
                "nothing was written; --active accepts a target that has a drive of its own",
            ));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let (rows, layout) = (curve.x_mm.len(), curve.layout.as_str());
        let rate = match curve.rate_hz {
            Some(hz) => format!("{hz:.3} rows a second, {:.1} s in all", rows as f64 / hz),
            None => format!(
                "no time: {} rows a second assumed",
                args.rate.unwrap_or(USUAL_RATE_HZ)
            ),
        };
        console.say(format!("{}: {layout}, {rows} rows, {rate}", path.display()));
        if !curve.assumed.is_empty() {
            console.say(format!(
                "note: {}: {} assumed; the names of the columns can say it, such as `force_n`",
                path.display(),
                curve.assumed.join(" and ")
            ));
        }
        if curve.release_first {
            console.say(format!(
                "note: {}: the file begins at the bottom; its press was put before its release",
                path.display()
            ));
        }
        let most_n = curve.f_n.iter().fold(0.0, |most: f64, n| most.max(n.abs()));
        if !curve.assumed.is_empty() && most_n < WEAK_N {
            console.say(format!(
                "warning: {}: the force is {most_n:.4} N at most, less than of any switch: if the column is in N, call it `force_n`",
                path.display()
            ));
        }
        if let Some(hz) = curve.rate_hz.filter(|hz| rows as f64 / hz > LONG_S) {
            console.say(format!(
                "warning: {}: by its column of the time the curve took {:.1} h; if that is in ms, call it time_ms",
                path.display(),
                rows as f64 / hz / 3600.0
            ));
        }
        curves.push((curve, name.into_owned(), sha256(&bytes)));
    }
    for (i, (_, name, hash)) in curves.iter().enumerate() {
        if let Some((_, before, _)) = curves[..i].iter().find(|(.., other)| other == hash) {
            return Err(
                Failure::input(format!("{before} and {name} are the same measurement"))
                    .hint("give every file once: a copy is no repetition"),
            );
        }
    }
    let sources: Vec<Source<'_>> = (curves.iter())
        .map(|(curve, file, sha256)| Source {
            curve,
            file,
            sha256,
        })
        .collect();
    for doubt in curve::unlike(&sources) {
        console.say(format!("warning: {doubt}"));
    }
    let stated = Stated {
        target: args.target.as_deref(),
        instrument: args.instrument.as_deref(),
        credit: args.credit.as_deref(),
        license: args.license.as_deref(),
        rate_hz: args.rate,
        file_names: args.file_names,
    };
    let recording = curve::join(&sources, stated);
    write_file(&args.out, |sink| sink.write_all(&recording))?;
    let number = counted(sources.len(), "curve", "curves");
    console.say(format!("wrote {number} to {}", args.out.display()));
    Ok(())
}
