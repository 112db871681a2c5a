//! Mechanisms on a device: upload, certificate, refusals, and hosts of older minor versions.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::support::{Host, begin, detents, mechanism, mechanism_requests, ms};
use study_device::firmware::Options;
use study_wire::mechanism::Scalars;
use study_wire::message::{
    Commit, DeviceState, Hello, Loaded, MechanismBegin, MechanismChunk, Refusal, Reply, Request,
};

/// The refusal of an upload, with its detail.
fn refused(begin: MechanismBegin, values_n: &[f64]) -> (Refusal, u32) {
    let mut host = Host::opened(Options::default());
    let (ack, _) = host.upload_mechanism(begin, values_n);
    (ack.refusal, ack.detail)
}

#[test]
fn a_mechanism_is_loaded_and_played() {
    let mut host = Host::opened(Options::default());
    let (begin, values) = mechanism(4.0, 1.2);
    let (ack, crc) = host.upload_mechanism(begin, &values);
    assert_eq!(
        (ack.refusal, ack.state),
        (Refusal::None, DeviceState::Loaded)
    );
    assert_eq!(host.play(7, crc).refusal, Refusal::None);
    host.live(ms(3000));
    assert_eq!(host.stop(7).refusal, Refusal::None);
    host.live(ms(20));
    let outcome = host.outcome();
    assert_eq!((outcome.loaded, outcome.crc), (Loaded::Table, crc));
    // the hand worked against detents and friction, and there were reversals
    assert!(outcome.peak_force_n > 2.0 && outcome.peak_force_n <= 12.0);
    assert!(
        outcome.energy_j > 0.01 && outcome.switches > 2,
        "{outcome:?}"
    );
    // what the contact and the detents store, and no more, comes back
    assert!(outcome.least_energy_j > -0.02, "{outcome:?}");

    // a table replaces it, and the other way round
    let nodes = detents(0.05, 0.02);
    let (ack, table) = host.upload(super::support::begin(&nodes), &nodes);
    assert_eq!(ack.refusal, Refusal::None);
    assert_eq!(host.play(8, crc).refusal, Refusal::OtherTable);
    assert_eq!(host.play(8, table).refusal, Refusal::None);
    host.live(ms(100));
    host.stop(8);
    host.live(ms(20));
    let (ack, again) = host.upload_mechanism(begin, &values);
    assert_eq!((ack.refusal, again), (Refusal::None, crc));
}

#[test]
fn what_is_no_passive_mechanism_is_refused() {
    let (good, values) = mechanism(4.0, 1.2);
    let count = values.len() as u32;
    let with = |change: &dyn Fn(&mut MechanismBegin)| {
        let mut begin = good;
        change(&mut begin);
        refused(begin, &values)
    };
    let scalar = |change: &dyn Fn(&mut Scalars)| with(&|begin| change(&mut begin.scalars));
    // no mechanism at all
    let bad = (Refusal::BadTable, count);
    assert_eq!(scalar(&|p| p.follower_kg = 0.0), bad);
    assert_eq!(scalar(&|p| p.contact_n_s_per_mm = -0.01), bad);
    assert_eq!(scalar(&|p| p.gap_mm = f64::NAN), bad);
    assert_eq!(with(&|b| b.detent_mm[1] = 0.0), bad);
    assert_eq!(with(&|b| b.range_mm = [33.5, 1.5]), bad);
    assert_eq!(with(&|b| b.trained_mm_s = f64::INFINITY), bad);
    let mut negative = values.clone();
    negative[67] = -0.5;
    assert_eq!(refused(good, &negative), (Refusal::BadTable, 67));
    negative[3] = f64::NAN;
    assert_eq!(refused(good, &negative), (Refusal::BadTable, 3));
    // limits of the device
    assert_eq!(with(&|b| b.force_n = 15.1), (Refusal::Limit, 1));
    assert_eq!(with(&|b| b.velocity_mm_s = 2000.0), (Refusal::Limit, 2));
    assert_eq!(with(&|b| b.range_mm[1] = 400.0), (Refusal::Limit, 3));
    assert_eq!(scalar(&|p| p.contact_n_per_mm = 500.0), (Refusal::Limit, 4));
    assert_eq!(scalar(&|p| p.handle_n_s_per_mm = 5.0), (Refusal::Limit, 5));
    // F_c rises too steeply from zero
    let mut steep = values.clone();
    steep[65] = 0.0;
    steep[66] = 3.0;
    assert_eq!(refused(good, &steep), (Refusal::Uncertified, 3));
    // armed, it is played with its cap
    let armed = MechanismBegin {
        uncertified_n: Some(2.0),
        ..good
    };
    let mut host = Host::opened(Options::default());
    let (ack, _) = host.upload_mechanism(armed, &steep);
    assert_eq!(ack.refusal, Refusal::None);
    assert_eq!(host.outcome().limit_n, 2.0);
}

#[test]
fn an_upload_out_of_order_or_incomplete_is_refused() {
    let (begin, values) = mechanism(4.0, 1.2);
    let (requests, crc) = mechanism_requests(begin, &values);
    let mut host = Host::opened(Options::default());
    let refusal = |host: &mut Host, request| host.ack(request).refusal;
    assert_eq!(refusal(&mut host, requests[1]), Refusal::WrongState);
    assert_eq!(refusal(&mut host, requests[0]), Refusal::None);
    assert_eq!(refusal(&mut host, requests[2]), Refusal::Order);
    assert_eq!(refusal(&mut host, requests[1]), Refusal::None);
    host.beat();
    let commit = Request::MechanismCommit(Commit { crc });
    assert_eq!(refusal(&mut host, commit), Refusal::Incomplete);
    for request in &requests[2..] {
        assert_eq!(refusal(&mut host, *request), Refusal::None);
    }
    let more = Request::MechanismChunk(MechanismChunk {
        first: values.len() as u16,
        values: study_wire::message::FixedVec::of(&[1.0]),
    });
    assert_eq!(refusal(&mut host, more), Refusal::TooMany);
    host.beat();
    // COMMIT of a table is not that of a mechanism
    assert_eq!(
        refusal(&mut host, Request::TableCommit(Commit { crc })),
        Refusal::WrongState
    );
    let wrong = Request::MechanismCommit(Commit { crc: !crc });
    assert_eq!(refusal(&mut host, wrong), Refusal::Checksum);
    let large = MechanismBegin {
        detents: u16::MAX,
        ..begin
    };
    assert_eq!(
        refusal(&mut host, Request::MechanismBegin(large)),
        Refusal::TooMany
    );
}

/// On a connection of minor version 0 or 1 the messages are unknown, and IDENTITY does not
/// tell of them.
#[test]
fn an_older_host_knows_no_mechanisms() {
    let (begin, values) = mechanism(4.0, 1.2);
    let (requests, crc) = mechanism_requests(begin, &values);
    for minor in [0, 1, 2] {
        let mut host = Host::new(Options::default());
        let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 9, minor })) else {
            panic!("no identity");
        };
        let told = identity.constants.is_some_and(|c| c.features.mechanism);
        assert_eq!(told, minor == 2);
        let bad_before = host.outcome().bad_frames;
        let refusals = [
            host.ack(requests[0]).refusal,
            host.ack(requests[1]).refusal,
            host.ack(Request::MechanismCommit(Commit { crc })).refusal,
        ];
        if minor < 2 {
            assert_eq!(refusals, [Refusal::UnknownType; 3]);
            assert_eq!(host.outcome().bad_frames, bad_before + 3);
        } else {
            assert_eq!(
                refusals,
                [Refusal::None, Refusal::None, Refusal::Incomplete]
            );
        }
        // a table is played as ever
        host.ack(Request::Rearm);
        let nodes = detents(0.05, 0.02);
        assert_eq!(
            host.upload(self::begin(&nodes), &nodes).0.refusal,
            Refusal::None
        );
    }
}
