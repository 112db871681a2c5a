//! The host's side of the wire format: bytes in, bytes out, time as an argument.
//!
//! A [`Host`] opens connections, uploads tables, plays and stops. It sends one request
//! at a time and repeats it every [`RETRY_INTERVAL`], up to [`MAX_TRIES`] times. Then the
//! device counts as lost, and the host tries to reconnect. Heartbeats are sent only
//! while the user interface calls [`Host::keep_alive`].
//!
//! A host has neither clock nor port: [`link`](super::link) runs it on a thread with a
//! port, [`virtual_device`](super::virtual_device) in virtual time with the simulated
//! device.

mod arrivals;
mod clock;
mod fade;
mod lateness;
mod replies;
mod stage;
mod trips;
pub(super) mod upload;

pub use arrivals::Arrivals;
pub use clock::DeviceClock;
pub use lateness::Lateness;
pub use trips::Trips;
pub use upload::load_time;

use super::{DeviceError, Identity, Report, Stimulus};
use stage::Stage;
use std::collections::VecDeque;
use std::num::NonZeroU16;
use std::time::Duration;
use study_base::limits::Limits;
use study_base::text::{Untrusted, is_unsafe};
use study_wire::frame::Decoder;
use study_wire::message::{self, Heartbeat, Hello, Play, Reply, Request, Stop, WireError};
use study_wire::servo::ServoSettings;

/// Time after which an unanswered request is sent again.
pub const RETRY_INTERVAL: Duration = Duration::from_millis(100);
/// Longest time for a COMMIT, wire.md 11.2, ms.
const MAX_COMMIT_MS: u16 = 1000;
/// Time on the way that COMMIT has in addition to the device's own.
const COMMIT_SLACK: Duration = Duration::from_millis(50);
/// Number of times a request is sent before the device counts as lost.
pub const MAX_TRIES: u32 = 5;
/// Time between heartbeats while the device's watchdog is active.
pub const HEARTBEAT_INTERVAL: Duration = Duration::from_millis(10);
/// Time between heartbeats otherwise, to notice when the device is lost.
const IDLE_HEARTBEAT_INTERVAL: Duration = Duration::from_millis(100);
/// Heartbeats stop when the user interface has not polled for this time.
pub const SUPERVISION_TIMEOUT: Duration = Duration::from_millis(100);
/// A heartbeat expires this long after the watchdog time, ms.
const DEADLINE_SLACK_MS: u32 = 10;
/// Largest distance of a deadline, ms. The limit of wire.md 6.1 is 1000 ms on the
/// device's clock, which the host only estimates.
const MAX_DEADLINE_MS: u32 = 900;
/// A device that answers no heartbeat for this time is lost.
const REPLY_TIMEOUT: Duration = Duration::from_millis(500);
/// Time for the handle to come to rest before an upload.
const REST_TIMEOUT: Duration = Duration::from_secs(4);
/// Time between two attempts to reconnect to a device that does not answer.
const RECONNECT_INTERVAL: Duration = Duration::from_millis(500);
/// Requested longest playback, ms; the device's own limit may be lower.
const LONGEST_MS: u32 = 10 * 60 * 1000;
/// Number of heartbeats whose send time is stored.
const MAX_PENDING_HEARTBEATS: usize = 64;

/// A request without an answer so far.
#[derive(Debug, Clone, Copy)]
struct PendingRequest {
    request: Request,
    sequence: u16,
    sent: Duration,
    tries: u32,
}

/// When the next REARM is sent, and when the host stops trying.
#[derive(Debug, Clone, Copy)]
struct RearmRetry {
    next: Duration,
    until: Duration,
}

/// Settings of a host.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HostSettings {
    /// Heartbeats stop this long after the last [`Host::keep_alive`]. `None`: without
    /// supervision, for virtual time.
    pub supervision_timeout: Option<Duration>,
    /// Requested telemetry rate, samples per second.
    pub telemetry_hz: f64,
}

impl Default for HostSettings {
    /// [`SUPERVISION_TIMEOUT`] and 1 kHz.
    fn default() -> Self {
        Self {
            supervision_timeout: Some(SUPERVISION_TIMEOUT),
            telemetry_hz: 1000.0,
        }
    }
}

/// Quality of the link.
#[derive(Debug, Clone, Default)]
pub struct Health {
    /// Estimate of the device's clock.
    pub clock: DeviceClock,
    /// Invalid frames and messages received.
    pub bad_frames: u64,
    /// Requests that were sent again.
    pub repeats: u64,
    /// Telemetry samples received.
    pub samples: u64,
    /// Telemetry samples known to be lost.
    pub samples_lost: u64,
    /// How late the host was, since it began.
    pub late: Lateness,
    /// Round trips of heartbeats.
    pub trips: Trips,
}

/// The host's side of a connection.
#[derive(Debug, Default)]
pub struct Host {
    stage: Stage,
    identity: Option<message::Identity>,
    decoder: Decoder,
    out: Vec<u8>,
    reports: Vec<Report>,
    nonce: u32,
    sequence: u16,
    pending: Option<PendingRequest>,
    queue: VecDeque<Request>,
    rearm_retry: Option<RearmRetry>,
    /// CRC of the table that is being uploaded or is loaded.
    crc: u32,
    /// Force limit of that table, N.
    limit_n: f64,
    playback: u32,
    /// Whether nothing but a force that falls was asked to end the playback.
    fades: bool,
    received: u64,
    lost: u64,
    /// When the samples of the playback arrived.
    arrivals: Arrivals,
    /// How late the host was in the playback.
    late: Lateness,
    /// Strokes and clamps in the last progress report.
    reported: (u32, u32),
    heartbeat_count: u32,
    next_heartbeat: Option<Duration>,
    /// Count and send time of heartbeats without an answer so far.
    pending_heartbeats: VecDeque<(u32, Duration)>,
    /// When the first heartbeat without any answer since was sent.
    silent_since: Option<Duration>,
    /// When the user interface last polled.
    alive_at: Option<Duration>,
    /// For how long it did not poll before a heartbeat that was not sent, at most; since the
    /// last load.
    unpolled: Option<Duration>,
    settings: HostSettings,
    failure: Option<String>,
    health: Health,
}

impl Host {
    /// A host without a port. `nonce` distinguishes its connections from others.
    pub fn new(nonce: u32, settings: HostSettings) -> Self {
        Self {
            nonce,
            settings,
            next_heartbeat: Some(Duration::ZERO),
            ..Self::default()
        }
    }

    /// Starts a connection on a new port with LIMP and HELLO.
    pub fn connected(&mut self, at: Duration) {
        self.decoder = Decoder::new();
        self.out.clear();
        self.open_connection(at);
    }

    /// The port is lost.
    pub fn disconnected(&mut self, why: &str) {
        self.report_loss(why);
        self.out.clear();
        self.pending = None;
        self.queue.clear();
        self.stage = Stage::Disconnected;
    }

    /// Identification of the device, once it has been received.
    pub fn device(&self) -> Option<&message::Identity> {
        self.identity.as_ref()
    }

    /// The same for a session.
    pub fn identity(&self) -> Option<Identity> {
        identity(self.identity.as_ref()?)
    }

    /// Whether the device needs heartbeats: during upload, while loaded and in playback.
    pub fn armed(&self) -> bool {
        self.stage.armed()
    }

    /// Quality of the link.
    pub fn health(&self) -> &Health {
        &self.health
    }

    /// The user interface polled at this time.
    pub fn keep_alive(&mut self, at: Duration) {
        self.alive_at = Some(self.alive_at.map_or(at, |before| before.max(at)));
    }

    /// A turn of the loop that serves the link came late by this time.
    pub fn was_late(&mut self, by: Duration) {
        self.late.add(by);
        self.health.late.add(by);
    }

    /// Takes the bytes to be written to the port.
    pub fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.out)
    }

    /// Takes the reports since the last call.
    pub fn take_reports(&mut self) -> Vec<Report> {
        std::mem::take(&mut self.reports)
    }

    /// [`Device::load`](super::Device::load), with its errors.
    pub fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        let table = what.need_table()?;
        let known = self.identity.as_ref().filter(|_| self.stage.known());
        let owned = known.and_then(|device| Some((identity(device)?, device)));
        let Some((own, device)) = owned else {
            return Err(DeviceError::Lost(self.stage.as_str().to_owned()));
        };
        let (Stage::Idle | Stage::Loading { .. } | Stage::Loaded { .. }) = self.stage else {
            return Err(self.wrong_state("load"));
        };
        let limits = limits.capped_at(own.limits);
        let upload = upload::of(table, limits, what.allow_uncertified, device)
            .map_err(|e| DeviceError::Refused(e.to_string()))?;
        self.crc = upload.crc;
        self.limit_n = limits.force_n.get();
        self.pending = None;
        // From any state: zero force first, then idle.
        self.queue = [Request::Limp, Request::Rearm].into();
        self.queue.extend(upload.requests);
        self.rearm_retry = Some(RearmRetry {
            next: at,
            until: at + REST_TIMEOUT,
        });
        self.stage = Stage::Loading { since: at };
        (self.late, self.unpolled) = (Lateness::default(), None);
        self.next_heartbeat = Some(at);
        self.send_heartbeat(at);
        self.next_request(at);
        Ok(())
    }

    fn wrong_state(&self, command: &'static str) -> DeviceError {
        DeviceError::WrongState {
            command,
            state: self.stage.as_str(),
        }
    }

    /// [`Device::start`](super::Device::start), with its errors.
    pub fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        let (Stage::Loaded { .. }, Some(device)) = (self.stage, &self.identity) else {
            return Err(self.wrong_state("start"));
        };
        self.playback = self.playback.wrapping_add(1).max(1);
        let play = Play {
            playback: self.playback,
            crc: self.crc,
            longest_ms: LONGEST_MS.min(device.longest_ms),
            every: Some(sample_interval(device.servo_hz, self.settings.telemetry_hz)),
        };
        (self.received, self.lost, self.reported) = (0, 0, (0, 0));
        self.fades = false;
        self.arrivals = Arrivals::default();
        (self.late, self.unpolled) = (Lateness::default(), None);
        self.stage = Stage::Starting;
        self.send(Request::Play(play), at);
        Ok(())
    }

    /// [`Device::stop`](super::Device::stop), with its errors.
    pub fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        match self.stage {
            Stage::Playing { .. } | Stage::Fading { .. } => self.ask_to_stop(at),
            // PLAY has to be answered first, or STOP would be refused.
            Stage::Starting => self.queue.push_back(Request::Stop(Stop {
                playback: self.playback,
            })),
            // STOP has been sent, or the end has been reported.
            Stage::Stopping { .. } | Stage::AwaitingOutcome | Stage::Idle => {}
            Stage::Disconnected | Stage::Connecting | Stage::Silent { .. } => {}
            Stage::Loading { .. } | Stage::Loaded { .. } => return Err(self.wrong_state("stop")),
        }
        Ok(())
    }

    /// See [`Device::limp`](super::Device::limp).
    pub fn limp(&mut self, at: Duration) {
        if !matches!(self.stage, Stage::Disconnected | Stage::Connecting) {
            if self.stage.known() {
                self.stage = Stage::Idle;
                self.queue.clear();
                self.rearm_retry = None;
            }
            self.send(Request::Limp, at);
        }
        self.reports.retain(Report::survives_limp);
    }

    /// Processes bytes received from the port.
    pub fn receive(&mut self, bytes: &[u8], at: Duration) {
        for byte in bytes {
            let decoded = match self.decoder.push(*byte) {
                None => continue,
                Some(Err(_)) => Err(None),
                Some(Ok(body)) => Reply::decode(body).map_err(Some),
            };
            match decoded {
                Ok((header, reply)) => self.take(header.sequence, reply, at),
                Err(Some(WireError::Version(version))) => self.other_version(version, at),
                Err(_) => self.health.bad_frames += 1,
            }
        }
    }

    /// Sends what is due at `at`: repeats, heartbeats and queued requests.
    pub fn advance(&mut self, at: Duration) {
        if let Stage::Silent { retry } = self.stage
            && at >= retry
        {
            self.open_connection(at);
        }
        self.repeat(at);
        if let Some(rearm) = self.rearm_retry
            && self.pending.is_none()
            && at >= rearm.next
        {
            self.next_request(at);
        }
        self.send_heartbeat(at);
        if self
            .silent_since
            .is_some_and(|since| at.saturating_sub(since) > REPLY_TIMEOUT)
        {
            self.lose_device("it no longer answers", at);
        }
    }

    /// When [`Host::advance`] next has something to do; `None` if nothing is due.
    pub fn next(&self) -> Option<Duration> {
        let heartbeat = match self.stage {
            Stage::Disconnected => return None,
            Stage::Silent { retry } => return Some(retry),
            Stage::Connecting => None,
            _ => self.next_heartbeat,
        };
        let request = match (&self.pending, self.rearm_retry) {
            (Some(pending), _) => Some(pending.sent + self.retry_interval(&pending.request)),
            (None, rearm) => rearm.map(|rearm| rearm.next),
        };
        heartbeat.into_iter().chain(request).min()
    }

    fn open_connection(&mut self, at: Duration) {
        self.nonce = self.nonce.wrapping_add(1);
        self.stage = Stage::Connecting;
        self.queue.clear();
        self.rearm_retry = None;
        self.silent_since = None;
        self.pending_heartbeats.clear();
        // LIMP does not wait for an answer, HELLO does.
        self.sequence = self.sequence.wrapping_add(1);
        let limp = Request::Limp.frame(self.sequence);
        self.out.extend_from_slice(limp.as_bytes());
        self.say_hello(message::MINOR, at);
    }

    fn say_hello(&mut self, minor: u8, at: Duration) {
        let nonce = self.nonce;
        self.send(Request::Hello(Hello { nonce, minor }), at);
    }

    fn send(&mut self, request: Request, at: Duration) {
        self.sequence = self.sequence.wrapping_add(1);
        self.out
            .extend_from_slice(request.frame(self.sequence).as_bytes());
        self.pending = Some(PendingRequest {
            request,
            sequence: self.sequence,
            sent: at,
            tries: 1,
        });
    }

    /// Time after which an unanswered request is sent again: longer for COMMIT, which a
    /// device may take longer to judge.
    fn retry_interval(&self, request: &Request) -> Duration {
        let constants = self.identity.and_then(|device| device.constants);
        match (request, constants) {
            (
                Request::TableCommit(_) | Request::PathCommit(_) | Request::MechanismCommit(_),
                Some(constants),
            ) => RETRY_INTERVAL.max(
                Duration::from_millis(u64::from(constants.commit_ms.min(MAX_COMMIT_MS)))
                    + COMMIT_SLACK,
            ),
            _ => RETRY_INTERVAL,
        }
    }

    fn repeat(&mut self, at: Duration) {
        let Some(mut pending) = self.pending else {
            return;
        };
        if at.saturating_sub(pending.sent) < self.retry_interval(&pending.request) {
            return;
        }
        if pending.tries < MAX_TRIES {
            pending.tries += 1;
            pending.sent = at;
            self.pending = Some(pending);
            self.health.repeats += 1;
            let frame = pending.request.frame(pending.sequence);
            self.out.extend_from_slice(frame.as_bytes());
        } else {
            let request = upload::describe(&pending.request);
            self.lose_device(
                &format!("no answer to {request} after {MAX_TRIES} tries"),
                at,
            );
        }
    }

    fn next_request(&mut self, at: Duration) {
        if let Some(request) = self.queue.pop_front() {
            self.send(request, at);
        }
    }

    fn ask_to_stop(&mut self, at: Duration) {
        let stop = Stop {
            playback: self.playback,
        };
        self.fades = false;
        self.stage = Stage::Stopping { since: at };
        self.send(Request::Stop(stop), at);
    }

    fn send_heartbeat(&mut self, at: Duration) {
        if !self.stage.known() || self.next_heartbeat.is_none_or(|next| at < next) {
            return;
        }
        self.next_heartbeat = match self.settings.supervision_timeout {
            _ if self.stage.armed() => Some(at + HEARTBEAT_INTERVAL),
            Some(_) => Some(at + IDLE_HEARTBEAT_INTERVAL),
            // In virtual time nobody waits for the loss of an idle device.
            None => None,
        };
        let alive = match (self.settings.supervision_timeout, self.alive_at) {
            (None, _) => true,
            (Some(stall), Some(alive_at)) => at.saturating_sub(alive_at) < stall,
            (Some(_), None) => false,
        };
        if !alive && self.stage.armed() {
            let since = self.alive_at.unwrap_or_default();
            self.unpolled = self.unpolled.max(Some(at.saturating_sub(since)));
        }
        let (true, Some(device)) = (alive, &self.identity) else {
            return;
        };
        let now_ms = self.health.clock.at(at).unwrap_or(device.clock_ms);
        self.heartbeat_count = self.heartbeat_count.wrapping_add(1);
        let beat = Heartbeat {
            count: self.heartbeat_count,
            deadline_ms: now_ms.wrapping_add(
                (u32::from(device.watchdog_ms) + DEADLINE_SLACK_MS).min(MAX_DEADLINE_MS),
            ),
        };
        // The sequence number of a heartbeat has no meaning.
        let frame = Request::Heartbeat(beat).frame(0);
        self.out.extend_from_slice(frame.as_bytes());

        self.silent_since = self.silent_since.or(Some(at));
        if self.pending_heartbeats.len() == MAX_PENDING_HEARTBEATS {
            self.pending_heartbeats.pop_front();
        }
        self.pending_heartbeats.push_back((beat.count, at));
    }

    /// Reports the device as lost, sends LIMP and reconnects later.
    fn lose_device(&mut self, why: &str, at: Duration) {
        self.report_loss(why);
        self.pending = None;
        self.queue.clear();
        self.rearm_retry = None;
        self.silent_since = None;
        self.sequence = self.sequence.wrapping_add(1);
        let limp = Request::Limp.frame(self.sequence);
        self.out.extend_from_slice(limp.as_bytes());
        self.stage = Stage::Silent {
            retry: at + RECONNECT_INTERVAL,
        };
    }

    fn report_loss(&mut self, why: &str) {
        if self.stage.known() {
            self.reports.push(Report::Lost(why.to_owned()));
        }
        self.failure = Some(why.to_owned());
    }

    /// Why the device does not answer; `None` if it does.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref().filter(|_| !self.stage.known())
    }

    fn other_version(&mut self, version: u8, at: Duration) {
        self.lose_device(
            &format!(
                "it uses version {version} of the wire format; this program supports version {}",
                message::VERSION
            ),
            at,
        );
    }
}

/// Servo periods per telemetry sample, at least one.
fn sample_interval(servo_hz: f64, telemetry_hz: f64) -> NonZeroU16 {
    // `as` saturates and turns NaN into 0.
    NonZeroU16::new((servo_hz / telemetry_hz).round() as u16).unwrap_or(NonZeroU16::MIN)
}

/// The identity for a session; `None` if the limits are invalid.
fn identity(device: &message::Identity) -> Option<Identity> {
    Some(Identity {
        id: display_name(&device.serial),
        simulated: device.flags.simulated,
        telemetry: device.flags.telemetry,
        numbered: true,
        limits: Limits::new(device.force_n, device.velocity_mm_s).ok()?,
        servo: device.constants.map(|told| servo(device, &told)),
        mechanisms: device.constants.is_some_and(|told| told.features.mechanism),
        elements: device.constants.is_some_and(|told| told.features.elements),
        stiffness_n_per_mm: Some(device.stiffness_n_per_mm),
        damping_n_s_per_mm: Some(device.damping_n_s_per_mm),
        stroke_mm: Some(device.stroke_mm),
        firmware: Some(display_name(&device.firmware)),
    })
}

/// The servo of a device that tells its constants.
fn servo(device: &message::Identity, told: &message::Constants) -> ServoSettings {
    ServoSettings {
        servo_hz: device.servo_hz,
        force_n: device.force_n,
        velocity_mm_s: device.velocity_mm_s,
        acceleration_hz: told.acceleration_hz,
        least_mass_kg: told.least_mass_kg,
        damping_n_s_per_mm: told.damping_n_s_per_mm,
        wall_n_per_mm: told.wall_n_per_mm,
        wall_n_s_per_mm: told.wall_n_s_per_mm,
        overtravel_mm: told.overtravel_mm,
        jump_mm: told.jump_mm,
        slew_n_s: told.slew_n_s,
        ramp_s: told.ramp_s,
    }
}

/// A device's text with unsafe characters replaced, for files and terminals.
pub fn display_name(name: &message::Name) -> String {
    let text = String::from_utf8_lossy(name.as_bytes());
    let text: String = text
        .chars()
        .map(|c| if is_unsafe(c) { '?' } else { c })
        .collect();
    match text.trim() {
        "" => "unnamed".to_owned(),
        trimmed => Untrusted(trimmed).to_string(),
    }
}
