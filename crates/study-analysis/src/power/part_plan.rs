//! From a part that is no rating to settings: defaults, then `[power]`, then flags.

use super::factors_plan;
use super::felt::FeltWorld;
use super::felt_plan::of_felt;
use super::parts::{PairsWorld, PartWorld};
use super::plan::{Defaults, LeftOut, numbers, slope, targets, tests};
use super::planned::{NOTHING, Planned, neat};
use super::tracks::{TrackWorld, TracksWorld, Truth};
use super::{Assumptions, Cell, Overrides, Pace, Plan, PlanError, Scale, Settings, Test, Vaf};
use crate::analyze::ALPHA;
use crate::analyze::psychophysics::{have_ratios, track_settings};
use study_base::sort::SmallSort as _;
use study_base::text::{ModelId, PartId};
use study_plan::procedure::Ladder;
use study_plan::protocol::conditions::by_condition;
use study_plan::protocol::pairs::{IntervalOrder, Pairs};
use study_plan::protocol::parts::{Part, Task, TrackRules};
use study_plan::protocol::power::{PowerPlan, PowerTrack};
use study_plan::protocol::{Method, Protocol, check};
use study_stats::power::covariate::Spread;
use study_stats::psychometric::{Core, Curve};

/// Logits.
const SLOPE: f64 = 0.5;
const REALIZATION: f64 = 0.3;
const TASTE: f64 = 0.5;
const TIES: f64 = 0.2;
const STUDIES_OF_PAIRS: u64 = 2000;
/// Of tracks, each of which takes many fits.
const STUDIES_OF_TRACKS: u64 = 200;
/// Of tracks of one condition, where there is no test: the mean width of an interval is known from
/// few.
const STUDIES_WITHOUT_TEST: u64 = 40;
const STUDIES_OF_FELT: u64 = 1000;
/// Of similarity, each of which takes many maps.
const STUDIES_OF_MAPS: u64 = 200;

/// The part that is meant: the one of the flag, or the one that asks the primary question;
/// `None` if that is a part of ratings.
pub(super) fn meant<'p>(
    protocol: &'p Protocol,
    flag: Option<&PartId>,
) -> Result<Option<&'p Part>, PlanError> {
    let primary = &protocol.analysis.primary;
    let found = match flag {
        Some(id) => Some(
            protocol
                .part(id)
                .ok_or_else(|| PlanError::NoPart(id.clone()))?,
        ),
        None => (protocol.parts.iter()).find(|part| part.asks.first() == Some(primary)),
    };
    Ok(found.filter(|part| !matches!(part.task, Task::Rating(_))))
}

impl Plan {
    /// The plan of a protocol (with VAF filled in) and flags.
    ///
    /// # Errors
    /// If the two contradict each other, or too few realizations have a VAF.
    pub fn of(protocol: &Protocol, flags: &Overrides) -> Result<Self, PlanError> {
        let part = meant(protocol, flags.part.as_ref())?;
        let crossing = match part {
            None => factors_plan::meant(protocol, flags),
            Some(_) => None,
        };
        let meant = match part.map(|part| &part.task) {
            Some(Task::Pairs(_)) => Meant::Pairs,
            Some(Task::Discrimination { .. }) => Meant::Tracks,
            Some(Task::Ranking(_)) => Meant::Ranking,
            Some(Task::Similarity(_)) => Meant::Similarity,
            Some(Task::Adjustment(_)) => Meant::Adjustment,
            Some(Task::Identification(_)) => Meant::Identification,
            _ if crossing.is_some() => Meant::Effects,
            _ => Meant::Ratings,
        };
        if let Some(flag) = unused(&flags.plan, meant) {
            return Err(PlanError::Unused(flag, meant.name()));
        }
        match (part, crossing) {
            (Some(part), _) => plan(protocol, flags, part),
            (None, Some(crossing)) => factors_plan::plan(protocol, flags, crossing),
            (None, None) => Self::of_ratings(protocol, flags),
        }
    }
}

/// What is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Meant {
    Ratings,
    Effects,
    Pairs,
    Tracks,
    Ranking,
    Similarity,
    Adjustment,
    Identification,
}

impl Meant {
    fn name(self) -> &'static str {
        match self {
            Self::Ratings => "ratings",
            Self::Effects => "effects of factors",
            Self::Pairs => "pairs",
            Self::Tracks => "tracks",
            Self::Ranking => "rankings",
            Self::Similarity => "ratings of difference",
            Self::Adjustment => "adjustment",
            Self::Identification => "identification",
        }
    }
}

/// A flag that was given and is not one of what is meant.
fn unused(over: &PowerPlan, meant: Meant) -> Option<&'static str> {
    let is = |all: &[Meant]| all.contains(&meant);
    let ratings = is(&[Meant::Ratings]);
    let numbers = is(&[Meant::Ratings, Meant::Effects]);
    let (pairs, tracks) = (is(&[Meant::Pairs]), is(&[Meant::Tracks]));
    let (ranking, similarity) = (is(&[Meant::Ranking]), is(&[Meant::Similarity]));
    let adjustment = is(&[Meant::Adjustment]);
    // What has a mean of its own.
    let centered = is(&[Meant::Adjustment, Meant::Identification]);
    let sd = &over.sd;
    let flags = [
        (
            "slope",
            over.slope.is_some(),
            ratings || pairs || ranking || similarity,
        ),
        ("rho", over.rho.is_some(), ratings || pairs || ranking),
        ("smallest", over.smallest.is_some(), ratings),
        ("mean", over.mean.is_some(), numbers || centered),
        ("scale", over.scale.is_some(), numbers),
        ("vaf", over.vaf.is_some(), ratings),
        ("reference", over.reference.is_some(), ratings),
        ("effect", !over.effects.is_empty(), is(&[Meant::Effects])),
        ("ties", over.ties.is_some(), pairs),
        ("track", over.track != PowerTrack::default(), tracks),
        (
            "sd participant",
            sd.participant.is_some(),
            !(pairs || ranking || similarity),
        ),
        (
            "sd realization",
            sd.realization.is_some(),
            !(tracks || adjustment),
        ),
        ("sd interaction", sd.interaction.is_some(), !centered),
        (
            "sd residual",
            sd.residual.is_some(),
            numbers || ranking || similarity || adjustment,
        ),
        ("sd slope", sd.slope.is_some(), ratings),
    ];
    let found = flags.into_iter().find(|(_, given, used)| *given && !used);
    found.map(|(flag, ..)| flag)
}

/// The plan of a part.
fn plan(protocol: &Protocol, flags: &Overrides, part: &Part) -> Result<Plan, PlanError> {
    let stated = flags.plan.clone().or(&protocol.power);
    if flags.pilot.is_some() {
        return Err(PlanError::PilotOfPart(part.id.clone()));
    }
    let mut defaults = Defaults::default();
    let participants = protocol.design.participants as usize;
    let (world, spread, slope, own, repetitions) = match &part.task {
        Task::Pairs(pairs) => of_pairs(protocol, &stated, pairs, &mut defaults)?,
        Task::Discrimination { tracks } => {
            of_tracks(protocol, (&stated, flags.pooled), tracks, &mut defaults)?
        }
        Task::Identification(_) | Task::Similarity(_) | Task::Ranking(_) | Task::Adjustment(_) => {
            of_felt(protocol, &stated, part, &mut defaults)?
        }
        Task::Search(_) => return Err(PlanError::NoTest(part.id.clone())),
        Task::Rating(_) | Task::Magnitude(_) | Task::Mushra(_) => {
            return Err(PlanError::NoPower(part.id.clone()));
        }
    };
    let own = Cell {
        participants,
        ..own
    };
    let fixed = [
        (
            "realizations",
            numbers(&stated.realizations, vec![own.realizations]) != [own.realizations],
        ),
        (
            "repetitions",
            matches!(world, PartWorld::Tracks(_))
                && numbers(&stated.repetitions, repetitions.clone()) != repetitions,
        ),
    ];
    if let Some((what, _)) = fixed.into_iter().find(|(_, other)| *other) {
        return Err(PlanError::Fixed(what, part.id.clone()));
    }
    let n = own.participants.max(2);
    let participants = numbers(&stated.participants, vec![n, 2 * n, 4 * n]);
    let repetitions = numbers(&stated.repetitions, repetitions);
    let grid = (repetitions.iter())
        .flat_map(|&repetitions| {
            participants.iter().map(move |&participants| Cell {
                participants,
                repetitions,
                ..own
            })
        })
        .collect();
    let tests = of_part(&world, tests(&stated), &part.id)?;
    let missing = stated.missing.unwrap_or(0.0);
    if missing > 0.0 && matches!(world, PartWorld::Tracks(_)) {
        return Err(PlanError::MissingOfTracks);
    }
    let studies = match world {
        PartWorld::Factors(_) | PartWorld::Pairs(_) => STUDIES_OF_PAIRS,
        PartWorld::Felt(FeltWorld::Similarity { .. }) => STUDIES_OF_MAPS,
        PartWorld::Felt(_) => STUDIES_OF_FELT,
        PartWorld::Tracks(_) if tests.is_empty() => STUDIES_WITHOUT_TEST,
        PartWorld::Tracks(_) => STUDIES_OF_TRACKS,
    };
    Ok(Plan {
        settings: Settings {
            assumptions: Assumptions {
                slope,
                smallest: None,
                mean: 0.0,
                spread,
                scale: Scale::Continuous,
                vaf: Vaf::Listed,
                dropout: stated.dropout.unwrap_or(0.0),
                missing,
                reference: 0.0,
            },
            part: Some(world),
            pilot: None,
            listed: Vec::new(),
            tests,
            alpha: protocol.analysis.alpha.unwrap_or(ALPHA),
            margin: None,
            seed: flags.seed.unwrap_or(protocol.study.seed),
            studies: stated.studies.unwrap_or(studies),
        },
        part: Some(part.id.clone()),
        own,
        grid,
        targets: targets(&stated),
        defaults: defaults.0,
        exclusions: protocol.analysis.exclude.len(),
        left_out: LeftOut::of(protocol, Some(&part.id)),
        within: stated.within,
        max_session_min: stated.max_session_min,
        pace: Pace::of_part(protocol, part, own.realizations),
    })
}

/// The tests of a part: those that are asked for, or its verdicts.
fn of_part(
    world: &PartWorld,
    asked: Option<Vec<Test>>,
    part: &PartId,
) -> Result<Vec<Test>, PlanError> {
    let possible = match world {
        PartWorld::Factors(_) => vec![Test::Effect],
        PartWorld::Felt(felt) => felt.tests(),
        PartWorld::Pairs(pairs) => {
            let mut known: Vec<f64> = pairs.vaf.iter().copied().flatten().collect();
            known.sort_by(f64::total_cmp);
            known.dedup();
            let mut all = vec![Test::Preferred];
            all.extend((known.len() >= 3).then_some(Test::PreferenceVaf));
            all
        }
        PartWorld::Tracks(tracks) => {
            let of = |truth: fn(&Truth) -> bool| {
                let own = tracks.tracks.iter().filter(|t| truth(&t.truth));
                let rules: Vec<&TrackRules> = own.map(|t| &t.rules).collect();
                by_condition(&rules).len()
            };
            let mut all = Vec::new();
            all.extend((of(|t| matches!(t, Truth::Function(_))) >= 2).then_some(Test::Thresholds));
            all.extend(
                (of(|t| matches!(t, Truth::Sensitivity(_))) >= 1).then_some(Test::ToldApart),
            );
            all
        }
    };
    let Some(asked) = asked.filter(|tests| *tests != [Test::Verdict]) else {
        return Ok(possible);
    };
    match asked.iter().find(|test| !possible.contains(test)) {
        Some(test) => Err(PlanError::NotOfPart(test.as_str(), part.clone())),
        None => Ok(asked),
    }
}

fn of_pairs(
    protocol: &Protocol,
    stated: &PowerPlan,
    pairs: &Pairs,
    defaults: &mut Defaults,
) -> Result<Planned, PlanError> {
    let mut items: Vec<_> = pairs.pairs.iter().flatten().collect();
    // In the order of the protocol.
    items.small_sort_by_key(|id| protocol.models.iter().position(|m| m.id == **id));
    items.dedup();
    let place = |id: &ModelId| items.iter().position(|item| **item == *id).unwrap_or(0);
    let ties = stated.ties;
    if ties.is_some_and(|share| share > 0.0) && !pairs.tie {
        return Err(PlanError::NoTies);
    }
    let spread = Spread {
        realization: defaults.or("sd.realization", stated.sd.realization, REALIZATION),
        interaction: defaults.or("sd.interaction", stated.sd.interaction, TASTE),
        ..NOTHING
    };
    let slope = slope(stated, spread.realization)?;
    let slope = defaults.or("slope", slope, SLOPE);
    let world = PairsWorld {
        vaf: (items.iter())
            .map(|id| protocol.model(id).and_then(|m| m.vaf))
            .collect(),
        pairs: (pairs.pairs.iter())
            .map(|[a, b]| [place(a), place(b)])
            .collect(),
        ties: pairs.tie.then(|| defaults.or("ties", ties, TIES)),
        random_order: pairs.interval_order == IntervalOrder::Random,
    };
    let own = Cell {
        realizations: items.len(),
        repetitions: pairs.repetitions as usize,
        participants: 0,
    };
    let repetitions = vec![own.repetitions];
    Ok((PartWorld::Pairs(world), spread, slope, own, repetitions))
}

fn of_tracks(
    protocol: &Protocol,
    (stated, pooled): (&PowerPlan, u64),
    ids: &[PartId],
    defaults: &mut Defaults,
) -> Result<Planned, PlanError> {
    let tracks: Vec<&TrackRules> = ids.iter().filter_map(|id| protocol.track(id)).collect();
    let ratios = have_ratios(protocol, &tracks);
    let ladders: Vec<Option<Ladder>> = (tracks.iter())
        .map(|track| track.family().map(|_| protocol.ladder(track)))
        .collect();
    if let Some(track) = (tracks.iter().zip(&ladders))
        .find(|(track, ladder)| ladder.is_some() && track.method == Method::SameDifferent)
    {
        return Err(PlanError::NoFunction(track.0.id.clone()));
    }
    let ends = ladders.iter().flatten().next().map(|ladder| {
        let levels = ladder.levels();
        (levels[0], levels[levels.len() - 1])
    });
    let ratios = ratios && ends.is_some();
    let mut truths = Vec::new();
    let conditions = by_condition(&tracks);
    let with_levels = conditions
        .iter()
        .filter(|own| own[0].family().is_some())
        .count();
    let typical = match ends {
        None => None,
        Some((low, high)) => {
            let middle = match ratios && low > 0.0 {
                true => (low * high).sqrt(),
                false => f64::midpoint(low, high),
            };
            let threshold = defaults.or("track.threshold", stated.track.threshold, neat(middle));
            let width = if ratios {
                threshold
            } else {
                neat((high - low) / 3.0)
            };
            let width = defaults.or("track.width", stated.track.width, width);
            let (ratio, difference) = (stated.track.ratio, stated.track.difference);
            if (ratio.is_some() && !ratios) || (difference.is_some() && ratios) {
                return Err(PlanError::RatioOrDifference(ratios));
            }
            let change = match (with_levels > 1, ratios) {
                (false, _) => 0.0,
                (true, true) => libm::log(defaults.or("track.ratio", ratio, 1.5)),
                (true, false) => {
                    defaults.or("track.difference", difference, neat((high - low) / 5.0))
                }
            };
            let lapse = defaults.or("track.lapse", stated.track.lapse, 0.02);
            Some((threshold, width, change, lapse))
        }
    };
    for (track, ladder) in tracks.iter().zip(ladders) {
        // Its place among the conditions with levels.
        let at = (conditions.iter().filter(|own| own[0].family().is_some()))
            .position(|own| own[0].condition() == track.condition());
        let truth = match (&ladder, typical) {
            (Some(_), Some((threshold, width, change, lapse))) => {
                let along = at.unwrap_or(0) as f64 / (with_levels.max(2) - 1) as f64;
                let factor = if ratios {
                    libm::exp(change * along)
                } else {
                    1.0
                };
                let shift = if ratios { 0.0 } else { change * along };
                let gamma = match track.method.guess_rate() {
                    Some(guess) => guess,
                    None => defaults.or("track.guess", stated.track.guess, 0.1),
                };
                Truth::Function(Curve {
                    core: Core::Norm,
                    threshold: threshold * factor + shift,
                    width: width * factor,
                    gamma,
                    lambda: lapse,
                })
            }
            _ => Truth::Sensitivity(defaults.or("track.d", stated.track.d, 1.0)),
        };
        truths.push(TrackWorld {
            rules: (*track).clone(),
            ladder: ladder.unwrap_or_else(|| protocol.ladder(track)),
            settings: track_settings(protocol, track),
            truth,
        });
    }
    let (person, both) = match (ratios, ends) {
        (true, _) => (0.3, 0.15),
        (false, Some((low, high))) => (neat((high - low) / 10.0), neat((high - low) / 20.0)),
        (false, None) => (0.5, 0.25),
    };
    let spread = Spread {
        subject: defaults.or("sd.participant", stated.sd.participant, person),
        interaction: defaults.or("sd.interaction", stated.sd.interaction, both),
        ..NOTHING
    };
    let own = Cell {
        realizations: truths.len(),
        repetitions: 1,
        participants: 0,
    };
    let world = TracksWorld {
        tracks: truths,
        ratios,
        // Participants of different groups are no draws from one population.
        pooled: if protocol.groups.is_some() { 0 } else { pooled },
    };
    Ok((PartWorld::Tracks(world), spread, 0.0, own, vec![1]))
}

impl Pace {
    /// Of a study whose part has other numbers of repetitions.
    fn of_part(protocol: &Protocol, part: &Part, realizations: usize) -> Self {
        let minutes = check::minutes(protocol);
        let mut longer = protocol.clone();
        let mut repetitions = 0.0;
        for other in longer.parts.iter_mut().filter(|p| p.id == part.id) {
            let repeated = match &mut other.task {
                Task::Pairs(own) => &mut own.repetitions,
                Task::Ranking(own) => &mut own.repetitions,
                Task::Similarity(own) => &mut own.repetitions,
                Task::Adjustment(own) => &mut own.repetitions,
                Task::Identification(own) => &mut own.presentations.repetitions,
                Task::Rating(_)
                | Task::Magnitude(_)
                | Task::Mushra(_)
                | Task::Discrimination { .. }
                | Task::Search(_) => continue,
            };
            repetitions = f64::from(*repeated);
            *repeated += 1;
        }
        let one = check::minutes(&longer) - minutes;
        Self {
            fixed: minutes - one * repetitions,
            trial: one / realizations.max(1) as f64,
            others: 0,
        }
    }
}
