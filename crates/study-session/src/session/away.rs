//! Time between feeling and answering in which nobody could answer.
//!
//! An answer has to be about what was felt, not about what is remembered of it. The program
//! may be left, paused, or wait for the device or the disk; the computer may be suspended.
//! After a longer pause than the protocol allows the trial is felt again, and so it is if the pause
//! came between two of its intervals. Once a question of it is answered it is not: that answer was
//! in time and must not be lost. The others then go on, and the trial records its pause.
//!
//! A questionnaire between the trials is about a condition, a block or a part, which is not felt
//! again for it. Its answers are kept; the event before them and the row say how long the pause was, and
//! whether it was too long.

use super::phase::{CLOCK_STEP_S, Phase};
use super::{Effect, Session};
use crate::outcome::{Event, Failure, FormId, Moment};
use study_plan::protocol::phrases::Phrase;

/// Least pause that a trial records, s.
const RECORDED_S: f64 = 1.0;

impl Session {
    /// Notes a pause after what was felt, s. If it became too long, the trial comes again.
    pub(super) fn was_away(&mut self, seconds: f64, at: Moment) {
        if self.history.open().is_none() {
            self.apart_s += seconds.max(0.0);
        }
        if !self.is_felt() {
            return;
        }
        self.away_s += seconds.max(0.0);
        let waits = match &self.phase {
            Phase::Stopped { .. } => true,
            Phase::Form(form) => matches!(form.id, FormId::Trial { .. }),
            _ => false,
        };
        if waits && self.comes_too_late() {
            self.feel_again(at);
            self.proceed(at);
        }
    }

    /// Notes the pause of a session that is resumed: since the last playback or answer of the
    /// trial under way, by the wall clock. Where that went back, nobody knows how long it was.
    pub(super) fn came_back(&mut self, at: Moment) {
        let last = self.history.open().and_then(|open| {
            let ended = open.attempt.presentations.iter().filter_map(|p| p.ended);
            let answers = self.history.answers.iter();
            let answered = answers
                .filter(|given| given.form == open.form())
                .filter_map(|given| given.answered_at);
            ended.map(|(at, _)| at).chain(answered).last()
        });
        self.away_s = since(last, at);
        self.apart_s = since(self.answered_before(), at);
    }

    /// Records the pauses before an answer to a questionnaire between the trials, with which it is kept and marked.
    pub(super) fn note_pause(&mut self, form: FormId, at: Moment) {
        let FormId::After { trial, attempt } = form else {
            return;
        };
        if self.apart_s < RECORDED_S {
            return;
        }
        let paused_s = std::mem::take(&mut self.apart_s);
        let before = self.history.delay(trial, attempt);
        let before_s = before.map_or(0.0, |delay| delay.paused_s.unwrap_or(f64::INFINITY));
        let delayed = Event::FormDelayed {
            trial,
            attempt,
            paused_s: Some(paused_s).filter(|s| s.is_finite()),
            late: before_s + paused_s > self.protocol.session.longest_pause_s,
        };
        self.record(delayed, at);
    }

    /// Whether the trial under way was felt to its end.
    fn is_felt(&self) -> bool {
        let open = self.history.open();
        open.is_some_and(|open| open.attempt.ended.is_some())
    }

    /// Whether the first answer to the trial under way would be about a memory.
    pub(super) fn comes_too_late(&self) -> bool {
        let open = self.history.open();
        let unanswered = open.is_some_and(|open| !self.history.any_answer(open.form()));
        unanswered && self.is_felt() && self.is_forgotten(0.0)
    }

    /// Whether an answer would come too long after what was felt, after `more_s` in addition.
    pub(super) fn is_forgotten(&self, more_s: f64) -> bool {
        self.away_s + more_s > self.protocol.session.longest_pause_s
    }

    /// The pause before the answer, s, if there was one.
    pub(super) fn paused_s(&self) -> Option<f64> {
        Some(self.away_s).filter(|s| *s >= RECORDED_S && s.is_finite())
    }

    /// The attempt under way does not count: its trial comes next.
    pub(super) fn feel_again(&mut self, at: Moment) {
        let detail = match self.away_s.is_finite() {
            true => format!("felt again after a pause of {:.0} s", self.away_s),
            false => "felt again: the clock went back during the pause".to_owned(),
        };
        self.fail(Failure::Interrupted, &detail, at);
        self.away_s = 0.0;
        self.notify_once_more();
    }

    fn notify_once_more(&mut self) {
        let words = self.words.get(Phrase::OnceMore).to_owned();
        self.notify(words);
    }

    /// Has all intervals felt again if the next one comes too long after the one before, which
    /// ended at `ended`; returns whether it does. A person who changes samples takes their time.
    pub(super) fn are_apart(&mut self, ended: Moment, at: Moment) -> bool {
        let Some(open) = self.history.open() else {
            return false;
        };
        // The first interval of a repetition follows nothing.
        let follows = open.attempt.interval().is_some_and(|n| n > 1);
        let gap_s = self.part_of(open.trial).map_or(0.0, |part| part.gap_s);
        if !follows || self.by_hand(open.trial) {
            return false;
        }
        // A computer that was suspended counts the time by its wall clock only.
        let wall_s = (at.wall - ended.wall).as_seconds_f64();
        let pause_s = at.seconds_since(&ended).max(wall_s) - gap_s;
        if pause_s <= self.protocol.session.longest_pause_s {
            return false;
        }
        self.away_s = pause_s;
        self.out.push(Effect::Limp);
        self.feel_again(at);
        self.proceed(at);
        true
    }

    /// The program did not run for so long, s, by the clock that also measures pauses: the process
    /// was stopped, or the computer suspended where that clock goes on.
    pub(super) fn did_not_run(&mut self, seconds: f64, at: Moment) {
        self.stood_still(seconds, at);
        // A pause, or a stopped trial, has this time in its own.
        let counts = self.in_form() || self.history.open().is_none();
        if counts && self.overlaid_since.is_none() {
            self.was_away(seconds, at);
        }
    }

    /// The computer stood still for so long, s. What a device did meanwhile, and for how long
    /// it was felt, is not known.
    pub(super) fn stood_still(&mut self, seconds: f64, at: Moment) {
        let pause = match self.phase {
            Phase::Ready { .. } | Phase::Playing { .. } => false,
            Phase::Stopping { pause, .. } => pause,
            _ => return,
        };
        self.out.push(Effect::Limp);
        let what = format!("the computer stood still for {seconds:.1} s");
        self.fail(Failure::Interrupted, &what, at);
        self.proceed(at);
        self.notify_once_more();
        if pause {
            self.start_pause(at);
        }
    }
}

/// The time since a moment of another process, s, by the wall clock; infinite if that went back.
fn since(last: Option<Moment>, at: Moment) -> f64 {
    match last.map(|last| (at.wall - last.wall).as_seconds_f64()) {
        None => 0.0,
        Some(s) if s < -CLOCK_STEP_S => f64::INFINITY,
        Some(s) => s.max(0.0),
    }
}
