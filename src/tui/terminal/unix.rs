//! Signals and hang-up detection on Unix.

use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::process::{Signal, getpid, kill_process};
use signal_hook::SigId;
use signal_hook::consts::{SIGCONT, SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::low_level::signal_name;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Whether this platform can guarantee that a session ends in order.
pub(super) const SUPPORTED: bool = true;

/// True while no terminal is open: the terminating signals then have their default
/// effect. Their handlers stay registered until the process ends.
static IDLE: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Signals while a terminal is open: the terminating ones only set a flag, so that
/// the session can stop the device and close its journal first.
pub(super) struct Signals {
    terminating: Arc<AtomicUsize>,
    continued: Arc<AtomicBool>,
    registered: Vec<SigId>,
}

impl Signals {
    pub(super) fn register() -> io::Result<Self> {
        let mut signals = Self {
            terminating: Arc::default(),
            continued: Arc::default(),
            registered: Vec::new(),
        };
        let first = IDLE.get().is_none();
        let idle = IDLE.get_or_init(Arc::default);
        idle.store(false, Ordering::SeqCst);
        for number in [SIGHUP, SIGINT, SIGQUIT, SIGTERM] {
            if first {
                signal_hook::flag::register_conditional_default(number, Arc::clone(idle))?;
            }
            let value = usize::try_from(number).unwrap_or(0);
            let flag = Arc::clone(&signals.terminating);
            let id = signal_hook::flag::register_usize(number, flag, value)?;
            signals.registered.push(id);
        }
        let id = signal_hook::flag::register(SIGCONT, Arc::clone(&signals.continued))?;
        signals.registered.push(id);
        Ok(signals)
    }

    /// The name of a terminating signal that has arrived, once.
    pub(super) fn take(&self) -> Option<&'static str> {
        let number = i32::try_from(self.terminating.swap(0, Ordering::SeqCst));
        signal_name(number.ok()?)
    }

    /// Whether the program was stopped and continued since the last call.
    pub(super) fn take_continued(&self) -> bool {
        self.continued.swap(false, Ordering::SeqCst)
    }
}

impl Drop for Signals {
    fn drop(&mut self) {
        for id in self.registered.drain(..) {
            signal_hook::low_level::unregister(id);
        }
        if let Some(idle) = IDLE.get() {
            idle.store(true, Ordering::SeqCst);
        }
    }
}

/// Stops the program until its shell continues it.
pub(super) fn suspend() -> io::Result<()> {
    Ok(kill_process(getpid(), Signal::TSTP)?)
}

/// Whether the other end of the terminal is closed. SIGHUP may be ignored, and
/// reading would not report it.
pub(super) fn hung_up() -> bool {
    let (stdin, stdout) = (io::stdin(), io::stdout());
    let gone = PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL;
    let mut ends = [
        PollFd::new(&stdin, PollFlags::empty()),
        PollFd::new(&stdout, PollFlags::empty()),
    ];
    let polled = rustix::event::poll(&mut ends, Some(&Timespec::default()));
    polled.is_ok() && ends.iter().any(|end| end.revents().intersects(gone))
}

/// Lets a write past the limit of the file size fail with an error instead of ending
/// the program. If the handler cannot be set, such a write ends the program.
pub(crate) fn survive_file_size_limit() {
    let _ = signal_hook::flag::register(Signal::XFSZ.as_raw(), Arc::new(AtomicBool::new(false)));
}
