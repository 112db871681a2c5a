//! Rankings of a study.

use super::part_data::{Found, Intervals, PartData};
use super::ranking::{RankingRow, Rankings, levels, ranking};
use super::results::PartResults;
use crate::analyze::Rules;
use crate::analyze::record::Number as _;
use crate::analyze::warning::Warning;
use std::collections::{BTreeMap, BTreeSet};
use study_base::sort::SmallSort as _;
use study_base::text::{ModelId, QuestionId, counted};
use study_plan::protocol::parts::Part;
use study_plan::protocol::{Answer, Ranking};
use study_session::outcome::RatingRow;

/// The ranks of a part.
pub(super) fn of_ranking(
    part: &Part,
    own: &Ranking,
    (rows, intervals): (&[&RatingRow], &Intervals<'_>),
    rules: &Rules,
) -> Found {
    let ranked = |row: &&RatingRow| -> Vec<RankingRow> {
        let felt = intervals.counted(row);
        let rank = |(at, question): (usize, &QuestionId)| {
            let mut interval = felt.iter().filter(|i| i.interval as usize == at + 1);
            let model = interval.find_map(|i| i.model.as_ref())?;
            Some(RankingRow {
                participant: row.participant.as_str().to_owned(),
                ranking: format!("{} {}", row.session, row.trial),
                realization: model.as_str().to_owned(),
                rank: row.answers.get(question).and_then(Answer::number)?,
            })
        };
        let asked = own.asked(&part.asks).iter().enumerate();
        asked.filter_map(rank).collect()
    };
    let ranks: Vec<RankingRow> = rows.iter().flat_map(ranked).collect();
    let mut found = ranking(&ranks, (rules.seed, part.id.as_str()));
    if is_one_order(rows, intervals) {
        found.cannot_be_told(ONE_ORDER);
    }
    let mut warnings: Vec<Warning> = tied(&ranks).filter(|_| !own.ties).into_iter().collect();
    warnings.extend(apart(&found));
    let mut results = PartResults::undefined("");
    results.over.ranking = Some(found);
    Found {
        task: "ranking",
        trials: rankings(&ranks).len(),
        results,
        warnings,
        names: Vec::new(),
        data: PartData::default(),
    }
}

const ONE_ORDER: &str = "everybody felt the realizations in the same order, so that ranks may follow it in place of them; \
                         present them in several orders";

/// Whether all of several rankings had the realizations in one order.
fn is_one_order(rows: &[&RatingRow], intervals: &Intervals<'_>) -> bool {
    let order = |row: &&RatingRow| -> Vec<(u32, ModelId)> {
        let felt = intervals.counted(row).iter();
        let mut felt: Vec<(u32, ModelId)> = felt
            .filter_map(|i| Some((i.interval, i.model.clone()?)))
            .collect();
        felt.small_sort();
        felt
    };
    let orders: Vec<Vec<(u32, ModelId)>> = rows.iter().map(order).collect();
    orders.len() > 1 && orders.windows(2).all(|two| two[0] == two[1])
}

/// The ranks of each ranking.
fn rankings(ranks: &[RankingRow]) -> BTreeMap<(&str, &str), Vec<f64>> {
    let mut all: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    for row in ranks {
        all.entry((&row.participant, &row.ranking))
            .or_default()
            .push(row.rank);
    }
    all
}

/// Realizations that were above all others in every ranking: how their worths are to be read.
fn apart(found: &Rankings) -> Option<Warning> {
    let levels = levels(found);
    let names: Vec<String> = levels.iter().map(|names| names.join(" and ")).collect();
    let is_tested = (found.pairs.values())
        .any(|pair| pair.worths.p.number().is_some() && pair.worths.difference.number().is_none());
    let over = match found.n_participants.number() {
        Some(1.0) => "rankings",
        _ => "participants",
    };
    let tested = match is_tested {
        true => format!(" and is tested by the sign test over {over}"),
        false => String::new(),
    };
    (levels.len() > 1).then(|| Warning {
        code: "ranked-apart",
        text: format!(
            "every ranking had {}: the difference of their worths has no upper limit. Worths are the limit of the model's likelihood, \
             those within each of these levels; a difference between two levels has a lower bound only (exact){tested}",
            names.join(" above ")
        ),
    })
}

/// Equal ranks in a part without ties: a correction, in which each rank is changed on its own, can make them.
fn tied(ranks: &[RankingRow]) -> Option<Warning> {
    let is_tied = |own: &&Vec<f64>| {
        let different: BTreeSet<u64> = own.iter().map(|rank| rank.to_bits()).collect();
        different.len() < own.len()
    };
    let n = rankings(ranks).values().filter(is_tied).count();
    (n > 0).then(|| Warning {
        code: "tied-ranks",
        text: format!(
            "{} equal ranks, which were corrected: they count as ties",
            counted(n, "ranking has", "rankings have")
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What everybody puts first is tested over participants, of one person over rankings, and not at all in one order.
    #[test]
    fn levels_are_said_with_the_test_that_there_is() {
        let rows = |people: u32| -> Vec<RankingRow> {
            let of = |person: u32| {
                [("a", 1.0), ("b", 2.0)].map(|(realization, rank)| RankingRow {
                    participant: format!("P{person}"),
                    ranking: "1".to_owned(),
                    realization: realization.to_owned(),
                    rank,
                })
            };
            (0..people).flat_map(of).collect()
        };
        let said = |found: &Rankings| apart(found).unwrap().text;
        let mut several = ranking(&rows(6), (1, "order"));
        assert!(said(&several).ends_with("is tested by the sign test over participants"));
        let one = ranking(&rows(1), (1, "order"));
        assert!(said(&one).ends_with("is tested by the sign test over rankings"));
        several.cannot_be_told(ONE_ORDER);
        assert!(said(&several).ends_with("has a lower bound only (exact)"));
    }
}
