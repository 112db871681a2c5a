//! The host's side of the wire, bytes in and bytes out, with time as an argument.
//!
//! [`Host`] says hello, uploads tables, plays and stops, with one request under way
//! at a time: sent again every [`RETRY`] until it is answered, [`TRIES`] times, then
//! the device counts as lost and is greeted until it answers. It sends heartbeats
//! only while whoever it works for has been [heard](Host::fed) lately.
//!
//! It has neither clock nor port: [`link`](super::link) runs it on a thread beside a
//! port, [`virtual_device`](super::virtual_device) in virtual time beside the
//! simulated device.

mod clock;
mod talk;
mod upload;

pub use clock::DeviceClock;

use super::{DeviceError, Identity, Report, Stimulus};
use std::collections::VecDeque;
use std::time::Duration;
use study_base::limits::{Limit, Limits};
use study_base::text::{Untrusted, is_unsafe};
use study_wire::frame::Decoder;
use study_wire::message::{self, Heartbeat, Hello, Outcome, Play, Reply, Request, Stop, WireError};

/// How long an answer is waited for before the request is sent again.
pub const RETRY: Duration = Duration::from_millis(100);
/// How often a request is sent before the device counts as lost.
pub const TRIES: u32 = 5;
/// Between two heartbeats while something is loaded.
pub const BEAT: Duration = Duration::from_millis(10);
/// Between two heartbeats otherwise: only to see whether the device is there.
const PING: Duration = Duration::from_millis(100);
/// A heartbeat is sent only if the screen's loop was heard so lately.
pub const STALL: Duration = Duration::from_millis(100);
/// How long beyond the watchdog time a heartbeat says something, ms.
const DEADLINE_SLACK_MS: u32 = 10;
/// A deadline a second ahead is none (wire.md 6.1), and the clock is an estimate, ms.
const DEADLINE_MOST_MS: u32 = 900;
/// How long heartbeats may stay without an answer.
const MUTE: Duration = Duration::from_millis(500);
/// How long a handle may take to come to rest before a table goes up.
const REST_WITHIN: Duration = Duration::from_secs(4);
/// How long a device that does not answer is left alone before it is greeted again.
const GREET_AGAIN: Duration = Duration::from_millis(500);
/// Longest playback that is asked for, ms, if the device allows it.
const LONGEST_MS: u32 = 10 * 60 * 1000;
/// Heartbeats whose sending is remembered.
const BEATS: usize = 64;

/// What the host does with the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// There is no port.
    Unlinked,
    /// LIMP and HELLO are on their way.
    Greeting,
    /// It did not answer, or not as it should; it is greeted again then.
    Mute { again: Duration },
    /// Limp, nothing loaded.
    Idle,
    /// A table goes up.
    Loading { since: Duration },
    /// It is up.
    Loaded { since: Duration },
    /// PLAY is on its way.
    Starting,
    /// It plays.
    Playing { since: Duration },
    /// STOP is on its way or its end is waited for.
    Stopping { since: Duration },
    /// It has ended; STATE asks how.
    Asking,
}

impl Stage {
    fn as_str(self) -> &'static str {
        match self {
            Self::Unlinked | Self::Greeting | Self::Mute { .. } => "it does not answer",
            Self::Idle => "nothing is loaded",
            Self::Loading { .. } => "the table is being loaded",
            Self::Loaded { .. } => "a table is loaded",
            Self::Starting => "it is about to play",
            Self::Playing { .. } => "it plays",
            Self::Stopping { .. } | Self::Asking => "it is about to stop",
        }
    }

    /// Whether the device needs its heartbeats.
    fn armed(self) -> bool {
        matches!(
            self,
            Self::Loading { .. }
                | Self::Loaded { .. }
                | Self::Starting
                | Self::Playing { .. }
                | Self::Stopping { .. }
        )
    }

    /// Whether the device has introduced itself.
    fn known(self) -> bool {
        !matches!(self, Self::Unlinked | Self::Greeting | Self::Mute { .. })
    }
}

/// A request that waits for its answer.
#[derive(Debug, Clone, Copy)]
struct Flight {
    request: Request,
    sequence: u16,
    sent: Duration,
    tries: u32,
}

/// How a host works.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Heartbeats stop so long after [`Host::fed`]. `None`: whoever lets time pass is
    /// alive, as in virtual time.
    pub stall: Option<Duration>,
    /// Telemetry samples per second that are asked for.
    pub telemetry_hz: f64,
}

impl Default for Settings {
    /// [`STALL`] and 1 kHz.
    fn default() -> Self {
        Self {
            stall: Some(STALL),
            telemetry_hz: 1000.0,
        }
    }
}

/// What the link has been like.
#[derive(Debug, Clone, Default)]
pub struct Health {
    /// The device's clock.
    pub clock: DeviceClock,
    /// Bytes between zeros that were no frame, and frames that were no message.
    pub bad_frames: u64,
    /// Requests that were sent again.
    pub repeats: u64,
    /// Heartbeats sent.
    pub beats: u64,
    /// Telemetry samples received and known to be lost.
    pub samples: u64,
    /// See above.
    pub samples_lost: u64,
    /// What came of the last playback, in full.
    pub outcome: Option<Outcome>,
}

/// The host's side of a connection.
#[derive(Debug)]
pub struct Host {
    stage: Stage,
    identity: Option<message::Identity>,
    decoder: Decoder,
    out: Vec<u8>,
    reports: Vec<Report>,
    nonce: u32,
    sequence: u16,
    flight: Option<Flight>,
    todo: VecDeque<Request>,
    /// When REARM is tried again, and until when.
    rest: Option<(Duration, Duration)>,
    /// CRC of the table that goes up or is up.
    crc: u32,
    playback: u32,
    received: u64,
    lost: u64,
    told: (u32, u32),
    beat_count: u32,
    next_beat: Duration,
    beats: VecDeque<(u32, Duration)>,
    /// Since when nothing has come back.
    unheard: Option<Duration>,
    fed: Option<Duration>,
    settings: Settings,
    trouble: Option<String>,
    health: Health,
}

impl Host {
    /// A host without a port. `nonce` tells its connections from those of another.
    pub fn new(nonce: u32, settings: Settings) -> Self {
        Self {
            stage: Stage::Unlinked,
            identity: None,
            decoder: Decoder::new(),
            out: Vec::new(),
            reports: Vec::new(),
            nonce,
            sequence: 0,
            flight: None,
            todo: VecDeque::new(),
            rest: None,
            crc: 0,
            playback: 0,
            received: 0,
            lost: 0,
            told: (0, 0),
            beat_count: 0,
            next_beat: Duration::ZERO,
            beats: VecDeque::new(),
            unheard: None,
            fed: None,
            settings,
            trouble: None,
            health: Health::default(),
        }
    }

    /// A port is there: zero force first, then hello.
    pub fn linked(&mut self, at: Duration) {
        self.decoder = Decoder::new();
        self.out.clear();
        self.greet(at);
    }

    /// The port is gone.
    pub fn unlinked(&mut self, why: &str) {
        self.tell_loss(why);
        self.out.clear();
        self.flight = None;
        self.todo.clear();
        self.stage = Stage::Unlinked;
    }

    /// Who the device is, once it has said so.
    pub fn device(&self) -> Option<&message::Identity> {
        self.identity.as_ref()
    }

    /// The same for a session.
    pub fn identity(&self) -> Option<Identity> {
        identity(self.identity.as_ref()?)
    }

    /// Whether the device has answered and is not lost.
    pub fn answers(&self) -> bool {
        self.stage.known()
    }

    /// Whether the device needs heartbeats: it has a table, gets one or plays.
    pub fn armed(&self) -> bool {
        self.stage.armed()
    }

    /// What the link has been like.
    pub fn health(&self) -> &Health {
        &self.health
    }

    /// The screen's loop was alive then.
    pub fn fed(&mut self, at: Duration) {
        self.fed = Some(self.fed.map_or(at, |before| before.max(at)));
    }

    /// What is to be written to the port.
    pub fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.out)
    }

    /// What has happened since the last call.
    pub fn take_reports(&mut self) -> Vec<Report> {
        std::mem::take(&mut self.reports)
    }

    /// See [`Device::load`](super::Device::load).
    ///
    /// # Errors
    /// [`DeviceError`] as there.
    pub fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        let table = what.need_table()?;
        let Some(own) = self.identity().filter(|_| self.stage.known()) else {
            return Err(DeviceError::Lost(self.stage.as_str().to_owned()));
        };
        if !matches!(
            self.stage,
            Stage::Idle | Stage::Loading { .. } | Stage::Loaded { .. }
        ) {
            return Err(DeviceError::WrongState {
                command: "load",
                state: self.stage.as_str(),
            });
        }
        super::table::check(table).map_err(DeviceError::Refused)?;
        let Some(device) = &self.identity else {
            return Err(DeviceError::Lost(self.stage.as_str().to_owned()));
        };
        let upload = upload::of(table, limits.capped_at(own.limits), what.permitted, device)
            .map_err(DeviceError::Refused)?;
        self.crc = upload.crc;
        self.flight = None;
        // whatever the device does and whyever it is limp: from zero force to idle
        self.todo = [Request::Limp, Request::Rearm].into();
        self.todo.extend(upload.requests);
        self.rest = Some((at, at + REST_WITHIN));
        self.stage = Stage::Loading { since: at };
        self.next_beat = at;
        self.beat(at);
        self.next_request(at);
        Ok(())
    }

    /// See [`Device::start`](super::Device::start).
    ///
    /// # Errors
    /// [`DeviceError`] as there.
    pub fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        let (Stage::Loaded { .. }, Some(device)) = (self.stage, &self.identity) else {
            return Err(DeviceError::WrongState {
                command: "start",
                state: self.stage.as_str(),
            });
        };
        self.playback = self.playback.wrapping_add(1).max(1);
        let play = Play {
            playback: self.playback,
            crc: self.crc,
            longest_ms: LONGEST_MS.min(device.longest_ms),
            every: every(device.servo_hz, self.settings.telemetry_hz),
        };
        (self.received, self.lost, self.told) = (0, 0, (0, 0));
        self.stage = Stage::Starting;
        self.send(Request::Play(play), at);
        Ok(())
    }

    /// See [`Device::stop`](super::Device::stop).
    ///
    /// # Errors
    /// [`DeviceError`] as there.
    pub fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        match self.stage {
            Stage::Playing { .. } => self.ask_to_stop(at),
            // PLAY is answered first; a stop that overtook it would be refused
            Stage::Starting => self.todo.push_back(Request::Stop(Stop {
                playback: self.playback,
            })),
            // on its way, or its end has been told
            Stage::Stopping { .. } | Stage::Asking | Stage::Idle => {}
            Stage::Unlinked | Stage::Greeting | Stage::Mute { .. } => {}
            Stage::Loading { .. } | Stage::Loaded { .. } => {
                return Err(DeviceError::WrongState {
                    command: "stop",
                    state: self.stage.as_str(),
                });
            }
        }
        Ok(())
    }

    /// See [`Device::limp`](super::Device::limp).
    pub fn limp(&mut self, at: Duration) {
        if !matches!(self.stage, Stage::Unlinked | Stage::Greeting) {
            if self.stage.known() {
                self.stage = Stage::Idle;
                self.todo.clear();
            }
            self.send(Request::Limp, at);
        }
        self.reports
            .retain(|r| matches!(r, Report::Fault(_) | Report::Lost(_) | Report::Ready));
    }

    /// Takes in what has come from the port.
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

    /// Lets time pass: repeats, heartbeats, what has become due.
    pub fn advance(&mut self, at: Duration) {
        if let Stage::Mute { again } = self.stage
            && at >= again
        {
            self.greet(at);
        }
        self.repeat(at);
        if let Some((again, _)) = self.rest
            && self.flight.is_none()
            && at >= again
        {
            self.next_request(at);
        }
        self.beat(at);
        if self
            .unheard
            .is_some_and(|since| at.saturating_sub(since) > MUTE)
        {
            self.lose("it does not answer any more", at);
        }
    }

    /// The next moment at which [`Host::advance`] has something to do.
    pub fn next(&self) -> Duration {
        let mut next = match self.stage {
            Stage::Unlinked => return Duration::MAX,
            Stage::Mute { again } => return again,
            Stage::Greeting => Duration::MAX,
            _ => self.next_beat,
        };
        if let Some(flight) = &self.flight {
            next = next.min(flight.sent + RETRY);
        } else if let Some((again, _)) = self.rest {
            next = next.min(again);
        }
        next
    }

    fn greet(&mut self, at: Duration) {
        self.nonce = self.nonce.wrapping_add(1);
        self.stage = Stage::Greeting;
        self.todo.clear();
        self.rest = None;
        self.unheard = None;
        self.beats.clear();
        // by a frame of its own: HELLO waits for an answer, zero force does not
        self.sequence = self.sequence.wrapping_add(1);
        let limp = Request::Limp.frame(self.sequence);
        self.out.extend_from_slice(limp.as_bytes());
        self.send(Request::Hello(Hello { nonce: self.nonce }), at);
    }

    fn send(&mut self, request: Request, at: Duration) {
        self.sequence = self.sequence.wrapping_add(1);
        self.out
            .extend_from_slice(request.frame(self.sequence).as_bytes());
        self.flight = Some(Flight {
            request,
            sequence: self.sequence,
            sent: at,
            tries: 1,
        });
    }

    fn repeat(&mut self, at: Duration) {
        let Some(flight) = &mut self.flight else {
            return;
        };
        if at.saturating_sub(flight.sent) < RETRY {
            return;
        }
        if flight.tries < TRIES {
            flight.tries += 1;
            flight.sent = at;
            self.health.repeats += 1;
            let frame = flight.request.frame(flight.sequence);
            self.out.extend_from_slice(frame.as_bytes());
        } else {
            let what = upload::word(&flight.request);
            self.lose(&format!("no answer to {what} after {TRIES} tries"), at);
        }
    }

    fn next_request(&mut self, at: Duration) {
        if let Some(request) = self.todo.pop_front() {
            self.send(request, at);
        }
    }

    fn ask_to_stop(&mut self, at: Duration) {
        let stop = Stop {
            playback: self.playback,
        };
        self.stage = Stage::Stopping { since: at };
        self.send(Request::Stop(stop), at);
    }

    fn beat(&mut self, at: Duration) {
        if !self.stage.known() || at < self.next_beat {
            return;
        }
        self.next_beat = match self.settings.stall {
            _ if self.stage.armed() => at + BEAT,
            Some(_) => at + PING,
            // nobody waits for news in virtual time
            None => Duration::MAX,
        };
        let alive = match (self.settings.stall, self.fed) {
            (None, _) => true,
            (Some(stall), Some(fed)) => at.saturating_sub(fed) < stall,
            (Some(_), None) => false,
        };
        let (true, Some(device)) = (alive, &self.identity) else {
            return;
        };
        let now_ms = self.health.clock.at(at).unwrap_or(device.clock_ms);
        self.beat_count = self.beat_count.wrapping_add(1);
        let beat = Heartbeat {
            count: self.beat_count,
            deadline_ms: now_ms.wrapping_add(
                (u32::from(device.watchdog_ms) + DEADLINE_SLACK_MS).min(DEADLINE_MOST_MS),
            ),
        };
        // heartbeats carry no sequence number that counts
        let frame = Request::Heartbeat(beat).frame(0);
        self.out.extend_from_slice(frame.as_bytes());
        self.health.beats += 1;
        self.unheard = self.unheard.or(Some(at));
        if self.beats.len() == BEATS {
            self.beats.pop_front();
        }
        self.beats.push_back((beat.count, at));
    }

    /// It does not answer, or not as it should: zero force as far as it hears, and
    /// greeted again soon.
    fn lose(&mut self, why: &str, at: Duration) {
        self.tell_loss(why);
        self.flight = None;
        self.todo.clear();
        self.rest = None;
        self.unheard = None;
        self.sequence = self.sequence.wrapping_add(1);
        let limp = Request::Limp.frame(self.sequence);
        self.out.extend_from_slice(limp.as_bytes());
        self.stage = Stage::Mute {
            again: at + GREET_AGAIN,
        };
    }

    fn tell_loss(&mut self, why: &str) {
        if self.stage.known() {
            self.reports.push(Report::Lost(why.to_owned()));
        }
        self.trouble = Some(why.to_owned());
    }

    /// Why the device does not answer, if it does not.
    pub fn trouble(&self) -> Option<&str> {
        self.trouble.as_deref().filter(|_| !self.stage.known())
    }

    fn other_version(&mut self, version: u8, at: Duration) {
        self.lose(
            &format!(
                "it speaks version {version} of the wire format, and this program version {}",
                message::VERSION
            ),
            at,
        );
    }
}

/// Servo periods between two samples, at least one.
fn every(servo_hz: f64, telemetry_hz: f64) -> u16 {
    // `as` saturates, and makes 0 of what is no number
    ((servo_hz / telemetry_hz).round() as u16).max(1)
}

/// What a device says of itself, for a session; `None` if it is no device's.
fn identity(device: &message::Identity) -> Option<Identity> {
    Some(Identity {
        id: name(&device.serial),
        simulated: device.flags.simulated,
        telemetry: device.flags.telemetry,
        limits: Limits {
            force_n: Limit::new(device.force_n).ok()?,
            velocity_mm_s: Limit::new(device.velocity_mm_s).ok()?,
        },
    })
}

/// A device's text, harmless in a file and on a terminal.
pub fn name(name: &message::Name) -> String {
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
