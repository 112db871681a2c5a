//! The answers of a session.

use super::{GivenAnswer, History};
use crate::outcome::event::{Channel, FormId, Moment};
use study_base::text::QuestionId;
use study_plan::protocol::Answer;

impl History {
    /// Takes an answer, which is the last thing that was done on a rating page that is open.
    pub(super) fn answered(
        &mut self,
        form: FormId,
        question: &QuestionId,
        answer: (&Answer, Option<Channel>),
        at: Moment,
    ) {
        self.given(form, question, answer).answered_at = Some(at);
        let is_open = self.open().is_some_and(|o| o.form() == form);
        if let Some(open) = self.open_mut().filter(|_| is_open)
            && let Some((_, last)) = &mut open.rating
        {
            *last = at;
        }
    }

    /// Sets an answer.
    pub(super) fn given(
        &mut self,
        form: FormId,
        question: &QuestionId,
        (answer, channel): (&Answer, Option<Channel>),
    ) -> &mut GivenAnswer {
        let known = self
            .answers
            .iter()
            .position(|g| g.form == form && g.question == *question);
        let index = known.unwrap_or(self.answers.len());
        if known.is_none() {
            self.answers.push(GivenAnswer {
                form,
                question: question.clone(),
                answer: answer.clone(),
                answered_at: None,
                corrected: false,
                channel,
            });
        }
        let given = &mut self.answers[index];
        given.answer = answer.clone();
        given.channel = channel;
        given
    }

    /// The answer with which a trial began: the first that was given.
    pub(super) fn first_answer(&self, trial: u32, attempt: u32) -> Option<Answer> {
        let form = FormId::Trial { trial, attempt };
        let first = self.answers.iter().find(|g| g.form == form);
        first.map(|g| g.answer.clone())
    }
}
