//! Signals and hang-up detection on Unix.
//!
//! A signal from outside that would end the program only sets a flag, so that the session
//! can end in order. A signal of a failure in the program itself, such as SIGABRT, leaves
//! no time for that: its handler restores the terminal and lets the signal end the program.

use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::process::{Signal, getpid, kill_process};
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};
use signal_hook::SigId;
use signal_hook::consts::{
    SIGABRT, SIGALRM, SIGBUS, SIGCONT, SIGFPE, SIGHUP, SIGILL, SIGINT, SIGPROF, SIGQUIT, SIGSYS,
    SIGTERM, SIGTRAP, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU,
};
use signal_hook::low_level::{emulate_default_handler, signal_name};
use std::io;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Signals that end a session in order.
const ENDING: [i32; 9] = [
    SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF,
];
/// Signals of a failure in the program, or of the end of its time. SIGSEGV is left to the
/// runtime library, which reports a stack overflow and then aborts.
const FAILING: [i32; 7] = [SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGSYS, SIGXCPU];

/// What restores the screen: end of an update, mouse and paste off, colors reset, main
/// screen, cursor shown.
const RESTORED: &[u8] =
    b"\x1b[?2026l\x1b[?1006l\x1b[?1015l\x1b[?1003l\x1b[?1002l\x1b[?1000l\x1b[?2004l\x1b[0m\x1b[?1049l\x1b[?25h";

/// The settings of the terminal before it was taken.
static BEFORE: OnceLock<Termios> = OnceLock::new();

/// True while no terminal is open: the terminating signals then have their default
/// effect. Their handlers stay registered until the process ends.
static IDLE: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Signals while a terminal is open: the terminating ones only set a flag, so that
/// the session can stop the device and close its journal first.
pub(crate) struct Signals {
    terminating: Arc<AtomicUsize>,
    continued: Arc<AtomicBool>,
    registered: Vec<SigId>,
}

impl Signals {
    pub(crate) fn register() -> io::Result<Self> {
        let mut signals = Self {
            terminating: Arc::default(),
            continued: Arc::default(),
            registered: Vec::new(),
        };
        let first = IDLE.get().is_none();
        let idle = IDLE.get_or_init(Arc::default);
        idle.store(false, Ordering::SeqCst);
        for number in ENDING {
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
    pub(crate) fn take(&self) -> Option<&'static str> {
        let number = i32::try_from(self.terminating.swap(0, Ordering::SeqCst));
        signal_name(number.ok()?)
    }

    /// Whether the program was stopped and continued since the last call.
    pub(crate) fn take_continued(&self) -> bool {
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

/// Remembers the settings of the terminal, and restores them when the program fails.
/// `taken` tells whether the terminal is in use.
pub(super) fn restore_on_failure(taken: &'static AtomicBool) -> io::Result<()> {
    if BEFORE.get().is_some() {
        return Ok(());
    }
    let before = tcgetattr(rustix::stdio::stdin())?;
    if BEFORE.set(before).is_ok() {
        for signal in FAILING {
            on_failure(signal, taken)?;
        }
    }
    Ok(())
}

#[allow(unsafe_code, reason = "a signal handler")]
fn on_failure(signal: i32, taken: &'static AtomicBool) -> io::Result<()> {
    let handler = move || {
        if taken.swap(false, Ordering::SeqCst) {
            restore_now();
        }
        // The signal has its default effect: it ends the program.
        let _ = emulate_default_handler(signal);
        signal_hook::low_level::abort();
    };
    // SAFETY: the handler only uses atomics and system calls that are safe in a handler
    // (tcsetattr, poll, write, sigaction, raise); it neither allocates nor locks. It never
    // returns to an instruction that has failed, which SIGFPE and SIGILL require.
    unsafe { signal_hook_registry::register_signal_unchecked(signal, handler) }?;
    Ok(())
}

/// Restores the terminal by system calls alone. A terminal that does not read is left as
/// it is: a write to it would wait.
fn restore_now() {
    if let Some(before) = BEFORE.get() {
        let _ = tcsetattr(rustix::stdio::stdin(), OptionalActions::Now, before);
    }
    let out = rustix::stdio::stdout();
    let mut ends = [PollFd::new(&out, PollFlags::OUT)];
    let polled = rustix::event::poll(&mut ends, Some(&Timespec::default()));
    if polled.is_ok() && ends[0].revents().contains(PollFlags::OUT) {
        let _ = rustix::io::write(out, RESTORED);
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

/// Whether the terminal can position text; what it calls itself, if not.
pub(super) fn positions_text() -> Result<(), String> {
    match std::env::var("TERM").unwrap_or_default() {
        term if term.is_empty() || term == "dumb" => Err(term),
        _ => Ok(()),
    }
}

/// Lets a write past the limit of the file size fail with an error instead of ending
/// the program. If the handler cannot be set, such a write ends the program.
pub(crate) fn survive_file_size_limit() {
    let _ = signal_hook::flag::register(Signal::XFSZ.as_raw(), Arc::new(AtomicBool::new(false)));
}
