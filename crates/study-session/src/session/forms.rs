//! Forms, answers, corrections and remarks.

use super::Session;
use super::flow::Step;
use super::phase::{Form, Phase, Told};
use crate::outcome::{Author, Event, FormId, Moment, STEP_BACK};
use study_base::text::QuestionId;
use study_plan::protocol::answer::MAX_TEXT_BYTES;
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{Answer, Control, Question, Refusal, Stimuli, Task};

/// Why an input was not accepted; shown to the operator.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum InputRefused {
    #[error("the session is over")]
    SessionOver,
    #[error("this answer cannot be corrected")]
    NothingToCorrect,
    #[error("that is already the answer")]
    Unchanged,
    #[error("type a few words")]
    NoText,
    #[error("at most {MAX_TEXT_BYTES} bytes")]
    TextTooLong,
    #[error("reason: {0}")]
    Reason(Box<InputRefused>),
    #[error(transparent)]
    Answer(#[from] Refusal),
    #[error("an answer is needed")]
    AnswerMissing,
    #[error("`{0}` is not asked here")]
    NotAsked(QuestionId),
}

impl InputRefused {
    /// What the operator or the participant reads.
    fn words(&self, words: &Words) -> String {
        match self {
            Self::Answer(refusal) => refusal.words(words),
            Self::AnswerMissing => words.get(Phrase::PlainNeeded).to_owned(),
            other => other.to_string(),
        }
    }
}

impl Session {
    /// The questions of a form, in their order.
    pub(super) fn questions(&self, form: FormId) -> Vec<&Question> {
        let all: &[Question] = match form {
            FormId::Setup => &self.protocol.setup,
            FormId::Intake => &self.protocol.intake,
            FormId::Outro => &self.protocol.outro,
            FormId::After { trial, .. } => return self.asked_after(trial),
            FormId::Consent => &[],
            FormId::Trial { trial, .. } => {
                let part = (self.history.planned(trial)).and_then(|t| self.part_of(t));
                if let Some(part) = part {
                    let question =
                        |id: &QuestionId| self.protocol.questions.iter().find(|q| q.id == *id);
                    return part.asks.iter().filter_map(question).collect();
                }
                &self.protocol.questions
            }
        };
        all.iter().collect()
    }

    /// Opens a form at the first question after the last answered one; returns
    /// whether there is one.
    pub(super) fn open_form(&mut self, form: FormId, at: Moment) -> bool {
        if step_of(form).is_some_and(|step| self.passed.contains(&step)) {
            return false;
        }
        let set = self.set_in(form);
        let mut questions = self.questions(form);
        questions.retain(|q| Some(&q.id) != set);
        let reached = questions
            .iter()
            .rposition(|q| self.history.answer(form, &q.id).is_some())
            .map_or(0, |last| last + 1);
        if reached == questions.len() {
            return false;
        }
        let mut pages = pages(&questions);
        let (mut page, mut answered) = (0, reached);
        while answered >= pages[page].len() {
            answered -= pages[page].len();
            page += 1;
        }
        pages[page].drain(..answered);
        self.phase = Phase::Form(Form {
            id: form,
            pages,
            at: page,
            opened: at,
            overlaid_s: 0.0,
        });
        true
    }

    /// Opens the rating of the attempt under way; completes the trial if every
    /// question is answered already.
    pub(super) fn open_trial_form(&mut self, at: Moment) {
        let Some(form) = self.history.open().map(|o| o.form()) else {
            return;
        };
        if !self.open_form(form, at) {
            self.complete(form, 0.0, at);
        }
    }

    pub(super) fn answer(&mut self, answers: Vec<(QuestionId, Answer)>, at: Moment) {
        let Phase::Form(open) = &self.phase else {
            return;
        };
        let Some(page) = open.pages.get(open.at) else {
            return;
        };
        let meant = |(id, answer): (QuestionId, Answer)| {
            let asked = page.iter().find(|q| q.id == id);
            let answer = match asked {
                Some(question) => self.meant(question, answer),
                None => answer,
            };
            (id, answer)
        };
        let meant = answers.into_iter().map(meant).collect();
        let checked = check(page, meant).and_then(|answers| {
            let kept = |q: &Question| self.history.answer(open.id, &q.id).is_some();
            let missing = |q: &&Question| answers.iter().all(|(id, _)| *id != q.id);
            if page.iter().filter(missing).any(kept) {
                return Err(InputRefused::AnswerMissing);
            }
            match self.taken(open.id, &answers) {
                Some(refusal) => Err(refusal.into()),
                None => Ok(answers),
            }
        });
        match checked {
            Err(why) => self.notify(why.words(&self.words)),
            Ok(answers) => {
                let form = open.id;
                if form == FormId::Consent {
                    return self.sign(&answers, at);
                }
                let stays = |(question, answer): &(QuestionId, Answer)| {
                    self.history.answer(form, question) == Some(answer)
                };
                if !answers.iter().all(stays) {
                    self.note_pause(form, at);
                }
                for (question, answer) in answers {
                    self.enter(form, question, answer, at);
                }
                self.turn_page(at);
            }
        }
    }

    /// Refuses ranks that are alike on this page of the form and those before it, in a part without ties. Pages after this
    /// one are passed again.
    fn taken(&self, form: FormId, answers: &[(QuestionId, Answer)]) -> Option<Refusal> {
        let FormId::Trial { trial, .. } = form else {
            return None;
        };
        let part = self.part_of(self.history.planned(trial)?)?;
        let Task::Ranking(own) = &part.task else {
            return None;
        };
        let asked = own.asked(&part.asks);
        let rank = |answer: &Answer| match answer {
            Answer::Rating(rank) => Some(*rank),
            _ => None,
        };
        let taken = |(question, answer): &(QuestionId, Answer)| {
            let at = asked.iter().position(|id| id == question)?;
            let before = asked[..at].iter();
            let before = before.filter_map(|id| rank(self.history.answer(form, id)?));
            let ranks: Vec<i64> = before.chain(rank(answer)).collect();
            let again = (1..ranks.len()).find(|i| ranks[..*i].contains(&ranks[*i]))?;
            Some(Refusal::RankTaken(ranks[again]))
        };
        answers.iter().filter(|_| !own.ties).find_map(taken)
    }

    /// Records an answer to a form on the screen. After a step back it may replace an
    /// earlier one.
    fn enter(&mut self, form: FormId, question: QuestionId, answer: Answer, at: Moment) {
        let channel = self.channel;
        let event = match self.history.answer(form, &question) {
            Some(before) if *before == answer => return,
            Some(before) => Event::Corrected {
                form,
                question,
                from: Some(before.clone()),
                to: answer,
                reason: STEP_BACK.to_owned(),
                by: match form {
                    FormId::Setup => Author::Experimenter,
                    _ => self.entered_by(),
                },
                channel,
            },
            None => Event::Answered {
                form,
                question,
                answer,
                channel,
            },
        };
        self.record(event, at);
    }

    /// Shows the page before the one on the screen, with its answers; before that of the initials,
    /// the document.
    pub(super) fn back(&mut self) {
        if let Phase::Form(open) = &mut self.phase {
            if open.id == FormId::Consent {
                self.phase = Phase::Consent;
            } else {
                open.at = open.at.saturating_sub(1);
            }
        }
    }

    /// Whether a page comes before the one on the screen.
    pub(super) fn can_go_back(&self) -> bool {
        matches!(&self.phase, Phase::Form(open) if open.at > 0 || open.id == FormId::Consent)
    }

    fn turn_page(&mut self, at: Moment) {
        if let Phase::Form(open) = &mut self.phase {
            open.at += 1;
            if open.at == open.pages.len() {
                let form = open.id;
                let spent_s = at.seconds_since(&open.opened) - open.overlaid_s;
                self.complete(form, spent_s.max(0.0), at);
            }
        }
    }

    /// Every question of the form is answered: proceed once that is on disk.
    fn complete(&mut self, form: FormId, spent_s: f64, at: Moment) {
        if let Some(step) = step_of(form) {
            self.passed.insert(step);
        }
        if let FormId::Trial { trial, attempt } = form {
            let earlier = self.history.open().map(|o| o.attempt.rated_earlier_s);
            let done = Event::TrialDone {
                trial,
                attempt,
                response_s: spent_s + earlier.unwrap_or(0.0),
                paused_s: self.paused_s(),
            };
            self.record(done, at);
            self.apart_s = 0.0;
            self.feedback = self.told(trial);
        }
        self.phase = Phase::Saving;
        self.proceed_if_saved(at);
    }

    /// Whether the answer to a trial is correct, if its participant is told.
    pub(super) fn told(&self, trial: u32) -> Option<Told> {
        let planned = self.history.planned(trial)?;
        let part = self.part_of(planned)?;
        let (attempt, _) = self.history.completion(trial)?;
        let form = FormId::Trial { trial, attempt };
        let answer = self.history.answer(form, part.asks.first()?)?;
        match &planned.stimuli {
            Stimuli::Track {
                track, intervals, ..
            } => {
                let track = self.protocol.track(track).filter(|t| t.feedback)?;
                let correct = track.is_correct(intervals, answer)?;
                let label = None;
                Some(Told { correct, label })
            }
            Stimuli::One { model } => {
                let own = part.task.identification()?;
                let own = Some(own).filter(|own| own.tells(planned.practice))?;
                let correct = own.is_correct(model, answer)?;
                let label = own.label_of(model).map(str::to_owned);
                Some(Told { correct, label })
            }
            Stimuli::Rated { .. }
            | Stimuli::Pair { .. }
            | Stimuli::Search { .. }
            | Stimuli::Set { .. }
            | Stimuli::Adjusted { .. } => None,
        }
    }

    pub(super) fn remark(&mut self, by: Author, text: String, at: Moment) {
        if let Err(why) = self.accepts_records().and_then(|()| check_free_text(&text)) {
            return self.notify(why.to_string());
        }
        let trial = self.history.open().map(|o| o.trial.trial);
        self.remarks.push(text.clone());
        self.record(Event::Remark { by, trial, text }, at);
    }

    pub(super) fn correct(
        &mut self,
        form: FormId,
        question: &QuestionId,
        answer: Answer,
        reason: String,
        by: Author,
        at: Moment,
    ) {
        let asked = self.questions(form).into_iter().find(|q| q.id == *question);
        let answer = match asked {
            Some(asked) => self.meant(asked, answer),
            None => answer,
        };
        match self.check_correction(form, question, &answer, &reason) {
            Err(why) => self.notify(why.words(&self.words)),
            Ok(from) => {
                let corrected = Event::Corrected {
                    form,
                    question: question.clone(),
                    from: Some(from),
                    to: answer,
                    reason,
                    by,
                    channel: self.channel,
                };
                self.record(corrected, at);
            }
        }
    }

    fn check_correction(
        &self,
        form: FormId,
        question: &QuestionId,
        answer: &Answer,
        reason: &str,
    ) -> Result<Answer, InputRefused> {
        self.accepts_records()?;
        let asked = self.questions(form).into_iter().find(|q| q.id == *question);
        let given = self.history.answer(form, question);
        // A level that was felt cannot be typed.
        if self.set_in(form) == Some(question) {
            return Err(InputRefused::NothingToCorrect);
        }
        let (Some(asked), Some(from), true) = (asked, given, self.history.is_current(form)) else {
            return Err(InputRefused::NothingToCorrect);
        };
        asked.accepts(answer)?;
        if from == answer {
            return Err(InputRefused::Unchanged);
        }
        check_free_text(reason).map_err(|why| InputRefused::Reason(Box::new(why)))?;
        Ok(from.clone())
    }

    /// Nothing more is recorded of a participant who dropped out or did not
    /// consent.
    pub(super) fn accepts_records(&self) -> Result<(), InputRefused> {
        if self.history.over() && !self.history.finished() {
            Err(InputRefused::SessionOver)
        } else {
            Ok(())
        }
    }
}

/// Checks the text of a remark or reason: neither empty nor too long.
pub(super) fn check_free_text(text: &str) -> Result<(), InputRefused> {
    if text.trim().is_empty() {
        Err(InputRefused::NoText)
    } else if text.len() > MAX_TEXT_BYTES {
        Err(InputRefused::TextTooLong)
    } else {
        Ok(())
    }
}

/// The step of a form that appears once.
pub(super) fn step_of(form: FormId) -> Option<Step> {
    match form {
        FormId::Setup => Some(Step::Setup),
        FormId::Intake => Some(Step::Intake),
        FormId::Outro => Some(Step::Outro),
        FormId::Trial { .. } | FormId::After { .. } | FormId::Consent => None,
    }
}

/// The pages of a form: one question each, with an optional text that directly
/// follows it.
fn pages(questions: &[&Question]) -> Vec<Vec<Question>> {
    let mut pages: Vec<Vec<Question>> = Vec::new();
    for &question in questions {
        let below = question.kind.control() == Control::Text && !question.required;
        match pages.last_mut() {
            Some(page) if below && page.len() == 1 => page.push(question.clone()),
            _ => pages.push(vec![question.clone()]),
        }
    }
    pages
}

/// Checks the answers to a page and returns them in the page's order. A text or
/// choice left empty becomes an empty answer, so that it is not asked again.
fn check(
    page: &[Question],
    mut given: Vec<(QuestionId, Answer)>,
) -> Result<Vec<(QuestionId, Answer)>, InputRefused> {
    let mut checked = Vec::new();
    for question in page {
        let at = given.iter().position(|(id, _)| *id == question.id);
        let answer = at.map(|at| given.swap_remove(at).1);
        match answer.or(question.kind.control().empty()) {
            Some(answer) => {
                question.accepts(&answer)?;
                checked.push((question.id.clone(), answer));
            }
            None if question.required => return Err(question.kind.control().needed().into()),
            None => {}
        }
    }
    match given.first() {
        Some((id, _)) => Err(InputRefused::NotAsked(id.clone())),
        None => Ok(checked),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_plan::protocol::{example, kinds};

    fn text(id: &str, required: bool) -> Question {
        Question {
            id: QuestionId::new(id).unwrap(),
            prompt: id.to_owned(),
            kind: kinds::Text.into(),
            required,
        }
    }

    #[test]
    fn a_page_is_one_question_and_the_optional_text_below_it() {
        let mut questions = example::protocol(2, 1).questions;
        questions.extend([text("more", false), text("must", true), text("may", false)]);
        let questions: Vec<&Question> = questions.iter().collect();
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

    #[test]
    fn a_remark_is_neither_blank_nor_longer_than_the_limit() {
        assert!(matches!(check_free_text(" \n"), Err(InputRefused::NoText)));
        assert!(check_free_text(&"x".repeat(MAX_TEXT_BYTES)).is_ok());
        let long = "x".repeat(MAX_TEXT_BYTES + 1);
        assert!(matches!(
            check_free_text(&long),
            Err(InputRefused::TextTooLong)
        ));
    }
}
