//! The tables of the pooled model of thresholds.

use super::{column, count};
use crate::apa::{name, plain, two};
use crate::table::{Builder, Table, page};
use study_analysis::analyze::psychophysics::results::{
    ConditionName, PartResults, Pooled, PooledContrast, PopulationModel,
};
use study_analysis::analyze::results::{Number as _, PairName};
use study_base::text::Untrusted;

/// The threshold of the population in each condition, beside those without pooling.
pub(super) fn population(results: &PartResults) -> Table {
    let model = results.over.psy_population.as_ref();
    let all = model.into_iter().flat_map(|m| &m.threshold);
    let all: Vec<(&ConditionName, &Pooled)> =
        all.filter(|c| c.1.median.number().is_some()).collect();
    let alone = |condition: &ConditionName| {
        let found = results.over.psy_group.get(condition)?;
        Some(&found.posterior_threshold)
    };
    Builder::new("Thresholds learned together", all)
        .name("", "condition", &|c| c.0.as_str().to_owned())
        .field(column("threshold", "threshold"), plain, |c| &c.1.median)
        .ends(page("95 %").file("threshold_ci95"), plain, &|c| {
            c.1.ci95.ends()
        })
        .number(column("alone", "geometric_mean"), plain, &|c| {
            alone(c.0)?.geometric_mean.number()
        })
        .ends(page("95 %").file("geometric_mean_ci95"), plain, &|c| {
            alone(c.0)?.ci95.ends()
        })
        .number(column("n", "n"), count, &|c| alone(c.0)?.n.number())
        .notes(model.into_iter().flat_map(notes))
}

/// What the pooled model is, and how far it can be relied upon.
fn notes(model: &PopulationModel) -> Vec<String> {
    let found = |pooled: &Pooled| {
        let (low, high) = pooled.ci95.ends()?;
        let median = pooled.median.number()?;
        Some(format!("{} [{}, {}]", two(median), two(low), two(high)))
    };
    let convergence = &model.convergence;
    if !model.has_converged() {
        let why = model.sd_participant.median.reason().unwrap_or_default();
        return vec![format!(
            "No thresholds learned together: {}. Those of each participant alone stand.",
            Untrusted(why)
        )];
    }
    let mut notes = vec![
        "Participants are draws from a population that is learned from all of them (partial pooling); alone: the \
         geometric mean of the participants' own thresholds with its t interval."
            .to_owned(),
    ];
    if let Some(spread) = found(&model.sd_participant) {
        let of_conditions = model.sd_interaction.as_ref().and_then(found);
        let of_conditions = of_conditions.map_or_else(String::new, |found| {
            format!(", in what a condition does to them {found}")
        });
        notes.push(format!(
            "Standard deviation of participants {spread}{of_conditions}."
        ));
    }
    let number = |stat: &study_analysis::analyze::results::Stat| stat.number();
    if let (Some(draws), Some(effective), Some(k), Some(r_hat)) = (
        number(&convergence.n_draws),
        number(&convergence.effective_draws),
        number(&convergence.pareto_k),
        number(&convergence.r_hat),
    ) {
        notes.push(format!(
            "Converged: {draws} draws, {effective:.0} effective, Pareto k {k:.2}, R-hat {r_hat:.3}."
        ));
    }
    notes
}

/// Contrasts of the pooled model.
pub(super) fn contrasts(results: &PartResults) -> Table {
    let model = results.over.psy_population.as_ref();
    let pairs = model.into_iter().flat_map(|m| &m.contrasts);
    let shown = |c: &PooledContrast| c.ratio.clone().or(c.difference.clone());
    let all: Vec<(&PairName, &PooledContrast)> = pairs
        .filter(|c| shown(c.1).is_some_and(|p| p.median.number().is_some()))
        .collect();
    Builder::new("Contrasts of thresholds learned together", all)
        .name("", "conditions", &|(pair, contrast)| {
            let names = pair.names().map(name);
            let sign = if contrast.ratio.is_some() {
                " / "
            } else {
                " − "
            };
            names.join(sign)
        })
        .number(column("estimate", "estimate"), plain, &|c| {
            shown(c.1)?.median.number()
        })
        .ends(page("95 %").file("estimate_ci95"), plain, &|c| {
            shown(c.1)?.ci95.ends()
        })
        .field(column("P(first larger)", "first_larger"), two, |c| {
            &c.1.first_larger
        })
        .done()
}
