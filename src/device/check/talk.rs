//! A conversation with a device that may say anything.

pub(in crate::device) use super::Broken;
use super::Wire;
use crate::device::host::{BEAT, DeviceClock, RETRY, TRIES};
use std::collections::VecDeque;
use std::time::Duration;
use study_wire::frame::{Decoder, Frame};
use study_wire::message::{
    Ack, Event, Heartbeat, Hello, Identity, Outcome, Pulse, Recorded, Refusal, Reply, Request,
    State, Telemetry, VERSION, kind,
};

/// One wait for bytes.
const SLICE: Duration = Duration::from_millis(1);
/// How long a handle may take to come to rest.
const REST_WITHIN: Duration = Duration::from_secs(5);

/// A reply as it came.
#[derive(Debug, Clone)]
pub(in crate::device) struct Came {
    pub(in crate::device) sequence: u16,
    pub(in crate::device) reply: Reply,
    pub(in crate::device) body: Vec<u8>,
    pub(in crate::device) at: Duration,
}

/// What goes on between the check and the device.
pub(in crate::device) struct Talk<'w> {
    wire: &'w mut dyn Wire,
    nonce: u32,
    decoder: Decoder,
    sequence: u16,
    /// Whether heartbeats go out by themselves.
    pub(in crate::device) beating: bool,
    beat_count: u32,
    next_beat: Duration,
    beats: VecDeque<(u32, Duration)>,
    pub(in crate::device) clock: DeviceClock,
    pub(in crate::device) device: Option<Identity>,
    /// Replies that nobody has looked at.
    replies: Vec<Came>,
    pub(in crate::device) telemetry: Vec<(Duration, Telemetry)>,
    pub(in crate::device) events: Vec<Event>,
    pub(in crate::device) recorded: Vec<Recorded>,
    pub(in crate::device) pulses: Vec<Pulse>,
    pub(in crate::device) latency_ms: Option<[f64; 3]>,
    playback: u32,
}

impl<'w> Talk<'w> {
    pub(in crate::device) fn new(wire: &'w mut dyn Wire, nonce: u32) -> Self {
        Self {
            wire,
            nonce,
            decoder: Decoder::new(),
            sequence: 0,
            beating: false,
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
        }
    }

    pub(in crate::device) fn now(&mut self) -> Duration {
        self.wire.now()
    }

    pub(in crate::device) fn identity(&self) -> Result<Identity, Broken> {
        self.device
            .ok_or_else(|| Broken::Gone("it has not said who it is".to_owned()))
    }

    pub(in crate::device) fn next_sequence(&mut self) -> u16 {
        // 0 is that of the heartbeats
        self.sequence = self.sequence.wrapping_add(1).max(1);
        self.sequence
    }

    pub(in crate::device) fn next_playback(&mut self) -> u32 {
        self.playback += 1;
        self.playback
    }

    /// Sends bytes and takes in what comes within `wait`.
    fn turn(&mut self, bytes: &[u8], wait: Duration) -> Result<(), Broken> {
        let now = self.now();
        let mut bytes = bytes.to_vec();
        if self.beating && now >= self.next_beat {
            self.next_beat = now + BEAT;
            bytes.extend_from_slice(self.heartbeat(now).as_bytes());
        }
        let came = self
            .wire
            .exchange(&bytes, wait)
            .map_err(|e| Broken::Gone(e.0))?;
        let at = self.now();
        for byte in came {
            if let Some(Ok(body)) = self.decoder.push(byte) {
                let body = body.to_vec();
                if let Ok((header, reply)) = Reply::decode(&body) {
                    self.take(header.sequence, reply, body, at);
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
                    self.clock.note(*sent, at, pulse.clock_ms);
                }
                self.pulses.push(pulse);
            }
            _ => self.replies.push(Came {
                sequence,
                reply,
                body,
                at,
            }),
        }
    }

    /// A heartbeat of now, counted.
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

    pub(in crate::device) fn beat_count(&self) -> u32 {
        self.beat_count
    }

    /// Lets time pass.
    pub(in crate::device) fn pass(&mut self, time: Duration) -> Result<(), Broken> {
        let until = self.now() + time;
        loop {
            let left = until.saturating_sub(self.now());
            if left.is_zero() {
                return Ok(());
            }
            self.turn(&[], left.min(SLICE))?;
        }
    }

    /// Bytes that may or may not be answered: the reply with this number, if it
    /// comes in time.
    pub(in crate::device) fn send(
        &mut self,
        bytes: &[u8],
        sequence: u16,
        wait: Duration,
    ) -> Result<Option<Came>, Broken> {
        self.replies.retain(|came| came.sequence != sequence);
        let until = self.now() + wait;
        self.turn(bytes, SLICE)?;
        loop {
            let found = self.replies.iter().position(|c| c.sequence == sequence);
            if let Some(place) = found {
                return Ok(Some(self.replies.remove(place)));
            }
            if self.now() >= until {
                return Ok(None);
            }
            self.turn(&[], SLICE)?;
        }
    }

    /// A request until it is answered.
    pub(in crate::device) fn ask(&mut self, request: Request) -> Result<Came, Broken> {
        let sequence = self.next_sequence();
        let frame = request.frame(sequence);
        for _ in 0..TRIES {
            if let Some(came) = self.send(frame.as_bytes(), sequence, RETRY)? {
                return Ok(came);
            }
        }
        Err(Broken::Gone(format!(
            "no answer to {} after {TRIES} tries",
            name(request.kind())
        )))
    }

    pub(in crate::device) fn ack(&mut self, request: Request) -> Result<Ack, Broken> {
        match self.ask(request)?.reply {
            Reply::Ack(ack) if ack.request == request.kind() => Ok(ack),
            other => Err(Broken::seen(format!(
                "{} is answered by {}",
                name(request.kind()),
                name(other.kind())
            ))),
        }
    }

    /// A request that has to be done.
    pub(in crate::device) fn done(&mut self, request: Request) -> Result<Ack, Broken> {
        let ack = self.ack(request)?;
        match ack.refusal {
            Refusal::None => Ok(ack),
            refusal => Err(Broken::seen(format!(
                "{} is refused: {} ({})",
                name(request.kind()),
                refusal.as_str(),
                ack.detail
            ))),
        }
    }

    /// A request that has to be refused, and why.
    pub(in crate::device) fn refused(
        &mut self,
        request: Request,
        why: Refusal,
    ) -> Result<Ack, Broken> {
        let ack = self.ack(request)?;
        if ack.refusal == why {
            Ok(ack)
        } else {
            Err(Broken::seen(format!(
                "{}: {}, and not: {}",
                name(request.kind()),
                ack.refusal.as_str(),
                why.as_str()
            )))
        }
    }

    pub(in crate::device) fn outcome(&mut self) -> Result<Outcome, Broken> {
        match self.ask(Request::State)?.reply {
            Reply::Outcome(outcome) => Ok(outcome),
            other => Err(Broken::seen(format!(
                "STATE is answered by {}",
                name(other.kind())
            ))),
        }
    }

    pub(in crate::device) fn limp(&mut self) -> Result<(), Broken> {
        self.done(Request::Limp).map(drop)
    }

    /// Opens a new connection.
    pub(in crate::device) fn hello(&mut self) -> Result<Identity, Broken> {
        self.nonce = self.nonce.wrapping_add(1);
        let sent = self.now();
        let came = self.ask(Request::Hello(Hello { nonce: self.nonce }))?;
        if let Reply::Ack(ack) = came.reply
            && ack.refusal == Refusal::Version
        {
            return Err(Broken::Gone(format!(
                "it speaks version {} of the wire format and not {VERSION}",
                ack.detail
            )));
        }
        let Reply::Identity(identity) = came.reply else {
            return Err(Broken::seen(format!(
                "HELLO is answered by {}",
                name(came.reply.kind())
            )));
        };
        if identity.nonce != self.nonce {
            return Err(Broken::seen("the nonce is not the one of HELLO"));
        }
        self.clock = DeviceClock::default();
        self.clock.note(sent, came.at, identity.clock_ms);
        self.device = Some(identity);
        Ok(identity)
    }

    /// Limp, at rest, idle, with heartbeats, and nothing left of before.
    pub(in crate::device) fn ready(&mut self) -> Result<(), Broken> {
        self.beating = true;
        self.limp()?;
        self.hello()?;
        let until = self.now() + REST_WITHIN;
        loop {
            let ack = self.ack(Request::Rearm)?;
            match ack.refusal {
                Refusal::None if ack.state == State::Idle => break,
                Refusal::Moving if self.now() < until => {
                    self.pass(Duration::from_millis(50))?;
                }
                refusal => {
                    return Err(Broken::seen(format!(
                        "REARM: {}, {}",
                        refusal.as_str(),
                        ack.state.as_str()
                    )));
                }
            }
        }
        self.telemetry.clear();
        self.events.clear();
        self.pulses.clear();
        self.replies.clear();
        // the new connection has not heard one yet
        self.next_beat = self.now();
        let until = self.now() + RETRY;
        while !self.pulses.iter().any(|pulse| pulse.fresh) {
            if self.now() > until {
                return Err(Broken::seen("no heartbeat is fresh after HELLO"));
            }
            self.pass(SLICE)?;
        }
        Ok(())
    }
}

/// What docs/wire.md calls a message.
pub(super) fn name(kind: u8) -> &'static str {
    match kind {
        kind::HELLO => "HELLO",
        kind::TABLE_BEGIN => "TABLE_BEGIN",
        kind::TABLE_CHUNK => "TABLE_CHUNK",
        kind::TABLE_COMMIT => "TABLE_COMMIT",
        kind::PLAY => "PLAY",
        kind::STOP => "STOP",
        kind::LIMP => "LIMP",
        kind::HEARTBEAT => "HEARTBEAT",
        kind::REARM => "REARM",
        kind::STATE => "STATE",
        kind::PATH_BEGIN => "PATH_BEGIN",
        kind::PATH_CHUNK => "PATH_CHUNK",
        kind::PATH_COMMIT => "PATH_COMMIT",
        kind::RECORD => "RECORD",
        kind::ACK => "ACK",
        kind::IDENTITY => "IDENTITY",
        kind::OUTCOME => "OUTCOME",
        kind::PULSE => "PULSE",
        kind::TELEMETRY => "TELEMETRY",
        kind::EVENT => "EVENT",
        kind::RECORDED => "RECORDED",
        _ => "a message of an unknown type",
    }
}
