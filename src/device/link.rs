//! Bytes to a device and back, and a thread that looks after them.
//!
//! A [`Link`] is read and written in bounded time; every error but a time-out is its
//! end, and a new one is opened. [`Threaded`] runs the host's side of the wire
//! beside a link on a thread of its own: heartbeats do not wait for a screen, and no
//! screen waits for a device. The thread sends heartbeats only while the screen's
//! loop polls. [`memory`] is a link without a port, in virtual time.

pub mod memory;
pub mod pty;

use super::host::{Health, Host, Settings};
use super::{Device, DeviceError, Identity, Report, Stimulus};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use study_base::limits::Limits;
use study_haptics::model::Realization;
use study_wire::message;

/// A link that has ended.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct LinkError(pub String);

/// Bytes both ways.
pub trait Link: Send {
    /// Waits at most about `wait` for bytes; how many came, possibly none.
    ///
    /// # Errors
    /// [`LinkError`]: the link has ended.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, LinkError>;

    /// Writes all bytes, in bounded time.
    ///
    /// # Errors
    /// [`LinkError`]: the link has ended, or takes no bytes.
    fn write(&mut self, bytes: &[u8]) -> Result<(), LinkError>;
}

/// Opens links to one device, again and again.
pub trait Opener: Send {
    /// A new link.
    ///
    /// # Errors
    /// [`LinkError`]: there is none at the moment.
    fn open(&mut self) -> Result<Box<dyn Link>, LinkError>;

    /// Where it leads to, for messages.
    fn place(&self) -> String;
}

/// How long one turn of the thread waits for bytes.
const SLICE: Duration = Duration::from_millis(1);
/// Between two attempts to open a link.
const OPEN_AGAIN: Duration = Duration::from_millis(250);
/// How long a device may take to introduce itself when a session is opened.
const FIRST_WITHIN: Duration = Duration::from_secs(3);
/// How long the thread may go on once nobody wants anything of it.
const LAST_WORDS: Duration = Duration::from_millis(30);

/// What the thread is told.
enum Command {
    Load(Box<Order>),
    Start,
    Stop,
    Limp,
}

struct Order {
    table: Realization,
    permitted: bool,
    limits: Limits,
}

/// What both threads see.
struct Shared {
    origin: Instant,
    /// When the screen's loop was last alive, ns since `origin`.
    fed_ns: AtomicU64,
    closing: AtomicBool,
    facts: Mutex<Facts>,
}

/// What is known of the device.
#[derive(Debug, Clone, Default)]
pub struct Facts {
    /// As it introduced itself last.
    pub device: Option<message::Identity>,
    /// The same for a session.
    pub identity: Option<Identity>,
    /// How the link is; brought up to date about once a second.
    pub health: Health,
    /// Why there is no link, or no answer.
    pub trouble: Option<String>,
}

impl Shared {
    fn now(&self) -> Duration {
        self.origin.elapsed()
    }

    fn feed(&self) {
        let ns = u64::try_from(self.now().as_nanos()).unwrap_or(u64::MAX);
        self.fed_ns.store(ns, Ordering::Relaxed);
    }

    fn facts(&self) -> MutexGuard<'_, Facts> {
        self.facts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A device behind a link that a thread looks after.
pub struct Threaded {
    shared: Arc<Shared>,
    commands: Sender<(u64, Command)>,
    reports: Receiver<(u64, Report)>,
    /// Counts the limps: what was said before the last one is old.
    epoch: u64,
    thread: Option<JoinHandle<()>>,
    identity: Identity,
    /// Whether the end of the thread has been told.
    told: bool,
}

impl Threaded {
    /// Opens the first link and waits until the device has introduced itself. Zero
    /// force is the first thing that it is told.
    ///
    /// # Errors
    /// [`DeviceError::Lost`] if there is no link, no answer or another version.
    pub fn open(mut opener: Box<dyn Opener>, settings: Settings) -> Result<Self, DeviceError> {
        let place = opener.place();
        let lost = |why: &str| DeviceError::Lost(format!("{place}: {why}"));
        let link = opener.open().map_err(|e| lost(&e.0))?;
        let shared = Arc::new(Shared {
            origin: Instant::now(),
            fed_ns: AtomicU64::new(0),
            closing: AtomicBool::new(false),
            facts: Mutex::new(Facts::default()),
        });
        let (commands, todo) = channel();
        let (say, reports) = channel();
        let theirs = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("device".to_owned())
            .spawn(move || {
                let mut keeper = Keeper {
                    host: Host::new(nonce(), settings),
                    shared: theirs,
                    todo,
                    say,
                    opener,
                    link: None,
                    again: Duration::ZERO,
                    noted: Duration::ZERO,
                    epoch: 0,
                };
                keeper.link(link);
                keeper.keep();
            })
            .map_err(|e| lost(&e.to_string()))?;
        let mut device = Self {
            shared,
            commands,
            reports,
            epoch: 0,
            thread: Some(thread),
            identity: nobody(),
            told: false,
        };
        device.introduce().map_err(|why| lost(&why))?;
        Ok(device)
    }

    fn introduce(&mut self) -> Result<(), String> {
        let start = Instant::now();
        while start.elapsed() < FIRST_WITHIN {
            if let Some(identity) = self.shared.facts().identity.clone() {
                self.identity = identity;
                return Ok(());
            }
            std::thread::sleep(SLICE);
        }
        let said = self.shared.facts().trouble.clone();
        Err(said.unwrap_or_else(|| "no device answers there".to_owned()))
    }

    /// What is known of the device and of the link.
    pub fn facts(&self) -> Facts {
        self.shared.facts().clone()
    }

    fn tell(&self, command: Command) -> Result<(), DeviceError> {
        let sent = self.commands.send((self.epoch, command));
        sent.map_err(|_| DeviceError::Lost(ENDED.to_owned()))
    }
}

/// Different for each start of the program: the time and the address space are.
fn nonce() -> u32 {
    use std::hash::{BuildHasher as _, RandomState};
    RandomState::new().hash_one(std::process::id()) as u32
}

/// Before a device has said who it is; never seen outside.
fn nobody() -> Identity {
    let limit = |value| study_base::limits::Limit::new(value).expect("a positive constant");
    Identity {
        id: String::new(),
        simulated: false,
        telemetry: false,
        limits: Limits {
            force_n: limit(1.0),
            velocity_mm_s: limit(1.0),
        },
    }
}

impl Device for Threaded {
    fn identity(&self) -> Identity {
        self.identity.clone()
    }

    /// What the device itself objects to comes as a [`Report::Fault`].
    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        _: Duration,
    ) -> Result<(), DeviceError> {
        self.shared.feed();
        let order = Order {
            table: what.need_table()?.clone(),
            permitted: what.permitted,
            limits,
        };
        self.tell(Command::Load(Box::new(order)))
    }

    fn start(&mut self, _: Duration) -> Result<(), DeviceError> {
        self.tell(Command::Start)
    }

    fn stop(&mut self, _: Duration) -> Result<(), DeviceError> {
        self.tell(Command::Stop)
    }

    fn limp(&mut self, _: Duration) {
        // what is still said of the playback so far is not heard any more
        self.epoch += 1;
        // a thread that has ended has left the device limp
        let _ = self.tell(Command::Limp);
    }

    fn poll(&mut self, _: Duration) -> Vec<Report> {
        self.shared.feed();
        let ended = self.thread.as_ref().is_none_or(JoinHandle::is_finished);
        let now = self.epoch;
        let heard = self.reports.try_iter();
        let mut reports: Vec<Report> = heard
            .filter(|(epoch, report)| *epoch == now || lasting(report))
            .map(|(_, report)| report)
            .collect();
        if ended && !self.told {
            self.told = true;
            reports.push(Report::Lost(ENDED.to_owned()));
        }
        reports
    }
}

impl Drop for Threaded {
    /// Also while a panic unwinds. The thread makes the device limp and ends.
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            // a panic in it has been reported by the hook
            let _ = thread.join();
        }
    }
}

const ENDED: &str = "the thread that talks to it has ended";

/// Whether a report outlives a limp.
fn lasting(report: &Report) -> bool {
    matches!(report, Report::Fault(_) | Report::Lost(_) | Report::Ready)
}

/// The thread's own.
struct Keeper {
    host: Host,
    shared: Arc<Shared>,
    todo: Receiver<(u64, Command)>,
    say: Sender<(u64, Report)>,
    opener: Box<dyn Opener>,
    link: Option<Box<dyn Link>>,
    /// When a link is opened again.
    again: Duration,
    /// When the facts were last brought up to date.
    noted: Duration,
    epoch: u64,
}

impl Keeper {
    fn keep(&mut self) {
        loop {
            let closing = self.shared.closing.load(Ordering::SeqCst);
            if closing {
                return self.close();
            }
            self.obey();
            let fed = Duration::from_nanos(self.shared.fed_ns.load(Ordering::Relaxed));
            self.host.fed(fed);
            self.turn();
            self.note();
            for report in self.host.take_reports() {
                if let Report::Lost(why) = &report {
                    self.shared.facts().trouble = Some(why.clone());
                }
                if self.say.send((self.epoch, report)).is_err() {
                    return self.close();
                }
            }
        }
    }

    fn link(&mut self, link: Box<dyn Link>) {
        self.link = Some(link);
        self.host.linked(self.shared.now());
        self.write();
    }

    /// Reads for a slice, lets the host work, writes.
    fn turn(&mut self) {
        let Some(link) = &mut self.link else {
            std::thread::sleep(SLICE);
            return self.open_again();
        };
        let mut buffer = [0; 4096];
        match link.read(&mut buffer, SLICE) {
            Ok(n) => {
                let now = self.shared.now();
                self.host.receive(&buffer[..n], now);
                self.host.advance(now);
                self.write();
            }
            Err(why) => self.unlink(&why),
        }
    }

    fn write(&mut self) {
        let bytes = self.host.take_output();
        if let (false, Some(link)) = (bytes.is_empty(), &mut self.link)
            && let Err(why) = link.write(&bytes)
        {
            self.unlink(&why);
        }
    }

    fn unlink(&mut self, why: &LinkError) {
        self.link = None;
        self.host.unlinked(&why.0);
        self.shared.facts().trouble = Some(why.0.clone());
        self.again = self.shared.now() + OPEN_AGAIN;
    }

    fn open_again(&mut self) {
        if self.shared.now() < self.again {
            return;
        }
        match self.opener.open() {
            Ok(link) => self.link(link),
            Err(_) => self.again = self.shared.now() + OPEN_AGAIN,
        }
    }

    fn obey(&mut self) {
        while let Ok((epoch, command)) = self.todo.try_recv() {
            // what was said before belongs to the time before
            for report in self.host.take_reports() {
                let _ = self.say.send((self.epoch, report));
            }
            self.epoch = epoch;
            let now = self.shared.now();
            let done = match command {
                Command::Load(order) => {
                    let stimulus = Stimulus {
                        permitted: order.permitted,
                        ..Stimulus::of_table(&order.table)
                    };
                    self.host.load(&stimulus, order.limits, now)
                }
                Command::Start => self.host.start(now),
                Command::Stop => self.host.stop(now),
                Command::Limp => {
                    self.host.limp(now);
                    Ok(())
                }
            };
            if let Err(why) = done {
                let report = match why {
                    DeviceError::Lost(why) => Report::Lost(why),
                    why => Report::Fault(why.to_string()),
                };
                let _ = self.say.send((self.epoch, report));
            }
            self.write();
        }
    }

    fn note(&mut self) {
        let now = self.shared.now();
        let mut facts = self.shared.facts();
        if let Some(why) = self.host.trouble()
            && facts.trouble.is_none()
        {
            facts.trouble = Some(why.to_owned());
        }
        let first = facts.identity.is_none() && self.host.identity().is_some();
        if first || now.saturating_sub(self.noted) > Duration::from_secs(1) {
            self.noted = now;
            facts.device = self.host.device().copied();
            facts.identity = self.host.identity();
            facts.health = self.host.health().clone();
        }
    }

    /// Zero force, and a moment for it to arrive.
    fn close(&mut self) {
        self.host.limp(self.shared.now());
        self.write();
        let until = self.shared.now() + LAST_WORDS;
        let mut buffer = [0; 512];
        while let Some(link) = &mut self.link
            && self.shared.now() < until
        {
            // an answer says that it was heard
            match link.read(&mut buffer, SLICE) {
                Ok(0) => {}
                Ok(_) | Err(_) => return,
            }
        }
    }
}

impl Drop for Keeper {
    /// A panic of this thread: the device is told to be limp, if anything still goes.
    fn drop(&mut self) {
        if std::thread::panicking()
            && let Some(link) = &mut self.link
        {
            let _ = link.write(message::Request::Limp.frame(0).as_bytes());
        }
    }
}
