//! `study analyze`

mod grim;
mod parts;
mod pool;
mod preregistration;
mod progress;
mod report;
mod trials;

pub(in crate::cli) use parts::of_track;

use super::load::Loaded;
use super::{Console, Failure, study_folder};
use crate::report::figures::Trace;
use crate::report::html::Details;
use crate::report::text::{Page, comments, page};
use crate::report::{Source, csv, json, wide};
use rayon::prelude::*;
use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use study_base::text::{QuestionId, Untrusted};
use study_core::analyze::{self, Analysis, Better, Deviation, Include, Rules, Warning};
use study_core::outcome::RatingRow;
use study_core::outcome::ratings::Ratings;
use study_core::protocol::{Protocol, Task};
use study_core::store::disk::{Disk as _, RealDisk};
use study_core::store::{Derived, StoreError, StudyFolder};

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
    /// Analyse this question instead of the protocol's primary one
    #[arg(long, value_name = "ID")]
    question: Option<String>,
    /// The scale of the ratings in a CSV, such as 1..7; ratings outside it are reported
    #[arg(long, value_name = "LOW..HIGH", value_parser = parse_scale, allow_hyphen_values = true)]
    scale: Option<(f64, f64)>,
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
    /// Print the comments by realization
    #[arg(long, conflicts_with = "json")]
    comments: bool,
    #[command(flatten, next_help_heading = "Thresholds and comparisons")]
    trials: trials::TrialArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Who {
    Pilot,
    Simulated,
}

/// Which ratings are better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Direction {
    /// Higher ratings, unless said otherwise
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
        let input = pool::analysed(&args.results, args, console)?;
        return show(args, &input, args.out.as_deref(), console);
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
        let input = of_csv(results, args)?;
        return show(args, &input, args.out.as_deref(), console);
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
    let studies = study_folder::studies(results)?;
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
    for (i, study) in studies.iter().enumerate() {
        if i > 0 {
            console.out(format!("\n{}\n\n", "─".repeat(60)))?;
        }
        let sessions = study.sessions()?;
        let loaded = study_folder::frozen(study)?;
        let derived = Derived::of(&sessions, &loaded.protocol);
        let is_real = |row: &RatingRow| !row.pilot && !row.simulated;
        let pilots = derived.rows.iter().any(|row| row.pilot) && !include(args).pilot;
        if pilots && !derived.rows.iter().any(is_real) {
            return Err(only_pilots(study));
        }
        let place = Place::of(args, study, several);
        let parts = parts::analyse(&sessions, &derived, &loaded.protocol, args);
        // Estimates of magnitudes are no ratings, though they are numbers.
        let primary = Some(&loaded.protocol.analysis.primary);
        let estimated = (loaded.protocol.parts.iter())
            .any(|p| matches!(p.task, Task::Magnitude(_)) && p.asks.first() == primary);
        let unrated = estimated || question(&loaded.protocol, None).is_err();
        if !parts.is_empty() && args.question.is_none() && unrated {
            let damage = study_folder::warnings(study, &sessions, Some(&loaded))?;
            study_folder::warn(study, &damage, console);
            let who = &derived.participants;
            let source = Source {
                preregistration: preregistration::of_parts(study, &sessions, &loaded, who, &parts)?,
                ..source_of(study, &loaded.protocol)
            };
            let details = Details {
                parts: parts::reports(&loaded.protocol, &parts),
                damage,
                ..report::details(&loaded.protocol, study, &derived, "")
            };
            parts::show(&source, &details, &parts, args, place, console)?;
            truncated = truncated.and(study_folder::whole(study, &sessions));
            continue;
        }
        let (input, damage) = rayon::join(
            || of_study(study, &derived, &loaded, args),
            || study_folder::warnings(study, &sessions, Some(&loaded)),
        );
        let (mut input, damage) = (input?, damage?);
        input.details.parts = parts::reports(&loaded.protocol, &parts);
        input.analysis.parts = parts;
        preregistration::add(study, &sessions, &loaded, &mut input)?;
        // The page contains these warnings; if it is not shown on a terminal, they are
        // also printed to standard error.
        if !console.terminal || args.json || args.comments {
            study_folder::warn(study, &damage, console);
        }
        let damage = damage.into_iter().map(|text| Warning {
            code: "damaged-results",
            text: format!("{text} (see `study verify`)"),
        });
        // Before all other warnings.
        input.analysis.warnings.splice(0..0, damage);
        show(args, &input, place.out.as_deref(), console)?;
        if let Some(error) = place.blocked {
            study_folder::tables_unwritten(&error.into(), console);
        }
        truncated = truncated.and(study_folder::whole(study, &sessions));
    }
    truncated
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
}

/// Pilots alone are analyzed only on request.
fn only_pilots(study: &StudyFolder) -> Failure {
    let path = study.path().display();
    Failure::input(format!("{path}: holds only pilots so far")).hint(format!(
        "`study analyze {path} --include pilot` analyzes them"
    ))
}

/// An analysis with everything its report needs.
struct Analysed {
    source: Source,
    details: Details,
    traces: Vec<Trace>,
    analysis: Analysis,
}

fn show(
    args: &Args,
    analysed: &Analysed,
    out: Option<&Path>,
    console: &mut Console,
) -> Result<(), Failure> {
    let Analysed {
        source, analysis, ..
    } = analysed;
    let written = out.map(|dir| (dir, write_all(dir, analysed)));
    let written = match written {
        // Writing to a folder that the user named must succeed.
        Some((_, Err(failure))) if args.out.is_some() => return Err(failure),
        other => other,
    };
    if args.json {
        return console.document(json::document(source, analysis));
    }
    let terminal = Page {
        width: console.width,
        colour: console.colour,
    };
    if args.comments {
        console.out(comments(analysis, terminal))?;
    } else {
        console.out(page(source, analysis, terminal))?;
        parts::pages(&source.title, &analysis.parts, console)?;
    }
    match written {
        Some((dir, Ok(()))) => {
            console.say(format!("report: {}", dir.join("report.html").display()));
        }
        Some((_, Err(failure))) => study_folder::tables_unwritten(&failure, console),
        None => {}
    }
    Ok(())
}

/// Writes tables, report and figures.
fn write_all(dir: &Path, analysed: &Analysed) -> Result<(), Failure> {
    let Analysed {
        source,
        details,
        traces,
        analysis,
    } = analysed;
    let tables = (csv::tables(source, analysis).into_iter()).chain([wide::file(analysis)]);
    let mut files: Vec<report::Output> = tables.map(report::Output::table).collect();
    files.extend(report::files(source, details, analysis, traces)?);
    write_files(dir, &files)?;
    report::clear_figures(dir, &files);
    Ok(())
}

fn include(args: &Args) -> Include {
    Include {
        pilot: args.include.contains(&Who::Pilot),
        simulated: args.include.contains(&Who::Simulated),
    }
}

/// Analyzes a table of ratings without a study.
fn of_csv(path: &Path, args: &Args) -> Result<Analysed, Failure> {
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let name = path.display().to_string();
    let length = file.metadata().map_or(0, |m| m.len());
    let input = BufReader::with_capacity(1 << 16, progress::Reader::new(file, length));
    let ratings =
        Ratings::read_csv(&name, input, args.question.as_deref()).map_err(Failure::input)?;
    let rules = Rules {
        include: include(args),
        scale: args.scale,
        better: args.direction.into(),
        ..Rules::default()
    };
    let title = path.file_name().unwrap_or_default().to_string_lossy();
    let source = Source {
        title: title.into_owned(),
        study: None,
        protocol_version: None,
        path: name,
        ..Source::default()
    };
    Ok(Analysed {
        source,
        details: Details {
            seed: Some(rules.seed),
            ..Details::default()
        },
        traces: Vec::new(),
        analysis: progress::analyze(&ratings, &rules),
    })
}

/// The study for the head of its report.
fn source_of(study: &StudyFolder, protocol: &Protocol) -> Source {
    Source {
        title: protocol.study.title.clone(),
        study: Some(protocol.study.id.clone()),
        protocol_version: Some(study.version()),
        path: study.path().display().to_string(),
        ..Source::default()
    }
}

/// Analyzes a study by the newest version of its protocol. Model files are read too,
/// because the VAF may be given only there.
fn of_study(
    study: &StudyFolder,
    derived: &Derived,
    loaded: &Loaded,
    args: &Args,
) -> Result<Analysed, Failure> {
    let protocol = &loaded.protocol;
    let question = question(protocol, args.question.as_deref())?;
    let ratings = ratings(loaded, derived, &question);
    let rules = Rules {
        deviations: deviations(study)?,
        ..Rules::of(protocol, question.as_str(), include(args))
    };
    let source = source_of(study, protocol);
    let mut analysis = progress::analyze(&ratings, &rules);
    let shares = protocol.analysis.share_of(&question).map(|option| Warning {
        code: "shares",
        text: format!(
            "numbers are shares: 1 for the answer “{option}”, and 0 for any other; t tests of shares are \
             approximate, and the ordinal model is a logistic one"
        ),
    });
    analysis.warnings.splice(0..0, shares);
    let written = !args.json || args.out.is_some();
    Ok(Analysed {
        source,
        details: report::details(protocol, study, derived, question.as_str()),
        // Telemetry is large: read it only if figures are written.
        traces: if written {
            report::traces(study, &derived.rows, &analysis)
        } else {
            Vec::new()
        },
        analysis,
    })
}

/// The answers to a question, with what the protocol and the model files say of the
/// realizations.
fn ratings(loaded: &Loaded, derived: &Derived, question: &QuestionId) -> Ratings {
    let share_of = loaded.protocol.analysis.share_of(question);
    let mut ratings = Ratings::from_rows(&derived.rows, question, share_of);
    ratings.set_states(&derived.participants);
    ratings.set_failed(&derived.rows, &derived.attempts);
    describe_realizations(&mut ratings, loaded);
    ratings
}

/// Hidden duplicates, and covariates from the model files.
pub(in crate::cli) fn describe_realizations(ratings: &mut Ratings, loaded: &Loaded) {
    let Loaded {
        protocol, models, ..
    } = loaded;
    ratings.set_duplicates(protocol.models.iter().filter_map(|m| {
        let original = m.duplicate_of.as_ref()?;
        Some((m.id.as_str(), original.as_str()))
    }));
    for (id, model) in models {
        let covariates = [
            ("memory_mm", model.provenance.memory_mm),
            ("lambda", model.provenance.lambda),
        ];
        for (name, value) in covariates {
            if let Some(value) = value {
                ratings.add_covariate(id.as_str(), name, value);
            }
        }
    }
}

/// The given question or the primary one, which must have numeric answers.
fn question(protocol: &Protocol, asked: Option<&str>) -> Result<QuestionId, Failure> {
    let id = match asked {
        None => protocol.analysis.primary.clone(),
        Some(id) => QuestionId::new(id).map_err(Failure::input)?,
    };
    let numeric: Vec<&str> = protocol
        .questions
        .iter()
        .filter(|q| q.kind.is_number() || protocol.analysis.share_of(&q.id).is_some())
        .map(|q| q.id.as_str())
        .collect();
    if numeric.contains(&id.as_str()) {
        Ok(id)
    } else {
        Err(
            Failure::input(format!("there is no question `{id}` with numeric answers")).hint(
                format!("questions with numeric answers: {}", numeric.join(", ")),
            ),
        )
    }
}

/// The changes of the analysis in later versions of the protocol.
fn deviations(study: &StudyFolder) -> Result<Vec<Deviation>, Failure> {
    let mut found = Vec::new();
    let mut before: Option<Protocol> = None;
    let versions = &study.manifest().versions;
    for version in versions.iter().filter(|_| versions.len() > 1) {
        let after = study_folder::frozen_version(study, version.version)?.protocol;
        if let Some(before) = &before {
            let changes = analyze::deviations(before, &after);
            found.extend(changes.into_iter().map(|change| Deviation {
                text: format!(
                    "protocol {} of {}, because \"{}\": {}",
                    version.version,
                    version.at.format("%Y-%m-%d"),
                    version.reason,
                    change.text
                ),
                ..change
            }));
        }
        before = Some(after);
    }
    Ok(found)
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

/// Writes each file atomically, unless it already has this content. Nothing is synced,
/// because all files can be regenerated. Only the owner can read them: they contain
/// single ratings and comments.
fn write_files(dir: &Path, files: &[report::Output]) -> Result<(), Failure> {
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
    })
}
