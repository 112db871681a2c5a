//! A simulated line in virtual time, with injected faults.
//!
//! Bytes arrive after the latency, in the pieces in which they were sent. Faults affect
//! single pieces, chosen by a seed. A dead line loses all bytes.

use std::collections::VecDeque;
use std::time::Duration;
use study_base::rng::Stream;

/// Fractions of the sent pieces that are affected by each fault, 0 to 1.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Noise {
    /// A bit is flipped.
    pub corrupt: f64,
    /// The piece is lost.
    pub drop: f64,
    /// The piece arrives twice.
    pub duplicate: f64,
    /// The piece overtakes the previous one, if that has not arrived yet.
    pub reorder: f64,
    /// The piece and all later ones arrive later by [`Noise::extra_delay`].
    pub delay: f64,
    /// Additional latency of a delayed piece.
    pub extra_delay: Duration,
    /// Fraction of the bytes in which a bit is flipped: longer pieces suffer more.
    pub byte_errors: f64,
    /// A piece that is longer than any but telemetry is lost.
    pub drop_telemetry: f64,
}

/// Only telemetry and uploads have longer pieces, and a lost upload is repeated.
const LONG_PIECE: usize = 100;

/// One direction of a line.
#[derive(Debug)]
pub struct Line {
    latency: Duration,
    noise: Noise,
    stream: Stream,
    queue: VecDeque<(Duration, Vec<u8>)>,
    dead: bool,
    pace: Pace,
    /// When the last byte that was sent has passed.
    free_at: Duration,
}

/// How fast a line is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Pace {
    /// Time that a byte takes; zero for a line that is faster than all that is sent.
    pub byte_time: Duration,
    /// An adapter hands over what has arrived at multiples of this time only, as one with a
    /// latency timer does; zero: at once.
    pub adapter: Duration,
}

impl Line {
    /// A line with a latency. `name` selects the random stream of its faults.
    pub fn new(latency: Duration, noise: Noise, seed: u64, name: &str) -> Self {
        Self {
            latency,
            noise,
            stream: Stream::new(seed, &["line", name]),
            queue: VecDeque::new(),
            dead: false,
            pace: Pace::default(),
            free_at: Duration::ZERO,
        }
    }

    /// Changes how fast it is.
    pub fn set_pace(&mut self, pace: Pace) {
        self.pace = pace;
    }

    /// Changes the faults.
    pub fn set_noise(&mut self, noise: Noise) {
        self.noise = noise;
    }

    /// Makes the line dead or usable; bytes in transit are lost.
    pub fn set_dead(&mut self, dead: bool) {
        self.dead = dead;
        self.queue.clear();
    }

    /// Sends one piece at time `at`.
    pub fn send(&mut self, mut bytes: Vec<u8>, at: Duration) {
        if bytes.is_empty() || self.dead {
            return;
        }
        self.free_at = self.free_at.max(at) + self.pace.byte_time * bytes.len() as u32;
        let mut due = self.free_at + self.latency;
        if !self.pace.adapter.is_zero() {
            let timer = self.pace.adapter.as_nanos();
            let due_ns = due.as_nanos().div_ceil(timer) * timer;
            due = Duration::from_nanos(u64::try_from(due_ns).unwrap_or(u64::MAX));
        }
        let n = self.noise;
        let whole = (1.0 - n.corrupt) * (1.0 - n.byte_errors).powf(bytes.len() as f64);
        let drop = match bytes.len() {
            0..=LONG_PIECE => n.drop,
            _ => 1.0 - (1.0 - n.drop) * (1.0 - n.drop_telemetry),
        };
        let fractions = [1.0 - whole, drop, n.duplicate, n.reorder, n.delay];
        if fractions.iter().all(|fraction| *fraction <= 0.0) {
            self.queue.push_back((due, bytes));
            return;
        }
        // Always the same number of draws, so that one fault does not change the next.
        let [corrupt, drop, duplicate, reorder, delay] =
            fractions.map(|fraction| self.stream.unit() < fraction);
        let bit = self.stream.below(8 * bytes.len() as u64);
        if corrupt {
            // The bit is within the piece, whose length is a usize.
            bytes[(bit / 8) as usize] ^= 1 << (bit % 8);
        }
        if drop {
            return;
        }
        if delay {
            due += self.noise.extra_delay;
        }
        if let Some((last, _)) = self.queue.back() {
            due = due.max(*last);
        }
        if duplicate {
            self.queue.push_back((due, bytes.clone()));
        }
        self.queue.push_back((due, bytes));
        let last = self.queue.len() - 1;
        if reorder && last > 0 {
            let earlier = self.queue[last - 1].0;
            self.queue.swap(last, last - 1);
            self.queue[last - 1].0 = earlier;
            self.queue[last].0 = due;
        }
    }

    /// Takes the bytes that have arrived by `at`.
    pub fn arrived(&mut self, at: Duration) -> Vec<u8> {
        let mut bytes = Vec::new();
        while let Some((due, _)) = self.queue.front()
            && *due <= at
        {
            if let Some((_, piece)) = self.queue.pop_front() {
                bytes.extend(piece);
            }
        }
        bytes
    }

    /// When the next bytes arrive; `None` if the line is empty.
    pub fn next(&self) -> Option<Duration> {
        self.queue.front().map(|(due, _)| *due)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn bytes_arrive_in_order_after_the_latency() {
        let mut line = Line::new(2 * MS, Noise::default(), 1, "a");
        line.send(vec![1, 2], MS);
        line.send(vec![3], 2 * MS);
        assert!(line.arrived(2 * MS).is_empty());
        assert_eq!(line.next(), Some(3 * MS));
        assert_eq!(line.arrived(3 * MS), [1, 2]);
        line.send(vec![4], 4 * MS);
        assert_eq!(line.arrived(9 * MS), [3, 4]);
        line.set_dead(true);
        line.send(vec![5], 9 * MS);
        line.set_dead(false);
        assert!(line.arrived(99 * MS).is_empty());
    }

    /// Two bytes of 3 ms each, and an adapter that looks every 16 ms.
    #[test]
    fn a_slow_line_takes_its_time() {
        let mut line = Line::new(MS, Noise::default(), 1, "c");
        line.set_pace(Pace {
            byte_time: 3 * MS,
            adapter: Duration::ZERO,
        });
        line.send(vec![1, 2], MS);
        line.send(vec![3], 2 * MS);
        assert!(line.arrived(7 * MS).is_empty());
        assert_eq!(line.arrived(8 * MS), [1, 2]);
        assert!(line.arrived(10 * MS).is_empty());
        assert_eq!(line.arrived(11 * MS), [3]);
        line.set_pace(Pace {
            byte_time: 3 * MS,
            adapter: 16 * MS,
        });
        line.send(vec![4], 20 * MS);
        assert!(line.arrived(31 * MS).is_empty());
        assert_eq!(line.arrived(32 * MS), [4]);
    }

    #[test]
    fn each_fault_does_what_it_says_about_as_often_as_asked() {
        let through = |noise: Noise| {
            let mut line = Line::new(MS, noise, 7, "b");
            let mut came = Vec::new();
            for i in 0..10_000u32 {
                line.send(vec![1], i * 10 * MS);
                line.send(vec![2], i * 10 * MS);
                came.push(line.arrived((i * 10 + 5) * MS));
                // Discard what arrives later, so that it does not count for the next.
                line.arrived((i * 10 + 9) * MS);
            }
            came
        };
        let part = |came: &[Vec<u8>], hit: &dyn Fn(&[u8]) -> bool| {
            came.iter().filter(|c| hit(c)).count() as f64 / came.len() as f64
        };
        let none = Noise::default();
        assert_eq!(part(&through(none), &|c| c == [1, 2]), 1.0);
        let dropped = through(Noise { drop: 0.1, ..none });
        assert!((part(&dropped, &|c| c.len() < 2) - 0.19).abs() < 0.02);
        let twice = through(Noise {
            duplicate: 0.1,
            ..none
        });
        assert!((part(&twice, &|c| c.len() > 2) - 0.19).abs() < 0.02);
        let swapped = through(Noise {
            reorder: 0.1,
            ..none
        });
        assert!((part(&swapped, &|c| c == [2, 1]) - 0.1).abs() < 0.02);
        let broken = through(Noise {
            corrupt: 0.1,
            ..none
        });
        assert!((part(&broken, &|c| c != [1, 2]) - 0.19).abs() < 0.02);
        let late = through(Noise {
            delay: 0.1,
            extra_delay: 6 * MS,
            ..none
        });
        assert!((part(&late, &|c| c.len() < 2) - 0.19).abs() < 0.02);
    }
}
