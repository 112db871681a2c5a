//! Deadlines of the safety chain, in virtual time: host and simulated device with a
//! line of half a millisecond in between.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::time::Duration;
use study::device::firmware::{Firmware, Options};
use study::device::host::{Host, HostSettings, SUPERVISION_TIMEOUT};
use study::device::link::memory::{Line, Noise};
use study::device::{Report, Stimulus};
use study_base::limits::{Limit, Limits};
use study_haptics::model::{Branch, Realization, Trained};
use study_wire::message::{DeviceState, Fault};
use study_wire::predict::{Direction, Lookup};

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

/// 3 N everywhere: force as soon as it plays.
fn table() -> Realization {
    let nodes: Vec<f64> = (0..=7).map(|i| 5.0 * f64::from(i)).collect();
    let branch = Branch {
        m_kg: vec![0.0; nodes.len()],
        b_n_s_per_mm: vec![0.005; nodes.len()],
        k_n_per_mm: vec![0.0; nodes.len()],
        f0_n: vec![3.0; nodes.len()],
    };
    Realization {
        id: "push".to_owned(),
        provenance: Default::default(),
        vaf: Default::default(),
        lookup: Lookup::Linear,
        direction: Direction::Play { delta_mm: 0.5 },
        trained: Trained {
            x_mm: [1.5, 33.5],
            v_mm_s: 138.0,
        },
        x_mm: nodes,
        positive: branch.clone(),
        negative: branch,
    }
}

/// Host, line, device. What is not there any more is told by flags.
struct Bench {
    host: Host,
    firmware: Firmware,
    there: Line,
    back: Line,
    now: Duration,
    /// The host's process runs.
    runs: bool,
    /// The screen's loop turns.
    screen: bool,
    heard: Vec<Report>,
}

impl Bench {
    fn new(noise: Noise, seed: u64, watchdog_ms: u16) -> Self {
        let line = |name| Line::new(2 * TICK, noise, seed, name);
        let firmware = Firmware::new(Options {
            seed,
            watchdog_ms,
            // the clock wraps while it plays
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
        // a host that does not run leaves its bytes in the driver
        if self.runs {
            let came = self.back.arrived(self.now);
            if self.screen {
                self.host.keep_alive(self.now);
            }
            self.host.receive(&came, self.now);
            self.host.advance(self.now);
            self.there.send(self.host.take_output(), self.now);
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

    /// Zero force stays, whatever the host does; it only comes back by a new start.
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
fn a_host_that_is_killed_is_zero_force_within_50_ms_latched() {
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
    // and it is the heartbeat that holds it: not at once either
    assert!(worst >= ms(20), "{worst:?}");
}

/// Stopped and continued: what waits in the driver does not make it play on.
#[test]
fn a_host_that_is_stopped_and_continued_does_not_resume() {
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
fn a_screen_that_stalls_is_zero_force_within_150_ms_latched() {
    let mut worst = Duration::ZERO;
    for phase in phases() {
        let mut bench = Bench::new(Noise::default(), 3, 30);
        bench.play();
        bench.pass(phase);
        bench.screen = false;
        worst = worst.max(bench.zero_after());
        bench.screen = true;
        bench.latched();
        let told = bench.heard.iter().any(|r| matches!(r, Report::Fault(_)));
        assert!(told, "{:?}", bench.heard);
    }
    assert!(worst <= ms(150), "{worst:?}");
    assert!(
        worst >= SUPERVISION_TIMEOUT,
        "a screen may take its time: {worst:?}"
    );
}

/// At every millisecond from the load to long after the stop: zero force in time,
/// no outcome that the device did not confirm, and everything works again after.
#[test]
fn a_cable_that_is_pulled_at_any_moment() {
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

/// A device that loses its power in the middle, at any moment.
#[test]
fn a_device_that_starts_anew_is_noticed_and_used_again() {
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

/// Damage, loss, repetition, reordering and delay of single frames: the force is
/// never above its limit, no playback is confirmed that was not, and with a patient
/// watchdog most playbacks come to their end.
#[test]
fn a_bad_line_is_safe_and_usable() {
    let share = 0.01;
    let noise = Noise {
        corrupt: share,
        drop: share,
        duplicate: share,
        reorder: share,
        delay: share,
        extra_delay: ms(25),
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

/// A deadline may not be further ahead than a second, whatever the watchdog time.
#[test]
fn a_device_with_a_watchdog_of_a_second_can_be_armed() {
    let mut bench = Bench::new(Noise::default(), 8, 1000);
    bench.play();
}

/// The clock of the device is known to a millisecond, and its telemetry is whole.
#[test]
fn clock_and_telemetry_are_accounted_for() {
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
