//! The terminal: raw mode and alternate screen on opening, restored on every way out.
//!
//! It is restored when [`Terminal`] is dropped, by a hook when any thread panics, by a
//! handler when the program aborts, and around Ctrl-Z. Terminating signals only set a flag, so that the session can stop
//! the device and close its journal first. A thread of its own reads the events:
//! reading never returns once a terminal is gone, and the device must not wait for
//! that.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
use unix as platform;
#[cfg(windows)]
use windows as platform;

pub(crate) use platform::{Signals, survive_file_size_limit};

use super::TuiError;
use crate::runner::OperatorError;
use crossterm::event::{
    DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture, Event,
};
use crossterm::terminal::{
    BeginSynchronizedUpdate, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen,
    disable_raw_mode, enable_raw_mode,
};
use crossterm::{cursor, execute, queue, style};
use platform::hung_up;
use ratatui::Frame;
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use std::cell::Cell;
use std::io::{self, IsTerminal as _, Stdout};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, Once, PoisonError, TryLockError};
use std::time::{Duration, Instant};

/// Whether the terminal is in raw mode and on the alternate screen.
static TAKEN: AtomicBool = AtomicBool::new(false);
/// Whether mouse events were requested.
static MOUSE: AtomicBool = AtomicBool::new(false);
/// Whether bracketed paste is on.
static PASTE: AtomicBool = AtomicBool::new(false);
/// Whether a thread has panicked: the terminal is restored for good.
static PANICKED: AtomicBool = AtomicBool::new(false);
static HOOK: Once = Once::new();
/// Held while a page is written, so that another thread's panic does not restore the
/// terminal in the middle of it.
static WRITING: Mutex<()> = Mutex::new(());

thread_local! {
    /// Whether this thread holds [`WRITING`].
    static WRITES: Cell<bool> = const { Cell::new(false) };
}

/// How often the reading thread checks whether it should end.
const READ_SLICE: Duration = Duration::from_millis(100);

/// Why the terminal cannot be used any more.
#[derive(Debug, thiserror::Error)]
pub(super) enum TerminalError {
    /// A part of the program panicked and gave the terminal back.
    #[error("a part of the program failed; see the message above")]
    Panicked,
    /// Closed, or its connection lost.
    #[error("the terminal is gone")]
    Gone,
    /// Reading failed.
    #[error("the terminal cannot be read: {0}")]
    Read(io::Error),
    /// Writing failed.
    #[error("the terminal cannot be written: {0}")]
    Write(io::Error),
    /// The program could not stop itself, as Ctrl-Z asks.
    #[error("the program cannot be suspended: {0}")]
    Suspend(io::Error),
    /// The terminal could not be entered again.
    #[error("the terminal cannot be taken again: {0}")]
    Resume(io::Error),
}

impl From<TerminalError> for OperatorError {
    fn from(error: TerminalError) -> Self {
        Self(error.to_string())
    }
}

/// An open terminal.
pub(super) struct Terminal {
    /// Never dropped: its drop prints to a terminal that may be gone, and panics.
    /// [`restore`] shows the cursor again.
    screen: ManuallyDrop<ratatui::Terminal<CrosstermBackend<Stdout>>>,
    events: Receiver<io::Result<(Event, Instant)>>,
    ended: Arc<AtomicBool>,
    signals: Signals,
}

impl Terminal {
    pub(super) fn open(mouse: bool) -> Result<Self, TuiError> {
        if !io::stdin().is_terminal() || !io::stdout().is_terminal() {
            return Err(TuiError::NoTerminal);
        }
        platform::positions_text().map_err(TuiError::DumbTerminal)?;
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |info| {
                PANICKED.store(true, Ordering::SeqCst);
                restore();
                before(info);
            }));
        });
        PANICKED.store(false, Ordering::SeqCst);
        MOUSE.store(mouse, Ordering::SeqCst);
        let signals = Signals::register().map_err(TuiError::Terminal)?;
        platform::restore_on_failure(&TAKEN).map_err(TuiError::Terminal)?;
        take().map_err(TuiError::Terminal)?;
        let failed = |error| {
            restore();
            TuiError::Terminal(error)
        };
        let backend = CrosstermBackend::new(io::stdout());
        let screen = ratatui::Terminal::new(backend).map_err(failed)?;
        let ended = Arc::new(AtomicBool::new(false));
        let (send, events) = channel();
        let stop = Arc::clone(&ended);
        std::thread::Builder::new()
            .name("keys".to_owned())
            .spawn(move || read(&send, &stop))
            .map_err(failed)?;
        Ok(Self {
            screen: ManuallyDrop::new(screen),
            events,
            ended,
            signals,
        })
    }

    /// Draws a page, unless the terminal has been restored in the meantime.
    pub(super) fn draw(&mut self, page: impl FnOnce(&mut Frame<'_>)) -> Result<(), TerminalError> {
        let one = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        if TAKEN.load(Ordering::SeqCst) {
            WRITES.set(true);
            let drawn = self.draw_whole(page);
            WRITES.set(false);
            drop(one);
            drawn.map_err(TerminalError::Write)
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

    /// Switches bracketed paste. A paste whose end marker is lost swallows every
    /// later key, so it is off while a key has to stop the device.
    pub(super) fn allow_paste(&self, allowed: bool) {
        let _one = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        if !TAKEN.load(Ordering::SeqCst) || PASTE.swap(allowed, Ordering::SeqCst) == allowed {
            return;
        }
        // A terminal that cannot be written is reported when the next page is drawn.
        let _ = if allowed {
            execute!(io::stdout(), EnableBracketedPaste)
        } else {
            execute!(io::stdout(), DisableBracketedPaste)
        };
    }

    /// The name of a terminating signal that has arrived, once.
    pub(super) fn take_signal(&self) -> Option<&'static str> {
        self.signals.take()
    }

    /// Checks that the terminal is still usable. True if it was cleared and has to be
    /// drawn again.
    pub(super) fn check(&mut self) -> Result<bool, TerminalError> {
        if PANICKED.load(Ordering::SeqCst) {
            return Err(TerminalError::Panicked);
        }
        if hung_up() {
            return Err(TerminalError::Gone);
        }
        // Stopped and continued from outside: the shell may have changed the terminal.
        if self.signals.take_continued() {
            restore();
            self.again()?;
            return Ok(true);
        }
        Ok(false)
    }

    /// The next event and when it arrived, within a time.
    pub(super) fn event(
        &self,
        timeout: Duration,
    ) -> Result<Option<(Event, Instant)>, TerminalError> {
        match self.events.recv_timeout(timeout) {
            Ok(Ok(event)) => Ok(Some(event)),
            Ok(Err(error)) => Err(TerminalError::Read(error)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(TerminalError::Gone),
        }
    }

    /// Goes to the background, as Ctrl-Z asks, and comes back with `fg`.
    pub(super) fn suspend(&mut self) -> Result<(), TerminalError> {
        restore();
        let stopped = platform::suspend();
        self.signals.take_continued();
        self.again()?;
        stopped.map_err(TerminalError::Suspend)
    }

    fn again(&mut self) -> Result<(), TerminalError> {
        take().map_err(TerminalError::Resume)?;
        // Not `clear`, which asks the terminal where its cursor is and would wait
        // for the thread that reads.
        let size = self.screen.size().map_err(TerminalError::Resume)?;
        let area = Rect::new(0, 0, size.width, size.height);
        self.screen.resize(area).map_err(TerminalError::Resume)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::SeqCst);
        restore();
    }
}

/// Enters raw mode and the alternate screen, with bracketed paste.
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
        restore();
    }
    entered
}

/// Restores the terminal. Every step is tried, whatever became of those before.
fn restore() {
    if !TAKEN.swap(false, Ordering::SeqCst) {
        return;
    }
    let _one = page_written();
    // Raw mode first: it needs no room in the output buffer, which may be full.
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

/// Waits until no other thread writes a page, at most half a second, since a terminal
/// may have stopped reading.
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

/// Sends events until it is told to stop or the receiver is gone.
fn read(send: &Sender<io::Result<(Event, Instant)>>, stop: &AtomicBool) {
    while !stop.load(Ordering::SeqCst) && !hung_up() {
        let event = match crossterm::event::poll(READ_SLICE) {
            Ok(false) => continue,
            // leave the event to whoever opens the terminal next
            Ok(true) if stop.load(Ordering::SeqCst) => return,
            Ok(true) => crossterm::event::read(),
            Err(error) => Err(error),
        };
        let event = event.map(|event| (event, Instant::now()));
        let failed = event.is_err();
        if send.send(event).is_err() || failed {
            return;
        }
    }
}
