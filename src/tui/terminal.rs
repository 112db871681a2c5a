//! The terminal itself: taken, and given back on every way out.
//!
//! It is given back when [`Terminal`] is dropped, by a hook when any thread
//! panics, and around Ctrl-Z. Signals that end the program only raise a flag, so
//! that the session can stop the device and close its journal first. Events are
//! read on a thread of their own: reading never returns once a terminal has gone
//! away, and the device must not wait for that.

use super::TuiError;
use crossterm::event::{
    DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture, Event,
};
use crossterm::terminal::{
    BeginSynchronizedUpdate, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen,
    disable_raw_mode, enable_raw_mode,
};
use crossterm::{cursor, execute, queue, style};
use ratatui::Frame;
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::process::{Signal, getpid, kill_process};
use signal_hook::consts::{SIGCONT, SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use std::cell::Cell;
use std::io::{self, IsTerminal as _, Stdout};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, Once, OnceLock, PoisonError, TryLockError};
use std::time::Duration;

/// Whether the terminal is ours: raw, on the alternate screen.
static TAKEN: AtomicBool = AtomicBool::new(false);
/// Whether the mouse was asked for.
static MOUSE: AtomicBool = AtomicBool::new(false);
/// Whether the terminal was asked to mark what is pasted.
static PASTE: AtomicBool = AtomicBool::new(false);
/// Whether some thread has panicked: the terminal is given back for good.
static PANICKED: AtomicBool = AtomicBool::new(false);
static HOOK: Once = Once::new();
/// Whether no terminal is open, so that the ending signals do what they do in any
/// other program. Their handlers stay for good once they are registered.
static IDLE: OnceLock<Arc<AtomicBool>> = OnceLock::new();
/// Held while a page is written, so that another thread's panic does not give the
/// terminal back in the middle of it.
static WRITING: Mutex<()> = Mutex::new(());

thread_local! {
    /// Whether this thread is the one that holds [`WRITING`].
    static WRITES: Cell<bool> = const { Cell::new(false) };
}

/// How long the reading thread waits before it looks whether it should end.
const READ_SLICE: Duration = Duration::from_millis(100);

/// A terminal that is taken.
pub(super) struct Terminal {
    /// Never dropped: its drop prints to a terminal that may be gone, and panics.
    /// The cursor is shown again by [`give_back`].
    screen: ManuallyDrop<ratatui::Terminal<CrosstermBackend<Stdout>>>,
    events: Receiver<io::Result<Event>>,
    ended: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
    continued: Arc<AtomicBool>,
    registered: Vec<signal_hook::SigId>,
}

impl Terminal {
    /// Takes the terminal.
    pub(super) fn open(mouse: bool) -> Result<Self, TuiError> {
        if !io::stdin().is_terminal() || !io::stdout().is_terminal() {
            return Err(TuiError::NoTerminal);
        }
        let term = std::env::var("TERM").unwrap_or_default();
        if term.is_empty() || term == "dumb" {
            return Err(TuiError::DumbTerminal(term));
        }
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |info| {
                PANICKED.store(true, Ordering::SeqCst);
                give_back();
                before(info);
            }));
        });
        PANICKED.store(false, Ordering::SeqCst);
        MOUSE.store(mouse, Ordering::SeqCst);

        let signal = Arc::new(AtomicUsize::new(0));
        let continued = Arc::new(AtomicBool::new(false));
        let mut registered = Vec::new();
        let first = IDLE.get().is_none();
        let idle = IDLE.get_or_init(Arc::default);
        idle.store(false, Ordering::SeqCst);
        for number in [SIGHUP, SIGINT, SIGQUIT, SIGTERM] {
            if first {
                signal_hook::flag::register_conditional_default(number, Arc::clone(idle))
                    .map_err(TuiError::Terminal)?;
            }
            let value = usize::try_from(number).unwrap_or(0);
            let id = signal_hook::flag::register_usize(number, Arc::clone(&signal), value);
            registered.push(id.map_err(TuiError::Terminal)?);
        }
        let id = signal_hook::flag::register(SIGCONT, Arc::clone(&continued));
        registered.push(id.map_err(TuiError::Terminal)?);

        take().map_err(TuiError::Terminal)?;
        let screen = ratatui::Terminal::new(CrosstermBackend::new(io::stdout())).map_err(|e| {
            give_back();
            TuiError::Terminal(e)
        })?;
        let ended = Arc::new(AtomicBool::new(false));
        let (send, events) = channel();
        let stop = Arc::clone(&ended);
        std::thread::Builder::new()
            .name("keys".to_owned())
            .spawn(move || read(&send, &stop))
            .map_err(|e| {
                give_back();
                TuiError::Terminal(e)
            })?;
        Ok(Self {
            screen: ManuallyDrop::new(screen),
            events,
            ended,
            signal,
            continued,
            registered,
        })
    }

    /// Draws a page, unless the terminal was given back meanwhile.
    pub(super) fn draw(&mut self, page: impl FnOnce(&mut Frame<'_>)) -> Result<(), String> {
        let one = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        if TAKEN.load(Ordering::SeqCst) {
            WRITES.set(true);
            let drawn = self.draw_whole(page);
            WRITES.set(false);
            drop(one);
            drawn.map_err(|error| format!("the terminal cannot be written: {error}"))
        } else {
            drop(one);
            self.check().map(drop)
        }
    }

    /// Draws a page as one update: a terminal that knows synchronized updates never
    /// shows half a page, and others ignore the request.
    fn draw_whole(&mut self, page: impl FnOnce(&mut Frame<'_>)) -> io::Result<()> {
        queue!(io::stdout(), BeginSynchronizedUpdate)?;
        self.screen.draw(page)?;
        execute!(io::stdout(), EndSynchronizedUpdate)
    }

    /// Whether what is pasted comes as one event. A paste whose end is lost on the way
    /// swallows every key after it, so there is none while a key has to stop the device.
    pub(super) fn allow_paste(&self, allowed: bool) {
        let _one = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        if !TAKEN.load(Ordering::SeqCst) || PASTE.swap(allowed, Ordering::SeqCst) == allowed {
            return;
        }
        // a terminal that cannot be written shows at the next page
        let _ = if allowed {
            execute!(io::stdout(), EnableBracketedPaste)
        } else {
            execute!(io::stdout(), DisableBracketedPaste)
        };
    }

    /// The name of a signal that asked the program to end, once.
    pub(super) fn take_signal(&self) -> Option<&'static str> {
        match i32::try_from(self.signal.swap(0, Ordering::SeqCst)) {
            Ok(SIGHUP) => Some("SIGHUP"),
            Ok(SIGINT) => Some("SIGINT"),
            Ok(SIGQUIT) => Some("SIGQUIT"),
            Ok(SIGTERM) => Some("SIGTERM"),
            _ => None,
        }
    }

    /// Looks whether the terminal is still there and ours; says whether it was
    /// emptied and has to be drawn again.
    pub(super) fn check(&mut self) -> Result<bool, String> {
        if PANICKED.load(Ordering::SeqCst) {
            return Err("a part of the program failed; see the message above".to_owned());
        }
        if hung_up() {
            return Err("the terminal is gone".to_owned());
        }
        // Somebody stopped the program from outside and let it go on: the shell
        // may have changed the terminal in between.
        if self.continued.swap(false, Ordering::SeqCst) {
            give_back();
            self.again()?;
            return Ok(true);
        }
        Ok(false)
    }

    /// The next event, within a time.
    pub(super) fn event(&self, timeout: Duration) -> Result<Option<Event>, String> {
        match self.events.recv_timeout(timeout) {
            Ok(Ok(event)) => Ok(Some(event)),
            Ok(Err(error)) => Err(format!("the terminal cannot be read: {error}")),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err("the terminal is gone".to_owned()),
        }
    }

    /// Goes to the background, as Ctrl-Z asks, and comes back with `fg`.
    pub(super) fn suspend(&mut self) -> Result<(), String> {
        give_back();
        let stopped = kill_process(getpid(), Signal::TSTP);
        self.continued.store(false, Ordering::SeqCst);
        self.again()?;
        stopped.map_err(|error| format!("the program cannot be suspended: {error}"))
    }

    fn again(&mut self) -> Result<(), String> {
        let gone = |error: io::Error| format!("the terminal cannot be taken again: {error}");
        take().map_err(gone)?;
        // Not `clear`, which asks the terminal where its cursor is and would wait
        // for the thread that reads.
        let size = self.screen.size().map_err(gone)?;
        let area = Rect::new(0, 0, size.width, size.height);
        self.screen.resize(area).map_err(gone)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::SeqCst);
        give_back();
        for id in self.registered.drain(..) {
            signal_hook::low_level::unregister(id);
        }
        if let Some(idle) = IDLE.get() {
            idle.store(true, Ordering::SeqCst);
        }
    }
}

/// Raw mode, alternate screen, pasting as one event.
fn take() -> io::Result<()> {
    enable_raw_mode()?;
    TAKEN.store(true, Ordering::SeqCst);
    let entered = execute!(io::stdout(), EnterAlternateScreen, EnableBracketedPaste);
    PASTE.store(true, Ordering::SeqCst);
    let entered = entered.and_then(|()| {
        if MOUSE.load(Ordering::SeqCst) {
            execute!(io::stdout(), EnableMouseCapture)
        } else {
            Ok(())
        }
    });
    if entered.is_err() {
        give_back();
    }
    entered
}

/// The terminal as it was. Every step is tried: a failed one hides no other.
fn give_back() {
    if !TAKEN.swap(false, Ordering::SeqCst) {
        return;
    }
    let _one = page_written();
    // Raw mode first: it needs no room in the output, which may be blocked.
    let _ = disable_raw_mode();
    if hung_up() {
        return;
    }
    if MOUSE.load(Ordering::SeqCst) {
        let _ = execute!(io::stdout(), DisableMouseCapture);
    }
    let _ = execute!(
        io::stdout(),
        EndSynchronizedUpdate,
        DisableBracketedPaste,
        style::ResetColor,
        LeaveAlternateScreen,
        cursor::Show
    );
}

/// Waits until no other thread writes a page; not for ever, since a terminal may
/// have stopped reading.
fn page_written() -> Option<MutexGuard<'static, ()>> {
    if WRITES.get() {
        return None;
    }
    for _ in 0..50 {
        match WRITING.try_lock() {
            Ok(one) => return Some(one),
            Err(TryLockError::Poisoned(one)) => return Some(one.into_inner()),
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(10)),
        }
    }
    None
}

/// Whether the terminal's other end is closed. SIGHUP may be ignored, and
/// reading would not tell.
fn hung_up() -> bool {
    let (stdin, stdout) = (io::stdin(), io::stdout());
    let gone = PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL;
    let mut ends = [
        PollFd::new(&stdin, PollFlags::empty()),
        PollFd::new(&stdout, PollFlags::empty()),
    ];
    let now = Timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    match rustix::event::poll(&mut ends, Some(&now)) {
        Ok(_) => ends.iter().any(|end| end.revents().intersects(gone)),
        Err(_) => false,
    }
}

/// Sends events until it should end or nobody listens.
fn read(send: &Sender<io::Result<Event>>, stop: &AtomicBool) {
    while !stop.load(Ordering::SeqCst) && !hung_up() {
        let event = match crossterm::event::poll(READ_SLICE) {
            Ok(false) => continue,
            // it is there for whoever takes the terminal next
            Ok(true) if stop.load(Ordering::SeqCst) => return,
            Ok(true) => crossterm::event::read(),
            Err(error) => Err(error),
        };
        let failed = event.is_err();
        if send.send(event).is_err() || failed {
            return;
        }
    }
}
