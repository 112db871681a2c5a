//! Processor time of `study power`: the numbers in lab/measured.md.
//!
//! `cargo bench --bench power` simulates studies of 10 × 8 × 3 (participants × realizations
//! × repetitions) on one thread, as `study power` does: the headline tests by their closed
//! forms, and the verdict rule of the analysis. `lab/power-peers.R` times lmer and simr
//! beside it.
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::sync::OnceLock;
use std::time::Instant;
use study_analysis::power::{
    Assumptions, Cell, Scale, Settings, Test, Vaf, candidates, closed, reach, run_chunk,
};
use study_stats::power::covariate::Spread;

const STUDIES: u64 = 1000;

fn main() {
    let design = Cell {
        realizations: 8,
        repetitions: 3,
        participants: 10,
    };
    println!(
        "1,000 studies of 10 × 8 × 3, processor time, median of 9\n\n| tests | losses | ms |\n|---|---|---|"
    );
    let headline = [Test::Permutation, Test::Crossed];
    let all = [
        Test::Pearson,
        Test::Permutation,
        Test::Crossed,
        Test::Friedman,
    ];
    let rows: [(&str, &[Test], f64); 4] = [
        ("permutation, crossed", &headline, 0.0),
        ("pearson, permutation, crossed, friedman", &all, 0.0),
        ("verdict", &[Test::Verdict], 0.0),
        ("verdict", &[Test::Verdict], 0.02),
    ];
    for (name, tests, missing) in rows {
        let settings = settings(tests, missing);
        let time = median(|| {
            black_box(run_chunk(&settings, &design, 0));
        });
        println!(
            "| {name} | {} | {time:.1} |",
            if missing > 0.0 {
                "2 % of the trials"
            } else {
                "none"
            }
        );
    }
    let settings = settings(&headline, 0.0);
    let time = median(|| {
        for realizations in [5, 8, 12] {
            for repetitions in [1, 3] {
                for participants in [10, 20, 40] {
                    let cell = Cell {
                        realizations,
                        repetitions,
                        participants,
                    };
                    black_box(closed(&settings, &cell));
                }
                for target in [0.8, 0.9] {
                    black_box(reach(&settings, realizations, repetitions, target, 200));
                }
            }
        }
        black_box(candidates(
            &settings,
            &[(5, 1), (8, 3), (12, 3)],
            &[0.8, 0.9],
            200,
        ));
    });
    println!("\nclosed forms of 18 designs and their smallest designs: {time:.2} ms");
}

fn settings(tests: &[Test], missing: f64) -> Settings {
    Settings {
        assumptions: Assumptions {
            slope: 0.5,
            smallest: None,
            mean: 4.0,
            spread: Spread {
                subject: 0.6,
                realization: 0.5,
                interaction: 0.4,
                residual: 0.8,
                slope: 0.0,
            },
            scale: Scale::Rounded(1, 7),
            vaf: Vaf::Listed,
            dropout: 0.0,
            missing,
            reference: 0.0,
        },
        part: None,
        pilot: None,
        listed: vec![0.6, 0.65, 0.69, 0.72, 0.77, 0.81, 0.86, 0.9],
        tests: tests.to_vec(),
        alpha: 0.05,
        margin: None,
        seed: 2007,
        studies: STUDIES,
    }
}

/// Median processor time of nine runs in milliseconds.
fn median(mut run: impl FnMut()) -> f64 {
    run();
    let mut times: Vec<f64> = (0..9)
        .map(|_| {
            let before = processor_ms();
            run();
            processor_ms() - before
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[4]
}

/// Processor time of this thread so far, ms; where Linux does not tell it, the clock.
fn processor_ms() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let ns = text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok());
    ns.map_or_else(
        || START.get_or_init(Instant::now).elapsed().as_secs_f64() * 1e3,
        |ns| ns / 1e6,
    )
}
