//! The simulated device's side of the link: the handler, a servo, a hand.
//!
//! [`Firmware`] is a device at the end of a wire: bytes go in, bytes come out, and
//! time passes when it is told so. What it plays and says follows from its
//! options, the bytes and the instants of both; how often it is looked at in
//! between changes nothing.
//!
//! The servo runs at every multiple of its period. A hand takes the handle when a
//! playback starts and lets go of it a little after its end; the probe of a
//! recording is ideal and moves the simulated target. `docs/simulation.md` says
//! what they are made of. Nothing that it reports is measured.

mod body;
mod flaw;

use body::Body;
pub use flaw::Flaw;
use flaw::Tamper;
use std::time::Duration;
use study_base::limits::{Limit, Limits};
use study_haptics::plant::{HandParameters, Parameters};
use study_wire::handler::{Bounds, Drive, Handler, Measured, Profile};
use study_wire::message::{Fault, Flags, Loaded, Name, State};
use study_wire::servo::Settings;

/// Room for a table's nodes.
pub const MOST_NODES: usize = 1024;
/// Room for a path's points: two minutes at 1 kHz and more.
pub const MOST_POINTS: usize = 1 << 17;
/// A processor that does not answer its hardware watchdog for so long is reset.
const HARDWARE_WATCHDOG: Duration = Duration::from_millis(10);
/// Time that is passed over when nothing can happen in it.
const IDLE: Duration = Duration::from_secs(1);

/// What a simulated device is like.
#[derive(Debug, Clone)]
pub struct Options {
    /// Decides how the hand moves in each playback, and the probe's noise.
    pub seed: u64,
    /// Servo periods per second, held to 500 … 20,000; no number reads as 4000.
    pub servo_hz: f64,
    /// Most telemetry samples per second.
    pub telemetry_hz: f64,
    /// What the device never exceeds.
    pub limits: Limits,
    /// Without a fresh heartbeat for so long it goes limp, ms.
    pub watchdog_ms: u16,
    /// Hand and slider.
    pub hand: HandParameters,
    /// What the probe of a recording moves.
    pub target: Parameters,
    /// Smallest mass that is rendered, kg: minus infinity plays every table as it
    /// is, which no hand may be able to hold.
    pub least_mass_kg: f64,
    /// What its clock says at the beginning, ms: a clock wraps at 2³².
    pub clock_ms: u32,
    /// Names it.
    pub serial: String,
    /// What is wrong with it.
    pub flaw: Option<Flaw>,
}

impl Default for Options {
    /// 4 kHz servo, 1 kHz telemetry, 15 N, 1 m/s, 30 ms, seed 0; no less mass than
    /// the slider's own can be taken away.
    fn default() -> Self {
        let limit = |value| Limit::new(value).expect("a positive constant");
        let hand = HandParameters::default();
        Self {
            seed: 0,
            servo_hz: 4000.0,
            telemetry_hz: 1000.0,
            limits: Limits {
                force_n: limit(15.0),
                velocity_mm_s: limit(1000.0),
            },
            watchdog_ms: 30,
            hand,
            target: Parameters::a(),
            least_mass_kg: -hand.slider_kg,
            clock_ms: 0,
            serial: "simulated-1".to_owned(),
            flaw: None,
        }
    }
}

/// A simulated device.
#[derive(Debug)]
pub struct Firmware {
    options: Options,
    handler: Box<Handler<MOST_NODES, MOST_POINTS>>,
    body: Body,
    /// Servo periods since the beginning.
    ticks: u64,
    period_ns: f64,
    /// When its clock began to count.
    started: Duration,
    clock_ms: u32,
    stalled_until: Option<Stall>,
    tamper: Option<Tamper>,
    /// Up to when time has passed.
    now: Duration,
    /// What came while it stalled.
    unread: Vec<u8>,
    sent: Vec<u8>,
}

#[derive(Debug, Clone, Copy)]
struct Stall {
    since: Duration,
    until: Duration,
}

impl Firmware {
    /// A device that has just been powered up, at the instant zero.
    pub fn new(mut options: Options) -> Self {
        options.servo_hz = if options.servo_hz.is_nan() {
            Options::default().servo_hz
        } else {
            options.servo_hz.clamp(500.0, 20_000.0)
        };
        Self {
            handler: Box::new(Handler::new(profile(&options))),
            body: Body::new(&options),
            ticks: 0,
            period_ns: 1e9 / options.servo_hz,
            started: Duration::ZERO,
            clock_ms: options.clock_ms,
            stalled_until: None,
            tamper: options
                .flaw
                .map(|flaw| Tamper::new(flaw, options.watchdog_ms)),
            now: Duration::ZERO,
            unread: Vec::new(),
            sent: Vec::new(),
            options,
        }
    }

    /// One servo period.
    pub fn period(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.options.servo_hz)
    }

    /// What it is doing.
    pub fn state(&self) -> State {
        self.handler.state()
    }

    /// Why it is limp.
    pub fn fault(&self) -> Fault {
        self.handler.fault()
    }

    /// The force on the motor at this moment, N.
    pub fn held_n(&self) -> f64 {
        self.body.force_n()
    }

    /// The largest force that what is loaded may have, N; 0 if nothing is.
    pub fn limit_n(&self) -> f64 {
        self.handler.limit_n()
    }

    /// Takes in what the link has received by `at`.
    pub fn receive(&mut self, bytes: &[u8], at: Duration) {
        self.advance(at);
        if self.stalled_until.is_some() {
            self.unread.extend_from_slice(bytes);
            return;
        }
        let now_ms = self.clock(at);
        match &mut self.tamper {
            None => self.hear(bytes, at),
            Some(tamper) => {
                let [heard, answered] = tamper.inbound(bytes, at, now_ms);
                self.hear(&heard, at);
                self.sent.extend(answered);
            }
        }
    }

    fn hear(&mut self, bytes: &[u8], at: Duration) {
        let now_ms = self.clock(at);
        let sent = &mut self.sent;
        self.handler
            .receive(bytes, now_ms, &mut |bytes| sent.extend_from_slice(bytes));
        self.notice();
    }

    /// What it has said since this was asked last.
    pub fn take_output(&mut self) -> Vec<u8> {
        let said = std::mem::take(&mut self.sent);
        match &mut self.tamper {
            None => said,
            Some(tamper) => tamper.outbound(&said, self.now),
        }
    }

    /// Lets time pass: every servo period that begins before `until`.
    pub fn advance(&mut self, until: Duration) {
        let due = (until.as_secs_f64() * self.options.servo_hz + 1e-6) as u64;
        let idle = (IDLE.as_secs_f64() * self.options.servo_hz) as u64;
        if !self.handler.state().armed()
            && !self.body.moving()
            && self.stalled_until.is_none()
            && due > self.ticks + idle
        {
            self.ticks = due - idle;
        }
        while self.ticks < due {
            let at = Duration::from_nanos((self.ticks as f64 * self.period_ns).round() as u64);
            while let Some(late) = self.tamper.as_mut().and_then(|t| t.overdue(at)) {
                self.hear(&late, at);
            }
            if self.awake(at) {
                self.servo(at);
            }
            self.body.pass();
            self.ticks += 1;
        }
        self.now = self.now.max(until);
    }

    /// Hangs for a while: nothing is read or sent, and the motor goes on with the
    /// force that it has. The hardware's own watchdog resets a processor that
    /// hangs for 10 ms; one that comes back before has missed servo periods.
    pub fn stall(&mut self, at: Duration, lasting: Duration) {
        self.advance(at);
        self.stalled_until = Some(Stall {
            since: at,
            until: at + lasting,
        });
    }

    /// Powers up anew: nothing is loaded, nobody has said HELLO, the clock starts.
    pub fn reset(&mut self, at: Duration) {
        self.advance(at);
        self.reboot(at);
    }

    /// Trips: a guard, a button, a drive's fault.
    pub fn trip(&mut self, fault: Fault, at: Duration) {
        self.advance(at);
        let now_ms = self.clock(at);
        let sent = &mut self.sent;
        self.handler
            .trip(fault, now_ms, &mut |bytes| sent.extend_from_slice(bytes));
        self.notice();
    }

    // inlined, it would give its half a megabyte of stack to every step
    #[cold]
    #[inline(never)]
    fn reboot(&mut self, at: Duration) {
        *self.handler = Handler::new(profile(&self.options));
        self.started = at;
        self.clock_ms = 0;
        self.stalled_until = None;
        self.unread.clear();
        self.notice();
    }

    /// Its own clock, ms.
    fn clock(&self, at: Duration) -> u32 {
        let since = at.saturating_sub(self.started).as_millis();
        self.clock_ms.wrapping_add(since as u32)
    }

    /// Whether the processor runs at this instant.
    fn awake(&mut self, at: Duration) -> bool {
        let Some(stall) = self.stalled_until else {
            return true;
        };
        if at >= stall.since + HARDWARE_WATCHDOG {
            self.reboot(at);
            return true;
        }
        if at < stall.until {
            return false;
        }
        self.stalled_until = None;
        if self.handler.state().forceful() {
            let now_ms = self.clock(at);
            let sent = &mut self.sent;
            self.handler.trip(Fault::Overrun, now_ms, &mut |bytes| {
                sent.extend_from_slice(bytes);
            });
        }
        let unread = std::mem::take(&mut self.unread);
        self.hear(&unread, at);
        true
    }

    fn servo(&mut self, at: Duration) {
        let now_ms = self.clock(at);
        let measured = self.body.measure();
        let sent = &mut self.sent;
        let drive = self
            .handler
            .servo(measured, now_ms, &mut |bytes| sent.extend_from_slice(bytes));
        self.notice();
        self.body.drive(drive);
    }

    /// Hand and motor follow what the handler has come to.
    fn notice(&mut self) {
        let forceful = self.handler.state().forceful();
        if !forceful {
            self.body.release();
        } else if !self.body.taken() {
            let range = match self.handler.loaded() {
                Loaded::Table => self.handler.range_mm(),
                _ => None,
            };
            self.body.take(range, self.handler.uploads());
        }
    }
}

/// What the simulated device says of itself.
fn profile(options: &Options) -> Profile {
    Profile {
        firmware: Name::new(concat!("study ", env!("CARGO_PKG_VERSION"))),
        serial: Name::new(&options.serial),
        flags: Flags {
            force_sensor: false,
            simulated: true,
            telemetry: options.telemetry_hz > 0.0,
            probe: true,
        },
        watchdog_ms: match options.flaw {
            Some(Flaw::LateWatchdog) => flaw::LATE_MS,
            _ => options.watchdog_ms,
        },
        longest_ms: 600_000,
        telemetry_hz: options.telemetry_hz.max(0.1),
        bounds: Bounds {
            force_n: options.limits.force_n.get(),
            velocity_mm_s: options.limits.velocity_mm_s.get(),
            stiffness_n_per_mm: 25.0,
            damping_n_s_per_mm: 0.2,
            stroke_mm: [-20.0, 60.0],
        },
        servo: Settings {
            servo_hz: options.servo_hz,
            least_mass_kg: options.least_mass_kg,
            ..Settings::default()
        },
        rest_mm_s: 5.0,
        rest_s: 0.05,
    }
}
