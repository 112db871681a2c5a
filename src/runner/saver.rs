//! Saves journal and telemetry of one session outside the session loop.
//!
//! Jobs are done in order; events that wait together are written together, with one
//! sync. [`SaveEvent::Saved`] acknowledges an event after its line is on disk, in the
//! order of the events. After a failed write nothing is acknowledged
//! and nothing is lost until [`Job::Retry`] has written every unsaved event into a new
//! segment of the journal. Telemetry that cannot be written is dropped and reported, and
//! the journal says so: no answer waits for it.

use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;
use study_session::outcome::{Event, Moment, Sample, TelemetryFile};
use study_session::store::{Journal, Receipt, SessionFolder, StoreError, TelemetryWriter};

/// How long the end of a session waits for the disk. A disk may never answer.
const LAST_WAIT: Duration = Duration::from_secs(5);
/// Interval at which it is checked.
const LAST_INTERVAL: Duration = Duration::from_millis(2);

/// A job for the saver.
#[derive(Debug)]
pub enum Job {
    /// Append an event with its time.
    Append(Moment, Event),
    /// Begin the telemetry file of an attempt.
    TelemetryBegin {
        /// Trial number, part of the file name.
        trial: u32,
        /// Attempt number, part of the file name.
        attempt: u32,
        /// Interval, part of the file name, if the trial has several.
        interval: Option<u32>,
    },
    /// Write samples of that attempt.
    Telemetry(Vec<Sample>),
    /// Finish the telemetry file.
    TelemetryEnd,
    /// Write the participant's copy of the consent document, before the next event.
    KeepConsent(String),
    /// Write all unsaved events into a new segment.
    Retry,
}

/// What the saver reports.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SaveEvent {
    /// The next event in order is on disk.
    Saved,
    /// An event could not be saved; reason and advice.
    Failed(String),
    /// The telemetry of the attempt could not be saved; answers are not affected.
    TelemetryLost(String),
    /// The session was left: the last record of its journal.
    Left(Receipt),
}

/// Who runs the saver of a session, and when.
#[derive(Clone)]
pub enum Saving {
    /// A thread of its own.
    Thread,
    /// The loop of the session: every event is on disk before the next input, as a rehearsal on a
    /// virtual clock requires.
    Loop,
    /// The loop of the session, in turns that a scheduler gives, so that saving takes time on a
    /// virtual clock: it is told how many jobs wait, and says how many are done now. A turn is
    /// what the thread does without waiting for another job.
    Turns(Rc<dyn Fn(usize) -> usize>),
}

/// The saver of one session; holds the lock of its folder.
pub struct Saver {
    mode: Mode,
}

enum Mode {
    Inline {
        worker: Box<Worker>,
        events: Vec<SaveEvent>,
    },
    Thread {
        jobs: Sender<Job>,
        events: Receiver<SaveEvent>,
        handle: JoinHandle<()>,
        /// Whether the premature end of the thread has been reported.
        reported: bool,
    },
    Turns {
        worker: Box<Worker>,
        waiting: VecDeque<Job>,
        turns: Rc<dyn Fn(usize) -> usize>,
    },
}

struct Worker {
    folder: SessionFolder,
    journal: Journal,
    telemetry: Option<Telemetry>,
    /// What became of the last telemetry file, until its playback is recorded.
    ended: Option<Ended>,
    /// The copy of the consent document that is not on disk.
    consent: Option<String>,
    unsaved: VecDeque<Unsaved>,
    broken: bool,
}

/// Trial, attempt and, if the trial has several, interval.
type Presented = (u32, u32, Option<u32>);

/// The telemetry of the attempt under way.
struct Telemetry {
    of: Presented,
    /// The file, or why there is none.
    file: Result<TelemetryWriter, String>,
}

/// A completed telemetry file, or why there is none.
struct Ended {
    of: Presented,
    file: Result<TelemetryFile, String>,
}

struct Unsaved {
    at: Moment,
    event: Event,
    /// Whether the session waits for it; it does not know of what the saver adds.
    awaited: bool,
}

impl Saver {
    /// A saver for a claimed folder.
    pub fn new(folder: SessionFolder, journal: Journal, saving: Saving) -> Self {
        let mut worker = Box::new(Worker {
            folder,
            journal,
            telemetry: None,
            ended: None,
            consent: None,
            unsaved: VecDeque::new(),
            broken: false,
        });
        let mode = match saving {
            Saving::Thread => {
                let (jobs, queue) = channel();
                let (send, events) = channel();
                let handle = std::thread::spawn(move || {
                    while let Ok(job) = queue.recv() {
                        for event in worker.turn(std::iter::once(job).chain(queue.try_iter())) {
                            // The work goes on even if the session loop has ended.
                            let _ = send.send(event);
                        }
                    }
                    for event in worker.finish() {
                        let _ = send.send(event);
                    }
                });
                Mode::Thread {
                    jobs,
                    events,
                    handle,
                    reported: false,
                }
            }
            Saving::Loop => Mode::Inline {
                worker,
                events: Vec::new(),
            },
            Saving::Turns(turns) => Mode::Turns {
                worker,
                waiting: VecDeque::new(),
                turns,
            },
        };
        Self { mode }
    }

    /// Queues a job.
    pub fn send(&mut self, job: Job) {
        match &mut self.mode {
            Mode::Inline { worker, events } => events.extend(worker.work(job)),
            Mode::Thread { jobs, .. } => {
                // The thread ends early only by a panic; then no event comes back, and
                // nothing is shown as saved.
                let _ = jobs.send(job);
            }
            Mode::Turns { waiting, .. } => waiting.push_back(job),
        }
    }

    /// Returns the events since the last call.
    pub fn drain(&mut self) -> Vec<SaveEvent> {
        match &mut self.mode {
            Mode::Inline { worker, events } => {
                events.extend(worker.save());
                std::mem::take(events)
            }
            Mode::Thread {
                events,
                handle,
                reported,
                ..
            } => {
                let mut new: Vec<SaveEvent> = events.try_iter().collect();
                if handle.is_finished() && !*reported {
                    *reported = true;
                    new.push(SaveEvent::Failed("the saving thread has ended".to_owned()));
                }
                new
            }
            Mode::Turns {
                worker,
                waiting,
                turns,
            } => match given(&**turns, waiting) {
                0 => Vec::new(),
                jobs => worker.turn(waiting.drain(..jobs)),
            },
        }
    }

    /// Finishes all queued jobs and closes the folder; returns the last events. Gives up
    /// waiting for a disk that does not answer.
    pub fn finish(self) -> Vec<SaveEvent> {
        match self.mode {
            Mode::Inline { worker, mut events } => {
                events.extend(worker.finish());
                events
            }
            Mode::Thread {
                jobs,
                events,
                handle,
                ..
            } => {
                drop(jobs);
                let most = LAST_WAIT.as_millis() / LAST_INTERVAL.as_millis();
                for _ in 0..most {
                    if handle.is_finished() {
                        break;
                    }
                    std::thread::sleep(LAST_INTERVAL);
                }
                events.try_iter().collect()
            }
            Mode::Turns {
                mut worker,
                mut waiting,
                turns,
            } => {
                let mut events = Vec::new();
                while !waiting.is_empty() {
                    match given(&*turns, &waiting) {
                        // A disk that does not answer.
                        0 => return events,
                        jobs => events.extend(worker.turn(waiting.drain(..jobs))),
                    }
                }
                events.extend(worker.finish());
                events
            }
        }
    }
}

/// How many of the jobs that wait are done now.
fn given(turns: &dyn Fn(usize) -> usize, waiting: &VecDeque<Job>) -> usize {
    match waiting.len() {
        0 => 0,
        jobs => turns(jobs).min(jobs),
    }
}

impl Worker {
    /// Does jobs, and writes their events together.
    fn turn(&mut self, jobs: impl Iterator<Item = Job>) -> Vec<SaveEvent> {
        let mut events: Vec<SaveEvent> = jobs.flat_map(|job| self.work(job)).collect();
        events.extend(self.save());
        events
    }

    /// Does a job; [`Self::save`] must follow.
    fn work(&mut self, job: Job) -> Vec<SaveEvent> {
        match job {
            Job::Append(at, event) => {
                self.queue(at, event);
                Vec::new()
            }
            Job::Retry => {
                if !self.broken {
                    return Vec::new();
                }
                match self.journal.new_segment() {
                    Ok(()) => {
                        self.broken = false;
                        Vec::new()
                    }
                    Err(error) => vec![SaveEvent::Failed(error.to_string())],
                }
            }
            Job::TelemetryBegin {
                trial,
                attempt,
                interval,
            } => {
                let mut events = self.end_telemetry();
                let file = self.folder.telemetry_of(trial, attempt, interval);
                let file = file.map_err(|error| error.to_string());
                events.extend(file.as_ref().err().cloned().map(SaveEvent::TelemetryLost));
                self.telemetry = Some(Telemetry {
                    of: (trial, attempt, interval),
                    file,
                });
                events
            }
            Job::Telemetry(samples) => {
                let Some(telemetry) = &mut self.telemetry else {
                    return Vec::new();
                };
                let written = match &mut telemetry.file {
                    Ok(file) => file.write(&samples),
                    Err(_) => return Vec::new(),
                };
                match written {
                    Ok(()) => Vec::new(),
                    Err(error) => {
                        telemetry.file = Err(error.to_string());
                        vec![SaveEvent::TelemetryLost(error.to_string())]
                    }
                }
            }
            Job::TelemetryEnd => self.end_telemetry(),
            Job::KeepConsent(copy) => {
                self.consent = Some(copy);
                Vec::new()
            }
        }
    }

    /// Queues an event. The end of a playback also says what became of its telemetry.
    fn queue(&mut self, at: Moment, mut event: Event) {
        if let Event::PlaybackEnded {
            trial,
            attempt,
            telemetry,
            interval,
            ..
        } = &mut event
            && let Some(ended) = self.ended.take()
            && ended.of == (*trial, *attempt, *interval)
        {
            match ended.file {
                Ok(file) => *telemetry = Some(file),
                Err(reason) => self.unsaved.push_back(Unsaved {
                    at,
                    event: Event::TelemetryLost {
                        trial: *trial,
                        attempt: *attempt,
                        reason,
                        interval: *interval,
                    },
                    awaited: false,
                }),
            }
        }
        self.unsaved.push_back(Unsaved {
            at,
            event,
            awaited: true,
        });
    }

    /// Writes every unsaved event, unless an earlier write failed.
    fn save(&mut self) -> Vec<SaveEvent> {
        if self.broken || self.unsaved.is_empty() {
            return Vec::new();
        }
        if let Err(error) = self.settle_consent() {
            self.broken = true;
            return vec![SaveEvent::Failed(error.to_string())];
        }
        let events: Vec<(Moment, &Event)> = self.unsaved.iter().map(|u| (u.at, &u.event)).collect();
        match self.journal.append_all(&events) {
            Ok(_) => {
                let saved = self.unsaved.drain(..).filter(|u| u.awaited);
                saved.map(|_| SaveEvent::Saved).collect()
            }
            Err(error) => {
                self.broken = true;
                vec![SaveEvent::Failed(error.to_string())]
            }
        }
    }

    /// Writes the copy of the consent document, or removes one from before a crash whose participant
    /// refuses now.
    fn settle_consent(&mut self) -> Result<(), StoreError> {
        if let Some(copy) = &self.consent {
            self.folder.keep_consent(copy)?;
            self.consent = None;
        }
        let refuses = |u: &Unsaved| {
            matches!(
                u.event,
                Event::Consented {
                    accepted: false,
                    ..
                }
            )
        };
        match self.unsaved.iter().any(refuses) {
            true => self.folder.drop_consent(),
            false => Ok(()),
        }
    }

    /// Finishes the telemetry file.
    fn end_telemetry(&mut self) -> Vec<SaveEvent> {
        let Some(Telemetry { of, file }) = self.telemetry.take() else {
            return Vec::new();
        };
        let mut events = Vec::new();
        let file = file.and_then(|file| {
            file.finish().map_err(|error| {
                events.push(SaveEvent::TelemetryLost(error.to_string()));
                error.to_string()
            })
        });
        self.ended = Some(Ended { of, file });
        events
    }

    /// Finishes what is under way, and writes the receipt if it can be written.
    fn finish(mut self) -> Vec<SaveEvent> {
        let mut events = self.end_telemetry();
        events.extend(self.save());
        let receipt = self.journal.receipt();
        events.extend(receipt.ok().flatten().map(SaveEvent::Left));
        events
    }
}
