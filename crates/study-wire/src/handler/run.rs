//! A playback or recording under way: its samples, on their way to the host.

use super::Measured;
use crate::message::{Few, Recorded, RecordedPoint, Reply, Telemetry, TelemetrySample, fixed};
use crate::servo::tally::Tally;

/// What is under way, or was last.
#[derive(Debug, Clone, Default)]
pub(super) struct Run {
    /// The host's number; 0 before the first.
    pub(super) playback: u32,
    /// Servo periods so far.
    pub(super) ticks: u32,
    /// Samples taken so far.
    pub(super) samples: u32,
    since_ms: u32,
    /// `None`: as long as its path.
    longest_ms: Option<u32>,
    /// Servo periods between two samples; 0: none are taken.
    every: u32,
    /// Servo periods that a sample may wait.
    patience: u32,
    waiting: Waiting,
    /// When the last of them was taken.
    newest_ms: u32,
}

/// Samples that wait for company.
#[derive(Debug, Clone, Default)]
enum Waiting {
    #[default]
    None,
    Telemetry(Few<TelemetrySample, { Telemetry::MOST }>),
    Recorded(Few<RecordedPoint, { Recorded::MOST }>),
}

/// Longest wait of a sample, s: the screen shows it soon, and no frame is sent for
/// one sample alone.
const PATIENCE_S: f64 = 0.025;

impl Run {
    /// A playback begins.
    pub(super) fn play(
        playback: u32,
        now_ms: u32,
        longest_ms: u32,
        every: u32,
        servo_hz: f64,
    ) -> Self {
        Self {
            playback,
            since_ms: now_ms,
            longest_ms: Some(longest_ms),
            every,
            patience: (PATIENCE_S * servo_hz) as u32,
            ..Self::default()
        }
    }

    /// A recording begins.
    pub(super) fn record(playback: u32, now_ms: u32) -> Self {
        Self {
            playback,
            since_ms: now_ms,
            ..Self::default()
        }
    }

    /// Whether the longest duration has passed.
    pub(super) fn over(&self, now_ms: u32) -> bool {
        self.longest_ms
            .is_some_and(|longest| now_ms.wrapping_sub(self.since_ms) >= longest)
    }

    /// Counts a servo period of a playback; true if samples should go.
    pub(super) fn sampled(&mut self, measured: Measured, force_n: f64, now_ms: u32) -> bool {
        let tick = self.ticks;
        self.ticks = self.ticks.saturating_add(1);
        if self.every == 0 {
            return false;
        }
        if !matches!(self.waiting, Waiting::Telemetry(_)) {
            self.waiting = Waiting::Telemetry(Few::new());
        }
        let Waiting::Telemetry(waiting) = &mut self.waiting else {
            return false;
        };
        if tick.is_multiple_of(self.every) {
            waiting.push(TelemetrySample {
                tick,
                x_nm: fixed::nm(measured.motion.x_mm),
                v_um_s: fixed::um_s(measured.motion.v_mm_s),
                command_un: fixed::un(force_n),
                measured_un: fixed::maybe_un(measured.force_n),
            });
            self.samples = self.samples.saturating_add(1);
            self.newest_ms = now_ms;
        }
        let oldest = waiting.as_slice().first();
        waiting.is_full() || oldest.is_some_and(|oldest| tick - oldest.tick >= self.patience)
    }

    /// Takes in a point of a recording; true if samples should go.
    pub(super) fn recorded(&mut self, point: RecordedPoint, now_ms: u32) -> bool {
        if !matches!(self.waiting, Waiting::Recorded(_)) {
            self.waiting = Waiting::Recorded(Few::new());
        }
        let Waiting::Recorded(waiting) = &mut self.waiting else {
            return false;
        };
        waiting.push(point);
        self.samples = self.samples.saturating_add(1);
        self.newest_ms = now_ms;
        waiting.is_full()
    }

    /// What waits, as a message.
    pub(super) fn take(&mut self, tally: &Tally) -> Option<Reply> {
        let first = |waiting: usize| self.samples.saturating_sub(waiting as u32);
        let reply = match &self.waiting {
            Waiting::Telemetry(samples) if !samples.as_slice().is_empty() => {
                Reply::Telemetry(Telemetry {
                    playback: self.playback,
                    first: first(samples.as_slice().len()),
                    clock_ms: self.newest_ms,
                    strokes: tally.strokes,
                    clamps: count(tally.clamps),
                    samples: *samples,
                })
            }
            Waiting::Recorded(points) if !points.as_slice().is_empty() => {
                Reply::Recorded(Recorded {
                    playback: self.playback,
                    first: first(points.as_slice().len()),
                    clock_ms: self.newest_ms,
                    points: *points,
                })
            }
            _ => return None,
        };
        self.waiting = Waiting::None;
        Some(reply)
    }
}

/// A count as it goes over the wire.
pub(super) fn count(count: u64) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}
