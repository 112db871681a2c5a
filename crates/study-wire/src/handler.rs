//! The device's side of the wire: bytes in, bytes out, time as an argument.
//!
//! A [`Handler`] is all of a device but its hardware: state machine, upload,
//! watchdog, servo. A firmware gives it what its serial port received, calls
//! [`Handler::servo`] once a servo period with what its sensors say, puts the
//! force that comes back on the motor, and sends the bytes that come out. The
//! simulated device does the same. `docs/wire.md` is the specification.
//!
//! Only `core`, `libm`, `crc` and slices: no clock, no allocation, no panic,
//! whatever bytes come in. `NODES` is the room for a table's nodes, 72 bytes each,
//! `POINTS` that for a path's points, 4 bytes each.
//!
//! All calls have to come from one context, or exclude each other.
//!
//! The invariants: force only in [`State::Ramp`] and [`State::Run`], never above
//! the limit that the table was accepted with; into those only by PLAY or RECORD
//! and only while the host is alive; out of [`State::Limp`] and [`State::Fault`]
//! only by REARM at rest.

mod path;
mod run;
mod table;
mod talk;

use super::frame::{Decoder, Frame, MAX_BODY};
use super::message::{Ack, Event, Fault, Flags, Happening, Loaded, Name, Refusal, Reply, State};
use super::servo::{Core, Rendering, Settings, State as Servo, Trip};
use crate::predict::Motion;
use path::Path;
use run::Run;
pub use table::Bounds;
use table::Table;

/// Where a handler's bytes go. They have to be taken whole, and without waiting.
pub type Out<'a> = &'a mut dyn FnMut(&[u8]);

/// What a device is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Its firmware and version.
    pub firmware: Name,
    /// Its serial number.
    pub serial: Name,
    /// What it has. [`Flags::probe`] needs room for points.
    pub flags: Flags,
    /// Time without a fresh heartbeat after which it goes limp, ms.
    pub watchdog_ms: u16,
    /// Longest playback, ms.
    pub longest_ms: u32,
    /// Most telemetry samples per second that its link carries.
    pub telemetry_hz: f64,
    /// What it renders stably and reaches.
    pub bounds: Bounds,
    /// The servo; force and velocity limits come from the table.
    pub servo: Settings,
    /// Below this speed the handle is at rest, mm/s.
    pub rest_mm_s: f64,
    /// For so long it has to be to re-arm, s.
    pub rest_s: f64,
}

/// What the sensors say at the beginning of a servo period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Of the handle.
    pub motion: Motion,
    /// The force that it takes, N, where there is a sensor.
    pub force_n: Option<f64>,
}

/// What the motor has to do in a servo period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drive {
    /// Hold this force, N, as the hand has to apply it; 0 is limp.
    Force(f64),
    /// Be there: a probe on its path.
    Position {
        /// mm.
        x_mm: f64,
        /// mm/s.
        v_mm_s: f64,
        /// With at most so much force, N.
        force_n: f64,
    },
}

/// Since when the host counts as alive, and for how long.
#[derive(Debug, Clone, Copy)]
struct Alive {
    since_ms: u32,
    for_ms: u32,
}

/// The request that was done last.
#[derive(Debug, Clone, Copy)]
struct Done {
    sequence: u16,
    /// CRC of its body and the reply to it; none of HELLO.
    request: Option<(u32, Frame)>,
}

/// A device without its hardware.
#[derive(Debug, Clone)]
pub struct Handler<const NODES: usize, const POINTS: usize> {
    profile: Profile,
    decoder: Decoder,
    state: State,
    fault: Fault,
    /// The connection's nonce.
    connection: Option<u32>,
    done: Option<Done>,
    /// Count of the newest heartbeat.
    beat: Option<u32>,
    alive: Option<Alive>,
    table: Table<NODES>,
    path: Path<POINTS>,
    loaded: Loaded,
    /// Of what is loaded.
    crc: u32,
    /// Largest force of what is loaded, N.
    limit_n: f64,
    core: Core,
    run: Run,
    /// Accepted uploads since power-up.
    uploads: u32,
    /// Number of the next message that nobody asked for.
    unasked: u16,
    /// To be told after the reply.
    event: Option<Event>,
    /// Servo periods that the handle has been at rest for.
    rested: u32,
    bad_frames: u32,
    stale_beats: u32,
}

impl<const NODES: usize, const POINTS: usize> Handler<NODES, POINTS> {
    /// A device that has just been powered up.
    pub fn new(profile: Profile) -> Self {
        Self {
            core: Core::new(profile.servo),
            profile,
            decoder: Decoder::new(),
            state: State::Boot,
            fault: Fault::None,
            connection: None,
            done: None,
            beat: None,
            alive: None,
            table: Table::new(),
            path: Path::new(),
            loaded: Loaded::Nothing,
            crc: 0,
            limit_n: 0.0,
            run: Run::default(),
            uploads: 0,
            unasked: 0,
            event: None,
            rested: 0,
            bad_frames: 0,
            stale_beats: 0,
        }
    }

    /// What it is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Why it is limp, or why the last playback ended.
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

    /// Where what is loaded was identified, mm.
    pub fn range_mm(&self) -> Option<[f64; 2]> {
        let begin = self.table.begin?;
        (self.loaded == Loaded::Table).then_some(begin.range_mm)
    }

    /// The force that it holds, N.
    pub fn held_n(&self) -> f64 {
        if self.state.forceful() {
            self.core.held_n()
        } else {
            0.0
        }
    }

    /// The largest force that what is loaded may have, N.
    pub fn limit_n(&self) -> f64 {
        self.limit_n
    }

    /// Takes in what the link has received.
    pub fn receive(&mut self, bytes: &[u8], now_ms: u32, out: Out<'_>) {
        self.supervise(now_ms, out);
        for byte in bytes {
            match self.decoder.push(*byte) {
                None => {}
                Some(Ok(body)) => {
                    // what is done with it may need all of the device
                    let mut copy = [0; MAX_BODY];
                    let len = body.len();
                    copy[..len].copy_from_slice(body);
                    self.handle(&copy[..len], now_ms, out);
                }
                Some(Err(_)) => self.bad_frames = self.bad_frames.wrapping_add(1),
            }
        }
    }

    /// Lets time pass; to be called at least once a millisecond. [`Handler::servo`]
    /// does it as well.
    pub fn supervise(&mut self, now_ms: u32, out: Out<'_>) {
        if self.state.armed() && !self.alive(now_ms) {
            self.latch(State::Limp, Fault::Watchdog, now_ms);
        } else if self.state.forceful() && self.run.over(now_ms) {
            self.fault = Fault::Longest;
            self.end();
        }
        if self.state == State::Stopping {
            self.flush(out);
            self.state = State::Loaded;
            self.happened(Happening::Stopped, now_ms);
        }
        self.tell(out);
    }

    /// One servo period: what the motor does until the next.
    pub fn servo(&mut self, measured: Measured, now_ms: u32, out: Out<'_>) -> Drive {
        let motion = measured.motion;
        let still = libm::fabs(motion.v_mm_s) <= self.profile.rest_mm_s;
        self.rested = if still {
            self.rested.saturating_add(1)
        } else {
            0
        };
        self.supervise(now_ms, out);
        if !self.state.forceful() {
            return Drive::Force(0.0);
        }
        match self.loaded {
            Loaded::Table => self.play(measured, now_ms, out),
            Loaded::Path => self.follow(measured, now_ms, out),
            Loaded::Nothing => Drive::Force(0.0),
        }
    }

    /// Goes limp and stays so: what only the hardware can know, such as
    /// [`Fault::Overrun`] or [`Fault::External`].
    pub fn trip(&mut self, fault: Fault, now_ms: u32, out: Out<'_>) {
        self.latch(State::Fault, fault, now_ms);
        self.tell(out);
    }

    fn play(&mut self, measured: Measured, now_ms: u32, out: Out<'_>) -> Drive {
        let Some(begin) = &self.table.begin else {
            return Drive::Force(0.0);
        };
        let what = Rendering {
            table: self.table.view(),
            rule: begin.direction,
            range_mm: begin.range_mm,
            trained_mm_s: begin.trained_mm_s,
        };
        let force_n = self.core.step(&what, measured.motion);
        if let Servo::Tripped(why) = self.core.state() {
            self.latch(State::Fault, fault_of(why), now_ms);
            self.tell(out);
            return Drive::Force(0.0);
        }
        if self.run.sampled(measured, force_n, now_ms) {
            self.flush(out);
        }
        let full = self.profile.servo.ramp_s * self.profile.servo.servo_hz;
        if self.state == State::Ramp && f64::from(self.run.ticks) >= full {
            self.state = State::Run;
        }
        Drive::Force(force_n)
    }

    /// Zero force, latched. The first cause stays, but a trip tops a limp.
    fn latch(&mut self, state: State, fault: Fault, now_ms: u32) {
        self.core.limp();
        self.unload();
        if self.state == State::Fault || self.state == state {
            return;
        }
        self.state = state;
        self.fault = fault;
        self.happened(Happening::Latched, now_ms);
    }

    /// Zero force; what is loaded stays.
    fn end(&mut self) {
        self.core.limp();
        self.state = State::Stopping;
    }

    fn unload(&mut self) {
        self.table.clear();
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
        f64::from(self.rested) >= self.profile.rest_s * self.profile.servo.servo_hz
    }

    fn happened(&mut self, what: Happening, now_ms: u32) {
        self.event = Some(Event {
            what,
            state: self.state,
            fault: self.fault,
            playback: self.run.playback,
            tick: self.run.ticks,
            clock_ms: now_ms,
        });
    }

    /// What is left of the stream, then the event.
    fn tell(&mut self, out: Out<'_>) {
        if let Some(event) = self.event.take() {
            self.flush(out);
            self.send(Reply::Event(event), out);
        }
    }

    /// The samples that wait.
    fn flush(&mut self, out: Out<'_>) {
        let tally = self.core.tally();
        if let Some(stream) = self.run.take(&tally) {
            self.send(stream, out);
        }
    }

    /// Sends what nobody asked for.
    fn send(&mut self, reply: Reply, out: Out<'_>) {
        out(reply.frame(self.unasked).as_bytes());
        self.unasked = self.unasked.wrapping_add(1);
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
        Trip::Told => Fault::External,
    }
}
