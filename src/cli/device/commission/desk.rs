//! The person at the device: what is said to them, and what they type, line by line.
//!
//! A line that was typed before its question is dropped.

use crate::cli::{Console, Failure};
use crate::runner::clock::Clock;
use crate::tui::Signals;
use crate::tui::wrap::wrap;
use std::time::Duration;

/// Time between two looks, as in a session.
const TURN: Duration = Duration::from_millis(20);

/// Why nobody answers any more.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(in crate::cli::device) enum Ended {
    /// The input ended, or the terminal was closed.
    #[error("the input ended before all steps were done")]
    Input,
    /// Nobody reads what is asked.
    #[error("the output was closed before all steps were done")]
    Output,
    /// A signal, such as that of Ctrl-C.
    #[error("{0} ended it before all steps were done")]
    Signal(&'static str),
}

/// A person, or a script in a test, and the time.
pub(in crate::cli::device) trait Desk {
    /// Shows a paragraph.
    fn say(&mut self, text: &str) -> Result<(), Failure>;

    /// The next line that was typed, if there is one. Blank lines count.
    fn line(&mut self) -> Result<Option<String>, Ended>;

    /// Whether nothing has ended the dialog, such as Ctrl-C, also while nothing is asked.
    fn goes_on(&mut self) -> Result<(), Ended>;

    /// Drops what was typed and not yet ended with Enter.
    fn drop_typed(&mut self);

    /// Time since an origin.
    fn now(&self) -> Duration;

    /// Lets a little time pass.
    fn wait(&mut self);
}

/// A person at a terminal, or a pipe.
pub(in crate::cli::device) struct Terminal<'c> {
    console: &'c mut Console,
    lines: Lines,
    signals: Signals,
    /// That of the device's other user, if there is one: a device is told times of one clock.
    clock: &'c dyn Clock,
}

impl<'c> Terminal<'c> {
    /// Takes the standard input, until it is dropped.
    pub(in crate::cli::device) fn open(
        console: &'c mut Console,
        clock: &'c dyn Clock,
    ) -> Result<Self, Failure> {
        let signals = Signals::register().map_err(Failure::device)?;
        Ok(Self {
            console,
            lines: Lines::default(),
            signals,
            clock,
        })
    }
}

impl Desk for Terminal<'_> {
    fn say(&mut self, text: &str) -> Result<(), Failure> {
        if !self.console.terminal {
            return self.console.out(format!("{text}\n"));
        }
        let lines = wrap(text, self.console.width);
        let lines: String = lines
            .iter()
            .map(|line| format!("{}\n", line.shown))
            .collect();
        self.console.out(lines)
    }

    fn line(&mut self) -> Result<Option<String>, Ended> {
        self.goes_on()?;
        self.lines.next()
    }

    fn goes_on(&mut self) -> Result<(), Ended> {
        if let Some(name) = self.signals.take() {
            return Err(Ended::Signal(name));
        }
        match is_closed() {
            true => Err(Ended::Output),
            false => Ok(()),
        }
    }

    fn drop_typed(&mut self) {
        #[cfg(unix)]
        {
            self.lines.typed.clear();
            use rustix::termios::{QueueSelector, tcflush};
            // A pipe has no such queue.
            let _ = tcflush(rustix::stdio::stdin(), QueueSelector::IFlush);
        }
    }

    fn now(&self) -> Duration {
        Duration::from_nanos(self.clock.now().mono_ns)
    }

    fn wait(&mut self) {
        std::thread::sleep(TURN);
    }
}

/// Whether nobody can read the output: a closed terminal, or a pipe without a reader.
#[cfg(unix)]
fn is_closed() -> bool {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let stdout = rustix::stdio::stdout();
    let mut ends = [PollFd::new(&stdout, PollFlags::empty())];
    let gone = PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL;
    let polled = poll(&mut ends, Some(&Timespec::default()));
    polled.is_ok() && ends[0].revents().intersects(gone)
}

/// See above: it shows in writing.
#[cfg(not(unix))]
fn is_closed() -> bool {
    false
}

/// Lines of standard input, also blank ones. Nothing is read that was not asked for: after a
/// dialog the input belongs to the session.
#[cfg(unix)]
#[derive(Default)]
struct Lines {
    typed: Vec<u8>,
}

#[cfg(unix)]
impl Lines {
    /// The next whole line, without waiting.
    fn next(&mut self) -> Result<Option<String>, Ended> {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        loop {
            if let Some(end) = self.typed.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.typed.drain(..=end).collect();
                return Ok(Some(String::from_utf8_lossy(&line[..end]).into_owned()));
            }
            let stdin = rustix::stdio::stdin();
            let mut ready = [PollFd::new(&stdin, PollFlags::IN)];
            let at_once = Timespec {
                tv_sec: 0,
                tv_nsec: 0,
            };
            match poll(&mut ready, Some(&at_once)) {
                Ok(0) | Err(rustix::io::Errno::INTR) => return Ok(None),
                Ok(_) => {}
                Err(_) => return Err(Ended::Input),
            }
            let mut bytes = [0; 256];
            match rustix::io::read(stdin, &mut bytes) {
                Ok(0) => return Err(Ended::Input),
                Ok(n) => self.typed.extend_from_slice(&bytes[..n]),
                Err(rustix::io::Errno::INTR | rustix::io::Errno::AGAIN) => return Ok(None),
                Err(_) => return Err(Ended::Input),
            }
        }
    }
}

/// The same where the input cannot be polled: a thread reads one line when it is asked for.
#[cfg(not(unix))]
#[derive(Default)]
struct Lines {
    asked: Option<std::sync::mpsc::Receiver<Option<String>>>,
}

#[cfg(not(unix))]
impl Lines {
    fn next(&mut self) -> Result<Option<String>, Ended> {
        use std::sync::mpsc::{TryRecvError, channel};
        let lines = self.asked.get_or_insert_with(|| {
            let (sender, lines) = channel();
            std::thread::spawn(move || {
                let mut line = String::new();
                let read = std::io::stdin().read_line(&mut line);
                let _ = sender.send(read.is_ok_and(|n| n > 0).then_some(line));
            });
            lines
        });
        let line = match lines.try_recv() {
            Ok(line) => line,
            Err(TryRecvError::Empty) => return Ok(None),
            Err(TryRecvError::Disconnected) => None,
        };
        self.asked = None;
        line.map(Some).ok_or(Ended::Input)
    }
}
