//! Questions, answers, corrections and remarks.

use super::Session;
use super::course::Step;
use super::phase::{Form, Phase};
use crate::outcome::{Author, Event, Moment, Place};
use crate::protocol::question::MAX_TEXT_BYTES;
use crate::protocol::{Answer, Question, QuestionKind};
use study_base::text::QuestionId;

impl Session {
    /// The questions that are asked in a place.
    pub(super) fn questions(&self, place: Place) -> &[Question] {
        match place {
            Place::Setup => &self.protocol.setup,
            Place::Intake => &self.protocol.intake,
            Place::Trial { .. } => &self.protocol.questions,
            Place::Outro => &self.protocol.outro,
        }
    }

    /// Opens a form at the first question that was not reached; says whether
    /// there is one.
    pub(super) fn open_form(&mut self, place: Place, at: Moment) -> bool {
        if step_of(place).is_some_and(|step| self.behind.contains(&step)) {
            return false;
        }
        let questions = self.questions(place);
        let reached = questions
            .iter()
            .rposition(|q| self.history.answer(place, &q.id).is_some())
            .map_or(0, |last| last + 1);
        let total = pages(questions).len();
        let mut left = pages(questions);
        let mut index = 0;
        for page in &mut left {
            page.retain(|_| {
                index += 1;
                index > reached
            });
        }
        left.retain(|page| !page.is_empty());
        if left.is_empty() {
            return false;
        }
        self.phase = Phase::Form(Form {
            place,
            pages: left,
            total,
            opened: at,
            covered_s: 0.0,
        });
        true
    }

    /// The rating of the attempt under way; closes the trial if every question
    /// is answered already.
    pub(super) fn open_trial_form(&mut self, at: Moment) {
        let Some(place) = self.history.open.as_ref().map(|o| o.place()) else {
            return;
        };
        if !self.open_form(place, at) {
            self.complete(place, 0.0, at);
        }
    }

    pub(super) fn answer(&mut self, answers: Vec<(QuestionId, Answer)>, at: Moment) {
        let Phase::Form(form) = &self.phase else {
            return;
        };
        let Some(page) = form.pages.first() else {
            return;
        };
        match check(page, answers) {
            Err(why) => self.say(why),
            Ok(answers) => {
                let place = form.place;
                for (question, answer) in answers {
                    let answered = Event::Answered {
                        place,
                        question,
                        answer,
                    };
                    self.record(answered, at);
                }
                self.turn_page(at);
            }
        }
    }

    fn turn_page(&mut self, at: Moment) {
        if let Phase::Form(form) = &mut self.phase {
            form.pages.remove(0);
            if form.pages.is_empty() {
                let place = form.place;
                let spent_s = at.seconds_since(&form.opened) - form.covered_s;
                self.complete(place, spent_s.max(0.0), at);
            }
        }
    }

    /// Everything is answered there; on once it is on disk.
    fn complete(&mut self, place: Place, spent_s: f64, at: Moment) {
        if let Some(step) = step_of(place) {
            self.behind.insert(step);
        }
        if let Place::Trial { trial, attempt } = place {
            let earlier = self.history.open.as_ref().map(|o| o.rated_earlier_s);
            let done = Event::TrialDone {
                trial,
                attempt,
                response_s: spent_s + earlier.unwrap_or(0.0),
            };
            self.record(done, at);
        }
        self.phase = Phase::Saving;
        self.go_on_if_saved(at);
    }

    pub(super) fn remark(&mut self, by: Author, text: String, at: Moment) {
        if let Err(why) = self.still_open().and_then(|()| check_words(&text)) {
            return self.say(why);
        }
        let trial = self.history.open.as_ref().map(|o| o.trial.trial);
        self.record(Event::Remark { by, trial, text }, at);
    }

    pub(super) fn correct(
        &mut self,
        place: Place,
        question: &QuestionId,
        answer: Answer,
        reason: String,
        by: Author,
        at: Moment,
    ) {
        match self.check_correction(place, question, &answer, &reason) {
            Err(why) => self.say(why),
            Ok(from) => {
                let corrected = Event::Corrected {
                    place,
                    question: question.clone(),
                    from: Some(from),
                    to: answer,
                    reason,
                    by,
                };
                self.record(corrected, at);
            }
        }
    }

    fn check_correction(
        &self,
        place: Place,
        question: &QuestionId,
        answer: &Answer,
        reason: &str,
    ) -> Result<Answer, String> {
        self.still_open()?;
        let asked = self.questions(place).iter().find(|q| q.id == *question);
        let given = self.history.answer(place, question);
        let (Some(asked), Some(from), true) = (asked, given, self.history.is_current(place)) else {
            return Err("there is no such answer to correct".to_owned());
        };
        asked.accepts(answer)?;
        if from == answer {
            return Err("that is the answer already".to_owned());
        }
        check_words(reason).map_err(|why| format!("reason: {why}"))?;
        Ok(from.clone())
    }

    /// Of somebody who dropped out or did not agree, nothing more is taken.
    fn still_open(&self) -> Result<(), String> {
        if self.history.over() && !self.history.finished {
            Err("the session is over".to_owned())
        } else {
            Ok(())
        }
    }
}

/// Free text of a remark or reason: some, and not too much.
pub(super) fn check_words(words: &str) -> Result<(), String> {
    if words.trim().is_empty() {
        Err("write a few words".to_owned())
    } else if words.len() > MAX_TEXT_BYTES {
        Err(format!("at most {MAX_TEXT_BYTES} bytes"))
    } else {
        Ok(())
    }
}

fn step_of(place: Place) -> Option<Step> {
    match place {
        Place::Setup => Some(Step::Setup),
        Place::Intake => Some(Step::Intake),
        Place::Outro => Some(Step::Outro),
        Place::Trial { .. } => None,
    }
}

/// One question a page, with the optional text that directly follows it.
fn pages(questions: &[Question]) -> Vec<Vec<Question>> {
    let mut pages: Vec<Vec<Question>> = Vec::new();
    for question in questions {
        let below = matches!(question.kind, QuestionKind::Text) && !question.required;
        match pages.last_mut() {
            Some(page) if below && page.len() == 1 => page.push(question.clone()),
            _ => pages.push(vec![question.clone()]),
        }
    }
    pages
}

/// The answers of a page in its order, or what is wrong with them. A text or
/// choice that was left empty is an empty answer, so that it is not asked again.
fn check(
    page: &[Question],
    mut given: Vec<(QuestionId, Answer)>,
) -> Result<Vec<(QuestionId, Answer)>, String> {
    let mut checked = Vec::new();
    for question in page {
        let at = given.iter().position(|(id, _)| *id == question.id);
        let answer = at.map(|at| given.swap_remove(at).1);
        let answer = answer.or(match question.kind {
            QuestionKind::Text => Some(Answer::Text(String::new())),
            QuestionKind::Choice { .. } => Some(Answer::Choice(Vec::new())),
            _ => None,
        });
        match answer {
            Some(answer) => {
                question.accepts(&answer)?;
                checked.push((question.id.clone(), answer));
            }
            None if question.required => return Err("an answer is needed".to_owned()),
            None => {}
        }
    }
    match given.first() {
        Some((id, _)) => Err(format!("`{id}` is not asked here")),
        None => Ok(checked),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::example;

    fn text(id: &str, required: bool) -> Question {
        Question {
            id: QuestionId::new(id).unwrap(),
            prompt: id.to_owned(),
            kind: QuestionKind::Text,
            required,
        }
    }

    #[test]
    fn a_page_is_one_question_and_the_optional_text_below_it() {
        let mut questions = example::protocol(2, 1).questions;
        questions.extend([text("more", false), text("must", true), text("may", false)]);
        let ids: Vec<Vec<_>> = pages(&questions)
            .iter()
            .map(|page| page.iter().map(|q| q.id.as_str().to_owned()).collect())
            .collect();
        assert_eq!(
            ids,
            [
                vec!["realism", "comment"],
                vec!["more"],
                vec!["must", "may"]
            ]
        );
    }

    #[test]
    fn a_page_takes_all_its_answers_or_none() {
        let page = example::protocol(2, 1).questions;
        let id = |n: usize| page[n].id.clone();
        let long = Answer::Text("x".repeat(MAX_TEXT_BYTES + 1));
        assert!(check(&page, vec![(id(0), Answer::Rating(8))]).is_err());
        assert!(check(&page, vec![(id(0), Answer::Rating(5)), (id(1), long)]).is_err());
        assert!(check(&page, vec![(id(1), Answer::Text("dull".to_owned()))]).is_err());
        let twice = vec![(id(0), Answer::Rating(5)), (id(0), Answer::Rating(6))];
        assert!(check(&page, twice).is_err());
        assert_eq!(
            check(&page, vec![(id(0), Answer::Rating(5))]).unwrap(),
            [
                (id(0), Answer::Rating(5)),
                (id(1), Answer::Text(String::new()))
            ]
        );
    }
}
