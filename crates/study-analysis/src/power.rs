//! How many participants, realizations and repetitions does a study need?
//!
//! A simulated study is a table of drawn numbers. A rating is the sum of a mean, the level
//! of the participant, (slope + own slope)·x, the scatter of the realization, an
//! interaction and a residual, cut to the scale of the question; x is VAF, standardized
//! over the realizations. The study is decided by the tests of [`crate::analyze`]: by their closed forms if the table is
//! complete, else by the analysis itself. `docs/power.md` explains every number.
//!
//! Results are reproducible: the numbers of study k of a cell follow from the seed, the
//! text of the cell and k, never from threads, shards or other cells. Counts are integers;
//! sums run over chunks ([`Settings::chunk`]) in order.
//!
//! Parts of pairs, of tracks, of ranking, similarity, adjustment and identification are simulated answer by answer, and decided by the
//! analysis of such parts. A search decides nothing: of it is known how near the best point it comes ([`SearchPlan`]).

mod decide;
mod draw;
mod expected;
mod factors;
mod factors_plan;
mod felt;
mod felt_plan;
mod part_plan;
mod parts;
mod perceivers;
mod pilot;
mod plan;
mod planned;
mod precision;
mod procedures;
mod searches;
mod simulate;
mod tally;
mod tracks;

pub use expected::{Floor, Reach, Smallest, candidates, closed, design, floor, reach, smallest};
pub use factors::FactorsWorld;
pub use felt::FeltWorld;
pub use parts::{PairsWorld, PartWorld};
pub use perceivers::{Likes, Perceiver};
pub use pilot::{Parameters, Pilot, PilotError};
pub use plan::{LeftOut, Overrides, Pace, Plan, PlanError};
pub use precision::{Estimates, Moments, Precision, Quality};
pub use procedures::{Alternative, POOLED, alternatives};
pub use searches::{Regret, SearchAsked, SearchPlan, SearchResult, utility_jnd};
pub use simulate::{Progress, Unit};
pub use tally::{CellResult, Chunk, Tally, TestResult, enough, merge, run_chunk};
pub use tracks::{TrackWorld, TracksWorld, Truth};

pub use study_plan::protocol::power::{PowerLink as Link, PowerTest as Test, PowerVaf as Vaf};

use study_stats::power::covariate::Spread;

/// Version of the numbers: the same seed gives other numbers under another version.
pub const STREAM: &str = "power/1";

/// Studies of a chunk, the unit of work.
pub const CHUNK: u64 = 1000;

/// Studies of a chunk of tracks, each of which takes many fits.
const CHUNK_OF_TRACKS: u64 = 20;

/// Studies of a chunk of what is ranked, set or labeled; of similarity there are as many as of tracks, because each takes many maps.
const CHUNK_OF_FELT: u64 = 100;

/// A design to simulate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Cell {
    /// Realizations that are tested, with a VAF.
    pub realizations: usize,
    /// Repetitions of each.
    pub repetitions: usize,
    /// Participants.
    pub participants: usize,
}

impl Cell {
    /// The text that names its random streams.
    pub fn canonical(&self) -> String {
        format!(
            "participants={} realizations={} repetitions={}",
            self.participants, self.realizations, self.repetitions
        )
    }

    /// Ratings of a complete study.
    pub fn ratings(&self) -> usize {
        self.participants * self.realizations * self.repetitions
    }
}

/// How a number becomes a rating.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// It is the rating.
    Continuous,
    /// It is rounded to the nearest whole number from the first to the second.
    Rounded(i64, i64),
    /// The rating is `from` plus the number of thresholds below it.
    Ordinal {
        /// Distribution of the residual.
        link: Link,
        /// Rising.
        thresholds: Vec<f64>,
        /// Lowest rating.
        from: i64,
    },
}

impl Scale {
    /// Whether its residual is standard logistic.
    pub fn is_logit(&self) -> bool {
        let link = match self {
            Self::Ordinal { link, .. } => Some(*link),
            Self::Continuous | Self::Rounded(..) => None,
        };
        link == Some(Link::Logit)
    }
}

/// What is assumed of the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Assumptions {
    /// Rating points per standard deviation of VAF (with denominator q).
    pub slope: f64,
    /// The smallest slope of interest.
    pub smallest: Option<f64>,
    /// Mean rating, on the latent scale.
    pub mean: f64,
    /// Standard deviations of the random effects.
    pub spread: Spread,
    /// How numbers become ratings.
    pub scale: Scale,
    /// Where VAF come from.
    pub vaf: Vaf,
    /// Share of participants that are lost whole.
    pub dropout: f64,
    /// Share of trials without a rating.
    pub missing: f64,
    /// The true mean of the hidden reference minus that of the realization with the highest
    /// VAF.
    pub reference: f64,
}

/// What a simulation needs besides its cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The assumptions.
    pub assumptions: Assumptions,
    /// The part, or the effects of factors, that are simulated; `None`: ratings, for VAF.
    pub part: Option<PartWorld>,
    /// The pilot whose uncertainty each study draws from, in place of the assumed slope
    /// and standard deviations.
    pub pilot: Option<Pilot>,
    /// VAF of the protocol's tested realizations.
    pub listed: Vec<f64>,
    /// The tests.
    pub tests: Vec<Test>,
    /// Level of significance, two-sided.
    pub alpha: f64,
    /// Equivalence margin of the analysis, in rating points.
    pub margin: Option<f64>,
    /// Seed of all numbers.
    pub seed: u64,
    /// Studies of each cell.
    pub studies: u64,
}

impl Settings {
    /// The VAF of so many realizations; empty if each study draws them.
    pub fn vaf(&self, realizations: usize) -> Vec<f64> {
        match self.assumptions.vaf {
            Vaf::Drawn => Vec::new(),
            Vaf::Listed if realizations == self.listed.len() => self.listed.clone(),
            // As many as are not listed are spread alike.
            Vaf::Listed | Vaf::Spread => {
                let ends = |f: fn(f64, f64) -> f64| self.listed.iter().copied().reduce(f);
                let (low, high) = match (ends(f64::min), ends(f64::max)) {
                    (Some(low), Some(high)) if low < high => (low, high),
                    _ => (0.0, 1.0),
                };
                let step = (high - low) / (realizations.max(2) - 1) as f64;
                (0..realizations).map(|i| low + step * i as f64).collect()
            }
        }
    }

    /// The name of a test by its place: that of the test or, of an effect of factors, that of the effect.
    pub fn test_name(&self, at: usize) -> String {
        let effect = match &self.part {
            Some(PartWorld::Factors(world)) => world.names().into_iter().nth(at),
            _ => None,
        };
        effect.unwrap_or_else(|| self.tests.get(at).map_or("", |t| t.as_str()).to_owned())
    }

    /// Studies of a chunk.
    pub fn chunk(&self) -> u64 {
        match self.part {
            Some(PartWorld::Tracks(_) | PartWorld::Felt(FeltWorld::Similarity { .. })) => {
                CHUNK_OF_TRACKS
            }
            Some(PartWorld::Felt(_)) => CHUNK_OF_FELT,
            None | Some(PartWorld::Factors(_) | PartWorld::Pairs(_)) => CHUNK,
        }
    }

    /// Chunks of a cell.
    pub fn chunks(&self) -> u64 {
        self.studies.div_ceil(self.chunk())
    }
}
