//! The simulated device in every state: requests, breakdowns and planted defects.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::num::NonZeroU16;
use std::time::Duration;

use crate::support::{Host, begin, detents, ms};
use study_device::firmware::{Flaw, Options};
use study_wire::message::{
    Commit, DeviceState, Fault, FixedVec, Hello, PathBegin, PathChunk, Play, Record, Refusal,
    Reply, Request, Stop, TableBegin, TableChunk,
};
use study_wire::predict::Direction;

/// Switches per second while a hand rests for ten seconds against a table whose branches
/// are `half_n` above and below zero.
fn held(direction: Direction, servo_hz: f64, half_n: f64) -> f64 {
    let mut options = Options {
        servo_hz,
        ..Options::default()
    };
    // one stroke, then an infinite rest
    options.hand.rest_s = [1e9, 1e9];
    let mut host = Host::opened(options);
    let mut nodes = detents(0.05, 0.0);
    for node in &mut nodes {
        node.positive[3] = half_n;
        node.negative[3] = -half_n;
    }
    let begin = TableBegin {
        direction,
        ..begin(&nodes)
    };
    let (ack, crc) = host.upload(begin, &nodes);
    assert_eq!(ack.refusal, Refusal::None, "{ack:?}");
    host.play(1, crc);
    host.live(ms(4000));
    let before = host.outcome();
    host.live(ms(10_000));
    let after = host.outcome();
    assert_eq!(after.state, DeviceState::Run);
    f64::from(after.switches - before.switches) / 10.0
}

/// The sign of v chatters at rest with any servo rate; a direction state does not. The
/// rate depends on the hand, the filter of the speed and the step between the branches;
/// another simulation found 140 switches per second.
#[test]
fn at_rest_the_sign_chatters_and_a_direction_state_does_not() {
    for servo_hz in [4000.0, 10_000.0] {
        for half_n in [0.5, 1.0, 4.0] {
            let sign = held(Direction::Sign, servo_hz, half_n);
            eprintln!("sign at {servo_hz} Hz, ±{half_n} N: {sign} switches/s");
            assert!((100.0..300.0).contains(&sign), "{sign}");
        }
        for direction in [
            Direction::Play { delta_mm: 0.5 },
            Direction::Dahl { delta_mm: 0.5 },
        ] {
            assert_eq!(held(direction, servo_hz, 1.0), 0.0, "{direction:?}");
        }
    }
}

/// Each planted defect is visible on the link.
#[test]
fn every_flaw_is_visible() {
    let flawed = |flaw| Options {
        flaw: Some(flaw),
        ..Options::default()
    };
    let playing = |flaw| Host::playing(flawed(flaw), ms(1000));

    let mut host = Host::opened(flawed(Flaw::TakesDamaged));
    let mut damaged = Request::State.frame(9).as_bytes().to_vec();
    damaged[6] ^= 0x10;
    assert!(matches!(host.send(&damaged), Some(Reply::Outcome(_))));

    let mut host = Host::new(flawed(Flaw::OtherVersion));
    let ack = host.ack(Request::Hello(Hello { nonce: 1, minor: 0 }));
    assert_eq!((ack.refusal, ack.detail), (Refusal::Version, 2));

    let mut host = playing(Flaw::DeafToLimp);
    assert_eq!(host.ack(Request::Limp).state, DeviceState::Limp);
    assert_eq!(host.device.state(), DeviceState::Run);

    let mut host = playing(Flaw::Repeats);
    let first = host.ask_as(5000, Request::Rearm).unwrap();
    host.live(ms(10));
    assert_ne!(host.ask_as(5000, Request::Rearm), Some(first));

    let mut host = playing(Flaw::Unlatched);
    host.wait(ms(100));
    assert_eq!(host.outcome().state, DeviceState::Idle);
    assert_eq!(host.device.state(), DeviceState::Limp);

    let mut host = playing(Flaw::TakesStale);
    let clock = host.clock_ms();
    assert!(host.beat_as(1_000_000, clock.wrapping_sub(500)).fresh);

    let mut host = playing(Flaw::LateWatchdog);
    host.beat();
    host.wait(ms(250));
    assert_eq!(host.device.state(), DeviceState::Run);
    let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 1, minor: 0 })) else {
        panic!();
    };
    assert_eq!(identity.watchdog_ms, 30);

    for (flaw, spoil) in [
        (Flaw::TakesBadTables, f64::NAN),
        (Flaw::TakesUncertified, -0.1),
    ] {
        let mut host = Host::opened(flawed(flaw));
        let mut nodes = detents(0.05, 0.02);
        nodes[3].positive[0] = spoil;
        assert_eq!(host.upload(begin(&nodes), &nodes).0.refusal, Refusal::None);
        assert_eq!(host.device.state(), DeviceState::Idle);
    }

    let most = |flaw| {
        let mut host = Host::playing(flawed(flaw), ms(3000));
        (host.outcome().peak_force_n, host)
    };
    let (plain, _) = most(Flaw::SlowStop);
    let (more, _) = most(Flaw::NoClamp);
    assert_eq!(more, 1.5 * plain);

    let (_, host) = most(Flaw::LosesTelemetry);
    let mut expected = 0;
    let gaps = host.heard.iter().filter(|reply| match reply {
        Reply::Telemetry(telemetry) => {
            let gap = telemetry.first != expected;
            expected = telemetry.first + telemetry.samples.as_slice().len() as u32;
            gap
        }
        _ => false,
    });
    assert!(gaps.count() > 20);

    let mut host = Host::new(flawed(Flaw::SlowReplies));
    let hello = Request::Hello(Hello { nonce: 1, minor: 0 });
    assert!(host.send(hello.frame(1).as_bytes()).is_none());
    host.wait(ms(49));
    assert_eq!(host.heard, []);
    host.wait(ms(2));
    assert!(matches!(host.heard[..], [Reply::Identity(_)]));

    let mut host = playing(Flaw::SlowStop);
    let stop = Request::Stop(Stop { playback: 7 });
    assert!(host.send(stop.frame(9000).as_bytes()).is_none());
    host.live(ms(190));
    assert_eq!(host.device.state(), DeviceState::Run);
    host.live(ms(20));
    assert_eq!(host.device.state(), DeviceState::Loaded);
}

/// A host that dies at any phase, with a slow link. In virtual time, so the result holds
/// for the device and does not depend on the computer.
#[test]
fn whenever_the_host_dies_the_force_is_zero_within_50_ms() {
    let mut worst = ms(0);
    for death in 0..200u64 {
        // a slow servo, to simulate many deaths in a short time
        let options = Options {
            servo_hz: 1000.0,
            ..Options::default()
        };
        let mut host = Host::playing(options, ms(450));
        // heartbeats arrive up to 9 ms after they were made, at any phase
        let late = death % 10;
        for _ in 0..death % 7 {
            let deadline = host.clock_ms() + 40;
            host.wait(ms(late));
            host.beat_as(1_000_000 + host.clock_ms(), deadline);
            host.wait(ms(10 - late));
        }
        let made = host.at;
        let deadline = host.clock_ms() + 40;
        host.wait(Duration::from_micros(1000 * late + 37 * death % 1000));
        host.beat_as(2_000_000, deadline);
        while host.device.state().applies_force() {
            host.wait(Duration::from_micros(250));
            assert!(host.at - made <= ms(50), "{death}");
        }
        assert_eq!(host.device.held_n(), 0.0);
        assert_eq!(host.device.fault(), Fault::Watchdog);
        worst = worst.max(host.at - made);
    }
    assert!(worst > ms(30) && worst <= ms(41), "{worst:?}");
}

fn in_state(state: DeviceState) -> Host {
    let loaded = || {
        let mut host = Host::opened(Options::default());
        let nodes = detents(0.05, 0.02);
        host.upload(begin(&nodes), &nodes);
        host
    };
    let mut host = match state {
        DeviceState::Boot => Host::new(Options::default()),
        DeviceState::Idle => Host::opened(Options::default()),
        DeviceState::Loaded => loaded(),
        DeviceState::Ramp => Host::playing(Options::default(), ms(200)),
        DeviceState::Run => Host::playing(Options::default(), ms(1000)),
        // no request can arrive between a stop and the end of its telemetry
        DeviceState::Stopping => unreachable!(),
        DeviceState::Limp => {
            let mut host = loaded();
            host.ask(Request::Limp);
            host
        }
        DeviceState::Fault => {
            let mut host = loaded();
            host.device.trip(Fault::External, host.at);
            host
        }
    };
    host.wait(ms(1));
    assert_eq!(host.device.state(), state);
    host
}

/// The table of states in the specification: every state, every request.
#[test]
fn every_request_in_every_state_has_the_specified_result() {
    use DeviceState::{Boot, Fault, Idle, Limp, Loaded, Ramp, Run};
    use Refusal::{NoHeartbeat, NoHello, None as Done, OtherPlayback, WrongState};

    let nodes = detents(0.05, 0.02);
    let begin = begin(&nodes);
    let mut crc = study_wire::message::UploadCrc::of_table(&begin);
    nodes.iter().for_each(|node| crc.node(node));
    let crc = crc.value();
    let path = PathBegin {
        points: 2,
        rate_hz: 1000.0,
        force_n: 1.0,
        velocity_mm_s: 1.0,
    };
    let chunk = Request::TableChunk(TableChunk {
        first: 0,
        nodes: FixedVec::of(&nodes[..3]),
    });
    let points = Request::PathChunk(PathChunk {
        first: 0,
        x_nm: FixedVec::of(&[0, 0]),
    });
    let play = Request::Play(Play {
        playback: 7,
        crc,
        longest_ms: 1000,
        every: NonZeroU16::new(4),
    });
    let stop = Request::Stop(Stop { playback: 7 });
    let hello = Request::Hello(Hello { nonce: 2, minor: 0 });
    let record = Request::Record(Record { playback: 7, crc });
    let states = [Boot, Idle, Loaded, Ramp, Run, Limp, Fault];
    let stay = |refusal| {
        states.map(|state| {
            if state == Boot {
                (NoHello, Boot)
            } else {
                (refusal, state)
            }
        })
    };
    let cases: [(Request, [(Refusal, DeviceState); 7]); 14] = [
        (
            Request::TableBegin(begin),
            [
                (NoHello, Boot),
                (Done, Idle),
                (Done, Idle),
                (WrongState, Ramp),
                (WrongState, Run),
                (WrongState, Limp),
                (WrongState, Fault),
            ],
        ),
        (
            Request::PathBegin(path),
            [
                (NoHello, Boot),
                (Done, Idle),
                (Done, Idle),
                (WrongState, Ramp),
                (WrongState, Run),
                (WrongState, Limp),
                (WrongState, Fault),
            ],
        ),
        (chunk, stay(WrongState)),
        (points, stay(WrongState)),
        (Request::TableCommit(Commit { crc }), stay(WrongState)),
        (Request::PathCommit(Commit { crc }), stay(WrongState)),
        (
            play,
            [
                (NoHello, Boot),
                (WrongState, Idle),
                (Done, Ramp),
                (WrongState, Ramp),
                (WrongState, Run),
                (WrongState, Limp),
                (WrongState, Fault),
            ],
        ),
        (
            record,
            [
                (NoHello, Boot),
                (WrongState, Idle),
                (Refusal::OtherTable, Loaded),
                (WrongState, Ramp),
                (WrongState, Run),
                (WrongState, Limp),
                (WrongState, Fault),
            ],
        ),
        (
            stop,
            [
                (NoHello, Boot),
                (OtherPlayback, Idle),
                (OtherPlayback, Loaded),
                (Done, DeviceState::Stopping),
                (Done, DeviceState::Stopping),
                (OtherPlayback, Limp),
                (OtherPlayback, Fault),
            ],
        ),
        (
            Request::Limp,
            [Boot, Idle, Loaded, Ramp, Run, Limp, Fault]
                .map(|s| (Done, if s == Fault { Fault } else { Limp })),
        ),
        (
            Request::Rearm,
            [
                (NoHello, Boot),
                (Done, Idle),
                (Done, Loaded),
                (Done, Ramp),
                (Done, Run),
                (Done, Idle),
                (Done, Idle),
            ],
        ),
        (
            hello,
            [Idle, Idle, Limp, Limp, Limp, Limp, Fault].map(|s| (Done, s)),
        ),
        (Request::State, states.map(|s| (Done, s))),
        (
            Request::Heartbeat(study_wire::message::Heartbeat {
                count: 1_000_000,
                deadline_ms: 0,
            }),
            states.map(|s| (Done, s)),
        ),
    ];
    for (request, expected) in cases {
        for (state, (refusal, after)) in states.into_iter().zip(expected) {
            let mut host = in_state(state);
            let context = format!("{} in {state:?}", request.kind());
            match host.ask(request) {
                Reply::Ack(ack) => {
                    assert_eq!((ack.refusal, ack.state), (refusal, after), "{context}")
                }
                Reply::Identity(identity) => assert_eq!(identity.state, after, "{context}"),
                Reply::Outcome(outcome) => assert_eq!(outcome.state, after, "{context}"),
                Reply::Pulse(pulse) => assert_eq!(pulse.state, after, "{context}"),
                other => panic!("{other:?}"),
            }
            if !after.applies_force() {
                assert_eq!(host.device.held_n(), 0.0, "{context}");
            }
        }
    }
    // PLAY from a host that was silent for longer than the watchdog time
    let mut host = in_state(Loaded);
    host.wait(ms(100));
    let Reply::Ack(ack) = host.ask(play) else {
        panic!();
    };
    assert_eq!((ack.refusal, ack.state), (WrongState, Limp));
    let mut host = Host::opened(Options::default());
    host.upload(begin, &nodes[..31]);
    host.ask(Request::TableChunk(TableChunk {
        first: 30,
        nodes: FixedVec::of(&nodes[30..]),
    }));
    host.wait(ms(50));
    let ack = host.ack(Request::TableCommit(Commit { crc }));
    assert_eq!((ack.refusal, ack.detail), (Refusal::Incomplete, 31));
    host.ask(Request::TableChunk(TableChunk {
        first: 31,
        nodes: FixedVec::of(&nodes[31..]),
    }));
    assert_eq!(
        host.ack(Request::TableCommit(Commit { crc })).refusal,
        NoHeartbeat
    );
    host.beat();
    assert_eq!(host.ack(Request::TableCommit(Commit { crc })).refusal, Done);
}

/// In each state: a reset, a processor that hangs, an unplugged cable, noise.
#[test]
fn every_state_ends_without_force_when_something_breaks() {
    for state in [
        DeviceState::Boot,
        DeviceState::Idle,
        DeviceState::Loaded,
        DeviceState::Ramp,
        DeviceState::Run,
        DeviceState::Limp,
        DeviceState::Fault,
    ] {
        let mut host = in_state(state);
        host.device.reset(host.at);
        assert_eq!(host.device.held_n(), 0.0, "{state:?}");
        assert_eq!(host.device.state(), DeviceState::Boot, "{state:?}");

        let mut host = in_state(state);
        host.device.stall(host.at, ms(60_000));
        host.wait(ms(11));
        assert_eq!(host.device.held_n(), 0.0, "{state:?}");
        assert_eq!(host.device.state(), DeviceState::Boot, "{state:?}");

        // unplugged: no more bytes arrive
        let mut host = in_state(state);
        host.wait(ms(41));
        assert_eq!(host.device.held_n(), 0.0, "{state:?}");
        let expected = if state.armed() {
            DeviceState::Limp
        } else {
            state
        };
        assert_eq!(host.device.state(), expected, "{state:?}");

        // noise: nothing is executed, and the next frame is received
        let mut host = in_state(state);
        let noise: Vec<u8> = (0..2000u32).map(|i| ((i * i) >> 3) as u8).collect();
        assert_eq!(host.send(&noise), None, "{state:?}");
        assert_eq!(host.device.state(), state);
        assert!(host.send(Request::State.frame(3).as_bytes()).is_some());
    }

    // in the middle of an upload
    let mut host = Host::opened(Options::default());
    let nodes = detents(0.05, 0.02);
    host.ask(Request::TableBegin(begin(&nodes)));
    host.device.reset(host.at);
    let chunk = Request::TableChunk(TableChunk {
        first: 0,
        nodes: FixedVec::of(&nodes[..3]),
    });
    assert_eq!(host.ack(chunk).refusal, Refusal::NoHello);
}
