//! Trials of adjustment: the participant changes the level that is felt, one step of its ladder at a time.
//!
//! A device plays one table. A change is therefore a stop, a load and a start. The force falls before the stop, on a device that
//! can do so, and comes up again with the device's own ramp, so that nobody feels a step. What comes next is in the journal before
//! the stop is requested.
//!
//! A device takes no table before the handle is at rest, and a playback may have a wrong force. Where it is known what was felt,
//! that fails the step and not the setting.

use super::Session;
use super::phase::{Confirmed, Phase};
use super::view::Adjusting;
use crate::outcome::fold::Attempt;
use crate::outcome::{Event, Failure, FormId, Moment};
use study_base::text::{ModelId, QuestionId};
use study_plan::protocol::{Adjustment, Answer, Trial, Turn};

impl Session {
    /// What the trial under way sets, if it is one of adjustment that is not answered yet.
    pub(super) fn adjusting(&self) -> Option<&Adjustment> {
        let open = self.history.open()?;
        let set = self.history.any_answer(open.form());
        self.adjustment_of(open.trial).filter(|_| !set)
    }

    /// What a trial sets, if it is one of adjustment.
    fn adjustment_of(&self, trial: &Trial) -> Option<&Adjustment> {
        self.part_of(trial)?.task.adjustment()
    }

    /// The question whose answer is the level that was set, in the form of a trial of adjustment. It is never shown: it
    /// names the level.
    pub(super) fn set_in(&self, form: FormId) -> Option<&QuestionId> {
        let FormId::Trial { trial, .. } = form else {
            return None;
        };
        let part = self.part_of(self.history.planned(trial)?)?;
        part.task.adjustment()?;
        part.asks.first()
    }

    /// Changes what is felt: after a stop the next level is loaded. Nothing changes while a change is under way, or beyond
    /// the ends of the ladder.
    pub(super) fn adjust(&mut self, turn: Turn, at: Moment) {
        if !matches!(self.phase, Phase::Playing { .. }) {
            return;
        }
        let turned = self.adjusting().and_then(|own| {
            let attempt = self.history.open()?.attempt;
            let level = attempt.set_to().filter(|_| !attempt.is_at_standard())?;
            own.turned(level, turn).cloned()
        });
        if let Some(to) = turned {
            self.feel_next(to, turn == Turn::Standard, at);
            self.request_fade(at);
        }
    }

    fn feel_next(&mut self, to: ModelId, standard: bool, at: Moment) {
        let Some(open) = self.history.open() else {
            return;
        };
        let adjusted = Event::Adjusted {
            trial: open.trial.trial,
            attempt: open.attempt.number,
            to,
            standard,
        };
        self.record(adjusted, at);
    }

    /// Enter: after the standard comes the level, as it does after the longest exposure, and a level is confirmed.
    pub(super) fn leave_level(&mut self, at: Moment) {
        let Some(attempt) = self.history.open().map(|open| open.attempt) else {
            return;
        };
        let at_standard = attempt.is_at_standard();
        let is_last = attempt.interval() == Some(attempt.intervals());
        let level = attempt.set_to().cloned();
        if let Some(level) = level.filter(|_| at_standard && is_last) {
            self.feel_next(level, false, at);
        }
        if at_standard {
            return self.request_fade(at);
        }
        self.request_stop(false, false, at);
        let by = self.confirmed();
        if let Phase::Stopping { confirmed, .. } = &mut self.phase {
            *confirmed = Some(by);
        }
    }

    /// Whether the standard is felt, or comes next, in an adjustment under way.
    pub(super) fn feels_standard(&self) -> bool {
        let open = self.history.open();
        self.adjusting().is_some() && open.is_some_and(|open| open.attempt.is_at_standard())
    }

    /// A confirmation that is entered now.
    pub(super) fn confirmed(&self) -> Confirmed {
        Confirmed {
            channel: self.channel,
        }
    }

    /// A level, or the standard, has stopped without a confirmation: what was chosen comes next, if anything was.
    pub(super) fn after_level(&mut self, at: Moment) {
        let goes_on = self.history.open().is_some_and(|open| {
            let last = open.attempt.presentations.last();
            let ended = last.and_then(|p| p.ended);
            open.attempt.interval().is_some() && ended.is_some_and(|(_, ended)| !ended.stopped)
        });
        match goes_on {
            true => self.load_interval(at),
            false => self.phase = Phase::Stopped { since: at },
        }
    }

    /// Whether the level that was felt last can be confirmed after a stop.
    pub(super) fn can_settle(&self, attempt: &Attempt) -> bool {
        let last = attempt.presentations.last();
        attempt.ended.is_some()
            && attempt.is_right()
            && !attempt.is_at_standard()
            && last.is_some_and(|last| self.suffices(last))
    }

    /// A step of the adjustment under way failed: what comes next was not presented, or what was felt last was not what it
    /// should be. What was set so far stays, and the level before is felt again on request. Not if it is unknown what was
    /// felt, or whether it has stopped, as once its start was requested, nor before the first level was felt, nor if the device
    /// failed at the same level `max_attempts` times: the attempt then fails. Returns whether it goes on.
    pub(super) fn step_failed(&mut self, failure: Failure, detail: &str, at: Moment) -> bool {
        let Some(open) = self.history.open().filter(|_| self.adjusting().is_some()) else {
            return false;
        };
        let (trial, attempt) = (open.trial.trial, open.attempt.number);
        let most = self
            .protocol
            .design_of(open.trial.part.as_ref())
            .max_attempts;
        let again = !failure.counts() || open.attempt.repeated_steps(failure) + 1 < most;
        let unknown = matches!(self.phase, Phase::Ready { .. });
        if unknown || !again || !open.attempt.goes_on() {
            return false;
        }
        let failed = Event::StepFailed {
            trial,
            attempt,
            failure,
            detail: detail.to_owned(),
        };
        self.record(failed, at);
        self.phase = Phase::Stopped { since: at };
        true
    }

    /// After a stop: feels the level, or the standard, again. Not if a change was under way, or if it is unknown whether what
    /// was felt has stopped; the trial then begins again.
    pub(super) fn feel_level_again(&mut self, at: Moment) -> bool {
        let Some(open) = self.history.open() else {
            return false;
        };
        let attempt = open.attempt;
        let known = attempt.presentations.iter().all(|p| p.ended.is_some());
        if self.adjusting().is_none() || !known || attempt.interval().is_some() {
            return false;
        }
        let standard = attempt.is_at_standard();
        let Some(last) = attempt.models.last().cloned() else {
            return false;
        };
        if self.device_lost {
            // What was set waits for it.
            self.show_device_lost();
            return true;
        }
        self.feel_next(last, standard, at);
        self.load_interval(at);
        true
    }

    /// The level that was felt last is the answer. Other questions of the part follow.
    pub(super) fn settle(&mut self, by: Confirmed, at: Moment) {
        let set = self.history.open().and_then(|open| {
            let question = self.set_in(open.form())?.clone();
            let level = self.protocol.level_of(open.attempt.set_to()?)?;
            Some((open.form(), question, level))
        });
        let Some((form, question, level)) = set else {
            return self.notify("this level cannot be set; see `study verify`");
        };
        let answered = Event::Answered {
            form,
            question,
            answer: Answer::Number(level),
            channel: by.channel,
        };
        self.record(answered, at);
        self.open_trial_form(at);
    }

    /// What is shown of the adjustment under way; nothing of the level, but for an end of the ladder.
    pub(super) fn shown_adjustment(&self) -> Option<Adjusting> {
        let own = self.adjusting()?;
        let open = self.history.open()?;
        let part = self.part_of(open.trial)?;
        let mut asked = self.protocol.questions.iter();
        let asked = asked.find(|q| Some(&q.id) == part.asks.first())?;
        let level = open.attempt.set_to()?;
        Some(Adjusting {
            prompt: asked.prompt.clone(),
            words: own.words.clone(),
            can_lower: own.turned(level, Turn::Lower).is_some(),
            can_higher: own.turned(level, Turn::Higher).is_some(),
            has_standard: own.standard.is_some(),
            at_standard: open.attempt.is_at_standard(),
        })
    }
}
