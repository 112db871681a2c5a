//! The device under test: questions, playbacks that are bounded, and what is seen meanwhile.

use super::desk::{Desk, Ended};
use crate::cli::{Failure, Kind};
use std::collections::VecDeque;
use std::time::Duration;
use study_base::limits::Limits;
use study_base::text::Untrusted;
use study_device::commission::{SwingSpring, Travel, VirtualSpring, force_free};
use study_device::{Device, Report, Stimulus};
use study_haptics::model::Realization;
use study_session::outcome::Sample;
use study_wire::servo::ServoSettings;

/// Time for a load, a start, a stop, or until a device answers again.
const ANSWER: Duration = Duration::from_secs(10);
/// Before a question nothing may have been typed for this time.
const QUIET: Duration = Duration::from_millis(100);
/// Somebody who never stops typing is asked after this time.
const LONGEST_QUIET: Duration = Duration::from_secs(5);
/// Time over which a reading is averaged.
const READING_S: f64 = 0.5;
/// Within it a handle at rest moves less than this, mm.
const REST_MM: f64 = 0.5;
/// The host ends a motion this far beyond its reach, in reaches, and above its speed: a device
/// does so by itself before.
const BEYOND: f64 = 1.4;
/// Range in which a device without a stroke is read, mm.
const WIDE_MM: f64 = 1000.0;
/// A motor that pushes reports a sample at least this often; the host ends its motion otherwise.
const SILENCE: Duration = Duration::from_millis(500);
/// A handle farther than this from where a motion begins was moved meanwhile, in reaches.
const MOVED: f64 = 0.3;
/// How often a position is read until the handle rests.
const TRIES: u32 = 4;
/// Limits of a playback without force.
const FREE_N: f64 = 0.1;
const FREE_MM_S: f64 = 1000.0;

/// What is said of a handle that was moved before the force began.
pub(in crate::cli::device) const MOVED_BEFORE: &str = "the handle was moved before the force began";
/// What is said of a handle that moves without a force.
pub(in crate::cli::device) const UNREST: &str =
    "the handle did not rest, although nothing pushes it";
/// What is said of a device without samples, and of a handle beyond its bounds.
const SILENT: &str = "the device reports no samples while its motor is on";
/// What is said after this computer, or this program, did nothing for a while.
pub(in crate::cli::device) const STOOD_STILL: &str = "this program stood still";
const UNBOUNDED: &str = "and the device did not stop by itself";
/// Why this program ends a motion.
pub(in crate::cli::device) const OWN: [&str; 3] = [MOVED_BEFORE, SILENT, UNBOUNDED];

/// Why a dialog goes no further.
#[derive(Debug)]
pub(in crate::cli::device) enum Stop {
    /// Nobody answers any more.
    Ended(Ended),
    /// A failure of this program or its output.
    Failed(Failure),
}

impl From<Ended> for Stop {
    fn from(ended: Ended) -> Self {
        Self::Ended(ended)
    }
}

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

/// An answer to a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::cli::device) enum Answer {
    /// What was typed, trimmed.
    Given(String),
    /// The step is left out.
    Skip,
    /// The device gave up meanwhile.
    Trouble(String),
}

/// Where a handle was for the time of a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::cli::device) struct Reading {
    /// Mean position, mm.
    pub(in crate::cli::device) x_mm: f64,
    /// Mean commanded force, N.
    pub(in crate::cli::device) command_n: f64,
    /// Whether it rested.
    pub(in crate::cli::device) rests: bool,
}

/// The bounds of a motion.
#[derive(Debug, Clone, Copy)]
struct Guard {
    /// Where the handle is when it begins.
    from_mm: f64,
    rest_mm: f64,
    reach_mm: f64,
    velocity_mm_s: f64,
}

/// The device and the person.
pub(in crate::cli::device) struct Rig<'d> {
    device: &'d mut dyn Device,
    pub(in crate::cli::device) desk: Box<dyn Desk + 'd>,
    /// Limits of the device.
    pub(in crate::cli::device) limits: Limits,
    /// The last samples of the present playback.
    samples: VecDeque<Sample>,
    /// All samples of a swing.
    kept: Option<Vec<Sample>>,
    /// Where the present motion has to stay.
    guard: Option<Guard>,
    /// When a sample of the present motion came last; `None` before it began.
    heard: Option<Duration>,
    /// When the device was polled last.
    polled: Duration,
    /// Whether the present playback has had no sample yet.
    unseen: bool,
    farthest_mm: f64,
    fastest_mm_s: f64,
    /// The last fault or loss.
    trouble: Option<String>,
    /// Why nobody answers any more.
    ended: Option<Ended>,
}

impl<'d> Rig<'d> {
    pub(in crate::cli::device) fn new(
        device: &'d mut dyn Device,
        desk: Box<dyn Desk + 'd>,
    ) -> Self {
        Self {
            limits: device.identity().limits,
            device,
            desk,
            samples: VecDeque::new(),
            kept: None,
            guard: None,
            heard: None,
            polled: Duration::ZERO,
            unseen: false,
            farthest_mm: 0.0,
            fastest_mm_s: 0.0,
            trouble: None,
            ended: None,
        }
    }

    pub(in crate::cli::device) fn say(&mut self, text: &str) -> Result<(), Failure> {
        self.desk.say(text)
    }

    /// Polls the device; heartbeats depend on it.
    fn poll(&mut self) -> Vec<Report> {
        let stood_still = self.heard.is_some() && self.desk.now() > self.polled + SILENCE;
        self.polled = self.desk.now();
        if stood_still && self.trouble.is_none() {
            self.device.limp(self.desk.now());
            self.trouble = Some(STOOD_STILL.to_owned());
        }
        let reports = self.device.poll(self.desk.now());
        for report in &reports {
            match report {
                Report::Telemetry(samples) => samples.iter().for_each(|s| self.see(s)),
                Report::Fault(why) | Report::Lost(why) => self.trouble = Some(why.clone()),
                _ => {}
            }
        }
        let silent = (self.heard).is_some_and(|at| self.desk.now() > at + SILENCE);
        if silent && self.trouble.is_none() {
            self.device.limp(self.desk.now());
            self.trouble = Some(SILENT.to_owned());
        }
        self.desk.wait();
        if let (Err(ended), None) = (self.desk.goes_on(), &self.ended) {
            self.device.limp(self.desk.now());
            self.trouble = Some(ended.to_string());
            self.ended = Some(ended);
        }
        reports
    }

    /// Watches a sample: the device has bounds of its own, and these are behind them.
    fn see(&mut self, sample: &Sample) {
        let is_first = std::mem::take(&mut self.unseen);
        self.samples.push_back(*sample);
        self.heard = self.heard.map(|_| self.desk.now());
        if let Some(kept) = &mut self.kept {
            kept.push(*sample);
        }
        let newest_s = sample.t_s;
        while (self.samples.front()).is_some_and(|first| newest_s - first.t_s > READING_S) {
            self.samples.pop_front();
        }
        let Some(guard) = self.guard else { return };
        let far_mm = (sample.x_mm - guard.rest_mm).abs();
        self.farthest_mm = self.farthest_mm.max(far_mm);
        self.fastest_mm_s = self.fastest_mm_s.max(sample.v_mm_s.abs());
        let inside = far_mm <= BEYOND * guard.reach_mm
            && sample.v_mm_s.abs() <= BEYOND * guard.velocity_mm_s;
        let moved = is_first && (sample.x_mm - guard.from_mm).abs() > MOVED * guard.reach_mm;
        if moved && self.trouble.is_none() {
            self.device.limp(self.desk.now());
            self.trouble = Some(MOVED_BEFORE.to_owned());
        }
        if !inside && self.trouble.is_none() {
            self.device.limp(self.desk.now());
            self.trouble = Some(format!(
                "the handle was {far_mm:.1} mm from its rest at {:.0} mm/s, {UNBOUNDED}",
                sample.v_mm_s.abs()
            ));
        }
    }

    /// Polls for a time, or until the device gives up.
    pub(in crate::cli::device) fn watch(&mut self, time: Duration) {
        let until = self.desk.now() + time;
        while self.desk.now() < until && self.trouble.is_none() {
            self.poll();
        }
    }

    /// Polls until a report comes; `None` if it does not in time or the device trips.
    fn until(&mut self, wanted: impl Fn(&Report) -> bool) -> Option<()> {
        let until = self.desk.now() + ANSWER;
        self.trouble = None;
        while self.desk.now() < until && self.trouble.is_none() {
            if self.poll().iter().any(&wanted) {
                return Some(());
            }
        }
        None
    }

    /// Why nobody answers any more, if a signal came while nothing was asked.
    pub(in crate::cli::device) fn ended(&self) -> Result<(), Ended> {
        self.ended.clone().map_or(Ok(()), Err)
    }

    /// What went wrong since the last playback began, once.
    pub(in crate::cli::device) fn take_trouble(&mut self) -> Option<String> {
        self.trouble.take()
    }

    /// Drops what was typed before a question.
    fn drop_typed_ahead(&mut self) -> Result<(), Ended> {
        self.desk.drop_typed();
        let latest = self.desk.now() + LONGEST_QUIET;
        let mut quiet_since = self.desk.now();
        while self.desk.now() < quiet_since + QUIET && self.desk.now() < latest {
            self.poll();
            while self.desk.line()?.is_some() {
                quiet_since = self.desk.now();
            }
        }
        Ok(())
    }

    /// Asks, and waits for a line while the device goes on.
    fn ask(&mut self, question: &str, despite_trouble: bool) -> Result<Answer, Stop> {
        self.drop_typed_ahead()?;
        self.say(question)?;
        loop {
            self.ended()?;
            if let (Some(why), false) = (&self.trouble, despite_trouble) {
                return Ok(Answer::Trouble(why.clone()));
            }
            match self.desk.line()? {
                Some(line) => {
                    return Ok(match line.trim() {
                        "skip" => Answer::Skip,
                        given => Answer::Given(given.to_owned()),
                    });
                }
                None => drop(self.poll()),
            }
        }
    }

    /// Asks until `read` accepts an answer; its error says what is needed.
    pub(in crate::cli::device) fn ask_for<T, E: std::fmt::Display>(
        &mut self,
        question: &str,
        despite_trouble: bool,
        mut read: impl FnMut(&str) -> Result<T, E>,
    ) -> Result<Result<T, Answer>, Stop> {
        loop {
            match self.ask(question, despite_trouble)? {
                Answer::Given(given) => match read(&given) {
                    Ok(value) => return Ok(Ok(value)),
                    Err(why) => self.say(&format!("{why}, or `skip`"))?,
                },
                other => return Ok(Err(other)),
            }
        }
    }

    /// One of some words, asked until it is one. `None`: skip.
    pub(in crate::cli::device) fn word(
        &mut self,
        question: &str,
        words: &[&str],
    ) -> Result<Option<String>, Stop> {
        let read = |given: &str| {
            let known = words.contains(&given);
            known
                .then(|| given.to_owned())
                .ok_or_else(|| format!("one of {} is needed", words.join(", ")))
        };
        Ok(self.ask_for(question, true, read)?.ok())
    }

    /// Whether a motion may begin: `go`, typed for this one. `false`: skip.
    pub(in crate::cli::device) fn may_go(&mut self, what: &str) -> Result<bool, Stop> {
        let question = format!("{what}\nType `go` to begin, or `skip`.");
        Ok(self.word(&question, &["go"])?.is_some())
    }

    /// Begins a playback.
    fn play(&mut self, table: &Realization, limits: Limits) -> Result<(), String> {
        self.ended().map_err(|ended| ended.to_string())?;
        self.samples.clear();
        self.heard = None;
        self.unseen = true;
        (self.farthest_mm, self.fastest_mm_s) = (0.0, 0.0);
        let at = self.desk.now();
        let stimulus = Stimulus {
            allow_uncertified: false,
            ..Stimulus::of_table(table)
        };
        let loading = self.device.load(&stimulus, limits, at);
        loading.map_err(|e| e.to_string())?;
        let trouble = |rig: &mut Self| {
            let why = rig.trouble.clone();
            why.unwrap_or_else(|| "the device does not answer in time".to_owned())
        };
        if self.until(|r| *r == Report::Loaded).is_none() {
            return Err(trouble(self));
        }
        let at = self.desk.now();
        self.device.start(at).map_err(|e| e.to_string())?;
        match self.until(|r| *r == Report::Started) {
            Some(()) => {
                self.heard = Some(self.desk.now());
                Ok(())
            }
            None => Err(trouble(self)),
        }
    }

    /// Plays a table without force, so that the position is reported.
    pub(in crate::cli::device) fn read_only(
        &mut self,
        stroke_mm: Option<[f64; 2]>,
    ) -> Result<(), String> {
        self.guard = None;
        let table = force_free(stroke_mm.unwrap_or([-WIDE_MM, WIDE_MM]));
        let limits = Limits::new(FREE_N, FREE_MM_S).map_err(|e| e.to_string())?;
        self.play(&table, limits.capped_at(self.limits))
    }

    /// Plays a spring.
    pub(in crate::cli::device) fn hold(&mut self, spring: &VirtualSpring) -> Result<(), String> {
        self.guard = Some(Guard {
            from_mm: spring.rest_mm,
            rest_mm: spring.rest_mm,
            reach_mm: spring.reach_mm,
            velocity_mm_s: spring.velocity_mm_s,
        });
        let limits = spring.limits().map_err(|e| e.to_string())?;
        self.play(&spring.table(), limits)?;
        // the first sample tells whether the handle is where the spring rests
        while self.unseen && self.trouble.is_none() {
            self.poll();
        }
        self.trouble.clone().map_or(Ok(()), Err)
    }

    /// Plays a spring beside whose rest the free handle is, and returns what it did.
    pub(in crate::cli::device) fn swing(
        &mut self,
        spring: &SwingSpring,
    ) -> Result<Vec<Sample>, String> {
        self.guard = Some(Guard {
            from_mm: spring.from_mm,
            rest_mm: spring.rest_mm,
            reach_mm: spring.reach_mm(),
            velocity_mm_s: spring.velocity_mm_s,
        });
        let limits = spring.limits().map_err(|e| e.to_string())?;
        self.kept = Some(Vec::new());
        let played = self.play(&spring.table(), limits);
        if played.is_ok() {
            self.watch(Duration::from_secs_f64(spring.seconds));
        }
        let kept = self.kept.take().unwrap_or_default();
        let trouble = self.take_trouble();
        self.limp();
        played?;
        match trouble {
            Some(why) => Err(why),
            None => Ok(kept),
        }
    }

    /// The constants of the servo, if the device tells them.
    pub(in crate::cli::device) fn servo(&self) -> Option<ServoSettings> {
        self.device.identity().servo
    }

    /// The mass of the handle, if the device tells what it can compensate, kg.
    pub(in crate::cli::device) fn told_mass_kg(&self) -> Option<f64> {
        let least_kg = -self.servo()?.least_mass_kg;
        (least_kg.is_finite() && least_kg > 0.0).then_some(least_kg)
    }

    /// Where the handle rests, by a short playback without force.
    pub(in crate::cli::device) fn position_mm(
        &mut self,
        stroke_mm: Option<[f64; 2]>,
    ) -> Result<f64, String> {
        self.read_only(stroke_mm)?;
        let mut read = self.reading();
        for _ in 1..TRIES {
            if read.as_ref().is_ok_and(|r| !r.rests) {
                read = self.reading();
            }
        }
        self.limp();
        match read? {
            read if read.rests => Ok(read.x_mm),
            _ => Err(UNREST.to_owned()),
        }
    }

    /// The mean of the last half second from now on, while the device goes on.
    pub(in crate::cli::device) fn reading(&mut self) -> Result<Reading, String> {
        self.samples.clear();
        let mut full = false;
        let until = self.desk.now() + ANSWER;
        while !full && self.desk.now() < until && self.trouble.is_none() {
            self.poll();
            let ends = self.samples.front().zip(self.samples.back());
            full = ends.is_some_and(|(first, last)| last.t_s - first.t_s > 0.9 * READING_S);
        }
        if let Some(why) = &self.trouble {
            return Err(why.clone());
        }
        if !full {
            return Err("the device reports no position".to_owned());
        }
        let n = self.samples.len() as f64;
        let mean = |of: fn(&Sample) -> f64| self.samples.iter().map(of).sum::<f64>() / n;
        let x_mm = mean(|s| s.x_mm);
        let spread = (self.samples.iter()).map(|s| (s.x_mm - x_mm).abs());
        Ok(Reading {
            x_mm,
            command_n: mean(|s| s.force_command_n),
            rests: spread.fold(0.0, f64::max) <= REST_MM,
        })
    }

    /// What a motion was limited to and how far it went.
    pub(in crate::cli::device) fn travel(&self, what: &str, spring: &VirtualSpring) -> Travel {
        Travel {
            what: what.to_owned(),
            rest_mm: spring.rest_mm,
            reach_mm: spring.reach_mm,
            force_n: spring.force_n,
            velocity_mm_s: spring.velocity_mm_s,
            farthest_mm: self.farthest_mm,
            fastest_mm_s: self.fastest_mm_s,
        }
    }

    /// Switches the force off.
    pub(in crate::cli::device) fn limp(&mut self) {
        self.guard = None;
        self.heard = None;
        self.device.limp(self.desk.now());
        self.poll();
    }

    /// Watches a limp device, whatever happened before.
    pub(in crate::cli::device) fn settle(&mut self, time: Duration) {
        self.limp();
        self.trouble = None;
        self.watch(time);
    }
}

impl Drop for Rig<'_> {
    /// On every way out, also that of a panic.
    fn drop(&mut self) {
        self.device.limp(self.desk.now());
    }
}

/// For a message: text of the device.
pub(in crate::cli::device) fn safe(text: &str) -> String {
    Untrusted(text).to_string()
}

impl Stop {
    /// The failure of the command.
    pub(in crate::cli::device) fn failure(self) -> Failure {
        match self {
            Self::Ended(ended @ (Ended::Input | Ended::Output)) => Failure::usage(ended),
            Self::Ended(ended) => Failure::new(Kind::Device, ended),
            Self::Failed(failure) => failure,
        }
    }
}
