//! Queues of bytes between an interrupt and the rest of a firmware.

use crate::Priority;
use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// A queue of `N` bytes with one writer and one reader, which may interrupt each other. It
/// holds at most `N` − 1 bytes.
#[derive(Debug)]
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    /// Where the reader reads next; only the reader changes it.
    read: AtomicUsize,
    /// Where the writer writes next; only the writer changes it.
    write: AtomicUsize,
}

impl<const N: usize> Ring<N> {
    /// An empty queue.
    pub const fn new() -> Self {
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            read: AtomicUsize::new(0),
            write: AtomicUsize::new(0),
        }
    }

    /// Room for so many bytes.
    pub fn free(&self) -> usize {
        let (read, write) = (
            self.read.load(Ordering::Acquire),
            self.write.load(Ordering::Relaxed),
        );
        (read + N - write - 1) % N
    }

    /// Adds all bytes; false, and nothing is added, if they do not fit.
    pub fn push(&self, bytes: &[u8]) -> bool {
        if bytes.len() > self.free() {
            return false;
        }
        let mut write = self.write.load(Ordering::Relaxed);
        for byte in bytes {
            self.bytes[write].store(*byte, Ordering::Relaxed);
            write = (write + 1) % N;
        }
        self.write.store(write, Ordering::Release);
        true
    }

    /// Adds a frame. Frames of a stream leave a quarter of the queue to the replies.
    pub fn push_frame(&self, frame: &[u8], priority: Priority) -> bool {
        let kept = match priority {
            Priority::Stream => N / 4,
            Priority::Reply => 0,
        };
        frame.len() + kept <= self.free() && self.push(frame)
    }

    /// The next byte.
    pub fn pop(&self) -> Option<u8> {
        let read = self.read.load(Ordering::Relaxed);
        if read == self.write.load(Ordering::Acquire) {
            return None;
        }
        let byte = self.bytes[read].load(Ordering::Relaxed);
        self.read.store((read + 1) % N, Ordering::Release);
        Some(byte)
    }

    /// Moves bytes into `buffer` and returns their number.
    pub fn pop_into(&self, buffer: &mut [u8]) -> usize {
        let mut len = 0;
        for free in buffer {
            let Some(byte) = self.pop() else { break };
            *free = byte;
            len += 1;
        }
        len
    }
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_leave_in_their_order_and_a_frame_goes_in_whole_or_not_at_all() {
        let ring = Ring::<8>::new();
        for round in 0..20 {
            assert!(ring.push(&[round, 1, 2, 3]));
            assert!(!ring.push(&[9; 4]), "there are three bytes left");
            let mut buffer = [0; 8];
            assert_eq!(ring.pop_into(&mut buffer), 4);
            assert_eq!(buffer[..4], [round, 1, 2, 3]);
            assert_eq!(ring.pop(), None);
        }
    }

    #[test]
    fn a_stream_leaves_room_for_replies() {
        let ring = Ring::<400>::new();
        while ring.push_frame(&[1; 50], Priority::Stream) {}
        assert!(ring.free() >= 100);
        assert!(ring.push_frame(&[2; 100], Priority::Reply));
    }
}
