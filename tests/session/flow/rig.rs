//! A device and a store around a session, and what must hold at every step.

use super::studies::{MODELS, PRACTICE};
use chrono::{DateTime, FixedOffset, TimeDelta};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use study_base::text::{ParticipantId, QuestionId};
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::*;
use study_session::outcome::{Entry, Event, FormId, Moment, Playback, SelfWeighed};
use study_session::session::{Claim, Config, Effect, Ending, Input, Screen, Session, View};

/// What the device of the tests does when it is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DeviceMood {
    /// Confirms everything at once.
    Willing,
    /// Says nothing by itself.
    Silent,
}

/// What the store of the tests does with an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StoreMood {
    /// On disk at once.
    Prompt,
    /// Keeps it and says nothing.
    Slow,
    /// Fails each time.
    Broken,
}

pub(crate) struct Rig {
    pub(crate) session: Session,
    pub(crate) now: Moment,
    /// What was sent to the store, after what was there before.
    pub(crate) journal: Vec<Entry>,
    /// Entries that an earlier process wrote.
    pub(crate) before: usize,
    /// Of this process, on disk.
    pub(crate) on_disk: u64,
    pub(crate) device: DeviceMood,
    pub(crate) store: StoreMood,
    pub(crate) seat: Seat,
    pub(crate) telemetry: bool,
    pub(crate) self_weighed: Option<SelfWeighed>,
    pub(crate) playback: Playback,
    pub(crate) effects: Vec<Effect>,
    pub(crate) ending: Option<Ending>,
    /// Whether the journal is damaged, so that a trial may be asked about again.
    pub(crate) lenient: bool,
    /// Whether every view is checked, which takes most of the time.
    pub(crate) watched: bool,
    pub(crate) screens: Vec<&'static str>,
    /// The participant's pages, if they are wanted.
    pub(crate) pages: Option<Vec<String>>,
    protocol: Arc<Protocol>,
    loads: u32,
    loaded: bool,
    steps: u32,
}

pub(crate) fn start() -> Moment {
    Moment {
        wall: DateTime::<FixedOffset>::parse_from_rfc3339("2026-03-02T09:00:00+01:00")
            .expect("a date"),
        mono_ns: 1_000_000_000,
    }
}

impl Rig {
    pub(crate) fn new(protocol: Protocol) -> Self {
        Self::with_config(protocol, Config::default(), Vec::new(), start())
    }

    /// Comes back after so many seconds to what is in a journal.
    pub(crate) fn back(protocol: Protocol, journal: Vec<Entry>, after_s: f64) -> Self {
        let last = journal.last().map_or(start().wall, |e| e.at.wall);
        let now = Moment {
            wall: last + TimeDelta::milliseconds((after_s * 1e3) as i64),
            mono_ns: 5_000_000_000,
        };
        Self::with_config(protocol, Config::default(), journal, now)
    }

    pub(crate) fn with_config(
        protocol: Protocol,
        config: Config,
        journal: Vec<Entry>,
        now: Moment,
    ) -> Self {
        let protocol = Arc::new(protocol);
        let (session, effects) = Session::new(protocol.clone(), None, config, now);
        let mut rig = Self {
            session,
            now,
            before: journal.len(),
            journal,
            on_disk: 0,
            device: DeviceMood::Willing,
            store: StoreMood::Prompt,
            seat: Seat::Row(1),
            telemetry: true,
            self_weighed: None,
            playback: Playback {
                exploration_s: 3.0,
                strokes: 5,
                ..Playback::default()
            },
            effects: Vec::new(),
            ending: None,
            lenient: false,
            watched: true,
            screens: Vec::new(),
            pages: None,
            protocol,
            loads: 0,
            loaded: false,
            steps: 0,
        };
        for answer in rig.carry_out(effects) {
            rig.send(answer);
        }
        rig
    }

    pub(crate) fn view(&self) -> View {
        self.session.view(self.now)
    }

    pub(crate) fn wait(&mut self, seconds: f64) -> &mut Self {
        self.now.mono_ns += (seconds * 1e9) as u64;
        self.now.wall += TimeDelta::nanoseconds((seconds * 1e9) as i64);
        self.send(Input::Tick)
    }

    /// Gives an input and plays device and store until they have nothing to say.
    pub(crate) fn send(&mut self, input: Input) -> &mut Self {
        let mut inbox = VecDeque::from([input]);
        while let Some(input) = inbox.pop_front() {
            match &input {
                Input::DeviceLoaded | Input::DeviceMount(_) => self.loaded = self.loads > 0,
                Input::Saved { count } => self.on_disk = *count,
                _ => {}
            }
            let effects = self.session.handle(input, self.now);
            inbox.extend(self.carry_out(effects));
        }
        self
    }

    /// Types an id, if the first screen asks for one.
    pub(crate) fn identify(&mut self) -> &mut Self {
        self.send(Input::Identify {
            participant: "P01".to_owned(),
            operator: "lw".to_owned(),
        })
    }

    fn claim(&self, participant: ParticipantId) -> Claim {
        Claim {
            seat: self.seat,
            device_telemetry: self.telemetry,
            self_weighed: self.self_weighed.clone(),
            ..claim(&self.protocol, participant, self.journal.clone())
        }
    }

    /// Does what the session wants; says what device and store answer.
    fn carry_out(&mut self, effects: Vec<Effect>) -> Vec<Input> {
        let mut answers = Vec::new();
        let mut recorded = false;
        for effect in effects {
            assert!(
                self.ending.is_none() || effect == Effect::Limp,
                "{effect:?}"
            );
            match &effect {
                Effect::Claim { participant, .. } => {
                    answers.push(Input::Claimed(Box::new(self.claim(participant.clone()))));
                }
                Effect::Record(event) => {
                    self.check_event(event);
                    self.journal.push(Entry {
                        seq: self.journal.len() as u64,
                        at: self.now,
                        event: event.clone(),
                    });
                    recorded = true;
                }
                Effect::Load { trial, attempt, .. } => {
                    let asked = matches!(
                        self.journal.last().map(|e| &e.event),
                        Some(
                            Event::AttemptStarted { trial: t, attempt: a, .. }
                            | Event::PlaybackEnded { trial: t, attempt: a, .. }
                            | Event::Replayed { trial: t, attempt: a }
                            | Event::Adjusted { trial: t, attempt: a, .. }
                        ) if t == trial && a == attempt
                    );
                    assert!(asked, "a load that is not in the journal");
                    self.loads += 1;
                    self.loaded = false;
                    if self.device == DeviceMood::Willing {
                        answers.push(Input::DeviceLoaded);
                    }
                }
                Effect::Start => {
                    assert!(self.loaded, "started what is not loaded");
                    if self.device == DeviceMood::Willing {
                        answers.push(Input::DeviceStarted);
                        answers.push(Input::DeviceProgress {
                            strokes: self.playback.strokes,
                        });
                    }
                }
                Effect::Stop | Effect::Fade => {
                    self.loaded = false;
                    if self.device == DeviceMood::Willing {
                        answers.push(Input::DeviceStopped(self.playback));
                    }
                }
                Effect::Limp => {
                    self.loads = 0;
                    self.loaded = false;
                }
                Effect::KeepConsent(_) => assert!(!recorded, "the copy comes before its event"),
                Effect::RetrySave => recorded = true,
                Effect::End(ending) => self.ending = Some(ending.clone()),
            }
            self.effects.push(effect);
        }
        self.check_view();
        if recorded {
            match self.store {
                StoreMood::Prompt => answers.push(self.all_on_disk()),
                StoreMood::Slow => {}
                StoreMood::Broken => answers.push(Input::SaveFailed("disk full".to_owned())),
            }
        }
        answers
    }

    /// What a store says once it has everything.
    pub(crate) fn all_on_disk(&self) -> Input {
        Input::Saved {
            count: (self.journal.len() - self.before) as u64,
        }
    }

    /// A rating is possible only for a playback that was confirmed; nothing is
    /// asked twice; a trial is closed once.
    fn check_event(&self, event: &Event) {
        if self.lenient {
            return;
        }
        match event {
            Event::Answered { form, question, .. } => {
                assert!(
                    self.answer(*form, question).is_none(),
                    "{question} is asked twice at {form:?}"
                );
                if let FormId::Trial { trial, attempt } = form {
                    assert!(self.ended(*trial, *attempt), "rated without a playback");
                }
            }
            Event::TrialDone { trial, attempt, .. } => {
                assert!(self.ended(*trial, *attempt), "done without a playback");
                assert!(!self.closed().contains_key(trial), "done twice");
            }
            Event::TrialClosed { trial, .. } => {
                assert!(!self.closed().contains_key(trial), "closed twice");
            }
            Event::SessionStarted(_) => assert!(self.journal.is_empty()),
            _ => {}
        }
    }

    fn check_view(&mut self) {
        if let Some(pages) = &mut self.pages {
            super::retraced::record(pages, &self.session.view(self.now));
        }
        if !self.watched {
            return;
        }
        let view = self.view();
        let shown = format!("{view:?}");
        for word in MODELS.iter().chain([&PRACTICE, &"0.918273", &".toml"]) {
            assert!(!shown.contains(word), "{word} is in {shown}");
        }
        let sent = (self.journal.len() - self.before) as u64;
        assert_eq!(view.line.all_saved, self.on_disk >= sent);
        assert!(view.line.trials_saved <= view.line.trials_answered);
        if let Screen::Form {
            form: FormId::Trial { trial, attempt },
            ..
        } = view.screen
        {
            assert!(
                self.lenient || self.ended(trial, attempt),
                "a form without a playback"
            );
        }
        let name = name(&view.screen);
        if self.screens.last() != Some(&name) {
            self.screens.push(name);
        }
    }

    fn ended(&self, trial: u32, attempt: u32) -> bool {
        self.journal.iter().any(|e| {
            matches!(e.event, Event::PlaybackEnded { trial: t, attempt: a, .. }
                if t == trial && a == attempt)
        })
    }

    pub(crate) fn answer(&self, form: FormId, question: &QuestionId) -> Option<Answer> {
        self.journal.iter().find_map(|e| match &e.event {
            Event::Answered {
                form: p,
                question: q,
                answer,
                ..
            } if *p == form && q == question => Some(answer.clone()),
            _ => None,
        })
    }

    /// Trials that are closed by the journal: `Some(attempt)` if rated.
    pub(crate) fn closed(&self) -> BTreeMap<u32, Option<u32>> {
        let mut closed = BTreeMap::new();
        for entry in &self.journal {
            match &entry.event {
                Event::TrialDone { trial, attempt, .. } => {
                    closed.insert(*trial, Some(*attempt));
                }
                Event::TrialClosed { trial, .. } => {
                    closed.insert(*trial, None);
                }
                Event::AttemptFailed { trial, .. } => {
                    closed.remove(trial);
                }
                Event::Reopened {
                    choice: Some(study_session::outcome::Choice::RestartBlock),
                    queue,
                    ..
                } => closed.retain(|trial, _| !queue.contains(trial)),
                _ => {}
            }
        }
        closed
    }

    pub(crate) fn events(&self) -> impl Iterator<Item = &Event> {
        self.journal.iter().map(|e| &e.event)
    }

    pub(crate) fn count(&self, which: impl Fn(&Event) -> bool) -> usize {
        self.events().filter(|e| which(e)).count()
    }

    pub(crate) fn schedule(&self) -> Vec<Trial> {
        match &self.journal[0].event {
            Event::SessionStarted(start) => start.schedule.clone(),
            other => panic!("the journal begins with {other:?}"),
        }
    }

    /// Good answers to the page on the screen.
    pub(crate) fn good_answers(&self) -> Vec<(QuestionId, Answer)> {
        let Screen::Form { questions, .. } = self.view().screen else {
            return Vec::new();
        };
        let answer = |q: &Question| match q.kind.control() {
            Control::Boxes { from, to, .. } => Answer::Rating(4_i64.clamp(from, to)),
            Control::Track { from, .. } => Answer::Number(from),
            Control::Digits { .. } => Answer::Number(21.5),
            Control::List { options, .. } => Answer::Choice(options[..1].to_vec()),
            Control::Text => Answer::Text("words".to_owned()),
        };
        questions
            .iter()
            .map(|q| (q.id.clone(), answer(q)))
            .collect()
    }

    pub(crate) fn answer_page(&mut self) -> &mut Self {
        let answers = self.good_answers();
        assert!(!answers.is_empty(), "no form: {:?}", self.view().screen);
        self.send(Input::Answer(answers))
    }

    /// Does the one thing that is to be done now.
    pub(crate) fn step(&mut self) -> &mut Self {
        self.steps += 1;
        assert!(self.steps < 5000, "it goes round: {:?}", self.view().screen);
        self.wait(1.0);
        match self.view().screen {
            Screen::Who { .. } => self.identify(),
            Screen::ResumeChoice { .. } => {
                self.send(Input::Resume(study_session::outcome::Choice::Continue))
            }
            Screen::Consent { .. } => self.send(Input::Consent(true)),
            Screen::Form { .. } => self.answer_page(),
            Screen::Reference { wait_s, .. } | Screen::Break { wait_s, .. } => {
                self.wait(wait_s).send(Input::Advance)
            }
            Screen::Mount { .. } => self.send(Input::Advance).send(Input::DeviceStarted),
            Screen::Loading { .. } => self.send(Input::DeviceLoaded).send(Input::DeviceStarted),
            Screen::Playing { .. } => self
                .send(Input::DeviceProgress { strokes: 9 })
                .send(Input::Advance),
            Screen::Stopping => {
                let playback = self.playback;
                self.send(Input::DeviceStopped(playback))
            }
            Screen::Stopped { .. } => self.send(Input::PlayAgain),
            Screen::DeviceTrouble { .. } => self.send(Input::DeviceReady).send(Input::Advance),
            Screen::Saving => {
                let saved = self.all_on_disk();
                self.send(saved)
            }
            Screen::SaveTrouble { .. } => {
                self.store = StoreMood::Prompt;
                self.send(Input::RetrySave)
            }
            Screen::Message { .. } | Screen::Paused { .. } | Screen::End { .. } => {
                self.send(Input::Advance)
            }
        }
    }

    /// Steps until a screen of this name.
    pub(crate) fn until(&mut self, screen: &str) -> &mut Self {
        for _ in 0..500 {
            if name(&self.view().screen) == screen {
                return self;
            }
            assert!(self.ending.is_none(), "it ended before {screen}");
            self.step();
        }
        panic!("never {screen}: {:?}", self.view());
    }

    /// Steps until there are so many closed trials and the next reference prompt.
    pub(crate) fn until_reference(&mut self, closed: usize) -> &mut Self {
        self.until("Reference");
        while self.closed().len() < closed {
            self.step().until("Reference");
        }
        self
    }

    pub(crate) fn finish(&mut self) -> &mut Self {
        self.store = StoreMood::Prompt;
        self.device = DeviceMood::Willing;
        for _ in 0..1000 {
            if self.ending.is_some() {
                return self;
            }
            self.step();
        }
        panic!("it never ends: {:?}", self.view());
    }

    /// The session is whole: every trial closed once, every answer there.
    pub(crate) fn assert_whole(&self) {
        assert_eq!(self.ending, Some(Ending::Finished));
        assert_eq!(self.count(|e| *e == Event::Finished), 1);
        let closed = self.closed();
        let planned: BTreeSet<u32> = self.schedule().iter().map(|t| t.trial).collect();
        assert_eq!(closed.keys().copied().collect::<BTreeSet<_>>(), planned);
        let ask = |form, questions: &[Question]| {
            for q in questions {
                assert!(self.answer(form, &q.id).is_some(), "{} {form:?}", q.id);
            }
        };
        ask(FormId::Setup, &self.protocol.setup);
        ask(FormId::Intake, &self.protocol.intake);
        ask(FormId::Outro, &self.protocol.outro);
        for (trial, attempt) in closed {
            if let Some(attempt) = attempt {
                ask(FormId::Trial { trial, attempt }, &self.protocol.questions);
            }
        }
    }

    /// Positions of the attempts that count, in the order of the trials' ends.
    pub(crate) fn positions(&self) -> Vec<u32> {
        let closed = self.closed();
        let practice = |n: u32| self.schedule().iter().any(|t| t.trial == n && t.practice);
        self.events()
            .filter_map(|e| match e {
                Event::AttemptStarted {
                    trial,
                    attempt,
                    position,
                    ..
                } if closed.get(trial) == Some(&Some(*attempt)) && !practice(*trial) => {
                    Some(*position)
                }
                _ => None,
            })
            .collect()
    }
}

/// What the store and the device say of a session with these entries.
pub(crate) fn claim(protocol: &Protocol, participant: ParticipantId, entries: Vec<Entry>) -> Claim {
    Claim {
        participant,
        session: 1,
        seat: Seat::Row(1),
        entries,
        protocol_version: 1,
        fingerprints: Fingerprints {
            stimulus: "s".to_owned(),
            wording: "w".to_owned(),
            analysis: "a".to_owned(),
        },
        device_kind: protocol.device.kind,
        device_id: "simulated-1".to_owned(),
        device_check: None,
        self_weighed: None,
        device_telemetry: true,
        assigned: Assigned::default(),
        notices: Vec::new(),
    }
}

pub(crate) fn name(screen: &Screen) -> &'static str {
    match screen {
        Screen::Who { .. } => "Who",
        Screen::ResumeChoice { .. } => "ResumeChoice",
        Screen::Consent { .. } => "Consent",
        Screen::Message { .. } => "Message",
        Screen::Form { .. } => "Form",
        Screen::Reference { .. } => "Reference",
        Screen::Loading { .. } => "Loading",
        Screen::Mount { .. } => "Mount",
        Screen::Playing { .. } => "Playing",
        Screen::Stopping => "Stopping",
        Screen::Stopped { .. } => "Stopped",
        Screen::DeviceTrouble { .. } => "DeviceTrouble",
        Screen::Saving => "Saving",
        Screen::SaveTrouble { .. } => "SaveTrouble",
        Screen::Break { .. } => "Break",
        Screen::Paused { .. } => "Paused",
        Screen::End { .. } => "End",
    }
}

impl Rig {
    /// The whole protocol, as text.
    pub(crate) fn protocol_text(&self) -> String {
        format!("{:?}", self.protocol)
    }
}
