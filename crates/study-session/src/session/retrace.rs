//! What was on the screen, from the journal of a session.
//!
//! [`pages`] lets a [`Session`] follow the events of its journal in place of inputs. What a
//! session records by itself, such as the start of a break, must be the next event; where
//! it is not, as after a crash or in a damaged journal, the journal is right. Nothing is
//! saved and no device is asked.
//!
//! A journal has what was done and not what was looked at. A page that was left without a
//! trace is not shown again: one to which somebody went back and changed nothing, or in a form that was resumed, the pages
//! between two texts at which the program ended, the rating after a stop until it is answered, the
//! request to mount a sample, a fault of device or disk between trials.

mod looks;

use super::forms::step_of;
use super::phase::Phase;
use super::saving::SaveState;
use super::trial::PLAYED_AGAIN;
use super::view::MessageKind;
use super::{ClaimFacts, Config, Effect, Ending, Screen, Session, View};
use crate::outcome::fold::History;
use crate::outcome::{Entry, Event, Failure, FormId, Moment, STEP_BACK, Start, Verdict};
use looks::{is_same, passes, reports_samples, timeless};
use std::sync::Arc;
use study_base::text::QuestionId;
use study_plan::protocol::{Protocol, Question};

/// Most texts and automatic events between two events of a journal.
const MOST_BETWEEN: usize = 100;

/// A page that was on the screen.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown {
    /// Number of events before it.
    pub after: usize,
    /// Trial and attempt to which it belongs, if it belongs to one.
    pub of: Option<(u32, u32)>,
    /// What was shown, at the time when all waiting is over.
    pub view: View,
}

/// The pages of a session, in order; none if its journal does not begin with its start.
///
/// `protocol` gives the version in force from the start or a resumption on.
pub fn pages(protocol: &dyn Fn(&Entry) -> Arc<Protocol>, entries: &[Entry]) -> Vec<Shown> {
    let Some(first) = entries.first() else {
        return Vec::new();
    };
    let Event::SessionStarted(start) = &first.event else {
        return Vec::new();
    };
    let mut retrace = Retrace {
        protocol,
        entries,
        next: 0,
        session: blank(protocol(first), first.at),
        runs: true,
        answered: None,
        shown: Vec::new(),
    };
    retrace.begin(start, first.at);
    while let Some(entry) = entries.get(retrace.next) {
        let before = retrace.next;
        retrace.follow(entry);
        if retrace.next == before {
            retrace.take();
        }
    }
    if let Some(last) = entries.last() {
        retrace.leave(last.at);
    }
    retrace.shown
}

fn blank(protocol: Arc<Protocol>, at: Moment) -> Session {
    Session::new(protocol, None, Config::default(), at).0
}

/// A session that follows its journal.
struct Retrace<'a> {
    protocol: &'a dyn Fn(&Entry) -> Arc<Protocol>,
    entries: &'a [Entry],
    /// Number of events that were followed.
    next: usize,
    session: Session,
    /// Whether the program runs at this point of the journal.
    runs: bool,
    /// The trial that was answered last, and its attempt.
    answered: Option<(u32, u32)>,
    shown: Vec<Shown>,
}

impl Retrace<'_> {
    fn begin(&mut self, start: &Start, at: Moment) {
        self.take();
        let session = &mut self.session;
        session.participant = start.participant.to_string();
        session.operator.clone_from(&start.operator);
        session.opened = Some(at);
        session.take_part(&start.assigned);
        session.claim = Some(ClaimFacts {
            session: start.session,
            seat: start.seat,
            device_kind: start.device_kind,
            device_id: start.device_id.clone(),
            device_telemetry: reports_samples(start.device_kind, self.entries),
            self_weighed: None,
        });
        session.phase = Phase::Saving;
    }

    /// Follows the next event, and those that belong to the same step.
    fn follow(&mut self, entry: &Entry) {
        if let Some(reopened) = self.reopened() {
            return self.reopen(reopened);
        }
        let at = entry.at;
        match &entry.event {
            // They change nothing on the screen.
            Event::SessionStarted(_)
            | Event::Reopened { .. }
            | Event::SelfWeighed(_)
            | Event::TelemetryLost { .. }
            | Event::NumbersSent { .. }
            | Event::ClockStepped { .. }
            | Event::Remark { .. }
            | Event::Revealed { .. }
            | Event::TrialClosed { .. }
            | Event::PointLeftOut { .. } => self.take(),
            // Beside what plays.
            Event::MediaShown { .. } => {
                self.show(at);
                self.take();
            }
            Event::Adjusted { .. } => {
                // The steps on the page are those from the level before.
                self.show(at);
                self.take();
                // Else it is stopped first.
                if matches!(self.session.phase, Phase::Stopped { .. }) {
                    self.automatic(|session| session.load_interval(at));
                }
            }
            Event::StepFailed { .. } => {
                self.show(at);
                self.take();
                self.session.phase = Phase::Stopped { since: at };
            }
            // A level is confirmed where it is felt, or on the page after a stop.
            Event::Answered { form, question, .. }
                if self.session.set_in(*form) == Some(question) =>
            {
                if !self.is_same_step(at) {
                    self.show(at);
                }
                self.take_and_go_on();
            }
            Event::Corrected { form, reason, .. }
                if reason != STEP_BACK || !self.is_open(*form) =>
            {
                self.take();
            }
            Event::Answered { form, question, .. } | Event::Corrected { form, question, .. } => {
                self.answers(*form, question, at);
            }
            // From outside, unless the session ended itself in the same step.
            Event::StateSet { .. } | Event::IdCorrected { .. } => {
                if self.is_same_step(at) {
                    self.take_and_go_on();
                } else {
                    self.leave(at);
                    self.take();
                }
            }
            Event::Interrupted { .. } => {
                if !self.is_same_step(at) {
                    self.lead(false, at);
                }
                self.take();
                // The page that says so.
                self.session.phase = Phase::Over(Ending::Interrupted);
                self.show(at);
                (self.runs, self.session.paused) = (false, None);
            }
            Event::Consented { accepted, .. } => {
                self.lead(true, at);
                let consent = self.session.protocol.consent.as_ref();
                if *accepted && consent.is_some_and(|consent| consent.initials) {
                    self.session.ask_initials(at);
                    self.show(at);
                }
                self.take_and_go_on();
            }
            Event::InstructionsRead
            | Event::Debriefed
            | Event::BreakStarted { .. }
            | Event::TrackEnded { .. }
            | Event::PracticeEnded { .. }
            | Event::Finished => {
                if self.lead(true, at) {
                    self.take_and_go_on();
                }
            }
            Event::FormDelayed { .. } => {
                if self.lead(true, at) {
                    self.take();
                }
            }
            Event::BreakEnded { .. } => {
                self.lead(false, at);
                self.take_and_go_on();
            }
            Event::Paused => {
                if !self.is_same_step(at) {
                    self.lead(false, at);
                } else if matches!(self.session.phase, Phase::Saving) {
                    // The page under the pause was never seen.
                    self.automatic(|session| session.proceed(at));
                }
                self.take();
                self.session.paused = Some(at);
            }
            Event::Unpaused { .. } => {
                self.show(at);
                self.take();
                self.session.paused = None;
            }
            Event::AttemptStarted { .. } => self.attempt_started(at),
            Event::PlaybackStarted { .. } => {
                self.show(at);
                self.take();
                self.session.phase = Phase::Playing {
                    since: at,
                    strokes: 0,
                    telemetry: None,
                };
            }
            Event::PlaybackEnded { rendering, .. } => {
                self.show(at);
                let wrong = rendering.as_ref().map(|found| found.verdict) == Some(Verdict::Fault);
                self.take_and_go_on();
                self.session.away_s = 0.0;
                if !wrong {
                    self.automatic(|session| session.after_playback(at));
                }
            }
            Event::Replayed { .. } => {
                self.show(at);
                self.take();
                self.automatic(|session| session.load_interval(at));
            }
            Event::AttemptFailed {
                failure, detail, ..
            } => self.failed(*failure, detail, at),
            Event::TrialDone { trial, attempt, .. } => {
                if self.is_same_step(at) || self.lead(true, at) {
                    self.take_and_go_on();
                    self.session.feedback = self.session.told(*trial);
                }
                self.answered = Some((*trial, *attempt));
            }
        }
    }

    /// Adds the next event to the history.
    fn take(&mut self) {
        if let Some(entry) = self.entries.get(self.next) {
            self.session.history.apply(&entry.event, entry.at);
            self.next += 1;
        }
    }

    /// The same; what comes next follows from the history.
    fn take_and_go_on(&mut self) {
        self.take();
        self.session.phase = Phase::Saving;
    }

    /// Whether the next event was recorded in one step with the one before it.
    fn is_same_step(&self, at: Moment) -> bool {
        let before = self.next.checked_sub(1);
        before.is_some_and(|before| self.entries[before].at == at)
    }

    /// Shows the page on the screen and goes on as far as no event is needed: from what is
    /// saved to the next page and, if `texts`, past pages to read. `false` if the session
    /// recorded the next event meanwhile.
    fn lead(&mut self, texts: bool, at: Moment) -> bool {
        let due = self.next;
        for _ in 0..MOST_BETWEEN {
            self.show(at);
            let agrees = match &self.session.phase {
                Phase::Saving => self.automatic(|session| session.proceed(at)),
                Phase::Message(_) | Phase::Feedback(_) if texts => {
                    self.automatic(|session| session.advance(at))
                }
                _ => return true,
            };
            if self.next > due {
                return false;
            }
            if !agrees {
                self.show(at);
                return true;
            }
        }
        true
    }

    /// Lets the session do something by itself. What it records must be the next events of
    /// the journal; else the history is that of the journal again, and `false` is returned.
    fn automatic(&mut self, act: impl FnOnce(&mut Session)) -> bool {
        act(&mut self.session);
        self.session.saves = SaveState::default();
        for effect in std::mem::take(&mut self.session.out) {
            let Effect::Record(event) = effect else {
                continue;
            };
            let due = self.entries.get(self.next);
            if due.is_none_or(|entry| entry.event != event) {
                self.session.history = History::of(&self.entries[..self.next]);
                return false;
            }
            self.next += 1;
        }
        true
    }

    fn attempt_started(&mut self, at: Moment) {
        let again = matches!(self.session.phase, Phase::Stopped { .. }) && self.is_same_step(at);
        if !again {
            self.lead(true, at);
            if !matches!(self.session.phase, Phase::Reference { .. }) {
                self.session.phase = Phase::Reference { since: at };
                self.show(at);
            }
        }
        self.take();
        self.session.away_s = 0.0;
        self.automatic(|session| session.load_interval(at));
    }

    fn failed(&mut self, failure: Failure, detail: &str, at: Moment) {
        let again = failure == Failure::Stopped && detail == PLAYED_AGAIN;
        let marked = failure == Failure::MarkedBad;
        if !self.is_same_step(at) {
            // The last trial can be marked from the page before the next one.
            let between = marked && self.session.history.open().is_none();
            self.lead(between, at);
            if again && !matches!(self.session.phase, Phase::Stopped { .. }) {
                self.session.phase = Phase::Stopped { since: at };
                self.show(at);
            }
        }
        self.take();
        let next = self.entries.get(self.next);
        let goes_on = next.is_some_and(|next| {
            next.at == at && matches!(next.event, Event::AttemptStarted { .. })
        });
        let rests = marked && matches!(self.session.phase, Phase::Break { .. });
        if !(rests || again && goes_on) {
            self.session.phase = Phase::Saving;
        }
    }

    /// The answers to a page, which were given in one step.
    fn answers(&mut self, form: FormId, question: &QuestionId, at: Moment) {
        self.lead(true, at);
        if !self.is_open(form) {
            self.automatic(|session| {
                session.open_form(form, at);
            });
        }
        self.turn_to(question, at);
        self.show(at);
        let page = self.page();
        let mut first = true;
        while let Some(entry) = self.entries.get(self.next) {
            let given = match &entry.event {
                Event::Answered {
                    form: f,
                    question: q,
                    ..
                } if *f == form => q,
                Event::Corrected {
                    form: f,
                    question: q,
                    reason,
                    ..
                } if *f == form && reason == STEP_BACK => q,
                _ => break,
            };
            if !first && (entry.at != at || !page.contains(given)) {
                break;
            }
            first = false;
            self.take();
        }
        self.turn_page(form);
    }

    /// Whether a form is on the screen.
    fn is_open(&self, form: FormId) -> bool {
        matches!(&self.session.phase, Phase::Form(open) if open.id == form)
    }

    /// The questions on the screen.
    fn page(&self) -> Vec<QuestionId> {
        match &self.session.phase {
            Phase::Form(open) => {
                let page = open.pages.get(open.at).into_iter().flatten();
                page.map(|q| q.id.clone()).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Turns to the page with a question, back or past pages whose answers stayed.
    fn turn_to(&mut self, question: &QuestionId, at: Moment) {
        loop {
            let Phase::Form(open) = &mut self.session.phase else {
                return;
            };
            let has = |page: &Vec<Question>| page.iter().any(|q| q.id == *question);
            match open.pages.iter().position(has) {
                Some(page) if page < open.at => open.at -= 1,
                Some(page) if page > open.at => open.at += 1,
                _ => return,
            }
            self.show(at);
        }
    }

    fn turn_page(&mut self, form: FormId) {
        if let Phase::Form(open) = &mut self.session.phase {
            open.at += 1;
            if open.at < open.pages.len() {
                return;
            }
        }
        self.session.passed.extend(step_of(form));
        self.session.phase = Phase::Saving;
    }

    /// The index of the event that resumes the session, if it belongs to the next step.
    fn reopened(&self) -> Option<usize> {
        let rest = &self.entries[self.next..];
        let fails = |entry: &&Entry| {
            matches!(
                entry.event,
                Event::AttemptFailed { .. }
                    | Event::TrialClosed { .. }
                    | Event::PointLeftOut { .. }
            )
        };
        let before = rest.iter().take_while(fails).count();
        let reopened = rest.get(before)?;
        let same = rest[..before].iter().all(|entry| entry.at == reopened.at);
        let resumes = matches!(reopened.event, Event::Reopened { .. });
        (same && resumes).then_some(self.next + before)
    }

    /// Another process continues the session.
    fn reopen(&mut self, index: usize) {
        let entry = &self.entries[index];
        self.leave(entry.at);
        let mut session = blank((self.protocol)(entry), entry.at);
        session.history = std::mem::take(&mut self.session.history);
        session.claim = self.session.claim.take();
        session.participant.clone_from(&self.session.participant);
        session.opened = Some(entry.at);
        let assigned = session.history.start().map(|start| start.assigned.clone());
        session.take_part(&assigned.unwrap_or_default());
        self.session = session;
        self.runs = true;
        if let Event::Reopened {
            operator,
            gap_s,
            choice,
            ..
        } = &entry.event
        {
            self.session.operator.clone_from(operator);
            if choice.is_some() {
                self.session.phase = Phase::ResumeChoice { gap_s: *gap_s };
                self.show(entry.at);
            }
        }
        while self.next <= index {
            self.take();
        }
        self.session.phase = Phase::Saving;
    }

    /// The program ends here: its last page.
    fn leave(&mut self, at: Moment) {
        if self.runs {
            self.lead(false, at);
        }
        (self.runs, self.session.paused) = (false, None);
    }

    /// Adds the page on the screen, unless it passes or is there already.
    fn show(&mut self, at: Moment) {
        if !self.runs {
            return;
        }
        // Later, what was felt may be too long ago for an answer.
        let at = match &self.session.phase {
            Phase::Stopped { since } => *since,
            _ => at,
        };
        let view = timeless(self.session.view(at));
        if passes(&view.screen) {
            return;
        }
        let of = self.trial_of(&view.screen);
        let last = self.shown.last();
        if last.is_some_and(|last| last.of == of && is_same(&last.view, &view)) {
            return;
        }
        let after = self.next;
        self.shown.push(Shown { after, of, view });
    }

    /// The trial and attempt of a page.
    fn trial_of(&self, screen: &Screen) -> Option<(u32, u32)> {
        let history = &self.session.history;
        let open = || {
            let open = history.open()?;
            Some((open.trial.trial, open.attempt.number))
        };
        let next = || {
            let next = history.next_trial()?.trial;
            Some((next, history.attempts(next) + 1))
        };
        match screen {
            Screen::Form {
                form: FormId::Trial { trial, attempt } | FormId::After { trial, attempt },
                ..
            } => Some((*trial, *attempt)),
            Screen::Reference { .. } => next(),
            Screen::Loading { .. } | Screen::Playing { .. } | Screen::Stopped { .. } => open(),
            Screen::Paused { .. } => match &self.session.phase {
                Phase::Reference { .. } => next(),
                _ => open(),
            },
            Screen::Message {
                kind: MessageKind::Feedback,
                ..
            } => self.answered,
            _ => None,
        }
    }
}
