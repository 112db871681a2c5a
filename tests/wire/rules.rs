//! What docs/wire.md says about orders, counts and states, rule by rule.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::support::{Host, begin, detents, ms};
use std::num::NonZeroU16;
use study_device::firmware::Options;
use study_wire::frame::Frame;
use study_wire::message::{
    Commit, DeviceState, EventKind, Fault, Hello, Node, Play, Refusal, Reply, Request, Stop,
    TableBegin, UploadCrc, kind,
};
use study_wire::predict::{Direction, Lookup};

/// The refusal of COMMIT with its detail.
fn refused(begin: TableBegin, nodes: &[Node]) -> (Refusal, u32) {
    let mut host = Host::opened(Options::default());
    let (ack, _) = host.upload(begin, nodes);
    assert_eq!(ack.request, kind::TABLE_COMMIT);
    (ack.refusal, ack.detail)
}

/// Every reason at once; then the first one is mended, and so on.
#[test]
fn a_commit_is_refused_for_the_first_reason_of_8_5() {
    let good = detents(0.05, 0.02);
    let mut nodes = good.clone();
    nodes[7].positive[2] = f64::NAN;
    nodes[20].x_mm = nodes[19].x_mm;
    // stiff, strongly damped, and against every condition
    for node in &mut nodes[24..26] {
        node.positive = [-1.0, -5.0, 90.0, -4000.0];
    }
    let mut table = TableBegin {
        range_mm: [33.5, 1.5],
        force_n: 99.0,
        velocity_mm_s: 1e9,
        ..begin(&good)
    };
    let expect = |table: &TableBegin, nodes: &[Node], why: Refusal, detail: u32| {
        assert_eq!(refused(*table, nodes), (why, detail));
    };
    expect(&table, &nodes, Refusal::BadTable, 7);
    nodes[7] = good[7];
    expect(&table, &nodes, Refusal::BadTable, 20);
    nodes[20] = good[20];
    expect(&table, &nodes, Refusal::BadTable, 32);
    table.range_mm = [-500.0, 33.5];
    expect(&table, &nodes, Refusal::Limit, 1);
    table.force_n = 12.0;
    expect(&table, &nodes, Refusal::Limit, 2);
    table.velocity_mm_s = 1000.0;
    expect(&table, &nodes, Refusal::Limit, 3);
    table.range_mm = [1.5, 33.5];
    expect(&table, &nodes, Refusal::Uncertified, 1);
    for node in &mut nodes[24..26] {
        node.positive[0] = 0.05;
    }
    expect(&table, &nodes, Refusal::Uncertified, 2);
    for node in &mut nodes[24..26] {
        node.positive[1] = 5.0;
    }
    expect(&table, &nodes, Refusal::Uncertified, 3);
    for node in &mut nodes[24..26] {
        node.positive[3] = 0.0;
    }
    expect(&table, &nodes, Refusal::Limit, 4);
    nodes[24..26].copy_from_slice(&good[24..26]);
    nodes[24].positive[1] = 5.0;
    expect(&table, &nodes, Refusal::Limit, 5);
    nodes[24] = good[24];
    expect(&table, &nodes, Refusal::None, 0);
}

#[test]
fn an_upload_is_kept_after_incomplete_and_no_heartbeat_and_discarded_otherwise() {
    let nodes = detents(0.05, 0.02);
    let mut host = Host::opened(Options::default());
    let commit = |host: &mut Host, crc| host.ack(Request::TableCommit(Commit { crc })).refusal;
    assert_eq!(commit(&mut host, 0), Refusal::WrongState, "nothing begun");
    host.wait(ms(100));
    // all chunks, but COMMIT without a heartbeat
    let mut crc = UploadCrc::of_table(&begin(&nodes));
    nodes.iter().for_each(|node| crc.node(node));
    host.ack(Request::TableBegin(begin(&nodes)));
    assert_eq!(commit(&mut host, crc.value()), Refusal::Incomplete);
    for request in host.chunks(&nodes) {
        assert_eq!(host.ack(request).refusal, Refusal::None);
    }
    assert_eq!(commit(&mut host, crc.value()), Refusal::NoHeartbeat);
    host.beat();
    assert_eq!(commit(&mut host, crc.value()), Refusal::None);

    host.ack(Request::TableBegin(begin(&nodes)));
    for request in host.chunks(&nodes) {
        host.ack(request);
    }
    host.beat();
    assert_eq!(commit(&mut host, crc.value() ^ 1), Refusal::Checksum);
    assert_eq!(commit(&mut host, crc.value()), Refusal::WrongState);
    let chunk = host.chunks(&nodes).remove(0);
    assert_eq!(host.ack(chunk).refusal, Refusal::WrongState);
}

#[test]
fn a_play_is_refused_for_the_first_reason_of_8_6() {
    let mut host = Host::opened(Options::default());
    let nodes = detents(0.05, 0.02);
    let mut play = Play {
        playback: 0,
        crc: 1,
        longest_ms: u32::MAX,
        every: NonZeroU16::new(4),
    };
    assert_eq!(host.ack(Request::Play(play)).refusal, Refusal::WrongState);
    let (_, crc) = host.upload(begin(&nodes), &nodes);
    // the host is no longer alive one millisecond before the watchdog acts
    host.wait(ms(29));
    let mut ask = |play: Play| {
        let ack = host.ack(Request::Play(play));
        (ack.refusal, ack.detail)
    };
    assert_eq!(ask(play), (Refusal::OtherTable, crc));
    play.crc = crc;
    assert_eq!(ask(play), (Refusal::Malformed, 0));
    play.playback = 1;
    assert_eq!(ask(play), (Refusal::Duration, 600_000));
}

#[test]
fn a_play_with_number_0_counts_as_executed() {
    let mut host = Host::opened(Options::default());
    let nodes = detents(0.05, 0.02);
    let (_, crc) = host.upload(begin(&nodes), &nodes);
    let play = |playback| {
        Request::Play(Play {
            playback,
            crc,
            longest_ms: 1000,
            every: None,
        })
    };
    let refusal = |reply: Option<Reply>| match reply {
        Some(Reply::Ack(ack)) => ack.refusal,
        other => panic!("{other:?}"),
    };
    assert_eq!(refusal(host.ask_as(700, play(0))), Refusal::Malformed);
    assert_eq!(refusal(host.ask_as(700, play(1))), Refusal::Reused);
    // a message that is too long does not count
    let mut long = vec![1, kind::PLAY];
    long.extend(701_u16.to_le_bytes());
    long.resize(99, 0);
    let frame = Frame::of(&long).unwrap();
    assert_eq!(refusal(host.send(frame.as_bytes())), Refusal::Malformed);
    host.beat();
    assert_eq!(refusal(host.ask_as(701, play(1))), Refusal::None);
}

#[test]
fn what_is_not_used_in_table_begin_is_zero() {
    let table = begin(&detents(0.05, 0.02));
    let sign = TableBegin {
        direction: Direction::Sign,
        ..table
    };
    let mut host = Host::opened(Options::default());
    let mut with = |table: TableBegin, at: usize, value: f64| {
        let mut frame = study_wire::frame::Decoder::new();
        let sequence = 1000 + at as u16;
        let mut body = Vec::new();
        for byte in Request::TableBegin(table).frame(sequence).as_bytes() {
            if let Some(found) = frame.push(*byte) {
                body = found.unwrap().to_vec();
            }
        }
        body[4 + at..][..8].copy_from_slice(&value.to_le_bytes());
        match host.send(Frame::of(&body).unwrap().as_bytes()) {
            Some(Reply::Ack(ack)) => ack.refusal,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(
        with(sign, 5, 0.5),
        Refusal::Malformed,
        "δ with the rule sign"
    );
    assert_eq!(with(table, 53, 9.0), Refusal::Malformed, "a cap, not armed");
    assert_eq!(with(sign, 5, 0.0), Refusal::None);
}

/// Frames that are bad by 2.3, and those with a correct CRC that are.
#[test]
fn bad_frames_are_counted_one_by_one() {
    let mut host = Host::opened(Options::default());
    let mut bad = |bytes: &[u8]| {
        let before = host.outcome().bad_frames;
        host.send(bytes);
        host.outcome().bad_frames - before
    };
    let framed = |body: &[u8]| Frame::of(body).unwrap().as_bytes().to_vec();
    assert_eq!(bad(&[0, 0, 0, 0]), 0, "zeros");
    assert_eq!(bad(&[0, 5, 0]), 1, "COBS beyond the end");
    assert_eq!(bad(&[0, 2, 9, 0]), 1, "too short for a CRC");
    assert_eq!(
        bad(&[7; 300]),
        1,
        "too long, up to the zero of the next frame"
    );
    let mut damaged = framed(&[1, kind::STATE, 0, 0]);
    damaged[3] ^= 1;
    assert_eq!(bad(&damaged), 1, "CRC");
    assert_eq!(bad(&framed(&[1, 2])), 1, "shorter than a header");
    assert_eq!(bad(&framed(&[1, kind::STATE, 0, 0, 1])), 1, "length");
    assert_eq!(bad(&framed(&[1, 0x44, 0, 0])), 1, "type");
    assert_eq!(bad(&framed(&[1, kind::PULSE, 0, 0])), 1, "a reply");
    assert_eq!(bad(&framed(&[2, kind::STATE, 0, 0])), 1, "version");
    assert_eq!(bad(&framed(&[1, kind::REARM, 0, 0])), 0, "refused only");
}

fn events(host: &Host) -> Vec<EventKind> {
    let events = host.heard.iter().filter_map(|reply| match reply {
        Reply::Event(event) => Some(event.kind),
        _ => None,
    });
    events.collect()
}

#[test]
fn limp_in_limp_and_in_fault_sends_no_second_event() {
    let mut host = Host::playing(Options::default(), ms(600));
    host.heard.clear();
    for _ in 0..3 {
        assert_eq!(host.ack(Request::Limp).state, DeviceState::Limp);
    }
    assert_eq!(events(&host), [EventKind::Latched]);
    host.device.trip(Fault::External, host.at);
    host.wait(ms(1));
    let before = events(&host).len();
    let ack = host.ack(Request::Limp);
    assert_eq!(
        (ack.state, ack.fault),
        (DeviceState::Fault, Fault::External)
    );
    assert_eq!(events(&host).len(), before);
}

#[test]
fn telemetry_and_events_have_one_counter_from_0_at_hello() {
    let mut host = Host::opened(Options::default());
    let nodes = detents(0.05, 0.02);
    for nonce in [21, 22] {
        host.open(nonce);
        let (_, crc) = host.upload(begin(&nodes), &nodes);
        host.unsolicited();
        host.play(7, crc);
        host.live(ms(300));
        host.stop(7);
        host.wait(ms(1));
        let numbers = host.unsolicited();
        assert!(numbers.len() > 20);
        let expected: Vec<u16> = (0..numbers.len() as u16).collect();
        assert_eq!(numbers, expected);
        // the hand lets go, and the device goes limp
        host.wait(ms(1000));
    }
}

#[test]
fn hello_forgets_heartbeats_and_before_it_none_is_fresh() {
    let mut host = Host::new(Options::default());
    let deadline = |host: &Host| host.clock_ms() + 40;
    let ahead = deadline(&host);
    assert!(!host.beat_as(1, ahead).fresh, "before HELLO");
    host.open(1);
    assert!(host.beat_as(1000, ahead).fresh);
    assert!(!host.beat_as(1000, ahead).fresh);
    host.ask(Request::Hello(Hello { nonce: 1, minor: 1 }));
    assert!(!host.beat_as(999, ahead).fresh, "the same connection");
    host.ask(Request::Hello(Hello { nonce: 2, minor: 1 }));
    let nodes = detents(0.05, 0.02);
    let (begin, chunks) = (begin(&nodes), host.chunks(&nodes));
    host.ack(Request::TableBegin(begin));
    for chunk in chunks {
        host.ack(chunk);
    }
    let mut crc = UploadCrc::of_table(&begin);
    nodes.iter().for_each(|node| crc.node(node));
    let commit = Request::TableCommit(Commit { crc: crc.value() });
    assert_eq!(host.ack(commit).refusal, Refusal::NoHeartbeat, "forgotten");
    assert!(host.beat_as(1, ahead).fresh, "any count is new");
}

/// The change of force over the direction state belongs to the stiffness from minor
/// version 1 on: 2 × 30 N over 0.5 mm are 120 N/mm, of which the device renders 100.
#[test]
fn the_stiffness_of_the_direction_state_counts_from_minor_version_1_on() {
    let mut nodes = detents(0.05, 0.02);
    for node in &mut nodes {
        [node.positive[3], node.negative[3]] = [30.0, -30.0];
    }
    for (minor, expected) in [(0, (Refusal::None, 0)), (1, (Refusal::Limit, 4))] {
        let mut host = Host::opened(Options::default());
        host.ask(Request::Hello(Hello { nonce: 9, minor }));
        let (ack, _) = host.upload(begin(&nodes), &nodes);
        assert_eq!((ack.refusal, ack.detail), expected, "minor version {minor}");
        // without a state there is nothing to add
        let mut host = Host::opened(Options::default());
        host.ask(Request::Hello(Hello { nonce: 9, minor }));
        let sign = TableBegin {
            direction: Direction::Sign,
            ..begin(&nodes)
        };
        assert_eq!(host.upload(sign, &nodes).0.refusal, Refusal::None);
    }
}

/// With the look-ups floor and nearest the mass may not grow along the motion, and S may
/// not jump.
#[test]
fn look_ups_that_jump_are_judged_by_their_jumps() {
    let flat: Vec<Node> = detents(0.05, 0.02)
        .into_iter()
        .map(|mut node| {
            [node.positive[3], node.negative[3]] = [1.0, -1.0];
            node
        })
        .collect();
    for lookup in [Lookup::Floor, Lookup::Nearest] {
        let table = TableBegin {
            lookup,
            direction: Direction::Sign,
            ..begin(&flat)
        };
        assert_eq!(refused(table, &flat), (Refusal::None, 0), "{lookup:?}");
        let mut grows = flat.clone();
        // in the direction of positive, and with any damping
        grows.iter_mut().for_each(|node| node.positive[1] = 0.15);
        grows[20..]
            .iter_mut()
            .for_each(|node| node.positive[0] = 0.06);
        assert_eq!(refused(table, &grows), (Refusal::Uncertified, 2));
        let mut jumps = flat.clone();
        jumps[20].positive[3] = 1.5;
        assert_eq!(refused(table, &jumps), (Refusal::Limit, 4), "{lookup:?}");
    }
}

/// Trips of 7.1 act only while there is force; a fault of the hardware in every state.
#[test]
fn a_fault_of_the_hardware_trips_in_every_state() {
    let mut boot = Host::new(Options::default());
    let mut idle = Host::opened(Options::default());
    let mut playing = Host::playing(Options::default(), ms(600));
    let mut limp = Host::playing(Options::default(), ms(600));
    limp.ack(Request::Limp);
    for host in [&mut boot, &mut idle, &mut playing, &mut limp] {
        host.device.trip(Fault::External, host.at);
        assert_eq!(host.device.state(), DeviceState::Fault);
        assert_eq!(host.device.fault(), Fault::External);
    }
}

/// 12 N of wall and table against a limit of 3 N: the ramp multiplies first, so nothing
/// is clamped before the ramp has passed 1/4.
#[test]
fn clamps_are_counted_on_the_force_after_the_ramp() {
    let mut nodes = detents(0.05, 0.02);
    for node in &mut nodes {
        [node.positive[3], node.negative[3]] = [12.0, 12.0];
    }
    let mut host = Host::opened(Options::default());
    let table = TableBegin {
        force_n: 3.0,
        ..begin(&nodes)
    };
    let (ack, crc) = host.upload(table, &nodes);
    assert_eq!(ack.refusal, Refusal::None);
    host.play(1, crc);
    // half a cosine over 400 ms is 1/4 after 133 ms
    host.live(ms(120));
    assert_eq!(host.outcome().clamps, 0);
    host.live(ms(40));
    assert_eq!(host.outcome().clamps, 1);
    assert_eq!(
        host.ack(Request::Stop(Stop { playback: 1 })).refusal,
        Refusal::None
    );
}
