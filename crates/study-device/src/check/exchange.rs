//! An exchange of messages with a device whose answers may be wrong.

use super::{CheckFailure, Connection, fail, strange};
use crate::host::upload::Upload;
use crate::host::{DeviceClock, HEARTBEAT_INTERVAL, MAX_TRIES, RETRY_INTERVAL};
use std::collections::VecDeque;
use std::time::Duration;
use study_wire::frame::{Decoder, Frame};
use study_wire::message::{
    Ack, DeviceState, Event, EventKind, Heartbeat, Hello, Identity, Outcome, Pulse, Recorded,
    Refusal, Reply, Request, Telemetry, VERSION, kind,
};

/// Longest single wait for bytes.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Time for the handle to come to rest.
const REST_TIMEOUT: Duration = Duration::from_secs(5);

/// A reply with its time of arrival.
#[derive(Debug, Clone)]
pub(crate) struct ReceivedReply {
    pub(crate) sequence: u16,
    pub(crate) reply: Reply,
    pub(crate) body: Vec<u8>,
    pub(crate) at: Duration,
}

/// The tester's side of a connection, with heartbeats and collected messages.
pub(crate) struct Exchange<'w> {
    connection: &'w mut dyn Connection,
    nonce: u32,
    decoder: Decoder,
    sequence: u16,
    /// Whether heartbeats are sent automatically.
    pub(crate) sends_heartbeats: bool,
    beat_count: u32,
    next_beat: Duration,
    beats: VecDeque<(u32, Duration)>,
    pub(crate) clock: DeviceClock,
    pub(crate) device: Option<Identity>,
    /// Replies that have not been used.
    replies: Vec<ReceivedReply>,
    pub(crate) telemetry: Vec<(Duration, Telemetry)>,
    pub(crate) events: Vec<Event>,
    pub(crate) recorded: Vec<Recorded>,
    pub(crate) pulses: Vec<Pulse>,
    pub(crate) latency_ms: Option<[f64; 3]>,
    playback: u32,
    /// How late this computer was at most since the last reset; with a simulated device also
    /// how long that stood still.
    pub(crate) late: Duration,
    /// Why the last bytes were no reply, since the last request.
    malformed: Option<String>,
    /// Arrival and clock of the first PULSE of the connection.
    first_pulse: Option<(Duration, u32)>,
}

impl<'w> Exchange<'w> {
    pub(crate) fn new(connection: &'w mut dyn Connection, nonce: u32) -> Self {
        Self {
            connection,
            nonce,
            decoder: Decoder::new(),
            sequence: 0,
            sends_heartbeats: false,
            beat_count: 0,
            next_beat: Duration::ZERO,
            beats: VecDeque::new(),
            clock: DeviceClock::default(),
            device: None,
            replies: Vec::new(),
            telemetry: Vec::new(),
            events: Vec::new(),
            recorded: Vec::new(),
            pulses: Vec::new(),
            latency_ms: None,
            playback: 0,
            late: Duration::ZERO,
            malformed: None,
            first_pulse: None,
        }
    }

    pub(crate) fn now(&mut self) -> Duration {
        self.connection.now()
    }

    pub(crate) fn identity(&self) -> Result<Identity, CheckFailure> {
        self.device
            .ok_or_else(|| CheckFailure::Disconnected("it has not identified itself".to_owned()))
    }

    pub(crate) fn next_sequence(&mut self) -> u16 {
        // Heartbeats use 0.
        self.sequence = self.sequence.wrapping_add(1).max(1);
        self.sequence
    }

    pub(crate) fn next_playback(&mut self) -> u32 {
        self.playback += 1;
        self.playback
    }

    /// Sends bytes and processes what arrives within `wait`.
    fn turn(&mut self, bytes: &[u8], wait: Duration) -> Result<(), CheckFailure> {
        let now = self.now();
        let mut bytes = bytes.to_vec();
        if self.sends_heartbeats && now >= self.next_beat {
            self.next_beat = now + HEARTBEAT_INTERVAL;
            bytes.extend_from_slice(self.heartbeat(now).as_bytes());
        }
        let received = self
            .connection
            .exchange(&bytes, wait)
            .map_err(|e| CheckFailure::Disconnected(e.to_string()))?;
        let at = self.now();
        self.late = self.late.max(at.saturating_sub(now + wait));
        for byte in received {
            if let Some(Ok(body)) = self.decoder.push(byte) {
                let body = body.to_vec();
                match Reply::decode(&body) {
                    Ok((header, reply)) => self.take(header.sequence, reply, body, at),
                    Err(error) => self.malformed = Some(strange::why(&body, error)),
                }
            }
        }
        Ok(())
    }

    fn take(&mut self, sequence: u16, reply: Reply, body: Vec<u8>, at: Duration) {
        match reply {
            Reply::Telemetry(telemetry) => self.telemetry.push((at, telemetry)),
            Reply::Event(event) => self.events.push(event),
            Reply::Recorded(recorded) => self.recorded.push(recorded),
            Reply::Pulse(pulse) if sequence == 0 => {
                let sent = self.beats.iter().find(|(count, _)| *count == pulse.count);
                if let Some((_, sent)) = sent {
                    self.clock.add(*sent, at, pulse.clock_ms);
                }
                self.compare_clocks(pulse.clock_ms, at);
                self.pulses.push(pulse);
            }
            _ => self.replies.push(ReceivedReply {
                sequence,
                reply,
                body,
                at,
            }),
        }
    }

    /// The processor of a simulated device is this computer, which may be busy: its clock
    /// then falls behind.
    fn compare_clocks(&mut self, clock_ms: u32, at: Duration) {
        let (first_at, first_ms) = *self.first_pulse.get_or_insert((at, clock_ms));
        let own = Duration::from_millis(u64::from(clock_ms.wrapping_sub(first_ms)));
        let behind = at.saturating_sub(first_at).saturating_sub(own);
        if self.device.is_some_and(|device| device.flags.simulated) {
            self.late = self.late.max(behind);
        }
    }

    /// The next heartbeat, made at `now`.
    fn heartbeat(&mut self, now: Duration) -> Frame {
        self.beat_count += 1;
        let watchdog = self.device.map_or(30, |d| u32::from(d.watchdog_ms));
        let now_ms = self.clock.at(now).unwrap_or(0);
        if self.beats.len() == 256 {
            self.beats.pop_front();
        }
        self.beats.push_back((self.beat_count, now));
        Request::Heartbeat(Heartbeat {
            count: self.beat_count,
            deadline_ms: now_ms.wrapping_add((watchdog + 10).min(900)),
        })
        .frame(0)
    }

    pub(crate) fn beat_count(&self) -> u32 {
        self.beat_count
    }

    /// Waits; heartbeats and received messages are processed meanwhile.
    pub(crate) fn wait(&mut self, time: Duration) -> Result<(), CheckFailure> {
        let until = self.now() + time;
        loop {
            let left = until.saturating_sub(self.now());
            if left.is_zero() {
                return Ok(());
            }
            self.turn(&[], left.min(POLL_INTERVAL))?;
        }
    }

    /// Sends bytes and returns the reply with this sequence number, if it arrives within
    /// `wait`.
    pub(crate) fn send(
        &mut self,
        bytes: &[u8],
        sequence: u16,
        wait: Duration,
    ) -> Result<Option<ReceivedReply>, CheckFailure> {
        self.replies
            .retain(|received| received.sequence != sequence);
        let until = self.now() + wait;
        self.turn(bytes, POLL_INTERVAL)?;
        loop {
            let found = self.replies.iter().position(|c| c.sequence == sequence);
            if let Some(place) = found {
                return Ok(Some(self.replies.remove(place)));
            }
            if self.now() >= until {
                return Ok(None);
            }
            self.turn(&[], POLL_INTERVAL)?;
        }
    }

    /// Sends a request, with repeats, until it is answered.
    pub(crate) fn ask(&mut self, request: Request) -> Result<ReceivedReply, CheckFailure> {
        let sequence = self.next_sequence();
        let frame = request.frame(sequence);
        let began = self.now();
        self.malformed = None;
        for _ in 0..MAX_TRIES {
            if let Some(received) = self.send(frame.as_bytes(), sequence, RETRY_INTERVAL)? {
                return Ok(received);
            }
        }
        let why = self.without_answer(&request, sequence, began);
        match (request, why) {
            // Nothing else can be tested without an identity.
            (Request::Hello(_), Some(why)) => Err(CheckFailure::Disconnected(why)),
            (_, Some(why)) => fail(why),
            (_, None) => Err(CheckFailure::Disconnected(format!(
                "no answer to {} after {MAX_TRIES} tries",
                kind::name(request.kind())
            ))),
        }
    }

    /// What came in place of the answer to a request, if anything did.
    fn without_answer(&self, request: &Request, sequence: u16, began: Duration) -> Option<String> {
        let stray = (self.replies.iter().rev())
            .find(|other| other.at >= began && strange::answers(request, &other.reply));
        let numbered = stray.map(|other| {
            format!(
                "{} has the sequence number {} and not {sequence} of the request (4.1)",
                kind::name(other.reply.kind()),
                other.sequence
            )
        });
        numbered.or_else(|| self.malformed.clone())
    }

    /// Why the last bytes were no reply, if they were not.
    pub(crate) fn take_malformed(&mut self) -> Option<String> {
        self.malformed.take()
    }

    /// The time that these bytes take on the line.
    pub(crate) fn line_time(&self, bytes: usize) -> Duration {
        self.connection.byte_time() * bytes as u32
    }

    pub(crate) fn ack(&mut self, request: Request) -> Result<Ack, CheckFailure> {
        match self.ask(request)?.reply {
            Reply::Ack(ack) if ack.request == request.kind() => Ok(ack),
            other => unexpected(request, &other),
        }
    }

    /// Sends a request that has to be executed.
    pub(crate) fn expect_done(&mut self, request: Request) -> Result<Ack, CheckFailure> {
        let ack = self.ack(request)?;
        match ack.refusal {
            Refusal::None => Ok(ack),
            refusal => {
                let (what, detail) = (kind::name(request.kind()), ack.detail);
                fail(format!("{what} is refused: {refusal} ({detail})"))
            }
        }
    }

    /// Sends everything of an upload except COMMIT. All of it has to be executed, and nothing may begin.
    pub(crate) fn expect_sent(&mut self, upload: &Upload) -> Result<(), CheckFailure> {
        let (_, requests) = upload
            .requests
            .split_last()
            .unwrap_or((&Request::State, &[]));
        for request in requests {
            let ack = self.expect_done(*request)?;
            if ack.state != DeviceState::Idle {
                return fail(format!("during an upload: {}", ack.state));
            }
        }
        Ok(())
    }

    /// Sends a request that has to be refused for the given reason.
    pub(crate) fn expect_refusal(
        &mut self,
        request: Request,
        why: Refusal,
    ) -> Result<Ack, CheckFailure> {
        let ack = self.ack(request)?;
        if ack.refusal == why {
            return Ok(ack);
        }
        let what = kind::name(request.kind());
        fail(format!("{what}: {}, and not: {why}", ack.refusal))
    }

    pub(crate) fn outcome(&mut self) -> Result<Outcome, CheckFailure> {
        match self.ask(Request::State)?.reply {
            Reply::Outcome(outcome) => Ok(outcome),
            other => unexpected(Request::State, &other),
        }
    }

    /// The event that reports a latched state, if there was one.
    pub(crate) fn latched(&self) -> Option<Event> {
        let mut events = self.events.iter();
        events.find(|e| e.kind == EventKind::Latched).copied()
    }

    pub(crate) fn limp(&mut self) -> Result<(), CheckFailure> {
        self.expect_done(Request::Limp).map(drop)
    }

    /// Makes the device limp, whatever it was doing, and identifies it.
    ///
    /// # Errors
    /// As [`Exchange::hello`].
    pub(crate) fn identify(&mut self) -> Result<Identity, CheckFailure> {
        let limp = Request::Limp.frame(0);
        let _ = self.send(limp.as_bytes(), 0, RETRY_INTERVAL)?;
        self.hello()
    }

    /// Opens a new connection.
    ///
    /// # Errors
    /// [`CheckFailure`] if the device does not answer, or uses another version.
    pub(crate) fn hello(&mut self) -> Result<Identity, CheckFailure> {
        self.hello_of(0)
    }

    /// The same as a host of this minor version.
    pub(crate) fn hello_of(&mut self, minor: u8) -> Result<Identity, CheckFailure> {
        self.nonce = self.nonce.wrapping_add(1);
        let sent = self.now();
        let request = Request::Hello(Hello {
            nonce: self.nonce,
            minor,
        });
        let received = self.ask(request)?;
        if let Reply::Ack(ack) = received.reply
            && ack.refusal == Refusal::Version
        {
            return Err(CheckFailure::Disconnected(format!(
                "it uses version {} of the wire format, not {VERSION}",
                ack.detail
            )));
        }
        let Reply::Identity(identity) = received.reply else {
            return unexpected(request, &received.reply);
        };
        if identity.nonce != self.nonce {
            return fail("its nonce is not that of HELLO");
        }
        self.clock = DeviceClock::default();
        self.first_pulse = None;
        self.clock.add(sent, received.at, identity.clock_ms);
        self.device = Some(identity);
        Ok(identity)
    }

    /// Brings the device to idle with a new connection and heartbeats, and discards all
    /// earlier messages.
    pub(crate) fn reset(&mut self) -> Result<(), CheckFailure> {
        self.sends_heartbeats = true;
        self.limp()?;
        self.hello()?;
        let until = self.now() + REST_TIMEOUT;
        loop {
            let ack = self.ack(Request::Rearm)?;
            match ack.refusal {
                Refusal::None if ack.state == DeviceState::Idle => break,
                Refusal::Moving if self.now() < until => {
                    self.wait(Duration::from_millis(50))?;
                }
                refusal => return fail(format!("REARM: {refusal}, {}", ack.state)),
            }
        }
        self.telemetry.clear();
        self.events.clear();
        self.replies.clear();
        self.first_heartbeat()
    }

    /// Waits for a fresh heartbeat of a new connection, which has received none so far.
    pub(crate) fn first_heartbeat(&mut self) -> Result<(), CheckFailure> {
        self.pulses.clear();
        self.next_beat = self.now();
        let until = self.now() + RETRY_INTERVAL;
        while !self.pulses.iter().any(|pulse| pulse.fresh) {
            if self.now() > until {
                return fail("no heartbeat is fresh after HELLO");
            }
            self.wait(POLL_INTERVAL)?;
        }
        Ok(())
    }
}

/// A reply of the wrong type.
pub(super) fn unexpected<T>(request: Request, reply: &Reply) -> Result<T, CheckFailure> {
    let [request, reply] = [request.kind(), reply.kind()].map(kind::name);
    fail(format!("{request} is answered by {reply}"))
}
