//! The simulated device on its link: states, watchdog, uploads.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{Host, begin, detents, ms};
use std::num::NonZeroU16;
use study_device::firmware::Options;
use study_wire::message::{
    Commit, DeviceState, Event, EventKind, Fault, FixedVec, Hello, Loaded, Node, Play, Refusal,
    Reply, Request, Stop, TableBegin, TableChunk, TelemetrySample, fixed,
};
use study_wire::predict::{Direction, Lookup};

fn events(host: &Host) -> Vec<Event> {
    let event = |reply: &Reply| match reply {
        Reply::Event(event) => Some(*event),
        _ => None,
    };
    host.heard.iter().filter_map(event).collect()
}

fn samples(host: &Host) -> Vec<TelemetrySample> {
    let mut samples = Vec::new();
    for reply in &host.heard {
        if let Reply::Telemetry(telemetry) = reply {
            assert_eq!(telemetry.first as usize, samples.len());
            samples.extend_from_slice(telemetry.samples.as_slice());
        }
    }
    samples
}

#[test]
fn a_session_from_power_up_to_an_outcome() {
    let mut host = Host::new(Options::default());
    assert_eq!(host.device.state(), DeviceState::Boot);
    assert_eq!(host.ack(Request::Rearm).refusal, Refusal::NoHello);
    host.open(1);
    let nodes = detents(0.05, 0.02);
    let (ack, crc) = host.upload(begin(&nodes), &nodes);
    assert_eq!(
        (ack.refusal, ack.state),
        (Refusal::None, DeviceState::Loaded)
    );
    let ack = host.play(7, crc);
    assert_eq!((ack.refusal, ack.state), (Refusal::None, DeviceState::Ramp));
    host.live(ms(399));
    assert_eq!(host.device.state(), DeviceState::Ramp);
    host.live(ms(11_601));
    assert_eq!(host.device.state(), DeviceState::Run);
    let ack = host.stop(7);
    assert_eq!(
        (ack.refusal, ack.state),
        (Refusal::None, DeviceState::Stopping)
    );
    assert_eq!(host.device.held_n(), 0.0);
    host.wait(ms(1));
    assert_eq!(host.device.state(), DeviceState::Loaded);
    let outcome = host.outcome();
    assert_eq!(outcome.fault, Fault::None);
    assert_eq!(outcome.loaded, Loaded::Table);
    assert_eq!((outcome.playback, outcome.crc), (7, crc));
    assert_eq!(outcome.ticks, 48_000);
    assert_eq!(outcome.samples, 12_000);
    assert!(outcome.strokes > 4, "{outcome:?}");
    assert!(outcome.energy_j > 0.1, "{outcome:?}");
    assert!(outcome.peak_force_n > 3.0 && outcome.peak_force_n <= 12.0);
    assert!(outcome.rough_n2 > 0.0);
    assert_eq!(outcome.limit_n, 12.0);
    assert_eq!(outcome.bad_frames, 0);

    let samples = samples(&host);
    assert_eq!(samples.len(), 12_000);
    assert!(
        samples
            .iter()
            .enumerate()
            .all(|(i, s)| s.tick as usize == 4 * i)
    );
    let happened: Vec<_> = events(&host)
        .iter()
        .map(|event| (event.kind, event.state, event.tick))
        .collect();
    assert_eq!(
        happened,
        [
            (EventKind::Latched, DeviceState::Limp, 0),
            (EventKind::Started, DeviceState::Ramp, 0),
            (EventKind::Stopped, DeviceState::Loaded, 48_000),
        ]
    );
}

/// The host falls silent at any phase after the last heartbeat.
#[test]
fn without_a_heartbeat_the_force_is_zero_after_the_watchdog_time() {
    for clock_ms in [0, u32::MAX - 1020] {
        let options = Options {
            clock_ms,
            ..Options::default()
        };
        let mut host = Host::playing(options, ms(1000));
        assert_eq!(host.beat().state, DeviceState::Run);
        host.wait(ms(29));
        assert_eq!(host.device.state(), DeviceState::Run);
        host.wait(ms(2));
        assert_eq!(host.device.held_n(), 0.0);
        assert_eq!(host.device.state(), DeviceState::Limp);
        assert_eq!(host.device.fault(), Fault::Watchdog);
        // new heartbeats do not resume the playback
        assert!(host.beat().fresh);
        host.live(ms(500));
        assert_eq!(host.device.state(), DeviceState::Limp);
        assert_eq!(host.stop(7).refusal, Refusal::None);
        assert_eq!(host.play(8, 0).refusal, Refusal::WrongState);
        assert_eq!(host.ack(Request::Rearm).state, DeviceState::Idle);
        assert_eq!(host.outcome().loaded, Loaded::Nothing);
    }
}

#[test]
fn a_queue_of_old_heartbeats_does_not_keep_the_device_alive() {
    let mut host = Host::playing(Options::default(), ms(1000));
    let died = host.at;
    let deadline = host.clock_ms() + 40;
    // a thousand heartbeats from a driver's queue, one per millisecond
    for count in 0..1000 {
        host.wait(ms(1));
        host.beat_as(1_000_000 + count, deadline);
        if host.device.state() == DeviceState::Limp {
            break;
        }
    }
    assert!(host.at - died <= ms(40), "{:?}", host.at - died);
    assert!(host.outcome().stale_beats <= 1);
    // neither an old count, nor the same one, nor an absurd deadline
    let clock = host.clock_ms();
    assert!(!host.beat_as(5, clock + 30).fresh);
    assert!(host.beat_as(2_000_000, clock + 30).fresh);
    assert!(!host.beat_as(2_000_000, clock + 30).fresh);
    assert!(!host.beat_as(2_000_001, clock + 1001).fresh);
    assert!(!host.beat_as(2_000_001, clock).fresh);
    assert!(!host.beat_as(2_000_001, clock.wrapping_sub(1)).fresh);
}

#[test]
fn limp_is_zero_force_at_once_in_every_state_and_every_version() {
    type Reach = fn() -> Host;
    let states: [(&str, Reach); 7] = [
        ("boot", || Host::new(Options::default())),
        ("idle", || Host::opened(Options::default())),
        ("loaded", || {
            let mut host = Host::opened(Options::default());
            let nodes = detents(0.05, 0.02);
            host.upload(begin(&nodes), &nodes);
            host
        }),
        ("ramp", || Host::playing(Options::default(), ms(200))),
        ("run", || Host::playing(Options::default(), ms(2000))),
        ("limp", || {
            let mut host = Host::playing(Options::default(), ms(500));
            host.wait(ms(50));
            host
        }),
        ("fault", || {
            let mut host = Host::playing(Options::default(), ms(500));
            host.device.trip(Fault::External, host.at);
            host.read();
            host
        }),
    ];
    for (name, reach) in states {
        for version in [1, 2, 77] {
            let mut host = reach();
            if name == "run" {
                assert_ne!(host.device.held_n(), 0.0);
            }
            let body = [version, 7, 0, 0, 1, 2, 3];
            let frame = study_wire::frame::Frame::of(&body).unwrap();
            let Some(Reply::Ack(ack)) = host.send(frame.as_bytes()) else {
                panic!("{name}");
            };
            assert_eq!(ack.refusal, Refusal::None);
            assert_eq!(host.device.held_n(), 0.0, "{name}");
            let expected = if name == "fault" {
                DeviceState::Fault
            } else {
                DeviceState::Limp
            };
            assert_eq!(host.device.state(), expected, "{name}");
            assert_eq!(host.outcome().loaded, Loaded::Nothing);
        }
    }
}

#[test]
fn a_device_can_be_re_armed_only_at_rest() {
    let mut host = Host::playing(Options::default(), ms(1200));
    while host.device.held_n().abs() < 2.0 {
        host.live(ms(10));
    }
    host.device.trip(Fault::External, host.at);
    let ack = host.ack(Request::Rearm);
    assert_eq!((ack.refusal, ack.fault), (Refusal::Moving, Fault::External));
    assert_eq!(ack.state, DeviceState::Fault);
    host.wait(ms(400));
    let ack = host.ack(Request::Rearm);
    assert_eq!((ack.refusal, ack.state), (Refusal::None, DeviceState::Idle));
    assert_eq!(host.ack(Request::Rearm).refusal, Refusal::None, "and again");
}

#[test]
fn a_repeated_request_is_executed_once() {
    let mut host = Host::playing(Options::default(), ms(500));
    let stop = Request::Stop(Stop { playback: 7 });
    let first = host.ask_as(5000, stop);
    host.live(ms(20));
    // the same reply, with the earlier state and clock
    assert_eq!(host.ask_as(5000, stop), first);
    let crc = host.outcome().crc;
    let play = |playback| {
        Request::Play(Play {
            playback,
            crc,
            longest_ms: 1000,
            every: NonZeroU16::new(0),
        })
    };
    assert!(host.ask_as(5001, play(8)).is_some());
    // a delayed stop is ignored
    assert_eq!(host.ask_as(5000, stop), None);
    assert_eq!(host.device.state(), DeviceState::Ramp);
    // one number, two requests
    let Some(Reply::Ack(ack)) = host.ask_as(5001, play(9)) else {
        panic!();
    };
    assert_eq!(ack.refusal, Refusal::Reused);
    assert_eq!(host.outcome().playback, 8);
    let Some(Reply::Ack(ack)) = host.ask_as(5002, stop) else {
        panic!();
    };
    assert_eq!((ack.refusal, ack.detail), (Refusal::OtherPlayback, 8));
}

#[test]
fn sequence_numbers_and_the_clock_wrap() {
    let mut host = Host::opened(Options::default());
    host.ask_as(
        9,
        Request::Hello(Hello {
            nonce: 99,
            minor: 0,
        }),
    );
    for sequence in [30_000, 60_000, 65_535, 0, 1] {
        assert!(
            host.ask_as(sequence, Request::Rearm).is_some(),
            "{sequence}"
        );
    }
    assert!(host.ask_as(65_535, Request::Rearm).is_none());

    let mut host = Host::playing(
        Options {
            clock_ms: u32::MAX - 2000,
            ..Options::default()
        },
        ms(5000),
    );
    assert_eq!(host.device.state(), DeviceState::Run);
    assert!(host.beat().clock_ms < 10_000);
}

#[test]
fn the_longest_duration_ends_a_playback() {
    let mut host = Host::playing(Options::default(), ms(500));
    host.stop(7);
    host.live(ms(10));
    let crc = host.outcome().crc;
    let mut play = |longest_ms| {
        host.beat();
        host.ack(Request::Play(Play {
            playback: 8,
            crc,
            longest_ms,
            every: NonZeroU16::new(40),
        }))
    };
    assert_eq!(play(0).refusal, Refusal::Duration);
    assert_eq!(play(600_001).detail, 600_000);
    assert_eq!(play(1000).refusal, Refusal::None);
    host.live(ms(990));
    assert_eq!(host.device.state(), DeviceState::Run);
    host.live(ms(20));
    assert_eq!(host.device.state(), DeviceState::Loaded);
    let last = *events(&host).last().unwrap();
    assert_eq!(
        (last.kind, last.fault),
        (EventKind::Stopped, Fault::Longest)
    );
    assert_eq!(host.outcome().ticks, 4000);
}

#[test]
fn another_host_makes_the_device_limp_and_discards_the_table() {
    let mut host = Host::playing(Options::default(), ms(500));
    let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 1, minor: 0 })) else {
        panic!();
    };
    assert_eq!(
        identity.state,
        DeviceState::Run,
        "the same one changes nothing"
    );
    let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 2, minor: 0 })) else {
        panic!();
    };
    assert_eq!(identity.state, DeviceState::Limp);
    assert_eq!(identity.fault, Fault::NewConnection);
    assert_eq!(host.device.held_n(), 0.0);
}

/// A defect of a table, the refusal and its detail.
type Case = (
    &'static str,
    fn(&mut TableBegin, &mut Vec<Node>),
    Refusal,
    u32,
);

#[test]
fn a_table_that_must_not_be_played_is_refused() {
    let cases: [Case; 19] = [
        (
            "too many nodes",
            |b, _| b.nodes = 1025,
            Refusal::TooMany,
            1024,
        ),
        ("one node", |_, n| n.truncate(1), Refusal::BadTable, 1),
        ("no node", |_, n| n.clear(), Refusal::BadTable, 0),
        (
            "a hole",
            |_, n| n[3].positive[1] = f64::NAN,
            Refusal::BadTable,
            3,
        ),
        (
            "endless",
            |_, n| n[30].negative[3] = f64::INFINITY,
            Refusal::BadTable,
            30,
        ),
        ("nowhere", |_, n| n[4].x_mm = f64::NAN, Refusal::BadTable, 4),
        (
            "not ascending",
            |_, n| n[5].x_mm = 3.0,
            Refusal::BadTable,
            5,
        ),
        (
            "no range",
            |b, _| b.range_mm = [3.0, 3.0],
            Refusal::BadTable,
            32,
        ),
        (
            "no speed",
            |b, _| b.trained_mm_s = 0.0,
            Refusal::BadTable,
            32,
        ),
        (
            "no delta",
            |b, _| b.direction = Direction::Dahl { delta_mm: f64::NAN },
            Refusal::BadTable,
            32,
        ),
        ("too strong", |b, _| b.force_n = 15.1, Refusal::Limit, 1),
        ("no force", |b, _| b.force_n = f64::NAN, Refusal::Limit, 1),
        (
            "a cap too strong",
            |b, _| b.uncertified_n = Some(99.0),
            Refusal::Limit,
            1,
        ),
        (
            "no velocity",
            |b, _| b.velocity_mm_s = f64::INFINITY,
            Refusal::Limit,
            2,
        ),
        (
            "too wide",
            |b, _| b.range_mm = [0.0, 61.0],
            Refusal::Limit,
            3,
        ),
        (
            "too stiff",
            |_, n| n[8].positive[3] += 110.0,
            Refusal::Limit,
            4,
        ),
        (
            "negative mass",
            |_, n| n[8].negative[0] = -0.01,
            Refusal::Uncertified,
            1,
        ),
        (
            "negative damping",
            |_, n| n[8].negative[1] = -0.01,
            Refusal::Uncertified,
            2,
        ),
        (
            "the wrong way round",
            |_, n| n[8].negative[3] += 2.5,
            Refusal::Uncertified,
            3,
        ),
    ];
    for (name, spoil, refusal, detail) in cases {
        let mut host = Host::opened(Options::default());
        let mut nodes = detents(0.05, 0.02);
        let mut begin = begin(&nodes);
        spoil(&mut begin, &mut nodes);
        if begin.nodes == 32 {
            begin.nodes = nodes.len() as u16;
        }
        let (ack, crc) = host.upload(begin, &nodes);
        assert_eq!((ack.refusal, ack.detail), (refusal, detail), "{name}");
        assert_eq!(ack.state, DeviceState::Idle, "{name}");
        assert_eq!(host.play(1, crc).refusal, Refusal::WrongState, "{name}");
    }
}

#[test]
fn an_uncertified_table_is_played_with_capped_force_but_an_invalid_one_never() {
    let upload = |nodes: &[Node], uncertified_n| {
        let mut host = Host::opened(Options::default());
        let begin = TableBegin {
            uncertified_n,
            ..begin(nodes)
        };
        let (ack, crc) = host.upload(begin, nodes);
        (host, ack, crc)
    };
    let mut negative = detents(-0.3, 0.02);
    negative.iter_mut().for_each(|n| n.positive[3] += 12.0);
    let (mut host, ack, _) = upload(&negative, None);
    assert_eq!((ack.refusal, ack.detail), (Refusal::Uncertified, 1));
    assert_eq!(host.outcome().limit_n, 0.0);

    let (mut host, ack, crc) = upload(&negative, Some(9.0));
    assert_eq!(ack.refusal, Refusal::None);
    assert_eq!(host.outcome().limit_n, 9.0);
    host.play(1, crc);
    host.live(ms(3000));
    let outcome = host.outcome();
    assert_eq!(outcome.peak_force_n, 9.0);
    assert!(outcome.clamps > 0);
    let force = samples(&host).iter().map(|s| s.command_un.abs()).max();
    assert_eq!(force, Some(fixed::un(9.0)));

    // the cap does not apply to a certified table
    let (mut host, _, _) = upload(&detents(0.05, 0.02), Some(9.0));
    assert_eq!(host.outcome().limit_n, 12.0);

    negative[3].x_mm = f64::NAN;
    let (_, ack, _) = upload(&negative, Some(9.0));
    assert_eq!(ack.refusal, Refusal::BadTable);
}

#[test]
fn an_upload_accepts_only_complete_chunks_in_order() {
    let nodes = detents(0.05, 0.02);
    let mut host = Host::opened(Options::default());
    let chunk = |first: u16, count: usize| {
        Request::TableChunk(TableChunk {
            first,
            nodes: FixedVec::of(&nodes[usize::from(first)..usize::from(first) + count]),
        })
    };
    assert_eq!(host.ack(chunk(0, 3)).refusal, Refusal::WrongState);
    host.ack(Request::TableBegin(TableBegin {
        nodes: 4,
        ..begin(&nodes)
    }));
    assert_eq!(host.ack(chunk(0, 3)).refusal, Refusal::None);
    let ack = host.ack(chunk(6, 3));
    assert_eq!((ack.refusal, ack.detail), (Refusal::Order, 3));
    let ack = host.ack(Request::TableCommit(Commit { crc: 1 }));
    assert_eq!((ack.refusal, ack.detail), (Refusal::Incomplete, 3));
    let ack = host.ack(chunk(3, 2));
    assert_eq!((ack.refusal, ack.detail), (Refusal::TooMany, 4));
    assert_eq!(host.ack(chunk(3, 1)).refusal, Refusal::None);
    host.beat();
    let ack = host.ack(Request::TableCommit(Commit { crc: 1 }));
    assert_eq!(ack.refusal, Refusal::Checksum);
    assert_eq!(host.ack(chunk(0, 1)).refusal, Refusal::WrongState, "gone");
    // nothing is loaded for a host that may be dead
    host.wait(ms(100));
    let (mut begin, mut crc) = (begin(&nodes), None);
    begin.lookup = Lookup::Linear;
    for _ in 0..2 {
        host.ack(Request::TableBegin(begin));
        for first in (0..30).step_by(3) {
            host.ack(chunk(first, 3));
        }
        host.ack(chunk(30, 2));
        let known = crc.unwrap_or(0);
        let ack = host.ack(Request::TableCommit(Commit { crc: known }));
        if crc.is_some() {
            assert_eq!(ack.refusal, Refusal::NoHeartbeat);
        }
        crc = Some(ack.detail);
    }
}

#[test]
fn unsupported_versions_and_types_are_refused() {
    let mut host = Host::opened(Options::default());
    let mut refused = |body: &[u8]| {
        let frame = study_wire::frame::Frame::of(body).unwrap();
        match host.send(frame.as_bytes()) {
            Some(Reply::Ack(ack)) => Some((ack.refusal, ack.detail)),
            None => None,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(&[2, 1, 0, 0, 9]), Some((Refusal::Version, 1)));
    assert_eq!(refused(&[1, 0x44, 0, 0]), Some((Refusal::UnknownType, 0)));
    assert_eq!(refused(&[1, 5, 0, 0, 1]), Some((Refusal::Malformed, 0)));
    assert_eq!(refused(&[1, 0x80, 0, 0]), None, "an echo of its own");
    assert_eq!(refused(&[1]), None);
    assert_eq!(host.outcome().bad_frames, 5);
}

#[test]
fn a_reset_a_stall_and_a_missed_period_end_without_force() {
    let mut host = Host::playing(Options::default(), ms(2000));
    host.device.reset(host.at);
    assert_eq!(host.device.held_n(), 0.0);
    assert_eq!(host.device.state(), DeviceState::Boot);

    let mut host = Host::playing(Options::default(), ms(2000));
    host.device.stall(host.at, ms(3));
    host.wait(ms(4));
    assert_eq!(host.device.fault(), Fault::Overrun);
    assert_eq!(host.device.held_n(), 0.0);

    let mut host = Host::playing(Options::default(), ms(2000));
    let held = host.device.held_n();
    host.device.stall(host.at, ms(10_000));
    host.wait(ms(9));
    assert_eq!(host.device.held_n(), held, "nobody is there to change it");
    host.wait(ms(2));
    assert_eq!(host.device.held_n(), 0.0);
    assert_eq!(host.device.state(), DeviceState::Boot);
}

#[test]
fn the_frequency_of_calls_has_no_influence() {
    let run = |step: u64| {
        let mut host = Host::playing(Options::default(), ms(20));
        for _ in 0..100 {
            host.beat();
            for _ in 0..10 / step {
                host.wait(ms(step));
            }
        }
        host.stop(7);
        host.wait(ms(10));
        (host.outcome(), samples(&host))
    };
    assert_eq!(run(10), run(1));
    assert_eq!(run(5), run(2));
}
