//! The flow of a session: what comes next, and everything between the trials.

use super::Session;
use super::phase::{Form, Phase};
use super::view::MessageKind;
use crate::outcome::{Author, Event, FormId, Moment};
use study_plan::protocol::phrases::Phrase;
use study_plan::protocol::{Entry, Trial};

/// A form or message that appears once in a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Step {
    Welcome,
    Instructions,
    Practice,
    PracticeOver,
    Setup,
    Intake,
    Outro,
    Debriefing,
}

impl Step {
    /// That of a message, unless each part has one.
    fn of(kind: MessageKind) -> Option<Self> {
        match kind {
            MessageKind::Welcome => Some(Self::Welcome),
            MessageKind::Instructions => Some(Self::Instructions),
            MessageKind::Practice => Some(Self::Practice),
            MessageKind::PracticeOver => Some(Self::PracticeOver),
            MessageKind::Debriefing => Some(Self::Debriefing),
            MessageKind::Part | MessageKind::Feedback => None,
        }
    }
}

impl Session {
    /// Enters the phase that is next according to the history.
    pub(super) fn proceed(&mut self, at: Moment) {
        if self.history.over() {
            self.phase = Phase::End;
        } else if let Some(told) = self.feedback.take() {
            self.phase = Phase::Feedback(told);
        } else if self.consent_is_missing() {
            self.phase = Phase::Consent;
        } else if !self.before_trials(at) && !self.trials(at) && !self.after_trials(at) {
            self.record(Event::Finished, at);
            self.phase = Phase::Saving;
        }
    }

    fn consent_is_missing(&self) -> bool {
        self.protocol.consent.is_some() && self.history.consent.is_none()
    }

    /// Who enters the participant's answers.
    pub(super) fn entered_by(&self) -> Author {
        match self.protocol.session.entry {
            Entry::Participant => Author::Participant,
            Entry::Experimenter => Author::Experimenter,
        }
    }

    /// Enters the first of set-up, welcome, intake and instructions that is not
    /// completed; returns whether there was one.
    fn before_trials(&mut self, at: Moment) -> bool {
        let begun = self.history.any_attempt(false) || self.history.instructions_read;
        let intake_begun = begun || self.history.any_answer(FormId::Intake);
        let setup = !intake_begun && self.open_form(FormId::Setup, at);
        if setup || (!intake_begun && self.show_message(MessageKind::Welcome)) {
            return true;
        }
        if begun {
            return false;
        }
        if self.open_form(FormId::Intake, at)
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

    /// Enters an unfinished rating, a questionnaire between trials, a break or the next trial;
    /// returns whether there was one.
    fn trials(&mut self, at: Moment) -> bool {
        if self.history.open().is_some() {
            self.after_playback(at);
            return true;
        }
        if self.ask_between(at) {
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
        if let Some(after) = self.break_due() {
            self.record(Event::BreakStarted { after }, at);
            self.phase = Phase::Break {
                since: at,
                rested_s: 0.0,
            };
            return true;
        }
        self.end_practice(at);
        self.end_tracks(at);
        // Only now is a part of tracks over.
        if self.ask_between(at) || self.show_message(MessageKind::Part) {
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

    /// The number of closed trials if a break is due now.
    fn break_due(&self) -> Option<u32> {
        let every = self.protocol.design.breaks?.every;
        let closed = self.history.closed(false);
        let due = every > 0 && closed > 0 && closed.is_multiple_of(every);
        let more = self.history.next_trial().is_some_and(|t| !t.practice);
        (due && more && !self.history.breaks.contains(&closed)).then_some(closed)
    }

    /// Enters the closing questions or, after them, what the study was about; returns whether there was one of them.
    fn after_trials(&mut self, at: Moment) -> bool {
        if self.open_form(FormId::Outro, at) {
            return true;
        }
        if self.protocol.debriefing.is_none() || self.history.debriefed {
            return false;
        }
        if self.show_message(MessageKind::Debriefing) {
            return true;
        }
        self.record(Event::Debriefed, at);
        false
    }

    fn has_practice(&self) -> bool {
        self.history.planned_total(true) > 0
    }

    fn show_message(&mut self, kind: MessageKind) -> bool {
        let shown = match Step::of(kind) {
            Some(step) => self.passed.contains(&step),
            None => self.next_part_begun(),
        };
        if !shown && self.message(kind).is_some() {
            self.phase = Phase::Message(kind);
            return true;
        }
        false
    }

    /// Whether the text of the next trial's part was shown, or a trial of it began.
    fn next_part_begun(&self) -> bool {
        let Some(part) = self.history.next_trial().and_then(|t| t.part.as_ref()) else {
            return true;
        };
        let begun = |t: &Trial| t.part.as_ref() == Some(part) && self.history.attempts(t.trial) > 0;
        self.parts_shown.contains(part) || self.history.schedule().iter().any(begun)
    }

    /// The text of a message, if it is to be shown.
    pub(super) fn message(&self, kind: MessageKind) -> Option<&str> {
        let text = &self.protocol.text;
        match kind {
            MessageKind::Part => self.part_of(self.history.next_trial()?)?.text.as_deref(),
            MessageKind::Feedback => None,
            MessageKind::Welcome => text.welcome.as_deref(),
            MessageKind::Instructions => text.instructions.as_deref(),
            MessageKind::Practice => text.practice.as_deref().filter(|_| self.has_practice()),
            MessageKind::PracticeOver => self
                .has_practice()
                .then(|| self.words.get(Phrase::PracticeEnd)),
            MessageKind::Debriefing => self.protocol.debriefing.as_ref()?.text.as_deref(),
        }
    }

    /// Enter: dismisses the overlay, or else advances the phase.
    pub(super) fn advance_or_dismiss(&mut self, at: Moment) {
        if self.saves.trouble.is_some() {
            self.retry_save();
        } else if let Some(since) = self.paused.take_if(|_| self.phase.under_way()) {
            let paused_s = at.seconds_since(&since);
            self.record(Event::Unpaused { paused_s }, at);
        } else if self.device_problem.is_some() && !self.in_form() {
            if self.can_continue() {
                self.device_problem = None;
            } else {
                self.notify("the device does not respond yet");
            }
        } else {
            self.advance(at);
        }
    }

    /// Enter on the phase alone.
    pub(super) fn advance(&mut self, at: Moment) {
        match &self.phase {
            Phase::Message(kind) => {
                match Step::of(*kind) {
                    Some(step) => {
                        self.passed.insert(step);
                    }
                    None => {
                        let next = self.history.next_trial().and_then(|t| t.part.clone());
                        self.parts_shown.extend(next);
                    }
                }
                self.proceed(at);
            }
            Phase::Feedback(_) => self.proceed(at),
            Phase::Reference { since } => {
                let shown_s = at.seconds_since(since);
                if self.reference_wait_s(at) > 0.0 {
                    self.notify("wait for the prompt to end");
                } else if self.device_lost {
                    self.show_device_lost();
                } else if self.waits_for_media(at) {
                    self.notify("the participant's page is not open and in sight, or has not loaded its pictures and sounds");
                } else {
                    self.begin_attempt(shown_s, at);
                }
            }
            Phase::Mounting { .. } => self.mounted(at),
            &Phase::Playing { strokes, since, .. } => {
                self.finish_playing(at.seconds_since(&since), strokes, at);
            }
            Phase::Stopped { .. } => self.notify("choose: play it again or rate it"),
            Phase::Break { since, rested_s } => {
                let rested_s = rested_s + at.seconds_since(since);
                if self.break_wait_s(at) > 0.0 {
                    self.notify("rest a little longer");
                } else {
                    self.record(Event::BreakEnded { rested_s }, at);
                    self.proceed(at);
                }
            }
            Phase::End => self.leave(false, at),
            _ => {}
        }
    }

    /// Time until Enter works on the reference prompt, s.
    pub(super) fn reference_wait_s(&self, at: Moment) -> f64 {
        match &self.phase {
            Phase::Reference { since } => {
                let least = self.protocol.trial.reference_min_s;
                (least - at.seconds_since(since)).max(0.0)
            }
            _ => 0.0,
        }
    }

    /// Time until Enter works in a break, s.
    pub(super) fn break_wait_s(&self, at: Moment) -> f64 {
        match (&self.phase, self.protocol.design.breaks) {
            (Phase::Break { since, rested_s }, Some(breaks)) => {
                (breaks.at_least_s - rested_s - at.seconds_since(since)).max(0.0)
            }
            _ => 0.0,
        }
    }

    /// Whether Enter dismisses a device problem: the device is back, or is not
    /// needed now.
    pub(super) fn can_continue(&self) -> bool {
        !self.device_lost || !matches!(self.phase, Phase::Reference { .. })
    }

    pub(super) fn in_form(&self) -> bool {
        matches!(self.phase, Phase::Form(_))
    }

    /// The topmost overlay.
    pub(super) fn overlay(&self) -> Option<Overlay> {
        if self.saves.trouble.is_some() {
            Some(Overlay::Disk)
        } else if self.paused.is_some() {
            Some(Overlay::Pause)
        } else if self.device_problem.is_some() && !self.in_form() {
            Some(Overlay::Device)
        } else {
            None
        }
    }

    /// Excludes the time under an overlay from what is measured: the rating time
    /// pauses, a reference prompt starts again. It counts as a pause before the answer.
    pub(super) fn track_overlay(&mut self, at: Moment) {
        match (self.overlay(), self.overlaid_since) {
            (Some(_), None) => self.overlaid_since = Some(at),
            (None, Some(since)) => {
                self.overlaid_since = None;
                match &mut self.phase {
                    Phase::Form(Form {
                        opened, overlaid_s, ..
                    }) => {
                        let from = if since.mono_ns > opened.mono_ns {
                            since
                        } else {
                            *opened
                        };
                        *overlaid_s += at.seconds_since(&from);
                    }
                    Phase::Reference { since } => *since = at,
                    Phase::Stopped { since } => *since = at,
                    _ => {}
                }
                self.was_away(at.seconds_since(&since), at);
            }
            _ => {}
        }
    }
}

/// A screen that hides the phase until it is dismissed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Overlay {
    Disk,
    Pause,
    Device,
}
