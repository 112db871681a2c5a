//! What is assumed: flags, and a pilot's results.

use super::super::include::{Who, include};
use super::super::{Console, Failure};
use clap::Args;
use std::path::{Path, PathBuf};
use study_analysis::analyze::{Rules, analyze};
use study_analysis::load;
use study_analysis::power::{Link, Overrides, POOLED, Pilot, Plan, PlanError, Test, Vaf};
use study_base::text::PartId;
use study_plan::protocol::Protocol;
use study_plan::protocol::power::{PowerPlan, PowerScale, PowerTrack, effect as effect_and_size};
use study_session::outcome::ratings::Ratings;
use study_session::store::{self, Derived};

/// Flags that state assumptions; they come after `[power]` of the protocol.
#[derive(Debug, Args)]
#[command(next_help_heading = "Assumptions")]
pub(super) struct Assume {
    /// Rating points per standard deviation of VAF
    #[arg(long, value_name = "B", value_parser = finite, allow_hyphen_values = true, conflicts_with = "rho")]
    slope: Option<f64>,
    /// Correlation of VAF with the true mean ratings, instead of the slope
    #[arg(long, value_name = "R", value_parser = correlation, allow_hyphen_values = true)]
    rho: Option<f64>,
    /// The smallest slope of interest
    #[arg(long, value_name = "B", value_parser = not_negative)]
    smallest: Option<f64>,
    /// Mean rating; of adjustment the mean level, of identification the share of correct answers
    #[arg(long, value_name = "M", value_parser = finite, allow_hyphen_values = true)]
    mean: Option<f64>,
    /// Standard deviations: participant=, realization=, interaction=, residual=, slope=
    #[arg(long, value_name = "WHAT=SD", value_delimiter = ',', value_parser = deviation)]
    sd: Vec<(Deviation, f64)>,
    /// continuous, rounded, or probit or logit with thresholds: logit:-2,-1,0.5; with --from, logit
    /// alone takes the pilot's
    #[arg(long, value_name = "SCALE", value_parser = scale, allow_hyphen_values = true)]
    scale: Option<PowerScale>,
    /// listed, spread or drawn
    #[arg(long, value_name = "HOW", value_parser = vaf)]
    vaf: Option<Vaf>,
    /// Share of participants who are lost whole
    #[arg(long, value_name = "SHARE", value_parser = share)]
    dropout: Option<f64>,
    /// Share of trials without a rating
    #[arg(long, value_name = "SHARE", value_parser = share)]
    missing: Option<f64>,
    /// True mean of the hidden reference minus that of the best realization
    #[arg(long, value_name = "B", value_parser = finite, allow_hyphen_values = true)]
    reference: Option<f64>,
    /// A part that is no rating, or the search (default: the one with the primary question)
    #[arg(long, value_name = "PART")]
    part: Option<PartId>,
    /// Effects of factors and their sizes in points: friction=0.5,friction:detent=0.3
    #[arg(long, value_name = "EFFECT=POINTS", value_delimiter = ',', value_parser = effect)]
    effect: Vec<(String, f64)>,
    /// Pairs: share of "no difference" between two that are alike
    #[arg(long, value_name = "SHARE", value_parser = share)]
    ties: Option<f64>,
    /// Tracks: threshold=, ratio=, difference=, width=, lapse=, guess=, d=
    #[arg(long, value_name = "WHAT=X", value_delimiter = ',', value_parser = track)]
    track: Vec<(Tracked, f64)>,
    /// Tracks: studies of each design, the first ones, whose thresholds are also learned together
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(0..=10_000))]
    pooled: Option<u64>,
    /// Numbers of participants to compare
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(2..=10_000))]
    participants: Vec<u32>,
    /// Numbers of realizations to compare
    #[arg(long, value_name = "Q,…", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(3..=200))]
    realizations: Vec<u32>,
    /// Numbers of repetitions to compare
    #[arg(long, value_name = "R,…", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=100))]
    repetitions: Vec<u32>,
    /// Simulated studies of each design
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(10..=10_000_000))]
    studies: Option<u64>,
    /// Stop simulating a design once the confidence interval of its power is within ± this
    #[arg(long, value_name = "HALF", value_parser = target)]
    within: Option<f64>,
    /// Propose no design whose sessions are longer
    #[arg(long, value_name = "MIN", value_parser = positive)]
    max_session_min: Option<f64>,
    /// Target power, such as 0.8,0.9
    #[arg(long, value_name = "P,…", value_delimiter = ',', value_parser = target)]
    targets: Vec<f64>,
    /// verdict, pearson, permutation, crossed, friedman, clmm, equivalence, reference-equivalence; of
    /// pairs preferred, preference-vaf; of tracks thresholds, told-apart; of factors effect; of ranking
    /// ranked-alike, ranked-first; of similarity map-follows; of adjustment adjusted; of identification
    /// identified; the first one decides
    #[arg(long, value_name = "TEST,…", value_delimiter = ',', value_parser = test)]
    tests: Vec<Test>,
    /// Seed of the simulated studies (default: that of the study)
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Results of a pilot, whose estimates are used with their uncertainty
    #[arg(long, value_name = "RESULTS")]
    from: Option<PathBuf>,
    /// Whose results --from reads, besides those of participants
    #[arg(long, value_name = "WHO", value_delimiter = ',', requires = "from")]
    include: Vec<Who>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Deviation {
    Participant,
    Realization,
    Interaction,
    Residual,
    Slope,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tracked {
    Threshold,
    Ratio,
    Difference,
    Width,
    Lapse,
    Guess,
    D,
}

/// A value that a flag cannot have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(super) struct FlagError(&'static str);

fn number(
    text: &str,
    admitted: impl Fn(f64) -> bool,
    expected: &'static str,
) -> Result<f64, FlagError> {
    let number = text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    number.filter(|x| admitted(*x)).ok_or(FlagError(expected))
}

fn finite(text: &str) -> Result<f64, FlagError> {
    number(text, |_| true, "give a number")
}

fn not_negative(text: &str) -> Result<f64, FlagError> {
    number(text, |x| x >= 0.0, "give a number, 0 or more")
}

pub(super) fn positive(text: &str) -> Result<f64, FlagError> {
    number(text, |x| x > 0.0, "give a number above 0")
}

fn share(text: &str) -> Result<f64, FlagError> {
    number(
        text,
        |x| (0.0..1.0).contains(&x),
        "give a share from 0 to below 1",
    )
}

fn correlation(text: &str) -> Result<f64, FlagError> {
    number(
        text,
        |x| x.abs() < 1.0,
        "give a correlation between -1 and 1",
    )
}

fn target(text: &str) -> Result<f64, FlagError> {
    number(text, |x| x > 0.0 && x < 1.0, "give a power between 0 and 1")
}

fn deviation(text: &str) -> Result<(Deviation, f64), FlagError> {
    const EXPECTED: &str = "write participant=0.6, realization=, interaction=, residual= or slope=";
    let (name, sd) = text.split_once('=').ok_or(FlagError(EXPECTED))?;
    let what = match name.trim() {
        "participant" => Deviation::Participant,
        "realization" => Deviation::Realization,
        "interaction" => Deviation::Interaction,
        "residual" => Deviation::Residual,
        "slope" => Deviation::Slope,
        _ => return Err(FlagError(EXPECTED)),
    };
    Ok((what, not_negative(sd)?))
}

fn track(text: &str) -> Result<(Tracked, f64), FlagError> {
    const EXPECTED: &str = "write threshold=0.4, ratio=, difference=, width=, lapse=, guess= or d=";
    let (name, value) = text.split_once('=').ok_or(FlagError(EXPECTED))?;
    let (what, value) = match name.trim() {
        "threshold" => (Tracked::Threshold, positive(value)),
        "ratio" => (Tracked::Ratio, positive(value)),
        "difference" => (Tracked::Difference, finite(value)),
        "width" => (Tracked::Width, positive(value)),
        "lapse" => (Tracked::Lapse, rate(value)),
        "guess" => (Tracked::Guess, rate(value)),
        "d" => (Tracked::D, not_negative(value)),
        _ => return Err(FlagError(EXPECTED)),
    };
    Ok((what, value?))
}

fn rate(text: &str) -> Result<f64, FlagError> {
    number(
        text,
        |x| (0.0..0.5).contains(&x),
        "give a share from 0 to below 0.5",
    )
}

fn scale(text: &str) -> Result<PowerScale, FlagError> {
    const EXPECTED: &str =
        "write continuous, rounded, probit:T,T,… or logit:T,T,… with rising thresholds";
    let (name, list) = match text.split_once(':') {
        None if text == "continuous" => return Ok(PowerScale::Continuous),
        None if text == "rounded" => return Ok(PowerScale::Rounded),
        None if text == "logit" => return Ok(PowerScale::FromPilot),
        Some(parts) => parts,
        None => return Err(FlagError(EXPECTED)),
    };
    let link = [Link::Probit, Link::Logit]
        .into_iter()
        .find(|l| l.as_str() == name);
    let thresholds: Result<Vec<f64>, FlagError> = list.split(',').map(finite).collect();
    let thresholds = thresholds?;
    if !thresholds.is_sorted_by(|a, b| a < b) {
        return Err(FlagError(EXPECTED));
    }
    let link = link.ok_or(FlagError(EXPECTED))?;
    Ok(PowerScale::Ordinal { link, thresholds })
}

fn effect(text: &str) -> Result<(String, f64), FlagError> {
    effect_and_size(text).map_err(FlagError)
}

fn vaf(text: &str) -> Result<Vaf, FlagError> {
    let all = [Vaf::Listed, Vaf::Spread, Vaf::Drawn];
    let found = all.into_iter().find(|v| v.as_str() == text);
    found.ok_or(FlagError("write listed, spread or drawn"))
}

fn test(text: &str) -> Result<Test, FlagError> {
    let found = Test::ALL.into_iter().find(|t| t.as_str() == text);
    found.ok_or(FlagError(
        "write verdict, pearson, permutation, crossed, friedman, clmm, equivalence, \
         reference-equivalence, preferred, preference-vaf, thresholds, told-apart, effect, ranked-alike, \
         ranked-first, map-follows, adjusted or identified",
    ))
}

impl Assume {
    /// The part that is meant, if one is named.
    pub(super) fn part(&self) -> Option<&PartId> {
        self.part.as_ref()
    }
}

/// The plan of a protocol with these flags.
pub(super) fn plan(
    protocol: &Protocol,
    given: &Assume,
    console: &mut Console,
) -> Result<Plan, Failure> {
    let overrides = overrides(protocol, given, console)?;
    Plan::of(protocol, &overrides).map_err(|error| failure(&error))
}

/// What these flags state.
pub(super) fn overrides(
    protocol: &Protocol,
    given: &Assume,
    console: &mut Console,
) -> Result<Overrides, Failure> {
    let seed = given.seed.unwrap_or(protocol.study.seed);
    let of_pilot = given.scale.as_ref() == Some(&PowerScale::FromPilot);
    let primary = protocol.primary().filter(|_| of_pilot);
    let ends = primary.and_then(|q| q.kind.scale().levels());
    let pilot = match &given.from {
        Some(path) => Some(pilot(path, given, (seed, ends), console)?),
        None => None,
    };
    let sd = |of: Deviation| {
        let last = given.sd.iter().rev().find(|(what, _)| *what == of);
        last.map(|(_, sd)| *sd)
    };
    let track = |of: Tracked| {
        let last = given.track.iter().rev().find(|(what, _)| *what == of);
        last.map(|(_, value)| *value)
    };
    let mut plan = PowerPlan {
        studies: given.studies,
        targets: given.targets.clone(),
        tests: given.tests.clone(),
        slope: given.slope,
        rho: given.rho,
        smallest: given.smallest,
        mean: given.mean,
        scale: given.scale.clone(),
        vaf: given.vaf,
        dropout: given.dropout,
        missing: given.missing,
        reference: given.reference,
        effects: given.effect.clone(),
        ties: given.ties,
        track: PowerTrack {
            threshold: track(Tracked::Threshold),
            ratio: track(Tracked::Ratio),
            difference: track(Tracked::Difference),
            width: track(Tracked::Width),
            lapse: track(Tracked::Lapse),
            guess: track(Tracked::Guess),
            d: track(Tracked::D),
        },
        within: given.within,
        max_session_min: given.max_session_min,
        participants: given.participants.clone(),
        realizations: given.realizations.clone(),
        repetitions: given.repetitions.clone(),
        ..PowerPlan::default()
    };
    plan.sd.participant = sd(Deviation::Participant);
    plan.sd.realization = sd(Deviation::Realization);
    plan.sd.interaction = sd(Deviation::Interaction);
    plan.sd.residual = sd(Deviation::Residual);
    plan.sd.slope = sd(Deviation::Slope);
    Ok(Overrides {
        plan,
        seed: Some(seed),
        pilot,
        part: given.part.clone(),
        pooled: given.pooled.unwrap_or(POOLED),
    })
}

/// Why there is no plan, with what helps.
pub(super) fn failure(error: &PlanError) -> Failure {
    let hint = match error {
        PlanError::FewRealizations(_) => "add realizations with a VAF to [[models]]",
        PlanError::NoMargin(_) => "equivalence_margin states which difference is negligible",
        PlanError::NoPilot => "add --from RESULTS, or thresholds: logit:-2,-1,…",
        PlanError::NoPower(_) => {
            "logarithms of estimates, and points from 0 to 100, are like ratings with --scale \
             continuous in a protocol with a rating part (docs/power.md)"
        }
        PlanError::NoPart(_)
        | PlanError::NoRatings(_)
        | PlanError::NoTracks
        | PlanError::NoThresholds(_) => "--part names one of [[parts]]",
        PlanError::OneOrder(_) => "take \"blocked\", \"williams\" or \"latin-square\"",
        PlanError::NotOfSearches(_) | PlanError::TooManyAnswers(_) => {
            "docs/power.md says what is simulated of a search"
        }
        _ => "the assumptions are flags, or keys of [power] in the protocol",
    };
    Failure::input(error).hint(hint)
}

/// What the results of a pilot allow.
fn pilot(
    path: &Path,
    given: &Assume,
    (seed, ends): (u64, Option<(i64, i64)>),
    console: &mut Console,
) -> Result<Pilot, Failure> {
    let include = include(&given.include);
    let shown = super::shown(path);
    let (ratings, rules) = if path.is_file() {
        let file = std::fs::File::open(path).map_err(|e| Failure::file(path, &e))?;
        let input = std::io::BufReader::new(file);
        let ratings = Ratings::read_csv(&shown, input, None).map_err(Failure::input)?;
        (ratings, Rules::default())
    } else {
        let study = store::one_study(path)?;
        let loaded = load::frozen(&study)?;
        let derived = Derived::of(&study.sessions()?, &loaded.protocol);
        let question = loaded.protocol.analysis.primary.clone();
        let share_of = loaded.protocol.analysis.share_of(&question);
        let mut ratings = Ratings::from_rows(&derived.rows, &question, share_of);
        ratings.set_states(&derived.participants);
        let rules = Rules::of(&loaded.protocol, question.as_str(), include);
        (ratings, rules)
    };
    let analysis = analyze(&ratings, &rules);
    let counts = &analysis.counts;
    if counts.real_rows == 0 && counts.pilots > 0 && !include.pilot {
        return Err(
            Failure::input(format!("{shown}: holds only pilots")).hint("--include pilot uses them")
        );
    }
    if counts.real_rows == 0 && counts.pilots == 0 && !include.simulated && !path.is_file() {
        return Err(
            Failure::input(format!("{shown}: holds only simulated participants"))
                .hint("--include simulated uses them; their effects are built in"),
        );
    }
    if counts.real_rows > 0 && !path.is_file() {
        console.say(format!(
            "note: {shown} has real participants. The power of a finished study from its own estimate \
             is its p in other words; rely on the smallest effect that the design finds"
        ));
    }
    Pilot::of(&analysis, seed, ends).map_err(|error| {
        Failure::input(format!("{shown}: {error}")).hint("a larger pilot, or stated assumptions")
    })
}
