//! The simulated device at the end of its wire: states, watchdog, uploads.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod wire_support;

use std::time::Duration;

use study::device::firmware::{Flaw, Options};
use study::device::wire::probe::PathCrc;
use study::device::wire::{
    Commit, Event, Fault, Few, Happening, Hello, Loaded, Node, PathBegin, PathChunk, Play, Record,
    Refusal, Reply, Request, State, Stop, TableBegin, TableChunk, TelemetrySample, fixed,
};
use study::model::predict::{Direction, Lookup};
use wire_support::{Host, begin, detents, ms};

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
    assert_eq!(host.device.state(), State::Boot);
    assert_eq!(host.ack(Request::Rearm).refusal, Refusal::NoHello);
    host.open(1);
    let nodes = detents(0.05, 0.02);
    let (ack, crc) = host.upload(begin(&nodes), &nodes);
    assert_eq!((ack.refusal, ack.state), (Refusal::None, State::Loaded));
    let ack = host.play(7, crc);
    assert_eq!((ack.refusal, ack.state), (Refusal::None, State::Ramp));
    host.live(ms(399));
    assert_eq!(host.device.state(), State::Ramp);
    host.live(ms(11_601));
    assert_eq!(host.device.state(), State::Run);
    let ack = host.stop(7);
    assert_eq!((ack.refusal, ack.state), (Refusal::None, State::Stopping));
    assert_eq!(host.device.held_n(), 0.0);
    host.wait(ms(1));
    assert_eq!(host.device.state(), State::Loaded);
    let outcome = host.outcome();
    assert_eq!(outcome.fault, Fault::None);
    assert_eq!(outcome.loaded, Loaded::Table);
    assert_eq!((outcome.playback, outcome.crc), (7, crc));
    assert_eq!(outcome.ticks, 48_000);
    assert_eq!(outcome.samples, 12_000);
    assert!(outcome.strokes > 4, "{outcome:?}");
    assert!(outcome.energy_j > 0.1, "{outcome:?}");
    assert!(outcome.most_force_n > 3.0 && outcome.most_force_n <= 12.0);
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
        .map(|event| (event.what, event.state, event.tick))
        .collect();
    assert_eq!(
        happened,
        [
            (Happening::Latched, State::Limp, 0),
            (Happening::Started, State::Ramp, 0),
            (Happening::Stopped, State::Loaded, 48_000),
        ]
    );
}

/// Nobody is heard from any more, at any time since the last heartbeat.
#[test]
fn without_a_heartbeat_the_force_is_zero_after_the_watchdog_time() {
    for clock_ms in [0, u32::MAX - 1020] {
        let options = Options {
            clock_ms,
            ..Options::default()
        };
        let mut host = Host::playing(options, ms(1000));
        assert_eq!(host.beat().state, State::Run);
        host.wait(ms(29));
        assert_eq!(host.device.state(), State::Run);
        host.wait(ms(2));
        assert_eq!(host.device.held_n(), 0.0);
        assert_eq!(host.device.state(), State::Limp);
        assert_eq!(host.device.fault(), Fault::Watchdog);
        // coming back does not go on with it
        assert!(host.beat().fresh);
        host.live(ms(500));
        assert_eq!(host.device.state(), State::Limp);
        assert_eq!(host.stop(7).refusal, Refusal::None);
        assert_eq!(host.play(8, 0).refusal, Refusal::WrongState);
        assert_eq!(host.ack(Request::Rearm).state, State::Idle);
        assert_eq!(host.outcome().loaded, Loaded::Nothing);
    }
}

#[test]
fn a_queue_of_old_heartbeats_does_not_keep_it_alive() {
    let mut host = Host::playing(Options::default(), ms(1000));
    let died = host.at;
    let deadline = host.clock_ms() + 40;
    // a thousand heartbeats that a driver still had, one a millisecond
    for count in 0..1000 {
        host.wait(ms(1));
        host.beat_as(1_000_000 + count, deadline);
        if host.device.state() == State::Limp {
            break;
        }
    }
    assert!(host.at - died <= ms(40), "{:?}", host.at - died);
    assert!(host.outcome().stale_beats <= 1);
    // neither an old number, nor the same, nor a deadline out of all reason
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
            let frame = study::device::frame::Frame::of(&body).unwrap();
            let Some(Reply::Ack(ack)) = host.send(frame.as_bytes()) else {
                panic!("{name}");
            };
            assert_eq!(ack.refusal, Refusal::None);
            assert_eq!(host.device.held_n(), 0.0, "{name}");
            let expected = if name == "fault" {
                State::Fault
            } else {
                State::Limp
            };
            assert_eq!(host.device.state(), expected, "{name}");
            assert_eq!(host.outcome().loaded, Loaded::Nothing);
        }
    }
}

#[test]
fn only_rest_re_arms() {
    let mut host = Host::playing(Options::default(), ms(1200));
    while host.device.held_n().abs() < 2.0 {
        host.live(ms(10));
    }
    host.device.trip(Fault::External, host.at);
    let ack = host.ack(Request::Rearm);
    assert_eq!((ack.refusal, ack.fault), (Refusal::Moving, Fault::External));
    assert_eq!(ack.state, State::Fault);
    host.wait(ms(400));
    let ack = host.ack(Request::Rearm);
    assert_eq!((ack.refusal, ack.state), (Refusal::None, State::Idle));
    assert_eq!(host.ack(Request::Rearm).refusal, Refusal::None, "and again");
}

#[test]
fn a_request_is_done_once_however_often_it_comes() {
    let mut host = Host::playing(Options::default(), ms(500));
    let stop = Request::Stop(Stop { playback: 7 });
    let first = host.ask_as(5000, stop);
    host.live(ms(20));
    // the very same reply, with the state and clock of then
    assert_eq!(host.ask_as(5000, stop), first);
    let crc = host.outcome().crc;
    let play = |playback| {
        Request::Play(Play {
            playback,
            crc,
            longest_ms: 1000,
            every: 0,
        })
    };
    assert!(host.ask_as(5001, play(8)).is_some());
    // a stop that was held up somewhere says nothing any more
    assert_eq!(host.ask_as(5000, stop), None);
    assert_eq!(host.device.state(), State::Ramp);
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
    host.ask_as(9, Request::Hello(Hello { nonce: 99 }));
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
    assert_eq!(host.device.state(), State::Run);
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
            every: 40,
        }))
    };
    assert_eq!(play(0).refusal, Refusal::Duration);
    assert_eq!(play(600_001).detail, 600_000);
    assert_eq!(play(1000).refusal, Refusal::None);
    host.live(ms(990));
    assert_eq!(host.device.state(), State::Run);
    host.live(ms(20));
    assert_eq!(host.device.state(), State::Loaded);
    let last = *events(&host).last().unwrap();
    assert_eq!(
        (last.what, last.fault),
        (Happening::Stopped, Fault::Longest)
    );
    assert_eq!(host.outcome().ticks, 4000);
}

#[test]
fn another_host_makes_it_limp_and_forgets_the_table() {
    let mut host = Host::playing(Options::default(), ms(500));
    let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 1 })) else {
        panic!();
    };
    assert_eq!(identity.state, State::Run, "the same one changes nothing");
    let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 2 })) else {
        panic!();
    };
    assert_eq!(identity.state, State::Limp);
    assert_eq!(identity.fault, Fault::NewConnection);
    assert_eq!(host.device.held_n(), 0.0);
}

/// What is wrong, the refusal and its detail.
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
            |_, n| n[8].positive[3] += 30.0,
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
        assert_eq!(ack.state, State::Idle, "{name}");
        assert_eq!(host.play(1, crc).refusal, Refusal::WrongState, "{name}");
    }
}

#[test]
fn armed_it_is_played_with_the_force_capped_but_never_with_a_hole() {
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
    assert_eq!(outcome.most_force_n, 9.0);
    assert!(outcome.clamps > 0);
    let force = samples(&host).iter().map(|s| s.command_un.abs()).max();
    assert_eq!(force, Some(fixed::un(9.0)));

    // a good table does not lose force by being armed
    let (mut host, _, _) = upload(&detents(0.05, 0.02), Some(9.0));
    assert_eq!(host.outcome().limit_n, 12.0);

    negative[3].x_mm = f64::NAN;
    let (_, ack, _) = upload(&negative, Some(9.0));
    assert_eq!(ack.refusal, Refusal::BadTable);
}

#[test]
fn an_upload_takes_its_pieces_in_order_and_whole() {
    let nodes = detents(0.05, 0.02);
    let mut host = Host::opened(Options::default());
    let chunk = |first: u16, count: usize| {
        Request::TableChunk(TableChunk {
            first,
            nodes: Few::of(&nodes[usize::from(first)..usize::from(first) + count]),
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
    // nothing is armed for a host that may be dead
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
fn versions_and_types_that_are_not_spoken_are_refused() {
    let mut host = Host::opened(Options::default());
    let mut refused = |body: &[u8]| {
        let frame = study::device::frame::Frame::of(body).unwrap();
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
    assert_eq!(host.device.state(), State::Boot);

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
    assert_eq!(host.device.state(), State::Boot);
}

#[test]
fn how_often_it_is_looked_at_changes_nothing() {
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

#[test]
fn a_path_is_followed_and_recorded() {
    let mut host = Host::opened(Options::default());
    let x_nm: Vec<i32> = (0..1000)
        .map(|i| fixed::nm(17.5 + 10.0 * libm::sin(f64::from(i) * 1e-3 * std::f64::consts::TAU)))
        .collect();
    let begin = PathBegin {
        points: 1000,
        rate_hz: 1000.0,
        force_n: 15.0,
        velocity_mm_s: 200.0,
    };
    let mut crc = PathCrc::of(&begin);
    x_nm.iter().for_each(|x| crc.point(*x));
    let crc = crc.value();
    assert_eq!(host.ack(Request::PathBegin(begin)).refusal, Refusal::None);
    for (i, some) in x_nm.chunks(PathChunk::MOST).enumerate() {
        let ack = host.ack(Request::PathChunk(PathChunk {
            first: (i * PathChunk::MOST) as u32,
            x_nm: Few::of(some),
        }));
        assert_eq!(ack.refusal, Refusal::None);
    }
    host.beat();
    let ack = host.ack(Request::PathCommit(Commit { crc }));
    assert_eq!((ack.refusal, ack.state), (Refusal::None, State::Loaded));
    assert_eq!(host.play(3, crc).refusal, Refusal::OtherTable);
    let ack = host.ack(Request::Record(Record { playback: 3, crc }));
    assert_eq!((ack.refusal, ack.state), (Refusal::None, State::Ramp));
    host.live(ms(2000));
    assert_eq!(
        host.device.state(),
        State::Loaded,
        "{:?}",
        host.device.fault()
    );

    let mut points = Vec::new();
    for reply in &host.heard {
        if let Reply::Recorded(recorded) = reply {
            assert_eq!(recorded.first as usize, points.len());
            points.extend_from_slice(recorded.points.as_slice());
        }
    }
    assert_eq!(points.len(), 1000);
    for (i, (point, x_nm)) in points.iter().zip(&x_nm).enumerate() {
        // the encoder, and a servo period of 63 mm/s
        assert!((point.x_nm - x_nm).abs() < 25_000, "{i} {point:?} {x_nm}");
    }
    let most = points.iter().map(|p| p.force_un.abs()).max().unwrap();
    assert!((2_000_000..14_000_000).contains(&most), "{most}");
    assert_eq!(host.outcome().samples, 1000);
}

/// Switches a second of a hand that holds still for ten seconds against a table
/// of two branches, `half_n` above and below zero.
fn held(direction: Direction, servo_hz: f64, half_n: f64) -> f64 {
    let mut options = Options {
        servo_hz,
        ..Options::default()
    };
    // one stroke, then a rest without end
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
    assert_eq!(after.state, State::Run);
    f64::from(after.switches - before.switches) / 10.0
}

/// The sign of v chatters at rest whatever the servo rate; a direction state does
/// not. How fast depends on the hand, on the filter of the speed and on the step
/// between the branches; another simulation found 140 switches a second.
#[test]
fn held_still_the_sign_chatters_and_a_direction_state_does_not() {
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

/// What each planted defect looks like from the other end of the wire.
#[test]
fn every_flaw_shows() {
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
    let ack = host.ack(Request::Hello(Hello { nonce: 1 }));
    assert_eq!((ack.refusal, ack.detail), (Refusal::Version, 2));

    let mut host = playing(Flaw::DeafToLimp);
    assert_eq!(host.ack(Request::Limp).state, State::Limp);
    assert_eq!(host.device.state(), State::Run);

    let mut host = playing(Flaw::Repeats);
    let first = host.ask_as(5000, Request::Rearm).unwrap();
    host.live(ms(10));
    assert_ne!(host.ask_as(5000, Request::Rearm), Some(first));

    let mut host = playing(Flaw::Unlatched);
    host.wait(ms(100));
    assert_eq!(host.outcome().state, State::Idle);
    assert_eq!(host.device.state(), State::Limp);

    let mut host = playing(Flaw::TakesStale);
    let clock = host.clock_ms();
    assert!(host.beat_as(1_000_000, clock.wrapping_sub(500)).fresh);

    let mut host = playing(Flaw::LateWatchdog);
    host.beat();
    host.wait(ms(250));
    assert_eq!(host.device.state(), State::Run);
    let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 1 })) else {
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
        assert_eq!(host.device.state(), State::Idle);
    }

    let most = |flaw| {
        let mut host = Host::playing(flawed(flaw), ms(3000));
        (host.outcome().most_force_n, host)
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
    let hello = Request::Hello(Hello { nonce: 1 });
    assert!(host.send(hello.frame(1).as_bytes()).is_none());
    host.wait(ms(49));
    assert_eq!(host.heard, []);
    host.wait(ms(2));
    assert!(matches!(host.heard[..], [Reply::Identity(_)]));

    let mut host = playing(Flaw::SlowStop);
    let stop = Request::Stop(Stop { playback: 7 });
    assert!(host.send(stop.frame(9000).as_bytes()).is_none());
    host.live(ms(190));
    assert_eq!(host.device.state(), State::Run);
    host.live(ms(20));
    assert_eq!(host.device.state(), State::Loaded);
}

/// A host that dies at any moment, over a link that takes its time: in virtual
/// time, so this is the device's promise and not a computer's.
#[test]
fn whenever_the_host_dies_the_force_is_zero_within_50_ms() {
    let mut worst = ms(0);
    for death in 0..200u64 {
        // a slow servo: many deaths in little time
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
        while host.device.state().forceful() {
            host.wait(Duration::from_micros(250));
            assert!(host.at - made <= ms(50), "{death}");
        }
        assert_eq!(host.device.held_n(), 0.0);
        assert_eq!(host.device.fault(), Fault::Watchdog);
        worst = worst.max(host.at - made);
    }
    assert!(worst > ms(30) && worst <= ms(41), "{worst:?}");
}

fn recording(x_mm: impl Fn(f64) -> f64, force_n: f64) -> (Host, u32) {
    let mut host = Host::opened(Options::default());
    let begin = PathBegin {
        points: 500,
        rate_hz: 1000.0,
        force_n,
        velocity_mm_s: 150.0,
    };
    let x_nm: Vec<i32> = (0..500)
        .map(|i| fixed::nm(x_mm(f64::from(i) * 1e-3)))
        .collect();
    let mut crc = PathCrc::of(&begin);
    x_nm.iter().for_each(|x| crc.point(*x));
    host.ack(Request::PathBegin(begin));
    for (i, some) in x_nm.chunks(PathChunk::MOST).enumerate() {
        let first = (i * PathChunk::MOST) as u32;
        let x_nm = Few::of(some);
        host.ack(Request::PathChunk(PathChunk { first, x_nm }));
    }
    host.beat();
    (host, crc.value())
}

#[test]
fn a_path_that_cannot_be_followed_is_refused_and_a_recording_can_be_stopped() {
    type Path = fn(f64) -> f64;
    let cases: [(Path, Refusal, u32); 3] = [
        (|t| 17.5 + 151.0 * t, Refusal::BadTable, 1),
        (|t| -19.9 - t, Refusal::Limit, 3),
        (
            |t| if t < 0.3 { 17.5 } else { 17.7 },
            Refusal::BadTable,
            300,
        ),
    ];
    for (path, refusal, detail) in cases {
        let (mut host, crc) = recording(path, 15.0);
        let ack = host.ack(Request::PathCommit(Commit { crc }));
        assert_eq!((ack.refusal, ack.detail), (refusal, detail));
    }
    let (mut host, crc) = recording(|t| 17.5 + 20.0 * t, 15.0);
    host.ack(Request::PathCommit(Commit { crc }));
    host.ack(Request::Record(Record { playback: 4, crc }));
    host.live(ms(700));
    assert_eq!(host.device.state(), State::Run);
    assert_ne!(host.device.held_n(), 0.0);
    assert_eq!(host.stop(4).state, State::Stopping);
    assert_eq!(host.device.held_n(), 0.0);
    host.wait(ms(1));
    let outcome = host.outcome();
    assert_eq!((outcome.loaded, outcome.fault), (Loaded::Path, Fault::None));
    assert!((190..=210).contains(&outcome.samples), "{outcome:?}");
    // and the host's death
    host.beat();
    host.ack(Request::Record(Record { playback: 5, crc }));
    host.wait(ms(31));
    assert_eq!(host.device.fault(), Fault::Watchdog);
    assert_eq!(host.device.held_n(), 0.0);
}

fn in_state(state: State) -> Host {
    let loaded = || {
        let mut host = Host::opened(Options::default());
        let nodes = detents(0.05, 0.02);
        host.upload(begin(&nodes), &nodes);
        host
    };
    let mut host = match state {
        State::Boot => Host::new(Options::default()),
        State::Idle => Host::opened(Options::default()),
        State::Loaded => loaded(),
        State::Ramp => Host::playing(Options::default(), ms(200)),
        State::Run => Host::playing(Options::default(), ms(1000)),
        // nothing can come in between a stop and the end of its telemetry
        State::Stopping => unreachable!(),
        State::Limp => {
            let mut host = loaded();
            host.ask(Request::Limp);
            host
        }
        State::Fault => {
            let mut host = loaded();
            host.device.trip(Fault::External, host.at);
            host
        }
    };
    host.wait(ms(1));
    assert_eq!(host.device.state(), state);
    host
}

/// The table of states in the document: every state, every request.
#[test]
fn every_request_in_every_state_does_what_the_document_says() {
    use Refusal::{NoHeartbeat, NoHello, None as Done, OtherPlayback, WrongState};
    use State::{Boot, Fault, Idle, Limp, Loaded, Ramp, Run};

    let nodes = detents(0.05, 0.02);
    let begin = begin(&nodes);
    let mut crc = study::device::wire::TableCrc::of(&begin);
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
        nodes: Few::of(&nodes[..3]),
    });
    let points = Request::PathChunk(PathChunk {
        first: 0,
        x_nm: Few::of(&[0, 0]),
    });
    let play = Request::Play(Play {
        playback: 7,
        crc,
        longest_ms: 1000,
        every: 4,
    });
    let stop = Request::Stop(Stop { playback: 7 });
    let hello = Request::Hello(Hello { nonce: 2 });
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
    let cases: [(Request, [(Refusal, State); 7]); 14] = [
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
                (Done, State::Stopping),
                (Done, State::Stopping),
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
            Request::Heartbeat(study::device::wire::Heartbeat {
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
            if !after.forceful() {
                assert_eq!(host.device.held_n(), 0.0, "{context}");
            }
        }
    }
    // PLAY for a host that has not been heard for as long as a watchdog lets it
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
        nodes: Few::of(&nodes[30..]),
    }));
    host.wait(ms(50));
    let ack = host.ack(Request::TableCommit(Commit { crc }));
    assert_eq!((ack.refusal, ack.detail), (Refusal::Incomplete, 31));
    host.ask(Request::TableChunk(TableChunk {
        first: 31,
        nodes: Few::of(&nodes[31..]),
    }));
    assert_eq!(
        host.ack(Request::TableCommit(Commit { crc })).refusal,
        NoHeartbeat
    );
    host.beat();
    assert_eq!(host.ack(Request::TableCommit(Commit { crc })).refusal, Done);
}

/// Each state met by a reset, a processor that hangs, an end of the cable, noise.
#[test]
fn every_state_ends_without_force_when_something_breaks() {
    for state in [
        State::Boot,
        State::Idle,
        State::Loaded,
        State::Ramp,
        State::Run,
        State::Limp,
        State::Fault,
    ] {
        let mut host = in_state(state);
        host.device.reset(host.at);
        assert_eq!(host.device.held_n(), 0.0, "{state:?}");
        assert_eq!(host.device.state(), State::Boot, "{state:?}");

        let mut host = in_state(state);
        host.device.stall(host.at, ms(60_000));
        host.wait(ms(11));
        assert_eq!(host.device.held_n(), 0.0, "{state:?}");
        assert_eq!(host.device.state(), State::Boot, "{state:?}");

        // unplugged: nothing comes any more
        let mut host = in_state(state);
        host.wait(ms(41));
        assert_eq!(host.device.held_n(), 0.0, "{state:?}");
        let expected = if state.armed() { State::Limp } else { state };
        assert_eq!(host.device.state(), expected, "{state:?}");

        // noise: nothing of it is done, and the next frame is understood
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
        nodes: Few::of(&nodes[..3]),
    });
    assert_eq!(host.ack(chunk).refusal, Refusal::NoHello);
}

#[test]
fn a_probe_that_is_not_strong_enough_loses_its_path_and_trips() {
    // out of the middle detent: the crest takes more than 3 N
    let (mut host, crc) = recording(|t| 17.5 + 20.0 * t, 3.0);
    host.ack(Request::PathCommit(Commit { crc }));
    host.ack(Request::Record(Record { playback: 4, crc }));
    for _ in 0..200 {
        host.live(ms(5));
        assert!(host.device.held_n().abs() <= 3.0);
    }
    assert_eq!(host.device.fault(), Fault::Following);
    assert_eq!(host.device.held_n(), 0.0);
}
