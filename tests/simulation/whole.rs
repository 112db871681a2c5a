//! A whole simulation from a seed: sittings in which things go wrong, each on another computer
//! than the last, then as many without faults as it takes to finish, and a last look.

use crate::bugs::Bug;
use crate::checks;
use crate::clock::SimClock;
use crate::device::SimDevice;
use crate::disk::Death;
use crate::faults::Plan;
use crate::memory::{Crash, Fault};
use crate::people::{Ledger, People};
use crate::setting::{Disks, LONGEST_PAUSE, PEOPLE, Person, kept, realizations, study_path};
use crate::sitting::{Before, Sitting, turns};
use crate::world::{self, Kept};
use chrono::{DateTime, FixedOffset, TimeDelta};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;
use study::runner::clock::Clock as _;
use study::runner::{Runner, Setup};
use study_base::hex::sha256;
use study_base::rng::Stream;
use study_base::text::ModelId;
use study_haptics::model::Realization;
use study_plan::protocol::{DeviceKind, Protocol};
use study_session::outcome::{Entry, Event};
use study_session::session::{Config, Ending, Unsaved};
use study_session::store::{SeatKind, SessionData, StoreError, StudyFolder};

/// Sittings without faults that a participant needs to finish, at most.
const MOST_CALM: u32 = 4;

/// What happened in a simulation.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Seen {
    pub(crate) sittings: u32,
    /// Processes that died, and those that left something unsaved.
    pub(crate) deaths: u32,
    pub(crate) unsaved: u32,
    /// Sittings in which the folder could not be opened.
    pub(crate) refused: u32,
    pub(crate) playbacks: u32,
    /// Answers that were shown as saved.
    pub(crate) saved: u32,
    /// Hash of everything that happened and of all files.
    pub(crate) fingerprint: String,
}

/// Runs the simulation of a seed.
///
/// # Errors
/// What went wrong, and the course until then.
pub(crate) fn simulate(seed: u64, bug: Option<Bug>) -> Result<Seen, String> {
    let mut course = Course::new(seed, bug);
    match course.run() {
        Ok(()) => Ok(course.seen),
        Err(why) => Err(format!("{why}\n{}", course.log.join("\n"))),
    }
}

struct Course {
    chance: Stream,
    bug: Option<Bug>,
    kept: Kept,
    protocol: Arc<Protocol>,
    models: BTreeMap<ModelId, Realization>,
    disks: Disks,
    ledger: Ledger,
    /// Real time so far.
    passed: Duration,
    /// By how much the wall clocks are wrong, ms, and whether one was ever set.
    set_ms: i64,
    was_set: bool,
    /// When each participant last left.
    left_at: BTreeMap<&'static str, Duration>,
    /// What the page has sent and not heard of.
    left: Vec<Vec<u8>>,
    log: Vec<String>,
    seen: Seen,
}

impl Course {
    fn new(seed: u64, bug: Option<Bug>) -> Self {
        let mut chance = Stream::new(seed, &["simulation"]);
        let kept = kept();
        Self {
            disks: Disks::new(chance.below(2) == 0),
            chance,
            bug,
            protocol: Arc::new(kept.protocol.clone()),
            kept,
            models: realizations(),
            ledger: Ledger::default(),
            passed: Duration::ZERO,
            set_ms: 0,
            was_set: false,
            left_at: BTreeMap::new(),
            left: Vec::new(),
            log: Vec::new(),
            seen: Seen::default(),
        }
    }

    fn mirrored(&self) -> bool {
        self.disks.0.len() == 2
    }

    fn run(&mut self) -> Result<(), String> {
        let first = self.chance.below(4) as usize;
        let second = (first + 1 + self.chance.below(3) as usize) % 4;
        let people = [PEOPLE[first], PEOPLE[second]];
        for _ in 0..2 + self.chance.below(4) {
            let person = people[usize::from(self.chance.below(4) == 0)];
            let mirrored = self.mirrored();
            let plan = Plan::drawn(&mut self.chance, mirrored);
            self.sitting(person, &plan, false)?;
            self.change_computers()?;
        }
        for person in people {
            let mut calm = 0;
            while !self.is_done(person) {
                calm += 1;
                if calm > MOST_CALM {
                    return Err(format!("{} does not finish", person.id));
                }
                let plan = Plan::calm(self.chance.below(2) == 0);
                self.sitting(person, &plan, true)?;
                self.change_computers()?;
            }
        }
        self.last_look(people)
    }

    /// The wall clock now, in one time zone or another.
    fn wall(&mut self) -> DateTime<FixedOffset> {
        let start = DateTime::parse_from_rfc3339("2026-03-02T09:00:00+01:00").unwrap();
        let hours = self.chance.below(3) as i32;
        let zone = FixedOffset::east_opt(3600 * hours).unwrap();
        let shown =
            TimeDelta::from_std(self.passed).unwrap() + TimeDelta::milliseconds(self.set_ms);
        (start + shown).with_timezone(&zone)
    }

    /// The journal of a participant as far as it is on any disk.
    fn entries(&self, id: &str) -> Vec<Entry> {
        let of = |sessions: Vec<SessionData>| {
            let own = sessions.into_iter().find(|s| s.participant.as_str() == id);
            own.map_or(Vec::new(), |session| session.entries)
        };
        let sides =
            (0..self.disks.0.len()).map(|side| self.disks.read(side).map_or(Vec::new(), of));
        // Of two copies one has everything that the other has.
        sides.max_by_key(Vec::len).unwrap_or_default()
    }

    /// What a sitting may not ask.
    fn before(&self, person: Person) -> Result<Before, String> {
        let entries = self.entries(person.id);
        let left_at = self.left_at.get(person.id);
        let away = left_at.map_or(Duration::ZERO, |at| self.passed.saturating_sub(*at));
        // With a clock that was set nobody knows how long it was.
        let too_long = away > LONGEST_PAUSE + Duration::from_secs(1) && !self.was_set;
        Ok(Before {
            answered: checks::answered(&entries)?,
            forgotten: match too_long {
                true => checks::unanswered(&entries),
                false => BTreeSet::new(),
            },
        })
    }

    /// One process. It has to come to the end of the session if nothing goes wrong.
    fn sitting(&mut self, person: Person, plan: &Plan, must_end: bool) -> Result<(), String> {
        self.seen.sittings += 1;
        let number = self.seen.sittings;
        self.log.push(format!("{number}: {}, {plan:?}", person.id));
        let before = self.before(person)?;
        self.disks.mount();
        let death = Death::default();
        let origin = Duration::from_secs(self.chance.below(1_000_000));
        let clock = SimClock::new(self.wall(), origin);
        let ended = self.process(person, plan, before, (&clock, &death));
        self.passed += clock.real();
        self.set_ms += clock.set_ms();
        self.was_set |= clock.set_ms() != 0;
        self.left_at.insert(person.id, self.passed);
        self.seen.deaths += u32::from(death.is_here());
        self.log.push(format!(
            "   {ended:?} after {:?}{}",
            clock.real(),
            if death.is_here() { ", dead" } else { "" }
        ));
        match ended? {
            Some(Ending::Finished) => Ok(()),
            other if must_end => Err(format!("without faults it ended with {other:?}")),
            _ => Ok(()),
        }
    }

    /// Plans what goes wrong with the disks. A disk whose records are not all on the other one is
    /// removed only after the folder is opened, which copies them: that the only copy is lost is beyond
    /// what a mirror promises. Returns the disk, and the call after that.
    fn plan_faults(&self, plan: &Plan) -> Option<(usize, usize)> {
        let mut later = None;
        for (side, fault) in plan.disks.into_iter().enumerate() {
            match fault {
                Some((call, Fault::Removed)) if self.disks.is_ahead(side) => {
                    later = Some((side, call));
                }
                Some((call, fault)) => self.disks.0[side].plan(call, fault),
                None => {}
            }
        }
        later
    }

    /// From the opening of the folder to the tables. `None` if there was no session, or if
    /// something is not saved.
    fn process(
        &mut self,
        person: Person,
        plan: &Plan,
        before: Before,
        (clock, death): (&SimClock, &Death),
    ) -> Result<Option<Ending>, String> {
        let mut stream = |name: &str| Stream::new(self.chance.next_u64(), &[name]);
        let [people, saver] = ["people", "saver"].map(&mut stream);
        let device_seed = self.chance.next_u64();
        let faults = (plan.device_faults, plan.uneven);
        let device = SimDevice::new(device_seed, clock, death, self.bug, faults);
        let removed_later = self.plan_faults(plan);
        let opened = self.disks.open(&self.kept, death, self.bug, clock.now());
        if let (Ok(_), Some((side, call))) = (&opened, removed_later) {
            let disk = &self.disks.0[side];
            disk.plan(disk.calls() + call, Fault::Removed);
        }
        let study = match opened.and_then(|study| study.refresh(&self.protocol).map(|_| study)) {
            Ok(study) => study,
            Err(error) => {
                self.seen.refused += 1;
                self.log.push(format!("   not opened: {error}"));
                return Ok(None);
            }
        };
        let setup = Setup {
            protocol: self.protocol.clone(),
            orders: None,
            models: self.models.clone(),
            deliveries: BTreeMap::new(),
            fingerprints: self.kept.fingerprints.clone(),
            study: study.clone(),
            kind: person.kind,
            rows: None,
            group: None,
            device_kind: DeviceKind::Simulated,
            device: Box::new(device.clone()),
            device_check: None,
            self_weighed: None,
            clock: Box::new(clock.clone()),
            saving: turns(clock.clone(), death.clone(), saver, plan.slow),
        };
        let left = std::mem::take(&mut self.left);
        let run = (self.seen.sittings, left);
        let people = People::new(person.id, people, plan, self.bug, run);
        let mut sitting = Sitting::new(
            (person, &self.disks, &mut self.ledger),
            (clock.clone(), death.clone(), device.clone()),
            people,
            plan.troubles.clone(),
            before,
        );
        let mut runner = Runner::new(setup, Config::default());
        let ended = runner.run(&mut sitting);
        // A dead process reaches neither disk nor device any more.
        drop(runner);
        let (wrong, left) = (sitting.wrong.take(), sitting.people.left());
        self.left = left;
        self.seen.playbacks += device.playbacks();
        if let Some(wrong) = wrong {
            return Err(wrong);
        }
        if death.is_here() {
            return match device.is_limp_without_host() {
                true => Ok(None),
                false => Err("there is force after the program has died".to_owned()),
            };
        }
        let mut sides = 0..self.disks.0.len();
        let finished = |side| {
            let journal = self.disks.journal_on_medium(side, person.id);
            journal.contains("\"event\":\"finished\"")
        };
        // What no disk takes is named as unsaved, and the program does not say that it is finished.
        let is_named = |unsaved: &Unsaved| {
            let mut events = unsaved.events.iter();
            events.any(|(_, event)| *event == Event::Finished)
        };
        if ended.ending == Ending::Finished
            && !sides.any(finished)
            && !ended.unsaved.as_ref().is_some_and(is_named)
        {
            return Err("it has finished, and no disk has it".to_owned());
        }
        self.seen.unsaved += u32::from(ended.unsaved.is_some());
        let written = study.refresh(&self.protocol);
        match (ended.unsaved, written) {
            (None, Ok(_)) => Ok(Some(ended.ending)),
            (_, written) => {
                let why = written.err().map(|error| error.to_string());
                self.log
                    .push(format!("   not everything is saved: {why:?}"));
                Ok(None)
            }
        }
    }

    /// The process has died or ended, perhaps without power; after a while another computer has
    /// the disks.
    fn change_computers(&mut self) -> Result<(), String> {
        let power = self.chance.below(3);
        let mut crash = || match power {
            0 => Crash::Process,
            1 => Crash::Strict(self.chance.next_u64()),
            _ => Crash::Ext4(self.chance.next_u64()),
        };
        let found = self.disks.0.iter().map(|disk| disk.after(crash()));
        self.disks = Disks(found.collect());
        const AWAY_S: [u64; 4] = [1, 20, 100, 18_000];
        let away_s = AWAY_S[self.chance.below(4) as usize];
        self.passed += Duration::from_secs(away_s);
        self.log.push(format!("   {power} power, {away_s} s"));
        self.notice()
    }

    /// Everything that was shown as saved is there, before anything is repaired.
    fn notice(&self) -> Result<(), String> {
        let mut found = BTreeSet::new();
        for side in 0..self.disks.0.len() {
            match self.disks.read(side) {
                Ok(sessions) => found.extend(checks::texts(&sessions, &self.ledger)?),
                // A disk that was removed, or on which there never was a study.
                Err(_) if self.mirrored() || self.ledger.told.is_empty() => {}
                Err(error) => return Err(format!("nothing can be read: {error}")),
            }
        }
        match self.ledger.told.difference(&found).next() {
            Some(lost) => Err(format!("{lost} was shown as saved and is lost")),
            None => Ok(()),
        }
    }

    fn is_done(&self, person: Person) -> bool {
        // One of two disks may be behind.
        (0..self.disks.0.len()).any(|side| {
            let sessions = self.disks.read(side).unwrap_or_default();
            let is_own = |s: &&SessionData| s.participant.as_str() == person.id;
            sessions.iter().filter(is_own).any(SessionData::is_done)
        })
    }

    /// The whole study: complete, verified, and everybody is what they were.
    fn last_look(&mut self, people: [Person; 2]) -> Result<(), String> {
        let told = |error: StoreError| error.to_string();
        self.disks.mount();
        let at = SimClock::new(self.wall(), Duration::ZERO).now();
        let opened = self.disks.open(&self.kept, &Death::default(), None, at);
        let study = opened.map_err(told)?;
        let derived = study.refresh(&self.protocol).map_err(told)?;
        let found = study.verify(Some(&self.protocol)).map_err(told)?;
        if let Some(problem) = found.iter().find(|f| f.is_problem) {
            return Err(format!("{problem:?}"));
        }
        for side in 0..self.disks.0.len() {
            let sessions = self.disks.read(side).map_err(told)?;
            checks::texts(&sessions, &self.ledger)?;
            checks::kinds(&people, &sessions, &derived)?;
            for person in people {
                let mut own = sessions.iter();
                let own = own.find(|s| s.participant.as_str() == person.id);
                let own = own.ok_or_else(|| format!("{} is not there", person.id))?;
                checks::whole(own, &self.protocol)?;
                checks::table(own, &derived, &self.protocol)?;
            }
        }
        self.notice()?;
        if self.mirrored() {
            let results = Arc::new(self.disks.0[0].clone());
            let results = StudyFolder::open_on(results, &study_path(0)).map_err(told)?;
            let mirror = &self.disks.0[1];
            let apart = results.verify_against_on(mirror, &study_path(1));
            if let Some(apart) = apart.map_err(told)?.first() {
                return Err(format!("the mirror differs: {apart:?}"));
            }
        }
        for person in people {
            let others = [SeatKind::Real, SeatKind::Pilot, SeatKind::Simulated];
            for kind in others.into_iter().filter(|kind| *kind != person.kind) {
                let claimed = study.claim(&world::request(person.id, kind));
                if !matches!(claimed, Err(StoreError::OtherKind { .. })) {
                    return Err(format!("{} is claimed as {kind:?}", person.id));
                }
            }
        }
        self.seen.saved = u32::try_from(self.ledger.told.len()).unwrap();
        let mut all = self.log.join("\n").into_bytes();
        for (path, bytes) in self.disks.0.iter().flat_map(|disk| disk.files()) {
            all.extend(path.to_string_lossy().bytes().chain(bytes));
        }
        self.seen.fingerprint = sha256(all);
        Ok(())
    }
}
