//! Sessions with faults: no constraint is violated unflagged.

use crate::designs::{design, model};
use chrono::{DateTime, FixedOffset, TimeDelta};
use std::sync::Arc;
use study_base::rng::Stream;
use study_base::text::{ModelId, ParticipantId};
use study_plan::protocol::Order::{Blocked, Fixed, LatinSquare, Shuffled, Williams};
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::{Design, DeviceKind, Protocol, Role, Seat, Trial};
use study_plan::schedule::plan;
use study_session::outcome::{Choice, Entry, Event, Failure, Moment, Playback};
use study_session::session::{Claim, Config, Effect, Input, Screen, Session};

const SESSIONS: u32 = 10_000;

#[test]
fn no_constraint_is_violated_unflagged_in_ten_thousand_sessions_with_faults() {
    let mut tally = Tally::default();
    for number in 1..=SESSIONS {
        let (protocol, mut chance) = constrained_design(number);
        let journal = Run::new(protocol.clone(), number).until_the_end(&mut chance);
        check(&journal, &protocol.design, &mut tally);
    }
    // The sessions are worth the check: most failures are mended, some cannot be.
    assert!(tally.failures > 3 * SESSIONS, "{tally:?}");
    assert!(tally.flagged > SESSIONS / 20, "{tally:?}");
    assert!(tally.flagged < tally.failures / 4, "{tally:?}");
    assert!(tally.violations > SESSIONS / 20, "{tally:?}");
    assert!(tally.closed > SESSIONS / 20, "{tally:?}");
    assert!(tally.restarts > SESSIONS / 100, "{tally:?}");
}

/// A feasible design with a constraint, and the random numbers of its session.
fn constrained_design(number: u32) -> (Arc<Protocol>, Chance) {
    let mut chance = Chance(Stream::new(11, &["faults", &number.to_string()]));
    loop {
        let order = [Blocked, Shuffled, Williams, LatinSquare, Fixed][chance.below(5)].clone();
        let mut protocol = design(2 + chance.below(5), 1 + chance.below(4) as u32, order);
        (protocol.design.max_run, protocol.design.min_distance) = match chance.below(4) {
            0 => (Some(1), None),
            1 => (Some(2), None),
            2 => (None, Some(2)),
            _ => (Some(1), Some(3)),
        };
        protocol.design.max_attempts = 1 + chance.below(3) as u32;
        if chance.below(3) == 0 {
            let mut spring = model("spring");
            spring.role = Role::Practice;
            protocol.design.practice = vec![spring.id.clone(), protocol.models[0].id.clone()];
            protocol.models.push(spring);
        }
        if plan(&protocol, None, Seat::Row(number)).is_ok() {
            return (Arc::new(protocol), chance);
        }
    }
}

struct Chance(Stream);

impl Chance {
    fn below(&mut self, n: u64) -> usize {
        self.0.below(n) as usize
    }

    /// True in so many of a hundred cases.
    fn percent(&mut self, n: usize) -> bool {
        self.below(100) < n
    }
}

/// A session with its journal, which is always saved at once.
struct Run {
    protocol: Arc<Protocol>,
    row: u32,
    session: Session,
    now: Moment,
    journal: Vec<Entry>,
    /// Entries of earlier processes.
    before: usize,
    ended: bool,
}

impl Run {
    fn new(protocol: Arc<Protocol>, row: u32) -> Self {
        let wall = DateTime::parse_from_rfc3339("2026-03-02T09:00:00+01:00").expect("a date");
        Self::from_journal(protocol, row, Vec::new(), wall)
    }

    fn from_journal(
        protocol: Arc<Protocol>,
        row: u32,
        journal: Vec<Entry>,
        wall: DateTime<FixedOffset>,
    ) -> Self {
        let config = Config {
            participant: "P01".to_owned(),
            auto_identify: true,
            ..Config::default()
        };
        let now = Moment {
            wall,
            mono_ns: 1_000_000_000,
        };
        let (session, effects) = Session::new(protocol.clone(), None, config, now);
        let mut run = Self {
            protocol,
            row,
            session,
            now,
            before: journal.len(),
            journal,
            ended: false,
        };
        run.carry_out(effects);
        run
    }

    /// The program ends at once and is started again later.
    fn crash(&mut self, gap_s: i64) {
        let journal = std::mem::take(&mut self.journal);
        let wall = self.now.wall + TimeDelta::seconds(gap_s);
        *self = Self::from_journal(self.protocol.clone(), self.row, journal, wall);
    }

    fn send(&mut self, input: Input) {
        self.now.mono_ns += 1_000_000;
        self.now.wall += TimeDelta::milliseconds(1);
        let effects = self.session.handle(input, self.now);
        self.carry_out(effects);
    }

    fn carry_out(&mut self, effects: Vec<Effect>) {
        let mut recorded = false;
        for effect in effects {
            match effect {
                Effect::Claim { participant, .. } => {
                    let claim = self.claim(participant);
                    self.send(Input::Claimed(Box::new(claim)));
                }
                Effect::Record(event) => {
                    self.journal.push(Entry {
                        seq: self.journal.len() as u64,
                        at: self.now,
                        event,
                    });
                    recorded = true;
                }
                Effect::End(_) => self.ended = true,
                _ => {}
            }
        }
        if recorded {
            let count = (self.journal.len() - self.before) as u64;
            self.send(Input::Saved { count });
        }
    }

    fn claim(&self, participant: ParticipantId) -> Claim {
        Claim {
            participant,
            session: 1,
            seat: Seat::Row(self.row),
            entries: self.journal.clone(),
            protocol_version: 1,
            fingerprints: Fingerprints {
                stimulus: "s".to_owned(),
                wording: "w".to_owned(),
                analysis: "a".to_owned(),
            },
            device_kind: DeviceKind::Simulated,
            device_id: "simulated-1".to_owned(),
            device_check: None,
            self_weighed: None,
            device_telemetry: true,
            assigned: study_plan::protocol::Assigned::default(),
            notices: Vec::new(),
        }
    }

    fn until_the_end(mut self, chance: &mut Chance) -> Vec<Entry> {
        for _ in 0..5000 {
            if self.ended {
                return self.journal;
            }
            self.step(chance);
        }
        panic!("it never ends: {:?}", self.session.view(self.now).screen);
    }

    fn step(&mut self, chance: &mut Chance) {
        let fault = || Input::DeviceFault("too hot".to_owned());
        let lost = || Input::PlaybackLost("no telemetry".to_owned());
        let mark = || Input::MarkBad {
            reason: "noise".to_owned(),
        };
        let screen = self.session.view(self.now).screen;
        let between_trials = matches!(
            screen,
            Screen::Reference { .. } | Screen::Loading { .. } | Screen::Playing { .. }
        );
        if between_trials && chance.percent(3) {
            let gap_s = [60, 40_000][chance.below(2)];
            return self.crash(gap_s);
        }
        match screen {
            Screen::ResumeChoice { .. } => {
                let choice = [Choice::RestartBlock, Choice::Continue][chance.below(2)];
                self.send(Input::Resume(choice));
            }
            Screen::Reference { .. } if chance.percent(6) => self.send(mark()),
            Screen::Reference { .. } => self.send(Input::Advance),
            Screen::Loading { .. } => match chance.below(12) {
                0 | 1 => self.send(fault()),
                2 => self.send(Input::Stop),
                3 => self.send(Input::Pause),
                4 => {
                    self.send(Input::DeviceLoaded);
                    self.send(lost());
                }
                _ => {
                    self.send(Input::DeviceLoaded);
                    self.send(Input::DeviceStarted);
                }
            },
            Screen::Playing { .. } => match chance.below(12) {
                0 => self.send(fault()),
                1 => self.send(lost()),
                2 => self.send(mark()),
                3 => self.send(Input::Stop),
                _ => self.send(Input::Advance),
            },
            Screen::Stopping if chance.percent(4) => self.send(fault()),
            Screen::Stopping => self.send(Input::DeviceStopped(Playback {
                strokes: 5,
                ..Playback::default()
            })),
            Screen::Stopped { .. } => {
                let choice =
                    [Input::PlayAgain, Input::RateStopped, mark()][chance.below(3)].clone();
                self.send(choice);
            }
            Screen::DeviceTrouble { .. } => {
                self.send(Input::DeviceReady);
                self.send(Input::Advance);
            }
            _ => self.send(Input::Advance),
        }
    }
}

#[derive(Debug, Default)]
struct Tally {
    failures: u32,
    flagged: u32,
    violations: u32,
    closed: u32,
    restarts: u32,
}

/// Reads a journal as docs/schedule.md describes it: after a failure that counts, and
/// after a restart of a block, the flag says whether the trials to come violate a
/// constraint, and no violation is felt without the flag.
fn check(journal: &[Entry], design: &Design, tally: &mut Tally) {
    let Event::SessionStarted(start) = &journal[0].event else {
        panic!("the journal begins with its start");
    };
    let trial = |number: u32| -> &Trial {
        let mut planned = start.schedule.iter();
        planned.find(|t| t.trial == number).expect("it is planned")
    };
    let mut felt: Vec<&ModelId> = Vec::new();
    let mut last = None;
    let mut goes_on = false;
    let mut flagged = false;
    for entry in journal {
        let decided = match &entry.event {
            Event::PlaybackStarted {
                trial: t, attempt, ..
            } => {
                let same = goes_on && last.is_some_and(|(last, _)| last == *t);
                (last, goes_on) = (Some((*t, *attempt)), false);
                if !same && !trial(*t).practice {
                    felt.extend(trial(*t).model());
                    if violates(&felt, felt.len() - 1, design) {
                        tally.violations += 1;
                        assert!(flagged, "unflagged: {felt:?}, {design:?}, {journal:#?}");
                    }
                }
                continue;
            }
            Event::AttemptFailed {
                trial,
                attempt,
                failure,
                queue,
                constraint_broken,
                ..
            } => {
                let counts = !matches!(failure, Failure::Stopped | Failure::Interrupted);
                if last == Some((*trial, *attempt)) {
                    goes_on = !counts;
                }
                if !counts {
                    continue;
                }
                tally.failures += 1;
                (queue, *constraint_broken)
            }
            Event::Reopened {
                choice: Some(Choice::RestartBlock),
                queue,
                constraint_broken,
                ..
            } => {
                tally.restarts += 1;
                (queue, *constraint_broken)
            }
            Event::TrialClosed { .. } => {
                tally.closed += 1;
                continue;
            }
            _ => continue,
        };
        let (mut queue, broken) = (decided.0.as_slice(), decided.1);
        if goes_on && queue.first() == last.map(|(trial, _)| trial).as_ref() {
            queue = &queue[1..];
        }
        let counts = |t: &&Trial| !t.practice;
        let to_come = queue.iter().map(|t| trial(*t)).filter(counts);
        let order: Vec<_> = felt
            .iter()
            .copied()
            .chain(to_come.filter_map(|t| t.model()))
            .collect();
        let expected = (felt.len()..order.len()).any(|at| violates(&order, at, design));
        assert_eq!(broken, expected, "{order:?}, {design:?}, {:?}", entry.event);
        flagged = broken;
        tally.flagged += u32::from(broken);
    }
}

/// Whether the trial at a place violates a constraint with those before it.
fn violates(order: &[&ModelId], at: usize, design: &Design) -> bool {
    let same = |back: usize| at >= back && order[at - back] == order[at];
    let run = design.max_run.is_some_and(|k| (1..=k as usize).all(same));
    let near = design
        .min_distance
        .is_some_and(|d| (1..d as usize).any(same));
    run || near
}
