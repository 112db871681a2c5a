//! Questionnaires between the trials: after each condition, block or part.
//!
//! A form of them belongs to the trial with which the condition ended, and to its attempt: if that trial
//! is felt again, they are asked again, and the answers of before do not count.

use super::Session;
use crate::outcome::{FormId, Moment};
use std::collections::{BTreeMap, BTreeSet};
use study_base::sort::SmallSort as _;
use study_plan::protocol::questionnaires::Stretch;
use study_plan::protocol::{Question, Questionnaire};

impl Session {
    /// Opens the questionnaires of a condition, block or part that is over and in which they are not
    /// completely answered; returns whether there are any.
    pub(super) fn ask_between(&mut self, at: Moment) -> bool {
        let questionnaires = self.protocol.questionnaires.iter();
        let over: BTreeSet<u32> = questionnaires
            .flat_map(|own| self.ended_with(own))
            .collect();
        let forms: Vec<FormId> = over
            .into_iter()
            .filter_map(|t| self.form_after(t))
            .collect();
        forms.into_iter().any(|form| self.open_form(form, at))
    }

    /// The items that are asked after a trial, those after its condition first.
    pub(super) fn asked_after(&self, trial: u32) -> Vec<&Question> {
        let all = self.protocol.questionnaires.iter();
        let mut asked: Vec<&Questionnaire> = all
            .filter(|own| self.ended_with(own).contains(&trial))
            .collect();
        asked.small_sort_by_key(|own| own.after);
        asked.into_iter().flat_map(|own| &own.questions).collect()
    }

    /// When the last trial was answered, or the last questionnaire after one that goes on.
    pub(super) fn answered_before(&self) -> Option<Moment> {
        let given = self.history.answers.iter().rev();
        let between = |form| matches!(form, FormId::After { .. });
        let begun = given
            .filter(|given| between(given.form))
            .find(|given| given.answered_at.is_some())
            .filter(|given| self.goes_on(given.form));
        if let Some(given) = begun {
            return given.answered_at;
        }
        let (_, done) = self.history.completion(self.history.last_done?)?;
        Some(done.at)
    }

    /// Whether questions of a form are still to be answered.
    fn goes_on(&self, form: FormId) -> bool {
        let questions = self.questions(form);
        let last = questions.last();
        last.is_some_and(|last| self.history.answer(form, &last.id).is_none())
    }

    fn form_after(&self, trial: u32) -> Option<FormId> {
        let (attempt, _) = self.history.completion(trial)?;
        Some(FormId::After { trial, attempt })
    }

    /// Of each condition, block or part of which no trial is to come, the trial that was completed last:
    /// the only one that can still be marked as bad.
    fn ended_with(&self, own: &Questionnaire) -> BTreeSet<u32> {
        let to_come: BTreeSet<u32> = self.history.queue.iter().copied().collect();
        let planned = self.history.schedule().iter();
        let all: Vec<(Stretch<'_>, u32)> = planned
            .filter_map(|trial| Some((own.stretch(&self.protocol, trial)?, trial.trial)))
            .collect();
        let goes_on: BTreeSet<Stretch<'_>> = (all.iter())
            .filter(|(_, trial)| to_come.contains(trial))
            .map(|(stretch, _)| *stretch)
            .collect();
        // By the numbers that the trials had on the screen, which follow the order of their completion.
        let mut last: BTreeMap<Stretch<'_>, (u32, u32)> = BTreeMap::new();
        for (stretch, trial) in all {
            let completion = self.history.completion(trial);
            if let Some((_, done)) = completion.filter(|_| !goes_on.contains(&stretch)) {
                let latest = last.entry(stretch).or_default();
                *latest = (*latest).max((done.number, trial));
            }
        }
        last.into_values().map(|(_, trial)| trial).collect()
    }
}
