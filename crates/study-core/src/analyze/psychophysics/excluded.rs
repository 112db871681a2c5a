//! The preregistered exclusion rules, applied to the trials of a part.
//!
//! A rule that speaks of points of a scale has no meaning where something is chosen; it
//! excludes nothing, and says so. Every rule judges the same trials.

use super::part_data::{Intervals, asked};
use crate::analyze::exclude::{Applied, UNJUDGED, is_unverified, is_wrong};
use crate::outcome::{RatingRow, Verdict};
use crate::protocol::{Answer, Exclusion, Part, Protocol, Role};
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::{ModelId, ParticipantId};
use study_stats::describe::{mean, rounded};

/// Whom or what a rule excludes.
enum Judged<'a> {
    Participants(BTreeSet<&'a ParticipantId>),
    /// Trials with fewer strokes in an interval, and whether those of a trial are unknown.
    Strokes(f64),
    /// Trials whose worst playback was judged so.
    Force(fn(Verdict) -> bool),
    Nothing(&'static str),
}

const NO_POINTS: &str = "the answers of this part are choices, not points of a scale";

/// Which trials stay, and the effect of each rule. A trial that several rules exclude is
/// counted for the first.
pub(super) fn apply(
    rules: &[Exclusion],
    (protocol, part): (&Protocol, &Part),
    rows: &[&RatingRow],
    intervals: &Intervals<'_>,
) -> (Vec<bool>, Vec<Applied>) {
    let mut stays = vec![true; rows.len()];
    let mut applied = Vec::new();
    for rule in rules {
        let mut problem = None;
        let judged = match rule {
            Exclusion::ConstantRater => Judged::Participants(constant(protocol, part, rows)),
            Exclusion::StrokesBelow(least) => Judged::Strokes(*least),
            Exclusion::WrongForce => Judged::Force(is_wrong),
            Exclusion::UnverifiedForce => Judged::Force(is_unverified),
            Exclusion::HiddenReferenceBelow(_) | Exclusion::Inconsistent(_)
                if !rows.iter().any(|row| rating(protocol, part, row).is_some()) =>
            {
                Judged::Nothing(NO_POINTS)
            }
            Exclusion::HiddenReferenceBelow(least) => {
                let is_reference = |row: &&&RatingRow| row.role == Role::HiddenReference;
                let own = rows.iter().filter(is_reference);
                let means = means(
                    own.filter_map(|row| Some((&row.participant, rating(protocol, part, row)?))),
                );
                match means.is_empty() {
                    true => Judged::Nothing("the part has no hidden reference"),
                    false => Judged::Participants(
                        means
                            .into_iter()
                            .filter(|(_, m)| m < least)
                            .map(|(who, _)| who)
                            .collect(),
                    ),
                }
            }
            Exclusion::Inconsistent(most) => {
                let distances = distances(protocol, part, rows);
                match distances.is_empty() {
                    true => Judged::Nothing("the part has no hidden duplicate"),
                    false => Judged::Participants(
                        (distances.into_iter().filter(|(_, d)| rounded(*d) > *most))
                            .map(|(who, _)| who)
                            .collect(),
                    ),
                }
            }
        };
        let excludes = |row: &RatingRow| match &judged {
            Judged::Participants(who) => who.contains(&row.participant),
            Judged::Strokes(least) => intervals
                .strokes(row)
                .is_some_and(|n| f64::from(n) < *least),
            Judged::Force(excludes) => {
                (row.fidelity.as_ref()).is_some_and(|worst| excludes(worst.verdict))
            }
            Judged::Nothing(_) => false,
        };
        match &judged {
            Judged::Nothing(why) => problem = Some(*why),
            Judged::Strokes(_) if rows.iter().any(|r| intervals.strokes(r).is_none()) => {
                problem = Some("the strokes of some trials are unknown; these trials stay");
            }
            Judged::Force(_) if rows.iter().any(|r| r.fidelity.is_none()) => {
                problem = Some(UNJUDGED);
            }
            Judged::Strokes(_) | Judged::Force(_) | Judged::Participants(_) => {}
        }
        let gone: Vec<usize> = (0..rows.len())
            .filter(|&i| stays[i] && excludes(rows[i]))
            .collect();
        let participants: BTreeSet<_> = gone.iter().map(|&i| &rows[i].participant).collect();
        applied.push(Applied {
            rule: *rule,
            rows: gone.len(),
            participants: participants.len(),
            problem,
        });
        for i in gone {
            stays[i] = false;
        }
    }
    (stays, applied)
}

/// The number that was given to the question of a part.
fn rating(protocol: &Protocol, part: &Part, row: &RatingRow) -> Option<f64> {
    row.answers.get(asked(protocol, part)?)?.number()
}

/// The mean of each key's numbers.
fn means<K: Ord>(numbers: impl Iterator<Item = (K, f64)>) -> BTreeMap<K, f64> {
    let mut all: BTreeMap<K, Vec<f64>> = BTreeMap::new();
    for (key, number) in numbers {
        all.entry(key).or_default().push(number);
    }
    let mean_of = |(key, x): (K, Vec<f64>)| Some((key, mean(&x)?));
    all.into_iter().filter_map(mean_of).collect()
}

/// The mean distance of each participant between realizations and their hidden duplicates.
fn distances<'a>(
    protocol: &Protocol,
    part: &Part,
    rows: &[&'a RatingRow],
) -> BTreeMap<&'a ParticipantId, f64> {
    let cells = means(rows.iter().filter_map(|row| {
        let model = row.model.as_ref()?;
        Some(((&row.participant, model), rating(protocol, part, row)?))
    }));
    let duplicates = protocol
        .models
        .iter()
        .filter_map(|m| Some((&m.id, m.duplicate_of.as_ref()?)));
    let duplicates: Vec<_> = duplicates.collect();
    let people: BTreeSet<&ParticipantId> = cells.keys().map(|(who, _)| *who).collect();
    means(people.into_iter().flat_map(|who| {
        let far = |(a, b): &(&ModelId, &ModelId)| {
            Some((cells.get(&(who, *a))? - cells.get(&(who, *b))?).abs())
        };
        let all: Vec<f64> = duplicates.iter().filter_map(far).collect();
        all.into_iter().map(move |d| (who, d))
    }))
}

/// Participants with two trials or more who gave the same answer in all of them.
fn constant<'a>(
    protocol: &Protocol,
    part: &Part,
    rows: &[&'a RatingRow],
) -> BTreeSet<&'a ParticipantId> {
    let mut given: BTreeMap<&ParticipantId, Vec<&Answer>> = BTreeMap::new();
    for row in rows {
        let answer = asked(protocol, part).and_then(|id| row.answers.get(id));
        given.entry(&row.participant).or_default().extend(answer);
    }
    let same = |answers: &[&Answer]| answers.len() > 1 && answers.iter().all(|a| a == &answers[0]);
    let constant = given.into_iter().filter(|(_, answers)| same(answers));
    constant.map(|(who, _)| who).collect()
}
