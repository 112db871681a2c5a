//! `study analyze`

mod grim;
mod trials;

use super::include::{Who, include};
use super::progress::{self, shown};
use super::{Console, Failure, Kind, study_folder};
use rayon::prelude::*;
use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::{Better, Include, OrdinalEffort, Progress, Rules};
use study_analysis::study::{
    Analyzed, Options, Pool, Results, Study, analyze_factorial_table, analyze_table, check_factors,
    factor,
};
use study_base::text::Untrusted;
use study_plan::protocol::Factor;
use study_report::figures::Trace;
use study_report::html::Details;
use study_report::study::{self as report, Output};
use study_report::text::{Page, comments, confirms, page, part, preregistered};
use study_session::store::disk::{Disk as _, RealDisk};
use study_session::store::{self, StoreError, StudyFolder};

/// What the progress of an analysis counts.
const GROUPS: &str = "groups of statistics";

/// Arguments of `study analyze`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A results folder, one study in it, or a CSV: subject,model,rating[,repetition][,vaf][,trial_index][,role]
    #[arg(required_unless_present = "possible")]
    results: Vec<PathBuf>,
    /// One analysis of several sites, with site as a factor: --pool SITE-A SITE-B
    #[arg(long, conflicts_with_all = ["scale", "task"])]
    pool: bool,
    /// Check a published mean and SD (GRIM/GRIMMER): mean=4.800 sd=0.997 n=30 scale=1..7 [each=3]
    #[arg(
        long,
        num_args = 1..,
        value_name = "KEY=VALUE",
        conflicts_with_all = ["results", "out", "question", "scale", "direction", "include", "comments"]
    )]
    possible: Vec<String>,
    /// Print the results as one JSON document with unrounded numbers
    #[arg(long)]
    json: bool,
    /// Folder for tables, report.html and figures (default for a study: its analysis/)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Analyze this question instead of the protocol's primary one
    #[arg(long, value_name = "ID")]
    question: Option<String>,
    /// The scale of the ratings in a CSV, such as 1..7; ratings outside it are reported
    #[arg(long, value_name = "LOW..HIGH", value_parser = parse_scale, allow_hyphen_values = true)]
    scale: Option<(f64, f64)>,
    /// A factor of a CSV: its column and its levels in their order, such as friction=low,high; once for each
    #[arg(
        long = "factor",
        value_name = "NAME=LEVEL,LEVEL",
        value_parser = factor,
        conflicts_with_all = ["pool", "task"]
    )]
    factors: Vec<Factor>,
    /// Which ratings of a CSV are better
    #[arg(
        long,
        value_name = "WHICH",
        default_value = "higher",
        hide_default_value = true
    )]
    direction: Direction,
    /// Also include these sessions
    #[arg(long, value_name = "WHO", value_delimiter = ',')]
    include: Vec<Who>,
    /// Also compute posterior probabilities by an ordinal hierarchical model: a second opinion that decides nothing (seconds to minutes)
    #[arg(long, conflicts_with_all = ["pool", "task", "possible"])]
    posterior: bool,
    /// Print the comments by realization
    #[arg(long, conflicts_with = "json")]
    comments: bool,
    #[command(flatten, next_help_heading = "Thresholds and comparisons")]
    trials: trials::TrialArgs,
}

/// Which ratings are better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Direction {
    /// Higher ratings (the default)
    Higher,
    /// Lower ratings
    Lower,
}

impl From<Direction> for Better {
    fn from(given: Direction) -> Self {
        match given {
            Direction::Higher => Self::Higher,
            Direction::Lower => Self::Lower,
        }
    }
}

/// A text that is no scale.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("give two numbers, lowest first, such as 1..7")]
struct ScaleError;

/// Reads `1..7`.
fn parse_scale(given: &str) -> Result<(f64, f64), ScaleError> {
    let number = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    let ends = given
        .split_once("..")
        .and_then(|(low, high)| number(low).zip(number(high)));
    ends.filter(|(low, high)| low < high).ok_or(ScaleError)
}

/// Runs `study analyze`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    if args.pool {
        return of_sites(args, console);
    }
    let results = match &args.results[..] {
        [] => return grim::run(&args.possible, args.json, console),
        [one] => one,
        [..] => {
            return Err(Failure::usage("only one of RESULTS is analyzed at a time")
                .hint("--pool analyzes several sites of a study together"));
        }
    };
    if let Some(task) = &args.trials.task {
        if !results.is_file() {
            return Err(Failure::input(format!(
                "{}: --task is for a table of trials; a study states its own",
                results.display()
            )));
        }
        return trials::run(results, task, &args.trials, args.json, console);
    }
    if results.is_file() {
        return of_csv(results, args, console);
    }
    if args.scale.is_some() {
        return Err(Failure::input(
            "--scale is for a CSV: a protocol states its scale",
        ));
    }
    if args.direction == Direction::Lower {
        return Err(Failure::input(
            "--direction is for a CSV: in a study higher ratings are better",
        ));
    }
    if !args.factors.is_empty() {
        return Err(Failure::input(
            "--factor is for a CSV: a study states its factors in its protocol, as [[factors]]",
        ));
    }
    let studies = store::studies(results)?;
    if args.json && studies.len() > 1 {
        return Err(Failure::input(format!(
            "{}: {} studies, but --json prints only one",
            results.display(),
            studies.len()
        ))
        .hint(format!("name one, such as {}", studies[0].path().display())));
    }
    let several = studies.len() > 1;
    let mut truncated = Ok(());
    for (i, folder) in studies.into_iter().enumerate() {
        if i > 0 {
            console.out(format!("\n{}\n\n", "─".repeat(60)))?;
        }
        let study = Study::read(folder)?;
        of_study(&study, args, several, console)?;
        truncated = truncated.and(study_folder::whole(&study.folder, &study.sessions));
    }
    truncated
}

/// Analyzes one study of RESULTS.
fn of_study(
    study: &Study,
    args: &Args,
    several: bool,
    console: &mut Console,
) -> Result<(), Failure> {
    let place = Place::of(args, &study.folder, several);
    let analyzed = shown(GROUPS, |progress| {
        study.analyze(&args.options(Some(progress)))
    })?;
    // The page of ratings contains these warnings; if it is not shown on a terminal, they
    // are also printed to standard error.
    let on_page = analyzed.ratings().is_some() && console.terminal;
    if !on_page || args.json || args.comments {
        study_folder::warn(&study.folder, &analyzed.damage, console);
    }
    let details = report::details(study, &study.derived, &analyzed);
    // Telemetry is large: read it only if figures are written.
    let traces = match (analyzed.ratings(), &place.out) {
        (Some(analysis), Some(_)) => study.traces(analysis),
        _ => Vec::new(),
    };
    show(args, &analyzed, &details, &traces, place, console)
}

/// Analyzes several sites together.
fn of_sites(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let pool = Pool::open(&args.results)?;
    for study in pool.studies() {
        study_folder::warn(&study.folder, &study.damage()?, console);
        study_folder::whole(&study.folder, &study.sessions)?;
    }
    let analyzed = shown(GROUPS, |progress| {
        pool.analyze(&args.options(Some(progress)))
    })?;
    let first = pool.studies().next();
    let details = first.map_or_else(Details::default, |first| {
        report::details(first, &pool.derived(), &analyzed)
    });
    // Whose playbacks would be shown? The reports of the sites have theirs.
    show(args, &analyzed, &details, &[], Place::given(args), console)
}

/// Analyzes a table of ratings without a study.
fn of_csv(path: &Path, args: &Args, console: &mut Console) -> Result<(), Failure> {
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let length = file.metadata().map_or(0, |m| m.len());
    let input = BufReader::with_capacity(1 << 16, progress::Reader::new(file, length));
    let rules = Rules {
        include: args.include(),
        scale: args.scale,
        better: args.direction.into(),
        posterior: args.effort(),
        ..Rules::default()
    };
    check_factors(&args.factors).map_err(Failure::usage)?;
    let question = args.question.as_deref();
    let analyzed = shown(GROUPS, |progress| match &args.factors[..] {
        [] => analyze_table(path, input, question, &rules, Some(progress)),
        factors => analyze_factorial_table(path, input, factors, question, &rules, Some(progress)),
    })?;
    let details = Details {
        seed: Some(rules.seed),
        ..Details::default()
    };
    show(args, &analyzed, &details, &[], Place::given(args), console)
}

impl Args {
    fn include(&self) -> Include {
        include(&self.include)
    }

    fn effort(&self) -> Option<OrdinalEffort> {
        self.posterior.then_some(OrdinalEffort::ANALYSIS)
    }

    fn options<'a>(&'a self, progress: Option<&'a Progress>) -> Options<'a> {
        Options {
            question: self.question.as_deref(),
            include: self.include(),
            posterior: self.effort(),
            progress,
        }
    }
}

/// Where the analysis of a study is written.
struct Place {
    /// The folder; `None` if nothing is written.
    out: Option<PathBuf>,
    /// Why its own `analysis/` is not written.
    blocked: Option<StoreError>,
}

impl Place {
    fn of(args: &Args, study: &StudyFolder, several: bool) -> Self {
        let folder = study.path();
        let out = match &args.out {
            Some(out) if several => Some(out.join(folder.file_name().unwrap_or_default())),
            Some(out) => Some(out.clone()),
            None if args.json => None,
            None => Some(folder.join("analysis")),
        };
        let own = out.is_some() && args.out.is_none();
        let blocked = own.then(|| study.check_analysis().err()).flatten();
        Self {
            out: out.filter(|_| blocked.is_none()),
            blocked,
        }
    }

    /// Only where the user says.
    fn given(args: &Args) -> Self {
        Self {
            out: args.out.clone(),
            blocked: None,
        }
    }
}

/// Writes and prints an analysis.
fn show(
    args: &Args,
    analyzed: &Analyzed,
    details: &Details,
    traces: &[Trace],
    place: Place,
    console: &mut Console,
) -> Result<(), Failure> {
    let source = &analyzed.source;
    let answers = |parts: &[PartAnalysis]| parts.iter().any(|part| part.trials > 0);
    if analyzed.ratings().is_none() && !answers(analyzed.parts()) {
        return Err(Failure::input(format!(
            "{}: no answers that count",
            source.path
        )));
    }
    let written = place.out.as_deref().map(|dir| {
        let files = report::files(analyzed, details, traces);
        let files = files.map_err(|e| Failure::new(Kind::Bug, e));
        (dir, files.and_then(|files| write_files(dir, &files)))
    });
    let written = match written {
        // Writing to a folder that the user named must succeed.
        Some((_, Err(failure))) if args.out.is_some() => return Err(failure),
        other => other,
    };
    if args.json {
        console.document(report::document(analyzed))?;
    } else {
        print(args, analyzed, console)?;
        match written {
            Some((dir, Ok(()))) => {
                console.say(format!("report: {}", dir.join("report.html").display()));
            }
            Some((_, Err(failure))) => study_folder::tables_unwritten(&failure, console),
            None => {}
        }
    }
    if let Some(error) = place.blocked {
        study_folder::tables_unwritten(&error.into(), console);
    }
    Ok(())
}

/// The analysis on the terminal.
fn print(args: &Args, analyzed: &Analyzed, console: &mut Console) -> Result<(), Failure> {
    let source = &analyzed.source;
    let terminal = Page {
        width: console.width,
        color: console.color,
    };
    match &analyzed.results {
        Results::Ratings(analysis) if args.comments => {
            return console.out(comments(analysis, terminal));
        }
        Results::Ratings(analysis) => console.out(page(source, analysis, terminal))?,
        Results::Parts(_) => {
            if let Some(search) = &source.confirms {
                console.out(format!("{}\n", confirms(search, terminal)))?;
            }
        }
    }
    for analysis in analyzed.parts() {
        let title = format!("{}: {}", source.title, analysis.part.as_str());
        console.out(format!("{}\n", part(&title, analysis, terminal)))?;
    }
    match (&analyzed.results, &source.preregistration) {
        (Results::Parts(_), Some(found)) => console.out(preregistered(found, terminal)),
        _ => Ok(()),
    }
}

/// Creates a folder and its parents; only the owner can enter the new ones.
pub(super) fn private_folder(path: &Path) -> io::Result<()> {
    for folder in path.ancestors().collect::<Vec<_>>().into_iter().rev() {
        if !folder.as_os_str().is_empty() && !folder.exists() {
            match RealDisk.create_folder(folder) {
                Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(e),
                _ => {}
            }
        }
    }
    match path.is_dir() {
        true => Ok(()),
        false => Err(io::ErrorKind::NotADirectory.into()),
    }
}

/// Whether only the owner can read a file, as far as the system knows.
fn is_private(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        fs::metadata(path).is_ok_and(|known| known.permissions().mode() & 0o077 == 0)
    }
    #[cfg(not(unix))]
    {
        path.exists()
    }
}

/// Writes each file of a report atomically, unless it already has this content. Nothing is synced,
/// because all files can be regenerated. Only the owner can read them: they contain
/// single ratings and comments.
fn write_files(dir: &Path, files: &[Output]) -> Result<(), Failure> {
    let figures = dir.join("figures");
    // A link may lead to a folder that is not ours.
    if fs::symlink_metadata(&figures).is_ok_and(|m| m.is_symlink()) {
        return Err(Failure::input(format!(
            "{}: this is a symbolic link, and figures would be written to its target",
            Untrusted(&figures.display().to_string())
        ))
        .hint("remove the link, or choose another folder with --out"));
    }
    for item in [dir.to_owned(), figures] {
        private_folder(&item).map_err(|e| Failure::file(&item, &e))?;
    }
    files.par_iter().try_for_each(|output| {
        let path = dir.join(&output.name);
        if is_private(&path) && fs::read(&path).is_ok_and(|old| old == output.content) {
            return Ok(());
        }
        // A unique temporary name for each file and process.
        let part = dir.join(format!("{}.{}.part", output.name, std::process::id()));
        // Left by a process of the same number that died.
        let _ = fs::remove_file(&part);
        let written = RealDisk
            .create(&part)
            .and_then(|mut file| file.write_all(&output.content))
            .and_then(|()| fs::rename(&part, &path));
        written.map_err(|e| {
            // The first error is the one to report.
            let _ = fs::remove_file(&part);
            Failure::file(&path, &e)
        })
    })?;
    clear_figures(dir, files);
    Ok(())
}

/// Removes figures of an earlier analysis that this one did not write.
fn clear_figures(dir: &Path, files: &[Output]) {
    let Ok(items) = fs::read_dir(dir.join("figures")) else {
        return;
    };
    for item in items.flatten() {
        let name = item.file_name().to_string_lossy().into_owned();
        let path = format!("figures/{name}");
        if report::is_figure(&name) && !files.iter().any(|f| f.name == path) {
            // A remaining outdated figure is no reason to fail.
            let _ = fs::remove_file(item.path());
        }
    }
}
