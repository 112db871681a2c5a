//! Generalized mixed models of measured outcomes: `outcomes/*/model/*`. They are a second opinion beside
//! the analysis of variance of the participants' means, which decides: that one has its error rates in
//! docs/calibration.md, and likelihood ratios find too much with few participants.

use super::measured::{OutcomeModel, OutcomeModelTest};
use super::record::{EffectName, Interval, Stat, Why};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use study_plan::protocol::{Crossing, OutcomeFamily, OutcomeRules};
use study_session::outcome::ratings::Ratings;
use study_stats::glmm::{
    Family, GlmmData, GlmmError, GlmmFit, Integral, Observation, RatioTest, glmm, ratio_test,
};

/// Most combinations of levels: each is a fixed effect.
const MAX_COMBINATIONS: usize = 40;

/// With more combinations of levels within participants these differ in the effects of single factors only: the work grows
/// with their cube.
const MOST_CROSSED: usize = 12;

/// Half of the width of a 95 % interval, in standard errors.
const WIDTH: f64 = 1.959_963_984_540_054;

/// The model that the protocol asks for, of these trials (row and number); `None` if it asks for none.
pub(super) fn model(
    used: &Ratings,
    trials: &[(usize, f64)],
    outcome: &OutcomeRules,
    crossing: Option<&Crossing>,
) -> Option<OutcomeModel> {
    let family = outcome.model?;
    let of = f64::from(outcome.of.unwrap_or(1));
    let found = match crossing {
        Some(crossing) => by_factors(used, trials, crossing),
        None => by_realization(used, trials),
    };
    let found = found.and_then(|design| design.fitted(family, of));
    Some(found.unwrap_or_else(OutcomeModel::undefined))
}

/// A trial of a tested realization.
struct Trial {
    number: f64,
    subject: usize,
    model: usize,
    /// The place of its level in each factor.
    levels: Vec<usize>,
}

/// The trials, and how their levels become columns of fixed effects.
struct Design {
    trials: Vec<Trial>,
    /// Number of levels of each factor.
    sizes: Vec<usize>,
    /// The names of the factors within participants, which are the first ones; none without factors.
    within: Vec<String>,
    /// The factors of each effect of the full crossing; its columns follow those of the one before.
    effects: Vec<Vec<usize>>,
    /// The effects that are tested, with their names; without a name that of the realizations.
    tested: Vec<(Option<String>, Vec<usize>)>,
}

/// Realizations as the levels of one factor.
fn by_realization(used: &Ratings, trials: &[(usize, f64)]) -> Result<Design, Why> {
    let mut trials = of_tested(used, trials);
    let present: BTreeSet<usize> = trials.iter().map(|t| t.model).collect();
    let present: Vec<usize> = present.into_iter().collect();
    for trial in &mut trials {
        trial.levels = vec![present.partition_point(|m| *m < trial.model)];
    }
    if present.len() < 2 {
        return Err("fewer than two realizations".into());
    }
    Ok(Design {
        trials,
        sizes: vec![present.len()],
        within: Vec::new(),
        effects: vec![vec![0]],
        tested: vec![(None, vec![0])],
    })
}

/// The factors within participants and, if it is a factor, the group.
fn by_factors(used: &Ratings, trials: &[(usize, f64)], crossing: &Crossing) -> Result<Design, Why> {
    let mut trials = of_tested(used, trials);
    let mut sizes = crossing.sizes();
    for trial in &mut trials {
        let levels = crossing.levels_of.get(&used.models[trial.model].id);
        let levels = levels.ok_or("a realization has no levels of the factors")?;
        trial.levels.clone_from(levels);
    }
    if !crossing.groups.is_empty() {
        let group = |trial: &Trial| {
            let own = used.subjects[trial.subject].group.as_ref()?;
            crossing.groups.iter().position(|g| g == own)
        };
        trials.retain(|trial| group(trial).is_some());
        let present: BTreeSet<usize> = trials.iter().filter_map(group).collect();
        let present: Vec<usize> = present.into_iter().collect();
        if present.len() < 2 {
            return Err("the participants are of one group".into());
        }
        for trial in &mut trials {
            let own = group(trial).unwrap_or_default();
            trial.levels.push(present.partition_point(|g| *g < own));
        }
        sizes.push(present.len());
    }
    let effects: Vec<Vec<usize>> = (1..1usize << sizes.len()).map(members).collect();
    let within = 0..crossing.factors.len();
    let tested = (crossing.effects.iter())
        .map(|effect| (Some(crossing.effect_name(effect)), effect.clone()))
        .collect();
    Ok(Design {
        trials,
        sizes,
        within: within
            .map(|place| crossing.name(place).to_owned())
            .collect(),
        effects,
        tested,
    })
}

/// The places of the bits of a number that are set.
fn members(set: usize) -> Vec<usize> {
    (0..usize::BITS as usize)
        .filter(|place| (set >> place) & 1 == 1)
        .collect()
}

/// The trials of the realizations under test.
fn of_tested(used: &Ratings, trials: &[(usize, f64)]) -> Vec<Trial> {
    let of = |&(row, number): &(usize, f64)| {
        let model = used.model[row]? as usize;
        used.models[model].is_tested().then(|| Trial {
            number,
            subject: used.subject[row] as usize,
            model,
            levels: Vec::new(),
        })
    };
    trials.iter().filter_map(of).collect()
}

impl Design {
    fn fitted(&self, family: OutcomeFamily, of: f64) -> Result<OutcomeModel, Why> {
        if self.sizes.iter().product::<usize>() > MAX_COMBINATIONS {
            return Err(format!("more than {MAX_COMBINATIONS} combinations of levels").into());
        }
        let with_cells = self.with_cells(family, of);
        let shared = self.shared();
        let cells: BTreeSet<(usize, usize)> =
            self.trials.iter().map(|t| (t.subject, t.model)).collect();
        let cells: BTreeMap<(usize, usize), usize> = cells.into_iter().zip(0..).collect();
        let observation = |trial: &Trial| {
            let cell = cells.get(&(trial.subject, trial.model)).copied();
            Observation {
                y: trial.number,
                trials: of,
                x: self.row(&trial.levels),
                levels: std::iter::once(trial.subject)
                    .chain(cell.filter(|_| with_cells))
                    .chain(shared.iter().map(|factors| self.part_of(trial, factors)))
                    .collect(),
            }
        };
        let observations: Vec<Observation> = self.trials.iter().map(observation).collect();
        let kind = match family {
            OutcomeFamily::Poisson => Family::Poisson,
            OutcomeFamily::Binomial => Family::Binomial,
            OutcomeFamily::Gamma => Family::Gamma,
        };
        let integral = match with_cells || !shared.is_empty() {
            true => Integral::Laplace,
            false => Integral::Adaptive,
        };
        let why = |error: GlmmError| match error {
            GlmmError::NotOfFamily => not_of(family, of),
            other => Why::from(other.to_string()),
        };
        let data = GlmmData::new(kind, &observations).map_err(why)?;
        let fit = glmm(&data, integral).map_err(why)?;
        let mut differ = None;
        let mut effects: BTreeMap<EffectName, OutcomeModelTest> = BTreeMap::new();
        for (name, effect) in &self.tested {
            let columns: Vec<usize> = self.columns(effect).collect();
            let test = match ratio_test(&data, &fit, &columns, integral) {
                Ok(test) => self.compared(&fit, test, effect, &columns),
                Err(error) => OutcomeModelTest::undefined(why(error)),
            };
            match name {
                Some(name) => drop(effects.insert(name.as_str().into(), test)),
                None => differ = Some(test),
            }
        }
        let of_shared = fit.sd.iter().skip(1 + usize::from(with_cells));
        let named = |factors: &Vec<usize>| -> EffectName {
            let names: Vec<&str> = factors.iter().map(|f| self.within[*f].as_str()).collect();
            names.join(":").as_str().into()
        };
        Ok(OutcomeModel {
            n: Stat::count(self.trials.len()),
            loglik: Stat::of(fit.loglik),
            aic: Stat::of(fit.aic()),
            sd_participant: Stat::or(fit.sd.first().copied(), "there are no participants"),
            sd_cell: (fit.sd.get(1).filter(|_| with_cells)).map(|sd| Stat::of(*sd)),
            sds: (shared.iter().zip(of_shared))
                .map(|(factors, sd)| (named(factors), Stat::of(*sd)))
                .collect(),
            dispersion: fit.dispersion.map(Stat::of),
            differ,
            effects,
        })
    }

    /// Whether cells of participant and realization have intercepts of their own: where trials repeat in a
    /// cell, and where a single number tells how much it varies by itself.
    fn with_cells(&self, family: OutcomeFamily, of: f64) -> bool {
        let mut seen = BTreeSet::new();
        let repeats = !(self.trials.iter()).all(|t| seen.insert((t.subject, t.model)));
        match family {
            OutcomeFamily::Poisson => true,
            OutcomeFamily::Binomial => repeats || of > 1.0,
            OutcomeFamily::Gamma => repeats,
        }
    }

    /// The factors within participants by whose levels, together, several realizations are alike: participants have an
    /// intercept for each of their combinations. Without these a test takes what participants differ in its effect for noise
    /// of single realizations, and finds too much with any number of them.
    fn shared(&self) -> Vec<Vec<usize>> {
        let all = (1usize << self.within.len()) - 1;
        let combinations: usize = self.sizes[..self.within.len()].iter().product();
        let is_kept = |factors: &Vec<usize>| factors.len() == 1 || combinations <= MOST_CROSSED;
        (1..all).map(members).filter(is_kept).collect()
    }

    /// The number of a participant and of the levels of a trial in some factors.
    fn part_of(&self, trial: &Trial, factors: &[usize]) -> usize {
        (factors.iter()).fold(trial.subject, |number, f| {
            number * self.sizes[*f] + trial.levels[*f]
        })
    }

    /// The intercept, and the products of the sum-to-zero codes of the factors of each effect.
    fn row(&self, levels: &[usize]) -> Vec<f64> {
        let mut row = vec![1.0];
        for effect in &self.effects {
            let mut own = vec![1.0];
            for &factor in effect {
                let codes = sum_to_zero(self.sizes[factor], levels[factor]);
                own = (own.iter())
                    .flat_map(|start| codes.iter().map(move |code| start * code))
                    .collect();
            }
            row.extend(own);
        }
        row
    }

    /// The columns of an effect.
    fn columns(&self, effect: &[usize]) -> Range<usize> {
        let width = |effect: &[usize]| effect.iter().map(|f| self.sizes[*f] - 1).product::<usize>();
        let before = self.effects.iter().take_while(|own| *own != effect);
        let start = 1 + before.map(|own| width(own)).sum::<usize>();
        start..start + width(effect)
    }

    /// The test of an effect and, of two levels, how they compare.
    fn compared(
        &self,
        fit: &GlmmFit,
        test: RatioTest,
        effect: &[usize],
        columns: &[usize],
    ) -> OutcomeModelTest {
        // The codes of two levels are 1 and −1.
        let two = match (effect, columns) {
            (&[factor], &[column]) if self.sizes[factor] == 2 => {
                let mut weights = vec![0.0; fit.beta.len()];
                weights[column] = -2.0;
                fit.contrast(&weights)
            }
            _ => None,
        };
        let ends = |(log, se): (f64, f64)| ((log - WIDTH * se).exp(), (log + WIDTH * se).exp());
        OutcomeModelTest {
            chi2: Stat::of(test.chi2),
            df: Stat::count(test.df),
            p: Stat::or(test.p, "it overflows"),
            ratio: two.map(|(log, _)| Stat::of(log.exp())),
            ratio_ci95: two.map(|two| Interval::or(Some(ends(two)), "it overflows")),
        }
    }
}

/// What a number is not that is outside of the family.
fn not_of(family: OutcomeFamily, of: f64) -> Why {
    match family {
        OutcomeFamily::Poisson => "a number is not a whole number of at least 0".into(),
        OutcomeFamily::Binomial => format!("a number is not a whole number from 0 to {of}").into(),
        OutcomeFamily::Gamma => "a number is not above 0".into(),
    }
}

/// The codes of a level: 1 in its own column, −1 in all of them for the last one.
fn sum_to_zero(size: usize, level: usize) -> Vec<f64> {
    let code = |column: usize| match level {
        _ if level + 1 == size => -1.0,
        _ if level == column => 1.0,
        _ => 0.0,
    };
    (0..size - 1).map(code).collect()
}
