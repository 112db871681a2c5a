//! From a part of ranking, similarity, adjustment or identification to what is assumed of it.

use super::Cell;
use super::draw::standardized;
use super::felt::FeltWorld;
use super::parts::PartWorld;
use super::plan::{Defaults, PlanError, slope};
use super::planned::{NOTHING, Planned, neat};
use study_base::text::ModelId;
use study_plan::protocol::parts::{Part, Task};
use study_plan::protocol::power::PowerPlan;
use study_plan::protocol::{Adjustment, Identification, Order, Protocol, Ranking, Similarity};
use study_stats::power::covariate::Spread;
use study_stats::similarity::dimensions::MOST_OBJECTS;

/// Of ranking, in standard deviations of the noise with which a realization is felt.
const WORTH: f64 = 0.5;
const RANKED: Spread = Spread {
    realization: 0.3,
    interaction: 0.5,
    residual: 1.0,
    ..NOTHING
};
/// Of similarity, in points of the scale.
const POINTS: f64 = 20.0;
const COMPARED: Spread = Spread {
    realization: 10.0,
    interaction: 10.0,
    residual: 10.0,
    ..NOTHING
};
/// Of identification, in logits.
const LABELED: Spread = Spread {
    subject: 0.5,
    realization: 0.3,
    ..NOTHING
};
/// The share of what guesses miss that is correct.
const ABOVE_GUESSING: f64 = 0.2;
/// The fewest realizations that have a map.
const LEAST_MAPPED: usize = 4;

/// What is assumed of such a part; of another one there is no power.
pub(super) fn of_felt(
    protocol: &Protocol,
    stated: &PowerPlan,
    part: &Part,
    defaults: &mut Defaults,
) -> Result<Planned, PlanError> {
    match &part.task {
        Task::Ranking(own) if own.order == Order::Fixed => {
            Err(PlanError::OneOrder(part.id.clone()))
        }
        Task::Ranking(own) => of_ranking(protocol, stated, own, defaults),
        Task::Similarity(own) => {
            let found = of_similarity(protocol, stated, own, defaults);
            found.ok_or_else(|| PlanError::NoProperty(part.id.clone()))
        }
        Task::Adjustment(own) => {
            let found = of_adjustment(protocol, stated, own, defaults);
            found.ok_or_else(|| PlanError::NoStandard(part.id.clone()))
        }
        Task::Identification(own) => of_identification(stated, own, defaults),
        Task::Rating(_)
        | Task::Magnitude(_)
        | Task::Mushra(_)
        | Task::Pairs(_)
        | Task::Discrimination { .. }
        | Task::Search(_) => Err(PlanError::NoPower(part.id.clone())),
    }
}

/// A design with the repetitions of the protocol.
fn planned(
    (world, spread, slope): (FeltWorld, Spread, f64),
    (realizations, repetitions): (usize, u32),
) -> Planned {
    let own = Cell {
        realizations,
        repetitions: repetitions as usize,
        participants: 0,
    };
    let repetitions = vec![own.repetitions];
    (PartWorld::Felt(world), spread, slope, own, repetitions)
}

/// What is stated of how realizations, tastes and answers spread, or else `usual`.
fn spread(stated: &PowerPlan, usual: Spread, defaults: &mut Defaults) -> Spread {
    let sd = &stated.sd;
    Spread {
        realization: defaults.or("sd.realization", sd.realization, usual.realization),
        interaction: defaults.or("sd.interaction", sd.interaction, usual.interaction),
        residual: defaults.or("sd.residual", sd.residual, usual.residual),
        ..NOTHING
    }
}

/// The level of the family that all realizations have, or else their VAF.
fn property(protocol: &Protocol, models: &[ModelId]) -> Option<(&'static str, Vec<f64>)> {
    let by = |of: &dyn Fn(&ModelId) -> Option<f64>| -> Option<Vec<f64>> {
        models.iter().map(of).collect()
    };
    let level = by(&|id| protocol.level_of(id)).map(|level| ("level", level));
    level.or_else(|| Some(("VAF", by(&|id| protocol.model(id)?.vaf)?)))
}

fn of_ranking(
    protocol: &Protocol,
    stated: &PowerPlan,
    own: &Ranking,
    defaults: &mut Defaults,
) -> Result<Planned, PlanError> {
    let places = (0..own.models.len()).map(|at| at as f64);
    let (property, values) = property(protocol, &own.models)
        .unwrap_or_else(|| ("place in the protocol", places.collect()));
    let spread = spread(stated, RANKED, defaults);
    let slope = slope(stated, spread.realization)?;
    let slope = defaults.or("slope", slope, WORTH);
    let world = FeltWorld::Ranking {
        x: standardized(&values).0,
        property,
        ties: own.ties,
    };
    let design = (own.models.len(), own.repetitions);
    Ok(planned((world, spread, slope), design))
}

/// `None` without a property.
fn of_similarity(
    protocol: &Protocol,
    stated: &PowerPlan,
    own: &Similarity,
    defaults: &mut Defaults,
) -> Option<Planned> {
    let (property, values) = property(protocol, &own.models)?;
    let (x, sd) = standardized(&values);
    if sd <= 0.0 || !(LEAST_MAPPED..=MOST_OBJECTS).contains(&x.len()) {
        return None;
    }
    let spread = spread(stated, COMPARED, defaults);
    let slope = defaults.or("slope", stated.slope, POINTS);
    let place = |id: &ModelId| own.models.iter().position(|other| other == id).unwrap_or(0);
    let pairs = own.different.iter().map(|[a, b]| [place(a), place(b)]);
    let world = FeltWorld::Similarity {
        x,
        property,
        pairs: pairs.collect(),
    };
    let design = (own.models.len(), own.repetitions);
    Some(planned((world, spread, slope), design))
}

/// `None` without a level as the standard.
fn of_adjustment(
    protocol: &Protocol,
    stated: &PowerPlan,
    own: &Adjustment,
    defaults: &mut Defaults,
) -> Option<Planned> {
    let levels: Option<Vec<f64>> = own.models.iter().map(|id| protocol.level_of(id)).collect();
    let levels = levels.filter(|levels| !levels.is_empty())?;
    let standard = protocol.level_of(own.standard.as_ref()?)?;
    let range = levels[levels.len() - 1] - levels[0];
    let tenth = neat(range / 10.0);
    let spread = Spread {
        subject: defaults.or("sd.participant", stated.sd.participant, tenth),
        residual: defaults.or("sd.residual", stated.sd.residual, neat(range / 20.0)),
        ..NOTHING
    };
    let world = FeltWorld::Adjustment {
        mean: defaults.or("mean", stated.mean, standard + neat(range / 20.0)),
        levels,
        standard,
    };
    // Each repetition is a setting from below and one from above.
    Some(planned((world, spread, 0.0), (1, own.repetitions)))
}

fn of_identification(
    stated: &PowerPlan,
    own: &Identification,
    defaults: &mut Defaults,
) -> Result<Planned, PlanError> {
    let presented = &own.presentations.models;
    let label = |id: &ModelId| {
        own.labels
            .iter()
            .position(|label| label.models.contains(id))
    };
    let labels = own.labels.len();
    let guessing = 1.0 / labels.max(2) as f64;
    let share = guessing + ABOVE_GUESSING * (1.0 - guessing);
    let correct = defaults.or("mean", stated.mean, neat(share));
    if !(correct > 0.0 && correct < 1.0) {
        return Err(PlanError::NoShare(correct));
    }
    let sd = &stated.sd;
    let spread = Spread {
        subject: defaults.or("sd.participant", sd.participant, LABELED.subject),
        realization: defaults.or("sd.realization", sd.realization, LABELED.realization),
        ..NOTHING
    };
    let world = FeltWorld::Identification {
        right: presented.iter().filter_map(label).collect(),
        labels,
        correct,
    };
    let design = (presented.len(), own.presentations.repetitions);
    Ok(planned((world, spread, 0.0), design))
}
