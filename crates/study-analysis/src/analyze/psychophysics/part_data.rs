//! What the parts of a study are analyzed from, and what is found of one.

use super::explored::Exploration;
use super::findings::PartFinding;
use super::identification::OwnConfusions;
use super::over_participants::Measured;
use super::results::PartResults;
use super::tracks::TrackData;
use super::trials::{Asked, TrialCount};
use crate::analyze::exclude::Applied;
use crate::analyze::findings::Pair;
use crate::analyze::record::Field as _;
use crate::analyze::values::Values;
use crate::analyze::warning::Warning;
use std::collections::BTreeMap;
use study_base::text::{PartId, ParticipantId, QuestionId};
use study_plan::protocol::parts::{Part, Task};
use study_plan::protocol::{Answer, Occasion, Protocol};
use study_session::outcome::fold::History;
use study_session::outcome::{IntervalRow, ParticipantRow, RatingRow};
use study_stats::psychometric::{Core, Level, Spacing};

/// What a study is analyzed from.
#[derive(Debug, Clone, Copy)]
pub struct StudyData<'a> {
    /// Its protocol, with the VAF of its realizations.
    pub protocol: &'a Protocol,
    /// `ratings.csv`.
    pub rows: &'a [RatingRow],
    /// `intervals.csv`.
    pub intervals: &'a [IntervalRow],
    /// `participants.csv`.
    pub participants: &'a [ParticipantRow],
    /// Its sessions, of which the tracks are replayed.
    pub sessions: &'a [&'a History],
    /// Whether thresholds of participants are also learned together, which takes seconds and
    /// decides nothing.
    pub pools: bool,
}

/// The analysis of one part of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct PartAnalysis {
    /// The part.
    pub part: PartId,
    /// The kind of its trials, as in `[[tracks]] method`, or `pairs`; that of a questionnaire.
    pub task: &'static str,
    /// Number of trials with an answer that counts, or of questionnaires with a score.
    pub trials: usize,
    /// Number of participants with such a trial.
    pub participants: usize,
    /// Whether answers of pilots are among them.
    pub pilot: bool,
    /// Whether answers of simulated participants are among them.
    pub simulated: bool,
    /// The statistics.
    pub results: PartResults,
    /// The answers to the questions about it.
    pub findings: Vec<PartFinding>,
    /// The comparisons on which they rest: of realizations, or of thresholds.
    pub pairs: Vec<Pair>,
    /// What limits them.
    pub warnings: Vec<Warning>,
    /// The effect of each preregistered exclusion rule.
    pub exclusions: Vec<Applied>,
    /// Level of significance of every test, two-sided.
    pub alpha: f64,
    /// The trials that count: participant, session, trial.
    pub used: Vec<(ParticipantId, u32, u32)>,
    /// What its figures draw besides.
    pub data: PartData,
}

impl PartAnalysis {
    /// The statistics by identifier.
    pub fn values(&self) -> Values {
        self.results.values()
    }
}

/// The answers of a part by level and trial.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PartData {
    /// What the level is, with its unit; `None` without levels or for several families.
    pub dimension: Option<String>,
    /// The family of the levels with its unit, as standards are counted; like `dimension` without a standard.
    pub family: Option<String>,
    /// Share of correct answers by guessing, where it follows from the kind of trial.
    pub guess: Option<f64>,
    /// Positive answers by level.
    pub levels: Vec<LevelData>,
    /// Tracks as they went.
    pub tracks: Vec<TrackData>,
    /// Labels, in their order on the page.
    pub labels: Vec<String>,
    /// How often each participant gave each label where another was right.
    pub confusions: OwnConfusions,
    /// VAF of the compared realizations that have one.
    pub vaf: BTreeMap<String, f64>,
    /// Thresholds and sensitivities, by which tracks, groups and sessions are compared.
    pub measured: Vec<Measured>,
    /// After what a questionnaire was asked between the trials.
    pub between: Option<Occasion>,
    /// What a search found.
    pub exploration: Option<Exploration>,
}

/// Positive answers of one participant in one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelData {
    /// Participant. Untrusted.
    pub participant: String,
    /// Condition, as in the identifiers of its statistics.
    pub condition: String,
    /// By level, each once.
    pub levels: Vec<Level>,
    /// The scale over which its function is fitted.
    pub spacing: Spacing,
    /// The shape of its function.
    pub core: Core,
}

/// What is found of a part, before findings.
pub(super) struct Found {
    pub(super) task: &'static str,
    pub(super) trials: usize,
    pub(super) results: PartResults,
    pub(super) warnings: Vec<Warning>,
    pub(super) data: PartData,
    /// Conditions of tracks.
    pub(super) names: Vec<String>,
}

/// The presentations of each attempt.
pub(super) struct Intervals<'a>(BTreeMap<Attempted<'a>, Vec<&'a IntervalRow>>);

/// Participant, session, trial and attempt.
type Attempted<'a> = (&'a ParticipantId, u32, u32, u32);

impl<'a> Intervals<'a> {
    pub(super) fn of(rows: &'a [IntervalRow]) -> Self {
        let mut attempts: BTreeMap<Attempted<'_>, Vec<&IntervalRow>> = BTreeMap::new();
        for row in rows {
            let attempt = (&row.participant, row.session, row.trial, row.attempt);
            attempts.entry(attempt).or_default().push(row);
        }
        Self(attempts)
    }

    /// The presentations of the attempt that counts.
    pub(super) fn counted<'b>(&'b self, row: &'b RatingRow) -> &'b [&'b IntervalRow] {
        let attempt = row.attempt.unwrap_or(0);
        let place = (&row.participant, row.session, row.trial, attempt);
        self.0.get(&place).map_or(&[], Vec::as_slice)
    }

    /// The fewest full strokes in an interval; `None` if those of one are unknown.
    pub(super) fn strokes(&self, row: &RatingRow) -> Option<u32> {
        let strokes: Option<Vec<u32>> = self.counted(row).iter().map(|i| i.strokes).collect();
        strokes?.into_iter().min()
    }
}

/// The answer to the part's own question: the first, if the right one was told before it was corrected.
pub(super) fn own_answer<'a>(part: &Part, row: &'a RatingRow) -> Option<&'a Answer> {
    let first = row.answer_before_feedback.as_ref();
    first.or_else(|| row.answers.get(part.asks.first()?))
}

/// The option that was chosen as the answer to the part's own question.
pub(super) fn chosen<'a>(part: &Part, row: &'a RatingRow) -> Option<&'a str> {
    match own_answer(part, row)? {
        Answer::Choice(chosen) => chosen.first().map(String::as_str),
        _ => None,
    }
}

/// A trial of a track that was right or wrong, in a condition.
pub(super) fn trial(
    part: &Part,
    asked: Asked,
    row: &RatingRow,
    condition: &str,
) -> Option<TrialCount> {
    let correct = row.correct?;
    let given = chosen(part, row)?;
    let words = asked.answers();
    let given = words.iter().position(|word| *word == given)?;
    // Of two answers, the one that was not given is correct if the given one is wrong. Of
    // three it is not known from the row, and not needed: only right or wrong counts.
    let target = match (correct, words.len()) {
        (true, _) => Some(given),
        (false, 2) => Some(1 - given),
        (false, _) => None,
    };
    Some(TrialCount {
        participant: row.participant.as_str().to_owned(),
        condition: condition.to_owned(),
        level: row.level,
        target,
        positive: f64::from(u8::from(correct)),
        trials: 1.0,
    })
}

/// The question that a part is about: the first, which is its own, but of ratings the
/// primary one, if they ask it.
pub(crate) fn asked<'a>(protocol: &Protocol, part: &'a Part) -> Option<&'a QuestionId> {
    let is_rating = matches!(part.task, Task::Rating(_));
    let is_primary = |id: &&QuestionId| is_rating && **id == protocol.analysis.primary;
    let primary = part.asks.iter().find(is_primary);
    primary.or_else(|| part.asks.first())
}

/// The group of each participant who has one.
pub(super) fn groups(rows: &[&RatingRow]) -> BTreeMap<String, String> {
    let of_row = |row: &&RatingRow| {
        let group = row.group.as_ref()?.as_str().to_owned();
        Some((row.participant.as_str().to_owned(), group))
    };
    rows.iter().filter_map(of_row).collect()
}

/// The sessions that have a part, if there are several; else only `None`.
pub(crate) fn sessions_of<'a>(protocol: &'a Protocol, part: &Part) -> Vec<Option<&'a PartId>> {
    let has = |s: &&study_plan::protocol::SessionPlan| {
        s.parts
            .as_ref()
            .is_none_or(|parts| parts.contains(&part.id))
    };
    let sessions: Vec<_> = protocol
        .sessions
        .iter()
        .filter(has)
        .map(|s| Some(&s.id))
        .collect();
    match sessions.len() {
        0 | 1 => vec![None],
        _ => sessions,
    }
}
