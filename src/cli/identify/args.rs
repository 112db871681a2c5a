//! The arguments of `study identify`, and the plan that they make.

use super::{Failure, Kind};
use clap::ValueEnum;
use std::path::{Path, PathBuf};
use study_haptics::identify::Method;
use study_haptics::identify::grid::Plan;
use study_haptics::identify::method::{
    Delta, Ewls, Hat, Segments, Sort, Start, State, TwoSided, Width, Window,
};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::signal;
use study_wire::predict::Lookup;

/// More numbers in a list than this are a slip of the finger.
const MOST_NUMBERS: usize = 1000;

/// Arguments of `study identify`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    /// The recording to identify from: a CSV with t_s, x_mm, f_n (and v_mm_s, a_m_s2)
    #[arg(value_name = "TRAINING")]
    pub(super) training: Named,

    /// Recordings that lambda and dx are chosen on; NAME=PATH names one in model files
    #[arg(long, value_name = "REC", num_args = 1.., required = true)]
    pub(super) validate: Vec<Named>,

    /// Recordings that nothing is chosen on: the VAF to report
    #[arg(long, value_name = "REC", num_args = 1..)]
    pub(super) test: Vec<Named>,

    /// Second recordings of the trajectory of a --validate or --test recording: the most that any model could explain
    #[arg(long, value_name = "REC", num_args = 1..)]
    pub(super) repeat: Vec<Named>,

    /// Low-pass x, a and F of all recordings at this corner, without delay
    #[arg(long, value_name = "HZ", value_parser = length)]
    pub(super) filter: Option<f64>,

    /// Where the acceleration comes from
    #[arg(long, value_enum, default_value_t = AccelerationWord::Accelerometer)]
    pub(super) acceleration: AccelerationWord,

    /// Leave most samples of dwells out of the training recording
    #[arg(long)]
    pub(super) thin: bool,

    /// The estimator
    #[arg(long, value_enum, default_value_t = MethodWord::Ewls)]
    pub(super) method: MethodWord,

    /// Forgetting factors, above 0 and at most 1: a list, or FROM:TO:STEP [default: 0.999:0.9999:0.0001]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = lambdas)]
    pub(super) lambda: Vec<Numbers>,

    /// Resampling increments in mm: a list, or FROM:TO:STEP [default: 0.5,1; for figures 11 from 0.05 to 4]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = increments)]
    pub(super) dx: Vec<Numbers>,

    /// How the estimates are brought to the nodes
    #[arg(long, value_enum)]
    pub(super) resample: Option<ResampleWord>,

    /// How parameters between nodes are found
    #[arg(long, value_enum, default_value_t = LookupWord::Linear)]
    pub(super) lookup: LookupWord,

    /// How the recursion begins
    #[arg(long, value_enum)]
    pub(super) start: Option<StartWord>,

    /// The order of the samples in the recursion
    #[arg(long, value_enum)]
    pub(super) sort: Option<SortWord>,

    /// How the weights of two-sided fall
    #[arg(long, value_enum)]
    pub(super) window: Option<WindowWord>,

    /// Reach of the weights of two-sided in mm, instead of --lambda
    #[arg(long, value_name = "MM", value_parser = length, conflicts_with = "lambda")]
    pub(super) width: Option<f64>,

    /// How a hat table joins its directions
    #[arg(long, value_enum)]
    pub(super) direction: Option<DirectionWord>,

    /// Distance over which a hat table changes direction in mm [default: the shortest that the training recording allows]
    #[arg(long, value_name = "MM", value_parser = length)]
    pub(super) delta: Option<f64>,

    /// Ridges of a hat table: on the curvature of F, on the slopes of m and b [default: 0.003,0.05]
    #[arg(long, value_name = "F,DYNAMICS", value_delimiter = ',', value_parser = weight, num_args = 2)]
    pub(super) ridge: Vec<f64>,

    /// Whether m and b of two-sided (default: off) and hat tables (default: on) are kept from below 0
    #[arg(long, value_enum)]
    pub(super) bounds: Option<Switch>,

    /// Straight lines of the segments baseline [default: 12]
    #[arg(long, value_name = "N")]
    pub(super) segments: Option<usize>,

    /// Print one JSON document, numbers unrounded
    #[arg(long)]
    pub(super) json: bool,

    /// Write one model file per cell into this folder
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,

    /// Ids of the model files; {lambda} and {dx} stand for the cell's own
    #[arg(long, value_name = "TEMPLATE", requires = "out")]
    pub(super) id: Option<String>,

    /// Overwrite model files that are there
    #[arg(long, requires = "out")]
    pub(super) force: bool,

    /// Write the figures (SVG, PNG) and their numbers (CSV) into this folder
    #[arg(long, value_name = "DIR")]
    pub(super) figures: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum AccelerationWord {
    /// The column of the recording
    Accelerometer,
    /// The second difference of the position
    Encoder,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum MethodWord {
    /// The paper's: exponentially weighted least squares along x
    Ewls,
    /// The paper's with m, b >= 0
    Constrained,
    /// Weighted least squares around each node
    TwoSided,
    /// All nodes at once, with a direction state
    Hat,
    /// Baseline: mean force by position and direction
    Static,
    /// Baseline: straight lines by direction
    Segments,
    /// Baseline: one straight line
    Spring,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum ResampleWord {
    /// At the node, between means over equal 5 µm counts
    Point,
    /// The mean over the bin around the node
    Bin,
    /// The mean weighted by how near the node is
    Hat,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum LookupWord {
    /// Interpolated
    Linear,
    /// The node to the left
    Floor,
    /// The nearest node
    Nearest,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum StartWord {
    /// From zero and P = 10⁶ I
    Cold,
    /// From where a pass back over the first samples ends
    Warm,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum SortWord {
    /// From the lowest x up
    Ascending,
    /// As the target travels
    Travel,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum WindowWord {
    /// An EWLS forward and one backward
    Exponential,
    /// Smooth, and zero beyond its reach
    Tricube,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum DirectionWord {
    /// The sign of v, as the paper
    Sign,
    /// Play
    Play,
    /// Dahl's friction
    Dahl,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Switch {
    /// m, b >= 0
    On,
    /// No bounds
    Off,
}

/// A path and the name that its recording has in model files.
#[derive(Debug, Clone)]
pub(super) struct Named {
    pub(super) name: String,
    pub(super) path: PathBuf,
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
    pub(super) fn file_name(&self) -> String {
        let name = self.path.file_name().unwrap_or(self.path.as_os_str());
        name.to_string_lossy().into_owned()
    }
}

/// One entry of a list: a number, or those of a range.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Numbers(Vec<f64>);

impl Numbers {
    /// `0.5`, or `0.1:0.5:0.1` with both ends.
    fn parse(given: &str) -> Result<Self, String> {
        let number = |text: &str| {
            let text = text.trim();
            text.parse::<f64>()
                .map_err(|_| format!("`{}` is no number", study_base::text::Untrusted(text)))
        };
        let parts: Vec<&str> = given.split(':').collect();
        let [from, to, step] = parts[..] else {
            return match parts[..] {
                [one] => Ok(Self(vec![number(one)?])),
                _ => Err("a range is FROM:TO:STEP".into()),
            };
        };
        let (low, high, width) = (number(from)?, number(to)?, number(step)?);
        let steps = (high - low) / width;
        if !(width > 0.0 && steps >= 0.0) {
            return Err("a range goes up from FROM to TO by a STEP above 0".into());
        }
        if steps >= MOST_NUMBERS as f64 {
            return Err(format!("that range has more than {MOST_NUMBERS} numbers"));
        }
        // 0.999 + 3 · 0.0001 shall be what 0.9993 is
        let digits = decimals(from).max(decimals(step));
        // a hundredth of a step forgives the rounding of the division
        let last = (steps + 0.01).floor() as usize;
        (0..=last)
            .map(|i| number(&format!("{:.digits$}", low + i as f64 * width)))
            .collect::<Result<_, _>>()
            .map(Self)
    }
}

/// Digits behind the point; 17 for other ways to write a number.
fn decimals(text: &str) -> usize {
    let text = text.trim();
    match text.split_once('.') {
        Some((_, digits)) if digits.bytes().all(|b| b.is_ascii_digit()) => digits.len(),
        None if text.bytes().all(|b| b.is_ascii_digit()) => 0,
        _ => 17,
    }
}

/// Forgetting factors, checked where clap can name the argument.
fn lambdas(given: &str) -> Result<Numbers, String> {
    let numbers = Numbers::parse(given)?;
    if numbers.0.iter().all(|value| *value > 0.0 && *value <= 1.0) {
        Ok(numbers)
    } else {
        Err("a forgetting factor is above 0 and at most 1".into())
    }
}

/// Resampling increments.
fn increments(given: &str) -> Result<Numbers, String> {
    let numbers = Numbers::parse(given)?;
    if numbers.0.iter().all(|v| *v > 0.0 && v.is_finite()) {
        Ok(numbers)
    } else {
        Err("an increment is a length above 0 mm".into())
    }
}

fn length(given: &str) -> Result<f64, String> {
    match given.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        Ok(_) => Err("this has to be above 0".into()),
        Err(_) => Err("this is no number".into()),
    }
}

fn weight(given: &str) -> Result<f64, String> {
    match given.trim().parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        Ok(_) => Err("a ridge is 0 or more".into()),
        Err(_) => Err("this is no number".into()),
    }
}

/// Over the range of the paper's grid.
const DEFAULT_LAMBDAS: [f64; 10] = [
    0.999, 0.9991, 0.9992, 0.9993, 0.9994, 0.9995, 0.9996, 0.9997, 0.9998, 0.9999,
];
/// The paper's best and the one of its study, mm.
const DEFAULT_DX_MM: [f64; 2] = [0.5, 1.0];
/// Over the range of the paper's Fig. 4, mm.
const FIGURE_DX_MM: [f64; 11] = [0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0];

impl Args {
    /// How signals are prepared.
    pub(super) fn signals(&self) -> signal::Settings {
        signal::Settings {
            filter_hz: self.filter,
            acceleration: match self.acceleration {
                AccelerationWord::Accelerometer => signal::Acceleration::Accelerometer,
                AccelerationWord::Encoder => signal::Acceleration::Encoder,
            },
        }
    }

    /// How parameters between nodes are found.
    pub(super) fn lookup(&self) -> Lookup {
        match self.lookup {
            LookupWord::Linear => Lookup::Linear,
            LookupWord::Floor => Lookup::Floor,
            LookupWord::Nearest => Lookup::Nearest,
        }
    }

    /// Every method with its options, and every dx.
    pub(super) fn plan(&self) -> Result<Plan, Failure> {
        self.refuse_what_has_no_meaning()?;
        let flat = |lists: &[Numbers]| -> Vec<f64> {
            let mut all = Vec::new();
            for value in lists.iter().flat_map(|list| &list.0) {
                if !all.contains(value) {
                    all.push(*value);
                }
            }
            all
        };
        let dx_mm = match flat(&self.dx) {
            given if !given.is_empty() => given,
            _ if self.figures.is_some() => FIGURE_DX_MM.to_vec(),
            _ => DEFAULT_DX_MM.to_vec(),
        };
        let lambdas = match flat(&self.lambda) {
            given if given.is_empty() => DEFAULT_LAMBDAS.to_vec(),
            given => given,
        };
        let each = |of: &dyn Fn(f64) -> Method| lambdas.iter().map(|l| of(*l)).collect();
        let on = |usual| self.bounds.map_or(usual, |b| b == Switch::On);
        let methods: Vec<Method> = match self.method {
            MethodWord::Ewls => each(&|lambda| self.ewls(lambda, false)),
            MethodWord::Constrained => each(&|lambda| self.ewls(lambda, true)),
            MethodWord::TwoSided => {
                let of = |width| {
                    Method::TwoSided(TwoSided {
                        window: match self.window {
                            Some(WindowWord::Exponential) => Window::Exponential,
                            Some(WindowWord::Tricube) | None => Window::Tricube,
                        },
                        width,
                        bounded: on(false),
                    })
                };
                match self.width {
                    Some(mm) => vec![of(Width::Mm(mm))],
                    None => each(&|lambda| of(Width::Lambda(lambda))),
                }
            }
            MethodWord::Hat => vec![self.hat(on(true))],
            MethodWord::Static => vec![Method::Static],
            MethodWord::Segments => vec![Method::Segments(
                self.segments
                    .map_or_else(Segments::default, |count| Segments { count }),
            )],
            MethodWord::Spring => vec![Method::Spring],
        };
        Ok(Plan { methods, dx_mm })
    }

    fn ewls(&self, lambda: f64, bounded: bool) -> Method {
        Method::Ewls(Ewls {
            lambda,
            resample: match self.resample {
                Some(ResampleWord::Point) => Resample::Point,
                Some(ResampleWord::Bin) | None => Resample::Bin,
                Some(ResampleWord::Hat) => Resample::Hat,
            },
            start: match self.start {
                Some(StartWord::Cold) | None => Start::Cold,
                Some(StartWord::Warm) => Start::Warm,
            },
            sort: match self.sort {
                Some(SortWord::Ascending) | None => Sort::Ascending,
                Some(SortWord::Travel) => Sort::Travel,
            },
            bounded,
        })
    }

    fn hat(&self, bounded: bool) -> Method {
        let usual = Hat::default();
        let delta = self.delta.map_or(Delta::Scan, Delta::Mm);
        Method::Hat(Hat {
            state: match self.direction {
                Some(DirectionWord::Sign) => State::Sign,
                Some(DirectionWord::Play) | None => State::Play(delta),
                Some(DirectionWord::Dahl) => State::Dahl(delta),
            },
            ridge_force: self.ridge.first().copied().unwrap_or(usual.ridge_force),
            ridge_dynamics: self.ridge.get(1).copied().unwrap_or(usual.ridge_dynamics),
            bounded,
        })
    }

    /// A flag that would be passed over in silence is a mistake. Those of the paper's
    /// recursion are let through, so that one script can make baselines as well.
    fn refuse_what_has_no_meaning(&self) -> Result<(), Failure> {
        use MethodWord::{Constrained, Ewls, Hat, Segments, Static, TwoSided};
        let given: [(&str, bool, &[MethodWord]); 9] = [
            (
                "--lambda",
                !self.lambda.is_empty(),
                &[Ewls, Constrained, TwoSided],
            ),
            (
                "--dx",
                !self.dx.is_empty(),
                &[Ewls, Constrained, TwoSided, Hat, Static],
            ),
            ("--window", self.window.is_some(), &[TwoSided]),
            ("--width", self.width.is_some(), &[TwoSided]),
            ("--direction", self.direction.is_some(), &[Hat]),
            ("--delta", self.delta.is_some(), &[Hat]),
            ("--ridge", !self.ridge.is_empty(), &[Hat]),
            ("--bounds", self.bounds.is_some(), &[TwoSided, Hat]),
            ("--segments", self.segments.is_some(), &[Segments]),
        ];
        match given
            .iter()
            .find(|(_, given, methods)| *given && !methods.contains(&self.method))
        {
            Some((flag, _, _)) => Err(Failure::new(
                Kind::Usage,
                format!("{flag} has no meaning for this method"),
            )),
            None => Ok(()),
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
        assert_eq!(lambdas("0.999:0.9999:0.0001").unwrap().0, DEFAULT_LAMBDAS);
        assert_eq!(increments("1:2:0.4").unwrap().0, [1.0, 1.4, 1.8]);
        assert_eq!(increments("2:2:1").unwrap().0, [2.0]);
        assert_eq!(increments("1e-1:0.3:1e-1").unwrap().0.len(), 3);
        for bad in ["2:1:0.1", "1:2:0", "1:2:-1", "1:2:nan", "0.001:10:0.001"] {
            assert!(increments(bad).is_err(), "{bad}");
        }
    }
}
