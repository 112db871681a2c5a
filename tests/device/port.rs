//! The right device on a pseudo-terminal in real time: minutes, therefore on request.

use crate::rendering::{judged, shipped};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use study::device::firmware::{Firmware, Options};
use study::device::host::HostSettings;
use study::device::link::LinkedDevice;
use study::device::link::memory::Noise;
use study::device::link::pty::Simulator;
use study::device::serial::SerialOpener;
use study::device::{Device, Report, Stimulus};
use study_core::outcome::{Sample, Verdict};
use study_haptics::plant::HandParameters;

/// Plays for some seconds; the samples and the end, or why there is none.
fn play(
    device: &mut LinkedDevice,
    what: &Stimulus<'_>,
    limits: study_base::limits::Limits,
    seconds: f64,
) -> Result<(Vec<Sample>, study_core::outcome::Playback), String> {
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

/// Shipped tables, hands of different vigour, with and without a bad line, on a
/// pseudo-terminal: no playback is accused, also beside other programs. How many:
/// `STUDY_PLAYBACKS`; 50 take five minutes.
#[test]
#[ignore = "minutes: cargo test --release --test device port -- --ignored --nocapture"]
fn the_right_device_is_not_accused_on_a_port() {
    let asked = std::env::var("STUDY_PLAYBACKS").ok();
    let playbacks: u64 = asked.map_or(50, |n| n.parse().unwrap());
    let tables = shipped();
    let speeds = [[40.0, 200.0], [15.0, 50.0], [150.0, 400.0], [60.0, 120.0]];
    let mut counts: BTreeMap<Verdict, u32> = BTreeMap::new();
    let (mut accused, mut ended_early) = (Vec::new(), BTreeMap::<String, u32>::new());
    let mut late_ms: f64 = 0.0;
    for n in 0..playbacks {
        let (id, table, limits) = &tables[n as usize % tables.len()];
        let mut options = Options {
            seed: 500 + n,
            watchdog_ms: 200,
            ..Options::default()
        };
        options.hand = HandParameters {
            speed_mm_s: speeds[n as usize % speeds.len()],
            ..HandParameters::default()
        };
        let noise = match n % 2 {
            0 => Noise::default(),
            _ => Noise {
                byte_errors: 1e-4,
                drop_telemetry: 0.01,
                ..Noise::default()
            },
        };
        let mut simulator = Simulator::open(Firmware::new(options), noise, n, None).unwrap();
        let path = simulator.path().unwrap().to_owned();
        let over = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                simulator.step();
            }
        });
        let opener = Box::new(SerialOpener::new(&path, 460_800, None));
        let mut device = LinkedDevice::open(opener, HostSettings::default()).unwrap();
        let servo = device.identity().servo;
        match play(&mut device, &Stimulus::of_table(table), *limits, 4.0) {
            Err(why) => *ended_early.entry(why).or_default() += 1,
            Ok((samples, playback)) => {
                late_ms = late_ms.max(playback.host_late_ms.map_or(0.0, |[_, most]| most));
                let others: Vec<_> = (tables.iter())
                    .filter(|(other, own, _)| other != id && own.positive != table.positive)
                    .map(|(other, own, _)| (other.clone(), own.clone()))
                    .collect();
                let heard = crate::rendering::Heard {
                    samples,
                    playback: Some(playback),
                    servo,
                    failed: Vec::new(),
                };
                let found = judged(id, table, *limits, &heard, &others);
                *counts.entry(found.verdict).or_default() += 1;
                if matches!(found.verdict, Verdict::Flag | Verdict::Fault) {
                    accused.push(format!("{n} {id}: {found:?}"));
                }
            }
        }
        drop(device);
        over.store(true, Ordering::Relaxed);
        thread.join().unwrap();
    }
    println!(
        "{counts:?}; ended early {ended_early:?}; this computer late by up to {late_ms:.1} ms"
    );
    assert!(accused.is_empty(), "{accused:#?}");
    assert!(counts.get(&Verdict::Ok).copied().unwrap_or(0) > 0);
}
