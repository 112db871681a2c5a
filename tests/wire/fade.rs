//! The end of a playback with a force that falls: its course, what ends it at once, and hosts and
//! devices that do not know it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::support::{Host, begin, detents, ms};
use std::time::Duration;
use study_base::limits::Limits;
use study_device::firmware::{Firmware, Options};
use study_device::host::{Host as StudyHost, HostSettings};
use study_device::{Report, Stimulus};
use study_haptics::model::file;
use study_wire::frame::Decoder;
use study_wire::message::{
    Commit, DeviceState, Event, EventKind, Fault, FixedVec, Hello, PathBegin, PathChunk, Record,
    Refusal, Reply, Request, Stop, TelemetrySample, UploadCrc, fixed,
};

/// Half a cosine over 0.4 s at 4 kHz, as the ramp.
const PERIODS: u32 = 1600;
/// 2 N/ms at 4 kHz.
const SLEW_N: f64 = 0.5;

fn fade(playback: u32) -> Request {
    Request::Fade(Stop { playback })
}

fn samples(host: &Host) -> Vec<TelemetrySample> {
    let batches = host.heard.iter().filter_map(|reply| match reply {
        Reply::Telemetry(telemetry) => Some(telemetry.samples.as_slice().to_vec()),
        _ => None,
    });
    batches.flatten().collect()
}

fn last_event(host: &Host) -> Event {
    let mut events = host.heard.iter().filter_map(|reply| match reply {
        Reply::Event(event) => Some(*event),
        _ => None,
    });
    events.next_back().unwrap()
}

/// A device that pushes with 3 N or more, so that a step of its force would show.
fn pushing() -> Host {
    let mut host = Host::playing(Options::default(), ms(1200));
    while host.device.held_n().abs() < 3.0 {
        host.live(ms(10));
    }
    host
}

#[test]
fn the_force_falls_and_the_playback_ends() {
    let mut host = pushing();
    let before = host.outcome().ticks;
    let ack = host.ack(fade(7));
    assert_eq!((ack.refusal, ack.state), (Refusal::None, DeviceState::Run));
    let held_n = host.device.held_n();
    assert!(held_n.abs() >= 3.0, "nothing falls at once: {held_n}");
    host.live(ms(200));
    assert_eq!(host.device.state(), DeviceState::Run);
    // Another one, and the same frame again, begin nothing anew.
    assert_eq!(host.ack(fade(7)).refusal, Refusal::None);
    host.live(ms(210));
    assert_eq!(host.device.state(), DeviceState::Loaded);
    assert_eq!(host.device.held_n(), 0.0);
    let outcome = host.outcome();
    assert_eq!(outcome.ticks, before + PERIODS);
    assert_eq!((outcome.fault, outcome.playback), (Fault::None, 7));
    let event = last_event(&host);
    assert_eq!(
        (event.kind, event.tick),
        (EventKind::Stopped, outcome.ticks)
    );
    // Sampled every ms, four periods: what the hand does is within the slew limit, too.
    let all = samples(&host);
    assert_eq!(all.len() as u32, outcome.samples);
    let force_n: Vec<f64> = all.iter().map(|s| fixed::from_un(s.command_un)).collect();
    let largest_n = (force_n.windows(2).map(|w| (w[1] - w[0]).abs())).fold(0.0, f64::max);
    assert!(largest_n <= 4.0 * SLEW_N + 0.05, "{largest_n}");
    // The last sample is taken at most four periods before the end.
    let last_n = force_n.last().unwrap().abs();
    assert!(last_n < 1e-3, "{last_n}");
    // It plays again from the start.
    assert_eq!(host.play(8, outcome.crc).refusal, Refusal::None);
    host.live(ms(1000));
    assert_eq!(host.device.state(), DeviceState::Run);
}

/// In the middle of the ramp both factors apply, and the state goes on to run.
#[test]
fn a_force_that_still_rises_falls_as_well() {
    let mut host = Host::playing(Options::default(), ms(200));
    assert_eq!(host.device.state(), DeviceState::Ramp);
    let ack = host.ack(fade(7));
    assert_eq!((ack.refusal, ack.state), (Refusal::None, DeviceState::Ramp));
    host.live(ms(300));
    assert_eq!(host.device.state(), DeviceState::Run);
    host.live(ms(110));
    assert_eq!(host.device.state(), DeviceState::Loaded);
}

/// What switches the force off at once does so during a fall.
#[test]
fn a_fall_is_ended_at_once_by_all_that_ends_a_playback() {
    let falling = || {
        let mut host = pushing();
        host.ack(fade(7));
        host.live(ms(20));
        while host.device.held_n().abs() < 0.5 {
            host.live(ms(10));
            assert_eq!(host.device.state(), DeviceState::Run);
        }
        host
    };
    let mut host = falling();
    let ack = host.stop(7);
    assert_eq!(ack.state, DeviceState::Stopping);
    assert_eq!(host.device.held_n(), 0.0);

    let mut host = falling();
    host.ask(Request::Limp);
    assert_eq!(host.device.held_n(), 0.0);
    assert_eq!(host.device.state(), DeviceState::Limp);

    let mut host = falling();
    host.device.trip(Fault::External, host.at);
    assert_eq!(host.device.held_n(), 0.0);
    assert_eq!(host.device.fault(), Fault::External);

    // The last heartbeat came at most 10 ms ago.
    let mut host = falling();
    host.wait(ms(31));
    assert_eq!(host.device.held_n(), 0.0);
    assert_eq!(host.device.state(), DeviceState::Limp);
    assert_eq!(host.device.fault(), Fault::Watchdog);
}

#[test]
fn a_fall_is_refused_where_nothing_can_fall() {
    let mut host = Host::opened(Options::default());
    assert_eq!(host.ack(fade(7)).refusal, Refusal::OtherPlayback);
    let mut host = Host::playing(Options::default(), ms(500));
    let other = host.ack(fade(6));
    assert_eq!((other.refusal, other.detail), (Refusal::OtherPlayback, 7));
    assert_eq!(host.ack(fade(0)).refusal, Refusal::OtherPlayback);
    host.stop(7);
    host.live(ms(20));
    // It has ended: acknowledged, as STOP is.
    assert_eq!(host.ack(fade(7)).refusal, Refusal::None);
    assert_eq!(host.device.state(), DeviceState::Loaded);

    let begin = PathBegin {
        points: 50,
        rate_hz: 100.0,
        force_n: 12.0,
        velocity_mm_s: 1000.0,
    };
    let mut crc = UploadCrc::of_path(&begin);
    let x_nm = [17_500_000; 50];
    x_nm.iter().for_each(|x| crc.point(*x));
    let crc = crc.value();
    assert_eq!(host.ack(Request::PathBegin(begin)).refusal, Refusal::None);
    let points = Request::PathChunk(PathChunk {
        first: 0,
        x_nm: FixedVec::of(&x_nm),
    });
    assert_eq!(host.ack(points).refusal, Refusal::None);
    host.beat();
    let commit = Request::PathCommit(Commit { crc });
    assert_eq!(host.ack(commit).refusal, Refusal::None);
    let record = Request::Record(Record { playback: 9, crc });
    assert_eq!(host.ack(record).refusal, Refusal::None);
    let ack = host.ack(fade(9));
    assert_eq!(
        (ack.refusal, ack.state),
        (Refusal::WrongState, DeviceState::Ramp)
    );
}

/// On a connection of an older minor version the message is unknown, and IDENTITY does not tell
/// of it.
#[test]
fn an_older_host_knows_no_fall() {
    let nodes = detents(0.05, 0.02);
    for minor in [0, 1, 2, 3] {
        let mut host = Host::opened(Options::default());
        let Reply::Identity(identity) = host.ask(Request::Hello(Hello { nonce: 9, minor })) else {
            panic!("no identity");
        };
        let told = identity.constants.is_some_and(|c| c.features.fade);
        assert_eq!(told, minor == 3);
        let (ack, crc) = host.upload(begin(&nodes), &nodes);
        assert_eq!(ack.refusal, Refusal::None);
        assert_eq!(host.play(7, crc).refusal, Refusal::None);
        host.live(ms(500));
        let expected = match told {
            true => Refusal::None,
            false => Refusal::UnknownType,
        };
        assert_eq!(host.ack(fade(7)).refusal, expected);
        host.live(ms(410));
        let ended = host.device.state() == DeviceState::Loaded;
        assert_eq!(ended, told);
    }
}

/// A host and a device, of which the device reads HELLO as one of this minor version.
struct Pair {
    host: StudyHost,
    device: Firmware,
    minor: u8,
    decoder: Decoder,
    now: Duration,
    /// Requests to end a playback.
    ends: Vec<Request>,
    reports: Vec<Report>,
}

impl Pair {
    fn new(minor: u8) -> Self {
        Self::of(minor, Options::default())
    }

    fn of(minor: u8, options: Options) -> Self {
        let settings = HostSettings {
            supervision_timeout: None,
            ..HostSettings::default()
        };
        let mut host = StudyHost::new(7, settings);
        host.connected(ms(0));
        let mut pair = Self {
            host,
            device: Firmware::new(options),
            minor,
            decoder: Decoder::new(),
            now: ms(0),
            ends: Vec::new(),
            reports: Vec::new(),
        };
        pair.pass(20);
        pair
    }

    /// Lets so many milliseconds pass.
    fn pass(&mut self, times: u32) {
        for _ in 0..times {
            self.now += ms(1);
            for byte in self.host.take_output() {
                let Some(Ok(body)) = self.decoder.push(byte) else {
                    continue;
                };
                let (header, request) = Request::decode(body).unwrap();
                let request = match request {
                    Request::Hello(hello) => Request::Hello(Hello {
                        minor: self.minor,
                        ..hello
                    }),
                    Request::Stop(_) | Request::Fade(_) => {
                        self.ends.push(request);
                        request
                    }
                    other => other,
                };
                let frame = request.frame(header.sequence);
                self.device.receive(frame.as_bytes(), self.now);
            }
            self.device.advance(self.now);
            self.host.receive(&self.device.take_output(), self.now);
            self.host.advance(self.now);
            self.reports.extend(self.host.take_reports());
        }
    }

    fn faded_from_s(&self) -> Option<f64> {
        self.reports.iter().find_map(|report| match report {
            Report::Faded { from_s } => Some(*from_s),
            _ => None,
        })
    }

    fn stopped_s(&self) -> Option<f64> {
        self.reports.iter().find_map(|report| match report {
            Report::Stopped(playback) => Some(playback.exploration_s),
            _ => None,
        })
    }

    /// Plays a second of a shipped table.
    fn plays(&mut self) {
        self.plays_up_to(12.0);
    }

    /// The same with a force limit.
    fn plays_up_to(&mut self, force_n: f64) {
        let path = "protocols/turn-signal-passive/models/passive.toml";
        let text = std::fs::read_to_string(path).unwrap();
        let table = file::parse(path, &text).0.unwrap();
        let limits = Limits::new(force_n, 1000.0).unwrap();
        let what = Stimulus::of_table(&table);
        self.host.load(&what, limits, self.now).unwrap();
        self.pass(500);
        self.host.start(self.now).unwrap();
        self.pass(1000);
        assert!(self.reports.contains(&Report::Started));
    }
}

#[test]
fn a_host_lets_the_force_fall_and_knows_from_when() {
    let mut pair = Pair::new(3);
    pair.plays();
    pair.host.fade(pair.now).unwrap();
    pair.host.fade(pair.now).unwrap();
    pair.pass(450);
    assert!(
        matches!(pair.ends[..], [Request::Fade(_)]),
        "{:?}",
        pair.ends
    );
    let (from_s, stopped_s) = (pair.faded_from_s().unwrap(), pair.stopped_s().unwrap());
    assert!(
        (stopped_s - from_s - 0.4).abs() < 1e-9,
        "{from_s} {stopped_s}"
    );
    // Between the request and its arrival.
    assert!((0.99..1.01).contains(&from_s), "{from_s}");

    // A stop meanwhile is a stop, and nothing is said of a fall that had no end.
    let mut pair = Pair::new(3);
    pair.plays();
    pair.host.fade(pair.now).unwrap();
    pair.pass(100);
    pair.host.stop(pair.now).unwrap();
    pair.pass(20);
    assert_eq!(pair.device.held_n(), 0.0);
    assert!(pair.stopped_s().is_some_and(|s| s < 1.2));
    assert_eq!(pair.faded_from_s(), None);
}

#[test]
fn a_device_of_an_older_minor_version_is_stopped_as_ever() {
    for minor in [1, 2] {
        let mut pair = Pair::new(minor);
        pair.plays();
        pair.host.fade(pair.now).unwrap();
        pair.pass(20);
        assert!(
            matches!(pair.ends[..], [Request::Stop(_)]),
            "{:?}",
            pair.ends
        );
        assert_eq!(pair.device.held_n(), 0.0);
        assert!(pair.stopped_s().is_some_and(|s| s < 1.05));
        assert_eq!(pair.faded_from_s(), None);
    }
}

/// From 2000 N a fall within the slew limit of 2 N/ms takes π/2 · 1 s, for which no session waits. What counts
/// is the limit of what is loaded, not that of the device.
#[test]
fn a_fall_that_takes_too_long_is_a_stop() {
    let strong = || Options {
        limits: Limits::new(2000.0, 1000.0).unwrap(),
        ..Options::default()
    };
    let mut pair = Pair::of(3, strong());
    pair.plays_up_to(2000.0);
    pair.host.fade(pair.now).unwrap();
    pair.pass(20);
    assert!(
        matches!(pair.ends[..], [Request::Stop(_)]),
        "{:?}",
        pair.ends
    );
    assert_eq!(pair.device.held_n(), 0.0);
    assert_eq!(pair.faded_from_s(), None);

    let mut pair = Pair::of(3, strong());
    pair.plays();
    pair.host.fade(pair.now).unwrap();
    pair.pass(450);
    assert!(
        matches!(pair.ends[..], [Request::Fade(_)]),
        "{:?}",
        pair.ends
    );
    assert!(pair.faded_from_s().is_some());
}
