#![doc = include_str!("../README.md")]
#![no_std]

pub mod ring;

use study_wire::frame::is_stream;
use study_wire::handler::{Drive, Handler, Measured};
use study_wire::message::Fault;
use study_wire::real::Real;

/// The hardware that a firmware provides. `R` is the precision of its servo.
pub trait Board<R> {
    /// Time, ms, wrapping at 2³².
    fn clock_ms(&self) -> u32;
    /// Moves bytes received by the serial port into `buffer` and returns their number.
    fn received(&mut self, buffer: &mut [u8]) -> usize;
    /// Queues a frame for the serial port, all of it or nothing, without waiting. A reply
    /// must not be lost while there is room for it: keep some of the queue free of the
    /// frames of a stream, such as TELEMETRY.
    fn send(&mut self, frame: &[u8], priority: Priority);
    /// Reads encoder, accelerometer and force sensor.
    fn measure(&mut self) -> Measured<R>;
    /// Applies a motor command until the next call.
    fn drive(&mut self, drive: Drive<R>);
    /// Whether a servo period was missed since the last call.
    fn overrun(&mut self) -> bool;
    /// Whether a guard or a button is open.
    fn guard_open(&mut self) -> bool;
    /// Feeds the hardware watchdog.
    fn feed_watchdog(&mut self);
}

/// What a full queue drops first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Priority {
    /// TELEMETRY, EVENT, RECORDED: a host can do without any of them.
    Stream,
    /// A reply, which its host waits for.
    Reply,
}

impl Priority {
    /// The priority of a frame of the handler.
    pub fn of(frame: &[u8]) -> Self {
        match is_stream(frame) {
            true => Self::Stream,
            false => Self::Reply,
        }
    }
}

/// Runs one servo period; call it from the timer interrupt. All calls of the handler are
/// made here, so no locks are needed.
pub fn period<const NODES: usize, const POINTS: usize, R: Real>(
    device: &mut Handler<NODES, POINTS, R>,
    board: &mut impl Board<R>,
) {
    let now_ms = board.clock_ms();
    if board.overrun() {
        device.overrun(now_ms, &mut |frame| board.send(frame, Priority::of(frame)));
    }
    if board.guard_open() {
        device.trip(Fault::External, now_ms, &mut |frame| {
            board.send(frame, Priority::of(frame));
        });
    }
    // The force comes first; received bytes can wait until the rest of the period.
    let measured = board.measure();
    let drive = device.servo(measured, now_ms, &mut |frame| {
        board.send(frame, Priority::of(frame));
    });
    board.drive(drive);
    board.feed_watchdog();

    // A few bytes per period are enough: 460,800 baud are 12 bytes at 4 kHz.
    let mut buffer = [0; 32];
    let len = board.received(&mut buffer).min(buffer.len());
    device.receive(&buffer[..len], now_ms, &mut |frame| {
        board.send(frame, Priority::of(frame));
    });
    if !device.state().applies_force() {
        board.drive(Drive::Force(R::ZERO));
    }
}
