//! Consent: the text of the document, the decision, and initials in place of a signature.
//!
//! The journal has the decision. The copy that is made for the participant has the text and
//! the initials, which are in nothing else that is written.

use super::phase::{Form, Phase};
use super::{Effect, Screen, Session};
use crate::outcome::{Event, FormId, Moment};
use std::fmt::Display;
use study_base::text::QuestionId;
use study_plan::protocol::phrases::Phrase;
use study_plan::protocol::{Answer, Consent, Question, QuestionKind, kinds};

impl Session {
    /// What the participant is asked to agree to.
    pub(super) fn consent_screen(&self, consent: &Consent) -> Screen {
        match &consent.text {
            None => Screen::Consent {
                document: consent.document.clone(),
                version: consent.version.clone(),
            },
            Some(text) => Screen::Consent {
                document: format!("{}\n\n{text}", self.title_of(consent)),
                version: String::new(),
            },
        }
    }

    fn title_of(&self, consent: &Consent) -> String {
        let values = [
            ("document", &consent.document as &dyn Display),
            ("version", &consent.version),
        ];
        self.words.fill(Phrase::Version, &values)
    }

    pub(super) fn consent(&mut self, accepted: bool, at: Moment) {
        let (Phase::Consent, Some(consent)) = (&self.phase, &self.protocol.consent) else {
            return;
        };
        if accepted && consent.initials {
            self.ask_initials(at);
        } else {
            self.decide(accepted, None, at);
        }
    }

    /// Enters the page on which the participant types initials.
    pub(super) fn ask_initials(&mut self, at: Moment) {
        let Ok(id) = QuestionId::new("initials") else {
            return;
        };
        let question = Question {
            id,
            prompt: self.words.get(Phrase::Initials).to_owned(),
            kind: QuestionKind::Text(kinds::Text),
            required: true,
        };
        self.phase = Phase::Form(Form {
            id: FormId::Consent,
            pages: vec![vec![question]],
            at: 0,
            opened: at,
            overlaid_s: 0.0,
        });
    }

    /// What was typed as initials: who declines to has not agreed yet.
    pub(super) fn sign(&mut self, answers: &[(QuestionId, Answer)], at: Moment) {
        let typed = match answers.first() {
            Some((_, Answer::Text(typed))) => typed.trim(),
            _ => "",
        };
        if typed.is_empty() {
            let needed = self.words.get(Phrase::PlainNeeded).to_owned();
            return self.notify(needed);
        }
        self.decide(true, Some(typed), at);
    }

    /// Records the decision; before it, the copy of what was agreed to is kept.
    fn decide(&mut self, accepted: bool, initials: Option<&str>, at: Moment) {
        let Some(consent) = self.protocol.consent.clone() else {
            return;
        };
        if accepted && (consent.text.is_some() || initials.is_some()) {
            let copy = self.copy_of(&consent, initials, at);
            self.saves.copy = Some(copy.clone());
            self.out.push(Effect::KeepConsent(copy));
        }
        let consented = Event::Consented {
            document: consent.document,
            version: consent.version,
            accepted,
            by: self.entered_by(),
        };
        self.record(consented, at);
        if !accepted {
            self.drop_out("no consent", at);
        }
        self.phase = Phase::Saving;
    }

    /// The participant's copy, as plain text.
    fn copy_of(&self, consent: &Consent, initials: Option<&str>, at: Moment) -> String {
        let mut copy = format!("{}\n\n", self.title_of(consent));
        if let Some(text) = &consent.text {
            copy.push_str(&format!("{text}\n\n"));
        }
        let agree = self.words.get(Phrase::Agree);
        let when = at.wall.format("%Y-%m-%d %H:%M %:z");
        copy.push_str(&format!("{}\n", self.protocol.study.title));
        copy.push_str(&format!("{agree} · {} · {when}\n", self.participant));
        if let Some(initials) = initials {
            copy.push_str(&format!("{initials}\n"));
        }
        copy
    }
}
