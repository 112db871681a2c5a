//! The device's side of `study`'s wire format, for a firmware.
//!
//! No code of its own but [`Board`] and [`period`]: the modules are those of
//! `study` itself, compiled without `std` and without an allocator. What the
//! simulated device runs is what a motor's processor runs. `docs/wire.md` says what
//! a firmware has to do beside it.
//!
//! It uses f64 throughout, so that a table is judged and played on the device bit
//! for bit as on the host. A processor with a double-precision unit is the right
//! one (a Cortex-M7, say); on a Cortex-M4F it runs, several times slower.

#![no_std]

use study_wire::handler::{Drive, Handler, Measured};
use study_wire::message::Fault;

/// Room for a table of 512 nodes (36 KiB) and no probe mode. It belongs into a
/// static, made in place: on a stack it takes 38 KiB.
pub type Device = Handler<512, 0>;

/// What a firmware has to have.
pub trait Board {
    /// A clock that counts milliseconds and wraps at 2³².
    fn clock_ms(&self) -> u32;
    /// Bytes that the serial port has received: how many of `room` it filled.
    fn received(&mut self, room: &mut [u8]) -> usize;
    /// Queues bytes for the serial port, all or none; it must not wait.
    fn send(&mut self, bytes: &[u8]);
    /// Encoder, accelerometer, force sensor.
    fn measure(&mut self) -> Measured;
    /// What the motor does until the next call.
    fn drive(&mut self, drive: Drive);
    /// Whether a servo period was missed since the last call.
    fn overrun(&mut self) -> bool;
    /// Whether a guard or a button has opened.
    fn guard_open(&mut self) -> bool;
    /// Tells the hardware's own watchdog that the servo runs.
    fn feed_watchdog(&mut self);
}

/// One servo period, from the timer's interrupt. Everything happens here, so that
/// nothing has to be locked.
pub fn period(device: &mut Device, board: &mut dyn Board) {
    let now_ms = board.clock_ms();
    if board.overrun() {
        device.trip(Fault::Overrun, now_ms, &mut |bytes| board.send(bytes));
    }
    if board.guard_open() {
        device.trip(Fault::External, now_ms, &mut |bytes| board.send(bytes));
    }
    // force first: what there is to read can wait for the rest of the period
    let measured = board.measure();
    let drive = device.servo(measured, now_ms, &mut |bytes| board.send(bytes));
    board.drive(drive);
    board.feed_watchdog();

    // at most a few bytes a period: 460,800 baud are 12 at 4 kHz
    let mut room = [0; 32];
    let len = board.received(&mut room).min(room.len());
    device.receive(&room[..len], now_ms, &mut |bytes| board.send(bytes));
    if !device.state().applies_force() {
        board.drive(Drive::Force(0.0));
    }
}
