//! The current playback or recording and its samples for the host.

use super::Measured;
use crate::message::{FixedVec, Recorded, RecordedPoint, Reply, Telemetry, TelemetrySample, fixed};
use crate::real::Real;
use crate::servo::tally::Tally;
use core::num::NonZeroU32;

/// The current or last playback or recording.
#[derive(Debug, Clone)]
pub(super) struct Run {
    /// The host's number for it; 0 before the first.
    pub(super) playback: u32,
    /// Servo periods so far.
    pub(super) ticks: u32,
    /// Samples taken so far.
    pub(super) samples: u32,
    since_ms: u32,
    /// Longest duration; `None` for a recording, which ends with its path.
    longest_ms: Option<u32>,
    /// Servo periods between two samples; `None` without telemetry.
    every: Option<NonZeroU32>,
    /// Servo periods that a sample may wait.
    max_wait: u32,
    batch: Batch,
    /// Time of the last sample in the batch.
    newest_ms: u32,
}

/// Samples collected for the next message.
#[derive(Debug, Clone)]
enum Batch {
    None,
    Telemetry(FixedVec<TelemetrySample, { Telemetry::MAX_SAMPLES }>),
    Recorded(FixedVec<RecordedPoint, { Recorded::MAX_POINTS }>),
}

/// Longest wait of a sample, s: short enough for a live display, long enough that
/// slow streams do not send one frame per sample.
const MAX_WAIT_S: f64 = 0.025;

impl Run {
    /// None so far.
    pub(super) const fn new() -> Self {
        Self {
            playback: 0,
            ticks: 0,
            samples: 0,
            since_ms: 0,
            longest_ms: None,
            every: None,
            max_wait: 0,
            batch: Batch::None,
            newest_ms: 0,
        }
    }

    /// A new playback.
    pub(super) fn play(
        playback: u32,
        now_ms: u32,
        longest_ms: u32,
        every: Option<NonZeroU32>,
        servo_hz: f64,
    ) -> Self {
        Self {
            playback,
            since_ms: now_ms,
            longest_ms: Some(longest_ms),
            every,
            max_wait: (MAX_WAIT_S * servo_hz) as u32,
            ..Self::new()
        }
    }

    /// A new recording.
    pub(super) fn record(playback: u32, now_ms: u32) -> Self {
        Self {
            playback,
            since_ms: now_ms,
            ..Self::new()
        }
    }

    /// Whether the longest duration has passed.
    pub(super) fn over(&self, now_ms: u32) -> bool {
        self.longest_ms
            .is_some_and(|longest| now_ms.wrapping_sub(self.since_ms) >= longest)
    }

    /// Counts a servo period of a playback; true if the batch should be sent.
    pub(super) fn add_period<R: Real>(
        &mut self,
        measured: Measured<R>,
        force_n: R,
        now_ms: u32,
    ) -> bool {
        let tick = self.ticks;
        self.ticks = self.ticks.saturating_add(1);
        let Some(every) = self.every else {
            return false;
        };
        if !matches!(self.batch, Batch::Telemetry(_)) {
            self.batch = Batch::Telemetry(FixedVec::new());
        }
        let Batch::Telemetry(batch) = &mut self.batch else {
            return false;
        };
        if tick.is_multiple_of(every.get()) {
            batch.push(TelemetrySample {
                tick,
                x_nm: fixed::nm(measured.motion.x_mm),
                v_um_s: fixed::um_s(measured.motion.v_mm_s),
                command_un: fixed::un(force_n),
                measured_un: measured.force_n.map(fixed::un),
            });
            self.samples = self.samples.saturating_add(1);
            self.newest_ms = now_ms;
        }
        let oldest = batch.as_slice().first();
        batch.is_full() || oldest.is_some_and(|oldest| tick - oldest.tick >= self.max_wait)
    }

    /// Adds a point of a recording; true if the batch should be sent.
    pub(super) fn add_point(&mut self, point: RecordedPoint, now_ms: u32) -> bool {
        if !matches!(self.batch, Batch::Recorded(_)) {
            self.batch = Batch::Recorded(FixedVec::new());
        }
        let Batch::Recorded(batch) = &mut self.batch else {
            return false;
        };
        batch.push(point);
        self.samples = self.samples.saturating_add(1);
        self.newest_ms = now_ms;
        batch.is_full()
    }

    /// Takes the batch as a message, if it has samples.
    pub(super) fn take<R: Real>(&mut self, tally: &Tally<R>) -> Option<Reply> {
        let first = |count: usize| self.samples.saturating_sub(count as u32);
        let reply = match &self.batch {
            Batch::Telemetry(samples) if !samples.as_slice().is_empty() => {
                Reply::Telemetry(Telemetry {
                    playback: self.playback,
                    first: first(samples.as_slice().len()),
                    clock_ms: self.newest_ms,
                    strokes: tally.strokes,
                    clamps: count(tally.clamps),
                    samples: *samples,
                })
            }
            Batch::Recorded(points) if !points.as_slice().is_empty() => Reply::Recorded(Recorded {
                playback: self.playback,
                first: first(points.as_slice().len()),
                clock_ms: self.newest_ms,
                points: *points,
            }),
            _ => return None,
        };
        self.batch = Batch::None;
        Some(reply)
    }
}

/// A count limited to the 32 bits of the wire format.
pub(super) fn count(count: u64) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}
