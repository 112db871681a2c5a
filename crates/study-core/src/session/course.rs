//! The course of a session: what comes next, and everything between the trials.

use super::Session;
use super::phase::{Form, Phase};
use super::view::MessageKind;
use crate::outcome::{Author, Event, Moment, Place};
use crate::protocol::Entry;

/// Something that is passed once in a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Step {
    Welcome,
    Instructions,
    Practice,
    PracticeOver,
    Setup,
    Intake,
    Outro,
}

impl From<MessageKind> for Step {
    fn from(kind: MessageKind) -> Self {
        match kind {
            MessageKind::Welcome => Self::Welcome,
            MessageKind::Instructions => Self::Instructions,
            MessageKind::Practice => Self::Practice,
            MessageKind::PracticeOver => Self::PracticeOver,
        }
    }
}

impl Session {
    /// Goes to whatever the history says is next.
    pub(super) fn go_on(&mut self, at: Moment) {
        if self.history.over() {
            self.phase = Phase::End;
        } else if self.consent_is_missing() {
            self.phase = Phase::Consent;
        } else if self.history.consent == Some(false) {
            self.refused(at);
        } else if !self.before_trials(at) && !self.trials(at) && !self.after_trials(at) {
            self.record(Event::Finished, at);
            self.phase = Phase::Saving;
        }
    }

    fn consent_is_missing(&self) -> bool {
        self.protocol.consent.is_some() && self.history.consent.is_none()
    }

    pub(super) fn consent(&mut self, accepted: bool, at: Moment) {
        let (Phase::Consent, Some(consent)) = (&self.phase, &self.protocol.consent) else {
            return;
        };
        let consented = Event::Consented {
            document: consent.document.clone(),
            version: consent.version.clone(),
            accepted,
            by: self.typist(),
        };
        self.record(consented, at);
        if accepted {
            self.phase = Phase::Saving;
        } else {
            self.refused(at);
        }
    }

    fn refused(&mut self, at: Moment) {
        self.drop_out("no consent", at);
        self.phase = Phase::Saving;
    }

    /// Who types what the participant says.
    fn typist(&self) -> Author {
        match self.protocol.session.entry {
            Entry::Participant => Author::Participant,
            Entry::Experimenter => Author::Experimenter,
        }
    }

    /// Set-up, welcome, intake and instructions, whichever is first to do.
    fn before_trials(&mut self, at: Moment) -> bool {
        let begun = self.history.any_attempt(false) || self.history.instructions_read;
        let intake_begun = begun || self.history.any_answer(Place::Intake);
        let setup = !intake_begun && self.open_form(Place::Setup, at);
        if setup || (!intake_begun && self.show_message(MessageKind::Welcome)) {
            return true;
        }
        if begun {
            return false;
        }
        if self.open_form(Place::Intake, at)
            || self.show_message(MessageKind::Instructions)
            || self.show_message(MessageKind::Practice)
        {
            return true;
        }
        let text = &self.protocol.text;
        if text.instructions.is_some() || (text.practice.is_some() && self.has_practice()) {
            self.record(Event::InstructionsRead, at);
        }
        false
    }

    /// A rating that is owed, a break, or the next trial.
    fn trials(&mut self, at: Moment) -> bool {
        if self.history.open.is_some() {
            self.after_playback(at);
            return true;
        }
        if let Some(began) = self.history.open_break {
            let rested_s = (at.wall - began.wall).as_seconds_f64().max(0.0);
            self.phase = Phase::Break {
                since: at,
                rested_s,
            };
            return true;
        }
        let breaks = self.protocol.design.breaks;
        if let Some(after) = breaks.and_then(|b| self.history.break_due(b.every)) {
            self.record(Event::BreakStarted { after }, at);
            self.phase = Phase::Break {
                since: at,
                rested_s: 0.0,
            };
            return true;
        }
        let Some(next) = self.history.next_trial() else {
            return false;
        };
        let first_that_counts = !next.practice && !self.history.any_attempt(true);
        if !(first_that_counts && self.show_message(MessageKind::PracticeOver)) {
            self.phase = Phase::Reference { since: at };
        }
        true
    }

    fn after_trials(&mut self, at: Moment) -> bool {
        self.open_form(Place::Outro, at)
    }

    fn has_practice(&self) -> bool {
        self.history.planned_total(true) > 0
    }

    fn show_message(&mut self, kind: MessageKind) -> bool {
        let shown = self.behind.contains(&Step::from(kind));
        if !shown && self.message(kind).is_some() {
            self.phase = Phase::Message(kind);
            return true;
        }
        false
    }

    /// The words of a message, if there are any.
    pub(super) fn message(&self, kind: MessageKind) -> Option<&str> {
        let text = &self.protocol.text;
        match kind {
            MessageKind::Welcome => text.welcome.as_deref(),
            MessageKind::Instructions => text.instructions.as_deref(),
            MessageKind::Practice => text.practice.as_deref().filter(|_| self.has_practice()),
            MessageKind::PracticeOver => self
                .has_practice()
                .then_some("The practice is over. From now on, every answer counts."),
        }
    }

    /// Enter: takes away what lies over the phase, or else goes on in it.
    pub(super) fn advance_or_uncover(&mut self, at: Moment) {
        if self.ledger.trouble.is_some() {
            self.retry_save();
        } else if let Some(since) = self.paused.take_if(|_| self.phase.under_way()) {
            let paused_s = at.seconds_since(&since);
            self.record(Event::Unpaused { paused_s }, at);
        } else if self.trouble.is_some() && !self.in_form() {
            if self.can_go_on() {
                self.trouble = None;
            } else {
                self.say("the device does not answer yet");
            }
        } else {
            self.advance(at);
        }
    }

    fn advance(&mut self, at: Moment) {
        match &self.phase {
            Phase::Message(kind) => {
                self.behind.insert((*kind).into());
                self.go_on(at);
            }
            Phase::Reference { since } => {
                let shown_s = at.seconds_since(since);
                if self.reference_wait_s(at) > 0.0 {
                    self.say("not yet");
                } else if self.device_lost {
                    self.show_trouble_again();
                } else {
                    self.begin_attempt(shown_s, at);
                }
            }
            Phase::Mounting { .. } => self.mounted(at),
            Phase::Playing { counts, .. } => {
                self.finish_playing(counts.unwrap_or_default().strokes, at);
            }
            Phase::Stopped => self.say("choose: play it again, or rate it"),
            Phase::Break { since, rested_s } => {
                let rested_s = rested_s + at.seconds_since(since);
                if self.break_wait_s(at) > 0.0 {
                    self.say("rest a little longer");
                } else {
                    self.record(Event::BreakEnded { rested_s }, at);
                    self.go_on(at);
                }
            }
            Phase::End => self.leave(false, at),
            _ => {}
        }
    }

    /// Seconds until Enter works on the reference prompt.
    pub(super) fn reference_wait_s(&self, at: Moment) -> f64 {
        match &self.phase {
            Phase::Reference { since } => {
                let least = self.protocol.trial.reference_min_s;
                (least - at.seconds_since(since)).max(0.0)
            }
            _ => 0.0,
        }
    }

    /// Seconds until Enter works in a break.
    pub(super) fn break_wait_s(&self, at: Moment) -> f64 {
        match (&self.phase, self.protocol.design.breaks) {
            (Phase::Break { since, rested_s }, Some(breaks)) => {
                (breaks.at_least_s - rested_s - at.seconds_since(since)).max(0.0)
            }
            _ => 0.0,
        }
    }

    /// Whether Enter takes device trouble away: the device is back, or is not
    /// needed now.
    pub(super) fn can_go_on(&self) -> bool {
        !self.device_lost || !matches!(self.phase, Phase::Reference { .. })
    }

    pub(super) fn in_form(&self) -> bool {
        matches!(self.phase, Phase::Form(_))
    }

    /// What lies over the phase, the topmost.
    pub(super) fn cover(&self) -> Option<Cover> {
        if self.ledger.trouble.is_some() {
            Some(Cover::Disk)
        } else if self.paused.is_some() {
            Some(Cover::Pause)
        } else if self.trouble.is_some() && !self.in_form() {
            Some(Cover::Device)
        } else {
            None
        }
    }

    /// Keeps time under a cover out of what is measured: a rating stands still,
    /// a reference prompt begins anew.
    pub(super) fn note_cover(&mut self, at: Moment) {
        match (self.cover(), self.covered) {
            (Some(_), None) => self.covered = Some(at),
            (None, Some(since)) => {
                self.covered = None;
                match &mut self.phase {
                    Phase::Form(Form {
                        opened, covered_s, ..
                    }) => {
                        let from = if since.mono_ns > opened.mono_ns {
                            since
                        } else {
                            *opened
                        };
                        *covered_s += at.seconds_since(&from);
                    }
                    Phase::Reference { since } => *since = at,
                    _ => {}
                }
            }
            _ => {}
        }
    }
}

/// What can lie over the phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cover {
    Disk,
    Pause,
    Device,
}
