//! Version 1 of the wire format, byte by byte.
//!
//! The bytes were written by another implementation than the tested one, with Python's
//! `struct` and `zlib.crc32` from the tables of `docs/wire.md`. They never change; a change
//! would be version 2.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod frames;
mod replies;
mod requests;

use self::replies::replies;
use self::requests::requests;
use std::num::NonZeroU16;
use study_wire::elements::Spring;
use study_wire::frame::{Decoder, crc32, is_stream};
use study_wire::handler::{Bounds, Handler, Measured, Profile};
use study_wire::mechanism::Scalars;
use study_wire::message::{
    Ack, Commit, Constants, DeviceState, ElementsBegin, Event, EventKind, Fault, Features,
    FixedVec, Flags, Heartbeat, Hello, Identity, Loaded, MechanismBegin, MechanismChunk, Name,
    Node, Outcome, PathBegin, PathChunk, Play, Pulse, Record, Recorded, RecordedPoint, Refusal,
    Reply, Request, Stop, TableBegin, TableChunk, Telemetry, TelemetrySample, UploadCrc, WireError,
    fixed, kind,
};
use study_wire::predict::{Direction, Lookup, Motion};
use study_wire::servo::ServoSettings;

/// CRC of the four nodes of [`chunk`] with [`begin`].
const TABLE_CRC: u32 = 0xDDE60A90;
/// CRC of the three points below.
const PATH_CRC: u32 = 0xD46CF557;
/// CRC of the five values below with [`mechanism`].
const MECHANISM_CRC: u32 = 0xE161DD9F;

struct Golden<M> {
    name: &'static str,
    sequence: u16,
    message: M,
    /// Bytes and meaning of each field, in order; together the body.
    body: &'static [(&'static str, &'static str)],
    /// CRC of the body, as sent.
    crc: &'static str,
    /// The encoded frame.
    frame: &'static str,
}

fn begin() -> TableBegin {
    TableBegin {
        nodes: 4,
        lookup: Lookup::Linear,
        direction: Direction::Play { delta_mm: 0.5 },
        range_mm: [1.5, 33.5],
        trained_mm_s: 138.0,
        force_n: 12.0,
        velocity_mm_s: 1000.0,
        uncertified_n: None,
    }
}

fn nodes() -> [Node; 4] {
    [
        (5.0, 0.0, 1.0, -1.0),
        (10.0, 0.25, -1.5, -3.5),
        (20.0, -0.5, 11.0, 9.0),
        (30.0, 0.0, 1.0, -1.0),
    ]
    .map(|(x_mm, k, plus, minus)| Node {
        x_mm,
        positive: [0.05, 0.01, k, plus],
        negative: [0.05, 0.01, k, minus],
    })
}

fn chunk(first: u16, count: usize) -> Request {
    let from = usize::from(first);
    Request::TableChunk(TableChunk {
        first,
        nodes: FixedVec::of(&nodes()[from..from + count]),
    })
}

fn identity() -> Identity {
    Identity {
        nonce: 0xC0FF_EE01,
        versions: [1, 1],
        state: DeviceState::Idle,
        fault: Fault::None,
        flags: Flags {
            simulated: true,
            telemetry: true,
            ..Flags::default()
        },
        clock_ms: 12,
        watchdog_ms: 30,
        max_nodes: 512,
        max_points: 0,
        longest_ms: 600_000,
        servo_hz: 4000.0,
        telemetry_hz: 1000.0,
        force_n: 15.0,
        velocity_mm_s: 1000.0,
        stiffness_n_per_mm: 20.0,
        damping_n_s_per_mm: 0.1,
        stroke_mm: [-5.0, 40.0],
        firmware: Name::new("example 1.0"),
        serial: Name::new("A-0001"),
        constants: None,
    }
}

/// A mechanism of three detent values and two of friction.
fn mechanism() -> MechanismBegin {
    MechanismBegin {
        detents: 3,
        frictions: 2,
        detent_mm: [1.5, 16.0],
        friction_mm: [1.5, 32.0],
        range_mm: [1.5, 33.5],
        trained_mm_s: 138.0,
        force_n: 12.0,
        velocity_mm_s: 1000.0,
        uncertified_n: None,
        scalars: Scalars {
            handle_kg: 0.1,
            follower_kg: 0.14,
            contact_n_per_mm: 12.0,
            contact_n_s_per_mm: 0.0125,
            gap_mm: 0.75,
            follower_n_s_per_mm: 0.005,
            slip_mm: 0.0625,
            stribeck: 0.25,
            stribeck_mm_s: 8.0,
            handle_n: 0.25,
            handle_slip_mm: 0.0625,
            handle_n_s_per_mm: 0.001,
            offset_n: 0.5,
        },
    }
}

/// Elements of three nodes with a spring of each kind.
fn elements() -> ElementsBegin {
    ElementsBegin {
        nodes: 3,
        mass_kg: 0.0625,
        range_mm: [1.5, 33.5],
        trained_mm_s: 138.0,
        force_n: 12.0,
        velocity_mm_s: 1000.0,
        uncertified_n: None,
        springs: FixedVec::of(&[
            Spring::Stop { slip_mm: 0.25 },
            Spring::Maxwell {
                slip_mm: 8.0,
                relaxation_s: 0.125,
            },
            Spring::Latch {
                rearm_mm: 10.0,
                break_mm: 14.0,
            },
        ]),
    }
}

/// The same device to a host of minor version 1.
fn identity_1() -> Identity {
    Identity {
        constants: Some(Constants {
            minor: 1,
            features: Features {
                acceleration_from_speed: true,
                mechanism: false,
                elements: false,
                fade: false,
            },
            commit_ms: 135,
            acceleration_hz: 20.0,
            least_mass_kg: -0.05,
            damping_n_s_per_mm: 0.002,
            wall_n_per_mm: 10.0,
            wall_n_s_per_mm: 0.01,
            overtravel_mm: 2.5,
            jump_mm: 1.0,
            slew_n_s: 2000.0,
            ramp_s: 0.4,
        }),
        ..identity()
    }
}

/// The same device, with all features, to a host of minor version 3.
fn identity_3() -> Identity {
    let told = identity_1().constants.map(|told| Constants {
        minor: 3,
        features: Features {
            acceleration_from_speed: true,
            mechanism: true,
            elements: true,
            fade: true,
        },
        ..told
    });
    Identity {
        constants: told,
        ..identity_1()
    }
}

fn outcome() -> Outcome {
    Outcome {
        state: DeviceState::Loaded,
        fault: Fault::None,
        loaded: Loaded::Table,
        clock_ms: 20_000,
        crc: TABLE_CRC,
        playback: 7,
        ticks: 48_000,
        samples: 12_000,
        strokes: 11,
        switches: 95,
        clamps: 2,
        slewed: 31,
        mass_held: 0,
        energy_j: 0.75,
        least_energy_j: -0.0625,
        peak_force_n: 12.0,
        rough_n2: 0.125,
        limit_n: 12.0,
        bad_frames: 1,
        stale_beats: 0,
    }
}

fn telemetry() -> Telemetry {
    let sample = |tick, x_mm, v_mm_s, command_n, measured_n: Option<f64>| TelemetrySample {
        tick,
        x_nm: fixed::nm(x_mm),
        v_um_s: fixed::um_s(v_mm_s),
        command_un: fixed::un(command_n),
        measured_un: measured_n.map(fixed::un),
    };
    Telemetry {
        playback: 7,
        first: 20,
        clock_ms: 123_483,
        strokes: 1,
        clamps: 0,
        samples: FixedVec::of(&[
            sample(80, 17.205, -120.5, -1.25, Some(-1.2)),
            sample(84, 17.085, -120.0, -1.3, None),
        ]),
    }
}

fn unhex(text: &str) -> Vec<u8> {
    (0..text.len())
        .step_by(2)
        .map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap())
        .collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// The only body in a stream.
fn body_of(stream: &[u8]) -> Vec<u8> {
    let mut decoder = Decoder::new();
    let mut found = Vec::new();
    for byte in stream {
        if let Some(body) = decoder.push(*byte) {
            found.push(body.unwrap().to_vec());
        }
    }
    assert_eq!(found.len(), 1);
    found.remove(0)
}

fn joined<M>(golden: &Golden<M>) -> Vec<u8> {
    unhex(
        &golden
            .body
            .iter()
            .map(|(bytes, _)| *bytes)
            .collect::<String>(),
    )
}

/// Checks frame, body and CRC of a message and returns the body.
fn bytes_agree<M>(golden: &Golden<M>, frame: &[u8]) -> Vec<u8> {
    assert_eq!(hex(frame), golden.frame, "{}", golden.name);
    let body = body_of(frame);
    assert_eq!(body, joined(golden), "{}", golden.name);
    let crc = hex(&crc32(&body).to_le_bytes());
    assert_eq!(crc, golden.crc, "{}", golden.name);
    body
}

#[test]
fn every_request_has_the_specified_bytes() {
    let mut kinds = Vec::new();
    for golden in requests() {
        let body = bytes_agree(&golden, golden.message.frame(golden.sequence).as_bytes());
        let (header, message) = Request::decode(&body).unwrap();
        assert_eq!(message, golden.message, "{}", golden.name);
        assert_eq!(header.sequence, golden.sequence);
        assert_eq!(header.kind, golden.message.kind());
        kinds.push(header.kind);
    }
    kinds.dedup();
    let all = [
        1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 0x10, 0x11, 0x12, 0x13, 0x20, 0x21, 0x22, 0x30,
    ];
    assert_eq!(kinds, all, "a message is not in the list");
}

#[test]
fn every_reply_has_the_specified_bytes() {
    let mut kinds = Vec::new();
    for golden in replies() {
        let frame = golden.message.frame(golden.sequence);
        let body = bytes_agree(&golden, frame.as_bytes());
        let stream = golden.message.kind() >= kind::TELEMETRY;
        assert_eq!(is_stream(frame.as_bytes()), stream, "{}", golden.name);
        let (header, message) = Reply::decode(&body).unwrap();
        assert_eq!(message, golden.message, "{}", golden.name);
        assert_eq!(header.sequence, golden.sequence);
        kinds.push(header.kind);
    }
    kinds.dedup();
    let all = [0x80, 0x81, 0x82, 0x83, 0x90, 0x91, 0x92];
    assert_eq!(kinds, all, "a message is not in the list");
}

#[test]
fn the_crc_of_an_upload_is_that_of_its_consecutive_fields() {
    let mut crc = UploadCrc::of_table(&begin());
    nodes().iter().for_each(|node| crc.node(node));
    assert_eq!(crc.value(), TABLE_CRC);
    let mut crc = UploadCrc::of_mechanism(&mechanism());
    for value in [0.0, 4.0, -4.0, 1.25, 1.5] {
        crc.value_n(value);
    }
    assert_eq!(crc.value(), MECHANISM_CRC);
    let mut crc = UploadCrc::of_elements(&elements());
    for (x_mm, values) in [
        (1.5, [1.25, 0.001, 0.002, 0.5, 0.25, 0.0, 0.0, 0.0]),
        (12.0, [-2.5, 0.0, 0.0, 0.5, 1.5, 2.0, 0.0, 0.0]),
        (33.5, [4.0, 0.003, 0.0, 0.25, 0.0, 0.0, 0.0, 0.0]),
    ] {
        crc.node(&Node::of_elements(x_mm, values));
    }
    // by zlib over the same numbers in Python
    assert_eq!(crc.value(), 0xf562bb78);
    let mut crc = UploadCrc::of_path(&PathBegin {
        points: 3,
        rate_hz: 1000.0,
        force_n: 20.0,
        velocity_mm_s: 500.0,
    });
    for point in [17_500_000, 17_500_250, -1] {
        crc.point(point);
    }
    assert_eq!(crc.value(), PATH_CRC);
}

#[test]
fn a_message_of_any_other_length_is_refused() {
    // Of these two, all that minor version 1 added is absent in minor version 0.
    let hello = Hello {
        nonce: 0xC0FF_EE01,
        minor: 0,
    };
    let shorter = |body: &[u8]| match (body[1], body.len()) {
        (kind::HELLO, 8) => Some(Request::decode(body).unwrap().1 == Request::Hello(hello)),
        (kind::IDENTITY, 157) => {
            Some(Reply::decode(body).unwrap().1 == Reply::Identity(identity()))
        }
        _ => None,
    };
    for golden in requests() {
        let body = joined(&golden);
        for cut in 4..body.len() {
            let decoded = Request::decode(&body[..cut]);
            let good = shorter(&body[..cut]).unwrap_or(decoded.is_err());
            assert!(good, "{} {cut}", golden.name);
        }
        let longer = [&body[..], &[0]].concat();
        assert_eq!(Request::decode(&longer).unwrap_err(), WireError::Length);
    }
    for golden in replies() {
        let body = joined(&golden);
        for cut in 4..body.len() {
            let decoded = Reply::decode(&body[..cut]);
            let good = shorter(&body[..cut]).unwrap_or(decoded.is_err());
            assert!(good, "{} {cut}", golden.name);
        }
        let longer = [&body[..], &[0]].concat();
        assert_eq!(Reply::decode(&longer).unwrap_err(), WireError::Length);
    }
}

#[test]
fn invalid_replies_are_rejected() {
    let spoiled = |reply: Reply, at: usize, bytes: &[u8]| {
        let mut body = body_of(reply.frame(0).as_bytes());
        body[at..at + bytes.len()].copy_from_slice(bytes);
        Reply::decode(&body)
    };
    let nan = f64::NAN.to_le_bytes();
    let zero = 0.0f64.to_le_bytes();
    // servo rate, force limit, state
    for (at, bytes) in [(33, &nan[..]), (49, &nan), (49, &zero), (10, &[9])] {
        let spoilt = spoiled(Reply::Identity(identity()), at, bytes);
        assert_eq!(spoilt, Err(WireError::Field), "{at}");
    }
    // minor version, acceleration filter, mass, damping, slew
    let positive = 0.1f64.to_le_bytes();
    let constants: [(usize, &[u8]); 6] = [
        (157, &[0]),
        (164, &zero),
        (172, &positive),
        (172, &nan),
        (180, &nan),
        (220, &zero),
    ];
    for (at, bytes) in constants {
        let spoilt = spoiled(Reply::Identity(identity_1()), at, bytes);
        assert_eq!(spoilt, Err(WireError::Field), "{at}");
    }
    // Features that this version does not know are ignored.
    let later = spoiled(
        Reply::Identity(identity_1()),
        158,
        &[0xf1, 0xff, 0xff, 0xff],
    );
    assert_eq!(later.unwrap().1, Reply::Identity(identity_1()));
    // energy
    let spoilt = spoiled(Reply::Outcome(outcome()), 47, &nan);
    assert_eq!(spoilt, Err(WireError::Field));
    // no sample, and more samples than allowed
    for count in [0, 11] {
        let spoilt = spoiled(Reply::Telemetry(telemetry()), 24, &[count]);
        assert_eq!(spoilt, Err(WireError::Field));
    }
    assert_eq!(Reply::decode(&[2, 0x80, 0, 0]), Err(WireError::Version(2)));
    assert_eq!(
        Reply::decode(&[1, 0x05, 0, 0]),
        Err(WireError::UnknownType(5))
    );
    assert_eq!(Reply::decode(&[1, 2, 3]), Err(WireError::Header));
}

#[test]
fn a_name_is_cut_between_characters() {
    let name = Name::new("äöüßäöüßäöüßäöü€€");
    assert_eq!(name.as_bytes(), "äöüßäöüßäöüßäöü".as_bytes());
    assert_eq!(Name::new("").as_bytes(), b"");
    let long = Name::new(&"x".repeat(99));
    assert_eq!(long.as_bytes().len(), Name::LEN);
}

/// The device of `docs/wire.md`, chapter 15.
fn documented() -> Box<Handler<8, 0>> {
    let identity = identity();
    Box::new(Handler::new(Profile {
        firmware: identity.firmware,
        serial: identity.serial,
        flags: identity.flags,
        features: Features::default(),
        watchdog_ms: identity.watchdog_ms,
        longest_ms: identity.longest_ms,
        telemetry_hz: identity.telemetry_hz,
        bounds: Bounds {
            force_n: identity.force_n,
            velocity_mm_s: identity.velocity_mm_s,
            stiffness_n_per_mm: identity.stiffness_n_per_mm,
            damping_n_s_per_mm: identity.damping_n_s_per_mm,
            stroke_mm: identity.stroke_mm,
        },
        servo: ServoSettings::default(),
        rest_mm_s: 5.0,
        rest_s: 0.05,
    }))
}

/// Times, ms, sequence numbers and requests of the host in the exchange.
fn conversation() -> Vec<(u32, u16, Request)> {
    let beat = |count, deadline_ms| Request::Heartbeat(Heartbeat { count, deadline_ms });
    vec![
        (100, 1, Request::Limp),
        (
            102,
            2,
            Request::Hello(Hello {
                nonce: 0xC0FF_EE01,
                minor: 0,
            }),
        ),
        (104, 3, Request::Rearm),
        (106, 4, Request::TableBegin(begin())),
        (112, 5, chunk(0, 3)),
        (118, 6, chunk(3, 1)),
        (120, 0, beat(1, 160)),
        (121, 7, Request::TableCommit(Commit { crc: TABLE_CRC })),
        (130, 0, beat(2, 170)),
        (
            131,
            8,
            Request::Play(Play {
                playback: 7,
                crc: TABLE_CRC,
                longest_ms: 60_000,
                every: NonZeroU16::new(40),
            }),
        ),
        (140, 0, beat(3, 180)),
        (150, 0, beat(4, 190)),
        (160, 9, Request::Stop(Stop { playback: 7 })),
        // the reply was lost: the same request again
        (162, 9, Request::Stop(Stop { playback: 7 })),
        (164, 10, Request::State),
        // from now on the host is silent
        (185, 11, Request::State),
    ]
}

fn word(message: &str) -> String {
    let end = message.find(['(', ' ']).unwrap_or(message.len());
    message[..end].to_owned()
}

/// The exchange, one line per frame.
fn exchange() -> Vec<String> {
    let mut device = documented();
    let at_rest = Measured {
        motion: Motion {
            x_mm: 10.0,
            v_mm_s: 0.0,
            a_m_s2: 0.0,
        },
        force_n: None,
    };
    let mut lines = Vec::new();
    let mut requests = conversation();
    requests.reverse();
    for now_ms in 0..200 {
        let mut out = |bytes: &[u8], request: Option<&str>| {
            if let Some(request) = request {
                lines.push(format!("{now_ms:3} > {}  {request}", hex(bytes)));
                return;
            }
            let (_, reply) = Reply::decode(&body_of(bytes)).unwrap();
            let mut what = word(&format!("{reply:?}"));
            match reply {
                Reply::Ack(ack) => {
                    what = format!("Ack {:?} {:?}", ack.refusal, ack.state);
                }
                Reply::Event(event) => {
                    what = format!("Event {:?} {:?} {:?}", event.kind, event.state, event.fault);
                }
                _ => {}
            }
            lines.push(format!("{now_ms:3} < {}  {what}", hex(bytes)));
        };
        while requests.last().is_some_and(|(at, ..)| *at == now_ms) {
            let (_, sequence, request) = requests.pop().unwrap();
            let frame = request.frame(sequence);
            let what = word(&format!("{request:?}"));
            out(frame.as_bytes(), Some(&what));
            device.receive(frame.as_bytes(), now_ms, &mut |bytes| out(bytes, None));
        }
        for _ in 0..4 {
            device.servo(at_rest, now_ms, &mut |bytes| out(bytes, None));
        }
    }
    lines
}

#[test]
fn the_documented_exchange_is_that_of_the_handler() {
    let document = include_str!("../../docs/wire.md");
    let (_, rest) = document.split_once("```exchange\n").unwrap();
    let (written, _) = rest.split_once("```").unwrap();
    let said = exchange();
    assert_eq!(
        written.lines().collect::<Vec<_>>(),
        said,
        "docs/wire.md, chapter 15, should be:\n{}",
        said.join("\n")
    );
}

/// Every code of the program is in the specification with its number.
#[test]
fn the_specification_lists_every_code() {
    let document = include_str!("../../docs/wire.md");
    let listed = |heading: &str| {
        let (_, rest) = document.split_once(heading).unwrap();
        let end = rest.find("\n#").unwrap_or(rest.len());
        let rows = rest[..end].lines().filter_map(|line| {
            let cell = line.strip_prefix("| ")?.split(" |").next()?;
            cell.parse::<u8>().ok()
        });
        rows.collect::<Vec<_>>()
    };
    let refusals: Vec<u8> = Refusal::ALL.iter().map(|r| r.code()).collect();
    assert_eq!(listed("### Refusals\n"), refusals);
    let faults: Vec<u8> = Fault::ALL.iter().map(|f| f.code()).collect();
    assert_eq!(listed("### Faults\n"), faults);
    let states: Vec<u8> = DeviceState::ALL.iter().map(|s| s.code()).collect();
    assert_eq!(listed("## 5. States\n"), states);
    for golden in requests() {
        let name = golden.name.split(' ').next().unwrap();
        let entry = format!("**{name} 0x{:02X}**", golden.message.kind());
        assert!(document.contains(&entry), "{entry}");
    }
    for golden in replies() {
        let name = golden.name.split(' ').next().unwrap();
        let entry = format!("**{name} 0x{:02X}**", golden.message.kind());
        assert!(document.contains(&entry), "{entry}");
    }
}
