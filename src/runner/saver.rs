//! Saves journal and telemetry of one session outside the session loop.
//!
//! Jobs are done in order. [`SaveEvent::Saved`] acknowledges an event after its line is
//! on disk, in the order of the events. After a failed write nothing is acknowledged
//! and nothing is lost until [`Job::Retry`] has written every unsaved event into a new
//! segment of the journal. Telemetry that cannot be written is dropped and reported: no
//! answer waits for it.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;
use study_core::outcome::{Event, Moment, Sample};
use study_core::store::{Journal, SessionFolder, TelemetryWriter};

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
    },
    /// Write samples of that attempt.
    Telemetry(Vec<Sample>),
    /// Finish the telemetry file.
    TelemetryEnd,
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
}

struct Worker {
    folder: SessionFolder,
    journal: Journal,
    telemetry: Option<TelemetryWriter>,
    unsaved: VecDeque<(Moment, Event)>,
    broken: bool,
}

impl Saver {
    /// A saver for a claimed folder, on its own thread or on that of the caller.
    pub fn new(folder: SessionFolder, journal: Journal, threaded: bool) -> Self {
        let mut worker = Box::new(Worker {
            folder,
            journal,
            telemetry: None,
            unsaved: VecDeque::new(),
            broken: false,
        });
        let mode = if threaded {
            let (jobs, queue) = channel();
            let (send, events) = channel();
            let handle = std::thread::spawn(move || {
                while let Ok(job) = queue.recv() {
                    for event in worker.work(job) {
                        // The work goes on even if the session loop has ended.
                        let _ = send.send(event);
                    }
                }
                for event in worker.end_telemetry() {
                    let _ = send.send(event);
                }
            });
            Mode::Thread {
                jobs,
                events,
                handle,
                reported: false,
            }
        } else {
            Mode::Inline {
                worker,
                events: Vec::new(),
            }
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
        }
    }

    /// Returns the events since the last call.
    pub fn drain(&mut self) -> Vec<SaveEvent> {
        match &mut self.mode {
            Mode::Inline { events, .. } => std::mem::take(events),
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
        }
    }

    /// Finishes all queued jobs and closes the folder; returns the last events. Gives up
    /// waiting for a disk that does not answer.
    pub fn finish(self) -> Vec<SaveEvent> {
        match self.mode {
            Mode::Inline {
                mut worker,
                mut events,
            } => {
                events.extend(worker.end_telemetry());
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
        }
    }
}

impl Worker {
    fn work(&mut self, job: Job) -> Vec<SaveEvent> {
        match job {
            Job::Append(at, event) => {
                self.unsaved.push_back((at, event));
                if self.broken {
                    return Vec::new();
                }
                self.append()
            }
            Job::Retry => {
                if !self.broken {
                    return Vec::new();
                }
                match self.journal.new_segment() {
                    Ok(()) => {
                        self.broken = false;
                        self.append()
                    }
                    Err(error) => vec![SaveEvent::Failed(error.to_string())],
                }
            }
            Job::TelemetryBegin { trial, attempt } => {
                let mut events = self.end_telemetry();
                match self.folder.telemetry(trial, attempt) {
                    Ok(telemetry) => {
                        self.telemetry = Some(telemetry);
                    }
                    Err(error) => events.push(SaveEvent::TelemetryLost(error.to_string())),
                }
                events
            }
            Job::Telemetry(samples) => {
                let Some(telemetry) = &mut self.telemetry else {
                    return Vec::new();
                };
                match telemetry.write(&samples) {
                    Ok(()) => Vec::new(),
                    Err(error) => {
                        self.telemetry = None;
                        vec![SaveEvent::TelemetryLost(error.to_string())]
                    }
                }
            }
            Job::TelemetryEnd => self.end_telemetry(),
        }
    }

    fn append(&mut self) -> Vec<SaveEvent> {
        let mut events = Vec::new();
        while let Some((at, event)) = self.unsaved.front() {
            match self.journal.append(*at, event) {
                Ok(_) => {
                    self.unsaved.pop_front();
                    events.push(SaveEvent::Saved);
                }
                Err(error) => {
                    self.broken = true;
                    events.push(SaveEvent::Failed(error.to_string()));
                    break;
                }
            }
        }
        events
    }

    /// Finishes the telemetry file. A truncated one is recognised by the number of
    /// samples in the journal.
    fn end_telemetry(&mut self) -> Vec<SaveEvent> {
        match self.telemetry.take().map(TelemetryWriter::finish) {
            Some(Err(error)) => vec![SaveEvent::TelemetryLost(error.to_string())],
            Some(Ok(())) | None => Vec::new(),
        }
    }
}
