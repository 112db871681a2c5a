//! How long a recording of a minute takes on the simulated probe.

use divan::{Bencher, black_box};
use study_haptics::plant::{Parameters, Probe};
use study_haptics::trajectory::{Trajectory, file};

fn main() {
    divan::main();
}

fn training() -> Trajectory {
    let text = include_str!("../protocols/turn-signal/training.toml");
    file::parse("training.toml", text).0.expect("it is shipped")
}

#[divan::bench(args = [1000.0, 10_000.0], sample_count = 5)]
fn a_recording_of_60_s(bencher: Bencher, rate_hz: f64) {
    let (trajectory, target) = (training(), Parameters::a());
    let probe = Probe::default();
    bencher.bench_local(|| probe.record(black_box(&trajectory), &target, rate_hz, 1));
}

#[divan::bench(sample_count = 5)]
fn a_check_of_60_s(bencher: Bencher) {
    let (trajectory, target) = (training(), Parameters::a());
    let probe = Probe::default();
    bencher.bench_local(|| probe.check(black_box(&trajectory), &target));
}
