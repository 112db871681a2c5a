//! Time limits of the safety measures in virtual time, with host and simulated device on
//! a line with a latency of half a millisecond.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::tables;
use std::cell::Cell;
use std::time::Duration;
use study_base::limits::{Limit, Limits};
use study_device::firmware::{Firmware, Options};
use study_device::host::{Host, HostSettings, SUPERVISION_TIMEOUT};
use study_device::link::memory::{Line, Noise};
use study_device::{Report, Stimulus};
use study_haptics::model::Realization;
use study_wire::frame::Decoder;
use study_wire::message::{DeviceState, Fault, Request};

const TICK: Duration = Duration::from_micros(250);

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn limits() -> Limits {
    Limits {
        force_n: Limit::new(12.0).unwrap(),
        velocity_mm_s: Limit::new(1000.0).unwrap(),
    }
}

/// A constant force of 3 N.
fn table() -> Realization {
    let (nodes, terms) = (tables::coarse(), [0.0, 0.005, 0.0]);
    tables::table("push", nodes, terms, |_, _| 3.0, tables::PLAY)
}

/// Host, line and device. Flags say which parts are running.
struct Bench {
    host: Host,
    firmware: Firmware,
    there: Line,
    back: Line,
    now: Duration,
    /// Whether the host's process runs.
    runs: bool,
    /// Whether the user interface polls.
    screen: bool,
    heard: Vec<Report>,
    /// Bytes that the host has sent.
    sent: Vec<u8>,
}

impl Bench {
    fn new(noise: Noise, seed: u64, watchdog_ms: u16) -> Self {
        let line = |name| Line::new(2 * TICK, noise, seed, name);
        let firmware = Firmware::new(Options {
            seed,
            watchdog_ms,
            // the clock wraps during the playback
            clock_ms: u32::MAX - 3000,
            ..Options::default()
        });
        let mut bench = Self {
            host: Host::new(1, HostSettings::default()),
            firmware,
            there: line("there"),
            back: line("back"),
            now: ms(0),
            runs: true,
            screen: true,
            heard: Vec::new(),
            sent: Vec::new(),
        };
        bench.pass(ms(200));
        bench.host.connected(bench.now);
        bench.pass(ms(300));
        bench
    }

    fn step(&mut self) {
        self.now += TICK;
        let came = self.there.arrived(self.now);
        self.firmware.receive(&came, self.now);
        self.back.send(self.firmware.take_output(), self.now);
        // the bytes for a host that does not run stay in the driver
        if self.runs {
            let came = self.back.arrived(self.now);
            if self.screen {
                self.host.keep_alive(self.now);
            }
            self.host.receive(&came, self.now);
            self.host.advance(self.now);
            let output = self.host.take_output();
            self.sent.extend_from_slice(&output);
            self.there.send(output, self.now);
            self.heard.extend(self.host.take_reports());
        }
    }

    fn pass(&mut self, time: Duration) {
        let until = self.now + time;
        while self.now < until {
            self.step();
        }
    }

    fn until(&mut self, what: &str, fine: impl Fn(&Report) -> bool) {
        let until = self.now + ms(10_000);
        while !self.heard.iter().any(&fine) {
            assert!(self.now < until, "no {what}: {:?}", self.heard);
            self.step();
        }
        self.heard.clear();
    }

    fn load(&mut self) {
        let table = table();
        let loaded = self
            .host
            .load(&Stimulus::of_table(&table), limits(), self.now);
        loaded.unwrap();
    }

    fn play(&mut self) {
        self.load();
        self.until("table", |r| *r == Report::Loaded);
        self.host.start(self.now).unwrap();
        self.until("start", |r| *r == Report::Started);
        self.pass(ms(700));
        assert!(
            self.firmware.held_n().abs() > 1.0,
            "there is no force to lose"
        );
    }

    /// Time from now to zero force.
    fn zero_after(&mut self) -> Duration {
        let from = self.now;
        while self.firmware.held_n() != 0.0 {
            assert!(self.now - from < ms(5000), "the force stays");
            self.step();
        }
        self.now - from
    }

    /// The force stays zero until a new start.
    fn latched(&mut self) {
        for _ in 0..4000 {
            self.step();
            assert_eq!(self.firmware.held_n(), 0.0);
        }
    }
}

/// Every phase of the 10 ms between two heartbeats, and of a tick.
fn phases() -> impl Iterator<Item = Duration> {
    (0..44).map(|n| TICK * n)
}

#[test]
fn the_force_is_zero_50_ms_after_the_host_is_killed() {
    let mut worst = Duration::ZERO;
    for phase in phases() {
        let mut bench = Bench::new(Noise::default(), 1, 30);
        bench.play();
        bench.pass(phase);
        bench.runs = false;
        worst = worst.max(bench.zero_after());
        assert_eq!(bench.firmware.fault(), Fault::Watchdog);
        bench.latched();
    }
    assert!(worst <= ms(50), "{worst:?}");
    // not at once either, because the heartbeats keep the device alive
    assert!(worst >= ms(20), "{worst:?}");
}

/// After the host is continued, heartbeats that waited in the driver have no effect.
#[test]
fn a_playback_does_not_resume_when_a_stopped_host_continues() {
    for phase in phases().step_by(7) {
        let mut bench = Bench::new(Noise::default(), 2, 30);
        bench.play();
        bench.pass(phase);
        bench.runs = false;
        assert!(bench.zero_after() <= ms(50));
        bench.pass(ms(300));
        bench.runs = true;
        bench.until("fault", |r| matches!(r, Report::Fault(_)));
        bench.latched();
        assert_ne!(bench.firmware.state(), DeviceState::Run);
        bench.play();
    }
}

#[test]
fn the_force_is_zero_150_ms_after_the_screen_stalls() {
    let mut worst = Duration::ZERO;
    for phase in phases() {
        let mut bench = Bench::new(Noise::default(), 3, 30);
        bench.play();
        bench.pass(phase);
        bench.screen = false;
        worst = worst.max(bench.zero_after());
        bench.screen = true;
        bench.latched();
        let told = bench
            .heard
            .iter()
            .any(|r| matches!(r, Report::Fault(why) if why.contains("screen stood still for 1")));
        assert!(told, "{:?}", bench.heard);
    }
    assert!(worst <= ms(150), "{worst:?}");
    assert!(
        worst >= SUPERVISION_TIMEOUT,
        "a screen may take its time: {worst:?}"
    );
}

/// At any time from the load to long after the stop: zero force in time, no unconfirmed
/// outcome, and the device is usable afterwards.
#[test]
fn the_cable_can_be_unplugged_at_any_time() {
    for pulled in (0..1500).step_by(9).map(ms) {
        let mut bench = Bench::new(Noise::default(), 4, 30);
        let begin = bench.now;
        bench.load();
        let mut played = false;
        let mut stopped = false;
        while bench.now - begin < pulled {
            bench.step();
            if !played && bench.heard.contains(&Report::Loaded) {
                played = true;
                bench.host.start(bench.now).unwrap();
            }
            if played && !stopped && bench.now - begin > ms(1000) {
                stopped = true;
                bench.host.stop(bench.now).unwrap();
            }
        }
        let confirmed = bench.heard.iter().any(|r| matches!(r, Report::Stopped(_)));
        bench.heard.clear();
        bench.host.disconnected("unplugged");
        bench.there.set_dead(true);
        bench.back.set_dead(true);
        assert!(bench.zero_after() <= ms(50), "{pulled:?}");
        bench.pass(ms(500));
        assert_eq!(
            bench.heard,
            [Report::Lost("unplugged".to_owned())],
            "{pulled:?}, confirmed {confirmed}"
        );
        bench.latched();
        bench.there.set_dead(false);
        bench.back.set_dead(false);
        bench.host.connected(bench.now);
        bench.heard.clear();
        bench.until("return", |r| *r == Report::Ready);
        bench.play();
    }
}

/// The device loses its power at any time.
#[test]
fn a_restarted_device_is_noticed_and_used_again() {
    for after in (0..1200).step_by(37).map(ms) {
        let mut bench = Bench::new(Noise::default(), 5, 30);
        let begin = bench.now;
        bench.load();
        let mut played = false;
        while bench.now - begin < after {
            bench.step();
            if !played && bench.heard.contains(&Report::Loaded) {
                played = true;
                bench.host.start(bench.now).unwrap();
            }
        }
        bench.heard.clear();
        bench.firmware.reset(bench.now);
        assert_eq!(bench.firmware.held_n(), 0.0);
        bench.until("return", |r| *r == Report::Ready);
        bench.play();
    }
}

/// Damaged, lost, repeated, reordered and delayed frames: the force never exceeds its
/// limit, outcomes are correct, and with a long watchdog time most playbacks end
/// regularly.
#[test]
fn a_faulty_line_is_safe_and_usable() {
    let share = 0.01;
    let noise = Noise {
        corrupt: share,
        drop: share,
        duplicate: share,
        reorder: share,
        delay: share,
        extra_delay: ms(25),
        ..Noise::default()
    };
    let mut ended = 0;
    for seed in 0..12 {
        let mut bench = Bench::new(noise, seed, 200);
        bench.until("greeting", |r| *r == Report::Ready);
        let table = table();
        let what = Stimulus::of_table(&table);
        bench.host.load(&what, limits(), bench.now).unwrap();
        let (mut started, mut stopping) = (None, false);
        let until = bench.now + ms(6000);
        while bench.now < until {
            bench.step();
            assert!(bench.firmware.held_n().abs() <= 12.0);
            let reports = std::mem::take(&mut bench.heard);
            for report in reports {
                match report {
                    Report::Loaded => bench.host.start(bench.now).unwrap(),
                    Report::Started => started = Some(bench.now),
                    Report::Stopped(playback) => {
                        let lasted = (bench.now - started.unwrap()).as_secs_f64();
                        assert!(playback.exploration_s <= lasted + 0.3, "{playback:?}");
                        assert!(playback.exploration_s > 1.5, "{playback:?}");
                        ended += 1;
                    }
                    _ => {}
                }
            }
            if !stopping && started.is_some_and(|at| bench.now - at > ms(2000)) {
                stopping = true;
                bench.host.stop(bench.now).unwrap();
            }
        }
    }
    assert!(ended >= 8, "{ended} of 12");
}

/// A heartbeat that waits in a driver must not outlive its host for long.
#[test]
fn heartbeats_expire_40_ms_after_they_were_made() {
    let mut bench = Bench::new(Noise::default(), 9, 30);
    bench.play();
    let mut decoder = Decoder::new();
    let mut count = 0;
    for _ in 0..4000 {
        bench.sent.clear();
        bench.step();
        let device_ms = (bench.now.as_millis() as u32).wrapping_add(u32::MAX - 3000);
        for byte in &bench.sent {
            let Some(Ok(body)) = decoder.push(*byte) else {
                continue;
            };
            if let Ok((_, Request::Heartbeat(heartbeat))) = Request::decode(body) {
                let ahead_ms = heartbeat.deadline_ms.wrapping_sub(device_ms);
                assert!((38..=42).contains(&ahead_ms), "{ahead_ms} ms");
                count += 1;
            }
        }
    }
    assert!((95..=105).contains(&count), "{count} in a second");
}

/// Without a user interface that polls there are no heartbeats, so nothing is loaded.
#[test]
fn nothing_can_be_loaded_without_a_responding_screen() {
    let mut bench = Bench::new(Noise::default(), 10, 30);
    bench.screen = false;
    bench.pass(ms(500));
    bench.load();
    bench.until("refusal", |r| matches!(r, Report::Fault(_)));
    assert_eq!(bench.firmware.limit_n(), 0.0);

    // a screen that has never polled
    bench.host = Host::new(2, HostSettings::default());
    bench.host.connected(bench.now);
    bench.pass(ms(300));
    bench.heard.clear();
    bench.load();
    bench.until("refusal", |r| matches!(r, Report::Fault(_)));
    assert_eq!(bench.firmware.limit_n(), 0.0);
}

/// A deadline may be at most a second ahead, with any watchdog time.
#[test]
fn a_device_with_a_watchdog_time_of_a_second_can_play() {
    let mut bench = Bench::new(Noise::default(), 8, 1000);
    bench.play();
}

/// The device's clock is known to a millisecond, and its telemetry is complete.
#[test]
fn the_clock_is_estimated_and_the_telemetry_is_complete() {
    let mut bench = Bench::new(Noise::default(), 6, 30);
    bench.play();
    bench.pass(ms(12_000));
    bench.host.stop(bench.now).unwrap();
    bench.until(
        "stop",
        |r| matches!(r, Report::Stopped(p) if p.samples_lost == 0),
    );
    let health = bench.host.health();
    assert!(health.samples > 12_000);
    assert_eq!(health.samples_lost, 0);
    assert_eq!(health.bad_frames, 0);
    assert!(health.clock.drift_ppm().unwrap().abs() < 60.0);
    let device_ms = bench.now.as_millis() as u32;
    let device_ms = device_ms.wrapping_add(u32::MAX - 3000);
    let known_ms = health.clock.at(bench.now).unwrap();
    let off = known_ms.wrapping_sub(device_ms) as i32;
    assert!(off.abs() <= 1, "{off} ms");
}

/// What the line loses is counted, of the playback and in the health of the line.
#[test]
fn lost_samples_are_counted() {
    let noise = Noise {
        drop_telemetry: 0.1,
        ..Noise::default()
    };
    let mut bench = Bench::new(noise, 6, 30);
    bench.play();
    bench.pass(ms(4000));
    bench.host.stop(bench.now).unwrap();
    let lost = Cell::new(0);
    bench.until("stop", |r| match r {
        Report::Stopped(playback) => {
            lost.set(playback.samples_lost);
            true
        }
        _ => false,
    });
    assert!((100..1500).contains(&lost.get()), "{lost:?}");
    assert_eq!(bench.host.health().samples_lost, lost.get());
}
