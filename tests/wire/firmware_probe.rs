//! The simulated device as a probe: paths are followed, recorded, refused.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{Host, ms};
use study_device::firmware::Options;
use study_wire::message::UploadCrc;
use study_wire::message::{
    Commit, DeviceState, Fault, FixedVec, Loaded, PathBegin, PathChunk, Record, Refusal, Reply,
    Request, fixed,
};

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
    let mut crc = UploadCrc::of_path(&begin);
    x_nm.iter().for_each(|x| crc.point(*x));
    let crc = crc.value();
    assert_eq!(host.ack(Request::PathBegin(begin)).refusal, Refusal::None);
    for (i, some) in x_nm.chunks(PathChunk::MAX_POINTS).enumerate() {
        let ack = host.ack(Request::PathChunk(PathChunk {
            first: (i * PathChunk::MAX_POINTS) as u32,
            x_nm: FixedVec::of(some),
        }));
        assert_eq!(ack.refusal, Refusal::None);
    }
    host.beat();
    let ack = host.ack(Request::PathCommit(Commit { crc }));
    assert_eq!(
        (ack.refusal, ack.state),
        (Refusal::None, DeviceState::Loaded)
    );
    assert_eq!(host.play(3, crc).refusal, Refusal::OtherTable);
    let ack = host.ack(Request::Record(Record { playback: 3, crc }));
    assert_eq!((ack.refusal, ack.state), (Refusal::None, DeviceState::Ramp));
    host.live(ms(2000));
    assert_eq!(
        host.device.state(),
        DeviceState::Loaded,
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
        // the encoder's resolution, and the motion in a servo period at 63 mm/s
        assert!((point.x_nm - x_nm).abs() < 25_000, "{i} {point:?} {x_nm}");
    }
    let most = points
        .iter()
        .map(|p| p.force_un.unwrap().abs())
        .max()
        .unwrap();
    assert!((2_000_000..14_000_000).contains(&most), "{most}");
    assert_eq!(host.outcome().samples, 1000);
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
    let mut crc = UploadCrc::of_path(&begin);
    x_nm.iter().for_each(|x| crc.point(*x));
    host.ack(Request::PathBegin(begin));
    for (i, some) in x_nm.chunks(PathChunk::MAX_POINTS).enumerate() {
        let first = (i * PathChunk::MAX_POINTS) as u32;
        let x_nm = FixedVec::of(some);
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
    assert_eq!(host.device.state(), DeviceState::Run);
    assert_ne!(host.device.held_n(), 0.0);
    assert_eq!(host.stop(4).state, DeviceState::Stopping);
    assert_eq!(host.device.held_n(), 0.0);
    host.wait(ms(1));
    let outcome = host.outcome();
    assert_eq!((outcome.loaded, outcome.fault), (Loaded::Path, Fault::None));
    assert!((190..=210).contains(&outcome.samples), "{outcome:?}");
    // the host dies
    host.beat();
    host.ack(Request::Record(Record { playback: 5, crc }));
    host.wait(ms(31));
    assert_eq!(host.device.fault(), Fault::Watchdog);
    assert_eq!(host.device.held_n(), 0.0);
}

#[test]
fn a_probe_that_is_not_strong_enough_loses_its_path_and_trips() {
    // out of the middle detent, whose crest needs more than 3 N
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
