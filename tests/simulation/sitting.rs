//! One process: a session from its first screen to its end or its death, with a check at every
//! turn of its loop.

use crate::clock::SimClock;
use crate::device::{LIMP_WITHIN, SimDevice};
use crate::disk::Death;
use crate::faults::{Moment, Trouble, When};
use crate::people::{Ledger, People};
use crate::setting::{Disks, LONGEST_PAUSE, Person};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::Rc;
use std::time::Duration;
use study::runner::saver::Saving;
use study::runner::{Operator, OperatorError};
use study_base::rng::Stream;
use study_base::text::QuestionId;
use study_plan::protocol::Answer;
use study_session::outcome::{Author, Channel, FormId};
use study_session::session::view::Mirror;
use study_session::session::{Input, Screen, View};

/// When the experimenter leaves a session that does not come to its end, and when it has hung.
const LEAVES: Duration = Duration::from_secs(20 * 60);
const HANGS: Duration = Duration::from_secs(40 * 60);

/// What a sitting knows of those before it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Before {
    /// What is answered.
    pub(crate) answered: BTreeSet<(FormId, QuestionId)>,
    /// Ratings that would be from memory.
    pub(crate) forgotten: BTreeSet<FormId>,
}

/// The world around one process: the scheduler.
pub(crate) struct Sitting<'a> {
    pub(crate) person: Person,
    pub(crate) disks: &'a Disks,
    pub(crate) ledger: &'a mut Ledger,
    pub(crate) people: People,
    pub(crate) device: SimDevice,
    pub(crate) clock: SimClock,
    pub(crate) death: Death,
    pub(crate) troubles: Vec<(When, Trouble)>,
    pub(crate) before: Before,
    /// What went wrong, once something has.
    pub(crate) wrong: Option<String>,
    state: State,
}

/// What the checks remember.
#[derive(Debug, Default)]
struct State {
    /// Whether the terminal is gone.
    hung_up: bool,
    /// Since when nothing is played or loaded.
    calm_since: Option<Duration>,
    /// When Stop arrived.
    stop_at: Option<Duration>,
    trials_saved: u32,
    /// When the experimenter next tries to leave.
    leaves_at: Duration,
    remarks: u32,
}

impl<'a> Sitting<'a> {
    pub(crate) fn new(
        (person, disks, ledger): (Person, &'a Disks, &'a mut Ledger),
        (clock, death, device): (SimClock, Death, SimDevice),
        people: People,
        troubles: Vec<(When, Trouble)>,
        before: Before,
    ) -> Self {
        Self {
            person,
            disks,
            ledger,
            people,
            device,
            clock,
            death,
            troubles,
            before,
            wrong: None,
            state: State {
                leaves_at: LEAVES,
                ..State::default()
            },
        }
    }

    /// Checks something; the first thing that is wrong ends the process.
    fn check(&mut self, found: Result<(), String>) {
        if let Err(wrong) = found {
            self.wrong = self.wrong.take().or(Some(wrong));
            self.death.comes();
        }
    }

    /// There is no force where there may be none.
    fn check_force(&mut self, view: &View) -> Result<(), String> {
        let now = self.clock.real();
        if let Some(wrong) = self.device.wrong() {
            return Err(wrong);
        }
        let has_force = self.device.has_force();
        let plays = matches!(view.screen, Screen::Loading { .. } | Screen::Playing { .. });
        self.state.calm_since = match (plays, self.state.calm_since) {
            (true, _) => None,
            (false, since) => since.or(Some(now)),
        };
        let late = |since: Duration| now >= since + LIMP_WITHIN;
        if has_force && self.state.calm_since.is_some_and(late) {
            return Err(format!("there is force on the screen {:?}", view.screen));
        }
        let stopped = self.state.stop_at.take_if(|at| late(*at)).is_some();
        match has_force && stopped {
            true => Err(format!("there is force after Stop: {:?}", view.screen)),
            false => Ok(()),
        }
    }

    /// Nothing is asked that is answered, and nothing about a memory.
    fn check_asked(&self, view: &View) -> Result<(), String> {
        let Screen::Form {
            form, questions, ..
        } = &view.screen
        else {
            return Ok(());
        };
        for question in questions.iter().map(|q| &q.id) {
            let known = (*form, question.clone());
            if self.before.answered.contains(&known) || view.given(*form, question).is_some() {
                return Err(format!("{question} of {form:?} is asked again"));
            }
        }
        match self.before.forgotten.contains(form) {
            true => Err(format!("{form:?} is asked from memory")),
            false => Ok(()),
        }
    }

    /// What is shown as saved is on the medium: on both, where both are shown as up to date.
    fn check_saved(&mut self, view: &View) -> Result<(), String> {
        let mut shown: BTreeSet<String> = self.people.told().into_iter().collect();
        if view.line.all_saved {
            let texts = view.correctable.iter().filter_map(|c| match &c.answer {
                Answer::Text(text) if !text.is_empty() => Some(text.clone()),
                _ => None,
            });
            shown.extend(texts);
        }
        shown.retain(|text| !self.ledger.told.contains(text));
        let trials = view.line.trials_saved;
        if shown.is_empty() && trials <= self.state.trials_saved {
            return Ok(());
        }
        let sides: &[usize] = match view.line.mirror {
            None | Some(Mirror::OnlyResults) => &[0],
            Some(Mirror::InStep) => &[0, 1],
            Some(Mirror::OnlyMirror) => &[1],
        };
        for side in sides {
            let journal = self.disks.journal_on_medium(*side, self.person.id);
            let is_missing = |text: &&String| !journal.contains(&format!("\"{text}\""));
            if let Some(text) = shown.iter().find(is_missing) {
                return Err(format!(
                    "{text} is shown as saved and is not on disk {side}"
                ));
            }
            let done = journal.matches("\"event\":\"trial_done\"").count();
            if done < trials as usize {
                return Err(format!(
                    "{trials} trials are shown as saved, {done} are on disk {side}"
                ));
            }
        }
        self.state.trials_saved = trials;
        self.ledger.told.extend(shown);
        Ok(())
    }

    /// When the next trouble comes.
    fn next_trouble(&self) -> Option<Duration> {
        let known = self.troubles.iter().filter_map(|(when, _)| match when {
            When::After(at) => Some(*at),
            When::During(..) => None,
        });
        known.min()
    }

    /// Lets happen what is due.
    fn make_trouble(&mut self, view: &View) {
        let now = self.clock.real();
        let moment = moment_of(&view.screen);
        for (when, _) in &mut self.troubles {
            if let When::During(of, after) = *when
                && Some(of) == moment
            {
                *when = When::After(now + after);
            }
        }
        let mut was_set = false;
        while let Some(at) = self
            .troubles
            .iter()
            .position(|(when, _)| is_due(*when, now))
        {
            let (_, trouble) = self.troubles.remove(at);
            match trouble {
                Trouble::Kill => return self.death.comes(),
                Trouble::HangUp => self.state.hung_up = true,
                // The device has not heard of this time yet.
                Trouble::Suspend(time) => {
                    // Who sets the clock back meanwhile hides it.
                    if !was_set {
                        self.forget(view, time);
                    }
                    if self.people.hide_suspensions() {
                        let time_ms = i64::try_from(time.as_millis()).unwrap();
                        self.clock.set(-time_ms);
                    }
                    return self.clock.suspend(time);
                }
                Trouble::Stall(time) => {
                    self.forget(view, time);
                    return self.clock.pass(time);
                }
                Trouble::SetClock(by_ms) => {
                    was_set = true;
                    self.clock.set(by_ms);
                }
                Trouble::Trip => self.device.trip(),
                Trouble::Hang(time) => self.device.hang(time),
                Trouble::LateTelemetry(time) => self.device.hold(time),
                Trouble::Stop => self.people.press_stop(now),
                Trouble::StopByKey => self.people.key(now, Input::Stop),
                Trouble::Pause => self.people.key(now, Input::Pause),
                Trouble::Quit => self.people.key(now, Input::Quit),
                Trouble::MarkBad => self.people.key(
                    now,
                    Input::MarkBad {
                        reason: "noise".to_owned(),
                    },
                ),
                Trouble::Remark => {
                    self.state.remarks += 1;
                    let remark = Input::Remark {
                        by: Author::Experimenter,
                        text: format!("remark {}", self.state.remarks),
                    };
                    self.people.key(now, remark);
                }
            }
        }
        if now >= self.state.leaves_at {
            self.state.leaves_at = now + Duration::from_secs(10);
            self.people.key(now, Input::Quit);
        }
        if now >= HANGS {
            self.check(Err(format!("the session hangs at {:?}", view.screen)));
        }
    }

    /// After a long standstill of the process or the computer nothing is asked about what was felt
    /// before.
    fn forget(&mut self, view: &View, time: Duration) {
        if let Screen::Form { form, .. } = &view.screen
            && matches!(form, FormId::Trial { .. })
            && time > LONGEST_PAUSE
            && view.correctable.iter().all(|c| c.form != *form)
        {
            self.before.forgotten.insert(*form);
        }
    }
}

impl Operator for Sitting<'_> {
    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        let gone = || Err(OperatorError("the terminal is gone".to_owned()));
        if self.death.is_here() {
            return gone();
        }
        let found = self.check_force(view).and_then(|()| self.check_asked(view));
        self.check(found);
        if !self.death.is_here() {
            self.make_trouble(view);
        }
        if self.death.is_here() || self.state.hung_up {
            return gone();
        }
        let now = self.clock.real();
        self.people.look(view, now, self.ledger);
        let found = self.check_saved(view);
        self.check(found);
        if self.death.is_here() {
            return gone();
        }
        let acts = self.people.next();
        let next = self.next_trouble().map_or(acts, |at| at.min(acts));
        self.clock.pass(timeout.min(next.saturating_sub(now)));
        let inputs = self.people.take(view, self.clock.real());
        self.state.stop_at = self.state.stop_at.or(self.people.stop());
        Ok(inputs)
    }

    fn channel(&self) -> Option<Channel> {
        Some(self.people.channel())
    }
}

fn is_due(when: When, now: Duration) -> bool {
    matches!(when, When::After(at) if at <= now)
}

fn moment_of(screen: &Screen) -> Option<Moment> {
    Some(match screen {
        Screen::Loading { .. } => Moment::Loading,
        Screen::Playing { .. } => Moment::Playing,
        Screen::Stopping => Moment::Stopping,
        Screen::Stopped { .. } => Moment::Stopped,
        Screen::Form { .. } => Moment::Form,
        Screen::Saving => Moment::Saving,
        _ => return None,
    })
}

/// The saver's turns: a disk that takes a while for some of them, `slow` of all.
pub(crate) fn turns(clock: SimClock, death: Death, chance: Stream, slow: f64) -> Saving {
    let state = RefCell::new((chance, Duration::ZERO));
    Saving::Turns(Rc::new(move |waiting: usize| {
        let mut state = state.borrow_mut();
        let (chance, busy_until) = &mut *state;
        let now = clock.real();
        // Of a dead process nothing is written, and its end need not be waited for.
        if slow == 0.0 || death.is_here() {
            return waiting;
        }
        if now < *busy_until {
            return 0;
        }
        if chance.unit() < slow {
            let takes_ms = match chance.below(40) {
                0 => 7000,
                _ => 1 + chance.below(300),
            };
            *busy_until = now + Duration::from_millis(takes_ms);
        }
        1 + usize::try_from(chance.below(waiting as u64)).unwrap()
    }))
}
