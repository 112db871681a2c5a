//! From a factorial study to settings: defaults, then `[power]`, then flags.

use super::factors::FactorsWorld;
use super::parts::PartWorld;
use super::plan::{Defaults, LeftOut, middle, numbers, scale, targets};
use super::{Assumptions, Cell, Overrides, Pace, Plan, PlanError, Settings, Test, Vaf};
use crate::analyze::ALPHA;
use study_plan::protocol::parts::Task;
use study_plan::protocol::power::PowerScale;
use study_plan::protocol::{Crossing, Protocol};
use study_stats::power::covariate::Spread;

/// Rating points, where nobody states the effects.
const SIZE: f64 = 0.5;
const SPREAD: Spread = Spread {
    subject: 0.6,
    realization: 0.0,
    interaction: 0.4,
    residual: 0.8,
    slope: 0.0,
};
/// Each is an analysis of variance.
const STUDIES: u64 = 2000;

/// The factors, if their effects are meant and not the relation with VAF.
pub(super) fn meant(protocol: &Protocol, flags: &Overrides) -> Option<Crossing> {
    let tests = match flags.plan.tests.is_empty() {
        true => &protocol.power.tests,
        false => &flags.plan.tests,
    };
    let effects = tests.iter().all(|test| *test == Test::Effect);
    protocol.crossing().filter(|_| effects)
}

/// The plan of a factorial study.
pub(super) fn plan(
    protocol: &Protocol,
    flags: &Overrides,
    crossing: Crossing,
) -> Result<Plan, PlanError> {
    let primary = &protocol.analysis.primary;
    let asked = protocol.questions.iter().find(|q| q.id == *primary);
    if asked.is_some_and(|q| !q.kind.scale().is_number()) {
        return Err(PlanError::NoRatings(primary.clone()));
    }
    if flags.pilot.is_some() {
        return Err(PlanError::PilotOfFactors);
    }
    let stated = flags.plan.clone().or(&protocol.power);
    let mut defaults = Defaults::default();
    let scale = match stated.scale.as_ref() {
        Some(PowerScale::FromPilot) => return Err(PlanError::NoPilot),
        given => scale(protocol, given)?,
    };
    let logit = scale.is_logit();
    if logit && stated.sd.residual.is_some() {
        return Err(PlanError::LogitResidual);
    }
    let sizes = sizes(&crossing, &stated.effects, &mut defaults)?;
    let sd = stated.sd;
    let spread = Spread {
        subject: defaults.or("sd.participant", sd.participant, SPREAD.subject),
        realization: defaults.or("sd.realization", sd.realization, SPREAD.realization),
        interaction: defaults.or("sd.interaction", sd.interaction, SPREAD.interaction),
        residual: match logit {
            true => 0.0,
            false => defaults.or("sd.residual", sd.residual, SPREAD.residual),
        },
        slope: 0.0,
    };
    let rated = protocol.parts.iter().find_map(|part| match &part.task {
        Task::Rating(own) if part.asks.contains(primary) => Some(own.repetitions),
        _ => None,
    });
    let own = Cell {
        realizations: crossing.levels_of.len(),
        repetitions: rated.unwrap_or(protocol.design.repetitions) as usize,
        participants: protocol.design.participants as usize,
    };
    if numbers(&stated.realizations, vec![own.realizations]) != [own.realizations] {
        return Err(PlanError::FixedByFactors);
    }
    let n = own.participants.max(2);
    let participants = numbers(&stated.participants, vec![n, 2 * n, 4 * n]);
    let repetitions = numbers(&stated.repetitions, vec![own.repetitions.max(1)]);
    let grid = (repetitions.iter())
        .flat_map(|&repetitions| {
            participants.iter().map(move |&participants| Cell {
                participants,
                repetitions,
                ..own
            })
        })
        .collect();
    let mean = defaults.or("mean", stated.mean, middle(protocol, &scale));
    let has_groups = !crossing.groups.is_empty();
    let left_out = LeftOut::of(protocol, None);
    Ok(Plan {
        settings: Settings {
            assumptions: Assumptions {
                slope: 0.0,
                smallest: None,
                mean,
                spread,
                scale,
                vaf: Vaf::Listed,
                dropout: stated.dropout.unwrap_or(0.0),
                missing: stated.missing.unwrap_or(0.0),
                reference: 0.0,
            },
            tests: vec![Test::Effect; crossing.effects.len()],
            part: Some(PartWorld::Factors(FactorsWorld { crossing, sizes })),
            pilot: None,
            listed: Vec::new(),
            alpha: protocol.analysis.alpha.unwrap_or(ALPHA),
            margin: None,
            seed: flags.seed.unwrap_or(protocol.study.seed),
            studies: stated.studies.unwrap_or(STUDIES),
        },
        part: None,
        own,
        grid,
        targets: targets(&stated),
        defaults: defaults.0,
        exclusions: protocol.analysis.exclude.len(),
        left_out: LeftOut {
            groups: left_out.groups && !has_groups,
            ..left_out
        },
        within: stated.within,
        max_session_min: stated.max_session_min,
        pace: Pace::of(protocol, own.realizations),
    })
}

/// The size of each effect that is tested.
fn sizes(
    crossing: &Crossing,
    stated: &[(String, f64)],
    defaults: &mut Defaults,
) -> Result<Vec<f64>, PlanError> {
    let names: Vec<String> = (crossing.effects.iter())
        .map(|effect| crossing.effect_name(effect))
        .collect();
    // `detent:friction` is `friction:detent`.
    let sorted = |name: &str| {
        let mut factors: Vec<String> = name.split(':').map(|f| f.trim().to_owned()).collect();
        factors.sort_unstable();
        factors
    };
    let own = |name: &str| names.iter().position(|own| sorted(own) == sorted(name));
    if let Some((name, _)) = stated.iter().find(|(name, _)| own(name).is_none()) {
        return Err(PlanError::NoEffect(name.clone(), names.join(", ")));
    }
    if stated.is_empty() {
        let of = |name: &String| defaults.or(&format!("effect {name}"), None, SIZE);
        return Ok(names.iter().map(of).collect());
    }
    let size = |at: usize| {
        let mut given = stated.iter().filter(|(name, _)| own(name) == Some(at));
        given.next_back().map_or(0.0, |(_, size)| *size)
    };
    Ok((0..names.len()).map(size).collect())
}
