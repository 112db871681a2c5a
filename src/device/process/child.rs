//! A running child with the threads that read and write, and how it ended.

use super::HELLO_WITHIN;
use super::words::{self, Say};
use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use study_base::text::Untrusted;

/// Longest line of a child, bytes.
const MAX_LINE: u64 = 256 * 1024;
/// Lines that wait to be taken in, and to be read by the child.
const WAITING: usize = 256;
/// How long a child may take to end by itself once its input is closed.
const END_WITHIN: Duration = Duration::from_millis(300);
/// How long its exit status is waited for once its output is closed: a busy machine
/// takes a moment between the two.
const STATUS_WITHIN: Duration = Duration::from_secs(2);
/// How long its standard error is read on after it has ended: whom it has started may
/// hold it open.
const LAST_WORDS_WITHIN: Duration = Duration::from_secs(1);
/// What is kept of the child's standard error, bytes.
const LAST_WORDS: usize = 1024;
/// Between two looks whether something has ended.
const SLICE: Duration = Duration::from_millis(5);
/// As much of the command as is told, characters.
const MAX_NAME: usize = 60;

/// Why a child is no device any more.
#[derive(Debug)]
pub(super) enum Why {
    /// It reads or says nothing any more.
    Gone,
    /// What it did that is not described.
    Wrong(String),
}

impl Why {
    pub(super) fn no_hello() -> Self {
        let within = HELLO_WITHIN.as_secs();
        Self::Wrong(format!("it has not said hello within {within} s"))
    }
}

/// A child with the threads that read and write.
#[derive(Debug)]
pub(super) struct Running {
    /// The command, as it is told.
    name: String,
    child: Child,
    lines: Receiver<Said>,
    /// Dropped to close the child's input.
    words: SyncSender<String>,
    last_words: Arc<Mutex<Vec<u8>>>,
    /// Ends when its standard error does.
    errors: JoinHandle<()>,
    /// Lines so far.
    heard: u64,
}

#[derive(Debug)]
enum Said {
    Line(Vec<u8>),
    /// There is nothing after it.
    Last(Why),
}

impl Running {
    pub(super) fn start(command: &[String]) -> Result<Self, String> {
        let (program, arguments) = command.split_first().ok_or("no program is named")?;
        let cannot = |e: std::io::Error| {
            let why = match e.kind() {
                std::io::ErrorKind::NotFound => "there is no such program".to_owned(),
                std::io::ErrorKind::PermissionDenied => "it is not executable".to_owned(),
                _ => e.to_string(),
            };
            format!(
                "the program `{}` cannot be started: {why}",
                Untrusted(program)
            )
        };
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(cannot)?;
        let (Some(mut input), Some(output), Some(mut error)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err("the program has no standard streams".to_owned());
        };
        let (say, lines) = sync_channel(WAITING);
        std::thread::spawn(move || {
            let mut output = BufReader::new(output);
            loop {
                let said = next_line(&mut output);
                let over = matches!(said, Said::Last(_));
                if say.send(said).is_err() || over {
                    return;
                }
            }
        });
        let (words, to_write) = sync_channel::<String>(WAITING);
        std::thread::spawn(move || {
            while let Ok(line) = to_write.recv() {
                // a child that has ended shows on its output
                if input.write_all(line.as_bytes()).is_err() || input.flush().is_err() {
                    return;
                }
            }
        });
        let last_words = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&last_words);
        let errors = std::thread::spawn(move || {
            let mut bytes = [0; 512];
            while let Ok(n @ 1..) = error.read(&mut bytes) {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&bytes[..n]);
                let excess = kept.len().saturating_sub(LAST_WORDS);
                kept.drain(..excess);
            }
        });
        Ok(Self {
            name: words::beginning(&command.join(" "), MAX_NAME),
            child,
            lines,
            words,
            last_words,
            errors,
            heard: 0,
        })
    }

    /// The next thing that it says, if there is one within that time.
    pub(super) fn listen(&mut self, within: Duration) -> Result<Option<Say>, Why> {
        let line = match self.lines.recv_timeout(within) {
            Ok(Said::Line(line)) => line,
            Ok(Said::Last(why)) => return Err(why),
            Err(RecvTimeoutError::Timeout) => return Ok(None),
            Err(RecvTimeoutError::Disconnected) => return Err(Why::Gone),
        };
        self.heard += 1;
        match words::read(&line) {
            Ok(say) => Ok(Some(say)),
            Err(why) => Err(Why::Wrong(format!(
                "its line {} is wrong: {why}",
                self.heard
            ))),
        }
    }

    /// Says something to it, without waiting for it.
    pub(super) fn tell(&mut self, line: String) -> Result<(), Why> {
        self.words.try_send(line).map_err(|e| match e {
            TrySendError::Full(_) => Why::Wrong("it does not read what it is told".to_owned()),
            TrySendError::Disconnected(_) => Why::Gone,
        })
    }

    /// Ends it, if it has not ended by itself; says why, how, and what it had to say
    /// itself. Safe to print.
    pub(super) fn end(&mut self, why: &Why) -> String {
        let within = match why {
            Why::Gone => STATUS_WITHIN,
            Why::Wrong(_) => Duration::ZERO,
        };
        let ended = self.ended_within(within);
        // it may have ended by itself
        let _ = self.child.kill();
        let _ = self.child.wait();
        let name = Untrusted(&self.name);
        let mut text = match (why, ended) {
            (Why::Gone, Some(status)) => {
                format!("the program `{name}` has ended {}", how(status))
            }
            (Why::Gone, None) => format!("the program `{name}` has closed its standard streams"),
            (Why::Wrong(why), Some(status)) => {
                let why = Untrusted(why);
                format!("the program `{name}` has ended {}: {why}", how(status))
            }
            (Why::Wrong(why), None) => format!("the program `{name}`: {}", Untrusted(why)),
        };
        if let Some(last) = self.last_line() {
            let last = words::short_text(&last);
            text.push_str(&format!("; its last words: {}", Untrusted(&last)));
        }
        text
    }

    fn ended_within(&mut self, within: Duration) -> Option<ExitStatus> {
        let until = Instant::now() + within;
        loop {
            match self.child.try_wait() {
                Ok(None) if Instant::now() < until => std::thread::sleep(SLICE),
                Ok(status) => return status,
                Err(_) => return None,
            }
        }
    }

    /// The last line of its standard error with something in it.
    fn last_line(&self) -> Option<String> {
        let until = Instant::now() + LAST_WORDS_WITHIN;
        while !self.errors.is_finished() && Instant::now() < until {
            std::thread::sleep(SLICE);
        }
        let last = self.last_words.lock();
        let last = last.unwrap_or_else(PoisonError::into_inner);
        let last = String::from_utf8_lossy(&last);
        let line = last.lines().rev().find(|l| !l.trim().is_empty());
        line.map(|line| line.trim().to_owned())
    }
}

fn how(status: ExitStatus) -> String {
    match status.code() {
        Some(code) => format!("with exit status {code}"),
        None => format!("by {status}"),
    }
}

impl Drop for Running {
    /// Limp, then a moment to end by itself with its input closed, then none.
    fn drop(&mut self) {
        if self.child.try_wait().is_ok_and(|ended| ended.is_some()) {
            return;
        }
        let _ = self.words.try_send(words::short("limp", u64::MAX));
        let (closed, _) = sync_channel(0);
        self.words = closed;
        if self.ended_within(END_WITHIN).is_some() {
            return;
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn next_line(output: &mut impl std::io::BufRead) -> Said {
    let mut line = Vec::new();
    match output.take(MAX_LINE).read_until(b'\n', &mut line) {
        Err(e) => Said::Last(Why::Wrong(format!("it cannot be read: {e}"))),
        Ok(0) => Said::Last(Why::Gone),
        Ok(_) if line.last() == Some(&b'\n') => Said::Line(line),
        Ok(n) if n as u64 == MAX_LINE => Said::Last(Why::Wrong(format!(
            "a line is longer than {MAX_LINE} bytes"
        ))),
        Ok(_) => Said::Last(Why::Gone),
    }
}
