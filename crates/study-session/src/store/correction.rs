//! Corrections after a session: of an answer, and of a mistyped id.
//!
//! Nothing is overwritten: a correction is one more record of the journal, with both values, its
//! reason and its time. An id is also the name of a folder; the record comes first, so that a
//! correction that is interrupted can be repeated.

use super::error::{At as _, StoreError};
use super::ledger::check_new_id;
use super::sessions::SessionData;
use super::{StudyFolder, layout};
use crate::outcome::{Author, Event, FormId, Moment, State};
use study_base::text::{ParticipantId, QuestionId, Untrusted};
use study_plan::protocol::phrases::Words;
use study_plan::protocol::{Answer, Given, Protocol, Question};

/// A request to correct an answer.
#[derive(Debug, Clone, PartialEq)]
pub struct AnswerCorrection {
    /// Participant.
    pub participant: ParticipantId,
    /// Session; `None`: the last one.
    pub session: Option<u32>,
    /// Trial; `None`: a question that is asked once.
    pub trial: Option<u32>,
    /// Question.
    pub question: QuestionId,
    /// The answer as it would be typed; `None`: declined, for the same reason.
    pub to: Option<String>,
    /// Reason.
    pub reason: String,
}

/// A corrected answer.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrectedAnswer {
    /// Answer before.
    pub from: Answer,
    /// Answer from now on.
    pub to: Answer,
    /// Messages to the operator.
    pub notices: Vec<String>,
}

impl StudyFolder {
    /// Corrects an answer that counts. The derived tables must be written again afterwards.
    ///
    /// # Errors
    /// [`StoreError`]: no such participant, session or answer, an answer that is not accepted,
    /// an open session, or the disk's.
    pub fn correct_answer(
        &self,
        request: &AnswerCorrection,
        protocol: &Protocol,
        at: Moment,
    ) -> Result<CorrectedAnswer, StoreError> {
        let _lock = self.lock()?;
        let id = &request.participant;
        let refused = |why: String| StoreError::CorrectionRefused {
            participant: id.clone(),
            why,
        };
        let own = self.kept_sessions(id)?;
        let session = match request.session {
            Some(number) => own.iter().find(|s| s.session == number),
            None => own.last(),
        };
        let session = session.ok_or_else(|| refused("there is no such session".to_owned()))?;
        if session.standing().state == State::Withdrawn {
            return Err(refused("who withdrew is not corrected".to_owned()));
        }
        let name = Untrusted(request.question.as_str()).to_string();
        let none = || {
            refused(match request.trial {
                Some(trial) => format!("trial {trial} has no answer to `{name}` that counts"),
                None => format!("`{name}` was not answered; --trial names the trial of a rating"),
            })
        };
        if request.to.is_some() && is_set(protocol, session, request) {
            let why = format!("`{name}` is a level that was set: it was felt, and cannot be typed");
            return Err(refused(why));
        }
        let (form, from) = given(session, request).ok_or_else(none)?;
        let question = asked(protocol, form, &request.question).ok_or_else(none)?;
        let to = match &request.to {
            Some(typed) => question
                .read(Some(&Given::Typed(typed.clone())))
                .map(|answer| answer.unwrap_or_else(|| Answer::Text(String::new())))
                .map_err(|why| refused(why.words(&Words::default())))?,
            None => Answer::Declined {
                reason: request.reason.clone(),
            },
        };
        if to == from {
            return Err(refused("that is already the answer".to_owned()));
        }
        let event = Event::Corrected {
            form,
            question: request.question.clone(),
            from: Some(from.clone()),
            to: to.clone(),
            reason: request.reason.clone(),
            by: Author::Experimenter,
            channel: None,
        };
        let mut notices = Vec::new();
        self.append_state(id, false, session.session, at, &event, &mut notices)?;
        Ok(CorrectedAnswer { from, to, notices })
    }

    /// Corrects a mistyped id: of every session of the participant, and of their folder. The
    /// derived tables must be written again afterwards.
    ///
    /// # Errors
    /// [`StoreError`]: no such participant, another one with this id, an open session, tables
    /// with sessions whose journals are missing, or the disk's.
    pub fn correct_id(
        &self,
        from: &ParticipantId,
        to: &ParticipantId,
        reason: &str,
        at: Moment,
    ) -> Result<Vec<String>, StoreError> {
        let _lock = self.lock()?;
        let own = self.kept_sessions(from)?;
        check_new_id(to)?;
        let ids = self.participant_ids()?;
        let taken = |id: &&ParticipantId| *id == to || (*id != from && id.collides_with(to));
        if let Some(other) = ids.iter().find(taken) {
            return Err(StoreError::CorrectionRefused {
                participant: from.clone(),
                why: format!("{other} takes part already, and two participants are not made one"),
            });
        }
        let mut notices = Vec::new();
        for session in &own {
            let last = session.entries.iter().rev().find_map(|e| match &e.event {
                Event::IdCorrected { to, .. } => Some(to),
                _ => None,
            });
            // An earlier call was interrupted before the folder had its new name.
            if last != Some(to) {
                let event = Event::IdCorrected {
                    from: from.clone(),
                    to: to.clone(),
                    reason: reason.to_owned(),
                };
                self.append_state(from, false, session.session, at, &event, &mut notices)?;
            }
        }
        let (old, new) = (
            layout::participant(&self.path, from),
            layout::participant(&self.path, to),
        );
        self.disk.rename(&old, &new).at(&old)?;
        let sessions = self.path.join(layout::SESSIONS);
        self.disk.sync_folder(&sessions).at(&sessions)?;
        Ok(notices)
    }

    /// The sessions of somebody whose data are there; at least one.
    ///
    /// # Errors
    /// [`StoreError`]: no such participant, one whose data were erased, or the disk's.
    pub fn kept_sessions(&self, id: &ParticipantId) -> Result<Vec<SessionData>, StoreError> {
        let own = self.sessions_of(id)?;
        match own.last() {
            None => Err(StoreError::Unknown {
                participant: id.clone(),
                near: self.near(id)?,
            }),
            Some(last) if last.tombstone.is_some() => Err(StoreError::Erased {
                participant: id.clone(),
            }),
            Some(_) => Ok(own),
        }
    }
}

/// Whether the answer is a level that was set in a trial of adjustment.
fn is_set(protocol: &Protocol, session: &SessionData, request: &AnswerCorrection) -> bool {
    let trial = request.trial.and_then(|n| session.history.planned(n));
    let part = trial.and_then(|trial| protocol.part(trial.part.as_ref()?));
    part.is_some_and(|part| {
        part.task.adjustment().is_some() && part.asks.first() == Some(&request.question)
    })
}

/// The answer that counts, and the form in which it was given.
fn given(session: &SessionData, request: &AnswerCorrection) -> Option<(FormId, Answer)> {
    let history = &session.history;
    let forms = match request.trial {
        Some(trial) => {
            let attempt = history.attempts(trial);
            vec![
                FormId::Trial { trial, attempt },
                FormId::After { trial, attempt },
            ]
        }
        None => vec![FormId::Setup, FormId::Intake, FormId::Outro],
    };
    let current = forms.into_iter().filter(|form| history.is_current(*form));
    let mut answers = current.filter_map(|form| {
        let answer = history.answer(form, &request.question)?;
        Some((form, answer.clone()))
    });
    answers.next()
}

fn asked<'a>(protocol: &'a Protocol, form: FormId, id: &QuestionId) -> Option<&'a Question> {
    let all = match form {
        FormId::Setup => &protocol.setup,
        FormId::Intake => &protocol.intake,
        FormId::Outro => &protocol.outro,
        FormId::Trial { .. } => &protocol.questions,
        FormId::After { .. } => return protocol.between().find(|q| q.id == *id),
        FormId::Consent => return None,
    };
    all.iter().find(|q| q.id == *id)
}
