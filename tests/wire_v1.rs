//! Version 1 of the wire format, byte by byte.
//!
//! The bytes below were written by another implementation than the one that they
//! test: Python's `struct` and `zlib.crc32`, from the tables of `docs/wire.md`. They
//! never change: what would change them is version 2.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use study::device::core::Settings;
use study::device::frame::{Decoder, crc32};
use study::device::handler::{Bounds, Handler, Measured, Profile};
use study::device::wire::probe::PathCrc;
use study::device::wire::{
    Ack, Commit, Event, Fault, Few, Flags, Happening, Heartbeat, Hello, Identity, Loaded, Name,
    Node, Outcome, PathBegin, PathChunk, Play, Pulse, Record, Recorded, RecordedPoint, Refusal,
    Reply, Request, State, Stop, TableBegin, TableChunk, TableCrc, Telemetry, TelemetrySample,
    WireError, fixed, kind,
};
use study::model::predict::{Direction, Lookup, Motion};

/// Of the four nodes of [`chunk`] under [`begin`].
const TABLE_CRC: u32 = 0xDDE60A90;
/// Of the three points below.
const PATH_CRC: u32 = 0xD46CF557;

struct Golden<M> {
    name: &'static str,
    sequence: u16,
    message: M,
    /// Bytes of each field and what they say, in order: together the body.
    body: &'static [(&'static str, &'static str)],
    /// Of the body, as it follows it.
    crc: &'static str,
    /// What goes over the wire.
    frame: &'static str,
}

fn requests() -> Vec<Golden<Request>> {
    vec![
        Golden {
            name: "HELLO",
            sequence: 0,
            message: Request::Hello(Hello { nonce: 0xC0FF_EE01 }),
            body: &[
                ("01", "version"),
                ("01", "type HELLO"),
                ("0000", "sequence number 0"),
                ("01eeffc0", "nonce"),
            ],
            crc: "4e717f1c",
            frame: "00030101010901eeffc04e717f1c00",
        },
        Golden {
            name: "TABLE_BEGIN",
            sequence: 1,
            message: Request::TableBegin(begin()),
            body: &[
                ("01", "version"),
                ("02", "type TABLE_BEGIN"),
                ("0100", "sequence number 1"),
                ("0400", "nodes: 4"),
                ("00", "lookup: linear"),
                ("01", "direction rule: play"),
                ("00", "armed: no"),
                ("000000000000e03f", "delta 0.5 mm"),
                ("000000000000f83f", "range from 1.5 mm"),
                ("0000000000c04040", "range to 33.5 mm"),
                ("0000000000406140", "trained to 138 mm/s"),
                ("0000000000002840", "force limit 12 N"),
                ("0000000000408f40", "velocity limit 1000 mm/s"),
                ("0000000000000000", "uncertified force: none"),
            ],
            crc: "74352c3b",
            frame: "0004010201020401020101010101010103e03f010101010103f83f0101010104c04040010101010440614001010101010328400101010104408f40010101010101010574352c3b00",
        },
        Golden {
            name: "TABLE_BEGIN armed",
            sequence: 1,
            message: Request::TableBegin(TableBegin {
                nodes: 2,
                lookup: Lookup::Floor,
                direction: Direction::Sign,
                range_mm: [0.0, 30.0],
                trained_mm_s: 100.0,
                force_n: 12.0,
                velocity_mm_s: 1000.0,
                uncertified_n: Some(9.0),
            }),
            body: &[
                ("01", "version"),
                ("02", "type TABLE_BEGIN"),
                ("0100", "sequence number 1"),
                ("0200", "nodes: 2"),
                ("01", "lookup: floor"),
                ("00", "direction rule: sign"),
                ("01", "armed: yes"),
                ("0000000000000000", "no delta"),
                ("0000000000000000", "range from 0 mm"),
                ("0000000000003e40", "range to 30 mm"),
                ("0000000000005940", "trained to 100 mm/s"),
                ("0000000000002840", "force limit 12 N"),
                ("0000000000408f40", "velocity limit 1000 mm/s"),
                ("0000000000002240", "uncertified force 9 N"),
            ],
            crc: "b28ef3a7",
            frame: "0004010201020202010201010101010101010101010101010101010101010101033e40010101010103594001010101010328400101010104408f400101010101072240b28ef3a700",
        },
        Golden {
            name: "TABLE_CHUNK of three",
            sequence: 2,
            message: chunk(0, 3),
            body: &[
                ("01", "version"),
                ("03", "type TABLE_CHUNK"),
                ("0200", "sequence number 2"),
                ("0000", "first node: 0"),
                ("03", "nodes here: 3"),
                ("0000000000001440", "node 0: x 5 mm"),
                ("9a9999999999a93f", "m+ 0.05 kg"),
                ("7b14ae47e17a843f", "b+ 0.01 N s/mm"),
                ("0000000000000000", "k+ 0 N/mm"),
                ("000000000000f03f", "F0+ 1 N"),
                ("9a9999999999a93f", "m- 0.05 kg"),
                ("7b14ae47e17a843f", "b- 0.01 N s/mm"),
                ("0000000000000000", "k- 0 N/mm"),
                ("000000000000f0bf", "F0- -1 N"),
                ("0000000000002440", "node 1: x 10 mm"),
                ("9a9999999999a93f", "m+ 0.05 kg"),
                ("7b14ae47e17a843f", "b+ 0.01 N s/mm"),
                ("000000000000d03f", "k+ 0.25 N/mm"),
                ("000000000000f8bf", "F0+ -1.5 N"),
                ("9a9999999999a93f", "m- 0.05 kg"),
                ("7b14ae47e17a843f", "b- 0.01 N s/mm"),
                ("000000000000d03f", "k- 0.25 N/mm"),
                ("0000000000000cc0", "F0- -3.5 N"),
                ("0000000000003440", "node 2: x 20 mm"),
                ("9a9999999999a93f", "m+ 0.05 kg"),
                ("7b14ae47e17a843f", "b+ 0.01 N s/mm"),
                ("000000000000e0bf", "k+ -0.5 N/mm"),
                ("0000000000002640", "F0+ 11 N"),
                ("9a9999999999a93f", "m- 0.05 kg"),
                ("7b14ae47e17a843f", "b- 0.01 N s/mm"),
                ("000000000000e0bf", "k- -0.5 N/mm"),
                ("0000000000002240", "F0- 9 N"),
            ],
            crc: "c77954e2",
            frame: "00040103020101020301010101011314409a9999999999a93f7b14ae47e17a843f0101010101010101010101010113f03f9a9999999999a93f7b14ae47e17a843f0101010101010101010101010103f0bf01010101011324409a9999999999a93f7b14ae47e17a843f010101010103d03f010101010113f8bf9a9999999999a93f7b14ae47e17a843f010101010103d03f0101010101030cc001010101011334409a9999999999a93f7b14ae47e17a843f010101010103e0bf01010101011326409a9999999999a93f7b14ae47e17a843f010101010103e0bf0101010101072240c77954e200",
        },
        Golden {
            name: "TABLE_CHUNK of one",
            sequence: 3,
            message: chunk(3, 1),
            body: &[
                ("01", "version"),
                ("03", "type TABLE_CHUNK"),
                ("0300", "sequence number 3"),
                ("0300", "first node: 3"),
                ("01", "nodes here: 1"),
                ("0000000000003e40", "node 3: x 30 mm"),
                ("9a9999999999a93f", "m+ 0.05 kg"),
                ("7b14ae47e17a843f", "b+ 0.01 N s/mm"),
                ("0000000000000000", "k+ 0 N/mm"),
                ("000000000000f03f", "F0+ 1 N"),
                ("9a9999999999a93f", "m- 0.05 kg"),
                ("7b14ae47e17a843f", "b- 0.01 N s/mm"),
                ("0000000000000000", "k- 0 N/mm"),
                ("000000000000f0bf", "F0- -1 N"),
            ],
            crc: "2467ccef",
            frame: "0004010303020302010101010101133e409a9999999999a93f7b14ae47e17a843f0101010101010101010101010113f03f9a9999999999a93f7b14ae47e17a843f0101010101010101010101010107f0bf2467ccef00",
        },
        Golden {
            name: "TABLE_COMMIT",
            sequence: 4,
            message: Request::TableCommit(Commit { crc: TABLE_CRC }),
            body: &[
                ("01", "version"),
                ("04", "type TABLE_COMMIT"),
                ("0400", "sequence number 4"),
                ("900ae6dd", "CRC of TABLE_BEGIN's fields and the four nodes"),
            ],
            crc: "8327c786",
            frame: "000401040409900ae6dd8327c78600",
        },
        Golden {
            name: "PLAY",
            sequence: 5,
            message: Request::Play(Play {
                playback: 7,
                crc: TABLE_CRC,
                longest_ms: 60_000,
                every: 4,
            }),
            body: &[
                ("01", "version"),
                ("05", "type PLAY"),
                ("0500", "sequence number 5"),
                ("07000000", "playback 7"),
                ("900ae6dd", "CRC of the table"),
                ("60ea0000", "longest duration 60 s"),
                ("0400", "a sample every 4 servo periods"),
            ],
            crc: "c2bba1b6",
            frame: "00040105050207010107900ae6dd60ea01020405c2bba1b600",
        },
        Golden {
            name: "STOP",
            sequence: 6,
            message: Request::Stop(Stop { playback: 7 }),
            body: &[
                ("01", "version"),
                ("06", "type STOP"),
                ("0600", "sequence number 6"),
                ("07000000", "playback 7"),
            ],
            crc: "6931d681",
            frame: "000401060602070101056931d68100",
        },
        Golden {
            name: "LIMP",
            sequence: 65535,
            message: Request::Limp,
            body: &[
                ("01", "version"),
                ("07", "type LIMP"),
                ("ffff", "sequence number 65535"),
            ],
            crc: "03bc9122",
            frame: "00090107ffff03bc912200",
        },
        Golden {
            name: "HEARTBEAT",
            sequence: 0,
            message: Request::Heartbeat(Heartbeat {
                count: 258,
                deadline_ms: 4_294_967_290,
            }),
            body: &[
                ("01", "version"),
                ("08", "type HEARTBEAT"),
                ("0000", "sequence number 0"),
                ("02010000", "count 258"),
                ("faffffff", "deadline 4294967290 ms"),
            ],
            crc: "5db78457",
            frame: "00030108010302010109faffffff5db7845700",
        },
        Golden {
            name: "REARM",
            sequence: 7,
            message: Request::Rearm,
            body: &[
                ("01", "version"),
                ("09", "type REARM"),
                ("0700", "sequence number 7"),
            ],
            crc: "311568d9",
            frame: "000401090705311568d900",
        },
        Golden {
            name: "STATE",
            sequence: 8,
            message: Request::State,
            body: &[
                ("01", "version"),
                ("0a", "type STATE"),
                ("0800", "sequence number 8"),
            ],
            crc: "a7b7b65c",
            frame: "0004010a0805a7b7b65c00",
        },
        Golden {
            name: "PATH_BEGIN",
            sequence: 9,
            message: Request::PathBegin(PathBegin {
                points: 3,
                rate_hz: 1000.0,
                force_n: 20.0,
                velocity_mm_s: 500.0,
            }),
            body: &[
                ("01", "version"),
                ("10", "type PATH_BEGIN"),
                ("0900", "sequence number 9"),
                ("03000000", "points: 3"),
                ("0000000000408f40", "1000 points a second"),
                ("0000000000003440", "force limit 20 N"),
                ("0000000000407f40", "velocity limit 500 mm/s"),
            ],
            crc: "20645759",
            frame: "000401100902030101010101010104408f4001010101010334400101010108407f402064575900",
        },
        Golden {
            name: "PATH_CHUNK",
            sequence: 10,
            message: Request::PathChunk(PathChunk {
                first: 0,
                x_nm: Few::of(&[17_500_000, 17_500_250, -1]),
            }),
            body: &[
                ("01", "version"),
                ("11", "type PATH_CHUNK"),
                ("0a00", "sequence number 10"),
                ("00000000", "first point: 0"),
                ("03", "points here: 3"),
                ("60070b01", "17.5 mm"),
                ("5a080b01", "17.50025 mm"),
                ("ffffffff", "-1 nm"),
            ],
            crc: "0a6f470b",
            frame: "000401110a01010101120360070b015a080b01ffffffff0a6f470b00",
        },
        Golden {
            name: "PATH_COMMIT",
            sequence: 11,
            message: Request::PathCommit(Commit { crc: PATH_CRC }),
            body: &[
                ("01", "version"),
                ("12", "type PATH_COMMIT"),
                ("0b00", "sequence number 11"),
                (
                    "57f56cd4",
                    "CRC of PATH_BEGIN's fields and the three points",
                ),
            ],
            crc: "95162d9e",
            frame: "000401120b0957f56cd495162d9e00",
        },
        Golden {
            name: "RECORD",
            sequence: 12,
            message: Request::Record(Record {
                playback: 8,
                crc: PATH_CRC,
            }),
            body: &[
                ("01", "version"),
                ("13", "type RECORD"),
                ("0c00", "sequence number 12"),
                ("08000000", "recording 8"),
                ("57f56cd4", "CRC of the path"),
            ],
            crc: "b7679eb3",
            frame: "000401130c020801010957f56cd4b7679eb300",
        },
    ]
}

fn replies() -> Vec<Golden<Reply>> {
    vec![
        Golden {
            name: "ACK",
            sequence: 5,
            message: Reply::Ack(Ack {
                request: kind::PLAY,
                refusal: Refusal::None,
                state: State::Ramp,
                fault: Fault::None,
                clock_ms: 123_456,
                detail: 0,
            }),
            body: &[
                ("01", "version"),
                ("80", "type ACK"),
                ("0500", "sequence number 5"),
                ("05", "to PLAY"),
                ("00", "refusal: none"),
                ("03", "state: ramp"),
                ("00", "fault: none"),
                ("40e20100", "clock 123456 ms"),
                ("00000000", "detail 0"),
            ],
            crc: "772e9d8d",
            frame: "0004018005020502030440e2010101010105772e9d8d00",
        },
        Golden {
            name: "ACK that refuses",
            sequence: 4,
            message: Reply::Ack(Ack {
                request: kind::TABLE_COMMIT,
                refusal: Refusal::Uncertified,
                state: State::Idle,
                fault: Fault::None,
                clock_ms: 1,
                detail: 1,
            }),
            body: &[
                ("01", "version"),
                ("80", "type ACK"),
                ("0400", "sequence number 4"),
                ("04", "to TABLE_COMMIT"),
                ("0c", "refusal: uncertified"),
                ("01", "state: idle"),
                ("00", "fault: none"),
                ("01000000", "clock 1 ms"),
                ("01000000", "detail: mass"),
            ],
            crc: "19003087",
            frame: "000401800404040c010201010102010101021903308700",
        },
        Golden {
            name: "IDENTITY",
            sequence: 0,
            message: Reply::Identity(identity()),
            body: &[
                ("01", "version"),
                ("81", "type IDENTITY"),
                ("0000", "sequence number 0"),
                ("01eeffc0", "nonce of HELLO"),
                ("01", "oldest version spoken"),
                ("01", "newest version spoken"),
                ("01", "state: idle"),
                ("00", "fault: none"),
                ("06", "flags: simulated, telemetry"),
                ("0c000000", "clock 12 ms"),
                ("1e00", "watchdog 30 ms"),
                ("0002", "most nodes 512"),
                ("00000000", "most points of a path: no probe"),
                ("c0270900", "longest playback 10 min"),
                ("000000000040af40", "servo 4000 Hz"),
                ("0000000000408f40", "telemetry 1000 Hz"),
                ("0000000000002e40", "force 15 N"),
                ("0000000000408f40", "velocity 1000 mm/s"),
                ("0000000000003440", "stiffness 20 N/mm"),
                ("9a9999999999b93f", "damping 0.1 N s/mm"),
                ("00000000000014c0", "stroke from -5 mm"),
                ("0000000000004440", "stroke to 40 mm"),
                (
                    "6578616d706c6520312e30000000000000000000000000000000000000000000",
                    "firmware: example 1.0",
                ),
                (
                    "412d303030310000000000000000000000000000000000000000000000000000",
                    "serial: A-0001",
                ),
            ],
            crc: "ef7e1ad3",
            frame: "00030181010801eeffc001010103060c0101021e01020201010104c0270901010101010440af400101010104408f400101010101032e400101010104408f4001010101010b34409a9999999999b93f01010101010314c001010101010e44406578616d706c6520312e30010101010101010101010101010101010101010107412d303030310101010101010101010101010101010101010101010101010105ef7e1ad300",
        },
        Golden {
            name: "OUTCOME",
            sequence: 8,
            message: Reply::Outcome(outcome()),
            body: &[
                ("01", "version"),
                ("82", "type OUTCOME"),
                ("0800", "sequence number 8"),
                ("02", "state: loaded"),
                ("00", "fault: none"),
                ("01", "loaded: a table"),
                ("204e0000", "clock 20000 ms"),
                ("900ae6dd", "CRC of the table"),
                ("07000000", "playback 7"),
                ("80bb0000", "48000 servo periods"),
                ("e02e0000", "12000 samples"),
                ("0b000000", "11 full strokes"),
                ("5f000000", "95 switches"),
                ("02000000", "2 clamps"),
                ("1f000000", "31 periods slewed"),
                ("00000000", "mass never held"),
                ("000000000000e83f", "energy 0.75 J"),
                ("000000000000b0bf", "least energy -0.0625 J"),
                ("0000000000002840", "largest force 12 N"),
                ("000000000000c03f", "0.125 N^2 above 20 Hz"),
                ("0000000000002840", "limit 12 N"),
                ("01000000", "1 bad frame"),
                ("00000000", "0 stale heartbeats"),
            ],
            crc: "f80489ec",
            frame: "000401820802020401204e0106900ae6dd0701010380bb0103e02e01020b0101025f010102020101021f01010101010101010101010103e83f010101010103b0bf0101010101032840010101010103c03f01010101010428400101010101010105f80489ec00",
        },
        Golden {
            name: "PULSE",
            sequence: 0,
            message: Reply::Pulse(Pulse {
                count: 258,
                fresh: true,
                state: State::Run,
                fault: Fault::None,
                clock_ms: 4_294_967_260,
            }),
            body: &[
                ("01", "version"),
                ("83", "type PULSE"),
                ("0000", "sequence number 0"),
                ("02010000", "to heartbeat 258"),
                ("01", "fresh"),
                ("04", "state: run"),
                ("00", "fault: none"),
                ("dcffffff", "clock 4294967260 ms"),
            ],
            crc: "58a94e77",
            frame: "00030183010302010103010409dcffffff58a94e7700",
        },
        Golden {
            name: "TELEMETRY",
            sequence: 3,
            message: Reply::Telemetry(telemetry()),
            body: &[
                ("01", "version"),
                ("90", "type TELEMETRY"),
                ("0300", "sequence number 3"),
                ("07000000", "playback 7"),
                ("14000000", "20 samples came before"),
                ("5be20100", "clock 123483 ms"),
                ("01000000", "1 full stroke"),
                ("00000000", "0 clamps"),
                ("02", "samples here: 2"),
                ("50000000", "tick 80"),
                ("08870601", "17.205 mm"),
                ("4c29feff", "-120.5 mm/s"),
                ("30edecff", "commanded -1.25 N"),
                ("80b0edff", "measured -1.2 N"),
                ("54000000", "tick 84"),
                ("48b20401", "17.085 mm"),
                ("402bfeff", "-120 mm/s"),
                ("e029ecff", "commanded -1.3 N"),
                ("00000080", "measured: no sensor"),
            ],
            crc: "a4e00b0d",
            frame: "00040190030207010102140101045be2010201010101010101030250010112088706014c29feff30edecff80b0edff5401010d48b20401402bfeffe029ecff01010680a4e00b0d00",
        },
        Golden {
            name: "EVENT",
            sequence: 4,
            message: Reply::Event(Event {
                what: Happening::Latched,
                state: State::Fault,
                fault: Fault::Velocity,
                playback: 7,
                tick: 48_000,
                clock_ms: 135_456,
            }),
            body: &[
                ("01", "version"),
                ("91", "type EVENT"),
                ("0400", "sequence number 4"),
                ("03", "what: latched"),
                ("07", "state: fault"),
                ("04", "fault: velocity"),
                ("07000000", "playback 7"),
                ("80bb0000", "after 48000 servo periods"),
                ("20110200", "clock 135456 ms"),
            ],
            crc: "5bbb402f",
            frame: "0004019104050307040701010380bb0104201102055bbb402f00",
        },
        Golden {
            name: "RECORDED",
            sequence: 5,
            message: Reply::Recorded(Recorded {
                playback: 8,
                first: 0,
                clock_ms: 200_000,
                points: Few::of(&[RecordedPoint {
                    x_nm: 17_500_000,
                    force_un: 850_000,
                    a_um_s2: -9_810_000,
                }]),
            }),
            body: &[
                ("01", "version"),
                ("92", "type RECORDED"),
                ("0500", "sequence number 5"),
                ("08000000", "recording 8"),
                ("00000000", "first sample 0"),
                ("400d0300", "clock 200000 ms"),
                ("01", "samples here: 1"),
                ("60070b01", "17.5 mm"),
                ("50f80c00", "0.85 N"),
                ("b04f6aff", "-9.81 m/s^2"),
            ],
            crc: "71f79b5e",
            frame: "0004019205020801010101010104400d03090160070b0150f80c09b04f6aff71f79b5e00",
        },
    ]
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
        nodes: Few::of(&nodes()[from..from + count]),
    })
}

fn identity() -> Identity {
    Identity {
        nonce: 0xC0FF_EE01,
        versions: [1, 1],
        state: State::Idle,
        fault: Fault::None,
        flags: Flags {
            simulated: true,
            telemetry: true,
            ..Flags::default()
        },
        clock_ms: 12,
        watchdog_ms: 30,
        most_nodes: 512,
        most_points: 0,
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
    }
}

fn outcome() -> Outcome {
    Outcome {
        state: State::Loaded,
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
        most_force_n: 12.0,
        rough_n2: 0.125,
        limit_n: 12.0,
        bad_frames: 1,
        stale_beats: 0,
    }
}

fn telemetry() -> Telemetry {
    let sample = |tick, x_mm, v_mm_s, command_n, measured_n| TelemetrySample {
        tick,
        x_nm: fixed::nm(x_mm),
        v_um_s: fixed::um_s(v_mm_s),
        command_un: fixed::un(command_n),
        measured_un: fixed::maybe_un(measured_n),
    };
    Telemetry {
        playback: 7,
        first: 20,
        clock_ms: 123_483,
        strokes: 1,
        clamps: 0,
        samples: Few::of(&[
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

#[test]
fn every_request_is_the_bytes_of_the_document() {
    let mut kinds = Vec::new();
    for golden in requests() {
        let frame = golden.message.frame(golden.sequence);
        assert_eq!(hex(frame.as_bytes()), golden.frame, "{}", golden.name);
        let body = body_of(frame.as_bytes());
        assert_eq!(body, joined(&golden), "{}", golden.name);
        assert_eq!(
            hex(&crc32(&body).to_le_bytes()),
            golden.crc,
            "{}",
            golden.name
        );
        let (header, message) = Request::decode(&body).unwrap();
        assert_eq!(message, golden.message, "{}", golden.name);
        assert_eq!(header.sequence, golden.sequence);
        assert_eq!(header.kind, golden.message.kind());
        kinds.push(header.kind);
    }
    kinds.dedup();
    let all = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0x10, 0x11, 0x12, 0x13];
    assert_eq!(kinds, all, "a message is not in the list");
}

#[test]
fn every_reply_is_the_bytes_of_the_document() {
    let mut kinds = Vec::new();
    for golden in replies() {
        let frame = golden.message.frame(golden.sequence);
        assert_eq!(hex(frame.as_bytes()), golden.frame, "{}", golden.name);
        let body = body_of(frame.as_bytes());
        assert_eq!(body, joined(&golden), "{}", golden.name);
        assert_eq!(
            hex(&crc32(&body).to_le_bytes()),
            golden.crc,
            "{}",
            golden.name
        );
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
fn the_crc_over_a_whole_is_that_of_its_fields_in_a_row() {
    let mut crc = TableCrc::of(&begin());
    nodes().iter().for_each(|node| crc.node(node));
    assert_eq!(crc.value(), TABLE_CRC);
    let mut crc = PathCrc::of(&PathBegin {
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
    for golden in requests() {
        let body = joined(&golden);
        for cut in 4..body.len() {
            assert!(
                Request::decode(&body[..cut]).is_err(),
                "{} {cut}",
                golden.name
            );
        }
        let longer = [&body[..], &[0]].concat();
        assert_eq!(Request::decode(&longer).unwrap_err(), WireError::Length);
    }
    for golden in replies() {
        let body = joined(&golden);
        for cut in 4..body.len() {
            assert!(
                Reply::decode(&body[..cut]).is_err(),
                "{} {cut}",
                golden.name
            );
        }
        let longer = [&body[..], &[0]].concat();
        assert_eq!(Reply::decode(&longer).unwrap_err(), WireError::Length);
    }
}

#[test]
fn what_a_device_may_not_say_is_no_message() {
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
    // energy
    let spoilt = spoiled(Reply::Outcome(outcome()), 47, &nan);
    assert_eq!(spoilt, Err(WireError::Field));
    // no sample, more samples than there can be
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
        servo: Settings::default(),
        rest_mm_s: 5.0,
        rest_s: 0.05,
    }))
}

/// What the host of the exchange sends, and at what time, ms.
fn conversation() -> Vec<(u32, u16, Request)> {
    let beat = |count, deadline_ms| Request::Heartbeat(Heartbeat { count, deadline_ms });
    vec![
        (100, 1, Request::Limp),
        (102, 2, Request::Hello(Hello { nonce: 0xC0FF_EE01 })),
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
                every: 40,
            }),
        ),
        (140, 0, beat(3, 180)),
        (150, 0, beat(4, 190)),
        (160, 9, Request::Stop(Stop { playback: 7 })),
        // the reply was lost: the same again
        (162, 9, Request::Stop(Stop { playback: 7 })),
        (164, 10, Request::State),
        // and then nothing more is heard of the host
        (185, 11, Request::State),
    ]
}

fn word(message: &str) -> String {
    let end = message.find(['(', ' ']).unwrap_or(message.len());
    message[..end].to_owned()
}

/// What goes over the wire, a line each.
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
                    what = format!("Event {:?} {:?} {:?}", event.what, event.state, event.fault);
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
fn the_exchange_of_the_document_is_what_a_device_says() {
    let document = include_str!("../docs/wire.md");
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

/// Every code of the program stands in the document with its number.
#[test]
fn the_document_lists_every_code() {
    let document = include_str!("../docs/wire.md");
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
    let states: Vec<u8> = State::ALL.iter().map(|s| s.code()).collect();
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
