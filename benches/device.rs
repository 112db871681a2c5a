//! Run time of simulated playbacks: 150 playbacks of 12 s are a study of 10 × 15 trials.

use divan::{Bencher, black_box};
use std::num::NonZeroU16;
use std::time::Duration;
use study::rater::{Impression, Reference};
use study_base::limits::{Limit, Limits};
use study_device::firmware::{self, Firmware};
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, Report, Stimulus};
use study_haptics::model::{Branch, Realization, Trained};
use study_wire::message::{
    Commit, FixedVec, Heartbeat, Hello, Node, Play, Request, TableBegin, TableChunk, UploadCrc,
};
use study_wire::predict::{Direction, Lookup, Motion};
use study_wire::servo::{Law, Rendering, Servo, ServoSettings, ServoState};

fn main() {
    divan::main();
}

/// A table of the size and lookup of those of the paper, with dx = 1 mm.
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
        mechanism: None,
        elements: None,
        units: study_haptics::model::Units::Linear,
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

/// The same with the shipped mechanism of 67 values.
#[divan::bench(sample_count = 100)]
fn a_thousand_servo_steps_of_a_mechanism(bencher: Bencher) {
    let path = "protocols/turn-signal-passive/models/mechanism.toml";
    let text = std::fs::read_to_string(path).expect("the shipped file");
    let parsed = study_haptics::model::file::parse(path, &text).0;
    let realization = parsed.expect("a valid file");
    let what = study_device::rendering_of(&realization);
    servo_steps(bencher, &what);
}

/// Time of a thousand servo periods of a playback: table of 32 nodes, moving hand.
#[divan::bench(sample_count = 100)]
fn a_thousand_servo_steps(bencher: Bencher) {
    let realization = realization();
    let what = Rendering {
        law: Law::Table {
            table: realization.table(),
            rule: Direction::Play { delta_mm: 0.5 },
        },
        range_mm: realization.trained.x_mm,
        trained_mm_s: realization.trained.v_mm_s,
    };
    servo_steps(bencher, &what);
}

fn servo_steps(bencher: Bencher, what: &Rendering<'_>) {
    let motions: Vec<Motion> = (0..1000)
        .map(|i| {
            let phase = f64::from(i) * 1e-3 * std::f64::consts::TAU;
            Motion {
                x_mm: 17.5 + 14.0 * phase.sin(),
                v_mm_s: 88.0 * phase.cos(),
                a_m_s2: -0.55 * phase.sin(),
            }
        })
        .collect();
    let mut core = Servo::new(ServoSettings::default());
    core.start();
    bencher.bench_local(|| {
        let mut sum = 0.0;
        for motion in &motions {
            sum += core.step(black_box(what), black_box(*motion));
        }
        sum
    });
    assert_eq!(core.state(), ServoState::Playing);
}

/// The same with all tasks of a firmware: watchdog, telemetry frames at 1 kHz, simulated
/// hand.
#[divan::bench(sample_count = 100)]
fn a_thousand_periods_of_the_simulated_device(bencher: Bencher) {
    let mut host = Playing::new(&realization());
    bencher.bench_local(|| host.quarter_second());
    assert!(host.device.state().applies_force());
}

/// A host connected to a playing device.
struct Playing {
    device: Firmware,
    at: Duration,
    beats: u32,
    sequence: u16,
}

impl Playing {
    fn new(realization: &Realization) -> Self {
        let mut playing = Self {
            device: Firmware::new(firmware::Options::default()),
            at: Duration::from_millis(100),
            beats: 0,
            sequence: 0,
        };
        let table = realization.table();
        let begin = TableBegin {
            nodes: table.x_mm.len() as u16,
            lookup: realization.lookup,
            direction: Direction::Play { delta_mm: 0.5 },
            range_mm: realization.trained.x_mm,
            trained_mm_s: realization.trained.v_mm_s,
            force_n: 12.0,
            velocity_mm_s: 1000.0,
            uncertified_n: Some(12.0),
        };
        let branch =
            |b: &Branch, i: usize| [b.m_kg[i], b.b_n_s_per_mm[i], b.k_n_per_mm[i], b.f0_n[i]];
        let mut crc = UploadCrc::of_table(&begin);
        playing.say(Request::Hello(Hello { nonce: 1, minor: 1 }));
        playing.say(Request::TableBegin(begin));
        for i in 0..table.x_mm.len() {
            let node = Node {
                x_mm: table.x_mm[i],
                positive: branch(&realization.positive, i),
                negative: branch(&realization.negative, i),
            };
            crc.node(&node);
            playing.say(Request::TableChunk(TableChunk {
                first: i as u16,
                nodes: FixedVec::of(&[node]),
            }));
        }
        let crc = crc.value();
        playing.beat();
        playing.say(Request::TableCommit(Commit { crc }));
        playing.say(Request::Play(Play {
            playback: 1,
            crc,
            longest_ms: 600_000,
            every: NonZeroU16::new(4),
        }));
        playing
    }

    fn say(&mut self, request: Request) {
        self.sequence = self.sequence.wrapping_add(1);
        self.device
            .receive(request.frame(self.sequence).as_bytes(), self.at);
    }

    fn beat(&mut self) {
        self.beats += 1;
        self.say(Request::Heartbeat(Heartbeat {
            count: self.beats,
            deadline_ms: self.at.as_millis() as u32 + 40,
        }));
    }

    /// A thousand servo periods of 250 µs.
    fn quarter_second(&mut self) -> usize {
        for _ in 0..25 {
            self.beat();
            self.at += Duration::from_millis(10);
            self.device.advance(self.at);
        }
        self.device.take_output().len()
    }
}

#[divan::bench(sample_count = 10)]
fn an_impression(bencher: Bencher) {
    let realization = realization();
    let target = Reference::switch_b();
    bencher.bench_local(|| Impression::of(black_box(&realization), &target));
}
