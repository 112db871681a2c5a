//! The tables of thresholds, sensitivities and preferences: the same on the terminal, in
//! the report and as CSV.

mod adjustment;
mod identification;
mod population;
mod ranking;
mod scales;
mod similarity;

use crate::apa::{self, bare_p, interval_or_dash, listing, name, or_dash, plain, two};
use crate::table::{Builder, Head, Table, file, page};
use scales::{items, magnitudes, ratings, scores, scores_after, subscales};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::results::{
    Ability, CellName, ConditionModel, Contrast, Function, PartResults, PopulationModel,
    Sensitivity,
};
use study_analysis::analyze::results::{Number as _, PairName, RealizationName};
use study_base::sort::SmallSort as _;
use study_base::text::Untrusted;

/// A kind of table: the file it goes into, and how it is made.
type Kind = (&'static str, fn(&PartResults) -> Table);

/// All tables, in the order of a page; those without rows and notes are left out of it.
pub(crate) const KINDS: [Kind; 34] = [
    ("part_thresholds.csv", thresholds),
    ("part_population.csv", population::population),
    ("part_population_contrasts.csv", population::contrasts),
    ("part_conditions.csv", conditions),
    ("part_contrasts.csv", contrasts),
    ("part_comparisons.csv", comparisons),
    ("part_sensitivities.csv", sensitivities),
    ("part_preferences.csv", abilities),
    ("part_preference_pairs.csv", differences),
    ("part_magnitudes.csv", magnitudes),
    ("part_magnitude_contrasts.csv", magnitude_contrasts),
    ("part_mushra.csv", ratings),
    ("part_confusions.csv", identification::confusions),
    ("part_label_pairs.csv", identification::label_pairs),
    ("part_recall.csv", identification::recall),
    ("part_identification.csv", identification::participants),
    ("part_dimensions.csv", similarity::dimensions),
    ("part_map.csv", similarity::map),
    ("part_map_follows.csv", similarity::follows),
    ("part_weights.csv", similarity::weights),
    ("part_weighted_map.csv", similarity::weighted_map),
    ("part_differences.csv", similarity::pairs),
    ("part_similarity.csv", similarity::participants),
    ("part_ranks.csv", ranking::realizations),
    ("part_rank_pairs.csv", ranking::pairs),
    ("part_rankings.csv", ranking::participants),
    ("part_adjustment.csv", adjustment::participants),
    ("part_scores.csv", scores),
    ("part_scores_after.csv", scores_after),
    ("part_subscales.csv", subscales),
    ("part_items.csv", items),
    ("part_groups.csv", groups),
    ("part_group_pairs.csv", group_pairs),
    ("part_group_changes.csv", group_changes),
];

/// All tables of these statistics; those without rows are left out.
pub(crate) fn tables(results: &PartResults) -> Vec<Table> {
    let tables = KINDS.iter().map(|(_, table)| table(results));
    tables.filter(|t| !t.is_blank()).collect()
}

/// A column of pages, with its name in the file.
fn column(head: &str, file: &str) -> Head {
    page(head).file(file)
}

/// A table of participants and conditions.
fn of_cells<'a, R>(
    caption: &str,
    cells: impl Iterator<Item = (&'a CellName, &'a R)>,
) -> Builder<(&'a CellName, &'a R)> {
    Builder::new(caption, cells)
        .name("", "participant", &|cell| {
            cell.0.participant.as_str().to_owned()
        })
        .name("condition", "condition", &|cell| {
            cell.0.condition.as_str().to_owned()
        })
}

const WEBER_FRACTION: &str =
    "ΔI/I: the Weber fraction, the distance of the threshold from the standard divided by it.";
const POOLED: &str = "Pooled: the median in the model of all participants, which draws thresholds of few trials towards those of \
                      the others.";

/// Each participant and condition.
fn thresholds(results: &PartResults) -> Table {
    let reversals = |cell: &CellName| {
        let staircase = results.track.get(cell)?.staircase.as_ref()?;
        staircase.estimate.number()
    };
    // Only staircases have them; those of several tracks of a condition are in their figures.
    let staircases = results.psy.keys().any(|cell| reversals(cell).is_some());
    let model = results.over.psy_population.as_ref();
    let pooled = |cell: &CellName| model?.participant.get(cell);
    let is_pooled = model.is_some_and(PopulationModel::has_converged);
    let interval = |head: &str| page("95 %").file(head);
    let adaptive = results.track.values().any(|t| t.quest_plus.is_some());
    // Of tracks that count their levels from a standard.
    let above = results.psy.values().any(|f| f.above_standard.is_some());
    let logarithms = results.psy.values().any(|f| f.trials.log_scale.is_some());
    let table = of_cells::<Function>("Thresholds", results.psy.iter())
        .field(column("trials", "n_trials"), count, |c| {
            &c.1.trials.n_trials
        })
        .field(
            column("threshold", "threshold").explained(threshold_note(logarithms, staircases)),
            plain,
            |c| {
                let threshold = &c.1.posterior.threshold;
                threshold.median.as_ref().unwrap_or(&threshold.mean)
            },
        )
        .ends(interval("threshold_ci95"), plain, &|c| {
            c.1.posterior.threshold.ci95.as_ref()?.ends()
        })
        .number(file("increment").when(above), plain, &|c| {
            c.1.above_standard.as_ref()?.increment.number()
        })
        .ends(file("increment_ci95").when(above), plain, &|c| {
            c.1.above_standard.as_ref()?.increment_ci95.ends()
        })
        .number(
            column("ΔI/I", "weber_fraction")
                .explained(WEBER_FRACTION.to_owned())
                .droppable(3)
                .when(above),
            plain,
            &|c| c.1.above_standard.as_ref()?.weber_fraction.number(),
        )
        .ends(
            interval("weber_fraction_ci95").droppable(3).when(above),
            plain,
            &|c| {
                c.1.above_standard
                    .as_ref()?
                    .weber_fraction_ci95
                    .as_ref()?
                    .ends()
            },
        )
        .number(
            column("pooled", "pooled_threshold")
                .explained(POOLED.to_owned())
                .droppable(2)
                .when(is_pooled),
            plain,
            &|c| pooled(c.0)?.median.number(),
        )
        .ends(
            interval("pooled_threshold_ci95")
                .droppable(2)
                .when(is_pooled),
            plain,
            &|c| pooled(c.0)?.ci95.ends(),
        )
        .field(column("width", "width"), plain, |c| {
            &c.1.posterior.width.mean
        })
        .ends(interval("width_ci95"), plain, &|c| {
            c.1.posterior.width.ci95.as_ref()?.ends()
        })
        .field(column("ML", "ml_threshold"), plain, |c| &c.1.ml.threshold)
        .field(file("map_threshold"), plain, |c| &c.1.map.threshold)
        .number(file("quest_plus_threshold").when(adaptive), plain, &|c| {
            let posterior = &results.track.get(c.0)?.quest_plus.as_ref()?.posterior;
            // The name of the parameter follows from the function.
            let location = posterior.get("threshold").or(posterior.get("mean"))?;
            location.mean.number()
        })
        .number(
            column("reversals", "reversal_mean").when(staircases),
            plain,
            &|c| reversals(c.0),
        )
        .done();
    if table.is_empty() {
        return table;
    }
    let mut notes = Vec::new();
    let mut reasons: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for (cell, function) in &results.psy {
        if let Some(why) = function.ml.threshold.reason() {
            let [participant, condition] =
                [cell.participant.as_str(), cell.condition.as_str()].map(name);
            let whose = format!("{participant} {condition}");
            reasons.entry(why).or_default().push(whose);
        }
    }
    if !reasons.is_empty() {
        let rests = "Without a maximum of the likelihood a posterior rests on its priors as much as on the answers; see its interval.";
        notes.push(rests.to_owned());
    }
    let of_reason = |(why, whose): (&str, Vec<String>)| {
        format!("{}: no maximum of the likelihood: {why}.", listing(&whose))
    };
    notes.extend(reasons.into_iter().map(of_reason));
    notes.extend(
        results
            .over
            .psy_group
            .iter()
            .filter_map(|(condition, found)| {
                let found = &found.posterior_threshold;
                Some(format!(
                    "{}: geometric mean {} {} of {} participants.",
                    name(condition.as_str()),
                    plain(found.geometric_mean.number()?),
                    interval_or_dash(found.ci95.ends(), plain),
                    found.n.number().unwrap_or_default(),
                ))
            }),
    );
    table.with_notes(notes)
}

/// What the columns of the thresholds are.
fn threshold_note(logarithms: bool, staircases: bool) -> String {
    let scale = match logarithms {
        true => {
            ", over logarithms: the threshold is a level, the width the natural logarithm of a ratio"
        }
        false => "",
    };
    let reversals = match staircases {
        true => " Reversals: the mean of the last reversals, where the rule settles.",
        false => "",
    };
    format!(
        "Threshold: the level at which the function without guesses and lapses is ½. Width: from .05 to \
         .95 of it. The threshold is a posterior median, the width a posterior mean{scale}.{reversals}"
    )
}

/// A number of trials or people.
fn count(n: f64) -> String {
    n.to_string()
}

/// Thresholds of the mixed model, by condition.
fn conditions(results: &PartResults) -> Table {
    let model = results.over.psy_mixed.as_ref();
    let all = model.into_iter().flat_map(|m| &m.conditions);
    let all: Vec<_> = all.filter(|c| c.1.mean().is_some()).collect();
    let ratios = all.iter().any(|c| c.1.geometric_mean.is_some());
    let ratios = ratios.then(|| "Geometric means; contrasts are ratios.".to_owned());
    let why = model.and_then(|m| m.test.f.reason());
    let why = why.map(|why| format!("No comparison of conditions: {}.", Untrusted(why)));
    Builder::new("Thresholds by condition, mixed model", all)
        .name("", "condition", &|c| c.0.as_str().to_owned())
        .number(column("mean", "mean"), plain, &|c| c.1.mean())
        .ends(column("95 %", "mean_ci95"), plain, &|c| {
            c.1.ci95.as_ref()?.ends()
        })
        .notes(ratios.into_iter().chain(why))
}

/// Contrasts of thresholds.
fn contrasts(results: &PartResults) -> Table {
    let model = results.over.psy_mixed.as_ref();
    of_model("Contrasts of thresholds", model)
}

/// Contrasts of estimated magnitudes.
fn magnitude_contrasts(results: &PartResults) -> Table {
    let model = results.magnitude_mixed.as_ref();
    of_model("Contrasts of estimated magnitudes", model)
}

fn of_model(caption: &str, model: Option<&ConditionModel>) -> Table {
    let pairs = model.into_iter().flat_map(|m| &m.pairs);
    of_pairs(caption, "conditions", pairs).done()
}

/// Contrasts of groups and of sessions.
fn group_pairs(results: &PartResults) -> Table {
    let again = &results.over.again;
    let groups = again.groups.iter().flat_map(|g| &g.pairs);
    let sessions = again.sessions.iter().flat_map(|s| &s.pairs);
    let caption = "Contrasts of groups and sessions";
    of_pairs(caption, "names", groups.chain(sessions))
        .field(column("g", "hedges_g"), two, |c| &c.1.hedges_g)
        .done()
}

/// By how much more one group changes than another, from the first session to the last.
fn group_changes(results: &PartResults) -> Table {
    let courses = results.over.again.groups_sessions.iter();
    let caption = "Changes from the first session to the last";
    of_pairs(caption, "groups", courses.flat_map(|g| &g.changes))
        .field(column("g", "hedges_g"), two, |c| &c.1.hedges_g)
        .done()
}

/// The columns that all contrasts have: ratios or differences.
fn of_pairs<'a>(
    caption: &str,
    file: &str,
    pairs: impl Iterator<Item = (&'a PairName, &'a Contrast)>,
) -> Builder<(&'a PairName, &'a Contrast)> {
    let all = pairs.filter(|c| c.1.estimate().1.is_some());
    Builder::new(caption, all)
        .name("", file, &|(pair, contrast)| {
            let sign = if contrast.ratio.is_some() {
                " / "
            } else {
                " − "
            };
            pair.names().join(sign)
        })
        .number(column("estimate", "estimate"), plain, &|c| c.1.estimate().1)
        .ends(column("95 %", "estimate_ci95"), plain, &|c| c.1.ci95.ends())
        .field(column("t", "t"), two, |c| &c.1.t)
        .field(column("df", "df"), two, |c| &c.1.df)
        .field(column("p (Holm)", "p_holm"), bare_p, |c| &c.1.p_holm)
}

/// Means of groups and of sessions.
fn groups(results: &PartResults) -> Table {
    let (groups, sessions) = (&results.over.again.groups, &results.over.again.sessions);
    let of_groups = groups.iter().flat_map(|g| &g.groups);
    let of_groups = of_groups.map(|(name, center)| (name.as_str(), center));
    let of_sessions = sessions.iter().flat_map(|s| &s.conditions);
    let of_sessions = of_sessions.map(|(name, center)| (name.as_str(), center));
    let means = (of_groups.chain(of_sessions)).filter(|(_, center)| center.mean().is_some());
    let why = [
        ("groups", groups.as_ref().map(|g| &g.test.f)),
        ("sessions", sessions.as_ref().map(|s| &s.test.f)),
    ];
    let why = why.into_iter().filter_map(|(kind, f)| {
        let why = Untrusted(f?.reason()?);
        Some(format!("No comparison of {kind}: {why}."))
    });
    Builder::new("Groups and sessions", means)
        .name("", "name", &|(name, _)| name.to_owned())
        .field(column("n", "n"), count, |(_, c)| &c.n)
        .number(column("mean", "mean"), plain, &|(_, c)| c.mean())
        .number(column("SD", "sd"), plain, &|(_, c)| c.sd())
        .ends(column("95 %", "mean_ci95"), plain, &|(_, c)| {
            c.ci95.as_ref()?.ends()
        })
        .notes(why)
}

fn comparisons(results: &PartResults) -> Table {
    let all = results.psy.iter();
    let compared = all.filter_map(|(cell, f)| Some((cell, f.with_standard.as_ref()?)));
    let compared = compared.filter(|(_, found)| found.pse.number().is_some());
    of_cells("Comparisons with the standard", compared)
        .field(column("PSE", "pse"), plain, |c| &c.1.pse)
        .ends(column("95 %", "pse_ci95"), plain, &|c| c.1.pse_ci95.ends())
        .field(column("constant error", "constant_error"), plain, |c| {
            &c.1.constant_error
        })
        .field(column("JND", "jnd"), plain, |c| &c.1.jnd)
        .field(column("Weber fraction", "weber_fraction"), plain, |c| {
            &c.1.weber_fraction
        })
        .done()
}

/// With two decimals; what is 0 but for rounding is 0.
fn two_or_0(x: f64) -> String {
    two(if x.abs() < 1e-9 { 0.0 } else { x })
}

fn sensitivities(results: &PartResults) -> Table {
    let groups = results.over.sdt_group.iter().filter_map(|(group, found)| {
        Some(format!(
            "{}: mean d′ {} {} of {} participants.",
            name(group.as_str()),
            two(found.d.mean.number()?),
            interval_or_dash(found.d.ci95.ends(), two),
            found.n.number().unwrap_or_default(),
        ))
    });
    of_cells::<Sensitivity>("Sensitivities", results.sdt.iter())
        .number(column("d′", "d"), two, &|c| c.1.d().0)
        .ends(column("95 %", "d_ci95"), two, &|c| c.1.d().1)
        .number(column("bias", "bias"), two_or_0, &|c| c.1.bias())
        .notes(groups)
}

/// Items, the most preferred first.
fn abilities(results: &PartResults) -> Table {
    let pairs = results.pairs.as_ref();
    let mut items: Vec<(&RealizationName, &Ability)> =
        pairs.into_iter().flat_map(|p| &p.items.0).collect();
    let order = |item: &(&RealizationName, &Ability)| item.1.ability.number().unwrap_or(f64::MIN);
    items.small_sort_by(|a, b| order(b).total_cmp(&order(a)));
    let mut notes = Vec::new();
    if let Some(why) = items.first().and_then(|item| item.1.ability.reason()) {
        notes.push(format!("No abilities: {}.", Untrusted(why)));
        items.clear();
    } else if let Some(effect) = pairs.and_then(|p| p.order.as_ref())
        && let Some(order) = effect.order.number()
    {
        let p = or_dash(effect.order_p.number(), apa::p);
        notes.push(format!(
            "Order: {} for what is presented first, p {p}.",
            two(order)
        ));
    }
    Builder::new("Preferences", items)
        .name("", "realization", &|item| item.0.as_str().to_owned())
        .field(column("ability", "ability"), two_or_0, |i| &i.1.ability)
        .field(column("SE", "se"), two, |i| &i.1.ability_se)
        .ends(column("95 %", "ability_ci95"), two, &|i| {
            i.1.ability_ci95.ends()
        })
        .notes(notes)
}

/// Differences of abilities.
fn differences(results: &PartResults) -> Table {
    let pairs = results.pairs.iter().flat_map(|p| &p.pairs);
    let pairs = pairs.filter(|p| p.1.difference.number().is_some());
    Builder::new("Differences of abilities", pairs)
        .name("", "realizations", &|p| p.0.names().join(" − "))
        .field(column("difference", "difference"), two_or_0, |p| {
            &p.1.difference
        })
        .field(column("SE", "se"), two, |p| &p.1.se)
        .field(column("clustered", "se_clustered"), two, |p| {
            &p.1.se_clustered
        })
        .field(column("preferred", "preferred"), two, |p| &p.1.preferred)
        .field(column("p (Holm)", "p_holm"), bare_p, |p| &p.1.p_holm)
        .done()
}
