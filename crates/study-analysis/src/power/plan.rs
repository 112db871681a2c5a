//! From a protocol to settings: defaults, then `[power]`, then a pilot, then flags.

use super::{Assumptions, Cell, Pilot, Scale, Settings, Test, Vaf};
use crate::analyze::ALPHA;
use study_base::text::{PartId, QuestionId, Untrusted};
use study_plan::procedure::ProcedureError;
use study_plan::procedure::search::MAX_TRIALS;
use study_plan::protocol::parts::Task;
use study_plan::protocol::power::{PowerPlan, PowerScale};
use study_plan::protocol::procedures::Procedure;
use study_plan::protocol::{Protocol, Role, check};
use study_stats::power::covariate::Spread;
use thiserror::Error;

/// Assumed where nobody says otherwise.
const SLOPE: f64 = 0.5;
const SPREAD: Spread = Spread {
    subject: 0.6,
    realization: 0.3,
    interaction: 0.4,
    residual: 0.8,
    slope: 0.0,
};
const STUDIES: u64 = 10_000;
const TARGETS: [f64; 2] = [0.8, 0.9];

/// Why a protocol has no plan.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlanError {
    /// Too few realizations with a VAF.
    #[error("{0} tested realizations have a VAF, but a correlation over them takes three")]
    FewRealizations(usize),
    /// An effect that is not tested.
    #[error("no effect `{name}` is tested; there are {1}", name = Untrusted(.0))]
    NoEffect(String, String),
    /// A pilot of another question.
    #[error("a pilot has estimates for VAF, not for the effects of factors: state them")]
    PilotOfFactors,
    /// A number that the factors fix.
    #[error("the number of realizations is that of the factors' levels")]
    FixedByFactors,
    /// No number, and no part that is simulated.
    #[error("`{0}` is no rating, and no part that can be simulated asks it")]
    NoRatings(QuestionId),
    /// No such part.
    #[error("there is no part `{0}`")]
    NoPart(PartId),
    /// Another kind of part.
    #[error(
        "the power of part `{0}` is not computed: ratings, pairs, tracks, ranking, similarity, adjustment and identification are \
         simulated, but not magnitude estimation and MUSHRA"
    )]
    NoPower(PartId),
    /// A search where the power of a test is asked for.
    #[error(
        "part `{0}` is a search, which has no test: study power says how many answers it needs"
    )]
    NoTest(PartId),
    /// Assumptions that a search does not have.
    #[error(
        "the part `{0}` is a search, of which only the number of perceivers (--studies), --targets, --trials, --jnd and \
         --best are stated"
    )]
    NotOfSearches(PartId),
    /// More answers than a search can have.
    #[error("a search has at most {MAX_TRIALS} trials, not {0}")]
    TooManyAnswers(u32),
    /// Nothing that a map could follow.
    #[error(
        "the map of part `{0}` can follow no property: it takes 4 to 30 realizations that all have a level of a family or a VAF, \
         not all the same"
    )]
    NoProperty(PartId),
    /// Rankings that no test decides about.
    #[error(
        "everybody feels the realizations of part `{0}` in the same order, so that the analysis decides nothing about their ranks"
    )]
    OneOrder(PartId),
    /// Settings without a level that they could differ from.
    #[error("part `{0}` has no level as its standard, so that settings are compared with nothing")]
    NoStandard(PartId),
    /// A share of correct answers that is none.
    #[error("the mean of identification is a share of correct answers: {0} is not between 0 and 1")]
    NoShare(f64),
    /// A pilot of ratings for another part.
    #[error("a pilot has estimates for ratings, not for part `{0}`: state its assumptions")]
    PilotOfPart(PartId),
    /// Numbers that the protocol fixes.
    #[error("the number of {0} of part `{1}` is that of the protocol")]
    Fixed(&'static str, PartId),
    /// A test of something else.
    #[error("`{0}` is no test of part `{1}`")]
    NotOfPart(&'static str, PartId),
    /// A test of a part for ratings.
    #[error("`{0}` is no test of the relation with VAF, but of another part or of factors")]
    NotOfRatings(&'static str),
    /// A flag that changes nothing.
    #[error("`--{0}` does not apply to {1}: leave it out")]
    Unused(&'static str, &'static str),
    /// Trials of a track are asked until there is an answer.
    #[error("missing trials of tracks are not simulated: leave missing out")]
    MissingOfTracks,
    /// Ties without an answer for them.
    #[error("ties are no answer in this part: leave them out")]
    NoTies,
    /// A ratio of levels without ratios, or the other way round.
    #[error("{}", match .0 {
        true => "the levels have ratios: state track.ratio, not track.difference",
        false => "the levels have no ratios: state track.difference, not track.ratio",
    })]
    RatioOrDifference(bool),
    /// A procedure for a part without tracks with levels.
    #[error("part `{0}` has no tracks with levels, whose procedures could be compared")]
    NoThresholds(PartId),
    /// Procedures where ratings are primary.
    #[error(
        "the primary question is not that of tracks with levels: name the part whose procedures are compared"
    )]
    NoTracks,
    /// A procedure that a ladder does not allow.
    #[error("procedure `{name}`: {1}", name = .0.as_str())]
    Procedure(Procedure, ProcedureError),
    /// A kind of trial without a psychometric function.
    #[error("track `{0}`: same-different with levels has no threshold")]
    NoFunction(PartId),
    /// Equivalence with a reference that does not exist.
    #[error("the test `reference-equivalence` needs a realization with the role hidden-reference")]
    NoReference,
    /// Thresholds of a pilot without one.
    #[error("the scale `logit` without thresholds takes them from a pilot, and there is none")]
    NoPilot,
    /// Both ways to state the effect.
    #[error("the slope and rho state the same effect: give one of them")]
    SlopeAndRho,
    /// A correlation without scatter.
    #[error("rho needs scatter of the realizations: sd.realization is 0")]
    RhoWithoutScatter,
    /// Listed VAF for another number of realizations.
    #[error(
        "vaf = \"listed\" allows only the {0} listed realizations; use \"spread\" or \"drawn\""
    )]
    Listed(usize),
    /// A residual for the link `logit`.
    #[error("the link `logit` has its own residual: leave sd.residual out")]
    LogitResidual,
    /// Thresholds of another scale.
    #[error(
        "{0} thresholds are given, but the primary question has {1} levels: one fewer is needed"
    )]
    Thresholds(usize, i64),
    /// An ordered scale for a question without levels.
    #[error("the primary question is no rating: only scale = \"continuous\" is possible")]
    NoLevels,
    /// Stated thresholds for a pilot.
    #[error(
        "the estimates of a pilot are rating points, not logits: leave the thresholds out, and they are the pilot's, too"
    )]
    PilotLogit,
    /// Equivalence without a margin.
    #[error("the test `{0}` needs equivalence_margin in [analysis]")]
    NoMargin(&'static str),
}

/// What flags state; later than `[power]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overrides {
    /// As in `[power]`.
    pub plan: PowerPlan,
    /// Seed of all numbers; without it that of the study.
    pub seed: Option<u64>,
    /// A pilot's estimates.
    pub pilot: Option<Pilot>,
    /// The part that is meant; without it the one with the primary question.
    pub part: Option<PartId>,
    /// Studies of each design of tracks, the first ones, whose thresholds are also learned together.
    pub pooled: u64,
}

/// What to simulate.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// How.
    pub settings: Settings,
    /// The part that is simulated; `None`: ratings.
    pub part: Option<PartId>,
    /// The protocol's own design.
    pub own: Cell,
    /// The designs that are compared.
    pub grid: Vec<Cell>,
    /// Target power.
    pub targets: Vec<f64>,
    /// What nobody stated, and so has a default; `key = value`.
    pub defaults: Vec<String>,
    /// Exclusion rules of the protocol, which are not simulated.
    pub exclusions: usize,
    /// What else of the protocol is not.
    pub left_out: LeftOut,
    /// Half-width of the interval of the power at which a cell has enough studies.
    pub within: Option<f64>,
    /// The longest session, min.
    pub max_session_min: Option<f64>,
    /// What is known of the duration of a session.
    pub pace: Pace,
}

/// What is not simulated.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Whether the study has groups: what differs between them.
    pub groups: bool,
    /// Whether it has several sessions: all but one.
    pub sessions: bool,
    /// Other parts that can be simulated.
    pub parts: Vec<PartId>,
    /// Parts of magnitude estimation and MUSHRA.
    pub never: Vec<PartId>,
}

impl LeftOut {
    pub(super) fn of(protocol: &Protocol, simulated: Option<&PartId>) -> Self {
        let mut found = Self {
            groups: protocol.groups.is_some(),
            sessions: protocol.sessions.len() > 1,
            ..Self::default()
        };
        for part in protocol
            .parts
            .iter()
            .filter(|part| Some(&part.id) != simulated)
        {
            match part.task {
                Task::Pairs(_)
                | Task::Discrimination { .. }
                | Task::Search(_)
                | Task::Identification(_)
                | Task::Similarity(_)
                | Task::Ranking(_)
                | Task::Adjustment(_) => found.parts.push(part.id.clone()),
                Task::Magnitude(_) | Task::Mushra(_) => found.never.push(part.id.clone()),
                Task::Rating(_) => {}
            }
        }
        found
    }
}

/// The duration of a session, from the estimate of `study check`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// What does not depend on the number of trials, min.
    pub(super) fixed: f64,
    /// A repetition of one realization, min.
    pub(super) trial: f64,
    /// Realizations that are presented besides those of a cell.
    pub(super) others: usize,
}

impl Pace {
    pub(super) fn of(protocol: &Protocol, tested: usize) -> Self {
        let repetitions = protocol.design.repetitions;
        let presented = protocol.scheduled_models().count();
        let mut longer = protocol.clone();
        longer.design.repetitions = repetitions + 1;
        let minutes = check::minutes(protocol);
        let repetition = check::minutes(&longer) - minutes;
        Self {
            fixed: minutes - repetition * f64::from(repetitions),
            trial: repetition / presented.max(1) as f64,
            others: presented.saturating_sub(tested),
        }
    }

    /// A session of a cell, min.
    pub fn minutes(&self, realizations: usize, repetitions: usize) -> f64 {
        self.fixed + self.trial * ((realizations + self.others) * repetitions) as f64
    }
}

impl Plan {
    /// The plan of the ratings of a protocol.
    pub(super) fn of_ratings(protocol: &Protocol, flags: &Overrides) -> Result<Self, PlanError> {
        let mut defaults = Defaults::default();
        let primary = &protocol.analysis.primary;
        let rated = protocol.parts.iter().find_map(|part| match &part.task {
            Task::Rating(own) if part.asks.contains(primary) => Some(own),
            _ => None,
        });
        let listed: Vec<f64> = (protocol.models.iter())
            .filter(|m| m.role == Role::Test && m.duplicate_of.is_none())
            .filter(|m| rated.is_none_or(|own| own.models.contains(&m.id)))
            .filter_map(|m| m.vaf)
            .collect();
        let repetitions = rated.map_or(protocol.design.repetitions, |own| own.repetitions);
        let asked = protocol.questions.iter().find(|q| q.id == *primary);
        if asked.is_some_and(|q| !q.kind.scale().is_number()) {
            return Err(PlanError::NoRatings(primary.clone()));
        }
        if listed.len() < 3 {
            return Err(PlanError::FewRealizations(listed.len()));
        }
        let pilot = flags.pilot.as_ref();
        let asked = flags.plan.scale.as_ref().or(protocol.power.scale.as_ref());
        let scale = match asked {
            Some(PowerScale::FromPilot) => {
                let found = pilot.and_then(|p| p.estimate.scale.clone());
                found.ok_or(PlanError::NoPilot)?
            }
            _ => scale(protocol, asked)?,
        };
        let logit = scale.is_logit();
        if logit && pilot.is_some_and(|p| p.estimate.scale.is_none()) {
            return Err(PlanError::PilotLogit);
        }
        let of_pilot = pilot.map(|p| p.estimate.stated(logit)).unwrap_or_default();
        let stated = flags.plan.clone().or(&of_pilot).or(&protocol.power);
        if logit && stated.sd.residual.is_some() {
            return Err(PlanError::LogitResidual);
        }
        let sd = stated.sd;
        let spread = Spread {
            subject: defaults.or("sd.participant", sd.participant, SPREAD.subject),
            realization: defaults.or("sd.realization", sd.realization, SPREAD.realization),
            interaction: defaults.or("sd.interaction", sd.interaction, SPREAD.interaction),
            residual: if logit {
                0.0
            } else {
                defaults.or("sd.residual", sd.residual, SPREAD.residual)
            },
            slope: defaults.or("sd.slope", sd.slope, SPREAD.slope),
        };
        let slope = slope(&stated, spread.realization)?;
        let slope = defaults.or("slope", slope, SLOPE);
        let mean = defaults.or("mean", stated.mean, middle(protocol, &scale));
        let own = Cell {
            realizations: listed.len(),
            repetitions: repetitions as usize,
            participants: protocol.design.participants as usize,
        };
        let n = own.participants.max(2);
        let vaf = stated.vaf;
        let more: Vec<usize> = match vaf {
            Some(Vaf::Listed) => vec![own.realizations],
            _ => [own.realizations, 8, 12]
                .into_iter()
                .filter(|q| *q >= own.realizations)
                .collect(),
        };
        let participants = numbers(&stated.participants, vec![n, 2 * n, 4 * n]);
        let realizations = numbers(&stated.realizations, more);
        let repetitions = numbers(&stated.repetitions, vec![1, own.repetitions.max(1)]);
        if vaf == Some(Vaf::Listed) && realizations != [own.realizations] {
            return Err(PlanError::Listed(own.realizations));
        }
        let mut grid = Vec::new();
        for &realizations in &realizations {
            for &repetitions in &repetitions {
                grid.extend(participants.iter().map(|&participants| Cell {
                    realizations,
                    repetitions,
                    participants,
                }));
            }
        }
        let tests = tests(&stated).unwrap_or_else(|| vec![Test::Verdict]);
        if let Some(test) = tests.iter().find(|test| !test.is_of_ratings()) {
            return Err(PlanError::NotOfRatings(test.as_str()));
        }
        let margin = protocol.analysis.equivalence_margin;
        let needs_margin = [Test::Equivalence, Test::ReferenceEquivalence];
        if let Some(test) = tests.iter().find(|test| needs_margin.contains(test))
            && margin.is_none()
        {
            return Err(PlanError::NoMargin(test.as_str()));
        }
        let has_reference = protocol
            .models
            .iter()
            .any(|m| m.role == Role::HiddenReference);
        if tests.contains(&Test::ReferenceEquivalence) && !has_reference {
            return Err(PlanError::NoReference);
        }
        let targets = targets(&stated);
        Ok(Self {
            settings: Settings {
                assumptions: Assumptions {
                    slope,
                    smallest: stated.smallest,
                    mean,
                    spread,
                    scale,
                    vaf: vaf.unwrap_or(Vaf::Listed),
                    dropout: stated.dropout.unwrap_or(0.0),
                    missing: stated.missing.unwrap_or(0.0),
                    reference: stated.reference.unwrap_or(0.0),
                },
                part: None,
                pilot: flags.pilot.clone(),
                listed,
                tests,
                alpha: protocol.analysis.alpha.unwrap_or(ALPHA),
                margin,
                seed: flags.seed.unwrap_or(protocol.study.seed),
                studies: stated.studies.unwrap_or(STUDIES),
            },
            part: None,
            own,
            grid,
            targets,
            defaults: defaults.0,
            exclusions: protocol.analysis.exclude.len(),
            left_out: LeftOut::of(protocol, None),
            within: stated.within,
            max_session_min: stated.max_session_min,
            pace: Pace::of(protocol, own.realizations),
        })
    }

    /// A digest of everything that the numbers depend on, SHA-256 in hexadecimal.
    pub fn digest(&self, version: &str) -> String {
        // Numbers are printed as the shortest text that reads back the same.
        let text = format!(
            "{version} {:?} {:?} {:?}",
            self.settings,
            self.cells(),
            self.within
        );
        study_base::hex::sha256(text)
    }

    /// Realizations and repetitions of the grid.
    pub fn shapes(&self) -> Vec<(usize, usize)> {
        let mut shapes: Vec<(usize, usize)> = (self.grid.iter())
            .map(|c| (c.realizations, c.repetitions))
            .collect();
        shapes.dedup();
        shapes
    }

    /// The minutes of a session with so many realizations and repetitions, if these are more
    /// than are allowed.
    pub fn too_long(&self, (realizations, repetitions): (usize, usize)) -> Option<f64> {
        let minutes = self.pace.minutes(realizations, repetitions);
        (self.max_session_min).and_then(|most| (minutes > most).then_some(minutes))
    }

    /// The shapes of designs that can be proposed.
    pub fn proposed(&self) -> Vec<(usize, usize)> {
        let mut shapes = self.shapes();
        shapes.retain(|shape| self.too_long(*shape).is_none());
        shapes
    }

    /// The largest number of participants that is considered for the smallest designs.
    pub fn most_participants(&self) -> usize {
        let most = self.grid.iter().map(|c| c.participants).max();
        (5 * most.unwrap_or(0)).max(200)
    }

    /// All cells to simulate, sorted: the grid, the protocol's own design, and the
    /// candidates for the smallest designs.
    pub fn cells(&self) -> Vec<Cell> {
        let mut cells = self.grid.clone();
        cells.push(self.own);
        if self.settings.part.is_some() {
            // No closed form says where the smallest design is.
            cells.sort_unstable();
            cells.dedup();
            return cells;
        }
        let most = self.most_participants();
        cells.extend(super::candidates(
            &self.settings,
            &self.proposed(),
            &self.targets,
            most,
        ));
        cells.sort_unstable();
        cells.dedup();
        cells
    }
}

/// What nobody stated, as `key = value`.
#[derive(Debug, Default)]
pub(super) struct Defaults(pub(super) Vec<String>);

impl Defaults {
    /// The stated value, or the default, which is noted once.
    pub(super) fn or(&mut self, key: &str, value: Option<f64>, default: f64) -> f64 {
        value.unwrap_or_else(|| {
            let note = format!("{key} = {default}");
            if !self.0.contains(&note) {
                self.0.push(note);
            }
            default
        })
    }
}

/// The effect as rating points per standard deviation of VAF.
pub(super) fn slope(stated: &PowerPlan, scatter: f64) -> Result<Option<f64>, PlanError> {
    match (stated.slope, stated.rho) {
        (Some(_), Some(_)) => Err(PlanError::SlopeAndRho),
        (None, Some(_)) if scatter == 0.0 => Err(PlanError::RhoWithoutScatter),
        (None, Some(rho)) => Ok(Some(scatter * rho / (1.0 - rho * rho).sqrt())),
        (slope, None) => Ok(slope),
    }
}

/// Numbers of the grid, sorted.
pub(super) fn numbers(stated: &[u32], default: Vec<usize>) -> Vec<usize> {
    let mut list = match stated.is_empty() {
        true => default,
        false => stated.iter().map(|n| *n as usize).collect(),
    };
    list.sort_unstable();
    list.dedup();
    list
}

/// The tests that are asked for, each once; `None` if there are none.
pub(super) fn tests(stated: &PowerPlan) -> Option<Vec<Test>> {
    let mut tests: Vec<Test> = Vec::new();
    for test in &stated.tests {
        if !tests.contains(test) {
            tests.push(*test);
        }
    }
    (!tests.is_empty()).then_some(tests)
}

/// The power that is wanted, sorted.
pub(super) fn targets(stated: &PowerPlan) -> Vec<f64> {
    let mut targets = match stated.targets.is_empty() {
        true => TARGETS.to_vec(),
        false => stated.targets.clone(),
    };
    targets.sort_by(f64::total_cmp);
    targets.dedup();
    targets
}

/// The middle of a scale, on which a mean is.
pub(super) fn middle(protocol: &Protocol, scale: &Scale) -> f64 {
    match scale {
        Scale::Ordinal { thresholds, .. } => {
            thresholds.iter().sum::<f64>() / thresholds.len().max(1) as f64
        }
        _ => (protocol.primary().and_then(|q| q.kind.scale().ends()))
            .map_or(0.0, |(low, high)| f64::midpoint(low, high)),
    }
}

/// How numbers become ratings of the primary question.
pub(super) fn scale(protocol: &Protocol, given: Option<&PowerScale>) -> Result<Scale, PlanError> {
    let levels = protocol.primary().and_then(|q| q.kind.scale().levels());
    match (given, levels) {
        (None | Some(PowerScale::Rounded), Some((from, to))) => Ok(Scale::Rounded(from, to)),
        (None | Some(PowerScale::Continuous), _) => Ok(Scale::Continuous),
        (Some(PowerScale::Ordinal { link, thresholds }), Some((from, to))) => {
            if thresholds.len() as i64 != to - from {
                return Err(PlanError::Thresholds(thresholds.len(), to - from + 1));
            }
            Ok(Scale::Ordinal {
                link: *link,
                thresholds: thresholds.clone(),
                from,
            })
        }
        (Some(PowerScale::FromPilot), _) => Err(PlanError::NoPilot),
        (Some(_), None) => Err(PlanError::NoLevels),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_plan::protocol::example;

    /// References and anchors take time, too.
    #[test]
    fn the_own_design_takes_as_long_as_the_protocol() {
        let mut protocol = example::protocol(5, 3);
        protocol.models[3].role = Role::HiddenReference;
        protocol.models[4].role = Role::LowAnchor;
        let minutes = Pace::of(&protocol, 3).minutes(3, 3);
        assert!((minutes - check::minutes(&protocol)).abs() < 1e-9);
    }
}
