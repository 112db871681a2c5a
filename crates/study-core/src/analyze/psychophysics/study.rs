//! The tracks and pairs of a study.

use super::preferences::{Choice, Preference, in_both_orders, preferences};
use super::trials::{Asked, TrialCount, TrialSettings, discrimination};
use crate::analyze::select::{Include, Whose, state_counts};
use crate::analyze::values::Values;
use crate::outcome::ratings::Origin;
use crate::outcome::{IntervalRow, ParticipantRow, RatingRow, Status};
use crate::protocol::parts::{Compared, Part, Task, TrackRules};
use crate::protocol::{Answer, Protocol};
use std::collections::BTreeSet;
use study_base::text::{PartId, ParticipantId};
use study_stats::psychometric::{Core, Support};

/// The statistics of one part of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct PartAnalysis {
    /// The part.
    pub part: PartId,
    /// The kind of its trials, as in `[[tracks]] method`, or `pairs`.
    pub task: &'static str,
    /// Number of trials with an answer that counts.
    pub trials: usize,
    /// Whether answers of pilots are among them.
    pub pilot: bool,
    /// Whether answers of simulated participants are among them.
    pub simulated: bool,
    /// The statistics.
    pub values: Values,
}

/// The statistics of all parts that are not ratings. Which participants count is decided
/// as for ratings, except that exclusion rules are not applied. Practice and trials without
/// an answer do not count. Answers are the corrected ones, at the levels that were presented.
pub fn parts(
    protocol: &Protocol,
    rows: &[RatingRow],
    intervals: &[IntervalRow],
    participants: &[ParticipantRow],
    include: Include,
) -> Vec<PartAnalysis> {
    let origin = |row: &RatingRow| Origin::of(row.simulated, row.pilot);
    let origins: Vec<Origin> = rows.iter().map(origin).collect();
    let whose = Whose::of(&origins, include);
    let unfinished = protocol.analysis.unfinished;
    let left_out: BTreeSet<&ParticipantId> = (participants.iter())
        .filter(|p| !state_counts(p.state, unfinished))
        .map(|p| &p.participant)
        .collect();
    let counts = |r: &&RatingRow| {
        let counts = whose.counts(origin(r)) && !left_out.contains(&r.participant);
        counts && !r.practice && r.status == Status::Ok
    };
    let rows: Vec<&RatingRow> = rows.iter().filter(counts).collect();
    let one = |part: &Part| {
        let of_part = |r: &&&RatingRow| r.part.as_ref() == Some(&part.id);
        let rows: Vec<&RatingRow> = rows.iter().filter(of_part).copied().collect();
        let (task, trials, values) = match &part.task {
            Task::Rating(_) => return None,
            Task::Pairs(pairs) => {
                let chosen = |row: &&RatingRow| preference(part, row, intervals);
                let chosen: Vec<Preference> = rows.iter().filter_map(chosen).collect();
                let values = preferences(&chosen, pairs.tie, in_both_orders(&chosen));
                ("pairs", chosen.len(), values)
            }
            Task::Discrimination { tracks } => {
                let tracks: Vec<&TrackRules> = (tracks.iter())
                    .filter_map(|id| protocol.tracks.iter().find(|t| t.id == *id))
                    .collect();
                let method = tracks.first()?.method.as_str();
                let (asked, name) = *Asked::NAMES.iter().find(|n| n.1 == method)?;
                let count = |row: &&RatingRow| trial(part, asked, row);
                let counts: Vec<TrialCount> = rows.iter().filter_map(count).collect();
                let settings = settings(protocol, &tracks);
                let values = discrimination(asked, &counts, &settings);
                (name, counts.len(), values)
            }
        };
        Some(PartAnalysis {
            part: part.id.clone(),
            task,
            trials,
            pilot: rows.iter().any(|r| r.pilot),
            simulated: rows.iter().any(|r| r.simulated),
            values,
        })
    };
    protocol.parts.iter().filter_map(one).collect()
}

/// The answer to the part's own question.
fn chosen<'a>(part: &Part, row: &'a RatingRow) -> Option<&'a str> {
    match row.answers.get(part.asks.first()?)? {
        Answer::Choice(chosen) => chosen.first().map(String::as_str),
        _ => None,
    }
}

fn preference(part: &Part, row: &RatingRow, intervals: &[IntervalRow]) -> Option<Preference> {
    let item = |interval: u32| {
        let of_it = |i: &&IntervalRow| {
            i.participant == row.participant
                && i.session == row.session
                && i.trial == row.trial
                && Some(i.attempt) == row.attempt
                && i.interval == interval
        };
        let found = intervals.iter().find(of_it)?;
        Some(found.model.as_ref()?.as_str().to_owned())
    };
    Some(Preference {
        participant: row.participant.as_str().to_owned(),
        first: item(1)?,
        second: item(2)?,
        choice: match chosen(part, row)? {
            "first" => Choice::First(1.0),
            "second" => Choice::Second(1.0),
            _ => Choice::Tie(1.0),
        },
    })
}

fn trial(part: &Part, asked: Asked, row: &RatingRow) -> Option<TrialCount> {
    let correct = row.correct?;
    let given = chosen(part, row)?;
    let words = asked.answers();
    let given = words.iter().position(|word| *word == given)?;
    // Of two answers, the one that was not given is correct if the given one is wrong; of
    // three, the sensitivities need only whether it is.
    let target = match (correct, words.len()) {
        (true, _) => Some(given),
        (false, 2) => Some(1 - given),
        (false, count) => Some((given + 1) % count),
    };
    Some(TrialCount {
        participant: row.participant.as_str().to_owned(),
        condition: row.track.as_ref()?.as_str().to_owned(),
        level: row.level,
        target,
        positive: f64::from(u8::from(correct)),
        trials: 1.0,
    })
}

/// How the functions of a part's tracks are fitted: the priors refer to the range of the
/// ladder, since an adaptive track stays near the threshold.
fn settings(protocol: &Protocol, tracks: &[&TrackRules]) -> TrialSettings {
    let ladders = tracks.iter().filter_map(|track| match &track.compared {
        Compared::Levels { family, .. } => protocol.families.iter().find(|f| f.id == *family),
        Compared::Models { .. } => None,
    });
    let support = |levels: &[f64]| {
        let steps = levels.windows(2).map(|pair| pair[1] - pair[0]);
        Some(Support {
            low: *levels.first()?,
            high: *levels.last()?,
            least: steps.fold(f64::INFINITY, f64::min),
        })
    };
    let mut supports: Vec<Support> = ladders.filter_map(|f| support(f.ladder.levels())).collect();
    supports.dedup_by(|a, b| (a.low, a.high, a.least) == (b.low, b.high, b.least));
    TrialSettings {
        core: Core::Norm,
        lambda: 0.02,
        standard: None,
        // Tracks of different families have no common range.
        support: supports.pop().filter(|_| supports.is_empty()),
        repeats: 0,
        seed: protocol.study.seed,
    }
}
