//! Standard input on Windows.
//!
//! A console is read key by key, and the line is echoed and edited here: the console's own
//! line input could not be interrupted when a single key has to stop the device. A pipe or a
//! file is read by a thread, because waiting for one cannot be limited.

use super::Typed;
use crate::tui::Signals;
use crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers};
use std::io::{self, IsTerminal as _, Read as _, Write as _};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};
use unicode_width::UnicodeWidthChar;

/// Standard input, line by line.
pub(in crate::plain) struct Lines {
    source: Source,
    signals: Signals,
    suspend: bool,
}

enum Source {
    Console {
        /// The line so far.
        line: String,
        /// Whether keys arrive one by one.
        single: bool,
    },
    Piped {
        chunks: Receiver<io::Result<Vec<u8>>>,
        /// Bytes that are not yet a line.
        bytes: Vec<u8>,
    },
}

impl Lines {
    pub(in crate::plain) fn open() -> io::Result<Self> {
        let source = match io::stdin().is_terminal() {
            true => Source::Console {
                line: String::new(),
                single: false,
            },
            false => Source::Piped {
                chunks: read_in_thread()?,
                bytes: Vec::new(),
            },
        };
        Ok(Self {
            source,
            signals: Signals::register()?,
            suspend: false,
        })
    }

    /// Whether single keys can be read.
    pub(in crate::plain) fn has_keys(&self) -> bool {
        matches!(self.source, Source::Console { .. })
    }

    /// The name of a console event that has arrived, once.
    pub(in crate::plain) fn take_signal(&self) -> Option<&'static str> {
        self.signals.take()
    }

    /// Whether Ctrl-Z was pressed since the last call.
    pub(in crate::plain) fn take_suspend(&mut self) -> bool {
        std::mem::take(&mut self.suspend)
    }

    /// Does nothing: Windows has no job control. Ctrl-Z has paused the session.
    pub(in crate::plain) fn suspend(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// Forgets what a person has typed and the program has not read; whether that was the
    /// begin of a line. A pipe is not a person: its lines are kept.
    pub(in crate::plain) fn forget(&mut self) -> bool {
        let Source::Console { line, .. } = &mut self.source else {
            return false;
        };
        let begun = !line.is_empty();
        line.clear();
        // A console that cannot be read is noticed when the next key is read.
        while crossterm::event::poll(Duration::ZERO).unwrap_or(false)
            && crossterm::event::read().is_ok()
        {}
        begun
    }

    /// Switches between lines and single keys, on a console.
    pub(in crate::plain) fn single_keys(&mut self, on: bool) -> io::Result<()> {
        if let Source::Console { line, single } = &mut self.source
            && *single != on
        {
            *single = on;
            line.clear();
        }
        Ok(())
    }

    /// What is typed next, within a time.
    pub(in crate::plain) fn next(&mut self, timeout: Duration) -> io::Result<Option<Typed>> {
        match &mut self.source {
            Source::Console { line, single } => {
                next_of_console(line, *single, &mut self.suspend, timeout)
            }
            Source::Piped { chunks, bytes } => next_of_pipe(chunks, bytes, timeout),
        }
    }
}

fn next_of_console(
    line: &mut String,
    single: bool,
    suspend: &mut bool,
    timeout: Duration,
) -> io::Result<Option<Typed>> {
    let until = Instant::now() + timeout;
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if !crossterm::event::poll(left)? {
            return Ok(None);
        }
        let Event::Key(key) = crossterm::event::read()? else {
            continue;
        };
        if key.kind == KeyEventKind::Release {
            continue;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            KeyCode::Esc if single => return Ok(Some(Typed::Stop)),
            KeyCode::Char(' ') if single && line.is_empty() => return Ok(Some(Typed::Stop)),
            KeyCode::Char('z') if control => {
                *suspend = true;
                return Ok(None);
            }
            KeyCode::Enter => {
                if !single {
                    echo("\r\n")?;
                }
                return Ok(Some(Typed::Line(std::mem::take(line))));
            }
            KeyCode::Backspace => {
                let columns = line.pop().and_then(UnicodeWidthChar::width);
                let columns = columns.filter(|_| !single);
                echo(&"\x08 \x08".repeat(columns.unwrap_or(0)))?;
            }
            KeyCode::Char(c) if !c.is_control() && !control => {
                line.push(c);
                if !single {
                    echo(c.encode_utf8(&mut [0; 4]))?;
                }
            }
            _ => {}
        }
    }
}

fn echo(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}

fn next_of_pipe(
    chunks: &Receiver<io::Result<Vec<u8>>>,
    bytes: &mut Vec<u8>,
    timeout: Duration,
) -> io::Result<Option<Typed>> {
    if let Some(line) = super::take_line(bytes) {
        return Ok(Some(Typed::Line(line)));
    }
    match chunks.recv_timeout(timeout) {
        Ok(chunk) => bytes.extend(chunk?),
        Err(RecvTimeoutError::Timeout) => return Ok(None),
        Err(RecvTimeoutError::Disconnected) => return Err(io::ErrorKind::UnexpectedEof.into()),
    }
    Ok(super::take_line(bytes).map(Typed::Line))
}

/// Reads standard input until it ends. The thread holds at most one chunk that nobody has
/// taken.
fn read_in_thread() -> io::Result<Receiver<io::Result<Vec<u8>>>> {
    let (send, chunks) = sync_channel(1);
    std::thread::Builder::new()
        .name("input".to_owned())
        .spawn(move || {
            let mut chunk = [0; 1024];
            loop {
                let read = match io::stdin().lock().read(&mut chunk) {
                    Ok(0) => return,
                    Ok(count) => Ok(chunk[..count].to_vec()),
                    Err(e) => Err(e),
                };
                let failed = read.is_err();
                if send.send(read).is_err() || failed {
                    return;
                }
            }
        })?;
    Ok(chunks)
}
