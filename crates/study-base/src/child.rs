//! A program that exchanges lines on its standard streams, with the threads that read and
//! write, and how it ended. What the lines say is the matter of those who use it.

use crate::text::{Untrusted, beginning};
use std::fmt::Display;
use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest line of a program, bytes.
const MAX_LINE: u64 = 256 * 1024;
/// Largest number of queued lines in each direction.
const QUEUE_LINES: usize = 256;
/// Time that a program has to end by itself once its input is closed.
const EXIT_TIMEOUT: Duration = Duration::from_millis(300);
/// Time that a program has for the same once it has violated the specification.
const LAST_WORDS: Duration = Duration::from_millis(100);
/// Time to wait for the exit status once the output is closed; a busy machine needs a
/// moment between the two.
const STATUS_TIMEOUT: Duration = Duration::from_secs(2);
/// How long standard error is read after the program has ended; programs that it has
/// started may keep it open.
const STDERR_TIMEOUT: Duration = Duration::from_secs(1);
/// Number of bytes of standard error that are kept.
const STDERR_KEPT: usize = 1024;
/// Time between two checks whether something has ended.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Longest part of the command in messages, characters.
const MAX_NAME: usize = 60;
/// Longest text of a program in messages, characters.
pub const MAX_TEXT: usize = 200;
/// Time that a program has from its start to its first line, in which it says who it is.
pub const HELLO_TIMEOUT: Duration = Duration::from_secs(10);
/// Time between the loss of a program and its restart.
pub const RESTART_DELAY: Duration = Duration::from_secs(1);

/// Why a program is no longer usable.
#[derive(Debug)]
pub enum ChildFailure {
    /// It has closed its input or output.
    Closed,
    /// It violates the specification; how.
    Violation(String),
}

impl ChildFailure {
    /// It has not said who it is in [`HELLO_TIMEOUT`].
    pub fn no_hello() -> Self {
        let timeout = HELLO_TIMEOUT.as_secs();
        Self::Violation(format!("it has sent no hello within {timeout} s"))
    }
}

/// Why a program cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// No program is named.
    #[error("the command is empty")]
    NoProgram,
    /// The system does not start it.
    #[error("the program `{program}` cannot be started: {reason}", program = Untrusted(.0), reason = spawn_failure(.1))]
    Spawn(String, std::io::Error),
    /// It cannot be talked to.
    #[error("the program has no standard streams")]
    NoStreams,
}

fn spawn_failure(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "there is no such program".to_owned(),
        std::io::ErrorKind::PermissionDenied => "it is not executable".to_owned(),
        _ => error.to_string(),
    }
}

/// A running program with the threads that read and write.
#[derive(Debug)]
pub struct Running {
    /// The command, as shown in messages.
    name: String,
    child: Child,
    lines: Receiver<OutputLine>,
    /// Dropped to close the program's input.
    input: SyncSender<String>,
    /// End of the standard error.
    stderr: Arc<Mutex<Vec<u8>>>,
    /// Ends with the program's standard error.
    stderr_thread: JoinHandle<()>,
    /// Lines received so far.
    lines_read: u64,
}

#[derive(Debug)]
enum OutputLine {
    Line(Vec<u8>),
    /// The output ends here.
    Last(ChildFailure),
}

impl Running {
    /// Starts a program with its arguments; no shell is involved.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn start(command: &[String]) -> Result<Self, StartError> {
        let (program, arguments) = command.split_first().ok_or(StartError::NoProgram)?;
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| StartError::Spawn(program.clone(), e))?;
        let (Some(mut input), Some(output), Some(mut error)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(StartError::NoStreams);
        };
        let (line_sender, lines) = sync_channel(QUEUE_LINES);
        std::thread::spawn(move || {
            let mut output = BufReader::new(output);
            loop {
                let line = next_line(&mut output);
                let last = matches!(line, OutputLine::Last(_));
                if line_sender.send(line).is_err() || last {
                    return;
                }
            }
        });
        let (input_sender, to_write) = sync_channel::<String>(QUEUE_LINES);
        std::thread::spawn(move || {
            while let Ok(line) = to_write.recv() {
                // The end of a program is noticed at its output.
                if input.write_all(line.as_bytes()).is_err() || input.flush().is_err() {
                    return;
                }
            }
        });
        let stderr = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&stderr);
        let stderr_thread = std::thread::spawn(move || {
            let mut bytes = [0; 512];
            while let Ok(n @ 1..) = error.read(&mut bytes) {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&bytes[..n]);
                let excess = kept.len().saturating_sub(STDERR_KEPT);
                kept.drain(..excess);
            }
        });
        Ok(Self {
            name: beginning(&command.join(" "), MAX_NAME),
            child,
            lines,
            input: input_sender,
            stderr,
            stderr_thread,
            lines_read: 0,
        })
    }

    /// Waits at most `wait` for the next line.
    ///
    /// # Errors
    /// [`ChildFailure`] if there will be none.
    pub fn receive(&mut self, wait: Duration) -> Result<Option<Vec<u8>>, ChildFailure> {
        match self.lines.recv_timeout(wait) {
            Ok(OutputLine::Line(line)) => {
                self.lines_read += 1;
                Ok(Some(line))
            }
            Ok(OutputLine::Last(failure)) => Err(failure),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(ChildFailure::Closed),
        }
    }

    /// The last line violates the specification; why.
    pub fn invalid(&self, why: impl Display) -> ChildFailure {
        ChildFailure::Violation(format!("its line {} is invalid: {why}", self.lines_read))
    }

    /// Queues a line for the program without waiting.
    ///
    /// # Errors
    /// [`ChildFailure`] if it takes none.
    pub fn send(&mut self, line: String) -> Result<(), ChildFailure> {
        self.input.try_send(line).map_err(|e| match e {
            TrySendError::Full(_) => {
                ChildFailure::Violation("it does not read its input".to_owned())
            }
            TrySendError::Disconnected(_) => ChildFailure::Closed,
        })
    }

    /// Ends the program if necessary. Returns a description of the failure with the exit
    /// status and the last line of its standard error, safe to print.
    pub fn end(&mut self, failure: &ChildFailure) -> String {
        let wait = match failure {
            ChildFailure::Closed => STATUS_TIMEOUT,
            ChildFailure::Violation(_) => Duration::ZERO,
        };
        let ended = self.wait_for_exit(wait);
        if ended.is_none() {
            // It may still be able to switch its motor off.
            self.close_input();
            self.wait_for_exit(LAST_WORDS);
        }
        // The program may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let mut text = format!("the program `{}`", Untrusted(&self.name));
        match (ended, failure) {
            (Some(status), _) => text += &format!(" has ended {}", how(status)),
            (None, ChildFailure::Closed) => text += " has closed its standard streams",
            (None, ChildFailure::Violation(_)) => {}
        }
        if let ChildFailure::Violation(reason) = failure {
            text += &format!(": {}", Untrusted(reason));
        }
        if let Some(last) = self.last_line() {
            let last = beginning(&last, MAX_TEXT);
            text.push_str(&format!("; its last error message: {}", Untrusted(&last)));
        }
        text
    }

    /// Closes the program's input.
    pub fn close_input(&mut self) {
        let (closed, _) = sync_channel(0);
        self.input = closed;
    }

    /// Waits at most `wait` for the end of the program.
    pub fn wait_for_exit(&mut self, wait: Duration) -> Option<ExitStatus> {
        let until = Instant::now() + wait;
        loop {
            match self.child.try_wait() {
                Ok(None) if Instant::now() < until => std::thread::sleep(POLL_INTERVAL),
                Ok(status) => return status,
                Err(_) => return None,
            }
        }
    }

    /// The last line of standard error that is not blank.
    fn last_line(&self) -> Option<String> {
        let until = Instant::now() + STDERR_TIMEOUT;
        while !self.stderr_thread.is_finished() && Instant::now() < until {
            std::thread::sleep(POLL_INTERVAL);
        }
        let last = self.stderr.lock();
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
    /// Closes the input and kills the program if it does not end.
    fn drop(&mut self) {
        if self.child.try_wait().is_ok_and(|ended| ended.is_some()) {
            return;
        }
        self.close_input();
        if self.wait_for_exit(EXIT_TIMEOUT).is_some() {
            return;
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn next_line(output: &mut impl std::io::BufRead) -> OutputLine {
    let mut line = Vec::new();
    match output.take(MAX_LINE).read_until(b'\n', &mut line) {
        Err(e) => OutputLine::Last(ChildFailure::Violation(format!("it cannot be read: {e}"))),
        Ok(0) => OutputLine::Last(ChildFailure::Closed),
        Ok(_) if line.last() == Some(&b'\n') => OutputLine::Line(line),
        Ok(n) if n as u64 == MAX_LINE => OutputLine::Last(ChildFailure::Violation(format!(
            "a line is longer than {MAX_LINE} bytes"
        ))),
        Ok(_) => OutputLine::Last(ChildFailure::Closed),
    }
}
