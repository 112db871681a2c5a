//! A file that is being read, with a bar once that has taken a second.

use super::super::console::{PATIENCE, progress};
use indicatif::ProgressBar;
use std::io::{self, Read};
use std::time::Instant;

/// Passes reads on and counts the bytes.
pub(super) struct Watched<R> {
    inner: R,
    length: u64,
    done: u64,
    since: Instant,
    bar: Option<ProgressBar>,
}

impl<R: Read> Watched<R> {
    /// `length` is how many bytes there will be.
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

impl<R: Read> Read for Watched<R> {
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
