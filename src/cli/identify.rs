//! `study identify`

mod output;

use super::{Console, Failure, Kind};
use crate::identify::grid::{self, Cell, Plan};
use crate::identify::resample::Resample;
use crate::identify::{IdentifyError, Training};
use crate::model::predict::Lookup;
use crate::recording::{self, Recording};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Arguments of `study identify`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The recording to identify from: a CSV with t_s, x_mm, f_n (and v_mm_s, a_m_s2)
    #[arg(value_name = "TRAINING")]
    training: Named,

    /// Recordings that lambda and dx are chosen on; NAME=PATH names one in model files
    #[arg(long, value_name = "REC", num_args = 1.., required = true)]
    validate: Vec<Named>,

    /// Recordings that nothing is chosen on: the VAF to report
    #[arg(long, value_name = "REC", num_args = 1..)]
    test: Vec<Named>,

    /// The estimator
    #[arg(long, value_enum, default_value_t = MethodWord::Ewls)]
    method: MethodWord,

    /// Forgetting factors, above 0 and at most 1, separated by commas [default: 0.999 to 0.9999 in steps of 0.0001]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = lambda)]
    lambda: Vec<f64>,

    /// Resampling increments in mm, separated by commas [default: 0.5,1]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = increment)]
    dx: Vec<f64>,

    /// How the estimates are brought to the nodes
    #[arg(long, value_enum, default_value_t = ResampleWord::Bin)]
    resample: ResampleWord,

    /// How parameters between nodes are found
    #[arg(long, value_enum, default_value_t = LookupWord::Linear)]
    lookup: LookupWord,

    /// How the recursion begins
    #[arg(long, value_enum, default_value_t = StartWord::Cold)]
    start: StartWord,

    /// The order of the samples in the recursion
    #[arg(long, value_enum, default_value_t = SortWord::Ascending)]
    sort: SortWord,

    /// Print one JSON document, numbers unrounded
    #[arg(long)]
    json: bool,

    /// Write one model file per cell into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Ids of the model files; {lambda} and {dx} stand for the cell's own
    #[arg(long, value_name = "TEMPLATE", requires = "out")]
    id: Option<String>,

    /// Overwrite model files that are there
    #[arg(long, requires = "out")]
    force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MethodWord {
    /// The paper's: exponentially weighted least squares along x
    Ewls,
    /// Baseline: mean force by position and direction
    Static,
    /// Baseline: one straight line
    Spring,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ResampleWord {
    /// At the node, between means over equal 5 µm counts
    Point,
    /// The mean over the bin around the node
    Bin,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum LookupWord {
    /// Interpolated
    Linear,
    /// The node to the left
    Floor,
    /// The nearest node
    Nearest,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum StartWord {
    /// From zero and P = 10⁶ I
    Cold,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SortWord {
    /// From the lowest x up
    Ascending,
}

/// A path and the name that its recording has in model files.
#[derive(Debug, Clone)]
struct Named {
    name: String,
    path: PathBuf,
}

impl std::str::FromStr for Named {
    type Err = String;
    /// `NAME=PATH`, or a path, whose stem is the name. A `=` behind a `/` belongs
    /// to the path.
    fn from_str(given: &str) -> Result<Self, String> {
        match given.split_once('=') {
            Some((name, path)) if !name.contains(['/', '\\']) => {
                if name.is_empty() || path.is_empty() {
                    return Err("a named recording is NAME=PATH".into());
                }
                Ok(Self {
                    name: name.into(),
                    path: path.into(),
                })
            }
            _ => Ok(Self::unnamed(Path::new(given))),
        }
    }
}

impl Named {
    fn unnamed(path: &Path) -> Self {
        let name = path.file_stem().unwrap_or(path.as_os_str());
        Self {
            name: name.to_string_lossy().into_owned(),
            path: path.to_owned(),
        }
    }

    /// The name of the file, for `--json`.
    fn file_name(&self) -> String {
        let name = self.path.file_name().unwrap_or(self.path.as_os_str());
        name.to_string_lossy().into_owned()
    }
}

/// A forgetting factor, checked where clap can name the argument.
fn lambda(given: &str) -> Result<f64, String> {
    let value: f64 = given.trim().parse().map_err(|_| "this is no number")?;
    if value > 0.0 && value <= 1.0 {
        Ok(value)
    } else {
        Err("a forgetting factor is above 0 and at most 1".into())
    }
}

/// A resampling increment.
fn increment(given: &str) -> Result<f64, String> {
    let value: f64 = given.trim().parse().map_err(|_| "this is no number")?;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err("an increment is a length above 0 mm".into())
    }
}

/// Over the range of the paper's grid.
const DEFAULT_LAMBDAS: [f64; 10] = [
    0.999, 0.9991, 0.9992, 0.9993, 0.9994, 0.9995, 0.9996, 0.9997, 0.9998, 0.9999,
];
/// The paper's best and the one of its study, mm.
const DEFAULT_DX_MM: [f64; 2] = [0.5, 1.0];

/// What was identified, for [`output`].
struct Found<'a> {
    args: &'a Args,
    training: &'a Recording,
    /// Validations, then tests.
    recordings: Vec<(&'a Named, &'a Recording)>,
    cells: Vec<Cell>,
    best: Option<usize>,
    /// Model files: path and text.
    files: Vec<(PathBuf, String)>,
}

/// Does it.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let plan = plan(args)?;
    let training = read(&args.training, console)?;
    let mut recordings = Vec::new();
    for named in args.validate.iter().chain(&args.test) {
        recordings.push((named, read(named, console)?));
    }
    refuse_reuse(&args.training, &training, &recordings)?;
    let recordings: Vec<(&Named, &Recording)> = recordings.iter().map(|(n, r)| (*n, r)).collect();

    let cells = identify(args, &plan, &training, &recordings)
        .map_err(|e| Failure::input(format!("{}: {e}", args.training.path.display())))?;
    let best = grid::best(&cells, args.validate.len());
    let mut found = Found {
        args,
        training: &training,
        recordings,
        cells,
        best,
        files: Vec::new(),
    };
    if let Some(dir) = &args.out {
        found.files = output::files(&mut found.cells, args, dir)?;
        output::write(dir, &found.files, args.force)?;
    }
    if args.json {
        console.out(output::json(&found))?;
    } else {
        console.out(output::table(&found))?;
    }
    for (path, _) in &found.files {
        console.say(format!("wrote {}", path.display()));
    }
    Ok(())
}

fn plan(args: &Args) -> Result<Plan, Failure> {
    let given = |flag: &str| {
        Failure::new(
            Kind::Usage,
            format!("{flag} has no meaning for this method"),
        )
    };
    let dx_mm = if args.dx.is_empty() {
        DEFAULT_DX_MM.to_vec()
    } else {
        args.dx.clone()
    };
    Ok(match args.method {
        MethodWord::Ewls => Plan::Ewls {
            lambdas: if args.lambda.is_empty() {
                DEFAULT_LAMBDAS.to_vec()
            } else {
                args.lambda.clone()
            },
            dx_mm,
            resample: match args.resample {
                ResampleWord::Point => Resample::Point,
                ResampleWord::Bin => Resample::Bin,
            },
        },
        MethodWord::Static | MethodWord::Spring if !args.lambda.is_empty() => {
            return Err(given("--lambda"));
        }
        MethodWord::Static => Plan::Static { dx_mm },
        MethodWord::Spring if !args.dx.is_empty() => return Err(given("--dx")),
        MethodWord::Spring => Plan::Spring,
    })
}

fn read(named: &Named, console: &mut Console) -> Result<Recording, Failure> {
    let path = &named.path;
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let recording = recording::read(&named.name, BufReader::with_capacity(1 << 16, file))
        .map_err(|e| Failure::input(format!("{}: line {}: {}", path.display(), e.line, e.fault)))?;
    for warning in &recording.warnings {
        console.say(format!("warning: {}: {warning}", path.display()));
    }
    Ok(recording)
}

/// Two recordings with the same bytes are not independent, whatever they are
/// called; and two with one name would be one entry of a model file.
fn refuse_reuse(
    training_name: &Named,
    training: &Recording,
    recordings: &[(&Named, Recording)],
) -> Result<(), Failure> {
    let all: Vec<(&Named, &Recording)> = std::iter::once((training_name, training))
        .chain(recordings.iter().map(|(n, r)| (*n, r)))
        .collect();
    for (i, (named, recording)) in all.iter().enumerate() {
        for (before, other) in &all[..i] {
            if recording.sha256 == other.sha256 {
                return Err(Failure::input(format!(
                    "{} and {} are the same recording",
                    before.path.display(),
                    named.path.display()
                ))
                .hint("identify from one recording, choose on a second, report a third"));
            }
            if recording.name == other.name {
                return Err(Failure::input(format!(
                    "two recordings are called {}: {} and {}",
                    recording.name,
                    before.path.display(),
                    named.path.display()
                ))
                .hint("give one another name: --validate NAME=PATH"));
            }
        }
    }
    Ok(())
}

fn identify(
    args: &Args,
    plan: &Plan,
    training: &Recording,
    recordings: &[(&Named, &Recording)],
) -> Result<Vec<Cell>, IdentifyError> {
    // the only values so far; a new one has to be handled here
    let (StartWord::Cold, SortWord::Ascending) = (args.start, args.sort);
    let lookup = match args.lookup {
        LookupWord::Linear => Lookup::Linear,
        LookupWord::Floor => Lookup::Floor,
        LookupWord::Nearest => Lookup::Nearest,
    };
    let training = Training::new(training)?;
    let recordings: Vec<&Recording> = recordings.iter().map(|(_, r)| *r).collect();
    let mut progress = Progress::new(plan.cells());
    grid::run(&training, plan, lookup, &recordings, || progress.step())
}

/// A bar on standard error that appears after a second, on a terminal only.
struct Progress {
    began: Instant,
    cells: usize,
    done: u64,
    bar: Option<ProgressBar>,
}

impl Progress {
    fn new(cells: usize) -> Self {
        Self {
            began: Instant::now(),
            cells,
            done: 0,
            bar: None,
        }
    }

    fn step(&mut self) {
        self.done += 1;
        if self.bar.is_none() && self.began.elapsed() > Duration::from_secs(1) {
            // indicatif draws nothing where standard error is no terminal
            let style = ProgressStyle::with_template("{bar:30} {pos}/{len} cells, {eta} left")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            self.bar = Some(ProgressBar::new(self.cells as u64).with_style(style));
        }
        if let Some(bar) = &self.bar {
            bar.set_position(self.done);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(given: &str) -> (String, String) {
        let named: Named = given.parse().unwrap();
        (named.name, named.path.display().to_string())
    }

    #[test]
    fn a_recording_is_named_by_its_stem_or_by_the_user() {
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(named("a/val.csv"), pair("val", "a/val.csv"));
        assert_eq!(
            named("validation-1.5hz=a/val.csv"),
            pair("validation-1.5hz", "a/val.csv")
        );
        assert_eq!(named("./dx=1/val.csv"), pair("val", "./dx=1/val.csv"));
        assert!("=a".parse::<Named>().is_err());
        assert!("a=".parse::<Named>().is_err());
    }

    #[test]
    fn factors_and_increments_out_of_range_are_refused() {
        for bad in ["0", "-1", "1.0001", "nan", "inf", "x", ""] {
            assert!(lambda(bad).is_err(), "{bad}");
        }
        for bad in ["0", "-1", "nan", "inf", "x", ""] {
            assert!(increment(bad).is_err(), "{bad}");
        }
        assert_eq!(lambda("1"), Ok(1.0));
        assert_eq!(increment(" 0.5"), Ok(0.5));
    }
}
