//! How long an analysis takes inside the process, without reading files.

use study::analyze::{Rules, analyze};
use study::outcome::ratings::Ratings;
use study::rng::Stream;

fn main() {
    divan::main();
}

/// A long-form table of `subjects` × 5 realizations × 3 repetitions.
fn table(subjects: u32) -> String {
    let mut noise = Stream::new(1, &["bench"]);
    let mut csv = String::from("subject,model,repetition,rating,vaf,trial_index\n");
    for s in 0..subjects {
        let bias = noise.normal();
        for trial in 0..15 {
            let (m, r) = (trial % 5, trial / 5);
            let level = 4.0 + bias * 0.5 + f64::from(m) * 0.3 + noise.normal();
            let rating = level.round().clamp(1.0, 7.0);
            let vaf = 0.7 + 0.03 * f64::from(m);
            csv += &format!("S{s:06},m{m},{},{rating},{vaf},{}\n", r + 1, trial + 1);
        }
    }
    csv
}

#[divan::bench(args = [10, 100, 1000])]
fn read_and_analyze(bencher: divan::Bencher<'_, '_>, subjects: u32) {
    let csv = table(subjects);
    bencher.bench(|| {
        let ratings = Ratings::read_csv("bench.csv", csv.as_bytes(), None);
        ratings.map(|r| analyze(&r, &Rules::default()))
    });
}
