//! Progress bars for reading, analyzing and simulating, shown after a second.

use super::console::{PATIENCE, progress};
use indicatif::ProgressBar;
use std::io::{self, IsTerminal as _, Read};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use study_analysis::analyze::Progress;

/// Interval between updates of the bar.
const UPDATE: Duration = Duration::from_millis(200);

/// A reader with a progress bar.
pub(super) struct Reader<R> {
    inner: R,
    length: u64,
    done: u64,
    since: Instant,
    bar: Option<ProgressBar>,
}

impl<R: Read> Reader<R> {
    /// Wraps a reader of `length` bytes.
    pub(super) fn new(inner: R, length: u64) -> Self {
        Self {
            inner,
            length,
            done: 0,
            since: Instant::now(),
            bar: None,
        }
    }
}

impl<R: Read> Read for Reader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.done += n as u64;
        if n == 0 {
            if let Some(bar) = &self.bar {
                bar.finish_and_clear();
            }
        } else if self.bar.is_some() || self.since.elapsed() > PATIENCE {
            let length = self.length;
            let bar = self.bar.get_or_insert_with(|| progress(length, "bytes"));
            bar.set_position(self.done);
        }
        Ok(n)
    }
}

/// Does work that reports its progress; on a terminal with a bar that counts `unit`s.
pub(super) fn shown<T>(unit: &'static str, work: impl FnOnce(&Progress) -> T) -> T {
    let state = Progress::default();
    if !io::stderr().is_terminal() {
        return work(&state);
    }
    let (done, wait) = channel::<()>();
    let state = &state;
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let mut bar = None;
            let mut patience = PATIENCE;
            // Nothing is sent: the channel closes when the work is done.
            while let Err(RecvTimeoutError::Timeout) = wait.recv_timeout(patience) {
                patience = UPDATE;
                let groups = state.groups.load(Ordering::Relaxed);
                // What comes before has no groups.
                if groups > 0 {
                    let bar = bar.get_or_insert_with(|| progress(groups, unit));
                    bar.set_length(groups);
                    bar.set_position(state.done.load(Ordering::Relaxed));
                }
            }
            if let Some(bar) = bar {
                bar.finish_and_clear();
            }
        });
        let made = work(state);
        drop(done);
        made
    })
}
