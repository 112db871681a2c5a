//! Duration of an analysis and, separately, of reading its table.
//!
//! `cargo bench --bench analyze -- --write FILE SUBJECTS MODELS REPETITIONS` writes a
//! table for timing the whole program.

use std::io::{BufWriter, Write};
use study_analysis::analyze::{Rules, analyze};
use study_base::rng::Stream;
use study_session::outcome::ratings::Ratings;

fn main() -> std::io::Result<()> {
    let args: Vec<String> = std::env::args().collect();
    if let Some(at) = args.iter().position(|a| a == "--write") {
        let number = |i: usize| args.get(at + i).and_then(|n| n.parse().ok()).unwrap_or(3);
        let path = args.get(at + 1).map_or("bench.csv", String::as_str);
        let mut file = BufWriter::new(std::fs::File::create(path)?);
        table(&mut file, number(2), number(3), number(4))?;
        return file.flush();
    }
    divan::main();
    Ok(())
}

/// A table in long form with ratings from 1 to 7; subjects and realizations differ.
fn table(
    out: &mut impl Write,
    subjects: u32,
    models: u32,
    repetitions: u32,
) -> std::io::Result<()> {
    let mut noise = Stream::new(1, &["bench"]);
    writeln!(out, "subject,model,repetition,rating,vaf,trial_index")?;
    for s in 0..subjects {
        let bias = noise.normal();
        for trial in 0..models * repetitions {
            let (m, r) = (trial % models, trial / models);
            let level = 4.0 + bias * 0.5 + f64::from(m) * 0.3 + noise.normal();
            let rating = level.round().clamp(1.0, 7.0);
            let vaf = 0.7 + 0.03 * f64::from(m);
            writeln!(out, "S{s:06},m{m},{},{rating},{vaf},{}", r + 1, trial + 1)?;
        }
    }
    Ok(())
}

/// Subjects, realizations, repetitions.
type Size = (u32, u32, u32);

const SMALL: [Size; 3] = [(10, 5, 3), (100, 5, 3), (1000, 5, 3)];
const LARGE: [Size; 2] = [(100_000, 5, 3), (1000, 5, 300)];

fn csv((subjects, models, repetitions): Size) -> Vec<u8> {
    let mut csv = Vec::new();
    // Writing to memory does not fail.
    let _ = table(&mut csv, subjects, models, repetitions);
    csv
}

#[divan::bench(args = SMALL)]
fn read_and_analyze(bencher: divan::Bencher<'_, '_>, size: Size) {
    let csv = csv(size);
    bencher.bench(|| {
        let ratings = Ratings::read_csv("bench.csv", csv.as_slice(), None);
        ratings.map(|r| analyze(&r, &Rules::default()))
    });
}

#[divan::bench(args = LARGE, sample_count = 5, sample_size = 1)]
fn read_a_million_and_a_half(bencher: divan::Bencher<'_, '_>, size: Size) {
    let csv = csv(size);
    bencher.bench(|| Ratings::read_csv("bench.csv", csv.as_slice(), None));
}

#[divan::bench(args = LARGE, sample_count = 5, sample_size = 1)]
fn analyze_a_million_and_a_half(bencher: divan::Bencher<'_, '_>, size: Size) {
    let csv = csv(size);
    let Ok(ratings) = Ratings::read_csv("bench.csv", csv.as_slice(), None) else {
        return;
    };
    drop(csv);
    bencher.bench(|| analyze(&ratings, &Rules::default()));
}
