//! A minimal host for a simulated device, in virtual time.

#![allow(dead_code, reason = "each test uses its part")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::num::NonZeroU16;
use std::time::Duration;
use study_device::firmware::{Firmware, Options};
use study_wire::frame::Decoder;
use study_wire::mechanism::Scalars;
use study_wire::message::{
    Ack, Commit, FixedVec, Heartbeat, Hello, MINOR, MechanismBegin, MechanismChunk, Node, Outcome,
    Play, Pulse, Refusal, Reply, Request, Stop, TableBegin, TableChunk, UploadCrc, kind,
};
use study_wire::predict::{Direction, Lookup};

pub(crate) fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

pub(crate) struct Host {
    pub(crate) device: Firmware,
    pub(crate) at: Duration,
    decoder: Decoder,
    sequence: u16,
    beats: u32,
    /// Time of the device's clock at the host's time zero, ms.
    offset_ms: u32,
    /// Messages that were not a reply to a request.
    pub(crate) heard: Vec<Reply>,
    /// Their sequence numbers.
    numbers: Vec<u16>,
}

impl Host {
    /// A device 100 ms after power-up.
    pub(crate) fn new(options: Options) -> Self {
        let offset_ms = options.clock_ms;
        let mut device = Firmware::new(options);
        device.advance(ms(100));
        Self {
            device,
            at: ms(100),
            decoder: Decoder::new(),
            sequence: 0,
            beats: 0,
            offset_ms,
            heard: Vec::new(),
            numbers: Vec::new(),
        }
    }

    /// LIMP, HELLO, REARM.
    pub(crate) fn opened(options: Options) -> Self {
        let mut host = Self::new(options);
        host.open(1);
        host
    }

    pub(crate) fn open(&mut self, nonce: u32) {
        self.ask(Request::Limp);
        self.ask(Request::Hello(Hello {
            nonce,
            minor: MINOR,
        }));
        assert_eq!(self.ack(Request::Rearm).refusal, Refusal::None);
    }

    pub(crate) fn clock_ms(&self) -> u32 {
        self.offset_ms.wrapping_add(self.at.as_millis() as u32)
    }

    /// Replies that the device has sent, in order.
    pub(crate) fn read(&mut self) -> Vec<Reply> {
        let mut replies = Vec::new();
        for byte in self.device.take_output() {
            if let Some(body) = self.decoder.push(byte) {
                let (header, reply) = Reply::decode(body.unwrap()).unwrap();
                if reply.kind() >= kind::TELEMETRY {
                    self.numbers.push(header.sequence);
                }
                replies.push(reply);
            }
        }
        replies
    }

    /// Sends with the next sequence number and returns the reply.
    pub(crate) fn ask(&mut self, request: Request) -> Reply {
        self.sequence = self.sequence.wrapping_add(1);
        self.ask_as(self.sequence, request).unwrap()
    }

    /// Sends with this sequence number.
    pub(crate) fn ask_as(&mut self, sequence: u16, request: Request) -> Option<Reply> {
        self.send(request.frame(sequence).as_bytes())
    }

    /// Sends bytes and returns the first reply, if any.
    pub(crate) fn send(&mut self, bytes: &[u8]) -> Option<Reply> {
        self.device.receive(bytes, self.at);
        let mut answer = None;
        for reply in self.read() {
            if reply.kind() < kind::TELEMETRY && answer.is_none() {
                answer = Some(reply);
            } else {
                self.heard.push(reply);
            }
        }
        answer
    }

    pub(crate) fn ack(&mut self, request: Request) -> Ack {
        match self.ask(request) {
            Reply::Ack(ack) => {
                assert_eq!(ack.request, request.kind());
                ack
            }
            other => panic!("{other:?}"),
        }
    }

    pub(crate) fn beat(&mut self) -> Pulse {
        self.beats = self.beats.wrapping_add(1);
        self.beat_as(self.beats, self.clock_ms().wrapping_add(40))
    }

    pub(crate) fn beat_as(&mut self, count: u32, deadline_ms: u32) -> Pulse {
        match self.ask(Request::Heartbeat(Heartbeat { count, deadline_ms })) {
            Reply::Pulse(pulse) => pulse,
            other => panic!("{other:?}"),
        }
    }

    pub(crate) fn outcome(&mut self) -> Outcome {
        match self.ask(Request::State) {
            Reply::Outcome(outcome) => outcome,
            other => panic!("{other:?}"),
        }
    }

    /// Waits without sending anything.
    pub(crate) fn wait(&mut self, lasting: Duration) {
        self.at += lasting;
        self.device.advance(self.at);
        let heard = self.read();
        self.heard.extend(heard);
    }

    /// Waits with a heartbeat every 10 ms.
    pub(crate) fn live(&mut self, lasting: Duration) {
        let until = self.at + lasting;
        while self.at < until {
            self.beat();
            self.wait(ms(10).min(until - self.at));
        }
    }

    /// Sequence numbers of the unsolicited messages since the last call.
    pub(crate) fn unsolicited(&mut self) -> Vec<u16> {
        std::mem::take(&mut self.numbers)
    }

    /// The chunks of a table.
    pub(crate) fn chunks(&self, nodes: &[Node]) -> Vec<Request> {
        let chunks = nodes.chunks(TableChunk::MAX_NODES).enumerate();
        let chunk = |(i, some)| {
            Request::TableChunk(TableChunk {
                first: (i * TableChunk::MAX_NODES) as u16,
                nodes: FixedVec::of(some),
            })
        };
        chunks.map(chunk).collect()
    }

    /// Uploads a table; the reply to COMMIT or the first refusal, and the CRC.
    pub(crate) fn upload(&mut self, begin: TableBegin, nodes: &[Node]) -> (Ack, u32) {
        let mut crc = UploadCrc::of_table(&begin);
        nodes.iter().for_each(|node| crc.node(node));
        let first = self.ack(Request::TableBegin(begin));
        if first.refusal != Refusal::None {
            return (first, crc.value());
        }
        for chunk in self.chunks(nodes) {
            let ack = self.ack(chunk);
            if ack.refusal != Refusal::None {
                return (ack, crc.value());
            }
        }
        self.beat();
        let crc = crc.value();
        (self.ack(Request::TableCommit(Commit { crc })), crc)
    }

    /// Uploads a mechanism; the reply to COMMIT or the first refusal, and the CRC.
    pub(crate) fn upload_mechanism(
        &mut self,
        begin: MechanismBegin,
        values_n: &[f64],
    ) -> (Ack, u32) {
        let (requests, crc) = mechanism_requests(begin, values_n);
        for request in requests {
            self.beat();
            let ack = self.ack(request);
            if ack.refusal != Refusal::None {
                return (ack, crc);
            }
        }
        self.beat();
        let commit = Request::MechanismCommit(Commit { crc });
        (self.ack(commit), crc)
    }

    pub(crate) fn play(&mut self, playback: u32, crc: u32) -> Ack {
        self.beat();
        self.ack(Request::Play(Play {
            playback,
            crc,
            longest_ms: 60_000,
            every: NonZeroU16::new(4),
        }))
    }

    pub(crate) fn stop(&mut self, playback: u32) -> Ack {
        self.ack(Request::Stop(Stop { playback }))
    }

    /// A device that has been playing for `lasting`.
    pub(crate) fn playing(options: Options, lasting: Duration) -> Self {
        let mut host = Self::opened(options);
        let nodes = detents(0.05, 0.02);
        let (ack, crc) = host.upload(begin(&nodes), &nodes);
        assert_eq!(ack.refusal, Refusal::None, "{ack:?}");
        assert_eq!(host.play(7, crc).refusal, Refusal::None);
        host.live(lasting);
        host
    }
}

/// MECHANISM_BEGIN and all chunks, and the CRC.
pub(crate) fn mechanism_requests(begin: MechanismBegin, values_n: &[f64]) -> (Vec<Request>, u32) {
    let mut crc = UploadCrc::of_mechanism(&begin);
    values_n.iter().for_each(|value| crc.value_n(*value));
    let chunks = values_n.chunks(MechanismChunk::MAX_VALUES).enumerate();
    let chunk = |(i, some)| {
        Request::MechanismChunk(MechanismChunk {
            first: (i * MechanismChunk::MAX_VALUES) as u16,
            values: FixedVec::of(some),
        })
    };
    let begin = [Request::MechanismBegin(begin)].into_iter();
    (begin.chain(chunks.map(chunk)).collect(), crc.value())
}

/// A switch of three detents with friction as a mechanism: 65 values of D every 0.5 mm, 9 of
/// F_c every 4 mm.
pub(crate) fn mechanism(detent_n: f64, friction_n: f64) -> (MechanismBegin, Vec<f64>) {
    let begin = MechanismBegin {
        detents: 65,
        frictions: 9,
        detent_mm: [1.5, 0.5],
        friction_mm: [1.5, 4.0],
        range_mm: [1.5, 33.5],
        trained_mm_s: 138.0,
        force_n: 12.0,
        velocity_mm_s: 1000.0,
        uncertified_n: None,
        scalars: Scalars {
            handle_kg: 0.1,
            follower_kg: 0.14,
            contact_n_per_mm: 12.0,
            contact_n_s_per_mm: 0.012,
            gap_mm: 0.8,
            follower_n_s_per_mm: 0.006,
            slip_mm: 0.06,
            stribeck: 0.3,
            stribeck_mm_s: 8.0,
            handle_n: 0.25,
            handle_slip_mm: 0.06,
            handle_n_s_per_mm: 0.001,
            offset_n: 0.3,
        },
    };
    let detent = (0..65).map(|i| {
        let x_mm = 1.5 + 0.5 * f64::from(i);
        detent_n * libm::sin((x_mm - 5.0) / 12.5 * std::f64::consts::TAU)
    });
    let friction = std::iter::repeat_n(friction_n, 9);
    (begin, detent.chain(friction).collect())
}

/// A switch of three detents with friction; m in kg, b in N·s/mm.
pub(crate) fn detents(m: f64, b: f64) -> Vec<Node> {
    (2..=33)
        .map(|x| {
            let x_mm = f64::from(x);
            let spring_n = 4.0 * libm::sin((x_mm - 5.0) / 12.5 * std::f64::consts::TAU);
            Node {
                x_mm,
                positive: [m, b, 0.0, spring_n + 1.0],
                negative: [m, b, 0.0, spring_n - 1.0],
            }
        })
        .collect()
}

pub(crate) fn begin(nodes: &[Node]) -> TableBegin {
    TableBegin {
        nodes: nodes.len() as u16,
        lookup: Lookup::Linear,
        direction: Direction::Play { delta_mm: 0.5 },
        range_mm: [1.5, 33.5],
        trained_mm_s: 138.0,
        force_n: 12.0,
        velocity_mm_s: 1000.0,
        uncertified_n: None,
    }
}
