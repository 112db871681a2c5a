//! Saving, away from the loop: journal and telemetry of one session.
//!
//! Jobs are done in order. An event is acknowledged by [`Word::Saved`] after its
//! line is on disk, in the order of the events. After a failed write nothing is
//! acknowledged, and nothing is forgotten, until [`Job::Retry`] has put every
//! event in doubt into a new segment of the journal. Telemetry that cannot be
//! written is dropped and told of: no answer waits for it.

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
pub enum Word {
    /// The next event in order is on disk.
    Saved,
    /// An event is not; why, and what to do.
    Failed(String),
    /// The telemetry of the attempt is not; the answers are.
    TelemetryLost(String),
}

/// The saver of one session; holds its folder, and so its lock.
pub struct Saver {
    way: Way,
}

enum Way {
    Inline {
        worker: Box<Worker>,
        words: Vec<Word>,
    },
    Thread {
        jobs: Sender<Job>,
        words: Receiver<Word>,
        handle: JoinHandle<()>,
        /// Whether its early end has been told.
        told: bool,
    },
}

struct Worker {
    folder: SessionFolder,
    journal: Journal,
    telemetry: Option<TelemetryWriter>,
    doubtful: VecDeque<(Moment, Event)>,
    broken: bool,
}

impl Saver {
    /// A saver for a claimed folder, on a thread of its own or in the caller's.
    pub fn new(folder: SessionFolder, journal: Journal, threaded: bool) -> Self {
        let mut worker = Box::new(Worker {
            folder,
            journal,
            telemetry: None,
            doubtful: VecDeque::new(),
            broken: false,
        });
        let way = if threaded {
            let (jobs, todo) = channel();
            let (say, words) = channel();
            let handle = std::thread::spawn(move || {
                while let Ok(job) = todo.recv() {
                    for word in worker.work(job) {
                        // A loop that is gone needs no words; the work goes on.
                        let _ = say.send(word);
                    }
                }
                // Nobody is left to tell.
                let _ = worker.end_telemetry();
            });
            Way::Thread {
                jobs,
                words,
                handle,
                told: false,
            }
        } else {
            Way::Inline {
                worker,
                words: Vec::new(),
            }
        };
        Self { way }
    }

    /// Hands over a job.
    pub fn send(&mut self, job: Job) {
        match &mut self.way {
            Way::Inline { worker, words } => words.extend(worker.work(job)),
            Way::Thread { jobs, .. } => {
                // The thread only ends before us by a panic; then no word comes
                // back, and nothing is shown as saved.
                let _ = jobs.send(job);
            }
        }
    }

    /// What has been said since the last call.
    pub fn words(&mut self) -> Vec<Word> {
        match &mut self.way {
            Way::Inline { words, .. } => std::mem::take(words),
            Way::Thread {
                words,
                handle,
                told,
                ..
            } => {
                let mut said: Vec<Word> = words.try_iter().collect();
                if handle.is_finished() && !*told {
                    *told = true;
                    said.push(Word::Failed("the thread that saves has ended".to_owned()));
                }
                said
            }
        }
    }

    /// Does what is left and closes the folder.
    pub fn finish(self) {
        match self.way {
            Way::Inline { mut worker, .. } => {
                // Nobody is left to tell.
                let _ = worker.end_telemetry();
            }
            Way::Thread { jobs, handle, .. } => {
                drop(jobs);
                // A panic in it has been reported by the hook.
                let _ = handle.join();
            }
        }
    }
}

impl Worker {
    fn work(&mut self, job: Job) -> Vec<Word> {
        match job {
            Job::Append(at, event) => {
                self.doubtful.push_back((at, event));
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
                    Err(error) => vec![Word::Failed(error.to_string())],
                }
            }
            Job::TelemetryBegin { trial, attempt } => {
                let mut words = self.end_telemetry();
                match self.folder.telemetry(trial, attempt) {
                    Ok(telemetry) => {
                        self.telemetry = Some(telemetry);
                    }
                    Err(error) => words.push(Word::TelemetryLost(error.to_string())),
                }
                words
            }
            Job::Telemetry(samples) => {
                let Some(telemetry) = &mut self.telemetry else {
                    return Vec::new();
                };
                match telemetry.write(&samples) {
                    Ok(()) => Vec::new(),
                    Err(error) => {
                        self.telemetry = None;
                        vec![Word::TelemetryLost(error.to_string())]
                    }
                }
            }
            Job::TelemetryEnd => self.end_telemetry(),
        }
    }

    fn append(&mut self) -> Vec<Word> {
        let mut words = Vec::new();
        while let Some((at, event)) = self.doubtful.front() {
            match self.journal.append(*at, event) {
                Ok(_) => {
                    self.doubtful.pop_front();
                    words.push(Word::Saved);
                }
                Err(error) => {
                    self.broken = true;
                    words.push(Word::Failed(error.to_string()));
                    break;
                }
            }
        }
        words
    }

    /// Telemetry is evidence, not an answer: no answer waits for it, and a file cut
    /// short shows beside the number of samples in the journal.
    fn end_telemetry(&mut self) -> Vec<Word> {
        match self.telemetry.take().map(TelemetryWriter::finish) {
            Some(Err(error)) => vec![Word::TelemetryLost(error.to_string())],
            Some(Ok(())) | None => Vec::new(),
        }
    }
}
