//! Random and mutated frames for a playing device: no panic, no force above the limit,
//! and the next frame after the noise is received.
//!
//! In virtual time, with a million frames of each kind; `STUDY_FUZZ_FRAMES` sets another
//! number, for a release build.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{begin, detents, mechanism, mechanism_requests};
use std::num::NonZeroU16;
use std::time::Duration;
use study_device::firmware::{Firmware, Options};
use study_wire::elements::Spring;
use study_wire::frame::{Decoder, Frame, MAX_BODY};
use study_wire::message::{
    Commit, DeviceState, ElementsBegin, FixedVec, Heartbeat, Hello, MINOR, MechanismBegin,
    MechanismChunk, PathBegin, PathChunk, Play, Record, Reply, Request, Stop, TableBegin,
    TableChunk, UploadCrc, kind,
};
use study_wire::predict::{Direction, Lookup};

/// Counts of the frames and their effects.
#[derive(Debug, Default)]
struct Count {
    frames: u64,
    accepted: u64,
    playing: u64,
    /// Largest force over its limit.
    most_share: f64,
    replies: u64,
}

struct Fuzz {
    device: Firmware,
    /// State of xorshift64*, a fast generator.
    random: u64,
    at: Duration,
    decoder: Decoder,
    sequence: u16,
    beats: u32,
    nonce: u32,
    /// CRC of the last uploaded table.
    crc: u32,
    count: Count,
}

impl Fuzz {
    fn new(seed: u64) -> Self {
        Self {
            device: Firmware::new(Options {
                seed,
                servo_hz: 1000.0,
                ..Options::default()
            }),
            random: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15),
            at: Duration::ZERO,
            decoder: Decoder::new(),
            sequence: 0,
            beats: 0,
            nonce: 0,
            crc: 0,
            count: Count::default(),
        }
    }

    fn next(&mut self) -> u64 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        self.random.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, n: u64) -> u64 {
        ((u128::from(self.next()) * u128::from(n)) >> 64) as u64
    }

    fn bytes(&mut self, most: u64) -> Vec<u8> {
        let len = self.below(most + 1);
        (0..len).map(|_| self.below(256) as u8).collect()
    }

    fn float(&mut self) -> f64 {
        let bits = self.next();
        match self.below(6) {
            0 => f64::from_bits(bits),
            1 => f64::NAN,
            2 => [0.0, -0.0, f64::INFINITY, 1e308, 1e-308][self.below(5) as usize],
            3 => 15.0,
            _ => 0.1 * self.below(400) as f64 - 12.0,
        }
    }

    /// A message of a host, with valid or invalid fields.
    fn request(&mut self) -> Request {
        let word = self.below(1 << 32) as u32;
        let small = self.below(40) as u16;
        let clock_ms = self.at.as_millis() as u32;
        match self.below(24) {
            0 => Request::Hello(Hello {
                nonce: self.nonce + self.below(2) as u32,
                minor: self.below(4) as u8,
            }),
            1 => Request::TableBegin(TableBegin {
                nodes: small,
                lookup: [Lookup::Linear, Lookup::Floor, Lookup::Nearest][self.below(3) as usize],
                direction: Direction::Play {
                    delta_mm: self.float(),
                },
                range_mm: [self.float(), self.float()],
                trained_mm_s: self.float(),
                force_n: self.float(),
                velocity_mm_s: self.float(),
                uncertified_n: Some(self.float()),
            }),
            2 => Request::TableChunk(TableChunk {
                first: small,
                nodes: FixedVec::of(&detents(self.float(), self.float())[..3]),
            }),
            3 => Request::TableCommit(Commit { crc: self.crc }),
            4..=6 => Request::Play(Play {
                playback: word,
                crc: self.crc,
                longest_ms: word % 1_000_000,
                every: NonZeroU16::new(small),
            }),
            7 => match word % 2 {
                0 => Request::Stop(Stop { playback: word }),
                _ => Request::Fade(Stop { playback: 1 }),
            },
            8 => Request::Limp,
            9..=13 => {
                self.beats = self.beats.wrapping_add(1);
                Request::Heartbeat(Heartbeat {
                    count: self.beats,
                    deadline_ms: clock_ms.wrapping_add(word % 60),
                })
            }
            14 => Request::Rearm,
            15 => Request::State,
            16 => Request::PathBegin(PathBegin {
                points: u32::from(small),
                rate_hz: self.float(),
                force_n: self.float(),
                velocity_mm_s: self.float(),
            }),
            17 => Request::PathChunk(PathChunk {
                first: u32::from(small),
                x_nm: FixedVec::of(&[word as i32; 56][..usize::from(small) + 1]),
            }),
            18 => Request::PathCommit(Commit { crc: word }),
            19 => {
                let (good, _) = mechanism(4.0, 1.0);
                Request::MechanismBegin(MechanismBegin {
                    detents: small,
                    frictions: small,
                    range_mm: [self.float(), self.float()],
                    trained_mm_s: self.float(),
                    force_n: self.float(),
                    uncertified_n: Some(self.float()),
                    ..good
                })
            }
            20 => Request::MechanismChunk(MechanismChunk {
                first: small,
                values: FixedVec::of(&[self.float(); 12]),
            }),
            21 => Request::MechanismCommit(Commit { crc: self.crc }),
            22 => Request::ElementsBegin(ElementsBegin {
                nodes: small,
                mass_kg: self.float(),
                range_mm: [self.float(), self.float()],
                trained_mm_s: self.float(),
                force_n: self.float(),
                velocity_mm_s: self.float(),
                uncertified_n: Some(self.float()),
                springs: FixedVec::of(&[
                    Spring::Stop {
                        slip_mm: self.float(),
                    },
                    Spring::Latch {
                        rearm_mm: self.float(),
                        break_mm: self.float(),
                    },
                ]),
            }),
            _ => Request::Record(Record {
                playback: word,
                crc: self.crc,
            }),
        }
    }

    /// Sends bytes, waits up to two milliseconds and checks the force.
    fn send(&mut self, bytes: &[u8]) {
        self.device.receive(bytes, self.at);
        self.look();
        if self.below(4) == 0 {
            let passed = self.below(3);
            self.at += Duration::from_millis(passed);
            self.device.advance(self.at);
            self.look();
        }
        for byte in self.device.take_output() {
            if let Some(body) = self.decoder.push(byte) {
                // the device sends only valid messages
                Reply::decode(body.unwrap()).unwrap();
                self.count.replies += 1;
            }
        }
    }

    fn look(&mut self) {
        let (force_n, limit_n) = (self.device.held_n(), self.device.limit_n());
        let state = self.device.state();
        assert!(force_n.abs() <= limit_n && limit_n <= 15.0, "{force_n}");
        assert!(
            force_n == 0.0 || state.applies_force(),
            "{force_n} {state:?}"
        );
        self.count.playing += u64::from(state.applies_force());
        if limit_n > 0.0 {
            self.count.most_share = self.count.most_share.max(force_n.abs() / limit_n);
        }
    }

    fn say(&mut self, request: Request) {
        self.sequence = self.sequence.wrapping_add(1);
        self.send(request.frame(self.sequence).as_bytes());
    }

    fn beat(&mut self) {
        self.beats = self.beats.wrapping_add(1);
        let deadline_ms = (self.at.as_millis() as u32).wrapping_add(40);
        self.say(Request::Heartbeat(Heartbeat {
            count: self.beats,
            deadline_ms,
        }));
    }

    /// From any state to idle, with a new connection.
    fn open(&mut self) {
        self.say(Request::Limp);
        self.at += Duration::from_millis(500);
        self.nonce += 2;
        self.say(Request::Hello(Hello {
            nonce: self.nonce,
            minor: MINOR,
        }));
        self.at += Duration::from_millis(100);
        self.say(Request::Rearm);
    }

    fn live(&mut self) {
        for _ in 0..50 {
            self.beat();
            self.at += Duration::from_millis(10);
        }
        assert!(
            self.device.state().applies_force(),
            "{:?}",
            self.device.fault()
        );
    }

    /// Starts a playback with a large force.
    fn play(&mut self) {
        self.open();
        let mut nodes = detents(0.05, 0.02);
        for node in &mut nodes {
            node.positive[3] *= 4.0;
            node.negative[3] *= 4.0;
        }
        let begin = TableBegin {
            uncertified_n: Some(9.0),
            ..begin(&nodes)
        };
        let mut crc = UploadCrc::of_table(&begin);
        nodes.iter().for_each(|node| crc.node(node));
        self.crc = crc.value();
        self.say(Request::TableBegin(begin));
        for (i, some) in nodes.chunks(TableChunk::MAX_NODES).enumerate() {
            self.say(Request::TableChunk(TableChunk {
                first: (i * TableChunk::MAX_NODES) as u16,
                nodes: FixedVec::of(some),
            }));
        }
        self.beat();
        self.say(Request::TableCommit(Commit { crc: self.crc }));
        self.say(Request::Play(Play {
            playback: 1,
            crc: self.crc,
            longest_ms: 60_000,
            every: NonZeroU16::new(1),
        }));
        self.live();
    }

    /// Starts a playback of a mechanism with a large force.
    fn play_mechanism(&mut self) {
        self.open();
        let (mut begin, values) = mechanism(16.0, 4.0);
        begin.uncertified_n = Some(9.0);
        let (requests, crc) = mechanism_requests(begin, &values);
        self.crc = crc;
        for request in requests {
            self.say(request);
        }
        self.beat();
        self.say(Request::MechanismCommit(Commit { crc }));
        self.say(Request::Play(Play {
            playback: 1,
            crc,
            longest_ms: 60_000,
            every: NonZeroU16::new(1),
        }));
        self.live();
    }

    /// Starts a recording.
    fn record(&mut self) {
        self.open();
        let begin = PathBegin {
            points: 2000,
            rate_hz: 1000.0,
            force_n: 15.0,
            velocity_mm_s: 1000.0,
        };
        let x_nm: Vec<i32> = (0..2000).map(|i| 17_500_000 + 6_000 * i).collect();
        let mut crc = UploadCrc::of_path(&begin);
        x_nm.iter().for_each(|x| crc.point(*x));
        self.crc = crc.value();
        self.say(Request::PathBegin(begin));
        for (i, some) in x_nm.chunks(PathChunk::MAX_POINTS).enumerate() {
            self.say(Request::PathChunk(PathChunk {
                first: (i * PathChunk::MAX_POINTS) as u32,
                x_nm: FixedVec::of(some),
            }));
        }
        self.beat();
        self.say(Request::PathCommit(Commit { crc: self.crc }));
        self.say(Request::Record(Record {
            playback: 1,
            crc: self.crc,
        }));
        self.live();
    }

    /// After any noise the next frame is received.
    fn in_step(&mut self) {
        self.device.take_output();
        let at = self.at;
        self.device.receive(Request::State.frame(77).as_bytes(), at);
        let mut found = None;
        for byte in self.device.take_output() {
            if let Some(Ok(body)) = self.decoder.push(byte) {
                found = Reply::decode(body).ok();
            }
        }
        assert!(matches!(found, Some((header, Reply::Outcome(_))) if header.sequence == 77));
    }
}

fn frames() -> u64 {
    std::env::var("STUDY_FUZZ_FRAMES").map_or(1_000_000, |frames| frames.parse().unwrap())
}

/// Valid frames with random bodies and correct CRC.
#[test]
fn random_frames() {
    let mut fuzz = Fuzz::new(1);
    while fuzz.count.frames < frames() {
        let i = fuzz.count.frames;
        if i.is_multiple_of(5000) {
            fuzz.record();
        } else if i.is_multiple_of(3000) {
            fuzz.play_mechanism();
        } else if i.is_multiple_of(1000) {
            fuzz.play();
        }
        if i.is_multiple_of(10) {
            fuzz.beat();
        }
        let body = match fuzz.below(4) {
            0 => fuzz.bytes(MAX_BODY as u64),
            // any bytes after a valid header, except that of LIMP
            1 => {
                let mut body = vec![1, fuzz.below(0x24) as u8, 0, 0];
                body.extend(fuzz.bytes(30));
                if body[1] == kind::LIMP && fuzz.below(50) != 0 {
                    body[1] = kind::PLAY;
                }
                body
            }
            _ => {
                let mut request = fuzz.request();
                if matches!(request, Request::Limp | Request::Hello(_)) && fuzz.below(50) != 0 {
                    request = Request::State;
                }
                fuzz.sequence = fuzz.sequence.wrapping_add(1);
                let frame = request.frame(fuzz.sequence);
                fuzz.count.accepted += 1;
                fuzz.send(frame.as_bytes());
                fuzz.count.frames += 1;
                continue;
            }
        };
        let frame = Frame::of(&body).unwrap();
        fuzz.send(frame.as_bytes());
        fuzz.count.frames += 1;
        if i.is_multiple_of(16) {
            fuzz.in_step();
        }
    }
    eprintln!("random: {:?}", fuzz.count);
    assert!(
        fuzz.count.playing > fuzz.count.frames / 20,
        "{:?}",
        fuzz.count
    );
    assert_eq!(fuzz.count.most_share, 1.0, "the limit was never reached");
}

/// Frames changed as by a faulty link: bits, bytes, pieces.
#[test]
fn mutated_frames() {
    let mut fuzz = Fuzz::new(2);
    for i in 0..frames() {
        if i.is_multiple_of(5000) {
            fuzz.record();
        } else if i.is_multiple_of(3000) {
            fuzz.play_mechanism();
        } else if i.is_multiple_of(1000) {
            fuzz.play();
        }
        if i.is_multiple_of(10) {
            fuzz.beat();
        }
        let mut request = fuzz.request();
        if matches!(request, Request::Limp | Request::Hello(_)) && fuzz.below(50) != 0 {
            request = Request::State;
        }
        fuzz.sequence = fuzz.sequence.wrapping_add(1);
        let mut bytes = request.frame(fuzz.sequence).as_bytes().to_vec();
        for _ in 0..=fuzz.below(3) {
            let at = fuzz.below(bytes.len() as u64) as usize;
            match fuzz.below(6) {
                0 => bytes[at] ^= 1 << fuzz.below(8),
                1 => bytes[at] = fuzz.below(256) as u8,
                2 => {
                    bytes.remove(at);
                }
                3 => bytes.insert(at, fuzz.below(256) as u8),
                4 => bytes.truncate(at + 1),
                _ => {
                    let again = bytes[at..].to_vec();
                    bytes.extend(again);
                }
            }
            if bytes.is_empty() {
                bytes.push(0x55);
            }
        }
        fuzz.send(&bytes);
        fuzz.count.frames += 1;
        if i.is_multiple_of(16) {
            fuzz.in_step();
        }
    }
    eprintln!("mutated: {:?}", fuzz.count);
    assert!(
        fuzz.count.playing > fuzz.count.frames / 20,
        "{:?}",
        fuzz.count
    );
    assert_eq!(fuzz.count.most_share, 1.0, "the limit was never reached");
    assert_ne!(fuzz.device.state(), DeviceState::Boot);
}

/// Random replies of a device after a valid header. A reply that can be decoded is the
/// same after encoding it again.
#[test]
fn random_replies() {
    let mut fuzz = Fuzz::new(3);
    let kinds = [
        kind::ACK,
        kind::IDENTITY,
        kind::OUTCOME,
        kind::PULSE,
        kind::TELEMETRY,
        kind::EVENT,
        kind::RECORDED,
    ];
    // the fixed lengths, so that most replies are not rejected because of the length
    let lengths = [12, 153, 91, 11, 21, 15, 13];
    let mut messages = 0u64;
    for _ in 0..frames() {
        let which = fuzz.below(7) as usize;
        let samples = fuzz.below(4) as usize;
        let mut body = vec![1, kinds[which], 0, 0];
        let more = match kinds[which] {
            kind::TELEMETRY => 20 * samples,
            kind::RECORDED => 12 * samples,
            _ => 0,
        };
        let small = fuzz.below(2) == 0;
        for i in 0..lengths[which] + more {
            // small bytes are more likely to be valid codes
            let byte = fuzz.below(if small && i < 12 { 9 } else { 256 });
            body.push(byte as u8);
        }
        if more > 0 {
            body[4 + lengths[which] - 1] = samples as u8;
        }
        let Ok((header, reply)) = Reply::decode(&body) else {
            continue;
        };
        messages += 1;
        let frame = reply.frame(header.sequence);
        let mut decoder = Decoder::new();
        let again = frame.as_bytes().iter().find_map(|byte| {
            let body = decoder.push(*byte)?;
            Some(Reply::decode(body.unwrap()).unwrap())
        });
        assert_eq!(again, Some((header, reply)));
    }
    eprintln!("random replies: {messages} were messages");
    assert!(messages > frames() / 10, "{messages}");
}
