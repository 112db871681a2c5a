//! Links to devices, and the thread that serves a link.
//!
//! A [`Link`] is read and written in bounded time. Every error ends the link, and a new
//! one is opened. [`LinkedDevice`] runs the [`Host`] on its own thread, so that
//! heartbeats do not wait for the user interface and the user interface does not wait
//! for the device. The thread sends heartbeats only while the user interface polls.
//! [`memory`] is a simulated line in virtual time; [`simulator`] a simulated device in real
//! time, at an address of this computer or, on Unix, on a pseudo-terminal (`pty`).
//! [`tcp`] is the host's end of a connection, and [`super::serial`] of a cable.

pub(crate) mod cable;
pub mod memory;
pub mod priority;
#[cfg(unix)]
pub mod pty;
#[cfg(unix)]
pub mod relay;
pub mod simulator;
pub mod tcp;

use super::host::{self, Health, Host, HostSettings};
use super::{Device, DeviceError, Identity, Report, Stimulus};
pub use priority::Priority;
use std::fmt::Display;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use study_base::limits::Limits;
use study_haptics::model::Realization;
use study_session::outcome::Playback;
use study_wire::message;

/// Why a link cannot be opened or has ended.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum LinkError {
    #[error("there is no such port")]
    NoSuchPort,
    #[error("no connected USB device has the serial number {0}")]
    NoSuchUsbSerial(String),
    #[error("permission denied; the user needs access to serial ports")]
    NoPermission,
    #[error("another program is using it")]
    InUse,
    #[error("it is not a serial port")]
    NotSerial,
    #[error("it does not support {0} baud")]
    BaudRate(u32),
    #[error("no device listens there")]
    NobodyListens,
    #[error("unplugged")]
    Unplugged,
    #[error("the port accepts no data")]
    WriteTimeout,
    #[error("the port fails: {0}")]
    System(String),
}

/// A byte stream in both directions.
pub trait Link: Send {
    /// Waits at most about `wait` for bytes and returns their number, possibly 0.
    ///
    /// # Errors
    /// [`LinkError`] if the link has ended.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, LinkError>;

    /// Writes all bytes in bounded time.
    ///
    /// # Errors
    /// [`LinkError`] if the link has ended or accepts no bytes.
    fn write(&mut self, bytes: &[u8]) -> Result<(), LinkError>;
}

/// Opens links to one device repeatedly.
pub trait Opener: Send {
    /// Opens a new link.
    ///
    /// # Errors
    /// [`LinkError`] if no link is available at the moment.
    fn open(&mut self) -> Result<Box<dyn Link>, LinkError>;

    /// Where the links lead, for messages.
    fn address(&self) -> String;

    /// The time that a byte takes, if the links have a rate; else zero.
    fn byte_time(&self) -> Duration {
        Duration::ZERO
    }
}

/// Longest single wait of the thread.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Time between two attempts to open a link.
const REOPEN_INTERVAL: Duration = Duration::from_millis(250);
/// Time that a device has to identify itself when a session opens.
const IDENTITY_TIMEOUT: Duration = Duration::from_secs(3);
/// Time that the thread waits for an answer to the last LIMP.
const CLOSE_TIMEOUT: Duration = Duration::from_millis(30);
/// Time between two updates of the status.
const STATUS_INTERVAL: Duration = Duration::from_secs(1);

/// A command to the thread.
enum Command {
    Load(Box<LoadOrder>),
    Start,
    Stop,
    Fade,
    Limp,
}

struct LoadOrder {
    table: Realization,
    allow_uncertified: bool,
    limits: Limits,
}

/// State shared by both threads.
struct Shared {
    origin: Instant,
    /// When the user interface last polled, ns since `origin`.
    alive_ns: AtomicU64,
    closing: AtomicBool,
    status: Mutex<DeviceStatus>,
}

/// What is known about the device.
#[derive(Debug, Clone, Default)]
pub struct DeviceStatus {
    /// Its last identification on the wire.
    pub device: Option<message::Identity>,
    /// The same for a session.
    pub identity: Option<Identity>,
    /// Quality of the link, updated about once per second.
    pub health: Health,
    /// Why there is no link or no answer.
    pub failure: Option<String>,
    /// How the thread that sends heartbeats is scheduled.
    pub priority: Priority,
}

impl Shared {
    fn now(&self) -> Duration {
        self.origin.elapsed()
    }

    fn keep_alive(&self) {
        let ns = u64::try_from(self.now().as_nanos()).unwrap_or(u64::MAX);
        self.alive_ns.store(ns, Ordering::Relaxed);
    }

    fn status(&self) -> MutexGuard<'_, DeviceStatus> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The thread that serves a link.
struct LinkThread {
    shared: Arc<Shared>,
    handle: Option<JoinHandle<()>>,
}

impl LinkThread {
    fn ended(&self) -> bool {
        self.handle.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Waits until the device has identified itself; `None` if it does not in time.
    fn wait_for_identity(&self) -> Option<Identity> {
        let start = Instant::now();
        while start.elapsed() < IDENTITY_TIMEOUT {
            let identity = self.shared.status().identity.clone();
            if identity.is_some() {
                return identity;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        None
    }
}

impl Drop for LinkThread {
    /// Makes the thread send LIMP and end, also while a panic unwinds.
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::SeqCst);
        if let Some(handle) = self.handle.take() {
            // A panic in the thread has been reported by the hook.
            let _ = handle.join();
        }
    }
}

/// A device behind a link that is served by a thread.
pub struct LinkedDevice {
    thread: LinkThread,
    commands: Sender<(u64, Command)>,
    reports: Receiver<(u64, Report)>,
    /// Number of LIMP commands; reports from before the last one are outdated.
    epoch: u64,
    identity: Identity,
    byte_time: Duration,
    /// Whether the end of the thread has been reported.
    end_reported: bool,
}

impl LinkedDevice {
    /// Opens the first link and waits until the device has identified itself. The first
    /// command that it receives is LIMP.
    ///
    /// # Errors
    /// [`DeviceError::Lost`] if there is no link, no answer, or an unsupported version.
    pub fn open(mut opener: Box<dyn Opener>, settings: HostSettings) -> Result<Self, DeviceError> {
        let address = opener.address();
        let byte_time = opener.byte_time();
        let lost = |why: &dyn Display| DeviceError::Lost(format!("{address}: {why}"));
        let link = opener.open().map_err(|e| lost(&e))?;
        let shared = Arc::new(Shared {
            origin: Instant::now(),
            alive_ns: AtomicU64::new(0),
            closing: AtomicBool::new(false),
            status: Mutex::new(DeviceStatus::default()),
        });
        let (commands, commands_in) = channel();
        let (reports_out, reports) = channel();
        let worker_shared = Arc::clone(&shared);
        let handle = std::thread::Builder::new()
            .name("device".to_owned())
            .spawn(move || {
                worker_shared.status().priority = priority::raise();
                let mut worker = LinkWorker {
                    host: Host::new(nonce(), settings),
                    shared: worker_shared,
                    commands_in,
                    reports_out,
                    opener,
                    link: None,
                    reopen_at: Duration::ZERO,
                    status_at: Duration::ZERO,
                    turn_at: Duration::ZERO,
                    epoch: 0,
                };
                worker.use_link(link);
                worker.run();
            })
            .map_err(|e| lost(&e))?;
        let thread = LinkThread {
            shared,
            handle: Some(handle),
        };
        let Some(identity) = thread.wait_for_identity() else {
            let failure = thread.shared.status().failure.clone();
            return Err(lost(
                &failure.as_deref().unwrap_or("no device answers there"),
            ));
        };
        Ok(Self {
            thread,
            commands,
            reports,
            epoch: 0,
            identity,
            byte_time,
            end_reported: false,
        })
    }

    /// What is known about the device and the link.
    pub fn status(&self) -> DeviceStatus {
        self.thread.shared.status().clone()
    }

    fn send(&self, command: Command) -> Result<(), DeviceError> {
        let sent = self.commands.send((self.epoch, command));
        sent.map_err(|_| DeviceError::Lost(THREAD_ENDED.to_owned()))
    }
}

/// A number for a connection that differs between runs of the program.
pub fn nonce() -> u32 {
    use std::hash::{BuildHasher as _, RandomState};
    RandomState::new().hash_one(std::process::id()) as u32
}

impl LinkedDevice {
    /// A simulated device has no clock of its own: it stands still while this computer does
    /// something else, which says nothing of a clock.
    fn without_clock(&self, report: Report) -> Report {
        match report {
            Report::Stopped(playback) if self.identity().simulated => Report::Stopped(Playback {
                time_ratio: None,
                ..playback
            }),
            other => other,
        }
    }
}

impl Device for LinkedDevice {
    fn identity(&self) -> Identity {
        self.identity.clone()
    }

    /// A refusal by the device itself follows as [`Report::Fault`].
    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        _: Duration,
    ) -> Result<(), DeviceError> {
        self.thread.shared.keep_alive();
        let order = LoadOrder {
            table: what.need_table()?.clone(),
            allow_uncertified: what.allow_uncertified,
            limits,
        };
        self.send(Command::Load(Box::new(order)))
    }

    fn load_time(&self, what: &Stimulus<'_>, limits: Limits) -> Option<Duration> {
        let status = self.status();
        let trip = status.health.trips.usual()?;
        host::load_time(&status.device?, what, limits, trip, self.byte_time)
    }

    fn start(&mut self, _: Duration) -> Result<(), DeviceError> {
        self.send(Command::Start)
    }

    fn stop(&mut self, _: Duration) -> Result<(), DeviceError> {
        self.send(Command::Stop)
    }

    fn fade(&mut self, _: Duration) -> Result<(), DeviceError> {
        self.send(Command::Fade)
    }

    fn limp(&mut self, _: Duration) {
        // Later reports about the present playback are discarded.
        self.epoch += 1;
        // A thread that has ended has left the device limp.
        let _ = self.send(Command::Limp);
    }

    fn poll(&mut self, _: Duration) -> Vec<Report> {
        self.thread.shared.keep_alive();
        // Checked first, so that all reports of an ended thread are received.
        let ended = self.thread.ended();
        let now = self.epoch;
        let mut reports: Vec<Report> = self
            .reports
            .try_iter()
            .filter(|(epoch, report)| *epoch == now || report.survives_limp())
            .map(|(_, report)| self.without_clock(report))
            .collect();
        if ended && !self.end_reported {
            self.end_reported = true;
            reports.push(Report::Lost(THREAD_ENDED.to_owned()));
        }
        reports
    }
}

const THREAD_ENDED: &str = "the program's device thread has ended";

/// The thread's side.
struct LinkWorker {
    host: Host,
    shared: Arc<Shared>,
    commands_in: Receiver<(u64, Command)>,
    reports_out: Sender<(u64, Report)>,
    opener: Box<dyn Opener>,
    link: Option<Box<dyn Link>>,
    /// When opening a link is tried again.
    reopen_at: Duration,
    /// Time of the last update of the status.
    status_at: Duration,
    /// Time of the last turn of the loop.
    turn_at: Duration,
    epoch: u64,
}

impl LinkWorker {
    fn run(&mut self) {
        loop {
            let closing = self.shared.closing.load(Ordering::SeqCst);
            if closing {
                return self.close();
            }
            self.run_commands();
            let alive_at = Duration::from_nanos(self.shared.alive_ns.load(Ordering::Relaxed));
            self.host.keep_alive(alive_at);
            self.transfer();
            self.update_status();
            for report in self.host.take_reports() {
                if let Report::Lost(why) = &report {
                    self.shared.status().failure = Some(why.clone());
                }
                if self.reports_out.send((self.epoch, report)).is_err() {
                    return self.close();
                }
            }
        }
    }

    fn use_link(&mut self, link: Box<dyn Link>) {
        self.link = Some(link);
        self.turn_at = self.shared.now();
        self.host.connected(self.turn_at);
        self.write();
    }

    /// Reads, lets the host process the bytes, writes its output.
    fn transfer(&mut self) {
        let Some(link) = &mut self.link else {
            std::thread::sleep(POLL_INTERVAL);
            return self.reopen();
        };
        let mut buffer = [0; 4096];
        match link.read(&mut buffer, POLL_INTERVAL) {
            Ok(n) => {
                let now = self.shared.now();
                let took = now.saturating_sub(self.turn_at);
                self.turn_at = now;
                self.host.was_late(took.saturating_sub(POLL_INTERVAL));
                self.host.receive(&buffer[..n], now);
                self.host.advance(now);
                self.write();
            }
            Err(why) => self.close_link(&why),
        }
    }

    fn write(&mut self) {
        let bytes = self.host.take_output();
        if let (false, Some(link)) = (bytes.is_empty(), &mut self.link)
            && let Err(why) = link.write(&bytes)
        {
            self.close_link(&why);
        }
    }

    fn close_link(&mut self, why: &LinkError) {
        self.link = None;
        let why = why.to_string();
        self.host.disconnected(&why);
        self.shared.status().failure = Some(why);
        self.reopen_at = self.shared.now() + REOPEN_INTERVAL;
    }

    fn reopen(&mut self) {
        if self.shared.now() < self.reopen_at {
            return;
        }
        match self.opener.open() {
            Ok(link) => self.use_link(link),
            Err(_) => self.reopen_at = self.shared.now() + REOPEN_INTERVAL,
        }
    }

    fn run_commands(&mut self) {
        while let Ok((epoch, command)) = self.commands_in.try_recv() {
            // Reports from before the command belong to the old epoch.
            for report in self.host.take_reports() {
                let _ = self.reports_out.send((self.epoch, report));
            }
            self.epoch = epoch;
            let now = self.shared.now();
            let done = match command {
                Command::Load(order) => {
                    let stimulus = Stimulus {
                        allow_uncertified: order.allow_uncertified,
                        ..Stimulus::of_table(&order.table)
                    };
                    self.host.load(&stimulus, order.limits, now)
                }
                Command::Start => self.host.start(now),
                Command::Stop => self.host.stop(now),
                Command::Fade => self.host.fade(now),
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
                let _ = self.reports_out.send((self.epoch, report));
            }
            self.write();
        }
    }

    fn update_status(&mut self) {
        let now = self.shared.now();
        let mut status = self.shared.status();
        if let Some(why) = self.host.failure()
            && status.failure.is_none()
        {
            status.failure = Some(why.to_owned());
        }
        let first = status.identity.is_none() && self.host.identity().is_some();
        if first || now.saturating_sub(self.status_at) > STATUS_INTERVAL {
            self.status_at = now;
            status.device = self.host.device().copied();
            status.identity = self.host.identity();
            status.health = self.host.health().clone();
        }
    }

    /// Sends LIMP and waits a moment for the answer.
    fn close(&mut self) {
        self.host.limp(self.shared.now());
        self.write();
        let until = self.shared.now() + CLOSE_TIMEOUT;
        let mut buffer = [0; 512];
        while let Some(link) = &mut self.link
            && self.shared.now() < until
        {
            // An answer confirms that LIMP was received.
            match link.read(&mut buffer, POLL_INTERVAL) {
                Ok(0) => {}
                Ok(_) | Err(_) => return,
            }
        }
    }
}

impl Drop for LinkWorker {
    /// If this thread panics, LIMP is sent directly.
    fn drop(&mut self) {
        if std::thread::panicking()
            && let Some(link) = &mut self.link
        {
            let _ = link.write(message::Request::Limp.frame(0).as_bytes());
        }
    }
}
