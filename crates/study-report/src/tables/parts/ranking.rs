//! The tables of rankings.

use super::{column, count};
use crate::apa::{bare_p, or_dash, two};
use crate::table::{Builder, Table, file};
use study_analysis::analyze::psychophysics::results::{AbilityDifference, PartResults, Rankings};
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;
use study_base::text::Untrusted;

fn found(results: &PartResults) -> Option<&Rankings> {
    results.over.ranking.as_ref()
}

const LEVELS: &str = "Level: in every ranking those of a level were above all of lower ones, so that the difference of their worths has no \
                      upper limit. Worths are the limit of the model: their logarithms sum to 0 within a level and compare only what is \
                      within it, and only the highest level can have the first rank.";

/// Realizations, that with the first ranks first.
pub(super) fn realizations(results: &PartResults) -> Table {
    let own = found(results);
    let mut items: Vec<_> = own.into_iter().flat_map(|own| &own.items).collect();
    items.small_sort_by(|a, b| {
        let order = [a, b].map(|item| item.1.mean_rank.number().unwrap_or(f64::INFINITY));
        order[0].total_cmp(&order[1])
    });
    let in_levels = items.iter().any(|item| item.1.level.is_some());
    let mut notes = Vec::new();
    // Without worths no realization has one, not even the probability of the first rank.
    if let Some(why) = items.first().and_then(|item| item.1.worth.reason()) {
        notes.push(format!("No worths: {}.", Untrusted(why)));
    }
    let incomplete = own.and_then(|own| own.n_incomplete.number());
    if let Some(n) = incomplete.filter(|n| *n > 0.0) {
        notes.push(format!("Rankings without a rank of some realization: {n}."));
    }
    let note = "Mean rank: over participants, 1 is the first. First: share of rankings in which nothing was above it. Worth: probability of the \
                first rank by the model of Plackett and Luce.";
    Builder::new("Ranks", items)
        .name("realization", "realization", &|item| {
            item.0.as_str().to_owned()
        })
        .field(column("rankings", "n"), count, |i| &i.1.n)
        .field(
            column("level", "level")
                .explained(LEVELS.to_owned())
                .when(in_levels),
            count,
            |i| &i.1.level,
        )
        .field(
            column("mean rank", "mean_rank").explained(note.to_owned()),
            two,
            |i| &i.1.mean_rank,
        )
        .field(column("SD", "sd").droppable(1), two, |i| &i.1.sd)
        .field(column("first", "first").droppable(2), two, |i| &i.1.first)
        .field(column("worth", "worth"), two, |i| &i.1.worth)
        .field(column("log worth", "log_worth"), two, |i| &i.1.log_worth)
        .field(column("SE", "log_worth_se").droppable(1), two, |i| {
            &i.1.log_worth_se
        })
        .ends(column("95 %", "log_worth_ci95"), two, &|i| {
            i.1.log_worth_ci95.ends()
        })
        .notes(notes)
}

const ONE_END: &str = "One end: where one of the two was above the other in every ranking, the difference has only this end of its exact 95 % \
                       interval, the lower one if the first was above, and p is that of the sign test.";

/// The only end of the interval of a difference.
fn bound(pair: &AbilityDifference) -> Option<f64> {
    match (pair.ci95.lo.number(), pair.ci95.hi.number()) {
        (Some(end), None) | (None, Some(end)) => Some(end),
        _ => None,
    }
}

/// Pairs of realizations, with the ties.
pub(super) fn pairs(results: &PartResults) -> Table {
    let own = found(results);
    let pairs = own.into_iter().flat_map(|own| &own.pairs);
    let note = "Above: share of rankings in which the first of the two was above the other. Difference: of the logarithms of the worths.";
    let endless = (own.into_iter().flat_map(|own| &own.pairs))
        .any(|pair| pair.1.worths.difference.number().is_none() && bound(&pair.1.worths).is_some());
    let ties = own.into_iter().flat_map(|own| &own.ties);
    let ties = ties.map(|(size, tie)| {
        format!(
            "Ties of {}: ln δ = {}, SE {}.",
            size.as_str(),
            or_dash(tie.log_delta.number(), two),
            or_dash(tie.log_delta_se.number(), two)
        )
    });
    let ties: Vec<String> = ties.collect();
    Builder::new("Differences of ranks", pairs)
        .name("", "realizations", &|p| p.0.names().join(" − "))
        .field(file("n"), count, |p| &p.1.n)
        .field(
            column("above", "above").explained(note.to_owned()),
            two,
            |p| &p.1.above,
        )
        .field(column("tied", "tied"), two, |p| &p.1.tied)
        .field(column("difference", "difference"), two, |p| {
            &p.1.worths.difference
        })
        .number(
            column("one end", "end")
                .explained(ONE_END.to_owned())
                .when(endless),
            two,
            &|p| bound(&p.1.worths),
        )
        .field(column("SE", "se").droppable(1), two, |p| &p.1.worths.se)
        .field(column("clustered", "se_clustered").droppable(1), two, |p| {
            &p.1.worths.se_clustered
        })
        .field(column("p (Holm)", "p_holm"), bare_p, |p| &p.1.worths.p_holm)
        .notes(ties)
}

/// Participants.
pub(super) fn participants(results: &PartResults) -> Table {
    let participants = found(results).into_iter().flat_map(|own| &own.participants);
    let note = "With others: Spearman's correlation of the mean ranks with those of all other participants. Own W: Kendall's W of the \
                participant's rankings.";
    Builder::new("Rankings by participant", participants)
        .name("participant", "participant", &|p| p.0.as_str().to_owned())
        .field(column("rankings", "n"), count, |p| &p.1.n)
        .field(
            column("with others", "with_others").explained(note.to_owned()),
            two,
            |p| &p.1.with_others,
        )
        .field(column("own W", "own_w"), two, |p| &p.1.own_w)
        .done()
}
