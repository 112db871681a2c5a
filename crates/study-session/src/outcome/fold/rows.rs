//! The rows of the derived tables, from the history of a session.

use super::trial::TrialHistory;
use super::{Attempt, GivenAnswer, History};
use crate::outcome::event::{FormId, Start};
use crate::outcome::rows::{ParticipantRow, RatingRow, Status};
use crate::outcome::sent::counted as counted_numbers;
use std::collections::BTreeMap;
use study_base::text::{ParticipantId, QuestionId};
use study_plan::protocol::{Answer, Part, Protocol, Role, Stimuli, TrackRules, Trial};

impl History {
    /// One row for each planned trial, practice included; none if the session never
    /// started, and none for trials after the end of their track. `protocol` gives roles, VAFs and covariates.
    pub fn rating_rows(&self, protocol: &Protocol) -> Vec<RatingRow> {
        let row = |start| move |trial| self.rating_row(start, trial, protocol);
        let takes_place = |trial: &&Trial| self.takes_place(trial.trial);
        (self.start().into_iter())
            .flat_map(|start| start.schedule.iter().filter(takes_place).map(row(start)))
            .collect()
    }

    /// The row of a participant whose last session this is.
    pub fn participant_row(&self, id: &ParticipantId, session: u32) -> ParticipantRow {
        let start = self.start();
        ParticipantRow {
            participant: id.clone(),
            session,
            state: self.standing.state,
            reason: self.standing.reason.clone(),
            row: start.and_then(|s| s.seat.row()),
            pilot: start.is_some_and(|s| s.seat.is_pilot()),
            simulated: start.is_some_and(|s| s.seat.is_simulated()),
            erased: false,
            consent_version: (self.consent.as_ref())
                .filter(|c| c.accepted)
                .map(|c| c.version.clone()),
            protocol_version: start.map(|s| s.protocol_version),
            trials_done: self.closed(false),
            trials_planned: self.planned_total(false),
            started_at: self.started_at().map(|at| at.wall),
            answers: answers(self.answers.iter().filter(|g| !is_of_trial(g))),
            group: start.and_then(|s| s.assigned.group.clone()),
            session_id: start.and_then(|s| s.assigned.session_id.clone()),
            gap_h: start.and_then(|s| s.assigned.gap_h),
        }
    }

    fn rating_row(&self, start: &Start, trial: &Trial, protocol: &Protocol) -> RatingRow {
        let unfelt = TrialHistory::default();
        let felt = self.trials.get(&trial.trial).unwrap_or(&unfelt);
        let counted = felt.counted();
        // Of a trial that was given up the last attempt is shown, without answers.
        let shown = counted.or(felt.attempts.last().filter(|_| felt.given_up));
        let begun = shown.and_then(|a| a.start.as_ref());
        let given: Vec<&GivenAnswer> = match counted.map(|a| a.number) {
            Some(attempt) => self.answers_of(trial.trial, attempt).collect(),
            None => Vec::new(),
        };
        let between: Vec<&GivenAnswer> = match counted.map(|a| a.number) {
            Some(attempt) => self.answers_after(trial.trial, attempt).collect(),
            None => Vec::new(),
        };
        let part = trial.part.as_ref().and_then(|id| protocol.part(id));
        let primary = match part.and_then(|part| part.asks.first()) {
            Some(first) if !asks(part, &protocol.analysis.primary) => first,
            _ => &protocol.analysis.primary,
        };
        let primary = given.iter().find(|g| g.question == *primary);
        let model = trial.model().or(match shown.map(|a| &a.models[..]) {
            // What was set is a level, and no realization that was presented.
            _ if shown.is_some_and(Attempt::is_adjusted) => None,
            Some([only]) => Some(only),
            _ => None,
        });
        let entry = model.and_then(|id| protocol.model(id));
        let before_feedback = counted.and_then(|a| before_feedback(trial, part, a, &given));
        let is_primary =
            primary.is_some_and(|g| part.is_some_and(|p| p.asks.first() == Some(&g.question)));
        let asked_first = before_feedback.as_ref().filter(|_| is_primary);
        let track = trial.track().and_then(|id| protocol.track(id));
        let played = shown.and_then(|a| a.ended).map(|e| e.playback);
        // Without telemetry nothing was counted.
        let sampled = played.filter(|p| p.samples > 0);
        let worst = shown.and_then(|a| a.rendering.iter().max_by_key(|r| r.verdict));
        let finite = |x: f64| Some(x).filter(|x| x.is_finite());
        let done = counted.and_then(|a| a.done);
        let sitting = shown.map_or(&self.sitting, |a| &a.sitting);
        let media = shown.and_then(|a| self.in_step(trial.trial, a));
        RatingRow {
            study: start.study.clone(),
            participant: start.participant.clone(),
            session: start.session,
            row: start.seat.row(),
            trial: trial.trial,
            block: trial.block,
            position: begun.map(|b| b.position),
            planned_position: trial.position,
            model: model.cloned(),
            role: entry.map_or(Role::Test, |m| m.role),
            repetition: trial.repetition,
            previous_model: begun.and_then(|b| b.previous.clone()),
            practice: trial.practice,
            pilot: start.seat.is_pilot(),
            simulated: start.seat.is_simulated(),
            device_kind: entry
                .and_then(|m| m.device)
                .filter(|_| !start.seat.is_pilot() && !start.seat.is_simulated())
                .unwrap_or(start.device_kind),
            device_id: sitting.device_id.clone(),
            operator: sitting.operator.clone(),
            tool_version: sitting.tool_version.clone(),
            protocol_version: start.protocol_version,
            corrected: given.iter().any(|g| g.corrected),
            declined: given.iter().any(|g| g.answer.is_declined()),
            remarks: felt.remarks.join(" | "),
            reference_s: begun.map(|b| b.reference_s),
            exploration_s: played.and_then(|p| finite(p.exploration_s)),
            response_s: done.map(|d| d.response_s),
            strokes: sampled.map(|p| p.strokes),
            least_energy_j: sampled.and_then(|p| finite(p.least_energy_j)),
            switches_per_s: sampled.and_then(|p| finite(p.switches_per_s)),
            clamp_count: sampled.map(|p| p.clamp_count),
            started_at: begun.map(|b| b.at.wall),
            rated_at: primary
                .and_then(|g| g.answered_at)
                .or(done.map(|d| d.at))
                .map(|at| at.wall),
            attempt: shown.map(|a| a.number),
            status: match felt.given_up {
                true => Status::Failed,
                false => status_of(asked_first.or(primary.map(|g| &g.answer))),
            },
            vaf: entry.and_then(|m| m.vaf),
            covariates: entry.map(|m| m.covariates.clone()).unwrap_or_default(),
            levels: entry.map(|m| m.levels.clone()).unwrap_or_default(),
            part: trial.part.clone(),
            track: trial.track().cloned(),
            level: (track.and_then(TrackRules::family))
                .and_then(|_| shown?.level)
                .map(|level| level.presented)
                .or_else(|| protocol.level_of(shown.and(model)?))
                .or_else(|| protocol.level_of(shown?.set_to()?)),
            correct: correct(trial, track, part, &given, before_feedback.as_ref()),
            replays: shown.map(|a| a.replays),
            fidelity: worst.cloned(),
            host_late_ms: played.and_then(|p| Some(p.host_late_ms?[1])),
            input_channel: primary.and_then(|g| g.channel),
            front_name: sitting.front.clone(),
            answers: answers(given.into_iter().chain(between)),
            group: start.assigned.group.clone(),
            session_id: start.assigned.session_id.clone(),
            paused_s: done.and_then(|d| d.paused_s),
            felt_again_after_s: felt.again_after_s,
            answer_before_feedback: before_feedback,
            questionnaire_paused_s: counted.and_then(|a| a.delay?.paused_s),
            questionnaire_late: counted.and_then(|a| a.delay?.late.then_some(true)),
            media_offset_ms: media.map(|m| m.onset.offset_ms),
            media_uncertainty_ms: media.map(|m| m.onset.uncertainty_ms),
            media_jitter_ms: media.and_then(|m| m.jitter_ms),
            sent: shown.map_or_else(BTreeMap::new, |a| counted_numbers(&a.numbers, protocol)),
        }
    }

    fn answers_of(&self, trial: u32, attempt: u32) -> impl Iterator<Item = &GivenAnswer> {
        let form = FormId::Trial { trial, attempt };
        self.answers.iter().filter(move |g| g.form == form)
    }

    /// The answers to the questionnaires of the condition, block or part that ended with an attempt.
    fn answers_after(&self, trial: u32, attempt: u32) -> impl Iterator<Item = &GivenAnswer> {
        let form = FormId::After { trial, attempt };
        self.answers.iter().filter(move |g| g.form == form)
    }
}

/// Whether the trials of a part ask a question; all of a study without parts do.
fn asks(part: Option<&Part>, question: &QuestionId) -> bool {
    part.is_none_or(|part| part.asks.contains(question))
}

/// The answer to the question of a part.
fn answer_of<'a>(part: Option<&Part>, given: &[&'a GivenAnswer]) -> Option<&'a Answer> {
    let question = part?.asks.first()?;
    let given = given.iter().find(|g| g.question == *question)?;
    Some(&given.answer)
}

/// The answer to a trial of identification that was given before the right label was told, if it was
/// corrected after that.
fn before_feedback(
    trial: &Trial,
    part: Option<&Part>,
    attempt: &Attempt,
    given: &[&GivenAnswer],
) -> Option<Answer> {
    let own = part?.task.identification()?;
    let first = attempt.told.as_ref()?;
    // Nothing is told of an answer that was declined.
    own.is_correct(trial.model()?, first)?;
    let corrected = own.tells(trial.practice) && answer_of(part, given) != Some(first);
    corrected.then(|| first.clone())
}

/// Whether the answer to a trial of a track or of identification is correct. Of an answer that was corrected after
/// the right label was told, the one before counts.
fn correct(
    trial: &Trial,
    track: Option<&TrackRules>,
    part: Option<&Part>,
    given: &[&GivenAnswer],
    before_feedback: Option<&Answer>,
) -> Option<bool> {
    let answer = before_feedback.or_else(|| answer_of(part, given))?;
    match &trial.stimuli {
        Stimuli::Track { intervals, .. } => track?.is_correct(intervals, answer),
        Stimuli::One { model } => part?.task.identification()?.is_correct(model, answer),
        Stimuli::Rated { .. }
        | Stimuli::Pair { .. }
        | Stimuli::Search { .. }
        | Stimuli::Set { .. }
        | Stimuli::Adjusted { .. } => None,
    }
}

/// Whether an answer belongs to a trial, and not to the participant.
fn is_of_trial(given: &GivenAnswer) -> bool {
    matches!(given.form, FormId::Trial { .. } | FormId::After { .. })
}

fn answers<'a>(given: impl Iterator<Item = &'a GivenAnswer>) -> BTreeMap<QuestionId, Answer> {
    given
        .map(|g| (g.question.clone(), g.answer.clone()))
        .collect()
}

fn status_of(primary: Option<&Answer>) -> Status {
    match primary {
        None => Status::Missing,
        Some(Answer::Declined { .. }) => Status::Declined,
        Some(Answer::Text(text)) if text.is_empty() => Status::Missing,
        Some(Answer::Choice(chosen)) if chosen.is_empty() => Status::Missing,
        Some(_) => Status::Ok,
    }
}
