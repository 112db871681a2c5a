//! The preregistered exclusion rules, applied to the trials of a part that is no rating.
//!
//! A rule that speaks of points of a scale has no meaning where something is chosen; it
//! excludes nothing, and says so. Every rule judges the same trials.

use super::part_data::Intervals;
use crate::analyze::exclude::{Applied, UNJUDGED, is_unverified, is_wrong};
use crate::outcome::{RatingRow, Verdict};
use crate::protocol::{Answer, Exclusion, Part};
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::ParticipantId;

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
    part: &Part,
    rows: &[&RatingRow],
    intervals: &Intervals<'_>,
) -> (Vec<bool>, Vec<Applied>) {
    let mut stays = vec![true; rows.len()];
    let mut applied = Vec::new();
    for rule in rules {
        let mut problem = None;
        let judged = match rule {
            Exclusion::ConstantRater => Judged::Participants(constant(part, rows)),
            Exclusion::StrokesBelow(least) => Judged::Strokes(*least),
            Exclusion::WrongForce => Judged::Force(is_wrong),
            Exclusion::UnverifiedForce => Judged::Force(is_unverified),
            Exclusion::HiddenReferenceBelow(_) | Exclusion::Inconsistent(_) => {
                Judged::Nothing(NO_POINTS)
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

/// Participants with two trials or more who gave the same answer in all of them.
fn constant<'a>(part: &Part, rows: &[&'a RatingRow]) -> BTreeSet<&'a ParticipantId> {
    let mut given: BTreeMap<&ParticipantId, Vec<&Answer>> = BTreeMap::new();
    for row in rows {
        let answer = part.asks.first().and_then(|id| row.answers.get(id));
        given.entry(&row.participant).or_default().extend(answer);
    }
    let same = |answers: &[&Answer]| answers.len() > 1 && answers.iter().all(|a| a == &answers[0]);
    let constant = given.into_iter().filter(|(_, answers)| same(answers));
    constant.map(|(who, _)| who).collect()
}
