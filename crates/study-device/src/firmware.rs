//! The simulated device: the handler of `study-wire` with a simulated motor and hand.
//!
//! [`Firmware`] receives and sends bytes and simulates time on request. Its behavior is
//! determined by its options, the received bytes and their times; the frequency of the
//! calls has no influence.
//!
//! The servo runs at every multiple of its period. A simulated hand takes the handle when
//! a playback starts and releases it shortly after the end. In a recording an ideal probe
//! moves the simulated target. `docs/simulation.md` describes the models. Nothing in the
//! reports is measured.

mod body;
mod flaw;
mod free;
mod motor;
mod wrong;

use body::Body;
pub use flaw::Flaw;
use flaw::FlawInjector;
pub use free::Place;
pub use motor::Motor;
use motor::Pending;
use std::time::Duration;
use study_base::limits::Limits;
use study_haptics::plant::{HandParameters, Parameters, Probe};
use study_wire::frame::Decoder;
use study_wire::handler::{Bounds, Drive, Handler, Measured, Out, Profile};
use study_wire::message::{DeviceState, Fault, Features, Flags, Loaded, Name, Reply};
use study_wire::servo::ServoSettings;
use wrong::Saboteur;
pub use wrong::{Wrong, WrongLoads};

/// Largest number of nodes of a table.
pub const MAX_NODES: usize = 1024;
/// Largest number of points of a path: more than two minutes at 1 kHz.
pub const MAX_POINTS: usize = 1 << 17;
/// From stop to stop, mm.
const STROKE_MM: [f64; 2] = [-20.0, 60.0];
/// A processor that hangs for this time is reset by its hardware watchdog.
const HARDWARE_WATCHDOG: Duration = Duration::from_millis(10);
/// Only this much of a longer idle time is simulated.
const IDLE: Duration = Duration::from_secs(1);

/// Options of a simulated device.
#[derive(Debug, Clone)]
pub struct Options {
    /// Seed of the hand's motion in each playback and of the probe's noise.
    pub seed: u64,
    /// Servo periods per second, limited to 500 … 20,000; 4000 for NaN.
    pub servo_hz: f64,
    /// Highest telemetry rate, samples per second.
    pub telemetry_hz: f64,
    /// Limits of the device.
    pub limits: Limits,
    /// Time without a fresh heartbeat after which it goes limp, ms.
    pub watchdog_ms: u16,
    /// Hand and slider.
    pub hand: HandParameters,
    /// Coulomb friction of a handle that nobody holds, N.
    pub friction_n: f64,
    /// Resolution of the position, mm.
    pub encoder_mm: f64,
    /// Target that the probe moves in a recording.
    pub target: Parameters,
    /// Smallest mass that is rendered, kg. Minus infinity renders every table unchanged,
    /// which may be unstable with any hand.
    pub least_mass_kg: f64,
    /// Initial time of its clock, ms; the clock wraps at 2³².
    pub clock_ms: u32,
    /// Serial number.
    pub serial: String,
    /// What the motor makes of a commanded force; telemetry does not show it.
    pub motor: Motor,
    /// Planted defect.
    pub flaw: Option<Flaw>,
    /// Wrong force.
    pub wrong: Option<WrongLoads>,
}

impl Default for Options {
    /// 4 kHz servo, 1 kHz telemetry, 15 N, 1 m/s, 30 ms, seed 0; the smallest mass
    /// compensates that of the slider.
    fn default() -> Self {
        let hand = HandParameters::default();
        Self {
            seed: 0,
            servo_hz: 4000.0,
            telemetry_hz: 1000.0,
            limits: Limits::new(15.0, 1000.0).expect("positive constants"),
            watchdog_ms: 30,
            hand,
            friction_n: 0.05,
            encoder_mm: Probe::default().encoder_mm,
            target: Parameters::a(),
            least_mass_kg: -hand.slider_kg,
            clock_ms: 0,
            serial: "simulated-1".to_owned(),
            motor: Motor::default(),
            flaw: None,
            wrong: None,
        }
    }
}

type AllHandler = Handler<MAX_NODES, MAX_POINTS>;

/// A simulated device.
#[derive(Debug)]
pub struct Firmware {
    options: Options,
    handler: Box<AllHandler>,
    body: Body,
    motor: Pending,
    /// Servo periods since the beginning.
    ticks: u64,
    period_ns: f64,
    /// When its clock started.
    started: Duration,
    clock_ms: u32,
    stall: Option<Stall>,
    injector: Option<FlawInjector>,
    saboteur: Option<Box<Saboteur>>,
    /// Current time of the simulation.
    now: Duration,
    /// Bytes received during a stall.
    unread: Vec<u8>,
    sent: Vec<u8>,
}

/// A time in which the processor hangs.
#[derive(Debug, Clone, Copy)]
struct Stall {
    since: Duration,
    until: Duration,
}

impl Firmware {
    /// A device that is powered up at time zero.
    pub fn new(mut options: Options) -> Self {
        options.servo_hz = if options.servo_hz.is_nan() {
            Options::default().servo_hz
        } else {
            options.servo_hz.clamp(500.0, 20_000.0)
        };
        Self {
            handler: Box::new(Handler::new(profile(&options))),
            body: Body::new(&options),
            motor: Pending::new(options.motor, options.servo_hz),
            ticks: 0,
            period_ns: 1e9 / options.servo_hz,
            started: Duration::ZERO,
            clock_ms: options.clock_ms,
            stall: None,
            injector: options
                .flaw
                .map(|flaw| FlawInjector::new(flaw, options.watchdog_ms)),
            saboteur: options
                .wrong
                .map(|how| Box::new(Saboteur::new(how, told(&options)))),
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

    /// The current state.
    pub fn state(&self) -> DeviceState {
        self.handler.state()
    }

    /// Why it is limp, or why the last playback ended.
    pub fn fault(&self) -> Fault {
        self.handler.fault()
    }

    /// The current force of the motor, N.
    pub fn held_n(&self) -> f64 {
        self.body.force_n()
    }

    /// Force limit of what is loaded, N; 0 if nothing is.
    pub fn limit_n(&self) -> f64 {
        self.handler.limit_n()
    }

    /// Processes bytes that the link has received at `at`.
    pub fn receive(&mut self, bytes: &[u8], at: Duration) {
        self.advance(at);
        if self.stall.is_some() {
            self.unread.extend_from_slice(bytes);
            return;
        }
        let changed = self.saboteur.as_mut().map(|own| own.inbound(bytes));
        let bytes = changed.as_deref().unwrap_or(bytes);
        let now_ms = self.clock(at);
        match &mut self.injector {
            None => self.handle(bytes, at),
            Some(injector) => {
                let [received, answers] = injector.inbound(bytes, at, now_ms);
                self.handle(&received, at);
                self.sent.extend(answers);
            }
        }
    }

    fn handle(&mut self, bytes: &[u8], at: Duration) {
        self.with_handler(at, |handler, now_ms, out| {
            handler.receive(bytes, now_ms, out)
        });
    }

    /// Takes the bytes to be sent.
    pub fn take_output(&mut self) -> Vec<u8> {
        let mut sent = std::mem::take(&mut self.sent);
        if let Some(saboteur) = &mut self.saboteur {
            sent = saboteur.outbound(&sent);
        }
        match &mut self.injector {
            None => sent,
            Some(injector) => injector.outbound(&sent, self.now),
        }
    }

    /// Simulates every servo period that begins before `until`.
    pub fn advance(&mut self, until: Duration) {
        let due = (until.as_secs_f64() * self.options.servo_hz + 1e-6) as u64;
        let idle = (IDLE.as_secs_f64() * self.options.servo_hz) as u64;
        if !self.handler.state().armed()
            && !self.body.moving()
            && self.stall.is_none()
            && due > self.ticks + idle
        {
            self.ticks = due - idle;
        }
        while self.ticks < due {
            let begins = Duration::from_nanos((self.ticks as f64 * self.period_ns).round() as u64);
            // Bytes may have been handled since: the device's clock never goes back.
            let at = begins.max(self.now);
            while let Some(late) = self.injector.as_mut().and_then(|t| t.overdue(at)) {
                self.handle(&late, at);
            }
            if self.awake(at) {
                self.servo(at);
            }
            self.body.pass();
            self.ticks += 1;
        }
        self.now = self.now.max(until);
    }

    /// Stalls the processor: nothing is read or sent, and the motor keeps its force. The
    /// hardware watchdog resets the processor after 10 ms; after a shorter stall it has
    /// missed servo periods.
    pub fn stall(&mut self, at: Duration, lasting: Duration) {
        self.advance(at);
        self.stall = Some(Stall {
            since: at,
            until: at + lasting,
        });
    }

    /// Restarts the device: nothing is loaded, there is no connection, the clock is 0.
    pub fn reset(&mut self, at: Duration) {
        self.advance(at);
        self.reboot(at);
    }

    /// Somebody brings the handle to this place and holds it there instead of moving it to and
    /// fro in playbacks, mm, as at a ruler.
    pub fn hold_at(&mut self, x_mm: f64) {
        self.body.hold_at(x_mm);
    }

    /// From now on nobody holds the handle: it moves as the motor pushes it, between its stops,
    /// until [`hold_at`](Self::hold_at).
    pub fn let_go(&mut self) {
        self.body.let_go();
    }

    /// A weight or a scale pulls at the free handle, N, positive towards +x.
    pub fn pull(&mut self, force_n: f64) {
        self.body.pull(force_n);
    }

    /// Where the handle is, and where a free one has been.
    pub fn place(&self) -> Place {
        self.body.place()
    }

    /// Trips, as by a guard, a button or a fault of the drive.
    pub fn trip(&mut self, fault: Fault, at: Duration) {
        self.advance(at);
        self.with_handler(at, |handler, now_ms, out| handler.trip(fault, now_ms, out));
    }

    /// Calls the handler at `at`, then lets hand and motor follow its state.
    fn with_handler<T>(
        &mut self,
        at: Duration,
        call: impl FnOnce(&mut AllHandler, u32, Out<'_>) -> T,
    ) -> T {
        let now_ms = self.clock(at);
        let sent = &mut self.sent;
        let result = call(&mut self.handler, now_ms, &mut |bytes| {
            sent.extend_from_slice(bytes)
        });
        self.update_body();
        result
    }

    // If it were inlined, every step would need half a megabyte of stack.
    #[cold]
    #[inline(never)]
    fn reboot(&mut self, at: Duration) {
        *self.handler = Handler::new(profile(&self.options));
        self.started = at;
        self.clock_ms = 0;
        self.stall = None;
        self.unread.clear();
        self.update_body();
    }

    /// Time of the device's clock, ms.
    fn clock(&self, at: Duration) -> u32 {
        let since = at.saturating_sub(self.started).as_millis();
        self.clock_ms.wrapping_add(since as u32)
    }

    /// Whether the processor runs at `at`.
    fn awake(&mut self, at: Duration) -> bool {
        let Some(stall) = self.stall else {
            return true;
        };
        if at >= stall.since + HARDWARE_WATCHDOG {
            self.reboot(at);
            return true;
        }
        if at < stall.until {
            return false;
        }
        self.stall = None;
        self.with_handler(at, |handler, now_ms, out| handler.overrun(now_ms, out));
        let unread = std::mem::take(&mut self.unread);
        self.handle(&unread, at);
        true
    }

    fn servo(&mut self, at: Duration) {
        let mut measured = self.body.measure();
        if let Some(saboteur) = &mut self.saboteur {
            measured.motion = saboteur.motion(measured.motion);
        }
        let drive = self.with_handler(at, |handler, now_ms, out| {
            handler.servo(measured, now_ms, out)
        });
        let drive = match &mut self.saboteur {
            Some(saboteur) => saboteur.drive(drive),
            None => drive,
        };
        self.body.drive(match drive {
            Drive::Force(force_n) => Drive::Force(self.motor.give(force_n)),
            probe @ Drive::Position { .. } => probe,
        });
    }

    /// Lets hand and motor follow the state of the handler.
    fn update_body(&mut self) {
        let forceful = self.handler.state().applies_force();
        if !forceful {
            self.body.release();
        } else if !self.body.is_held() {
            let range = match self.handler.loaded() {
                Loaded::Table => self.handler.range_mm(),
                _ => None,
            };
            self.body.take(range, self.handler.uploads());
        }
    }
}

/// The servo that the simulated device tells.
fn told(options: &Options) -> ServoSettings {
    ServoSettings {
        servo_hz: options.servo_hz,
        least_mass_kg: options.least_mass_kg,
        ..ServoSettings::default()
    }
}

/// The profile of the simulated device.
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
        features: Features {
            mechanism: true,
            elements: true,
            fade: true,
            ..Features::default()
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
            stiffness_n_per_mm: 100.0,
            damping_n_s_per_mm: 0.2,
            stroke_mm: STROKE_MM,
        },
        servo: match options.wrong {
            Some(how) => how.wrong.servo(told(options)),
            None => told(options),
        },
        rest_mm_s: 5.0,
        rest_s: 0.05,
    }
}

/// The replies in bytes that the handler wrote, with the sequence numbers of their requests.
fn replies(bytes: &[u8]) -> Vec<(u16, Reply)> {
    let mut decoder = Decoder::new();
    let mut found = Vec::new();
    for byte in bytes {
        if let Some(Ok(body)) = decoder.push(*byte)
            && let Ok((header, reply)) = Reply::decode(body)
        {
            found.push((header.sequence, reply));
        }
    }
    found
}
