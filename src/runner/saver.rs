//! Saving, away from the loop: journal and telemetry of one session.
//!
//! Jobs are done in order. An event is acknowledged by [`SaveEvent::Saved`] after its
//! line is on disk, in the order of the events. After a failed write nothing is
//! acknowledged, and nothing is forgotten, until [`Job::Retry`] has put every
//! event in doubt into a new segment of the journal. Telemetry that cannot be
//! written is dropped and reported of: no answer waits for it.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use study_core::outcome::{Event, Moment, Sample};
use study_core::store::{Journal, SessionFolder, TelemetryWriter};

/// Something to write.
#[derive(Debug)]
pub enum Job {
    /// An event, with the moment it happened.
    Append(Moment, Event),
    /// The telemetry of this attempt begins.
    TelemetryBegin {
        /// Names the file.
        trial: u32,
        /// Names the file.
        attempt: u32,
    },
    /// Samples of the attempt that has begun.
    Telemetry(Vec<Sample>),
    /// It is over.
    TelemetryEnd,
    /// Put what is in doubt into a new segment.
    Retry,
}

/// What the saver says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SaveEvent {
    /// The next event in order is on disk.
    Saved,
    /// An event is not; why, and what to do.
    Failed(String),
    /// The telemetry of the attempt is not; the answers are.
    TelemetryLost(String),
}

/// The saver of one session; holds its folder, and so its lock.
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
        /// Whether its early end has been reported.
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
    /// A saver for a claimed folder, on a thread of its own or in the caller's.
    pub fn new(folder: SessionFolder, journal: Journal, threaded: bool) -> Self {
        let mut worker = Box::new(Worker {
            folder,
            journal,
            telemetry: None,
            unsaved: VecDeque::new(),
            broken: false,
        });
        let mode = if threaded {
            let (jobs, todo) = channel();
            let (say, events) = channel();
            let handle = std::thread::spawn(move || {
                while let Ok(job) = todo.recv() {
                    for event in worker.work(job) {
                        // A loop that is gone needs no events; the work goes on.
                        let _ = say.send(event);
                    }
                }
                // Nobody is left to tell.
                let _ = worker.end_telemetry();
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

    /// Hands over a job.
    pub fn send(&mut self, job: Job) {
        match &mut self.mode {
            Mode::Inline { worker, events } => events.extend(worker.work(job)),
            Mode::Thread { jobs, .. } => {
                // The thread only ends before us by a panic; then no event comes
                // back, and nothing is shown as saved.
                let _ = jobs.send(job);
            }
        }
    }

    /// What has been said since the last call.
    pub fn drain(&mut self) -> Vec<SaveEvent> {
        match &mut self.mode {
            Mode::Inline { events, .. } => std::mem::take(events),
            Mode::Thread {
                events,
                handle,
                reported,
                ..
            } => {
                let mut said: Vec<SaveEvent> = events.try_iter().collect();
                if handle.is_finished() && !*reported {
                    *reported = true;
                    said.push(SaveEvent::Failed(
                        "the thread that saves has ended".to_owned(),
                    ));
                }
                said
            }
        }
    }

    /// Does what is left and closes the folder.
    pub fn finish(self) {
        match self.mode {
            Mode::Inline { mut worker, .. } => {
                // Nobody is left to tell.
                let _ = worker.end_telemetry();
            }
            Mode::Thread { jobs, handle, .. } => {
                drop(jobs);
                // A panic in it has been reported by the hook.
                let _ = handle.join();
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

    /// Telemetry is evidence, not an answer: no answer waits for it, and a file cut
    /// short shows beside the number of samples in the journal.
    fn end_telemetry(&mut self) -> Vec<SaveEvent> {
        match self.telemetry.take().map(TelemetryWriter::finish) {
            Some(Err(error)) => vec![SaveEvent::TelemetryLost(error.to_string())],
            Some(Ok(())) | None => Vec::new(),
        }
    }
}
