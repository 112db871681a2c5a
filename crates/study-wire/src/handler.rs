//! The device's side of the protocol: bytes in, bytes out, time as an argument.
//!
//! A [`Handler`] is a complete device except for its hardware: state machine,
//! upload, watchdog and servo. A firmware
//!
//! - passes the bytes that its serial port received to [`Handler::receive`],
//! - calls [`Handler::servo`] once per servo period with the [`Measured`] values,
//! - applies the [`Drive`] that this call returns to the motor,
//! - and sends the bytes that the handler writes to its [`Out`] argument.
//!
//! The simulated device does the same. `docs/wire.md` is the specification.
//!
//! It has no clock and does not panic, whatever bytes it receives. `NODES` is the capacity
//! for the nodes of a table and for the values of a mechanism, together 80 bytes each, or 44 in
//! single precision; `POINTS` is the
//! capacity for the points of a path, 4 bytes each; the rest takes less than 3.5 KiB. All calls must come from one context or exclude each other.
//!
//! Invariants:
//!
//! - There is force only in [`DeviceState::Ramp`] and [`DeviceState::Run`], and never
//!   more than the limit that the upload was accepted with.
//! - Only PLAY and RECORD lead into those states, and only while the host is alive.
//! - Only REARM at rest leads out of [`DeviceState::Limp`] and [`DeviceState::Fault`].

mod mechanism;
mod path;
mod requests;
mod run;
mod table;

use super::frame::{Decoder, Frame, MAX_BODY};
use super::message::{
    Ack, DeviceState, Event, EventKind, Fault, Features, Flags, Loaded, Name, Refusal, Reply,
};
use super::servo::{Law, Rendering, Servo, ServoSettings, ServoState, Trip};
use crate::predict::Motion;
use crate::real::Real;
use mechanism::MechanismBuffer;
use path::PathBuffer;
use run::Run;
pub use table::Bounds;
use table::TableBuffer;

/// Receives the bytes that a handler sends. It must take all bytes without waiting.
pub type Out<'a> = &'a mut dyn FnMut(&[u8]);

/// Properties and limits of a device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Name and version of the firmware.
    pub firmware: Name,
    /// Serial number of the device.
    pub serial: Name,
    /// Optional features. [`Flags::probe`] needs `POINTS` > 0.
    pub flags: Flags,
    /// Features of minor version 1.
    pub features: Features,
    /// Time without a fresh heartbeat after which the device goes limp, ms.
    pub watchdog_ms: u16,
    /// Longest playback, ms.
    pub longest_ms: u32,
    /// Highest telemetry rate of the link, samples per second.
    pub telemetry_hz: f64,
    /// Limits for uploads.
    pub bounds: Bounds,
    /// Settings of the servo; the upload gives its force and velocity limits.
    pub servo: ServoSettings,
    /// Largest speed at which the handle counts as at rest, mm/s.
    pub rest_mm_s: f64,
    /// Time at rest that REARM requires, s.
    pub rest_s: f64,
}

/// Sensor values at the beginning of a servo period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured<R = f64> {
    /// Motion of the handle.
    pub motion: Motion<R>,
    /// Measured force, N; `None` without a force sensor.
    pub force_n: Option<R>,
}

/// Command for the motor until the next servo period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drive<R = f64> {
    /// Render this force, N, with the sign of the force that the hand applies.
    Force(R),
    /// Control the position: a probe follows its path.
    Position {
        /// Target position, mm.
        x_mm: R,
        /// Target speed, mm/s.
        v_mm_s: R,
        /// Largest force, N.
        force_n: R,
    },
}

/// The period for which the last fresh heartbeat keeps the host alive.
#[derive(Debug, Clone, Copy)]
struct Alive {
    since_ms: u32,
    for_ms: u32,
}

/// The last request that was executed.
#[derive(Debug, Clone, Copy)]
struct LastRequest {
    sequence: u16,
    /// CRC of its body and the reply; `None` for HELLO, which has no repeats.
    request: Option<(u32, Frame)>,
}

/// A device without its hardware. The servo calculates with `R`, which is `f32` on a
/// processor without a double-precision unit.
#[derive(Debug, Clone)]
pub struct Handler<const NODES: usize, const POINTS: usize, R = f64> {
    profile: Profile,
    decoder: Decoder,
    state: DeviceState,
    fault: Fault,
    /// Nonce of the connection.
    connection: Option<u32>,
    /// Minor version of the connection.
    minor: u8,
    last_request: Option<LastRequest>,
    /// Count of the newest heartbeat.
    heartbeat: Option<u32>,
    alive: Option<Alive>,
    table: TableBuffer<NODES, R>,
    mechanism: MechanismBuffer<NODES, R>,
    path: PathBuffer<POINTS>,
    loaded: Loaded,
    /// CRC of what is loaded.
    crc: u32,
    /// Largest force of what is loaded, N.
    limit_n: f64,
    servo: Servo<R>,
    run: Run,
    /// Accepted uploads since power-up.
    uploads: u32,
    /// Sequence number of the next unsolicited message.
    unsolicited: u16,
    /// Event to send after the reply.
    event: Option<Event>,
    /// Servo periods for which the handle has been at rest.
    rest_periods: u32,
    bad_frames: u32,
    stale_beats: u32,
}

impl<const NODES: usize, const POINTS: usize, R: Real> Handler<NODES, POINTS, R> {
    /// A device that has just been powered up. As a constant it can be the value of a
    /// `static`.
    pub const fn new(profile: Profile) -> Self {
        Self {
            servo: Servo::limp_with(profile.servo),
            profile,
            decoder: Decoder::new(),
            state: DeviceState::Boot,
            fault: Fault::None,
            connection: None,
            minor: 0,
            last_request: None,
            heartbeat: None,
            alive: None,
            table: TableBuffer::new(),
            mechanism: MechanismBuffer::new(),
            path: PathBuffer::new(),
            loaded: Loaded::Nothing,
            crc: 0,
            limit_n: 0.0,
            run: Run::new(),
            uploads: 0,
            unsolicited: 0,
            event: None,
            rest_periods: 0,
            bad_frames: 0,
            stale_beats: 0,
        }
    }

    /// The current state.
    pub fn state(&self) -> DeviceState {
        self.state
    }

    /// Why the device is limp, or why the last playback ended.
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// Accepted uploads since power-up.
    pub fn uploads(&self) -> u32 {
        self.uploads
    }

    /// What is loaded.
    pub fn loaded(&self) -> Loaded {
        self.loaded
    }

    /// Identified range of the loaded table or mechanism, mm.
    pub fn range_mm(&self) -> Option<[f64; 2]> {
        let begun = (self.table.begin.map(|begin| begin.range_mm))
            .or(self.mechanism.begin.map(|begin| begin.range_mm))?;
        (self.loaded == Loaded::Table).then_some(begun)
    }

    /// The commanded force, N.
    pub fn held_n(&self) -> R {
        if self.state.applies_force() {
            self.servo.held_n()
        } else {
            R::ZERO
        }
    }

    /// Force limit of what is loaded, N; 0 if nothing is.
    pub fn limit_n(&self) -> f64 {
        self.limit_n
    }

    /// Received nodes, or values of a mechanism, that have not been judged so far.
    /// [`Handler::servo`] judges one a period while there is no force, and COMMIT the rest.
    /// A link of up to 32 bytes a period leaves at most the nodes of one chunk.
    pub fn unjudged(&self) -> usize {
        self.table.unjudged() + self.mechanism.unjudged()
    }

    /// Processes bytes that the link has received.
    pub fn receive(&mut self, bytes: &[u8], now_ms: u32, out: Out<'_>) {
        self.supervise(now_ms, out);
        for byte in bytes {
            match self.decoder.push(*byte) {
                None => {}
                Some(Ok(body)) => {
                    // The decoder owns the body, and handling needs all of `self`.
                    let mut copy = [0; MAX_BODY];
                    let len = body.len();
                    copy[..len].copy_from_slice(body);
                    self.handle(&copy[..len], now_ms, out);
                }
                Some(Err(_)) => self.bad_frames = self.bad_frames.wrapping_add(1),
            }
        }
    }

    /// Checks watchdog and playback duration. Call it at least once per millisecond;
    /// [`Handler::servo`] and [`Handler::receive`] include it.
    pub fn supervise(&mut self, now_ms: u32, out: Out<'_>) {
        if self.state.armed() && !self.alive(now_ms) {
            self.latch(DeviceState::Limp, Fault::Watchdog, now_ms);
        } else if self.state.applies_force() && self.run.over(now_ms) {
            self.fault = Fault::Longest;
            self.end();
        }
        if self.state == DeviceState::Stopping {
            self.flush(out);
            self.state = DeviceState::Loaded;
            self.queue_event(EventKind::Stopped, now_ms);
        }
        self.send_event(out);
    }

    /// Runs one servo period and returns the command for the motor.
    pub fn servo(&mut self, measured: Measured<R>, now_ms: u32, out: Out<'_>) -> Drive<R> {
        let motion = measured.motion;
        let still = motion.v_mm_s.abs() <= R::of(self.profile.rest_mm_s);
        self.rest_periods = if still {
            self.rest_periods.saturating_add(1)
        } else {
            0
        };
        self.supervise(now_ms, out);
        if !self.state.applies_force() {
            self.table.judge();
            self.mechanism.judge();
            return Drive::Force(R::ZERO);
        }
        match self.loaded {
            Loaded::Table => self.play(measured, now_ms, out),
            Loaded::Path => self.follow(measured, now_ms, out),
            Loaded::Nothing => Drive::Force(R::ZERO),
        }
    }

    /// The firmware missed a servo period. This is a fault only while there is force.
    pub fn overrun(&mut self, now_ms: u32, out: Out<'_>) {
        if self.state.applies_force() {
            self.trip(Fault::Overrun, now_ms, out);
        }
    }

    /// Switches the force off and latches this state. The firmware reports faults of
    /// the hardware this way, such as [`Fault::External`].
    pub fn trip(&mut self, fault: Fault, now_ms: u32, out: Out<'_>) {
        self.latch(DeviceState::Fault, fault, now_ms);
        self.send_event(out);
    }

    fn play(&mut self, measured: Measured<R>, now_ms: u32, out: Out<'_>) -> Drive<R> {
        let what = if let Some(begin) = &self.table.begin {
            Rendering {
                law: match self.table.elements() {
                    Some(elements) => Law::Elements(elements),
                    None => Law::Table {
                        table: self.table.view(),
                        rule: begin.direction,
                    },
                },
                range_mm: begin.range_mm,
                trained_mm_s: begin.trained_mm_s,
            }
        } else if let (Some(begin), Some(view)) = (&self.mechanism.begin, self.mechanism.view()) {
            Rendering {
                law: Law::Mechanism(view),
                range_mm: begin.range_mm,
                trained_mm_s: begin.trained_mm_s,
            }
        } else {
            return Drive::Force(R::ZERO);
        };
        let force_n = self.servo.step(&what, measured.motion);
        if let ServoState::Tripped(trip) = self.servo.state() {
            self.latch(DeviceState::Fault, fault_of(trip), now_ms);
            self.send_event(out);
            return Drive::Force(R::ZERO);
        }
        if self.run.add_period(measured, force_n, now_ms) {
            self.flush(out);
        }
        if self.state == DeviceState::Ramp {
            let full = self.profile.servo.ramp_s * self.profile.servo.servo_hz;
            if f64::from(self.run.ticks) >= full {
                self.state = DeviceState::Run;
            }
        }
        if self.servo.faded() {
            self.end();
            return Drive::Force(R::ZERO);
        }
        Drive::Force(force_n)
    }

    /// Sets the force to zero and latches. The first cause is kept, except that a
    /// fault replaces a limp.
    fn latch(&mut self, state: DeviceState, fault: Fault, now_ms: u32) {
        self.servo.limp();
        self.unload();
        if self.state == DeviceState::Fault || self.state == state {
            return;
        }
        self.state = state;
        self.fault = fault;
        self.queue_event(EventKind::Latched, now_ms);
    }

    /// Sets the force to zero; what is loaded is kept.
    fn end(&mut self) {
        self.servo.limp();
        self.state = DeviceState::Stopping;
    }

    fn unload(&mut self) {
        self.table.clear();
        self.mechanism.clear();
        self.path.clear();
        self.loaded = Loaded::Nothing;
        self.crc = 0;
        self.limit_n = 0.0;
    }

    fn alive(&self, now_ms: u32) -> bool {
        self.alive
            .is_some_and(|alive| now_ms.wrapping_sub(alive.since_ms) < alive.for_ms)
    }

    fn at_rest(&self) -> bool {
        f64::from(self.rest_periods) >= self.profile.rest_s * self.profile.servo.servo_hz
    }

    fn queue_event(&mut self, kind: EventKind, now_ms: u32) {
        self.event = Some(Event {
            kind,
            state: self.state,
            fault: self.fault,
            playback: self.run.playback,
            tick: self.run.ticks,
            clock_ms: now_ms,
        });
    }

    /// Sends the remaining samples, then the event.
    fn send_event(&mut self, out: Out<'_>) {
        if let Some(event) = self.event.take() {
            self.flush(out);
            self.send(Reply::Event(event), out);
        }
    }

    /// Sends the samples collected so far.
    fn flush(&mut self, out: Out<'_>) {
        let tally = self.servo.tally();
        if let Some(stream) = self.run.take(&tally) {
            self.send(stream, out);
        }
    }

    /// Sends an unsolicited message.
    fn send(&mut self, reply: Reply, out: Out<'_>) {
        out(reply.frame(self.unsolicited).as_bytes());
        self.unsolicited = self.unsolicited.wrapping_add(1);
    }

    fn ack(&self, request: u8, result: Result<(), (Refusal, u32)>, now_ms: u32) -> Reply {
        let (refusal, detail) = result.err().unwrap_or((Refusal::None, 0));
        Reply::Ack(Ack {
            request,
            refusal,
            state: self.state,
            fault: self.fault,
            clock_ms: now_ms,
            detail,
        })
    }
}

fn fault_of(trip: Trip) -> Fault {
    match trip {
        Trip::Velocity => Fault::Velocity,
        Trip::Stroke => Fault::Stroke,
        Trip::NotANumber => Fault::NotANumber,
        Trip::Encoder => Fault::Encoder,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROFILE: Profile = Profile {
        firmware: Name::new("test 1"),
        serial: Name::new("1"),
        flags: Flags {
            force_sensor: false,
            simulated: false,
            telemetry: true,
            probe: false,
        },
        features: Features {
            acceleration_from_speed: true,
            mechanism: true,
            elements: true,
            fade: true,
        },
        watchdog_ms: 30,
        longest_ms: 600_000,
        telemetry_hz: 1000.0,
        bounds: Bounds {
            force_n: 10.0,
            velocity_mm_s: 1000.0,
            stiffness_n_per_mm: 10.0,
            damping_n_s_per_mm: 0.1,
            stroke_mm: [0.0, 35.0],
        },
        servo: ServoSettings::new(),
        rest_mm_s: 5.0,
        rest_s: 0.05,
    };

    /// As a firmware holds it: without code at the start, and not on a stack.
    static DOUBLE: Handler<512, 0> = Handler::new(PROFILE);
    static SINGLE: Handler<512, 0, f32> = Handler::new(PROFILE);

    #[test]
    fn a_handler_is_a_constant_of_the_documented_size() {
        assert_eq!(DOUBLE.state(), DeviceState::Boot);
        assert_eq!(SINGLE.held_n(), 0.0);
        // 80 or 44 bytes a node, and the rest
        let rest = [
            size_of_val(&DOUBLE) - 80 * 512,
            size_of_val(&SINGLE) - 44 * 512,
        ];
        assert!(rest.iter().all(|rest| *rest < 3584), "{rest:?}");
        let probe = size_of::<Handler<2, 1000>>() - size_of::<Handler<2, 0>>();
        assert_eq!(probe, 4000);
    }

    #[test]
    fn the_default_servo_renders_no_negative_mass() {
        assert_eq!(ServoSettings::default().least_mass_kg, 0.0);
    }
}
