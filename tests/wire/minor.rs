//! The minor version: hosts and devices of minor versions 0 and 1 work together.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::support::{Host, ms};
use std::time::Duration;
use study_base::limits::Limits;
use study_device::firmware::{Firmware, Options};
use study_device::host::{Host as StudyHost, HostSettings};
use study_device::{Report, Stimulus};
use study_haptics::model::file;
use study_wire::frame::Decoder;
use study_wire::message::{
    Ack, Constants, DeviceState, Fault, Header, Hello, Identity, MINOR, Refusal, Reply, Request,
    kind,
};

fn identity(minor: u8) -> Identity {
    let mut host = Host::new(Options::default());
    match host.ask(Request::Hello(Hello { nonce: 1, minor })) {
        Reply::Identity(identity) => identity,
        other => panic!("{other:?}"),
    }
}

#[test]
fn only_a_host_that_asks_is_told_the_constants() {
    let old = identity(0);
    assert_eq!(old.constants, None);
    let new = identity(1);
    let told = new.constants.unwrap();
    let expected = Constants {
        minor: 1,
        acceleration_hz: 20.0,
        least_mass_kg: Options::default().least_mass_kg,
        damping_n_s_per_mm: 0.002,
        wall_n_per_mm: 10.0,
        wall_n_s_per_mm: 0.01,
        overtravel_mm: 2.5,
        jump_mm: 1.0,
        slew_n_s: 2000.0,
        ramp_s: 0.4,
        ..told
    };
    assert_eq!(told, expected);
    let without = Identity {
        constants: None,
        ..new
    };
    assert_eq!(without, old);
}

#[test]
fn the_lower_minor_version_of_both_sides_is_used() {
    for asked in [MINOR, MINOR + 1, u8::MAX] {
        assert_eq!(identity(asked).constants.unwrap().minor, MINOR);
    }
}

/// A device of minor version 0 refuses what minor version 1 added.
struct OldDevice {
    device: Firmware,
    decoder: Decoder,
    refused: usize,
}

impl OldDevice {
    fn receive(&mut self, bytes: &[u8], at: Duration) -> Vec<u8> {
        let mut out = Vec::new();
        for byte in bytes {
            let Some(Ok(body)) = self.decoder.push(*byte) else {
                continue;
            };
            let header = Header::read(body).unwrap();
            if header.kind == kind::HELLO && body.len() != 8 {
                self.refused += 1;
                let ack = Reply::Ack(Ack {
                    request: kind::HELLO,
                    refusal: Refusal::Malformed,
                    state: DeviceState::Boot,
                    fault: Fault::None,
                    clock_ms: 0,
                    detail: 0,
                });
                out.extend_from_slice(ack.frame(header.sequence).as_bytes());
            } else {
                let (_, request) = Request::decode(body).unwrap();
                let frame = request.frame(header.sequence);
                self.device.receive(frame.as_bytes(), at);
                out.extend(self.device.take_output());
            }
        }
        out
    }
}

#[test]
fn a_device_of_minor_version_0_is_asked_again_and_plays() {
    let mut old = OldDevice {
        device: Firmware::new(Options::default()),
        decoder: Decoder::new(),
        refused: 0,
    };
    let settings = HostSettings {
        supervision_timeout: None,
        ..HostSettings::default()
    };
    let mut host = StudyHost::new(7, settings);
    host.connected(ms(0));
    for at in 0..20 {
        let answer = old.receive(&host.take_output(), ms(at));
        host.receive(&answer, ms(at));
        host.advance(ms(at));
    }
    assert_eq!(old.refused, 1);
    assert!(matches!(host.take_reports()[..], [Report::Ready]));
    assert_eq!(host.device().unwrap().constants, None);
    assert_eq!(host.health().repeats, 0, "it was not waited for");
}

/// A device of minor version 1 plays tables as ever and is not sent a mechanism.
#[test]
fn a_device_of_minor_version_1_gets_no_mechanism() {
    let mut device = Firmware::new(Options::default());
    let settings = HostSettings {
        supervision_timeout: None,
        ..HostSettings::default()
    };
    let mut host = StudyHost::new(7, settings);
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
    assert_eq!(host.device().unwrap().constants.unwrap().minor, 1);
    assert!(!host.identity().unwrap().mechanisms);
    let path = "protocols/turn-signal-passive/models/mechanism.toml";
    let text = std::fs::read_to_string(path).unwrap();
    let mechanism = file::parse(path, &text).0.unwrap();
    let limits = Limits::new(12.0, 1000.0).unwrap();
    let refused = host.load(&Stimulus::of_table(&mechanism), limits, ms(1));
    let text = refused.unwrap_err().to_string();
    assert!(
        text.contains("is a mechanism, and this device plays tables only"),
        "{text}"
    );
    assert!(host.take_output().is_empty(), "nothing was sent");
}

#[test]
fn a_device_of_minor_version_1_tells_the_host_its_constants() {
    let mut device = Firmware::new(Options::default());
    let mut host = StudyHost::new(7, HostSettings::default());
    host.connected(ms(0));
    device.receive(&host.take_output(), ms(0));
    host.receive(&device.take_output(), ms(0));
    let constants = host.device().unwrap().constants.unwrap();
    assert_eq!(constants.minor, MINOR);
    assert_eq!(constants.slew_n_s, 2000.0);
}
