//! Similarity of a study.

use super::part_data::{Found, Intervals, PartData};
use super::results::PartResults;
use super::similarity::{Properties, SimilarityRow, similarity};
use crate::analyze::Rules;
use crate::analyze::warning::Warning;
use std::collections::BTreeMap;
use study_base::text::{ModelId, Untrusted, counted};
use study_plan::protocol::parts::Part;
use study_plan::protocol::{Answer, Protocol, Similarity};
use study_session::outcome::RatingRow;

/// The ratings of a part.
pub(super) fn of_similarity(
    protocol: &Protocol,
    part: &Part,
    own: &Similarity,
    (rows, intervals): (&[&RatingRow], &Intervals<'_>),
    rules: &Rules,
) -> Found {
    let rated = |row: &&RatingRow| {
        let item = |interval: u32| {
            let felt = intervals.counted(row).iter();
            let model = felt
                .filter(|i| i.interval == interval)
                .find_map(|i| i.model.as_ref());
            Some(model?.as_str().to_owned())
        };
        Some(SimilarityRow {
            participant: row.participant.as_str().to_owned(),
            first: item(1)?,
            second: item(2)?,
            rating: row
                .answers
                .get(part.asks.first()?)
                .and_then(Answer::number)?,
        })
    };
    let ratings: Vec<SimilarityRow> = rows.iter().filter_map(rated).collect();
    let properties = properties(protocol, own);
    let mut results = PartResults::undefined("");
    let streams = (rules.seed, part.id.as_str());
    results.over.similarity = Some(similarity(&ratings, &properties, streams));
    Found {
        task: "similarity",
        trials: ratings.len(),
        results,
        warnings: self_check(&ratings).into_iter().collect(),
        names: Vec::new(),
        data: PartData::default(),
    }
}

/// What the protocol knows of the realizations: the level of a family, VAF, and covariates that all of them have.
fn properties(protocol: &Protocol, own: &Similarity) -> Properties {
    let by = |of: &dyn Fn(&ModelId) -> Option<f64>| -> Option<BTreeMap<String, f64>> {
        let one = |id: &ModelId| Some((id.as_str().to_owned(), of(id)?));
        own.models.iter().map(one).collect()
    };
    let level = by(&|id| protocol.level_of(id));
    let vaf = by(&|id| protocol.model(id)?.vaf);
    let mut names: Vec<&String> = (own.models.first())
        .and_then(|id| protocol.model(id))
        .into_iter()
        .flat_map(|model| model.covariates.keys())
        .collect();
    names.sort_unstable();
    let covariates: Vec<BTreeMap<String, f64>> = (names.into_iter())
        .filter_map(|name| by(&|id| protocol.model(id)?.covariates.get(name).copied()))
        .collect();
    let sets = [
        ("level", level.into_iter().collect()),
        ("VAF", vaf.into_iter().collect()),
        ("covariates", covariates),
    ];
    let known = sets
        .into_iter()
        .filter(|set: &(_, Vec<_>)| !set.1.is_empty());
    known.map(|(name, set)| (name.to_owned(), set)).collect()
}

/// Participants who rate identical pairs as different as others.
fn self_check(ratings: &[SimilarityRow]) -> Option<Warning> {
    let mut sums: BTreeMap<(&str, bool), (f64, f64)> = BTreeMap::new();
    for row in ratings {
        let sum = sums
            .entry((&row.participant, row.first == row.second))
            .or_default();
        *sum = (sum.0 + row.rating, sum.1 + 1.0);
    }
    let mean = |who: &str, identical: bool| sums.get(&(who, identical)).map(|sum| sum.0 / sum.1);
    let all = sums.keys().filter(|(_, identical)| *identical);
    let doubtful: Vec<String> = all
        .filter(|(who, _)| match (mean(who, true), mean(who, false)) {
            (Some(same), Some(different)) => same >= different,
            _ => false,
        })
        .map(|(who, _)| Untrusted(who).to_string())
        .collect();
    (!doubtful.is_empty()).then(|| Warning {
        code: "identical-pairs",
        text: format!(
            "{} rated identical pairs as different as other ones, or more: {}",
            counted(doubtful.len(), "participant", "participants"),
            doubtful.join(", ")
        ),
    })
}
