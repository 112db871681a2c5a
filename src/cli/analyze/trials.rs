//! `study analyze TABLE.csv --task …`: thresholds, sensitivities and preferences of
//! somebody else's trials.

use crate::cli::{Console, Failure};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use study_analysis::analyze::psychophysics::{TableKind, TrialSettings, analyze_table};
use study_report::json;
use study_report::text::{Page, trials};
use study_stats::psychometric::{Core, Priors, Spacing, Support, WidthPrior};

/// Options of a table of trials.
#[derive(Debug, clap::Args)]
pub(super) struct TrialArgs {
    /// A CSV of trials and how they are answered; needs a table, not a study
    #[arg(long, value_name = "KIND", value_parser = clap::builder::PossibleValuesParser::new(TableKind::names()))]
    pub(super) task: Option<String>,
    /// Shape of the psychometric functions [default: norm; with --fit-scale log gumbel, a Weibull function]
    #[arg(long, value_name = "CORE", requires = "task",
          value_parser = clap::builder::PossibleValuesParser::new(Core::NAMES.map(|n| n.1)))]
    core: Option<String>,
    /// Scale of the levels over which functions are fitted; with log, thresholds are still given as levels
    #[arg(long, value_name = "SCALE", default_value = "lin", requires = "task",
          value_parser = clap::builder::PossibleValuesParser::new(["lin", "log"]))]
    fit_scale: String,
    /// Lapse rate of the fit by maximum likelihood; the posterior estimates it
    #[arg(long, value_name = "RATE", default_value = "0.02", requires = "task", value_parser = parse_rate)]
    lapse: f64,
    /// The standard of a comparison, for PSE, JND and Weber fraction
    #[arg(
        long,
        value_name = "LEVEL",
        requires = "task",
        allow_hyphen_values = true
    )]
    standard: Option<f64>,
    /// Lowest and highest level of an adaptive track, with the step between levels, such as 0..2:0.05;
    /// with --fit-scale log, with their ratio, such as 0.02..0.6:1.1
    #[arg(long, value_name = "LOW..HIGH:STEP", requires = "task", value_parser = parse_ladder, allow_hyphen_values = true)]
    ladder: Option<LadderArg>,
    /// Simulated data sets for the p of the deviance; not for adaptive tracks
    #[arg(long, value_name = "N", default_value = "0", requires = "task", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    bootstrap: u32,
}

/// A text that is not what an option takes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
enum OptionError {
    #[error("give a rate of at least 0 and less than 0.5")]
    Rate,
    #[error("give the lowest and the highest level and the step, such as 0..2:0.05")]
    Ladder,
}

/// The ends of a ladder, and the step or the ratio between its levels.
#[derive(Debug, Clone, Copy)]
struct LadderArg {
    low: f64,
    high: f64,
    step: f64,
}

impl LadderArg {
    /// The range of the priors on a scale; `None` if there is no such ladder.
    fn support(self, spacing: Spacing) -> Option<Support> {
        let least = match spacing {
            Spacing::Lin => self.step,
            Spacing::Log => spacing.place(self.step)?,
        };
        let support = Support {
            low: spacing.place(self.low)?,
            high: spacing.place(self.high)?,
            least,
        };
        (least > 0.0 && support.low + least <= support.high).then_some(support)
    }
}

fn parse_rate(given: &str) -> Result<f64, OptionError> {
    let rate = given.parse().ok().filter(|r| (0.0..0.5).contains(r));
    rate.ok_or(OptionError::Rate)
}

fn parse_ladder(given: &str) -> Result<LadderArg, OptionError> {
    let number = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    let found = || {
        let (ends, step) = given.split_once(':')?;
        let (low, high) = ends.split_once("..")?;
        Some(LadderArg {
            low: number(low)?,
            high: number(high)?,
            step: number(step)?,
        })
    };
    found().ok_or(OptionError::Ladder)
}

/// Prints the statistics of a table of trials.
pub(super) fn run(
    path: &Path,
    task: &str,
    args: &TrialArgs,
    as_json: bool,
    console: &mut Console,
) -> Result<(), Failure> {
    let kind = TableKind::named(task).ok_or_else(|| Failure::input("unknown task"))?;
    let spacing = match args.fit_scale.as_str() {
        "log" => Spacing::Log,
        _ => Spacing::Lin,
    };
    let named = args.core.as_deref().and_then(Core::named);
    let core = named.unwrap_or_else(|| spacing.usual_core());
    let support = match args.ladder {
        None => None,
        Some(ladder) => Some(ladder.support(spacing).ok_or_else(|| {
            Failure::input(match spacing {
                Spacing::Lin => "--ladder: give the lowest and the highest level and the step, such as 0..2:0.05",
                Spacing::Log => "--ladder: over logarithms, give the lowest and the highest level, above 0, and the ratio of two neighbors, such as 0.02..0.6:1.1",
            })
        })?),
    };
    // Only over logarithms it is known what a width is likely to be.
    let priors = match (support, spacing) {
        (Some(support), Spacing::Log) => Priors::track(Some(support), WidthPrior::OfRatios),
        (support, _) => Priors::schuett(support),
    };
    let settings = TrialSettings {
        core,
        spacing,
        lambda: args.lapse,
        standard: args.standard,
        priors,
        repeats: args.bootstrap,
        seed: 2007,
    };
    let file = File::open(path).map_err(|e| Failure::file(path, &e))?;
    let name = path.display().to_string();
    let (results, rows) =
        analyze_table(&name, BufReader::new(file), kind, &settings).map_err(Failure::input)?;
    if as_json {
        return console.document(json::trials(&name, task, rows, &results));
    }
    let page = Page {
        width: console.width,
        color: console.color,
    };
    console.out(trials(&name, task, rows, &results, page))
}
