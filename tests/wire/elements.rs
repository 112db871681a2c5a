//! Elements on a device: upload, certificate, refusals, and hosts and devices that do not know
//! them.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::support::{Host, begin, detents, ms};
use study_base::limits::Limits;
use study_device::Stimulus;
use study_device::firmware::{Firmware, Options};
use study_device::host::{Host as StudyHost, HostSettings};
use study_haptics::model::{Elements, Provenance, Realization, Trained};
use study_wire::elements::Spring;
use study_wire::frame::Decoder;
use study_wire::message::{
    Commit, DeviceState, ElementsBegin, FixedVec, Hello, Loaded, Node, Refusal, Reply, Request,
    TableChunk, UploadCrc,
};

const NODES: usize = 33;

/// Three detents with friction, a branch that relaxes and a latch in the middle.
fn elements(detent_n: f64) -> (ElementsBegin, Vec<Node>) {
    let springs = [
        Spring::Stop { slip_mm: 0.3 },
        Spring::Maxwell {
            slip_mm: 5.0,
            relaxation_s: 0.05,
        },
        Spring::Latch {
            rearm_mm: 15.0,
            break_mm: 18.0,
        },
    ];
    let begin = ElementsBegin {
        nodes: NODES as u16,
        mass_kg: 0.05,
        range_mm: [1.5, 33.5],
        trained_mm_s: 138.0,
        force_n: 12.0,
        velocity_mm_s: 1000.0,
        uncertified_n: None,
        springs: FixedVec::of(&springs),
    };
    let node = |i: usize| {
        let x_mm = 1.5 + i as f64;
        let spring_n = detent_n * libm::sin((x_mm - 5.0) / 12.5 * std::f64::consts::TAU);
        Node::of_elements(x_mm, [spring_n, 0.01, 0.012, 1.0, 2.0, 0.8, 0.0, 0.0])
    };
    (begin, (0..NODES).map(node).collect())
}

/// ELEMENTS_BEGIN, all chunks and COMMIT, and the CRC.
fn requests(begin: ElementsBegin, nodes: &[Node]) -> (Vec<Request>, u32) {
    let mut crc = UploadCrc::of_elements(&begin);
    nodes.iter().for_each(|node| crc.node(node));
    let crc = crc.value();
    let chunks = nodes.chunks(TableChunk::MAX_NODES).enumerate();
    let chunk = |(i, some)| {
        Request::TableChunk(TableChunk {
            first: (i * TableChunk::MAX_NODES) as u16,
            nodes: FixedVec::of(some),
        })
    };
    let mut all = vec![Request::ElementsBegin(begin)];
    all.extend(chunks.map(chunk));
    all.push(Request::TableCommit(Commit { crc }));
    (all, crc)
}

/// The first refusal of an upload, with its detail.
fn upload(host: &mut Host, begin: ElementsBegin, nodes: &[Node]) -> (Refusal, u32) {
    for request in requests(begin, nodes).0 {
        host.beat();
        let ack = host.ack(request);
        if ack.refusal != Refusal::None {
            return (ack.refusal, ack.detail);
        }
    }
    (Refusal::None, 0)
}

#[test]
fn elements_are_loaded_and_played_and_replaced() {
    let mut host = Host::opened(Options::default());
    let (begun, nodes) = elements(4.0);
    let crc = requests(begun, &nodes).1;
    assert_eq!(upload(&mut host, begun, &nodes), (Refusal::None, 0));
    assert_eq!(host.outcome().state, DeviceState::Loaded);
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
    // what the springs store, and no more, comes back
    assert!(outcome.least_energy_j > -0.02, "{outcome:?}");

    // a table replaces them: its nodes are parameters again
    let table = detents(0.05, 0.02);
    let (ack, table_crc) = host.upload(begin(&table), &table);
    assert_eq!(ack.refusal, Refusal::None);
    assert_eq!(host.play(8, crc).refusal, Refusal::OtherTable);
    assert_eq!(host.play(8, table_crc).refusal, Refusal::None);
    host.live(ms(100));
    host.stop(8);
    host.live(ms(20));
    assert_eq!(upload(&mut host, begun, &nodes), (Refusal::None, 0));
}

#[test]
fn what_are_no_passive_elements_is_refused() {
    let (good, nodes) = elements(4.0);
    let with = |change: &dyn Fn(&mut ElementsBegin, &mut [Node])| {
        let (mut begin, mut nodes) = (good, nodes.clone());
        change(&mut begin, &mut nodes);
        upload(&mut Host::opened(Options::default()), begin, &nodes)
    };
    let spring = |spring: Spring| with(&|begin, _| begin.springs = FixedVec::of(&[spring]));
    let bad = (Refusal::BadTable, NODES as u32);
    assert_eq!(spring(Spring::Stop { slip_mm: 0.0 }), bad);
    assert_eq!(spring(Spring::Stop { slip_mm: f64::NAN }), bad);
    let none = Spring::Maxwell {
        slip_mm: 1.0,
        relaxation_s: 0.0,
    };
    assert_eq!(spring(none), bad);
    let reversed = Spring::Latch {
        rearm_mm: 18.0,
        break_mm: 15.0,
    };
    assert_eq!(spring(reversed), bad);
    assert_eq!(with(&|b, _| b.mass_kg = f64::NAN), bad);
    assert_eq!(with(&|b, _| b.range_mm = [33.5, 1.5]), bad);
    assert_eq!(with(&|b, _| b.trained_mm_s = 0.0), bad);
    let not_finite = with(&|_, nodes| nodes[4].negative[3] = f64::INFINITY);
    assert_eq!(not_finite, (Refusal::BadTable, 4));
    // limits of the device
    assert_eq!(with(&|b, _| b.force_n = 15.1), (Refusal::Limit, 1));
    assert_eq!(with(&|b, _| b.velocity_mm_s = 2000.0), (Refusal::Limit, 2));
    assert_eq!(with(&|b, _| b.range_mm[1] = 400.0), (Refusal::Limit, 3));
    // 1 N over 1 µm, and 5 N·s/mm
    assert_eq!(spring(Spring::Stop { slip_mm: 1e-3 }), (Refusal::Limit, 4));
    assert_eq!(with(&|_, n| n[3].positive[1] = 5.0), (Refusal::Limit, 5));
    // what could supply energy
    assert_eq!(with(&|b, _| b.mass_kg = -0.01), (Refusal::Uncertified, 1));
    assert_eq!(
        with(&|_, n| n[3].positive[2] = -0.01),
        (Refusal::Uncertified, 2)
    );
    assert_eq!(
        with(&|_, n| n[3].negative[0] = -0.01),
        (Refusal::Uncertified, 3)
    );
    let narrow = Spring::Latch {
        rearm_mm: 15.0,
        break_mm: 15.05,
    };
    assert_eq!(spring(narrow), (Refusal::Uncertified, 3));
    // armed, they are played with their cap
    let armed = ElementsBegin {
        uncertified_n: Some(2.0),
        springs: FixedVec::of(&[narrow]),
        ..good
    };
    let mut host = Host::opened(Options::default());
    assert_eq!(upload(&mut host, armed, &nodes), (Refusal::None, 0));
    assert_eq!(host.outcome().limit_n, 2.0);
}

/// On a connection of minor version 0 or 1 the message is unknown, and IDENTITY does not tell of
/// it.
#[test]
fn an_older_host_knows_no_elements() {
    let (begun, nodes) = elements(4.0);
    for minor in [0, 1, 2] {
        let mut host = Host::new(Options::default());
        let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 9, minor })) else {
            panic!("no identity");
        };
        let told = identity.constants.is_some_and(|c| c.features.elements);
        assert_eq!(told, minor == 2);
        let expected = if minor < 2 {
            Refusal::UnknownType
        } else {
            Refusal::None
        };
        assert_eq!(upload(&mut host, begun, &nodes).0, expected);
        // a table is played as ever
        let table = detents(0.05, 0.02);
        let (ack, _) = host.upload(begin(&table), &table);
        assert_eq!(ack.refusal, Refusal::None);
    }
}

/// A device of minor version 1 is not sent elements: the host refuses them with words.
#[test]
fn a_device_of_minor_version_1_gets_no_elements() {
    let mut device = Firmware::new(Options::default());
    let mut host = StudyHost::new(7, HostSettings::default());
    host.connected(ms(0));
    let mut decoder = Decoder::new();
    for byte in host.take_output() {
        let Some(Ok(body)) = decoder.push(byte) else {
            continue;
        };
        let (header, request) = Request::decode(body).unwrap();
        // what it reads of the host's HELLO
        let request = match request {
            Request::Hello(hello) => Request::Hello(Hello { minor: 1, ..hello }),
            other => other,
        };
        device.receive(request.frame(header.sequence).as_bytes(), ms(0));
    }
    host.receive(&device.take_output(), ms(0));
    assert!(!host.identity().unwrap().elements);
    let elements = Elements {
        x_mm: vec![1.0, 30.0],
        force_n: vec![0.0, 2.0],
        damping_n_s_per_mm: [vec![0.01; 2], vec![0.01; 2]],
        ..Elements::default()
    };
    let trained = Trained {
        x_mm: [1.0, 30.0],
        v_mm_s: 100.0,
    };
    let vaf = std::collections::BTreeMap::new();
    let one = Realization::of_elements("e".into(), Provenance::default(), vaf, trained, elements);
    let limits = Limits::new(12.0, 1000.0).unwrap();
    let refused = host.load(&Stimulus::of_table(&one), limits, ms(1));
    let text = refused.unwrap_err().to_string();
    assert!(
        text.contains("is made of elements, which this device does not play"),
        "{text}"
    );
    assert!(host.take_output().is_empty(), "nothing was sent");
}
