//! Example of a firmware's main loop around `study-wire`.
//!
//! The example consists of the trait [`Board`] and the function [`period`]. Everything
//! else is in `study-wire`, which the simulated device uses as well. `docs/wire.md` lists
//! what a firmware has to do in addition.
//!
//! The arithmetic is f64, so that the device validates and renders a table with the same
//! results as the host. A processor with a double-precision unit such as a Cortex-M7 is
//! recommended; a Cortex-M4F is several times slower.

#![no_std]

use study_wire::handler::{Drive, Handler, Measured};
use study_wire::message::Fault;

/// A handler for tables of up to 512 nodes (36 KiB) without probe mode. Construct it in a
/// `static`; on a stack it takes 38 KiB.
pub type Device = Handler<512, 0>;

/// The hardware that a firmware provides.
pub trait Board {
    /// Time, ms, wrapping at 2³².
    fn clock_ms(&self) -> u32;
    /// Moves bytes received by the serial port into `buffer` and returns their number.
    fn received(&mut self, buffer: &mut [u8]) -> usize;
    /// Queues bytes for the serial port, all or none, without waiting.
    fn send(&mut self, bytes: &[u8]);
    /// Reads encoder, accelerometer and force sensor.
    fn measure(&mut self) -> Measured;
    /// Applies a motor command until the next call.
    fn drive(&mut self, drive: Drive);
    /// Whether a servo period was missed since the last call.
    fn overrun(&mut self) -> bool;
    /// Whether a guard or a button is open.
    fn guard_open(&mut self) -> bool;
    /// Feeds the hardware watchdog.
    fn feed_watchdog(&mut self);
}

/// Runs one servo period; call it from the timer interrupt. All calls of the handler are
/// made here, so no locks are needed.
pub fn period(device: &mut Device, board: &mut dyn Board) {
    let now_ms = board.clock_ms();
    if board.overrun() {
        device.overrun(now_ms, &mut |bytes| board.send(bytes));
    }
    if board.guard_open() {
        device.trip(Fault::External, now_ms, &mut |bytes| board.send(bytes));
    }
    // The force comes first; received bytes can wait until the rest of the period.
    let measured = board.measure();
    let drive = device.servo(measured, now_ms, &mut |bytes| board.send(bytes));
    board.drive(drive);
    board.feed_watchdog();

    // A few bytes per period are enough: 460,800 baud are 12 bytes at 4 kHz.
    let mut buffer = [0; 32];
    let len = board.received(&mut buffer).min(buffer.len());
    device.receive(&buffer[..len], now_ms, &mut |bytes| board.send(bytes));
    if !device.state().applies_force() {
        board.drive(Drive::Force(0.0));
    }
}
