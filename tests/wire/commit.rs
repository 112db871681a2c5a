//! COMMIT: little work in any servo period, and a host that waits for it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::support::{Host, begin, detents, ms};
use study_base::limits::Limits;
use study_device::Stimulus;
use study_device::firmware::{Firmware, Options};
use study_device::host::{Host as StudyHost, HostSettings};
use study_haptics::model::{Branch, Realization, Trained};
use study_wire::frame::Decoder;
use study_wire::handler::{Bounds, Handler, Measured, Profile};
use study_wire::message::{
    Commit, DeviceState, Fault, Features, FixedVec, Flags, Heartbeat, Hello, Name, Node, Refusal,
    Reply, Request, TableBegin, TableChunk, UploadCrc,
};
use study_wire::predict::{Direction, Lookup, Motion};
use study_wire::servo::ServoSettings;

const NODES: usize = 512;

fn device() -> Box<Handler<NODES, 0>> {
    Box::new(Handler::new(Profile {
        firmware: Name::new("test"),
        serial: Name::new("1"),
        flags: Flags::default(),
        features: Features::default(),
        watchdog_ms: 30,
        longest_ms: 1000,
        telemetry_hz: 1000.0,
        bounds: Bounds {
            force_n: 15.0,
            velocity_mm_s: 1000.0,
            stiffness_n_per_mm: 1e3,
            damping_n_s_per_mm: 1.0,
            stroke_mm: [-20.0, 60.0],
        },
        servo: ServoSettings::default(),
        rest_mm_s: 5.0,
        rest_s: 0.01,
    }))
}

/// A host that sends the next request when the last is answered, over a link that
/// carries `bytes` a servo period.
struct Link {
    device: Box<Handler<NODES, 0>>,
    ticks: u32,
    sequence: u16,
}

impl Link {
    /// The reply, and the nodes that were not judged when the last byte arrived.
    fn ask(&mut self, request: Request, bytes: usize) -> (Reply, usize) {
        self.sequence += 1;
        let frame = request.frame(self.sequence);
        let mut replies = Vec::new();
        let mut unjudged = 0;
        for some in frame.as_bytes().chunks(bytes) {
            let now_ms = self.ticks / 4;
            self.ticks += 1;
            let measured = Measured {
                motion: Motion::at_rest(10.0),
                force_n: None,
            };
            let mut out = |frame: &[u8]| replies.push(frame.to_vec());
            self.device.servo(measured, now_ms, &mut out);
            unjudged = self.device.unjudged();
            self.device.receive(some, now_ms, &mut out);
        }
        let mut decoder = Decoder::new();
        for byte in &replies[0] {
            if let Some(body) = decoder.push(*byte) {
                return (Reply::decode(body.unwrap()).unwrap().1, unjudged);
            }
        }
        panic!("no reply");
    }

    fn done(&mut self, request: Request, bytes: usize) -> usize {
        let (reply, unjudged) = self.ask(request, bytes);
        let good = match reply {
            Reply::Ack(ack) => ack.refusal == Refusal::None,
            _ => true,
        };
        assert!(good, "{reply:?}");
        unjudged
    }
}

#[test]
fn of_512_nodes_at_most_three_are_left_for_commit() {
    // 460,800 baud at 4 kHz, and the most that the example of a firmware takes a period
    for bytes in [12, 32] {
        let mut link = Link {
            device: device(),
            ticks: 0,
            sequence: 0,
        };
        for _ in 0..100 {
            let at_rest = Measured {
                motion: Motion::at_rest(10.0),
                force_n: None,
            };
            link.device.servo(at_rest, 0, &mut |_| {});
        }
        link.done(Request::Hello(Hello { nonce: 1, minor: 1 }), bytes);
        let nodes: Vec<Node> = (0..NODES)
            .map(|i| Node {
                x_mm: 0.05 * i as f64,
                positive: [0.05, 0.02, 0.1, 1.0],
                negative: [0.05, 0.02, 0.1, -1.0],
            })
            .collect();
        let begin = TableBegin {
            range_mm: [0.0, 25.0],
            ..begin(&nodes)
        };
        let mut crc = UploadCrc::of_table(&begin);
        nodes.iter().for_each(|node| crc.node(node));
        link.done(Request::TableBegin(begin), bytes);
        for (i, some) in nodes.chunks(TableChunk::MAX_NODES).enumerate() {
            let chunk = TableChunk {
                first: (i * TableChunk::MAX_NODES) as u16,
                nodes: FixedVec::of(some),
            };
            let unjudged = link.done(Request::TableChunk(chunk), bytes);
            assert!(unjudged <= TableChunk::MAX_NODES, "{i}: {unjudged}");
        }
        let beat = Heartbeat {
            count: 1,
            deadline_ms: link.ticks / 4 + 500,
        };
        link.done(Request::Heartbeat(beat), bytes);
        let commit = Commit { crc: crc.value() };
        let unjudged = link.done(Request::TableCommit(commit), bytes);
        assert!(unjudged <= TableChunk::MAX_NODES, "COMMIT: {unjudged}");
        assert_eq!(link.device.state(), DeviceState::Loaded);
    }
}

#[test]
fn a_missed_period_is_a_fault_only_while_there_is_force() {
    let missed = |device: &mut Handler<NODES, 0>| {
        device.overrun(1, &mut |_| {});
        (device.state(), device.fault())
    };
    let mut fresh = device();
    assert_eq!(missed(&mut fresh), (DeviceState::Boot, Fault::None));

    let mut host = Host::opened(Options::default());
    let nodes = detents(0.05, 0.02);
    host.upload(begin(&nodes), &nodes);
    host.beat();
    host.device.stall(host.at, ms(5));
    host.wait(ms(6));
    assert_eq!(host.device.state(), DeviceState::Loaded);
    let mut host = Host::playing(Options::default(), ms(1000));
    host.device.stall(host.at, ms(5));
    host.wait(ms(6));
    assert_eq!(host.device.state(), DeviceState::Fault);
    assert_eq!(host.device.fault(), Fault::Overrun);
}

fn spring() -> Realization {
    let branch = || Branch {
        m_kg: vec![0.05; 2],
        b_n_s_per_mm: vec![0.01; 2],
        k_n_per_mm: vec![0.1; 2],
        f0_n: vec![0.0; 2],
    };
    Realization {
        id: "spring".to_owned(),
        provenance: Default::default(),
        vaf: Default::default(),
        lookup: Lookup::Linear,
        direction: Direction::Play { delta_mm: 0.5 },
        trained: Trained {
            x_mm: [0.0, 30.0],
            v_mm_s: 138.0,
        },
        x_mm: vec![0.0, 30.0],
        positive: branch(),
        negative: branch(),
        mechanism: None,
        elements: None,
        units: study_haptics::model::Units::Linear,
    }
}

/// The reply to COMMIT is lost; the host repeats it after the time that the device states.
#[test]
fn the_host_waits_as_long_as_the_device_needs_for_commit() {
    for (commit_ms, expected_ms) in [(50, 100), (300, 350), (u16::MAX, 1050)] {
        let settings = HostSettings {
            supervision_timeout: None,
            ..HostSettings::default()
        };
        let mut device = Firmware::new(Options::default());
        let mut host = StudyHost::new(7, settings);
        let mut commits = Vec::new();
        host.connected(ms(0));
        let mut requests = Decoder::new();
        for at in 0..2000 {
            device.advance(ms(at));
            for byte in host.take_output() {
                if let Some(Ok(body)) = requests.push(byte) {
                    let (header, request) = Request::decode(body).unwrap();
                    match request {
                        Request::TableCommit(_) => commits.push(at),
                        _ => device.receive(request.frame(header.sequence).as_bytes(), ms(at)),
                    }
                }
            }
            let mut replies = Decoder::new();
            for byte in device.take_output() {
                if let Some(Ok(body)) = replies.push(byte) {
                    let (header, mut reply) = Reply::decode(body).unwrap();
                    if let Reply::Identity(identity) = &mut reply {
                        identity.constants.as_mut().unwrap().commit_ms = commit_ms;
                    }
                    host.receive(reply.frame(header.sequence).as_bytes(), ms(at));
                }
            }
            if at == 200 {
                let table = spring();
                let limits = Limits::new(9.0, 500.0).unwrap();
                host.load(&Stimulus::of_table(&table), limits, ms(at))
                    .unwrap();
            }
            host.advance(ms(at));
        }
        assert_eq!(commits[1] - commits[0], expected_ms, "{commit_ms}");
    }
}
