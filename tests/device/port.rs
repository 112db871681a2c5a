//! The right device on a pseudo-terminal in real time: minutes, therefore on request.

use crate::accused::{Tally, bad_line, hand, others, playbacks};
use crate::rendering::{Heard, judged, shipped};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use study_device::firmware::{Firmware, Options, Wrong, WrongLoads};
use study_device::host::HostSettings;
use study_device::link::memory::Noise;
use study_device::link::simulator::{Simulator, Socket};
use study_device::link::{LinkedDevice, priority};
use study_device::serial::SerialOpener;
use study_device::{Device, Report, Stimulus};
use study_session::outcome::{Defect, Sample, Verdict};

/// Plays for some seconds; the samples and the end, or why there is none.
fn play(
    device: &mut LinkedDevice,
    what: &Stimulus<'_>,
    limits: study_base::limits::Limits,
    seconds: f64,
) -> Result<(Vec<Sample>, study_session::outcome::Playback), String> {
    let start = Instant::now();
    device.load(what, limits, start.elapsed()).unwrap();
    let (mut samples, mut stop_at) = (Vec::new(), None);
    while start.elapsed() < Duration::from_secs(60) {
        for report in device.poll(start.elapsed()) {
            match report {
                Report::Loaded => device.start(start.elapsed()).map_err(|e| e.to_string())?,
                Report::Started => {
                    stop_at = Some(start.elapsed() + Duration::from_secs_f64(seconds));
                }
                Report::Telemetry(more) => samples.extend(more),
                Report::Stopped(playback) => return Ok((samples, playback)),
                Report::Fault(why) | Report::Lost(why) => return Err(why),
                _ => {}
            }
        }
        if stop_at.take_if(|at| start.elapsed() >= *at).is_some() {
            device.stop(start.elapsed()).unwrap();
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Err("it takes too long".to_owned())
}

/// A simulated device on a pseudo-terminal, in a thread.
struct Served {
    path: String,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    fn start(options: Options, noise: Noise) -> Self {
        let seed = options.seed;
        let mut simulator = Simulator::open(
            Firmware::new(options),
            noise,
            seed,
            Socket::Pty { name: None },
        )
        .unwrap();
        let path = simulator.path().unwrap().to_owned();
        let over = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            priority::raise();
            while !ended.load(Ordering::Relaxed) {
                simulator.step();
            }
        });
        Self {
            path,
            over,
            thread: Some(thread),
        }
    }

    fn connect(&self) -> LinkedDevice {
        let opener = Box::new(SerialOpener::new(&self.path, 460_800, None));
        LinkedDevice::open(opener, HostSettings::default()).unwrap()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
    }
}

/// It stands still while this computer does something else: that says nothing of a clock.
#[test]
fn the_clock_of_a_simulated_device_on_a_port_is_not_judged() {
    let (id, table, limits) = &shipped()[0];
    let slow = Options {
        watchdog_ms: 900,
        wrong: Some(WrongLoads {
            wrong: Wrong::SlowClock,
            loads: [1, u32::MAX],
        }),
        ..Options::default()
    };
    let served = Served::start(slow, Noise::default());
    let mut device = served.connect();
    let servo = device.identity().servo;
    // a busy computer may miss heartbeats
    let mut tries = (0..5).map(|_| play(&mut device, &Stimulus::of_table(table), *limits, 2.5));
    let (samples, playback) = tries.find_map(Result::ok).unwrap();
    assert_eq!(playback.time_ratio, None);
    let heard = Heard {
        samples,
        playback: Some(playback),
        servo,
        failed: Vec::new(),
    };
    let found = judged(id, table, *limits, &heard, &[]);
    assert!(!found.defects.contains(&Defect::Clock), "{found:?}");
}

/// Shipped tables, hands of different vigour, with and without a bad line, on a
/// pseudo-terminal: no playback is accused, also beside other programs. How many:
/// `STUDY_PLAYBACKS`; 50 take five minutes.
#[test]
#[ignore = "minutes: cargo test --release --test device port -- --ignored --nocapture"]
fn the_right_device_is_not_accused_on_a_port() {
    // as the user interface of a session
    priority::raise_nice();
    let tables = shipped();
    let (mut tally, mut ended_early) = (Tally::default(), BTreeMap::<String, u32>::new());
    let mut late_ms: f64 = 0.0;
    for n in 0..playbacks(50) {
        let own = &tables[n % tables.len()];
        let (id, table, limits) = own;
        let mut options = Options {
            seed: 500 + n as u64,
            watchdog_ms: 200,
            ..Options::default()
        };
        // the slowest hand has no verdict
        options.hand = hand(n % 4);
        let noise = match n % 2 {
            0 => Noise::default(),
            _ => bad_line(),
        };
        let served = Served::start(options, noise);
        let mut device = served.connect();
        let servo = device.identity().servo;
        match play(&mut device, &Stimulus::of_table(table), *limits, 4.0) {
            Err(why) => *ended_early.entry(why).or_default() += 1,
            Ok((samples, playback)) => {
                late_ms = late_ms.max(playback.host_late_ms.map_or(0.0, |[_, most]| most));
                let heard = Heard {
                    samples,
                    playback: Some(playback),
                    servo,
                    failed: Vec::new(),
                };
                let found = judged(id, table, *limits, &heard, &others(own));
                tally.add(&format!("{n} {id}"), n % 4, &found);
            }
        }
    }
    println!("{tally}ended early {ended_early:?}; this computer late by up to {late_ms:.1} ms");
    assert!(tally.accused.is_empty(), "{:#?}", tally.accused);
    assert!(tally.of(Verdict::Ok) > 0);
}
