//! The arguments of `study identify`.

use super::Failure;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::path::{Path, PathBuf};
use study_base::text::Untrusted;
use study_haptics::identify::ESTIMATORS;
use study_haptics::identify::elsewhere::Stated;
use study_haptics::identify::identification::Request;
use study_haptics::identify::method::{Options, Rule, Sort, Start, TermName, Window};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::signal::{Acceleration, Settings};
use study_haptics::model::Units;
use study_haptics::recording::{Named, Names};
use study_wire::predict::Lookup;

/// Longer lists of numbers are a typing error.
const MAX_NUMBERS: usize = 1000;

/// Why an argument is rejected.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum ArgumentError {
    #[error("a named recording is NAME=PATH")]
    Name,
    #[error("`{}` is not a number", Untrusted(.0))]
    NotANumber(String),
    #[error("a range is FROM:TO:STEP")]
    RangeParts,
    #[error("a range ascends from FROM to TO with a STEP above 0")]
    RangeOrder,
    #[error("the range has more than {MAX_NUMBERS} numbers")]
    RangeLength,
    #[error("a forgetting factor is above 0 and at most 1")]
    Lambda,
    #[error("an increment is a length above 0 mm")]
    Increment,
    #[error("the value has to be above 0")]
    NotPositive,
    #[error("a ridge is 0 or more")]
    Ridge,
    #[error("there is no such value")]
    Choice,
}

/// A value of an option with its help text.
type Choice<T> = (T, &'static str);

const ACCELERATIONS: [Choice<Acceleration>; 2] = [
    (Acceleration::Accelerometer, "The column a_m_s2"),
    (
        Acceleration::Encoder,
        "The second difference of the position",
    ),
];
const RESAMPLES: [Choice<Resample>; 3] = [
    (
        Resample::Point,
        "Interpolate between means over equal 5 µm counts",
    ),
    (Resample::Bin, "Mean over the bin around the node"),
    (Resample::Hat, "Mean weighted by the distance from the node"),
];
const LOOKUPS: [Choice<Lookup>; 3] = [
    (Lookup::Linear, "Interpolate linearly"),
    (Lookup::Floor, "Take the node to the left"),
    (Lookup::Nearest, "Take the nearest node"),
];
const STARTS: [Choice<Start>; 2] = [
    (Start::Cold, "From zero and P = 10⁶ I"),
    (Start::Warm, "From a backward pass over the first samples"),
];
const SORTS: [Choice<Sort>; 2] = [
    (Sort::Ascending, "Ascending x in both directions"),
    (Sort::Travel, "In the direction of travel"),
];
const WINDOWS: [Choice<Window>; 2] = [
    (Window::Exponential, "Sum of a forward and a backward EWLS"),
    (Window::Tricube, "Smooth, with finite support"),
];
const DIRECTIONS: [Choice<Rule>; 3] = [
    (Rule::Sign, "The sign of v, as in the paper"),
    (Rule::Play, "Play (backlash)"),
    (Rule::Dahl, "Dahl friction"),
];
const TERMS: [Choice<TermName>; 4] = [
    (TermName::M, "The mass"),
    (TermName::B, "The damping"),
    (TermName::K, "The stiffness"),
    (
        TermName::F0,
        "The force by position; in friction the Coulomb friction with an offset",
    ),
];
const BOUNDS: [Choice<bool>; 2] = [(true, "Require m, b >= 0"), (false, "No bounds")];

/// Parses an option with a fixed set of values that have these names.
fn choice<T: Copy + Send + Sync + 'static>(
    choices: &'static [Choice<T>],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let names = (choices.iter()).map(|(value, help)| PossibleValue::new(name(*value)).help(*help));
    PossibleValuesParser::new(names).try_map(move |given| {
        let found = choices.iter().find(|(value, _)| name(*value) == given);
        found.map(|(value, _)| *value).ok_or(ArgumentError::Choice)
    })
}

/// The names of the estimators, each with what it is.
fn estimators() -> PossibleValuesParser {
    let names = ESTIMATORS.iter().flat_map(|known| known.names);
    PossibleValuesParser::new(names.map(|(name, what)| PossibleValue::new(*name).help(*what)))
}

fn switch(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

/// Arguments of `study identify`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    /// The training recordings: CSV files with t_s, x_mm, f_n (and v_mm_s, a_m_s2)
    #[arg(value_name = "TRAINING", required = true)]
    pub(super) training: Vec<NamedPath>,

    /// Dynamic recordings of the same target: mass and damping are identified from them, and the force by position from TRAINING alone, such as slow force curves
    #[arg(long, value_name = "REC", num_args = 1..)]
    pub(super) dynamic: Vec<NamedPath>,

    /// Mass that you state, such as that of a handle that was weighed: it is not identified, and every output says so
    #[arg(long, value_name = "KG", value_parser = positive, allow_negative_numbers = true)]
    pub(super) mass_kg: Option<f64>,

    /// Damping that you state: it is not identified, and every output says so
    #[arg(long, value_name = "N_S_PER_MM", value_parser = positive, allow_negative_numbers = true)]
    pub(super) damping_n_s_per_mm: Option<f64>,

    /// Recordings on which lambda and dx are selected, needed for more than one realization; NAME=PATH sets the name in model files
    #[arg(long, value_name = "REC", num_args = 1..)]
    pub(super) validate: Vec<NamedPath>,

    /// Recordings that are not used for selection: their VAF is the one to report
    #[arg(long, value_name = "REC", num_args = 1..)]
    pub(super) test: Vec<NamedPath>,

    /// Second recordings of the trajectory of a --validate or --test recording: they give the highest VAF that a model can reach
    #[arg(long, value_name = "REC", num_args = 1..)]
    pub(super) repeat: Vec<NamedPath>,

    /// Low-pass filter x, a and F of all recordings at this corner frequency, with zero phase
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(super) filter: Option<f64>,

    /// Source of the acceleration
    #[arg(long, value_name = "SOURCE", value_parser = choice(&ACCELERATIONS, Acceleration::as_str), default_value = "accelerometer")]
    pub(super) acceleration: Acceleration,

    /// Remove most samples of dwells from the training recording
    #[arg(long)]
    pub(super) thin: bool,

    /// Names and units of the columns: t=time:ms,x=pos:deg,f=torque:N·m
    #[arg(long, value_name = "KEY=NAME:UNIT", value_delimiter = ',')]
    pub(super) columns: Vec<Named>,

    /// Lever arm of a rotary target: positions in mm and forces in N are those at its end; model files are in the unit of the angle and N·m
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) lever: Option<f64>,

    /// Replace spikes of x and F, samples that differ from their neighbors as no motion does
    #[arg(long)]
    pub(super) robust: bool,

    /// Limit the influence of outliers in a passive table (Huber weights, k = 1.345)
    #[arg(long)]
    pub(super) huber: bool,

    /// Write model files without the coverage by the recordings, which release 0.1 reads
    #[arg(long)]
    pub(super) without_coverage: bool,

    /// Accept a target that supplies energy: without this flag it is refused, because most likely the force has the wrong sign
    #[arg(long)]
    pub(super) active: bool,

    /// Weights of the components of errors, which `study explore --reference` writes: perceptual VAF is shown beside VAF, and methods are compared by it
    #[arg(long, value_name = "FILE")]
    pub(super) weights: Option<PathBuf>,

    /// Estimator [default: all are compared, and one is recommended; with an option of the recursion ewls, with another one of an estimator passive]
    #[arg(long, value_parser = estimators())]
    pub(super) method: Option<String>,

    /// Forgetting factors, above 0 and at most 1: a list, or FROM:TO:STEP [default: 0.999:0.9999:0.0001]; without --method they mean ewls
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = lambdas)]
    pub(super) lambda: Vec<Numbers>,

    /// Resampling increments in mm: a list, or FROM:TO:STEP [default: 0.5,1; with --figures 11 values from 0.05 to 4; in proportion if the travel is not 10 to 100 mm]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = increments)]
    pub(super) dx: Vec<Numbers>,

    /// Resampling of the estimates at the nodes [default: bin]
    #[arg(long, value_name = "METHOD", value_parser = choice(&RESAMPLES, Resample::as_str))]
    pub(super) resample: Option<Resample>,

    /// Look-up of parameters between nodes
    #[arg(long, value_name = "RULE", value_parser = choice(&LOOKUPS, Lookup::as_str), default_value = "linear")]
    pub(super) lookup: Lookup,

    /// Initial state of the recursion [default: cold]
    #[arg(long, value_name = "START", value_parser = choice(&STARTS, Start::as_str))]
    pub(super) start: Option<Start>,

    /// Order of the samples in the recursion [default: ascending]
    #[arg(long, value_name = "ORDER", value_parser = choice(&SORTS, Sort::as_str))]
    pub(super) sort: Option<Sort>,

    /// Shape of the weights of two-sided [default: tricube]
    #[arg(long, value_name = "SHAPE", value_parser = choice(&WINDOWS, Window::as_str))]
    pub(super) window: Option<Window>,

    /// Width of the weights of two-sided in mm, instead of --lambda
    #[arg(long, value_name = "MM", value_parser = positive, conflicts_with = "lambda")]
    pub(super) width: Option<f64>,

    /// Direction state of a hat or passive table [default: play] or of friction [default: dahl]
    #[arg(long, value_parser = choice(&DIRECTIONS, Rule::as_str))]
    pub(super) direction: Option<Rule>,

    /// Lengths over which a hat or passive table or friction changes direction, in mm: a list, or FROM:TO:STEP [default: the shortest that suits the training recording]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = increments)]
    pub(super) delta: Vec<Numbers>,

    /// Ridges of a hat table: on the curvature of F, on the slopes of m and b [default: 0.003,0.05]; of a passive table: on F, on b [default: 0.003,0.06]
    #[arg(long, value_name = "F,DYNAMICS", value_delimiter = ',', value_parser = ridge, num_args = 2)]
    pub(super) ridge: Vec<f64>,

    /// Terms that are identified: f0 with any of m, b and, for ewls, constrained and two-sided, k [default: all, without m and b where the recordings do not carry them]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = choice(&TERMS, TermName::as_str))]
    pub(super) terms: Vec<TermName>,

    /// Whether m, b >= 0 for two-sided (default: off) and hat tables (default: on)
    #[arg(long, value_name = "SWITCH", value_parser = choice(&BOUNDS, switch))]
    pub(super) bounds: Option<bool>,

    /// Number of segments of the segments baseline [default: 12]
    #[arg(long, value_name = "N")]
    pub(super) segments: Option<usize>,

    /// Print the results as one JSON document, with unrounded numbers
    #[arg(long)]
    pub(super) json: bool,

    /// Write one model file per cell into this folder
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,

    /// Template of the ids of the model files, with {lambda}, {dx} and {delta}
    #[arg(long, value_name = "TEMPLATE", requires = "out")]
    pub(super) id: Option<String>,

    /// Overwrite existing model files
    #[arg(long, requires = "out")]
    pub(super) force: bool,

    /// Write the figures (SVG, PNG) and their data (CSV) into this folder
    #[arg(long, value_name = "DIR")]
    pub(super) figures: Option<PathBuf>,
}

/// A recording's path and its name in model files.
#[derive(Debug, Clone)]
pub(super) struct NamedPath {
    pub(super) name: String,
    pub(super) path: PathBuf,
}

impl std::str::FromStr for NamedPath {
    type Err = ArgumentError;
    /// `NAME=PATH`, or a path, whose stem is the name. A `=` after a `/` is part of the
    /// path.
    fn from_str(given: &str) -> Result<Self, ArgumentError> {
        match given.split_once('=') {
            Some((name, path)) if !name.contains(['/', '\\']) => {
                if name.is_empty() || path.is_empty() {
                    return Err(ArgumentError::Name);
                }
                Ok(Self {
                    name: name.into(),
                    path: path.into(),
                })
            }
            _ => {
                let path = Path::new(given);
                let name = path.file_stem().unwrap_or(path.as_os_str());
                Ok(Self {
                    name: name.to_string_lossy().into_owned(),
                    path: path.to_owned(),
                })
            }
        }
    }
}

fn number(text: &str) -> Result<f64, ArgumentError> {
    let text = text.trim();
    let number = text.parse();
    number.map_err(|_| ArgumentError::NotANumber(text.to_owned()))
}

/// One entry of a list: a number, or the numbers of a range.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Numbers(Vec<f64>);

impl Numbers {
    /// `0.5`, or `0.1:0.5:0.1` with both ends.
    fn parse(given: &str) -> Result<Self, ArgumentError> {
        let parts: Vec<&str> = given.split(':').collect();
        let [from, to, step] = parts[..] else {
            return match parts[..] {
                [one] => Ok(Self(vec![number(one)?])),
                _ => Err(ArgumentError::RangeParts),
            };
        };
        let (low, high, width) = (number(from)?, number(to)?, number(step)?);
        let steps = (high - low) / width;
        if !(width > 0.0 && steps >= 0.0) {
            return Err(ArgumentError::RangeOrder);
        }
        if steps >= MAX_NUMBERS as f64 {
            return Err(ArgumentError::RangeLength);
        }
        // 0.999 + 3 · 0.0001 has to equal 0.9993
        let digits = decimals(from).max(decimals(step));
        // a hundredth of a step absorbs the rounding of the division
        let last = (steps + 0.01).floor() as usize;
        (0..=last)
            .map(|i| number(&format!("{:.digits$}", low + i as f64 * width)))
            .collect::<Result<_, _>>()
            .map(Self)
    }

    /// Numbers that all satisfy a condition.
    fn all(
        given: &str,
        valid: impl Fn(f64) -> bool,
        otherwise: ArgumentError,
    ) -> Result<Self, ArgumentError> {
        let numbers = Self::parse(given)?;
        match numbers.0.iter().all(|value| valid(*value)) {
            true => Ok(numbers),
            false => Err(otherwise),
        }
    }
}

/// Number of decimals; 17 for other notations.
fn decimals(text: &str) -> usize {
    let text = text.trim();
    match text.split_once('.') {
        Some((_, digits)) if digits.bytes().all(|b| b.is_ascii_digit()) => digits.len(),
        None if text.bytes().all(|b| b.is_ascii_digit()) => 0,
        _ => 17,
    }
}

/// Parses forgetting factors.
fn lambdas(given: &str) -> Result<Numbers, ArgumentError> {
    Numbers::all(given, |v| v > 0.0 && v <= 1.0, ArgumentError::Lambda)
}

/// Parses resampling increments.
fn increments(given: &str) -> Result<Numbers, ArgumentError> {
    let valid = |v: f64| v > 0.0 && v.is_finite();
    Numbers::all(given, valid, ArgumentError::Increment)
}

fn positive(given: &str) -> Result<f64, ArgumentError> {
    let value = Some(number(given)?).filter(|v| *v > 0.0 && v.is_finite());
    value.ok_or(ArgumentError::NotPositive)
}

fn ridge(given: &str) -> Result<f64, ArgumentError> {
    let value = Some(number(given)?).filter(|v| *v >= 0.0 && v.is_finite());
    value.ok_or(ArgumentError::Ridge)
}

/// All numbers of some lists, each once.
pub(super) fn distinct(lists: &[Numbers]) -> Vec<f64> {
    let mut all = Vec::new();
    for value in lists.iter().flat_map(|list| &list.0) {
        if !all.contains(value) {
            all.push(*value);
        }
    }
    all
}

impl Args {
    /// Names and units of the columns of all recordings.
    pub(super) fn names(&self) -> Result<Names, Failure> {
        match (self.columns.iter().any(Named::is_rotary), self.lever) {
            (true, None) => Err(Failure::usage("columns in units of rotation need --lever")
                .hint("--lever MM is the radius at which the hand holds: limits and reports are in mm and N there")),
            (false, Some(_)) => Err(Failure::usage("--lever without a column in units of rotation")),
            (_, lever_mm) => Ok(Names::new(&self.columns, lever_mm.unwrap_or(1.0))),
        }
    }

    /// The units of the model files, and the lever arm of a turning handle, mm.
    pub(super) fn units(&self) -> Option<(Units, f64)> {
        let degrees = self.columns.iter().find_map(Named::in_degrees);
        let units = match degrees {
            Some(false) => Units::Radians,
            _ => Units::Degrees,
        };
        self.lever.map(|lever_mm| (units, lever_mm))
    }

    /// What is asked of the identification, without what files contain.
    pub(super) fn request(&self) -> Request {
        Request {
            options: Options {
                method: self.method.clone(),
                lambda: distinct(&self.lambda),
                dx_mm: distinct(&self.dx),
                resample: self.resample,
                start: self.start,
                sort: self.sort,
                window: self.window,
                width_mm: self.width,
                direction: self.direction,
                delta_mm: distinct(&self.delta),
                // clap takes two numbers or none
                ridge: self.ridge.first_chunk().copied(),
                huber: self.huber,
                terms: self.terms.clone(),
                bounds: self.bounds,
                segments: self.segments,
                filter_hz: self.filter,
                range_of_dx: self.figures.is_some(),
            },
            lookup: self.lookup,
            signals: Settings {
                filter_hz: self.filter,
                acceleration: self.acceleration,
            },
            thin: self.thin,
            robust: self.robust,
            active: self.active,
            turned: self.units(),
            without_coverage: self.without_coverage,
            stated: Stated {
                m_kg: self.mass_kg,
                b_n_s_per_mm: self.damping_n_s_per_mm,
            },
            weights: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(given: &str) -> (String, String) {
        let named: NamedPath = given.parse().unwrap();
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
        assert!("=a".parse::<NamedPath>().is_err());
        assert!("a=".parse::<NamedPath>().is_err());
    }

    #[test]
    fn factors_and_increments_out_of_range_are_refused() {
        for bad in ["0", "-1", "1.0001", "nan", "inf", "x", "", "0.9:1.1:0.1"] {
            assert!(lambdas(bad).is_err(), "{bad}");
        }
        for bad in [
            "0", "-1", "nan", "inf", "x", "", "0:1:0.1", "1:2", "1:2:3:4",
        ] {
            assert!(increments(bad).is_err(), "{bad}");
        }
        assert_eq!(lambdas("1"), Ok(Numbers(vec![1.0])));
        assert_eq!(increments(" 0.5"), Ok(Numbers(vec![0.5])));
    }

    #[test]
    fn a_range_has_both_ends_and_numbers_as_they_would_be_typed() {
        assert_eq!(
            lambdas("0.999:0.9993:0.0001").unwrap().0,
            [0.999, 0.9991, 0.9992, 0.9993]
        );
        assert_eq!(increments("1:2:0.4").unwrap().0, [1.0, 1.4, 1.8]);
        assert_eq!(increments("2:2:1").unwrap().0, [2.0]);
        assert_eq!(increments("1e-1:0.3:1e-1").unwrap().0.len(), 3);
        for bad in ["2:1:0.1", "1:2:0", "1:2:-1", "1:2:nan", "0.001:10:0.001"] {
            assert!(increments(bad).is_err(), "{bad}");
        }
    }
}
