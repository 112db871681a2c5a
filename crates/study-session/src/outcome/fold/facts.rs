//! What the history of a session tells.

use super::trial::TrialHistory;
use super::{Attempt, Completion, FormDelay, GivenAnswer, History, OpenAttempt};
use crate::outcome::event::{FormId, Moment, Start, State};
use study_base::text::{ModelId, PartId, QuestionId};
use study_plan::protocol::{Answer, Part, Trial};

impl History {
    /// The first event, if the session has started.
    pub fn start(&self) -> Option<&Start> {
        self.start.as_ref().map(|(_, start)| start.as_ref())
    }

    /// When the session started.
    pub fn started_at(&self) -> Option<Moment> {
        self.start.as_ref().map(|(at, _)| *at)
    }

    /// Whether nothing more is to be asked.
    pub fn over(&self) -> bool {
        self.standing.state != State::Unfinished
    }

    /// Whether every trial is closed and every form answered.
    pub fn finished(&self) -> bool {
        self.standing.state == State::Done
    }

    /// Every planned trial; empty before the session has started.
    pub fn schedule(&self) -> &[Trial] {
        self.start().map_or(&[], |start| &start.schedule)
    }

    /// A planned trial by its number.
    pub fn planned(&self, trial: u32) -> Option<&Trial> {
        self.schedule().iter().find(|t| t.trial == trial)
    }

    /// Whether a trial is planned and of no track, and no practice, that ended before it.
    pub fn takes_place(&self, trial: u32) -> bool {
        let Some(planned) = self.planned(trial) else {
            return false;
        };
        !self.has_ended(planned) || self.trials.contains_key(&trial)
    }

    /// Number of planned trials that count, or of practice trials. Trials after the end of
    /// their track are none.
    pub fn planned_total(&self, practice: bool) -> u32 {
        let planned = self.schedule().iter().filter(|t| t.practice == practice);
        count(planned.filter(|t| self.takes_place(t.trial)))
    }

    /// Whether the track of a trial, or the practice to which it belongs, has ended.
    pub fn has_ended(&self, trial: &Trial) -> bool {
        let practice = trial.part.as_ref().filter(|_| trial.practice);
        trial.track().is_some_and(|t| self.ended_tracks.contains(t))
            || practice.is_some_and(|part| self.ended_practice.contains(part))
    }

    /// Whether the answers to the completed practice trials of a part of identification were
    /// correct, in the order in which they were given. Declined ones are left out, and corrections change nothing.
    pub fn practiced(&self, part: &Part) -> Vec<bool> {
        let Some(own) = part.task.identification() else {
            return Vec::new();
        };
        let correct = |(trial, attempt): &(u32, u32)| {
            let planned = self.planned(*trial).filter(|t| t.practice)?;
            let model = planned
                .model()
                .filter(|_| planned.part.as_ref() == Some(&part.id))?;
            let attempts = &self.trials.get(trial)?.attempts;
            let attempt = attempts.iter().find(|a| a.number == *attempt)?;
            own.is_correct(model, attempt.told.as_ref()?)
        };
        self.told.iter().filter_map(correct).collect()
    }

    /// The completed trials of a track that count, in the order in which it was told.
    pub fn told<'a>(
        &'a self,
        track: &'a PartId,
    ) -> impl Iterator<Item = (&'a Trial, &'a Attempt)> + 'a {
        self.told_of(move |trial| trial.track() == Some(track))
    }

    /// The completed trials that count of those that follow from answers, in the order in which these were told.
    pub(super) fn told_of<'a>(
        &'a self,
        which: impl Fn(&Trial) -> bool + 'a,
    ) -> impl Iterator<Item = (&'a Trial, &'a Attempt)> + 'a {
        self.told.iter().filter_map(move |(trial, attempt)| {
            let planned = self.planned(*trial).filter(|t| which(t))?;
            let attempts = &self.trials.get(trial)?.attempts;
            Some((planned, attempts.iter().find(|a| a.number == *attempt)?))
        })
    }

    /// The trial under way or to come next.
    pub fn next_trial(&self) -> Option<&Trial> {
        self.queue.first().and_then(|t| self.planned(*t))
    }

    /// The attempt under way.
    pub fn open(&self) -> Option<OpenAttempt<'_>> {
        let trial = self.planned(self.open?)?;
        let attempt = self.trials.get(&trial.trial)?.attempts.last()?;
        Some(OpenAttempt { trial, attempt })
    }

    /// Every attempt so far, by trial.
    pub fn all_attempts(&self) -> impl Iterator<Item = (u32, &Attempt)> {
        let trials = self.trials.iter();
        trials.flat_map(|(trial, history)| history.attempts.iter().map(|a| (*trial, a)))
    }

    /// Number of the last attempt at a trial; 0 before the first.
    pub fn attempts(&self, trial: u32) -> u32 {
        let last = self.trials.get(&trial).and_then(|t| t.attempts.last());
        last.map_or(0, |a| a.number)
    }

    /// Failures of a trial that count towards `max_attempts`, since its block was
    /// last restarted.
    pub fn failures(&self, trial: u32) -> u32 {
        self.trials.get(&trial).map_or(0, |t| t.failures)
    }

    /// The attempt with which a trial was completed, and its completion.
    pub fn completion(&self, trial: u32) -> Option<(u32, Completion)> {
        let attempt = self.trials.get(&trial)?.counted()?;
        Some((attempt.number, attempt.done?))
    }

    /// The pauses before the answers so far to the questionnaires after an attempt.
    pub fn delay(&self, trial: u32, attempt: u32) -> Option<FormDelay> {
        let attempts = &self.trials.get(&trial)?.attempts;
        attempts.iter().find(|a| a.number == attempt)?.delay
    }

    /// Whether a trial is completed or given up.
    pub fn is_closed(&self, trial: u32) -> bool {
        self.trials.get(&trial).is_some_and(TrialHistory::is_closed)
    }

    /// Number of trials that count (or of practice trials) that are closed.
    pub fn closed(&self, practice: bool) -> u32 {
        let closed = |t: &&Trial| t.practice == practice && self.is_closed(t.trial);
        count(self.schedule().iter().filter(closed))
    }

    /// The trials that count and are completed.
    pub fn completed(&self) -> impl Iterator<Item = u32> {
        let done = |t: &&Trial| !t.practice && self.completion(t.trial).is_some();
        self.schedule().iter().filter(done).map(|t| t.trial)
    }

    /// Whether an attempt was made at any planned trial, or at any that counts.
    pub fn any_attempt(&self, counted_only: bool) -> bool {
        let made = |t: &Trial| self.attempts(t.trial) > 0 && !(counted_only && t.practice);
        self.schedule().iter().any(made)
    }

    /// Whether any trial was rated, even in part.
    pub fn has_rating(&self) -> bool {
        let rated = |g: &GivenAnswer| matches!(g.form, FormId::Trial { .. });
        self.answers.iter().any(rated) || self.all_attempts().any(|(_, a)| a.done.is_some())
    }

    /// The planned trials in the order in which they were felt, one for each
    /// presentation.
    pub fn felt(&self) -> impl Iterator<Item = &Trial> {
        self.felt.iter().filter_map(|(t, _)| self.planned(*t))
    }

    /// Whether the last presentation was stopped or interrupted. If its trial is felt
    /// again at once, the same presentation goes on.
    pub fn goes_on(&self) -> bool {
        self.goes_on
    }

    /// The trial that was felt last.
    pub fn last_felt(&self) -> Option<&Trial> {
        self.felt.last().and_then(|(t, _)| self.planned(*t))
    }

    /// The trial and the attempt whose playback was the last one to start.
    pub fn last_attempt(&self) -> Option<(u32, u32)> {
        self.felt.last().copied()
    }

    /// The realization that was felt last.
    pub fn last_model(&self) -> Option<&ModelId> {
        let (trial, number) = self.felt.last()?;
        let planned = self.planned(*trial)?;
        if planned.part.is_none() {
            return planned.model();
        }
        let attempts = &self.trials.get(trial)?.attempts;
        let attempt = attempts.iter().find(|a| a.number == *number)?;
        let interval = attempt.presentations.last()?.interval as usize;
        attempt.models.get(interval.checked_sub(1)?)
    }

    /// The current answer to a question.
    pub fn answer(&self, form: FormId, question: &QuestionId) -> Option<&Answer> {
        let mut given = self.answers.iter();
        let given = given.find(|g| g.form == form && g.question == *question);
        given.map(|g| &g.answer)
    }

    /// Whether any question of a form was answered.
    pub fn any_answer(&self, form: FormId) -> bool {
        self.answers.iter().any(|g| g.form == form)
    }

    /// Whether the answers of a form count: not those of failed attempts.
    pub fn is_current(&self, form: FormId) -> bool {
        match form {
            FormId::Setup | FormId::Intake | FormId::Outro => true,
            FormId::Consent => false,
            FormId::Trial { trial, attempt } => {
                let open = self.open().is_some_and(|o| o.form() == form);
                open || self
                    .completion(trial)
                    .is_some_and(|(done, _)| done == attempt)
            }
            FormId::After { trial, attempt } => {
                let done = self.completion(trial);
                done.is_some_and(|(done, _)| done == attempt)
            }
        }
    }
}

/// Number of items, as trials are counted.
fn count<T>(items: impl Iterator<Item = T>) -> u32 {
    u32::try_from(items.count()).unwrap_or(u32::MAX)
}
