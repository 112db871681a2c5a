//! Standard input on Unix, with the terminal's settings and the signals.

use super::Typed;
use crate::tui::Signals;
use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::process::{Signal, getpid, kill_process};
use rustix::termios::{LocalModes, OptionalActions, QueueSelector, Termios};
use rustix::termios::{tcflush, tcgetattr, tcsetattr};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const ESC: u8 = 0x1b;

/// Standard input, line by line.
pub(in crate::plain) struct Lines {
    /// The settings of the terminal before; `None` for a file or a pipe.
    before: Option<Termios>,
    /// Whether keys arrive one by one.
    single: bool,
    /// Bytes that are not yet a line.
    bytes: Vec<u8>,
    signals: Signals,
    suspend: Arc<AtomicBool>,
    on_suspend: signal_hook::SigId,
}

impl Lines {
    pub(in crate::plain) fn open() -> io::Result<Self> {
        let suspend = Arc::new(AtomicBool::new(false));
        let on_suspend = signal_hook::flag::register(Signal::TSTP.as_raw(), suspend.clone())?;
        Ok(Self {
            before: tcgetattr(rustix::stdio::stdin()).ok(),
            single: false,
            bytes: Vec::new(),
            signals: Signals::register()?,
            suspend,
            on_suspend,
        })
    }

    /// Whether single keys can be read.
    pub(in crate::plain) fn has_keys(&self) -> bool {
        self.before.is_some()
    }

    /// The name of a terminating signal that has arrived, once.
    pub(in crate::plain) fn take_signal(&self) -> Option<&'static str> {
        self.signals.take()
    }

    /// Whether Ctrl-Z was pressed since the last call.
    pub(in crate::plain) fn take_suspend(&mut self) -> bool {
        self.suspend.swap(false, Ordering::SeqCst)
    }

    /// Stops the program until its shell continues it.
    pub(in crate::plain) fn suspend(&mut self) -> io::Result<()> {
        self.single_keys(false)?;
        Ok(kill_process(getpid(), Signal::STOP)?)
    }

    /// Forgets what a person has typed and the program has not read; whether that was the
    /// begin of a line. A pipe is not a person: its lines are kept.
    pub(in crate::plain) fn forget(&mut self) -> bool {
        if self.before.is_none() {
            return false;
        }
        let begun = self.bytes.last().is_some_and(|b| *b != b'\n');
        self.bytes.clear();
        // A terminal that cannot be flushed is noticed when it is read.
        let _ = tcflush(rustix::stdio::stdin(), QueueSelector::IFlush);
        begun
    }

    /// Switches between lines and single keys, on a terminal.
    pub(in crate::plain) fn single_keys(&mut self, on: bool) -> io::Result<()> {
        let Some(before) = self.before.as_ref().filter(|_| on != self.single) else {
            return Ok(());
        };
        let mut settings = before.clone();
        if on {
            settings
                .local_modes
                .remove(LocalModes::ICANON | LocalModes::ECHO);
        }
        tcsetattr(rustix::stdio::stdin(), OptionalActions::Now, &settings)?;
        self.single = on;
        self.bytes.clear();
        Ok(())
    }

    /// What is typed next, within a time.
    pub(in crate::plain) fn next(&mut self, timeout: Duration) -> io::Result<Option<Typed>> {
        if let Some(typed) = self.take() {
            return Ok(Some(typed));
        }
        let stdin = rustix::stdio::stdin();
        let mut ends = [PollFd::new(&stdin, PollFlags::IN)];
        let timeout = Timespec::try_from(timeout).unwrap_or_default();
        match rustix::event::poll(&mut ends, Some(&timeout)) {
            Ok(0) | Err(rustix::io::Errno::INTR) => return Ok(None),
            Ok(_) => {}
            Err(e) => return Err(e.into()),
        }
        let mut chunk = [0; 1024];
        let count = match rustix::io::read(stdin, &mut chunk) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => count,
            Err(rustix::io::Errno::INTR) => return Ok(None),
            Err(e) => return Err(e.into()),
        };
        self.bytes.extend_from_slice(&chunk[..count]);
        Ok(self.take())
    }

    fn take(&mut self) -> Option<Typed> {
        let first = *self.bytes.first()?;
        if self.single && (self.bytes.contains(&ESC) || first == b' ') {
            self.bytes.clear();
            return Some(Typed::Stop);
        }
        super::take_line(&mut self.bytes).map(Typed::Line)
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        let _ = self.single_keys(false);
        signal_hook::low_level::unregister(self.on_suspend);
    }
}
