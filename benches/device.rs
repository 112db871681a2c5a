//! How long simulated playbacks take: 150 of 12 s are a study of 10 × 15 trials.

use divan::{Bencher, black_box};
use std::time::Duration;
use study::device::virtual_device::{Options, VirtualDevice};
use study::device::{Device, Report, Stimulus};
use study::limits::{Limit, Limits};
use study::model::predict::{Direction, Lookup};
use study::model::{Branch, Realization, Trained};
use study::rater::Impression;

fn main() {
    divan::main();
}

/// A table of the size and look-up of the paper's at dx = 1 mm.
fn realization() -> Realization {
    let x_mm: Vec<f64> = (2..=33).map(f64::from).collect();
    let branch = |friction: f64| Branch {
        m_kg: vec![0.05; x_mm.len()],
        b_n_s_per_mm: vec![0.01; x_mm.len()],
        k_n_per_mm: vec![0.0; x_mm.len()],
        f0_n: x_mm
            .iter()
            .map(|x| 6.0 * ((x - 5.0) / 12.5 * std::f64::consts::TAU).sin() + friction)
            .collect(),
    };
    Realization {
        id: "bench".to_owned(),
        provenance: Default::default(),
        vaf: Default::default(),
        lookup: Lookup::Linear,
        direction: Direction::Sign,
        trained: Trained {
            x_mm: [1.5, 33.5],
            v_mm_s: 138.0,
        },
        positive: branch(1.0),
        negative: branch(-1.0),
        x_mm,
    }
}

fn play(device: &mut VirtualDevice, realization: &Realization, since: Duration) -> usize {
    let limits = Limits {
        force_n: Limit::new(12.0).expect("positive"),
        velocity_mm_s: Limit::new(1000.0).expect("positive"),
    };
    let at = |ms| since + Duration::from_millis(ms);
    device
        .load(&Stimulus::of_table(realization), limits, at(0))
        .expect("a table");
    device.poll(at(40));
    device.start(at(40)).expect("loaded");
    let reports = device.poll(at(12_022));
    device.stop(at(12_022)).expect("playing");
    let telemetry = |report: &Report| match report {
        Report::Telemetry(samples) => samples.len(),
        _ => 0,
    };
    reports.iter().map(telemetry).sum::<usize>() + device.poll(at(12_100)).len()
}

#[divan::bench(sample_count = 10)]
fn a_playback_of_12_s(bencher: Bencher) {
    let realization = realization();
    bencher.bench_local(|| {
        let mut device = VirtualDevice::new(Options::default());
        play(&mut device, black_box(&realization), Duration::ZERO)
    });
}

#[divan::bench(sample_count = 3)]
fn a_study_of_150_playbacks(bencher: Bencher) {
    let realization = realization();
    bencher.bench_local(|| {
        let mut device = VirtualDevice::new(Options::default());
        (0..150)
            .map(|n| play(&mut device, &realization, Duration::from_secs(20 * n)))
            .sum::<usize>()
    });
}

#[divan::bench(sample_count = 10)]
fn an_impression(bencher: Bencher) {
    let realization = realization();
    Impression::of(&realization);
    bencher.bench_local(|| Impression::of(black_box(&realization)));
}
